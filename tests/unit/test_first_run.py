"""The first run after installation: what other processes compile for it."""

import json
import os
import subprocess
import sys

import pytest

from planner.cli import plans as first_run

RECORD = """
import json, sys
import numba
from numba.core import event

compiled = []

class Record(event.Listener):
    def on_start(self, event):
        dispatcher = event.data["dispatcher"]
        name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__name__}"
        inner = dispatcher.targetoptions.get("no_cpython_wrapper", False)
        if name.startswith("planner."):
            compiled.append((name, str(event.data["args"]), inner))

    def on_end(self, event):
        pass

event.register("numba:compile", Record())
"""
GRADE = """
import planner
planner.grade(sys.argv[1], from_="Tango", to="Vero").write(sys.argv[2])
"""
REHEARSE = """
from planner.cli.plans import rehearse
rehearse(int(sys.argv[1]), int(sys.argv[2]))
"""


def compiled(code, *arguments, cache):
    """Run code in a process and return what it had to compile: (name, types, whether inner)."""
    done = subprocess.run(
        [sys.executable, "-c", f"{RECORD}{code}\nprint(json.dumps(compiled))", *arguments],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [tuple(each) for each in json.loads(done.stdout.splitlines()[-1])]


@pytest.mark.long
def test_what_is_rehearsed_is_not_compiled_again(samples, tmp_path):
    rehearsed = compiled(REHEARSE, "0", "1", cache=tmp_path / "kept")
    part = str(samples / "finger.stl")
    own = compiled(GRADE, part, str(tmp_path / "out"), cache=tmp_path / "kept")
    assert own
    assert not [name for name, *_ in own if "voxels" in name or "formats" in name]
    assert len({name for name, *_ in rehearsed}) > 2 * len({name for name, *_ in own})
    # Two processes that compile a function for the same types keep the same; for other types
    # they could take each other's: so each has one set of types.
    both = {(name, types) for name, types, _ in (*rehearsed, *own)}
    assert len({name for name, _ in both}) == len(both)
    # Only inner kernels are not kept: they are compiled with each kernel that calls them.
    kept = [name for name, _, inner in (*rehearsed, *own) if not inner]
    assert sorted(set(kept)) == sorted(kept)


@pytest.mark.parametrize(
    ("processors", "shares"),
    [
        (1, []),
        (2, [(0, 1)]),
        (3, [(0, 2), (1, 2)]),
        (8, [(0, 2), (1, 2)]),
    ],
)
def test_free_processors_rehearse_and_nothing_is_heard_of_them(monkeypatch, processors, shares):
    started = []
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(processors)), raising=False)
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
    first_run._start()
    assert [command[:2] for command in started] == [[sys.executable, "-c"]] * len(shares)
    for command, share in zip(started, shares, strict=True):
        assert str(share) in command[2]
        compile(command[2], "code", "exec")


def test_a_run_goes_on_where_no_process_can_be_started(monkeypatch):
    def refused(*_, **__):
        raise OSError("no more processes")

    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1}, raising=False)
    monkeypatch.setattr(subprocess, "Popen", refused)
    first_run._start()


LOOPS = """
import gc, json, sys
from planner.compilation_cache import nothing_kept
from planner.numerics import kernel

first = nothing_kept()

@kernel
def twice(x):
    return x + x

@kernel
def thrice(x):
    return twice(x) + x

results = [thrice(2), thrice(2.5), gc.isenabled()]
gc.disable()
results += [thrice(2 + 1j).real, gc.isenabled()]
print(json.dumps([results, first, nothing_kept()]))
"""


@pytest.mark.slow
def test_a_first_run_is_told_and_compiling_leaves_garbage_collection_as_it_was(tmp_path):
    script, kept = tmp_path / "loops.py", tmp_path / "kept"
    script.write_text(LOOPS)

    def run():
        place = {"NUMBA_CACHE_DIR": str(kept)}
        command = [sys.executable, str(script)]
        return json.loads(subprocess.check_output(command, env={**os.environ, **place}))

    right = [6, 7.5, True, 6.0, False]
    assert run() == [right, True, False]
    assert run() == [right, False, False]  # nothing to compile
    script.write_text(LOOPS.replace("return x + x", "return 2 * x"))
    assert run() == [right, False, False]  # no installation, but a loop that changed


@pytest.mark.slow  # it takes long only where nothing is compiled yet, as in a first quick run
def test_every_stage_can_be_rehearsed():
    first_run.rehearse(0, 1)
