"""Specimens that stand apart from their replicates."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.gap.where.whitening import Whitening

__all__ = ["Apart", "specimens_apart"]

TAIL_FREEDOM = 5.0
"""Specimens are drawn from Student's t: a stray one is no rarity."""

_NORMAL_MAD = 0.6745


@dataclass(frozen=True, slots=True, eq=False)
class Apart:
    """Specimens against their replicates.

    Attributes
    ----------
    figure
        How far the farthest is off, in deviations of the others, and (P,) that of draws.
    named
        Numbers of those that are farther off than 95 of 100 draws, the farthest first; at least
        that one.
    shift
        Of each named one, as a logarithm of force, against its replicates.
    """

    figure: float
    drawn: FloatArray
    named: tuple[int, ...]
    shift: tuple[float, ...]


def specimens_apart(
    whitening: Whitening,
    level: FloatArray,
    residual: FloatArray,
    test: IntArray,
    draws: int,
    rng: np.random.Generator,
) -> Apart | None:
    """Return which specimens stand apart; None where no test has two specimens.

    Each specimen's level is compared with the mean of its replicates'; the scale is told by the
    median over all specimens, so that a few that are off do not hide themselves.

    Parameters
    ----------
    level : (N,)
        What a gap of one unit looks like in every force.
    test : (n,)
        Of each specimen.
    """
    phi = whitening.of_specimens(level)
    information = whitening.summed(phi**2)
    seen = information > 0.0
    scale = np.where(seen, information, 1.0)
    shared = whitening.directions * np.sqrt(1.0 / (1.0 - whitening.shrink) ** 2 - 1.0)
    height = whitening.summed(phi * whitening.of_specimens(residual)) / scale
    tied = whitening.summed(phi[:, None] * shared) / scale[:, None]
    contrasts = _contrasts(test, seen)
    compared = np.abs(contrasts).sum(axis=1) > 0.0
    if compared.sum() < 2:
        return None
    sd = np.where(seen, 1.0 / np.sqrt(scale), 0.0)
    own = rng.standard_normal((draws, len(test)))
    own /= np.sqrt(rng.chisquare(TAIL_FREEDOM, own.shape) / TAIL_FREEDOM)
    drawn = own * sd + rng.standard_normal((draws, tied.shape[1])) @ tied.T
    deviation = _deviation(contrasts, sd, tied)
    figures = _standing(drawn, contrasts, deviation, compared)[1].max(axis=1)
    scale_of, standing = _standing(height[None], contrasts, deviation, compared)
    cut = float(np.quantile(figures, 0.95))
    named, shift = _named(height, test, seen, sd, tied, float(scale_of[0]), cut)
    return Apart(float(standing.max()), figures, named, shift)


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


def _named(
    height: FloatArray,
    test: IntArray,
    seen: BoolArray,
    sd: FloatArray,
    tied: FloatArray,
    scale: float,
    cut: float,
) -> tuple[tuple[int, ...], tuple[float, ...]]:
    named: list[int] = []
    shift: list[float] = []
    left = seen.copy()
    for _ in range(max(1, len(test) // 3)):
        contrasts = _contrasts(test, left)
        difference = contrasts @ height
        off = np.abs(difference) / _deviation(contrasts, sd, tied) / scale
        # Of two that differ from each other only, the one farther from what is predicted.
        worst = int(np.argmax(off + 1e-6 * np.abs(height)))
        if named and off[worst] < cut:
            break
        named.append(worst)
        shift.append(float(difference[worst]))
        left[worst] = False
    return tuple(named), tuple(shift)
