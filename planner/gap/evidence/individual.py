"""Effects whose size is each specimen's own: what the specimens differ by, as nuisances."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weights import node_weights

__all__ = ["individual_columns"]


def individual_columns(
    problem: Problem, candidate: Candidate, weight: FloatArray | None
) -> tuple[FloatArray, FloatArray] | None:
    """Return inner products of the specimens' own deviations, (n, X) and (n, n).

    A specimen's deviation has the course of the effect itself at its best size, and the
    coefficient of variation that the effect states. None where all specimens have it alike.
    """
    branch, place = candidate.branches[0], candidate.places[0]
    cv = branch.effect.individual
    if cv <= 0.0:
        return None
    whitened = problem.whitened
    first = problem.nodes.start + branch.first
    pattern = whitened.columns[:, first : first + branch.nodes] @ node_weights(branch, place)
    pattern *= cv
    begin = whitened.first_row[:-1]
    rows = np.ones(len(pattern))
    if weight is not None:
        rows = np.repeat(weight, np.diff(whitened.first_row))
    cross = np.add.reduceat(whitened.columns * (pattern * rows)[:, None], begin, axis=0)
    return cross, np.diag(np.add.reduceat(pattern**2 * rows, begin))
