"""The field of a steady flow between two regions: gradients that follow a bent part."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.errors import ArgumentError
from planner.geometry.fields.cells import CellValues, cells_of, reached_cells, spread_values
from planner.geometry.fields.region import Region
from planner.geometry.kernel import kernel
from planner.geometry.mesh import Mesh

__all__ = ["HarmonicField", "harmonic_field", "solve_laplace"]

Point = tuple[float, float, float]

_COARSEST = 20_000  # cells; below, nothing is gained by a coarser grid
_PRECISION = 1e-7  # of the field's range, root mean square of the residual


@dataclass(frozen=True)
class HarmonicField:
    """Solution of Laplace's equation in the part: 0 in one region, 1 in another.

    No flow leaves through the rest of the surface. The surface is one of cells, so a level lies
    within about a cell of the true one, and falls with the cells at first order.

    Attributes
    ----------
    start, end
        Where it is 0, and where 1.
    pitch_mm
        Of the cells.
    cells
        The solution.
    """

    start: Region
    end: Region
    pitch_mm: float
    cells: CellValues = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "harmonic"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return self.cells.at(points_mm)

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name,
            "from": self.start.description(),
            "to": self.end.description(),
            "cells_mm": self.pitch_mm,
        }


def harmonic_field(
    mesh: Mesh, start: Region, end: Region, pitch_mm: float, origin_mm: Point = (0.0, 0.0, 0.0)
) -> HarmonicField:
    """Solve for the field between two regions of a part.

    Messages give places as seen from `origin_mm`: where the part's own origin lies.

    Raises
    ------
    ArgumentError
        A region that holds no cell of the part, regions that share one, or a body of the part
        that has none of either.
    """
    grid, inside = cells_of(mesh, pitch_mm)
    index = np.argwhere(inside)
    centres = grid.centre_mm(index)
    first, second = start.holds(centres), end.holds(centres)
    for which, held in (("from", first), ("to", second)):
        if not held.any():
            raise ArgumentError(
                f"field harmonic: the region {which}= holds nothing of the part at {pitch_mm:.3g} "
                f"mm; the part reaches {_box(mesh, origin_mm)}"
            )
    if (first & second).any():
        x, y, z = (centres[int(np.argmax(first & second))] - origin_mm).tolist()
        raise ArgumentError(
            f"field harmonic: the regions from= and to= share ({x:.4g}, {y:.4g}, {z:.4g}) mm; "
            "they must lie apart"
        )
    fixed = np.full(inside.shape, np.nan)
    fixed[tuple(index[first].T)], fixed[tuple(index[second].T)] = 0.0, 1.0
    reached, lost = reached_cells(inside, np.isfinite(fixed))
    if lost is not None:
        x, y, z = (grid.centre_mm(lost) - origin_mm).tolist()
        raise ArgumentError(
            f"field harmonic: the body at ({x:.4g}, {y:.4g}, {z:.4g}) mm touches neither region; "
            "name a region in each body, or take a finer --pitch if a wall is thinner than a cell"
        )
    values = solve_laplace(reached, fixed)
    spread_values(values, reached)
    return HarmonicField(start, end, pitch_mm, CellValues(grid, values))


def _box(mesh: Mesh, origin_mm: Point) -> str:
    low, high = mesh.bounds_mm - origin_mm
    return " to ".join(f"({p[0]:.4g}, {p[1]:.4g}, {p[2]:.4g})" for p in (low, high)) + " mm"


def solve_laplace(inside: BoolArray, fixed: FloatArray) -> FloatArray:
    """Solve Laplace's equation on cells, (nx, ny, nz); NaN outside.

    Conjugate gradients with the diagonal as preconditioner, started from the solution on cells
    twice as large.

    Parameters
    ----------
    inside
        Cells to solve on; no flow leaves them.
    fixed
        Given values, NaN elsewhere.
    """
    guess = np.full(inside.shape, 0.5)
    if np.count_nonzero(inside) > _COARSEST:
        guess = _from_coarser(inside, fixed)
    number = np.full(inside.shape, -1, dtype=np.int32)
    index = np.flatnonzero(inside)
    number.reshape(-1)[index] = np.arange(len(index), dtype=np.int32)
    neighbours = np.full((len(index), 6), -1, dtype=np.int32)
    padded = np.pad(number, 1, constant_values=-1)
    place = np.stack(np.unravel_index(index, inside.shape), axis=1) + 1
    for way in range(6):
        step = np.zeros(3, dtype=np.int64)
        step[way % 3] = 1 if way < 3 else -1
        neighbours[:, way] = padded[tuple((place + step).T)]
    given = fixed.reshape(-1)[index]
    free = np.isnan(given)
    x = np.where(free, guess.reshape(-1)[index], given)
    _conjugate_gradients(neighbours, free, x, np.empty((4, len(x))), _PRECISION)
    values = np.full(inside.shape, np.nan)
    values.reshape(-1)[index] = np.clip(x, np.nanmin(given), np.nanmax(given))
    return values


def _from_coarser(inside: BoolArray, fixed: FloatArray) -> FloatArray:
    """Solve on cells twice as large: inside where any of the eight is, fixed by their mean."""
    shape = tuple((n + 1) // 2 for n in inside.shape)
    room = [(0, 2 * m - n) for m, n in zip(shape, inside.shape, strict=True)]
    blocks = (shape[0], 2, shape[1], 2, shape[2], 2)
    any_inside: BoolArray = np.asarray(np.pad(inside, room).reshape(blocks).any(axis=(1, 3, 5)))
    known = np.pad(np.isfinite(fixed), room).reshape(blocks).sum(axis=(1, 3, 5))
    total = np.pad(np.nan_to_num(fixed), room).reshape(blocks).sum(axis=(1, 3, 5))
    with np.errstate(invalid="ignore"):
        coarse = solve_laplace(
            any_inside, np.where(known > 0, total / np.maximum(known, 1), np.nan)
        )
    spread_values(coarse, any_inside, 1)
    from scipy import ndimage

    x, y, z = (
        np.clip((np.arange(n) - 0.5) / 2.0, 0.0, m - 1.0)
        for n, m in zip(inside.shape, shape, strict=True)
    )
    found = np.empty(inside.shape)
    for i, at in enumerate(x):  # layer by layer, to save memory
        where = np.meshgrid([at], y, z, indexing="ij")
        found[i] = ndimage.map_coordinates(coarse, where, order=1, mode="nearest")[0]
    return found


@kernel
def _conjugate_gradients(neighbours: Any, free: Any, x: Any, work: Any, precision: Any) -> Any:
    """Improve `x` at free cells until the residual falls below the precision; return the steps.

    `work` holds the residual, the way to go, its image, and one over the number of neighbours,
    which is 0 for cells that do not move.
    """
    n = x.size
    residual, way, image, inverse = work[0], work[1], work[2], work[3]
    energy, unknowns = 0.0, 0
    for i in range(n):
        residual[i] = way[i] = inverse[i] = 0.0
        if not free[i]:
            continue
        total, count = 0.0, 0
        for m in range(6):
            j = neighbours[i, m]
            if j >= 0:
                total += x[j] - x[i]
                count += 1
        if count > 0:
            unknowns += 1
            inverse[i] = 1.0 / count
            residual[i] = total
            way[i] = total * inverse[i]
            energy += total * way[i]
    enough = precision * precision * unknowns
    for step in range(20000):
        if energy <= enough:
            return step
        curvature = 0.0
        for i in range(n):
            if inverse[i] > 0.0:
                own, total = way[i], 0.0
                for m in range(6):
                    j = neighbours[i, m]
                    if j >= 0:
                        total += own - way[j]
                image[i] = total
                curvature += own * total
        if curvature <= 0.0:
            return step
        length = energy / curvature
        fresh = 0.0
        for i in range(n):
            if inverse[i] > 0.0:
                x[i] += length * way[i]
                residual[i] -= length * image[i]
                fresh += residual[i] * residual[i] * inverse[i]
        turn = fresh / energy
        energy = fresh
        for i in range(n):
            way[i] = residual[i] * inverse[i] + turn * way[i]
    return 20000
