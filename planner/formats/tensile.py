"""Tensile test files: what a testing machine wrote, in seven languages, as a record a specimen."""

import functools
import math
import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import dropwhile, permutations, product, takewhile
from pathlib import Path

import numpy as np

from planner.errors import ArgumentError, Caution, FileError, as_texts
from planner.formats import tables
from planner.formats.files import read_file, toml_beside, unpacked
from planner.formats.units import quantities_of, unit_factor
from planner.numerics import FloatArray, IntArray

__all__ = ["MODES", "NoRecordError", "TensileTable", "headings_of", "mode_of", "read_tensile"]


# ------------------------------------------------------------------------------------------------
# The terms are data, in terms.toml, and so are the words around them; here stand the signs.


def _words(table: str, name: str) -> list[str]:
    return [word.strip() for word in re.split(r",|\n", _TERMS[table][name]) if word.strip()]


@functools.lru_cache(maxsize=8192)
def _folded(text: str) -> str:
    """Return a term as it is looked up: without accents, case, underscores and full width."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    bare = "".join(c for c in plain if unicodedata.category(c) != "Mn")
    return re.sub(r"[\s_,]+", " ", bare).strip(" .:=")


_TERMS = toml_beside("terms.toml")
_MEANING, _COLUMN_SYMBOLS, _SIZE, _SYMBOLS, _TEXT, _SPEED, _MODE = (
    {_folded(word): meaning for meaning in _TERMS[table] for word in _words(table, meaning)}
    for table in ("columns", "column_symbols", "sizes", "symbols", "texts", "speeds", "modes")
)
MODES = tuple(_TERMS["modes"])
"""The ways of loading that are told apart."""

_BEFORE, _BEHIND = (
    re.compile(form % "|".join(sorted(map(_folded, _words("qualifiers", name)), key=len)[::-1]))
    for name, form in (("before", r"^(?:%s)[\s.]*"), ("behind", r"\s(?:%s)$"))
)
_ANY = {name: "|".join(_words("signs", name)) for name in _TERMS["signs"]}
_SIGNS = {name: re.compile(f"(?:{any_})", re.I) for name, any_ in _ANY.items()}
"""By what cells are known that are no terms; see terms.toml."""

_BRACKET = re.compile(r"[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]")
_LEADING = re.compile(r"^(%(?=\s*[^\W\d])|(?i:percent(?:age)?)\b|[XY](?=[A-Z][a-z]))\s*(.+)")
_NUMBERED_CHANNEL = re.compile(
    rf"(?<![a-z])(?:{_ANY['channel']})(?=[\s_.:#\d])[\s_.:#]*\d*[\s_.:-]+", re.IGNORECASE
)
_SUFFIXED = re.compile(r"(.+)_([^_\s]+)")
_SPACED = re.compile(r"(.+?)(?:\s*[/,;:]|\s(?:in|en))?\s(\S+)")
_JOINED = re.compile(r"(.+?)\s*[/,;:]\s*(.+)")
_NUMBERED = re.compile(
    rf"(.+?)(?:[\s_.:#-]+(?P<tag>(?:(?:{_ANY['specimen']})\s*)?[A-Za-z]{{0,3}}-?\d+|[A-Z])|"
    r"(?P<number>\d+))",
    re.IGNORECASE,
)
_TAG = re.compile(rf"(?:(?:{_ANY['specimen']})[\s_]*)?[\w-]*\d[\w-]*", re.IGNORECASE)
_SYMBOL = re.compile(r"(.+) (?:[abdhls]\s?[0o]|[abhtw])")
"""A size with its symbol in ISO 527: "Probendicke a0"."""

_MARK = re.compile(
    rf"[#*%\s]*(?:(?:{_ANY['specimen']})n?|(?P<test>{_ANY['test']}))[\s-]*"
    r"(?:(?P<counted>no|nr|n|number|nummer|n°|№)(?!\w)|(?:name|id)\b)?"
    r"\s*(?:(?(test)(?(counted)[.:#]|[.#])|[.:#=_-])+\s*(?P<said>.{1,60})|"
    r"(?P<number>[\w.-]*\d[\w.-]*|[A-Z])(?:\s*(?:of|von|sur|de|di|/)\s*\d+)?)",
    re.IGNORECASE,
)


def _looked_up(name: str, table: Mapping[str, str]) -> str | None:
    """Return what a name means, qualifiers taken off one by one until it is known."""
    folded = _folded(name)
    while folded not in table:
        bare = _BEHIND.sub("", folded)
        bare = _BEFORE.sub("", folded, count=1) if bare == folded else bare
        if bare == folded:
            return None
        folded = bare
    return table[folded]


# ------------------------------------------------------------------------------------------------
# A column's heading: which quantity, in which unit.


_COLUMNS: Mapping[str, Mapping[str, str]] = _TERMS["quantities"]
"""By meaning: the column, by the quantity that the unit is of; the first where none is stated."""


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading taken apart.

    Attributes
    ----------
    text
        As the file writes it.
    meaning
        A key of the known meanings.
    unit
        None where it is not stated.
    tag
        What tells it from others of the same meaning: ``S1`` of "S1_force_N", ``2`` of "Force.2".
    compressed
        Whether it says that load or travel count in compression.
    """

    text: str
    meaning: str
    unit: str | None
    tag: str = ""
    compressed: bool = False

    @property
    def quantity(self) -> str:
        """What the column is of: of several quantities the one that its unit is of."""
        kinds = quantities_of(self.unit or "")
        choices = _COLUMNS[self.meaning]
        return next((kind for kind in choices if kind in kinds), next(iter(choices)))

    def column(self, where: str) -> tuple[str, float]:
        """Return the name of the column, and the factor to its unit.

        Raises
        ------
        FileError
            The unit is missing where one is needed, or is unknown.
        """
        where, quantity = f"{where}, column {self.text!r}", self.quantity
        name = _COLUMNS[self.meaning][quantity]
        if self.unit is None and quantity != "strain":
            unsure = ", so that it may be a length or a strain" * (self.meaning == "elongation")
            units = ("mm", "%") if unsure else (name.rpartition("_")[2],)
            examples = " or ".join(f"'{self.text} ({unit})'" for unit in units)
            raise FileError(f"{where}: no unit{unsure}; write it in the heading, as {examples}")
        return name, unit_factor(quantity, self.unit or "", where=where)


@functools.lru_cache(maxsize=8192)
def heading_of(text: str) -> Heading:
    """Take a heading apart; where it names nothing that is known the meaning is "".

    "Load (lbf)", "Load [lbf]", "force_N", "Load N", "Kraft in N", "Kraft / N", "C_1_Force[kN]",
    "Load (5 kN cell) [N]", "S1_force_N" and a bare "Load" are understood.
    """
    plain = _plain(text)
    brackets, name = list[str](), plain
    while inner := _BRACKET.findall(name):  # one within another, as WaveMatrix writes them
        brackets, name = inner + brackets, _BRACKET.sub(" ", name)
    name = " ".join(name.split()) or plain
    for word in [b for b in brackets if _folded(f"{b} {name}") in _MEANING]:  # "Stress (true)"
        name, brackets = f"{word} {name}", [b for b in brackets if b != word]
    if any(_SIGNS[k].search(_folded(b)) for b in brackets for k in ("bent", "otherwise", "figure")):
        return Heading(text, "", None)
    found = _parse(_NUMBERED_CHANNEL.sub("", name, count=1)) or _tagged(name)
    if (found := found or _symbol(name, brackets)) is None:
        return Heading(text, "", None)
    meaning, unit, tag = found
    unitless = next(iter(_COLUMNS.get(meaning, ())), "") == "strain"
    for bracket in reversed(brackets):
        stated = quantities_of(bracket) and (unitless or not bracket.isdigit())
        if stated or not (_SIGNS["source"].search(bracket) or _looked_up(bracket, _MEANING)):
            unit = bracket
            if stated:
                break
    return Heading(text, meaning, unit, tag, bool(_SIGNS["compressed"].search(_folded(name))))


def _plain(text: str) -> str:
    """Return a cell in one width, with single blanks; of what is too long for a heading "".

    A hash before it is a comment's, as NumPy writes headings; "% strain" is "strain %", and
    CellScale's "XForce_mN" is "Force_mN X".
    """
    short = unicodedata.normalize("NFKC", text) if len(text) <= tables.LONGEST_HEADING else ""
    joined = re.sub(r" / (?=m|in)", "/", " ".join(short.split()))  # "Strain mm / mm"
    return _LEADING.sub(r"\2 \1", joined.lstrip("# ").rstrip("_"))


def _parse(name: str) -> tuple[str, str | None, str] | None:
    """Return meaning, unit and tag of a heading without brackets."""
    if (meaning := _looked_up(name, _MEANING)) is not None:
        return meaning, None, ""
    suffixed = _SUFFIXED.fullmatch(name)
    if suffixed and not suffixed[2].isdigit():
        stem, unit = suffixed.groups()
        meaning = _looked_up(stem, _MEANING)
        if meaning is not None and (quantities_of(unit) or not _SIGNS["source"].search(unit)):
            return meaning, unit, ""
    for stem, unit in _apart(name, _SPACED, _JOINED):  # "Load min" is none in minutes
        if (inner := _parse(stem)) and (inner[0] == "time" or quantities_of(unit) != {"time"}):
            return inner[0], unit, inner[2]
    if numbered := _NUMBERED.fullmatch(name):
        inner = _parse(numbered[1])
        if inner is not None and not inner[2]:
            return inner[0], inner[1], numbered["tag"] or numbered["number"]
    return None


def _symbol(name: str, brackets: Sequence[str]) -> tuple[str, str, str] | None:
    """Return meaning, unit and tag of a symbol with a unit of its quantity: "F (N)", "t / s"."""
    with_units = [(name, unit) for unit in brackets] + [*_apart(name, _SUFFIXED, _SPACED, _JOINED)]
    for stem, unit in with_units:
        meaning = _COLUMN_SYMBOLS.get(_folded(stem), "")
        if not quantities_of(unit).isdisjoint(_COLUMNS.get(meaning, ())):
            return meaning, unit, ""
    return None


def _apart(name: str, *patterns: re.Pattern[str]) -> Iterator[tuple[str, str]]:
    """Yield a name and the unit behind it, a known one: "Load cell", "Time stamp" have none."""
    for match in (pattern.fullmatch(name) for pattern in patterns):
        if match and quantities_of(match[2]) and not match[2].isdigit():
            yield match[1], match[2]


def _tagged(name: str) -> tuple[str, str | None, str] | None:
    """Return meaning, unit and tag of a heading with the specimen's in front: "S1_force_N".

    In "1/lambda" no specimen stands in front.
    """
    for gap in re.finditer(r"(?<!^1(?=\s*/))[\s_:./|-]+", name):
        tag = name[: gap.start()]
        if _TAG.fullmatch(tag) and (inner := _parse(name[gap.end() :])) is not None:
            return inner[0], inner[1], tag
    return None


_STRAINS = {"strain", "stretch", "true strain", "lagrange strain"}
_LENGTHS = {"displacement", "position", "elongation"} | _STRAINS
_LOADS = {"force", "stress", "true stress"}
"""What a record has one of each of."""


def headings_of(cells: Sequence[str]) -> list[Heading] | None:
    """Return the headings in a row that names a load and a length; None of any other row."""
    found = [heading_of("" if _is_figure(c) and not _WORD.search(c) else c) for c in cells]
    return None if _missing(found) else found


def _is_figure(cell: str) -> bool:
    """Say whether a cell begins as a number does."""
    return cell[:1].isdigit() or (cell[:1] in "+-.," and cell[1:2].isdigit())


# ------------------------------------------------------------------------------------------------
# What stands beside the columns: sizes, speeds, names.


_VALUE = re.compile(r"([+-]?\d[\d.,'\s]*(?:[eE][+-]?\d+)?)\s*([^\d\s]\S*(?:\s\S+)?)?")


def _split_value(cell: str, separator: str) -> tuple[float, str] | None:
    """Return the number and the unit in a cell such as "6,00 mm"; None where there is no number."""
    match = _VALUE.fullmatch(cell.strip()) if len(cell) <= tables.LONGEST_HEADING else None
    value = None if match is None else tables.number(match[1].strip(), separator)
    if match is None or value is None or not math.isfinite(value):
        return None
    return value, (match[2] or "").strip("()[] ")


def _names(cell: str) -> Iterator[tuple[str, str]]:
    """Yield the names that a cell such as "Dimension : Width (mm)" may mean, each with its unit."""
    plain = _plain(cell).rstrip(" :=")
    unit = next((b for b in reversed(_BRACKET.findall(plain)) if quantities_of(b)), "")
    name = " ".join(_BRACKET.sub(" ", plain).split()).rstrip(" :=")
    if not unit:
        name, unit = next(_apart(name, _SUFFIXED, _SPACED, _JOINED), (name, ""))
    yield name, unit
    last = name.rpartition(" : ")[2]
    yield last, unit
    if symbol := _SYMBOL.fullmatch(_folded(last)):
        yield symbol[1], unit
    yield re.split(r"\s*,\s*|\s+-\s+", last)[0], unit


def size_of(cell: str, *, symbols: bool = False) -> tuple[str | None, str, str]:
    """Return the size that a cell beside the columns names, its unit or "", and its number or "".

    A size as width_mm, or rate_mm_s, the crosshead's speed. "Width 2" has the number 2: one of
    several readings. `symbols` takes "w" for a width too, if its unit is of length or not there.
    """
    for name, unit in _names(cell):
        numbered = _NUMBERED.fullmatch(_folded(name))
        stem, count = (numbered[1], numbered["tag"] or numbered["number"]) if numbered else ("", "")
        speed = _SPEED.get(_folded(name)) or _SPEED.get(stem)
        gauge = "gauge_mm" if _SIGNS["gauge"].match(_folded(name)) else None
        if (size := _looked_up(name, _SIZE) or speed or gauge) is not None:
            of_area = _folded(name) == "a0" and "area" in quantities_of(unit)
            return "area_mm2" if of_area else size, unit, ""
        size = _looked_up(stem, _SIZE) if len(stem) > 1 and count.isdigit() else None
        if size in ("width_mm", "thickness_mm", "diameter_mm"):
            return size, unit, count
    is_symbol = symbols and (not unit or "length" in quantities_of(unit))
    return _SYMBOLS.get(_folded(name)) if is_symbol else None, unit, ""


def _head_text(cell: str) -> str | None:
    """Return which text of the head a cell names: material, specimen, mode or none."""
    return next(filter(None, (_TEXT.get(_folded(name)) for name, _ in _names(cell))), None)


def mode_of(text: str) -> str | None:
    """Return how a specimen was loaded, as its words tell: one of `MODES`, or None."""
    return _MODE.get(_folded(str(text)))


def marked_specimen(cell: str) -> str | None:
    """Return the specimen that a cell by itself announces: "1" of "Specimen 1"; else None."""
    match = _MARK.fullmatch(cell.strip()) if len(cell) <= tables.LONGEST_HEADING else None
    return (match["said"] or match["number"]).strip() if match else None


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
_LENGTH_COLUMNS = ("strain", "true_strain", "displacement_mm")
_BLOCKS = ("join", "apart")


class NoRecordError(FileError):
    """A file without any table that could be a record of a test."""


_FEWEST_ROWS = 3
"""Of a record beside others: two points are a line, and a table of results has fewer."""


_Headings = Sequence[Heading]
"""A row's; of a cell that is not understood the meaning is ""."""

_BLANK = Heading("", "", None)


def _only(headings: _Headings, places: Collection[int]) -> _Headings:
    """Return headings of which those at other places are blank."""
    return [h if i in places else _BLANK for i, h in enumerate(headings)]


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """A sheet's cells, the separator of its numbers (see `number`), and how it is to be read.

    `merged` are the columns, by line, of cells that one to their left goes on over.
    """

    where: str
    sheet: str
    separator: str
    rows: list[tables.TextRow]
    by_position: _Headings | None
    option: str
    merged: Mapping[int, Collection[int]]

    def number(self, cell: str) -> float | None:
        return tables.number(cell, self.separator)

    def is_number(self, cell: str) -> bool:
        return self.number(cell) is not None or _CLOCK.fullmatch(cell) is not None

    def cell(self, row: int, at: int) -> str:
        cells = self.rows[row][1]
        return cells[at] if at < len(cells) else ""


@dataclass(frozen=True, slots=True)
class _Block:
    """Headings, in row `head`, with the numbers below; `start` is the first row that is theirs."""

    grid: _Grid
    start: int
    head: int
    headings: _Headings
    rows: list[int]
    notes: tuple[str, ...] = ()

    @property
    def is_headed(self) -> bool:
        return self.head not in self.rows

    def cells(self, at: int) -> list[str]:
        return [self.grid.cell(row, at) for row in self.rows]

    def numbers(self, at: int) -> list[float | None]:
        return [self.grid.number(cell) for cell in self.cells(at)]


@dataclass(frozen=True, slots=True)
class _Column:
    """A column that serves: its index and heading, planner's name, and the factor to its unit."""

    at: int
    heading: Heading
    name: str
    factor: float


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """The columns of one specimen in one block; `texts` are those of material and mode."""

    name: str
    grid: _Grid
    block: _Block
    columns: Mapping[str, FloatArray]
    used: Sequence[_Column]
    lines: list[int]
    unused: tuple[str, ...]
    notes: tuple[str, ...]
    in_column: bool
    texts: Mapping[str, str]


_STYLED = re.compile(rb'<(?:\w+:)?c\s+r="([A-Z]+\d+)"[^<>]*?\ss="(\d+)"')
"""A cell of an XLSX: its place and its style."""


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
    unmerged = dict[int, set[int]]()
    of_text = [] if tables.is_workbook(data) else [("", tables.decode_text(data, path), unmerged)]
    grids, pieces, notes = dict[_Grid, list[_Block]](), list[_Piece](), list[str]()
    for sheet, cells, merged in of_text or tables.read_sheets(data, path.name):
        where = f"{path.name}, sheet {sheet!r}" if sheet else path.name
        grid, found = _best_grid(_Grid(where, sheet, "", [], by_position, option, merged), cells)
        grids[grid] = found
        pieces += _joined(_pieces(grid, found, notes), blocks, notes)
    if not grids:
        raise NoRecordError(f"{path.name}: a workbook without sheets; export the test again")
    if not pieces:
        longest = max(grids, key=_count_numbers)
        few = _count_numbers(longest) < _FEWEST_ROWS
        raise (NoRecordError if few else FileError)(_not_understood(longest))
    ordered = sorted(grids, key=lambda grid: not grids[grid])
    notes += [f"{grid.where}: no record of a test" for grid in ordered if not grids[grid]]
    fewest = min(len(piece.lines) for piece in pieces)
    for grid in ordered:
        read = {line for piece in pieces if piece.grid is grid for line in piece.lines}
        rest = replace(grid, rows=[row for row in grid.rows if row[0] not in read])
        if _count_numbers(rest) * (4 if grids[grid] else 1) >= fewest:
            raise FileError(f"{_not_understood(rest)}; the rest of the file is understood")
    named = {piece: piece.name or piece.grid.sheet for piece in pieces}
    means = {p: name for p, name in named.items() if len(name) > 1 and _is_statistic(name)}
    if means and len(pieces) > len(means) + 1:
        pieces = [piece for piece in pieces if piece not in means]
        notes.append(f"{path.name}: {', '.join(means.values())} of the others; left out")
    headed = data[:2] == b"PK" and any(one.factor == 0.01 for p in pieces for one in p.used)
    if headed and _in_per_cent(dict(unpacked(data, path.name)), pieces):
        said = "headings in %, and cells in a format of per cent, where 12 % is the number 0.12"
        notes.append(Caution(f"{path.name}: {said}; if those are strains, give --unit-of strain=1"))
    return tuple(_tables(path, pieces, ordered, notes))


def _in_per_cent(parts: Mapping[str, bytes], pieces: Sequence[_Piece]) -> bool:
    """Say whether cells of a workbook that are read in % are in a format of per cent themselves.

    In an ODS each says so, in an XLSX by a style: of Excel's own two formats (ECMA-376, 18.8.30),
    or of any other.
    """
    said = parts.get("xl/styles.xml", b"")
    codes = {b"9", b"10", *re.findall(rb'numFmtId="(\d+)"\s+formatCode="[^"]*%', said)}
    xfs = re.findall(rb'<(?:\w+:)?xf\b(?:[^<>]*?numFmtId="(\d+)")?', said.partition(b"cellXfs")[2])
    styles = {b"%d" % n for n, code in enumerate(xfs) if code in codes}
    sheets = [{place for place, n in _STYLED.findall(p) if n in styles} for p in parts.values()]
    return b'type="percentage"' in parts.get("content.xml", b"") or any(
        {b"%s%d" % (_letters(column.at), line) for line in piece.lines} <= cells
        for piece, cells in product(pieces, sheets)
        for column in piece.used
        if column.factor == 0.01
    )


def _letters(at: int) -> bytes:
    return b"%c%c" % (64 + at // 26, 65 + at % 26) if at > 25 else b"%c" % (65 + at)


def _best_grid(sheet: _Grid, content: str | list[list[str]]) -> tuple[_Grid, list[_Block]]:
    """Return the cells of a sheet, split so that headings stand above numbers, and its blocks."""
    tried: list[_Grid] = []
    text = content if isinstance(content, str) else None
    in_it = [s for s in _SEPARATORS if text is not None and (s in text or sheet.by_position)]
    for separator in in_it or [";"]:
        split = enumerate(content, 1) if text is None else tables.split_rows(text, separator)
        rows = _with_signals([*split])
        if separator == " " and sheet.by_position is None:
            rows = _with_headings_of_words(rows)
        grid = replace(sheet, separator=_decimals(rows, separator), rows=rows)
        blocks = _blocks(grid)
        if found := [block for block in blocks if block.rows]:
            return grid, found
        if blocks and text is not None and separator.strip(" "):
            raise FileError(
                f"{grid.where}: headings but no bare numbers below; export them, units in headings"
            )
        tried.append(grid)

    def nearness(grid: _Grid) -> tuple[int, int]:
        width = len(_nearest(grid)[1])
        return width if grid.separator.strip(" ") and width > 1 else 0, width

    return max(tried, key=nearness), []


def _with_headings_of_words(rows: list[tables.TextRow]) -> list[tables.TextRow]:
    """Put words between blanks together to headings: "Time Axial Force" are two.

    As few words as make a heading, or as many, whichever gives as many as there are columns below.
    Headings that come out otherwise would stand above others' numbers: they are left one cell.
    """
    found: list[tables.TextRow] = []
    below = 0
    for line, words in reversed(rows):
        few = len(words) <= _MOST_WORDS and len(words) != below
        choices = [_put_together_words(words, step) for step in (1, -1)] if few else []
        otherwise = [" ".join(words)] if choices and headings_of(words) else words
        found.append((line, next((c for c in choices if len(c) == below), otherwise)))
        below = len(words) if any(words) else below
    return found[::-1]


def _with_signals(rows: list[tables.TextRow]) -> list[tables.TextRow]:
    """Head what stands below "StartOfData" by the rows "Sig1", ... above, as TA's DMA means it."""
    signals = [" ".join(c[1:]) for _, c in rows if c and re.fullmatch(r"Sig\d+", c[0])]
    return [(n, signals if signals and c[:1] == ["StartOfData"] else c) for n, c in rows]


_MOST_WORDS = 60


def _put_together_words(words: Sequence[str], step: int) -> list[str]:
    cells: list[str] = []
    at = 0
    while at < len(words):
        ends = range(at + 1, min(len(words), at + 5) + 1)[::step]
        end = next((e for e in ends if heading_of(" ".join(words[at:e])).meaning), at + 1)
        cells.append(" ".join(words[at:end]))
        at = end
    return cells


def _decimals(rows: Sequence[tables.TextRow], separator: str) -> str:
    """Return the separator by which numbers are read (see `number`).

    Cells in quotes may have decimal commas between commas: "0,5","12,25". A cell that cannot be
    thousands tells, where no number has a dot. Where one sign is seen to be the decimal one, the
    other stands between thousands.
    """
    cells = [cell for _, row in rows for cell in row if cell[:1].isdigit() or cell[:1] in "+-,."]
    dots, commas = (any(map(pattern.fullmatch, cells)) for pattern in _DECIMALS)
    if separator == ",":
        return ",." if dots else ";," if commas else separator
    return f"{separator}," if commas and not dots and separator.strip(" ") else separator


_DECIMALS = [
    re.compile(rf"[+-]?(\d{{4,}}{sign}\d*|\d+{sign}(\d{{1,2}}|\d{{4,}})|0\d*{sign}\d+)")
    for sign in (r"\.", ",")
]


# ------------------------------------------------------------------------------------------------
# Blocks: headings, and the numbers below.


def _blocks(grid: _Grid) -> list[_Block]:
    found = list[_Block]()
    headings = grid.by_position
    start = at = 0
    while at < len(grid.rows):
        own = headings_of(grid.rows[at][1]) if grid.by_position is None else None
        head = at
        if grid.by_position is None and grid.cell(at, 0) == _SEGMENT:
            headings = None
        if own is not None:
            _spread(grid, at)
            headings, at = _with_units(headings_of(grid.rows[at][1]) or own, grid, at)
        elif headings is None:
            at += 1
            continue
        wanted = sum(h.meaning not in ("", "specimen") for h in headings)
        least = 2 if own is not None or found else wanted
        data, at = _numbers_below(grid, headings, at, own is not None, least)
        few = own is None and found and 0 < 4 * len(data) < len(found[-1].rows)
        if few and _is_of_results(grid, start, data[0]):
            headings = None
        elif data or own is not None:
            found.append(_Block(grid, start, data[0] if own is None else head, headings, data))
        start = at if data else start
    return found


def _is_of_results(grid: _Grid, start: int, first: int) -> bool:
    """Say whether numbers stand below two headings as of results: "Maximum Load", "Modulus".

    One may be what is said of a record, as "Break type,ductile".
    """
    above = (map(_folded, cells) for _, cells in grid.rows[start:first])
    return any(len([*filter(_SIGNS["figure"].search, cells)]) > 1 for cells in above)


def _under(grid: _Grid, head: int) -> list[list[str]]:
    """Return the rows between one of headings and the numbers that may go on with it."""
    rows = (cells for _, cells in grid.rows[head + 1 : head + 4])
    return [*takewhile(lambda r: not any(grid.number(c) is not None for c in r if c != "1"), rows)]


def _spread(grid: _Grid, head: int) -> None:
    """Write a merged heading above each column that it spans, with the word that stands below.

    "Travel" above "Crosshead" and "Extensometer" is "Crosshead Travel" and "Extensometer Travel".
    How far it goes a workbook says; else over empty cells with a word, or a unit of it, below.
    """
    line, cells = grid.rows[head]
    under = _under(grid, head)
    numbers = next((row for _, row in grid.rows[head + 1 + len(under) :]), [])
    heads = [*cells, *[""] * (len(numbers) - len(cells))]
    texts = [[c for row in under for c in row[i : i + 1] if c] for i in range(len(numbers))]
    spans = list[list[int]]()
    for i, number in enumerate(numbers):
        if heads[i]:
            spans.append([i])
        elif number and spans and spans[-1][-1] == i - 1:
            kinds = _COLUMNS.get(heading_of(heads[spans[-1][0]]).meaning, {}).keys()
            units = [quantities_of(c.strip("()[]{} ")) for c in texts[i] if not _is_word(c)]
            merged = i in grid.merged[line] if line in grid.merged else texts[i]
            if merged and kinds and not any(map(kinds.isdisjoint, units)):
                spans[-1].append(i)
    for span in (span for span in spans if len(span) > 1):
        top = heads[span[0]]
        words = {i: next(filter(_is_word, texts[i]), "") for i in span}
        ways = {i: (f"{word} {top}".strip(), f"{top} {word}".strip()) for i, word in words.items()}
        known = {i: name for i, both in ways.items() for name in both if _is_term(name)}
        for i, word in words.items():
            heads[i] = known.get(i, ways[i][1]) if known else top
            # Words that are not known, and come again, name specimens.
            for row in (row for row in under if known or row.count(word) == 1):
                row[i : i + 1] = ["" if cell == word else cell for cell in row[i : i + 1]]
        grid.rows[head] = line, heads[: max(len(cells), span[-1] + 1)]


def _is_word(cell: str) -> bool:
    return cell[0] not in "([" and not quantities_of(cell)


def _is_term(name: str) -> bool:
    return bool(heading_of(name).meaning and not heading_of(name).tag)


def _with_units(headings: _Headings, grid: _Grid, head: int) -> tuple[_Headings, int]:
    """Return headings with the units that stand in a row of their own, and the row behind.

    The row is below, or, in what LabVIEW writes, above and says so.
    """
    for row, cells in enumerate(_under(grid, head), start=head + 1):
        units = [cell.strip("()[]{} ") for cell in cells]
        known = any(
            h.meaning and unit and (quantities_of(unit) or cell[0] in "([")
            for h, unit, cell in zip(headings, units, cells, strict=False)
        )
        if known and not all(unit.isdigit() for unit in units if unit):
            return _in_units(headings, units, grid.where), row + 1
    for _, cells in grid.rows[max(head - _NEAR, 0) : head]:
        if cells and _SIGNS["unit"].search(cells[0]):
            return _in_units(headings, cells, grid.where), head + 1
    return headings, head + 1


def _in_units(headings: _Headings, units: Sequence[str], where: str) -> _Headings:
    for h, unit in zip(headings, units, strict=False):
        for q in quantities_of(h.unit or "") & quantities_of(unit) if h.meaning else ():
            said = f"{where}, column {h.text!r}"
            if len({unit_factor(q, one, where=said) for one in (h.unit or "", unit)}) > 1:
                said += f": it says {h.unit!r} and the row of units {unit!r}; give one of both"
                raise FileError(said)
    return [
        replace(h, unit=unit) if unit and not quantities_of(h.unit or "") else h
        for h, unit in zip(headings, [*units, *[""] * len(headings)], strict=False)
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
    for row in range(at, len(grid.rows)):
        cells = grid.rows[row][1]
        if grid.cell(row, 0) == _SEGMENT:
            return found, row + (not found)
        filled = [cells[i] for i in wanted if i < len(cells) and cells[i]]
        words = [cell for cell in filled if not grid.is_number(cell)]
        if not any(cells):
            gap = True
        elif _sums_up(grid, row) or (
            words == filled and (filled or not found or not _names_alone(grid, named, row))
        ):
            if found or not headed or headings_of(cells) is not None:
                return found, row if found or headed or row > at else row + 1
        elif not found and len(filled) - len(words) < least:
            return found, row + 1
        elif words and found and (gap or _WORD.search(words[0])) and _ends(grid, wanted, row):
            return found, row
        else:
            found.append(row)
            gap = False
    return found, len(grid.rows)


def _names_alone(grid: _Grid, named: Sequence[int], row: int) -> bool:
    cells = grid.rows[row][1]
    is_head = _head_text(cells[0]) == "specimen" or headings_of(cells) is not None
    return any(grid.cell(row, i) for i in named) and not is_head


def _sums_up(grid: _Grid, row: int) -> bool:
    """Say whether a row is one of statistics: "Mean" stands before it, and before no record."""
    label = next(filter(None, grid.rows[row][1]), "")
    if len(label) < 2 or not _is_statistic(label):
        return False
    near = grid.rows[max(row - 2, 0) : row + 3]
    return sum(next(filter(None, cells), "") == label for _, cells in near) < _FEWEST_ROWS


def _is_statistic(word: str) -> bool:
    return not _is_figure(word) and _SIGNS["statistic"].fullmatch(word.strip(" .:")) is not None


_SEGMENT = "Channels"
"""With what a head of LabVIEW's begins, each segment's own."""

_WORD = re.compile(r"[^\W\d_]{3}")


def _ends(grid: _Grid, wanted: Sequence[int], at: int) -> bool:
    """Say whether a row of numbers and words begins what follows a record, as a table of results.

    No row of numbers alone comes before the next one of words alone.
    """
    for row in range(at + 1, len(grid.rows)):
        numbers = [grid.is_number(grid.cell(row, i)) for i in wanted]
        if all(numbers) or (any(grid.rows[row][1]) and not any(numbers)):
            return not all(numbers)
    return True


# ------------------------------------------------------------------------------------------------
# Pieces: of a block the columns and rows of one specimen.


def _pieces(grid: _Grid, blocks: Sequence[_Block], notes: list[str]) -> list[_Piece]:
    found: list[_Piece] = []
    groups, marked = list[tuple[str, list[int], str]](), ""
    for block in blocks:
        block = _with_units_of_head(grid, block)
        longer = [r for r in block.rows if any(grid.rows[r][1][len(block.headings) :])]
        if grid.separator[0] == "," and not grid.by_position and 2 * len(longer) > len(block.rows):
            line, cells = grid.rows[longer[0]]
            raise FileError(
                f"{grid.where}, line {line}: {len(cells)} cells where the headings have "
                f"{len(block.headings)}; a decimal comma needs quotes, or semicolons between cells"
            )
        mark = _marked(grid, block)
        if mark or block.is_headed or not groups:  # else it goes on with the names before it
            groups, marked = _groups(grid, block), mark
        for name, places, material in groups:
            several = name if len(blocks) == 1 else f"{marked} {name}".strip()
            own = _split(grid, block, places, marked if len(groups) == 1 else several)
            if material:
                own = [replace(one, texts={"material": material, **one.texts}) for one in own]
            if own and not own[0].name and found and _goes_on(found[-1], own[0]):
                own[0] = replace(own[0], name=found[-1].name)
            found += own
    if results := _results(found):
        line = results[0].lines[0]
        notes.append(f"{grid.where}: from line {line} on a row a specimen, results of the others")
        found = [piece for piece in found if piece not in results]
    longest = Counter[int]()
    for piece in found:
        longest[piece.block.head] = max(longest[piece.block.head], len(piece.lines))
    kept: list[_Piece] = []
    for at, piece in enumerate(found):
        near = [p for p in (*kept[::-1], *found[at + 1 :]) if p.name == piece.name][:2]
        alone = not any(_goes_on(*sorted((p, piece), key=lambda p: p.lines[0])) for p in near)
        if alone and longest[piece.block.head] < _FEWEST_ROWS <= max(longest.values()):
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


_Records = list[tuple[str, list[int], str]]
"""Of each its name, the places of its columns, and its material."""


def _groups(grid: _Grid, block: _Block) -> _Records:
    """Return the columns of each record that stands in a block.

    A row of names above the headings tells them apart, then a part of the headings ("S1_force_N"),
    then headings that come again. Names that come again are a material's, or a batch's.
    """
    headings = block.headings
    known = [i for i, h in enumerate(headings) if h.meaning]
    tags = [h.tag for h in headings]
    above_of: dict[int, str] = {}
    numbered: _Records = []
    for names in (*_names_above(grid, block), tags):
        by_name: dict[str, list[int]] = {}
        for i in known:
            by_name.setdefault(names[min(i, len(names) - 1)], []).append(i)
        shared = [] if _whole(headings, by_name.get("", [])) else by_name.pop("", [])
        partial = [name for name, places in by_name.items() if not _whole(headings, places)]
        if any(len(name) < 2 for name in partial):
            continue  # "Force 1" and "Force 2" may be load cells
        if len(by_name) < 2 or not all(_whole(headings, shared + by_name[n]) for n in partial):
            continue
        if {name.upper() for name in by_name} == {"X", "Y"} and not partial:
            raise _two_axes(grid, headings, by_name)
        called = {name: " ".join(name.split()) for name in by_name}
        if "" in by_name:
            called = {name: str(n) for n, name in enumerate(by_name, start=1)}
        walked = {name: _walked(headings, places) for name, places in by_name.items()}
        cut = [parts for parts in walked.values() if len(parts) > 1]
        again = any(all(_whole(headings, part) for part in parts) for parts in cut)
        if again and names is not tags and not above_of:
            above_of = {i: called[name] for name, places in by_name.items() for i in places}
        records = [
            (f"{called[name]} {n}" if again else called[name], places)
            for name in by_name
            for n, places in enumerate(walked[name] if again else [by_name[name]], start=1)
        ]
        found = [(name, sorted(shared + at), above_of.get(at[0], "")) for name, at in records]
        if not again:
            return found
        numbered = numbered or found
    # A length belongs to all too where a person headed the columns.
    alone = {"time"} | (_LENGTHS if grid.by_position else set())
    return numbered or _that_come_again(headings, known, alone)


def _without_terms(name: str) -> str:
    """Return what a heading says besides quantity and unit: "TPU" of "TPU stress (MPa)"."""
    words = re.split(r"([\s_()\[\],]+)", name)
    others = (w for w in words if w.isdigit() or not (heading_of(w).meaning or quantities_of(w)))
    return "".join(others).strip(" _()[],")


def _that_come_again(headings: _Headings, known: Sequence[int], alone: set[str]) -> _Records:
    """Return the records whose headings come again; what comes once, as time, belongs to all."""
    first, *others = _walked(headings, known)
    once = [
        i
        for i in first
        if headings[i].meaning in alone
        and not all(any(_same(headings[i], headings[j]) for j in at) for at in others)
    ]
    found = [first, *([*once, *places] for places in others)]
    if not others or not all(_whole(headings, places) for places in found):
        return [("", list(known), "")]
    return [(str(n), places, "") for n, places in enumerate(found, start=1)]


def _whole(headings: _Headings, places: Iterable[int]) -> bool:
    return not _missing(headings[i] for i in places)


def _walked(headings: _Headings, places: Iterable[int]) -> list[list[int]]:
    """Cut columns where a heading comes again: first, behind a record."""
    walked: list[list[int]] = [[]]
    for i in places:
        again = any(_same(headings[i], headings[j]) for j in walked[-1])
        if again and (len(walked) > 1 or _whole(headings, walked[-1])):
            walked.append([])
        walked[-1].append(i)
    return walked


def _two_axes(grid: _Grid, headings: _Headings, by_name: Mapping[str, Sequence[int]]) -> FileError:
    said = f"loads and lengths along {' and '.join(by_name)}, two axes of one test"
    times = [i for i, h in enumerate(headings) if h.meaning == "time"]
    mode = "--mode equibiaxial" if grid.option else "the mode 'equibiaxial'"
    ways = [_only(headings, [*at, *times]) for at in by_name.values()]
    return _one_of(grid, said, ways, f", with {mode} if both are loaded alike")


def _names_above(grid: _Grid, block: _Block) -> list[list[str]]:
    """Return the rows near above a block that may name its records: of words, then of numbers.

    Figures are sizes; whole numbers may be those of specimens, as words that count are.
    """
    words, counts, numbers = (list[list[str]]() for _ in range(3))
    above = grid.rows[max(block.head - 3, 0) : block.head][::-1]
    for _, near in above + grid.rows[block.head + 1 : block.rows[0]]:
        cells = [*near, ""]
        if not (figures := [cell for cell in cells if grid.number(cell) is not None]):
            (counts if _counts({*near} - {""}) else words).append(_carried(cells))
        elif all(map(str.isdigit, figures)) and size_of(cells[0])[0] is None:
            numbers.append(_carried(cells))
    found = words + counts + numbers
    # By position the file's own headings stand above, and may name materials.
    return [[*map(_without_terms, row)] for row in found] if grid.by_position else found


def _counts(names: Collection[str]) -> bool:
    """Say whether names count within what stands above them: "Specimen 1", or "S1" to "S3"."""
    split = [re.fullmatch(r"(\D*)(\d{1,3})", name) for name in names]
    stems = {match and match[1] for match in split}
    run = {int(match[2]) for match in split if match} == {*range(1, len(names) + 1)}
    return (run and len(stems) == 1) or all(map(marked_specimen, names))


def _carried(cells: Iterable[str]) -> list[str]:
    """Return cells, an empty one as the one before it."""
    last = ""
    return [last := cell or last for cell in cells]


def _same(one: Heading, other: Heading) -> bool:
    plain = [re.sub(r"[\s\d._#-]+", "", h.text.casefold()) for h in (one, other)]
    return (one.meaning, one.unit, plain[0]) == (other.meaning, other.unit, plain[1])


def _marked(grid: _Grid, block: _Block) -> str:
    """Return the specimen that is named above a block and below the one before, or "".

    A number ahead of the headings, above an empty column, is its: "1,Time,Displacement,Force".
    """
    first = grid.cell(block.head, 0)
    found = first if first.isdigit() and not any(block.cells(0)) else ""
    for _, cells in grid.rows[block.start : block.rows[0]]:
        filled = [cell for cell in cells if cell]
        if len(filled) > 1 and _head_text(filled[0]) == "specimen":
            told = heading_of(filled[1])  # "Run 1" is a name, "Force 1" is none
            found = filled[1] if told.meaning == ("specimen" if told.tag else "") else found
        elif len(filled) < 3 and (mark := marked_specimen(" ".join(filled))) is not None:
            found = mark
    return found


def _split(grid: _Grid, block: _Block, places: Sequence[int], label: str) -> list[_Piece]:
    """Return the pieces of one group of columns: one, or as many as its column of specimens has."""
    headings = block.headings
    named = next((i for i in places if headings[i].meaning == "specimen"), None)
    alone = len(places) == sum(bool(h.meaning) for h in headings)
    filled = [
        i for i in places if headings[i].meaning in _LOADS | _LENGTHS or (alone and i == named)
    ]
    if not (lined := [r for r in block.rows if any(grid.cell(r, i) for i in filled)]):
        return []
    record = replace(block, rows=lined)
    used, notes = _used_columns(record, places)
    values = _values(record, used, notes)
    kept = [column for column in used if column.name in values]
    values = _with_strain(values, grid.where, notes)
    heads = grid.rows[block.head][1] if block.is_headed else []
    heads = [*heads, *[""] * (len(grid.rows[lined[0]][1]) - len(heads) if heads else 0)]
    texts = {_head_text(cell): i for i, cell in enumerate(heads) if cell}
    texts = {what: i for what, i in texts.items() if what in ("material", "mode")}
    read = {*(column.at for column in kept), *texts.values(), named}
    unused = tuple(
        cell or f"column {i + 1} (no heading)"
        for i, cell in enumerate(heads)
        if i not in read and size_of(cell)[0] is None
        if (i in places or not (cell and headings[i].meaning)) and grid.cell(lined[0], i)
        if cell or 2 * sum(map(grid.is_number, record.cells(i))) > len(lined)
    )
    if named is not None:
        names = _carried(record.cells(named))
        counts = len(set(names)) == len(lined) and all(map(grid.is_number, names))
        # Else a list of specimens beside their records.
        if (counts or not alone) and min(Counter(names).values()) < _FEWEST_ROWS <= len(lined):
            named = None
    if named is None:  # several materials, or modes, are several specimens
        named = next((i for i in texts.values() if len({*record.cells(i)} - {""}) > 1), None)
    names = [""] * len(lined) if named is None else _carried(record.cells(named))
    told = {what: record.cells(i) for what, i in texts.items() if what}
    if "material" in told:
        # Merged over several specimens it is filled in its first row alone; an empty mode is the
        # usual one.
        told["material"] = _carried(told["material"])
        full = list(zip(told["material"], names, strict=True))
        # Numbers may begin anew with each material.
        if named is not None and len({*full}) > len({*names}):
            names = ["-".join(one) for one in full]
    rows_of: dict[str, list[int]] = {}
    for n, name in enumerate(names):
        rows_of.setdefault(name, []).append(n)
    return [
        _Piece(
            name or label, grid, block, {column: array[at] for column, array in values.items()},
            kept, [grid.rows[lined[n]][0] for n in at], unused, (*block.notes, *notes), bool(name),
            {what: told[what][at[0]] for what in told},
        )
        for name, at in rows_of.items()
    ]  # fmt: skip


_CLOCK = re.compile(r"(?:(\d+):)?(\d{1,2}):(\d{1,2}(?:[.,]\d*)?)")


def _seconds(cell: str) -> str:
    """Return a time of the form 0:01:02.5 in seconds; any other cell as it is."""
    if (clock := _CLOCK.fullmatch(cell)) is None:
        return cell
    seconds = 3600.0 * int(clock[1] or 0) + 60.0 * int(clock[2]) + float(clock[3].replace(",", "."))
    return f"{seconds:.15g}"


def _values(record: _Block, used: Sequence[_Column], notes: list[str]) -> dict[str, FloatArray]:
    """Return the numbers of columns, by name; without those of a time that has none."""
    grid, found = record.grid, dict[str, FloatArray]()
    rows = [grid.rows[row] for row in record.rows]
    for column in used:
        if short := next((row for row in rows if len(row[1]) <= column.at), None):
            raise FileError(
                f"{grid.where}, line {short[0]}: {len(short[1])} cells where the headings have "
                f"{len(record.headings)}; complete or remove the line"
            )
        at, text, is_time = column.at, column.heading.text, column.name == "time_s"
        cells = {line: _seconds(of[at]) if is_time else of[at] for line, of in rows}
        try:
            numbers = tables.finite_numbers(cells, grid.separator, grid.where, text, column.factor)
            found[column.name] = numbers
        except FileError as error:
            if not is_time or any(grid.number(cell) is not None for cell in cells.values()):
                raise
            notes.append(f"{str(error).partition('; ')[0]}; time is optional and is left out")
    return found


def _with_strain(
    values: dict[str, FloatArray], where: str, notes: list[str]
) -> dict[str, FloatArray]:
    """Return columns with the strain that a stretch, or else a Lagrange strain E, is of.

    The squared stretch of a line along x is 1 + 2 Exx, however the specimen is sheared.
    """
    stretch, lagrange = (values.pop(name, None) for name in ("stretch", "lagrange_strain"))
    if "strain" not in values and stretch is None and lagrange is not None:
        if float(lagrange.min()) <= -0.5:
            raise FileError(
                f"{where}: Lagrange strain reaches {lagrange.min():.4g}; it is above -0.5 at any "
                "stretch: check its unit"
            )
        notes.append(f"{where}: strain is sqrt(1 + 2 E) - 1 of Lagrange strain E")
        stretch = np.sqrt(1.0 + 2.0 * lagrange)
    if stretch is not None:
        values.setdefault("strain", stretch - 1.0)
    return values


def _used_columns(record: _Block, places: Sequence[int]) -> tuple[list[_Column], list[str]]:
    """Return of the columns at some places those that serve: of each canonical name the first.

    A crosshead's absolute position serves only where nothing else tells the travel, an
    extensometer goes before the crosshead. A column with gaps, or that never moves, is left out
    where the others suffice.

    Raises
    ------
    FileError
        A column without a unit, or two of one kind that differ.
    """
    grid, headings, where, notes = record.grid, record.headings, record.grid.where, list[str]()
    cells = {i: record.cells(i) for i in places if headings[i].meaning != "specimen"}
    cells = {i: column for i, column in cells.items() if any(column)}
    told = {i: c for i, c in cells.items() if any(map(grid.is_number, {*c} - {"NaN", "nan"}))}
    cells = told if _whole(headings, told) else cells
    moved = {i: c for i, c in cells.items() if headings[i].meaning == "time" or len({*c}) > 1}
    cells = moved if _whole(headings, moved) else cells
    if lacking := _missing(headings[i] for i in cells):
        raise FileError(f"{where}: no numbers of a {' nor of a '.join(lacking)}; export them too")
    gaps = [i for i, column in cells.items() if "" in column]
    if _whole(headings, (i for i in cells if i not in gaps)):
        for i, j in permutations(cells, 2):
            if i in gaps and j not in gaps and _same(headings[i], headings[j]):
                raise FileError(
                    f"{where}: column {headings[i].text!r} comes again, and what stands beside it "
                    f"is not understood; {_advice(grid.option, _example(headings, twice=True))}"
                )
        for i in gaps:
            notes.append(f"{where}: column {headings[i].text!r} has empty cells; it is left out")
            del cells[i]

    def rank(i: int) -> tuple[bool, bool, bool, bool]:
        # Of the machine's own way, which a nearer sensor's goes before.
        of_crosshead = _SIGNS["crosshead"].search(_folded(headings[i].text)) is not None
        meaning = headings[i].meaning
        unmeasured = meaning not in ("elongation", "strain")
        return len(set(cells[i])) < 2, meaning == "position", unmeasured, of_crosshead

    found: dict[str, _Column] = {}
    doubles: list[_Column] = []
    for i in sorted(cells, key=rank):
        heading = headings[i]
        is_time = heading.meaning == "time"
        if is_time and _CLOCK.fullmatch(cells[i][0]):
            heading = replace(heading, unit="s")
        try:
            column = _Column(i, heading, *heading.column(where))
        except FileError as error:
            others = _whole(headings, (j for j in cells if j != i and headings[j].unit))
            if is_time or (heading.meaning in ("elongation", "position") and others):
                what = "time is optional and" if is_time else "it"
                notes.append(f"{str(error).partition('; ')[0]}; {what} is left out")
                continue
            advice = _advice(grid.option, _example(headings))
            if heading.unit is not None:
                advice = f"name the columns with units that are known by {grid.option}"
            if grid.by_position or (heading.unit is not None and not grid.option):
                raise
            raise FileError(f"{error}, or {advice}") from error
        if (same := found.setdefault(column.name, column)) is column:
            continue
        notes.append(
            f"{where}: column {heading.text!r} left out; {column.name} is read from "
            f"{same.heading.text!r}"
        )
        if rank(i) == rank(same.at) and not is_time:
            doubles.append(column)
    _refuse_bent(headings, where)
    _refuse_ramp(record)
    _refuse_far(record, found)
    is_strain = any(column.heading.quantity == "strain" for column in found.values())
    for other in doubles:
        if not (is_strain and other.name == "displacement_mm"):
            _refuse_two(record, found[other.name], other, doubles)
    if "strain" in found and _SIGNS["tensor"].search(_folded(found["strain"].heading.text)):
        said = f"{where}: {found['strain'].heading.text!r} is read as engineering strain; if it is"
        notes.append(Caution(f"{said} Lagrange's, as of Ncorr or VIC, head it Lagrange strain"))
    return sorted(found.values(), key=lambda column: column.at), notes


def _refuse_bent(headings: _Headings, where: str) -> None:
    """Refuse what a heading tells to be bending or shear: its load would be read as tension."""
    bent = [h.text for h in headings if not h.meaning and _SIGNS["bent"].search(_folded(h.text))]
    if bent:
        raise FileError(f"{where}: {bent[0]!r} is of bending or shear; leave out test or column")


_ONE_TEMPERATURE_C = 4.0
"""From the lowest to the highest of a test at one temperature (ISO 23529: within 2 degrees)."""


def _refuse_ramp(record: _Block) -> None:
    """Refuse a record through which the temperature goes, as a dynamic test's does."""
    for i, heading in enumerate(record.headings):
        if heading.meaning or not _SIGNS["temperature"].search(heading.text):
            continue
        known = [value for value in record.numbers(i) if value is not None]
        if known and max(known) - min(known) > _ONE_TEMPERATURE_C:
            raise FileError(
                f"{record.grid.where}: {heading.text!r} goes from {min(known):g} to "
                f"{max(known):g}; a law is of one temperature: give tests at one each, and what it "
                "was in the column temperature_C of specimens.csv"
            )


def _refuse_far(record: _Block, used: Mapping[str, _Column]) -> None:
    """Refuse a plain travel where a column that is not understood may be a nearer sensor's."""
    grid, headings = record.grid, record.headings
    lengths = [column.heading for column in used.values() if column.heading.meaning in _LENGTHS]
    plain = {h.meaning for h in lengths} <= {"displacement", "position"}
    if grid.by_position or not lengths or not plain:
        return
    near: dict[int, Heading] = {}
    for i, h in enumerate(headings):
        unit = h.unit or _unit_at_end(h.text)
        kinds = quantities_of(unit) & {"length", "strain"}
        # What is not understood may be of a sensor, or a strain of the gauge.
        nearer, otherwise = (_SIGNS[n].search(_folded(h.text)) for n in ("nearer", "otherwise"))
        if h.meaning or unit.isdigit() or not kinds or not nearer or otherwise:
            continue
        numbers = {*record.numbers(i)}
        if None not in numbers and len(numbers) > 1:
            near[i] = replace(h, meaning=_BY_KIND[min(kinds)], unit=unit)
    if near:
        read = [near.get(i, _BLANK if h.meaning in _LENGTHS else h) for i, h in enumerate(headings)]
        first = next(iter(near.values())).text
        said = f"{first!r} is not understood, and may be nearer to the specimen than"
        raise _one_of(grid, f"{said} {lengths[0].text!r}", [read, headings])


def _refuse_two(record: _Block, one: _Column, other: _Column, doubles: list[_Column]) -> None:
    """Refuse two columns of one kind that differ: of two sensors, or of two specimens."""
    first, second = (c.factor * np.array(record.numbers(c.at), np.float64) for c in (one, other))
    is_load = one.heading.meaning in _LOADS or other.heading.meaning in _LOADS
    apart = first - second - (0.0 if is_load else first[0] - second[0])
    if not float(np.max(np.abs(apart))) > _SAME * float(np.ptp(first)):
        return
    grid, headings = record.grid, record.headings
    what = "loads over one length, of two load cells or of two specimens"
    what = what if is_load else "lengths of one record, of two sensors"
    said = f"{one.heading.text!r} and {other.heading.text!r} are two {what}"
    same = {one.at, *(column.at for column in doubles if column.name == one.name)}
    rest = {*range(len(headings))} - same
    both = f", or read {len(same)} specimens by {grid.option} {_example(headings, twice=True)}"
    ways = [_only(headings, rest | {kept.at}) for kept in (one, other)]
    raise _one_of(grid, said, ways, both if is_load and grid.option else "")


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
        if blocks == "apart" and not piece.name and len(pieces) > 1:
            piece = replace(piece, name=str(count))
        name, last = piece.name, found.get(piece.name)
        if last is not None and blocks != "join" and not _goes_on(last, piece):
            who = f"specimen {name}" if name else "the block"
            advice = "write 'Specimen' and its name above each, or give each a file"
            if piece.grid.option:
                advice = "give --blocks apart for specimens, or --blocks join for one record"
            raise FileError(
                f"{piece.grid.where}: {who} that ends on line {last.lines[-1]} starts again on "
                f"line {piece.lines[0]}, and nothing names another; {advice}"
            )
        found[name] = piece if last is None else _put_together(last, piece, notes)
    return [*found.values()]


def _goes_on(one: _Piece, next_: _Piece) -> bool:
    """Say whether a piece's time and length go on where those of the one before ended."""
    a, b = one.columns, next_.columns
    if "time_s" in a and "time_s" in b and b["time_s"][0] < a["time_s"][-1]:
        return False
    if (name := next((c for c in _LENGTH_COLUMNS if c in a and c in b), None)) is None:
        return False
    ends, span = b[name][0] - a[name][[0, -1]], float(np.ptp([*a[name], *b[name]]))
    return bool(abs(ends[1]) <= min(abs(ends[0]), _STEP * span))


_STEP = 0.25
"""Of the range of both: by how much a record in blocks goes on from one to the next at most."""


def _put_together(one: _Piece, next_: _Piece, notes: list[str]) -> _Piece:
    a, b = one.columns, next_.columns
    if lost := [c for c in {**a, **b} if c not in a or c not in b]:
        notes.append(
            f"{one.grid.where}: {', '.join(lost)} is not in all blocks of the record; left out"
        )
    joined = {c: np.concatenate([a[c], b[c]]) for c in a if c in b}
    return replace(one, columns=joined, lines=[*one.lines, *next_.lines])


def _tables(
    path: Path, pieces: list[_Piece], grids: Sequence[_Grid], notes: Sequence[str]
) -> Iterator[TensileTable]:
    """Yield pieces as records, each under a name of its own, with what the file says of it."""
    names = [piece.name for piece in pieces]
    if len(pieces) == 1 and not pieces[0].in_column:
        names = [""]  # a label in the head; the file's name tells specimens apart
    if len({piece.grid.sheet for piece in pieces}) > 1:
        names = [
            name if name and names.count(name) == 1 else f"{piece.grid.sheet} {name}".strip()
            for name, piece in zip(names, pieces, strict=True)
        ]
    said = [size for grid in grids for size in _said_sizes(grid, pieces)]
    labels = {grid: _labels(grid, pieces, names) for grid in grids}
    for nth, (piece, name) in enumerate(zip(pieces, names, strict=True)):
        if names.count(name) > 1:
            raise FileError(
                f"{piece.grid.where}: {names.count(name)} records of specimen {name!r}; give each "
                "a name of its own"
            )
        metadata, sources, unclear = _metadata(piece, nth, pieces, said, labels)
        if name:
            metadata.pop("specimen", None)
        metadata |= piece.texts
        if any(column.heading.compressed for column in piece.used if column.name != "time_s"):
            metadata.setdefault("mode", "compression")
        bare = {column.name for column in piece.used if column.heading.unit is None}
        steps = np.diff(piece.columns.get("time_s", ()))
        way = -1 if len(steps) and (steps < 0.0).all() else 1
        turned = ["the rows stand in reversed order of time; read from the last"] * (way < 0)
        yield TensileTable(
            file=path.name,
            columns={name: values[::way] for name, values in piece.columns.items()},
            factors={column.name: column.factor for column in piece.used},
            lines=np.array(piece.lines, dtype=np.int64)[::way],
            specimen=name or str(metadata.get("specimen", "")),
            metadata=metadata,
            without_unit=frozenset(name.removeprefix("lagrange_") for name in bare - {"stretch"}),
            notes=(*piece.notes, *_behind(piece, pieces), *turned, *notes),
            sheet=piece.grid.sheet,
            headings={column.name: _written(column.heading) for column in piece.used},
            unused=piece.unused,
            sources=sources,
            unclear=unclear,
        )


def _written(heading: Heading) -> str:
    inside = heading.unit is None or heading_of(heading.text).unit == heading.unit
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

    def where(self) -> str:
        sheet = f"sheet {self.grid.sheet!r}, " if self.grid.sheet else ""
        return f"{sheet}line {self.grid.rows[self.row][0]}, {self.key!r}"


_Figures = list[tuple[str, float]]
"""With the labels of their specimens."""

_ONE_CELL = re.compile(r"([^:：=]+?)\s*[:：=]\s*([+-]?[\d.,]+(?:\s*\S+)?)")
_NEAR = 30
_BESIDE = 200
"""Rows of numbers beside which sizes are looked for; programs write them at the top."""


def _said_sizes(grid: _Grid, pieces: Sequence[_Piece]) -> Iterator[_Said]:
    """Yield what all cells say that are not in a record's columns."""
    data: dict[int, int] = {}
    # Of a table that is divided by specimens all pieces have its one block.
    blocks = {id(piece.block): piece.block for piece in pieces if piece.grid is grid}.values()
    for block in blocks:
        width = 1 + max(i for i, h in enumerate(block.headings) if h.meaning)
        data |= {row: max(width, data.get(row, 0)) for row in block.rows}
    heads = {block.head for block in blocks}
    beside = min(data, default=0) + _BESIDE
    for row, (_, cells) in enumerate(grid.rows):
        if row in data and row > beside:
            continue
        for at in range(data.get(row, 0), len(cells)):
            if cells[at] and not _is_figure(cells[at]):
                yield from _said_at(grid, row, at, row not in heads)


def _said_at(grid: _Grid, row: int, at: int, symbols: bool) -> Iterator[_Said]:
    """Yield what one cell says together with its neighbours: to its right, or below it."""
    cells = grid.rows[row][1]
    key, right = cells[at], [c for c in cells[at + 1 :] if c]
    single = _ONE_CELL.fullmatch(key) if len(key) <= tables.LONGEST_HEADING else None
    if single is not None:  # "Width: 6.00 mm"
        key, right = single[1], [single[2]]
    text = _head_text(key)
    if symbols and text == "material" and (listed := _materials_below(grid, row, at)):
        yield _Said(grid, row, key, text, listed)
    elif text and right and _head_text(right[0]) is None and size_of(right[0])[0] is None:
        if text == "mode" and mode_of(right[0]) is None:
            return  # "Test type: QA" and "Direction: MD" are other matters
        yield _Said(grid, row, key, text, (("", right[0]),))
    size, unit, count = size_of(key, symbols=symbols)
    if size is None:
        return
    figures: _Figures = []
    for column, value in enumerate(right, start=at + 1):
        if (split := _split_value(value, grid.separator[0])) is not None:
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
        below = grid.cell(row + 1, at + 1)
        unit = below if _is_of_size(below) else ""
    unit = unit.strip("()[] ")
    if unit:
        size = size_of(f"{key} [{unit}]")[0] or size  # A0 in mm² is an area
    elif size_of(key)[0] is None:
        return  # a symbol without a unit may be anything
    quantity = {"rate_mm_s": "speed", "area_mm2": "area"}.get(size, "length")
    known = quantity in quantities_of(unit)
    if not known and unit and len(figures) == 1 and quantity != "speed":
        raise FileError(
            f"{grid.where}, line {grid.rows[row][0]}, {key!r}: unknown unit {unit!r} of "
            f"{size.split('_')[0]}; use one of 'mm', 'cm', 'in'"
        )
    if figures and (known or not unit):
        factor = unit_factor(quantity, unit, where="") if known else 0.0
        values = tuple((label, v * factor) for label, v in figures if known)
        yield _Said(grid, row, key, size, values, count)


def _is_of_size(unit: str) -> bool:
    return not {"length", "area", "speed"}.isdisjoint(quantities_of(unit.strip("()[] ")))


def _label_above(grid: _Grid, row: int, at: int) -> str:
    """Return the specimen that heads a column of figures: the row of names near it."""
    for other in range(max(row - _NEAR, 0), min(row + _NEAR, len(grid.rows))):
        label = grid.cell(other, at)
        if other != row and label and _head_text(grid.cell(other, 0)) == "specimen":
            return label
    return ""


def _materials_below(grid: _Grid, row: int, at: int) -> tuple[tuple[str, str], ...]:
    """Return the materials below a cell of a table of specimens, by specimen; merged or not."""
    heads = enumerate(grid.rows[row][1])
    named = next((i for i, c in heads if "specimen" in (_head_text(c), heading_of(c).meaning)), at)
    below = dropwhile(lambda r: not grid.cell(r, named), range(row + 1, len(grid.rows)))  # units
    listed = [*takewhile(lambda r: grid.cell(r, named) and not headings_of(grid.rows[r][1]), below)]
    materials = _carried(grid.cell(r, at) for r in listed)
    told = zip([grid.cell(r, named) for r in listed], materials, strict=True)
    return () if named == at else tuple((name, m) for name, m in told if m)


def _figures_below(grid: _Grid, row: int, at: int, unit: str) -> tuple[_Figures, str]:
    """Return the figures below a cell of a table of results, by specimen, and their unit."""
    heads = grid.rows[row][1]
    counts = (i for i, c in enumerate(heads) if c.strip(" .").casefold() in ("no", "nr", "n°"))
    named = next((i for i, c in enumerate(heads) if _head_text(c) == "specimen"), next(counts, 0))
    is_named = size_of(heads[named])[0] is None  # no figure names a specimen
    figures: _Figures = []
    for below in range(row + 1, len(grid.rows)):
        cells, cell = grid.rows[below][1], grid.cell(below, at)
        value = _split_value(cell, grid.separator[0])
        if value is None:
            bare = cell.strip("()[] ")
            if figures or not any(cells) or (bare and (unit or not quantities_of(bare))):
                break
            unit = bare
            continue
        label = grid.cell(below, named) if named != at and is_named else ""
        # "Mean" may stand before an empty label; an "x" beside one is an orientation.
        words = [label] if re.search(r"\w", label) else [c for c in cells[:at] if c]
        if any(map(_is_statistic, words)):
            break
        label = label or (figures[-1][0] if figures else "")
        if (label, value[0]) not in figures[-1:]:
            figures.append((label, value[0]))
        unit = unit or value[1]
    return figures, unit


_LENGTH_RANKS = ("gauge_mm", "height_mm", "length_mm", "grip_mm")


_Labels = Mapping[_Grid, Mapping[int, str]]
"""Of each sheet: the names of the records that it may speak of, by their places."""


def _metadata(
    piece: _Piece, nth: int, pieces: Sequence[_Piece], said: Sequence[_Said], labels: _Labels
) -> tuple[dict[str, float | str], dict[str, str], dict[str, str]]:
    """Return what a file says of one record, where it says so, and what it leaves unclear.

    What stands in the record's block goes before what stands above all, and that before what
    other sheets say.
    """
    heads = [p.block.head for p in pieces if p.grid is piece.grid]
    scopes: dict[tuple[int, str], list[_Said]] = {}
    for one in said:
        within = piece.block.start <= one.row <= piece.block.rows[-1]
        scope = 2 if one.grid is not piece.grid else 0 if within else 1
        behind = scope == 1 and one.row >= min(heads)
        of_another = behind and len(heads) > 1 and len(one.values) < 2
        if nth in labels[one.grid] and not of_another:
            scopes.setdefault((scope, one.name), []).append(one)
    found: dict[str, tuple[float | str | None, str]] = {}
    for (_, name), of in sorted(scopes.items(), key=lambda item: item[0][0]):
        if found.get(name, (None,))[0] is None:
            value, where = _agreed(of, piece, nth, labels)
            if value is not None or name not in found:
                found[name] = value, where
    mode = mode_of(str(found.get("mode", ("",))[0]))
    if mode != "compression" and not any(column.heading.compressed for column in piece.used):
        found.pop("height_mm", None)  # a section's
    if ranked := [found.pop(size) for size in _LENGTH_RANKS if size in found]:
        found["gauge_mm"] = ranked[0]
    values = {size: value for size, (value, _) in found.items() if value is not None}
    sources = {size: at for size, (_, at) in found.items() if size in values}
    return values, sources, {size: at for size, (_, at) in found.items() if size not in values}


def _agreed(
    said: Sequence[_Said], piece: _Piece, nth: int, labels: _Labels
) -> tuple[float | str | None, str]:
    """Return the value that all say, None where they differ, and where they say so."""
    values: dict[float | str, str] = {}
    readings: dict[str, tuple[float, _Said]] = {}
    unclear = open_ = ""
    for one in said:
        beside = one.grid is piece.grid and one.row == piece.block.head
        value = _value_for(one, nth, labels[one.grid], beside)
        if one.number and isinstance(value, float):
            readings[one.number] = value, one
        elif value is not None:
            values.pop(value, None)  # the last place of a value is told
            values[value] = one.where()
        else:
            figures = ", ".join(f"{v:g}" for _, v in one.values if isinstance(v, float))
            gives = f"gives {figures} of specimens" if one.values else "without a unit"
            unclear = f"{one.where()} {gives}"
            open_ = unclear if one.values else open_
    if readings:
        figures_, told = zip(*readings.values(), strict=True)
        at = " and ".join(one.where() for one in told)
        alone = len(told) == len(labels[told[0].grid]) and len(told[0].values) == 1
        if alone and len(told) > 1 and len({*figures_}) > 1:  # or one of each specimen
            unclear = f"{at}, of one specimen or of {len(told)}"
        else:
            values[math.fsum(figures_) / len(figures_)] = at
    several = [f"{v:g} ({at})" for v, at in values.items() if isinstance(v, float)]
    several += [open_] if open_ and several else []
    if len(several) > 1:
        return None, " and ".join(several)
    # Of texts the first holds: a machine's head names its sample before its fixture.
    return next(iter(values.items())) if values else (None, unclear)


def _series(grid: _Grid) -> str:
    """Return the number of a series' sheet: the "2" of "Results Series 2"; "" of any other."""
    match = _SIGNS["series"].search(grid.sheet)
    return match[1] if match else ""


def _labels(grid: _Grid, pieces: Sequence[_Piece], names: Sequence[str]) -> dict[int, str]:
    """Return the records that a sheet, of one series or all, may speak of: names by numbers."""
    series = _series(grid)
    there = [i for i, p in enumerate(pieces) if not series or _series(p.grid) in ("", series)]
    own = {i: pieces[i].name for i in there}
    count = Counter(own.values())
    return {i: _plain_name(name if count[name] == 1 else names[i]) for i, name in own.items()}


def _value_for(one: _Said, nth: int, labels: Mapping[int, str], beside: bool) -> float | str | None:
    """Return the value that holds for a specimen: by its name, else by its place.

    By place only where no label is another specimen's, save in a column beside the records.
    """
    values = {value for _, value in one.values}
    if len(one.values) == 1 and (len(labels) == 1 or not one.values[0][0]):
        return one.values[0][1]
    told = [(_plain_name(label), value) for label, value in one.values]
    named = {value for label, value in told if label and label == labels[nth]}
    if len(named) == 1:
        return named.pop()
    others = not beside and not {label for label, _ in told if label}.isdisjoint(labels.values())
    if len(told) == len(labels) and not others:
        return told[[*labels].index(nth)][1]
    return values.pop() if len(values) == 1 and not (others and len(told) == 1) else None


@functools.lru_cache(maxsize=8192)
def _plain_name(name: str) -> str:
    return re.sub(r"[\s_.-]+", "", marked_specimen(name) or name).casefold()


def _with_units_of_head(grid: _Grid, block: _Block) -> _Block:
    """Return a block with the units that a file's head states by lines of their own.

    A Mark-10 MESURgauge has "Units: N" (of the load), "Travel Unit: mm", an Emperor "Force Units",
    "N"; the columns are without units, time in seconds.

    Raises
    ------
    FileError
        The head names load units that are two different ones.
    """
    units: dict[str, str] = {}
    for line, cells in grid.rows[: block.head]:
        told = _SIGNS["unit of"].fullmatch(" ".join(cell for cell in cells if cell))
        unit = told[2] if told else ""
        of_load = "force" if "force" in quantities_of(unit) else ""
        meaning = heading_of(told[1]).meaning if told and told[1] else of_load
        if meaning and quantities_of(unit) and units.setdefault(meaning, unit) != unit:
            raise FileError(
                f"{grid.where}, line {line}: unit of {meaning} is {unit!r} here and "
                f"{units[meaning]!r} above; keep the right one"
            )
    if units:
        units["time"] = "s"
    filled = [replace(h, unit=h.unit or units.get(h.meaning)) for h in block.headings]
    if filled == [*block.headings]:
        return block
    stated = ", ".join(f"{meaning} in {unit}" for meaning, unit in units.items())
    return replace(block, headings=filled, notes=(f"{grid.where}: {stated} by its head",))


# ------------------------------------------------------------------------------------------------
# Where headings are not understood: which ones, and by which others the file can be read.


def _by_position(columns: Sequence[str]) -> _Headings:
    headings = [heading_of("" if c.strip() == "-" else c) for c in as_texts(columns, "`columns`")]
    for heading in headings:
        if heading.text and not heading.meaning:
            raise FileError(
                f"column {heading.text!r} is unknown; use time_s, displacement_mm, force_N, "
                "strain, stretch, stress_MPa, specimen, or '-' for a column to leave out"
            )
    if _missing(headings):
        raise FileError(
            f"columns {', '.join(columns)}: name one load (force_N, stress_MPa) and one length "
            "(displacement_mm, strain, stretch)"
        )
    return headings


def _count_numbers(grid: _Grid) -> int:
    """Return how many rows of a sheet hold two numbers or more."""
    return sum(sum(grid.number(cell) is not None for cell in cells) > 1 for _, cells in grid.rows)


def _not_understood(grid: _Grid) -> str:
    if grid.by_position is not None:
        count = len(grid.by_position)
        return f"{grid.where}: no row with {count} columns of numbers; check the columns"
    for name, *figures in (cells for _, cells in grid.rows if len(cells) > _FEWEST_ROWS):
        if heading_of(name).meaning in _LENGTHS and all(map(grid.is_number, figures)):
            return f"{grid.where}: figures stand beside {name!r}, not below; transpose the table"
    line, headings, units = _nearest(grid)
    if not headings:
        return (
            f"{grid.where}: no row of headings with a load (force, load, stress) and a length "
            "(displacement, extension, travel, strain, stretch) above columns of numbers; export "
            "the raw data, headed as 'time_s,displacement_mm,force_N'"
        )
    known = [f"{h.text!r} as {h.meaning}" for h in headings if h.meaning]
    unknown = [h.text for h in headings if h.text and not h.meaning]
    shown = [repr(text if len(text) <= 30 else f"{text[:27]}...") for text in unknown[:8]]
    said = (
        f"{grid.where}, line {line}: no heading of a {' nor of a '.join(_missing(headings))}; "
        f"understood: {', '.join(known) or 'none'}; not understood: {', '.join(shown) or 'none'}"
    )
    _refuse_bent(headings, f"{grid.where}, line {line}")
    if len(_missing(headings)) > 1 and any(len(t) > 2 and size_of(t)[0] for t in unknown):
        return f"{said}; a list of specimens is called specimens.csv: rename it, or take it away"
    example = _example([replace(h, unit=u) for h, u in zip(headings, units, strict=True)])
    if sum(bool(h.text) for h in headings) < 2:  # a title stands above numbers without headings
        example = ",".join("?" * max(len(headings), 2))
    named = example.split(",")
    if named.count("?") < len(_missing(map(heading_of, named))):
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
            "force_N, strain, stretch or stress_MPa for a '?', or '-' for a column to leave out"
        )
    left_out = " (a '-' leaves a column out)" if "-" in example.split(",") else ""
    return f"name the columns by position, for example {option} {example}{left_out}"


def _one_of(grid: _Grid, said: str, ways: Iterable[_Headings], end: str = "") -> FileError:
    """Return the refusal of a file in which two columns may be meant, with a way to each."""
    options = " or ".join(f"{grid.option} {_example(way, twice=True)}" for way in ways)
    one = f"take one of them by {options}" if grid.option else "keep one in the file"
    return FileError(f"{grid.where}: {said}; {one}{end}")


def _example(headings: _Headings, *, twice: bool = False) -> str:
    """Return names by position: what is understood, and what units tell of the others.

    Where a load or a length is missing, a "?" stands for what units do not tell. `twice` keeps a
    quantity that comes again.
    """
    names, meant = list[str](), list[str]()
    told = Counter(kind for h in headings if not h.meaning for kind in quantities_of(h.unit or ""))
    for heading in headings:
        unit, name = heading.unit or "", _ALIKE.get(heading.meaning, heading.meaning)
        unit = "mm/mm" if unit == "1" else unit
        kinds = quantities_of(unit)
        if not name and len(kinds) == 1 and told[min(kinds)] == 1 and not twice:
            name = _BY_KIND.get(min(kinds), "")
        if not name or (name in meant and not twice):
            names.append("-")
            continue
        meant.append(name)
        bare = next(iter(_COLUMNS.get(name, {}).values()), name)
        names.append(f"{name.replace(' ', '_')}_{unit}" if unit and name != "specimen" else bare)
    if any(kinds.isdisjoint(meant) for kinds in _SOUGHT.values()):
        names = ["?" if h.text and n == "-" else n for h, n in zip(headings, names, strict=True)]
    return ",".join(names)


_ALIKE = {"position": "displacement", "elongation": "displacement"}
_BY_KIND = {"length": "displacement"} | {k: k for k in ("time", "force", "stress", "strain")}


def _nearest(grid: _Grid) -> tuple[int, _Headings, Sequence[str]]:
    """Return the row that comes nearest to one of headings: its line, headings and units.

    The row above the first row of numbers, or above a row of units there; none where there is none.
    """
    rows = [(line, cells) for line, cells in grid.rows if any(cells)]
    for at, (_, cells) in enumerate(rows):
        filled = [cell for cell in cells if cell]
        numbers = sum(grid.number(cell) is not None for cell in filled)
        # A specimen's name may stand beside them; a size in the head is one number alone.
        if at and numbers > 1 and 2 * numbers >= len(filled):
            break
    else:
        return 0, (), ()
    below = rows[at - 1][1] if at > 1 else []
    known = [bool(quantities_of(cell.strip("()[]")) or cell[0] in "([") for cell in below if cell]
    if 2 * sum(known) < len(known):
        below = []
    line, names = rows[at - 1 - bool(below)]
    headings = [heading_of(name) for name in names]
    units = [h.unit if h.meaning else _unit_at_end(h.text) for h in headings]
    # Of a figure, as a modulus, the unit tells nothing.
    return line, headings, [
        "" if not h.meaning and _SIGNS["figure"].search(_folded(h.text))
        else unit if unit and quantities_of(unit) else other.strip("()[] ")
        for h, unit, other in zip(headings, units, [*below, *[""] * len(names)], strict=False)
    ]  # fmt: skip


def _unit_at_end(name: str) -> str:
    """Return the unit in a heading whose name is not known: "Gap (mm)", "Gap_mm", "Gap / mm"."""
    return re.split(r"[\s_(\[]", re.sub(r"(?:^|[\s_#])\d+$", "", name).rstrip(")] "))[-1]
