"""Arguments as scripts give them, numpy scalars included, as plain numbers."""

import math
import operator
from typing import SupportsFloat, SupportsIndex

from planner.errors import ArgumentError

__all__ = ["as_count", "as_number", "positive"]


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


def positive(value: SupportsFloat, name: str) -> float:
    """Return a finite number above 0.

    Raises
    ------
    ArgumentError
        It is none.
    """
    number = as_number(value, name)
    if not number > 0.0:
        raise ArgumentError(f"{name} {number:g}: it must be above 0")
    return number
