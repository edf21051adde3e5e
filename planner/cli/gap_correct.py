"""planner gap correct."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from planner.cli.options import AsJson, PaletteName, PrinterName, Quiet

if TYPE_CHECKING:
    from planner.gap.correction import Correction
    from planner.gap.diagnosis import Diagnosis
    from planner.palette import Palette, Reference

__all__ = ["correct"]


def correct(
    diagnosis: Annotated[
        Path, typer.Argument(help="A diagnosis.json, or the folder that holds it.")
    ],
    palette: PaletteName = None,
    temperature_C: Annotated[
        float | None, typer.Option("--temperature-C", help="Of use; else the palette's own.")
    ] = None,
    rate_per_s: Annotated[
        float | None, typer.Option("--rate-per-s", help="Strain rate of use, likewise.")
    ] = None,
    soak_h: Annotated[
        float | None, typer.Option("--soak-h", help="Hours in water before use, likewise.")
    ] = None,
    age_days: Annotated[
        float | None, typer.Option("--age-days", help="Days since the print, likewise.")
    ] = None,
    orientation: Annotated[
        str | None, typer.Option("--orientation", help="Of the load on the tray: x, y or z.")
    ] = None,
    width_mm: Annotated[
        float, typer.Option("--width-mm", help="Of the part's section, for water and advice.")
    ] = 6.0,
    thickness_mm: Annotated[
        float, typer.Option("--thickness-mm", help="Of the part's section, likewise.")
    ] = 3.0,
    recalibrate: Annotated[
        bool,
        typer.Option(
            "--recalibrate", help="Shift every law to the level that the campaign asks for, too."
        ),
    ] = False,
    printer: PrinterName = "connex3",
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Palette file (TOML) to write.")
    ] = Path("palette-corrected.toml"),
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Write a palette for the conditions of use, corrected for what a diagnosis has found.

    Exit code 1 when there is nothing that a palette can be corrected for (nothing is written), or
    the verdict has an effect that no palette can hold beside one that it can.

    Example: [bold]planner gap correct diagnosis --temperature-C 33 -o warm.toml[/bold]
    """
    from planner.cli.output import print_document
    from planner.errors import ArgumentError
    from planner.formats.palette_toml import write_palette
    from planner.formats.whole_file import check_absent
    from planner.gap.correction import corrected_palette
    from planner.gap.diagnosis_json import read_diagnosis
    from planner.palette import Reference

    if orientation not in (None, "x", "y", "z"):
        raise ArgumentError(f"--orientation {orientation}: it must be x, y or z")
    along = cast("Literal['x', 'y', 'z'] | None", orientation)
    check_absent(output, force=force)
    found = read_diagnosis(diagnosis)
    chosen, doubt = _palette(found, printer, palette)
    conditions = Reference(rate_per_s, temperature_C, soak_h, age_days, along)
    result = corrected_palette(
        chosen,
        found,
        conditions,
        recalibrate=recalibrate,
        width_mm=width_mm,
        thickness_mm=thickness_mm,
    )
    if result.corrected:
        write_palette(result.palette, output, force=force)
    if as_json:
        print_document(_document(result, output))
    elif not quiet:
        _report(result, chosen, doubt, output)
    return 0 if result.corrected and not result.left else 1


def _palette(found: "Diagnosis", printer: str, name: str | None) -> "tuple[Palette, str]":
    """Return the palette, and a doubt whether it is the one that was diagnosed."""
    from planner.cli.options import choose
    from planner.errors import PlannerError, UnknownNameError

    if name is None:
        try:
            chosen: Palette | None = choose(printer, found.palette)[1]
        except PlannerError:
            chosen = None
        if chosen is None or found.palette_sha256 not in ("", chosen.sha256):
            has = "does not bring" if chosen is None else "brings with other bytes"
            raise UnknownNameError(
                f"the diagnosis is of a palette {found.palette} that printer {printer} {has}; give "
                "its file, the campaign's palette.toml, with --palette"
            )
        return chosen, ""
    chosen = choose(printer, name)[1]
    if found.palette_sha256 in ("", chosen.sha256):
        return chosen, ""
    return chosen, (
        f"palette {chosen.name} is not, byte for byte, the one that was diagnosed; if it has "
        "other laws, the correction is wrong: give the campaign's own with --palette"
    )


def _document(result: "Correction", output: Path) -> "dict[str, object]":
    return {
        "schema": 1,
        "file": output.name if result.corrected else None,
        "corrected": list(result.corrected),
        "left": list(result.left),
        "conditions": _conditions(result.palette.reference) if result.corrected else None,
        "materials": {
            m: {"stress_factor": float(f"{f:.6g}"), "misfit": float(f"{result.misfit[m]:.3g}")}
            for m, f in result.factor.items()
        },
        "notes": list(result.notes),
    }


def _conditions(at: "Reference") -> "dict[str, object]":
    return {
        "strain_rate_per_s": at.strain_rate_per_s,
        "temperature_C": at.temperature_C,
        "soak_h": at.soak_h,
        "age_days": at.age_days,
        "orientation": at.orientation,
    }


def _report(result: "Correction", before: "Palette", doubt: str, output: Path) -> None:
    from planner.cli.output import figure, finding, print_table, say, warn
    from planner.materials.laws import make_law
    from planner.materials.stiffness import secant_modulus_MPa

    if doubt:
        warn(doubt)
    for note in result.notes:
        (finding if note.split(":")[0] in result.left else warn)(note)
    if not result.corrected:
        say("there is nothing to correct the palette for; nothing was written")
        return
    rows = []
    for old, new in zip(before.materials, result.palette.materials, strict=True):
        at = min(0.1, 0.5 * old.elongation_at_break)
        was, now = (float(secant_modulus_MPa(make_law(m.law), at)) for m in (old, new))
        rows.append(
            [old.id, figure(was), figure(now), f"{now / was:.3f}",
             f"{100 * result.misfit[old.id]:.2f} %"]
        )  # fmt: skip
    print_table(
        ["material", "before MPa", "after MPa", "factor", "misfit"],
        rows,
        title=f"Corrected for {' and '.join(result.corrected)}: secant modulus at strain 0.1 "
        "(half the break of rigid grades)",
        right=["before MPa", "after MPa", "factor", "misfit"],
    )
    say(f"wrote {output} (next: planner grade PART --palette {output})")
