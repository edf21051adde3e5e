"""Triangle meshes in millimetres: positions joined where equal, edges, bodies, shells that fit."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from planner.numerics import BoolArray, Float32Array, FloatArray, Int32Array, inner_kernel, kernel

__all__ = [
    "JoinedShells",
    "Measures",
    "Mesh",
    "Topology",
    "cancel_opposite",
    "compact",
    "connected",
    "face_normal",
    "join_shells",
    "key_slot",
    "measure",
    "number_groups",
    "order_edges",
    "order_rows",
    "repeats_index",
    "sorted_corners",
    "unite",
    "weld",
    "weld_points",
]


# ------------------------------------------------------------------------------------------------
# A triangle mesh in millimetres.


_Floats = Float32Array | FloatArray


class Measures(NamedTuple):
    """What `measure` finds of each part of a surface.

    Attributes
    ----------
    volume_mm3, area_mm2 : (parts,) float64
        The volume is negative for a surface turned inside out; both are 0 without faces.
    bounds_mm : (parts, 2, 3) float64
        Smallest and largest coordinates: inf and -inf without faces, NaN where one is NaN.
    flat : int
        Triangles of zero area, in all parts.
    """

    volume_mm3: FloatArray
    area_mm2: FloatArray
    bounds_mm: FloatArray
    flat: int


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices and the triangles between them, normals outwards by the right-hand rule.

    Attributes
    ----------
    vertices : (n, 3) float64
        Positions in mm.
    faces : (m, 3) int32
        Indices into `vertices`, counter-clockwise as seen from outside.
    """

    vertices: FloatArray
    faces: Int32Array

    def __post_init__(self) -> None:
        # Kernels are kept for one kind of array: plain, contiguous and writable.
        for name, kind in (("vertices", np.float64), ("faces", np.int32)):
            object.__setattr__(self, name, np.require(getattr(self, name), kind, ["C", "W", "E"]))

    @cached_property
    def triangles(self) -> FloatArray:
        """Corner positions, (m, 3, 3) in mm."""
        return self.vertices.take(self.faces, axis=0)

    @cached_property
    def area_vectors_mm2(self) -> FloatArray:
        """Outward normals of the faces, as long as their areas, (m, 3)."""
        a, b, c = self.triangles.transpose(1, 0, 2)
        return np.asarray(0.5 * np.cross(b - a, c - a))

    @property
    def normals(self) -> FloatArray:
        """Outward normals of the faces, of length 1, (m, 3); 0 of a face without area."""
        length = np.linalg.norm(self.area_vectors_mm2, axis=1, keepdims=True)
        return np.asarray(self.area_vectors_mm2 / np.maximum(length, 1e-300))

    @cached_property
    def bounds_mm(self) -> FloatArray:
        """Smallest and largest coordinate of the vertices that faces use, (2, 3) in mm."""
        return np.asarray(self._measured.bounds_mm[0])

    @property
    def volume_mm3(self) -> float:
        """Signed volume in mm³: positive where normals point outwards."""
        return float(self._measured.volume_mm3[0])

    @property
    def area_mm2(self) -> float:
        """Surface area in mm²."""
        return float(self._measured.area_mm2[0])

    @cached_property
    def _measured(self) -> Measures:
        return measure(self.vertices, self.faces)


def measure(
    vertices: _Floats, faces: Int32Array, part: Int32Array | None = None, parts: int = 1
) -> Measures:
    """Measure each part of a surface.

    Volumes are by the divergence theorem, summed about a vertex of the part: about a distant
    origin the terms would cancel and take the digits with them. The order of summation is fixed.

    Parameters
    ----------
    vertices : (n, 3) array
        Positions in mm.
    faces : (m, 3) int32
        Outward triangles.
    part : (m,) int32
        Which part each triangle belongs to, from 0 on; by default all to one.
    parts : int
        How many there are.
    """
    part = np.zeros(len(faces), dtype=np.int32) if part is None else part
    volume, area, origin = np.zeros(parts), np.zeros(parts), np.full((parts, 3), np.nan)
    bounds = np.empty((parts, 2, 3))
    bounds[:, 0], bounds[:, 1] = np.inf, -np.inf
    points = np.require(vertices, np.float64, ["C", "W", "E"])
    first = np.unique(part, return_index=True)[1] if parts > 1 else np.arange(min(len(part), 1))
    origin[part[first]] = points[faces[first, 0]]
    faces = np.require(faces, np.int32, ["C", "W", "E"])
    flat = _measure(points, faces, part, origin, volume, area, bounds, np.empty((3, 3)))
    return Measures(volume / 6.0, area / 2.0, bounds, int(flat))


@kernel
def _measure(
    vertices: Any, faces: Any, part: Any, origin: Any, volume: Any, area: Any, bounds: Any, at: Any
) -> Any:
    flat = 0
    for i in range(part.size):
        p = part[i]
        for j in range(3):
            for k in range(3):
                x = vertices[faces[i, j], k]
                at[j, k] = x - origin[p, k]
                if x < bounds[p, 0, k] or x != x:  # NaN, which then stays
                    bounds[p, 0, k] = x
                if x > bounds[p, 1, k] or x != x:
                    bounds[p, 1, k] = x
        along, squared, is_flat = 0.0, 0.0, True
        for k in range(3):
            y, z = (k + 1) % 3, (k + 2) % 3
            uy, uz = at[1, y] - at[0, y], at[1, z] - at[0, z]
            vy, vz = at[2, y] - at[0, y], at[2, z] - at[0, z]
            normal = uy * vz - uz * vy
            along += at[0, k] * normal
            squared += normal * normal
            is_flat &= normal == 0.0
        volume[p] += along
        area[p] += np.sqrt(squared)
        flat += is_flat
    return flat


# ------------------------------------------------------------------------------------------------
# Give equal positions one index, and take out the faces that weld to nothing.


_Points = TypeVar("_Points", Float32Array, FloatArray)


def weld(triangles: _Points) -> tuple[_Points, Int32Array]:
    """Index a triangle soup by exact position: corners of equal bits share a vertex.

    Minus zero counts as zero. Nothing is merged within a tolerance, no face is dropped.

    Parameters
    ----------
    triangles : (k, 3, 3) float32 or float64
        Corner positions.

    Returns
    -------
    vertices : (n, 3) array of the same type
        Distinct positions in the order of their first appearance.
    faces : (k, 3) int32
        Indices into `vertices`.
    """
    vertices, faces = weld_points(triangles.reshape(-1, 3))
    return vertices, faces.reshape(-1, 3)


def weld_points(points: _Points) -> tuple[_Points, Int32Array]:
    """Index points, (k, 3), as `weld` does: distinct positions (n, 3) and an index (k,)."""
    # No minus zero is left.
    words = np.add(points, 0.0, order="C", dtype=points.dtype).view(np.uint32)
    distinct = np.empty_like(words)
    index = np.empty(len(words), dtype=np.int32)
    bits = max(10, (4 * len(words) // 3).bit_length())  # at most three quarters are taken
    n = _weld(words, distinct, index, np.zeros(1 << bits, np.int32), np.uint64(64 - bits))
    return distinct[:n].copy().view(points.dtype), index


@kernel
def _weld(rows: Any, distinct: Any, index: Any, table: Any, shift: Any) -> Any:
    """Give equal rows of uint32 one number; return how many are distinct.

    An open-addressed table has the number + 1 of a row of `distinct`, and 0 where it is free. Slots
    are the top bits of the hash, all but `shift`: low bits of round coordinates are all zero.
    """
    n = 0
    for i in range(rows.shape[0]):
        mixed = np.uint64(0)  # a product hash, whose top bits are the best
        for k in range(rows.shape[1]):
            mixed = (mixed ^ np.uint64(rows[i, k])) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(32)
        slot = np.int64((mixed * np.uint64(0xD6E8FEB86659FD93)) >> shift)
        while table[slot] > 0:
            same = True
            for k in range(rows.shape[1]):
                same &= distinct[table[slot] - 1, k] == rows[i, k]
            if same:
                break
            slot = (slot + 1) & (table.size - 1)
        if table[slot] == 0:
            for k in range(rows.shape[1]):
                distinct[n, k] = rows[i, k]
            n += 1
            table[slot] = n
        index[i] = table[slot] - 1
    return n


@inner_kernel
def key_slot(keys: Any, key: Any) -> Any:
    """Find where an open-addressed table has a positive key, or the free slot (0) for it."""
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    slot = np.int64((mixed ^ (mixed >> np.uint64(32))) & np.uint64(keys.size - 1))
    while keys[slot] != 0 and keys[slot] != key:
        slot = (slot + 1) & (keys.size - 1)
    return slot


@inner_kernel
def face_normal(points: Any, a: Any, b: Any, c: Any) -> Any:
    """Return the normal of a triangle between points, twice its area long."""
    ax, ay, az = points[a, 0], points[a, 1], points[a, 2]
    ux, uy, uz = points[b, 0] - ax, points[b, 1] - ay, points[b, 2] - az
    vx, vy, vz = points[c, 0] - ax, points[c, 1] - ay, points[c, 2] - az
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def compact(faces: Int32Array, vertices: int) -> tuple[NDArray[np.intp], Int32Array]:
    """Return which of so many vertices some faces use, and the faces in terms of those alone."""
    used = np.zeros(vertices, dtype=np.bool_)
    used[faces.ravel()] = True
    index = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(used), index.take(faces)


def repeats_index(faces: Int32Array) -> BoolArray:
    """Tell which faces, (m, 3), name a vertex twice."""
    a, b, c = faces.T
    return np.asarray((a == b) | (b == c) | (c == a))


def cancel_opposite(faces: Int32Array, label: Int32Array | None = None) -> BoolArray:
    """Tell which faces stay when faces on the same three vertices but turned over cancel.

    Of a triple with p faces one way and q the other, the first |p - q| of the more frequent
    way stay. The boundary of the surface does not change. What names a vertex twice does not stay.

    Parameters
    ----------
    faces : (m, 3) int32
    label : (m,) int32
        From 0 on: faces of different labels do not cancel.

    Returns
    -------
    (m,) bool
        True where a face stays.
    """
    keep = ~repeats_index(faces)
    order, starts = order_rows(*(() if label is None else (label,)), *sorted_corners(faces))
    count = np.diff(starts, append=len(order))
    way = np.where(_turned(faces.take(order, axis=0)), -1, 1)
    net = np.repeat(np.add.reduceat(way, starts), count)
    frequent = way * net > 0
    rank = np.cumsum(frequent)
    rank -= np.repeat(rank[starts] - frequent[starts], count)
    keep[order] &= frequent & (rank <= np.abs(net))
    return keep


def _turned(faces: Int32Array) -> BoolArray:
    """Tell which faces run from their lowest vertex to the highest before the middle one."""
    a, b, c = faces.T
    return np.asarray((a < b) ^ (b < c) ^ (c < a))


def sorted_corners(faces: Int32Array) -> tuple[Int32Array, Int32Array, Int32Array]:
    """Lowest, middle and highest vertex of each face: the same for faces on the same three."""
    a, b, c = faces.T
    low, high = np.minimum(a, b), np.maximum(a, b)
    return np.minimum(low, c), np.maximum(low, np.minimum(high, c)), np.maximum(high, c)


def order_rows(*columns: Int32Array) -> tuple[Int32Array, NDArray[np.int64]]:
    """Sort rows of small numbers, stably, so that equal ones become neighbours.

    Parameters
    ----------
    *columns : (m,) int32
        Numbers from 0 on, such as indices of vertices; the first column counts most.

    Returns
    -------
    order : (m,) int32
        Indices of the rows.
    starts : (g,) int64
        Where in `order` each group of equal rows begins.
    """
    order = np.arange(len(columns[0]), dtype=np.int32)
    for column in columns[::-1]:
        moved = np.empty_like(order)
        place = np.zeros(int(column.max(initial=-1)) + 2, dtype=np.int32)
        _count_into(column, order, place, moved)
        order = moved
    first = order == order[:1]  # that alone: rows differ
    for column in columns:
        ranked = column.take(order)
        first[1:] |= ranked[1:] != ranked[:-1]
    return order, np.flatnonzero(first)


@kernel
def _count_into(key: Any, order: Any, place: Any, moved: Any) -> None:
    """Sort `order` stably by key[order] into `moved`: one digit of a radix sort."""
    for i in range(key.size):
        place[key[i] + 1] += 1
    for i in range(place.size - 1):
        place[i + 1] += place[i]
    for i in range(order.size):
        k = key[order[i]]
        moved[place[k]] = order[i]
        place[k] += 1


# ------------------------------------------------------------------------------------------------
# Which faces meet at which edges: neighbours, borders, bodies.


@dataclass(frozen=True, eq=False)
class Topology:
    """Neighbourhood of the faces of a welded mesh.

    Half-edge 3 f + j runs from vertex j of face f to the next.

    Attributes
    ----------
    faces : (m, 3) int32
        Faces without repeated index.
    """

    faces: Int32Array

    OPEN: ClassVar = -1
    CROWDED: ClassVar = -2
    """In `twin`: no other face at this edge, or more than one."""

    @cached_property
    def twin(self) -> Int32Array:
        """The other half-edge at each half-edge's edge, (3 m,), or `OPEN` or `CROWDED`."""
        order, starts, count = order_edges(self.faces)
        twin = np.full(self.faces.size, self.OPEN, dtype=np.int32)
        twin[order[np.repeat(count > 2, count)]] = self.CROWDED
        pairs = starts[count == 2]
        one, other = order[pairs], order[pairs + 1]
        twin[one], twin[other] = other, one
        return twin

    @cached_property
    def same_way(self) -> int:
        """Edges whose two faces run the same way: one of the two is turned over."""
        half, tail = np.flatnonzero(self.twin > np.arange(self.faces.size)), self.faces.ravel()
        return int(np.count_nonzero(tail[half] == tail[self.twin[half]]))

    @cached_property
    def two_faced(self) -> bool:
        """Whether every edge has exactly two faces."""
        return len(self.faces) > 0 and int(self.twin.min()) >= 0

    @property
    def closed(self) -> bool:
        """Whether every directed edge occurs once, and so does its reverse."""
        return self.two_faced and self.same_way == 0

    @cached_property
    def body(self) -> Int32Array:
        """Number of the body each face belongs to, (m,), by first appearance.

        Faces are of one body when steps over edges of exactly two faces connect them.
        """
        half = np.flatnonzero(self.twin >= 0)
        return connected(len(self.faces), half // 3, self.twin[half] // 3)

    @property
    def bodies(self) -> int:
        """How many bodies there are."""
        return int(self.body.max(initial=-1)) + 1

    @property
    def open_edges(self) -> Int32Array:
        """The vertices (k, 2) of the half-edges that no other face lies at."""
        return self._edges(self.OPEN)

    @property
    def crowded_edges(self) -> Int32Array:
        """The vertices (k, 2) of the half-edges that more than one other face lies at."""
        return self._edges(self.CROWDED)

    def _edges(self, kind: int) -> Int32Array:
        face, corner = np.divmod(np.flatnonzero(self.twin == kind), 3)
        return np.stack([self.faces[face, corner], self.faces[face, (corner + 1) % 3]], axis=1)

    @property
    def turned(self) -> BoolArray | None:
        """Which faces, (m,), to turn over so that neighbours agree, of each body the smaller part.

        None where a body has one side only, as a Möbius strip.
        """
        # A face and its reverse are two: joined to those of a neighbour that agree with them.
        half, tail, count = np.flatnonzero(self.twin >= 0), self.faces.ravel(), len(self.faces)
        one, other = half // 3, self.twin[half] // 3
        off = np.where(tail[half] == tail[self.twin[half]], count, 0)
        ones, others = (one, one + count), (other + off, other + count - off)
        joined = connected(2 * count, np.concatenate(ones), np.concatenate(others))
        group, reverse = np.split(joined, 2)
        if (group == reverse).any():
            return None
        turned = group != group[np.unique(self.body, return_index=True)[1][self.body]]
        most = np.bincount(self.body, weights=turned) * 2 > np.bincount(self.body)
        return np.asarray(turned ^ most[self.body])


def order_edges(faces: Int32Array) -> tuple[Int32Array, NDArray[np.int64], NDArray[np.int64]]:
    """Sort half-edges 3 f + j by the two vertices they join.

    Returns
    -------
    order : (3 m,) int32
        Half-edges; those at one edge, either way, are neighbours and rise.
    starts, count : (e,) int64
        Where in `order` each edge's half-edges begin, and how many there are.
    """
    heads = faces[:, [1, 2, 0]]
    order, starts = order_rows(np.minimum(faces, heads).ravel(), np.maximum(faces, heads).ravel())
    return order, starts, np.diff(starts, append=len(order))


def connected(
    count: int, one: NDArray[np.integer[Any]], other: NDArray[np.integer[Any]]
) -> Int32Array:
    """Find which of 0..count-1 links one[i]-other[i] join; number groups by first appearance."""
    parent = np.arange(count, dtype=np.int32)
    _join(parent, one.astype(np.int32), other.astype(np.int32))
    return number_groups(parent)


def number_groups(parent: Int32Array) -> Int32Array:
    """Return the group of each member of a union-find, (n,), numbered by first appearance."""
    while (parent != (root := parent[parent])).any():
        parent = root
    number = np.cumsum(parent == np.arange(len(parent)), dtype=np.int32) - np.int32(1)
    return np.asarray(number[parent])


@kernel
def _join(parent: Any, one: Any, other: Any) -> None:
    for i in range(one.size):
        unite(parent, one[i], other[i])


@inner_kernel
def unite(parent: Any, a: Any, b: Any) -> None:
    """Join the groups of two members in a union-find: the root of a group is its smallest."""
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    while parent[b] != b:
        parent[b] = parent[parent[b]]
        b = parent[b]
    if a < b:
        parent[b] = a
    else:
        parent[a] = b


# ------------------------------------------------------------------------------------------------
# All shells of a part as the readers of their files find them.


@dataclass(frozen=True, eq=False)
class JoinedShells:
    """Shells with equal positions joined, within each shell and between them.

    Attributes
    ----------
    vertices : (n, 3) float32
        Positions in mm, no two equal.
    faces : tuple of (m, 3) int32
        Of each shell, as indices into `vertices`.
    """

    vertices: Float32Array
    faces: tuple[Int32Array, ...]

    @cached_property
    def measures(self) -> tuple[Measures, ...]:
        """Volume, area and bounds of each shell."""
        points = self.vertices.astype(np.float64)
        return tuple(measure(points, faces) for faces in self.faces)

    @cached_property
    def left(self) -> Int32Array:
        """The faces, (m, 3), that remain of all shells when opposite triangles cancel."""
        faces = np.concatenate([np.empty((0, 3), np.int32), *self.faces])
        return faces.compress(cancel_opposite(faces), axis=0)

    @cached_property
    def outside(self) -> Mesh:
        """The surface that `left` is, with its own vertices alone."""
        used, faces = compact(self.left, len(self.vertices))
        return Mesh(self.vertices.take(used, axis=0).astype(np.float64), faces)

    @cached_property
    def outside_closed(self) -> bool:
        """Whether there is any, and each directed edge occurs as often as its reverse."""
        faces = self.outside.faces
        if not len(faces):
            return False
        order, starts, _ = order_edges(faces)
        way = np.where(faces < faces[:, [1, 2, 0]], 1, -1).ravel()
        return not np.add.reduceat(way[order], starts).any()

    def sound(self, number: int) -> bool:
        """Tell whether a shell is closed, the right way out, and has no face twice.

        Every directed edge occurs once, and so does its reverse; no face has two equal corners.
        Two faces on the same three vertices then are a body of their own, back to back.
        """
        faces = self.faces[number]
        order, _, count = order_edges(faces)
        if (count != 2).any() or repeats_index(faces).any():
            return False
        corners = np.stack([faces, faces[:, [2, 0, 1]]]).reshape(2, -1)  # tails, and thirds
        one, other = corners.take(order.reshape(-1, 2).T, axis=1).swapaxes(0, 1)
        return bool((one != other).all() and self.measures[number].volume_mm3[0] > 0.0)


def join_shells(shells: Iterable[_Floats | tuple[Float32Array, Int32Array]]) -> JoinedShells:
    """Join equal positions of shells.

    Parameters
    ----------
    shells
        Of each its triangles, (k, 3, 3), or its vertices (n, 3) and faces (m, 3), in mm.
    """
    indexed = [one if isinstance(one, tuple) else weld(one.astype(np.float32)) for one in shells]
    points = np.concatenate([np.empty((0, 3), np.float32), *(vertices for vertices, _ in indexed)])
    vertices, index = weld_points(points)
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in indexed)])
    each = zip(starts, indexed, strict=False)
    return JoinedShells(vertices, tuple(index[start:].take(faces) for start, (_, faces) in each))
