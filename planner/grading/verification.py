"""Whether shells are sound, and fill the part without gap or overlap, as readers find them."""

from collections.abc import Sequence

import numpy as np

from planner.arrays import Float32Array, FloatArray
from planner.geometry.audit import Measured, audit_welded, interfaces_cancel
from planner.geometry.columns import grid_for, iterate_columns
from planner.geometry.mesh import Mesh
from planner.geometry.weld import weld
from planner.plan import Check

__all__ = ["VOLUME_ERROR_LIMIT", "shell_checks"]

VOLUME_ERROR_LIMIT = 1e-6
"""Of the shells' volumes against the part's: what rounding to float32 leaves on a part of any
shape that fits a tray."""

OVERLAP_LIMIT = 1e-9
_COLUMNS_ACROSS = 512  # of the longest side: 2e5 columns over a cube, a fraction of a second


def shell_checks(shells: Sequence[Float32Array | FloatArray], part: Measured) -> dict[str, Check]:
    """Verify a part's shells as they stand in their files.

    Parameters
    ----------
    shells
        Triangles (k, 3, 3) of each, at least one.
    part
        The part they were cut from; its volume is above 0.

    Returns
    -------
    dict
        ``shells_unsound``: shells that are not closed, each edge used exactly once each way,
        without degenerate or duplicate triangles, the right way out, and taken by manifold3d.
        ``volume_error``: sum of the shells' volumes against the part's, relative.
        ``interfaces_unmatched``: 0 when all opposite triangles of neighbours cancel exactly and
        the part's own surface, by area and volume, is what remains.
        ``overlap``: volume that two shells share, of the part's. Shells whose boundaries cancel
        have winding numbers that add up to the part's, so it can differ from 0 only where a
        shell is turned inside out in places; it is measured on columns of voxels.
    """
    meshes = [_welded(shell) for shell in shells]
    audits = [audit_welded(mesh) for mesh in meshes]
    unsound = sum(
        not (found.sound and _accepted(mesh)) for found, mesh in zip(audits, meshes, strict=True)
    )
    fit = interfaces_cancel(meshes, part)
    total = sum(found.volume_mm3 for found in audits)
    error = abs(total / part.volume_mm3 - 1.0)
    shared = _shared_mm3(meshes) / part.volume_mm3
    return {
        "shells_unsound": Check(unsound, 0, unsound == 0),
        "volume_error": Check(error, VOLUME_ERROR_LIMIT, error <= VOLUME_ERROR_LIMIT),
        "interfaces_unmatched": Check(int(not fit.ok), 0, fit.ok),
        "overlap": Check(shared, OVERLAP_LIMIT, shared <= OVERLAP_LIMIT),
    }


def _shared_mm3(meshes: Sequence[Mesh]) -> float:
    """Measure on columns what lies in more than one shell."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    together = Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=False)]),
    )
    extent_mm = together.bounds_mm[1] - together.bounds_mm[0]
    grid = grid_for(together.bounds_mm, float(extent_mm.max()) / _COLUMNS_ACROSS)
    voxels = [
        sum(columns.voxels for columns in iterate_columns(mesh, grid))
        for mesh in (together, *meshes)
    ]
    return abs(sum(voxels[1:]) - voxels[0]) * grid.voxel_mm3


def _welded(soup: Float32Array | FloatArray) -> Mesh:
    vertices, faces = weld(soup.astype(np.float32))
    return Mesh(vertices.astype(np.float64), faces)


def _accepted(mesh: Mesh) -> bool:
    """Tell whether manifold3d takes a shell as a manifold."""
    import manifold3d

    solid = manifold3d.Manifold(
        manifold3d.Mesh(
            vert_properties=mesh.vertices.astype(np.float32),
            tri_verts=mesh.faces.astype(np.uint32),
        )
    )
    return bool(solid.status() == manifold3d.Error.NoError)
