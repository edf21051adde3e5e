"""VTU, unstructured grids of VTK, written: points, cells, and values at both."""

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
    body, blocks = io.StringIO(), io.BytesIO()
    count, cell_count = len(points), sum(len(nodes) for _, nodes in cells)

    def array(values: NDArray[np.generic], name: str) -> None:
        kind = _NAMES.get(values.dtype.newbyteorder("<").str[1:])
        if kind is None:
            raise ArgumentError(
                f"{name}: values of type {values.dtype} have no place in a VTU file"
            )
        width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        body.write(
            f'<DataArray type="{kind}" Name={quoteattr(name)}{width} format="appended" '
            f'offset="{blocks.tell()}"/>\n'
        )
        data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
        blocks.write(len(data).to_bytes(8, "little") + data)

    def group(tag: str, values_of: _Values, size: int) -> None:
        body.write(f"<{tag}>\n")
        for name, values in values_of.items():
            if len(values) != size or values.ndim > 2:
                raise ArgumentError(f"{name}: {values.shape} values for {size} of {tag}")
            array(np.asarray(values), name)
        body.write(f"</{tag}>\n")

    body.write(
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" '
        'byte_order="LittleEndian" header_type="UInt64">\n<UnstructuredGrid>\n'
        f'<Piece NumberOfPoints="{count}" NumberOfCells="{cell_count}">\n'
    )
    group("PointData", point_data or {}, count)
    group("CellData", cell_data or {}, cell_count)
    body.write("<Points>\n")
    array(points, "Points")
    body.write("</Points>\n<Cells>\n")
    nodes = [np.asarray(given, dtype=np.int64) for _, given in cells]
    array(np.concatenate([np.empty(0, np.int64), *(n.ravel() for n in nodes)]), "connectivity")
    sizes = np.repeat([n.shape[1] for n in nodes], [len(n) for n in nodes])
    array(np.cumsum(sizes, dtype=np.int64), "offsets")
    array(np.repeat(np.array([t for t, _ in cells], np.uint8), [len(n) for n in nodes]), "types")
    body.write('</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding="raw">\n_')
    return body.getvalue().encode() + blocks.getvalue() + b"\n</AppendedData>\n</VTKFile>\n"
