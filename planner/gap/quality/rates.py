"""The declared rate against travel and time."""

import math
from collections.abc import Iterator, Sequence

from planner.gap.quality.motion import speed_mm_s
from planner.gap.quality.problem import Problem, gathered
from planner.gap.specimen import Specimen

__all__ = ["rate_problems"]

TOLERANCE = 0.1
"""Machines hold a speed to 1 %; what is 10 % off is another speed."""

_SLIPS = (
    (60.0, "mm/s and mm/min, or s and min, were mixed up"),
    (25.4, "mm and inches were mixed up in travel or rate"),
    (1524.0, "mm/s and in/min were mixed up"),
    (1000.0, "s and ms were mixed up"),
)


def rate_problems(specimens: Sequence[Specimen]) -> tuple[Problem, ...]:
    """Return the specimens whose crosshead moved at another speed than declared."""
    known = [s for s in specimens if s.rate_mm_s is not None and s.time_recorded]
    return gathered(tuple(_rate_problems(known)), len(known))


def _rate_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    for s in specimens:
        speed = speed_mm_s(s.time_s, s.displacement_mm)
        declared = s.rate_mm_s
        if declared is None or speed <= 0.0 or abs(math.log(speed / declared)) <= TOLERANCE:
            continue
        reason = next(
            (
                f"; {words}"
                for factor, words in _SLIPS
                if abs(abs(math.log(speed / declared)) - math.log(factor)) < TOLERANCE
            ),
            "",
        )
        yield Problem(
            "rate",
            s.id,
            f"the crosshead moves at {speed:.3g} mm/s by its time channel, {declared:.3g} mm/s "
            f"is declared{reason}",
            float(f"{speed:.6g}"),
            declared,
        )
