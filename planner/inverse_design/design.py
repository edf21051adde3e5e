"""Design a part's gradient so that it deforms as wanted, and plan it in materials that print."""

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from planner.cutting.grid import default_pitch_mm
from planner.errors import ArgumentError, FileError, ThinBandError, did_you_mean, positive
from planner.fields.basic import Field, axis_field
from planner.fields.parse import Setting, TableFile, build_field
from planner.formats.field_file import encode_vti
from planner.formats.files import decode_document, encode_document, read_file
from planner.formats.mesh_file import read_mesh
from planner.formats.tables import encode_csv
from planner.glance import counted, html_of, one_line, outcome, percent
from planner.grading.grade import grade, open_part, refuse_oversize
from planner.grading.profile import Profile, stiffness_scale
from planner.grading.regions import point
from planner.grading.wish import Wish, targets_of
from planner.inverse_design.controls import Controls, lattice, lattice_counts, profile_knots
from planner.inverse_design.goals import Functional, Target, functionals, read_limits, read_target
from planner.materials.mixtures import CoefficientModel
from planner.mesh.halve import halve_long_edges
from planner.mesh.mesh import Mesh
from planner.mesh.part import place
from planner.numerics import FloatArray, interrupted, one_blas_thread
from planner.palette import Palette
from planner.plan import Plan
from planner.printers import Printer, load_printer, palette_of
from planner.simulation.loads import Conditions, LoadCase, palette_densities, read_conditions
from planner.simulation.part import (
    COARSER,
    check_effort,
    default_cell_mm,
    filling_along,
    finest_cell_mm,
    open_solid,
)

if TYPE_CHECKING:
    from planner.inverse_design.search import (
        Case,
        DesignProblem,
        Found,
        Solved,
        StiffnessRange,
        Tried,
    )
    from planner.simulation.cut_cells import CutCells

__all__ = ["DesignFinding", "DesignStage", "PartDesign", "Reached", "design"]

_MOST_KNOTS = 40

_Made = TypeVar("_Made")

_NUDGE = 1e-3
"""Of the range of ln(modulus): a profile that cuts a band thinner than a layer is moved by it."""

_PREFER = ("smooth", "soft")


class DesignStage(str):
    """What a design is doing, in words; `done` is about which share of the work is behind it."""

    done: float

    def __new__(cls, words: str, done: float) -> "DesignStage":
        """Return the words with the share."""
        made = super().__new__(cls, words)
        made.done = done
        return made


@dataclass(frozen=True, slots=True)
class Reached:
    """One target or limit, and what it came to.

    Attributes
    ----------
    target, case
        As it was written, and the load case's name.
    kind
        ``target``; ``near`` of what the design comes as near to as it can: points, and surfaces,
        whose figure is the root mean square deviation; ``<`` or ``>`` of a limit.
    wanted, unit
        The figure: of a stiffness, the displacement or force that it means.
    continuous, printed
        With the gradient as it is wanted, and with the materials of the plan.
    interval
        Holds what a print does, from the palette's uncertainty; None of a surface.
    error
        (printed - wanted) over wanted, of a surface over its longest way; None where nothing is
        wanted to move.
    reach
        The figure in the softest and in the stiffest material that is allowed; None where the part
        is not stable in it.
    largest
        Of a surface: the largest deviation of the printed part, mm.
    """

    target: str
    case: str
    kind: str
    unit: str
    wanted: float
    continuous: float
    printed: float
    interval: tuple[float, float] | None
    error: float | None
    reach: tuple[float | None, float | None] = (None, None)
    largest: float | None = None

    @property
    def hard(self) -> bool:
        """Whether it is to be met or kept."""
        return self.kind != "near"


@dataclass(frozen=True, slots=True)
class DesignFinding:
    """A target or limit that is not met, and why."""

    kind: str
    message: str


class Course(NamedTuple):
    """How a part deforms in a case, from rest to full load.

    Attributes
    ----------
    share : (k,)
        Of the load, from 0 to 1.
    displacement_mm : (k, N, 3)
        Of the cells' nodes.
    wanted, off_mm
        The shape that is wanted, and how far each vertex of the cells' surface is off it at last.
    """

    case: str
    share: FloatArray
    cells: "CutCells"
    displacement_mm: FloatArray
    wanted: Mesh | None
    off_mm: FloatArray | None


def _course(name: str, solved: "Solved", steps: int) -> Course:
    """Load a solved part once more, in steps."""
    from planner.simulation.solid import LostStabilityError

    states = [solved.mechanics.at_rest()]
    try:
        for state, _ in solved.mechanics.follow(np.linspace(0.0, 1.0, steps + 1)[1:-1].tolist()):
            states.append(state)
    except LostStabilityError:
        pass  # another way led to the last one
    states.append(solved.state)
    shapes, misses = solved.shapes, solved.deviations()
    return Course(
        name,
        np.array([state.share for state in states]),
        solved.mechanics.body.cells,
        np.stack([state.displacement_mm for state in states]),
        shapes[0].wanted.surface if shapes else None,
        misses[0].off_mm if misses else None,
    )


@dataclass(frozen=True, eq=False)
class PartDesign:
    """A gradient that was found, and the plan that prints it.

    Attributes
    ----------
    positions, moduli_MPa : (knots,)
        The profile along the field; of a lattice, its softest and stiffest.
    values : (n,)
        Of the knots or controls, from 0 (softest) to 1 (stiffest).
    free
        Of a lattice: its ``counts`` along x, y and z, the box it is over, ``bounds_mm``, and the
        axes across which it is ``symmetric``. Quadratic B-splines are between.
    table
        Of a lattice: the gradient as a VTI file.
    reached
        Of every target and limit.
    strain_over_break
        Largest in the printed materials, averaged over neighbouring cells; None without a limit.
    tried
        Equilibria that were solved for.
    interrupted
        Whether the search was ended before it was done.
    plan
        What is written: `PartDesign.write`.
    courses
        Of each case, if steps were asked for: what the slider of plan.html shows.
    """

    plan: Plan
    positions: tuple[float, ...]
    moduli_MPa: tuple[float, ...]
    values: tuple[float, ...]
    reached: tuple[Reached, ...]
    strain_over_break: float | None
    cell_mm: float
    level: float
    tried: int
    free: Mapping[str, Any] | None = None
    table: bytes | None = None
    interrupted: bool = False
    findings: tuple[DesignFinding, ...] = ()
    notes: tuple[str, ...] = ()
    courses: tuple[Course, ...] = ()

    _repr_html_ = html_of

    @one_line
    def __repr__(self) -> str:
        worst = max((abs(r.error or 0.0) for r in self.reached if _matters(r)), default=0.0)
        what = counted(len(self.values), "control" if self.free else "knot")
        return (
            f"{self.plan.part.name}: {counted(len(self.reached), 'target')}, worst missed by "
            f"{percent(worst)}, {what}; " + outcome((len(self.findings), "finding"))
        )

    @property
    def ok(self) -> bool:
        """Whether all targets and limits are met by the printed materials, and it will print."""
        return not self.findings and self.plan.ok

    def document(self) -> dict[str, Any]:
        """Return the design as JSON holds it; the plan has its own."""
        return {
            "schema": 1,
            "part": self.plan.part.file,
            "palette": asdict(self.plan.palette),
            "field": dict(self.plan.gradient.field),
            "profile": {
                "positions": list(self.positions),
                "moduli_MPa": list(self.moduli_MPa),
            },
            "free": None if self.free is None else dict(self.free),
            "values": list(self.values),
            "targets": [{**asdict(r), "hard": r.hard} for r in self.reached],
            "level": self.level,
            "strain_over_break": self.strain_over_break,
            "cell_mm": self.cell_mm,
            "tried": self.tried,
            "interrupted": self.interrupted,
            "findings": [asdict(f) for f in self.findings],
            "notes": list(self.notes),
        }

    def json(self) -> bytes:
        """Return `document` as bytes."""
        return encode_document(self.document())

    def profile_csv(self) -> bytes:
        """Return the profile as `planner.grade` reads it."""
        rows = zip(self.positions, self.moduli_MPa, strict=True)
        return encode_csv([("position", "modulus_MPa"), *rows], digits=6)

    def write(
        self,
        output: str | Path | None = None,
        *,
        force: bool = False,
        page: bytes | None = None,
    ) -> Path:
        """Write the plan's folder, with design.json and profile.csv beside plan.json.

        A lattice's gradient is there as field.vti, which ParaView opens and `planner.grade` takes.

        Raises
        ------
        OutputError
            The folder exists already, or cannot be written.
        """
        target = f"{self.plan.part.name}-designed" if output is None else output
        beside = {"design.json": self.json(), "profile.csv": self.profile_csv()}
        if self.table is not None:
            beside[_TABLE] = self.table
        return self.plan.write(target, force=force, page=page, beside=beside)


_TABLE = "field.vti"


def _matters(row: Reached) -> bool:
    """Tell whether an error is a miss: a limit's is one where it is passed."""
    return row.error is not None and (row.kind not in "<>" or _passed(row) > 0.0)


def _passed(row: Reached) -> float:
    over = abs(row.printed) / row.wanted - 1.0
    return over if row.kind == "<" else -over


def interrupted_design(folder: Path) -> bool:
    """Tell whether a folder holds a design whose search was ended before it was done."""
    file = folder / "design.json"
    if not file.is_file():
        return False
    return decode_document(read_file(file), _Document, str(file)).get("interrupted") is True


_Document = dict[str, Any]


def _begun(start: "str | Path | PartDesign | None", count: int) -> FloatArray | None:
    """Return the values of an earlier design to go on from."""
    if start is None:
        return None
    if isinstance(start, PartDesign):
        found: Any = start.values
    else:
        file = Path(start) / "design.json" if Path(start).is_dir() else Path(start)
        found = decode_document(read_file(file), _Document, str(file)).get("values")
    try:
        values = np.array(found, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (count,) or not ((values >= 0.0) & (values <= 1.0)).all():
        raise FileError(
            f"`start` {start if not isinstance(start, PartDesign) else 'design'}: it has no "
            f"{count} values from 0 to 1, one for each control of this design; give one with the "
            "same `free` or `knots`, or none"
        )
    return values


@one_blas_thread()
def design(
    part: object,
    *,
    from_: str | float,
    to: str | float,
    target: str | Sequence[str] = (),
    fix: str | Sequence[str] = (),
    load: str | Sequence[str] = (),
    pressure: str | Sequence[str] = (),
    move: str | Sequence[str] = (),
    gravity: str | Sequence[float] | None = None,
    moment: str | Sequence[str] = (),
    cases: Sequence[LoadCase] = (),
    limit: str | Sequence[str] = (),
    knots: int = 7,
    axis: str | tuple[float, float, float] | None = None,
    field: str | Field | Callable[[FloatArray], FloatArray] | None = None,
    free: str | None = None,
    symmetric: str = "",
    prefer: str = "smooth",
    robust: bool = False,
    blend: str | None = None,
    at_strain: float = 0.1,
    cell_mm: float | None = None,
    minutes: float | None = None,
    tolerance: float = 0.01,
    level: float = 0.95,
    start: "str | Path | PartDesign | None" = None,
    steps: int = 0,
    printer: str | Printer | None = None,
    palette: str | Path | Palette | None = None,
    unit: str | None = None,
    bodies: str | None = None,
    name: str | None = None,
    force_oversize: bool = False,
    progress: Callable[[str], None] = lambda stage: None,
) -> PartDesign:
    """Find the gradient with which a part deforms as wanted, and plan its print.

    What is searched for is ln(modulus): at evenly spaced knots of a field, or on a lattice of
    controls over the part. It is found by derivatives of the whole part's equilibrium, first on
    larger cells, then on those asked for; then it is planned, the plan's own materials are put into
    the cells, and the gradient is moved as a whole until what is printed reaches the targets.

    Parameters
    ----------
    part
        As `planner.grade` takes it.
    from_, to
        What stands at the beginning and the end of the gradient that the design sets out from, and
        the softest and stiffest that it may use: materials or moduli.
    target
        ``SELECTOR ux=VALUE mm`` (uy, uz): the mean displacement of faces; ``SELECTOR
        rx=VALUE deg`` (ry, rz): how far they turn; ``SELECTOR to SELECTOR distance=VALUE mm``;
        ``SELECTOR stiffness=VALUE N/mm`` of a load or motion there; ``SELECTOR fx=VALUE N`` of a
        support; ``shape: FILE.csv`` with x_mm, y_mm, z_mm, ux_mm, uy_mm, uz_mm; ``shape: FILE.stl``
        (or ``... on SELECTOR``), the part's surface as it is to be, best with the part's own
        triangles. ``weight 2`` behind one makes its miss count twice.
    fix, load, pressure, move, gravity, moment
        As of `LoadCase`.
    cases
        More load cases, each with its own targets and limits.
    limit
        ``strain/break<0.5``, ``slope<0.1 /mm`` (change of ln(modulus)), or a figure as of a target,
        without its sign: ``x=min uy<1 mm``.
    knots
        Of the profile.
    axis, field
        What the gradient follows, as `planner.grade`.
    free
        A lattice of controls instead: ``6x3x3`` (how many along x, y and z), ``8mm`` (their
        spacing) or ``auto``, which is taken for a shape by a surface where nothing else is said.
        Quadratic B-splines are between.
    symmetric
        Axes, as ``y`` or ``yz``, across whose middle plane of the part a lattice is its own mirror.
    prefer
        Of gradients that reach the targets: ``smooth``, which bends least and stays near the even
        gradient from `from_` to `to`, of a lattice near an even modulus; or ``soft``, which has
        least of what is stiff.
    robust
        Whether limits hold at the worst of the palette's interval, not for its own figures alone.
    blend
        As `planner.grade`: ``nearest`` or ``dither``.
    at_strain
        Working strain at which moduli are secants.
    cell_mm
        Edge of the cells; about 2000 by default.
    minutes
        Take the finest cells that are foretold to be done in that time, within a factor of two.
    tolerance
        Relative miss of a target that is accepted; of a surface, its root mean square over the
        longest way.
    level
        How probably an interval holds what a print does.
    start
        An earlier design, or its folder, to go on from.
    steps
        Of each load, to show on plan.html: the printed part is solved for each of them.
    printer, palette, unit, bodies, name, force_oversize
        As `planner.grade`.
    progress
        Called with a few words when a stage begins; they are a `DesignStage`, with the share of the
        work that is done.

    Returns
    -------
    PartDesign
        `PartDesign.ok` is false when a target or limit is missed: the nearest is returned. An
        interrupt ends the search, and the best so far is planned and returned.

    Raises
    ------
    PlannerError
        Bad input, with what to do about it.

    Examples
    --------
    >>> made = planner.design(  # doctest: +SKIP
    ...     "finger.stl", from_="Tango", to="Vero", axis="x",
    ...     fix="x=max", load="x=min: 0,0,-0.5 N", target="x=min uz=-12 mm",
    ... )
    >>> made.reached[0].printed, made.reached[0].interval  # doctest: +SKIP
    >>> made.write("finger-designed")  # doctest: +SKIP
    """
    own = LoadCase(target, fix, load, pressure, move, gravity, moment=moment)
    limits, figures = read_limits((limit,) if isinstance(limit, str) else limit)
    alone = bool(cases) and own.is_empty and not own.target
    cases = tuple(cases) if alone else (own, *cases)
    wanted = [_wanted_of(case) for case in cases]
    for aims in wanted if alone else wanted[:1]:
        aims += figures
    if not all(wanted) or not any(aim.sense == "=" for aims in wanted for aim in aims):
        raise ArgumentError("`target` is missing: give one, as target='x=min uz=-12 mm'")
    if not 2 <= knots <= _MOST_KNOTS:
        raise ArgumentError(f"`knots` {knots}: it must be a whole number from 2 to {_MOST_KNOTS}")
    if prefer not in _PREFER:
        hint = did_you_mean(prefer, _PREFER)
        raise ArgumentError(f"`prefer` {prefer}: {hint}it may be {' or '.join(_PREFER)}")
    if blend not in (None, "nearest", "dither"):
        raise ArgumentError(f"`blend` {blend}: a design is printed by nearest or by dither")
    surfaces = any(aim.surface_mm is not None for aims in wanted for aim in aims)
    if free is None and axis is None and field is None and surfaces:
        free = "auto"
    if free is not None and (axis is not None or field is not None):
        raise ArgumentError("give `free`, or `axis` or `field`, not both")
    if not set(symmetric) <= set("xyz") or (symmetric and free is None):
        raise ArgumentError(f"`symmetric` {symmetric}: it is x, y or z, or several, with `free`")
    if cell_mm is not None and minutes is not None:
        raise ArgumentError("give `cell_mm` or `minutes`, not both")
    positive(tolerance, "`tolerance`")
    machine = load_printer(printer or "connex3")
    chosen = palette_of(palette, machine)
    scale = stiffness_scale(chosen, at_strain)
    ends, _, _ = targets_of(Wish(start=from_, end=to, profile="log"), scale)
    low, high = sorted((ends.moduli_MPa[0], ends.moduli_MPa[-1]))

    progress(DesignStage("reading the part", 0.0))
    source = open_part(part, unit=unit, name=name, tray_mm=machine.tray_mm, bodies=bodies)
    if not force_oversize:
        refuse_oversize(source, machine)
    mesh = source.part.mesh
    placed, translation = place(mesh)
    setting = Setting(placed, point(translation), default_pitch_mm(placed))
    densities = palette_densities(chosen, cases)
    # Two searches of about ten gradients and the print's own, in one or two steps each.
    work = {"factors": 2 * len(cases), "solutions": 20 * len(cases)}
    edge = default_cell_mm(mesh) if cell_mm is None else cell_mm
    if minutes is not None:
        edge = finest_cell_mm(mesh, minutes, **work)
    effort = check_effort(mesh, edge, **work)
    extent = float(np.linalg.norm(np.ptp(mesh.bounds_mm, axis=0)))

    def posed(surface: Mesh) -> list[tuple[Conditions, list[Functional]]]:
        out = []
        for case, aims in zip(cases, wanted, strict=True):
            watch = [selector for aim in aims for selector in aim.selectors]
            on = read_conditions(surface, replace(case, watch=watch))
            out.append((on, functionals(aims, on, extent)))
        return out

    posed(halve_long_edges(mesh, 0.5 * edge)[0])  # what is wrong is told before the work
    progress(DesignStage("loading the solver", 0.0))
    from planner.inverse_design.search import Case, DesignProblem, StiffnessRange, search
    from planner.inverse_design.shape import ShapeGoal, wanted_shape
    from planner.materials.marlow import marlow_table
    from planner.simulation.cut_cells import FEWEST_ALONG, cut_cells
    from planner.simulation.solid import Body, LostStabilityError
    from planner.simulation.sparse_cholesky import analyse

    shapes = [
        [
            wanted_shape(a.text, a.selector, a.weight, a.surface_mm, _triangles(part, unit, mesh))
            for a in aims
            if a.surface_mm is not None
        ]
        for aims in wanted
    ]
    model = scale.model
    stiffness = StiffnessRange((low, high), model, at_strain)
    table = marlow_table(model)
    span_mm, along = 1.0, None
    says: dict[str, Any] | None = None
    if free is not None:
        hard = sum(aim.surface_mm is None for aims in wanted for aim in aims)
        box = np.ptp(mesh.bounds_mm, axis=0)
        counts = lattice_counts(free, box, hard + 12 * sum(map(len, shapes)))
        says = {
            "counts": list(counts), "bounds_mm": mesh.bounds_mm.tolist(),
            "symmetric": list(symmetric),
        }  # fmt: skip

        def freed(even: float) -> Controls:
            return lattice(mesh.bounds_mm, counts, ["xyz".index(c) for c in symmetric], even)

        controls = freed(0.5)
    else:
        along = axis_field(axis, placed) if field is None else build_field(field, setting)
        length = along.description().get("span_mm")
        span_mm = length if isinstance(length, float) else 1.0
        ramp = np.linspace(0.0, 1.0, knots)
        ramp = ramp if ends.moduli_MPa[0] < ends.moduli_MPa[-1] else ramp[::-1]
        if limits.slope is not None:  # the start keeps it, and so does every step
            span = abs(np.log(ends.moduli_MPa[-1] / ends.moduli_MPa[0]))
            ramp = 0.5 + (ramp - 0.5) * min(1.0, limits.slope * span_mm / span)
        values_along = along.values
        controls = profile_knots(lambda p: values_along(p + translation), ramp, span_mm)
    begun = _begun(start, len(controls.even))

    def cases_on(body: Body, before: "Sequence[Case]" = ()) -> list[Case]:
        cells, made = body.cells, []
        analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
        for number, (case, (on, goals)) in enumerate(zip(cases, posed(cells.surface), strict=True)):
            called = case.name or (f"case {number + 1}" if len(cases) > 1 else "")
            facets = {watched.selector: watched.facets for watched in on.watched}
            goal = [ShapeGoal.on(s, cells, facets.get(s.selector)) for s in shapes[number]]
            made.append(Case(called, cells, on, analysis, goals, body, goal))
            if before:
                made[-1].begin_from(before[number])
        return made

    def problem_on(size_mm: float, done: float, before: "Sequence[Case]" = ()) -> DesignProblem:
        words = f"cutting the part into cells of {size_mm:.3g} mm; all takes {effort}"
        progress(DesignStage(words, done))
        cells = cut_cells(mesh, size_mm)
        middle = float(stiffness.coordinates(np.array([0.5]))[0][0])
        body = Body(cells, table, np.full(len(cells.points), middle), densities=densities)
        made = cases_on(replace(body, stabiliser_MPa=body.cell_shear_MPa), before)
        normal = NormalDist().inv_cdf(0.5 + level / 2.0) if robust else 0.0
        return DesignProblem(stiffness, controls, made, limits, prefer, 0.3 * tolerance, normal)

    def told(stage: str, first: float, last: float) -> Callable[[int, float], None]:
        def tell(tried: int, off: float) -> None:
            done = first + (last - first) * min(tried / 15.0, 0.9)
            progress(DesignStage(f"{stage}: gradient {tried}, off by {percent(off)}", done))

        return tell

    longest_mm = float(np.ptp(mesh.bounds_mm, axis=0).max())
    larger_mm = max(edge, min(COARSER * edge, longest_mm / FEWEST_ALONG))
    near_share = 0.25  # of the work is done in the larger cells
    problem = problem_on(larger_mm, 0.0)  # to come near
    progress(DesignStage("larger cells: the softest and the stiffest that is allowed", 0.05))
    reach = _reach(problem)
    for words in _out_of_reach(problem, reach):
        progress(DesignStage(words, 0.1))
    if free is not None:
        controls = freed(_even(problem, reach))
        problem = replace(problem, controls=controls)
    found = None
    for stiffer in (0.0, 0.5, 0.75, 1.0):
        try:
            first = np.maximum(controls.even, stiffer) if begun is None else begun
            found = search(
                problem, first, tolerance=max(0.02, tolerance),
                progress=told("larger cells", 0.1, near_share),
            )  # fmt: skip
            break
        except LostStabilityError:
            continue
    if found is None:
        raise ArgumentError(
            "the part has no stable equilibrium under these loads even in the stiffest material; "
            "take smaller loads"
        )
    tried, best, stopped = found.tried, found.best, found.stopped

    def refined() -> "tuple[DesignProblem, Found]":
        finer = problem_on(edge, near_share, problem.cases)
        return finer, search(
            finer, best.values, tolerance=0.3 * tolerance, radius=0.1,
            progress=told("cells asked for", near_share, 0.7),
        )  # fmt: skip

    if not stopped:
        after = _unless_stopped(refined)
        stopped = after is None
        if after is not None:
            problem, found = after
            tried, best, stopped = tried + found.tried, found.best, found.stopped

    progress(DesignStage("planning the print", 0.7))

    def laid(values: FloatArray) -> tuple[Profile, Field, TableFile | None]:
        """Return the profile, the field that it is along, and the field as a table."""
        if along is not None:
            positions = tuple(np.linspace(0.0, 1.0, len(values)).tolist())
            moduli = tuple(stiffness.modulus_MPa(values).tolist())
            return Profile("designed", positions, moduli, "log"), along, None
        data = _encoded(controls, values, mesh.bounds_mm, counts, stiffness)
        held = TableFile(Path(_TABLE), "position", data)
        return Profile("designed", (0.0, 1.0), (low, high), "log"), held.field(setting), held

    gentler = "a coarser --free" if along is None else "fewer --knots"

    def planned(values: FloatArray) -> tuple[Plan, Field]:
        profile, field_laid, held = laid(values)
        try:
            plan = grade(
                part, profile=profile, axis=axis, field=held or field, blend=blend,
                at_strain=at_strain, printer=machine, palette=chosen, unit=unit, bodies=bodies,
                name=name, force_oversize=force_oversize,
            )  # fmt: skip
        except ArgumentError as error:
            raise type(error)(_own_advice(str(error), gentler)) from error
        advised = [replace(f, message=_own_advice(f.message, gentler)) for f in plan.findings]
        notes = _own_advice(plan.notes, gentler)
        return replace(plan, findings=tuple(advised), notes=notes), field_laid

    def solved_with(plan: Plan, follows: Field) -> "list[Solved]":
        if blend == "dither" or len(plan.regions) == 1:
            filling = filling_along(follows, plan, chosen)(problem.cases[0].cells.points_mm)
            return [case.solve(filling) for case in problem.cases]
        cells, filling = open_solid(plan, None, None, None, chosen).cut(problem_mm)
        body = Body(cells, table, filling, densities=densities)
        return [case.solve(filling) for case in cases_on(body, problem.cases)]

    problem_mm = edge if not stopped else float(problem.cases[0].cells.cell_mm.max())

    def printed(values: FloatArray) -> "tuple[FloatArray, Plan, list[Solved]]":
        try:
            plan, follows = planned(values)
        except ThinBandError:  # which goes where all is a bit softer
            values = values - _NUDGE * (values > _NUDGE)
            plan, follows = planned(values)
        return values, plan, solved_with(plan, follows)

    aims_met = np.array([goal.kind == "target" for goal in problem.goals], dtype=np.bool_)

    def offs(solved: "list[Solved]") -> FloatArray:
        """Return how far targets are off what the gradient comes to, relative to what is wanted."""
        figures = np.concatenate([s.values() for s in solved])
        each = zip(problem.goals, figures.tolist(), best.figures.tolist(), strict=True)
        missed = np.array([goal.off(now) - goal.off(aim) for goal, now, aim in each])
        return np.asarray(missed[aims_met])

    laid_out = _unless_stopped(lambda: printed(best.values))
    stopped = stopped or laid_out is None
    values, plan, solved = printed(best.values) if laid_out is None else laid_out
    tried += 1
    misses = offs(solved)
    least, kept = float(np.abs(misses).max(initial=0.0)), (values, plan, solved, misses)
    # One offset of the whole gradient; brackets close in where a secant may jump.
    base, way = values, np.ones(len(values))
    trail = [_Try(0.0, _signed(misses, best.slopes, way), plan)]
    for _ in range(8 if len(misses) and not stopped else 0):
        if least <= 0.5 * tolerance:
            break
        jumped = None if limits.slope is not None or free is not None else _jump(trail)
        if jumped is not None:
            # What is printed steps there, as a cut passes a wall: the others move, it does not.
            base = kept[0]
            at = np.linspace(0.0, 1.0, len(values))
            way = (np.abs(at - jumped) >= 1.0 / (len(values) - 1)).astype(np.float64)
            trail = [_Try(0.0, _signed(kept[3], best.slopes, way), kept[1])]
        shift = _next_shift(trail)
        values = np.clip(base + shift * way, 0.0, 1.0)
        if shift in [t.shift for t in trail] or np.array_equal(values, kept[0]):
            break
        progress(DesignStage(f"printed materials: off by {percent(least)}", 0.8))
        aimed = values
        laid_out = _unless_stopped(lambda aimed=aimed: printed(aimed))  # type: ignore[misc]
        if laid_out is None:
            stopped = True
            break
        values, plan, solved = laid_out
        tried += 1
        misses = offs(solved)
        trail.append(_Try(shift, _signed(misses, best.slopes, way), plan))
        if float(np.abs(misses).max()) < least:
            least, kept = float(np.abs(misses).max()), (values, plan, solved, misses)
    values, plan, solved, _ = kept

    rows, over = [], None
    figures_of = iter(zip(best.figures.tolist(), reach, strict=True))
    wanted_ways = problem.shape_deviations(best.values)
    for number, (case, one) in enumerate(zip(problem.cases, solved, strict=True)):
        intervals = _intervals(one, model, level)
        for goal, figure, span in zip(case.goals, one.values().tolist(), intervals, strict=True):
            off = None if not goal.wanted else figure / goal.wanted - 1.0
            continuous, ends_of = next(figures_of)
            rows.append(
                Reached(
                    goal.text, case.name, goal.kind, goal.unit, goal.wanted, continuous, figure,
                    span, off, ends_of,
                )
            )  # fmt: skip
        for wish, miss, ideal in zip(
            shapes[number], one.deviations(), wanted_ways[number], strict=True
        ):
            way_mm = wish.greatest_mm
            rows.append(
                Reached(
                    wish.text, case.name, "near", "mm off", 0.0, ideal.rms * way_mm,
                    miss.rms * way_mm, None, miss.rms, largest=miss.largest * way_mm,
                )
            )  # fmt: skip
        if limits.strain_over_break is not None:
            over = max(over or 0.0, one.over_break().largest)
    findings = _findings(
        rows, over, limits.strain_over_break, tolerance, values, problem, best,
        dithered=blend == "dither",
    )  # fmt: skip
    notes = [wish.note for each in shapes for wish in each]
    if free is not None:
        notes.append(
            f"{counted(len(values), 'control')} on a lattice of {' x '.join(map(str, counts))}; "
            "smoothness (the sum of squared second differences) weighs 1, a target's relative miss "
            "20, a shape's squared deviation over 0.3 of the tolerance 20"
        )
    if stopped:
        findings.insert(0, DesignFinding("interrupted", _INTERRUPTED.format(tried=tried)))
    profile, _, held = laid(values)
    courses: list[Course] = []
    if steps:
        progress(DesignStage("from rest to full load, for the page", 0.9))
        courses = [
            _course(c.name, one, steps) for c, one in zip(problem.cases, solved, strict=True)
        ]
    return PartDesign(
        courses=tuple(courses),
        plan=plan,
        positions=profile.positions,
        moduli_MPa=profile.moduli_MPa,
        values=tuple(float(f"{v:.9g}") for v in values),
        reached=tuple(rows),
        strain_over_break=over,
        cell_mm=problem_mm,
        level=level,
        tried=tried,
        free=says,
        table=None if held is None else held.data,
        interrupted=stopped,
        findings=tuple(findings),
        notes=(
            *notes,
            f"figures are those of cells of {problem_mm:.3g} mm; `planner simulate` of the plan "
            "tells how far they depend on the cells",
        ),
    )


def _unless_stopped(work: Callable[[], _Made]) -> _Made | None:
    """Return what work returns, or None where the user interrupts it."""
    try:
        return work()
    except (KeyboardInterrupt, SystemError) as error:
        if not interrupted(error):
            raise
        return None


_INTERRUPTED = (
    "the search was interrupted after {tried} gradients: this is the best of them, not corrected "
    "for rounding to materials; the same command goes on from here"
)


def _wanted_of(case: LoadCase) -> list[Target]:
    """Return the targets and limits of a case."""
    limits, figures = read_limits(case.limit)
    if limits.strain_over_break is not None or limits.slope is not None:
        raise ArgumentError(
            f"`limit` {case.limit[0]}: of strain and slope there is one limit for all cases; give "
            "it beside them"
        )
    return [*map(read_target, case.target), *figures]


def _triangles(part: object, unit: str | None, mesh: Mesh) -> FloatArray:
    """Return the part's triangles in the order of its file, (k, 3, 3)."""
    if isinstance(part, (str, Path)):
        return np.asarray(read_mesh(Path(part), unit).triangles, dtype=np.float64)
    return mesh.triangles


def _encoded(
    controls: Controls,
    values: FloatArray,
    bounds_mm: FloatArray,
    counts: Sequence[int],
    stiffness: "StiffnessRange",
) -> bytes:
    """Return a lattice's gradient as a VTI file: eight steps between controls, and the box's ends.

    Between points of a table values are linear: off by 1/64 of an eighth of a second difference.
    """
    steps = [8 * max(count - 2, 1) for count in counts]
    spacing = np.ptp(bounds_mm, axis=0) / steps
    index = np.stack(np.meshgrid(*(np.arange(n + 1) for n in steps), indexing="ij"), axis=-1)
    places = bounds_mm[0] + index.reshape(-1, 3) * spacing
    share = (controls.basis(places) @ values).reshape(index.shape[:3]).astype(np.float32)
    modulus = stiffness.modulus_MPa(share.astype(np.float64)).astype(np.float32)
    return encode_vti(bounds_mm[0], spacing, {"position": share, "modulus_MPa": modulus})


# ------------------------------------------------------------------------------------------------
# What is in reach: the softest and the stiffest answers, before the search.


_Ends = tuple[float | None, float | None]


def _reach(problem: "DesignProblem") -> list[_Ends]:
    """Return the figures of all goals in the softest and in the stiffest material."""
    from planner.simulation.solid import LostStabilityError

    found: list[list[float | None]] = []
    for share in (0.0, 1.0):
        coordinate, _ = problem.stiffness.coordinates(np.full(problem.basis.shape[0], share))
        each: list[float | None] = []
        for case in problem.cases:
            case.state = None
            try:
                each += case.solve(coordinate, steps=4).values().tolist()
            except LostStabilityError:
                each += [None] * len(case.goals)
        found.append(each)
    for case in problem.cases:
        case.state = None
    return list(zip(*found, strict=True))


def _out_of_reach(problem: "DesignProblem", reach: Sequence[_Ends]) -> list[str]:
    """Say which figures no even material gives."""
    out = []
    for goal, (soft, stiff) in zip(problem.goals, reach, strict=True):
        if goal.kind == "target" and soft is not None and stiff is not None:
            low, high = sorted((soft, stiff))
            if not low <= goal.wanted <= high:
                way = "the sign is the other one" if goal.wanted * (low + high) < 0.0 else ""
                out.append(
                    f"{goal.text}: all in the softest material comes to {soft:.4g} {goal.unit}, "
                    f"all in the stiffest to {stiff:.4g}; {way or 'a gradient may not get there'}"
                )
    return out


def _even(problem: "DesignProblem", reach: Sequence[_Ends]) -> float:
    """Return the share of stiffness at which an even part comes nearest to the targets."""
    shares = []
    for goal, (soft, stiff) in zip(problem.goals, reach, strict=True):
        if goal.kind == "target" and goal.wanted and soft and stiff and soft != stiff:
            figures = np.array([goal.wanted, stiff]) / soft
            if (figures > 0.0).all():
                wanted, span = np.log(figures)
                shares.append(float(np.clip(wanted / span, 0.05, 0.95)))
    return float(np.mean(shares)) if shares else 0.5


# ------------------------------------------------------------------------------------------------
# From the gradient to the print: one offset makes up for rounding to materials.


class _Try(NamedTuple):
    shift: float
    miss: float  # in shifts
    plan: Plan


def _signed(missed: FloatArray, slopes: FloatArray, way: FloatArray) -> float:
    """Return the least-squares part of the misses that a shift of knots by `way` can mend."""
    along = slopes @ way
    return float(missed @ along / max(float(along @ along), 1e-300)) if len(missed) else 0.0


def _bracket(trail: Sequence[_Try]) -> tuple[_Try, _Try] | None:
    """Return the two tries nearest to one another that miss to either side."""
    above = [t for t in trail if t.miss > 0.0]
    below = [t for t in trail if t.miss <= 0.0]
    pairs = itertools.product(above, below)
    return min(pairs, key=lambda pair: abs(pair[0].shift - pair[1].shift), default=None)


_STEEP = 2.0
"""Times the slope, from which a change is taken for a step. Numerical."""


def _jump(trail: Sequence[_Try]) -> float | None:
    """Return the cut, as a field value, that jumps within the bracket, if what is printed does."""
    within = _bracket(trail)
    if within is None:
        return None
    a, b = within
    if abs(a.miss - b.miss) < _STEEP * abs(a.shift - b.shift):
        return None
    cuts, others = ({r.material: r.field[1] for r in t.plan.regions[:-1]} for t in (a, b))
    moved = {m: abs(cuts[m] - others[m]) for m in cuts.keys() & others.keys()}
    return cuts[max(moved, key=lambda m: moved[m])] if moved else None


def _next_shift(trail: Sequence[_Try]) -> float:
    """Return the next offset to try: by the slope, then within the narrowest bracket."""
    within = _bracket(trail)
    if within:
        a, b = within
        share = a.miss / (a.miss - b.miss)
        return a.shift + min(max(share, 0.1), 0.9) * (b.shift - a.shift)
    last, best = trail[-1], min(trail, key=lambda t: abs(t.miss))
    if abs(last.miss) > abs(best.miss):  # as cuts pass walls it may be the other way
        return 2.0 * best.shift - last.shift
    return last.shift - 1.2 * last.miss  # a little more than the slope says


def _intervals(
    solved: "Solved", model: CoefficientModel, level: float
) -> list[tuple[float, float]]:
    from planner.simulation.response import figure_interval, log_stress_sds

    normal = NormalDist().inv_cdf(0.5 + level / 2.0)
    sds = log_stress_sds(solved.mechanics, solved.state, model, normal)
    return [
        figure_interval(
            solved.mechanics, solved.state, solved.factored, weights, figure, sds, normal,
        )
        for figure, weights in (
            goal.measure(solved.mechanics, solved.state) for goal in solved.goals
        )
    ]  # fmt: skip


_BANDS = re.compile(r"(?:--bands|`bands`) \d+ or fewer, (?:or )?a gentler profile(?: there)?")
_OF_GRADE = re.compile(r"; (?:--tolerance \S+ accepts it|with --snap 0 it is [^;]*)")


def _own_advice(text: str, gentler: str) -> str:
    """Give what `grade` advises as a design can follow it, whose bands come of its profile."""
    return _OF_GRADE.sub("", _BANDS.sub(gentler, text))


def _findings(
    rows: Sequence[Reached],
    over: float | None,
    limit: float | None,
    tolerance: float,
    values: FloatArray,
    problem: "DesignProblem",
    best: "Tried",
    *,
    dithered: bool,
) -> list[DesignFinding]:
    """Say which targets and limits are missed, and what stands in the way."""
    found = []
    softest, stiffest = float(np.mean(values < 0.01)), float(np.mean(values > 0.99))
    why = ""
    if softest == 1.0 or stiffest == 1.0:
        word = "softest" if softest else "stiffest"
        why = f"; all of the part is in the {word} material that is allowed"
    elif limit is not None and over is not None and over > 0.97 * limit:
        why = f"; strain over break is at its limit, {limit:g}"
    against = _against(problem, best, tolerance)
    for row in rows:
        closer = "" if dithered else "; dithered ones follow it closer (blend: dither)"
        if row.largest is not None:
            if row.error is not None and row.error > tolerance:
                found.append(
                    DesignFinding(
                        "target",
                        f"{row.target}: the surface is {row.printed:.3g} mm off (root mean "
                        f"square), {percent(row.error)} of its longest way, and "
                        f"{row.largest:.3g} mm at most; the gradient comes to "
                        f"{row.continuous:.3g} mm"
                        + ("" if row.continuous > 0.8 * row.printed else closer),
                    )
                )
            continue
        miss = row.error if row.kind not in "<>" else _passed(row)
        missed = miss is not None and row.hard and (miss if row.kind in "<>" else abs(miss))
        if miss is None or not missed or missed <= tolerance:
            continue
        short = abs(row.continuous - row.wanted) > tolerance * abs(row.wanted)
        if row.kind in "<>":
            short = _passed(replace(row, printed=row.continuous)) > tolerance
        name = f"{row.case}: {row.target}" if row.case else row.target
        what = (
            f"the nearest gradient comes to {row.continuous:.4g} {row.unit}"
            if short
            else f"the gradient comes to {row.continuous:.4g} {row.unit}, which the printed "
            f"materials follow in steps{closer}"
        )
        ends = [f"{e:.4g}" if e is not None else "nothing stable" for e in row.reach]
        stands = against.get((row.case, row.target), "")
        reasons = (
            f"{why}{stands}; softest {ends[0]}, stiffest {ends[1]} {row.unit}" if short else ""
        )
        found.append(
            DesignFinding(
                "target" if row.kind == "target" else "limit",
                f"{name}: {row.printed:.4g} {row.unit} is reached, {percent(miss, '+')}; {what}"
                f"{reasons}",
            )
        )
    if limit is not None and over is not None and over > limit * (1.0 + tolerance):
        found.append(
            DesignFinding("limit", f"strain/break<{limit:g}: the printed part comes to {over:.3g}")
        )
    return found


_OPPOSED = -0.5
"""Cosine between two derivatives from which targets are said to stand against each other."""


def _against(
    problem: "DesignProblem", best: "Tried", tolerance: float
) -> dict[tuple[str, str], str]:
    """Say of each target and limit that is missed which other stands most against it."""
    named = [(case.name, goal.text, goal.kind) for case in problem.cases for goal in case.goals]
    off, over = (
        iter(zip(best.off, best.slopes, strict=True)),
        iter(zip(best.over, best.over_slopes, strict=True)),
    )
    rows = []
    for case, text, kind in named:
        if kind != "near":
            miss, row = next(off) if kind == "target" else next(over)
            rows.append((case, text, kind, float(miss), row))
    out = {}
    for case, text, kind, miss, row in rows:
        if (abs(miss) if kind == "target" else miss) <= tolerance:
            continue
        mend = -np.sign(miss) * row
        size = float(np.linalg.norm(mend))
        worst, who = _OPPOSED, ""
        for case2, text2, kind2, miss2, row2 in rows:
            if (case2, text2) == (case, text) or (kind2 != "target" and miss2 < -0.05):
                continue
            keep = -np.sign(miss2) * row2 if kind2 == "target" and miss2 else -row2
            cosine = float(mend @ keep) / max(size * float(np.linalg.norm(keep)), 1e-300)
            if cosine < worst:
                worst, who = cosine, f"{case2}: {text2}" if case2 else text2
        if who:
            out[case, text] = f"; {who} stands against it"
    return out
