"""Moisture: soaked elastomer swells and softens, saturating within about a day."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_SIZE = Parameter("softening", 0.02, 0.45, "softening of a saturated specimen")


def _uptake_of(setup: Setup, soak_h: FloatArray, values: Values) -> FloatArray:
    """Mass taken up over its saturation: Fick's law for a sheet, short and long times joined."""
    tau_h = values["saturation"] * (setup.thickness_mm / 3.0) ** 2
    return np.sqrt(1.0 - np.exp(-4.0 * soak_h / np.pi / tau_h))


def _fick(setup: Setup, values: Values) -> Setup:
    """Soften by the mass that a sheet has taken up."""
    taken = _uptake_of(setup, setup.soak_h, values)
    start = _uptake_of(setup, np.full_like(setup.soak_h, setup.reference.soak_h), values)
    drop = np.log1p(-values["softening"] * taken) - np.log1p(-values["softening"] * start)
    return setup.stiffened(setup.on_slices(drop))


def _root(setup: Setup, values: Values) -> Setup:
    """Soften by the root of the time until saturation, whatever the thickness."""
    full = values["saturation"]
    taken = np.tanh(np.sqrt(setup.soak_h / full))
    start = np.tanh(np.sqrt(setup.reference.soak_h / full))
    drop = np.log1p(-values["softening"] * taken) - np.log1p(-values["softening"] * start)
    return setup.stiffened(setup.on_slices(drop))


EFFECT = Effect(
    "moisture",
    "water uptake",
    "law",
    (
        Form(
            "fick",
            (
                _SIZE,
                Parameter("saturation", 1.0, 30.0, "time scale of 3 mm sheet", "h", log=True),
            ),
            _fick,
            "E = E0 (1 - s sqrt(1 - exp(-4 t / (pi tau)))), tau ~ thickness^2",
            "Crank, The Mathematics of Diffusion, 1975, ch. 4",
        ),
        Form(
            "root-time",
            (_SIZE, Parameter("saturation", 2.0, 100.0, "time of saturation", "h", log=True)),
            _root,
            "E = E0 (1 - s tanh(sqrt(t / t_s)))",
            "Crank, The Mathematics of Diffusion, 1975, ch. 4 (short times)",
        ),
    ),
    where=("soak_h", "thickness_mm"),
    covariates=("soak_h",),
)
