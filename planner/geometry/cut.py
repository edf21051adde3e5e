"""Divide the surface of a part by parallel planes, each (edge, plane) once.

Where a plane meets a mesh edge is computed from the lower end to the upper one, so that both
triangles at the edge find the same bits, and rounded once. What then has equal coordinates has
one index: the divided surface closes wherever the mesh does.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, Float32Array, FloatArray
from planner.geometry.kernel import kernel
from planner.geometry.mesh import Mesh
from planner.geometry.weld import cancel_opposite, position_slot

__all__ = ["Divided", "divide", "snap_distance_mm"]

LATTICE_MM = 2.0**-20
"""Readers that join positions within 1e-8 mm must not join two of ours: float32 is finer than
that near zero, so new points are first rounded to this lattice."""


@dataclass(frozen=True, eq=False)
class Divided:
    """The surface of a part, divided by planes.

    Attributes
    ----------
    vertices : (n, 3) float32
        The mesh's vertices, then the points where planes meet edges, in mm.
    faces : (k, 3) int32
        Triangles with the orientation of those they are part of.
    piece : (k,) int32
        Between which planes a triangle lies: piece i has plane i - 1 below and plane i above.
    segment : (s, 2) int32
        Directed sides of triangles that lie in a plane.
    segment_plane : (s,) int32
        The plane they lie in.
    segment_below : (s,) bool
        Whether their triangle is of the piece below the plane.
    """

    vertices: Float32Array
    faces: NDArray[np.int32]
    piece: NDArray[np.int32]
    segment: NDArray[np.int32]
    segment_plane: NDArray[np.int32]
    segment_below: BoolArray


def snap_distance_mm(bounds_mm: FloatArray) -> float:
    """Within what distance of a plane a vertex counts as lying in it.

    Twice the spacing of float32 at the largest coordinate: more than rounding moves a new point
    off its plane (at most sqrt(3)/2 of the spacing and of the lattice together), so that a new
    point can coincide only with vertices that count as lying in the plane.
    """
    largest = np.float32(np.abs(bounds_mm).max())
    return 2.0 * max(float(np.spacing(largest)), LATTICE_MM)


def divide(mesh: Mesh, normal: FloatArray, offsets_mm: FloatArray) -> Divided:
    """Divide a mesh of float32 positions by the planes n . x = offset.

    Parameters
    ----------
    mesh : Mesh
        A closed surface; no two vertices are equal.
    normal : (3,) float64
        Unit normal n of the planes.
    offsets_mm : (L,) float64
        Increasing, more than two snap distances apart. For a normal along an axis, float32
        values: new points then lie exactly in their plane.

    Returns
    -------
    Divided
        Triangles that no plane cuts keep their bits. Faces in a plane belong to the side on
        which the material is.
    """
    axis = int(np.argmax(np.abs(normal))) if np.count_nonzero(normal) == 1 else -1
    along, code = _classify(mesh.vertices, normal, offsets_mm, snap_distance_mm(mesh.bounds_mm))
    crossings, triangles, sides = _size(mesh.faces, code)
    # New points: at most two a crossing, as each side of an edge finds its own.
    n, most = len(mesh.vertices), 2 * crossings
    vertices = np.empty((n + most, 3), dtype=np.float32)
    vertices[:n] = mesh.vertices
    tag = np.full(n + most, -1, dtype=np.int32)
    tag[:n][code % 2 == 1] = code[code % 2 == 1]
    origin = np.empty((most, 2), dtype=np.int32)
    merged = np.zeros(n + most, dtype=np.bool_)
    bits = max(4, int(2 * (np.count_nonzero(tag >= 0) + most)).bit_length())
    table = np.full(1 << bits, -1, dtype=np.int32)
    faces, piece = np.empty((triangles, 3), dtype=np.int32), np.empty(triangles, dtype=np.int32)
    segment = np.empty((sides, 4), dtype=np.int32)
    made, written, drawn = _divide(
        mesh.vertices, mesh.faces, normal, axis, offsets_mm, along, code, vertices,
        vertices.view(np.uint32), tag, origin, merged, table, np.uint64(64 - bits), faces, piece,
        segment,
    )  # fmt: skip
    vertices, merged = vertices[: n + made], merged[: n + made]
    faces, piece, segment = faces[:written], piece[:written], segment[:drawn]
    if merged.any():
        touched = np.flatnonzero(merged[faces].any(axis=1))
        doubled = touched[~_cancel_in_pieces(faces[touched], piece[touched])]
        faces, piece = np.delete(faces, doubled, axis=0), np.delete(piece, doubled)
    return Divided(
        vertices, faces, piece, segment[:, :2].copy(), segment[:, 2].copy(), segment[:, 3] == 1
    )


def _cancel_in_pieces(faces: NDArray[np.int32], piece: NDArray[np.int32]) -> BoolArray:
    """Tell which faces stay when those of one piece that are opposite cancel."""
    keep = np.ones(len(faces), dtype=np.bool_)
    for i in np.unique(piece):
        members = piece == i
        keep[members] = cancel_opposite(faces[members])
    return keep


@kernel
def _classify(vertices: Any, normal: Any, offsets: Any, snap: Any) -> Any:
    """Place every vertex along the normal: code 2i in piece i, 2i + 1 in plane i."""
    n = vertices.shape[0]
    along = np.empty(n, dtype=np.float64)
    code = np.empty(n, dtype=np.int32)
    for i in range(n):
        s = normal[0] * vertices[i, 0] + normal[1] * vertices[i, 1] + normal[2] * vertices[i, 2]
        along[i] = s
        low, high = 0, offsets.size
        while low < high:
            middle = (low + high) // 2
            if offsets[middle] < s - snap:
                low = middle + 1
            else:
                high = middle
        code[i] = 2 * low
        if low < offsets.size and offsets[low] <= s + snap:
            code[i] += 1
    return along, code


@kernel
def _has_side(c0: Any, c1: Any, c2: Any) -> Any:
    """Tell whether two of a triangle's corners lie in one plane."""
    return (c0 == c1 and c0 & 1) or (c1 == c2 and c1 & 1) or (c2 == c0 and c2 & 1)


@kernel
def _size(faces: Any, code: Any) -> Any:
    """Count planes that cross triangles, and the most triangles and sides in planes to come."""
    crossings = sides = 0
    for f in range(faces.shape[0]):
        c0, c1, c2 = code[faces[f, 0]], code[faces[f, 1]], code[faces[f, 2]]
        crossed = max(c0, c1, c2) // 2 - (min(c0, c1, c2) + 1) // 2
        if crossed > 0:
            crossings += crossed
            sides += 3 * (1 + 2 * crossed)
        elif _has_side(c0, c1, c2):
            sides += 3
    return crossings, faces.shape[0] + 2 * crossings, sides


@kernel
def _divide(
    vertices: Any, faces: Any, normal: Any, axis: Any, offsets: Any, along: Any, code: Any,
    pool: Any, raw: Any, tag: Any, origin: Any, merged: Any, table: Any, shift: Any,
    out_face: Any, out_piece: Any, segment: Any,
) -> Any:  # fmt: skip
    """Fill the output; return how many points, triangles and sides there are."""
    n = vertices.shape[0]
    for i in range(n):
        if tag[i] >= 0:
            slot = position_slot(raw[i, 0], raw[i, 1], raw[i, 2], shift)
            while table[slot] >= 0:
                slot = (slot + 1) & (table.size - 1)
            table[slot] = i
    polygon = np.empty(5, dtype=np.int64)
    made = written = drawn = 0
    for f in range(faces.shape[0]):
        # One integer type for indices: kernels called below are then compiled once.
        lo, mid, hi = np.int64(faces[f, 0]), np.int64(faces[f, 1]), np.int64(faces[f, 2])
        c0, c1, c2 = code[lo], code[mid], code[hi]
        first = (min(c0, c1, c2) + 1) // 2
        last = max(c0, c1, c2) // 2
        if first >= last:
            if c0 == c1 and c1 == c2 and c0 & 1:
                first = c0 // 2 + (0 if _faces_up(vertices, normal, lo, mid, hi) else 1)
            out_face[written, 0], out_face[written, 1], out_face[written, 2] = lo, mid, hi
            out_piece[written] = first
            written += 1
            if _has_side(c0, c1, c2):
                drawn = _draw(segment, drawn, tag, lo, mid, hi, first)
            continue

        turned = False
        if c0 > c1:
            lo, mid, c0, c1, turned = mid, lo, c1, c0, not turned
        if c1 > c2:
            mid, hi, c1, c2, turned = hi, mid, c2, c1, not turned
        if c0 > c1:
            lo, mid, c0, c1, turned = mid, lo, c1, c0, not turned
        long_below = short_below = lo
        below = c0
        for k in range(first, last + 1):
            above = 2 * k + 1
            if k == last:
                above = c2
                long_above = short_above = hi
            else:
                long_above = short_above = mid
                for side in range(2):
                    low, high = lo, hi
                    if side == 1:
                        if above == c1:
                            continue
                        if above < c1:
                            high = mid
                        else:
                            low = mid
                    v, made = _meet(
                        vertices, along, low, high, offsets[k], axis, normal, pool, raw, n,
                        made, origin, merged, table, shift,
                    )  # fmt: skip
                    tag[v] = above
                    if side == 0:
                        long_above = v
                    else:
                        short_above = v
            # Counter-clockwise along lo, mid, hi; the middle corner first where it takes part.
            corners = 0
            if (c1 > below or k == first) and (c1 < above or k == last):
                corners = _append(polygon, corners, mid)
            corners = _append(polygon, corners, short_above)
            corners = _append(polygon, corners, long_above)
            corners = _append(polygon, corners, long_below)
            corners = _append(polygon, corners, short_below)
            while corners > 1 and polygon[corners - 1] == polygon[0]:
                corners -= 1
            if corners == 4 and _better_from_second(pool, polygon):
                v = polygon[0]
                polygon[0], polygon[1], polygon[2] = polygon[1], polygon[2], polygon[3]
                polygon[3] = v
            for j in range(1, corners - 1):
                a, b, c = polygon[0], polygon[j], polygon[j + 1]
                if turned:
                    b, c = c, b
                if a != b and b != c and c != a:
                    out_face[written, 0], out_face[written, 1], out_face[written, 2] = a, b, c
                    out_piece[written] = k
                    written += 1
                    drawn = _draw(segment, drawn, tag, a, b, c, k)
            long_below, short_below, below = long_above, short_above, above
    return made, written, drawn


@kernel
def _meet(
    vertices: Any, along: Any, low: Any, high: Any, offset: Any, axis: Any, normal: Any,
    pool: Any, raw: Any, n: Any, made: Any, origin: Any, merged: Any, table: Any, shift: Any,
) -> Any:  # fmt: skip
    """Find the index of the point where the edge low-high meets a plane, or make it."""
    t = (offset - along[low]) / (along[high] - along[low])
    i = n + made
    for j in range(3):
        if j == axis:
            value = offset * normal[j]
        else:
            value = vertices[low, j] + t * (vertices[high, j] - vertices[low, j])
        pool[i, j] = np.rint(value / LATTICE_MM) * LATTICE_MM + 0.0
    slot = position_slot(raw[i, 0], raw[i, 1], raw[i, 2], shift)
    while table[slot] >= 0:
        j = table[slot]
        if raw[j, 0] == raw[i, 0] and raw[j, 1] == raw[i, 1] and raw[j, 2] == raw[i, 2]:
            if j < n or origin[j - n, 0] != low or origin[j - n, 1] != high:
                merged[j] = True
            return np.int64(j), made
        slot = (slot + 1) & (table.size - 1)
    table[slot] = i
    origin[made, 0], origin[made, 1] = low, high
    return np.int64(i), made + 1


@kernel
def _append(polygon: Any, corners: Any, v: Any) -> Any:
    if corners > 0 and polygon[corners - 1] == v:
        return corners
    polygon[corners] = v
    return corners + 1


@kernel
def _draw(segment: Any, drawn: Any, tag: Any, a: Any, b: Any, c: Any, piece: Any) -> Any:
    """Note the sides of a triangle that lie in a plane."""
    for _ in range(3):
        if tag[a] >= 0 and tag[a] == tag[b]:
            segment[drawn, 0], segment[drawn, 1] = a, b
            segment[drawn, 2] = tag[a] // 2
            segment[drawn, 3] = 1 if tag[a] // 2 == piece else 0
            drawn += 1
        a, b, c = b, c, a
    return drawn


@kernel
def _faces_up(vertices: Any, normal: Any, a: Any, b: Any, c: Any) -> Any:
    """Tell whether a face's normal has a positive part along the planes' normal."""
    dot = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        uj, uk = vertices[b, j] - vertices[a, j], vertices[b, k] - vertices[a, k]
        vj, vk = vertices[c, j] - vertices[a, j], vertices[c, k] - vertices[a, k]
        dot += normal[i] * (uj * vk - uk * vj)
    return dot > 0.0


@kernel
def _better_from_second(pool: Any, polygon: Any) -> Any:
    """Tell whether diagonal 1-3 of a quadrilateral leaves thicker triangles than 0-2."""
    p0, p1, p2, p3 = polygon[0], polygon[1], polygon[2], polygon[3]
    kept = min(squared_height(pool, p0, p1, p2), squared_height(pool, p0, p2, p3))
    other = min(squared_height(pool, p1, p2, p3), squared_height(pool, p1, p3, p0))
    return other > kept


@kernel
def squared_height(pool: Any, a: Any, b: Any, c: Any) -> Any:
    """Square of a triangle's height over its longest side; 0 where two corners coincide."""
    ux = np.float64(pool[b, 0]) - pool[a, 0]
    uy = np.float64(pool[b, 1]) - pool[a, 1]
    uz = np.float64(pool[b, 2]) - pool[a, 2]
    vx = np.float64(pool[c, 0]) - pool[a, 0]
    vy = np.float64(pool[c, 1]) - pool[a, 1]
    vz = np.float64(pool[c, 2]) - pool[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    wx, wy, wz = vx - ux, vy - uy, vz - uz
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
    longest = max(longest, wx * wx + wy * wy + wz * wz)
    return (nx * nx + ny * ny + nz * nz) / longest if longest > 0.0 else 0.0
