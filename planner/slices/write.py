"""A stack of layer images written to a folder, on this machine or on a cluster."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, OutputError, PlannerError
from planner.formats.files import encode_document
from planner.formats.outputs import check_target, new_folder
from planner.formats.png import NOTHING, ImageKind, Rgba, distinct_colours
from planner.formats.tables import encode_csv
from planner.glance import counted, one_line, outcome
from planner.plan import PartGraded, Plan, plan_file
from planner.printers import Printer
from planner.slices.slices import (
    PlanShells,
    SlabImages,
    SlabTask,
    deal_slabs,
    make_slab,
    open_shells,
)
from planner.voxels.columns import Grid

__all__ = ["SliceStack", "write_slices"]


# ------------------------------------------------------------------------------------------------
# A stack of layers as written: what of each material is where, and the files that say so.


_RECORD = "slices.json"
"""The folder of a stack."""


def _layer_file(index: int) -> str:
    """Return the name of a layer's image."""
    return f"layer_{index:05d}.png"


@dataclass(frozen=True, slots=True)
class SlicedMaterial:
    """What of a stack is one material.

    Attributes
    ----------
    rgba
        Its pixels' colour, which no other material has.
    file, sha256
        The shell that it was made from.
    """

    material: str
    operator_name: str
    rgba: Rgba
    file: str
    sha256: str
    voxels: int
    volume_mm3: float


@dataclass(frozen=True, eq=False)
class SliceStack:
    """The content of slices.json and layers.csv.

    Attributes
    ----------
    voxels : (layers, materials) int64
        Voxels of each material by layer.
    overlapping
        Voxels that lie in more than one shell; each was drawn once.
    open_rows
        Rows of voxels that enter a shell and do not leave it.
    """

    version: str
    printer: str
    plan_sha256: str
    part: PartGraded
    grid: Grid
    indexed: bool
    materials: tuple[SlicedMaterial, ...]
    voxels: NDArray[np.int64]
    overlapping: int
    open_rows: int

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.part.name}: {counted(self.grid.shape[2], 'layer')} of "
            f"{self.grid.shape[0]} x {self.grid.shape[1]} voxels, "
            f"{counted(len(self.materials), 'material')}; "
            + outcome((len(self.findings), "finding"))
        )

    @property
    def findings(self) -> tuple[str, ...]:
        """What is wrong with the plan's shells, in words."""
        found = []
        if self.overlapping:
            found.append(
                f"{self.overlapping} voxels lie in more than one shell; each is drawn once"
            )
        if self.open_rows:
            found.append(f"{self.open_rows} rows of voxels enter a shell that they do not leave")
        return tuple(f"{text}: run planner check on the plan" for text in found)

    @property
    def ok(self) -> bool:
        """Whether every voxel lies in one shell or in none."""
        return not self.findings

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the images, from the lowest layer up."""
        return tuple(_layer_file(index) for index in range(self.grid.shape[2]))

    def document(self) -> dict[str, Any]:
        """Return the stack as slices.json holds it."""
        return {
            "schema": 1,
            "version": self.version,
            "printer": self.printer,
            "plan": {"sha256": self.plan_sha256},
            "part": {
                "name": self.part.name,
                "file": self.part.file,
                "sha256": self.part.sha256,
                "translation_mm": list(self.part.translation_mm),
            },
            "grid": {
                "origin_mm": list(self.grid.origin_mm),
                "pitch_mm": list(self.grid.pitch_mm),
                "shape": list(self.grid.shape),
            },
            "images": {
                "pixels": "indexed" if self.indexed else "rgba",
                "column": "x",
                "row": "y",
                "layer": "z",
                "nothing": list(NOTHING),
            },
            "materials": [
                {
                    "label": label,
                    "material": each.material,
                    "operator_name": each.operator_name,
                    "rgba": list(each.rgba),
                    "file": each.file,
                    "sha256": each.sha256,
                    "voxels": each.voxels,
                    "volume_mm3": each.volume_mm3,
                }
                for label, each in enumerate(self.materials, 1)
            ],
            "overlapping_voxels": self.overlapping,
            "open_rows": self.open_rows,
            "layers": "layers.csv",
            "files": list(self.files),
        }

    def json(self) -> bytes:
        """Return the bytes of slices.json."""
        return encode_document(self.document())

    def csv(self) -> bytes:
        """Return the bytes of layers.csv."""
        bottom_mm, edge_mm = self.grid.origin_mm[2], self.grid.pitch_mm[2]
        rows = (
            [index, bottom_mm + (index + 0.5) * edge_mm, *counts]
            for index, counts in enumerate(self.voxels.tolist())
        )
        return encode_csv([["layer", "z_mm", *(m.material for m in self.materials)], *rows])


# ------------------------------------------------------------------------------------------------
# Slabs made by the workers of a Dask cluster, which need share no disk with this machine.


_CONNECT_S, _SILENCE_S = 10, 30
_SLABS_A_THREAD = 2  # in flight: one is made while the next is on its way
_LARGE_TASK = "distributed.admin.large-graph-warning-threshold"


def _make_slabs_on(scheduler: str, tasks: Iterator[SlabTask]) -> Iterator[SlabImages]:
    """Make slabs on a cluster, and yield them as they come.

    A slab carries its triangles there and its images back. When a worker dies, what it had is
    made again by another.

    Parameters
    ----------
    scheduler
        Its address, ``tcp://HOST:PORT``.

    Raises
    ------
    ArgumentError
        No address; Dask is not installed here, or planner not there; nothing answers, or has no
        workers.
    OutputError
        The cluster lost all its workers, or several over one slab.
    """
    if not isinstance(scheduler, str) or not re.fullmatch(
        r"(tcp|tls|ws|wss)://[^\s:/]+:\d+", scheduler
    ):
        raise ArgumentError(
            f"`scheduler` {scheduler}: is no address of a scheduler; give what dask scheduler "
            "prints, as tcp://127.0.0.1:8786"
        )
    try:
        distributed: Any = import_module("distributed")
        dask: Any = import_module("dask")
    except ImportError as error:
        raise ArgumentError(
            f"`scheduler` {scheduler}: Dask is not installed ({error}); "
            "pip install distributed, or leave `scheduler` out"
        ) from error
    with dask.config.set({_LARGE_TASK: "1GiB"}), _client(distributed, scheduler) as client:
        threads = _threads(client, scheduler)
        submitted = _submit(client, tasks)
        waiting = set(islice(submitted, _SLABS_A_THREAD * threads))
        while waiting:
            finished = _some_of(distributed, client, waiting, scheduler)
            waiting -= finished
            for future in finished:
                slab = _result(distributed, future, scheduler)
                waiting |= set(islice(submitted, 1))
                yield slab


def _client(distributed: Any, scheduler: str) -> Any:
    try:
        return distributed.Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
    except OSError as error:  # TimeoutError is one
        raise ArgumentError(
            f"`scheduler` {scheduler}: no scheduler answers there within {_CONNECT_S} s; give the "
            "address that dask scheduler prints"
        ) from error


def _threads(client: Any, scheduler: str) -> int:
    try:
        client.wait_for_workers(1, timeout=_CONNECT_S)
    except TimeoutError as error:
        raise ArgumentError(
            f"`scheduler` {scheduler}: has no workers; start some: dask worker {scheduler}"
        ) from error
    return max(1, int(sum(client.nthreads().values())))


def _submit(client: Any, tasks: Iterator[SlabTask]) -> Iterator[Any]:
    from planner import __version__

    for task in tasks:
        yield client.submit(_make_elsewhere, task.alone(), __version__, pure=False)


def _make_elsewhere(task: SlabTask, version: str) -> SlabImages:
    """Make a slab, if this is the planner that asked: another might choose other voxels."""
    from planner import __version__

    if version != __version__:
        raise ArgumentError(
            f"a worker has planner {__version__}, not {version}; install planner {version} there"
        )
    return make_slab(task)


def _some_of(distributed: Any, client: Any, waiting: set[Any], scheduler: str) -> set[Any]:
    """Wait for some of the slabs for as long as there are workers."""
    while True:
        try:
            with client.as_current():
                some = distributed.wait(waiting, _SILENCE_S, return_when="FIRST_COMPLETED")
            return set(some.done)
        except TimeoutError as error:
            if not client.nthreads():
                raise OutputError(
                    f"`scheduler` {scheduler}: all its workers are gone; start some again"
                ) from error


def _result(distributed: Any, future: Any, scheduler: str) -> SlabImages:
    try:
        slab: SlabImages = future.result()
    except PlannerError:
        raise
    except ImportError as error:
        raise ArgumentError(
            f"`scheduler` {scheduler}: its workers cannot import what they need ({error}); install "
            "planner there"
        ) from error
    except distributed.KilledWorker as error:
        raise OutputError(
            f"`scheduler` {scheduler}: several workers died over one slab; give them more memory"
        ) from error
    return slab


# ------------------------------------------------------------------------------------------------
# planner.write_slices: a plan's folder to a stack of images, one a layer of the printer.


def write_slices(
    plan: str | Path | Plan,
    output: str | Path,
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
        A plan.json, its folder, or the plan read from there.
    output
        Folder to write: ``layer_00000.png`` and so on, ``slices.json`` and ``layers.csv``.
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

    Returns
    -------
    SliceStack
        What was written; `SliceStack.ok` is false where the plan's shells overlap or are open.

    Raises
    ------
    PlannerError
        Bad input, see `planner.slices.slices.open_shells`; a folder that may not be written; a
        cluster that cannot be used.

    Examples
    --------
    >>> planner.write_slices("finger-graded", "finger-slices", pitch_mm=0.1).ok  # doctest: +SKIP
    True
    """
    check_target(output, force=force, record=_RECORD)
    if slab_layers is not None and (not isinstance(slab_layers, int) or slab_layers < 1):
        raise ArgumentError(f"slab_layers is {slab_layers}; it must be a whole number from 1 up")
    if Path(output).resolve().is_relative_to(plan_file(plan).resolve().parent):
        raise OutputError(
            f"{output}: lies in the plan's own folder, which would then no longer be sound; name "
            "another folder with `output`"
        )
    source = open_shells(plan, pitch_mm=pitch_mm, printer=printer)
    edges_mm = source.grid.pitch_mm
    colours = distinct_colours([shell.colour for shell in source.shells])
    kind = ImageKind(colours, indexed, (edges_mm[0], edges_mm[1]))
    tasks = (SlabTask(slab, kind) for slab in deal_slabs(source, slab_layers))
    layers = source.grid.shape[2]
    voxels = np.zeros((layers, len(source.shells)), np.int64)
    overlapping = open_rows = done = 0
    with new_folder(output, force=force, record=_RECORD) as scratch:
        for slab in _made(tasks, scheduler):
            for index, image in enumerate(slab.images, slab.first_layer):
                (scratch / _layer_file(index)).write_bytes(image)
            voxels[slab.first_layer : slab.first_layer + len(slab.images)] = slab.voxels
            overlapping += slab.overlapping
            open_rows += slab.open_rows
            done += len(slab.images)
            progress(done, layers)
        stack = _stack(source, kind, voxels, overlapping, open_rows)
        (scratch / "layers.csv").write_bytes(stack.csv())
        (scratch / _RECORD).write_bytes(stack.json())
    return stack


def _made(tasks: Iterator[SlabTask], scheduler: str | None) -> Iterator[SlabImages]:
    if scheduler is None:
        return map(make_slab, tasks)

    return _make_slabs_on(scheduler, tasks)


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
