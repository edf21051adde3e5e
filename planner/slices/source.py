"""A plan's shells, read back and placed on one grid of the printer's voxels."""

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import ArgumentError, FileError, UnknownNameError
from planner.formats.stl import decode_stl
from planner.geometry.columns import Grid, grid_for
from planner.geometry.layer_runs import SlabTriangles, iterate_slabs, slab_layers_for
from planner.geometry.mesh import Mesh
from planner.geometry.weld import weld
from planner.plan import Plan, Region, plan_file, read_plan
from planner.printers import Printer
from planner.printers import printer as load_printer

__all__ = ["PlanShells", "ShellMesh", "deal_slabs", "open_shells"]

_UNKNOWN_COLOUR = "#808080"
_MOST_SHELLS = 255  # labels are bytes


@dataclass(frozen=True, eq=False)
class ShellMesh:
    """One shell as its file holds it.

    Attributes
    ----------
    material, operator_name
        The material's id, and what the printer's own software calls it.
    colour
        "#RRGGBB", as the plan's 3MF has it.
    """

    material: str
    operator_name: str
    colour: str
    file: str
    sha256: str
    mesh: Mesh


@dataclass(frozen=True, eq=False)
class PlanShells:
    """All shells of a plan on one grid, in the order of their files: from soft to hard."""

    plan: Plan
    plan_sha256: str
    printer: str
    shells: tuple[ShellMesh, ...]
    grid: Grid


def open_shells(
    path: str | Path,
    *,
    pitch_mm: float | Sequence[float] | None = None,
    printer: str | Printer | None = None,
) -> PlanShells:
    """Read the shells of a plan and verify that they are the ones it was written with.

    Parameters
    ----------
    path
        A plan.json, or its folder.
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
    machine = _machine(plan, printer, needed=pitch_mm is None)
    shells = tuple(_shells(file.parent, plan, machine))
    if not 0 < len(shells) <= _MOST_SHELLS:
        raise FileError(f"{file}: names {len(shells)} shells; 1 to {_MOST_SHELLS} can be sliced")
    bounds_mm = np.array(
        [
            np.min([shell.mesh.bounds_mm[0] for shell in shells], axis=0),
            np.max([shell.mesh.bounds_mm[1] for shell in shells], axis=0),
        ]
    )
    if pitch_mm is None and machine is not None:
        pitch_mm = (*machine.pixel_mm, machine.layer_mm)
    edges_mm = _pitch(pitch_mm, bounds_mm[1] - bounds_mm[0])
    return PlanShells(
        plan,
        hashlib.sha256(file.read_bytes()).hexdigest(),
        plan.printer if machine is None else machine.name,
        shells,
        grid_for(bounds_mm, edges_mm),
    )


def deal_slabs(
    shells: PlanShells, slab_layers: int | None = None
) -> Iterator[tuple[SlabTriangles, ...]]:
    """Deal the triangles of all shells to slabs of layers, from the lowest up."""
    layers = slab_layers_for(shells.grid) if slab_layers is None else slab_layers
    dealt = (iterate_slabs(shell.mesh, shells.grid, layers) for shell in shells.shells)
    return zip(*dealt, strict=True)


def _machine(plan: Plan, printer: str | Printer | None, *, needed: bool) -> Printer | None:
    if printer is not None:
        return load_printer(printer)
    try:
        return load_printer(plan.printer)
    except UnknownNameError as error:
        if needed:
            raise UnknownNameError(
                f"{error}; or give the size of a voxel with --pitch, or another printer with "
                "--printer"
            ) from error
        return None


def _shells(root: Path, plan: Plan, machine: Printer | None) -> Iterator[ShellMesh]:
    seen = {region.file: region for region in plan.regions}
    colours = _colours(root, plan, machine, {_material(region) for region in seen.values()})
    for name in sorted(seen):
        region = seen[name]
        path = (root / name).resolve()
        if not path.is_relative_to(root.resolve()):
            raise FileError(f"{name}: the plan names a shell outside its folder; it was not read")
        try:
            data = path.read_bytes()
        except FileNotFoundError as error:
            raise FileError(
                f"{root / name}: the plan names this shell, but it is missing; grade the part again"
            ) from error
        except OSError as error:
            raise FileError(f"{root / name}: cannot be read ({error.strerror or error})") from error
        sha256 = hashlib.sha256(data).hexdigest()
        if sha256 != region.sha256:
            raise FileError(
                f"{root / name}: its content is not what the plan was written with (sha256 "
                f"{sha256[:12]}..., the plan says {region.sha256[:12]}...); grade the part again"
            )
        vertices, faces = weld(decode_stl(data, name).astype(np.float32))
        material = _material(region)
        yield ShellMesh(
            material,
            material if machine is None else machine.operator_name(material),
            colours.get(material, _UNKNOWN_COLOUR),
            name,
            sha256,
            Mesh(vertices.astype(np.float64), faces),
        )


def _material(region: Region) -> str:
    """Return what a region's shell is printed in: a material's id, or a mixture's name."""
    name = region.material or (region.blend or {}).get("name")
    return str(name or Path(region.file).stem.partition("__")[2])


def _colours(root: Path, plan: Plan, machine: Printer | None, wanted: set[str]) -> dict[str, str]:
    """Return colours by material: those of the plan's palette, else of its 3MF, as far as known."""
    if machine is not None and plan.palette.name in machine.palettes:
        palette = machine.palette(plan.palette.name)
        colours = {material.id: material.colour for material in palette.materials}
        if palette.sha256 == plan.palette.sha256 and wanted <= set(colours):
            return colours
    file = root / f"{plan.name}.3mf"
    if not file.is_file():
        return {}
    from planner.formats.threemf_reader import read_threemf

    return {each.material_name: each.colour for each in read_threemf(file).objects if each.colour}


def _pitch(
    pitch_mm: float | Sequence[float] | None,
    extent_mm: np.ndarray[tuple[int], np.dtype[np.float64]],
) -> tuple[float, ...]:
    try:
        edges = np.atleast_1d(np.asarray(pitch_mm, dtype=np.float64))
    except (TypeError, ValueError):
        edges = np.empty(0)
    if edges.shape not in ((1,), (3,)):
        raise ArgumentError(f"pitch is {pitch_mm!r}; give one length in mm, or three: x, y, z")
    whole = tuple(float(p) for p in np.broadcast_to(edges, 3))
    for axis, edge, extent in zip("xyz", whole, extent_mm.tolist(), strict=True):
        if not 0.0 < edge < math.inf:
            raise ArgumentError(f"pitch along {axis} is {edge:g} mm; it must be above 0 and finite")
        if edge > extent:
            micrometres = ",".join(f"{p / 1000.0:g}" for p in whole)
            hint = f"; did you mean {micrometres} mm?" if edge / 1000.0 <= extent / 2.0 else ""
            raise ArgumentError(
                f"pitch along {axis} is {edge:g} mm, more than the part's {extent:.6g} mm{hint}"
            )
    return whole
