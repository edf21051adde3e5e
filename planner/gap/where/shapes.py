"""The shapes over strain that a gap is looked for in: a level, a slope and a bend."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.features.table import FeatureTable

__all__ = ["field_level", "strain_place", "strain_shapes"]

SMALLEST_STRAIN = 0.01


def strain_place(table: FeatureTable) -> FloatArray:
    """Return the logarithm of strain, -1 at the table's smallest and 1 at its largest, (N,)."""
    log = np.log(np.maximum(table.strain, 0.0) + SMALLEST_STRAIN)
    low, high = float(log.min()), float(log.max())
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-9)
    place: FloatArray = (log - middle) / half
    return place


def strain_shapes(table: FeatureTable) -> FloatArray:
    """Return level, slope and bend of the forces' logarithm over log strain, (N, 3).

    Legendre's polynomials times the sensitivity, so that a gap in per cent is one.
    """
    u = strain_place(table)
    h = np.where(table.is_field, 0.0, table.sensitivity(table.measured_raw))
    return np.stack([h, h * u, h * (1.5 * u**2 - 0.5)], axis=1)


def field_level(table: FeatureTable) -> FloatArray:
    """Return what all local strains being off by one factor looks like, (N,)."""
    return np.where(table.is_field, table.sensitivity(table.measured_raw), 0.0)
