"""A whole part under its loads: what stands where in it, how it deforms, how sure that is."""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.errors import ArgumentError, FileError, as_count, as_number, positive
from planner.fields.basic import AxisField, Field
from planner.fields.parse import Setting, build_field, field_of
from planner.formats.field_file import encode_vtu
from planner.formats.files import free_memory_bytes, json_of
from planner.formats.mesh_file import encode_stl
from planner.formats.tables import encode_csv
from planner.glance import counted, html_of, one_line, outcome, place_text, plotted, sized
from planner.materials.mixtures import CoefficientModel
from planner.mesh.distance import triangle_tree
from planner.mesh.halve import halve_long_edges
from planner.mesh.mesh import Mesh, Topology, join_shells
from planner.mesh.part import open_part, plain
from planner.numerics import FloatArray, Point, as_point, one_blas_thread
from planner.palette import Palette
from planner.plan import Plan, Triangles, plan_file, read_plan, read_shells
from planner.printers import Printer, palette_of
from planner.simulation.bar import (
    mixture_along,
    plan_axis,
    plan_palette,
    region_coordinates,
    united,
)
from planner.simulation.cut_cells import FEWEST_ALONG, MOST_CELLS, CutCells, Shells, cut_cells
from planner.simulation.loads import Conditions, LoadCase, palette_densities, read_conditions
from planner.simulation.simulate import called

if TYPE_CHECKING:
    # The solver is loaded when a part is solved, and not before its input is known to be sound.
    from planner.simulation.response import LoadSteps, Response
    from planner.simulation.solid import Body, Mechanics
    from planner.simulation.sparse_cholesky import Factor

__all__ = [
    "COARSER",
    "COVERS",
    "PartSimulation",
    "Solid",
    "check_effort",
    "default_cell_mm",
    "filling_along",
    "finest_cell_mm",
    "open_solid",
    "simulate_part",
]


# ------------------------------------------------------------------------------------------------
# What stands at a place of a plan, and the surface around it; all in the part's own coordinates.


Filling = Callable[[FloatArray], FloatArray]
"""The coordinate, (n,), at points (n, 3) mm."""

_OFF = 1e-4
"""Of the volume: how far shells, rounded to single precision, may be off the part's."""


_FLAT_MM = 1e-4
"""How far cuts that are taken back may move the surface: ten times what single precision rounds by
on a tray of 400 mm, and a hundredth of a printed layer."""


def _own(plan: Plan, placed: Mesh) -> Mesh:
    off = abs(placed.volume_mm3 - plan.part.volume_mm3)
    if not Topology(placed.faces).closed or off > _OFF * plan.part.volume_mm3:
        raise FileError(
            f"the shells of {plan.part.file} make up {placed.volume_mm3:.6g} mm3, the part is "
            f"{plan.part.volume_mm3:.6g} mm3, or leave it open; grade the part again"
        )
    return Mesh(placed.vertices - np.array(plan.part.translation_mm), placed.faces)


def _filling(
    plan: Plan, shells: Mapping[str, Triangles], placed: Mesh, palette: Palette
) -> Filling:
    field = _field(plan, placed)
    if field is not None:
        return filling_along(field, plan, palette)
    if plan.gradient.kind == "dither":
        raise ArgumentError(
            f"{plan.part.file}: its cells are dealt along a field, {plan.gradient.field['name']}, "
            "that plan.json does not hold, so that no mixture is known; grade it with another "
            "`blend` to simulate it"
        )
    return _by_shells(plan, shells, palette)


def filling_along(field: Field, plan: Plan, palette: Palette) -> Filling:
    """Return what a plan prints along its field, which is over the part as placed for printing."""
    moved, mixture = np.array(plan.part.translation_mm), mixture_along(plan, palette)
    return lambda points: mixture(field.values(points + moved))


def _field(plan: Plan, placed: Mesh) -> Field | None:
    """Return a plan's field, None where plan.json does not hold it."""
    says = plan.gradient.field
    if says.get("name") == "axis":
        return AxisField(*plan_axis(says))
    if "'faces'" in str(says):
        return None  # of the part's triangles in a box: shells have theirs cut
    try:
        text = field_of(says, plan.part.translation_mm, plan.folder)
    except ArgumentError:
        return None
    pitch_mm = float(says.get("pitch_mm", 0.5))
    return build_field(text, Setting(placed, plan.part.translation_mm, pitch_mm))


def _filled(plan: Plan, shells: Mapping[str, Triangles], palette: Palette) -> FloatArray:
    """Return what each shell is filled with, (shells,)."""
    files = [region.file for region in plan.regions]
    by_file = dict(zip(files, region_coordinates(plan, palette).tolist(), strict=True))
    return np.array([by_file[file] for file in shells])


def _by_shells(plan: Plan, shells: Mapping[str, Triangles], palette: Palette) -> Filling:
    """Look up in which shell points are; those in none, by rounding, are in the nearest."""
    moved = np.array(plan.part.translation_mm)
    filled = _filled(plan, shells, palette)
    meshes = [united({file: soup}) for file, soup in shells.items()]
    trees = [triangle_tree(mesh) for mesh in meshes]

    def by_shells(points: FloatArray) -> FloatArray:
        placed = np.ascontiguousarray(points + moved)
        found = np.full(len(points), np.nan)
        for mesh, tree, coordinate in zip(meshes, trees, filled, strict=True):
            low, high = mesh.bounds_mm
            near = np.flatnonzero(((placed >= low) & (placed <= high)).all(axis=1))
            _, outside = tree.distances(placed[near])
            found[near[~outside]] = coordinate
        lost = np.flatnonzero(np.isnan(found))
        away = np.stack([tree.distances(placed[lost])[0] for tree in trees])
        found[lost] = filled[away.argmin(axis=0)]
        return found

    return by_shells


# ------------------------------------------------------------------------------------------------
# What is to be loaded: a plan, or a mesh of one material.


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed surface in the part's own coordinates, what fills it, and where it came from.

    Attributes
    ----------
    filling
        The coordinate on the palette, (n,), at points (n, 3) mm.
    at_strain
        Working strain of the plan, up to which its moduli are secants.
    shells, shell_coordinate
        What fills it and with what, (shells,), where that is several materials, each in a region.
    """

    name: str
    surface: Mesh
    filling: Filling
    palette: Palette
    notes: tuple[str, ...]
    at_strain: float = 0.1
    shells: Shells | None = None
    shell_coordinate: FloatArray | None = None

    def cut(
        self, cell_mm: float, *, shift: float = 0.0, like: CutCells | None = None
    ) -> tuple[CutCells, FloatArray]:
        """Return cells, as `cut_cells`, and the coordinate at their quadrature points.

        What a cell has joined are layers of like moduli, softer or stiffer than the rest of the
        cell. An isotropic law cannot be both what they are along them, the arithmetic mean, and
        in shear across them and along their normal, in series, the harmonic. It is the harmonic:
        where it matters much, stiffer pieces bear what is along the layers. A stack of six in a
        cell is 3 % too soft then at most, and 5 to 10 % too stiff with the geometric mean (tests).
        """
        cells = cut_cells(self.surface, cell_mm, shells=self.shells, shift=shift, like=like)
        if self.shells is None or self.shell_coordinate is None:
            return cells, self.filling(cells.points_mm)
        moduli = self.shells.modulus_MPa
        joined = 1.0 / (cells.shares @ (1.0 / moduli))
        by_modulus = np.argsort(moduli)
        log = np.log(moduli[by_modulus])
        each = np.interp(np.log(joined), log, self.shell_coordinate[by_modulus])
        return cells, each[cells.cell_of]


def open_solid(
    source: object,
    material: str | None,
    unit: str | None,
    printer: str | Printer | None,
    palette: str | Path | Palette | None,
    bodies: str | None = None,
) -> Solid:
    """Return what a plan prints, or a mesh of one material.

    A plan's surface is that of its shells, without the faces where two of them touch. What it
    prints at a place is told by its field; where plan.json does not hold what that is made of, by
    the shells. Cells of two materials that lie among each other count as the mixture that they
    come to.

    Parameters
    ----------
    source
        A plan, its plan.json or folder; or a mesh as `planner.grade` takes it. One that is open
        stays as it is.
    material, unit, bodies
        Of a mesh.

    Raises
    ------
    PlannerError
        It cannot be read, or has no material, or two.
    """
    if isinstance(source, Solid):
        return source
    is_path = isinstance(source, (str, Path))
    if is_path and (Path(str(source)).is_dir() or Path(str(source)).suffix.casefold() == ".json"):
        source = read_plan(plan_file(Path(str(source))))
    if not isinstance(source, Plan):
        chosen = palette_of(palette, printer)
        opened = open_part(source, unit=unit, bodies=bodies)
        if material is None:
            raise ArgumentError(
                "`material` is missing: a mesh has none of its own; give one, as "
                f"{chosen.materials[len(chosen.materials) // 2].id}, or a plan"
            )
        coordinate = chosen.resolve(material).coordinate
        said = tuple(f"{opened.file}: {note}" for note in (*opened.repairs, *opened.warnings))

        def even(points: FloatArray) -> FloatArray:
            return np.full(len(points), coordinate)

        return Solid(opened.file, opened.mesh, even, chosen, said)
    for name, given in (("`material`", material), ("`unit`", unit), ("`bodies`", bodies)):
        if given is not None:
            raise ArgumentError(f"{name} {given}: it goes with a mesh; a plan has its own")
    chosen, notes = plan_palette(source, palette, printer)
    shells = dict(read_shells(source))
    joined = join_shells(shells.values())
    placed = plain(joined.outside, _FLAT_MM)  # without what only interfaces have cut
    filling = _filling(source, shells, placed, chosen)
    surface, strain = _own(source, placed), source.stiffness.at_strain
    made = Solid(source.part.file, surface, filling, chosen, notes, strain)
    if source.gradient.kind in ("mix", "dither") or len(shells) == 1:
        return made
    own = Mesh(joined.vertices - np.array(source.part.translation_mm), np.concatenate(joined.faces))
    shell = np.repeat(np.arange(len(shells), dtype=np.int32), [len(s) for s in joined.faces])
    filled = _filled(source, shells, chosen)
    modulus = CoefficientModel(chosen).modulus_MPa(filled, strain)
    return replace(made, shells=Shells(own, shell, modulus), shell_coordinate=filled)


# ------------------------------------------------------------------------------------------------
# The result.


@dataclass(frozen=True, slots=True)
class PartFinding:
    """Something that a print would not do as simulated.

    Attributes
    ----------
    kind
        ``break``: a strain passes its elongation at break. ``stopped``: the load is not reached.
    load
        Share of the load at which it happens.
    """

    kind: str
    message: str
    load: float
    place_mm: Point | None = None


@dataclass(frozen=True, slots=True)
class Discretisation:
    """How far figures may be off those of ever smaller cells.

    Larger cells are laid twice, half a cell apart, and the changes of a figure, without their
    signs, are added up: one alone may vanish where two errors happen to meet. What is told, 1.15
    times that, bounds the change to cells half as large for nine random parts in ten
    (benchmarks/discretisation.py). At clamped edges, of what is left 0.2 to 0.4 % may be untold.
    Figures are of a small share of the load, where a part answers linearly.

    Attributes
    ----------
    cell_mm
        Edge of the larger cells.
    errors
        By response: relative, of its displacement, or of the force of a support that moves; None
        where there is none.
    """

    cell_mm: float
    errors: tuple[float | None, ...]

    @property
    def largest(self) -> float | None:
        """The largest error; None where no response tells any."""
        return max((error for error in self.errors if error is not None), default=None)


class LoadCurve(NamedTuple):
    """What a load curve is drawn of, (steps,) each, and the factors to the interval's ends.

    Attributes
    ----------
    sure_x, sure_y
        Lower and upper factor of x and y; (1, 1) of what is given.
    """

    x: FloatArray
    y: FloatArray
    x_label: str
    y_label: str
    sure_x: tuple[float, float] = (1.0, 1.0)
    sure_y: tuple[float, float] = (1.0, 1.0)

    @property
    def interval(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper ends of x and of y, (2, steps) each."""
        return np.outer(self.sure_x, self.x), np.outer(self.sure_y, self.y)


@dataclass(frozen=True, eq=False)
class PartSimulation:
    """A part under its loads, in steps from none to all of them.

    Attributes
    ----------
    name
        The part's file.
    coordinate : (Q,)
        Of the mixture at the cells' quadrature points.
    surface_coordinate : (V,)
        At the vertices of the surface, ``cells.surface``.
    steps
        What the part does: displacements and strains of the surface at every step, and the
        responses where it is held, loaded and watched.
    level
        Probability that intervals hold a print's figure.
    notes
        What was assumed, one sentence each.
    case
        Name of the load case, where there are several.
    """

    name: str
    palette: Palette
    conditions: Conditions
    cells: CutCells
    coordinate: FloatArray
    surface_coordinate: FloatArray
    steps: "LoadSteps"
    level: float
    discretisation: Discretisation | None = None
    findings: tuple[PartFinding, ...] = ()
    notes: tuple[str, ...] = ()
    case: str = ""

    _repr_html_ = html_of
    plot = plotted

    @property
    def called(self) -> str:
        """The part's file and the load case."""
        return f"{self.name}, {self.case}" if self.case else self.name

    @one_line
    def __repr__(self) -> str:
        curve = self.curve
        return (
            f"{self.called}: {curve.x[-1]:.4g} mm at {curve.y[-1]:.4g} "
            f"{curve.y_label.rpartition(', ')[2].removeprefix('share ')}, "
            f"{counted(len(curve.x) - 1, 'step')}; " + outcome((len(self.findings), "finding"))
        )

    @property
    def ok(self) -> bool:
        """Whether the whole load is reached and nothing breaks."""
        return not self.findings

    @property
    def main(self) -> "Response | None":
        """What the load curve is of: the first load, else moment, move, watch, pressure."""
        order = {"load": 0, "moment": 1, "move": 2, "watch": 3, "pressure": 4}
        loaded = [response for response in self.steps.responses if response.kind in order]
        return min(loaded, key=lambda response: order[response.kind], default=None)

    @property
    def curve(self) -> LoadCurve:
        """Force, pressure or share of the load over the displacement of the main response."""
        share, main = self.steps.share, self.main
        if main is None:
            moved = np.linalg.norm(self.steps.displacement_mm, axis=2).max(axis=1)
            return LoadCurve(moved, share, "largest displacement, mm", "share of the load")
        low, high = main.interval or (1.0, 1.0)
        x, y = main.along_mm, main.along_N
        x_label, y_label = f"displacement of {main.selector}, mm", "force, N"
        if main.turn_deg is not None and main.moment_N_mm is not None:
            x, y = main.turn_deg @ main.direction, main.moment_N_mm @ main.direction
            x_label, y_label = f"turn of {main.selector}, °", "moment, N mm"
        figure = float((y if main.kind == "move" else x)[-1])
        sure = (low / figure, high / figure) if main.interval and figure else (1.0, 1.0)
        if main.kind == "move":
            return LoadCurve(x, y, x_label, y_label, sure_y=sure)
        pressures = {1000.0 * pressure.pressure_MPa for pressure in self.conditions.pressures}
        if main.kind in ("watch", "pressure"):
            y, y_label = share, "share of the load"
            if len(pressures) == 1:
                y, y_label = share * pressures.pop(), "pressure, kPa"
        return LoadCurve(x, y, x_label, y_label, sure_x=sure)

    @property
    def farthest(self) -> tuple[FloatArray, Point]:
        """Displacement at last of the vertex that moves most, (3,), and its place at rest."""
        moved = self.steps.displacement_mm[-1]
        at = int(np.linalg.norm(moved, axis=1).argmax())
        return moved[at], as_point(self.cells.surface.vertices[at])

    def document(self) -> dict[str, Any]:
        """Return the simulation as JSON holds it."""
        steps, cells, found = self.steps, self.cells, self.discretisation
        moved, place = self.farthest
        return {
            "schema": 1,
            "source": self.name,
            "case": self.case,
            "palette": {"name": self.palette.name, "sha256": self.palette.sha256},
            "cells": {
                "cell_mm": cells.cell_mm.tolist(),
                "count": len(cells.nodes),
                "unknowns": 3 * len(cells.node_mm),
                "volume_mm3": cells.volume_mm3,
            },
            "level": self.level,
            "gravity": self.conditions.gravity,
            "share": steps.share.tolist(),
            "energy_mJ": steps.energy_mJ.tolist(),
            "strain_over_break": steps.largest.tolist(),
            "strain_place_mm": steps.largest_mm.tolist(),
            "farthest": {"place_mm": place, "displacement_mm": moved.tolist()},
            "responses": [
                {
                    "kind": response.kind,
                    "selector": response.selector,
                    "direction": response.direction.tolist(),
                    "displacement_mm": response.displacement_mm.tolist(),
                    "force_N": response.force_N.tolist(),
                    "interval": response.interval,
                    "stiffness_N_mm": response.stiffness_N_mm,
                    **{name: values.tolist() for name, values in response.turned.items()},
                }
                for response in steps.responses
            ],
            "discretisation": None if found is None else dataclasses.asdict(found),
            "findings": [dataclasses.asdict(finding) for finding in self.findings],
            "notes": list(self.notes),
        }

    json = json_of

    def csv(self) -> bytes:
        """Return the steps as CSV, one a row; responses are numbered as in the JSON, from 1."""
        steps = self.steps
        columns = {
            "share": steps.share,
            "energy_mJ": steps.energy_mJ,
            "strain_over_break": steps.largest,
        }
        for number, response in enumerate(steps.responses, start=1):
            told = {"displacement_mm": response.displacement_mm, "force_N": response.force_N}
            if response.kind in ("watch", "moment"):
                del told["force_N"]
            for name, values in {**told, **response.turned}.items():
                for axis, column in zip("xyz", values.T, strict=True):
                    columns[f"{response.kind}{number}_{axis}_{name.partition('_')[2]}"] = column
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        return encode_csv([columns, *rows])

    def deformed_stl(self, step: int = -1) -> bytes:
        """Return the surface as it is at a step, in the part's own coordinates: a binary STL."""
        surface = self.cells.surface
        vertices = (surface.vertices + self.steps.displacement_mm[step]).astype(np.float32)
        share = self.steps.share[step]
        return encode_stl(vertices, surface.faces, f"planner: {self.name} at load {share:.3g}, mm")

    def vtu(self, step: int = -1) -> bytes:
        """Return the surface at rest, with what its vertices do at a step: a VTU file.

        Values are ``displacement_mm``, by which ParaView's filter Warp By Vector deforms it,
        ``strain_over_break`` and ``coordinate``.
        """
        surface = self.cells.surface
        values = {
            "displacement_mm": self.steps.displacement_mm[step],
            "strain_over_break": self.steps.strain_over_break[step],
            "coordinate": self.surface_coordinate,
        }
        return encode_vtu(surface.vertices, [surface.faces], point_data=values)


# ------------------------------------------------------------------------------------------------
# What a size of cells takes, foretold before any of it is spent.


def _effort(
    surface: Mesh, edge_mm: FloatArray, factors: int, solutions: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Foretell cells, equations, memory in bytes and seconds of solutions, by the cells' edge.

    Fitted to 1000 to 20,000 cells over a finger, a gripper and a bar: cells and equations are
    within 20 %, memory 4 % less to 50 % more than it takes; seconds are those of two cores, within
    a factor of 2.
    """
    extent = np.ptp(surface.bounds_mm, axis=0)
    cell_mm3 = np.prod(extent / np.maximum(np.ceil(extent / edge_mm[:, None] - 1e-6), 1.0), axis=1)
    inside, across = surface.volume_mm3 / cell_mm3, surface.area_mm2 / cell_mm3 ** (2.0 / 3.0)
    cells, unknowns = inside + 0.3 * across, 3.0 * (8.0 * inside + 4.8 * across)
    # Nested dissection in three dimensions fills in like n^(4/3), and works like n².
    memory = 8.0 * ((11.0 * factors + 9.0) * unknowns ** (4.0 / 3.0) + 1.04e4 * cells)
    seconds = 3.0 + 1.5e-3 * across + 5.0 * solutions * (1e-4 * cells + unknowns**2 / 1.5e10)
    return cells, unknowns, memory, seconds


_SIZES_MM = np.array([digits * 10.0**power for power in range(-4, 4) for digits in range(10, 100)])


def check_effort(
    surface: Mesh, cell_mm: float, *, factors: int = 2, solutions: int = 5, known_bytes: float = 0.0
) -> str:
    """Refuse cells that do not fit in free memory; return in words what they take.

    Parameters
    ----------
    factors
        Of the matrix, in memory at a time.
    solutions
        Steps of the load in all cases, or as many equilibria.
    known_bytes
        What it takes, where that is known; else it is foretold. Cells of many materials take more.

    Raises
    ------
    ArgumentError
        With the finest cells that fit.
    """
    positive(cell_mm, "`cell_mm`")
    sizes = np.append(cell_mm, _SIZES_MM[cell_mm < _SIZES_MM])
    cells, unknowns, memory, seconds = _effort(surface, sizes, factors, solutions)
    free = free_memory_bytes()
    more = known_bytes / memory[0] if known_bytes else 1.0
    memory, seconds = memory * more, seconds * more  # graded by radius: 7.7 times, n² 7.4 times
    gigabytes = [f"{figure:.2g} GB of memory" for figure in memory / 1e9]
    minutes = [counted(math.ceil(figure / 60.0), "minute") for figure in seconds]
    fits = (memory <= free) & (cells <= MOST_CELLS)
    if fits[0]:
        return f"about {gigabytes[0]} and {minutes[0]}"
    what = f"about {cells[0]:.0f} cells are needed, and {MOST_CELLS} are possible"
    if memory[0] > free:
        what = f"about {unknowns[0]:.0f} equations take {gigabytes[0]}"
        what += f", and {free / 1e9:.3g} GB are free"
    fits &= sizes <= np.ptp(surface.bounds_mm, axis=0).max() / FEWEST_ALONG
    best = int(np.argmax(fits))
    advice = f"the finest cells that fit are of {sizes[best]:g} mm (about {minutes[best]})"
    raise ArgumentError(f"`cell_mm` {cell_mm:g}: {what}; {advice if fits[best] else 'none fit'}")


def finest_cell_mm(surface: Mesh, minutes: float, *, factors: int, solutions: int) -> float:
    """Return the finest cells that are foretold to take so long at most, and that fit in memory.

    Raises
    ------
    ArgumentError
        None do.
    """
    positive(minutes, "`minutes`")
    cells, _, memory, seconds = _effort(surface, _SIZES_MM, factors, solutions)
    fits = (seconds <= 60.0 * minutes) & (memory <= free_memory_bytes()) & (cells <= MOST_CELLS)
    fits &= np.ptp(surface.bounds_mm, axis=0).max() / FEWEST_ALONG >= _SIZES_MM
    if not fits.any():
        raise ArgumentError(f"`minutes` {minutes:g}: no cells are done in that time; give more")
    return float(_SIZES_MM[int(np.argmax(fits))])


# ------------------------------------------------------------------------------------------------
# A part, its load cases, its cells, and the solver: planner.simulate_part.


_CELLS = 2000
"""Of material in full cells, where no size is given: a minute's work. The comparison with larger
cells says how much it leaves open."""

COARSER = 1.5
"""Times larger are the cells that tell how far figures depend on their size."""

COVERS = 1.15
"""Times the sum of what two solutions in such cells change, is what is told. Calibrated by
benchmarks/discretisation.py: of 24 parts the sum alone bounds the true error of 21, this of 23."""

_SMALL = 1e-3
"""Share of the load at which sizes of cells are compared: parts answer linearly there."""

_MOVES = 0.02
"""Share of the part's largest displacement that faces under pressure move by on the mean, for its
relative error to be told. Chosen: it is nothing where opposite ones move apart."""

_MOST_STEPS = 1000


def default_cell_mm(surface: Mesh) -> float:
    """Return the edge of cells where none is given."""
    return float(f"{math.cbrt(surface.volume_mm3 / _CELLS):.2g}")


@one_blas_thread()
def simulate_part(
    source: object,
    cases: LoadCase | Sequence[LoadCase],
    *,
    material: str | None = None,
    cell_mm: float | None = None,
    steps: int = 5,
    level: float = 0.95,
    compare_cells: bool = True,
    unit: str | None = None,
    bodies: str | None = None,
    printer: str | Printer | None = None,
    palette: str | Path | Palette | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[PartSimulation, ...]:
    """Load a whole part, a solid that may bend: how each place of it moves and strains.

    Parameters
    ----------
    source
        A plan (a value, its plan.json or folder), or a mesh as `planner.grade` takes it.
    cases
        How it is held and loaded, once or several times.
    material, unit, bodies
        Of a mesh: what it is made of; the others as `planner.grade` has them.
    cell_mm
        Edge of the cells that the part is cut into; about 2000 by default.
    steps
        Of each load.
    level
        Probability that an interval holds what a print does.
    compare_cells
        Whether larger cells tell how far figures may be off because of the cells.
    printer, palette
        By name, file or value; by default those of the plan, else the Connex3 and its own.
    progress
        Called with what is being done.

    Returns
    -------
    tuple of PartSimulation
        One a case. Its ``ok`` is false when a print would break, or the load is out of reach.

    Raises
    ------
    PlannerError
        Bad input, with what to do about it; cells that do not fit in free memory.

    Examples
    --------
    >>> held = planner.LoadCase(fix="x=max", load="x=min: 0,0,-0.5 N")  # doctest: +SKIP
    >>> (bent,) = planner.simulate_part("finger-graded", held)  # doctest: +SKIP
    """
    cases = LoadCase.named(cases)
    if not cases:
        raise ArgumentError("`cases`: there is none; say how the part is held and loaded")
    steps = as_count(steps, "`steps`", _MOST_STEPS)
    level = as_number(level, "`level`", (0.0, 1.0))
    several = len(cases) > 1
    tell = progress or (lambda stage: None)
    tell("reading the part")
    solid = open_solid(source, material, unit, printer, palette, bodies)
    densities = palette_densities(solid.palette, cases)
    edge = default_cell_mm(solid.surface) if cell_mm is None else cell_mm
    # Cases share the factor of the part at rest.
    work = {"factors": 1 + several, "solutions": (steps + 1) * len(cases)}
    effort = check_effort(solid.surface, edge, **work)

    def conditions(surface: Mesh) -> list[Conditions]:
        return [_conditions(surface, case) for case in cases]

    conditions(halve_long_edges(solid.surface, 0.5 * edge)[0])
    tell("loading the solver")
    from planner.materials.marlow import marlow_table
    from planner.simulation.response import respond
    from planner.simulation.solid import Body, Mechanics
    from planner.simulation.sparse_cholesky import analyse

    model = CoefficientModel(solid.palette)
    table = marlow_table(model)

    def prepared(edge_mm: float, shift: float = 0.0) -> "tuple[list[Mechanics], str]":
        tell(f"cutting the part into cells of {edge_mm:.3g} mm; all takes {effort}")
        cells, coordinate = solid.cut(edge_mm, shift=shift)
        body = Body(cells, table, coordinate, densities=densities)
        tell(f"ordering {3 * len(cells.node_mm)} equations")
        analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
        needed = work["factors"] * analysis.factor_bytes + analysis.work_bytes
        needed += 8 * 6 * 27**2 * len(cells.nodes)
        takes = check_effort(solid.surface, edge_mm, **work, known_bytes=needed)
        rests: dict[object, Factor] | None = {} if several else None
        on, *others = conditions(cells.surface)
        one = Mechanics(body, on, analysis, rests=rests)
        return [one, *(Mechanics(body, o, analysis, like=one, rests=rests) for o in others)], takes

    def told(share: float, k: int, residual: float) -> None:
        tell(f"load {share:.3g}: iteration {k}, residual {residual:.1e}; all takes {effort}")

    solved, effort = prepared(edge)
    found = [respond(one, model, steps=steps, level=level, progress=told) for one in solved]
    cells, coordinate = solved[0].body.cells, solved[0].body.coordinate
    larger_mm = COARSER * float(cells.cell_mm.max())
    longest_mm = float(np.ptp(solid.surface.bounds_mm, axis=0).max())
    compared: list[Discretisation | None] = [None] * len(cases)
    if compare_cells and longest_mm >= FEWEST_ALONG * larger_mm:
        here = [_small_figures(one) for one in solved]
        others = [list(map(_small_figures, prepared(larger_mm, shift)[0])) for shift in (0.0, 0.5)]
        compared = [
            Discretisation(larger_mm, tuple(map(_error, *each)))
            if all(each) and reached.share[-1] > 0.0
            else None
            for reached, *each in zip(found, here, *others, strict=True)
        ]
    surface_coordinate = solid.filling(cells.surface.vertices)
    return tuple(
        PartSimulation(
            name=solid.name,
            palette=solid.palette,
            conditions=one.conditions,
            cells=cells,
            coordinate=coordinate,
            surface_coordinate=surface_coordinate,
            steps=reached,
            level=level,
            discretisation=change,
            findings=tuple(_findings(reached, solid.filling, model, case.name)),
            notes=(*solid.notes, *_notes(solved[0].body), *_moment_notes(reached, one.conditions)),
            case=case.name,
        )
        for one, reached, change, case in zip(solved, found, compared, cases, strict=True)
    )


def _conditions(surface: Mesh, case: LoadCase) -> Conditions:
    """Read a load case to simulate: the displacements among its targets are watched too."""
    try:
        watched = (*case.watch, *case.watched_targets)
        on = read_conditions(surface, dataclasses.replace(case, watch=watched))
        for seen in on.watched:
            axes = range(3) if seen.axis is None else [seen.axis]
            on.refuse_held(f"`watch` {seen.selector}", seen.facets, axes)
    except ArgumentError as error:
        raise ArgumentError(f"{case.name}: {error}" if case.name else str(error)) from error
    return on


def _small_figures(mechanics: "Mechanics") -> list[FloatArray | None]:
    """Return what each response is of at a small load: displacement, turn, or a support's force.

    None where there is none, or hardly any of faces under pressure.
    """
    from planner.simulation.response import answers
    from planner.simulation.solid import LostStabilityError

    try:
        state = mechanics.small(_SMALL)
    except LostStabilityError:
        return []  # the steps say so, where it matters
    norm = np.linalg.norm
    least = _MOVES * float(norm(state.displacement_mm, axis=1).max())
    return [
        None if told.kind == "pressure" and norm(told.displacement_mm) < least else told.figure
        for told, _ in answers(mechanics, state)
    ]


def _error(here: FloatArray | None, *others: FloatArray | None) -> float | None:
    if here is None or not (size := float(here @ here)):
        return None
    changes = (abs(float(here @ there) / size - 1.0) for there in others if there is not None)
    return COVERS * sum(changes)


def _findings(
    steps: "LoadSteps", filling: Filling, model: CoefficientModel, case: str
) -> Iterator[PartFinding]:
    """Report where the part breaks first, and where it loses stability."""
    prefix = f"{case}: " if case else ""
    broken = steps.largest > 1.0
    if broken.any():
        k = int(np.argmax(broken))  # never at rest
        share = float(np.interp(1.0, steps.largest[k - 1 : k + 1], steps.share[k - 1 : k + 1]))
        coordinate = float(filling(steps.largest_mm[k][None])[0])
        words = (
            f"{called(model, coordinate)} at {place_text(steps.largest_mm[k])} passes its "
            f"elongation at break at {share:.3g} of the load, by the mean of neighbouring cells; a "
            "print would break there, and what follows is extrapolated"
        )
        yield PartFinding("break", prefix + words, share, as_point(steps.largest_mm[k]))
    if steps.lost is not None:
        share = float(steps.share[-1])
        where = steps.lost.place_mm
        at = "" if where is None else f" near {place_text(where)}"
        if steps.lost.share > 0.0:
            words = (
                f"the part loses stability at {steps.lost.share:.3g} of the load{at}: it buckles, "
                "snaps through or is inflated without end; only what is before is given (a given "
                "displacement, `move`, often goes farther than a force)"
            )
        else:
            words = (
                f"no equilibrium is found under the least load{at}: the part may hang together by "
                "less than a cell there, or the load be too large for the first step; take "
                "smaller cells or more steps"
            )
        place = None if where is None else as_point(where)
        yield PartFinding("stopped", prefix + words, share, place)


def _moment_notes(steps: "LoadSteps", on: Conditions) -> Iterator[str]:
    at_last = [r.moment_N_mm[-1] for r in steps.responses if r.moment_N_mm is not None]
    for left, moment in zip(at_last, on.moments, strict=False):  # none where nothing settled
        given = float(steps.share[-1]) * np.array(moment.moment_N_mm)
        size = float(np.linalg.norm(given))
        if abs(share := left @ given / size**2 - 1.0) > 0.01:
            yield (
                f"moment on {moment.selector}: its tractions keep their direction while the faces "
                f"turn, so that {size * (1.0 + share):.3g} of {size:.3g} N mm are left at last"
            )


_STEEP = float(np.log(4.0))
"""Change of ln(modulus) over a cell from which it is told. Numerical: beams graded 950:1 over 10
and over 4 cells, where it is 0.7 and 1.7 a cell, are off by 0.1 and 1.0 %."""


def _notes(body: "Body") -> Iterator[str]:
    cells = body.cells
    thick_mm = 2.0 * cells.surface.volume_mm3 / cells.surface.area_mm2  # of a sheet, exactly
    if float(cells.cell_mm.max()) > thick_mm:
        # The finger, 2.5 mm on average: cells of 2 mm are 3 % stiff, of 3 mm 7 %.
        yield (
            f"twice the part's volume over its surface is {thick_mm:.2g} mm, less than a cell: it "
            "may come out a tenth too stiff, also where larger cells agree; try "
            f"{0.75 * thick_mm:.2g} mm"
        )
    yield (
        "the palette's laws are of tension; what compression and stretch in two directions do is "
        "extrapolated from them"
    )
    yield (
        f"strains are means over neighbouring cells of {sized(cells.cell_mm, '.3g')} mm; at "
        "clamped edges and sharp corners they are higher"
    )
    starts, log = cells.offsets[:-1], np.log(body.shear_modulus_MPa)
    change = np.maximum.reduceat(log, starts) - np.minimum.reduceat(log, starts)
    steep = cells.cell_volume_mm3 @ (change > _STEEP) / cells.volume_mm3
    if steep > 0.0:
        yield (
            f"stiffness changes more than fourfold within cells that hold {100.0 * steep:.2g} % "
            "of the part: figures may be off by more than 2 %; take smaller cells"
        )
    joined = cells.cell_volume_mm3 @ (cells.shares.max(axis=1) < 1.0) / cells.volume_mm3
    if joined > 0.0:
        yield (
            f"{100.0 * joined:.2g} % of the part stands where more than four materials share a "
            "cell; those of like modulus are joined there, in series: smaller cells "
            "tell them apart"
        )
    if cells.dropped_mm3 > 0.0:
        yield f"{cells.dropped_mm3:.2g} mm3 of specks that hang on nothing are left out"
