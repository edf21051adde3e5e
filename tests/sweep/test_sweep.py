"""Hard solids along all fields and blends: refused in a line, or cut as an own audit finds it.

What a plan says of itself has to be what the audit finds: faults that a plan tells are told, those
that it does not tell are failures. `pytest -m long tests/sweep` takes 400 cases, some twenty
minutes; `python -m tests.sweep.test_sweep FIRST LAST` prints each of some cases as a line of JSON.
"""

import contextlib
import io
import json
import struct
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.cli import run
from tests.sweep.audit import SHAPE, audit
from tests.sweep.fields import gradients
from tests.sweep.solids import FAMILIES, surface_of

BLENDS = (
    ("--blend", "nearest"),
    ("--blend", "nearest", "--bands", "10"),
    ("--blend", "bands:2"),
    ("--blend", "mix", "--bands", "6"),
    ("--blend", "dither"),
)
SHAPE_CHECKS = ("shells_unsound", "volume_error", "interfaces_unmatched", "overlap")
SOLIDS = ("body_in_body",)  # whose winding does not tell whether they are hollow
QUICK = (0, 2, 6, 8, 10, 16, 22, 27, 30, 33, 36, 85)
LONG = (4, 26, 34)
MANY = 400


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes
    ----------
    told
        Checks of shape that the plan says fail.
    told_later
        Those that `planner check` finds to fail in the plan's folder, and any disagreement with it.
    faults
        What the audit finds.
    """

    number: int
    solid: str
    command: str
    code: int
    said: str
    told: tuple[str, ...]
    told_later: tuple[str, ...]
    faults: tuple[str, ...]
    cpu_s: float

    @property
    def verdict(self) -> str:
        """Refused, sound, told; or a failure: silent, false alarm, wrong, disagrees, internal."""
        if self.code == 2:
            lines = self.said.strip().splitlines()
            one = len(lines) == 1 and len(lines[0]) < 2000 and "Traceback" not in lines[0]
            return "refused" if one else "internal"
        if self.code not in (0, 1) or "Traceback" in self.said:
            return "internal"
        if self.told != self.told_later:
            return "disagrees"
        of_shape = [fault for fault in self.faults if fault.startswith(SHAPE)]
        if len(self.faults) > len(of_shape):
            return "wrong"
        if of_shape:
            return "told" if self.told else "silent"
        return "false alarm" if self.told else "sound"


def examine(number: int, folder: Path) -> Outcome:
    """Make a case, run the command on it, and audit what it has written."""
    rng = np.random.default_rng(number)
    family = list(FAMILIES)[number % len(FAMILIES)]
    triangles = FAMILIES[family](rng).astype(np.float32).astype(np.float64)
    part = folder / f"{family}.stl"
    part.write_bytes(stl_bytes(triangles))
    kinds = gradients(surface_of(family, triangles), rng)
    kind = list(kinds)[int(rng.integers(len(kinds)))]
    gradient = kinds[kind]
    blend = BLENDS[int(rng.choice(len(BLENDS), p=(0.35, 0.2, 0.15, 0.15, 0.15)))]
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    pitch_mm = size / 16
    options = [*gradient.options, *blend]
    if blend[1] == "dither":
        options += ["--cell", repr(pitch_mm)]
    elif gradient.curved:
        options += ["--pitch", repr(pitch_mm)]
    target = folder / "out"
    command = ["grade", str(part), "--from", "Tango", "--to", "Vero", *options]
    command += ["--force-oversize", "--no-page"]
    command += ["--bodies", "solids"] if family in SOLIDS else []
    begin, said = time.process_time(), io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = run([*command, "-o", str(target)])
    cpu_s = time.process_time() - begin
    told: tuple[str, ...] = ()
    told_later: tuple[str, ...] = ()
    faults: list[str] = []
    if target.exists():
        told = failing(json.loads((target / "plan.json").read_text(encoding="utf-8")))
        with contextlib.redirect_stdout(io.StringIO()) as certificate:
            run(["check", str(target), "--json"])
        told_later = failing(json.loads(certificate.getvalue()))
        faults = audit(target, triangles, gradient, pitch_mm, number)
    elif code != 2:
        faults = ["files: nothing was written"]
    shown = " ".join(f'"{word}"' if " " in word else word for word in command)
    said_lines = "\n".join(
        line
        for line in said.getvalue().splitlines()
        if not line.startswith(("note:", "warning:", "finding:"))
    )
    return Outcome(
        number, f"{family} (case {number})", shown.replace(f"{folder}/", ""), code, said_lines,
        told, told_later, tuple(faults), round(cpu_s, 2),
    )  # fmt: skip


def failing(document: dict[str, Any]) -> tuple[str, ...]:
    """Return which checks of shape, or of a plan against its files, a document says fail."""
    names = (*SHAPE_CHECKS, "files_altered", "plan_disagreements")
    checks = document["checks"]
    return tuple(name for name in names if name in checks and not checks[name]["ok"])


def stl_bytes(triangles: np.ndarray) -> bytes:
    """Return a binary STL file, normals left to its reader."""
    rows = np.zeros((len(triangles), 50), np.uint8)
    rows[:, 12:48] = triangles.astype("<f4").reshape(-1, 9).view(np.uint8)
    return b"\0" * 80 + struct.pack("<I", len(triangles)) + rows.tobytes()


FAILURES = {"silent", "false alarm", "wrong", "disagrees", "internal"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "number", [*QUICK, *(pytest.param(number, marks=pytest.mark.long) for number in LONG)]
)
def test_a_hard_solid_is_refused_or_cut_as_the_plan_says(number, tmp_path):
    outcome = examine(number, tmp_path)
    assert outcome.verdict not in FAILURES, outcome


@pytest.mark.long
def test_hard_solids_are_refused_or_cut_as_their_plans_say(tmp_path):
    outcomes = []
    for number in range(MANY):
        (tmp_path / str(number)).mkdir()
        outcomes.append(examine(number, tmp_path / str(number)))
    sys.stdout.write(f"{Counter(outcome.verdict for outcome in outcomes)}\n")
    failed = [outcome for outcome in outcomes if outcome.verdict in FAILURES]
    assert not failed, "\n".join(map(str, failed))


def main() -> None:
    """Print cases as lines of JSON."""
    first, last = (int(word) for word in sys.argv[1:3])
    for number in range(first, last):
        with tempfile.TemporaryDirectory() as scratch:
            begin = time.process_time()
            outcome = examine(number, Path(scratch))
            audit_s = time.process_time() - begin - outcome.cpu_s
        row = {"verdict": outcome.verdict, **asdict(outcome), "audit_s": round(audit_s, 2)}
        sys.stdout.write(f"{json.dumps(row)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
