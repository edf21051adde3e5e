"""Load cases of a design on cells: how a part is posed and solved, what its goals come to."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.inverse_design.goals import Functional, Target, posed
from planner.inverse_design.shape import Deviation, ShapeGoal, WantedShape
from planner.materials.marlow import MarlowTable
from planner.materials.mixtures import CoefficientModel
from planner.mesh.mesh import Mesh
from planner.numerics import FloatArray
from planner.simulation.cut_cells import CutCells, cut_cells
from planner.simulation.loads import LoadCase
from planner.simulation.part_sensitivity import moved_by
from planner.simulation.response import (
    CellAverage,
    figure_interval,
    largest_stretch,
    log_stress_sds,
)
from planner.simulation.solid import Body, Equilibrium, LostStabilityError, Mechanics, Sensitivity
from planner.simulation.sparse_cholesky import analyse

if TYPE_CHECKING:
    from planner.simulation.loads import Conditions
    from planner.simulation.sparse_cholesky import Analysis, Factor

__all__ = ["Case", "Solved", "WantedOfPart"]


@dataclass(frozen=True, eq=False)
class WantedOfPart:
    """What is wanted of a part, whatever cells it is cut into.

    Attributes
    ----------
    mesh
        In its own coordinates.
    cases, targets, shapes
        Load cases; targets and limits, and shapes by a surface, of each.
    table, densities
        Of the materials.
    """

    mesh: Mesh
    cases: Sequence[LoadCase]
    targets: Sequence[Sequence[Target]]
    shapes: Sequence[Sequence[WantedShape]]
    table: MarlowTable
    densities: tuple[FloatArray, FloatArray] | None

    def cut(self, size_mm: float, coordinate: float, before: "Sequence[Case]" = ()) -> "list[Case]":
        """Return the cases on cells of a size; their stabilisation is that of one mixture."""
        cells = cut_cells(self.mesh, size_mm)
        even = self.filled(cells, np.full(len(cells.points), coordinate))
        return self.on(replace(even, stabiliser_MPa=even.cell_shear_MPa), before)

    def filled(self, cells: CutCells, coordinate: FloatArray) -> Body:
        """Return cells with mixtures at the quadrature points."""
        return Body(cells, self.table, coordinate, densities=self.densities)

    def on(self, body: Body, before: "Sequence[Case]" = ()) -> "list[Case]":
        """Return the cases on cells, deformed as others are in theirs."""
        cells, made = body.cells, list[Case]()
        analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
        each = posed(self.cases, self.targets, cells.surface)
        for number, (case, (on, goals)) in enumerate(zip(self.cases, each, strict=True)):
            name = case.name or (f"case {number + 1}" if len(self.cases) > 1 else "")
            facets = {watched.selector: watched.facets for watched in on.watched}
            shapes = [ShapeGoal.on(s, cells, facets.get(s.selector)) for s in self.shapes[number]]
            made.append(Case(name, cells, on, analysis, goals, body, shapes))
            if before:
                made[-1].begin_from(before[number])
        return made


_SETTLED = 1e-4
"""Numerical: equilibria are off by about its square, derivatives by about as much."""


@dataclass(eq=False)
class Case:
    """A load case on cells; it keeps its last equilibrium, from which the next one starts."""

    name: str
    cells: CutCells
    conditions: "Conditions"
    analysis: "Analysis"
    goals: Sequence[Functional]
    body: Body
    shapes: Sequence[ShapeGoal] = ()
    mechanics: Mechanics | None = None
    state: Equilibrium | None = None
    average: CellAverage | None = None

    def begin_from(self, other: "Case") -> None:
        """Take over how this part is deformed in other cells, as where the next solution starts."""
        if other.state is None or other.mechanics is None:
            return
        mechanics = Mechanics(self.body, self.conditions, self.analysis)
        moved = other.cells.interpolated(self.cells.node_mm, other.state.displacement_mm)
        self.mechanics, self.state = mechanics, mechanics.state_of(moved, 1.0)

    def solve(self, coordinate: FloatArray, *, steps: int = 0) -> "Solved":
        """Return the equilibrium with mixtures at the quadrature points.

        Parameters
        ----------
        steps
            Take so many equal ones from rest, and give up where one fails; by default from the
            last equilibrium, else from rest by steps that are halved where they must be.

        Raises
        ------
        LostStabilityError
            There is none that way.
        """
        body = replace(self.body, coordinate=coordinate)
        mechanics = Mechanics(body, self.conditions, self.analysis, like=self.mechanics)
        self.mechanics = mechanics
        state, factored = self.state, None
        try:
            if steps:
                state = mechanics.at_rest()
            elif state is None:
                raise LostStabilityError(0.0, None)
            for share in np.linspace(0.0, 1.0, max(steps, 1) + 1)[1:].tolist():
                state, factored = mechanics.settle(state, share, into=factored, settled=_SETTLED)
        except LostStabilityError:
            if steps:
                raise
            state, factored = list(mechanics.follow([1.0], settled=_SETTLED))[-1]
        assert factored is not None
        self.state = state
        if self.average is None:
            self.average = CellAverage(self.cells)
        return Solved(mechanics, state, factored, self.average, self.goals, self.shapes)


@dataclass(frozen=True, eq=False)
class Solved:
    """An equilibrium of a case, with what its goals come to."""

    mechanics: Mechanics
    state: Equilibrium
    factored: "Factor"
    average: CellAverage
    goals: Sequence[Functional]
    shapes: Sequence[ShapeGoal] = ()

    def values(self) -> FloatArray:
        """Return the figures of the goals."""
        return np.array([goal.measure(self.mechanics, self.state)[0] for goal in self.goals])

    def sensitivities(self) -> list[Sensitivity]:
        """Return their derivatives over the material at the points: one solution for each."""
        return [
            self.mechanics.sensitivity(
                self.state, self.factored, goal.measure(self.mechanics, self.state)[1]
            )
            for goal in self.goals
        ]

    def deviations(self) -> list[Deviation]:
        """Return how far the surface is off the shapes that are wanted."""
        return [shape.deviation(self.state.displacement_mm) for shape in self.shapes]

    def shape_rows(self, share: Any) -> FloatArray:
        """Return the changes of all deviations, (m, n), by changes of the coordinate, (Q, n)."""
        moved = moved_by(self.mechanics, self.state, self.factored, share)
        rows = []
        for shape, seen in zip(self.shapes, self.deviations(), strict=True):
            by_vertex = (shape.carried @ moved.reshape(len(moved), -1)).reshape(
                -1, *moved.shape[1:]
            )
            rows.append(seen.rows(by_vertex))
        return np.concatenate(rows)

    def sds(self, model: CoefficientModel, normal: float) -> tuple[FloatArray, FloatArray]:
        """Return the standard deviations of ln(stress) at the points, both ways."""
        return log_stress_sds(self.mechanics, self.state, model, normal)

    def intervals(self, model: CoefficientModel, level: float) -> list[tuple[float, float]]:
        """Return what prints do, of each goal, from the palette's uncertainty."""
        normal = NormalDist().inv_cdf(0.5 + level / 2.0)
        sds = self.sds(model, normal)
        measured = (goal.measure(self.mechanics, self.state) for goal in self.goals)
        return [
            figure_interval(self.mechanics, self.state, self.factored, weights, figure, sds, normal)
            for figure, weights in measured
        ]

    def over_break(self) -> "OverBreak":
        """Return the largest strain over break, and how a smooth stand-in for it changes."""
        mechanics, state = self.mechanics, self.state
        stretch, along = largest_stretch(mechanics.observe(state).strain)
        body = mechanics.body
        breaks = body.table.break_at(body.coordinate)
        ratio = (stretch - 1.0) / breaks
        held = self.average.held
        nodal = np.where(held, self.average.of(ratio), 0.0)
        largest = float(nodal.max())
        volume = np.where(held, self.average.volume, 0.0)
        volume /= volume.sum()
        raised = np.maximum(nodal, 0.0) / largest
        norm = float(np.sum(volume * raised**_NORM) ** (1.0 / _NORM))
        # d norm / d mean, then back to the points, then over strain and over the coordinate
        weights = norm ** (1.0 - _NORM) * volume * raised ** (_NORM - 1.0)
        each = self.average.back(weights)
        square = along[:, [0, 1, 2, 0, 1, 0]] * along[:, [0, 1, 2, 1, 2, 2]]
        tensor = (each / (breaks * stretch))[:, None] * square
        # nodal_forces multiplies by volumes, which `back` has put in already
        pulled = mechanics.nodal_forces(state, tensor / mechanics.body.cells.weights_mm3[:, None])
        through = mechanics.sensitivity(state, self.factored, pulled)
        table = body.table
        gap = 1e-6 * float(np.ptp(table.coordinate)) + 1e-12
        change = (table.break_at(body.coordinate + gap) - breaks) / gap
        direct = -each * ratio / breaks * change
        by_stress = (through.log_stress + through.log_bulk) / norm * largest
        return OverBreak(largest, norm * largest, through.coordinate + direct, by_stress)


_NORM = 12
"""Power of the norm that stands for the largest value in gradients; the limit is on the largest."""


class OverBreak(NamedTuple):
    """Largest strain over break, its norm, and the norm's derivatives over coordinates, (Q,).

    `by_stress` is how the largest changes with ln(stress) at the points, (Q,).
    """

    largest: float
    norm: float
    slope: FloatArray
    by_stress: FloatArray
