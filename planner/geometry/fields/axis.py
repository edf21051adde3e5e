"""The field along a straight direction."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.geometry.mesh import Mesh

__all__ = ["AxisField", "axis_field"]

UNITS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
ALLOWED = 'x, y, z, -x, -y, -z, or three numbers such as "1,0,1"'


@dataclass(frozen=True)
class AxisField:
    """u = (n . x - start) / span, with planes as level sets.

    Attributes
    ----------
    direction : tuple of 3 floats
        Unit vector n towards larger values.
    start_mm : float
        n . x where u = 0.
    span_mm : float
        Distance over which u grows from 0 to 1, positive.
    """

    direction: tuple[float, float, float]
    start_mm: float
    span_mm: float

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "axis"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return (project(points_mm, self.direction) - self.start_mm) / self.span_mm

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name,
            "direction": list(self.direction),
            "start_mm": self.start_mm,
            "span_mm": self.span_mm,
        }

    def plane(self, level: float) -> tuple[FloatArray, float]:
        """Return unit normal and offset in mm of the plane n . x = offset where u = level."""
        return np.array(self.direction), self.start_mm + level * self.span_mm


def axis_field(axis: str | Sequence[float] | None, mesh: Mesh) -> AxisField:
    """Build the field along an axis over the true extent of a part.

    Parameters
    ----------
    axis : str, three numbers or None
        x, y, z, -x, -y, -z, or a direction of any length, also as text "dx,dy,dz". None takes
        the longest side of the bounding box, x before y before z where sides are equal.
    mesh : Mesh
        The part, in mm.

    Returns
    -------
    AxisField
        0 on the part's first vertex along the direction, 1 on its last.

    Raises
    ------
    ArgumentError
        A direction of another form, not finite or zero, or along which the part is flat.
    """
    bounds_mm = mesh.bounds_mm
    if axis is None:
        axis = "xyz"[int(np.argmax(bounds_mm[1] - bounds_mm[0]))]
    direction = _direction(axis)
    extent = project(mesh.vertices, direction)[mesh.faces]
    start_mm, end_mm = float(extent.min()), float(extent.max())
    if not end_mm > start_mm:
        raise ArgumentError(
            f"axis {axis!r}: the part is flat along it (0 mm); choose another axis: {ALLOWED}"
        )
    return AxisField(direction, start_mm, end_mm - start_mm)


def project(points_mm: FloatArray, direction: Sequence[float]) -> FloatArray:
    """Return n . x of points (n, 3), summed in a fixed order: the same bits on every machine."""
    x, y, z = np.asarray(points_mm, dtype=np.float64).T
    along: FloatArray = x * direction[0] + y * direction[1] + z * direction[2]
    return along


def _direction(axis: str | Sequence[float]) -> tuple[float, float, float]:
    """Return the unit vector of an axis as a user writes it."""
    if isinstance(axis, str):
        text = axis.strip().lower()
        if text.lstrip("+-") in UNITS and len(text) <= 2:
            sign = -1.0 if text[0] == "-" else 1.0
            x, y, z = (sign * component + 0.0 for component in UNITS[text[-1]])
            return x, y, z
        parts: Sequence[object] = text.split(",")
    else:
        parts = list(axis)
    try:
        components = [float(part) for part in parts]  # type: ignore[arg-type] # ValueError below
    except (TypeError, ValueError):
        components = []
    if len(components) != 3:
        raise ArgumentError(f"axis {axis!r} is not a direction; allowed are {ALLOWED}")
    if not all(map(math.isfinite, components)):
        raise ArgumentError(f"axis {axis!r} has a component that is not finite; use {ALLOWED}")
    largest = max(map(abs, components))
    if largest == 0.0:
        raise ArgumentError(f"axis {axis!r} has length zero; use {ALLOWED}")
    x, y, z = (component / largest for component in components)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length + 0.0, y / length + 0.0, z / length + 0.0
