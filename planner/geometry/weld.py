"""Give equal positions one index, and take out the faces that weld to nothing."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, Float32Array, FloatArray
from planner.geometry.kernel import kernel

__all__ = [
    "cancel_opposite",
    "counting_order",
    "position_slot",
    "repeats_index",
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
    bits = np.uint32 if points.dtype == np.float32 else np.uint64
    vertices, index = _weld(
        np.require(points, requirements=["C", "W"]).view(bits),
        bits(1 << (8 * points.dtype.itemsize - 1)),
    )
    return vertices.view(points.dtype), index


@kernel
def _weld(corners: Any, minus_zero: Any) -> Any:
    """Hash the bit patterns into an open-addressed table that doubles when half full."""
    count = corners.shape[0]
    index = np.empty(count, dtype=np.int32)
    vertices = np.empty((max(count, 1), 3), dtype=corners.dtype)
    shift = np.uint64(54)
    table = np.full(1024, -1, dtype=np.int32)
    n = 0
    for i in range(count):
        x, y, z = corners[i, 0], corners[i, 1], corners[i, 2]
        x = x if x != minus_zero else x ^ x
        y = y if y != minus_zero else y ^ y
        z = z if z != minus_zero else z ^ z
        slot = position_slot(x, y, z, shift)
        while True:
            j = table[slot]
            if j < 0:
                vertices[n, 0], vertices[n, 1], vertices[n, 2] = x, y, z
                table[slot] = n
                j = n
                n += 1
                break
            if vertices[j, 0] == x and vertices[j, 1] == y and vertices[j, 2] == z:
                break
            slot = (slot + 1) & (table.size - 1)
        index[i] = j
        if 2 * n > table.size:
            shift -= np.uint64(2)
            table = np.full(4 * table.size, -1, dtype=np.int32)
            for k in range(n):
                slot = position_slot(vertices[k, 0], vertices[k, 1], vertices[k, 2], shift)
                while table[slot] >= 0:
                    slot = (slot + 1) & (table.size - 1)
                table[slot] = k
    return vertices[:n].copy(), index


@kernel
def position_slot(x: Any, y: Any, z: Any, shift: Any) -> Any:
    """Top bits of a product hash: low bits of round coordinates are all zero."""
    mixed = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= np.uint64(y) * np.uint64(0xC2B2AE3D27D4EB4F)
    mixed ^= np.uint64(z) * np.uint64(0x165667B19E3779F9)
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
    keep: BoolArray = _cancel(faces, int(faces.max(initial=-1)) + 1)
    return keep


@kernel
def _cancel(faces: Any, n: Any) -> Any:
    m = faces.shape[0]
    key = np.empty((3, m), dtype=np.int32)
    way = np.empty(m, dtype=np.int8)
    for i in range(m):
        a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
        low, high = min(a, b, c), max(a, b, c)
        key[0, i], key[1, i], key[2, i] = high, a ^ b ^ c ^ low ^ high, low
        way[i] = 1 if (a < b) + (b < c) + (c < a) == 2 else -1
    keep = np.ones(m, dtype=np.bool_)
    order = np.arange(m).astype(np.int32)
    for digit in range(3):
        order = counting_order(key[digit], order, n)
    start = 0
    while start < m:
        i = order[start]
        end, net = start, 0
        while end < m:
            j = order[end]
            if key[0, i] != key[0, j] or key[1, i] != key[1, j] or key[2, i] != key[2, j]:
                break
            net += way[j]
            end += 1
        if abs(net) != end - start:
            for k in range(start, end):
                j = order[k]
                if net * way[j] > 0:
                    net -= way[j]
                else:
                    keep[j] = False
        start = end
    return keep


@kernel
def counting_order(key: Any, order: Any, size: Any) -> Any:
    """Sort `order` stably by key[order], keys in 0..size-1: one digit of a radix sort."""
    place = np.zeros(size + 1, dtype=np.int32)
    for i in range(order.size):
        place[key[order[i]] + 1] += 1
    for i in range(size):
        place[i + 1] += place[i]
    moved = np.empty_like(order)
    for i in range(order.size):
        k = key[order[i]]
        moved[place[k]] = order[i]
        place[k] += 1
    return moved
