"""planner invert."""

from typing import Annotated

import typer

from planner.cli.options import AsJson, AtStrain, PaletteName, PrinterName, choose

__all__ = ["invert"]


def invert(
    modulus: Annotated[
        list[float], typer.Option("--modulus", "-m", help="Wanted modulus in MPa; repeatable.")
    ],
    at_strain: AtStrain = 0.1,
    printer: PrinterName = "connex3",
    palette: PaletteName = None,
    as_json: AsJson = False,
) -> int:
    """Find the digital material, and the blend of two, that has a wanted stiffness.

    Exit code 1 when a modulus is out of reach; the nearest that can be printed is reported.

    Example: [bold]planner invert --modulus 1.2 --at-strain 0.2[/bold]
    """
    from planner.cli.output import figure, finding, print_document, print_table
    from planner.grading.mixture import mixture_for

    _, chosen = choose(printer, palette)
    found = [mixture_for(chosen, value, at_strain) for value in modulus]
    if as_json:
        print_document(
            {
                "schema": 1,
                "palette": chosen.name,
                "at_strain": at_strain,
                "results": [mixture.document() for mixture in found],
            }
        )
    else:
        print_table(
            ["target MPa", "nearest", "MPa", "error", "blend", "m", "MPa", "95 % interval"],
            [
                [
                    figure(mixture.target_MPa, 4),
                    mixture.nearest,
                    figure(mixture.nearest_modulus_MPa, 4),
                    f"{100 * (mixture.nearest_modulus_MPa / mixture.target_MPa - 1):+.1f} %",
                    mixture.blend_text(),
                    f"{mixture.blend.coordinate:.4f}",
                    figure(mixture.modulus_MPa, 4),
                    f"{figure(mixture.interval_MPa[0])} .. {figure(mixture.interval_MPa[1])}",
                ]
                for mixture in found
            ],
            title=f"{chosen.name}: secant modulus at strain {at_strain:g}",
            right=["target MPa", "MPa", "error", "m"],
            droppable=["95 % interval", "error"],
        )
        for mixture in found:
            if not mixture.reachable:
                finding(
                    f"{mixture.target_MPa:g} MPa is out of reach: the palette goes from "
                    f"{figure(mixture.range_MPa[0])} to {figure(mixture.range_MPa[1])} MPa; the "
                    f"nearest is {mixture.nearest}"
                )
    return 0 if all(mixture.reachable for mixture in found) else 1
