"""Permutation tests of where a gap lies, on whitened residuals, with their family-wise error."""

from dataclasses import dataclass

import numpy as np
import scipy.special

from planner.gap.noise import SpecimenNoise
from planner.numerics import BoolArray, FloatArray, IntArray

__all__ = [
    "Whitening",
    "axis_p",
    "family_wise",
    "orthonormal",
    "outlying_replicates",
    "rank_p",
    "tail_p",
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


def family_wise(p: FloatArray, drawn: FloatArray) -> FloatArray:
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


def axis_p(
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
    total_freedom = float(carries.sum())
    # As many specimens as if all that tell weighed alike.
    units = weight.sum(axis=0) ** 2 / np.sum(weight**2, axis=0)
    if float(np.median(units)) >= _FEWEST_TO_FLIP and total_freedom > k:
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
    return OutlyingReplicates(float(farthest[0]), farthest[1:], named, shift)
