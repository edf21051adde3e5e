"""What a person or a program reads: the only place that prints.

Results go to stdout, everything else to stderr. NO_COLOR and non-terminals are honoured by rich.
"""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

__all__ = ["complain", "figure", "print_document", "print_table", "progress", "say", "warn"]


def complain(message: str) -> None:
    """Say on stderr why nothing was done."""
    print(f"planner: {message}", file=sys.stderr)


def warn(message: str) -> None:
    """Say on stderr what the user should know although the work was done."""
    _stderr_line("warning", "yellow", message)


def say(message: str = "") -> None:
    """Write a line of the result to stdout."""
    print(message)


def finding(message: str) -> None:
    """Say on stderr what will not come out as planned."""
    _stderr_line("finding", "red", message)


def print_document(document: dict[str, Any] | list[Any] | bytes) -> None:
    """Write one JSON document to stdout."""
    if isinstance(document, bytes):
        sys.stdout.write(document.decode("utf-8"))
    else:
        sys.stdout.write(json.dumps(document, indent=2, ensure_ascii=False) + "\n")


def print_table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    title: str | None = None,
    right: Sequence[str] = (),
    swatches: Sequence[str] | None = None,
) -> None:
    """Write a table to stdout.

    Parameters
    ----------
    right
        Columns whose figures stand flush right.
    swatches
        A colour "#RRGGBB" a row, shown in front where colour is on.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False, soft_wrap=False)
    if not console.is_terminal:
        # A file or a pipe has no width: never cut a figure short there.
        console = Console(highlight=False, width=10_000, no_color=True)
    coloured = swatches is not None and console.color_system is not None
    table = Table(
        title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False
    )
    if coloured:
        table.add_column("")
    for column in columns:
        flush = "right" if column in right else "left"
        table.add_column(column, justify=flush, no_wrap=True)  # type: ignore[arg-type]
    for number, row in enumerate(rows):
        cells = [Text(cell) for cell in row]
        if coloured and swatches is not None:
            cells.insert(0, Text("██", style=swatches[number]))
        table.add_row(*cells)
    console.print(table)


def figure(value: float, digits: int = 3) -> str:
    """Write a figure with `digits` significant digits, without exponent where it reads well."""
    if value == 0.0:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        decimals = max(0, digits - 1 - _exponent(value))
        return f"{value:.{decimals}f}"
    return f"{value:.{digits - 1}e}"


def _exponent(value: float) -> int:
    return int(f"{abs(value):e}".split("e")[1])


@contextmanager
def progress(enabled: bool) -> Iterator[Callable[[str], None]]:
    """Show the running stage on stderr while it lasts, on a terminal only."""
    if not (enabled and sys.stderr.isatty()):
        yield lambda stage: None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting")
        yield lambda stage: bar.update(task, description=stage)


def _stderr_line(kind: str, colour: str, message: str) -> None:
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True, highlight=False, soft_wrap=True)
    console.print(Text.assemble((f"{kind}: ", colour), message))
