"""A surface with its long edges halved, conforming."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, Int32Array, IntArray

__all__ = ["halve_long_edges"]


# How often an edge is halved is told by its length alone, so that the triangles on both its sides
# agree and a closed surface stays closed. A triangle with three edges to halve makes four of its
# own shape. One with a short edge, as the long thin ones of CAD are, is cut across into a
# triangle and a strip, and the strip across again: to bisect its sides one by one would make 3^k
# triangles of it, where 2^k do.


class _Shapes(NamedTuple):
    """Triangles (n, 3), or strips (n, 4) whose second and fourth edge are long."""

    corners: Int32Array
    halvings: IntArray  # of the edge from each corner to the next
    parent: IntArray  # the triangle that each is of

    def turned(self, chosen: BoolArray, first: IntArray) -> "_Shapes":
        """Return some, begun at another corner."""
        turn = (first[chosen, None] + np.arange(self.corners.shape[1])) % self.corners.shape[1]
        corners = np.take_along_axis(self.corners[chosen], turn, axis=1)
        halvings = np.take_along_axis(self.halvings[chosen], turn, axis=1)
        return _Shapes(corners, halvings, self.parent[chosen])


def halve_long_edges(mesh: Mesh, longest_mm: float) -> tuple[Mesh, Int32Array]:
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
    return mesh if len(faces) == len(mesh.faces) else Mesh(vertices, faces), triangle


def _halve(vertices: FloatArray, whole: _Shapes) -> tuple[FloatArray, Int32Array, IntArray]:
    none = np.empty((0, 4), np.int32)
    both = (whole, _Shapes(none, none, none[:, 0]))
    while (marked := np.concatenate([shapes.halvings.ravel() for shapes in both]) > 0).any():
        tails, heads = (
            np.concatenate([np.roll(shapes.corners, -step, axis=1).ravel() for shapes in both])
            for step in (0, 1)
        )
        ends = np.sort(np.stack([tails, heads], axis=1)[marked].astype(np.int64), axis=1)
        edges, at = np.unique(ends @ [len(vertices), 1], return_inverse=True)
        middle = np.full(len(marked), -1, np.int32)
        middle[marked] = len(vertices) + at
        pairs = np.stack(np.divmod(edges, len(vertices)), axis=1)
        vertices = np.concatenate([vertices, vertices[pairs].mean(axis=1)])
        both = _cut(both, np.split(middle, [both[0].corners.size]))
    triangles, strips = both
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


_CHILDREN: Mapping[int, Mapping[int, Sequence[tuple[Sequence[int], Sequence[int]]]]] = {
    3: {
        3: (((0, 3, 5), (1, 2, 3)), ((3, 1, 4), (1, 2, 3)), ((5, 4, 2), (1, 2, 3)),
            ((4, 5, 3), (1, 2, 3))),
        2: (((5, 4, 2), (0, 2, 3)), ((0, 1, 4, 5), (0, 2, 0, 3))),
        1: (((0, 3, 2), (1, 0, 0)), ((3, 1, 2), (1, 0, 0))),
    },
    4: {
        2: (((0, 1, 5, 7), (0, 2, 0, 4)), ((7, 5, 2, 3), (0, 2, 0, 4))),
        1: (((0, 4, 3), (1, 0, 0)), ((4, 2, 3), (0, 0, 0)), ((4, 1, 2), (1, 0, 0))),
    },
}  # fmt: skip
"""What a triangle or a strip is cut into, by how many of its edges are to be halved: of each piece
the corners, those of the whole and then the middles of its edges, and the edge of the whole, from 1
on, whose halvings less one each of its edges has left; 0 for none. The whole begins with the one
edge to be halved, or with the first one that is not."""


def _cut(both: Sequence[_Shapes], middle: Sequence[Int32Array]) -> tuple[_Shapes, _Shapes]:
    # Cut each shape once, at the middles of its edges that are to be halved (-1 elsewhere).
    made: dict[int, list[_Shapes]] = {3: [], 4: []}
    for whole, flat in zip(both, middle, strict=True):
        at = flat.reshape(-1, whole.corners.shape[1])
        sides, halved = at.shape[1], at >= 0
        count = np.count_nonzero(halved, axis=1)
        made[sides].append(whole.turned(count == 0, 0 * count))
        for number, children in _CHILDREN[sides].items():
            first = np.argmax(halved, axis=1) if number == 1 else np.argmin(halved, axis=1)
            some = whole.turned(count == number, first)
            middles = whole._replace(corners=at).turned(count == number, first).corners
            corners = np.concatenate([some.corners, middles], axis=1)
            left = np.pad(some.halvings - 1, ((0, 0), (1, 0)))
            for own, edges in children:
                made[len(own)].append(_Shapes(corners[:, own], left[:, edges], some.parent))
    return _joined(made[3]), _joined(made[4])


def _joined(shapes: list[_Shapes]) -> _Shapes:
    return _Shapes(*(np.concatenate(parts) for parts in zip(*shapes, strict=True)))
