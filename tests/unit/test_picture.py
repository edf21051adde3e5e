"""Pictures of solids: what is seen, what a cut shows, and the same bytes."""

import hashlib
import io
import zipfile

import manifold3d as m3
import numpy as np
import pytest
from PIL import Image

import planner
from planner.formats.threemf import read_threemf
from planner.mesh.mesh import Mesh
from planner.voxels.picture import pictures_of


def _mesh(solid: m3.Manifold) -> Mesh:
    mesh = solid.to_mesh()
    vertices = np.asarray(mesh.vert_properties[:, :3], dtype=np.float64)
    return Mesh(vertices, np.asarray(mesh.tri_verts, dtype=np.int32))


def _pixels(solids: list[tuple[Mesh, str]], *, cut_open: bool = False) -> np.ndarray:
    each = [(solid.vertices, solid.faces, colour) for solid, colour in solids]
    pictures = pictures_of(each, width=120, height=90)
    image = Image.open(io.BytesIO(pictures.section if cut_open else pictures.outside))
    assert image.size == (120, 90)
    return np.asarray(image.convert("RGBA")).astype(int)


SHELL, CORE = "#0000FF", "#FF0000"
BLOCK = m3.Manifold.cube([40.0, 20.0, 20.0], center=True)
BALL = m3.Manifold.sphere(6.0, 48)


def test_a_block_has_three_faces_in_three_lights() -> None:
    pixels = _pixels([(_mesh(BLOCK), SHELL)])
    whole = pixels[pixels[..., 3] == 255]
    assert not whole[:, :2].any()  # nothing but blue
    light, count = np.unique(whole[:, 2], return_counts=True)
    # Three faces; along their edges a pixel is a mean of two. Slopes are whole steps of a ray.
    common = light[count > 100]
    assert 1 + (np.diff(common) > 3).sum() == 3
    assert (pixels[0] == 0).all()  # a transparent margin
    wide, high = (np.ptp(np.flatnonzero(pixels[..., 3].any(axis=axis))) + 1 for axis in (0, 1))
    assert max(wide / 120, high / 90) == pytest.approx(0.94, abs=2 / 90)  # all but the margins


def test_a_cut_shows_what_is_inside() -> None:
    """A ball within a block is seen where the block is cut, as an ellipse in its whole colour."""
    solids = [(_mesh(BLOCK - BALL), SHELL), (_mesh(BALL), CORE)]
    assert not (_pixels(solids)[..., 0] > 0).any()
    pixels = _pixels(solids, cut_open=True)
    core = (pixels == [255, 0, 0, 255]).all(axis=2)
    face = (pixels == [0, 0, 255, 255]).all(axis=2)
    # The plane through the middle: a disc of radius 6 in a face of 40 by 20.
    assert core.sum() / (core.sum() + face.sum()) == pytest.approx(np.pi * 36 / 800, rel=0.05)


def test_an_open_cavity_is_looked_into() -> None:
    pixels = _pixels([(_mesh(BLOCK - BALL), SHELL)], cut_open=True)
    inside = pixels[(pixels[..., 3] == 255) & (pixels[..., 2] < 255)]
    assert len(inside) > 100


def test_the_bytes_are_these() -> None:
    block = _mesh(BLOCK)
    data = b"".join(pictures_of([(block.vertices, block.faces, SHELL)], width=60, height=40))
    assert hashlib.sha256(data).hexdigest()[:16] == "d07ceccb393a1b94"


def test_a_plan_has_pictures_and_its_3mf_a_thumbnail(tmp_path) -> None:
    part = _mesh(BLOCK)
    plan = planner.grade((part.vertices, part.faces), from_="Tango", to="Vero")
    folder = plan.write(tmp_path / "out")
    for name in ("part.png", "section.png"):
        assert Image.open(io.BytesIO((folder / name).read_bytes())).size == (600, 400)
    with zipfile.ZipFile(folder / "part.3mf") as archive:
        thumbnail = Image.open(io.BytesIO(archive.read("Metadata/Thumbnail.png")))
    assert thumbnail.size == (300, 200)
    assert len(read_threemf(folder / "part.3mf").objects) == len(plan.shells)
    assert planner.check(folder).ok
    assert plan.write(tmp_path / "out", force=True) == folder


@pytest.mark.parametrize("along", ["y", "x"])
def test_rows_of_bodies_are_cut_and_not_what_is_between(along: str) -> None:
    """A plane through the middle of two blocks took one off and left the other whole."""
    long = m3.Manifold.cube([40.0, 8.0, 8.0], center=True)
    core = m3.Manifold.cube([30.0, 4.0, 4.0], center=True)
    turn = 0.0 if along == "y" else 90.0
    places = [(0.0, -10.0, 0.0), (0.0, 10.0, 0.0)]
    shell, cores = (
        m3.Manifold.batch_boolean([one.translate(at) for at in places], m3.OpType.Add)
        for one in (long - core, core)
    )
    solids = [(_mesh(shell.rotate([0, 0, turn])), SHELL), (_mesh(cores.rotate([0, 0, turn])), CORE)]
    pixels = _pixels(solids, cut_open=True)
    inner = (pixels == [255, 0, 0, 255]).all(axis=2).sum()
    # The front one is cut: a face of 30 by 4 in one of 40 by 8; the other stands behind it, whole.
    faces = (pixels == [0, 0, 255, 255]).all(axis=2).sum()
    assert inner / (inner + faces) == pytest.approx(120 / 320, rel=0.1)
    shaded = (pixels[..., 3] == 255) & (pixels[..., 2] < 255) & (pixels[..., 0] == 0)
    assert shaded.sum() > 200
