"""The distance from a surface: the part's own, another mesh's, or some faces'."""

from dataclasses import dataclass, field

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.fields.ramp import Ramp
from planner.geometry.fields.triangle_tree import TriangleTree, nearest

__all__ = ["DistanceField"]


@dataclass(frozen=True)
class DistanceField:
    """Parallels of a surface, by exact distances.

    At pitch h a level is drawn within 3 h² / 8 r, r its radius of curvature, and where its
    parallels fold, as along the middle of a wall, within 0.87 h.

    Attributes
    ----------
    origin
        What the distance is from, as a plan says it.
    ramp
        Distances at which the gradient starts and ends.
    tree
        The surface.
    signed
        1 where distances count positive inside, -1 outside, 0 on both sides.
    """

    origin: dict[str, object]
    ramp: Ramp
    tree: TriangleTree = field(repr=False, compare=False)
    signed: int = 0

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "distance"

    def distance_mm(self, points_mm: FloatArray) -> FloatArray:
        """Return the distance at points (n, 3), with its sign."""
        distance, outside = nearest(self.tree, points_mm)
        if self.signed:
            distance = np.where(outside == (self.signed > 0), -distance, distance)
        return distance

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return self.ramp.share(self.distance_mm(points_mm))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {"name": self.name, **self.origin, **self.ramp.lengths()}
