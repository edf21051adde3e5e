"""What a person or a program reads: the only place of `print`; and options of many commands."""

import contextlib
import functools
import inspect
import itertools
import json
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin

from typer import Argument, Context, Option, Typer

import planner
from planner.errors import ArgumentError, Caution, listed, refused

__all__ = [
    "AsJson",
    "ForceOversize",
    "Kept",
    "MeshBodies",
    "Output",
    "Overwrite",
    "PaletteName",
    "PrinterLimits",
    "PrinterName",
    "asked",
    "check_targets",
    "command",
    "complain",
    "finding",
    "in_words",
    "long_progress",
    "print_document",
    "print_table",
    "progress",
    "run",
    "say",
    "stated",
    "tell_findings",
    "tell_notes",
    "terminal_width",
    "warn",
    "write_asked",
]


# ------------------------------------------------------------------------------------------------
# What a person or a program reads: the only place of `print`.
#
# Results go to stdout, everything else to stderr. NO_COLOR and non-terminals are honoured by rich.


def complain(message: str) -> None:
    """Say on stderr why nothing was done."""
    with contextlib.suppress(OSError):  # nobody may be listening
        if sys.stderr is not None:
            print(f"planner: {message}", file=sys.stderr)


def warn(*messages: str) -> None:
    """Say on stderr what the user should know although the work was done."""
    _stderr_lines("warning", "yellow", *messages)


def tell_notes(notes: Iterable[str]) -> None:
    """Say notes on stderr, each kind once with its count: cautions as warnings, before the others.

    A kind is what notes say of one file, specimen or material after another: the same words behind
    its name, whatever the figures.
    """
    kinds: dict[tuple[bool, str], list[str]] = {}
    for note in dict.fromkeys(notes):
        words = _FIGURE.sub("#", note.partition(": ")[2] or note)
        kinds.setdefault((not isinstance(note, Caution), words), []).append(note)
    for (is_note, _), alike in sorted(kinds.items(), key=lambda kind: kind[0][0]):
        count = f" ({len(alike)} such; --json lists all)" if len(alike) > 1 else ""
        _stderr_lines(*(("note", "cyan") if is_note else ("warning", "yellow")), alike[0] + count)


_FIGURE = re.compile(r"\d[\d.e+-]*")


def say(*lines: str) -> None:
    """Write lines of the result to stdout."""
    for line in lines:
        print(line)


def terminal_width() -> int:
    """Return how wide to set text: a terminal's width up to 100 columns, elsewhere 80."""
    if sys.stdout is None or not sys.stdout.isatty():
        return 80
    return max(40, min(100, shutil.get_terminal_size().columns))


def finding(*messages: str) -> None:
    """Say on stderr what will not come out as planned."""
    _stderr_lines("finding", "red", *messages)


_FINDINGS_SHOWN = 10


def tell_findings(messages: Sequence[str], listed: str) -> None:
    """Say findings on stderr, the first few, and where the others are listed."""
    finding(*messages[:_FINDINGS_SHOWN])
    if len(messages) > _FINDINGS_SHOWN:
        finding(f"{len(messages) - _FINDINGS_SHOWN} more of these are in {listed}")


class Kept(int):
    """Exit code of a command that was interrupted, and has kept what it had."""


def write_asked(path: Path | None, content: Callable[[], bytes]) -> None:
    """Write a file whole or not at all, where one is asked for."""
    from planner.formats.outputs import write_whole

    if path is not None:
        write_whole(path, content())


def print_document(document: dict[str, Any] | list[Any] | bytes) -> None:
    """Write one JSON document to stdout."""
    if isinstance(document, bytes):
        print(document.decode("utf-8"), end="")
    else:
        print(json.dumps(document, indent=2, ensure_ascii=False))


_running: list[tuple[Context, dict[str, Any]]] = []
"""Last the command that runs: what typer knows of it, and its options but for switches."""


def asked(*switches: str) -> bool:
    """Tell whether the command that runs, if one does, was given one of some switches, or of all.

    These are `as_json` and `quiet`.
    """
    names = switches or _SWITCHES
    return any(context.params.get(name) for context, _ in _running[-1:] for name in names)


def stated() -> dict[str, Any]:
    """Return the options that the command which runs was given; the others have their defaults."""
    context, _ = _running[-1]
    return {
        name: value
        for name, value in context.params.items()
        if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"
    }


def in_words(document: Callable[[], dict[str, Any] | bytes]) -> bool:
    """Print a result's document where JSON is asked for; tell whether it is to be said in words."""
    if asked("as_json"):
        print_document(document())
    return not asked()


def print_table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    title: str | None = None,
    droppable: Sequence[str] = (),
    swatches: Sequence[str] | None = None,
    abridged: str | None = None,
) -> None:
    """Write a table to stdout. No figure is ever cut short.

    Parameters
    ----------
    columns
        Their names; behind a ``>`` one whose figures stand flush right.
    droppable
        Columns to leave out, the first one first, where the terminal is too narrow.
    swatches
        A colour "#RRGGBB" a row, shown in front where colour is on.
    abridged
        Where rows are left out of the middle of a table that a terminal cannot show at once, what
        is said of them; by default all rows are written.
    """
    from rich import box
    from rich.console import Console
    from rich.measure import Measurement
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False)
    coloured = swatches is not None and console.color_system is not None
    lines = list(zip(swatches or ["default"] * len(rows), rows, strict=True))
    most = max(console.height - _AROUND, _LEAST_ROWS)
    if abridged is not None and console.is_terminal and len(rows) > most:
        first, last = (most + 1) // 2, most // 2 - 1
        gap = ["", f"... {len(rows) - first - last} more", *[""] * (len(columns) - 2)]
        lines[first:-last] = [("default", gap)]
    else:
        abridged = None
    wide = console.options.update(max_width=10_000)
    left = iter(droppable if console.is_terminal else ())
    while True:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
        if coloured:
            table.add_column("")
        for column in columns:
            flush: Any = "right" if column.startswith(">") else "left"
            table.add_column(column.removeprefix(">"), justify=flush, no_wrap=True)
        for swatch, row in lines:
            table.add_row(*([Text("██", style=swatch)] if coloured else []), *map(Text, row))
        width = Measurement.get(console, wide, table).maximum
        if width <= console.width or (dropped := next(left, None)) is None:
            break
        kept = [k for k, name in enumerate(columns) if name.removeprefix(">") != dropped]
        columns = [columns[k] for k in kept]
        lines = [(swatch, [row[k] for k in kept]) for swatch, row in lines]
    if title is not None:
        console.print(title, style="bold", soft_wrap=True)
    console.width = max(console.width, width)
    console.print(table)
    if abridged is not None:
        console.print(abridged, soft_wrap=True)


_AROUND = 10
"""Lines of a terminal that are kept for what stands about a table."""

_LEAST_ROWS = 10


@contextlib.contextmanager
def progress(enabled: bool = True, *, layers: bool = False) -> Iterator[Callable[..., None]]:
    """Show the running stage on stderr while it lasts, on a terminal only, if words are asked for.

    Yielded is what is called with the stage; or where `layers` are made, with how many of how many.
    """
    if asked() or not (enabled and sys.stderr is not None and sys.stderr.isatty()):
        yield lambda *told: None
        return
    from rich import progress as shown
    from rich.console import Console

    told: list[shown.ProgressColumn] = [shown.TextColumn("{task.description}")]
    if layers:
        told += [shown.BarColumn(), shown.MofNCompleteColumn(), shown.TimeRemainingColumn()]
    else:
        told = [shown.SpinnerColumn(), *told, shown.TimeElapsedColumn()]
    with shown.Progress(*told, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("layers" if layers else "starting", total=None)
        if layers:
            yield lambda done, of: bar.update(task, completed=done, total=of)
        else:
            yield lambda stage: bar.update(task, description=stage)


_PAUSE_S = 10.0
"""Between lines of progress where no terminal is."""


@contextlib.contextmanager
def long_progress() -> Iterator[Callable[[str], None]]:
    """Show stages and the time left on stderr, a line each ten seconds where it is no terminal.

    Stages that know which share of the work is done have it as `done`.
    """
    begun = said = time.monotonic()
    with progress() as show:

        def tell(stage: str) -> None:
            nonlocal said
            now = time.monotonic()
            spent, done = now - begun, float(getattr(stage, "done", 0.0))
            if done >= 0.1 and spent > _PAUSE_S:
                left = spent * (1.0 - done) / done
                stage += f"; about {f'{left / 60:.0f} min' if left > 90 else f'{left:.0f} s'} left"
            show(stage)
            if not asked() and now - said > _PAUSE_S and not (sys.stderr and sys.stderr.isatty()):
                said = now
                _stderr_lines("working", "cyan", stage)

        yield tell


def _stderr_lines(kind: str, colour: str, *messages: str) -> None:
    from rich.console import Console
    from rich.text import Text

    for message in messages if sys.stderr is not None else ():
        console = Console(stderr=True, highlight=False, soft_wrap=True)
        console.print(Text.assemble((f"{kind}: ", colour), message))


# ------------------------------------------------------------------------------------------------
# Options that more than one command takes.


AsJson = Annotated[bool, Option("--json", help="Print one JSON document and nothing else.")]
_SWITCHES: Mapping[str, Any] = {
    "as_json": AsJson,
    "quiet": Annotated[bool, "--quiet", "-q", "Print nothing but errors."],
}
PrinterName = Annotated[
    str, "Installed printer, see [bold]planner printers[/bold]; or its TOML file."
]
PaletteName = Annotated[str | None, "Palette file (TOML), or one of the printer's palettes."]


_Command = TypeVar("_Command", bound=Callable[..., int])
_Result = TypeVar("_Result")


def command(
    app: Typer, name: str | None = None, *, switches: str = "as_json quiet"
) -> Callable[[_Command], _Command]:
    """Add a function to the commands of an app; `_shown` tells what its options may be.

    Its docstring is the command's help, and where it has a section of parameters their help. Behind
    them it has switches, which it is not given: they are `asked`, for `in_words` as for `progress`.
    """

    def add(function: _Command) -> _Command:
        told, texts = _documented(function)
        own = [*inspect.signature(function).parameters.values()]
        groups: Any = {one.name: one.annotation for one in own if is_dataclass(one.annotation)}
        last = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=Context)
        for switch in switches.split():
            own.append(last.replace(name=switch, default=False, annotation=_SWITCHES[switch]))
        shown = [*itertools.chain(*(_shown(one, texts) for one in own)), last]

        @functools.wraps(function)
        def run(context: Context, **given: Any) -> int:
            given = {name: value for name, value in given.items() if name not in _SWITCHES}
            _running.append((context, given.copy()))
            context.call_on_close(_running.pop)
            for name, group in groups.items():
                given[name] = group(**{one.name: given.pop(one.name) for one in fields(group)})
            return function(**given)

        run.__doc__ = told
        vars(run)["__signature__"] = inspect.Signature(shown)
        run.__annotations__ = {one.name: one.annotation for one in shown}
        app.command(name)(run)
        return function

    return add


def _documented(thing: object) -> tuple[str, dict[str, str]]:
    """Return a docstring up to its parameters or attributes, and what it says of each of these."""
    doc = inspect.getdoc(thing) or ""
    told, *said = re.split(r"\n+(?:Parameters|Attributes)\n-{10}\n", doc)
    texts = re.findall(r"^(\w+)\n((?: {4}.+\n?)+)", "".join(said), re.MULTILINE)
    return told, {name: " ".join(text.split()) for name, text in texts}


def _shown(one: inspect.Parameter, texts: Mapping[str, str]) -> Iterator[inspect.Parameter]:
    """Yield a parameter as typer knows it; of one that is a dataclass, a group, each field.

    It is an option: those texts that it is annotated with and that begin with - are its names, as
    --from, if it has other ones than its parameter; another one is its help, else what the
    docstring says. A switch that is off by default has no other to turn it off. One by position
    that has to be given and has no such names is an argument.
    """
    if is_dataclass(one.annotation):
        _, texts = _documented(one.annotation)
        for each in fields(one.annotation):
            field = one.replace(name=each.name, annotation=each.type, default=each.default)
            yield from _shown(field, texts)
        return
    is_annotated = get_origin(one.annotation) is Annotated
    kind, *told = get_args(one.annotation) if is_annotated else [one.annotation]
    if all(isinstance(each, str) for each in told):
        names = [each for each in told if each.startswith("-")]
        said = next((each for each in told if each not in names), texts.get(one.name))
        if not names and one.default is False:
            names = [f"--{one.name.replace('_', '-')}"]
        is_argument = one.default is one.empty and one.kind is not one.KEYWORD_ONLY and not names
        info = Argument(help=said) if is_argument else Option(*names, help=said)
        one = one.replace(annotation=Annotated[kind, info])
    yield one


@dataclass(frozen=True)
class PrinterLimits:
    """Limits in place of the printer's own.

    Attributes
    ----------
    tray
        Largest part, X,Y,Z in mm, in place of the printer's own.
    minimum_wall_mm
        Thinnest wall in mm, in place of the printer's own.
    minimum_feature_mm
        Smallest detail in mm, in place of the printer's own.
    """

    tray: str | None = None
    minimum_wall_mm: Annotated[float | None, "--minimum-wall"] = None
    minimum_feature_mm: Annotated[float | None, "--minimum-feature"] = None

    def printer(
        self, printer: str | None, like: Path | None = None
    ) -> "str | planner.Printer | None":
        """Return the printer that is asked for, or that a plan to follow has, with these limits."""
        if self == PrinterLimits():
            return printer
        said = "give X,Y,Z in mm, as 300,200,150"
        with refused(ArgumentError, f"--tray {self.tray}", said, ValueError):
            x, y, z = map(float, (self.tray or "0,0,0").split(","))
        return planner.load_printer(
            printer or ("connex3" if like is None else planner.read_plan(like).printer),
            tray_mm=None if self.tray is None else (x, y, z),
            minimum_wall_mm=self.minimum_wall_mm,
            minimum_feature_mm=self.minimum_feature_mm,
        )


def run(function: Callable[..., _Result], **instead: Any) -> _Result:
    """Run a function with those options of the command that runs which it takes.

    It has them under the same names, some with another value `instead`. What is not given is left
    out: the defaults are the same.
    """
    names, given = inspect.signature(function).parameters, _running[-1][1] | instead
    return function(**{n: value for n, value in given.items() if n in names and value is not None})


_Target = Path | tuple[Path | None, str | None] | None
"""A file; or a folder with its record, see `check_target`; None of an option that is not given."""


def check_targets(*, force: bool, reads: Iterable[Path] = (), **targets: _Target) -> None:
    """Refuse targets that cannot be written; keep the others for this command until it ends.

    Refused is what is there already, is no file, is a figure but no SVG, is named twice, or is read
    by the command: any file that an argument or another option names, or holds as a folder.

    Parameters
    ----------
    reads
        Files that the command reads though none of its arguments names them.
    targets
        Files and folders to write, by the option that names each.
    """
    from planner.formats.outputs import check_absent, check_target, claimed, is_stream

    (context, _), figure = _running[-1], targets.get("figure")
    if isinstance(figure, Path) and figure.suffix.casefold() != ".svg":
        raise ArgumentError(f"--figure {figure}: its ending must be .svg")
    wanted = {name: one if isinstance(one, tuple) else (one, "") for name, one in targets.items()}
    places = {option: path for option, (path, _) in wanted.items() if path is not None}
    _refuse_sharing(places)
    there = any(path.exists() for path in places.values())
    read = [*reads, *_files_read(context, targets)] if there else []
    for option, path in places.items():
        if (record := wanted[option][1]) == "":
            _refuse_reading(option, path, [f for f in read if _same(path, f)], "that file")
            check_absent(path, force=force)
            continue
        if is_stream(path):
            raise ArgumentError(f"--{option} {path}: a folder is written; give its name")
        kept = check_target(path, force=force, record=record, option=option)
        inside = [f for f in read if _real(f).is_relative_to(_real(path))]
        _refuse_reading(option, path, inside, "a file in that folder")
        if kept and not asked("quiet"):
            warn(f"{path} keeps {listed(kept, 5)}, which planner did not write")
    for path in places.values():
        if not is_stream(path):
            context.with_resource(claimed(path, force=force))
        elif asked("as_json"):
            raise ArgumentError(f"{path}: --json prints there, too; name a file")
        else:  # what is said goes elsewhere
            context.with_resource(contextlib.redirect_stdout(sys.stderr))


def _refuse_sharing(given: Mapping[str, Path]) -> None:
    for (option, path), (other, beside) in itertools.combinations(given.items(), 2):
        one, two = _real(path), _real(beside)
        if _same(path, beside) or one.is_relative_to(two) or two.is_relative_to(one):
            raise ArgumentError(
                f"--{option} {path} and --{other} {beside} name one place; give each its own"
            )


def _refuse_reading(option: str, path: Path, read: Sequence[Path], what: str) -> None:
    if read:
        raise ArgumentError(
            f"--{option} {path}: the command reads {what} ({read[0]}); name another place"
        )


def _files_read(context: Context, targets: Container[str]) -> Iterator[Path]:
    """Yield the files that a command's arguments name, alone, in a text or as their folder."""
    from planner.formats.outputs import files_within

    for name, value in context.params.items():
        for given in () if name in targets else value if isinstance(value, list) else [value]:
            # Of a text such as 'shape: tip.csv' each word may be a file.
            words = re.split(r"[:,=;]\s*|\s+", given) if isinstance(given, str) else []
            for word in [given, *words] if isinstance(given, (str, Path)) else []:
                with contextlib.suppress(OSError, ValueError):  # no name of any file
                    path = Path(word)
                    if word and path.is_dir() and word is given:
                        yield path
                        yield from files_within(path)
                    elif word and path.is_file():
                        yield path


def _same(one: Path, other: Path) -> bool:
    """Tell whether two paths are one file, by links and other spellings too."""
    with contextlib.suppress(OSError):
        if one.samefile(other):
            return True
    return _real(one) == _real(other)


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))  # Path.resolve stops at loops of links


# ------------------------------------------------------------------------------------------------
# Options of the commands that take whole parts, and write files.


Output = Annotated[Path | None, "--output", "-o"]
Overwrite = Annotated[bool, "--force", "Replace files that are there."]
ForceOversize = Annotated[
    bool, "--force-oversize", "Plan a part that the printer's tray does not hold."
]
MeshBodies = Annotated[
    str | None,
    "What bodies of a mesh are whose winding does not tell: cavities, taken away from the "
    "solids around them; or solids, and then all are united.",
]
