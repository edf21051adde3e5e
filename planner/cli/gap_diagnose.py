"""planner gap diagnose."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, Quiet

if TYPE_CHECKING:
    from planner.gap.campaign import Campaign
    from planner.gap.diagnosis import Diagnosis

__all__ = ["diagnose"]


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
    from planner.formats.folder import check_target
    from planner.gap.diagnose import diagnose as diagnosis_of
    from planner.report.gap.folder import DIAGNOSIS, write_diagnosis

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
    _report(found, output, as_json=as_json, quiet=quiet)
    return 0 if found.ok else 1


def _read(folder: Path, palette: str | None) -> "Campaign":
    from planner.gap.campaign_file import read_campaign_file
    from planner.gap.campaign_reader import read_campaign
    from planner.palette import load_palette
    from planner.printers import printer

    if palette is None:
        return read_campaign(folder)
    if palette.endswith(".toml") or Path(palette).is_file():
        return read_campaign(folder, load_palette(palette))
    machine = printer(read_campaign_file(folder).printer)
    return read_campaign(folder, machine.palette(palette))


def _report(diagnosis: "Diagnosis", output: Path | None, *, as_json: bool, quiet: bool) -> None:
    from planner.cli.output import print_document, say, say_verdict, terminal_width
    from planner.gap.diagnosis_json import encode_diagnosis
    from planner.report.gap.verdict_text import verdict_text

    if as_json:
        print_document(encode_diagnosis(diagnosis))
        return
    if quiet:
        return
    say_verdict(verdict_text(diagnosis, width=terminal_width()))
    say()
    if output is None:
        say("nothing was written (for a report with figures: --output FOLDER)")
    else:
        say(f"wrote {output} (next: open {output / 'report.html'})")
