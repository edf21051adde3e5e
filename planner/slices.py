"""A plan as the printer's own layers: runs of voxels along each row, images, and their folder."""

import hashlib
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import (
    ArgumentError,
    FileError,
    OutputError,
    UnknownNameError,
    positive,
    refused,
)
from planner.formats.files import json_of, path_within
from planner.formats.outputs import check_target, new_folder
from planner.formats.png import NOTHING, ImageKind, encode_layer
from planner.formats.tables import encode_csv
from planner.glance import brief, channels, counted, one_line, outcome
from planner.mesh.mesh import Mesh, weld
from planner.numerics import FloatArray, IntArray, kernel
from planner.plan import PartGraded, Plan, Region, plan_file, read_plan, read_shells
from planner.printers import Printer, load_printer
from planner.voxels.columns import Grid, Slab, grid_for, iterate_slabs, paint

__all__ = ["Layer", "SliceStack", "iterate_layers", "write_slices"]


# The voxels are those of `planner.voxels.columns`, as runs along x, made layer by layer from the
# lowest up, so that a stack of images can be written while a few layers are held in memory.


# ------------------------------------------------------------------------------------------------
# A plan's shells, read back and placed on one grid of the printer's voxels.


_Pitch = float | Sequence[float] | None
"""Edges of a voxel along x, y, z, or one for all; the printer's own where there is none."""

_Slabs = Sequence[Slab]
"""The same layers of each shell."""

_UNKNOWN_COLOUR = "#808080"
_MOST_SHELLS = 255  # labels are bytes


@dataclass(frozen=True, eq=False)
class _ShellMesh:
    """One shell as its file holds it.

    Attributes
    ----------
    region
        One that the file holds: it names the file and its material.
    operator_name
        What the printer's own software calls the material.
    colour
        "#RRGGBB", as the plan's 3MF has it.
    """

    region: Region
    operator_name: str
    colour: str
    mesh: Mesh


@dataclass(frozen=True, eq=False)
class _PlanShells:
    """All shells of a plan on one grid, in the order of their files: from soft to hard."""

    plan: Plan
    plan_sha256: str
    printer: str
    shells: tuple[_ShellMesh, ...]
    grid: Grid


def _open_shells(
    path: str | Path | Plan, pitch_mm: _Pitch, printer: str | Printer | None
) -> _PlanShells:
    """Read the shells of a plan and verify that they are the ones it was written with.

    Parameters
    ----------
    path
        A plan.json, its folder, or the plan read from there.
    pitch_mm
        Edges of a voxel along x, y, z, or one for all; by default the printer's own.
    printer
        By default the plan's.

    Raises
    ------
    FileError
        No plan, or a shell that is missing or altered.
    UnknownNameError
        The printer is not installed, and there is no pitch to do without.
    ArgumentError
        A pitch that is none, or a grid too large for it.
    """
    file = plan_file(path)
    plan = read_plan(file)
    if pitch_mm is None and printer is None:
        pitch_mm = plan.voxel_mm
    machine = _machine(plan, printer, needed=pitch_mm is None)
    shells = tuple(_shells(file.parent, plan, machine))
    if not 0 < len(shells) <= _MOST_SHELLS:
        raise FileError(f"{file}: names {len(shells)} shells; 1 to {_MOST_SHELLS} can be sliced")
    lowest, highest = np.array([shell.mesh.bounds_mm for shell in shells]).swapaxes(0, 1)
    bounds_mm = np.array([lowest.min(axis=0), highest.max(axis=0)])
    if pitch_mm is None and machine is not None:
        pitch_mm = (*machine.pixel_mm, machine.layer_mm)
    grid = grid_for(bounds_mm, _pitch(pitch_mm, bounds_mm[1] - bounds_mm[0]))
    name = plan.printer if machine is None else machine.name
    return _PlanShells(plan, hashlib.sha256(file.read_bytes()).hexdigest(), name, shells, grid)


def _deal_slabs(shells: _PlanShells, slab_layers: int | None = None) -> Iterator[_Slabs]:
    """Deal the triangles of all shells to slabs of layers, from the lowest up."""
    dealt = (iterate_slabs(shell.mesh, shells.grid, slab_layers) for shell in shells.shells)
    return zip(*dealt, strict=True)


def _machine(plan: Plan, printer: str | Printer | None, *, needed: bool) -> Printer | None:
    if printer is not None:
        return load_printer(printer)
    try:
        return load_printer(plan.printer)
    except UnknownNameError as error:
        if needed:
            raise UnknownNameError(
                f"{error}; or give the size of a voxel with `pitch_mm`, or another printer with "
                "`printer`"
            ) from error
        return None


def _shells(root: Path, plan: Plan, machine: Printer | None) -> Iterator[_ShellMesh]:
    seen = {region.file: region for region in plan.regions}
    colours = _colours(root, plan, machine, {region.printed for region in seen.values()})
    for name, triangles in read_shells(plan):
        vertices, faces = weld(triangles.astype(np.float32))
        material = seen[name].printed
        called = material if machine is None else machine.operator_name(material)
        colour = colours.get(material, _UNKNOWN_COLOUR)
        yield _ShellMesh(seen[name], called, colour, Mesh(vertices.astype(np.float64), faces))


def _colours(root: Path, plan: Plan, machine: Printer | None, wanted: set[str]) -> dict[str, str]:
    """Return colours by material: those of the plan's palette, else of its 3MF, as far as known."""
    if machine is not None and plan.palette.name in machine.palettes:
        palette = machine.palette(plan.palette.name)
        colours = {material.id: material.colour for material in palette.materials}
        if palette.sha256 == plan.palette.sha256 and wanted <= set(colours):
            return colours
    file = path_within(root, f"{plan.name}.3mf")
    if not file.is_file():
        return {}
    from planner.formats.threemf import read_threemf

    return {each.material_name: each.colour for each in read_threemf(file).objects if each.colour}


_ROUNDING = 1e-3
"""Of a layer. Physical: what no printer tells; float32 in STL files takes less from a layer."""


def _pitch(pitch_mm: _Pitch, extent_mm: FloatArray) -> tuple[float, ...]:
    given: Any = pitch_mm if isinstance(pitch_mm, (list, tuple, np.ndarray)) else [pitch_mm]
    edges = tuple(positive(edge, "pitch in mm") for edge in given)
    if len(edges) not in (1, 3):
        raise ArgumentError(f"pitch: {len(edges)} lengths; give one in mm, or three: x, y, z")
    whole = edges if len(edges) == 3 else 3 * edges
    for axis, edge, extent in zip("xyz", whole, extent_mm.tolist(), strict=True):
        if edge > (1.0 + _ROUNDING) * extent:
            micrometres = ",".join(f"{p / 1000.0:g}" for p in whole)
            hint = f"; did you mean {micrometres} mm?" if 1.0 <= edge <= 500.0 * extent else ""
            raise ArgumentError(
                f"pitch along {axis} is {edge:g} mm, more than the part's {extent:.6g} mm{hint}"
            )
    return whole


# ------------------------------------------------------------------------------------------------
# The runs of several shells as one set of runs with a material each.


_Runs = tuple[IntArray, IntArray, IntArray, IntArray]
"""Runs along x of whole layers: offsets, start and stop, as of `Slab.runs`, and labels (runs,)
int32, n + 1 of shell n."""


def _join_shells(shells: _Slabs) -> tuple[_Runs, NDArray[np.int64], int, int]:
    """Join the runs that shells have in the same layers.

    Returns
    -------
    runs, voxels, overlapping, open_rows
        Each voxel is drawn once; the others are those of `_SlabImages`.
    """
    ny, each = shells[0].shape[0], [shell.runs(row_leads=True) for shell in shells]
    own_offsets, starts, stops, open_rows = zip(*each, strict=True)
    rows = len(own_offsets[0]) - 1
    before = np.cumsum([0, *map(len, starts)])
    offsets = np.stack([own + n for own, n in zip(own_offsets, before, strict=False)])
    start, stop = np.concatenate(starts), np.concatenate(stops)
    joined = np.empty((3, len(start)), np.int32)  # start, stop and label of each
    new_offsets = np.zeros(rows + 1, np.int64)
    voxels = np.zeros((rows // ny, len(shells)), np.int64)
    place = offsets[:, 0].copy()
    made = (new_offsets, *joined, voxels)
    runs, overlapping = _join(offsets, start, stop, ny, place, *made)
    return (new_offsets, *joined[:, :runs]), voxels, int(overlapping), sum(open_rows)


@kernel
def _join(
    offsets: Any, start: Any, stop: Any, ny: Any, place: Any, new_offsets: Any, new_start: Any,
    new_stop: Any, label: Any, voxels: Any,
) -> Any:  # fmt: skip
    runs, overlapping = np.int64(0), np.int64(0)
    for r in range(new_offsets.size - 1):
        done = np.int32(0)  # voxels below are drawn
        while True:
            shell = -1
            for s in range(offsets.shape[0]):
                if place[s] < offsets[s, r + 1] and (
                    shell < 0 or start[place[s]] < start[place[shell]]
                ):
                    shell = s
            if shell < 0:
                break
            low, high = start[place[shell]], stop[place[shell]]
            place[shell] += 1
            overlapping += max(min(done, high) - low, 0)
            low = max(low, done)
            if low < high:
                new_start[runs], new_stop[runs], label[runs] = low, high, shell + 1
                voxels[r // ny, shell] += high - low
                runs += 1
                done = high
        new_offsets[r + 1] = runs
    return runs, overlapping


# ------------------------------------------------------------------------------------------------
# A slab of layers: what is needed to make it, and what comes out; nothing is shared with others.
#
# This is what a cluster's workers run, so that a slab can be made anywhere.


@dataclass(frozen=True, eq=False)
class _SlabImages:
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


def _make_slab(kind: ImageKind, shells: _Slabs) -> _SlabImages:
    """Make the images of a slab: the triangles of each shell there, and how images look."""
    ny, _, nx = shells[0].shape
    runs, voxels, overlapping, open_rows = _join_shells(shells)
    rows = range(0, len(runs[0]) - 1, ny)
    images = tuple(encode_layer(runs, (row, row + ny), nx, kind) for row in rows)
    return _SlabImages(shells[0].first, images, voxels, overlapping, open_rows)


# ------------------------------------------------------------------------------------------------
# Layers of a plan as arrays, for scripts that work on voxels.


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

    __repr__ = brief


def iterate_layers(
    plan: str | Path | Plan, *, pitch_mm: _Pitch = None, printer: str | Printer | None = None
) -> Iterator[Layer]:
    """Make the layers of a plan's folder, from the lowest up; a few are in memory at a time.

    Parameters
    ----------
    plan
        A plan.json, its folder, or the plan read from there.
    pitch_mm, printer
        Edges of a voxel along x, y, z; by default those of the printer, which is by default the
        plan's.

    Yields
    ------
    Layer
        With the label of every voxel: 0 for nothing, else the place of its material from 1.

    Raises
    ------
    PlannerError
        No plan, or a shell that is missing or altered; no such printer; a pitch that is none.

    Examples
    --------
    >>> layer = next(planner.iterate_layers("finger-graded", pitch_mm=1.0))  # doctest: +SKIP
    >>> layer.label.shape  # doctest: +SKIP
    (16, 97)
    """
    source = _open_shells(plan, pitch_mm, printer)
    grid, materials = source.grid, tuple(shell.region.printed for shell in source.shells)
    nx, ny, _ = grid.shape
    for slab in _deal_slabs(source):
        (offsets, start, stop, material), *_ = _join_shells(slab)
        for index in range(slab[0].first, slab[0].last):
            label = np.zeros((ny, nx), np.uint8)
            first = (index - slab[0].first) * ny
            paint(offsets[first : first + ny + 1], start, stop, material, label)
            z_mm = grid.origin_mm[2] + (index + 0.5) * grid.pitch_mm[2]
            yield Layer(index, z_mm, label, materials)


# ------------------------------------------------------------------------------------------------
# A stack of layers as written: what of each material is where, and the files that say so.


_RECORD = "slices.json"
"""The folder of a stack."""


def _layer_file(index: int) -> str:
    """Return the name of a layer's image."""
    return f"layer_{index:05d}.png"


@dataclass(frozen=True, slots=True)
class _SlicedMaterial:
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
    rgba: tuple[int, int, int, int]
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
    materials: tuple[_SlicedMaterial, ...]
    voxels: NDArray[np.int64]
    overlapping: int
    open_rows: int

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.part.name}: {counted(self.grid.shape[2], 'layer')} of {self.grid.shape[0]} x "
            f"{self.grid.shape[1]} voxels, {counted(len(self.materials), 'material')}; "
            + outcome((len(self.findings), "finding"))
        )

    @property
    def findings(self) -> tuple[str, ...]:
        """What is wrong with the plan's shells, in words."""
        counts = {
            "voxels lie in more than one shell; each is drawn once": self.overlapping,
            "rows of voxels enter a shell that they do not leave": self.open_rows,
        }
        return tuple(f"{n} {why}: run planner check on the plan" for why, n in counts.items() if n)

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
        part = {name: getattr(self.part, name) for name in ("name", "file", "sha256")}
        axes = {"column": "x", "row": "y", "layer": "z"}
        pixels = "indexed" if self.indexed else "rgba"
        return {
            "schema": 1,
            "version": self.version,
            "printer": self.printer,
            "plan": {"sha256": self.plan_sha256},
            "part": part | {"translation_mm": list(self.part.translation_mm)},
            "grid": asdict(self.grid),
            "images": {"pixels": pixels, **axes, "nothing": list(NOTHING)},
            "materials": [
                {"label": label, **asdict(each)} for label, each in enumerate(self.materials, 1)
            ],
            "overlapping_voxels": self.overlapping,
            "open_rows": self.open_rows,
            "layers": "layers.csv",
            "files": list(self.files),
        }

    json = json_of

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


def _make_slabs_on(
    scheduler: str, kind: ImageKind, slabs: Iterator[_Slabs]
) -> Iterator[_SlabImages]:
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
    from planner import __version__

    if not re.fullmatch(r"(tcp|tls|ws|wss)://[^\s:/]+:\d+", str(scheduler)):
        raise ArgumentError(
            f"`scheduler` {scheduler}: is no address of a scheduler; give what dask scheduler "
            "prints, as tcp://127.0.0.1:8786"
        )
    missing = "Dask is not installed ({}); pip install distributed, or leave `scheduler` out"
    with refused(ArgumentError, f"`scheduler` {scheduler}", missing, ImportError):
        distributed: Any = import_module("distributed")
        dask: Any = import_module("dask")
    with dask.config.set({_LARGE_TASK: "1GiB"}), _client(distributed, scheduler) as client:
        threads = _threads(client, scheduler)
        alone = ([shell.alone() for shell in shells] for shells in slabs)
        made = partial(client.submit, _make_elsewhere, kind, version=__version__, pure=False)
        submitted = map(made, alone)
        waiting = set(islice(submitted, _SLABS_A_THREAD * threads))
        while waiting:
            finished = _some_of(distributed, client, waiting, scheduler)
            waiting -= finished
            for future in finished:
                slab = _result(distributed, future, scheduler)
                waiting |= set(islice(submitted, 1))
                yield slab


def _client(distributed: Any, scheduler: str) -> Any:
    silent = f"no scheduler answers there within {_CONNECT_S} s; give the address that dask"
    with refused(ArgumentError, f"`scheduler` {scheduler}", f"{silent} scheduler prints", OSError):
        return distributed.Client(scheduler, timeout=_CONNECT_S, set_as_default=False)


def _threads(client: Any, scheduler: str) -> int:
    none = f"has no workers; start some: dask worker {scheduler}"
    with refused(ArgumentError, f"`scheduler` {scheduler}", none, TimeoutError):
        client.wait_for_workers(1, timeout=_CONNECT_S)
    return max(1, int(sum(client.nthreads().values())))


def _make_elsewhere(kind: ImageKind, shells: _Slabs, version: str) -> _SlabImages:
    """Make a slab, if this is the planner that asked: another might choose other voxels."""
    from planner import __version__

    if version != __version__:
        raise ArgumentError(
            f"a worker has planner {__version__}, not {version}; install planner {version} there"
        )
    return _make_slab(kind, shells)


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


def _result(distributed: Any, future: Any, scheduler: str) -> _SlabImages:
    place = f"`scheduler` {scheduler}"
    strange = "its workers cannot import what they need ({}); install planner there"
    killed = "several workers died over one slab; give them more memory"
    with (
        refused(ArgumentError, place, strange, ImportError),
        refused(OutputError, place, killed, distributed.KilledWorker),
    ):
        slab: _SlabImages = future.result()
    return slab


# ------------------------------------------------------------------------------------------------
# One colour a material, told apart by eye and by program.


_LEAST_DISTANCE = 8.0
"""Between two colours of a stack, in 8-bit steps of red, green and blue together."""

_SPARE = np.stack(np.meshgrid(*[np.arange(0, 256, 17)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def _distinct_colours(wished: Sequence[str]) -> tuple[tuple[int, int, int, int], ...]:
    """Return the wished colours, opaque; those that look like an earlier one are replaced.

    A replacement is the spare colour farthest from all wished and given ones, so the result
    depends on the wishes alone.

    Parameters
    ----------
    wished
        "#RRGGBB" by material.
    """
    wishes = np.array([channels(colour) for colour in wished])
    spare = np.min([_squares(_SPARE, wish) for wish in wishes], axis=0)
    given: list[IntArray] = []
    for wish in wishes:
        is_like = any(_squares(wish, other) < _LEAST_DISTANCE**2 for other in given)
        colour = _SPARE[np.argmax(spare)] if is_like else wish
        given.append(colour)
        spare = np.minimum(spare, _squares(_SPARE, colour))
    return tuple((int(red), int(green), int(blue), 255) for red, green, blue in given)


def _squares(colours: IntArray, other: IntArray) -> IntArray:
    return np.asarray(((colours - other) ** 2).sum(axis=-1))


# ------------------------------------------------------------------------------------------------
# planner.write_slices: a plan's folder to a stack of images, one a layer of the printer.


def write_slices(
    plan: str | Path | Plan,
    output: str | Path,
    *,
    pitch_mm: _Pitch = None,
    indexed: bool = False,
    printer: str | Printer | None = None,
    scheduler: str | None = None,
    slab_layers: int | None = None,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
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
        As of `iterate_layers`; a folder that may not be written; a cluster that cannot be used.

    Examples
    --------
    >>> planner.write_slices("finger-graded", "finger-slices", pitch_mm=0.1).ok  # doctest: +SKIP
    True
    """
    from planner import __version__

    check_target(output, force=force, record=_RECORD)
    if slab_layers is not None and (not isinstance(slab_layers, int) or slab_layers < 1):
        raise ArgumentError(f"slab_layers is {slab_layers}; it must be a whole number from 1 up")
    if Path(output).resolve().is_relative_to(plan_file(plan).resolve().parent):
        raise OutputError(
            f"{output}: lies in the plan's own folder, which would then no longer be sound; name "
            "another folder with `output`"
        )
    tell = progress or (lambda done, of: None)
    source = _open_shells(plan, pitch_mm, printer)
    colours = _distinct_colours([shell.colour for shell in source.shells])
    kind = ImageKind(colours, indexed, source.grid.pitch_mm[:2])
    dealt = _deal_slabs(source, slab_layers)
    make = partial(_make_slab, kind)
    slabs = map(make, dealt) if scheduler is None else _make_slabs_on(scheduler, kind, dealt)
    layers = source.grid.shape[2]
    voxels = np.zeros((layers, len(source.shells)), np.int64)
    overlapping = open_rows = done = 0
    with new_folder(output, force=force, record=_RECORD) as scratch:
        for slab in slabs:
            for index, image in enumerate(slab.images, slab.first_layer):
                (scratch / _layer_file(index)).write_bytes(image)
            voxels[slab.first_layer : slab.first_layer + len(slab.images)] = slab.voxels
            overlapping += slab.overlapping
            open_rows += slab.open_rows
            done += len(slab.images)
            tell(done, layers)
        totals = voxels.sum(axis=0).tolist()
        stack = SliceStack(
            version=__version__,
            printer=source.printer,
            plan_sha256=source.plan_sha256,
            part=source.plan.part,
            grid=source.grid,
            indexed=indexed,
            materials=tuple(
                _SlicedMaterial(
                    *(shell.region.printed, shell.operator_name, rgba, shell.region.file),
                    *(shell.region.sha256, count, count * source.grid.voxel_mm3),
                )
                for shell, rgba, count in zip(source.shells, colours, totals, strict=True)
            ),
            voxels=voxels,
            overlapping=overlapping,
            open_rows=open_rows,
        )
        (scratch / "layers.csv").write_bytes(stack.csv())
        (scratch / _RECORD).write_bytes(stack.json())
    return stack
