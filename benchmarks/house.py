"""How large the house is, how many of its rooms a command passes, and what commands cost.

python benchmarks/house.py                    sizes, and the files that two commands pass
python benchmarks/house.py --lower            the same, then lower each limit to what stands
python benchmarks/house.py --against TREE     also the cost of commands as a ratio to another tree

Limits and aims stand in pyproject.toml; what is beyond its limit ends this with 1.
TREE is a checkout of another revision. Commands run in turn here and there, as whole processes,
after one run that is not counted; medians of processor time and of peak memory are compared.
"""

import argparse
import ast
import io
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import tokenize
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = ROOT / "pyproject.toml"
PASSED = {
    "files of a grading": ["grade", "finger.stl", "--from", "Tango", "--to", "Vero", "-o", "g"],
    "files of a diagnosis": ["gap", "diagnose", "warm-lab", "-o", "d"],
}
COMMANDS = {
    "grade dogbone": ["grade", "dogbone.stl", "--from", "Tango", "--to", "Vero", "--bands", "10"],
    "grade finger": ["grade", "finger.stl", "--from", "Tango", "--to", "Vero"],
    "grade gripper, radial": [
        "grade", "gripper.stl", "--from", "Tango", "--to", "Vero", "--field", "radial: point=0 0 0"
    ],
    "grade finger, distance": [
        "grade", "finger.stl", "--from", "Tango", "--to", "Vero", "--field", "distance: surface"
    ],
    "grade dogbone, dither": [
        "grade", "dogbone.stl", "--from", "FLX9750", "--to", "FLX9785", "--blend", "dither"
    ],
    "grade organic, 330k triangles": ["grade", "organic.stl", "--from", "Tango", "--to", "Vero"],
    "slices": ["slices", "ready", "--pitch", "0.1", "-o", "out"],
    "simulate": ["simulate", "ready", "-o", "out.csv"],
    "fit": ["fit", "tensile", "-o", "out.toml"],
    "gap diagnose": ["gap", "diagnose", "warm-lab", "-o", "told"],
    "--help": ["--help"],
}  # fmt: skip


def code_lines(source: str) -> int:
    """Count lines that hold code: no blank ones, no comments, no docstrings of any kind."""
    words = {
        line
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    blank = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    held = {
        line
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type not in blank and token.type != tokenize.ENDMARKER
        for line in range(token.start[0], token.end[0] + 1)
    }
    return len(held - words)


def exported(source: str) -> set[str]:
    """Return the names in a file's ``__all__``."""
    return {
        str(ast.literal_eval(name))
        for node in ast.parse(source).body
        if isinstance(node, ast.Assign)
        and getattr(node.targets[0], "id", "") == "__all__"
        and isinstance(node.value, ast.List)
        for name in node.value.elts
    }


def sizes(root: Path) -> dict[str, int]:
    """Return the measures of a tree's package."""
    sources, stubs = (
        [path.read_text(encoding="utf-8") for path in sorted((root / "planner").rglob(f"*.{end}"))]
        for end in ("py", "pyi")
    )
    return {
        "files": len(sources),
        "code lines": sum(map(code_lines, sources + stubs)),
        "exported names": len(set().union(*map(exported, sources))),  # planner's own, once
    }


def passed(root: Path, arguments: Sequence[str]) -> int:
    """Count the files of planner in which a command runs more than the file's own top level.

    Bodies of modules and classes run on import, in files that a command never comes to too; those
    of functions alone have local variables of their own.
    """
    script = (
        "import inspect, sys, threading\n"
        "seen = set()\n"
        "def look(frame, event, _):\n"
        "    if event == 'call' and frame.f_code.co_flags & inspect.CO_NEWLOCALS:\n"
        "        seen.add(frame.f_code.co_filename)\n"
        "sys.setprofile(look); threading.setprofile(look)\n"
        "from planner.cli import run\n"
        "run(sys.argv[2:])\n"
        "sys.setprofile(None)\n"
        "print('passed', sum(name.startswith(sys.argv[1]) for name in seen))\n"
    )
    with workplace(root) as folder:
        done = subprocess.run(
            [sys.executable, "-c", script, str(root / "planner"), *arguments],
            cwd=folder, env=environment(root), capture_output=True, text=True, check=True,
        )  # fmt: skip
    return int(done.stdout.rsplit("passed", 1)[1])


def workplace(root: Path) -> "tempfile.TemporaryDirectory[str]":
    """Make a folder with a tree's samples."""
    folder = tempfile.TemporaryDirectory(prefix="house-")
    for sample in (root / "samples").iterdir():
        (Path(folder.name) / sample.name).symlink_to(sample)
    return folder


def environment(root: Path) -> dict[str, str]:
    """Return the environment in which `planner` is that of a tree."""
    return {**os.environ, "PYTHONPATH": str(root), "PYTHONSAFEPATH": "1"}


def cost(root: Path, folder: str, arguments: Sequence[str]) -> tuple[float, float]:
    """Return processor seconds and peak MB of one run of a command."""
    command = [sys.executable, "-m", "planner", *arguments]
    process = subprocess.Popen(
        command if "--help" in command else [*command, "--force"],
        cwd=folder, env=environment(root), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 1):
        raise SystemExit(f"planner {' '.join(arguments)} failed in {root}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0


def compare(here: Path, there: Path, runs: int) -> None:
    """Print the cost of every command in both trees, and their ratio."""
    print(
        f"{'command':32} {'cpu s':>7} {'was':>7} {'ratio':>6}   {'MB':>5} {'was':>5} {'ratio':>6}"
    )
    # A folder for each tree: neither replaces what the other wrote.
    with workplace(here) as one, workplace(here) as other:
        folders = {here: one, there: other}
        # In a process of its own: a child's peak memory begins at its parent's.
        make = [sys.executable, "-m", "benchmarks.grade", "make", f"{one}/organic.stl", "812"]
        subprocess.run(make, cwd=ROOT, check=True)
        Path(other, "organic.stl").symlink_to(Path(one, "organic.stl"))
        ready = ["grade", "finger.stl", "--from", "Tango", "--to", "Vero", "-o", "ready"]
        for root, folder in folders.items():
            cost(root, folder, ready)
        for name, arguments in COMMANDS.items():
            taken: dict[Path, list[tuple[float, float]]] = {here: [], there: []}
            for run in range(runs + 1):
                for root in (here, there):
                    measured = cost(root, folders[root], arguments)
                    if run:
                        taken[root].append(measured)
            (cpu, mb), (cpu_was, mb_was) = (
                [statistics.median(values) for values in zip(*taken[root], strict=True)]
                for root in (here, there)
            )
            print(
                f"{name:32} {cpu:7.2f} {cpu_was:7.2f} {cpu / cpu_was:6.2f}   "
                f"{mb:5.0f} {mb_was:5.0f} {mb / mb_was:6.2f}"
            )


def lowered(settings: str, values: Mapping[str, int]) -> str:
    """Return the text of pyproject.toml with the limits that values stay below lowered to them."""
    table = tomllib.loads(settings)["tool"]["planner"]["house"]
    for name, value in values.items():
        now = min(value, table[name]["limit"])
        line = rf"^({re.escape(json.dumps(name))} = \{{ limit = )\d+"
        settings, found = re.subn(line, rf"\g<1>{now}", settings, flags=re.MULTILINE)
        if found != 1:
            raise SystemExit(f"pyproject.toml: no line '{json.dumps(name)} = {{ limit = ...'")
    return settings


def gauge(lower: bool) -> bool:
    """Print the measures beside their limits and aims; return whether all are within limits."""
    values = sizes(ROOT) | {name: passed(ROOT, words) for name, words in PASSED.items()}
    settings = SETTINGS.read_text(encoding="utf-8")
    if lower:
        settings = lowered(settings, values)
        SETTINGS.write_text(settings, encoding="utf-8")
    table = tomllib.loads(settings)["tool"]["planner"]["house"]
    print(f"{'planner/':24} {'stands':>7} {'limit':>7} {'aim':>7}")
    for name, value in values.items():
        limit, aim = table[name]["limit"], table[name]["aim"]
        beyond = "   beyond its limit" if value > limit else ""
        print(f"{name:24} {value:7} {limit:7} {aim:7}{beyond}")
    return all(value <= table[name]["limit"] for name, value in values.items())


def main() -> None:
    """Print the measures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("--lower", action="store_true", help="lower limits to what stands")
    parser.add_argument("--against", type=Path, help="checkout of another revision")
    parser.add_argument("--runs", type=int, default=5)
    given = parser.parse_args()
    if given.against:
        compare(ROOT, given.against.resolve(), given.runs)
    sys.exit(0 if gauge(given.lower) else 1)


if __name__ == "__main__":
    main()
