"""Thin walls: what must be found, what must not, and how large it is said to be.

Plates, pins and wedges of known thickness, in many directions; minimum wall 0.6 mm throughout.
"""

from dataclasses import replace
from types import SimpleNamespace

import manifold3d
import numpy as np
import pytest
import trimesh

from planner.errors import ArgumentError
from planner.fields.basic import axis_field
from planner.mesh.mesh import Mesh
from planner.voxels.thin_places import PlanarBand, raster_for, thin_places, thin_walls

WALL = 0.6
SHORT = 0.02 * WALL  # sizes are short of the true ones by at most this
DIRECTIONS = [(0, 0, 1), (1, 0, 0), (0, 1, 0), (1, 1, 0), (1, 1, 1), (1, 2, 3), (-3, 1, 0.5)]


def mesh_of(*bodies: trimesh.Trimesh) -> Mesh:
    body = trimesh.util.concatenate(bodies)
    return Mesh(np.asarray(body.vertices), np.asarray(body.faces, dtype=np.int32))


def box(extents, centre=(0.0, 0.0, 0.0), normal=(0, 0, 1)) -> trimesh.Trimesh:
    """A box whose third axis points along `normal`."""
    body = trimesh.creation.box(extents)
    body.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), normal))
    body.apply_translation(centre)
    return body


def wedge(degrees: float, height=6.0, width=4.0) -> trimesh.Trimesh:
    """A prism with its sharp edge along z at x = 0."""
    half = height * np.tan(np.radians(degrees / 2))
    corners = np.array([[0, 0], [height, -half], [height, half]])
    return trimesh.creation.extrude_triangulation(corners, np.array([[0, 1, 2]]), width)


def findings(mesh: Mesh, axis="x", levels=(), materials=("only",), **options):
    return thin_walls(mesh, axis_field(axis, mesh), levels, materials, WALL, **options)


@pytest.mark.parametrize("normal", DIRECTIONS)
@pytest.mark.parametrize("thickness", [0.02, 0.2, 0.4, 0.5])
def test_thin_plate_is_found_in_any_direction(normal, thickness):
    (finding,) = findings(mesh_of(box((8, 6, thickness), normal=normal)))
    assert finding.kind == "thin-wall"
    assert thickness - SHORT <= finding.size_mm <= thickness + 1e-6
    n = np.array(normal) / np.linalg.norm(normal)
    assert abs(finding.place_mm @ n) <= SHORT  # on the middle plane
    if thickness >= 0.2:  # volumes of thinner sheets are in whole voxels
        assert finding.volume_mm3 == pytest.approx(48 * thickness, rel=0.15)


@pytest.mark.parametrize("normal", DIRECTIONS)
@pytest.mark.parametrize("thickness", [0.6, 0.65, 1.0])
def test_plate_of_the_minimum_wall_or_more_is_not_reported(normal, thickness):
    assert findings(mesh_of(box((8, 6, thickness), centre=(0.01, 0.02, 0.03), normal=normal))) == ()


@pytest.mark.parametrize("normal", DIRECTIONS)
def test_edges_and_corners_of_a_cube_are_not_reported(normal):
    assert findings(mesh_of(box((5, 5, 5), normal=normal))) == ()


def test_sphere_and_obtuse_wedge_are_not_reported():
    assert findings(mesh_of(trimesh.creation.icosphere(4, 3.0))) == ()
    assert findings(mesh_of(wedge(60))) == ()


def dog_bone() -> Mesh:
    """A bar of 115 x 19 x 4 mm with a neck of 33 x 6 mm between shoulders of 14 mm radius."""
    turn = np.linspace(0, np.pi / 3, 12)
    shoulder = np.column_stack([16.5 + 14 * np.sin(turn), 3 + 14 * (1 - np.cos(turn))])
    right = np.concatenate([shoulder[:-1], [[28, 9.5], [57.5, 9.5]]])
    upper = np.concatenate([right[::-1], right * [-1, 1]])
    outline = np.concatenate([upper, (upper * [1, -1])[::-1]])
    solid = manifold3d.CrossSection([outline]).extrude(4.0).to_mesh()
    return Mesh(solid.vert_properties[:, :3].astype(np.float64), solid.tri_verts.astype(np.int32))


@pytest.mark.parametrize("axis", ["x", (1, 1, 0), (1, 1, 1)])
def test_dog_bone_with_bands_is_not_reported(axis):
    """Nine materials in straight and oblique bands of about 13 mm."""
    mesh = dog_bone()
    assert mesh.bounds_mm[1] - mesh.bounds_mm[0] == pytest.approx((115, 19, 4))
    assert findings(mesh, axis, np.linspace(0, 1, 10)[1:-1], range(9)) == ()


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_tip_of_a_wedge_is_found_where_it_is_thin(turn):
    """At 20 degrees the ball of 0.6 mm sits 1.73 mm from the edge; the place begins there."""
    body = wedge(20)
    rotation = trimesh.transformations.rotation_matrix(turn, (1, 2, 3))
    body.apply_transform(rotation)
    (finding,) = findings(mesh_of(body))
    x, y, _ = np.linalg.inv(rotation)[:3, :3] @ finding.place_mm
    assert 0 < x < 1.73
    assert finding.size_mm < 0.35
    # the largest ball at distance x from the edge has the diameter 2 x sin 10 degrees
    assert finding.size_mm == pytest.approx(2 * np.hypot(x, y) * np.sin(np.radians(10)), abs=0.03)


def test_pin_is_found():
    pin = trimesh.creation.cylinder(0.15, 4.0, sections=64)
    (finding,) = findings(mesh_of(pin))
    assert finding.size_mm == pytest.approx(0.3, abs=SHORT)
    assert finding.extent_mm == pytest.approx((0.3, 0.3, 4.0), abs=0.11)


def test_pin_on_a_block_is_found_without_the_block():
    """The place is the pin, not the network of the block's edges."""
    block = box((6, 6, 6))
    pin = trimesh.creation.cylinder(0.2, 4.0, sections=32)
    pin.apply_translation((1, 1, 4.5))  # 3.5 mm stand out at the top
    (finding,) = findings(mesh_of(block, pin))
    assert finding.kind == "thin-wall"
    assert finding.extent_mm == pytest.approx((0.4, 0.4, 3.5), abs=0.12)
    assert finding.place_mm[2] > 3
    assert finding.size_mm == pytest.approx(0.4, abs=SHORT)


def test_plate_beside_a_block_is_found_across_a_narrow_gap():
    block, plate = box((6, 6, 6)), box((5, 5, 0.3), centre=(0, 0, 3.35))
    (finding,) = findings(mesh_of(block, plate))
    assert finding.size_mm == pytest.approx(0.3, abs=SHORT)


@pytest.mark.parametrize("thickness", [0.02, 0.3, 0.45])
@pytest.mark.parametrize("axis", ["x", (1, 1, 0), (1, 2, 3)])
def test_thin_band_is_found(axis, thickness):
    mesh = mesh_of(box((20, 4, 4)))
    field = axis_field(axis, mesh)
    levels = (0.5, 0.5 + thickness / field.span_mm)
    found = thin_walls(mesh, field, levels, ("soft", "hard", "soft"), WALL)
    (finding,) = [f for f in found if f.label == 1]
    # (1, 2, 3) leaves edges of 37 degrees on either side, which are thin, the others do not
    assert len(found) == (3 if axis == (1, 2, 3) else 1)
    assert finding.kind == "thin-wall"
    assert thickness - SHORT <= finding.size_mm <= thickness + 1e-6
    if thickness >= 0.3:  # in whole voxels: 5 layers and more
        area = 16 / field.direction[0]  # of the cut through the bar
        assert finding.volume_mm3 == pytest.approx(area * thickness, rel=0.15)


def test_thin_end_is_found():
    mesh = mesh_of(box((20, 4, 4)))
    first, last = findings(mesh, "x", (0.001, 0.98), ("a", "b", "c"))
    assert (first.label, last.label) == (0, 2)
    assert first.size_mm == pytest.approx(0.02, abs=SHORT)
    assert last.size_mm == pytest.approx(0.4, abs=SHORT)


def test_adjacent_pieces_of_one_material_are_one_region():
    """Three bands of 0.3 mm are thin one by one, and sound as one material."""
    mesh = mesh_of(box((20, 4, 4)))
    levels = 0.5 + np.arange(4) * 0.3 / 20
    apart = findings(mesh, "x", levels, ("a", "b", "c", "d", "a"))
    assert [f.label for f in apart] == [1, 2, 3]
    assert findings(mesh, "x", levels, ("a", "b", "b", "b", "a")) == ()


def test_small_body_is_a_fragment():
    block, crumb = box((6, 6, 6)), box((0.4, 0.25, 0.35), centre=(0, 0, 5), normal=(1, 2, 3))
    (finding,) = findings(mesh_of(block, crumb), "z", (0.5,), ("a", "b"))
    assert (finding.kind, finding.label) == ("fragment", 1)
    assert finding.place_mm == pytest.approx((0, 0, 5), abs=0.11)  # where a ball of 0.25 fits
    assert finding.size_mm == pytest.approx(0.25, abs=SHORT)
    assert finding.extent_mm == pytest.approx(np.ptp(crumb.bounds, axis=0), abs=0.11)
    assert finding.volume_mm3 == pytest.approx(0.035, rel=0.5)  # about 200 voxels, most at the rim


def test_touching_places_are_one_and_separate_ones_are_two():
    plates = [box((5, 5, 0.4)), box((5, 5, 0.4), centre=(2.3, 0, 2.3), normal=(1, 0, 0))]
    assert len(findings(mesh_of(*plates))) == 1
    assert len(findings(mesh_of(plates[0], box((5, 5, 0.4), centre=(0, 0, 3))))) == 2


def test_reported_places_are_limited_largest_first():
    pins = [trimesh.creation.cylinder(0.15, 2 + 0.2 * i) for i in range(8)]
    for i, pin in enumerate(pins):
        pin.apply_translation((2.0 * (i * 3 % 8), 0, 0))
    mesh = mesh_of(*pins)
    listed = findings(mesh, limit=3)
    assert [f.extent_mm[2] for f in listed] == pytest.approx([3.4, 3.2, 3.0], abs=0.11)
    assert [f.more for f in listed] == [0, 0, 5]
    assert listed[:2] == findings(mesh, limit=8)[:2]


@pytest.mark.parametrize("slab_rows", [16, 40])
def test_places_do_not_depend_on_slabs(slab_rows):
    """A comb of a block with fins and a long oblique plate, over several slabs."""
    fins = [box((4, 0.3, 8), centre=(0, 3.0 * i, 3)) for i in range(-2, 3)]
    plate = box((0.4, 20, 3), centre=(3, 0, -5), normal=(0.3, 0.2, 1))
    mesh = mesh_of(box((4, 16, 4), centre=(0, 0, -2)), *fins, plate)
    band = PlanarBand(np.array([0.0, 0.0, 1.0]), -np.inf, 5.5)
    raster = raster_for(*mesh.bounds_mm, WALL)
    assert raster.grid.shape[1] > 3 * slab_rows
    whole = thin_places(mesh, band, raster)
    slabs = thin_places(mesh, band, replace(raster, slab_rows=slab_rows))
    assert len(whole) == 6
    assert list(map(str, whole)) == list(map(str, slabs))


def test_large_parts_get_a_coarser_grid():
    raster = raster_for(np.zeros(3), np.array([490.0, 390.0, 200.0]), WALL)
    assert raster.radius == 2
    assert raster.grid.pitch_mm[0] == pytest.approx(WALL / 5)
    row_bytes = (raster.grid.shape[0] + 12) * (raster.grid.shape[2] // 64 + 3) * 8
    assert raster.slab_rows * row_bytes <= 16 << 20  # of one set without its halo


@pytest.mark.parametrize("normal", DIRECTIONS)
@pytest.mark.parametrize("radius", [2, 3, 4])
def test_coarser_grids_find_and_pass_what_they_promise(monkeypatch, normal, radius):
    monkeypatch.setattr("planner.voxels.thin_places.FINEST_RADIUS", radius)
    surely_thin = {2: 0.6, 3: 0.75, 4: 0.8}[radius] * WALL
    assert len(findings(mesh_of(box((8, 6, surely_thin), normal=normal)))) == 1
    assert findings(mesh_of(box((8, 6, WALL), centre=(0.01, 0.02, 0.03), normal=normal))) == ()
    assert findings(mesh_of(box((4, 4, 4), normal=normal))) == ()


def test_arguments_out_of_range():
    mesh = mesh_of(box((2, 2, 2)))
    field = axis_field("x", mesh)
    for wall in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ArgumentError, match="minimum wall"):
            thin_walls(mesh, field, (), ("a",), wall)
    with pytest.raises(ArgumentError, match="limit"):
        thin_walls(mesh, field, (), ("a",), WALL, limit=0)
    with pytest.raises(ArgumentError, match="materials"):
        thin_walls(mesh, field, (0.5,), ("a",), WALL)
    with pytest.raises(ArgumentError, match="planes"):
        thin_walls(mesh, SimpleNamespace(name="radial"), (), ("a",), WALL)
