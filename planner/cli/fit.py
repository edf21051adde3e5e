"""planner fit."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.characterise import (
    ColumnNames,
    GaugeMm,
    MaterialName,
    SpecimensFile,
    TensileFiles,
    ThicknessMm,
    WidthMm,
)
from planner.cli.options import AsJson, Quiet

if TYPE_CHECKING:
    from planner.measurement.palette_study import PaletteStudy

__all__ = ["fit"]


def fit(
    files: TensileFiles,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Palette file (TOML) to write.")
    ] = Path("palette.toml"),
    law: Annotated[
        str,
        typer.Option(
            "--law", help="ogden, yeoh, martins, neo-hookean, or all: the best is chosen."
        ),
    ] = "all",
    name: Annotated[
        str | None, typer.Option("--name", help="Name of the palette; else that of the file.")
    ] = None,
    weighting: Annotated[
        str,
        typer.Option("--weighting", help="Residuals relative to the stress, or absolute."),
    ] = "relative",
    coordinate: Annotated[
        list[str] | None,
        typer.Option("--coordinate", help="ID=M, repeatable; else 0..1 in order of stiffness."),
    ] = None,
    density: Annotated[
        list[str] | None, typer.Option("--density", help="ID=G_CM3, repeatable.")
    ] = None,
    starts: Annotated[
        int, typer.Option("--starts", min=1, max=2000, help="Starts of each search.")
    ] = 50,
    level: Annotated[
        float, typer.Option("--level", min=0.5, max=0.999, help="Coverage of the intervals.")
    ] = 0.95,
    specimens: SpecimensFile = None,
    material: MaterialName = None,
    width_mm: WidthMm = None,
    thickness_mm: ThicknessMm = None,
    gauge_mm: GaugeMm = None,
    columns: ColumnNames = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the palette file.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Fit laws to tensile tests, choose one a material, and write a palette with intervals.

    Exit code 1 when the palette cannot be planned with as it is: its laws cross.

    Example: [bold]planner fit samples/tensile --law all -o lab.toml[/bold]
    """
    from planner.cli.output import finding, print_document, progress, warn
    from planner.errors import OutputError
    from planner.formats.palette_toml import write_palette
    from planner.materials.fit.sample import weighting_of
    from planner.measurement.palette_study import fit_study
    from planner.measurement.study import read_study

    if output.exists() and not force:
        raise OutputError(
            f"{output}: exists already; replace it with --force, or name another with --output"
        )
    study = read_study(
        files,
        specimens=specimens,
        material=material,
        width_mm=width_mm,
        thickness_mm=thickness_mm,
        gauge_mm=gauge_mm,
        columns=None if columns is None else [name.strip() for name in columns.split(",")],
    )
    with progress(not (quiet or as_json)) as stage:
        result = fit_study(
            study,
            name=name or output.stem,
            law=law,
            weighting=weighting_of(weighting),
            starts=starts,
            level=level,
            coordinates=_figures(coordinate, "--coordinate"),
            densities_g_cm3=_figures(density, "--density"),
            stage=stage,
        )
    write_palette(result.palette, output, force=force)
    if as_json:
        print_document({**result.document(), "file": str(output)})
    elif not quiet:
        for note in result.notes:
            warn(note)
        _print_report(result, output)
    if result.problem is not None:
        if not (as_json or quiet):
            finding(f"{result.problem}; planner grade will refuse this palette")
        return 1
    return 0


def _figures(given: Sequence[str] | None, option: str) -> dict[str, float]:
    """Read repeated ID=NUMBER options."""
    from planner.errors import ArgumentError

    figures = {}
    for text in given or ():
        key, _, value = text.rpartition("=")
        try:
            figures[key.strip()] = float(value)
        except ValueError:
            key = ""
        if not key.strip():
            raise ArgumentError(f"{option} {text!r}: write ID=NUMBER, as FLX9760=0.5")
    return figures


def _print_report(result: "PaletteStudy", output: Path) -> None:
    from planner.cli.output import figure, print_table, say

    rows = []
    for material in result.palette.materials:
        fit = result.fits[material.id]
        name = material.id
        if fit.choice is None:
            modulus = fit.law.parameters["modulus_MPa"][0]
            low, high = (
                ends["modulus_MPa"][0]
                for ends in (fit.uncertainty.law_low, fit.uncertainty.law_high)
            )
            law = f"* linear ({figure(modulus)} MPa, {figure(low)} .. {figure(high)})"
            rows.append([name, str(fit.characteristics.n), law, "1", *[""] * 6])
            continue
        for candidate in fit.choice.candidates:
            one, convergence = candidate.fit, candidate.fit.convergence
            unstable = candidate.stability.strain
            rows.append(
                [
                    name,
                    str(fit.characteristics.n),
                    f"{'*' if candidate is fit.choice.chosen else ' '} {one.name}",
                    str(one.parameter_count),
                    f"{100 * candidate.held_out_error:.2f} %",
                    f"{one.r2:.5f}",
                    f"{one.adjusted_r2:.5f}",
                    f"{100 * one.nrmse:.2f} %",
                    "yes" if unstable is None else f"falls at {figure(unstable, 2)}",
                    f"{convergence.agreeing}/{convergence.starts}",
                ]
            )
            name = ""
    columns = [
        "material",
        "n",
        "law",
        "k",
        "held out",
        "R2",
        "adj. R2",
        "nRMSE",
        "stable",
        "starts",
    ]
    print_table(columns, rows, title="Laws tried (* chosen)", right=["n", "k", "held out", "nRMSE"])
    chosen = []
    for material in result.palette.materials:
        fit = result.fits[material.id]
        name = material.id
        for symbol, values in material.law.parameters.items():
            ends = zip(
                fit.uncertainty.law_low[symbol], fit.uncertainty.law_high[symbol], strict=True
            )
            for number, (value, (low, high)) in enumerate(zip(values, ends, strict=True), start=1):
                label = symbol if len(values) == 1 else f"{symbol} [{number}]"
                interval = f"{figure(low)} .. {figure(high)}"
                spread = f"{100 * material.modulus_log_sd:.1f} %" if name else ""
                law = material.law.model if name else ""
                chosen.append([name, law, label, figure(value, 4), interval, spread])
                name = ""
    percent = f"{100 * result.fits[result.palette.materials[0].id].uncertainty.level:g} % interval"
    print_table(
        ["material", "law", "parameter", "value", percent, "next print's sd"],
        chosen,
        title="Parameters",
        right=["value", "next print's sd"],
    )
    say(f"palette {result.palette.name} written to {output}")
