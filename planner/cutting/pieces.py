"""Divide a part at levels of a field into pieces whose shells fit triangle for triangle."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.cutting.grid import LevelSets, default_pitch_mm, draw_level_sets
from planner.cutting.intersect import Crossed, Meetings, intersect
from planner.cutting.planes import (
    cut_by_planes,
    flip_thin,
    squared_height,
    thin_faces,
    triangulate_loops,
)
from planner.errors import ArgumentError, positive
from planner.fields.basic import Field, PlanarField
from planner.glance import place_text
from planner.mesh.mesh import (
    JoinedShells,
    Measures,
    Mesh,
    Topology,
    cancel_opposite,
    compact,
    face_normal,
    measure,
    weld_points,
)
from planner.numerics import BoolArray, Float32Array, FloatArray, inner_kernel, kernel

__all__ = ["FIRST_SHIFT", "Pieces", "split"]


@dataclass(frozen=True, eq=False)
class Pieces:
    """A part divided at L levels into L + 1 pieces, softest to hardest along the field.

    Attributes
    ----------
    vertices : (n, 3) float32
        One pool for all pieces, in mm; no two positions are equal.
    faces : (k, 3) int32
        The part's surface, divided, with its orientation.
    piece : (k,) int32
        The piece each of `faces` belongs to.
    cap_faces : (c, 3) int32
        Interfaces, outwards for the piece below the level; turned over for the one above.
    cap_level : (c,) int32
        The level each of `cap_faces` lies in.
    count : int
        Number of pieces, L + 1; some may be empty.
    field_range
        Values between which the field lies over the part.
    """

    vertices: Float32Array
    faces: NDArray[np.int32]
    piece: NDArray[np.int32]
    cap_faces: NDArray[np.int32]
    cap_level: NDArray[np.int32]
    count: int
    field_range: tuple[float, float]

    @cached_property
    def measures(self) -> Measures:
        """Volume, area and bounds of every piece."""
        faces = np.concatenate([self.faces, self.cap_faces, self.cap_faces[:, ::-1]])
        piece = np.concatenate([self.piece, self.cap_level, self.cap_level + np.int32(1)])
        return measure(self.vertices, faces, piece, self.count)

    @property
    def volumes_mm3(self) -> FloatArray:
        """Volume of every piece in mm³, (count,); their sum is the part's volume."""
        return self.measures.volume_mm3

    @property
    def bounds_mm(self) -> FloatArray:
        """Smallest and largest coordinates of every piece in mm, (count, 2, 3); NaN where empty."""
        found = self.measures.bounds_mm
        return np.where(np.isfinite(found), found, np.nan)

    def shell_faces(self, members: Collection[int]) -> NDArray[np.int32]:
        """Return the faces of the union of some pieces, outwards, as indices into the pool.

        Their share of the surface comes first, then interfaces with what is not a member.
        """
        chosen = np.zeros(self.count, dtype=np.bool_)
        chosen[list(members)] = True
        below, above = chosen.take(self.cap_level), chosen[1:].take(self.cap_level)
        own = self.faces.compress(chosen.take(self.piece), axis=0)
        lower = self.cap_faces.compress(below & ~above, axis=0)
        upper = self.cap_faces.compress(above & ~below, axis=0)
        return np.concatenate([own, lower, upper[:, ::-1]])


# ------------------------------------------------------------------------------------------------
# Divide the faces of a surface along segments: the loops around each part of a face.


@dataclass(frozen=True, eq=False)
class Loops:
    """Loops around parts of faces, each with what it encloses on its left.

    Attributes
    ----------
    nodes : int32
        Vertices of the surface, then its vertices' number + the number of a meeting.
    starts : (k + 1,) int32
        Loop i is ``nodes[starts[i]:starts[i + 1]]``.
    face, label : (k,) int32
        The face it divides, and the label of what it encloses.
    broken : int
        Faces whose segments do not divide them; 0 for surfaces that are what they say.
    """

    nodes: NDArray[np.int32]
    starts: NDArray[np.int32]
    face: NDArray[np.int32]
    label: NDArray[np.int32]
    broken: int

    def joined(self, number: NDArray[np.int32]) -> "Loops":
        """Give nodes other numbers, and leave out a node that equals the one before it."""
        nodes = number[self.nodes]
        before = np.roll(nodes, 1)
        size = np.diff(self.starts)
        before[self.starts[:-1][size > 0]] = nodes[self.starts[1:][size > 0] - 1]
        kept = nodes != before
        starts = np.append(0, np.cumsum(kept, dtype=np.int32))[self.starts]
        return Loops(nodes[kept], starts.astype(np.int32), self.face, self.label, self.broken)


def _walk_faces(crossed: Crossed, meetings: Meetings) -> Loops:
    """Find the loops of all faces that have segments."""
    surface, labels, way = crossed.surface, crossed.labels, meetings.way
    order = np.argsort(crossed.segment_face, kind="stable")
    faces, first = np.unique(crossed.segment_face[order], return_index=True)
    starts = np.append(first, len(order)).astype(np.int32)
    on_edges = np.diff(crossed.offsets)[surface.of_face[faces]].sum(axis=1)
    halves = 3 + on_edges + 2 * np.diff(starts)
    room, most = int(halves.sum()), int(halves.max(initial=3))
    nodes, loop_starts = np.empty(room, dtype=np.int32), np.zeros(room + 1, dtype=np.int32)
    loop_face, loop_label = np.empty((2, room), dtype=np.int32)
    count = len(labels) + len(way)
    slot, stamp = np.empty(2 * count, dtype=np.int32), np.full(2 * count, -1, dtype=np.int32)
    loops, lost = _walk(
        faces.astype(np.int32), surface.faces, surface.of_face, labels, crossed.offsets,
        crossed.points, way, starts, meetings.segment[order], crossed.segment_label[order], slot,
        stamp, np.empty((most, 4), dtype=np.int32), nodes, loop_starts, loop_face, loop_label,
    )  # fmt: skip
    return Loops(
        nodes[: loop_starts[loops]], loop_starts[: loops + 1], loop_face[:loops],
        loop_label[:loops], lost,
    )  # fmt: skip


@kernel
def _walk(
    chosen: Any, corners: Any, edges: Any, labels: Any, offsets: Any, points: Any, way: Any,
    starts: Any, segment: Any, segment_level: Any, slot: Any, stamp: Any, half: Any, nodes: Any,
    loop_starts: Any, loop_face: Any, loop_label: Any,
) -> Any:  # fmt: skip
    # half: where each directed side begins and ends, its label, and whether it is left to walk.
    count = labels.size
    loops = filled = lost = 0
    for n in range(chosen.size):
        f = chosen[n]
        sides = 0
        for j in range(3):
            a, b = corners[f, j], corners[f, (j + 1) % 3]
            e = edges[f, j]
            first, last = offsets[e], offsets[e + 1]
            label, at = labels[a], a
            for m in range(last - first):
                p = points[first + m] if a < b else points[last - 1 - m]
                sides = _add(half, sides, at, count + p, label, slot, stamp, f)
                label += way[p] if a < b else -way[p]
                at = count + p
            sides = _add(half, sides, at, b, label, slot, stamp, f)
        for s in range(starts[n], starts[n + 1]):
            begin, end = count + segment[s, 0], count + segment[s, 1]
            sides = _add(half, sides, begin, end, segment_level[s] + 1, slot, stamp, f)
            sides = _add(half, sides, end, begin, segment_level[s], slot, stamp, f)
        fine = True
        for h in range(sides):
            if half[h, 3] == 0:
                continue
            label, g = half[h, 2], h
            while half[g, 3] == 1:
                half[g, 3] = 0
                nodes[filled] = half[g, 0]
                filled += 1
                key = 2 * half[g, 1] + (label & 1)
                if stamp[key] != f or half[slot[key], 2] != label:
                    fine = False
                    break
                g = slot[key]
            if g != h:
                fine = False
            loop_face[loops], loop_label[loops] = f, label
            loops += 1
            loop_starts[loops] = filled
        if not fine:
            lost += 1
    return loops, lost


@inner_kernel
def _add(
    half: Any, sides: Any, begin: Any, end: Any, label: Any, slot: Any, stamp: Any, f: Any
) -> Any:
    half[sides, 0], half[sides, 1], half[sides, 2], half[sides, 3] = begin, end, label, 1
    key = 2 * begin + (label & 1)
    slot[key], stamp[key] = sides, f
    return sides + 1


# ------------------------------------------------------------------------------------------------
# Fill loops with triangles between their nodes.


_MOST_COVERED = 24  # corners of a loop whose triangulations are compared


def _fill_loops(
    loops: Loops, points_mm: Float32Array, normals: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Triangulate what loops enclose; loops of one face and label enclose it together.

    Parameters
    ----------
    points_mm : (nodes, 3) float32
        Positions.
    normals : (m, 3) float64
        Of the faces, of any length.

    Returns
    -------
    faces : (t, 3) int32
        Triangles between nodes.
    label, source : (t,) int32
        Of the loops.
    """
    size = np.diff(loops.starts)
    key = loops.face.astype(np.int64) * (int(loops.label.max(initial=0)) + 1) + loops.label
    _, group, together = np.unique(key, return_inverse=True, return_counts=True)
    simple = np.flatnonzero((together[group] == 1) & (size <= _MOST_COVERED))
    triangles = int(np.maximum(size[simple] - 2, 0).sum())
    faces = np.empty((triangles, 3), dtype=np.int32)
    owner = np.empty(triangles, dtype=np.int32)
    most = _MOST_COVERED
    _cover(
        simple, loops.nodes, loops.starts, loops.face, points_mm, normals, faces, owner,
        np.empty((most, 2)), np.empty((most, most)), np.empty((most, most), dtype=np.int32),
        np.empty((most, 2), dtype=np.int32),
    )  # fmt: skip
    rest = size >= 3  # a loop of two nodes encloses nothing
    rest[simple] = False
    ranked = np.flatnonzero(rest)
    ranked = ranked[np.argsort(key[ranked], kind="stable")]
    if len(ranked):
        normal = normals[loops.face[ranked]]
        drop = np.argmax(np.abs(normal), axis=1)
        turned = normal[np.arange(len(ranked)), drop] < 0
        across = np.stack([(drop + 1 + turned) % 3, (drop + 2 - turned) % 3], axis=1)
        chosen = (ranked, key[ranked], across)
        more, owners = triangulate_loops(points_mm, loops.nodes, loops.starts, *chosen)
        faces, owner = np.concatenate([faces, more]), np.concatenate([owner, owners])
    return faces, loops.label[owner], loops.face[owner]


@kernel
def _cover(
    chosen: Any, nodes: Any, starts: Any, loop_face: Any, points: Any, normals: Any, faces: Any,
    owner: Any, flat: Any, best: Any, middle: Any, stack: Any,
) -> None:  # fmt: skip
    """Of all triangulations of a loop take the one whose thinnest triangle is thickest.

    By dynamic programming over the loop's stretches (Klincsek 1980). Triangles that are turned
    over count as thinner than any other; where none is, they cover the loop's inside once.
    """
    written = 0
    for loop in chosen:
        first, count = starts[loop], starts[loop + 1] - starts[loop]
        if count < 3:
            continue
        normal = normals[loop_face[loop]]
        drop = 0
        for d in range(1, 3):
            if abs(normal[d]) > abs(normal[drop]):
                drop = d
        u, v = (drop + 1) % 3, (drop + 2) % 3
        if normal[drop] < 0.0:
            u, v = v, u
        for i in range(count):
            flat[i, 0], flat[i, 1] = points[nodes[first + i], u], points[nodes[first + i], v]
            best[i, (i + 1) % count] = np.inf
        for length in range(2, count):
            for i in range(count - length):
                k = i + length
                best[i, k], middle[i, k] = -np.inf, i + 1
                for j in range(i + 1, k):
                    value = min(best[i, j], best[j, k])
                    if value <= best[i, k]:
                        continue
                    a, b, c = nodes[first + i], nodes[first + j], nodes[first + k]
                    height = squared_height(points, a, b, c)
                    turn = (flat[j, 0] - flat[i, 0]) * (flat[k, 1] - flat[i, 1])
                    if not turn - (flat[j, 1] - flat[i, 1]) * (flat[k, 0] - flat[i, 0]) > 0.0:
                        height = -1.0 - height
                    value = min(value, height)
                    if value > best[i, k]:
                        best[i, k], middle[i, k] = value, j
        stack[0, 0], stack[0, 1] = 0, count - 1
        size = 1
        while size > 0:
            size -= 1
            i, k = stack[size, 0], stack[size, 1]
            j = middle[i, k]
            a, b, c = nodes[first + i], nodes[first + j], nodes[first + k]
            faces[written, 0], faces[written, 1], faces[written, 2] = a, b, c
            owner[written] = loop
            written += 1
            if j > i + 1:
                stack[size, 0], stack[size, 1] = i, j
                size += 1
            if k > j + 1:
                stack[size, 0], stack[size, 1] = j, k
                size += 1


# ------------------------------------------------------------------------------------------------
# Divide a part along level sets, as pieces whose shells fit triangle for triangle.


def _divide_along(
    mesh: Mesh, field: Field, levels: FloatArray, pitch_mm: float, shift: FloatArray,
    within_mm: float, follow: bool,
) -> tuple[Pieces, int]:  # fmt: skip
    """Divide a part along the level sets of a field, drawn on one grid.

    Also returned: how many contradictions were met; with any, the shells are not closed.

    Parameters
    ----------
    mesh : Mesh
        Closed, at float32 positions.
    levels : (L,) float64
        Strictly increasing.
    shift : (3,) float64
        Place of the grid's corner below the part's, in pitches beyond one: 0 to 1.
    """
    sets = draw_level_sets(mesh, field, levels, pitch_mm, shift, within_mm, follow=follow)
    meetings, part, level = intersect(mesh, levels, sets)
    part_loops, level_loops = _walk_faces(part, meetings), _walk_faces(level, meetings)
    met = _positions(meetings, mesh, sets, part, level)

    # One pool: the part's vertices, the level sets', the meetings; equal positions joined.
    n, m = len(mesh.vertices), len(sets.vertices)
    placed = mesh.vertices.astype(np.float32)
    pool, number = weld_points(np.concatenate([placed, sets.vertices, met]))
    of_part = np.concatenate([number[:n], number[n + m :]])
    faces, piece, _ = _divided(mesh.faces, part.labels, part_loops, of_part, pool)
    piece = np.clip(piece, 0, len(levels))  # where surfaces contradict themselves
    caps, kept, source = _divided(sets.faces, level.labels, level_loops, number[n:], pool)
    order = np.argsort(sets.level[source[kept == 1]], kind="stable")
    caps, cap_level = caps[kept == 1][order], sets.level[source[kept == 1][order]]

    # What covers itself within a piece or an interface is left out, and vertices without use.
    own, inner = cancel_opposite(faces, piece), cancel_opposite(caps, cap_level)
    faces, caps, cap_level = faces[own], caps[inner], cap_level[inner]
    if np.isfinite(within_mm):
        free = np.ones(len(pool), dtype=np.bool_)
        free[faces] = False
        left = _merged(caps, pool, free, sets.flat_mm)
        caps, cap_level = caps[left], cap_level[left]
    used, both = compact(np.concatenate([faces, caps]), len(pool))
    faces, caps = np.split(both, [len(faces)])
    ends = sets.field_range
    found = Pieces(pool[used], faces, piece[own], caps, cap_level, len(levels) + 1, ends)
    return found, meetings.broken + part_loops.broken + level_loops.broken


def _positions(
    meetings: Meetings, mesh: Mesh, sets: LevelSets, part: Crossed, level: Crossed
) -> Float32Array:
    """Place the meetings on their edges, rounded once, and walls along the axes where they are."""
    found = np.empty((len(meetings.edge), 3), dtype=np.float32)
    for own, vertices, crossed in ((True, mesh.vertices, part), (False, sets.vertices, level)):
        chosen = meetings.of_part == own
        low, high = vertices[crossed.surface.ends[meetings.edge[chosen]].T].astype(np.float64)
        found[chosen] = sets.lattice.rounded(low + meetings.along[chosen, None] * (high - low))
        if own:
            wall = low == high
        else:
            a, b, c = mesh.vertices[mesh.faces[meetings.face[chosen]]].transpose(1, 0, 2)
            low, wall = a, (a == b) & (b == c)
        found[chosen] = np.where(wall, low, found[chosen])
    return found


def _divided(
    faces: NDArray[np.int32], labels: NDArray[np.int32], loops: Loops, number: NDArray[np.int32],
    pool: Float32Array,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:  # fmt: skip
    """Faces that nothing meets as they are, the others divided; their labels and sources."""
    whole = np.ones(len(faces), dtype=np.bool_)
    whole[loops.face] = False
    cut = np.flatnonzero(~whole)
    normals = np.zeros((len(faces), 3))
    normals[cut] = Mesh(pool.astype(np.float64), number[faces[cut]]).area_vectors_mm2
    new, label, source = _fill_loops(loops.joined(number), pool, normals)
    return (
        np.concatenate([number.take(faces.compress(whole, axis=0)), new]),
        np.concatenate([labels.take(faces[whole, 0]), label]),
        np.concatenate([np.flatnonzero(whole), source]),
    )


# ------------------------------------------------------------------------------------------------
# Merge an interface's triangles where it is flat, or straight along a crease.


_MOST_AROUND = 40  # neighbours of a vertex that is looked at


def _merged(
    faces: NDArray[np.int32], pool: Float32Array, free: BoolArray, flat_mm: float
) -> BoolArray:
    """Draw free vertices into free neighbours, in place; tell which faces are left.

    A neighbour takes a vertex if it is as near as that to the planes of all its triangles, if none
    turns over, and if none becomes lower than the lowest, or than ten times that. What was closed
    stays so: edges that arise end in free vertices, which no other surface has.
    """
    first, seen = np.full(len(pool), -1, np.int32), np.zeros(len(pool), np.int64)
    after, ring = np.empty(faces.size, np.int32), np.empty((_MOST_AROUND, 2), np.int32)
    _merge(pool.astype(np.float64), faces, free.copy(), flat_mm, first, after, ring, seen)
    return np.asarray(faces[:, 0] >= 0)


@kernel
def _merge(
    points: Any, faces: Any, free: Any, flat: Any, first: Any, after: Any, ring: Any, seen: Any
) -> None:
    # Vertex v has the corners 3 f + c of faces f from first[v] on; those that are gone begin with
    # -1. ring: what follows v in each of its faces; seen: of which ring a vertex was last.
    for corner in range(after.size):
        v = faces[corner // 3, corner % 3]
        after[corner], first[v] = first[v], corner
    number, total, gone = 0, 0, 1
    while 50 * gone > total:
        gone = 0
        for v in range(first.size):
            number += 1
            count, best, into = 0, 100.0 * flat * flat, -1
            s = first[v] if free[v] else -1
            while s >= 0 and count < ring.shape[0]:
                f, c = s // 3, s % 3
                if faces[f, 0] >= 0:
                    a, b = faces[f, (c + 1) % 3], faces[f, (c + 2) % 3]
                    ring[count, 0], ring[count, 1], seen[a] = a, b, number
                    best = min(best, squared_height(points, v, a, b))
                    count += 1
                s = after[s]
            for n in range(count if s < 0 else 0):
                u = ring[n, 0]
                if free[u]:
                    height = _lowest(points, ring, count, v, u, flat)
                    if height > best and _beside(faces, after, first[u], seen, number) == 4:
                        best, into = height, u
            if into < 0:
                continue
            last = s = first[v]
            while s >= 0:
                f, c = s // 3, s % 3
                if faces[f, (c + 1) % 3] == into or faces[f, (c + 2) % 3] == into:
                    faces[f, 0] = -1
                elif faces[f, 0] >= 0:
                    faces[f, c] = into
                last, s = s, after[s]
            after[last], first[into], free[v] = first[into], first[v], False
            gone += 1
        total += gone


@inner_kernel
def _lowest(points: Any, ring: Any, count: Any, v: Any, u: Any, flat: Any) -> Any:
    """Square of the least height of faces in a ring around v if v is at u; -1 if it may not be."""
    height = np.inf
    for n in range(count):
        a, b = ring[n, 0], ring[n, 1]
        if a == u or b == u:
            continue
        height = min(height, squared_height(points, u, a, b))
        before, then = face_normal(points, v, a, b), face_normal(points, u, a, b)
        turn = off = size = 0.0
        for d in range(3):
            turn += before[d] * then[d]
            size += before[d] * before[d]
            off += before[d] * (points[u, d] - points[v, d])
        if turn <= 0.0 or off * off > flat * flat * size:
            return -1.0
    return height


@inner_kernel
def _beside(faces: Any, after: Any, s: Any, seen: Any, number: Any) -> Any:
    """Count a vertex's neighbours that are in a ring, each in both of its faces."""
    count = 0
    while s >= 0:
        f, c = s // 3, s % 3
        if faces[f, 0] >= 0:
            for d in range(1, 3):
                count += 1 if seen[faces[f, (c + d) % 3]] == number else 0
        s = after[s]
    return count


# ------------------------------------------------------------------------------------------------
# Divide a part along curved level sets, and make sure that every shell is closed.


_ATTEMPTS = 12
"""Grids to try: the second is needed where a level lies in a face or edge, a fifth hardly ever."""

FIRST_SHIFT = np.array([0.3702, 0.2131, 0.5316])
"""Of the first grid; see `_divide_along`."""

_THIN_ATTEMPTS = 4
"""Of these, how many may go to triangles so thin that some readers drop them."""

_READ_MM = 1.5e-8  # trimesh drops triangles lower than 1e-8 mm
_SHARE = 2e-3  # of a pitch that levels move by from attempt to attempt
_STEP = np.array([0.7548776662, 0.5698402910, 0.4301597090])  # spreads evenly over a cube


def _split_curved(
    mesh: Mesh, field: Field, levels: FloatArray, pitch_mm: float, within_mm: float, follow: bool
) -> Pieces:
    """Divide a part along level sets on a grid of a pitch.

    Decisions are exact, but points are rounded to float32 afterwards. Where surfaces nearly
    touch, points of different places can become one, and a shell then has an edge of four
    faces. The grid is moved in such a case, by a part of a pitch, and levels by a thousandth.

    Raises
    ------
    ArgumentError
        The pitch is none or too fine, the field is not finite, or no grid serves.
    """
    extent_mm = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    positive(pitch_mm, "`pitch_mm`")
    best: tuple[int, Pieces] | None = None
    for attempt in range(_ATTEMPTS):
        if best is not None and (best[0] == 0 or attempt >= _THIN_ATTEMPTS):
            break
        shift = (FIRST_SHIFT + attempt * _STEP) % 1.0
        share = _SHARE * ((attempt + 1) // 2) * (1 if attempt % 2 else -1)  # up and down in turn
        moved = levels + share * pitch_mm / max(float(extent_mm.max()), pitch_mm)
        found, broken = _divide_along(mesh, field, moved, pitch_mm, shift, within_mm, follow)
        if broken:
            continue
        new = np.asarray((found.faces.T.copy() >= len(mesh.vertices)).any(axis=0))
        each = [(_thin(found, new), found)]
        if each[0][0]:
            flipped = _without_thin(found, new)
            each.append((_thin(flipped, new), flipped))
        made = next((one for one in sorted(each, key=itemgetter(0)) if _shells_close(one[1])), None)
        if made is not None and (best is None or made[0] < best[0]):
            best = made
    if best is not None:
        return best[1]
    raise ArgumentError(
        f"field {field.name!r}: no grid of {pitch_mm:g} mm gives sound shells{_fault(found)}; the "
        "part touches itself there, or levels are too close for its size: mend the part, use "
        "fewer bands, or another `pitch_mm`"
    )


def _fault(divided: Pieces) -> str:
    """Say where the first shell that is not closed has the middle of its first wrong edge.

    One whose two faces run the same way is such an edge, too; the first in the order of the faces.
    """
    for number in np.unique(divided.piece).tolist():
        faces = divided.shell_faces([number])
        twin, tail = Topology(faces).twin, faces.ravel()
        wrong = np.flatnonzero((twin < 0) | (tail == tail[twin]))
        if len(wrong):
            face, j = divmod(int(wrong[0]), 3)
            ends = divided.vertices[faces[face, [j, (j + 1) % 3]]].astype(np.float64)
            return f" at {place_text(ends.mean(axis=0))} as placed for printing"
    return ""


def _thin(divided: Pieces, new: BoolArray) -> int:
    """Count new triangles so thin that readers drop them."""
    faces = np.concatenate([divided.faces.compress(new, axis=0), divided.cap_faces])
    return len(thin_faces(divided.vertices, faces, _READ_MM))


def _without_thin(divided: Pieces, new: BoolArray) -> Pieces:
    """Exchange the long sides of thin new triangles, within each piece and each interface."""
    faces, caps = divided.faces.copy(), divided.cap_faces.copy()
    for own, label in ((faces, np.where(new, divided.piece, -1)), (caps, divided.cap_level)):
        for value in np.unique(label[label >= 0]):
            members = np.flatnonzero(label == value)
            some = own[members]
            flip_thin(divided.vertices, some, flat=False)
            own[members] = some
    return replace(divided, faces=faces, cap_faces=caps)


def _shells_close(divided: Pieces) -> bool:
    """Tell whether each piece has each edge once each way, no face twice, and a volume."""
    pieces = (divided.shell_faces([number]) for number in range(divided.count))
    shells = JoinedShells(divided.vertices, tuple(faces for faces in pieces if len(faces)))
    return all(shells.sound(number) for number in range(len(shells.faces)))


# ------------------------------------------------------------------------------------------------
# Divide a part at levels of a field, whatever its level sets are.


def split(
    mesh: Mesh, field: Field, levels: Sequence[float] | FloatArray, *,
    pitch_mm: float | None = None, within_mm: float = math.inf, follow: bool = True,
) -> Pieces:  # fmt: skip
    """Divide a part at levels of a field: in planes where its level sets are, else on a grid.

    Parameters
    ----------
    mesh : Mesh
        A closed part at float32 positions, as `planner.mesh.part.moved_to_corner` returns it.
    field : Field
        In the coordinates of `mesh`.
    levels : (L,) sequence of float
        Field values of the interfaces, strictly increasing in (0, 1).
    pitch_mm : float
        Of the grid on which curved level sets are drawn; see
        `planner.cutting.grid.default_pitch_mm`. Planes need none.
    within_mm
        The grid is divided where triangles would lie farther from their level set.
    follow
        Whether vertices lie where the field has its levels, or where it has them if linear
        between the grid's vertices.

    Returns
    -------
    Pieces
        Every piece's shell is closed, and both sides of an interface have the same triangles.

    Raises
    ------
    ArgumentError
        Levels out of order, out of range or too close to be told apart in float32; positions
        that float32 cannot hold; a pitch that is none or too fine; a field that is not finite.
    MeshError
        The part is open where a level meets it.
    """
    values = np.asarray(levels, dtype=np.float64)
    if values.ndim != 1 or not ((values > 0) & (values < 1)).all():
        raise ArgumentError(f"levels {list(levels)}: every level must be a number between 0 and 1")
    if not (mesh.vertices.astype(np.float32) == mesh.vertices).all():
        raise ArgumentError(
            "the mesh has coordinates that float32 cannot hold; pass it through "
            "planner.mesh.part.moved_to_corner first"
        )
    if not isinstance(field, PlanarField):
        if not (np.diff(values) > 0).all():
            raise ArgumentError(f"levels {list(levels)}: they must increase")
        pitch_mm = default_pitch_mm(mesh) if pitch_mm is None else pitch_mm
        return _split_curved(mesh, field, values, pitch_mm, within_mm, follow)
    divided, vertices, cap_faces, cap_level = cut_by_planes(mesh, field, values)
    over, count = field.values(mesh.vertices), len(values) + 1
    ends = float(over.min()), float(over.max())
    return Pieces(vertices, divided.faces, divided.piece, cap_faces, cap_level, count, ends)
