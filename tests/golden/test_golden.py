"""The same input, options and version give the same bytes.

After a change that is meant to change the files: ``PLANNER_UPDATE_GOLDEN=1 pytest tests/golden``.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import planner
from planner.testing import assert_golden, assert_same_plan, golden_record

HERE = Path(__file__).parent
JOBS = {
    "finger-log": ("finger.stl", {"from_": "Tango", "to": "Vero", "axis": "x"}),
    "dogbone-bands": ("dogbone.stl", {"from_": "Vero", "to": "Tango", "bands": 10}),
    "gripper-tilted": ("gripper.stl", {"from_": "FLX9740", "to": "RGD8425", "axis": "1,0,2"}),
    "finger-radial": (
        "finger.stl",
        {"from_": "Vero", "to": "Tango", "field": "radial: line=0 8 8 1 0 0", "pitch_mm": 1.0},
    ),
    "dogbone-dither": (
        "dogbone.stl",
        {"from_": "FLX9750", "to": "FLX9785", "blend": "dither", "cell_mm": 1.2},
    ),
    "finger-mix": ("finger.stl", {"from_": "Tango", "to": "Vero", "blend": "mix", "bands": 12}),
}


@pytest.mark.parametrize("job", JOBS)
def test_same_bytes_as_the_golden_record(job: str, samples: Path, tmp_path: Path) -> None:
    part, options = JOBS[job]
    folder = planner.grade(samples / part, **options).write(tmp_path / job)
    update = os.environ.get("PLANNER_UPDATE_GOLDEN") == "1"
    assert_golden(folder, HERE / f"{job}.json", update=update)


@pytest.mark.slow
def test_same_bytes_in_another_process_and_place(samples: Path, tmp_path: Path) -> None:
    part, options = JOBS["finger-log"]
    plan = planner.grade(samples / part, **options)
    here = plan.write(tmp_path / "here", page=planner.plan_page(plan))
    elsewhere = tmp_path / "a place with spaces"
    elsewhere.mkdir()
    (elsewhere / part).write_bytes((samples / part).read_bytes())
    command = [sys.executable, "-m", "planner", "grade", part, "--from", "tango", "--to", "vero"]
    subprocess.run(
        [*command, "--axis", "x", "--quiet", "-o", "out"],
        cwd=elsewhere,
        env={**os.environ, "PYTHONHASHSEED": "7", "NUMBA_NUM_THREADS": "1"},
        check=False,
    )
    assert golden_record(here) == golden_record(elsewhere / "out")
    threemf = "finger.3mf"
    assert (here / threemf).read_bytes() == (elsewhere / "out" / threemf).read_bytes()


def test_an_altered_file_is_named(samples: Path, tmp_path: Path) -> None:
    part, options = JOBS["finger-log"]
    folder = planner.grade(samples / part, **options).write(tmp_path / "out")
    golden = tmp_path / "golden.json"
    assert_golden(folder, golden, update=True)
    assert set(json.loads(golden.read_text())["files"]) >= {"plan.json", "finger.3mf", "HOWTO.md"}
    (folder / "plan.json").write_bytes((folder / "plan.json").read_bytes() + b"\n")
    with pytest.raises(AssertionError, match=r"plan\.json"):
        assert_golden(folder, golden)
    assert_same_plan(folder, planner.grade(samples / part, **options))
