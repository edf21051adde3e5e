"""A planned part as a finite-element model for Abaqus, CalculiX or ParaView (planner.export)."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, Caution, PlannerError, check_known, positive
from planner.formats.field_file import encode_vtu
from planner.formats.files import json_of
from planner.formats.outputs import check_absent, write_whole
from planner.glance import counted, one_line, sized
from planner.materials.law_blocks import hardening
from planner.materials.laws import Yeoh, first_invariant
from planner.materials.marlow import POISSON
from planner.materials.mixtures import CoefficientModel
from planner.mesh.halve import halve_long_edges
from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, IntArray, as_point
from planner.palette import Palette
from planner.printers import Printer
from planner.simulation.loads import Condition, LoadCase, Pressure, couple, read_conditions
from planner.simulation.part import COARSER, Solid, default_cell_mm, open_solid, simulate_part
from planner.voxels.columns import MOST_VOXELS, Grid, inside_shares

__all__ = ["Export", "ExportedMaterial", "export"]


_TARGETS = ("abaqus", "calculix", "vtu")

_CELLS = 15_000
"""By default. Chosen: about 1 mm in a finger, whose walls are then two cells; CalculiX on one core
takes a minute and a half an iteration."""

_MOST_MATERIALS = 64
_BINS = 32
"""Of coordinates, where a plan has more than 64. Chosen: over seven grades stiffness then changes
by a fifth from one to the next, about as much as prints of one grade scatter."""

_FAR_OFF = 0.1
"""Relative: a volume of cells off by more is told as a warning. Chosen: stiffness goes with it at
least in proportion, and the palette's moduli are known to about that."""

_SAME = 1e-6
"""Relative, below which cells fill a box. Numerical: rounding is less, a slant is more."""

_CURVE_POINTS = 60

_WITHIN = 0.05
"""Relative error of stress up to which a law of CalculiX counts as the palette's. Chosen: prints of
one grade scatter by more."""

_MARGIN = 1.5
"""Times the largest strain of a solution: how far laws follow the palette. Chosen: a solution with
large cells may miss a third of a peak."""

_LESS = 0.9
"""Numerical: where a law does not go far enough, it is tried to this share of the strain."""

_ROUND = 0.05
"""Strain up to a multiple of which that is rounded, so that the file is the same on any machine."""

_NEIGHBOURS = 24
"""Numerical: nearest facets to look among for one that faces the same way; in a wall of one cell
a cell's edge away lie about eight facets of the other side."""


# ------------------------------------------------------------------------------------------------
# The part as equal hexahedra of 20 nodes: the cells of a lattice that are at least half full.


_ACROSS = 7
"""Columns along a cell's edge that tell how full it is. Numerical: odd, so that a wall along the
lattice fills half a cell exactly where the middle column says so; with 6 a finger gained 2 %."""

_MOST_CELLS = 300_000
"""Chosen: 1.3 million nodes and a file of 150 MB, beyond what solvers of a workstation take."""

_NEAR, _TRIALS = 1.15, 9
"""Chosen: cells of a seventh more or less are as good to the user."""

_SPECK = 0.01
"""Cells that no face joins to the rest are left out where they are less than this share of all.
Chosen: what a surface grazes comes to single cells, and a body of a part is more."""

# Corners of a cell counterclockwise, below before above; then the middles of edges: below, above,
# upright. It is the order of C3D20 in Abaqus and CalculiX, and of VTK's quadratic hexahedron.
_LOCAL = np.array(
    [
        (0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
        (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
        (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
    ]
)  # fmt: skip

# Faces by their numbers there, 1 to 6: -z, +z, -y, +x, +y, -x.
_NORMALS = np.array([(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)])
_FACE_NODES = np.array([np.flatnonzero((_LOCAL - 1) @ normal == 1) for normal in _NORMALS])
"""Local nodes of each face, (6, 8), four corners before four middles."""


class _Hexahedra(NamedTuple):
    """Cells of a lattice over a part's bounding box.

    Attributes
    ----------
    cell_mm : (3,)
        Edges: the bounding box divided evenly.
    middle_mm : (n, 3)
    nodes : (n, 20)
    node_mm : (N, 3)
    outer : (m, 2)
        Cell and face, 0 to 5, of each face that only one cell has.
    outer_normal : (m, 3)
        Which way is out.
    pieces
        Bodies that no face joins.
    dropped_mm3
        Of specks left out.
    """

    cell_mm: FloatArray
    middle_mm: FloatArray
    nodes: NDArray[np.int64]
    node_mm: FloatArray
    outer: NDArray[np.int64]
    outer_normal: FloatArray
    pieces: int
    dropped_mm3: float

    @property
    def cell_mm3(self) -> float:
        """Volume of one."""
        return float(np.prod(self.cell_mm))

    @property
    def volume_mm3(self) -> float:
        """Volume of all."""
        return len(self.nodes) * self.cell_mm3

    @property
    def outer_middle_mm(self) -> FloatArray:
        """Middles of the outer faces, (m, 3)."""
        return self.middle_mm[self.outer[:, 0]] + 0.5 * self.outer_normal * self.cell_mm

    @property
    def outer_mm2(self) -> FloatArray:
        """Areas of the outer faces, (m,)."""
        return np.asarray(self.cell_mm3 / np.abs(self.outer_normal @ self.cell_mm))


def _fitting_cell_mm(surface: Mesh, about_mm: float) -> float:
    """Return the edge near a wanted one whose cells come nearest to the part's volume.

    Walls gain or lose up to half a cell on either side; between one edge and another that is a
    seventh longer the volume of a finger's cells swings by several percent.
    """

    def off_mm3(edge_mm: float) -> float:
        _, edges, full = _half_full(surface, edge_mm)
        return float(abs(full.sum() * np.prod(edges) - surface.volume_mm3))

    edges_mm = (about_mm * np.geomspace(1.0 / _NEAR, _NEAR, _TRIALS)).tolist()
    return float(min(edges_mm, key=off_mm3))


def _hexahedra(surface: Mesh, cell_mm: float) -> _Hexahedra:
    """Fill a closed surface with cells of about an edge.

    Raises
    ------
    ArgumentError
        There are too many, or none is half full.
    """
    low, edges, full = _half_full(surface, positive(cell_mm, "`cell_mm`"))
    kept, pieces = _joined(full)
    index = np.argwhere(kept)
    if not len(index):
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: no cell is half full, the part's walls are thinner; take "
            "smaller ones"
        )
    places = 2 * index[:, None] + _LOCAL
    width = 2 * np.array(full.shape) + 1
    key = (places[..., 2] * width[1] + places[..., 1]) * width[0] + places[..., 0]
    used, nodes = np.unique(key, return_inverse=True)
    at = np.stack([used % width[0], used // width[0] % width[1], used // (width[0] * width[1])], 1)
    beside = np.moveaxis(index[:, None] + _NORMALS + 1, 2, 0)
    outer = np.argwhere(~np.pad(kept, 1)[tuple(beside)])
    return _Hexahedra(
        cell_mm=edges,
        middle_mm=low + (index + 0.5) * edges,
        nodes=nodes.reshape(-1, 20).astype(np.int64),
        node_mm=low + 0.5 * at * edges,
        outer=outer,
        outer_normal=_NORMALS[outer[:, 1]].astype(np.float64),
        pieces=pieces,
        dropped_mm3=float((full.sum() - len(index)) * np.prod(edges)),
    )


def _half_full(surface: Mesh, cell_mm: float) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return the lattice's lower corner, a cell's edges, and which cells are at least half full."""
    low, high = surface.bounds_mm
    nx, ny, nz = (max(int(n), 1) for n in np.ceil((high - low) / cell_mm - 1e-6))
    most = surface.volume_mm3 / cell_mm**3
    if most > _MOST_CELLS or max(nx, ny, nz) * _ACROSS > MOST_VOXELS:
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: the part would come to {most:.3g} cells; up to {_MOST_CELLS} "
            "are possible: take larger ones"
        )
    edges = (high - low) / (nx, ny, nz)
    share = inside_shares(surface, Grid(as_point(low), as_point(edges), (nx, ny, nz)), _ACROSS)
    return low, edges, share >= 0.5


def _joined(full: BoolArray) -> tuple[BoolArray, int]:
    """Return the cells without specks, and how many bodies they make."""
    from scipy.ndimage import label

    number, _ = label(full)
    size = np.bincount(number.ravel())
    size[0] = 0
    large = size >= _SPECK * max(int(size.sum()), 1)
    return large[number], int(large.sum())


# ------------------------------------------------------------------------------------------------
# The model.


@dataclass(frozen=True, slots=True)
class ExportedMaterial:
    """A material of the model.

    Attributes
    ----------
    modulus_MPa
        Secant modulus at the working strain.
    cells, volume_mm3
        Made of it.
    law
        ``Marlow``, ``Yeoh`` or ``plastic``; None in a file for ParaView.
    to_strain, fit_error
        Up to which strain CalculiX' law follows the palette's tensile curve, and its largest
        relative error of stress there; None for others, which take the curve or none.
    """

    name: str
    coordinate: float
    modulus_MPa: float
    cells: int
    volume_mm3: float
    law: str | None = None
    to_strain: float | None = None
    fit_error: float | None = None


@dataclass(frozen=True, eq=False)
class Export:
    """A finite-element model of a part, as the bytes of a file.

    Attributes
    ----------
    name
        The part's file.
    to
        ``abaqus``, ``calculix`` or ``vtu``.
    data
        The file.
    cell_mm
        Edges of a cell along x, y, z.
    volume_mm3, part_mm3
        Of the cells and of the part.
    notes
        What was assumed, one sentence each; cautions ask for an act.
    """

    name: str
    to: Literal["abaqus", "calculix", "vtu"]
    data: bytes = field(repr=False)
    cell_mm: tuple[float, float, float]
    cells: int
    nodes: int
    volume_mm3: float
    part_mm3: float
    materials: tuple[ExportedMaterial, ...]
    notes: tuple[str, ...] = ()

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.name} for {self.to}: {counted(self.cells, 'cell')}, {self.nodes} nodes, "
            f"{counted(len(self.materials), 'material')}, volume {self.volume_error:+.1%}"
        )

    @property
    def volume_error(self) -> float:
        """Volume of the cells over the part's, less 1."""
        return self.volume_mm3 / self.part_mm3 - 1.0

    def write(self, output: str | Path | None = None, *, force: bool = False) -> Path:
        """Write the file, <part>.inp or .vtu by default, whole or not at all; return its path.

        Raises
        ------
        OutputError
            It is there and `force` is not set, or it cannot be written.
        """
        own = f"{Path(self.name).stem}.{'vtu' if self.to == 'vtu' else 'inp'}"
        path = Path(own if output is None else output)
        check_absent(path, force=force)
        write_whole(path, self.data)
        return path

    def document(self) -> dict[str, Any]:
        """Return what the model is as JSON holds it."""
        said = asdict(self)
        del said["data"]
        return {"schema": 1, "source": said.pop("name"), **said}

    json = json_of


def export(
    source: object,
    *,
    to: str,
    cell_mm: float | None = None,
    fix: Sequence[str] = (),
    load: Sequence[str] = (),
    moment: Sequence[str] = (),
    pressure: Sequence[str] = (),
    move: Sequence[str] = (),
    gravity: str | Sequence[float] | None = None,
    to_strain: float | None = None,
    material: str | None = None,
    unit: str | None = None,
    bodies: str | None = None,
    printer: str | Printer | None = None,
    palette: str | Path | Palette | None = None,
) -> Export:
    """Make a finite-element model of a planned part: hexahedra of 20 nodes, each in its material.

    Cells of an even lattice that are at least half full of the part stand for it, so that any part
    has a mesh; curved and slanted faces are stairs.

    Parameters
    ----------
    source
        A plan, just made, read back, or the path of a plan.json or its folder; or a mesh, by path
        or value, with a `material`.
    to
        ``abaqus`` (Marlow's law: the palette's own tensile curves), ``calculix`` (Yeoh's law, the
        nearest that is stable, or for what yields an elastic-plastic one) or ``vtu`` (ParaView:
        material, coordinate and modulus of every cell).
    cell_mm
        Edge of a cell; by default what makes about 15000, and comes nearest to the part's volume.
    fix, load, moment, pressure, move, gravity
        What holds and loads the part, as `LoadCase` has it; without any the file has no
        step. Each is also a set of nodes or faces.
    to_strain
        Strain up to which CalculiX' laws are to follow the palette's curves, within 2 % at rest and
        5 % beyond. By default one and a half times the largest that the part reaches under its
        loads, as `planner.simulate` finds with large cells, or without loads the break. Where no
        law does, the note and the file say how far it goes.
    material, unit, bodies
        Of a mesh, as `planner.grade` has the last two.
    printer, palette
        By name, file or value; by default those of the plan, else the Connex3 and its own.

    Returns
    -------
    Export
        `Export.write` writes it.

    Raises
    ------
    PlannerError
        Bad input, with what to do about it.

    Examples
    --------
    >>> planner.export("finger-graded", to="calculix").write("finger.inp")  # doctest: +SKIP
    """
    check_known(to, _TARGETS, f"`to` {to}: {{}}it may be")
    if to_strain is not None:
        positive(to_strain, "`to_strain`")
    case = LoadCase(
        fix=fix, load=load, moment=moment, pressure=pressure, move=move, gravity=gravity
    )
    is_loaded = not case.is_empty
    if is_loaded and to == "vtu":
        raise ArgumentError("`to` vtu: loads and supports have no place in it; leave them out")
    solid = open_solid(source, material, unit, printer, palette, bodies)
    part_mm3 = solid.surface.volume_mm3
    about = (part_mm3 / _CELLS) ** (1.0 / 3.0)
    edge = _fitting_cell_mm(solid.surface, about) if cell_mm is None else cell_mm
    mesh = _hexahedra(solid.surface, edge)
    model = CoefficientModel(solid.palette)
    strain = solid.at_strain
    coordinate = solid.filling(mesh.middle_mm)
    levels, of_cell, notes = _mixtures(coordinate, model, strain)
    notes = (*solid.notes, *_mesh_notes(mesh, part_mm3), *notes)
    elements = [np.flatnonzero(of_cell == k) for k in range(len(levels))]
    moduli = model.modulus_MPa(levels, strain).tolist()
    each = zip(_names(levels, model), levels.tolist(), moduli, elements, strict=True)
    materials = [
        ExportedMaterial(name, m, modulus, len(own), len(own) * mesh.cell_mm3)
        for name, m, modulus, own in each
    ]
    if to == "vtu":
        corners, nodes = np.unique(mesh.nodes[:, :8], return_inverse=True)
        values: dict[str, FloatArray | IntArray] = {
            "material": of_cell.astype(np.int32),
            "coordinate": coordinate,
            "modulus_MPa": model.modulus_MPa(coordinate, strain),
        }
        data = encode_vtu(mesh.node_mm[corners], [nodes.reshape(-1, 8)], cell_data=values)
    else:
        if to == "calculix" and is_loaded and to_strain is None:
            to_strain, words = _reached(solid, case, model)
            notes = (*notes, words)
        laws = [_law(one, model, to, to_strain or np.inf) for one in materials]
        materials = [law.material for law in laws]
        if not is_loaded:
            notes = (*notes, "nothing holds or loads the part: the file has no *STEP; add one")
        if to == "calculix":
            notes = (*notes, *_law_notes(laws, to_strain or np.inf))
        remarks = [
            f"{solid.name}: {len(mesh.nodes)} cells of {sized(mesh.cell_mm)} mm",
            f"cells at least half full of the part: {mesh.volume_mm3:.6g} mm3 for "
            f"{part_mm3:.6g} mm3 ({mesh.volume_mm3 / part_mm3 - 1.0:+.1%})",
        ]
        step = _step(mesh, laws, solid.surface, case, to, remarks) if is_loaded else ([], [], [])
        lines = _inp(mesh, remarks, elements, laws, to, *step)
        data = ("\n".join(lines) + "\n").encode("ascii", "replace")
    return Export(
        name=solid.name,
        to=to,  # type: ignore[arg-type]  # one of _TARGETS
        data=data,
        cell_mm=as_point(mesh.cell_mm),
        cells=len(mesh.nodes),
        nodes=len(corners if to == "vtu" else mesh.node_mm),
        volume_mm3=mesh.volume_mm3,
        part_mm3=part_mm3,
        materials=tuple(materials),
        notes=notes,
    )


def _mesh_notes(mesh: _Hexahedra, part_mm3: float) -> Iterator[str]:
    off = mesh.volume_mm3 / part_mm3 - 1.0
    words = f"the cells have {abs(off):.1%} {'more' if off > 0 else 'less'} volume than the part"
    if abs(off) > _FAR_OFF:
        yield Caution(f"{words}; take smaller cells")
    elif abs(off) > _SAME:  # else a box
        yield f"{words}; slanted and curved faces are stairs of {mesh.cell_mm.max():.3g} mm"
    if mesh.pieces > 1:
        yield Caution(
            f"the cells make {mesh.pieces} bodies that no face joins, each of which must be held; "
            "if the part is one, take smaller cells"
        )
    if mesh.dropped_mm3 > 0.0:
        yield f"{mesh.dropped_mm3:.2g} mm3 of cells that hang on nothing are left out"


# ------------------------------------------------------------------------------------------------
# Materials


def _mixtures(
    coordinate: FloatArray, model: CoefficientModel, strain: float
) -> tuple[FloatArray, IntArray, tuple[str, ...]]:
    """Return the coordinates of materials, which of them each cell is made of, and notes."""
    levels, of_cell = np.unique(np.round(coordinate, 9), return_inverse=True)
    if len(levels) <= _MOST_MATERIALS:
        return levels, of_cell, ()
    edges = np.linspace(levels[0], levels[-1], _BINS + 1)
    of_bin = np.clip(np.searchsorted(edges, coordinate, side="right") - 1, 0, _BINS - 1)
    used, of_cell = np.unique(of_bin, return_inverse=True)
    means = np.bincount(of_cell, weights=coordinate) / np.bincount(of_cell)
    steps = np.log(model.modulus_MPa(edges[1:], strain) / model.modulus_MPa(edges[:-1], strain))
    half = np.expm1(0.5 * float(steps.max()))
    return means, of_cell, (f"{len(used)} materials stand for all mixtures, within {half:.0%}",)


def _names(levels: FloatArray, model: CoefficientModel) -> Iterator[str]:
    ids = {round(m.coordinate, 9): m.id for m in model.palette.materials}
    for number, m in enumerate(levels.tolist()):
        word = ids.get(round(m, 9)) or f"m{m:.4f}"
        yield f"M{number:02d}_" + re.sub(r"[^A-Za-z0-9_-]", "_", word)


class _Law(NamedTuple):
    """A material, its lines in the file, and up to where its curve rises.

    Without a density (NaN) nothing of it weighs.
    """

    material: ExportedMaterial
    lines: Sequence[str]
    end: float
    density_g_cm3: float


def _law(made: ExportedMaterial, model: CoefficientModel, to: str, to_strain: float) -> _Law:
    """Return a material with its law: its curve, or what CalculiX has that is nearest."""
    end = float(np.interp(made.coordinate, model.coordinates, model.breaks))
    densities = np.array([m.density_g_cm3 for m in model.palette.materials], dtype=np.float64)
    density = float(np.interp(made.coordinate, model.coordinates, densities))
    # Closer at rest, where the curve bends most.
    strain = end * np.linspace(0.0, 1.0, _CURVE_POINTS + 1)[1:] ** 2
    stress = model.nominal_stress_MPa(made.coordinate, 1.0 + strain)
    kept = np.logical_and.accumulate(np.diff(stress, prepend=-np.inf) > 0.0)  # while it rises
    strain, stress = strain[kept], stress[kept]
    modulus = float(model.modulus_MPa(made.coordinate, 0.0))
    if to == "abaqus":
        made, words = replace(made, law="Marlow"), "Marlow's law is its curve"
        law = [f"*HYPERELASTIC, MARLOW, POISSON={POISSON:g}", "*UNIAXIAL TEST DATA"]
        law += [f"{s:.9g}, {e:.9g}" for e, s in np.stack([strain, stress], axis=1).tolist()]
    else:
        reached = min(to_strain, float(strain[-1]))
        fitted, error = _stable_yeoh(strain, stress, modulus, reached)
        rows = hardening(strain, stress, modulus) if error > _WITHIN else None
        if rows is not None:
            made = replace(made, law="plastic", to_strain=float(strain[-1]))
            law = ["*ELASTIC", f"{modulus:.9g}, {POISSON:g}", "*PLASTIC"]
            law += [f"{s:.9g}, {e:.9g}" for s, e in rows.tolist()]
        else:
            while error > _WITHIN:
                reached *= _LESS
                fitted, error = _stable_yeoh(strain, stress, modulus, reached)
            made = replace(made, law="Yeoh", to_strain=reached, fit_error=error)
            law = ["*HYPERELASTIC, YEOH", _yeoh_line(fitted)]
        off = "on" if made.fit_error is None else f"within {error:.1%} of"
        words = f"{made.law} law, {off} its curve up to strain {made.to_strain:.3g}"
    remark = (
        f"coordinate {made.coordinate:.4g}, secant modulus {made.modulus_MPa:.4g} MPa, "
        f"breaks at strain {end:.3g}; {words}"
    )
    if np.isfinite(density):
        law += ["*DENSITY", f"{1e-9 * density:.9g}"]
    section = f"*SOLID SECTION, ELSET={made.name}, MATERIAL={made.name}"
    lines = [f"** {remark}", f"*MATERIAL, NAME={made.name}", *law, section]
    return _Law(made, lines, float(strain[-1]), density)


def _yeoh_line(law: Yeoh) -> str:
    # The first D is 2 over the bulk modulus. CalculiX takes 0 for a stiff default, so the
    # others, which divide what J adds in higher powers, are large.
    c1, c2, c3 = (1.5 / (1.0 + POISSON) * c for c in law.c_MPa)
    bulk = 2.0 * c1 * 2.0 * (1.0 + POISSON) / (3.0 * (1.0 - 2.0 * POISSON))
    return f"{c1:.9g}, {c2:.9g}, {c3:.9g}, {2.0 / bulk:.9g}, 1e9, 1e9"


def _reached(solid: Solid, case: LoadCase, model: CoefficientModel) -> tuple[float, str]:
    """Return the strain up to which laws matter under the loads given, and words on it."""
    cell_mm = COARSER * default_cell_mm(solid.surface)
    unknown = (
        "the strain that the part reaches is not known: laws go to the break, or give `to_strain`"
    )
    try:
        (found,) = simulate_part(solid, case, cell_mm=cell_mm, steps=1, compare_cells=False)
    except PlannerError as error:
        return np.inf, f"{unknown} ({error})"
    if found.steps.lost is not None:
        return np.inf, f"{unknown} (with cells of {cell_mm:.2g} mm it is unstable)"
    ends = np.interp(found.surface_coordinate, model.coordinates, model.breaks)
    most = float((found.steps.strain_over_break[-1] * ends).max())
    to_strain = round(_ROUND * max(float(np.ceil(_MARGIN * most / _ROUND)), 1.0), 9)
    return to_strain, (
        f"with cells of {cell_mm:.2g} mm the largest strain is {most:.2g}: laws follow the palette "
        f"up to {to_strain:.2g}, or to the break"
    )


def _law_notes(laws: Sequence[_Law], to_strain: float) -> Iterator[str]:
    if hard := [one.material.name for one in laws if one.material.law == "plastic"]:
        yield (
            f"{', '.join(hard)}: no rubber of CalculiX bends over as the curve does; *ELASTIC and "
            "*PLASTIC follow it while the load grows, and keep a set where it is taken off"
        )
    if short := [
        f"{one.material.name} {strain:.2g}"
        for one in laws
        if (strain := one.material.to_strain) is not None and strain < min(to_strain, one.end)
    ]:
        yield (
            f"stable laws of CalculiX are within {_WITHIN:.0%} of the palette up to these strains "
            f"only: {', '.join(short)}; Abaqus takes the curve itself"
        )


# ------------------------------------------------------------------------------------------------
# What is held and loaded, on the cells' outer faces


_On = TypeVar("_On", bound=Condition)


def _step(
    mesh: _Hexahedra, laws: Sequence[_Law], part: Mesh, case: LoadCase, to: str, remarks: list[str]
) -> tuple[list[str], list[str], list[str]]:
    """Return the lines of sets of nodes, of sets of elements, and of what holds and loads them.

    What the names in them stand for is added to the remarks.
    """
    surface = halve_long_edges(part, 0.5 * float(mesh.cell_mm.min()))[0]
    conditions = read_conditions(surface, case)
    if conditions.gravity is not None and not all(np.isfinite(law.density_g_cm3) for law in laws):
        raise ArgumentError("`gravity`: the palette tells no density of a material; add it there")
    facet = _facets(mesh, surface)

    def named(word: str, given: Sequence[_On]) -> Iterator[tuple[str, _On, IntArray]]:
        for number, one in enumerate(given, start=1):
            faces = np.flatnonzero(one.facets[facet])
            if not len(faces):
                raise ArgumentError(
                    f"{one.selector}: no face of the cells stands for it; take a smaller `cell_mm`"
                )
            remarks.append(f"{word}{number}: {one.selector}")
            yield f"{word}{number}", one, faces

    node_sets, element_sets, held, forces, pressures = (list[str]() for _ in range(5))
    output = ["*OUTPUT, FIELD", "*NODE OUTPUT", "U, RF", "*ELEMENT OUTPUT", "S, LE"]
    if to == "calculix":
        output = ["*NODE FILE", "U, RF", "*EL FILE", "S, E"]
    wanted_mm = np.full(mesh.node_mm.shape, np.nan)
    for name, support, faces in named("HELD", conditions.supports):
        nodes = np.unique(_nodes(mesh, faces))
        wanted = np.array([np.nan if u is None else u for u in support.displacement_mm])
        # On an edge between two that want different things the first has its way.
        with np.errstate(invalid="ignore"):
            nodes = nodes[~(np.abs(wanted_mm[nodes] - wanted) > 0.0).any(axis=1)]
        wanted_mm[nodes] = np.where(np.isnan(wanted), wanted_mm[nodes], wanted)
        node_sets += _listed(f"*NSET, NSET={name}", nodes)
        given = [(k, u) for k, u in enumerate(support.displacement_mm, 1) if u is not None]
        held += ["*BOUNDARY", *(f"{name}, {axis}, {axis}, {u:.9g}" for axis, u in given)]
        if to == "calculix":
            output += [f"*NODE PRINT, NSET={name}, TOTALS=ONLY", "RF"]
    for name, force, faces in named("LOAD", conditions.forces):
        nodes, share = _spread(mesh, faces)
        forces += _pulled(name, nodes, share[:, None] * np.array(force.force_N))
    for name, moment, faces in named("MOMENT", conditions.moments):
        nodes, share = _spread(mesh, faces)
        turning = couple(share, mesh.node_mm[nodes], np.array(moment.moment_N_mm))
        forces += _pulled(name, nodes, turning)
    for name, push, faces in named("PRESSURE", conditions.pressures):
        cell, face = mesh.outer[faces].T
        for side in np.unique(face).tolist():
            own = f"{name}_S{side + 1}"
            element_sets += _listed(f"*ELSET, ELSET={own}", cell[face == side])
            pressures.append(f"{own}, P{side + 1}, {push.pressure_MPa:.9g}")
        nodes, missing_N = _missing(mesh, faces, surface, push)
        if missing_N.any():
            forces += _pulled(name, nodes, missing_N)
            remarks.append(f"{name}'s cells end elsewhere than the part: forces make up for it")
    if conditions.gravity is not None:
        x, y, z = conditions.gravity
        pressures.append(f"EALL, GRAV, {_GRAVITY_MM_S2:g}, {x:.9g}, {y:.9g}, {z:.9g}")
    begin = "*STEP, NLGEOM=YES, INC=1000" if to == "abaqus" else "*STEP, NLGEOM, INC=1000"
    loads = [*held, *forces, *(["*DLOAD", *pressures] if pressures else [])]
    step = [begin, "*STATIC", "0.1, 1., 1e-6, 0.2", *loads, *output, "*END STEP"]
    return node_sets, element_sets, step


def _pulled(name: str, nodes: IntArray, forces_N: FloatArray) -> Iterator[str]:
    yield from (f"** {name}", "*CLOAD")
    for row, axis in np.argwhere(forces_N).tolist():
        yield f"{nodes[row] + 1}, {axis + 1}, {forces_N[row, axis]:.9g}"


_ROUNDING = 1e-9
"""Of the force on a cell's face: less is missing only by rounding."""


def _missing(
    mesh: _Hexahedra, faces: IntArray, surface: Mesh, push: Pressure
) -> tuple[IntArray, FloatArray]:
    """Return nodes of faces, and forces at them to which a pressure there falls short.

    Faces of cells end elsewhere than the part's facets, and so does their resultant: with these
    forces, which do not turn with the faces, it has the part's force and moment.
    """
    nodes, share = _spread(mesh, faces)
    place_mm = mesh.node_mm[nodes]

    def resultant(at_mm: FloatArray, outwards_mm2: FloatArray) -> FloatArray:
        pull_N = -push.pressure_MPa * outwards_mm2
        return np.array(
            [pull_N.sum(axis=0), np.cross(at_mm - share @ place_mm, pull_N).sum(axis=0)]
        )

    part_mm, part_mm2 = surface.triangles.mean(axis=1), surface.area_vectors_mm2
    cells_mm2 = mesh.outer_mm2[:, None] * mesh.outer_normal
    force, moment = resultant(part_mm[push.facets], part_mm2[push.facets]) - resultant(
        mesh.outer_middle_mm[faces], cells_mm2[faces]
    )
    missing_N = share[:, None] * force + couple(share, place_mm, moment)
    rounded_N = _ROUNDING * abs(push.pressure_MPa) * mesh.outer_mm2.max()
    return nodes, np.where(np.abs(missing_N) > rounded_N, missing_N, 0.0)


def _facets(mesh: _Hexahedra, surface: Mesh) -> IntArray:
    """Return the facet of the part that each outer face of the cells stands for.

    It is the nearest that faces the same way, if any of the nearest ones does.
    """
    from scipy.spatial import cKDTree

    k = min(_NEIGHBOURS, len(surface.faces))
    _, near = cKDTree(surface.triangles.mean(axis=1)).query(mesh.outer_middle_mm, k=k)
    near = np.asarray(near).reshape(-1, k)
    agrees = np.einsum("nki,ni->nk", surface.area_vectors_mm2[near], mesh.outer_normal) > 0.0
    return np.asarray(near[np.arange(len(near)), agrees.argmax(axis=1)])


def _nodes(mesh: _Hexahedra, faces: IntArray) -> IntArray:
    """Return the eight nodes of outer faces, corners first."""
    cell, face = mesh.outer[faces].T
    return np.asarray(mesh.nodes[cell[:, None], _FACE_NODES[face]])


def _spread(mesh: _Hexahedra, faces: IntArray) -> tuple[IntArray, FloatArray]:
    """Return nodes of faces and the share of each in their area, as quadratic functions have it."""
    area = mesh.outer_mm2[faces]
    # Of a face of eight nodes: -1/12 at corners, 1/3 at the middles of its edges.
    weight = np.array([-1.0 / 12.0] * 4 + [1.0 / 3.0] * 4)
    nodes, at = np.unique(_nodes(mesh, faces), return_inverse=True)
    share = np.bincount(at.ravel(), weights=np.outer(area, weight).ravel())
    return nodes, share / area.sum()


# ------------------------------------------------------------------------------------------------
# INP, what Abaqus and CalculiX read: mm, N, MPa, t, s.


_PER_LINE = 16  # entries that a line may have in either program

_GRAVITY_MM_S2 = 9806.65


def _inp(
    mesh: _Hexahedra, remarks: Sequence[str], elements: Sequence[IntArray], laws: Sequence[_Law],
    to: str, node_sets: list[str], element_sets: list[str], step: list[str],
) -> Iterator[str]:  # fmt: skip
    yield "*HEADING"
    yield remarks[0]
    yield from (f"** {line}" for line in remarks[1:])
    yield "** units: mm, N, MPa, t, s"
    yield "*NODE, NSET=NALL"
    for number, (x, y, z) in enumerate((mesh.node_mm + 0.0).tolist(), start=1):
        yield f"{number}, {x:.9g}, {y:.9g}, {z:.9g}"
    kind = "C3D20RH" if to == "abaqus" else "C3D20R"
    for law, own in zip(laws, elements, strict=True):
        yield f"*ELEMENT, TYPE={kind}, ELSET={law.material.name}"
        for row in (np.column_stack([own, mesh.nodes[own]]) + 1).tolist():
            yield ", ".join(map(str, row[:_PER_LINE])) + ","
            yield ", ".join(map(str, row[_PER_LINE:]))
    yield "*ELSET, ELSET=EALL"
    yield from (law.material.name for law in laws)
    low, high = mesh.node_mm.min(axis=0), mesh.node_mm.max(axis=0)
    for a, (axis, edge) in enumerate(zip("XYZ", mesh.cell_mm.tolist(), strict=True)):
        for end, place in (("MIN", low), ("MAX", high)):
            nodes = np.flatnonzero(np.abs(mesh.node_mm[:, a] - place[a]) < 1e-6 * edge)
            yield from _listed(f"*NSET, NSET={axis}{end}", nodes)
    yield from node_sets
    for law in laws:
        yield from law.lines
    yield from element_sets
    yield from step


def _listed(head: str, numbers: IntArray) -> Iterator[str]:
    yield head
    counted = (np.asarray(numbers) + 1).tolist()
    for start in range(0, len(counted), _PER_LINE):
        yield ", ".join(map(str, counted[start : start + _PER_LINE]))


# ------------------------------------------------------------------------------------------------
# A Yeoh law nearest to a tensile curve among those that are stable up to its break.


# With an energy W of the first invariant alone the stress of a tensile test is
#
#     P = 2 W'(I1) (l - l^-2),   W' = C10 + 2 C20 (I1 - 3) + 3 C30 (I1 - 3)²,
#
# linear in the coefficients. In principal logarithmic strains, their sum 0, the second derivative
# of W along n is 4 W' S + 4 W'' T² with S = sum l² n² and T = sum l² n; by Cauchy and Schwarz
# T² <= S (I1 - 9 / I2). So the material is stable in Drucker's sense wherever
#
#     W' > 0  and  W' + W'' (I1 - 9 / I2) > 0.
#
# Where W'' < 0 the second is the harder, and hardest where I2 is largest: at a given I1 that is
# stretch in two directions alike. Both are linear in the coefficients, so that the law whose
# largest relative error of stress is least is the solution of a linear programme.

_STABLE_POINTS = 60
_FARTHEST = 1.1
"""Times the strain up to which stability is asked. Chosen: a solver's first guess near the break is
not lost yet; with 2 a law that goes to strain 0.3 is a third worse."""

_SLIGHTEST = 0.02
"""Least tangent over the stress of the curve's own. Chosen: enough that Newton's method of any
solver converges; without it the programme would go to the brink of instability."""

_REST = (0.98, 1.0133)
"""Between which the modulus at rest over the curve's own is held: 2 %, also where a reader of the
law takes it for incompressible, which at Poisson's ratio 0.49 adds 0.67 %."""

_BEYOND = 3.0
"""The error beyond the strain that matters may grow with this power of the strain. Chosen: the
square costs a third more error before, the fourth power gains next to nothing there."""


def _stable_yeoh(
    strain: FloatArray, stress_MPa: FloatArray, modulus_MPa: float, to_strain: float
) -> tuple[Yeoh, float]:
    """Fit a tensile curve up to its break, nearest up to a strain.

    Also returned is the largest relative error of stress up to that strain.

    Parameters
    ----------
    strain, stress_MPa : (n,)
        Engineering strains, rising from above 0 to the break, and nominal stresses above 0.
    modulus_MPa
        At rest.
    to_strain
        Up to where the error is least; beyond, it may grow. Up to this stretch in two directions
        alike, and up to the break in one, the law is stable in every mode.
    """
    from scipy.optimize import linprog

    y, slope = first_invariant(strain), stress_MPa / (2.0 * (1.0 + strain - (1.0 + strain) ** -2))
    fit = _slopes(y) / slope[:, None]
    both = 1.0 + _FARTHEST * to_strain  # a sheet stretched in two directions
    most = max(float(first_invariant(_FARTHEST * strain[-1])), 2.0 * both**2 + both**-4 - 3.0)
    far = most * np.linspace(0.0, 1.0, _STABLE_POINTS + 1)[1:] ** 2
    own = np.interp(far, y, slope)
    positive = _slopes(far) / own[:, None]
    curvatures = np.stack([np.zeros_like(far), np.full_like(far, 2.0), 6.0 * far], axis=1)
    stable = positive + curvatures * _reach(far)[:, None] / own[:, None]
    allowed, none = np.maximum(strain / to_strain, 1.0)[:, None] ** _BEYOND, np.zeros((len(far), 1))
    sides = [[fit, -allowed], [-fit, -allowed], [-positive, none], [-stable, none]]
    first = modulus_MPa / 6.0 * _REST[0], modulus_MPa / 6.0 * _REST[1]
    found = linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=np.block(sides),
        b_ub=np.repeat([1.0, -1.0, -_SLIGHTEST], [len(y), len(y), 2 * len(far)]),
        bounds=[first, *2 * [(None, None)], (0, None)],
    )
    c1, c2, c3, error = np.asarray(found.x).tolist()
    return Yeoh((c1, c2, c3)), error


def _slopes(y: FloatArray) -> FloatArray:
    """Return W' of each coefficient alone."""
    return np.stack([np.ones_like(y), 2.0 * y, 3.0 * y * y], axis=1)


def _reach(y: FloatArray) -> FloatArray:
    """Return I1 - 9 / I2 at I1 = 3 + y of a sheet stretched in two directions alike."""
    stretch = np.geomspace(1.0, 1.0 + np.sqrt(3.0 + float(y.max())), 4001)
    first = 2.0 * stretch**2 + stretch**-4 - 3.0
    return 3.0 + y - 9.0 / np.interp(y, first, stretch**4 + 2.0 * stretch**-2)
