"""The tutorial runs as written."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


def blocks(page: str) -> list[tuple[str, str]]:
    text = (ROOT / "docs" / "tutorial" / page).read_text(encoding="utf-8")
    return re.findall(r"```(sh|python)\n(.*?)```", text, re.DOTALL)


@pytest.mark.parametrize(
    "page",
    [
        "first-part.md",
        pytest.param("bend-a-finger.md", marks=pytest.mark.slow),
        pytest.param("strip-to-s.md", marks=pytest.mark.slow),
    ],
)
def test_every_block_of_the_tutorial_runs(page: str, tmp_path: Path) -> None:
    assert len(blocks(page)) >= 5
    (tmp_path / "samples").symlink_to(ROOT / "samples")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    for language, code in blocks(page):
        command = ["sh", "-c", code] if language == "sh" else [sys.executable, "-c", code]
        done = subprocess.run(
            command,
            cwd=tmp_path,
            env={**os.environ, "PATH": path},
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        # 0 is done without a finding: cuts have moved off whatever would have left a sliver.
        assert done.returncode == 0, f"{code}\n{done.stdout}\n{done.stderr}"


def printed(sample: str, *arguments: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, str(ROOT / "samples" / sample), *arguments],
        capture_output=True, encoding="utf-8", check=True,
    )  # fmt: skip
    return done.stdout.splitlines()


def test_the_design_loop_runs() -> None:
    """On cells so large that it takes seconds; what is printed comes within 1 % all the same."""
    rows = [re.findall(r"[\d.]+", line) for line in printed("design_loop.py", "6")]
    assert [float(row[0]) for row in rows] == [8.0, 12.0, 16.0]
    for wanted, reached, *_ in rows:
        # Reached is printed to hundredths.
        assert abs(float(reached) - float(wanted)) < 0.01 * float(wanted) + 0.005
    soft, stiff = (np.array([float(row[column]) for row in rows]) for column in (2, 3))
    assert (soft < 0.01 * stiff).all()
    assert soft[0] > soft[1:].max(), "more travel takes a softer tip"
