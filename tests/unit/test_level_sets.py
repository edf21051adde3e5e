"""Shells along curved level sets: the guarantees of planar cuts, and where the interfaces lie."""

import numba
import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Error, Manifold
from manifold3d import Mesh as SolidMesh

from benchmarks.audit import audit
from benchmarks.interfaces import BOX, FACES
from planner.cutting import grid
from planner.cutting import pieces as cutting
from planner.cutting.intersect import volume_sign
from planner.cutting.pieces import FIRST_SHIFT, split
from planner.errors import ArgumentError
from planner.fields.parse import Setting, build_field
from planner.grading.check import interfaces_cancel
from planner.mesh.mesh import Mesh, join_shells, weld
from planner.mesh.part import moved_to_corner


class FunctionField:
    """A field given by a function of points."""

    name = "function"

    def __init__(self, function):
        self.values = function

    def description(self):
        return {"name": self.name}


def radial(centre, length):
    centre = np.array(centre, dtype=float)
    return FunctionField(lambda points: np.linalg.norm(points - centre, axis=1) / length)


def part(solid):
    mesh = solid.to_mesh()
    return moved_to_corner(
        Mesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))
    )[0]


def check(pieces, mesh):
    """Audit every shell as its readers see it; return how many are not empty."""
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    soups = [soup for soup in soups if len(soup)]
    for soup in soups:
        assert audit(soup).sound
        vertices, faces = weld(soup)
        assert Manifold(SolidMesh(vertices, faces.astype(np.uint32))).status() == Error.NoError
        assert trimesh.Trimesh(vertices, faces, process=True, validate=True).is_watertight
    assert interfaces_cancel(join_shells(soups), mesh)
    return len(soups)


LEVELS = (0.03906810533247537, 0.04581336939740248, 0.07057545606160655, 0.09462974960809709)
"""Where the first guess is the root but for its last digit, and others are made."""


@pytest.mark.parametrize("level", LEVELS)
def test_a_flat_level_set_lies_at_its_level(level):
    """Of a distance from flat faces: within the 2e-3 of a cell that vertices keep off its edges."""
    mesh = Mesh(np.asarray([20.0, 12.0, 6.0] * BOX, dtype=np.float32).astype(float), FACES)
    depth = build_field("distance: surface, to=3", Setting(mesh, (0.0, 0.0, 0.0), 0.56))
    sets = grid.draw_level_sets(
        mesh, depth, np.array([level]), 0.56, FIRST_SHIFT, 0.02, follow=True
    )
    x, y, z = sets.vertices.T
    inner = (x > 2.0) & (x < 18.0) & (y > 2.0) & (y < 10.0)
    for deep in (z[inner & (z < 3.0)], 6.0 - z[inner & (z > 3.0)]):
        assert len(deep) > 50
        assert np.abs(deep - 3.0 * level).max() < 2.0 * 2e-3 * 0.56


def test_tetrahedra_are_halved_in_the_middle_of_an_edge(monkeypatch):
    """Also of one that met a crease elsewhere: they keep their shape, and none turns over."""
    halved, off_mm = grid._halved, []

    def watched(cubes, field, marks, places, number):
        found, leaves = halved(cubes, field, marks, places, number)
        there = found.places[found.sharp == 0]
        middle_mm = grid._even_mm(cubes, grid._indices(cubes.active, there))
        off_mm.append(np.abs(found.points_mm[found.sharp == 0] - middle_mm).max(initial=0.0))
        corners = found.seen(cubes, leaves.ravel())[0].reshape(-1, 4, 3)
        assert (np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) > 1e-9).all()
        return found, leaves

    monkeypatch.setattr(grid, "_halved", watched)
    mesh = Mesh(np.asarray([20.0, 12.0, 6.0] * BOX, dtype=np.float32).astype(float), FACES)
    wish = "max(distance: surface; radial: point=0 0 0)"
    field = build_field(wish, Setting(mesh, (0.0, 0.0, 0.0), 0.56))
    split(mesh, field, np.arange(1, 8) / 8, pitch_mm=0.56, within_mm=0.02)
    assert len(off_mm) > 2
    assert max(off_mm) == 0.0


def test_functions_are_asked_where_there_are_points():
    """Some take no empty arrays, as those of `numpy.vectorize`."""
    asked = []

    def values(points):
        asked.append(len(points))
        return points[:, 0] / 20.0

    mesh = Mesh(np.asarray([20.0, 12.0, 6.0] * BOX, dtype=np.float32).astype(float), FACES)
    split(mesh, FunctionField(values), [0.5], pitch_mm=0.56, within_mm=0.02)
    assert min(asked) > 0


@numba.njit
def signs(normals, offsets):
    found = np.empty(len(normals), dtype=np.int64)
    for i in range(len(normals)):
        n, d = normals[i], offsets[i]
        found[i] = volume_sign(n[0], n[1], n[2], d[0], d[1], d[2])
    return found


def test_signs_of_volumes_are_exact_where_floating_point_is_not():
    rng = np.random.default_rng(0)
    offsets = rng.integers(-(2**29), 2**29, (2000, 3))
    normals = rng.integers(-(2**60), 2**60, (2000, 3))
    # Half of them nearly in the plane: the products cancel to a few units out of 2^90.
    for n, d in zip(normals[::2], offsets[::2], strict=True):
        d[2] = 1
        n[2] = np.clip(
            -(int(n[0]) % 1000 * int(d[0])) - int(n[1]) % 1000 * int(d[1]), -(2**60), 2**60
        )
        n[0], n[1] = n[0] % 1000, n[1] % 1000
        n[2] += rng.integers(-1, 2)
    exact = [
        int(np.sign(sum(int(a) * int(b) for a, b in zip(n, d, strict=True))))
        for n, d in zip(normals, offsets, strict=True)
    ]
    assert {-1, 0, 1} <= set(exact)
    np.testing.assert_array_equal(signs(normals, offsets), exact)


def test_interfaces_lie_within_half_a_pitch_and_fall_at_second_order():
    mesh = part(Manifold.cube([10, 10, 10]))
    field = radial([1, 1, 1], 12.0)
    worst = []
    for pitch_mm in (2.0, 1.0, 0.5):
        pieces = split(mesh, field, [0.3, 0.7], pitch_mm=pitch_mm)
        assert check(pieces, mesh) == 3
        corners = pieces.vertices[pieces.cap_faces].astype(float)
        # Vertices lie on the grid's edges, so centres of triangles are farther off.
        centres = corners.mean(axis=1)
        level = np.array([0.3, 0.7])[pieces.cap_level]
        off_mm = np.abs(field.values(centres) - level) * 12.0
        assert off_mm.max() < pitch_mm / 2
        worst.append(off_mm.max())
    assert worst[0] / worst[1] == pytest.approx(4, rel=0.35)
    assert worst[1] / worst[2] == pytest.approx(4, rel=0.35)


def test_volumes_of_shells_of_a_ball():
    mesh = part(Manifold.sphere(10, 128))
    centre = mesh.bounds_mm.mean(axis=0)
    pieces = split(mesh, radial(centre, 10.0), [0.3, 0.6, 0.9], pitch_mm=0.4)
    assert check(pieces, mesh) == 4
    inner = np.cumsum(pieces.volumes_mm3)[:3]
    # A chord of a pitch cuts h^2 / 8 r off; edges reach sqrt(3) pitches.
    np.testing.assert_allclose(inner, 4 / 3 * np.pi * np.array([3, 6, 9]) ** 3, rtol=0.012)
    assert pieces.volumes_mm3.sum() == pytest.approx(mesh.volume_mm3, rel=1e-7)


def test_untouched_triangles_keep_their_bits():
    mesh = part(Manifold.sphere(5, 48))
    field = radial([1, 1, 1], 12.0)
    pieces = split(mesh, field, [0.5], pitch_mm=0.5)
    kept = {pieces.vertices[face].tobytes() for face in pieces.faces}
    missing = [f for f in mesh.faces if mesh.vertices[f].astype(np.float32).tobytes() not in kept]
    below = (field.values(mesh.vertices)[mesh.faces] < 0.5).sum(axis=1)
    crossed = (below > 0) & (below < 3)
    # The interface lies within the grid's error of the level: few more faces can be cut.
    assert len(missing) <= 1.3 * np.count_nonzero(crossed) + 10


def tube():
    ring = CrossSection.circle(2.0, 20).translate((5, 0)) - CrossSection.circle(1.6, 20).translate(
        (5, 0)
    )
    return Manifold.revolve(ring, 40)


SOLIDS = {
    "box": lambda: Manifold.cube([7, 5, 3]),
    "turned box": lambda: Manifold.cube([7, 5, 3]).rotate([10, 20, 30]),
    "hollow ring": tube,
    "drilled ball": lambda: Manifold.sphere(5, 32) - Manifold.cylinder(12, 1.5, 1.5, 24, True),
    "two bodies": lambda: Manifold.cube([3, 3, 3]) + Manifold.sphere(2, 20).translate([8, 1, 1]),
}
FIELDS = {
    "radial": lambda low, size: radial(low + 0.3 * size, float(np.linalg.norm(size))),
    "along z": lambda low, size: FunctionField(lambda p: (p[:, 2] - low[2]) / size[2]),
    "waves": lambda low, size: FunctionField(
        lambda p: 0.5 + 0.5 * np.sin((p - low) @ (5 / size)) * np.cos((p - low)[:, 0] * 4 / size[0])
    ),
    "kinked": lambda low, size: FunctionField(
        lambda p: np.abs((p - low) / size - [0.2, 0.5, 0.7]).max(axis=1)
    ),
    "flat in places": lambda low, size: FunctionField(
        lambda p: np.clip(((p - low) / size).sum(axis=1) - 0.6, 0.25, 0.75)
    ),
}


@pytest.mark.parametrize("solid", SOLIDS)
def test_shells_are_sound_and_fit(solid):
    mesh = part(SOLIDS[solid]())
    low, high = mesh.bounds_mm
    shells = 0
    for make in FIELDS.values():
        # Level 0.5 of "along z" lies in faces and through edges; 0.25 and 0.75 where clipped.
        for levels in ([0.25, 0.5, 0.75], [0.1, 0.31, 0.315, 0.9]):
            pieces = split(mesh, make(low, high - low), levels, pitch_mm=0.7)
            shells += check(pieces, mesh)
    assert shells > 25


def test_a_level_in_a_face_of_the_part():
    mesh = part(Manifold.cube([4, 4, 2]) + Manifold.cube([2, 2, 2]).translate([1, 1, 2]))
    low = mesh.bounds_mm[0]
    field = FunctionField(lambda p: (p[:, 2] - low[2]) / 4.0)
    pieces = split(mesh, field, [0.5], pitch_mm=0.3)
    assert check(pieces, mesh) == 2
    # The level may move by a thousandth of a pitch or two, over 4 mm by 4 mm.
    np.testing.assert_allclose(pieces.volumes_mm3, [32, 8], rtol=0, atol=16 * 0.002)


def test_levels_that_miss_and_no_levels():
    mesh = part(Manifold.cube([3, 3, 3]))
    whole = split(mesh, radial([100, 100, 100], 1000.0), [0.5], pitch_mm=0.5)
    assert check(whole, mesh) == 1
    assert len(whole.cap_faces) == 0
    assert check(split(mesh, radial([1, 1, 1], 10.0), [], pitch_mm=0.5), mesh) == 1


def test_a_level_inside_that_never_meets_the_surface():
    mesh = part(Manifold.cube([4, 4, 4]))
    pieces = split(mesh, radial([3, 3, 3], 10.0), [0.1], pitch_mm=0.2)
    assert check(pieces, mesh) == 2
    assert audit(pieces.vertices[pieces.shell_faces([1])]).bodies == 2
    assert pieces.volumes_mm3[0] == pytest.approx(4 / 3 * np.pi, rel=0.02)


def test_a_field_that_bends_within_a_cell_takes_one_grid(monkeypatch):
    """Pieces are told by the levels that were drawn, not by values between a cell's corners."""
    mesh, tried = part(Manifold.cube((14, 10, 0.4))), []
    waves = FunctionField(lambda at: 0.5 + 0.5 * np.sin(4 * at[:, 0]) * np.cos(0.78 * at[:, 1]))
    divide = cutting._divide_along
    monkeypatch.setattr(cutting, "_divide_along", lambda *given: tried.append(1) or divide(*given))
    found = split(mesh, waves, [0.1, 0.3, 0.5, 0.7, 0.9], pitch_mm=0.94, within_mm=0.1)
    assert check(found, mesh) == 6
    assert len(tried) == 1


def test_same_input_same_bytes():
    mesh = part(Manifold.sphere(5, 32))
    first, second = (split(mesh, radial([1, 2, 3], 9.0), [0.3, 0.6], pitch_mm=0.5) for _ in "ab")
    for name in ("vertices", "faces", "piece", "cap_faces", "cap_level"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


@pytest.mark.parametrize(
    ("pitch_mm", "reason"),
    [(0.0, "above 0"), (-1.0, "above 0"), (np.nan, "finite number"), (1e-4, "or more fits")],
)
def test_pitches_that_cannot_be(pitch_mm, reason):
    mesh = part(Manifold.cube([3, 3, 3]))
    with pytest.raises(ArgumentError, match=reason):
        split(mesh, radial([1, 1, 1], 5.0), [0.5], pitch_mm=pitch_mm)


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (lambda p: np.where(p[:, 0] > 2, np.nan, 0.0), "finite over the part"),
        (lambda p: p, "one number for each"),
    ],
)
def test_fields_without_values(function, reason):
    mesh = part(Manifold.cube([3, 3, 3]))
    with pytest.raises(ArgumentError, match=reason):
        split(mesh, FunctionField(function), [0.5], pitch_mm=0.5)


def test_a_part_that_touches_itself_says_where():
    # Two boxes of different height in contact along an edge: no cut of it is sound.
    apart = Manifold.cube([4, 4, 2]), Manifold.cube([3, 3, 3]).translate([4, 4, 0])
    raw = [solid.to_mesh() for solid in apart]
    count = len(raw[0].vert_properties)
    vertices = np.concatenate([np.asarray(r.vert_properties)[:, :3] for r in raw])
    faces = np.concatenate([raw[0].tri_verts, raw[1].tri_verts + count]).astype(np.int32)
    mesh, _ = moved_to_corner(Mesh(vertices.astype(float), faces))
    with pytest.raises(ArgumentError, match=r"touches itself there") as told:
        split(mesh, radial([5, 5, 0], 4.0), [0.35, 0.5], pitch_mm=0.5)
    assert "(5, 5, " in str(told.value)
