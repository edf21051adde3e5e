"""planner slices."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, Quiet
from planner.errors import ArgumentError

if TYPE_CHECKING:
    from planner.slices.stack import SliceStack

__all__ = ["slices"]


def slices(
    plan: Annotated[
        Path, typer.Argument(help="Folder that planner grade wrote, or its plan.json.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")],
    pitch: Annotated[
        str | None,
        typer.Option(
            help="Edges of a voxel in mm, X,Y,Z or one for all; the printer's own by default."
        ),
    ] = None,
    indexed: Annotated[
        bool, typer.Option("--indexed", help="Write palette images: smaller, the same colours.")
    ] = False,
    printer: Annotated[
        str | None, typer.Option("--printer", help="Installed printer; by default the plan's.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Make the layers on a Dask cluster: its scheduler, tcp://HOST:PORT."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier stack there.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Write a plan as the printer's own layers: one image a layer, one colour a material.

    Exit code 1 when the plan's shells overlap or are open.

    Example: [bold]planner slices finger-graded -o finger-slices[/bold]
    """
    from planner.cli.output import finding, print_document, progress_bar
    from planner.slices.write import write_slices

    pitch_mm = None if pitch is None else _lengths(pitch)
    with progress_bar("layers", not quiet and not as_json) as advance:
        stack = write_slices(
            plan,
            output,
            pitch_mm=pitch_mm,
            indexed=indexed,
            printer=printer,
            scheduler=scheduler,
            force=force,
            progress=advance,
        )
    if as_json:
        print_document(stack.json())
    elif not quiet:
        _report(stack, output)
    if not quiet:
        for message in stack.findings:
            finding(message)
    return 0 if stack.ok else 1


def _lengths(text: str) -> tuple[float, ...]:
    try:
        lengths = tuple(float(word) for word in text.split(","))
    except ValueError as error:
        bare = re.sub(r"\s*(mm|um|µm|μm|m)\b|(?<=\d)\s*[x×;]\s*(?=[\d.])", _comma, text)
        numbers = re.findall(r"\d*\.?\d+", bare)
        if len(numbers) in (1, 3):
            scale = 0.001 if re.search(r"[uµμ]m", text) else 1.0
            meant = ",".join(f"{float(number) * scale:g}" for number in numbers)
            hint = f"did you mean {meant}? "
        else:
            hint = ""
        raise ArgumentError(
            f"--pitch {text}: {hint}give lengths in mm without a unit, X,Y,Z as 0.042,0.042,0.03 "
            "or one for all"
        ) from error
    if len(lengths) not in (1, 3):
        raise ArgumentError(f"--pitch {text}: {len(lengths)} lengths; give one, or three: X,Y,Z")
    return lengths


def _comma(found: re.Match[str]) -> str:
    return "" if found.group(1) else ","


def _report(stack: "SliceStack", folder: Path) -> None:
    from planner.cli.output import figure, print_table, say

    x, y, z = stack.grid.pitch_mm
    total = sum(each.voxels for each in stack.materials)
    rows = [
        [each.material, _hex(each.rgba), str(each.voxels), figure(each.volume_mm3, 4)]
        for each in stack.materials
    ]
    rows.append(["all", "", str(total), figure(total * stack.grid.voxel_mm3, 4)])
    print_table(
        ["material", "colour", "voxels", "volume mm3"],
        rows,
        title=f"{stack.part.file} on {stack.printer}: {stack.grid.shape[2]} layers of "
        f"{stack.grid.shape[0]} x {stack.grid.shape[1]} pixels, {x:g} x {y:g} x {z:g} mm",
        right=["voxels", "volume mm3"],
        swatches=[*(_hex(each.rgba) for each in stack.materials), "default"],
    )
    say(f"wrote {folder} (materials and grid: {folder / 'slices.json'})")


def _hex(rgba: tuple[int, ...]) -> str:
    return "#" + bytes(rgba[:3]).hex().upper()
