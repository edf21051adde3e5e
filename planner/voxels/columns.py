"""A mesh as columns of voxels: runs along z that lie inside."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, MeshError, positive
from planner.mesh.mesh import Mesh, compact, face_normal
from planner.numerics import BoolArray, FloatArray, IntArray, as_point, inner_kernel, kernel

__all__ = [
    "MOST_VOXELS",
    "Columns",
    "Grid",
    "Slab",
    "columns_of",
    "dense",
    "grid_for",
    "inside_shares",
    "iterate_columns",
    "iterate_slabs",
    "paint",
    "snap",
    "voxel_counts",
    "voxelize",
]


# ------------------------------------------------------------------------------------------------
# The loops behind `planner.voxels.columns`: from triangles to runs of voxels along a line.
#
# Lattice units below are 1 / `_LATTICE` of a voxel, with voxel centres at multiples of `_LATTICE`.
# Axes are called by what they do in a walk: columns stand along the *depth*, in rows of pixels.
#
# Every choice is made exactly, in integers, as if each centre were moved by infinitely small steps:
# furthest along z, far less along x, least along y. No centre then lies in a triangle, an edge or
# below a vertex, so a closed oriented mesh has a whole winding number at each, whatever line one
# walks along: columns along z (depth z, pixels x, rows y) and along x (depth x, pixels y, rows z)
# hold the same voxels. In the second the step along the rows is the longest: `row_leads`.


_SHIFT = 16
_LATTICE = 1 << _SHIFT
"""Steps in a voxel that vertices are rounded to."""

_VOXEL = 1.0 / _LATTICE
_DOUBT = 2.0**-28
# of a voxel: a depth nearer to a centre is decided in integers. Rounding errs by less than 2^-34:
# depths are below 2^15 voxels, and a handful of operations err by 2^-53 of that each.


def snap(vertices: FloatArray, grid: "Grid") -> NDArray[np.int64]:
    """Return vertices (n, 3) in lattice units; voxel (i, j, k) is centred at LATTICE ijk."""
    voxel: FloatArray = (vertices - np.asarray(grid.origin_mm)) / np.asarray(grid.pitch_mm)
    return np.floor(voxel * _LATTICE + 0.5).astype(np.int64) - _LATTICE // 2


@inner_kernel
def _ceil_voxel(coordinate: Any) -> Any:
    return (coordinate + (_LATTICE - 1)) >> _SHIFT


_SLAB_LINES = 1 << 17  # a slab's working arrays stay in the second-level cache


@dataclass(frozen=True, eq=False)
class Slab:
    """What is needed of a mesh to walk the rows first <= row < last.

    Attributes
    ----------
    shape
        Pixels of a row, rows and voxels along the depth, of the whole grid.
    snapped : (n, 3) int64
        Vertices in lattice units: along the pixels, the rows and the depth.
    faces : (m, 3) int32
        Those that reach into the slab, as indices into `snapped`.
    spans
        Rows of the slab that these cross in all, at most.
    """

    shape: tuple[int, int, int]
    first: int
    last: int
    snapped: IntArray
    faces: NDArray[np.int32]
    spans: int

    def alone(self) -> "Slab":
        """Return the same without the vertices that the slab does not need."""
        used, faces = compact(self.faces, len(self.snapped))
        return replace(self, snapped=self.snapped[used], faces=faces)

    def runs(
        self, *, shortest: int = 0, row_leads: bool = False
    ) -> tuple[IntArray, IntArray, IntArray, int]:
        """Return the runs of inside voxels along the depth.

        Parameters
        ----------
        shortest
            A run of fewer voxels is lengthened to this many (0: it is dropped when empty).
        row_leads
            Whether ties are decided along the rows first, not along the depth.

        Returns
        -------
        offsets, start, stop, unpaired
            The line of pixel i of a row is number ``(row - first) * pixels + i``, and has the runs
            ``offsets[number]`` to ``offsets[number + 1]``; these rise and do not touch, and hold
            the voxels start <= voxel < stop. Unpaired are lines whose entries and exits do not
            pair up.
        """
        nx, _, nz = self.shape
        mesh, first = (self.snapped, self.faces), self.first
        cursor = np.zeros((self.last - first) * nx + 1, np.int32)
        columns, heights = np.empty((self.spans, 4), np.int32), np.empty((self.spans, 2))
        n = _spans(*mesh, first, self.last, nx, row_leads, cursor, columns, heights)
        crossings = int(np.sum(columns[:n, 1], dtype=np.int64))
        start, stop = np.empty((2, crossings // 2), np.int32)
        offsets = np.zeros(len(cursor), np.int64)
        keys = np.empty(crossings, np.int32)
        drawn = columns[:n], heights, *mesh, first, nx, row_leads
        runs, unpaired = _runs(*drawn, cursor, keys, nz, shortest, offsets, start, stop)
        return offsets, start[:runs], stop[:runs], int(unpaired)


def deal_rows(
    snapped: IntArray, faces: NDArray[np.int32], shape: tuple[int, int, int], rows: int | None
) -> Iterator[Slab]:
    """Deal triangles to slabs of rows, from the lowest up; the arguments are those of `Slab`.

    By default a slab has about 10^5 lines, a few MB. Faces that cover no column (steep or small)
    are left out. Memory grows with the mesh, not with the number of slabs: faces are kept while
    they reach into the slab at hand.
    """
    nx, ny, _ = shape
    rows = max(1, _SLAB_LINES // nx) if rows is None else rows
    # By the pixel and the row at or beyond each vertex; sorting whole rows takes a few passes.
    beyond = np.clip(-(-snapped[:, :2] >> _SHIFT), 0, (nx, ny)).astype(np.int16)
    x, y = (along.take(faces.T) for along in beyond.T)
    low, high = y.min(axis=0), y.max(axis=0)
    rising = np.flatnonzero((low < high) & (x.min(axis=0) < x.max(axis=0))).astype(np.int32)
    slabs = range(0, ny, min(rows, ny))
    of_slab = low[rising] // slabs.step
    ends = np.cumsum(np.bincount(of_slab, minlength=len(slabs)))
    begun = np.split(rising[np.argsort(of_slab, kind="stable")], ends[:-1])  # nearby ones together
    members = rising[:0]
    for first, own in zip(slabs, begun, strict=True):
        last = min(first + slabs.step, ny)
        members = np.append(members.compress(high.take(members) > first), own)
        crossed = np.minimum(high.take(members), last) - np.maximum(low.take(members), first)
        own_faces, spans = faces.take(members, axis=0), int(crossed.sum(dtype=np.int64))
        yield Slab(shape, first, last, snapped, own_faces, spans)


@inner_kernel
def _first_pixel(x0: Any, y0: Any, x1: Any, y1: Any, y: Any, row_leads: Any) -> Any:
    # Smallest pixel at or right of the edge (y0 < y1) at height y: an exact ceiling division.
    # Where rows lead, y is a little more: an edge that leans right has then passed the pixel.
    numerator = x0 * (y1 - y0) + (x1 - x0) * (y - y0)
    if row_leads and x1 > x0:
        numerator += 1
    return -(-numerator // ((y1 - y0) << _SHIFT))


@kernel
def _spans(
    snapped: IntArray, faces: IntArray, row0: int, row1: int, nx: int, row_leads: bool,
    counts: IntArray, columns: IntArray, heights: FloatArray,
) -> int:  # fmt: skip
    # Cut each triangle into one span a row: first column, length, exit (1) or entry (0) and the
    # face (-1 where z is the same all over it, and so exact) in `columns`; z at the first column
    # and its rise a column in `heights`. `counts` gets +1 where a span begins and -1 where it
    # ends, so that its running sum counts a column's crossings.
    n = 0
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        # vertices by rising y, so that both triangles at an edge divide the same numbers
        turned = False
        if snapped[b, 1] < snapped[a, 1]:
            a, b, turned = b, a, not turned
        if snapped[c, 1] < snapped[b, 1]:
            b, c, turned = c, b, not turned
        if snapped[b, 1] < snapped[a, 1]:
            a, b, turned = b, a, not turned
        ax, ay, az = snapped[a, 0], snapped[a, 1], snapped[a, 2]
        bx, by, bz = snapped[b, 0], snapped[b, 1], snapped[b, 2]
        cx, cy, cz = snapped[c, 0], snapped[c, 1], snapped[c, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0:  # it is steep
            continue
        per_area = 1.0 / area
        along_y = (bz - az) * (cy - ay) - (cz - az) * (by - ay)
        level = along_y == 0 and (bz - az) * (cx - ax) == (cz - az) * (bx - ax)
        exit_sign = (area > 0) != turned  # the normal points up: the line leaves the body
        rise = along_y * per_area * _LATTICE
        first = max(_ceil_voxel(ay), row0)
        last = min(_ceil_voxel(cy), row1)
        for row in range(first, last):
            y = row << _SHIFT
            left = _first_pixel(ax, ay, cx, cy, y, row_leads)
            if y < by:
                right = _first_pixel(ax, ay, bx, by, y, row_leads)
            else:
                right = _first_pixel(bx, by, cx, cy, y, row_leads)
            if left > right:
                left, right = right, left
            left, right = max(left, 0), min(right, nx)
            if left >= right:
                continue
            x = left << _SHIFT
            weight_b = (x - ax) * (cy - ay) - (cx - ax) * (y - ay)
            weight_c = (bx - ax) * (y - ay) - (x - ax) * (by - ay)
            columns[n, 0] = (row - row0) * nx + left
            columns[n, 1] = right - left
            columns[n, 2] = exit_sign
            columns[n, 3] = -1 if level else f
            share_b, share_c = weight_b * per_area, weight_c * per_area
            heights[n, 0] = az + (share_b * (bz - az) + share_c * (cz - az))
            heights[n, 1] = rise
            counts[columns[n, 0]] += 1
            counts[columns[n, 0] + columns[n, 1]] -= 1
            n += 1
    return n


@inner_kernel
def _exact_voxel(
    snapped: Any, faces: Any, f: Any, x: Any, y: Any, near: Any, row_leads: Any
) -> Any:
    # First voxel at or beyond face f in the column at x, y, where the face is within `_DOUBT` of
    # the centre of voxel `near`. Products of three coordinates take 92 bits and wrap around, but
    # what they sum to is area * distance, below 2^62 * 2^-11: it comes out whole.
    a = faces[f, 0]
    nx, ny, nz = face_normal(snapped, a, faces[f, 1], faces[f, 2])
    dx, dy, dz = x - snapped[a, 0], y - snapped[a, 1], (near << _SHIFT) - snapped[a, 2]
    beyond, rises = nx * dx + ny * dy + nz * dz, -ny  # the latter along the rows
    if nz < 0:
        beyond, rises = -beyond, -rises
    return near if beyond > 0 or (beyond == 0 and not (row_leads and rises > 0)) else near + 1


@inner_kernel
def _sort_span(keys: Any, first: Any, last: Any) -> Any:
    """Sort keys[first:last] by Shell's method.

    Insertion sort for the usual handful, no quadratic worst case for a stack.
    """
    gap = 1
    while gap < (last - first) // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(first + gap, last):
            key = keys[i]
            j = i
            while j >= first + gap and keys[j - gap] > key:
                keys[j] = keys[j - gap]
                j -= gap
            keys[j] = key
        gap //= 3


@kernel
def _runs(
    columns: Any, heights: Any, snapped: Any, faces: Any, row0: Any, nx: Any, row_leads: Any,
    cursor: Any, keys: Any, nz: Any, shortest: Any, offsets: Any, start: Any, stop: Any,
) -> Any:  # fmt: skip
    # Gather each column's crossings in `keys`, sort them, and count the winding along them.
    crossings = here = 0
    for c in range(cursor.size - 1):
        here += cursor[c]
        cursor[c] = crossings
        crossings += here
    for s in range(columns.shape[0]):
        z, rise = heights[s, 0], heights[s, 1]
        for i in range(columns[s, 1]):
            column: Any = np.int64(columns[s, 0] + i)
            depth = (z + rise * i) * _VOXEL
            voxel: Any = np.int64(np.ceil(depth))
            short = voxel - depth
            if columns[s, 3] >= 0 and (short < _DOUBT or short > 1.0 - _DOUBT):
                x, y = (column % nx) << _SHIFT, (row0 + column // nx) << _SHIFT
                near = voxel if short < _DOUBT else voxel - 1
                voxel = _exact_voxel(snapped, faces, columns[s, 3], x, y, near, row_leads)
            voxel = min(max(voxel, -1), nz + 1)
            # entries sort before exits of the same voxel: touching bodies make one run
            keys[cursor[column]] = (voxel << 1) | columns[s, 2]
            cursor[column] += 1
    runs, first, unpaired = np.int64(0), np.int64(0), 0
    for c in range(cursor.size - 1):
        last = np.int64(cursor[c])
        if last - first > 1:
            _sort_span(keys, first, last)
        winding, low = 0, 0
        for i in range(first, last):
            voxel = keys[i] >> 1
            if keys[i] & 1 == 0:
                winding += 1
                if winding == 1:
                    low = voxel
                continue
            winding -= 1
            if winding == 0:
                high = voxel
                if high - low < shortest:
                    low = min(low, nz - shortest) if low <= nz else low
                    high = low + shortest
                low, high = max(low, 0), min(high, nz)
                if low < high:
                    if runs == offsets[c] or low > stop[runs - 1]:
                        start[runs], stop[runs] = low, high
                        runs += 1
                    elif high > stop[runs - 1]:
                        stop[runs - 1] = high
        if winding != 0:
            unpaired += 1
        offsets[c + 1] = runs
        first = last
    return runs, unpaired


@kernel
def paint(offsets: Any, start: Any, stop: Any, label: Any, filled: Any) -> None:
    """Write the labels of runs into a zeroed (lines, voxels) uint8 array."""
    for r in range(filled.shape[0]):
        for n in range(offsets[r], offsets[r + 1]):
            for i in range(start[n], stop[n]):
                filled[r, i] = label[n]


# ------------------------------------------------------------------------------------------------
# A mesh as columns of voxels: for each column of a grid, the runs along z that lie inside.
#
# A voxel is inside when the winding number of its centre is positive, so overlapping bodies
# unite and cavities stay empty. Runs take memory by the surface, not by the volume, and are made
# slab by slab (a few rows of columns at a time).
#
# Vertices are rounded to 1/65536 of a voxel (0.6 nm at a pitch of 0.042 mm); from there on every
# choice is exact, so a voxel is inside by the mesh and the grid alone, whatever the order of the
# triangles or the direction of the walk (`planner.slices` goes along x). No column is
# missed or counted twice, also where vertices lie on voxel centres, and bodies that share a face
# share no voxel.


MOST_VOXELS = 1 << 14
"""Along an axis of a grid."""


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
        for edge in self.pitch_mm:
            positive(edge, "pitch in mm")
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
        return np.asarray(self.origin_mm + (voxels + 0.5) * np.array(self.pitch_mm))


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
    unpaired
        How many have entries and exits that do not pair up: the surface is open, or a face turned.
    """

    grid: Grid
    first_row: int
    offsets: IntArray
    start: IntArray
    stop: IntArray
    unpaired: int = 0

    @property
    def rows(self) -> int:
        """Number of rows."""
        return (len(self.offsets) - 1) // self.grid.shape[0]

    @property
    def voxels(self) -> int:
        """Number of inside voxels."""
        return int(np.sum(self.stop, dtype=np.int64) - np.sum(self.start, dtype=np.int64))


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
        voxels = np.ceil((high - low) / pitch - 0.5 / _LATTICE)
    nx, ny, nz = (int(n) if 1 <= n <= 2**31 else 2**31 * int(n > 1) + 1 for n in voxels)
    return Grid(as_point(low), as_point(pitch), (nx, ny, nz))


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
    check_reach(mesh, grid)
    snapped = snap(mesh.vertices, grid)
    yield from columns_of(snapped, mesh.faces, grid, slab_rows=slab_rows, shortest=shortest)


def columns_of(
    snapped: NDArray[np.int64], faces: NDArray[np.int32], grid: Grid, *,
    slab_rows: int | None = None, shortest: int = 0,
) -> Iterator[Columns]:  # fmt: skip
    """Make columns of some faces between vertices in lattice units; see `iterate_columns`."""
    for slab in deal_rows(snapped, faces, grid.shape, slab_rows):
        yield Columns(grid, slab.first, *slab.runs(shortest=shortest))


def iterate_slabs(mesh: Mesh, grid: Grid, slab_layers: int | None = None) -> Iterator[Slab]:
    """Deal a closed mesh's triangles to slabs of layers, from the lowest up, for runs along x.

    Pixels are along y, rows along z; `Slab.runs` with `row_leads` holds the voxels of
    `iterate_columns`.

    Raises
    ------
    MeshError
        See `iterate_columns`.
    """
    nx, ny, nz = grid.shape
    check_reach(mesh, grid)
    snapped = np.ascontiguousarray(snap(mesh.vertices, grid)[:, [1, 2, 0]])
    return deal_rows(snapped, mesh.faces, (ny, nz, nx), slab_layers)


def voxel_counts(
    vertices: FloatArray, shells: Iterable[NDArray[np.int32]], grid: Grid
) -> list[int]:
    """Return how many voxels lie in each of some shells, by their faces between vertices."""
    snapped = snap(vertices, grid)
    return [sum(columns.voxels for columns in columns_of(snapped, one, grid)) for one in shells]


def voxelize(mesh: Mesh, pitch_mm: float | Sequence[float], *, shortest: int = 0) -> Columns:
    """Return all columns of a closed mesh at once, on the grid of `grid_for` its bounds.

    Raises
    ------
    ArgumentError, MeshError
        See `grid_for` and `iterate_columns`.
    """
    grid = grid_for(mesh.bounds_mm, pitch_mm)
    return next(iterate_columns(mesh, grid, slab_rows=grid.shape[1], shortest=shortest))


def dense(columns: Columns) -> BoolArray:
    """Return whether each voxel is inside, (nx, rows, nz); one byte a voxel."""
    nx, _, nz = columns.grid.shape
    voxels = np.zeros((len(columns.offsets) - 1, nz), np.uint8)
    inside = np.ones(len(columns.start), np.int32)
    paint(columns.offsets, columns.start, columns.stop, inside, voxels)
    return voxels.view(np.bool_).reshape(columns.rows, nx, nz).transpose(1, 0, 2)


_BLOCK_COLUMNS = 1 << 14  # a few MB of voxels


def inside_shares(mesh: Mesh, grid: Grid, parts: int) -> FloatArray:
    """Return which share of each cell of a grid is inside, by so many parts along each edge.

    Raises
    ------
    ArgumentError, MeshError
        The parts are too many for a grid; see `iterate_columns`.
    """
    nx, ny, nz = grid.shape
    fine_mm = as_point(np.array(grid.pitch_mm) / parts)
    fine = Grid(grid.origin_mm, fine_mm, (nx * parts, ny * parts, nz * parts))
    rows = max(1, _BLOCK_COLUMNS // (nx * parts))
    share = np.empty(grid.shape)
    for columns in iterate_columns(mesh, fine, slab_rows=rows * parts):
        first = columns.first_row // parts
        blocks = dense(columns).reshape(nx, parts, -1, parts, nz, parts)
        share[:, first : first + rows] = blocks.mean(axis=(1, 3, 5))
    return share


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
