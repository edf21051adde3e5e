"""Write docs/reference/python.md from the docstrings: python docs/reference/make_python.py."""

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import planner

TARGET = Path(__file__).with_name("python.md")

COMMANDS = {
    "grade": "grade",
    "simulate": "simulate",
    "design": "design",
    "export": "export",
    "invert": "invert",
    "materials": "list_materials",
    "fit": "fit",
    "characterise": "characterise",
    "view": "view",
    "check": "check",
    "diff": "diff",
    "compare": "compare_page",
    "slices": "write_slices",
    "printers": "installed_printers",
    "gap diagnose": "diagnose",
    "gap correct": "correct",
    "gap design": "design_campaign",
    "gap simulate": "synthesise_campaign",
}
"""The function that each command calls."""

BEHIND = {"simulate": ("simulate_bar", "simulate_part")}
"""What a function calls in turn, by what its options are of."""

HEAD = """# The Python interface

Made by `docs/reference/make_python.py` from the docstrings; do not edit.

Every command is a function of `planner`, whose arguments have the names and defaults of the
command's options: `--at-strain` is `at_strain`; a length in mm or a modulus says so, `--pitch` is
`pitch_mm`; `--from` is `from_`, because `from` is Python's. What takes a file takes the value that
is read from it, too: a plan, a campaign, a diagnosis, a palette, a printer.

Some functions are not called as their command. `planner.slices`, `planner.materials` and
`planner.printers` are packages and a module, which a function of that name would hide or be hidden
by: `write_slices`, `list_materials` and `installed_printers` do what those commands do.
`planner compare` is `compare_page`. `planner.simulate` and `planner.design` are of a part; of a
campaign, as `planner gap simulate` and `planner gap design`, they are `synthesise_campaign` and
`design_campaign`.

Results come back as values; writing is a step of its own, `Plan.write`, `write_palette`,
`write_campaign`, `write_diagnosis`. A result's `ok` is false where its command's exit code is 1; a
`Mixture` says `reachable`, and `diff` returns no differences where plans mean the same.

Each shows itself on one line, and some as a page or a plot: [work in a
notebook](../how-to/work-in-a-notebook.md).

Errors are `planner.PlannerError`, or one of its kinds in `planner.errors`: `FileError`,
`MeshError`, `PaletteError`, `UnknownNameError`, `ArgumentError`, `OutputError`. Their messages name
an argument between backticks. Names are imported on first use; `import planner` costs nothing. For
tests of your own, see `planner.testing` and [golden files](../how-to/use-golden-files.md).
"""


def reference() -> str:
    """Return the page."""
    verbs = [n for verb in COMMANDS.values() for n in (verb, *BEHIND.get(verb, ()))]
    functions = [n for n in planner.__all__ if inspect.isfunction(getattr(planner, n))]
    types = [n for n in planner.__all__ if n not in functions]
    lines = [HEAD, "| command | function |", "| --- | --- |"]
    lines += [f"| `planner {c}` | [`planner.{f}`](#{f}) |" for c, f in COMMANDS.items()]
    lines += ["", "## What the commands do", ""]
    for name in verbs:
        lines += function_entry(name, getattr(planner, name))
    lines += ["## Reading, writing and drawing", ""]
    for name in functions:
        if name not in verbs:
            lines += function_entry(name, getattr(planner, name))
    lines += ["## Types", ""]
    for name in types:
        lines += type_entry(name, getattr(planner, name))
    return "\n".join(lines).rstrip() + "\n"


def function_entry(name: str, function: Callable[..., Any]) -> Iterator[str]:
    """Yield the lines of a function: how it is called, then its docstring's sections."""
    yield from (
        f"### {name}",
        "",
        "```python",
        f"planner.{name}({_arguments(function)})",
        "```",
        "",
    )
    yield from _rendered(function)


def type_entry(name: str, cls: type) -> Iterator[str]:
    """Yield the lines of a type: its docstring, its other fields, its methods and properties."""
    yield from (f"### {name}", "")
    yield from _rendered(cls)
    told = {n.split(":")[0].strip() for key in entries(sections(cls).get("Attributes", ""))
            for n in key.split(",")}  # fmt: skip
    fields = dataclasses.fields(cls) if dataclasses.is_dataclass(cls) else ()
    other = [f"`{f.name}`" for f in fields if f.name not in told]
    if other:
        yield from (f"Fields{' beside these' if told else ''}: {', '.join(other)}.", "")
    members = {
        n: member
        for n, member in vars(cls).items()
        if not n.startswith("_") and (inspect.isfunction(member) or isinstance(member, property))
    }
    if members:
        yield from ("**Methods and properties**", "")
    for called, member in members.items():
        summary = sections(member)[""].partition("\n\n")[0]
        arguments = f"({_arguments(member)})" if inspect.isfunction(member) else ""
        yield f"- `{called}{arguments}`: {_plain(summary)}"
    if members:
        yield ""


def sections(thing: Any) -> dict[str, str]:
    """Return the text of each section of a numpydoc docstring; "" is what comes before them."""
    text = inspect.getdoc(thing) or ""
    parts = re.split(r"^([A-Z][a-z]+)\n-{3,}\n", text, flags=re.MULTILINE)
    return {
        "": parts[0].strip(),
        **dict(zip(parts[1::2], map(str.rstrip, parts[2::2]), strict=True)),
    }


def entries(section: str) -> dict[str, str]:
    """Return what a section says, by the names or types that it says it of."""
    parts = re.split(r"^(\S.*)\n", section + "\n", flags=re.MULTILINE)
    return dict(zip(parts[1::2], map(inspect.cleandoc, parts[2::2]), strict=True))


def _arguments(function: Callable[..., Any]) -> str:
    shown = []
    keyword = False
    for p in inspect.signature(function).parameters.values():
        if p.kind is p.KEYWORD_ONLY and not keyword:
            keyword = True
            shown.append("*")
        if p.name != "self":
            default = "..." if callable(p.default) else repr(p.default)
            shown.append(p.name if p.default is p.empty else f"{p.name}={default}")
    return ", ".join(shown)


def _rendered(thing: Any) -> Iterator[str]:
    for heading, text in sections(thing).items():
        if not heading:
            if not (dataclasses.is_dataclass(thing) and text.startswith(f"{thing.__name__}(")):
                yield from (_plain(text), "")
        elif heading == "Examples":
            yield from ("```python", text.replace("  # doctest: +SKIP", ""), "```", "")
        else:
            yield from (f"**{heading}**", "")
            for names, told in entries(text).items():
                yield f"- `{names}`{': ' if told else ''}{_plain(told)}"
            yield ""


def _plain(text: str) -> str:
    """Turn reStructuredText's literals into Markdown's and unwrap lines within paragraphs."""
    paragraphs = [" ".join(p.split()) for p in text.replace("``", "`").split("\n\n")]
    return "\n\n".join(p for p in paragraphs if p)


if __name__ == "__main__":
    TARGET.write_text(reference(), encoding="utf-8", newline="\n")
