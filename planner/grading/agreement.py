"""Whether a plan's files say what its plan.json says."""

import itertools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from planner.arrays import Float32Array, FloatArray
from planner.errors import PlannerError
from planner.formats.threemf import ThreemfObject, read_threemf
from planner.geometry.audit import audit
from planner.plan import Box, Plan, Region

__all__ = ["region_problems", "shell_problems", "threemf_problems"]

Shells = Mapping[str, Float32Array | FloatArray]

_VOLUME_ERROR = 1e-6  # relative; plan.json keeps nine digits
_PLACE_ERROR_MM = 1e-3  # far below a pixel, far above float32 on any tray


def region_problems(plan: Plan) -> Iterator[str]:
    """Hold a plan's regions against one another and against the part."""
    if not plan.regions:
        yield "plan.json: it has no regions"
        return
    total = sum(region.volume_mm3 for region in plan.regions)
    if not math.isclose(total, plan.part.volume_mm3, rel_tol=_VOLUME_ERROR):
        yield (
            f"plan.json: its regions have {total:.9g} mm3 in all, the part "
            f"{plan.part.volume_mm3:.9g} mm3"
        )
    for before, after in itertools.pairwise(plan.regions):
        together = before.field == after.field and _dealt(before) and _dealt(after)
        if before.field[1] > after.field[0] + 1e-9 and not together:
            yield f"plan.json: region {after.index} begins before region {before.index} ends"
    low, high = _union([region.bounds_mm for region in plan.regions])
    shift = np.array(plan.part.translation_mm)
    if not _near((low, high), np.array(plan.part.bounds_mm) + shift):
        yield "plan.json: its regions do not fill the part's bounds"


def shell_problems(plan: Plan, shells: Shells) -> Iterator[str]:
    """Hold each shell against the regions that the plan puts into it."""
    for number, file in enumerate(sorted(shells), start=1):
        regions = _of(plan, file)
        materials = sorted({region.printed for region in regions})
        if not all(file.endswith(f"_{material}.stl") for material in materials):
            yield f"{file}: the plan puts {', '.join(materials)} into it, its name says otherwise"
        if f"__{number:02d}_" not in file:
            yield f"{file}: its number is not its place from soft to hard, {number:02d}"
        found = audit(shells[file])
        volume = sum(region.volume_mm3 for region in regions)
        if not math.isclose(found.volume_mm3, volume, rel_tol=_VOLUME_ERROR):
            yield f"{file}: it has {found.volume_mm3:.9g} mm3, the plan says {volume:.9g} mm3"
        if any(region.triangles != found.triangles for region in regions):
            yield f"{file}: it has {found.triangles} triangles, the plan says otherwise"
        if not _near(found.bounds_mm, _union([region.bounds_mm for region in regions])):
            yield f"{file}: it does not lie where the plan says"
    softest_first = [_of(plan, file)[0].coordinate for file in sorted(shells)]
    if softest_first != sorted(softest_first):
        yield "stl/: the files' numbers do not run from soft to hard"


def threemf_problems(path: Path, plan: Plan, shells: Shells) -> Iterator[str]:
    """Hold the 3MF against the STL files, triangle for triangle, and its materials."""
    if not path.is_file():
        return  # told as missing
    try:
        model = read_threemf(path)
    except PlannerError as error:
        yield str(error)
        return
    for remark in model.remarks:
        yield f"{path.name}: {remark}"
    objects = {item.name: item for item in model.objects}
    for file, shell in shells.items():
        item = objects.pop(Path(file).stem, None)
        if item is None:
            yield f"{path.name}: it has no object {Path(file).stem}"
        else:
            yield from _object_problems(path.name, item, shell, _of(plan, file))
    for name in objects:
        yield f"{path.name}: object {name} has no STL"


def _object_problems(
    name: str, item: ThreemfObject, shell: Float32Array | FloatArray, regions: list[Region]
) -> Iterator[str]:
    triangles = np.asarray(item.vertices, dtype=np.float32)[item.faces]
    # Text keeps each coordinate to about one unit in the last place of float32.
    if triangles.shape != shell.shape or not np.allclose(triangles, shell, rtol=3e-7, atol=1e-9):
        yield f"{name}: object {item.name} is not the shell in its STL"
    materials = {region.printed for region in regions}
    if materials != {item.material_name}:
        yield (
            f"{name}: object {item.name} is of {item.material_name or 'no material'}, the plan "
            f"says {', '.join(sorted(str(m) for m in materials))}"
        )


def _dealt(region: Region) -> bool:
    """Tell whether a region is one of two whose cells lie among each other."""
    return (region.blend or {}).get("kind") == "dither"


def _of(plan: Plan, file: str) -> list[Region]:
    return [region for region in plan.regions if region.file == file]


def _union(boxes: list[Box]) -> FloatArray:
    corners = np.array(boxes)
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])


def _near(box: object, other: object) -> bool:
    return bool(np.allclose(np.array(box), np.array(other), rtol=0.0, atol=_PLACE_ERROR_MM))
