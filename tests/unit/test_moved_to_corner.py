"""Placing a part takes as little of its volume as single precision allows."""

import manifold3d as m3
import numpy as np
import pytest

from planner.cutting.pieces import split
from planner.fields.basic import PlanarField, axis_field
from planner.mesh.mesh import Mesh
from planner.mesh.part import moved_to_corner

LEVELS = np.linspace(0.0, 1.0, 11)[1:-1]


class Rings:
    """Distance from an axis along z, over a length."""

    name = "rings"

    def __init__(self, mesh: Mesh) -> None:
        self.centre = mesh.bounds_mm.mean(axis=0)
        self.length = np.ptp(mesh.bounds_mm, axis=0).max() / 1.9

    def values(self, points_mm: np.ndarray) -> np.ndarray:
        return np.linalg.norm((points_mm - self.centre)[:, :2], axis=1) / self.length

    def description(self) -> dict[str, object]:
        return {}


def _box(size_mm, angles=(0.0, 0.0, 0.0), offset_mm: float = 0.0) -> Mesh:
    """A box turned and moved in double precision: manifold3d has its corners in single."""
    solid = m3.Manifold.cube([1.0, 1.0, 1.0]).to_mesh()
    vertices = np.asarray(solid.vert_properties[:, :3], np.float64) * size_mm
    for axis, angle in enumerate(np.radians(angles)):
        turn, (i, j) = np.eye(3), [(1, 2), (0, 2), (0, 1)][axis]
        turn[i, i] = turn[j, j] = np.cos(angle)
        turn[i, j], turn[j, i] = -np.sin(angle), np.sin(angle)
        vertices = vertices @ turn.T
    return Mesh(vertices + offset_mm * np.array([1.0, 0.7, 0.3]), np.asarray(solid.tri_verts))


def _taken(mesh: Mesh, field: str) -> float:
    """Share of the volume that placing and cutting take."""
    placed, _ = moved_to_corner(mesh)
    along: PlanarField | Rings = Rings(placed) if field == "rings" else axis_field(field, placed)
    pieces = split(placed, along, LEVELS, pitch_mm=np.ptp(placed.bounds_mm, axis=0).max() / 60)
    return abs(float(pieces.volumes_mm3.sum()) / mesh.volume_mm3 - 1.0)


@pytest.mark.parametrize("field", ["x", "1,1,0", "rings"])
@pytest.mark.parametrize("offset_mm", [0.0, 1e4, 9.99e5])
@pytest.mark.parametrize("thickness_mm", [0.06, 0.1, 0.3])
def test_plates_along_the_axes_keep_their_volume(thickness_mm, offset_mm, field):
    """Steps of float32 are 2^-23 mm from 1 to 2 mm: half of one is 1e-6 of 0.06 mm."""
    # A part 1e6 mm away has a thickness only to the steps of float64 there, 1.2e-10 mm.
    assert _taken(_box((200.0, 150.0, thickness_mm), offset_mm=offset_mm), field) <= 1e-6


@pytest.mark.parametrize("field", ["x", "rings"])
@pytest.mark.parametrize(
    ("size_mm", "angles"),
    [
        ((200.0, 200.0, 0.1), (0.0, 0.0, 30.0)),
        ((100.0, 60.0, 0.6), (10.0, 20.0, 30.0)),
        ((300.0, 280.0, 1.5), (10.0, 20.0, 0.0)),
        ((300.0, 280.0, 2.0), (25.0, 5.0, 70.0)),
    ],
)
def test_turned_plates_keep_their_volume(size_mm, angles, field):
    assert _taken(_box(size_mm, angles), field) <= 1e-6


def test_the_place_is_the_usual_one_where_that_takes_little():
    placed, translation_mm = moved_to_corner(_box((60.0, 40.0, 20.0), offset_mm=-33.3))
    assert np.array_equal(placed.bounds_mm[0], np.ones(3))
    assert translation_mm == pytest.approx([34.3, 24.31, 10.99])


def test_the_place_is_never_below_1_mm_nor_a_step_beyond():
    for angle in (5.0, 17.0, 31.0, 44.0):
        low, high = moved_to_corner(_box((250.0, 100.0, 0.5), (angle, angle / 2, 0.0)))[0].bounds_mm
        assert (low >= 1.0).all()
        assert (low <= 1.0 + 2.0 * np.spacing(high.astype(np.float32))).all()
