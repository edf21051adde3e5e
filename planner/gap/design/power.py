"""What a planned campaign would show of each effect, and what it could not tell apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import ndtr

from planner.arrays import FloatArray
from planner.gap.evidence.detectable import WIDTH_NATS, detectable_sizes
from planner.gap.evidence.gram import Elimination, whiten
from planner.gap.evidence.nodes import Branch
from planner.gap.evidence.priors import Priors
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weights import node_weights
from planner.gap.features.table import BRANCHES
from planner.gap.imitation.stated_effect import usual_value

__all__ = ["ALIKE", "Expected", "batch_level", "elimination_of", "expected_of", "usual_patterns"]

ALIKE = 0.95
"""Cosine of patterns above which two effects are one to the diagnosis."""

_SHAPES = (-1.0, 0.0, 1.0)
_FIELD = BRANCHES.index("field")


@dataclass(frozen=True, slots=True)
class Expected:
    """What is to be expected of one effect.

    Attributes
    ----------
    parameter, unit
        Of its first form's size.
    smallest
        That would be named rather than no effect; None if not even the largest would.
    usual
        The middle of its prior.
    probability
        That an effect of this size is named, no other beside it.
    alike
        Effects of those that were asked for whose pattern is the same to 0.95.
    others
        Further effects of the library of which that is true.
    """

    id: str
    parameter: str
    unit: str
    smallest: float | None
    usual: float
    probability: float
    alike: tuple[str, ...]
    others: tuple[str, ...]


def usual_place(branch: Branch) -> list[float]:
    """Return the place of a branch at the middle of its form's prior."""
    size = branch.form.size
    return [float(np.sqrt(usual_value(size) / size.high)), *[0.0] * branch.shapes]


def usual_patterns(problem: Problem, ids: Sequence[str]) -> FloatArray:
    """Return whitened patterns of effects at the middle of their priors, (N, k).

    Every form has one, all forms of an effect together weighing as one.
    """
    nodes = problem.whitened.columns[:, problem.nodes]
    patterns = []
    for id in ids:
        branches = [b for b in problem.branches if b.effect.id == id and b.sign > 0.0]
        for b in branches:
            own = nodes[:, b.first : b.first + b.nodes]
            patterns.append(own @ node_weights(b, usual_place(b)) / np.sqrt(len(branches)))
    return np.stack(patterns, axis=1)


def batch_level(problem: Problem) -> FloatArray:
    """Return the whitened pattern of a batch one deviation off, (N,)."""
    force = np.where(problem.table.branch == _FIELD, 0.0, problem.sensitivity)
    return whiten((problem.scatter.batch * force)[:, None], problem.noise, 0).columns[:, 0]


def elimination_of(problem: Problem, weight: FloatArray, batches: int) -> Elimination:
    """Return inner products with nuisances integrated out, batches among them.

    Parameters
    ----------
    weight : (n,)
        How many specimens there are of each condition, spread evenly over the batches.
    """
    gram = problem.whitened.gram(weight)
    level = batch_level(problem)
    rows = np.repeat(weight, np.diff(problem.whitened.first_row)) / batches
    cross = np.tile((rows * level) @ problem.whitened.columns, (batches, 1))
    own = np.eye(batches) * float((rows * level) @ level)
    return gram.eliminate(extra=(cross, own))


def expected_of(
    problem: Problem, elimination: Elimination, asked: Sequence[str], testable: Sequence[str]
) -> tuple[Expected, ...]:
    """Return what to expect of the effects that were asked for.

    An effect is named if its expected evidence makes up for the odds against it and beats that of
    every other testable effect at its best parameters; both are taken to be normally distributed
    about what is expected.
    """
    priors = Priors()
    sizes = {d.id: d for d in detectable_sizes(problem, elimination, priors)}
    needed = float(np.log(priors.none * len(testable) / priors.single)) + WIDTH_NATS
    m = elimination.products[problem.nodes, problem.nodes]
    rivals = {id: _combinations(problem, id) for id in testable}
    found = []
    for id in asked:
        first = next(b for b in problem.branches if b.effect.id == id)
        pattern = np.zeros(len(m))
        pattern[first.first : first.first + first.nodes] = node_weights(first, usual_place(first))
        length2 = float(pattern @ m @ pattern)
        named = float(ndtr(np.sqrt(length2) - np.sqrt(2.0 * needed)))
        cosines = _cosines(m, pattern, length2, {k: v for k, v in rivals.items() if k != id})
        for cosine in cosines.values():
            left = length2 * (1.0 - min(cosine, 1.0) ** 2)
            named = min(named, float(ndtr(0.5 * np.sqrt(max(left, 0.0)))))
        size = first.form.size
        alike = tuple(k for k, cosine in cosines.items() if cosine > ALIKE)
        found.append(
            Expected(
                id=id,
                parameter=size.name,
                unit=size.unit,
                smallest=sizes[id].size,
                usual=usual_value(size),
                probability=named,
                alike=tuple(k for k in alike if k in asked),
                others=tuple(k for k in alike if k not in asked),
            )
        )
    return tuple(found)


def _combinations(problem: Problem, id: str) -> FloatArray:
    """Return combinations of nodes that stand for an effect: sizes, shapes, forms, signs."""
    total = problem.nodes.stop - problem.nodes.start
    rows = []
    for b in problem.branches:
        if b.effect.id != id:
            continue
        for size in (max(b.least, 0.3), usual_place(b)[0], 1.0):
            for shape in product(_SHAPES, repeat=b.shapes):
                row = np.zeros(total)
                row[b.first : b.first + b.nodes] = node_weights(b, [size, *shape])
                rows.append(row)
    return np.array(rows)


def _cosines(
    m: FloatArray, pattern: FloatArray, length2: float, rivals: Mapping[str, FloatArray]
) -> dict[str, float]:
    """Return how alike each rival can be, nuisances projected out."""
    along = m @ pattern
    found = {}
    for id, rows in rivals.items():
        lengths = np.einsum("ki,ij,kj->k", rows, m, rows, optimize=True)
        usable = lengths > 1e-9
        if not usable.any() or length2 <= 0.0:
            continue
        cosines = (rows @ along)[usable] / np.sqrt(lengths[usable] * length2)
        found[id] = float(cosines.max())
    return found
