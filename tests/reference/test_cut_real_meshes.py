"""Parts as CAD systems export them, cut along axes and aslant."""

import re
import zipfile

import numpy as np
import pytest
import trimesh
from manifold3d import Error, Manifold
from manifold3d import Mesh as SolidMesh

from benchmarks.audit import audit
from planner.cutting.pieces import split
from planner.fields.basic import axis_field
from planner.grading.check import interfaces_cancel
from planner.mesh.mesh import Mesh, join_shells, weld
from planner.mesh.part import moved_to_corner


def load(path):
    """Triangle soup of a mesh file, in the file's unit."""
    if path.suffix == ".3mf":
        model = zipfile.ZipFile(path).read("3D/3dmodel.model").decode()
        corner = r'<vertex x="([^"]+)" y="([^"]+)" z="([^"]+)"'
        face = r'<triangle v1="(\d+)" v2="(\d+)" v3="(\d+)"'
        vertices = np.array(re.findall(corner, model), dtype=float)
        return vertices[np.array(re.findall(face, model), dtype=int)]
    return np.asarray(trimesh.load(path, force="mesh", process=False).triangles)


def placed(path, unit_mm):
    return moved_to_corner(Mesh(*weld(load(path).astype(np.float64) * unit_mm)))[0]


def cut(mesh, axis):
    """Cut at nine levels, every other one through a vertex; return the soups of the shells."""
    field = axis_field(axis, mesh)
    values = field.values(mesh.vertices)
    levels = np.arange(1, 10) / 10
    levels[::2] = [values[np.argmin(abs(values - level))] for level in levels[::2]]
    # Where vertices are few, several levels find the same one.
    levels = np.unique(levels[levels < 1])
    levels = levels[np.diff(levels, prepend=0) > 1e-4]
    pieces = split(mesh, field, levels)
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    return pieces, [soup for soup in soups if len(soup)]


@pytest.mark.parametrize("axis", ["x", "y", "-z", "1,2,3"])
@pytest.mark.parametrize(
    ("name", "unit_mm"),
    [
        ("featuretype.STL", 25.4), ("ADIS16480.STL", 25.4), ("angle_block.STL", 25.4),
        ("torus.3mf", 1), ("quadknot.obj", 1), ("busted.STL", 1),
    ],
)  # fmt: skip
def test_shells_of_real_parts_are_sound(shared_data, name, unit_mm, axis):
    mesh = placed(shared_data / "meshes" / name, unit_mm)
    assert audit(mesh.triangles.astype(np.float32)).sound
    pieces, soups = cut(mesh, axis)
    assert len(soups) >= 5
    for soup in soups:
        found = audit(soup)
        assert found.sound
        assert found.flat_faces == 0
        vertices, faces = weld(soup)
        assert Manifold(SolidMesh(vertices, faces.astype(np.uint32))).status() == Error.NoError
        # A reader that also drops what is thinner than 1e-8 mm still finds a closed shell.
        read = trimesh.Trimesh(**trimesh.triangles.to_kwargs(soup), process=True, validate=True)
        assert read.is_watertight
    assert interfaces_cancel(join_shells(soups), mesh)
    assert pieces.volumes_mm3.sum() == pytest.approx(mesh.volume_mm3, rel=1e-6)


def test_bodies_that_touch_stay_closed_outlines(shared_data):
    # 242 edges of this assembly have four faces before any cut: shells inherit such edges, but
    # no shell is open, and together they are the part.
    mesh = placed(shared_data / "meshes" / "cycloidal.ply", 25.4)
    whole = audit(mesh.triangles.astype(np.float32))
    assert (whole.open_edges, whole.overused_edges) == (0, 242)
    pieces, soups = cut(mesh, "x")
    for soup in soups:
        found = audit(soup)
        assert found.open_edges == 0
        assert found.degenerate_faces == found.duplicate_faces == 0
    assert interfaces_cancel(join_shells(soups), mesh)
    assert pieces.volumes_mm3.sum() == pytest.approx(mesh.volume_mm3, rel=1e-6)
