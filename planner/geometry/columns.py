"""A mesh as columns of voxels: for each column of a grid, the runs along z that lie inside.

A voxel is inside when the winding number of its centre is positive, so overlapping bodies
unite and cavities stay empty. Runs take memory by the surface, not by the volume, and are made
slab by slab (a few rows of columns at a time).

Vertices are rounded to 1/65536 of a voxel (0.6 nm at a pitch of 0.042 mm); from there on every
choice is exact, so a voxel is inside by the mesh and the grid alone, whatever the order of the
triangles or the direction of the walk (`planner.geometry.layer_runs` goes along x). No column is
missed or counted twice, also where vertices lie on voxel centres, and bodies that share a face
share no voxel.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.errors import ArgumentError, MeshError
from planner.geometry.column_kernels import LATTICE, bin_triangles, fill_runs, slab_runs, snap
from planner.geometry.mesh import Mesh

__all__ = [
    "MOST_VOXELS",
    "Columns",
    "Faults",
    "Grid",
    "check_reach",
    "dense",
    "grid_for",
    "iterate_columns",
    "voxelize",
]

MOST_VOXELS = 1 << 14
"""Along an axis of a grid."""

_SLAB_COLUMNS = 1 << 17  # a slab's working arrays stay in the second-level cache


@dataclass(frozen=True)
class Grid:
    """A regular grid of voxels; voxel (i, j, k) is centred at origin + (i + ½, j + ½, k + ½) pitch.

    Attributes
    ----------
    origin_mm, pitch_mm
        Lower corner and edge lengths of a voxel along x, y, z.
    shape
        Voxels along x, y, z.
    """

    origin_mm: tuple[float, float, float]
    pitch_mm: tuple[float, float, float]
    shape: tuple[int, int, int]

    def __post_init__(self) -> None:
        if len(self.pitch_mm) != 3 or not all(0 < p < np.inf for p in self.pitch_mm):
            raise ArgumentError(
                f"pitch is {self.pitch_mm} mm; it must be positive and finite along x, y and z"
            )
        if not all(np.isfinite(self.origin_mm)):
            raise ArgumentError(f"grid origin is {self.origin_mm} mm; it must be finite")
        if not all(0 < n <= MOST_VOXELS for n in self.shape):
            raise ArgumentError(
                f"a pitch of {self.pitch_mm} mm makes a grid of {self.shape} voxels; up to "
                f"{MOST_VOXELS} along an axis are possible: choose a coarser pitch"
            )

    @property
    def voxel_mm3(self) -> float:
        """Volume of a voxel."""
        return float(np.prod(self.pitch_mm))

    def centre_mm(self, voxels: IntArray) -> FloatArray:
        """Return the centres of voxels (..., 3)."""
        origin, pitch = np.array(self.origin_mm), np.array(self.pitch_mm)
        centres: FloatArray = origin + (voxels + 0.5) * pitch
        return centres


@dataclass(frozen=True)
class Faults:
    """Where a mesh is not the surface of a solid.

    Attributes
    ----------
    open_columns
        Columns whose entries and exits do not pair up: the surface is open or a face is flipped.
    inverted_columns
        Columns that leave a body before they enter it: a body is inside out.
    place_mm
        x, y of the first such column (open ones first), or None.
    """

    open_columns: int = 0
    inverted_columns: int = 0
    place_mm: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Columns:
    """Runs of inside voxels along z, for whole rows of a grid.

    Attributes
    ----------
    grid
        The grid the rows belong to.
    first_row
        Index along y of the first row.
    offsets : (columns + 1,) int64
        Column (i, j) is number ``(j - first_row) * nx + i`` and has the runs
        ``offsets[number]`` to ``offsets[number + 1]``.
    start, stop : (runs,) int32
        Each run holds the voxels start <= k < stop; runs of a column rise and do not touch.
    faults
        What these rows say about the mesh.
    """

    grid: Grid
    first_row: int
    offsets: IntArray
    start: IntArray
    stop: IntArray
    faults: Faults = field(default_factory=Faults)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return (len(self.offsets) - 1) // self.grid.shape[0]

    @property
    def voxels(self) -> int:
        """Number of inside voxels."""
        return int(np.sum(self.stop, dtype=np.int64) - np.sum(self.start, dtype=np.int64))

    @property
    def volume_mm3(self) -> float:
        """Volume of the inside voxels."""
        return self.voxels * self.grid.voxel_mm3


def grid_for(bounds_mm: FloatArray, pitch_mm: float | Sequence[float]) -> Grid:
    """Return the grid that covers a box, with a corner at the box's lower corner.

    Parameters
    ----------
    bounds_mm : (2, 3)
        Smallest and largest coordinates.
    pitch_mm
        Edge of a voxel, or one along each axis.

    Raises
    ------
    ArgumentError
        The pitch is not positive, or so fine that an axis has more than 16384 voxels.
    """
    low, high = np.asarray(bounds_mm, dtype=np.float64)
    pitch = np.broadcast_to(np.asarray(pitch_mm, dtype=np.float64), 3)
    with np.errstate(all="ignore"):
        voxels = np.ceil((high - low) / pitch - 0.5 / LATTICE)
    nx, ny, nz = (int(n) if 1 <= n <= 2**31 else 2**31 * int(n > 1) + 1 for n in voxels)
    x, y, z = (float(v) for v in low)
    px, py, pz = (float(p) for p in pitch)
    return Grid((x, y, z), (px, py, pz), (nx, ny, nz))


def iterate_columns(
    mesh: Mesh, grid: Grid, *, slab_rows: int | None = None, shortest: int = 0
) -> Iterator[Columns]:
    """Make columns of a closed mesh, a slab of rows after the other.

    The result does not depend on how rows are cut into slabs. What lies outside the grid is
    left out.

    Parameters
    ----------
    slab_rows
        Rows a slab; by default about 10^5 columns, a few MB.
    shortest
        Lengthen runs of fewer voxels to this many. With 1, sheets thinner than a voxel still
        show in the columns that cross them.

    Raises
    ------
    MeshError
        A vertex is not finite, or lies more than 16384 voxels away from another.
    """
    nx, ny, nz = grid.shape
    rows = max(1, _SLAB_COLUMNS // nx) if slab_rows is None else slab_rows
    if rows < 1:
        raise ArgumentError(f"slab_rows is {slab_rows}; it must be at least 1")
    check_reach(mesh, grid)
    snapped = snap(mesh.vertices, np.asarray(grid.origin_mm), np.asarray(grid.pitch_mm))
    offsets, members, spans = bin_triangles(snapped, mesh.faces, nx, ny, rows)
    for slab, first in enumerate(range(0, ny, rows)):
        ids = members[offsets[slab] : offsets[slab + 1]]
        last = min(first + rows, ny)
        runs = slab_runs(snapped, mesh.faces, ids, int(spans[slab]), first, last, nx, nz, shortest)
        yield Columns(grid, first, *runs[:3], _faults(runs[3], grid, first))


def voxelize(mesh: Mesh, pitch_mm: float | Sequence[float], *, shortest: int = 0) -> Columns:
    """Return all columns of a closed mesh at once, on the grid of `grid_for` its bounds.

    Raises
    ------
    ArgumentError, MeshError
        See `grid_for` and `iterate_columns`.
    """
    grid = grid_for(mesh.bounds_mm, pitch_mm)
    return _join(list(iterate_columns(mesh, grid, shortest=shortest)))


def dense(columns: Columns) -> BoolArray:
    """Return whether each voxel is inside, (nx, rows, nz); one byte a voxel."""
    nx, _, nz = columns.grid.shape
    voxels = np.zeros((len(columns.offsets) - 1, nz), np.uint8)
    fill_runs(columns.offsets, columns.start, columns.stop, voxels)
    return voxels.view(np.bool_).reshape(columns.rows, nx, nz).transpose(1, 0, 2)


def _join(slabs: list[Columns]) -> Columns:
    runs = np.cumsum([0, *(len(s.start) for s in slabs)])
    parts = [s.offsets[1:] + before for s, before in zip(slabs, runs, strict=False)]
    faults = [s.faults for s in slabs]
    places = [f.place_mm for f in sorted(faults, key=lambda f: f.open_columns == 0)]
    return Columns(
        slabs[0].grid,
        slabs[0].first_row,
        np.concatenate([slabs[0].offsets[:1], *parts]),
        np.concatenate([s.start for s in slabs]),
        np.concatenate([s.stop for s in slabs]),
        Faults(
            sum(f.open_columns for f in faults),
            sum(f.inverted_columns for f in faults),
            next((p for p in places if p is not None), None),
        ),
    )


def check_reach(mesh: Mesh, grid: Grid) -> None:
    """Refuse a mesh without faces, or too large for exact integers on a grid.

    Raises
    ------
    MeshError
        See `iterate_columns`.
    """
    if not len(mesh.faces):
        raise MeshError("the mesh has no faces; nothing can be made of it")
    used = mesh.bounds_mm
    with np.errstate(invalid="ignore", over="ignore"):
        voxels = (used - np.asarray(grid.origin_mm)) / np.asarray(grid.pitch_mm)
        near = np.abs(voxels) <= 2 * MOST_VOXELS
        small = voxels[1] - voxels[0] <= MOST_VOXELS
    if not (near.all() and small.all()):
        raise MeshError(
            f"the mesh reaches from {used[0].tolist()} to {used[1].tolist()} mm, which is not "
            f"within {MOST_VOXELS} voxels of {grid.pitch_mm} mm about the grid's origin "
            f"{grid.origin_mm} mm; choose a coarser pitch, or cut the part"
        )


def _faults(counts: IntArray, grid: Grid, first_row: int) -> Faults:
    unpaired, inverted, first_open, first_inverted = (int(c) for c in counts)
    column = first_open if first_open >= 0 else first_inverted
    if column < 0:
        return Faults()
    row, i = divmod(column, grid.shape[0])
    x, y, _ = grid.centre_mm(np.array([i, first_row + row, 0])).tolist()
    return Faults(unpaired, inverted, (x, y))
