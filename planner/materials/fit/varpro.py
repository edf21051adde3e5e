"""Variable projection: separable least squares from many starts at once.

The residual of ``P = sum_j c_j phi_j(a_j)`` is minimised over c exactly at each a, which leaves a
search over a alone: fewer dimensions, better conditioned, and no start values for c. The Jacobian
is Kaufman's, whose gradient is exact (G. Golub and V. Pereyra 1973; L. Kaufman 1975). All starts
go through Levenberg-Marquardt together as one batch of arrays.
"""

from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.materials.fit.sample import Sample
from planner.materials.fit.separable import SeparableLaw

__all__ = ["CONVERGED_GRADIENT", "Held", "Solutions", "minimise", "spread_starts"]

CONVERGED_GRADIENT = 1e-6
"""Largest cosine between the residual and a direction of search that counts as converged."""

RIDGE = 1e-4
"""Weight of the terms' own sizes, as shares of the stress, beside the relative residual. It does
nothing where terms differ; where two coincide it keeps them from growing to many times the stress
and cancelling: tests do not determine such pairs, and they would make figures of noise."""

ITERATIONS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Solutions:
    """Where each start ended.

    Attributes
    ----------
    a, c
        Nonlinear parameters (s, q) and linear coefficients (s, p), held ones as they were given.
    cost
        Shape (s,): the sample's mean square relative residual, with the ridge's part.
    gradient
        Shape (s,): largest cosine between the residual and a free direction of search.
    converged
        Shape (s,): gradient below `CONVERGED_GRADIENT`, or no step lowers the cost any more.
    """

    a: FloatArray
    c: FloatArray
    cost: FloatArray
    gradient: FloatArray
    iterations: IntArray
    converged: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Parameters that a search leaves alone, one row a start.

    Attributes
    ----------
    a
        Shape (s, q): true where the nonlinear parameter stays at its start.
    c
        Shape (s, p): where a coefficient is held, its value in the file's terms (see
        `SeparableLaw.divisor`); NaN where it is free.
    """

    a: BoolArray
    c: FloatArray


def spread_starts(law: SeparableLaw, sample: Sample, count: int, shift: float = 0.5) -> FloatArray:
    """Return `count` starts spread evenly over the bounds, shape (count, q).

    A Kronecker sequence with the generalised golden ratio (M. Roberts 2018); `shift` in 0..1
    moves the whole pattern, as a seed would.
    """
    q = law.nonlinear
    if q == 0:
        return np.empty((1, 0))
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (q + 1))
    steps = ratio ** -np.arange(1.0, q + 1)
    fraction = (shift + np.arange(1, count + 1)[:, None] * steps) % 1.0
    return law.start(fraction, float(sample.stretch.max()))


def minimise(
    law: SeparableLaw,
    sample: Sample,
    starts: FloatArray,
    held: Held | None = None,
    flat: float = 1e-14,
) -> Solutions:
    """Minimise the sample's cost over a law's parameters from each start.

    Parameters
    ----------
    starts
        Nonlinear parameters, shape (s, q).
    held
        Parameters left alone, for profiles.
    flat
        Share of the cost that a step has to gain for a search to go on.
    """
    problem = _Problem(law, sample)
    low, high = law.bounds(float(sample.stretch.max())).T
    a = np.clip(starts, low, high)
    s, q = a.shape
    held_a = np.zeros((s, q), dtype=bool) if held is None else held.a
    held_c = np.full((s, law.columns), np.nan) if held is None else held.c
    state = problem.project(a, held_c)
    damping = np.full(s, 1e-2)
    iterations = np.zeros(s, dtype=np.int64)
    gradient = np.zeros(s)
    converged = np.full(s, q == 0)
    active = np.flatnonzero(~converged)
    for _ in range(ITERATIONS):
        if not len(active):
            break
        iterations[active] += 1
        now = state.rows(active)
        at = a[active]
        slope = np.einsum("snk,sn->sk", now.jacobian, now.residual)
        stuck = held_a[active] | ((at <= low) & (slope > 0)) | ((at >= high) & (slope < 0))
        jacobian = np.where(stuck[:, None, :], 0.0, now.jacobian)
        slope = np.where(stuck, 0.0, slope)
        square = np.einsum("snk,snk->sk", jacobian, jacobian)
        length = np.sqrt(square * now.cost[:, None])
        cosine = np.abs(slope) / np.where(length > 0, length, 1.0)
        gradient[active] = cosine.max(axis=1)
        normal = np.einsum("snk,snl->skl", jacobian, jacobian)
        diagonal = np.where(square > 0, square, 1.0)
        normal[:, range(q), range(q)] = diagonal * (1.0 + damping[active])[:, None]
        step = -np.linalg.solve(normal, slope[:, :, None])[:, :, 0]
        trial = np.clip(at + step, low, high)
        after = problem.project(trial, held_c[active])
        better = after.cost < now.cost
        gained = now.cost - after.cost > flat * now.cost
        small = np.abs(trial - at).max(axis=1) <= 1e-10 * (1.0 + np.abs(at).max(axis=1))
        damping[active] *= np.where(better, 0.2, 5.0)
        damping[active] = np.maximum(damping[active], 1e-10)
        a[active] = np.where(better[:, None], trial, at)
        state.take(active[better], after.rows(np.flatnonzero(better)))
        done = (gradient[active] < CONVERGED_GRADIENT) | (better & ~gained) | (~better & small)
        converged[active] |= done
        active = active[~done]
    return Solutions(a, state.coefficients, state.cost, gradient, iterations, converged)


@dataclass(slots=True, eq=False)
class _State:
    """What projecting at each candidate's a gives; one row a candidate."""

    coefficients: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    cost: FloatArray

    def rows(self, index: IntArray) -> "_State":
        return _State(
            self.coefficients[index], self.residual[index], self.jacobian[index], self.cost[index]
        )

    def take(self, index: IntArray, other: "_State") -> None:
        self.coefficients[index] = other.coefficients
        self.residual[index] = other.residual
        self.jacobian[index] = other.jacobian
        self.cost[index] = other.cost


class _Problem:
    def __init__(self, law: SeparableLaw, sample: Sample) -> None:
        self.law = law
        self.stretch = sample.stretch
        self.factor = sample.factor
        self.target = sample.factor * sample.stress_MPa

    def project(self, a: FloatArray, held_c: FloatArray) -> _State:
        """Solve for the free coefficients at each a, and differentiate the residual by a."""
        phi, slope = self.law.evaluate(self.stretch, a)
        free = np.isnan(held_c)
        if not free.all():
            # A held coefficient is the file's: its column carries the divisor.
            divisor, divisor_slope = self.law.divisor(a)
            multiplier = np.where(free, 1.0, divisor)[:, None, :]
            if self.law.nonlinear:
                slope = slope * multiplier + phi * np.where(free, 0.0, divisor_slope)[:, None, :]
            phi = phi * multiplier
        phi = phi * self.factor[:, None]
        slope = slope * self.factor[:, None]
        given = np.where(free, 0.0, held_c)
        norm = np.where(free, np.sqrt(np.einsum("snp,snp->sp", phi, phi)), 1.0)
        unit = np.where(free[:, None, :], phi / norm[:, None, :], 0.0)
        target = self.target - np.einsum("snp,sp->sn", phi, given)
        s, n, p = unit.shape
        ridge = np.broadcast_to(RIDGE * np.eye(p), (s, p, p))
        padded = np.concatenate([unit, ridge], axis=1)
        basis, triangle = np.linalg.qr(padded)
        inner = np.einsum("snp,sn->sp", basis[:, :n], target)
        shares = np.linalg.solve(triangle, inner[:, :, None])[:, :, 0]
        residual = np.einsum("snp,sp->sn", padded, shares)
        residual[:, :n] -= target
        jacobian = np.zeros((s, n + p, self.law.nonlinear))
        coefficients = np.where(free, shares / norm, given)
        if self.law.nonlinear:
            # A unit column turns, it does not grow: its change has no part along itself.
            change = slope * coefficients[:, None, :]
            change -= unit * np.einsum("snp,snp->sp", unit, change)[:, None, :]
            jacobian[:, :n] = change
            jacobian -= basis @ np.einsum("snp,snk->spk", basis[:, :n], change)
        return _State(coefficients, residual, jacobian, np.einsum("sn,sn->s", residual, residual))
