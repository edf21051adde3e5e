"""Where a part's surface and level sets meet, decided by exact arithmetic."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.cutting.grid import Lattice, LevelSets
from planner.mesh.mesh import Mesh, connected, face_normal, key_slot, order_edges
from planner.numerics import Float32Array, FloatArray, inner_kernel, kernel

__all__ = ["Crossed", "Meetings", "intersect"]


# ------------------------------------------------------------------------------------------------
# Positions as integers, and the sign of a volume decided exactly.
#
# Two surfaces are compared, a part's and that of the level sets. Where a vertex of one lies in a
# face of the other, or two edges meet, the volume is zero; the level sets then count as moved by
# (ε, ε², ε³) with ε as small as one likes (simulation of simplicity, Edelsbrunner and Mücke 1990).
# Every decision is that of this moved surface, so decisions never contradict each other.


@inner_kernel
def volume_sign(nx: Any, ny: Any, nz: Any, dx: Any, dy: Any, dz: Any) -> Any:
    """Sign of n . d for |n| < 2^61 and |d| < 2^30, exactly, in two words of 64 bits."""
    low = (nx & 0x7FFFFFFF) * dx + (ny & 0x7FFFFFFF) * dy + (nz & 0x7FFFFFFF) * dz
    high = (nx >> 31) * dx + (ny >> 31) * dy + (nz >> 31) * dz + (low >> 31)
    if high != 0:
        return 1 if high > 0 else -1
    return 1 if (low & 0x7FFFFFFF) > 0 else 0


@inner_kernel
def _first_sign(nx: Any, ny: Any, nz: Any) -> Any:
    """Sign of n . (ε, ε², ε³)."""
    for n in (nx, ny, nz):
        if n != 0:
            return 1 if n > 0 else -1
    return 0


@inner_kernel
def _side(surface: Any, corner: Any, points: Any, at: Any, normal: Any, moved: Any) -> Any:
    """Tell on which side of a face a point lies, the level sets being moved by (ε, ε², ε³).

    `corner` is one of the face's; `moved` is 1 where the point is of the level sets, -1 where the
    face is.
    """
    nx, ny, nz = normal
    dx = points[at, 0] - surface[corner, 0]
    dy = points[at, 1] - surface[corner, 1]
    dz = points[at, 2] - surface[corner, 2]
    sign = volume_sign(nx, ny, nz, dx, dy, dz)
    return sign if sign != 0 else moved * _first_sign(nx, ny, nz)


@inner_kernel
def _turn_of_edges(points: Any, p: Any, q: Any, level: Any, u: Any, v: Any) -> Any:
    """Sign of (q - p) x (v - u) . (u - p) for an edge of the part and one of the level sets."""
    px, py, pz = points[p, 0], points[p, 1], points[p, 2]
    ux, uy, uz = level[u, 0], level[u, 1], level[u, 2]
    ax, ay, az = points[q, 0] - px, points[q, 1] - py, points[q, 2] - pz
    bx, by, bz = level[v, 0] - ux, level[v, 1] - uy, level[v, 2] - uz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    sign = volume_sign(nx, ny, nz, ux - px, uy - py, uz - pz)
    return sign if sign != 0 else _first_sign(nx, ny, nz)


# ------------------------------------------------------------------------------------------------
# Where the surface of a part and level sets meet: points at edges, segments between them.


class Surface(NamedTuple):
    """A surface on the lattice, and its edges, each from its lower vertex to its higher one.

    Attributes
    ----------
    points : (n, 3) int64
        Positions on the lattice.
    faces : (m, 3) int32
        Triangles.
    ends : (e, 2) int32
        Vertices of each edge.
    of_face : (m, 3) int32
        Edge from corner j to corner j + 1 of each face.
    """

    points: NDArray[np.int64]
    faces: NDArray[np.int32]
    ends: NDArray[np.int32]
    of_face: NDArray[np.int32]


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


@dataclass(frozen=True, eq=False)
class Crossed:
    """The part or the level sets, with what is known of it where it meets the other.

    Attributes
    ----------
    surface
        On the lattice.
    labels : (n,) int32
        Of its vertices: levels below, or 1 inside the part.
    offsets : (e + 1,) int32, points : int32
        Edge i has the meetings ``points[offsets[i]:offsets[i + 1]]``, from its lower vertex on.
    segment_face, segment_label : (s,) int32
        The face that each segment lies in, and the lower of the two labels that it divides, the
        higher one on its left.
    """

    surface: Surface
    labels: NDArray[np.int32]
    offsets: NDArray[np.int32]
    points: NDArray[np.int32]
    segment_face: NDArray[np.int32]
    segment_label: NDArray[np.int32]


def intersect(mesh: Mesh, levels: FloatArray, sets: LevelSets) -> tuple[Meetings, Crossed, Crossed]:
    """Find where a part and level sets meet, and how they divide the part and each other."""
    part = _surface_of(mesh.vertices, mesh.faces, sets.lattice)
    level = _surface_of(sets.vertices, sets.faces, sets.lattice)
    found = _met(part, level, sets)
    lower = sets.level[np.where(found.of_part, found.face, 0)]  # of the part's edges alone
    on_part, part_groups = _told(part, found, True, lower)
    on_level, level_groups = _told(level, found, False, np.zeros_like(lower))
    piece = _piece_of_vertices(part, level, *part_groups, levels, sets)
    inside = _inside_part(part, level, *level_groups, sets)
    between = sets.level[found.segment_level]
    of_part = Crossed(part, piece, *on_part, found.segment_part, between)
    of_level = Crossed(level, inside, *on_level, found.segment_level, np.zeros_like(between))
    return found, of_part, of_level


def _surface_of(
    points_mm: FloatArray | Float32Array, faces: NDArray[np.int32], lattice: Lattice
) -> Surface:
    """Place a surface on the lattice, find its edges and give them numbers."""
    order, starts, count = order_edges(faces)
    number = np.empty(faces.size, dtype=np.int32)
    number[order] = np.repeat(np.arange(len(starts), dtype=np.int32), count)
    first = order[starts]
    tail, head = faces.ravel()[first], faces[:, [1, 2, 0]].ravel()[first]
    ends = np.stack([np.minimum(tail, head), np.maximum(tail, head)], axis=1)
    return Surface(lattice.integers(points_mm), faces, ends, number.reshape(-1, 3))


def _met(part: Surface, level: Surface, sets: LevelSets) -> Meetings:
    """Find all points and segments that a part and level sets have in common."""
    own, starts = np.unique(sets.cell, return_index=True)
    starts = np.append(starts, len(sets.cell)).astype(np.int32)
    room = 1 << 16
    while True:
        keys, number = np.zeros(4 * room, dtype=np.int64), np.empty(4 * room, dtype=np.int32)
        edge, face = np.empty((2, room), dtype=np.int32)
        kind, way = np.empty((2, room), dtype=np.int8)
        along = np.empty(room)
        segment = np.empty((room, 4), dtype=np.int32)
        points, segments, broken = _meet(
            tuple(part), tuple(level), own, starts, sets.offsets, sets.touched,
            sets.cubes.reshape(-1), keys, number, edge, face, kind, way, along, segment,
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
    a: Any, b: Any, own: Any, starts: Any, offsets: Any, cells: Any, marked: Any, keys: Any,
    number: Any, edge: Any, face: Any, kind: Any, way: Any, along: Any, segment: Any,
) -> Any:  # fmt: skip
    """Fill points and segments; return how many, or -1 where there is no room for them."""
    made = segments = broken = 0
    (a_points, a_faces, a_ends, a_edges), (b_points, b_faces, b_ends, b_edges) = a, b
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    # By whose edges, the part's (0) or the level sets' (1).
    sides, turns = np.empty((2, 3), dtype=np.int64), np.empty((2, 3, 3), dtype=np.int64)
    for t in range(a_faces.shape[0]):
        fresh = True
        normal = (np.int64(0), np.int64(0), np.int64(0))
        for c in range(offsets[t], offsets[t + 1]):
            if marked[cells[c]] != 2:
                continue
            if fresh:
                fresh = False
                a0, a1, a2 = a_faces[t, 0], a_faces[t, 1], a_faces[t, 2]
                normal = face_normal(a_points, a0, a1, a2)
                for d in range(3):
                    x, y, z = a_points[a0, d], a_points[a1, d], a_points[a2, d]
                    low[d], high[d] = min(x, min(y, z)), max(x, max(y, z))
            n = np.searchsorted(own, cells[c])
            for p in range(starts[n], starts[n + 1]):
                b0, b1, b2 = b_faces[p, 0], b_faces[p, 1], b_faces[p, 2]
                apart = False
                for d in range(3):
                    x, y, z = b_points[b0, d], b_points[b1, d], b_points[b2, d]
                    if min(x, min(y, z)) > high[d] or max(x, max(y, z)) < low[d]:
                        apart = True
                        break
                if apart:
                    continue
                for j in range(3):
                    sides[1, j] = _side(a_points, a0, b_points, b_faces[p, j], normal, 1)
                if abs(sides[1, 0] + sides[1, 1] + sides[1, 2]) == 3:
                    continue
                b_normal = face_normal(b_points, b0, b1, b2)
                for j in range(3):
                    sides[0, j] = _side(b_points, b0, a_points, a_faces[t, j], b_normal, -1)
                if abs(sides[0, 0] + sides[0, 1] + sides[0, 2]) == 3:
                    continue
                for i in range(3):
                    for j in range(3):
                        turns[0, i, j] = turns[1, j, i] = _turn_of_edges(
                            a_points, a_faces[t, i], a_faces[t, (i + 1) % 3],
                            b_points, b_faces[p, j], b_faces[p, (j + 1) % 3],
                        )  # fmt: skip
                if made + 6 > edge.size or segments + 1 > segment.shape[0]:
                    return -1, 0, 0
                begin, end, found = np.int32(-1), np.int32(-1), 0
                for m in range(6):
                    of, i = m // 3, m % 3
                    s0, s1 = sides[of, i], sides[of, (i + 1) % 3]
                    turn = turns[of, i, 0]
                    if s0 == s1 or turn != turns[of, i, 1] or turn != turns[of, i, 2]:
                        continue
                    if of == 0:
                        e, f = a_edges[t, i], p
                        forward = a_faces[t, i] == a_ends[e, 0]
                        key = np.int64(e) * b_faces.shape[0] + p
                        place = _along(a_points, a_ends, e, b_points, b0, b_normal)
                    else:
                        e, f = b_edges[p, i], t
                        forward = b_faces[p, i] == b_ends[e, 0]
                        key = np.int64(e) * a_faces.shape[0] + t
                        place = _along(b_points, b_ends, e, a_points, a0, normal)
                    enters = (s1 > 0) == (of == 0)
                    key = 2 * key + 1 + of
                    slot = key_slot(keys, key)
                    if keys[slot] == 0:
                        keys[slot], number[slot] = key, made
                        edge[made], face[made], kind[made] = e, f, of
                        way[made] = 1 if enters == forward else -1
                        along[made] = place
                        made += 1
                    point = number[slot]
                    found += 1
                    if enters:
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
def _along(points: Any, ends: Any, e: Any, others: Any, corner: Any, normal: Any) -> Any:
    """Place between an edge's ends where it meets a plane."""
    low = high = 0.0
    for d in range(3):
        low += float(normal[d]) * float(points[ends[e, 0], d] - others[corner, d])
        high += float(normal[d]) * float(points[ends[e, 1], d] - others[corner, d])
    return min(max(low / (low - high), 0.0), 1.0) if low != high else 0.5


# ------------------------------------------------------------------------------------------------
# On which side of every level, and of the part's surface, each vertex lies.


_Two = tuple[NDArray[np.int32], NDArray[np.int32]]


def _told(
    surface: Surface, meetings: Meetings, of_part: bool, lower: NDArray[np.int32]
) -> tuple[_Two, _Two]:
    """Order meetings along edges, and group vertices that edges without any join.

    Edges with one meeting tell the labels of the groups that they join.

    Parameters
    ----------
    lower : (p,) int32
        A meeting joins this label and the next along its edge, upwards where its way is 1.

    Returns
    -------
    offsets, points
        See `Crossed`.
    group, label : (n,) int32, (groups,) int32
        Of each vertex, and of each group: -1 where no such edge ends.
    """
    own = np.flatnonzero(meetings.of_part == of_part)
    points = own[np.lexsort((meetings.along[own], meetings.edge[own]))].astype(np.int32)
    edges = np.arange(len(surface.ends) + 1)
    offsets = np.searchsorted(meetings.edge[points], edges).astype(np.int32)
    ends, count = surface.ends, np.diff(offsets)
    group = connected(len(surface.points), *ends[count == 0].T)
    label = np.full(int(group.max(initial=-1)) + 1, -1, dtype=np.int32)
    single = np.flatnonzero(count == 1)
    met = points[offsets[single]]
    label[group[ends[single, 0]]] = lower[met] + (meetings.way[met] < 0)
    label[group[ends[single, 1]]] = lower[met] + (meetings.way[met] > 0)
    return (offsets, points), (group, label)


def _piece_of_vertices(
    part: Surface, level: Surface, group: NDArray[np.int32], label: NDArray[np.int32],
    levels: FloatArray, sets: LevelSets,
) -> NDArray[np.int32]:  # fmt: skip
    """Count the levels below each vertex of the part, (n,).

    Where no edge tells, the field at a corner of a vertex's cube does, with the level sets on the
    way there, by the same exact decisions.
    """
    left = np.flatnonzero(label < 0)
    seed = np.unique(group, return_index=True)[1][left].astype(np.int32)
    listed = sets.cell, np.arange(len(level.faces), dtype=np.int32)
    passed = _passed(level, part, seed, sets.corner[seed], sets.cube[seed], listed, sets, 1)
    label[left] = np.searchsorted(levels, sets.corner_value[seed], side="right") - passed
    return label[group]


def _inside_part(
    part: Surface, level: Surface, group: NDArray[np.int32], answer: NDArray[np.int32],
    sets: LevelSets,
) -> NDArray[np.int32]:  # fmt: skip
    """Tell which vertices of the level sets lie in the part: 1 or 0, (n,).

    Where no edge tells, a ray does, by the same exact decisions.
    """
    open_groups = np.flatnonzero(answer < 0)
    if len(open_groups):
        first = np.full(len(answer), -1, dtype=np.int64)
        corners = level.faces.ravel()
        first[group[corners[::-1]]] = np.arange(len(corners))[::-1]
        seed = corners[first[open_groups]]
        to = level.points[seed]
        to[:, 2] = max(part.points[:, 2].max(), level.points[:, 2].max()) + 2
        by_cell = np.argsort(sets.touched, kind="stable")
        face = np.repeat(np.arange(len(part.faces), dtype=np.int32), np.diff(sets.offsets))
        listed = sets.touched[by_cell], face[by_cell]
        cell = sets.cell[first[open_groups] // 3]
        answer[open_groups] = _passed(part, level, seed, to, cell, listed, sets, -1) > 0
    return answer[group]


def _passed(
    surface: Surface, other: Surface, seed: NDArray[np.int32], to: NDArray[np.int64],
    seed_cell: NDArray[np.int32], listed: tuple[NDArray[np.int32], NDArray[np.int32]],
    sets: LevelSets, moved: int,
) -> NDArray[np.int32]:  # fmt: skip
    """Count how often stretches pass a surface towards its front, less how often the other way.

    Each begins at a vertex of the other surface, in a given cube, and ends in that or above it.

    Parameters
    ----------
    listed
        Cubes, rising, and a face of the surface in each.
    moved
        1 where the surface is the level sets, which count as moved, else -1.
    """
    _, ny, nz = sets.cubes.shape
    found, stamp = np.empty(len(seed), np.int32), np.full(len(surface.faces), -1, np.int32)
    points = np.concatenate([other.points, other.points[:1]])
    cell, face = listed
    _cast(
        surface.points, surface.faces, points, seed, to, seed_cell.astype(np.int64),
        cell.astype(np.int64), face, ny, nz, moved, stamp, found,
    )  # fmt: skip
    return found


@kernel
def _cast(
    a: Any, a_faces: Any, b: Any, seed: Any, to: Any, seed_cell: Any, cell: Any, face: Any,
    ny: Any, nz: Any, moved: Any, stamp: Any, found: Any,
) -> None:  # fmt: skip
    end = b.shape[0] - 1
    for s in range(seed.size):
        v = seed[s]
        for d in range(3):
            b[end, d] = to[s, d]
        passed = 0
        column = seed_cell[s] // nz
        # A vertex may lie on the border of its cube: look into the neighbours as well.
        for di in range(-1, 2):
            for dj in range(-1, 2):
                first = (column + di * ny + dj) * nz + max(seed_cell[s] % nz - 1, 0)
                if first < 0:
                    continue
                last = (column + di * ny + dj + 1) * nz
                for n in range(np.searchsorted(cell, first), np.searchsorted(cell, last)):
                    t = face[n]
                    if stamp[t] == s:
                        continue
                    stamp[t] = s
                    normal = face_normal(a, a_faces[t, 0], a_faces[t, 1], a_faces[t, 2])
                    s0 = _side(a, a_faces[t, 0], b, v, normal, -moved)
                    s1 = _side(a, a_faces[t, 0], b, end, normal, -moved)
                    if s0 == s1:
                        continue
                    turns = 0
                    for j in range(3):
                        p, q = a_faces[t, j], a_faces[t, (j + 1) % 3]
                        if moved > 0:
                            turns += _turn_of_edges(b, v, end, a, p, q)
                        else:
                            turns += _turn_of_edges(a, p, q, b, v, end)
                    if abs(turns) == 3:
                        passed += 1 if s1 > 0 else -1
        found[s] = passed
