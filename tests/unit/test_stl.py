"""Binary and ASCII STL: what is read, what is refused, and the bytes that are written."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from planner.errors import MeshError, OutputError
from planner.formats.mesh_file import decode_stl, encode_stl

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
BINARY = encode_stl(CORNERS, FACES, "tetrahedron unit=mm")

FACET = "facet normal 0 0 1\n outer loop\n{}\n endloop\nendfacet\n"


def ascii_stl(triangles, name="part"):
    facets = (
        FACET.format("\n".join("  vertex {:.9g} {:.9g} {:.9g}".format(*p) for p in t))
        for t in triangles
    )
    return (f"solid {name}\n" + "".join(facets) + f"endsolid {name}\n").encode()


def test_binary_layout():
    assert len(BINARY) == 84 + 50 * 4
    assert BINARY[:80] == b"tetrahedron unit=mm".ljust(80)
    assert struct.unpack_from("<I", BINARY, 80) == (4,)
    normal, attribute = struct.unpack_from("<3f", BINARY, 84), struct.unpack_from("<H", BINARY, 132)
    assert normal == (0.0, 0.0, -1.0)  # the face in the plane z = 0 looks down
    assert attribute == (0,)
    floats = np.frombuffer(BINARY, "12<f4,<u2", offset=84)["f0"]
    assert not np.signbit(floats[floats == 0]).any()  # no minus zero


def test_normals_are_unit_vectors_to_the_right():
    records = np.frombuffer(BINARY, "<f4,<f4,<f4,(3,3)<f4,<u2", offset=84)
    normals = np.stack([records[f"f{k}"] for k in range(3)], axis=1)
    centre = CORNERS.mean(axis=0)
    outward = records["f3"].mean(axis=1) - centre
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=0, atol=2e-7)  # float32
    assert (np.einsum("ij,ij->i", normals, outward) > 0).all()


def test_triangle_without_area_has_zero_normal():
    data = encode_stl(CORNERS[[0, 0, 1]], np.array([[0, 1, 2]]), "flat")
    assert struct.unpack_from("<3f", data, 84) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("header", ["solid part", "  SOLID", "Solidworks bracket"])
def test_header_never_begins_with_solid(header):
    data = encode_stl(CORNERS, FACES, header)
    assert not data[:80].lstrip().lower().startswith(b"solid")
    assert len(data) == len(BINARY)


def test_long_and_foreign_headers_fit():
    data = encode_stl(CORNERS, FACES, "é" * 200)
    assert data[:80] == b"?" * 80


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    arrays.arrays(
        np.float32,
        st.tuples(st.integers(1, 40), st.just(3), st.just(3)),
        elements=st.floats(-1e6, 1e6, width=32),
    )
)
def test_binary_and_ascii_round_trip(triangles):
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    binary = decode_stl(encode_stl(triangles.reshape(-1, 3), faces, "x"), "x")
    assert binary.dtype == np.float32
    assert np.array_equal(binary, triangles)
    # 9 digits name a float32 uniquely
    assert np.array_equal(decode_stl(ascii_stl(triangles), "x").astype(np.float32), triangles)


def test_many_blocks_are_like_one():
    rng = np.random.default_rng(1)
    vertices = rng.uniform(1, 100, (500, 3)).astype(np.float32)
    faces = rng.integers(0, 500, (40_000, 3))
    whole = encode_stl(vertices, faces, "x")
    parts = [encode_stl(vertices, faces[k : k + 999], "x")[84:] for k in range(0, 40_000, 999)]
    assert whole[84:] == b"".join(parts)


def test_binary_that_begins_with_solid():
    data = b"solid made by a CAD program".ljust(80) + BINARY[80:]
    assert np.array_equal(decode_stl(data, "x"), CORNERS[FACES])


@pytest.mark.parametrize(
    "change",
    [
        bytes,
        bytes.upper,
        lambda text: b"\xef\xbb\xbf" + text,
        lambda text: text.replace(b"\n", b"\r\n"),
        lambda text: text.replace(b" ", b"\t  "),
        lambda text: b"\n\n" + text + b"\n \n",
        lambda text: b" ".join(text.split()),
        lambda text: text.replace(b"facet normal 0 0 1", b"facet normal nan -nan(ind) 1.#QNAN"),
        lambda text: text.replace(b"solid part", b"solid facet of a part, 1 2 3"),
        lambda text: text.replace(b"solid part", b"solid"),
    ],
)
def test_ascii_as_programs_write_it(change):
    data = change(ascii_stl(CORNERS[FACES]))
    assert np.array_equal(decode_stl(data, "x"), CORNERS[FACES])


def test_ascii_with_several_solids():
    data = ascii_stl(CORNERS[FACES], "a") + ascii_stl(CORNERS[FACES] + 5, "b")
    assert np.array_equal(decode_stl(data, "x")[4:], CORNERS[FACES] + 5)
    one_line = b" ".join(data.split())
    assert np.array_equal(decode_stl(one_line, "x"), decode_stl(data, "x"))


def test_what_is_not_written():
    with pytest.raises(OutputError, match=r"vertex 2 is .*nan"):
        encode_stl(np.where(CORNERS == 1, np.nan, CORNERS), FACES, "x")


GOOD = ascii_stl(CORNERS[FACES])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty"),
        (b" \n ", "empty"),
        (b"solid Empty\nendsolid Empty", "no triangles"),
        (bytes(84), "no triangles"),
        (BINARY[:150], r"4 triangles has 284 bytes, got 150 \(1 triangles\): it is cut short"),
        (BINARY + b"\0", "4 triangles has 284 bytes, got 285"),
        (BINARY[:40] + b"\0", "begins with 84 bytes, got 41"),
        (b"solid x".ljust(80) + BINARY[80:150], "got 150"),
        (b"hello\nworld\n", "line 1: expected 'solid', got 'hello'"),
        (GOOD.replace(b"vertex 0 0 1", b"vertex 0 0 one", 1), "line 13: expected a number, "),
        (GOOD.replace(b"vertex 0 0 1", b"vertex 0 0,5 1", 1), "'0,5'"),
        (GOOD.replace(b"endloop", b"vertex 1 1 1\nendloop", 1), "expected 'endloop'"),
        (GOOD[:200], "line 16: the file ends where .*cut short"),
        (GOOD[: GOOD.rindex(b"endsolid")], "the file ends"),
        (GOOD.replace(b"vertex 1 0 0", b"vertex nan 0 0", 1), "triangle 1 of 4 .* nan"),
        (GOOD.replace(b"vertex 1 0 0", b"vertex 1e999 0 0", 1), "triangle 1 of 4 .* inf"),
        (
            BINARY[:146] + struct.pack("<2f", np.inf, np.nan) + BINARY[154:],
            "triangle 2 of 4 .* inf; 1 triangles",
        ),
    ],
)
def test_what_is_refused(data, message):
    with pytest.raises(MeshError, match=message) as caught:
        decode_stl(data, "part.stl")
    assert str(caught.value).startswith("part.stl: ")


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.data())
def test_damaged_files_raise_nothing_else(data):
    source = bytearray(data.draw(st.sampled_from([BINARY, GOOD])))
    for _ in range(data.draw(st.integers(1, 4))):
        source[data.draw(st.integers(0, len(source) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(source)))
    for damaged in (bytes(source), bytes(source[:cut])):
        try:
            triangles = decode_stl(damaged, "x")
        except MeshError:
            continue
        assert np.isfinite(triangles).all()
        assert triangles.shape[1:] == (3, 3)
