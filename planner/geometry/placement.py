"""Move a part to where the single precision of mesh files is finest and never negative."""

import numpy as np

from planner.arrays import FloatArray
from planner.errors import MeshError
from planner.geometry.mesh import Mesh
from planner.geometry.weld import cancel_opposite, repeats_index, weld_points

__all__ = ["place"]


def place(mesh: Mesh) -> tuple[Mesh, FloatArray]:
    """Move a part's smallest corner to (1, 1, 1) mm and round it to float32.

    Slicing programs of jetting printers want positive coordinates, and rounding before cutting
    makes one part, and so interfaces that match, of what is cut. Vertices that round to one
    position are joined, faces that thereby repeat a vertex are dropped, and faces that thereby
    cover another turned over cancel.

    Parameters
    ----------
    mesh : Mesh
        The part, in mm.

    Returns
    -------
    placed : Mesh
        Vertices are float32 values; no two are equal.
    translation_mm : (3,) float64
        What was added to every vertex before rounding.

    Raises
    ------
    MeshError
        Without faces, or with a coordinate that is not finite.
    """
    if len(mesh.faces) == 0:
        raise MeshError("the mesh has no triangles; export the part again as a solid")
    if not np.isfinite(mesh.vertices).all():
        row = int(np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))[0])
        raise MeshError(
            f"vertex {row} is {tuple(mesh.vertices[row].tolist())}: coordinates must be finite "
            "numbers of mm; export the part again"
        )
    translation_mm = 1.0 - mesh.bounds_mm[0]
    rounded = (mesh.vertices + translation_mm).astype(np.float32)
    vertices, index = weld_points(rounded)
    faces = index[mesh.faces]
    faces = faces[~repeats_index(faces)]
    faces = faces[cancel_opposite(faces)]
    if len(faces) == 0:
        raise MeshError(
            "nothing is left of the mesh in single precision: the part has no thickness, or its "
            "unit is wrong; check the unit, or scale the part"
        )
    used = np.zeros(len(vertices), dtype=np.bool_)
    used[faces.ravel()] = True
    compact = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return Mesh(vertices[used].astype(np.float64), compact[faces]), translation_mm
