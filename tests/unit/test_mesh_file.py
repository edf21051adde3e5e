"""Mesh files: every format gives the same part, units are honest, errors say what to do."""

import hashlib
import json
import math
import time
import warnings
import zipfile
from importlib.util import find_spec
from pathlib import Path

import lib3mf
import numpy as np
import pytest
import trimesh

from planner.errors import ArgumentError, FileError, MeshError
from planner.formats.files import UnfoldingLimits
from planner.formats.mesh_file import EXTENSIONS, encode_stl, read_mesh
from planner.formats.threemf import ThreemfObject, encode_threemf
from planner.formats.units import QUANTITY_UNITS
from planner.mesh.part import make_part


@pytest.fixture
def box():
    return trimesh.creation.box((2, 4, 6))


def corners(triangles):
    return np.unique(np.asarray(triangles).reshape(-1, 3).round(6), axis=0)


MESHES = [kind for kind in EXTENSIONS if kind not in ("step", "stp")]  # trimesh writes no STEP
STEP = Path(__file__).parents[1] / "data" / "two-cylinders-inch.step"


@pytest.mark.parametrize("kind", MESHES)
def test_each_format_gives_the_same_triangles(kind, box, tmp_path):
    path = tmp_path / f"part.{kind}"
    if kind == "3mf":
        faces = box.faces.astype(np.int32)
        item = ThreemfObject("x", box.vertices.astype(np.float32), faces, "m", "#000000")
        path.write_bytes(encode_threemf([item], "x"))
    else:
        box.export(path)
    mesh = read_mesh(path, "mm")
    assert mesh.triangles.dtype == np.float64
    assert mesh.triangles.shape == (12, 3, 3)
    assert np.array_equal(corners(mesh.triangles), corners(box.triangles))
    assert mesh.name == "part"
    assert mesh.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("name", ["part.STL", "my part.v2.stl"])
def test_names(name, box, tmp_path):
    (tmp_path / name).write_bytes(encode_stl(box.vertices, box.faces, "x"))
    assert read_mesh(tmp_path / name).name == name[:-4]


@pytest.mark.parametrize(
    ("unit", "millimetres"),
    [
        *(("mm", 1), ("cm", 10), ("m", 1000), ("inch", 25.4), ("ft", 304.8), ("um", 0.001)),
        *(("in", 25.4), ("Inches", 25.4), ("feet", 304.8), ("µm", 0.001), ("microns", 0.001)),
        *(("millimetres", 1), ("METER", 1000), ('"', 25.4)),
    ],
)
def test_units(unit, millimetres, box, tmp_path):
    (tmp_path / "a.stl").write_bytes(encode_stl(box.vertices, box.faces, "x"))
    mesh = read_mesh(tmp_path / "a.stl", unit)
    assert QUANTITY_UNITS["length"][mesh.unit] == millimetres
    assert np.ptp(mesh.triangles, axis=(0, 1)) == pytest.approx(np.array([2, 4, 6]) * millimetres)


def test_unknown_unit(tmp_path):
    with pytest.raises(ArgumentError, match=r"`unit` inhc: no such unit; did you mean inch\?"):
        read_mesh(tmp_path / "not even there.stl", "inhc")
    with pytest.raises(ArgumentError, match="it may be mm, cm, m, inch, ft, um"):
        read_mesh(tmp_path / "not even there.stl", "parsec")


def test_formats_without_a_unit_are_in_mm(box, tmp_path):
    (tmp_path / "a.stl").write_bytes(encode_stl(box.vertices, box.faces, "x"))
    assert read_mesh(tmp_path / "a.stl").unit == "mm"
    assert read_mesh(tmp_path / "a.stl").notes == ()


def test_glb_is_in_metres_and_says_so(box, tmp_path):
    """The glTF 2.0 specification, 3.4: the units of all linear distances are metres."""
    box.export(tmp_path / "a.glb")
    mesh = read_mesh(tmp_path / "a.glb")
    assert mesh.unit == "m"
    assert "glTF" in mesh.notes[0]
    assert np.ptp(mesh.triangles, axis=(0, 1)).max() == pytest.approx(6000)


def test_glb_transforms_apply(box, tmp_path):
    scene = trimesh.Scene(box)
    scene.add_geometry(box, transform=trimesh.transformations.translation_matrix((10, 0, 0)))
    scene.export(tmp_path / "a.glb")
    mesh = read_mesh(tmp_path / "a.glb", "mm")
    assert len(mesh.triangles) == 24
    assert mesh.triangles[..., 0].max() == pytest.approx(11)


def threemf_in(unit, box, path):
    """A file of lib3mf's own, with the box twice, in some unit."""
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(unit)
    mesh = model.AddMeshObject()
    mesh.SetGeometry(
        [lib3mf.Position(tuple(p)) for p in box.vertices.tolist()],
        [lib3mf.Triangle(tuple(f)) for f in box.faces.tolist()],
    )
    model.AddBuildItem(mesh, wrapper.GetIdentityTransform())
    away = wrapper.GetIdentityTransform()
    away.Fields[3][0] = 10.0
    model.AddBuildItem(mesh, away)
    model.QueryWriter("3mf").WriteToFile(str(path))


def test_3mf_unit_and_objects(box, tmp_path):
    threemf_in(lib3mf.ModelUnit.Inch, box, tmp_path / "a.3mf")
    mesh = read_mesh(tmp_path / "a.3mf")
    assert mesh.unit == "inch"
    assert mesh.notes == ("holds 2 placed objects, graded together as one part",)
    assert mesh.triangles[..., 0].max() == pytest.approx(11 * 25.4)
    asked = read_mesh(tmp_path / "a.3mf", "cm")
    assert asked.unit == "cm"
    assert asked.notes[-1] == "read in cm as asked, though the file says inch"
    assert asked.triangles[..., 0].max() == pytest.approx(110)


def test_3mf_as_trimesh_writes_it_is_read_without_a_warning(box, tmp_path):
    """It puts attributes of the production extension where lib3mf does not expect them."""
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in box.vertices)
    faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in box.faces)
    schema = "http://schemas.microsoft.com/3dmanufacturing"
    model = (
        f'<model xmlns="{schema}/core/2015/02" xmlns:p="{schema}/production/2015/06" '
        'unit="millimeter"><resources><object id="1" name="geometry_0" type="model" '
        'p:UUID="62a479ad-ef7c-4580-8493-edccfbed9db8"><mesh>'
        f"<vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh></object>"
        '</resources><build p:UUID="e5ce6545-8d2d-4219-afcb-4e22171fdf62">'
        f'<item xmlns="{schema}/core/2015/02" xmlns:b="{schema}/beamlattice/2017/02" '
        f'xmlns:s="{schema}/slice/2015/07" objectid="1" partnumber="geometry_0" '
        'p:UUID="22994b6b-71bb-4bc5-b41e-68d2643cec39"/></build></model>'
    )
    packages = "http://schemas.openxmlformats.org/package/2006"
    with zipfile.ZipFile(tmp_path / "a.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
        archive.writestr(
            "_rels/.rels",
            f'<Relationships xmlns="{packages}/relationships"><Relationship '
            f'Type="{schema}/2013/01/3dmodel" Target="/3D/3dmodel.model" Id="rel0"/>'
            "</Relationships>",
        )
        archive.writestr(
            "[Content_Types].xml",
            f'<Types xmlns="{packages}/content-types"><Default Extension="model" '
            'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/><Default '
            'Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships'
            '+xml"/></Types>',
        )
    mesh = read_mesh(tmp_path / "a.3mf")
    assert mesh.notes == ()
    assert np.array_equal(corners(mesh.triangles), corners(box.triangles))


def test_step_has_its_unit_its_bodies_names_and_closed_surfaces():
    """Cylinders along x: 2 inches of radius 1/4, and 1 inch of radius 1/2."""
    pytest.importorskip("cascadio")
    mesh = read_mesh(STEP)
    assert mesh.unit == "inch"
    (note,) = mesh.notes
    assert "2 placed objects (root and tip)" in note
    part = make_part(mesh.triangles, name="part")
    assert part.repairs == ()
    assert part.mesh.bounds_mm[:, 0] == pytest.approx([0.0, 4.0 * 25.4])
    # Chords 10 um inside an arc of 6.35 mm take 2/3 of 10 um of it, 0.2 % of the section.
    volume_mm3 = math.pi * (2.0 * 0.25**2 + 0.5**2) * 25.4**3
    assert 0.996 * volume_mm3 < part.mesh.volume_mm3 < volume_mm3
    asked = read_mesh(STEP, "mm")
    assert asked.notes[-1] == "read in mm as asked, though the file says inch"
    assert asked.triangles.max() == pytest.approx(4.0)


def test_step_that_no_solid_is_in_or_no_one_reads_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "part.stp"
    whole = STEP.read_bytes()
    path.write_bytes(whole[:5000])
    with pytest.raises(MeshError, match="not a whole STEP file"):
        read_mesh(path)
    path.write_bytes(whole.replace(b"MANIFOLD_SOLID_BREP", b"NOTHING_KNOWN"))
    if find_spec("cascadio"):
        with pytest.raises(MeshError, match="no solid"):
            read_mesh(path)
    monkeypatch.setattr("planner.formats.mesh_file.find_spec", lambda name: None)
    with pytest.raises(MeshError, match="pip install cascadio"):
        read_mesh(path)


def test_missing_file_names_a_near_one(box, tmp_path):
    box.export(tmp_path / "finger.stl")
    with pytest.raises(FileError, match=r"no such file; did you mean finger\.stl\?"):
        read_mesh(tmp_path / "fingr.stl")
    with pytest.raises(FileError, match="check the name and the folder"):
        read_mesh(tmp_path / "no folder" / "x.stl")


def test_folder(tmp_path):
    (tmp_path / "part.stl").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        read_mesh(tmp_path / "part.stl")


@pytest.mark.parametrize("name", ["part.iges", "part", "part.stl.zip"])
def test_ending_that_is_not_read(name, tmp_path):
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(MeshError, match="stl, 3mf, ply, obj, off, glb"):
        read_mesh(tmp_path / name)


def test_name_with_a_zero_byte():
    with pytest.raises(FileError, match="no such file"):
        read_mesh("a\0.stl")


@pytest.mark.parametrize("kind", EXTENSIONS)
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 200, b"ply\nformat", b"v 1 2\nf 1 2 3\n", b"OFF\n"]
)
def test_damaged_files(kind, content, tmp_path):
    path = tmp_path / f"bad.{kind}"
    path.write_bytes(content)
    with pytest.raises(MeshError, match=r"bad\."):
        read_mesh(path)


@pytest.mark.parametrize("kind", ["ply", "obj", "off", "glb", "3mf"])
def test_files_cut_short(kind, box, tmp_path):
    """Whatever is cut away, the answer is a MeshError or fewer finite triangles."""
    path = tmp_path / f"a.{kind}"
    if kind == "3mf":
        threemf_in(lib3mf.ModelUnit.MilliMeter, box, path)
    else:
        box.export(path)
    data = path.read_bytes()
    for cut in np.linspace(1, len(data) - 1, 25).astype(int).tolist():
        path.write_bytes(data[:cut])
        try:
            mesh = read_mesh(path)
        except MeshError:
            continue
        assert np.isfinite(mesh.triangles).all()


def test_not_finite(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match="triangle 1 of 1 has a coordinate nan"):
        read_mesh(tmp_path / "a.obj")


PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 2 0 3
"""
OFF = "OFF # a tetrahedron\n4 4 0\n" + PLY.partition("end_header\n")[2]


@pytest.mark.parametrize("word", ["nan", "inf", "1e400", "-1", "4", "99999999999999999999", "x"])
@pytest.mark.parametrize(("kind", "text"), [("ply", PLY), ("off", OFF)])
def test_a_corner_that_is_no_vertex_is_an_error_without_a_warning(word, kind, text, tmp_path):
    path = tmp_path / f"a.{kind}"
    path.write_text(text)
    assert len(read_mesh(path).triangles) == 4
    path.write_text(text.replace("3 1 2 3", f"3 1 2 {word}"))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")  # as errors they would end in the same MeshError
        with pytest.raises(MeshError, match="export the part again"):
            read_mesh(path)
    assert told == []


@pytest.mark.parametrize(
    ("kind", "text", "promised"),
    [
        ("ply", PLY.removesuffix("3 2 0 3\n"), 8),
        ("ply", PLY.replace("element face 4", "element face 99999999999"), 100_000_000_003),
        ("ply", PLY.replace("element vertex 4", "element vertex 99999999999"), 100_000_000_003),
        ("off", OFF.removesuffix("3 2 0 3\n"), 8),
        ("off", OFF.replace("4 4 0", "4 99999999999 0"), 100_000_000_003),
    ],
)
def test_fewer_rows_than_promised_are_refused(kind, text, promised, tmp_path):
    path = tmp_path / f"a.{kind}"
    path.write_text(text)
    with pytest.raises(MeshError, match=rf"promises {promised} rows of .* holds \d:"):
        read_mesh(path)


def test_a_glb_that_places_a_shape_too_often_is_refused(box, tmp_path):
    scene = trimesh.Scene()
    for k in range(50):
        moved = trimesh.transformations.translation_matrix((10.0 * k, 0.0, 0.0))
        scene.add_geometry(box, geom_name="box", transform=moved)
    scene.export(tmp_path / "a.glb")
    assert len(read_mesh(tmp_path / "a.glb").triangles) == 600
    for limits in (UnfoldingLimits(triangles=599), UnfoldingLimits(objects=49)):
        with pytest.raises(MeshError, match="unfolds to 50 objects of 600 triangles"):
            read_mesh(tmp_path / "a.glb", limits=limits)


def glb_of(box, nodes):
    """A GLB of a box whose nodes are one's own."""
    data = trimesh.Scene(box).export(file_type="glb")
    size = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + size]) | {"nodes": nodes, "scenes": [{"nodes": [0]}]}
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    whole = [b"glTF", 2, len(data) - size + len(text), len(text)]
    head = b"".join(n if isinstance(n, bytes) else n.to_bytes(4, "little") for n in whole)
    return head + b"JSON" + text + data[20 + size :]


def test_a_glb_whose_transform_is_not_finite_is_an_error_without_a_warning(box, tmp_path):
    (tmp_path / "a.glb").write_bytes(glb_of(box, [{"mesh": 0, "matrix": 16 * [float("nan")]}]))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        with pytest.raises(MeshError, match="no number, or too large"):
            read_mesh(tmp_path / "a.glb")
    assert told == []


@pytest.mark.parametrize(
    ("last", "said"), [({"mesh": 0}, "nested too deep"), ({"children": [0]}, "turn back")]
)
def test_a_glb_of_deep_nodes_is_refused_at_once(last, said, box, tmp_path):
    """2,000 nodes one below the other took 18 s: each is placed by all that are above it."""
    chain = [{"mesh": 0, "children": [k + 1]} for k in range(1999)]
    (tmp_path / "a.glb").write_bytes(glb_of(box, [*chain, last]))
    begin = time.process_time()
    with pytest.raises(MeshError, match=said):
        read_mesh(tmp_path / "a.glb")
    assert time.process_time() - begin < 1.0
    short = [*chain[:299], {"mesh": 0}]
    (tmp_path / "a.glb").write_bytes(glb_of(box, short))
    assert len(read_mesh(tmp_path / "a.glb").triangles) == 300 * 12
