"""Shells judged as the readers of their files find them, joined where equal; separate bits."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from planner.mesh.mesh import (
    Measures,
    Mesh,
    cancel_opposite,
    compact,
    connected,
    measure,
    order_edges,
    repeats_index,
    sort_span,
    weld,
    weld_points,
)
from planner.numerics import Float32Array, FloatArray, Point, kernel

__all__ = [
    "Fragments",
    "JoinedShells",
    "Measured",
    "first_fault_mm",
    "interfaces_cancel",
    "join_shells",
    "small_bodies",
]


# ------------------------------------------------------------------------------------------------
# All shells of a part as the readers of their files find them.


@dataclass(frozen=True, eq=False)
class JoinedShells:
    """Shells with equal positions joined, within each shell and between them.

    Attributes
    ----------
    vertices : (n, 3) float32
        Positions in mm, no two equal.
    faces : tuple of (m, 3) int32
        Of each shell, as indices into `vertices`.
    """

    vertices: Float32Array
    faces: tuple[NDArray[np.int32], ...]

    @cached_property
    def measures(self) -> tuple[Measures, ...]:
        """Volume, area and bounds of each shell."""
        points = self.vertices.astype(np.float64)
        return tuple(measure(points, faces) for faces in self.faces)

    @cached_property
    def left(self) -> NDArray[np.int32]:
        """The faces, (m, 3), that remain of all shells when opposite triangles cancel."""
        faces = np.concatenate([np.empty((0, 3), np.int32), *self.faces])
        repeating = repeats_index(faces)
        if repeating.any():
            faces = faces[~repeating]
        left: NDArray[np.int32] = faces[cancel_opposite(faces)]
        return left

    @cached_property
    def outside(self) -> Mesh:
        """The surface that `left` is, with its own vertices alone."""
        used, faces = compact(self.left, len(self.vertices))
        return Mesh(self.vertices[used].astype(np.float64), faces)

    @cached_property
    def outside_closed(self) -> bool:
        """Whether there is any, and each directed edge occurs as often as its reverse."""
        faces = self.outside.faces
        if not len(faces):
            return False
        order, starts, _ = order_edges(faces)
        way = np.where(faces < faces[:, [1, 2, 0]], 1, -1).ravel()
        return not np.add.reduceat(way[order], starts).any()

    def sound(self, number: int) -> bool:
        """Tell whether a shell is closed, the right way out, and has no face twice.

        Every directed edge occurs once, and so does its reverse; no face has two equal corners.
        Two faces on the same three vertices then are a body of their own, back to back.
        """
        faces = self.faces[number]
        buckets = np.zeros(len(self.vertices), np.int32)
        edges = np.empty(faces.size, np.int64)
        if not len(faces) or not _edges_paired(faces, buckets, edges):
            return False
        return bool(self.measures[number].volume_mm3[0] > 0.0)


def join_shells(
    shells: Iterable[Float32Array | FloatArray | tuple[Float32Array, NDArray[np.int32]]],
) -> JoinedShells:
    """Join equal positions of shells.

    Parameters
    ----------
    shells
        Of each its triangles, (k, 3, 3), or its vertices (n, 3) and faces (m, 3), in mm.
    """
    indexed = [
        shell if isinstance(shell, tuple) else weld(shell.astype(np.float32)) for shell in shells
    ]
    points = np.concatenate([np.empty((0, 3), np.float32), *(vertices for vertices, _ in indexed)])
    vertices, index = weld_points(points)
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in indexed)])
    return JoinedShells(
        vertices,
        tuple(index[start:][faces] for start, (_, faces) in zip(starts, indexed, strict=False)),
    )


@kernel
def _edges_paired(faces: Any, buckets: Any, edges: Any) -> Any:
    """Tell whether every directed edge occurs once, and so does its reverse, on two other faces.

    Edges are dealt to `buckets`, zeros, one for each vertex, by their lower vertex: the few of a
    bucket are sorted on the spot. An edge is its higher vertex, then a bit that is set where it
    runs down, then the face's third vertex.
    """
    for f in range(faces.shape[0]):
        for j in range(3):
            tail, head = faces[f, j], faces[f, j - 2]
            buckets[tail if tail < head else head] += 1
    total = 0
    for v in range(buckets.size):
        total += buckets[v]
        buckets[v] = total - buckets[v]
    for f in range(faces.shape[0]):
        for j in range(3):
            tail, head, third = np.int64(faces[f, j]), np.int64(faces[f, j - 2]), faces[f, j - 1]
            if tail == head:
                return False
            lower, edge = (tail, 2 * head) if tail < head else (head, 2 * tail + 1)
            edges[buckets[lower]] = edge << 32 | third
            buckets[lower] += 1
    first = np.int64(0)
    for v in range(buckets.size):
        last = np.int64(buckets[v])
        sort_span(edges, first, last)
        if (last - first) % 2 == 1:
            return False
        for i in range(first, last, 2):
            up, down = edges[i] >> 32, edges[i + 1] >> 32
            if up % 2 == 1 or down != up + 1 or edges[i] + (1 << 32) == edges[i + 1]:
                return False
            if i > first and edges[i - 1] >> 32 >= up:
                return False
        first = last
    return True


@dataclass(frozen=True)
class Interfaces:
    """How a part's shells fit: what is left when opposite triangles cancel.

    Attributes
    ----------
    closed : bool
        The faces that remain have no boundary.
    volume_error_mm3, area_error_mm2 : float
        Remaining surface minus part.
    volume_limit_mm3, area_limit_mm2 : float
        What rounding the cuts' points to float32 can cause.
    """

    closed: bool
    volume_error_mm3: float
    area_error_mm2: float
    volume_limit_mm3: float
    area_limit_mm2: float

    @property
    def ok(self) -> bool:
        """Only the part's own surface is left.

        An interface that does not match leaves two surfaces more: area gives it away, also
        where both together enclose nothing.
        """
        return (
            self.closed
            and abs(self.volume_error_mm3) <= self.volume_limit_mm3
            and abs(self.area_error_mm2) <= self.area_limit_mm2
        )


class Measured(Protocol):
    """A solid known by its volume and area alone."""

    @property
    def volume_mm3(self) -> float:
        """Enclosed volume."""

    @property
    def area_mm2(self) -> float:
        """Surface area."""


def interfaces_cancel(shells: JoinedShells, part: Measured) -> Interfaces:
    """Test that shells fill a part and touch triangle for triangle.

    Parameters
    ----------
    shells : JoinedShells
        All shells of the part.
    part : Measured
        The part they were cut from, in the same place: a `Mesh`, or a record of its volume and
        area, with which any position may have been moved by rounding.

    Returns
    -------
    Interfaces
        `ok` where exactly opposite triangles cancel and the part's surface remains.
    """
    outside = shells.outside
    vertices, moved = outside.vertices, outside.faces
    if isinstance(part, Mesh):
        # Positions of the part come first; rounding has moved only what is not among them.
        own = len(part.vertices)
        _, index = weld_points(np.concatenate([part.vertices, vertices]).astype(np.float32))
        new = index[own:] > index[:own].max(initial=-1)
        moved = moved[new[moved].any(axis=1)]
    strayed = measure(vertices, moved)
    spacing_mm = float(np.spacing(np.float32(np.abs(vertices).max(initial=0.0))))
    extent_mm = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    digits = 1e-12 * part.area_mm2
    return Interfaces(
        closed=shells.outside_closed,
        volume_error_mm3=outside.volume_mm3 - part.volume_mm3,
        area_error_mm2=outside.area_mm2 - part.area_mm2,
        volume_limit_mm3=float(strayed.area_mm2[0]) * spacing_mm + digits * extent_mm,
        area_limit_mm2=_perimeter(vertices, moved) * spacing_mm + digits,
    )


def _perimeter(vertices: FloatArray, faces: NDArray[np.int32]) -> float:
    corners = vertices[faces]
    return float(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).sum())


def first_fault_mm(mesh: Mesh) -> Point | None:
    """Return the middle of the first edge, in the order of the faces, that has not two faces.

    One whose two faces run the same way is such an edge, too. None of a closed mesh.
    """
    order, starts, count = order_edges(mesh.faces)
    tail, pairs = mesh.faces.ravel(), starts[count == 2]
    wrong = count != 2
    wrong[count == 2] = tail[order[pairs]] == tail[order[pairs + 1]]
    if not wrong.any():
        return None
    face, j = divmod(int(order[starts[wrong]].min()), 3)
    x, y, z = mesh.vertices[mesh.faces[face, [j, (j + 1) % 3]]].mean(axis=0).tolist()
    return x, y, z


# ------------------------------------------------------------------------------------------------
# Separate bits of a solid that are smaller than a limit.


_NOWHERE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Fragments:
    """Bodies of a solid that are smaller than a limit.

    Attributes
    ----------
    count
        How many.
    place_mm, extent_mm, volume_mm3
        Centre, box and volume of the largest by volume.
    total_mm3
        Volume of all of them.
    boxes_mm : (n, 2, 3)
        Of all of them, and of those too small to be printed at all.
    """

    count: int
    place_mm: tuple[float, float, float]
    extent_mm: tuple[float, float, float]
    volume_mm3: float
    total_mm3: float
    boxes_mm: FloatArray


def small_bodies(mesh: Mesh, limit_mm: float, least_mm: float) -> Fragments:
    """Find bodies with less volume than a cube of a limit, or smaller than it in all directions.

    Bodies are what vertices in common hold together; cavities are none. Bodies smaller than
    `least_mm` in all directions are not counted: a printer does not see them.
    """
    corners = mesh.faces.T
    body = connected(
        len(mesh.vertices),
        np.concatenate([corners[0], corners[1]]),
        np.concatenate([corners[1], corners[2]]),
    )
    number = body[corners[0]]
    used, number = np.unique(number, return_inverse=True)
    if len(used) < 2 and mesh.volume_mm3 >= limit_mm**3:
        return Fragments(0, _NOWHERE, _NOWHERE, 0.0, 0.0, np.empty((0, 2, 3)))
    found = measure(mesh.vertices, mesh.faces, number.astype(np.int32), len(used))
    extent = found.bounds_mm[:, 1] - found.bounds_mm[:, 0]
    small = (found.volume_mm3 < limit_mm**3) | (extent < limit_mm).all(axis=1)
    small &= found.volume_mm3 > 0.0
    boxes = found.bounds_mm[small]
    members = np.flatnonzero(small & (extent >= least_mm).any(axis=1))
    if not len(members):
        return Fragments(0, _NOWHERE, _NOWHERE, 0.0, 0.0, boxes)
    largest = members[np.argmax(found.volume_mm3[members])]
    x, y, z = found.bounds_mm[largest].mean(axis=0).tolist()
    width, depth, height = extent[largest].tolist()
    volume_mm3 = float(found.volume_mm3[largest])
    total_mm3 = float(found.volume_mm3[members].sum())
    return Fragments(len(members), (x, y, z), (width, depth, height), volume_mm3, total_mm3, boxes)
