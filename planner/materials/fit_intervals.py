"""How sure a fitted law is: scatter between specimens, intervals of what users read."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from planner.errors import ArgumentError
from planner.glance import brief
from planner.materials.characterise import (
    MINIMUM_POINTS,
    SECANT_STRAINS,
    Curve,
    MaterialCharacteristics,
    characterise_material,
    toe_compensated,
)
from planner.materials.fit import (
    MODES,
    RELATIVE_FLOOR,
    STARTS,
    Choice,
    Held,
    LawCandidate,
    LawFit,
    Sample,
    by_symbol,
    choose_law,
    fit_law,
    least_yielding,
    logs,
    minimise,
    rows_leant_on,
    sample_columns,
    sample_of,
    sample_stress_MPa,
    unstable_strain,
)
from planner.materials.laws import SeparableLaw, Yielding, make_law, secant_modulus_MPa, stability
from planner.notes import Caution
from planner.numerics import BoolArray, FloatArray, IntArray, normal_quantile, students_t
from planner.palette import LawParameters, Uncertainty

__all__ = ["ASSUMED_LOG_SD", "MaterialFit", "by_mode", "fit_material", "loading", "widened"]


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
        Between specimens; `ASSUMED_LOG_SD` for a single one, or one record given several times.
    misfit
        Root mean square of the law's error along the curve that all specimens share, once each
        specimen's own level is taken out.
    log_sd
        For the next print: its 95 % range is ``exp(+-1.96 log_sd)``. Few specimens are accounted
        for by Student's t, and the mean's own error by 1 + 1/n.
    """

    specimens: int
    between: float
    misfit: float
    log_sd: float


def scatter_of_fit(fit: LawFit, sample: Sample) -> ParameterScatter:
    """Return the scatter of a fit's specimens about its law."""
    return _scatter_about(sample_stress_MPa(fit.law, fit.a, fit.c, sample), sample)


def _scatter_about(law: FloatArray, sample: Sample) -> ParameterScatter:
    """Compare each specimen's stress with the law's (n,), as logarithms of their ratio."""
    floor = RELATIVE_FLOOR * sample.stress_MPa.max()
    used = (sample.stress_MPa > floor) & (law > floor)
    ratio = np.log(np.where(used, sample.stress_MPa, 1.0) / np.where(used, law, 1.0))
    own = [used & (sample.specimen == n) for n in np.unique(sample.specimen)]
    courses = [(sample.stretch[i], ratio[i]) for i in own if i.any()]
    return scatter_of_levels([float(r.mean()) for _, r in courses], _common(courses))


def _common(courses: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """Return the root mean square course of ln(stress over law) that all specimens share.

    Each without its own level. The mean product of two specimens' courses holds what they share
    alone, the law's misfit; each one's own noise and shape are no part of it. One specimen cannot
    tell the two apart: all of its course is taken.
    """
    if len(courses) < 2:
        return float(np.mean([r.std() for _, r in courses])) if courses else 0.0
    first, last = (max(s[0] for s, _ in courses), min(s[-1] for s, _ in courses))
    at = np.linspace(first, last, 60)
    held = np.array([np.interp(at, s, r) for s, r in courses])
    held -= held.mean(axis=1)[:, None]
    count = len(held)
    whole = (held.sum(axis=0) ** 2).mean() - (held**2).mean(axis=1).sum()
    return float(np.sqrt(max(whole / (count * (count - 1.0)), 0.0)))


def scatter_of_levels(levels: Sequence[float], misfit: float) -> ParameterScatter:
    """Return the scatter of specimens' own ln(stiffness), about a law that is `misfit` off."""
    count = len(levels)
    if count < 2 or np.ptp(levels) < _SAME:
        spread = ASSUMED_LOG_SD
        return ParameterScatter(
            count, spread, misfit, float(np.hypot(spread * np.sqrt(2.0), misfit))
        )
    between = float(np.std(levels, ddof=1))
    predictive = between * widened(count) * np.sqrt(1.0 + 1.0 / count)
    return ParameterScatter(count, between, misfit, float(np.hypot(predictive, misfit)))


# ------------------------------------------------------------------------------------------------
# Intervals that know that points along one curve are not independent: the unit is the specimen.
#
# What users read, stress and secant modulus at a strain, is all but linear in the specimens'
# curves, whatever the law: Student's t of the specimens' influences (the jackknife, linearised).
#
# A parameter is not. The profile of the cost over it gives its interval's shape, skewed or open as
# it may be; how far the cost may rise is set by the scatter between specimens (the adjustment of a
# clustered likelihood by R. Chandler and S. Bate 2007): Student's t with one degree of freedom
# fewer than specimens, squared, times the ratio of the variance of the parameter's score between
# specimens to the one that independent points would have. Both are taken where the profile is, not
# at the best fit, for the law may bend in between. For a law that is linear in its parameter and
# specimens of equal sampling that is the t interval of the specimens' own estimates.


_ROUNDS = 14
"""Secant steps towards the profile's crossing; each refits the other parameters."""

_CLOSE = 0.02
"""Relative error of the crossing's distance at which the search ends."""

_FLAT = 1e-7
"""Gain per step, as a share of the cost, at which a point of a profile is left."""

_FLOOR = 1e-10
"""Added to the normal matrix of unit columns: directions without information stay finite."""

_SAME = 1e-6
"""Relative difference under which specimens are one record given twice: no test repeats so."""


_OPEN = float(np.log(1000.0))
"""Half width of an interval of ln(parameter) from which on it is open. Chosen: then the tests do
not tell the parameter's size."""


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Two-sided intervals of a fit's parameters.

    Attributes
    ----------
    a, c
        Low and high, shapes (q, 2) and (p, 2), in the file's terms; infinite where the tests
        leave a side open, for the profile meets the law's bound first (zero below, for a
        parameter that is positive). All are open where specimens say nothing of their scatter.
    level
        Nominal coverage.
    known
        Whether the scatter between specimens is known: there are two that differ.
    """

    a: FloatArray
    c: FloatArray
    level: float
    known: bool


@dataclass(frozen=True, slots=True)
class SecantInterval:
    """A law's secant modulus at a strain, and how sure it is; stress is strain times it.

    Attributes
    ----------
    strain
        Engineering strain; 0 stands for the initial modulus.
    low_MPa, high_MPa
        Ends of the interval of the specimens' mean; 0 and infinity where it is unknown.
    next_log_sd
        Standard deviation of ln(the next print's secant) about the law's.
    """

    strain: float
    value_MPa: float
    low_MPa: float
    high_MPa: float
    next_log_sd: float


def widened(specimens: float) -> float:
    """Return Student's t of so many specimens over the normal deviation."""
    return students_t(0.95, specimens) / normal_quantile()


def intervals(fit: LawFit, sample: Sample, level: float = 0.95) -> Intervals:
    """Return intervals of all parameters of a fit, by profiles."""
    q, p = fit.law.nonlinear, fit.law.columns
    if not _scatter_known(sample):
        ends = np.tile([-np.inf, np.inf], (q + p, 1))
        return Intervals(ends[:q], ends[q:], level, False)
    spread = np.sqrt(_moves_variance(fit, sample, np.eye(q + p)))
    t = students_t(level, sample.specimens)
    if q == 0:
        # Linear: the jackknife knows that the specimen that goes farthest tells most of the last
        # coefficient, which the profile's score of a few specimens does not.
        ends = fit.c[:, None] + t * spread[:, None] * np.array([-1.0, 1.0])
        return Intervals(ends[:q], ends, level, True)
    ends = _crossings(fit, sample, t, spread)
    return Intervals(ends[:q], ends[q:], level, True)


def _half_widths(own: FloatArray, level: float) -> FloatArray:
    """Return the half widths of Student's intervals of the specimens' logarithms (n, k)."""
    count = len(own)
    if count < 2 or float(np.ptp(own, axis=0).max(initial=0.0)) < _SAME:
        return np.full(own.shape[1], np.inf)
    half = students_t(level, count) * own.std(axis=0, ddof=1) / np.sqrt(count)
    return np.where(half > _OPEN, np.inf, half)


def secant_intervals(
    fit: LawFit, sample: Sample, strains: Sequence[float], level: float = 0.95
) -> tuple[SecantInterval, ...]:
    """Return the law's secant moduli at strains from 0 up to the largest that was tested.

    The next print's is off by the scatter of prints, and by the law's own error at that strain,
    which is largest at rest, where a record tells least of it.
    """
    tested = np.array([e for e in strains if 1.0 + e <= sample.stretch.max()])
    # At rest the secant is the slope, which stress at a small strain gives to seven digits.
    strain = np.maximum(tested, 1e-7)
    columns = fit.law.evaluate(1.0 + strain, fit.a[None])
    derivative, stress = _derivatives(fit.law, fit.a, fit.c, columns)
    value, scatter = stress / strain, scatter_of_fit(fit, sample)
    half, next_ = np.full(len(strain), np.inf), np.full(len(strain), scatter.log_sd)
    if _scatter_known(sample):
        relative = (derivative / stress[:, None]).T
        half = students_t(level, sample.specimens) * np.sqrt(_moves_variance(fit, sample, relative))
        if scatter.specimens > 1:  # else one is so stiff that it hides all others
            # What holds a law moves it to one side: the mean's interval lets go of that, but the
            # law's error, beside prints' own scatter, is as small as it is held to.
            held = _moves_variance(fit, sample, relative, held=True)
            next_ = _next_log_sds(scatter, np.sqrt(held))
    rows = zip(tested, value, value * np.exp(-half), value * np.exp(half), next_, strict=True)
    return tuple(SecantInterval(*(float(v) for v in row)) for row in rows)


def _next_log_sds(scatter: ParameterScatter, own: FloatArray) -> FloatArray:
    """Return the next print's deviations at strains, where the law's own are `own`.

    The prints' scatter about their mean, and what the law is less sure of at a strain than the
    mean's level. Both come of the same few specimens: Student's t with the degrees of freedom that
    Welch and Satterthwaite give to a sum of two variances.
    """
    others = scatter.specimens - 1
    level = scatter.between**2 * (1.0 + 1.0 / scatter.specimens)
    more = np.maximum(own**2 - scatter.between**2 / scatter.specimens, 0.0)
    freedom = others * (level + more) ** 2 / (level**2 + more**2)
    wide = [widened(1.0 + one) for one in freedom.tolist()]
    return np.hypot(np.sqrt(level + more) * wide, scatter.misfit)


def _scatter_known(sample: Sample) -> bool:
    """Return whether at least two specimens of one loading differ in their mean secant."""
    own = _own(sample)
    means = np.array([np.mean(sample.stress_MPa[i] / (sample.stretch[i] - 1.0)) for i in own])
    mode = np.zeros(len(sample.stretch)) if sample.mode is None else sample.mode
    loading = np.array([(3.0 + mode[i][0]) * np.sign(sample.stretch[i][0] - 1.0) for i in own])
    alike = [means[loading == one] for one in np.unique(loading)]
    return any(float(np.ptp(one)) > _SAME * abs(float(one.mean())) for one in alike)


def _derivatives(
    law: SeparableLaw, a: FloatArray, c: FloatArray, columns: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the derivative of stress by (a, file's c), shape (n, q + p), and the stress."""
    phi, slope = columns
    divisor, change = (d[0] for d in law.divisor(a[None]))
    by_c = phi[0] * divisor
    by_a = (slope[0] * divisor + phi[0] * change) * c if law.nonlinear else slope[0]
    return np.concatenate([by_a, by_c], axis=1), by_c @ c


def _linearised(
    law: SeparableLaw, a: FloatArray, c: FloatArray, sample: Sample, *, held: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return unit columns of the scaled residual's derivative, their sizes, and the residual.

    Of a law that is held (`held`) the columns go on behind the points: by `rows_leant_on`.
    """
    derivative, stress = _derivatives(law, a, c, sample_columns(law, sample, a[None]))
    jacobian = sample.factor[:, None] * derivative
    if held:
        rows, _ = _derivatives(law, a, c, rows_leant_on(law, sample, a))
        jacobian = np.concatenate([jacobian, rows])
    size = np.sqrt((jacobian**2).sum(axis=0))
    size = np.where(size > 0.0, size, 1.0)
    return jacobian / size, size, sample.factor * (stress - sample.stress_MPa)


def _moves_variance(
    fit: LawFit, sample: Sample, directions: FloatArray, *, held: bool = False
) -> FloatArray:
    """Return the variance between specimens of linear forms (q + p, k) of the parameters."""
    unit, size, residual = _linearised(fit.law, fit.a, fit.c, sample, held=held)
    own = _own(sample)
    moves = np.stack([_without(unit, residual, i) for i in own]) / size @ directions
    count = len(own)
    return np.asarray(moves.var(axis=0) * (count - 1.0))


def _without(unit: FloatArray, residual: FloatArray, own: BoolArray) -> FloatArray:
    """Return how far the linearised estimate moves when one specimen is left out."""
    mine = unit[: len(own)][own]
    rest = np.concatenate([unit[: len(own)][~own], unit[len(own) :]])
    normal = rest.T @ rest + _FLOOR * np.eye(unit.shape[1])
    return np.asarray(np.linalg.solve(normal, mine.T @ residual[own]), dtype=np.float64)


def _own(sample: Sample) -> list[BoolArray]:
    return [sample.specimen == number for number in np.unique(sample.specimen)]


def _allowed_rise(
    law: SeparableLaw, a: FloatArray, c: FloatArray, sample: Sample, which: int
) -> float:
    """Return the variance between specimens of the profile's score over its square's, at a fit.

    The score is that of one parameter, freed of what the others could do instead. Away from the
    best fit every specimen's has a share in the slope of the cost, by how much it tells of the
    parameter; what is left is how far the specimens differ.
    """
    unit, _, residual = _linearised(law, a, c, sample)
    others = np.delete(unit, which, axis=1)
    normal = others.T @ others + _FLOOR * np.eye(others.shape[1])
    score = unit[:, which] - others @ np.linalg.solve(normal, others.T @ unit[:, which])
    each = np.array([score[i] @ residual[i] for i in _own(sample)])
    told = np.array([score[i] @ score[i] for i in _own(sample)])
    whole = max(float(told.sum()), 1e-300)
    count = len(each)
    apart = each - told / whole * each.sum()
    return float(count / (count - 1.0) * (apart @ apart) / whole)


def _crossings(fit: LawFit, sample: Sample, t: float, spread: FloatArray) -> FloatArray:
    """Return where each parameter's profile has risen too far, below and above, shape (k, 2).

    Nonlinear parameters come first. The square root of the rise grows about evenly with the
    distance, so that a secant step from the best fit all but hits; it is kept within the bracket
    found so far. What any of the profiles passes through belongs to every parameter's interval, if
    it is as good as that asks: a modulus falls by decades where its exponent moves by a few units,
    and its own profile would not find that way.
    """
    q = fit.law.nonlinear
    k = len(spread)
    best = np.concatenate([fit.a, fit.c])
    which, side = np.repeat(np.arange(k), 2), np.tile([-1.0, 1.0], k)
    limit = np.full(2 * k, np.inf)
    bounds = fit.law.bounds(float(sample.stretch.max()))
    limit[: 2 * q] = (np.abs(bounds - fit.a[:, None])).ravel()
    farthest = 10.0 * np.maximum(np.abs(best), 1e-300)
    distance = np.clip(t * spread, 1e-6 * np.abs(best) + 1e-300, farthest)[which]
    inside, outside = np.zeros(2 * k), np.full(2 * k, np.inf)
    near = np.tile(fit.a, (2 * k, 1))
    open_ended = np.zeros(2 * k, dtype=bool)
    todo = np.arange(2 * k)
    passed = []
    for _ in range(_ROUNDS):
        distance[todo] = np.minimum(distance[todo], limit[todo])
        at = distance[todo]
        cost, a, c = _profile(fit, sample, which[todo], best, side[todo] * at, near[todo])
        near[todo] = _interval_rounded(a)
        passed.append((cost, np.concatenate([a, c], axis=1)))
        allowed = [
            _allowed_rise(fit.law, own_a, own_c, sample, which[row])
            for row, own_a, own_c in zip(todo, a, c, strict=True)
        ]
        target = t * t * np.maximum(allowed, 1e-12 * fit.objective)
        ratio = np.sqrt(np.maximum(cost - fit.objective, 0.0) / target)
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
    if q:
        costs, points = (np.concatenate(values) for values in zip(*passed, strict=True))
        for rise, point in zip(costs - fit.objective, points, strict=True):
            for one in np.flatnonzero((point < out[:, 0]) | (point > out[:, 1])):
                asked = t * t * _allowed_rise(fit.law, point[:q], point[q:], sample, int(one))
                if rise <= asked:
                    out[one] = min(out[one, 0], point[one]), max(out[one, 1], point[one])
    return out


def _profile(
    fit: LawFit,
    sample: Sample,
    which: IntArray,
    best: FloatArray,
    offset: FloatArray,
    near: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the least cost with one parameter held a row, and the parameters there.

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
    found = minimise(fit.law, sample, np.concatenate(starts), held, flat=_FLAT)
    cost = found.cost.reshape(len(starts), -1)
    lowest = np.argmax(cost <= cost.min(axis=0) * (1.0 + 1e-6), axis=0)
    a = found.a.reshape(*cost.shape, q)[lowest, rows]
    a = np.where(a == 0.0, _FLAT, a)  # Ogden's term of exponent 0 is none, its modulus infinite
    c = found.c.reshape(*cost.shape, -1)[lowest, rows]
    c = np.where(np.isnan(held_c), c / fit.law.divisor(a)[0], c)
    return cost[lowest, rows], a, c


def _interval_rounded(values: FloatArray) -> FloatArray:
    """Round to four digits, so that the last bits of a processor do not choose the path."""
    scale = 10.0 ** np.floor(np.log10(np.maximum(np.abs(values), 1e-300)))
    return np.asarray(np.where(np.isfinite(values), np.round(values / scale, 3) * scale, values))


# ------------------------------------------------------------------------------------------------
# Slack before a specimen bears: stress stays where it is, and then rises at once.
#
# The tangent of a rubber's curve, by which a toe is found (ASTM D638), is never straight: its zero
# lies before the end of the slack. Here the curve behind the slack is Mooney's, which bends.


_SLACK_RANGE = 0.3
"""Strain behind the record's beginning over which Mooney's form describes an elastomer."""

_LARGEST_SLACK = 0.1
_SLACK_STEPS = 101
_SLACK_LEVEL = 0.95
"""Confidence that the specimens' slack together differs from none; a slack missed costs 10 % of the
modulus. How often one is found is in docs/explanation/fitting.md."""


def loading(curves: Sequence[Curve]) -> list[Curve]:
    """Return the curves from the end of their slack to their largest stress; slack is noted.

    Slack is the grips' and the series', so that the specimens together decide whether there is
    any; each then has its own. How far it may be off shows in the specimens' scatter.
    """
    from scipy.special import fdtri

    found = [_slack(curve) for curve in curves]
    gain, independent = (sum(one[k] for one in found) for k in (1, 2))
    tried = sum(one[2] > 0.0 for one in found)
    whole = list(curves)
    if tried and gain > tried * fdtri(tried, independent, _SLACK_LEVEL):  # an F test of them all
        whole = [
            curve.part(curve.strain >= slack, *_slack_note(curve, slack), origin=slack)
            for curve, (slack, *_) in zip(curves, found, strict=True)
        ]
    return [curve.part(slice(int(np.argmax(curve.stress_MPa)) + 1)) for curve in whole]


def _slack_note(curve: Curve, slack: float) -> list[str]:
    if not slack:
        return []
    return [
        f"specimen {curve.specimen}: begins to bear at strain {slack:.3g}; strains of its "
        "material's law count from there"
    ]


def _slack(curve: Curve) -> tuple[float, float, float]:
    """Return the strain at which a specimen begins to bear, how much better that fits, of what.

    The gain is that in the sum of squares over the scatter's variance, as a squared number of
    standard errors; 0 where there is no slack. Last comes the number of points, less what was
    fitted, that would tell as much were they not correlated with their neighbours.
    """
    peak = int(np.argmax(curve.stress_MPa)) + 1
    near = (np.arange(len(curve.strain)) < peak) & (curve.strain - curve.strain[0] <= _SLACK_RANGE)
    x, y = curve.strain[near], curve.stress_MPa[near]
    if len(x) < 3 * MINIMUM_POINTS or x[0] < 0.0:
        return 0.0, 0.0, 0.0
    slack = np.linspace(0.0, min(_LARGEST_SLACK, 0.3 * float(x[-1])), _SLACK_STEPS)
    stretch = 1.0 + np.maximum(x - slack[:, None], 0.0)
    front = stretch - stretch**-2
    basis, _ = np.linalg.qr(np.stack([front, front / stretch], axis=2))
    scatter = y - np.einsum("snk,sk->sn", basis, np.einsum("snk,n->sk", basis, y))
    squares = (scatter**2).sum(axis=1)
    at = int(np.argmin(squares))
    best = float(squares[at])
    if at == _SLACK_STEPS - 1 or not best > 0.0:
        return 0.0, 0.0, 0.0
    correlation = max(float(scatter[at, 1:] @ scatter[at, :-1]) / best, 0.0)
    independent = (len(x) - 3) * (1.0 - correlation) / (1.0 + correlation)
    return float(slack[at]), float(squares[0] - best) / best * independent, independent


# ------------------------------------------------------------------------------------------------
# From one material's specimens to its law: hyperelastic where it is elastic, else one that yields.


@dataclass(frozen=True, slots=True, eq=False)
class MaterialFit:
    """What a palette says of one material, and why.

    Attributes
    ----------
    secants
        What the law says at rest and at some strains up to the largest tested, with intervals.
    choice
        The laws that were tried; None for a plastic material, which gets a law that yields.
    notes
        What the user should know, one sentence each.
    curves
        The specimens' curves that the law was fitted to: behind slack or toe.
    """

    material: str
    characteristics: MaterialCharacteristics
    law: LawParameters
    uncertainty: Uncertainty
    scatter: ParameterScatter
    choice: Choice | None
    notes: tuple[str, ...]
    secants: tuple[SecantInterval, ...] = ()
    curves: tuple[Curve, ...] = ()

    __repr__ = brief

    @property
    def chosen_name(self) -> str:
        """The law's name, with its number of terms where there is a choice."""
        chosen = None if self.choice is None else self.choice.chosen
        return self.law.model if chosen is None else chosen.fit.name

    @property
    def elongation_at_break(self) -> float:
        """Mean strain at break of the specimens."""
        return self.characteristics.spreads["elongation_at_break"].mean


def fit_material(
    material: str,
    curves: Sequence[Curve],
    laws: Sequence[SeparableLaw],
    *,
    others: Sequence[Curve] = (),
    weighting: str = "relative",
    starts: int = STARTS,
    level: float = 0.95,
) -> MaterialFit:
    """Characterise a material's specimens, fit the laws, and choose one.

    Strains count from the end of the slack, and the curve up to its largest stress is fitted; of a
    plastic material from the end of the toe, and the whole curve. A law that is not held to be
    stable across the load is taken where that costs more than `STABLE_WITHIN` times the error.
    What bends over as no stable law of rubber does gets a law that yields, elastic or not.

    Parameters
    ----------
    others
        Specimens compressed, or loaded in another way (`Curve.mode`), fitted together with the
        others: each mode weighs the same, in it each specimen.

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
        notes.extend(_falls(material, curves))
        return _plastic(found, curves, tuple(notes), weighting, level)
    loaded = tuple(loading(curves))
    # A law's strains count from where its specimens begin to bear, not from the tangent's zero.
    notes = [note for note in notes if "strains count from" not in note]
    notes += [
        note
        for curve, whole in zip(loaded, curves, strict=True)
        for note in curve.notes[len(whole.notes) :]
    ]
    ends_at = [curve.part(slice(int(np.argmax(np.abs(curve.stress_MPa))) + 1)) for curve in others]
    sample = sample_of([*loaded, *ends_at], weighting=weighting)
    working = found.spreads["elongation_at_break"].mean
    try:
        choice = choose_law(laws, sample, working, starts=starts)
    except ArgumentError as error:
        raise ArgumentError(f"material {material}: {error}") from error
    chosen = choice.chosen
    if chosen is not None and len({law.model for law in laws}) > 1 and not others:
        scatter = scatter_of_fit(chosen.fit, sample)
        if scatter.misfit > _NOTABLE_MISFIT * scatter.between:
            bent = _plastic(found, curves, tuple(notes), weighting, level)
            if STABLE_WITHIN * bent.scatter.misfit < scatter.misfit:
                reason = (
                    f"a law that yields follows it to {100 * bent.scatter.misfit:.2g} %, "
                    f"{chosen.fit.name} to {100 * scatter.misfit:.2g} %"
                )
                return replace(bent, choice=replace(choice, chosen=None, reason=reason))
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
    price = 1.0
    if chosen.fit.law.model == "ogden":
        free = fit_law(chosen.fit.law, replace(sample, across=False), starts=starts)
        # One specimen's cost lacks the scatter that several would have.
        own = ASSUMED_LOG_SD**2 if sample.specimens == 1 else 0.0
        price = ((chosen.fit.cost + own) / (free.cost + own)) ** 0.5
        if price > STABLE_WITHIN:
            chosen = replace(chosen, fit=free, unstable_strain=unstable_strain(free, working))
            candidates = tuple(chosen if c is choice.chosen else c for c in choice.candidates)
            choice = replace(choice, candidates=candidates, chosen=chosen)
            sample = replace(sample, across=False)
    if limits := stability(make_law(chosen.fit.parameters), working).limits:
        notes.append(
            Caution(
                f"{material}: {chosen.fit.name} is stable (Drucker) only at stretch "
                f"{', '.join(limits)}"
            )
        )
        if price > STABLE_WITHIN:
            held = f"held to be stable to its break its error is {price:.2g} times as large"
            choice = replace(choice, reason=f"{choice.reason}; {held}")
    if others:
        notes.append(_by_mode(material, chosen.fit, sample))
    secants = secant_intervals(chosen.fit, sample, (0.0, *SECANT_STRAINS), level)
    notes.extend(_doubts(material, chosen, secants))
    ends = intervals(chosen.fit, sample, level)
    if ends.known and not others and np.isposinf(ends.c[:, 1]).any():
        notes.append(
            f"material {material}: tension bounds no modulus of {chosen.fit.name} from above: add "
            "equibiaxial tests, or compression to stretch 0.6"
        )
    return MaterialFit(
        material,
        found,
        chosen.fit.parameters,
        _uncertainty(chosen, ends, found.n, choice.scheme, secants),
        scatter_of_fit(chosen.fit, sample),
        choice,
        tuple(notes),
        secants,
        loaded,
    )


def _by_mode(material: str, fit: LawFit, sample: Sample) -> str:
    """Say how the loadings weigh, and how far the law is off in each."""
    said = [f"{k} weighs {w:.3g}, {100 * off:.2g} % off" for k, (w, off) in by_mode(fit, sample)]
    return f"material {material}: {'; '.join(said)} (RMS)"


def by_mode(fit: LawFit, sample: Sample) -> list[tuple[str, tuple[float, float]]]:
    """Return the share of the weight and the root mean square residual over scale by loading."""
    off = (sample_stress_MPa(fit.law, fit.a, fit.c, sample) - sample.stress_MPa) / sample.scale_MPa
    mode = np.zeros(len(off), dtype=np.int64) if sample.mode is None else sample.mode
    found = []
    for k in np.unique(mode):
        weight = np.where(mode == k, sample.weight, 0.0)
        share = float(weight.sum())
        found.append((MODES[k], (share, float(np.sqrt(weight @ off**2 / share)))))
    return found


def _doubts(material: str, chosen: LawCandidate, secants: Sequence[SecantInterval]) -> list[str]:
    convergence = chosen.fit.convergence
    notes: list[str] = []
    if not chosen.determined:
        notes.append(
            f"material {material}: tests do not determine single terms of {chosen.fit.name}; read "
            "its secant moduli, not its coefficients"
        )
    if len(secants) > 1 and secants[1].value_MPa > secants[0].value_MPa:
        # One Ogden term steepens from rest from an exponent of 6 on; elastomers have 1 to 4.
        notes.append(
            Caution(
                f"material {material}: its stress steepens from rest on, as in compression or "
                "behind slack: look at the tests"
            )
        )
    if not convergence.ok:
        notes.append(
            Caution(
                f"material {material}: {convergence.agreeing} of {convergence.starts} starts reach "
                f"the best {chosen.fit.name}; a better one may exist: try more --starts"
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


def _uncertainty(
    chosen: LawCandidate,
    ends: Intervals,
    count: int,
    scheme: str,
    secants: Sequence[SecantInterval],
) -> Uncertainty:
    law = chosen.fit.law
    basis = f"profiles, by the scatter of {count} specimens" if ends.known else _unknown(count)
    return Uncertainty(
        specimens=count,
        level=ends.level,
        law_low=_fit_rounded(law.parameters(ends.a[:, 0], ends.c[:, 0])),
        law_high=_fit_rounded(law.parameters(ends.a[:, 1], ends.c[:, 1])),
        basis=f"{basis}; judged on what was left out, {scheme} at a time",
        r2=chosen.fit.r2,
        nrmse=chosen.fit.nrmse,
        held_out_error=float(f"{chosen.held_out_error:.3g}"),
        strain=tuple(one.strain for one in secants),
        log_sd=tuple(float(f"{one.next_log_sd:.4g}") for one in secants),
    )


def _unknown(count: int) -> str:
    if count > 1:
        return f"unknown: {count} specimens of one record tell no scatter"
    return "unknown: one specimen tells nothing of the scatter between specimens"


def _fit_rounded(parameters: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
    """Round ends of intervals, which are found to 2 %, to four digits."""
    return {k: tuple(float(f"{v:.4g}") for v in values) for k, values in parameters.items()}


def _at_one_level(curves: Sequence[Curve], laws: Sequence[Yielding]) -> list[Curve]:
    """Return curves brought to the mean level of their laws.

    Where one specimen breaks before the others the mean curve would jump to their level.
    """
    strain = np.linspace(0.0, min(float(curve.strain[-1]) for curve in curves), 61)[1:]
    levels = np.array([np.log(law.nominal_stress_MPa(1.0 + strain)).mean() for law in laws])
    return [
        replace(curve, stress_MPa=curve.stress_MPa * float(np.exp(levels.mean() - level)))
        for curve, level in zip(curves, levels, strict=True)
    ]


def _plastic(
    found: MaterialCharacteristics,
    curves: Sequence[Curve],
    notes: tuple[str, ...],
    weighting: str,
    level: float,
) -> MaterialFit:
    """Fit a law that yields, with intervals of what the specimens' own laws say."""
    whole = [toe_compensated(curve) for curve in curves]
    moduli = [c.modulus_MPa for c in found.specimens]
    sample = sample_of(whole, weighting=weighting)
    laws, sides = zip(
        *(
            least_yielding(modulus, sample_of([curve], weighting=weighting))
            for modulus, curve in zip(moduli, whole, strict=True)
        ),
        strict=True,
    )
    levelled = _at_one_level(whole, laws)
    law, _ = least_yielding(
        float(np.exp(np.mean(np.log(moduli)))), sample_of(levelled, weighting=weighting)
    )
    stress = law.nominal_stress_MPa(sample.stretch)
    error, measured = stress - sample.stress_MPa, sample.stress_MPa
    own = np.array([logs(one) for one in laws])
    # The specimens' scatter tells how sure their mean is; the law through all of them at once has
    # its hardening from the few that go on longest, and so less surely. The interval holds both.
    half, middle = _half_widths(own, level), own.mean(axis=0)
    low, high = np.minimum(middle - half, logs(law)), np.maximum(middle + half, logs(law))
    # A parameter at its bound in some specimen is one that its test leaves open on that side.
    low = np.where((np.array(sides) < 0).any(axis=0), -np.inf, low)
    high = np.where((np.array(sides) > 0).any(axis=0), np.inf, high)
    strains = [e for e in (0.0, *SECANT_STRAINS) if 1.0 + e <= sample.stretch.max()]
    each = np.log([secant_modulus_MPa(one, strains) for one in laws])
    value = secant_modulus_MPa(law, strains)
    wide = _half_widths(each, level)
    scatter = _scatter_about(stress, sample)
    next_ = np.full(len(strains), scatter.log_sd)
    ends = zip(strains, value, value * np.exp(-wide), value * np.exp(wide), next_, strict=True)
    return MaterialFit(
        material=found.material,
        characteristics=found,
        law=LawParameters(law.model, MappingProxyType(by_symbol(logs(law)))),
        uncertainty=Uncertainty(
            specimens=found.n,
            level=level,
            law_low=_fit_rounded(by_symbol(low)),
            law_high=_fit_rounded(by_symbol(high)),
            basis=f"Student's t, by the scatter of {found.n} specimens"
            if np.isfinite(wide).any()
            else _unknown(found.n),
            r2=1.0 - float(np.sum(error**2) / np.sum((measured - measured.mean()) ** 2)),
            nrmse=float(np.sqrt(np.sum(sample.weight * error**2))) / float(measured.max()),
        ),
        scatter=scatter,
        choice=None,
        notes=notes,
        secants=tuple(SecantInterval(*(float(v) for v in row)) for row in ends),
        curves=tuple(whole),
    )


_NOTABLE_FALL = 0.1
"""Fall of stress behind the yield that is told. Chosen: the law then lies 5 % off on either side,
as much as specimens scatter."""


STABLE_WITHIN = 1.25
"""Times the error that a law may cost which says more: one that is stable in every direction, or
one that has an energy where one that yields has none."""

_NOTABLE_MISFIT = 0.75
"""Share of the scatter between specimens from which on a misfit is looked at: together they are
1.25 times the scatter."""


def _falls(material: str, curves: Sequence[Curve]) -> list[str]:
    falls = [1.0 - float(c.stress_MPa[-1] / c.stress_MPa.max()) for c in curves]
    if max(falls) <= _NOTABLE_FALL:
        return []
    return [
        f"material {material}: stress falls by up to {100 * max(falls):.0f} % behind the yield; "
        "the law must rise, and runs through the middle"
    ]
