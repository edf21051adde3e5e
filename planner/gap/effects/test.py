"""Effects of the test: grips, frame, load cell and strain measurement."""

import math

import numpy as np

from planner.formats.units import QUANTITY_UNITS
from planner.gap.diagnosis import FoundEffect
from planner.gap.effect import Advice, Effect, Form, Parameter, Values, place_on_palette
from planner.numerics import FloatArray
from planner.simulation.bar_solver import Setup

__all__ = [
    "FORCE_OFFSET",
    "FORCE_SCALE",
    "GRIP_SLACK",
    "GRIP_SLIP",
    "MACHINE_COMPLIANCE",
    "STRAIN_SCALE",
]


# ------------------------------------------------------------------------------------------------
# What to do about them: what was printed is as predicted, what was read is not.


def _measure_anew(how: str) -> Advice:
    """Return the advice to mend the measurement."""

    def advice(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
        return (
            f"{found.id}: the print was right, the measurement was off ({found.text}); the "
            f"palette stays as it is: {how}, and diagnose again"
        )

    return advice


# ------------------------------------------------------------------------------------------------
# Force offset: the load cell was not zero when it should have been.


_OFFSET = Parameter("offset", 0.01, 0.4, "shown without load", "N", signed=True)
_WEIGHT = Parameter("offset", 0.4, 5.0, "shown without load", "N", signed=True)
_OFFSET_RARE = 0.2
"""How usual a grip's weight is, beside a zero that is a little off. Chosen: who tests, tares."""

_OFFSET_SOURCE = "ISO 376 (zero and drift of force-proving instruments)"


def _constant(setup: Setup, values: Values) -> Setup:
    """Throughout."""
    return setup.with_(offset_N=setup.offset_N + values["offset"])


def _drifting(setup: Setup, values: Values) -> Setup:
    """From zero, in proportion to time."""
    return setup.with_(offset_N=setup.offset_N + values["drift"] / 60.0 * setup.time_s)


def _fading(setup: Setup, values: Values) -> Setup:
    """Less and less, as a load cell warms up."""
    left = np.exp(-setup.time_s / values["time"])
    return setup.with_(offset_N=setup.offset_N + values["offset"] * left)


FORCE_OFFSET = Effect(
    "force-offset",
    "zero of force",
    "the load cell does not show zero when nothing pulls",
    "sensor",
    (
        Form("constant", (_OFFSET,), _constant, "shown = F + a", _OFFSET_SOURCE),
        Form(
            "untared",
            (_WEIGHT,),
            _constant,
            "shown = F + a, a grip's weight",
            _OFFSET_SOURCE,
            _OFFSET_RARE,
        ),
        Form(
            "drifting",
            (Parameter("drift", 0.01, 0.6, "of the zero", "N/min", signed=True),),
            _drifting,
            "shown = F + a t",
            _OFFSET_SOURCE,
        ),
        Form(
            "fading",
            (_OFFSET, Parameter("time", 3.0, 600.0, "of fading", "s")),
            _fading,
            "shown = F + a exp(-t / tau)",
            _OFFSET_SOURCE,
        ),
    ),
    where=("strain", "material", "specimen", "time"),
    changes=("section", "rate"),
    individual=0.35,
    advice=_measure_anew("zero the load cell before every test, or take the offset off the curves"),
)


# ------------------------------------------------------------------------------------------------
# Force scale: the load cell's gain, or a unit taken for another, of all or some specimens.


_SCALE_RARE = 0.1
"""How usual a wrong unit is, beside a gain that is a little off. Chosen: of ten faults of force
about one, for each unit."""

_UNITS = "Thompson & Taylor, NIST SP 811, 2008 (units)"
_FORCES_N = QUANTITY_UNITS["force"]


def _gained(setup: Setup, values: Values) -> Setup:
    """Scale what the load cell shows."""
    return setup.with_(gain=setup.gain * math.exp(values["log_gain"]))


def _unit(name: str, factor: float, meaning: str) -> Form:
    """Form of a known factor, 3 % to either side left for the load cell's own."""
    log = math.log(factor)
    size = Parameter("log_gain", log - 0.03, log + 0.03, meaning, signed=True, log=False)
    return Form(name, (size,), _gained, f"ln gain = +-ln {factor:.4g}", _UNITS, _SCALE_RARE)


FORCE_SCALE = Effect(
    "force-scale",
    "gain or unit of force",
    "the load cell shows a multiple of the true force: its gain, or a unit mixed up",
    "sensor",
    (
        Form(
            "gain",
            (Parameter("log_gain", 0.02, 0.5, "ln of shown over true force", signed=True),),
            _gained,
            "shown = F exp(a)",
            "ISO 7500-1 (verification of the force-measuring system)",
        ),
        _unit("pound-force", _FORCES_N["lbf"], "newtons shown as pounds-force or the reverse"),
        _unit(
            "kilogram-force", _FORCES_N["kgf"], "newtons shown as kilograms-force or the reverse"
        ),
        Form(
            "other-unit",
            (Parameter("log_gain", 0.5, 7.0, "ln of shown over true force", signed=True),),
            _gained,
            "shown = F exp(a), |a| up to ln 1100",
            _UNITS,
            _SCALE_RARE,
        ),
    ),
    where=("specimen", "batch"),
    changes=("section", "gauge"),
    some=True,
    advice=_measure_anew(
        "check the load cell's calibration and the unit of force, and divide the curves by the "
        "factor"
    ),
)


# ------------------------------------------------------------------------------------------------
# Grip slack: the crosshead moves before the specimen is taut.


_SIZE = Parameter("slack", 0.02, 2.0, "travel lost", "mm")
_SLACK_SOURCE = "ASTM D638, annex on toe compensation"


def _taken(
    travel_mm: FloatArray, slack_mm: float | FloatArray, sharpness: float = 4.0
) -> FloatArray:
    """Return the travel while it is well below the slack, the slack when it is well above.

    At 4 the corner is spread over about half the slack, as a grip does not close at once; at 1 the
    slack is taken up over many times its length.
    """
    ratio = np.maximum(travel_mm, 0.0) / np.maximum(slack_mm, 1e-12)
    taken: FloatArray = slack_mm * ratio * (1.0 + ratio**sharpness) ** (-1.0 / sharpness)
    return taken


def _dead_travel(setup: Setup, values: Values) -> Setup:
    """Lost first, and again on every way back."""
    return setup.with_(lost_mm=setup.lost_mm + _taken(setup.travel_mm, values["slack"]))


def _rounded(setup: Setup, values: Values) -> Setup:
    """Lost bit by bit, as strands are drawn taut one after the other."""
    taken = _taken(setup.travel_mm, values["slack"], values["sharpness"])
    return setup.with_(lost_mm=setup.lost_mm + taken)


def _seating(setup: Setup, values: Values) -> Setup:
    """Lost first and for good."""
    furthest = np.maximum.accumulate(setup.travel_mm, axis=1)
    return setup.with_(lost_mm=setup.lost_mm + _taken(furthest, values["slack"]))


def _taking_up(setup: Setup, values: Values) -> Setup:
    """Lost bit by bit over a further length."""
    slack = values["slack"]
    taken = -np.expm1(-np.maximum(setup.travel_mm, 0.0) / (slack + values["length"]))
    return setup.with_(lost_mm=setup.lost_mm + slack * taken)


_SOFTER = 0.1
"""Of the palette, over which grips go from one way of holding to the other. Chosen: less than from
one grade to the next."""


def _of_soft(setup: Setup, values: Values) -> Setup:
    """Lost first, by specimens softer than some mixture: clamped gently, they hang loosely."""
    mean = np.add.reduceat(place_on_palette(setup), setup.first_slice[:-1])
    mean /= np.diff(setup.first_slice)
    share = 0.5 - 0.5 * np.tanh((mean - values["until"]) / _SOFTER)
    slack_mm = values["slack"] * share[:, None]
    return setup.with_(lost_mm=setup.lost_mm + _taken(setup.travel_mm, slack_mm))


GRIP_SLACK = Effect(
    "grip-slack",
    "slack in the grips",
    "part of the travel is taken up before the specimen is pulled",
    "boundary",
    (
        Form(
            "dead-travel", (_SIZE,), _dead_travel, "lost = d s / (d^4 + s^4)^(1/4)", _SLACK_SOURCE
        ),
        Form(
            "rounded",
            (_SIZE, Parameter("sharpness", 1.0, 4.0, "of the corner")),
            _rounded,
            "lost = d s / (d^p + s^p)^(1/p)",
            _SLACK_SOURCE,
        ),
        Form(
            "seating",
            (_SIZE,),
            _seating,
            "lost = d s / (d^4 + s^4)^(1/4), d the furthest travel so far",
            _SLACK_SOURCE,
        ),
        Form(
            "taking-up",
            (_SIZE, Parameter("length", 0.1, 5.0, "over which it is taken up", "mm")),
            _taking_up,
            "lost = s (1 - exp(-d / (s + l)))",
            _SLACK_SOURCE,
        ),
        Form(
            "of-soft",
            (
                _SIZE,
                Parameter("until", 0.0, 1.0, "mixture, softest 0 to hardest 1", log=False),
            ),
            _of_soft,
            "lost = d s / (d^4 + s^4)^(1/4), of softer mixtures",
            _SLACK_SOURCE,
        ),
    ),
    where=("strain", "specimen", "gauge_mm", "material"),
    changes=("gauge", "cyclic"),
    individual=0.35,
    advice=_measure_anew("take the toe off the curves, or start at a small preload"),
)


# ------------------------------------------------------------------------------------------------
# Grip slip: under load the specimen creeps out of its grips, for good.


_LOAD_N = 20.0
"""At which slip is told where it grows as a power of the load. Convention: what coupons of 6 by 3
mm bear at a stress of 1 MPa."""


def _threshold(setup: Setup, values: Values) -> Setup:
    """In proportion to the load beyond what the grips hold."""
    return _slipping(setup, values["slip"], values["hold"], 1.0)


def _power(setup: Setup, values: Values) -> Setup:
    """From the first load on, ever faster."""
    power = values["power"]
    return _slipping(setup, values["slip"] * _LOAD_N**-power, 0.0, power)


def _slipping(setup: Setup, slip_mm_N: float, from_N: float, power: float) -> Setup:
    if slip_mm_N == 0.0:
        return setup
    return setup.with_(
        slip_mm_N=setup.slip_mm_N + slip_mm_N,
        slip_from_N=np.full_like(setup.slip_from_N, from_N),
        slip_power=np.full_like(setup.slip_power, power),
    )


GRIP_SLIP = Effect(
    "grip-slip",
    "slip in the grips",
    "the specimen creeps out of the grips as the load grows",
    "boundary",
    (
        Form(
            "threshold",
            (
                Parameter("slip", 0.003, 0.5, "per newton beyond the hold", "mm/N"),
                Parameter("hold", 0.3, 60.0, "load that the grips hold", "N"),
            ),
            _threshold,
            "lost = k max(F_max - F_0, 0)",
            "Coulomb friction: a grip holds up to a load",
        ),
        Form(
            "power",
            (
                Parameter("slip", 0.01, 3.0, "at 20 N", "mm"),
                Parameter("power", 1.0, 2.5, "of the load", log=False),
            ),
            _power,
            "lost = s (F_max / 20 N)^p",
            "ASTM D412: extension is not to be read from the grips, which slip",
        ),
    ),
    where=("strain", "material", "width_mm", "specimen"),
    changes=("section", "gauge", "cyclic"),
    individual=0.35,
    advice=_measure_anew("grip harder, or read the strain from the specimen, not from the grips"),
)


# ------------------------------------------------------------------------------------------------
# Machine compliance: frame, load cell and grips stretch with the specimen.


_STIFFEST_mm_N = 0.0005
"""The least compliance. Physical: a floor-standing frame of 2 kN/mm with load cell and grips."""

_CLOSING_N, _CLOSING = 15.0, 1.2
"""Load at which joints are half closed, and the deviation of its logarithm. Chosen: from small
grips for soft strips to wedge grips for a kilonewton."""


def _in_series(setup: Setup, values: Values) -> Setup:
    """Add a spring in series, and joints that give much at first and then close."""
    if values["compliance"] == 0.0:
        return setup
    joint_N = _CLOSING_N * math.exp(_CLOSING * values.get("closing", 0.0))
    return setup.with_(
        compliance_mm_N=setup.compliance_mm_N + values["compliance"],
        joint_share=np.full_like(setup.joint_share, values.get("joints", 0.0)),
        joint_N=np.full_like(setup.joint_N, joint_N),
    )


MACHINE_COMPLIANCE = Effect(
    "machine-compliance",
    "compliance of the machine",
    "the machine and the grips give way under load and take up travel",
    "boundary",
    (
        Form(
            "linear",
            (Parameter("compliance", _STIFFEST_mm_N, 0.1, "of machine and grips", "mm/N"),),
            _in_series,
            "lost = C F",
            "Kalidindi, Abusafieh & El-Danaf, Exp. Mech. 37, 1997, 210",
        ),
        Form(
            "stiffening",
            (
                Parameter("compliance", 0.5 * _STIFFEST_mm_N, 0.1, "with closed joints", "mm/N"),
                Parameter("joints", 0.3, 15.0, "compliance of open joints over that"),
            ),
            _in_series,
            "lost = C (F + k F_0 ln(1 + F / F_0)), F_0 15 N or as `closing` says",
            "Johnson, Contact Mechanics, 1985 (joints stiffen under load)",
            details=("closing",),
        ),
    ),
    where=("material", "strain", "width_mm", "gauge_mm"),
    changes=("section", "gauge"),
    advice=_measure_anew(
        "take compliance times force off the travel, or read the strain from the specimen"
    ),
)


# ------------------------------------------------------------------------------------------------
# Strain scale: the length that strains is not the gauge length, or travel is read wrongly.


_INCH = math.log(QUANTITY_UNITS["length"]["in"])


def _factor(setup: Setup, values: Values) -> Setup:
    """Scale the travel of all tests alike."""
    return setup.with_(travel_factor=setup.travel_factor * math.exp(values["log_factor"]))


def _ends(setup: Setup, values: Values) -> Setup:
    """Spread the travel over more than the gauge: the fillets strain as well."""
    share = setup.gauge_mm / (setup.gauge_mm + values["length"])
    return setup.with_(travel_factor=setup.travel_factor * share)


STRAIN_SCALE = Effect(
    "strain-scale",
    "gauge length or travel",
    "true strains are a multiple of the recorded ones: gauge length or travel",
    "boundary",
    (
        Form(
            "factor",
            (Parameter("log_factor", 0.01, 0.5, "ln of true over recorded strain", signed=True),),
            _factor,
            "strain = travel / gauge exp(a)",
            "ISO 37 (strain is measured between marks, not grips)",
        ),
        Form(
            "ends",
            (Parameter("length", 0.3, 20.0, "that strains beyond the gauge", "mm"),),
            _ends,
            "strain = travel / (gauge + l)",
            "ISO 37 (the fillets of a dumb-bell strain as well)",
        ),
        Form(
            "other-length",
            (Parameter("log_factor", 0.5, 1.5, "ln of true over recorded strain", signed=True),),
            _factor,
            "strain = travel / gauge exp(a), |a| up to ln 4.5",
            "ISO 37 (a length between other marks than was said)",
            weight=_SCALE_RARE,
        ),
        Form(
            "inch",
            (
                Parameter(
                    "log_factor",
                    _INCH - 0.03,
                    _INCH + 0.03,
                    "travel in inches taken for mm, or the reverse",
                    signed=True,
                    log=False,
                ),
            ),
            _factor,
            "ln factor = +-ln 25.4",
            "Thompson & Taylor, NIST SP 811, 2008 (units)",
            weight=_SCALE_RARE,
        ),
    ),
    where=("strain", "gauge_mm"),
    changes=("gauge", "section", "bars"),
    advice=_measure_anew("measure the gauge length that strains, and divide the travel by it"),
)
