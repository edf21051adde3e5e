"""Candidates on the forward model: their posterior mode, and the model linear about it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.sparse import block_diag, csr_array, diags_array

from planner.gap.evidence.problem import Candidate, Problem, searched
from planner.numerics import FloatArray, IntArray

__all__ = ["Likelihood", "PosteriorMode", "posterior_mode"]


# ------------------------------------------------------------------------------------------------
# How far data may be from any model: by the specimens' scatter, and by the model's own discrepancy.


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Inner products of the kept columns with nuisances integrated out, and ln p(data | none)."""

    products: FloatArray
    none: float

    def with_random(self, columns: slice, amplitude: float) -> float:
        """Return `none` with columns integrated over, their coefficients of such a deviation."""
        a = self.products
        inner = a[columns, columns] + np.eye(columns.stop - columns.start) / amplitude**2
        left, log_det = _integrated(a[:1, :1], a[columns, :1], inner)
        log_det += 2.0 * len(inner) * float(np.log(amplitude))
        return self.none + (0.5 * (float(a[0, 0]) - float(left[0, 0])) - 0.5 * log_det)


def _integrated(kept: FloatArray, cross: FloatArray, inner: FloatArray) -> tuple[FloatArray, float]:
    """Return Schur's complement of `inner`, and the logarithm of its determinant."""
    if not len(inner):
        return kept, 0.0
    # By LAPACK itself: what is around it in scipy costs more than so small matrices do.
    factor, _ = dpotrf(inner, lower=True)
    half, _ = dtrtrs(factor, cross, lower=True)
    return kept - half.T @ half, 2.0 * float(np.log(np.diagonal(factor)).sum())


class Likelihood:
    """Scatter of one size and a model discrepancy of one size, all nuisances integrated out.

    Parameters
    ----------
    scale
        The specimens' scatter over the one that was estimated.
    level
        Of that, how much of the scatter of their force's level is left; at most 1.
    discrepancy
        Deviation of forces from any model, over each test's largest; see
        `Problem.discrepancy`.
    laws
        How far laws are off in their course, over what they usually are; see `Problem.of_laws`.
    nuisances, more : (N, k)
        Columns of prior deviation 1, whitened, in place of the problem's or beside them.
    share
        Its prior probability.
    weight : (n,)
        Of specimens; 1 each by default.

    Attributes
    ----------
    none, left
        ln p of the campaign without any effect, and the sum of squares that it leaves.
    offset
        ln p where nothing is left, and no more is integrated over.
    likeliest
        ln p of the campaign beside the likeliest candidate whose mode is known so far.
    """

    def __init__(
        self, problem: Problem, *, scale: float = 1.0, level: float = 1.0,
        discrepancy: float = 0.0, laws: float = 1.0, share: float = 1.0,
        nuisances: FloatArray | None = None, more: FloatArray | None = None,
        weight: FloatArray | None = None,
    ) -> None:  # fmt: skip
        self.problem, self.scale, self.level = problem, scale, level
        self.discrepancy, self.laws, self.log_share = discrepancy, laws, float(np.log(share))
        each = np.ones(len(problem.noise.rows)) if weight is None else weight
        rows = np.repeat(each, np.diff(problem.noise.first_row))
        self.offset = -float(rows.sum()) * float(np.log(scale))
        # To a scale where scatter and discrepancy are white: sparse, as both are of a test each.
        self._white = csr_array(diags_array(np.sqrt(rows) / scale))
        if level < 1.0:
            levels, widened = _along_levels(problem, level)
            self.offset += float(each @ np.log1p(widened))
            self._white += levels @ diags_array(widened) @ levels.T @ self._white
        if discrepancy:
            courses = np.asarray(self._white @ (discrepancy * problem.discrepancy))
            root = _inverse_root_of_tests(courses, problem.table.test)
            self.offset += float(np.log(root.diagonal()).sum())
            self._white = root @ self._white
        self._sizes = np.where(problem.of_laws, laws, 1.0)
        blocks = [problem.nuisances * self._sizes if nuisances is None else nuisances]
        weighted = self._white @ np.concatenate(blocks if more is None else [*blocks, more], axis=1)
        self._nuisances = csr_array(weighted.T)
        inner = np.asarray(self._nuisances @ weighted)
        inner[np.diag_indices(len(inner))] += 1.0
        self._factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
        self.offset -= float(np.log(np.diagonal(self._factor)).sum())
        self._own: tuple[Any, ...] = ()
        alone = self.elimination(problem.target)
        self.none, self.left = alone.none, float(alone.products[0, 0])
        self.likeliest = self.none

    def products(self, columns: FloatArray, own: csr_array | None = None) -> FloatArray:
        """Return inner products of whitened columns, (k, k), nuisances integrated out.

        Parameters
        ----------
        columns : (N, k)
        own : (N, m)
            Further nuisances of prior deviation 1.
        """
        weighted, half, m = self._without_nuisances(columns)
        if own is None or not own.shape[1]:
            return m
        _, beside, halved, factor = self._beside(own)
        out, _ = dtrtrs(factor, beside.T @ weighted - halved.T @ half, lower=True)
        return np.asarray(m - out.T @ out)

    def _without_nuisances(self, columns: FloatArray) -> tuple[FloatArray, ...]:
        weighted = np.asarray(self._white @ columns)
        half, _ = dtrtrs(self._factor, self._nuisances @ weighted, lower=True)
        return weighted, half, np.asarray(weighted.T @ weighted - half.T @ half)

    def _beside(self, own: csr_array) -> tuple[Any, ...]:
        """Return what integrates over further nuisances; the last one's is kept."""
        if not self._own or self._own[0] is not own:
            weighted = self._white @ own
            half, _ = dtrtrs(self._factor, (self._nuisances @ weighted).toarray(), lower=True)
            m = (weighted.T @ weighted).toarray() - half.T @ half
            self._own = own, weighted, half, dpotrf(m + np.eye(len(m)), lower=True)[0]
        return self._own

    def fit(self, left: FloatArray, columns: FloatArray, own: csr_array | None) -> FloatArray:
        """Return the posterior mean of the columns' coefficients, of prior deviation 1, in `left`.

        Of (N,) and (N, k); `own` as of `products`.
        """
        m = self.products(np.concatenate([left[:, None], columns], axis=1), own)
        return np.asarray(np.linalg.solve(m[1:, 1:] + np.eye(len(m) - 1), m[1:, 0]))

    def coefficients(self, left: FloatArray) -> FloatArray:
        """Return the nuisances' posterior mean, in prior deviations, of what is left, (N,)."""
        cross = np.asarray(self._nuisances @ (self._white @ left))
        return np.asarray(scipy.linalg.cho_solve((self._factor, True), cross, check_finite=False))

    def laws_off(self, candidate: Candidate) -> tuple[FloatArray, FloatArray]:
        """Return the mean and covariance of the problem's ways, the candidate being right."""
        problem, count = self.problem, len(self.problem.calibrations)
        left = problem.target - problem.noise.whiten(problem.explained(candidate))
        unit = np.eye(len(self._factor), count)
        inverse = scipy.linalg.cho_solve((self._factor, True), unit, check_finite=False)[:count]
        sizes = self._sizes[:count]
        return sizes * self.coefficients(left)[:count], np.outer(sizes, sizes) * inverse

    def error(self, candidate: Candidate) -> float:
        """Return the root mean square errors of all tests' features, summed, beside a candidate.

        Laws are off as they likeliest are then. Features tell small forces from each other as well
        as large ones: at the start of a curve, errors of its largest force say nothing.
        """
        problem, table = self.problem, self.problem.table
        explained = problem.explained(candidate)
        off = self.coefficients(problem.target - problem.noise.whiten(explained))
        off = (self._sizes * off[: len(self._sizes)])[: problem.calibration.shape[1]]
        left = problem.residual - explained - problem.calibration @ off
        known = ~problem.strays[table.specimen]
        of = table.test[known]
        mean = np.bincount(of, left[known] ** 2) / np.maximum(np.bincount(of), 1)
        return float(np.sqrt(mean).sum())

    def elimination(
        self, target: FloatArray, slopes: FloatArray | None = None,
        kept: FloatArray | None = None, own: csr_array | None = None, unkept: float = 0.0,
    ) -> Elimination:  # fmt: skip
        """Return inner products of a target and further columns, with ln p of the target.

        Parameters
        ----------
        target : (N,)
        slopes : (N, p)
            Integrated out, of prior deviation 1.
        kept : (N, k)
        own : (N, m)
            As of `products`.
        unkept
            Nats of what slopes explain of the target that are not to be had.
        """
        parts = [target[:, None], *(part for part in (kept, slopes) if part is not None)]
        m = self.products(np.concatenate(parts, axis=1), own)
        head = len(m) - (0 if slopes is None else slopes.shape[1])
        inner = m[head:, head:] + np.eye(len(m) - head)
        m, log_det = _integrated(m[:head, :head], m[head:, :head], inner)
        m[0, 0] += 2.0 * unkept
        if own is not None and own.shape[1]:
            log_det += 2.0 * float(np.log(np.diagonal(self._beside(own)[-1])).sum())
        return Elimination(m, self.offset - 0.5 * (float(m[0, 0]) + log_det))


def _along_levels(problem: Problem, level: float) -> tuple[csr_array, FloatArray]:
    """Return directions in which specimens' levels go, (N, n), and what each is stretched by.

    Whitened features have a unit covariance, of which a level that scatters less takes from that
    one direction: 1 - (1 - level^2) sd^2 |g|^2 of it is left, with g what the level changes.
    """
    change = problem.noise.whiten(np.where(problem.table.is_field, 0.0, problem.sensitivity))
    changes = csr_array((change, (np.arange(len(change)), problem.table.specimen)))
    squares = np.maximum(changes.power(2).sum(axis=0), 1e-300)
    left = 1.0 - (1.0 - level**2) * problem.scatter.specimen**2 * squares
    return changes @ diags_array(1.0 / np.sqrt(squares)), 1.0 / np.sqrt(left) - 1.0


def _inverse_root_of_tests(courses: FloatArray, test: IntArray) -> csr_array:
    """Return what whitens noise of I + courses courses^T, triangular in each test.

    Each course, a column of (N, r), is of one test's rows.
    """
    order = np.argsort(test, kind="stable")
    rows = np.split(order, np.flatnonzero(np.diff(test[order])) + 1)
    factors = [np.linalg.cholesky(np.eye(len(of)) + courses[of] @ courses[of].T) for of in rows]
    back = np.argsort(order)
    return csr_array(block_diag(list(map(np.linalg.inv, factors))))[back][:, back]


# ------------------------------------------------------------------------------------------------
# The posterior mode, by Levenberg's and Marquardt's method on the forward model itself.
#
# In coordinates that are normal before any data (`SignedForm.coordinates`) the posterior is a sum
# of squares: of whitened residuals, nuisances integrated out, and of the coordinates.


_STEPS = 60
_ENOUGH_NATS = 0.05
"""Iterations, and the gain that is none: one that was made, or that the model linear about a point
promises still. Numerical: evidence is off by about that, little beside the 3 nats that tell
hypotheses apart."""

_HOPELESS_NATS, _ENOUGH_SHARE = 50.0, 0.05
"""What a candidate may be behind the likeliest so far, and the gain that is none of what it is
behind by more, made or promised. Numerical: along curved valleys a search gained 40 nats more
than was promised."""

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
    """Return the candidate at coordinates of all its signed forms, one after the other."""
    parts, first = [], 0
    for signed, point in candidate.parts:
        own = slice(first, first := first + len(signed.coordinates(point)))
        parts.append((signed, signed.point(coordinates[own])))
    return replace(candidate, parts=tuple(parts))


class _State:
    """A candidate somewhere, and what the forward model says of it there.

    Attributes
    ----------
    left : (N,)
        The whitened residual that it leaves.
    """

    def __init__(self, problem: Problem, candidate: Candidate, coordinates: FloatArray) -> None:
        self._problem, self.coordinates = problem, coordinates
        self.candidate = _moved(candidate, coordinates)
        self._prediction = problem.predictions([self.candidate])
        self._change = problem.changes(self._prediction)
        self.left = problem.noise.whiten(problem.residual - self._change[0])
        self.left -= problem.gain_of(self.candidate)

    def cost(self, squares: float) -> float:
        """Return minus ln of the posterior, but for a constant, of the squares that are left."""
        return 0.5 * (squares + float(self.coordinates @ self.coordinates))

    @cached_property
    def slopes(self) -> FloatArray:
        """Derivatives of the whitened features by the coordinates, (N, p)."""
        at, problem = self.coordinates, self._problem
        # Towards the middle, where no parameter is at its bound.
        steps = np.where(at > 0.0, -_DIFFERENCE, _DIFFERENCE)
        moved = [_moved(self.candidate, row) for row in at + np.diag(steps)]
        changes = problem.changes(problem.predictions(moved, self._prediction[0])) - self._change
        return problem.noise.whiten((changes / steps[:, None]).T)


def _mode(likelihood: Likelihood, state: _State, own: csr_array) -> _State:
    """Return the posterior mode under a likelihood from a point on, beside specimens' own sizes.

    Slopes follow the steps (Broyden's rule); where they promise no more they are made anew.
    """
    slopes, fresh, damping = state.slopes, True, _DAMPING
    for _ in range(_STEPS):
        if (step := _damped_step(likelihood, state, own, slopes, damping)) is not None:
            reached, move, enough, damping = step
            off = state.left - reached.left - slopes @ move
            slopes = slopes + np.outer(off, move / (move @ move))
            state = reached
        if (done := step is None or enough) and fresh:
            break
        if fresh := done:
            slopes, damping = state.slopes, _DAMPING
    return state


def _damped_step(
    likelihood: Likelihood, state: _State, own: csr_array, slopes: FloatArray, damping: float
) -> tuple[_State, FloatArray, bool, float] | None:
    """Return where a damped step leads, that step, if it gains next to none, and the next damping.

    None where the model linear about the point, whose evidence has its gain already, promises
    nothing, or no step gains.
    """
    cost, gradient, curvature, promised = _promise(likelihood, state, own, slopes)
    hopeless = likelihood.likeliest - (likelihood.offset - cost) - _HOPELESS_NATS
    enough = max(_ENOUGH_NATS, _ENOUGH_SHARE * hopeless)
    while promised >= enough and damping <= _MOST_DAMPING:
        damped = curvature + damping * np.diag(np.diagonal(curvature))
        move = np.clip(np.linalg.solve(damped, gradient), -_LONGEST, _LONGEST)
        reached = _State(likelihood.problem, state.candidate, state.coordinates + move)
        gained = cost - reached.cost(float(likelihood.products(reached.left[:, None], own)[0, 0]))
        if gained > 0.0:
            return reached, move, gained < enough, damping * _LESS
        damping, promised = damping * _MORE, float(gradient @ move)
    return None


def _promise(
    likelihood: Likelihood, state: _State, own: csr_array, slopes: FloatArray
) -> tuple[float, FloatArray, FloatArray, float]:
    """Return the cost of a point, gradient and curvature there, and what these promise to gain."""
    m = likelihood.products(np.concatenate([state.left[:, None], slopes], axis=1), own)
    gradient = m[1:, 0] - state.coordinates
    curvature = m[1:, 1:] + np.eye(len(gradient))
    promised = 0.5 * float(gradient @ np.linalg.solve(curvature, gradient))
    return state.cost(float(m[0, 0])), gradient, curvature, promised


# ------------------------------------------------------------------------------------------------
# The model linear about the mode: evidence, gains of some specimens, and the unknown beside it.


@dataclass(frozen=True, eq=False)
class PosteriorMode:
    """One candidate at its mode, and the model linear about it.

    Attributes
    ----------
    likelihood
        That in which the mode is.
    coordinates : (p,)
    slopes : (N, p)
        Derivatives of the whitened features by the coordinates.
    own : (N, k)
        What specimens' own sizes change beside, whitened, of prior deviation 1.
    target : (N,)
        Whitened: what slopes times coordinates, own sizes, nuisances and noise must make up.
    unkept
        Nats that the linear model promises of the target, and the search did not find.
    """

    likelihood: Likelihood
    candidate: Candidate
    coordinates: FloatArray
    slopes: FloatArray
    own: csr_array
    target: FloatArray
    unkept: float = 0.0
    _known: dict[Likelihood, Elimination] = field(init=False, default_factory=dict)

    def eliminated(self, likelihood: Likelihood, kept: FloatArray | None = None) -> Elimination:
        """Return inner products of the target and further columns, under a likelihood."""
        if kept is not None:
            return likelihood.elimination(self.target, self.slopes, kept, self.own, self.unkept)
        if likelihood not in self._known:
            found = likelihood.elimination(self.target, self.slopes, None, self.own, self.unkept)
            self._known[likelihood] = found
            likelihood.likeliest = max(likelihood.likeliest, found.none)
        return self._known[likelihood]

    def weighed(self, likelihood: Likelihood, elimination: Elimination) -> Candidate:
        """Return the candidate with its gain and evidence over no effect under a likelihood."""
        gain = 0.5 * (likelihood.left - float(elimination.products[0, 0]))
        return replace(self.candidate, gain=gain, log_evidence=elimination.none - likelihood.none)

    def fitted(self, likelihood: Likelihood, beside: FloatArray) -> Candidate:
        """Return the candidate at its mode under another likelihood, by this linear model.

        Parameters
        ----------
        beside : (N,)
            The whitened change by a gain of some specimens beside it.
        """
        at = likelihood.fit(self.target - beside, self.slopes, self.own)
        move = np.clip(at - self.coordinates, -_LONGEST, _LONGEST)
        # Slopes say nothing of what is far off: as far as the forward model bears them out.
        ends = [self.coordinates + share * move for share in (1.0, 0.5)]
        tried = [(_State(self.likelihood.problem, self.candidate, at).left, at) for at in ends]
        tried.append((self.target - self.slopes @ self.coordinates, self.coordinates))

        def cost(one: tuple[FloatArray, FloatArray]) -> float:
            left = (one[0] - beside)[:, None]
            return float(likelihood.products(left, self.own)[0, 0] + one[1] @ one[1])

        return _moved(self.candidate, min(tried, key=cost)[1])

    def with_own_sizes(self, candidate: Candidate) -> Candidate:
        """Return the candidate, as weighed, with the likeliest own size of each specimen."""
        left = self.target - self.slopes @ self.coordinates
        left -= self.likelihood.problem.gain_of(candidate)
        sizes = self.likelihood.fit(left, self.own.toarray(), None)
        return replace(candidate, own=sizes.reshape(-1, len(self.likelihood.problem.noise.rows)))

    def covariance(self) -> FloatArray:
        """Return the coordinates' posterior covariance, (p, p)."""
        inner = self.likelihood.products(self.slopes, self.own) + np.eye(self.slopes.shape[1])
        return np.asarray(np.linalg.inv(inner))

    @cached_property
    def beside(self) -> list[Candidate]:
        """Every form alone at its best place for what this candidate leaves."""
        problem = self.likelihood.problem
        left = self.eliminated(self.likelihood, problem.nodes).products
        return searched(problem.signed_forms, left[0, 1:], left[1:, 1:])


_ROUNDS = 3
_SAME_SIZE = 0.05
"""Rounds in which specimens' own sizes follow the effect's, and its relative change at which they
end. Numerical: their deviation, a third, is off by as little."""


def _mode_beside_own(
    likelihood: Likelihood, state: _State, own: csr_array
) -> tuple[_State, csr_array]:
    """Return a mode and specimens' own sizes there, from a point and such sizes on."""
    for _ in range(_ROUNDS):
        before, state = state, _mode(likelihood, state, own)
        was, now = ([s for _, (s, *_) in one.candidate.parts] for one in (before, state))
        if own.shape[1] and np.all(np.abs(np.divide(now, was) - 1.0) < _SAME_SIZE):
            break
        # Own sizes scatter in proportion to the effect's.
        own = likelihood.problem.own_sizes(state.candidate)
        if not own.shape[1]:
            break
    return state, own


def posterior_mode(
    likelihoods: Sequence[Likelihood], candidate: Candidate, start: Likelihood
) -> PosteriorMode:
    """Return a candidate at its mode, under the likelihood in which it is likeliest.

    Parameters
    ----------
    start
        That of them in which the candidate was found.
    """
    at = [signed.coordinates(point) for signed, point in candidate.parts]
    state = _State(start.problem, candidate, np.concatenate(at))
    state, own = _mode_beside_own(start, state, csr_array((len(state.left), 0)))
    mode = _mode_at(start, state, own)
    likeliest = max(likelihoods, key=lambda w: mode.eliminated(w).none)
    if likeliest is start:
        return mode
    again = _mode_at(likeliest, *_mode_beside_own(likeliest, state, own))
    # Each by its own mode: far from one the linear model may promise what is not there.
    return again if again.eliminated(likeliest).none > mode.eliminated(start).none else mode


def _mode_at(likelihood: Likelihood, state: _State, own: csr_array) -> PosteriorMode:
    at, slopes = state.coordinates, state.slopes
    unkept, target = _promise(likelihood, state, own, slopes)[-1], state.left + slopes @ at
    return PosteriorMode(likelihood, state.candidate, at, slopes, own, target, unkept)
