"""planner.write_slices: a plan's folder to a stack of images, one a layer of the printer."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from planner.errors import ArgumentError, OutputError
from planner.formats.folder import check_target, new_folder
from planner.plan import plan_file
from planner.printers import Printer
from planner.slices.colours import distinct_colours
from planner.slices.layer_image import ImageKind
from planner.slices.slab import SlabImages, SlabTask, make_slab
from planner.slices.source import PlanShells, deal_slabs, open_shells
from planner.slices.stack import SLICES, SlicedMaterial, SliceStack, layer_file

__all__ = ["write_slices"]


def write_slices(
    plan: str | Path,
    folder: str | Path,
    *,
    pitch_mm: float | Sequence[float] | None = None,
    indexed: bool = False,
    printer: str | Printer | None = None,
    scheduler: str | None = None,
    slab_layers: int | None = None,
    force: bool = False,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> SliceStack:
    """Write a plan as the printer's own layers: one PNG a layer, one colour a material.

    A voxel belongs to the shell that holds its centre. Memory holds a few layers, however many
    there are. The folder is whole or absent, and the same plan and options give the same bytes.

    Parameters
    ----------
    plan
        A plan.json, or its folder.
    folder
        What to write: ``layer_00000.png`` and so on, ``slices.json`` and ``layers.csv``.
    pitch_mm
        Edges of a voxel along x, y, z, or one for all; by default the printer's own.
    indexed
        Write palette images, which are smaller, in the same colours.
    printer
        By default the plan's.
    scheduler
        Address of a Dask scheduler, ``tcp://HOST:PORT``, whose workers make the layers.
    slab_layers
        Layers made at once; by default about 10^5 rows of voxels. The result is the same.
    force
        Replace an earlier stack in that place.
    progress
        Called with the number of layers done, and of all.

    Raises
    ------
    PlannerError
        Bad input, see `planner.slices.source.open_shells`; a folder that may not be written; a
        cluster that cannot be used.
    """
    target = check_target(folder, force=force, kind=SLICES)
    if slab_layers is not None and (not isinstance(slab_layers, int) or slab_layers < 1):
        raise ArgumentError(f"slab_layers is {slab_layers}; it must be a whole number from 1 up")
    if target.is_relative_to(plan_file(plan).resolve().parent):
        raise OutputError(
            f"{folder}: lies in the plan's own folder, which would then no longer be sound; name "
            "another folder with --output"
        )
    source = open_shells(plan, pitch_mm=pitch_mm, printer=printer)
    edges_mm = source.grid.pitch_mm
    colours = distinct_colours([shell.colour for shell in source.shells])
    kind = ImageKind(colours, indexed, (edges_mm[0], edges_mm[1]))
    tasks = (SlabTask(slab, kind) for slab in deal_slabs(source, slab_layers))
    layers = source.grid.shape[2]
    voxels = np.zeros((layers, len(source.shells)), np.int64)
    overlapping = open_rows = done = 0
    with new_folder(folder, force=force, kind=SLICES) as scratch:
        for slab in _made(tasks, scheduler):
            for index, image in enumerate(slab.images, slab.first_layer):
                (scratch / layer_file(index)).write_bytes(image)
            voxels[slab.first_layer : slab.first_layer + len(slab.images)] = slab.voxels
            overlapping += slab.overlapping
            open_rows += slab.open_rows
            done += len(slab.images)
            progress(done, layers)
        stack = _stack(source, kind, voxels, overlapping, open_rows)
        (scratch / "layers.csv").write_bytes(stack.csv())
        (scratch / "slices.json").write_bytes(stack.json())
    return stack


def _made(tasks: Iterator[SlabTask], scheduler: str | None) -> Iterator[SlabImages]:
    if scheduler is None:
        return map(make_slab, tasks)
    from planner.slices.cluster import make_slabs_on

    return make_slabs_on(scheduler, tasks)


def _stack(
    source: PlanShells,
    kind: ImageKind,
    voxels: np.ndarray[tuple[int, int], np.dtype[np.int64]],
    overlapping: int,
    open_rows: int,
) -> SliceStack:
    from planner import __version__

    totals = voxels.sum(axis=0).tolist()
    return SliceStack(
        version=__version__,
        printer=source.printer,
        plan_sha256=source.plan_sha256,
        part=source.plan.part,
        grid=source.grid,
        indexed=kind.indexed,
        materials=tuple(
            SlicedMaterial(
                *(shell.material, shell.operator_name, rgba, shell.file, shell.sha256),
                *(count, count * source.grid.voxel_mm3),
            )
            for shell, rgba, count in zip(source.shells, kind.colours, totals, strict=True)
        ),
        voxels=voxels,
        overlapping=overlapping,
        open_rows=open_rows,
    )
