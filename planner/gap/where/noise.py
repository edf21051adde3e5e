"""What the residual of a campaign would be like if nothing were hidden."""

from collections.abc import Sequence
from dataclasses import dataclass

from planner.arrays import FloatArray

__all__ = ["Noise"]


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Covariance of N figures: what each specimen has to itself, and what specimens share.

    Attributes
    ----------
    block_covariance
        Of each specimen's own figures, (d, d), in the table's order: scatter of level and slope,
        wandering, sensor.
    shared : (N, q)
        What specimens share, a column of prior deviation 1 each: batches, the calibration of the
        palette's laws. It is marginalised.
    log_sd
        How far the noise may be off, as a standard deviation of its logarithm.
    """

    block_covariance: Sequence[FloatArray]
    shared: FloatArray
    log_sd: float = 0.3

    @property
    def degrees_of_freedom(self) -> float:
        """Of a scaled chi-square variance that is as uncertain."""
        return 0.5 / max(self.log_sd, 1e-3) ** 2
