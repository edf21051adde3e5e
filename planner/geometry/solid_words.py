"""A closed mesh as sets of voxels for `planner.geometry.thin_places`, however thin it is.

A voxel belongs to the solid when its centre does. Where the solid is thinner than a voxel it may
hold no centre; there the voxels that its triangles pass through are taken instead. They are told
by their neighbourhood: a solid at least 1.74 voxels thick has a centre within one voxel of every
point of its surface.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from planner.geometry.columns import MOST_VOXELS, Columns, iterate_columns
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.mesh import Mesh
from planner.geometry.morphology import ROOM, Bits, add_runs, empty_set
from planner.geometry.thin_places import Raster, turned

__all__ = ["solid_words"]

_CELL = 2.0  # voxels: edge of the cells that a triangle is looked at in
_POINTS = 7  # drawn along either edge of a cell and half a cell beyond it
_BESIDE = 3  # rows on either side of a slab that cells reaching into it are told by


def solid_words(mesh: Mesh, raster: Raster) -> Iterator[tuple[Bits, ...]]:
    """Draw a closed mesh on a raster, slab by slab of `Raster.slab_rows` rows."""
    along, grid = turned(mesh, raster, (0, 1, 2))
    corners = (along.vertices - np.asarray(grid.origin_mm)) / np.asarray(grid.pitch_mm)
    # rows are below 2^14: sorting whole ones takes a few passes over them
    row = np.clip(np.floor(corners[:, 1]), -1, MOST_VOXELS).astype(np.int16)
    one, two, three = (row[along.faces[:, i]] for i in range(3))
    first = np.minimum(np.minimum(one, two), three)
    order = np.argsort(first, kind="stable").astype(np.int32)
    last = np.maximum.accumulate(np.maximum(np.maximum(one, two), three)[order])
    first = first[order]
    slabs = iterate_columns(along, grid, slab_rows=raster.slab_rows, shortest=1)
    nothing = empty_set(_BESIDE, grid.shape[0], grid.shape[2])
    before, held, start = nothing, _drawn(next(slabs)), 0
    while True:
        slab = next(slabs, None)
        after = nothing if slab is None else _drawn(slab)
        beside = np.concatenate([after[:_BESIDE], nothing[len(after) :]])
        stop = start + len(held)
        low = int(np.searchsorted(last, start - _BESIDE))
        near = order[low : np.searchsorted(first, stop + _BESIDE, side="right")]
        sheets = np.zeros_like(held)
        _sheets(corners, along.faces, near, start, before, held, beside, sheets)
        yield (held | sheets,)
        if slab is None:
            return
        before = np.concatenate([before, held])[-_BESIDE:].copy()
        held, start = after, stop


def _drawn(slab: Columns) -> Bits:
    bits = empty_set(slab.rows, slab.grid.shape[0], slab.grid.shape[2])
    every = np.ones(len(slab.start), dtype=np.bool_)
    add_runs(bits, 0, slab.offsets, slab.start, slab.stop, every)
    return bits


@kernel
def _sheets(
    corners: Any, faces: Any, members: Any, first_row: Any, before: Any, here: Any, after: Any,
    found: Any,
) -> None:  # fmt: skip
    # Marks in `found` the voxels of triangles near which there is none. Triangles are looked at
    # in cells of up to two voxels, in strips along their longest side; also in those cells whose
    # middle lies beside the slab, as they may reach into it.
    rows, columns = here.shape[0], here.shape[1] - 2 * ROOM
    voxels = (here.shape[2] - 2) * 64
    side, at = np.empty(3), np.empty(3)
    for m in members:
        longest, j = -1.0, 0
        for e in range(3):
            one, other = faces[m, e], faces[m, (e + 1) % 3]
            side[e] = 0.0
            for d in range(3):
                side[e] += (corners[one, d] - corners[other, d]) ** 2
            if side[e] > longest:
                longest, j = side[e], e
        a, b, c = faces[m, j], faces[m, (j + 1) % 3], faces[m, (j + 2) % 3]
        along = 0.5 * (longest + side[(j + 2) % 3] - side[(j + 1) % 3])
        height = np.sqrt(max(side[(j + 2) % 3] - along * along / max(longest, 1e-300), 0.0))
        strips = max(int(np.ceil(height / _CELL)), 1)
        for i in range(strips):
            up = (i + 0.5) / strips
            cells = max(int(np.ceil(np.sqrt(longest) * (1.0 - i / strips) / _CELL)), 1)
            y = (1.0 - up) * corners[a, 1] + up * corners[c, 1] - first_row
            slope = (1.0 - up) * (corners[b, 1] - corners[a, 1])
            first, last = 0, cells
            if abs(slope) > 1e-6:
                low, high = (-3.0 - y) / slope, (rows + 3.0 - y) / slope
                first = max(int(np.floor(min(low, high) * cells)) - 1, 0)
                last = min(int(np.ceil(max(low, high) * cells)) + 1, cells)
            for k in range(first, last):
                _at(corners, a, b, c, (k + 0.5) / cells, up, at)
                row, column, voxel = int(at[1]) - first_row, int(at[0]), int(at[2])
                if not -2 <= row < rows + 2:
                    continue
                if not (0 <= column < columns and 0 <= voxel < voxels):
                    continue
                if _near(before, here, after, row, column + ROOM, voxel):
                    continue
                for p in range(_POINTS):
                    for q in range(_POINTS):
                        over = (k - 0.5 + 2.0 * p / (_POINTS - 1)) / cells
                        rise = (i - 0.5 + 2.0 * q / (_POINTS - 1)) / strips
                        over, rise = min(max(over, 0.0), 1.0), min(max(rise, 0.0), 1.0)
                        _at(corners, a, b, c, over, rise, at)
                        row, column, voxel = int(at[1]) - first_row, int(at[0]), int(at[2])
                        if not 0 <= row < rows:
                            continue
                        if 0 <= column < columns and 0 <= voxel < voxels:
                            bit = np.uint64(1) << np.uint64(voxel & 63)
                            found[row, column + ROOM, 1 + (voxel >> 6)] |= bit


@inner_kernel
def _at(corners: Any, a: Any, b: Any, c: Any, over: Any, up: Any, at: Any) -> None:
    # The point so far along ab, and then towards c.
    for d in range(3):
        foot = corners[a, d] + over * (corners[b, d] - corners[a, d])
        at[d] = np.floor(foot + up * (corners[c, d] - foot))


@inner_kernel
def _near(before: Any, here: Any, after: Any, row: Any, column: Any, voxel: Any) -> Any:
    # Whether any of the 27 voxels around one is in the set.
    for i in range(3):
        at = row + (0 if i == 0 else (-1 if i == 1 else 1))
        for j in range(3):
            beside = column + (0 if j == 0 else (-1 if j == 1 else 1))
            for k in range(voxel - 1, voxel + 2):
                word, bit = 1 + (k >> 6), np.uint64(k & 63)
                if at < 0:
                    value = before[at + _BESIDE, beside, word]
                elif at >= here.shape[0]:
                    value = after[at - here.shape[0], beside, word]
                else:
                    value = here[at, beside, word]
                if (value >> bit) & np.uint64(1) == 1:
                    return True
    return False
