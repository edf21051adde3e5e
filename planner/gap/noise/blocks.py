"""Covariance of each specimen's own figures, and what specimens of a batch share."""

import itertools
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.noise.scatter import Scatter

__all__ = ["SpecimenNoise", "place_on_path", "specimen_block", "specimen_noise"]

MODEL_SD = 0.003
"""No prediction is truer than this: of discretisation and of reading a curve at a place."""

_FIELD = BRANCHES.index("field")
_ORDER = {"loading": 0.0, "unloading": 1.0, "reloading": 2.0, "hold": 1.0, "field": 0.0}


@dataclass(frozen=True, slots=True, eq=False)
class SpecimenNoise:
    """Noise of N figures.

    Attributes
    ----------
    rows
        Slices of the table's rows, one a specimen.
    blocks
        Covariance of each specimen's rows, (d, d).
    factors
        Their lower Cholesky factors.
    batch : (N, batches)
        What specimens of one batch share, a column of prior deviation 1 a batch; no column where
        batches are unknown or all the same.
    """

    rows: tuple[slice, ...]
    blocks: tuple[FloatArray, ...]
    factors: tuple[FloatArray, ...]
    batch: FloatArray


def specimen_noise(
    table: FeatureTable,
    sensitivity: FloatArray,
    scatter: Scatter,
    sensor_sd_N: FloatArray,
    batch_of: IntArray,
    path: FloatArray,
) -> SpecimenNoise:
    """Return the noise of a campaign's figures.

    Parameters
    ----------
    sensitivity : (N,)
        Of the transformed figures by the logarithm of force or strain.
    sensor_sd_N : (n,)
        Of each specimen's force.
    batch_of : (n,)
        Number of each specimen's batch, -1 where unknown.
    path : (N,)
        See `place_on_path`.
    """
    rows = _rows(table)
    blocks = tuple(specimen_block(table, sensitivity, scatter, sensor_sd_N, path, r) for r in rows)
    batches = sorted(set(batch_of.tolist()) - {-1})
    columns = np.zeros((len(table), len(batches) if len(batches) > 1 else 0))
    for column, number in enumerate(batches[: columns.shape[1]]):
        of_batch = (batch_of[table.specimen] == number) & (table.branch != _FIELD)
        columns[of_batch, column] = scatter.batch * sensitivity[of_batch]
    factors: tuple[FloatArray, ...] = tuple(
        np.asarray(np.linalg.cholesky(block)) for block in blocks
    )
    return SpecimenNoise(rows, blocks, factors, columns)


def place_on_path(table: FeatureTable, last_step: int) -> FloatArray:
    """Return how far along its test's path each figure was read, 0 to 1."""
    path: FloatArray = table.step / float(last_step)
    return path


def _rows(table: FeatureTable) -> tuple[slice, ...]:
    edges = np.flatnonzero(np.diff(table.specimen)) + 1
    bounds = [0, *edges.tolist(), len(table)]
    return tuple(slice(a, b) for a, b in itertools.pairwise(bounds))


def specimen_block(
    table: FeatureTable,
    sensitivity: FloatArray,
    scatter: Scatter,
    sensor_sd_N: FloatArray,
    path: FloatArray,
    rows: slice,
) -> FloatArray:
    """Return the covariance of one specimen's rows, (d, d)."""
    force = table.branch[rows] != _FIELD
    h = np.where(force, sensitivity[rows], 0.0)
    place = path[rows]
    strain = table.strain[rows]
    travel = strain / max(float(strain.max()), 1e-12)
    tilt = h * (travel - 0.5)
    far = np.abs(np.subtract.outer(place, place)) / scatter.wander_length
    block = scatter.specimen**2 * np.outer(h, h) + scatter.slope**2 * np.outer(tilt, tilt)
    block += scatter.wander**2 * np.exp(-far) * np.outer(h, h)
    floor = table.floor[rows]
    # The derivative of asinh(F / 2 s) by F, where F = 2 s sinh(y): 1 / (2 s cosh y).
    by_raw = np.sqrt(np.maximum(1.0 - sensitivity[rows] ** 2, 1e-8)) / (2.0 * floor)
    own = np.where(
        force,
        scatter.sensor * sensor_sd_N[table.specimen[rows]] * by_raw,
        np.hypot(scatter.field * by_raw, scatter.field_relative * sensitivity[rows]),
    )
    block[np.diag_indices(len(h))] += own**2 + MODEL_SD**2
    return block
