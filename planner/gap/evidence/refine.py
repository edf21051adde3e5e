"""Weigh one candidate on its own columns, with what its form may depart by."""

from dataclasses import dataclass, replace

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.discrepancy import departures
from planner.gap.evidence.gram import Elimination, Gram
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.search_kernels import weigh_single
from planner.gap.evidence.subset import weigh_subset_beside
from planner.gap.evidence.weights import node_weights

__all__ = ["Refiner", "Weight"]

ROUNDS = 4
SETTLED = 0.1
"""Change of the logarithm of a size that no longer matters."""

LEAST_GROWTH = 1e-4


@dataclass(frozen=True, slots=True)
class Weight:
    """Gain and log evidence over no effect at the same scale of scatter, and the best place."""

    gain: float
    evidence: float
    place: tuple[float, ...]


class Refiner:
    """One candidate's columns: the residual, its nodes, perhaps the unknown's, and all nuisances.

    Its form is right and its size the same for all, or each specimen's own where that is usual, or
    the form departs as `departures` says: with equal probability. Departures are as
    large as the effect that is found with them, so that no large effect bends into a small gap.
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
        found = departures(
            candidate, problem.node_figures, problem.factors, problem.noise, problem.table
        )
        rows = None if weight is None else np.repeat(weight, np.diff(problem.whitened.first_row))
        white = problem.whitened.columns[:, columns]
        self._branch = found.branch
        self._extra = _inner(found.columns, white, rows)
        self._counts = sorted({0, found.own, len(found.branch)})
        self._gram = Gram(gram.products[np.ix_(columns, columns)], gram.rows, gram.nuisances)
        self._firsts = np.cumsum([0, *[b.nodes for b in candidate.branches]])[:-1].astype(np.int64)
        self._shapes = np.array([b.shapes for b in candidate.branches], dtype=np.int64)
        self._lows = np.array([b.least for b in candidate.branches])

        self._settled: list[Elimination] = []
        self._growth = [np.ones(len(candidate.branches)) for _ in self._counts]
        for number in range(len(self._counts)):
            self._settled.append(self._settle(number))

    def _settle(self, number: int) -> Elimination:
        """Find the size at which departures are as large as the effect itself."""
        start = np.array([place[0] for place in self.candidate.places])
        for round_ in range(ROUNDS):
            elimination = self._eliminate(number, 1.0)
            if not self._counts[number]:
                break
            place = np.array(self._weigh(elimination, 0.0).place)
            growth = np.maximum((place[self._first_places()] / start) ** 2, LEAST_GROWTH)
            if round_:
                # Where small departures ask for a large effect and large ones for a small one.
                growth = np.minimum(growth, self._growth[number])
            if np.all(np.abs(np.log(growth / self._growth[number])) < SETTLED):
                break
            self._growth[number] = growth
        else:
            elimination = self._eliminate(number, 1.0)
        return elimination

    def _first_places(self) -> IntArray:
        """Return where each branch's size is among all parameters of a place."""
        lengths = [1 + int(shapes) for shapes in self._shapes]
        return np.cumsum([0, *lengths])[:-1].astype(np.int64)

    def _eliminate(self, number: int, scale: float) -> Elimination:
        count = self._counts[number]
        if not count:
            return self._gram.eliminate(scale)
        size = self._growth[number][self._branch[:count]]
        cross, inner = self._extra
        extra = cross[:count] * size[:, None], inner[:count, :count] * np.outer(size, size)
        return self._gram.eliminate(scale, extra)

    def eliminate(self, scale: float) -> list[Elimination]:
        """Integrate over nuisances: with the form as it is, and with each kind of departure."""
        if scale == 1.0:
            return self._settled
        return [self._eliminate(number, scale) for number in range(len(self._counts))]

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

    def left(self, elimination: Elimination, candidate: Candidate) -> float:
        """Return the sum of squares that the candidate leaves at its best place.

        Needs the unknown's columns, with which the gains' are.
        """
        place = self._weigh(elimination, 0.0).place
        places = self.candidate.at(place, 0.0, 0.0).places
        nodes = [node_weights(b, p) for b, p in zip(candidate.branches, places, strict=True)]
        vector = np.zeros(self.head + self._gains)
        vector[: self.head] = np.concatenate([[1.0], *[-n for n in nodes]])
        if candidate.members is not None:
            vector[self.head :] = -candidate.log_gain * candidate.members
        kept = elimination.products[: len(vector), : len(vector)]
        return float(vector @ kept @ vector)

    def subset(self, scale: float, none: float) -> Candidate:
        """Return the candidate with some specimens' force off by a factor beside it.

        Needs the unknown's columns, with which the gains' are.
        """
        gains = slice(self.head, self.head + self._gains)
        found = []
        # Each specimen's own size of the effect would take up its gain: with and without these.
        for elimination in self.eliminate(scale):
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
) -> tuple[FloatArray, FloatArray]:
    weighted = patterns if rows is None else patterns * rows[:, None]
    return weighted.T @ columns, weighted.T @ patterns
