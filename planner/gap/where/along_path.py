"""What a gap that goes with the branch of the path, or with the time of a hold, looks like."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.where.shapes import strain_place, strain_shapes
from planner.gap.where.whitening import Whitening, orthonormal

__all__ = ["branch_basis", "hold_place", "hold_time_basis", "later_branches"]

_HOLD = BRANCHES.index("hold")


def later_branches(table: FeatureTable) -> tuple[int, ...]:
    """Return the branches of forces, other than the first loading, that were measured."""
    return tuple(
        k for k, name in enumerate(BRANCHES)
        if name not in ("loading", "field") and np.any(table.branch == k)
    )  # fmt: skip


def branch_basis(table: FeatureTable, whitening: Whitening, common: FloatArray) -> FloatArray:
    """Return a level of every later branch, and a slope over strain where strain varies, (N, k)."""
    level = strain_shapes(table)[:, 0]
    u = strain_place(table)
    columns = []
    for branch in later_branches(table):
        of_branch = np.where(table.branch == branch, level, 0.0)
        columns.append(of_branch)
        if branch != _HOLD:
            columns.append(of_branch * u)
    return _made(columns, table, whitening, common)


def hold_time_basis(table: FeatureTable, whitening: Whitening, common: FloatArray) -> FloatArray:
    """Return a level, a slope and a bend over the logarithm of the time of a hold, (N, k)."""
    hold = table.branch == _HOLD
    if not hold.any():
        return np.zeros((len(table), 0))
    level = np.where(hold, strain_shapes(table)[:, 0], 0.0)
    w = hold_place(table)
    return _made([level, level * w, level * w**2], table, whitening, common)


def hold_place(table: FeatureTable) -> FloatArray:
    """Return the logarithm of the time of a hold, 0 at the shortest and 1 at the longest, (N,)."""
    hold = table.branch == _HOLD
    log = np.log(np.maximum(table.time_s, 1e-3))
    low, high = float(log[hold].min()), float(log[hold].max())
    place: FloatArray = np.where(hold, (log - low) / max(high - low, 1e-9), 0.0)
    return place


def _made(
    columns: list[FloatArray], table: FeatureTable, whitening: Whitening, common: FloatArray
) -> FloatArray:
    if not columns:
        return np.zeros((len(table), 0))
    return orthonormal(whitening(np.stack(columns, axis=1)), besides=common)
