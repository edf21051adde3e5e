"""Values at the cells of a grid that lie in the part, as a field."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.geometry.columns import Grid, dense, grid_for, voxelize
from planner.geometry.kernel import kernel
from planner.geometry.mesh import Mesh

__all__ = [
    "MOST_CELLS",
    "CellValues",
    "cells_of",
    "reached_cells",
    "solve_pitch_mm",
    "spread_values",
]

MOST_CELLS = 3_000_000
"""Of the part's box, for what is solved over all of it."""

_CRUMB = 1e-3  # of all cells


@dataclass(frozen=True, eq=False)
class CellValues:
    """Values at cell centres, linear between them along each axis.

    Attributes
    ----------
    grid
        Where cells lie.
    values : (nx, ny, nz) float64
        One for each cell.
    """

    grid: Grid
    values: FloatArray

    def at(self, points_mm: FloatArray) -> FloatArray:
        """Interpolate at points (n, 3); beyond the outermost centres as at them."""
        found = np.empty(len(points_mm))
        _interpolate(
            np.require(points_mm, np.float64, ["C", "W"]), np.array(self.grid.origin_mm),
            np.array(self.grid.pitch_mm), self.values, found,
        )  # fmt: skip
        return found


def solve_pitch_mm(mesh: Mesh, pitch_mm: float) -> float:
    """Return the pitch to solve at: that of the shells, or as fine as `MOST_CELLS` allow."""
    extent_mm = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    return max(pitch_mm, float(np.cbrt(extent_mm.prod() / MOST_CELLS)))


def cells_of(mesh: Mesh, pitch_mm: float) -> tuple[Grid, BoolArray]:
    """Return a grid over the part and which of its cells (nx, ny, nz) have their centre in it.

    Walls thinner than a cell keep one cell along z.
    """
    grid = grid_for(mesh.bounds_mm, pitch_mm)
    return grid, np.ascontiguousarray(dense(voxelize(mesh, pitch_mm, shortest=1)))


def reached_cells(inside: BoolArray, seeds: BoolArray) -> tuple[BoolArray, IntArray | None]:
    """Keep the cells that are connected to seeds.

    Returns
    -------
    reached : (nx, ny, nz) bool
        Without crumbs: a few cells at a corner that touch no other.
    lost : (3,) int or None
        A cell of the largest body without a seed, where that is more than a crumb.
    """
    from scipy import ndimage

    body, bodies = ndimage.label(inside)
    size = np.bincount(body.ravel(), minlength=bodies + 1)
    known = np.zeros(bodies + 1, dtype=np.bool_)
    known[body[seeds]] = True
    known[0] = False
    size[known] = 0
    size[0] = 0
    worst = int(np.argmax(size))
    if size[worst] > _CRUMB * np.count_nonzero(inside):
        return inside, np.argwhere(body == worst)[0]
    return np.asarray(known[body]), None


def spread_values(values: FloatArray, known: BoolArray, layers: int = 3) -> None:
    """Continue values, in place, into a few layers of cells around those that are known.

    Each new cell takes the mean of its known neighbours; what lies farther takes the mean of all.
    """
    mean = float(values[known].mean())
    state = known.astype(np.uint8)
    _spread(values, state, layers)
    values[state == 0] = mean


@kernel
def _spread(values: Any, state: Any, layers: Any) -> None:
    nx, ny, nz = values.shape
    for layer in range(2, layers + 2):
        for i in range(nx):
            for j in range(ny):
                for k in range(nz):
                    if state[i, j, k] != 0:
                        continue
                    total, count = 0.0, 0
                    for a in range(max(i - 1, 0), min(i + 2, nx)):
                        for b in range(max(j - 1, 0), min(j + 2, ny)):
                            for c in range(max(k - 1, 0), min(k + 2, nz)):
                                if state[a, b, c] != 0 and state[a, b, c] < layer:
                                    total += values[a, b, c]
                                    count += 1
                    if count > 0:
                        values[i, j, k] = total / count
                        state[i, j, k] = layer


@kernel
def _interpolate(points: Any, origin: Any, pitch: Any, values: Any, found: Any) -> None:
    cell, share = np.empty(3, dtype=np.int64), np.empty(3)
    for p in range(points.shape[0]):
        for d in range(3):
            at = (points[p, d] - origin[d]) / pitch[d] - 0.5
            at = min(max(at, 0.0), float(values.shape[d] - 1))
            cell[d] = min(int(at), max(values.shape[d] - 2, 0))
            share[d] = at - cell[d]
        total = 0.0
        for corner in range(8):
            weight = 1.0
            i, j, k = cell[0], cell[1], cell[2]
            if corner & 1:
                weight *= share[0]
                i = min(i + 1, values.shape[0] - 1)
            else:
                weight *= 1.0 - share[0]
            if corner & 2:
                weight *= share[1]
                j = min(j + 1, values.shape[1] - 1)
            else:
                weight *= 1.0 - share[1]
            if corner & 4:
                weight *= share[2]
                k = min(k + 1, values.shape[2] - 1)
            else:
                weight *= 1.0 - share[2]
            total += weight * values[i, j, k]
        found[p] = total
