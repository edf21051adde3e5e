"""The commands, each imported from the file that bears its name."""

from typing import Annotated

import typer

from planner.cli.characterise import characterise
from planner.cli.check import check
from planner.cli.diff import diff
from planner.cli.fit import fit
from planner.cli.gap import app as gap
from planner.cli.grade import grade
from planner.cli.invert import invert
from planner.cli.materials import materials
from planner.cli.printers import printers
from planner.cli.simulate import simulate
from planner.cli.slices import slices

__all__ = ["app"]

app = typer.Typer(
    name="planner",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from planner import __version__
        from planner.cli.output import say

        say(f"planner {__version__}")
        raise typer.Exit


@app.callback()
def planner(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Say the version.")
    ] = False,
) -> None:
    """Plan print jobs of graded stiffness for multi-material jetting printers.

    [bold]planner grade[/bold] turns a mesh and a wish for stiffness into files that print.
    """


app.command()(grade)
app.command()(simulate)
app.add_typer(gap)
app.command()(invert)
app.command()(materials)
app.command()(fit)
app.command()(characterise)
app.command()(check)
app.command()(diff)
app.command()(slices)
app.command()(printers)
