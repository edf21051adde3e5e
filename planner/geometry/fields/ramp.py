"""From a raw quantity, such as a distance, to a field from 0 to 1."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError

__all__ = ["Ramp"]


@dataclass(frozen=True)
class Ramp:
    """Where a gradient starts and ends along a raw quantity.

    Attributes
    ----------
    start, stop
        Values of the quantity where the field is 0 and 1; it may fall from one to the other.
    """

    start: float
    stop: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.start) and np.isfinite(self.stop)) or self.start == self.stop:
            raise ArgumentError(
                f"a gradient from {self.start:.6g} to {self.stop:.6g} is none: the two must be "
                "finite and differ; give from= and to="
            )

    def share(self, quantity: FloatArray) -> FloatArray:
        """Return the field, (n,)."""
        shares: FloatArray = (quantity - self.start) / (self.stop - self.start)
        return shares

    def lengths(self) -> dict[str, object]:
        """Return the ramp as a plan describes that of a distance."""
        return {
            "from_mm": self.start,
            "to_mm": self.stop,
            "span_mm": abs(self.stop - self.start),
        }

    def numbers(self) -> dict[str, object]:
        """Return the ramp as a plan describes that of any other quantity."""
        return {"from": self.start, "to": self.stop}
