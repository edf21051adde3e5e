"""Cut cells: exact where the answer is known, and pieces that share what they should."""

import numpy as np
import pytest
import trimesh

from planner.errors import ArgumentError
from planner.mesh.mesh import Mesh
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
