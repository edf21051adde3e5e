"""planner printers and schema: what machines there are, one of your own, and what editors check."""

import re
from pathlib import Path
from typing import Any, Literal

import typer

import planner
from planner.cli import output as cli
from planner.errors import ArgumentError, PlannerError
from planner.glance import sized

app = typer.Typer(name="printers", rich_markup_mode="rich", invoke_without_command=True)

_STATED = (
    "title", "tray_mm", "pixel_mm", "layer_mm", "minimum_wall_mm", "base_resins", "palettes",
)  # fmt: skip


@app.callback()
def _printers(context: typer.Context, as_json: cli.AsJson = False) -> int:
    """List the installed printers, what they print and where each comes from.

    Example: [bold]planner printers --json[/bold]
    """
    if context.invoked_subcommand:
        return 0
    rows: list[dict[str, Any]] = []
    shown, broken = [], []
    for name, entry in planner.installed_printers().items():
        try:
            machine = planner.load_printer(name)
        except PlannerError as error:
            broken.append(str(error))
            continue
        made_by = None if entry.dist is None else f"{entry.dist.name} {entry.dist.version}"
        stated = {key: getattr(machine, key) for key in _STATED}
        rows.append({"name": name, **stated, "plugin": entry.value, "distribution": made_by})
        sizes = machine.tray_mm, [1000 * v for v in (*machine.pixel_mm, machine.layer_mm)]
        where = [", ".join(machine.palettes), made_by or entry.value]
        shown.append([name, machine.title, *(sized(each, "g") for each in sizes), *where])
    if as_json:
        cli.print_document({"schema": 1, "printers": rows, "broken": broken})
    else:
        columns = ["name", "machine", "tray mm", "voxel um", "palettes", "from"]
        cli.print_table(columns, shown, droppable=["from", "voxel um"])
        cli.finding(*broken)
    return 1 if broken else 0


# ------------------------------------------------------------------------------------------------
# planner printers show.


@cli.command(app, switches="as_json")
def show(name: str) -> int:
    """Show a printer: its limits, its resins, its palettes and what its software calls materials.

    Example: [bold]planner printers show connex3[/bold]

    Parameters
    ----------
    name
        Installed printer, or its file, as my.toml.
    """
    machine = planner.load_printer(name)
    named = {
        palette.name: {m.id: machine.operator_name(m.id) for m in palette.materials}
        for palette in map(machine.palette, machine.palettes)
    }
    limits = {key: getattr(machine, key) for key in (*_STATED[1:5], "minimum_feature_mm")}
    resins = {"base_resins": machine.base_resins, "support": machine.support}
    called = {"name": machine.name, "title": machine.title}
    if not cli.in_words(lambda: {"schema": 1, **called, **limits, **resins, "palettes": named}):
        return 0
    cli.say(f"{machine.title} ({machine.name})")
    for key, value in limits.items():
        words = sized(value if isinstance(value, tuple) else (value,), "g")
        cli.say(f"  {key.removesuffix('_mm').replace('_', ' ')}: {words} mm")
    cli.say(f"  resins: {', '.join(machine.base_resins)}; support: {machine.support}")
    rows = [[palette, *pair] for palette, names in named.items() for pair in names.items()]
    cli.print_table(["palette", "material", "in its software"], rows)
    cli.say(f"(stiffness: planner materials --printer {name} --palette NAME)")
    return 0


# ------------------------------------------------------------------------------------------------
# planner printers new.


_NAME = re.compile(r"[a-z][a-z0-9_-]*")


@cli.command(app, switches="")
def new(name: str, like: str = "connex3", output: cli.Output = None) -> int:
    """Write a plugin for a printer of your own: figures, palette, notes, schemas and its test.

    Example: [bold]planner printers new myjet[/bold]

    Parameters
    ----------
    name
        Of the printer: small letters, digits, - and _.
    like
        Printer whose figures, palette and notes it begins with.
    output
        Folder to write; NAME-printer by default.
    """
    from planner.formats.outputs import write_folder

    if not _NAME.fullmatch(name):
        raise ArgumentError(f"{name}: give a name of small letters, digits, - and _, as myjet")
    if name in planner.installed_printers():  # one of both would be found by it
        raise ArgumentError(f"{name}: a printer of that name is installed; give another name")
    folder = Path(f"{name}-printer") if output is None else output
    cli.check_targets(force=False, output=(folder, None))
    package = f"{name.replace('-', '_')}_printer"
    write_folder(folder, _plugin(name, package, planner.load_printer(like)))
    profile = folder / package / "printer.toml"
    cli.say(f"wrote {folder}: put your printer's figures into {profile}, its materials beside it")
    cli.say(f"use it at once: planner grade PART --printer {profile}")
    cli.say(f"or by its name: pip install -e {folder} (its test: pytest {folder})")
    return 0


def _plugin(name: str, package: str, base: "planner.Printer") -> dict[str, bytes]:
    """Return the files of a plugin by their paths, each figure as the other printer has it."""
    from dataclasses import replace
    from importlib.resources import files
    from string import Template

    from planner.formats.files import toml_text
    from planner.palette import encode_palette
    from planner.printers import ProfileFile

    palette = replace(base.palette(), name=f"{name}-palette")
    names = {m.id: base.operator_name(m.id) for m in palette.materials}
    figures: dict[str, Any] = {
        key: getattr(base, key)
        for key in ProfileFile.__struct_fields__
        if hasattr(base, key) and key not in ("operator_names", "base")
    }
    figures |= {"name": name, "title": name, "palettes": [palette.name]}
    words = {
        "name": name,
        "package": package,
        "base": base.title,
        "figures": "\n".join(f"{key} = {toml_text(value)}" for key, value in figures.items()),
        "called": "\n".join(f"{toml_text(id)} = {toml_text(said)}" for id, said in names.items()),
    }

    def filled(template: str) -> bytes:
        text = (files("planner.cli") / "plugin" / f"{template}.template").read_text("utf-8")
        return Template(text).substitute(words).encode()

    return {
        "pyproject.toml": filled("pyproject.toml"),
        f"{package}/__init__.py": filled("__init__.py"),
        f"{package}/printer.toml": filled("printer.toml"),
        f"{package}/job_notes.md": f"**These notes are of the {base.title}: write what holds "
        f"for {name} into job_notes.md.**\n\n{base.job_notes()}".encode(),
        f"test_{package}.py": filled("test.py"),
        f"{package}/palettes/{palette.name}.toml": b"#:schema ../palette.schema.json\n"
        + encode_palette(palette),
        f"{package}/printer.schema.json": _encoded("printer"),
        f"{package}/palette.schema.json": _encoded("palette"),
    }


# ------------------------------------------------------------------------------------------------
# planner schema.


_Kind = Literal["printer", "palette", "campaign"]


def schema(kind: _Kind, output: cli.Output = None, force: cli.Overwrite = False) -> int:
    """Write the JSON Schema by which an editor checks a printer's, palette's or campaign's file.

    Editors that know TOML (taplo, Even Better TOML) follow a first line
    [bold]#:schema ./palette.schema.json[/bold]. What no schema can say, planner checks on reading.

    Example: [bold]planner schema palette -o palette.schema.json[/bold]

    Parameters
    ----------
    kind
        printer, palette or campaign.
    output
        File to write; else it is printed.
    """
    from planner.formats.outputs import write_whole

    cli.check_targets(force=force, output=output)
    if output is None:
        cli.print_document(_encoded(kind))
        return 0
    write_whole(output, _encoded(kind))
    cli.say(f"wrote {output} (first line of your file: #:schema ./{output.name})")
    return 0


def _encoded(kind: _Kind) -> bytes:
    from planner.formats.files import encode_document

    return encode_document(planner.file_schema(kind))
