"""Fields: what a gradient follows through a part, a number from 0 to 1 at every point."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Protocol, runtime_checkable

import numpy as np

from planner.errors import ArgumentError
from planner.mesh.distance import TriangleTree, nearest, triangle_tree
from planner.mesh.mesh import Mesh, Topology, connected
from planner.numerics import BoolArray, FloatArray

__all__ = [
    "AxisField",
    "BallRegion",
    "BlendField",
    "BoxRegion",
    "ClampField",
    "DistanceField",
    "Field",
    "FieldRegion",
    "FunctionField",
    "HalfSpace",
    "LineField",
    "MaximumField",
    "MinimumField",
    "PlanarField",
    "PointField",
    "Ramp",
    "axis_field",
    "faces_within",
    "inside_mesh",
    "project",
    "smooth_patch",
]


# ------------------------------------------------------------------------------------------------
# The field along a straight direction.


_UNITS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_ALLOWED = 'x, y, z, -x, -y, -z, or three numbers such as "1,0,1"'


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
            f"axis {axis!r}: the part is flat along it (0 mm); choose another axis: {_ALLOWED}"
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
        if text.lstrip("+-") in _UNITS and len(text) <= 2:
            sign = -1.0 if text[0] == "-" else 1.0
            x, y, z = (sign * component + 0.0 for component in _UNITS[text[-1]])
            return x, y, z
        parts: Sequence[object] = text.split(",")
    else:
        parts = list(axis)
    try:
        components = [float(part) for part in parts]  # type: ignore[arg-type] # ValueError below
    except (TypeError, ValueError):
        components = []
    if len(components) != 3:
        raise ArgumentError(f"axis {axis!r} is not a direction; allowed are {_ALLOWED}")
    if not all(map(math.isfinite, components)):
        raise ArgumentError(f"axis {axis!r} has a component that is not finite; use {_ALLOWED}")
    largest = max(map(abs, components))
    if largest == 0.0:
        raise ArgumentError(f"axis {axis!r} has length zero; use {_ALLOWED}")
    x, y, z = (component / largest for component in components)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length + 0.0, y / length + 0.0, z / length + 0.0


# ------------------------------------------------------------------------------------------------
# What a gradient follows: a number from 0 to 1 at every point of the part.


@runtime_checkable
class Field(Protocol):
    """A continuous function over the part, 0 where the gradient starts and 1 where it ends."""

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        ...

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,), in 0..1 over the part and continued outside."""
        ...

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        ...


@runtime_checkable
class PlanarField(Field, Protocol):
    """A field whose level sets are parallel planes, so that they can be cut exactly."""

    def plane(self, level: float) -> tuple[FloatArray, float]:
        """Return the unit normal to larger values and the offset in mm of n . x = offset."""
        ...


# ------------------------------------------------------------------------------------------------
# From a raw quantity, such as a distance, to a field from 0 to 1.


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


# ------------------------------------------------------------------------------------------------
# The distance from a point or from a line.


_Point = tuple[float, float, float]


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

    centre_mm: _Point
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

    point_mm: _Point
    direction: _Point
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


# ------------------------------------------------------------------------------------------------
# Fields made of fields: the lower or higher of several, a mixture, a clamp.


@dataclass(frozen=True)
class MinimumField:
    """The lowest of several fields; kinks between them are drawn within 0.87 of a pitch."""

    fields: tuple[Field, ...]

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "min"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return reduce(np.minimum, (field.values(points_mm) for field in self.fields))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {"name": self.name, "fields": [field.description() for field in self.fields]}


@dataclass(frozen=True)
class MaximumField:
    """The highest of several fields; kinks between them are drawn within 0.87 of a pitch."""

    fields: tuple[Field, ...]

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "max"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return reduce(np.maximum, (field.values(points_mm) for field in self.fields))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {"name": self.name, "fields": [field.description() for field in self.fields]}


@dataclass(frozen=True)
class BlendField:
    """A weighted mean of two fields: (1 - weight) first + weight second."""

    first: Field
    second: Field
    weight: float

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "blend"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        first, second = self.first.values(points_mm), self.second.values(points_mm)
        mixed: FloatArray = (1.0 - self.weight) * first + self.weight * second
        return mixed

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name,
            "fields": [self.first.description(), self.second.description()],
            "weight": self.weight,
        }


@dataclass(frozen=True)
class ClampField:
    """A field held between two values."""

    field: Field
    low: float
    high: float

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "clamp"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return np.clip(self.field.values(points_mm), self.low, self.high)

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name,
            "fields": [self.field.description()],
            "low": self.low,
            "high": self.high,
        }


# ------------------------------------------------------------------------------------------------
# A field given by a Python function of positions.


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


# ------------------------------------------------------------------------------------------------
# A smooth piece of a surface, such as the wall of a hole, from one picked point.


_CREASE = np.cos(np.radians(40.0))


def smooth_patch(mesh: Mesh, point_mm: FloatArray) -> Mesh:
    """Return the faces around the place nearest to a point, up to edges sharper than 40 degrees."""
    distance = nearest(triangle_tree(mesh), point_mm[None])[0][0]
    # The face itself: the only one, or one of those, as near as that.
    corners = mesh.triangles
    box = np.maximum(corners.min(axis=1) - point_mm, point_mm - corners.max(axis=1)).max(axis=1)
    candidates = np.flatnonzero(box <= distance + 1e-9)
    off = [
        nearest(triangle_tree(Mesh(mesh.vertices, mesh.faces[[f]])), point_mm[None])[0][0]
        for f in candidates.tolist()
    ]
    picked = int(candidates[int(np.argmin(off))])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    twin = Topology(mesh.faces).twin
    half = np.flatnonzero(twin >= 0)
    one, other = half // 3, twin[half] // 3
    smooth = (normal[one] * normal[other]).sum(axis=1) > _CREASE
    group = connected(len(mesh.faces), one[smooth], other[smooth])
    return Mesh(mesh.vertices, mesh.faces[group == group[picked]])


def faces_within(mesh: Mesh, low_mm: FloatArray, high_mm: FloatArray) -> Mesh:
    """Return the faces whose three corners lie in a box."""
    corners = mesh.triangles
    held = ((corners >= low_mm) & (corners <= high_mm)).all(axis=(1, 2))
    return Mesh(mesh.vertices, mesh.faces[held])


# ------------------------------------------------------------------------------------------------
# Regions of space that fields start from or end at.


class FieldRegion(Protocol):
    """A set of points."""

    def holds(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie in it."""
        ...

    def description(self) -> dict[str, object]:
        """Everything needed to build the region again, as JSON values."""
        ...


@dataclass(frozen=True)
class BoxRegion:
    """What lies between two corners."""

    low_mm: _Point
    high_mm: _Point

    def holds(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie in it."""
        inside = (points_mm >= np.array(self.low_mm)) & (points_mm <= np.array(self.high_mm))
        return np.asarray(inside.all(axis=1))

    def description(self) -> dict[str, object]:
        """Everything needed to build the region again, as JSON values."""
        return {"box_mm": [list(self.low_mm), list(self.high_mm)]}


@dataclass(frozen=True)
class BallRegion:
    """What lies within a radius of a point."""

    centre_mm: _Point
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

    point_mm: _Point
    normal: _Point

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


# ------------------------------------------------------------------------------------------------
# The distance from a surface: the part's own, another mesh's, or some faces'.


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
