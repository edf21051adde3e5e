"""Read a tensile file: generic CSV, Mark-10 MESURgauge or Instron Bluehill.

One way for all: the head is whatever stands above the first row of headings that names a load
and a length; a row of bare units below the headings (Bluehill) or units in the head (MESURgauge)
fill what the headings leave open.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.formats.tensile.headings import Heading, Meaning, column_of, parse_heading
from planner.formats.tensile.preamble import mark10_units, metadata
from planner.formats.tensile.table import TensileTable
from planner.formats.tensile.text_rows import TextRow, number, read_text, split_rows
from planner.formats.tensile.units import is_unit

__all__ = ["read_tensile"]

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
    head = metadata(layout.head, layout.separator, where=where)
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
    units = mark10_units(layout.head, where=where)
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
