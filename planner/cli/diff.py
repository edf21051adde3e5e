"""planner diff."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.options import AsJson, Quiet

__all__ = ["diff"]


def diff(
    before: Annotated[Path, typer.Argument(help="A plan.json, or the folder that holds it.")],
    after: Annotated[Path, typer.Argument(help="The plan to compare with it.")],
    tolerance: Annotated[
        float,
        typer.Option(
            help="Relative difference of volumes, masses and moduli that still counts as equal."
        ),
    ] = 1e-6,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Compare two plans by meaning: material moved, volume changed, another target.

    Exit code 1 when they differ.

    Example: [bold]planner diff finger-graded finger-graded-before[/bold]
    """
    from planner.cli.output import print_document, print_table, say
    from planner.grading.difference import differences
    from planner.plan import read_plan

    found = differences(read_plan(before), read_plan(after), tolerance)
    if as_json:
        rows = [
            {"what": d.what, "where": d.where, "before": d.before, "after": d.after} for d in found
        ]
        print_document({"schema": 1, "equal": not found, "differences": rows})
    elif not quiet:
        if found:
            print_table(
                ["what", "where", "before", "after"],
                [[d.what, d.where, d.before, d.after] for d in found],
            )
        else:
            say("the plans mean the same")
    return 1 if found else 0
