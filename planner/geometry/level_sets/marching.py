"""Marching tetrahedra: all level sets of a field on one grid, which therefore never cross."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.level_sets.grid import FieldGrid
from planner.geometry.level_sets.lattice import Lattice

__all__ = ["LevelSets", "draw_level_sets", "keep_off_levels"]

_OFF_LEVEL = 1e-3  # of the field's change to the next vertex

# A cube's tetrahedra: along its edges from corner 0 to corner 7, one for each order of the axes.
# Corner c is at (c & 1, c >> 1 & 1, c >> 2), and the first three are right-handed.
_CORNERS = np.array(
    [[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 4, 6, 7]]
)
# Even orders of a tetrahedron's vertices: one apart from three, and two from two, by which of
# them lie below (bit i for vertex i).
_EVEN = np.array(
    [
        [0, 1, 2, 3], [0, 1, 2, 3], [1, 0, 3, 2], [0, 1, 2, 3],
        [2, 0, 1, 3], [0, 2, 3, 1], [1, 2, 0, 3], [3, 0, 2, 1],
        [3, 0, 2, 1], [0, 3, 1, 2], [1, 3, 2, 0], [2, 0, 1, 3],
        [2, 3, 0, 1], [1, 0, 3, 2], [0, 1, 2, 3], [0, 1, 2, 3],
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class LevelSets:
    """Surfaces of equal field in the cubes that hold any of the part.

    Attributes
    ----------
    vertices : (n, 3) float32
        In mm, on the lattice.
    faces : (m, 3) int32
        Normals towards larger values; in the order of the cubes.
    level, cell : (m,) int32
        The level of each face, and the number of its cube.
    """

    vertices: Float32Array
    faces: NDArray[np.int32]
    level: NDArray[np.int32]
    cell: NDArray[np.int32]


def keep_off_levels(grid: FieldGrid, levels: FloatArray) -> None:
    """Move values, in place, off the levels by a thousandth of the change to the next vertex.

    Level sets then keep off the grid's vertices, where their faces would shrink to nothing. They
    move by a thousandth of the pitch at most.
    """
    _keep_off(grid.values, levels, _OFF_LEVEL)


def draw_level_sets(grid: FieldGrid, levels: FloatArray, lattice: Lattice) -> LevelSets:
    """Draw all level sets.

    Parameters
    ----------
    grid : FieldGrid
        Values off the levels; see `keep_off_levels`.
    levels : (L,) float64
        Strictly increasing.
    """
    none, nowhere = np.empty((0, 3), dtype=np.int32), np.empty((0, 3))
    empty, keys = np.empty(0, dtype=np.int32), np.zeros(1, dtype=np.int64)
    shared = (grid.values, grid.active, grid.origin_mm, grid.pitch_mm, levels, _CORNERS, _EVEN)
    count, _ = _march(*shared, keys, empty, nowhere, none, empty, empty)
    bits = max(4, int(2 * count + 1).bit_length())
    keys, number = np.zeros(1 << bits, dtype=np.int64), np.empty(1 << bits, dtype=np.int32)
    points = np.empty((2 * count + 4, 3))
    faces = np.empty((count, 3), dtype=np.int32)
    level, cell = np.empty((2, count), dtype=np.int32)
    _, made = _march(*shared, keys, number, points, faces, level, cell)
    return LevelSets(lattice.rounded(points[:made]), faces, level, cell)


@kernel
def _keep_off(values: Any, levels: Any, share: Any) -> None:
    nx, ny, nz = values.shape
    count = levels.size
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                f = values[i, j, k]
                if f != f:
                    continue
                near = np.searchsorted(levels, f)
                change = 0.0
                for d in range(6):
                    a, b, c = i, j, k
                    step = 1 if d < 3 else -1
                    if d % 3 == 0:
                        a += step
                    elif d % 3 == 1:
                        b += step
                    else:
                        c += step
                    if 0 <= a < nx and 0 <= b < ny and 0 <= c < nz:
                        other = abs(values[a, b, c] - f)
                        if other > change:
                            change = other
                off = share * change
                for n in (near - 1, near):
                    if n < 0 or n >= count or abs(f - levels[n]) >= off:
                        continue
                    if f >= levels[n]:
                        room = levels[n + 1] - levels[n] if n + 1 < count else np.inf
                        values[i, j, k] = levels[n] + min(off, 0.5 * room)
                    else:
                        room = levels[n] - levels[n - 1] if n > 0 else np.inf
                        values[i, j, k] = levels[n] - min(off, 0.5 * room)
                    break


@kernel
def _march(
    values: Any, active: Any, origin: Any, pitch: Any, levels: Any, corners: Any, even: Any,
    keys: Any, number: Any, points: Any, faces: Any, face_level: Any, face_cell: Any,
) -> Any:  # fmt: skip
    # With room for no faces: counts them. Otherwise fills.
    nx, ny, nz = active.shape
    count, made, drawing = 0, 0, faces.shape[0] > 0
    v = np.empty(8)
    vertex = np.empty(4, dtype=np.int32)
    at = np.empty(3, dtype=np.int64)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if active[i, j, k] == 0:
                    continue
                low, high = np.inf, -np.inf
                for c in range(8):
                    v[c] = values[i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]
                    low, high = min(low, v[c]), max(high, v[c])
                first = np.searchsorted(levels, low, side="right")
                at[0], at[1], at[2] = i, j, k
                for n in range(first, levels.size):
                    level = levels[n]
                    if level > high:
                        break
                    for t in range(6):
                        below, some = 0, 0
                        for c in range(4):
                            if v[corners[t, c]] < level:
                                below |= 1 << c
                                some += 1
                        if some == 0 or some == 4:
                            continue
                        if not drawing:
                            count += 2 if some == 2 else 1
                            continue
                        p, q, r, s = even[below, 0], even[below, 1], even[below, 2], even[below, 3]
                        ends = 3
                        if some == 2:
                            ends = 4
                            pairs = ((p, r), (p, s), (q, s), (q, r))
                        else:
                            pairs = ((p, q), (p, r), (p, s), (p, s))
                        for e in range(ends):
                            a, b = corners[t, pairs[e][0]], corners[t, pairs[e][1]]
                            vertex[e], made = _crossing(
                                a, b, v, at, ny, nz, level, n, levels.size, origin, pitch, keys,
                                number, points, made,
                            )  # fmt: skip
                        turned = (t >= 3) ^ (some == 3)
                        first_corner = 0
                        if ends == 4 and _apart(points, vertex[1], vertex[3]) < _apart(
                            points, vertex[0], vertex[2]
                        ):
                            first_corner = 1
                        for e in range(ends - 2):
                            x = vertex[first_corner]
                            y = vertex[(first_corner + e + 1) % ends]
                            z = vertex[(first_corner + e + 2) % ends]
                            if turned:
                                y, z = z, y
                            faces[count, 0], faces[count, 1], faces[count, 2] = x, y, z
                            face_level[count] = n
                            face_cell[count] = (i * ny + j) * nz + k
                            count += 1
    return count, made


@inner_kernel
def _apart(points: Any, a: Any, b: Any) -> Any:
    square = 0.0
    for d in range(3):
        square += (points[a, d] - points[b, d]) ** 2
    return square


@inner_kernel
def _crossing(
    a: Any, b: Any, v: Any, at: Any, ny: Any, nz: Any, level: Any, n: Any, count: Any,
    origin: Any, pitch: Any, keys: Any, number: Any, points: Any, made: Any,
) -> Any:  # fmt: skip
    """Find the vertex where a level meets an edge of the grid, or make it."""
    if a > b:
        a, b = b, a
    i, j, k = at[0] + (a & 1), at[1] + (a >> 1 & 1), at[2] + (a >> 2)
    way = b - a  # corners along an edge share the bits of the lower one
    edge = ((i * (ny + 1) + j) * (nz + 1) + k) * 8 + way
    key = edge * count + n + 1
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    slot = np.int64((mixed ^ (mixed >> np.uint64(32))) & np.uint64(keys.size - 1))
    while keys[slot] != 0:
        if keys[slot] == key:
            return number[slot], made
        slot = (slot + 1) & (keys.size - 1)
    keys[slot] = key
    number[slot] = made
    t = (level - v[a]) / (v[b] - v[a])
    points[made, 0] = origin[0] + (i + t * (way & 1)) * pitch
    points[made, 1] = origin[1] + (j + t * (way >> 1 & 1)) * pitch
    points[made, 2] = origin[2] + (k + t * (way >> 2)) * pitch
    return np.int32(made), made + 1
