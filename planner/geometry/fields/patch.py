"""A smooth piece of a surface, such as the wall of a hole, from one picked point."""

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.fields.triangle_tree import nearest, triangle_tree
from planner.geometry.mesh import Mesh
from planner.geometry.topology import Topology, connected

__all__ = ["faces_within", "smooth_patch"]

_CREASE = np.cos(np.radians(40.0))


def smooth_patch(mesh: Mesh, point_mm: FloatArray) -> Mesh:
    """Return the faces around the place nearest to a point, up to edges sharper than 40 degrees."""
    distance = nearest(triangle_tree(mesh), point_mm[None])[0][0]
    # The face itself: the only one, or one of those, as near as that.
    corners = mesh.triangles
    box = np.maximum(corners.min(axis=1) - point_mm, point_mm - corners.max(axis=1)).max(axis=1)
    candidates = np.flatnonzero(box <= distance + 1e-9)
    off = [
        nearest(triangle_tree(Mesh(mesh.vertices, mesh.faces[[f]])), point_mm[None])[0][0]
        for f in candidates.tolist()
    ]
    picked = int(candidates[int(np.argmin(off))])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    twin = Topology(mesh.faces).twin
    half = np.flatnonzero(twin >= 0)
    one, other = half // 3, twin[half] // 3
    smooth = (normal[one] * normal[other]).sum(axis=1) > _CREASE
    group = connected(len(mesh.faces), one[smooth], other[smooth])
    return Mesh(mesh.vertices, mesh.faces[group == group[picked]])


def faces_within(mesh: Mesh, low_mm: FloatArray, high_mm: FloatArray) -> Mesh:
    """Return the faces whose three corners lie in a box."""
    corners = mesh.triangles
    held = ((corners >= low_mm) & (corners <= high_mm)).all(axis=(1, 2))
    return Mesh(mesh.vertices, mesh.faces[held])
