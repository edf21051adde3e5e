"""planner fit."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, Quiet
from planner.cli.tensile_options import (
    ColumnNames,
    Force,
    GaugeMm,
    MaterialName,
    SpecimensFile,
    TensileFiles,
    ThicknessMm,
    WidthMm,
    refuse_existing,
    split_columns,
)

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
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Fit laws to tensile tests, choose one a material, and write a palette with intervals.

    Exit code 1 when the palette cannot be used as it is, because its laws cross, when replicates
    are more than twice apart, or when a law describes its material badly.

    Example: [bold]planner fit samples/tensile --law all -o lab.toml[/bold]
    """
    from planner.cli.output import finding, print_document, progress, warn
    from planner.formats.json_document import encode_document
    from planner.formats.palette_toml import write_palette
    from planner.materials.fit.sample import weighting_of
    from planner.measurement.palette_study import fit_study
    from planner.measurement.study import read_study

    refuse_existing(output, force=force)
    study = read_study(
        files,
        specimens=specimens,
        material=material,
        width_mm=width_mm,
        thickness_mm=thickness_mm,
        gauge_mm=gauge_mm,
        columns=split_columns(columns),
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
    findings = list(result.findings)
    if result.problem is not None:
        findings.append(
            f"{result.problem}; planner cannot grade, invert or list materials with this palette"
        )
    if as_json:
        print_document(encode_document({**result.document(), "file": str(output)}))
    elif not quiet:
        for note in result.notes:
            warn(note)
        _print_report(result, output)
        for said in findings:
            finding(said)
    return 1 if findings else 0


def _figures(given: Sequence[str] | None, option: str) -> dict[str, float]:
    """Read repeated ID=NUMBER options."""
    from planner.errors import ArgumentError

    figures = {}
    for text in given or ():
        key, _, value = text.rpartition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not key.strip() or not math.isfinite(number):
            raise ArgumentError(f"{option} {text!r}: write ID=NUMBER, as FLX9760=0.5")
        figures[key.strip()] = number
    return figures


def _print_report(result: "PaletteStudy", output: Path) -> None:
    from planner.cli.output import say

    _print_candidates(result)
    _print_parameters(result)
    for material in result.palette.materials:
        fit = result.fits[material.id]
        reason = fit.characteristics.deformation.reason if fit.choice is None else fit.choice.reason
        say(f"{material.id}: {reason}")
        say(f"  intervals: {fit.uncertainty.basis}")
    say(f"palette {result.palette.name} written to {output}")


def _print_candidates(result: "PaletteStudy") -> None:
    from planner.cli.output import figure, print_table

    rows = []
    for material in result.palette.materials:
        fit = result.fits[material.id]
        name = material.id
        candidates = () if fit.choice is None else fit.choice.candidates
        for candidate in candidates:
            one, convergence = candidate.fit, candidate.fit.convergence
            unstable = candidate.stability.strain
            rows.append(
                [
                    name,
                    str(fit.characteristics.n) if name else "",
                    f"{'*' if candidate.fit.parameters is fit.law else ' '} {one.name}",
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
    if not rows:
        return
    figures = ["held out", "R2", "adj. R2", "nRMSE"]
    print_table(
        ["material", "n", "law", "k", *figures, "stable", "starts"],
        rows,
        title="Laws tried (* chosen)",
        right=["n", "k", *figures, "starts"],
    )


def _print_parameters(result: "PaletteStudy") -> None:
    from planner.cli.output import figure, print_table

    rows = []
    for material in result.palette.materials:
        known = result.fits[material.id].uncertainty
        name, law = material.id, material.law.model
        spread = f"{100 * material.modulus_log_sd:.1f} %"
        for symbol, values in material.law.parameters.items():
            ends = zip(known.law_low[symbol], known.law_high[symbol], strict=True)
            for number, (value, (low, high)) in enumerate(zip(values, ends, strict=True), start=1):
                label = symbol if len(values) == 1 else f"{symbol} [{number}]"
                rows.append([name, law, label, figure(value, 4), _interval(low, high), spread])
                name = law = spread = ""
    level = result.fits[result.palette.materials[0].id].uncertainty.level
    print_table(
        ["material", "law", "parameter", "value", f"{100 * level:g} % interval", "next print's sd"],
        rows,
        title="Parameters",
        right=["value", "next print's sd"],
    )


def _interval(low: float, high: float) -> str:
    """Write an interval with as many digits as tell its ends apart; an open end is said so."""
    from planner.cli.output import figure

    texts: list[str] = []
    for digits in (3, 4, 5, 6):
        texts = [figure(v, digits) if math.isfinite(v) else "open" for v in (low, high)]
        if texts[0] != texts[1]:
            break
    return " .. ".join(texts)
