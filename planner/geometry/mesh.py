"""A triangle mesh in millimetres."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.geometry.kernel import kernel

__all__ = ["Measures", "Mesh", "measure"]


class Measures(NamedTuple):
    """What `measure` finds of each part of a surface.

    Attributes
    ----------
    volume_mm3, area_mm2 : (parts,) float64
        The volume is negative for a surface turned inside out; both are 0 without faces.
    bounds_mm : (parts, 2, 3) float64
        Smallest and largest coordinates: inf and -inf without faces, NaN where one is NaN.
    flat : int
        Triangles of zero area, in all parts.
    """

    volume_mm3: FloatArray
    area_mm2: FloatArray
    bounds_mm: FloatArray
    flat: int


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices and the triangles between them, normals outwards by the right-hand rule.

    Attributes
    ----------
    vertices : (n, 3) float64
        Positions in mm.
    faces : (m, 3) int32
        Indices into `vertices`, counter-clockwise as seen from outside.
    """

    vertices: FloatArray
    faces: NDArray[np.int32]

    def __post_init__(self) -> None:
        # Kernels are compiled for one kind of array: contiguous and writable.
        vertices = np.require(self.vertices, np.float64, ["C", "W"])
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", np.require(self.faces, np.int32, ["C", "W"]))

    @cached_property
    def triangles(self) -> FloatArray:
        """Corner positions, (m, 3, 3) in mm."""
        return self.vertices[self.faces]

    @cached_property
    def bounds_mm(self) -> FloatArray:
        """Smallest and largest coordinate of the vertices that faces use, (2, 3) in mm."""
        bounds_mm: FloatArray = self._measured.bounds_mm[0]
        return bounds_mm

    @property
    def volume_mm3(self) -> float:
        """Signed volume in mm³: positive where normals point outwards."""
        return float(self._measured.volume_mm3[0])

    @property
    def area_mm2(self) -> float:
        """Surface area in mm²."""
        return float(self._measured.area_mm2[0])

    @cached_property
    def _measured(self) -> Measures:
        return measure(self.vertices, self.faces)


def measure(
    vertices: FloatArray | Float32Array,
    faces: NDArray[np.int32],
    part: NDArray[np.int32] | None = None,
    parts: int = 1,
) -> Measures:
    """Measure each part of a surface.

    Volumes are by the divergence theorem, summed about a vertex of the part: about a distant
    origin the terms would cancel and take the digits with them. The order of summation is fixed.

    Parameters
    ----------
    vertices : (n, 3) array
        Positions in mm.
    faces : (m, 3) int32
        Outward triangles.
    part : (m,) int32
        Which part each triangle belongs to, from 0 on; by default all to one.
    parts : int
        How many there are.
    """
    if part is None:
        part = np.zeros(len(faces), dtype=np.int32)
    volume, area, origin = np.zeros(parts), np.zeros(parts), np.full((parts, 3), np.nan)
    bounds = np.empty((parts, 2, 3))
    bounds[:, 0], bounds[:, 1] = np.inf, -np.inf
    points = np.require(vertices, np.float64, ["C", "W"])
    first = np.unique(part, return_index=True)[1] if parts > 1 else np.arange(min(len(part), 1))
    origin[part[first]] = points[faces[first, 0]]
    faces = np.require(faces, np.int32, ["C", "W"])
    flat = _measure(points, faces, part, origin, volume, area, bounds)
    return Measures(volume / 6.0, area / 2.0, bounds, int(flat))


@kernel
def _measure(
    vertices: Any, faces: Any, part: Any, origin: Any, volume: Any, area: Any, bounds: Any
) -> Any:
    flat = 0
    for i in range(faces.shape[0]):
        p, i0, i1, i2 = part[i], faces[i, 0], faces[i, 1], faces[i, 2]
        for j in range(3):
            for k in range(3):
                x = vertices[faces[i, j], k]
                if x < bounds[p, 0, k] or x != x:  # NaN, which then stays
                    bounds[p, 0, k] = x
                if x > bounds[p, 1, k] or x != x:
                    bounds[p, 1, k] = x
        ox, oy, oz = origin[p, 0], origin[p, 1], origin[p, 2]
        ax, ay, az = vertices[i0, 0] - ox, vertices[i0, 1] - oy, vertices[i0, 2] - oz
        ux = vertices[i1, 0] - ox - ax
        uy = vertices[i1, 1] - oy - ay
        uz = vertices[i1, 2] - oz - az
        vx = vertices[i2, 0] - ox - ax
        vy = vertices[i2, 1] - oy - ay
        vz = vertices[i2, 2] - oz - az
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        volume[p] += ax * nx + ay * ny + az * nz
        area[p] += np.sqrt(nx * nx + ny * ny + nz * nz)
        if nx == 0.0 and ny == 0.0 and nz == 0.0:
            flat += 1
    return flat
