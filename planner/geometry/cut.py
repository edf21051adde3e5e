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
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.mesh import Mesh
from planner.geometry.weld import cancel_opposite, row_slot

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
    c0, c1, c2 = (code[corner] for corner in mesh.faces.T)
    first = (np.minimum(np.minimum(c0, c1), c2) + 1) >> 1
    last = np.maximum(np.maximum(c0, c1), c2) >> 1
    flat = np.flatnonzero((c0 == c1) & (c1 == c2) & (c0 & 1 == 1))
    first[flat] = last[flat] + ~_faces_up(mesh, flat, normal)
    cut, whole = np.flatnonzero(last > first), np.flatnonzero(last <= first)
    crossings = int((last[cut] - first[cut]).sum())
    # New points: at most two a crossing, as each side of an edge finds its own.
    n, most = len(mesh.vertices), 2 * crossings
    vertices = np.empty((n + most, 3), dtype=np.float32)
    vertices[:n] = mesh.vertices
    tag = np.full(n + most, -1, dtype=np.int32)
    tag[:n][code % 2 == 1] = code[code % 2 == 1]
    bits = max(4, int(2 * (np.count_nonzero(tag >= 0) + most)).bit_length())
    origin = np.empty((most, 2), dtype=np.int32)
    merged = np.zeros(n + most, dtype=np.bool_)
    faces = np.empty((len(cut) + 2 * crossings, 3), dtype=np.int32)
    piece, source = np.empty((2, len(faces)), dtype=np.int32)
    made, written = _divide(
        mesh.vertices, mesh.faces, cut, normal, axis, offsets_mm, along, code, vertices,
        vertices.view(np.uint32), tag, origin, merged, np.full(1 << bits, -1, dtype=np.int32),
        np.uint64(64 - bits), np.empty(5, dtype=np.int64), faces, piece, source,
    )  # fmt: skip
    vertices, tag, merged = vertices[: n + made], tag[: n + made], merged[: n + made]
    # Back into the order of the mesh's faces.
    rank = np.searchsorted(whole, source[:written]) + np.arange(written)
    other = np.ones(len(whole) + written, dtype=np.bool_)
    other[rank] = False
    divided, faces = faces[:written], np.empty((len(other), 3), dtype=np.int32)
    faces[rank], faces[other] = divided, mesh.faces[whole]
    between, piece = piece[:written], np.empty(len(other), dtype=np.int32)
    piece[rank], piece[other] = between, first[whole]
    t0, t1, t2 = (tag[corner] for corner in faces.T)
    drawn = np.stack([t0 == t1, t1 == t2, t2 == t0], axis=1)
    drawn &= np.stack([t0 >= 0, t1 >= 0, t2 >= 0], axis=1)
    side = np.flatnonzero(drawn)
    face, j = side // 3, side % 3
    segment = np.stack([faces[face, j], faces[face, (j + 1) % 3]], axis=1)
    segment_plane = tag[segment[:, 0]] >> 1
    segment_below = segment_plane == piece[face]
    if merged.any():
        touched = np.flatnonzero(merged[faces].any(axis=1))
        doubled = touched[~_cancel_in_pieces(faces[touched], piece[touched])]
        faces, piece = np.delete(faces, doubled, axis=0), np.delete(piece, doubled)
    return Divided(vertices, faces, piece, segment, segment_plane, segment_below)


def _cancel_in_pieces(faces: NDArray[np.int32], piece: NDArray[np.int32]) -> BoolArray:
    """Tell which faces stay when those of one piece that are opposite cancel."""
    keep = np.ones(len(faces), dtype=np.bool_)
    for i in np.unique(piece):
        members = piece == i
        keep[members] = cancel_opposite(faces[members])
    return keep


def _classify(
    vertices: FloatArray, normal: FloatArray, offsets_mm: FloatArray, snap_mm: float
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Place every vertex along the normal: code 2i in piece i, 2i + 1 in plane i."""
    x, y, z = vertices.T
    along = normal[0] * x + normal[1] * y + normal[2] * z
    above = np.searchsorted(offsets_mm, along - snap_mm)
    nearest = np.append(offsets_mm, np.inf)[above]
    return along, (2 * above + (nearest <= along + snap_mm)).astype(np.int32)


def _faces_up(mesh: Mesh, faces: NDArray[np.intp], normal: FloatArray) -> BoolArray:
    """Tell which normals of faces have a positive part along the planes' normal."""
    a, b, c = mesh.vertices[mesh.faces[faces]].transpose(1, 0, 2)
    return np.asarray(np.cross(b - a, c - a) @ normal > 0.0)


@kernel
def _divide(
    vertices: Any, faces: Any, cut: Any, normal: Any, axis: Any, offsets: Any, along: Any,
    code: Any, pool: Any, raw: Any, tag: Any, origin: Any, merged: Any, table: Any, shift: Any,
    polygon: Any, out_face: Any, out_piece: Any, out_source: Any,
) -> Any:  # fmt: skip
    """Divide the faces `cut`; return how many points and triangles there are."""
    n = vertices.shape[0]
    for i in range(n):
        if tag[i] >= 0:
            slot = row_slot(raw, i, shift)
            while table[slot] >= 0:
                slot = (slot + 1) & (table.size - 1)
            table[slot] = i
    # One integer type for indices: kernels called below are then compiled once.
    made = written = np.int64(0)
    for f in cut:
        lo, mid, hi = np.int64(faces[f, 0]), np.int64(faces[f, 1]), np.int64(faces[f, 2])
        c0, c1, c2 = code[lo], code[mid], code[hi]
        turned = False
        if c0 > c1:
            lo, mid, c0, c1, turned = mid, lo, c1, c0, not turned
        if c1 > c2:
            mid, hi, c1, c2, turned = hi, mid, c2, c1, not turned
        if c0 > c1:
            lo, mid, c0, c1, turned = mid, lo, c1, c0, not turned
        first, last = (c0 + 1) // 2, c2 // 2
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
                polygon[0] = mid
                corners = 1
            for v in (short_above, long_above, long_below, short_below):
                if corners == 0 or polygon[corners - 1] != v:
                    polygon[corners] = v
                    corners += 1
            while corners > 1 and polygon[corners - 1] == polygon[0]:
                corners -= 1
            turn = 1 if corners == 4 and _better_from_second(pool, polygon) else 0
            for j in range(1, corners - 1):
                a, b, c = polygon[turn], polygon[j + turn], polygon[(j + 1 + turn) % corners]
                if turned:
                    b, c = c, b
                if a != b and b != c and c != a:
                    out_face[written, 0], out_face[written, 1], out_face[written, 2] = a, b, c
                    out_piece[written], out_source[written] = k, f
                    written += 1
            long_below, short_below, below = long_above, short_above, above
    return made, written


@inner_kernel
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
    slot = row_slot(raw, i, shift)
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


@inner_kernel
def _better_from_second(pool: Any, polygon: Any) -> Any:
    """Tell whether diagonal 1-3 of a quadrilateral leaves thicker triangles than 0-2."""
    p0, p1, p2, p3 = polygon[0], polygon[1], polygon[2], polygon[3]
    kept = min(squared_height(pool, p0, p1, p2), squared_height(pool, p0, p2, p3))
    other = min(squared_height(pool, p1, p2, p3), squared_height(pool, p1, p3, p0))
    return other > kept


@inner_kernel
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
