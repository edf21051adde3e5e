"""Put the tree of planner on the page of its architecture: a line a file, its own first line.

python docs/explanation/make_architecture.py
"""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = Path(__file__).parent / "architecture.md"
BEGIN, END = "<!-- tree -->\n```text\n", "```\n<!-- end of tree -->"


def first_line(path: Path) -> str:
    """Return what a file says of itself in its first line."""
    words = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return words.split("\n")[0]


def tree(folder: Path, indent: str = "  ") -> Iterator[str]:
    """Yield a line for each file and folder of a package, files first."""
    for path in sorted(folder.glob("*.py")):
        if path.name not in ("__init__.py", "__main__.py"):
            yield f"{indent + path.name:24} {first_line(path)}"
    for path in sorted(p for p in folder.iterdir() if (p / "__init__.py").exists()):
        yield f"{indent + path.name + '/':24} {first_line(path / '__init__.py')}"
        yield from tree(path, indent + "  ")


def page(text: str) -> str:
    """Return the page with the tree as it is on disk."""
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    lines = []
    for name in ("planner", "printers"):
        head = f"{name + '/':24} {first_line(ROOT / name / '__init__.py')}"
        lines += [head, *tree(ROOT / name)]
    return before + BEGIN + "".join(line.rstrip() + "\n" for line in lines) + END + after


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
