"""Where the material changes: from a target along the field to bands of catalogue materials."""

import itertools
import math
from dataclasses import dataclass

from planner.grading.profile import Profile
from planner.materials.inverse import nearest_on, thresholds_of

__all__ = ["Band", "Shortfall", "distinct_positions", "equal_bands", "natural_bands", "shortfalls"]

# Positions nearer than this to each other or to an end are one position: far below any printer's
# pixel on any part that fits a tray, far above rounding.
_SAME_POSITION = 1e-9


@dataclass(frozen=True, slots=True)
class Band:
    """A stretch of the field printed in one material.

    Attributes
    ----------
    start, stop
        Field values.
    grade
        Place of the material from soft (0) to hard.
    target_MPa
        Lowest and highest target in the band.
    """

    start: float
    stop: float
    grade: int
    target_MPa: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A stretch of the field whose target no material reaches, and the grade that comes nearest."""

    start: float
    stop: float
    target_MPa: tuple[float, float]
    grade: int


def natural_bands(profile: Profile, moduli_MPa: tuple[float, ...]) -> tuple[Band, ...]:
    """Cut where the catalogue material nearest in log stiffness changes.

    Parameters
    ----------
    profile
        Target along the field.
    moduli_MPa
        Of the catalogue materials, strictly rising.
    """
    thresholds = thresholds_of(moduli_MPa)
    cuts = [u for threshold in thresholds.tolist() for u in profile.crossings(threshold)]
    jumps = [a for a, b in itertools.pairwise(profile.positions) if a == b]
    edges = distinct_positions([*cuts, *jumps])
    merged: list[Band] = []
    for start, stop in itertools.pairwise(edges):
        band = _band(profile, moduli_MPa, start, stop)
        if merged and merged[-1].grade == band.grade:
            last = merged.pop()
            low = min(last.target_MPa[0], band.target_MPa[0])
            high = max(last.target_MPa[1], band.target_MPa[1])
            band = Band(last.start, stop, band.grade, (low, high))
        merged.append(band)
    return tuple(merged)


def equal_bands(profile: Profile, moduli_MPa: tuple[float, ...], count: int) -> tuple[Band, ...]:
    """Cut into equal steps of the field, each the material nearest to its middle in log stiffness.

    The middle is the geometric mean of the lowest and the highest target in the band, which
    makes the largest log error smallest.
    """
    edges = [i / count for i in range(count + 1)]
    return tuple(_band(profile, moduli_MPa, a, b) for a, b in itertools.pairwise(edges))


def shortfalls(profile: Profile, moduli_MPa: tuple[float, ...]) -> tuple[Shortfall, ...]:
    """Find where the target lies below the softest or above the hardest material."""
    softest, hardest = moduli_MPa[0], moduli_MPa[-1]
    cuts = [u for limit in (softest, hardest) for u in profile.crossings(limit)]
    found = []
    for start, stop in itertools.pairwise(distinct_positions([*cuts, *profile.positions])):
        low, high = profile.interval_MPa(start, stop)
        if low < softest * (1.0 - 1e-9):
            found.append(Shortfall(start, stop, (low, high), 0))
        elif high > hardest * (1.0 + 1e-9):
            found.append(Shortfall(start, stop, (low, high), len(moduli_MPa) - 1))
    return tuple(found)


def _band(profile: Profile, moduli_MPa: tuple[float, ...], start: float, stop: float) -> Band:
    low, high = profile.interval_MPa(start, stop)
    grade = int(nearest_on(moduli_MPa, math.sqrt(low * high)))
    return Band(start, stop, grade, (low, high))


def distinct_positions(positions: list[float]) -> list[float]:
    """Return 0, the positions that are not the same as another or an end, rising, and 1."""
    edges = [0.0]
    for u in sorted(positions):
        if u - edges[-1] > _SAME_POSITION and 1.0 - u > _SAME_POSITION:
            edges.append(u)
    return [*edges, 1.0]
