"""The tree of planner for the site: a line a file, its own first line."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def first_line(path: Path) -> str:
    """Return what a file says of itself in its first line."""
    words = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return words.split("\n")[0]


def _lines(folder: Path, indent: str = "  ") -> Iterator[str]:
    """Yield a line for each file and folder of a package, files first."""
    for path in sorted(folder.glob("*.py")):
        if path.name not in ("__init__.py", "__main__.py"):
            yield f"{indent + path.name:24} {first_line(path)}"
    for path in sorted(p for p in folder.iterdir() if (p / "__init__.py").exists()):
        yield f"{indent + path.name + '/':24} {first_line(path / '__init__.py')}"
        yield from _lines(path, indent + "  ")


def tree() -> str:
    """Return the tree as it is on disk."""
    lines = []
    for name in ("planner", "printers"):
        head = f"{name + '/':24} {first_line(ROOT / name / '__init__.py')}"
        lines += [head, *_lines(ROOT / name)]
    return "\n".join(line.rstrip() for line in lines)
