"""Candidates on the forward model: their posterior mode, and the model linear about it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.sparse import block_diag, csr_array, diags_array, triu

from planner.gap.evidence.problem import Candidate, Problem, searched
from planner.numerics import FloatArray, IntArray
from planner.simulation.bar_solver import Prediction

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
        inner = amplitude**2 * a[columns, columns] + np.eye(columns.stop - columns.start)
        left, log_det = _integrated(a[:1, :1], amplitude * a[columns, :1], inner)
        return self.none + 0.5 * (float(a[0, 0]) - float(left[0, 0]) - log_det)


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
        if level != 1.0:
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
        self._nuisances, self._turned = csr_array(weighted.T), self._white.T
        inner = np.asarray(self._nuisances @ weighted)
        inner[np.diag_indices(len(inner))] += 1.0
        self._factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
        self.offset -= float(np.log(np.diagonal(self._factor)).sum())
        self._own: tuple[Any, ...] = ()
        alone = self.elimination(problem.target)
        self.none, self.left = alone.none, float(alone.products[0, 0])
        self.likeliest = self.none

    def products(self, columns: FloatArray, own: FloatArray | None = None) -> FloatArray:
        """Return inner products of whitened columns, (k, k), nuisances integrated out.

        Parameters
        ----------
        columns : (N, k)
        own : (m, N)
            Further nuisances of prior deviation 1, of each specimen by itself: m of each.
        """
        weighted, half, m = self._without_nuisances(columns)
        if own is None or not len(own):
            return m
        halved, factor = self._beside(own)
        out, _ = dtrtrs(factor, self._summed(own, weighted) - halved.T @ half, lower=True)
        return np.asarray(m - out.T @ out)

    def _without_nuisances(self, columns: FloatArray) -> tuple[FloatArray, ...]:
        weighted = np.asarray(self._white @ columns)
        half, _ = dtrtrs(self._factor, self._nuisances @ weighted, lower=True)
        return weighted, half, np.asarray(weighted.T @ weighted - half.T @ half)

    def _summed(self, own: FloatArray, weighted: FloatArray) -> FloatArray:
        """Return products of each specimen's own columns with weighted ones, (m n, k)."""
        each = own[:, :, None] * np.asarray(self._turned @ weighted)
        sums = np.add.reduceat(each, self.problem.noise.first_row[:-1], axis=1)
        return sums.reshape(-1, weighted.shape[1])

    @cached_property
    def _inner(self) -> tuple[Any, ...]:
        """Half of the rows' products, the other half its mirror image; nuisances by row.

        Of the products: values, rows, columns, and cells by specimen.
        """
        square, of = triu(self._turned @ self._white).tocoo(), self.problem.table.specimen
        values = np.where(square.row == square.col, 0.5, 1.0) * square.data
        cell = of[square.row] * len(self.problem.noise.rows) + of[square.col]
        reach, _ = dtrtrs(self._factor, (self._nuisances @ self._white).toarray(), lower=True)
        return values, square.row, square.col, cell, np.ascontiguousarray(reach.T)

    def _among(self, own: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what nuisances share with specimens' own columns, and these with one another."""
        values, row, column, cell, reach = self._inner
        first, m, n = self.problem.noise.first_row, len(own), len(self.problem.noise.rows)
        halved = np.concatenate([csr_array((a, np.arange(len(a)), first)) @ reach for a in own])
        blocks = [[np.bincount(cell, a[row] * values * b[column], n * n) for b in own] for a in own]
        half = np.reshape(blocks, (m, m, n, n)).transpose(0, 2, 1, 3).reshape(m * n, -1)
        return halved.T, half + half.T - halved @ halved.T

    def _beside(self, own: FloatArray) -> tuple[Any, ...]:
        """Return what integrates over specimens' own columns; the last ones' is kept."""
        if not self._own or self._own[0] is not own:
            halved, m = self._among(own)
            self._own = own, halved, dpotrf(m + np.eye(len(m)), lower=True)[0]
        return self._own[1:]

    def log_det(self, own: FloatArray | None) -> float:
        """Return half of the logarithm of the determinant that integrating over `own` brings."""
        if own is None or not len(own):
            return 0.0
        return float(np.log(np.diagonal(self._beside(own)[1])).sum())

    def among(self, own: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return products of specimens' own columns with one another, (m n, m n), and with `left`.

        Of (m, N) and (N,), nuisances integrated out.
        """
        halved, m = self._among(own)
        weighted, half, _ = self._without_nuisances(left[:, None])
        return m, (self._summed(own, weighted) - halved.T @ half)[:, 0]

    def coefficients(self, left: FloatArray) -> FloatArray:
        """Return the nuisances' posterior mean, in prior deviations, of what is left, (N,)."""
        cross = np.asarray(self._nuisances @ (self._white @ left))
        return np.asarray(scipy.linalg.cho_solve((self._factor, True), cross, check_finite=False))

    def laws_off(self, candidate: Candidate) -> tuple[FloatArray, FloatArray]:
        """Return the mean and covariance of what laws are off by, the candidate being right."""
        problem, count = self.problem, len(self.problem.calibrations)
        left = problem.target - problem.noise.whiten(problem.explained(candidate))
        unit = np.eye(len(self._factor), count)
        inverse = scipy.linalg.cho_solve((self._factor, True), unit, check_finite=False)[:count]
        sizes = self._sizes[:count]
        return sizes * self.coefficients(left)[:count], np.outer(sizes, sizes) * inverse

    def error(self, candidate: Candidate) -> FloatArray:
        """Return root mean square errors of specimens beside a candidate, of forces and of strains.

        (n, 2), strays left out. Laws are off as they likeliest are then. Features tell small forces
        from each other as well as large ones: at the start of a curve, errors of its largest force
        say nothing.
        """
        problem, table = self.problem, self.problem.table
        explained = problem.explained(candidate)
        off = self.coefficients(problem.target - problem.noise.whiten(explained))
        off = (self._sizes * off[: len(self._sizes)])[: problem.calibration.shape[1]]
        left = problem.residual - explained - problem.calibration @ off
        of = 2 * table.specimen + table.is_field
        count = np.bincount(of, minlength=2 * len(problem.strays))
        mean = np.bincount(of, left**2, len(count)) / np.maximum(count, 1)
        return np.asarray(np.sqrt(mean).reshape(-1, 2)[~problem.strays])

    def elimination(
        self, target: FloatArray, slopes: FloatArray | None = None,
        kept: FloatArray | None = None, own: FloatArray | None = None, unkept: float = 0.0,
    ) -> Elimination:  # fmt: skip
        """Return inner products of a target and further columns, with ln p of the target.

        Parameters
        ----------
        target : (N,)
        slopes : (N, p)
            Integrated out, of prior deviation 1.
        kept : (N, k)
        own : (m, N)
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
        log_det += 2.0 * self.log_det(own)
        return Elimination(m, self.offset - 0.5 * (float(m[0, 0]) + log_det))


def _along_levels(problem: Problem, level: float) -> tuple[csr_array, FloatArray]:
    """Return directions in which specimens' levels go, (N, n), and what each is stretched by.

    Whitened features have a unit covariance, of which a level that scatters less takes from that
    one direction, and one that scatters more adds: 1 - (1 - level^2) sd^2 |g|^2 of it is left, with
    g what the level changes.
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
    roots = [csr_array(np.linalg.inv(factor)) for factor in factors]
    return csr_array(block_diag(roots))[back][:, back]


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


@dataclass(frozen=True, slots=True, eq=False)
class _OwnSizes:
    """Specimens' likeliest own sizes of m effects beside a candidate.

    Attributes
    ----------
    deviates : (m, n)
        See `Candidate.own_sizes`.
    change : (N,)
        By these, whitened.
    columns : (m, N)
        By a deviation more.
    left : (N,)
        What the candidate leaves where they are 0, by the model linear about them.
    """

    deviates: FloatArray
    change: FloatArray
    columns: FloatArray
    left: FloatArray


class _State:
    """A candidate somewhere, and what the forward model says of it there.

    Attributes
    ----------
    left : (N,)
        The whitened residual that it leaves where all specimens have the effects' sizes.
    near : (m, n)
        Where own sizes' deviates are looked for first.
    """

    def __init__(
        self, problem: Problem, candidate: Candidate, coordinates: FloatArray,
        near: FloatArray | None = None, like: Prediction | None = None,
    ) -> None:  # fmt: skip
        self._problem, self.coordinates = problem, coordinates
        self.candidate = _moved(candidate, coordinates)
        none = np.zeros((len(candidate.differing), len(problem.noise.rows)))
        self._near = none if near is None else near
        self._prediction = problem.predictions([self.candidate], like)
        self._change = problem.changes(self._prediction)
        self.left = problem.noise.whiten(problem.residual - self._change[0])
        self.left -= problem.gain_of(self.candidate)
        self._known: dict[Any, FloatArray] = {}
        self._own: tuple[Likelihood, _OwnSizes] | None = None

    def _courses_of(self, candidate: Candidate) -> FloatArray:
        """Return whitened courses over the sizes of effects whose sizes differ, (m, 3, N)."""
        own = candidate.differing
        for signed, point in own:
            if (signed.number, point) not in self._known:
                course = self._problem.course_over_sizes((signed, point))
                self._known[signed.number, point] = self._problem.noise.whiten(course.T).T
        found = [self._known[signed.number, point] for signed, point in own]
        return np.reshape(found, (len(own), 3, len(self.left)))

    def by_own(
        self, deviates: FloatArray, candidate: Candidate | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the whitened change by own sizes, (N,), and by a deviation more, (m, N)."""
        courses = self._courses_of(candidate or self.candidate)
        return self._problem.by_own_sizes(courses, *self.candidate.own_sizes(deviates))

    def own(self, likelihood: Likelihood) -> _OwnSizes:
        """Return specimens' own sizes under a likelihood; the last one's are kept."""
        if self._own is None or self._own[0] is not likelihood:
            near = self._own[1].deviates if self._own else self._near
            self._own = likelihood, self._likeliest_sizes(likelihood, near)
        return self._own[1]

    def _likeliest_sizes(self, likelihood: Likelihood, at: FloatArray) -> _OwnSizes:
        def cost(at: FloatArray, change: FloatArray) -> float:
            squares = float(likelihood.products((self.left - change)[:, None])[0, 0])
            return 0.5 * (squares + float(np.sum(at**2)))

        change, columns = self.by_own(at)
        for _ in range(_STEPS if len(at) else 0):
            inner, cross = likelihood.among(columns, self.left - change)
            gradient = cross - at.ravel()
            step = np.linalg.solve(inner + np.eye(len(inner)), gradient).reshape(at.shape)
            if 0.5 * float(gradient @ step.ravel()) < _ENOUGH_NATS:
                break
            most, there = cost(at, change), at + step
            while cost(there, (found := self.by_own(there))[0]) > most and np.any(there != at):
                there = at + _LESS * (there - at)
            if np.all(there == at):
                break
            at, (change, columns) = there, found
        return _OwnSizes(at, change, columns, self.left_at_none(at, columns))

    def left_at_none(self, deviates: FloatArray, columns: FloatArray) -> FloatArray:
        """Return what is left without own sizes, by the model linear about deviates, (N,)."""
        linear = np.sum(columns * deviates[:, self._problem.table.specimen], axis=0)
        return np.asarray(self.left - self.by_own(deviates)[0] + linear)

    def cost(self, likelihood: Likelihood) -> float:
        """Return minus ln of the posterior, but for a constant, own sizes integrated over."""
        own = self.own(likelihood)
        squares = float(likelihood.products(own.left[:, None], own.columns)[0, 0])
        cost = 0.5 * (squares + float(self.coordinates @ self.coordinates))
        return cost + likelihood.log_det(own.columns)

    def linear(self, likelihood: Likelihood) -> tuple[FloatArray, FloatArray]:
        """Return derivatives by the coordinates at the own sizes: of features, and of `log_det`.

        Whitened, (N, p), and (p,).
        """
        steps, moved, changes = self._at_steps
        own = self.own(likelihood)
        rise = self._problem.noise.whiten((changes - self._change).T)
        narrower = np.zeros(len(steps))
        for k, candidate in enumerate(moved if len(own.columns) else ()):
            change, columns = self.by_own(own.deviates, candidate)
            rise[:, k] += change - own.change
            narrower[k] = likelihood.log_det(columns)
        return rise / steps, (narrower - likelihood.log_det(own.columns)) / steps

    @cached_property
    def _at_steps(self) -> tuple[FloatArray, list[Candidate], FloatArray]:
        """Steps of the coordinates, and the candidates and changes there."""
        # Towards the middle, where no parameter is at its bound.
        steps = np.where(self.coordinates > 0.0, -_DIFFERENCE, _DIFFERENCE)
        moved = [_moved(self.candidate, row) for row in self.coordinates + np.diag(steps)]
        predictions = self._problem.predictions(moved, self._prediction[0])
        return steps, moved, self._problem.changes(predictions)


def _mode(likelihood: Likelihood, state: _State) -> _State:
    """Return the posterior mode under a likelihood from a point on, beside specimens' own sizes.

    Slopes follow the steps (Broyden's rule); where they promise no more they are made anew.
    """
    (slopes, narrower), fresh, damping = state.linear(likelihood), True, _DAMPING
    for _ in range(_STEPS):
        if (step := _damped_step(likelihood, state, slopes, narrower, damping)) is not None:
            reached, move, enough, damping = step
            own = state.own(likelihood)
            off = state.left - own.change - slopes @ move
            off -= reached.left - reached.by_own(own.deviates)[0]
            slopes = slopes + np.outer(off, move / (move @ move))
            state = reached
        if (done := step is None or enough) and fresh:
            break
        if fresh := done:
            (slopes, narrower), damping = state.linear(likelihood), _DAMPING
    return state


def _damped_step(
    likelihood: Likelihood, state: _State, slopes: FloatArray, narrower: FloatArray, damping: float
) -> tuple[_State, FloatArray, bool, float] | None:
    """Return where a damped step leads, that step, if it gains next to none, and the next damping.

    None where the model linear about the point, whose evidence has its gain already, promises
    nothing, or no step gains.
    """
    cost, gradient, curvature, promised = _promise(likelihood, state, slopes, narrower)
    hopeless = likelihood.likeliest - (likelihood.offset - cost) - _HOPELESS_NATS
    enough = max(_ENOUGH_NATS, _ENOUGH_SHARE * hopeless)
    while promised >= enough and damping <= _MOST_DAMPING:
        damped = curvature + damping * np.diag(np.diagonal(curvature))
        move = np.clip(np.linalg.solve(damped, gradient), -_LONGEST, _LONGEST)
        at, near = state.coordinates + move, state.own(likelihood).deviates
        reached = _State(likelihood.problem, state.candidate, at, near, state._prediction[0])
        gained = cost - reached.cost(likelihood)
        if gained > 0.0:
            return reached, move, gained < enough, damping * _LESS
        damping, promised = damping * _MORE, float(gradient @ move)
    return None


def _promise(
    likelihood: Likelihood, state: _State, slopes: FloatArray, narrower: FloatArray
) -> tuple[float, FloatArray, FloatArray, float]:
    """Return the cost of a point, gradient and curvature there, and what these promise to gain."""
    own = state.own(likelihood)
    columns = np.concatenate([own.left[:, None], slopes], axis=1)
    m = likelihood.products(columns, own.columns)
    gradient = m[1:, 0] - state.coordinates - narrower
    curvature = m[1:, 1:] + np.eye(len(gradient))
    promised = 0.5 * float(gradient @ np.linalg.solve(curvature, gradient))
    return state.cost(likelihood), gradient, curvature, promised


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
    deviates : (m, n), own : (m, N)
        Specimens' own sizes, and how features change with them by a deviation, whitened.
    target : (N,)
        Whitened: what slopes times coordinates, own sizes, nuisances and noise must make up.
    unkept
        Nats that the linear model promises of the target, and the search did not find.
    """

    likelihood: Likelihood
    candidate: Candidate
    coordinates: FloatArray
    slopes: FloatArray
    deviates: FloatArray
    own: FloatArray
    target: FloatArray
    unkept: float = 0.0
    _known: dict[tuple[Likelihood, bool], Elimination] = field(init=False, default_factory=dict)

    @classmethod
    def of_nothing(cls, likelihood: Likelihood) -> "PosteriorMode":
        """Return no effect at all under a likelihood."""
        left = likelihood.problem.target
        none, sizes = np.zeros((0, len(left))), np.zeros((0, len(likelihood.problem.noise.rows)))
        return cls(likelihood, Candidate(()), np.zeros(0), none.T, sizes, none, left)

    def eliminated(self, likelihood: Likelihood, kept: FloatArray | None = None) -> Elimination:
        """Return inner products of the target and further columns, under a likelihood.

        Those of no columns and of the specimens' own gains are asked for again, and remembered.
        """
        if kept is not None and kept is not likelihood.problem.gains:
            return likelihood.elimination(self.target, self.slopes, kept, self.own, self.unkept)
        key = likelihood, kept is None
        if key not in self._known:
            found = likelihood.elimination(self.target, self.slopes, kept, self.own, self.unkept)
            self._known[key] = found
            likelihood.likeliest = max(likelihood.likeliest, found.none)
        return self._known[key]

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
        columns = np.concatenate([(self.target - beside)[:, None], self.slopes], axis=1)
        m = likelihood.products(columns, self.own)
        at = np.linalg.solve(m[1:, 1:] + np.eye(len(m) - 1), m[1:, 0])
        move = np.clip(at - self.coordinates, -_LONGEST, _LONGEST)
        # Slopes say nothing of what is far off: as far as the forward model bears them out.
        ends = [self.coordinates + share * move for share in (1.0, 0.5)]
        states = [_State(self.likelihood.problem, self.candidate, at) for at in ends]
        tried = [(s.left_at_none(self.deviates, self.own), s.coordinates) for s in states]
        tried.append((self.target - self.slopes @ self.coordinates, self.coordinates))

        def cost(one: tuple[FloatArray, FloatArray]) -> float:
            left = (one[0] - beside)[:, None]
            return float(likelihood.products(left, self.own)[0, 0] + one[1] @ one[1])

        return _moved(self.candidate, min(tried, key=cost)[1])

    def with_own_sizes(self, candidate: Candidate) -> Candidate:
        """Return the candidate, as weighed, with the likeliest own size of each specimen."""
        left = self.target - self.slopes @ self.coordinates
        left -= self.likelihood.problem.gain_of(candidate)
        inner, cross = self.likelihood.among(self.own, left)
        deviates = np.linalg.solve(inner + np.eye(len(inner)), cross)
        return replace(candidate, own=np.reshape(deviates, (len(self.own), -1)))

    def covariance(self) -> FloatArray:
        """Return the coordinates' posterior covariance, (p, p)."""
        inner = self.likelihood.products(self.slopes, self.own) + np.eye(self.slopes.shape[1])
        return np.asarray(np.linalg.inv(inner))

    @cached_property
    def beside(self) -> list[Candidate]:
        """Every form alone at its best place for what this candidate leaves; see `searched`."""
        problem = self.likelihood.problem
        left = self.eliminated(self.likelihood, problem.nodes).products
        return searched(problem.signed_forms, left[0, 1:], left[1:, 1:])


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
    state = _mode(start, _State(start.problem, candidate, np.concatenate(at)))
    mode = _mode_at(start, state)
    likeliest = max(likelihoods, key=lambda w: mode.eliminated(w).none)
    if likeliest is start:
        return mode
    again = _mode_at(likeliest, _mode(likeliest, state))
    # Each by its own mode: far from one the linear model may promise what is not there.
    return again if again.eliminated(likeliest).none > mode.eliminated(start).none else mode


def _mode_at(likelihood: Likelihood, state: _State) -> PosteriorMode:
    at, own, (slopes, narrower) = state.coordinates, state.own(likelihood), state.linear(likelihood)
    # Where own sizes' volume grows with the effect's size, the linear model promises more.
    unkept, target = _promise(likelihood, state, slopes, 0.0 * narrower)[-1], own.left + slopes @ at
    sizes = own.deviates, own.columns
    return PosteriorMode(likelihood, state.candidate, at, slopes, *sizes, target, unkept)
