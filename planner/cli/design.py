"""planner design: the gradient with which a part deforms as wanted."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from typer import Argument, Context, Option

import planner
from planner.cli import output as cli
from planner.glance import format_range


@cli.in_groups
def design(
    context: Context,
    part: Annotated[Path, Argument(help="Mesh file, as for planner grade.")],
    from_: Annotated[
        str,
        Option("--from", help="What the gradient begins with: a material or a modulus (0.5MPa)."),
    ],
    to: Annotated[str, Option(help="What it ends with. Nothing softer or stiffer is used.")],
    target: Annotated[
        list[str] | None,
        Option(
            help="What is wanted, as 'x=min uz=-12 mm', 'x=min ry=30 deg' (the faces turn), 'z=max "
            "to z=min distance=12 mm', 'x=min stiffness=0.05 N/mm', 'x=max fz=2 N', 'shape: "
            "bent.stl' (the surface as it is to be) or 'shape: points.csv'; 'weight 2' behind one "
            "makes its miss count twice. Repeatable."
        ),
    ] = None,
    *,
    loads: cli.LoadOptions,
    cases: cli.CasesFile = None,
    case: Annotated[
        list[str] | None,
        Option(
            help="A further load case: 'side; load x=min: 0,0.1,0 N; limit x=min uy<1 mm': its "
            "name, then target, limit, fix, load, ..., as in a file; held as the first one if "
            "nothing is said. Repeatable."
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        Option(
            help="'strain/break<0.5', 'slope<0.1 /mm', or a figure without its sign: 'x=min uy<1 "
            "mm'. Repeatable."
        ),
    ] = None,
    free: Annotated[
        str | None,
        Option(
            help="A gradient free in space: on a lattice of 6x3x3 controls, one each 8mm, or auto."
        ),
    ] = None,
    symmetric: Annotated[
        str, Option(help="With --free: its own mirror image across the part's middle along y, say.")
    ] = "",
    robust: Annotated[
        bool, Option("--robust", help="Limits hold at the worst of the palette's interval.")
    ] = False,
    knots: Annotated[int, Option(help="Of the profile, between which it is even.")] = 7,
    axis: Annotated[
        str | None, Option(help="Direction of the gradient; the longest side by default.")
    ] = None,
    field: Annotated[
        str | None, Option(help="What the gradient follows instead, as for planner grade.")
    ] = None,
    prefer: Annotated[
        str,
        Option(
            help="Among profiles that reach the targets: smooth (near the even gradient) or soft "
            "(least of what is stiff)."
        ),
    ] = "smooth",
    blend: Annotated[str | None, Option(help="nearest, by default, or dither.")] = None,
    at_strain: Annotated[float, Option(help="Working strain of the moduli.")] = 0.1,
    cell_mm: Annotated[
        float | None,
        Option("--cell", "--cell-mm", help="Edge of the cells; about 2000 by default."),
    ] = None,
    minutes: Annotated[
        float | None, Option(help="Take the finest cells that are done in about that time.")
    ] = None,
    tolerance: Annotated[float, Option(help="Relative miss of a target that is accepted.")] = 0.01,
    unit: cli.MeshUnit = None,
    bodies: cli.MeshBodies = None,
    printer: Annotated[
        str | None, Option(help="Installed printer, or its TOML file; connex3 by default.")
    ] = None,
    limits: cli.PrinterLimits,
    palette: cli.PaletteName = None,
    output: Annotated[Path | None, cli.out("Folder to write; <part>-designed by default.")] = None,
    no_page: Annotated[bool, Option("--no-page", help="Leave plan.html out.")] = False,
    force: cli.Overwrite = False,
    force_oversize: cli.ForceOversize = False,
    as_json: cli.AsJson = False,
    quiet: cli.Quiet = False,
) -> int:
    """Find the gradient with which a part bends, stretches or holds as wanted, and plan its print.

    The gradient is found on the whole part, planned in printed materials, simulated in those, and
    corrected. Exit code 1 when a target or limit is missed: the nearest is written. Ctrl-C ends the
    search and writes the best so far (a second one writes nothing); the same command goes on.

    Example: [bold]planner design finger.stl --from Tango --to Vero --axis x --fix x=max --load
    "x=min: 0,0,-0.5 N" --target "x=min uz=-12 mm"[/bold]
    """
    given = locals()
    from planner.inverse_design.design import interrupted_design
    from planner.simulation.loads import LoadCase, read_cases

    folder = Path(f"{part.stem}-designed") if output is None else output
    goes_on = interrupted_design(folder)
    force = force or goes_on
    cli.check_targets(context, force=force, folders={"output": (folder, "plan.json")})
    further = [
        one if one.fix or one.move else replace(one, fix=loads.fix or (), move=loads.move or ())
        for one in map(LoadCase.read, case or ())
    ]
    with cli.long_progress(not quiet and not as_json) as stage:
        asked = cli.taken(planner.design, given | vars(loads)) | {
            "cases": (*(() if cases is None else read_cases(cases)), *further),
            "start": folder if goes_on else None,
            "steps": 0 if no_page else _STEPS,
            "printer": limits.printer(printer),
            "progress": stage,
        }
        made = planner.design(**asked)
        stage("writing the files")
        made.write(folder, force=force, page=None if no_page else planner.plan_page(made))
    if as_json:
        cli.print_document(made.json())
    elif not quiet:
        _report(made, folder)
    return cli.Kept(130) if made.interrupted else 0 if made.ok else 1


_STEPS = 4
"""Of each load on the page: the view takes a second a step where there is no graphics card."""


def _report(made: "planner.PartDesign", folder: Path) -> None:
    cli.tell_notes(made.notes)
    interval = f">{100 * made.level:g} % interval"
    columns = ["target", ">wanted", ">gradient", ">printed", ">error", interval]
    rows = [
        [
            f"{row.case}: {row.target}" if row.case else row.target,
            f"{row.kind if row.kind in '<>' else ''}{row.wanted:.4g} {row.unit}",
            f"{row.continuous:.4g}",
            f"{row.printed:.4g}",
            "" if row.error is None or row.kind in "<>" else f"{100 * row.error:+.2f} %",
            "" if row.interval is None else format_range(list(row.interval)),
        ]
        for row in made.reached
    ]
    cli.print_table(columns, rows, title=repr(made)[1:-1])
    if made.free is None:
        knots = zip(made.positions, made.moduli_MPa, strict=True)
        cli.say("profile: " + ", ".join(f"{E:.3g} MPa at {u:.3g}" for u, E in knots))
    if made.strain_over_break is not None:
        cli.say(f"largest strain over elongation at break: {made.strain_over_break:.3g}")
    for words in [f.message for f in made.findings] + [f.message for f in made.plan.findings[:3]]:
        cli.finding(words)
    more = "" if made.table is None else "field.vti (opens in ParaView), "
    cli.say(f"wrote {folder}: what planner grade writes, {more}design.json and profile.csv")
