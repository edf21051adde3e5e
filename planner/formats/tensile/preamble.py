"""What stands above a record's columns: machine, specimen sizes, units."""

import re
from collections.abc import Sequence

from planner.errors import FileError
from planner.formats.tensile.text_rows import TextRow, number
from planner.formats.tensile.units import unit_factor

__all__ = ["mark10_units", "metadata"]

_SIZES = {
    "width": "width_mm",
    "thickness": "thickness_mm",
    "length": "gauge_mm",
    "gauge length": "gauge_mm",
    "gage length": "gauge_mm",
}
_TEXTS = {
    "material": "material",
    "specimen label": "specimen",
    "specimen name": "specimen",
    "specimen id": "specimen",
}
_SPEED = {"mm/min": 1 / 60, "mm/s": 1.0, "in/min": 25.4 / 60, "in/s": 25.4}
_KEY = re.compile(r"(?:.* : )?(?:specimen )?(.*?)\s*(?:[\(\[](.*)[\)\]])?\s*:?", re.IGNORECASE)


def metadata(rows: Sequence[TextRow], separator: str, *, where: str) -> dict[str, float | str]:
    """Read the sizes and names in the head of a file: "Width (mm);6" and the like.

    Bluehill writes "Dimension : Width","6.00","mm"; the group in front is left away.

    Raises
    ------
    FileError
        A size in an unknown unit.
    """
    found: dict[str, float | str] = {}
    for line, cells in rows:
        if len(cells) < 2 or not cells[0] or not cells[1]:
            continue
        match = _KEY.fullmatch(cells[0])
        if match is None:
            continue
        key = match[1].strip().casefold()
        name = _TEXTS.get(f"specimen {key}") or _TEXTS.get(key)
        if name is not None:
            found[name] = cells[1]
            continue
        value = number(cells[1], separator)
        unit = match[2] or (cells[2].strip("()[]") if len(cells) > 2 else "")
        if value is None or not unit:
            continue
        if key in _SIZES:
            factor = unit_factor("length", unit, where=f"{where}, line {line}, {cells[0]!r}")
            found[_SIZES[key]] = value * factor
        elif key in ("speed", "rate", "crosshead speed") and unit in _SPEED:
            found["rate_mm_s"] = value * _SPEED[unit]
    return found


def mark10_units(rows: Sequence[TextRow], *, where: str) -> dict[str, str]:
    """Return the units that a Mark-10 MESURgauge file states above its columns.

    The head has "Units: N" (of the load), "Travel Unit: mm", "Readings: ..." and "X-Axis: ...";
    the columns are Reading, Load, Travel and Time without units, time in seconds.

    Raises
    ------
    FileError
        The head names load units that are two different ones.
    """
    found: dict[str, str] = {}
    keys = {"units": "force", "unit": "force", "load unit": "force", "load units": "force",
            "travel unit": "displacement", "travel units": "displacement"}  # fmt: skip
    for line, cells in rows:
        text = " ".join(cell for cell in cells if cell)
        key, colon, value = text.partition(":")
        meaning = keys.get(key.strip().casefold())
        if not colon or meaning is None or not value.strip():
            continue
        unit = value.strip().strip("()[]")
        if found.setdefault(meaning, unit) != unit:
            raise FileError(
                f"{where}, line {line}: unit of {meaning} is {unit!r} here and "
                f"{found[meaning]!r} above; keep the right one"
            )
    if found:
        found["time"] = "s"
    return found
