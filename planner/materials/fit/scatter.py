"""How far a print's stiffness may lie from its law's: specimens and misfit together."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from planner.materials.fit.law_fit import LawFit, law_stress_MPa
from planner.materials.fit.sample import RELATIVE_FLOOR, Sample

__all__ = ["ASSUMED_LOG_SD", "Scatter", "scatter_of_fit", "scatter_of_moduli"]

ASSUMED_LOG_SD = 0.05
"""Taken between specimens where only one was tested: replicates of PolyJet elastomers scatter by
1 to 9 %."""


@dataclass(frozen=True, slots=True)
class Scatter:
    """Standard deviations of ln(stiffness).

    Attributes
    ----------
    specimens
        How many were tested.
    between
        Between specimens; `ASSUMED_LOG_SD` for a single one.
    misfit
        Root mean square of the law's error along the curve, once each specimen's own level is
        taken out.
    log_sd
        For the next print: its 95 % range is ``exp(+-1.96 log_sd)``. Few specimens are accounted
        for by Student's t, and the mean's own error by 1 + 1/n.
    """

    specimens: int
    between: float
    misfit: float
    log_sd: float


def scatter_of_fit(fit: LawFit, sample: Sample) -> Scatter:
    """Compare each specimen's stress with the law's, as logarithms of their ratio."""
    law = law_stress_MPa(fit.law, fit.a, fit.c, sample.stretch)
    floor = RELATIVE_FLOOR * sample.stress_MPa.max()
    used = (sample.stress_MPa > floor) & (law > floor)
    ratio = np.log(np.where(used, sample.stress_MPa, 1.0) / np.where(used, law, 1.0))
    own = [ratio[used & (sample.specimen == n)] for n in np.unique(sample.specimen)]
    levels = [float(r.mean()) for r in own if len(r)]
    within = np.sqrt(np.mean([r.var() for r in own if len(r)])) if levels else 0.0
    return _scatter(levels, float(within))


def scatter_of_moduli(moduli_MPa: Sequence[float]) -> Scatter:
    """Return the scatter of specimens' own moduli, all above zero."""
    return _scatter([float(v) for v in np.log(np.asarray(moduli_MPa))], 0.0)


def _scatter(levels: Sequence[float], misfit: float) -> Scatter:
    from scipy.stats import t as student

    count = len(levels)
    if count < 2:
        spread = ASSUMED_LOG_SD
        return Scatter(count, spread, misfit, float(np.hypot(spread * np.sqrt(2.0), misfit)))
    between = float(np.std(levels, ddof=1))
    widened = float(student.ppf(0.975, count - 1)) / NormalDist().inv_cdf(0.975)
    predictive = between * widened * np.sqrt(1.0 + 1.0 / count)
    return Scatter(count, between, misfit, float(np.hypot(predictive, misfit)))
