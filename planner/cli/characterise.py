"""planner characterise."""

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
    from planner.materials.characterise import MaterialCharacteristics, Spread

__all__ = ["characterise"]


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
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Take modulus, toughness, elongation and their spread from tensile tests.

    Says whether each material deforms elastically (fit a law) or plastically (Young's modulus
    alone). Exit code 1 when a material's specimens disagree about that or are more than twice
    apart, or a figure looks like a wrong unit.

    Example: [bold]planner characterise tests/*.csv --width-mm 3 --thickness-mm 2 --gauge-mm 15 -o
    materials.csv[/bold]
    """
    from planner.cli.output import finding, print_document, say, warn
    from planner.formats.json_document import encode_document
    from planner.materials.characterise import SECANT_STRAINS, characterise_material
    from planner.materials.doubts import doubts
    from planner.measurement.characteristics_table import (
        characteristics_document,
        write_characteristics,
    )
    from planner.measurement.study import read_study

    if output is not None:
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
    strains = tuple(at_strain) if at_strain else SECANT_STRAINS
    found = [
        characterise_material(name, curves, secant_strains=strains)
        for name, curves in study.groups.items()
    ]
    if output is not None:
        write_characteristics(found, output, force=force)
    doubtful = [said for one in found for said in doubts(one)]
    if as_json:
        document = characteristics_document(found, study.notes)
        print_document(encode_document({**document, "findings": doubtful}))
    elif not quiet:
        for note in (*study.notes, *_corrections(found)):
            warn(note)
        _tables(found)
        for one in found:
            say(f"{one.material}: {one.deformation.kind}; {one.deformation.reason}")
        if output is not None:
            say(f"wrote {output}")
        for said in doubtful:
            finding(said)
    return 1 if doubtful else 0


def _corrections(found: "list[MaterialCharacteristics]") -> list[str]:
    """Return the notes on single specimens, and one line for strains left as recorded."""
    specimens = [c for one in found for c in one.specimens]
    lines = [note for c in specimens for note in c.notes if "not shifted" not in note]
    unshifted = [c for c in specimens if not c.toe_strain]
    if unshifted:
        lines.append(
            f"{len(unshifted)} of {len(specimens)} specimens show no toe; their strains are as "
            "recorded (--json says why for each)"
        )
    return lines


def _tables(found: "list[MaterialCharacteristics]") -> None:
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
    moduli = {"modulus_MPa": "E"}
    if any(c.toe_strain for one in found for c in one.specimens):
        moduli["modulus_uncompensated_MPa"] = "with toe"
    moduli |= {name: f"at {name.split('_')[1]}" for name in secants}
    breaks = {
        "strength_MPa": "strength MPa",
        "elongation_at_break": "strain at break",
        "toughness_MJ_m3": "toughness MJ/m3",
    }
    for title, names in (
        ("Young's and secant moduli (MPa), mean ± coefficient of variation over specimens", moduli),
        ("Break", breaks),
    ):
        kind = names is breaks
        print_table(
            ["material", "n", *names.values(), *(["deforms"] if kind else [])],
            [
                [
                    one.material,
                    str(one.n),
                    *(value(one, name) for name in names),
                    *([one.deformation.kind + "ally"] if kind else []),
                ]
                for one in found
            ],
            title=title,
            right=["n", *names.values()],
        )
