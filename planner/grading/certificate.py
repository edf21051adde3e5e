"""A plan's folder verified anew, from its files alone."""

import hashlib
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import FileError, PlannerError
from planner.formats.stl import decode_stl
from planner.formats.threemf import read_threemf
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
    """

    part: str
    printer: str
    shells: int
    triangles: int
    checks: Mapping[str, Check]
    problems: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether everything holds."""
        return not self.problems and all(check.ok for check in self.checks.values())

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
        }


def certify(
    folder: str | Path, *, progress: Callable[[str], None] = lambda stage: None
) -> Certificate:
    """Verify a plan's folder: nothing missing, nothing altered, and every shell sound.

    Raises
    ------
    FileError
        There is no plan to verify, or it cannot be read.
    """
    file = plan_file(folder)
    root = file.parent
    plan = read_plan(file)
    problems = list(_misplaced(root, plan))
    soups: dict[str, bytes] = {}
    progress("reading the shells")
    altered = 0
    for region in plan.regions:
        path = root / region.file
        if region.file in soups or not path.is_file():
            continue
        data = path.read_bytes()
        soups[region.file] = data
        if hashlib.sha256(data).hexdigest() != region.sha256:
            altered += 1
            problems.append(f"{region.file}: its content is not what the plan was written with")
    progress("verifying the shells")
    checks = {"files_altered": Check(altered, 0, altered == 0)}
    triangles = 0
    try:
        triangles = sum(len(decode_stl(data, name)) for name, data in soups.items())
        checks |= shell_checks(list(soups.values()), plan.part)
    except FileError as error:
        problems.append(str(error))
    checks |= _region_checks(plan)
    progress("comparing the 3MF")
    mismatched, words = _threemf_mismatches(root, plan, soups)
    checks["threemf_mismatches"] = Check(mismatched, 0, mismatched == 0)
    return Certificate(
        part=plan.part.file,
        printer=plan.printer,
        shells=len(soups),
        triangles=triangles,
        checks=checks,
        problems=(*problems, *words),
    )


def _misplaced(root: Path, plan: Plan) -> list[str]:
    expected = {region.file for region in plan.regions} | {"plan.json", f"{plan.name}.3mf"}
    found = {p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file()}
    words = [f"{name}: the plan names it, but it is missing" for name in sorted(expected - found)]
    strangers = sorted(found - expected - _EXTRA)
    return words + [f"{name}: no part of the plan; remove it" for name in strangers]


def _region_checks(plan: Plan) -> dict[str, Check]:
    """Compare the regions with one another and with the part, as the plan states them."""
    total = sum(region.volume_mm3 for region in plan.regions)
    error = abs(total / plan.part.volume_mm3 - 1.0)
    edges = [region.field for region in plan.regions]
    gaps = sum(a[1] > b[0] + 1e-9 for a, b in itertools.pairwise(edges))
    return {
        "regions_volume_error": Check(error, 1e-6, error <= 1e-6),
        "regions_out_of_order": Check(gaps, 0, gaps == 0),
    }


def _threemf_mismatches(root: Path, plan: Plan, soups: dict[str, bytes]) -> tuple[int, list[str]]:
    """Compare the shells in the 3MF with the STL files, triangle for triangle."""
    path = root / f"{plan.name}.3mf"
    if not path.is_file():
        return 1, []
    try:
        model = read_threemf(path)
    except PlannerError as error:
        return 1, [str(error)]
    objects = {item.name: item for item in model.objects}
    words = [f"{path.name}: {remark}" for remark in model.remarks]
    mismatched = len(words)
    for file, data in soups.items():
        stem = Path(file).stem
        if stem not in objects:
            mismatched += 1
            words.append(f"{path.name}: it has no object {stem}")
            continue
        item = objects.pop(stem)
        ours = np.asarray(item.vertices, dtype=np.float32)[item.faces]
        # Text keeps each coordinate to about one unit in the last place of float32.
        theirs = decode_stl(data, file)
        if ours.shape != theirs.shape or not np.allclose(ours, theirs, rtol=3e-7, atol=1e-9):
            mismatched += 1
            words.append(f"{path.name}: object {stem} is not the shell in {file}")
    for stem in objects:
        mismatched += 1
        words.append(f"{path.name}: object {stem} has no STL")
    return mismatched, words
