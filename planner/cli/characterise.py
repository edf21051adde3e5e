"""planner characterise."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, Quiet

if TYPE_CHECKING:
    from planner.materials.characterise import MaterialCharacteristics, Spread

__all__ = [
    "ColumnNames",
    "GaugeMm",
    "MaterialName",
    "SpecimensFile",
    "TensileFiles",
    "ThicknessMm",
    "WidthMm",
    "characterise",
]

TensileFiles = Annotated[
    list[Path],
    typer.Argument(
        help="Tensile files (CSV, Mark-10 MESURgauge, Instron Bluehill), or folders of them; a "
        "specimens.csv among or beside them is used."
    ),
]
SpecimensFile = Annotated[
    Path | None, typer.Option("--specimens", help="List of specimens: material, size, file.")
]
MaterialName = Annotated[
    str | None, typer.Option("--material", help="What all specimens without a row are made of.")
]
WidthMm = Annotated[
    float | None, typer.Option("--width-mm", help="Width of specimens without a row.")
]
ThicknessMm = Annotated[
    float | None, typer.Option("--thickness-mm", help="Thickness of specimens without a row.")
]
GaugeMm = Annotated[
    float | None, typer.Option("--gauge-mm", help="Gauge length of specimens without a row.")
]
ColumnNames = Annotated[
    str | None,
    typer.Option(
        "--columns",
        help="Headings in place of the files' own, by position: 'stretch,stress_MPa', '-' leaves "
        "a column out.",
    ),
]


def characterise(
    files: TensileFiles,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="CSV file to write, one row a material.")
    ] = None,
    specimens: SpecimensFile = None,
    material: MaterialName = None,
    width_mm: WidthMm = None,
    thickness_mm: ThicknessMm = None,
    gauge_mm: GaugeMm = None,
    columns: ColumnNames = None,
    at_strain: Annotated[
        list[float] | None,
        typer.Option("--at-strain", help="Strain of a secant modulus; repeatable."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Take modulus, toughness, elongation and their spread from tensile tests.

    Says whether each material deforms elastically (fit a law) or plastically (Young's modulus
    alone). Exit code 1 when a material's specimens disagree about that.

    Example: [bold]planner characterise tests/*.csv --width-mm 3 --thickness-mm 2 --gauge-mm 15 -o
    materials.csv[/bold]
    """
    from planner.cli.output import finding, print_document, say, warn
    from planner.materials.characterise import SECANT_STRAINS, characterise_material
    from planner.measurement.characteristics_table import (
        characteristics_document,
        write_characteristics,
    )
    from planner.measurement.study import read_study

    study = read_study(
        files,
        specimens=specimens,
        material=material,
        width_mm=width_mm,
        thickness_mm=thickness_mm,
        gauge_mm=gauge_mm,
        columns=None if columns is None else columns.split(","),
    )
    strains = tuple(at_strain) if at_strain else SECANT_STRAINS
    found = [
        characterise_material(name, curves, secant_strains=strains)
        for name, curves in study.groups.items()
    ]
    if output is not None:
        write_characteristics(found, output)
    if as_json:
        print_document(characteristics_document(found, study.notes))
    elif not quiet:
        for note in (*study.notes, *_corrections(found)):
            warn(note)
        _table(found)
        for one in found:
            say(f"{one.material}: {one.deformation.kind}; {one.deformation.reason}")
        if output is not None:
            say(f"wrote {output}")
    split = [one for one in found if not one.agree]
    for one in split if not (as_json or quiet) else ():
        kinds = ", ".join(f"{c.specimen} {c.deformation.kind}" for c in one.specimens)
        finding(f"{one.material}: its specimens disagree on how it deforms: {kinds}")
    return 1 if split else 0


def _corrections(found: "list[MaterialCharacteristics]") -> list[str]:
    """Return the notes on strains: all shifts, and one line for what was left as recorded."""
    specimens = [c for one in found for c in one.specimens]
    lines = [note for c in specimens if c.toe_strain for note in c.notes]
    unshifted = [c for c in specimens if not c.toe_strain]
    if unshifted:
        lines.append(
            f"{len(unshifted)} of {len(specimens)} specimens show no toe; their strains are as "
            "recorded (--json says why for each)"
        )
    return lines


def _table(found: "list[MaterialCharacteristics]") -> None:
    from planner.cli.output import figure, print_table

    def value(one: "MaterialCharacteristics", name: str) -> str:
        spread: Spread | None = one.spreads.get(name)
        if spread is None:
            return "-"
        cv = "" if spread.cv is None else f" ±{100 * spread.cv:.1f} %"
        return figure(spread.mean) + cv

    secants = list(
        dict.fromkeys(name for one in found for name in one.spreads if name.startswith("secant"))
    )
    names = {
        "modulus_MPa": "E MPa",
        "modulus_uncompensated_MPa": "uncompensated",
        **{name: f"at {name.split('_')[1]}" for name in secants},
        "toughness_MJ_m3": "toughness MJ/m3",
        "elongation_at_break": "strain at break",
    }
    print_table(
        ["material", "n", *names.values(), "deforms"],
        [
            [
                one.material,
                str(one.n),
                *(value(one, name) for name in names),
                one.deformation.kind + "ally",
            ]
            for one in found
        ],
        title="Young's and secant moduli (MPa), mean ± coefficient of variation over specimens",
        right=["n", *names.values()],
    )
