"""Strain along the graded bars as a camera sees it: averaged over its facets, or at points."""

from dataclasses import dataclass

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray

__all__ = ["FIELD_ROWS", "USUAL", "Camera", "field_detectability", "measured_strain", "strain_sd"]

FIELD_ROWS = np.arange(15, 121, 15)
_PLACES = 28
_SD = 0.0015
_RELATIVE_SD = 0.01


@dataclass(frozen=True)
class Camera:
    """What watches the graded bars.

    Attributes
    ----------
    facet_mm
        Length that a facet averages over; 0 sees strain at points.
    spacing_mm
        From place to place, the first as far from the bar's end; None: 28 places, from one facet
        inside either end.
    stated
        Whether the campaign says how long facets are.
    """

    facet_mm: float = 1.2
    spacing_mm: float | None = None
    stated: bool = False

    def __post_init__(self) -> None:
        if self.facet_mm < 0.0 or (self.spacing_mm or 1.0) <= 0.0:
            raise ValueError("a camera's facets are of 0 mm or more, the spacing above 0")

    def positions_mm(self, bench: Bench) -> list[FloatArray]:
        """Return the facets' middles, a row a bar."""
        ends, spacing, inset = bench.design.gauge_mm, self.spacing_mm, self.facet_mm
        if spacing is None:
            places = [np.linspace(inset, end - inset, _PLACES) for end in ends]
        else:
            places = [np.arange(spacing, end - 0.5 * spacing, spacing) for end in ends]
        return [np.round(x, 3) for x in places]

    def seen(self, bench: Bench, strain: FloatArray) -> list[FloatArray]:
        """Return the strains, (rows, places) a bar, of elements that are strained, (S, T, N)."""
        found = []
        for i, (edges, x) in enumerate(zip(bench.edges_mm, self.positions_mm(bench), strict=True)):
            ends = (x + np.array([[-0.5], [0.5]]) * self.facet_mm).clip(edges[0], edges[-1])
            rows = []
            for now in strain[i, FIELD_ROWS]:
                if self.facet_mm == 0.0:
                    rows.append(bench.strain_at(i, now, x))
                    continue
                moved = np.append(0.0, np.cumsum(now * np.diff(edges)))
                rows.append(
                    np.diff(np.interp(ends, edges, moved), axis=0)[0] / np.diff(ends, axis=0)[0]
                )
            found.append(np.array(rows))
        return found


USUAL = Camera()


def measured_strain(
    bench: Bench, strain: FloatArray, camera: Camera, rng: np.random.Generator
) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return times, positions (mm) and strains (times, positions) that the camera sees of bars."""
    found = []
    for i, (x, seen) in enumerate(
        zip(camera.positions_mm(bench), camera.seen(bench, strain), strict=True)
    ):
        noisy = seen + rng.normal(size=seen.shape) * strain_sd(seen)
        found.append((bench.motion.time_s[i, FIELD_ROWS], x, np.round(noisy, 5)))
    return found


def field_detectability(
    bench: Bench, strain: FloatArray, plain: FloatArray, camera: Camera
) -> float:
    """Return how many standard errors the camera's strains lie from those without an effect."""
    pairs = zip(camera.seen(bench, strain), camera.seen(bench, plain), strict=True)
    squares = [
        np.sum(((with_effect - without) / strain_sd(without)) ** 2)
        for with_effect, without in pairs
    ]
    return float(np.sqrt(np.sum(squares)))


def strain_sd(strain: FloatArray) -> FloatArray:
    """Return the standard deviation of the camera's noise."""
    return _SD + _RELATIVE_SD * np.abs(strain)
