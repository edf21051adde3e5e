"""Divide the faces of a surface along segments: the loops around each part of a face."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.level_sets.meetings import Surface
from planner.geometry.level_sets.sides import OrderedPoints

__all__ = ["Loops", "walk_faces"]


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


def walk_faces(
    surface: Surface, labels: NDArray[np.int32], ordered: OrderedPoints, way: NDArray[np.int8],
    step_level: NDArray[np.int32], segment: NDArray[np.int32], segment_face: NDArray[np.int32],
    segment_level: NDArray[np.int32],
) -> Loops:  # fmt: skip
    """Find the loops of all faces that have segments.

    Parameters
    ----------
    surface : Surface
        The part, or the level sets.
    labels : (n,) int32
        Of its vertices.
    ordered
        Meetings on its edges.
    way, step_level : (p,)
        A meeting joins the labels `step_level` and `step_level` + 1 along its edge, upwards
        where `way` is 1.
    segment, segment_face : (s, 2), (s,)
        Segments in its faces, with the higher label on their left.
    segment_level : (s,) int32
        The lower of the two labels that each divides.
    """
    order = np.argsort(segment_face, kind="stable")
    faces, first = np.unique(segment_face[order], return_index=True)
    starts = np.append(first, len(order)).astype(np.int32)
    on_edges = np.diff(ordered.offsets)[surface.edges.of_face[faces]].sum(axis=1)
    halves = 3 + on_edges + 2 * np.diff(starts)
    room, most = int(halves.sum()), int(halves.max(initial=3))
    nodes, loop_starts = np.empty(room, dtype=np.int32), np.zeros(room + 1, dtype=np.int32)
    loop_face, loop_label = np.empty((2, room), dtype=np.int32)
    count = len(labels) + len(way)
    # The order of near meetings is settled where labels tell it: a copy is changed.
    points = ordered.points.copy()
    broken = _settle(ordered.offsets, points, surface.edges.ends, labels, way, step_level)
    slot, stamp = np.empty(2 * count, dtype=np.int32), np.full(2 * count, -1, dtype=np.int32)
    loops, lost = _walk(
        faces.astype(np.int32), surface.faces, surface.edges.of_face, surface.edges.ends, labels,
        ordered.offsets, points, way, starts, segment[order], segment_level[order],
        slot, stamp, np.empty((most, 4), dtype=np.int32),
        nodes, loop_starts, loop_face, loop_label,
    )  # fmt: skip
    return Loops(
        nodes[: loop_starts[loops]], loop_starts[: loops + 1], loop_face[:loops],
        loop_label[:loops], broken + lost,
    )  # fmt: skip


@kernel
def _settle(offsets: Any, points: Any, ends: Any, labels: Any, way: Any, step_level: Any) -> Any:
    """Let each edge's meetings follow from label to label; return how many edges cannot."""
    broken = 0
    for e in range(ends.shape[0]):
        label = labels[ends[e, 0]]
        for n in range(offsets[e], offsets[e + 1]):
            found = -1
            for m in range(n, offsets[e + 1]):
                p = points[m]
                if label == step_level[p] + (0 if way[p] > 0 else 1):
                    found = m
                    break
            if found < 0:
                broken += 1
                break
            p = points[found]
            for m in range(found, n, -1):
                points[m] = points[m - 1]
            points[n] = p
            label += way[p]
        else:
            if label != labels[ends[e, 1]]:
                broken += 1
    return broken


@kernel
def _walk(
    chosen: Any, faces: Any, face_edges: Any, ends: Any, labels: Any, offsets: Any, points: Any,
    way: Any, starts: Any, segment: Any, segment_level: Any, slot: Any, stamp: Any, half: Any,
    nodes: Any, loop_starts: Any, loop_face: Any, loop_label: Any,
) -> Any:  # fmt: skip
    # half: where each directed side begins and ends, its label, and whether it is left to walk.
    count = labels.size
    loops = filled = lost = 0
    for n in range(chosen.size):
        f = chosen[n]
        sides = 0
        for j in range(3):
            a, b = faces[f, j], faces[f, (j + 1) % 3]
            e = face_edges[f, j]
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
