"""Cells of a column dealt anew to specimens.

Whole specimens are dealt, never single figures. Without a gap all of them are alike but for
noise, replicates too, so any of them may trade places. In a column that varies within batches
they trade places within a batch only, provided that leaves enough arrangements, so that batches
cannot pass for the column.
"""

import math

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.where.columns import Column

__all__ = ["dealt", "seen_by_chance", "varies_within"]

ENOUGH = 2000.0
"""Arrangements within batches, that those alone are dealt."""


def varies_within(column: Column, batch: IntArray) -> bool:
    """Return whether a column varies enough within batches to be dealt within them."""
    return _log_arrangements(column, batch) > math.log(ENOUGH)


def seen_by_chance(column: Column, batch: IntArray | None) -> float:
    """Return the chance of dealing the very cells that are seen, or the like of them.

    Levels of as many specimens may change names; of numbers along a course, both ends may.
    """
    alone = np.zeros(len(column.level), dtype=np.intp)
    log = _log_arrangements(column, alone if batch is None else batch)
    sizes = np.bincount(column.level[column.known])
    sizes = sizes[sizes > 0]
    if column.coordinates.shape[1] == len(sizes) - 1:
        log -= sum(math.lgamma(c + 1) for c in np.bincount(sizes).tolist())
    else:
        log -= math.log(2.0)
    return min(1.0, math.exp(-log))


def dealt(keys: FloatArray, column: Column, batch: IntArray | None) -> IntArray:
    """Return whose cell each known specimen is dealt in each draw, (P, n known).

    Parameters
    ----------
    keys : (P, n)
        Uniform on 0 to 1.
    batch
        Number of each specimen's batch, to deal within batches only.
    """
    drawn = keys[:, column.known]
    if batch is None:
        return np.argsort(drawn, axis=1)
    number = batch[column.known]
    places = np.empty(drawn.shape, dtype=np.intp)
    places[:, np.argsort(number, kind="stable")] = np.argsort(drawn + 2.0 * number, axis=1)
    return places


def _log_arrangements(column: Column, batch: IntArray) -> float:
    log = 0.0
    for number in np.unique(batch[column.known]):
        level = column.level[column.known & (batch == number)]
        log += math.lgamma(len(level) + 1)
        log -= sum(math.lgamma(c + 1) for c in np.bincount(level).tolist())
    return log
