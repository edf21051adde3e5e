"""A mesh judged as a file's reader finds it: a soup of triangles, joined where equal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planner.errors import MeshError
from planner.mesh.mesh import (
    Mesh,
    cancel_opposite,
    connected,
    measure,
    order_edges,
    order_rows,
    repeats_index,
    sorted_corners,
    weld,
    weld_points,
)
from planner.numerics import Float32Array, FloatArray

__all__ = ["Fragments", "Measured", "audit", "audit_welded", "interfaces_cancel", "small_bodies"]


# ------------------------------------------------------------------------------------------------
# Judge a mesh as a file's reader finds it: a soup of triangles, joined where equal.


@dataclass(frozen=True, eq=False)
class Audit:
    """What a triangle soup is once equal positions are joined.

    Attributes
    ----------
    triangles, vertices : int
        How many there are.
    open_edges : int
        Edges with one face.
    overused_edges : int
        Edges with more than two faces, or with two that run the same way.
    first_fault_mm : (3,) tuple of float or None
        Middle of the first such edge of either kind, in the order of the triangles.
    degenerate_faces : int
        Triangles with two equal corners. They have no share in edges, bodies and volume.
    flat_faces : int
        Triangles of zero area with three different corners.
    duplicate_faces : int
        Triangles on the same three vertices as an earlier one, either way round.
    volume_mm3 : float
        Enclosed volume, negative for a mesh turned inside out.
    area_mm2 : float
        Surface area.
    bounds_mm : (2, 3) array
        Smallest and largest coordinates; zeros without triangles.
    bodies : int
        Parts of the surface that no edge connects. A cavity counts as one.
    """

    triangles: int
    vertices: int
    open_edges: int
    overused_edges: int
    first_fault_mm: tuple[float, float, float] | None
    degenerate_faces: int
    flat_faces: int
    duplicate_faces: int
    volume_mm3: float
    area_mm2: float
    bounds_mm: FloatArray
    bodies: int

    @property
    def closed(self) -> bool:
        """Every directed edge occurs once, and so does its reverse."""
        return self.triangles > 0 and self.open_edges == 0 and self.overused_edges == 0

    @property
    def sound(self) -> bool:
        """Closed, the right way out, without degenerate or duplicate faces."""
        return (
            self.closed
            and self.degenerate_faces == 0
            and self.duplicate_faces == 0
            and self.volume_mm3 > 0.0
        )


def audit(triangles: Float32Array | FloatArray) -> Audit:
    """Audit a triangle soup.

    Parameters
    ----------
    triangles : (k, 3, 3) float32 or float64
        Corner positions in mm, as they stand in a file.

    Returns
    -------
    Audit
        Counts and measures; the caller decides what is a fault.

    Raises
    ------
    MeshError
        A coordinate is not finite.
    """
    if not np.isfinite(triangles).all():
        row = int(np.flatnonzero(~np.isfinite(triangles).all(axis=(1, 2)))[0])
        raise MeshError(
            f"triangle {row} has a coordinate that is not a finite number: "
            f"{triangles[row].tolist()}; export the part again"
        )
    vertices, faces = weld(triangles)  # type: ignore[type-var] # either type, returned as it is
    return audit_welded(Mesh(vertices.astype(np.float64), faces))


def audit_welded(mesh: Mesh) -> Audit:
    """Audit a mesh whose equal positions are one vertex already; see `audit`."""
    vertices, faces = mesh.vertices, mesh.faces
    proper = faces[~repeats_index(faces)]
    order, starts, count = order_edges(proper)
    tail = proper.ravel()
    pairs = starts[count == 2]
    wrong = count != 2
    wrong[count == 2] = tail[order[pairs]] == tail[order[pairs + 1]]
    opened = int(np.count_nonzero(count == 1))
    measured = measure(vertices, proper)
    first_fault_mm = None
    if wrong.any():
        face, j = divmod(int(order[starts[wrong]].min()), 3)
        x, y, z = (
            vertices[proper[face, [j, (j + 1) % 3]]].astype(np.float64).sum(axis=0) / 2
        ).tolist()
        first_fault_mm = (x, y, z)
    bounds_mm = np.zeros((2, 3))
    if len(vertices):
        bounds_mm[:] = vertices.min(axis=0), vertices.max(axis=0)
    later = np.delete(np.arange(len(order)), starts)
    bodies = connected(len(proper), order[later - 1] // 3, order[later] // 3)
    return Audit(
        triangles=len(faces),
        vertices=len(vertices),
        open_edges=opened,
        overused_edges=int(np.count_nonzero(wrong)) - opened,
        first_fault_mm=first_fault_mm,
        degenerate_faces=len(faces) - len(proper),
        flat_faces=measured.flat,
        duplicate_faces=len(proper) - len(order_rows(*sorted_corners(proper))[1]),
        volume_mm3=float(measured.volume_mm3[0]),
        area_mm2=float(measured.area_mm2[0]),
        bounds_mm=bounds_mm,
        bodies=int(bodies.max(initial=-1)) + 1,
    )


@dataclass(frozen=True)
class Interfaces:
    """How a part's shells fit: what is left when opposite triangles cancel.

    Attributes
    ----------
    closed : bool
        The remaining triangles have no boundary.
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
        ...

    @property
    def area_mm2(self) -> float:
        """Surface area."""
        ...


def interfaces_cancel(shells: Sequence[Float32Array | Mesh], part: Measured) -> Interfaces:
    """Test that shells fill a part and touch triangle for triangle.

    Parameters
    ----------
    shells : sequence of (k, 3, 3) float32 or Mesh
        All shells as they stand in their files, in mm, welded or not.
    part : Measured
        The part they were cut from, in the same place: a `Mesh`, or a record of its volume and
        area, with which any position may have been moved by rounding.

    Returns
    -------
    Interfaces
        `ok` where exactly opposite triangles cancel and the part's surface remains.
    """
    own = part.vertices if isinstance(part, Mesh) else np.empty((0, 3))
    points, corners = [own.astype(np.float32)], [np.empty(0, dtype=np.int64)]
    for shell in shells:
        before = sum(map(len, points))
        if isinstance(shell, Mesh):
            points.append(shell.vertices.astype(np.float32))
            corners.append(before + shell.faces.ravel().astype(np.int64))
        else:
            points.append(shell.reshape(-1, 3))
            corners.append(before + np.arange(3 * len(shell)))
    vertices, index = weld_points(np.concatenate(points))
    faces = index[np.concatenate(corners)].reshape(-1, 3)
    faces = faces[~repeats_index(faces)]
    rest = faces[cancel_opposite(faces)]
    left = measure(vertices, rest)
    # Positions of the part come first; rounding has moved only what is not among them.
    moved = rest[(rest > index[: len(own)].max(initial=-1)).any(axis=1)]
    spacing_mm = float(np.spacing(np.float32(np.abs(vertices).max(initial=0.0))))
    extent_mm = float(np.ptp(vertices, axis=0).max())
    digits = 1e-12 * part.area_mm2
    return Interfaces(
        closed=bool(len(rest) and _balanced(rest)),
        volume_error_mm3=float(left.volume_mm3[0]) - part.volume_mm3,
        area_error_mm2=float(left.area_mm2[0]) - part.area_mm2,
        volume_limit_mm3=float(measure(vertices, moved).area_mm2[0]) * spacing_mm
        + digits * extent_mm,
        area_limit_mm2=_perimeter(vertices, moved) * spacing_mm + digits,
    )


def _perimeter(vertices: Float32Array, faces: NDArray[np.int32]) -> float:
    corners = vertices[faces].astype(np.float64)
    return float(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).sum())


def _balanced(faces: NDArray[np.int32]) -> bool:
    """Tell whether every directed edge occurs as often as its reverse."""
    order, starts, _ = order_edges(faces)
    way = np.where(faces < faces[:, [1, 2, 0]], 1, -1).ravel()
    return not np.add.reduceat(way[order], starts).any()


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
