"""Level sets on one grid: where it lies, its values, and marching tetrahedra over it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.cutting.intersect import Lattice
from planner.errors import ArgumentError
from planner.fields.basic import Field
from planner.mesh.mesh import Mesh, key_slot
from planner.numerics import BoolArray, Float32Array, FloatArray, inner_kernel, kernel
from planner.voxels.columns import Grid, dense, iterate_columns, voxelize

__all__ = [
    "MOST_VERTICES",
    "TETRAHEDRA",
    "active_cells",
    "affordable_pitch_mm",
    "default_pitch_mm",
    "draw_level_sets",
    "field_grid",
    "keep_off_levels",
    "touched_cells",
]


# ------------------------------------------------------------------------------------------------
# The grid that level sets are drawn on, and the field's values at its vertices.


MOST_VERTICES = 150_000_000
"""Of a grid: 9 bytes each, and some more where the part is."""

_USUAL_MM = 0.5  # about a printer's smallest feature: levels come out a tenth of it off
_LEAST_CELLS = 50  # along the mean edge of a small part's box
_FINEST_MM = 0.1
_MOST_USUAL = 2_000_000  # vertices of a large part's box
_CHUNK = 1 << 18


@dataclass(frozen=True, eq=False)
class FieldGrid:
    """A field on a grid of cubes, linear within each of the six tetrahedra of a cube.

    Attributes
    ----------
    origin_mm, pitch_mm
        Lower corner and edge of a cube.
    active : (nx, ny, nz) uint8
        Cubes that hold any of the part.
    values : (nx + 1, ny + 1, nz + 1) float64
        The field at the corners of active cubes, elsewhere NaN.
    """

    origin_mm: FloatArray
    pitch_mm: float
    active: NDArray[np.uint8]
    values: FloatArray

    def interpolate(self, points_mm: FloatArray) -> FloatArray:
        """Return the field as the grid has it at points of the part, (n,)."""
        found = np.empty(len(points_mm))
        points = np.require(points_mm, np.float64, ["C", "W"])
        _interpolate(points, self.origin_mm, self.pitch_mm, self.values, found)
        return found


def default_pitch_mm(mesh: Mesh) -> float:
    """Return a pitch of 0.5 mm; finer for small parts, coarser for large ones.

    A fiftieth of the mean edge of a box smaller than 25 mm, 0.1 mm at least; or such that the
    box has about two million vertices. On the bundled samples, along fields of all kinds, 0.5 mm
    draws interfaces within 0.06 mm of where the field has them; half of it takes four times the
    triangles for a fifth of that. Rounded to two digits: the same for parts that differ by a hair.
    """
    extent_mm = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    edge_mm = float(np.cbrt(extent_mm.prod()))
    fine_mm = max(min(_USUAL_MM, edge_mm / _LEAST_CELLS), _FINEST_MM)
    coarse_mm = max(edge_mm / float(np.cbrt(_MOST_USUAL)), float(extent_mm.max()) / 2000.0)
    pitch_mm = max(fine_mm, coarse_mm)
    return float(f"{pitch_mm:.2g}")


def touched_cells(
    mesh: Mesh, origin_mm: FloatArray, pitch_mm: float, shape: tuple[int, int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """List the cubes that each face may touch.

    Returns
    -------
    offsets : (m + 1,) int64
        Face f touches ``cells[offsets[f]:offsets[f + 1]]``, and a few more may be listed.
    cells : int32
        Numbers (i ny + j) nz + k.
    """
    offsets = np.zeros(len(mesh.faces) + 1, dtype=np.int64)
    size = np.array(shape, dtype=np.int64)
    none = np.empty(0, dtype=np.int32)
    _touch(mesh.vertices, mesh.faces, origin_mm, pitch_mm, size, offsets, none)
    np.cumsum(offsets, out=offsets)
    cells = np.empty(offsets[-1], dtype=np.int32)
    _touch(mesh.vertices, mesh.faces, origin_mm, pitch_mm, size, offsets, cells)
    return offsets, cells


def active_cells(
    mesh: Mesh, origin_mm: FloatArray, pitch_mm: float, cells: NDArray[np.int32],
    shape: tuple[int, int, int],
) -> NDArray[np.uint8]:  # fmt: skip
    """Mark the cubes that hold any of a part: touched by its surface, or centred inside."""
    x, y, z = origin_mm.tolist()
    grid = Grid((x, y, z), (pitch_mm, pitch_mm, pitch_mm), shape)
    active = np.empty(shape, dtype=np.uint8)
    for columns in iterate_columns(mesh, grid):
        rows = slice(columns.first_row, columns.first_row + columns.rows)
        active[:, rows] = dense(columns)
    active.reshape(-1)[cells] = 1
    return active


def _values_at(field: Field, points_mm: FloatArray) -> FloatArray:
    """Return a field at points (n, 3), (n,), verified.

    Raises
    ------
    ArgumentError
        It gives another number of values, or one that is not finite.
    """
    found = np.asarray(field.values(points_mm), dtype=np.float64)
    if found.shape != (len(points_mm),):
        raise ArgumentError(
            f"field {field.name!r}: it gave {found.shape} values for {len(points_mm)} points; it "
            "must give one number for each"
        )
    bad = ~np.isfinite(found)
    if bad.any():
        x, y, z = points_mm[int(np.argmax(bad))].tolist()
        raise ArgumentError(
            f"field {field.name!r}: it is {found[int(np.argmax(bad))]} at ({x:.4g}, {y:.4g}, "
            f"{z:.4g}) mm as placed for printing; it must be finite over the part and a pitch "
            "around it"
        )
    return found


def field_grid(
    field: Field, origin_mm: FloatArray, pitch_mm: float, active: NDArray[np.uint8]
) -> FieldGrid:
    """Evaluate a field at the corners of active cubes.

    Raises
    ------
    ArgumentError
        A value is not finite.
    """
    nx, ny, nz = active.shape
    values = np.full((nx + 1, ny + 1, nz + 1), np.nan)
    layer = max(1, _CHUNK // ((ny + 1) * (nz + 1)))
    for first in range(0, nx + 1, layer):
        last = min(first + layer, nx + 1)
        wanted = _corners(active[max(first - 1, 0) : last])
        wanted = wanted[1 if first > 0 else 0 :][: last - first]
        index = np.argwhere(wanted)
        index[:, 0] += first
        points = origin_mm + index * pitch_mm
        found = _values_at(field, points)
        values[first:last][wanted] = found
    return FieldGrid(origin_mm, pitch_mm, active, values)


def _corners(active: NDArray[np.uint8]) -> BoolArray:
    """Tell which vertices are corners of active cubes."""
    n, ny, nz = active.shape
    found = np.zeros((n + 1, ny + 1, nz + 1), dtype=np.bool_)
    marked = active.view(np.bool_)
    for i in range(2):
        for j in range(2):
            for k in range(2):
                found[i : i + n, j : j + ny, k : k + nz] |= marked
    return found


@kernel
def _touch(
    vertices: Any, faces: Any, origin: Any, pitch: Any, shape: Any, offsets: Any, cells: Any
) -> None:
    # With room for no cells: counts into offsets[f + 1]. Otherwise fills.
    margin = 1e-3  # of a pitch: far above what rounding moves a face by
    low, high, n = np.empty(3), np.empty(3), np.empty(3)
    index = np.zeros(3, dtype=np.int64)
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            x, y, z = vertices[a, d], vertices[b, d], vertices[c, d]
            low[d] = (min(x, min(y, z)) - origin[d]) / pitch - margin
            high[d] = (max(x, max(y, z)) - origin[d]) / pitch + margin
        for d in range(3):
            j, k = (d + 1) % 3, (d + 2) % 3
            uj, uk = vertices[b, j] - vertices[a, j], vertices[b, k] - vertices[a, k]
            vj, vk = vertices[c, j] - vertices[a, j], vertices[c, k] - vertices[a, k]
            n[d] = uj * vk - uk * vj
        w = 0
        for d in range(1, 3):
            if abs(n[d]) > abs(n[w]):
                w = d
        u, v = (w + 1) % 3, (w + 2) % 3
        size = abs(n[w])
        su = -n[u] / n[w] if size > 0.0 else 0.0
        sv = -n[v] / n[w] if size > 0.0 else 0.0
        a0 = (vertices[a, w] - origin[w]) / pitch
        au = (vertices[a, u] - origin[u]) / pitch
        av = (vertices[a, v] - origin[v]) / pitch
        spread = 0.5 * (abs(su) + abs(sv)) + margin
        count = offsets[f] if cells.size else 0
        for i in range(
            max(int(np.floor(low[u])), 0), min(int(np.floor(high[u])), shape[u] - 1) + 1
        ):
            for j in range(
                max(int(np.floor(low[v])), 0), min(int(np.floor(high[v])), shape[v] - 1) + 1
            ):
                first, last = low[w], high[w]
                if size > 0.0:
                    middle = a0 + su * (i + 0.5 - au) + sv * (j + 0.5 - av)
                    first, last = max(first, middle - spread), min(last, middle + spread)
                for k in range(
                    max(int(np.floor(first)), 0), min(int(np.floor(last)), shape[w] - 1) + 1
                ):
                    if cells.size:
                        index[u], index[v], index[w] = i, j, k
                        cells[count] = (index[0] * shape[1] + index[1]) * shape[2] + index[2]
                    count += 1
        if not cells.size:
            offsets[f + 1] = count


@kernel
def _interpolate(points: Any, origin: Any, pitch: Any, values: Any, found: Any) -> None:
    for p in range(points.shape[0]):
        x = (points[p, 0] - origin[0]) / pitch
        y = (points[p, 1] - origin[1]) / pitch
        z = (points[p, 2] - origin[2]) / pitch
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        found[p] = _in_cube(values, i, j, k, x - i, y - j, z - k)


@inner_kernel
def _in_cube(values: Any, i: Any, j: Any, k: Any, x: Any, y: Any, z: Any) -> Any:
    """Interpolate linearly in the tetrahedron of a cube that has the larger coordinate first."""
    low, high = values[i, j, k], values[i + 1, j + 1, k + 1]
    if x >= y:
        if y >= z:
            p, q, a, b, c = values[i + 1, j, k], values[i + 1, j + 1, k], x, y, z
        elif x >= z:
            p, q, a, b, c = values[i + 1, j, k], values[i + 1, j, k + 1], x, z, y
        else:
            p, q, a, b, c = values[i, j, k + 1], values[i + 1, j, k + 1], z, x, y
    elif x >= z:
        p, q, a, b, c = values[i, j + 1, k], values[i + 1, j + 1, k], y, x, z
    elif y >= z:
        p, q, a, b, c = values[i, j + 1, k], values[i, j + 1, k + 1], y, z, x
    else:
        p, q, a, b, c = values[i, j, k + 1], values[i, j + 1, k + 1], z, y, x
    return low + a * (p - low) + b * (q - p) + c * (high - q)


# ------------------------------------------------------------------------------------------------
# How large a field's interfaces are before they are drawn, and the pitch that they can have.


_MOST_FACES = 1_500_000
"""Of interfaces, on both sides: some 75 MB of STL, and seconds to draw and verify."""

_FACES_PER_CELL = 30.0
"""Of both sides, for each square of the pitch's edge: tetrahedra make about 15 of a sheet there."""

_COARSEST = 2.0
"""Of the usual pitch: beyond it, bands as thick as a printer's smallest feature are not drawn."""

_MOST_VOXELS = 500_000


def interface_area_mm2(mesh: Mesh, field: Field, levels: FloatArray, pitch_mm: float) -> float:
    """Return about how large the level sets are within a part, by counting crossings.

    Lines along x, y and z through voxels inside cross a surface A / 2 times for each unit of their
    cross-section if its normals point all ways (Cauchy and Crofton); levels that one step crosses
    count each. What a level set does within a voxel is not seen.
    """
    columns = voxelize(mesh, pitch_mm)
    inside = dense(columns)
    voxels = np.argwhere(inside)
    if not len(voxels):
        return 0.0
    band = np.full(inside.shape, -1, np.int32)
    values = _values_at(field, columns.grid.centre_mm(voxels))
    band[tuple(voxels.T)] = np.searchsorted(levels, values, side="right")
    crossings = 0
    for axis in range(3):
        along = np.moveaxis(band, axis, 0)
        both = (along[1:] >= 0) & (along[:-1] >= 0)
        crossings += int(np.abs(along[1:] - along[:-1])[both].sum())
    return crossings * pitch_mm**2 / 1.5


def affordable_pitch_mm(mesh: Mesh, field: Field, levels: FloatArray, usual_mm: float) -> float:
    """Return the usual pitch, or a coarser one where interfaces would be too many triangles.

    Up to twice the usual, rounded to two digits.
    """
    volume_mm3 = abs(mesh.volume_mm3)
    sampled_mm = max(usual_mm, float(np.cbrt(volume_mm3 / _MOST_VOXELS)))
    area_mm2 = interface_area_mm2(mesh, field, levels, sampled_mm)
    needed_mm = float(np.sqrt(_FACES_PER_CELL * area_mm2 / _MOST_FACES))
    if needed_mm <= usual_mm:
        return usual_mm
    return float(f"{min(needed_mm, _COARSEST * usual_mm):.2g}")


# ------------------------------------------------------------------------------------------------
# Marching tetrahedra: all level sets of a field on one grid, which therefore never cross.


_OFF_LEVEL = 1e-3  # of the field's change to the next vertex

# A cube's tetrahedra: along its edges from corner 0 to corner 7, one for each order of the axes.
# Corner c is at (c & 1, c >> 1 & 1, c >> 2), and the first three are right-handed.
TETRAHEDRA = np.array(
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
    shared = (grid.values, grid.active, grid.origin_mm, grid.pitch_mm, levels, TETRAHEDRA, _EVEN)
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
    slot = key_slot(keys, key)
    if keys[slot] == key:
        return number[slot], made
    keys[slot] = key
    number[slot] = made
    t = (level - v[a]) / (v[b] - v[a])
    points[made, 0] = origin[0] + (i + t * (way & 1)) * pitch
    points[made, 1] = origin[1] + (j + t * (way >> 1 & 1)) * pitch
    points[made, 2] = origin[2] + (k + t * (way >> 2)) * pitch
    return np.int32(made), made + 1
