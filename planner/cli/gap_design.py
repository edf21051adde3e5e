"""planner gap design."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, PaletteName, PrinterName, Quiet, choose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from planner.gap.design import CampaignDesign, Expected

__all__ = ["design"]


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
    from planner.gap.design import Size, design_campaign

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
            size=Size(width_mm, thickness_mm, gauge_mm),
            progress=stage,
        )
    _write(made, output, listed=listed)
    if as_json:
        print_document(_document(made, output))
    elif not quiet:
        _report(made, output, listed=listed)
    return 0 if all(_well(e) for e in made.expected) else 1


def _well(expected: "Expected") -> bool:
    return not expected.alike and expected.probability >= 0.5


def _check_target(output: Path, asked: "Sequence[str]", *, listed: bool) -> None:
    """Make sure that the result can be written, before it is worked out."""
    from planner.errors import ArgumentError, OutputError
    from planner.formats.folder import check_target
    from planner.gap.design import may_take_bars

    if not listed:
        check_target(output)
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
    from planner.formats.whole_file import write_whole
    from planner.gap.campaign_writer import specimens_csv, write_campaign

    if listed:
        write_whole(output, specimens_csv(made.campaign))
    else:
        write_campaign(made.campaign, output, measured=False)


def _document(made: "CampaignDesign", output: Path) -> "dict[str, object]":
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


def _report(made: "CampaignDesign", output: Path, *, listed: bool) -> None:
    from planner.cli.output import figure, finding, print_table, say, warn

    rows = []
    for e in made.expected:
        unit = "" if e.unit == "1" else f" {e.unit}"
        smallest = "none" if e.smallest is None else f"{figure(e.smallest)}{unit}"
        rows.append(
            [e.id, e.parameter, smallest, f"{figure(e.usual)}{unit}",
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
