"""VTU files: read back by planner's own reader, and refused where values do not fit."""

from xml.etree import ElementTree

import numpy as np

from planner.formats.field_file import encode_vtu, read_point_table

POINTS = np.array([[i, j, k] for k in (0, 1) for j, i in ((0, 0), (0, 1), (1, 1), (1, 0))], float)
CELLS = (np.arange(8)[None], np.array([[0, 1, 2], [4, 5, 6]]))


def head(data: bytes) -> ElementTree.Element:
    return ElementTree.fromstring(data[: data.index(b"<AppendedData")] + b"</VTKFile>")


def test_points_and_values_read_back(tmp_path):
    values = np.linspace(0.25, 2.0, 8)
    data = encode_vtu(
        POINTS, CELLS, point_data={"modulus & more": values},
        cell_data={"material": np.array([3, 1, 2], np.int32)},
    )  # fmt: skip
    file = tmp_path / "a.vtu"
    file.write_bytes(data)
    points, found, _ = read_point_table(file, array="modulus & more")
    np.testing.assert_array_equal(points, POINTS)
    np.testing.assert_array_equal(found, values)
    assert data == encode_vtu(
        POINTS, CELLS, point_data={"modulus & more": values},
        cell_data={"material": np.array([3, 1, 2], np.int32)},
    )  # fmt: skip


def test_cells_of_two_kinds_follow_each_other():
    data = encode_vtu(POINTS, CELLS)
    arrays = {a.get("Name"): a for a in head(data).iter("DataArray")}
    start = data.index(b"_", data.index(b"<AppendedData")) + 1
    found = {}
    for name, kind in (("connectivity", "<i8"), ("offsets", "<i8"), ("types", "u1")):
        at = start + int(arrays[name].get("offset"))
        size = int.from_bytes(data[at : at + 8], "little")
        found[name] = np.frombuffer(data[at + 8 : at + 8 + size], kind).tolist()
    assert found["connectivity"] == [*range(8), 0, 1, 2, 4, 5, 6]
    assert found["offsets"] == [8, 11, 14]
    assert found["types"] == [12, 5, 5]
