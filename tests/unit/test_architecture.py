"""The map of the house is the house."""

import ast
import re
import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path

from benchmarks import house

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
DRAWINGS = re.findall(r"```text\n(.*?)```", TEXT, re.DOTALL)


def test_the_drawing_has_the_layers_that_are_held() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    rooms = (re.split(r" {2,}", line.strip())[0] for line in DRAWINGS[0].splitlines())
    drawn = re.findall(r"[\w.]+", " ".join(rooms))
    assert drawn == re.findall(r"[\w.]+", " ".join(layers))


def test_what_the_page_names_is_there() -> None:
    """Each dotted name is defined in the file that it is told to be in; each path exists."""
    ways = re.findall(r"\b([a-z]+\.[a-z_]+)\b", DRAWINGS[1].replace("part.stl", ""))
    for dotted in [*re.findall(r"`((?:[a-z_0-9]+\.)+\w+)`", TEXT), *ways]:
        *path, name = dotted.split(".")
        file = ROOT / "planner" / "/".join(path)
        if name in ("py", "md", "toml", "json", "csv", "js", "html") or any(
            there.exists() for there in (file / f"{name}.py", file / name)
        ):
            continue
        file = file / "__init__.py" if file.is_dir() else file.with_suffix(".py")
        if path[0] == "planner":
            continue  # public names have pages of their own
        source = file.read_text(encoding="utf-8")
        assert re.search(rf"^(def|class) {name}\b", source, re.MULTILINE), dotted
    for path in re.findall(r"`((?:\w+/)*\w+\.(?:py|js)|(?:\w+/)+)`", TEXT):
        assert any((base / path).exists() for base in (ROOT, ROOT / "planner")), path


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def test_what_another_file_takes_is_exported() -> None:
    """`__all__` tells what a change of a file may break elsewhere; commands are for Typer."""
    trees = {
        _module(path): ast.parse(path.read_text(encoding="utf-8"))
        for room in ("planner", "printers")
        for path in (ROOT / room).rglob("*.py")
    }
    exported = {module: house.exported(ast.unparse(tree)) for module, tree in trees.items()}
    taken = {
        (module, name)
        for tree in trees.values()
        for module, name in _taken(tree, exported)
        if not module.startswith("planner.cli.") and name != "__version__"
    }
    assert len(taken) > 600  # of a check that sees nothing
    assert sorted(f"{m}.{name}" for m, name in taken if name not in exported[m]) == []


def _taken(tree: ast.Module, modules: Collection[str]) -> Iterator[tuple[str, str]]:
    """Tell the names of modules that a file imports, or reads as attributes of modules."""
    known: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module in modules:
            for name in node.names:
                if (module := f"{node.module}.{name.name}") in modules:
                    known[name.asname or name.name] = module
                else:
                    yield node.module, name.name
    for node in ast.walk(tree):
        of = node.value if isinstance(node, ast.Attribute) else None
        if isinstance(of, ast.Name) and of.id in known:
            yield known[of.id], node.attr
