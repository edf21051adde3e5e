"""Options that more than one command takes."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from planner.palette import Palette
    from planner.printers import Printer

__all__ = ["AsJson", "AtStrain", "PaletteName", "PrinterName", "Quiet", "choose"]

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
PrinterName = Annotated[
    str, typer.Option("--printer", help="Installed printer; see [bold]planner printers[/bold].")
]
PaletteName = Annotated[
    str | None,
    typer.Option("--palette", help="Palette file (TOML), or one of the printer's palettes."),
]
AtStrain = Annotated[
    float,
    typer.Option(
        "--at-strain",
        help="Working strain: stiffness is the secant modulus of the nominal stress up to it.",
    ),
]


def choose(printer: str, palette: str | None) -> "tuple[Printer, Palette]":
    """Load the printer and the palette that the options name.

    Raises
    ------
    UnknownNameError, PaletteError
        No such printer or palette, or a palette file that breaks its schema.
    """
    from planner.printers import palette_of
    from planner.printers import printer as load_printer

    machine = load_printer(printer)
    return machine, palette_of(machine, palette)
