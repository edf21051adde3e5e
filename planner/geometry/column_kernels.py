"""The loops behind `planner.geometry.columns`: from triangles to runs of voxels along a line.

Lattice units below are 1 / `LATTICE` of a voxel, with voxel centres at multiples of `LATTICE`.
Axes are called by what they do in a walk: columns stand along the *depth*, in rows of pixels.

Every choice is made exactly, in integers, as if each centre were moved by infinitely small steps:
furthest along z, far less along x, least along y. No centre then lies in a triangle, an edge or
below a vertex, so a closed oriented mesh has a whole winding number at each, whatever line one
walks along: columns along z (depth z, pixels x, rows y) and along x (depth x, pixels y, rows z)
hold the same voxels. In the second the step along the rows is the longest: `row_leads`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray, IntArray
from planner.geometry.kernel import inner_kernel, kernel

__all__ = ["LATTICE", "bin_triangles", "cover_rows", "fill_runs", "slab_runs", "snap"]

_SHIFT = 16
LATTICE = 1 << _SHIFT
"""Steps in a voxel that vertices are rounded to."""

_VOXEL = 1.0 / LATTICE
_DOUBT = 2.0**-28
# of a voxel: a depth nearer to a centre is decided in integers. Rounding errs by less than 2^-34:
# depths are below 2^15 voxels, and a handful of operations err by 2^-53 of that each.


def snap(vertices: FloatArray, origin: FloatArray, pitch: FloatArray) -> NDArray[np.int64]:
    """Return vertices (n, 3) in lattice units; voxel (i, j, k) is centred at LATTICE ijk."""
    voxel = (vertices - origin) / pitch
    return np.floor(voxel * LATTICE + 0.5).astype(np.int64) - LATTICE // 2


@inner_kernel
def _ceil_voxel(coordinate: Any) -> Any:
    return (coordinate + (LATTICE - 1)) >> _SHIFT


def bin_triangles(
    snapped: NDArray[np.int64], faces: NDArray[np.int32], nx: int, ny: int, slab_rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]]:
    """Sort triangles into slabs of rows.

    Returns
    -------
    offsets, members, spans
        Slab s holds the faces ``members[offsets[s]:offsets[s + 1]]``, which cross at most
        ``spans[s]`` of its rows in all. Faces that cover no column (steep or small) are left out.
    """
    slabs = (ny + slab_rows - 1) // slab_rows
    low, high = np.empty((2, len(faces)), np.int32)
    count, spans = np.zeros((2, slabs), np.int64)
    _cover(snapped, faces, nx, ny, slab_rows, low, high, count, spans)
    offsets = np.append(0, np.cumsum(count))
    members = np.empty(offsets[-1], np.int32)
    _deal(low, high, slab_rows, offsets[:-1].copy(), members)
    return offsets, members, spans


def cover_rows(
    snapped: NDArray[np.int64], faces: NDArray[np.int32], nx: int, ny: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the rows low <= row < high that each face covers; 0, 0 where it covers no column."""
    low, high = np.empty((2, len(faces)), np.int32)
    count, spans = np.zeros((2, 1), np.int64)
    _cover(snapped, faces, nx, ny, ny, low, high, count, spans)
    return low, high


@kernel
def _cover(
    snapped: IntArray,
    faces: IntArray,
    nx: int,
    ny: int,
    slab_rows: int,
    low: IntArray,
    high: IntArray,
    count: IntArray,
    spans: IntArray,
) -> None:
    # Rows that each face covers, and what falls to each slab.
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, bx, cx = snapped[a, 0], snapped[b, 0], snapped[c, 0]
        ay, by, cy = snapped[a, 1], snapped[b, 1], snapped[c, 1]
        first = max(_ceil_voxel(min(ay, by, cy)), 0)
        last = min(_ceil_voxel(max(ay, by, cy)), ny)
        left = max(_ceil_voxel(min(ax, bx, cx)), 0)
        right = min(_ceil_voxel(max(ax, bx, cx)), nx)
        low[f], high[f] = 0, 0
        if first < last and left < right and (bx - ax) * (cy - ay) != (cx - ax) * (by - ay):
            low[f], high[f] = first, last
            for s in range(first // slab_rows, (last - 1) // slab_rows + 1):
                count[s] += 1
                spans[s] += min(last, (s + 1) * slab_rows) - max(first, s * slab_rows)


@kernel
def _deal(
    low: IntArray, high: IntArray, slab_rows: int, cursor: IntArray, members: IntArray
) -> None:
    for f in range(low.size):
        if low[f] < high[f]:
            for s in range(low[f] // slab_rows, (high[f] - 1) // slab_rows + 1):
                members[cursor[s]] = f
                cursor[s] += 1


@inner_kernel
def _first_pixel(x0: Any, y0: Any, x1: Any, y1: Any, per_row: Any, y: Any, row_leads: Any) -> Any:
    # Smallest pixel at or right of the edge (y0 < y1) at height y: an exact ceiling division,
    # estimated in floating point (per_row = 1 / denominator) and mended in integers.
    # Where rows lead, y is a little more: an edge that leans right has then passed the pixel.
    denominator = (y1 - y0) << _SHIFT
    numerator = x0 * (y1 - y0) + (x1 - x0) * (y - y0)
    if row_leads and x1 > x0:
        numerator += 1
    pixel = int(numerator * per_row)
    while pixel * denominator < numerator:
        pixel += 1
    while (pixel - 1) * denominator >= numerator:
        pixel -= 1
    return pixel


@kernel
def _spans(
    snapped: IntArray,
    faces: IntArray,
    members: IntArray,
    row0: int,
    row1: int,
    nx: int,
    row_leads: bool,
    counts: IntArray,
    columns: IntArray,
    heights: FloatArray,
) -> int:
    # Cut each triangle into one span a row: first column, length, exit (1) or entry (0) and the
    # face (-1 where z is the same all over it, and so exact) in `columns`; z at the first column
    # and its rise a column in `heights`. `counts` gets +1 where a span begins and -1 where it
    # ends, so that its running sum counts a column's crossings.
    n = 0
    for m in range(len(members)):
        f = members[m]
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        level = snapped[a, 2] == snapped[b, 2] and snapped[b, 2] == snapped[c, 2]
        area = (snapped[b, 0] - snapped[a, 0]) * (snapped[c, 1] - snapped[a, 1]) - (
            snapped[c, 0] - snapped[a, 0]
        ) * (snapped[b, 1] - snapped[a, 1])
        exit_sign = 1 if area > 0 else 0  # the normal points up: the line leaves the body
        # vertices by rising y, so that both triangles at an edge divide the same numbers
        if snapped[b, 1] < snapped[a, 1]:
            a, b = b, a
        if snapped[c, 1] < snapped[b, 1]:
            b, c = c, b
        if snapped[b, 1] < snapped[a, 1]:
            a, b = b, a
        ax, ay, az = snapped[a, 0], snapped[a, 1], snapped[a, 2]
        bx, by, bz = snapped[b, 0], snapped[b, 1], snapped[b, 2]
        cx, cy, cz = snapped[c, 0], snapped[c, 1], snapped[c, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        per_area = 1.0 / area
        rise = ((bz - az) * (cy - ay) - (cz - az) * (by - ay)) * per_area * LATTICE
        long_edge = 1.0 / ((cy - ay) << _SHIFT)
        lower = 1.0 / (max(by - ay, 1) << _SHIFT)
        upper = 1.0 / (max(cy - by, 1) << _SHIFT)
        first = max(_ceil_voxel(ay), row0)
        last = min(_ceil_voxel(cy), row1)
        for row in range(first, last):
            y = row << _SHIFT
            left = _first_pixel(ax, ay, cx, cy, long_edge, y, row_leads)
            if y < by:
                right = _first_pixel(ax, ay, bx, by, lower, y, row_leads)
            else:
                right = _first_pixel(bx, by, cx, cy, upper, y, row_leads)
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
            heights[n, 0] = az + (
                (weight_b * per_area) * (bz - az) + (weight_c * per_area) * (cz - az)
            )
            heights[n, 1] = rise
            counts[columns[n, 0]] += 1
            counts[columns[n, 0] + columns[n, 1]] -= 1
            n += 1
    return n


@inner_kernel
def _sort(keys: Any, first: Any, last: Any) -> Any:
    # Shell sort: insertion sort for the usual handful, no quadratic worst case for a stack.
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


def slab_runs(
    snapped: NDArray[np.int64],
    faces: NDArray[np.int32],
    members: NDArray[np.int32],
    spans: int,
    row0: int,
    row1: int,
    nx: int,
    nz: int,
    shortest: int,
    row_leads: bool = False,
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return the runs of one slab of rows.

    Parameters
    ----------
    spans
        At least the number of rows that the members cross in all.
    shortest
        A run of fewer voxels is lengthened to this many (0: it is dropped when empty).
    row_leads
        Whether ties are decided along the rows first, not along the depth.

    Returns
    -------
    offsets, start, stop, faults
        Runs of column c: ``start[offsets[c]:offsets[c + 1]]``. ``faults``: columns whose signs
        do not sum to zero, columns where the winding is negative over more than one voxel (one
        may come from rounding), and the first faulty column of each kind (-1: none).
    """
    cursor = np.zeros((row1 - row0) * nx + 1, np.int32)
    columns, heights = np.empty((spans, 4), np.int32), np.empty((spans, 2), np.float64)
    n = _spans(snapped, faces, members, row0, row1, nx, row_leads, cursor, columns, heights)
    crossings = int(np.sum(columns[:n, 1], dtype=np.int64))
    keys = np.empty(crossings, np.int32)
    start, stop = np.empty((2, crossings // 2), np.int32)
    offsets, faults = np.zeros(len(cursor), np.int64), np.array([0, 0, -1, -1])
    ends = (offsets, start, stop, faults)
    mesh = (snapped, faces, row0, nx, row_leads)
    runs = _runs(columns[:n], heights, *mesh, cursor, keys, nz, shortest, *ends)
    return offsets, start[:runs], stop[:runs], faults


@inner_kernel
def _exact_voxel(
    snapped: Any, faces: Any, f: Any, x: Any, y: Any, near: Any, row_leads: Any
) -> Any:
    # First voxel at or beyond face f in the column at x, y, where the face is within `_DOUBT` of
    # the centre of voxel `near`. Products of three coordinates take 92 bits and wrap around, but
    # what they sum to is area * distance, below 2^62 * 2^-11: it comes out whole.
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ax, ay, az = snapped[a, 0], snapped[a, 1], snapped[a, 2]
    ux, uy, uz = snapped[b, 0] - ax, snapped[b, 1] - ay, snapped[b, 2] - az
    vx, vy, vz = snapped[c, 0] - ax, snapped[c, 1] - ay, snapped[c, 2] - az
    area = ux * vy - vx * uy
    weight_b = (x - ax) * vy - vx * (y - ay)
    weight_c = ux * (y - ay) - (x - ax) * uy
    beyond = ((near << _SHIFT) - az) * area - weight_b * uz - weight_c * vz
    rises = ux * vz - vx * uz  # along the rows, times the area
    if area < 0:
        beyond, rises = -beyond, -rises
    if beyond > 0 or (beyond == 0 and not (row_leads and rises > 0)):
        return near
    return near + 1


@kernel
def _runs(
    columns: Any,
    heights: Any,
    snapped: Any,
    faces: Any,
    row0: Any,
    nx: Any,
    row_leads: Any,
    cursor: Any,
    keys: Any,
    nz: Any,
    shortest: Any,
    offsets: Any,
    start: Any,
    stop: Any,
    faults: Any,
) -> Any:
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
    runs, first = np.int64(0), np.int64(0)
    for c in range(cursor.size - 1):
        last = np.int64(cursor[c])
        if last - first == 2:
            if keys[first] > keys[first + 1]:
                keys[first], keys[first + 1] = keys[first + 1], keys[first]
        elif last - first > 2:
            _sort(keys, first, last)
        winding, low, below, inverted = 0, 0, 0, False
        for i in range(first, last):
            voxel = keys[i] >> 1
            if keys[i] & 1 == 0:
                winding += 1
                if winding == 1:
                    low = voxel
                elif winding == 0:
                    inverted |= voxel - below > 1
                continue
            winding -= 1
            if winding == -1:
                below = voxel
            elif winding == 0:
                high = voxel
                if high - low < shortest:
                    low = min(low, nz - shortest) if low <= nz else low
                    high = low + shortest
                low, high = max(low, 0), min(high, nz)
                if low < high:
                    if runs > offsets[c] and low <= stop[runs - 1]:
                        stop[runs - 1] = max(high, stop[runs - 1])
                    else:
                        start[runs], stop[runs] = low, high
                        runs += 1
        if winding != 0:
            faults[0] += 1
            if faults[2] < 0:
                faults[2] = c
        if inverted:
            faults[1] += 1
            if faults[3] < 0:
                faults[3] = c
        offsets[c + 1] = runs
        first = last
    return runs


@kernel
def fill_runs(offsets: IntArray, start: IntArray, stop: IntArray, dense: IntArray) -> None:
    """Set the voxels of runs to one in a zeroed (columns, nz) uint8 array."""
    for c in range(len(offsets) - 1):
        for r in range(offsets[c], offsets[c + 1]):
            dense[c, start[r] : stop[r]] = 1
