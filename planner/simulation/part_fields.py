"""What stands inside a loaded part, from place to place: stress, energy, strain over break."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from planner.numerics import FloatArray, IntArray
from planner.simulation.element import shape_functions

if TYPE_CHECKING:
    from planner.simulation.cut_cells import CutCells
    from planner.simulation.solid import Equilibrium, Mechanics

__all__ = ["PartFields", "fields_of", "hats", "in_cells"]


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
