"""From weighed hypotheses to the ranking that a diagnosis reports."""

from collections.abc import Sequence

from planner.gap.diagnosis import Hypothesis
from planner.gap.evidence.misfit import shy, without_misfits
from planner.gap.evidence.posterior import UNKNOWN, evened_out, posterior
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.unlike import with_unlike
from planner.gap.evidence.weigh import Weighed

__all__ = ["ranking_of", "without_refuted"]


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
    gives its probability to the unknown.
    """
    nothing = [h for h in ranking if h.effects == ()]
    rest = 1.0 - sum(h.probability for h in nothing)
    named = [
        Hypothesis(h.effects, 0.0, h.with_unknown)
        for h in ranking
        if h.effects not in ((), UNKNOWN)
    ]
    kept = [*nothing, Hypothesis(UNKNOWN, rest, 0.0), *named]
    return tuple(sorted(kept, key=lambda h: -h.probability))
