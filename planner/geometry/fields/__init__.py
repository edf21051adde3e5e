"""Fields: what a gradient follows through the part."""

from planner.geometry.fields.axis import AxisField, axis_field
from planner.geometry.fields.field import Field, PlanarField

__all__ = ["AxisField", "Field", "PlanarField", "axis_field"]
