"""What stands inside a loaded part, from place to place: stress, energy, strain over break."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from planner.formats.vtu import HEXAHEDRON, TETRAHEDRON, WEDGE, encode_vtu
from planner.mesh.clip import clip_hexahedra
from planner.mesh.distance import nearest, triangle_tree
from planner.numerics import FloatArray, IntArray
from planner.simulation.element import shape_functions

if TYPE_CHECKING:
    from planner.simulation.cut_cells import CutCells
    from planner.simulation.solid import Equilibrium, Mechanics

__all__ = ["PartFields", "fields_of", "hats", "in_cells", "volume_vtu"]


@dataclass(frozen=True, eq=False)
class PartFields:
    """One state of a body.

    Attributes
    ----------
    displacement_mm : (N, 3)
        Of the cells' nodes.
    stress_MPa : (Q, 6)
        Cauchy's at the quadrature points: 11, 22, 33, 12, 23, 13.
    energy_MPa : (Q,)
        Stored there, over the volume at rest (N mm / mm³).
    strain_over_break : (n, 8)
        Largest principal strain over the elongation at break, by the mean over neighbouring cells,
        at each cell's corners, x fastest.
    """

    displacement_mm: FloatArray
    stress_MPa: FloatArray
    energy_MPa: FloatArray
    strain_over_break: FloatArray


_ROWS = 1 << 14
# Points whose gradients are held at a time: 10 MB.


def fields_of(
    mechanics: "Mechanics", state: "Equilibrium", strain_over_break: FloatArray
) -> PartFields:
    """Return what stands in a body; Cauchy's stress is F S Fᵀ / J."""
    cells, u = mechanics.body.cells, state.displacement_mm
    of_point = np.repeat(np.arange(len(cells.nodes)), np.diff(cells.offsets))
    stress = np.empty_like(state.stress_MPa)
    for first in range(0, len(of_point), _ROWS):
        rows = slice(first, first + _ROWS)
        gradient = shape_functions(cells.points[rows], cells.cell_mm)[1]
        F = np.eye(3) + np.einsum("qai,qaj->qij", u[cells.nodes[of_point[rows]]], gradient)
        S = state.stress_MPa[rows][:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]
        full = F @ S @ F.transpose(0, 2, 1) / np.linalg.det(F)[:, None, None]
        stress[rows] = full[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    return PartFields(u, stress, mechanics.energy_MPa(state), strain_over_break)


def hats(local: FloatArray) -> FloatArray:
    """Return the eight linear shape functions at places in a cell, (n, 8), x fastest."""
    low, high = 0.5 * (1.0 - local), 0.5 * (1.0 + local)
    ends = np.stack([low, high], axis=2)  # (n, 3, 2)
    values = np.einsum("nk,nj,ni->nkji", ends[:, 2], ends[:, 1], ends[:, 0])
    return np.asarray(values.reshape(-1, 8))


_APART = 10.0
# Between cells of the lattice, whose own coordinates go to 1.2: none is nearest to another's.


def in_cells(cells: "CutCells", places_mm: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the nearest quadrature point of places in the part, its cell, and the place in it.

    Of all pieces of material that share a place of the lattice, the one with that point.
    """
    from scipy.spatial import cKDTree

    of_point = np.repeat(np.arange(len(cells.nodes)), np.diff(cells.offsets))
    tree = cKDTree(cells.points + _APART * cells.index[of_point])
    scaled = (places_mm - cells.origin_mm) / cells.cell_mm
    index = np.clip(np.floor(scaled), cells.index.min(axis=0), cells.index.max(axis=0))
    _, point = tree.query(2.0 * (scaled - index) - 1.0 + _APART * index)
    cell = of_point[point]
    local = 2.0 * (scaled - cells.index[cell]) - 1.0
    return np.asarray(point), cell, np.clip(local, -1.0, 1.0)


# ------------------------------------------------------------------------------------------------
# The volume, for ParaView.

_ACROSS = 3
"""Small hexahedra along a cell's edge: one for each quadrature point of a full cell."""

_NEAR = 1e-3
# of a cell's edge: a corner this near to the surface is on it, so that no sliver is cut off.

_CORNERS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
)


def volume_vtu(
    cells: "CutCells", fields: PartFields, coordinate: FloatArray, grades: FloatArray
) -> bytes:
    """Return a part's volume at rest, with what stands in it: a VTU file.

    Each cell is 27 small hexahedra, those at the surface clipped by it. Each has what stands at
    the nearest quadrature point of its cell.

    Parameters
    ----------
    coordinate : (Q,)
        Of the mixture at the quadrature points.
    grades
        Coordinates of the palette's materials; ``material`` is the number of the nearest, from 0.
    """
    steps = np.stack(np.meshgrid(*3 * [np.arange(_ACROSS + 1)], indexing="ij"), axis=-1)
    steps = steps.reshape(-1, 3)  # z fastest
    # A place on a face, edge or corner is shared by the cells that share the node there.
    part = np.where(steps == 0, 0, np.where(steps == _ACROSS, 2, 1))
    owner = cells.nodes[:, part @ np.array([1, 3, 9])]
    place = _ACROSS * cells.index[:, None].astype(np.int64) + steps
    wide = place.max(axis=(0, 1)) + 1
    key = (place[..., 0] * wide[1] + place[..., 1]) * wide[2] + place[..., 2]
    _, first, number = np.unique(
        np.stack([owner.ravel(), key.ravel()], axis=1),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    number = number.reshape(owner.shape)
    local = 2.0 * steps / _ACROSS - 1.0
    shape, _ = shape_functions(local, cells.cell_mm)
    moved = np.einsum("sa,nai->nsi", shape, fields.displacement_mm[cells.nodes])
    points = cells.origin_mm + place.reshape(-1, 3)[first] / _ACROSS * cells.cell_mm
    u = moved.reshape(-1, 3)[first]

    low = steps[(steps < _ACROSS).all(axis=1)]
    at = (low[:, None] + _CORNERS) @ np.array([(_ACROSS + 1) ** 2, _ACROSS + 1, 1])
    corners, cell = number[:, at].reshape(-1, 8), np.repeat(np.arange(len(number)), len(low))
    point, of, inner = in_cells(cells, points[corners].mean(axis=1))
    mine = of == cell  # another piece of material may stand there
    corners, cell, point, inner = corners[mine], cell[mine], point[mine], inner[mine]

    distance = np.full(len(points), -1.0)
    volume = np.zeros(tuple(cells.index.max(axis=0) + 1))
    np.add.at(volume, tuple(cells.index.T), np.add.reduceat(cells.weights_mm3, cells.offsets[:-1]))
    full = volume[tuple(cells.index.T)] > (1.0 - 1e-9) * np.prod(cells.cell_mm)
    asked = np.unique(corners[~full[cell]])
    away, outside = nearest(triangle_tree(cells.surface), points[asked])
    distance[asked] = np.where(outside, away, -away) - _NEAR * float(cells.cell_mm.min())
    kept = clip_hexahedra(corners, points, distance)

    def cut(values: FloatArray) -> FloatArray:
        a, b = values[kept.edge[:, 0]], values[kept.edge[:, 1]]
        return np.concatenate([values, a + kept.share[:, None] * (b - a)])

    used = np.concatenate([kept.of_hexahedron, kept.of_wedge, kept.of_tetrahedron])
    point, shares = point[used], hats(inner[used])
    return encode_vtu(
        cut(points),
        [(HEXAHEDRON, kept.hexahedra), (WEDGE, kept.wedges), (TETRAHEDRON, kept.tetrahedra)],
        point_data={"displacement_mm": cut(u)},
        cell_data={
            "material": np.abs(coordinate[point][:, None] - grades).argmin(axis=1).astype(np.int32),
            "coordinate": coordinate[point],
            "stress_MPa": fields.stress_MPa[point].astype(np.float32),
            "energy_MPa": fields.energy_MPa[point].astype(np.float32),
            "strain_over_break": np.einsum(
                "mc,mc->m", shares, fields.strain_over_break[cell[used]]
            ).astype(np.float32),
            "cell": cell[used].astype(np.int32),
        },
    )
