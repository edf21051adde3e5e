"""Separate bits of a solid that are smaller than a limit."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.mesh import Mesh, measure
from planner.geometry.topology import connected

__all__ = ["Fragments", "small_bodies"]

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
    boxes_mm : (n, 2, 3)
        Of all of them, and of those too small to be printed at all.
    """

    count: int
    place_mm: tuple[float, float, float]
    extent_mm: tuple[float, float, float]
    volume_mm3: float
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
        return Fragments(0, _NOWHERE, _NOWHERE, 0.0, np.empty((0, 2, 3)))
    found = measure(mesh.vertices, mesh.faces, number.astype(np.int32), len(used))
    extent = found.bounds_mm[:, 1] - found.bounds_mm[:, 0]
    small = (found.volume_mm3 < limit_mm**3) | (extent < limit_mm).all(axis=1)
    small &= found.volume_mm3 > 0.0
    boxes = found.bounds_mm[small]
    members = np.flatnonzero(small & (extent >= least_mm).any(axis=1))
    if not len(members):
        return Fragments(0, _NOWHERE, _NOWHERE, 0.0, boxes)
    largest = members[np.argmax(found.volume_mm3[members])]
    x, y, z = found.bounds_mm[largest].mean(axis=0).tolist()
    width, depth, height = extent[largest].tolist()
    volume_mm3 = float(found.volume_mm3[largest])
    return Fragments(len(members), (x, y, z), (width, depth, height), volume_mm3, boxes)
