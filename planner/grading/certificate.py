"""A plan's folder verified anew, from its files alone."""

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.arrays import Float32Array, FloatArray
from planner.errors import FileError, MeshError
from planner.formats.stl import decode_stl
from planner.grading.agreement import region_problems, shell_problems, threemf_problems
from planner.grading.verification import shell_checks
from planner.plan import Check, Plan, plan_file, read_plan

__all__ = ["Certificate", "certify"]

_EXTRA = {"report.html", "HOWTO.md"}


@dataclass(frozen=True, slots=True)
class Certificate:
    """What was verified, and what does not hold.

    Attributes
    ----------
    checks
        By name; each with its value and limit.
    problems
        In words, with the file.
    reported
        What the plan itself reported when it was made: findings and targets out of reach.
    """

    part: str
    printer: str
    shells: int
    triangles: int
    checks: Mapping[str, Check]
    problems: tuple[str, ...]
    reported: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether everything holds, and the plan reported nothing."""
        held = all(check.ok for check in self.checks.values())
        return held and not self.problems and not self.reported

    def document(self) -> dict[str, Any]:
        """Return the certificate as JSON holds it."""
        return {
            "schema": 1,
            "ok": self.ok,
            "part": self.part,
            "printer": self.printer,
            "shells": self.shells,
            "triangles": self.triangles,
            "checks": {
                name: {"value": c.value, "limit": c.limit, "ok": c.ok}
                for name, c in self.checks.items()
            },
            "problems": list(self.problems),
            "reported": list(self.reported),
        }


def certify(
    folder: str | Path, *, progress: Callable[[str], None] = lambda stage: None
) -> Certificate:
    """Verify a plan's folder: nothing missing, nothing altered, and every shell sound.

    Each shell is verified as a reader finds it, and held against what the plan says of it: its
    material, volume, triangles and place. Where bands share a file, their volumes are verified
    together.

    Raises
    ------
    FileError
        There is no plan to verify, or it cannot be read.
    """
    file = plan_file(folder)
    root = file.parent
    plan = read_plan(file)
    problems = list(_misplaced(root, plan))
    disagreements = list(region_problems(plan))
    progress("reading the shells")
    altered, shells = 0, dict[str, Float32Array | FloatArray]()
    for name, expected in {region.file: region.sha256 for region in plan.regions}.items():
        try:
            data = _inside(root, name).read_bytes()
            if hashlib.sha256(data).hexdigest() != expected:
                altered += 1
                problems.append(f"{name}: its content is not what the plan was written with")
            shells[name] = decode_stl(data, name)
        except FileNotFoundError:
            continue  # told as missing already
        except (OSError, FileError) as error:
            problems.append(str(error))
    progress("verifying the shells")
    checks = {"files_altered": Check(altered, 0, altered == 0)}
    if shells and plan.part.volume_mm3 > 0.0:
        checks |= shell_checks(list(shells.values()), plan.part)
        disagreements += shell_problems(plan, shells)
    else:
        problems.append("there is no shell that can be verified")
    progress("comparing the 3MF")
    mismatches = list(threemf_problems(root / f"{plan.name}.3mf", plan, shells))
    checks["plan_disagreements"] = Check(len(disagreements), 0, not disagreements)
    checks["threemf_mismatches"] = Check(len(mismatches), 0, not mismatches)
    return Certificate(
        part=plan.part.file,
        printer=plan.printer,
        shells=len(shells),
        triangles=sum(map(len, shells.values())),
        checks=checks,
        problems=(*problems, *disagreements, *mismatches),
        reported=tuple(_reported(plan)),
    )


def _inside(root: Path, name: str) -> Path:
    path = (root / name).resolve()
    if not path.is_relative_to(root.resolve() / "stl"):
        raise MeshError(
            f"{name}: the plan names a shell outside the folder's stl/; it was not read"
        )
    return path


def _misplaced(root: Path, plan: Plan) -> Iterator[str]:
    expected = {region.file for region in plan.regions} | {"plan.json", f"{plan.name}.3mf"}
    found = {p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file()}
    for name in sorted(expected - found):
        yield f"{name}: the plan names it, but it is missing"
    for name in sorted(found - expected - _EXTRA):
        yield f"{name}: no part of the plan; remove it"


def _reported(plan: Plan) -> Iterator[str]:
    for finding in plan.findings:
        yield finding.message
    for missed in plan.unreachable:
        low, high = missed.target_modulus_MPa
        yield f"target {low:.3g} .. {high:.3g} MPa is out of reach of {missed.nearest}"
    for name, check in plan.checks.items():
        if not check.ok and not plan.findings:  # findings say it better
            yield f"check {name} did not hold: {check.value:.3g}, limit {check.limit:.3g}"
