"""A whole part pulled step by step, and what each of its mixtures has to do with its force."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.errors import FileError
from planner.materials.marlow import MarlowTable, marlow_table, uniaxial_strain
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray, IntArray, one_blas_thread
from planner.palette import Palette
from planner.simulation.cut_cells import CutCells
from planner.simulation.element import shape_functions
from planner.simulation.loads import Conditions, LoadCase, read_conditions
from planner.simulation.part import COARSER, COVERS, Solid, open_solid
from planner.simulation.part_response import PartResponse
from planner.simulation.response import answers
from planner.simulation.solid import (
    Body,
    Equilibrium,
    LostStabilityError,
    Mechanics,
)
from planner.simulation.sparse_cholesky import analyse

if TYPE_CHECKING:
    from planner.simulation.sparse_cholesky import Factor

__all__ = [
    "LoadedPart",
    "followed",
    "loaded_part",
    "moved_by",
    "part_response",
    "response_of",
]


# ------------------------------------------------------------------------------------------------
# A plan, held and loaded in one way, cut into cells.


@dataclass(frozen=True, eq=False)
class LoadedPart:
    """A part's cells with what fills them, its supports and its load.

    Attributes
    ----------
    coordinate : (Q,)
        Of the mixture at the cells' quadrature points.
    """

    solid: Solid
    cells: CutCells
    coordinate: FloatArray
    conditions: Conditions


_CELLS = 1500
"""Of material, where no size is given. Chosen: a part that bends is within about two per cent, less
than its prints scatter by."""


def loaded_part(
    solid: Solid, case: LoadCase, *, cell_mm: float | None = None, shift: float = 0.0
) -> LoadedPart:
    """Cut a part into cells, and hold and load it.

    Parameters
    ----------
    case
        Its supports, and a load or a move.
    shift
        As of `Solid.cut`.

    Raises
    ------
    ArgumentError
        Selectors and loads that mean nothing on this part.
    """
    edge = float(np.cbrt(solid.surface.volume_mm3 / _CELLS)) if cell_mm is None else cell_mm
    cells, coordinate = solid.cut(edge, shift=shift)
    return LoadedPart(solid, cells, coordinate, read_conditions(cells.surface, case))


# ------------------------------------------------------------------------------------------------
# Equilibria along the load, with the derivative of the force by the law at every point.


@dataclass(frozen=True, eq=False)
class _Moved:
    """Equilibria of a part: mean displacement of what is loaded, the force on it, and its points.

    Attributes
    ----------
    displacement_mm, force_N : (n,)
        Along the load.
    strain, share : (n, Q)
        As of `PartResponse`, at the quadrature points; without rows where they were not asked for.
    """

    displacement_mm: FloatArray
    force_N: FloatArray
    strain: FloatArray
    share: FloatArray


@one_blas_thread()
def followed(
    part: LoadedPart,
    table: MarlowTable,
    steps: Sequence[float],
    *,
    sensitive: bool = True,
) -> _Moved:
    """Load a part in steps, shares of its whole load, as far as it is stable.

    Parameters
    ----------
    table
        Laws; the palette's, or others.
    """
    cells = part.cells
    mechanics = Mechanics(
        Body(cells, table, part.coordinate),
        part.conditions,
        analyse(cells.nodes, cells.node_mm, cells.interface.cells),
    )
    found: list[tuple[FloatArray, ...]] = []
    try:
        for state, factored in mechanics.follow(list(steps)):
            told = answers(mechanics, state)
            loaded, weights = next(one for one in told if one[0].kind in ("load", "move"))
            strain = share = np.empty(0)
            if sensitive:
                own = mechanics.sensitivity(state, factored, weights(loaded.direction))
                share = own.log_stress + own.log_bulk
                share = share / share.sum()
                strain = uniaxial_strain(mechanics.observe(state).x)
            found.append((loaded.along_mm, loaded.along_N, strain, share))
    except LostStabilityError:
        pass  # as far as it came
    return _Moved(*(np.array([step[k] for step in found]) for k in range(4)))


# ------------------------------------------------------------------------------------------------
# The other way round: how all of a part moves with the material of many places at once.


_RUN = 20_000
"""Points at a time: 30 MB for each of their fields."""


def moved_by(
    mechanics: Mechanics, state: Equilibrium, factored: "Factor", share: Any
) -> FloatArray:
    """Return how far each node goes as the coordinate at the points changes, (N, 3, n).

    It is the tangent K⁻¹ (-∂f/∂m), one solution for each column of `share`; `Mechanics.sensitivity`
    is its adjoint. The load is held. `factored` belongs to the state.

    Parameters
    ----------
    share : (Q, n) sparse
        Changes of the coordinate at the points.
    """
    from scipy.sparse import csr_matrix

    cells, body = mechanics.body.cells, mechanics.body
    count, width = len(cells.node_mm), share.shape[1]
    table, below = body.table, mechanics.table[2]
    above = np.minimum(below + 1, len(table.coordinate) - 1)
    gap = np.maximum(table.coordinate[above] - table.coordinate[below], 1e-12)
    rest = table.log_slope_MPa[:, 0, 0]
    seen = mechanics.observe(state)
    cell = np.repeat(np.arange(len(cells.nodes)), np.diff(cells.offsets))
    pressure = np.einsum("qr,qr->q", state.pressure[cell], mechanics.basis)
    # δp of each cell, by the change of ln κ at its points
    by_bulk = cells.weights_mm3 * pressure / mechanics.bulk * (rest[above] - rest[below]) / gap
    swelling = np.stack(
        [
            np.add.reduceat(share.multiply((by_bulk * psi)[:, None]).toarray(), cells.offsets[:-1])
            for psi in mechanics.basis.T
        ],
        axis=1,
    )
    swelling = np.einsum("crs,csn->crn", mechanics.compliance, swelling)
    square = 2.0 * seen.strain[:, _SQUARE] + np.eye(3)
    bulging = np.linalg.det(square)[:, None, None] ** 0.5 * np.linalg.inv(square)
    iso = state.stress_MPa[:, _SQUARE] - pressure[:, None, None] * bulging
    iso *= (seen.over_m / gap)[:, None, None]
    out = np.zeros((3 * count, width))
    for first in range(0, len(cell), _RUN):
        run = slice(first, first + _RUN)
        nodes = cells.nodes[cell[run]]
        gradient = shape_functions(cells.points[run], cells.cell_mm)[1]
        slope = np.eye(3) + np.einsum("qai,qaj->qij", state.displacement_mm[nodes], gradient)
        rows = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 81)
        ends = 81 * np.arange(len(nodes) + 1)
        changes = (share[run], np.einsum("qr,qrn->qn", mechanics.basis[run], swelling[cell[run]]))
        for stress, change in zip((iso, bulging), changes, strict=True):
            pull = np.einsum("qij,qjm,qam->qai", slope, stress[run], gradient, optimize=True)
            pull *= cells.weights_mm3[run, None, None]
            spread = csr_matrix((pull.ravel(), rows.ravel(), ends), (len(nodes), 3 * count)).T
            out -= spread @ change
    gravity = mechanics.conditions.gravity
    if gravity is not None:
        weight = mechanics.weight_over_m(state.share)
        out += np.kron(weight @ share.toarray(), np.array(gravity)[:, None])
    return factored.solve(out).reshape(count, 3, width)


_SQUARE = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Places of a tensor's six components in its matrix."""


# ------------------------------------------------------------------------------------------------
# The response: points of nearly one mixture and one strain together in a bin.


_STEPS = (0.02, *(0.1 * k for k in range(1, 11)))
"""Shares of the load. Numerical: the first tells the part at rest; between them cubics."""

_BINS = 36
"""Of a part. Numerical: an effect's change of ln stress differs little within a bin."""

_MIXTURES = 12
"""Groups of mixtures, where a part has more of them. Numerical: as a palette has grades."""

_HELD = 0.01
"""Of ln force, whatever the cells. Chosen: what clamps that do not give are off by."""


def part_response(
    source: object,
    palette: Palette,
    *,
    fix: Sequence[str],
    move: str = "",
    load: str = "",
    cell_mm: float | None = None,
) -> PartResponse:
    """Simulate a plan with its supports and its load.

    Parameters
    ----------
    source
        A plan, its folder or its plan.json.
    fix, move, load
        As of `planner.simulate`; one of `move` and `load`, the other "".

    Raises
    ------
    FileError
        No such plan, or no equilibrium is found.
    ArgumentError
        As `loaded_part`.
    """
    solid = open_solid(source, None, None, None, palette)
    case = LoadCase(fix=fix, move=move or (), load=load or ())
    part = loaded_part(solid, case, cell_mm=cell_mm)
    table = marlow_table(CoefficientModel(palette))
    moved = followed(part, table, _STEPS)
    change = 0.0
    for shift in (0.0, 0.5) if len(moved.force_N) > 1 else ():
        edge = COARSER * float(part.cells.cell_mm.max())
        coarser = loaded_part(solid, case, cell_mm=edge, shift=shift)
        other = followed(coarser, table, _STEPS[:1], sensitive=False)
        if len(other.force_N):
            stiffness = [one.force_N[0] / one.displacement_mm[0] for one in (other, moved)]
            change += abs(math.log(stiffness[0] / stiffness[1]))
    # What is told bounds the error of nine parts in ten: 1.645 standard deviations.
    log_sd = math.hypot(_HELD, COVERS * change / 1.645)
    return response_of(part, moved, log_sd=log_sd)


def response_of(part: LoadedPart, moved: _Moved, *, log_sd: float) -> PartResponse:
    """Return a part's response from what its points do.

    Raises
    ------
    FileError
        It was not solved for two steps, or does not resist.
    """
    name, surface = Path(part.solid.name).stem, part.solid.surface
    if len(moved.force_N) < 2:
        raise FileError(
            f"part {name}: no equilibrium under its load; take a smaller one, or one that "
            "does not push a slender part along itself"
        )
    weight = np.abs(moved.share).mean(axis=0)
    weight += 1e-9 * weight.max()  # a point that bears nothing has a mean too
    bin_of = _bins(part.coordinate, moved.strain[-1], weight)
    count = int(bin_of.max()) + 1

    def summed(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(bin_of, values, count), dtype=np.float64)

    total = summed(weight)
    return PartResponse(
        name,
        moved.displacement_mm,
        moved.force_N,
        summed(weight * part.coordinate) / total,
        np.stack([summed(weight * strain) / total for strain in moved.strain]),
        np.stack([summed(share) for share in moved.share]),
        thickness_mm=2.0 * surface.volume_mm3 / surface.area_mm2,
        log_sd=log_sd,
    )


def _bins(coordinate: FloatArray, strain: FloatArray, weight: FloatArray) -> IntArray:
    """Return the number of each point's bin: groups of mixtures, each cut by its last strain.

    Groups have as many bins as their part of the weight, one at least.
    """
    mixtures = np.unique(np.round(coordinate, 9))
    group: IntArray = np.searchsorted(mixtures, np.round(coordinate, 9))
    if len(mixtures) > _MIXTURES:
        group = _quantiles(coordinate, weight, _MIXTURES)
    bins = np.empty(len(coordinate), dtype=np.int64)
    first = 0
    for number in np.unique(group).tolist():
        own = group == number
        wanted = max(1, round(_BINS * float(weight[own].sum() / weight.sum())))
        within = _quantiles(strain[own], weight[own], wanted)
        _, within = np.unique(within, return_inverse=True)
        bins[own] = first + within
        first += int(within.max()) + 1
    return bins


def _quantiles(values: FloatArray, weight: FloatArray, count: int) -> IntArray:
    """Return in which of so many groups of equal weight each value lies."""
    order = np.argsort(values, kind="stable")
    reach = np.cumsum(weight[order])
    found = np.empty(len(values), dtype=np.int64)
    found[order] = np.minimum((count * (reach - 0.5 * weight[order]) / reach[-1]), count - 1)
    return found
