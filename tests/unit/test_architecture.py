"""The map of the house is the house."""

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "architecture.md"


def test_the_tree_on_the_page_is_the_tree_on_disk() -> None:
    spec = importlib.util.spec_from_file_location("tree", PAGE.parent / "make_architecture.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    text = PAGE.read_text(encoding="utf-8")
    assert script.page(text) == text, "run docs/explanation/make_architecture.py"


def test_what_the_page_names_is_there() -> None:
    """Each dotted name is defined in the file that it is told to be in; each path exists."""
    text = PAGE.read_text(encoding="utf-8").split("## Layers")[1]
    for dotted in re.findall(r"`((?:[a-z_0-9]+\.)+\w+)`", text):
        *path, name = dotted.split(".")
        file = ROOT / "planner" / "/".join(path)
        if name in ("py", "md", "toml", "json") or (file / f"{name}.py").exists():
            continue
        file = file / "__init__.py" if file.is_dir() else file.with_suffix(".py")
        if path[0] == "planner":
            continue  # public names have a page of their own
        source = file.read_text(encoding="utf-8")
        assert re.search(rf"^(def|class) {name}\b", source, re.MULTILINE), dotted
    for path in re.findall(r"`((?:\w+/)*\w+\.py|(?:\w+/)+)`", text):
        assert any((base / path).exists() for base in (ROOT, ROOT / "planner")), path
