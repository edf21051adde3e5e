"""From weighed hypotheses to the ranking that a diagnosis reports."""

from collections.abc import Sequence
from dataclasses import replace

from planner.gap.diagnosis import Hypothesis
from planner.gap.evidence.misfit import shy, without_misfits
from planner.gap.evidence.posterior import UNKNOWN, evened_out, posterior, with_unknown
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.unlike import with_unlike
from planner.gap.evidence.weigh import Weighed

__all__ = ["ranking_of", "without_refuted"]


GIVEN_UP = 0.7
"""Share of what is named that an explanation gives up which does not predict."""


def ranking_of(problem: Problem, weighed: Weighed) -> tuple[Hypothesis, ...]:
    """Return hypotheses, the most probable first.

    What does not fit gives way to the unknown, what looks the same shares its probability, and few
    specimens name little; where replicates are not alike, something is at work.
    """
    fitting = without_misfits(problem, weighed, posterior([weighed.log_odds]))
    named = shy(evened_out(problem, weighed, fitting), len(problem.campaign.specimens))
    return with_unlike(problem, named)


def without_refuted(ranking: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the ranking of a campaign whose leading explanation predicts worse than none.

    Folds choose among all hypotheses anew, so that what fails is no one of them: all that is named
    gives most of its probability to the unknown, and keeps its place behind it.
    """
    kept = [
        h
        if h.effects in ((), UNKNOWN)
        else replace(h, probability=(1.0 - GIVEN_UP) * h.probability)
        for h in ranking
    ]
    lost = sum(GIVEN_UP * h.probability for h in ranking if h.effects not in ((), UNKNOWN))
    return with_unknown(kept, lost)
