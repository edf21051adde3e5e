"""Tables: rows of cells of a text, whatever its separator, or of a workbook; columns of numbers."""

import contextlib
import csv
import datetime
import functools
import io
import math
import re
import subprocess
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import FileError
from planner.formats.files import SIGNIFICANT_DIGITS, read_file, unpacked
from planner.formats.units import unit_factor
from planner.numerics import FloatArray

__all__ = [
    "LARGEST_FIGURE",
    "LONGEST_HEADING",
    "TextRow",
    "decode_text",
    "encode_csv",
    "finite_numbers",
    "is_workbook",
    "number",
    "read_columns",
    "read_rows",
    "read_sheets",
    "split_rows",
]


# ------------------------------------------------------------------------------------------------
# A text table as rows of cells, whatever its encoding, separator and decimal sign.


TextRow = tuple[int, list[str]]
"""Line number in the file, and its cells without blanks around them."""

LARGEST_FIGURE = 1e30
"""What no test can measure, in mm, N, s or MPa; beyond it squares and products would overflow."""

LONGEST_HEADING = 200
"""Characters; programs write 80 at most, and searching a heading takes the square of them."""

_THOUSANDS = {
    ",": re.compile(r"[+-]?(?P<first>\d)\d{0,2}(,\d{3})+(?P<decimals>\.\d*)?"),
    ".": re.compile(r"[+-]?(?P<first>\d)\d{0,2}(\.\d{3})+(?P<decimals>,\d*)?"),
}
"""By what stands between thousands."""
_BY_BLANKS = re.compile(r"[+-]?[1-9]\d{0,2}( \d{3})+([.,]\d*)?")
_GROUPED = str.maketrans({"\N{NO-BREAK SPACE}": "", "\N{NARROW NO-BREAK SPACE}": "", "'": "",
                          "\N{MINUS SIGN}": "-"})  # fmt: skip
"""What groups digits by thousands besides dot and comma: French and Swiss programs write these."""

_FORMULA = re.compile(r"'*[=+\-@＝＋－＠\t\r\n]")
"""What a spreadsheet takes a cell for a formula by (OWASP, CSV injection), and apostrophes before:
one more makes a text of it, and is taken off when planner reads it."""

_FIGURE = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def encode_csv(
    rows: Iterable[Iterable[str | float | None]], digits: int = SIGNIFICANT_DIGITS
) -> bytes:
    """Return rows as CSV, which no spreadsheet takes for formulas; `read_rows` gives texts back.

    Figures have so many significant digits; None and what is not finite leave a cell empty.
    """
    lines = [",".join(_csv_cell(value, digits) for value in row) for row in rows]
    return "".join(f"{line}\n" for line in lines).encode("utf-8")


def _csv_cell(value: str | float | None, digits: int) -> str:
    if isinstance(value, float):
        return f"{value + 0.0:.{digits}g}" if math.isfinite(value) else ""
    if not isinstance(value, str):
        return "" if value is None else str(value).lower()
    if _FORMULA.match(value) and not _FIGURE.fullmatch(value):
        value = f"'{value}"
    return f'"{value.replace(chr(34), chr(34) * 2)}"' if re.search(r'[",\r\n]', value) else value


def decode_text(data: bytes, path: Path) -> str:
    """Return a text in UTF-8, UTF-16, GB 18030, Shift-JIS, or Windows-949, -1251 or -1252.

    Raises
    ------
    FileError
        It is empty, or binary.
    """
    text = _decoded(data)
    if "\0" in text:
        raise FileError(f"{path}: a binary file; export it as CSV or text")
    if not text.strip():
        raise FileError(f"{path}: the file is empty; export it again")
    return text


_KOREAN = "하중 변위 시간 응력 변형 연신".encode("cp949").split()
"""Load, displacement, time, stress, strain, elongation: as Chinese they are no words."""


def _decoded(data: bytes) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    # Digits and separators are most of a record: of UTF-16 every other byte is then zero.
    odd, even = data[1::2].count(0), data[::2].count(0)
    if 2 * max(odd, even) > len(data) // 2 and min(odd, even) == 0:
        text = data.decode("utf-16-le" if odd else "utf-16-be", errors="replace")
        if "\n" in text:  # no other binary data
            return text
    with contextlib.suppress(UnicodeDecodeError):
        return data.decode("utf-8-sig")
    # A Chinese character is two bytes from 0xA1 on; in European texts such bytes stand alone.
    runs = re.findall(rb"[\x80-\xff]+", data)
    if all(len(run) % 2 == 0 and min(run) >= 0xA1 for run in runs):
        is_korean = any(word in data for word in _KOREAN)
        return data.decode("cp949" if is_korean else "gb18030", errors="replace")
    with contextlib.suppress(UnicodeDecodeError):
        text = data.decode("cp932")
        # What European letters become as Shift-JIS begins with bytes from 0xA0 on; kana and the
        # usual kanji begin below, where Windows-1252 has quotes, dashes and the euro.
        begins = [c.encode("cp932")[0] for c in text if not c.isascii()]
        if 2 * sum(byte < 0xA0 for byte in begins) > len(begins):
            return text
    # Cyrillic words are of such bytes alone; of other European letters at most two stand together.
    cyrillic = sum(map(len, runs)) > 2 * len(runs)
    return data.decode("cp1251" if cyrillic else "cp1252", errors="replace")


def split_rows(text: str, separator: str) -> Iterator[TextRow]:
    """Split a text into rows of cells; a blank is any run of blanks, two are a run of two up.

    Beside blanks a hash that begins a line, as NumPy's headings, is no cell.
    """
    if not separator.strip(" "):
        blanks = re.compile(r"\s+" if separator == " " else r"\s{2,}|\t")
        for n, line in enumerate(text.splitlines(), start=1):
            yield n, blanks.split(line.strip().lstrip("# "))
        return
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    start = 1
    try:
        for cells in reader:
            bare = map(str.strip, cells)
            yield start, [c[1:] if c[:1] == "'" and _FORMULA.match(c) else c for c in bare]
            start = reader.line_num + 1
    except csv.Error as error:
        raise FileError(f"line {start}: {error}") from error


def read_rows(path: Path) -> tuple[list[str], str, Iterator[TextRow]]:
    """Read a table: its headings, its separator (the likeliest) and its rows that are not blank.

    Raises
    ------
    FileError
        The file cannot be read, is empty, or is binary.
    """
    text = decode_text(read_file(path, advice="give a CSV file"), path)
    separator = max(",;\t", key=text.strip().splitlines()[0].count)
    rows = ((line, cells) for line, cells in split_rows(text, separator) if any(cells))
    return next(rows)[1], separator, rows


def number(cell: str, separator: str) -> float | None:
    """Return the number in a cell, or None where there is none.

    A comma is the decimal sign where it does not separate cells; of comma and dot the last one is:
    "1,234.5" and "1.234,5" are one thousand and some. Where the decimal sign is known it stands
    behind the separator: "1,234" is a thousand and some with ",.", as "1.234" is with ";,".
    """
    cell = cell.translate(_GROUPED)
    if " " in cell and _BY_BLANKS.fullmatch(cell):
        cell = cell.replace(" ", "")
    between = "," if separator[0] == "," else "."
    if "," in cell and "." in cell:  # whichever comes last is the decimal sign
        between = min(",.", key=cell.find)
    if between in cell:
        groups = _THOUSANDS[between].fullmatch(cell)
        if groups and (groups["decimals"] or (separator[1:].strip() and groups["first"] != "0")):
            cell = cell.replace(between, "")
        elif "," in cell:
            return None
    try:
        return float(cell.replace(",", ".")) if "_" not in cell else None
    except ValueError:
        return None


# ------------------------------------------------------------------------------------------------
# Workbooks (XLSX, XLS, ODS) as sheets of cells, read by calamine once their size is known.


_MOST_CELLS = 20_000_000
"""Of a sheet, empty ones included. Chosen: a test of five days at 5 points a second in eight
columns; what holds more takes gigabytes as cells."""

_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_TRIAL = """
import sys, python_calamine
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, -1))
except (ImportError, ValueError):
    pass  # Windows; or less is allowed already
python_calamine.CalamineWorkbook.from_filelike(sys.stdin.buffer)
"""
"""Of an XLS: calamine ends the process that cannot hold its sheets, each one rectangle of at most
0.5 GB. Whatever a file in sectors says of itself, in any damage, a trial tells it."""
_PLACE = re.compile(rb"""\sr\s*=\s*["']([A-Z]{0,3})(\d{1,7})["']""")
_TIMES = re.compile(rb"""number-(?:rows|columns)-repeated\s*=\s*["'](\d{1,9})["']""")

Sheet = tuple[str, list[list[str]], dict[int, set[int]]]
"""Its name, its cells by row, an empty one '', and by line the columns that a merged one covers."""


def is_workbook(data: bytes) -> bool:
    """Say whether bytes begin as a workbook does, whatever the file is called."""
    return data[:4] == b"PK\x03\x04" or data[:8] == _OLE


def read_sheets(data: bytes, name: str) -> list[Sheet]:
    """Return the sheets of a workbook as texts; numbers with the 15 digits that Excel keeps.

    Raises
    ------
    FileError
        No workbook that can be read, or one whose cells would exhaust memory.
    """
    from python_calamine import CalamineWorkbook

    if data[:2] == b"PK":
        _check_size(data, name)
    sheets: list[Sheet] = []
    try:
        if data[:8] == _OLE and subprocess.run(
            [sys.executable, "-c", _TRIAL], input=data, capture_output=True, check=False
        ).returncode not in (0, 1):  # 1: refused, as it will be here
            raise ValueError("damaged: its cells take more than 4 GB of memory")
        book = CalamineWorkbook.from_filelike(io.BytesIO(data))
        for called in book.sheet_names:
            sheet = book.get_sheet_by_name(called)
            if sheet.total_height * sheet.total_width > _MOST_CELLS:
                raise _too_many(f"{name}, sheet {called!r}")
            rows = [[_text(c) for c in row] for row in sheet.to_python(skip_empty_area=False)]
            merged = dict[int, set[int]]()
            for (top, left), (_, right) in sheet.merged_cell_ranges or ():
                merged.setdefault(top + 1, set()).update(range(left + 1, right + 1))
            sheets.append((called or name, rows, merged))
    except (FileError, MemoryError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # calamine is compiled: its panics are no Exception
        said = " ".join(str(error).split())[:200]
        raise FileError(
            f"{name}: a workbook that cannot be read ({said}); save it again as XLSX, without a "
            "password"
        ) from error
    return sheets


def _text(cell: object) -> str:
    if isinstance(cell, bool):
        return str(cell).lower()
    if isinstance(cell, datetime.timedelta):
        cell = cell.total_seconds()
    return f"{cell:.15g}" if isinstance(cell, float) else str(cell).strip()


def _too_many(where: str) -> FileError:
    return FileError(
        f"{where}: more than {_MOST_CELLS:,} cells, empty ones included; delete what lies far from "
        "the table, or save the sheet as CSV"
    )


def _check_size(data: bytes, name: str) -> None:
    """Refuse a workbook that unpacks to too much, or whose cells lie too far apart.

    calamine holds a sheet as one rectangle, so that a single cell in the last row and column
    would take hundreds of gigabytes.
    """
    members = dict(unpacked(data, name, 1 << 32))
    if not any(m.startswith("xl/") or m == "content.xml" for m in members):
        raise FileError(f"{name}: a zip archive, but no workbook; unpack it and give its files")
    for member, content in members.items():
        if member.startswith("xl/worksheets/") and _xlsx_cells(content) > _MOST_CELLS:
            raise _too_many(f"{name}, {member}")
    for table in re.split(rb"<table:table[ >]", members.get("content.xml", b""))[1:]:
        if _ods_cells(table) > _MOST_CELLS:
            raise _too_many(name)


def _xlsx_cells(content: bytes) -> int:
    places = _PLACE.findall(content)
    rows = max((int(digits) for _, digits in places), default=1)
    letters = max((letters for letters, _ in places), key=lambda of: (len(of), of), default=b"A")
    return rows * functools.reduce(lambda number, letter: 26 * number + letter - 64, letters, 0)


def _ods_cells(table: bytes) -> int:
    """Return the cells of a table's rectangle; repeats of empty cells at its ends take none."""
    rows = [(_times(row.partition(b">")[0]), row) for row in table.split(b"<table:table-row")[1:]]
    while rows and b"value" not in rows[-1][1]:
        rows.pop()
    ends = [row.find(b">", row.rfind(b"value")) for _, row in rows]
    cells = [row[:end].split(b"table-cell")[1:] for (_, row), end in zip(rows, ends, strict=True)]
    return sum(times for times, _ in rows) * max((sum(map(_times, c)) for c in cells), default=0)


def _times(element: bytes) -> int:
    found = _TIMES.search(element)
    return int(found[1]) if found else 1


# ------------------------------------------------------------------------------------------------
# Tables of numbers with known columns: profiles and strain fields.


_WITH_UNIT = re.compile(r"(?P<name>.+?)(?:\s*[(\[]\s*(.*?)\s*[)\]]|_([^_]*))")


@dataclass(frozen=True, slots=True, eq=False)
class ColumnFile:
    """The columns of a file, in planner's units.

    Attributes
    ----------
    numbers
        Arrays of one length by column.
    texts
        The same of the columns of texts.
    lines
        Line number of each row.
    """

    numbers: Mapping[str, FloatArray]
    texts: Mapping[str, tuple[str, ...]]
    lines: tuple[int, ...]


def read_columns(
    path: Path,
    columns: Mapping[str, str | None],
    *,
    texts: Collection[str] = (),
    optional: Collection[str] = (),
    gaps: Collection[str] = (),
    others: bool = False,
) -> ColumnFile:
    """Read a table whose columns are known.

    Parameters
    ----------
    columns
        Name, with its unit as suffix, and quantity (see `unit_factor`; None for a bare number).
        Another unit of that quantity may stand in the heading: "x_in", "x (in)".
    texts
        Columns of texts.
    optional
        Columns that may be absent.
    gaps
        Columns whose cells may be empty, which is NaN.
    others
        Whether the file may have further columns, which are left out.

    Raises
    ------
    FileError
        A column that is missing, double or unknown, a unit that is unknown, or a cell that is
        no finite number; the message names file, line and column.
    """
    where = path.name
    headings, separator, rows = read_rows(path)
    named: Mapping[str, str | None] = {**dict.fromkeys(texts), **columns}
    found: dict[str, tuple[int, float]] = {}
    for place, heading in enumerate(headings):
        try:
            name, factor = _column(heading, named, where)
        except FileError:
            if others:
                continue
            raise
        if name in found:
            raise FileError(f"{where}: two columns {name!r}; keep one")
        found[name] = place, factor
    if missing := [name for name in named if name not in found and name not in optional]:
        raise FileError(
            f"{where}: no column {' nor '.join(map(repr, missing))}; its columns are "
            f"{', '.join(headings)}"
        )
    table = list(rows)
    for line, cells in table:
        if len(cells) < len(headings) or any(cells[len(headings) :]):
            raise FileError(f"{where}, line {line}: {len(cells)} cells for {len(headings)} columns")
    if not table:
        raise FileError(f"{where}: headings but no numbers below them; export the file again")
    numbers, words = dict[str, FloatArray](), dict[str, tuple[str, ...]]()
    lines = tuple(line for line, _ in table)
    for name, (place, factor) in found.items():
        of = tuple(cells[place] for _, cells in table)
        if name not in columns:
            words[name] = of
            continue
        filled = [row for row, cell in enumerate(of) if cell or name not in gaps]
        known = {lines[row]: of[row] for row in filled}
        numbers[name] = np.full(len(of), np.nan)
        numbers[name][filled] = finite_numbers(known, separator, where, headings[place], factor)
    return ColumnFile(numbers, words, lines)


def _column(heading: str, columns: Mapping[str, str | None], where: str) -> tuple[str, float]:
    """Return the column that a heading names, and the factor from its unit."""
    if heading in columns:
        return heading, 1.0
    stems = {name.rpartition("_")[0]: name for name, quantity in columns.items() if quantity}
    if heading and heading in stems:
        raise FileError(f"{where}, column {heading!r}: no unit; head it {stems[heading]!r}")
    match = _WITH_UNIT.fullmatch(heading) if len(heading) <= LONGEST_HEADING else None
    name = stems.get(match["name"]) if match else None
    if match is None or name is None:
        raise FileError(f"{where}: unknown column {heading!r}; it has {', '.join(columns)}")
    unit = match[2] if match[3] is None else match[3]
    return name, unit_factor(columns[name] or "", unit, where=f"{where}, column {heading!r}")


def finite_numbers(
    cells: Mapping[int, str], separator: str, where: str, heading: str, factor: float
) -> FloatArray:
    """Return a column's numbers, times a factor, of its cells by line.

    Raises
    ------
    FileError
        A cell has none, or one that is not finite or beyond `LARGEST_FIGURE`; the message names
        file, line and column.
    """
    values = [number(cell, separator) for cell in cells.values()]
    for (line, cell), value in zip(cells.items(), values, strict=True):
        if value is None or not abs(value) <= LARGEST_FIGURE:
            finite = value is not None and math.isfinite(value)
            raise FileError(
                f"{where}, line {line}, column {heading!r}: {cell!r} is "
                f"{f'beyond {LARGEST_FIGURE:g}' if finite else 'no finite number'}; "
                "repair or remove the line"
            )
    return factor * np.array(values, dtype=np.float64)
