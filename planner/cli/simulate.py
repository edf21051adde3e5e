"""planner simulate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, PaletteName, Quiet

if TYPE_CHECKING:
    from planner.simulation.result import Simulation

__all__ = ["simulate"]

_ROWS = 6
_FINDINGS_SHOWN = 10


def simulate(
    source: Annotated[
        str,
        typer.Argument(
            help="A plan.json or its folder, a profile (CSV: x_mm, coordinate[, width_mm, "
            "thickness_mm]), or a material."
        ),
    ],
    to_strain: Annotated[
        float, typer.Option("--to-strain", help="Largest displacement over the bar's length.")
    ] = 0.3,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            help="Crosshead speed in mm/s, which sets the times alone; by default the palette's "
            "reference strain rate.",
        ),
    ] = None,
    protocol: Annotated[
        str, typer.Option("--protocol", help="monotonic, cyclic or relaxation.")
    ] = "monotonic",
    cycles: Annotated[int, typer.Option("--cycles", help="Of the cyclic protocol.")] = 1,
    hold_s: Annotated[
        float, typer.Option("--hold-s", help="How long relaxation holds, in seconds.")
    ] = 100.0,
    steps: Annotated[int, typer.Option("--steps", help="Load steps up, and down or held.")] = 100,
    slices: Annotated[int, typer.Option("--slices", help="Slices of a plan or a profile.")] = 400,
    between: Annotated[
        str | None,
        typer.Option(
            "--between", help="START:STOP in mm along the axis: pull only this stretch of the bar."
        ),
    ] = None,
    width_mm: Annotated[
        float, typer.Option("--width-mm", help="Width of a coupon, or of a profile without.")
    ] = 6.0,
    thickness_mm: Annotated[
        float, typer.Option("--thickness-mm", help="Thickness of a coupon or such a profile.")
    ] = 4.0,
    gauge_mm: Annotated[float, typer.Option("--gauge-mm", help="Gauge length of a coupon.")] = 33.0,
    level: Annotated[
        float, typer.Option("--level", help="How probably the interval holds a print's force.")
    ] = 0.95,
    printer: Annotated[
        str | None,
        typer.Option("--printer", help="Installed printer; by default the plan's, else connex3."),
    ] = None,
    palette: PaletteName = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write: .csv (the curve) or .json (all)."),
    ] = None,
    field: Annotated[
        Path | None,
        typer.Option("--field", help="CSV file to write: strain along the bar at every step."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="SVG file to write: both as curves.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Pull a planned part, a graded bar or a coupon, and see its force and strains.

    Slices across the axis share one force. Exit code 1 when a print would break on the way, or
    the strain is out of reach.

    Example: [bold]planner simulate finger-graded --to-strain 0.1 --figure pull.svg[/bold]
    """
    from planner.cli.output import print_document
    from planner.errors import ArgumentError
    from planner.formats.whole_file import check_absent, write_whole
    from planner.simulation.simulate import simulate as pull

    if output is not None and output.suffix.casefold() not in (".csv", ".json"):
        raise ArgumentError(f"--output {output}: its ending must be .csv or .json")
    targets = [path for path in (output, field, figure) if path is not None]
    if len(set(targets)) < len(targets):
        raise ArgumentError("--output, --field and --figure name one file; give each its own")
    for path in targets:
        check_absent(path, force=force)
    result = pull(
        source,
        to_strain=to_strain,
        rate_mm_s=rate,
        protocol=protocol,
        steps=steps,
        cycles=cycles,
        hold_s=hold_s,
        slices=slices,
        between_mm=None if between is None else _between(between),
        width_mm=width_mm,
        thickness_mm=thickness_mm,
        gauge_mm=gauge_mm,
        level=level,
        printer=printer,
        palette=palette,
    )
    if output is not None:
        csv = output.suffix.casefold() == ".csv"
        write_whole(output, result.csv() if csv else result.json())
    if field is not None:
        write_whole(field, result.field_csv())
    if figure is not None:
        from planner.report.simulation_figure import simulation_figure

        write_whole(figure, simulation_figure(result))
    if as_json:
        print_document(result.json())
    elif not quiet:
        _report(result, targets)
    return 0 if result.ok else 1


def _between(text: str) -> tuple[float, float]:
    from planner.errors import ArgumentError

    start, _, stop = text.partition(":")
    try:
        return float(start), float(stop)
    except ValueError:
        raise ArgumentError(
            f"--between {text}: it must be START:STOP in mm, as in 36.5:65.9"
        ) from None


def _report(result: "Simulation", written: list[Path]) -> None:
    from planner.cli.output import figure, finding, print_table, say, warn

    for note in result.notes:
        warn(note)
    count = len(result.force_N)
    shown = sorted({round(i * (count - 1) / (_ROWS - 1)) for i in range(_ROWS)})
    low, high = result.force_interval_N.T
    bar = result.bar
    slices = len(bar.x_mm)
    print_table(
        ["time s", "mm", "strain", "force N", f"{100 * result.level:g} % interval", "most strain"],
        [
            [
                figure(float(result.time_s[i]), 4),
                figure(float(result.displacement_mm[i]), 4),
                f"{result.gauge_strain[i]:.4f}",
                figure(float(result.force_N[i]), 4),
                f"{figure(float(low[i]))} .. {figure(float(high[i]))}",
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
    for found in result.findings[:_FINDINGS_SHOWN]:
        finding(found.message)
    if len(result.findings) > _FINDINGS_SHOWN:
        finding(f"{len(result.findings) - _FINDINGS_SHOWN} more of these are in the JSON")
    for path in written:
        say(f"wrote {path}")
