"""The first run after installation: what other processes compile for it."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import first_run
from planner import compilation_cache
from tests.conftest import compile_ahead

LISTED = json.loads(first_run.LISTED.read_bytes())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder in which the commands can run."""
    return tmp_path_factory.mktemp("commands")


@pytest.mark.slow
@pytest.mark.parametrize("command", first_run.COMMANDS)
def test_the_list_is_what_a_command_meets(command, folder):
    if command == "simulate" and not (folder / "graded").exists():
        first_run.loops_met("grade", folder)
    met = first_run.loops_met(command, folder)
    assert met == LISTED[command], "python -m benchmarks.first_run writes the list again"


def test_types_of_the_list_name_the_same_machine_code_as_in_a_run():
    assert set(LISTED) == set(first_run.COMMANDS)
    for name, types in [loop for loops in LISTED.values() for loop in loops]:
        values = tuple(map(compilation_cache._of_type, types))
        again = json.dumps([first_run.told(value) for value in values])
        assert json.loads(again) == types
        assert compilation_cache._named(name)._path(values) is not None


@pytest.mark.parametrize("layout", ["C", "A"])
@pytest.mark.parametrize("writeable", [True, False])
def test_an_array_of_the_list_is_as_it_was(layout, writeable):
    array = np.zeros((3, 4), np.int32) if layout == "C" else np.zeros((3, 8), np.int32)[:, ::2]
    array.flags.writeable = writeable
    like = compilation_cache._of_type(first_run.told(array))
    assert compilation_cache._type_word(like) == compilation_cache._type_word(array)


LOOPS = """
import gc, json, sys
from planner.numerics import kernel

@kernel
def twice(x):
    return x + x

@kernel
def thrice(x):
    return twice(x) + x

results = [thrice(2), thrice(2.5), gc.isenabled()]
gc.disable()
results += [thrice(2 + 1j).real, gc.isenabled()]
print(json.dumps(results))
"""


@pytest.mark.slow
def test_compiling_leaves_garbage_collection_as_it_was(tmp_path):
    script, kept = tmp_path / "loops.py", tmp_path / "kept"
    script.write_text(LOOPS)

    def run():
        place = {"NUMBA_CACHE_DIR": str(kept)}
        command = [sys.executable, str(script)]
        return json.loads(subprocess.check_output(command, env={**os.environ, **place}))

    assert run() == run() == [6, 7.5, True, 6.0, False]
    (at,) = kept.iterdir()
    before = set(at.glob("*.nbc"))
    assert len(before) == 3
    script.write_text(LOOPS.replace("return x + x", "return 2 * x"))
    assert run() == [6, 7.5, True, 6.0, False]
    assert len(set(at.glob("*.nbc")) - before) == 3


@pytest.fixture
def started(monkeypatch, tmp_path):
    """Return the list of what is started where two processors are free and no loop is kept."""
    commands = []
    monkeypatch.setattr(compilation_cache, "_folder", lambda: tmp_path)
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: commands.append(command))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1}, raising=False)
    return commands


@pytest.mark.parametrize(("processors", "shares"), [(1, 0), (2, 1), (3, 2), (8, 2)])
def test_free_processors_compile_all_that_is_listed(monkeypatch, started, processors, shares):
    met = []
    monkeypatch.setattr(compilation_cache.Loop, "_entry", lambda loop, _: met.append(loop))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(processors)), raising=False)
    compile_ahead("grade", "diagnose")
    assert [command[:2] for command in started] == [[sys.executable, "-c"]] * shares
    for *_, code in started:
        exec(code, {})
    listed = [compilation_cache._named(name) for name, _ in LISTED["grade"] + LISTED["diagnose"]]
    assert set(met) == (set(listed) if shares else set())
    assert len(met) == (len(listed) if shares else 0)
    assert not shares or met[0] is listed[-1]  # the command itself begins at the other end


def test_nothing_is_started_where_all_but_one_are_kept(started, tmp_path):
    names = [name for name, _ in LISTED["diagnose"]]
    for name in names[1:]:
        (tmp_path / f"{name}-0123.nbc").touch()
    compile_ahead("diagnose")
    assert not started
    (tmp_path / f"{names[1]}-0123.nbc").unlink()
    compile_ahead("diagnose")
    assert len(started) == 1


def test_nothing_is_started_where_nothing_can_be_kept(monkeypatch, started):
    monkeypatch.setattr(compilation_cache, "_folder", lambda: None)
    compile_ahead("grade")
    assert not started


def test_a_run_goes_on_where_no_process_can_be_started(monkeypatch, started):
    def refused(*_, **__):
        raise OSError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", refused)
    compile_ahead("grade")
