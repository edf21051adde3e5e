"""The loops that a command meets after installation, in that order: planner/first_run.json.

python -m benchmarks.first_run [--seconds]

Runs commands on the samples and writes which loops they met first, with the types of their
arguments. `compile_ahead` has other processes compile these meanwhile. With --seconds nothing is
written; each command is timed twice with nothing kept at first, compiled ahead and not.
"""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from planner import compilation_cache

ROOT = Path(__file__).resolve().parents[1]
LISTED = ROOT / "planner/first_run.json"
FINGER = str(ROOT / "samples/finger.stl")
HELD = ("--fix", "x=max", "--load", "x=min: 0,0,-0.2 N", "--cell", "6")
GRADE = ("grade", FINGER, "--from", "Tango", "--to", "Vero", "--output")
COMMANDS: Mapping[str, Sequence[str]] = {
    "grade": (*GRADE, "graded"),
    "grade --field": (*GRADE, "curved", "--field", "radial: point=0 0 0"),
    "simulate": ("simulate", "graded", *HELD),
    "diagnose": ("gap", "diagnose", str(ROOT / "samples/warm-lab")),
}


@contextlib.contextmanager
def recorded() -> Iterator[dict[str, tuple[str, list[Any]]]]:
    """Note each loop that is found or made, and its types, by the name of its file."""
    found, met = compilation_cache.Loop._entry, dict[str, tuple[str, list[Any]]]()

    def entry(loop: Any, arguments: tuple[Any, ...]) -> Any:
        path = loop._path(arguments)
        name = f"{loop.py_func.__module__}.{loop.py_func.__name__}"
        types = [told(value) for value in arguments]
        again = map(compilation_cache._of_type, json.loads(json.dumps(types)))
        assert loop._path(tuple(again)) == path, f"{name}: its types cannot be listed"
        met.setdefault(path.name, (name, types))
        return found(loop, arguments)

    compilation_cache.Loop._entry = entry  # type: ignore[method-assign]
    compilation_cache.compile_ahead = lambda *_: None  # by a list that is yet to be made
    try:
        yield met
    finally:
        compilation_cache.Loop._entry = found  # type: ignore[method-assign]


def told(value: Any) -> Any:
    """Return a value's type as `compile_share` reads it."""
    kind = type(value)
    if kind is np.ndarray:
        flags, dtype = value.flags, value.dtype
        fields = dtype.str if dtype.names is None else dtype.descr
        return [fields, value.ndim, "C" if flags.c_contiguous else "A", flags.writeable]
    if isinstance(value, tuple):
        return {f"{kind.__module__}.{kind.__name__}": [told(one) for one in value]}
    return np.dtype(kind).name


def run_here(code: str, folder: Path, *arguments: str, **environment: str) -> bytes:
    """Run code in a process of its own and return what it writes."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE, cwd=folder, env={**os.environ, **environment}, check=False,
    )  # fmt: skip
    return done.stdout


def seconds(command: str, folder: Path, *, ahead: bool) -> float:
    """Return how long a command takes where nothing is kept yet."""
    code = "from planner.cli import main; main()"
    if not ahead:
        code = f"from planner import compilation_cache as c; c.compile_ahead = lambda *_: 0; {code}"
    with tempfile.TemporaryDirectory() as kept:
        began = time.perf_counter()
        run_here(code, folder, *COMMANDS[command], "--force", NUMBA_CACHE_DIR=kept)
        return time.perf_counter() - began


def loops_met(command: str, folder: Path) -> list[Any]:
    """Run a command in a process of its own; return each loop that it met and its types."""
    code = "import json, sys; from planner.cli import run; from benchmarks import first_run as f\n"
    code += "with f.recorded() as met: run(sys.argv[1:])\nprint(json.dumps(list(met.values())))"
    words = [*COMMANDS[command], "--force", "--quiet"]
    written = run_here(code, folder, *words, PYTHONPATH=str(ROOT))
    return list(json.loads(written))


def main(arguments: Sequence[str]) -> None:
    """Write the list, or print how long commands take."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        met = {command: loops_met(command, folder) for command in COMMANDS}
        for command in COMMANDS if arguments else ():
            took = [f"{seconds(command, folder, ahead=ahead):.1f} s" for ahead in (True, False)]
            print(f"{command}: {took[0]} compiled ahead, {took[1]} not")
    if not arguments:
        lists = (
            f'"{command}": [\n' + ",\n".join(map(json.dumps, loops)) + "\n]"
            for command, loops in met.items()
        )
        LISTED.write_text("{\n" + ",\n".join(lists) + "\n}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
