"""Force scale: the load cell's gain, or a unit taken for another, of all or some specimens."""

import math

from planner.gap.effects.effect import Apply, Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

RARE = 0.1
"""How usual a wrong unit is, beside a gain that is a little off."""

_UNITS = "Thompson & Taylor, NIST SP 811, 2008 (units)"


def _gained(setup: Setup, values: Values) -> Setup:
    """Scale what the load cell shows."""
    return setup.with_(gain=setup.gain * math.exp(values["log_gain"]))


def _unit(name: str, factor: float, meaning: str) -> Form:
    """Form of a known factor, 3 % to either side left for the load cell's own."""
    log = math.log(factor)
    size = Parameter("log_gain", log - 0.03, log + 0.03, meaning, signed=True)
    apply: Apply = _gained
    return Form(name, (size,), apply, f"ln gain = +-ln {factor:.4g}", _UNITS, RARE)


EFFECT = Effect(
    "force-scale",
    "gain or unit of force",
    "sensor",
    (
        Form(
            "gain",
            (
                Parameter(
                    "log_gain", 0.02, 0.5, "ln of shown over true force", log=True, signed=True
                ),
            ),
            _gained,
            "shown = F exp(a)",
            "ISO 7500-1 (verification of the force-measuring system)",
        ),
        _unit("pound-force", 4.4482216, "newtons shown as pounds-force or the reverse"),
        _unit("kilogram-force", 9.80665, "newtons shown as kilograms-force or the reverse"),
        Form(
            "other-unit",
            (
                Parameter(
                    "log_gain", 0.5, 7.0, "ln of shown over true force", log=True, signed=True
                ),
            ),
            _gained,
            "shown = F exp(a), |a| up to ln 1100",
            _UNITS,
            RARE,
        ),
    ),
    where=("specimen", "batch"),
    some=True,
)
