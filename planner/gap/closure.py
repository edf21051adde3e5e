"""How far the gap shrinks once the effect is added, on conditions that took no part."""

from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.gap.campaign import TOLERANCES, Campaign, Specimen, levels
from planner.gap.diagnosis import Gap
from planner.gap.evidence.posterior import UNKNOWN, posterior
from planner.gap.evidence.problem import Problem, own_axes, specimen_forces_N
from planner.gap.evidence.surrogate import Candidate
from planner.gap.evidence.weigh import Effects, Priors, weigh
from planner.gap.observations import BRANCHES
from planner.numerics import BoolArray, FloatArray, IntArray

__all__ = [
    "Fold",
    "closure",
    "conditions_out",
    "held_out_words",
    "levels_out",
    "refutes",
    "without_effect",
]


# ------------------------------------------------------------------------------------------------
# Which tests to leave out together, so that what is predicted is another condition.


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """What is left out.

    Attributes
    ----------
    name
        The column.
    out : (n,)
        Specimens that take no part.
    judged : (n,)
        Those of them whose direction and material some other specimen has: what is said of one
        that was not tested is a guess.
    """

    name: str
    out: BoolArray
    judged: BoolArray


_LEAST_LEVELS = 3
_MOST_FOLDS = 10
_MOST_LEVELS = 6
_LARGEST_SHARE = 0.5


def conditions_out(campaign: Campaign, tests: Sequence[Sequence[int]]) -> tuple[Fold, ...]:
    """Return folds that leave each condition out once, with all that were tested in it.

    Where there are more than `_MOST_FOLDS` conditions, several are left out together. With one
    condition, specimens are left out one at a time, or a few; with one specimen there is no fold.

    Parameters
    ----------
    tests
        Places of the specimens of each condition.
    """
    specimens = campaign.specimens
    groups: list[Sequence[int]] = [t for t in tests if t]
    name = "condition"
    if len(groups) < 2:
        groups, name = [[k] for k in range(len(specimens))], "specimen"
    if len(groups) < 2:
        return ()
    count = min(len(groups), _MOST_FOLDS)
    order = np.arange(len(specimens))
    found = []
    for k in range(count):
        out = np.isin(order, [place for group in groups[k::count] for place in group])
        # Of specimens one at a time, what is said of another material or direction has to do.
        judged = _judged(specimens, out) if name == "condition" else out
        if judged.any():
            found.append(Fold(name, out, judged))
    if not found and name == "condition":
        # Every condition has a material or a direction of its own.
        return conditions_out(campaign, ())
    return tuple(found)


def levels_out(campaign: Campaign, names: Collection[str]) -> tuple[Fold, ...]:
    """Return folds that leave whole levels of a column out: what is predicted lies beyond.

    A column with two levels is left as it is: without one of them nothing could be learned of the
    other.

    Parameters
    ----------
    names
        The columns; others leave nothing out.
    """
    specimens = campaign.specimens
    n = len(specimens)
    found: list[Fold] = []
    seen: set[bytes] = set()
    columns: dict[str, tuple[Hashable, ...]] = {
        name: levels([getattr(s, name) for s in specimens], *tolerance)
        for name, tolerance in TOLERANCES.items()
        if name in names
    }
    if "orientation" in names:
        columns["orientation"] = tuple(s.orientation for s in specimens)
    for name, cells in columns.items():
        known = [c for c in dict.fromkeys(cells) if c is not None]
        if len(known) < _LEAST_LEVELS:
            continue
        for level in known:
            out = np.array([c == level for c in cells])
            if not 0 < out.sum() <= _LARGEST_SHARE * n or out.tobytes() in seen:
                continue
            seen.add(out.tobytes())
            judged = _judged(specimens, out)
            if judged.any():
                found.append(Fold(name, out, judged))
    # Evenly chosen where there are many, so that every column keeps some.
    if len(found) > _MOST_LEVELS:
        chosen = np.linspace(0, len(found) - 1, _MOST_LEVELS).round().astype(int)
        found = [found[k] for k in chosen.tolist()]
    return tuple(found)


def held_out_words(folds: Sequence[Fold], tests: int) -> str:
    """Return what is left out at a time: "15 conditions left out, one or two at a time"."""
    if folds[0].name == "specimen":
        return f"{sum(int(f.out.sum()) for f in folds)} specimens left out one at a time"
    most = -(-tests // _MOST_FOLDS)
    if most == 1:
        return "leave one condition out"
    return f"{tests} conditions left out, up to {most} at a time"


def _judged(specimens: Sequence[Specimen], out: BoolArray) -> BoolArray:
    judged = out.copy()
    for name in ("orientation", "material"):
        cells = [getattr(s, name) for s in specimens]
        known = {cell for cell, left_out in zip(cells, out, strict=True) if not left_out}
        judged &= np.array([cell in known for cell in cells])
    return judged


# ------------------------------------------------------------------------------------------------
# How far the gap shrinks once the effect is added, on conditions that took no part.
#
# Each fold leaves a condition out, chooses the effect anew on the rest, fits it, and predicts what
# was left out with the palette's own laws and that effect. Others leave out whole levels of a
# column, the warmest or the fastest: how an effect's form carries beyond what was tested.


_RESAMPLES = 400
_GENERIC_AMPLITUDES = (0.003, 0.01, 0.03, 0.1)
"""Of its patterns, as deviations of the logarithm of force; the rest of the data chooses."""

_RECALIBRATION_SD = 5.0
"""Base laws are refitted nearly freely: their stated deviation times this."""

_NONE, _SINGLE, _PAIR = 0.2, 0.7, 0.1
"""Prior probabilities in the folds: that something is at work has been found already."""

_LEAST_PROBABILITY = 0.02
"""Hypotheses below it do not take part in what is expected."""

_NEGATIVE = 1.05

_REFUTED = 1.2
"""Error after over before above which what is named is no explanation: on the bench right ones stay
below 1.18, as conditions at the edge of a design are extrapolated."""

_WIDER = 1.25
"""Resampling some 15 tests gives intervals that are too narrow. So much wider, and with the floor's
own doubt, they held the closure of the true effect in 87 % of 70 campaigns of the bench."""
_FIELD = BRANCHES.index("field")


@dataclass(frozen=True, slots=True, eq=False)
class _Errors:
    """Mean squared normalised errors of specimens, (n,), held out once or more; NaN if never."""

    before: FloatArray
    after: FloatArray
    recalibrated: FloatArray
    generic: FloatArray


def closure(
    problem: Problem,
    priors: Priors,
    verdict: Effects,
    rng: np.random.Generator,
    progress: Callable[[int, int, str], None] | None = None,
) -> Gap:
    """Return the gap before and after, beside the replicate floor and two baselines.

    Parameters
    ----------
    verdict
        Of the whole campaign: with "none" or "unknown" there is no effect to add.
    """
    tests = [list(members) for members in problem.model.tests]
    folds = conditions_out(problem.campaign, tests)
    measured = problem.model.measured_N
    peak = np.maximum(np.abs(measured).max(axis=1, keepdims=True), 1e-12)
    plain = specimen_forces_N(problem, Candidate(()), problem.model.setup)
    before = _squared(measured, plain, peak)
    floor = _floor(problem, peak)
    nothing = verdict in ((), UNKNOWN)
    if not folds:
        figure = float(np.sqrt(before.mean()))
        return Gap(figure, None, None, None, None, None, None, "one specimen: nothing left out")
    among = replace(priors, none=_NONE, single=_SINGLE, pair=_PAIR)
    errors = _held_out(problem, among, folds, peak, (plain, before), nothing, progress)
    some = np.isfinite(errors.before)
    rms = {
        name: float(np.sqrt(np.nanmean(getattr(errors, name)[some])))
        for name in ("before", "after", "recalibrated", "generic")
    }
    floor_rms = None if floor is None else float(np.sqrt(np.nanmean(floor)))
    closed = interval = None
    if floor_rms is not None and not nothing:
        closed = _closed(rms["before"], rms["after"], floor_rms)
        interval = _interval(problem, errors, floor, rng)
    elif nothing:
        closed = 0.0
    beyond = None if nothing else _beyond(problem, among, verdict, peak, (plain, before))
    return Gap(
        before=rms["before"],
        after=rms["after"],
        floor=floor_rms,
        closed=closed,
        closed_interval=interval,
        recalibration_only=rms["recalibrated"],
        generic=rms["generic"],
        held_out=held_out_words(folds, len(tests)),
        extrapolated_before=None if beyond is None else beyond[0],
        extrapolated=None if beyond is None else beyond[1],
        negative_transfer=rms["after"] > _NEGATIVE * rms["before"],
    )


def refutes(gap: Gap) -> bool:
    """Tell whether what is named makes predictions of held-out conditions clearly worse."""
    return gap.after is not None and gap.after > _REFUTED * gap.before


def without_effect(gap: Gap) -> Gap:
    """Return a gap to which no effect is added."""
    return replace(
        gap, after=gap.before, closed=0.0, closed_interval=None, extrapolated_before=None,
        extrapolated=None, negative_transfer=False,
    )  # fmt: skip


def _held_out(
    problem: Problem,
    priors: Priors,
    folds: tuple[Fold, ...],
    peak: FloatArray,
    palette_alone: tuple[FloatArray, FloatArray],
    nothing: bool,
    progress: Callable[[int, int, str], None] | None,
) -> _Errors:
    measured = problem.model.measured_N
    plain, before = palette_alone
    n = len(measured)
    totals = {name: np.zeros(n) for name in ("after", "recalibrated", "generic")}
    times = np.zeros(n)
    for k, fold in enumerate(folds):
        out = fold.judged
        if progress is not None:
            progress(k, len(folds), "held-out conditions")
        weight = np.where(fold.out, 0.0, 1.0)
        forces = plain if nothing else _expected(problem, priors, weight)
        totals["after"][out] += _squared(measured, forces, peak)[out]
        setup = problem.model.setup
        for way, size in zip(problem.ways, _recalibration(problem, weight), strict=True):
            setup = way.applied(setup, size)
        forces = specimen_forces_N(problem, Candidate(()), setup)
        totals["recalibrated"][out] += _squared(measured, forces, peak)[out]
        ratio = _generic_ratio(problem, weight, peak)
        totals["generic"][out] += (before * ratio)[out]
        times[out] += 1.0
    held = np.where(times > 0.0, times, np.nan)
    return _Errors(
        np.where(times > 0.0, before, np.nan),
        totals["after"] / held,
        totals["recalibrated"] / held,
        totals["generic"] / held,
    )


def _beyond(
    problem: Problem,
    priors: Priors,
    verdict: Effects,
    peak: FloatArray,
    palette_alone: tuple[FloatArray, FloatArray],
) -> tuple[float, float] | None:
    """Return the errors before and after of whole levels left out; None without such.

    Levels of the verdict's own covariates: along any other column nothing is carried beyond.
    """
    effects = {b.effect.id: b.effect for b in problem.branches if b.effect.id in verdict}
    folds = levels_out(problem.campaign, own_axes(list(effects.values())))
    if not folds:
        return None
    measured = problem.model.measured_N
    _, before = palette_alone
    left, times = np.zeros(len(measured)), np.zeros(len(measured))
    for fold in folds:
        forces = _expected(problem, priors, np.where(fold.out, 0.0, 1.0))
        left[fold.judged] += _squared(measured, forces, peak)[fold.judged]
        times[fold.judged] += 1.0
    some = times > 0.0
    return (
        float(np.sqrt(before[some].mean())),
        float(np.sqrt((left[some] / times[some]).mean())),
    )


def _squared(measured: FloatArray, forces: FloatArray, peak: FloatArray) -> FloatArray:
    """Return specimens' mean squared errors, relative to their peaks, (n,)."""
    found: FloatArray = np.mean(((measured - forces) / peak) ** 2, axis=1)
    return found


def _expected(problem: Problem, priors: Priors, weight: FloatArray) -> FloatArray:
    """Return forces expected from the weighted specimens: averaged over what may be the cause."""
    weighed = weigh(problem, priors, weight, quick=True)
    likely = [h for h in posterior([weighed.log_odds]) if h.probability > _LEAST_PROBABILITY]
    total = sum(h.probability for h in likely)
    expected = np.zeros_like(problem.model.measured_N)
    for h in likely:
        chosen = weighed.best[h.effects]
        everyone = replace(chosen, members=None)
        forces = specimen_forces_N(problem, everyone, problem.model.setup)
        if chosen.members is not None:
            forces = _plain_with_subset(problem, chosen, forces)
        expected += h.probability / total * forces
    return expected


def _plain_with_subset(problem: Problem, chosen: Candidate, forces: FloatArray) -> FloatArray:
    """Return forces with each specimen's gain, told from its own curve's level alone.

    Which specimens are affected cannot be known of those left out; whether the gain that the rest
    show fits them better than none is read off their own curves, one bit a specimen.
    """
    measured = problem.model.measured_N
    scaled = forces * np.exp(chosen.log_gain)
    plain_error = np.mean((measured - forces) ** 2, axis=1)
    scaled_error = np.mean((measured - scaled) ** 2, axis=1)
    return np.where((scaled_error < plain_error)[:, None], scaled, forces)


def _recalibration(problem: Problem, weight: FloatArray) -> list[float]:
    """Return sizes of the calibrations that fit the weighted specimens best, no effect added."""
    j = problem.whitened.nuisance_columns[:, : len(problem.ways)]
    rows = problem.whitened.on_rows(weight)
    inner = j.T @ (j * rows[:, None]) + np.eye(j.shape[1]) / _RECALIBRATION_SD**2
    best = np.linalg.solve(inner, j.T @ (problem.whitened.columns[:, 0] * rows))
    return [float(b * way.sd) for b, way in zip(best, problem.ways, strict=True)]


def _generic_ratio(problem: Problem, weight: FloatArray, peak: FloatArray) -> FloatArray:
    """Return squared error after over before a generic regressor, on the figures of force.

    It knows every column, strain and branch, and no physics: all patterns of the unknown at once,
    beside the calibrations, by ridge regression.
    """
    whitened = problem.whitened
    columns = whitened.columns[:, problem.gains.stop :]
    rows = whitened.on_rows(weight)
    inner = columns.T @ (columns * rows[:, None])
    cross = columns.T @ (whitened.columns[:, 0] * rows)
    best, most = np.zeros(len(cross)), -np.inf
    for amplitude in _GENERIC_AMPLITUDES:
        sd = np.full(len(cross), amplitude)
        sd[len(cross) - whitened.nuisances :] = 1.0
        scaled = inner * np.outer(sd, sd) + np.eye(len(sd))
        solution = np.linalg.solve(scaled, sd * cross)
        evidence = 0.5 * float((sd * cross) @ solution - np.linalg.slogdet(scaled)[1])
        if evidence > most:
            best, most = sd * solution, evidence
    table = problem.table
    raw_columns = [a.columns for a in problem.unknown]
    raw = np.concatenate([*raw_columns, problem.calibration, problem.noise.batch], axis=1)
    predicted = table.transformed(problem.unpredicted) + raw @ best
    force = 2.0 * table.floor * np.sinh(np.clip(predicted, -50.0, 50.0))
    scale = peak[table.specimen, 0]
    counted = table.branch != _FIELD
    n = len(problem.campaign.specimens)
    after = np.bincount(
        table.specimen[counted],
        (((table.measured_raw - force) / scale) ** 2)[counted],
        minlength=n,
    )
    before = np.bincount(
        table.specimen[counted],
        (((table.measured_raw - problem.unpredicted) / scale) ** 2)[counted],
        minlength=n,
    )
    ratio: FloatArray = after / np.maximum(before, 1e-300)
    return ratio


def _floor(problem: Problem, peak: FloatArray) -> FloatArray | None:
    """Return what no model can beat, squared, (n,); None without replicates.

    What replicates differ by, and what they share as specimens of one batch.
    """
    measured = problem.model.measured_N / peak
    peaks = peak[:, 0]
    floor = np.full(len(measured), np.nan)
    batches = [s.batch for s in problem.campaign.specimens]
    for members in problem.model.tests:
        if len(members) > 1:
            rows = np.array(members)
            # Relative to the group's mean peak: each one's own would hide its level.
            curves = measured[rows] * (peaks[rows] / peaks[rows].mean())[:, None]
            share = len(rows) / (len(rows) - 1.0)
            floor[rows] = share * np.mean((curves - curves.mean(axis=0)) ** 2, axis=1)
            if len({batches[k] for k in members}) == 1:
                floor[rows] += problem.scatter.batch**2 * np.mean(measured[rows] ** 2, axis=1)
    return None if np.isnan(floor).all() else floor


def _closed(before: float, after: float, floor: float) -> float | None:
    if before <= 1.02 * floor:
        return None
    return 1.0 - (after - floor) / (before - floor)


def _interval(
    problem: Problem, errors: _Errors, floor: FloatArray | None, rng: np.random.Generator
) -> tuple[float, float] | None:
    """Return the 90 % interval of the closure over resampled tests.

    Replicates of one test share most of what a model leaves: they are drawn together. The floor is
    a variance of few degrees of freedom, and drawn as such.
    """
    assert floor is not None
    some, test_of = np.isfinite(errors.before), problem.model.test_of
    freedom = max(problem.scatter.degrees_of_freedom, 1)
    groups = [np.flatnonzero(some & (test_of == test)) for test in np.unique(test_of[some])]

    def closed(rows: IntArray, doubt: float) -> float | None:
        if np.isnan(floor[rows]).all():
            return None
        return _closed(
            float(np.sqrt(errors.before[rows].mean())),
            float(np.sqrt(errors.after[rows].mean())),
            float(np.sqrt(doubt * np.nanmean(floor[rows]))),
        )

    middle = closed(np.flatnonzero(some), 1.0)
    values = []
    for _ in range(_RESAMPLES):
        drawn = rng.integers(len(groups), size=len(groups))
        doubt = freedom / float(rng.chisquare(freedom))
        value = closed(np.concatenate([groups[g] for g in drawn]), doubt)
        if value is not None:
            values.append(value)
    if middle is None or len(values) < _RESAMPLES // 2:
        return None
    low, high = np.quantile(values, [0.05, 0.95])
    return (
        min(middle, middle - _WIDER * (middle - float(low))),
        max(middle, middle + _WIDER * (float(high) - middle)),
    )
