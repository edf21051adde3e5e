"""Fields by formula and by distance: axis, radial, distance, function, and fields of fields."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from planner.errors import ArgumentError
from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, numbers_in

__all__ = [
    "AxisField",
    "Field",
    "FieldRegion",
    "FunctionField",
    "PlanarField",
    "Quantity",
    "Ramp",
    "axis_field",
    "project",
    "unit_direction",
]

Quantity = Callable[[FloatArray], FloatArray]


# ------------------------------------------------------------------------------------------------
# The field along a straight direction.


_DIRECTIONS = {
    "x": "1,0,0", "y": "0,1,0", "z": "0,0,1", "+x": "1,0,0", "+y": "0,1,0", "+z": "0,0,1",
    "-x": "-1,0,0", "-y": "0,-1,0", "-z": "0,0,-1",
}  # fmt: skip
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

    name = "axis"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return (project(points_mm, self.direction) - self.start_mm) / self.span_mm

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {"name": self.name, **asdict(self), "direction": list(self.direction)}

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
    axis = "xyz"[int(np.argmax(np.ptp(mesh.bounds_mm, axis=0)))] if axis is None else axis
    direction = unit_direction(axis)
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
    return np.asarray(x * direction[0] + y * direction[1] + z * direction[2])


def unit_direction(axis: str | Sequence[float]) -> tuple[float, float, float]:
    """Return the unit vector of an axis as a user writes it."""
    if isinstance(axis, str):
        text = axis.strip().lower().replace("\N{MINUS SIGN}", "-")
        text = _DIRECTIONS.get(text, text)
        parts: Sequence[object] = text.split("," if "," in text else None)
    else:
        parts = list(axis) if np.iterable(axis) else []
    components = numbers_in(parts, float)
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

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,), in 0..1 over the part and continued outside."""

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""


@runtime_checkable
class PlanarField(Field, Protocol):
    """A field whose level sets are parallel planes, so that they can be cut exactly."""

    def plane(self, level: float) -> tuple[FloatArray, float]:
        """Return the unit normal to larger values and the offset in mm of n . x = offset."""


@dataclass(frozen=True)
class FunctionField:
    """A field by a function of points (n, 3), and what else a plan says of it.

    planner measures where its levels are drawn (check ``interface_error_um``).
    """

    name: str
    function: Callable[[FloatArray], FloatArray] = field(repr=False, compare=False)
    says: Mapping[str, object] = field(default_factory=dict)

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return self.function(np.asarray(points_mm, dtype=np.float64))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {"name": self.name, **self.says}


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
        ends = self.start, self.stop
        if not np.isfinite(ends).all() or math.isclose(*ends, rel_tol=1e-9):  # rounding is no rise
            raise ArgumentError(
                f"a gradient from {self.start:.6g} to {self.stop:.6g} is none: the two must be "
                "finite and differ; give from= and to="
            )

    @classmethod
    def over(cls, found: FloatArray, start: float | None, stop: float | None) -> "Ramp":
        """Return the ramp over all of some values, as far as its ends are not stated."""
        first = float(found.min()) if start is None else start
        return cls(first, float(found.max()) if stop is None else stop)

    def along(
        self, quantity: Quantity, name: str, says: Mapping[str, object], *, length: bool = True
    ) -> FunctionField:
        """Return the field of a quantity of points (n, 3); a plan says of lengths that they are."""

        def share(points_mm: FloatArray) -> FloatArray:
            return (quantity(points_mm) - self.start) / (self.stop - self.start)

        ends: dict[str, object] = {"from": self.start, "to": self.stop}
        if length:
            span_mm = abs(self.stop - self.start)
            ends = {"from_mm": self.start, "to_mm": self.stop, "span_mm": span_mm}
        return FunctionField(name, share, {**says, **ends})


# ------------------------------------------------------------------------------------------------
# Regions of space that fields start from or end at.


@dataclass(frozen=True)
class FieldRegion:
    """A set of points: which of points (n, 3) it holds, and what a plan says of it."""

    holds: Callable[[FloatArray], BoolArray] = field(repr=False, compare=False)
    says: Mapping[str, object]
