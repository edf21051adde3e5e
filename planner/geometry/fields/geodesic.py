"""The shortest way through the part from a region."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.geometry.fields.cells import CellValues, cells_of, reached_cells, spread_values
from planner.geometry.fields.ramp import Ramp
from planner.geometry.fields.region import Region
from planner.geometry.kernel import kernel
from planner.geometry.mesh import Mesh

__all__ = ["GeodesicField", "geodesic_field"]

Point = tuple[float, float, float]


@dataclass(frozen=True)
class GeodesicField:
    """Lengths of shortest ways within the part, on cells (fast sweeping, Zhao 2005).

    Lengths are too long by about a cell, and a few per cent beyond corners; the error falls with
    the cells a little slower than at first order.

    Attributes
    ----------
    start
        Where ways begin.
    ramp
        Lengths at which the gradient starts and ends.
    pitch_mm
        Of the cells.
    cells
        Lengths in mm.
    """

    start: Region
    ramp: Ramp
    pitch_mm: float
    cells: CellValues = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "geodesic"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        return self.ramp.share(self.cells.at(points_mm))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {
            "name": self.name,
            "start": self.start.description(),
            "cells_mm": self.pitch_mm,
            **self.ramp.lengths(),
        }


def geodesic_field(
    mesh: Mesh,
    start: Region,
    pitch_mm: float,
    from_mm: float | None = None,
    to_mm: float | None = None,
    origin_mm: Point = (0.0, 0.0, 0.0),
) -> GeodesicField:
    """Measure the ways from a region of a part to all of it.

    Messages give places as seen from `origin_mm`: where the part's own origin lies.

    Raises
    ------
    ArgumentError
        The region holds nothing of the part, or a body of the part cannot be reached from it.
    """
    grid, inside = cells_of(mesh, pitch_mm)
    index = np.argwhere(inside)
    held = start.holds(grid.centre_mm(index))
    if not held.any():
        low, high = (mesh.bounds_mm - origin_mm).round(3).tolist()
        raise ArgumentError(
            f"field geodesic: the region start= holds nothing of the part at {pitch_mm:.3g} mm; "
            f"the part reaches from {low} to {high} mm"
        )
    seeds = np.zeros_like(inside)
    seeds[tuple(index[held].T)] = True
    reached, stray = reached_cells(inside, seeds)
    if stray is not None:
        x, y, z = (grid.centre_mm(stray) - origin_mm).tolist()
        raise ArgumentError(
            f"field geodesic: no way leads from start= to ({x:.4g}, {y:.4g}, {z:.4g}) mm within "
            "the part; name a region in each body, or take a finer --pitch if a wall is thinner "
            "than a cell"
        )
    length = np.full(tuple(n + 2 for n in inside.shape), np.inf)  # a border saves all tests
    length[tuple((index[held] + 1).T)] = 0.0
    blocked = np.pad(~reached, 1, constant_values=True)
    _sweep(length, blocked, pitch_mm)
    cells = length[1:-1, 1:-1, 1:-1].copy()
    ramp = Ramp(
        0.0 if from_mm is None else from_mm,
        float(cells[reached].max()) if to_mm is None else to_mm,
    )
    spread_values(cells, reached)
    return GeodesicField(start, ramp, pitch_mm, CellValues(grid, cells))


@kernel
def _sweep(length: Any, blocked: Any, pitch: Any) -> None:
    nx, ny, nz = length.shape
    for _ in range(200):
        change = 0.0
        for way in range(8):
            for i0 in range(1, nx - 1):
                i = i0 if way & 1 else nx - 1 - i0
                for j0 in range(1, ny - 1):
                    j = j0 if way & 2 else ny - 1 - j0
                    for k0 in range(1, nz - 1):
                        k = k0 if way & 4 else nz - 1 - k0
                        if blocked[i, j, k] or length[i, j, k] == 0.0:
                            continue
                        a = min(length[i - 1, j, k], length[i + 1, j, k])
                        b = min(length[i, j - 1, k], length[i, j + 1, k])
                        c = min(length[i, j, k - 1], length[i, j, k + 1])
                        a, b = min(a, b), max(a, b)
                        b, c = min(b, c), max(b, c)
                        a, b = min(a, b), max(a, b)
                        found = a + pitch
                        if found > b:
                            under = 2.0 * pitch * pitch - (a - b) ** 2
                            found = 0.5 * (a + b + np.sqrt(max(under, 0.0)))
                            if found > c:
                                total = a + b + c
                                under = total * total - 3.0 * (a * a + b * b + c * c - pitch**2)
                                found = (total + np.sqrt(max(under, 0.0))) / 3.0
                        if found < length[i, j, k]:
                            if length[i, j, k] == np.inf:
                                change = np.inf
                            else:
                                change = max(change, length[i, j, k] - found)
                            length[i, j, k] = found
        if change <= 1e-9 * pitch:
            return
