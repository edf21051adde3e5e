"""Give equal positions one index, and take out the faces that weld to nothing."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, Float32Array, FloatArray
from planner.geometry.kernel import inner_kernel, kernel

__all__ = [
    "cancel_opposite",
    "order_rows",
    "repeats_index",
    "row_slot",
    "sorted_corners",
    "weld",
    "weld_points",
]

Points = TypeVar("Points", Float32Array, FloatArray)


def weld(triangles: Points) -> tuple[Points, NDArray[np.int32]]:
    """Index a triangle soup by exact position: corners of equal bits share a vertex.

    Minus zero counts as zero. Nothing is merged within a tolerance, no face is dropped.

    Parameters
    ----------
    triangles : (k, 3, 3) float32 or float64
        Corner positions.

    Returns
    -------
    vertices : (n, 3) array of the same type
        Distinct positions in the order of their first appearance.
    faces : (k, 3) int32
        Indices into `vertices`.
    """
    vertices, faces = weld_points(triangles.reshape(-1, 3))
    return vertices, faces.reshape(-1, 3)


def weld_points(points: Points) -> tuple[Points, NDArray[np.int32]]:
    """Index points, (k, 3), as `weld` does: distinct positions (n, 3) and an index (k,)."""
    plain = np.add(points, 0.0, order="C", dtype=points.dtype)  # no minus zero is left
    words = plain.view(np.uint32)
    distinct = np.empty_like(words)
    index = np.empty(len(words), dtype=np.int32)
    n = _weld(words, distinct, index)
    vertices: Points = distinct[:n].copy().view(points.dtype)
    return vertices, index


@kernel
def _weld(rows: Any, distinct: Any, index: Any) -> Any:
    """Find equal rows by a hash table, open-addressed, that grows when half full."""
    count, width = rows.shape
    shift = np.uint64(54)
    table = np.zeros(1024, dtype=np.int32)  # number + 1 of a distinct row; 0 where free
    n = 0
    for i in range(count):
        slot = row_slot(rows, i, shift)
        while table[slot] > 0:
            j, same = table[slot] - 1, True
            for k in range(width):
                same &= distinct[j, k] == rows[i, k]
            if same:
                break
            slot = (slot + 1) & (table.size - 1)
        if table[slot] == 0:
            for k in range(width):
                distinct[n, k] = rows[i, k]
            n += 1
            table[slot] = n
        index[i] = table[slot] - 1
        if 2 * n > table.size:
            shift -= np.uint64(2)
            table = np.zeros(4 * table.size, dtype=np.int32)
            for j in range(n):
                slot = row_slot(distinct, j, shift)
                while table[slot] > 0:
                    slot = (slot + 1) & (table.size - 1)
                table[slot] = j + 1
    return n


@inner_kernel
def row_slot(rows: Any, i: Any, shift: Any) -> Any:
    """Top bits of a product hash of a row of uint32: low bits of round coordinates are all zero."""
    mixed = np.uint64(0)
    for k in range(rows.shape[1]):
        mixed = (mixed ^ np.uint64(rows[i, k])) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= mixed >> np.uint64(32)
    mixed *= np.uint64(0xD6E8FEB86659FD93)
    return np.int64(mixed >> shift)


def repeats_index(faces: NDArray[np.int32]) -> BoolArray:
    """Tell which faces, (m, 3), name a vertex twice."""
    a, b, c = faces.T
    return np.asarray((a == b) | (b == c) | (c == a))


def cancel_opposite(faces: NDArray[np.int32]) -> BoolArray:
    """Tell which faces stay when faces on the same three vertices but turned over cancel.

    Of a triple with p faces one way and q the other, the first |p - q| of the more frequent
    way stay. The boundary of the surface does not change.

    Parameters
    ----------
    faces : (m, 3) int32
        Faces without repeated index.

    Returns
    -------
    (m,) bool
        True where a face stays.
    """
    keep = np.ones(len(faces), dtype=np.bool_)
    order, starts = order_rows(*sorted_corners(faces))
    count = np.diff(starts, append=len(order))
    if not (count > 1).any():
        return keep
    a, b, c = faces[order].T
    way = np.where((a < b) ^ (b < c) ^ (c < a), -1, 1)
    net = np.repeat(np.add.reduceat(way, starts), count)
    frequent = way * net > 0
    rank = np.cumsum(frequent)
    rank -= np.repeat(rank[starts] - frequent[starts], count)
    keep[order] = frequent & (rank <= np.abs(net))
    return keep


def sorted_corners(
    faces: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Lowest, middle and highest vertex of each face: the same for faces on the same three."""
    a, b, c = faces.T
    low, high = np.minimum(a, b), np.maximum(a, b)
    return np.minimum(low, c), np.maximum(low, np.minimum(high, c)), np.maximum(high, c)


def order_rows(*columns: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Sort rows of small numbers, stably, so that equal ones become neighbours.

    Parameters
    ----------
    *columns : (m,) int32
        Numbers from 0 on, such as indices of vertices; the first column counts most.

    Returns
    -------
    order : (m,) int32
        Indices of the rows.
    starts : (g,) int64
        Where in `order` each group of equal rows begins.
    """
    order = np.arange(len(columns[0]), dtype=np.int32)
    for column in columns[::-1]:
        moved = np.empty_like(order)
        place = np.zeros(int(column.max(initial=-1)) + 2, dtype=np.int32)
        _count_into(column, order, place, moved)
        order = moved
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = False
    for column in columns:
        ranked = column[order]
        first[1:] |= ranked[1:] != ranked[:-1]
    return order, np.flatnonzero(first)


@kernel
def _count_into(key: Any, order: Any, place: Any, moved: Any) -> None:
    """Sort `order` stably by key[order] into `moved`: one digit of a radix sort."""
    for i in range(key.size):
        place[key[i] + 1] += 1
    for i in range(place.size - 1):
        place[i + 1] += place[i]
    for i in range(order.size):
        k = key[order[i]]
        moved[place[k]] = order[i]
        place[k] += 1
