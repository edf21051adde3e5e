"""Level sets on one grid: where it lies, its values, and marching tetrahedra over it."""

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.cutting.planes import LATTICE_MM
from planner.errors import ArgumentError
from planner.fields.basic import Field
from planner.glance import place_text
from planner.mesh.mesh import Mesh, compact, face_normal, key_slot
from planner.numerics import BoolArray, Float32Array, FloatArray, as_point, inner_kernel, kernel
from planner.voxels.columns import Grid, dense, iterate_columns

__all__ = ["TETRAHEDRA", "Lattice", "LevelSets", "default_pitch_mm", "draw_level_sets"]


# ------------------------------------------------------------------------------------------------
# The grid that level sets are drawn on, and the field's values at its vertices.


_MOST_VERTICES = 150_000_000
"""Of a grid: 9 bytes each, and some more where the part is."""

_USUAL_MM = 0.5  # about a printer's smallest feature: levels come out a tenth of it off
_LEAST_CELLS = 50  # along the mean edge of a small part's box
_FINEST_MM = 0.1
_MOST_USUAL = 2_000_000  # vertices of a large part's box
_CHUNK = 1 << 18


@dataclass(frozen=True, eq=False)
class FieldGrid:
    """A field on a grid of cells, and cubes of cells in which level sets are drawn.

    Attributes
    ----------
    origin_mm, pitch_mm
        Lower corner and edge of a cell.
    cells
        Along a cube's edge; a power of two.
    active : (nx, ny, nz) uint8
        Cubes that hold any of the part.
    values : (cells nx + 1, cells ny + 1, cells nz + 1) float64
        The field at the corners of cubes and of cells that hold any of the part, elsewhere NaN.
    """

    origin_mm: FloatArray
    pitch_mm: float
    cells: int
    active: NDArray[np.uint8]
    values: FloatArray


def default_pitch_mm(mesh: Mesh) -> float:
    """Return a pitch of 0.5 mm; finer for small parts, coarser for large ones.

    A fiftieth of the mean edge of a box smaller than 25 mm, 0.1 mm at least; or such that the
    box has about two million vertices. Rounded to
    two digits: the same for parts that differ by a hair.
    """
    extent_mm = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    edge_mm = math.cbrt(extent_mm.prod())
    fine_mm = max(min(_USUAL_MM, edge_mm / _LEAST_CELLS), _FINEST_MM)
    coarse_mm = max(edge_mm / math.cbrt(_MOST_USUAL), float(extent_mm.max()) / 2000.0)
    return float(f"{max(fine_mm, coarse_mm):.2g}")


def _check_pitch(mesh: Mesh, pitch_mm: float) -> None:
    """Refuse a grid of more vertices than there is room for."""
    extent_mm = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    vertices = float((extent_mm / pitch_mm + 4.0).prod())
    longest_mm = float(extent_mm.max())
    if vertices > _MOST_VERTICES or longest_mm / pitch_mm > 16000:
        least = max(math.cbrt(extent_mm.prod() / _MOST_VERTICES), longest_mm / 15990)
        raise ArgumentError(
            f"`pitch_mm` {pitch_mm:g}: this part would need {vertices:.2g} grid points, and "
            f"{_MOST_VERTICES:.2g} are possible; a pitch of {1.1 * least:.2g} mm or more fits"
        )


def _cells_held(
    mesh: Mesh, origin_mm: FloatArray, pitch_mm: float, shape: tuple[int, int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.uint8]]:
    """List the cells that each face may touch, and mark those that hold any of a part.

    Returns
    -------
    offsets : (m + 1,) int64
        Face f touches ``touched[offsets[f]:offsets[f + 1]]``, and a few more may be listed.
    touched : int32
        Numbers (i ny + j) nz + k.
    active : (nx, ny, nz) uint8
        1 where a cell is touched by the part's surface, or centred inside.
    """
    offsets = np.zeros(len(mesh.faces) + 1, dtype=np.int64)
    size = np.array(shape, dtype=np.int64)
    none = np.empty(0, dtype=np.int32)
    _touch(mesh.vertices, mesh.faces, origin_mm, pitch_mm, size, offsets, none)
    np.cumsum(offsets, out=offsets)
    touched = np.empty(offsets[-1], dtype=np.int32)
    _touch(mesh.vertices, mesh.faces, origin_mm, pitch_mm, size, offsets, touched)
    grid = Grid(as_point(origin_mm), (pitch_mm, pitch_mm, pitch_mm), shape)
    active = np.empty(shape, dtype=np.uint8)
    for columns in iterate_columns(mesh, grid):
        active[:, columns.first_row : columns.first_row + columns.rows] = dense(columns)
    active.reshape(-1)[touched] = 1
    return offsets, touched, active


def _values_at(field: Field, points_mm: FloatArray) -> FloatArray:
    """Return a field at points (n, 3), (n,), verified.

    Raises
    ------
    ArgumentError
        It gives another number of values, or one that is not finite.
    """
    if not len(points_mm):  # which functions of users need not take
        return np.empty(0)
    found = np.asarray(field.values(points_mm), dtype=np.float64)
    if found.shape != (len(points_mm),):
        raise ArgumentError(
            f"field {field.name!r}: it gave {found.shape} values for {len(points_mm)} points; it "
            "must give one number for each"
        )
    bad = ~np.isfinite(found)
    if bad.any():
        first = int(np.argmax(bad))
        raise ArgumentError(
            f"field {field.name!r}: it is {found[first]} at {place_text(points_mm[first])} as "
            "placed for printing; it must be finite over the part and a pitch around it"
        )
    return found


def _field_grid(
    field: Field, origin_mm: FloatArray, pitch_mm: float, held: NDArray[np.uint8],
    active: NDArray[np.uint8],
) -> FieldGrid:  # fmt: skip
    """Evaluate a field at the corners of cells, `held`, and of cubes, `active`.

    Raises
    ------
    ArgumentError
        A value is not finite.
    """
    cells = len(held) // len(active)
    wanted = _corners(held)
    wanted[::cells, ::cells, ::cells] |= _corners(active)
    values = np.full(wanted.shape, np.nan)
    layers = max(1, _CHUNK // wanted[0].size)
    for first in range(0, len(wanted), layers):
        own = slice(first, first + layers)
        index = np.argwhere(wanted[own]) + np.array([first, 0, 0])
        values[own][wanted[own]] = _values_at(field, origin_mm + index * pitch_mm)
    return FieldGrid(origin_mm, pitch_mm, cells, active, values)


def _corners(active: NDArray[np.uint8]) -> BoolArray:
    """Tell which vertices are corners of active cubes."""
    n, ny, nz = active.shape
    found = np.zeros((n + 1, ny + 1, nz + 1), dtype=np.bool_)
    marked = active.view(np.bool_)
    for i, j, k in np.ndindex(2, 2, 2):
        found[i : i + n, j : j + ny, k : k + nz] |= marked
    return found


@inner_kernel
def _cells_from(low: Any, high: Any, count: Any) -> Any:
    """Return those of so many cells in a row that a stretch, in their edges, has any of."""
    return range(max(int(np.floor(low)), 0), min(int(np.floor(high)), count - 1) + 1)


@kernel
def _touch(
    vertices: Any, faces: Any, origin: Any, pitch: Any, shape: Any, offsets: Any, cells: Any
) -> None:
    # With room for no cells: counts into offsets[f + 1]. Otherwise fills.
    margin = 1e-3  # of a pitch: far above what rounding moves a face by
    low, high = np.empty(3), np.empty(3)
    index = np.zeros(3, dtype=np.int64)
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            x, y, z = vertices[a, d], vertices[b, d], vertices[c, d]
            low[d] = (min(x, min(y, z)) - origin[d]) / pitch - margin
            high[d] = (max(x, max(y, z)) - origin[d]) / pitch + margin
        n = face_normal(vertices, a, b, c)
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
        for i in _cells_from(low[u], high[u], shape[u]):
            for j in _cells_from(low[v], high[v], shape[v]):
                first, last = low[w], high[w]
                if size > 0.0:
                    middle = a0 + su * (i + 0.5 - au) + sv * (j + 0.5 - av)
                    first, last = max(first, middle - spread), min(last, middle + spread)
                for k in _cells_from(first, last, shape[w]):
                    if cells.size:
                        index[u], index[v], index[w] = i, j, k
                        cells[count] = (index[0] * shape[1] + index[1]) * shape[2] + index[2]
                    count += 1
        if not cells.size:
            offsets[f + 1] = count


# ------------------------------------------------------------------------------------------------
# Positions as integers, of which signs of volumes can be decided exactly.


_BITS = 29  # of a coordinate: products of three differences then stay within two words


@dataclass(frozen=True, eq=False)
class Lattice:
    """Integer coordinates about an origin.

    Attributes
    ----------
    origin_mm : (3,) float64
        Where the integers are zero, on the lattice itself.
    unit_mm : float
        A power of two; `LATTICE_MM` for what fits a tray.
    """

    origin_mm: FloatArray
    unit_mm: float

    def integers(self, points_mm: FloatArray | Float32Array) -> NDArray[np.int64]:
        """Round positions (n, 3) to the lattice."""
        moved = np.asarray(points_mm, dtype=np.float64) - self.origin_mm
        return np.rint(moved / self.unit_mm).astype(np.int64)

    def rounded(self, points_mm: FloatArray) -> Float32Array:
        """Round positions to values that both the lattice and float32 hold."""
        return (np.rint(points_mm / self.unit_mm) * self.unit_mm + 0.0).astype(np.float32)


def _lattice_for(bounds_mm: FloatArray, margin_mm: float) -> Lattice:
    """Return the finest lattice on which a box and a margin about it can be decided."""
    low, high = bounds_mm[0] - margin_mm, bounds_mm[1] + margin_mm
    unit_mm = LATTICE_MM
    while float((high - low).max()) / unit_mm >= 2**_BITS:
        unit_mm *= 2.0
    return Lattice(np.floor(low / unit_mm) * unit_mm, unit_mm)


# ------------------------------------------------------------------------------------------------
# Marching tetrahedra: all level sets of a field on one grid, which therefore never cross.


_CELLS = 4
"""Along a cube's edge, where cubes are divided as the field asks for it."""

_DEEPEST = 6
"""Times that a cube's edge is halved at most."""

_CLEAR = 0.5
"""Of a cell: how far values beyond those of a cube's corners pass a level, for the cube to be
divided before any face is drawn in it. What bends less is seen by the faces around."""

_SURE_OFF = 0.8
"""Of the wanted distance: slopes are known to a tenth, and saddles bend between places."""

_FINEST = 4 << _DEEPEST
"""Parts of a cube's edge: also edges from the middle of a shortest one have their middle there."""

_STACK = 3 * _DEEPEST + 9
_MOST_ROUNDS = 4 * _DEEPEST

_KEPT_OFF = 1e-3
"""Of an edge: level sets keep so far off the grid's vertices, where faces shrink to nothing."""

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


_FACES, _FACES_EACH = 400_000, 1.4
"""Triangles of interfaces, and for each of the part's, beyond which none are divided: smooth fields
need a quarter of it, so it bounds the cost of fields with creases. When flat ones are merged, a
third or less is left."""


@dataclass(frozen=True, eq=False)
class LevelSets:
    """Surfaces of equal field in the cubes that hold any of a part.

    Attributes
    ----------
    vertices : (n, 3) float32
        In mm, on the lattice.
    faces : (m, 3) int32
        Normals towards larger values; in the order of the cubes.
    level, cell : (m,) int32
        The level of each face, and the number of its cube.
    lattice
        On which positions are compared.
    offsets : (k + 1,) int64, touched : int32
        Face f of the part may touch the cubes ``touched[offsets[f]:offsets[f + 1]]``.
    cubes : (nx, ny, nz) uint8
        1 where a cube holds any of the part, 2 where it has faces.
    cube, corner, corner_value
        Of the part's vertices: the number of the cube that each lies in, that cube's lower corner
        on the lattice, (v, 3), and the field there.
    field_range
        Values between which the field lies over the part, sought about the grid's extremes.
    flat_mm
        How far faces may come to lie from the level sets when they are merged.
    """

    vertices: Float32Array
    faces: NDArray[np.int32]
    level: NDArray[np.int32]
    cell: NDArray[np.int32]
    lattice: Lattice
    offsets: NDArray[np.int64]
    touched: NDArray[np.int32]
    cubes: NDArray[np.uint8]
    cube: NDArray[np.int32]
    corner: NDArray[np.int64]
    corner_value: FloatArray
    field_range: tuple[float, float]
    flat_mm: float


_FLAT = 0.05
"""How far apart planes are whose triangles are merged, of the wanted distance and of the least one
between levels: far less than either. With half of it a third more triangles are left."""

_Faces = tuple[FloatArray, NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]
"""Vertices in mm, faces, and of these the level and the cube."""


def draw_level_sets(
    mesh: Mesh, field: Field, levels: FloatArray, pitch_mm: float, shift: FloatArray,
    within_mm: float, *, follow: bool,
) -> LevelSets:  # fmt: skip
    """Draw all level sets of a field over a part.

    Parameters
    ----------
    levels : (L,) float64
        Strictly increasing.
    shift : (3,) float64
        Place of the grid's corner below the part's, in pitches beyond one: 0 to 1.
    within_mm
        How near faces have to be to their level set.
    follow
        Whether vertices lie where the field has its levels, or where it has them if linear between
        the grid's vertices.

    Raises
    ------
    ArgumentError
        The pitch is too fine, or a value of the field is not finite.
    """
    _check_pitch(mesh, pitch_mm)
    origin_mm = mesh.bounds_mm[0] - (1.0 + shift) * pitch_mm
    size = _CELLS if follow and np.isfinite(within_mm) else 1
    cubes = np.floor((mesh.bounds_mm[1] - origin_mm) / (size * pitch_mm) + 1e-2).astype(int) + 1
    nx, ny, nz = cubes.tolist()
    offsets, touched, active = _cells_held(mesh, origin_mm, size * pitch_mm, (nx, ny, nz))
    held = active
    if size > 1:
        _, _, held = _cells_held(mesh, origin_mm, pitch_mm, (size * nx, size * ny, size * nz))
        active |= held.reshape(nx, size, ny, size, nz, size).max(axis=(1, 3, 5))
    grid = _field_grid(field, origin_mm, pitch_mm, held, active)
    lattice = _lattice_for(mesh.bounds_mm, 4.0 * pitch_mm)
    most = _FACES + _FACES_EACH * len(mesh.faces)
    followed = field if follow else None
    points, faces, level, cell = _drawn_near(grid, levels, followed, within_mm, most)
    active.reshape(-1)[cell] = 2
    edge_mm = size * pitch_mm
    index = np.clip(((mesh.vertices - origin_mm) / edge_mm).astype(np.int64), 0, cubes - 1)
    cube = np.ravel_multi_index(tuple(index.T), active.shape).astype(np.int32)
    corner = lattice.integers(origin_mm + index * edge_mm)
    corner_value = grid.values[tuple(size * index.T)]
    rise = max(np.fmax.reduce(np.abs(np.diff(grid.values, axis=k)), axis=None) for k in range(3))
    apart_mm = pitch_mm * float(np.diff(levels).min(initial=np.inf)) / max(rise, 1e-300)
    flat_mm = min(_FLAT * within_mm, _FLAT * apart_mm)
    points_mm = lattice.rounded(points)
    ends = _extreme(grid, field, mesh.bounds_mm, -1.0), _extreme(grid, field, mesh.bounds_mm, 1.0)
    return LevelSets(
        points_mm, faces, level, cell, lattice, offsets, touched, active, cube, corner,
        corner_value, ends, flat_mm,
    )  # fmt: skip


_NARROWED = 12
"""How often the place of an extreme is halved: from a pitch to about a ten-thousandth of a mm."""


def _extreme(grid: FieldGrid, field: Field, bounds_mm: FloatArray, way: float) -> float:
    """Return the field's greatest value over a part (1), or its least (-1), and a little more."""
    corner = np.unravel_index(np.nanargmax(way * grid.values), grid.values.shape)
    middle_mm = grid.origin_mm + np.array(corner) * grid.pitch_mm
    about = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * 3, indexing="ij"), axis=-1)
    for k in range(_NARROWED):
        places = np.clip(middle_mm + about.reshape(-1, 3) * grid.pitch_mm / 2**k, *bounds_mm)
        found = way * _values_at(field, places)
        middle_mm = places[np.argmax(found)]
    return way * float(found.max() + np.ptp(found))


def _drawn_near(
    grid: FieldGrid, levels: FloatArray, field: Field | None, within_mm: float, most_faces: float
) -> _Faces:
    """Draw all level sets, and divide tetrahedra until faces are near enough.

    Where a level meets an edge is sought on the field itself. Along an edge levels keep their
    order, and in a tetrahedron all have the same diagonal. So none cross: who cuts off more of
    each edge cuts off more of the tetrahedron.

    Tetrahedra are halved by bisection (Maubach 1995), and with them those that share the edge, so
    that no corner lies within a neighbour's side. What is left is divided where creases of the
    field meet its edges, on which neighbours agree; at once, so that no round goes to what a
    halving took from its neighbours.

    Parameters
    ----------
    field
        None takes the field to be linear between the grid's vertices.
    most_faces
        Beyond these none are divided; those that misplace most volume come first.
    """
    none = np.empty((0, 3))
    places = np.empty(0, dtype=np.int64)
    divided = np.zeros(grid.active.shape, np.uint8)
    marks = _Marks(divided, places, none, none[:, 0], places.astype(np.uint8))
    if field is None or not np.isfinite(within_mm):
        one = _drawn(grid, levels, field, marks, 0)
        return one.points_mm, one.faces, one.level, one.cell
    marks, tried = _shown(grid, field, levels, marks, within_mm)
    rounds = [_drawn(grid, levels, field, marks, number) for number in (0, 1)]
    told: list[FloatArray] = []
    while (number := len(rounds)) <= _MOST_ROUNDS:
        held = [one.held(marks, n) for n, one in enumerate(rounds)]
        left = int(most_faces) - sum(map(np.count_nonzero, held))
        if left <= 0:
            break
        told += [_errors(field, one, levels) for one in rounds[len(told) :]]
        each = [
            (one.leaf[kept], one.cell[kept], *both[:, kept])
            for one, both, kept in zip(rounds, told, held, strict=True)
        ]
        leaf, cell, off_mm, area_mm2 = map(np.concatenate, zip(*each, strict=True))
        far = np.flatnonzero((off_mm > _SURE_OFF * within_mm) & (leaf[:, 5] < 3 * _DEEPEST))
        share = area_mm2[off_mm > within_mm].sum() / max(area_mm2.sum(), 1e-300)
        if not len(far) or (marks.sharp.any() and share < _LEFT_OFF * (1.0 - left / most_faces)):
            break
        worst = far[np.argsort(-(off_mm * area_mm2)[far], kind="stable")[:left]]
        # Far tetrahedra are halved, unless edges turn out to meet creases.
        marks.divided.reshape(-1)[cell[worst]] = number
        rest = leaf[worst]
        middle = rest[:, _EDGES].sum(axis=2) // 2
        new = ~_among(middle, tried)
        marks, tried = _creased(grid, field, marks, rest[:, :4], within_mm, tried, number)
        rest = rest[~(new & _among(middle, marks.places)).any(axis=1)]
        middles = (rest[:, 0] + rest[np.arange(len(rest)), rest[:, 4]]) // 2
        marks, leaves = _halved(grid, field, marks, middles, number)
        marks, tried = _creased(grid, field, marks, leaves, within_mm, tried, number)
        rounds.append(_drawn(grid, levels, field, marks, number))
    return _joined(rounds, marks)


@dataclass(frozen=True, eq=False)
class _Marks:
    """Vertices of tetrahedra within cubes.

    `divided` has the round in which each cube was divided last, `places` the numbers of vertices,
    rising, as a grid counts them in which all lie in the middle of the edge that they divide;
    `points_mm` where they do lie, `values` the field there. Those that are `sharp` are at a crease:
    they divide the tetrahedra around an edge that are left when all others have been halved.
    """

    divided: NDArray[np.uint8]
    places: NDArray[np.int64]
    points_mm: FloatArray
    values: FloatArray
    sharp: NDArray[np.uint8]

    def table(self, origin_mm: FloatArray) -> tuple[NDArray[Any], ...]:
        """Return a table of the places for kernels, and what they look up in it.

        Of each place whether it is sharp, where its vertex lies from an origin, and the value.
        """
        bits = max(4, int(2 * len(self.places)).bit_length())
        keys, index = np.zeros(1 << bits, dtype=np.int64), np.empty(1 << bits, dtype=np.int32)
        _fill(self.places, keys, index)
        return keys, index, self.sharp, self.points_mm - origin_mm, self.values

    def more(
        self, number: int, places: NDArray[np.int64], points_mm: FloatArray, values: FloatArray,
        sharp: int,
    ) -> "_Marks":  # fmt: skip
        """Add vertices, or put them in the place of those there, and tell cubes that have them."""
        found, first = np.unique(np.concatenate([places, self.places]), return_index=True)
        shape = np.array(self.divided.shape)
        index = _indices(self.divided, places)
        for corner in range(8):
            cube = (index - np.array([corner & 1, corner >> 1 & 1, corner >> 2])) // _FINEST
            cube = cube[((cube >= 0) & (cube < shape)).all(axis=1)]
            self.divided[tuple(cube.T)] = number
        points_mm = np.concatenate([points_mm, self.points_mm])[first]
        values = np.concatenate([values, self.values])[first]
        all_sharp = np.concatenate([np.full(len(places), sharp, np.uint8), self.sharp])[first]
        return _Marks(self.divided, found, points_mm, values, all_sharp)

    def seen(self, grid: FieldGrid, places: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
        """Return where vertices of tetrahedra lie, and the field there."""
        index = _indices(self.divided, places)
        points = _even_mm(grid, index)
        values = grid.values[tuple((index // _FINEST * grid.cells).T)]
        new = (index % _FINEST != 0).any(axis=1)
        at = np.searchsorted(self.places, places[new])
        points[new], values[new] = self.points_mm[at], self.values[at]
        return points, values


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Level sets in some cubes; vertices with a key that is the same wherever they are met.

    `leaf` is the tetrahedron that each face lies in, before creases divide it, as in `_root`; and
    `steepness` is the field's slope there, per mm.
    """

    key: NDArray[np.int64]
    points_mm: FloatArray
    faces: NDArray[np.int32]
    level: NDArray[np.int32]
    cell: NDArray[np.int32]
    leaf: NDArray[np.int64]
    steepness: FloatArray

    def held(self, marks: _Marks, number: int) -> BoolArray:
        """Tell which faces no later round replaces."""
        return np.asarray(marks.divided.reshape(-1)[self.cell] == number)


def _errors(field: Field, drawn: _Drawn, levels: FloatArray) -> FloatArray:
    """Estimate how far faces lie from their level set in mm, and their areas in mm2: (2, m).

    At their middle and their longest edge's.
    """
    mesh = Mesh(drawn.points_mm, drawn.faces)
    corners, each = mesh.triangles, np.arange(len(drawn.faces))
    way = np.roll(corners, -1, axis=1) - corners
    longest = np.square(way).sum(axis=2).argmax(axis=1)
    ends = corners[each, longest] + corners[each, (longest + 1) % 3]
    places = corners.sum(axis=1) / 3.0, 0.5 * ends
    off = np.maximum(*(np.abs(_values_at(field, at) - levels[drawn.level]) for at in places))
    with np.errstate(divide="ignore", invalid="ignore"):
        off_mm = np.where(off > 0.0, off / drawn.steepness, 0.0)
    return np.stack([off_mm, np.linalg.norm(mesh.area_vectors_mm2, axis=1)])


def _joined(rounds: list[_Drawn], marks: _Marks) -> _Faces:
    """Take from each cube what was drawn in it last."""
    both = [(one, one.held(marks, number)) for number, one in enumerate(rounds)]
    cell = np.concatenate([one.cell[kept] for one, kept in both])
    order = np.argsort(cell, kind="stable")
    level = np.concatenate([one.level[kept] for one, kept in both])[order]
    # A vertex lies where it was drawn last: an end of its edge may have moved.
    key, place = np.unique(np.concatenate([one.key for one in rounds[::-1]]), return_index=True)
    points = np.concatenate([one.points_mm for one in rounds[::-1]])[place]
    at = np.searchsorted(key, np.concatenate([one.key[one.faces[kept]] for one, kept in both]))
    used, faces = compact(at[order].astype(np.int32), len(key))
    return points[used], faces, level, cell[order]


def _drawn(
    grid: FieldGrid, levels: FloatArray, field: Field | None, marks: _Marks, number: int
) -> _Drawn:
    """Draw the level sets in the cubes that were divided in a round."""
    cubes = (grid.values, grid.cells, grid.active, grid.pitch_mm)
    given = (cubes, marks.divided, number, levels, marks.table(grid.origin_mm))
    count = made = 0
    while True:  # first with room for nothing, to count
        bits = max(4, int(2 * count + 1).bit_length())
        keys, index = np.zeros(1 << bits, dtype=np.int64), np.empty(1 << bits, dtype=np.int32)
        ends = np.empty((2 * count + 4, 2), dtype=np.int64)
        faces, of_face = np.empty((2, count, 3), dtype=np.int32)
        leaf, steepness = np.empty((count, 7), dtype=np.int64), np.empty(count)
        count, made = _march(*given, keys, index, ends, faces, of_face, leaf, steepness)
        if len(faces) == count:
            break
    held = np.flatnonzero(keys)
    key, of_vertex = np.empty(made, dtype=np.int64), np.empty(made, dtype=np.int32)
    key[index[held]] = keys[held]
    of_vertex[faces] = of_face[:, :1]
    points = _met(grid, field, marks, ends[:made], levels[of_vertex])
    level, cell = of_face[:, 0].copy(), of_face[:, 1].copy()
    return _Drawn(key, points, faces, level, cell, leaf, steepness)


def _halved(
    grid: FieldGrid, field: Field, marks: _Marks, places: NDArray[np.int64], number: int
) -> tuple[_Marks, NDArray[np.int64]]:
    """Halve tetrahedra at edges' middles, and those that then have a corner within an edge.

    Also returned: the tetrahedra in all cubes that were divided in the round, (n, 4).
    """
    leaves = np.empty((0, 4), dtype=np.int64)
    while True:
        places = np.unique(places)
        points = _even_mm(grid, _indices(grid.active, places))
        marks = marks.more(number, places, points, _values_at(field, points), 0)
        room = np.empty(max(4 * len(places), 1000), dtype=np.int64)
        given = grid.active, marks.divided, number, marks.table(grid.origin_mm), room
        found, count = _hanging(*given, leaves)
        if not found:
            leaves = np.empty((count, 4), dtype=np.int64)
            _hanging(*given, leaves)
            return marks, leaves
        places = room[:found]


def _among(values: NDArray[np.int64], rising: NDArray[np.int64]) -> BoolArray:
    """Tell which are in a rising array: numpy's `isin` hashes, of millions twenty times as slow."""
    return np.asarray(np.append(rising, -1)[np.searchsorted(rising, values)] == values)


_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])

_NEAR_END = 1.0 / 64.0
"""Of an edge: over how much of it at each end its slope is taken, and how near to its end no crease
divides it."""

_SHARP = 0.8
"""Of what two slopes foretell: how far a field bends at least where it has a crease. One that bends
evenly comes to 0.5."""

_LEFT_OFF = 0.01
"""Of the area: where creases meet in a line no division ends. It is over when no more is off than
the check of interfaces leaves, or as much less as triangles are fewer than they may become."""


def _creased(
    grid: FieldGrid, field: Field, marks: _Marks, corners: NDArray[np.int64], within_mm: float,
    tried: NDArray[np.int64], number: int,
) -> tuple[_Marks, NDArray[np.int64]]:  # fmt: skip
    """Divide edges of tetrahedra, (n, 4), at creases, but for those `tried` before.

    Also returned: the middles of all edges that were ever tried.
    """
    ends = corners[:, _EDGES].reshape(-1, 2)
    places, first = np.unique(ends.sum(axis=1) // 2, return_index=True)
    new = ~_among(places, tried)
    sharp, points, values = _crease(grid, field, marks, ends[first[new]], within_mm)
    tried = np.sort(np.concatenate([tried, places[new]]), kind="stable")  # merges
    places = places[new][sharp]
    return marks.more(number, places, points[sharp], values[sharp], 1), tried


def _crease(
    grid: FieldGrid, field: Field, marks: _Marks, ends: NDArray[np.int64], within_mm: float
) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Tell which edges meet a crease that matters, where, and the field there."""
    (start, low), (end, high) = (marks.seen(grid, ends[:, side]) for side in (0, 1))
    way = end - start
    rise = (_values_at(field, start + _NEAR_END * way) - low) / _NEAR_END
    fall = (high - _values_at(field, end - _NEAR_END * way)) / _NEAR_END
    sharp, points, values, bent = _meeting(field, start, way, low, high, rise, fall)
    steep = np.maximum(np.abs(rise), np.abs(fall)) / np.sqrt((way**2).sum(axis=1))
    return sharp & (np.abs(bent) > 2.0 * _SURE_OFF * within_mm * steep), points, values


def _meeting(
    field: Field, start: FloatArray, way: FloatArray, low: FloatArray, high: FloatArray,
    rise: FloatArray, fall: FloatArray,
) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """Tell whether stretches have a crease, where, the field there, and how far it bends.

    A crease is where the lines meet that rise from one end and to the other, if the field is there
    what they foretell.
    """
    with np.errstate(all="ignore"):
        share = (high - low - fall) / (rise - fall)
    inner = (share >= _NEAR_END) & (share <= 1.0 - _NEAR_END)
    share = np.where(inner, share, 0.5)
    points = start + share[:, None] * way
    values = _values_at(field, points)
    straight = low + share * (high - low)
    bent, foretold = values - straight, low + share * rise - straight
    return inner & (bent * np.sign(foretold) > _SHARP * np.abs(foretold)), points, values, bent


def _indices(cubes: NDArray[np.uint8], places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return coordinates of vertices, (n, 3), in parts of the cubes' edges."""
    return np.stack(np.unravel_index(places, [n * _FINEST + 1 for n in cubes.shape]), axis=-1)


def _places(grid: FieldGrid, index: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the numbers of vertices, of which `_indices` returns the coordinates (..., 3)."""
    _, ny, nz = (n * _FINEST + 1 for n in grid.active.shape)
    return np.asarray(index @ np.array([ny * nz, nz, 1]))


def _even_mm(grid: FieldGrid, index: NDArray[np.int64]) -> FloatArray:
    """Return where vertices lie that are in the middle of their edges; see `_indices`."""
    return np.asarray(grid.origin_mm + index * (grid.cells * grid.pitch_mm / _FINEST))


def _shown(
    grid: FieldGrid, field: Field, levels: FloatArray, marks: _Marks, within_mm: float
) -> tuple[_Marks, NDArray[np.int64]]:
    """Divide cubes whose corners do not show all levels: at creases, and where these do not do.

    Walls thinner than a cube have few triangles where creases show what corners do not.

    Also returned: the middles of all edges in which a crease was sought.
    """
    sizes = [2**n for n in range(1, grid.cells.bit_length())]
    found = [_hides(grid.values, size, levels) for size in sizes]
    for small, large in itertools.pairwise(found):
        x, y, z = large.shape
        large |= small.reshape(x, 2, y, 2, z, 2).max(axis=(1, 3, 5))
    cubes = np.argwhere(found[-1])
    corners = np.arange(8)[:, None] >> np.arange(3) & 1
    each = _places(grid, _FINEST * (cubes[:, None] + corners))[:, TETRAHEDRA]
    none = np.empty(0, dtype=np.int64)
    marks, tried = _creased(grid, field, marks, each.reshape(-1, 4), within_mm, none, 1)
    # What the field is at least and at most at creases of a cube.
    middle = (each[:, :, _EDGES].sum(axis=-1) // 2).reshape(len(cubes), 36)
    at = np.append(marks.values, np.nan)[np.searchsorted(marks.places, middle)]
    at = np.where(_among(middle, marks.places), at, np.nan)
    seen = np.full((2, *found[-1].shape), np.nan)
    seen[:, *cubes.T] = np.fmin.reduce(at, axis=1), np.fmax.reduce(at, axis=1)
    shown = ~np.isnan(seen[0]) & ~_hides(grid.values, grid.cells, levels, *seen)
    wanted = [none]
    inner = np.delete(np.indices((3, 3, 3)).reshape(3, 27).T, (0, 2, 6, 8, 18, 20, 24, 26), axis=0)
    for size, hidden in zip(sizes, found, strict=True):
        parts = grid.cells // size
        hidden &= ~shown.repeat(parts, axis=0).repeat(parts, axis=1).repeat(parts, axis=2)
        twice = 2 * np.argwhere(hidden)[:, None] + inner
        wanted.append(_places(grid, twice * (_FINEST // parts // 2)).ravel())
    marks, leaves = _halved(grid, field, marks, np.concatenate(wanted), 1)
    return _creased(grid, field, marks, leaves, within_mm, tried, 1)


def _hides(
    values: FloatArray, size: int, levels: FloatArray, least: Any = np.nan, most: Any = np.nan
) -> BoolArray:
    """Tell which cubes, of a size in cells, have a level far beyond what is seen of them.

    That is the values of their corners, and a least and a greatest value where they are known.
    """
    low = lowest = high = highest = np.array(np.nan)
    for first in itertools.product(range(size + 1), repeat=3):
        x, y, z = (slice(d, n + d - size, size) for d, n in zip(first, values.shape, strict=True))
        at = values[x, y, z]
        lowest, highest = np.fmin(lowest, at), np.fmax(highest, at)
        if all(d % size == 0 for d in first):
            low, high = (at, at) if not any(first) else (np.minimum(low, at), np.maximum(high, at))
    off = _CLEAR * (highest - lowest) / size
    low, high = np.fmin(low, least), np.fmax(high, most)
    rank = [levels.searchsorted(v, side="right") for v in (lowest + off, low, high, highest - off)]
    return np.asarray(~np.isnan(low) & ((rank[0] < rank[1]) | (rank[2] < rank[3])))


_ROOT_STEPS = 6
_SURE = 0.05
"""Of an edge: after a step so short the next one is a few thousandths."""


def _met(
    grid: FieldGrid, field: Field | None, marks: _Marks, ends: NDArray[np.int64], level: FloatArray
) -> FloatArray:
    """Find where levels meet edges, by inverse quadratic interpolation within brackets."""
    (start, first), (end, last) = (marks.seen(grid, ends[:, side]) for side in (0, 1))
    below, above = first - level, last - level
    share = below / (below - above)
    if field is None:
        return np.asarray(start + share[:, None] * (end - start))
    rising = last > first
    left, low, high = np.arange(len(share)), np.zeros(len(share)), np.ones(len(share))
    for _ in range(_ROOT_STEPS):
        t, a, b, fa, fb = share[left], low[left], high[left], below[left], above[left]
        f = _values_at(field, start[left] + t[:, None] * (end[left] - start[left])) - level[left]
        with np.errstate(all="ignore"):
            better = (
                a * (f * fb) / ((fa - f) * (fa - fb)) + t * (fa * fb) / ((f - fa) * (f - fb))
                + b * (fa * f) / ((fb - fa) * (fb - f))
            )  # fmt: skip
        beyond = (f < 0.0) == rising[left]
        a, fa = np.where(beyond, t, a), np.where(beyond, f, fa)
        b, fb = np.where(beyond, b, t), np.where(beyond, fb, f)
        # Where the field is straight it may be an end, or beyond it by rounding.
        inside = (better > a - 1e-9) & (better < b + 1e-9)
        better = np.where(inside, np.clip(better, a, b), 0.5 * (a + b))
        better = np.where(f == 0.0, t, better)
        share[left], low[left], high[left], below[left], above[left] = better, a, b, fa, fb
        left = left[np.abs(better - t) > _SURE]
        if not len(left):
            break
    share = _in_order(ends.sum(axis=1), np.where(rising, level, -level), share)
    return np.asarray(start + share[:, None] * (end - start))


def _in_order(edge: NDArray[np.int64], rank: FloatArray, share: FloatArray) -> FloatArray:
    """Let levels follow each other along each edge, strictly, and keep off its ends."""
    order = np.lexsort((rank, edge))
    first = np.append(True, np.diff(edge[order]) != 0)[: len(order)]
    number, starts = np.cumsum(first) - 1, np.flatnonzero(first)
    count = np.diff(np.append(starts, len(order)))[number]
    place = (np.arange(len(order)) - starts[number] + 1.0) / (count + 1.0)
    rising = np.maximum.accumulate(share[order] + 2.0 * number) - 2.0 * number
    found = np.empty(len(order))
    found[order] = (1.0 - 2.0 * _KEPT_OFF) * rising + 2.0 * _KEPT_OFF * place
    return found


@kernel
def _fill(places: Any, keys: Any, index: Any) -> None:
    for n in range(places.size):
        slot = key_slot(keys, places[n] + 1)
        keys[slot], index[slot] = places[n] + 1, n


@inner_kernel
def _root(stack: Any, t: Any, i: Any, j: Any, k: Any, ny: Any, nz: Any) -> None:
    """Begin with a tetrahedron of a cube.

    A row has its vertices, the last of them at the refinement edge's end, how often it was halved,
    and whether it is left-handed.
    """
    for c in range(4):
        b = TETRAHEDRA[t, c]
        x, y, z = (i + (b & 1)) * _FINEST, (j + (b >> 1 & 1)) * _FINEST, (k + (b >> 2)) * _FINEST
        stack[0, c] = (x * (ny * _FINEST + 1) + y) * (nz * _FINEST + 1) + z
    stack[0, 4], stack[0, 5], stack[0, 6] = 3, 0, 1 if t >= 3 else 0


@inner_kernel
def _copy(into: Any, one: Any) -> None:
    """Copy a tetrahedron."""
    for c in range(7):
        into[c] = one[c]


@inner_kernel
def _halve(stack: Any, top: Any) -> Any:
    """Replace a tetrahedron by its halves (Maubach 1995); return how many there are then."""
    tag = stack[top, 4]
    middle = (stack[top, 0] + stack[top, tag]) // 2
    _copy(stack[top + 1], stack[top])
    for c in range(tag):
        stack[top + 1, c] = stack[top, c + 1]
    stack[top, tag] = stack[top + 1, tag] = middle
    stack[top, 4] = stack[top + 1, 4] = tag - 1 if tag > 1 else 3
    stack[top, 5] = stack[top + 1, 5] = stack[top, 5] + 1
    stack[top + 1, 6] = stack[top, 6] ^ (tag & 1)
    return top + 2


@inner_kernel
def _divides(stack: Any, top: Any, a: Any, b: Any, marks: Any) -> Any:
    """Tell what divides an edge of a tetrahedron: nothing (0), a halving (1), a crease (2)."""
    keys, index, sharp, _, _ = marks
    slot = key_slot(keys, (stack[top, a] + stack[top, b]) // 2 + 1)
    return 0 if keys[slot] == 0 else 1 + sharp[index[slot]]


@inner_kernel
def _is_halved(stack: Any, top: Any, marks: Any) -> Any:
    """Tell whether a tetrahedron has another's corner within one of its edges."""
    for a in range(3):
        for b in range(a + 1, 4):
            if _divides(stack, top, a, b, marks) == 1:
                return True
    return False


@inner_kernel
def _divide_at_crease(stack: Any, top: Any, marks: Any) -> Any:
    """Divide a tetrahedron at a crease, if any meets an edge; return how many there are then.

    Of several creases the one with the largest number comes first, so that what is on both sides
    of a triangle divides it alike.
    """
    middle, first, last = -1, 0, 0
    for a in range(3):
        for b in range(a + 1, 4):
            place = (stack[top, a] + stack[top, b]) // 2
            if place > middle and _divides(stack, top, a, b, marks) == 2:
                middle, first, last = place, a, b
    if middle < 0:
        return top
    _copy(stack[top + 1], stack[top])
    stack[top, first] = stack[top + 1, last] = middle
    stack[top, 4] = stack[top + 1, 4] = 0
    return top + 2


@kernel
def _hanging(active: Any, divided: Any, number: Any, marks: Any, missing: Any, leaves: Any) -> Any:
    """List places at which tetrahedra have to be halved as well, and the tetrahedra that need not.

    Returned is how many of both there are; of places as many as there is room for.
    """
    found = count = 0
    stack = np.empty((_STACK, 7), dtype=np.int64)
    for i, j, k in np.ndindex(active.shape):
        if active[i, j, k] == 0 or divided[i, j, k] != number:
            continue
        for t in range(6):
            _root(stack, t, i, j, k, active.shape[1], active.shape[2])
            left = 1
            while left > 0:
                left -= 1
                if not _is_halved(stack, left, marks):
                    if count < leaves.shape[0]:
                        for c in range(4):
                            leaves[count, c] = stack[left, c]
                    count += 1
                    continue
                last = stack[left, 4]
                if _divides(stack, left, 0, last, marks) != 1:
                    if found == missing.shape[0]:
                        return found, count
                    missing[found] = (stack[left, 0] + stack[left, last]) // 2
                    found += 1
                left = _halve(stack, left)
    return found, count


@inner_kernel
def _seen(place: Any, grid: Any, marks: Any, at: Any) -> Any:
    """Fill in where a vertex lies, in mm from the grid's corner, and return the field there."""
    (values, cells, active, pitch), (keys, index, _, points, value_at) = grid, marks
    ny, nz = active.shape[1] * _FINEST + 1, active.shape[2] * _FINEST + 1
    x, y, z = place // (ny * nz), place // nz % ny, place % nz
    if x % _FINEST == 0 and y % _FINEST == 0 and z % _FINEST == 0:
        x, y, z = x // _FINEST * cells, y // _FINEST * cells, z // _FINEST * cells
        at[0], at[1], at[2] = x * pitch, y * pitch, z * pitch
        return values[x, y, z]
    n = index[key_slot(keys, place + 1)]
    for d in range(3):
        at[d] = points[n, d]
    return value_at[n]


@inner_kernel
def _slope(at: Any, v: Any) -> Any:
    """Length of the gradient of what is linear in a tetrahedron."""
    normals = face_normal(at, 0, 2, 3), face_normal(at, 0, 3, 1), face_normal(at, 0, 1, 2)
    square = volume = 0.0
    for d in range(3):
        total = 0.0
        for c in range(3):
            total += (v[c + 1] - v[0]) * normals[c][d]
        volume += (at[1, d] - at[0, d]) * normals[0][d]
        square += total * total
    return np.sqrt(square) / abs(volume)


@kernel
def _march(
    grid: Any, divided: Any, number: Any, levels: Any, marks: Any, keys: Any, index: Any,
    ends: Any, faces: Any, of_face: Any, leaf: Any, steepness: Any,
) -> Any:  # fmt: skip
    # With room for no faces: counts them. Otherwise fills.
    active = grid[2]
    nx, ny, nz = active.shape
    count, made, drawing = 0, 0, faces.shape[0] > 0
    v, at, met = np.empty(4), np.empty((4, 3)), np.empty((4, 3))
    vertex, whole = np.empty(4, dtype=np.int32), np.empty(7, dtype=np.int64)
    stack = np.empty((_STACK, 7), dtype=np.int64)
    for cube in range(nx * ny * nz):
        i, j, k = cube // (ny * nz), cube // nz % ny, cube % nz
        if active[i, j, k] == 0 or divided[i, j, k] != number:
            continue
        for t in range(6):
            _root(stack, t, i, j, k, ny, nz)
            left = 1
            while left > 0:
                left -= 1
                if stack[left, 4] > 0:
                    if number > 0 and _is_halved(stack, left, marks):
                        left = _halve(stack, left)
                        continue
                    _copy(whole, stack[left])
                if number > 0:
                    more = _divide_at_crease(stack, left, marks)
                    if more > left:
                        left = more
                        continue
                low, high = np.inf, -np.inf
                for c in range(4):
                    v[c] = _seen(stack[left, c], grid, marks, at[c])
                    low, high = min(low, v[c]), max(high, v[c])
                first = np.searchsorted(levels, low, side="right")
                slope, across = -1.0, -1
                for n in range(first, levels.size):
                    level = levels[n]
                    if level > high:
                        break
                    below, some = 0, 0
                    for c in range(4):
                        if v[c] < level:
                            below |= 1 << c
                            some += 1
                    if not drawing:
                        count += 2 if some == 2 else 1
                        continue
                    if slope < 0.0:
                        slope = _slope(at, v)
                    p, q = _EVEN[below, 0], _EVEN[below, 1]
                    r, s = _EVEN[below, 2], _EVEN[below, 3]
                    sides, pairs = 3, ((p, q), (p, r), (p, s), (p, s))
                    if some == 2:
                        sides, pairs = 4, ((p, r), (p, s), (q, s), (q, r))
                    for e in range(sides):
                        a, b = pairs[e]
                        if stack[left, a] > stack[left, b]:
                            a, b = b, a
                        key = (stack[left, a] + stack[left, b]) * levels.size + n + 1
                        slot = key_slot(keys, key)
                        if keys[slot] == 0:
                            keys[slot], index[slot] = key, made
                            ends[made, 0], ends[made, 1] = stack[left, a], stack[left, b]
                            made += 1
                        vertex[e] = index[slot]
                        share = (level - v[a]) / (v[b] - v[a])
                        for d in range(3):
                            met[e, d] = at[a, d] + share * (at[b, d] - at[a, d])
                    if sides == 4 and across < 0:  # all levels have the first one's diagonal
                        across = 1 if _apart(met, 1, 3) < _apart(met, 0, 2) else 0
                    turned = (stack[left, 6] == 1) ^ (some == 3)
                    begin = across if sides == 4 else 0
                    for e in range(sides - 2):
                        y = vertex[(begin + e + 1) % sides]
                        z = vertex[(begin + e + 2) % sides]
                        if turned:
                            y, z = z, y
                        faces[count, 0], faces[count, 1], faces[count, 2] = vertex[begin], y, z
                        of_face[count, 0], of_face[count, 1] = n, cube
                        _copy(leaf[count], whole)
                        steepness[count] = slope
                        count += 1
    return count, made


@inner_kernel
def _apart(points: Any, a: Any, b: Any) -> Any:
    square = 0.0
    for d in range(3):
        square += (points[a, d] - points[b, d]) ** 2
    return square
