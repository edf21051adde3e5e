"""Some specimens, but not the others, have their force off by one factor."""

from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from planner.arrays import FloatArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.gram import Elimination
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.subset_kernel import best_subset
from planner.gap.noise import Scatter

__all__ = ["weigh_subset", "weigh_subset_beside"]

FORCE_UNITS = (4.4482216152605, 9.80665, 25.4)
"""Pounds and kilograms for newtons; inches, where somebody scaled the wrong column."""

_GAINS = np.geomspace(0.05, 0.6, 24)
_UNITS = np.log(FORCE_UNITS)

DISTINCT = 2.5
"""Deviations of the specimens' scatter by which a gain must exceed it: smaller ones are scatter."""

SHARES: FloatArray = np.array([0.07, 0.15, 0.3, 0.5])
"""Of specimens that are members."""

LEAST_MEMBERS = 2
"""One specimen alone is an outlier of the data, not an effect."""


def gains_of(scatter: Scatter) -> tuple[FloatArray, FloatArray]:
    """Return logarithms of the factor, and their log prior: half for any gain, half for units."""
    some = _GAINS[DISTINCT * scatter.specimen <= _GAINS]
    gains = np.concatenate([some, -some, _UNITS, -_UNITS])
    of_units = np.arange(len(gains)) >= 2 * len(some)
    prior = np.where(of_units, 0.5 / of_units.sum(), 0.5 / max(int((~of_units).sum()), 1))
    return gains, np.log(prior)


def weigh_subset(problem: Problem, elimination: Elimination) -> Candidate:
    """Return the best subset, with the log evidence of there being one."""
    gains = problem.gains
    b = np.ascontiguousarray(elimination.products[gains, 0])
    h = np.ascontiguousarray(elimination.products[gains, gains])
    return _best(b, h, Candidate(()), problem.scatter)


def weigh_subset_beside(
    elimination: Elimination,
    gains: slice,
    candidate: Candidate,
    weights: FloatArray,
    scatter: Scatter,
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
    inner = np.ascontiguousarray(a[gains, gains])
    return _best(np.ascontiguousarray(b), inner, candidate, scatter)


def _best(b: FloatArray, h: FloatArray, beside: Candidate, scatter: Scatter) -> Candidate:
    n = len(b)
    gammas, prior = gains_of(scatter)
    belief, best = np.zeros(n), np.zeros(n)
    evidence = np.empty(len(gammas))
    at = int(best_subset(b, h, gammas, SHARES, belief, best, evidence))
    total = float(logsumexp(evidence + prior))
    gamma, members = float(gammas[at]), (best > 0.5).astype(np.float64)
    gain = float(gamma * members @ b - 0.5 * gamma**2 * members @ h @ members)
    if members.sum() < LEAST_MEMBERS:
        total = -np.inf
    return replace(
        beside,
        effects=tuple(sorted({*beside.effects, "force-scale"})),
        gain=beside.gain + gain,
        log_evidence=beside.log_evidence + total,
        members=members,
        log_gain=gamma,
    )
