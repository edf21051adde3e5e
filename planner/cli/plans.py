"""planner grade, view, check, diff, compare, slices: they make or take a plan."""

import re
import textwrap
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import Annotated, Any

import planner
from planner.cli import output as cli
from planner.errors import ArgumentError, Caution
from planner.glance import format_number

# ------------------------------------------------------------------------------------------------
# planner grade.


def grade(
    part: Path,
    like: Path | None = None,
    *,
    from_: Annotated[str | None, "--from"] = None,
    to: str | None = None,
    axis: str | None = None,
    field: str | None = None,
    pitch_mm: Annotated[float | None, "--pitch"] = None,
    profile: str | None = None,
    bands: int | None = None,
    blend: str | None = None,
    cell_mm: Annotated[float | None, "--cell"] = None,
    snap_mm: Annotated[float | None, "--snap"] = None,
    at_strain: float | None = None,
    tolerance: float | None = None,
    unit: str | None = None,
    bodies: cli.MeshBodies = None,
    printer: str | None = None,
    limits: cli.PrinterLimits,
    palette: cli.PaletteName = None,
    output: cli.Output = None,
    force: bool = False,
    force_oversize: cli.ForceOversize = False,
    coupons: bool = False,
    strict: bool = False,
    dry_run: bool = False,
    no_page: bool = False,
    slicer: Annotated[str | None, "--for"] = None,
) -> int:
    """Grade a part from one stiffness to another and write the files that print it.

    Exit code 1 when a target is out of reach, a check fails or something will not print as drawn.

    Example: [bold]planner grade finger.stl --from Tango --to Vero --axis x[/bold]

    Parameters
    ----------
    part
        Mesh: STL, 3MF, PLY, OBJ, OFF, GLB; or STEP, with the package cascadio.
    like
        An earlier plan's folder or plan.json: its targets in MPa are to be met again, with another
        --palette; what else is not stated is as it was there; see docs/how-to/close-the-loop.md.
    from_
        Where the gradient begins: a material, or a modulus with its unit (500kPa).
    to
        Where it ends: a material, or a modulus (7MPa).
    axis
        Direction: x, y, z, -x, ... or dx,dy,dz; the longest extent by default.
    field
        What the gradient follows instead of an axis, NAME: ARGUMENTS: radial, distance, harmonic,
        geodesic, expression, table, points, axis, and min, max, blend, clamp of such; see
        docs/how-to/grade-along-a-field.md.
    pitch_mm
        Cells, in mm, in which curved fields are drawn, all alike; without it they are divided until
        interfaces lie within 20 um.
    profile
        log (by default), linear, smooth, steps:N, grades (an equal length of each material from the
        one nearest to --from to that nearest to --to), or a CSV file with position (0..1) and
        modulus_MPa or material.
    bands
        Cut into N equal steps, with --blend nearest or mix; by default the cuts lie where the
        material or mixture changes.
    blend
        How a target between two materials is met: nearest, by default, takes the nearer one; dither
        deals cells of both; bands:N lets N pairs of thinner bands take turns; mix records mixtures;
        see docs/how-to/blend-materials.md.
    cell_mm
        Edge, in mm, of the cells that dither deals; the printer's smallest feature by default.
    snap_mm
        How far, in mm, a cut may be moved so that it leaves no sliver beside a face of the part;
        half the minimum wall by default, 0 for not at all.
    at_strain
        Working strain: stiffness is the secant modulus of the nominal stress up to it; 0.1 by
        default.
    tolerance
        How many times as stiff or as soft as asked is no finding yet, as 1.25; or below 1 a share,
        as 0.25 for 25 %; 2 by default.
    unit
        Unit of the mesh: mm, cm, m, um, inch, ft.
    printer
        Installed printer, see [bold]planner printers[/bold], or its TOML file; connex3 by default.
    output
        Folder to write; <part>-graded by default.
    force
        Replace an earlier plan there.
    coupons
        Lay a tensile coupon of each material (ASTM D638, type IV) beside the part, to be printed
        and pulled with it: the folder coupons.
    strict
        Write nothing when something was found.
    dry_run
        Plan and report, but write nothing.
    no_page
        Leave plan.html out, the page that shows the plan.
    slicer
        Slicer that the 3MF is for: prusaslicer gets all materials as one mesh, which it needs to
        show one object; bambu, orca and cura open the 3MF that is written by default; see
        docs/how-to/open-in-a-slicer.md.
    """
    from planner.compilation_cache import compile_ahead
    from planner.formats.threemf import needs_one_mesh

    folder = Path(f"{part.stem}-graded") if output is None else output
    machine = limits.printer(printer, like)
    if slicer is not None:
        needs_one_mesh(slicer)  # a slip is told before the work
    if not dry_run:
        cli.check_targets(force=force, output=(folder, "plan.json"))
    compile_ahead("grade --field" if field or blend == "dither" else "grade")
    with cli.progress() as stage:
        plan = cli.run(planner.grade, printer=machine, progress=stage)
        kept = not dry_run and (plan.ok or not strict)
        if kept:
            stage("writing the files")
            page = None if no_page else planner.plan_page(plan)
            plan.write(folder, force=force, page=page, slicer=slicer)
    if cli.in_words(plan.json):
        _grade_report(plan, folder if kept else None, like)
    return 0 if plan.ok else 1


def _grade_report(plan: "planner.Plan", folder: Path | None, like: Path | None) -> None:
    from planner.report.plan_figure import error_words, moved_words, unreachable_words

    cli.tell_notes(
        Caution(f"{plan.part.file}: {remark}") if isinstance(remark, Caution) else remark
        for remark in (*map(Caution, plan.part.repairs), *plan.warnings)
    )
    _table(plan)
    cli.say(*filter(None, (error_words(plan), moved_words(plan))))
    cli.finding(*unreachable_words(plan))
    cli.tell_findings([found.message for found in plan.findings], "plan.json")
    failed, count = [name for name, check in plan.checks.items() if not check.ok], len(plan.checks)
    more = f"; not: {', '.join(failed)}" if failed else ""
    cli.say(f"{count - len(failed)} of {count} checks hold{more}")
    if folder is None:
        cli.say("nothing was written")
        return
    named = quote("./" * str(folder).startswith("-") + str(folder))
    cli.say(f"wrote {folder} (next: planner check {named}; planner view {named})")
    if like is not None:
        cli.say(
            f"what changed: planner diff {like} {folder}; once it is printed and pulled: "
            "planner gap next CAMPAIGN, with it in specimens.csv"
        )


def _table(plan: "planner.Plan") -> None:
    from planner.report.plan_figure import plan_table

    colours = {shell.material: shell.colour for shell in plan.shells}
    table = plan_table(plan)
    cli.print_table(
        [f">{name}" if name in table.right else name for name in table.columns],
        [[row.get(name, "") for name in table.columns] for row in (*table.rows, table.total)],
        title=table.title,
        droppable=["#", "95 % interval", "mass g", "volume mm3", "blend", "error"],
        abridged="the rows left out are in plan.json",
        swatches=[colours.get(r.printed, "#808080") for r in plan.regions] + ["default"],
    )


# ------------------------------------------------------------------------------------------------
# planner view.


def view(plan: Path, no_open: bool = False) -> int:
    """Open a plan's page in the browser: the part in its materials, its figures, how to print it.

    The page, plan.html, is made where it is missing or of another version.

    Example: [bold]planner view finger-graded[/bold]

    Parameters
    ----------
    plan
        Folder that planner grade wrote, or its plan.json.
    no_open
        Make the page if need be and say where it is, no more.
    """
    with cli.progress() as stage:
        stage("making the page")
        page = planner.view(plan)
    _show(page, no_open=no_open)
    return 0


def _show(page: Path, *, no_open: bool, **more: object) -> None:
    """Open a page in the browser and say where it is; `more` stands in the document, too."""
    import webbrowser

    opened = not no_open and webbrowser.open(page.resolve().as_uri())
    if cli.in_words(lambda: {"schema": 1, "page": str(page), "opened": opened} | more):
        if not (opened or no_open):
            cli.warn("no browser could be started; open the page yourself")
        cli.say(str(page))


# ------------------------------------------------------------------------------------------------
# planner check.


def check(folder: Path) -> int:
    """Verify a plan's folder anew from its files alone and print a certificate.

    Exit code 1 when something does not hold.

    Example: [bold]planner check finger-graded[/bold]

    Parameters
    ----------
    folder
        Folder that planner grade wrote.
    """
    with cli.progress() as stage:
        certificate = planner.check(folder, progress=stage)
    if cli.in_words(certificate.document):
        rows = [
            [name, f"{c.value:.3g}", f"{c.limit:.3g}", "yes" if c.ok else "NO"]
            for name, c in certificate.checks.items()
        ]
        where = f"{folder}: {certificate.part} on {certificate.printer}"
        title = f"{where}, {certificate.shells} shells, {certificate.triangles} triangles"
        cli.print_table(["check", ">value", ">limit", "holds"], rows, title=title)
        cli.finding(*certificate.problems)
        cli.finding(*(f"reported by the plan: {message}" for message in certificate.reported))
        cli.say(_verdict(certificate))
    return 0 if certificate.ok else 1


def _verdict(certificate: "planner.Certificate") -> str:
    if certificate.ok:
        return "the folder is sound"
    failed = certificate.problems or not all(c.ok for c in certificate.checks.values())
    return "the folder is NOT sound" if failed else "the files are sound, with the findings above"


# ------------------------------------------------------------------------------------------------
# planner diff.


_Tolerance = Annotated[
    float, "Relative difference of volumes, masses and moduli that still counts as equal."
]


def diff(before: Path, after: Path, tolerance: _Tolerance = 1e-6) -> int:
    """Compare two plans by meaning: material moved, volume changed, another target.

    Exit code 1 when they differ.

    Example: [bold]planner diff finger-graded finger-graded-before[/bold]

    Parameters
    ----------
    before
        A plan.json, or the folder that holds it.
    after
        The plan to compare with it.
    """
    found = planner.diff(before, after, tolerance=tolerance)
    if cli.in_words(lambda: _equality(found)):
        for difference in found:
            cli.say(textwrap.fill(difference.text, cli.terminal_width(), subsequent_indent="    "))
        if not found:
            cli.say("the plans mean the same")
    return 1 if found else 0


def _equality(found: "Sequence[planner.Difference]") -> dict[str, Any]:
    return {"schema": 1, "equal": not found, "differences": [asdict(one) for one in found]}


# ------------------------------------------------------------------------------------------------
# planner compare.


def compare(
    before: Path,
    after: Path,
    output: Annotated[Path, "--output", "-o"] = Path("compare.html"),
    tolerance: _Tolerance = 1e-6,
    no_open: bool = False,
    force: bool = False,
) -> int:
    """Write a page with two plans side by side, turned and cut together, and open it.

    Exit code 1 when they differ, as of [bold]planner diff[/bold].

    Example: [bold]planner compare finger-graded finger-graded-before[/bold]

    Parameters
    ----------
    before
        Folder that planner grade wrote, or its plan.json.
    after
        The plan to see beside it.
    output
        Page to write; compare.html by default.
    no_open
        Write the page and say where it is, no more.
    force
        Replace a page that is there.
    """
    cli.check_targets(force=force, output=output)
    with cli.progress() as stage:
        stage("making the page")
        found = planner.diff(before, after, tolerance=tolerance)
        cli.write_asked(output, lambda: planner.compare_page(before, after, tolerance=tolerance))
    _show(output, no_open=no_open, **_equality(found))
    return 1 if found else 0


# ------------------------------------------------------------------------------------------------
# planner slices.


def slices(
    plan: Path,
    output: Annotated[Path, "--output", "-o"],
    pitch_mm: Annotated[str | None, "--pitch"] = None,
    indexed: bool = False,
    printer: str | None = None,
    scheduler: str | None = None,
    force: bool = False,
) -> int:
    """Write a plan as the printer's own layers: one image a layer, one colour a material.

    Exit code 1 when the plan's shells overlap or are open.

    Example: [bold]planner slices finger-graded -o finger-slices[/bold]

    Parameters
    ----------
    plan
        Folder that planner grade wrote, or its plan.json.
    output
        Folder to write.
    pitch_mm
        Edges of a voxel in mm, X,Y,Z or one for all; the printer's own by default.
    indexed
        Write palette images: smaller, the same colours.
    printer
        Installed printer or its file; else the plan's.
    scheduler
        Make the layers on a Dask cluster: its scheduler, tcp://HOST:PORT.
    force
        Replace an earlier stack there.
    """
    cli.check_targets(force=force, output=(output, "slices.json"))
    pitch = None if pitch_mm is None else _lengths(pitch_mm)
    with cli.progress(layers=True) as advance:
        stack = cli.run(planner.write_slices, pitch_mm=pitch, progress=advance)
    if cli.in_words(stack.json):
        _slices_report(stack, output)
    if not cli.asked("quiet"):
        cli.finding(*stack.findings)
    return 0 if stack.ok else 1


def _lengths(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError as error:
        numbers = re.findall(r"\d*\.?\d+", text)
        scale, hint = 0.001 if re.search(r"[uµμ]m", text) else 1.0, ""
        if len(numbers) in (1, 3):
            hint = f"did you mean {','.join(f'{float(each) * scale:g}' for each in numbers)}? "
        raise ArgumentError(
            f"--pitch {text}: {hint}give lengths in mm without a unit, X,Y,Z as 0.042,0.042,0.03 "
            "or one for all"
        ) from error


def _slices_report(stack: "planner.SliceStack", folder: Path) -> None:
    x, y, z = stack.grid.pitch_mm
    total = sum(each.voxels for each in stack.materials)
    rows = []
    for each in stack.materials:
        colour = "#" + bytes(each.rgba[:3]).hex().upper()
        volume = format_number(each.volume_mm3, 4)
        rows.append([each.material, colour, str(each.voxels), volume])
    rows.append(["all", "", str(total), format_number(total * stack.grid.voxel_mm3, 4)])
    cli.print_table(
        ["material", "colour", ">voxels", ">volume mm3"],
        rows,
        title=f"{stack.part.file} on {stack.printer}: {stack.grid.shape[2]} layers of "
        f"{stack.grid.shape[0]} x {stack.grid.shape[1]} pixels, {x:g} x {y:g} x {z:g} mm",
        swatches=[colour or "default" for _, colour, *_ in rows],
    )
    cli.say(f"wrote {folder} (materials and grid: {folder / 'slices.json'})")
