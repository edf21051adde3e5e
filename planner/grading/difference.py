"""Two plans compared by meaning: what is printed differently, not which bytes differ."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from planner.errors import ArgumentError
from planner.plan import Plan

__all__ = ["Difference", "differences"]

_NEAREST = {"kind": "nearest"}  # of plans that say nothing of it


@dataclass(frozen=True, slots=True)
class Difference:
    """One difference in words: what differs, where, and how it was and is."""

    what: str
    where: str
    before: str
    after: str


def differences(before: Plan, after: Plan, tolerance: float = 1e-6) -> tuple[Difference, ...]:
    """Compare two plans.

    Parameters
    ----------
    tolerance
        Relative difference of figures that still counts as equal; places along the field are
        compared with the same tolerance, absolutely.

    Raises
    ------
    ArgumentError
        The tolerance is not a number from 0 to 1.

    Returns
    -------
    tuple of Difference
        Empty when the plans mean the same. File hashes and version numbers do not count: they
        differ whenever anything else does, and sometimes when nothing does.
    """
    if not 0.0 <= tolerance <= 1.0:
        raise ArgumentError(f"--tolerance {tolerance:g}: it must be a number from 0 to 1")
    return tuple(_compare(before, after, tolerance))


def _compare(before: Plan, after: Plan, tolerance: float) -> Iterator[Difference]:
    pairs: list[tuple[str, Any, Any]] = [
        ("printer", before.printer, after.printer),
        ("palette", before.palette.name, after.palette.name),
        ("part", before.part.file, after.part.file),
        ("part volume mm3", before.part.volume_mm3, after.part.volume_mm3),
        ("part bounds mm", before.part.bounds_mm, after.part.bounds_mm),
        ("field", before.gradient.field, after.gradient.field),
        ("profile", before.gradient.profile, after.gradient.profile),
        ("gradient from", before.gradient.start, after.gradient.start),
        ("gradient to", before.gradient.end, after.gradient.end),
        ("blend", before.gradient.blend or _NEAREST, after.gradient.blend or _NEAREST),
        ("working strain", before.stiffness.at_strain, after.stiffness.at_strain),
    ]
    for what, a, b in pairs:
        if not _equal(a, b, tolerance):
            yield Difference(what, "plan", _text(a), _text(b))
    if before.palette.name == after.palette.name and before.palette.sha256 != after.palette.sha256:
        yield Difference(
            "palette content", "plan", before.palette.sha256[:12], after.palette.sha256[:12]
        )
    yield from _compare_materials(before, after, tolerance)
    yield from _compare_regions(before, after, tolerance)
    for name in sorted({*before.checks, *after.checks}):
        a, b = before.checks.get(name), after.checks.get(name)
        if (a is None or a.ok) != (b is None or b.ok):
            yield Difference("check", name, _holds(a), _holds(b))
    a_found = sorted(found.message for found in before.findings)
    b_found = sorted(found.message for found in after.findings)
    if a_found != b_found:
        yield Difference("findings", "plan", str(len(a_found)), str(len(b_found)))
    if not _equal(_targets(before), _targets(after), tolerance):
        yield Difference(
            "unreachable targets", "plan", _text(_targets(before)), _text(_targets(after))
        )


def _compare_materials(before: Plan, after: Plan, tolerance: float) -> Iterator[Difference]:
    volumes = [_volume_by_material(plan) for plan in (before, after)]
    for material in [*volumes[0], *(m for m in volumes[1] if m not in volumes[0])]:
        a, b = volumes[0].get(material), volumes[1].get(material)
        if a is None:
            yield Difference("material added", material, "", f"{_text(b)} mm3")
        elif b is None:
            yield Difference("material removed", material, f"{_text(a)} mm3", "")
        elif not _equal(a, b, tolerance):
            yield Difference("material volume mm3", material, _text(a), _text(b))


def _compare_regions(before: Plan, after: Plan, tolerance: float) -> Iterator[Difference]:
    if len(before.regions) != len(after.regions):
        yield Difference("regions", "plan", str(len(before.regions)), str(len(after.regions)))
        return
    for a, b in zip(before.regions, after.regions, strict=True):
        where = f"region {a.index}"
        if a.printed != b.printed:
            yield Difference("material", where, a.printed, b.printed)
        for what, x, y in (
            ("place along the field", a.field, b.field),
            ("target modulus MPa", a.target_modulus_MPa, b.target_modulus_MPa),
            ("achieved modulus MPa", a.modulus_MPa, b.modulus_MPa),
            ("blend", a.blend or {}, b.blend or {}),
            ("volume mm3", a.volume_mm3, b.volume_mm3),
            ("mass g", a.mass_g, b.mass_g),
        ):
            if not _equal(x, y, tolerance):
                yield Difference(what, where, _text(x), _text(y))


def _volume_by_material(plan: Plan) -> dict[str, float]:
    volumes: dict[str, float] = {}
    for region in plan.regions:
        volumes[region.printed] = volumes.get(region.printed, 0.0) + region.volume_mm3
    return volumes


def _targets(plan: Plan) -> list[Any]:
    return [[missed.field, missed.target_modulus_MPa] for missed in plan.unreachable]


def _holds(check: Any) -> str:
    return "absent" if check is None else "holds" if check.ok else "fails"


def _equal(a: Any, b: Any, tolerance: float) -> bool:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_equal(a[k], b[k], tolerance) for k in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(_equal(x, y, tolerance) for x, y in zip(a, b, strict=True))
    if isinstance(a, (int, float)) and isinstance(b, (int, float)):
        return math.isclose(a, b, rel_tol=tolerance, abs_tol=tolerance)
    return bool(a == b)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return " .. ".join(_text(v) for v in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_text(v)}" for k, v in value.items())
    return str(value)
