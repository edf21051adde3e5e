"""Labels along planar fields: each voxel's is that of its centre, and labels partition the part."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from planner.errors import ArgumentError
from planner.fields.basic import AxisField, axis_field
from planner.mesh.mesh import Mesh
from planner.voxels.columns import (
    LabelledColumns,
    dense,
    grid_for,
    iterate_columns,
    label_columns,
    label_volumes_mm3,
    layers,
    voxelize,
)

DIRECTIONS = [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (1, 1, 0), (1, -2, 3), (-1, 0.3, -2)]


def mesh_of(body: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(body.vertices), np.asarray(body.faces, dtype=np.int32))


@pytest.fixture(scope="module")
def ring():
    body = trimesh.creation.torus(5, 2, major_sections=40, minor_sections=20)
    body.apply_transform(trimesh.transformations.rotation_matrix(0.4, (1, 2, 3)))
    return mesh_of(body)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_every_voxel_has_the_label_of_its_centre(ring, direction):
    field = axis_field(direction, ring)
    levels = [0.1, 0.1001, 0.37, 0.5, 0.81, 1.5]
    columns = voxelize(ring, (0.31, 0.29, 0.23))
    labelled = label_columns(columns, field, levels)
    images = layers(labelled, 0, columns.grid.shape[2]).transpose(2, 1, 0)
    inside = dense(columns)
    assert np.array_equal(images > 0, inside)
    centres = columns.grid.centre_mm(np.argwhere(inside))
    u = field.values(centres)
    sure = np.abs(u[:, None] - levels).min(axis=1) > 1e-12  # a centre on a plane may go either way
    expected = np.searchsorted(levels, u, side="right") + 1
    assert sure.mean() > 0.99
    assert np.array_equal(images[inside][sure], expected[sure])


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_labels_partition_the_voxels(ring, direction):
    columns = voxelize(ring, 0.2)
    levels = np.linspace(0, 1, 12)[1:-1]
    labelled = label_columns(columns, axis_field(direction, ring), levels)
    volumes = label_volumes_mm3(labelled, 11)
    assert volumes.shape == (11,)
    assert (volumes > 0).all()
    assert volumes.sum() == pytest.approx(columns.volume_mm3, rel=1e-12)
    # within a column, neighbours that touch differ in label: no run is cut without need
    first_in_column = np.zeros(len(labelled.start), bool)
    first_in_column[labelled.offsets[:-1][np.diff(labelled.offsets) > 0]] = True
    touching = ~first_in_column[1:] & (labelled.start[1:] == labelled.stop[:-1])
    assert (np.diff(labelled.label)[touching] != 0).all()


def test_levels_on_voxel_centres_belong_above():
    """Centres at 0.5, 1.5, ... mm: a plane through a centre gives it the upper label."""
    box = trimesh.creation.box((3, 3, 8))
    mesh = Mesh(box.vertices + np.array([1.5, 1.5, 4]), box.faces)
    columns = voxelize(mesh, 1.0)
    up = label_columns(columns, AxisField((0.0, 0.0, 1.0), 0.0, 8.0), [2.5 / 8])
    assert label_volumes_mm3(up, 2).tolist() == [18.0, 54.0]
    down = label_columns(columns, AxisField((0.0, 0.0, -1.0), -8.0, 8.0), [2.5 / 8])
    assert label_volumes_mm3(down, 2).tolist() == [18.0, 54.0]


def test_slab_volumes_match_the_exact_band(ring):
    """A box cut along z at thirds of its height holds a third of the voxels in each piece."""
    box = trimesh.creation.box((2, 2, 3))
    mesh = mesh_of(box)
    labelled = label_columns(voxelize(mesh, 0.1), axis_field("z", mesh), [1 / 3, 2 / 3])
    assert label_volumes_mm3(labelled, 3) == pytest.approx([4.0, 4.0, 4.0])


def test_slabs_label_as_the_whole(ring):
    field = axis_field((1, 2, 3), ring)
    grid = grid_for(ring.bounds_mm, 0.25)
    whole = label_columns(voxelize(ring, 0.25), field, [0.3, 0.6])
    slabs = [
        label_columns(slab, field, [0.3, 0.6]) for slab in iterate_columns(ring, grid, slab_rows=5)
    ]
    for name in ("start", "stop", "label"):
        joined = np.concatenate([getattr(s, name) for s in slabs])
        assert np.array_equal(joined, getattr(whole, name))


def test_no_levels_is_one_label(ring):
    columns = voxelize(ring, 0.5)
    labelled = label_columns(columns, axis_field("z", ring), [])
    assert isinstance(labelled, LabelledColumns)
    assert label_volumes_mm3(labelled, 1).tolist() == [columns.volume_mm3]


def test_layers_are_the_dense_voxels(ring):
    columns = voxelize(ring, 0.3)
    images = layers(columns, 3, 9)
    assert np.array_equal(images.transpose(2, 1, 0), dense(columns)[:, :, 3:9])
    labelled = label_columns(columns, axis_field("z", ring), [0.5])
    painted = layers(labelled, 0, columns.grid.shape[2], values=[7, 200])
    assert set(np.unique(painted)) == {0, 7, 200}
    with pytest.raises(ArgumentError, match="not within"):
        layers(columns, 0, 10_000)
    with pytest.raises(ArgumentError, match="for each label"):
        layers(labelled, 0, 1, values=[7])
    with pytest.raises(ArgumentError, match="0 to 255"):
        layers(labelled, 0, 1, values=[7, 256])


def test_arguments_out_of_range(ring):
    columns, field = voxelize(ring, 1.0), axis_field("x", ring)
    for levels in ([0.5, 0.5], [0.6, 0.5], [np.nan]):
        with pytest.raises(ArgumentError, match="strictly rising"):
            label_columns(columns, field, levels)
    with pytest.raises(ArgumentError, match="32766"):
        label_columns(columns, field, np.linspace(0, 1, 40_000))
    curved = SimpleNamespace(name="radial", values=None, description=None)
    with pytest.raises(ArgumentError, match="planes"):
        label_columns(columns, curved, [0.5])
