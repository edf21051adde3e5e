"""Tables of numbers with known columns: profiles and strain fields."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.formats.tensile.text_rows import iterate_rows, number, read_text
from planner.formats.tensile.units import unit_factor

__all__ = ["ColumnFile", "read_columns"]

_BRACKETED = re.compile(r"(.+?)\s*[\(\[]\s*(.*?)\s*[\)\]]")


@dataclass(frozen=True, slots=True, eq=False)
class ColumnFile:
    """The columns of a file, in planner's units.

    Attributes
    ----------
    numbers
        Arrays of one length by column.
    texts
        The same of the column `specimen`, if that was asked for.
    lines
        Line number of each row.
    """

    numbers: Mapping[str, FloatArray]
    texts: tuple[str, ...]
    lines: tuple[int, ...]


def read_columns(
    path: Path,
    columns: Mapping[str, str | None],
    *,
    optional: frozenset[str] = frozenset(),
    with_specimen: bool = False,
) -> ColumnFile:
    """Read a table whose columns are known.

    Parameters
    ----------
    columns
        Name, with its unit as suffix, and quantity (see `unit_factor`; None for a bare number).
        Another unit of that quantity may stand in the heading: "x_in", "x (in)".
    optional
        Columns that may be absent.
    with_specimen
        The file has a text column `specimen` besides.

    Raises
    ------
    FileError
        A column that is missing, double or unknown, a unit that is unknown, or a cell that is
        no finite number; the message names file, line and column.
    """
    where = path.name
    text = read_text(path)
    first = next(line for line in text.splitlines() if line.strip())
    separator = max(",;\t", key=first.count)
    rows = ((line, cells) for line, cells in iterate_rows(text, separator) if any(cells))
    headings = next(rows)[1]
    places: dict[str, tuple[int, float]] = {}
    named: int | None = None
    for index, heading in enumerate(headings):
        if heading == "specimen" and with_specimen:
            named = index
            continue
        found = _column(heading, columns, where)
        if found is None:
            raise FileError(f"{where}: unknown column {heading!r}; it has {', '.join(columns)}")
        if found[0] in places:
            raise FileError(f"{where}: two columns {found[0]!r}; keep one")
        places[found[0]] = (index, found[1])
    missing = [c for c in columns if c not in places and c not in optional]
    if with_specimen and named is None:
        missing.insert(0, "specimen")
    if missing:
        raise FileError(
            f"{where}: no column {' nor '.join(map(repr, missing))}; its columns are "
            f"{', '.join(headings)}"
        )
    columns_of_text: list[list[str]] = [[] for _ in headings]
    lines: list[int] = []
    for line, cells in rows:
        if len(cells) != len(headings):
            raise FileError(f"{where}, line {line}: {len(cells)} cells for {len(headings)} columns")
        lines.append(line)
        for column, cell in zip(columns_of_text, cells, strict=True):
            column.append(cell)
    if not lines:
        raise FileError(f"{where}: headings but no numbers below them; export the file again")
    numbers = {
        name: factor * _numbers(columns_of_text[i], lines, separator, where, headings[i])
        for name, (i, factor) in places.items()
    }
    return ColumnFile(numbers, () if named is None else tuple(columns_of_text[named]), tuple(lines))


def _column(
    heading: str, columns: Mapping[str, str | None], where: str
) -> tuple[str, float] | None:
    if heading in columns:
        return heading, 1.0
    bracketed = _BRACKETED.fullmatch(heading)
    for name, quantity in columns.items():
        base = name.rpartition("_")[0]
        if quantity is None or not base:
            continue
        if heading == base:
            raise FileError(f"{where}, column {heading!r}: no unit; head it {name!r}")
        if bracketed and bracketed[1] == base:
            unit = bracketed[2]
        elif heading.rpartition("_")[0] == base:
            unit = heading.rpartition("_")[2]
        else:
            continue
        return name, unit_factor(quantity, unit, where=f"{where}, column {heading!r}")
    return None


def _numbers(
    cells: Sequence[str], lines: Sequence[int], separator: str, where: str, heading: str
) -> FloatArray:
    values = [number(cell, separator) for cell in cells]
    for line, cell, value in zip(lines, cells, values, strict=True):
        if value is None or not math.isfinite(value):
            raise FileError(
                f"{where}, line {line}, column {heading!r}: {cell!r} is no finite number; "
                "repair or remove the line"
            )
    return np.array(values, dtype=np.float64)
