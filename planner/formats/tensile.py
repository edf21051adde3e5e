"""Tensile test files, and the list of specimens: its columns, and what an empty cell stands for."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, get_args

import numpy as np

from planner.errors import FileError
from planner.formats.headings import (
    HeadedColumn,
    Heading,
    column_of,
    head_text,
    is_speed,
    parse_heading,
    size_of,
)
from planner.formats.tables import (
    LARGEST_FIGURE,
    LONGEST_HEADING,
    TextRow,
    finite_numbers,
    is_unit,
    number,
    quantities_of,
    read_rows,
    read_text,
    split_rows,
    unit_factor,
)
from planner.numerics import FloatArray, IntArray

__all__ = [
    "SPECIMEN_COLUMNS",
    "SPECIMEN_TEXTS",
    "ListedSpecimen",
    "SpecimenConditions",
    "TensileTable",
    "is_specimens_file",
    "read_specimens",
    "read_tensile",
]


# ------------------------------------------------------------------------------------------------
# What stands above a record's columns: machine, specimen sizes, speed, units.


_ONE_CELL = re.compile(r"([^:=]+?)\s*[:=]\s*([+-]?[\d.,]+)\s*(\S+)")


def _metadata(rows: Sequence[TextRow], separator: str, *, where: str) -> dict[str, float | str]:
    """Read the sizes, speed and names in the head of a file: "Width (mm);6" and the like.

    Bluehill writes "Dimension : Width","6.00","mm"; the group in front is left away. Two speeds
    that differ (of a preload and of the test) leave the speed unknown.

    Raises
    ------
    FileError
        A size in an unknown unit.
    """
    found: dict[str, float | str] = {}
    speeds: set[float] = set()
    for line, row in rows:
        cells = row
        alone = row and not any(row[1:]) and len(row[0]) <= LONGEST_HEADING
        single = _ONE_CELL.fullmatch(row[0]) if alone else None
        if single is not None:  # "Width: 6.00 mm"
            cells = list(single.groups())
        if len(cells) < 2 or not cells[0] or not cells[1]:
            continue
        name = head_text(cells[0])
        if name is not None:
            found[name] = cells[1]
            continue
        value = number(cells[1], separator)
        size, unit = size_of(cells[0])
        speed, _ = is_speed(cells[0])
        unit = unit or (cells[2].strip("()[] ") if len(cells) > 2 else "")
        if value is None or not unit:
            continue
        if size is not None:
            factor = unit_factor("length", unit, where=f"{where}, line {line}, {cells[0]!r}")
            found[size] = value * factor
        elif speed and (per_second := _mm_s(unit)) is not None:
            speeds.add(value * per_second)
    if len(speeds) == 1:
        found["rate_mm_s"] = speeds.pop()
    return found


def _mm_s(unit: str) -> float | None:
    """Return the mm/s in a unit of speed such as mm/min; None of any other unit."""
    length, _, time = unit.partition("/")
    if "length" not in quantities_of(length) or "time" not in quantities_of(time):
        return None
    return unit_factor("length", length, where=unit) / unit_factor("time", time, where=unit)


def _mark10_units(rows: Sequence[TextRow], *, where: str) -> dict[str, str]:
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


# ------------------------------------------------------------------------------------------------
# What a tensile file holds once its columns have planner's names and units.


@dataclass(frozen=True, slots=True, eq=False)
class TensileTable:
    """One specimen's record.

    Attributes
    ----------
    file
        Name of the file, without folder.
    columns
        Arrays of one length by name: time_s, displacement_mm, force_N, strain, stress_MPa,
        true_strain, true_stress_MPa; whichever the file has.
    factors
        By column: what the numbers in the file were multiplied by.
    lines
        Line number of each row in the file, for messages.
    specimen
        The specimen that the file names, or "".
    metadata
        What the file's head says: width_mm, thickness_mm, gauge_mm, rate_mm_s (numbers),
        material (text); whichever it has.
    without_unit
        Columns whose header gave no unit, so that one was assumed.
    notes
        What was assumed or left out in reading.
    """

    file: str
    columns: Mapping[str, FloatArray]
    factors: Mapping[str, float]
    lines: IntArray
    specimen: str
    metadata: Mapping[str, float | str]
    without_unit: frozenset[str]
    notes: tuple[str, ...]


# ------------------------------------------------------------------------------------------------
# Read a tensile file: generic CSV, Mark-10 MESURgauge or Instron Bluehill.
#
# One way for all: the head is whatever stands above the first row of headings that names a load
# and a length; a row of bare units below the headings (Bluehill) or units in the head (MESURgauge)
# fill what the headings leave open.


_SEPARATORS = ("\t", ";", ",", " ")
_LENGTHS = {"displacement", "position", "elongation", "strain", "stretch", "true strain"}
_LOADS = {"force", "stress", "true stress"}


@dataclass(frozen=True, slots=True)
class _Layout:
    separator: str
    headings: list[Heading | None]
    head: list[TextRow]
    body: list[TextRow]


def read_tensile(
    path: str | Path, *, columns: Sequence[str] | None = None, option: str = ""
) -> tuple[TensileTable, ...]:
    """Read the records in a file, one a specimen.

    Parameters
    ----------
    columns
        Headings in place of the file's own, by position ("force_N", "Load (lbf)"; "-" leaves a
        column out), for a file without headings or without units.
    option
        What a user gives `columns` by, for messages; "" where there is no such option.

    Returns
    -------
    tables
        One, or as many as a column `specimen` tells apart, in order of appearance.

    Raises
    ------
    FileError
        No columns that are understood, an unknown unit, or a cell that is no number; the message
        names file, line and column.
    """
    path = Path(path)
    where = path.name
    layout = _layout(read_text(path), where, columns, option)
    head = _metadata(layout.head, layout.separator, where=where)
    headings, notes = _with_mark10_units(layout, where)
    _refuse_side_by_side(headings, where, option)
    meanings: dict[int, HeadedColumn] = {}
    # A crosshead's absolute position serves only where nothing else tells the travel.
    for index in sorted(range(len(headings)), key=lambda i: _is(headings[i], "position")):
        heading = headings[index]
        if heading is None or heading.meaning == "specimen":
            continue
        try:
            meaning = column_of(heading, where=where)
        except FileError as error:
            if heading.meaning != "time" and heading.unit is None and columns is None:
                example = _example(headings, [h.unit or "" if h else "" for h in headings])
                raise FileError(f"{error}, or {_by_position(option, example)}") from error
            if heading.meaning != "time":
                raise
            notes.append(f"{error}; time is optional and is left out")
            continue
        same = next((m for m in meanings.values() if m.name == meaning.name), None)
        if same is None:
            meanings[index] = meaning
        else:
            notes.append(
                f"{where}: column {heading.text!r} left out; {meaning.name} is read from "
                f"{same.heading.text!r}"
            )
    rows, ended = _data_rows(layout, set(meanings), where)
    if not rows:
        raise FileError(f"{where}: headings but no numbers below them; export the raw data too")
    if ended is not None:
        notes.append(f"{where}: what stands from line {ended} on is no part of the record")
    lines = [line for line, _ in rows]
    values = {
        m.name: finite_numbers(
            [c[i] for _, c in rows], lines, layout.separator, where, m.heading.text, m.factor
        )
        for i, m in meanings.items()
    }
    without_unit = {m.name for m in meanings.values() if m.heading.unit is None}
    if "stretch" in values:
        values.setdefault("strain", values.pop("stretch") - 1.0)
        without_unit.discard("stretch")
    named = next((i for i, h in enumerate(headings) if _is(h, "specimen")), None)
    groups: dict[str, list[int]] = {}
    for position, (_, cells) in enumerate(rows):
        groups.setdefault("" if named is None else cells[named], []).append(position)
    return tuple(
        TensileTable(
            file=where,
            columns=MappingProxyType({name: array[at] for name, array in values.items()}),
            factors=MappingProxyType({m.name: m.factor for m in meanings.values()}),
            lines=np.array(lines, dtype=np.int64)[at],
            specimen=specimen or str(head.get("specimen", "")),
            metadata=MappingProxyType(head),
            without_unit=frozenset(without_unit),
            notes=tuple(notes),
        )
        for specimen, at in groups.items()
    )


def _refuse_side_by_side(headings: Sequence[Heading | None], where: str, option: str) -> None:
    """Refuse a file whose load and length stand in it again under the same headings.

    Raises
    ------
    FileError
        Records side by side; the message says how to read one of them.
    """
    texts = [h.text if h is not None else "" for h in headings]
    again = [h for i, h in enumerate(headings) if h is not None and h.text in texts[:i]]
    if not _suffice(again):
        return
    second = texts.index(again[0].text, texts.index(again[0].text) + 1)
    said = (
        f"{where}: records stand side by side ({again[0].text!r} heads columns "
        f"{texts.index(again[0].text) + 1} and {second + 1}); export one file a specimen"
    )
    if not option:
        raise FileError(said)
    block = headings[second : second + len(set(texts))]
    example = _example(block, [h.unit or "" if h is not None else "" for h in block])
    raise FileError(
        f"{said}, or copy the file for each and read its record by position: the second by "
        f"{option} {'-,' * second}{example}"
    )


def _is(heading: Heading | None, meaning: str) -> bool:
    return heading is not None and heading.meaning == meaning


def _with_mark10_units(layout: _Layout, where: str) -> tuple[list[Heading | None], list[str]]:
    units = _mark10_units(layout.head, where=where)
    headings: list[Heading | None] = [
        Heading(h.text, h.meaning, units[h.meaning])
        if h is not None and h.unit is None and h.meaning in units
        else h
        for h in layout.headings
    ]
    if headings == layout.headings:
        return headings, []
    stated = ", ".join(f"{meaning} in {unit}" for meaning, unit in units.items())
    return headings, [f"{where}: a MESURgauge file, {stated} by its head"]


def _layout(text: str, name: str, columns: Sequence[str] | None, option: str) -> _Layout:
    if columns is not None:
        return _layout_by_position(text, name, columns)
    for separator in _SEPARATORS[:3]:
        rows = split_rows(text, separator)
        for place, (_, cells) in enumerate(rows):
            headings = [parse_heading(cell) if cell else None for cell in cells]
            if not _suffice(headings):
                continue
            body = rows[place + 1 :]
            if body and _is_unit_row(body[0][1], separator):
                headings = _with_units(headings, body[0][1])
                body = body[1:]
            return _Layout(_decimals(body, separator), headings, rows[:place], body)
    raise FileError(f"{name}{_not_understood(text, option)}")


def _suffice(headings: Sequence[Heading | None]) -> bool:
    meanings = {h.meaning for h in headings if h is not None}
    return bool(meanings & _LENGTHS and meanings & _LOADS)


def _decimals(body: Sequence[TextRow], separator: str) -> str:
    """Return the separator by which numbers are read (see `number`).

    Cells in quotes may have decimal commas between commas: "0,5","12,25". A cell that cannot be
    thousands tells, where no cell has a dot.
    """
    cells = [cell for _, row in body for cell in row if cell]
    if separator != "," or any("." in cell for cell in cells):
        return separator
    return ";" if any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells) else separator


_DECIMAL_COMMA = re.compile(r"[+-]?(\d{4,},\d*|\d+,(\d{1,2}|\d{4,})|0\d*,\d+)")


def _not_understood(text: str, option: str) -> str:
    """Say which headings are not understood, and by which others the file can be read."""
    found = _nearest(text)
    if found is None:
        return (
            ": no row of headings with a load (force, load, stress) and a length (displacement, "
            "extension, travel, strain, stretch) above columns of numbers; export the raw data, "
            "headed as 'time_s,displacement_mm,force_N'"
        )
    line, names, headings, units = found
    known = [f"{h.text!r} as {h.meaning}" for h in headings if h is not None]
    unknown = [_quoted(n) for n, h in zip(names, headings, strict=True) if h is None and n]
    meanings = {h.meaning for h in headings if h is not None}
    missing = [
        what
        for what, kinds in (("load (force or stress)", _LOADS), ("length (travel or strain)",
                                                                 _LENGTHS))
        if not meanings & kinds
    ]  # fmt: skip
    said = (
        f", line {line}: no heading of a {' nor of a '.join(missing)}; understood: "
        f"{', '.join(known) or 'none'}; not understood: {', '.join(unknown[:8]) or 'none'}"
    )
    example = _example(headings, units)
    if not _suffice([parse_heading(name) for name in example.split(",")]):
        return f"{said}; export what is missing too"
    return f"{said}; {_by_position(option, example)}"


def _by_position(option: str, example: str) -> str:
    if not option:
        return f"head the columns {example}"
    left_out = " (a '-' leaves a column out)" if "-" in example.split(",") else ""
    return f"name the columns by position, for example {option} {example}{left_out}"


def _quoted(name: str) -> str:
    return repr(name if len(name) <= 30 else f"{name[:27]}...")


_EXAMPLES = {"time": "time_", "length": "displacement_", "force": "force_", "stress": "stress_",
             "strain": "strain_"}  # fmt: skip


def _example(headings: Sequence[Heading | None], units: Sequence[str]) -> str:
    """Return names by position: what is understood, and what units tell of the others.

    Where units tell nothing, the first columns that are left stand for what is missing.
    """
    names: list[str] = []
    for heading, unit in zip(headings, units, strict=True):
        kinds = quantities_of(unit)
        if heading is not None and heading.meaning != "specimen":
            name = heading.meaning.replace(" ", "_")
            name = {"position": "displacement", "elongation": "displacement"}.get(name, name)
            name = f"{name}_{unit}" if unit else _BARE.get(name, name)
        elif heading is not None:
            name = "specimen"
        elif len(kinds) == 1:
            name = _EXAMPLES[next(iter(kinds))] + unit
        else:
            name = "-"
        names.append("-" if name != "-" and _meaning_of(name) in map(_meaning_of, names) else name)
    for wanted, meanings in (("displacement_mm", _LENGTHS), ("force_N", _LOADS)):
        if meanings.isdisjoint(map(_meaning_of, names)) and "-" in names:
            names[names.index("-")] = wanted
    return ",".join(names)


_BARE = {"time": "time_s", "force": "force_N", "displacement": "displacement_mm",
         "stress": "stress_MPa", "true_stress": "true_stress_MPa"}  # fmt: skip


def _meaning_of(name: str) -> str | None:
    heading = parse_heading(name)
    return None if heading is None else heading.meaning


def _nearest(text: str) -> tuple[int, list[str], list[Heading | None], list[str]] | None:
    """Return the row that comes nearest to one of headings: line, cells, headings and units.

    The row above the first row of numbers, or above a row of units there; the separator is that
    by which it has most cells.
    """
    best: tuple[int, list[str], list[Heading | None], list[str]] | None = None
    for separator in _SEPARATORS[:3]:
        rows = [(line, cells) for line, cells in split_rows(text, separator) if any(cells)]
        for place, (_, cells) in enumerate(rows):
            filled = [cell for cell in cells if cell]
            numbers = sum(number(cell, separator) is not None for cell in filled)
            # A specimen's name may stand beside them; a size in the head is one number alone.
            if place and numbers > 1 and 2 * numbers >= len(filled):
                break
        else:
            continue
        has_units = place > 1 and _is_unit_row(rows[place - 1][1], separator)
        line, names = rows[place - 1 - has_units]
        headings = [parse_heading(cell) if cell else None for cell in names]
        below = rows[place - 1][1] if has_units else []
        units = [
            unit if is_unit(unit := (h.unit or "") if h else _unit_at_end(n)) else
            (below[i].strip("()[] ") if i < len(below) else "")
            for i, (n, h) in enumerate(zip(names, headings, strict=True))
        ]  # fmt: skip
        if best is None or len(names) > len(best[1]):
            best = line, names, headings, units
    return best


def _unit_at_end(name: str) -> str:
    """Return the unit in a heading whose name is not known: "Gap (mm)", "Gap_mm", "Gap / mm"."""
    return name.rstrip(")] ").replace("_", " ").replace("(", " ").replace("[", " ").split(" ")[-1]


def _layout_by_position(text: str, name: str, columns: Sequence[str]) -> _Layout:
    headings: list[Heading | None] = []
    for column in columns:
        heading = None if column.strip() in ("", "-") else parse_heading(column.strip())
        if heading is None and column.strip() not in ("", "-"):
            raise FileError(
                f"column {column!r} is unknown; use time_s, displacement_mm, force_N, strain, "
                "stretch, stress_MPa, specimen, or '-' for a column to leave out"
            )
        headings.append(heading)
    if not _suffice(headings):
        raise FileError(
            f"columns {', '.join(columns)}: name one load (force_N, stress_MPa) and one length "
            "(displacement_mm, strain, stretch)"
        )
    for separator in _SEPARATORS:
        rows = split_rows(text, separator)
        decimals = _decimals(rows, separator)
        for place, (_, cells) in enumerate(rows):
            filled = [number(c, decimals) for c in cells[: len(columns)]]
            wanted = [v for v, h in zip(filled, headings, strict=False)
                      if h is not None and h.meaning != "specimen"]  # fmt: skip
            if len(filled) == len(columns) and None not in wanted:
                return _Layout(decimals, headings, rows[:place], rows[place:])
    raise FileError(f"{name}: no row with {len(columns)} columns of numbers; check the columns")


def _is_unit_row(cells: list[str], separator: str) -> bool:
    filled = [cell for cell in cells if cell]
    return bool(filled) and all(
        number(cell, separator) is None and (is_unit(cell.strip("()[]")) or cell[0] in "([")
        for cell in filled
    )


def _with_units(headings: list[Heading | None], units: list[str]) -> list[Heading | None]:
    padded = units + [""] * (len(headings) - len(units))
    return [
        h if h is None or h.unit is not None or not unit.strip("()[] ")
        else Heading(h.text, h.meaning, unit.strip("()[] "))
        for h, unit in zip(headings, padded, strict=False)
    ]  # fmt: skip


def _data_rows(layout: _Layout, wanted: set[int], where: str) -> tuple[list[TextRow], int | None]:
    """Rows of the record, and the line of whatever follows it below a blank line."""
    rows: list[TextRow] = []
    blank = False
    for line, cells in layout.body:
        if not any(cells):
            blank = bool(rows)
            continue
        if blank and number(cells[0], layout.separator) is None:
            return rows, line
        if len(cells) <= max(wanted):
            raise FileError(
                f"{where}, line {line}: {len(cells)} cells where the headings have "
                f"{len(layout.headings)}; complete or remove the line"
            )
        blank = False
        rows.append((line, cells))
    return rows, None


# ------------------------------------------------------------------------------------------------
# The list of specimens: what each one is, its size and how it was tested.


_Orientation = Literal["x", "y", "z"]
_Protocol = Literal["monotonic", "cyclic", "relaxation"]

_MODES = frozenset({"tension", "tensile", "compression", "compressive"})
"""Ways of loading that may stand beside a protocol."""


@dataclass(frozen=True, slots=True)
class SpecimenColumn:
    """A condition or a size in specimens.csv; numbers are above 0 unless `between` says more.

    Attributes
    ----------
    name
        With its unit as suffix.
    title
        What it is, in words.
    at
        A sentence's end that tells a value.
    label
        The same beside a curve; "" where a curve is not named by it.
    called
        Headings of the same quantity that leave the unit open.
    choices
        What a cell may say; None for a number, none for any text.
    between
        Least and largest number.
    plausible
        What tensile specimens have, in mm: beyond, the cell is doubted.
    tolerance
        How far apart, absolute and relative, two specimens of one condition may be.
    scale
        On which a load's trend over the column is smooth.
    usual
        Stands in where neither specimen nor palette tells.
    is_size
        Whether it belongs to the specimen's size; the others are conditions of print and test.
    """

    name: str
    title: str
    at: str
    label: str = ""
    called: tuple[str, ...] = ()
    choices: tuple[str, ...] | None = None
    between: tuple[float, float] | None = None
    plausible: tuple[float, float] = (0.0, math.inf)
    tolerance: tuple[float, float] | None = None
    scale: Callable[[FloatArray], FloatArray] = np.positive
    usual: float | None = None
    is_size: bool = False


_WIDTHS_MM, _THICKNESSES_MM, _GAUGES_MM = (0.5, 100.0), (0.1, 50.0), (2.0, 500.0)
"""ASTM D412 and D638, ISO 37 and 527 have widths of 2 to 25 mm, thicknesses of 0.5 to 14 mm and
gauges of 4 to 80 mm; labs go further, but not beyond these."""

_TEMPERATURES_C = (-100.0, 300.0)
"""Beyond these every elastomer and jetted resin is glass, or decomposes."""

SPECIMEN_COLUMNS: Mapping[str, SpecimenColumn] = MappingProxyType(
    {
        column.name: column
        for column in (
            SpecimenColumn(
                "rate_mm_s", "crosshead speed", "at {} mm/s", "{:g} mm/s", ("rate",),
                tolerance=(0.0, 0.05), scale=lambda speed: np.log(np.maximum(speed, 1e-9)),
            ),
            SpecimenColumn(
                "temperature_C", "temperature", "at {} °C", "{:g} °C", ("temperature",),
                between=_TEMPERATURES_C, tolerance=(1.0, 0.0), usual=23.0,
            ),
            SpecimenColumn(
                "soak_h", "soaking time", "after {} h of soaking", "{:g} h soaked", ("soak",),
                between=(0.0, math.inf), tolerance=(0.25, 0.05), usual=0.0,
                scale=lambda hours: np.sqrt(np.maximum(hours, 0.0)),
            ),
            SpecimenColumn(
                "age_days", "age at the test", "at an age of {} days", "{:g} d old", ("age",),
                between=(0.0, math.inf), tolerance=(0.5, 0.1), usual=7.0,
                scale=lambda days: np.log1p(np.maximum(days, 0.0)),
            ),
            SpecimenColumn(
                "orientation", "orientation on the tray", "along {}", "{}",
                choices=get_args(_Orientation),
            ),
            SpecimenColumn(
                "protocol", "protocol", "in {} tests", "{}", choices=get_args(_Protocol)
            ),
            SpecimenColumn("batch", "batch", "in batch {}", choices=()),
            SpecimenColumn(
                "width_mm", "width", "at a width of {} mm", called=("width",),
                plausible=_WIDTHS_MM, tolerance=(0.0, 0.02), is_size=True,
            ),
            SpecimenColumn(
                "thickness_mm", "thickness", "at a thickness of {} mm", called=("thickness",),
                plausible=_THICKNESSES_MM, tolerance=(0.0, 0.02), is_size=True,
            ),
            SpecimenColumn(
                "measured_width_mm", "measured width", "at a measured width of {} mm",
                called=("measured width",), plausible=_WIDTHS_MM, is_size=True,
            ),
            SpecimenColumn(
                "measured_thickness_mm", "measured thickness", "at a measured thickness of {} mm",
                called=("measured thickness",), plausible=_THICKNESSES_MM, is_size=True,
            ),
            SpecimenColumn(
                "gauge_mm", "gauge length", "at a gauge of {} mm",
                called=("gauge", "gauge length", "gage", "gage length"),
                plausible=_GAUGES_MM, tolerance=(0.0, 0.1), is_size=True,
            ),
        )
    }
)  # fmt: skip
"""What is known of a specimen besides what it is made of: conditions, then sizes, by name."""

SPECIMEN_TEXTS = ("specimen", "material", "profile", "file")
"""The columns that say which specimen it is, what it is made of and where its curve stands."""

_PART_TEXTS = ("part", "fix", "move", "load")
"""Those of whole parts. Without the first, the others are a lab's own columns."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SpecimenConditions:
    """How a specimen was made and tested, and its section; None stands for what is unknown."""

    width_mm: float | None = None
    thickness_mm: float | None = None
    measured_width_mm: float | None = None
    measured_thickness_mm: float | None = None
    rate_mm_s: float | None = None
    temperature_C: float | None = None
    soak_h: float | None = None
    age_days: float | None = None
    orientation: _Orientation | None = None
    protocol: _Protocol | None = None
    batch: str | None = None

    @property
    def area_mm2(self) -> float | None:
        """Undeformed section, from measured sizes where there are any; None where unknown."""
        width = self.measured_width_mm or self.width_mm
        thickness = self.measured_thickness_mm or self.thickness_mm
        return None if width is None or thickness is None else width * thickness


@dataclass(frozen=True, slots=True)
class ListedSpecimen(SpecimenConditions):
    """One row of specimens.csv; None or "" stands for an empty cell, which means unknown.

    Attributes
    ----------
    material, profile, part
        Exactly one is given: a material of one piece, the file of a graded bar's design, or the
        plan of a whole part.
    fix, move, load
        How a part is held and loaded.
    mode
        How it was loaded, as a protocol such as "cyclic compression" says; "" where it does not.
    covariates
        Further columns as the lab wrote them, by name.
    """

    specimen: str
    material: str = ""
    profile: str = ""
    part: str = ""
    fix: str = ""
    move: str = ""
    load: str = ""
    file: str = ""
    gauge_mm: float | None = None
    mode: str = ""
    covariates: Mapping[str, str] = field(default_factory=dict)

    def conditions(self) -> dict[str, Any]:
        """Return what the row says in each of `SPECIMEN_COLUMNS`."""
        return {name: getattr(self, name) for name in SPECIMEN_COLUMNS}


def is_specimens_file(path: str | Path) -> bool:
    """Say whether a file lists specimens: a column `specimen`, and what each is made of."""
    first = read_text(Path(path)).lstrip("\n").splitlines()[0]
    return any(
        "specimen" in cells and not _MADE_OF.isdisjoint(cells)
        for cells in ([c.strip().casefold() for c in first.split(s)] for s in ",;\t")
    )


def read_specimens(path: str | Path) -> tuple[ListedSpecimen, ...]:
    """Read specimens.csv; the case of planner's own columns does not matter.

    Raises
    ------
    FileError
        A missing column, a size that is no positive number, a condition that no test has, an
        unknown choice, neither or both of material and profile, or two rows of one specimen; the
        message names line and column.
    """
    path = Path(path)
    headings, separator, rows = read_rows(path)
    texts: tuple[str, ...] = SPECIMEN_TEXTS
    if "part" in (name.casefold() for name in headings):
        texts += _PART_TEXTS
    known = {name.casefold(): name for name in (*texts, *SPECIMEN_COLUMNS)}
    columns = [known.get(name.casefold(), name) for name in headings]
    for name in columns:
        if columns.count(name) > 1:
            raise FileError(f"{path.name}: two columns {name!r}; keep one")
    if "specimen" not in columns or _MADE_OF.isdisjoint(columns):
        raise FileError(
            f"{path.name}: columns are {', '.join(columns)}; 'specimen' and 'material' (or "
            "'profile', or 'part') are needed"
        )
    specimens: dict[str, tuple[int, ListedSpecimen]] = {}
    for line, cells in rows:
        where = f"{path.name}, line {line}"
        if len(cells) > len(columns):
            raise FileError(
                f"{where}: {len(cells)} cells for {len(columns)} columns; a comma within a cell "
                "needs quotes"
            )
        row = _listed(dict(zip(columns, cells, strict=False)), texts, separator, where)
        before = specimens.setdefault(row.specimen, (line, row))[0]
        if before != line:
            raise FileError(
                f"{where}: specimen {row.specimen!r} stands on line {before} already; give each "
                "specimen its own id"
            )
    if not specimens:
        raise FileError(f"{path.name}: no specimen; write one row a specimen")
    return tuple(row for _, row in specimens.values())


_MADE_OF = frozenset({"material", "profile", "part"})


def _listed(
    record: Mapping[str, str], names: Sequence[str], separator: str, where: str
) -> ListedSpecimen:
    texts: dict[str, Any] = {name: record.get(name, "") for name in names}
    if not texts["specimen"]:
        raise FileError(f"{where}: column 'specimen' is empty; give the specimen an id")
    given = {name: texts[name] for name in ("material", "profile", "part") if name in texts}
    if sum(map(bool, given.values())) != 1:
        got = " and ".join(map(repr, given.values()))
        raise FileError(
            f"{where}: give exactly one of {' and '.join(map(repr, given))} (got {got})"
        )
    if not texts.get("part"):
        loose = next((name for name in _PART_TEXTS[1:] if texts.get(name)), None)
        if loose is not None:
            raise FileError(f"{where}: {loose!r} goes with a part; give one, or leave it empty")
    elif record.get("gauge_mm"):
        raise FileError(f"{where}: a part has no 'gauge_mm'; leave it empty")
    record, mode = _without_mode(record)
    conditions: dict[str, Any] = {
        column.name: _condition(record.get(column.name, ""), column, separator, where)
        for column in SPECIMEN_COLUMNS.values()
    }
    known = {*names, *SPECIMEN_COLUMNS, ""}
    others = {name: value for name, value in record.items() if name not in known}
    return ListedSpecimen(**texts, **conditions, mode=mode, covariates=MappingProxyType(others))


def _without_mode(record: Mapping[str, str]) -> tuple[Mapping[str, str], str]:
    """Return a row whose protocol does not say how the specimen was loaded, and what it said.

    Nothing more of a protocol is a monotonic test.
    """
    words = record.get("protocol", "").casefold().split()
    mode = next((word for word in words if word in _MODES), "")
    if not mode:
        return record, ""
    return {**record, "protocol": " ".join(w for w in words if w != mode) or "monotonic"}, mode


def _condition(cell: str, column: SpecimenColumn, separator: str, where: str) -> str | float | None:
    if not cell:
        return None
    if column.choices is not None:
        if column.choices and cell.casefold() not in column.choices:
            allowed = ", ".join(column.choices)
            raise FileError(f"{where}: {column.name} is {cell!r}; it must be one of {allowed}")
        return cell.casefold() if column.choices else cell
    value = number(cell, separator)
    hint = ""
    measured = value is not None and abs(value) <= LARGEST_FIGURE
    if value is None or not measured or (column.between is None and value <= 0):
        must = "a number" if column.between else "a number above 0"
    else:
        low, high = column.between or (0.0, math.inf)
        if low <= value <= high:
            return value
        must = f"from {low:g} to {high:g}" if math.isfinite(high) else f"{low:g} or more"
        hint = "; kelvin or degrees Fahrenheit?" if column.name == "temperature_C" else ""
    raise FileError(
        f"{where}: {column.name} is {cell!r}; it must be {must}, or empty if unknown{hint}"
    )
