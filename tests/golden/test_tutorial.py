"""The tutorial runs as written."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tutorial" / "first-part.md"
BLOCKS = re.findall(r"```(sh|python)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def test_every_block_of_the_tutorial_runs(tmp_path: Path) -> None:
    assert len(BLOCKS) >= 7
    (tmp_path / "samples").symlink_to(ROOT / "samples")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    for language, code in BLOCKS:
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


def test_the_design_loop_runs() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "samples" / "design_loop.py")],
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    rows = [line.split() for line in done.stdout.splitlines()[1:]]
    assert [row[0] for row in rows] == ["log", "linear", "smooth"]
    stiffness = {row[0]: float(row[4]) for row in rows}
    # A linear ramp of modulus leaves the soft end after a short way: far stiffer than log.
    assert stiffness["linear"] > 2.0 * stiffness["log"]
