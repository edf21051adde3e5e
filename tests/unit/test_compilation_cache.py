"""Compiled loops on disk: each belongs to all that it is made of."""

import importlib
import json
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import planner
from planner import compilation_cache
from planner.numerics import inner_kernel, kernel

AREAS = """
import json
import numpy as np
from numba.core import event
from planner.report.display import _add_areas

compiled = []

class Record(event.Listener):
    def on_start(self, event):
        compiled.append(event.data["dispatcher"].__name__)

    def on_end(self, event):
        pass

event.register("numba:compile", Record())
sums = np.zeros((3, 4))
_add_areas(np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]], np.int32), sums)
print(json.dumps([sums[0, 0], compiled]))
"""


@pytest.fixture
def package(tmp_path):
    """A copy of the package in which no loop is compiled, nor the module that a test changes."""
    copy = tmp_path / "planner"
    compiled = shutil.ignore_patterns("loops-*", "mesh.*.pyc", "*.pyc.*")
    shutil.copytree(Path(planner.__file__).parent, copy, ignore=compiled)
    return copy


def run(code, place, **environment):
    """Run code with the package at a place; return what it prints, as JSON."""
    # Python, too, goes by dates: without bytecode on disk it reads the sources.
    fresh = {"PYTHONPATH": str(place), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return json.loads(
        subprocess.check_output([sys.executable, "-c", code], env={**kept, **fresh}, cwd=place)
    )


def kept(place):
    return sorted(place.glob("**/loops-*/*"))


@pytest.mark.slow
def test_a_loop_is_compiled_anew_when_one_in_another_file_changes_and_found_when_it_is_changed_back(
    package,
):
    mesh = package / "mesh" / "mesh.py"
    right = mesh.read_text(), mesh.stat()
    wrong = right[0].replace("return uy * vz - uz * vy, uz", "return uy * vz + 9 * 11 , uz")
    assert len(wrong) == len(right[0])
    assert wrong != right[0]

    def write(text):
        mesh.write_text(text)
        os.utime(mesh, ns=(right[1].st_atime_ns, right[1].st_mtime_ns))

    both = ["_add_areas", "face_normal"]
    assert run(AREAS, package.parent) == [2, both]
    assert run(AREAS, package.parent) == [2, []]
    write(wrong)
    assert run(AREAS, package.parent) == [pytest.approx(np.hypot(99, 2)), both]
    write(f"\n\n{right[0]}")  # the same loops, on other lines
    os.utime(mesh)
    assert run(AREAS, package.parent) == [2, []]
    write(wrong)
    assert run(AREAS, package.parent) == [pytest.approx(np.hypot(99, 2)), []]


KEPT = """
import json, sys
import numpy as np
from planner.compilation_cache import Loop

{loop}

looped = Loop(loop, {{"error_model": "numpy"}})
print(json.dumps([{results}, "numba" in sys.modules]))
"""
TAKEN = """
def loop(a, b):
    c = np.zeros(3)
    for i in range(len(a)):
        c[i % 3] += a[i] * b[0] + math.sin(b[1])
    return c.sum(), b[2], max(b[0], 2)
import math
"""


@pytest.mark.slow
def test_a_loop_that_is_kept_is_called_without_numba_and_gives_the_same(package):
    given = "looped(np.arange(5.0), (2, 0.5, True)), looped(np.arange(5)[::2], (2, 0.5, True))"
    code = KEPT.format(loop=TAKEN, results=given)
    first, second = run(code, package.parent), run(code, package.parent)
    assert first[-1]
    assert second == [*first[:-1], False]
    assert first[0] == [pytest.approx(20 + 5 * np.sin(0.5)), True, 2]
    assert first[1] == [pytest.approx(12 + 3 * np.sin(0.5)), True, 2]


@pytest.mark.slow
def test_processes_that_meet_a_loop_at_once_compile_it_once(package):
    pytest.importorskip("fcntl")
    # Each takes its time, so that the second one comes while the first compiles.
    code = AREAS.replace("compiled.append", "__import__('time').sleep(1.0); compiled.append")
    env = {**os.environ, "PYTHONPATH": str(package.parent)}
    env.pop("NUMBA_CACHE_DIR", None)
    both = [
        subprocess.Popen(
            [sys.executable, "-c", code], env=env, cwd=package.parent, stdout=subprocess.PIPE
        )
        for _ in range(2)
    ]
    told = [json.loads(one.communicate()[0]) for one in both]
    assert [area for area, _ in told] == [2.0, 2.0]
    assert sorted(compiled for _, compiled in told) == [[], ["_add_areas", "face_normal"]]
    assert not list(package.glob("**/*.lock"))


@pytest.mark.slow
def test_what_a_kept_loop_returns_and_raises_is_what_numba_would(package):
    loop = """
def loop(a):
    if len(a) == 0:
        raise ValueError("nothing")
    return a.copy()[::-1], None
def told(a):
    try:
        return [looped(a)[0].tolist(), str(looped(a)[0].dtype)]
    except ValueError as error:
        return str(error)
"""
    given = "told(np.arange(3, dtype=np.float32)), told(np.arange(2)), told(np.arange(0.0))"
    code = KEPT.format(loop=loop, results=given)
    right = [[[2.0, 1.0, 0.0], "float32"], [[1, 0], "int64"], "nothing"]
    assert run(code, package.parent) == [*right, True]
    assert run(code, package.parent) == [*right, True]  # numba unpickles


@pytest.mark.long
def test_each_set_of_types_has_code_of_its_own(package):
    loop = """
def loop(a):
    return 2 * a
frozen = np.arange(2)
frozen.setflags(write=False)
kinds = [1, 1.5, True, np.float32(0.1), np.uint8(200), 1j, np.int64(3), np.float64(0.5)]
arrays = [np.arange(3.0), np.arange(2), frozen]
arrays += [np.ones((2, 2)), np.ones((2, 2)).T, np.arange(4)[::2]]
"""
    given = (
        "[repr(looped(kind)) for kind in kinds], [repr(2 * kind) for kind in kinds], "
        "[looped(each).tolist() for each in arrays], [(2 * each).tolist() for each in arrays]"
    )
    code = KEPT.format(loop=loop, results=given)
    first, second = run(code, package.parent), run(code, package.parent)
    assert second[:4] == first[:4]
    assert first[2] == first[3]
    assert first[0][:3] == first[1][:3]


@pytest.mark.slow
def test_what_no_one_used_for_a_month_goes_when_something_new_comes(package):
    old = package / "__pycache__" / "loops-python3.0"
    old.mkdir(parents=True)
    recent, unused = old / "recent.nbc", old / "unused.nbc"
    recent.touch()
    unused.touch()
    month_s = 30 * 24 * 3600
    os.utime(unused, (0, recent.stat().st_mtime - month_s - 60))
    os.utime(recent, (0, recent.stat().st_mtime - month_s + 3600))
    run(AREAS, package.parent)
    *others, outer = kept(package)
    assert others == [recent]
    os.utime(outer, (0, 0))
    run(AREAS, package.parent)
    assert outer.stat().st_mtime > recent.stat().st_mtime  # it was used


@pytest.mark.slow
def test_damaged_and_lost_files_are_compiled_anew(package):
    both = ["_add_areas", "face_normal"]
    assert run(AREAS, package.parent) == [2, both]
    (outer,) = kept(package)  # machine code holds what it calls
    outer.write_bytes(outer.read_bytes()[:1000])
    assert run(AREAS, package.parent) == [2, both]
    outer.write_bytes(b"")
    assert run(AREAS, package.parent) == [2, both]
    assert run(AREAS, package.parent) == [2, []]
    outer.unlink()
    assert run(AREAS, package.parent) == [2, both]


@pytest.mark.long
def test_without_a_place_to_write_loops_are_compiled_in_each_process(package, tmp_path):
    shutil.rmtree(package / "__pycache__", ignore_errors=True)
    (package / "__pycache__").write_text("in the way, for root too")
    home = tmp_path / "home"
    home.mkdir()
    places = {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")}
    both = ["_add_areas", "face_normal"]
    assert run(AREAS, package.parent, **places) == [2, both]
    assert run(AREAS, package.parent, **places) == [2, []]  # in the user's folder
    assert len(kept(home)) == 1
    shutil.rmtree(home)
    home.write_text("in the way")
    for _ in range(2):
        assert run(AREAS, package.parent, **places) == [2, both]


# ------------------------------------------------------------------------------------------------
# What the digest tells apart.


def digest(loop):
    return tuple(compilation_cache._parts(loop, []))


def test_every_loop_of_the_package_has_a_digest_of_its_own():
    loops = {
        loop
        for module in pkgutil.walk_packages(planner.__path__, "planner.")
        if not module.name.endswith("__main__")
        for loop in vars(importlib.import_module(module.name)).values()
        if isinstance(loop, compilation_cache.Loop)
    }
    assert len(loops) > 100
    assert len({digest(loop) for loop in loops}) == len(loops)


def made(constants=(1, 23), table=(1.0, 2.0), text="return inner(x) + TABLE[0]", inner="x"):
    """Return a loop that names another and a table."""
    names = {"kernel": kernel, "inner_kernel": inner_kernel, "TABLE": np.array(table)}
    code = f"""
@inner_kernel
def inner(x):
    return {inner} * {constants[0]} + {constants[1]}

@kernel
def outer(x):
    {text}
"""
    exec(code, names)
    return names["outer"]


@pytest.mark.parametrize(
    "change",
    [
        {"constants": (12, 3)},
        {"constants": (1, 23.0)},
        {"table": (1.0, 2.5)},
        {"text": "return inner(x) - TABLE[0]"},
        {"text": "return inner(x) + TABLE[1]"},
        {"inner": "x * TABLE[1]"},
    ],
)
def test_whatever_a_loop_is_made_of_is_in_its_digest(change):
    assert digest(made()) == digest(made())
    assert digest(made(**change)) != digest(made())


def test_how_a_loop_is_compiled_is_in_its_digest():
    def one(x):
        return x

    assert digest(kernel(one)) != digest(inner_kernel(one))


class Pair(NamedTuple):
    a: float
    b: float


def test_a_loop_with_something_untold_in_it_is_compiled_but_not_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(compilation_cache, "_folder", lambda: tmp_path)

    @kernel
    def untold(x):
        return Pair(x, x).b

    @kernel
    def told(x):
        return (x, x)[1]

    assert untold(2.0) == told(2.0) == 2.0
    assert [path.name.rpartition("-")[0] for path in tmp_path.iterdir()] == [f"{__name__}.told"]


def test_a_numba_that_is_another_within_compiles_and_keeps_nothing(monkeypatch, tmp_path):
    # `_linkable` goes by what numba keeps to itself, which a new version may rename.
    monkeypatch.setattr(compilation_cache, "_folder", lambda: tmp_path)

    def renamed(compiled):
        return compiled.of_another_name

    monkeypatch.setattr(compilation_cache, "_linkable", renamed)

    @kernel
    def loop(x):
        return x + 1.0

    assert loop(2.0) == 3.0
    assert not [*tmp_path.glob("*.nbc")]
