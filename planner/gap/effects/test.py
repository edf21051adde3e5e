"""Effects of the test: grips, frame, load cell and strain measurement."""

import math

import numpy as np

from planner.gap.effect import Values, place_on_palette
from planner.numerics import FloatArray
from planner.simulation.bar_solver import Setup

# ------------------------------------------------------------------------------------------------
# Force offset: the load cell was not zero when it should have been.


def _left(setup: Setup, values: Values) -> FloatArray:
    """Return what is left of what passes as time goes on, (P, T); all, without such a time."""
    return np.asarray(np.exp(-setup.time_s / values.get("time", math.inf)))


def _offset(setup: Setup, values: Values) -> Setup:
    """Throughout, or less as a load cell warms up; or more and more since it was tared."""
    shown_N = values.get("offset", 0.0) * _left(setup, values)
    shown_N += values.get("drift", 0.0) / 60.0 * (setup.time_s + values.get("since", 0.0))
    return setup.with_(offset_N=setup.offset_N + shown_N)


# ------------------------------------------------------------------------------------------------
# Force scale: the load cell's gain, or a unit taken for another, of all or some specimens.


def _gained(setup: Setup, values: Values, *, grows: bool = False) -> Setup:
    """Scale what the load cell shows: throughout, until it is warm, or the more as it creeps."""
    left = _left(setup, values)
    share = 1.0 - left if grows else left
    return setup.with_(gain=setup.gain * np.exp(values["log_gain"] * share))


# ------------------------------------------------------------------------------------------------
# Grip slack: the crosshead moves before the specimen is taut.


_SHARPNESS = 4.0
"""Of the corner, where no form says. Chosen: it is spread over about half the slack, as a grip does
not close at once."""


def _taken(travel_mm: FloatArray, slack_mm: float | FloatArray, sharpness: float) -> FloatArray:
    """Return the travel while it is well below the slack, the slack when it is well above.

    At a sharpness of 1 the slack is taken up over many times its length.
    """
    ratio = np.maximum(travel_mm, 0.0) / np.maximum(slack_mm, 1e-12)
    return np.asarray(slack_mm * ratio * (1.0 + ratio**sharpness) ** (-1.0 / sharpness))


def _dead_travel(setup: Setup, values: Values, *, for_good: bool = False) -> Setup:
    """Lost first, and again on every way back; rounded, bit by bit as strands are drawn taut."""
    travel_mm = np.maximum.accumulate(setup.travel_mm, axis=1) if for_good else setup.travel_mm
    taken = _taken(travel_mm, values["slack"], values.get("sharpness", _SHARPNESS))
    return setup.with_(lost_mm=setup.lost_mm + taken)


def _taking_up(setup: Setup, values: Values) -> Setup:
    """Lost bit by bit over a further length."""
    slack = values["slack"]
    taken = -np.expm1(-np.maximum(setup.travel_mm, 0.0) / (slack + values["length"]))
    return setup.with_(lost_mm=setup.lost_mm + slack * taken)


def _of_soft(setup: Setup, values: Values) -> Setup:
    """Lost first, by specimens softer than some mixture: clamped gently, they hang loosely.

    Grips go from one way of holding to the other over less than the step between two grades.
    """
    beyond = setup.mean_of_tests(place_on_palette(setup)) - values["until"]
    share = 0.5 - 0.5 * np.tanh(beyond * len(setup.palette_coordinate))
    slack_mm = values["slack"] * share[:, None]
    return setup.with_(lost_mm=setup.lost_mm + _taken(setup.travel_mm, slack_mm, _SHARPNESS))


# ------------------------------------------------------------------------------------------------
# Grip slip: under load the specimen creeps out of its grips, for good.


_LOAD_N = 20.0
"""At which slip is told where it grows as a power of the load. Convention: what coupons of 6 by 3
mm bear at a stress of 1 MPa."""


def _slipping(setup: Setup, values: Values) -> Setup:
    """In proportion to the load beyond what the grips hold; or from the first load on, faster."""
    slip_mm_N, power = values["slip"], values.get("power", 1.0)
    if slip_mm_N == 0.0:
        return setup
    if "power" in values:
        slip_mm_N *= _LOAD_N**-power
    return setup.with_(
        slip_mm_N=setup.slip_mm_N + slip_mm_N,
        slip_from_N=np.full_like(setup.slip_from_N, values.get("hold", 0.0)),
        slip_power=np.full_like(setup.slip_power, power),
    )


# ------------------------------------------------------------------------------------------------
# Machine compliance: frame, load cell and grips stretch with the specimen.


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


# ------------------------------------------------------------------------------------------------
# Strain scale: the length that strains is not the gauge length, or travel is read wrongly.


def _factor(setup: Setup, values: Values) -> Setup:
    """Scale the travel of all tests alike."""
    return setup.with_(travel_factor=setup.travel_factor * math.exp(values["log_factor"]))


def _ends(setup: Setup, values: Values) -> Setup:
    """Spread the travel over more than the gauge: the fillets strain as well."""
    share = setup.gauge_mm / (setup.gauge_mm + values["length"])
    return setup.with_(travel_factor=setup.travel_factor * share)
