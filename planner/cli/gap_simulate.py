"""planner gap simulate."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.options import AsJson, PaletteName, PrinterName, Quiet, choose

__all__ = ["simulate"]


def simulate(
    design: Annotated[
        Path,
        typer.Option(
            "--design", help="Which specimens: a specimens.csv, or the folder of a campaign."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")],
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            help="ID:NAME=VALUE,..., as in rate:rise=0.12,form=power-law; repeatable; what is not "
            "given is at the middle of its range.",
        ),
    ] = None,
    scatter: Annotated[
        float, typer.Option("--scatter", help="From specimen to specimen, of ln force.")
    ] = 0.03,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Same seed, same bytes.")] = 1,
    camera: Annotated[
        bool, typer.Option("--camera", help="See the strain along planned bars, too.")
    ] = False,
    printer: PrinterName = "connex3",
    palette: PaletteName = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Make a campaign with stated effects by planner's own model, to teach or to practise.

    It says of itself that it is simulated; it is no evidence of what the diagnosis can do with
    measurements. A campaign's own palette counts, not that of the options.

    Example: [bold]planner gap simulate --design plan --effect rate:rise=0.12 -o made[/bold]
    """
    import numpy as np

    from planner.cli.output import print_document, say, warn
    from planner.formats.folder import check_target
    from planner.gap.campaign_writer import write_campaign
    from planner.gap.imitation import imitate
    from planner.gap.imitation.stated_effect import stated_effect
    from planner.gap.planned.planned_campaign import read_plan_of_campaign

    check_target(output)
    machine, chosen = choose(printer, palette)
    plan = read_plan_of_campaign(design, chosen, printer=machine.name, camera=camera)
    effects = [stated_effect(text, plan.palette) for text in effect or ()]
    rng = np.random.default_rng(seed)
    made = imitate(plan, effects, rng, scatter=scatter, seed_text=f"seed {seed}")
    write_campaign(made, output)
    if as_json:
        print_document(
            {
                "schema": 1,
                "simulated": made.notes,
                "effects": [e.text for e in effects],
                "specimens": len(made.specimens),
                "folder": output.name,
            }
        )
    elif not quiet:
        for note in plan.remarks:
            warn(note)
        say(made.notes)
        say(f"wrote {output} (next: planner gap diagnose {output})")
    return 0
