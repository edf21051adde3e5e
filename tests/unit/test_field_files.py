"""Values in space from files: each kind gives the same numbers, and says what is wrong."""

import base64
import pickle
import re
import struct
import tracemalloc
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
        f'<UnstructuredGrid><Piece NumberOfPoints="{len(PLACES)}">'
        f"<PointData>{item}</PointData><Points>{place}</Points></Piece>"
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
    points, values, _ = read_point_table(tmp_path / "a.vtu")
    np.testing.assert_array_equal(points, PLACES)  # halves are exact in float32
    np.testing.assert_array_equal(values, VALUES.ravel())


def test_csv_in_any_order_and_npy(tmp_path):
    order = np.random.default_rng(0).permutation(24)
    (tmp_path / "a.csv").write_text(csv_of(PLACES[order], VALUES.ravel()[order]))
    table = read_grid_table(tmp_path / "a.csv")
    assert table.first_mm == FIRST
    assert table.spacing_mm == STEP
    np.testing.assert_array_equal(table.values, VALUES)
    _, values, _ = read_point_table(tmp_path / "a.csv")
    np.testing.assert_array_equal(values, VALUES.ravel()[order])
    np.save(tmp_path / "a.npy", VALUES.astype(np.float32))
    table = read_grid_table(tmp_path / "a.npy", lies=(FIRST, STEP))
    np.testing.assert_array_equal(table.values, VALUES)


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.csv", b"", "the file is empty"),
        ("a.csv", b"x_mm,y_mm,value\n1,2,3\n", "needs x_mm, y_mm, z_mm"),
        ("a.csv", b"x_mm,y_mm,z_mm,a,b\n1,2,3,4,5\n", "array= may be a, b"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n1,2,3,four\n", "line 2"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n1,2,3,nan\n", "'nan' is no finite number"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n", "no numbers below"),
        ("a.csv", b"x_mm,y_mm,z_mm,a\n0,0,0,1\n1,0,0,1\n3,0,0,1\n", "no regular grid"),
        ("a.csv", b"\xff\xfe\x00", "needs x_mm, y_mm, z_mm"),
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
        read_grid_table(tmp_path / name, lies=(FIRST, STEP))


@pytest.mark.parametrize("form", FORMS)
def test_files_cut_short_or_altered_are_told(tmp_path, form):
    rng = np.random.default_rng(1)
    for data, name, read in (
        (vti(form), "a.vti", lambda path: read_grid_table(path).values),
        (vtu(form), "a.vtu", lambda path: read_point_table(path)[1]),
    ):
        for _ in range(60):
            bad = bytearray(data[: rng.integers(len(data))] if rng.random() < 0.5 else data)
            for place in rng.integers(0, max(len(bad), 1), 3):
                if len(bad):
                    bad[place] = rng.integers(256)
            (tmp_path / name).write_bytes(bytes(bad))
            try:
                values = read(tmp_path / name)
            except FileError:
                continue
            assert np.isfinite(values).all()


def test_what_a_npy_does_not_say(tmp_path):
    np.save(tmp_path / "a.npy", VALUES)
    with pytest.raises(ArgumentError, match="origin= and step="):
        read_grid_table(tmp_path / "a.npy")
    with pytest.raises(ArgumentError, match="give origin= and step=, and no array="):
        read_grid_table(tmp_path / "a.npy", lies=(FIRST, STEP), array="a")
    np.save(tmp_path / "a.npy", VALUES[0])
    with pytest.raises(FileError, match="three axes"):
        read_grid_table(tmp_path / "a.npy", lies=(FIRST, STEP))
    with pytest.raises(FileError, match="cannot be read"):
        read_point_table(tmp_path / "none.csv")


# ------------------------------------------------------------------------------------------------
# Files made to exhaust memory, time or the reader's own recursion.


def npy(head, data=b""):
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + data


def head(descr="'<f8'", shape="(3, 4, 2)"):
    return f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()


class Explodes:
    def __reduce__(self):
        return (pytest.fail, ("unpickled",))


def refused(folder, name, data, reason, most_bytes=3_000_000):
    """Read what is to be refused, and hold that it takes no memory and tells no warning."""
    (folder / name).write_bytes(data)
    read = read_point_table if name.endswith("vtu") else read_grid_table
    given = {"lies": (FIRST, STEP)} if name.endswith("npy") else {}
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match=reason):
            read(folder / name, **given)
        assert tracemalloc.get_traced_memory()[1] < most_bytes + 4 * len(data)
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (
            npy(head(shape="(100000, 100000, 100000)"), bytes(192)),
            "or cut short .*too small",
        ),
        (npy(head(shape=f"({10**18}, {10**18}, {10**18})"), bytes(192)), "cut short"),
        (npy(head(), bytes(191)), "or cut short .*too small"),
        (npy(head(shape="(-3, 4, 2)"), bytes(192)), "negative dimensions"),
        (npy(head(shape="(" * 60_000), bytes(192)), "no .npy of numbers"),
        (npy(b"{'descr': " + b"[" * 60_000), "no .npy of numbers"),
        (npy(head(descr="'|O'"), pickle.dumps(Explodes())), "type object; it needs real numbers"),
        (pickle.dumps(Explodes()), "no .npy of numbers"),
        (npy(head(descr="'<c16'"), bytes(384)), "type complex128; it needs real numbers"),
        (npy(head(descr="[('a', '<f4'), ('b', '<f4')]"), bytes(192)), "type .*it needs real"),
        (npy(head(descr="'<M8[s]'"), bytes(192)), r"type datetime64\[s\]"),
        (npy(head(descr="'<U2'"), bytes(192)), "type <U2"),
        (npy(head(descr="'<f3'"), bytes(192)), "no .npy of numbers"),
        (npy(head(), np.full(24, np.inf).tobytes()), "not a finite number; fill the gaps$"),
        (npy(head(shape="(0, 4, 2)")), "holds no values"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff" + head(), "no .npy of numbers"),
    ],
)
def test_npy_is_judged_by_its_head(tmp_path, data, reason):
    refused(tmp_path, "a.npy", data, reason)


@pytest.mark.parametrize("order", "CF")
@pytest.mark.parametrize("kind", ["<f8", ">f4", "<i2", "|u1", ">i8", "|b1", "<f2"])
def test_npy_of_any_real_type_and_order_is_read(tmp_path, kind, order):
    values = np.array(VALUES, dtype=kind, order=order)
    np.save(tmp_path / "a.npy", values)
    table = read_grid_table(tmp_path / "a.npy", lies=(FIRST, STEP))
    np.testing.assert_array_equal(table.values, values.astype(float))


EXTENT = b"0 2 0 3 0 1"


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (b'Spacing="0.5', b'Spacing="nan', "not finite"),
        (b'Spacing="0.5', b'Spacing="inf', "not finite"),
        (b'Origin="1.0', b'Origin="1e999', "not finite"),
        (b'Spacing="0.5', b'Spacing="1e308', None),
        (EXTENT, b"0 2 0 3 0 inf", "no list of numbers"),
        (EXTENT, b"0 999999999 0 999999999 0 999999999", "values|bytes"),
        (EXTENT, b"%d 2 0 3 0 1" % -(10**400), "not finite"),
        (EXTENT, b"%d %d 0 3 0 1" % (10**400, 10**400 + 2), "not finite"),
        (EXTENT, b"0 2 0 3 0 0", "values|bytes"),
        (EXTENT, b"0 2 0 3 0 1 5", "another length"),
    ],
)
def test_images_that_lie_nowhere_are_refused(tmp_path, form, old, new, reason):
    data = vti(form).replace(old, new)
    if reason is None:  # far away, but somewhere
        (tmp_path / "a.vti").write_bytes(data)
        assert read_grid_table(tmp_path / "a.vti").spacing_mm[0] == 1e308
    else:
        refused(tmp_path, "a.vti", data, reason)


def packed_vti(*blocks, count=None, usual=192, last=0):
    """An image whose packed array has a header of one's own."""
    lengths = [len(block) for block in blocks]
    start = struct.pack(f"<{3 + len(blocks)}I", len(blocks) if count is None else count, usual,
                        last, *lengths)  # fmt: skip
    text = base64.b64encode(start) + base64.b64encode(b"".join(blocks))
    return re.sub(rb'"binary">[^<]*', b'"binary">' + text, vti("zlib"))


BOMB = zlib.compress(bytes(10_000_000))
RIGHT = zlib.compress(np.ascontiguousarray(VALUES.transpose(2, 1, 0)).tobytes())


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (packed_vti(BOMB), "unpacks to another length"),
        (packed_vti(BOMB, usual=10_000_000), "10000000 bytes where 192 are needed"),
        (packed_vti(*100 * [BOMB], usual=2, last=4), "202 bytes where 192"),
        (packed_vti(RIGHT, RIGHT), "384 bytes where 192 are needed"),
        (packed_vti(RIGHT, count=0xFFFFFFFF), "4294967295 packed blocks in"),
        (packed_vti(RIGHT, count=0), "0 bytes where 192 are needed"),
        (packed_vti(b"", usual=192), "another length|incomplete"),
        (packed_vti(b"\xff" * 20), "cannot be decoded"),
    ],
)
def test_packed_blocks_are_unpacked_no_further_than_the_grid(tmp_path, data, reason):
    refused(tmp_path, "a.vti", data, reason)


def test_a_packed_image_of_zeros_larger_than_its_file_by_far_is_refused(tmp_path):
    """600 MB of zeros pack into 0.6 MB: the grid is as large, and is refused for that."""
    n = 599
    data = packed_vti(zlib.compress(bytes(1000)), usual=8 * (n + 1) ** 3 // 2, count=2)
    data = data.replace(EXTENT, b"0 %d 0 %d 0 %d" % (n, n, n))
    refused(tmp_path, "a.vti", data, "unpack to|blocks in|decoded")


def test_blocks_of_several_sizes_are_read(tmp_path):
    whole = np.ascontiguousarray(VALUES.transpose(2, 1, 0)).tobytes()
    for size, last in ((80, 32), (96, 0), (96, 96), (192, 0)):
        blocks = [zlib.compress(whole[at : at + size]) for at in range(0, 192, size)]
        (tmp_path / "a.vti").write_bytes(packed_vti(*blocks, usual=size, last=last))
        np.testing.assert_array_equal(read_grid_table(tmp_path / "a.vti").values, VALUES)


def test_an_array_that_a_file_lacks_is_named(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"x_mm,y_mm,z_mm,a,b\n1,2,3,4,5\n")
    with pytest.raises(FileError, match="it needs x_mm, y_mm, z_mm and q; array= may be a, b"):
        read_point_table(tmp_path / "a.csv", array="q")


def test_a_grid_without_pieces_is_told(tmp_path):
    (tmp_path / "a.vtu").write_bytes(
        b"<VTKFile type='UnstructuredGrid'><UnstructuredGrid/></VTKFile>"
    )
    with pytest.raises(FileError, match="has no Piece"):
        read_point_table(tmp_path / "a.vtu")


@pytest.mark.slow
def test_pieces_that_share_one_array_are_counted_together(tmp_path):
    once = vtu("zlib")
    piece = re.search(rb"<Piece.*</Piece>", once, re.DOTALL)[0]
    many = once.replace(piece, 300_000 * b'<Piece NumberOfPoints="999999"/>' + piece)
    refused(tmp_path, "a.vtu", many, "without Points", 1e9)
    data = once.replace(b'NumberOfPoints="24"', b'NumberOfPoints="999999999"')
    refused(tmp_path, "a.vtu", data, "unpack to")
    refused(tmp_path, "a.vtu", once.replace(b'="24"', b'="-24"'), "without NumberOfPoints")
    refused(tmp_path, "a.vtu", once.replace(b'="24"', b'="23"'), "where 276 are needed")


def test_xml_of_another_encoding_hides_no_entities(tmp_path):
    text = '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE x [<!ENTITY a "b">]><VTKFile/>'
    refused(tmp_path, "a.vti", text.encode("utf-16"), "UTF-8")


def test_a_csv_of_extreme_places_is_refused_without_a_warning(tmp_path):
    points = np.array([[-1.5e308, 0, 0], [1.5e308, 0, 0], [0.0, 0, 0]])
    refused(tmp_path, "a.csv", csv_of(points, np.arange(3.0)).encode(), r"'-1.5e\+308' is beyond")
