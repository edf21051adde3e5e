"""Fit laws to specimens, choose one, and say how sure it is."""

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import ArgumentError, Caution, as_number, refused
from planner.glance import brief
from planner.materials import characterise
from planner.materials.characterise import Curve, MaterialCharacteristics, characterise_material
from planner.materials.laws import (
    LOWEST_STRETCH,
    Columns,
    NeoHookean,
    Ogden,
    SeparableLaw,
    Yielding,
    make_law,
    secant_modulus_MPa,
    stability,
)
from planner.numerics import BoolArray, FloatArray, IntArray, normal_quantile, students_t
from planner.palette import LAW_PARAMETERS, LawParameters, Uncertainty

__all__ = [
    "ASSUMED_LOG_SD",
    "RELATIVE_FLOOR",
    "STARTS",
    "MaterialFit",
    "Sample",
    "fit_law",
    "fit_material",
    "least_yielding",
    "loading",
    "sample_of",
    "widened",
    "yielding_parameters",
]


# ------------------------------------------------------------------------------------------------
# The points that a law is fitted to: every specimen counts once, whatever its sampling rate.


LOADINGS = ("uniaxial", "planar", "equibiaxial", "compression")
"""Loadings that a curve may be of (`Curve.mode`)."""

RELATIVE_FLOOR = 0.05
"""Share of the largest stress under which a relative residual stops growing: near zero stress
the load cell's noise, not the law, would decide."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Points of one material's specimens, with weights that sum to one.

    The cost of a law is ``sum w_i ((P(l_i) - P_i) / s_i)^2``, the mean square of the residual
    over the scale s: dimensionless, so that stiff and soft materials are judged alike.

    Attributes
    ----------
    stretch, stress_MPa
        Shape (n,).
    scale_MPa
        Shape (n,): hypot(stress, floor) for relative weighting, the root mean square stress for
        absolute weighting.
    weight
        Shape (n,): equal within a specimen; each specimen has the same sum.
    specimen
        Shape (n,), the specimen's number from zero.
    mode
        Shape (n,), the place in `LOADINGS` of each point's loading.
    across
        Whether a law fitted to it is held to be stable across the load too; see `SoundRows`.
    """

    stretch: FloatArray
    stress_MPa: FloatArray
    scale_MPa: FloatArray
    weight: FloatArray
    specimen: IntArray
    mode: IntArray
    across: bool = True

    @property
    def specimens(self) -> int:
        """Number of specimens."""
        return len(np.unique(self.specimen))

    @property
    def factor(self) -> FloatArray:
        """Multiplier of a residual in MPa under which the sum of squares is the cost."""
        return np.sqrt(self.weight) / self.scale_MPa

    def part(self, chosen: BoolArray) -> "Sample":
        """Return the points where `chosen` (n,) is true, weighed anew."""
        names = ("stretch", "stress_MPa", "scale_MPa", "specimen", "mode")
        kept = {name: getattr(self, name)[chosen] for name in names}
        return replace(self, **kept, weight=_weights(kept["specimen"], kept["mode"]))


def sample_of(
    curves: Sequence[Curve], *, weighting: str = "relative", points: int | None = 60
) -> Sample:
    """Resample the specimens' loading curves to points even in strain, and weigh them.

    Parameters
    ----------
    curves
        Replicates of one material, strain from rest, loading only.
    weighting
        "relative": residual over hypot(stress, `RELATIVE_FLOOR` of the largest stress);
        "absolute": residual over the root mean square stress of all points.
    points
        Means over this many bins of equal strain width a specimen (empty bins are left out);
        None takes the points as they are, each of a specimen with the same weight.

    Raises
    ------
    ArgumentError
        A curve without tension.
    """
    points_of = []
    for number, curve in enumerate(curves):
        sign = 1.0 if curve.strain.max() >= -curve.strain.min() else -1.0
        loaded = (sign * curve.strain > 0.0) & np.isfinite(curve.stress_MPa)
        if loaded.sum() < 3 or (sign * curve.stress_MPa[loaded]).max() <= 0.0:
            raise ArgumentError(
                f"specimen {curve.specimen}: fewer than 3 points with strain and stress of one "
                "sign; a law is fitted to strain from 0 on, tension positive"
            )
        x, y = sign * curve.strain[loaded], curve.stress_MPa[loaded]
        if points is not None and len(x) > points:
            x, y = _bin_means(x, y, points)
        of = (np.full(len(x), number), np.full(len(x), LOADINGS.index(curve.mode)))
        points_of.append((1.0 + sign * x, y, *of))
    stretch, stress, specimen, mode = map(np.concatenate, zip(*points_of, strict=True))
    weight = _weights(specimen, mode)
    if weighting == "relative":
        scale = np.hypot(stress, RELATIVE_FLOOR * np.abs(stress).max())
    else:
        scale = np.full(len(stress), np.sqrt((weight * stress**2).sum()))
    return Sample(stretch, stress, scale, weight, specimen, mode)


def _bin_means(x: FloatArray, y: FloatArray, bins: int) -> tuple[FloatArray, FloatArray]:
    index = np.minimum((x / x.max() * bins).astype(np.int64), bins - 1)
    count = np.bincount(index)
    used = count > 0
    mean_x, mean_y = (np.bincount(index, values)[used] / count[used] for values in (x, y))
    return mean_x, mean_y


def _weights(specimen: IntArray, mode: IntArray) -> FloatArray:
    """Return weights that sum to one: each mode's the same, in it each specimen's."""
    _, inverse, count = np.unique(specimen, return_inverse=True, return_counts=True)
    modes, of_mode = np.unique(mode, return_inverse=True)
    in_mode = np.array([len(np.unique(specimen[mode == m])) for m in modes])
    return np.asarray(1.0 / (count[inverse] * in_mode[of_mode] * len(modes)))


def sample_columns(law: SeparableLaw, sample: Sample, a: FloatArray) -> Columns:
    """Return a law's columns and their slopes at a sample's points, each in its own loading.

    As `SeparableLaw.evaluate`. Of compression alone, sizes of strain and stress are uniaxial ones
    with their signs turned. Equibiaxial loading to l is uniaxial loading to l^-2, with nominal
    stress -P(l^-2) / l^3.
    """
    if not sample.mode.any():
        return law.evaluate(sample.stretch, a)
    planar, both, pressed = (sample.mode == LOADINGS.index(name) for name in LOADINGS[1:])
    uniaxial = np.where(pressed, 2.0 - sample.stretch, sample.stretch)
    stretch = np.where(both, sample.stretch**-2.0, uniaxial)
    turn = np.where(both, -(sample.stretch**-3.0), np.where(pressed, -1.0, 1.0))[:, None]
    found = [one * turn for one in law.evaluate(stretch, a)]
    of_planar = law.evaluate(sample.stretch[planar], a, planar=True)
    for one, other in zip(found, of_planar, strict=True):
        one[:, planar] = other
    return found[0], found[1]


# ------------------------------------------------------------------------------------------------
# Variable projection: separable least squares from many starts at once.
#
# The residual of ``P = sum_j c_j phi_j(a_j)`` is minimised over c exactly at each a, which leaves a
# search over a alone: fewer dimensions, better conditioned, and no start values for c. The Jacobian
# is Kaufman's, whose gradient is exact (G. Golub and V. Pereyra 1973; L. Kaufman 1975). All starts
# go through Levenberg-Marquardt together as one batch of arrays, on points thinned out; the lowest
# go on to the minimum. The damping follows how much of the foreseen gain a step makes (H. Nielsen
# 1999): a fixed factor up and down wastes every second step in the long bent valley along which two
# terms exchange their parts, and where a row of `SoundRows` pulls at the law.


_CONVERGED_GRADIENT = 1e-6
"""Largest cosine between the residual and a direction of search that counts as converged."""

_RIDGE = 1e-4
"""Weight of the terms' own sizes, as shares of the stress, beside the relative residual. It does
nothing where terms differ; where two coincide it keeps them from growing to many times the stress
and cancelling: tests do not determine such pairs, and they would make figures of noise."""

_ITERATIONS = 80


class Solutions(NamedTuple):
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
        Shape (s,): gradient below `_CONVERGED_GRADIENT`, or no step lowers the cost any more.
    """

    a: FloatArray
    c: FloatArray
    cost: FloatArray
    gradient: FloatArray
    converged: BoolArray


def spread_starts(law: SeparableLaw, sample: Sample, count: int, shift: float = 0.5) -> FloatArray:
    """Return `count` starts spread evenly over the bounds, shape (count, q).

    A Kronecker sequence with the generalised golden ratio (M. Roberts 2018); `shift` in 0..1
    moves the whole pattern, as a seed would.
    """
    q = law.nonlinear
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
    held: tuple[BoolArray, FloatArray] | None = None,
    flat: float = 1e-14,
    iterations: int = _ITERATIONS,
) -> Solutions:
    """Minimise the sample's cost over a law's parameters from each start.

    Parameters
    ----------
    starts
        Nonlinear parameters, shape (s, q).
    held
        Parameters left alone, for profiles, one row a start: where the nonlinear ones stay there
        (s, q); and what coefficients are held at, in the file's terms (see `SeparableLaw.divisor`),
        NaN where they are free (s, p).
    flat
        Share of the cost that a step has to gain for a search to go on.
    iterations
        At most so many steps.
    """
    problem = _Problem(law, sample)
    low, high = law.bounds(float(sample.stretch.max())).T
    starts = np.clip(starts, low, high)
    s, q = starts.shape
    held_a, held_c = held or (np.zeros((s, q), dtype=bool), np.full((s, law.columns), np.nan))
    state = problem.project(starts, held_c)
    damping, raised = np.full(s, 0.1), np.full(s, 2.0)
    gradient = np.zeros(s)
    converged = np.full(s, q == 0)
    active = np.flatnonzero(~converged)
    for _ in range(iterations):
        if not len(active):
            break
        now = state.rows(active)
        at, slope = now.a, now.slope
        stuck = held_a[active] | ((at <= low) & (slope > 0)) | ((at >= high) & (slope < 0))
        slope = np.where(stuck, 0.0, slope)
        normal = np.where(stuck[:, :, None] | stuck[:, None, :], 0.0, now.normal)
        square = np.maximum(np.einsum("skk->sk", normal), 0.0)
        length = np.sqrt(square * now.cost[:, None])
        gradient[active] = (np.abs(slope) / np.where(length > 0, length, 1.0)).max(axis=1)
        damped = normal.copy()
        diagonal = np.where(square > 0, square, 1.0)
        damped[:, range(q), range(q)] = diagonal * (1.0 + damping[active])[:, None]
        step = -np.linalg.solve(damped, slope[:, :, None])[:, :, 0]
        trial = np.clip(at + step, low, high)
        after = problem.project(trial, held_c[active], now.broken)
        better = after.cost < now.cost
        gained = now.cost - after.cost > flat * now.cost
        small = np.abs(trial - at).max(axis=1) <= 1e-10 * (1.0 + np.abs(at).max(axis=1))
        taken = trial - at
        bent = (normal @ taken[:, :, None])[:, :, 0]
        foreseen = -np.einsum("sk,sk->s", taken, 2.0 * slope + bent)
        share = (now.cost - after.cost) / np.where(foreseen > 0.0, foreseen, np.inf)
        eased = np.clip(1.0 - (2.0 * share - 1.0) ** 3, 1.0 / 3.0, 2.0)
        damping[active] *= np.where(better, eased, raised[active])
        damping[active] = np.maximum(damping[active], 1e-10)
        raised[active] = np.where(better, 2.0, 2.0 * raised[active])
        state.take(active[better], after.rows(np.flatnonzero(better)))
        done = (gradient[active] < _CONVERGED_GRADIENT) | (better & ~gained) | (~better & small)
        converged[active] |= done
        active = active[~done]
    return Solutions(state.a, state.coefficients, state.cost, gradient, converged)


def rows_leant_on(law: SeparableLaw, sample: Sample, a: FloatArray) -> Columns:
    """Return columns and slopes, as `sample_columns`, of the `SoundRows` that hold a fitted law."""
    problem = _Problem(law, sample)
    state = problem.project(a[None], np.full((1, law.columns), np.nan))
    rows = problem.weighed_rows(a[None])[:, state.broken[0]]
    return rows[:, :, : law.columns], rows[:, :, law.columns :]


class _State(NamedTuple):
    """What projecting at each candidate's a gives; one row a candidate.

    `normal` and `slope` are those of Gauss and Newton, J'J and J'r, of the projected residual;
    `broken` says which of `SoundRows` pull at it.
    """

    a: FloatArray
    coefficients: FloatArray
    cost: FloatArray
    slope: FloatArray
    normal: FloatArray
    broken: BoolArray

    def rows(self, index: IntArray) -> "_State":
        return _State._make(values[index] for values in self)

    def take(self, index: IntArray, other: "_State") -> None:
        for values, new in zip(self, other, strict=True):
            values[index] = new


class _Problem:
    """The cost of candidates, from products of columns, their slopes and the stress.

    These are small matrices, one a candidate, so that a step touches the points once.
    """

    def __init__(self, law: SeparableLaw, sample: Sample) -> None:
        self.law, self.sample = law, sample
        self.rows = SoundRows(float(sample.stretch.max()))
        self.factor = sample.factor
        self.target = sample.factor * sample.stress_MPa
        self.size = float(self.target @ self.target)
        # Neo-Hooke's modulus: what rows of the modulus' size are compared with.
        columns, _ = sample_columns(NeoHookean(1.0), sample, np.empty((1, 0)))
        front = sample.factor * columns[0, :, 0] / 3.0
        self.stiffness = _STIFFNESS * float(front @ front) / float(front @ self.target)
        self.weigh = self.stiffness * self.rows.matrix
        self.across = self.rows.principal if sample.across and isinstance(law, Ogden) else None

    def weighed_rows(self, a: FloatArray) -> FloatArray:
        """Return what `SoundRows` make of the columns and of their slopes, (s, m, p + q)."""
        uniaxial = np.concatenate(self.law.evaluate(self.rows.uniaxial, a), axis=2)
        planar = np.concatenate(self.law.evaluate(self.rows.planar, a, planar=True), axis=2)
        rows: FloatArray = self.weigh @ np.concatenate([uniaxial, planar], axis=1)
        if self.across is None:
            return rows
        x = self.across[None, :, None]
        power = x ** (a[:, None, :] - 2.0)
        more = np.concatenate([power - _ROOM, power * np.log(x)], axis=2)
        return np.concatenate([rows, self.stiffness * more], axis=1)

    def project(self, a: FloatArray, held_c: FloatArray, near: BoolArray | None = None) -> _State:
        """Solve for the free coefficients at each a, and differentiate the residual by a.

        `near` says which rows were broken at an a nearby, where the solution starts.
        """
        law, free = self.law, np.isnan(held_c)
        p, q = law.columns, law.nonlinear
        both = np.concatenate(sample_columns(law, self.sample, a), axis=2) * self.factor[:, None]
        rows = self.weighed_rows(a)
        if not free.all():
            # A held coefficient is the file's: its column carries the divisor.
            divisor, change = law.divisor(a)
            by = np.where(free, 1.0, divisor)
            turn = np.zeros((len(a), p + q, p + q))
            turn[:, range(p), range(p)] = turn[:, range(p, p + q), range(p, p + q)] = by
            turn[:, range(p), range(p, p + q)] = np.where(free, 0.0, change)
            both, rows = both @ turn, rows @ turn
        square = both.transpose(0, 2, 1) @ both
        inner = self.target @ both
        size = np.einsum("spp->sp", square[:, :p, :p])
        norm = np.sqrt(np.where(free & (size > 0.0), size, 1.0))
        # A row with enormous entries, as of an exponent of 30, would swamp the others' digits.
        largest = np.abs(rows[:, :, :p] / norm[:, None, :]).max(axis=2, initial=0.0)
        rows = rows / np.maximum(largest / _LARGEST_ROW, 1.0)[:, :, None]
        z, active = self._solve(square, inner, rows, norm, free, held_c, near)
        c = z / norm
        broken = np.where(active, np.einsum("smp,sp->sm", rows[:, :, :p], c), 0.0)
        fitted = np.einsum("spj,sp->sj", square[:, :p], c)
        cost = (
            self.size
            - np.einsum("sp,sp->s", 2.0 * inner[:, :p] - fitted[:, :p], c)
            + _RIDGE**2 * (np.where(free, z, 0.0) ** 2).sum(axis=1)
            + (broken**2).sum(axis=1)
        )
        if not q:
            empty = np.zeros((len(a), 0))
            return _State(a, c, cost, empty, empty[:, :, None], active)
        # A unit column turns, it does not grow: its change has no part along itself.
        grown = np.where(free, np.einsum("spp->sp", square[:, :p, p:]) / norm**2, 0.0)
        kept = rows * active[:, :, None]
        square = square + kept.transpose(0, 2, 1) @ kept
        residual = np.einsum("spj,sp->sj", square[:, :p], c) - inner
        turn = np.zeros((len(a), p + q, q))
        turn[:, range(p), range(q)] = -c * grown
        turn[:, range(p, p + q), range(q)] = c
        across = turn.transpose(0, 2, 1) @ square
        gradient = np.einsum("sjk,sj->sk", turn, residual)
        by_columns = np.where(free[:, None, :], across[:, :, :p] / norm[:, None, :], 0.0)
        matrix = square[:, :p, :p] / (norm[:, :, None] * norm[:, None, :])
        matrix = _of_free(matrix, free, _RIDGE**2)
        solved = np.linalg.solve(matrix, by_columns.transpose(0, 2, 1))
        normal = across @ turn - by_columns @ solved
        return _State(a, c, np.maximum(cost, 0.0), gradient, normal, active)

    @staticmethod
    def _solve(
        square: FloatArray, inner: FloatArray, rows: FloatArray, norm: FloatArray,
        free: BoolArray, held_c: FloatArray, near: BoolArray | None,
    ) -> tuple[FloatArray, BoolArray]:  # fmt: skip
        """Return the coefficients of unit columns, and which rows they break.

        Newton's method on a cost that is quadratic but for the rows that are broken or not; the
        best of a few shares of each step is taken, for whole steps may go in circles.
        """
        p = free.shape[1]
        rows = rows[:, :, :p] / norm[:, None, :]
        whole = square[:, :p, :p] / (norm[:, :, None] * norm[:, None, :])
        whole[:, range(p), range(p)] += np.where(free, _RIDGE**2, 0.0)
        right = inner[:, :p] / norm
        given = np.where(free, 0.0, held_c)
        active = np.zeros(rows.shape[:2], dtype=bool) if near is None else near
        kept = rows * active[:, :, None]
        z = _solved(whole + kept.transpose(0, 2, 1) @ kept, right, free, given)
        broken = (rows @ z[:, :, None])[:, :, 0] < 0.0
        todo = np.flatnonzero((broken != active).any(axis=1))
        active = broken
        for _ in range(_ROW_ROUNDS):
            if not len(todo):
                break
            held, form, target = rows[todo], whole[todo], right[todo]
            kept = held * active[todo][:, :, None]
            aim = _solved(form + kept.transpose(0, 2, 1) @ kept, target, free[todo], given[todo])
            tried = z[todo][:, None] + _SHARES[:, None] * (aim - z[todo])[:, None]
            value = np.einsum("stp,stp->st", tried @ form - 2.0 * target[:, None], tried)
            slack = np.minimum(tried @ held.transpose(0, 2, 1), 0.0)
            value += np.einsum("stm,stm->st", slack, slack)
            best = np.argmin(value, axis=1)
            chosen = np.arange(len(todo)), best
            z[todo] = tried[chosen]
            broken = slack[chosen] < 0.0
            done = (best == 0) & (broken == active[todo]).all(axis=1)
            active[todo] = broken
            todo = todo[~done]
        return z, active


def _solved(form: FloatArray, right: FloatArray, free: BoolArray, given: FloatArray) -> FloatArray:
    """Return the minimum over the free coefficients of a quadratic form, given the held ones."""
    aim = np.where(free, right - np.einsum("sij,sj->si", form, given), given)
    found = np.linalg.solve(_of_free(form, free), aim[:, :, None])
    return np.asarray(found[:, :, 0], dtype=np.float64)


def _of_free(matrix: FloatArray, free: BoolArray, ridge: float = 0.0) -> FloatArray:
    """Return a normal matrix of the free coefficients alone, one for those held."""
    p = free.shape[1]
    matrix = np.where(free[:, :, None] & free[:, None, :], matrix, 0.0)
    diagonal = np.einsum("spp->sp", matrix)
    # The last term is above the rounding of the first, so that no matrix is singular.
    matrix[:, range(p), range(p)] += np.where(free, ridge + 1e-14 * diagonal, 1.0)
    return matrix


# ------------------------------------------------------------------------------------------------
# Where no data are: compression, and the two other modes that a print bends and bulges in.
#
# A law that is fitted to tension alone may do anything elsewhere. It is held to what every
# elastomer does, by rows that are linear in its coefficients, so that variable projection keeps
# its form: a row that would be broken joins the least squares as one more point, heavy enough
# that it is kept to some 1e-4 of the modulus.
#
# 1. Uniaxially, nominal stress rises from stretch 0.6 to a tenth beyond the tests.
# 2. The Kirchhoff stress rises with ln(stretch) (Drucker, Hill) in uniaxial, planar and
#    equibiaxial loading from stretch 0.6 to the largest tested.
# 3. An Ogden law is stable across the load too, which its stress does not tell: the sum of
#    mu alpha x^alpha is above zero at every principal stretch x that those loadings have. With
#    it the second derivative of its energy is positive in every direction.
# 4. In compression to 0.6 stress lies between half and twice that of neo-Hooke's law of the same
#    initial modulus. At equal largest stretch, planar and equibiaxial stress, as shares of
#    neo-Hooke's, lie within a factor of four of the uniaxial one, which is tested.


COMPRESSION_FACTOR = 2.0
"""Two Mooney terms with positive coefficients lie at stretch 0.6 within 1 and 1.67 times the
neo-Hookean stress, Ogden terms with exponents of 0 to 10 within 0.98 and 1.97."""

MODES_FACTOR = 4.0
"""Ogden terms with positive exponents and moduli lie within a factor of 2, for (1 + l^(-1.5 a)) /
(1 + l^-3) does; laws of I1 alone, whose invariant at equal stretch is twice as large in equibiaxial
loading, within 4 where it enters by its square, as Yeoh's third term."""

_ROOM = 0.01
"""What a fit keeps inside those limits, so that a row broken by a little is none broken: stress
rises by at least this share of neo-Hooke's rise, and factors are smaller by this share."""

_STIFFNESS = 3.0
"""Weight of a row in units of the modulus, beside a relative residual of the stress. A row pulls
by at most the misfit it costs, a few per cent squared, and so gives by 1e-3 / 3^2 or less."""

_LARGEST_ROW = 1e3
"""Bound of a weighted row's entries beside unit columns: its square leaves the ridge its digits."""

_ROW_ROUNDS = 12
_SHARES = np.array([1.0, 0.6, 0.3, 0.1, 0.03])


class SoundRows:
    """The rows, each a linear form of a law's coefficients that a sound law has above zero.

    Parameters
    ----------
    largest_stretch
        The largest that was tested.

    Attributes
    ----------
    uniaxial, planar
        The stretches that the rows look at.
    matrix
        Shape (m, n): what the rows make of the columns at those stretches, per unit of modulus.
    principal
        The principal stretches that a law is stable across at.
    """

    def __init__(self, largest_stretch: float) -> None:
        compressed = _net(1.0, LOWEST_STRETCH, 7)[::-1]
        far = 1.0 + (1.0 + _MARGIN) * (largest_stretch - 1.0)
        rising = np.concatenate([compressed, _net(1.0, far, 16)[1:]])
        equal = np.geomspace(1.0, max(largest_stretch, LOWEST_STRETCH**-0.5), 7)[1:]
        # Equibiaxial loading is uniaxial loading to l^-2.
        outer = (
            _net(LOWEST_STRETCH, min(0.95 * LOWEST_STRETCH, largest_stretch**-2), 7)[::-1],
            _net(far, max(1.05 * far, LOWEST_STRETCH**-2), 4),
        )
        planar = _net(1.0, max(largest_stretch, 1.0 / LOWEST_STRETCH), 9)
        squeezed = np.geomspace(LOWEST_STRETCH, 1.0, 9)[:-1:2]
        near = np.array([1.0 + 1e-6])
        used = [near, rising, *outer, squeezed, equal, equal**-2, planar, equal]
        ends = np.cumsum([len(part) for part in used])
        each = np.split(np.eye(ends[-1]), ends[:-1])
        # Neo-Hooke's nominal stress over its Young's modulus, the last ones planar.
        modes = [(part - part ** (-3.0 if k >= 7 else -2.0)) / 3.0 for k, part in enumerate(used)]
        # Shares of neo-Hooke's stress, so that the modulus is that at rest.
        share = {k: each[k] / modes[k][:, None] for k in (0, 4, 5, 6, 8)}
        rest = share[0]
        rows = [np.diff(each[1], axis=0) / np.diff(modes[1])[:, None] - _ROOM * rest]
        for i in (2, 3, 7):
            kirchhoff = np.diff(each[i] * used[i][:, None], axis=0)
            rows.append(kirchhoff / np.diff(modes[i] * used[i])[:, None] - _ROOM * rest)
        limits = ((COMPRESSION_FACTOR, 0, 4), (MODES_FACTOR, 5, 6), (MODES_FACTOR, 5, 8))
        for most, one, other in limits:
            factor = most * (1.0 - _ROOM)
            rows += [factor * share[one] - share[other], share[other] - share[one] / factor]
        self.uniaxial, self.planar = np.concatenate(used[:7]), np.concatenate(used[7:])
        self.matrix = np.concatenate(rows)
        lowest, highest = min(LOWEST_STRETCH, far**-0.5), max(far, LOWEST_STRETCH**-0.5)
        self.principal = np.geomspace(lowest, highest, 25)


def _net(start: float, end: float, steps: int) -> FloatArray:
    """Return stretches from `start` to a step beyond `end`, for a row is a mean over a step."""
    return np.geomspace(start, end * (end / start) ** (1.0 / steps), steps + 2)


# ------------------------------------------------------------------------------------------------
# Fit one law to one material's specimens, and say how well and how surely.


STARTS = 50
_AGREEMENT = 1e-3
"""Starts agree when their costs differ by less than this share."""

_ROUGH = 1e-5
"""Gain per step, as a share of the cost, at which a search is left; the lowest go on."""

_ROUGH_ITERATIONS = 25
_ROUGH_POINTS = 75

_POLISHED = 4

_POLISH = 40
_FLAT = 1e-13
"""Gain per step at which the lowest are left: figures are rounded long before."""

_MARGIN = 0.1
"""Share of the working strain that the law must hold beyond it."""

_POINTS = 401

_SIGNIFICANT_DIGITS = 5
"""Nonlinear parameters are rounded to this and the coefficients solved anew: what lies beyond
is neither determined by tests nor the same on every processor."""


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """A fitted law.

    Attributes
    ----------
    parameters
        As a palette file holds them.
    a, c
        Nonlinear parameters (q,) and the law's coefficients (p,) in file terms.
    lowest
        Nonlinear parameters (k, q) at which the lowest searches ended.
    cost
        Mean square of the residual over its scale; see `Sample`.
    objective
        What was minimised: the cost with the ridge's part; see `planner.materials.fit`.
    r2, adjusted_r2
        Of nominal stress, each specimen with equal weight. The adjustment counts the resampled
        points, which are correlated: it flatters, and is no criterion of choice.
    nrmse
        Root mean square error over the largest stress.
    starts, starts_converged, starts_agreeing
        Starts made; how many converged; how many ended within `_AGREEMENT` of the lowest cost.
    gradient
        Of the best start: largest cosine between the residual and a direction of search.
    at_bound
        Whether a nonlinear parameter of the best lies at its bound.
    """

    law: SeparableLaw
    parameters: LawParameters
    a: FloatArray
    c: FloatArray
    lowest: FloatArray
    cost: float
    objective: float
    r2: float
    adjusted_r2: float
    nrmse: float
    starts: int
    starts_converged: int
    starts_agreeing: int
    gradient: float
    at_bound: bool

    __repr__ = brief

    @property
    def name(self) -> str:
        """The model with its number of terms where there is a choice, as "ogden-2"."""
        return self.law.name

    @property
    def parameter_count(self) -> int:
        """Number of fitted parameters."""
        return self.law.columns + self.law.nonlinear

    def nominal_stress_MPa(self, at: FloatArray | Sample) -> FloatArray:
        """Return the nominal stress at stretches, or at points each in its own loading."""
        return law_stress_MPa(self.law, self.a, self.c, at)

    def unstable_strain(self, working_strain: float, margin: float = _MARGIN) -> float | None:
        """Return the strain nearest to rest at which the law is unstable in some mode, if any.

        In Drucker's sense in every mode, from stretch `LOWEST_STRETCH` to the working strain
        (`planner.materials.laws.stability`); nominal stress in tension rises to ``1 + margin``
        times that.

        Parameters
        ----------
        working_strain
            The working range is from rest to this strain.
        margin
            With 0 the stress in uniaxial tension alone is looked at, from rest to the working
            strain.
        """
        stretch = np.linspace(1.0, 1.0 + (1.0 + margin) * working_strain, _POINTS)
        rises = np.diff(self.nominal_stress_MPa(stretch)) > 0.0
        middle = 0.5 * (stretch[1:] + stretch[:-1])
        strains = [] if rises.all() else [float(middle[int(np.argmin(rises))]) - 1.0]
        if margin:
            law = LawParameters(self.law.model, self.law.parameters(self.a, self.c))
            found = stability(make_law(law), working_strain)
            pairs = (zip(ends, found.asked, strict=True) for ends in found.sound.values())
            strains += [end - 1.0 for pair in pairs for end, asked in pair if end != asked]
        return min(strains, key=abs, default=None)


def fit_law(
    law: SeparableLaw, sample: Sample, *, starts: int = STARTS, also: FloatArray | None = None
) -> LawFit:
    """Fit a law by multi-start variable projection.

    Parameters
    ----------
    starts
        Number of starts spread over the bounds.
    also
        Further starts, shape (k, q).
    """
    spread = spread_starts(law, sample, starts)
    if also is not None and law.nonlinear:
        spread = np.concatenate([spread, also])
    thin = np.arange(len(sample.stretch)) % max(len(sample.stretch) // _ROUGH_POINTS, 1) == 0
    rough = minimise(law, sample.part(thin), spread, flat=_ROUGH, iterations=_ROUGH_ITERATIONS)
    lowest = np.argsort(rough.cost, kind="stable")[:_POLISHED]
    found = minimise(law, sample, rough.a[lowest], flat=_FLAT, iterations=_POLISH)
    best = _best(found)
    converged = rough.converged
    converged[lowest] = found.converged
    a = np.sort(found.a[best]) if law.model == "ogden" else found.a[best]
    low, high = law.bounds(float(sample.stretch.max())).T
    a = np.clip([float(f"{v:.{_SIGNIFICANT_DIGITS}g}") for v in a], low, high)
    final = _Problem(law, sample).project(a[None], np.full((1, law.columns), np.nan))
    c = final.coefficients[0] / law.divisor(a[None])[0][0]
    residual = law_stress_MPa(law, a, c, sample) - sample.stress_MPa
    mean = sample.weight @ sample.stress_MPa
    error = float(sample.weight @ residual**2)
    r2 = 1.0 - error / float(sample.weight @ (sample.stress_MPa - mean) ** 2)
    count, used = len(sample.stretch), law.columns + law.nonlinear
    return LawFit(
        law=law,
        parameters=LawParameters(law.model, law.parameters(a, c)),
        a=a,
        c=c,
        lowest=found.a,
        cost=float(((sample.factor * residual) ** 2).sum()),
        objective=float(final.cost[0]),
        r2=r2,
        adjusted_r2=1.0 - (1.0 - r2) * (count - 1) / max(count - used - 1, 1),
        nrmse=float(np.sqrt(error) / np.abs(sample.stress_MPa).max()),
        starts=len(spread),
        starts_converged=int(converged.sum()),
        starts_agreeing=int((rough.cost <= rough.cost.min() * (1.0 + _AGREEMENT)).sum()),
        gradient=float(found.gradient[best]),
        at_bound=bool(np.any((a <= low + 1e-9 * abs(low)) | (a >= high - 1e-9 * abs(high)))),
    )


def law_stress_MPa(
    law: SeparableLaw, a: FloatArray, c: FloatArray, at: FloatArray | Sample
) -> FloatArray:
    """Return nominal stress of a law with nonlinear parameters a (q,), file coefficients c (p,).

    At stretches of uniaxial loading, or at a sample's points, each in its own loading.
    """
    one = a[None]
    phi, _ = sample_columns(law, at, one) if isinstance(at, Sample) else law.evaluate(at, one)
    return np.asarray(phi[0] @ (c * law.divisor(a[None])[0][0]))


def _best(found: Solutions) -> int:
    """Return the start with the lowest cost; among equal ones that with the smallest exponents.

    Where a law has more terms than the tests determine, different parameters reach one cost.
    """
    equal = np.flatnonzero(found.cost <= found.cost.min() * (1.0 + 1e-6) + 1e-30)
    return int(equal[np.argmin(np.round(np.abs(found.a[equal]).sum(axis=1), 4))])


# ------------------------------------------------------------------------------------------------
# Choose a law by what it predicts of a specimen that took no part in the fit.


_FOLD_STEPS = 12
"""Steps of a fit with a specimen left out, which begins where the lowest searches of the whole fit
ended: what it predicts is known to a share of its own error by then."""

_BLOCKS = 7
"""Blocks along strain for a single specimen; the outer two are never left out, because a law is
not asked to extrapolate."""

_INDIFFERENT = 0.02
"""Share of the best held-out error that is no reason to take more parameters."""

_UNRESOLVED = 1e-4
"""Held-out error that is none: 0.01 % of the stress is less than a load cell of class 0.5 (ISO
7500-1, 0.5 %) resolves."""


@dataclass(frozen=True, slots=True, eq=False)
class LawCandidate:
    """A fitted law with the evidence for and against it.

    Attributes
    ----------
    unstable_strain
        See `unstable_strain`, over the working range.
    held_out
        Relative root mean square error on each specimen (or block) left out, shape (folds,).
    determined
        Whether the tests determine each term: leaving specimens out says of every column's part
        in the stress how far it may be off (95 %), and that is less than the whole stress.
    """

    fit: LawFit
    unstable_strain: float | None
    held_out: FloatArray
    determined: bool = True

    __repr__ = brief

    @property
    def held_out_error(self) -> float:
        """Mean of the held-out errors."""
        return float(self.held_out.mean())


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The candidates and the one to use.

    Attributes
    ----------
    candidates
        In the order they were given.
    chosen
        None when every candidate is unstable in the working range.
    scheme
        What was left out in turn: "one specimen" or "one block of strain".
    reason
        Why the chosen one, in one sentence.
    """

    candidates: tuple[LawCandidate, ...]
    chosen: LawCandidate | None
    scheme: str
    reason: str

    __repr__ = brief


def choose_law(
    laws: Sequence[SeparableLaw], sample: Sample, working_strain: float, *, starts: int = STARTS
) -> Choice:
    """Fit every law, leave one specimen out in turn, and choose.

    Among laws that are stable over the working range the fewest parameters win whose mean
    held-out error lies within one standard error of the best one's; the standard error is that
    of the paired difference, specimen by specimen, for the specimens' own scatter is common to
    all laws. Where the tests do not determine that law's terms, a law that they do determine is
    taken, if its error is within one standard error of the best one's. With a single specimen
    blocks along strain are left out instead, which judges the
    law's shape but not the scatter between specimens.

    Raises
    ------
    ArgumentError
        The sample holds fewer points than the smallest law has parameters.
    """
    folds, scheme = _folds(sample)
    fits = [fit_law(law, sample, starts=starts) for law in laws]
    points = len(sample.stretch) - max(int(fold.sum()) for fold in folds)
    if not (usable := [fit for fit in fits if fit.parameter_count < points]):
        raise ArgumentError(
            f"{points} points are too few to fit {', '.join(f.name for f in fits)} and test it "
            "on what is left out; measure more points or choose a law of fewer parameters"
        )
    each = ((fit, fit.unstable_strain(working_strain)) for fit in usable)
    candidates = tuple(LawCandidate(fit, at, *_held_out(fit, sample, folds)) for fit, at in each)
    if not (stable := [c for c in candidates if c.unstable_strain is None]):
        return Choice(candidates, None, scheme, "no law's stress rises over the working range")
    best = min(stable, key=lambda c: c.held_out_error)
    near = [c for c in stable if _as_good(c, best)]
    chosen = min(near, key=lambda c: (c.fit.parameter_count, c.held_out_error))
    if not chosen.determined:
        # Breiman's rule, whose standard error is that of the best one's own errors.
        most = best.held_out_error + _standard_error(best.held_out)
        known = [c for c in stable if c.determined and c.held_out_error <= most]
        chosen = min(known, key=lambda c: (c.fit.parameter_count, c.held_out_error), default=chosen)
    reason = _reason(chosen, best) if len(candidates) > 1 else f"{chosen.fit.name} was asked for"
    return Choice(candidates, chosen, scheme, reason)


def _folds(sample: Sample) -> tuple[list[BoolArray], str]:
    """Return what is left out in turn; a specimen that nothing can be asked of is not."""
    # One specimen a loading: without it another loading would be extrapolated to.
    kinds = set(zip(sample.mode.tolist(), (sample.stretch > 1.0).tolist(), strict=True))
    alone = sample.mode.any() and sample.specimens <= len(kinds)
    if sample.specimens > 1 and not alone:
        # The one that begins lowest can always be asked, so that at least one fold is left.
        return [fold for fold in _own(sample) if _asked(fold, sample).any()], "one specimen"
    rank = np.argsort(np.argsort(sample.stretch, kind="stable"), kind="stable")
    block = rank * _BLOCKS // len(rank)
    return [block == b for b in range(1, _BLOCKS - 1)], "one block of strain"


def _asked(fold: BoolArray, sample: Sample) -> BoolArray:
    """Return the points left out that lie within the others' strain.

    Beyond it would be extrapolation, which a palette never does.
    """
    return np.asarray(fold & (sample.stretch <= sample.stretch[~fold].max()))


def _held_out(fit: LawFit, sample: Sample, folds: Sequence[BoolArray]) -> tuple[FloatArray, bool]:
    """Return the error on each fold left out, and whether every column's part is determined."""
    errors, parts = [], []
    for fold in folds:
        known = sample.part(~fold)
        found = minimise(fit.law, known, fit.lowest, flat=_ROUGH, iterations=_FOLD_STEPS)
        best = _best(found)
        phi, _ = sample_columns(fit.law, sample, found.a[best][None])
        stress = phi[0] * found.c[best]
        error = (stress.sum(axis=1) - sample.stress_MPa) / sample.scale_MPa
        errors.append(np.sqrt(np.mean(error[_asked(fold, sample)] ** 2)))
        part = sample.factor[:, None] * stress
        parts.append(np.sqrt((part**2).sum(axis=0)))
    count = len(folds)
    if count < 2:
        return np.array(errors), True
    # The jackknife's variance; the whole stress, divided by its own size, has about size one.
    spread = np.std(parts, axis=0) * np.sqrt(count - 1.0)
    return np.array(errors), bool(np.all(students_t(0.95, count) * spread < 1.0))


def _standard_error(values: FloatArray) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0


def _as_good(candidate: LawCandidate, best: LawCandidate) -> bool:
    difference = candidate.held_out - best.held_out
    error = _standard_error(difference)
    indifferent = max(_INDIFFERENT * best.held_out_error, _UNRESOLVED)
    return bool(difference.mean() <= max(error, indifferent))


def _reason(chosen: LawCandidate, best: LawCandidate) -> str:
    error = f"{100 * chosen.held_out_error:.2g} %"
    if chosen is best:
        return f"{chosen.fit.name} has the lowest held-out error, {error}"
    if not best.determined and not _as_good(chosen, best):
        return (
            f"{chosen.fit.name} (held-out error {error}) is within one standard error of "
            f"{best.fit.name} ({100 * best.held_out_error:.2g} %), whose terms the tests do not "
            "determine"
        )
    return (
        f"{chosen.fit.name} (k = {chosen.fit.parameter_count}, held-out error {error}) is "
        f"as good as {best.fit.name} (k = {best.fit.parameter_count}, "
        f"{100 * best.held_out_error:.2g} %) within one standard error"
    )


# ------------------------------------------------------------------------------------------------
# Modulus, flow stress, hardening and sharpness are fitted together to the curves, from the end of
# the toe to the break: what a plan asks of a law is its secant at a strain, behind the yield too.
# The modulus is the law's slope at rest, within a fifth of the one that `characterise` measures:
# that one is the slope of a part that is straight within 5 %, and so lies some 2 % below where the
# curve bends early. Held there, it pushed sharpness and hardening off by more than their intervals.
# All are sought in their logarithm within bounds, so that stress rises everywhere: a curve that
# falls behind its yield is run through in the middle, and the misfit says so.


_SHARPNESS = (0.5, 20.0)
"""Bounds of the sharpness. Chosen: below, the bend begins at rest and the modulus means nothing;
above, the knee is narrower than the points."""

_HARDENING = (0.01, 0.9)
"""Bounds of hardening strain over flow stress, and over the modulus. Chosen: stress rises by 1 % at
least over a strain of 1, so that a pulled bar has one answer; and bends at all."""

_MODULUS = 1.2
"""Factor about the measured modulus within which the law's is sought. Chosen: above what a linear
part's curvature, toe and noise move it by."""

_SHARPNESS_STARTS = (0.8, 2.0, 6.0)


_AT_BOUND = 0.01
"""Distance of ln(parameter) from its bound that counts as being there: the search keeps inside."""


def _logs(law: Yielding) -> FloatArray:
    """Return the logarithms of the parameters, shape (4,)."""
    return np.log(astuple(law))


def _by_symbol(logs: FloatArray) -> dict[str, tuple[float, ...]]:
    """Return parameters by symbol; five digits, beyond which no test tells anything."""
    each = zip(LAW_PARAMETERS[Yielding.model], np.exp(logs).tolist(), strict=True)
    return {symbol: (float(f"{value:.5g}"),) for symbol, value in each}


def yielding_parameters(law: Yielding) -> LawParameters:
    """Return a law that yields as a palette holds it, its figures rounded."""
    return LawParameters(law.model, _by_symbol(_logs(law)))


def least_yielding(
    modulus_MPa: float, sample: Sample, *, ridge: float = 0.0
) -> tuple[Yielding, IntArray]:
    """Return the law of about this modulus whose weighted squares are least, from several starts.

    Of each parameter also -1 or 1 where it lies at its lower or upper bound, else 0. A ridge, the
    weight of the logarithms' distance from a start's, settles those that a curve leaves open.
    """
    from scipy.optimize import least_squares

    largest, strain = float(sample.stress_MPa.max()), float(sample.stretch.max()) - 1.0
    moduli = (modulus_MPa / _MODULUS, modulus_MPa * _MODULUS)
    slopes = (_HARDENING[0] * largest, _HARDENING[1] * modulus_MPa / _MODULUS)
    low, high = np.log([moduli, (0.05 * largest, 20.0 * largest), slopes, _SHARPNESS]).T

    def residuals(logs: FloatArray) -> FloatArray:
        stress = Yielding(*np.exp(logs).tolist()).nominal_stress_MPa(sample.stretch)
        off = (stress - sample.stress_MPa) * sample.factor
        return np.append(off, ridge * (logs - starts[0])) if ridge else np.asarray(off)

    hardening = np.clip(0.05 * largest / strain, *np.exp([low[2], high[2]]))
    starts = [np.log([modulus_MPa, 0.9 * largest, hardening, n]) for n in _SHARPNESS_STARTS]
    ends = (least_squares(residuals, start, bounds=(low, high)) for start in starts)
    best = min(ends, key=lambda found: float(found.cost))
    side = (best.x > high - _AT_BOUND).astype(np.int64) - (best.x < low + _AT_BOUND)
    return Yielding(*np.exp(best.x).tolist()), side


# ------------------------------------------------------------------------------------------------
# How far a print's stiffness may lie from its law's: specimens and misfit together.


ASSUMED_LOG_SD = 0.05
"""Taken between specimens where only one was tested: replicates of PolyJet elastomers scatter by
1 to 9 %."""


@dataclass(frozen=True, slots=True)
class ParameterScatter:
    """Standard deviations of ln(stiffness).

    Attributes
    ----------
    specimens
        How many were tested.
    between
        Between specimens; `ASSUMED_LOG_SD` for a single one, or one record given several times.
    misfit
        Root mean square of the law's error along the curve that all specimens share, once each
        specimen's own level is taken out.
    log_sd
        For the next print: its 95 % range is ``exp(+-1.96 log_sd)``. Few specimens are accounted
        for by Student's t, and the mean's own error by 1 + 1/n.
    """

    specimens: int
    between: float
    misfit: float
    log_sd: float


def scatter_of_fit(fit: LawFit, sample: Sample) -> ParameterScatter:
    """Return the scatter of a fit's specimens about its law."""
    return _scatter_of(_courses(fit.nominal_stress_MPa(sample), sample))


def _scatter_of(courses: Sequence[tuple[FloatArray, FloatArray]]) -> ParameterScatter:
    return scatter_of_levels([float(r.mean()) for _, r in courses], _common(courses))


def _courses(law: FloatArray, sample: Sample) -> list[tuple[FloatArray, FloatArray]]:
    """Return stretches of each specimen, and ln of its stress over the law's (n,) there."""
    floor = RELATIVE_FLOOR * sample.stress_MPa.max()
    used = (sample.stress_MPa > floor) & (law > floor)
    ratio = np.log(np.where(used, sample.stress_MPa, 1.0) / np.where(used, law, 1.0))
    own = [used & mine for mine in _own(sample)]
    return [(sample.stretch[i], ratio[i]) for i in own if i.any()]


def _common(courses: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """Return the root mean square course of ln(stress over law) that all specimens share.

    Each without its own level. The mean product of two specimens' courses holds what they share
    alone, the law's misfit; each one's own noise and shape are no part of it. One specimen cannot
    tell the two apart: all of its course is taken.
    """
    if len(courses) < 2:
        return float(np.mean([r.std() for _, r in courses])) if courses else 0.0
    first, last = (max(s[0] for s, _ in courses), min(s[-1] for s, _ in courses))
    at = np.linspace(first, last, 60)
    held = np.array([np.interp(at, s, r) for s, r in courses])
    held -= held.mean(axis=1)[:, None]
    count = len(held)
    whole = (held.sum(axis=0) ** 2).mean() - (held**2).mean(axis=1).sum()
    return float(np.sqrt(max(whole / (count * (count - 1.0)), 0.0)))


def scatter_of_levels(levels: Sequence[float], misfit: float) -> ParameterScatter:
    """Return the scatter of specimens' own ln(stiffness), about a law that is `misfit` off."""
    count = len(levels)
    between, wide = ASSUMED_LOG_SD, np.sqrt(2.0)
    if count > 1 and np.ptp(levels) >= _SAME:
        between, wide = float(np.std(levels, ddof=1)), widened(count) * np.sqrt(1.0 + 1.0 / count)
    return ParameterScatter(count, between, misfit, float(np.hypot(between * wide, misfit)))


# ------------------------------------------------------------------------------------------------
# Intervals that know that points along one curve are not independent: the unit is the specimen.
#
# What users read, stress and secant modulus at a strain, is all but linear in the specimens'
# curves, whatever the law: Student's t of the specimens' influences (the jackknife, linearised).
#
# A parameter is not. The profile of the cost over it gives its interval's shape, skewed or open as
# it may be; how far the cost may rise is set by the scatter between specimens (the adjustment of a
# clustered likelihood by R. Chandler and S. Bate 2007): Student's t with one degree of freedom
# fewer than specimens, squared, times the ratio of the variance of the parameter's score between
# specimens to the one that independent points would have. Both are taken where the profile is, not
# at the best fit, for the law may bend in between. For a law that is linear in its parameter and
# specimens of equal sampling that is the t interval of the specimens' own estimates.


_ROUNDS = 14
"""Secant steps towards the profile's crossing; each refits the other parameters."""

_CLOSE = 0.02
"""Relative error of the crossing's distance at which the search ends."""

_PROFILE_FLAT = 1e-7
"""Gain per step, as a share of the cost, at which a point of a profile is left."""

_FLOOR = 1e-10
"""Added to the normal matrix of unit columns: directions without information stay finite."""

_SAME = 1e-6
"""Relative difference under which specimens are one record given twice: no test repeats so."""


_OPEN = float(np.log(1000.0))
"""Half width of an interval of ln(parameter) from which on it is open. Chosen: then the tests do
not tell the parameter's size."""


class Intervals(NamedTuple):
    """Two-sided intervals of a fit's parameters.

    Attributes
    ----------
    a, c
        Low and high, shapes (q, 2) and (p, 2), in the file's terms; infinite where the tests
        leave a side open, for the profile meets the law's bound first (zero below, for a
        parameter that is positive). All are open where specimens say nothing of their scatter.
    """

    a: FloatArray
    c: FloatArray


@dataclass(frozen=True, slots=True)
class SecantInterval:
    """A law's secant modulus at a strain, and how sure it is; stress is strain times it.

    Attributes
    ----------
    strain
        Engineering strain; 0 stands for the initial modulus.
    low_MPa, high_MPa
        Ends of the interval of the specimens' mean; 0 and infinity where it is unknown.
    next_log_sd
        Standard deviation of ln(the next print's secant) about the law's.
    """

    strain: float
    value_MPa: float
    low_MPa: float
    high_MPa: float
    next_log_sd: float


def widened(specimens: float) -> float:
    """Return Student's t of so many specimens over the normal deviation."""
    return students_t(0.95, specimens) / normal_quantile()


def intervals(fit: LawFit, sample: Sample, level: float = 0.95) -> Intervals:
    """Return intervals of all parameters of a fit, by profiles."""
    q = fit.law.nonlinear
    ends = np.tile([-np.inf, np.inf], (fit.parameter_count, 1))
    if _scatter_known(sample):
        spread = np.sqrt(_moves_variance(fit, sample, np.eye(len(ends))))
        t = students_t(level, sample.specimens)
        # Linear: the jackknife knows that the specimen that goes farthest tells most of the last
        # coefficient, which the profile's score of a few specimens does not.
        linear = fit.c[:, None] + t * spread[q:, None] * np.array([-1.0, 1.0])
        ends = _crossings(fit, sample, t, spread) if q else linear
    return Intervals(ends[:q], ends[q:])


def _half_widths(own: FloatArray, level: float) -> FloatArray:
    """Return the half widths of Student's intervals of the specimens' logarithms (n, k)."""
    count = len(own)
    if count < 2 or float(np.ptp(own, axis=0).max(initial=0.0)) < _SAME:
        return np.full(own.shape[1], np.inf)
    half = students_t(level, count) * own.std(axis=0, ddof=1) / np.sqrt(count)
    return np.where(half > _OPEN, np.inf, half)


def secant_intervals(
    fit: LawFit, sample: Sample, strains: Sequence[float], level: float = 0.95
) -> tuple[SecantInterval, ...]:
    """Return the law's secant moduli at strains from 0 up to the largest that was tested.

    The next print's is off by the scatter of prints, and by the law's own error at that strain,
    which is largest at rest, where a record tells least of it.
    """
    tested = np.array([e for e in strains if 1.0 + e <= sample.stretch.max()])
    # At rest the secant is the slope, which stress at a small strain gives to seven digits.
    strain = np.maximum(tested, 1e-7)
    derivative, stress = _derivatives(fit, fit.law.evaluate(1.0 + strain, fit.a[None]))
    courses = _courses(fit.nominal_stress_MPa(sample), sample)
    value, scatter = stress / strain, _scatter_of(courses)
    half, next_ = np.full(len(strain), np.inf), np.full(len(strain), scatter.log_sd)
    if _scatter_known(sample):
        relative = (derivative / stress[:, None]).T
        half = students_t(level, sample.specimens) * np.sqrt(_moves_variance(fit, sample, relative))
        if scatter.specimens > 1:  # else one is so stiff that it hides all others
            # What holds a law moves it to one side: the mean's interval lets go of that, but the
            # law's error, beside prints' own scatter, is as small as it is held to.
            held = _moves_variance(fit, sample, relative, held=True)
            next_ = _next_log_sds(_levels_at(tested, courses), held, scatter.misfit)
    return _secants(tested, value, half, next_)


def _secants(
    strain: ArrayLike, value: FloatArray, half: FloatArray, next_log_sd: FloatArray
) -> tuple[SecantInterval, ...]:
    """Return intervals of half widths in ln(value)."""
    columns = (strain, value, value * np.exp(-half), value * np.exp(half), next_log_sd)
    return tuple(SecantInterval(*row) for row in np.stack(columns, axis=1).tolist())


def _levels_at(strain: FloatArray, courses: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Return what each specimen is off the law at strains, (n, k): on the line of its course."""
    own = ((stretch - 1.0, ratio) for stretch, ratio in courses)
    lines = [np.polyfit(e, r, min(1, len(r) - 1), w=np.abs(e) ** 0.5) for e, r in own]
    return np.array([np.polyval(line, strain) for line in lines])


def _next_log_sds(levels: FloatArray, own: FloatArray, misfit: float) -> FloatArray:
    """Return the next print's deviations at strains, where the law's own variances are `own`.

    The scatter of the specimens (n, k) about their mean, and what the law is less sure of at a
    strain than that mean. Both come of the same few specimens: Student's t with the degrees of
    freedom that Welch and Satterthwaite give to a sum of two variances.
    """
    count, between = len(levels), np.maximum(levels.var(axis=0, ddof=1), _SAME**2)
    level, more = between * (1.0 + 1.0 / count), np.maximum(own - between / count, 0.0)
    freedom = (count - 1.0) * (level + more) ** 2 / (level**2 + more**2)
    wide = [widened(1.0 + one) for one in freedom.tolist()]
    return np.asarray(np.hypot(np.sqrt(level + more) * wide, misfit))


def _scatter_known(sample: Sample) -> bool:
    """Return whether at least two specimens of one loading differ in their mean secant."""
    own = _own(sample)
    means = np.array([np.mean(sample.stress_MPa[i] / (sample.stretch[i] - 1.0)) for i in own])
    loading = np.array([(3 + sample.mode[i][0]) * np.sign(sample.stretch[i][0] - 1.0) for i in own])
    alike = [means[loading == one] for one in np.unique(loading)]
    return any(float(np.ptp(one)) > _SAME * abs(float(one.mean())) for one in alike)


def _derivatives(fit: LawFit, columns: Columns) -> tuple[FloatArray, FloatArray]:
    """Return the derivative of stress by (a, file's c), shape (n, q + p), and the stress."""
    phi, slope = columns
    divisor, change = (d[0] for d in fit.law.divisor(fit.a[None]))
    by_c = phi[0] * divisor
    by_a = (slope[0] * divisor + phi[0] * change) * fit.c if fit.law.nonlinear else slope[0]
    return np.concatenate([by_a, by_c], axis=1), by_c @ fit.c


def _linearised(fit: LawFit, sample: Sample, *, held: bool = False) -> tuple[FloatArray, ...]:
    """Return unit columns of the scaled residual's derivative, their sizes, and the residual.

    Of a law that is held (`held`) the columns go on behind the points: by `rows_leant_on`.
    """
    derivative, stress = _derivatives(fit, sample_columns(fit.law, sample, fit.a[None]))
    jacobian = sample.factor[:, None] * derivative
    if held:
        rows, _ = _derivatives(fit, rows_leant_on(fit.law, sample, fit.a))
        jacobian = np.concatenate([jacobian, rows])
    size = np.sqrt((jacobian**2).sum(axis=0))
    size = np.where(size > 0.0, size, 1.0)
    return jacobian / size, size, sample.factor * (stress - sample.stress_MPa)


def _moves_variance(
    fit: LawFit, sample: Sample, directions: FloatArray, *, held: bool = False
) -> FloatArray:
    """Return the variance between specimens of linear forms (q + p, k) of the parameters.

    That of the jackknife: how far the linearised estimate moves when one specimen is left out.
    """
    unit, size, residual = _linearised(fit, sample, held=held)
    moves = []
    for own in map(np.flatnonzero, _own(sample)):
        rest = np.delete(unit, own, axis=0)
        normal = rest.T @ rest + _FLOOR * np.eye(unit.shape[1])
        moves.append(np.linalg.solve(normal, unit[own].T @ residual[own]))
    variance = (np.stack(moves) / size @ directions).var(axis=0)
    return np.asarray(variance * (len(moves) - 1.0))


def _own(sample: Sample) -> list[BoolArray]:
    return [sample.specimen == number for number in np.unique(sample.specimen)]


def _allowed_rise(fit: LawFit, sample: Sample, which: int) -> float:
    """Return the variance between specimens of the profile's score over its square's, at a fit.

    The score is that of one parameter, freed of what the others could do instead. Away from the
    best fit every specimen's has a share in the slope of the cost, by how much it tells of the
    parameter; what is left is how far the specimens differ.
    """
    unit, _, residual = _linearised(fit, sample)
    others = np.delete(unit, which, axis=1)
    normal = others.T @ others + _FLOOR * np.eye(others.shape[1])
    score = unit[:, which] - others @ np.linalg.solve(normal, others.T @ unit[:, which])
    each = np.array([score[i] @ residual[i] for i in _own(sample)])
    told = np.array([score[i] @ score[i] for i in _own(sample)])
    whole = max(float(told.sum()), 1e-300)
    share = told / whole
    apart = each - share * each.sum()
    # The more a specimen tells, the nearer to it is the mean that it is compared with.
    return float(np.sum(apart**2 / np.maximum(1.0 - 2.0 * share + share @ share, 1e-9)) / whole)


def _crossings(fit: LawFit, sample: Sample, t: float, spread: FloatArray) -> FloatArray:
    """Return where each parameter's profile has risen too far, below and above, shape (k, 2).

    Nonlinear parameters come first. The square root of the rise grows about evenly with the
    distance, so that a secant step from the best fit all but hits; it is kept within the bracket
    found so far. What any of the profiles passes through belongs to every parameter's interval, if
    it is as good as that asks: a modulus falls by decades where its exponent moves by a few units,
    and its own profile would not find that way.
    """
    q = fit.law.nonlinear
    k = len(spread)
    best = np.concatenate([fit.a, fit.c])
    which, side = np.repeat(np.arange(k), 2), np.tile([-1.0, 1.0], k)
    limit = np.full(2 * k, np.inf)
    bounds = fit.law.bounds(float(sample.stretch.max()))
    limit[: 2 * q] = (np.abs(bounds - fit.a[:, None])).ravel()
    farthest = 10.0 * np.maximum(np.abs(best), 1e-300)
    distance = np.clip(t * spread, 1e-6 * np.abs(best) + 1e-300, farthest)[which]
    inside, outside = np.zeros(2 * k), np.full(2 * k, np.inf)
    near = np.tile(fit.a, (2 * k, 1))
    open_ended = np.zeros(2 * k, dtype=bool)
    todo = np.arange(2 * k)
    passed = []
    for _ in range(_ROUNDS):
        distance[todo] = np.minimum(distance[todo], limit[todo])
        at = distance[todo]
        ends = best[which[todo]] + side[todo] * at
        cost, a, c = _profile(fit, sample, which[todo], ends, near[todo])
        near[todo] = _interval_rounded(a)
        passed.append((cost, np.concatenate([a, c], axis=1)))
        rows = zip(which[todo], a, c, strict=True)
        allowed = [_allowed_rise(replace(fit, a=a, c=c), sample, k) for k, a, c in rows]
        target = t * t * np.maximum(allowed, 1e-12 * fit.objective)
        ratio = np.sqrt(np.maximum(cost - fit.objective, 0.0) / target)
        under = ratio < 1.0
        inside[todo] = np.where(under, np.maximum(inside[todo], at), inside[todo])
        outside[todo] = np.where(under, outside[todo], np.minimum(outside[todo], at))
        open_ended[todo] = under & (at >= limit[todo])
        done = (np.abs(ratio - 1.0) < _CLOSE) | open_ended[todo]
        step = at / np.clip(ratio, 0.1, 10.0)
        astray = (step <= inside[todo]) | (step >= outside[todo])
        middle = 0.5 * (inside[todo] + np.where(np.isinf(outside[todo]), 2 * at, outside[todo]))
        distance[todo] = _interval_rounded(np.where(done, at, np.where(astray, middle, step)))
        todo = todo[~done]
        if not len(todo):
            break
    # A search that ran out of rounds gives the wider end of its bracket.
    distance[todo] = np.minimum(outside[todo], limit[todo])
    end = best[which] + side * distance
    positive = np.append(bounds[:, 0] >= 0.0, np.zeros(fit.law.columns, dtype=bool))[which]
    end = np.where(open_ended, np.where(positive & (side < 0.0), 0.0, side * np.inf), end)
    out: FloatArray = end.reshape(k, 2)
    costs, points = (np.concatenate(values) for values in zip(*passed, strict=True))
    for rise, point in zip(costs - fit.objective, points, strict=True):
        for one in np.flatnonzero((point < out[:, 0]) | (point > out[:, 1])):
            asked = t * t * _allowed_rise(replace(fit, a=point[:q], c=point[q:]), sample, int(one))
            if rise <= asked:
                out[one] = min(out[one, 0], point[one]), max(out[one, 1], point[one])
    return out


def _profile(
    fit: LawFit, sample: Sample, which: IntArray, at: FloatArray, near: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the least cost with one parameter held at a value a row, and the parameters there.

    Each is sought from the best fit and from the last point of this profile.
    """
    q, rows = fit.law.nonlinear, np.arange(len(which))
    is_held = which[:, None] == np.arange(fit.parameter_count)
    held_a, held_c = is_held[:, :q], np.where(is_held[:, q:], at[:, None], np.nan)
    starts = [np.where(held_a, at[:, None], start) for start in (fit.a, near)]
    held = np.tile(held_a, (len(starts), 1)), np.tile(held_c, (len(starts), 1))
    found = minimise(fit.law, sample, np.concatenate(starts), held, flat=_PROFILE_FLAT)
    cost = found.cost.reshape(len(starts), -1)
    lowest = np.argmax(cost <= cost.min(axis=0) * (1.0 + 1e-6), axis=0)
    a = found.a.reshape(*cost.shape, q)[lowest, rows]
    # Ogden's term of exponent 0 is none, its modulus infinite.
    a = np.where(a == 0.0, _PROFILE_FLAT, a)
    c = found.c.reshape(*cost.shape, -1)[lowest, rows]
    c = np.where(np.isnan(held_c), c / fit.law.divisor(a)[0], c)
    return cost[lowest, rows], a, c


def _interval_rounded(values: FloatArray) -> FloatArray:
    """Round to four digits, so that the last bits of a processor do not choose the path."""
    scale = 10.0 ** np.floor(np.log10(np.maximum(np.abs(values), 1e-300)))
    return np.asarray(np.where(np.isfinite(values), np.round(values / scale, 3) * scale, values))


# ------------------------------------------------------------------------------------------------
# Slack before a specimen bears: stress stays where it is, and then rises at once.
#
# The tangent of a rubber's curve, by which a toe is found (ASTM D638), is never straight: its zero
# lies before the end of the slack. Here the curve behind the slack is Mooney's, which bends.


_SLACK_RANGE = 0.3
"""Strain behind the record's beginning over which Mooney's form describes an elastomer."""

_SLACK_STEPS = 101
_SLACK_LEVEL = 0.95
"""Confidence that the specimens' slack together differs from none; a slack missed costs 10 % of the
modulus. How often one is found is in docs/explanation/fitting.md."""

_CORRELATION_STRAINS = np.geomspace(1e-5, 1.0, 31)
"""Strains over which the scatter's correlation may fall by e. Numerical."""


def loading(curves: Sequence[Curve]) -> list[Curve]:
    """Return the curves from the end of their slack to their largest stress; slack is noted."""
    found = []
    for curve, slack in zip(curves, _slacks(curves), strict=True):
        if slack:
            bears = f"specimen {curve.specimen}: begins to bear at strain {slack:.3g}"
            note = f"{bears}; strains of its material's law count from there"
            curve = curve.part(curve.strain >= slack, note, origin=slack)
        found.append(curve.part(slice(int(np.argmax(curve.stress_MPa)) + 1)))
    return found


def _slacks(curves: Sequence[Curve]) -> list[float]:
    """Return the strain at which each specimen begins to bear, 0 where it has no slack.

    Slack is the series', or one specimen's that slipped. An F test says whether one slack of all
    specimens lowers their squares: then each begins at its own. Else those do that pass the test
    alone. Each of the two questions has half of the errors, of the second each specimen its part.
    The scatter of points is correlated along a record: over which strain tells the restricted
    likelihood of all specimens without slack.
    """
    from scipy.special import fdtri

    begun = {k: found for k, curve in enumerate(curves) if len((found := _beginning(curve))[0])}
    if not begun:
        return [0.0] * len(curves)
    farthest = np.array([reach for *_, reach in begun.values()])
    tried = np.linspace(0.0, farthest.max(), _SLACK_STEPS)
    each = [_slack_squares(x, y, np.minimum(tried, reach)) for x, y, reach in begun.values()]
    squares, deviance = (np.array(values) for values in zip(*each, strict=True))
    own = squares[:, np.argmin(deviance.sum(axis=0))]
    freedom = np.array([len(x) - 3 for x, *_ in begun.values()])
    gain = freedom[:, None] * (own[:, :1] - own) / own.min(axis=1)[:, None]
    error = (1.0 - _SLACK_LEVEL) / min(len(begun), 2)  # of a single specimen both are one question
    slipped = gain.max(axis=1) > fdtri(1, freedom, 1.0 - error / len(begun))
    slipped |= gain.sum(axis=0).max() > fdtri(1, freedom.sum(), 1.0 - error)
    best = tried[np.argmax(gain, axis=1)]
    best = np.where(slipped & (best < farthest), best, 0.0)  # the farthest is no minimum
    slacks = dict(zip(begun, best.tolist(), strict=True))
    return [slacks.get(k, 0.0) for k in range(len(curves))]


def _beginning(curve: Curve) -> tuple[FloatArray, FloatArray, float]:
    """Return strain and stress where Mooney's form holds, and how far slack may reach.

    None of a record that tells no slack. The tangent's toe ends before the slack does.
    """
    toe = float(curve.strain[-1] - characterise.toe_compensated(curve).strain[-1])
    near = np.arange(len(curve.strain)) <= np.argmax(curve.stress_MPa)
    near &= curve.strain - curve.strain[0] <= toe + _SLACK_RANGE
    few = near.sum() < 3 * characterise.MINIMUM_POINTS
    if few or curve.strain[0] < 0.0 or curve.mode == "compression":
        near[:] = False
    x = curve.strain[near]
    return x, curve.stress_MPa[near], toe + 0.3 * float(np.max(x - toe, initial=0.0))


def _slack_squares(x: FloatArray, y: FloatArray, slack: FloatArray) -> tuple[FloatArray, ...]:
    """Return how well Mooney's form behind each slack (s,) follows a record's beginning.

    The generalised squares (r, s) for each of `_CORRELATION_STRAINS`, and minus twice the
    restricted log-likelihood of each without slack (r,).
    """
    stretch = 1.0 + np.maximum(x - slack[:, None], 0.0)
    front = stretch - stretch**-2
    basis, _ = np.linalg.qr(np.stack([front, front / stretch], axis=2))
    scatter = y - np.einsum("snk,sk->sn", basis, np.einsum("snk,n->sk", basis, y))
    # Scatter whose correlation falls evenly with strain has an inverse covariance of three bands.
    columns = np.concatenate([basis, scatter[:, :, None]], axis=2)
    rows = columns.transpose(0, 2, 1)
    beside = rows[:, :, 1:] @ columns[:, :-1]
    correlation = np.exp(-float(x[-1] - x[0]) / (len(x) - 1) / _CORRELATION_STRAINS)
    r = correlation[:, None, None, None]
    product = rows @ columns - r * (beside + beside.transpose(0, 2, 1))
    product += r**2 * (rows[:, :, 1:-1] @ columns[:, 1:-1])
    normal, across = product[..., :2, :2], product[..., :2, 2]
    solved = np.linalg.solve(normal, across[..., None])[..., 0]
    squares = product[..., 2, 2] - (across * solved).sum(axis=2)
    squares = np.maximum(squares, 1e-24 * float(y @ y))  # less is rounding
    deviance = (len(x) - 2) * np.log(squares[:, 0]) - np.log1p(-(correlation**2))
    return squares, deviance + np.linalg.slogdet(normal[:, 0])[1]


# ------------------------------------------------------------------------------------------------
# From one material's specimens to its law: hyperelastic where it is elastic, else one that yields.


@dataclass(frozen=True, slots=True, eq=False)
class MaterialFit:
    """What a palette says of one material, and why.

    Attributes
    ----------
    secants
        What the law says at rest and at some strains up to the largest tested, with intervals.
    choice
        The laws that were tried; none for a plastic material, which gets a law that yields.
    notes
        What the user should know, one sentence each.
    curves
        The specimens' curves that the law was fitted to: behind slack or toe.
    """

    material: str
    characteristics: MaterialCharacteristics
    law: LawParameters
    uncertainty: Uncertainty
    scatter: ParameterScatter
    choice: Choice
    notes: tuple[str, ...] = ()
    secants: tuple[SecantInterval, ...] = ()
    curves: tuple[Curve, ...] = ()

    __repr__ = brief

    @property
    def chosen_name(self) -> str:
        """The law's name, with its number of terms where there is a choice."""
        chosen = self.choice.chosen
        return self.law.model if chosen is None else chosen.fit.name

    @property
    def elongation_at_break(self) -> float:
        """Mean strain at break of the specimens; of compression, the mean largest strain."""
        return self.characteristics.spreads["elongation_at_break"].mean

    @property
    def compressed(self) -> bool:
        """Whether the specimens were compressed, none pulled; their curves are sizes."""
        return self.curves[0].mode == "compression"

    def stress_MPa(self, strain: FloatArray) -> FloatArray:
        """Return the law's nominal stress at strains, both sizes where it was compressed."""
        sign = -1.0 if self.compressed else 1.0
        return sign * make_law(self.law).nominal_stress_MPa(1.0 + sign * strain)


def fit_material(
    material: str,
    curves: Sequence[Curve],
    laws: Sequence[SeparableLaw],
    *,
    others: Sequence[Curve] = (),
    weighting: str = "relative",
    starts: int = STARTS,
    level: float = 0.95,
) -> MaterialFit:
    """Characterise a material's specimens, fit the laws, and choose one.

    Strains count from the end of the slack, and the curve up to its largest stress is fitted; of a
    plastic material from the end of the toe, and the whole curve. A law that is not held to be
    stable across the load is taken where that costs more than `STABLE_WITHIN` times the error.
    What bends over as no stable law of rubber does gets a law that yields, elastic or not.

    Parameters
    ----------
    others
        Specimens compressed, or loaded in another way (`Curve.mode`), fitted together with the
        others: each mode weighs the same, in it each specimen.

    Raises
    ------
    ArgumentError
        No law is stable over the working range, which goes to the mean elongation at break; or
        what was compressed alone is plastic.
    FileError
        A curve that no figure can rest on.
    """
    if not 0.5 <= as_number(level, "`level`") < 1.0:
        raise ArgumentError(f"level {level:g}: it must be at least 0.5 and below 1, as 0.95")
    found = characterise_material(material, curves)
    compressed, working = curves[0].mode == "compression", found.spreads["elongation_at_break"].mean
    if compressed and found.deformation.kind == "plastic":
        why = f"material {material}: compressed alone, and {found.deformation.reason}"
        raise ArgumentError(f"{why}; add tensile tests, or leave it out by `leave_out`")
    notes = [note for c in found.specimens for note in c.notes if "not shifted" not in note]
    if found.deformation.kind == "plastic":
        fall = max(1.0 - float(c.stress_MPa[-1] / c.stress_MPa.max()) for c in curves)
        if fall > _NOTABLE_FALL:
            notes.append(
                f"material {material}: stress falls by up to {100 * fall:.0f} % behind the yield; "
                "the law must rise, and runs through the middle"
            )
        unlike = "left out, as a law that yields is fitted to tension alone"
        notes.extend(Caution(f"specimen {curve.specimen}: {unlike}") for curve in others)
        return replace(_plastic(found, curves, weighting, level), notes=tuple(notes))
    loaded = tuple(loading(curves))
    # A law's strains count from where its specimens begin to bear, not from the tangent's zero.
    notes = [note for note in notes if "strains count from" not in note]
    for curve, whole in zip(loaded, curves, strict=True):
        notes += curve.notes[len(whole.notes) :]
    if compressed:
        valid = f"material {material}: compressed alone; its law is valid in compression to strain"
        unknown = "in tension nothing was measured: as much stands for its elongation at break"
        notes = [Caution(f"{valid} {working:.3g}; {unknown}; add tensile tests if it is pulled")]
    ends_at = [curve.part(slice(int(np.argmax(np.abs(curve.stress_MPa))) + 1)) for curve in others]
    sample = sample_of([*loaded, *ends_at], weighting=weighting)
    with refused(ArgumentError, f"material {material}", "{}", ArgumentError):
        choice = choose_law(laws, sample, working, starts=starts)
    chosen = choice.chosen
    pulled = not (others or compressed)
    if chosen is not None and len({law.model for law in laws}) > 1 and pulled:
        scatter = scatter_of_fit(chosen.fit, sample)
        if scatter.misfit > _NOTABLE_MISFIT * scatter.between:
            bent = _plastic(found, curves, weighting, level)
            if STABLE_WITHIN * bent.scatter.misfit < scatter.misfit:
                reason = (
                    f"a law that yields follows it to {100 * bent.scatter.misfit:.2g} %, "
                    f"{chosen.fit.name} to {100 * scatter.misfit:.2g} %"
                )
                choice = replace(choice, chosen=None, reason=reason)
                return replace(bent, notes=tuple(notes), choice=choice)
    if chosen is None:
        form = "the stress of {} falls at strain {:.3g}"
        falls = "; ".join(form.format(c.fit.name, c.unstable_strain) for c in choice.candidates)
        raise ArgumentError(
            f"material {material}: no law is stable up to its elongation at break, {working:.3g}, "
            f"and a tenth beyond ({falls}); try `law` all"
        )
    price = 1.0
    if chosen.fit.law.model == "ogden":
        free = fit_law(chosen.fit.law, replace(sample, across=False), starts=starts)
        # One specimen's cost lacks the scatter that several would have.
        own = ASSUMED_LOG_SD**2 if sample.specimens == 1 else 0.0
        price = ((chosen.fit.cost + own) / (free.cost + own)) ** 0.5
        if price > STABLE_WITHIN:
            chosen = replace(chosen, fit=free, unstable_strain=free.unstable_strain(working))
            candidates = tuple(chosen if c is choice.chosen else c for c in choice.candidates)
            choice = replace(choice, candidates=candidates, chosen=chosen)
            sample = replace(sample, across=False)
    if limits := stability(make_law(chosen.fit.parameters), working).limits:
        only = f"stable (Drucker) only at stretch {', '.join(limits)}"
        notes.append(Caution(f"{material}: {chosen.fit.name} is {only}"))
        if price > STABLE_WITHIN:
            held = f"held to be stable to its break its error is {price:.2g} times as large"
            choice = replace(choice, reason=f"{choice.reason}; {held}")
    if others:
        told = by_mode(chosen.fit, sample)
        said = [f"{mode} weighs {w:.3g}, {100 * off:.2g} % off" for mode, (w, off) in told]
        notes.append(f"material {material}: {'; '.join(said)} (RMS)")
    secants = secant_intervals(chosen.fit, sample, (0.0, *characterise.SECANT_STRAINS), level)
    notes.extend(_doubts(material, chosen, secants))
    ends, known = intervals(chosen.fit, sample, level), _scatter_known(sample)
    if known and pulled and np.isposinf(ends.c[:, 1]).any():
        notes.append(
            f"material {material}: tension bounds no modulus of {chosen.fit.name} from above: add "
            "equibiaxial tests, or compression to stretch 0.6"
        )
    how = "profiles of the error" if chosen.fit.law.nonlinear else "the jackknife"
    fit, judged = chosen.fit, f"laws are judged on what is left out, {choice.scheme} at a time"
    sure = Uncertainty(
        specimens=found.n,
        level=level,
        law_low=_end_rounded(fit.law.parameters(ends.a[:, 0], ends.c[:, 0])),
        law_high=_end_rounded(fit.law.parameters(ends.a[:, 1], ends.c[:, 1])),
        basis=f"{_basis(how, known, found.n)}; {judged}",
        r2=fit.r2,
        nrmse=fit.nrmse,
        held_out_error=float(f"{chosen.held_out_error:.3g}"),
        strain=tuple(one.strain for one in secants),
        log_sd=tuple(float(f"{one.next_log_sd:.4g}") for one in secants),
    )
    law, scatter = fit.parameters, scatter_of_fit(fit, sample)
    return MaterialFit(material, found, law, sure, scatter, choice, tuple(notes), secants, loaded)


def by_mode(fit: LawFit, sample: Sample) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the share of the weight and the root mean square residual over scale by loading."""
    off = (fit.nominal_stress_MPa(sample) - sample.stress_MPa) / sample.scale_MPa
    for k in np.unique(sample.mode):
        weight = np.where(sample.mode == k, sample.weight, 0.0)
        share = float(weight.sum())
        yield LOADINGS[k], (share, float(np.sqrt(weight @ off**2 / share)))


def _doubts(
    material: str, chosen: LawCandidate, secants: Sequence[SecantInterval]
) -> Iterator[str]:
    fit = chosen.fit
    if not chosen.determined:
        yield (
            f"material {material}: tests do not determine single terms of {fit.name}; read "
            "its secant moduli, not its coefficients"
        )
    if len(secants) > 1 and secants[1].value_MPa > secants[0].value_MPa:
        # One Ogden term steepens from rest from an exponent of 6 on; elastomers have 1 to 4.
        yield Caution(
            f"material {material}: its stress steepens from rest on, as in compression or "
            "behind slack: look at the tests"
        )
    if not fit.starts_converged or fit.starts_agreeing < min(2, fit.starts):
        yield Caution(
            f"material {material}: {fit.starts_agreeing} of {fit.starts} starts reach the best "
            f"{fit.name}; a better one may exist: try more --starts"
        )
    if fit.at_bound:
        yield Caution(
            f"material {material}: a parameter of {fit.name} lies at its bound, so that the tests "
            "do not determine it"
        )


def _basis(how: str, known: bool, count: int) -> str:
    """Say what intervals rest on."""
    if known:
        return f"{how}, by the scatter of {count} specimens"
    if count > 1:
        return f"unknown: {count} specimens of one record tell no scatter"
    return "unknown: one specimen tells nothing of the scatter between specimens"


def _end_rounded(parameters: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
    """Round ends of intervals, which are found to 2 %, to four digits."""
    return {k: tuple(float(f"{v:.4g}") for v in values) for k, values in parameters.items()}


def _at_one_level(curves: Sequence[Curve], laws: Sequence[Yielding]) -> list[Curve]:
    """Return curves brought to the mean level of their laws.

    Where one specimen breaks before the others the mean curve would jump to their level.
    """
    strain = np.linspace(0.0, min(float(curve.strain[-1]) for curve in curves), 61)[1:]
    levels = np.array([np.log(law.nominal_stress_MPa(1.0 + strain)).mean() for law in laws])
    return [
        replace(curve, stress_MPa=curve.stress_MPa * float(np.exp(levels.mean() - level)))
        for curve, level in zip(curves, levels, strict=True)
    ]


def _plastic(
    found: MaterialCharacteristics, curves: Sequence[Curve], weighting: str, level: float
) -> MaterialFit:
    """Fit a law that yields, with intervals of what the specimens' own laws say."""
    whole = tuple(characterise.toe_compensated(curve) for curve in curves)
    moduli = [c.modulus_MPa for c in found.specimens]
    sample = sample_of(whole, weighting=weighting)
    each = [sample_of([curve], weighting=weighting) for curve in whole]
    laws, sides = zip(*map(least_yielding, moduli, each), strict=True)
    levelled = _at_one_level(whole, laws)
    modulus_MPa = float(np.exp(np.mean(np.log(moduli))))
    law, _ = least_yielding(modulus_MPa, sample_of(levelled, weighting=weighting))
    stress = law.nominal_stress_MPa(sample.stretch)
    error, measured = stress - sample.stress_MPa, sample.stress_MPa
    own = np.array([_logs(one) for one in laws])
    # The specimens' scatter tells how sure their mean is; the law through all of them at once has
    # its hardening from the few that go on longest, and so less surely. The interval holds both.
    half, middle = _half_widths(own, level), own.mean(axis=0)
    low, high = np.minimum(middle - half, _logs(law)), np.maximum(middle + half, _logs(law))
    # A parameter at its bound in some specimen is one that its test leaves open on that side.
    low = np.where((np.array(sides) < 0).any(axis=0), -np.inf, low)
    high = np.where((np.array(sides) > 0).any(axis=0), np.inf, high)
    strains = [e for e in (0.0, *characterise.SECANT_STRAINS) if 1.0 + e <= sample.stretch.max()]
    wide = _half_widths(np.log([secant_modulus_MPa(one, strains) for one in laws]), level)
    scatter = _scatter_of(_courses(stress, sample))
    next_ = np.full(len(strains), scatter.log_sd)
    secants = _secants(strains, secant_modulus_MPa(law, strains), wide, next_)
    sure = Uncertainty(
        specimens=found.n,
        level=level,
        law_low=_end_rounded(_by_symbol(low)),
        law_high=_end_rounded(_by_symbol(high)),
        basis=_basis("Student's t", bool(np.isfinite(wide).any()), found.n),
        r2=1.0 - float(np.sum(error**2) / np.sum((measured - measured.mean()) ** 2)),
        nrmse=float(np.sqrt(np.sum(sample.weight * error**2))) / float(measured.max()),
    )
    choice, parameters = Choice((), None, "", found.deformation.reason), yielding_parameters(law)
    return MaterialFit(found.material, found, parameters, sure, scatter, choice, (), secants, whole)


_NOTABLE_FALL = 0.1
"""Fall of stress behind the yield that is told. Chosen: the law then lies 5 % off on either side,
as much as specimens scatter."""


STABLE_WITHIN = 1.25
"""Times the error that a law may cost which says more: one that is stable in every direction, or
one that has an energy where one that yields has none."""

_NOTABLE_MISFIT = 0.75
"""Share of the scatter between specimens from which on a misfit is looked at: together they are
1.25 times the scatter."""
