"""Programs that people use open what is written: admesh, assimp, PrusaSlicer, Cura's reader."""

import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import manifold3d
import numpy as np
import pytest

from planner.formats.mesh_file import encode_stl
from planner.formats.threemf import ThreemfObject, encode_threemf
from planner.voxels.picture import pictures_of


def need(program):
    return pytest.mark.skipif(shutil.which(program) is None, reason=f"{program} is not installed")


def run(*command):
    done = subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        encoding="utf-8",
        errors="replace",  # not all that admesh prints is UTF-8
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "error" not in done.stdout.lower()
    return done.stdout


def parts():
    """Two shells that share a face, as two materials of a graded part do; and their volumes."""
    ring = manifold3d.Manifold.cylinder(4.0, 10.0, circular_segments=64)
    ring -= manifold3d.Manifold.cylinder(4.0, 5.0, circular_segments=64)
    shells = []
    for half in ring.translate((11, 11, 1)).split_by_plane((1, 0, 0), 11.0):
        mesh = half.to_mesh()
        vertices = np.asarray(mesh.vert_properties, dtype=np.float32)[:, :3]
        shells.append((vertices, np.asarray(mesh.tri_verts, dtype=np.int32), half.volume()))
    return shells


@pytest.fixture(scope="module")
def stl(tmp_path_factory):
    vertices, faces, volume = parts()[0]
    path = tmp_path_factory.mktemp("stl") / "ring__01_FLX9740.stl"
    path.write_bytes(encode_stl(vertices, faces, "ring FLX9740 unit=mm"))
    return path, len(faces), volume


def written(path, *, one_mesh=False):
    shells = parts()
    objects = [
        ThreemfObject(f"ring__{k}", v, f, name, colour, {"coordinate": "0.5"})
        for k, ((v, f, _), name, colour) in enumerate(
            zip(shells, ("FLX9740", "VeroWhitePlus"), ("#336699", "#EEEEEE"), strict=True)
        )
    ]
    solids = [(v, f, "#336699") for v, f, _ in shells]
    picture = pictures_of(solids, width=64, height=64).thumbnail
    data = encode_threemf(objects, "ring", thumbnail=picture, one_mesh=one_mesh)
    path.write_bytes(data)
    return path, [len(f) for _, f, _ in shells], [volume for *_, volume in shells]


@pytest.fixture(scope="module")
def threemf(tmp_path_factory):
    return written(tmp_path_factory.mktemp("3mf") / "ring.3mf")


@pytest.fixture(scope="module")
def prusa_threemf(tmp_path_factory):
    return written(tmp_path_factory.mktemp("3mf") / "ring.3mf", one_mesh=True)


def number(name, text):
    return [float(value) for value in re.findall(rf"{name}\s*[=:]\s*([-\d.]+)", text)]


@need("admesh")
def test_admesh_finds_nothing_to_mend(stl):
    path, faces, volume = stl
    report = run("admesh", path)
    assert "Binary STL file" in report
    assert re.search(rf"Number of facets\s*:\s*{faces}\s+{faces}\n", report)
    assert number("Volume", report) == [pytest.approx(volume, rel=1e-5)]  # admesh sums in float32
    for fault in ("Total disconnected facets", "Degenerate facets", "Edges fixed"):
        assert number(fault, report) == [0]
    for fault in ("Facets removed", "Facets reversed", "Backwards edges", "Normals fixed"):
        assert number(fault, report) == [0]


@need("assimp")
def test_assimp_reads_the_stl(stl):
    path, faces, _ = stl
    report = run("assimp", "info", path)
    assert number("Faces", report) == [faces]
    assert number("Meshes", report) == [1]


@need("assimp")
def test_assimp_reads_the_3mf(threemf):
    path, faces, _ = threemf
    report = run("assimp", "info", path)
    assert number("Meshes", report) == [2]
    assert number("Faces", report) == [sum(faces)]
    assert "FLX9740" in report
    assert "VeroWhitePlus" in report


@need("assimp")
def test_assimp_reads_the_3mf_of_one_mesh(prusa_threemf):
    path, faces, _ = prusa_threemf
    report = run("assimp", "info", path)
    assert number("Meshes", report) == [1]
    assert number("Faces", report) == [sum(faces)]


@need("prusa-slicer")
def test_prusa_slicer_reads_the_stl(stl):
    path, faces, volume = stl
    report = run("prusa-slicer", "--info", path)
    assert number("number_of_facets", report) == [faces]
    assert re.findall("manifold = (.*)", report) == ["yes"]
    assert number("volume", report) == [pytest.approx(volume, rel=1e-5)]  # float32 sums


@need("prusa-slicer")
def test_prusa_slicer_makes_an_object_of_each_component(threemf):
    path, faces, volumes = threemf
    report = run("prusa-slicer", "--info", path)
    assert number("number_of_facets", report) == faces
    assert re.findall("manifold = (.*)", report) == ["yes", "yes"]
    assert number("volume", report) == [pytest.approx(v, rel=1e-5) for v in volumes]


@need("prusa-slicer")
def test_prusa_slicer_makes_parts_of_one_object_of_one_mesh(prusa_threemf, tmp_path):
    path, faces, volumes = prusa_threemf
    report = run("prusa-slicer", "--info", path)
    assert number("number_of_facets", report) == [sum(faces)]
    assert number("number_of_parts", report) == [2]
    assert number("volume", report) == [pytest.approx(sum(volumes), rel=1e-5)]
    assert number("min_x", report) == [pytest.approx(1.0, abs=1e-5)]  # where it was written

    # Written again by PrusaSlicer itself: both parts keep their names and extruders.
    run("prusa-slicer", "--export-3mf", "--dont-arrange", "-o", tmp_path / "again.3mf", path)
    with zipfile.ZipFile(tmp_path / "again.3mf") as archive:
        config = ET.fromstring(archive.read("Metadata/Slic3r_PE_model.config"))
    (whole,) = config.findall("object")
    found = [{m.get("key"): m.get("value") for m in v} for v in whole.findall("volume")]
    assert [(v["name"], v["extruder"]) for v in found] == [("ring__0", "1"), ("ring__1", "2")]


@need("prusa-slicer")
def test_prusa_slicer_prints_each_part_with_its_extruder(prusa_threemf, tmp_path):
    path, *_ = prusa_threemf
    (tmp_path / "two.ini").write_text(
        "nozzle_diameter = 0.4,0.4\nsingle_extruder_multi_material = 0\n"
    )
    gcode = tmp_path / "ring.gcode"
    run("prusa-slicer", "--load", tmp_path / "two.ini", "--export-gcode", "-o", gcode, path)
    assert set(re.findall(r"^T\d+", gcode.read_text(), re.MULTILINE)) == {"T0", "T1"}


# Cura's own reader of 3MF, a module of the system's Python: Savitar up to Cura 4, then pySavitar.
SAVITAR = """
import json, sys, zipfile
try:
    import Savitar
except ImportError:
    import pySavitar as Savitar

def told(node):
    settings = {k: getattr(v, "value", v) for k, v in node.getSettings().items()}
    triangles = len(node.getMeshData().getFlatVerticesAsBytes()) // 36
    inner = [told(child) for child in node.getChildren()]
    return [node.getName(), triangles, settings.get("extruder_nr"), inner]

if len(sys.argv) > 1:
    model = zipfile.ZipFile(sys.argv[1]).read("3D/3dmodel.model")
    scene = Savitar.ThreeMFParser().parse(model)
    print(json.dumps([told(node) for node in scene.getSceneNodes()]))
"""


def savitar(*arguments):
    return subprocess.run(
        ["/usr/bin/python3", "-c", SAVITAR, *map(str, arguments)],
        capture_output=True,
        encoding="utf-8",
        timeout=60,
        check=False,
    )


def test_cura_reads_one_group_of_meshes_with_extruders(threemf):
    if not Path("/usr/bin/python3").exists() or savitar().returncode != 0:
        pytest.skip("Cura's reader (python3-savitar) is not installed")
    path, faces, _ = threemf
    done = savitar(path)
    assert done.returncode == 0, done.stderr
    first = ["ring__0", faces[0], "0", []]
    second = ["ring__1", faces[1], "1", []]
    assert json.loads(done.stdout) == [["ring", 0, None, [first, second]]]
