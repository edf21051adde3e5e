"""What a palette's laws cannot follow, and what a camera does to strains: further nuisances.

A law of a few parameters follows its tests to about 1 %, with an error that has a course in
strain. A camera's facets average over a length that nobody states, and lie a little to the side.
"""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.campaign import Campaign
from planner.gap.features.table import BRANCHES, FeatureTable

__all__ = ["course_columns", "field_columns"]

COURSE_SD = 0.02
"""Of the logarithm of stress: the misfit of a law along its curve."""

FIELD_SD = 0.012
"""Of the logarithm of a local strain: the same, seen along a bar."""

FACET_SHARE = 0.6
"""Standard deviation of the facets' averaging and of their place, in bins of the strain field."""

_FIELD = BRANCHES.index("field")
_DECAYS = (0.01, 0.03, 0.09, 0.27)


def course_columns(campaign: Campaign, table: FeatureTable, sensitivity: FloatArray) -> FloatArray:
    """Return, of each material and each bar's design, courses in strain, (N, q)."""
    names = [
        s.material if s.profile is None else f"bar {s.profile.name}" for s in campaign.specimens
    ]
    force = np.where(table.branch == _FIELD, 0.0, sensitivity)
    # Laws of one family miss the same bends, whatever the material.
    columns = [COURSE_SD * force * np.exp(-table.strain / decay) for decay in _DECAYS]
    for name in dict.fromkeys(names):
        of_it = force * np.array([n == name for n in names])[table.specimen]
        columns += [COURSE_SD * of_it * np.exp(-table.strain / decay) for decay in _DECAYS]
    return np.stack(columns, axis=1)


def field_columns(
    table: FeatureTable, unpredicted: FloatArray, sensitivity: FloatArray
) -> FloatArray:
    """Return what facets and laws do to local strains, (N, q)."""
    field = np.flatnonzero(table.branch == _FIELD)
    if not len(field):
        return np.zeros((len(table), 0))
    blur = np.zeros((len(table), 1))
    shifts, places = [], []
    key = table.specimen[field] * 1000 + table.step[field]
    for value in np.unique(key).tolist():
        rows = field[key == value]
        strain = unpredicted[rows]
        scale = FACET_SHARE * sensitivity[rows] / np.maximum(np.abs(strain), 1e-9)
        padded = np.concatenate([strain[:1], strain, strain[-1:]])
        blur[rows, 0] = FACET_SHARE * scale * (padded[2:] - 2.0 * strain + padded[:-2])
        shift = np.zeros(len(table))
        shift[rows] = 0.5 * scale * (padded[2:] - padded[:-2])
        shifts.append((int(table.specimen[rows[0]]), shift))
    by_specimen: dict[int, FloatArray] = {}
    for specimen, shift in shifts:
        by_specimen[specimen] = by_specimen.get(specimen, 0.0) + shift
    for test in np.unique(table.test[field]).tolist():
        rows = field[table.test[field] == test]
        for x in np.unique(np.round(table.x_mm[rows], 6)).tolist():
            column = np.zeros(len(table))
            here = rows[np.abs(table.x_mm[rows] - x) < 1e-3]
            column[here] = FIELD_SD * sensitivity[here]
            places.append(column)
    return np.stack([blur[:, 0], *by_specimen.values(), *places], axis=1)
