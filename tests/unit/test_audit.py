import numpy as np
import pytest
from manifold3d import Error, Manifold
from manifold3d import Mesh as MeshGL

from benchmarks.audit import audit
from planner.errors import MeshError
from planner.formats.mesh_file import encode_stl, stl_holds
from planner.grading.check import interfaces_cancel
from planner.mesh.mesh import Mesh, join_shells


def soup(solid):
    mesh = solid.to_mesh()
    return np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts)]


CUBE = soup(Manifold.cube([2.0, 3.0, 4.0]))


def test_a_box():
    found = audit(CUBE)
    assert found.sound
    assert (found.triangles, found.vertices, found.bodies) == (12, 8, 1)
    assert found.volume_mm3 == pytest.approx(24, rel=1e-15)
    assert found.area_mm2 == pytest.approx(52, rel=1e-15)
    np.testing.assert_array_equal(found.bounds_mm, [[0, 0, 0], [2, 3, 4]])
    assert found.first_fault_mm is None


def test_a_missing_face_opens_three_edges():
    found = audit(CUBE[1:])
    assert (found.open_edges, found.overused_edges) == (3, 0)
    edges = {tuple((CUBE[0][i] + CUBE[0][i - 1]) / 2) for i in range(3)}
    assert found.first_fault_mm in edges
    assert not found.closed


def test_a_flipped_face_overuses_its_edges():
    flipped = CUBE.copy()
    flipped[5] = flipped[5, ::-1]
    found = audit(flipped)
    assert (found.open_edges, found.overused_edges) == (0, 3)


def test_inside_out_is_closed_but_not_sound():
    found = audit(CUBE[:, ::-1])
    assert found.closed
    assert found.volume_mm3 == pytest.approx(-24, rel=1e-15)
    assert not found.sound


def test_a_doubled_face_is_a_duplicate_either_way_round():
    for extra in (CUBE[3:4], CUBE[3:4, ::-1]):
        found = audit(np.concatenate([CUBE, extra]))
        assert found.duplicate_faces == 1
        assert found.overused_edges == 3
    # Two triangles back to back close each other: only the duplicate gives them away.
    pair = audit(np.concatenate([CUBE[:1], CUBE[:1, ::-1]]))
    assert pair.closed
    assert pair.duplicate_faces == 1
    assert not pair.sound


def test_degenerate_and_flat_faces():
    point = np.zeros((1, 3, 3), dtype=np.float32)
    line = np.array([[[0, 0, 0], [1, 1, 1], [3, 3, 3]]], dtype=np.float32)
    found = audit(np.concatenate([CUBE, point, line]))
    assert (found.degenerate_faces, found.flat_faces) == (1, 1)


def test_cubes_that_touch_along_an_edge():
    touching = np.concatenate([CUBE, CUBE + np.float32([2, 3, 0])])
    found = audit(touching)
    assert found.overused_edges == 1
    assert found.first_fault_mm == (2.0, 3.0, 2.0)


def test_bodies_are_joined_by_edges_not_by_vertices():
    assert audit(np.concatenate([CUBE, CUBE + np.float32([2, 3, 4])])).bodies == 2
    shell = Manifold.sphere(2, 32) - Manifold.sphere(1, 32)
    found = audit(soup(shell))
    assert found.bodies == 2
    assert found.sound


def test_nothing_and_not_a_number():
    found = audit(np.empty((0, 3, 3), dtype=np.float32))
    assert not found.sound
    assert np.isfinite(found.bounds_mm).all()
    broken = CUBE.copy()
    broken[7, 1, 2] = np.inf
    with pytest.raises(MeshError, match="triangle 7"):
        audit(broken)


def halves(shift=0.0, turn=False):
    """A box in two, the upper half's lower face moved or triangulated differently."""
    low = soup(Manifold.cube([1, 1, 1]))
    high = soup(Manifold.cube([1, 1, 1]).translate([0, 0, 1 + shift]))
    if turn:
        # The other diagonal of the interface.
        flat = (high[:, :, 2] == 1).all(axis=1)
        corners = np.array([[0, 0], [0, 1], [1, 1], [1, 0]], dtype=np.float32)
        shared = set(map(tuple, high[flat][0][:, :2])) & set(map(tuple, high[flat][1][:, :2]))
        start = next(i for i in range(4) if tuple(corners[i]) not in shared)
        ring = np.c_[np.roll(corners, -start, axis=0), np.ones(4)].astype(np.float32)
        high[flat] = [ring[[0, 1, 2]], ring[[0, 2, 3]]]
    return [low, high]


@pytest.mark.parametrize(
    ("shells", "ok"),
    [
        (halves(), True), (halves(shift=1e-4), False), (halves(turn=True), False),
        (halves()[:1], False), ([*halves(), halves()[0]], False),
        ([halves()[0], halves()[1][:, ::-1]], False), ([], False),
    ],
)  # fmt: skip
def test_interfaces(shells, ok):
    box = soup(Manifold.cube([1, 1, 2]))
    part = Mesh(box.reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert interfaces_cancel(join_shells(shells), part) is ok


def damaged(soup, rng):
    """A soup with faces left out, turned over, doubled, on other vertices, or as it was."""
    soup = soup.copy()
    some = rng.integers(len(soup), size=int(rng.integers(1, 4)))
    match rng.integers(6):
        case 0:
            soup = np.delete(soup, some, axis=0)
        case 1:
            soup[some] = soup[some, ::-1]
        case 2:
            soup = np.concatenate([soup, soup[some]])
        case 3:
            soup = np.concatenate([soup, soup[some, ::-1]])
        case 4:
            soup[some, 0] = soup[rng.integers(len(soup)), 0]
    return soup


def test_what_is_sound_is_so_by_counting_and_by_manifold3d():
    """Shells are judged by edges paired in buckets: hold that against two others' judgement."""
    rng = np.random.default_rng(16)
    verdicts = []
    for _ in range(300):
        ball = Manifold.sphere(1.0 + rng.random(), int(rng.integers(4, 24)))
        if rng.random() < 0.3:  # vertices with many faces, and a second body
            ball += Manifold.cylinder(3.0, 0.5, 0.5, 64).translate([4.0 * rng.random(), 0, 0])
        found = damaged(soup(ball), rng)
        shells = join_shells([found])
        counted = audit(found)
        assert shells.sound(0) is counted.sound
        if counted.sound:
            made = Manifold(
                MeshGL(vert_properties=shells.vertices, tri_verts=shells.faces[0].astype(np.uint32))
            )
            assert made.status() == Error.NoError
            assert made.volume() > 0.0
        verdicts.append(counted.sound)
    assert 30 < sum(verdicts) < 270  # of both kinds there are enough


def test_bytes_of_an_stl_are_held_against_its_mesh():
    shells = join_shells([CUBE])
    data = encode_stl(shells.vertices, shells.faces[0], "a box")
    assert stl_holds(data, shells.vertices, shells.faces[0])
    assert not stl_holds(data, shells.vertices, shells.faces[0][:, [1, 2, 0]])
    assert not stl_holds(data[:-50], shells.vertices, shells.faces[0])
    for place in (84 + 12, 84 + 7 * 50 + 30, len(data) - 3):  # a bit of a coordinate
        assert not stl_holds(
            data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :],
            shells.vertices, shells.faces[0],
        )  # fmt: skip
