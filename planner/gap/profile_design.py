"""What was printed along a graded bar: the design that its measurement is compared with."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.gap.column_file import read_columns
from planner.grading.blends.along import dithered_profile, is_dithered
from planner.palette import Palette
from planner.plan import Plan, Region, plan_file, read_plan

__all__ = ["ProfileDesign", "read_profile"]

_COLUMNS: Mapping[str, str | None] = {
    "x_mm": "length", "coordinate": None, "width_mm": "length", "thickness_mm": "length",
}  # fmt: skip
_SLACK = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ProfileDesign:
    """Material and section along the gauge, linear between points.

    Attributes
    ----------
    name
        Of the file, without ending.
    x_mm
        From 0, one end of the gauge, to its length, shape (n,). It never falls; a place that
        stands twice is a step.
    coordinate
        Place on the palette, shape (n,).
    width_mm, thickness_mm
        Nominal section, shape (n,), or None where the specimen's own is meant throughout.
    """

    name: str
    x_mm: FloatArray
    coordinate: FloatArray
    width_mm: FloatArray | None = None
    thickness_mm: FloatArray | None = None

    def __post_init__(self) -> None:
        for name in ("x_mm", "coordinate", "width_mm", "thickness_mm"):
            if getattr(self, name) is not None:
                array = np.array(getattr(self, name), dtype=np.float64)
                array.setflags(write=False)
                object.__setattr__(self, name, array)

    @property
    def length_mm(self) -> float:
        """Length of the gauge."""
        return float(self.x_mm[-1])

    def at(self, x_mm: FloatArray) -> FloatArray:
        """Return the coordinate at places along the gauge."""
        return np.interp(x_mm, self.x_mm, self.coordinate)


def read_profile(
    path: str | Path, *, palette: Palette, gauge_mm: float | None
) -> tuple[ProfileDesign, tuple[str, ...]]:
    """Read a graded bar's design: a profile (CSV), or a plan.json or its folder.

    A plan made along an axis gives one material a region; where the part is longer than the
    gauge, the gauge is taken to be its middle.

    Parameters
    ----------
    gauge_mm
        The specimen's gauge length; None takes the design's.

    Returns
    -------
    design
        On 0 to the gauge length.
    notes
        What was assumed.

    Raises
    ------
    FileError
        Not a profile or a plan along an axis, places that fall back, a coordinate off the
        palette, or a length other than the gauge's.
    """
    path = Path(path)
    if path.is_dir() or path.suffix.casefold() == ".json":
        design, notes = _of_plan(path, palette, gauge_mm)
    else:
        design, notes = _of_csv(path), ()
    soft, hard = palette.materials[0].coordinate, palette.materials[-1].coordinate
    outside = (design.coordinate < soft - 1e-6) | (design.coordinate > hard + 1e-6)
    if outside.any():
        at = int(np.flatnonzero(outside)[0])
        raise FileError(
            f"{path.name}: coordinate is {design.coordinate[at]:g} at {design.x_mm[at]:g} mm; "
            f"palette {palette.name} goes from {soft:g} to {hard:g}"
        )
    return _on_gauge(design, gauge_mm, path.name), notes


def _of_csv(path: Path) -> ProfileDesign:
    file = read_columns(path, _COLUMNS, optional=frozenset({"width_mm", "thickness_mm"}))
    x = file.numbers["x_mm"]
    if len(x) < 2:
        raise FileError(f"{path.name}: one point; a profile takes at least the gauge's two ends")
    fall = np.flatnonzero(np.diff(x) < 0.0)
    if len(fall):
        raise FileError(
            f"{path.name}, line {file.lines[fall[0] + 1]}: x_mm falls from {x[fall[0]]:g} to "
            f"{x[fall[0] + 1]:g}; sort the rows by x_mm"
        )
    for name in ("width_mm", "thickness_mm"):
        sizes = file.numbers.get(name, np.ones(1))
        if not np.all(sizes > 0.0):
            at = int(np.argmin(sizes))
            raise FileError(
                f"{path.name}, line {file.lines[at]}: {name} is {sizes[at]:g}; it must be above 0"
            )
    return ProfileDesign(path.stem, **file.numbers)


def _on_gauge(design: ProfileDesign, gauge_mm: float | None, where: str) -> ProfileDesign:
    start, stop = float(design.x_mm[0]), design.length_mm
    gauge = stop if gauge_mm is None else gauge_mm
    slack = _SLACK * gauge
    if stop - start < gauge - slack or gauge <= 0.0:
        raise FileError(
            f"{where}: the profile is {stop - start:g} mm long, shorter than the gauge of "
            f"{gauge:g} mm; give it from 0 to the gauge length"
        )
    if start < -slack or start > slack or stop > gauge + slack:
        raise FileError(
            f"{where}: x_mm runs from {start:g} to {stop:g}, the gauge from 0 to {gauge:g} mm; "
            "cut the profile to the gauge and count x_mm from its end"
        )
    x = design.x_mm.copy()
    x[0], x[-1] = 0.0, gauge
    return ProfileDesign(design.name, x, design.coordinate, design.width_mm, design.thickness_mm)


def _of_plan(
    path: Path, palette: Palette, gauge_mm: float | None
) -> tuple[ProfileDesign, tuple[str, ...]]:
    plan = read_plan(path)
    where = plan_file(path).name
    span = _axis_span_mm(plan, where)
    if plan.palette.sha256 and palette.sha256 and plan.palette.sha256 != palette.sha256:
        notes = [
            f"{path.name}: planned with another version of palette {plan.palette.name}; its "
            "coordinates are taken as they are"
        ]
    else:
        notes = []
    by_stretch = {region.field: region for region in plan.regions}  # two of each, where dithered
    regions = [by_stretch[field] for field in sorted(by_stretch)]
    _check_whole(regions, where)
    if is_dithered(plan):
        field, coordinate = dithered_profile(plan, palette)
        x = field * span
    else:
        x = np.repeat([0.0, *(r.field[1] for r in regions)], 2)[1:-1] * span
        coordinate = np.repeat([r.coordinate for r in regions], 2)
    name = path.name if path.is_dir() else path.stem
    if name == "plan":
        name = plan.name
    if gauge_mm is not None and span > gauge_mm * (1.0 + _SLACK):
        begin = 0.5 * (span - gauge_mm)
        notes.append(
            f"{path.name}: the part is {span:g} mm long, the gauge {gauge_mm:g} mm; the gauge is "
            "taken to be its middle"
        )
        inside = (x > begin) & (x < begin + gauge_mm)
        ends = _right_of(x, coordinate, begin), _left_of(x, coordinate, begin + gauge_mm)
        x = np.array([0.0, *(x[inside] - begin), gauge_mm])
        coordinate = np.array([ends[0], *coordinate[inside], ends[1]])
    return ProfileDesign(name, x, coordinate), tuple(notes)


def _axis_span_mm(plan: Plan, where: str) -> float:
    field: Mapping[str, Any] = plan.gradient.field
    span = field.get("span_mm")
    if field.get("name") != "axis" or not isinstance(span, (int, float)) or span <= 0:
        raise FileError(
            f"{where}: its gradient follows {field.get('name')!r}, not an axis; give the bar's "
            "profile along the gauge as a CSV file x_mm,coordinate"
        )
    return float(span)


def _check_whole(regions: list[Region], where: str) -> None:
    edges = [0.0]
    for region in regions:
        if abs(region.field[0] - edges[-1]) > 1e-6:
            break
        edges.append(region.field[1])
    if len(edges) != len(regions) + 1 or abs(edges[-1] - 1.0) > 1e-6:
        raise FileError(
            f"{where}: its regions do not follow each other from 0 to 1 along the axis; give the "
            "bar's profile along the gauge as a CSV file x_mm,coordinate"
        )


def _right_of(x: FloatArray, coordinate: FloatArray, place: float) -> float:
    return float(coordinate[int(np.searchsorted(x, place, side="right"))])


def _left_of(x: FloatArray, coordinate: FloatArray, place: float) -> float:
    return float(coordinate[int(np.searchsorted(x, place, side="left")) - 1])
