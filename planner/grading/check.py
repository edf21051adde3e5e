"""Plans checked and compared: from a folder's files alone, and one against another."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import FileError, PlannerError, within
from planner.formats.files import path_within
from planner.formats.mesh_file import decode_stl
from planner.formats.outputs import is_as_written, is_scratch
from planner.formats.threemf import read_threemf
from planner.glance import counted, one_line, outcome
from planner.grading.profile import profile_of
from planner.mesh.mesh import JoinedShells, Measures, Mesh, join_shells, measure, weld_points
from planner.numerics import FloatArray, Int32Array, Point
from planner.palette import DENSEST_G_CM3
from planner.plan import (
    Check,
    PartGraded,
    Plan,
    Region,
    Triangles,
    plan_file,
    read_plan,
    read_shell,
)
from planner.voxels.columns import grid_for, voxel_counts

__all__ = ["Certificate", "Difference", "check", "diff", "plan_checks", "shell_checks"]


# ------------------------------------------------------------------------------------------------
# Whether shells are sound, and fill the part without gap or overlap, as readers find them.


_VOLUME_ERROR_LIMIT = 1e-6
"""Of the shells' volumes against the part's: what rounding to float32 leaves on a part of any
shape that fits a tray; nine digits in plan.json are finer."""

_OVERLAP_LIMIT = 1e-9
_COLUMNS_ACROSS = 512  # of the longest side: 2e5 columns over a cube, a fraction of a second


def shell_checks(shells: JoinedShells, part: Mesh | PartGraded) -> dict[str, Check]:
    """Verify a part's shells as they stand in their files.

    Parameters
    ----------
    shells
        As the readers of the files find them, at least one.
    part
        The part they were cut from; its volume is above 0.

    Returns
    -------
    dict
        ``shells_unsound``: shells that are not closed, each edge used exactly once each way,
        without degenerate or duplicate triangles, the right way out: what manifold3d, too, takes
        as a manifold.
        ``volume_error``: sum of the shells' volumes against the part's, relative.
        ``interfaces_unmatched``: 0 when all opposite triangles of neighbours cancel exactly and
        the part's own surface, by area and volume, is what remains.
        ``overlap``: volume that two shells share, of the part's. Shells whose boundaries cancel
        have winding numbers that add up to the part's, so it can differ from 0 only where a
        shell is turned inside out in places; it is measured on columns of voxels.
    """
    unsound = sum(not shells.sound(number) for number in range(len(shells.faces)))
    fit = interfaces_cancel(shells, part)
    error = abs(sum(float(m.volume_mm3[0]) for m in shells.measures) / part.volume_mm3 - 1.0)
    shared = _shared_mm3(shells) / part.volume_mm3
    return {
        "shells_unsound": Check(unsound, 0, unsound == 0),
        "volume_error": Check(error, _VOLUME_ERROR_LIMIT, error <= _VOLUME_ERROR_LIMIT),
        "interfaces_unmatched": Check(int(not fit), 0, fit),
        "overlap": Check(shared, _OVERLAP_LIMIT, shared <= _OVERLAP_LIMIT),
    }


def interfaces_cancel(shells: JoinedShells, part: Mesh | PartGraded) -> bool:
    """Tell whether shells fill a part and touch triangle for triangle.

    Exactly opposite triangles then cancel, and what remains is closed and the part's own surface.
    An interface that does not match leaves two surfaces more: area gives it away, also where both
    together enclose nothing. Volume and area may differ by what rounding the cuts' points to
    float32 can cause.

    Parameters
    ----------
    shells
        All shells of the part.
    part
        The part they were cut from, in the same place: a mesh, or a record of its volume and area,
        with which any position may have been moved by rounding.
    """
    outside = shells.outside
    vertices, moved = outside.vertices, outside.faces
    if isinstance(part, Mesh):
        # Positions of the part come first; rounding has moved only what is not among them.
        own = len(part.vertices)
        _, index = weld_points(np.concatenate([part.vertices, vertices]).astype(np.float32))
        new = index[own:] > index[:own].max(initial=-1)
        moved = moved.compress(new.take(moved).any(axis=1), axis=0)
    strayed_mm2 = float(measure(vertices, moved).area_mm2[0])
    corners = vertices.take(moved, axis=0)
    sides_mm = float(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).sum())
    spacing_mm = float(np.spacing(np.float32(np.abs(vertices).max(initial=0.0))))
    extent_mm = float(np.ptp(outside.bounds_mm, axis=0).max()) if len(vertices) else 0.0
    digits = 1e-12 * part.area_mm2
    return (
        shells.outside_closed
        and abs(outside.volume_mm3 - part.volume_mm3)
        <= strayed_mm2 * spacing_mm + digits * extent_mm
        and abs(outside.area_mm2 - part.area_mm2) <= sides_mm * spacing_mm + digits
    )


def _shared_mm3(shells: JoinedShells) -> float:
    """Measure on columns what lies in more than one shell: what is left bounds all together."""
    points = shells.vertices.astype(np.float64)
    bounds_mm = _union([found.bounds_mm[0] for found in shells.measures])
    grid = grid_for(bounds_mm, float(np.ptp(bounds_mm, axis=0).max()) / _COLUMNS_ACROSS)
    whole, *each = voxel_counts(points, (shells.left, *shells.faces), grid)
    return abs(sum(each) - whole) * grid.voxel_mm3


# ------------------------------------------------------------------------------------------------
# Whether a plan's files say what its plan.json says.


_DIGITS = 1e-8  # of places along the field, and of targets, likewise
_PLACE_ERROR_MM = 1e-3  # far below a pixel, far above float32 on any tray
_PLACE_ERROR = 2.0**-22  # of a coordinate: float32 on parts larger than any tray


def plan_checks(
    plan: Plan, files: Sequence[str], shells: JoinedShells, placed: Mesh | None = None
) -> tuple[dict[str, Check], tuple[str, ...]]:
    """Verify a plan's shells, and hold them against what plan.json says of them.

    Both ``planner grade`` and ``planner check`` call it, so that they cannot disagree.

    Parameters
    ----------
    plan
        As plan.json gives it back, with nine digits; what its own checks say does not count.
    files, shells
        The files that can be read, by name, and the shells as their readers find them.
    placed
        The part as it was cut, where it is at hand: interfaces are then held against its very
        positions as well.

    Returns
    -------
    checks
        Those of `shell_checks`, if there are shells, and ``plan_disagreements``.
    problems
        What the last one counts, in words.
    """
    measures = dict(zip(files, shells.measures, strict=True))
    whole_mm3 = sum(float(found.volume_mm3[0]) for found in measures.values())
    problems = list(_region_problems(plan, whole_mm3))
    checks = {}
    if files and plan.part.volume_mm3 > 0.0:
        checks = shell_checks(shells, plan.part)
        if placed is not None and not interfaces_cancel(shells, placed):
            checks["interfaces_unmatched"] = Check(1, 0, False)
        problems += _shell_problems(plan, measures, dict(zip(files, shells.faces, strict=True)))
    checks["plan_disagreements"] = Check(len(problems), 0, not problems)
    return checks, tuple(problems)


def _region_problems(plan: Plan, whole_mm3: float) -> Iterator[str]:
    """Hold a plan's regions against one another and against the part.

    Where they have what the shells have, `whole_mm3`, the check of volumes tells what is off.
    """
    if not plan.regions:
        yield "plan.json: it has no regions"
        return
    total = sum(region.volume_mm3 for region in plan.regions)
    wholes = (plan.part.volume_mm3, whole_mm3)
    if not any(math.isclose(total, whole, rel_tol=_VOLUME_ERROR_LIMIT) for whole in wholes):
        yield (
            f"plan.json: its regions have {total:.9g} mm3 in all, the part "
            f"{plan.part.volume_mm3:.9g} mm3"
        )
    for before, after in itertools.pairwise(plan.regions):
        together = before.field == after.field and _dealt(before) and _dealt(after)
        if before.field[1] > after.field[0] + 1e-9 and not together:
            yield f"plan.json: region {after.index} begins before region {before.index} ends"
    densities, profile = dict[str, float](), profile_of(plan.gradient.profile)
    for region in plan.regions:
        where = f"plan.json: region {region.index}"
        mass = region.mass_g or 0.0  # also of one that is not known: then of none of its material
        density = 1000.0 * mass / (region.volume_mm3 or math.nan)
        usual = densities.setdefault(region.printed, density)
        possible = region.mass_g is None or 0.0 < density < DENSEST_G_CM3
        if not (possible and math.isclose(density, usual, rel_tol=1e-6)):
            yield (
                f"{where}: its mass, {mass:.4g} g, is not that of "
                f"{region.volume_mm3:.4g} mm3 of {region.printed}"
            )
        low, high = region.modulus_interval_MPa
        softest, stiffest = region.target_modulus_MPa
        error = [region.modulus_MPa / target - 1.0 for target in (stiffest, softest)]
        told = f"{where}: its modulus, {region.modulus_MPa:.4g} MPa,"
        if not low <= region.modulus_MPa <= high:
            yield f"{told} is not in its interval, {low:.4g} .. {high:.4g} MPa"
        # Bands in turn have the target of their period, which is longer.
        start = min(max(region.field[0] - _DIGITS, 0.0), 1.0 - _DIGITS)
        least, most = profile.interval_MPa(start, max(region.field[1], start) + _DIGITS)
        own = softest >= least * (1.0 - _DIGITS) and stiffest <= most * (1.0 + _DIGITS)
        if not own and (region.blend or {}).get("kind") != "bands":
            yield f"{where}: its target is not the profile's there, {least:.4g} .. {most:.4g} MPa"
        if region.blend is None and not np.allclose(region.error, error, atol=1e-6):
            yield f"{told} and its target, {softest:.4g} .. {stiffest:.4g} MPa, give another error"
    whole_mm = np.add(plan.part.bounds_mm, plan.part.translation_mm)
    if not _near(_union([region.bounds_mm for region in plan.regions]), whole_mm):
        yield "plan.json: its regions do not fill the part's bounds"


def _shell_problems(
    plan: Plan, measures: Mapping[str, Measures], faces: Mapping[str, Int32Array]
) -> Iterator[str]:
    """Hold each shell against the regions that the plan puts into it."""
    for number, file in enumerate(sorted({region.file for region in plan.regions}), start=1):
        if file not in measures:
            continue  # told as missing, or unreadable
        regions = _of(plan, file)
        materials = sorted({region.printed for region in regions})
        if not all(file.endswith(f"_{material}.stl") for material in materials):
            yield f"{file}: the plan puts {', '.join(materials)} into it, its name says otherwise"
        if not file.startswith("stl/"):
            yield f"{file}: shells stand in stl/; move it there, or grade the part again"
        if f"__{number:02d}_" not in file or any(region.index != number for region in regions):
            yield f"{file}: its number is not its place from soft to hard, {number:02d}"
        found = measures[file]
        volume_mm3, said_mm3 = float(found.volume_mm3[0]), sum(r.volume_mm3 for r in regions)
        if not math.isclose(volume_mm3, said_mm3, rel_tol=_VOLUME_ERROR_LIMIT):
            yield f"{file}: it has {volume_mm3:.9g} mm3, the plan says {said_mm3:.9g} mm3"
        if any(region.triangles != len(faces[file]) for region in regions):
            yield f"{file}: it has {len(faces[file])} triangles, the plan says otherwise"
        if not _near(found.bounds_mm[0], _union([region.bounds_mm for region in regions])):
            yield f"{file}: it does not lie where the plan says"
    softest_first = [_of(plan, file)[0].coordinate for file in sorted(measures)]
    if softest_first != sorted(softest_first):
        yield "stl/: the files' numbers do not run from soft to hard"


def _threemf_problems(root: Path, plan: Plan, shells: Mapping[str, Triangles]) -> Iterator[str]:
    """Hold the 3MF against the STL files, triangle for triangle, and its materials."""
    try:
        path = path_within(root, f"{plan.name}.3mf")
        if not path.is_file():
            return  # told as missing
        model = read_threemf(path)
    except PlannerError as error:
        yield str(error)
        return
    yield from (f"{path.name}: {remark}" for remark in model.remarks)
    # One mesh of all materials, as PrusaSlicer takes it, tells shells by their material alone.
    stems = {str(region.printed): Path(region.file).stem for region in plan.regions}
    objects = {
        stems.get(item.material_name, plan.name) if item.name == plan.name else item.name: item
        for item in model.objects
    }
    for file, shell in shells.items():
        if (item := objects.pop(Path(file).stem, None)) is None:
            yield f"{path.name}: it has no object {Path(file).stem}"
            continue
        found = np.asarray(item.vertices, dtype=np.float32)[item.faces]
        # Text of earlier versions is about one unit in the last place of float32 off.
        if found.shape != shell.shape or not np.allclose(found, shell, rtol=3e-7, atol=1e-9):
            yield f"{path.name}: object {item.name} is not the shell in its STL"
        materials = {region.printed for region in _of(plan, file)}
        if materials != {item.material_name}:
            yield (
                f"{path.name}: object {item.name} is of {item.material_name or 'no material'}, the "
                f"plan says {', '.join(sorted(str(m) for m in materials))}"
            )
    strange = (name for name in objects if name not in stems.values())
    yield from (f"{path.name}: object {name} has no STL" for name in strange)


def _dealt(region: Region) -> bool:
    """Tell whether a region is one of two whose cells lie among each other."""
    return (region.blend or {}).get("kind") == "dither"


def _of(plan: Plan, file: str) -> list[Region]:
    return [region for region in plan.regions if region.file == file]


def _union(boxes: Sequence[tuple[Point, Point] | FloatArray]) -> FloatArray:
    corners = np.array(boxes)
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])


def _near(box: FloatArray, other: FloatArray) -> bool:
    return np.allclose(box, other, rtol=_PLACE_ERROR, atol=_PLACE_ERROR_MM)


# ------------------------------------------------------------------------------------------------
# A plan's folder verified anew, from its files alone.


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
    warnings
        What it warned of, as laws that are not stable up to the break; no reason to fail.
    """

    part: str
    printer: str
    shells: int
    triangles: int
    checks: Mapping[str, Check]
    problems: tuple[str, ...]
    reported: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.part}: {counted(self.shells, 'shell')}, {counted(self.triangles, 'triangle')}; "
            + outcome(
                (sum(not check.ok for check in self.checks.values()), "check failed"),
                (len(self.problems), "problem"),
                (len(self.reported), "finding of the plan"),
            )
        )

    @property
    def ok(self) -> bool:
        """Whether everything holds, and the plan reported nothing."""
        held = all(check.ok for check in self.checks.values())
        return held and not self.problems and not self.reported

    def document(self) -> dict[str, Any]:
        """Return the certificate as JSON holds it."""
        return {"schema": 1, "ok": self.ok, **asdict(self)}


def check(
    folder: str | Path | Plan, *, progress: Callable[[str], None] | None = None
) -> Certificate:
    """Verify a plan's folder: nothing missing, nothing altered, and every shell sound.

    Each shell is verified as a reader finds it, and held against what the plan says of it: its
    material, volume, triangles and place. Where bands share a file, their volumes are verified
    together.

    Parameters
    ----------
    folder
        That `Plan.write` or ``planner grade`` wrote, its plan.json, or the plan read from there.
    progress
        Called with the name of each stage as it begins.

    Returns
    -------
    Certificate
        `Certificate.ok` is false when something does not hold, or the plan itself reported so.

    Raises
    ------
    FileError
        There is no plan to verify, or it cannot be read.

    Examples
    --------
    >>> planner.check("finger-graded").ok  # doctest: +SKIP
    True
    """
    tell = progress or (lambda stage: None)
    file = plan_file(folder)
    root = file.parent
    plan = read_plan(file)
    problems = list(_misplaced(root, plan))
    rewritten = dict.fromkeys(n for n in plan.files_sha256 if _is_rewritten(root, n, plan))
    tell("reading the shells")
    shells = dict[str, Triangles]()
    for name, region in {region.file: region for region in plan.regions}.items():
        try:
            if not path_within(root, name).exists():
                continue  # told as missing already
            data, changed = read_shell(root, region)
            if changed:
                rewritten[name] = None
            shells[name] = decode_stl(data, name)
        except FileError as error:
            problems.append(str(error))
    tell("verifying the shells")
    verified, disagreements = plan_checks(plan, list(shells), join_shells(shells.values()))
    checks = {"files_altered": Check(len(rewritten), 0, not rewritten), **verified}
    problems += [f"{name}: its content is not what the plan was written with" for name in rewritten]
    if "shells_unsound" not in checks:
        problems.append("there is no shell that can be verified")
    tell("comparing the 3MF")
    mismatches = list(_threemf_problems(root, plan, shells))
    checks["threemf_mismatches"] = Check(len(mismatches), 0, not mismatches)
    return Certificate(
        part=plan.part.file,
        printer=plan.printer,
        shells=len(shells),
        triangles=sum(map(len, shells.values())),
        checks=checks,
        problems=(*problems, *disagreements, *mismatches),
        reported=tuple(_reported(plan)),
        warnings=plan.warnings,
    )


def _misplaced(root: Path, plan: Plan) -> Iterator[str]:
    expected = {region.file for region in plan.regions} | {"plan.json", f"{plan.name}.3mf"}
    expected |= {name for name in plan.files_sha256 if name.endswith(_KEPT)}
    found = {
        p.relative_to(root).as_posix()
        for p in root.rglob("*")
        if p.is_file() and not is_scratch(p.name)  # of a run that was killed, or is under way
    }
    for name in sorted(expected - found):
        yield f"{name}: the plan names it, but it is missing"
    for name in sorted(found - expected - set(plan.files_sha256)):
        if name.startswith("stl/") or name.casefold().endswith((".stl", ".3mf")):  # may be printed
            yield f"{name}: no part of the plan; remove it"


_KEPT = (".md", ".png", ".stl")
_READ = (*_KEPT, ".html", ".3mf")
"""Of a plan's files what people read and print; tables are to be filled, and the page can be made
anew."""


def _is_rewritten(root: Path, name: str, plan: Plan) -> bool:
    """Tell whether such a file is there, and not as it was written."""
    is_there = name.endswith(_READ) and path_within(root, name).is_file()
    return is_there and not is_as_written(root, name, plan.files_sha256[name])


def _reported(plan: Plan) -> Iterator[str]:
    yield from (finding.message for finding in plan.findings)
    for missed in plan.unreachable:
        low, high = missed.target_modulus_MPa
        yield f"target {low:.3g} .. {high:.3g} MPa is out of reach of {missed.nearest}"
    for name, check in plan.checks.items():
        if not check.ok and not plan.findings:  # findings say it better
            yield f"check {name} did not hold: {check.value:.3g}, limit {check.limit:.3g}"


# ------------------------------------------------------------------------------------------------
# Two plans compared by meaning: what is printed differently, not which bytes differ.


_NEAREST = {"kind": "nearest"}  # of plans that say nothing of it


@dataclass(frozen=True, slots=True)
class Difference:
    """One difference in words: what differs, where, and how it was and is."""

    what: str
    where: str
    before: str
    after: str

    @one_line
    def __repr__(self) -> str:
        return self.text

    @property
    def text(self) -> str:
        """The difference in a line."""
        before, after = (words or "nothing" for words in (self.before, self.after))
        return f"{self.what} ({self.where}): {before} -> {after}"


def diff(
    before: Plan | str | Path, after: Plan | str | Path, *, tolerance: float = 1e-6
) -> tuple[Difference, ...]:
    """Compare two plans by meaning.

    Parameters
    ----------
    before, after
        Plans, or the files or folders that hold them.
    tolerance
        Relative difference of figures that still counts as equal; places along the field are
        compared with the same tolerance, absolutely.

    Returns
    -------
    tuple of Difference
        Empty when the plans mean the same. File hashes and version numbers do not count: they
        differ whenever anything else does, and sometimes when nothing does.

    Raises
    ------
    ArgumentError
        The tolerance is not a number from 0 to 1.
    FileError
        There is no plan, or it cannot be read.

    Examples
    --------
    >>> planner.diff("finger-graded", "five-bands")[0].what  # doctest: +SKIP
    'material removed'
    """
    within(tolerance, "`tolerance`", 0.0, 1.0)
    plans = [plan if isinstance(plan, Plan) else read_plan(plan) for plan in (before, after)]
    return tuple(_compare(plans[0], plans[1], tolerance))


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
        yield from _different(what, "plan", a, b, tolerance)
    hashes = before.palette.sha256, after.palette.sha256
    if before.palette.name == after.palette.name and hashes[0] != hashes[1]:
        yield Difference("palette content", "plan", *(each[:12] for each in hashes))
    yield from _compare_materials(before, after, tolerance)
    yield from _compare_regions(before, after, tolerance)
    for name in sorted({*before.checks, *after.checks}):
        a, b = before.checks.get(name), after.checks.get(name)
        if (a is None or a.ok) != (b is None or b.ok):
            yield Difference("check", name, _holds(a), _holds(b))
    messages = [sorted(found.message for found in plan.findings) for plan in (before, after)]
    if messages[0] != messages[1]:
        yield Difference("findings", "plan", *(str(len(each)) for each in messages))
    a, b = ([[m.field, m.target_modulus_MPa] for m in p.unreachable] for p in (before, after))
    yield from _different("unreachable targets", "plan", a, b, tolerance)


def _compare_materials(before: Plan, after: Plan, tolerance: float) -> Iterator[Difference]:
    volumes = [_volume_by_material(plan) for plan in (before, after)]
    for material in volumes[0] | volumes[1]:
        a, b = volumes[0].get(material), volumes[1].get(material)
        if a is None:
            yield Difference("material added", material, "", f"{_text(b)} mm3")
        elif b is None:
            yield Difference("material removed", material, f"{_text(a)} mm3", "")
        else:
            yield from _different("material volume mm3", material, a, b, tolerance)


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
            yield from _different(what, where, x, y, tolerance)


def _different(what: str, where: str, a: Any, b: Any, tolerance: float) -> Iterator[Difference]:
    """Yield two values' difference, with as many digits as tell them apart; None where equal."""
    if not _equal(a, b, tolerance):
        each = ((_text(a, digits), _text(b, digits)) for digits in range(6, 18))
        told = next((texts for texts in each if texts[0] != texts[1]), (_text(a), _text(b)))
        yield Difference(what, where, *told)


def _volume_by_material(plan: Plan) -> dict[str, float]:
    volumes: dict[str, float] = {}
    for region in plan.regions:
        volumes[region.printed] = volumes.get(region.printed, 0.0) + region.volume_mm3
    return volumes


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


def _text(value: Any, digits: int = 6) -> str:
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    if isinstance(value, (list, tuple)):
        return " .. ".join(_text(v, digits) for v in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_text(v, digits)}" for k, v in value.items())
    return str(value)
