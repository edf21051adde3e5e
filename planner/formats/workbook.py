"""Workbooks (XLSX, XLS, ODS) as sheets of cells, read by calamine once their size is known."""

import datetime
import functools
import io
import re

from planner.errors import FileError
from planner.formats.archive import unpacked

__all__ = ["MOST_CELLS", "is_workbook", "read_sheets"]

MOST_CELLS = 20_000_000
"""Of a sheet, empty ones included. Chosen: a test of five days at 5 points a second in eight
columns; what holds more takes gigabytes as cells."""

_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_PLACE = re.compile(rb'\sr="([A-Z]{0,3})(\d{1,7})"')
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
    for table in re.split(rb"<table:table[ >]", members.get("content.xml", b""))[1:]:
        if _ods_cells(table) > MOST_CELLS:
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
