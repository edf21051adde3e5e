"""Some specimens, but not the others, have their force off by one factor."""

from dataclasses import replace

import numpy as np
from scipy.special import gammaln, logsumexp

from planner.arrays import FloatArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.gram import Elimination
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.subset_kernel import best_subset

__all__ = ["weigh_subset", "weigh_subset_beside"]

FORCE_UNITS = (4.4482216152605, 9.80665, 25.4)
"""Pounds and kilograms for newtons; inches, where somebody scaled the wrong column."""

_GAINS = np.geomspace(0.05, 0.6, 24)
GAMMAS: FloatArray = np.concatenate([_GAINS, -_GAINS, np.log(FORCE_UNITS), -np.log(FORCE_UNITS)])
"""Logarithms of the factor."""

LEAST_MEMBERS = 2
"""One specimen alone is an outlier of the data, not an effect."""


def weigh_subset(problem: Problem, elimination: Elimination) -> Candidate:
    """Return the best subset, with the log evidence of there being one."""
    gains = problem.gains
    b = np.ascontiguousarray(elimination.products[gains, 0])
    h = np.ascontiguousarray(elimination.products[gains, gains])
    return _best(b, h, Candidate(()))


def weigh_subset_beside(
    elimination: Elimination, gains: slice, candidate: Candidate, weights: FloatArray
) -> Candidate:
    """Return the best subset beside a candidate at its best place.

    Parameters
    ----------
    elimination
        Of the residual, the candidate's nodes and the gains, in that order.
    weights
        Of the nodes.
    """
    a = elimination.products
    b = a[gains, 0] - a[gains, 1 : 1 + len(weights)] @ weights
    return _best(np.ascontiguousarray(b), np.ascontiguousarray(a[gains, gains]), candidate)


def _best(b: FloatArray, h: FloatArray, beside: Candidate) -> Candidate:
    n = len(b)
    sizes = np.arange(n + 1)
    log_prior = -(gammaln(n + 1) - gammaln(sizes + 1) - gammaln(n - sizes + 1)) - np.log(n)
    log_prior[sizes > 0.6 * n] = -1e3
    member, best = np.zeros(n), np.zeros(n)
    evidence = np.empty(len(GAMMAS))
    at = int(best_subset(b, h, GAMMAS, log_prior, LEAST_MEMBERS, member, best, evidence))
    # Half of the prior for gains of any size, half for units.
    of_units = np.arange(len(GAMMAS)) >= 2 * len(_GAINS)
    prior = np.where(of_units, 0.5 / of_units.sum(), 0.5 / (~of_units).sum())
    total = float(logsumexp(evidence + np.log(prior)))
    gamma = float(GAMMAS[at])
    gain = float(gamma * best @ b - 0.5 * gamma**2 * best @ h @ best)
    return replace(
        beside,
        effects=tuple(sorted({*beside.effects, "force-scale"})),
        gain=beside.gain + gain,
        log_evidence=beside.log_evidence + total,
        members=best,
        log_gain=gamma,
    )
