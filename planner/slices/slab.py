"""A slab of layers: what is needed to make it, and what comes out; nothing is shared with others.

This is what a cluster's workers run, so that a slab can be made anywhere.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.geometry.layer_runs import SlabTriangles, runs_along_x
from planner.slices.layer_image import ImageKind, encode_layer
from planner.slices.material_runs import MaterialRuns, join_shells

__all__ = ["SlabImages", "SlabTask", "make_slab", "slab_runs_of"]


@dataclass(frozen=True, eq=False)
class SlabTask:
    """Some layers to be made: the triangles of each shell there, and how images look."""

    shells: tuple[SlabTriangles, ...]
    kind: ImageKind

    def alone(self) -> "SlabTask":
        """Return the same with no more of the shells than it needs, to be sent elsewhere."""
        return replace(self, shells=tuple(shell.alone() for shell in self.shells))


@dataclass(frozen=True, eq=False)
class SlabImages:
    """Some layers as made.

    Attributes
    ----------
    images
        PNG files, from `first_layer` up.
    voxels : (layers, shells) int64
        Voxels of each shell by layer.
    overlapping
        Voxels in more than one shell.
    open_rows
        Rows in which a shell's entries and exits do not pair up.
    """

    first_layer: int
    images: tuple[bytes, ...]
    voxels: NDArray[np.int64]
    overlapping: int
    open_rows: int


def slab_runs_of(shells: tuple[SlabTriangles, ...]) -> tuple[MaterialRuns, int]:
    """Return the runs of some layers with their materials, and the open rows among them."""
    runs = [runs_along_x(shell) for shell in shells]
    return join_shells(runs, shells[0].shape[1]), sum(each.open_rows for each in runs)


def make_slab(task: SlabTask) -> SlabImages:
    """Make the images of a slab."""
    nx, ny, _ = task.shells[0].shape
    runs, open_rows = slab_runs_of(task.shells)
    images = tuple(
        encode_layer(
            *(runs.offsets, runs.start, runs.stop, runs.label),
            *((row, row + ny), nx, task.kind),
        )
        for row in range(0, len(runs.offsets) - 1, ny)
    )
    first = task.shells[0].first_layer
    return SlabImages(first, images, runs.voxels, runs.overlapping, open_rows)
