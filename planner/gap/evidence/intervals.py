"""How well a candidate's parameters are known."""

from itertools import product

import numpy as np

from planner.arrays import FloatArray
from planner.gap.diagnosis import FoundEffect
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.gram import Elimination
from planner.gap.evidence.nodes import Branch
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.refine import Refiner
from planner.gap.evidence.weights import node_weights

__all__ = ["found_effects"]

POINTS = 13
DROP = 4.5
"""Places whose log likelihood is lower than the best one's by this do not count."""

LEVEL = 0.90


def found_effects(
    problem: Problem, nominal: Elimination, candidate: Candidate
) -> tuple[FoundEffect, ...]:
    """Return each effect's form and parameters with 90 % intervals, the other's held at its best.

    Intervals are the posterior's under the form's own prior, on a grid around the best place.
    """
    found = []
    if candidate.branches:
        refiner = Refiner(problem, problem.whitened.gram(), candidate, None)
        products = refiner.likelier(nominal.none).products
        found = [_found(products, candidate, k) for k in range(len(candidate.branches))]
    if candidate.members is not None:
        found.append(_some(problem, nominal, candidate))
    return tuple(sorted(found, key=lambda effect: effect.id))


def _some(problem: Problem, elimination: Elimination, candidate: Candidate) -> FoundEffect:
    assert candidate.members is not None
    h = elimination.products[problem.gains, problem.gains]
    sd = 1.0 / np.sqrt(max(float(candidate.members @ h @ candidate.members), 1e-12))
    factor = float(np.exp(candidate.log_gain))
    names = tuple(
        s.id
        for s, member in zip(problem.campaign.specimens, candidate.members, strict=True)
        if member
    )
    ends = (factor * float(np.exp(-1.645 * sd)), factor * float(np.exp(1.645 * sd)))
    return FoundEffect(
        "force-scale", "of-some-specimens", {"factor": factor}, {"factor": ends}, {"factor": "1"},
        names,
    )  # fmt: skip


def _found(products: FloatArray, candidate: Candidate, number: int) -> FoundEffect:
    branch, place = candidate.branches[number], candidate.places[number]
    b, g = _inner(products, candidate, number)
    ends = [_reach(branch, place, d, b, g) for d in range(len(place))]
    axes = [np.linspace(low, high, POINTS) for low, high in ends]
    grid = list(product(*axes))
    weights = np.array([node_weights(branch, point) for point in grid])
    log = weights @ b - 0.5 * np.sum((weights @ g) * weights, axis=1)
    # The prior of a size is uniform in its logarithm: ds / s.
    log -= np.log([point[0] for point in grid])
    mass = np.exp(log - log.max()).reshape([POINTS] * len(axes))
    interval: dict[str, tuple[float, float]] = {}
    best = branch.values(place)
    for d, parameter in enumerate(branch.form.parameters):
        marginal = mass.sum(axis=tuple(k for k in range(len(axes)) if k != d))
        low, high = _quantiles(axes[d], marginal)
        one = [list(place), list(place)]
        one[0][d], one[1][d] = low, high
        values = sorted(branch.values(p)[parameter.name] for p in one)
        interval[parameter.name] = (values[0], values[1])
    return FoundEffect(
        branch.effect.id,
        branch.form.name,
        dict(best),
        interval,
        {p.name: p.unit for p in branch.form.parameters},
    )


def _inner(
    products: FloatArray, candidate: Candidate, number: int
) -> tuple[FloatArray, FloatArray]:
    """Return inner products of the branch's nodes with what the other effect leaves, and own."""
    ends = np.cumsum([1, *[b.nodes for b in candidate.branches]])
    own = slice(int(ends[number]), int(ends[number + 1]))
    left = products[own, 0].copy()
    for k, (other, place) in enumerate(zip(candidate.branches, candidate.places, strict=True)):
        if k != number:
            left -= products[own, ends[k] : ends[k + 1]] @ node_weights(other, place)
    return left, products[own, own]


def _reach(
    branch: Branch, place: tuple[float, ...], d: int, b: FloatArray, g: FloatArray
) -> tuple[float, float]:
    """Return how far along one direction the likelihood has not dropped by `DROP`."""
    low, high = (branch.least, 1.0) if d == 0 else (-1.0, 1.0)

    def drop(x: float) -> float:
        point = list(place)
        point[d] = x
        c = node_weights(branch, point)
        return best - float(c @ b - 0.5 * c @ g @ c)

    c = node_weights(branch, place)
    best = float(c @ b - 0.5 * c @ g @ c)
    ends = []
    for end in (low, high):
        inside, outside = place[d], end
        if drop(end) <= DROP:
            ends.append(end)
            continue
        for _ in range(20):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if drop(middle) <= DROP else (inside, middle)
        ends.append(outside)
    # Other parameters move along: the reach at held ones is too short by up to this.
    widen = 1.0 if len(place) == 1 else 2.5
    return (
        max(low, place[d] + widen * (ends[0] - place[d])),
        min(high, place[d] + widen * (ends[1] - place[d])),
    )


def _quantiles(at: FloatArray, mass: FloatArray) -> tuple[float, float]:
    share = np.cumsum(mass)
    share = (share - 0.5 * mass) / share[-1]
    tail = 0.5 * (1.0 - LEVEL)
    low, high = np.interp([tail, 1.0 - tail], share, at).tolist()
    return low, high
