"""A condition of each test against that at which the palette's laws hold."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from planner.arrays import FloatArray
from planner.gap.forward.setup import Setup

__all__ = ["STANDARD", "condition", "reference_condition"]

STANDARD: Mapping[str, float] = MappingProxyType(
    {"rate_per_s": 0.03, "temperature_C": 23.0, "soak_h": 0.0, "age_days": 7.0}
)
"""What stands in where a palette does not say at which conditions it was measured."""

_REFERENCE = MappingProxyType({"rate_per_s": "strain_rate_per_s"})
_COLUMN = MappingProxyType({"rate_per_s": "rate_mm_s"})


def reference_condition(setup: Setup, name: str) -> float:
    """Return a condition's value at the palette's reference."""
    value = getattr(setup.reference, _REFERENCE.get(name, name))
    return STANDARD[name] if value is None else float(value)


def condition(setup: Setup, name: str) -> FloatArray:
    """Return a condition of the tests, (P,), the reference's where it is unknown."""
    values: FloatArray = getattr(setup, name)
    known = setup.known.get(name, setup.known.get(_COLUMN.get(name, name)))
    if known is None:
        return values
    return np.where(known, values, reference_condition(setup, name))
