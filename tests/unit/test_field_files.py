"""Values in space from files: each kind gives the same numbers, and says what is wrong."""

import base64
import struct
import zlib

import numpy as np
import pytest

from planner.errors import ArgumentError, FileError
from planner.formats.field_file import read_grid_table, read_point_table

SHAPE = (3, 4, 2)
VALUES = np.arange(24.0).reshape(SHAPE)
FIRST, STEP = (1.0, 2.0, 3.0), (0.5, 1.0, 2.0)
PLACES = np.stack(
    np.meshgrid(*(f + s * np.arange(n) for f, s, n in zip(FIRST, STEP, SHAPE, strict=True)),
                indexing="ij"),
    axis=-1,
).reshape(-1, 3)  # fmt: skip


def csv_of(points, values):
    rows = [f"{x},{y},{z},{v}" for (x, y, z), v in zip(points, values, strict=True)]
    return "\n".join(["x_mm,y_mm,z_mm,strain", *rows]) + "\n"


def array(values, form, name="strain", more="", kind="Float64"):
    """A DataArray, and what it appends: as VTK's file-format document has them."""
    data = np.ascontiguousarray(values, dtype={"Float64": "<f8", "Float32": "<f4"}[kind]).tobytes()
    tag = f'<DataArray type="{kind}" Name="{name}" {more} format='
    if form == "ascii":
        return tag + f'"ascii">{" ".join(map(repr, np.ravel(values).tolist()))}</DataArray>', b""
    if form == "zlib":
        packed = zlib.compress(data)
        head = struct.pack("<4I", 1, len(data), 0, len(packed))
        text = base64.b64encode(head) + base64.b64encode(packed)
        return tag + f'"binary">{text.decode()}</DataArray>', b""
    block = struct.pack("<I", len(data)) + data
    if form == "binary":
        return tag + f'"binary">\n  {base64.b64encode(block).decode()}\n</DataArray>', b""
    return tag + '"appended" offset="OFFSET"/>', block


def vtk(kind, body, appended, form):
    packer = ' compressor="vtkZLibDataCompressor"' if form == "zlib" else ""
    text = (
        f'<?xml version="1.0"?><VTKFile type="{kind}" version="0.1" byte_order="LittleEndian"'
        f"{packer}>{body}"
    )
    data = b"".join(appended)
    offset = 0
    for block in appended:
        if block:
            text = text.replace("OFFSET", str(offset), 1)
            offset += len(block)
    tail = b'<AppendedData encoding="raw">_' + data + b"</AppendedData>" if data else b""
    return text.encode() + tail + b"</VTKFile>"


def vti(form, cells=False):
    item, block = array(VALUES.transpose(2, 1, 0), form)
    group = "CellData" if cells else "PointData"
    ends = [n if cells else n - 1 for n in SHAPE]
    extent = f"0 {ends[0]} 0 {ends[1]} 0 {ends[2]}"
    shift = 0.5 if cells else 0.0
    origin = " ".join(str(f - shift * s) for f, s in zip(FIRST, STEP, strict=True))
    body = (
        f'<ImageData WholeExtent="{extent}" Origin="{origin}" Spacing="0.5 1 2">'
        f'<Piece Extent="{extent}"><{group}>{item}</{group}></Piece></ImageData>'
    )
    return vtk("ImageData", body, [block], form)


def vtu(form):
    item, block = array(VALUES.ravel(), form)
    place, more = array(PLACES, form, "Points", 'NumberOfComponents="3"', "Float32")
    body = (
        f"<UnstructuredGrid><Piece><PointData>{item}</PointData><Points>{place}</Points></Piece>"
        "</UnstructuredGrid>"
    )
    return vtk("UnstructuredGrid", body, [block, more], form)


FORMS = ["ascii", "binary", "zlib", "appended"]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("cells", [False, True])
def test_images(tmp_path, form, cells):
    (tmp_path / "a.vti").write_bytes(vti(form, cells))
    table = read_grid_table(tmp_path / "a.vti")
    assert table.first_mm == FIRST
    assert table.spacing_mm == STEP
    np.testing.assert_array_equal(table.values, VALUES)


@pytest.mark.parametrize("form", FORMS)
def test_unstructured_grids(tmp_path, form):
    (tmp_path / "a.vtu").write_bytes(vtu(form))
    table = read_point_table(tmp_path / "a.vtu")
    np.testing.assert_array_equal(table.points_mm, PLACES)  # halves are exact in float32
    np.testing.assert_array_equal(table.values, VALUES.ravel())


def test_csv_in_any_order_and_npy(tmp_path):
    order = np.random.default_rng(0).permutation(24)
    (tmp_path / "a.csv").write_text(csv_of(PLACES[order], VALUES.ravel()[order]))
    table = read_grid_table(tmp_path / "a.csv")
    assert table.first_mm == FIRST
    assert table.spacing_mm == STEP
    np.testing.assert_array_equal(table.values, VALUES)
    points = read_point_table(tmp_path / "a.csv")
    np.testing.assert_array_equal(points.values, VALUES.ravel()[order])
    np.save(tmp_path / "a.npy", VALUES.astype(np.float32))
    table = read_grid_table(tmp_path / "a.npy", first_mm=FIRST, spacing_mm=STEP)
    np.testing.assert_array_equal(table.values, VALUES)


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.csv", b"", "columns are none"),
        ("a.csv", b"x_mm,y_mm,value\n1,2,3\n", "needs x_mm, y_mm, z_mm"),
        ("a.csv", b"x_mm,y_mm,z_mm,a,b\n1,2,3,4,5\n", "array= may be a, b"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n1,2,3,four\n", "line 2"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n1,2,3,nan\n", "not a finite"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n", "holds no values"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n0,0,0,1\n1,0,0,1\n3,0,0,1\n", "no regular grid"),
        ("a.csv", b"\xff\xfe\x00", "no CSV in UTF-8"),
        ("a.txt", b"1", "a table is a"),
        ("a.npy", b"12", "no .npy of numbers"),
        ("a.vti", b"<VTKFile", "no XML"),
        ("a.vti", b"<VTKFile type='PolyData'/>", "PolyData file"),
        ("a.vti", b"<VTKFile type='ImageData'/>", "no ImageData"),
        ("a.vti", b"<!DOCTYPE x><VTKFile type='ImageData'/>", "entities"),
        ("a.vti", vti("ascii").replace(b"0 2 0 3 0 1", b"0 2 0 3 0 9"), "24 values"),
        ("a.vti", vti("ascii").replace(b'Name="strain"', b'Name="s" NumberOfComponents="3"'),
         "none of one number"),
        ("a.vti", vti("binary").replace(b"Float64", b"Float16"), "type Float16"),
        ("a.vti", vti("zlib").replace(b"vtkZLibData", b"vtkLZ4Data"), "only zlib"),
    ],
)  # fmt: skip
def test_files_that_hold_something_else(tmp_path, name, data, reason):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FileError, match=reason):
        read_grid_table(tmp_path / name, first_mm=FIRST, spacing_mm=STEP)


@pytest.mark.parametrize("form", FORMS)
def test_files_cut_short_or_altered_are_told(tmp_path, form):
    rng = np.random.default_rng(1)
    for data, name, read in (
        (vti(form), "a.vti", read_grid_table),
        (vtu(form), "a.vtu", read_point_table),
    ):
        for _ in range(60):
            bad = bytearray(data[: rng.integers(len(data))] if rng.random() < 0.5 else data)
            for place in rng.integers(0, max(len(bad), 1), 3):
                if len(bad):
                    bad[place] = rng.integers(256)
            (tmp_path / name).write_bytes(bytes(bad))
            try:
                table = read(tmp_path / name)
            except FileError:
                continue
            assert np.isfinite(table.values).all()


def test_what_a_npy_does_not_say(tmp_path):
    np.save(tmp_path / "a.npy", VALUES)
    with pytest.raises(ArgumentError, match="origin= and step="):
        read_grid_table(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", VALUES[0])
    with pytest.raises(FileError, match="three axes"):
        read_grid_table(tmp_path / "a.npy", first_mm=FIRST, spacing_mm=STEP)
    with pytest.raises(FileError, match="cannot be read"):
        read_point_table(tmp_path / "none.csv")
