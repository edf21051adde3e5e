"""planner gap: its commands, each imported from a file of its own."""

import typer

from planner.cli.gap_bench import bench
from planner.cli.gap_correct import correct
from planner.cli.gap_design import design
from planner.cli.gap_diagnose import diagnose
from planner.cli.gap_simulate import simulate

__all__ = ["app"]

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
app.command()(bench)
app.command()(correct)
app.command()(design)
app.command()(simulate)
