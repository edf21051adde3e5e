"""Layers along x hold the voxels that columns along z hold, ties included."""

import itertools

import numpy as np
import pytest
import trimesh

from planner.errors import MeshError
from planner.mesh.mesh import Mesh
from planner.voxels.columns import Grid, dense, grid_for, iterate_columns, iterate_slabs


def by_layers(mesh: Mesh, grid: Grid, slab_layers: int = 3, *, alone: bool = False) -> np.ndarray:
    """Voxels (nx, ny, nz) from runs along x."""
    nx, ny, nz = grid.shape
    voxels = np.zeros((nz * ny, nx), bool)
    for slab in iterate_slabs(mesh, grid, slab_layers):
        offsets, starts, stops, open_rows = (slab.alone() if alone else slab).runs(row_leads=True)
        assert open_rows == 0
        for row, (first, last) in enumerate(itertools.pairwise(offsets)):
            for start, stop in zip(starts[first:last], stops[first:last], strict=True):
                voxels[slab.first * ny + row, start:stop] = True
    return voxels.reshape(nz, ny, nx).transpose(2, 1, 0)


def by_columns(mesh: Mesh, grid: Grid) -> np.ndarray:
    return np.concatenate([dense(columns) for columns in iterate_columns(mesh, grid)], axis=1)


def whole_numbers(*shape: int) -> Grid:
    """Voxel centres at whole numbers from 0 on."""
    return Grid((-0.5, -0.5, -0.5), (1.0, 1.0, 1.0), (shape[0], shape[1], shape[2]))


@pytest.mark.parametrize("seed", range(30))
def test_tetrahedra_with_every_vertex_on_centres(seed: int) -> None:
    """Faces and edges of all slopes pass through centres exactly; both walks agree on each."""
    random = np.random.default_rng(seed)
    points = random.integers(0, 9, (4, 3)).astype(float)
    if abs(np.linalg.det(points[1:] - points[0])) < 0.5:
        points[0] += (4, 0, 0)
    if np.linalg.det(points[1:] - points[0]) > 0:
        points = points[[1, 0, 2, 3]]
    mesh = Mesh(points, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    grid = whole_numbers(14, 10, 10)
    assert np.array_equal(by_layers(mesh, grid), by_columns(mesh, grid))


def test_tetrahedra_fill_a_cube_without_gap_or_overlap() -> None:
    """Six tetrahedra about a diagonal, all on centres: their voxels are the cube's, each once."""
    grid, count = whole_numbers(8, 8, 8), np.zeros((8, 8, 8), int)
    for order in itertools.permutations(range(3)):
        path = np.zeros((4, 3))
        for step, axis in enumerate(order):
            path[step + 1 :, axis] = 6.0
        if np.linalg.det(path[1:] - path[0]) > 0:
            path = path[[1, 0, 2, 3]]
        count += by_layers(Mesh(path, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]), grid)
    expected = np.zeros((8, 8, 8), int)
    expected[:6, :6, :6] = 1
    assert np.array_equal(count, expected)


@pytest.mark.parametrize("pitch", [1.0, (0.5, 1.0, 0.25), (0.3, 0.7, 0.4)])
def test_curved_and_concave_bodies(pitch: object) -> None:
    """A torus turned askew and rounded to a coarse lattice, so that many vertices are ties."""
    body = trimesh.creation.torus(6.0, 2.5, 24, 16)
    body.apply_transform(trimesh.transformations.rotation_matrix(0.7, (1, 2, 3)))
    vertices = np.round(np.asarray(body.vertices) * 4) / 4
    mesh = Mesh(vertices, np.asarray(body.faces))
    pitch_mm = tuple(float(p) for p in np.broadcast_to(pitch, 3))
    grid = grid_for(mesh.bounds_mm + np.array([[-0.5], [0.5]]) * pitch_mm, pitch_mm)
    voxels = by_layers(mesh, grid)
    assert np.array_equal(voxels, by_columns(mesh, grid))
    assert np.array_equal(voxels, by_layers(mesh, grid, 1))
    assert np.array_equal(voxels, by_layers(mesh, grid, 1000, alone=True))


def test_a_grid_that_cuts_the_mesh_off() -> None:
    ball = trimesh.creation.icosphere(2, 5.0)
    mesh = Mesh(np.asarray(ball.vertices), np.asarray(ball.faces))
    grid = Grid((-3.0, -2.0, -4.0), (0.25, 0.5, 0.125), (17, 11, 40))
    voxels = by_layers(mesh, grid)
    assert np.array_equal(voxels, by_columns(mesh, grid))
    assert voxels.any()


def test_depths_of_large_triangles_are_exact_to_the_lattice() -> None:
    """A plane x + y + z = n through centres 16000 voxels out: half-open there as at the origin."""
    n = 16000.0
    mesh = Mesh(
        np.array([[0, 0, 0], [n, 0, 0], [0, n, 0], [0, 0, n]]),
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
    k = 15_990
    grid = Grid((-0.5, -0.5, k - 0.5), (1.0, 1.0, 1.0), (12, 12, 12))
    voxels = by_layers(mesh, grid)
    i, j, above = np.indices(grid.shape)
    assert np.array_equal(voxels, i + j + above + k < n)
    assert np.array_equal(voxels, by_columns(mesh, grid))


def test_bad_arguments_are_named() -> None:
    box = trimesh.creation.box((1, 1, 1))
    mesh = Mesh(np.asarray(box.vertices), np.asarray(box.faces))
    with pytest.raises(MeshError, match="no faces"):
        next(iterate_slabs(Mesh(mesh.vertices, mesh.faces[:0]), whole_numbers(2, 2, 2), 1))
