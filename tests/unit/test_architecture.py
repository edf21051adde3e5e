"""The map of the house is the house."""

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


_IMPORTS = re.compile(
    r"^ *from ((?:planner|printers)[\w.]*) import (?:\(([^)]*)\)|(.*))", re.MULTILINE
)
_NAME = re.compile(r"(\w+)(?: as (\w+))?")


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def test_what_another_file_takes_is_exported() -> None:
    """`__all__` tells what a change of a file may break elsewhere; commands are for Typer."""
    sources = {
        _module(path): path.read_text(encoding="utf-8")
        for room in ("planner", "printers")
        for path in (ROOT / room).rglob("*.py")
    }
    exported = {module: house.exported(source) for module, source in sources.items()}
    taken = {
        (module, name)
        for source in sources.values()
        for module, name in _taken(source, exported)
        if not module.startswith("planner.cli.") and name != "__version__"
    }
    assert len(taken) > 600  # of a check that sees nothing
    assert sorted(f"{m}.{name}" for m, name in taken if name not in exported[m]) == []


def _taken(source: str, modules: Collection[str]) -> Iterator[tuple[str, str]]:
    """Tell the names of modules that a file imports, or reads as attributes of modules."""
    for module, one, several in _IMPORTS.findall(source):
        for name, alias in _NAME.findall(one or several):
            if (inner := f"{module}.{name}") in modules:
                for attribute in re.findall(rf"(?<![\w.\"'/]){alias or name}\.(\w+)", source):
                    yield inner, attribute
            elif module in modules:
                yield module, name
