"""The material of a part as columns, cut into segments by the faces of a lattice of cells."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import MeshError
from planner.mesh.mesh import Mesh
from planner.numerics import FloatArray, IntArray, inner_kernel, kernel
from planner.voxels.columns import MOST_VOXELS, Columns, Grid, iterate_columns, join

__all__ = ["SampledMaterial", "column_place", "located", "sample", "segment_starts"]


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
            Column, lower and upper end.
        """
        where = np.append(number, np.int32(-1))[self.piece]
        begin = np.append(0, np.cumsum(np.bincount(where[where >= 0], minlength=len(layer))))
        segments = np.empty((int(begin[-1]), 3), np.int32)
        _gather(self.lines, where, layer.copy(), begin[:-1].copy(), segments)
        return begin, segments

    def measured(self) -> tuple[IntArray, IntArray, FloatArray, NDArray[np.int32]]:
        """Return steps that each piece fills, its cell, bounds (n, 2, 3) in cells, and shell."""
        n = int(self.piece.max(initial=-1)) + 1
        filled, cell, ends = np.zeros(n, np.int64), np.zeros(n, np.int64), np.empty((n, 2, 3))
        ends[:, 0], ends[:, 1], shell = np.inf, -np.inf, np.zeros(n, np.int32)
        _fill(
            self.lines, self.frame, np.array(self.counts), self.piece, self.shell, filled, cell,
            ends, shell,
        )  # fmt: skip
        return filled, cell, ends, shell


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
        if faults := sampled[-1].unpaired:
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
    first = segment_starts(columns, foot, voxels)
    piece = np.arange(first[-1], dtype=np.int32)
    per_foot = np.bincount(foot[foot >= 0], minlength=cells[0] * cells[1])
    return SampledMaterial(columns, cells, voxels, frame, foot, per_foot, first[:-1], shell, piece)


def segment_starts(columns: Columns, foot: NDArray[np.int32], voxels: int) -> NDArray[np.int64]:
    """Return the first segment of each run, and how many there are in all."""
    reach = (columns.stop - 1) // voxels - columns.start // voxels + 1
    reach[np.repeat(foot < 0, np.diff(columns.offsets))] = 0
    return np.append(0, np.cumsum(reach, dtype=np.int64))


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


@kernel
def _gather(lines: Any, where: Any, layer: Any, cursor: Any, segments: Any) -> None:
    # Segments (column, low, high) of each piece that `where` numbers, one piece after the other.
    offsets, start, stop, first, foot, _, voxels = lines
    for c in range(foot.size):
        if foot[c] >= 0:
            for r in range(offsets[c], offsets[c + 1]):
                for k in range(start[r] // voxels, (stop[r] - 1) // voxels + 1):
                    p = where[first[r] + k - start[r] // voxels]
                    if p >= 0:
                        s = cursor[p]
                        segments[s, 0] = c
                        segments[s, 1] = max(start[r], k * voxels) - layer[p] * voxels
                        segments[s, 2] = min(stop[r], (k + 1) * voxels) - layer[p] * voxels
                        cursor[p] += 1


@kernel
def _fill(
    lines: Any, frame: Any, counts: Any, piece: Any, shell: Any,
    filled: Any, cell: Any, ends: Any, of: Any,
) -> None:  # fmt: skip
    offsets, start, stop, first, foot, nu, voxels = lines
    # How much of its cell each piece fills, which cell that is, its bounds, in cells, and shell.
    for c in range(foot.size):
        if foot[c] < 0:
            continue
        x, y = column_place(frame, nu, c)
        for r in range(offsets[c], offsets[c + 1]):
            for k in range(start[r] // voxels, (stop[r] - 1) // voxels + 1):
                p = piece[first[r] + k - start[r] // voxels]
                low, high = max(start[r], k * voxels), min(stop[r], (k + 1) * voxels)
                filled[p] += high - low
                of[p] = shell[r]
                cell[p] = foot[c] * counts[2] + k
                ends[p, 0, 0], ends[p, 1, 0] = min(ends[p, 0, 0], x), max(ends[p, 1, 0], x)
                ends[p, 0, 1], ends[p, 1, 1] = min(ends[p, 0, 1], y), max(ends[p, 1, 1], y)
                ends[p, 0, 2] = min(ends[p, 0, 2], low / voxels)
                ends[p, 1, 2] = max(ends[p, 1, 2], high / voxels)


# ------------------------------------------------------------------------------------------------
# Which piece a point of the surface is in.


_PLAIN_STEP = 1e-6
# of a cell: a point this close to a face of its cell is in the cell that its material is in.


def located(
    material: SampledMaterial, origin_mm: FloatArray, cell_mm: FloatArray, index: IntArray,
    points_mm: FloatArray, inward: FloatArray, shell: NDArray[np.int32] | None = None,
) -> tuple[NDArray[np.int32], FloatArray, FloatArray]:  # fmt: skip
    """Find points as `CutCells.locate`, if given in shells; also how far their material is."""
    place = (points_mm - origin_mm) / cell_mm
    counts = np.array(material.counts)
    own = np.clip(np.floor(place + _PLAIN_STEP * inward), 0, counts - 1).astype(np.int64)
    step = material.frame[2]
    target = points_mm - origin_mm + step * inward
    target[:, 2] *= material.voxels / cell_mm[2]
    if shell is None:
        shell = np.full(len(own), -1, np.int32)
    cell, away = np.empty(len(points_mm), np.int32), np.empty(len(points_mm))
    _nearest(
        material.lines, material.frame, material.piece, np.array(counts),
        cell_mm[2] / material.voxels, own, target, material.shell, shell, cell, away,
    )  # fmt: skip
    found = index[cell]
    local = 2.0 * (place - found) - 1.0
    inside = (found == own).all(axis=1)
    local[inside] = np.clip(local[inside], -1.0, 1.0)
    return cell, local, away


@kernel
def _nearest(
    lines: Any, frame: Any, piece: Any, counts: Any, voxel_mm: Any, own: Any, target: Any,
    shell: Any, wanted: Any, cell: Any, distance: Any,
) -> None:  # fmt: skip
    offsets, start, stop, first, foot, nu, voxels = lines
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
        low, high = own[n, 2] * voxels, (own[n, 2] + 1) * voxels
        best, best_own = np.inf, np.inf
        found, found_own = -1, -1
        for ring in range(max(nu, nv)):
            if (ring - 0.5) * pitch > best + slack:
                break
            for j in range(max(j0 - ring, 0), min(j0 + ring, nv - 1) + 1):
                step = 1 if abs(j - j0) == ring else max(2 * ring, 1)
                for i in range(i0 - ring, i0 + ring + 1, step):
                    if i < 0 or i >= nu or foot[j * nu + i] < 0:
                        continue
                    c = j * nu + i
                    across = pitch * pitch * ((i - u) ** 2 + (j - v) ** 2)
                    for r in range(offsets[c], offsets[c + 1]):
                        k0, k1 = start[r] // voxels, (stop[r] - 1) // voxels
                        if piece[first[r]] < 0 or (wanted[n] >= 0 and shell[r] != wanted[n]):
                            continue
                        at = min(max(z, start[r]), stop[r])
                        away = np.sqrt(across + ((z - at) * voxel_mm) ** 2)
                        if away < best:
                            k = min(max(int(at // voxels), k0), k1)
                            best, found = away, piece[first[r] + k - k0]
                        if foot[c] == mine and start[r] < high and stop[r] > low:
                            at = min(max(z, start[r], low), stop[r], high)
                            away = np.sqrt(across + ((z - at) * voxel_mm) ** 2)
                            if away < best_own:
                                best_own, found_own = away, piece[first[r] + own[n, 2] - k0]
        distance[n] = min(best, best_own)
        cell[n] = found_own if best_own <= best + slack else found
