"""Which faces meet at which edges: neighbours, borders, bodies."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray
from planner.geometry.kernel import kernel
from planner.geometry.weld import order_rows

__all__ = [
    "CROWDED",
    "OPEN",
    "EdgeOrder",
    "Topology",
    "connected",
    "consistent_winding",
    "order_edges",
]

OPEN, CROWDED = -1, -2
"""In `Topology.twin`: no other face at this edge, or more than one."""


class EdgeOrder(NamedTuple):
    """Half-edges sorted by the edge they lie at.

    Attributes
    ----------
    order : (3 m,) int32
        Half-edges; those at one edge, either way, are neighbours and rise.
    starts, faces : (e,) int64
        Where in `order` each edge's half-edges begin, and how many there are.
    """

    order: NDArray[np.int32]
    starts: NDArray[np.int64]
    faces: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Topology:
    """Neighbourhood of the faces of a welded mesh.

    Half-edge 3 f + j runs from vertex j of face f to the next.

    Attributes
    ----------
    faces : (m, 3) int32
        Faces without repeated index.
    """

    faces: NDArray[np.int32]

    @cached_property
    def _around(self) -> EdgeOrder:
        """The half-edges, those at one edge next to each other."""
        return order_edges(self.faces)

    @cached_property
    def _paired(self) -> tuple[NDArray[np.int32], int]:
        order, starts, count = self._around
        twin = np.full(self.faces.size, OPEN, dtype=np.int32)
        twin[order[np.repeat(count > 2, count)]] = CROWDED
        pairs = starts[count == 2]
        one, other = order[pairs], order[pairs + 1]
        twin[one], twin[other] = other, one
        tail = self.faces.ravel()
        return twin, int(np.count_nonzero(tail[one] == tail[other]))

    @property
    def twin(self) -> NDArray[np.int32]:
        """The other half-edge at each half-edge's edge, (3 m,), or `OPEN` or `CROWDED`."""
        return self._paired[0]

    @property
    def same_way(self) -> int:
        """Edges whose two faces run the same way: one of the two is turned over."""
        return self._paired[1]

    @cached_property
    def two_faced(self) -> bool:
        """Whether every edge has exactly two faces."""
        return len(self.faces) > 0 and int(self.twin.min()) >= 0

    @property
    def closed(self) -> bool:
        """Whether every directed edge occurs once, and so does its reverse."""
        return self.two_faced and self.same_way == 0

    @cached_property
    def body(self) -> NDArray[np.int32]:
        """Number of the body each face belongs to, (m,), by first appearance.

        Faces are of one body when steps over edges of exactly two faces connect them.
        """
        half = np.flatnonzero(self.twin >= 0)
        return connected(len(self.faces), half // 3, self.twin[half] // 3)

    @property
    def bodies(self) -> int:
        """How many bodies there are."""
        return int(self.body.max(initial=-1)) + 1

    def edges(self, kind: int) -> NDArray[np.int32]:
        """Return the vertices (k, 2) of the half-edges that are `OPEN` or `CROWDED`."""
        half = np.flatnonzero(self.twin == kind)
        face, corner = np.divmod(half, 3)
        return np.stack([self.faces[face, corner], self.faces[face, (corner + 1) % 3]], axis=1)


def order_edges(faces: NDArray[np.int32]) -> EdgeOrder:
    """Sort half-edges 3 f + j by the two vertices they join; see `EdgeOrder`."""
    heads = faces[:, [1, 2, 0]]
    order, starts = order_rows(np.minimum(faces, heads).ravel(), np.maximum(faces, heads).ravel())
    return EdgeOrder(order, starts, np.diff(starts, append=len(order)))


def connected(
    count: int, one: NDArray[np.integer[Any]], other: NDArray[np.integer[Any]]
) -> NDArray[np.int32]:
    """Find which of 0..count-1 links one[i]-other[i] join; number groups by first appearance."""
    parent = np.arange(count, dtype=np.int32)
    _join(parent, one.astype(np.int32), other.astype(np.int32))
    number = np.cumsum(parent == np.arange(count), dtype=np.int32) - np.int32(1)
    labels: NDArray[np.int32] = number[parent]
    return labels


@kernel
def _join(parent: Any, one: Any, other: Any) -> None:
    """Point each member of a group at its smallest, by links between two (union-find)."""
    for i in range(one.size):
        a, b = one[i], other[i]
        while parent[a] != a:
            parent[a] = parent[parent[a]]
            a = parent[a]
        while parent[b] != b:
            parent[b] = parent[parent[b]]
            b = parent[b]
        if a < b:
            parent[b] = a
        else:
            parent[a] = b
    for i in range(parent.size):
        parent[i] = parent[parent[i]]


def consistent_winding(topology: Topology) -> BoolArray | None:
    """Tell which faces to turn over so that neighbours agree.

    Of each body the smaller part is turned.

    Returns
    -------
    (m,) bool or None
        None where a body has one side only, as a Möbius strip.
    """
    turned, ok = _flood(topology.faces, topology.twin)
    if not ok:
        return None
    body = topology.body
    most = np.bincount(body, weights=turned) * 2 > np.bincount(body)
    result: BoolArray = turned ^ most[body]
    return result


@kernel
def _flood(faces: Any, twin: Any) -> Any:
    m = faces.shape[0]
    turned = np.zeros(m, dtype=np.bool_)
    seen = np.zeros(m, dtype=np.bool_)
    stack = np.empty(m, dtype=np.int32)
    for seed in range(m):
        if seen[seed]:
            continue
        seen[seed] = True
        stack[0], size = seed, 1
        while size > 0:
            size -= 1
            f = stack[size]
            for j in range(3):
                e = twin[3 * f + j]
                if e < 0:
                    continue
                g = e // 3
                wanted = turned[f] ^ (faces[f, j] == faces[g, e % 3])
                if not seen[g]:
                    seen[g], turned[g] = True, wanted
                    stack[size] = g
                    size += 1
                elif turned[g] != wanted:
                    return turned, False
    return turned, True
