"""How often the quick tests notice a change of the core: seeded single mutations, a table by room.

python -m benchmarks.mutations RESULTS

Each of the mutations changes one thing in one function: a comparison, a sign, a constant, a bound
by one, a statement that is dropped. A map says which functions each test enters, itself or by a
fixture (machine code and other processes are not seen); it is made once, by a run of all quick and
slow tests, and kept beside RESULTS, a file of JSON lines, one a mutation; a second run goes on
where it ends. Of a mutated function the tests that enter it run first, then those that enter its
file, the shortest first, until one fails, hangs, or the time is up: the quick ones, and where none
of these notices, the slow ones.
"""

import argparse
import ast
import collections
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = {
    "cutting": ["planner/cutting/*.py"],
    "evidence": ["planner/gap/evidence/*.py"],
    "cells": ["planner/simulation/*cell*.py", "planner/simulation/export.py",
              "planner/simulation/element.py", "planner/simulation/solid.py"],
    "writers": [f"planner/formats/{name}.py" for name in
                ("field_file", "mesh_file", "outputs", "png", "threemf")],
    "laws": [f"planner/materials/{name}.py" for name in
             ("law_blocks", "laws", "marlow", "mixtures")],
}  # fmt: skip
OUT_OF_TIME = 77
HANG = (30.0, 10.0)  # seconds, and times what a test takes, after which it is said to hang


# ------------------------------------------------------------------------------------------------
# Mutations.


@dataclass(frozen=True)
class Mutation:
    """One change: the text from start to end, in bytes of a file, becomes another."""

    room: str
    file: str
    line: int
    function: str
    kind: str
    start: int
    end: int
    text: str

    @property
    def name(self) -> str:
        """Return what says the same mutation in another run."""
        return f"{self.file}:{self.line} {self.kind} {self.start}: {self.text}"


COMPARISONS: dict[type, type] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip


def changed(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield the kinds of change that a node allows, and what it becomes."""
    match node:
        case ast.Compare(left=left, ops=[op, *ops], comparators=others):
            yield "comparison", ast.Compare(left, [COMPARISONS[type(op)](), *ops], others)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            yield "sign", ast.BinOp(left, ast.Sub(), right)
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            yield "sign", ast.BinOp(left, ast.Add(), right)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield "sign", operand
        case ast.Constant(value=bool(value)):
            yield "constant", ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield "off by one", ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield "constant", ast.Constant(1.25 * value if value else 1.0)
        case ast.AugAssign() | ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield "dropped", ast.Pass()
        case ast.Expr(value=ast.Call()) | ast.If(orelse=[]):
            yield "dropped", ast.Pass()


def functions(tree: ast.AST, inside: str = "") -> Iterator[tuple[str, ast.AST]]:
    """Yield the outermost functions and methods of a file with their dotted names."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef):
            yield from functions(node, f"{inside}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield f"{inside}{node.name}", node


def mutations_of(room: str, path: Path) -> list[Mutation]:
    """Return every mutation of a file's functions: none of signatures, messages and texts."""
    source = path.read_bytes()
    starts = [0]
    for text in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(text))
    found = []
    for function, body in functions(ast.parse(source)):
        left = [*getattr(body, "body", ())]
        while left:
            node = left.pop()
            if isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr | ast.arguments):
                continue
            left += ast.iter_child_nodes(node)
            for kind, new in changed(node):
                lines = [getattr(node, f"{end}lineno") - 1 for end in ("", "end_")]
                start, end = (
                    starts[line] + getattr(node, f"{side}col_offset")
                    for line, side in zip(lines, ("", "end_"), strict=True)
                )
                text = ast.unparse(ast.fix_missing_locations(new))
                text = text if isinstance(new, ast.stmt) else f"({text})"
                file = path.relative_to(ROOT).as_posix()
                found.append(Mutation(room, file, lines[0] + 1, function, kind, start, end, text))
    return found


def chosen(count: int, *, seed: int) -> list[Mutation]:
    """Draw mutations: the rooms in turn, each kind as likely, no function twice."""
    rng = random.Random(seed)
    drawn: list[Mutation] = []
    every = {
        room: [
            one
            for path in sorted({path for pattern in patterns for path in ROOT.glob(pattern)})
            for one in mutations_of(room, path)
        ]
        for room, patterns in ROOMS.items()
    }
    for _ in range(count // len(ROOMS)):
        for found in every.values():
            seen = {(one.file, one.function) for one in drawn}
            kind = rng.choice(sorted({one.kind for one in found}))
            fresh = [x for x in found if x.kind == kind and (x.file, x.function) not in seen]
            drawn.append(rng.choice(fresh))
    return drawn


# ------------------------------------------------------------------------------------------------
# In the tests' process: which functions a test enters, and when to stop. Read as a plugin.


class Mapper:
    """Writes the functions that each test enters, and its seconds, to a file."""

    def __init__(self, path: Path) -> None:
        self.path, self.entered = path, set[CodeType]()
        self.by_fixture: dict[str, set[str]] = {}
        self.passed, self.of_test = True, set[str]()
        self.tests: dict[str, dict[str, Any]] = {}

    def names(self) -> set[str]:
        """Return what was entered since, and forget it."""
        entered, self.entered = self.entered, set()  # this is traced too
        here = f"{ROOT_OF_TESTS}{os.sep}"
        return {
            f"{code.co_filename.removeprefix(here)}:{code.co_qualname.split('.<locals>')[0]}"
            for code in entered
            if code.co_filename.startswith(f"{here}planner{os.sep}") and code.co_name != "<module>"
        }

    def look(self, frame: FrameType, event: str, argument: object) -> None:
        """Note a call."""
        self.entered.add(frame.f_code)

    @pytest.hookimpl(hookwrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[None]:
        """Note what a fixture enters, for all tests that it serves."""
        before = self.names()
        yield
        during = self.names()
        key = f"{fixturedef.baseid}::{fixturedef.argname}"
        self.by_fixture[key] = self.by_fixture.get(key, set()) | during
        self.of_test |= before | during

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any, nextitem: Any) -> Iterator[None]:
        """Note what a test enters."""
        self.of_test.clear()
        self.entered.clear()
        start, self.passed = time.perf_counter(), True
        sys.settrace(self.look)
        yield
        sys.settrace(None)
        names = self.of_test | self.names()
        for definitions in item._fixtureinfo.name2fixturedefs.values():
            for one in definitions:
                names |= self.by_fixture.get(f"{one.baseid}::{one.argname}", set())
        if self.passed:
            seconds = round(time.perf_counter() - start, 3)
            slow = item.get_closest_marker("slow") is not None
            told = {"seconds": seconds, "slow": slow, "enters": sorted(names)}
            self.tests[item.nodeid] = told

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Leave out tests that fail or skip: they tell nothing of a mutation."""
        self.passed &= report.passed

    def pytest_sessionfinish(self) -> None:
        """Write what this process has seen."""
        worker = os.environ.get("PYTEST_XDIST_WORKER", "all")
        self.path.with_suffix(f".{worker}").write_text(json.dumps(self.tests))


class Stopper:
    """Ends a run of tests when its time is up, or when a test takes far longer than it did."""

    def __init__(self, until_s: float, seconds: dict[str, float]) -> None:
        self.until_s, self.seconds = until_s, seconds

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any, nextitem: Any) -> Iterator[None]:
        """Set the alarm, which ends the process even inside a loop of machine code."""
        if time.time() > self.until_s:
            pytest.exit("out of time", returncode=OUT_OF_TIME)
        (Path.cwd() / "current-test").write_text(item.nodeid)
        signal.alarm(int(HANG[0] + HANG[1] * self.seconds.get(item.nodeid, 0.0)))
        yield
        signal.alarm(0)


ROOT_OF_TESTS = os.environ.get("MUTATIONS_TREE", "")


def pytest_configure(config: pytest.Config) -> None:
    """Be what the environment asks for."""
    if "MUTATIONS_MAP" in os.environ:
        config.pluginmanager.register(Mapper(Path(os.environ["MUTATIONS_MAP"])))
    elif "MUTATIONS_RUN" in os.environ:
        run = json.loads(Path(os.environ["MUTATIONS_RUN"]).read_text())
        config.pluginmanager.register(Stopper(run["until_s"], run["seconds"]))


# ------------------------------------------------------------------------------------------------
# Runs.


def workplace(folder: Path) -> Path:
    """Copy what tests read; the shared data, where there, lies beside as it does here."""
    there = folder / "tree"
    shutil.copytree(ROOT, there, symlinks=True, ignore=shutil.ignore_patterns(".*", "_build"))
    if (shared := ROOT.parent / "shared").is_dir():
        (folder / "shared").symlink_to(shared)
    (folder / "plugin").mkdir()
    shutil.copy(__file__, folder / "plugin")
    return there


def run_tests(there: Path, arguments: Sequence[str], **more: str) -> int:
    """Run tests in a copy; return pytest's exit code."""
    path = os.pathsep.join([str(there), str(there.parent / "plugin")])
    usual = {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "mutations", *arguments]
    done = subprocess.run(
        command, cwd=there, env={**os.environ, **usual, **more},
        stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    return done.returncode


def made_map(there: Path, path: Path, words: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return which functions each test enters; those that fail without mutations are left out.

    So are tests that a map made before knows and that are there no more.
    """
    if not path.exists():
        code = run_tests(there, words, MUTATIONS_MAP=str(path), MUTATIONS_TREE=str(there))
        if code in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED):
            raise SystemExit(f"pytest finds no such tests: {words}")
        made: dict[str, Any] = {}
        for part in path.parent.glob(f"{path.stem}.[ag]*"):  # all, gw0, gw1, ...
            made |= json.loads(part.read_text())
            part.unlink()
        path.write_text(json.dumps(made))
    told = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "--collect-only", *words, "-n", "0"],
        cwd=there, env={**os.environ, "PYTHONPATH": str(there)}, check=True,
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    there_now = set(told.stdout.splitlines())
    return {test: one for test, one in json.loads(path.read_text()).items() if test in there_now}


def noticing(mutation: Mutation, made: dict[str, dict[str, Any]], *, slow: bool) -> list[str]:
    """Return the tests that can notice a mutation, those that do most likely and soonest first."""
    file, function = f"{mutation.file}:", f"{mutation.file}:{mutation.function}"
    order = [
        (function not in told["enters"], told["seconds"], test)
        for test, told in made.items()
        if told["slow"] == slow and any(name.startswith(file) for name in told["enters"])
    ]
    return [test for *_, test in sorted(order)]


def outcome(there: Path, made: dict[str, dict[str, Any]], tests: list[str], limit_s: float) -> str:
    """Run tests until one fails: return "killed by" which, "survived" or "out of time".

    By "none" where the tests cannot even be imported.
    """
    if not tests:
        return "survived, for no test enters it"
    run, listed = there / "run.json", there / "run.txt"
    seconds = {test: made[test]["seconds"] for test in tests}
    current = there / "current-test"
    current.write_text("none")
    run.write_text(json.dumps({"until_s": time.time() + limit_s, "seconds": seconds}))
    listed.write_text("\n".join(tests))
    words = ["-x", "-n", "0", "-m", "not bench and not long", f"@{listed}"]
    code = run_tests(there, words, MUTATIONS_RUN=str(run))
    if code == OUT_OF_TIME:
        return f"out of time after {tests.index(current.read_text())} of {len(tests)} tests"
    return f"killed by {current.read_text()}" if code else f"survived {len(tests)} tests"


def rewrite(path: Path, source: bytes) -> None:
    """Write a module, and forget what was compiled of it: files of one size and second differ."""
    path.write_bytes(source)
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink()


def result(
    there: Path, mutation: Mutation, made: dict[str, dict[str, Any]], limit_s: float
) -> dict[str, Any]:
    """Run the tests on mutated code, the slow ones if no quick one notices."""
    path = there / mutation.file
    whole, start = path.read_bytes(), time.time()
    rewrite(path, whole[: mutation.start] + mutation.text.encode() + whole[mutation.end :])
    told: dict[str, Any] = {"name": mutation.name, "room": mutation.room, "in": mutation.function}
    for sort, slow in (("quick", False), ("slow", True)):
        told[sort] = outcome(there, made, noticing(mutation, made, slow=slow), limit_s)
        if told[sort].startswith("killed"):
            break
    rewrite(path, whole)
    return told | {"seconds": round(time.time() - start, 1)}


def table(results: list[dict[str, Any]]) -> None:
    """Print how many are killed by room, and what is not."""
    rooms: dict[str, collections.Counter[str]] = {room: collections.Counter() for room in ROOMS}
    for one in results:
        sorts = [sort for sort in ("quick", "slow") if one.get(sort, "").startswith("killed")]
        for room in (one["room"], "all"):
            rooms.setdefault(room, collections.Counter()).update(["mutations", *sorts])
    print(f"{'room':10} {'mutations':>10} {'quick kill':>11} {'slow kill':>10} {'survive':>8}")
    for room, count in rooms.items():
        left = count["mutations"] - count["quick"] - count["slow"]
        print(f"{room:10} {count['mutations']:10} {count['quick']:11} {count['slow']:10} {left:8}")
    for one in results:
        if not one["quick"].startswith("killed"):
            print(f"{one['name']} in {one['in']}\n  quick: {one['quick']}\n  slow: {one['slow']}")


def main() -> None:
    """Draw mutations, run each, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("results", type=Path, help="a file, begun or gone on with")
    parser.add_argument("--count", type=int, default=80)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=300.0, help="for the tests of a mutation")
    parser.add_argument("--tests", nargs="+", default=[], help="files of tests, if not all")
    parser.add_argument("--processes", default="2", help="of the run that makes the map")
    given = parser.parse_args()
    results: Path = given.results.resolve()
    results.touch()
    words = ["-n", given.processes, "-m", "not bench and not long", *given.tests]
    drawn = chosen(given.count, seed=given.seed)
    done = {one["name"]: one for one in map(json.loads, results.read_text().splitlines())}
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        there = workplace(Path(folder))
        made = made_map(there, results.with_suffix(".map.json"), words)
        for mutation in drawn:
            if mutation.name not in done:
                done[mutation.name] = result(there, mutation, made, given.seconds)
                with results.open("a") as file:
                    file.write(json.dumps(done[mutation.name]) + "\n")
    table([done[one.name] for one in drawn])


if __name__ == "__main__":
    main()
