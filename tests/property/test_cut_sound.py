"""Shells of random parts, cut at random and at awkward levels, audited from float32 soups."""

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, Error, Manifold
from manifold3d import Mesh as SolidMesh

from benchmarks.audit import audit
from planner.cutting.pieces import split
from planner.cutting.planes import snap_distance_mm
from planner.fields.basic import axis_field
from planner.grading.check import interfaces_cancel
from planner.mesh.mesh import Mesh, join_shells, weld
from planner.mesh.part import moved_to_corner


def solid(kind, rng):
    """A closed solid of about unit size."""
    if kind == "sphere":
        return Manifold.sphere(1, int(rng.integers(4, 48)))
    if kind == "torus":
        ring = CrossSection.circle(0.3, int(rng.integers(4, 30))).translate((1, 0))
        return Manifold.revolve(ring, int(rng.integers(5, 60)))
    if kind == "drilled":
        drill = Manifold.cylinder(4, 0.3, 0.3, 24, True)
        return Manifold.sphere(1, 32) - drill - drill.rotate([90, 0, 0])
    found = Manifold.cube([1, 1, 1])
    for _ in range(int(rng.integers(1, 6))):
        if kind == "pitted":
            ball = Manifold.sphere(rng.uniform(0.1, 0.5), int(rng.integers(4, 40)))
            found -= ball.translate(rng.uniform(0, 1, 3))
        else:
            # Sides on a lattice of 0.1: faces of different boxes share planes.
            box = Manifold.cube(np.round(rng.uniform(0.2, 1, 3), 1))
            found += box.translate(np.round(rng.uniform(-0.5, 1, 3), 1))
    return found


KINDS = ["sphere", "torus", "drilled", "pitted", "boxes"]


def random_case(kind, seed):
    """Place a random part, and choose a direction and levels, some through vertices or close."""
    rng = np.random.default_rng(seed)
    found = solid(kind, rng)
    if rng.random() < 0.5:
        found = found.rotate(rng.uniform(0, 360, 3))
    raw = found.scale(rng.uniform(0.5, 2, 3) * 10 ** rng.uniform(0, 1.7)).to_mesh()
    vertices, faces = np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts)
    mesh, _ = moved_to_corner(Mesh(vertices + rng.uniform(-400, 400, 3), faces))
    if rng.random() < 0.3:
        # Coarser float32 than any part on a tray has: as large as a tray, but thin.
        mesh, _ = moved_to_corner(mesh)
        moved = (mesh.vertices + rng.integers(0, 400, 3)).astype(np.float32)
        mesh = Mesh(moved, mesh.faces)
    straight = ["x", "y", "z", "-x", "-y", "-z"]
    axis = straight[rng.integers(6)] if rng.random() < 0.5 else tuple(rng.normal(size=3))
    field = axis_field(axis, mesh)
    levels = rng.uniform(0.0005, 0.9995, rng.integers(1, 10))
    levels = np.append(levels, rng.choice(field.values(mesh.vertices), 4))
    if rng.random() < 0.5:
        levels = np.append(levels, levels + 2e-4 / field.span_mm)
    kept = [0.0]
    # Above the least distance that `split` accepts, after rounding the level to float32.
    apart = max(1.9e-4, 3.5 * snap_distance_mm(mesh.bounds_mm)) / field.span_mm
    for level in np.sort(levels).tolist():
        if kept[-1] + apart < level < 1:
            kept.append(level)
    return mesh, field, kept[1:]


def count_unsound(mesh, field, levels):
    """Split, audit every shell, and return how many there are and how many are faulty."""
    pieces = split(mesh, field, levels)
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    soups = [soup for soup in soups if len(soup)]
    faulty = 0
    for soup in soups:
        vertices, faces = weld(soup)
        imported = Manifold(SolidMesh(vertices, faces.astype(np.uint32)))
        faulty += not audit(soup).sound or imported.status() != Error.NoError
    assert interfaces_cancel(join_shells(soups), mesh)
    assert len(np.unique(pieces.vertices, axis=0)) == len(pieces.vertices)
    # Cut points move by half the float32 spacing at most, and the surface with them.
    limit = max(1e-6 * mesh.volume_mm3, snap_distance_mm(mesh.bounds_mm) * mesh.area_mm2 / 4)
    assert abs(pieces.volumes_mm3.sum() - mesh.volume_mm3) < limit
    return len(soups), faulty


def touches_itself(mesh, field):
    """Tell whether the part has two bodies or walls in contact, so that no cut can be sound.

    Edges that lie on each other but end in different vertices are told apart in the part; a
    level through both gives each the same new vertex, and the shells an edge of four faces.
    """
    vertices = mesh.vertices
    edges = np.unique(np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
    along = end - start
    length = np.linalg.norm(along, axis=1)
    near = 8 * snap_distance_mm(mesh.bounds_mm)
    for i in range(len(edges)):
        from_start = vertices - start[i]
        share = from_start @ along[i] / length[i]
        away = np.linalg.norm(from_start - share[:, None] * along[i] / length[i], axis=1)
        if ((away < near) & (share > near) & (share < length[i] - near)).any():
            return True
    return False


@settings(
    deadline=None, max_examples=60, derandomize=True,
    suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow],
)  # fmt: skip
@given(kind=st.sampled_from(KINDS), seed=st.integers(0, 2**32 - 1))
def test_shells_of_random_parts_are_sound(kind, seed):
    mesh, field, levels = random_case(kind, seed)
    assume(audit(mesh.triangles.astype(np.float32)).sound)
    shells, faulty = count_unsound(mesh, field, levels)
    assert shells > 0
    assert faulty == 0 or touches_itself(mesh, field)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(
    directions=st.tuples(*[st.integers(-9, 9).filter(bool)] * 3),
    shares=st.lists(st.integers(1, 999), min_size=1, max_size=6, unique=True),
)
def test_pieces_of_a_box_have_the_volume_between_the_planes(directions, shares):
    raw = Manifold.cube([3, 5, 8]).to_mesh()
    mesh, _ = moved_to_corner(
        Mesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts))
    )
    field = axis_field(directions, mesh)
    levels = np.sort(shares) / 1000
    volumes = split(mesh, field, levels).volumes_mm3
    # The corner below n . x = c of a box is a sum over its corners q of sign(q) (c - n . q)^3,
    # over 6 n1 n2 n3.
    n = np.abs(np.array(field.direction))
    below = np.zeros(len(levels))
    for corner in np.ndindex(2, 2, 2):
        reach = levels * (n @ [3, 5, 8]) - n @ (corner * np.array([3, 5, 8]))
        below += (-1) ** sum(corner) * np.maximum(reach, 0) ** 3
    expected = np.diff(np.concatenate([[0], below / (6 * n.prod()), [120]]))
    # Rounding moves a plane by less than 2e-6 mm, and it cuts less than 50 mm2.
    np.testing.assert_allclose(volumes, expected, rtol=0, atol=1e-4)


@pytest.mark.long
def test_a_thousand_parts():
    total = unsound = 0
    for seed in range(1000):
        mesh, field, levels = random_case(KINDS[seed % len(KINDS)], seed)
        if levels and audit(mesh.triangles.astype(np.float32)).sound:
            shells, faulty = count_unsound(mesh, field, levels)
            if faulty and touches_itself(mesh, field):
                continue
            total, unsound = total + shells, unsound + faulty
    assert total > 5000
    assert unsound == 0
