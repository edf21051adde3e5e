"""The smallest size of each effect that this campaign would have shown."""

import numpy as np

from planner.gap.diagnosis import Detectable
from planner.gap.evidence.gram import Elimination
from planner.gap.evidence.nodes import Branch
from planner.gap.evidence.priors import Priors
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weights import node_weights

__all__ = ["detectable_sizes"]

WIDTH_NATS = 3.0
"""What the freedom of size and shape costs an effect, beyond its prior odds."""

_SIZES = 60


def detectable_sizes(
    problem: Problem, elimination: Elimination, priors: Priors
) -> tuple[Detectable, ...]:
    """Return, of each effect's first form, the size whose expected evidence would name it.

    That is where half the squared length of its whitened pattern, nuisances projected out, makes
    up for the prior odds against it and the width of its prior; shapes are at their middle.
    """
    ids = tuple(dict.fromkeys(b.effect.id for b in problem.branches))
    if not ids:
        return ()
    needed = float(np.log(priors.none * len(ids) / priors.single)) + WIDTH_NATS
    found = []
    for id in ids:
        branches = [b for b in problem.branches if b.effect.id == id]
        first = [b for b in branches if b.form is branches[0].form]
        sizes = [_smallest(problem, elimination, b, needed) for b in first]
        known = [s for s in sizes if s is not None]
        size = first[0].form.size
        found.append(Detectable(id, size.name, min(known, default=None), size.unit))
    return tuple(found)


def _smallest(
    problem: Problem, elimination: Elimination, branch: Branch, needed: float
) -> float | None:
    first = problem.nodes.start + branch.first
    own = slice(first, first + branch.nodes)
    g = elimination.products[own, own]
    for s in np.geomspace(branch.least, 1.0, _SIZES).tolist():
        c = node_weights(branch, [s] + [0.0] * branch.shapes)
        if 0.5 * float(c @ g @ c) >= needed:
            return float(branch.form.size.high * s**2)
    return None
