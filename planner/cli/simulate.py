"""planner simulate: a bar pulled along its axis, or a whole part as it is held and loaded."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Context, Option

from planner.cli.output import (
    AsJson,
    FixedFaces,
    Gravity,
    Loads,
    MeshBodies,
    MeshMaterial,
    MeshUnit,
    Moves,
    PaletteName,
    Pressures,
    Quiet,
    check_targets,
)
from planner.errors import ArgumentError

if TYPE_CHECKING:
    from planner.simulation.part import PartSimulation
    from planner.simulation.simulate import Simulation

_ROWS = 6
_FINDINGS_SHOWN = 10


def simulate(
    context: Context,
    source: Annotated[
        str,
        Argument(
            help="A plan.json or its folder, a profile (CSV: x_mm, coordinate[, width_mm, "
            "thickness_mm]), a material, or with --fix and --load a mesh."
        ),
    ],
    fix: FixedFaces = None,
    load: Loads = None,
    pressure: Pressures = None,
    move: Moves = None,
    gravity: Gravity = None,
    watch: Annotated[
        list[str] | None, Option(help="Faces whose displacement is told too, as x=min.")
    ] = None,
    material: MeshMaterial = None,
    cell_mm: Annotated[
        float | None,
        Option(
            "--cell",
            "--cell-mm",
            help="Edge of the cells that the whole part is cut into; about 2000 by default.",
        ),
    ] = None,
    compare_cells: Annotated[
        bool,
        Option(
            "--compare-cells/--no-compare-cells",
            help="Solve with larger cells too, which tells how far figures depend on them.",
        ),
    ] = True,
    unit: MeshUnit = None,
    bodies: MeshBodies = None,
    to_strain: Annotated[
        float | None, Option(help="Largest displacement over the bar's length; 0.3 by default.")
    ] = None,
    rate_mm_s: Annotated[
        float | None,
        Option(
            "--rate",
            help="Crosshead speed in mm/s, which sets the times alone; by default the palette's "
            "reference strain rate.",
        ),
    ] = None,
    protocol: Annotated[str, Option(help="monotonic, cyclic or relaxation.")] = "monotonic",
    cycles: Annotated[int, Option(help="Of the cyclic protocol.")] = 1,
    hold_s: Annotated[float, Option(help="How long relaxation holds, in seconds.")] = 100.0,
    steps: Annotated[
        int | None,
        Option(help="Load steps up, and down or held: 100 by default, 5 of a whole part."),
    ] = None,
    slices: Annotated[int, Option(help="Slices of a plan or a profile.")] = 400,
    between_mm: Annotated[
        str | None,
        Option(
            "--between", help="START:STOP in mm along the axis: pull only this stretch of the bar."
        ),
    ] = None,
    width_mm: Annotated[float, Option(help="Width of a coupon, or of a profile without.")] = 6.0,
    thickness_mm: Annotated[float, Option(help="Thickness of a coupon or such a profile.")] = 4.0,
    gauge_mm: Annotated[float, Option(help="Gauge length of a coupon.")] = 33.0,
    level: Annotated[
        float, Option(help="How probably an interval holds what a print does.")
    ] = 0.95,
    printer: Annotated[
        str | None, Option(help="Installed printer; by default the plan's, else connex3.")
    ] = None,
    palette: PaletteName = None,
    output: Annotated[
        Path | None,
        Option("--output", "-o", help="File to write: .csv (the curve) or .json (all)."),
    ] = None,
    field: Annotated[
        Path | None, Option(help="CSV file to write: strain along the bar at every step.")
    ] = None,
    figure: Annotated[Path | None, Option(help="SVG file to write: the curves.")] = None,
    deformed: Annotated[
        Path | None, Option(help="STL file to write: the whole part's surface as it is at last.")
    ] = None,
    vtu: Annotated[
        Path | None,
        Option(help="VTU file to write: that surface with displacement, strain and material."),
    ] = None,
    volume: Annotated[
        Path | None,
        Option(help="VTU file to write: the volume with stress, energy, strain over break."),
    ] = None,
    page: Annotated[
        Path | None, Option(help="HTML file to write: the whole part as it moves, in 3D.")
    ] = None,
    force: Annotated[bool, Option("--force", help="Replace files that are there.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Pull a planned part, a graded bar or a coupon; or load a whole part, which may bend.

    Pulled along the axis of its gradient, slices across the axis share one force. With --fix and
    --load, --pressure, --move or --gravity the whole part is solved as it is held and loaded. Exit
    code 1 when a print would break on the way, or the strain or load is out of reach.

    Example: [bold]planner simulate finger-graded --to-strain 0.1 --figure pull.svg[/bold]

    Example: [bold]planner simulate finger-graded --fix x=max --load "x=min: 0,0,-0.5 N"[/bold]
    """
    import planner
    from planner.cli.output import print_document, progress
    from planner.formats.outputs import write_whole

    _check_endings(output=(output, ".csv", ".json"), deformed=(deformed, ".stl"),
                   vtu=(vtu, ".vtu"), volume=(volume, ".vtu"), page=(page, ".html"))  # fmt: skip
    check_targets(
        context, force=force, output=output, field=field, figure=figure, deformed=deformed, vtu=vtu,
        volume=volume, page=page,
    )  # fmt: skip
    conditions = [*(fix or ()), *(load or ()), *(pressure or ()), *(move or ())]
    whole = bool(conditions) or gravity is not None
    for name, path in (("deformed", deformed), ("vtu", vtu), ("volume", volume), ("page", page)):
        if path is not None and not whole:
            raise ArgumentError(f"--{name}: it is of a whole part; give --fix and --load too")
    if field is not None and whole:
        raise ArgumentError("--field: it is of a bar; --vtu has the strains of a whole part")
    options: dict[str, Any] = {
        "fix": fix or (), "load": load or (), "pressure": pressure or (), "move": move or (),
        "gravity": gravity, "watch": watch or (), "material": material, "cell_mm": cell_mm,
        "compare_cells": compare_cells, "unit": unit, "bodies": bodies, "to_strain": to_strain,
        "rate_mm_s": rate_mm_s, "protocol": protocol, "steps": steps, "cycles": cycles,
        "hold_s": hold_s, "slices": slices,
        "between_mm": None if between_mm is None else _between(between_mm), "width_mm": width_mm,
        "thickness_mm": thickness_mm, "gauge_mm": gauge_mm, "level": level, "printer": printer,
        "palette": palette,
    }  # fmt: skip
    with progress(not quiet and not as_json and whole) as stage:
        result: Any = planner.simulate(source, progress=stage, **options)
        if page is not None:
            stage("making the page")
            write_whole(page, planner.part_page(result))
    if output is not None:
        csv = output.suffix.casefold() == ".csv"
        write_whole(output, result.csv() if csv else result.json())
    if field is not None:
        write_whole(field, result.field_csv())
    if figure is not None:
        write_whole(figure, planner.simulation_figure(result))
    if deformed is not None:
        write_whole(deformed, result.deformed_stl())
    if vtu is not None:
        write_whole(vtu, result.vtu())
    if volume is not None:
        write_whole(volume, planner.part_volume(result))
    if as_json:
        print_document(result.json())
    elif not quiet:
        written = [p for p in (output, field, figure, deformed, vtu, volume, page) if p]
        (_part_report if whole else _bar_report)(result, written)
    return 0 if result.ok else 1


def _check_endings(**given: tuple[Path | None, *tuple[str, ...]]) -> None:
    for name, (path, *endings) in given.items():
        if path is not None and path.suffix.casefold() not in endings:
            raise ArgumentError(f"--{name} {path}: its ending must be {' or '.join(endings)}")


def _between(text: str) -> tuple[float, float]:
    start, _, stop = text.partition(":")
    try:
        return float(start), float(stop)
    except ValueError:
        raise ArgumentError(
            f"--between {text}: it must be START:STOP in mm, as in 36.5:65.9"
        ) from None


def _part_report(result: "PartSimulation", written: list[Path]) -> None:
    from planner.cli.output import print_table, say, tell_notes
    from planner.report.part_text import part_title, response_rows, step_rows, summary_words

    tell_notes(result.notes)
    steps = list(step_rows(result, _ROWS))
    columns = list(steps[0])
    print_table(
        columns, [[*row.values()] for row in steps], title=part_title(result), right=columns,
        droppable=["energy, mJ"],
    )  # fmt: skip
    rows = list(response_rows(result))
    columns = list(rows[0])
    print_table(
        columns, [[*row.values()] for row in rows], right=columns[2:], droppable=[columns[-1]]
    )
    for words in summary_words(result):
        say(words)
    _close(result, written)


def _bar_report(result: "Simulation", written: list[Path]) -> None:
    from planner.cli.output import format_number, format_range, print_table, warn

    for note in result.notes:
        warn(note)
    count = len(result.force_N)
    shown = sorted({round(i * (count - 1) / (_ROWS - 1)) for i in range(_ROWS)})
    bar = result.bar
    slices = len(bar.x_mm)
    print_table(
        ["time s", "mm", "strain", "force N", f"{100 * result.level:g} % interval", "most strain"],
        [
            [
                format_number(float(result.time_s[i]), 4),
                format_number(float(result.displacement_mm[i]), 4),
                f"{result.gauge_strain[i]:.4f}",
                format_number(float(result.force_N[i]), 4),
                format_range(result.force_interval_N[i].tolist()),
                f"{result.strain[i].max():.4f} at "
                f"{bar.x_mm[int(result.strain[i].argmax())]:.2f} mm",
            ]
            for i in shown
        ],
        title=f"{result.name}, {bar.gauge_mm:.4g} mm long, {slices} "
        f"{'slice' if slices == 1 else 'slices'}, {result.protocol} to strain "
        f"{result.to_strain:g}",
        right=["time s", "mm", "strain", "force N"],
    )
    _close(result, written)


def _close(result: "PartSimulation | Simulation", written: list[Path]) -> None:
    from planner.cli.output import finding, say

    for found in result.findings[:_FINDINGS_SHOWN]:
        finding(found.message)
    if len(result.findings) > _FINDINGS_SHOWN:
        finding(f"{len(result.findings) - _FINDINGS_SHOWN} more of these are in the JSON")
    for path in written:
        say(f"wrote {path}")
