"""Values in space: CSV, NPY, VTK's image (VTI) and unstructured (VTU) data, read."""

import base64
import binascii
import csv
import hashlib
import io
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

import numpy as np

from planner.errors import ArgumentError, FileError
from planner.numerics import FloatArray, Point

__all__ = ["read_grid_table", "read_point_table"]


# ------------------------------------------------------------------------------------------------
# VTK's XML files: image data (VTI) and unstructured grids (VTU), as their specification has them.
#
# Read are ASCII, inline base64 and appended data, plain or compressed by zlib, of any byte order.


_TYPES = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4",
    "Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
_MOST_BYTES = 1 << 32


@dataclass(frozen=True)
class _Document:
    root: ElementTree.Element
    appended: bytes
    raw: bool
    order: str
    header: str
    zipped: bool
    name: str

    def fail(self, what: str) -> NoReturn:
        raise FileError(f"{self.name}: {what}; write it again from ParaView or meshio")


def _read_vti(data: bytes, name: str, array: str | None) -> tuple[Point, Point, FloatArray]:
    """Read an image: place of the first value, spacing, values (nx, ny, nz).

    Raises
    ------
    FileError
        Not such a file, or without such an array.
    """
    document = _open(data, name, "ImageData")
    image = document.root.find("ImageData")
    piece = None if image is None else image.find("Piece")
    if image is None or piece is None:
        document.fail("has no ImageData with a Piece")
    try:
        extent = [int(n) for n in str(piece.get("Extent") or image.get("WholeExtent")).split()]
        origin = [float(n) for n in image.get("Origin", "0 0 0").split()]
        spacing = [float(n) for n in image.get("Spacing", "1 1 1").split()]
        sizes = [extent[2 * d + 1] - extent[2 * d] for d in range(3)]
    except (ValueError, IndexError):
        document.fail("has an extent, origin or spacing that is no list of numbers")
    if len(origin) != 3 or len(spacing) != 3 or min(sizes) < 0:
        document.fail("has an extent, origin or spacing of another length")
    found = _named(document, piece, array)
    values, in_cells = found
    shape = [n if in_cells else n + 1 for n in sizes]
    if values.size != int(np.prod(shape)):
        document.fail(f"has {values.size} values for a grid of {shape}")
    offset = 0.5 if in_cells else 0.0
    first = [o + (extent[2 * d] + offset) * spacing[d] for d, o in enumerate(origin)]
    # x runs fastest.
    table = np.ascontiguousarray(values.reshape(shape[::-1]).transpose(2, 1, 0))
    return (first[0], first[1], first[2]), (spacing[0], spacing[1], spacing[2]), table


def _read_vtu(data: bytes, name: str, array: str | None) -> tuple[FloatArray, FloatArray]:
    """Read points (n, 3) and values (n,) of an unstructured grid; cells are not used.

    Raises
    ------
    FileError
        Not such a file, or without such an array at its points.
    """
    document = _open(data, name, "UnstructuredGrid")
    points, values = [], []
    for piece in document.root.iter("Piece"):
        place = piece.find("Points/DataArray")
        if place is None:
            document.fail("has a Piece without Points")
        at = _decode(document, place)
        found, in_cells = _named(document, piece, array, at_points=True)
        if in_cells or at.size != 3 * found.size:
            document.fail(f"has {found.size} values for {at.size // 3} points")
        points.append(at.reshape(-1, 3))
        values.append(found)
    if not points:
        document.fail("has no Piece")
    return np.concatenate(points), np.concatenate(values)


def _open(data: bytes, name: str, kind: str) -> _Document:
    text, appended, raw = data, b"", False
    start = data.find(b"<AppendedData")
    if start >= 0:
        head_end = data.find(b">", start)
        mark = data.find(b"_", head_end)
        end = data.rfind(b"</AppendedData")
        raw = b'encoding="raw"' in data[start:head_end]
        appended = data[mark + 1 : end if end > mark else len(data)]
        text = data[:start] + b"</VTKFile>"
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise FileError(f"{name}: declares XML entities, which no VTK file needs; it is not read")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise FileError(f"{name}: is no XML that can be read ({error})") from error
    if root.tag != "VTKFile" or root.get("type") != kind:
        found = root.get("type") or root.tag
        raise FileError(f"{name}: is a {found} file; a VTKFile of type {kind} is needed")
    order = ">" if root.get("byte_order") == "BigEndian" else "<"
    header = order + _TYPES.get(root.get("header_type", "UInt32"), "u4")
    packer = root.get("compressor")
    if packer not in (None, "vtkZLibDataCompressor"):
        raise FileError(f"{name}: is packed by {packer}; only zlib is read, so write it again")
    return _Document(root, appended, raw, order, header, packer is not None, name)


def _named(
    document: _Document, piece: ElementTree.Element, array: str | None, *, at_points: bool = False
) -> tuple[FloatArray, bool]:
    """Find the values by name, or the only ones; and whether they belong to cells."""
    known: dict[str, tuple[ElementTree.Element, bool]] = {}
    for group, in_cells in (("PointData", False), ("CellData", True)):
        if in_cells and at_points:
            continue
        for item in piece.findall(f"{group}/DataArray"):
            if item.get("NumberOfComponents", "1") in ("", "1"):
                known.setdefault(item.get("Name", ""), (item, in_cells))
    if array is None and len(known) == 1:
        array = next(iter(known))
    if array not in known:
        has = ", ".join(known) or "none of one number each"
        what = "several arrays" if array is None and known else f"no array {array}"
        raise FileError(f"{document.name}: has {what}; array= may be: {has}")
    item, in_cells = known[array]
    return _decode(document, item), in_cells


def _decode(document: _Document, item: ElementTree.Element) -> FloatArray:
    kind = _TYPES.get(item.get("type", ""))
    if kind is None:
        document.fail(f"has values of type {item.get('type')}")
    encoding = item.get("format", "ascii")
    try:
        if encoding == "ascii":
            return np.array((item.text or "").split(), dtype=np.float64)
        if encoding == "appended":
            block = document.appended[int(item.get("offset", "0")) :]
            data = _unpacked(document, block, document.raw)
        else:
            data = _unpacked(document, re.sub(rb"\s", b"", (item.text or "").encode()), False)
        return np.frombuffer(data, dtype=document.order + kind).astype(np.float64)
    except (ValueError, IndexError, zlib.error, binascii.Error) as error:
        document.fail(f"has an array that cannot be decoded ({error})")


def _unpacked(document: _Document, block: bytes, raw: bool) -> bytes:
    """Take the data behind its header of lengths; base64 encodes header and data apart."""
    word = np.dtype(document.header)

    def words(count: int) -> list[int]:
        size = count * word.itemsize
        head = block[:size] if raw else base64.b64decode(block[: 4 * ((size + 2) // 3)])[:size]
        return [int(n) for n in np.frombuffer(head, dtype=word)]

    if not document.zipped:
        size = words(1)[0]
        _check_size(document, size)
        if raw:
            return block[word.itemsize : word.itemsize + size]
        total = word.itemsize + size
        return base64.b64decode(block[: 4 * ((total + 2) // 3)])[word.itemsize : total]
    count = words(1)[0]
    _check_size(document, count * word.itemsize)
    lengths = words(3 + count)[3:]
    size = (3 + count) * word.itemsize
    _check_size(document, sum(lengths))
    if raw:
        data = block[size : size + sum(lengths)]
    else:
        start = 4 * ((size + 2) // 3)
        data = base64.b64decode(block[start : start + 4 * ((sum(lengths) + 2) // 3)])
    parts, at = [], 0
    for length in lengths:
        parts.append(zlib.decompress(data[at : at + length]))
        at += length
    return b"".join(parts)


def _check_size(document: _Document, size: int) -> None:
    if not 0 <= size <= _MOST_BYTES:
        document.fail(f"has an array of {size} bytes")


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

    first_mm: Point
    spacing_mm: Point
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
    first_mm: Point | None = None,
    spacing_mm: Point | None = None,
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
        first, spacing, values = _read_vti(data, str(path), array)
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
        points, values = _read_vtu(data, str(path), array)
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
        if any(cell.strip() for cell in row[len(head) :]):
            raise FileError(
                f"{path}: line {number} has {len(row)} cells for {len(head)} columns; write one "
                "number a column, with a dot as its decimal sign"
            )
    return found[:, :3].copy(), found[:, 3].copy()


def _regular(points: FloatArray, values: FloatArray, path: Path) -> tuple[Point, Point, FloatArray]:
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
