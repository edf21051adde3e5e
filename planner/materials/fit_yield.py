"""Fit a law that yields to specimens of a plastic material."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from planner.materials.characterise import Curve, MaterialCharacteristics, toe_compensated
from planner.materials.fit import Sample, sample_of
from planner.materials.laws import Yielding
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import LawParameters

__all__ = ["YieldFit", "by_symbol", "fit_yielding", "least_yielding", "logs"]


# ------------------------------------------------------------------------------------------------
# Modulus, flow stress, hardening and sharpness are fitted together to the curves, from the end of
# the toe to the break: what a plan asks of a law is its secant at a strain, behind the yield too.
# The modulus is the law's slope at rest, within a fifth of the one that `characterise` measures:
# that one is the slope of a part that is straight within 5 %, and so lies some 2 % below where the
# curve bends early. Held there, it pushed sharpness and hardening off by more than their intervals.
# All are sought in their logarithm within bounds, so that stress rises everywhere: a curve that
# falls behind its yield is run through in the middle, and the misfit says so.


_SHARPNESS = (0.5, 20.0)
"""Bounds of the sharpness. Chosen: below, the bend begins at rest and the modulus means nothing;
above, the knee is narrower than the points."""

_HARDENING = (0.01, 0.9)
"""Bounds of hardening strain over flow stress, and over the modulus. Chosen: stress rises by 1 % at
least over a strain of 1, so that a pulled bar has one answer; and bends at all."""

_MODULUS = 1.2
"""Factor about the measured modulus within which the law's is sought. Chosen: above what a linear
part's curvature, toe and noise move it by."""

_SHARPNESS_STARTS = (0.8, 2.0, 6.0)


_AT_BOUND = 0.01
"""Distance of ln(parameter) from its bound that counts as being there: the search keeps inside."""


@dataclass(frozen=True, slots=True, eq=False)
class YieldFit:
    """A fitted law, and those of the specimens by themselves.

    Attributes
    ----------
    own
        Each specimen's law.
    at_low, at_high
        Shape (4,), in the order of `Yielding`: whether the parameter of some specimen lies at its
        lower or upper bound, so that its test leaves that side open.
    sample
        What the law was fitted to.
    r2, nrmse
        Of the stresses at the fitted points.
    """

    law: Yielding
    own: tuple[Yielding, ...]
    at_low: BoolArray
    at_high: BoolArray
    sample: Sample
    r2: float
    nrmse: float

    @property
    def parameters(self) -> LawParameters:
        """The law as a palette file holds it."""
        return LawParameters(Yielding.model, MappingProxyType(by_symbol(logs(self.law))))


def fit_yielding(
    found: MaterialCharacteristics, curves: Sequence[Curve], *, weighting: str = "relative"
) -> YieldFit:
    """Fit a yielding law to each specimen by itself, and to all together, brought to one level.

    Parameters
    ----------
    found
        The specimens' characteristics, in the order of `curves`: their Young's moduli.
    weighting
        Of the residuals, as in `planner.materials.fit.sample_of`.
    """
    whole = [toe_compensated(curve) for curve in curves]
    moduli = [c.modulus_MPa for c in found.specimens]
    sample = sample_of(whole, weighting=weighting)
    own = [
        least_yielding(modulus, sample_of([curve], weighting=weighting))
        for modulus, curve in zip(moduli, whole, strict=True)
    ]
    sides = np.array([side for _, side in own])
    # Where one specimen breaks before the others the mean curve would jump to their level.
    strain = np.linspace(0.0, min(float(c.strain[-1]) for c in whole), 61)[1:]
    levels = np.array([np.log(one.nominal_stress_MPa(1.0 + strain)).mean() for one, _ in own])
    levelled = [
        replace(curve, stress_MPa=curve.stress_MPa * float(np.exp(levels.mean() - level)))
        for curve, level in zip(whole, levels, strict=True)
    ]
    law, _ = least_yielding(
        float(np.exp(np.mean(np.log(moduli)))), sample_of(levelled, weighting=weighting)
    )
    stress = law.nominal_stress_MPa(sample.stretch)
    error = stress - sample.stress_MPa
    largest = float(sample.stress_MPa.max())
    return YieldFit(
        law=law,
        own=tuple(one for one, _ in own),
        at_low=np.asarray((sides < 0).any(axis=0)),
        at_high=np.asarray((sides > 0).any(axis=0)),
        sample=sample,
        r2=1.0 - float(np.sum(error**2) / np.sum((sample.stress_MPa - _mean(sample)) ** 2)),
        nrmse=float(np.sqrt(np.sum(sample.weight * error**2))) / largest,
    )


_SYMBOLS = ("modulus_MPa", "flow_MPa", "hardening_MPa", "sharpness")


def logs(law: Yielding) -> FloatArray:
    """Return the logarithms of the parameters, shape (4,)."""
    return np.log([getattr(law, symbol) for symbol in _SYMBOLS])


def by_symbol(logs: FloatArray) -> dict[str, tuple[float, ...]]:
    """Return parameters by symbol; five digits, beyond which no test tells anything."""
    return {s: (float(f"{v:.5g}"),) for s, v in zip(_SYMBOLS, np.exp(logs).tolist(), strict=True)}


def _mean(sample: Sample) -> float:
    return float(sample.stress_MPa.mean())


def least_yielding(
    modulus_MPa: float, sample: Sample, *, ridge: float = 0.0
) -> tuple[Yielding, IntArray]:
    """Return the law of about this modulus whose weighted squares are least, from several starts.

    Of each parameter also -1 or 1 where it lies at its lower or upper bound, else 0. A ridge, the
    weight of the logarithms' distance from a start's, settles those that a curve leaves open.
    """
    from scipy.optimize import least_squares

    largest, strain = float(sample.stress_MPa.max()), float(sample.stretch.max()) - 1.0
    low, high = np.log(
        [
            (modulus_MPa / _MODULUS, modulus_MPa * _MODULUS),
            (0.05 * largest, 20.0 * largest),
            (_HARDENING[0] * largest, _HARDENING[1] * modulus_MPa / _MODULUS),
            _SHARPNESS,
        ]
    ).T

    def law_of(logs: FloatArray) -> Yielding:
        modulus, flow, hardening, sharpness = np.exp(logs).tolist()
        return Yielding(modulus, flow, hardening, sharpness)

    def residuals(logs: FloatArray) -> FloatArray:
        stress = law_of(logs).nominal_stress_MPa(sample.stretch)
        off = (stress - sample.stress_MPa) * sample.factor
        return np.append(off, ridge * (logs - starts[0])) if ridge else np.asarray(off)

    hardening = np.clip(0.05 * largest / strain, *np.exp([low[2], high[2]]))
    starts = [np.log([modulus_MPa, 0.9 * largest, hardening, n]) for n in _SHARPNESS_STARTS]
    best = min(
        (least_squares(residuals, start, bounds=(low, high)) for start in starts),
        key=lambda found: float(found.cost),
    )
    side = (best.x > high - _AT_BOUND).astype(np.int64) - (best.x < low + _AT_BOUND)
    return law_of(best.x), side
