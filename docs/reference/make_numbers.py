"""The numbers of the diagnosis, from the sources, as tables for the site."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCES = (*sorted((ROOT / "planner/gap").rglob("*.py")), ROOT / "planner/simulation/bar_solver.py")

KINDS = {
    "Physical": "follows from how specimens, materials, machines or units are",
    "Numerical": "a grid, a tolerance or a limit of a method; it says what error that leaves",
    "Calibrated": "set by the script that it names, or on the figures that it names",
    "Convention": "a usual level, a count of resamples, what is shown",
    "Chosen": "a judgement, with its reason; nobody has calibrated it",
}
_SOURCE = re.compile(rf"(?:^|(?<=\s))({'|'.join(KINDS)}): (.+)$")

_ELSEWHERE = ("Parameter",)
"""Calls whose numbers stand among the effects."""

_LONGEST = 240
"""Characters of a value that is shown in full."""


@dataclass(frozen=True)
class Number:
    """One number, or a few under one text.

    Attributes
    ----------
    kind, source
        "" where the text does not say.
    """

    module: str
    names: tuple[str, ...]
    values: tuple[str, ...]
    meaning: str
    kind: str
    source: str


def numbers() -> Iterator[Number]:
    """Yield every number of the sources, in their order."""
    for path in SOURCES:
        module = path.relative_to(ROOT / "planner").as_posix()
        text = path.read_text(encoding="utf-8")
        yield from _constants(module, ast.parse(text).body)


def _constants(module: str, body: list[ast.stmt]) -> Iterator[Number]:
    """Yield numbers; those without a line between share the text under the last of them."""
    run: list[tuple[str, str]] = []
    end = 0
    for statement in body:
        follows = statement.lineno == end + 1
        if run and not (follows and isinstance(statement, ast.Assign | ast.AnnAssign)):
            text = _string(statement) if follows else ""
            yield _number(module, *zip(*run, strict=True), text)
            run = []
        if isinstance(statement, ast.ClassDef):
            yield from _fields(module, statement)
        elif isinstance(statement, ast.Assign | ast.AnnAssign):
            run += _named(statement)
            end = statement.end_lineno or statement.lineno
    if run:
        yield _number(module, *zip(*run, strict=True), "")


def _named(statement: ast.Assign | ast.AnnAssign) -> Iterator[tuple[str, str]]:
    """Yield name and value, as shown, of each number that a statement assigns."""
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    value = statement.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = list(zip(target.elts, value.elts, strict=True))
    else:
        pairs = [(target, value)] if value is not None else []
    for name, one in pairs:
        if _has_number(one):
            yield ast.unparse(name), _shown(one)


def _fields(module: str, of: ast.ClassDef) -> Iterator[Number]:
    """Yield the fields of a class whose text says where they come from, alike ones at once."""
    doc = ast.get_docstring(of) or ""
    whole = _number(module, (), (), doc.partition("\nAttributes\n")[0])
    if not whole.kind:
        return
    meant = {
        name.strip(): " ".join(text.split())
        for names, text in re.findall(r"^(\w[\w, ]*)\n((?:    .+\n?)+)", doc, re.MULTILINE)
        for name in names.split(",")
    }
    together: dict[Number, list[tuple[str, str]]] = {}
    for field in of.body:
        if isinstance(field, ast.AnnAssign):
            for name, value in _named(field):
                one = _number(module, (), (), meant.get(name, whole.meaning))
                one = one if one.kind else replace(one, kind=whole.kind, source=whole.source)
                together.setdefault(one, []).append((f"{of.name}.{name}", value))
    for one, pairs in together.items():
        names, values = zip(*pairs, strict=True)
        yield replace(one, names=names, values=values)


def _number(module: str, names: tuple[str, ...], values: tuple[str, ...], text: str) -> Number:
    text = " ".join(text.split())
    found = _SOURCE.search(text)
    if found is None:
        return Number(module, names, values, text, "", "")
    meaning = text[: found.start()].strip()
    return Number(module, names, values, meaning, found[1], found[2])


def _has_number(value: ast.expr) -> bool:
    """Return whether a value holds a number, beside those of effects, of indices and functions."""
    if isinstance(value, ast.Lambda):
        return False
    if isinstance(value, ast.Call) and ast.unparse(value.func) in _ELSEWHERE:
        return False
    if isinstance(value, ast.Subscript):
        return _has_number(value.value)
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float) and not isinstance(value.value, bool)
    children = (c.value if isinstance(c, ast.keyword) else c for c in ast.iter_child_nodes(value))
    return any(_has_number(child) for child in children if isinstance(child, ast.expr))


def _shown(value: ast.expr) -> str:
    """Return a value as the source has it, without what only wraps it; a long one in a word."""
    if (
        isinstance(value, ast.Call)
        and ast.unparse(value.func) in ("MappingProxyType", "np.array")
        and len(value.args) == 1
        and not value.keywords
    ):
        return _shown(value.args[0])
    shown = ast.unparse(value)
    return f"`{shown}`" if len(shown) <= _LONGEST else "in the source"


def _string(statement: ast.stmt) -> str:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return str(statement.value.value)
    return ""


def tables() -> str:
    """Return how many numbers have which source, then a table a module."""
    found = list(numbers())
    counts = Counter(kind for number in found for kind in [number.kind] * len(number.names))
    lines = ["| source | what it means | numbers |", "| --- " * 3 + "|"]
    lines += [f"| {kind.lower()} | {means} | {counts[kind]} |" for kind, means in KINDS.items()]
    for module in dict.fromkeys(number.module for number in found):
        lines += ["", f"## {module}", "", "| number | value | what it is | source |"]
        lines += ["| --- " * 4 + "|"]
        lines += [_row(number) for number in found if number.module == module]
    return "\n".join(lines) + "\n"


def _row(number: Number) -> str:
    names = "<br>".join(f"`{name}`" for name in number.names)
    values = "<br>".join(number.values)
    cells = (names, values, number.meaning, f"*{number.kind.lower()}*: {number.source}")
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"
