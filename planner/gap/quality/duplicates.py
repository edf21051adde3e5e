"""Curves that are copies of one another."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.gap.quality.problem import Problem
from planner.gap.specimen import Specimen

__all__ = ["duplicate_problems"]

SIGNIFICANT_DIGITS = 7


def duplicate_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    """Yield specimens whose force and travel are another's, number for number.

    Time does not count: a copy may start elsewhere.
    """
    seen: dict[bytes, str] = {}
    for s in specimens:
        digits = _rounded(s.force_N).tobytes() + _rounded(s.displacement_mm).tobytes()
        other = seen.setdefault(digits, s.id)
        if other != s.id:
            yield Problem(
                "duplicate", s.id, f"its curve is that of specimen {other}, number for number"
            )


def _rounded(values: np.ndarray) -> np.ndarray:
    scale = float(np.max(np.abs(values))) or 1.0
    return np.round(values / scale, SIGNIFICANT_DIGITS) * float(f"{scale:.{SIGNIFICANT_DIGITS}g}")
