"""Fields made of fields: the lower or higher of several, a mixture, a clamp."""

from dataclasses import dataclass
from functools import reduce

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.fields.field import Field

__all__ = ["BlendField", "ClampField", "MaximumField", "MinimumField"]


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
