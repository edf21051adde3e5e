"""Whatever happens to a command that writes, what it writes is whole: earlier or new, never a mix.

Small inputs for every such command, how it is attacked (`attacked.py`), and what it may leave.
"""

import hashlib
import json
import os
import random
import shlex
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import manifold3d as m3
import numpy as np
import pytest
import typer

from planner.cli import app, run
from planner.formats.mesh_file import encode_stl
from planner.formats.outputs import claimed, is_scratch

ATTACKED = Path(__file__).with_name("attacked.py")
SAMPLES = Path(__file__).resolve().parents[2] / "samples"

Content = Mapping[str, str]


@dataclass(frozen=True)
class Writer:
    """A command that writes.

    Attributes
    ----------
    words
        The command line, in the working directory of `Inputs`.
    targets
        Files and folders that it writes.
    needs
        What of the inputs it works on.
    force
        Whether it can replace what is there.
    """

    words: str
    targets: tuple[str, ...]
    needs: tuple[str, ...] = ()
    force: bool = True

    @property
    def name(self) -> str:
        first, second = self.words.split()[:2]
        return f"{first} {second}" if first in ("gap", "printers") else first


_ENDS = "--from Tango --to Vero"
WRITERS = (
    Writer(f"grade bar.stl {_ENDS} --bands 3 -o out", ("out",), ("bar.stl",)),
    Writer("view plain --no-open", ("plain/plan.html",), ("plain",), force=False),
    Writer("compare graded plain -o page.html --no-open", ("page.html",), ("graded", "plain")),
    Writer("slices graded -o stack --pitch 1", ("stack",), ("graded",)),
    Writer(
        "simulate FLX9760 --steps 5 -o pull.csv --figure pull.svg", ("pull.csv", "pull.svg")
    ),
    Writer("export graded --to calculix -o model.inp --cell 2", ("model.inp",), ("graded",)),
    Writer("materials --figure ladder.svg", ("ladder.svg",)),
    Writer(
        "characterise tensile -o table.csv --figure tests.svg",
        ("table.csv", "tests.svg"), ("tensile",),
    ),
    Writer(
        "gap simulate --design lab.csv --scatter 0.02 -o made", ("made",), ("lab.csv",),
        force=False,
    ),
    Writer("gap design --effects rate --budget 6 -o plan", ("plan",), (), force=False),
    Writer(
        "fit tensile -o lab.toml --figure lab.svg --tables tables",
        ("lab.toml", "lab.svg", "tables"), ("tensile",),
    ),
    Writer("gap diagnose warm-lab -o diagnosis", ("diagnosis",), ("warm-lab",)),
    Writer(
        "gap correct diagnosed --palette warm-lab/palette.toml --temperature-C 33 -o warm.toml",
        ("warm.toml",), ("diagnosed", "warm-lab"),
    ),
    Writer(
        f"design bar.stl {_ENDS} --cell 2 --no-page -o designed --fix x=min "
        "--load 'x=max: 0,0,-0.01 N' --target 'x=max uz=-0.05 mm'",
        ("designed",), ("bar.stl",),
    ),
    Writer("printers new myjet -o mine", ("mine",), (), force=False),
    Writer("schema palette -o palette.schema.json", ("palette.schema.json",)),
)  # fmt: skip
QUICK = ("grade", "view", "materials", "gap simulate")


def content(folder: Path) -> Content:
    """Hash every file below a folder, what is hidden included; folders end in a slash."""
    return {
        path.relative_to(folder).as_posix() + "/" * path.is_dir(): (
            "" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest()
        )
        for path in sorted(folder.rglob("*"))
    }


def left_over(found: Content) -> set[str]:
    """Return what stands in a scratch file or folder of a run."""
    return {path for path in found if any(map(is_scratch, path.split("/")))}


def below(found: Content, target: str) -> Content:
    """Return what lies at a target."""
    return {
        p: h for p, h in found.items() if p in (target, target + "/") or p.startswith(target + "/")
    }


@dataclass(frozen=True)
class Attacked:
    """How an attacked command ended, and what the working directory held then."""

    code: int
    out: str
    err: str
    steps: int
    found: Content


@dataclass
class Bench:
    """A working directory with the inputs of one writer."""

    writer: Writer
    folder: Path
    report: Path
    inputs: Content = field(init=False)

    def __post_init__(self) -> None:
        self.inputs = content(self.folder)

    def words(self, *, force: bool) -> list[str]:
        words = shlex.split(self.writer.words)
        return [*words, "--force"] if force and self.writer.force else words

    def start(self, fault: str, step: int = 0, *, force: bool = True) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, ATTACKED, fault, str(step), self.report, *self.words(force=force)],
            cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run(self, fault: str = "none", step: int = 0, *, force: bool = True) -> Attacked:
        self.report.write_text("-1")
        process = self.start(fault, step, force=force)
        out, err = process.communicate(timeout=300)
        steps = int(self.report.read_text())
        return Attacked(process.returncode, out, err, steps, content(self.folder))

    def reset(self, state: Path) -> None:
        shutil.rmtree(self.folder)
        shutil.copytree(state, self.folder)


@pytest.fixture(scope="session")
def inputs(
    tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Callable[[str], Path]:
    """Make each input on first use."""
    folder = tmp_path_factory.mktemp("inputs")

    def grade(name: str, *more: str) -> None:
        words = ["grade", str(path_of("bar.stl")), "--from", "Tango", "--to", "Vero", "-q"]
        assert run([*words, "-o", str(folder / name), *more]) in (0, 1)

    def path_of(name: str) -> Path:
        path = folder / name
        if path.exists():
            return path
        if name == "bar.stl":
            bar = m3.Manifold.cube([12.0, 4.0, 4.0]).to_mesh()
            corners = np.asarray(bar.vert_properties[:, :3], np.float32)
            path.write_bytes(encode_stl(corners, np.asarray(bar.tri_verts), "bar"))
        elif name == "graded":
            grade(name, "--bands", "3")
        elif name == "plain":
            grade(name, "--bands", "2", "--no-page")
        elif name == "lab.csv":
            words = ["--effects", "rate", "--budget", "6", "-o", str(path)]
            assert run(["gap", "design", *words]) in (0, 1)
        elif name == "diagnosed":
            shutil.copytree(request.getfixturevalue("warm_diagnosis"), path)
        else:
            shutil.copytree(SAMPLES / name, path)
        return path

    return path_of


@pytest.fixture
def bench_of(inputs: Callable[[str], Path], tmp_path: Path) -> Iterator[Callable[[Writer], Bench]]:
    """Lay out the working directory of a writer."""

    def made(writer: Writer) -> Bench:
        folder = tmp_path / "work"
        folder.mkdir()
        for name in writer.needs:
            source = inputs(name)
            if source.is_dir():
                shutil.copytree(source, folder / name)
            else:
                shutil.copy(source, folder / name)
        return Bench(writer, folder, tmp_path / "steps.txt")

    return made


FAULTS = ("kill", "int", "term", "full", "gone")
_CODES = {"kill": {-9}, "int": {130}, "term": {143}, "full": {2}, "gone": {2}}


def _names(command: Any, before: str = "") -> list[tuple[str, Any]]:
    within = getattr(command, "commands", None)
    if within is None:
        return [(before.strip(), command)]
    return [one for name, c in within.items() for one in _names(c, f"{before} {name}")]


def test_every_command_that_writes_is_attacked() -> None:
    """A command that writes says so in an option: a file, folder or page to write."""
    writing = {
        name
        for name, command in _names(typer.main.get_command(app))
        if any(" to write" in (getattr(p, "help", "") or "") for p in command.params)
    }
    assert writing | {"view"} == {writer.name for writer in WRITERS}


def _held(bench: Bench, attacked: Attacked, earlier: Content, new: Content) -> str:
    """Hold what is there against what was and what would be; say which of both each target is."""
    found = {p: h for p, h in attacked.found.items() if p not in left_over(attacked.found)}
    known = set()
    told = []
    for target in bench.writer.targets:
        now = below(found, target)
        known |= set(now)
        assert now in (below(earlier, target), below(new, target)), (target, sorted(now))
        told.append("new" if now == below(new, target) else "earlier")
    others = {p: h for p, h in found.items() if p not in known}
    expected = {
        p: h
        for p, h in earlier.items()
        if not any(p in below(earlier, t) for t in bench.writer.targets)
    }
    assert others == expected
    return "/".join(told)


def _said(attacked: Attacked, fault: str, outcome: str) -> None:
    """Hold exit code and words against the contract."""
    assert "Traceback" not in attacked.err, attacked.err
    done = attacked.code in (0, 1) and "earlier" not in outcome  # too late to stop it
    assert attacked.code in _CODES[fault] or done, (attacked.code, attacked.err)
    if attacked.code != -9:
        assert not left_over(attacked.found), left_over(attacked.found)
    if attacked.code == 2:
        assert (
            len([line for line in attacked.err.splitlines() if line.startswith("planner: ")]) == 1
        )


def _attack(bench: Bench, state: Path, fault: str, steps: list[int], new: Content) -> list[str]:
    """Attack a command at some of its steps, each from the same state; return what was left."""
    outcomes = []
    bench.reset(state)
    earlier = Bench(bench.writer, bench.folder, bench.report).inputs
    for step in steps:
        bench.reset(state)
        attacked = bench.run(fault, step)
        outcome = _held(bench, attacked, earlier, new)
        _said(attacked, fault, outcome)
        outcomes.append(outcome)
        if fault == "kill" and not (bench.writer.force is False and "new" in outcome):
            again = bench.run()
            assert again.code in (0, 1), again.err
            assert again.found == new  # and what the killed run left is gone
    return outcomes


def _states(bench: Bench, folder: Path) -> tuple[dict[str, Path], Content, int]:
    """Return the states to begin from, what a run makes of them, and its number of steps."""
    absent = folder / "absent"
    shutil.copytree(bench.folder, absent)
    first = bench.run()
    assert first.code in (0, 1), first.err
    assert first.steps > 0
    states = {"absent": absent}
    if bench.writer.force:
        earlier = folder / "earlier"
        shutil.copytree(bench.folder, earlier)
        for target in bench.writer.targets:  # an earlier one, not the same
            path = earlier / target
            for file in [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]:
                if file.suffix != ".json":
                    file.write_bytes(b"earlier")
            for record in path.glob("*.json") if path.is_dir() else ():
                document = json.loads(record.read_bytes())
                if "files_sha256" in document:  # as if it had been written so
                    of = hashlib.sha256(b"earlier").hexdigest()
                    kept = {
                        name: of for name in document["files_sha256"] if not name.endswith(".json")
                    }
                    record.write_text(
                        json.dumps(document | {"files_sha256": document["files_sha256"] | kept})
                    )
        states["earlier"] = earlier
    return states, first.found, first.steps


@pytest.mark.slow
@pytest.mark.parametrize(
    "writer",
    [pytest.param(w, id=w.name, marks=[pytest.mark.long] * (w.name != "grade"))
     for w in WRITERS if w.name in QUICK],
)  # fmt: skip
def test_a_step_of_quick_commands(
    writer: Writer, bench_of: Callable[[Writer], Bench], tmp_path: Path
) -> None:
    bench = bench_of(writer)
    states, new, steps = _states(bench, tmp_path)
    draw = random.Random(writer.name)
    for fault in ("kill", "full", draw.choice(["int", "term"])):
        state = draw.choice(sorted(states))
        _attack(bench, states[state], fault, [draw.randint(1, steps)], new)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a disk of 64 kB, where the system lets us."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("no disk can be mounted here")
    yield disk
    subprocess.run(["umount", disk], check=True)


@pytest.mark.parametrize("state", ["full", "read-only"])
def test_a_disk_that_takes_no_more(
    state: str, small_disk: Path, inputs: Callable[[str], Path], tmp_path: Path
) -> None:
    bench = Bench(WRITERS[0], small_disk, tmp_path / "steps.txt")
    (small_disk / "out").mkdir()
    (small_disk / "out" / "plan.json").write_text('{"files_sha256": {}}')
    shutil.copy(inputs("bar.stl"), small_disk)
    if state == "read-only":
        subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    before = content(small_disk)
    attacked = bench.run()
    assert attacked.code == 2
    assert attacked.err.startswith("planner: out: ")
    assert attacked.err.count("\n") == 1
    assert ("No space left on device" if state == "full" else "cannot be written") in attacked.err
    assert attacked.found == before


@pytest.mark.slow
@pytest.mark.parametrize("force", [pytest.param(False, marks=pytest.mark.long), True])
@pytest.mark.parametrize("writer", [WRITERS[0], WRITERS[4]], ids=["folder", "files"])
def test_two_runs_onto_one_target(
    writer: Writer, force: bool, bench_of: Callable[[Writer], Bench], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """They begin at about the same time; the target is the one's or the other's, whole."""
    bench = bench_of(writer)
    words = writer.words.replace("--bands 3", "--bands 2").replace("--steps 5", "--steps 6")
    other = Bench(replace(writer, words=words), bench.folder, tmp_path / "other.txt")
    target = writer.targets[0]
    wanted = []
    monkeypatch.chdir(bench.folder)
    for one in (bench, other):
        assert run(one.words(force=True)) in (0, 1)
        wanted.append(below(content(bench.folder), target))
        for path in map(bench.folder.joinpath, writer.targets):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    processes = [one.start("none", force=force) for one in (bench, other)]
    told = [process.communicate(timeout=300)[1] for process in processes]
    codes = sorted(process.returncode for process in processes)
    found = content(bench.folder)
    assert below(found, target) in wanted
    assert not left_over(found)
    assert codes[0] in (0, 1)
    refused = [line for words in told for line in words.splitlines() if "planner: " in line]
    if not force or refused:  # else the one had ended before the other began
        (line,) = refused
        assert codes[1] == 2
        assert "another run is writing it" in line or (not force and "exists already" in line)


@pytest.mark.parametrize("writer", [WRITERS[0], WRITERS[4]], ids=["folder", "files"])
def test_a_target_that_another_run_writes(
    writer: Writer, bench_of: Callable[[Writer], Bench]
) -> None:
    bench = bench_of(writer)
    with claimed(bench.folder / writer.targets[-1]):
        attacked = bench.run()
    assert attacked.code == 2
    assert "another run is writing it" in attacked.err
    assert attacked.err.count("\n") == 1
    assert content(bench.folder) == bench.inputs


@pytest.mark.parametrize("reader", ["full", "gone"])
def test_no_one_takes_what_is_printed(reader: str, bench_of: Callable[[Writer], Bench]) -> None:
    """What is written is whole all the same; that nothing could be printed is told."""
    bench = bench_of(WRITERS[0])
    command = [sys.executable, "-m", "planner", *bench.words(force=False)]
    with Path("/dev/full" if reader == "full" else "/dev/null").open("w") as out:
        process = subprocess.Popen(
            command, cwd=bench.folder, text=True, stderr=subprocess.PIPE,
            stdout=out if reader == "full" else subprocess.PIPE,
        )  # fmt: skip
    if process.stdout is not None:
        process.stdout.close()
    assert process.stderr is not None
    told = process.stderr.read()
    process.stderr.close()
    code = process.wait()
    assert "Traceback" not in told
    assert (bench.folder / "out" / "plan.json").exists()
    assert not left_over(content(bench.folder))
    if reader == "full":
        assert code == 2
        assert "standard output: No space left on device" in told
    else:
        assert code in (0, 1)


# What may stand where a result is to be written, besides nothing and an earlier result. Each takes
# the target, and a file that the command reads.
def _loop(target: Path, _: Path) -> None:
    target.symlink_to(target.with_name("loop"))
    target.with_name("loop").symlink_to(target)


THINGS: Mapping[str, Callable[[Path, Path], object]] = {
    "pipe": lambda target, _: os.mkfifo(target),
    "link to a device": lambda target, _: target.symlink_to("/dev/null"),
    "socket": lambda target, _: os.mknod(target, 0o600 | stat.S_IFSOCK),
    "loop of links": _loop,
    "another's folder": lambda target, _: shutil.copytree(SAMPLES / "tensile", target),
    "link to an input": lambda target, source: target.symlink_to(source),
    "second name of an input": lambda target, source: os.link(source, target),
    # And without --force:
    "file": lambda target, _: target.write_text("mine"),
    "link to nothing": lambda target, _: target.symlink_to("nothing"),
}


def _seen(folder: Path) -> dict[str, object]:
    """Say what every path below a folder is: a link's end, a file's hash, or its kind."""
    return {
        path.relative_to(folder).as_posix(): path.readlink()
        if path.is_symlink()
        else hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else stat.S_IFMT(path.lstat().st_mode)
        for path in sorted(folder.rglob("*"))
    }


@pytest.mark.parametrize("thing", THINGS)
@pytest.mark.parametrize("writer", WRITERS, ids=lambda w: w.name)
def test_an_output_on_every_kind_of_thing(
    writer: Writer, thing: str, bench_of: Callable[[Writer], Bench],
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """It is refused before anything is computed, in one line, and stays what it is."""
    bench = bench_of(writer)
    monkeypatch.chdir(bench.folder)
    for name in writer.targets:
        target = bench.folder / name
        if target.exists():  # the page of a plan
            target.unlink()
        source = next(
            (p for p in sorted(bench.folder.rglob("*")) if p.name in ("bar.stl", "plan.json")),
            next((p for p in sorted(bench.folder.rglob("*")) if p.is_file()), None),
        )
        if source is None and "input" in thing:
            pytest.skip("it reads no file")
        THINGS[thing](target, source or bench.folder)
        before = _seen(bench.folder)
        capsys.readouterr()
        force = thing not in ("file", "link to nothing")
        assert run(bench.words(force=force)) == 2, thing
        assert _seen(bench.folder) == before
        told = capsys.readouterr().err
        assert told.startswith("planner: ")
        assert told.count("\n") == 1
        for path in (target, target.with_name("loop")):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)


@pytest.mark.long
@pytest.mark.parametrize("writer", WRITERS, ids=lambda w: w.name)
def test_killed_at_any_time(
    writer: Writer, bench_of: Callable[[Writer], Bench], tmp_path: Path
) -> None:
    """Moments drawn evenly over the last third of the run, when it writes, and a tenth beyond."""
    bench, draw = bench_of(writer), random.Random(writer.name)
    states, new, _ = _states(bench, tmp_path)
    begun = time.monotonic()
    bench.reset(states["absent"])
    bench.run()
    lasts_s = time.monotonic() - begun
    outcomes = []
    for _ in range(12):
        state = states[draw.choice(sorted(states))]
        bench.reset(state)
        earlier = content(state)
        process = bench.start("none")
        try:
            out, err = process.communicate(timeout=lasts_s * draw.uniform(0.66, 1.1))
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
        found = content(bench.folder)
        outcomes.append(
            _held(bench, Attacked(process.returncode, out, err, 0, found), earlier, new)
        )
    counts = {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))}
    sys.stdout.write(f"{writer.name}, killed at any time: {len(outcomes)} runs, {counts}\n")


@pytest.mark.long
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("writer", WRITERS, ids=lambda w: w.name)
def test_every_step_of_every_command(
    writer: Writer, fault: str, bench_of: Callable[[Writer], Bench], tmp_path: Path,
) -> None:  # fmt: skip
    bench = bench_of(writer)
    states, new, steps = _states(bench, tmp_path)
    for name, state in states.items():
        more = 6 if name == "earlier" else 0  # what is replaced is removed file by file
        chosen = range(1, steps + more + 1)
        if writer.name in ("fit", "gap diagnose", "design"):  # seconds each
            chosen = chosen[:: max(1, len(chosen) // 5)]
        outcomes = _attack(bench, state, fault, list(chosen), new)
        counts = {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))}
        sys.stdout.write(f"{writer.name}, {fault}, {name}: {len(outcomes)} runs, {counts}\n")
