"""Which tests are slow: measured, and kept in tests/slow.txt.

python -m benchmarks.slow_tests [RESULTS]

Runs the quick tests and those of tests/slow.txt, and writes there again what takes more than
LIMIT_S of processor time, its other processes included and its fixtures not. QUICK stays quick all
the same, and so do the tests that first notice a mutation in RESULTS, a file of `python -m
benchmarks.mutations`: no shorter one does.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
SLOW = ROOT / "tests/slow.txt"
LIMIT_S = 0.6
QUICK = (
    # The main promises.
    "tests/golden/test_golden.py::test_same_bytes_as_the_golden_record",
    "tests/property/test_grade.py::test_every_shell_of_every_part_is_sound",
    # Noticed a mutation that shorter ones did not.
    "tests/golden/test_behaviour.py::test_as_before[blend-refused]",
    "tests/golden/test_behaviour.py::test_as_before[check]",
    "tests/golden/test_behaviour.py::test_as_before[second-printer]",
    "tests/property/test_coefficients.py::test_hardness_of_other_mixtures_moves",
    "tests/unit/test_interface_error.py::test_a_plan_says_what_its_files_show[distance]",
    "tests/unit/test_solid.py::test_rivlins_tube",
    "tests/unit/test_targets.py::test_a_result_goes_down_a_pipe",
)


class Measure:
    """Notes the processor time of each test, and writes all into a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.found_s = folder, dict[str, float]()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_call(self, item: Any) -> Iterator[None]:
        """Take the times before and after; they have those of processes that have ended."""
        before = sum(os.times()[:4])
        yield
        self.found_s[item.nodeid] = sum(os.times()[:4]) - before

    def pytest_sessionfinish(self) -> None:
        """Write what this process has measured."""
        worker = os.environ.get("PYTEST_XDIST_WORKER", "all")
        (self.folder / worker).write_text(json.dumps(self.found_s))


def pytest_configure(config: pytest.Config) -> None:
    """Be a plugin where the environment asks for one."""
    if "SLOW_TESTS" in os.environ:
        config.pluginmanager.register(Measure(Path(os.environ["SLOW_TESTS"])))


def main() -> None:
    """Measure, and write the list."""
    noticed = set[str]()
    for one in Path(sys.argv[1]).read_text().splitlines() if len(sys.argv) > 1 else ():
        told = json.loads(one)
        noticed |= {told.get(sort, "").removeprefix("killed by ") for sort in ("quick", "slow")}
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "SLOW_TESTS": folder, "PLANNER_SLOW_TESTS": os.devnull}
        command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "-p", "benchmarks.slow_tests"]
        subprocess.run(command, cwd=ROOT, env=env, check=True)
        found_s: dict[str, float] = {}
        for part in Path(folder).iterdir():
            found_s |= json.loads(part.read_text())
    slow = sorted(
        name
        for name, seconds in found_s.items()
        if seconds > LIMIT_S and name not in noticed and not name.startswith(QUICK)
    )
    SLOW.write_text("".join(f"{name}\n" for name in slow))
    print(f"{len(slow)} of {len(found_s)} tests take {sum(found_s[n] for n in slow):.0f} s", end="")
    print(f" of {sum(found_s.values()):.0f} s")


if __name__ == "__main__":
    main()
