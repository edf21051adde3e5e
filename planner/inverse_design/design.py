"""Design a part's gradient so that it deforms as wanted, and plan it in materials that print."""

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.cutting.grid import default_pitch_mm
from planner.errors import ArgumentError, did_you_mean, positive
from planner.fields.basic import Field, axis_field
from planner.fields.parse import Setting, build_field
from planner.formats.files import encode_document
from planner.formats.tables import encode_csv
from planner.glance import counted, html_of, one_line, outcome, percent
from planner.grading.grade import grade, open_part, refuse_oversize
from planner.grading.profile import Profile, stiffness_scale
from planner.grading.regions import point
from planner.grading.wish import Wish, targets_of
from planner.inverse_design.goals import Functional, functionals, read_limits, read_target
from planner.materials.mixtures import CoefficientModel
from planner.mesh.halve import halve_long_edges
from planner.mesh.mesh import Mesh
from planner.mesh.part import place
from planner.numerics import FloatArray, one_blas_thread
from planner.palette import Palette
from planner.plan import Plan
from planner.printers import Printer, load_printer, palette_of
from planner.simulation.loads import Conditions, LoadCase, palette_densities, read_conditions
from planner.simulation.part import (
    COARSER,
    check_effort,
    default_cell_mm,
    filling_along,
    open_solid,
)

if TYPE_CHECKING:
    from planner.inverse_design.search import Solved

__all__ = ["DesignFinding", "PartDesign", "Reached", "design"]

_MOST_KNOTS = 40

_NUDGE = 1e-3
"""Of the range of ln(modulus): a profile that cuts a band thinner than a layer is moved by it."""

_PREFER = ("smooth", "soft")


@dataclass(frozen=True, slots=True)
class Reached:
    """One target, and what it came to.

    Attributes
    ----------
    target, case
        As it was written, and the load case's name.
    wanted, unit
        The figure: of a stiffness, the displacement or force that it means.
    continuous, printed
        With the profile as it is wanted, and with the materials of the plan.
    interval
        Holds what a print does, from the palette's uncertainty.
    error
        (printed - wanted) over wanted; None where nothing is wanted to move.
    hard
        Whether it is to be met; points of a shape are only come near to.
    """

    target: str
    case: str
    unit: str
    wanted: float
    continuous: float
    printed: float
    interval: tuple[float, float]
    error: float | None
    hard: bool


@dataclass(frozen=True, slots=True)
class DesignFinding:
    """A target or limit that is not met, and why."""

    kind: str
    message: str


@dataclass(frozen=True, eq=False)
class PartDesign:
    """A profile that was found, and the plan that prints it.

    Attributes
    ----------
    positions, moduli_MPa : (knots,)
        The profile along the field.
    reached
        Of every target.
    strain_over_break
        Largest in the printed materials, averaged over neighbouring cells; None without a limit.
    tried
        Equilibria that were solved for.
    plan
        What is written: `PartDesign.write`.
    """

    plan: Plan
    positions: tuple[float, ...]
    moduli_MPa: tuple[float, ...]
    reached: tuple[Reached, ...]
    strain_over_break: float | None
    cell_mm: float
    level: float
    tried: int
    findings: tuple[DesignFinding, ...] = ()
    notes: tuple[str, ...] = ()

    _repr_html_ = html_of

    @one_line
    def __repr__(self) -> str:
        worst = max((abs(r.error) for r in self.reached if r.error is not None), default=0.0)
        return (
            f"{self.plan.part.name}: {counted(len(self.reached), 'target')}, worst missed by "
            f"{percent(worst)}, {counted(len(self.positions), 'knot')}; "
            + outcome((len(self.findings), "finding"))
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
            "targets": [asdict(r) for r in self.reached],
            "level": self.level,
            "strain_over_break": self.strain_over_break,
            "cell_mm": self.cell_mm,
            "tried": self.tried,
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

        Raises
        ------
        OutputError
            The folder exists already, or cannot be written.
        """
        target = f"{self.plan.part.name}-designed" if output is None else output
        beside = {"design.json": self.json(), "profile.csv": self.profile_csv()}
        return self.plan.write(target, force=force, page=page, beside=beside)


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
    prefer: str = "smooth",
    blend: str | None = None,
    at_strain: float = 0.1,
    cell_mm: float | None = None,
    tolerance: float = 0.01,
    level: float = 0.95,
    printer: str | Printer | None = None,
    palette: str | Path | Palette | None = None,
    unit: str | None = None,
    bodies: str | None = None,
    name: str | None = None,
    force_oversize: bool = False,
    progress: Callable[[str], None] = lambda stage: None,
) -> PartDesign:
    """Find the gradient with which a part deforms as wanted, and plan its print.

    The profile is ln(modulus) at evenly spaced knots of the field. It is found by derivatives of
    the whole part's equilibrium, first on larger cells, then on those asked for; then it is
    planned, the plan's own materials are put into the cells, and the profile is moved as a whole
    until what is printed reaches the targets.

    Parameters
    ----------
    part
        As `planner.grade` takes it.
    from_, to
        What stands at the beginning and the end of the gradient that the design sets out from, and
        the softest and stiffest that it may use: materials or moduli.
    target
        ``SELECTOR ux=VALUE mm`` (uy, uz): the mean displacement of faces; ``SELECTOR
        stiffness=VALUE N/mm`` of a load or motion there; ``SELECTOR fx=VALUE N`` of a support;
        ``shape: FILE.csv`` with x_mm, y_mm, z_mm, ux_mm, uy_mm, uz_mm.
    fix, load, pressure, move, gravity, moment
        As of `LoadCase`.
    cases
        More load cases, each with its own targets.
    limit
        ``strain/break<0.5``, ``slope<0.1 /mm`` (change of ln(modulus)).
    knots
        Of the profile.
    axis, field
        What the gradient follows, as `planner.grade`.
    prefer
        Of profiles that reach the targets: ``smooth``, which bends least and stays near the even
        gradient from `from_` to `to`; or ``soft``, which has least of what is stiff.
    blend
        As `planner.grade`: ``nearest`` or ``dither``.
    at_strain
        Working strain at which moduli are secants.
    cell_mm
        Edge of the cells; about 2000 by default.
    tolerance
        Relative miss of a target that is accepted.
    level
        How probably an interval holds what a print does.
    printer, palette, unit, bodies, name, force_oversize
        As `planner.grade`.
    progress
        Called with a few words when a stage begins.

    Returns
    -------
    PartDesign
        `PartDesign.ok` is false when a target or limit is missed: the nearest is returned.

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
    cases = tuple(cases) if cases and own.is_empty and not own.target else (own, *cases)
    if not all(case.target for case in cases):
        raise ArgumentError("`target` is missing: give one, as target='x=min uz=-12 mm'")
    if not 2 <= knots <= _MOST_KNOTS:
        raise ArgumentError(f"`knots` {knots}: it must be a whole number from 2 to {_MOST_KNOTS}")
    if prefer not in _PREFER:
        hint = did_you_mean(prefer, _PREFER)
        raise ArgumentError(f"`prefer` {prefer}: {hint}it may be {' or '.join(_PREFER)}")
    if blend not in (None, "nearest", "dither"):
        raise ArgumentError(f"`blend` {blend}: a design is printed by nearest or by dither")
    positive(tolerance, "`tolerance`")
    limits = read_limits((limit,) if isinstance(limit, str) else limit)
    machine = load_printer(printer or "connex3")
    chosen = palette_of(palette, machine)
    scale = stiffness_scale(chosen, at_strain)
    ends, _, _ = targets_of(Wish(start=from_, end=to, profile="log"), scale)
    wanted = [[read_target(text) for text in case.target] for case in cases]

    progress("reading the part")
    source = open_part(part, unit=unit, name=name, tray_mm=machine.tray_mm, bodies=bodies)
    if not force_oversize:
        refuse_oversize(source, machine)
    mesh = source.part.mesh
    placed, translation = place(mesh)
    if field is None:
        along: Field = axis_field(axis, placed)
    else:
        along = build_field(field, Setting(placed, point(translation), default_pitch_mm(placed)))
    length = along.description().get("span_mm")
    span_mm = length if isinstance(length, float) else 1.0
    densities = palette_densities(chosen, cases)
    edge = default_cell_mm(mesh) if cell_mm is None else cell_mm
    # Two searches of about ten profiles and the print's own, in one or two steps each.
    effort = check_effort(mesh, edge, factors=2 * len(cases), solutions=20 * len(cases))

    extent = float(np.linalg.norm(np.ptp(mesh.bounds_mm, axis=0)))

    def posed(surface: Mesh) -> list[tuple[Conditions, list[Functional]]]:
        aimed = [[target.selector for target in case if target.selector] for case in wanted]
        given = zip(cases, aimed, strict=True)
        on = [read_conditions(surface, replace(case, watch=seen)) for case, seen in given]
        return [(o, functionals(targets, o, extent)) for o, targets in zip(on, wanted, strict=True)]

    posed(halve_long_edges(mesh, 0.5 * edge)[0])  # what is wrong is told before the work
    progress("loading the solver")
    from planner.inverse_design.search import Case, Knots, ProfileProblem, search
    from planner.materials.marlow import marlow_table
    from planner.simulation.cut_cells import FEWEST_ALONG, cut_cells
    from planner.simulation.solid import POISSON, Body, LostStabilityError
    from planner.simulation.sparse_cholesky import analyse

    ramp = np.linspace(0.0, 1.0, knots)
    ramp = ramp if ends.moduli_MPa[0] < ends.moduli_MPa[-1] else ramp[::-1]
    if limits.slope is not None:  # the start keeps it, and so does every step
        span = abs(np.log(ends.moduli_MPa[-1] / ends.moduli_MPa[0]))
        ramp = 0.5 + (ramp - 0.5) * min(1.0, limits.slope * span_mm / span)
    low, high = sorted((ends.moduli_MPa[0], ends.moduli_MPa[-1]))
    model = scale.model
    unknowns = Knots(knots, (low, high), model, at_strain)
    table = marlow_table(model, poisson=POISSON)

    def cases_on(body: "Body") -> "list[Case]":
        cells, made = body.cells, []
        analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
        for number, (case, (conditions, goals)) in enumerate(
            zip(cases, posed(cells.surface), strict=True)
        ):
            called = case.name or (f"case {number + 1}" if len(cases) > 1 else "")
            made.append(Case(called, cells, conditions, analysis, goals, body))
        return made

    def problem_on(size_mm: float) -> tuple[ProfileProblem, FloatArray]:
        progress(f"cutting the part into cells of {size_mm:.3g} mm; all takes {effort}")
        cells = cut_cells(mesh, size_mm)
        points = cells.points_mm
        u = along.values(points + translation)
        middle, _ = unknowns.coordinates(np.full(knots, 0.5), u)
        body = Body(cells, table, middle, densities=densities)
        made = cases_on(replace(body, stabiliser_MPa=body.cell_shear_MPa))
        return ProfileProblem(
            unknowns, made, u, limits, ramp, prefer, span_mm / (knots - 1)
        ), points

    def told(stage: str) -> Callable[[int, float], None]:
        return lambda tried, off: progress(f"{stage}: profile {tried}, off by {percent(off)}")

    longest_mm = float(np.ptp(mesh.bounds_mm, axis=0).max())
    larger_mm = max(edge, min(COARSER * edge, longest_mm / FEWEST_ALONG))
    problem, _ = problem_on(larger_mm)  # to come near
    found = None
    for stiffer in (0.0, 0.5, 1.0):
        try:
            start = np.maximum(ramp, stiffer)
            found = search(problem, start, tolerance=0.02, progress=told("larger cells"))
            break
        except LostStabilityError:
            continue
    if found is None:
        raise ArgumentError(
            "the part has no stable equilibrium under these loads even in the stiffest material; "
            "take smaller loads"
        )
    tried = found.tried
    problem, points = problem_on(edge)
    found = search(
        problem, found.best.values, tolerance=0.3 * tolerance, radius=0.1,
        progress=told("cells asked for"),
    )  # fmt: skip
    tried += found.tried
    best = found.best

    progress("planning the print")
    hard = np.array([goal.hard for goal in problem.goals])

    def solved_with(plan: Plan) -> "list[Solved]":
        solid = open_solid(plan, None, None, None, chosen)
        if solid.shells is None:
            filling = filling_along(along, plan, chosen)(points)
            return [case.solve(filling) for case in problem.cases]
        cells, filling = solid.cut(edge)
        return [
            case.solve(filling)
            for case in cases_on(Body(cells, table, filling, densities=densities))
        ]

    def planned(values: FloatArray) -> Plan:
        profile = Profile(
            "designed", tuple(unknowns.positions.tolist()),
            tuple(unknowns.modulus_MPa(values).tolist()), "log",
        )  # fmt: skip
        try:
            plan = grade(
                part, profile=profile, axis=axis, field=field, blend=blend, at_strain=at_strain,
                printer=machine, palette=chosen, unit=unit, bodies=bodies, name=name,
                force_oversize=force_oversize,
            )  # fmt: skip
        except ArgumentError as error:
            raise ArgumentError(_own_advice(str(error))) from error
        found = tuple(replace(f, message=_own_advice(f.message)) for f in plan.findings)
        return replace(plan, findings=found, notes=_own_advice(plan.notes))

    def printed(values: FloatArray) -> "tuple[FloatArray, Plan, list[Solved]]":
        try:
            plan = planned(values)
        except ArgumentError:  # a band thinner than a layer, which goes where all is a bit softer
            values = values - _NUDGE * (values > _NUDGE)
            plan = planned(values)
        return values, plan, solved_with(plan)

    def offs(solved: "list[Solved]") -> FloatArray:
        figures = np.concatenate([s.values() for s in solved])
        return np.array(
            [_off(goal, f) for goal, f in zip(problem.goals, figures.tolist(), strict=True)]
        )

    values, plan, solved = printed(best.values)
    tried += 1
    missed = offs(solved)[hard]
    least, kept = float(np.abs(missed).max(initial=0.0)), (values, plan, missed)
    # One offset of the whole profile; brackets close in where a secant may jump.
    base, way = values, np.ones(knots)
    trail = [_Try(0.0, _signed(missed, best.slopes[hard], way), plan)]
    for _ in range(8 if len(missed) else 0):
        if least <= 0.2 * tolerance:
            break
        jumped = None if limits.slope is not None else _jump(trail)
        if jumped is not None:
            # What is printed steps there, as a cut passes a wall: the others move, it does not.
            base = kept[0]
            way = (np.abs(unknowns.positions - jumped) >= 1.0 / (knots - 1)).astype(np.float64)
            trail = [_Try(0.0, _signed(kept[2], best.slopes[hard], way), kept[1])]
        shift = _next_shift(trail)
        values = np.clip(base + shift * way, 0.0, 1.0)
        if shift in [t.shift for t in trail] or np.array_equal(values, kept[0]):
            break
        progress(f"printed materials: off by {percent(least)}")
        values, plan, solved = printed(values)
        tried += 1
        missed = offs(solved)[hard]
        trail.append(_Try(shift, _signed(missed, best.slopes[hard], way), plan))
        if float(np.abs(missed).max()) < least:
            least, kept = float(np.abs(missed).max()), (values, plan, missed)
    values, chosen_plan, _ = kept
    if chosen_plan is not plan:  # an earlier try was the nearest
        plan, solved = chosen_plan, solved_with(chosen_plan)

    rows, over = [], None
    figures = iter(best.figures.tolist())
    for case, one in zip(problem.cases, solved, strict=True):
        intervals = _intervals(one, model, level)
        for goal, figure, span in zip(case.goals, one.values().tolist(), intervals, strict=True):
            off = None if not goal.wanted else figure / goal.wanted - 1.0
            rows.append(
                Reached(
                    goal.text, case.name, goal.unit, goal.wanted, next(figures), figure, span,
                    off, goal.hard,
                )
            )  # fmt: skip
        if limits.strain_over_break is not None:
            over = max(over or 0.0, one.over_break().largest)
    findings = _findings(
        rows, over, limits.strain_over_break, tolerance, values, dithered=blend == "dither"
    )
    return PartDesign(
        plan=plan,
        positions=tuple(unknowns.positions.tolist()),
        moduli_MPa=tuple(unknowns.modulus_MPa(values).tolist()),
        reached=tuple(rows),
        strain_over_break=over,
        cell_mm=edge,
        level=level,
        tried=tried,
        findings=tuple(findings),
        notes=(
            f"figures are those of cells of {edge:.3g} mm; `planner simulate` of the plan tells "
            "how far they depend on the cells",
        ),
    )


def _off(goal: Functional, figure: float) -> float:
    if goal.wanted:
        return figure / goal.wanted - 1.0
    return figure / goal.scale


class _Try(NamedTuple):
    shift: float
    miss: float  # in shifts
    plan: Plan


def _signed(missed: FloatArray, slopes: FloatArray, way: FloatArray) -> float:
    """Return the least-squares part of the misses that a shift of knots by `way` can mend."""
    along = slopes @ way
    return float(missed @ along / max(float(along @ along), 1e-300)) if len(missed) else 0.0


def _bracket(trail: Sequence[_Try]) -> tuple[_Try, _Try] | None:
    above = [t for t in trail if t.miss > 0.0]
    below = [t for t in trail if t.miss <= 0.0]
    if above and below:
        return min(above, key=lambda t: t.miss), max(below, key=lambda t: t.miss)
    return None


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
        return a.shift + min(max(share, 0.2), 0.8) * (b.shift - a.shift)
    last = trail[-1]  # further the same way, by a little more than the slope says
    return last.shift - 1.2 * last.miss


def _intervals(
    solved: "Solved", model: CoefficientModel, level: float
) -> list[tuple[float, float]]:
    from planner.simulation.response import figure_interval, log_stress_sds

    normal = NormalDist().inv_cdf(0.5 + level / 2.0)
    sds = log_stress_sds(solved.mechanics, solved.state, model, normal)
    return [
        figure_interval(
            solved.mechanics, solved.state, solved.factored, goal.weights(solved.mechanics)[0],
            goal.value(solved.mechanics, solved.state), sds, normal,
        )
        for goal in solved.goals
    ]  # fmt: skip


_BANDS = re.compile(r"(?:--bands|`bands`) \d+ or fewer, (?:or )?a gentler profile(?: there)?")
_OF_GRADE = re.compile(r"; (?:--tolerance \S+ accepts it|with --snap 0 it is [^;]*)")


def _own_advice(text: str) -> str:
    """Give what `grade` advises as a design can follow it, whose bands come of its profile."""
    return _OF_GRADE.sub("", _BANDS.sub("fewer --knots", text))


def _findings(
    rows: Sequence[Reached],
    over: float | None,
    limit: float | None,
    tolerance: float,
    values: FloatArray,
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
    for row in rows:
        short = abs(row.continuous - row.wanted) > tolerance * abs(row.wanted)
        if row.hard and row.error is not None and abs(row.error) > tolerance:
            what = (
                f"the nearest profile comes to {row.continuous:.4g} {row.unit}"
                if short
                else f"the profile comes to {row.continuous:.4g} {row.unit}, which the printed "
                "materials follow in steps"
                + ("" if dithered else "; dithered ones follow it closer (blend: dither)")
            )
            found.append(
                DesignFinding(
                    "target",
                    f"{row.target}: {row.printed:.4g} {row.unit} is reached, "
                    f"{percent(row.error, '+')}; {what}{why if short else ''}",
                )
            )
    if limit is not None and over is not None and over > limit * (1.0 + tolerance):
        found.append(
            DesignFinding("limit", f"strain/break<{limit:g}: the printed part comes to {over:.3g}")
        )
    return found
