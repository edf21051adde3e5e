"""Distances from a surface to its nearest triangle, and which side faces a point."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.mesh.mesh import Mesh, order_edges
from planner.numerics import FloatArray, IntArray, inner_kernel, kernel

__all__ = ["TriangleTree", "triangle_tree"]


# ------------------------------------------------------------------------------------------------
# A tree of boxes over triangles, to find the nearest one.


_LEAF = 2


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Triangles, halved again and again into small boxes: a complete binary tree of these.

    Attributes
    ----------
    corners : (k, 3, 3) float64
        Positions in mm; the mesh's last is repeated to fill the leaves.
    outward : (k, 7, 3) float64
        What tells outside at the face, its three vertices, and its three edges from corner j to
        the next (angle-weighted pseudonormals, Baerentzen and Aanaes 2005).
    box : (nodes, 2, 3) float64
        Node i has the children 2 i + 1 and 2 i + 2.
    order : (k,)
        Number of each triangle in its mesh.
    """

    corners: FloatArray
    outward: FloatArray
    box: FloatArray
    order: IntArray

    def distances(self, points_mm: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return how far points (n, 3) are from the nearest triangle, and whether it faces them.

        Exact up to rounding. A point faces a closed surface where it lies outside.
        """
        distance, faced, _, _ = _all_nearest(self, points_mm)
        return distance, faced

    def closest(self, points_mm: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return the place of the triangles nearest to points (n, 3), and whose it is, (n,)."""
        _, _, place, which = _all_nearest(self, points_mm)
        return place, self.order[which]

    def moved_within(self, points_mm: FloatArray, depth_mm: float) -> FloatArray:
        """Return points (n, 3), those outside a closed surface, or hardly below, moved below it."""
        distance, faced, place, which = _all_nearest(self, points_mm)
        inwards = self.corners[which].mean(axis=1) - place  # off the face's own edges, too
        inwards /= np.maximum(np.linalg.norm(inwards, axis=1, keepdims=True), 1e-300)
        below = place + depth_mm * (inwards - self.outward[which, 0])
        return np.where((faced | (distance < depth_mm))[:, None], below, points_mm)


def triangle_tree(mesh: Mesh) -> TriangleTree:
    """Build the tree of a mesh, or of some of its faces."""
    corners = mesh.triangles
    order = _in_small_boxes(corners)
    leaves = len(order) // _LEAF
    ranked = corners[order]
    held = ranked.reshape(leaves, _LEAF * 3, 3)
    level = np.stack([held.min(axis=1), held.max(axis=1)], axis=1)
    boxes = [level]
    while len(level) > 1:
        pairs = level.reshape(-1, 2, 2, 3)
        level = np.stack([pairs[:, :, 0].min(axis=1), pairs[:, :, 1].max(axis=1)], axis=1)
        boxes.append(level)
    outward = np.ascontiguousarray(_outward(mesh)[order])
    return TriangleTree(np.ascontiguousarray(ranked), outward, np.concatenate(boxes[::-1]), order)


def _in_small_boxes(corners: FloatArray) -> IntArray:
    """Return triangles such that halves of them, quarters and so on have boxes of little area.

    Which a line or a ball hits as rarely as can be (MacDonald and Booth 1990). Parts are halved at
    their median along the axis that leaves the least.
    """
    count = max(_LEAF, 1 << (len(corners) - 1).bit_length())
    triangle = np.append(np.arange(len(corners)), np.full(count - len(corners), len(corners) - 1))
    sides = [(each.min(axis=0)[triangle], each.max(axis=0)[triangle]) for each in corners.T]
    middle = corners.mean(axis=1)[triangle]
    along = np.argsort(middle.T, axis=1, kind="stable")[:, None]  # by each axis, in each part
    while along.shape[2] > _LEAF:
        _, parts, size = along.shape
        half = along.reshape(3, parts, 2, -1)
        x, y, z = (high[half].max(axis=3) - low[half].min(axis=3) for low, high in sides)
        area = (x * y + y * z + z * x).sum(axis=2)
        least = along[np.argmin(area, axis=0), np.arange(parts)]
        upper = np.empty(count, dtype=np.bool_)
        upper[least] = np.arange(size) >= size // 2
        ranks = np.argsort(upper[along], axis=2, kind="stable")
        along = np.take_along_axis(along, ranks, axis=2).reshape(3, 2 * parts, -1)
    return np.asarray(triangle[along[0].ravel()])


def _outward(mesh: Mesh) -> FloatArray:
    """Return what tells outside at each face, its vertices and its edges, (m, 7, 3)."""
    corners, faces, normal = mesh.triangles, mesh.faces, mesh.normals
    at_vertex = np.zeros((len(mesh.vertices), 3))
    for j in range(3):
        u = corners[:, (j + 1) % 3] - corners[:, j]
        v = corners[:, (j + 2) % 3] - corners[:, j]
        sine = np.linalg.norm(np.cross(u, v), axis=1)
        angle = np.arctan2(sine, (u * v).sum(axis=1))
        for axis in range(3):
            at_vertex[:, axis] += np.bincount(
                faces[:, j], weights=angle * normal[:, axis], minlength=len(at_vertex)
            )
    order, starts, count = order_edges(faces)
    total = np.add.reduceat(normal[order // 3], starts, axis=0)
    at_edge = np.empty((faces.size, 3))
    at_edge[order] = np.repeat(total, count, axis=0)
    return np.concatenate([normal[:, None], at_vertex[faces], at_edge.reshape(-1, 3, 3)], axis=1)


def _all_nearest(
    tree: TriangleTree, points_mm: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray, IntArray]:
    points = np.require(points_mm, np.float64, ["C", "W", "E"])
    distance, place = np.empty(len(points)), np.empty((len(points), 3))
    faced, which = np.empty(len(points), dtype=np.bool_), np.empty(len(points), dtype=np.int64)
    _nearest(
        tree.corners, tree.outward, tree.box, points, distance, faced, place, which,
        np.empty(128, dtype=np.int64), np.empty(128), np.empty(3), np.empty((2, 3)),
    )  # fmt: skip
    return distance, faced, place, which


@kernel
def _nearest(
    corners: Any, outward: Any, box: Any, points: Any, distance: Any, faced: Any, place: Any,
    which: Any, stack: Any, reach: Any, at: Any, closest: Any,
) -> None:  # fmt: skip
    # closest[0]: nearest point of the triangle last looked at; closest[1]: of all.
    first_leaf = box.shape[0] // 2
    last: Any = np.int64(0)  # of one type, or `_to_triangle` is compiled twice
    for p in range(points.shape[0]):
        for d in range(3):
            at[d] = points[p, d]
        best, feature = _to_triangle(corners, last, at, closest)
        for d in range(3):
            closest[1, d] = closest[0, d]
        stack[0], reach[0], size = 0, 0.0, 1
        while size > 0:
            size -= 1
            node = stack[size]
            if reach[size] >= best:
                continue
            # Down the nearer side, leaving the farther one for later.
            while node < first_leaf:
                near, far = 2 * node + 1, 2 * node + 2
                off, other = _to_box(box, near, at), _to_box(box, far, at)
                if other < off:
                    near, far, off, other = far, near, other, off
                if other < best:
                    stack[size], reach[size] = far, other
                    size += 1
                if off >= best:
                    break
                node = near
            else:
                leaf = node - first_leaf
                for t in range(leaf * _LEAF, leaf * _LEAF + _LEAF):
                    square, kind = _to_triangle(corners, t, at, closest)
                    if square < best:
                        best, feature, last = square, kind, t
                        for d in range(3):
                            closest[1, d] = closest[0, d]
        distance[p] = np.sqrt(best)
        which[p] = last
        dot = 0.0
        for d in range(3):
            place[p, d] = closest[1, d]
            dot += (at[d] - closest[1, d]) * outward[last, feature, d]
        faced[p] = dot >= 0.0


@inner_kernel
def _to_box(box: Any, node: Any, at: Any) -> Any:
    square = 0.0
    for d in range(3):
        off = max(box[node, 0, d] - at[d], at[d] - box[node, 1, d])
        if off > 0.0:
            square += off * off
    return square


@inner_kernel
def _to_triangle(corners: Any, t: Any, at: Any, closest: Any) -> Any:
    """Square of the distance to a triangle, and where: 0 face, 1 to 3 vertex, 4 to 6 edge.

    By the Voronoi regions of corners, edges and face (Ericson 2004, Real-Time Collision Detection,
    5.1.5).
    """
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for d in range(3):
        ab, ac = corners[t, 1, d] - corners[t, 0, d], corners[t, 2, d] - corners[t, 0, d]
        d1 += ab * (at[d] - corners[t, 0, d])
        d2 += ac * (at[d] - corners[t, 0, d])
        d3 += ab * (at[d] - corners[t, 1, d])
        d4 += ac * (at[d] - corners[t, 1, d])
        d5 += ab * (at[d] - corners[t, 2, d])
        d6 += ac * (at[d] - corners[t, 2, d])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v = w = 0.0
    kind = 0
    if d1 <= 0.0 and d2 <= 0.0:
        kind = 1
    elif d3 >= 0.0 and d4 <= d3:
        v, kind = 1.0, 2
    elif d6 >= 0.0 and d5 <= d6:
        w, kind = 1.0, 3
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0 and d1 > d3:
        v, kind = d1 / (d1 - d3), 4
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0 and d4 - d3 + (d5 - d6) > 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v, kind = 1.0 - w, 5
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0 and d2 > d6:
        w, kind = d2 / (d2 - d6), 6
    elif va + vb + vc > 0.0:
        total = va + vb + vc
        v, w = vb / total, vc / total
    square = 0.0
    for d in range(3):
        a = corners[t, 0, d]
        closest[0, d] = a + v * (corners[t, 1, d] - a) + w * (corners[t, 2, d] - a)
        square += (at[d] - closest[0, d]) ** 2
    return square, kind
