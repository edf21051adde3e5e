"""What is printed along a graded bar's gauge: lamellae, ramps, blocks and waves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.palette_file import PaletteFile

__all__ = ["PROFILES", "Profile", "draw_profiles"]

FloatArray = NDArray[np.float64]

PROFILES = ("lamellae", "ramp", "blocks", "wave")
SEGMENTS = 16
_LENGTH_MM = 32.0
_STEP_MM = 0.01


@dataclass(frozen=True)
class Profile:
    """A printed design, linear between its points.

    Attributes
    ----------
    x_mm, coordinate
        Points along the gauge, from 0 to its length.
    edges_mm
        Ends of the segments between which the design may jump, shape (SEGMENTS + 1,).
    """

    kind: str
    x_mm: FloatArray
    coordinate: FloatArray

    @property
    def length_mm(self) -> float:
        """Return the gauge length."""
        return float(self.x_mm[-1])

    @property
    def edges_mm(self) -> FloatArray:
        """Return the ends of the segments."""
        return np.linspace(0.0, self.length_mm, SEGMENTS + 1)

    def at(self, x_mm: FloatArray) -> FloatArray:
        """Return the design's coordinate, the end values beyond the gauge."""
        return np.interp(x_mm, self.x_mm, self.coordinate)


def draw_profiles(
    palette: PaletteFile, count: int, rng: np.random.Generator
) -> tuple[Profile, ...]:
    """Draw `count` bars: lamellae first, each between a softer and a harder grade."""
    grades = palette.grades
    profiles = []
    for number in range(count):
        soft = int(rng.integers(0, max(1, len(grades) - 3)))
        hard = int(rng.integers(min(soft + 3, len(grades) - 1), len(grades)))
        ends = grades[soft].coordinate, grades[hard].coordinate
        profiles.append(_profile(PROFILES[number % len(PROFILES)], *ends))
    return tuple(profiles)


def _profile(kind: str, soft: float, hard: float) -> Profile:
    edges = np.linspace(0.0, _LENGTH_MM, SEGMENTS + 1)
    grid = np.linspace(0.0, _LENGTH_MM, 8 * SEGMENTS + 1)
    match kind:
        case "lamellae":
            steps = np.arange(SEGMENTS) % 2
        case "blocks":
            steps = np.array([0] * 5 + [1] * 6 + [0] * 5)
        case "ramp":
            return Profile(kind, grid, _decimals(soft + (hard - soft) * grid / _LENGTH_MM))
        case _:
            share = 0.5 - 0.5 * np.cos(4.0 * np.pi * grid / _LENGTH_MM)
            return Profile(kind, grid, _decimals(soft + (hard - soft) * share))
    inner = edges[1:-1]
    x = np.sort(np.r_[0.0, inner - _STEP_MM / 2, inner + _STEP_MM / 2, _LENGTH_MM])
    return Profile(kind, x, _decimals(np.repeat(np.where(steps == 1, hard, soft), 2)))


def _decimals(coordinate: FloatArray) -> FloatArray:
    return np.round(coordinate, 6)
