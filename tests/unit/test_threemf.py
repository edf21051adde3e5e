"""3MF: content, determinism, archive layout, and what is read back."""

import io
import re
import zipfile
from xml.etree import ElementTree

import lib3mf
import numpy as np
import pytest

from planner.errors import FileError, MeshError, OutputError
from planner.formats.threemf import (
    ThreemfObject,
    decode_threemf,
    encode_threemf,
    read_threemf,
)
from planner.testing import threemf_xml_hashes

VERTICES = np.array([[1, 1, 1], [11.1, 1, 1], [1, 11.3, 1], [1, 1, 11.7]], dtype=np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)


def tetrahedron(name="a", material="FLX9760", colour="#FF8000", shift=0.0, **metadata):
    moved = VERTICES + np.float32(shift)
    return ThreemfObject(name, moved, FACES, material, colour, metadata)


PAIR = [
    tetrahedron("soft", "TangoPlus", "#102030", coordinate="0"),
    tetrahedron("hard", "Vero", "#FFEEDD", 20.0, coordinate="1.5", note='<&> "é"'),
]


PARTS = [
    "[Content_Types].xml",
    "_rels/.rels",
    "3D/3dmodel.model",
    "3D/_rels/3dmodel.model.rels",
    "Metadata/model_settings.config",
]


def model_xml(data, tmp_path):
    (tmp_path / "x.3mf").write_bytes(data)
    with zipfile.ZipFile(tmp_path / "x.3mf") as archive:
        return archive.read("3D/3dmodel.model").decode()


def metadata(data, tmp_path):
    """What is said of the model, then of each object, by name without its namespace."""
    core = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    root = ElementTree.fromstring(model_xml(data, tmp_path))
    return [
        {each.get("name").rpartition(":")[2]: each.text for each in of.findall(f"{core}metadata")}
        for of in (root, *root.iter(f"{core}metadatagroup"))
    ]


def test_strict_reader_finds_what_was_written(follows_to_the_letter, tmp_path):
    data = encode_threemf(PAIR, "finger")
    assert follows_to_the_letter(data)
    model = decode_threemf(data, "x")
    assert model.remarks == ()
    assert model.unit == "mm"
    heading, *of_objects = metadata(data, tmp_path)
    assert heading == {"Title": "finger", "Application": "planner"}
    numbers = ({"extruder_nr": "0"}, {"extruder_nr": "1"})
    assert of_objects == [
        {**item.metadata, **number} for item, number in zip(PAIR, numbers, strict=True)
    ]
    for read, written in zip(model.objects, PAIR, strict=True):
        assert (read.name, read.material_name, read.colour) == (
            written.name,
            written.material_name,
            written.colour,
        )
        assert np.array_equal(read.faces, written.faces)
        assert np.array_equal(read.vertices, written.vertices)


def written_figures(vertices):
    mesh = ThreemfObject("x", vertices, np.array([[0, 1, 2]]), "m", "#000000")
    with zipfile.ZipFile(io.BytesIO(encode_threemf([mesh], "x"))) as archive:
        text = archive.read("3D/3dmodel.model").decode()
    return re.findall(r' [xyz]="([^"]*)"', text)


@pytest.mark.parametrize("span", [(1.0, 500.0), (1e-5, 1e9), (1e-44, 3e38)])
def test_text_is_read_back_to_the_same_float32(span):
    rng = np.random.default_rng(7)
    vertices = np.exp(rng.uniform(*np.log(span), (30_000, 3))) * rng.choice([-1, 1], (30_000, 3))
    figures = written_figures(vertices.astype(np.float32))
    assert np.array_equal(np.array(figures, np.float32), vertices.astype(np.float32).ravel())
    digits = [len(figure.partition("e")[0].strip("-0.").replace(".", "")) for figure in figures]
    assert max(digits) <= 9


def test_figures_are_short():
    vertices = np.array([[0.0, -0.0, 1.0], [0.1, -18.0, 11.7], [1e-5, 123456.0, 16777217.0]])
    figures = written_figures(vertices.astype(np.float32))
    assert figures == ["0", "0", "1", "0.1", "-18", "11.7", "0.00001", "123456", "16777216"]


def test_structure(tmp_path):
    third = tetrahedron("third", "Vero", "#FFEEDD", 40.0)
    xml = model_xml(encode_threemf([*PAIR, third], "finger"), tmp_path)
    assert len(re.findall("<mesh>", xml)) == 3
    assert len(re.findall("<component ", xml)) == 3
    assert len(re.findall("<item ", xml)) == 1
    assert re.findall('<base name="([^"]*)" displaycolor="([^"]*)"', xml) == [
        ("TangoPlus", "#102030FF"),
        ("Vero", "#FFEEDDFF"),
    ]
    assert '"urn:planner:mixture:1"' in xml
    identifiers = re.findall('UUID="([^"]*)"', xml)
    assert len(set(identifiers)) == len(identifiers) == 3 + 3 + 1 + 1 + 1


def test_same_content_same_bytes():
    assert encode_threemf(PAIR, "finger") == encode_threemf(PAIR, "finger")


@pytest.mark.parametrize(
    "other",
    [
        [PAIR[1], PAIR[0]],
        [PAIR[0], tetrahedron("hard", "Vero", "#FFEEDD", 20.5)],
        [PAIR[0], tetrahedron("hard", "Vero", "#FFEEDC", 20.0)],
    ],
)
def test_other_content_other_identifiers(other, tmp_path):
    def build(objects):
        return re.search('<build p:UUID="(.*?)"', model_xml(encode_threemf(objects, "f"), tmp_path))

    assert build(PAIR)[1] != build(other)[1]


def test_archive_is_plain(tmp_path):
    data = encode_threemf(PAIR, "finger")
    (tmp_path / "x.3mf").write_bytes(data)
    assert b"PK\x06\x06" not in data  # no zip64
    with zipfile.ZipFile(tmp_path / "x.3mf") as archive:
        assert archive.testzip() is None
        assert archive.namelist() == PARTS
        for member in archive.infolist():
            assert member.date_time == (1980, 1, 1, 0, 0, 0)
            assert member.external_attr == 0o100644 << 16
            assert (member.create_system, member.extract_version, member.extra) == (3, 20, b"")
            assert member.compress_type == zipfile.ZIP_DEFLATED


def test_archives_that_take_zip64_are_refused(monkeypatch):
    size = len(encode_threemf(PAIR, "finger"))
    for most in (400, size - 1000):  # less than a member has, and than all have
        monkeypatch.setattr(zipfile, "ZIP64_LIMIT", most)
        with pytest.raises(OutputError, match=r"^3MF: takes more than 2 GiB .*reduce the number"):
            encode_threemf(PAIR, "finger")


def test_hashes_name_every_part(tmp_path):
    (tmp_path / "a.3mf").write_bytes(encode_threemf(PAIR, "finger"))
    (tmp_path / "b.3mf").write_bytes(encode_threemf(PAIR, "thumb"))
    a, b = threemf_xml_hashes(tmp_path / "a.3mf"), threemf_xml_hashes(tmp_path / "b.3mf")
    assert list(a) == PARTS
    assert [name for name in a if a[name] != b[name]] == [PARTS[2], PARTS[4]]
    with pytest.raises(FileError):
        threemf_xml_hashes(tmp_path / "none.3mf")


def test_names_that_xml_cannot_hold_as_they_are(follows_to_the_letter, tmp_path):
    item = tetrahedron("a<&>\x07", 'Vero "white"', "#000000", note="line\nbreak\x00")
    data = encode_threemf([item], "part <1> & co")
    assert follows_to_the_letter(data)
    model = decode_threemf(data, "x")
    assert model.remarks == ()
    heading, of_object = metadata(data, tmp_path)
    assert heading["Title"] == "part <1> & co"
    read = model.objects[0]
    assert (read.name, read.material_name) == ("a<&>?", 'Vero "white"')
    assert of_object["note"] == "line\nbreak?"


def test_names_that_utf8_cannot_hold(follows_to_the_letter, tmp_path):
    """Python reads a file name's byte FF, which is not UTF-8, as half of a surrogate pair."""
    odd = "\udcffpart\ufffe"
    shell = tetrahedron(odd, odd, note=odd)
    data = encode_threemf([shell], odd)
    assert follows_to_the_letter(data)
    model = decode_threemf(data, "x")
    assert {model.objects[0].name, model.objects[0].material_name} == {"?part?"}
    heading, of_object = metadata(data, tmp_path)
    assert (heading["Title"], of_object["note"]) == ("?part?", "?part?")


@pytest.mark.parametrize(
    ("objects", "message"),
    [
        ([], "no objects"),
        ([tetrahedron(colour="orange")], "#RRGGBB"),
        ([tetrahedron(**{"two words": "x"})], "'two words'"),
        ([ThreemfObject("a", VERTICES * np.float32(np.nan), FACES, "m", "#000000")], "not finite"),
        ([ThreemfObject("a", VERTICES, FACES[:0], "m", "#000000")], "no triangles"),
        ([ThreemfObject("a", VERTICES, FACES[:, [0, 0, 1]], "m", "#000000")], "3MF of finger"),
        ([ThreemfObject("a", VERTICES, FACES + 9, "m", "#000000")], "3MF of finger"),
    ],
)
def test_what_cannot_be_written(objects, message):
    with pytest.raises(OutputError, match=message):
        encode_threemf(objects, "finger")


@pytest.mark.parametrize("cut", [0, 10, 300, 700])
def test_damaged_file(cut, tmp_path):
    (tmp_path / "x.3mf").write_bytes(encode_threemf(PAIR, "finger")[:cut])
    with pytest.raises(MeshError, match="not a 3MF file"):
        read_threemf(tmp_path / "x.3mf")


def written_by_lib3mf(build, tmp_path):
    """Let `build(wrapper, model, mesh)` place a mesh; return the file's bytes."""
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    mesh = model.AddMeshObject()
    mesh.SetName("tetrahedron")
    mesh.SetGeometry(
        [lib3mf.Position(tuple(map(float, p))) for p in VERTICES],
        [lib3mf.Triangle(tuple(map(int, f))) for f in FACES],
    )
    build(wrapper, model, mesh)
    model.QueryWriter("3mf").WriteToFile(str(tmp_path / "x.3mf"))
    return (tmp_path / "x.3mf").read_bytes()


def transform(wrapper, rows):
    matrix = wrapper.GetIdentityTransform()
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            matrix.Fields[i][j] = value
    return matrix


def test_transforms_nest(tmp_path):
    """A quarter turn about z, then doubled and moved: (x, y, z) to (9 - 2y, 2x, 2z)."""

    def build(wrapper, model, mesh):
        inner = model.AddComponentsObject()
        inner.AddComponent(mesh, transform(wrapper, [(0, 1, 0), (-1, 0, 0), (0, 0, 1), (0, 0, 0)]))
        inner.AddComponent(mesh, wrapper.GetIdentityTransform())
        model.AddBuildItem(inner, transform(wrapper, [(2, 0, 0), (0, 2, 0), (0, 0, 2), (9, 0, 0)]))

    turned, straight = decode_threemf(written_by_lib3mf(build, tmp_path), "x").objects
    x, y, z = VERTICES.astype(np.float64).T
    # 1e-6: the file holds six decimals
    assert np.allclose(turned.vertices, np.stack([9 - 2 * y, 2 * x, 2 * z], axis=1), atol=4e-6)
    assert np.allclose(straight.vertices, 2 * VERTICES + [9, 0, 0], atol=4e-6)


def test_mirrored_object_keeps_its_outside(tmp_path):
    def build(wrapper, model, mesh):
        model.AddBuildItem(mesh, transform(wrapper, [(-1, 0, 0), (0, 1, 0), (0, 0, 1), (50, 0, 0)]))

    item = decode_threemf(written_by_lib3mf(build, tmp_path), "x").objects[0]
    a, b, c = item.vertices[item.faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


def test_a_material_that_all_triangles_state_is_the_mesh_s(tmp_path):
    """As some writers have it: on every triangle, whatever the object states."""

    def build(wrapper, model, mesh):
        group = model.AddBaseMaterialGroup()
        first = group.AddMaterial("A", wrapper.RGBAToColor(1, 2, 3, 255))
        second = group.AddMaterial("B", wrapper.RGBAToColor(4, 5, 6, 255))
        mesh.SetObjectLevelProperty(group.GetResourceID(), first)
        properties = lib3mf.TriangleProperties()
        properties.ResourceID = group.GetResourceID()
        properties.PropertyIDs[:] = [second] * 3
        for triangle in range(4):
            mesh.SetTriangleProperties(triangle, properties)
        model.AddBuildItem(mesh, wrapper.GetIdentityTransform())

    (found,) = decode_threemf(written_by_lib3mf(build, tmp_path), "x").objects
    assert found.material_name == "B"


def test_support_is_left_out_with_a_remark(tmp_path):
    def build(wrapper, model, mesh):
        mesh.SetType(lib3mf.ObjectType.Support)
        model.AddBuildItem(mesh, wrapper.GetIdentityTransform())

    model = decode_threemf(written_by_lib3mf(build, tmp_path), "x")
    assert model.objects == ()
    assert any("left out" in remark for remark in model.remarks)


def test_beam_lattice_is_refused(tmp_path):
    def build(wrapper, model, mesh):
        lattice = mesh.BeamLattice()
        lattice.SetMinLength(0.01)
        beam = lib3mf.Beam()
        beam.Indices[0], beam.Indices[1] = 0, 1
        beam.Radii[0] = beam.Radii[1] = 0.5
        lattice.AddBeam(beam)
        model.AddBuildItem(mesh, wrapper.GetIdentityTransform())

    with pytest.raises(MeshError, match=r"tetrahedron.* beam lattice"):
        decode_threemf(written_by_lib3mf(build, tmp_path), "x")


def test_exploding_components_are_refused(tmp_path):
    """Fourteen levels of twice the level below are 2^14 tetrahedra."""

    def build(wrapper, model, mesh):
        top = mesh
        for _ in range(14):
            level = model.AddComponentsObject()
            level.AddComponent(top, wrapper.GetIdentityTransform())
            level.AddComponent(top, wrapper.GetIdentityTransform())
            top = level
        model.AddBuildItem(top, wrapper.GetIdentityTransform())

    with pytest.raises(MeshError, match="more than"):
        decode_threemf(written_by_lib3mf(build, tmp_path), "x")
