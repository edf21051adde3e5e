"""On which side of every level, and of the part's surface, each vertex lies."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray
from planner.geometry.kernel import kernel
from planner.geometry.level_sets.lattice import face_normal, side_of_part, turn_of_edges
from planner.geometry.level_sets.meetings import Meetings, Surface
from planner.geometry.topology import connected

__all__ = ["OrderedPoints", "inside_part", "order_points", "piece_of_vertices"]


@dataclass(frozen=True, eq=False)
class OrderedPoints:
    """Meetings on the edges of one surface, in order along each.

    Attributes
    ----------
    offsets : (e + 1,) int32
        Edge i has the points ``points[offsets[i]:offsets[i + 1]]``, from its lower vertex on.
    points : int32
        Numbers of meetings.
    """

    offsets: NDArray[np.int32]
    points: NDArray[np.int32]


def order_points(meetings: Meetings, of_part: bool, edges: int) -> OrderedPoints:
    """Order the meetings along the edges of the part, or of the level sets."""
    own = np.flatnonzero(meetings.of_part == of_part)
    order = np.lexsort((meetings.along[own], meetings.edge[own]))
    points = own[order].astype(np.int32)
    offsets = np.searchsorted(meetings.edge[points], np.arange(edges + 1)).astype(np.int32)
    return OrderedPoints(offsets, points)


def piece_of_vertices(
    part: Surface, meetings: Meetings, ordered: OrderedPoints, levels: FloatArray,
    values: FloatArray,
) -> NDArray[np.int32]:  # fmt: skip
    """Count the levels below each vertex of the part, (n,).

    The field decides for one vertex of each body, the one farthest from any level; from there
    on the edges' meetings do.
    """
    above = np.searchsorted(levels, values, side="right").astype(np.int32)
    padded = np.concatenate([[-np.inf], levels, [np.inf]])
    margin = np.minimum(values - padded[above], padded[above + 1] - values)
    seeds = np.argsort(-margin, kind="stable")
    ends = part.edges.ends
    step = np.add.reduceat(
        np.append(meetings.way[ordered.points], 0).astype(np.int64), ordered.offsets[:-1]
    ) * (np.diff(ordered.offsets) > 0)
    both = np.concatenate([ends, ends[:, ::-1]])
    order = np.argsort(both[:, 0], kind="stable")
    starts = np.searchsorted(both[order, 0], np.arange(len(values) + 1))
    piece = np.full(len(values), -1, dtype=np.int32)
    _spread(
        starts, both[order, 1], np.concatenate([step, -step])[order].astype(np.int32), seeds,
        above, piece, np.empty(len(values), dtype=np.int32),
    )  # fmt: skip
    return piece


@kernel
def _spread(
    starts: Any, other: Any, step: Any, seeds: Any, above: Any, piece: Any, stack: Any
) -> None:
    known = np.zeros(piece.size, dtype=np.bool_)
    for seed in seeds:
        if known[seed]:
            continue
        known[seed], piece[seed] = True, above[seed]
        stack[0], size = seed, 1
        while size > 0:
            size -= 1
            v = stack[size]
            for h in range(starts[v], starts[v + 1]):
                w = other[h]
                if not known[w]:
                    known[w], piece[w] = True, piece[v] + step[h]
                    stack[size] = w
                    size += 1


def inside_part(
    part: Surface, level: Surface, meetings: Meetings, ordered: OrderedPoints,
    level_cell: NDArray[np.int32], offsets: NDArray[np.int64], cells: NDArray[np.int32],
    shape: tuple[int, int, int],
) -> NDArray[np.int32]:  # fmt: skip
    """Tell which vertices of the level sets lie in the part: 1 or 0, (n,).

    Edges that do not meet the part join vertices of one answer; one edge that enters or leaves
    settles it for all of them. Where there is none, a ray does, by the same exact decisions.
    """
    ends, count = level.edges.ends, np.diff(ordered.offsets)
    free = count == 0
    group = connected(len(level.points), ends[free, 0], ends[free, 1])
    answer = np.full(int(group.max(initial=-1)) + 1, -1, dtype=np.int32)
    single = np.flatnonzero(count == 1)
    way = meetings.way[ordered.points[ordered.offsets[single]]]
    answer[group[ends[single, 0]]] = way < 0
    answer[group[ends[single, 1]]] = way > 0
    open_groups = np.flatnonzero(answer < 0)
    if len(open_groups):
        first = np.full(len(answer), -1, dtype=np.int64)
        corners = level.faces.ravel()
        first[group[corners[::-1]]] = np.arange(len(corners))[::-1]
        seed = corners[first[open_groups]]
        cell = level_cell[first[open_groups] // 3].astype(np.int64)
        found = np.empty(len(seed), dtype=np.int32)
        by_cell = np.argsort(cells, kind="stable")
        face = np.repeat(np.arange(len(part.faces), dtype=np.int32), np.diff(offsets))[by_cell]
        top = int(max(part.points[:, 2].max(), level.points[:, 2].max())) + 2
        _cast(
            part.points, part.faces, np.concatenate([level.points, level.points[:1]]), seed, cell,
            cells[by_cell].astype(np.int64), face, shape[1], shape[2], top,
            np.full(len(part.faces), -1, dtype=np.int32), found,
        )  # fmt: skip
        answer[open_groups] = found
    return answer[group]


@kernel
def _cast(
    a: Any, a_faces: Any, b: Any, seed: Any, seed_cell: Any, cell: Any, face: Any,
    ny: Any, nz: Any, top: Any, stamp: Any, found: Any,
) -> None:  # fmt: skip
    end = b.shape[0] - 1
    for s in range(seed.size):
        v = seed[s]
        b[end, 0], b[end, 1], b[end, 2] = b[v, 0], b[v, 1], top
        inside = 0
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
                    s0 = side_of_part(a, a_faces[t, 0], b, v, normal)
                    s1 = side_of_part(a, a_faces[t, 0], b, end, normal)
                    if s0 == s1:
                        continue
                    t0 = turn_of_edges(a, a_faces[t, 0], a_faces[t, 1], b, v, end)
                    t1 = turn_of_edges(a, a_faces[t, 1], a_faces[t, 2], b, v, end)
                    t2 = turn_of_edges(a, a_faces[t, 2], a_faces[t, 0], b, v, end)
                    if t0 == t1 and t1 == t2:
                        inside += 1 if s1 > 0 else -1
        found[s] = 1 if inside > 0 else 0
