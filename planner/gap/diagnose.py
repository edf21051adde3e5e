"""Diagnose a campaign: where its gap lies, which effect causes it, how far it closes, what next."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.errors import ArgumentError
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.campaign import (
    Campaign,
    Specimen,
    axis_columns,
    column_levels,
    replicate_groups,
    with_modes,
)
from planner.gap.campaign_folder import read_campaign
from planner.gap.closure import closure
from planner.gap.design import next_experiments
from planner.gap.diagnosis import (
    Diagnosis,
    Effects,
    Location,
    QualityProblem,
    Traces,
    UnitOf,
    Untestable,
    name_of,
    signed_error,
)
from planner.gap.effect import untestable
from planner.gap.effects import EFFECTS, TESTS, effect_named, effects_for
from planner.gap.evidence.problem import Candidate, Problem, applied, set_up, specimen_forces_N
from planner.gap.evidence.settle import World
from planner.gap.evidence.weigh import (
    ENOUGH_SPECIMENS,
    Priors,
    Weighed,
    class_of,
    detectable_sizes,
    evidence_of,
    found_effects,
    ranking_of,
    verdict_of,
    weigh,
)
from planner.gap.localise import Whitening, localise
from planner.gap.observations import ObservationModel, observation_model
from planner.gap.quality import HOLDS, examine, hold_share, merged_units, suggested_units
from planner.gap.summary import summary_of
from planner.glance import counted
from planner.numerics import FloatArray, one_blas_thread
from planner.palette import Palette
from planner.simulation.bar_solver import predict

__all__ = ["diagnose"]


# ------------------------------------------------------------------------------------------------
# Where the gap lies, what remains of it after the effect, and what the laws ask for beside it.


_SIGNIFICANT = 0.01
"""Level of a remainder, family-wise. Convention: 1 %, as a remainder is named beside a cause that
has explained the gap."""


def _places_of(
    problem: Problem, chosen: Candidate, rng: np.random.Generator
) -> tuple[tuple[Location, ...], tuple[Location, ...]]:
    """Return where the gap lies, and where a significant one is left after the chosen effects."""
    shared = np.concatenate([problem.calibration, problem.noise.batch], axis=1)
    whitening = Whitening.of(problem.noise, shared, problem.scatter.log_sd)
    before = localise(problem.campaign, problem.table, problem.residual, whitening, rng)
    if not chosen.effects:
        return before, tuple(p for p in before if p.p < _SIGNIFICANT)
    left = problem.residual - _explained(problem, chosen)
    after = localise(problem.campaign, problem.table, left, whitening, rng)
    return before, tuple(p for p in after if p.p < _SIGNIFICANT)


def _explained(problem: Problem, chosen: Candidate) -> FloatArray:
    """Return what the chosen effects change of the features, (N,)."""
    change: FloatArray = problem.changes_by([chosen])[0]
    if chosen.members is not None:
        force = np.where(problem.table.is_field, 0.0, problem.sensitivity)
        change = change + chosen.log_gain * chosen.members[problem.table.specimen] * force
    return change


def _recalibration_of(world: World, chosen: Candidate) -> Mapping[str, tuple[float, float]]:
    """Return each material's posterior level, ln of a factor on its stress, and its deviation."""
    problem, (mean, covariance) = world.problem, world.laws_off(chosen)
    return {
        way.material: (float(mean[k] * way.sd), float(np.sqrt(covariance[k, k]) * way.sd))
        for k, way in enumerate(problem.ways)
        if way.kind == "level"
    }


# ------------------------------------------------------------------------------------------------
# What was tested, so that whoever uses the effect knows where it was seen.


def levels_tested(campaign: Campaign) -> Mapping[str, tuple[float | str, ...]]:
    """Return the levels of every condition, and the materials; see `Diagnosis.tested`."""
    specimens = campaign.specimens
    found: dict[str, tuple[float | str, ...]] = {}
    for name in ("temperature_C", "soak_h", "age_days"):
        found[name] = _levels([getattr(s, name) for s in specimens], name)
    found["strain_rate_per_s"] = _levels([r for s in specimens for r in _rates(s)], "rate_mm_s")
    found["orientation"] = tuple(sorted({s.orientation for s in specimens if s.orientation}))
    spans = [s.coordinates for s in specimens if s.coordinates is not None]
    found["material"] = tuple(
        m.id
        for m in campaign.palette.materials
        if any(s.material is not None and campaign.palette.resolve(s.material) == m
               for s in specimens)
        or any(span.min() <= m.coordinate <= span.max() for span in spans)
    )  # fmt: skip
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
    setup = model.setup
    sign = np.where(setup.pushed, -1.0, 1.0)[:, None]
    signs = sign[model.test_of]
    measured = signs * model.measured_N
    before = signs * specimen_forces_N(problem, Candidate(()))
    after = signs * specimen_forces_N(problem, chosen)
    return Traces(
        label=tuple(_label(specimens[members[0]], specimens) for members in model.tests),
        rows=[list(members) for members in model.tests],
        travel_mm=setup.travel_mm,
        time_s=setup.time_s,
        before_N=sign * predict(setup, model.laws).force_N,
        after_N=sign * predict(applied(chosen, setup), model.laws).force_N,
        measured_N=measured,
        residual_before=signed_error((measured - before) / model.peaks_N),
        residual_after=signed_error((measured - after) / model.peaks_N),
        specimens=tuple(s.id for s in specimens),
        columns=axis_columns(problem.campaign),
    )


def _label(specimen: Specimen, specimens: tuple[Specimen, ...]) -> str:
    """Return what a test is, by the columns that vary in the campaign."""
    parts = [specimen.named]
    parts += ["compressed"] if specimen.pushed else []
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
    for one in not_testable:
        other = EFFECTS[one.id]
        needs = (*other.covariates, *other.channels)
        alike = [
            id for id in effects if id in EFFECTS and set(EFFECTS[id].where) & set(other.where)
        ]
        if not alike or _NEVER_THERE & set(needs):
            continue
        axes = [axis for axis in other.where if any(axis in EFFECTS[id].where for id in alike)]
        tests = " and ".join(", or ".join(TESTS[n] for n in need.split("|")) for need in needs)
        settle = f"; to settle it, {tests}" if tests else ""
        yield (
            f"{other.id} could not be tested ({one.reason}), but shows along "
            f"{' and '.join(axes)} as {' and '.join(alike)} {'do' if len(alike) > 1 else 'does'}, "
            f"and may be the cause instead, or a part of it{settle}"
        )


_OF_UNITS = frozenset({"force-scale", "strain-scale"})
"""Effects of which a mixed-up unit is a form."""

_Progress = Callable[[int, int, str], None]
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
    without = (without,) if isinstance(without, str) else tuple(without)
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
        rng = np.random.default_rng(seed)
        evidence = evidence_of(problem, weighed)
        ranking = ranking_of(evidence, priors)
        verdict = verdict_of(ranking)
        gap = closure(problem, weighed, evidence.vain, verdict, rng, progress)
        chosen = weighed.best.get(verdict, Candidate(()))
        nodes = weighed.plain.elimination(problem.target, kept=problem.nodes)
        where, remainder = _places_of(problem, chosen, rng)
        same_class = class_of(problem, weighed, ranking, verdict)
        mending = [problem.unit_of for problem in data_quality if problem.unit_of is not None]
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
            effect=found_effects(problem, weighed, chosen),
            remainder=remainder,
            data_quality=data_quality,
            next_experiments=next_experiments(problem, weighed, ranking, rng),
            detectable=detectable_sizes(problem, nodes, priors),
            limitations=(
                *campaign.limitations,
                *model.limitations,
                *_cautions(problem),
                *_confounders(verdict, reasons),
            ),
            unit_of=merged_units([*_units_of(problem, weighed, same_class), *mending]),
            recalibration=_recalibration_of(weighed.settled_as(chosen).world, chosen),
            tested=levels_tested(campaign),
            seed=seed,
            traces=_traces_of(problem, chosen),
            own_palette=campaign.palette,
        )
        return replace(found, summary=summary_of(found))


def _units_of(
    problem: Problem, weighed: Weighed, same_class: Sequence[Effects]
) -> Iterator[UnitOf]:
    """Yield the units that the hypotheses of a class say the numbers are in."""
    for effects in same_class:
        if _OF_UNITS & set(effects):
            found = found_effects(problem, weighed, weighed.best[effects])
            yield from suggested_units(found, problem.campaign.specimens)


def prepared(
    campaign: Campaign, without: Sequence[str] = (), progress: _Progress | None = None
) -> tuple[Problem, tuple[Untestable, ...], tuple[QualityProblem, ...]]:
    """Return a campaign ready for weighing, the effects that it says nothing about, and its faults.

    Of specimens that cannot be compared none is told.
    """
    for id in without:
        effect_named(id, EFFECTS, "`without`")
    campaign = with_modes(campaign)
    library = {id: e for id, e in effects_for(campaign.palette).items() if id not in without}
    reasons = {id: untestable(effect, campaign) for id, effect in library.items()}
    effects = [effect for id, effect in library.items() if reasons[id] is None]
    campaign, model = _comparable(campaign)
    quality = examine(campaign)
    problem = set_up(campaign, model, effects, progress, _strays(campaign, quality))
    untold = (Untestable(id, told) for id, told in reasons.items() if told is not None)
    return problem, tuple(untold), quality


def _strays(campaign: Campaign, quality: Sequence[QualityProblem]) -> set[str]:
    """Return the specimen that differs from its replicates by more than scatter, if one does.

    Or the two of which it cannot be told. Several are no strays: something sets them apart.
    """
    off = {p.specimen for p in quality if p.kind in ("outlier", "units")}
    found = {s.id for s in campaign.specimens if s.id in off}
    alike = [{campaign.specimens[k].id for k in g} for g in replicate_groups(campaign.specimens)]
    return found if len(found) == 1 or found in alike else set()


def _comparable(campaign: Campaign) -> tuple[Campaign, ObservationModel]:
    """Return the campaign and its model without the specimens whose curves cannot be compared."""
    model = observation_model(campaign)
    if (model.test_of >= 0).all():
        return campaign, model
    kept = tuple(campaign.specimens[k] for k in np.flatnonzero(model.test_of >= 0))
    remarks = (*campaign.remarks, *model.limitations)
    campaign = replace(campaign, specimens=kept, remarks=remarks)
    return campaign, observation_model(campaign)


def _cautions(problem: Problem) -> Iterator[str]:
    """Yield what is to be told of the specimens' number, and of their scatter."""
    specimens, scatter = problem.campaign.specimens, problem.scatter
    if scatter.heterogeneous:
        # Specimens that should be alike and are not: something differs that no effect claims.
        columns = [
            name
            for name in problem.campaign.covariates
            if any(
                len({specimens[k].covariates.get(name) for k in alike}) > 1
                for alike in problem.model.replicates
            )
        ]
        where = (
            f"they differ in column{'s' if len(columns) > 1 else ''} {', '.join(columns)}, which "
            "no effect claims"
            if columns
            else "no column tells them apart"
        )
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
