"""Axes within specimens: what is seen is held against the same with specimens' signs drawn.

Without a gap a specimen's whitened figures are as likely to lie above as below, all together, and
no specimen knows of another. The figure compared is a one-sample F over specimens: what all of
them agree on against how they differ. Signs of few specimens are soon exhausted (three give a
quarter at best); then the figures are drawn from the noise itself, its size moderated by the
noise's own degrees of freedom. Noise is never taken to be less than declared.
"""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.where.axis import share_p
from planner.gap.where.whitening import Whitening

__all__ = ["within_p"]

FEWEST_TO_FLIP = 11.0
"""2**10 arrangements of signs."""

_SMALLEST_WEIGHT = 1e-2


def within_p(
    whitening: Whitening,
    basis: FloatArray,
    y: FloatArray,
    signs: FloatArray,
    freedom: float,
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
    freedom
        Of the noise.
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
        values = share_p(explained, left, k, total_freedom - k)
        return float(values[0]), values[1:]
    drawn = _drawn(whitening, basis, carries, len(signs), freedom, rng)
    scores = np.concatenate([score[None], drawn])
    explained = np.sum(scores.sum(axis=1) ** 2, axis=1)
    total_of = np.sum((scores / root) ** 2, axis=(1, 2))
    left = np.maximum(total_of - explained, total_freedom - k) + freedom
    values = share_p(explained, left, k, total_freedom - k + freedom)
    return float(values[0]), values[1:]


def _drawn(
    whitening: Whitening,
    basis: FloatArray,
    carries: FloatArray,
    draws: int,
    freedom: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Scores of noise alone, (P, n, k), whose size is as uncertain as the noise's."""
    n, k = carries.shape
    scores = np.zeros((draws, n, k))
    for i in np.flatnonzero(carries.any(axis=1)).tolist():
        piece = basis[whitening.starts[i] : whitening.starts[i + 1]]
        scores[:, i] = rng.standard_normal((draws, len(piece))) @ piece
    size = np.sqrt(freedom / rng.chisquare(freedom, draws))
    return np.where(carries, scores, 0.0) * size[:, None, None]
