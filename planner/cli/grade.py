"""planner grade."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, AtStrain, PaletteName, PrinterName, Quiet, choose

if TYPE_CHECKING:
    from planner.plan import Plan, Region

__all__ = ["grade"]

_FINDINGS_SHOWN = 10


def grade(
    part: Annotated[Path, typer.Argument(help="Mesh: STL, 3MF, PLY, OBJ, OFF, GLB.")],
    from_: Annotated[
        str | None, typer.Option("--from", help="Material where the gradient begins.")
    ] = None,
    to: Annotated[str | None, typer.Option("--to", help="Material where it ends.")] = None,
    axis: Annotated[
        str | None,
        typer.Option(
            help="Direction: x, y, z, -x, ... or dx,dy,dz; the longest extent by default."
        ),
    ] = None,
    field: Annotated[
        str | None,
        typer.Option(
            help="What the gradient follows instead of an axis, NAME: ARGUMENTS: radial, "
            "distance, harmonic, geodesic, expression, table, points, axis, and min, max, "
            "blend, clamp of such; see docs/how-to/grade-along-a-field.md."
        ),
    ] = None,
    pitch: Annotated[
        float | None,
        typer.Option(
            help="Grid, in mm, on which curved fields are drawn; by default 0.5, finer for parts "
            "smaller than 25 mm, coarser for those larger than 63 mm."
        ),
    ] = None,
    profile: Annotated[
        str,
        typer.Option(
            help="log, linear, smooth, steps:N, or a CSV file with position (0..1) and "
            "modulus_MPa or material."
        ),
    ] = "log",
    bands: Annotated[
        int | None,
        typer.Option(
            help="Cut into N equal steps, with --blend nearest or mix; by default the cuts lie "
            "where the material or mixture changes."
        ),
    ] = None,
    blend: Annotated[
        str,
        typer.Option(
            help="How a target between two materials is met: nearest takes the nearer one; dither "
            "deals cells of both; bands:N lets N pairs of thinner bands take turns; mix records "
            "mixtures; see docs/how-to/blend-materials.md."
        ),
    ] = "nearest",
    cell: Annotated[
        float | None,
        typer.Option(
            help="Edge, in mm, of the cells that dither deals; the printer's smallest feature by "
            "default."
        ),
    ] = None,
    at_strain: AtStrain = 0.1,
    unit: Annotated[
        str | None, typer.Option(help="Unit of the mesh: mm, cm, m, um, inch, ft.")
    ] = None,
    printer: PrinterName = "connex3",
    palette: PaletteName = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder to write; <part>-graded by default."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier plan there.")] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Write nothing when something was found.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Plan and report, but write nothing.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Grade a part from one stiffness to another and write the files that print it.

    Example: [bold]planner grade finger.stl --from Tango --to Vero --axis x[/bold]
    """
    from planner.cli.output import progress
    from planner.formats.folder import check_target
    from planner.grading.planning import grade as plan_part

    machine, chosen = choose(printer, palette)
    folder = Path(f"{part.stem}-graded") if output is None else output
    if not dry_run:
        check_target(folder, force=force)
    with progress(not quiet and not as_json) as stage:
        plan = plan_part(
            part,
            from_=from_,
            to=to,
            axis=axis,
            field=field,
            pitch_mm=pitch,
            profile=profile,
            bands=bands,
            blend=blend,
            cell_mm=cell,
            at_strain=at_strain,
            unit=unit,
            printer=machine,
            palette=chosen,
            progress=stage,
        )
        refused = strict and not plan.ok
        if not (dry_run or refused):
            stage("writing the files")
            plan.write(folder, force=force)
    _report(plan, None if dry_run or refused else folder, as_json=as_json, quiet=quiet)
    return 0 if plan.ok else 1


def _report(plan: "Plan", folder: Path | None, *, as_json: bool, quiet: bool) -> None:
    from planner.cli.output import finding, print_document, say, warn

    if as_json:
        print_document(plan.json())
        return
    if quiet:
        return
    for remark in (*plan.part.repairs, *plan.warnings):
        warn(f"{plan.part.file}: {remark}")
    _table(plan)
    for missed in plan.unreachable:
        low, high = missed.target_modulus_MPa
        finding(
            f"target {low:.3g} .. {high:.3g} MPa at field {missed.field[0]:.3f} .. "
            f"{missed.field[1]:.3f} is out of reach; the nearest is {missed.nearest} with "
            f"{missed.modulus_MPa:.3g} MPa"
        )
    for found in plan.findings[:_FINDINGS_SHOWN]:
        finding(found.message)
    if len(plan.findings) > _FINDINGS_SHOWN:
        finding(f"{len(plan.findings) - _FINDINGS_SHOWN} more of these are in plan.json")
    failed = [name for name, check in plan.checks.items() if not check.ok]
    held = len(plan.checks) - len(failed)
    say(
        f"{held} of {len(plan.checks)} checks hold"
        + (f"; not: {', '.join(failed)}" if failed else "")
    )
    if folder is None:
        say("nothing was written")
    else:
        say(f"wrote {folder} (next: planner check {folder}; open {folder / 'HOWTO.md'})")


def _mm_along(field: Mapping[str, object]) -> tuple[float, float]:
    """Return where a field that is a length begins, and how far it goes, in mm."""
    begin, end, span = field.get("from_mm"), field.get("to_mm"), field.get("span_mm")
    if isinstance(begin, float) and isinstance(end, float):
        return begin, end - begin
    return 0.0, span if isinstance(span, float) else 1.0


def _blend_text(region: "Region") -> str:
    """Say in a few words what a region has to do with its neighbour."""
    blend = region.blend or {}
    if blend.get("kind") == "dither":
        return f"{100 * blend['volume_fraction']:.1f} % {blend['upper']} in {blend['lower']}"
    if blend.get("kind") == "bands":
        return f"{100 * blend['share']:.1f} % {blend['upper']}, {blend['lower']} in turn"
    if blend.get("kind") == "mix":
        return f"{100 * blend['fraction']:.1f} % {blend['upper']} mixed in {blend['lower']}"
    return ""


def _table(plan: "Plan") -> None:
    from planner.cli.output import figure, print_table

    colours = {shell.material: shell.colour for shell in plan.shells}
    field = plan.gradient.field
    span = field.get("span_mm")
    begin, way = _mm_along(field)
    blended = plan.gradient.blend is not None
    rows = []
    for region in plan.regions:
        low, high = region.target_modulus_MPa
        start, stop = region.field
        where = (
            f"{begin + start * way:.2f} .. {begin + stop * way:.2f}"
            if isinstance(span, float)
            else f"{start:.4f} .. {stop:.4f}"
        )
        rows.append(
            [
                str(region.index),
                region.printed,
                *([_blend_text(region)] if blended else []),
                where,
                f"{figure(low)} .. {figure(high)}",
                figure(region.modulus_MPa),
                f"{figure(region.modulus_interval_MPa[0])} .. "
                f"{figure(region.modulus_interval_MPa[1])}",
                f"{100 * region.error[0]:+.0f} .. {100 * region.error[1]:+.0f} %",
                figure(region.volume_mm3, 4),
                figure(region.mass_g),
            ]
        )
    total = sum(r.volume_mm3 for r in plan.regions), sum(r.mass_g for r in plan.regions)
    rows.append(
        ["", "all", *([""] if blended else []), *[""] * 5, figure(total[0], 4), figure(total[1])]
    )
    print_table(
        [
            "#",
            "material",
            *(["blend"] if blended else []),
            "along mm" if isinstance(span, float) else "field",
            "target MPa",
            "achieved",
            "95 % interval",
            "error",
            "volume mm3",
            "mass g",
        ],
        rows,
        title=f"{plan.part.file} on {plan.printer}: secant modulus at strain "
        f"{plan.stiffness.at_strain:g}, of rigid grades the initial modulus",
        right=["#", "achieved", "error", "volume mm3", "mass g"],
        droppable=["95 % interval", "error", "#"],
        swatches=[colours.get(r.printed, "#808080") for r in plan.regions] + ["default"],
    )
