"""Numbers of a spreadsheet's first sheet (xlsx), with the standard library alone."""

import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from planner.numerics import FloatArray

__all__ = ["read_numbers"]

_MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"


def read_numbers(path: Path) -> FloatArray:
    """Return the first sheet's rows that hold numbers throughout, (rows, columns)."""
    with zipfile.ZipFile(path) as book:
        sheet = ElementTree.fromstring(book.read("xl/worksheets/sheet1.xml"))
    rows = [
        [float(value.text or "nan") for value in row.iter(f"{_MAIN}v")]
        for row in sheet.iter(f"{_MAIN}row")
    ]
    width = max(map(len, rows))
    return np.array([row for row in rows if len(row) == width])
