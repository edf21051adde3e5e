"""Columns agree voxel for voxel with the winding number computed another way."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.mesh.mesh import Mesh
from planner.voxels.columns import Grid, dense, iterate_columns


def winding_numbers(points, triangles):
    """Sum of signed solid angles over 4 pi (van Oosterom and Strackee 1983), point by triangle."""
    a, b, c = (triangles[None, :, i] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    top = np.einsum("...i,...i", a, np.cross(b, c))
    bottom = la * lb * lc + np.einsum("...i,...i", a, b) * lc
    bottom += np.einsum("...i,...i", b, c) * la + np.einsum("...i,...i", c, a) * lb
    return np.arctan2(top, bottom).sum(axis=1) / (2 * np.pi)


def random_body(rng):
    """A bumpy ball or ring, squeezed and turned: closed, mostly without self-crossings."""
    kind = rng.integers(3)
    if kind == 0:
        body = trimesh.creation.icosphere(2, 2.0)
        body.vertices *= 1 + 0.3 * rng.standard_normal((len(body.vertices), 1)).clip(-1, 1)
    elif kind == 1:
        body = trimesh.creation.torus(2.0, 0.8, major_sections=12, minor_sections=8)
    else:
        body = trimesh.creation.box((3, 2, 2.5))
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
    body.apply_transform(turn)
    return np.asarray(body.vertices) * rng.uniform(0.5, 1.5, 3), np.asarray(body.faces)


@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(6, 12))]
)
def test_every_voxel_agrees_with_the_winding_number(seed):
    """One or two (overlapping) bodies on an anisotropic grid; centres miss surfaces by chance."""
    rng = np.random.default_rng(seed)
    bodies = [random_body(rng) for _ in range(1 + seed % 2)]
    vertices = np.concatenate([v + i for i, (v, _) in enumerate(bodies)])
    faces = np.concatenate([f + i * len(bodies[0][0]) for i, (_, f) in enumerate(bodies)]).astype(
        np.int32
    )
    pitch = tuple(float(p) for p in rng.uniform(0.3, 0.5, 3))
    grid = Grid((-5.0, -5.0, -5.0), pitch, tuple(int(11 / p) for p in pitch))
    (columns,) = iterate_columns(Mesh(vertices, faces), grid, slab_rows=grid.shape[1])
    voxels = np.stack(np.meshgrid(*map(np.arange, grid.shape), indexing="ij"), -1).reshape(-1, 3)
    centres = grid.centre_mm(voxels)
    near = ((centres > vertices.min(0) - 1) & (centres < vertices.max(0) + 1)).all(axis=1)
    inside = dense(columns).reshape(-1)
    assert not inside[~near].any()
    parts = np.array_split(centres[near], 1 + near.sum() // 1000)
    winding = np.concatenate([winding_numbers(p, vertices[faces]) for p in parts])
    assert np.array_equal(inside[near], winding > 0.5)
    assert columns.unpaired == 0


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(*[st.integers(0, 12)] * 3), min_size=4, max_size=9, unique=True),
    st.sampled_from([1.0, 0.5]),
)
def test_lattice_hulls_never_leave_a_column_unpaired(points, pitch):
    """Convex hulls of lattice points: every vertex, many edges and faces pass through centres."""
    try:
        hull = trimesh.PointCloud(np.array(points, float)).convex_hull
    except Exception:  # flat point sets have no hull
        return
    if hull.volume < 1e-9 or not hull.is_watertight:
        return
    mesh = Mesh(np.asarray(hull.vertices), np.asarray(hull.faces, dtype=np.int32))
    n = int(14 / pitch)
    grid = Grid((-0.5 * pitch - 1,) * 3, (pitch,) * 3, (n,) * 3)
    (columns,) = iterate_columns(mesh, grid, slab_rows=n)
    assert columns.unpaired == 0
    voxels = dense(columns)
    i, j, k = np.indices(voxels.shape)
    centres = grid.centre_mm(np.stack([i, j, k], -1).reshape(-1, 3))
    normals, corners = hull.face_normals, hull.triangles[:, 0]
    depth = (centres @ normals.T - np.einsum("ij,ij->i", normals, corners)).max(axis=1)
    inside = voxels.reshape(-1)
    assert inside[depth < -1e-6].all()
    assert not inside[depth > 1e-6].any()
