"""Where the gap of a campaign lies: every axis, with its share, p-value and a sentence."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.special

from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.axes import axis_cells, axis_patterns, column_levels, rows_by_design, steps_of
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import SIGNIFICANT, Location
from planner.gap.noise import SpecimenNoise
from planner.gap.observations import BRANCHES, FeatureTable
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import Palette
from planner.simulation.bar import ProfileDesign

__all__ = ["Whitening", "localise", "tail_p"]


# ------------------------------------------------------------------------------------------------
# Residuals on a scale where all noise is of unit variance and unrelated.
#
# A specimen's own noise is taken out by its covariance, what specimens share by the inverse root of
# ``I + V V'`` with V the whitened shared columns, which is of low rank. So what laws or batches may
# well be off by counts no more than its prior allows.


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """The way from N features to N numbers of unit noise.

    Attributes
    ----------
    directions, shrink : (N, q), (q,)
        What specimens share, orthonormal, and how much of it is taken off.
    degrees_of_freedom
        Of a scaled chi-square variance that is as uncertain as the noise.
    """

    noise: SpecimenNoise
    directions: FloatArray
    shrink: FloatArray
    degrees_of_freedom: float

    @classmethod
    def of(cls, noise: SpecimenNoise, shared: FloatArray, log_sd: float) -> "Whitening":
        """Return the whitening of noise.

        Parameters
        ----------
        shared : (N, q)
            What specimens share, a column of prior deviation 1 each: batches, the calibration of
            the palette's laws. It is marginalised.
        log_sd
            How far the noise may be off, as a standard deviation of its logarithm.
        """
        directions, singular, _ = np.linalg.svd(noise.whiten(shared), full_matrices=False)
        shrink = 1.0 - 1.0 / np.sqrt(1.0 + singular**2)
        return cls(noise, directions, shrink, 0.5 / max(log_sd, 1e-3) ** 2)

    @property
    def starts(self) -> IntArray:
        """Rows of specimen i are ``starts[i]`` to ``starts[i + 1]``, (n + 1,)."""
        return self.noise.first_row

    @property
    def of_row(self) -> IntArray:
        """Number of each row's specimen, (N,)."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))

    def of_all(self, whitened: FloatArray) -> FloatArray:
        """Return what the noise has whitened with that whitened which specimens share."""
        along = (self.directions.T @ whitened).T * self.shrink
        return np.asarray(whitened - self.directions @ along.T, dtype=np.float64)

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), whitened."""
        return self.of_all(self.noise.whiten(columns))

    def summed(self, values: FloatArray) -> FloatArray:
        """Return sums over each specimen's rows, (n, ...)."""
        sums: FloatArray = np.add.reduceat(values, self.starts[:-1], axis=0)
        return sums


def _orthonormal(columns: FloatArray, besides: FloatArray | None = None) -> FloatArray:
    """Return an orthonormal basis of columns, (N, k), and of what is in them beside another."""
    if not columns.shape[1]:
        return columns
    scale = np.linalg.norm(columns, axis=0)
    left: FloatArray = columns[:, scale > 0.0] / scale[scale > 0.0]
    if besides is not None and left.shape[1]:
        for _ in range(2):  # once more for rounding
            left = left - besides @ (besides.T @ left)
    if not left.shape[1]:
        return left
    basis, singular, _ = np.linalg.svd(left, full_matrices=False)
    # Columns were of unit length: what is left of less than a hundredth is the other's.
    kept: FloatArray = np.ascontiguousarray(basis[:, singular > 1e-2])
    return kept


# ------------------------------------------------------------------------------------------------
# P-values over a family of axes: how often the clearest of all is as clear without a gap.
#
# Westfall and Young's single-step minimum of p-values. The statistic of each axis is brought to one
# scale by its own draws first, so that none dominates; the draws then say how often the smallest of
# all is as small, whatever the axes have in common. An axis is never clearer than its own statistic
# says.
#
# What draws cannot resolve follows from the tail of its logarithm, which is exponential (a
# generalised Pareto tail of shape 0, fitted to the clearest tenth of draws, never thinner than that
# of a true p-value).


_SMALLEST = 1e-12
"""Of a p-value. Convention: a tail fitted to a thousand draws says nothing about less."""

_TIES = 1e-9
"""Relative difference below which a draw is as large as what is seen. Numerical: rounding."""


def _family_wise(p: FloatArray, drawn: FloatArray) -> FloatArray:
    """Return family-wise p-values of axes, (A,), from statistics like p-values.

    Parameters
    ----------
    p : (A,)
    drawn : (A, P)
        Of draws without a gap, each draw the same for all axes.
    """
    own = np.array(
        [
            max(a, tail_p(-float(np.log(a)), -np.log(b), 1.0))
            for a, b in zip(np.minimum(p, 1.0), drawn, strict=True)
        ]
    )
    clearest = -np.log(np.min([_rank_p(-d) for d in drawn], axis=0))
    return np.array([max(a, tail_p(-float(np.log(a)), clearest, 1.0)) for a in own])


def _rank_p(drawn: FloatArray) -> FloatArray:
    """Return the share of draws that are as large as each one."""
    as_large = len(drawn) - np.searchsorted(np.sort(drawn), drawn, side="left")
    share: FloatArray = as_large / len(drawn)
    return share


def _share_p(explained: FloatArray, left: FloatArray, k: float, freedom: float) -> FloatArray:
    """Return the chance of explaining so much by accident: of Fisher's F.

    Parameters
    ----------
    explained, left
        Sums of squares, in any common unit.
    k, freedom
        Their degrees of freedom.
    """
    left_over = 1.0 - explained / np.maximum(explained + left, 1e-300)
    return np.maximum(scipy.special.betainc(0.5 * freedom, 0.5 * k, left_over), 1e-300)


def tail_p(seen: float, drawn: FloatArray, thinnest: float) -> float:
    """Return the chance of a statistic as large as that seen, by draws and their exponential tail.

    Parameters
    ----------
    seen, drawn
        Large where it is clear; the tail falls exponentially.
    thinnest
        The least mean excess over a high threshold that is believed.
    """
    as_large = drawn >= seen - _TIES * max(abs(seen), 1.0)
    counted = (1.0 + float(np.sum(as_large))) / (len(drawn) + 1.0)
    if counted > 1.5 / (len(drawn) + 1.0) or len(drawn) < 50:
        return counted
    threshold = float(np.quantile(drawn, 0.9))
    beyond = drawn[drawn > threshold]
    mean = max(float(np.mean(beyond - threshold)) if len(beyond) else 0.0, thinnest)
    share = len(beyond) / len(drawn)
    tail = share * float(np.exp(-(seen - threshold) / mean))
    return float(np.clip(tail, _SMALLEST, counted))


# ------------------------------------------------------------------------------------------------
# One axis: what is seen is held against the same with whole specimens' signs drawn.
#
# Without a gap a specimen's whitened features are as likely to lie above as below, all together,
# and no specimen knows of another. The statistic is a one-sample F over specimens: what all of them
# agree on against how they differ. Signs of few specimens are soon exhausted (three give a quarter
# at best); then features are drawn from the noise itself, its size moderated by the noise's own
# degrees of freedom. Noise is never taken to be less than declared.


_FEWEST_TO_FLIP = 11.0
"""Specimens, for signs to be drawn. Numerical: 2**10 arrangements of signs, for a thousand
draws."""

_SMALLEST_WEIGHT = 1e-2
"""Weight, of the largest, below which a specimen tells nothing of an axis. Numerical: it
tells a hundredth as much."""


def _axis_p(
    whitening: Whitening,
    basis: FloatArray,
    y: FloatArray,
    signs: FloatArray,
    rng: np.random.Generator,
) -> tuple[float, FloatArray]:
    """Return the p-value of an axis, and that of each draw.

    Parameters
    ----------
    basis : (N, k)
        Orthonormal.
    y : (N,)
        Whitened.
    signs : (P, n)
        -1 or 1.
    """
    if not basis.shape[1]:
        return 1.0, np.ones(len(signs))
    weight = whitening.summed(basis**2)
    carries = weight > _SMALLEST_WEIGHT * weight.max(axis=0)
    score = np.where(carries, whitening.summed(basis * y[:, None]), 0.0)
    root = np.sqrt(np.where(carries, weight, 1.0))
    k = basis.shape[1]
    total, extra = np.sum((score / root) ** 2), 0.0
    freedom = float(carries.sum()) - k
    # As many specimens as if all that tell weighed alike.
    units = weight.sum(axis=0) ** 2 / np.sum(weight**2, axis=0)
    if float(np.median(units)) >= _FEWEST_TO_FLIP and freedom > 0.0:
        sums = np.concatenate([score.sum(axis=0)[None], signs @ score])
    else:
        scores = np.concatenate([score[None], _drawn(whitening, basis, carries, len(signs), rng)])
        sums, total = scores.sum(axis=1), np.sum((scores / root) ** 2, axis=(1, 2))
        extra = whitening.degrees_of_freedom
    explained = np.sum(sums**2, axis=1)
    left = np.maximum(total - explained, freedom) + extra
    values = _share_p(explained, left, k, freedom + extra)
    return float(values[0]), values[1:]


def _drawn(
    whitening: Whitening,
    basis: FloatArray,
    carries: FloatArray,
    draws: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Scores of noise alone, (P, n, k), whose size is as uncertain as the noise's."""
    n, k = carries.shape
    scores = np.zeros((draws, n, k))
    for i in np.flatnonzero(carries.any(axis=1)).tolist():
        piece = basis[whitening.starts[i] : whitening.starts[i + 1]]
        scores[:, i] = rng.standard_normal((draws, len(piece))) @ piece
    freedom = whitening.degrees_of_freedom
    size = np.sqrt(freedom / rng.chisquare(freedom, draws))
    return np.where(carries, scores, 0.0) * size[:, None, None]


# ------------------------------------------------------------------------------------------------
# Outlying replicates.


_TAIL_FREEDOM = 5.0
"""Of Student's t, from which specimens are drawn. Chosen: a stray one is no rarity, and yet the
variance and the kurtosis are finite."""

_NORMAL_MAD = 0.6745
"""Median absolute deviation over the standard one. Convention: of a normal distribution."""


@dataclass(frozen=True, slots=True, eq=False)
class _OutlyingReplicates:
    """Specimens against their replicates.

    Attributes
    ----------
    largest, drawn
        How far the farthest is off, in deviations of the others, and (P,) that of draws.
    named
        Numbers of those that are farther off than 95 of 100 draws, the farthest first; at least
        that one.
    shift
        Of each named one, as a logarithm of force, against its replicates.
    """

    largest: float
    drawn: FloatArray
    named: list[int]
    shift: list[float]


def _outlying_replicates(
    whitening: Whitening,
    level: FloatArray,
    residual: FloatArray,
    test: IntArray,
    draws: int,
    rng: np.random.Generator,
) -> _OutlyingReplicates | None:
    """Return which specimens are outliers; None where no test has two specimens.

    Each specimen's level is compared with the mean of its replicates'; the scale is told by the
    median over all specimens, so that a few that are off do not hide themselves.

    Parameters
    ----------
    level : (N,)
        What a gap of one unit looks like in every force.
    test : (n,)
        Number of each specimen's replicates.
    """
    phi = whitening.noise.whiten(level)
    information = whitening.summed(phi**2)
    seen = information > 0.0
    known = np.where(seen, information, 1.0)
    height = whitening.summed(phi * whitening.noise.whiten(residual)) / known
    alike = (test[:, None] == test) & seen[:, None] & ~np.eye(len(test), dtype=bool)

    def differences(heights: FloatArray, kept: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return those from replicates' means, and the same in deviations, (..., n)."""
        others = np.where(alike & kept, 1.0, 0.0)
        count = others.sum(axis=1, keepdims=True)
        contrasts = np.where(count > 0.0, np.eye(len(test)) - others / np.maximum(count, 1.0), 0.0)
        found = heights @ contrasts.T
        return found, np.abs(found) / np.sqrt(np.maximum(contrasts**2 @ (1.0 / known), 1e-300))

    compared = (alike & seen).any(axis=1)
    if compared.sum() < 2:
        return None
    drawn = rng.standard_normal((draws, len(test)))
    drawn /= np.sqrt(known * rng.chisquare(_TAIL_FREEDOM, drawn.shape) / _TAIL_FREEDOM)
    off = differences(np.concatenate([height[None], drawn]), seen)[1][:, compared]
    scale = np.maximum(np.median(off, axis=1) / _NORMAL_MAD, 1e-9)
    farthest = off.max(axis=1) / scale
    cut = float(np.quantile(farthest[1:], 0.95))
    named: list[int] = []
    shift: list[float] = []
    left = seen.copy()
    for _ in range(max(1, len(test) // 3)):
        difference, away = differences(height, left)
        # Of two that differ from each other only, the one farther from what is predicted.
        worst = int(np.argmax(np.where(left, away, 0.0) / scale[0] + 1e-6 * np.abs(height)))
        if named and away[worst] < cut * scale[0]:
            break
        named.append(worst)
        shift.append(float(difference[worst]))
        left[worst] = False
    return _OutlyingReplicates(float(farthest[0]), farthest[1:], named, shift)


# ------------------------------------------------------------------------------------------------
# One axis along which a gap may vary, and how likely what is seen along it is without one.


@dataclass(frozen=True, slots=True, eq=False)
class _Axis:
    """One axis.

    Attributes
    ----------
    basis : (N, k)
        Orthonormal, in whitened features: what a gap along the axis may look like.
    p : float
        Of what is seen, for this axis alone; small where the gap varies along it.
    drawn_p : (P,)
        The same of each draw without a gap.
    detail
        One sentence.
    is_common
        Whether it is the gap that all specimens have in common, over strain.
    """

    name: str
    basis: FloatArray
    p: float
    drawn_p: FloatArray
    detail: str
    is_common: bool = False


# ------------------------------------------------------------------------------------------------
# How much of the excess an axis explains, and how sure that is.


_CLAIM = 3.0
"""How much of the gap in common an axis may claim, over what varies along it. Physical: the square
of the mean of a ramp from zero, over its variance; an effect in proportion to a column is such."""


@dataclass(frozen=True, slots=True, eq=False)
class _Case:
    """What every axis is made from, and what there is to explain.

    An axis may claim some of the gap that all specimens have in common: with half of them at
    33 degC, soft, and half as predicted, half of the gap is common and yet lies along temperature.
    It may claim three times what the gap varies by along it, which is what a gap has in common
    that rises evenly from none. A gap that is the same everywhere is so claimed by no axis.

    Attributes
    ----------
    signs : (P, n)
        Of whole specimens, drawn.
    y, varying : (N,)
        Whitened residuals, all and without their common part.
    common : (N, c)
        Orthonormal.
    """

    campaign: Campaign
    table: FeatureTable
    residual: FloatArray
    patterns: Mapping[str, FloatArray]
    gaps: "_Gaps"
    signs: FloatArray
    rng: np.random.Generator
    whitening: Whitening
    y: FloatArray
    varying: FloatArray
    common: FloatArray

    @property
    def least(self) -> float:
        """The least excess that shares are taken of: two deviations of pure noise."""
        return float(2.0 * np.sqrt(2.0 * len(self.y)))

    @property
    def in_common(self) -> float:
        """What all specimens have in common, beyond noise."""
        return _beyond_noise(self.common, self.y)

    def explained(self, axis: _Axis) -> float:
        """Return what an axis explains beyond noise, its claim on the common gap included."""
        if axis.is_common:
            return self.in_common
        own = _beyond_noise(axis.basis, self.varying)
        return own + min(_CLAIM * own, self.in_common)

    def share(self, axis: _Axis) -> float:
        """Return the share of the excess, 0 to 1."""
        explained = self.explained(axis)
        total = max(float(self.y @ self.y) - len(self.y), self.least)
        return explained / max(total, explained, 1e-12)

    def interval(self, axis: _Axis, weights: FloatArray) -> tuple[float, float]:
        """Return the 90 % interval of the share over draws of specimens.

        Parameters
        ----------
        weights : (B, n)
            How often each specimen was drawn.
        """
        squares = self.whitening.summed(self.y**2) - np.diff(self.whitening.starts)
        total = np.maximum(weights @ squares, self.least)
        common = self._drawn(self.common, self.y, weights)
        own = common
        if not axis.is_common:
            own = self._drawn(axis.basis, self.varying, weights)
            own = own + np.minimum(_CLAIM * own, common)
        shares = own / np.maximum(total, np.maximum(own, 1e-12))
        share = self.share(axis)
        moved = shares + share - float(np.median(shares))
        low, high = np.quantile(np.clip(moved, 0.0, 1.0), (0.05, 0.95)).tolist()
        return min(low, share), max(high, share)

    def _drawn(self, basis: FloatArray, y: FloatArray, weights: FloatArray) -> FloatArray:
        """Explained beyond noise, of draws, (B,)."""
        k = basis.shape[1]
        if not k:
            return np.zeros(len(weights))
        score = weights @ self.whitening.summed(basis * y[:, None])
        pairs = self.whitening.summed((basis[:, :, None] * basis[:, None, :]).reshape(-1, k * k))
        inner = (weights @ pairs).reshape(-1, k, k) + 1e-3 * np.eye(k)
        solved = np.linalg.solve(inner, score[:, :, None])[:, :, 0]
        # A draw has the noise of what was measured and its own.
        found: FloatArray = np.maximum(np.einsum("bk,bk->b", score, solved) - 2.0 * k, 0.0)
        return found

    def basis(self, columns: FloatArray) -> FloatArray:
        """Return what a gap along columns may look like, whitened, beside the common gap."""
        return _orthonormal(self.whitening(columns), besides=self.common)

    def flipped(self, basis: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
        """Return the p-value of an axis, and that of each draw."""
        return _axis_p(self.whitening, basis, y, self.signs, self.rng)


def _beyond_noise(basis: FloatArray, y: FloatArray, cost: float = 1.0) -> float:
    """Return the sum of squares along an orthonormal basis, less a cost a degree of freedom."""
    return float(max(np.sum((basis.T @ y) ** 2) - cost * basis.shape[1], 0.0))


# ------------------------------------------------------------------------------------------------
# The order of axes: what explains most first, then what adds to it.
#
# Only axes along which the gap varies at the 5 % level compete; the others follow by their p-value.
# The first explains most, each degree of freedom costing the logarithm of the number of specimens
# (Schwarz). The others follow by what they add to the first, and by a part of what they explain
# alone: an axis that merely goes along with the first falls behind one that does not, and before
# one that explains nothing.


_ALONE = 0.3
"""What an axis explains alone, beside what it adds to the first, in the order of axes. Chosen: so
that what merely goes along with the first ranks behind what does not, and before nothing."""


def _ranked(axes: Sequence[_Axis], p: FloatArray, case: _Case) -> tuple[list[int], list[float]]:
    """Return the order of axes, and what each adds to the first as a share of its own."""
    cost = math.log(max(len(case.whitening.starts) - 1, 2))
    alone = [max(case.explained(a) - (cost - 1.0) * a.basis.shape[1], 0.0) for a in axes]
    found = [i for i in range(len(axes)) if p[i] <= SIGNIFICANT]
    if not found:
        return sorted(range(len(axes)), key=lambda i: (p[i], -alone[i])), [1.0] * len(axes)
    first = max(found, key=lambda i: (alone[i], -p[i]))
    adds = [_added(axis, axes[first], case, cost) for axis in axes]
    adds[first] = alone[first]
    rest = sorted((i for i in found if i != first), key=lambda i: -(adds[i] + _ALONE * alone[i]))
    others = sorted((i for i in range(len(axes)) if i not in found), key=lambda i: p[i])
    parts = [a / max(own, 1e-12) if own > 0.0 else 1.0 for a, own in zip(adds, alone, strict=True)]
    return [first, *rest, *others], parts


def _added(axis: _Axis, first: _Axis, case: _Case, cost: float) -> float:
    if axis.is_common:
        return max(case.in_common - _CLAIM * _beyond_noise(first.basis, case.varying), 0.0)
    beside = axis.basis if first.is_common else _orthonormal(axis.basis, besides=first.basis)
    return _beyond_noise(beside, case.varying, cost)


# ------------------------------------------------------------------------------------------------
# What is seen along an axis, in one sentence with numbers.


_MOST_LEVELS = 6
_NAMED = 4
"""Levels of a column, from more of which thirds are told, and outlying specimens that are named.
Convention: what is shown."""

_ALIKE = 0.01
"""Difference of ln force below which levels are told as one. Convention: what is shown in whole
per cents."""

_TELLS = 0.05
"""Sensitivity below which a force tells no per cents. Numerical: it is a hundredth of the test's
largest, and would weigh 1/400."""

_STEP_REACH, _STEP_REACH_mm = 0.06, 1.0
"""How far off a step of the bar is still told as the place, of its length and at least. Convention:
one bin of a camera's places."""

_Part = tuple[BoolArray, str, int]
"""Rows, what to call them, and of how many specimens they are; 0 not to tell."""


class _Gaps:
    """Gaps as shares of force or strain, averaged as weights of what is really told by each.

    Attributes
    ----------
    log : (N,)
        Measured over predicted, as a logarithm.
    weight : (N,)
        How much a feature says: little near zero crossings.
    """

    __slots__ = ("log", "weight")

    def __init__(self, table: FeatureTable, residual: FloatArray) -> None:
        h = table.sensitivity(table.measured_raw)
        self.log = residual / np.where(np.abs(h) > _TELLS, h, 1.0)
        self.weight = np.where(np.abs(h) > _TELLS, h**2, 0.0)

    def mean(self, rows: BoolArray) -> float | None:
        """Return the mean gap over rows, a logarithm; None where nothing is told."""
        weight = self.weight[rows]
        return float(weight @ self.log[rows] / weight.sum()) if weight.sum() > 0.0 else None

    def sentence(
        self, parts: Iterable[_Part], *, ordered: bool = False, alike: str | None = None
    ) -> str:
        """Return where the gap is highest and lowest.

        Parameters
        ----------
        ordered
            Tell all parts as they come.
        alike
            What to say where they hardly differ.
        """
        means = [(self.mean(rows), name, n) for rows, name, n in parts]
        found = [(mean, name, n) for mean, name, n in means if mean is not None]
        if not found:
            return "no force to tell it by"
        logs = [mean for mean, _, _ in found]
        if alike is not None and max(logs) - min(logs) < _ALIKE:
            return f"force {_off(float(np.mean(logs)))} {alike}"
        if not ordered:
            # The one farthest from prediction first, then the one farthest from it.
            first = max(found, key=lambda f: abs(f[0]))
            second = max(found, key=lambda f: abs(f[0] - first[0]))
            found = [first, second][: len(found)]
        told = [f"{_off(mean)} {name}{_count(n)}" for mean, name, n in found]
        return "force " + ", ".join([told[0], *(t.replace(" prediction", "", 1) for t in told[1:])])


def _column_parts(
    name: str, cells: Sequence[float | str | None], force: BoolArray, of_row: IntArray
) -> Iterator[_Part]:
    """Levels of a column, or thirds of one of many numbers."""
    known = SPECIMEN_COLUMNS.get(name)
    phrase = known.at if known else f"where {name} is {{}}"
    phrase = "in {}" if name == "material" else phrase
    for label, members in _groups(name, cells):
        yield force & members[of_row], phrase.format(label), int(members.sum())


def _groups(name: str, cells: Sequence[float | str | None]) -> Iterator[tuple[str, BoolArray]]:
    level = column_levels(name, cells)
    known = sorted(set(level) - {None}, key=str)
    members = [np.array([of == k for of in level]) for k in known]
    if any(isinstance(cell, str) for cell in cells):
        yield from zip(map(str, known), members, strict=True)
        return
    value = np.array([np.nan if cell is None else float(cell) for cell in cells])
    if len(known) <= _MOST_LEVELS:
        for of_it in members:
            yield f"{float(np.mean(value[of_it])):.4g}", of_it
        return
    low, high = np.nanquantile(value, (1.0 / 3.0, 2.0 / 3.0)).tolist()
    for third in (value <= low, (value > low) & (value <= high), value > high):
        if third.any():
            ends = dict.fromkeys(f"{f(value[third]):.3g}" for f in (np.min, np.max))
            yield " to ".join(ends), third


def _strain_parts(table: FeatureTable) -> Iterator[_Part]:
    """Quarters of the forces by strain."""
    force, strain = ~table.is_field, table.strain
    edges = np.quantile(strain[force], (0.0, 0.25, 0.5, 0.75, 1.0)) if force.any() else ()
    for k, (low, high) in enumerate(itertools.pairwise(edges)):
        rows = force & (strain >= low) & ((strain < high) if k < 3 else (strain <= high))
        name = {0: f"at strains up to {high:.2g}", 3: f"at strains of {low:.2g} and more"}
        yield rows, name.get(k, f"at strains from {low:.2g} to {high:.2g}"), 0


def _branch_parts(table: FeatureTable) -> Iterator[_Part]:
    """Branches of the tests that have more than a first loading."""
    names = {"loading": "in the first loading", "unloading": "in unloading",
             "reloading": "in reloading", "hold": "in the hold"}  # fmt: skip
    cyclic = np.isin(table.specimen, table.specimen[table.branch != 0])
    for branch, name in names.items():
        yield (table.branch == BRANCHES.index(branch)) & cyclic, name, 0


def _hold_parts(table: FeatureTable) -> Iterator[_Part]:
    """Early and late in the hold."""
    hold = table.branch == BRANCHES.index("hold")
    early, late = np.quantile(table.time_s[hold], (0.25, 0.75)).tolist()
    yield hold & (table.time_s <= early), f"within {early:.2g} s of the hold", 0
    yield hold & (table.time_s >= late), f"after {late:.2g} s of it", 0


def _position_sentence(
    place: tuple[ProfileDesign, float, IntArray], palette: Palette, gaps: _Gaps
) -> str:
    """Return where along which bar the local strain is farthest off."""
    design, at_mm, rows = place
    mean = gaps.mean(np.isin(np.arange(len(gaps.log)), rows))
    off = "off" if mean is None else _off(mean)
    sentence = f"strain {off} near {at_mm:.3g} mm along bar {design.name}"
    reach = max(_STEP_REACH * design.length_mm, _STEP_REACH_mm)
    step = min(steps_of(design), key=lambda s: abs(s.x_mm - at_mm), default=None)
    if step is not None and abs(step.x_mm - at_mm) <= reach:
        grades = [
            min(palette.materials, key=lambda m: abs(m.coordinate - at)).id
            for at in (step.before, step.after)
        ]
        sentence += f", at the step from {grades[0]} to {grades[1]}"
    return sentence


def _outliers_sentence(ids: Sequence[str], shift: Sequence[float]) -> str:
    """Return which specimens differ from their replicates, and by how much."""
    listed = [
        f"{id} {_off(value, 'its replicates')}"
        for id, value in zip(ids[:_NAMED], shift, strict=False)
    ]
    more = len(ids) - len(listed)
    return "force of " + "; ".join(listed) + (f"; and {more} more" if more else "")


def _count(n: int) -> str:
    return f" ({n} specimen{'s' if n > 1 else ''})" if n else ""


def _off(log: float, what: str = "prediction") -> str:
    percent = 100.0 * float(np.expm1(np.clip(log, -7.0, 7.0)))
    if abs(percent) < 0.5:
        return "as predicted" if what == "prediction" else f"as {what}"
    if percent > 200.0:
        return f"{1.0 + percent / 100.0:.3g} times {what}"
    number = f"{abs(percent):.2g}" if abs(percent) < 10.0 else f"{abs(percent):.0f}"
    return f"{number} % {'above' if percent > 0.0 else 'below'} {what}"


# ------------------------------------------------------------------------------------------------
# Along bars: how noisy, and where strains are farthest off.


def _force_level(table: FeatureTable) -> FloatArray:
    """Return what all forces being off by one factor looks like, (N,)."""
    return np.where(table.is_field, 0.0, table.sensitivity(table.measured_raw))


def _local_level(table: FeatureTable) -> FloatArray:
    """Return what all local strains being off by one factor looks like, (N,)."""
    return np.where(table.is_field, table.sensitivity(table.measured_raw), 0.0)


def _factors_of_bars(table: FeatureTable, of_row: IntArray) -> FloatArray:
    """Return a factor on all local strains of each bar, (N, bars): no matter of position."""
    bars = np.unique(of_row[table.is_field])
    return np.where(of_row[:, None] == bars, _local_level(table)[:, None], 0.0)


def _bar_scale(table: FeatureTable, y: FloatArray, basis: FloatArray) -> float:
    """Return how much larger the noise of local strains is than declared, at least 1.

    Bars are too few for how they lie together to tell; place by place, replicates tell. Without
    replicates it is what no pattern along the bars explains.
    """
    bars: dict[tuple[int, bytes], list[FloatArray]] = {}
    for number in np.unique(table.specimen[table.is_field]).tolist():
        rows = np.flatnonzero(table.is_field & (table.specimen == number))
        key = int(table.replicates[rows[0]]), np.round(table.x_mm[rows], 3).tobytes()
        bars.setdefault(key, []).append(y[rows])
    squares, freedom = 0.0, 0
    for alike in bars.values():
        values = np.stack(alike)
        squares += float(np.sum((values - values.mean(axis=0)) ** 2))
        freedom += (len(values) - 1) * values.shape[1]
    if not freedom:
        left = (y - basis @ (basis.T @ y))[table.is_field]
        squares, freedom = float(left @ left), max(len(left) - basis.shape[1], 1)
    return max(1.0, float(np.sqrt(squares / freedom)))


def _farthest_place(
    campaign: Campaign, table: FeatureTable, y: FloatArray
) -> tuple[ProfileDesign, float, IntArray]:
    """Return the place along which bar the local strain is farthest off, and its rows.

    Parameters
    ----------
    y : (N,)
        Whitened.
    """
    best, found = -1.0, None
    for rows, design in rows_by_design(campaign, table).values():
        at, place = np.unique(np.round(table.x_mm[rows], 3), return_inverse=True)
        score = np.abs(np.bincount(place, y[rows]) / np.sqrt(np.bincount(place)))
        peak = int(np.argmax(score))
        if score[peak] > best:
            best, found = float(score[peak]), (design, float(at[peak]), rows[place == peak])
    assert found is not None
    return found


# ------------------------------------------------------------------------------------------------
# Where the gap of a campaign lies: every axis, with its share, p-value and a sentence.


_BOOTSTRAPS = 200
"""Resamples behind the interval of a share. Convention: ends of a 90 % interval are then known to
5 % of its width."""

_THINNEST = 0.1
"""Mean excess, over a high threshold, of the logarithm of how far the farthest specimen is off,
that is believed at least. Chosen: a tenth of the distance, so that a few draws that lie close
together promise no certainty."""

_FEWEST_KNOWN = 4
"""Specimens whose value of a column is known, for it to be an axis. Numerical: three have six
orders at most, of which none is rarer than 1/6."""

_ADDS_LITTLE = 0.25
"""Share of what an axis explains that is left beside the first, below which that is said. Chosen:
three quarters of it are the first's then."""


def localise(
    campaign: Campaign,
    table: FeatureTable,
    residual: FloatArray,
    whitening: Whitening,
    rng: np.random.Generator,
    *,
    permutations: int = 999,
) -> tuple[Location, ...]:
    """Return along which axes the gap varies, the one to look at first in front.

    Axes are the material, every column that varies, the strain (what all specimens have in
    common), branch and time of a hold, the place along bars, and specimens against their
    replicates. A share is of the excess over noise that the axis explains alone, so that shares of
    axes which go together add up to more than 1. P-values are family-wise over all axes.

    Parameters
    ----------
    residual : (N,)
        Measured minus predicted, on the table's transformed scale.
    whitening
        Of what the residual would be like if nothing were hidden.
    permutations
        Draws without a gap.

    Returns
    -------
    places
        Nothing for a single specimen: there is nothing to compare it with.
    """
    count = len(campaign.specimens)
    if count < 2:
        return ()
    y = whitening(residual)
    patterns = axis_patterns(campaign, table, table.sensitivity(table.measured_raw))
    shapes = np.column_stack([_force_level(table), patterns["strain"], _local_level(table)])
    common = _orthonormal(whitening(shapes))
    varying = y - common @ (common.T @ y)
    signs: FloatArray = np.where(rng.random((permutations, count)) < 0.5, -1.0, 1.0)
    gaps = _Gaps(table, residual)
    case = _Case(
        campaign, table, residual, patterns, gaps, signs, rng, whitening, y, varying, common
    )
    axes = [*_column_axes(case), *_within_axes(case), *_position_axes(case), *_outlying_axes(case)]
    p = _family_wise(
        np.array([a.p for a in axes]),
        np.stack([a.drawn_p for a in axes]),
    )
    order, adds = _ranked(axes, p, case)
    weights = rng.multinomial(count, np.full(count, 1.0 / count), _BOOTSTRAPS).astype(np.float64)
    places = []
    for i in order:
        sentence = axes[i].detail
        if i != order[0] and p[i] <= SIGNIFICANT and adds[i] < _ADDS_LITTLE:
            sentence += f"; little of it beyond what goes with {axes[order[0]].name}"
        share, interval = case.share(axes[i]), case.interval(axes[i], weights)
        places.append(Location(axes[i].name, share, interval, float(p[i]), sentence))
    return tuple(places)


def _column_axes(case: _Case) -> Iterator[_Axis]:
    """Material and the columns of specimens.csv."""
    cells = axis_cells(case.campaign)
    for name in (name for name in cells if name in case.patterns):
        basis = case.basis(case.patterns[name])
        known = sum(cell is not None for cell in cells[name])
        if known >= _FEWEST_KNOWN and basis.shape[1]:
            parts = _column_parts(name, cells[name], ~case.table.is_field, case.whitening.of_row)
            sentence = case.gaps.sentence(parts)
            yield _Axis(name, basis, *case.flipped(basis, case.varying), sentence)


def _within_axes(case: _Case) -> Iterator[_Axis]:
    """Strain, branch and time of a hold: signs of whole specimens are drawn."""
    table, gaps = case.table, case.gaps
    sentence = gaps.sentence(_strain_parts(table), alike="alike at all strains")
    p, drawn = case.flipped(case.common, case.y)
    yield _Axis("strain", case.common, p, drawn, sentence, is_common=True)
    for name, parts in (("branch", _branch_parts), ("time", _hold_parts)):
        if name in case.patterns and (basis := case.basis(case.patterns[name])).shape[1]:
            sentence = gaps.sentence(parts(table), ordered=name == "time")
            yield _Axis(name, basis, *case.flipped(basis, case.varying), sentence)


def _position_axes(case: _Case) -> Iterator[_Axis]:
    """Places along bars: a smooth pattern, and steps between materials."""
    table, whitening = case.table, case.whitening
    if "position" not in case.patterns:
        return
    bars = whitening(_factors_of_bars(table, whitening.of_row))
    besides = _orthonormal(np.concatenate([case.common, bars], axis=1))
    columns = whitening(case.patterns["position"])
    basis = _orthonormal(columns, besides=besides)
    if not basis.shape[1]:
        return
    y = case.y - besides @ (besides.T @ case.y)
    y = y / _bar_scale(table, y, basis)
    place = _farthest_place(case.campaign, table, y)
    sentence = _position_sentence(place, case.campaign.palette, case.gaps)
    yield _Axis("position", basis, *case.flipped(basis, y), sentence)


def _outlying_axes(case: _Case) -> Iterator[_Axis]:
    """Specimens against their replicates: noise with stray specimens is drawn."""
    whitening = case.whitening
    level = _force_level(case.table)
    alike = case.table.replicates[whitening.starts[:-1]]
    found = _outlying_replicates(whitening, level, case.residual, alike, len(case.signs), case.rng)
    if found is None:
        return
    basis = case.basis(np.where(whitening.of_row[:, None] == found.named, level[:, None], 0.0))
    ids = [case.campaign.specimens[i].id for i in found.named]
    p = tail_p(float(np.log(max(found.largest, 1e-9))), np.log(found.drawn), _THINNEST)
    sentence = _outliers_sentence(ids, found.shift)
    yield _Axis("specimen", basis, p, _rank_p(found.drawn), sentence)
