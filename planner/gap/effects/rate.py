"""Rate: elastomers are stiffer when strained faster, and relax when held."""

import math

import numpy as np
from scipy.special import rgamma

from planner.arrays import FloatArray
from planner.gap.effects.conditions_of_tests import condition, reference_condition
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.mixture_trend import PEAK, mixture_share
from planner.gap.forward.setup import RELAXATION_TIMES_s, Setup

__all__ = ["EFFECT", "REFERENCE_STRAIN"]

REFERENCE_STRAIN = 0.15
"""Strain at which a relaxing law has the palette's stress, pulled at the reference's rate."""

_LOG10_TIMES: FloatArray = np.log10(RELAXATION_TIMES_s)
_TIME_STEP = float(np.log(RELAXATION_TIMES_s[1] / RELAXATION_TIMES_s[0]))

_RISE = Parameter("rise", 0.02, 0.8, "of ln stress per decade of strain rate", log=True)
_SHARE = Parameter("share", 0.04, 0.8, "of the instantaneous stress that relaxes", log=True)
_CENTRE = Parameter("centre", 0.05, 2000.0, "middle of the relaxation times", "s", log=True)


def _decades(setup: Setup) -> FloatArray:
    """Decades of strain rate above the reference, (P,)."""
    return np.log10(condition(setup, "rate_per_s") / reference_condition(setup, "rate_per_s"))


def _power(setup: Setup, values: Values) -> Setup:
    """All mixtures alike."""
    return setup.stiffened(setup.on_slices(values["rise"] * _decades(setup)))


def _graded_power(setup: Setup, values: Values) -> Setup:
    """One mixture most."""
    rise = values["rise"] * mixture_share(setup, values["peak"])
    return setup.stiffened(rise * setup.on_slices(_decades(setup)))


def _ramp_average(setup: Setup) -> FloatArray:
    """Mean of each exponential over the palette's own pull up to `REFERENCE_STRAIN`, (K,)."""
    rests = REFERENCE_STRAIN / reference_condition(setup, "rate_per_s") / RELAXATION_TIMES_s
    return -np.expm1(-rests) / rests


def _relaxing(setup: Setup, spectrum: FloatArray) -> Setup:
    """Add shares that relax, (S, K) or (K,), the stress in the palette's own pull kept.

    Pulled evenly, a linear law shows 1 - sum g (1 - mean of the exponential) of its
    instantaneous stress.
    """
    kept = 1.0 - spectrum @ (1.0 - _ramp_average(setup))
    return setup.with_(
        relaxing=setup.relaxing + spectrum, log_factor=setup.log_factor - np.log(kept)
    )


def _spectrum(centre_s: float, breadth: float) -> FloatArray:
    """Parts of a whole, log-normal over the relaxation times, (K,)."""
    weights = np.exp(-0.5 * ((_LOG10_TIMES - math.log10(centre_s)) / breadth) ** 2)
    return weights / float(np.sum(weights))


def _prony(setup: Setup, values: Values) -> Setup:
    """All mixtures relax alike."""
    return _relaxing(setup, values["share"] * _spectrum(values["centre"], values["breadth"]))


def _graded_prony(setup: Setup, values: Values) -> Setup:
    """One mixture relaxes most, over two decades of time."""
    share = values["share"] * mixture_share(setup, values["peak"])
    return _relaxing(setup, share[:, None] * _spectrum(values["centre"], 1.0))


def _fractional(setup: Setup, values: Values) -> Setup:
    """Relax as (1 + t/onset)^-n: its spectrum's integral over ln time as a sum."""
    n = values["exponent"] * mixture_share(setup, values["peak"])[:, None]
    rates = values["onset"] / RELAXATION_TIMES_s
    density = rgamma(n) * np.exp(n * np.log(rates) - rates)
    return _relaxing(setup, density * _TIME_STEP)


EFFECT = Effect(
    "rate",
    "strain rate and relaxation",
    "law",
    (
        Form(
            "power-law",
            (_RISE,),
            _power,
            "ln stress += a log10(rate / reference)",
            "G'Sell & Jonas, J. Mater. Sci. 14, 1979, 583",
        ),
        Form(
            "graded-power-law",
            (_RISE, PEAK),
            _graded_power,
            "ln stress += a w(m) log10(rate / reference)",
            "Slesarenko & Rudykh, Int. J. Eng. Sci. 123, 2018, 62",
        ),
        Form(
            "prony",
            (_SHARE, _CENTRE, Parameter("breadth", 0.5, 2.0, "of the times", "decade", log=True)),
            _prony,
            "G(t) = 1 - g sum p_k (1 - exp(-t / tau_k)), p log-normal",
            "Fung, Biomechanics, 1981, ch. 7 (quasi-linear viscoelasticity)",
        ),
        Form(
            "graded-prony",
            (_SHARE, _CENTRE, PEAK),
            _graded_prony,
            "G(t) = 1 - g w(m) sum p_k (1 - exp(-t / tau_k)), p log-normal of 1 decade",
            "Fung, Biomechanics, 1981, ch. 7; Slesarenko & Rudykh, Int. J. Eng. Sci. 123, 2018, 62",
        ),
        Form(
            "fractional",
            (
                Parameter("exponent", 0.008, 0.3, "of the decay", log=True),
                Parameter("onset", 0.02, 5.0, "time from which it decays", "s", log=True),
                PEAK,
            ),
            _fractional,
            "G(t) = (1 + t / t_0)^(-n w(m)), as exponentials",
            "Bagley & Torvik, J. Rheol. 27, 1983, 201",
        ),
    ),
    where=("rate_mm_s", "time", "branch"),
    covariates=("rate_mm_s|hold",),
)
