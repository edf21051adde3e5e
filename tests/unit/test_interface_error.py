"""Interfaces of curved fields lie within 20 um of their level sets, vertices and faces."""

import numpy as np
import pytest
from manifold3d import Manifold

from benchmarks.audit import audit
from planner.cutting.pieces import Pieces, split
from planner.fields.basic import FunctionField
from planner.fields.solved import between_cells
from planner.mesh.mesh import Mesh, interfaces_cancel, join_shells
from planner.mesh.part import place
from planner.voxels.columns import Grid

WITHIN_MM = 0.02


def part(solid: Manifold) -> Mesh:
    mesh = solid.to_mesh()
    return place(Mesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)))[0]


BALL = part(Manifold.sphere(10.0, 64))
BOX = part(Manifold.cube([24.0, 16.0, 12.0]))


def radius(mesh: Mesh):
    centre = mesh.bounds_mm.mean(axis=0)
    return lambda p: np.sqrt(((p - centre) ** 2).sum(axis=1)) / 16.0


def helicoid(mesh: Mesh):
    centre = mesh.bounds_mm.mean(axis=0) + np.array([0.0, 20.0, 0.0])  # its axis is outside
    return lambda p: (
        0.5 + 0.35 * np.arctan2(*(p - centre)[:, :2].T) % np.pi / np.pi + p[:, 2] / 60.0 - 0.25
    )


def wave(mesh: Mesh):
    return lambda p: p[:, 2] / 14.0 + 0.1 * np.sin(p[:, 0] / 3.0) * np.cos(p[:, 1] / 4.0)


def table(mesh: Mesh):
    """A table with a row every 4 mm, linear between them along each axis."""
    x, y, z = np.meshgrid(*[np.arange(8.0)] * 3, indexing="ij")
    values = 0.2 + 0.07 * x + 0.02 * np.sqrt(y + 1.0) + 0.01 * z
    return between_cells(Grid((-1.0, -1.0, -1.0), (4.0, 4.0, 4.0), (8, 8, 8)), values)


def ridge(mesh: Mesh):
    """A distance with one crease, a plane aslant: the nearer of two walls."""
    low = mesh.bounds_mm[0]
    return lambda p: np.minimum(p[:, 0] - low[0], 0.8 * (p[:, 1] - low[1]) + 2.0) / 16.0


def off_mm(pieces: Pieces, field: FunctionField, levels: np.ndarray) -> list[np.ndarray]:
    """How far corners of faces lie, and middles, by the field's own slope."""

    def distance(points: np.ndarray, level: np.ndarray) -> np.ndarray:
        step = 1e-4
        ahead = [field.values(points + step * axis) for axis in np.eye(3)]
        behind = [field.values(points - step * axis) for axis in np.eye(3)]
        slope = np.linalg.norm((np.array(ahead) - behind) / (2.0 * step), axis=0)
        return np.abs(field.values(points) - level) / slope

    corners = pieces.vertices[pieces.cap_faces].astype(float)
    level = levels[pieces.cap_level]
    ends = distance(corners.reshape(-1, 3), np.repeat(level, 3))
    return [ends, distance(corners.mean(axis=1), level)]


@pytest.mark.parametrize(
    ("mesh", "make"),
    [(BALL, radius), (BOX, radius), (BOX, helicoid), (BOX, wave), (BOX, table)],
    ids=["radius in a ball", "radius in a box", "helicoid", "wave", "table"],
)
def test_interfaces_are_within_a_stated_distance(mesh: Mesh, make) -> None:
    field, levels = FunctionField("function", make(mesh)), np.array([0.15, 0.3, 0.45, 0.6])
    pieces = split(mesh, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    ends, middles = off_mm(pieces, field, levels)
    assert len(middles) > 100
    # Corners keep off the grid's vertices by a thousandth of an edge of at most 2 sqrt(3) mm; where
    # a face ends at the part's surface its corners lie anywhere in it.
    assert np.quantile(ends, 0.5) < 0.2 * WITHIN_MM
    assert np.quantile(ends, 0.99) < WITHIN_MM
    assert ends.max() < 2.0 * WITHIN_MM
    assert np.quantile(middles, 0.99) < WITHIN_MM
    assert middles.max() < 1.5 * WITHIN_MM  # where the slope changes within a tetrahedron
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    soups = [soup for soup in soups if len(soup)]
    assert all(audit(soup).sound for soup in soups)
    assert interfaces_cancel(join_shells(soups), mesh).ok


def test_flat_fields_take_few_triangles() -> None:
    """A cube's section, where no finer one is needed; five times fewer than at the pitch."""
    field, levels = FunctionField("function", radius(BALL)), np.array([0.3, 0.45])
    divided = split(BALL, field, levels, pitch_mm=0.25, within_mm=WITHIN_MM)
    fine = split(BALL, field, levels, pitch_mm=0.25)
    assert 4 * len(divided.cap_faces) < len(fine.cap_faces)


def test_a_crease_is_followed_to_the_deepest_division() -> None:
    field, levels = FunctionField("function", ridge(BOX)), np.array([0.3, 0.45])
    pieces = split(BOX, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    _, middles = off_mm(pieces, field, levels)
    assert middles.max() < 2.0 * WITHIN_MM
    assert np.quantile(middles, 0.99) < WITHIN_MM


def test_levels_close_together_do_not_cross() -> None:
    """Faces of the next level lie above those of the one below, however near they are."""
    levels = np.array([0.3, 0.3002, 0.3005, 0.45])
    field = FunctionField("function", radius(BALL))
    pieces = split(BALL, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    volume = pieces.measures.volume_mm3
    assert (volume > 0.0).all()
    wanted = 4.0 * np.pi * (16.0 * 0.3) ** 2 * 16.0 * np.diff(levels[:3])
    # Bands of 3 and 5 um; each level may move by a thousandth of an edge, 0.5 mm long there.
    np.testing.assert_allclose(volume[1:3], wanted, rtol=0.15)
