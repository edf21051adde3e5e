"""The best parameters of every form and of the pairs that matter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.gram import Elimination
from planner.gap.evidence.nodes import Branch
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.search_kernels import best_pair, best_single, scan_pairs, weigh_single

__all__ = ["Pair", "Pairs", "Search", "Singles"]

PAIRS = 30
"""Pairs of effects that pass the scan."""

FORMS = 3
"""Combinations of forms of such a pair that are weighed."""


@dataclass(frozen=True, slots=True, eq=False)
class Singles:
    """Of every branch: best place (B, 3), gain and log evidence (B,) over no effect."""

    place: FloatArray
    gain: FloatArray
    evidence: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Of M pairs of branches (M, 2): best places (M, 6), gain and log evidence (M,)."""

    branches: IntArray
    place: FloatArray
    gain: FloatArray
    evidence: FloatArray


Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """The branches of a problem, ready to be searched on any inner products."""

    problem: Problem
    effect: IntArray
    firsts: IntArray
    shapes: IntArray
    lows: FloatArray

    @classmethod
    def of(cls, problem: Problem) -> "Search":
        """Give each of a problem's effects a number."""
        ids = {id: k for k, id in enumerate(dict.fromkeys(b.effect.id for b in problem.branches))}
        return cls(
            problem,
            np.array([ids[b.effect.id] for b in problem.branches], dtype=np.int64),
            np.array([b.first for b in problem.branches], dtype=np.int64),
            np.array([b.shapes for b in problem.branches], dtype=np.int64),
            np.array([b.least for b in problem.branches]),
        )

    def inner(self, elimination: Elimination) -> tuple[FloatArray, FloatArray]:
        """Return inner products of nodes with the residual and with one another."""
        a, nodes = elimination.products, self.problem.nodes
        return np.ascontiguousarray(a[0, nodes]), np.ascontiguousarray(a[nodes, nodes])

    def singles(self, elimination: Elimination) -> Singles:
        """Search every branch alone."""
        count = len(self.firsts)
        gain, evidence, place = np.empty(count), np.empty(count), np.zeros((count, 3))
        best_single(*self.inner(elimination), self.firsts, self.shapes, self.lows, place, gain,
                    evidence)  # fmt: skip
        return Singles(place, gain, evidence)

    def scan(self, elimination: Elimination, place: FloatArray) -> Pairs:
        """Return the pairs worth weighing, with sizes to start from; shapes are held at `place`."""
        count = len(self.firsts)
        gain = np.full((count, count), -np.inf)
        sizes = np.zeros((count, count, 2))
        scan_pairs(*self.inner(elimination), self.firsts, self.shapes, self.lows, place,
                   self.effect, gain, sizes)  # fmt: skip
        groups: dict[Pair, list[tuple[float, int, int]]] = {}
        for k, other in np.argwhere(np.isfinite(gain)).tolist():
            low, high = sorted((int(self.effect[k]), int(self.effect[other])))
            groups.setdefault((low, high), []).append((float(gain[k, other]), k, other))
        ranked = sorted((sorted(group, reverse=True) for group in groups.values()), reverse=True)
        chosen = [(k, o) for group in ranked[:PAIRS] for _, k, o in group[:FORMS]]
        starts = np.zeros((len(chosen), 6))
        for row, (k, other) in enumerate(chosen):
            starts[row, :3], starts[row, 3:] = place[k], place[other]
            starts[row, [0, 3]] = sizes[k, other]
        none = np.full(len(chosen), -np.inf)
        return Pairs(np.array(chosen, dtype=np.int64).reshape(-1, 2), starts, none, none)

    def pairs(self, elimination: Elimination, start: Pairs) -> Pairs:
        """Search pairs from where they start."""
        count = len(start.branches)
        gain, evidence, place = np.empty(count), np.empty(count), start.place.copy()
        if count:
            best_pair(*self.inner(elimination), self.firsts[start.branches],
                      self.shapes[start.branches], self.lows[start.branches], place, gain,
                      evidence)  # fmt: skip
        return Pairs(start.branches, place, gain, evidence)

    def climb(
        self, inner: tuple[FloatArray, FloatArray], firsts: IntArray, candidate: Candidate
    ) -> tuple[float, float]:
        """Improve a candidate on inner products of its own nodes; return gain and log evidence."""
        numbers = [b.number for b in candidate.branches]
        gain, evidence = weigh_single(
            *inner, firsts, self.shapes[numbers], self.lows[numbers], candidate.flat
        )
        return float(gain), float(evidence)

    def candidate(
        self, numbers: Sequence[int], places: Sequence[FloatArray], gain: float, evidence: float
    ) -> Candidate:
        """Return the candidate of branches by number, effects sorted."""
        branches: list[Branch] = [self.problem.branches[k] for k in numbers]
        order = sorted(range(len(branches)), key=lambda i: branches[i].effect.id)
        cut = [tuple(p[: 1 + b.shapes].tolist()) for b, p in zip(branches, places, strict=True)]
        return Candidate(
            tuple(branches[i].effect.id for i in order),
            tuple(branches[i] for i in order),
            tuple(cut[i] for i in order),
            gain,
            evidence,
        )
