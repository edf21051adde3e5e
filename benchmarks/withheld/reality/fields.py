"""Strain along the graded bars, as a camera would see it: averaged over its facets."""

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.bench import Bench, FloatArray

__all__ = ["FIELD_POINTS", "FIELD_ROWS", "measured_strain"]

FIELD_ROWS = np.arange(15, 121, 15)
FIELD_POINTS = 28
_FACET_MM = 1.2
_SD = 0.0015
_RELATIVE_SD = 0.01


def measured_strain(
    bench: Bench, strain: FloatArray, rng: np.random.Generator
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return the rows, the positions (mm) and the strains (S, rows, positions) of the camera."""
    length = bench.design.gauge_mm
    positions = np.array([np.linspace(_FACET_MM, end - _FACET_MM, FIELD_POINTS) for end in length])
    positions = np.round(positions, 3)
    edges = bench.edges_mm
    seen = np.zeros((len(length), len(FIELD_ROWS), FIELD_POINTS))
    for i in range(len(length)):
        for k, row in enumerate(FIELD_ROWS):
            moved = np.append(0.0, np.cumsum(strain[i, row] * np.diff(edges[i])))
            ends = positions[i] + np.array([[-0.5], [0.5]]) * _FACET_MM
            seen[i, k] = np.diff(np.interp(ends, edges[i], moved), axis=0)[0] / _FACET_MM
    noise = rng.normal(size=seen.shape) * (_SD + _RELATIVE_SD * np.abs(seen))
    return FIELD_ROWS, positions, np.round(seen + noise, 5)
