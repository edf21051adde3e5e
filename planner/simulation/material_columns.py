"""The material of a part as columns, cut into segments by the faces of a lattice of cells."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import MeshError
from planner.mesh.mesh import Mesh, order_rows
from planner.numerics import FloatArray, IntArray, inner_kernel, kernel
from planner.voxels.columns import MOST_VOXELS, Columns, Grid, iterate_columns

__all__ = ["SampledMaterial", "column_xy", "sample"]


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
    counts
        Cells along x, y, z.
    voxels
        Steps along z in a cell.
    across
        Columns in a row of their lattice.
    frame : (7,)
        u and v of the first column, spacing, cosine and sine of the turn, and the scale
        of x and y in cells a mm; u, v and x, y are from the part's lower corner.
    foot : (columns,) int32
        Footprint each column stands in, ``i counts[1] + j``; -1 outside the bounding box, where
        columns have no segments.
    per_foot : (footprints,) int64
        Columns that stand in each.
    segments : (s, 3) int32
        Column, lower and upper end in steps; rising, column by column. Each is in one cell.
    shell : (s,) int32
        Shell that each segment is in.
    piece : (s,) int32
        Cell (of `CutCells`) that each segment belongs to; -1 where it is dropped.
    """

    counts: tuple[int, ...]
    voxels: int
    across: int
    frame: FloatArray
    foot: NDArray[np.int32]
    per_foot: NDArray[np.int64]
    segments: NDArray[np.int32]
    shell: NDArray[np.int32]
    piece: NDArray[np.int32]

    @cached_property
    def offsets(self) -> IntArray:
        """Segments of column c are ``offsets[c]`` to ``offsets[c + 1]``."""
        return np.append(0, np.cumsum(np.bincount(self.segments[:, 0], minlength=len(self.foot))))

    @property
    def cell(self) -> IntArray:
        """Cell of the lattice that each segment is in, (s,)."""
        column, low, _ = self.segments.T
        return np.asarray(self.foot[column].astype(np.int64) * self.counts[2] + low // self.voxels)

    def xy(self, segments: Any = slice(None)) -> tuple[FloatArray, FloatArray]:
        """Return x and y of segments, in cells."""
        x, y = _column_xy(self.frame, self.across, self.segments[segments, 0])
        return x, y

    def touching(self, label: IntArray, apart: IntArray) -> NDArray[np.int32]:
        """Return pairs of segments that touch: of one label, (s,), and not one `apart`, (k, 2)."""
        # In rows of m and n segments less than m + n pairs overlap, and each row has four beside
        # it: room for all, of which half is written.
        pairs = np.empty((5 * len(label), 2), np.int32)
        label, apart = label.astype(np.int64), apart.astype(np.int32)
        return pairs[: _touching(self.segments, self.offsets, self.across, label, apart, pairs)]

    def segments_of(
        self, number: NDArray[np.int32], layer: IntArray
    ) -> tuple[IntArray, NDArray[np.int32]]:
        """Return the segments of some pieces, one piece after the other.

        Parameters
        ----------
        number : (pieces,)
            0 to n - 1 of those that are wanted, else -1.
        layer : (n,)
            Cells along z from which each one's segments are measured.

        Returns
        -------
        begin : (n + 1,)
            Where each one's segments begin.
        segments : (s, 3) int32
        """
        where = np.append(number, np.int32(-1))[self.piece]
        wanted = np.flatnonzero(where >= 0)
        order, begin = order_rows(where[wanted])
        wanted = wanted[order]
        segments = self.segments[wanted]
        segments[:, 1:] -= (self.voxels * layer)[where[wanted], None]
        return np.append(begin, len(wanted)), segments

    def pieces(self) -> tuple[IntArray, NDArray[np.int32]]:
        """Return the cell of the lattice and the shell of each piece, (n,)."""
        n = int(self.piece.max(initial=-1)) + 1
        cell, shell = np.empty(n, np.int64), np.empty(n, np.int32)
        cell[self.piece], shell[self.piece] = self.cell, self.shell
        return cell, shell

    def measured(self) -> tuple[FloatArray, FloatArray]:
        """Return steps that each piece fills, (n,), and its bounds in cells, (n, 2, 3)."""
        order, starts = order_rows(self.piece)
        _, low, high = self.segments[order].T
        x, y = self.xy(order)
        least = [np.minimum.reduceat(along, starts) for along in (x, y, low / self.voxels)]
        most = [np.maximum.reduceat(along, starts) for along in (x, y, high / self.voxels)]
        return np.add.reduceat(high - low, starts), np.array([least, most]).transpose(2, 0, 1)

    def locate(
        self, origin_mm: FloatArray, cell_mm: FloatArray, index: IntArray,
        points_mm: FloatArray, inward: FloatArray, shell: NDArray[np.int32] | None = None,
    ) -> tuple[NDArray[np.int32], FloatArray, FloatArray]:  # fmt: skip
        """Find the cell, the place in it, and the distance of the material of points on a surface.

        A point is in the piece of its own cell whose material is nearest to it, seen from a
        column's spacing inwards. Where its cell has no material as near as a neighbour has (it
        was thinner than the columns see), it is in the neighbour, and its place a little outside.

        Parameters
        ----------
        origin_mm, cell_mm, index
            Of the lattice, and the place of each piece's cell in it.
        points_mm : (k, 3)
            On the surface, or close to it.
        inward : (k, 3)
            Unit vectors from there into the material.
        shell : (k,)
            In which each is, if that is known.

        Returns
        -------
        cell : (k,) int32
        local : (k, 3)
            In the cell's own coordinates: -1..1, and beyond where the piece goes on or is nearest.
        away : (k,)
        """
        place = (points_mm - origin_mm) / cell_mm
        counts = np.array(self.counts)
        own = np.clip(np.floor(place + _PLAIN_STEP * inward), 0, counts - 1).astype(np.int64)
        target = points_mm - origin_mm + self.frame[2] * inward
        target[:, 2] *= self.voxels / cell_mm[2]
        shell = np.full(len(own), -1, np.int32) if shell is None else shell
        cell, away = np.empty(len(points_mm), np.int32), np.empty(len(points_mm))
        _nearest(
            self.segments, self.offsets, self.piece, self.shell, self.foot,
            self.frame, self.across, counts, self.voxels, cell_mm[2] / self.voxels,
            own, target, shell, cell, away,
        )  # fmt: skip
        found = index[cell]
        local = 2.0 * (place - found) - 1.0
        inside = (found == own).all(axis=1)
        local[inside] = np.clip(local[inside], -1.0, 1.0)
        return cell, local, away


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
    frame = np.array([u[0] + pitch / 2, v[0] + pitch / 2, pitch, cos, sin, *(1.0 / size[:2])])
    foot = np.empty(nu * nv, np.int32)
    _find_feet(frame, nu, cells[0], cells[1], foot)
    per_foot = np.bincount(foot[foot >= 0], minlength=cells[0] * cells[1])
    each = []
    for mesh in shells:
        x, y, z = (mesh.vertices - low).T
        turned = Mesh(np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=1), mesh.faces)
        columns = next(iterate_columns(turned, grid, slab_rows=grid.shape[1]))
        if columns.unpaired:
            raise MeshError(
                f"the surface is open: {columns.unpaired} lines along z go in and do not "
                "come out, or come out twice; repair the part first"
            )
        each.append(_segments(columns, foot, voxels))
    segments = np.concatenate(each)
    shell = np.repeat(np.arange(len(each), dtype=np.int32), [len(own) for own in each])
    if len(each) > 1:
        order = np.lexsort((segments[:, 1], segments[:, 0]))
        segments, shell = segments[order], shell[order]
    piece = np.arange(len(shell), dtype=np.int32)
    return SampledMaterial(cells, voxels, nu, frame, foot, per_foot, segments, shell, piece)


def _segments(columns: Columns, foot: NDArray[np.int32], voxels: int) -> NDArray[np.int32]:
    """Cut the runs of columns that stand in a footprint by the faces of cells."""
    column = np.repeat(np.arange(len(foot)), np.diff(columns.offsets))
    inside = foot[column] >= 0
    column, start, stop = column[inside], columns.start[inside], columns.stop[inside]
    reach = (stop - 1) // voxels - start // voxels + 1
    run = np.repeat(np.arange(len(reach)), reach)
    before = np.cumsum(reach) - reach
    bottom = (start[run] // voxels + np.arange(len(run)) - before[run]) * voxels
    low, high = np.maximum(start[run], bottom), np.minimum(stop[run], bottom + voxels)
    return np.stack([column[run], low, high], axis=1, dtype=np.int32, casting="same_kind")


def _column_xy(frame: Any, across: Any, column: Any) -> Any:
    """Return x and y of a column, in cells."""
    u, v = frame[0] + (column % across) * frame[2], frame[1] + (column // across) * frame[2]
    return (frame[3] * u - frame[4] * v) * frame[5], (frame[4] * u + frame[3] * v) * frame[6]


column_xy = inner_kernel(_column_xy)


@kernel
def _find_feet(frame: Any, nu: Any, cells_x: Any, cells_y: Any, foot: Any) -> None:
    for c in range(foot.size):
        x, y = column_xy(frame, nu, c)
        i, j = int(np.floor(x)), int(np.floor(y))
        foot[c] = i * cells_y + j if 0 <= i < cells_x and 0 <= j < cells_y else -1


@kernel
def _touching(segments: Any, offsets: Any, across: Any, label: Any, apart: Any, pairs: Any) -> Any:
    n, count = 0, offsets.size - 1
    for c in range(count):
        for s in range(offsets[c] + 1, offsets[c + 1]):
            r = s - 1
            near = segments[r, 2] == segments[s, 1]
            if near and label[r] == label[s] and apart[r] != apart[s]:
                pairs[n, 0], pairs[n, 1] = r, s
                n += 1
        for side in range(2):
            d = c + (across if side else 1)
            if d >= count or (not side and d % across == 0):
                continue
            r, s = offsets[c], offsets[d]
            while r < offsets[c + 1] and s < offsets[d + 1]:
                low, high = max(segments[r, 1], segments[s, 1]), min(segments[r, 2], segments[s, 2])
                if low < high and label[r] == label[s] and apart[r] != apart[s]:
                    pairs[n, 0], pairs[n, 1] = r, s
                    n += 1
                if segments[r, 2] < segments[s, 2]:
                    r += 1
                else:
                    s += 1
    return n


# ------------------------------------------------------------------------------------------------
# Which piece a point of the surface is in.


_PLAIN_STEP = 1e-6
# of a cell: a point this close to a face of its cell is in the cell that its material is in.


@kernel
def _nearest(
    segments: Any, offsets: Any, piece: Any, shell: Any, foot: Any, frame: Any, nu: Any,
    counts: Any, voxels: Any, voxel_mm: Any, own: Any, target: Any, wanted: Any,
    cell: Any, distance: Any,
) -> None:  # fmt: skip
    # The piece of the segment nearest to each target (x and y in mm, z in steps), of the wanted
    # shell or, with -1, of any, in rings of columns about it; and how far it is. One in the point's
    # own cell is preferred when it is nearer than the nearest of all and a diagonal of the lattice.
    nv = foot.size // nu
    pitch = frame[2]
    slack = np.sqrt(2.0) * pitch
    for n in range(cell.size):
        x, y, z = target[n, 0], target[n, 1], target[n, 2]
        u = (frame[3] * x + frame[4] * y - frame[0]) / pitch
        v = (frame[3] * y - frame[4] * x - frame[1]) / pitch
        i0 = min(max(int(np.floor(u + 0.5)), 0), nu - 1)
        j0 = min(max(int(np.floor(v + 0.5)), 0), nv - 1)
        mine = own[n, 0] * counts[1] + own[n, 1]
        bottom, top = own[n, 2] * voxels, (own[n, 2] + 1) * voxels
        best, best_own = np.inf, np.inf
        found, found_own = -1, -1
        for ring in range(max(nu, nv)):
            if (ring - 0.5) * pitch > best + slack:
                break
            for j in range(max(j0 - ring, 0), min(j0 + ring, nv - 1) + 1):
                step = 1 if abs(j - j0) == ring else max(2 * ring, 1)
                for i in range(i0 - ring, i0 + ring + 1, step):
                    if i < 0 or i >= nu:
                        continue
                    c = j * nu + i
                    across = pitch * pitch * ((i - u) ** 2 + (j - v) ** 2)
                    for s in range(offsets[c], offsets[c + 1]):
                        if piece[s] < 0 or (wanted[n] >= 0 and shell[s] != wanted[n]):
                            continue
                        low, high = segments[s, 1], segments[s, 2]
                        at = min(max(z, low), high)
                        away = np.sqrt(across + ((z - at) * voxel_mm) ** 2)
                        if away < best:
                            best, found = away, piece[s]
                        if foot[c] == mine and bottom <= low < top and away < best_own:
                            best_own, found_own = away, piece[s]
        distance[n] = min(best, best_own)
        cell[n] = found_own if best_own <= best + slack else found
