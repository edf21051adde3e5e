"""Values on a regular grid or at scattered points, from a file."""

from dataclasses import dataclass, field

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.geometry.fields.cells import CellValues
from planner.geometry.fields.ramp import Ramp

__all__ = ["PointsField", "TableField", "points_field"]


@dataclass(frozen=True)
class TableField:
    """Values at the centres of a grid's cells, linear between them, even beyond the outermost.

    The table is taken for the truth between its values; at pitch h a level is drawn within half
    a pitch where the table is no finer than that.

    Attributes
    ----------
    file, sha256
        Where the table comes from.
    ramp
        Values of the table at which the gradient starts and ends.
    cells
        The table.
    """

    file: str
    sha256: str
    ramp: Ramp
    cells: CellValues = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "table"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return self.ramp.share(self.cells.at(points_mm))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name, "file": self.file, "sha256": self.sha256, **self.ramp.numbers(),
        }  # fmt: skip


@dataclass(frozen=True)
class PointsField:
    """Values at scattered points: a mean of the nearest, those nearer weighing more.

    Weights fall to nothing at the ninth nearest (modified Shepard, Franke and Nielson 1980), so
    that the field is continuous; it keeps each point's value at the point, and never leaves the
    range of its neighbours.

    Attributes
    ----------
    file, sha256
        Where the points come from.
    ramp
        Values at which the gradient starts and ends.
    points_mm, quantity
        (n, 3) and (n,).
    """

    file: str
    sha256: str
    ramp: Ramp
    points_mm: FloatArray = field(repr=False, compare=False)
    quantity: FloatArray = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "points"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        from scipy.spatial import KDTree

        count = min(_NEAREST + 1, len(self.points_mm))
        found = KDTree(self.points_mm).query(points_mm, k=count)
        distance, which = np.asarray(found[0]), np.asarray(found[1])
        reach = distance[:, -1:] * (1.0 + 1e-12) + 1e-300
        weight = np.square(np.maximum(reach - distance, 0.0) / (reach * (distance + 1e-12)))
        weight /= weight.sum(axis=1, keepdims=True)
        return self.ramp.share((weight * self.quantity[which]).sum(axis=1))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name, "file": self.file, "sha256": self.sha256, **self.ramp.numbers(),
        }  # fmt: skip


_NEAREST = 8


def points_field(
    file: str, sha256: str, points_mm: FloatArray, quantity: FloatArray,
    start: float | None, stop: float | None,
) -> PointsField:  # fmt: skip
    """Build the field of scattered values; points that repeat a place take their mean.

    Raises
    ------
    ArgumentError
        Fewer than four places.
    """
    places, which, count = np.unique(points_mm, axis=0, return_inverse=True, return_counts=True)
    if len(places) < 4:
        raise ArgumentError(f"field points: {file} has {len(places)} places; it needs 4 or more")
    mean = np.bincount(which.ravel(), weights=quantity) / count
    ramp = Ramp(
        float(mean.min()) if start is None else start, float(mean.max()) if stop is None else stop
    )
    return PointsField(file, sha256, ramp, places, mean)
