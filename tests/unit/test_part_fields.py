"""What stands inside a loaded part: stress, energy, strain over break; its file and its cut."""

import numpy as np
import pytest
import trimesh

import planner
from planner.materials.mixtures import CoefficientModel
from planner.mesh.mesh import Mesh
from planner.report.loaded_part import _clip_hexahedra, _cut_of, _cut_words
from planner.simulation.part import PartSimulation

FREE = ["x=min: 0,free,free mm", "y=min: free,0,free mm", "z=min: free,free,0 mm"]


def box(*extents: float) -> Mesh:
    body = trimesh.creation.box(extents)
    return Mesh(body.vertices + np.array(extents) / 2, body.faces)


def pulled(**options) -> PartSimulation:
    return planner.simulate(
        box(8.0, 4.0, 4.0), material="FLX9770", cell_mm=2.0, compare_cells=False, steps=1,
        move=[*FREE, "x=max: 1.6,free,free mm"], **options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def bent() -> PartSimulation:
    plan = planner.grade(box(40.0, 8.0, 8.0), from_="Tango", to="Vero", axis="x", profile="grades")
    return planner.simulate(
        plan, fix="x=max", load="x=min: 0,0,-1 N", cell_mm=4.0, steps=2, compare_cells=False
    )


def test_a_bar_pulled_evenly_has_its_stress_and_energy_everywhere():
    result = pulled()
    fields = result.steps.fields
    model = CoefficientModel(result.palette)
    strain = np.linspace(0.0, 0.2, 401)
    nominal = model.nominal_stress_MPa(result.coordinate[0], 1.0 + strain)
    # True stress is the nominal one over the shrunken section. Poisson's ratio is 0.49, not 0.5:
    # 0.4 % of volume, and as much of stress.
    np.testing.assert_allclose(fields.stress_MPa[:, 0], 1.2 * nominal[-1], rtol=1e-2)
    np.testing.assert_allclose(fields.stress_MPa[:, 1:], 0.0, atol=1e-3 * nominal[-1])
    np.testing.assert_allclose(fields.energy_MPa, np.trapezoid(nominal, strain), rtol=1e-2)
    total = float(result.cells.weights_mm3 @ fields.energy_MPa)
    assert total == pytest.approx(result.steps.energy_mJ[-1], rel=1e-12)
    np.testing.assert_allclose(fields.strain_over_break, 0.2 / 0.65, rtol=1e-4)


def test_a_ball_is_clipped_out_of_a_lattice():
    n = 16
    grid = np.stack(np.meshgrid(*3 * [np.linspace(-1, 1, n + 1)], indexing="ij"), axis=-1)
    points, at = grid.reshape(-1, 3), np.arange((n + 1) ** 3).reshape(3 * (n + 1,))
    low, high = slice(None, -1), slice(1, None)
    corners = [at[i, j, k] for k in (low, high) for i, j in
               ((low, low), (high, low), (high, high), (low, high))]  # fmt: skip
    cells, _, edge, share = _clip_hexahedra(
        np.stack([c.ravel() for c in corners], axis=1), points,
        np.linalg.norm(points, axis=1) - 0.83,
    )  # fmt: skip
    hexahedra, wedges, tetrahedra = cells
    ends = points[edge]
    new = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
    points = np.concatenate([points, new])

    def volumes(tets: np.ndarray) -> np.ndarray:
        return np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]]) / 6.0

    in_wedges = [volumes(wedges[:, [*four]]) for four in ((0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5))]
    tets = volumes(tetrahedra)
    assert min(tets.min(), *(w.min() for w in in_wedges)) > -1e-12  # none inside out
    found = len(hexahedra) * (2 / n) ** 3 + tets.sum() + sum(w.sum() for w in in_wedges)
    # A polyhedron within the ball: of second order in an edge, 0.125 of 0.83.
    assert found == pytest.approx(4 / 3 * np.pi * 0.83**3, rel=0.02)
    assert found < 4 / 3 * np.pi * 0.83**3


def test_meshio_opens_the_volume(bent, tmp_path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / "bent.vtu"
    path.write_bytes(planner.part_volume(bent))
    mesh = meshio.read(path)
    assert [block.type for block in mesh.cells] == ["hexahedron"]  # a box is cut by nothing
    nodes = mesh.cells[0].data
    assert len(nodes) == 27 * 40
    size = np.ptp(mesh.points[nodes], axis=1).prod(axis=1)
    assert size.sum() == pytest.approx(40.0 * 64.0)
    # Shared between cells of one material; at the nine interfaces each has its own.
    assert len(mesh.points) == (31 + 9) * 7 * 7
    values = {name: blocks[0] for name, blocks in mesh.cell_data.items()}
    assert values["stress_MPa"].shape == (1080, 6)
    # One small cell a quadrature point, of unequal weight: 5/9 and 8/9 for thirds.
    assert size @ values["energy_MPa"] == pytest.approx(bent.steps.energy_mJ[-1], rel=0.1)
    assert values["strain_over_break"].max() <= bent.steps.largest[-1] * 1.001
    x = mesh.points[nodes].mean(axis=1)[:, 0]
    np.testing.assert_array_equal(values["material"], x // 4.0)
    tip = mesh.points[:, 0] == 0.0
    moved = mesh.point_data["displacement_mm"][tip, 2].mean()
    assert moved == pytest.approx(bent.steps.responses[0].displacement_mm[-1, 2], rel=0.01)


def test_a_round_part_is_clipped_by_its_surface(tmp_path):
    meshio = pytest.importorskip("meshio")
    tube = trimesh.creation.annulus(3.0, 6.0, 20.0)
    result = planner.simulate(
        Mesh(tube.vertices, tube.faces), material="FLX9785", fix="z=min", load="z=max: 1,0,0 N",
        cell_mm=3.0, steps=1, compare_cells=False,
    )  # fmt: skip
    path = tmp_path / "tube.vtu"
    path.write_bytes(planner.part_volume(result))
    mesh = meshio.read(path)
    radius = np.linalg.norm(
        mesh.points[np.concatenate([b.data.ravel() for b in mesh.cells])][:, :2], axis=1
    )
    # Corners lie on the surface, to what a distance bends between them: a ninth of an edge.
    assert radius.min() > 3.0 - 0.1
    assert radius.max() < 6.0 + 0.1
    assert {b.type for b in mesh.cells} == {"hexahedron", "wedge", "tetra"}


def test_the_cut_goes_through_the_worst_place_and_says_so(bent):
    cut = _cut_of(bent)
    worst = bent.steps.largest[-1]
    # Along the bar, not across it, nor along the surface that strains most.
    assert (cut.along, cut.up) == (0, 2)
    assert cut.strain_over_break.shape[1] > 2 * cut.strain_over_break.shape[0]
    assert np.isfinite(cut.strain_over_break).all()
    assert np.nanmax(cut.strain_over_break) == pytest.approx(worst, rel=0.1)
    words = " ".join(_cut_words(bent, cut))
    assert f"by {100.0 * worst:.2g} % of what" in words
    assert "torn" not in words
    page = planner.part_page(bent).decode()
    assert f"largest: {worst:.3g}" in page
    assert page.count("Where it would tear") == 1


def test_what_is_beyond_its_break_is_pink(bent):
    torn = planner.simulate(
        box(12.0, 4.0, 4.0), material="Vero", fix="x=min", move="x=max: 3,0,0 mm", cell_mm=4.0,
        steps=2, compare_cells=False,
    )  # fmt: skip
    words = " ".join(_cut_words(torn, _cut_of(torn)))
    assert "Pink is beyond its break" in words
    assert planner.part_page(torn).decode().count('fill="#E0218A" shape-rendering') == 1
    assert planner.part_page(bent).decode().count('fill="#E0218A" shape-rendering') == 0
