"""The docs run as written, and print what they show.

Of each page the console and python blocks run in order, in a folder that has the samples alone.
What stands below a command is what it prints, `...` for any text; what a command that shows nothing
prints is not looked at. A comment above a block may say `exits 0 1`, a code a command where not all
are 0, or `not run: why`.
"""

import doctest
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(
    p.relative_to(DOCS).as_posix()
    for p in DOCS.rglob("*.md")
    if not {"_build", "generated"} & set(p.parts)
)
MOST_WORDS = 45_000
QUICK = {"tutorial/first-part.md": "slow", "how-to/work-in-a-notebook.md": "slow"}
_BLOCK = re.compile(
    r"(?:^ *<!-- (?P<note>exits|not run:) (?P<said>[^\n]*) -->\n)?"
    r"^(?P<indent> *)```(?P<language>console|sh|python)\n(?P<code>.*?)^ *```$",
    re.MULTILINE | re.DOTALL,
)
_COMMAND = re.compile(r"^\$ ((?:.*\\\n)*.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)


def blocks(page: str) -> Iterator[tuple[str, str, list[int]]]:
    """Yield the language, the code and the exit codes that are told of each block that runs."""
    for found in _BLOCK.finditer((DOCS / page).read_text(encoding="utf-8")):
        if found["note"] == "not run:":
            continue
        code = re.sub(f"^{found['indent']}", "", found["code"], flags=re.MULTILINE)
        told = [int(word) for word in (found["said"] or "").split()]
        yield found["language"], code, told


def run_commands(code: str, exits: list[int], folder: Path) -> None:
    commands = _COMMAND.findall(code)
    assert commands, f"a console block begins with '$ ':\n{code}"
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    for k, (command, shown) in enumerate(commands):
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=folder,
            env={**os.environ, "PATH": path, "COLUMNS": "100", "NO_COLOR": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            check=False,
        )
        assert done.returncode == (exits[k] if exits else 0), f"{command}\n{done.stdout}"
        if shown.strip():
            assert matches(shown, done.stdout), f"$ {command}\n{done.stdout}\nis not\n{shown}"


def matches(shown: str, printed: str) -> bool:
    """Whether a text is what is shown; ``...`` stands for any text, rules may differ in length."""
    lines = [
        re.sub("─+", "─", "\n".join(line.rstrip() for line in text.strip().splitlines()))
        for text in (shown, printed)
    ]
    pattern = ".*?".join(map(re.escape, lines[0].split("...")))
    return re.fullmatch(pattern, lines[1], re.DOTALL) is not None


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=getattr(pytest.mark, QUICK.get(page, "long")))
        for page in PAGES
        if any(blocks(page))
    ],
)
def test_a_page_runs_and_prints_what_it_shows(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "samples").symlink_to(ROOT / "samples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {}
    for language, code, exits in blocks(page):
        if language == "console":
            run_commands(code, exits, tmp_path)
        elif ">>> " in code:
            test = doctest.DocTestParser().get_doctest(code, names, page, page, 0)
            told: list[str] = []
            runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
            assert runner.run(test, out=told.append, clear_globs=False).failed == 0, "".join(told)
            names |= test.globs
        else:
            exec(compile(code, page, "exec"), names)


@pytest.mark.parametrize("page", PAGES)
def test_commands_stand_in_blocks_that_run(page: str) -> None:
    assert "sh" not in {language for language, _, _ in blocks(page)}, "write ```console and $"


def test_what_is_shown_is_compared() -> None:
    assert matches("a\n...\nb 1\n", "a \nx\ny\nb 1")
    assert not matches("a\nb 1\n", "a\nb 2\n")
    assert not matches("a\n", "a\nb\n")


def test_the_docs_are_short() -> None:
    """Beside what the site takes from the code."""
    words = sum(len((DOCS / page).read_text(encoding="utf-8").split()) for page in PAGES)
    assert words <= MOST_WORDS


def printed(sample: str, *arguments: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, str(ROOT / "samples" / sample), *arguments],
        capture_output=True, encoding="utf-8", check=True,
    )  # fmt: skip
    return done.stdout.splitlines()


@pytest.mark.long
def test_the_design_loop_runs() -> None:
    """On cells so large that it takes seconds; what is printed comes within 1 % all the same."""
    rows = [re.findall(r"[\d.]+", line) for line in printed("design_loop.py", "5")]
    assert [float(row[0]) for row in rows] == [8.0, 12.0, 16.0]
    for wanted, reached, *_ in rows:
        # Reached is printed to hundredths.
        assert abs(float(reached) - float(wanted)) < 0.01 * float(wanted) + 0.005
    soft, stiff = (np.array([float(row[column]) for row in rows]) for column in (2, 3))
    assert (soft < 0.01 * stiff).all()
    assert soft[0] > soft[1:].max(), "more travel takes a softer tip"
