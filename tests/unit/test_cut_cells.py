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
    columns, h = material.columns, cells.cell_mm
    u0, v0, pitch, cos, sin = material.frame[:5]
    number = np.repeat(np.arange(len(material.foot)), np.diff(columns.offsets))
    u = u0 + pitch * (number % columns.grid.shape[0])
    v = v0 + pitch * (number // columns.grid.shape[0])
    x, y = cos * u - sin * v, sin * u + cos * v
    area = h[0] * h[1] / material.per_foot[material.foot[number]]
    low, high = columns.start * h[2] / material.voxels, columns.stop * h[2] / material.voxels
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
