"""Cut cells: exact where the answer is known, and pieces that share what they should."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy import sparse

from planner import simulation
from planner.errors import ArgumentError, MeshError
from planner.formats.mesh_file import read_mesh
from planner.mesh.halve import halve_long_edges
from planner.mesh.mesh import Mesh, Topology
from planner.mesh.part import make_part
from planner.simulation.cut_cells import CutCells, cut_cells


def box(extents, low=(0.0, 0.0, 0.0)) -> Mesh:
    body = trimesh.creation.box(extents)
    return Mesh(body.vertices - body.bounds[0] + low, body.faces)


def united(*meshes: Mesh) -> Mesh:
    counts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + n for m, n in zip(meshes, counts, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def places(cells: CutCells) -> np.ndarray:
    """Quadrature points in mm."""
    of = np.repeat(np.arange(len(cells.index)), np.diff(cells.offsets))
    return cells.origin_mm + (cells.index[of] + (cells.points + 1) / 2) * cells.cell_mm


def integral(cells: CutCells, function) -> float:
    return float(np.sum(cells.weights_mm3 * function(*places(cells).T)))


def test_a_box_on_the_lattice_is_full_cells_and_exact():
    cells = cut_cells(box((6, 4, 5), low=(1, 2, 3)), 2.0)
    assert cells.cell_mm == pytest.approx([2, 2, 5 / 3])
    assert len(cells.index) == 3 * 2 * 3
    assert np.all(np.diff(cells.offsets) == 27)
    assert len(cells.node_mm) == 7 * 5 * 7
    assert cells.volume_mm3 == pytest.approx(120, rel=1e-14)
    exact = (7**5 - 1) / 5 * (6**2 - 2**2) / 2 * (8**2 - 3**2) / 2
    assert integral(cells, lambda x, y, z: x**4 * y * z) == pytest.approx(exact, rel=1e-13)


def test_a_cell_larger_than_the_part_is_refused():
    with pytest.raises(ArgumentError, match="`cell_mm` 9"):
        cut_cells(box((6, 4, 5)), 9.0)


def moments(cells: CutCells) -> np.ndarray:
    """All monomials up to degree 6 over the part, about its middle, in half its length."""
    middle = cells.surface.bounds_mm.mean(axis=0)
    x, y, z = (places(cells) - middle).T / (np.ptp(cells.surface.bounds_mm) / 2)
    return np.array(
        [
            np.sum(cells.weights_mm3 * x**a * y**b * z ** (d - a - b))
            for d in range(7)
            for a in range(d + 1)
            for b in range(d + 1 - a)
        ]
    )


def columns_moments(cells: CutCells) -> np.ndarray:
    """The same of the columns themselves, by four Gauss points in each segment."""
    material = cells.material
    h, (number, low, high) = cells.cell_mm, material.segments.T
    u0, v0, pitch, cos, sin = material.frame[:5]
    u = u0 + pitch * (number % material.across)
    v = v0 + pitch * (number // material.across)
    x, y = cos * u - sin * v, sin * u + cos * v
    area = h[0] * h[1] / material.per_foot[material.foot[number]]
    low, high = low * h[2] / material.voxels, high * h[2] / material.voxels
    middle = np.ptp(cells.surface.bounds_mm, axis=0) / 2
    scale = np.ptp(cells.surface.bounds_mm) / 2
    x, y, low, high = (
        (c - m) / scale for c, m in zip((x, y, low, high), middle[[0, 1, 2, 2]], strict=True)
    )
    return np.array(
        [
            np.sum(area * scale * x**a * y**b * (high ** (c + 1) - low ** (c + 1)) / (c + 1))
            for d in range(7)
            for a in range(d + 1)
            for b in range(d + 1 - a)
            for c in (d - a - b,)
        ]
    )


def sphere(radius=5.0) -> Mesh:
    body = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return Mesh(body.vertices, body.faces)


def test_weights_are_positive_and_moments_those_of_the_columns():
    """Eight cut cells and no full one: all 84 moments are those of the columns."""
    cells = cut_cells(sphere(), 5.0)
    assert len(cells.index) == 8
    assert cells.weights_mm3.min() > 0
    assert np.all(np.diff(cells.offsets) == 27)
    exact = columns_moments(cells)
    assert moments(cells) == pytest.approx(exact, abs=1e-10 * exact[0])


def turned(mesh: Mesh, axis, radians: float) -> Mesh:
    turn = trimesh.transformations.rotation_matrix(radians, axis)[:3, :3]
    return Mesh(mesh.vertices @ turn.T, mesh.faces)


def second_moments(cells: CutCells) -> np.ndarray:
    p = places(cells)
    p = p - np.average(p, axis=0, weights=cells.weights_mm3)
    return np.einsum("q,qi,qj->ij", cells.weights_mm3, p, p)


def box_moments(extents, axis, radians: float) -> np.ndarray:
    """V L^2 / 12 along each edge, turned."""
    turn = trimesh.transformations.rotation_matrix(radians, axis)[:3, :3]
    return turn @ np.diag(np.prod(extents) * np.square(extents) / 12) @ turn.T


def test_a_box_aslant_has_its_volume_and_moments():
    """10 x 6 x 4 mm: 2e-4 and 5e-4 at 24 columns a cell; measured 3e-5 and 1e-4 at most."""
    extents, axis = (10.0, 6.0, 4.0), (1, 2, 3)
    cells = cut_cells(turned(box(extents, low=(-5, -3, -2)), axis, 0.7), 2.0)
    assert cells.volume_mm3 == pytest.approx(240, rel=2e-4)
    exact = box_moments(extents, axis, 0.7)
    assert second_moments(cells) == pytest.approx(exact, abs=5e-4 * np.trace(exact))


def test_a_sphere_converges_with_the_spacing_of_columns(monkeypatch):
    """Volume of the triangles, exactly known: the error falls faster than the spacing."""
    mesh, errors = sphere(), []
    for n in (6, 12, 24, 48, 96):
        monkeypatch.setattr(simulation.cut_cells, "_COLUMNS_ACROSS", n)
        errors.append(abs(cut_cells(mesh, 5.0).volume_mm3 / mesh.volume_mm3 - 1))
    slope = np.polyfit(np.log([6, 12, 24, 48, 96]), np.log(np.maximum(errors, 1e-7)), 1)[0]
    assert slope < -1.0
    assert errors[2] < 5e-4


def test_a_cylinder_along_a_cell_direction_has_its_moments():
    """A prism of 64 sides, diameter 6, length 20, across the columns: V and V L^2 / 12."""
    mesh = turned(
        Mesh(*(lambda b: (b.vertices, b.faces))(trimesh.creation.cylinder(3, 20, sections=64))),
        (0, 1, 0),
        np.pi / 2,
    )
    cells = cut_cells(mesh, 2.0)
    assert cells.volume_mm3 == pytest.approx(mesh.volume_mm3, rel=3e-4)
    assert second_moments(cells)[0, 0] == pytest.approx(mesh.volume_mm3 * 400 / 12, rel=3e-4)


def walls(gap: float, bottom: float) -> Mesh:
    """A U of two walls of 0.5 mm along y, on a bottom: an outline in x, z, drawn out along y."""
    width = 1.0 + gap
    outline = [(0, 0), (width, 0), (width, 8), (width - 0.5, 8), (width - 0.5, bottom),
               (0.5, bottom), (0.5, 8), (0, 8)]  # fmt: skip
    n = len(outline)
    vertices = np.array([(x, y, z) for y in (0.0, 8.0) for x, z in outline])
    sides = [
        face for i in range(n) for j in [(i + 1) % n] for face in ((i, j, n + j), (i, n + j, n + i))
    ]
    cap = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]
    faces = [*sides, *cap, *((n + a, n + c, n + b) for a, b, c in cap)]
    mesh = Mesh(vertices, np.array(faces, np.int32))
    return mesh if mesh.volume_mm3 > 0 else Mesh(vertices, mesh.faces[:, ::-1])


def bodies(cells):
    """How many bodies there are: their cells share nodes, or meet at an interface."""
    count = len(cells.nodes)
    has = sparse.csr_array((np.ones(27 * count), cells.nodes.ravel(), 27 * np.arange(count + 1)))
    pairs = cells.interface.cells
    met = sparse.coo_array((np.ones(len(pairs)), tuple(pairs.T)), (count, count))
    return sparse.csgraph.connected_components(has @ has.T + met.tocsr())[0]


def test_two_walls_in_a_cell_are_pieces_of_their_own_that_touch_their_ground():
    cells = cut_cells(walls(gap=0.8, bottom=1.0), 2.0)  # 1 x 4 x 4 cells, 1.8 mm wide
    assert cells.volume_mm3 == pytest.approx(8 * (1.8 * 1 + 2 * 0.5 * 7), rel=1e-3)
    assert bodies(cells) == 1
    middle = np.add.reduceat(cells.weights_mm3[:, None] * places(cells), cells.offsets[:-1])
    middle /= np.add.reduceat(cells.weights_mm3, cells.offsets[:-1])[:, None]
    upper, left = middle[:, 2] > 1.0, middle[:, 0] < 0.9
    assert (~upper).sum() == 4  # the ground, and on it in the same cells the feet of both walls
    assert upper.sum() == 2 * 4 * 4
    assert not np.intersect1d(cells.nodes[upper & left], cells.nodes[~(upper & left)]).size
    met = cells.interface
    assert len(met.cells) == 2 * 4
    assert np.all(upper[met.cells].sum(axis=1) == 1)
    assert met.area_mm2.sum() == pytest.approx(2 * 0.5 * 8, rel=0.02)  # by columns of 0.075 mm
    of_point = np.repeat(met.cells[:, 0], np.diff(met.starts))
    at = cells.origin_mm + (cells.index[of_point] + 0.5 * (met.local[:, 0] + 1)) * cells.cell_mm
    np.testing.assert_allclose(at[:, 2], 1.0, atol=1e-3)
    # and vertices of the walls are in their own pieces
    high = cells.surface.vertices[:, 2] > 2.1
    of_left = cells.surface.vertices[:, 0] < 0.9
    assert np.all(left[cells.vertex_cell[high & of_left]])
    assert not left[cells.vertex_cell[high & ~of_left]].any()


@pytest.mark.parametrize("bottom", [1.98, 2.0, 2.02])
def test_walls_on_a_ground_beside_a_face_of_the_lattice_are_joined_by_the_ground(bottom):
    """Also where a skin of the ground touches across the face between the walls."""
    cells = cut_cells(walls(gap=1.6, bottom=bottom), 2.0)  # 2 x 4 x 4 cells, 1.3 mm wide
    assert len(cells.index) == 2 * 4 * 4
    left = cells.index[:, 0] == 0
    shared = np.intersect1d(cells.nodes[left], cells.nodes[~left])
    assert cells.node_mm[shared, 2].max() == 2.0


def test_bodies_apart_share_nothing():
    cells = cut_cells(united(box((4, 4, 4)), box((4, 4, 4), low=(4.3, 0, 0))), 2.0)
    assert bodies(cells) == 2
    assert cells.volume_mm3 == pytest.approx(128, rel=5e-4)  # measured 1.5e-4


def test_a_thin_plate_aslant_holds_together():
    """0.3 mm in cells of 2 mm: one body, its volume and the moment across its face."""
    extents, axis = (20.0, 20.0, 0.3), (1, 0.5, 0.2)
    cells = cut_cells(turned(box(extents, low=(-10, -10, -0.15)), axis, 0.6), 2.0)
    assert bodies(cells) == 1
    assert cells.volume_mm3 == pytest.approx(120, rel=1e-3)
    exact = box_moments(extents, axis, 0.6)
    assert second_moments(cells) == pytest.approx(exact, abs=1e-3 * np.trace(exact))
    assert cells.weights_mm3.min() > 0


def test_a_wall_that_ends_beside_a_face_makes_no_cells_of_single_columns():
    """A step of 0.05 mm beyond x = 4 of a lattice of 2 mm is a skin: it belongs to the wall."""
    step = united(box((4.05, 8, 4)), box((8, 8, 2), low=(0, 0, -2)))
    cells = cut_cells(step, 2.0)
    thin = np.diff(cells.offsets) < 27
    assert not thin.any()
    assert 1.0 < np.abs(cells.points).max() < 1.05 + 1 / 24  # half a column's width more
    assert cells.volume_mm3 == pytest.approx(4.05 * 8 * 4 + 128, rel=1e-3)


def test_vertices_are_placed_where_they_are():
    cells = cut_cells(sphere(), 2.0)
    cell = cells.vertex_cell
    there = cells.origin_mm + (cells.index[cell] + (cells.vertex_local + 1) / 2) * cells.cell_mm
    assert there == pytest.approx(cells.surface.vertices, abs=1e-9)
    assert np.abs(cells.vertex_local).max() < 1.16


def test_a_plane_fits_the_nodes():
    """Nodes of each cell are at its own places."""
    cells = cut_cells(sphere(), 2.0)
    a = np.arange(27)
    local = np.stack([a % 3, a // 3 % 3, a // 9], axis=1) / 2
    place = cells.origin_mm + (cells.index[:, None] + local) * cells.cell_mm
    assert cells.node_mm[cells.nodes] == pytest.approx(place, abs=1e-12)


def test_the_same_on_one_thread_and_on_two_and_again(monkeypatch):
    mesh = turned(box((10, 6, 4)), (1, 2, 3), 0.7)
    two, again = cut_cells(mesh, 2.0), cut_cells(mesh, 2.0)
    monkeypatch.setattr(simulation.cell_quadrature, "_THREADS", 1)
    one = cut_cells(mesh, 2.0)
    for name in ("index", "nodes", "node_mm", "offsets", "points", "weights_mm3", "vertex_local"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
        assert np.array_equal(getattr(two, name), getattr(again, name)), name


def test_cells_of_nearly_the_same_part_take_points_from_there():
    """The bottom is thicker: about its top pieces are others, which have points of their own."""
    other, mesh = walls(2.0, 3.0), walls(2.0, 3.6)
    like, alone = cut_cells(other, 2.0), cut_cells(mesh, 2.0)
    cells = cut_cells(mesh, 2.0, like=like)
    assert np.array_equal(cells.points, alone.points)
    assert cells.weights_mm3 == pytest.approx(alone.weights_mm3, rel=1e-14)
    heavy = replace(like, weights_mm3=2.0 * like.weights_mm3)
    cells = cut_cells(mesh, 2.0, like=heavy)
    ratio = cells.cell_volume_mm3 / alone.cell_volume_mm3
    taken = np.abs(ratio - 2.0) < 1e-12
    assert np.abs(ratio[~taken] - 1.0).max() < 1e-12
    full = alone.cell_volume_mm3 > (1.0 - 1e-12) * np.prod(alone.cell_mm)
    assert set(alone.index[~(taken | full), 2].tolist()) == {1}
    moved = cut_cells(Mesh(mesh.vertices * [1.1, 1.0, 1.0], mesh.faces), 2.0, like=heavy)
    assert moved.volume_mm3 == pytest.approx(1.1 * alone.volume_mm3, rel=1e-3), "another lattice"


def test_the_finger_has_its_volume(samples):
    mesh = make_part(read_mesh(samples / "finger.stl").triangles, name="finger").mesh
    cells = cut_cells(mesh, 4.0)
    assert cells.volume_mm3 == pytest.approx(mesh.volume_mm3, rel=1e-4)
    assert bodies(cells) == 1
    assert cells.dropped_mm3 == 0.0
    assert Topology(cells.surface.faces).closed
    sides = cells.surface.triangles - np.roll(cells.surface.triangles, 1, axis=1)
    assert np.linalg.norm(sides, axis=2).max() <= cells.cell_mm.min() / 2
    assert cells.surface.area_mm2 == pytest.approx(mesh.area_mm2, rel=1e-12)
    fine, triangle = halve_long_edges(mesh, cells.cell_mm.min() / 2)
    assert np.array_equal(fine.faces, cells.surface.faces)
    whole = np.bincount(triangle, _areas(cells.surface), minlength=len(mesh.faces))
    assert whole == pytest.approx(_areas(mesh), rel=1e-9)


def _areas(mesh: Mesh) -> np.ndarray:
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_edge_is_refused(wrong):
    with pytest.raises(ArgumentError, match="`cell_mm`"):
        cut_cells(box((6, 4, 5)), wrong)


def test_far_too_many_cells_are_refused_with_their_number():
    with pytest.raises(ArgumentError, match=r"`cell_mm` 0\.1: the part has at least 120000 cells"):
        cut_cells(box((6, 4, 5)), 0.1)
    with pytest.raises(ArgumentError, match="more than can be sampled"):
        cut_cells(box((6, 4, 5)), 0.001)


def test_an_open_surface_is_refused():
    mesh = box((6, 4, 5))
    with pytest.raises(MeshError, match="open"):
        cut_cells(Mesh(mesh.vertices, mesh.faces[mesh.triangles[:, :, 2].min(axis=1) < 5]), 2.0)


def test_a_wall_that_no_column_meets_is_refused():
    """A foil of 1 µm aslant, between columns 80 µm apart."""
    foil = turned(box((0.0001, 8, 8)), (0, 0, 1), 1.0172)
    with pytest.raises(MeshError, match="no material is found"):
        cut_cells(foil, 2.0)
