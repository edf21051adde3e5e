"""What differs between specimens that should be equal, and what the machine adds.

None of it knows the truth: the same design and seed give the same noise whatever is hidden.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.design import Design

__all__ = ["CAREFUL", "Handling", "Scatter", "measured_force", "wander_correlation"]

FloatArray = NDArray[np.float64]

_T4_TO_NORMAL = 0.6745 / 0.7407
"""With this scale the middle half of Student's t4 is as wide as the normal's."""


@dataclass(frozen=True)
class Scatter:
    """Standard deviations, relative to the force unless named otherwise.

    Attributes
    ----------
    specimen, batch
        Of the level of a whole curve.
    slope
        Of the change of that level from the start of a curve to its largest travel.
    wander, wander_rows
        Of what comes and goes along a curve, and the rows over which it lasts.
    smooth
        Whether it wanders smoothly, or as a first-order process.
    calibration, tilt
        Of each grade's true law about the palette's: its level, and its course.
    sensor_N, quantum_N
        White noise and resolution of the load cell.
    sensor_share
        White noise besides, over each specimen's largest force.
    freedom
        Degrees of freedom of the specimens' and sensors' distribution; 0 is the normal's.
    """

    specimen: float
    batch: float
    slope: float
    wander: float
    wander_rows: float
    smooth: bool
    calibration: float
    tilt: float
    sensor_N: float
    quantum_N: float
    freedom: int = 0
    sensor_share: float = 0.0

    def white_N(self, force_N: FloatArray) -> FloatArray:
        """Return the standard deviation of each specimen's white noise, rounding too, (S, 1)."""
        return np.hypot(self.cell_N(force_N), self.quantum_N / np.sqrt(12.0))

    def cell_N(self, force_N: FloatArray) -> FloatArray:
        """Return the standard deviation of the load cell's own, (S, 1)."""
        share_N = self.sensor_share * np.abs(force_N).max(axis=1, keepdims=True)
        return np.asarray(np.hypot(self.sensor_N, share_N))


@dataclass(frozen=True)
class Handling:
    """How specimens are clamped, and how their travel is written down.

    Attributes
    ----------
    toe
        Standard deviation of where pulls begin, over the farthest travel: some specimens hang
        loosely, some are taut; taken up bit by bit.
    percent
        Specimens whose strain in per cent of the gauge length is written as mm of travel.
    """

    toe: float = 0.0
    percent: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.toe <= 0.1 or self.percent < 0:
            raise ValueError("pulls begin within 0 to 0.1 of their travel, of 0 specimens or more")

    def written_mm(
        self, travel_mm: FloatArray, gauge_mm: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Return travel as it is written down, (S, T), of the crosshead's."""
        toe_mm = self.toe * travel_mm.max(axis=1, keepdims=True)
        own = rng.normal(size=toe_mm.shape).clip(-2.0, 2.0) * toe_mm
        written = travel_mm - own * np.expm1(-travel_mm / np.maximum(4.0 * toe_mm, 1e-9))
        some = rng.permutation(len(gauge_mm))[: self.percent]
        written[some] *= 100.0 / gauge_mm[some, None]
        return np.asarray(written)


CAREFUL = Handling()


def measured_force(
    force_N: FloatArray,
    level_travel: FloatArray,
    design: Design,
    scatter: Scatter,
    rng: np.random.Generator,
) -> FloatArray:
    """Return what the machine writes down, of what the ideal specimens would have shown.

    Parameters
    ----------
    force_N
        Shape (S, T).
    level_travel
        Travel over its largest value, of the same shape.
    """
    specimens, rows = force_N.shape
    batches, batch = np.unique(design.batch, return_inverse=True)
    level = scatter.specimen * _drawn((specimens, 1), scatter.freedom, rng)
    level = level + scatter.batch * rng.normal(size=len(batches))[batch][:, None]
    slope = scatter.slope * _drawn((specimens, 1), scatter.freedom, rng) * (level_travel - 0.5)
    wander = scatter.wander * _wander(specimens, rows, scatter, rng)
    sensor = scatter.cell_N(force_N) * _drawn((specimens, rows), scatter.freedom, rng)
    true = force_N * np.exp(level + slope + wander) + sensor
    return np.round(true / scatter.quantum_N) * scatter.quantum_N


def wander_correlation(rows: NDArray[np.int64], scatter: Scatter) -> FloatArray:
    """Return the correlation of the wandering between rows, shape (n, n)."""
    far = np.abs(np.subtract.outer(rows, rows)) / scatter.wander_rows
    return (1.0 + far) * np.exp(-far) if scatter.smooth else np.exp(-far)


def _wander(specimens: int, rows: int, scatter: Scatter, rng: np.random.Generator) -> FloatArray:
    root = np.linalg.cholesky(wander_correlation(np.arange(rows), scatter) + 1e-9 * np.eye(rows))
    return rng.normal(size=(specimens, rows)) @ root.T


def _drawn(shape: tuple[int, ...], freedom: int, rng: np.random.Generator) -> FloatArray:
    if freedom == 0:
        return rng.normal(size=shape)
    return _T4_TO_NORMAL * rng.standard_t(freedom, size=shape)
