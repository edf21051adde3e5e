"""Values in space from a file: CSV, NPY, and VTK's image (VTI) and unstructured (VTU) data."""

import csv
import hashlib
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError, FileError
from planner.formats.vtk_xml import read_vti, read_vtu

__all__ = ["GridTable", "PointTable", "read_grid_table", "read_point_table"]

_COLUMNS = ("x_mm", "y_mm", "z_mm")


@dataclass(frozen=True, eq=False)
class GridTable:
    """Values on a regular grid.

    Attributes
    ----------
    first_mm, spacing_mm
        Place of the first value, and steps along x, y, z.
    values : (nx, ny, nz) float64
        Indexed by x, y, z.
    sha256
        Of the file's bytes.
    """

    first_mm: tuple[float, float, float]
    spacing_mm: tuple[float, float, float]
    values: FloatArray
    sha256: str


@dataclass(frozen=True, eq=False)
class PointTable:
    """Values at points, (n, 3) in mm and (n,)."""

    points_mm: FloatArray
    values: FloatArray
    sha256: str


def read_grid_table(
    path: Path,
    *,
    array: str | None = None,
    first_mm: tuple[float, float, float] | None = None,
    spacing_mm: tuple[float, float, float] | None = None,
) -> GridTable:
    """Read values on a regular grid.

    Parameters
    ----------
    path
        ``.csv`` with x_mm, y_mm, z_mm and one further column, every place of a grid once;
        ``.npy`` with three axes x, y, z; or ``.vti``.
    array
        Name of the values where a file has several.
    first_mm, spacing_mm
        Of a ``.npy``, which does not say.

    Raises
    ------
    FileError, ArgumentError
        The file cannot be read, or holds something else; the message says what.
    """
    data = _bytes(path)
    kind = path.suffix.casefold()
    if kind == ".npy":
        if first_mm is None or spacing_mm is None:
            raise ArgumentError(
                f"{path}: a .npy does not say where it lies; give origin= and step="
            )
        values = _npy(data, path)
        first, spacing = first_mm, spacing_mm
    elif kind == ".vti":
        first, spacing, values = read_vti(data, str(path), array)
    elif kind == ".csv":
        first, spacing, values = _regular(*_csv(data, path, array), path)
    else:
        raise FileError(f"{path}: a table is a .csv, .npy or .vti; points come as .csv or .vtu")
    _check(values, path)
    if min(spacing) <= 0.0 or not np.isfinite([*first, *spacing]).all():
        raise FileError(f"{path}: steps of the grid are {spacing} mm; they must be positive")
    return GridTable(first, spacing, values, hashlib.sha256(data).hexdigest())


def read_point_table(path: Path, *, array: str | None = None) -> PointTable:
    """Read values at points: ``.csv`` with x_mm, y_mm, z_mm and a value, or ``.vtu``.

    Raises
    ------
    FileError
        The file cannot be read, or holds something else; the message says what.
    """
    data = _bytes(path)
    kind = path.suffix.casefold()
    if kind == ".vtu":
        points, values = read_vtu(data, str(path), array)
    elif kind == ".csv":
        points, values = _csv(data, path, array)
    else:
        raise FileError(f"{path}: points come as .csv or .vtu; a table is a .csv, .npy or .vti")
    _check(values, path)
    _check(points, path)
    return PointTable(points, values, hashlib.sha256(data).hexdigest())


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path}: cannot be read ({reason}); check the name") from error


def _check(values: FloatArray, path: Path) -> None:
    if values.size == 0:
        raise FileError(f"{path}: holds no values")
    bad = ~np.isfinite(values)
    if bad.any():
        raise FileError(
            f"{path}: value {int(np.argmax(bad.ravel())) + 1} of {values.size} is not a finite "
            "number; fill the gaps or leave those points out"
        )


def _npy(data: bytes, path: Path) -> FloatArray:
    try:
        values = np.load(io.BytesIO(data), allow_pickle=False)
        found = np.ascontiguousarray(values, dtype=np.float64)
    except (ValueError, TypeError, OSError, EOFError) as error:
        raise FileError(f"{path}: is no .npy of numbers ({error})") from error
    if found.ndim != 3:
        raise FileError(f"{path}: has shape {found.shape}; it needs three axes: x, y, z")
    return found


def _csv(data: bytes, path: Path, array: str | None) -> tuple[FloatArray, FloatArray]:
    try:
        rows = list(csv.reader(io.StringIO(data.decode("utf-8-sig"))))
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path}: is no CSV in UTF-8 ({error})") from error
    rows = [row for row in rows if any(cell.strip() for cell in row)]
    head = [cell.strip() for cell in rows[0]] if rows else []
    others = [name for name in head if name not in _COLUMNS]
    wanted = array if array is not None else (others[0] if len(others) == 1 else None)
    if not set(_COLUMNS) <= set(head) or wanted not in others:
        which = f"; array= may be {', '.join(others)}" if len(others) > 1 else ""
        raise FileError(
            f"{path}: columns are {', '.join(head) or 'none'}; it needs x_mm, y_mm, z_mm and a "
            f"value{which}"
        )
    if len(rows) < 2:
        raise FileError(f"{path}: holds no values")
    columns = [head.index(name) for name in (*_COLUMNS, wanted)]
    found = np.empty((len(rows) - 1, 4))
    for number, row in enumerate(rows[1:], start=2):
        try:
            found[number - 2] = [float(row[column]) for column in columns]
        except (ValueError, IndexError):
            raise FileError(f"{path}: line {number} is {row}; it needs four numbers") from None
    return found[:, :3].copy(), found[:, 3].copy()


def _regular(
    points: FloatArray, values: FloatArray, path: Path
) -> tuple[tuple[float, float, float], tuple[float, float, float], FloatArray]:
    if not np.isfinite(points).all():
        raise FileError(f"{path}: a place is not finite")
    axes = [np.unique(points[:, axis]) for axis in range(3)]
    shape = tuple(map(len, axes))
    steps = [(a[-1] - a[0]) / (len(a) - 1) if len(a) > 1 else 1.0 for a in axes]
    even = all(
        np.allclose(np.diff(a), step, rtol=1e-6, atol=0.0)
        for a, step in zip(axes, steps, strict=True)
    )
    index = tuple(np.searchsorted(a, points[:, axis]) for axis, a in enumerate(axes))
    if not even or int(np.prod(shape)) != len(values):
        raise FileError(
            f"{path}: its {len(values)} places are no regular grid ({' x '.join(map(str, shape))} "
            "different x, y, z, evenly spaced); use points: for values that lie anywhere"
        )
    table = np.full(shape, np.nan)
    table[index] = values
    first = float(axes[0][0]), float(axes[1][0]), float(axes[2][0])
    return first, (float(steps[0]), float(steps[1]), float(steps[2])), table
