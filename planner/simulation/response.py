"""What a solid does under its loads: displacements, reactions, strain over break, intervals."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from planner.errors import FileError
from planner.materials.marlow import MarlowTable, marlow_table, uniaxial_strain
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray, IntArray, normal_quantile, one_blas_thread
from planner.palette import Palette
from planner.simulation.cut_cells import CutCells
from planner.simulation.element import SIX, shape_functions
from planner.simulation.loads import Condition, Conditions, LoadCase, read_conditions
from planner.simulation.part import COARSER, COVERS, Solid, open_solid
from planner.simulation.part_response import PartResponse
from planner.simulation.simulate import log_sds
from planner.simulation.solid import Body, Equilibrium, LostStabilityError, Mechanics
from planner.simulation.sparse_cholesky import Factor, analyse

__all__ = [
    "CellAverage",
    "LoadSteps",
    "Response",
    "Solution",
    "answers",
    "part_response",
    "respond",
]


# ------------------------------------------------------------------------------------------------
# What stands inside a loaded part, from place to place: stress, energy, strain over break.


class _PartFields(NamedTuple):
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

    def over_break_at(self, cell: IntArray, local: FloatArray) -> FloatArray:
        """Return the strain over break at places in cells, (n, 3)."""
        return _between(self.strain_over_break, cell, local)


def _fields_of(
    mechanics: Mechanics, state: Equilibrium, strain_over_break: FloatArray
) -> _PartFields:
    """Return what stands in a body; Cauchy's stress is F S Fᵀ / J."""
    u, stress = state.displacement_mm, np.empty_like(state.stress_MPa)
    for run, _, _, F in mechanics.runs(u):
        S = state.stress_MPa[run][:, SIX]
        full = F @ S @ F.transpose(0, 2, 1) / np.linalg.det(F)[:, None, None]
        stress[run] = full[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    return _PartFields(u, stress, mechanics.energy_MPa(state), strain_over_break)


def _between(corners: FloatArray, cell: IntArray, local: FloatArray) -> FloatArray:
    """Return at places in cells, (m, 3), what is given at all cells' corners, (n, 8)."""
    return np.asarray(np.einsum("mc,mc->m", _hats(local), corners[cell]))


def _hats(local: FloatArray) -> FloatArray:
    """Return the eight linear shape functions at places in a cell, (n, 8), x fastest."""
    ends = np.stack([0.5 * (1.0 - local), 0.5 * (1.0 + local)], axis=2)  # (n, 3, 2)
    values = np.einsum("nk,nj,ni->nkji", ends[:, 2], ends[:, 1], ends[:, 0])
    return np.asarray(values.reshape(-1, 8))


# ------------------------------------------------------------------------------------------------
# An equilibrium with its factor: how sure a figure is, and how all of the part moves with the
# material of many places at once.


_OUT_OF_PROPORTION = 2.0
"""By how much more than in proportion to the stiffness a figure may change, for its interval to be
one of its logarithm. Chosen: a bent rubber strip's by up to 1.5, what nearly cancels by ten."""


@dataclass(frozen=True, eq=False)
class Solution:
    """An equilibrium of a body, and the factor of its stiffness there."""

    mechanics: Mechanics
    state: Equilibrium
    factored: Factor

    def log_stress_sds(
        self, model: CoefficientModel, normal: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the standard deviations of ln(stress) at the points, downwards and upwards, (Q,).

        They are those of a bar's interval, at the strain of a tensile test of the same invariant.
        """
        strain = uniaxial_strain(self.mechanics.observe(self.state).x)
        return log_sds(model, self.mechanics.body.coordinate, strain, normal)

    def interval(
        self, weights: FloatArray, figure: float, sds: tuple[FloatArray, FloatArray],
        normal: float,
    ) -> tuple[float, float]:  # fmt: skip
        """Return the interval of a figure whose nodal weights, (N, 3), are given.

        Errors of the grades go together, as in a bar: all softer than thought, or all stiffer, by
        `normal` of their standard deviations `sds` (`log_stress_sds`). It is that of the logarithm,
        save where a figure changes by far more than in proportion to the stiffness, as across the
        load, or between loads that all but cancel.
        """
        each = self.mechanics.sensitivity(self.state, self.factored, weights).log_modulus
        ends = []
        for sign, sd in zip((-1.0, 1.0), sds, strict=True):
            change = sign * normal * float(each @ sd)
            most = abs(figure) * max(1.0, _OUT_OF_PROPORTION * normal * float(sd.max()))
            factor = figure != 0.0 and abs(change) <= most
            ends.append(figure * np.exp(change / figure) if factor else figure + change)
        return float(min(ends)), float(max(ends))

    def moved_by(self, share: Any) -> FloatArray:
        """Return how far each node goes as the coordinate at the points changes, (N, 3, n).

        It is the tangent K⁻¹ (-∂f/∂m), one solution for each column of `share`;
        `Mechanics.sensitivity` is its adjoint. The load is held.

        Parameters
        ----------
        share : (Q, n) sparse
            Changes of the coordinate at the points.
        """
        from scipy.sparse import csr_matrix

        mechanics, state = self.mechanics, self.state
        cells, body = mechanics.body.cells, mechanics.body
        count, width = len(cells.node_mm), share.shape[1]
        seen, pressure = mechanics.observe(state), body.pressure_MPa(state.pressure)
        # δp of each cell, by the change of ln κ at its points
        by_bulk = cells.weights_mm3 * pressure / mechanics.cell_bulk * mechanics.bulk_over_m
        grown = (share.multiply((by_bulk * psi)[:, None]).toarray() for psi in mechanics.basis.T)
        swelling = np.stack([np.add.reduceat(g, cells.offsets[:-1]) for g in grown], axis=1)
        swelling = np.einsum("crs,csn->crn", mechanics.compliance, swelling)
        own = mechanics.table[4] * (seen.growth - 1.0)  # pressure of the points
        inverse = np.linalg.inv(2.0 * seen.strain[:, SIX] + np.eye(3))
        bulging = seen.growth[:, None, None] * inverse
        iso = state.stress_MPa[:, SIX] - (pressure + own)[:, None, None] * bulging
        iso *= seen.over_m[:, None, None]
        out = np.zeros((3 * count, width))
        for run, nodes, gradient, slope in mechanics.runs(state.displacement_mm):
            rows = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 81)
            ends = 81 * np.arange(len(nodes) + 1)
            pressed = share[run].multiply((own * mechanics.bulk_over_m)[run, None]).toarray()
            pressed += np.einsum("qr,qrn->qn", mechanics.basis[run], swelling[cells.cell_of[run]])
            changes = (share[run], pressed)
            for stress, change in zip((iso, bulging), changes, strict=True):
                pull = np.einsum("qij,qjm,qam->qai", slope, stress[run], gradient, optimize=True)
                pull *= cells.weights_mm3[run, None, None]
                spread = csr_matrix((pull.ravel(), rows.ravel(), ends), (len(nodes), 3 * count)).T
                out -= spread @ change
        gravity = mechanics.conditions.gravity
        if gravity is not None:
            weight = mechanics.weight_over_m(state.share)
            out += np.kron(weight @ share.toarray(), np.array(gravity)[:, None])
        return self.factored.solve(out).reshape(count, 3, width)


# ------------------------------------------------------------------------------------------------
# What faces do, and intervals of it.


@dataclass(frozen=True, eq=False)
class Response:
    """What faces did that are loaded, held or watched, over steps, (steps,), or at one, ().

    Attributes
    ----------
    kind
        ``load``, ``moment``, ``move``, ``fix``, ``pressure`` or ``watch``.
    displacement_mm : (..., 3)
        Mean over the faces by their area at rest.
    force_N : (..., 3)
        Of the load, or of the support on the part, in all.
    direction : (3,)
        Of the force or moment, of the motion given, of the axis watched, or of the displacement at
        last.
    interval
        Of the figure that follows from the others at the last step, with the probability asked
        for: of a load or watched faces the displacement along `direction`, mm; of a moment the turn
        about it, degrees; of a support that moves its force, N. None of the others.
    moment_N_mm, turn_deg : (..., 3)
        Of a moment: that of its tractions on the faces as they are, and how far these have turned.
    """

    selector: str
    kind: str
    displacement_mm: FloatArray
    force_N: FloatArray
    direction: FloatArray
    interval: tuple[float, float] | None = None
    moment_N_mm: FloatArray | None = None
    turn_deg: FloatArray | None = None

    @property
    def turned(self) -> dict[str, FloatArray]:
        """What only a moment has, by name."""
        if self.moment_N_mm is None or self.turn_deg is None:
            return {}
        return {"moment_N_mm": self.moment_N_mm, "turn_deg": self.turn_deg}

    @property
    def figure(self) -> FloatArray | None:
        """What follows from the rest, (..., 3): mm, degrees or N; None of a support that holds."""
        own = {"fix": None, "moment": self.turn_deg, "move": self.force_N}
        return own.get(self.kind, self.displacement_mm)

    @property
    def along_mm(self) -> FloatArray:
        """Displacement along `direction`, (...)."""
        return np.asarray(self.displacement_mm @ self.direction)

    @property
    def along_N(self) -> FloatArray:
        """Force along `direction`, (...)."""
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
    fields: _PartFields


def respond(
    mechanics: Mechanics, model: CoefficientModel, *, steps: int, level: float,
    progress: Callable[[float, int, float], None],
) -> LoadSteps:  # fmt: skip
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
    body, cells = mechanics.body, mechanics.body.cells
    at_vertices, _ = shape_functions(cells.vertex_local, cells.cell_mm)
    at_surface = np.clip(cells.vertex_local, -1.0, 1.0)
    average = CellAverage(cells)
    factored, last, lost = None, mechanics.at_rest(), None
    kept: list[dict[str, Any]] = []
    told: list[list[tuple[Response, _Weights]]] = []
    corners = np.empty(0)

    def keep(state: Equilibrium) -> None:
        nonlocal corners
        u = state.displacement_mm
        stretch, _ = mechanics.observe(state).largest_stretch()
        nodal = average.of((stretch - 1.0) / body.table.break_at(body.coordinate))
        corners = nodal[average.number]
        worst = int(np.argmax(np.where(average.held, nodal, -np.inf)))
        moved = np.einsum("va,vai->vi", at_vertices, u[cells.nodes[cells.vertex_cell]])
        kept.append({
            "share": state.share,
            "displacement_mm": moved,
            "strain_over_break": _between(corners, cells.vertex_cell, at_surface),
            "largest": nodal[worst],
            "largest_mm": cells.node_mm[average.node[worst]],
            "energy_mJ": mechanics.energy_mJ(state),
        })  # fmt: skip
        told.append(list(answers(mechanics, state)))

    keep(last)
    try:
        shares = np.linspace(0.0, 1.0, steps + 1)[1:].tolist()
        for reached in mechanics.follow(shares, progress, tangents=False):
            last, factored = reached
            keep(last)
    except LostStabilityError as stop:
        lost, factored, last = stop, None, stop.state or last
        if last.share > kept[-1]["share"]:
            keep(last)
        with suppress(LostStabilityError):  # of a step that has come to just beyond
            factored = mechanics.tangent(last) if last.share else None
    responses = tuple(
        _responses(mechanics, told, last, factored, model, level) if factored is not None else ()
    )
    series: dict[str, Any] = {name: np.stack([one[name] for one in kept]) for name in kept[0]}
    fields = _fields_of(mechanics, last, corners)
    return LoadSteps(**series, responses=responses, lost=lost, fields=fields)


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

    def __init__(self, cells: CutCells) -> None:
        corners = [i + 3 * j + 9 * k for k in (0, 2) for j in (0, 2) for i in (0, 2)]
        self.node, self.number = np.unique(cells.nodes[:, corners], return_inverse=True)
        self.hat = _hats(cells.points) * cells.weights_mm3[:, None]
        self.at = self.number[cells.cell_of]
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


_Weights = Callable[[FloatArray], FloatArray]
"""Nodal weights, (N, 3), of a response's figure along a direction."""


def answers(mechanics: Mechanics, state: Equilibrium) -> "Iterator[tuple[Response, _Weights]]":
    """Yield what faces do at one equilibrium, and the derivative of each figure."""
    on, share, u = mechanics.conditions, state.share, state.displacement_mm

    def answer(
        kind: str, faces: Condition, force_N: FloatArray, direction: FloatArray | None,
        weights: _Weights | None = None, **turned: Any,
    ) -> tuple[Response, _Weights]:  # fmt: skip
        points = mechanics.points_of(faces.facets)
        moved = mechanics.mean(points, u)
        if direction is None:
            direction = force_N if kind == "fix" else moved
        size = float(np.linalg.norm(direction))
        along = direction / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
        told = Response(faces.selector, kind, moved, force_N, along, **turned)
        return told, weights or partial(mechanics.mean_weights, points)

    for force in on.forces:
        given = np.array(force.force_N)
        yield answer("load", force, share * given, given)
    for moment in on.moments:
        given = np.array(moment.moment_N_mm)
        points, pulls = mechanics.couple(moment.facets, given)
        left = share * np.cross(mechanics.place_mm(points, u), pulls).sum(axis=0)
        turn = mechanics.turn_deg(moment.facets, u)
        weights = partial(mechanics.turn_weights, moment.facets, u)
        yield answer("moment", moment, np.zeros(3), given, weights, moment_N_mm=left, turn_deg=turn)
    pulled = zip(on.supports, mechanics.held, mechanics.reactions(state), strict=True)
    for number, (support, held, pull) in enumerate(pulled):
        weights = partial(mechanics.reaction_weights, number)
        kind, way = ("move", held.target_mm) if held.target_mm.any() else ("fix", None)
        yield answer(kind, support, pull, way, weights)
    for pressure in on.pressures:
        yield answer("pressure", pressure, mechanics.push(pressure, share, u).sum(axis=0), None)
    for watched in on.watched:
        axis, seen = watched.axis, watched
        if axis is not None:
            seen = replace(watched, selector=f"{watched.selector} u{'xyz'[axis]}")
        yield answer("watch", seen, np.zeros(3), None if axis is None else np.eye(3)[axis])


def _responses(
    mechanics: Mechanics, over_steps: "Sequence[Sequence[tuple[Response, _Weights]]]",
    last: Equilibrium, factored: Factor, model: CoefficientModel, level: float,
) -> Iterator[Response]:  # fmt: skip
    normal = normal_quantile(level)
    at_last = Solution(mechanics, last, factored)
    sds = at_last.log_stress_sds(model, normal)
    for steps in zip(*over_steps, strict=True):
        told, weights = steps[-1]
        span = None
        if told.figure is not None and told.kind != "pressure":
            figure = float(told.figure @ told.direction)
            span = at_last.interval(weights(told.direction), figure, sds, normal)
        series = ("displacement_mm", "force_N", *told.turned)
        each = {name: np.stack([getattr(one, name) for one, _ in steps]) for name in series}
        yield replace(told, interval=span, **each)


# ------------------------------------------------------------------------------------------------
# A plan, held and loaded in one way, cut into cells.


class LoadedPart(NamedTuple):
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
    edge = math.cbrt(solid.surface.volume_mm3 / _CELLS) if cell_mm is None else cell_mm
    cells, coordinate = solid.cut(edge, shift=shift)
    return LoadedPart(solid, cells, coordinate, read_conditions(cells.surface, case))


# ------------------------------------------------------------------------------------------------
# Equilibria along the load, with the derivative of the force by the law at every point.


class _Moved(NamedTuple):
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
    part: LoadedPart, table: MarlowTable, steps: Sequence[float], *, sensitive: bool = True
) -> _Moved:
    """Load a part in steps, shares of its whole load, as far as it is stable.

    Parameters
    ----------
    table
        Laws; the palette's, or others.
    """
    cells = part.cells
    analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
    mechanics = Mechanics(Body(cells, table, part.coordinate), part.conditions, analysis)
    found: list[tuple[FloatArray, ...]] = []
    try:
        for state, factored in mechanics.follow(list(steps), tangents=sensitive):
            told = answers(mechanics, state)
            loaded, weights = next(one for one in told if one[0].kind in ("load", "move"))
            strain = share = np.empty(0)
            if sensitive:
                own = mechanics.sensitivity(state, factored, weights(loaded.direction))
                share = own.log_modulus / own.log_modulus.sum()
                strain = uniaxial_strain(mechanics.observe(state).x)
            found.append((loaded.along_mm, loaded.along_N, strain, share))
    except LostStabilityError:
        pass  # as far as it came
    return _Moved(*(np.array([step[k] for step in found]) for k in range(4)))


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
    return response_of(part, moved, log_sd=math.hypot(_HELD, COVERS * change / 1.645))


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
    coordinate = summed(weight * part.coordinate) / total
    strain = np.stack([summed(weight * strain) / total for strain in moved.strain])
    share = np.stack([summed(share) for share in moved.share])
    thickness_mm = 2.0 * surface.volume_mm3 / surface.area_mm2
    return PartResponse(
        name, moved.displacement_mm, moved.force_N, coordinate, strain, share, thickness_mm, log_sd
    )


def _bins(coordinate: FloatArray, strain: FloatArray, weight: FloatArray) -> IntArray:
    """Return the number of each point's bin: groups of mixtures, each cut by its last strain.

    Groups have as many bins as their part of the weight, one at least.
    """
    mixtures = np.unique(np.round(coordinate, 9))
    group: IntArray = np.searchsorted(mixtures, np.round(coordinate, 9))
    if len(mixtures) > _MIXTURES:
        group = _quantiles(coordinate, weight, _MIXTURES)
    bins = _BINS * group
    for number in np.unique(group).tolist():
        own = group == number
        wanted = max(1, round(_BINS * float(weight[own].sum() / weight.sum())))
        bins[own] += _quantiles(strain[own], weight[own], wanted)
    return np.unique(bins, return_inverse=True)[1]


def _quantiles(values: FloatArray, weight: FloatArray, count: int) -> IntArray:
    """Return in which of so many groups of equal weight each value lies."""
    order = np.argsort(values, kind="stable")
    reach = np.cumsum(weight[order])
    found: FloatArray = np.minimum(count * (reach - 0.5 * weight[order]) / reach[-1], count - 1)
    return found[np.argsort(order)].astype(np.int64)
