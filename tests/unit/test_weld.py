import numpy as np
import pytest

from planner.errors import MeshError
from planner.mesh.mesh import Mesh, cancel_opposite, repeats_index, weld
from planner.mesh.part import moved_to_corner

CUBE = Mesh(
    np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float),
    np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
         [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    ),
)  # fmt: skip


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_weld_keeps_positions_and_numbers_them_by_first_appearance(dtype):
    rng = np.random.default_rng(0)
    pool = rng.integers(-3, 4, (5000, 3)).astype(dtype) / dtype(7)
    soup = pool[rng.integers(0, len(pool), (20_000, 3))]
    vertices, faces = weld(soup)
    assert vertices.dtype == dtype
    np.testing.assert_array_equal(vertices[faces], soup)
    assert len(vertices) == len(np.unique(vertices, axis=0))
    _, first = np.unique(faces.ravel(), return_index=True)
    assert (np.diff(first) > 0).all()


def test_weld_joins_minus_zero_and_nothing_within_a_tolerance():
    tiny = np.nextafter(np.float32(0), np.float32(1))
    soup = np.array([[[0.0, 0, 0], [-0.0, 0, -0.0], [tiny, 0, 0]]], dtype=np.float32)
    vertices, faces = weld(soup)
    assert faces.tolist() == [[0, 0, 1]]
    assert not np.signbit(vertices).any()


def test_weld_of_nothing():
    vertices, faces = weld(np.empty((0, 3, 3), dtype=np.float32))
    assert vertices.shape == (0, 3)
    assert faces.shape == (0, 3)


def test_repeated_index():
    faces = np.array([[0, 1, 2], [0, 0, 1], [1, 2, 1], [2, 1, 1]], dtype=np.int32)
    assert repeats_index(faces).tolist() == [False, True, True, True]


def test_opposite_faces_cancel_and_equal_ones_stay():
    # Triple 0-1-2 occurs three times one way and once the other: two of the majority are left.
    faces = np.array([[0, 1, 2], [2, 1, 0], [3, 1, 2], [1, 2, 0], [2, 0, 1]], dtype=np.int32)
    assert cancel_opposite(faces).tolist() == [True, False, True, True, False]
    pair = np.array([[4, 5, 6], [5, 4, 6]], dtype=np.int32)
    assert not cancel_opposite(pair).any()


def test_arrays_are_plain_ones_whatever_class_they_come_in():
    """trimesh has one of its own, for which no loop is kept: each process would compile anew."""

    class Tracked(np.ndarray):
        pass

    mesh = Mesh(CUBE.vertices.view(Tracked), CUBE.faces.view(Tracked))
    assert {type(mesh.vertices), type(mesh.faces)} == {np.ndarray}


def test_cube_measures():
    assert CUBE.volume_mm3 == pytest.approx(1, rel=1e-15)
    assert CUBE.area_mm2 == pytest.approx(6, rel=1e-15)
    far = Mesh(CUBE.vertices + 1e6, CUBE.faces)
    # About a local origin no digit is lost, although coordinates are a million times the side.
    assert far.volume_mm3 == pytest.approx(1, rel=1e-15)
    assert Mesh(CUBE.vertices, CUBE.faces[:, ::-1]).volume_mm3 == pytest.approx(-1, rel=1e-15)


def test_place_moves_the_corner_to_one_and_rounds_to_float32():
    mesh = Mesh(CUBE.vertices * [1 / 3, 20, 7] - 12.3456789, CUBE.faces)
    placed, translation_mm = moved_to_corner(mesh)
    np.testing.assert_array_equal(placed.bounds_mm[0], 1)
    np.testing.assert_array_equal(placed.vertices, placed.vertices.astype(np.float32))
    # Half the spacing of float32 below 32 mm.
    np.testing.assert_allclose(placed.vertices, mesh.vertices + translation_mm, rtol=0, atol=1e-6)


def test_place_drops_what_rounds_to_nothing():
    # A tetrahedron 1e-9 mm thick beside the cube collapses to two opposite faces, which cancel.
    flake = np.array([[9, 0, 0], [10, 0, 0], [9, 1, 0], [9, 0, 1e-9]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]) + 8
    both = Mesh(np.concatenate([CUBE.vertices, flake]), np.concatenate([CUBE.faces, faces]))
    placed, _ = moved_to_corner(both)
    assert len(placed.faces) == 12
    assert len(placed.vertices) == 8
    with pytest.raises(MeshError, match="no thickness"):
        moved_to_corner(Mesh(flake, faces - 8))
