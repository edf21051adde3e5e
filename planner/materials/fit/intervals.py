"""Intervals of fitted parameters that know that points along one curve are not independent.

The profile of the cost over one parameter gives the interval's shape, skewed or open as it may
be; how far the cost may rise is set by the scatter between specimens (the adjustment of a
clustered likelihood by R. Chandler and S. Bate 2007): Student's t with one degree of freedom
fewer than specimens, squared, times the ratio of the parameter's variance between specimens (the
linearised jackknife, one specimen left out in turn) to the one that independent points would
have. For a law that is linear in its parameter and specimens of equal sampling that is the t
interval of the specimens' own estimates.
"""

from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.materials.fit.law_fit import LawFit
from planner.materials.fit.sample import Sample
from planner.materials.fit.varpro import Held, minimise

__all__ = ["Intervals", "intervals"]

ROUNDS = 14
"""Secant steps towards the profile's crossing; each refits the other parameters."""

CLOSE = 0.02
"""Relative error of the crossing's distance at which the search ends."""

FLOOR = 1e-10
"""Added to the normal matrix of unit columns: directions without information stay finite."""


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Two-sided intervals of a fit's parameters.

    Attributes
    ----------
    a, c
        Low and high, shapes (q, 2) and (p, 2), in the file's terms; infinite where the tests
        leave a side open, for the profile meets the law's bound first (zero below, for a
        parameter that is positive).
    level
        Nominal coverage.
    profiled
        Shape (q + p,): true where the profile gives the interval, false where Student's t does.
    basis
        "specimens" or "one specimen": the latter leaves out the scatter between specimens.
    independent_points
        How many independent points the curve of a single specimen counts for; None otherwise.
    """

    a: FloatArray
    c: FloatArray
    level: float
    profiled: BoolArray
    basis: str
    independent_points: float | None


def intervals(fit: LawFit, sample: Sample, level: float = 0.95) -> Intervals:
    """Return intervals of all parameters of a fit.

    Nonlinear parameters are profiled, and so is the coefficient beside a single one.
    Coefficients of linear laws have Student's interval, which is their profile's; those of laws
    with several nonlinear terms too, for their profiles have many branches, of which no search
    finds the lowest reliably.
    """
    from scipy.stats import t as student

    q, p = fit.law.nonlinear, fit.law.columns
    jacobian, residual = _linearised(fit, sample)
    size = np.sqrt((jacobian**2).sum(axis=0))
    unit = jacobian / size
    inverse = np.linalg.inv(unit.T @ unit + FLOOR * np.eye(p + q))
    count = sample.specimens
    variance: FloatArray
    if count > 1:
        moves = np.stack([_without(unit, residual, own) for own in _own(sample)])
        variance = (moves**2).sum(axis=0) * (count - 1) / count
        freedom, points, basis = count - 1.0, None, "specimens"
    else:
        points = _independent_points(residual, sample)
        freedom, basis = max(points - (p + q), 1.0), "one specimen"
        variance = np.diag(inverse) * float(residual @ residual) / freedom
    t = float(student.ppf(0.5 + 0.5 * level, freedom))
    reach = t * np.sqrt(variance) / size
    rise = t * t * variance / np.diag(inverse)
    best = np.concatenate([fit.a, fit.c])
    ends = best[:, None] + reach[:, None] * np.array([-1.0, 1.0])
    profiled = np.arange(q + p if q == p == 1 else q)
    ends[profiled] = _crossings(fit, sample, profiled, reach, rise)
    by_profile = np.isin(np.arange(q + p), profiled)
    return Intervals(ends[:q], ends[q:], level, by_profile, basis, points)


def _linearised(fit: LawFit, sample: Sample) -> tuple[FloatArray, FloatArray]:
    """Return the derivative of the scaled residual by (a, file's c), and the residual."""
    phi, slope = fit.law.evaluate(sample.stretch, fit.a[None])
    divisor, change = (d[0] for d in fit.law.divisor(fit.a[None]))
    by_c = phi[0] * divisor
    by_a = (slope[0] * divisor + phi[0] * change) * fit.c if fit.law.nonlinear else slope[0]
    factor = sample.factor
    residual = factor * (by_c @ fit.c - sample.stress_MPa)
    return factor[:, None] * np.concatenate([by_a, by_c], axis=1), residual


def _without(unit: FloatArray, residual: FloatArray, own: BoolArray) -> FloatArray:
    """Return how far the linearised estimate moves when one specimen is left out."""
    rest = unit[~own]
    normal = rest.T @ rest + FLOOR * np.eye(unit.shape[1])
    return np.asarray(np.linalg.solve(normal, unit[own].T @ residual[own]), dtype=np.float64)


def _own(sample: Sample) -> list[BoolArray]:
    return [sample.specimen == number for number in np.unique(sample.specimen)]


def _independent_points(residual: FloatArray, sample: Sample) -> float:
    """Return n (1 - r) / (1 + r), r the correlation of neighbouring residuals along strain."""
    ordered = residual[np.argsort(sample.stretch, kind="stable")]
    r = float(ordered[1:] @ ordered[:-1] / max(float(ordered @ ordered), 1e-300))
    r = min(max(r, 0.0), 0.99)
    return len(residual) * (1.0 - r) / (1.0 + r)


def _crossings(
    fit: LawFit, sample: Sample, profiled: IntArray, reach: FloatArray, rise: FloatArray
) -> FloatArray:
    """Return where each parameter's profile has risen by `rise`, below and above, shape (k, 2).

    `profiled` (k,) numbers the parameters, nonlinear ones first. The square root of the rise
    grows about evenly with the distance, so that a secant step from the best fit all but hits;
    it is kept within the bracket found so far.
    """
    q = fit.law.nonlinear
    k = len(profiled)
    best = np.concatenate([fit.a, fit.c])
    which, side = np.repeat(profiled, 2), np.tile([-1.0, 1.0], k)
    limit = np.full(2 * k, np.inf)
    bounds = fit.law.bounds(float(sample.stretch.max()))
    limit[: 2 * q] = (np.abs(bounds - fit.a[:, None])).ravel()
    target = np.maximum(rise, 1e-12 * fit.objective)[which]
    distance = np.maximum(reach, 1e-9 * np.abs(best) + 1e-300)[which]
    inside, outside = np.zeros(2 * k), np.full(2 * k, np.inf)
    near = np.tile(fit.a, (2 * k, 1))
    open_ended = np.zeros(2 * k, dtype=bool)
    todo = np.arange(2 * k)
    for _ in range(ROUNDS):
        distance[todo] = np.minimum(distance[todo], limit[todo])
        at = distance[todo]
        cost, near[todo] = _profile(fit, sample, which[todo], best, side[todo] * at, near[todo])
        ratio = np.sqrt(np.maximum(cost - fit.objective, 0.0) / target[todo])
        under = ratio < 1.0
        inside[todo] = np.where(under, np.maximum(inside[todo], at), inside[todo])
        outside[todo] = np.where(under, outside[todo], np.minimum(outside[todo], at))
        open_ended[todo] = under & (at >= limit[todo])
        done = (np.abs(ratio - 1.0) < CLOSE) | open_ended[todo]
        step = at / np.clip(ratio, 0.1, 10.0)
        astray = (step <= inside[todo]) | (step >= outside[todo])
        middle = 0.5 * (inside[todo] + np.where(np.isinf(outside[todo]), 2 * at, outside[todo]))
        distance[todo] = _rounded(np.where(done, at, np.where(astray, middle, step)))
        todo = todo[~done]
        if not len(todo):
            break
    # A search that ran out of rounds gives the wider end of its bracket.
    distance[todo] = np.minimum(outside[todo], limit[todo])
    end = best[which] + side * distance
    positive = np.append(bounds[:, 0] >= 0.0, np.zeros(fit.law.columns, dtype=bool))[which]
    end = np.where(open_ended, np.where(positive & (side < 0.0), 0.0, side * np.inf), end)
    out: FloatArray = end.reshape(k, 2)
    return out


def _profile(
    fit: LawFit,
    sample: Sample,
    which: IntArray,
    best: FloatArray,
    offset: FloatArray,
    near: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the least cost with one parameter held a row, and the nonlinear ones there.

    Each is sought from the best fit and from the last point of this profile.
    """
    q, rows = fit.law.nonlinear, np.arange(len(which))
    held_a = np.zeros((len(rows), q), dtype=bool)
    held_c = np.full((len(rows), fit.law.columns), np.nan)
    by_a, by_c = which < q, which >= q
    at = best[which] + offset
    held_a[rows[by_a], which[by_a]] = True
    held_c[rows[by_c], which[by_c] - q] = at[by_c]
    starts = [np.tile(fit.a, (len(rows), 1)), near.copy()]
    for start in starts:
        start[rows[by_a], which[by_a]] = at[by_a]
    held = Held(np.tile(held_a, (len(starts), 1)), np.tile(held_c, (len(starts), 1)))
    found = minimise(fit.law, sample, np.concatenate(starts), held)
    cost = found.cost.reshape(len(starts), -1)
    lowest = np.argmax(cost <= cost.min(axis=0) * (1.0 + 1e-6), axis=0)
    return cost[lowest, rows], _rounded(found.a.reshape(*cost.shape, q)[lowest, rows])


def _rounded(values: FloatArray) -> FloatArray:
    """Round to four digits, so that the last bits of a processor do not choose the path."""
    scale = 10.0 ** np.floor(np.log10(np.maximum(np.abs(values), 1e-300)))
    out: FloatArray = np.where(np.isfinite(values), np.round(values / scale, 3) * scale, values)
    return out
