"""Interpolation weights of a branch's nodes, and the figures of a candidate by them."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from planner.arrays import FloatArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.nodes import SHAPE_NODES, SIZE_NODES, Branch

__all__ = ["figures_of", "node_weights"]


def node_weights(branch: Branch, place: Sequence[float]) -> FloatArray:
    """Return the weight of each node of a branch at a place."""
    size = _lagrange((0.0, *SIZE_NODES), place[0])[1:]
    shapes = [_lagrange(nodes, at) for nodes, at in zip(SHAPE_NODES, place[1:], strict=False)]
    return np.array([np.prod(parts) for parts in product(size, *shapes)])


def figures_of(candidate: Candidate, node_figures: FloatArray) -> FloatArray:
    """Return how a candidate's effects change the figures, by interpolation, (N,)."""
    total = np.zeros(node_figures.shape[1])
    for branch, place in zip(candidate.branches, candidate.places, strict=True):
        nodes = slice(branch.first, branch.first + branch.nodes)
        total += node_weights(branch, place) @ node_figures[nodes]
    return total


def _lagrange(at: tuple[float, ...], x: float) -> list[float]:
    return [float(np.prod([(x - b) / (a - b) for b in at if b != a])) for a in at]
