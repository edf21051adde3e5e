"""Values in space: CSV, NPY, VTK's images (VTI) and unstructured grids (VTU); both also written."""

import base64
import hashlib
import io
import itertools
import math
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, FileError, refused
from planner.formats.files import most_unpacked, read_file
from planner.formats.tables import read_columns, read_rows
from planner.numerics import FloatArray, IntArray, Point

__all__ = ["GridTable", "encode_vti", "encode_vtu", "read_grid_table", "read_point_table"]


# ------------------------------------------------------------------------------------------------
# VTK's XML files: image data (VTI) and unstructured grids (VTU), as their specification has them.
#
# Read are ASCII, inline base64 and appended data, plain or compressed by zlib, of any byte order.


_TYPES = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4",
    "Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
_FARTHEST_INDEX = 1 << 31
"""VTK counts an image's values along each axis by integers of 32 bits."""


@dataclass(frozen=True)
class _Document:
    root: ElementTree.Element
    appended: bytes
    raw: bool
    order: str
    header: str
    zipped: bool
    name: str
    size: int

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
    if len(origin) != 3 or len(spacing) != 3 or len(extent) != 6 or min(sizes) < 0:
        document.fail("has an extent, origin or spacing of another length")
    if not np.isfinite([*origin, *spacing]).all() or max(map(abs, extent)) >= _FARTHEST_INDEX:
        document.fail("has an extent, origin or spacing that is not finite")
    item, in_cells = _named(document, piece, array)
    shape = [n if in_cells else n + 1 for n in sizes]
    values = _decode(document, item, math.prod(shape), f"a grid of {shape}")
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
    points, values, total = [], [], 0
    for piece in document.root.iter("Piece"):
        place = piece.find("Points/DataArray")
        if place is None:
            document.fail("has a Piece without Points")
        count = _whole(piece.get("NumberOfPoints", ""))
        if count is None:
            document.fail("has a Piece without NumberOfPoints")
        total += count  # pieces may share one array
        _check_size(document, 4 * 8 * total)
        item, _ = _named(document, piece, array, at_points=True)
        points.append(_decode(document, place, 3 * count, f"{count} points").reshape(-1, 3))
        values.append(_decode(document, item, count, f"{count} points"))
    if not points:
        document.fail("has no Piece")
    return np.concatenate(points), np.concatenate(values)


def _open(data: bytes, name: str, kind: str) -> _Document:
    text, appended, raw = data, b"", False
    if (start := data.find(b"<AppendedData")) >= 0:
        head_end = data.find(b">", start)
        mark = data.find(b"_", head_end)
        end = data.rfind(b"</AppendedData")
        raw = b'encoding="raw"' in data[start:head_end]
        appended = data[mark + 1 : end if end > mark else len(data)]
        text = data[:start] + b"</VTKFile>"
    if b"\0" in text:
        raise FileError(f"{name}: is no XML in UTF-8; write it again from ParaView or meshio")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise FileError(f"{name}: declares XML entities, which no VTK file needs; it is not read")
    broken = (ElementTree.ParseError, ValueError, LookupError)
    with refused(FileError, name, "is no XML that can be read ({})", *broken):
        root = ElementTree.fromstring(text)
    if root.tag != "VTKFile" or root.get("type") != kind:
        found = root.get("type") or root.tag
        raise FileError(f"{name}: is a {found} file; a VTKFile of type {kind} is needed")
    order = ">" if root.get("byte_order") == "BigEndian" else "<"
    header = order + _TYPES.get(root.get("header_type", "UInt32"), "u4")
    packer = root.get("compressor")
    if packer not in (None, "vtkZLibDataCompressor"):
        raise FileError(f"{name}: is packed by {packer}; only zlib is read, so write it again")
    return _Document(root, appended, raw, order, header, packer is not None, name, len(data))


def _named(
    document: _Document, piece: ElementTree.Element, array: str | None, *, at_points: bool = False
) -> tuple[ElementTree.Element, bool]:
    """Find the values by name, or the only ones; and whether they belong to cells."""
    known: dict[str, tuple[ElementTree.Element, bool]] = {}
    for group in ("PointData",) if at_points else ("PointData", "CellData"):
        for item in piece.findall(f"{group}/DataArray"):
            if item.get("NumberOfComponents", "1") in ("", "1"):
                known.setdefault(item.get("Name", ""), (item, group == "CellData"))
    if array is None and len(known) == 1:
        array = next(iter(known))
    if array not in known:
        has = ", ".join(known) or "none of one number each"
        what = "several arrays" if array is None and known else f"no array {array}"
        raise FileError(f"{document.name}: has {what}; array= may be: {has}")
    return known[array]


def _decode(document: _Document, item: ElementTree.Element, count: int, needed: str) -> FloatArray:
    """Return the `count` values of an array, which is refused before it is unpacked if it differs.

    What it is `needed` for stands in the message.
    """
    kind = _TYPES.get(item.get("type", ""))
    if kind is None:
        document.fail(f"has values of type {item.get('type')}")
    dtype = np.dtype(document.order + kind)
    encoding = item.get("format", "ascii")
    try:
        if encoding == "ascii":
            text = item.text or ""
            words = (float(word[0]) for word in re.finditer(r"\S+", text))
            # One more than needed shows that there are too many.
            found = np.fromiter(itertools.islice(words, min(count, len(text)) + 1), np.float64)
        else:
            block, raw = re.sub(rb"\s", b"", (item.text or "").encode()), False
            if encoding == "appended":
                offset = _whole(item.get("offset", "0"))
                if offset is None:
                    document.fail(f"has an array at offset {item.get('offset')}")
                block, raw = document.appended[offset:], document.raw
            data = _unpacked(document, block, raw, count * dtype.itemsize)
            with np.errstate(invalid="ignore"):  # signalling NaN, refused later like any other
                found = np.frombuffer(data, dtype=dtype).astype(np.float64)
    except (ValueError, IndexError, zlib.error) as error:  # binascii's error is a ValueError
        document.fail(f"has an array that cannot be decoded ({error})")
    if found.size != count:
        document.fail(f"has {found.size} values or more for {needed}")
    return found


def _unpacked(document: _Document, block: bytes, raw: bool, needed: int) -> bytes:
    """Take the data behind its header of lengths, unless they promise more or less than needed.

    Base64 encodes the header with the data, but apart from it where that is packed.
    """
    word = np.dtype(document.header)

    def stretch(at: int, size: int) -> tuple[bytes, int]:
        """Return `size` bytes that lie, or whose base64 lies, at a place; and the place behind."""
        end = at + (size if raw else 4 * ((size + 2) // 3))
        return (block[at:end] if raw else base64.b64decode(block[at:end])[:size]), end

    def lengths(data: bytes) -> list[int]:
        return [int(n) for n in np.frombuffer(data, dtype=word)]

    if not document.zipped:
        data, _ = stretch(0, word.itemsize + needed)
        _check_promise(document, lengths(data[: word.itemsize])[0], needed)
        return data[word.itemsize :]
    count = lengths(stretch(0, word.itemsize)[0])[0]
    if count * word.itemsize > len(block):
        raise ValueError(f"{count} packed blocks in {len(block)} bytes")
    head, behind = stretch(0, (3 + count) * word.itemsize)
    _, usual, last, *packed = lengths(head)
    sizes = [usual] * count
    if count and last:
        sizes[-1] = last
    _check_promise(document, sum(sizes), needed)
    _check_size(document, needed)
    data, _ = stretch(behind, sum(packed))
    parts, at = [], 0
    for length, size in zip(packed, sizes, strict=True):
        # One more than promised shows that there is too much; and 0 would mean no limit.
        parts.append(zlib.decompressobj().decompress(data[at : at + length], size + 1))
        if len(parts[-1]) != size:
            raise ValueError(f"a block of {size} bytes unpacks to another length")
        at += length
    return b"".join(parts)


def _check_promise(document: _Document, promised: int, needed: int) -> None:
    if promised != needed:
        document.fail(f"has an array of {promised} bytes where {needed} are needed")


def _check_size(document: _Document, size: int) -> None:
    """Refuse what takes far more memory than the file itself."""
    if size > most_unpacked(document.size):
        document.fail(f"is {document.size} bytes that unpack to {size} or more")


def _whole(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 19 else None


_Lies = tuple[Point, Point] | None

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


def read_grid_table(
    path: Path, *, array: str | None = None, lies: _Lies = None, data: bytes | None = None
) -> GridTable:
    """Read values on a regular grid.

    Parameters
    ----------
    path
        ``.csv`` with x_mm, y_mm, z_mm and one further column, every place of a grid once;
        ``.npy`` with three axes x, y, z; or ``.vti``.
    array
        Name of the values where a file has several.
    lies
        Of a ``.npy``, which does not say: the place of the first value, and the steps.
    data
        The bytes of a ``.vti`` that is not on disk.

    Raises
    ------
    FileError, ArgumentError
        The file cannot be read, or holds something else; the message says what.
    """
    data = read_file(path, advice="check the name") if data is None else data
    kind = path.suffix.casefold()
    if kind == ".npy":
        if lies is None or array:
            raise ArgumentError(
                f"{path}: a .npy holds values alone; give origin= and step=, and no array="
            )
        (first, spacing), values = lies, _npy(data, path)
    elif kind == ".vti":
        first, spacing, values = _read_vti(data, str(path), array)
    elif kind == ".csv":
        first, spacing, values = _regular(*_csv(path, array), path)
    else:
        raise FileError(f"{path}: a table is a .csv, .npy or .vti; points come as .csv or .vtu")
    _check(values, path)
    if min(spacing) <= 0.0 or not np.isfinite([*first, *spacing]).all():
        raise FileError(f"{path}: steps of the grid are {spacing} mm; they must be positive")
    return GridTable(first, spacing, values, hashlib.sha256(data).hexdigest())


def read_point_table(path: Path, *, array: str | None = None) -> tuple[FloatArray, FloatArray, str]:
    """Read values at points: ``.csv`` with x_mm, y_mm, z_mm and a value, or ``.vtu``.

    Returns
    -------
    points : (n, 3)
        In mm.
    values : (n,)
    sha256
        Of the file's bytes.

    Raises
    ------
    FileError
        The file cannot be read, or holds something else; the message says what.
    """
    data = read_file(path, advice="check the name")
    kind = path.suffix.casefold()
    if kind == ".vtu":
        points, values = _read_vtu(data, str(path), array)
    elif kind == ".csv":
        points, values = _csv(path, array)
    else:
        raise FileError(f"{path}: points come as .csv or .vtu; a table is a .csv, .npy or .vti")
    for found in (values, points):
        _check(found, path, "fill the gaps or leave those points out")
    return points, values, hashlib.sha256(data).hexdigest()


def _check(values: FloatArray, path: Path, then: str = "fill the gaps") -> None:
    if values.size == 0:
        raise FileError(f"{path}: holds no values")
    if (bad := ~np.isfinite(values)).any():
        raise FileError(
            f"{path}: value {int(np.argmax(bad.ravel())) + 1} of {values.size} is not a finite "
            f"number; {then}"
        )


def _npy(data: bytes, path: Path) -> FloatArray:
    """Read a .npy by its head; nothing is unpickled, nor made before it is known to be there."""
    stream = io.BytesIO(data)
    said = "is no .npy of numbers, or cut short ({}); write it by numpy.save"
    # Whatever numpy's parser of foreign bytes may raise.
    with refused(FileError, path, said, Exception):
        npy = np.lib.format
        is_first = npy.read_magic(stream) == (1, 0)
        read = npy.read_array_header_1_0 if is_first else npy.read_array_header_2_0
        shape, by_columns, dtype = read(stream)
    if dtype.kind not in "biuf":
        raise FileError(
            f"{path}: holds values of type {dtype}; it needs real numbers: write "
            "array.astype(float) by numpy.save"
        )
    if len(shape) != 3:
        raise FileError(f"{path}: has shape {shape}; it needs three axes: x, y, z")
    with refused(FileError, path, said, Exception):
        values = np.ndarray(shape, dtype, data, stream.tell(), order="F" if by_columns else "C")
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later
        return np.array(values, np.float64, order="C")


def _csv(path: Path, array: str | None) -> tuple[FloatArray, FloatArray]:
    head = read_rows(path)[0]
    others = [name for name in head if name and name not in _COLUMNS]
    wanted = array or (others[0] if len(others) == 1 else "")
    if not set(_COLUMNS) <= set(head) or wanted not in others:
        which = f"; array= may be {', '.join(others)}" if len(others) > 1 else ""
        raise FileError(
            f"{path}: columns are {', '.join(head)}; it needs x_mm, y_mm, z_mm and "
            f"{array or 'a value'}{which}"
        )
    numbers = read_columns(path, dict.fromkeys([*_COLUMNS, wanted]), others=True).numbers
    return np.column_stack([numbers[name] for name in _COLUMNS]), numbers[wanted]


def _regular(points: FloatArray, values: FloatArray, path: Path) -> tuple[Point, Point, FloatArray]:
    axes = [np.unique(points[:, axis]) for axis in range(3)]
    shape = tuple(map(len, axes))
    steps = [(a[-1] - a[0]) / (len(a) - 1) if len(a) > 1 else 1.0 for a in axes]
    pairs = zip(axes, steps, strict=True)
    even = all(np.allclose(np.diff(a), step, rtol=1e-6, atol=0.0) for a, step in pairs)
    index = tuple(np.searchsorted(a, points[:, axis]) for axis, a in enumerate(axes))
    if not even or math.prod(shape) != len(values):
        raise FileError(
            f"{path}: its {len(values)} places are no regular grid ({' x '.join(map(str, shape))} "
            "different x, y, z, evenly spaced); use points: for values that lie anywhere"
        )
    table = np.full(shape, np.nan)
    table[index] = values
    first = float(axes[0][0]), float(axes[1][0]), float(axes[2][0])
    return first, (float(steps[0]), float(steps[1]), float(steps[2])), table


# ------------------------------------------------------------------------------------------------
# VTU and VTI, written: cells or a lattice of points, and values there.


_CELLS = {3: 5, 4: 10, 6: 13, 8: 12}
"""VTK's types of triangles, tetrahedra, wedges and hexahedra by their number of nodes, which are in
VTK's own order (VTK File Formats, Kitware)."""

_NAMES = {kind: name for name, kind in _TYPES.items()}

_Values = Mapping[str, FloatArray | IntArray | NDArray[np.float32]]


def encode_vtu(
    points: FloatArray | NDArray[np.float32],
    cells: Sequence[IntArray],
    *,
    point_data: _Values | None = None,
    cell_data: _Values | None = None,
) -> bytes:
    """Return the bytes of a VTU file: data appended as they are, little endian, not packed.

    Parameters
    ----------
    points : (n, 3)
    cells
        Nodes (m, k) of triangles, tetrahedra, wedges and hexahedra, each kind by itself; values of
        cells follow in the same order.
    point_data, cell_data
        By name: (n,) or (n, c) of points, (m,) or (m, c) of all cells.
    """
    count, counts = len(points), [len(nodes) for nodes in cells]
    cell_count = sum(counts)
    file = _Written("UnstructuredGrid", "")
    file.body.write(f'<Piece NumberOfPoints="{count}" NumberOfCells="{cell_count}">\n')
    file.group("PointData", point_data or {})
    file.group("CellData", cell_data or {})
    file.body.write("<Points>\n")
    file.array(points, "Points")
    file.body.write("</Points>\n<Cells>\n")
    nodes = [np.empty(0, np.int64), *(np.ravel(given) for given in cells)]
    file.array(np.concatenate(nodes, dtype=np.int64), "connectivity")
    sizes = [given.shape[1] for given in cells]
    file.array(np.cumsum(np.repeat(sizes, counts), dtype=np.int64), "offsets")
    file.array(np.repeat(np.array([_CELLS[n] for n in sizes], np.uint8), counts), "types")
    file.body.write("</Cells>\n")
    return file.encoded()


def encode_vti(first_mm: FloatArray, spacing_mm: FloatArray, values: _Values) -> bytes:
    """Return the bytes of a VTI file: values (nx, ny, nz) at the points of a lattice, by name.

    Data are appended as by `encode_vtu`.
    """
    shape = next(iter(values.values())).shape
    extent = " ".join(f"0 {n - 1}" for n in shape)
    origin, spacing = (" ".join(f"{v:.9g}" for v in one) for one in (first_mm, spacing_mm))
    file = _Written("ImageData", f'WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}"')
    file.body.write(f'<Piece Extent="{extent}">\n')
    flat = {name: each.ravel(order="F") for name, each in values.items()}  # x runs fastest
    file.group("PointData", flat)
    return file.encoded()


class _Written:
    """A file of VTK in the making: its head, and the arrays appended to it."""

    def __init__(self, kind: str, attributes: str) -> None:
        self.kind, self.body, self.blocks = kind, io.StringIO(), io.BytesIO()
        self.body.write(
            f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" '
            f'byte_order="LittleEndian" header_type="UInt64">\n<{kind}{attributes and " "}'
            f"{attributes}>\n"
        )

    def array(self, values: NDArray[np.generic], name: str) -> None:
        """Add an array, (n,) or (n, c)."""
        kind = _NAMES[values.dtype.newbyteorder("<").str[1:]]
        width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        self.body.write(
            f'<DataArray type="{kind}" Name="{escape(name)}"{width} format="appended" '
            f'offset="{self.blocks.tell()}"/>\n'
        )
        data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
        self.blocks.write(len(data).to_bytes(8, "little") + data)

    def group(self, tag: str, values_of: _Values) -> None:
        """Add values of all points or cells."""
        self.body.write(f"<{tag}>\n")
        for name, values in values_of.items():
            self.array(np.asarray(values), name)
        self.body.write(f"</{tag}>\n")

    def encoded(self) -> bytes:
        """Return the whole file."""
        self.body.write(f'</Piece>\n</{self.kind}>\n<AppendedData encoding="raw">\n_')
        end = b"\n</AppendedData>\n</VTKFile>\n"
        return self.body.getvalue().encode() + self.blocks.getvalue() + end
