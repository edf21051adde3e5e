"""Word-parallel set operations agree with scipy's, and inscribed balls with known ones."""

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from planner.mesh.mesh import Mesh
from planner.voxels.thin_places import (
    _ROOM,
    _add_runs,
    _components,
    _members,
    _runs_of,
    ball,
    empty_set,
    grow,
    morph,
    room_mm,
)

SHAPE = (11, 9, 150)  # columns cross two word borders
AROUND = ndimage.generate_binary_structure(3, 3)


def packed(dense):
    rows, columns, voxels = dense.shape
    bits = empty_set(rows, columns, voxels)
    for i, j, k in np.argwhere(dense):
        bits[i, _ROOM + j, 1 + k // 64] |= np.uint64(1) << np.uint64(k % 64)
    return bits


def unpacked(bits, shape):
    words = bits[:, _ROOM : _ROOM + shape[1], 1:]
    bools = (words[..., None] >> np.arange(64, dtype=np.uint64)) & np.uint64(1)
    return bools.reshape(*words.shape[:2], -1)[..., : shape[2]].astype(bool)


@pytest.fixture(params=range(3))
def sets(request):
    """A blobby set and a larger one around it."""
    rng = np.random.default_rng(request.param)
    noise = ndimage.gaussian_filter(rng.standard_normal(SHAPE), 1.5)
    return noise > 0.05, noise > -0.1


def sphere(radius):
    i, j, k = np.ogrid[-radius : radius + 1, -radius : radius + 1, -radius : radius + 1]
    return i**2 + j**2 + k**2 <= radius**2


@pytest.mark.parametrize("radius", [1, 2, 3, 5])
def test_opening_by_a_ball(sets, radius):
    """Also where whole words are full with full words around."""
    dense = ndimage.binary_dilation(sets[1], iterations=radius)
    dense[:, :, 20:] |= np.indices(SHAPE)[0][:, :, 20:] > 1
    dense[[0, -1]] = False
    region = packed(dense)
    eroded = ndimage.binary_erosion(dense, sphere(radius))
    opened = ndimage.binary_dilation(eroded, sphere(radius))
    small = morph(region, ball(radius), False, region)
    assert np.array_equal(unpacked(small, SHAPE), eroded)
    back = morph(small, ball(radius), True, region)
    assert np.array_equal(unpacked(back, SHAPE), opened)


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_growth_within_a_set(sets, steps):
    dense, within = sets
    expected = ndimage.binary_erosion(dense) & within
    grown = packed(expected)
    for step in range(steps):
        structure = ndimage.generate_binary_structure(3, 1 + step % 2)
        expected = ndimage.binary_dilation(expected, structure) & within
    left = grow(grown, packed(within), steps)
    assert np.array_equal(unpacked(grown, SHAPE), expected)
    assert (left == 0) == np.array_equal(expected, within)


def test_runs_members_and_components(sets):
    sparse, dense = sets
    dense = dense ^ ndimage.binary_erosion(dense)
    runs = _runs_of(packed(dense), 0, SHAPE[0])
    assert (runs[:, 3] - runs[:, 2]).sum() == dense.sum()
    starts = np.argwhere(dense & ~np.roll(np.pad(dense, ((0, 0), (0, 0), (0, 1))), 1, 2)[..., :-1])
    assert np.array_equal(runs[:, :3], starts)
    labels, count = ndimage.label(dense, AROUND)
    number = _components(runs)
    assert number.max() + 1 == count
    expected = labels[tuple(runs[:, :3].T)]
    assert len(set(zip(number.tolist(), expected.tolist(), strict=True))) == count
    for run, found in zip(runs, _members(runs, packed(sparse)), strict=True):
        inside = run[2] + np.flatnonzero(sparse[run[0], run[1], run[2] : run[3]])
        middle = [inside[0], inside[len(inside) // 2], inside[-1]] if len(inside) else [-1] * 3
        assert found.tolist() == middle


def test_runs_become_sets():
    offsets = np.array([0, 2, 2, 3, 4])  # two rows of two columns
    start, stop = np.array([0, 64, 3, 60]), np.array([1, 128, 130, 70])
    bits = empty_set(2, 2, 130)
    _add_runs(bits, offsets, start, stop)
    expected = np.zeros((2, 2, 130), bool)
    expected[0, 0, [0, *range(64, 128)]] = True
    expected[1, 0, 3:] = True
    expected[1, 1, 60:70] = True
    assert np.array_equal(unpacked(bits, expected.shape), expected)


@pytest.mark.parametrize("seed", range(5))
def test_inscribed_ball_of_a_turned_box(seed):
    """The ball in a box of 2 x 1 x 3 about its centre touches the two nearest faces: radius 0.5."""
    rng = np.random.default_rng(seed)
    body = trimesh.creation.box((2, 1, 3))
    body.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    start = rng.uniform(-0.1, 0.1, 3)
    (centre,), (across,) = room_mm(Mesh(body.vertices, body.faces), start[None], 0.2, 10.0)
    assert 1.0 - 0.2 / 8 <= across <= 1.0 + 1e-9
    distance = np.abs(
        body.face_normals @ centre - np.einsum("ij,ij->i", body.face_normals, body.triangles[:, 0])
    )
    assert across == pytest.approx(2 * distance.min(), abs=2e-9)


def test_inscribed_ball_starting_outside_climbs_in():
    body = trimesh.creation.icosphere(3, 0.1)
    start = np.array([[0.12, 0.0, 0.02]])
    (centre,), (across,) = room_mm(Mesh(body.vertices, body.faces), start, 0.2, 2.0)
    assert np.linalg.norm(centre) < 0.03
    assert across == pytest.approx(0.2, abs=0.04)


@pytest.mark.parametrize("seed", range(5))
def test_inscribed_balls_of_a_sharp_body_lie_inside(seed):
    """Wherever the search starts, a ball with a radius is as large as the nearest face allows."""
    rng = np.random.default_rng(seed)
    body = trimesh.convex.convex_hull(rng.uniform(-1, 1, (4, 3)) * [1, 1, 0.1])
    starts = rng.uniform(-1.2, 1.2, (5, 3)) * [1, 1, 0.3]
    centres, across = room_mm(Mesh(body.vertices, body.faces), starts, 0.2, 10.0)
    arms = centres[:, None] - body.triangles[:, 0]
    beyond = np.einsum("fj,nfj->nf", body.face_normals, arms).max(axis=1)
    assert across == pytest.approx(2 * np.maximum(-beyond, 0.0), abs=2e-9)
