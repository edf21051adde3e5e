"""Which faces meet at which edges: neighbours, borders, bodies."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, FloatArray
from planner.geometry.kernel import kernel

__all__ = ["CROWDED", "OPEN", "Topology", "body_measures", "consistent_winding"]

OPEN, CROWDED = -1, -2
"""In `Topology.twin`: no other face at this edge, or more than one."""


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
    def _paired(self) -> tuple[NDArray[np.int32], int]:
        twin, same_way = _pair(self.faces, int(self.faces.max(initial=-1)) + 1)
        return twin, int(same_way)

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
        labels: NDArray[np.int32] = _bodies(self.twin)
        return labels

    @property
    def bodies(self) -> int:
        """How many bodies there are."""
        return int(self.body.max(initial=-1)) + 1

    def edges(self, kind: int) -> NDArray[np.int32]:
        """Return the vertices (k, 2) of the half-edges that are `OPEN` or `CROWDED`."""
        half = np.flatnonzero(self.twin == kind)
        face, corner = np.divmod(half, 3)
        return np.stack([self.faces[face, corner], self.faces[face, (corner + 1) % 3]], axis=1)


@kernel
def _pair(faces: Any, n: Any) -> Any:
    """Bucket half-edges by their lower vertex, sort each bucket by the higher, match equals."""
    m = faces.shape[0]
    place = np.zeros(n + 1, dtype=np.int32)
    for i in range(m):
        for j in range(3):
            place[min(faces[i, j], faces[i, (j + 1) % 3]) + 1] += 1
    for i in range(n):
        place[i + 1] += place[i]
    bucket = np.empty(3 * m, dtype=np.int32)
    high = np.empty(3 * m, dtype=np.int32)
    for i in range(m):
        for j in range(3):
            a, b = faces[i, j], faces[i, (j + 1) % 3]
            k = place[min(a, b)]
            bucket[k], high[k] = 3 * i + j, max(a, b)
            place[min(a, b)] = k + 1
    twin = np.full(3 * m, -1, dtype=np.int32)
    same_way = 0
    start = 0
    for v in range(n):
        end = place[v]
        gap = (end - start) // 2  # Shell's sort: at most vertices few edges meet, at a fan's many
        while gap > 0:
            for i in range(start + gap, end):
                h, e, k = high[i], bucket[i], i
                while k >= start + gap and high[k - gap] > h:
                    high[k], bucket[k] = high[k - gap], bucket[k - gap]
                    k -= gap
                high[k], bucket[k] = h, e
            gap //= 2
        while start < end:
            stop = start + 1
            while stop < end and high[stop] == high[start]:
                stop += 1
            if stop - start == 2:
                e, g = bucket[start], bucket[start + 1]
                twin[e], twin[g] = g, e
                same_way += faces[e // 3, e % 3] == faces[g // 3, g % 3]
            elif stop - start > 2:
                for k in range(start, stop):
                    twin[bucket[k]] = -2
            start = stop
    return twin, same_way


@kernel
def _bodies(twin: Any) -> Any:
    m = twin.shape[0] // 3
    label = np.full(m, -1, dtype=np.int32)
    stack = np.empty(m, dtype=np.int32)
    bodies = 0
    for seed in range(m):
        if label[seed] >= 0:
            continue
        label[seed] = bodies
        stack[0], size = seed, 1
        while size > 0:
            size -= 1
            f = stack[size]
            for j in range(3):
                g = twin[3 * f + j]
                if g >= 0 and label[g // 3] < 0:
                    label[g // 3] = bodies
                    stack[size] = g // 3
                    size += 1
        bodies += 1
    return label


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


def body_measures(
    vertices: FloatArray, topology: Topology
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measure each body.

    Returns
    -------
    volume_mm3, area_mm2 : (bodies,)
        Signed volume about a vertex of the body, and surface.
    bounds_mm : (bodies, 2, 3)
        Smallest and largest coordinates.
    """
    volume, area, bounds = _measure(vertices, topology.faces, topology.body, topology.bodies)
    return volume, area, bounds


@kernel
def _measure(vertices: Any, faces: Any, body: Any, bodies: Any) -> Any:
    volume, area = np.zeros(bodies), np.zeros(bodies)
    bounds = np.empty((bodies, 2, 3))
    bounds[:, 0], bounds[:, 1] = np.inf, -np.inf
    origin = np.empty((bodies, 3))
    for i in range(faces.shape[0]):
        b = body[i]
        if bounds[b, 0, 0] == np.inf:
            for k in range(3):
                origin[b, k] = vertices[faces[i, 0], k]
        for j in range(3):
            for k in range(3):
                at = vertices[faces[i, j], k]
                bounds[b, 0, k] = min(bounds[b, 0, k], at)
                bounds[b, 1, k] = max(bounds[b, 1, k], at)
        i0, i1, i2 = faces[i, 0], faces[i, 1], faces[i, 2]
        x, y, z = vertices[i0, 0], vertices[i0, 1], vertices[i0, 2]
        ux, uy, uz = vertices[i1, 0] - x, vertices[i1, 1] - y, vertices[i1, 2] - z
        vx, vy, vz = vertices[i2, 0] - x, vertices[i2, 1] - y, vertices[i2, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        x, y, z = x - origin[b, 0], y - origin[b, 1], z - origin[b, 2]
        volume[b] += x * nx + y * ny + z * nz
        area[b] += np.sqrt(nx * nx + ny * ny + nz * nz)
    return volume / 6.0, area / 2.0, bounds
