"""Permutation tests of where a gap lies, on whitened residuals, with their family-wise error."""

import math
from dataclasses import dataclass

import numpy as np
import scipy.special

from planner.gap.noise import SpecimenNoise
from planner.numerics import BoolArray, FloatArray, IntArray

__all__ = [
    "FEWEST_TO_FLIP",
    "Column",
    "SpecimenScores",
    "Whitening",
    "family_wise",
    "least_permutation_p",
    "orthonormal",
    "outlying_replicates",
    "permuted",
    "rank_p",
    "tail_p",
    "varies_within",
    "within_p",
]


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
    starts : (n + 1,)
        Rows of specimen i are ``starts[i]`` to ``starts[i + 1]``.
    directions, shrink : (N, q), (q,)
        What specimens share, orthonormal, and how much of it is taken off.
    degrees_of_freedom
        Of a scaled chi-square variance that is as uncertain as the noise.
    """

    noise: SpecimenNoise
    starts: IntArray
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
        return cls(noise, noise.first_row, directions, shrink, 0.5 / max(log_sd, 1e-3) ** 2)

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


def orthonormal(columns: FloatArray, besides: FloatArray | None = None) -> FloatArray:
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
# Cells of a column permuted among specimens.
#
# Whole specimens are permuted, never single features. Without a gap all of them are alike but for
# noise, replicates too, so any of them may trade places. In a column that varies within batches
# they trade places within a batch only, provided that leaves enough arrangements, so that batches
# cannot pass for the column.


_ENOUGH = 2000.0
"""Arrangements within batches, that those alone are drawn. Numerical: twice the thousand draws, so
that few of them repeat."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column that takes more than one value.

    Attributes
    ----------
    values
        Of each specimen with features; None where unknown.
    level : (n,)
        Number of each specimen's level, -1 where unknown.
    coordinates : (n, m)
        Orthonormal and of mean zero over the specimens that are known, zero at the others:
        numbers as polynomials on the column's usual scale, text as levels.
    """

    name: str
    values: tuple[str | float | None, ...]
    level: IntArray
    coordinates: FloatArray

    @property
    def known(self) -> BoolArray:
        """Which specimens' values are known."""
        return np.asarray(self.level >= 0)

    @property
    def is_number(self) -> bool:
        """Whether its values are numbers."""
        return not any(isinstance(v, str) for v in self.values)


def varies_within(column: Column, batch: IntArray) -> bool:
    """Return whether a column varies enough within batches to be permuted within them."""
    return _log_arrangements(column, batch) > math.log(_ENOUGH)


def least_permutation_p(column: Column, batch: IntArray | None) -> float:
    """Return the chance of drawing the very cells that are seen, or the like of them.

    Levels of as many specimens may change names; of numbers both ends may.
    """
    alone = np.zeros(len(column.level), dtype=np.intp)
    log = _log_arrangements(column, alone if batch is None else batch)
    sizes = np.bincount(column.level[column.known])
    sizes = sizes[sizes > 0]
    if column.coordinates.shape[1] == len(sizes) - 1:
        log -= sum(math.lgamma(c + 1) for c in np.bincount(sizes).tolist())
    else:
        log -= math.log(2.0)
    return min(1.0, math.exp(-log))


def permuted(keys: FloatArray, column: Column, batch: IntArray | None) -> IntArray:
    """Return whose cell each known specimen has in each draw, (P, n known).

    Parameters
    ----------
    keys : (P, n)
        Uniform on 0 to 1.
    batch
        Number of each specimen's batch, to permute within batches only.
    """
    drawn = keys[:, column.known]
    if batch is None:
        return np.argsort(drawn, axis=1)
    number = batch[column.known]
    places = np.empty(drawn.shape, dtype=np.intp)
    places[:, np.argsort(number, kind="stable")] = np.argsort(drawn + 2.0 * number, axis=1)
    return places


def _log_arrangements(column: Column, batch: IntArray) -> float:
    log = 0.0
    for number in np.unique(batch[column.known]):
        level = column.level[column.known & (batch == number)]
        log += math.lgamma(len(level) + 1)
        log -= sum(math.lgamma(c + 1) for c in np.bincount(level).tolist())
    return log


# ------------------------------------------------------------------------------------------------
# P-values over a family of axes: how often the clearest of all is as clear without a gap.
#
# Westfall and Young's single-step minimum of p-values. The statistic of each axis is brought to one
# scale by its own draws first, so that none dominates; the draws then say how often the smallest of
# all is as small, whatever the axes have in common. An axis is never clearer than its own statistic
# says, which is exact for normal noise even where draws trade what is not quite alike.
#
# What draws cannot resolve follows from the tail of its logarithm, which is exponential (a
# generalised Pareto tail of shape 0, fitted to the clearest tenth of draws, never thinner than that
# of a true p-value).


_SMALLEST = 1e-12
"""Of a p-value. Convention: a tail fitted to a thousand draws says nothing about less."""

_TIES = 1e-9
"""Relative difference below which a draw is as large as what is seen. Numerical: rounding."""


def family_wise(p: FloatArray, drawn: FloatArray, least: FloatArray) -> FloatArray:
    """Return family-wise p-values of axes, (A,), from statistics like p-values.

    Parameters
    ----------
    p : (A,)
    drawn : (A, P)
        Of draws without a gap, each draw the same for all axes.
    least : (A,)
        The chance of a draw that shows the very same, which `drawn` is without.
    """
    own = np.array(
        [
            min(1.0, c + max(a, tail_p(-float(np.log(a)), -np.log(b), 1.0)))
            for a, b, c in zip(np.minimum(p, 1.0), drawn, least, strict=True)
        ]
    )
    clearest = -np.log(np.min([rank_p(-d) for d in drawn], axis=0))
    return np.array([max(a, tail_p(-float(np.log(a)), clearest, 1.0)) for a in own])


def rank_p(drawn: FloatArray) -> FloatArray:
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
# Axes between specimens: what is seen is held against the same with the column's cells permuted.
#
# Each specimen is reduced to its scores along level, slope and bend of its curve; all that an axis
# explains is a quadratic form of these. So a draw costs a few small matrices, not N features.


_RIDGE = 1e-7
_SAME = 1e-6
_WHOLE = 1e-6
"""Share below which a direction is none, two draws are the same, or nothing is left of a score.
Numerical: above rounding, below anything that shows."""


@dataclass(frozen=True, slots=True, eq=False)
class SpecimenScores:
    """Scores of n specimens along s shapes.

    Attributes
    ----------
    own : (n, s, s)
        Information of each specimen's own features.
    tied : (n, s, r)
        What is lost of it to what specimens share and to the common gap: the information of
        specimens i and j together is ``own_i (i = j) - tied_i tied_j'``.
    score : (n, s)
    """

    own: FloatArray
    tied: FloatArray
    score: FloatArray

    @classmethod
    def of(
        cls, whitening: Whitening, shapes: FloatArray, common: FloatArray, y: FloatArray
    ) -> "SpecimenScores":
        """Return the scores of whitened features from which the common gap has been taken.

        Parameters
        ----------
        shapes : (N, s)
            Not whitened.
        common : (N, c)
            Orthonormal, whitened.
        y : (N,)
            Whitened, without its part along `common`.
        """
        phi = whitening.noise.whiten(shapes)
        own = whitening.summed(phi[:, :, None] * phi[:, None, :])
        shrink = whitening.shrink
        # (I - Q a Q')^2 = I - Q (2 a - a^2) Q'.
        roots = np.sqrt(2.0 * shrink - shrink**2)
        shared = whitening.directions * roots
        columns = np.concatenate([shared, whitening.of_all(common)], axis=1)
        tied = whitening.summed(phi[:, :, None] * columns[:, None, :])
        score = whitening.summed(phi * whitening.of_all(y)[:, None])
        return cls(own, tied, score)

    def explained(self, coordinates: FloatArray) -> tuple[FloatArray, int]:
        """Return what axes explain, (P,), and the degrees of freedom of the first.

        Parameters
        ----------
        coordinates : (P, n, m)
            Of each specimen along each axis.
        """
        draws, n, m = coordinates.shape
        s = self.score.shape[1]
        turned = np.ascontiguousarray(np.swapaxes(coordinates, 1, 2))
        b = (turned @ self.score).reshape(draws, m * s)
        pairs = (turned[:, :, None, :] * turned[:, None, :, :]).reshape(draws, m * m, n)
        own = (pairs @ self.own.reshape(n, s * s)).reshape(draws, m, m, s, s)
        inner = own.transpose(0, 1, 3, 2, 4).reshape(draws, m * s, m * s)
        tied = (turned @ self.tied.reshape(n, -1)).reshape(draws, m * s, -1)
        inner = inner - tied @ np.swapaxes(tied, 1, 2)
        # One unit a column, from what a column has without the ties.
        unit = np.sqrt(np.einsum("pmmss->pms", own).reshape(draws, m * s))
        unit = np.maximum(unit, 1e-12 * max(float(unit.max()), 1e-150))
        inner = inner / (unit[:, :, None] * unit[:, None, :])
        b = b / unit
        rank = int(np.sum(np.linalg.eigvalsh(inner[0]) > 1e-4))
        inner += _RIDGE * np.eye(m * s)
        solved = np.linalg.solve(inner, b[:, :, None])[:, :, 0]
        return np.maximum(np.einsum("pk,pk->p", b, solved), 0.0), rank

    def total(self, known: IntArray) -> tuple[float, int]:
        """Return all that there is between specimens, and its degrees of freedom.

        By Woodbury's identity: the ties are few.
        """
        s = self.score.shape[1]
        values, vectors = np.linalg.eigh(self.own[known])
        kept = values > _RIDGE * np.maximum(values[:, -1:], 1e-150)
        roots = np.where(kept, 1.0 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
        roots_of = vectors * roots[:, None, :]
        score = np.einsum("isk,is->ik", roots_of, self.score[known]).reshape(-1)
        tied = np.einsum("isk,isr->ikr", roots_of, self.tied[known]).reshape(len(known) * s, -1)
        lost, along = np.linalg.eigh(tied.T @ tied)
        # Of what the common gap takes whole, nothing is left in the scores either.
        free = lost < 1.0 - _WHOLE
        projected = along.T @ (tied.T @ score)
        total = score @ score + np.sum(projected[free] ** 2 / (1.0 - lost[free]))
        return float(total), int(kept.sum()) - int(np.sum(~free))

    def p(self, column: Column, places: IntArray) -> tuple[float, FloatArray]:
        """Return the p-value of a column, and that of each draw.

        Noise is taken to be what specimens differ by beside the column, and no less than declared.
        Draws that came upon the seen arrangement are replaced by others: how likely it is is known.

        Parameters
        ----------
        places : (P, n known)
            Whose cell each known specimen has, counted among the known.
        """
        known = np.flatnonzero(column.known)
        total, freedom = self.total(known)
        cells = column.coordinates[known]
        coordinates = np.zeros((len(places) + 1, len(column.level), cells.shape[1]))
        coordinates[0, known] = cells
        coordinates[1:, known] = cells[places]
        explained, k = self.explained(coordinates)
        if k == 0 or freedom <= k:
            return 1.0, np.ones(len(places))
        left = np.maximum(total - explained, float(freedom - k))
        values = _share_p(explained, left, k, freedom - k)
        same = np.abs(explained[1:] - explained[0]) <= _SAME * explained[0]
        drawn = values[1:]
        if same.any() and not same.all():
            drawn[same] = np.resize(drawn[~same], int(same.sum()))
        return float(values[0]), drawn


# ------------------------------------------------------------------------------------------------
# Axes within specimens: what is seen is held against the same with specimens' signs drawn.
#
# Without a gap a specimen's whitened features are as likely to lie above as below, all together,
# and no specimen knows of another. The statistic is a one-sample F over specimens: what all of them
# agree on against how they differ. Signs of few specimens are soon exhausted (three give a quarter
# at best); then features are drawn from the noise itself, its size moderated by the noise's own
# degrees of freedom. Noise is never taken to be less than declared.


FEWEST_TO_FLIP = 11.0
"""Specimens, for signs to be drawn. Numerical: 2**10 arrangements of signs, for a thousand
draws."""

_SMALLEST_WEIGHT = 1e-2
"""Weight, of the largest, below which a specimen tells nothing of an axis. Numerical: it
tells a hundredth as much."""


def within_p(
    whitening: Whitening,
    basis: FloatArray,
    y: FloatArray,
    signs: FloatArray,
    rng: np.random.Generator,
) -> tuple[float, FloatArray]:
    """Return the p-value of an axis within specimens, and that of each draw.

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
    total_freedom = float(carries.sum())
    # As many specimens as if all that tell weighed alike.
    units = weight.sum(axis=0) ** 2 / np.sum(weight**2, axis=0)
    if float(np.median(units)) >= FEWEST_TO_FLIP and total_freedom > k:
        total = float(np.sum((score / root) ** 2))
        explained = np.sum(np.concatenate([score.sum(axis=0)[None], signs @ score]) ** 2, axis=1)
        left = np.maximum(total - explained, total_freedom - k)
        values = _share_p(explained, left, k, total_freedom - k)
        return float(values[0]), values[1:]
    drawn = _drawn(whitening, basis, carries, len(signs), rng)
    freedom = whitening.degrees_of_freedom
    scores = np.concatenate([score[None], drawn])
    explained = np.sum(scores.sum(axis=1) ** 2, axis=1)
    total_of = np.sum((scores / root) ** 2, axis=(1, 2))
    left = np.maximum(total_of - explained, total_freedom - k) + freedom
    values = _share_p(explained, left, k, total_freedom - k + freedom)
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
class OutlyingReplicates:
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


def outlying_replicates(
    whitening: Whitening,
    level: FloatArray,
    residual: FloatArray,
    test: IntArray,
    draws: int,
    rng: np.random.Generator,
) -> OutlyingReplicates | None:
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
    scale = np.where(seen, information, 1.0)
    shared = whitening.directions * np.sqrt(1.0 / (1.0 - whitening.shrink) ** 2 - 1.0)
    height = whitening.summed(phi * whitening.noise.whiten(residual)) / scale
    tied = whitening.summed(phi[:, None] * shared) / scale[:, None]
    contrasts = _contrasts(test, seen)
    compared = np.abs(contrasts).sum(axis=1) > 0.0
    if compared.sum() < 2:
        return None
    sd = np.where(seen, 1.0 / np.sqrt(scale), 0.0)
    own = rng.standard_normal((draws, len(test)))
    own /= np.sqrt(rng.chisquare(_TAIL_FREEDOM, own.shape) / _TAIL_FREEDOM)
    drawn = own * sd + rng.standard_normal((draws, tied.shape[1])) @ tied.T
    deviation = _deviation(contrasts, sd, tied)
    farthest = _standing(drawn, contrasts, deviation, compared)[1].max(axis=1)
    scale_of, standing = _standing(height[None], contrasts, deviation, compared)
    cut = float(np.quantile(farthest, 0.95))
    named: list[int] = []
    shift: list[float] = []
    left = seen.copy()
    for _ in range(max(1, len(test) // 3)):
        contrasts = _contrasts(test, left)
        difference = contrasts @ height
        off = np.abs(difference) / _deviation(contrasts, sd, tied) / float(scale_of[0])
        # Of two that differ from each other only, the one farther from what is predicted.
        worst = int(np.argmax(off + 1e-6 * np.abs(height)))
        if named and off[worst] < cut:
            break
        named.append(worst)
        shift.append(float(difference[worst]))
        left[worst] = False
    return OutlyingReplicates(float(standing.max()), farthest, named, shift)


def _contrasts(test: IntArray, seen: BoolArray) -> FloatArray:
    """Of each specimen against the mean of its replicates, (n, n); zero without any."""
    alike = (test[:, None] == test) & seen & seen[:, None]
    others = np.where(alike & ~np.eye(len(test), dtype=bool), 1.0, 0.0)
    count = others.sum(axis=1)
    rows: FloatArray = -others / np.maximum(count, 1.0)[:, None]
    rows[np.diag_indices(len(test))] = count > 0
    return rows


def _deviation(contrasts: FloatArray, sd: FloatArray, tied: FloatArray) -> FloatArray:
    variance = (contrasts**2) @ sd**2 + np.sum((contrasts @ tied) ** 2, axis=1)
    deviation: FloatArray = np.sqrt(np.maximum(variance, 1e-300))
    return deviation


def _standing(
    height: FloatArray, contrasts: FloatArray, deviation: FloatArray, compared: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Scale of draws, (P,), and how far each compared specimen is off, (P, n)."""
    off = np.abs(height @ contrasts.T / deviation)[:, compared]
    scale = np.maximum(np.median(off, axis=1) / _NORMAL_MAD, 1e-9)
    return scale, off / scale[:, None]
