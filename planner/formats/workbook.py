"""Workbooks (XLSX, XLS, ODS) as sheets of cells, read by calamine once their size is known."""

import datetime
import io
import re
from collections.abc import Iterator

from planner.errors import FileError
from planner.formats.archive import unpacked

__all__ = ["MOST_CELLS", "is_workbook", "read_sheets"]

MOST_CELLS = 20_000_000
"""Of a sheet, empty ones included. Chosen: a test of five days at 5 points a second in eight
columns; what holds more takes gigabytes as cells."""

_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_PLACE = re.compile(rb'\sr="([A-Z]{0,3})(\d{1,7})"')
_REPEATS = re.compile(
    rb"<table:table[ >]|<table:table-row\b([^>]*)>|<table:(?:covered-)?table-cell\b([^>]*)>"
)
_TIMES = re.compile(rb'number-(?:rows|columns)-repeated="(\d{1,9})"')

Sheet = tuple[str, list[list[str]]]
"""Its name, and its cells by row; an empty cell is ''."""


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
        book = CalamineWorkbook.from_filelike(io.BytesIO(data))
        for called in book.sheet_names:
            sheet = book.get_sheet_by_name(called)
            if sheet.total_height * sheet.total_width > MOST_CELLS:
                raise _too_many(f"{name}, sheet {called!r}")
            rows = sheet.to_python(skip_empty_area=False)
            sheets.append((called, [[_text(cell) for cell in row] for row in rows]))
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
    if isinstance(cell, float):
        return f"{cell:.15g}"
    if isinstance(cell, datetime.timedelta):
        return f"{cell.total_seconds():.15g}"
    return str(cell).strip()


def _too_many(where: str) -> FileError:
    return FileError(
        f"{where}: more than {MOST_CELLS:,} cells, empty ones included; delete what lies far from "
        "the table, or save the sheet as CSV"
    )


def _check_size(data: bytes, name: str) -> None:
    """Refuse a workbook that unpacks to too much, or whose cells lie too far apart.

    calamine holds a sheet as one rectangle, so that a single cell in the last row and column
    would take hundreds of gigabytes.
    """
    members = {member: b"".join(pieces) for member, pieces in unpacked(data, name, 1 << 32)}
    if not any(m.startswith("xl/") or m == "content.xml" for m in members):
        raise FileError(f"{name}: a zip archive, but no workbook; unpack it and give its files")
    for member, content in members.items():
        if member.startswith("xl/worksheets/") and _xlsx_cells(content) > MOST_CELLS:
            raise _too_many(f"{name}, {member}")
    if any(cells > MOST_CELLS for cells in _ods_cells(members.get("content.xml", b""))):
        raise _too_many(name)


def _xlsx_cells(content: bytes) -> int:
    rows, columns = 1, 1
    for letters, digits in set(_PLACE.findall(content)):
        rows = max(rows, int(digits))
        column = 0
        for letter in letters:
            column = 26 * column + letter - 64
        columns = max(columns, column)
    return rows * columns


def _ods_cells(content: bytes) -> Iterator[int]:
    """Yield the cells of each table's rectangle; repeats of empty cells at its ends take none."""
    row = row_times = column = rows = columns = 0
    for match in _REPEATS.finditer(content):
        if match[1] is None and match[2] is None:
            yield rows * columns
            row = row_times = column = rows = columns = 0
            continue
        found = _TIMES.search(match[1] if match[1] is not None else match[2])
        times = int(found[1]) if found else 1
        if match[1] is not None:
            row, row_times, column = row + row_times, times, 0
            continue
        column += times
        if b"value" in match[2] or not match[2].rstrip().endswith(b"/"):
            rows, columns = max(rows, row + row_times), max(columns, column)
    yield rows * columns
