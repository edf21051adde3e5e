"""A bar from a profile file: the printed design of a graded bar along its gauge."""

import csv
import math
from pathlib import Path

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.palette import Palette
from planner.simulation.bar import Bar

__all__ = ["read_profile_bar"]

_NEEDED = ("x_mm", "coordinate")
_SECTION = ("width_mm", "thickness_mm")


def read_profile_bar(
    path: str | Path, palette: Palette, *, slices: int, width_mm: float, thickness_mm: float
) -> Bar:
    """Read a profile (CSV) and cut it into slices.

    Parameters
    ----------
    path
        Columns ``x_mm`` (rising; twice for a jump) and ``coordinate``, and where the section is
        not the same along the bar ``width_mm`` and ``thickness_mm``. Linear between rows.
    slices
        About so many, of about one length; none lies across a row.
    width_mm, thickness_mm
        The section where the file has no such column.

    Raises
    ------
    FileError
        The file cannot be read, or a row breaks the rules; the message names the line.
    """
    rows = _rows(Path(path), palette)
    missing = {"width_mm": width_mm, "thickness_mm": thickness_mm}
    columns = {
        k: np.array([row.get(k, missing.get(k)) for row in rows]) for k in (*_NEEDED, *_SECTION)
    }
    x = columns["x_mm"]
    share = np.diff(x) / (x[-1] - x[0])
    count = np.where(share > 0.0, np.maximum(np.rint(share * slices), 1.0), 0.0).astype(np.int64)
    segment = np.repeat(np.arange(len(share)), count)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    within = (np.arange(len(segment)) - first[segment] + 0.5) / count[segment]

    def at_centres(values: FloatArray) -> FloatArray:
        middle: FloatArray = values[segment] + within * np.diff(values)[segment]
        return middle

    pieces = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(x[:-1], x[1:], count, strict=True)]
    return Bar(
        np.concatenate([x[:1], *(piece for piece, n in zip(pieces, count, strict=True) if n)]),
        at_centres(columns["coordinate"]),
        at_centres(columns["width_mm"]) * at_centres(columns["thickness_mm"]),
    )


def _rows(path: Path, palette: Palette) -> list[dict[str, float]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"profile {path}: cannot be read ({error}); give a CSV file") from error
    reader = csv.DictReader(text.splitlines(), skipinitialspace=True)
    columns = tuple(reader.fieldnames or ())
    unknown = [c for c in columns if c not in (*_NEEDED, *_SECTION)]
    if unknown or not set(_NEEDED) <= set(columns) or len(set(columns)) < len(columns):
        raise FileError(
            f"profile {path}: columns are {', '.join(map(repr, columns)) or 'none'}; it takes "
            f"{', '.join(_NEEDED)} and, optional, {', '.join(_SECTION)}, each once"
        )
    rows: list[dict[str, float]] = []
    for cells in reader:
        where = f"profile {path}, line {reader.line_num}"
        row = {name: _number(cells.get(name), f"{where}: {name}") for name in columns}
        _check(row, rows, palette, where)
        rows.append(row)
    if len(rows) < 2 or not rows[-1]["x_mm"] > rows[0]["x_mm"]:
        raise FileError(f"profile {path}: it needs rows from the gauge's beginning to its end")
    return rows


def _check(
    row: dict[str, float], before: list[dict[str, float]], palette: Palette, where: str
) -> None:
    x, m = row["x_mm"], row["coordinate"]
    if before and x < before[-1]["x_mm"]:
        raise FileError(f"{where}: x_mm falls from {before[-1]['x_mm']:g} to {x:g}; it must rise")
    if len(before) > 1 and x == before[-2]["x_mm"]:
        raise FileError(f"{where}: x_mm {x:g} stands three times; a jump is two rows")
    low, high = palette.materials[0].coordinate, palette.materials[-1].coordinate
    if not low <= m <= high:
        raise FileError(
            f"{where}: coordinate is {m:g}; palette {palette.name} goes from {low:g} to {high:g}"
        )
    for name in _SECTION:
        if not row.get(name, 1.0) > 0.0:
            raise FileError(f"{where}: {name} is {row[name]:g}; it must be above 0")


def _number(text: str | None, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileError(f"{where} is {text!r}; it must be a finite number")
    return value
