"""Thin places of a solid: what must be found, what must not, and how large it is said to be.

Plates, pins and wedges of known thickness, in many directions; minimum wall 0.6 mm throughout.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from planner.mesh.mesh import Mesh
from planner.voxels.thin_places import raster_for, thin_solid_places

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


def places(mesh: Mesh, listed=20):
    return thin_solid_places(mesh, WALL, listed=listed)[0]


@pytest.mark.parametrize("normal", DIRECTIONS)
@pytest.mark.parametrize("thickness", [0.05, 0.2, 0.4, 0.45])
def test_thin_plate_is_found_in_any_direction(normal, thickness):
    """Three quarters of the limit are found in a grid of its seventh part."""
    (place,) = places(mesh_of(box((8, 6, thickness), normal=normal)))
    assert place.alone
    assert thickness - SHORT <= place.size_mm <= thickness + 1e-6
    n = np.array(normal) / np.linalg.norm(normal)
    assert abs(place.place_mm @ n) <= SHORT  # on the middle plane
    if thickness >= 0.2:  # volumes of thinner sheets are in whole voxels
        assert place.volume_mm3 == pytest.approx(48 * thickness, rel=0.15)


@pytest.mark.parametrize("normal", DIRECTIONS)
def test_a_sheet_thinner_than_a_voxel_may_be_told_in_several_places(normal):
    found = places(mesh_of(box((8, 6, 0.02), normal=normal)))
    assert found
    assert all(0.02 - SHORT <= place.size_mm <= 0.02 + 1e-6 for place in found)


@pytest.mark.parametrize("normal", DIRECTIONS)
@pytest.mark.parametrize("thickness", [0.6, 0.65, 1.0])
def test_plate_of_the_minimum_wall_or_more_is_not_reported(normal, thickness):
    assert places(mesh_of(box((8, 6, thickness), centre=(0.01, 0.02, 0.03), normal=normal))) == []


@pytest.mark.parametrize("normal", DIRECTIONS)
def test_edges_and_corners_of_a_cube_are_not_reported(normal):
    assert places(mesh_of(box((5, 5, 5), normal=normal))) == []


def test_sphere_and_obtuse_wedge_are_not_reported():
    assert places(mesh_of(trimesh.creation.icosphere(4, 3.0))) == []
    assert places(mesh_of(wedge(60))) == []


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_tip_of_a_wedge_is_found_where_it_is_thin(turn):
    """At 20 degrees the ball of 0.6 mm sits 1.73 mm from the edge; the place begins there."""
    body = wedge(20)
    rotation = trimesh.transformations.rotation_matrix(turn, (1, 2, 3))
    body.apply_transform(rotation)
    (place,) = places(mesh_of(body))
    x, y, _ = np.linalg.inv(rotation)[:3, :3] @ place.place_mm
    assert 0 < x < 1.73
    assert place.size_mm < 0.35
    # the largest ball at distance x from the edge has the diameter 2 x sin 10 degrees
    assert place.size_mm == pytest.approx(2 * np.hypot(x, y) * np.sin(np.radians(10)), abs=0.03)


def test_pin_is_found():
    pin = trimesh.creation.cylinder(0.15, 4.0, sections=64)
    (place,) = places(mesh_of(pin))
    assert place.size_mm == pytest.approx(0.3, abs=SHORT)
    assert place.extent_mm == pytest.approx((0.3, 0.3, 4.0), abs=0.11)


def test_pin_on_a_block_is_found_without_the_block():
    """The place is the pin, not the network of the block's edges."""
    block = box((6, 6, 6))
    pin = trimesh.creation.cylinder(0.2, 4.0, sections=32)
    pin.apply_translation((1, 1, 4.5))  # 3.5 mm stand out at the top
    (place,) = places(mesh_of(block, pin))
    assert place.extent_mm == pytest.approx((0.4, 0.4, 3.5), abs=0.18)
    assert place.place_mm[2] > 3
    assert place.size_mm == pytest.approx(0.4, abs=SHORT)


def test_plate_beside_a_block_is_found_across_a_narrow_gap():
    block, plate = box((6, 6, 6)), box((5, 5, 0.3), centre=(0, 0, 3.35))
    (place,) = places(mesh_of(block, plate))
    assert place.size_mm == pytest.approx(0.3, abs=SHORT)


def test_touching_places_are_one_and_separate_ones_are_two():
    plates = [box((5, 5, 0.4)), box((5, 5, 0.4), centre=(2.3, 0, 2.3), normal=(1, 0, 0))]
    assert len(places(mesh_of(*plates))) == 1
    assert len(places(mesh_of(plates[0], box((5, 5, 0.4), centre=(0, 0, 3))))) == 2


def test_reported_places_are_limited_largest_first():
    pins = [trimesh.creation.cylinder(0.15, 2 + 0.2 * i) for i in range(8)]
    for i, pin in enumerate(pins):
        pin.apply_translation((2.0 * (i * 3 % 8), 0, 0))
    mesh = mesh_of(*pins)
    listed, more = thin_solid_places(mesh, WALL, listed=3)
    assert [place.extent_mm[2] for place in listed] == pytest.approx([3.4, 3.2, 3.0], abs=0.15)
    assert more == 5
    assert listed == thin_solid_places(mesh, WALL, listed=8)[0][:3]


@pytest.mark.parametrize("slab_rows", [16, 40])
def test_places_do_not_depend_on_slabs(monkeypatch, slab_rows):
    """A comb of a block with fins and a long oblique plate, over several slabs."""
    fins = [box((4, 0.3, 8), centre=(0, 3.0 * i, 3)) for i in range(-2, 3)]
    plate = box((0.4, 20, 3), centre=(3, 0, -5), normal=(0.3, 0.2, 1))
    mesh = mesh_of(box((4, 16, 4), centre=(0, 0, -2)), *fins, plate)
    whole = places(mesh)
    assert len(whole) == 6
    raster = raster_for(*mesh.bounds_mm, WALL)
    assert raster.grid.shape[1] > 3 * slab_rows

    def in_slabs(*arguments):
        return replace(raster_for(*arguments), slab_rows=slab_rows)

    monkeypatch.setattr("planner.voxels.thin_places.raster_for", in_slabs)
    assert places(mesh) == whole


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
    assert len(places(mesh_of(box((8, 6, surely_thin), normal=normal)))) == 1
    assert places(mesh_of(box((8, 6, WALL), centre=(0.01, 0.02, 0.03), normal=normal))) == []
    assert places(mesh_of(box((4, 4, 4), normal=normal))) == []
