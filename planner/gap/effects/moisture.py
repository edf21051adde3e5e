"""Moisture: soaked elastomer swells and softens, saturating within about a day."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.conditions_of_tests import condition, reference_condition
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.mixture_trend import PEAK, mixture_share
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_SIZE = Parameter("softening", 0.02, 0.45, "softening of a saturated specimen")
_SHEET = Parameter("saturation", 1.0, 30.0, "time scale of 3 mm sheet", "h", log=True)


def _soaked_h(setup: Setup) -> tuple[FloatArray, FloatArray]:
    """Soaking of the tests and, as an array too, of the palette's own, (P,)."""
    soak_h = condition(setup, "soak_h")
    return soak_h, np.full_like(soak_h, reference_condition(setup, "soak_h"))


def _sheet_uptake(setup: Setup, soak_h: FloatArray, saturation_h: float) -> FloatArray:
    """Mass taken up over its saturation: Fick's law for a sheet, short and long times joined."""
    tau_h = saturation_h * (setup.thickness_mm / 3.0) ** 2
    return np.sqrt(-np.expm1(-4.0 * soak_h / np.pi / tau_h))


def _fick(setup: Setup, values: Values) -> Setup:
    """Soften by the mass that a sheet has taken up."""
    taken, start = (_sheet_uptake(setup, h, values["saturation"]) for h in _soaked_h(setup))
    size = values["softening"]
    return setup.stiffened(setup.on_slices(np.log1p(-size * taken) - np.log1p(-size * start)))


def _graded_fick(setup: Setup, values: Values) -> Setup:
    """Soften by the mass that a sheet has taken up, one mixture most."""
    taken, start = (
        setup.on_slices(_sheet_uptake(setup, h, values["saturation"])) for h in _soaked_h(setup)
    )
    size = values["softening"] * mixture_share(setup, values["peak"])
    return setup.stiffened(np.log1p(-size * taken) - np.log1p(-size * start))


def _root(setup: Setup, values: Values) -> Setup:
    """Soften by the root of the time until saturation, whatever the thickness."""
    taken, start = (np.tanh(np.sqrt(h / values["saturation"])) for h in _soaked_h(setup))
    size = values["softening"]
    return setup.stiffened(setup.on_slices(np.log1p(-size * taken) - np.log1p(-size * start)))


EFFECT = Effect(
    "moisture",
    "water uptake",
    "law",
    (
        Form(
            "fick",
            (_SIZE, _SHEET),
            _fick,
            "E = E0 (1 - s sqrt(1 - exp(-4 t / (pi tau)))), tau ~ thickness^2",
            "Crank, The Mathematics of Diffusion, 1975, ch. 4",
        ),
        Form(
            "graded-fick",
            (_SIZE, _SHEET, PEAK),
            _graded_fick,
            "E = E0 (1 - s w(m) sqrt(1 - exp(-4 t / (pi tau)))), tau ~ thickness^2",
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
