"""How far the gap shrinks once the effect is added, on conditions that took no part."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.gap.campaign import TOLERANCES, Specimen, column_levels
from planner.gap.diagnosis import Effects, Gap
from planner.gap.evidence.problem import (
    Candidate,
    Problem,
    own_axes,
    replicate_floor,
    specimen_forces_N,
    squared_errors,
)
from planner.gap.evidence.settle import World
from planner.gap.evidence.weigh import NO_GAP, UNKNOWN, Weighed, reweigh
from planner.numerics import BoolArray, FloatArray, IntArray

__all__ = ["closure"]


# ------------------------------------------------------------------------------------------------
# Which tests to leave out together, so that what is predicted is another condition.


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """What is left out.

    Attributes
    ----------
    out : (n,)
        Specimens that take no part.
    judged : (n,)
        Those of them whose direction and material some other specimen has: what is said of one
        that was not tested is a guess.
    """

    out: BoolArray
    judged: BoolArray


_LEAST_LEVELS = 3
"""Of a column, for whole ones to be left out. Numerical: a course along it needs two that are
left."""

_MOST_FOLDS = 10
_MOST_LEVELS = 6
"""Folds of conditions, and levels that are left out in turn. Convention: tenfold, as is usual; each
costs a fit of all hypotheses."""

_LARGEST_SHARE = 0.5
"""Of the specimens, that a level may hold to be left out. Chosen: what less than half of them teach
says little of what all do."""


def _conditions_out(
    specimens: Sequence[Specimen], tests: Sequence[Sequence[int]]
) -> tuple[list[Fold], str]:
    """Return folds that leave each condition out once, with all that were tested in it, in words.

    Where there are more than `_MOST_FOLDS` conditions, several are left out together. With one
    condition or two, as one alone teaches nothing of what sets it apart, or each of a material or a
    direction of its own, specimens are left out one at a time, or a few; with one specimen there is
    no fold.

    Parameters
    ----------
    tests
        Places of the specimens of each condition.
    """
    folds = [
        Fold(out, judged)
        for out in _in_turn(specimens, tests)
        if (judged := _judged(specimens, out)).any()
    ]
    if folds and len(tests) >= _LEAST_LEVELS:
        most = -(-len(tests) // _MOST_FOLDS)
        several = f"{len(tests)} conditions left out, up to {most} at a time"
        return folds, "leave one condition out" if most == 1 else several
    n = len(specimens)
    if n < 2:
        return [], "one specimen: nothing left out"
    # Of specimens one at a time, what is said of another material or direction has to do.
    alone = [Fold(out, out) for out in _in_turn(specimens, [[k] for k in range(n)])]
    return alone, f"{n} specimens left out one at a time"


def _in_turn(specimens: Sequence[Specimen], groups: Sequence[Sequence[int]]) -> Iterator[BoolArray]:
    """Yield which specimens are left out in each of at most `_MOST_FOLDS` turns."""
    count = min(len(groups), _MOST_FOLDS)
    for k in range(count):
        out = [place for group in groups[k::count] for place in group]
        yield np.isin(np.arange(len(specimens)), out)


def _levels_out(specimens: Sequence[Specimen], names: Collection[str]) -> list[Fold]:
    """Return folds that leave whole levels of a column out: what is predicted lies beyond.

    A column with two levels is left as it is: without one of them nothing could be learned of the
    other.

    Parameters
    ----------
    names
        The columns; others leave nothing out.
    """
    found: dict[bytes, Fold] = {}
    for name in (name for name in (*TOLERANCES, "orientation") if name in names):
        cells = column_levels(name, [getattr(s, name) for s in specimens])
        known = [c for c in dict.fromkeys(cells) if c is not None]
        for level in known if len(known) >= _LEAST_LEVELS else ():
            out = np.array([c == level for c in cells])
            judged = _judged(specimens, out)
            if out.sum() <= _LARGEST_SHARE * len(specimens) and judged.any():
                found.setdefault(out.tobytes(), Fold(out, judged))
    # Evenly chosen where there are many, so that every column keeps some.
    folds = list(found.values())
    chosen = np.linspace(0, len(folds) - 1, min(len(folds), _MOST_LEVELS)).round().astype(int)
    return [folds[k] for k in chosen.tolist()]


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
"""Behind the interval of what is closed. Convention: ends of a 90 % interval are then known to 3 %
of its width."""

_GENERIC_AMPLITUDES = (0.003, 0.01, 0.03, 0.1)
"""Of a generic regressor's patterns, as deviations of the logarithm of force. Numerical: in steps
of about three, from nothing to any gap; the rest of the data chooses."""

_RECALIBRATION_SD = 5.0
"""Deviation of base laws that are refitted, over the stated one. Chosen: nearly freely, and yet
none runs off that the tests do not tell of."""

_LEAST_PROBABILITY = 0.02
"""Hypotheses below it do not take part in what is expected. Numerical: each would move it by less
than 2 % of what it predicts otherwise."""

_NEGATIVE = 1.05
"""Error after over before from which predictions are told to be worse. Chosen: errors of some 15
tests change by a few per cent by chance."""

_WIDER = 1.25
"""Of the interval of what is closed: resampling some 15 tests gives one that is too narrow.
Calibrated: so much wider, and with the floor's own doubt, it held the closure of the true effect in
87 % of 70 campaigns of the bench."""


def closure(
    problem: Problem,
    weighed: Weighed,
    vain: Collection[Effects],
    verdict: Effects,
    rng: np.random.Generator,
    progress: Callable[[int, int, str], None] | None = None,
) -> Gap:
    """Return the gap before and after, beside the replicate floor and two baselines.

    Parameters
    ----------
    weighed
        What was weighed on the whole campaign: the folds choose among it anew.
    vain
        Effects that close nothing on the whole campaign: the folds do not choose these.
    verdict
        Of the whole campaign: with "none" or "unknown" there is no effect to add.
    """
    specimens, nothing = problem.campaign.specimens, verdict in ((), UNKNOWN)
    alone = squared_errors(problem, Candidate(()))
    predictor = _Predictor(problem, weighed, vain, alone)
    folds, held_out = _conditions_out(specimens, problem.model.tests)
    floor = replicate_floor(problem)
    if not folds:
        return Gap(_rms(alone), None, None, None, None, None, None, held_out)

    def errors_of(weight: FloatArray) -> FloatArray:
        after = alone if nothing else predictor.of_what_is_likely(weight)
        return np.stack([after, predictor.recalibrated(weight), predictor.generic(weight)])

    after, recalibrated, generic = _held_out(problem, folds, errors_of, progress)
    judged = np.isfinite(after)
    before = np.where(judged, alone, np.nan)
    if floor is not None:  # of the same specimens as the errors, where some of these are replicated
        same = np.where(judged, floor, np.nan)
        floor = floor if np.isnan(same).all() else same
    floor_rms = None if floor is None else _rms(floor)
    closed = 0.0 if nothing else None
    interval: tuple[float, float] | None = None
    if floor is not None and floor_rms is not None and not nothing:
        closed = _closed(_rms(before), _rms(after), floor_rms)
        interval = _interval(problem, before, after, floor, rng)
    # Levels of the verdict's own covariates: along any other column nothing is carried beyond.
    own = own_axes([b.effect for b in problem.branches if b.effect.id in verdict])
    beyond = [] if nothing else _levels_out(specimens, own)
    gap = Gap(
        before=_rms(before),
        after=_rms(after),
        floor=floor_rms,
        closed=closed,
        closed_interval=interval,
        recalibration_only=_rms(recalibrated),
        generic=_rms(generic),
        held_out=held_out,
        negative_transfer=_rms(after) > _NEGATIVE * max(_rms(before), floor_rms or 0.0),
    )
    if not beyond:
        return gap
    (errors,) = _held_out(problem, beyond, lambda weight: predictor.of_what_is_likely(weight)[None])
    left_out = _rms(alone[np.isfinite(errors)])
    return replace(gap, extrapolated_before=left_out, extrapolated=_rms(errors))


def _rms(squares: FloatArray) -> float:
    """Return the root of the mean of mean squares, those that are not known left out."""
    return float(np.sqrt(np.nanmean(squares)))


def _held_out(
    problem: Problem,
    folds: Sequence[Fold],
    errors_of: Callable[[FloatArray], FloatArray],
    progress: Callable[[int, int, str], None] | None = None,
) -> FloatArray:
    """Return specimens' mean errors over the folds that judge them, (k, n); NaN if none does.

    Of strays none is judged.

    Parameters
    ----------
    errors_of
        Of specimens' weights, (n,), their errors, (k, n).
    """
    total: FloatArray | float = 0.0
    times = np.where(problem.strays, 0, np.sum([fold.judged for fold in folds], axis=0))
    for k, fold in enumerate(folds):
        if progress is not None:
            progress(k, len(folds), "held-out conditions")
        total = total + np.where(fold.judged, errors_of(np.where(fold.out, 0.0, 1.0)), 0.0)
    return np.asarray(total / np.where(times > 0, times, np.nan))


@dataclass(frozen=True, slots=True, eq=False)
class _Predictor:
    """Squared errors of specimens, (n,), relative to their peaks, by several predictions.

    Attributes
    ----------
    before : (n,)
        Of the palette alone.
    """

    problem: Problem
    weighed: Weighed
    vain: Collection[Effects]
    before: FloatArray

    def of_what_is_likely(self, weight: FloatArray) -> FloatArray:
        """By forces averaged over what may be the cause, as the weighted specimens say, (n,).

        By the palette's own laws, whatever these specimens say that they are off by: that is
        `recalibrated`.
        """
        problem = self.problem
        world, odds = reweigh(self.weighed, weight)
        odds = [(value, c) for value, c in odds if c.effects not in self.vain]
        most = max(value for value, _ in odds)
        shares = np.exp([value - most for value, _ in odds])
        likely = [
            (share, candidate)
            for share, (_, candidate) in zip((shares / shares.sum()).tolist(), odds, strict=True)
            if share > _LEAST_PROBABILITY
        ]
        expected = np.zeros_like(problem.model.measured_N)
        for share, candidate in likely:
            settled = self.weighed.settled_as(candidate)
            chosen = settled.fitted(world, problem.gain_of(candidate))
            forces = specimen_forces_N(problem, replace(chosen, members=None))
            if candidate.members is not None:
                forces = self._with_own_gain(forces, candidate.log_gain)
            expected += share * forces
        return squared_errors(problem, expected / sum(share for share, _ in likely))

    def _with_own_gain(self, forces: FloatArray, log_gain: float) -> FloatArray:
        """Return forces with each specimen's gain, told from its own curve's level alone.

        Which specimens are affected cannot be known of those left out; whether the gain that the
        rest show fits them better than none is read off their own curves, one bit a specimen.
        """
        scaled, measured = forces * np.exp(log_gain), self.problem.model.measured_N
        plain_error, scaled_error = (np.mean((measured - f) ** 2, axis=1) for f in (forces, scaled))
        return np.where((scaled_error < plain_error)[:, None], scaled, forces)

    def recalibrated(self, weight: FloatArray) -> FloatArray:
        """By calibrations that fit the weighted specimens best, no effect added."""
        problem, count = self.problem, len(self.problem.ways)
        ways = _RECALIBRATION_SD * problem.nuisances[:, :count]
        best = World(problem, nuisances=ways, weight=weight).coefficients(problem.target)
        setup = problem.with_laws_off(_RECALIBRATION_SD * best)
        return squared_errors(problem, Candidate(()), setup)

    def generic(self, weight: FloatArray) -> FloatArray:
        """By a generic regressor, on the features of force.

        It knows every column, strain and branch, and no physics: all patterns of the unknown at
        once, beside the calibrations.
        """
        problem, table = self.problem, self.problem.table
        world, amplitude = max(
            (
                (World(problem, more=amplitude * problem.patterns, weight=weight), amplitude)
                for amplitude in _GENERIC_AMPLITUDES
            ),
            key=lambda found: found[0].none,
        )
        best = world.coefficients(problem.target)
        # Without the levels of batches: like the floor's, the specimens are new, and so is theirs.
        raw = problem.calibration @ best[: problem.calibration.shape[1]]
        raw += np.concatenate([a.columns for a in problem.unknown], axis=1) @ (
            amplitude * best[problem.nuisances.shape[1] :]
        )
        predicted = table.transformed(problem.unpredicted) + raw
        # No further than what was measured or predicted goes: patterns grow without an end.
        most = np.max(np.abs([table.measured, table.transformed(problem.unpredicted)]))
        force = 2.0 * table.floor * np.sinh(np.clip(predicted, -most, most))
        of = np.where(table.is_field, 0.0, 1.0 / problem.model.peaks_N[table.specimen, 0])
        after, before = (
            np.bincount(table.specimen, (of * (table.measured_raw - found)) ** 2)
            for found in (force, problem.unpredicted)
        )
        return np.asarray(self.before * (after / np.maximum(before, 1e-300)))


def _closed(before: float, after: float, floor: float) -> float | None:
    if before <= NO_GAP * floor:
        return None
    return 1.0 - (after - floor) / (before - floor)


def _interval(
    problem: Problem,
    before: FloatArray,
    after: FloatArray,
    floor: FloatArray,
    rng: np.random.Generator,
) -> tuple[float, float] | None:
    """Return the 90 % interval of the closure over resampled tests.

    Replicates of one test share most of what a model leaves: they are drawn together. The floor is
    a variance of few degrees of freedom, and drawn as such.
    """
    some, test_of = np.isfinite(before), problem.model.test_of
    freedom = max(problem.scatter.degrees_of_freedom, 1)
    groups = [np.flatnonzero(some & (test_of == test)) for test in np.unique(test_of[some])]

    def closed(rows: IntArray, doubt: float) -> float | None:
        if np.isnan(floor[rows]).all():
            return None
        return _closed(_rms(before[rows]), _rms(after[rows]), _rms(doubt * floor[rows]))

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
    # More than all there is cannot close: a share above 1 is the floor's own doubt.
    return (
        min(1.0, middle, middle - _WIDER * (middle - float(low))),
        min(1.0, max(middle, middle + _WIDER * (float(high) - middle))),
    )
