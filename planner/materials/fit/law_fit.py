"""Fit one law to one material's specimens, and say how well and how surely."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from planner.arrays import FloatArray
from planner.materials.fit.sample import Sample
from planner.materials.fit.separable import SeparableLaw
from planner.materials.fit.varpro import Held, Solutions, minimise, spread_starts
from planner.palette import LawParameters

__all__ = ["STARTS", "Convergence", "LawFit", "fit_law", "law_stress_MPa"]

STARTS = 50
AGREEMENT = 1e-3
"""Starts agree when their costs differ by less than this share."""

ROUGH = 1e-5
"""Gain per step, as a share of the cost, at which a search is left; the lowest go on."""

POLISHED = 5

SIGNIFICANT_DIGITS = 5
"""Nonlinear parameters are rounded to this and the coefficients solved anew: what lies beyond
is neither determined by tests nor the same on every processor."""


@dataclass(frozen=True, slots=True)
class Convergence:
    """How a multi-start search ended.

    Attributes
    ----------
    starts, converged, agreeing
        Starts made; how many converged; how many ended within `AGREEMENT` of the lowest cost.
    gradient
        Of the best start: largest cosine between the residual and a direction of search.
    at_bound
        Whether a nonlinear parameter of the best lies at its bound.
    """

    starts: int
    converged: int
    agreeing: int
    gradient: float
    iterations: int
    at_bound: bool

    @property
    def ok(self) -> bool:
        """Whether the best start converged and, with several starts, another one agrees."""
        return self.converged > 0 and self.agreeing >= min(2, self.starts)


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """A fitted law.

    Attributes
    ----------
    parameters
        As a palette file holds them.
    a, c
        Nonlinear parameters (q,) and the law's coefficients (p,) in file terms.
    cost
        Mean square of the residual over its scale; see `Sample`.
    objective
        What was minimised: the cost with the ridge's part; see `planner.materials.fit.varpro`.
    r2, adjusted_r2
        Of nominal stress, each specimen with equal weight. The adjustment counts the resampled
        points, which are correlated: it flatters, and is no criterion of choice.
    nrmse
        Root mean square error over the largest stress.
    """

    law: SeparableLaw
    parameters: LawParameters
    a: FloatArray
    c: FloatArray
    cost: float
    objective: float
    r2: float
    adjusted_r2: float
    nrmse: float
    convergence: Convergence

    @property
    def name(self) -> str:
        """The model with its number of terms where there is a choice, as "ogden-2"."""
        terms = f"-{self.law.columns}" if self.law.model == "ogden" else ""
        return f"{self.law.model}{terms}"

    @property
    def parameter_count(self) -> int:
        """Number of fitted parameters."""
        return self.law.columns + self.law.nonlinear


def fit_law(
    law: SeparableLaw,
    sample: Sample,
    *,
    starts: int = STARTS,
    shift: float = 0.5,
    also: FloatArray | None = None,
) -> LawFit:
    """Fit a law by multi-start variable projection.

    Parameters
    ----------
    starts
        Number of starts spread over the bounds.
    shift
        Moves the pattern of starts; see `spread_starts`.
    also
        Further starts, shape (k, q).
    """
    spread = spread_starts(law, sample, starts, shift)
    if also is not None and law.nonlinear:
        spread = np.concatenate([spread, also])
    rough = minimise(law, sample, spread, flat=ROUGH)
    lowest = np.argsort(rough.cost, kind="stable")[:POLISHED]
    found = minimise(law, sample, rough.a[lowest])
    best = _best(found)
    a = _significant(np.sort(found.a[best]) if law.model == "ogden" else found.a[best])
    held = Held(np.ones((1, law.nonlinear), dtype=bool), np.full((1, law.columns), np.nan))
    final = minimise(law, sample, a[None], held)
    a = final.a[0]
    c = final.c[0] / law.divisor(final.a)[0][0]
    residual = law_stress_MPa(law, a, c, sample.stretch) - sample.stress_MPa
    mean = sample.weight @ sample.stress_MPa
    error = float(sample.weight @ residual**2)
    r2 = 1.0 - error / float(sample.weight @ (sample.stress_MPa - mean) ** 2)
    count, used = len(sample.stretch), law.columns + law.nonlinear
    low, high = law.bounds(float(sample.stretch.max())).T
    return LawFit(
        law=law,
        parameters=LawParameters(law.model, MappingProxyType(law.parameters(a, c))),
        a=a,
        c=c,
        cost=float(((sample.factor * residual) ** 2).sum()),
        objective=float(final.cost[0]),
        r2=r2,
        adjusted_r2=1.0 - (1.0 - r2) * (count - 1) / max(count - used - 1, 1),
        nrmse=float(np.sqrt(error) / sample.stress_MPa.max()),
        convergence=Convergence(
            starts=len(spread),
            converged=int(rough.converged.sum()),
            agreeing=int((rough.cost <= found.cost[best] * (1.0 + AGREEMENT)).sum()),
            gradient=float(found.gradient[best]),
            iterations=int(rough.iterations.max() + found.iterations[best]),
            at_bound=bool(np.any((a <= low * (1 + 1e-9)) | (a >= high * (1 - 1e-9))))
            if law.model != "ogden"
            else bool(np.any(np.abs(a) >= high - 1e-6)),
        ),
    )


def law_stress_MPa(
    law: SeparableLaw, a: FloatArray, c: FloatArray, stretch: FloatArray
) -> FloatArray:
    """Return nominal stress of a law with nonlinear parameters a (q,), file coefficients c (p,)."""
    phi, _ = law.evaluate(stretch, a[None])
    out: FloatArray = phi[0] @ (c * law.divisor(a[None])[0][0])
    return out


def _best(found: Solutions) -> int:
    """Return the start with the lowest cost; among equal ones that with the smallest exponents.

    Where a law has more terms than the tests determine, different parameters reach one cost.
    """
    equal = np.flatnonzero(found.cost <= found.cost.min() * (1.0 + 1e-6) + 1e-30)
    return int(equal[np.argmin(np.round(np.abs(found.a[equal]).sum(axis=1), 4))])


def _significant(values: FloatArray) -> FloatArray:
    return np.array([float(f"{v:.{SIGNIFICANT_DIGITS}g}") for v in values])
