"""Diagnose a campaign: where its gap lies, which effect causes it, how far it closes, what next."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from planner.errors import UnknownNameError, nearest_names
from planner.gap.campaign import Campaign
from planner.gap.closure import closure, refutes, without_effect
from planner.gap.diagnosis import Diagnosis, Quality, Untestable
from planner.gap.effects import EFFECTS, Effect, effects_for
from planner.gap.effects.testable import untestable
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.detectable import detectable_sizes
from planner.gap.evidence.intervals import found_effects
from planner.gap.evidence.posterior import class_of, verdict_of
from planner.gap.evidence.priors import Priors
from planner.gap.evidence.problem import Problem, set_up
from planner.gap.evidence.ranking import ranking_of, without_refuted
from planner.gap.evidence.unlike import caution
from planner.gap.evidence.weigh import Effects, weigh
from planner.gap.experiments import next_experiments
from planner.gap.forward.mount import Mounted, mount
from planner.gap.look_alikes import look_alikes
from planner.gap.quality import examine
from planner.gap.remainder import places_of, recalibration_of
from planner.gap.traces import traces_of

__all__ = ["LEAST_PROBABILITY", "RANKED", "diagnose", "prepared"]

Progress = Callable[[int, int, str], None]
RANKED = 12
LEAST_PROBABILITY = 1e-4


def diagnose(
    campaign: Campaign,
    *,
    seed: int = 0,
    without: Sequence[str] = (),
    progress: Progress | None = None,
    priors: Priors | None = None,
) -> Diagnosis:
    """Return the diagnosis of a campaign.

    Parameters
    ----------
    seed
        Of resampling; the same campaign and seed give the same diagnosis.
    without
        Effects to take out of the library, to see whether their absence is noticed.
    progress
        Called with how much is done, of how much, and what.

    Raises
    ------
    UnknownNameError
        An effect in `without` that there is not.
    """
    # Small matrices: more threads only get into each other's way, and change the last digits.
    with threadpool_limits(1, user_api="blas"):
        return _diagnose(campaign, seed, without, progress, priors or Priors())


def _diagnose(
    campaign: Campaign,
    seed: int,
    without: Sequence[str],
    progress: Progress | None,
    priors: Priors,
) -> Diagnosis:
    problem, reasons = prepared(campaign, without, progress)
    campaign, mounted = problem.campaign, problem.mounted
    weighed = weigh(problem, priors)
    rng = np.random.default_rng(seed)
    ranking = ranking_of(problem, weighed)
    verdict = verdict_of(ranking)
    gap = closure(problem, priors, verdict, rng, progress)
    refuted = verdict if refutes(gap) else None
    if refuted is not None:
        ranking, gap = without_refuted(ranking), without_effect(gap)
        verdict = verdict_of(ranking)
    chosen = weighed.best.get(verdict, Candidate(()))
    nominal = weighed.nominal
    where, remainder = places_of(problem, chosen, rng)
    return Diagnosis(
        campaign=campaign.name,
        palette=campaign.palette.name,
        palette_sha256=campaign.palette.sha256,
        specimens=len(campaign.specimens),
        tests=len(mounted.tests),
        verdict=_name(verdict),
        ranking=tuple(
            replace(h, effects=h.effects or ("none",))
            for h in ranking[:RANKED]
            if h.probability >= LEAST_PROBABILITY
        ),
        same_class=tuple(e or ("none",) for e in class_of(problem, weighed, ranking, verdict)),
        not_testable=reasons,
        where=where,
        gap=gap,
        effect=found_effects(problem, nominal, chosen),
        remainder=remainder,
        data_quality=tuple(Quality(p.specimen, p.kind, p.problem) for p in examine(campaign)),
        next_experiments=next_experiments(problem, weighed, ranking, rng),
        detectable=detectable_sizes(problem, nominal, priors),
        limitations=(
            *campaign.limitations,
            *mounted.limitations,
            *_cautions(problem, refuted),
            *look_alikes(verdict, reasons),
        ),
        recalibration=recalibration_of(problem, chosen),
        seed=seed,
        traces=traces_of(problem, chosen),
    )


def prepared(
    campaign: Campaign, without: Sequence[str] = (), progress: Progress | None = None
) -> tuple[Problem, tuple[Untestable, ...]]:
    """Return a campaign ready for weighing, and the effects that it says nothing about."""
    effects, reasons = _library(campaign, without)
    campaign, mounted = _mounted(campaign)
    return set_up(campaign, mounted, effects, progress), reasons


def _library(
    campaign: Campaign, without: Sequence[str]
) -> tuple[tuple[Effect, ...], tuple[Untestable, ...]]:
    for id in without:
        if id not in EFFECTS:
            near = nearest_names(id, list(EFFECTS))
            hint = f"did you mean {near[0]}? " if near else ""
            raise UnknownNameError(
                f"--without {id}: no such effect; {hint}there are {', '.join(EFFECTS)}"
            )
    effects, reasons = [], []
    for id, effect in effects_for(campaign.palette).items():
        if id in without:
            continue
        reason = untestable(effect, campaign)
        if reason is not None:
            reasons.append(Untestable(id, reason))
        else:
            effects.append(effect)
    return tuple(effects), tuple(reasons)


def _mounted(campaign: Campaign) -> tuple[Campaign, Mounted]:
    """Mount a campaign without the specimens whose curves cannot be compared."""
    mounted = mount(campaign)
    used = sorted(place for test in mounted.tests for place in test)
    if len(used) == len(campaign.specimens):
        return campaign, mounted
    kept = tuple(campaign.specimens[place] for place in used)
    remarks = (*campaign.remarks, *mounted.limitations)
    campaign = replace(campaign, specimens=kept, remarks=remarks)
    return campaign, mount(campaign)


def _name(effects: Effects) -> str:
    return "+".join(effects) or "none"


def _cautions(problem: Problem, refuted: Effects | None) -> tuple[str, ...]:
    found = []
    if refuted is not None:
        found.append(
            f"{_name(refuted)} fits best, but predicts conditions that are left out worse than "
            "the palette alone does: it is no explanation"
        )
    n = len(problem.campaign.specimens)
    unlike = caution(problem)
    if unlike is not None:
        found.append(unlike)
    if problem.scatter.degrees_of_freedom == 0:
        found.append(
            "no two specimens were made and tested alike, so that scatter is not measured but "
            "taken to be what is usual (3 % from specimen to specimen): print replicates"
        )
    if n < 6:
        found.append(
            f"{n} specimen{'s' if n > 1 else ''} cannot tell causes apart: take the verdict as "
            "a hint of what to test next"
        )
    return tuple(found)
