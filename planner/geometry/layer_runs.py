"""A mesh as layers of voxels: for each row of a layer, the runs along x that lie inside.

The voxels are those of `planner.geometry.columns` on the same grid, made layer by layer from the
lowest up, so that a stack of images can be written while a few layers are held in memory.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.arrays import IntArray
from planner.errors import ArgumentError
from planner.geometry.column_kernels import cover_rows, slab_runs, snap
from planner.geometry.columns import Grid, check_reach
from planner.geometry.mesh import Mesh

__all__ = ["LayerRuns", "SlabTriangles", "iterate_slabs", "runs_along_x", "slab_layers_for"]

_SLAB_ROWS = 1 << 17  # a slab's working arrays stay in the second-level cache


@dataclass(frozen=True, eq=False)
class LayerRuns:
    """Runs of inside voxels along x, for whole layers of a grid.

    Attributes
    ----------
    offsets : (layers * ny + 1,) int64
        Row (j, k) is number ``(k - first_layer) * ny + j`` and has the runs
        ``offsets[number]`` to ``offsets[number + 1]``.
    start, stop : (runs,) int32
        Each run holds the voxels start <= i < stop; runs of a row rise and do not touch.
    open_rows
        Rows whose entries and exits do not pair up: the mesh is not closed.
    """

    offsets: IntArray
    start: IntArray
    stop: IntArray
    open_rows: int


@dataclass(frozen=True, eq=False)
class SlabTriangles:
    """What is needed of a mesh to make the layers first_layer <= k < last_layer.

    Attributes
    ----------
    shape
        Voxels along x, y, z of the whole grid.
    snapped : (n, 3) int64
        Vertices as y, z, x in lattice units of the grid.
    faces : (m, 3) int32
        Indices into `snapped`.
    members : (k,) int32
        The faces that reach into the slab.
    spans
        Layers of the slab that these cross in all.
    """

    shape: tuple[int, int, int]
    first_layer: int
    last_layer: int
    snapped: NDArray[np.int64]
    faces: NDArray[np.int32]
    members: NDArray[np.int32]
    spans: int

    def alone(self) -> "SlabTriangles":
        """Return the same without the faces and vertices that the slab does not need."""
        faces = self.faces[self.members]
        used, renumbered = np.unique(faces, return_inverse=True)
        return replace(
            self,
            snapped=self.snapped[used],
            faces=renumbered.reshape(-1, 3).astype(np.int32),
            members=np.arange(len(faces), dtype=np.int32),
        )


def slab_layers_for(grid: Grid) -> int:
    """Return how many layers to make at once: about 10^5 rows, a few MB."""
    return max(1, min(_SLAB_ROWS // grid.shape[1], grid.shape[2]))


def iterate_slabs(mesh: Mesh, grid: Grid, slab_layers: int) -> Iterator[SlabTriangles]:
    """Deal a mesh's triangles to slabs of layers, from the lowest up.

    Memory grows with the mesh, not with the number of slabs: triangles are kept while they reach
    into the slab at hand.

    Raises
    ------
    ArgumentError
        `slab_layers` is below 1.
    MeshError
        No faces; or a vertex is not finite, or more than 16384 voxels away from another.
    """
    ny, nz = grid.shape[1:]
    if slab_layers < 1:
        raise ArgumentError(f"slab_layers is {slab_layers}; it must be at least 1")
    check_reach(mesh, grid)
    snapped = snap(mesh.vertices, np.asarray(grid.origin_mm), np.asarray(grid.pitch_mm))
    snapped = np.ascontiguousarray(snapped[:, [1, 2, 0]])
    low, high = cover_rows(snapped, mesh.faces, ny, nz)
    rising = np.flatnonzero(low < high).astype(np.int32)
    rising = rising[np.argsort(low[rising], kind="stable")]
    begins, taken, members = low[rising], 0, rising[:0]
    for first in range(0, nz, slab_layers):
        last = min(first + slab_layers, nz)
        reached = int(np.searchsorted(begins, last))
        members = np.append(members[high[members] > first], rising[taken:reached])
        taken = reached
        crossed = np.minimum(high[members], last) - np.maximum(low[members], first)
        spans = int(crossed.sum(dtype=np.int64))
        yield SlabTriangles(grid.shape, first, last, snapped, mesh.faces, members, spans)


def runs_along_x(slab: SlabTriangles) -> LayerRuns:
    """Return the runs of one slab's layers."""
    nx, ny, _ = slab.shape
    triangles = (slab.snapped, slab.faces, slab.members, slab.spans)
    layers = (slab.first_layer, slab.last_layer)
    offsets, start, stop, faults = slab_runs(*triangles, *layers, ny, nx, 0, row_leads=True)
    return LayerRuns(offsets, start, stop, int(faults[0]))
