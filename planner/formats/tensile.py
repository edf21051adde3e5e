"""Tensile test files, and the list of specimens: its columns, and what an empty cell stands for."""

import functools
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, permutations
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, get_args

import numpy as np

from planner.errors import ArgumentError, FileError
from planner.formats.files import read_file
from planner.formats.headings import (
    HeadedColumn,
    Heading,
    column_of,
    head_text,
    is_of_crosshead,
    marked_specimen,
    may_be_nearer,
    mode_of,
    parse_heading,
    size_of,
    split_value,
)
from planner.formats.tables import (
    LARGEST_FIGURE,
    LONGEST_HEADING,
    TextRow,
    decode_text,
    finite_numbers,
    is_unit,
    number,
    quantities_of,
    read_rows,
    split_rows,
    unit_factor,
)
from planner.formats.workbook import is_workbook, read_sheets
from planner.numerics import FloatArray, IntArray

__all__ = [
    "SPECIMEN_COLUMNS",
    "SPECIMEN_TEXTS",
    "ListedSpecimen",
    "NoRecordError",
    "SpecimenConditions",
    "TensileTable",
    "is_specimens_file",
    "read_specimens",
    "read_tensile",
]


# ------------------------------------------------------------------------------------------------
# What a test's file holds once its columns have planner's names and units.


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
        What the file says beside the columns: width_mm, thickness_mm, diameter_mm, area_mm2,
        gauge_mm, rate_mm_s (numbers), material, specimen, mode (texts); whichever it has.
    without_unit
        Columns whose header gave no unit, so that one was assumed.
    notes
        What was assumed or left out in reading.
    sheet
        Of a workbook, else "".
    headings
        By column: its heading in the file.
    unused
        Headings of the record's other columns.
    sources
        By size: where the file says it.
    unclear
        By size: the readings of which the file does not say which one holds.
    """

    file: str
    columns: Mapping[str, FloatArray]
    factors: Mapping[str, float]
    lines: IntArray
    specimen: str
    metadata: Mapping[str, float | str]
    without_unit: frozenset[str]
    notes: tuple[str, ...]
    sheet: str = ""
    headings: Mapping[str, str] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    sources: Mapping[str, str] = field(default_factory=dict)
    unclear: Mapping[str, str] = field(default_factory=dict)


# ------------------------------------------------------------------------------------------------
# Read a test's file, whatever machine wrote it.
#
# One way for all: a file is sheets, a sheet is a grid of cells (of a text, by the separator that
# makes headings of it). A row that names a load and a length heads a block of numbers; units
# stand in it, below it or in the sheet's head. Its columns are one record, or several side by
# side; its rows are one specimen's, or a column tells several apart. Blocks of one name go on
# with one another. Sizes are looked for in all cells that are no columns of numbers.


_SEPARATORS = ("\t", ";", ",", "|", "  ", " ")
_LENGTHS = {"displacement", "position", "elongation", "strain", "stretch", "true strain"}
_LOADS = {"force", "stress", "true stress"}
_LENGTH_COLUMNS = ("strain", "true_strain", "displacement_mm")
_BLOCKS = ("join", "apart")


class NoRecordError(FileError):
    """A file without any table that could be a record of a test."""


_FEWEST_ROWS = 3
"""Of a record beside others: two points are a line, and a table of results has fewer."""


_Headings = Sequence[Heading]
"""A row's; of a cell that is not understood the meaning is ""."""


@dataclass(frozen=True, slots=True)
class _Grid:
    """A sheet's cells, the separator of its numbers (see `number`), and how it is to be read."""

    where: str
    sheet: str
    separator: str
    rows: list[TextRow]
    by_position: _Headings | None
    option: str

    def number(self, cell: str) -> float | None:
        return number(cell, self.separator)

    def is_number(self, cell: str) -> bool:
        return self.number(cell) is not None or _CLOCK.fullmatch(cell) is not None


@dataclass(frozen=True, slots=True)
class _Block:
    """Headings with the numbers below them: `start` is the first row above that belongs to it."""

    start: int
    place: int
    headings: _Headings
    rows: list[int]


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """The columns of one specimen in one block; `texts` are those of material and mode."""

    name: str
    grid: _Grid
    block: _Block
    columns: Mapping[str, FloatArray]
    used: Sequence[HeadedColumn]
    lines: list[int]
    unused: tuple[str, ...]
    notes: tuple[str, ...]
    in_column: bool
    texts: Mapping[str, str]


def read_tensile(
    path: str | Path,
    *,
    columns: Sequence[str] | None = None,
    blocks: str | None = None,
    option: str = "",
) -> tuple[TensileTable, ...]:
    """Read the records in a file, one a specimen.

    Parameters
    ----------
    columns
        Headings in place of the file's own, by position ("force_N", "Load (lbf)"; "-" leaves a
        column out), for a file without headings or without units. Given again, they head the
        record beside.
    blocks
        Of blocks of numbers in one sheet that nothing names: "join" reads them as one record,
        "apart" as specimens. None: as their time tells.
    option
        What a user gives `columns` by, for messages; "" where there is no such option.

    Returns
    -------
    tables
        In order of appearance: those of a column `specimen`, of blocks, side by side, of sheets.

    Raises
    ------
    FileError
        No columns that are understood, an unknown unit, a cell that is no number, or blocks that
        may be one record or several; the message names file, line and column.
    """
    path = Path(path)
    if blocks not in (None, *_BLOCKS):
        raise ArgumentError(f"blocks is {blocks!r}; it must be one of {', '.join(_BLOCKS)}")
    data = read_file(path, advice="give the path of a tensile file")
    by_position = None if columns is None else _by_position(columns)
    grids, missed, pieces, notes = list[_Grid](), list[_Grid](), list[_Piece](), list[str]()
    for sheet, text, rows in _sheets(data, path):
        where = f"{path.name}, sheet {sheet!r}" if sheet else path.name
        grid, found = _best_grid(_Grid(where, sheet, "", rows, by_position, option), text)
        (grids if found else missed).append(grid)
        pieces += _joined(_pieces(grid, found, notes), blocks, notes)
    if not (grids or missed):
        raise NoRecordError(f"{path.name}: a workbook without sheets; export the test again")
    if not pieces:
        longest = max(missed, key=_count_numbers)
        few = _count_numbers(longest) < _FEWEST_ROWS
        raise (NoRecordError if few else FileError)(_not_understood(longest))
    notes += [f"{grid.where}: no record of a test" for grid in missed]
    fewest = min(len(piece.lines) for piece in pieces)
    for grid in (*grids, *missed):
        read = {line for piece in pieces if piece.grid is grid for line in piece.lines}
        rest = replace(grid, rows=[row for row in grid.rows if row[0] not in read])
        if _count_numbers(rest) * (1 if grid in missed else 4) >= fewest:
            said = _not_understood(rest)
            raise FileError(f"{said}; the rest of the file is understood")
    return _tables(path, pieces, [*grids, *missed], notes)


def _sheets(data: bytes, path: Path) -> Iterator[tuple[str, str, list[TextRow]]]:
    """Yield each sheet: its name, its text where it is one, and its rows where it is none."""
    if is_workbook(data):
        for name, rows in read_sheets(data, path.name):
            yield name or path.name, "", list(enumerate(rows, start=1))
    else:
        yield "", decode_text(data, path), []


def _best_grid(sheet: _Grid, text: str) -> tuple[_Grid, list[_Block]]:
    """Return the cells of a sheet, split so that headings stand above numbers, and its blocks."""
    tried: list[_Grid] = []
    separators = [s for s in _SEPARATORS if s in text or sheet.by_position] if text else []
    for separator in separators or [";"]:
        cells = split_rows(text, separator) if text else sheet.rows
        if separator == " " and sheet.by_position is None:
            cells = _with_headings_of_words(cells)
        grid = replace(sheet, separator=_decimals(cells, separator), rows=cells)
        found = _blocks(grid)
        if any(block.rows for block in found):
            return grid, [block for block in found if block.rows]
        if found and text and separator.strip():
            raise FileError(
                f"{grid.where}: headings but no numbers below them; export the raw data too"
            )
        tried.append(grid)

    def nearness(grid: _Grid) -> tuple[int, int]:
        width = len(_nearest(grid)[1])
        return width if grid.separator.strip() and width > 1 else 0, width

    return max(tried, key=nearness), []


def _with_headings_of_words(rows: list[TextRow]) -> list[TextRow]:
    """Put words between blanks together to headings: "Time Axial Force" are two.

    As few words as make a heading, or as many, whichever gives as many as there are columns below.
    """
    found: list[TextRow] = []
    below = 0
    for line, words in reversed(rows):
        few = len(words) <= _MOST_WORDS and len(words) != below
        choices = [_put_together_words(words, step) for step in (1, -1)] if few else []
        found.append((line, next((c for c in choices if len(c) == below), words)))
        below = len(words) if any(words) else below
    return found[::-1]


_MOST_WORDS = 60


def _put_together_words(words: Sequence[str], step: int) -> list[str]:
    cells: list[str] = []
    at = 0
    while at < len(words):
        ends = range(at + 1, min(len(words), at + 5) + 1)[::step]
        end = next((e for e in ends if parse_heading(" ".join(words[at:e]))), at + 1)
        cells.append(" ".join(words[at:end]))
        at = end
    return cells


def _decimals(rows: Sequence[TextRow], separator: str) -> str:
    """Return the separator by which numbers are read (see `number`).

    Cells in quotes may have decimal commas between commas: "0,5","12,25". A cell that cannot be
    thousands tells, where no number has a dot. Where one sign is seen to be the decimal one, the
    other stands between thousands.
    """
    cells = [cell for _, row in rows for cell in row if cell[:1].isdigit() or cell[:1] in "+-,."]
    dots = any(_DECIMAL_DOT.fullmatch(cell) for cell in cells)
    commas = any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells)
    if separator == ",":
        return ",." if dots else ";," if commas else separator
    return f"{separator}," if commas and not dots and separator.strip(" ") else separator


_DECIMAL_COMMA, _DECIMAL_DOT = (
    re.compile(rf"[+-]?(\d{{4,}}{sign}\d*|\d+{sign}(\d{{1,2}}|\d{{4,}})|0\d*{sign}\d+)")
    for sign in (",", r"\.")
)


# ------------------------------------------------------------------------------------------------
# Blocks: headings, and the numbers below.


def _suffice(headings: Iterable[Heading]) -> bool:
    meanings = {heading.meaning for heading in headings}
    return bool(meanings & _LENGTHS and meanings & _LOADS)


def _headings(cells: Sequence[str]) -> _Headings | None:
    """Return the headings in a row that names a load and a length; None of any other row."""
    if sum(map(bool, cells)) < 2:
        return None
    found = [_heading("" if _is_figure(cell) else cell) for cell in cells]
    return found if _suffice(found) else None


def _heading(cell: str) -> Heading:
    return parse_heading(cell) or Heading(cell, "", None)


def _is_figure(cell: str) -> bool:
    return cell[:1].isdigit() or (cell[:1] in "+-.," and cell[1:2].isdigit())


def _blocks(grid: _Grid) -> list[_Block]:
    rows, found = grid.rows, list[_Block]()
    headings = grid.by_position
    start = at = 0
    while at < len(rows):
        own = _headings(rows[at][1]) if grid.by_position is None else None
        place = at
        if grid.by_position is None and _cell(rows[at][1], 0) == _SEGMENT:
            headings = None
        if own is not None:
            headings, at = _with_units(own, grid, at)
            found.append(_Block(start, place, headings, []))
        elif headings is None:
            at += 1
            continue
        wanted = sum(h.meaning not in ("", "specimen") for h in headings)
        least = 2 if own is not None or found else wanted
        data, at = _numbers_below(grid, headings, at, own is not None, least)
        if data and own is not None:
            found[-1].rows.extend(data)
        elif data:
            found.append(_Block(start, data[0], headings, data))
        if data:
            start = at
    return found


def _with_units(headings: _Headings, grid: _Grid, place: int) -> tuple[_Headings, int]:
    """Return headings with the units that stand in a row of their own, and the row behind.

    The row is below, or, in what LabVIEW writes, above and says so.
    """
    for row in range(place + 1, min(place + 4, len(grid.rows))):
        cells = grid.rows[row][1]
        if any(grid.number(cell) is not None for cell in cells if cell not in ("", "1")):
            break
        units = [cell.strip("()[]{} ") for cell in cells]
        known = [
            h.meaning and unit and (is_unit(unit) or cell[0] in "([")
            for h, unit, cell in zip(headings, units, cells, strict=False)
        ]
        if any(known) and not all(unit.isdigit() for unit in units if unit):
            return _in_units(headings, units), row + 1
    for _, cells in grid.rows[max(place - _NEAR, 0) : place]:
        if cells and _UNITS.search(cells[0]):
            return _in_units(headings, cells), place + 1
    return headings, place + 1


_UNITS = re.compile(r"\bunit|_unit_|einheit|unité|unidad|unità|単位|单位", re.IGNORECASE)


def _in_units(headings: _Headings, units: Sequence[str]) -> _Headings:
    return [
        replace(h, unit=_cell(units, i)) if _cell(units, i) and not is_unit(h.unit or "") else h
        for i, h in enumerate(headings)
    ]


def _numbers_below(
    grid: _Grid, headings: _Headings, at: int, headed: bool, least: int
) -> tuple[list[int], int]:
    """Return the rows of numbers from `at` on, and the row behind them.

    Between headings and numbers texts may stand. A row of numbers and words is taken for one of
    the record while no blank line came before it, so that a damaged cell is told, not dropped; so
    is a row that has a specimen's name alone.
    """
    wanted = [i for i, h in enumerate(headings) if h.meaning not in ("", "specimen")]
    named = [i for i, h in enumerate(headings) if h.meaning == "specimen"]
    found: list[int] = []
    gap = False
    for place in range(at, len(grid.rows)):
        cells = grid.rows[place][1]
        if _cell(cells, 0) == _SEGMENT:
            return found, place + (not found)
        filled = [cells[i] for i in wanted if i < len(cells) and cells[i]]
        words = [cell for cell in filled if not grid.is_number(cell)]
        if not any(cells):
            gap = True
        elif _sums_up(grid, place) or (
            words == filled
            and (filled or not found or not _names_alone([_cell(cells, i) for i in named], cells))
        ):
            if found or not headed or _headings(cells) is not None:
                return found, place if found or headed else place + 1
        elif not found and len(filled) - len(words) < least:
            return found, place + 1
        elif words and found and (gap or _WORD.search(words[0])) and _ends(grid, wanted, place):
            return found, place
        else:
            found.append(place)
            gap = False
    return found, len(grid.rows)


def _names_alone(names: Iterable[str], cells: Sequence[str]) -> bool:
    return any(names) and head_text(cells[0]) != "specimen"


def _sums_up(grid: _Grid, place: int) -> bool:
    """Say whether a row is one of statistics: "Mean" stands before it, and before no other."""
    label = next(filter(None, grid.rows[place][1]), "")
    if len(label) < 2 or _is_figure(label) or not _is_statistic(label):
        return False
    near = grid.rows[max(place - 1, 0) : place + 2]
    return sum(next(filter(None, cells), "") == label for _, cells in near) == 1


_SEGMENT = "Channels"
"""With what a head of LabVIEW's begins, each segment's own."""

_WORD = re.compile(r"[^\W\d_]{3}")


def _ends(grid: _Grid, wanted: Sequence[int], at: int) -> bool:
    """Say whether a row of numbers and words begins what follows a record, as a table of results.

    No row of numbers alone comes before the next one of words alone.
    """
    for _, cells in islice(grid.rows, at + 1, None):
        numbers = [grid.is_number(_cell(cells, i)) for i in wanted]
        if all(numbers):
            return False
        if any(cells) and not any(numbers):
            return True
    return True


# ------------------------------------------------------------------------------------------------
# Pieces: of a block the columns and rows of one specimen.


def _pieces(grid: _Grid, blocks: Sequence[_Block], notes: list[str]) -> list[_Piece]:
    found: list[_Piece] = []
    groups, marked = list[tuple[str, list[int], str]](), ""
    for block in blocks:
        block, told = _with_units_of_head(grid, block)
        longer = [r for r in block.rows if any(grid.rows[r][1][len(block.headings) :])]
        if grid.separator[0] == "," and not grid.by_position and 2 * len(longer) > len(block.rows):
            line, cells = grid.rows[longer[0]]
            raise FileError(
                f"{grid.where}, line {line}: {len(cells)} cells where the headings have "
                f"{len(block.headings)}; a decimal comma needs quotes, or semicolons between cells"
            )
        mark, headed = _marked(grid, block), block.place not in block.rows
        if mark or headed or not groups:  # else it goes on with the names of the one before
            groups, marked = _groups(grid, block), mark
        for name, places, material in groups:
            several = name if len(blocks) == 1 else f"{marked} {name}".strip()
            label = marked if len(groups) == 1 else several
            own = _split(grid, block, places, label, told)
            if material:
                own = [replace(one, texts={"material": material, **one.texts}) for one in own]
            if own and not own[0].name and found and _goes_on(found[-1], own[0]):
                own[0] = replace(own[0], name=found[-1].name)
            found += own
    if results := _results(found):
        line = results[0].lines[0]
        notes.append(f"{grid.where}: from line {line} on a row a specimen, results of the others")
        found = [piece for piece in found if piece not in results]
    longest = {p.block.place: len(p.lines) for p in sorted(found, key=lambda p: len(p.lines))}
    kept: list[_Piece] = []
    for at, piece in enumerate(found):
        near = [p for p in (*kept[::-1], *found[at + 1 :]) if p.name == piece.name]
        alone = not any(_goes_on(*sorted((p, piece), key=lambda p: p.lines[0])) for p in near[:2])
        if alone and longest[piece.block.place] < _FEWEST_ROWS <= max(longest.values()):
            notes.append(f"{grid.where}: line {piece.lines[0]} is no part of a record")
        else:
            kept.append(piece)
    return kept


def _results(pieces: Sequence[_Piece]) -> list[_Piece]:
    """Return what is headed like a record and has one row for each of the records below it."""
    first = [piece for piece in pieces if piece.block is pieces[0].block]
    others = pieces[len(first) :]
    rows = sum(len(piece.lines) for piece in first)
    ends = len(others) < 2 or rows != len(others) or _goes_on(first[-1], others[0])
    return [] if ends or any(len(piece.lines) <= rows for piece in others) else first


def _groups(grid: _Grid, block: _Block) -> list[tuple[str, list[int], str]]:
    """Return the columns of each record that stands in a block, with its name and its material.

    A row of names above the headings tells them apart, then a part of the headings ("S1_force_N"),
    then headings that come again. Names that come again are a material's, or a batch's.
    """

    def whole(places: Iterable[int]) -> bool:
        return _suffice(headings[i] for i in places)

    def walk(places: Iterable[int]) -> list[list[int]]:
        walked: list[list[int]] = [[]]
        for i in places:
            if any(_same(headings[i], headings[j]) for j in walked[-1]) and whole(walked[-1]):
                walked.append([])
            walked[-1].append(i)
        return walked

    headings = block.headings
    known = [i for i, h in enumerate(headings) if h.meaning]
    tags = [h.tag for h in headings]
    above_of: dict[int, str] = {}
    numbered: list[tuple[str, list[int], str]] = []
    for names in (*_names_above(grid, block), tags):
        by_name: dict[str, list[int]] = {}
        for i in known:
            by_name.setdefault(names[min(i, len(names) - 1)], []).append(i)
        shared = [] if whole(by_name.get("", [])) else by_name.pop("", [])
        if any(len(name) < 2 and not whole(places) for name, places in by_name.items()):
            continue  # "Force 1" and "Force 2" may be load cells
        if len(by_name) < 2 or not all(whole([*shared, *at]) for at in by_name.values()):
            continue
        if {name.upper() for name in by_name} == {"X", "Y"} and all(map(whole, by_name.values())):
            raise FileError(_two_axes(grid, headings, by_name))
        called = {
            name: " ".join(name.split()) if "" not in by_name else str(n)
            for n, name in enumerate(by_name, start=1)
        }
        parts = {name: walk(places) for name, places in by_name.items()}
        if any(len(walked) > 1 and all(map(whole, walked)) for walked in parts.values()):
            if names is not tags:
                above_of = above_of or {i: called[name] for name, at in by_name.items() for i in at}
            numbered = numbered or [
                (f"{called[name]} {n}", sorted(shared + places), above_of.get(places[0], ""))
                for name, walked in parts.items()
                for n, places in enumerate(walked, start=1)
            ]
            continue
        return [
            (called[name], sorted(shared + places), above_of.get(places[0], ""))
            for name, places in by_name.items()
        ]
    if numbered:
        return numbered
    walked = walk(known)
    # What comes once, as time does, belongs to all; a length too where a person headed the columns.
    kinds = {"time"} | (_LENGTHS if grid.by_position else set())
    once = [
        i for i in walked[0] if headings[i].meaning in kinds
        and not all(any(_same(headings[i], headings[j]) for j in at) for at in walked[1:])
    ]  # fmt: skip
    found = [walked[0], *([*once, *places] for places in walked[1:])]
    if len(found) < 2 or not all(map(whole, found)):
        return [("", known, "")]
    return [(str(n), places, "") for n, places in enumerate(found, start=1)]


def _two_axes(grid: _Grid, headings: _Headings, by_name: Mapping[str, Sequence[int]]) -> str:
    """Return what is said of a test with a load and a length along each of two axes."""
    said = f"{grid.where}: loads and lengths along {' and '.join(by_name)}, two axes of one test"
    if not grid.option:
        return f"{said}; keep one in the file, with the mode 'equibiaxial' if both are loaded alike"
    examples = [
        _example([h if i in at or h.meaning == "time" else Heading("", "", None)
                  for i, h in enumerate(headings)], twice=True)
        for at in by_name.values()
    ]  # fmt: skip
    choice = " or ".join(f"{grid.option} {example}" for example in examples)
    return f"{said}; take one of them by {choice}, with --mode equibiaxial if both are loaded alike"


def _names_above(grid: _Grid, block: _Block) -> list[list[str]]:
    """Return the rows near above a block that may name its records: of words, then of numbers.

    Figures are sizes; whole numbers may be those of specimens.
    """
    words, numbers = list[list[str]](), list[list[str]]()
    for row in range(block.place - 1, max(block.place - 4, -1), -1):
        cells = [*grid.rows[row][1], ""]
        figures = [cell for cell in cells if grid.number(cell) is not None]
        if not figures:
            words.append(_carried(cells))
        elif all(map(str.isdigit, figures)) and size_of(cells[0])[0] is None:
            numbers.append(_carried(cells))
    return words + numbers


def _carried(cells: Iterable[str]) -> list[str]:
    """Return cells, an empty one as the one before it."""
    last = ""
    return [last := cell or last for cell in cells]


def _same(one: Heading, other: Heading) -> bool:
    plain = [re.sub(r"[\s\d._#-]+", "", h.text.casefold()) for h in (one, other)]
    return (one.meaning, one.unit, plain[0]) == (other.meaning, other.unit, plain[1])


def _marked(grid: _Grid, block: _Block) -> str:
    """Return the specimen that is named above a block and below the one before, or ""."""
    found = ""
    for _, cells in grid.rows[block.start : block.rows[0]]:
        filled = [cell for cell in cells if cell]
        if len(filled) > 1 and head_text(filled[0]) == "specimen":
            found = found if _heading(filled[1]).meaning else filled[1]
        elif len(filled) < 3 and (mark := marked_specimen(" ".join(filled))) is not None:
            found = mark
    return found


def _split(
    grid: _Grid, block: _Block, places: Sequence[int], label: str, told: Sequence[str]
) -> list[_Piece]:
    """Return the pieces of one group of columns: one, or as many as its column of specimens has."""
    where, rows, headings = grid.where, grid.rows, block.headings
    named = next((i for i in places if headings[i].meaning == "specimen"), None)
    alone = len(places) == sum(bool(h.meaning) for h in headings)
    filled = [
        i for i in places if headings[i].meaning in _LOADS | _LENGTHS or (alone and i == named)
    ]
    lined = [r for r in block.rows if any(_cell(rows[r][1], i) for i in filled)]
    if not lined:
        return []
    used, notes = _used_columns(grid, headings, places, lined)
    lines = [rows[r][0] for r in lined]
    values: dict[str, FloatArray] = {}
    for i, column in used.items():
        line, short = next((rows[r] for r in lined if len(rows[r][1]) <= i), (0, []))
        if line:
            raise FileError(
                f"{where}, line {line}: {len(short)} cells where the headings have "
                f"{len(headings)}; complete or remove the line"
            )
        cells = [rows[r][1][i] for r in lined]
        is_time, text = column.name == "time_s", column.heading.text
        cells = [_seconds(cell) for cell in cells] if is_time else cells
        try:
            values[column.name] = finite_numbers(
                cells, lines, grid.separator, where, text, column.factor
            )
        except FileError as error:
            if not is_time or any(grid.number(cell) is not None for cell in cells):
                raise
            notes.append(f"{str(error).partition('; ')[0]}; time is optional and is left out")
    kept = {i: column for i, column in used.items() if column.name in values}
    if "stretch" in values:
        values.setdefault("strain", values.pop("stretch") - 1.0)
    heads = rows[block.place][1] if block.place not in block.rows else []
    texts = {head_text(cell): i for i, cell in enumerate(heads) if cell}
    texts = {what: i for what, i in texts.items() if what in ("material", "mode")}
    unused = tuple(
        cell for i, cell in enumerate(heads)
        if cell and i not in (*kept, *texts.values(), named) and size_of(cell)[0] is None
        and (i in places or not headings[i].meaning) and _cell(rows[lined[0]][1], i)
    )  # fmt: skip

    def words(i: int) -> list[str]:
        return _carried(_cell(rows[r][1], i) for r in lined)

    if named is not None:
        names = words(named)
        counts = len(set(names)) == len(lined)
        # Else a list of specimens beside their records.
        if (counts or not alone) and min(Counter(names).values()) < _FEWEST_ROWS <= len(lined):
            named = None
    if named is None:  # several materials, or modes, are several specimens
        named = next((i for i in texts.values() if len({*words(i)} - {""}) > 1), None)
    groups: dict[str, list[int]] = {}
    for at, name in enumerate([""] * len(lined) if named is None else words(named)):
        groups.setdefault(name, []).append(at)
    return [
        _Piece(
            name or label, grid, block, {column: array[at] for column, array in values.items()},
            tuple(kept.values()), [lines[n] for n in at], unused, (*told, *notes), bool(name),
            {what: _cell(rows[lined[at[0]]][1], i) for what, i in texts.items() if what},
        )
        for name, at in groups.items()
    ]  # fmt: skip


def _cell(cells: Sequence[str], at: int) -> str:
    return cells[at] if at < len(cells) else ""


_CLOCK = re.compile(r"(?:(\d+):)?(\d{1,2}):(\d{1,2}(?:[.,]\d*)?)")


def _seconds(cell: str) -> str:
    """Return a time of the form 0:01:02.5 in seconds; any other cell as it is."""
    clock = _CLOCK.fullmatch(cell)
    if clock is None:
        return cell
    seconds = 3600.0 * int(clock[1] or 0) + 60.0 * int(clock[2]) + float(clock[3].replace(",", "."))
    return f"{seconds:.15g}"


def _used_columns(
    grid: _Grid, headings: _Headings, places: Sequence[int], lined: Sequence[int]
) -> tuple[dict[int, HeadedColumn], list[str]]:
    """Return the columns that serve, by place: of each canonical name the first.

    A crosshead's absolute position serves only where nothing else tells the travel, an
    extensometer goes before the crosshead; one that never moves goes behind the others. A column
    with gaps is left out where the others suffice.

    Raises
    ------
    FileError
        A column without a unit, or two of one kind that differ.
    """
    where, notes = grid.where, list[str]()
    found: dict[int, HeadedColumn] = {}
    cells = {
        i: [_cell(grid.rows[r][1], i) for r in lined]
        for i in places
        if headings[i].meaning != "specimen"
    }
    cells = {i: column for i, column in cells.items() if any(column)}
    if _suffice(headings[i] for i, column in cells.items() if "" not in column):
        for i, j in permutations(cells, 2):
            if "" in cells[i] and "" not in cells[j] and _same(headings[i], headings[j]):
                raise FileError(
                    f"{where}: column {headings[i].text!r} comes again, and what stands beside it "
                    f"is not understood; {_advice(grid.option, _example(headings, twice=True))}"
                )
        notes += [
            f"{where}: column {headings[i].text!r} has empty cells; it is left out"
            for i, column in cells.items()
            if "" in column
        ]
        cells = {i: column for i, column in cells.items() if "" not in column}

    def rank(i: int) -> tuple[bool, bool, bool, bool]:
        meaning, of_crosshead = headings[i].meaning, is_of_crosshead(headings[i].text)
        unmeasured = meaning not in ("elongation", "strain")
        return len(set(cells[i])) < 2, meaning == "position", unmeasured, of_crosshead

    doubles: list[tuple[int, int, float]] = []
    for i in sorted(cells, key=rank):
        heading = headings[i]
        is_time = heading.meaning == "time"
        if is_time and _CLOCK.fullmatch(cells[i][0]):
            heading = replace(heading, unit="s")
        try:
            column = column_of(heading, where=where)
        except FileError as error:
            others = _suffice(headings[j] for j in cells if j != i and headings[j].unit)
            if not is_time and not (heading.meaning in ("elongation", "position") and others):
                if grid.by_position or (heading.unit is not None and not grid.option):
                    raise
                if heading.unit is not None:
                    raise FileError(
                        f"{error}, or name the columns with units that are known by {grid.option}"
                    ) from error
                example = _example(headings)
                raise FileError(f"{error}, or {_advice(grid.option, example)}") from error
            left = f"{'time is optional and' if is_time else 'it'} is left out"
            notes.append(f"{str(error).partition('; ')[0]}; {left}")
            continue
        same = next((j for j, m in found.items() if m.name == column.name), None)
        if same is None:
            found[i] = column
            continue
        notes.append(
            f"{where}: column {heading.text!r} left out; {column.name} is read from "
            f"{found[same].heading.text!r}"
        )
        if rank(i) == rank(same) and not is_time:
            doubles.append((same, i, column.factor))
    _refuse_ramp(grid, lined, headings)
    _refuse_far(grid, lined, list(found.values()), headings)
    strains = {"strain", "true_strain", "stretch"} & {column.name for column in found.values()}
    for one, other, factor in doubles:
        if not (strains and found[one].name == "displacement_mm"):
            _refuse_two(grid, lined, {one: found[one].factor, other: factor}, headings)
    return {i: found[i] for i in sorted(found)}, notes


_ONE_TEMPERATURE_C = 4.0
"""From the lowest to the highest of a test at one temperature (ISO 23529: within 2 degrees)."""


def _refuse_ramp(grid: _Grid, lined: Sequence[int], headings: _Headings) -> None:
    """Refuse a record through which the temperature goes, as a dynamic test's does."""
    for i, heading in enumerate(headings):
        if heading.meaning or not _TEMPERATURE.search(heading.text):
            continue
        found = [grid.number(_cell(grid.rows[r][1], i)) for r in lined]
        known = [value for value in found if value is not None]
        if known and max(known) - min(known) > _ONE_TEMPERATURE_C:
            raise FileError(
                f"{grid.where}: {heading.text!r} goes from {min(known):g} to {max(known):g}; a "
                "law is of one temperature: give tests at one each, and what it was in the column "
                "temperature_C of specimens.csv"
            )


_TEMPERATURE = re.compile(r"temp[eé]?rat|\btemp\b|温度|気温", re.IGNORECASE)


def _refuse_far(
    grid: _Grid, lined: Sequence[int], used: Sequence[HeadedColumn], headings: _Headings
) -> None:
    """Refuse a plain travel where a column that is not understood may be a nearer sensor's."""
    lengths = [column.heading for column in used if column.name in _LENGTH_COLUMNS]
    if (
        grid.by_position
        or not lengths
        or {h.meaning for h in lengths} - {"displacement", "position"}
    ):
        return
    near: dict[int, Heading] = {}
    for i, h in enumerate(headings):
        unit = h.unit or _unit_at_end(h.text)
        kinds = quantities_of(unit) & {"length", "strain"}
        if h.meaning or unit.isdigit() or not kinds or not may_be_nearer(h.text):
            continue
        numbers = {grid.number(_cell(grid.rows[r][1], i)) for r in lined}
        if None not in numbers and len(numbers) > 1:
            near[i] = replace(h, meaning=_BY_KIND[min(kinds)], unit=unit)
    if near:
        blank = Heading("", "", None)
        taken = [near.get(i, blank if h.meaning in _LENGTHS else h) for i, h in enumerate(headings)]
        first, twice = next(iter(near.values())), len(near) > 1
        other = f", or leave it out by {grid.option} {_example(headings)}" if grid.option else ""
        raise FileError(
            f"{grid.where}: {first.text!r} is not understood, and may be nearer to the specimen "
            f"than {lengths[0].text!r}; to take it, "
            f"{_advice(grid.option, _example(taken, twice=twice))}{other}"
        )


def _refuse_two(
    grid: _Grid, lined: Sequence[int], factors: Mapping[int, float], headings: _Headings
) -> None:
    """Refuse two columns of one kind that differ: of two sensors, or of two specimens."""
    one, other = (
        factor * np.array([grid.number(_cell(grid.rows[r][1], i)) for r in lined], dtype=np.float64)
        for i, factor in factors.items()
    )
    is_load = any(headings[i].meaning in _LOADS for i in factors)
    if not is_load:
        one, other = one - one[0], other - other[0]
    if not float(np.max(np.abs(one - other))) > _SAME * float(np.ptp(one)):
        return
    first, second = (headings[i].text for i in factors)
    what = "loads over one length, of two load cells or of two specimens"
    what = what if is_load else "lengths of one record, of two sensors"
    said = f"{grid.where}: {first!r} and {second!r} are two {what}"
    if not grid.option:
        raise FileError(f"{said}; keep one in the file")
    examples = []
    for left_out in (*reversed(factors), None):
        kept = [Heading("", "", None) if i == left_out else h for i, h in enumerate(headings)]
        examples.append(f"{grid.option} {_example(kept, twice=True)}")
    both = f", or read two specimens by {examples[2]}" if is_load else ""
    raise FileError(f"{said}; take one of them by {examples[0]} or {examples[1]}{both}")


_SAME = 0.02
"""Of the range: one load in two units or from two channels, rounded differently."""


# ------------------------------------------------------------------------------------------------
# Blocks that go on with one another, and those that are specimens.


def _joined(pieces: Sequence[_Piece], blocks: str | None, notes: list[str]) -> list[_Piece]:
    """Join the pieces of one specimen; those that nothing names go on in time, or are asked about.

    Raises
    ------
    FileError
        Blocks that may be one record or several.
    """
    found: dict[str, _Piece] = {}
    for count, piece in enumerate(pieces, start=1):
        name = piece.name
        if blocks == "apart" and not name and len(pieces) > 1:
            name, piece = str(count), replace(piece, name=str(count))
        last = found.get(name)
        if last is not None and blocks != "join" and not _goes_on(last, piece):
            who = f"specimen {name}" if name else "the block"
            advice = _ASKED[bool(piece.grid.option)]
            raise FileError(
                f"{piece.grid.where}: {who} that ends on line {last.lines[-1]} starts again on "
                f"line {piece.lines[0]}, and nothing names another; {advice}"
            )
        found[name] = piece if last is None else _put_together(last, piece, notes)
    return [*found.values()]


_ASKED = (
    "write 'Specimen' and its name above each, or give each a file",
    "give --blocks apart if they are specimens, or --blocks join if they are one record",
)


def _goes_on(one: _Piece, next_: _Piece) -> bool:
    """Say whether a piece's time and length go on where those of the one before ended."""
    a, b = one.columns, next_.columns
    if "time_s" in a and "time_s" in b and b["time_s"][0] < a["time_s"][-1]:
        return False
    name = next((c for c in _LENGTH_COLUMNS if c in a and c in b), None)
    if name is None:
        return False
    ends, span = b[name][0] - a[name][[0, -1]], float(np.ptp([*a[name], *b[name]]))
    return bool(abs(ends[1]) <= min(abs(ends[0]), _STEP * span))


_STEP = 0.25
"""Of the range of both: by how much a record in blocks goes on from one to the next at most."""


def _put_together(one: _Piece, next_: _Piece, notes: list[str]) -> _Piece:
    names = [c for c in one.columns if c in next_.columns]
    lost = [c for c in {**one.columns, **next_.columns} if c not in names]
    if lost:
        notes.append(
            f"{one.grid.where}: {', '.join(lost)} is not in all blocks of the record; left out"
        )
    return replace(
        one,
        columns={c: np.concatenate([one.columns[c], next_.columns[c]]) for c in names},
        lines=[*one.lines, *next_.lines],
    )


def _tables(
    path: Path, pieces: list[_Piece], grids: Sequence[_Grid], notes: Sequence[str]
) -> tuple[TensileTable, ...]:
    """Return pieces as records, each under a name of its own, with what the file says of it."""
    names = [piece.name for piece in pieces]
    if len(pieces) == 1 and not pieces[0].in_column:
        names = [""]  # a label in the head; the file's name tells specimens apart
    if len({piece.grid.sheet for piece in pieces}) > 1:
        names = [
            name if name and names.count(name) == 1 else f"{piece.grid.sheet} {name}".strip()
            for name, piece in zip(names, pieces, strict=True)
        ]
    found = []
    said = [size for grid in grids for size in _said_sizes(grid, pieces)]
    labels = {_series(grid): _labels(_series(grid), pieces, names) for grid in grids}
    for place, (piece, name) in enumerate(zip(pieces, names, strict=True)):
        if names.count(name) > 1:
            raise FileError(
                f"{piece.grid.where}: {names.count(name)} records of specimen {name!r}; give each "
                "a name of its own"
            )
        metadata, sources, unclear = _metadata(piece, place, pieces, said, labels)
        if name:
            metadata.pop("specimen", None)
        metadata |= piece.texts
        if any(m.heading.compressed for m in piece.used if m.name != "time_s"):
            metadata.setdefault("mode", "compression")
        found.append(
            TensileTable(
                path.name, MappingProxyType(dict(piece.columns)),
                MappingProxyType({m.name: m.factor for m in piece.used}),
                np.array(piece.lines, dtype=np.int64), name or str(metadata.get("specimen", "")),
                MappingProxyType(metadata),
                frozenset(m.name for m in piece.used if m.heading.unit is None) - {"stretch"},
                (*piece.notes, *_behind(piece, pieces), *notes), piece.grid.sheet,
                MappingProxyType({m.name: _written(m.heading) for m in piece.used}), piece.unused,
                MappingProxyType(sources), MappingProxyType(unclear),
            )
        )  # fmt: skip
    return tuple(found)


def _written(heading: Heading) -> str:
    inside = heading.unit is None or _heading(heading.text).unit == heading.unit
    return heading.text if inside else f"{heading.text} ({heading.unit})"


def _behind(piece: _Piece, pieces: Sequence[_Piece]) -> list[str]:
    """Say from which line on a sheet holds something that is no part of its last record."""
    here = [p for p in pieces if p.grid is piece.grid]
    last = max(p.lines[-1] for p in here) if piece is here[-1] else math.inf
    rest = next((line for line, cells in piece.grid.rows if line > last and any(cells)), None)
    said = f"{piece.grid.where}: what stands from line {rest} on is no part of the record"
    return [] if rest is None else [said]


# ------------------------------------------------------------------------------------------------
# What stands beside the columns: sizes, speed, names, modes.


@dataclass(frozen=True, slots=True)
class _Said:
    """What a sheet says: one value, or one a specimen with its label; none without a unit.

    Of several readings of one size `number` counts them.
    """

    grid: _Grid
    row: int
    key: str
    name: str
    values: tuple[tuple[str, float | str], ...]
    number: str = ""

    def place(self) -> str:
        sheet = f"sheet {self.grid.sheet!r}, " if self.grid.sheet else ""
        return f"{sheet}line {self.grid.rows[self.row][0]}, {self.key!r}"


_ONE_CELL = re.compile(r"([^:：=]+?)\s*[:：=]\s*([+-]?[\d.,]+\s*\S+)")
_NEAR = 30
_BESIDE = 200
"""Rows of numbers beside which sizes are looked for; programs write them at the top."""


def _said_sizes(grid: _Grid, pieces: Sequence[_Piece]) -> Iterator[_Said]:
    """Yield what all cells say that are not in a record's columns."""
    data: dict[int, int] = {}
    for piece in (p for p in pieces if p.grid is grid):
        width = 1 + max(i for i, h in enumerate(piece.block.headings) if h.meaning)
        data |= {row: max(width, data.get(row, 0)) for row in piece.block.rows}
    beside = min(data, default=0) + _BESIDE
    for row, (_, cells) in enumerate(grid.rows):
        if row in data and row > beside:
            continue
        for at in range(data.get(row, 0), len(cells)):
            if cells[at] and not _is_figure(cells[at]):
                yield from _said_at(grid, row, at)


def _said_at(grid: _Grid, row: int, at: int) -> Iterator[_Said]:
    """Yield what one cell says together with its neighbours: to its right, or below it."""
    cells = grid.rows[row][1]
    key, right = cells[at], [c for c in cells[at + 1 :] if c]
    single = _ONE_CELL.fullmatch(key) if len(key) <= LONGEST_HEADING else None
    if single is not None:  # "Width: 6.00 mm"
        key, right = single[1], [single[2]]
    text = head_text(key)
    if text and right and head_text(right[0]) is None and size_of(right[0])[0] is None:
        yield _Said(grid, row, key, text, (("", right[0]),))
    size, unit, count = size_of(key)
    if size is None:
        return
    figures: list[tuple[str, float]] = []
    for column, value in enumerate(right, start=at + 1):
        split = split_value(value, grid.separator[0])
        if split is not None:
            figures.append((_label_above(grid, row, column), split[0]))
            unit = unit or split[1]
        elif column < at + 3 and not unit and _is_of_size(value):
            unit = value
        else:
            break
    if len(figures) == 1:
        figures = [("", figures[0][1])]  # of all, though it stands below the first name
    if not figures:
        figures, unit = _figures_below(grid, row, at, unit)
    if figures and not unit and row + 1 < len(grid.rows):
        below = _cell(grid.rows[row + 1][1], at + 1)
        unit = below if _is_of_size(below) else ""
    if unit:
        size = size_of(f"{key} [{unit.strip('()[] ')}]")[0] or size  # A0 in mm² is an area
    factor = _factor(size, unit)
    if factor is None and unit and len(figures) == 1 and size != "rate_mm_s":
        raise FileError(
            f"{grid.where}, line {grid.rows[row][0]}, {key!r}: unknown unit {unit!r} of "
            f"{size.split('_')[0]}; use one of 'mm', 'cm', 'in'"
        )
    if figures and (factor is not None or not unit):
        values = tuple((label, v * factor) for label, v in figures) if factor is not None else ()
        yield _Said(grid, row, key, size, values, count)


def _is_of_size(unit: str) -> bool:
    return not {"length", "area", "speed"}.isdisjoint(quantities_of(unit.strip("()[] ")))


def _factor(size: str, unit: str) -> float | None:
    """Return the factor of a unit to that of a size; None where it is none of that kind."""
    quantity = {"rate_mm_s": "speed", "area_mm2": "area"}.get(size, "length")
    unit = unit.strip("()[] ")
    return unit_factor(quantity, unit, where="") if quantity in quantities_of(unit) else None


def _label_above(grid: _Grid, row: int, at: int) -> str:
    """Return the specimen that heads a column of figures: the row of names near it."""
    near = range(max(row - _NEAR, 0), min(row + _NEAR, len(grid.rows)))
    for cells in (grid.rows[other][1] for other in near if other != row):
        if cells and cells[0] and head_text(cells[0]) == "specimen" and _cell(cells, at):
            return cells[at]
    return ""


def _figures_below(
    grid: _Grid, row: int, at: int, unit: str
) -> tuple[list[tuple[str, float]], str]:
    """Return the figures below a cell of a table of results, by specimen, and their unit."""
    heads = grid.rows[row][1]
    counts = (i for i, c in enumerate(heads) if c.strip(" .").casefold() in ("no", "nr", "n°"))
    named = next((i for i, c in enumerate(heads) if head_text(c) == "specimen"), next(counts, 0))
    figures: list[tuple[str, float]] = []
    for _, cells in grid.rows[row + 1 :]:
        cell = _cell(cells, at)
        value = split_value(cell, grid.separator[0])
        if value is None:
            bare = cell.strip("()[] ")
            if figures or not any(cells) or (bare and (unit or not is_unit(bare))):
                break
            unit = bare
            continue
        label = _cell(cells, named) if named != at else ""
        # "Mean" may stand before an empty label; an "x" beside one is an orientation.
        words = [label] if re.search(r"\w", label) else [c for c in cells[:at] if c]
        if any(map(_is_statistic, words)):
            break
        label = label or (figures[-1][0] if figures else "")
        if (label, value[0]) not in figures[-1:]:
            figures.append((label, value[0]))
        unit = unit or value[1]
    return figures, unit


def _is_statistic(word: str) -> bool:
    return _STATISTIC.fullmatch(word.strip(" .:").casefold()) is not None


_STATISTIC = re.compile(
    r"mean|average|avg|median|maximum|minimum|max|min|range|s|sd|(?:std|standard)\W*(?:(?:dev|abw|err).*)?|"
    r"coefficient.*|cv|n|x|x̄|ν|v|mittel.*|mw|moyenne|[eé]cart.*|media|promedio|desv.*|dev.*|平均.*|標準.*|标准.*"
)


_LENGTH_RANKS = ("gauge_mm", "height_mm", "length_mm", "grip_mm")


def _metadata(
    piece: _Piece,
    place: int,
    pieces: Sequence[_Piece],
    said: Sequence[_Said],
    labels: Mapping[str, Mapping[int, str]],
) -> tuple[dict[str, float | str], dict[str, str], dict[str, str]]:
    """Return what a file says of one record, where it says so, and what it leaves unclear.

    What stands in the record's block goes before what stands above all, and that before what
    other sheets say.
    """
    first = min(p.block.place for p in pieces if p.grid is piece.grid)
    scopes: tuple[list[_Said], ...] = ([], [], [])
    for one in said:
        if place not in labels[_series(one.grid)]:
            continue
        if one.grid is not piece.grid:
            scopes[2].append(one)
        elif piece.block.start <= one.row <= piece.block.rows[-1]:
            scopes[0].append(one)
        elif one.row < first or len(one.values) > 1:
            scopes[1].append(one)
    found: dict[str, tuple[float | str | None, str]] = {}
    for scope in scopes:
        here: dict[str, dict[float | str | None, str]] = {}
        open_: dict[str, str] = {}
        readings_of: dict[str, dict[str, tuple[float, _Said]]] = {}
        for one in scope:
            beside = one.grid is piece.grid and one.row == piece.block.place
            value = _value_for(one, place, labels[_series(one.grid)], beside)
            of = here.setdefault(one.name, {})
            if one.number and isinstance(value, float):
                readings_of.setdefault(one.name, {})[one.number] = value, one
            elif value is not None:
                of.pop(value, None)  # the last place of a value is told
                of[value] = one.place()
            else:
                readings = ", ".join(f"{v:g}" for _, v in one.values if isinstance(v, float))
                gives = f"gives {readings} of specimens" if one.values else "without a unit"
                of[None] = f"{one.place()} {gives}"
                if one.values:
                    open_[one.name] = of[None]
        for size, each in readings_of.items():
            figures, told = zip(*each.values(), strict=True)
            at = " and ".join(one.place() for one in told)
            alone = len(told) == len(labels[_series(told[0].grid)]) and len(told[0].values) == 1
            if alone and len(told) > 1 and len({*figures}) > 1:  # or one of each specimen
                here[size][None] = f"{at}, of one specimen or of {len(told)}"
            else:
                here[size][math.fsum(figures) / len(figures)] = at
        for size, values in here.items():
            known = [(v, at) for v, at in values.items() if v is not None]
            if found.get(size, (None, ""))[0] is not None:
                continue
            several = [f"{v:g} ({at})" for v, at in known if isinstance(v, float)]
            several += [open_[size]] if size in open_ and several else []
            if len(several) > 1:
                found[size] = None, " and ".join(several)
            elif known or size not in found:
                found[size] = known[-1] if known else (None, values[None])
    compressed = any(column.heading.compressed for column in piece.used)
    if not compressed and mode_of(str(found.get("mode", ("",))[0])) != "compression":
        found.pop("height_mm", None)  # a section's
    ranked = [found.pop(size) for size in _LENGTH_RANKS if size in found]
    if ranked:
        found["gauge_mm"] = ranked[0]
    if mode_of(str(found.get("mode", ("",))[0])) is None:
        found.pop("mode", None)  # "Test type: QA" is another matter
    values_ = {size: value for size, (value, _) in found.items() if value is not None}
    sources = {size: at for size, (_, at) in found.items() if size in values_}
    return values_, sources, {size: at for size, (_, at) in found.items() if size not in values_}


def _series(grid: _Grid) -> str:
    """Return the number of a series' sheet: the "2" of "Results Series 2"; "" of any other."""
    match = _SERIES.search(grid.sheet)
    return match[1] if match else ""


_SERIES = re.compile(r"s[eé]rie[sn]?\s*(\d+)$", re.IGNORECASE)


def _labels(series: str, pieces: Sequence[_Piece], names: Sequence[str]) -> dict[int, str]:
    """Return the records that a series' sheet may speak of, by place: the name of each there."""
    places = [i for i, p in enumerate(pieces) if not series or _series(p.grid) in ("", series)]
    count = Counter(pieces[i].name for i in places)
    return {
        i: _plain_name(pieces[i].name if count[pieces[i].name] == 1 else names[i]) for i in places
    }


def _value_for(
    one: _Said, place: int, labels: Mapping[int, str], beside: bool
) -> float | str | None:
    """Return the value that holds for a specimen: by its name, else by its place.

    By place only where no label is another specimen's, save in a column beside the records.
    """
    values = {value for _, value in one.values}
    if len(one.values) == 1 and (len(labels) == 1 or not one.values[0][0]):
        return one.values[0][1]
    plain = labels[place]
    told = [_plain_name(label) for label, _ in one.values]
    named = {v for label, (_, v) in zip(told, one.values, strict=True) if plain and label == plain}
    if len(named) == 1:
        return named.pop()
    if not beside and not set(labels.values()).isdisjoint({*told} - {""}):
        return values.pop() if len(values) == 1 < len(one.values) else None
    if len(one.values) == len(labels):
        return one.values[[*labels].index(place)][1]
    return values.pop() if len(values) == 1 else None


@functools.lru_cache(maxsize=8192)
def _plain_name(name: str) -> str:
    return re.sub(r"[\s_.-]+", "", marked_specimen(name) or name).casefold()


def _with_units_of_head(grid: _Grid, block: _Block) -> tuple[_Block, list[str]]:
    """Return a block with the units that a file's head states by lines of their own.

    A Mark-10 MESURgauge has "Units: N" (of the load), "Travel Unit: mm", an Emperor "Force Units",
    "N"; the columns are without units, time in seconds.

    Raises
    ------
    FileError
        The head names load units that are two different ones.
    """
    units: dict[str, str] = {}
    for line, cells in grid.rows[: block.place]:
        told = _UNIT_OF.fullmatch(" ".join(cell for cell in cells if cell))
        unit = told[2] if told else ""
        of_load = "force" if "force" in quantities_of(unit) else ""
        meaning = _heading(told[1]).meaning if told and told[1] else of_load
        if meaning and is_unit(unit) and units.setdefault(meaning, unit) != unit:
            raise FileError(
                f"{grid.where}, line {line}: unit of {meaning} is {unit!r} here and "
                f"{units[meaning]!r} above; keep the right one"
            )
    if units:
        units["time"] = "s"
    filled = [
        replace(h, unit=units[h.meaning]) if h.unit is None and h.meaning in units else h
        for h in block.headings
    ]
    if filled == [*block.headings]:
        return block, []
    stated = ", ".join(f"{meaning} in {unit}" for meaning, unit in units.items())
    return replace(block, headings=filled), [f"{grid.where}: {stated} by its head"]


_UNIT_OF = re.compile(r"(?:(\w+) )?units?\s*:?\s*[(\[]?([^\s()\[\]]+)[)\]]?", re.IGNORECASE)


# ------------------------------------------------------------------------------------------------
# Where headings are not understood: which ones, and by which others the file can be read.


def _by_position(columns: Sequence[str]) -> _Headings:
    headings = [_heading("" if c.strip() == "-" else c.strip()) for c in columns]
    for heading in headings:
        if heading.text and not heading.meaning:
            raise FileError(
                f"column {heading.text!r} is unknown; use time_s, displacement_mm, force_N, "
                "strain, stretch, stress_MPa, specimen, or '-' for a column to leave out"
            )
    if not _suffice(headings):
        raise FileError(
            f"columns {', '.join(columns)}: name one load (force_N, stress_MPa) and one length "
            "(displacement_mm, strain, stretch)"
        )
    return headings


def _count_numbers(grid: _Grid) -> int:
    """Return how many rows of a sheet hold two numbers or more."""
    return sum(
        sum(grid.number(cell) is not None for cell in cells if cell) > 1 for _, cells in grid.rows
    )


def _not_understood(grid: _Grid) -> str:
    if grid.by_position is not None:
        count = len(grid.by_position)
        return f"{grid.where}: no row with {count} columns of numbers; check the columns"
    line, names, units = _nearest(grid)
    if not names:
        return (
            f"{grid.where}: no row of headings with a load (force, load, stress) and a length "
            "(displacement, extension, travel, strain, stretch) above columns of numbers; export "
            "the raw data, headed as 'time_s,displacement_mm,force_N'"
        )
    headings = [_heading(name) for name in names]
    known = [f"{h.text!r} as {h.meaning}" for h in headings if h.meaning]
    unknown = [
        repr(n if len(n) <= 30 else f"{n[:27]}...") for n in names if n and not _heading(n).meaning
    ]
    missing = _missing(headings)
    said = (
        f"{grid.where}, line {line}: no heading of a {' nor of a '.join(missing)}; understood: "
        f"{', '.join(known) or 'none'}; not understood: {', '.join(unknown[:8]) or 'none'}"
    )
    example = _example([replace(h, unit=u) for h, u in zip(headings, units, strict=True)])
    if example.split(",").count("?") < len(_missing(map(_heading, example.split(",")))):
        return f"{said}; export what is missing too"
    return f"{said}; {_advice(grid.option, example)}"


def _missing(headings: Iterable[Heading]) -> list[str]:
    meanings = {heading.meaning for heading in headings}
    return [what for what, kinds in _SOUGHT.items() if kinds.isdisjoint(meanings)]


_SOUGHT = {"load (force or stress)": _LOADS, "length (travel or strain)": _LENGTHS}


def _advice(option: str, example: str) -> str:
    if not option:
        return f"head the columns {example}"
    if "?" in example.split(","):
        return (
            f"name the columns by position: {option} {example} with time_s, displacement_mm, "
            "force_N, strain or stress_MPa for a '?', or '-' for a column to leave out"
        )
    left_out = " (a '-' leaves a column out)" if "-" in example.split(",") else ""
    return f"name the columns by position, for example {option} {example}{left_out}"


def _example(headings: _Headings, *, twice: bool = False) -> str:
    """Return names by position: what is understood, and what units tell of the others.

    Where a load or a length is missing, a "?" stands for what units do not tell. `twice` keeps a
    quantity that comes again.
    """
    names, meant = list[str](), list[str]()
    told = Counter(kind for h in headings if not h.meaning for kind in quantities_of(h.unit or ""))
    for heading in headings:
        unit, name = heading.unit or "", _ALIKE.get(heading.meaning, heading.meaning)
        kinds = quantities_of(unit)
        if not name and len(kinds) == 1 and told[min(kinds)] == 1 and not twice:
            name = _BY_KIND.get(min(kinds), "")
        if not name or (name in meant and not twice):
            names.append("-")
            continue
        meant.append(name)
        bare = name.replace(" ", "_")
        names.append(f"{bare}_{unit}" if unit and name != "specimen" else _BARE.get(bare, bare))
    if any(kinds.isdisjoint(meant) for kinds in _SOUGHT.values()):
        names = [
            "?" if h.text and not h.meaning and name == "-" else name
            for h, name in zip(headings, names, strict=True)
        ]
    return ",".join(names)


_ALIKE = {"position": "displacement", "elongation": "displacement"}
_BY_KIND = {
    "length": "displacement",
    **{kind: kind for kind in ("time", "force", "stress", "strain")},
}
_BARE = {"time": "time_s", "force": "force_N", "displacement": "displacement_mm",
         "stress": "stress_MPa", "true_stress": "true_stress_MPa"}  # fmt: skip


def _nearest(grid: _Grid) -> tuple[int, Sequence[str], Sequence[str]]:
    """Return the row that comes nearest to one of headings: line, cells and units.

    The row above the first row of numbers, or above a row of units there; no cells where there is
    none.
    """
    rows = [(line, cells) for line, cells in grid.rows if any(cells)]
    for place, (_, cells) in enumerate(rows):
        filled = [cell for cell in cells if cell]
        numbers = sum(grid.number(cell) is not None for cell in filled)
        # A specimen's name may stand beside them; a size in the head is one number alone.
        if place and numbers > 1 and 2 * numbers >= len(filled):
            break
    else:
        return 0, (), ()
    below = rows[place - 1][1] if place > 1 else []
    if not all(is_unit(cell.strip("()[]")) or cell[0] in "([" for cell in below if cell):
        below = []
    line, names = rows[place - 1 - bool(below)]
    units = [_heading(n).unit if _heading(n).meaning else _unit_at_end(n) for n in names]
    return line, names, [
        unit if unit and is_unit(unit) else _cell(below, i).strip("()[] ")
        for i, unit in enumerate(units)
    ]  # fmt: skip


def _unit_at_end(name: str) -> str:
    """Return the unit in a heading whose name is not known: "Gap (mm)", "Gap_mm", "Gap / mm"."""
    return re.split(r"[\s_(\[]", name.rstrip(")] "))[-1]


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
    data = read_file(path, advice="give the path of a tensile file")
    if is_workbook(data):
        return False
    first = decode_text(data, Path(path)).lstrip("\n").splitlines()[0]
    return any(
        "specimen" in cells and not _MADE_OF.isdisjoint(cells) and _headings(cells) is None
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
