"""A triangle mesh in millimetres."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.geometry.kernel import kernel

__all__ = ["Mesh", "volume_and_area"]


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
        bounds_mm: FloatArray = _bounds(self.vertices, self.faces)
        return bounds_mm

    @property
    def volume_mm3(self) -> float:
        """Signed volume in mm³: positive where normals point outwards."""
        return self._measure[0]

    @property
    def area_mm2(self) -> float:
        """Surface area in mm²."""
        return self._measure[1]

    @cached_property
    def _measure(self) -> tuple[float, float]:
        return volume_and_area(self.vertices, self.faces)


def volume_and_area(
    vertices: FloatArray | Float32Array, faces: NDArray[np.int32]
) -> tuple[float, float]:
    """Volume that a closed surface encloses, by the divergence theorem, and its area.

    Summed about a vertex of the surface: about a distant origin the terms would cancel and take
    the digits with them. The order of summation is fixed.

    Parameters
    ----------
    vertices : (n, 3) array
        Positions in mm.
    faces : (m, 3) int32
        Outward triangles.

    Returns
    -------
    volume_mm3, area_mm2 : float
        The volume is negative for a surface turned inside out; both are 0 without faces.
    """
    volume_mm3, area_mm2 = _volume_and_area(vertices, faces)
    return float(volume_mm3), float(area_mm2)


@kernel
def _bounds(vertices: Any, faces: Any) -> Any:
    bounds = np.empty((2, 3))
    bounds[0], bounds[1] = np.inf, -np.inf
    for i in range(faces.shape[0]):
        for j in range(3):
            for k in range(3):
                x = vertices[faces[i, j], k]
                if np.isnan(x):  # no comparison would notice it
                    bounds[:] = np.nan
                    return bounds
                bounds[0, k], bounds[1, k] = min(bounds[0, k], x), max(bounds[1, k], x)
    return bounds


@kernel
def _volume_and_area(vertices: Any, faces: Any) -> Any:
    volume = area = 0.0
    if faces.shape[0] == 0:
        return volume, area
    ox, oy, oz = vertices[faces[0, 0]].astype(np.float64)
    for i in range(faces.shape[0]):
        i0, i1, i2 = faces[i, 0], faces[i, 1], faces[i, 2]
        ax, ay, az = vertices[i0, 0] - ox, vertices[i0, 1] - oy, vertices[i0, 2] - oz
        ux = vertices[i1, 0] - ox - ax
        uy = vertices[i1, 1] - oy - ay
        uz = vertices[i1, 2] - oz - az
        vx = vertices[i2, 0] - ox - ax
        vy = vertices[i2, 1] - oy - ay
        vz = vertices[i2, 2] - oz - az
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        volume += ax * nx + ay * ny + az * nz
        area += np.sqrt(nx * nx + ny * ny + nz * nz)
    return volume / 6.0, area / 2.0
