"""The material of a part as columns, cut into segments by the faces of a lattice of cells."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import MeshError
from planner.mesh.mesh import Mesh
from planner.numerics import FloatArray, inner_kernel, kernel
from planner.voxels.columns import MOST_VOXELS, Columns, Grid, iterate_columns, join

__all__ = ["SampledMaterial", "column_place", "sample"]


# Material is sampled by exact columns along z, on a square lattice turned about z by an angle
# whose tangent, the golden ratio, is badly approximable: walls along x or y then gain and lose
# columns evenly, where a lattice along the walls would misjudge all of them by the same share of
# a pitch. A column belongs to the cell that its place is in, and stands for an equal share of that
# cell's footprint, so that full cells are exact. Along z runs end within 1/16384 of the part's
# height. What is exact from there on is exact for this sampled material: the moments of a piece
# converge with the spacing of columns, faster than its first power.


@dataclass(frozen=True, eq=False)
class SampledMaterial:
    """Columns of material, cut into segments by the cells' faces.

    Attributes
    ----------
    columns
        In the turned frame; z in steps of which each cell has `voxels`.
    counts
        Cells along x, y, z.
    voxels
        Steps along z in a cell.
    frame : (9,)
        u and v of the first column, spacing, cosine and sine of the turn, and the scale
        of x and y in cells a mm; u, v and x, y are from the part's lower corner.
    foot : (columns,) int32
        Footprint each column stands in, ``i counts[1] + j``; -1 outside the bounding box.
    per_foot : (footprints,) int64
        Columns that stand in each.
    first : (runs,) int64
        First segment of each run; the others follow upwards, one a cell.
    shell : (runs,) int32
        Shell that each run is in.
    piece : (segments,) int32
        Cell (of `CutCells`) that each segment belongs to; -1 where it is dropped.
    """

    columns: Columns
    counts: tuple[int, ...]
    voxels: int
    frame: FloatArray
    foot: NDArray[np.int32]
    per_foot: NDArray[np.int64]
    first: NDArray[np.int64]
    shell: NDArray[np.int32]
    piece: NDArray[np.int32]

    @property
    def lines(self) -> tuple[Any, Any, Any, Any, Any, int, int]:
        """What loops over segments begin with."""
        c = self.columns
        return (c.offsets, c.start, c.stop, self.first, self.foot, c.grid.shape[0], self.voxels)


def sample(
    shells: Sequence[Mesh], low: FloatArray, extent: FloatArray, cells: tuple[int, ...], across: int
) -> SampledMaterial:
    """Sample closed surfaces that may touch, and do not overlap.

    Parameters
    ----------
    low, extent
        Lower corner and edges of the box that is divided into cells.
    cells
        How many along x, y, z.
    across
        Columns along the shorter of the edges of a cell along x and y.

    Raises
    ------
    MeshError
        A surface is open.
    """
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    cos, sin = 1.0 / np.sqrt(1.0 + golden**2), golden / np.sqrt(1.0 + golden**2)
    size = extent / cells
    pitch = float(min(size[:2])) / across
    # the lattice covers the turned bounding box, so that all footprints are whole
    u = (0.0, cos * extent[0] + sin * extent[1])
    v = (-sin * extent[0], cos * extent[1])
    nu, nv = (int(np.ceil((b - a) / pitch)) for a, b in (u, v))
    voxels = (MOST_VOXELS - 1) // cells[2]
    grid = Grid((u[0], v[0], 0.0), (pitch, pitch, size[2] / voxels), (nu, nv, voxels * cells[2]))
    sampled = []
    for mesh in shells:
        x, y, z = (mesh.vertices - low).T
        turned = Mesh(np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=1), mesh.faces)
        sampled.append(join(list(iterate_columns(turned, grid))))
        if faults := sampled[-1].faults.open_columns:
            raise MeshError(
                f"the surface is open: {faults} lines along z go in and do not "
                "come out, or come out twice; repair the part first"
            )
    columns, shell = _together(sampled)
    frame = np.array(
        [u[0] + pitch / 2, v[0] + pitch / 2, pitch, cos, sin, 1.0 / size[0], 1.0 / size[1]]
    )
    foot = np.empty(nu * nv, np.int32)
    _find_feet(frame, nu, cells[0], cells[1], foot)
    runs = np.diff(columns.offsets)
    reach = (columns.stop - 1) // voxels - columns.start // voxels + 1
    reach[np.repeat(foot < 0, runs)] = 0
    first = np.append(0, np.cumsum(reach, dtype=np.int64))
    piece = np.arange(first[-1], dtype=np.int32)
    per_foot = np.bincount(foot[foot >= 0], minlength=cells[0] * cells[1])
    return SampledMaterial(columns, cells, voxels, frame, foot, per_foot, first[:-1], shell, piece)


def _together(sampled: Sequence[Columns]) -> tuple[Columns, NDArray[np.int32]]:
    """Return the runs of all shells, rising in each column, and which shell each is of."""
    each = [len(columns.start) for columns in sampled]
    shell = np.repeat(np.arange(len(sampled), dtype=np.int32), each)
    if len(sampled) == 1:
        return sampled[0], shell
    count = len(sampled[0].offsets) - 1
    column = np.concatenate([np.repeat(np.arange(count), np.diff(c.offsets)) for c in sampled])
    start, stop = (np.concatenate([getattr(c, end) for c in sampled]) for end in ("start", "stop"))
    order = np.lexsort((start, column))
    offsets = sum((c.offsets for c in sampled[1:]), sampled[0].offsets)
    grid = sampled[0].grid
    return Columns(grid, 0, offsets, start[order], stop[order]), shell[order]


@inner_kernel
def column_place(frame: Any, nu: Any, c: Any) -> Any:
    """Return x and y of a column, in cells."""
    u, v = frame[0] + (c % nu) * frame[2], frame[1] + (c // nu) * frame[2]
    return (frame[3] * u - frame[4] * v) * frame[5], (frame[4] * u + frame[3] * v) * frame[6]


@kernel
def _find_feet(frame: Any, nu: Any, cells_x: Any, cells_y: Any, foot: Any) -> None:
    for c in range(foot.size):
        x, y = column_place(frame, nu, c)
        i, j = int(np.floor(x)), int(np.floor(y))
        foot[c] = i * cells_y + j if 0 <= i < cells_x and 0 <= j < cells_y else -1
