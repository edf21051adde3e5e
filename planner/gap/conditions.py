"""Which specimens were made and tested alike, so that they differ by scatter alone."""

from collections.abc import Hashable, Iterable, Sequence

import numpy as np

from planner.gap.specimen import Specimen

__all__ = ["condition_keys", "levels", "replicate_groups"]

TOLERANCES: dict[str, tuple[float, float]] = {
    "rate_mm_s": (0.0, 0.05),
    "temperature_C": (1.0, 0.0),
    "soak_h": (0.25, 0.05),
    "age_days": (0.5, 0.1),
    "gauge_mm": (0.0, 0.02),
    "width_mm": (0.0, 0.02),
    "thickness_mm": (0.0, 0.02),
}
"""How far apart, absolute and relative, two specimens of one condition may be."""


def levels(
    values: Sequence[float | None], absolute: float, relative: float
) -> tuple[int | None, ...]:
    """Return the level of each value, counted from the lowest; None stays unknown.

    Sorted values are of one level while each is within the tolerance of the level's first.
    """
    found: list[int | None] = [None] * len(values)
    level, first = -1, 0.0
    for value, place in sorted((v, i) for i, v in enumerate(values) if v is not None):
        if level < 0 or value - first > max(absolute, relative * abs(first)):
            level, first = level + 1, value
        found[place] = level
    return tuple(found)


def condition_keys(
    specimens: Sequence[Specimen], *, with_batch: bool = False
) -> tuple[Hashable, ...]:
    """Return a key for each specimen; equal keys mean made and tested alike.

    Material or design, nominal size, orientation, protocol, rate, temperature, soaking and age
    count, figures within `TOLERANCES`; further columns do not. Two unknowns count as alike.
    """
    columns = [
        levels([getattr(s, name) for s in specimens], *tolerance)
        for name, tolerance in TOLERANCES.items()
    ]
    return tuple(
        (
            s.material,
            None if s.profile is None else _design_key(s),
            s.orientation,
            s.protocol,
            s.batch if with_batch else None,
            *(column[i] for column in columns),
        )
        for i, s in enumerate(specimens)
    )


def replicate_groups(
    specimens: Sequence[Specimen], *, with_batch: bool = False
) -> tuple[tuple[int, ...], ...]:
    """Return the places of specimens that are alike, in order of appearance, singles included."""
    return _grouped(condition_keys(specimens, with_batch=with_batch))


def _grouped(keys: Iterable[Hashable]) -> tuple[tuple[int, ...], ...]:
    groups: dict[Hashable, list[int]] = {}
    for place, key in enumerate(keys):
        groups.setdefault(key, []).append(place)
    return tuple(tuple(group) for group in groups.values())


def _design_key(specimen: Specimen) -> Hashable:
    design = specimen.profile
    assert design is not None
    arrays = (design.x_mm, design.coordinate, design.width_mm, design.thickness_mm)
    return tuple(None if a is None else np.round(a, 6).tobytes() for a in arrays)
