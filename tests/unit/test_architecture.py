"""The map of the house is the house."""

import re
import tomllib
from pathlib import Path

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
