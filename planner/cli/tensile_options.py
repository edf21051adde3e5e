"""Options of the commands that read tensile tests and write one file."""

from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "ColumnNames",
    "Force",
    "GaugeMm",
    "MaterialName",
    "SpecimensFile",
    "TensileFiles",
    "ThicknessMm",
    "WidthMm",
    "refuse_existing",
    "split_columns",
]

Force = Annotated[bool, typer.Option("--force", help="Replace the output file.")]
TensileFiles = Annotated[
    list[Path],
    typer.Argument(
        help="Tensile files (CSV, Mark-10 MESURgauge, Instron Bluehill), or folders of them; a "
        "specimens.csv among or beside them is used."
    ),
]
SpecimensFile = Annotated[
    Path | None, typer.Option("--specimens", help="List of specimens: material, size, file.")
]
MaterialName = Annotated[
    str | None, typer.Option("--material", help="What all specimens without a row are made of.")
]
WidthMm = Annotated[
    float | None, typer.Option("--width-mm", help="Width of specimens without a row.")
]
ThicknessMm = Annotated[
    float | None, typer.Option("--thickness-mm", help="Thickness of specimens without a row.")
]
GaugeMm = Annotated[
    float | None, typer.Option("--gauge-mm", help="Gauge length of specimens without a row.")
]
ColumnNames = Annotated[
    str | None,
    typer.Option(
        "--columns",
        help="Headings in place of the files' own, by position: 'stretch,stress_MPa', '-' leaves "
        "a column out.",
    ),
]


def split_columns(columns: str | None) -> list[str] | None:
    """Take --columns apart."""
    return None if columns is None else [name.strip() for name in columns.split(",")]


def refuse_existing(output: Path, *, force: bool) -> None:
    """Refuse to replace a file before the work for it begins.

    Raises
    ------
    OutputError
        It is there and `force` is false.
    """
    from planner.errors import OutputError

    if output.exists() and not force:
        raise OutputError(
            f"{output}: exists already; replace it with --force, or name another with --output"
        )
