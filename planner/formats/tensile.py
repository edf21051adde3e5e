"""Tensile test files: what a testing machine exports, and the list of specimens beside it."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from planner.errors import FileError
from planner.formats.tables import TextRow, is_unit, number, read_text, split_rows, unit_factor
from planner.numerics import FloatArray, IntArray

__all__ = [
    "ListedSpecimen",
    "TensileTable",
    "column_of",
    "is_specimens_file",
    "parse_heading",
    "read_specimens",
    "read_tensile",
]


# ------------------------------------------------------------------------------------------------
# What a column's heading means: which quantity, in which unit.


_NAMES = {
    "time": ("time", "elapsed time", "test time", "total time"),
    "force": ("force", "load", "standard force", "tensile force", "tensile load", "axial force"),
    "displacement": (
        "displacement", "disp", "extension", "travel", "position", "crosshead", "stroke",
        "crosshead displacement", "crosshead extension", "tensile extension", "distance",
        "tensile displacement", "axial displacement", "standard travel",
    ),
    "elongation": ("elongation", "deformation"),
    "strain": (
        "strain", "ε", "engineering strain", "nominal strain", "tensile strain", "axial strain",
        "strain 1", "tensile strain (extension)", "tensile strain (displacement)",
        "tensile strain (strain 1)", "eng strain",
    ),
    "stress": (
        "stress", "σ", "engineering stress", "nominal stress", "tensile stress", "axial stress",
        "eng stress",
    ),
    "stretch": ("stretch", "stretch ratio", "lambda"),
    "true strain": ("true strain",),
    "true stress": ("true stress",),
    "specimen": ("specimen", "specimen id"),
}  # fmt: skip
_MEANING = {name: meaning for meaning, names in _NAMES.items() for name in names}
_COLUMN = {
    "time": ("time_s", "time"),
    "force": ("force_N", "force"),
    "displacement": ("displacement_mm", "length"),
    "strain": ("strain", "strain"),
    "stress": ("stress_MPa", "stress"),
    "stretch": ("stretch", "strain"),
    "true strain": ("true_strain", "strain"),
    "true stress": ("true_stress_MPa", "stress"),
}
_UNIT_OPTIONAL = {"strain", "stretch", "true strain"}
_BRACKETED = re.compile(r"(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*")
_SUFFIXED = re.compile(r"(.+)_([^_\s]+)")
_SPACED = re.compile(r"(.+)\s(\S+)")


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading taken apart: a key of the known meanings, and its unit (None: not stated)."""

    text: str
    meaning: str
    unit: str | None


@dataclass(frozen=True, slots=True)
class Meaning:
    """Canonical column name, and the factor to its unit."""

    column: str
    factor: float
    unit_stated: bool


def _meaning(name: str) -> str | None:
    return _MEANING.get(re.sub(r"[\s_]+", " ", name).strip().casefold())


def parse_heading(text: str) -> Heading | None:
    """Take a heading apart, or return None where it names nothing that is known.

    "Load (lbf)", "Load [lbf]", "force_N", "Load N" and a bare "Load" are understood.
    """
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed and (meaning := _meaning(bracketed[1])) is not None:
        # "Tensile strain (Displacement)" names where the strain comes from, not a unit.
        if is_unit(bracketed[2]) or _meaning(text) is None:
            return Heading(text, meaning, bracketed[2])
        return Heading(text, meaning, None)
    if (meaning := _meaning(text)) is not None:
        return Heading(text, meaning, None)
    if bracketed and (inner := parse_heading(bracketed[1])) is not None:
        return Heading(text, inner.meaning, bracketed[2])
    suffixed = _SUFFIXED.fullmatch(text)
    if suffixed and (meaning := _meaning(suffixed[1])) is not None:
        return Heading(text, meaning, suffixed[2])
    spaced = _SPACED.fullmatch(text)
    # Only a known unit: a "Load cell" and a "Time stamp" are no columns.
    if spaced and is_unit(spaced[2]) and (meaning := _meaning(spaced[1])) is not None:
        return Heading(text, meaning, spaced[2])
    return None


def column_of(heading: Heading, *, where: str) -> Meaning:
    """Return the canonical column of a heading, with the factor to its unit.

    Raises
    ------
    FileError
        The unit is missing where one is needed, or is unknown.
    """
    where = f"{where}, column {heading.text!r}"
    meaning, unit = heading.meaning, heading.unit
    if meaning == "elongation":
        # Bench software calls both the travel and the per cent of gauge length so.
        meaning = "strain" if unit is not None and "%" in unit else "displacement"
    column, quantity = _COLUMN[meaning]
    if unit is None and meaning not in _UNIT_OPTIONAL:
        raise FileError(
            f"{where}: no unit; write it in the heading, as '{heading.text} (unit)', "
            f"or name the columns yourself, as {column}"
        )
    return Meaning(column, unit_factor(quantity, unit or "", where=where), unit is not None)


# ------------------------------------------------------------------------------------------------
# What stands above a record's columns: machine, specimen sizes, units.


_SIZES = {
    "width": "width_mm",
    "thickness": "thickness_mm",
    "length": "gauge_mm",
    "gauge length": "gauge_mm",
    "gage length": "gauge_mm",
}
_PREAMBLE_TEXTS = {
    "material": "material",
    "specimen label": "specimen",
    "specimen name": "specimen",
    "specimen id": "specimen",
}
_SPEED = {"mm/min": 1 / 60, "mm/s": 1.0, "in/min": 25.4 / 60, "in/s": 25.4}
_KEY = re.compile(r"(?:.* : )?(?:specimen )?(.*?)\s*(?:[\(\[](.*)[\)\]])?\s*:?", re.IGNORECASE)


def _metadata(rows: Sequence[TextRow], separator: str, *, where: str) -> dict[str, float | str]:
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
        name = _PREAMBLE_TEXTS.get(f"specimen {key}") or _PREAMBLE_TEXTS.get(key)
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
_LENGTHS = {"displacement", "elongation", "strain", "stretch", "true strain"}
_LOADS = {"force", "stress", "true stress"}


@dataclass(frozen=True, slots=True)
class _Layout:
    separator: str
    headings: list[Heading | None]
    head: list[TextRow]
    body: list[TextRow]


def read_tensile(
    path: str | Path, *, columns: Sequence[str] | None = None
) -> tuple[TensileTable, ...]:
    """Read the records in a file, one a specimen.

    Parameters
    ----------
    columns
        Headings in place of the file's own, by position ("force_N", "Load (lbf)"; "-" leaves a
        column out), for a file without headings or without units.

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
    layout = _layout(read_text(path), where, columns)
    head = _metadata(layout.head, layout.separator, where=where)
    headings, notes = _with_mark10_units(layout, where)
    meanings: dict[int, Meaning] = {}
    for index, heading in enumerate(headings):
        if heading is None or heading.meaning == "specimen":
            continue
        try:
            meaning = column_of(heading, where=where)
        except FileError as error:
            if heading.meaning != "time":
                raise
            notes.append(f"{error}; time is optional and is left out")
            continue
        if any(meaning.column == m.column for m in meanings.values()):
            notes.append(
                f"{where}: column {heading.text!r} left out, {meaning.column} stands before"
            )
        else:
            meanings[index] = meaning
    rows, ended = _data_rows(layout, set(meanings), where)
    if not rows:
        raise FileError(f"{where}: headings but no numbers below them; export the raw data too")
    if ended is not None:
        notes.append(f"{where}: what stands from line {ended} on is no part of the record")
    values = {
        m.column: _numbers(rows, i, layout.separator, where, headings[i]) * m.factor
        for i, m in meanings.items()
    }
    without_unit = {m.column for m in meanings.values() if not m.unit_stated}
    if "stretch" in values:
        values.setdefault("strain", values.pop("stretch") - 1.0)
        without_unit.discard("stretch")
    lines = np.array([line for line, _ in rows], dtype=np.int64)
    named = next((i for i, h in enumerate(headings) if h and h.meaning == "specimen"), None)
    groups: dict[str, list[int]] = {}
    for position, (_, cells) in enumerate(rows):
        groups.setdefault("" if named is None else cells[named], []).append(position)
    return tuple(
        TensileTable(
            file=where,
            columns=MappingProxyType({name: array[at] for name, array in values.items()}),
            lines=lines[at],
            specimen=specimen or str(head.get("specimen", "")),
            metadata=MappingProxyType(head),
            without_unit=frozenset(without_unit),
            notes=tuple(notes),
        )
        for specimen, at in groups.items()
    )


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


def _layout(text: str, name: str, columns: Sequence[str] | None) -> _Layout:
    if columns is not None:
        return _layout_by_position(text, name, columns)
    for separator in _SEPARATORS[:3]:
        rows = split_rows(text, separator)
        for place, (_, cells) in enumerate(rows):
            headings = [parse_heading(cell) if cell else None for cell in cells]
            meanings = {h.meaning for h in headings if h is not None}
            if not (meanings & _LENGTHS and meanings & _LOADS):
                continue
            body = rows[place + 1 :]
            if body and _is_unit_row(body[0][1], separator):
                headings = _with_units(headings, body[0][1])
                body = body[1:]
            return _Layout(separator, headings, rows[:place], body)
    raise FileError(
        f"{name}: no row of headings with a load (force, load, stress) and a length "
        "(displacement, extension, travel, strain, stretch); add headings such as "
        f"'time_s,displacement_mm,force_N', or name the columns by position{_nearest(text)}"
    )


def _nearest(text: str) -> str:
    """Quote the row that comes nearest to one of headings."""
    rows = [row for separator in _SEPARATORS[:3] for row in split_rows(text, separator)]
    known = [sum(parse_heading(cell) is not None for cell in cells if cell) for _, cells in rows]
    if not any(known):
        return ""
    line, cells = rows[known.index(max(known))]
    quoted = ", ".join(cell if len(cell) <= 30 else f"{cell[:27]}..." for cell in cells[:8])
    return f"; line {line} comes nearest: {quoted}"


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
    meanings = {h.meaning for h in headings if h is not None}
    if not (meanings & _LENGTHS and meanings & _LOADS):
        raise FileError(
            f"columns {', '.join(columns)}: name one load (force_N, stress_MPa) and one length "
            "(displacement_mm, strain, stretch)"
        )
    for separator in _SEPARATORS:
        rows = split_rows(text, separator)
        for place, (_, cells) in enumerate(rows):
            filled = [number(c, separator) for c in cells[: len(columns)]]
            wanted = [v for v, h in zip(filled, headings, strict=False)
                      if h is not None and h.meaning != "specimen"]  # fmt: skip
            if len(filled) == len(columns) and None not in wanted:
                return _Layout(separator, headings, rows[:place], rows[place:])
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


def _numbers(
    rows: list[TextRow], index: int, separator: str, where: str, heading: Heading | None
) -> FloatArray:
    values = np.empty(len(rows))
    for position, (line, cells) in enumerate(rows):
        value = number(cells[index], separator)
        if value is None or not np.isfinite(value):
            called = "" if heading is None else heading.text
            raise FileError(
                f"{where}, line {line}, column {called!r}: {cells[index]!r} is no finite number; "
                "repair or remove the line"
            )
        values[position] = value
    return values


# ------------------------------------------------------------------------------------------------
# The list of specimens: what each one is, its size and how it was tested.


_POSITIVE = (
    "width_mm", "thickness_mm", "gauge_mm", "measured_width_mm", "measured_thickness_mm",
    "rate_mm_s",
)  # fmt: skip
_FROM_TO = {
    "temperature_C": (-100.0, 300.0),
    "soak_h": (0.0, math.inf),
    "age_days": (0.0, math.inf),
}
"""Beyond these temperatures every elastomer and jetted resin is glass, or decomposes."""

_NUMBERS = (*_POSITIVE, *_FROM_TO)
_CHOICES = {
    "orientation": ("x", "y", "z"),
    "protocol": ("monotonic", "cyclic", "relaxation"),
}
_SPECIMEN_TEXTS = ("specimen", "material", "profile", "file", "batch")
_COLUMNS = (*_SPECIMEN_TEXTS, *_CHOICES, *_NUMBERS)


@dataclass(frozen=True, slots=True)
class ListedSpecimen:
    """One row of specimens.csv; None or "" stands for an empty cell, which means unknown.

    Attributes
    ----------
    material, profile
        Exactly one is given: a material of one piece, or the file of a graded bar's design.
    covariates
        Further columns as the lab wrote them, by name.
    """

    specimen: str
    material: str = ""
    profile: str = ""
    file: str = ""
    batch: str = ""
    width_mm: float | None = None
    thickness_mm: float | None = None
    gauge_mm: float | None = None
    measured_width_mm: float | None = None
    measured_thickness_mm: float | None = None
    rate_mm_s: float | None = None
    temperature_C: float | None = None
    soak_h: float | None = None
    age_days: float | None = None
    orientation: str = ""
    protocol: str = ""
    covariates: Mapping[str, str] = field(default_factory=dict)

    @property
    def area_mm2(self) -> float | None:
        """Undeformed section, from measured sizes where there are any."""
        width = self.measured_width_mm or self.width_mm
        thickness = self.measured_thickness_mm or self.thickness_mm
        return None if width is None or thickness is None else width * thickness


def is_specimens_file(path: str | Path) -> bool:
    """Say whether a file lists specimens: a column `specimen`, and `material` or `profile`."""
    first = read_text(Path(path)).lstrip("\n").splitlines()[0]
    return any(
        "specimen" in cells and ("material" in cells or "profile" in cells)
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
    text = read_text(path)
    lines = text.splitlines()
    separator = max(",;\t", key=next((line for line in lines if line.strip()), "").count)
    rows = [(line, cells) for line, cells in split_rows(text, separator) if any(cells)]
    known = {name.casefold(): name for name in _COLUMNS}
    columns = [known.get(name.casefold(), name) for name in rows[0][1]]
    for name in columns:
        if columns.count(name) > 1:
            raise FileError(f"{path.name}: two columns {name!r}; keep one")
    if "specimen" not in columns or not {"material", "profile"} & set(columns):
        raise FileError(
            f"{path.name}: columns are {', '.join(columns)}; 'specimen' and 'material' (or "
            "'profile') are needed"
        )
    specimens: list[ListedSpecimen] = []
    seen: dict[str, int] = {}
    for line, cells in rows[1:]:
        if len(cells) > len(columns):
            raise FileError(
                f"{path.name}, line {line}: {len(cells)} cells for {len(columns)} columns; a "
                "comma within a cell needs quotes"
            )
        record = dict(zip(columns, cells, strict=False))
        specimen = _specimen(record, separator, f"{path.name}, line {line}")
        if specimen.specimen in seen:
            raise FileError(
                f"{path.name}, line {line}: specimen {specimen.specimen!r} stands on line "
                f"{seen[specimen.specimen]} already; give each specimen its own id"
            )
        seen[specimen.specimen] = line
        specimens.append(specimen)
    if not specimens:
        raise FileError(f"{path.name}: no specimen; write one row a specimen")
    return tuple(specimens)


def _specimen(record: Mapping[str, str], separator: str, where: str) -> ListedSpecimen:
    texts: dict[str, Any] = {name: record.get(name, "") for name in _SPECIMEN_TEXTS}
    if not texts["specimen"]:
        raise FileError(f"{where}: column 'specimen' is empty; give the specimen an id")
    if bool(texts["material"]) == bool(texts["profile"]):
        raise FileError(
            f"{where}: give exactly one of 'material' and 'profile' (got "
            f"{texts['material']!r} and {texts['profile']!r})"
        )
    for name, allowed in _CHOICES.items():
        texts[name] = record.get(name, "").casefold()
        if texts[name] and texts[name] not in allowed:
            raise FileError(
                f"{where}: {name} is {record[name]!r}; it must be one of {', '.join(allowed)}"
            )
    sizes: dict[str, Any] = {
        name: _size(record.get(name, ""), name, separator, where) for name in _NUMBERS
    }
    return ListedSpecimen(
        **texts,
        **sizes,
        covariates=MappingProxyType(
            {name: value for name, value in record.items() if name not in _COLUMNS and name}
        ),
    )


def _size(cell: str, name: str, separator: str, where: str) -> float | None:
    if not cell:
        return None
    value = number(cell, separator)
    if value is None or not math.isfinite(value) or (name in _POSITIVE and value <= 0):
        must = "a number above 0" if name in _POSITIVE else "a number"
        raise FileError(f"{where}: {name} is {cell!r}; it must be {must}, or empty if unknown")
    low, high = _FROM_TO.get(name, (-math.inf, math.inf))
    if not low <= value <= high:
        must = f"from {low:g} to {high:g}" if math.isfinite(high) else f"{low:g} or more"
        hint = "; kelvin or degrees Fahrenheit?" if name == "temperature_C" else ""
        raise FileError(
            f"{where}: {name} is {cell!r}; it must be {must}, or empty if unknown{hint}"
        )
    return value
