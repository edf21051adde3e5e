"""Every BLAS runs on one thread in solutions, whatever was loaded before."""

import json
import os
import subprocess
import sys

import pytest
import trimesh

# A list of libraries that is taken before scipy's BLAS is loaded does not have it.
LOADED_BEFORE = {
    "a list": "import numpy, threadpoolctl; early = threadpoolctl.ThreadpoolController()",
    "scipy": "import scipy.linalg",
}
SOLVE = """
import json, sys
import planner
from planner.simulation import sparse_cholesky
from threadpoolctl import threadpool_info

def threads():
    return {i["filepath"]: i["num_threads"] for i in threadpool_info() if i["user_api"] == "blas"}

class Stop(Exception):
    pass

seen = {"simulate": [], "factor": [], "solve": [], "design": []}

def watched(name, loop):
    def run(*arguments):
        seen[name].append(threads())
        return loop(*arguments)
    return run

def stop(stage):
    seen["design"].append(threads())
    if "gradient" in stage:
        raise Stop

sparse_cholesky._factor_fronts = watched("factor", sparse_cholesky._factor_fronts)
sparse_cholesky._solve = watched("solve", sparse_cholesky._solve)
held = {"fix": "x=min", "load": "x=max: 0,0,-0.01 N"}
planner.simulate(
    sys.argv[1], material="FLX9795", **held, cell_mm=4.0, steps=1, compare_cells=False,
    progress=lambda stage: seen["simulate"].append(threads()),
)
after = [threads()]
try:
    planner.design(
        sys.argv[1], from_="Tango", to="Vero", **held, target="x=max uz=-1 mm", cell_mm=4.0,
        progress=stop,
    )
except Stop:
    after.append(threads())
print(json.dumps([seen, after]))
"""


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one processor: one thread anyway")
@pytest.mark.parametrize(
    "before",
    [LOADED_BEFORE["a list"], pytest.param(LOADED_BEFORE["scipy"], marks=pytest.mark.slow)],
    ids=LOADED_BEFORE,
)
def test_every_library_has_one_thread_in_solutions_and_its_own_number_after(before, tmp_path):
    part = tmp_path / "bar.stl"
    trimesh.creation.box((16.0, 4.0, 4.0)).export(part)
    done = subprocess.run(
        [sys.executable, "-c", before + SOLVE, str(part)],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "2", "MKL_NUM_THREADS": "2"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    seen, (simulated, stopped) = json.loads(done.stdout)
    assert set(simulated.values()) == {2}
    assert stopped == simulated  # after an error too
    assert all(seen.values())
    for times in seen.values():
        for threads in times:
            assert threads == dict.fromkeys(simulated, 1)
