"""Ageing: curing goes on after the print and stiffens; some mixtures lose stiffness instead."""

import math

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.conditions_of_tests import condition, reference_condition
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.mixture_trend import PEAK, mixture_share
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_DECADE = Parameter("change", 0.01, 0.35, "of ln stress per decade of age", log=True, signed=True)


def _decades(setup: Setup, onset_days: float) -> FloatArray:
    """Decades of age beyond the reference, (P,), counted from a first change."""
    age, start = condition(setup, "age_days"), reference_condition(setup, "age_days")
    decades: FloatArray = np.log((age + onset_days) / (start + onset_days)) / math.log(10.0)
    return decades


def _log_time(setup: Setup, values: Values) -> Setup:
    """All mixtures alike."""
    return setup.stiffened(setup.on_slices(values["change"] * _decades(setup, values["onset"])))


def _graded_log_time(setup: Setup, values: Values) -> Setup:
    """One mixture most, from the first day on."""
    change = values["change"] * mixture_share(setup, values["peak"])
    return setup.stiffened(change * setup.on_slices(_decades(setup, 1.0)))


def _saturating(setup: Setup, values: Values) -> Setup:
    """To an end, as a reaction of first order."""
    age, start = condition(setup, "age_days"), reference_condition(setup, "age_days")
    gone = np.exp(-start / values["time"]) - np.exp(-age / values["time"])
    return setup.stiffened(setup.on_slices(values["change"] * gone))


EFFECT = Effect(
    "ageing",
    "ageing since the print",
    "law",
    (
        Form(
            "log-time",
            (_DECADE, Parameter("onset", 0.3, 30.0, "age of the first change", "days", log=True)),
            _log_time,
            "ln stress += a (log10(1 + t / t_0) - log10(1 + t_ref / t_0))",
            "Struik, Physical Aging in Amorphous Polymers and Other Materials, 1978",
        ),
        Form(
            "graded-log-time",
            (_DECADE, PEAK),
            _graded_log_time,
            "ln stress += a w(m) (log10(1 + t / 1 day) - log10(1 + t_ref / 1 day))",
            "Bass, Meisel & Williams, Rapid Prototyping J. 22, 2016, 826",
        ),
        Form(
            "saturating",
            (
                Parameter("change", 0.02, 0.6, "of ln stress in the end", log=True, signed=True),
                Parameter("time", 2.0, 600.0, "of the reaction", "days", log=True),
            ),
            _saturating,
            "ln stress += a (exp(-t_ref / tau) - exp(-t / tau))",
            "Bass, Meisel & Williams, Rapid Prototyping J. 22, 2016, 826",
        ),
    ),
    where=("age_days",),
    covariates=("age_days",),
)
