"""3MF files that unfold to more than a machine holds are refused before anything is unfolded."""

import io
import re
import struct
import time
import zipfile

import numpy as np
import pytest

from planner.errors import FileError, MeshError
from planner.formats.files import UnfoldingLimits
from planner.formats.mesh_file import read_mesh
from planner.formats.threemf import ThreemfObject, decode_threemf, encode_threemf

CORNERS = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], dtype=np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)
MODEL = "3D/3dmodel.model"


def archive(model: str, **others: bytes) -> bytes:
    """Return a 3MF file with planner's own frame around a model of one's own."""
    frame = encode_threemf([ThreemfObject("a", CORNERS, FACES, "m", "#000000")], "x")
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(frame)) as old, zipfile.ZipFile(out, "w", 8) as new:
        for name in ("[Content_Types].xml", "_rels/.rels"):
            new.writestr(name, old.read(name))
        new.writestr(MODEL, model)
        for name, content in others.items():
            new.writestr(name, content)
    return out.getvalue()


def mesh(number: int, faces: int = 4) -> str:
    corners = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CORNERS)
    turns = [f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in FACES]
    triangles = "".join(turns[k % 4] for k in range(faces))
    return (
        f'<object id="{number}" type="model"><mesh><vertices>{corners}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object>"
    )


def assembly(number: int, *parts: int, transform: str = "") -> str:
    inner = "".join(f'<component objectid="{part}"{transform}/>' for part in parts)
    return f'<object id="{number}" type="model"><components>{inner}</components></object>'


def model(objects: str, *items: int, transform: str = "") -> str:
    build = "".join(f'<item objectid="{item}"{transform}/>' for item in items)
    return (
        '<?xml version="1.0"?><model unit="millimeter" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f"<resources>{objects}</resources><build>{build}</build></model>"
    )


def doubling(levels: int) -> str:
    assemblies = "".join(assembly(k + 1, k, k) for k in range(1, levels + 1))
    return model(mesh(1) + assemblies, levels + 1)


def chain(levels: int, transform: str = "") -> str:
    assemblies = "".join(assembly(k + 1, k, transform=transform) for k in range(1, levels + 1))
    return model(mesh(1) + assemblies, levels + 1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            lambda: doubling(20),
            r"unfolds to 2,097,151 objects, .* more than the 10,000 that planner",
        ),
        (lambda: doubling(40), r"unfolds to 2,199,023,255,551 objects"),
        (lambda: doubling(4000), r"unfolds to over 10\^15 objects"),
        (lambda: chain(2_000), r"nests components 2,001 deep, more than the 1,000"),
        (lambda: chain(100_000), r"holds more than 10,000 objects"),
        (
            lambda: model(mesh(1, 5120), *9_999 * [1]),
            r"unfolds to 51,194,880 triangles, more than the 10,000,000 that",
        ),
        (lambda: model(mesh(1) + assembly(2, *20_000 * [1]), 2), r"unfolds to 20,001 objects"),
        # Nothing but assemblies of nothing, which a reader visits all the same.
        (
            lambda: doubling(40).replace(mesh(1), assembly(1)),
            r"unfolds to 2,199,023,255,551 objects",
        ),
    ],
)
def test_more_than_a_machine_holds_is_refused_at_once(text, said):
    data = archive(text())
    begin = time.process_time()
    with pytest.raises(MeshError, match=said):
        decode_threemf(data, "bomb.3mf")
    assert time.process_time() - begin < 1.0


def test_a_model_that_promises_nothing_is_no_way_around():
    """lib3mf unpacks what is there, whatever the archive's directory says of its size."""
    data = bytearray(archive(doubling(40)))
    entry = data.rindex(MODEL.encode()) - 46
    assert data[entry : entry + 4] == b"PK\x01\x02"
    data[entry + 24 : entry + 28] = bytes(4)
    begin = time.process_time()
    with pytest.raises(MeshError, match=r"not a zip archive that can be read .* CRC"):
        decode_threemf(bytes(data), "bomb.3mf")
    assert time.process_time() - begin < 1.0


def test_nested_components_are_read_without_recursion():
    moved = ' transform="1 0 0 0 1 0 0 0 1 1 0 0"'
    (item,) = decode_threemf(archive(chain(998, moved)), "x").objects
    assert item.vertices[:, 0].min() == 998.0


def test_copies_within_the_limits_are_read_each_in_its_place():
    parts = "".join(
        f'<component objectid="1" transform="1 0 0 0 1 0 0 0 1 {20 * k} 0 0"/>' for k in range(3000)
    )
    whole = f'<object id="2" type="model"><components>{parts}</components></object>'
    begin = time.process_time()
    objects = decode_threemf(archive(model(mesh(1) + whole, 2)), "x").objects
    assert [item.vertices[:, 0].min() for item in objects] == [20.0 * k for k in range(3000)]
    # 38 s for 10,000 where each copy's arrays were read anew.
    assert time.process_time() - begin < 5.0


def test_limits_are_the_callers(tmp_path):
    data = archive(doubling(3))
    assert len(decode_threemf(data, "x", limits=UnfoldingLimits(objects=15)).objects) == 8
    path = tmp_path / "x.3mf"
    path.write_bytes(data)
    assert len(read_mesh(path, limits=UnfoldingLimits(triangles=32)).triangles) == 32
    for limits, said in (
        (UnfoldingLimits(objects=14), "15 objects"),
        (UnfoldingLimits(depth=3), "4 deep"),
        (UnfoldingLimits(triangles=31), "32 triangles"),
        (UnfoldingLimits(unpacked_bytes=100), "bytes that unpack to"),
    ):
        with pytest.raises(MeshError, match=said):
            read_mesh(path, limits=limits)


def test_what_a_file_itself_holds_is_read_whatever_the_limit():
    limits = UnfoldingLimits(triangles=3)
    assert len(decode_threemf(archive(model(mesh(1), 1)), "x", limits=limits).objects) == 1
    with pytest.raises(MeshError, match="unfolds to 8 triangles"):
        decode_threemf(archive(model(mesh(1), 1, 1)), "x", limits=limits)


@pytest.mark.parametrize(
    "hide",
    [
        lambda text: text.replace("<", "<m:").replace("<m:/", "</m:").replace("<m:?", "<?")
        .replace("xmlns=", "xmlns:m="),
        lambda text: text.replace("<component ", "<component\n\tpartnumber='a>b \"' "),
        lambda text: text.replace("<resources>", '<resources><!-- > " <object id="9" -->'),
        lambda text: text.replace('objectid="', "objectid = ' ").replace('"/>', "'/>"),
    ],
)  # fmt: skip
def test_components_are_counted_however_they_are_written(hide):
    with pytest.raises(MeshError, match=r"unfolds to 32,767 objects"):
        decode_threemf(archive(hide(doubling(14))), "x")


def test_the_structure_of_a_large_file_is_seen():
    """Of 4 MB every object and triangle is counted."""
    text = model("".join(mesh(k, 5000) for k in range(1, 60)), *range(1, 60), 1)
    with pytest.raises(MeshError, match="unfolds to 300,000 triangles"):
        decode_threemf(archive(text), "x", limits=UnfoldingLimits(triangles=299_999))


def test_objects_that_refer_to_each_other_are_refused():
    text = model(mesh(1) + assembly(2, 3) + assembly(3, 2, 1), 2)
    with pytest.raises(MeshError, match="not a 3MF file that can be read"):
        decode_threemf(archive(text), "x")


@pytest.mark.parametrize("figure", ["nan", "1e39", "-1e39"])
def test_a_transform_that_is_not_finite_is_an_error_without_a_warning(figure):
    placed = f' transform="{figure} 0 0 0 1 0 0 0 1 0 0 0"'
    for text in (model(mesh(1), 1, transform=placed), chain(1, placed)):
        with pytest.raises(MeshError, match="transform that is not finite or too large"):
            decode_threemf(archive(text), "x")


def test_transforms_that_overflow_together_are_an_error_without_a_warning():
    text = chain(12, ' transform="1e38 0 0 0 1e38 0 0 0 1e38 0 0 0"')
    with pytest.raises(MeshError, match="too large"):
        decode_threemf(archive(text), "x")


def promising(data: bytes, size: int) -> bytes:
    """Return a 3MF whose directory promises another size of the model."""
    found = [at.start() for at in re.finditer(b"PK\x01\x02", data)]
    changed = bytearray(data)
    struct.pack_into("<I", changed, found[2] + 24, size)
    return bytes(changed)


def test_archives_that_unpack_to_too_much_are_refused_at_once():
    plain = archive(model(mesh(1), 1))
    bomb = archive(model(mesh(1), 1) + 120_000_000 * " ")
    begin = time.process_time()
    for data, said in (
        (bomb, r"unpack to 120,00.* at most 100,000,000 are read"),
        (promising(bomb, 500), r"not a zip archive that can be read \(Bad CRC"),
        (promising(plain, 2**32 - 2), r"unpack to 4,294,9"),
        (promising(plain, 5000), r"3dmodel.model is cut short"),
    ):
        with pytest.raises(MeshError, match=said):
            decode_threemf(data, "x")
    assert time.process_time() - begin < 1.0


def test_what_is_no_archive_is_refused():
    for data in (b"", b"PK", archive(model(mesh(1), 1))[:-30]):
        with pytest.raises(FileError, match="not a zip archive"):
            decode_threemf(data, "x")
