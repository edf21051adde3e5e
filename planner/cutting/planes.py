"""Cut a part by parallel planes: each edge once, one triangulation for both sides."""

from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, MeshError
from planner.fields.basic import PlanarField, project
from planner.glance import place_text
from planner.mesh.mesh import (
    Mesh,
    cancel_opposite,
    face_normal,
    order_rows,
    repeats_index,
    weld_points,
)
from planner.numerics import (
    BoolArray,
    Float32Array,
    FloatArray,
    Int32Array,
    IntArray,
    as_point,
    inner_kernel,
    kernel,
)

__all__ = [
    "LATTICE_MM",
    "cut_by_planes",
    "flip_thin",
    "squared_height",
    "thin_faces",
    "triangulate_loops",
]


# ------------------------------------------------------------------------------------------------
# Divide the surface of a part by parallel planes, each (edge, plane) once.
#
# Where a plane meets a mesh edge is computed from the lower end to the upper one, so that both
# triangles at the edge find the same bits, and rounded once. What then has equal coordinates has
# one index: the divided surface closes wherever the mesh does.


LATTICE_MM = 2.0**-20
"""Readers that join positions within 1e-8 mm must not join two of ours: float32 is finer than
that near zero, so new points are first rounded to this lattice."""


@dataclass(frozen=True, eq=False)
class DividedSurface:
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
    return 2.0 * max(float(np.spacing(np.float32(np.abs(bounds_mm).max()))), LATTICE_MM)


def divide(mesh: Mesh, normal: FloatArray, offsets_mm: FloatArray) -> DividedSurface:
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
    DividedSurface
        Triangles that no plane cuts keep their bits. Faces in a plane belong to the side on
        which the material is.
    """
    along, code = _classify(mesh.vertices, normal, offsets_mm, snap_distance_mm(mesh.bounds_mm))
    c0, c1, c2 = (code[corner] for corner in mesh.faces.T)
    first = (np.minimum(np.minimum(c0, c1), c2) + 1) >> 1
    last = np.maximum(np.maximum(c0, c1), c2) >> 1
    flat = np.flatnonzero((c0 == c1) & (c1 == c2) & (c0 & 1 == 1))
    a, b, c = mesh.vertices[mesh.faces[flat]].transpose(1, 0, 2)
    first[flat] = last[flat] + ~(np.cross(b - a, c - a) @ normal > 0.0)
    cut, whole = np.flatnonzero(last > first), np.flatnonzero(last <= first)
    # Every part of a cut face, from the lowest up: the face, and its piece.
    parts = last[cut] - first[cut] + 1
    face = np.repeat(np.arange(len(cut)), parts)
    k = first[cut][face] + np.arange(len(face)) - np.repeat(np.cumsum(parts) - parts, parts)
    # The corners of a cut face by height; as stably sorted, an odd order turns it over.
    order = np.argsort(code[mesh.faces[cut]], axis=1, kind="stable")
    corners = np.take_along_axis(mesh.faces[cut], order, axis=1)
    turned = ((order[:, 1] - order[:, 0]) % 3 != 1)[face]
    lo, mid, hi = corners[face].T
    starts, ends = k == first[cut][face], k == last[cut][face]
    below, above = np.where(starts, code[lo], 2 * k - 1), np.where(ends, code[hi], 2 * k + 1)
    # Where the plane above a part meets the edge lo-hi, and lo-mid or mid-hi if not at mid.
    rises = above > code[mid]
    met = np.stack([~ends, ~ends & (above != code[mid])], axis=1)
    low = np.stack([lo, np.where(rises, mid, lo)], axis=1)[met]
    high = np.stack([hi, np.where(rises, hi, mid)], axis=1)[met]
    plane = np.broadcast_to(k[:, None], met.shape)[met]
    points = _meetings(mesh.vertices, along, low, high, offsets_mm[plane], normal)
    vertices, number, merged = _joined(mesh.vertices, np.flatnonzero(code & 1), points, low, high)
    tag = np.full(len(vertices), -1, dtype=np.int32)
    tag[: len(code)][code & 1 == 1] = code[code & 1 == 1]
    tag[number] = 2 * plane + 1
    sides_above = np.where(ends, hi, mid)[:, None].repeat(2, axis=1)
    sides_above[met] = number
    sides_below = np.where(starts[:, None], lo[:, None], np.roll(sides_above, 1, axis=0))
    # Counter-clockwise along lo, mid, hi; the middle corner first where it takes part.
    own = ((code[mid] > below) | starts) & ((code[mid] < above) | ends)
    ring = np.column_stack([np.where(own, mid, -1), sides_above[:, ::-1], sides_below])
    chosen, faces = _fans(vertices, ring, turned)
    # Back into the order of the mesh's faces.
    order = np.argsort(np.concatenate([cut[face[chosen]], whole]), kind="stable")
    faces = np.concatenate([faces, mesh.faces[whole]])[order]
    piece = np.concatenate([k[chosen], first[whole]]).astype(np.int32)[order]
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
        doubled = touched[~cancel_opposite(faces[touched], piece[touched])]
        faces, piece = np.delete(faces, doubled, axis=0), np.delete(piece, doubled)
    return DividedSurface(vertices, faces, piece, segment, segment_plane, segment_below)


def _classify(
    vertices: FloatArray, normal: FloatArray, offsets_mm: FloatArray, snap_mm: float
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Place every vertex along the normal: code 2i in piece i, 2i + 1 in plane i."""
    along = project(vertices, as_point(normal))
    above = np.searchsorted(offsets_mm, along - snap_mm)
    nearest = np.append(offsets_mm, np.inf)[above]
    return along, (2 * above + (nearest <= along + snap_mm)).astype(np.int32)


def _meetings(
    vertices: FloatArray, along: FloatArray, low: Int32Array, high: Int32Array,
    offset_mm: FloatArray, normal: FloatArray,
) -> Float32Array:  # fmt: skip
    """Return where edges low-high meet planes, rounded."""
    start, end = vertices[low], vertices[high]
    share = (offset_mm - along[low]) / (along[high] - along[low])
    points = start + share[:, None] * (end - start)
    wall = start == end  # along the axes, where it stays
    if np.count_nonzero(normal) == 1:
        axis = int(np.argmax(np.abs(normal)))
        points[:, axis], wall[:, axis] = offset_mm * normal[axis], False
    rounded = np.rint(points / LATTICE_MM) * LATTICE_MM + 0.0
    return np.where(wall, start, rounded).astype(np.float32)


def _joined(
    vertices: FloatArray, inside: IntArray, points: Float32Array, low: Int32Array, high: Int32Array
) -> tuple[Float32Array, IntArray, BoolArray]:
    """Add new points to the vertices, each position once, also beside those `inside` planes.

    Also returned: the number of each point, and which vertices are points of several edges.
    """
    own = vertices.astype(np.float32)
    distinct, index = weld_points(np.concatenate([own[inside], points]))
    known, index = len(inside), index[len(inside) :]
    number = np.concatenate([inside, len(own) + np.arange(len(distinct) - known)])[index]
    pool = np.concatenate([own, distinct[known:]])
    maker = np.zeros(len(distinct), dtype=np.int64)
    maker[index[::-1]] = np.arange(len(index))[::-1]  # the first of those with one position
    maker = maker[index]
    several = (index < known) | (low != low[maker]) | (high != high[maker])
    merged = np.zeros(len(pool), dtype=np.bool_)
    merged[number[several]] = True
    return pool, number, merged


def _fans(
    vertices: Float32Array, ring: IntArray, turned: BoolArray
) -> tuple[IntArray, NDArray[np.int32]]:
    """Divide polygons of at most five corners, (n, 5), into triangles, and turn some over.

    A corner that repeats the one before it counts once, and -1 is none. Of a quadrilateral's
    diagonals the one that leaves thicker triangles is taken. Also returned: whose each triangle is.
    """
    kept = ring != np.roll(ring, 1, axis=1)
    kept[:, 0] = ring[:, 0] >= 0
    packed = np.take_along_axis(ring, np.argsort(~kept, axis=1, kind="stable"), axis=1)
    corners, each = kept.sum(axis=1), np.arange(len(ring))
    corners -= (corners > 1) & (packed[each, corners - 1] == packed[:, 0])
    four = np.flatnonzero(corners == 4)
    heights = [
        np.minimum(*(_squared_heights(vertices, packed[four][:, three]) for three in pair))
        for pair in (((0, 1, 2), (0, 2, 3)), ((1, 2, 3), (1, 3, 0)))
    ]
    begin = np.zeros(len(ring), dtype=np.int64)
    begin[four] = heights[1] > heights[0]
    step = np.arange(1, 4)
    after = (begin[:, None] + step + 1) % np.maximum(corners, 1)[:, None]
    faces = np.empty((len(ring), 3, 3), dtype=np.int32)
    faces[:, :, 0] = packed[each, begin][:, None]
    faces[:, :, 1] = np.take_along_axis(packed, begin[:, None] + step, axis=1)
    faces[:, :, 2] = np.take_along_axis(packed, after, axis=1)
    faces[turned] = faces[turned][:, :, [0, 2, 1]]
    proper = (step < corners[:, None] - 1) & ~repeats_index(faces.reshape(-1, 3)).reshape(-1, 3)
    return np.nonzero(proper)[0], faces[proper]


def _squared_heights(points_mm: Float32Array, faces: IntArray) -> FloatArray:
    """Return what `squared_height` does, of many triangles."""
    heights = np.empty(len(faces))
    _fill_heights(points_mm, np.ascontiguousarray(faces, dtype=np.int32), heights)
    return heights


@kernel
def _fill_heights(points: Any, faces: Any, heights: Any) -> None:
    for i in range(len(faces)):
        heights[i] = squared_height(points, faces[i, 0], faces[i, 1], faces[i, 2])


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


# ------------------------------------------------------------------------------------------------
# Mend a planar triangulation: thin triangles, and sides that the surface already has.


_THIN_MM = LATTICE_MM / 4
"""Readers drop triangles lower than 1e-8 mm and so open a surface; float32 cannot promise more
than the spacing of its values, so what is lower than this is worth a flip."""


def flip_thin(vertices: Float32Array, faces: NDArray[np.int32], *, flat: bool = True) -> None:
    """Exchange, in place, the longest side of thin triangles where the neighbour gains by it.

    Parameters
    ----------
    vertices : (n, 3) float32
        Positions in mm.
    faces : (m, 3) int32
        A triangulation of flat regions, or of any surface.
    flat : bool
        Whether regions are flat: what a flip made may then be flipped again, thin or not.
    """
    thin, points = thin_faces(vertices, faces, _THIN_MM), vertices.astype(np.float64)
    for _ in range(_FLIP_ROUNDS if len(thin) else 0):
        keys = _key(_sides(faces))
        half = np.argsort(keys, kind="stable")
        if not _flip(points, faces, thin, np.inf if flat else _THIN_MM**2, keys[half], half):
            break


def thin_faces(points_mm: Float32Array, faces: NDArray[np.int32], least_mm: float) -> IntArray:
    """Return which triangles are lower than so much over their longest side."""
    return np.flatnonzero(_squared_heights(points_mm, faces) < least_mm**2)


_FLIP_ROUNDS = 64
"""At most. Thin triangles nested along a line are undone from outside, one a round: a face with
many loops had 31 of them left after 8 rounds, 2 after 16, none after 64."""


@kernel
def _flip(vertices: Any, faces: Any, thin: Any, most: Any, keys: Any, half: Any) -> Any:
    """Flip once, by the sides 3f + j of faces by their keys, which rise; return how often."""
    moved = np.zeros(faces.shape[0], dtype=np.bool_)
    flips = 0
    for i in thin:
        if moved[i]:
            continue
        corner, longest = 0, -1.0
        for j in range(3):
            a, b = faces[i, j], faces[i, (j + 1) % 3]
            length = 0.0
            for k in range(3):
                length += (vertices[a, k] - vertices[b, k]) ** 2
            if length > longest:
                corner, longest = j, length
        a, b, c = faces[i, corner], faces[i, (corner + 1) % 3], faces[i, (corner + 2) % 3]
        if squared_height(vertices, a, b, c) >= most:
            continue
        place = _find(keys, b, a)
        if place < 0 or moved[half[place] // 3]:
            continue
        f, other = divmod(half[place], 3)
        d = faces[f, (other + 2) % 3]
        now = min(squared_height(vertices, a, b, c), squared_height(vertices, b, a, d))
        then = min(squared_height(vertices, c, a, d), squared_height(vertices, d, b, c))
        if (
            then > now
            and _find(keys, c, d) < 0
            and _find(keys, d, c) < 0
            and _same_side(vertices, b, a, d, c, a, d)
            and _same_side(vertices, b, a, d, d, b, c)
        ):
            faces[i, 0], faces[i, 1], faces[i, 2] = c, a, d
            faces[f, 0], faces[f, 1], faces[f, 2] = d, b, c
            moved[i] = moved[f] = True
            flips += 1
    return flips


@inner_kernel
def _same_side(vertices: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Any:
    """Tell whether the normals of triangles a-b-c and d-e-f are less than 90 degrees apart."""
    nx, ny, nz = face_normal(vertices, a, b, c)
    mx, my, mz = face_normal(vertices, d, e, f)
    return nx * mx + ny * my + nz * mz > 0.0


@inner_kernel
def _find(keys: Any, a: Any, b: Any) -> Any:
    """Find the last place of side a-b in rising keys; -1 where it is not there."""
    key = (np.int64(a) << 32) + b
    place = np.searchsorted(keys, key, side="right") - 1
    return place if place >= 0 and keys[place] == key else -1


def _first_unfilled(faces: NDArray[np.int32], segment: NDArray[np.int32], below: BoolArray) -> int:
    """Find where caps and the surface below them do not close.

    Parameters
    ----------
    faces, segment, below
        As for `_side_clashes`.

    Returns
    -------
    int
        A vertex at a side that occurs more often one way than the other; -1 if there is none.
    """
    tails, heads = np.concatenate([_sides(faces), segment[below]]).T
    order, starts = order_rows(np.minimum(tails, heads), np.maximum(tails, heads))
    way = np.where(tails < heads, 1, -1)
    odd = starts[np.add.reduceat(way[order], starts) != 0] if len(starts) else starts
    return int(min(tails[order[odd[0]]], heads[order[odd[0]]])) if len(odd) else -1


def _side_clashes(
    faces: NDArray[np.int32], segment: NDArray[np.int32], below: BoolArray
) -> NDArray[np.intp]:
    """Find inner sides of caps that the surface, or another cap triangle, has already.

    Parameters
    ----------
    faces : (m, 3) int32
        Cap triangles, facing along the normal.
    segment : (s, 2) int32
        Directed sides of surface triangles in the planes.
    below : (s,) bool
        Whether their triangle lies below the plane.

    Returns
    -------
    (r,) int
        3f + j for side j of face f: an edge of the piece below or above would have four faces.
    """
    sides = _sides(faces)
    ranked, turned = np.sort(_key(sides)), _key(sides[:, ::-1])
    inner = np.flatnonzero(ranked.take(np.searchsorted(ranked, turned), mode="clip") == turned)
    clash = np.zeros(len(sides), dtype=np.bool_)
    for surface, own in ((segment[below], sides[inner]), (segment[~below], sides[inner, ::-1])):
        both = np.concatenate([surface, own])
        order, starts = order_rows(both[:, 0].copy(), both[:, 1].copy())
        later = np.delete(order, starts) - len(surface)
        clash[inner[later[later >= 0]]] = True
    return np.flatnonzero(clash)


def _sides(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Directed sides 3f + j, (3 m, 2)."""
    return np.stack([faces, faces[:, [1, 2, 0]]], axis=2).reshape(-1, 2)


def _key(sides: NDArray[np.int32]) -> NDArray[np.int64]:
    return (sides[:, 0].astype(np.int64) << 32) + sides[:, 1]


def _split_sides(
    vertices: Float32Array, faces: NDArray[np.int32], level: NDArray[np.int32], sides: IntArray
) -> tuple[Float32Array, NDArray[np.int32], NDArray[np.int32]]:
    """Put a new vertex on each side, and divide the triangles on both sides of it.

    Parameters
    ----------
    vertices : (n, 3) float32
        Positions in mm.
    faces, level : (m, 3) int32, (m,) int32
        Cap triangles and their planes.
    sides : (r,) int
        Sides as `_side_clashes` gives them; of a face or its neighbour at most one is divided.

    Returns
    -------
    vertices, faces, level
        With the new vertices and triangles; `level` stays increasing.
    """
    pairs = list(map(tuple, _sides(faces).tolist()))
    half = {pair: side for side, pair in enumerate(pairs)}
    taken = {point.tobytes() for point in vertices}
    points = [vertices]
    children = {}
    count = len(vertices)
    for side in sides.tolist():
        a, b = pairs[side]
        (i, j), (f, k) = divmod(side, 3), divmod(half[b, a], 3)
        if i in children or f in children or i == f:
            continue
        ends = vertices[[a, b]].astype(np.float64)
        for share in (1 / 2, 1 / 4, 3 / 4, 1 / 8, 7 / 8):
            point = ends[0] * (1 - share) + ends[1] * share
            new = (np.rint(point / LATTICE_MM) * LATTICE_MM + 0.0).astype(np.float32)
            if new.tobytes() not in taken:
                break
        else:
            continue
        taken.add(new.tobytes())
        points.append(new[None])
        c, d = int(faces[i, (j + 2) % 3]), int(faces[f, (k + 2) % 3])
        children[i] = ((a, count, c), (count, b, c))
        children[f] = ((b, count, d), (count, a, d))
        count += 1
    grown = [children.get(i, (tuple(face),)) for i, face in enumerate(faces.tolist())]
    flat = np.array([face for own in grown for face in own], dtype=np.int32)
    return np.concatenate(points), flat, np.repeat(level, [len(own) for own in grown])


# ------------------------------------------------------------------------------------------------
# Close the pieces of a divided surface: one triangulation a plane, shared by both sides.


_ROUNDS = 8
"""Splitting a side at most this often; once has been enough wherever it was needed."""


def caps(
    divided: DividedSurface, normal: FloatArray
) -> tuple[Float32Array, NDArray[np.int32], NDArray[np.int32]]:
    """Triangulate every plane's cross-section between the vertices of its outline.

    A vertex is added only in the middle of a diagonal that is already an edge of the surface,
    as at a groove whose bottom lies in the plane: no edge then has four faces.

    Parameters
    ----------
    divided : DividedSurface
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
    corners, starts, loop_plane = _loops(divided, (u, v))
    order = np.argsort(loop_plane, kind="stable")
    chosen = (order, loop_plane[order], np.broadcast_to([u, v], (len(order), 2)))
    cap_faces, owner = triangulate_loops(divided.vertices, corners, starts, *chosen)
    proper = ~repeats_index(cap_faces)
    cap_faces, cap_level = cap_faces[proper], loop_plane[owner[proper]]
    flip_thin(divided.vertices, cap_faces)
    unfilled = _first_unfilled(cap_faces, divided.segment, divided.segment_below)
    if unfilled >= 0:
        place = place_text(divided.vertices[unfilled].tolist(), 6)
        raise MeshError(
            f"the cross-section near {place} cannot be divided into triangles: "
            "its outline crosses itself; repair the mesh, or move the level"
        )
    vertices = divided.vertices
    for _ in range(_ROUNDS):
        sides = _side_clashes(cap_faces, divided.segment, divided.segment_below)
        if len(sides) == 0:
            break
        vertices, cap_faces, cap_level = _split_sides(vertices, cap_faces, cap_level, sides)
    return vertices, cap_faces, cap_level


def triangulate_loops(
    points_mm: Float32Array, nodes: NDArray[np.int32], starts: NDArray[np.int32],
    chosen: NDArray[np.intp], key: NDArray[np.integer[Any]], across: NDArray[np.intp],
) -> tuple[NDArray[np.int32], NDArray[np.intp]]:  # fmt: skip
    """Triangulate what loops enclose, those of one key together.

    Parameters
    ----------
    nodes, starts
        Loop i has the points ``nodes[starts[i]:starts[i + 1]]``.
    chosen, key : (k,)
        Which loops, and the key of each, never falling, from 0 on.
    across : (k, 2)
        The axes that span the plane in which each is seen.

    Returns
    -------
    faces : (t, 3) int32
        Triangles between points.
    owner : (t,) int
        The first loop of each.
    """
    from manifold3d import triangulate

    size = np.diff(starts)[chosen]
    stops = np.cumsum(size)
    begins = stops - size
    nodes = nodes[np.arange(size.sum()) + np.repeat(starts[chosen] - begins, size)]
    flat = np.take_along_axis(points_mm[nodes], np.repeat(across, size, axis=0), axis=1)
    flat = flat.astype(np.float64)
    outlines = [flat[i:k] for i, k in zip(begins.tolist(), stops.tolist(), strict=True)]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    bounds = pairwise([*first.tolist(), len(key)])
    local = [triangulate(outlines[i:k], epsilon=LATTICE_MM) for i, k in bounds]
    count = [len(each) for each in local]
    within = np.concatenate([np.empty((0, 3), dtype=np.int64), *local])
    return nodes[within + np.repeat(begins[first], count)[:, None]], np.repeat(chosen[first], count)


def _loops(
    divided: DividedSurface, across: tuple[int, int]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Chain the sides in a plane, turned over, to loops with the material on their left.

    Sides that occur both ways cancel. Where loops touch at a vertex, a side continues with the
    first one clockwise from where it came: every corner then spans one wedge of material.

    Returns
    -------
    corners, starts, plane
        Loop i has the vertices ``corners[starts[i] : starts[i + 1]]`` and lies in ``plane[i]``.
    """
    heads, tails = divided.segment[divided.segment_below].T.tolist()
    leaving = defaultdict[int, list[int]](list)  # the sides that leave each vertex
    for side, (tail, head) in enumerate(zip(tails, heads, strict=True)):
        opposite = [other for other in leaving[head] if heads[other] == tail]
        if opposite:
            leaving[head].remove(opposite[-1])
        else:
            leaving[tail].append(side)
    corners, starts, seeds = list[int](), [0], list[int]()
    for seed, tail in enumerate(tails):
        # It stays among those that leave its vertex until the loop comes back to it.
        side, walked = seed, seed not in leaving[tail]
        while not walked:
            came, at = tails[side], heads[side]
            corners.append(came)
            onward = leaving[at][::-1]
            if not onward:
                raise MeshError(
                    f"the surface is open near {place_text(divided.vertices[at].tolist(), 6)}: the "
                    "outline of a cut ends there; repair the mesh so that every edge has two faces"
                )
            side = onward[0]
            if len(onward) > 1:
                star = divided.vertices[[at, came, *(heads[other] for other in onward)]]
                side = onward[int(np.argmin(_clockwise(star[:, across].astype(np.float64))))]
            leaving[at].remove(side)
            walked = side == seed
        if len(corners) > starts[-1]:
            starts.append(len(corners))
            seeds.append(seed)
    plane = divided.segment_plane[divided.segment_below][seeds]
    return np.array(corners, np.int32), np.array(starts, np.int32), plane


def _clockwise(star: FloatArray) -> FloatArray:
    """Measure clockwise turns at star[0] from star[1] to each other, growing with the angle.

    They lie in (0, 4].
    """
    (cu, cv), (tu, tv) = star[1] - star[0], (star[2:] - star[0]).T
    cosine, sine = cu * tu + cv * tv, cv * tu - cu * tv
    size = np.abs(cosine) + np.abs(sine)
    share = cosine / np.where(size > 0.0, size, 1.0)
    turn = np.where(sine >= 0.0, 1.0 - share, 3.0 + share)
    return np.where((turn > 0.0) & (size > 0.0), turn, 4.0)


# ------------------------------------------------------------------------------------------------
# Cut a part at levels of a field whose level sets are planes.


def cut_by_planes(
    mesh: Mesh, field: PlanarField, levels: FloatArray
) -> tuple[DividedSurface, Float32Array, NDArray[np.int32], NDArray[np.int32]]:
    """Divide a part's surface by the planes of some levels, and close the pieces; see `caps`.

    Raises
    ------
    ArgumentError
        Levels are too close to be told apart in float32.
    MeshError
        See `caps`.
    """
    normal = np.asarray(field.plane(0.0)[0], dtype=np.float64)
    offsets_mm = np.array([field.plane(level)[1] for level in levels.tolist()], dtype=np.float64)
    if np.count_nonzero(normal) == 1:  # along a coordinate axis they are float32 values
        rounded = np.rint(offsets_mm / LATTICE_MM) * LATTICE_MM
        offsets_mm = rounded.astype(np.float32).astype(np.float64)
    least_mm = 2.5 * snap_distance_mm(mesh.bounds_mm)
    close = np.flatnonzero(~(np.diff(offsets_mm) > least_mm))
    if len(close):
        i = int(close[0])
        raise ArgumentError(
            f"levels {levels[i]:.9g} and {levels[i + 1]:.9g} are "
            f"{offsets_mm[i + 1] - offsets_mm[i]:.3g} mm apart along the field: they must "
            f"increase by more than {least_mm:.3g} mm for this part; drop one of them"
        )
    divided = divide(mesh, normal, offsets_mm)
    return divided, *caps(divided, normal)
