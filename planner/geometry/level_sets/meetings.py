"""Where the surface of a part and level sets meet: points at edges, segments between them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.level_sets.lattice import (
    face_normal,
    side_of_level,
    side_of_part,
    turn_of_edges,
)
from planner.geometry.topology import order_edges

__all__ = ["Edges", "Meetings", "Surface", "edges_of", "meet"]


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of a surface, each from its lower vertex to its higher one.

    Attributes
    ----------
    ends : (e, 2) int32
        Vertices.
    of_face : (m, 3) int32
        Edge from corner j to corner j + 1 of each face.
    """

    ends: NDArray[np.int32]
    of_face: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface on the lattice.

    Attributes
    ----------
    points : (n, 3) int64
        Positions on the lattice.
    faces : (m, 3) int32
        Triangles.
    edges : Edges
        Of the triangles.
    """

    points: NDArray[np.int64]
    faces: NDArray[np.int32]
    edges: Edges


@dataclass(frozen=True, eq=False)
class Meetings:
    """Points where an edge of one surface passes a face of the other, and what joins them.

    Attributes
    ----------
    of_part : (p,) bool
        Whether the edge is the part's, and the face of the level sets.
    edge, face : (p,) int32
        Which they are.
    way : (p,) int8
        1 where the edge, from its lower vertex to its higher one, rises past the level, or
        enters the part; -1 where it falls, or leaves.
    along : (p,) float64
        Place between the edge's ends, 0 to 1.
    segment : (s, 2) int32
        Points that a face of the part and one of the level sets have in common begin and end
        at: what lies above the level is left of it on the part, the part left of it on the
        level set.
    segment_part, segment_level : (s,) int32
        The two faces.
    broken : int
        Pairs of faces that do not meet in one segment; 0 for surfaces that are what they say.
    """

    of_part: NDArray[np.bool_]
    edge: NDArray[np.int32]
    face: NDArray[np.int32]
    way: NDArray[np.int8]
    along: FloatArray
    segment: NDArray[np.int32]
    segment_part: NDArray[np.int32]
    segment_level: NDArray[np.int32]
    broken: int


def edges_of(faces: NDArray[np.int32]) -> Edges:
    """Find the edges of a surface and give them numbers."""
    order, starts, count = order_edges(faces)
    number = np.empty(faces.size, dtype=np.int32)
    number[order] = np.repeat(np.arange(len(starts), dtype=np.int32), count)
    first = order[starts]
    tail, head = faces.ravel()[first], faces[:, [1, 2, 0]].ravel()[first]
    ends = np.stack([np.minimum(tail, head), np.maximum(tail, head)], axis=1)
    return Edges(ends, number.reshape(-1, 3))


def meet(
    part: Surface, level: Surface, level_cell: NDArray[np.int32],
    offsets: NDArray[np.int64], cells: NDArray[np.int32], marked: NDArray[np.uint8],
) -> Meetings:  # fmt: skip
    """Find all points and segments that a part and level sets have in common.

    Parameters
    ----------
    part, level : Surface
        On one lattice.
    level_cell : (m,) int32
        The cube of each face of the level sets, rising.
    offsets, cells
        Cubes that each face of the part may touch.
    marked : (cubes,) uint8
        2 where a cube has faces of the level sets.
    """
    own, starts = np.unique(level_cell, return_index=True)
    starts = np.append(starts, len(level_cell)).astype(np.int32)
    room = 1 << 16
    while True:
        keys, number = np.zeros(4 * room, dtype=np.int64), np.empty(4 * room, dtype=np.int32)
        edge, face = np.empty((2, room), dtype=np.int32)
        kind, way = np.empty((2, room), dtype=np.int8)
        along = np.empty(room)
        segment = np.empty((room, 4), dtype=np.int32)
        points, segments, broken = _meet(
            part.points, part.faces, part.edges.ends, part.edges.of_face,
            level.points, level.faces, level.edges.ends, level.edges.of_face,
            own, starts, offsets, cells, marked,
            keys, number, edge, face, kind, way, along, segment,
        )  # fmt: skip
        if points >= 0:
            break
        room *= 4
    segment = segment[:segments]
    return Meetings(
        kind[:points] == 0, edge[:points], face[:points], way[:points], along[:points],
        segment[:, :2].copy(), segment[:, 2].copy(), segment[:, 3].copy(), broken,
    )  # fmt: skip


@kernel
def _meet(
    a: Any, a_faces: Any, a_ends: Any, a_edges: Any, b: Any, b_faces: Any, b_ends: Any,
    b_edges: Any, own: Any, starts: Any, offsets: Any, cells: Any, marked: Any,
    keys: Any, number: Any, edge: Any, face: Any, kind: Any, way: Any, along: Any, segment: Any,
) -> Any:  # fmt: skip
    """Fill points and segments; return how many, or -1 where there is no room for them."""
    made = segments = broken = 0
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    sides, others = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    turns = np.empty((3, 3), dtype=np.int64)
    for t in range(a_faces.shape[0]):
        fresh = True
        normal = (np.int64(0), np.int64(0), np.int64(0))
        for c in range(offsets[t], offsets[t + 1]):
            if marked[cells[c]] != 2:
                continue
            if fresh:
                fresh = False
                a0, a1, a2 = a_faces[t, 0], a_faces[t, 1], a_faces[t, 2]
                normal = face_normal(a, a0, a1, a2)
                for d in range(3):
                    low[d] = min(a[a0, d], min(a[a1, d], a[a2, d]))
                    high[d] = max(a[a0, d], max(a[a1, d], a[a2, d]))
            n = np.searchsorted(own, cells[c])
            for p in range(starts[n], starts[n + 1]):
                b0, b1, b2 = b_faces[p, 0], b_faces[p, 1], b_faces[p, 2]
                apart = False
                for d in range(3):
                    x, y, z = b[b0, d], b[b1, d], b[b2, d]
                    if min(x, min(y, z)) > high[d] or max(x, max(y, z)) < low[d]:
                        apart = True
                        break
                if apart:
                    continue
                other_side = 0
                for j in range(3):
                    others[j] = side_of_part(a, a0, b, b_faces[p, j], normal)
                    other_side += others[j]
                if abs(other_side) == 3:
                    continue
                b_normal = face_normal(b, b0, b1, b2)
                side = 0
                for j in range(3):
                    sides[j] = side_of_level(b, b0, a, a_faces[t, j], b_normal)
                    side += sides[j]
                if abs(side) == 3:
                    continue
                for i in range(3):
                    for j in range(3):
                        turns[i, j] = turn_of_edges(
                            a, a_faces[t, i], a_faces[t, (i + 1) % 3],
                            b, b_faces[p, j], b_faces[p, (j + 1) % 3],
                        )  # fmt: skip
                if made + 6 > edge.size or segments + 1 > segment.shape[0]:
                    return -1, 0, 0
                begin, end, found = np.int32(-1), np.int32(-1), 0
                for i in range(3):
                    s0, s1 = sides[i], sides[(i + 1) % 3]
                    if s0 != s1 and turns[i, 0] == turns[i, 1] and turns[i, 1] == turns[i, 2]:
                        e = a_edges[t, i]
                        before = made
                        point, made = _point(
                            (np.int64(e) * b_faces.shape[0] + p) * 2 + 1, keys, number, made
                        )
                        if made > before:
                            edge[point], face[point], kind[point] = e, p, 0
                            forward = a_faces[t, i] == a_ends[e, 0]
                            way[point] = 1 if (s1 > 0) == forward else -1
                            along[point] = _along(a, a_ends, e, b, b0, b_normal)
                        found += 1
                        if s1 > 0:
                            end = point
                        else:
                            begin = point
                for j in range(3):
                    s0, s1 = others[j], others[(j + 1) % 3]
                    if s0 != s1 and turns[0, j] == turns[1, j] and turns[1, j] == turns[2, j]:
                        e = b_edges[p, j]
                        before = made
                        point, made = _point(
                            (np.int64(e) * a_faces.shape[0] + t) * 2 + 2, keys, number, made
                        )
                        if made > before:
                            edge[point], face[point], kind[point] = e, t, 1
                            forward = b_faces[p, j] == b_ends[e, 0]
                            way[point] = 1 if (s1 < 0) == forward else -1
                            along[point] = _along(b, b_ends, e, a, a0, normal)
                        found += 1
                        if s1 < 0:
                            end = point
                        else:
                            begin = point
                if found == 0:
                    continue
                if found != 2 or begin < 0 or end < 0:
                    broken += 1
                    continue
                segment[segments, 0], segment[segments, 1] = begin, end
                segment[segments, 2], segment[segments, 3] = t, p
                segments += 1
    return made, segments, broken


@inner_kernel
def _point(key: Any, keys: Any, number: Any, made: Any) -> Any:
    """Find the point of an edge and a face, or give it the next number."""
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    slot = np.int64((mixed ^ (mixed >> np.uint64(32))) & np.uint64(keys.size - 1))
    while keys[slot] != 0:
        if keys[slot] == key:
            return number[slot], made
        slot = (slot + 1) & (keys.size - 1)
    keys[slot] = key
    number[slot] = made
    return np.int32(made), made + 1


@inner_kernel
def _along(points: Any, ends: Any, e: Any, others: Any, corner: Any, normal: Any) -> Any:
    """Place between an edge's ends where it meets a plane."""
    heights = (0.0, 0.0)
    for end in range(2):
        v = ends[e, end]
        height = 0.0
        for d in range(3):
            height += float(normal[d]) * float(points[v, d] - others[corner, d])
        heights = (heights[1], height)
    low, high = heights
    return min(max(low / (low - high), 0.0), 1.0) if low != high else 0.5
