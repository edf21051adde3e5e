"""Mend a planar triangulation: thin triangles, and sides that the surface already has."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, Float32Array
from planner.geometry.cut import LATTICE_MM, squared_height
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.weld import order_rows

__all__ = ["first_unfilled", "flip_thin", "side_clashes", "split_sides"]

THIN_MM = LATTICE_MM / 4
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
    a, b, c = vertices[faces].transpose(1, 0, 2).astype(np.float64)
    u, v = b - a, c - a
    square = np.maximum((u * u).sum(axis=1), (v * v).sum(axis=1))
    square = np.maximum(square, ((v - u) ** 2).sum(axis=1))
    doubled = (np.cross(u, v) ** 2).sum(axis=1)
    thin = np.flatnonzero(doubled < THIN_MM**2 * np.where(square > 0.0, square, 1.0))
    if len(thin):
        _flip(vertices, faces, thin, np.inf if flat else THIN_MM**2)


@kernel
def _flip(vertices: Any, faces: Any, thin: Any, most: Any) -> Any:
    for _ in range(8):
        table, half = _half_edges(faces)
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
                    length += (np.float64(vertices[a, k]) - vertices[b, k]) ** 2
                if length > longest:
                    corner, longest = j, length
            a, b, c = faces[i, corner], faces[i, (corner + 1) % 3], faces[i, (corner + 2) % 3]
            if squared_height(vertices, a, b, c) >= most:
                continue
            other = half[_find(table, b, a)]
            if other < 0 or moved[other // 3]:
                continue
            f = other // 3
            d = faces[f, (other % 3 + 2) % 3]
            now = min(squared_height(vertices, a, b, c), squared_height(vertices, b, a, d))
            then = min(squared_height(vertices, c, a, d), squared_height(vertices, d, b, c))
            if (
                then > now
                and half[_find(table, c, d)] < 0
                and half[_find(table, d, c)] < 0
                and _same_side(vertices, b, a, d, c, a, d)
                and _same_side(vertices, b, a, d, d, b, c)
            ):
                faces[i, 0], faces[i, 1], faces[i, 2] = c, a, d
                faces[f, 0], faces[f, 1], faces[f, 2] = d, b, c
                moved[i] = moved[f] = True
                flips += 1
        if flips == 0:
            break


@inner_kernel
def _same_side(vertices: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Any:
    """Tell whether the normals of triangles a-b-c and d-e-f are less than 90 degrees apart."""
    dot = 0.0
    for i in range(3):
        dot += _normal(vertices, a, b, c, i) * _normal(vertices, d, e, f, i)
    return dot > 0.0


@inner_kernel
def _normal(vertices: Any, a: Any, b: Any, c: Any, i: Any) -> Any:
    j, k = (i + 1) % 3, (i + 2) % 3
    uj = np.float64(vertices[b, j]) - vertices[a, j]
    uk = np.float64(vertices[b, k]) - vertices[a, k]
    vj = np.float64(vertices[c, j]) - vertices[a, j]
    vk = np.float64(vertices[c, k]) - vertices[a, k]
    return uj * vk - uk * vj


@inner_kernel
def _half_edges(faces: Any) -> Any:
    """Hash the directed sides: face 3f + j where a slot is taken, -1 where it is free."""
    size = 16
    while size < 6 * faces.shape[0]:
        size *= 2
    table = np.zeros(size, dtype=np.int64)
    half = np.full(size, -1, dtype=np.int32)
    for i in range(faces.shape[0]):
        for j in range(3):
            a, b = faces[i, j], faces[i, (j + 1) % 3]
            slot = _find(table, a, b)
            table[slot] = (np.int64(a) << 32) + b + 1
            half[slot] = 3 * i + j
    return table, half


@inner_kernel
def _find(table: Any, a: Any, b: Any) -> Any:
    """Find the slot of side a-b, or the free one where it would go; free slots hold 0."""
    key = (np.int64(a) << 32) + b + 1
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    slot = np.int64((mixed ^ (mixed >> np.uint64(29))) & np.uint64(table.size - 1))
    while table[slot] != 0 and table[slot] != key:
        slot = (slot + 1) & (table.size - 1)
    return slot


def first_unfilled(faces: NDArray[np.int32], segment: NDArray[np.int32], below: BoolArray) -> int:
    """Find where caps and the surface below them do not close.

    Parameters
    ----------
    faces, segment, below
        As for `side_clashes`.

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


def side_clashes(
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
    inner = np.flatnonzero(np.isin(_key(sides[:, ::-1]), _key(sides)))
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


def split_sides(
    vertices: Float32Array,
    faces: NDArray[np.int32],
    level: NDArray[np.int32],
    sides: NDArray[np.intp],
) -> tuple[Float32Array, NDArray[np.int32], NDArray[np.int32]]:
    """Put a new vertex on each side, and divide the triangles on both sides of it.

    Parameters
    ----------
    vertices : (n, 3) float32
        Positions in mm.
    faces, level : (m, 3) int32, (m,) int32
        Cap triangles and their planes.
    sides : (r,) int
        Sides as `side_clashes` gives them; of a face or its neighbour at most one is divided.

    Returns
    -------
    vertices, faces, level
        With the new vertices and triangles; `level` stays increasing.
    """
    half = {
        (int(a), int(b)): (i, j)
        for i, face in enumerate(faces)
        for j, (a, b) in enumerate(zip(face, np.roll(face, -1), strict=True))
    }
    taken = {point.tobytes() for point in vertices}
    points = [vertices]
    children = {}
    count = len(vertices)
    for side in sides.tolist():
        i, j = divmod(side, 3)
        a, b = int(faces[i, j]), int(faces[i, (j + 1) % 3])
        f, k = half[b, a]
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
    divided = [i for i in range(len(faces)) for _ in range(2 if i in children else 1)]
    grown = faces[divided]
    second = False
    for row, i in enumerate(divided):
        if i in children:
            grown[row] = children[i][second]
            second = not second
    return np.concatenate(points), grown, level[divided]
