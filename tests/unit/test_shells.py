import numpy as np
import pytest
from manifold3d import CrossSection, Error, Manifold
from manifold3d import Mesh as SolidMesh

from benchmarks.audit import audit
from planner.cutting.pieces import split
from planner.cutting.planes import flip_thin
from planner.errors import ArgumentError, MeshError
from planner.fields.basic import axis_field
from planner.grading.check import interfaces_cancel
from planner.mesh.mesh import Mesh, join_shells, weld
from planner.mesh.part import moved_to_corner


def part(solid):
    mesh = solid.to_mesh()
    return moved_to_corner(
        Mesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))
    )[0]


def check(pieces, mesh):
    """Audit every shell as its reader sees it; return how many are not empty."""
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    soups = [soup for soup in soups if len(soup)]
    for soup in soups:
        assert audit(soup).sound
        vertices, faces = weld(soup)
        assert Manifold(SolidMesh(vertices, faces.astype(np.uint32))).status() == Error.NoError
    assert interfaces_cancel(join_shells(soups), mesh)
    assert len(np.unique(pieces.vertices, axis=0)) == len(pieces.vertices)
    return len(soups)


def test_box_into_thirds():
    mesh = part(Manifold.cube([6, 2, 3]))
    pieces = split(mesh, axis_field("x", mesh), [1 / 3, 2 / 3])
    assert check(pieces, mesh) == 3
    # The corner is at 1 mm: cuts at 3 and 5 mm are exact.
    np.testing.assert_allclose(pieces.volumes_mm3, 12, rtol=1e-14)
    bounds_mm = pieces.bounds_mm
    np.testing.assert_array_equal(bounds_mm[:, 0, 0], [1, 3, 5])
    np.testing.assert_array_equal(bounds_mm[:, 1], [[3, 3, 4], [5, 3, 4], [7, 3, 4]])


def test_direction_turned_round_reverses_the_pieces():
    mesh = part(Manifold.sphere(5, 40))
    up, down = (split(mesh, axis_field(axis, mesh), [0.2, 0.5]).volumes_mm3 for axis in ("z", "-z"))
    # A cap of height h has volume pi h^2 (15 - h) / 3; 40 segments fall short by about 1 %.
    assert up[0] == pytest.approx(np.pi * 2**2 * (15 - 2) / 3, rel=0.05)
    np.testing.assert_allclose(down[:2], up[:2], rtol=1e-6)


def test_untouched_triangles_keep_their_bits():
    mesh = part(Manifold.sphere(5, 64))
    pieces = split(mesh, axis_field("0.2,0.3,1", mesh), [0.3, 0.31, 0.8])
    kept = {face.tobytes() for face in pieces.faces}
    np.testing.assert_array_equal(pieces.vertices[: len(mesh.vertices)], mesh.vertices)
    missing = [face for face in mesh.faces if face.tobytes() not in kept]
    crossed = np.ptp(
        np.searchsorted(
            [0.3, 0.31, 0.8], axis_field("0.2,0.3,1", mesh).values(mesh.vertices)
        )[mesh.faces],
        axis=1,
    )  # fmt: skip
    assert len(missing) == np.count_nonzero(crossed)


def test_faces_in_the_plane_of_a_level_belong_to_the_material():
    steps = (
        Manifold.cube([3, 3, 1])
        + Manifold.cube([2, 2, 1]).translate([0, 0, 1])
        + Manifold.cube([4, 4, 1]).translate([-1, -1, 2])
    )
    mesh = part(steps)
    pieces = split(mesh, axis_field("z", mesh), [1 / 3, 2 / 3])
    assert check(pieces, mesh) == 3
    np.testing.assert_allclose(pieces.volumes_mm3, [9, 4, 16], rtol=1e-14)
    np.testing.assert_array_equal(pieces.bounds_mm[:, :, 2], [[1, 2], [2, 3], [3, 4]])
    # Interfaces cover the narrow step only: 2 mm by 2 mm on both levels.
    soup = pieces.vertices[pieces.cap_faces].astype(float)
    normal = np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0])
    assert normal[:, 2].sum() / 2 == pytest.approx(8, rel=1e-14)
    assert (normal[:, 2] > 0).all()


@pytest.mark.parametrize("groove", ["into the top", "into the bottom", "both"])
def test_groove_whose_bottom_lies_in_a_level(groove):
    # A cap's diagonal along the groove's bottom would be an edge of four faces.
    wedge = CrossSection([[[-1, 1], [0, 0], [1, 1]]]).extrude(4).rotate([90, 0, 0])
    solid = Manifold.cube([4, 4, 2]).translate([-2, -4, -1])
    if groove != "into the bottom":
        solid -= wedge
    if groove != "into the top":
        solid -= wedge.rotate([0, 180, 0]).translate([1, 0, 0])
    mesh = part(solid)
    pieces = split(mesh, axis_field("z", mesh), [0.5])
    assert check(pieces, mesh) == 2
    # One groove takes half of 2 mm by 1 mm out of 4 mm by 1 mm, over 4 mm.
    expected = {"into the top": [16, 12], "into the bottom": [12, 16], "both": [12, 12]}
    np.testing.assert_allclose(pieces.volumes_mm3, expected[groove], rtol=1e-12)


def test_loops_that_touch_at_a_vertex():
    # An octahedral cavity's widest outline touches the box's wall at one vertex.
    cavity = Manifold.sphere(1, 4)
    solid = (
        Manifold.cube([4, 4, 4], True)
        - cavity.translate([0.5, 0, 0])
        - cavity.translate([-1.5, 0, 0]).scale([0.9, 1, 1])
    )
    mesh = part(solid)
    for levels in ([0.5], [0.25, 0.5, 0.75]):
        check(split(mesh, axis_field("z", mesh), levels), mesh)


def test_levels_through_every_vertex():
    mesh = part(Manifold.sphere(10, 24).rotate([10, 20, 30]))
    for axis in ("x", "1,1,0", "3,-1,2"):
        field = axis_field(axis, mesh)
        values = np.unique(field.values(mesh.vertices))
        levels = [0.0]
        for value in values:
            if 1e-3 / field.span_mm < value - levels[-1] and value < 1:
                levels.append(float(value))
        assert len(levels) > 10
        check(split(mesh, field, levels[1:]), mesh)


def test_levels_very_near_each_other_on_a_large_part():
    mesh = part(Manifold.sphere(200, 48).rotate([5, 6, 7]))
    field = axis_field("1,2,3", mesh)
    levels = 0.5 + np.arange(6) * 2e-4 / field.span_mm
    assert check(split(mesh, field, levels), mesh) == 7


def test_holes_nested_loops_and_many_bodies():
    tube = Manifold.cylinder(10, 4, 4, 30) - Manifold.cylinder(10, 3, 3, 30)
    core = Manifold.cylinder(10, 2, 2, 30) - Manifold.cylinder(10, 1, 1, 30)
    mesh = part(tube + core + (tube + core).translate([20, 0, 3]))
    pieces = split(mesh, axis_field("z", mesh), [0.1, 0.5, 0.9])
    assert check(pieces, mesh) == 4
    assert audit(pieces.vertices[pieces.shell_faces([1, 2])]).bodies == 4


@pytest.mark.long
def test_genus_above_100():
    def solid(x, y, z):
        waves = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
        return 0.6 - abs(waves)

    side = 6 * np.pi
    mesh = part(Manifold.level_set(solid, [0, 0, 0, side, side, side], 0.35))
    whole = audit(mesh.triangles.astype(np.float32))
    assert whole.sound
    assert (2 * whole.bodies - whole.vertices + whole.triangles // 2) // 2 > 100
    for axis in ("x", "1,2,3"):
        assert check(split(mesh, axis_field(axis, mesh), np.arange(1, 10) / 10), mesh) == 10


def test_union_of_pieces():
    mesh = part(Manifold.sphere(5, 32))
    pieces = split(mesh, axis_field("z", mesh), [0.25, 0.5, 0.75])
    volumes = pieces.volumes_mm3
    for members in ([0, 1], [0, 2], [1, 2, 3], [0, 1, 2, 3]):
        found = audit(pieces.vertices[pieces.shell_faces(members)])
        assert found.sound
        assert found.volume_mm3 == pytest.approx(volumes[members].sum(), rel=1e-12)
    assert len(pieces.shell_faces([0, 1, 2, 3])) == len(pieces.faces)
    assert len(pieces.shell_faces([])) == 0


def test_levels_that_miss_and_no_levels():
    mesh = part(Manifold.cube([1, 1, 1]) + Manifold.cube([1, 1, 1]).translate([9, 0, 0]))
    pieces = split(mesh, axis_field("x", mesh), [0.3, 0.6])
    assert check(pieces, mesh) == 2
    assert len(pieces.cap_faces) == 0
    np.testing.assert_allclose(pieces.volumes_mm3, [1, 0, 1], rtol=1e-14)
    assert np.isnan(pieces.bounds_mm[1]).all()
    whole = split(mesh, axis_field("x", mesh), [])
    np.testing.assert_array_equal(whole.faces, mesh.faces)


def test_same_input_same_bytes():
    mesh = part(Manifold.sphere(5, 64))
    first, second = (split(mesh, axis_field("1,2,3", mesh), [0.2, 0.7]) for _ in range(2))
    for name in ("vertices", "faces", "piece", "cap_faces", "cap_level"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


BOX = part(Manifold.cube([100, 1, 1]))


@pytest.mark.parametrize(
    ("levels", "reason"),
    [
        ([0.5, 0.2], "increase"), ([0.5, 0.5], "increase"), ([0.5, 0.5 + 1e-8], "increase"),
        ([0.0], "between 0 and 1"), ([1.0], "between 0 and 1"), ([np.nan], "between 0 and 1"),
    ],
)  # fmt: skip
def test_levels_that_cannot_be_cut(levels, reason):
    with pytest.raises(ArgumentError, match=reason):
        split(BOX, axis_field("x", BOX), levels)


def test_positions_that_float32_cannot_hold():
    mesh = Mesh(BOX.vertices + 0.1, BOX.faces)
    with pytest.raises(ArgumentError, match="float32"):
        split(mesh, axis_field("x", mesh), [0.5])


def test_open_part_says_where():
    with pytest.raises(MeshError, match=r"open near \("):
        split(Mesh(BOX.vertices, BOX.faces[1:]), axis_field("x", BOX), [0.5])


@pytest.mark.parametrize(("reach", "flipped"), [(0.2, False), (40.0, True)])
def test_a_thin_triangle_is_flipped_where_that_folds_nothing(reach: float, flipped: bool) -> None:
    """Seen from c, d hides behind the corner a, unless it lies lower: then they see each other."""
    h = 1e-7  # mm: under a quarter of the lattice
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.5, h, 0], [-1, -reach * h, 0]], np.float32)
    faces = np.array([[0, 1, 2], [1, 0, 3]], np.int32)
    flip_thin(vertices, faces)
    assert faces.tolist() == ([[2, 0, 3], [3, 1, 2]] if flipped else [[0, 1, 2], [1, 0, 3]])
