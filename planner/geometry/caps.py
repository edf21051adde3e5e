"""Close the pieces of a divided surface: one triangulation a plane, shared by both sides."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.errors import MeshError
from planner.geometry.cut import LATTICE_MM, Divided
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.mend import first_unfilled, flip_thin, side_clashes, split_sides

__all__ = ["caps"]

ROUNDS = 8
"""Splitting a side at most this often; once has been enough wherever it was needed."""


def caps(
    divided: Divided, normal: FloatArray
) -> tuple[Float32Array, NDArray[np.int32], NDArray[np.int32]]:
    """Triangulate every plane's cross-section between the vertices of its outline.

    A vertex is added only in the middle of a diagonal that is already an edge of the surface,
    as at a groove whose bottom lies in the plane: no edge then has four faces.

    Parameters
    ----------
    divided : Divided
        The surface.
    normal : (3,) float64
        Unit normal of the planes.

    Returns
    -------
    vertices : (n, 3) float32
        Those of `divided`, then the added ones.
    cap_faces : (c, 3) int32
        Triangles that face along the normal: outwards for the piece below.
    cap_level : (c,) int32
        The plane each triangle closes, increasing.

    Raises
    ------
    MeshError
        An outline is not closed, because the mesh is not, or has no triangulation.
    """
    # Without its largest component the normal is projected, exactly, on a coordinate plane.
    drop = int(np.argmax(np.abs(normal)))
    u, v = (drop + 1) % 3, (drop + 2) % 3
    if normal[drop] < 0:
        u, v = v, u
    outline = divided.segment[divided.segment_below]
    plane = divided.segment_plane[divided.segment_below]
    points = divided.vertices[:, [u, v]].astype(np.float64, order="C")
    corners, starts, loop_plane, astray = _loops(outline, plane, points)
    if astray >= 0:
        raise MeshError(
            f"the surface is open near {_place(divided, astray)}: the outline of a cut ends there; "
            "repair the mesh so that every edge has two faces"
        )
    cap_faces, cap_level = _triangulate(points, corners, starts, loop_plane)
    flip_thin(divided.vertices, cap_faces)
    unfilled = first_unfilled(cap_faces, divided.segment, divided.segment_below)
    if unfilled >= 0:
        raise MeshError(
            f"the cross-section near {_place(divided, unfilled)} cannot be divided into triangles: "
            "its outline crosses itself; repair the mesh, or move the level"
        )
    vertices = divided.vertices
    for _ in range(ROUNDS):
        sides = side_clashes(cap_faces, divided.segment, divided.segment_below)
        if len(sides) == 0:
            break
        vertices, cap_faces, cap_level = split_sides(vertices, cap_faces, cap_level, sides)
    return vertices, cap_faces, cap_level


def _place(divided: Divided, vertex: int) -> str:
    """Write a vertex's position for a message."""
    x, y, z = divided.vertices[vertex].tolist()
    return f"({x:.6g}, {y:.6g}, {z:.6g}) mm"


def _triangulate(
    points: FloatArray,
    corners: NDArray[np.int32],
    starts: NDArray[np.int32],
    loop_plane: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Triangulate the loops of each plane, indices into the whole pool of vertices."""
    from manifold3d import triangulate

    faces = [np.empty((0, 3), dtype=np.int32)]
    level = [np.empty(0, dtype=np.int32)]
    order = np.argsort(loop_plane, kind="stable")
    bounds = np.searchsorted(loop_plane[order], np.arange(loop_plane.max(initial=-1) + 2))
    for i, (first, last) in enumerate(pairwise(bounds.tolist())):
        if first == last:
            continue
        loops = [corners[starts[j] : starts[j + 1]] for j in order[first:last].tolist()]
        local = triangulate([points[loop] for loop in loops], epsilon=LATTICE_MM)
        found = np.concatenate(loops)[local]
        a, b, c = found.T
        found = found[(a != b) & (b != c) & (c != a)]
        faces.append(found)
        level.append(np.full(len(found), i, dtype=np.int32))
    return np.concatenate(faces), np.concatenate(level)


def _loops(
    outline: NDArray[np.int32], plane: NDArray[np.int32], points: FloatArray
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], int]:
    """Chain the sides in a plane, turned over, to loops with the material on their left.

    Sides that occur both ways cancel.

    Returns
    -------
    corners, starts, plane
        Loop i has the vertices ``corners[starts[i] : starts[i + 1]]`` and lies in ``plane[i]``.
    astray : int
        A vertex at which no side goes on; -1 if all loops close.
    """
    count = len(outline)
    corners, starts = np.empty(count, dtype=np.int32), np.zeros(count + 1, dtype=np.int32)
    seeds, later = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    first = np.full(len(points), -1, dtype=np.int32)
    alive = np.zeros(count, dtype=np.bool_)
    loops, astray = _chain(outline, points, first, later, alive, corners, starts, seeds)
    return corners[: starts[loops]], starts[: loops + 1], plane[seeds[:loops]], astray


@kernel
def _chain(
    outline: Any, points: Any, first: Any, later: Any, alive: Any,
    corners: Any, starts: Any, seeds: Any,
) -> Any:  # fmt: skip
    """Fill the loops; return how many there are, and the vertex where one ends or -1.

    Each vertex has a list of the sides that leave it: first[vertex], later[side], ...; -1.
    Where loops touch at a vertex, a side continues with the first one clockwise from where it
    came: every corner then spans one wedge of material.
    """
    for e in range(outline.shape[0]):
        tail, head = outline[e, 1], outline[e, 0]
        back, previous = first[head], np.int32(-1)
        while back >= 0 and outline[back, 0] != tail:
            previous, back = back, later[back]
        if back < 0:
            alive[e] = True
            later[e] = first[tail]
            first[tail] = e
        else:
            alive[back] = False
            if previous >= 0:
                later[previous] = later[back]
            else:
                first[head] = later[back]

    loops = filled = 0
    for seed in range(outline.shape[0]):
        if not alive[seed]:
            continue
        # The seed stays in its vertex's list until the loop comes back to it.
        e = seed
        while alive[seed]:
            corners[filled] = outline[e, 1]
            filled += 1
            at, came = outline[e, 0], outline[e, 1]
            best = candidate = first[at]
            if best < 0:
                return loops, at
            before, previous, widest = np.int32(-1), np.int32(-1), 5.0
            while candidate >= 0 and later[first[at]] >= 0:
                turn = _clockwise(points, at, came, outline[candidate, 0])
                if turn < widest:
                    best, before, widest = candidate, previous, turn
                previous, candidate = candidate, later[candidate]
            if before >= 0:
                later[before] = later[best]
            else:
                first[at] = later[best]
            alive[best] = False
            e = best
        seeds[loops] = seed
        loops += 1
        starts[loops] = filled
    return loops, np.int32(-1)


@inner_kernel
def _clockwise(points: Any, at: Any, came: Any, to: Any) -> Any:
    """Measure the clockwise turn from at-came to at-to, growing with the angle, in (0, 4]."""
    cu, cv = points[came, 0] - points[at, 0], points[came, 1] - points[at, 1]
    tu, tv = points[to, 0] - points[at, 0], points[to, 1] - points[at, 1]
    cosine, sine = cu * tu + cv * tv, cv * tu - cu * tv
    size = abs(cosine) + abs(sine)
    if size == 0.0:
        return 4.0
    turn = 1.0 - cosine / size if sine >= 0.0 else 3.0 + cosine / size
    return turn if turn > 0.0 else 4.0
