"""Odds on resampled specimens, so that a verdict that hangs on a few of them says so."""

import numpy as np

from planner.gap.evidence.posterior import LogOdds
from planner.gap.evidence.priors import Priors
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weigh import Weighed, weigh

__all__ = ["resampled_odds"]

RUNS = 0


def resampled_odds(
    problem: Problem, priors: Priors, weighed: Weighed, rng: np.random.Generator
) -> list[LogOdds]:
    """Return log odds on specimens weighted at random (Bayesian bootstrap)."""
    n = len(problem.campaign.specimens)
    runs: list[LogOdds] = []
    for _ in range(RUNS if n > 5 else 0):
        weight = rng.dirichlet(np.ones(n)) * n
        runs.append(weigh(problem, priors, weight).log_odds)
    return runs
