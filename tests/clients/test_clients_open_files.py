"""Programs that people use open what is written: admesh, assimp, PrusaSlicer."""

import re
import shutil
import subprocess

import manifold3d
import numpy as np
import pytest

from planner.formats.stl import encode_stl
from planner.formats.threemf import ThreemfObject, write_threemf


def need(program):
    return pytest.mark.skipif(shutil.which(program) is None, reason=f"{program} is not installed")


def run(*command):
    done = subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        encoding="utf-8",
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


@pytest.fixture(scope="module")
def threemf(tmp_path_factory):
    shells = parts()
    objects = [
        ThreemfObject(f"ring__{k}", v, f, name, colour, {"coordinate": "0.5"})
        for k, ((v, f, _), name, colour) in enumerate(
            zip(shells, ("FLX9740", "VeroWhitePlus"), ("#336699", "#EEEEEE"), strict=True)
        )
    ]
    path = tmp_path_factory.mktemp("3mf") / "ring.3mf"
    write_threemf(path, objects, "ring", {"printer": "connex3"})
    return path, [len(f) for _, f, _ in shells], [volume for *_, volume in shells]


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


@need("prusa-slicer")
def test_prusa_slicer_reads_the_stl(stl):
    path, faces, volume = stl
    report = run("prusa-slicer", "--info", path)
    assert number("number_of_facets", report) == [faces]
    assert re.findall("manifold = (.*)", report) == ["yes"]
    assert number("volume", report) == [pytest.approx(volume, rel=1e-5)]  # float32 sums


@need("prusa-slicer")
def test_prusa_slicer_reads_the_3mf(threemf):
    path, faces, volumes = threemf
    report = run("prusa-slicer", "--info", path)
    assert number("number_of_facets", report) == faces
    assert re.findall("manifold = (.*)", report) == ["yes", "yes"]
    assert number("volume", report) == [pytest.approx(v, rel=1e-5) for v in volumes]
