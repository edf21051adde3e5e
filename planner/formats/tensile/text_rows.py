"""A text table as rows of cells, whatever its encoding, separator and decimal sign."""

import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path

from planner.errors import FileError

__all__ = ["TextRow", "iterate_rows", "number", "read_text", "split_rows"]

TextRow = tuple[int, list[str]]
"""Line number in the file, and its cells without blanks around them."""

_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d*")


def read_text(path: Path) -> str:
    """Read a text file in UTF-8, UTF-16 (with byte order mark) or Windows-1252.

    Raises
    ------
    FileError
        The file cannot be read, is empty, or is binary.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror or error}); give the path of a tensile file"
        ) from error
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", errors="replace")
    if "\0" in text:
        raise FileError(f"{path}: a binary file; export the test as CSV or text")
    if not text.strip():
        raise FileError(f"{path}: the file is empty; export the test again")
    return text


def split_rows(text: str, separator: str) -> list[TextRow]:
    """Split a text into rows of cells; a blank `separator` means any run of blanks."""
    return list(iterate_rows(text, separator))


def iterate_rows(text: str, separator: str) -> Iterator[TextRow]:
    """Yield what `split_rows` returns, row by row, for texts too long to hold in cells."""
    if separator == " ":
        yield from ((n, line.split()) for n, line in enumerate(text.splitlines(), start=1))
        return
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    start = 1
    try:
        for cells in reader:
            yield start, [cell.strip() for cell in cells]
            start = reader.line_num + 1
    except csv.Error as error:
        raise FileError(f"line {start}: {error}") from error


def number(cell: str, separator: str) -> float | None:
    """Return the number in a cell, or None where there is none.

    A comma is the decimal sign where it does not separate cells; in a file separated by commas,
    "1,234.5" in quotes is one thousand and some.
    """
    if "," in cell:
        if separator == ",":
            if not _THOUSANDS.fullmatch(cell):
                return None
            cell = cell.replace(",", "")
        else:
            if "." in cell:
                return None
            cell = cell.replace(",", ".")
    try:
        return float(cell) if "_" not in cell else None
    except ValueError:
        return None
