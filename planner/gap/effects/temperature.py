"""Temperature: mixtures soften through a glass transition that lies the higher the harder."""

import numpy as np
from scipy.special import expit

from planner.arrays import FloatArray
from planner.gap.effects.conditions_of_tests import condition, reference_condition
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.mixture_trend import PEAK, mixture_share, place_on_palette
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_BREADTH_K = 10.0
"""Logistic scale of the transition: 10 to 90 % within 44 K, as jetted elastomers show."""

_SLOPE = Parameter("slope", 0.003, 0.15, "fall of ln stress per kelvin", "1/K", log=True)


def _warmer_K(setup: Setup) -> FloatArray:
    """Kelvin above the reference, (P,)."""
    return condition(setup, "temperature_C") - reference_condition(setup, "temperature_C")


def _exponential(setup: Setup, values: Values) -> Setup:
    """All mixtures alike."""
    return setup.stiffened(setup.on_slices(-values["slope"] * _warmer_K(setup)))


def _graded_exponential(setup: Setup, values: Values) -> Setup:
    """One mixture most."""
    slope = values["slope"] * mixture_share(setup, values["peak"])
    return setup.stiffened(-slope * setup.on_slices(_warmer_K(setup)))


def _wlf(setup: Setup, values: Values) -> Setup:
    """Less and less per kelvin; below half the constant the tangent goes on."""
    warmer, constant = _warmer_K(setup), values["constant"]
    inside = np.maximum(warmer, -0.5 * constant)
    shift = inside / (1.0 + inside / constant) + 4.0 * (warmer - inside)
    slope = values["slope"] * mixture_share(setup, values["peak"])
    return setup.stiffened(-slope * setup.on_slices(shift))


def _transition(setup: Setup, values: Values) -> Setup:
    """From glass to rubber about a temperature that rises with the coordinate."""
    middle = values["transition"] + values["span"] * place_on_palette(setup)
    at = reference_condition(setup, "temperature_C")
    now = setup.on_slices(_warmer_K(setup)) + at
    passed = expit((now - middle) / _BREADTH_K) - expit((at - middle) / _BREADTH_K)
    return setup.stiffened(-values["drop"] * passed)


EFFECT = Effect(
    "temperature",
    "temperature",
    "law",
    (
        Form(
            "exponential",
            (_SLOPE,),
            _exponential,
            "ln stress -= b (T - T_ref)",
            "Reichl & Inman, Exp. Tech. 42, 2018, 19 (Objet Connex materials)",
        ),
        Form(
            "graded-exponential",
            (_SLOPE, PEAK),
            _graded_exponential,
            "ln stress -= b w(m) (T - T_ref)",
            "Reichl & Inman, Exp. Tech. 42, 2018, 19 (Objet Connex materials)",
        ),
        Form(
            "wlf",
            (
                _SLOPE,
                Parameter("constant", 30.0, 150.0, "the second WLF constant", "K", log=True),
                PEAK,
            ),
            _wlf,
            "ln stress -= b w(m) (T - T_ref) / (1 + (T - T_ref) / C2)",
            "Williams, Landel & Ferry, J. Am. Chem. Soc. 77, 1955, 3701",
        ),
        Form(
            "transition",
            (
                Parameter("drop", 0.2, 7.0, "of ln stress from glass to rubber", log=True),
                Parameter("transition", -10.0, 40.0, "temperature of the softest's", "°C"),
                Parameter("span", 0.0, 60.0, "how much higher the hardest's lies", "K"),
            ),
            _transition,
            "ln stress -= D (s(T) - s(T_ref)), s(T) = 1 / (1 + exp(-(T - T_g(m)) / 10 K))",
            "Mahieux & Reifsnider, Polymer 42, 2001, 3281",
        ),
    ),
    where=("temperature_C",),
    covariates=("temperature_C",),
)
