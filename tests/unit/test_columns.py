"""Voxel columns: exact where the answer is known, also where edges pass through centres."""

import numpy as np
import pytest
import trimesh

from planner.errors import ArgumentError, MeshError
from planner.mesh.mesh import Mesh
from planner.voxels.columns import Columns, Grid, dense, grid_for, iterate_columns, voxelize


def mesh_of(body: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(body.vertices), np.asarray(body.faces, dtype=np.int32))


def box(extents, low=(0.0, 0.0, 0.0)) -> Mesh:
    body = trimesh.creation.box(extents)
    return Mesh(body.vertices - body.bounds[0] + low, body.faces)


def united(*meshes: Mesh) -> Mesh:
    """Put bodies beside one another in one mesh, without any boolean."""
    counts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + n for m, n in zip(meshes, counts, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def columns_on(mesh: Mesh, grid: Grid) -> Columns:
    (columns,) = iterate_columns(mesh, grid, slab_rows=grid.shape[1])
    return columns


def volume_mm3(columns: Columns) -> float:
    return columns.voxels * columns.grid.voxel_mm3


def same(a: Columns, b: Columns) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in ("offsets", "start", "stop")
    )


def test_box_on_the_grid_is_exact():
    """4 x 3 x 2 mm at 0.1 mm: 40 x 30 columns of one run of 20 voxels."""
    columns = voxelize(box((4, 3, 2), low=(1, 1, 1)), 0.1)
    assert columns.grid.shape == (40, 30, 20)
    assert np.array_equal(columns.offsets, np.arange(1201))
    assert set(columns.start) == {0}
    assert set(columns.stop) == {20}
    assert volume_mm3(columns) == pytest.approx(24.0, rel=1e-14)


def test_box_off_the_grid_holds_the_centres_inside_it():
    """Per axis, voxels are those with low <= centre < high: counted by hand from the formula."""
    low, extents = np.array([0.213, 0.377, 0.149]), np.array([1.234, 0.871, 1.03])
    grid = Grid((0.0, 0.0, 0.0), (0.042, 0.042, 0.03), (40, 40, 50))
    columns = columns_on(box(extents, low), grid)
    inside = [
        (low[a] <= grid.pitch_mm[a] * (np.arange(n) + 0.5))
        & (grid.pitch_mm[a] * (np.arange(n) + 0.5) < low[a] + extents[a])
        for a, n in enumerate(grid.shape)
    ]
    expected = inside[0][:, None, None] & inside[1][:, None] & inside[2]
    assert np.array_equal(dense(columns), expected)


def test_vertices_and_edges_on_voxel_centres():
    """A box from centre to centre is half-open: the lower faces' voxels are in, the upper's out."""
    grid = Grid((-0.5, -0.5, -0.5), (1.0, 1.0, 1.0), (6, 6, 6))  # centres at whole numbers
    columns = columns_on(box((4, 3, 2), low=(1, 1, 1)), grid)
    expected = np.zeros((6, 6, 6), bool)
    expected[1:5, 1:4, 1:3] = True
    assert np.array_equal(dense(columns), expected)
    assert columns.unpaired == 0


@pytest.mark.parametrize("pitch", [1.0, (0.5, 1.0, 0.25)])
def test_octahedron_with_every_vertex_and_diagonal_on_centres(pitch):
    """|x| + |y| + |z| < 4: all slopes are 45 degrees through centres; no column is unpaired."""
    v = 4.0 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    pitch_mm = tuple(float(p) for p in np.broadcast_to(pitch, 3))
    shape = tuple(int(10 / p) for p in pitch_mm)
    origin = tuple(-5.0 - p / 2 for p in pitch_mm)
    columns = columns_on(Mesh(v, np.array(faces)), Grid(origin, pitch_mm, shape))
    assert columns.unpaired == 0
    centres = [
        o + p * (np.arange(n) + 0.5) for o, p, n in zip(origin, pitch_mm, shape, strict=True)
    ]
    distance = np.abs(centres[0])[:, None, None] + np.abs(centres[1])[:, None] + np.abs(centres[2])
    voxels = dense(columns)
    assert voxels[distance < 4].all()
    assert not voxels[distance > 4].any()


def test_halves_that_share_a_tilted_face_partition_the_body():
    """The shared face is triangulated differently on either side; no voxel is lost or doubled."""
    cube = box((6, 6, 6))
    v = cube.vertices
    corner = {tuple(p): i for i, p in enumerate(np.round(v).astype(int).tolist())}
    a, b, c, d = (corner[p] for p in ((0, 0, 0), (6, 0, 0), (6, 6, 6), (0, 6, 6)))
    e, f, g, h = (corner[p] for p in ((0, 6, 0), (6, 6, 0), (0, 0, 6), (6, 0, 6)))
    below = [[a, b, c], [a, c, d], [a, f, b], [a, e, f], [e, d, c], [e, c, f], [a, d, e], [b, f, c]]
    above = [[a, d, b], [b, d, c], [a, b, h], [a, h, g], [g, h, c], [g, c, d], [a, g, d], [b, c, h]]
    lower, upper = Mesh(v, np.array(below)), Mesh(v, np.array(above))
    assert lower.volume_mm3 == pytest.approx(108.0)
    assert upper.volume_mm3 == pytest.approx(108.0)
    # voxel centres lie exactly on the shared plane y = z
    grid = Grid((-0.5, -0.5, -0.5), (1.0, 1.0, 1.0), (8, 8, 8))
    low, high, whole = (dense(columns_on(m, grid)) for m in (lower, upper, cube))
    assert not (low & high).any()
    assert np.array_equal(low | high, whole)


def test_overlapping_bodies_unite_and_cavities_stay_empty():
    outer, inner = box((4, 4, 4)), box((2, 2, 2), low=(1, 1, 1))
    both = voxelize(united(outer, box((4, 4, 4), low=(2, 0, 0))), 0.25)
    assert volume_mm3(both) == pytest.approx(6 * 4 * 4)
    hollow = voxelize(united(outer, Mesh(inner.vertices, inner.faces[:, ::-1])), 0.25)
    assert volume_mm3(hollow) == pytest.approx(4**3 - 2**3)
    assert hollow.unpaired == 0


def test_stacked_bodies_make_one_run():
    columns = voxelize(united(box((1, 1, 1)), box((1, 1, 1), low=(0, 0, 1))), 0.25)
    assert len(columns.start) == 16
    assert set(columns.stop) == {8}


def test_columns_through_a_hole_are_counted_and_an_inverted_mesh_is_empty():
    cube = box((2, 2, 2))
    top = np.flatnonzero((cube.vertices[cube.faces][:, :, 2] > 1.9).all(axis=1))
    torn = voxelize(Mesh(cube.vertices, np.delete(cube.faces, top[0], axis=0)), 0.1)
    assert torn.unpaired == pytest.approx(200, abs=20)  # half of 20 x 20 columns
    flipped = voxelize(Mesh(cube.vertices, cube.faces[:, ::-1]), 0.1)
    assert flipped.voxels == 0
    assert flipped.unpaired == 0


def test_degenerate_triangles_change_nothing():
    ball = mesh_of(trimesh.creation.icosphere(2, 3.0))
    n = len(ball.faces)
    extra = np.array([[0, 0, 1], [5, 5, 5], [7, 8, 7]])
    collinear = np.array([[len(ball.vertices), len(ball.vertices) + 1, len(ball.vertices) + 2]])
    line = np.array([[0.0, 0, 0], [1, 1, 1], [2, 2, 2]])
    dirty = Mesh(
        np.concatenate([ball.vertices, line]), np.concatenate([ball.faces, extra, collinear])
    )
    grid = grid_for(ball.bounds_mm, 0.17)
    assert len(dirty.faces) == n + 4
    assert same(columns_on(ball, grid), columns_on(dirty, grid))


@pytest.mark.parametrize("slab_rows", [1, 3, 7, 1000])
def test_slabs_join_to_the_same_columns(slab_rows):
    mesh = mesh_of(trimesh.creation.torus(5, 2))
    grid = grid_for(mesh.bounds_mm, 0.3)
    slabs = list(iterate_columns(mesh, grid, slab_rows=slab_rows))
    whole = voxelize(mesh, 0.3)
    assert np.array_equal(np.concatenate([s.start for s in slabs]), whole.start)
    assert np.array_equal(
        np.concatenate([np.diff(s.offsets) for s in slabs]), np.diff(whole.offsets)
    )
    assert [s.first_row for s in slabs] == list(range(0, grid.shape[1], slab_rows))


def test_grid_clips_what_lies_outside():
    ball = mesh_of(trimesh.creation.icosphere(3, 3.0))
    whole = grid_for(ball.bounds_mm, 0.25)
    low = tuple(o + 4 * p for o, p in zip(whole.origin_mm, whole.pitch_mm, strict=True))
    part = Grid(low, whole.pitch_mm, (9, 10, 11))
    expected = dense(columns_on(ball, whole))[4:13, 4:14, 4:15]
    assert np.array_equal(dense(columns_on(ball, part)), expected)


def test_volume_converges_with_the_pitch():
    """Centre sampling of a ball at random offsets: RMS error about (pitch / radius)², order 2.

    The lattice point discrepancy of a smooth convex body is O(pitch²) up to logarithms, far
    below the O(pitch) of a rule that is biased at the surface; 8 offsets give the order to 0.3.
    """
    ball = mesh_of(trimesh.creation.icosphere(4, 5.0))
    rng = np.random.default_rng(0)
    pitches = np.array([0.8, 0.4, 0.2, 0.1])
    errors = []
    for pitch in pitches:
        shifted = [
            volume_mm3(columns_on(ball, Grid(tuple(low), (pitch,) * 3, (int(12 / pitch),) * 3)))
            for low in -6 + pitch * rng.random((8, 3))
        ]
        errors.append(np.sqrt(np.mean((np.array(shifted) / ball.volume_mm3 - 1) ** 2)))
    order = np.polyfit(np.log(pitches), np.log(errors), 1)[0]
    assert order > 1.6
    assert errors[-1] < (0.1 / 5) ** 2


def test_shortest_run_keeps_a_sheet_thinner_than_a_voxel():
    sheet = box((5, 5, 0.01), low=(0, 0, 0.52))
    grid = Grid((0.0, 0.0, 0.0), (0.5, 0.5, 0.5), (10, 10, 3))
    (plain,) = iterate_columns(sheet, grid, slab_rows=10)
    (kept,) = iterate_columns(sheet, grid, slab_rows=10, shortest=1)
    assert plain.voxels == 0
    assert np.array_equal(kept.start, np.full(100, 1))


def test_columns_with_many_crossings():
    """A stack of 200 plates listed in a shuffled order: 400 crossings a column."""
    order = np.random.default_rng(1).permutation(200)
    stack = united(*(box((1, 1, 0.5), low=(0, 0, float(i))) for i in order))
    columns = voxelize(stack, (0.5, 0.5, 0.25))
    assert len(columns.start) == 4 * 200
    assert np.array_equal(columns.start[:200], 4 * np.arange(200))
    assert volume_mm3(columns) == pytest.approx(100.0)


def test_arguments_out_of_range():
    cube = box((2, 2, 2))
    for pitch in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ArgumentError, match="pitch"):
            voxelize(cube, pitch)
    with pytest.raises(ArgumentError, match="coarser pitch"):
        voxelize(cube, 1e-5)
    with pytest.raises(MeshError, match="no faces"):
        next(iterate_columns(Mesh(cube.vertices, np.empty((0, 3))), grid_for(cube.bounds_mm, 0.5)))
    broken = Mesh(np.where(cube.vertices > 1, np.nan, cube.vertices), cube.faces)
    with pytest.raises(MeshError, match="reaches"):
        next(iterate_columns(broken, grid_for(cube.bounds_mm, 0.5)))
    far = Mesh(cube.vertices * 1e9, cube.faces)
    with pytest.raises(MeshError, match="coarser pitch"):
        next(iterate_columns(far, grid_for(cube.bounds_mm, 0.5)))
