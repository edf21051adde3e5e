"""Weigh one candidate on its own columns, with what its form may depart by."""

from dataclasses import dataclass, replace

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.discrepancy import discrepancy_patterns
from planner.gap.evidence.gram import Elimination, Gram
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.search_kernels import weigh_single
from planner.gap.evidence.subset import weigh_subset_beside
from planner.gap.evidence.weights import node_weights

__all__ = ["Refiner", "Weight"]


@dataclass(frozen=True, slots=True)
class Weight:
    """Gain and log evidence over no effect at the same scale of scatter, and the best place."""

    gain: float
    evidence: float
    place: tuple[float, ...]


class Refiner:
    """One candidate's columns: the residual, its nodes, perhaps the unknown's, and all nuisances.

    Its form is right, or departs as `discrepancy_patterns` says: with equal probability.
    """

    def __init__(
        self,
        problem: Problem,
        gram: Gram,
        candidate: Candidate,
        weight: FloatArray | None,
        *,
        unknown: bool = False,
    ) -> None:
        self.candidate = candidate
        self._scatter = problem.scatter
        start = problem.nodes.start
        nodes = [start + b.first + np.arange(b.nodes) for b in candidate.branches]
        self.head = 1 + sum(len(n) for n in nodes)
        total = len(gram.products)
        first = problem.gains.start if unknown else total - gram.nuisances
        self._gains = problem.gains.stop - problem.gains.start
        columns: IntArray = np.concatenate([[0], *nodes, np.arange(first, total)]).astype(np.int64)
        self._shift = self.head - problem.gains.start
        own, form = discrepancy_patterns(
            candidate, problem.node_figures, problem.factors, problem.noise, problem.table
        )
        rows = None if weight is None else np.repeat(weight, np.diff(problem.whitened.first_row))
        white = problem.whitened.columns[:, columns]
        self._extras = [_inner(p, white, rows) for p in (own, np.concatenate([own, form], axis=1))]
        self._gram = Gram(gram.products[np.ix_(columns, columns)], gram.rows, gram.nuisances)
        self._firsts = np.cumsum([0, *[b.nodes for b in candidate.branches]])[:-1].astype(np.int64)
        self._shapes = np.array([b.shapes for b in candidate.branches], dtype=np.int64)
        self._lows = np.array([b.least for b in candidate.branches])

    def eliminate(self, scale: float) -> list[Elimination]:
        """Integrate over nuisances: with the form as it is, and with departures from it."""
        return [self._gram.eliminate(scale, extra) for extra in self._extras]

    def weigh(self, eliminations: list[Elimination], none: float) -> Weight:
        """Return the candidate's weight; `none` is ln p of no effect at that scale."""
        found = [self._weigh(e, none) for e in eliminations]
        evidence = float(np.logaddexp.reduce([w.evidence for w in found]) - np.log(len(found)))
        best = max(found, key=lambda w: w.evidence)
        return Weight(best.gain, evidence, best.place)

    def likelier(self, none: float) -> Elimination:
        """Return the inner products, at the nominal scatter, under which it weighs more."""
        return max(self.eliminate(1.0), key=lambda e: self._weigh(e, none).evidence)

    def _weigh(self, elimination: Elimination, none: float) -> Weight:
        a = elimination.products
        place = self.candidate.flat
        gain, evidence = weigh_single(
            np.ascontiguousarray(a[0, 1 : self.head]),
            np.ascontiguousarray(a[1 : self.head, 1 : self.head]),
            self._firsts, self._shapes, self._lows, place,
        )  # fmt: skip
        shift = elimination.none - none
        return Weight(float(gain) + shift, float(evidence) + shift, tuple(place.tolist()))

    def subset(self, scale: float, none: float) -> Candidate:
        """Return the candidate with some specimens' force off by a factor beside it.

        Needs the unknown's columns, with which the gains' are.
        """
        gains = slice(self.head, self.head + self._gains)
        found = []
        # Each specimen's own size of the effect would take up its gain: with and without these.
        for elimination in [self._gram.eliminate(scale), *self.eliminate(scale)]:
            weight = self._weigh(elimination, none)
            candidate = self.candidate.at(weight.place, weight.gain, weight.evidence)
            parts = zip(candidate.branches, candidate.places, strict=True)
            nodes = np.concatenate([node_weights(b, p) for b, p in parts])
            found.append(weigh_subset_beside(elimination, gains, candidate, nodes, self._scatter))
        evidence = float(np.logaddexp.reduce([c.log_evidence for c in found]) - np.log(len(found)))
        best = max(found, key=lambda c: c.log_evidence)
        return replace(best, log_evidence=evidence)

    def beside(
        self, eliminations: list[Elimination], axis: slice, amplitude: float
    ) -> list[Elimination]:
        """Add an unknown along one axis, given by its columns in the problem."""
        at = slice(axis.start + self._shift, axis.stop + self._shift)
        return [e.with_random(at, amplitude, self.head) for e in eliminations]


def _inner(
    patterns: FloatArray, columns: FloatArray, rows: FloatArray | None
) -> tuple[FloatArray, FloatArray] | None:
    if not patterns.shape[1]:
        return None
    weighted = patterns if rows is None else patterns * rows[:, None]
    return weighted.T @ columns, weighted.T @ patterns
