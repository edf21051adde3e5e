"""A surface with its long edges halved, conforming."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, IntArray

__all__ = ["halve_long_edges"]


# How often an edge is halved is told by its length alone, so that the triangles on both its sides
# agree and a closed surface stays closed. A triangle with three edges to halve makes four of its
# own shape. One with a short edge, as the long thin ones of CAD are, is cut across into a
# triangle and a strip, and the strip across again: to bisect its sides one by one would make 3^k
# triangles of it, where 2^k do.


class _Shapes(NamedTuple):
    """Triangles (n, 3), or strips (n, 4) whose second and fourth edge are long."""

    corners: NDArray[np.int32]
    halvings: IntArray  # of the edge from each corner to the next
    parent: IntArray  # the triangle that each is of

    def turned(self, chosen: BoolArray, first: IntArray) -> "_Shapes":
        """Return some, begun at another corner."""
        turn = (first[chosen, None] + np.arange(self.corners.shape[1])) % self.corners.shape[1]
        return _Shapes(
            np.take_along_axis(self.corners[chosen], turn, axis=1),
            np.take_along_axis(self.halvings[chosen], turn, axis=1),
            self.parent[chosen],
        )


def halve_long_edges(mesh: Mesh, longest_mm: float) -> tuple[Mesh, NDArray[np.int32]]:
    """Halve edges of a surface until none is longer than so much.

    A closed surface stays closed. Also returned: which triangle of the mesh each new one is of.
    """
    vertices, faces = mesh.vertices, mesh.faces
    triangle = np.arange(len(faces), dtype=np.int32)
    while True:
        corners = vertices[faces]
        length = np.sqrt(np.sum((np.roll(corners, -1, axis=1) - corners) ** 2, axis=2))
        if not (length > longest_mm).any():
            break
        with np.errstate(divide="ignore"):
            halvings = np.ceil(np.maximum(np.log2(length / longest_mm), 0.0)).astype(np.int64)
        halvings[length > longest_mm] = np.maximum(halvings[length > longest_mm], 1)
        vertices, faces, parent = _halve(vertices, _Shapes(faces, halvings, triangle))
        triangle = parent.astype(np.int32)
    if len(faces) == len(mesh.faces):
        return mesh, triangle
    return Mesh(vertices, faces), triangle


def _halve(vertices: FloatArray, whole: _Shapes) -> tuple[FloatArray, NDArray[np.int32], IntArray]:
    none = np.empty((0, 4), np.int32)
    triangles, strips = whole, _Shapes(none, none, none[:, 0])
    while triangles.halvings.any() or strips.halvings.any():
        tails, heads = (
            np.concatenate([np.roll(shapes.corners, -step, axis=1).ravel() for shapes in both])
            for both, step in (((triangles, strips), 0), ((triangles, strips), 1))
        )
        marked = np.concatenate([triangles.halvings.ravel(), strips.halvings.ravel()]) > 0
        ends = np.sort(np.stack([tails, heads], axis=1)[marked].astype(np.int64), axis=1)
        edges, at = np.unique(ends @ [len(vertices), 1], return_inverse=True)
        middle = np.full(len(marked), -1, np.int32)
        middle[marked] = len(vertices) + at
        pairs = np.stack(np.divmod(edges, len(vertices)), axis=1)
        vertices = np.concatenate([vertices, vertices[pairs].mean(axis=1)])
        split = triangles.corners.size
        triangles, strips = _cut(
            triangles, middle[:split].reshape(-1, 3), strips, middle[split:].reshape(-1, 4)
        )
    a, b, c, d = strips.corners.T
    one = np.sum((vertices[a] - vertices[c]) ** 2, axis=1)
    near = (one <= np.sum((vertices[b] - vertices[d]) ** 2, axis=1))[:, None]
    halves = (
        np.where(near, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1)),
        np.where(near, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1)),
    )
    faces = np.concatenate([triangles.corners, *halves]).astype(np.int32)
    parent = np.concatenate([triangles.parent, strips.parent, strips.parent])
    order = np.argsort(parent, kind="stable")
    return vertices, faces[order], parent[order]


def _cut(
    triangles: _Shapes,
    middle: NDArray[np.int32],
    strips: _Shapes,
    strip_middle: NDArray[np.int32],
) -> tuple[_Shapes, _Shapes]:
    # Cut each shape once, at the middles of its edges that are to be halved (-1 elsewhere).
    count = np.count_nonzero(middle >= 0, axis=1)
    made = [triangles.turned(count == 0, count)]
    made_strips: list[_Shapes] = []

    def add(of: _Shapes, corners: tuple[IntArray, ...], halvings: tuple[Any, ...]) -> None:
        into = made if len(corners) == 3 else made_strips
        left = [np.broadcast_to(k, of.parent.shape) for k in halvings]
        into.append(_Shapes(np.stack(corners, axis=1), np.stack(left, axis=1), of.parent))

    def begun(of: _Shapes, at: NDArray[np.int32], chosen: BoolArray, first: IntArray) -> Any:
        shapes, middles = of.turned(chosen, first), of._replace(corners=at).turned(chosen, first)
        return shapes, shapes.corners.T, shapes.halvings.T - 1, middles.corners.T

    some, (a, b, c), (k, m, n), (ab, bc, ca) = begun(triangles, middle, count == 3, 0 * count)
    add(some, (a, ab, ca), (k, m, n))
    add(some, (ab, b, bc), (k, m, n))
    add(some, (ca, bc, c), (k, m, n))
    add(some, (bc, ca, ab), (k, m, n))
    short = np.argmin(middle >= 0, axis=1)
    some, (a, b, c), (_, m, n), (_, bc, ca) = begun(triangles, middle, count == 2, short)
    add(some, (ca, bc, c), (0, m, n))
    add(some, (a, b, bc, ca), (0, m, 0, n))
    long = np.argmax(middle >= 0, axis=1)
    some, (a, b, c), (k, _, _), (ab, _, _) = begun(triangles, middle, count == 1, long)
    add(some, (a, ab, c), (k, 0, 0))
    add(some, (ab, b, c), (k, 0, 0))

    count = np.count_nonzero(strip_middle >= 0, axis=1)
    made_strips.append(strips.turned(count == 0, count))
    some, (a, b, c, d), (_, m, _, n), (_, bc, _, da) = begun(
        strips, strip_middle, count == 2, 0 * count
    )
    add(some, (a, b, bc, da), (0, m, 0, n))
    add(some, (da, bc, c, d), (0, m, 0, n))
    long = np.argmax(strip_middle >= 0, axis=1)
    some, (a, b, c, d), (k, _, _, _), (ab, _, _, _) = begun(strips, strip_middle, count == 1, long)
    add(some, (a, ab, d), (k, 0, 0))
    add(some, (ab, c, d), (0, 0, 0))
    add(some, (ab, b, c), (k, 0, 0))
    return _joined(made), _joined(made_strips)


def _joined(shapes: list[_Shapes]) -> _Shapes:
    return _Shapes(*(np.concatenate(parts) for parts in zip(*shapes, strict=True)))
