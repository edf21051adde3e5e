"""planner gap diagnose, design, next, simulate and correct."""

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer
from typer import Option

import planner
from planner.cli import output as cli
from planner.glance import format_number, format_range

app = typer.Typer(name="gap", rich_markup_mode="rich", invoke_without_command=True)


@app.callback()
def _gap(context: typer.Context) -> None:
    """Diagnose why printed parts differ from what the palette predicts.

    Example: [bold]planner gap diagnose campaign -o diagnosis[/bold]
    """
    if context.invoked_subcommand is None:
        cli.say(context.get_help())


# ------------------------------------------------------------------------------------------------
# planner gap diagnose.


@cli.command(app)
def diagnose(
    campaign: Path,
    palette: str | None = None,
    output: cli.Output = None,
    without: list[str] | None = None,
    unit_of: list[str] | None = None,
    seed: Annotated[int, Option(min=0, help="Of resampling: same seed, same diagnosis.")] = 0,
    force: bool = False,
) -> int:
    """Say where measurements differ from the palette, what causes it, how far that closes it.

    Exit code 1 when there is a gap to explain, or one remains after the effect.

    Example: [bold]planner gap diagnose campaign -o diagnosis[/bold]

    Parameters
    ----------
    campaign
        Folder with campaign.toml, specimens.csv and the curves.
    palette
        Palette file (TOML), or one of the printer's palettes, in place of the campaign's own.
    output
        Folder to write: report.html, next-specimens.csv, JSON, figures.
    without
        Effect to leave out, as if it were not known; repeatable.
    unit_of
        Read force or travel in another unit than the files say, as in force=lbf:S1,S2 or, for all
        specimens, travel=in; repeatable.
    force
        Replace a folder that an earlier diagnosis wrote.
    """
    from planner.compilation_cache import compile_ahead
    from planner.gap.summary import next_command
    from planner.report.gap_page import verdict_text

    cli.check_targets(force=force, output=(output, "diagnosis.json"))
    compile_ahead("diagnose")
    with cli.progress() as stage:
        found = cli.run(
            planner.diagnose, progress=lambda done, total, what: stage(f"{what}, {done} of {total}")
        )
        if output is not None:
            stage("writing the files")
            planner.write_diagnosis(found, output, force=force)
    if cli.in_words(found.json):
        _say_verdict(verdict_text(found, width=cli.terminal_width()))
        cli.say("")
        if output is None:
            cli.say("nothing was written (for a report with figures: --output FOLDER)")
        else:
            cli.say(f"wrote {output} (next: open {output / 'report.html'})")
        again = _again("connex3", palette, without=without, unit_of=unit_of)
        if command := next_command(found, output, campaign, again):
            cli.say(f"next: {command}")
    return 0 if found.ok else 1


def _say_verdict(text: str) -> None:
    """Write a text of indented paragraphs to stdout, its headings bold where colour is on."""
    from rich.console import Console

    console = Console(highlight=False)
    for line in text.splitlines():
        style = "bold" if line and not line.startswith(" ") else None
        console.print(line, style=style, soft_wrap=True, markup=False)


# ------------------------------------------------------------------------------------------------
# planner gap correct.


@cli.command(app)
def correct(
    diagnosis: Path,
    palette: cli.PaletteName = None,
    temperature_C: Annotated[float | None, "--temperature-C"] = None,
    rate_per_s: float | None = None,
    soak_h: float | None = None,
    age_days: float | None = None,
    orientation: str | None = None,
    width_mm: float = 6.0,
    thickness_mm: float = 3.0,
    recalibrate: bool = False,
    printer: cli.PrinterName = "connex3",
    output: Annotated[Path, "--output", "-o"] = Path("palette-corrected.toml"),
    force: bool = False,
) -> int:
    """Write a palette for the conditions of use, corrected for what a diagnosis has found.

    Exit code 1 when there is nothing that a palette can be corrected for (nothing is written); when
    the verdict has an effect that no palette can hold beside one that it can; or when the use lies
    so far from the tests that they do not tell one grade from the next there.

    Example: [bold]planner gap correct diagnosis --temperature-C 33 -o warm.toml[/bold]

    Parameters
    ----------
    diagnosis
        A diagnosis.json, or the folder that holds it.
    temperature_C
        Of use; else the palette's own.
    rate_per_s
        Strain rate of use, likewise.
    soak_h
        Hours in water before use, likewise.
    age_days
        Days since the print, likewise.
    orientation
        Of the load on the tray: x, y or z.
    width_mm
        Of the part's section, for water and advice.
    thickness_mm
        Of the part's section, likewise.
    recalibrate
        Shift every law to the level that the campaign asks for, too.
    output
        Palette file (TOML) to write.
    force
        Replace a file that is there.
    """
    cli.check_targets(force=force, output=output)
    made = cli.run(planner.correct)
    if made.corrected:
        planner.write_palette(made.palette, output, force=force)
    file = output.name if made.corrected else None
    if cli.in_words(lambda: {"schema": 1, "file": file, **made.document()}):
        _correct_report(made, output, _again(printer))
    return 0 if made.ok else 1


def _correct_report(made: "planner.Correction", output: Path, options: str) -> None:
    for note in made.notes:
        (cli.finding if note in made.findings else cli.warn)(note)
    if not made.corrected:
        cli.say("there is nothing to correct the palette for; nothing was written")
        return
    # As the list of materials and plans have them.
    before, after = (planner.list_materials(palette=p) for p in (made.before, made.palette))
    rows = []
    for n, material in enumerate(made.palette.materials):
        was, now = float(before.moduli_MPa[n]), float(after.moduli_MPa[n])
        moduli = [format_number(was), format_number(now), format_range(after.intervals_MPa[n])]
        misfit = f"{100 * made.misfit[material.id]:.2f} %"
        rows.append([material.id, *moduli, f"{now / was:.3f}", misfit])
    at = f"secant modulus at strain {after.at_strain:g}"
    columns = ["material", ">before MPa", ">after MPa", "95 % interval", ">factor", ">misfit"]
    cli.print_table(columns, rows, title=f"Corrected for {' and '.join(made.corrected)}: {at}")
    command = f"planner grade PART --like OLD_PLAN --palette {quote(str(output))}{options}"
    cli.say(f"wrote {output} (next: {command})")


# ------------------------------------------------------------------------------------------------
# planner gap design.


@cli.command(app)
def design(
    *,
    effects: str,
    budget: int,
    output: Annotated[Path, "--output", "-o"],
    printer: cli.PrinterName = "connex3",
    palette: cli.PaletteName = None,
    width_mm: float = 6.0,
    thickness_mm: float = 3.0,
    gauge_mm: float = 25.0,
) -> int:
    """Choose the specimens that tell effects apart, and say how sure the diagnosis will be.

    Exit code 1 when two of the effects would look the same, or one of middling size would more
    likely be missed than named: the design is written all the same.

    Example: [bold]planner gap design --effects rate,moisture --budget 30 -o plan[/bold]

    Parameters
    ----------
    effects
        Ids with commas between: rate,moisture,temperature.
    budget
        Specimens at most, of both batches.
    output
        Folder to write, a campaign to be measured; or a file .csv.
    width_mm
        Of the specimens' section.
    thickness_mm
        Likewise.
    gauge_mm
        Gauge length of the specimens.
    """
    from planner.errors import ArgumentError
    from planner.gap.campaign_folder import specimens_csv
    from planner.gap.effects import EFFECTS

    listed, asked = output.suffix.casefold() == ".csv", {id.strip() for id in effects.split(",")}
    if listed and any("bars" in EFFECTS[id].changes for id in asked & EFFECTS.keys()):
        raise ArgumentError(
            f"{output}: these effects may take graded bars, whose designs are files of their own; "
            "name a folder with --output"
        )
    cli.check_targets(force=False, output=output if listed else (output, None))
    with cli.progress() as stage:
        made = cli.run(planner.design_campaign, progress=stage)
    if listed:
        cli.write_asked(output, lambda: specimens_csv(made.campaign))
    else:
        planner.write_campaign(made.campaign, output, measured=False)
    if cli.in_words(lambda: {"schema": 1, "written": output.name, **made.document()}):
        _design_report(made, output, printer, palette, listed=listed)
    return 0 if made.ok else 1


def _design_report(
    made: "planner.CampaignDesign", output: Path, printer: str, palette: str | None, *, listed: bool
) -> None:

    rows = []
    for e in made.expected:
        unit = "" if e.size.unit == "1" else f" {e.size.unit}"
        ends = (e.smallest, e.size.usual)
        sizes = ("none" if s is None else format_number(s) + unit for s in ends)
        rows.append([e.id, e.size.name, *sizes, f"{100 * min(e.probability, 0.99):.0f} %"])
    columns = ["effect", "size", ">smallest named", ">middling size", ">chance to name that"]
    of = f"{len(made.campaign.specimens)} specimens, {made.conditions} conditions"
    cli.print_table(columns, rows, title=f"{of}: what a diagnosis is to name")
    for e in made.expected:
        if e.alike:
            cli.finding(
                f"{e.id} and {', '.join(e.alike)} will look the same: they are named together"
            )
        elif e.probability < 0.5:
            cli.finding(
                f"{e.id} will more likely be missed than named; raise the budget, or check it "
                "by other means"
            )
        if e.others:
            cli.warn(
                f"{e.id} will look the same as {', '.join(e.others)}; add to --effects what you "
                "cannot rule out otherwise"
            )
    if made.left_over:
        cli.warn(f"{made.left_over} of the budget left over: conditions are printed once a batch")
    if made.needs_camera:
        cli.warn("the bars' strains along their axis are counted on: write them to fields.csv")
    cli.say(made.campaign.notes)
    if listed:
        again = _again(printer, palette)
        command = f"planner gap simulate --design {quote(str(output))}{again} -o practice"
        cli.say(f"wrote {output} (to practise: {command})")
    else:
        command = f"planner gap next {quote(str(output))}"
        cli.say(f"wrote {output} (next: print, pull, fill curves.csv; {command})")


def _again(printer: str, palette: str | None = None, **lists: list[str] | None) -> str:
    """Return the options that name a printer and a palette which are not the default ones.

    And repeatable ones, by their names here.
    """
    options = [("--printer", "" if printer == "connex3" else printer), ("--palette", palette)]
    options += [(f"--{n.replace('_', '-')}", one) for n, of in lists.items() for one in of or ()]
    return "".join(f" {option} {quote(name)}" for option, name in options if name)


# ------------------------------------------------------------------------------------------------
# planner gap next.


@cli.command(app, "next", switches="as_json")
def next_(campaign: Path) -> int:
    """Say where a campaign or a diagnosis stands, what is missing, which command comes next.

    Example: [bold]planner gap next lab[/bold]

    Parameters
    ----------
    campaign
        Folder with campaign.toml and specimens.csv; or a diagnosis, JSON or folder.
    """
    from planner.gap.campaign import named

    found = planner.campaign_standing(campaign)
    if not cli.in_words(found.document):
        return 0
    if found.listed:
        measured = len(found.listed) - len(found.missing)
        cli.say(f"{found.campaign}: {measured} of {len(found.listed)} specimens have a curve")
    for name, ids in found.unknown.items():
        cli.say(f"{name} is unknown of {named(ids)}: no effect of it is tested there")
    if found.missing:
        cli.say(f"missing: {named(found.missing)}; pull them, and write their curves to curves.csv")
    if found.diagnosis is not None:
        cli.say(f"diagnosed in {found.diagnosis}: {found.verdict}")
    if found.next:
        cli.say(f"next: {found.next}")
    return 0


# ------------------------------------------------------------------------------------------------
# planner gap simulate.


@cli.command(app)
def simulate(
    *,
    design: Path,
    output: Annotated[Path, "--output", "-o"],
    effect: list[str] | None = None,
    scatter: float = 0.03,
    seed: Annotated[int, Option(min=0, help="Same seed, same bytes.")] = 1,
    camera: bool = False,
    printer: cli.PrinterName = "connex3",
    palette: cli.PaletteName = None,
) -> int:
    """Make a campaign with stated effects by planner's own model, to teach or to practise.

    It says of itself that it is simulated; it is no evidence of what the diagnosis can do with
    measurements. A campaign's own palette counts, not that of the options; of its specimens.csv or
    a diagnosis' next-specimens.csv alone, where the options name none.

    Example: [bold]planner gap simulate --design plan --effect rate:rise=0.12 -o made[/bold]

    Parameters
    ----------
    design
        Which specimens: a specimens.csv, or the folder of a campaign.
    output
        Folder to write.
    effect
        ID:NAME=VALUE,..., as in rate:rise=0.12,form=power-law; repeatable; what is not given is in
        the middle of what is physical.
    scatter
        Of force from specimen to specimen, as a share: 0.03 is 3 %.
    camera
        See the strain along planned bars, too.
    """
    from planner.gap.virtual import stated_effect

    cli.check_targets(force=False, output=(output, None))
    made = cli.run(planner.synthesise_campaign)
    planner.write_campaign(made, output)
    effects = [stated_effect(text, made.palette).text for text in effect or ()]
    said = {"schema": 1, "simulated": made.notes, "effects": effects}
    said |= {"specimens": len(made.specimens), "folder": output.name}
    if cli.in_words(lambda: said):
        cli.warn(*made.remarks)
        cli.say(made.notes)
        cli.say(f"wrote {output} (next: planner gap diagnose {quote(str(output))})")
    return 0
