"""A mesh judged as a file's reader finds it: a soup of triangles, joined where equal."""

from dataclasses import dataclass

import numpy as np

from planner.errors import MeshError
from planner.mesh.mesh import (
    connected,
    measure,
    order_edges,
    order_rows,
    repeats_index,
    sorted_corners,
    weld,
)
from planner.numerics import Float32Array, FloatArray


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
    points, faces = weld(triangles)
    vertices = points.astype(np.float64)
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
