"""How sure a fitted law is: scatter between specimens, intervals of what users read."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from planner.errors import ArgumentError
from planner.materials.characterise import (
    Curve,
    MaterialCharacteristics,
    characterise_material,
    toe_compensated,
)
from planner.materials.fit import (
    RELATIVE_FLOOR,
    STARTS,
    Choice,
    Held,
    LawCandidate,
    LawFit,
    Sample,
    choose_law,
    law_stress_MPa,
    minimise,
    sample_of,
)
from planner.materials.fit_yield import fit_yielding
from planner.materials.laws import SeparableLaw
from planner.notes import Caution
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import LawParameters, Uncertainty

__all__ = ["ASSUMED_LOG_SD", "MaterialFit", "fit_material"]


# ------------------------------------------------------------------------------------------------
# How far a print's stiffness may lie from its law's: specimens and misfit together.


ASSUMED_LOG_SD = 0.05
"""Taken between specimens where only one was tested: replicates of PolyJet elastomers scatter by
1 to 9 %."""


@dataclass(frozen=True, slots=True)
class ParameterScatter:
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


def scatter_of_fit(fit: LawFit, sample: Sample) -> ParameterScatter:
    """Compare each specimen's stress with the law's, as logarithms of their ratio."""
    law = law_stress_MPa(fit.law, fit.a, fit.c, sample.stretch)
    floor = RELATIVE_FLOOR * sample.stress_MPa.max()
    used = (sample.stress_MPa > floor) & (law > floor)
    ratio = np.log(np.where(used, sample.stress_MPa, 1.0) / np.where(used, law, 1.0))
    own = [ratio[used & (sample.specimen == n)] for n in np.unique(sample.specimen)]
    levels = [float(r.mean()) for r in own if len(r)]
    within = np.sqrt(np.mean([r.var() for r in own if len(r)])) if levels else 0.0
    return scatter_of_levels(levels, float(within))


def scatter_of_levels(levels: Sequence[float], misfit: float) -> ParameterScatter:
    """Return the scatter of specimens' own ln(stiffness), about a law that is `misfit` off."""
    from scipy.stats import t as student

    count = len(levels)
    if count < 2:
        spread = ASSUMED_LOG_SD
        return ParameterScatter(
            count, spread, misfit, float(np.hypot(spread * np.sqrt(2.0), misfit))
        )
    between = float(np.std(levels, ddof=1))
    widened = float(student.ppf(0.975, count - 1)) / NormalDist().inv_cdf(0.975)
    predictive = between * widened * np.sqrt(1.0 + 1.0 / count)
    return ParameterScatter(count, between, misfit, float(np.hypot(predictive, misfit)))


# ------------------------------------------------------------------------------------------------
# Intervals of fitted parameters that know that points along one curve are not independent.
#
# The profile of the cost over one parameter gives the interval's shape, skewed or open as it may
# be; how far the cost may rise is set by the scatter between specimens (the adjustment of a
# clustered likelihood by R. Chandler and S. Bate 2007): Student's t with one degree of freedom
# fewer than specimens, squared, times the ratio of the parameter's variance between specimens (the
# linearised jackknife, one specimen left out in turn) to the one that independent points would
# have. For a law that is linear in its parameter and specimens of equal sampling that is the t
# interval of the specimens' own estimates.


_ROUNDS = 14
"""Secant steps towards the profile's crossing; each refits the other parameters."""

_CLOSE = 0.02
"""Relative error of the crossing's distance at which the search ends."""

_FLOOR = 1e-10
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
    inverse = np.linalg.inv(unit.T @ unit + _FLOOR * np.eye(p + q))
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
    normal = rest.T @ rest + _FLOOR * np.eye(unit.shape[1])
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
    for _ in range(_ROUNDS):
        distance[todo] = np.minimum(distance[todo], limit[todo])
        at = distance[todo]
        cost, near[todo] = _profile(fit, sample, which[todo], best, side[todo] * at, near[todo])
        ratio = np.sqrt(np.maximum(cost - fit.objective, 0.0) / target[todo])
        under = ratio < 1.0
        inside[todo] = np.where(under, np.maximum(inside[todo], at), inside[todo])
        outside[todo] = np.where(under, outside[todo], np.minimum(outside[todo], at))
        open_ended[todo] = under & (at >= limit[todo])
        done = (np.abs(ratio - 1.0) < _CLOSE) | open_ended[todo]
        step = at / np.clip(ratio, 0.1, 10.0)
        astray = (step <= inside[todo]) | (step >= outside[todo])
        middle = 0.5 * (inside[todo] + np.where(np.isinf(outside[todo]), 2 * at, outside[todo]))
        distance[todo] = _interval_rounded(np.where(done, at, np.where(astray, middle, step)))
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
    return cost[lowest, rows], _interval_rounded(found.a.reshape(*cost.shape, q)[lowest, rows])


def _interval_rounded(values: FloatArray) -> FloatArray:
    """Round to four digits, so that the last bits of a processor do not choose the path."""
    scale = 10.0 ** np.floor(np.log10(np.maximum(np.abs(values), 1e-300)))
    out: FloatArray = np.where(np.isfinite(values), np.round(values / scale, 3) * scale, values)
    return out


# ------------------------------------------------------------------------------------------------
# From one material's specimens to its law: hyperelastic where it is elastic, else one that yields.


@dataclass(frozen=True, slots=True, eq=False)
class MaterialFit:
    """What a palette says of one material, and why.

    Attributes
    ----------
    choice
        The laws that were tried; None for a plastic material, which gets a law that yields.
    notes
        What the user should know, one sentence each.
    """

    material: str
    characteristics: MaterialCharacteristics
    law: LawParameters
    uncertainty: Uncertainty
    scatter: ParameterScatter
    choice: Choice | None
    notes: tuple[str, ...]

    @property
    def elongation_at_break(self) -> float:
        """Mean strain at break of the specimens."""
        return self.characteristics.spreads["elongation_at_break"].mean


def fit_material(
    material: str,
    curves: Sequence[Curve],
    laws: Sequence[SeparableLaw],
    *,
    weighting: str = "relative",
    starts: int = STARTS,
    level: float = 0.95,
) -> MaterialFit:
    """Characterise a material's specimens, fit the laws, and choose one.

    Strains count from the end of the toe, and the curve up to its largest stress is fitted.

    Raises
    ------
    ArgumentError
        No law is stable over the working range, which goes to the mean elongation at break.
    FileError
        A curve that no figure can rest on.
    """
    if not 0.5 <= level < 1.0:
        raise ArgumentError(f"level {level:g}: it must be at least 0.5 and below 1, as 0.95")
    found = characterise_material(material, curves)
    notes = [note for c in found.specimens for note in c.notes if "not shifted" not in note]
    if found.deformation.kind == "plastic":
        law, uncertainty, scatter = _plastic(found, curves, weighting, level)
        notes.extend(_falls(material, curves))
        return MaterialFit(material, found, law, uncertainty, scatter, None, tuple(notes))
    sample = sample_of([_loading(curve) for curve in curves], weighting=weighting)
    working = found.spreads["elongation_at_break"].mean
    try:
        choice = choose_law(laws, sample, working, starts=starts)
    except ArgumentError as error:
        raise ArgumentError(f"material {material}: {error}") from error
    chosen = choice.chosen
    if chosen is None:
        falls = "; ".join(
            f"the stress of {c.fit.name} falls at strain {c.unstable_strain:.3g}"
            for c in choice.candidates
            if c.unstable_strain is not None
        )
        raise ArgumentError(
            f"material {material}: no law is stable up to its elongation at break, {working:.3g}, "
            f"and a tenth beyond ({falls}); try `law` all"
        )
    notes.extend(_doubts(material, chosen))
    ends = intervals(chosen.fit, sample, level)
    return MaterialFit(
        material,
        found,
        chosen.fit.parameters,
        _uncertainty(chosen, ends, found.n, choice.scheme),
        scatter_of_fit(chosen.fit, sample),
        choice,
        tuple(notes),
    )


def _loading(curve: Curve) -> Curve:
    """Return the curve from the end of its toe to its largest stress."""
    curve = toe_compensated(curve)
    return curve.part(slice(int(np.argmax(curve.stress_MPa)) + 1))


def _doubts(material: str, chosen: LawCandidate) -> list[str]:
    convergence = chosen.fit.convergence
    notes: list[str] = []
    if not convergence.ok:
        notes.append(
            Caution(
                f"material {material}: {convergence.agreeing} of {convergence.starts} starts reach "
                f"the best {chosen.fit.name}, whose gradient is {convergence.gradient:.1e}; a "
                "better one may exist: try more --starts"
            )
        )
    if convergence.at_bound:
        notes.append(
            Caution(
                f"material {material}: a parameter of {chosen.fit.name} lies at its bound, so that "
                "the tests do not determine it"
            )
        )
    return notes


def _uncertainty(chosen: LawCandidate, ends: Intervals, count: int, scheme: str) -> Uncertainty:
    law = chosen.fit.law
    by_profile = ends.profiled.astype(np.float64)
    flags = law.parameters(by_profile[: law.nonlinear], by_profile[law.nonlinear :])
    kinds = {
        kind: ", ".join(symbol for symbol, values in flags.items() if values[0] == flag)
        for kind, flag in (("profile", 1.0), ("Student's t", 0.0))
    }
    ways = " and ".join(f"{kind} ({symbols})" for kind, symbols in kinds.items() if symbols)
    if ends.independent_points is None:
        scatter = f"scatter between {count} specimens"
    else:
        scatter = (
            f"one specimen as {ends.independent_points:.3g} independent points, without the "
            "scatter between specimens"
        )
    return Uncertainty(
        specimens=count,
        level=ends.level,
        law_low=_fit_rounded(law.parameters(ends.a[:, 0], ends.c[:, 0])),
        law_high=_fit_rounded(law.parameters(ends.a[:, 1], ends.c[:, 1])),
        basis=f"{ways}; {scatter}; held out: {scheme}",
        r2=chosen.fit.r2,
        nrmse=chosen.fit.nrmse,
        held_out_error=float(f"{chosen.held_out_error:.3g}"),
    )


def _fit_rounded(parameters: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
    """Round ends of intervals, which are found to 2 %, to four digits."""
    return {k: tuple(float(f"{v:.4g}") for v in values) for k, values in parameters.items()}


def _plastic(
    found: MaterialCharacteristics, curves: Sequence[Curve], weighting: str, level: float
) -> tuple[LawParameters, Uncertainty, ParameterScatter]:
    """Fit a law that yields, with Student's intervals of its parameters' logarithms."""
    fit = fit_yielding(
        found, curves, weighting=weighting, level=level, assumed_log_sd=ASSUMED_LOG_SD
    )
    uncertainty = Uncertainty(
        specimens=found.n,
        level=level,
        law_low=_fit_rounded(fit.low),
        law_high=_fit_rounded(fit.high),
        basis=f"Student's t; scatter between {found.n} specimens"
        if found.n > 1
        else f"one specimen, {100 * ASSUMED_LOG_SD:g} % scatter between specimens assumed",
        r2=fit.r2,
        nrmse=fit.nrmse,
    )
    return fit.law, uncertainty, scatter_of_levels(fit.levels, fit.misfit)


_NOTABLE_FALL = 0.1
"""Fall of stress behind the yield that is told. Chosen: the law then lies 5 % off on either side,
as much as specimens scatter."""


def _falls(material: str, curves: Sequence[Curve]) -> list[str]:
    falls = [1.0 - float(c.stress_MPa[-1] / c.stress_MPa.max()) for c in curves]
    if max(falls) <= _NOTABLE_FALL:
        return []
    return [
        f"material {material}: the stress falls by up to {100 * max(falls):.0f} % behind the "
        "yield; a law that plans are made with must rise, so it runs through the middle there"
    ]
