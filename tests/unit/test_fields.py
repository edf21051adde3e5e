"""Fields against what geometry and analysis say they are."""

import hashlib
import math

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold

from planner.errors import ArgumentError
from planner.fields.basic import Field, FunctionField, PlanarField, Ramp
from planner.fields.parse import (
    FieldArguments,
    Setting,
    _ball_region,
    _box_region,
    _half_space,
    _smooth_patch,
    build_field,
)
from planner.fields.solved import geodesic_field, harmonic_field, points_field
from planner.formats.mesh_file import encode_stl
from planner.mesh.distance import triangle_tree
from planner.mesh.mesh import Mesh
from planner.mesh.part import make_part

RNG = np.random.default_rng(5)
ORIGIN = (0.0, 0.0, 0.0)
POINTS = RNG.uniform(-8, 8, (400, 3))


def mesh_of(solid):
    raw = solid.to_mesh()
    return Mesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts))


def built(wish, mesh=None, origin_mm=(0.0, 0.0, 0.0)):
    """A field over a part; over a cube of 2 mm about the origin if none is given."""
    mesh = mesh_of(Manifold.cube([2, 2, 2], True)) if mesh is None else mesh
    return build_field(wish, Setting(mesh, origin_mm, 0.5))


@pytest.mark.parametrize("at_mm", [0.0, 0.137, -0.4219])
def test_distances_from_a_mesh_begin_where_it_meets_the_part(tmp_path, at_mm):
    """However its place lies on the grid that the part is sampled on."""
    sheet = np.array([[at_mm, -5, -5], [at_mm, 5, -5], [at_mm, 0, 9]], dtype=np.float32)
    path = tmp_path / "sheet.stl"
    path.write_bytes(encode_stl(sheet, np.array([[0, 1, 2]]), "sheet"))
    says = built(f"distance: {path}").description()
    assert 0.0 <= says["from_mm"] < 1e-3  # as near as it is sought
    assert says["to_mm"] == pytest.approx(1 + abs(at_mm))


def test_distances_from_a_point_and_a_line():
    point = built("radial: point=1 2 3, from=2, to=6")
    expected = (np.linalg.norm(POINTS - [1, 2, 3], axis=1) - 2) / 4
    np.testing.assert_allclose(point.values(POINTS), expected, rtol=1e-13, atol=1e-13)
    line = built("radial: line=1 2 3 0 3 4, from=6, to=0")
    off = np.linalg.norm(np.cross(POINTS - [1, 2, 3], [0, 0.6, 0.8]), axis=1)
    np.testing.assert_allclose(line.values(POINTS), 1 - off / 6, rtol=1e-13, atol=1e-13)
    assert isinstance(point, Field)
    assert not isinstance(point, PlanarField)
    assert line.description()["span_mm"] == 6.0


@pytest.mark.parametrize(
    ("solid", "text", "least", "most"),
    [
        (Manifold.cylinder(20.0, 10.0, circular_segments=128), "radial: line=0 0 0 0 0 1", 0, 10),
        (Manifold.sphere(30.0, 64), "radial: point=0 0 0", 0, 30),
        (Manifold.cube([120.0, 120.0, 4.0]), "radial: point=60 60 60", 56, math.sqrt(10_800)),
        (
            Manifold.cylinder(40.0, 10.0, circular_segments=128)
            - Manifold.cylinder(50.0, 4.0, circular_segments=128).translate((0.0, 0.0, -5.0)),
            "radial: line=0 0 0 0 0 1",
            4,
            10,
        ),
    ],
)
def test_radii_run_over_those_of_the_part(solid, text, least, most):
    """To a micrometre or two: cells of the part are halved about the least, float32 the rest."""
    says = built(text, mesh_of(solid)).description()
    assert says["from_mm"] == pytest.approx(least, abs=2e-3)
    assert says["to_mm"] == pytest.approx(most, abs=1e-4)


def test_radii_from_a_place_on_the_surface_begin_at_it():
    """However it lies on the grid of samples: in a face, on an edge, on walls thinner than a cell.

    To two micrometres, as above; the greatest is that of a vertex.
    """
    rng = np.random.default_rng(8)
    cups = [
        (Manifold.cylinder(height, 30.0, 20.0, 24) - Manifold.cylinder(height, 29.0, 19.0, 24))
        .rotate((20, 40, 60))
        for height in (20.0, 150.0)
    ]  # fmt: skip
    for solid in (*cups, Manifold.cube([97, 16, 20.0])):
        mesh = mesh_of(solid)
        for corners in rng.choice(mesh.triangles, 4):
            for shares in ((0.3, 0.5, 0.2), (0.3, 0.7, 0.0)):
                place = shares @ corners
                says = built(f"radial: point={' '.join(map(str, place))}", mesh).description()
                assert 0.0 <= says["from_mm"] < 2e-3
                most = np.linalg.norm(mesh.vertices - place, axis=1).max()
                assert says["to_mm"] == pytest.approx(most, abs=1e-9)


def brute_force(triangles, points):
    """Distances by projection on each plane, edge and vertex, one after the other."""
    best = np.full(len(points), np.inf)
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        height = (points - a) @ normal
        foot = points - height[:, None] * normal
        inside = np.all(
            [np.cross(q - p, foot - p) @ normal >= 0 for p, q in ((a, b), (b, c), (c, a))], axis=0
        )
        best = np.where(inside, np.minimum(best, np.abs(height)), best)
        for p, q in ((a, b), (b, c), (c, a)):
            share = np.clip((points - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            best = np.minimum(best, np.linalg.norm(points - p - share[:, None] * (q - p), axis=1))
    return best


def test_nearest_triangle_is_the_nearest_of_all():
    mesh = mesh_of(Manifold.sphere(4, 20) - Manifold.cube([9, 2, 2], True))
    distance, outside = triangle_tree(mesh).distances(POINTS)
    np.testing.assert_allclose(distance, brute_force(mesh.triangles, POINTS), atol=1e-12)
    # Sharp edges and a hole: what is inside comes from the construction.
    in_slot = (np.abs(POINTS[:, 1]) < 1) & (np.abs(POINTS[:, 2]) < 1)
    radius = np.linalg.norm(POINTS, axis=1)
    np.testing.assert_array_equal(outside[in_slot], True)
    np.testing.assert_array_equal(outside[radius > 4], True)
    # The inscribed ball of 20 segments around has cos(pi / 20)^2 of the radius.
    assert not outside[(radius < 3.9) & ~in_slot].any()


@pytest.mark.parametrize("count", [1, 2, 3, 64, 77])
def test_a_tree_has_every_triangle_and_boxes_that_hold_them(count):
    sphere = mesh_of(Manifold.sphere(4, 20))
    tree = triangle_tree(Mesh(sphere.vertices, sphere.faces[:count]))
    assert set(tree.order.tolist()) == set(range(count))
    np.testing.assert_array_equal(tree.corners, sphere.triangles[tree.order])
    for node in range(1, len(tree.box)):
        assert (tree.box[(node - 1) // 2, 0] <= tree.box[node, 0]).all()
        assert (tree.box[(node - 1) // 2, 1] >= tree.box[node, 1]).all()
    leaves = tree.box[len(tree.box) // 2 :]
    held = tree.corners.reshape(len(leaves), -1, 3)
    np.testing.assert_array_equal(leaves, np.stack([held.min(axis=1), held.max(axis=1)], axis=1))


def test_depth_below_a_surface():
    mesh = mesh_of(Manifold.sphere(5, 200))
    depth = built("distance: surface, to=5", mesh)
    expected = 1 - np.linalg.norm(POINTS, axis=1) / 5
    # Facets of 200 segments lie up to 5 (1 - cos(pi / 200)^2) = 1.2e-3 mm inside the ball.
    np.testing.assert_allclose(depth.values(POINTS), expected, atol=4e-4)


def test_the_wall_of_a_hole_and_faces_in_a_box():
    mesh = mesh_of(Manifold.cube([10, 10, 4], True) - Manifold.cylinder(6, 2, 2, 60, True))
    wall = _smooth_patch(mesh, np.array([1.9, 0.0, 0.5]))
    radii = np.linalg.norm(wall.triangles[..., :2], axis=-1)
    np.testing.assert_allclose(radii, 2, atol=1e-6)  # float32 of manifold3d
    assert wall.area_mm2 == pytest.approx(2 * np.pi * 2 * 4, rel=2e-3)
    top = built("distance: box=-6 -6 1.9 6 6 2.1, from=0, to=1", mesh)
    # Above it, below it, beside it, and over the hole, which is a polygon of 60 sides.
    points = np.array([[3.0, 3.0, 2.5], [3.0, 3.0, -2.0], [6.0, 0.0, 2.0], [0.0, 0.0, 2.0]])
    np.testing.assert_allclose(top.values(points), [0.5, 4.0, 1.0, 2.0], rtol=2e-3)


def test_harmonic_field_of_a_bar_is_linear_at_first_order():
    mesh = mesh_of(Manifold.cube([12, 3, 3]))
    worst = []
    for pitch_mm in (0.5, 0.25):
        field = harmonic_field(
            mesh,
            _half_space((2, 0, 0), (-1, 0, 0)),
            _box_region((10, -1, -1), (13, 4, 4)),
            pitch_mm,
            (0.0, 0.0, 0.0),
        )
        points = RNG.uniform([2, 0.5, 0.5], [10, 2.5, 2.5], (300, 3))
        worst.append(8 * np.abs(field.values(points) - (points[:, 0] - 2) / 8).max())
        assert worst[-1] < pitch_mm
    assert worst[1] < 0.7 * worst[0]


def test_harmonic_field_of_a_ring_segment_follows_the_bend():
    ring = CrossSection.circle(6, 90) - CrossSection.circle(4, 90)
    half = ring ^ CrossSection.square((20, 10)).translate((-10, 0))
    mesh = mesh_of(half.extrude(2))
    start, end = _half_space((0, 0.3, 0), (0, -1, 0)), _ball_region((-5, 0, 1), 1.6)
    start_only = _box_region((3, -1, -1), (7, 0.3, 3))
    assert start.holds(np.array([[5.0, 0.0, 1.0]])).all()
    field = harmonic_field(mesh, start_only, end, 0.2, (0.0, 0.0, 0.0))
    angle = np.linspace(0.3, 2.5, 12)
    along = field.values(5 * np.stack([np.cos(angle), np.sin(angle), 0.2 + 0 * angle], axis=1))
    assert (np.diff(along) > 0).all()
    # Between the ends the flow is steady: the field rises evenly with the angle.
    assert np.ptp(np.diff(along)[2:-2]) < 0.1 * np.diff(along).mean()


def test_geodesic_distance_goes_round_the_corner():
    mesh = mesh_of(Manifold.cube([10, 10, 2]) - Manifold.cube([8, 8, 4]).translate([2, 2, -1]))
    for pitch_mm in (0.25, 0.125):
        field = geodesic_field(mesh, _ball_region((1, 9, 1), 0.5), pitch_mm, (0.0, 1.0), ORIGIN)
        # Straight to the inner corner at (2, 2), then straight on.
        length = np.hypot(1, 7) + np.hypot(7, 1) - 0.5
        assert abs(field.values(np.array([[9.0, 1.0, 1.0]]))[0] - length) < 0.5 * pitch_mm


def test_geodesic_distance_hugs_a_curved_wall_at_any_pitch():
    ring = Manifold.cylinder(2, 14, 14, 360) - Manifold.cylinder(4, 10, 10, 360).translate(
        [0, 0, -1]
    )
    mesh = mesh_of(ring - Manifold.cube([30, 30, 4]).translate([0, -30, -1]))
    start = _box_region((9, -1, -1), (15, 0.4, 3))
    angle, radius = np.radians(np.linspace(60, 265, 40))[:, None], np.array([10.4, 12.0, 13.6])
    # From the start's edge to the inner wall, along it, and off it on a tangent.
    length = np.sqrt(radius**2 - 100) + 10 * (angle - np.arccos(10 / radius)) - 0.4
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    points = np.stack([x, y, np.full_like(x, 1.03)], axis=-1).reshape(-1, 3)
    # A cell from the start, and half a cell by which middles of cells lie off the wall, a radian.
    cells = 1.0 + 0.5 * (angle - np.arccos(10 / radius)).ravel()
    for pitch_mm in (0.4, 0.2):
        field = geodesic_field(mesh, start, pitch_mm, (0.0, 1.0), ORIGIN)
        off = field.values(points) - length.ravel()
        assert (np.abs(off) < cells * pitch_mm).all()


def test_geodesic_distance_goes_round_a_ball_and_round_slits():
    hollow = Manifold.sphere(9, 120) - Manifold.sphere(7, 120)
    angle = np.linspace(1.0, 3.0, 20)
    points = 7.6 * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    # On a tangent to the inner wall, along it, and off it.
    length = 2 * np.sqrt(7.6**2 - 49) + 7 * (angle - 2 * np.arccos(7 / 7.6)) - 0.6
    start = _ball_region((0, 0, 7.6), 0.6)
    field = geodesic_field(mesh_of(hollow), start, 0.3, (0.0, 1.0), ORIGIN)
    assert np.abs(field.values(points) - length).max() < (1.0 + 0.5 * 2.2) * 0.3
    # A slit that is hardly wider than a cell is a wall at any slope.
    for turn in np.radians([0.0, 33.0, 45.0]):
        slit = Manifold.cube([10, 0.3, 3]).translate([-1, 4.9, -1])
        mesh = mesh_of((Manifold.cube([10, 10, 1]) - slit).rotate([0, 0, np.degrees(turn)]))
        along, across = np.array(
            [[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0]]
        )
        begin, end = (along + y * across + [0, 0, 0.5] for y in (4, 6))
        field = geodesic_field(mesh, _ball_region(begin, 0.5), 0.25, (0.0, 1.0), ORIGIN)
        length = np.hypot(8, 0.9) + 0.3 + np.hypot(8, 0.8) - 0.5
        assert abs(field.values(end[None])[0] - length) < (1.0 + 0.5 * np.pi) * 0.25


def test_geodesic_distance_jumps_nowhere():
    """Where a straight way and one with many bends meet, both are as long."""
    maze = Manifold.cube([39, 13, 2]).translate([0, 35, 0])
    for n in range(9):
        maze -= Manifold.cube([1, 10, 4]).translate([3 + 4 * n, 35 + 3 * (n % 2), -1])
    maze += Manifold.cube([3, 36, 2]) + Manifold.cube([3, 36, 2]).translate([36, 0, 0])
    mesh = mesh_of(maze + Manifold.cube([39, 3, 2]))
    for pitch_mm in (1.0, 0.5):
        field = geodesic_field(mesh, _ball_region((1, 36, 1), 0.9), pitch_mm, (0.0, 1.0), ORIGIN)
        y = np.arange(1.0, 47.0, pitch_mm)  # along the corridor where they meet
        found = field.values(np.stack([np.full_like(y, 37.5), y, np.ones_like(y)], axis=1))
        # A pitch farther is a pitch longer, but for the cells' own steps.
        assert np.abs(np.diff(found)).max() < 1.5 * pitch_mm


def test_regions(tmp_path):
    cube, file = mesh_of(Manifold.cube([2, 2, 2], True)), tmp_path / "cube.stl"
    file.write_bytes(encode_stl(cube.vertices.astype(np.float32), cube.faces, "cube in mm"))
    inside = FieldArguments("harmonic", (), {"to": str(file)}, (0.0, 0.0, 0.0)).region("to")
    found = inside.holds(POINTS / 4)
    np.testing.assert_array_equal(found, (np.abs(POINTS / 4) < 1).all(axis=1))
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    assert inside.says == {"file": "cube.stl", "sha256": sha256}


@pytest.mark.parametrize(
    ("start", "end", "reason"),
    [
        (_half_space((-9, 0, 0), (-1, 0, 0)), _ball_region((0, 0, 0), 9), "from= holds nothing"),
        (_ball_region((0, 0, 0), 1), _ball_region((0, 0, 0), 1), "must lie apart"),
        (_box_region((0, 0, 0), (1, 1, 1)), _box_region((2, 2, 2), (3, 3, 3)), "touches neither"),
    ],
)
def test_regions_between_which_nothing_flows(start, end, reason):
    mesh = mesh_of(Manifold.cube([3, 3, 3]) + Manifold.cube([3, 3, 3]).translate([9, 0, 0]))
    with pytest.raises(ArgumentError, match=reason):
        harmonic_field(mesh, start, end, 0.25, (0.0, 0.0, 0.0))
    with pytest.raises(ArgumentError, match=r"no way leads|holds nothing"):
        geodesic_field(mesh, start, 0.25, (None, None), ORIGIN)


def test_expressions_are_what_numpy_computes():
    x, y, z = POINTS.T
    cases = {
        "0.5 + 0.5*sin(2*pi*x/20)": 0.5 + 0.5 * np.sin(2 * np.pi * x / 20),
        "-x**2 + y^2 % 3": -(x**2) + y**2 % 3,
        "clamp(r/10, 0, 1)": np.clip(np.hypot(x, y) / 10, 0, 1),
        "min(x, max(y, -z))": np.minimum(x, np.maximum(y, -z)),
        "atan2(y, x) / e": np.arctan2(y, x) / np.e,
        "1": np.ones(len(x)),
    }
    for text, expected in cases.items():
        found = built(f"expression: {text}").values(POINTS)
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13, err_msg=text)
    moved = built("expression: x", origin_mm=(5.0, 0.0, 0.0))
    np.testing.assert_allclose(moved.values(POINTS), x - 5)
    cube = mesh_of(Manifold.cube([8, 6, 4], True))
    within = POINTS / 4 * [1, 0, 0]
    np.testing.assert_allclose(
        built("expression: u + d", cube).values(within), (within[:, 0] + 4) / 8 + 2, atol=1e-12
    )


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')", "x.real", "(lambda: 1)()", "[x for x in y]", "x if y else z", "x < y",
        "x and y", "f'{x}'", "'a'", "x[0]", "(x := 1)", "sin(*x)", "sin(x, out=y)", "sin", "q",
        "sine(x)", "sin()", "sin(x, y)", "1 +", "", "x y", "True", "1j", "x // 2", "~x", "x @ y",
        "print(x)", "()", "x, y", "x; y", "\0", "9" * 2000, "9" * 900,
        "-" * 90 + "x",
    ],
)  # fmt: skip
def test_what_is_no_formula_is_refused(text):
    with pytest.raises(ArgumentError, match="expression"):
        built(f"expression: {text}")
    with pytest.raises(ArgumentError):
        built(f"expression: {text}+ evil")


@pytest.mark.parametrize(
    "text",
    ["expression: -x**2 - (y - 1)", "radial: point=-1 2 -3", "harmonic: from=z<-0.5, to=z>0.5"],
)
def test_the_minus_of_print_is_a_minus(text):
    printed = text.replace("-", "\N{MINUS SIGN}")
    cube = mesh_of(Manifold.cube([2, 2, 2], True))
    within = POINTS / 40
    np.testing.assert_array_equal(
        built(printed, cube).values(within), built(text, cube).values(within)
    )


def test_a_name_that_is_a_slip():
    with pytest.raises(ArgumentError, match="did you mean sqrt"):
        built("expression: sqr(x)")


def test_scattered_values_are_kept_and_stay_in_range():
    at = RNG.uniform(0, 1, (300, 3))
    value = at @ [1.0, 2.0, 3.0]
    field = points_field(
        {"file": "p.csv", "sha256": "0"}, np.concatenate([at, at]), np.tile(value, 2), (0.0, 1.0)
    )
    np.testing.assert_allclose(field.values(at), value, rtol=1e-6)
    between = RNG.uniform(0.2, 0.8, (500, 3))
    found = field.values(between)
    # Linear values are met: those of places within are far from the ends of the range.
    assert np.abs(found - between @ [1, 2, 3]).max() < 1e-9
    assert found.min() >= value.min()
    assert found.max() <= value.max()
    with pytest.raises(ArgumentError, match="4 or more"):
        points_field({"file": "p.csv", "sha256": "0"}, at[:3], value[:3], (None, None))


def test_scattered_values_change_no_faster_than_they_are_apart():
    """Also where the nearest change, and beside places that are given twice, nearly."""
    at = np.random.default_rng(1).uniform(0, 1, (200, 3))
    value = np.sin(9.0 * at).sum(axis=1)
    twice = np.concatenate([at, at + 1e-6]), np.concatenate([value, value + 0.05])
    line = np.array([0.1, 0.2, 0.3]) + np.linspace(0, 1, 200_001)[:, None] * [0.7, 0.5, 0.6]
    for points, values, most in ((at, value, 0.01), (*twice, 0.02)):
        field = points_field({"file": "p.csv"}, points, values, (0.0, 1.0))
        # Steps of 5e-6: the values change by some 16 a unit, 0.0001 a step.
        assert np.abs(np.diff(field.values(line))).max() < most


@pytest.mark.parametrize("uneven", [0.0, 0.02], ids=["even", "uneven"])
@pytest.mark.parametrize("step_mm", [(5.0, 5.0, 1.0), (6.0, 1.0, 1.0), (1.0, 10.0, 10.0)])
def test_scattered_values_are_met_on_grids_that_are_finer_one_way(
    step_mm: tuple[float, float, float], uneven: float
) -> None:
    """As meshes of plates and beams are: the nearest places then lie in a plane or on a line."""
    at = np.argwhere(np.ones((7, 7, 7))) * step_mm
    at += uneven * RNG.uniform(-1, 1, at.shape) * step_mm
    between = RNG.uniform(1.5, 4.5, (500, 3)) * step_mm
    linear = np.array([1.0, 2.0, 3.0]) / step_mm / 36.0
    field = points_field({"file": "p.csv"}, at, at @ linear, (0.0, 1.0))
    # Solved in one step each: rounding is all that is left.
    np.testing.assert_allclose(field.values(between), between @ linear, atol=1e-9)


@pytest.mark.parametrize("flat", [[1.0, 1.0, 0.0], [1.0, 0.0, 0.0]], ids=["plane", "line"])
def test_scattered_values_of_a_plane_or_a_line_go_on_even_aside(flat: list[float]) -> None:
    at = RNG.uniform(0, 1, (300, 3)) * flat
    field = points_field({"file": "p.csv"}, at, at @ [1.0, 2.0, 3.0], (0.0, 1.0))
    between = RNG.uniform(0.2, 0.8, (200, 3)) * flat
    aside = field.values(between + np.array([0.0, 0.0, 1e-3]))
    assert np.quantile(np.abs(aside - between @ [1.0, 2.0, 3.0]), 0.9) < 1e-3


def test_fields_made_of_fields():
    x, y, _ = POINTS.T
    first, second = "expression: x", "expression: y"
    cases = {
        f"min({first}; {second})": np.minimum(x, y),
        f"max({first}; {second})": np.maximum(x, y),
        f"blend({first}; {second}; 0.25)": 0.75 * x + 0.25 * y,
        f"clamp({first}; -1; 2)": np.clip(x, -1, 2),
    }
    for wish, expected in cases.items():
        field = built(wish)
        np.testing.assert_allclose(field.values(POINTS), expected)
        assert len(field.description()["fields"]) in (1, 2)


def test_a_function_of_the_parts_own_coordinates():
    field = built(lambda points: points[:, 0], origin_mm=(5.0, 0.0, 0.0))
    np.testing.assert_allclose(field.values(POINTS), POINTS[:, 0] - 5)
    assert field.description()["function"].endswith("<lambda>")
    assert built(FunctionField("own", np.sin)).name == "own"


@pytest.mark.parametrize(("start", "stop"), [(1.0, 1.0), (np.nan, 1.0), (0.0, np.inf)])
def test_ramps_that_are_none(start, stop):
    with pytest.raises(ArgumentError, match="must be finite and differ"):
        Ramp(start, stop)


def test_depth_where_bodies_touch_and_in_cavities():
    """Faces where two bodies touch are no surface of the part: it is printed as one block."""

    def corners_of(size, at):
        found = Manifold.cube(size).translate(at).to_mesh()
        return np.asarray(found.vert_properties)[:, :3][np.asarray(found.tri_verts)]

    touching = [corners_of([8, 8, 8], [0, 0, 0]), corners_of([6, 6, 6], [8, 1, 1])]
    one = make_part(np.concatenate(touching), name="p").mesh
    depth = built("distance: surface, from=0, to=8", one)
    inside = np.array(
        [[4.0, 4, 4], [7.9, 4, 4], [8.1, 4, 4], [11, 4, 4], [15, 4, 4], [8.5, 0.5, 4]]
    )
    expected = np.array([4.0, np.hypot(3, 0.1), 3, 3, -1, -0.5])
    np.testing.assert_allclose(depth.values(inside) * 8, expected, atol=1e-12)

    nested = [
        corners_of([8, 8, 8], [0, 0, 0]),
        corners_of([6, 6, 6], [1, 1, 1])[:, ::-1],
        corners_of([2, 2, 2], [3, 3, 3]),
    ]
    hollow = make_part(np.concatenate(nested), name="p").mesh
    depth = built("distance: surface, from=0, to=1", hollow)
    at = np.array([[0.5, 4, 4], [2, 4, 4], [4, 4, 4]])  # wall, cavity, what lies in it
    np.testing.assert_allclose(depth.values(at), [0.5, -1, 1], atol=1e-12)
