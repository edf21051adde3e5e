"""A triangle mesh in millimetres."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray

__all__ = ["Mesh", "signed_volume_mm3"]


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
        object.__setattr__(self, "vertices", np.ascontiguousarray(self.vertices, dtype=np.float64))
        object.__setattr__(self, "faces", np.ascontiguousarray(self.faces, dtype=np.int32))

    @cached_property
    def triangles(self) -> FloatArray:
        """Corner positions, (m, 3, 3) in mm."""
        return self.vertices[self.faces]

    @cached_property
    def bounds_mm(self) -> FloatArray:
        """Smallest and largest coordinate of the vertices that faces use, (2, 3) in mm."""
        used = np.zeros(len(self.vertices), dtype=np.bool_)
        used[self.faces.ravel()] = True
        points = self.vertices[used]
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def volume_mm3(self) -> float:
        """Signed volume in mm³: positive where normals point outwards."""
        return signed_volume_mm3(self.vertices, self.faces)

    @cached_property
    def area_mm2(self) -> float:
        """Surface area in mm²."""
        corner = self.triangles
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        return float(0.5 * np.linalg.norm(normal, axis=1).sum())


def signed_volume_mm3(vertices: FloatArray | Float32Array, faces: NDArray[np.int32]) -> float:
    """Volume that a closed surface encloses, by the divergence theorem.

    Summed about the middle of the faces' bounding box: about a distant origin the terms would
    cancel and take the digits with them.

    Parameters
    ----------
    vertices : (n, 3) array
        Positions in mm.
    faces : (m, 3) int32
        Outward triangles.

    Returns
    -------
    float
        Volume in mm³, negative for a surface turned inside out, 0 without faces.
    """
    if len(faces) == 0:
        return 0.0
    corner = np.asarray(vertices, dtype=np.float64)[faces]
    flat = corner.reshape(-1, 3)
    corner = corner - (flat.min(axis=0) + flat.max(axis=0)) / 2
    a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
