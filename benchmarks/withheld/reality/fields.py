"""Strain along the graded bars as a camera sees it: averaged over its facets, or at points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.bench import Bench, FloatArray

__all__ = ["FIELD_ROWS", "USUAL", "Camera", "field_detectability", "measured_strain"]

FIELD_ROWS = np.arange(15, 121, 15)
_INSET_MM = 0.35
_SD = 0.0015
_RELATIVE_SD = 0.01


@dataclass(frozen=True)
class Camera:
    """What watches the graded bars.

    Attributes
    ----------
    facet_mm
        Length that a facet averages over; 0 sees strain at points.
    places
        Facets along a bar, evenly spaced.
    stated
        Whether the campaign says how long facets are.
    """

    facet_mm: float = 1.2
    places: int = 28
    stated: bool = False

    def __post_init__(self) -> None:
        if self.facet_mm < 0.0 or self.places < 2:
            raise ValueError(
                f"a camera of {self.places} facets of {self.facet_mm:g} mm: it has two or more, "
                "of 0 mm or more"
            )

    def positions_mm(self, bench: Bench) -> FloatArray:
        """Return the facets' middles, (S, places), from one facet inside either end."""
        inset = self.facet_mm or _INSET_MM
        ends = bench.design.gauge_mm
        return np.round(np.array([np.linspace(inset, e - inset, self.places) for e in ends]), 3)

    def seen(self, bench: Bench, strain: FloatArray) -> FloatArray:
        """Return the strains, (S, rows, places), of elements that are strained, (S, T, N)."""
        positions = self.positions_mm(bench)
        seen = np.zeros((len(positions), len(FIELD_ROWS), self.places))
        for i, edges in enumerate(bench.edges_mm):
            ends = positions[i] + np.array([[-0.5], [0.5]]) * self.facet_mm
            for k, row in enumerate(FIELD_ROWS):
                if self.facet_mm == 0.0:
                    seen[i, k] = bench.strain_at(i, strain[i, row], positions[i])
                    continue
                moved = np.append(0.0, np.cumsum(strain[i, row] * np.diff(edges)))
                seen[i, k] = np.diff(np.interp(ends, edges, moved), axis=0)[0] / self.facet_mm
        return seen


USUAL = Camera()


def measured_strain(
    bench: Bench, strain: FloatArray, camera: Camera, rng: np.random.Generator
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return the rows, the positions (mm) and the strains (S, rows, positions) of the camera."""
    seen = camera.seen(bench, strain)
    noise = rng.normal(size=seen.shape) * _sd(seen)
    return FIELD_ROWS, camera.positions_mm(bench), np.round(seen + noise, 5)


def field_detectability(
    bench: Bench, strain: FloatArray, plain: FloatArray, camera: Camera
) -> float:
    """Return how many standard errors the camera's strains lie from those without an effect."""
    with_effect, without = (camera.seen(bench, e) for e in (strain, plain))
    return float(np.sqrt(np.sum(((with_effect - without) / _sd(without)) ** 2)))


def _sd(strain: FloatArray) -> FloatArray:
    return _SD + _RELATIVE_SD * np.abs(strain)
