"""planner printers."""

from typing import Any

from planner.cli.options import AsJson

__all__ = ["printers"]


def printers(as_json: AsJson = False) -> int:
    """List the installed printers, what they print and where each comes from.

    Example: [bold]planner printers --json[/bold]
    """
    from planner.cli.output import finding, print_document, print_table
    from planner.errors import PlannerError
    from planner.printers import installed_printers, printer

    rows: list[dict[str, Any]] = []
    broken = []
    for name, entry in installed_printers().items():
        try:
            machine = printer(name)
        except PlannerError as error:
            broken.append(str(error))
            continue
        rows.append(
            {
                "name": name,
                "title": machine.title,
                "tray_mm": list(machine.tray_mm),
                "pixel_mm": list(machine.pixel_mm),
                "layer_mm": machine.layer_mm,
                "minimum_wall_mm": machine.minimum_wall_mm,
                "base_resins": list(machine.base_resins),
                "palettes": list(machine.palettes),
                "plugin": entry.value,
                "distribution": None
                if entry.dist is None
                else f"{entry.dist.name} {entry.dist.version}",
            }
        )
    if as_json:
        print_document({"schema": 1, "printers": rows, "broken": broken})
        return 1 if broken else 0
    print_table(
        ["name", "machine", "tray mm", "voxel um", "palettes", "from"],
        [
            [
                row["name"],
                row["title"],
                " x ".join(f"{v:g}" for v in row["tray_mm"]),
                " x ".join(f"{1000 * v:g}" for v in (*row["pixel_mm"], row["layer_mm"])),
                ", ".join(row["palettes"]),
                str(row["distribution"] or row["plugin"]),
            ]
            for row in rows
        ],
        droppable=["from", "voxel um"],
    )
    for problem in broken:
        finding(problem)
    return 1 if broken else 0
