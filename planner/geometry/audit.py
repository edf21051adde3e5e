"""Judge a mesh as a file's reader finds it: a soup of triangles, joined where equal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from planner.arrays import Float32Array, FloatArray
from planner.errors import MeshError
from planner.geometry.kernel import kernel
from planner.geometry.mesh import Mesh, volume_and_area
from planner.geometry.weld import (
    cancel_opposite,
    counting_order,
    repeats_index,
    weld,
    weld_points,
)

__all__ = ["Audit", "Interfaces", "Measured", "audit", "audit_welded", "interfaces_cancel"]


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
    opened, overused, flat, duplicates, bodies, fault = _audit(vertices, proper)
    volume_mm3, area_mm2 = volume_and_area(vertices, proper)
    first_fault_mm = None
    if fault[0] >= 0:
        x, y, z = ((vertices[fault[0]].astype(np.float64) + vertices[fault[1]]) / 2).tolist()
        first_fault_mm = (x, y, z)
    bounds_mm = np.zeros((2, 3))
    if len(vertices):
        bounds_mm[:] = vertices.min(axis=0), vertices.max(axis=0)
    return Audit(
        triangles=len(faces),
        vertices=len(vertices),
        open_edges=int(opened),
        overused_edges=int(overused),
        first_fault_mm=first_fault_mm,
        degenerate_faces=len(faces) - len(proper),
        flat_faces=int(flat),
        duplicate_faces=int(duplicates),
        volume_mm3=volume_mm3,
        area_mm2=area_mm2,
        bounds_mm=bounds_mm,
        bodies=int(bodies),
    )


@kernel
def _audit(vertices: Any, faces: Any) -> Any:
    n, m = vertices.shape[0], faces.shape[0]
    low, high, order = _edges(faces, n)
    flat = 0
    for i in range(m):
        flat += _is_flat(vertices, faces[i, 0], faces[i, 1], faces[i, 2])

    parent = np.arange(m).astype(np.int32)
    bodies = m
    opened = overused = duplicates = 0
    fault = np.full(2, -1, dtype=np.int64)
    earliest = 3 * m
    start = 0
    while start < 3 * m:
        e = order[start]
        end = start + 1
        forward = 1 if faces[e // 3, e % 3] == low[e] else 0
        while end < 3 * m and low[order[end]] == low[e] and high[order[end]] == high[e]:
            g = order[end]
            forward += 1 if faces[g // 3, g % 3] == low[e] else 0
            first, second = _root(parent, e // 3), _root(parent, g // 3)
            if first != second:
                parent[max(first, second)] = min(first, second)
                bodies -= 1
            # The face is counted at the one of its edges that faces its largest vertex.
            apex = faces[g // 3, (g % 3 + 2) % 3]
            if apex > high[e]:
                for k in range(start, end):
                    h = order[k]
                    if faces[h // 3, (h % 3 + 2) % 3] == apex:
                        duplicates += 1
                        break
            end += 1
        if end - start != 2 or forward != 1:
            if end - start == 1:
                opened += 1
            else:
                overused += 1
            if e < earliest:
                earliest = e
                fault[0], fault[1] = low[e], high[e]
        start = end
    return opened, overused, flat, duplicates, bodies, fault


@kernel
def _edges(faces: Any, n: Any) -> Any:
    """Sort directed edges 3f + j by their two ends: all faces at an edge become neighbours."""
    m = faces.shape[0]
    low, high = np.empty(3 * m, dtype=np.int32), np.empty(3 * m, dtype=np.int32)
    for i in range(m):
        for j in range(3):
            a, b = faces[i, j], faces[i, (j + 1) % 3]
            low[3 * i + j], high[3 * i + j] = min(a, b), max(a, b)
    order = counting_order(high, np.arange(3 * m).astype(np.int32), n)
    return low, high, counting_order(low, order, n)


@kernel
def _root(parent: Any, i: Any) -> Any:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _is_flat(vertices: Any, a: Any, b: Any, c: Any) -> Any:
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        uj = np.float64(vertices[b, j]) - vertices[a, j]
        uk = np.float64(vertices[b, k]) - vertices[a, k]
        vj = np.float64(vertices[c, j]) - vertices[a, j]
        vk = np.float64(vertices[c, k]) - vertices[a, k]
        if uj * vk != uk * vj:
            return 0
    return 1


@dataclass(frozen=True)
class Interfaces:
    """How a part's shells fit: what is left when opposite triangles cancel.

    Attributes
    ----------
    cancelled : int
        Pairs of opposite triangles: the interfaces.
    remaining : int
        Triangles left: the outer surface, if all interfaces match.
    closed : bool
        The remaining triangles have no boundary.
    volume_error_mm3, area_error_mm2 : float
        Remaining surface minus part.
    volume_limit_mm3, area_limit_mm2 : float
        What rounding the cuts' points to float32 can cause.
    """

    cancelled: int
    remaining: int
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
    volume_mm3, area_mm2 = volume_and_area(vertices, rest)
    # Positions of the part come first; rounding has moved only what is not among them.
    moved = rest[(rest > index[: len(own)].max(initial=-1)).any(axis=1)]
    spacing_mm = float(np.spacing(np.float32(np.abs(vertices).max(initial=0.0))))
    extent_mm = float(np.ptp(vertices, axis=0).max())
    digits = 1e-12 * part.area_mm2
    return Interfaces(
        cancelled=(len(faces) - len(rest)) // 2,
        remaining=len(rest),
        closed=bool(len(rest) and _balanced(rest, len(vertices))),
        volume_error_mm3=volume_mm3 - part.volume_mm3,
        area_error_mm2=area_mm2 - part.area_mm2,
        volume_limit_mm3=volume_and_area(vertices, moved)[1] * spacing_mm + digits * extent_mm,
        area_limit_mm2=_perimeter(vertices, moved) * spacing_mm + digits,
    )


@kernel
def _perimeter(vertices: Any, faces: Any) -> Any:
    total = 0.0
    for i in range(faces.shape[0]):
        for j in range(3):
            square = 0.0
            for k in range(3):
                step = np.float64(vertices[faces[i, j], k]) - vertices[faces[i, (j + 1) % 3], k]
                square += step * step
            total += np.sqrt(square)
    return total


@kernel
def _balanced(faces: Any, n: Any) -> Any:
    """Tell whether every directed edge occurs as often as its reverse."""
    m = faces.shape[0]
    low, high, order = _edges(faces, n)
    net = 0
    for i in range(3 * m):
        e = order[i]
        if i > 0 and (low[e] != low[order[i - 1]] or high[e] != high[order[i - 1]]):
            if net != 0:
                return False
            net = 0
        net += 1 if faces[e // 3, e % 3] == low[e] else -1
    return net == 0
