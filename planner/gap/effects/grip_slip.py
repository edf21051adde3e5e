"""Grip slip: under load the specimen creeps out of its grips, for good."""

import numpy as np

from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_LOAD_N = 20.0
"""At which slip is told where it grows as a power of the load."""


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


EFFECT = Effect(
    "grip-slip",
    "slip in the grips",
    "boundary",
    (
        Form(
            "threshold",
            (
                Parameter("slip", 0.003, 0.5, "per newton beyond the hold", "mm/N", log=True),
                Parameter("hold", 0.3, 60.0, "load that the grips hold", "N", log=True),
            ),
            _threshold,
            "lost = k max(F_max - F_0, 0)",
            "Coulomb friction: a grip holds up to a load",
        ),
        Form(
            "power",
            (
                Parameter("slip", 0.01, 3.0, "at 20 N", "mm", log=True),
                Parameter("power", 1.0, 2.5, "of the load"),
            ),
            _power,
            "lost = s (F_max / 20 N)^p",
            "ASTM D412: extension is not to be read from the grips, which slip",
        ),
    ),
    where=("strain", "material", "width_mm", "specimen"),
    individual=0.35,
)
