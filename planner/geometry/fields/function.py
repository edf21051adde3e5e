"""A field given by a Python function of positions."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from planner.arrays import FloatArray

__all__ = ["FunctionField"]


@dataclass(frozen=True)
class FunctionField:
    """What a function of points (n, 3) in the part's own coordinates returns, (n,).

    At pitch h a level is drawn within 3 h² / 8 times the largest second derivative over the
    gradient; planner measures where it lies (check ``interface_error_mm``).

    Attributes
    ----------
    function
        Takes points in mm, returns values from 0 to 1 over the part.
    origin_mm
        Where the part's own origin lies, as placed for printing.
    """

    function: Callable[[FloatArray], FloatArray] = field(repr=False)
    origin_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "function"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        own = np.asarray(points_mm, dtype=np.float64) - np.array(self.origin_mm)
        return np.asarray(self.function(own), dtype=np.float64)

    def description(self) -> dict[str, object]:
        """Say which function it was; the function itself is not kept."""
        called = getattr(self.function, "__qualname__", type(self.function).__name__)
        return {"name": self.name, "function": called, "origin_mm": list(self.origin_mm)}
