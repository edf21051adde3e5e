"""What every command does, held fixed: run the cases, compare with behaviour.json, remake it.

``python tests/golden/behaviour.py check`` says which cases differ from behaviour.json, ``update``
remakes it and shows by meaning what changed against the code of a git revision, ``record`` keeps
all that the cases print and write, ``compare`` shows how two such records differ.
"""

# ruff: noqa: T201

import argparse
import contextlib
import fnmatch
import functools
import hashlib
import io
import json
import math
import multiprocessing
import os
import platform
import re
import shlex
import subprocess
import sys
import tarfile
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
if str(HERE) not in sys.path:
    sys.path.insert(0, str(HERE))

if __name__ == "__main__" and "NPY_DISABLE_CPU_FEATURES" not in os.environ:
    from planner.cli import round_alike

    round_alike()

from behaviour_cases import CASES, Case  # noqa: E402
from behaviour_meaning import differences_of, member_hashes  # noqa: E402

__all__ = ["Output", "manifest_of", "run_case", "wrong_in"]

ROOT = HERE.parents[1]
MANIFEST = HERE / "behaviour.json"
PLUGIN = ROOT / "tests" / "plugins" / "duojet"
REMAKE = "python tests/golden/behaviour.py update"
_NUMBER = re.compile(r"(?<![\w.])-?(?:\d+\.\d+(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+)(?!\w)")
_CONTROL = re.compile(r"\x1b\[[0-9;]*m")
_TEXT = {".json", ".csv", ".txt", ".toml", ".svg", ".html", ".md", ""}
_MANY = 6  # files in one folder; more count as one
_NOT_SHOWN = (
    DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning,
)  # fmt: skip


@dataclass(frozen=True)
class Output:
    """What one command line did: its exit code, what it printed and the files it wrote."""

    command: str
    exit: str
    stdout: bytes
    stderr: bytes
    files: dict[str, bytes]


# Running


def run_case(name: str) -> list[Output]:
    """Run a case's command lines in a new folder, which is the working directory meanwhile."""
    case = CASES[name]
    outputs: list[Output] = []
    with tempfile.TemporaryDirectory(prefix="behaviour-") as temporary:
        folder = Path(temporary).resolve()
        (folder / "samples").symlink_to(ROOT / "samples", target_is_directory=True)
        with _settled(folder, plugin=case.plugin):
            known: dict[str, bytes] = {}
            for step in case.steps:
                if not isinstance(step, str):
                    step(folder)
                    continue
                before = _digests(folder, case) if not outputs else known
                code, out, err = _run(shlex.split(step))
                known = _digests(folder, case)
                written = {
                    path: _masked((folder / path).read_bytes(), folder, Path(path).suffix)
                    for path, digest in known.items()
                    if before.get(path) != digest
                }
                written |= {f"{path} (gone)": b"" for path in before if path not in known}
                masked = (_masked(text, folder, "") for text in (out, err))
                outputs.append(Output(_unique(step, outputs), code, *masked, written))
    return outputs


def _unique(command: str, outputs: Sequence[Output]) -> str:
    again = sum(o.command == command or o.command.startswith(f"{command} #") for o in outputs)
    return f"{command} #{again + 1}" if again else command


@contextlib.contextmanager
def _settled(folder: Path, *, plugin: bool) -> Iterator[None]:
    """Be in a folder, with an environment that is the same everywhere."""
    environment, place, path = dict(os.environ), Path.cwd(), list(sys.path)
    for name in ("FORCE_COLOR", "CLICOLOR_FORCE", "TTY_COMPATIBLE", "TTY_INTERACTIVE", "LINES"):
        os.environ.pop(name, None)
    os.environ.update(COLUMNS="100", NO_COLOR="1", TERM="xterm")
    os.chdir(folder)
    if plugin:
        sys.path.insert(0, str(PLUGIN))
    try:
        yield
    finally:
        os.chdir(place)
        sys.path[:] = path
        os.environ.clear()
        os.environ.update(environment)


def _run(arguments: list[str]) -> tuple[str, bytes, bytes]:
    """Run planner in this process; warnings of Python count as lines of stderr."""
    from planner.cli import main

    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", newline="\n") for _ in range(2))
    code = "returned"
    with (
        warnings.catch_warnings(record=True) as caught,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        warnings.simplefilter("always")
        for category in _NOT_SHOWN:
            warnings.simplefilter("ignore", category)
        try:
            main(arguments)
        except SystemExit as stop:
            code = str(stop.code)
        except BaseException as error:
            code = f"raised {type(error).__name__}: {error}"
    for line in sorted({f"{w.category.__name__}: {w.message}" for w in caught}):
        err.write(line + "\n")
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue())  # type: ignore[attr-defined]
    return code, texts[0], texts[1]


def _digests(folder: Path, case: Case) -> dict[str, bytes]:
    found = {}
    for place, _, names in os.walk(folder):  # the link to the samples is not followed
        for name in names:
            if name == "plan.html" and not case.page:
                continue
            path = Path(place, name)
            found[path.relative_to(folder).as_posix()] = hashlib.sha256(path.read_bytes()).digest()
    return dict(sorted(found.items()))


def _masked(data: bytes, folder: Path, suffix: str) -> bytes:
    """Return a text without the places that differ from machine to machine."""
    if suffix not in _TEXT:
        return data
    for place, stand_in in ((folder, b"<folder>"), (ROOT, b"<root>")):
        data = data.replace(os.fsencode(place), stand_in)
    return _CONTROL.sub("", data.decode("utf-8", "surrogateescape")).encode(
        "utf-8", "surrogateescape"
    )


# The manifest


def manifest_of(case: Case, outputs: Sequence[Output]) -> dict[str, Any]:
    """Return the hashes that stand for a case's outputs."""
    return {
        output.command: {
            "exit": int(output.exit) if output.exit.isdigit() else output.exit,
            "stdout": _hash(output.stdout, "", case.digits),
            "stderr": _hash(output.stderr, "", case.digits),
            "files": _files(output.files, case.digits),
        }
        for output in outputs
    }


def _files(files: dict[str, bytes], digits: int | None) -> dict[str, str]:
    hashes = {name: _hash(data, Path(name).suffix, digits) for name, data in files.items()}
    folders: dict[str, list[str]] = {}
    for name in hashes:
        folders.setdefault(name.rpartition("/")[0], []).append(name)
    for folder, names in folders.items():
        if folder and len(names) > _MANY:
            together = "".join(f"{name} {hashes.pop(name)}\n" for name in sorted(names))
            hashes[f"{folder}/ ({len(names)} files)"] = _short(together.encode())
    return dict(sorted(hashes.items()))


def _hash(data: bytes, suffix: str, digits: int | None) -> str:
    if not data:
        return ""
    if suffix == ".3mf":
        data = json.dumps(member_hashes(data), sort_keys=True).encode()
    elif digits is not None and suffix in _TEXT:
        text = data.decode("utf-8", "surrogateescape")
        rounded = _NUMBER.sub(lambda found: _rounded(found[0], digits), text)
        data = rounded.encode("utf-8", "surrogateescape")
    return _short(data)


def _short(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _rounded(number: str, digits: int) -> str:
    value = float(number)
    if not math.isfinite(value):
        return number
    return f"{value:.{digits}g}" if abs(value) > 1e-12 else "0"


def _processor() -> str:
    """Return what BLAS and numpy take the processor for: each has kernels of its own."""
    import numpy as np  # its BLAS must be there to be asked
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__
    from threadpoolctl import threadpool_info

    found = {i.get("architecture", "?") for i in threadpool_info() if i["user_api"] == "blas"}
    found |= {name for name in __cpu_dispatch__ if __cpu_features__[name]}
    return " ".join([platform.machine(), *sorted(found), f"numpy {np.__version__}"])


@functools.cache
def _read_manifest() -> dict[str, Any]:
    if not MANIFEST.exists():
        return {"processor": _processor(), "cases": {}}
    manifest: dict[str, Any] = json.loads(MANIFEST.read_text(encoding="utf-8"))
    return manifest


def _without_numbers(made: dict[str, Any]) -> dict[str, Any]:
    return {
        command: {**output, "stdout": "", "files": dict.fromkeys(output["files"], "")}
        for command, output in made.items()
    }


def wrong_in(name: str, outputs: Sequence[Output]) -> list[str]:
    """Return what of a case is not as the manifest has it, a line each."""
    expected = _read_manifest()["cases"].get(name)
    made = manifest_of(CASES[name], outputs)
    if expected is None:
        return ["the case is not in behaviour.json"]
    if CASES[name].searches and _read_manifest()["processor"] != _processor():
        expected, made = _without_numbers(expected), _without_numbers(made)
    lines = []
    for command in [*expected, *(c for c in made if c not in expected)]:
        before, after = expected.get(command), made.get(command)
        if before is None or after is None:
            lines.append(f"{command}: {'new' if before is None else 'no longer run'}")
            continue
        wrong = [
            f"exit {before['exit']} -> {after['exit']}" if key == "exit" else key
            for key in ("exit", "stdout", "stderr")
            if before[key] != after[key]
        ]
        for file in sorted({*before["files"], *after["files"]}):
            was, now = before["files"].get(file), after["files"].get(file)
            if was != now:
                wrong.append(f"{file}{' is new' if was is None else ''}")
                wrong[-1] += " is not written" if now is None else ""
        if wrong:
            lines.append(f"{command}: {', '.join(wrong)}")
            if not before["stderr"] and after["stderr"]:
                said = next(o.stderr for o in outputs if o.command == command)
                lines.append(f"  stderr: {said.decode('utf-8', 'replace').splitlines()[-1][:300]}")
    return lines


# Records of all that was printed and written


def store(name: str, outputs: Sequence[Output], folder: Path) -> None:
    """Write a case's outputs below a folder, as they are."""
    for number, output in enumerate(outputs):
        place = folder / name / f"{number:02d}"
        (place / "files").mkdir(parents=True)
        (place / "command").write_text(output.command + "\n", encoding="utf-8")
        (place / "exit").write_text(output.exit + "\n", encoding="utf-8")
        (place / "stdout").write_bytes(output.stdout)
        (place / "stderr").write_bytes(output.stderr)
        for file, data in output.files.items():
            (place / "files" / file).parent.mkdir(parents=True, exist_ok=True)
            (place / "files" / file).write_bytes(data)


def compare(before: Path, after: Path) -> dict[str, list[str]]:
    """Return by case how two records differ, exactly and by meaning."""
    names = sorted({p.name for root in (before, after) for p in root.iterdir() if p.is_dir()})
    found: dict[str, list[str]] = {}
    for name in names:
        lines = _compared(before / name, after / name)
        if lines:
            found[name] = lines
    return found


def _compared(before: Path, after: Path) -> list[str]:
    if not before.is_dir() or not after.is_dir():
        return [f"only in {(before if before.is_dir() else after).parent}"]
    lines: list[str] = []
    for number in sorted({p.name for root in (before, after) for p in root.iterdir()}):
        old, new = (_stored(root / number) for root in (before, after))
        wrong = []
        for file in sorted({*old, *new}):
            wrong += differences_of(file, old.get(file), new.get(file))
        if wrong:
            command = (new.get("command") or old["command"]).decode().strip()
            lines += [f"$ planner {command}", *(f"  {line}" for line in wrong)]
    return lines


def _stored(place: Path) -> dict[str, bytes]:
    files = (p for p in sorted(place.rglob("*")) if p.is_file()) if place.is_dir() else ()
    return {p.relative_to(place).as_posix().removeprefix("files/"): p.read_bytes() for p in files}


# Commands


def _chosen(globs: Sequence[str]) -> list[str]:
    names = [n for n in CASES if not globs or any(fnmatch.fnmatchcase(n, g) for g in globs)]
    if not names:
        raise SystemExit(f"no case is called {' or '.join(globs)}; there are: {', '.join(CASES)}")
    return names


def _run_all(names: Sequence[str], jobs: int) -> Iterator[tuple[str, list[Output]]]:
    if jobs == 1 or len(names) == 1:
        yield from ((name, run_case(name)) for name in names)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(names)), mp_context=context) as pool:
        yield from zip(names, pool.map(run_case, names), strict=True)


def _check(names: Sequence[str], jobs: int) -> int:
    wrong = 0
    for name, outputs in _run_all(names, jobs):
        lines = wrong_in(name, outputs)
        if lines:
            wrong += 1
            print("\n".join([name, *(f"  {line}" for line in lines)]), flush=True)
    print(f"{len(names) - wrong} of {len(names)} cases are as behaviour.json has them")
    if wrong:
        print(f"if that is meant: {REMAKE}")
    return 1 if wrong else 0


def _record(folder: Path, names: Sequence[str], jobs: int) -> int:
    taken = [name for name in names if (folder / name).exists()]
    if taken:
        raise SystemExit(f"{folder} has {taken[0]} already; give another folder")
    for name, outputs in _run_all(names, jobs):
        store(name, outputs, folder)
    print(f"{len(names)} cases recorded in {folder}")
    return 0


def _update(names: Sequence[str], jobs: int, against: str, *, everything: bool) -> int:
    if _read_manifest()["processor"] != _processor():
        print(f"behaviour.json is of another processor ({_read_manifest()['processor']}): remade")
        print("here, cases that search change without a change of the code")
    manifest = dict(_read_manifest()["cases"])
    changed: dict[str, list[Output]] = {}
    for name, outputs in _run_all(names, jobs):
        made = manifest_of(CASES[name], outputs)
        if manifest.get(name) != made:
            if name in manifest:
                changed[name] = outputs
            else:
                print(f"{name}: a new case")
            manifest[name] = made
    gone = [name for name in manifest if name not in CASES]
    for name in gone if everything else ():
        del manifest[name]
        print(f"{name}: no such case any more")
    cases = {n: manifest[n] for n in CASES if n in manifest}
    document = {"schema": 1, "processor": _processor(), "cases": cases}
    MANIFEST.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    if changed:
        _show(changed, against, jobs)
    print(f"{len(changed)} of {len(names)} cases changed; {MANIFEST.name} is up to date")
    return 0


def _show(changed: dict[str, list[Output]], against: str, jobs: int) -> None:
    """Print by meaning what the code of a revision does otherwise."""
    with tempfile.TemporaryDirectory(prefix="behaviour-") as temporary:
        before, after = Path(temporary, "before"), Path(temporary, "after")
        for name, outputs in changed.items():
            store(name, outputs, after)
        tree = _code_of(against)
        paths = os.pathsep.join([str(tree), *filter(None, [os.environ.get("PYTHONPATH")])])
        command = [sys.executable, str(HERE / "behaviour.py"), "record", str(before), *changed]
        done = subprocess.run(
            [*command, "--jobs", str(jobs), "--code", str(tree)],
            env={**os.environ, "PYTHONPATH": paths},
            stdout=subprocess.DEVNULL,
            check=False,
        )
        if done.returncode:
            print(f"the code of {against} could not be run; what changed is not shown")
            return
        found = compare(before, after)
    for name in changed:
        lines = found.get(name, [f"as the code of {against} does it: behaviour.json was stale"])
        print("\n".join([name, *(f"  {line}" for line in lines)]))


def _code_of(revision: str) -> Path:
    """Return a copy of a revision's code; it is kept, for what numba has compiled of it."""
    commit = subprocess.run(
        ["git", "rev-parse", "--verify", f"{revision}^{{commit}}"],
        cwd=ROOT, capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    if commit.returncode:
        raise SystemExit(f"--against {revision}: {commit.stderr.strip()}")
    name = commit.stdout.strip()
    tree = Path(tempfile.gettempdir()) / f"planner-code-{os.getuid()}" / name[:16]
    if not tree.is_dir():
        archive = subprocess.run(
            ["git", "archive", name, "planner", "printers"],
            cwd=ROOT, capture_output=True, check=True,
        ).stdout  # fmt: skip
        tree.parent.mkdir(exist_ok=True, mode=0o700)
        half = Path(tempfile.mkdtemp(dir=tree.parent))
        with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
            tar.extractall(half, filter="data")
        half.rename(tree)
    return tree


def _must_be_from(tree: Path) -> None:
    import planner

    place = Path(planner.__file__).resolve()
    if not place.is_relative_to(tree.resolve()):
        raise SystemExit(f"planner was imported from {place}, not from {tree}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    commands = parser.add_subparsers(dest="command", required=True)
    globs = {"nargs": "*", "metavar": "CASE-GLOB", "help": "all cases by default"}
    check = commands.add_parser("check", parents=[common], help="compare with behaviour.json")
    check.add_argument("globs", **globs)  # type: ignore[arg-type]
    update = commands.add_parser(
        "update", parents=[common], help="remake behaviour.json and show what changed by meaning"
    )
    update.add_argument("globs", **globs)  # type: ignore[arg-type]
    update.add_argument(
        "--against", default="HEAD", metavar="REV", help="revision whose code is compared with"
    )
    record = commands.add_parser(
        "record", parents=[common], help="keep all that the cases print and write"
    )
    record.add_argument("folder", type=Path, metavar="DIR")
    record.add_argument("globs", **globs)  # type: ignore[arg-type]
    record.add_argument("--code", type=Path, help="folder that planner must be imported from")
    two = commands.add_parser("compare", help="show how two records differ, by meaning")
    two.add_argument("before", type=Path, metavar="DIR1")
    two.add_argument("after", type=Path, metavar="DIR2")
    commands.add_parser("list", help="list the cases")
    given, more = parser.parse_known_args()
    if more and (any(m.startswith("-") for m in more) or not hasattr(given, "globs")):
        parser.error(f"unrecognized arguments: {' '.join(more)}")
    if more:  # globs behind an option
        given.globs = [*given.globs, *more]
    if given.command == "list":
        for name, case in CASES.items():
            print(f"{name}: {sum(isinstance(s, str) for s in case.steps)} commands")
        return 0
    if given.command == "compare":
        found = compare(given.before, given.after)
        for name, lines in found.items():
            print("\n".join([name, *(f"  {line}" for line in lines)]))
        print(f"{len(found)} cases differ" if found else "the records are the same")
        return 1 if found else 0
    names = _chosen(given.globs)
    if given.command == "check":
        return _check(names, given.jobs)
    if given.command == "record":
        if given.code is not None:
            _must_be_from(given.code)
        return _record(given.folder, names, given.jobs)
    return _update(names, given.jobs, given.against, everything=not given.globs)


if __name__ == "__main__":
    sys.exit(main())
