"""The distance from a point or from a line."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.fields.ramp import Ramp

__all__ = ["LineField", "PointField"]

Point = tuple[float, float, float]


@dataclass(frozen=True)
class PointField:
    """Spheres about a point; a level of radius r is drawn within 3 h² / 8 r at pitch h.

    Attributes
    ----------
    centre_mm
        The point.
    ramp
        Radii at which the gradient starts and ends.
    """

    centre_mm: Point
    ramp: Ramp

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "radial"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        x, y, z = (np.asarray(points_mm, dtype=np.float64) - np.array(self.centre_mm)).T
        return self.ramp.share(np.sqrt(x * x + y * y + z * z))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {"name": self.name, "centre_mm": list(self.centre_mm), **self.ramp.lengths()}


@dataclass(frozen=True)
class LineField:
    """Cylinders about a line; a level of radius r is drawn within 3 h² / 8 r at pitch h.

    Attributes
    ----------
    point_mm, direction
        A point of the line, and its unit direction.
    ramp
        Radii at which the gradient starts and ends.
    """

    point_mm: Point
    direction: Point
    ramp: Ramp

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "radial"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        x, y, z = (np.asarray(points_mm, dtype=np.float64) - np.array(self.point_mm)).T
        a, b, c = self.direction
        p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
        return self.ramp.share(np.sqrt(p * p + q * q + r * r))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name,
            "point_mm": list(self.point_mm),
            "direction": list(self.direction),
            **self.ramp.lengths(),
        }
