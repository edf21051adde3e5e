"""Design a part's gradient so that it deforms as wanted, and plan it in materials that print."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import msgspec
import numpy as np

from planner.cutting.grid import default_pitch_mm
from planner.errors import ArgumentError, FileError, as_count, as_number, check_known, positive
from planner.fields.basic import Field, axis_field
from planner.fields.parse import Setting, build_field
from planner.formats.files import decode_document, json_of, read_file
from planner.formats.mesh_file import read_mesh
from planner.formats.tables import encode_csv
from planner.glance import counted, html_of, in_percent, one_line, outcome
from planner.grading.grade import grade
from planner.grading.profile import stiffness_scale
from planner.grading.wish import Wish, targets_of
from planner.inverse_design.controls import TABLE, Controls, StiffnessRange, lattice_counts
from planner.inverse_design.findings import DesignFinding, Ends, Reached, findings, reached
from planner.inverse_design.goals import Limits, Target, WantedShape, posed
from planner.mesh.halve import halve_long_edges
from planner.mesh.mesh import Mesh
from planner.mesh.part import moved_to_corner, open_part
from planner.numerics import FloatArray, as_point, interrupted, normal_quantile, one_blas_thread
from planner.palette import Palette
from planner.plan import Plan
from planner.printers import Printer, load_printer, palette_of
from planner.simulation.cut_cells import FEWEST_ALONG, CutCells
from planner.simulation.loads import LoadCase, palette_densities
from planner.simulation.part import check_effort, default_cell_mm, finest_cell_mm

if TYPE_CHECKING:
    from planner.inverse_design.search import Case, DesignProblem, Found, Solved

__all__ = ["Course", "PartDesign", "design", "interrupted_design"]

_MOST_KNOTS = 100

_PREFER = ("smooth", "soft")


class DesignStage(str):
    """What a design is doing, in words; `done` is about which share of the work is behind it."""

    done: float

    def __new__(cls, words: str, done: float) -> "DesignStage":
        """Return the words with the share."""
        made = super().__new__(cls, words)
        made.done = done
        return made


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
    cells: CutCells
    displacement_mm: FloatArray
    wanted: Mesh | None
    off_mm: FloatArray | None


_SHOWN = 0.03
"""Largest last change, over the way: what is left is about its square, a page shows thousandths."""


def _course(case: "Case", solved: "Solved", coordinate: FloatArray, steps: int) -> Course:
    """Tell how a solved part comes to its load: as in larger cells, scaled to how it is at last."""
    from planner.simulation.solid import LostStabilityError

    cells, last = solved.mechanics.body.cells, solved.state.displacement_mm
    shares = np.linspace(0.0, 1.0, steps + 1)[1:-1].tolist()
    moved = [0.0 * last, last]
    try:
        full = case.solve(coordinate, tangent=False)
        way = full.mechanics.follow(shares, settled=_SHOWN, tangents=False)
        states = [state for state, _ in way]
    except LostStabilityError:
        shares = []  # there is no such way in larger cells
    else:
        each = np.stack([state.displacement_mm for state in (*states, full.state)], axis=1)
        size = np.linalg.norm(each, axis=(0, 2)) / np.linalg.norm(each[:, -1])
        at = full.mechanics.body.cells.interpolated(cells.node_mm, each.reshape(len(each), -1))
        at = at.reshape(len(last), -1, 3).swapaxes(0, 1)
        moved[1:1] = at[:-1] + size[:-1, None, None] * (last - at[-1])
    shapes, misses = solved.shapes, solved.deviations()
    return Course(
        case.name, np.array([0.0, *shares, 1.0]), cells, np.stack(moved),
        shapes[0].wanted.surface if shapes else None,
        misses[0].off_mm if misses else None,
    )  # fmt: skip


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
        worst = max((r.missed for r in self.reached), default=0.0)
        what = counted(len(self.values), "control" if self.free else "knot")
        return (
            f"{self.plan.part.name}: {counted(len(self.reached), 'target')}, worst missed by "
            f"{in_percent(worst)}, {what}; " + outcome((len(self._found), "finding"))
        )

    @property
    def _found(self) -> list[Any]:
        return [*self.findings, *self.plan.findings]

    @property
    def ok(self) -> bool:
        """Whether all targets and limits are met by the printed materials, and it will print."""
        return not self.findings and self.plan.ok

    def document(self) -> dict[str, Any]:
        """Return the design as JSON holds it; the plan has its own."""
        same = ("level", "strain_over_break", "cell_mm", "tried", "interrupted")
        return {
            "schema": 1,
            "part": self.plan.part.file,
            "palette": asdict(self.plan.palette),
            "field": dict(self.plan.gradient.field),
            "profile": {"positions": list(self.positions), "moduli_MPa": list(self.moduli_MPa)},
            "free": None if self.free is None else dict(self.free),
            "values": list(self.values),
            "targets": [{**asdict(r), "hard": r.hard} for r in self.reached],
            **{name: getattr(self, name) for name in same},
            "findings": [{"kind": f.kind, "message": f.message} for f in self._found],
            "notes": list(self.notes),
        }

    json = json_of

    def profile_csv(self) -> bytes:
        """Return the profile as `planner.grade` reads it."""
        rows = zip(self.positions, self.moduli_MPa, strict=True)
        return encode_csv([("position", "modulus_MPa"), *rows], digits=6)

    def write(
        self, output: str | Path | None = None, *, force: bool = False, page: bytes | None = None
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
            beside[TABLE] = self.table
        return self.plan.write(target, force=force, page=page, beside=beside)


class _Earlier(msgspec.Struct):
    values: tuple[Annotated[float, msgspec.Meta(ge=0.0, le=1.0)], ...]
    interrupted: bool = False


def _written(file: Path) -> _Earlier:
    return decode_document(read_file(file), _Earlier, str(file))


def interrupted_design(folder: Path) -> bool:
    """Tell whether a folder holds a design whose search was ended before it was done."""
    file = folder / "design.json"
    return file.is_file() and _written(file).interrupted


def _begun(start: "str | Path | PartDesign | None", count: int) -> FloatArray | None:
    """Return the values of an earlier design to go on from."""
    if start is None:
        return None
    if isinstance(start, PartDesign):
        values, start = start.values, "design"
    else:
        file = Path(str(start))
        values = _written(file / "design.json" if file.is_dir() else file).values
    if len(values) != count:
        raise FileError(
            f"`start` {start}: it has {len(values)} values, this design {count} controls; give one "
            "with the same `free` or `knots`, or none"
        )
    return np.array(values)


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
    cases: LoadCase | Sequence[LoadCase] = (),
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
    progress: Callable[[str], None] | None = None,
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
        Of each load, to show on plan.html: on the way as larger cells tell, at last as printed.
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
    first = LoadCase(target, fix, load, pressure, move, gravity, moment=moment)
    limits, figures = Limits.read(limit)
    alone = bool(cases) and first.is_empty and not first.target
    cases = LoadCase.named(cases, *(() if alone else (first,)))
    wanted = [_wanted_of(case, unit) for case in cases]
    for aims in wanted if alone else wanted[:1]:
        aims += figures
    if not all(wanted) or not any(aim.sense == "=" for aims in wanted for aim in aims):
        raise ArgumentError("`target` is missing: each case needs one, as target='x=min uz=-12 mm'")
    knots = as_count(knots, "`knots`", _MOST_KNOTS, least=2)
    steps, level = as_count(steps, "`steps`", 1000, 0), as_number(level, "`level`", (0.0, 1.0))
    check_known(prefer, _PREFER, f"`prefer` {prefer}: {{}}it may be")
    if blend is not None:
        check_known(blend, ("nearest", "dither"), f"`blend` {blend}: {{}}a design's may be")
    by_surface = [[aim for aim in aims if aim.surface_mm is not None] for aims in wanted]
    if free is None and axis is None and field is None and any(by_surface):
        free = "auto"
    if free is not None and (axis is not None or field is not None):
        raise ArgumentError("give `free`, or `axis` or `field`, not both")
    if not set(str(symmetric)) <= set("xyz") or (symmetric and free is None):
        raise ArgumentError(f"`symmetric` {symmetric}: it is x, y or z, or several, with `free`")
    if cell_mm is not None and minutes is not None:
        raise ArgumentError("give `cell_mm` or `minutes`, not both")
    positive(tolerance, "`tolerance`")
    machine = load_printer("connex3" if printer is None else printer)
    chosen = palette_of(palette, machine)
    scale = stiffness_scale(chosen, at_strain)
    ends, _, _ = targets_of(Wish(start=from_, end=to, profile="log"), scale)
    low, high = sorted((ends.moduli_MPa[0], ends.moduli_MPa[-1]))
    tell = progress or (lambda stage: None)
    tell(DesignStage("reading the part", 0.0))
    mesh = open_part(
        part, unit=unit, name=name, tray_mm=machine.tray_mm, bodies=bodies, oversize=force_oversize
    ).mesh
    placed, translation = moved_to_corner(mesh)
    setting = Setting(placed, as_point(translation), default_pitch_mm(placed))
    densities = palette_densities(chosen, cases)
    # Two searches of about ten gradients and the print's own, in one or two steps each.
    work = {"factors": 2 * len(cases), "solutions": 20 * len(cases)}
    edge = default_cell_mm(mesh) if cell_mm is None else cell_mm
    if minutes is not None:
        edge = finest_cell_mm(mesh, minutes, **work)
    effort = check_effort(mesh, edge, **work)
    # What is wrong is told before the work.
    posed(cases, wanted, halve_long_edges(mesh, 0.5 * edge)[0])
    tell(DesignStage("loading the solver", 0.0))
    from planner.inverse_design.printing import Printing, corrected
    from planner.inverse_design.search import DesignProblem, WantedOfPart
    from planner.materials.marlow import marlow_table

    own = mesh.triangles
    if any(by_surface) and isinstance(part, (str, Path)):  # in the order of the file
        own = np.asarray(read_mesh(Path(part), unit).triangles, dtype=np.float64)
    shapes = [[WantedShape.of(aim, own) for aim in aims] for aims in by_surface]
    stiffness = StiffnessRange((low, high), scale.model, at_strain)
    asked = WantedOfPart(mesh, cases, wanted, shapes, marlow_table(scale.model), densities)
    if free is not None:
        hard = sum(aim.surface_mm is None for aims in wanted for aim in aims)
        box, figured = np.ptp(mesh.bounds_mm, axis=0), hard + 12 * sum(map(len, shapes))
        counts, follows = lattice_counts(free, box, figured), None
        controls = Controls.lattice(mesh.bounds_mm, counts, ["xyz".index(c) for c in symmetric])
    else:
        counts = (1, 1, 1)
        follows = axis_field(axis, placed) if field is None else build_field(field, setting)
        rises = ends.moduli_MPa[0] < ends.moduli_MPa[-1]
        controls = _ramp(follows, knots, rises, limits, stiffness, translation)
    normal = normal_quantile(level) if robust else 0.0

    def problem_on(size_mm: float, done: float, before: "Sequence[Case]" = ()) -> DesignProblem:
        words = f"cutting the part into cells of {size_mm:.3g} mm; all takes {effort}"
        tell(DesignStage(words, done))
        on_cells = asked.cut(size_mm, float(stiffness.coordinates(np.array([0.5]))[0][0]), before)
        return DesignProblem(stiffness, controls, on_cells, limits, prefer, 0.3 * tolerance, normal)

    begun = _begun(start, len(controls.even))
    found, larger, reach = _searched(
        problem_on, edge, mesh, begun, tolerance, tell, is_lattice=free is not None
    )
    best, problem, dithered = found.best, found.problem, blend == "dither"
    tell(DesignStage("planning the print", 0.7))
    problem_mm = float(problem.cases[0].cells.cell_mm.max()) if found.stopped else edge
    graded = partial(
        grade, part, axis=axis, field=field, blend=blend, at_strain=at_strain, printer=machine,
        palette=chosen, unit=unit, bodies=bodies, name=name, force_oversize=force_oversize,
    )  # fmt: skip
    printing = Printing(
        asked, setting, follows, counts, problem, larger, best, graded, scale, machine, problem_mm,
        dithered, tolerance,
    )  # fmt: skip

    def corrects(off: float) -> None:
        tell(DesignStage(f"printed materials: off by {in_percent(off)}", 0.8))

    printed, prints, stopped = corrected(printing, stopped=found.stopped, progress=corrects)
    tried = found.tried + prints
    rows = list(reached(problem, best, reach, printed.solved, level))
    broken = () if limits.strain_over_break is None else printed.solved
    over = max((one.over_break().largest for one in broken), default=None)
    told = list(findings(rows, over, tolerance, problem, best, printed.values, dithered=dithered))
    if stopped:
        told.insert(0, DesignFinding("interrupted", _INTERRUPTED.format(tried=tried)))
    notes, says = [shape.note for each in shapes for shape in each], None
    if free is not None:
        box_mm = mesh.bounds_mm.tolist()
        says = {"counts": list(counts), "bounds_mm": box_mm, "symmetric": list(symmetric)}
        notes.append(
            f"{counted(len(printed.values), 'control')} on a lattice of "
            f"{' x '.join(map(str, counts))}; smoothness (the sum of squared second "
            f"differences) weighs 1, a target's relative miss {problem.miss_weight:g}, a shape's "
            "squared deviation over 0.3 of the tolerance 20"
        )
    if steps:
        tell(DesignStage("from rest to full load, for the page", 0.9))
    coordinate, _ = stiffness.coordinates(larger.basis @ printed.values)
    courses = zip(larger.cases, printed.solved, strict=True) if steps else ()
    profile, _, table = printing.laid(printed.values)
    return PartDesign(
        courses=tuple(_course(case, one, coordinate, steps) for case, one in courses),
        plan=printed.plan,
        positions=profile.positions,
        moduli_MPa=profile.moduli_MPa,
        values=tuple(float(f"{v:.9g}") for v in printed.values),
        reached=tuple(rows),
        strain_over_break=over,
        cell_mm=problem_mm,
        level=level,
        tried=tried,
        free=says,
        table=None if table is None else table.data,
        interrupted=stopped,
        findings=tuple(told),
        notes=(
            *notes,
            f"figures are those of cells of {problem_mm:.3g} mm; `planner simulate` of the plan "
            "tells how far they depend on the cells",
        ),
    )


_INTERRUPTED = (
    "the search was interrupted after {tried} gradients: this is the best of them, not corrected "
    "for rounding to materials; the same command goes on from here"
)


def _ramp(
    along: Field, knots: int, rises: bool, limits: Limits, stiffness: StiffnessRange,
    moved_mm: FloatArray,
) -> Controls:  # fmt: skip
    """Return knots along a field, from one end of the stiffness to the other as a slope allows."""
    length = along.description().get("span_mm")
    span_mm = length if isinstance(length, float) else 1.0
    ramp = np.linspace(0.0, 1.0, knots)[:: 1 if rises else -1]
    if limits.slope is not None:
        ramp = 0.5 + (ramp - 0.5) * min(1.0, limits.slope * span_mm / stiffness.span)
    return Controls.knots(lambda points: along.values(points + moved_mm), ramp, span_mm)


_NEAR = 0.25
"""Of the work is done in the larger cells."""

_LARGER = 2.0
"""Times the edge of the cells asked for: an equilibrium there costs about a twentieth."""


def _searched(
    problem_on: "Callable[..., DesignProblem]", edge_mm: float, mesh: Mesh,
    begun: FloatArray | None, tolerance: float, progress: Callable[[str], None], *,
    is_lattice: bool,
) -> "tuple[Found, DesignProblem, Ends]":  # fmt: skip
    """Search in larger cells first, then in those asked for.

    Returns
    -------
    found
        In the cells that were come to, with all gradients counted.
    larger
        In the larger cells.
    reach
        The softest and the stiffest that is allowed, in the larger cells.
    """
    from planner.inverse_design.search import search
    from planner.simulation.solid import LostStabilityError

    def tell(stage: str, first: float, last: float, tried: int, off: float) -> None:
        done = first + (last - first) * min(tried / 15.0, 0.9)
        progress(DesignStage(f"{stage}: gradient {tried}, off by {in_percent(off)}", done))

    def begun_at(
        problem: "DesignProblem", start: FloatArray, tolerance: float, **more: Any
    ) -> "Found":
        for stiffer in (0.0, 0.5, 0.75, 1.0):
            with suppress(LostStabilityError):
                return search(problem, np.maximum(start, stiffer), tolerance=tolerance, **more)
        raise ArgumentError(
            "the part has no stable equilibrium under these loads even in the stiffest material; "
            "take smaller loads"
        )

    longest_mm = float(np.ptp(mesh.bounds_mm, axis=0).max())
    problem = problem_on(max(edge_mm, min(_LARGER * edge_mm, longest_mm / FEWEST_ALONG)), 0.0)
    progress(DesignStage("larger cells: the softest and the stiffest that is allowed", 0.05))
    reach = Ends.of(problem)
    for words in reach.beyond():
        progress(DesignStage(words, 0.1))
    controls = problem.controls
    if is_lattice:
        controls = replace(controls, even=np.full(len(controls.even), reach.even_share()))
        problem = replace(problem, controls=controls)
    found = begun_at(
        problem, controls.even if begun is None else begun, max(0.02, tolerance),
        progress=partial(tell, "larger cells", 0.1, _NEAR),
    )  # fmt: skip
    if found.stopped:
        return found, problem, reach
    try:
        finer = replace(problem_on(edge_mm, _NEAR, problem.cases), controls=controls)
        after = begun_at(
            finer, found.best.values, 0.3 * tolerance, radius=0.1,
            progress=partial(tell, "cells asked for", _NEAR, 0.7),
        )  # fmt: skip
    except (KeyboardInterrupt, SystemError) as error:
        if not interrupted(error):
            raise
        return found._replace(stopped=True), problem, reach
    return after._replace(tried=found.tried + after.tried), problem, reach


def _wanted_of(case: LoadCase, unit: str | None) -> list[Target]:
    """Return the targets and limits of a case."""
    limits, figures = Limits.read(case.limit)
    if limits.strain_over_break is not None or limits.slope is not None:
        raise ArgumentError(
            f"`limit` {case.limit[0]}: of strain and slope there is one limit for all cases; give "
            "it beside them"
        )
    return [*(Target.read(text, unit=unit) for text in case.target), *figures]
