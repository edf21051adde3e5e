"""How large a field's interfaces are before they are drawn, and the pitch that they can have."""

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.columns import dense, voxelize
from planner.geometry.fields.field import Field
from planner.geometry.level_sets.grid import values_at
from planner.geometry.mesh import Mesh

__all__ = ["affordable_pitch_mm", "interface_area_mm2"]

_MOST_FACES = 1_500_000
"""Of interfaces, on both sides: some 75 MB of STL, and seconds to draw and verify."""

_FACES_PER_CELL = 30.0
"""Of both sides, for each square of the pitch's edge: tetrahedra make about 15 of a sheet there."""

_COARSEST = 2.0
"""Of the usual pitch: beyond it, bands as thick as a printer's smallest feature are not drawn."""

_MOST_VOXELS = 500_000


def interface_area_mm2(mesh: Mesh, field: Field, levels: FloatArray, pitch_mm: float) -> float:
    """Return about how large the level sets are within a part, by counting crossings.

    Lines along x, y and z through voxels inside cross a surface A / 2 times for each unit of their
    cross-section if its normals point all ways (Cauchy and Crofton); levels that one step crosses
    count each. What a level set does within a voxel is not seen.
    """
    columns = voxelize(mesh, pitch_mm)
    inside = dense(columns)
    voxels = np.argwhere(inside)
    if not len(voxels):
        return 0.0
    band = np.full(inside.shape, -1, np.int32)
    values = values_at(field, columns.grid.centre_mm(voxels))
    band[tuple(voxels.T)] = np.searchsorted(levels, values, side="right")
    crossings = 0
    for axis in range(3):
        along = np.moveaxis(band, axis, 0)
        both = (along[1:] >= 0) & (along[:-1] >= 0)
        crossings += int(np.abs(along[1:] - along[:-1])[both].sum())
    return crossings * pitch_mm**2 / 1.5


def affordable_pitch_mm(mesh: Mesh, field: Field, levels: FloatArray, usual_mm: float) -> float:
    """Return the usual pitch, or a coarser one where interfaces would be too many triangles.

    Up to twice the usual, rounded to two digits.
    """
    volume_mm3 = abs(mesh.volume_mm3)
    sampled_mm = max(usual_mm, float(np.cbrt(volume_mm3 / _MOST_VOXELS)))
    area_mm2 = interface_area_mm2(mesh, field, levels, sampled_mm)
    needed_mm = float(np.sqrt(_FACES_PER_CELL * area_mm2 / _MOST_FACES))
    if needed_mm <= usual_mm:
        return usual_mm
    return float(f"{min(needed_mm, _COARSEST * usual_mm):.2g}")
