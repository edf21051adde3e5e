"""Layers of a plan as arrays, for scripts that work on voxels."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planner.printers import Printer
from planner.slices.material_runs import paint
from planner.slices.slab import slab_runs_of
from planner.slices.source import deal_slabs, open_shells

__all__ = ["Layer", "iterate_layers"]


@dataclass(frozen=True, eq=False)
class Layer:
    """One layer of voxels.

    Attributes
    ----------
    index, z_mm
        Number from the lowest up, and height of the voxels' centres.
    label : (ny, nx) uint8
        0 where nothing is printed, n where ``materials[n - 1]`` is; row j is voxel j along y.
    materials
        Ids, from soft to hard.
    """

    index: int
    z_mm: float
    label: NDArray[np.uint8]
    materials: tuple[str, ...]


def iterate_layers(
    plan: str | Path,
    *,
    pitch_mm: float | Sequence[float] | None = None,
    printer: str | Printer | None = None,
) -> Iterator[Layer]:
    """Make the layers of a plan's folder, from the lowest up; a few are in memory at a time.

    Parameters
    ----------
    plan
        A plan.json, or its folder.
    pitch_mm, printer
        Edges of a voxel along x, y, z; by default those of the printer, which is by default the
        plan's.

    Raises
    ------
    PlannerError
        See `planner.slices.source.open_shells`.
    """
    source = open_shells(plan, pitch_mm=pitch_mm, printer=printer)
    grid, materials = source.grid, tuple(shell.material for shell in source.shells)
    nx, ny, _ = grid.shape
    for slab in deal_slabs(source):
        runs, _ = slab_runs_of(slab)
        for index in range(slab[0].first_layer, slab[0].last_layer):
            label = np.zeros((ny, nx), np.uint8)
            first = (index - slab[0].first_layer) * ny
            paint(runs.offsets, runs.start, runs.stop, runs.label, first, label)
            z_mm = grid.origin_mm[2] + (index + 0.5) * grid.pitch_mm[2]
            yield Layer(index, z_mm, label, materials)
