"""planner simulate, export, design: parts under loads, and the gradient that bends them so."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import planner
from planner.cli import output as cli
from planner.errors import ArgumentError, refused
from planner.glance import counted, format_number, format_range, sized

_MeshMaterial = Annotated[str | None, "What a mesh is made of, which is no plan."]
_PlansPrinter = Annotated[str | None, "Installed printer; by default the plan's, else connex3."]
_CasesFile = Annotated[
    Path | None, "TOML file of load cases: tables 'case' with these options, and name."
]
_MeshUnit = Annotated[str | None, "Unit of a mesh: mm, cm, m, um, inch, ft."]

_Texts = list[str] | None
"""Of an option that may be repeated."""


@dataclass(frozen=True)
class _LoadOptions:
    """How a whole part is held and loaded.

    Attributes
    ----------
    fix
        Faces of the whole part that do not move, as x=max; for what may stand there see
        docs/how-to/simulate-a-whole-part.md. Repeatable, as all of these.
    load
        Force on faces in all, as 'x=min: 0,0,-0.5 N'.
    moment
        Moment about the middle of faces, as 'x=min: 0,5,0 N mm'.
    pressure
        Pressure on faces, as 'cavity: 20 kPa'.
    move
        Faces that are moved, as 'z>102: 5,free,0 mm'.
    gravity
        Where the part's weight pulls: -z, or dx,dy,dz.
    """

    fix: _Texts = None
    load: _Texts = None
    moment: _Texts = None
    pressure: _Texts = None
    move: _Texts = None
    gravity: str | None = None


_CELL = ("--cell", "--cell-mm")
_ROWS = 6

_FILES_OF_BAR = ["field"]
_FILES_OF_PART = ["watch", "deformed", "vtu", "volume", "page"]


def simulate(
    source: str,
    *,
    loads: _LoadOptions,
    cases: _CasesFile = None,
    watch: list[str] | None = None,
    material: _MeshMaterial = None,
    cell_mm: Annotated[float | None, *_CELL] = None,
    compare_cells: bool = True,
    unit: _MeshUnit = None,
    bodies: cli.MeshBodies = None,
    to_strain: float = 0.3,
    rate_mm_s: Annotated[float | None, "--rate"] = None,
    protocol: str = "monotonic",
    cycles: int = 1,
    hold_s: float = 100.0,
    steps: int | None = None,
    slices: int = 400,
    between_mm: Annotated[str | None, "--between"] = None,
    width_mm: float = 6.0,
    thickness_mm: float = 4.0,
    gauge_mm: float = 33.0,
    level: float = 0.95,
    printer: _PlansPrinter = None,
    palette: cli.PaletteName = None,
    output: cli.Output = None,
    field: Path | None = None,
    figure: Path | None = None,
    deformed: Path | None = None,
    vtu: Path | None = None,
    volume: Path | None = None,
    page: Path | None = None,
    force: cli.Overwrite = False,
) -> int:
    """Pull a planned part, a graded bar or a coupon; or load a whole part, which may bend.

    Pulled along the axis of its gradient, slices across the axis share one force. With --fix and
    --load, --moment, --pressure, --move or --gravity, or --cases, the whole part is solved as it is
    held and loaded. With --cases each file but .json and .html is one a case, numbered. Exit code 1
    when a print would break on the way, or the strain or load is out of reach.

    Example: [bold]planner simulate finger-graded --to-strain 0.1 --figure pull.svg[/bold]

    Example: [bold]planner simulate finger-graded --fix x=max --load "x=min: 0,0,-0.5 N"[/bold]

    Parameters
    ----------
    source
        A plan.json or its folder, a profile (CSV: x_mm, coordinate[, width_mm, thickness_mm]), a
        material, or with --fix and --load a mesh.
    watch
        Faces whose displacement is told too, as x=min, or 'x=min uz' along an axis.
    cell_mm
        Edge of the cells that the whole part is cut into; about 2000 by default.
    compare_cells
        Solve with larger cells too, which tells how far figures depend on them.
    to_strain
        Largest displacement over the bar's length.
    rate_mm_s
        Crosshead speed in mm/s, which sets the times alone; by default the palette's reference
        strain rate.
    protocol
        monotonic, cyclic or relaxation.
    cycles
        Of the cyclic protocol.
    hold_s
        How long relaxation holds, in seconds.
    steps
        Load steps up, and down or held: 100 by default, 5 of a whole part.
    slices
        Slices of a plan or a profile, 10 or more.
    between_mm
        START:STOP in mm along the axis: pull only this stretch of the bar.
    width_mm
        Width of a coupon, or of a profile without.
    thickness_mm
        Thickness of a coupon or such a profile.
    gauge_mm
        Gauge length of a coupon.
    level
        How probably an interval holds what a print does.
    output
        File to write: .csv (the curve) or .json (all).
    field
        CSV file to write: strain along the bar at every step.
    figure
        SVG file to write: the curves.
    deformed
        STL file to write: the whole part's surface as it is at last.
    vtu
        VTU file to write: that surface with displacement, strain and material.
    volume
        VTU file to write: the volume with stress, energy, strain over break.
    page
        HTML file to write: the whole part as it moves, in 3D.
    """
    from planner.compilation_cache import compile_ahead
    from planner.formats.files import encode_document
    from planner.simulation.loads import read_cases

    _check_endings(output=(output, ".csv", ".json"), deformed=(deformed, ".stl"),
                   vtu=(vtu, ".vtu"), volume=(volume, ".vtu"), page=(page, ".html"))  # fmt: skip
    given = cli.stated()
    seen = tuple(watch or ())
    own = planner.LoadCase(watch=seen, **{k: v for k, v in vars(loads).items() if v is not None})
    held = [] if own.is_empty else [own]
    whole = bool(held) or cases is not None
    solve: Callable[..., Any] = planner.simulate_bar
    other: Callable[..., Any] = planner.simulate_part
    why = "it is of a whole part; say how that is held and loaded with `fix` and `load`, `moment`, "
    why += "`pressure`, `move` or `gravity`, or with `cases`"
    if whole:
        solve, other = other, solve
        why = "it is of a bar that is pulled along its axis, not of a whole part; leave it out"
    takes = signature(solve).parameters
    for name in (*signature(other).parameters, *(_FILES_OF_BAR if whole else _FILES_OF_PART)):
        if name in given and name not in takes:
            told = ", ".join(given[name]) if name == "watch" else given[name]
            raise ArgumentError(f"`{name}` {told}: {why}")
    between = None if between_mm is None else _between(between_mm)
    if cases is not None:
        held += [replace(case, watch=(*case.watch, *seen)) for case in read_cases(cases)]
    files: dict[str, tuple[Path | None, Callable[[Any], bytes]]] = {
        "output": (output, lambda result: result.csv()),
        "field": (field, lambda result: result.field_csv()),
        "figure": (figure, planner.simulation_figure),
        "deformed": (deformed, lambda result: result.deformed_stl()),
        "vtu": (vtu, lambda result: result.vtu()),
        "volume": (volume, planner.part_volume),
    }
    whole_files = {"page": page}
    if output is not None and output.suffix.casefold() == ".json":
        whole_files["output"], _ = files.pop("output")
    each = [
        {
            name: path.with_stem(f"{path.stem}-{number}") if cases else path
            for name, (path, _) in files.items()
            if path is not None
        }
        for number in range(1, max(len(held), 1) + 1)
    ]
    for paths in each:
        cli.check_targets(force=force, reads=(), **whole_files, **paths)
    if whole:
        compile_ahead("simulate")
    with cli.progress(whole) as stage:
        found = cli.run(solve, between_mm=between, cases=held, progress=stage)
        results = found if whole else (found,)
        if page is not None:
            stage("making the page")
            cli.write_asked(page, lambda: planner.part_page(results))
    document = results[0].json()
    if cases is not None:
        document = encode_document({"schema": 1, "cases": [one.document() for one in results]})
    cli.write_asked(whole_files.get("output"), lambda: document)
    for result, paths in zip(results, each, strict=True):
        for name, path in paths.items():
            cli.write_asked(path, partial(files[name][1], result))
    if cli.in_words(lambda: document):
        (_part_report if whole else _bar_report)(results)
        cli.tell_findings([f.message for result in results for f in result.findings], "the JSON")
        some = [path for paths in each for path in paths.values()]
        cli.say(*(f"wrote {path}" for path in (*some, *whole_files.values()) if path))
    return 0 if all(result.ok for result in results) else 1


def _check_endings(**given: tuple[Path | None, *tuple[str, ...]]) -> None:
    from planner.formats.outputs import is_stream

    for name, (path, *endings) in given.items():
        if not (path is None or is_stream(path) or path.suffix.casefold() in endings):
            raise ArgumentError(f"--{name} {path}: its ending must be {' or '.join(endings)}")


def _between(text: str) -> tuple[float, float]:
    start, _, stop = text.partition(":")
    said = "it must be START:STOP in mm, as in 36.5:65.9"
    with refused(ArgumentError, f"--between {text}", said, ValueError):
        return float(start), float(stop)


def _part_report(results: "Sequence[planner.PartSimulation]") -> None:
    from planner.report.loaded_part import part_title, response_rows, step_rows, summary_words

    cli.tell_notes(note for result in results for note in result.notes)
    for result in results:
        steps = list(step_rows(result, _ROWS))
        columns = [f">{name}" for name in steps[0]]
        cells = [[*row.values()] for row in steps]
        cli.print_table(columns, cells, title=part_title(result), droppable=["energy, mJ"])
        rows = list(response_rows(result))
        named, what, *figures = rows[0]
        columns = [named, what, *(f">{name}" for name in figures)]
        cli.print_table(columns, [[*row.values()] for row in rows], droppable=figures[-1:])
        cli.say(*summary_words(result))


def _bar_report(results: "Sequence[planner.Simulation]") -> None:
    (result,) = results
    cli.warn(*result.notes)
    evenly = {round(i * (len(result.force_N) - 1) / (_ROWS - 1)) for i in range(_ROWS)}
    shown = sorted(evenly | {int(result.displacement_mm.argmax())})
    bar = result.bar
    interval = f"{100 * result.level:g} % interval"
    rows = []
    for i in shown:
        figures = result.time_s[i], result.displacement_mm[i], result.force_N[i]
        time, travel, force = (format_number(float(figure), 4) for figure in figures)
        ends, strain = format_range(result.force_interval_N[i].tolist()), result.strain[i]
        most = f"{strain.max():.4f} at {bar.x_mm[int(strain.argmax())]:.2f} mm"
        rows.append([time, travel, f"{result.gauge_strain[i]:.4f}", force, ends, most])
    of = f"{result.name}, {bar.gauge_mm:.4g} mm long, {counted(len(bar.x_mm), 'slice')}"
    title = f"{of}, {result.protocol} to strain {result.to_strain:g}"
    columns = [">time s", ">mm", ">strain", ">force N", interval, "most strain"]
    cli.print_table(columns, rows, title=title)


# ------------------------------------------------------------------------------------------------
# planner export.


def export(
    source: str,
    *,
    to: str,
    output: cli.Output = None,
    cell_mm: Annotated[float | None, *_CELL] = None,
    loads: _LoadOptions,
    to_strain: float | None = None,
    material: _MeshMaterial = None,
    unit: _MeshUnit = None,
    bodies: cli.MeshBodies = None,
    printer: _PlansPrinter = None,
    palette: cli.PaletteName = None,
    force: cli.Overwrite = False,
) -> int:
    """Write a planned part as hexahedra, each in its material, for Abaqus, CalculiX or ParaView.

    Cells of an even lattice that are at least half full stand for the part; curved and slanted
    faces are stairs. With --fix and --load, --pressure, --move or --gravity the file has a step
    and runs as it is; without, it has sets of nodes at the part's ends to make one.

    Example: [bold]planner export finger-graded --to calculix --fix x=max --load "x=min: 0,0,-0.2
    N"[/bold]

    Parameters
    ----------
    source
        A plan.json or its folder, or with --material a mesh.
    to
        abaqus, calculix (INP files) or vtu (ParaView).
    output
        File to write; <part>.inp or .vtu by default.
    cell_mm
        Edge of a cell in mm; by default what makes about 15000.
    to_strain
        Strain up to which CalculiX' laws follow the palette; by default 1.5 times what the part
        reaches under its loads, or the break.
    """
    part, ending = Path(source), ".vtu" if to == "vtu" else ".inp"
    if output is None and (part.is_dir() or part.suffix.casefold() == ".json"):
        part = Path(planner.read_plan(source).part.file)
    path = Path(part.stem + ending) if output is None else output
    cli.check_targets(force=force, output=path)
    _check_endings(output=(path, ending))
    with cli.progress() as stage:
        stage("filling the part with cells")
        model = cli.run(planner.export)
    model.write(path, force=force)
    if cli.in_words(model.json):
        _export_report(model)
        cli.say(f"wrote {path}")
    return 0


def _export_report(model: "planner.Export") -> None:
    cli.tell_notes(model.notes)
    columns = ["material", ">coordinate", ">modulus MPa", ">cells", ">volume mm3"]
    of_law = [">law", ">to strain", ">off by"] if model.to == "calculix" else []
    rows = []
    for made in model.materials:
        figures = [f"{made.coordinate:.4g}", format_number(made.modulus_MPa), str(made.cells)]
        to = "-" if made.to_strain is None else f"{made.to_strain:.3g}"
        off = "-" if made.fit_error is None else f"{made.fit_error:.1%}"
        law = [made.law or "-", to, off][: len(of_law)]
        rows.append([made.name, *figures, format_number(made.volume_mm3, 4), *law])
    of = f"{model.cells} cells of {sized(model.cell_mm, '.3g')} mm, {model.nodes} nodes"
    title = f"{model.name}: {of}, volume {model.volume_error:+.1%}"
    cli.print_table([*columns, *of_law], rows, title=title)


# ------------------------------------------------------------------------------------------------
# planner design.


def design(
    part: Path,
    *,
    from_: Annotated[str, "--from"],
    to: str,
    target: list[str] | None = None,
    loads: _LoadOptions,
    cases: _CasesFile = None,
    case: list[str] | None = None,
    limit: list[str] | None = None,
    free: str | None = None,
    symmetric: str = "",
    robust: bool = False,
    knots: int = 7,
    axis: str | None = None,
    field: str | None = None,
    prefer: str = "smooth",
    blend: str | None = None,
    at_strain: float = 0.1,
    cell_mm: Annotated[float | None, *_CELL] = None,
    minutes: float | None = None,
    tolerance: float = 0.01,
    unit: _MeshUnit = None,
    bodies: cli.MeshBodies = None,
    printer: str | None = None,
    limits: cli.PrinterLimits,
    palette: cli.PaletteName = None,
    output: cli.Output = None,
    no_page: bool = False,
    force: cli.Overwrite = False,
    force_oversize: cli.ForceOversize = False,
) -> int:
    """Find the gradient with which a part bends, stretches or holds as wanted, and plan its print.

    The gradient is found on the whole part, planned in printed materials, simulated in those, and
    corrected. Exit code 1 when a target or limit is missed: the nearest is written. Ctrl-C ends the
    search and writes the best so far (a second one writes nothing); the same command goes on.

    Example: [bold]planner design finger.stl --from Tango --to Vero --axis x --fix x=max --load
    "x=min: 0,0,-0.5 N" --target "x=min uz=-12 mm"[/bold]

    Parameters
    ----------
    part
        Mesh file, as for planner grade.
    from_
        What the gradient begins with: a material or a modulus (0.5MPa).
    to
        What it ends with. Nothing softer or stiffer is used.
    target
        What is wanted, as 'x=min uz=-12 mm', 'x=min ry=30 deg' (the faces turn), 'z=max to z=min
        distance=12 mm', 'x=min stiffness=0.05 N/mm', 'x=max fz=2 N', 'shape: bent.stl' (the surface
        as it is to be) or 'shape: points.csv'; 'weight 2' behind one makes its miss count twice.
        Repeatable.
    case
        A further load case: 'side; load x=min: 0,0.1,0 N; limit x=min uy<1 mm': its name, then
        target, limit, fix, load, ..., as in a file; held as the first one if nothing is said.
        Repeatable.
    limit
        'strain/break<0.5', 'slope<0.1 /mm', or a figure without its sign: 'x=min uy<1 mm'.
        Repeatable.
    free
        A gradient free in space: on a lattice of 6x3x3 controls, one each 8mm, or auto.
    symmetric
        With --free: its own mirror image across the part's middle along y, say.
    robust
        Limits hold at the worst of the palette's interval.
    knots
        Of the profile, between which it is even.
    axis
        Direction of the gradient; the longest side by default.
    field
        What the gradient follows instead, as for planner grade.
    prefer
        Among profiles that reach the targets: smooth (near the even gradient) or soft (least of
        what is stiff).
    blend
        nearest, by default, or dither.
    at_strain
        Working strain of the moduli.
    cell_mm
        Edge of the cells; about 2000 by default.
    minutes
        Take the finest cells that are done in about that time.
    tolerance
        Relative miss of a target that is accepted.
    printer
        Installed printer, or its TOML file; connex3 by default.
    output
        Folder to write; <part>-designed by default.
    no_page
        Leave plan.html out.
    """
    from planner.compilation_cache import compile_ahead
    from planner.inverse_design.design import interrupted_design
    from planner.simulation.loads import LoadCase, read_cases

    folder = Path(f"{part.stem}-designed") if output is None else output
    goes_on = interrupted_design(folder)
    force = force or goes_on
    cli.check_targets(force=force, output=(folder, "plan.json"))
    further = [
        one if one.fix or one.move else replace(one, fix=loads.fix or (), move=loads.move or ())
        for one in map(LoadCase.read, case or ())
    ]
    compile_ahead("simulate", "grade")
    with cli.long_progress() as stage:
        instead = {
            "cases": (*(() if cases is None else read_cases(cases)), *further),
            "start": folder if goes_on else None,
            "steps": 0 if no_page else _STEPS,
            "printer": limits.printer(printer),
        }
        made = cli.run(planner.design, **instead, progress=stage)
        stage("writing the files")
        made.write(folder, force=force, page=None if no_page else planner.plan_page(made))
    if cli.in_words(made.json):
        _design_report(made, folder)
    return cli.Kept(130) if made.interrupted else 0 if made.ok else 1


_STEPS = 4
"""Of each load on the page: the view takes a second a step where there is no graphics card."""


def _design_report(made: "planner.PartDesign", folder: Path) -> None:
    cli.tell_notes(made.notes)
    interval = f">{100 * made.level:g} % interval"
    columns = ["target", ">wanted", ">gradient", ">printed", ">error", interval]
    rows = []
    for row in made.reached:
        target = f"{row.case}: {row.target}" if row.case else row.target
        wanted = f"{row.kind if row.kind in '<>' else ''}{row.wanted:.4g} {row.unit}"
        off = "" if row.error is None or row.kind in "<>" else f"{100 * row.error:+.2f} %"
        ends = "" if row.interval is None else format_range(list(row.interval))
        rows.append([target, wanted, f"{row.continuous:.4g}", f"{row.printed:.4g}", off, ends])
    cli.print_table(columns, rows, title=repr(made)[1:-1])
    if made.free is None:
        knots = zip(made.positions, made.moduli_MPa, strict=True)
        cli.say("profile: " + ", ".join(f"{E:.3g} MPa at {u:.3g}" for u, E in knots))
    if made.strain_over_break is not None:
        cli.say(f"largest strain over elongation at break: {made.strain_over_break:.3g}")
    cli.finding(*(f.message for f in made.findings), *(f.message for f in made.plan.findings[:3]))
    more = "" if made.table is None else "field.vti (opens in ParaView), "
    cli.say(f"wrote {folder}: what planner grade writes, {more}design.json and profile.csv")
