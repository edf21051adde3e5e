"""planner export: a planned part as a finite-element model."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Context, Option

from planner.cli.output import (
    AsJson,
    Force,
    LoadOptions,
    MeshBodies,
    MeshMaterial,
    MeshUnit,
    PaletteName,
    Quiet,
    check_targets,
    in_groups,
    taken,
)

if TYPE_CHECKING:
    from planner.simulation.export import Export


@in_groups
def export(
    context: Context,
    source: Annotated[str, Argument(help="A plan.json or its folder, or with --material a mesh.")],
    to: Annotated[str, Option(help="abaqus, calculix (INP files) or vtu (ParaView).")],
    output: Annotated[
        Path | None, Option("--output", "-o", help="File to write; <part>.inp or .vtu by default.")
    ] = None,
    cell_mm: Annotated[
        float | None,
        Option(
            "--cell", "--cell-mm", help="Edge of a cell in mm; by default what makes about 15000."
        ),
    ] = None,
    *,
    loads: LoadOptions,
    to_strain: Annotated[
        float | None,
        Option(
            help="Strain up to which CalculiX' laws follow the palette; by default 1.5 times what "
            "the part reaches under its loads, or the break."
        ),
    ] = None,
    material: MeshMaterial = None,
    unit: MeshUnit = None,
    bodies: MeshBodies = None,
    printer: Annotated[
        str | None, Option(help="Installed printer; by default the plan's, else connex3.")
    ] = None,
    palette: PaletteName = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Write a planned part as hexahedra, each in its material, for Abaqus, CalculiX or ParaView.

    Cells of an even lattice that are at least half full stand for the part; curved and slanted
    faces are stairs. With --fix and --load, --pressure, --move or --gravity the file has a step
    and runs as it is; without, it has sets of nodes at the part's ends to make one.

    Example: [bold]planner export finger-graded --to calculix --fix x=max --load "x=min: 0,0,-0.2
    N"[/bold]
    """
    given = locals()
    import planner
    from planner.cli.output import print_document, progress, say

    check_targets(context, force=force, output=output)
    with progress(not quiet and not as_json) as stage:
        stage("filling the part with cells")
        model = planner.export(**taken(planner.export, given | vars(loads)))
    path = model.write(output, force=force)
    if as_json:
        print_document(model.json())
    elif not quiet:
        _report(model)
        say(f"wrote {path}")
    return 0


def _report(model: "Export") -> None:
    from planner.cli.output import format_number, print_table, tell_notes

    tell_notes(model.notes)
    columns = [
        "material",
        "coordinate",
        "modulus MPa",
        "cells",
        "volume mm3",
        "law",
        "to strain",
        "off by",
    ]
    rows = [
        [
            made.name,
            f"{made.coordinate:.4g}",
            format_number(made.modulus_MPa),
            str(made.cells),
            format_number(made.volume_mm3, 4),
            made.law or "-",
            "-" if made.to_strain is None else f"{made.to_strain:.3g}",
            "-" if made.fit_error is None else f"{made.fit_error:.1%}",
        ]
        for made in model.materials
    ]
    if model.to != "calculix":
        columns, rows = columns[:-3], [row[:-3] for row in rows]
    edges = " x ".join(f"{edge:.3g}" for edge in model.cell_mm)
    print_table(
        columns,
        rows,
        title=f"{model.name}: {model.cells} cells of {edges} mm, {model.nodes} nodes, volume "
        f"{model.volume_error:+.1%}",
        right=columns[1:],
    )
