"""Force offset: the load cell was not zero when it should have been."""

import numpy as np

from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_OFFSET = Parameter("offset", 0.01, 0.4, "shown without load", "N", log=True, signed=True)
_WEIGHT = Parameter("offset", 0.4, 5.0, "shown without load", "N", log=True, signed=True)
RARE = 0.2
_SOURCE = "ISO 376 (zero and drift of force-proving instruments)"


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


EFFECT = Effect(
    "force-offset",
    "zero of force",
    "sensor",
    (
        Form("constant", (_OFFSET,), _constant, "shown = F + a", _SOURCE),
        Form("untared", (_WEIGHT,), _constant, "shown = F + a, a grip's weight", _SOURCE, RARE),
        Form(
            "drifting",
            (Parameter("drift", 0.01, 0.6, "of the zero", "N/min", log=True, signed=True),),
            _drifting,
            "shown = F + a t",
            _SOURCE,
        ),
        Form(
            "fading",
            (_OFFSET, Parameter("time", 3.0, 600.0, "of fading", "s", log=True)),
            _fading,
            "shown = F + a exp(-t / tau)",
            _SOURCE,
        ),
    ),
    where=("strain", "material", "specimen", "time"),
    individual=0.35,
)
