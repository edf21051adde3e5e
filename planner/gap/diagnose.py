"""Diagnose a campaign: where its gap lies, which effect causes it, how far it closes, what next."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np
from scipy.special import softmax

from planner.errors import ArgumentError, as_count, as_texts
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.campaign import (
    TOLERANCES,
    Campaign,
    Specimen,
    axis_columns,
    column_levels,
    named,
    stated,
)
from planner.gap.campaign_folder import read_campaign
from planner.gap.design import next_experiments
from planner.gap.diagnosis import (
    Diagnosis,
    Effects,
    Gap,
    Location,
    QualityProblem,
    Traces,
    Untestable,
    name_of,
    signed_error,
)
from planner.gap.effect import untestable
from planner.gap.effects import EFFECTS, TESTS, effect_named, effects_for
from planner.gap.evidence.posterior_mode import Likelihood
from planner.gap.evidence.problem import Candidate, Problem
from planner.gap.evidence.weigh import (
    ENOUGH_SPECIMENS,
    UNKNOWN,
    Priors,
    Weighed,
    axes_of,
    class_of,
    detectable_sizes,
    evidence_of,
    found_effects,
    ranking_of,
    reweigh,
    verdict_of,
    weigh,
)
from planner.gap.localise import Whitening, localise
from planner.gap.observations import ObservationModel
from planner.gap.quality import HOLDS, examine, merged_units, suggested_units
from planner.gap.segments import hold_share
from planner.gap.summary import summary_of
from planner.glance import counted
from planner.numerics import BoolArray, FloatArray, one_blas_thread
from planner.palette import Material, Palette
from planner.simulation.bar_solver import predict

__all__ = ["diagnose"]


_Progress = Callable[[int, int, str], None]


# ------------------------------------------------------------------------------------------------
# Which tests to leave out together, so that what is predicted is another condition.


_Fold = tuple[BoolArray, BoolArray]
"""Specimens that take no part; and those of them whose direction and material some other specimen
has, (n,) each: what is said of one that was not tested is a guess."""


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
) -> tuple[list[_Fold], str]:
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
    folds = [(out, j) for out in _in_turn(specimens, tests) if (j := _judged(specimens, out)).any()]
    if folds and len(tests) >= _LEAST_LEVELS:
        most = -(-len(tests) // _MOST_FOLDS)
        several = f"{len(tests)} conditions left out, up to {most} at a time"
        return folds, "leave one condition out" if most == 1 else several
    n = len(specimens)
    if n < 2:
        return [], "one specimen: nothing left out"
    # Of specimens one at a time, what is said of another material or direction has to do.
    alone = [(out, out) for out in _in_turn(specimens, [[k] for k in range(n)])]
    return alone, f"{n} specimens left out one at a time"


def _in_turn(specimens: Sequence[Specimen], groups: Sequence[Sequence[int]]) -> Iterator[BoolArray]:
    """Yield which specimens are left out in each of at most `_MOST_FOLDS` turns."""
    count = min(len(groups), _MOST_FOLDS)
    for k in range(count):
        out = [place for group in groups[k::count] for place in group]
        yield np.isin(np.arange(len(specimens)), out)


def _levels_out(specimens: Sequence[Specimen], names: Collection[str]) -> list[_Fold]:
    """Return folds that leave whole levels of a column out: what is predicted lies beyond.

    A column with two levels is left as it is: without one of them nothing could be learned of the
    other.

    Parameters
    ----------
    names
        The columns; others leave nothing out.
    """
    found: dict[bytes, _Fold] = {}
    for name in (name for name in (*TOLERANCES, "orientation") if name in names):
        cells = column_levels(name, [getattr(s, name) for s in specimens])
        known = [c for c in dict.fromkeys(cells) if c is not None]
        for level in known if len(known) >= _LEAST_LEVELS else ():
            out = np.array([c == level for c in cells])
            judged = _judged(specimens, out)
            if out.sum() <= _LARGEST_SHARE * len(specimens) and judged.any():
                found.setdefault(out.tobytes(), (out, judged))
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

_WIDER = 1.25
"""Of the interval of what is closed: resampling some 15 tests gives one that is too narrow.
Calibrated: so much wider, and with the floor's own doubt, it held the closure of the true effect in
86 % of 119 campaigns of the bench."""


def closure(
    problem: Problem,
    weighed: Weighed,
    vain: Mapping[Effects, float],
    verdict: Effects,
    rng: np.random.Generator,
    progress: _Progress | None = None,
) -> Gap:
    """Return the gap before and after, beside the replicate floor and two baselines.

    Parameters
    ----------
    weighed
        What was weighed on the whole campaign: the folds choose among it anew.
    vain
        By how many nats effects that close nothing on the whole campaign are less in the folds.
    verdict
        Of the whole campaign: with "none" or "unknown" there is no effect to add.
    """
    specimens, nothing = problem.campaign.specimens, verdict in ((), UNKNOWN)
    alone = problem.squared_errors(Candidate(()))
    predictor = _Predictor(problem, weighed, vain, alone)
    folds, held_out = _conditions_out(specimens, problem.model.tests)
    floor = problem.replicate_floor(None if nothing else weighed.best.get(verdict))
    if not folds:
        return Gap(_rms(alone), None, None, None, None, None, None, held_out)

    def errors_of(weight: FloatArray) -> FloatArray:
        after = alone if nothing else predictor.of_what_is_likely(weight)
        return np.stack([after, predictor.recalibrated(weight), predictor.generic(weight)])

    after, recalibrated, generic = _held_out(problem, folds, errors_of, progress)
    judged = np.isfinite(after)
    before = np.where(judged, alone, np.nan)
    closed, floor_rms, interval = 0.0 if nothing else None, None, None
    if floor is not None:  # of the same specimens as the errors, where some are replicated
        same = np.where(judged, floor, np.nan)
        floor = floor if np.isnan(same).all() else same
        floor_rms = _rms(floor)
        if not nothing:
            closed = _closed(_rms(before), _rms(after), floor_rms)
            interval = _interval(problem, np.stack([before, after, floor]), closed, rng)
    # Levels of the verdict's own covariates: along any other column nothing is carried beyond.
    beyond = _levels_out(specimens, {a for a, id in problem.own_axes.items() if id in verdict})
    gap = Gap(
        before=_rms(before),
        after=_rms(after),
        floor=floor_rms,
        closed=closed,
        closed_interval=interval,
        recalibration_only=_rms(recalibrated),
        generic=_rms(generic),
        held_out=held_out,
        negative_transfer=_rms(after) > max(_rms(before), floor_rms or 0.0),
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
    folds: Sequence[_Fold],
    errors_of: Callable[[FloatArray], FloatArray],
    progress: _Progress | None = None,
) -> FloatArray:
    """Return specimens' mean errors over the folds that judge them, (k, n); NaN if none does.

    Of strays none is judged.

    Parameters
    ----------
    errors_of
        Of specimens' weights, (n,), their errors, (k, n).
    """
    total: FloatArray | float = 0.0
    times = np.where(problem.strays, 0, np.sum([judged for _, judged in folds], axis=0))
    for k, (out, judged) in enumerate(folds):
        if progress is not None:
            progress(k, len(folds), "held-out conditions")
        total = total + np.where(judged, errors_of(np.where(out, 0.0, 1.0)), 0.0)
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
    vain: Mapping[Effects, float]
    before: FloatArray

    def of_what_is_likely(self, weight: FloatArray) -> FloatArray:
        """By forces averaged over what may be the cause, as the weighted specimens say, (n,).

        By the palette's own laws, whatever these specimens say that they are off by: that is
        `recalibrated`.
        """
        problem = self.problem
        likelihood, odds = reweigh(self.weighed, self.vain, weight)
        shares = softmax([value for value, _ in odds])
        expected, told = np.zeros_like(problem.model.measured_N), 0.0
        for share, (_, candidate) in zip(shares.tolist(), odds, strict=True):
            if share <= _LEAST_PROBABILITY:
                continue
            chosen = self.weighed.mode_of(candidate).fitted(likelihood, problem.gain_of(candidate))
            forces = problem.forces_N(replace(chosen, members=None))
            if candidate.members is not None:
                forces = self._with_own_gain(forces, candidate.log_gain)
            expected += share * forces
            told += share
        return problem.squared_errors(expected / told)

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
        problem, count = self.problem, len(self.problem.calibrations)
        laws = _RECALIBRATION_SD * problem.nuisances[:, :count]
        best = Likelihood(problem, nuisances=laws, weight=weight).coefficients(problem.target)
        model, setup = problem.model, problem.model.setup
        for calibration, size in zip(problem.calibrations, best.tolist(), strict=True):
            setup = calibration.applied(setup, _RECALIBRATION_SD * size * calibration.sd)
        return problem.squared_errors(predict(setup, model.laws).force_N[model.test_of])

    def generic(self, weight: FloatArray) -> FloatArray:
        """By a generic regressor, on the features of force.

        It knows every column, strain and branch, and no physics: all patterns of the unknown at
        once, beside the calibrations.
        """
        problem, table = self.problem, self.problem.table
        likelihoods = (
            (Likelihood(problem, more=amplitude * problem.patterns, weight=weight), amplitude)
            for amplitude in _GENERIC_AMPLITUDES
        )
        likelihood, amplitude = max(likelihoods, key=lambda found: found[0].none)
        best = likelihood.coefficients(problem.target)
        # Without the levels of batches: like the floor's, the specimens are new, and so is theirs.
        raw = problem.calibration @ best[: problem.calibration.shape[1]]
        patterns = np.concatenate([a.columns for a in problem.unknown], axis=1)
        raw += patterns @ (amplitude * best[problem.nuisances.shape[1] :])
        predicted = table.transformed(problem.unpredicted) + raw
        # No further than what was measured or predicted goes: patterns grow without an end.
        most = np.max(np.abs([table.measured, table.transformed(problem.unpredicted)]))
        of = np.where(table.is_field, 0.0, 1.0 / problem.model.peaks_N[table.specimen, 0])
        after, before = (
            np.bincount(table.specimen, (of * (table.measured_raw - found)) ** 2)
            for found in (table.raw(np.clip(predicted, -most, most)), problem.unpredicted)
        )
        return np.asarray(self.before * (after / np.maximum(before, 1e-300)))


_NO_GAP = 1.02
"""Error before over the floor up to which no share of it closes. Chosen: the floor itself is known
no better, and a share of nothing is none."""


def _closed(before: float, after: float, floor: float) -> float | None:
    return None if before <= _NO_GAP * floor else 1.0 - (after - floor) / (before - floor)


def _interval(
    problem: Problem, errors: FloatArray, middle: float | None, rng: np.random.Generator
) -> tuple[float, float] | None:
    """Return the 90 % interval, about a middle, of the closure over resampled tests.

    Replicates of one test share most of what a model leaves: they are drawn together. The floor is
    a variance of few degrees of freedom, and drawn as such.

    Parameters
    ----------
    errors : (3, n)
        Of specimens: before, after, and the floor.
    """
    before, after, floor = errors
    some, test_of = np.isfinite(before), problem.model.test_of
    freedom = max(problem.scatter.degrees_of_freedom, 1)
    groups = [np.flatnonzero(some & (test_of == test)) for test in np.unique(test_of[some])]

    values = []
    for _ in range(_RESAMPLES):
        rows = np.concatenate([groups[g] for g in rng.integers(len(groups), size=len(groups))])
        doubt = freedom / float(rng.chisquare(freedom))
        if not np.isnan(floor[rows]).all():
            values.append(_closed(*map(_rms, (before[rows], after[rows], doubt * floor[rows]))))
    told = [value for value in values if value is not None]
    if middle is None or len(told) < _RESAMPLES // 2:
        return None
    low, high = (middle + _WIDER * (np.quantile(told, [0.05, 0.95]) - middle)).tolist()
    # Ends may pass 1, as the middle may: the floor is itself uncertain.
    return min(middle, low), max(middle, high)


# ------------------------------------------------------------------------------------------------
# Where the gap lies, what remains of it after the effect, and what the laws ask for beside it.


_SIGNIFICANT = 0.01
"""Level of a remainder, family-wise. Convention: 1 %, as a remainder is named beside a cause that
has explained the gap."""


def _places_of(
    problem: Problem, likely: Mapping[str, float], chosen: Candidate
) -> tuple[tuple[Location, ...], tuple[Location, ...]]:
    """Return where the gap lies, and where a significant one is left after the chosen effects."""
    whitening = Whitening(problem.noise, problem.nuisances, problem.scatter.log_sd)
    before = after = localise(problem.campaign, problem.table, problem.residual, whitening, likely)
    if chosen.effects:
        left = problem.residual - problem.explained(chosen)
        after = localise(problem.campaign, problem.table, left, whitening)
    return before, tuple(p for p in after if p.p < _SIGNIFICANT)


# ------------------------------------------------------------------------------------------------
# What was tested, so that whoever uses the effect knows where it was seen.


_Levels = dict[str, tuple[float | str, ...]]


def levels_tested(campaign: Campaign) -> tuple[_Levels, Mapping[str, tuple[str, ...]]]:
    """Return `Diagnosis.tested` and `Diagnosis.changed`."""
    found, changed = _levels_of(campaign.specimens), dict[str, list[str]]()
    own, tested = asdict(stated(campaign.palette.reference)), []
    for material in campaign.palette.materials:
        if having := [s for s in campaign.specimens if _has(campaign, s, material)]:
            tested.append(material.id)
            for name, levels in _levels_of(having).items():
                column = {"strain_rate_per_s": "rate_mm_s"}.get(name, name)
                if len({*column_levels(column, [*levels, own[name]])}) > 1:
                    changed.setdefault(name, []).append(material.id)
    return found | {"material": tuple(tested)}, {n: tuple(ids) for n, ids in changed.items()}


def _has(campaign: Campaign, specimen: Specimen, material: Material) -> bool:
    if (span := specimen.coordinates) is None:
        return campaign.palette.resolve(specimen.material or "") == material
    return bool(span.min() <= material.coordinate <= span.max())


def _levels_of(specimens: Sequence[Specimen]) -> _Levels:
    """Return the levels of every condition that is known of some specimen."""
    conditions = ("temperature_C", "soak_h", "age_days")
    found: _Levels = {n: _levels([getattr(s, n) for s in specimens], n) for n in conditions}
    found["strain_rate_per_s"] = _levels([r for s in specimens for r in _rates(s)], "rate_mm_s")
    found["orientation"] = tuple(sorted({s.orientation for s in specimens if s.orientation}))
    return {name: values for name, values in found.items() if values}


def _levels(values: Sequence[float | None], name: str) -> tuple[float, ...]:
    """Return the means of values that replicates may have in common."""
    known = [value for value in values if value is not None]
    level = np.array(column_levels(name, known))
    return tuple(float(np.mean(np.array(known)[level == at])) for at in np.unique(level))


def _rates(specimen: Specimen) -> tuple[float, ...]:
    """Return the strain rates that a specimen shows: its pull's, and that of a pull as long as it.

    A law that relaxes shows in a hold what a pull shows that takes as long.
    """
    if specimen.rate_mm_s is None:
        return ()
    pull = specimen.rate_mm_s / specimen.gauge_mm
    if hold_share(specimen) <= HOLDS:
        return (pull,)
    return pull, float(specimen.strain.max() / (specimen.time_s[-1] - specimen.time_s[0]))


# ------------------------------------------------------------------------------------------------
# Curves to draw: what was predicted before and after, and what was measured.


def _traces_of(problem: Problem, chosen: Candidate) -> Traces:
    """Return the traces of a campaign and its verdict's candidate."""
    model, specimens = problem.model, problem.campaign.specimens
    setup, peaks_N = model.setup, problem.typical_peaks_N()
    sign = np.where(setup.pushed, -1.0, 1.0)[:, None]
    signs = sign[model.test_of]
    measured, after = signs * model.measured_N, signs * problem.forces_N(chosen)
    before_N = sign * model.alone.force_N
    return Traces(
        label=tuple(_label(specimens[members[0]], specimens) for members in model.tests),
        rows=[list(members) for members in model.tests],
        travel_mm=setup.travel_mm,
        time_s=setup.time_s,
        before_N=before_N,
        after_N=sign * predict(chosen.applied(setup), model.laws).force_N,
        measured_N=measured,
        peaks_N=peaks_N,
        residual_before=signed_error((measured - before_N[model.test_of]) / peaks_N),
        residual_after=signed_error((measured - after) / peaks_N),
        columns=axis_columns(problem.campaign),
    )


def _label(specimen: Specimen, specimens: tuple[Specimen, ...]) -> str:
    """Return what a test is, by the columns that vary in the campaign."""
    parts = [specimen.named, *(["compressed"] if specimen.pushed else [])]
    for name, column in SPECIMEN_COLUMNS.items():
        value = getattr(specimen, name)
        if column.label and value is not None and len({getattr(s, name) for s in specimens}) > 1:
            parts.append(column.label.format(value))
    return ", ".join(parts)


# ------------------------------------------------------------------------------------------------
# Effects that could not be tested, but would show where the verdict's effects do.


_NEVER_THERE = frozenset({"unloading", "bar"})
"""Channels without which an effect does not act: what was never unloaded has no set, what was
printed of one material no boundary."""


def _confounders(effects: Sequence[str], not_testable: Sequence[Untestable]) -> Iterator[str]:
    """Yield a sentence for each effect that may be the cause in place of the verdict's.

    Such an effect could not be tested, so that no evidence speaks for or against it, and shows
    along an axis along which one of the verdict's effects shows as well.

    Parameters
    ----------
    effects
        The verdict's, by id; an "unknown" has no axes of its own and resembles nothing.
    """
    where = {id: EFFECTS[id].where for id in effects if id in EFFECTS}
    for one in not_testable:
        other = EFFECTS[one.id]
        needs = (*other.covariates, *other.channels)
        alike = [id for id in where if set(where[id]) & set(other.where)]
        if not alike or _NEVER_THERE & set(needs):
            continue
        axes = [axis for axis in other.where if any(axis in where[id] for id in alike)]
        tests = " and ".join(", or ".join(TESTS[n] for n in need.split("|")) for need in needs)
        settle = f"; to settle it, {tests}" if tests else ""
        yield (
            f"{other.id} could not be tested ({one.reason}), but shows along "
            f"{' and '.join(axes)} as {' and '.join(alike)} {'do' if len(alike) > 1 else 'does'}, "
            f"and may be the cause instead, or a part of it{settle}"
        )


RANKED = 12
LEAST_PROBABILITY = 1e-4
"""Hypotheses that are shown, and the least that each must have. Convention: what is shown."""


def diagnose(
    campaign: Campaign | str | Path,
    *,
    palette: str | Path | Palette | None = None,
    without: str | Sequence[str] = (),
    unit_of: str | Sequence[str] = (),
    seed: int = 0,
    progress: _Progress | None = None,
    priors: Priors | None = None,
) -> Diagnosis:
    """Say where measurements differ from the palette, which effect causes it, how far it closes.

    Parameters
    ----------
    campaign
        The folder of a campaign, or a campaign that was read from one.
    palette
        By name, file or value, in place of the one that the folder names.
    seed
        Of resampling; the same campaign and seed give the same diagnosis.
    without
        Effects to take out of the library, to see whether their absence is noticed.
    unit_of
        The unit that force or travel is in, whatever the file says; see `read_campaign`.
    progress
        Called with how much is done, of how much, and what.
    priors
        Of the effects' number and sizes, for studies of the diagnosis itself.

    Returns
    -------
    Diagnosis
        `Diagnosis.ok` is false where there is a gap to explain, or one remains after the effect.
        `write_diagnosis` writes the report.

    Raises
    ------
    UnknownNameError
        An effect in `without`, or a specimen or unit in `unit_of`, that there is not.
    ArgumentError
        A palette or units beside a campaign that was read already.
    FileError, PaletteError
        A file of the folder that cannot be understood; see `read_campaign`.

    Examples
    --------
    >>> planner.diagnose("samples/warm-lab").verdict  # doctest: +SKIP
    'temperature'
    """
    rng = np.random.default_rng(as_count(seed, "`seed`", 2**63, least=0))
    without = as_texts(without, "`without`")
    if not isinstance(campaign, Campaign):
        campaign = read_campaign(campaign, palette, unit_of)
    elif palette is not None or unit_of:
        name = "unit_of" if palette is None else "palette"
        raise ArgumentError(f"`{name}` goes with the folder of a campaign; read it with that")
    priors = priors or Priors()
    # Small matrices: more threads only get into each other's way, and change the last digits.
    with one_blas_thread():
        problem, reasons, data_quality = prepared(campaign, without, progress)
        campaign, model = problem.campaign, problem.model
        weighed = weigh(problem, priors)
        evidence = evidence_of(problem, weighed)
        ranking = ranking_of(evidence, priors)
        verdict = verdict_of(ranking)
        gap = closure(problem, weighed, evidence.vain, verdict, rng, progress)
        chosen = weighed.best.get(verdict, Candidate(()))
        nodes = weighed.plain.products(problem.nodes)
        where, remainder = _places_of(problem, axes_of(problem, evidence, ranking, priors), chosen)
        same_class = class_of(problem, weighed, evidence, ranking, verdict)
        doubts = [*_cautions(problem), *_confounders(verdict, reasons)]
        alike = [found_effects(weighed, weighed.best[e]) for e in same_class if e in weighed.best]
        units = [unit for found in alike for unit in suggested_units(found, campaign.specimens)]
        units += [problem.unit_of for problem in data_quality if problem.unit_of is not None]
        mean, covariance = weighed.mode_of(chosen).likelihood.laws_off(chosen)
        tested, changed = levels_tested(campaign)
        found = Diagnosis(
            campaign=campaign.name,
            palette=campaign.palette.name,
            palette_sha256=campaign.palette.sha256,
            specimens=len(campaign.specimens),
            tests=len(model.tests),
            verdict=name_of(verdict),
            ranking=tuple(h for h in ranking[:RANKED] if h.probability >= LEAST_PROBABILITY),
            same_class=same_class,
            not_testable=reasons,
            where=where,
            gap=gap,
            effect=found_effects(weighed, chosen),
            remainder=remainder,
            data_quality=data_quality,
            next_experiments=next_experiments(problem, weighed, ranking),
            detectable=tuple(detectable_sizes(problem, nodes, priors)),
            limitations=(*campaign.limitations, *model.limitations, *doubts),
            unit_of=merged_units(units),
            recalibration={
                one.material: (float(mean[k] * one.sd), float(np.sqrt(covariance[k, k]) * one.sd))
                for k, one in enumerate(problem.calibrations)
                if one.kind == "level"
            },
            tested=tested,
            changed=changed,
            seed=seed,
            traces=_traces_of(problem, chosen),
            own_palette=campaign.palette,
        )
        return replace(found, summary=summary_of(found))


def prepared(
    campaign: Campaign, without: Sequence[str] = (), progress: _Progress | None = None
) -> tuple[Problem, tuple[Untestable, ...], tuple[QualityProblem, ...]]:
    """Return a campaign ready for weighing, the effects that it says nothing about, and its faults.

    Specimens whose curves cannot be compared, or whose travel is in another unit, are left out.
    """
    for id in without:
        effect_named(id, EFFECTS, "`without`")
    campaign = campaign.with_modes()
    model = ObservationModel(campaign)
    if (model.test_of < 0).any():
        campaign, model = _kept(campaign, model.test_of >= 0, model.limitations)
    quality = examine(campaign, model)
    if moved := [p.specimen for p in quality if p.kind == "travel" and p.specimen]:
        told = f"{named(moved)}: travel in another unit, as data quality says; left out"
        campaign, model = _kept(campaign, [s.id not in moved for s in campaign.specimens], [told])
    library = {id: e for id, e in effects_for(campaign.palette).items() if id not in without}
    reasons = {id: untestable(effect, campaign) for id, effect in library.items()}
    effects = [effect for id, effect in library.items() if reasons[id] is None]
    problem = Problem(campaign, model, effects, progress, _strays(campaign, quality))
    untold = (Untestable(id, told) for id, told in reasons.items() if told is not None)
    return problem, tuple(untold), quality


def _kept(
    campaign: Campaign, kept: Sequence[bool] | BoolArray, remarks: Sequence[str]
) -> tuple[Campaign, ObservationModel]:
    """Return a campaign without some of its specimens, and its model."""
    specimens = tuple(compress(campaign.specimens, kept))
    left = replace(campaign, specimens=specimens, remarks=(*campaign.remarks, *remarks))
    return left, ObservationModel(left)


def _strays(campaign: Campaign, quality: Sequence[QualityProblem]) -> set[str]:
    """Return the specimen that differs from its replicates by more than scatter, if one does.

    Or the two of which it cannot be told. Several are no strays: something sets them apart.
    """
    found = {p.specimen for p in quality if p.specimen and p.kind in ("outlier", "units")}
    alike = [{s.id for s in group} for group in campaign.replicates()]
    return found if len(found) == 1 or found in alike else set()


_LARGEST_SCATTER = 0.12
"""Of replicates' levels, above which they are not alike. Physical: jetted specimens scatter by 1 to
9 %, and estimates are off by a third."""


def _cautions(problem: Problem) -> Iterator[str]:
    """Yield what is to be told of the specimens' number, and of their scatter."""
    specimens, scatter = problem.campaign.specimens, problem.scatter
    if scatter.degrees_of_freedom and scatter.specimen > _LARGEST_SCATTER:
        # Specimens that should be alike and are not: something differs that no effect claims.
        alike = [[specimens[k].covariates for k in of] for of in problem.model.replicates]
        columns = [
            name
            for name in problem.campaign.covariates
            if any(len({cells.get(name) for cells in of}) > 1 for of in alike)
        ]
        where = "no column tells them apart"
        if columns:
            named = f"column{'s' if len(columns) > 1 else ''} {', '.join(columns)}"
            where = f"they differ in {named}, which no effect claims"
        yield (
            f"specimens made and tested alike differ by {100.0 * scatter.specimen:.0f} %, and "
            f"jetted ones by 1 to 9 %: {where}; give the condition in which they differ its own "
            "column"
        )
    if scatter.degrees_of_freedom == 0:
        yield (
            "no two specimens were made and tested alike, so that scatter is not measured but "
            "taken to be what is usual (3 % from specimen to specimen): print replicates"
        )
    if len(specimens) < ENOUGH_SPECIMENS:
        yield (
            f"{counted(len(specimens), 'specimen')} cannot tell causes apart: take the verdict as "
            "a hint of what to test next"
        )
