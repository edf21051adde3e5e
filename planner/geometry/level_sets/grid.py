"""The grid that level sets are drawn on, and the field's values at its vertices."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, FloatArray
from planner.errors import ArgumentError
from planner.geometry.columns import Grid, dense, iterate_columns
from planner.geometry.fields.field import Field
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.mesh import Mesh

__all__ = [
    "MOST_VERTICES",
    "FieldGrid",
    "active_cells",
    "default_pitch_mm",
    "field_grid",
    "touched_cells",
    "values_at",
]

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


def values_at(field: Field, points_mm: FloatArray) -> FloatArray:
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
        found = values_at(field, points)
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
        found[p] = in_cube(values, i, j, k, x - i, y - j, z - k)


@inner_kernel
def in_cube(values: Any, i: Any, j: Any, k: Any, x: Any, y: Any, z: Any) -> Any:
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
