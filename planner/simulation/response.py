"""What a solid does under its loads: displacements, reactions, strain over break, intervals."""

from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from planner.materials.marlow import uniaxial_strain
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray, IntArray
from planner.simulation.element import shape_functions
from planner.simulation.simulate import log_sds
from planner.simulation.solid import (
    Equilibrium,
    FacetPoints,
    LostStabilityError,
    Mechanics,
    Progress,
    spread,
)

if TYPE_CHECKING:
    from planner.simulation.cut_cells import CutCells
    from planner.simulation.sparse_cholesky import Factor

__all__ = [
    "CellAverage",
    "LoadSteps",
    "Response",
    "figure_interval",
    "hats",
    "in_cells",
    "log_stress_sds",
    "respond",
    "strain_over_break",
]


# ------------------------------------------------------------------------------------------------
# What stands inside a loaded part, from place to place: stress, energy, strain over break.


@dataclass(frozen=True, eq=False)
class _PartFields:
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


def _fields_of(
    mechanics: "Mechanics", state: "Equilibrium", strain_over_break: FloatArray
) -> _PartFields:
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
    return _PartFields(u, stress, mechanics.energy_MPa(state), strain_over_break)


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
# What faces do, and intervals of it.


@dataclass(frozen=True, eq=False)
class Response:
    """What faces did that are loaded, held or watched.

    Attributes
    ----------
    kind
        ``load``, ``moment``, ``move``, ``fix``, ``pressure`` or ``watch``.
    displacement_mm : (steps, 3)
        Mean over the faces by their area at rest.
    force_N : (steps, 3)
        Of the load, or of the support on the part, in all.
    direction : (3,)
        Of the force or moment, of the motion given, of the axis watched, or of the displacement at
        last.
    interval
        Of the figure that follows from the others at the last step, with the probability asked
        for: of a load or watched faces the displacement along `direction`, mm; of a moment the turn
        about it, degrees; of a support that moves its force, N. None of the others.
    moment_N_mm, turn_deg : (steps, 3)
        Of a moment: that of its tractions on the faces as they are, and how far these have turned.
    """

    selector: str
    kind: str
    displacement_mm: FloatArray
    force_N: FloatArray
    direction: FloatArray
    interval: tuple[float, float] | None
    moment_N_mm: FloatArray | None = None
    turn_deg: FloatArray | None = None

    @property
    def turned(self) -> dict[str, FloatArray]:
        """What only a moment has, by name."""
        if self.moment_N_mm is None or self.turn_deg is None:
            return {}
        return {"moment_N_mm": self.moment_N_mm, "turn_deg": self.turn_deg}

    @property
    def along_mm(self) -> FloatArray:
        """Displacement along `direction`, (steps,)."""
        return np.asarray(self.displacement_mm @ self.direction)

    @property
    def along_N(self) -> FloatArray:
        """Force along `direction`, (steps,)."""
        return np.asarray(self.force_N @ self.direction)

    @property
    def stiffness_N_mm(self) -> float | None:
        """Force over displacement of the last step; None where either is not given."""
        if self.kind not in ("load", "move") or not self.along_mm[-1]:
            return None
        return float(self.along_N[-1] / self.along_mm[-1])


@dataclass(frozen=True, eq=False)
class LoadSteps:
    """Equilibria of a body from rest to its full load, or as far as it is stable.

    Attributes
    ----------
    share : (steps,)
        Of the load, from 0.
    displacement_mm : (steps, V, 3)
        Of the surface's vertices.
    strain_over_break : (steps, V)
        Largest principal strain over the elongation at break, averaged over the neighbouring
        cells, at the surface's vertices.
    largest : (steps,), largest_mm : (steps, 3)
        The largest in the whole material, and where.
    energy_mJ : (steps,)
        Stored in the material.
    lost
        Why it stopped early.
    iterations
        Of Newton's method, in all.
    fields
        What stands inside at the last step.
    """

    share: FloatArray
    displacement_mm: FloatArray
    strain_over_break: FloatArray
    largest: FloatArray
    largest_mm: FloatArray
    energy_mJ: FloatArray
    responses: tuple[Response, ...]
    lost: LostStabilityError | None
    iterations: int
    fields: _PartFields


def respond(
    mechanics: Mechanics,
    model: CoefficientModel,
    *,
    steps: int = 1,
    level: float = 0.95,
    progress: Progress | None = None,
) -> LoadSteps:
    """Load a body step by step.

    Parameters
    ----------
    steps
        Equal steps of the load.
    level
        Probability that an interval holds what a print does.
    progress
        Called at each iteration with the load's share, the iteration and the residual.
    """
    cells = mechanics.body.cells
    at_vertices, _ = shape_functions(cells.vertex_local, cells.cell_mm)
    average = CellAverage(cells)
    states: list[Equilibrium] = [mechanics.at_rest()]
    iterations = 0
    lost = None

    def counted(share: float, iteration: int, residual: float) -> None:
        nonlocal iterations
        iterations += 1
        if progress is not None:
            progress(share, iteration, residual)

    factored, last = None, states[0]
    surface, over_break, largest, places, energy = ([] for _ in range(5))
    corners: list[FloatArray] = []

    def keep(state: Equilibrium) -> None:
        u = state.displacement_mm
        surface.append(np.einsum("va,vai->vi", at_vertices, u[cells.nodes[cells.vertex_cell]]))
        nodal = average.of(strain_over_break(mechanics, state))
        over_break.append(average.at_vertices(nodal))
        corners[:] = [nodal[average.number]]
        worst = int(np.argmax(np.where(average.held, nodal, -np.inf)))
        largest.append(float(nodal[worst]))
        places.append(cells.node_mm[average.node[worst]])
        energy.append(mechanics.energy_mJ(state))

    keep(states[0])
    try:
        shares = np.linspace(0.0, 1.0, steps + 1)[1:].tolist()
        for state, now in mechanics.follow(shares, counted, tangents=False):
            factored = now
            states.append(Equilibrium(  # strains of earlier states are not needed again
                state.share, state.displacement_mm, *_NOTHING, state.iterations
            ))  # fmt: skip
            keep(state)
            last = state
    except LostStabilityError as stop:
        lost = stop
        factored = None if factored is None else mechanics.tangent(last)
    responses = tuple(
        _responses(mechanics, states, last, factored, model, level) if factored is not None else ()
    )
    return LoadSteps(
        np.array([state.share for state in states]),
        np.stack(surface),
        np.stack(over_break),
        np.array(largest),
        np.stack(places),
        np.array(energy),
        responses,
        lost,
        iterations,
        _fields_of(mechanics, last, corners[0]),
    )


_NOTHING = (np.empty((0, 6)), np.empty((0, 6)), np.empty((0, 4)))


def strain_over_break(mechanics: Mechanics, state: Equilibrium) -> FloatArray:
    """Return the largest principal strain over the elongation at break at the points, (Q,)."""
    stretch, _ = largest_stretch(mechanics.observe(state).strain)
    body = mechanics.body
    return np.asarray((stretch - 1.0) / body.table.break_at(body.coordinate))


def largest_stretch(strain: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest principal stretch of Green-Lagrange strains, (Q, 6), and its direction.

    Its derivative over the strain is the direction's square over the stretch.
    """
    square = np.eye(3) + 2.0 * strain[:, np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])]
    values, vectors = np.linalg.eigh(square)
    return np.sqrt(np.maximum(values[:, 2], 0.0)), vectors[:, :, 2]


class CellAverage:
    """Means over neighbouring cells: hat functions of the cells' corners over the material.

    Attributes
    ----------
    node : (n,)
        The corners.
    volume : (n,)
        Of each hat, mm³.
    held : (n,)
        Corners whose hat holds as much material as one at a corner of a block, an eighth: means
        over less, outside of the part, are those of slivers. All, in a part that is thinner.
    """

    def __init__(self, cells: "CutCells") -> None:
        corners = [i + 3 * j + 9 * k for k in (0, 2) for j in (0, 2) for i in (0, 2)]
        self.cells = cells
        self.corner = cells.nodes[:, corners]
        self.node, number = np.unique(self.corner, return_inverse=True)
        self.number = number.reshape(self.corner.shape)
        counts = np.diff(cells.offsets)
        self.hat = hats(cells.points) * cells.weights_mm3[:, None]
        self.at = np.repeat(self.number, counts, axis=0)
        self.volume = np.bincount(self.at.ravel(), self.hat.ravel(), len(self.node))
        held = self.volume > 0.124 * float(np.prod(cells.cell_mm))
        self.held = held if held.any() else np.ones_like(held)

    def of(self, values: FloatArray) -> FloatArray:
        """Return the means at the corners of values at the quadrature points."""
        total = np.bincount(self.at.ravel(), (self.hat * values[:, None]).ravel(), len(self.node))
        return np.asarray(total / np.where(self.volume > 0.0, self.volume, 1.0))

    def back(self, weights: FloatArray) -> FloatArray:
        """Return weights : means as weights of the values at the points, (Q,)."""
        scaled = weights / np.where(self.volume > 0.0, self.volume, 1.0)
        return np.asarray(np.einsum("qc,qc->q", self.hat, scaled[self.at]))

    def at_vertices(self, nodal: FloatArray) -> FloatArray:
        """Return values at the corners between them, at the surface's vertices."""
        shares = hats(np.clip(self.cells.vertex_local, -1.0, 1.0))
        return np.asarray(np.einsum("vc,vc->v", shares, nodal[self.number[self.cells.vertex_cell]]))


def _responses(
    mechanics: Mechanics,
    states: list[Equilibrium],
    last: Equilibrium,
    factored: "Factor",
    model: CoefficientModel,
    level: float,
) -> "list[Response]":
    conditions = mechanics.conditions
    normal = NormalDist().inv_cdf(0.5 + level / 2.0)
    sds = log_stress_sds(mechanics, last, model, normal)
    shares = np.array([state.share for state in states])[:, None]
    reactions = np.array([mechanics.reactions(state) for state in states])

    def interval(figure: float, weights: FloatArray, positive: bool = True) -> tuple[float, float]:
        return figure_interval(
            mechanics, last, factored, weights, figure, sds, normal, positive=positive
        )

    out = []

    def moved(points: FacetPoints) -> FloatArray:
        return np.array([mechanics.mean(points, state.displacement_mm) for state in states])

    span: tuple[float, float] | None

    def add(
        name: str, kind: str, points: FacetPoints, pulls: FloatArray, direction: FloatArray | None
    ) -> None:
        where = moved(points)
        along = _unit(where[-1]) if direction is None else direction
        span = None
        if kind != "pressure":
            weights = mechanics.mean_weights(points, along)
            # Loads do work, so that what they move goes their way.
            span = interval(float(where[-1] @ along), weights, kind == "load")
        out.append(Response(name, kind, where, pulls, along, span))

    for force in conditions.forces:
        given = np.array(force.force_N)
        points = mechanics.points_of(force.facets)
        add(force.selector, "load", points, shares * given, _unit(given))
    for moment in conditions.moments:
        given = np.array(moment.moment_N_mm)
        points, pulls = mechanics.couple(moment.facets, given)
        arms = [mechanics.place_mm(points, state.displacement_mm) for state in states]
        moments = np.array([np.cross(arm, pulls).sum(axis=0) for arm in arms])
        turns = np.array([mechanics.turn_deg(moment.facets, s.displacement_mm) for s in states])
        _, rates = mechanics.couple(moment.facets, _unit(given), last.displacement_mm)
        weights = spread(mechanics.body.cells, points, np.degrees(rates))
        out.append(Response(
            moment.selector, "moment", moved(points), 0.0 * turns, _unit(given),
            interval(float(turns[-1] @ _unit(given)), weights), shares * moments, turns,
        ))  # fmt: skip
    for k, support in enumerate(conditions.supports):
        held, pull = mechanics.held[k], reactions[:, k]
        moves = bool(held.target_mm.any())
        along = _unit(held.target_mm if moves else pull[-1])
        span = None
        if moves:
            span = interval(float(pull[-1] @ along), mechanics.reaction_weights(k, along))
        kind = "move" if moves else "fix"
        out.append(Response(support.selector, kind, moved(held.points), pull, along, span))
    for pressure, pushed in zip(conditions.pressures, mechanics.pushed, strict=True):
        push = np.array([mechanics.push(pushed, s.share, s.displacement_mm) for s in states])
        add(pressure.selector, "pressure", pushed.points, push, None)
    for watched in conditions.watched:
        axis, points = watched.axis, mechanics.points_of(watched.facets)
        name = watched.selector if axis is None else f"{watched.selector} u{'xyz'[axis]}"
        nothing = np.zeros((len(states), 3))
        add(name, "watch", points, nothing, None if axis is None else np.eye(3)[axis])
    return out


def figure_interval(
    mechanics: Mechanics,
    state: Equilibrium,
    factored: "Factor",
    weights: FloatArray,
    figure: float,
    sds: tuple[FloatArray, FloatArray],
    normal: float,
    *,
    positive: bool = False,
) -> tuple[float, float]:
    """Return the interval of a figure whose nodal weights, (N, 3), are given.

    Errors of the grades go together, as in a bar: all softer than thought, or all stiffer, by
    `normal` of their standard deviations `sds` (`log_stress_sds`). It is that of the logarithm,
    save where a figure that may have either sign changes by more than itself, as across the load.
    """
    found = mechanics.sensitivity(state, factored, weights)
    each = found.log_stress + found.log_bulk
    ends = []
    for sign, sd in zip((-1.0, 1.0), sds, strict=True):
        change = sign * normal * float(each @ sd)
        factor = figure != 0.0 and (positive or abs(change) < abs(figure))
        ends.append(figure * np.exp(change / figure) if factor else figure + change)
    return float(min(ends)), float(max(ends))


def _unit(vector: FloatArray) -> FloatArray:
    size = float(np.linalg.norm(vector))
    return vector / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def log_stress_sds(
    mechanics: Mechanics, state: Equilibrium, model: CoefficientModel, normal: float
) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviations of ln(stress) at the points, downwards and upwards, (Q,).

    They are those of a bar's interval, at the strain of a tensile test of the same invariant.
    """
    strain = uniaxial_strain(mechanics.observe(state).x)
    return log_sds(model, mechanics.body.coordinate, strain, normal)
