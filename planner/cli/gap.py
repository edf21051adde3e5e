"""planner gap diagnose, design, simulate and correct."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from planner.cli.output import AsJson, PaletteName, PrinterName, Quiet, choose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from planner.gap.campaign import Campaign
    from planner.gap.correct import Correction
    from planner.gap.design import CampaignDesign, Expected
    from planner.gap.diagnosis import Diagnosis
    from planner.palette import Palette, Reference

__all__ = ["app", "correct", "design", "diagnose", "simulate"]


# ------------------------------------------------------------------------------------------------
# planner gap correct.


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
    from planner.formats.files import check_absent
    from planner.gap.correct import corrected_palette
    from planner.gap.diagnosis import read_diagnosis
    from planner.palette import Reference, write_palette

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
        print_document(_correct_document(result, output))
    elif not quiet:
        _correct_report(result, chosen, doubt, output)
    return 0 if result.corrected and not result.left else 1


def _palette(found: "Diagnosis", printer: str, name: str | None) -> "tuple[Palette, str]":
    """Return the palette, and a doubt whether it is the one that was diagnosed."""
    from planner.cli.output import choose
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


def _correct_document(result: "Correction", output: Path) -> "dict[str, object]":
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


def _correct_report(result: "Correction", before: "Palette", doubt: str, output: Path) -> None:
    from planner.cli.output import finding, format_number, print_table, say, warn
    from planner.materials.laws import make_law, secant_modulus_MPa

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
            [old.id, format_number(was), format_number(now), f"{now / was:.3f}",
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


# ------------------------------------------------------------------------------------------------
# planner gap design.


def design(
    effects: Annotated[
        str, typer.Option("--effects", help="Ids with commas between: rate,moisture,temperature.")
    ],
    budget: Annotated[int, typer.Option("--budget", help="Specimens at most, of both batches.")],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="Folder to write, a campaign to be measured; or a file .csv."
        ),
    ],
    printer: PrinterName = "connex3",
    palette: PaletteName = None,
    width_mm: Annotated[
        float, typer.Option("--width-mm", help="Of the usual specimen's section.")
    ] = 6.0,
    thickness_mm: Annotated[float, typer.Option("--thickness-mm", help="Likewise.")] = 3.0,
    gauge_mm: Annotated[float, typer.Option("--gauge-mm", help="Of the usual specimen.")] = 25.0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Choose the specimens that tell effects apart, and say how sure the diagnosis will be.

    Exit code 1 when two of the effects would stay alike, or one would more likely be missed than
    named at the middle of its range: the design is written all the same.

    Example: [bold]planner gap design --effects rate,moisture --budget 30 -o plan[/bold]
    """
    from planner.cli.output import print_document, progress
    from planner.gap.design import SpecimenSize, design_campaign

    listed = output.suffix.casefold() == ".csv"
    asked = [id.strip() for id in effects.split(",") if id.strip()]
    _check_target(output, asked, listed=listed)
    machine, chosen = choose(printer, palette)
    with progress(not (quiet or as_json)) as stage:
        made = design_campaign(
            chosen,
            asked,
            budget,
            printer=machine.name,
            size=SpecimenSize(width_mm, thickness_mm, gauge_mm),
            progress=stage,
        )
    _write(made, output, listed=listed)
    if as_json:
        print_document(_design_document(made, output))
    elif not quiet:
        _design_report(made, output, listed=listed)
    return 0 if all(_well(e) for e in made.expected) else 1


def _well(expected: "Expected") -> bool:
    return not expected.alike and expected.probability >= 0.5


def _check_target(output: Path, asked: "Sequence[str]", *, listed: bool) -> None:
    """Make sure that the result can be written, before it is worked out."""
    from planner.errors import ArgumentError, OutputError
    from planner.formats.files import check_target
    from planner.gap.design import may_take_bars

    if not listed:
        check_target(output, kind=None)
    elif output.exists():
        raise OutputError(f"{output}: exists already; name another file with --output")
    elif not output.parent.is_dir():
        raise OutputError(f"{output}: there is no folder {output.parent}; create that first")
    elif may_take_bars(asked):
        raise ArgumentError(
            f"{output}: these effects may take graded bars, whose designs are files of their own; "
            "name a folder with --output"
        )


def _write(made: "CampaignDesign", output: Path, *, listed: bool) -> None:
    from planner.formats.files import write_whole
    from planner.gap.campaign_folder import specimens_csv, write_campaign

    if listed:
        write_whole(output, specimens_csv(made.campaign))
    else:
        write_campaign(made.campaign, output, measured=False)


def _design_document(made: "CampaignDesign", output: Path) -> "dict[str, object]":
    return {
        "schema": 1,
        "written": output.name,
        "specimens": len(made.campaign.specimens),
        "conditions": made.conditions,
        "least": made.least,
        "left_over": made.left_over,
        "needs_strain_fields": made.needs_camera,
        "notes": made.campaign.notes,
        "expected": [
            {
                "effect": e.id,
                "parameter": e.parameter,
                "unit": e.unit,
                "smallest": None if e.smallest is None else float(f"{e.smallest:.3g}"),
                "usual": float(f"{e.usual:.3g}"),
                "probability": round(e.probability, 3),
                "alike": list(e.alike),
                "alike_others": list(e.others),
            }
            for e in made.expected
        ],
    }


def _design_report(made: "CampaignDesign", output: Path, *, listed: bool) -> None:
    from planner.cli.output import finding, format_number, print_table, say, warn

    rows = []
    for e in made.expected:
        unit = "" if e.unit == "1" else f" {e.unit}"
        smallest = "none" if e.smallest is None else f"{format_number(e.smallest)}{unit}"
        rows.append(
            [e.id, e.parameter, smallest, f"{format_number(e.usual)}{unit}",
             f"{100 * min(e.probability, 0.99):.0f} %"]
        )  # fmt: skip
    count = len(made.campaign.specimens)
    print_table(
        ["effect", "size", "smallest named", "middle of its range", "named at the middle"],
        rows,
        title=f"{count} specimens, {made.conditions} conditions: what a diagnosis is to name",
        right=["smallest named", "middle of its range", "named at the middle"],
    )
    for e in made.expected:
        if e.alike:
            finding(f"{e.id} and {', '.join(e.alike)} stay alike: they will be named as one class")
        elif e.probability < 0.5:
            finding(
                f"{e.id} will more likely be missed than named; raise the budget, or check it "
                "by other means"
            )
        if e.others:
            warn(
                f"{e.id} stays like {', '.join(e.others)}; add to --effects what you cannot rule "
                "out otherwise"
            )
    if made.left_over:
        warn(f"{made.left_over} of the budget left over: conditions are printed once a batch")
    if made.needs_camera:
        warn("the bars' strains along their axis are counted on: write them to fields.csv")
    say(made.campaign.notes)
    if listed:
        say(f"wrote {output} (to practise: planner gap simulate --design {output} -o practice)")
        return
    say(f"wrote {output} (next: measure, fill curves.csv, planner gap diagnose {output})")


# ------------------------------------------------------------------------------------------------
# planner gap diagnose.


def diagnose(
    campaign: Annotated[
        Path, typer.Argument(help="Folder with campaign.toml, specimens.csv and the curves.")
    ],
    palette: Annotated[
        str | None,
        typer.Option(
            "--palette",
            help="Palette file (TOML), or one of the printer's palettes, in place of the "
            "campaign's own.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder to write: report.html, JSON, CSV, figures."),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", help="Effect to leave out of the library; repeatable."),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Of resampling: same seed, same diagnosis.")
    ] = 0,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a folder that an earlier diagnosis wrote.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Say where measurements differ from the palette, which effect causes it, how far it closes.

    Exit code 1 when there is a gap to explain, or one remains after the effect.

    Example: [bold]planner gap diagnose campaign -o diagnosis[/bold]
    """
    from planner.cli.output import progress
    from planner.formats.files import check_target
    from planner.gap.diagnose import diagnose as diagnosis_of
    from planner.report.gap_page import DIAGNOSIS, write_diagnosis

    if output is not None:
        check_target(output, force=force, kind=DIAGNOSIS)
    measured = _read(campaign, palette)
    with progress(not (quiet or as_json)) as stage:
        found = diagnosis_of(
            measured,
            seed=seed,
            without=tuple(without or ()),
            progress=lambda done, total, what: stage(f"{what}, {done} of {total}"),
        )
        if output is not None:
            stage("writing the files")
            write_diagnosis(found, output, force=force)
    _diagnose_report(found, output, as_json=as_json, quiet=quiet)
    return 0 if found.ok else 1


def _read(folder: Path, palette: str | None) -> "Campaign":
    from planner.gap.campaign_folder import read_campaign, read_campaign_file
    from planner.palette import load_palette
    from planner.printers import printer

    if palette is None:
        return read_campaign(folder)
    if palette.endswith(".toml") or Path(palette).is_file():
        return read_campaign(folder, load_palette(palette))
    machine = printer(read_campaign_file(folder).printer)
    return read_campaign(folder, machine.palette(palette))


def _diagnose_report(
    diagnosis: "Diagnosis", output: Path | None, *, as_json: bool, quiet: bool
) -> None:
    from planner.cli.output import print_document, say, say_verdict, terminal_width
    from planner.report.gap_text import verdict_text

    if as_json:
        print_document(diagnosis.json())
        return
    if quiet:
        return
    say_verdict(verdict_text(diagnosis, width=terminal_width()))
    say()
    if output is None:
        say("nothing was written (for a report with figures: --output FOLDER)")
    else:
        say(f"wrote {output} (next: open {output / 'report.html'})")


# ------------------------------------------------------------------------------------------------
# planner gap simulate.


def simulate(
    design: Annotated[
        Path,
        typer.Option(
            "--design", help="Which specimens: a specimens.csv, or the folder of a campaign."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")],
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            help="ID:NAME=VALUE,..., as in rate:rise=0.12,form=power-law; repeatable; what is not "
            "given is at the middle of its range.",
        ),
    ] = None,
    scatter: Annotated[
        float, typer.Option("--scatter", help="From specimen to specimen, of ln force.")
    ] = 0.03,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Same seed, same bytes.")] = 1,
    camera: Annotated[
        bool, typer.Option("--camera", help="See the strain along planned bars, too.")
    ] = False,
    printer: PrinterName = "connex3",
    palette: PaletteName = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Make a campaign with stated effects by planner's own model, to teach or to practise.

    It says of itself that it is simulated; it is no evidence of what the diagnosis can do with
    measurements. A campaign's own palette counts, not that of the options.

    Example: [bold]planner gap simulate --design plan --effect rate:rise=0.12 -o made[/bold]
    """
    import numpy as np

    from planner.cli.output import print_document, say, warn
    from planner.formats.files import check_target
    from planner.gap.campaign_folder import write_campaign
    from planner.gap.virtual import read_design, stated_effect, synthetic_campaign

    check_target(output, kind=None)
    machine, chosen = choose(printer, palette)
    plan = read_design(design, chosen, printer=machine.name, camera=camera)
    effects = [stated_effect(text, plan.palette) for text in effect or ()]
    rng = np.random.default_rng(seed)
    made = synthetic_campaign(plan, effects, rng, scatter=scatter, seed_text=f"seed {seed}")
    write_campaign(made, output)
    if as_json:
        print_document(
            {
                "schema": 1,
                "simulated": made.notes,
                "effects": [e.text for e in effects],
                "specimens": len(made.specimens),
                "folder": output.name,
            }
        )
    elif not quiet:
        for note in plan.remarks:
            warn(note)
        say(made.notes)
        say(f"wrote {output} (next: planner gap diagnose {output})")
    return 0


# ------------------------------------------------------------------------------------------------
# planner gap: its commands, each imported from a file of its own.


app = typer.Typer(name="gap", rich_markup_mode="rich", invoke_without_command=True)


@app.callback()
def gap(context: typer.Context) -> None:
    """Diagnose why printed parts differ from what the palette predicts.

    Example: [bold]planner gap diagnose campaign -o diagnosis[/bold]
    """
    if context.invoked_subcommand is None:
        from planner.cli.output import say

        say(context.get_help())


app.command()(diagnose)
app.command()(correct)
app.command()(design)
app.command()(simulate)
