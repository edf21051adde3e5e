"""From weighed hypotheses to the ranking that a diagnosis reports."""

from planner.gap.diagnosis import Hypothesis
from planner.gap.evidence.misfit import shy, without_misfits
from planner.gap.evidence.posterior import evened_out, posterior
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.unlike import with_unlike
from planner.gap.evidence.weigh import Weighed

__all__ = ["ranking_of"]


def ranking_of(problem: Problem, weighed: Weighed) -> tuple[Hypothesis, ...]:
    """Return hypotheses, the most probable first.

    What does not fit gives way to the unknown, what looks the same shares its probability, and few
    specimens name little; where replicates are not alike, something is at work.
    """
    fitting = without_misfits(problem, weighed, posterior([weighed.log_odds]))
    named = shy(evened_out(problem, weighed, fitting), len(problem.campaign.specimens))
    return with_unlike(problem, named)
