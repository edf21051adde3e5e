"""Arguments as scripts give them, numpy scalars included, as plain numbers."""

import math
import operator
from typing import SupportsFloat, SupportsIndex

from planner.errors import ArgumentError

__all__ = ["as_count", "as_number"]


def as_count(value: SupportsIndex, name: str) -> int:
    """Return a whole number.

    Raises
    ------
    ArgumentError
        It is none.
    """
    try:
        return operator.index(value)
    except TypeError:
        raise ArgumentError(f"{name} {value!r}: it must be a whole number") from None


def as_number(value: SupportsFloat, name: str) -> float:
    """Return a finite number.

    Raises
    ------
    ArgumentError
        It is none; text is not taken for one.
    """
    try:
        number = math.nan if isinstance(value, str) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ArgumentError(f"{name} {value!r}: it must be a finite number")
    return number
