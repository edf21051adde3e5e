"""What a gradient follows: a number from 0 to 1 at every point of the part."""

from typing import Protocol, runtime_checkable

from planner.arrays import FloatArray

__all__ = ["Field", "PlanarField"]


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
