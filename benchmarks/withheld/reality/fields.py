"""Strain along the graded bars, as a camera would see it: averaged over its facets."""

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.bench import Bench, FloatArray

__all__ = ["FIELD_POINTS", "FIELD_ROWS", "field_detectability", "measured_strain"]

FIELD_ROWS = np.arange(15, 121, 15)
FIELD_POINTS = 28
_FACET_MM = 1.2
_SD = 0.0015
_RELATIVE_SD = 0.01


def measured_strain(
    bench: Bench, strain: FloatArray, rng: np.random.Generator
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return the rows, the positions (mm) and the strains (S, rows, positions) of the camera."""
    positions = _positions_mm(bench)
    seen = _facet_strain(bench, strain, positions)
    noise = rng.normal(size=seen.shape) * _sd(seen)
    return FIELD_ROWS, positions, np.round(seen + noise, 5)


def field_detectability(bench: Bench, strain: FloatArray, plain: FloatArray) -> float:
    """Return how many standard errors the camera's strains lie from those without an effect."""
    positions = _positions_mm(bench)
    with_effect, without = (_facet_strain(bench, e, positions) for e in (strain, plain))
    return float(np.sqrt(np.sum(((with_effect - without) / _sd(without)) ** 2)))


def _positions_mm(bench: Bench) -> FloatArray:
    """Return the facets' middles, from one facet inside either end."""
    length = bench.design.gauge_mm
    spaced = [np.linspace(_FACET_MM, end - _FACET_MM, FIELD_POINTS) for end in length]
    return np.round(np.array(spaced), 3)


def _facet_strain(bench: Bench, strain: FloatArray, positions: FloatArray) -> FloatArray:
    seen = np.zeros((len(positions), len(FIELD_ROWS), FIELD_POINTS))
    for i, edges in enumerate(bench.edges_mm):
        ends = positions[i] + np.array([[-0.5], [0.5]]) * _FACET_MM
        for k, row in enumerate(FIELD_ROWS):
            moved = np.append(0.0, np.cumsum(strain[i, row] * np.diff(edges)))
            seen[i, k] = np.diff(np.interp(ends, edges, moved), axis=0)[0] / _FACET_MM
    return seen


def _sd(strain: FloatArray) -> FloatArray:
    return _SD + _RELATIVE_SD * np.abs(strain)
