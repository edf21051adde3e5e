"""Sizes that no tensile specimen has, and measured ones far from nominal."""

from collections.abc import Iterator, Sequence

from planner.gap.quality.problem import Problem, gathered
from planner.gap.specimen import Specimen

__all__ = ["size_problems"]

PLAUSIBLE_MM = {
    "width_mm": (0.5, 100.0),
    "thickness_mm": (0.1, 50.0),
    "gauge_mm": (2.0, 500.0),
    "measured_width_mm": (0.5, 100.0),
    "measured_thickness_mm": (0.1, 50.0),
}
"""ASTM D412 and D638, ISO 37 and 527 have widths of 2 to 25 mm, thicknesses of 0.5 to 14 mm and
gauges of 4 to 80 mm; labs go further, but not beyond these."""

DEVIATION = 0.25
"""Jetted parts print up to 0.3 mm oversize; a quarter of a size is none of that."""

_SLACK_MM = 0.4


def size_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    """Yield implausible sizes; one that all specimens share is the campaign's."""
    for name, (low, high) in PLAUSIBLE_MM.items():
        sized = [s for s in specimens if getattr(s, name) is not None]
        yield from gathered(tuple(_implausible(sized, name, low, high)), len(sized))
    for name in ("width_mm", "thickness_mm"):
        yield from _against_nominal(specimens, name)


def _implausible(
    specimens: Sequence[Specimen], name: str, low: float, high: float
) -> Iterator[Problem]:
    for s in specimens:
        size: float = getattr(s, name)
        if low <= size <= high:
            continue
        inches = size * 25.4 if size < low else size / 25.4
        reason = "; inches?" if low <= inches <= high and size < low else ""
        yield Problem(
            "size",
            s.id,
            f"{name} is {size:.4g}; tensile specimens have {low:g} to {high:g} mm{reason}",
            size,
            low if size < low else high,
        )


def _against_nominal(specimens: Sequence[Specimen], name: str) -> Iterator[Problem]:
    for s in specimens:
        nominal: float | None = getattr(s, name)
        measured: float | None = getattr(s, f"measured_{name}")
        if nominal is None or measured is None:
            continue
        if abs(measured - nominal) > max(DEVIATION * nominal, _SLACK_MM):
            yield Problem(
                "size",
                s.id,
                f"measured {name.removesuffix('_mm')} is {measured:.4g} mm, nominal "
                f"{nominal:.4g} mm; width and thickness swapped, or another unit?",
                measured,
                nominal,
            )
