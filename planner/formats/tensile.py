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
from planner.formats.tables import (
    QUANTITY_UNITS,
    TextRow,
    finite_numbers,
    is_unit,
    number,
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
class _Heading:
    """A heading taken apart: a key of the known meanings, and its unit (None: not stated)."""

    text: str
    meaning: str
    unit: str | None


@dataclass(frozen=True, slots=True)
class _Meaning:
    """Canonical column name of a heading, and the factor to its unit."""

    heading: _Heading
    column: str
    factor: float


def _meaning(name: str) -> str | None:
    return _MEANING.get(re.sub(r"[\s_]+", " ", name).strip().casefold())


def _parse_heading(text: str) -> _Heading | None:
    """Take a heading apart, or return None where it names nothing that is known.

    "Load (lbf)", "Load [lbf]", "force_N", "Load N" and a bare "Load" are understood.
    """
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed and (meaning := _meaning(bracketed[1])) is not None:
        # "Tensile strain (Displacement)" names where the strain comes from, not a unit.
        if is_unit(bracketed[2]) or _meaning(text) is None:
            return _Heading(text, meaning, bracketed[2])
        return _Heading(text, meaning, None)
    if (meaning := _meaning(text)) is not None:
        return _Heading(text, meaning, None)
    if bracketed and (inner := _parse_heading(bracketed[1])) is not None:
        return _Heading(text, inner.meaning, bracketed[2])
    suffixed = _SUFFIXED.fullmatch(text)
    if suffixed and (meaning := _meaning(suffixed[1])) is not None:
        return _Heading(text, meaning, suffixed[2])
    spaced = _SPACED.fullmatch(text)
    # Only a known unit: a "Load cell" and a "Time stamp" are no columns.
    if spaced and is_unit(spaced[2]) and (meaning := _meaning(spaced[1])) is not None:
        return _Heading(text, meaning, spaced[2])
    return None


def _column_of(heading: _Heading, *, where: str) -> _Meaning:
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
    return _Meaning(heading, column, unit_factor(quantity, unit or "", where=where))


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
_SPEED = {
    f"{length}/{time}": QUANTITY_UNITS["length"][length] / QUANTITY_UNITS["time"][time]
    for length in ("mm", "in")
    for time in ("min", "s")
}
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
_LENGTHS = {"displacement", "elongation", "strain", "stretch", "true strain"}
_LOADS = {"force", "stress", "true stress"}


@dataclass(frozen=True, slots=True)
class _Layout:
    separator: str
    headings: list[_Heading | None]
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
    meanings: dict[int, _Meaning] = {}
    for index, heading in enumerate(headings):
        if heading is None or heading.meaning == "specimen":
            continue
        try:
            meaning = _column_of(heading, where=where)
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
    lines = [line for line, _ in rows]
    values = {
        m.column: m.factor
        * finite_numbers([c[i] for _, c in rows], lines, layout.separator, where, m.heading.text)
        for i, m in meanings.items()
    }
    without_unit = {m.column for m in meanings.values() if m.heading.unit is None}
    if "stretch" in values:
        values.setdefault("strain", values.pop("stretch") - 1.0)
        without_unit.discard("stretch")
    named = next((i for i, h in enumerate(headings) if h and h.meaning == "specimen"), None)
    groups: dict[str, list[int]] = {}
    for position, (_, cells) in enumerate(rows):
        groups.setdefault("" if named is None else cells[named], []).append(position)
    return tuple(
        TensileTable(
            file=where,
            columns=MappingProxyType({name: array[at] for name, array in values.items()}),
            factors=MappingProxyType({m.column: m.factor for m in meanings.values()}),
            lines=np.array(lines, dtype=np.int64)[at],
            specimen=specimen or str(head.get("specimen", "")),
            metadata=MappingProxyType(head),
            without_unit=frozenset(without_unit),
            notes=tuple(notes),
        )
        for specimen, at in groups.items()
    )


def _with_mark10_units(layout: _Layout, where: str) -> tuple[list[_Heading | None], list[str]]:
    units = _mark10_units(layout.head, where=where)
    headings: list[_Heading | None] = [
        _Heading(h.text, h.meaning, units[h.meaning])
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
            headings = [_parse_heading(cell) if cell else None for cell in cells]
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
    known = [sum(_parse_heading(cell) is not None for cell in cells if cell) for _, cells in rows]
    if not any(known):
        return ""
    line, cells = rows[known.index(max(known))]
    quoted = ", ".join(cell if len(cell) <= 30 else f"{cell[:27]}..." for cell in cells[:8])
    return f"; line {line} comes nearest: {quoted}"


def _layout_by_position(text: str, name: str, columns: Sequence[str]) -> _Layout:
    headings: list[_Heading | None] = []
    for column in columns:
        heading = None if column.strip() in ("", "-") else _parse_heading(column.strip())
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


def _with_units(headings: list[_Heading | None], units: list[str]) -> list[_Heading | None]:
    padded = units + [""] * (len(headings) - len(units))
    return [
        h if h is None or h.unit is not None or not unit.strip("()[] ")
        else _Heading(h.text, h.meaning, unit.strip("()[] "))
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
    material, profile
        Exactly one is given: a material of one piece, or the file of a graded bar's design.
    mode
        How it was loaded, as a protocol such as "cyclic compression" says; "" where it does not.
    covariates
        Further columns as the lab wrote them, by name.
    """

    specimen: str
    material: str = ""
    profile: str = ""
    file: str = ""
    gauge_mm: float | None = None
    mode: str = ""
    covariates: Mapping[str, str] = field(default_factory=dict)

    def conditions(self) -> dict[str, Any]:
        """Return what the row says in each of `SPECIMEN_COLUMNS`."""
        return {name: getattr(self, name) for name in SPECIMEN_COLUMNS}


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
    headings, separator, rows = read_rows(path)
    known = {name.casefold(): name for name in (*SPECIMEN_TEXTS, *SPECIMEN_COLUMNS)}
    columns = [known.get(name.casefold(), name) for name in headings]
    for name in columns:
        if columns.count(name) > 1:
            raise FileError(f"{path.name}: two columns {name!r}; keep one")
    if "specimen" not in columns or not {"material", "profile"} & set(columns):
        raise FileError(
            f"{path.name}: columns are {', '.join(columns)}; 'specimen' and 'material' (or "
            "'profile') are needed"
        )
    specimens: dict[str, tuple[int, ListedSpecimen]] = {}
    for line, cells in rows:
        where = f"{path.name}, line {line}"
        if len(cells) > len(columns):
            raise FileError(
                f"{where}: {len(cells)} cells for {len(columns)} columns; a comma within a cell "
                "needs quotes"
            )
        row = _listed(dict(zip(columns, cells, strict=False)), separator, where)
        before = specimens.setdefault(row.specimen, (line, row))[0]
        if before != line:
            raise FileError(
                f"{where}: specimen {row.specimen!r} stands on line {before} already; give each "
                "specimen its own id"
            )
    if not specimens:
        raise FileError(f"{path.name}: no specimen; write one row a specimen")
    return tuple(row for _, row in specimens.values())


def _listed(record: Mapping[str, str], separator: str, where: str) -> ListedSpecimen:
    texts: dict[str, Any] = {name: record.get(name, "") for name in SPECIMEN_TEXTS}
    if not texts["specimen"]:
        raise FileError(f"{where}: column 'specimen' is empty; give the specimen an id")
    if bool(texts["material"]) == bool(texts["profile"]):
        raise FileError(
            f"{where}: give exactly one of 'material' and 'profile' (got "
            f"{texts['material']!r} and {texts['profile']!r})"
        )
    record, mode = _without_mode(record)
    conditions: dict[str, Any] = {
        column.name: _condition(record.get(column.name, ""), column, separator, where)
        for column in SPECIMEN_COLUMNS.values()
    }
    known = {*SPECIMEN_TEXTS, *SPECIMEN_COLUMNS, ""}
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
    if value is None or not math.isfinite(value) or (column.between is None and value <= 0):
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
