"""VTU and VTI, grids of VTK, written: cells or a lattice of points, and values there."""

import io
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError
from planner.numerics import FloatArray, IntArray

__all__ = [
    "HEXAHEDRON",
    "QUADRATIC_HEXAHEDRON",
    "TETRAHEDRON",
    "TRIANGLE",
    "VERTEX",
    "WEDGE",
    "encode_vti",
    "encode_vtu",
]


# VTK's numbers of cell types; nodes of each in VTK's own order (VTK File Formats, Kitware).
VERTEX = 1
TRIANGLE = 5
TETRAHEDRON = 10
HEXAHEDRON = 12
WEDGE = 13
QUADRATIC_HEXAHEDRON = 25

_NAMES = {
    "i1": "Int8", "u1": "UInt8", "i4": "Int32", "u4": "UInt32", "i8": "Int64", "f4": "Float32",
    "f8": "Float64",
}  # fmt: skip

_Values = Mapping[str, FloatArray | IntArray | NDArray[np.float32]]


def encode_vtu(
    points: FloatArray | NDArray[np.float32],
    cells: Sequence[tuple[int, IntArray]],
    *,
    point_data: _Values | None = None,
    cell_data: _Values | None = None,
) -> bytes:
    """Return the bytes of a VTU file: data appended as they are, little endian, not packed.

    Parameters
    ----------
    points : (n, 3)
    cells
        VTK's type, and nodes (m, k) of each cell; values of cells follow in the same order.
    point_data, cell_data
        By name: (n,) or (n, c) of points, (m,) or (m, c) of all cells.

    Raises
    ------
    ArgumentError
        Values for another number of points or cells, or of a type that VTU has not.
    """
    count, cell_count = len(points), sum(len(nodes) for _, nodes in cells)
    file = _Document("UnstructuredGrid", "")
    file.body.write(f'<Piece NumberOfPoints="{count}" NumberOfCells="{cell_count}">\n')
    file.group("PointData", point_data or {}, count)
    file.group("CellData", cell_data or {}, cell_count)
    file.body.write("<Points>\n")
    file.array(points, "Points")
    file.body.write("</Points>\n<Cells>\n")
    nodes = [np.asarray(given, dtype=np.int64) for _, given in cells]
    file.array(np.concatenate([np.empty(0, np.int64), *(n.ravel() for n in nodes)]), "connectivity")
    sizes = np.repeat([n.shape[1] for n in nodes], [len(n) for n in nodes])
    file.array(np.cumsum(sizes, dtype=np.int64), "offsets")
    file.array(
        np.repeat(np.array([t for t, _ in cells], np.uint8), [len(n) for n in nodes]), "types"
    )
    file.body.write("</Cells>\n")
    return file.encoded()


def encode_vti(first_mm: FloatArray, spacing_mm: FloatArray, values: _Values) -> bytes:
    """Return the bytes of a VTI file: values (nx, ny, nz) at the points of a lattice, by name.

    Data are appended as by `encode_vtu`.
    """
    shape = next(iter(values.values())).shape
    extent = " ".join(f"0 {n - 1}" for n in shape)
    origin, spacing = (" ".join(f"{v:.9g}" for v in one) for one in (first_mm, spacing_mm))
    lattice = f'WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}"'
    file = _Document("ImageData", lattice)
    file.body.write(f'<Piece Extent="{extent}">\n')
    flat = {name: each.ravel(order="F") for name, each in values.items()}  # x runs fastest
    file.group("PointData", flat, int(np.prod(shape)))
    return file.encoded()


class _Document:
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
        kind = _NAMES.get(values.dtype.newbyteorder("<").str[1:])
        if kind is None:
            raise ArgumentError(
                f"{name}: values of type {values.dtype} have no place in a VTU file"
            )
        width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        self.body.write(
            f'<DataArray type="{kind}" Name={quoteattr(name)}{width} format="appended" '
            f'offset="{self.blocks.tell()}"/>\n'
        )
        data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
        self.blocks.write(len(data).to_bytes(8, "little") + data)

    def group(self, tag: str, values_of: _Values, size: int) -> None:
        """Add values of so many points or cells."""
        self.body.write(f"<{tag}>\n")
        for name, values in values_of.items():
            if len(values) != size or values.ndim > 2:
                raise ArgumentError(f"{name}: {values.shape} values for {size} of {tag}")
            self.array(np.asarray(values), name)
        self.body.write(f"</{tag}>\n")

    def encoded(self) -> bytes:
        """Return the whole file."""
        self.body.write(f'</Piece>\n</{self.kind}>\n<AppendedData encoding="raw">\n_')
        end = b"\n</AppendedData>\n</VTKFile>\n"
        return self.body.getvalue().encode() + self.blocks.getvalue() + end
