"""How visible a hidden effect is: its excess over the standard error of what it changes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.base_law import BaseLaw
from benchmarks.withheld.reality.bench import Bench
from benchmarks.withheld.reality.noise import Scatter, wander_correlation

__all__ = ["Yardstick", "level_excess", "relative_excess"]

FloatArray = NDArray[np.float64]

ROWS_LOOKED_AT = np.arange(10, 121, 10)
_LEAST_SHARE_OF_PEAK = 0.1


def relative_excess(with_effect_N: FloatArray, without_N: FloatArray) -> FloatArray:
    """Return the change of force over the force, at a dozen rows of each curve."""
    peak = np.abs(without_N).max(axis=1, keepdims=True)
    scale = np.maximum(np.abs(without_N), _LEAST_SHARE_OF_PEAK * peak)
    return np.asarray(((with_effect_N - without_N) / scale)[:, ROWS_LOOKED_AT])


def level_excess(excess: FloatArray) -> FloatArray:
    """Return each specimen's root mean square excess, with the sign of its mean."""
    return np.asarray(np.sign(excess.mean(axis=1)) * np.sqrt(np.mean(excess**2, axis=1)))


@dataclass(frozen=True)
class Yardstick:
    """The covariance that a campaign's specimens have when nothing is hidden.

    Attributes
    ----------
    level
        Of whole curves, (S, S): scatter of specimens, batches and the palette's calibration.
    shared
        Its part that specimens share, (S, S).
    """

    scatter: Scatter
    level: FloatArray
    shared: FloatArray
    tilt: FloatArray
    force_N: FloatArray
    travel: FloatArray

    @classmethod
    def of(cls, benches: tuple[Bench, ...], scatter: Scatter, force_N: FloatArray) -> "Yardstick":
        """Make the yardstick of a campaign whose ideal forces are `force_N`, (S, T)."""
        order = np.concatenate([b.design.number for b in benches]).argsort()
        batch = np.concatenate([b.design.batch for b in benches])[order]
        grades = np.concatenate([_grade_shares(b) for b in benches])[order]
        travel = np.concatenate([b.motion.displacement_mm for b in benches])[order]
        alike = grades @ grades.T
        shared = scatter.calibration**2 * alike
        shared += scatter.batch**2 * (batch[:, None] == batch)
        alone = scatter.specimen**2 + scatter.slope**2 / 12.0 + 0.5 * scatter.wander**2
        travel = travel / travel.max(axis=1, keepdims=True)
        level = shared + alone * np.eye(len(shared))
        return cls(scatter, level, shared, scatter.tilt**2 * alike, force_N, travel)

    def snr(self, level: FloatArray) -> float:
        """Return the excess RMS over the standard error of the contrast that it makes.

        With a the specimens' excess and V their covariance, the generalised least-squares
        amplitude of the pattern a has the standard error rms(a) / sqrt(a' V^-1 a).
        """
        return float(np.sqrt(level @ np.linalg.solve(self.level, level)))

    def detectability(self, excess: FloatArray) -> float:
        """Return the same with the course along each curve: a matched filter's upper bound."""
        scatter, points = self.scatter, len(ROWS_LOOKED_AT)
        course = np.tanh((0.34 * self.travel[:, ROWS_LOOKED_AT] - 0.15) / 0.2)
        covariance = np.kron(self.shared, np.ones((points, points)))
        covariance += np.kron(self.tilt, np.ones((points, points))) * np.outer(course, course)
        within = scatter.specimen**2 + scatter.wander**2 * wander_correlation(
            ROWS_LOOKED_AT, scatter
        )
        covariance += np.kron(np.eye(len(self.level)), within)
        slope = (self.travel[:, ROWS_LOOKED_AT] - 0.5) * scatter.slope
        for specimen, part in enumerate(slope):
            block = slice(specimen * points, (specimen + 1) * points)
            covariance[block, block] += np.outer(part, part)
        peak = np.abs(self.force_N).max(axis=1, keepdims=True)
        scale = np.maximum(np.abs(self.force_N[:, ROWS_LOOKED_AT]), _LEAST_SHARE_OF_PEAK * peak)
        white = (scatter.white_N(self.force_N) / scale) ** 2
        covariance += np.diag(white.ravel())
        flat = excess.ravel()
        return float(np.sqrt(flat @ np.linalg.solve(covariance, flat)))


def _grade_shares(bench: Bench) -> FloatArray:
    """Return how much of each specimen's length is of each grade, (S, grades)."""
    law: BaseLaw = bench.law
    at = law.coordinates
    hats = np.array([np.interp(bench.coordinate, at, np.eye(len(at))[k]) for k in range(len(at))])
    length = bench.element_mm / bench.element_mm.sum(axis=1, keepdims=True)
    shares: FloatArray = np.einsum("gsn,sn->sg", hats, length)
    return shares
