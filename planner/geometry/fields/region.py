"""Regions of space that fields start from or end at."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.geometry.fields.triangle_tree import TriangleTree, nearest, triangle_tree
from planner.geometry.mesh import Mesh

__all__ = ["Ball", "Box", "HalfSpace", "Inside", "Region", "inside_mesh"]

Point = tuple[float, float, float]


class Region(Protocol):
    """A set of points."""

    def holds(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie in it."""
        ...

    def description(self) -> dict[str, object]:
        """Everything needed to build the region again, as JSON values."""
        ...


@dataclass(frozen=True)
class Box:
    """What lies between two corners."""

    low_mm: Point
    high_mm: Point

    def holds(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie in it."""
        inside = (points_mm >= np.array(self.low_mm)) & (points_mm <= np.array(self.high_mm))
        return np.asarray(inside.all(axis=1))

    def description(self) -> dict[str, object]:
        """Everything needed to build the region again, as JSON values."""
        return {"box_mm": [list(self.low_mm), list(self.high_mm)]}


@dataclass(frozen=True)
class Ball:
    """What lies within a radius of a point."""

    centre_mm: Point
    radius_mm: float

    def holds(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie in it."""
        off = points_mm - np.array(self.centre_mm)
        return np.asarray((off * off).sum(axis=1) <= self.radius_mm**2)

    def description(self) -> dict[str, object]:
        """Everything needed to build the region again, as JSON values."""
        return {"centre_mm": list(self.centre_mm), "radius_mm": self.radius_mm}


@dataclass(frozen=True)
class HalfSpace:
    """What lies beyond a plane, where its normal points."""

    point_mm: Point
    normal: Point

    def holds(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie in it."""
        x, y, z = (points_mm - np.array(self.point_mm)).T
        a, b, c = self.normal
        return np.asarray(x * a + y * b + z * c >= 0.0)

    def description(self) -> dict[str, object]:
        """Everything needed to build the region again, as JSON values."""
        return {"point_mm": list(self.point_mm), "normal": list(self.normal)}


@dataclass(frozen=True)
class Inside:
    """What lies inside a closed mesh."""

    file: str
    sha256: str
    tree: TriangleTree = field(repr=False, compare=False)

    def holds(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie in it."""
        return ~nearest(self.tree, points_mm)[1]

    def description(self) -> dict[str, object]:
        """Everything needed to build the region again, as JSON values."""
        return {"file": self.file, "sha256": self.sha256}


def inside_mesh(mesh: Mesh, file: str, sha256: str) -> Inside:
    """Return the inside of a mesh as a region."""
    return Inside(file, sha256, triangle_tree(mesh))
