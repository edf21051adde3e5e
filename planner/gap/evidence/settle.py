"""Candidates settled on the forward model: their posterior mode, and the model linear about it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from planner.gap.evidence.problem import Problem
from planner.gap.evidence.surrogate import Candidate, Elimination, integrated
from planner.numerics import FloatArray
from planner.simulation.bar_solver import Setup

__all__ = ["Settled", "World", "joined", "resettled", "settle"]


# ------------------------------------------------------------------------------------------------
# How far data may be from any model: by the specimens' scatter, and by the model's own discrepancy.


class World:
    """Scatter of one size and a model discrepancy of one size, all nuisances integrated out.

    Parameters
    ----------
    scale
        The specimens' scatter over the one that was estimated.
    discrepancy
        Deviation of forces from any model, over each test's largest; see
        `Problem.discrepancy`.
    weight : (n,)
        Of specimens; 1 each by default.

    Attributes
    ----------
    none, left
        ln p of the campaign without any effect, and the sum of squares that it leaves.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        scale: float = 1.0,
        discrepancy: float = 0.0,
        weight: FloatArray | None = None,
    ) -> None:
        self.problem, self.scale, self.discrepancy = problem, scale, discrepancy
        whitened = problem.whitened
        rows = np.ones(len(problem.table)) if weight is None else whitened.on_rows(weight)
        self._root = np.sqrt(rows) / scale
        nuisances = whitened.nuisance_columns
        if discrepancy:
            nuisances = np.concatenate([nuisances, discrepancy * problem.discrepancy], axis=1)
        self._nuisances = self._root[:, None] * nuisances
        inner = self._nuisances.T @ self._nuisances
        inner[np.diag_indices(len(inner))] += 1.0
        self._factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
        log_det = 2.0 * float(np.log(np.diagonal(self._factor)).sum())
        self._offset = -float(rows.sum()) * float(np.log(scale)) - 0.5 * log_det
        alone = self.elimination(whitened.columns[:, 0])
        self.none, self.left = alone.none, float(alone.products[0, 0])

    def _half(self, columns: FloatArray) -> FloatArray:
        cross = self._nuisances.T @ columns
        return np.asarray(
            scipy.linalg.solve_triangular(self._factor, cross, lower=True, check_finite=False)
        )

    def products(self, columns: FloatArray, own: FloatArray | None = None) -> FloatArray:
        """Return inner products of whitened columns, (k, k), nuisances integrated out.

        Parameters
        ----------
        columns : (N, k)
        own : (N, m)
            Further nuisances of prior deviation 1.
        """
        count = columns.shape[1]
        if own is not None:
            columns = np.concatenate([columns, own], axis=1)
        weighted = self._root[:, None] * columns
        half = self._half(weighted)
        m = weighted.T @ weighted - half.T @ half
        return np.asarray(m) if own is None else _without_last(m, count)[0]

    def calibrated(self, candidate: Candidate) -> Setup:
        """Return the campaign's setup with laws off as they likeliest are beside a candidate."""
        problem = self.problem
        left = problem.whitened.columns[:, 0] - problem.signature(candidate)
        cross = self._nuisances.T @ (self._root * left)
        mean = scipy.linalg.cho_solve((self._factor, True), cross, check_finite=False)
        return problem.with_laws_off(mean[: len(problem.ways)])

    def elimination(
        self, target: FloatArray, slopes: FloatArray | None = None, kept: FloatArray | None = None
    ) -> Elimination:
        """Return inner products of a target and further columns, with ln p of the target.

        Parameters
        ----------
        target : (N,)
        slopes : (N, p)
            Integrated out, of prior deviation 1.
        kept : (N, k)
        """
        parts = [target[:, None], *(part for part in (kept, slopes) if part is not None)]
        m = self.products(np.concatenate(parts, axis=1))
        m, log_det = _without_last(m, len(m) - (0 if slopes is None else slopes.shape[1]))
        return Elimination(m, self._offset - 0.5 * (float(m[0, 0]) + log_det))


def _without_last(m: FloatArray, head: int) -> tuple[FloatArray, float]:
    """Return inner products of the first `head` columns, the others integrated out, prior 1."""
    return integrated(m[:head, :head], m[head:, :head], m[head:, head:] + np.eye(len(m) - head))


# ------------------------------------------------------------------------------------------------
# The posterior mode, by Levenberg's and Marquardt's method on the forward model itself.
#
# In coordinates that are normal before any data (`SignedForm.coordinates`) the posterior is a sum
# of squares: of whitened residuals, nuisances integrated out, and of the coordinates.


_STEPS = 12
_ENOUGH_NATS = 0.05
"""Iterations, and the gain below which one is the last. Numerical: evidence is off by about that,
little beside the 3 nats that tell hypotheses apart."""

_DIFFERENCE = 0.02
"""Step of the derivatives, in prior deviations. Numerical: they are off by a hundredth of what they
change by over a deviation."""

_DAMPING, _LESS, _MORE = 1e-2, 0.2, 10.0
_MOST_DAMPING = 1e6
"""Of Levenberg's and Marquardt's method, at first, and its factors and its end. Numerical: they
decide how fast the mode is found, and not where it lies."""

_LONGEST = 1.5
"""Prior deviations that a step goes at most. Numerical: slopes say nothing of what is farther off;
the next step goes on."""


def _moved(candidate: Candidate, coordinates: FloatArray) -> Candidate:
    """Return the candidate at coordinates of all its branches, one after the other."""
    places, first = [], 0
    for branch, own in zip(candidate.branches, candidate.places, strict=True):
        stop = first + len(branch.coordinates(own))
        places.append(branch.place(coordinates[first:stop]))
        first = stop
    return replace(candidate, places=tuple(places))


def _coordinates(candidate: Candidate) -> FloatArray:
    pairs = zip(candidate.branches, candidate.places, strict=True)
    return np.concatenate([branch.coordinates(place) for branch, place in pairs])


class _Posterior:
    """A candidate's posterior in a world, beside specimens' own sizes of it."""

    def __init__(self, world: World, candidate: Candidate, own: FloatArray | None) -> None:
        self._world, self._problem, self._start = world, world.problem, candidate
        self._own = own
        self._evaluate(_coordinates(candidate))

    def _evaluate(self, at: FloatArray) -> None:
        problem = self._problem
        self.coordinates, self.candidate = at, _moved(self._start, at)
        self._change = problem.changes([self.candidate])[0]
        self.left = problem.noise.whiten(problem.residual - self._change)
        squares = float(self._world.products(self.left[:, None], self._own)[0, 0])
        self.cost = 0.5 * (squares + float(at @ at))

    def slopes(self) -> FloatArray:
        """Return derivatives of the whitened features by the coordinates, (N, p)."""
        at = self.coordinates
        # Towards the middle, where no parameter is at its bound.
        steps = np.where(at > 0.0, -_DIFFERENCE, _DIFFERENCE)
        moved = [_moved(self._start, row) for row in at + np.diag(steps)]
        changes = self._problem.changes(moved) - self._change
        return self._problem.noise.whiten((changes / steps[:, None]).T)

    def climb(self, steps: int) -> FloatArray:
        """Go to the mode; return the slopes there."""
        damping, slopes = _DAMPING, self.slopes()
        for _ in range(steps):
            at, before = self.coordinates, self.cost
            state = self.candidate, self._change, self.left
            columns = np.concatenate([self.left[:, None], slopes], axis=1)
            m = self._world.products(columns, self._own)
            gradient = m[1:, 0] - at
            curvature = m[1:, 1:] + np.eye(len(at))
            while True:
                damped = curvature + damping * np.diag(np.diagonal(curvature))
                move = np.clip(np.linalg.solve(damped, gradient), -_LONGEST, _LONGEST)
                self._evaluate(at + move)
                if self.cost < before:
                    damping *= _LESS
                    break
                damping *= _MORE
                if float(gradient @ move) < _ENOUGH_NATS or damping > _MOST_DAMPING:
                    self.coordinates, self.cost = at, before
                    self.candidate, self._change, self.left = state
                    return slopes
            slopes = self.slopes()
            if before - self.cost < _ENOUGH_NATS:
                break
        return slopes


# ------------------------------------------------------------------------------------------------
# The model linear about the mode: evidence, gains of some specimens, and the unknown beside it.


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """One candidate at its mode, and the model linear about it.

    Attributes
    ----------
    world
        That in which the mode is.
    coordinates : (p,)
    slopes : (N, p)
        Derivatives of the whitened features by the coordinates.
    own : (N, k)
        What specimens' own sizes change beside, whitened, of prior deviation 1.
    target : (N,)
        Whitened: what slopes times coordinates, own sizes, nuisances and noise must make up.
    """

    world: World
    candidate: Candidate
    coordinates: FloatArray
    slopes: FloatArray
    own: FloatArray
    target: FloatArray

    def eliminated(self, world: World, kept: FloatArray | None = None) -> Elimination:
        """Return inner products of the target and further columns, in a world."""
        free = np.concatenate([self.slopes, self.own], axis=1)
        return world.elimination(self.target, free, kept)

    def weighed(self, world: World, elimination: Elimination) -> Candidate:
        """Return the candidate with its gain and evidence over no effect in a world."""
        gain = 0.5 * (world.left - float(elimination.products[0, 0]))
        return replace(self.candidate, gain=gain, log_evidence=elimination.none - world.none)

    def deviations(self) -> FloatArray:
        """Return the coordinates' posterior deviations, (p,)."""
        inner = self.world.products(self.slopes, self.own) + np.eye(self.slopes.shape[1])
        return np.asarray(np.sqrt(np.diagonal(np.linalg.inv(inner))))

    def conditional(self) -> Elimination:
        """Return the problem's nodes with nuisances and this candidate integrated out."""
        problem = self.world.problem
        return self.eliminated(self.world, problem.whitened.columns[:, problem.nodes])


def joined(one: Candidate, other: Candidate) -> Candidate:
    """Return two effects as one candidate, sorted."""
    parts = zip((*one.branches, *other.branches), (*one.places, *other.places), strict=True)
    branches, places = zip(*sorted(parts, key=lambda part: part[0].effect.id), strict=True)
    return Candidate(tuple(b.effect.id for b in branches), branches, places)


_ROUNDS = 3
_SAME_SIZE = 0.05
"""Rounds in which specimens' own sizes follow the effect's, and its relative change at which they
end. Numerical: their deviation, a third, is off by as little."""


def _settled_in(world: World, candidate: Candidate) -> Settled:
    own = np.zeros((len(world.problem.table), 0))
    for _ in range(_ROUNDS):
        posterior = _Posterior(world, candidate, own)
        slopes = posterior.climb(_STEPS)
        before, candidate = candidate, posterior.candidate
        if own.shape[1] and np.all(np.abs(candidate.sizes / before.sizes - 1.0) < _SAME_SIZE):
            break
        # Own sizes scatter in proportion to the effect's.
        own = world.problem.own_sizes(candidate)
        if not own.shape[1]:
            break
    at = posterior.coordinates
    return Settled(world, candidate, at, slopes, own, posterior.left + slopes @ at)


def settle(worlds: Sequence[World], candidate: Candidate, start: World) -> Settled:
    """Return a candidate at its mode, in the world in which it is likeliest.

    Parameters
    ----------
    start
        The world in which the candidate was found.
    """
    settled = _settled_in(start, candidate)
    likeliest = max(worlds, key=lambda world: settled.eliminated(world).none)
    return settled if likeliest is start else _settled_in(likeliest, settled.candidate)


def resettled(world: World, candidate: Candidate) -> Candidate:
    """Return a candidate at its mode in a world, from where it is."""
    posterior = _Posterior(world, candidate, world.problem.own_sizes(candidate))
    posterior.climb(_STEPS)
    return posterior.candidate
