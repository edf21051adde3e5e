"""Load cases of a part on cells, and the search for the gradient that brings them to targets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from planner.inverse_design.controls import Controls, StiffnessRange
from planner.inverse_design.goals import (
    Deviation,
    Functional,
    Limits,
    ShapeGoal,
    Target,
    WantedShape,
    posed,
)
from planner.materials.marlow import MarlowTable
from planner.materials.mixtures import CoefficientModel
from planner.mesh.mesh import Mesh
from planner.numerics import FloatArray, interrupted, normal_quantile
from planner.simulation.cut_cells import CutCells, cut_cells
from planner.simulation.loads import Conditions, LoadCase
from planner.simulation.response import CellAverage, Solution
from planner.simulation.solid import Body, Equilibrium, LostStabilityError, Mechanics
from planner.simulation.sparse_cholesky import Analysis, Factor, analyse

__all__ = [
    "Case", "DesignProblem", "Found", "Solved", "Tried", "WantedOfPart", "evaluate",
    "next_values", "search",
]  # fmt: skip


# ------------------------------------------------------------------------------------------------
# Load cases on one set of cells.


class WantedOfPart(NamedTuple):
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
        return self.on(cells, np.full(len(cells.points), coordinate), before, varies=True)

    def on(
        self, cells: CutCells, coordinate: FloatArray, before: "Sequence[Case]", *, varies: bool
    ) -> "list[Case]":
        """Return the cases on filled cells, deformed as others are in theirs."""
        body, made = Body(cells, self.table, coordinate, densities=self.densities), list[Case]()
        body = replace(body, stabiliser_MPa=body.cell_shear_MPa if varies else None)
        analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
        each = posed(self.cases, self.targets, cells.surface)
        both = zip(self.cases, self.shapes, each, strict=True)
        for number, (case, wanted, (on, goals)) in enumerate(both):
            facets = {watched.selector: watched.facets for watched in on.watched}
            shapes = [ShapeGoal.on(s, cells, facets.get(s.target.selector)) for s in wanted]
            made.append(Case(case.name, cells, on, analysis, goals, body, shapes))
            if before:
                made[-1].begin_from(before[number])
        return made


_SETTLED = 5e-3
"""Numerical: equilibria are off by about its square, derivatives by about as much."""

_TOLD = 3e-2
"""The same, of figures that are only told."""


@dataclass(eq=False)
class Case:
    """A load case on cells; it keeps its last equilibrium and factor: the next starts from them."""

    name: str
    cells: CutCells
    conditions: Conditions
    analysis: Analysis
    goals: Sequence[Functional]
    body: Body
    shapes: Sequence[ShapeGoal] = ()
    mechanics: Mechanics | None = None
    state: Equilibrium | None = None
    factored: Factor | None = None

    def begin_from(self, other: "Case") -> None:
        """Take over how this part is deformed in other cells, whence the next solution starts.

        The other's memory is taken, and with it its factor.
        """
        if other.state is None or other.mechanics is None:
            return
        self.mechanics = Mechanics(self.body, self.conditions, self.analysis, like=other.mechanics)
        self.state = self.mechanics.state_like(other.mechanics, other.state)
        self.factored, other.factored = other.factored, None

    def solve(self, coordinate: FloatArray, *, steps: int = 0, tangent: bool = True) -> "Solved":
        """Return the equilibrium with mixtures at the quadrature points.

        Parameters
        ----------
        steps
            Take so many equal ones from rest, and give up where one fails: the equilibrium is as
            good as is told. By default from the last one, else from rest by steps that are halved
            where they must be.
        tangent
            As of `Mechanics.equilibrated`.

        Raises
        ------
        LostStabilityError
            There is none that way.
        """
        body = replace(self.body, coordinate=coordinate)
        mechanics = Mechanics(body, self.conditions, self.analysis, like=self.mechanics)
        self.mechanics = mechanics
        state, factored = self.state, self.factored
        self.factored = None  # its memory is taken
        # Where derivatives are wanted, the material is almost that of the factor.
        near = tangent and factored is not None and factored.analysis is self.analysis
        shares = np.linspace(0.0, 1.0, max(steps, 1) + 1)[1:].tolist()
        settled = _TOLD if steps else _SETTLED
        way = mechanics.follow(shares, settled=settled, tangents=not steps, halves=not steps)
        try:
            if steps or state is None:
                raise LostStabilityError(0.0, None)
            state, factored = mechanics.equilibrated(
                state, 1.0, into=factored, near=near, settled=_SETTLED, tangent=tangent
            )
        except LostStabilityError:
            state, factored = list(way)[-1]
        assert factored is not None
        self.state, self.factored = state, factored
        return Solved(mechanics, state, factored, self.goals, self.shapes)


@dataclass(frozen=True, eq=False)
class Solved(Solution):
    """An equilibrium of a case, with what its goals come to."""

    goals: Sequence[Functional]
    shapes: Sequence[ShapeGoal] = ()

    def values(self) -> FloatArray:
        """Return the figures of the goals."""
        return np.array([goal.measure(self.mechanics, self.state)[0] for goal in self.goals])

    def deviations(self) -> list[Deviation]:
        """Return how far the surface is off the shapes that are wanted."""
        return [shape.deviation(self.state.displacement_mm) for shape in self.shapes]

    def intervals(self, model: CoefficientModel, level: float) -> list[tuple[float, float]]:
        """Return what prints do, of each goal, from the palette's uncertainty."""
        normal = normal_quantile(level)
        sds = self.log_stress_sds(model, normal)
        measured = (goal.measure(self.mechanics, self.state) for goal in self.goals)
        return [self.interval(weights, figure, sds, normal) for figure, weights in measured]

    def over_break(self) -> "OverBreak":
        """Return the largest strain over break, and how a smooth stand-in for it changes."""
        mechanics, state = self.mechanics, self.state
        stretch, along = mechanics.observe(state).largest_stretch()
        body = mechanics.body
        breaks = body.table.break_at(body.coordinate)
        ratio = (stretch - 1.0) / breaks
        average = CellAverage(body.cells)
        nodal = np.where(average.held, average.of(ratio), 0.0)
        largest = float(nodal.max())
        volume = np.where(average.held, average.volume, 0.0)
        volume /= volume.sum()
        raised = np.maximum(nodal, 0.0) / largest
        norm = float(np.sum(volume * raised**_NORM) ** (1.0 / _NORM))
        # d norm / d mean, then back to the points, then over strain and over the coordinate
        weights = norm ** (1.0 - _NORM) * volume * raised ** (_NORM - 1.0)
        each = average.back(weights)
        square = along[:, [0, 1, 2, 0, 1, 0]] * along[:, [0, 1, 2, 1, 2, 2]]
        tensor = (each / (breaks * stretch))[:, None] * square
        pulled = mechanics.nodal_forces(state.displacement_mm, tensor)  # with volumes, by `back`
        through = mechanics.sensitivity(state, self.factored, pulled)
        gap = 1e-6 * float(np.ptp(body.table.coordinate)) + 1e-12
        change = (body.table.break_at(body.coordinate + gap) - breaks) / gap
        direct = -each * ratio / breaks * change
        by_stress = through.log_modulus / norm * largest
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


# ------------------------------------------------------------------------------------------------
# The search: linear models of what the cases come to, a quadratic wish, within a trust region.


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """Controls to find.

    Attributes
    ----------
    cases
        Load cases, each with its goals, on cells of one size.
    limits
        Of all cases.
    prefer
        Among gradients that reach the targets: ``smooth``, or ``soft``, which has the least of
        what is stiff.
    tolerance
        Miss of a shape, over its longest way, that counts as whole.
    normal
        Of standard deviations of the palette by which limits are kept; 0 for its own figures.
    miss_weight
        Of a miss of 1 against the wish, whose values are below 1: misses come first.
    """

    stiffness: StiffnessRange
    controls: Controls
    cases: Sequence[Case]
    limits: Limits
    prefer: str
    tolerance: float = 0.01
    normal: float = 0.0
    miss_weight: float = 20.0
    basis: Any = field(init=False)
    volume: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        cells = self.cases[0].cells
        object.__setattr__(self, "basis", self.controls.basis(cells.points_mm))
        volume = self.basis.T @ cells.weights_mm3
        object.__setattr__(self, "volume", volume / volume.sum())

    @property
    def goals(self) -> list[Functional]:
        """Of all cases, in their order."""
        return [goal for case in self.cases for goal in case.goals]

    @property
    def wish(self) -> tuple[FloatArray, FloatArray]:
        """What is made small among gradients that reach the targets: ½ vᵀ H v + gᵀ v."""
        count = len(self.controls.even)
        bend = 2.0 * self.controls.bends.T @ self.controls.bends
        if self.prefer == "soft":
            return 0.1 * bend, self.volume
        return bend + 0.2 / count * np.eye(count), -0.2 / count * self.controls.even


@dataclass(frozen=True, eq=False)
class Tried:
    """A gradient that was tried; derivatives are over its n controls.

    Attributes
    ----------
    values : (n,)
    figures : (goals,)
    off, slopes : (t,), (t, n)
        Of each target: ln(figure / wanted), or the deviation over its scale; times its weight.
    over, over_slopes : (l,), (l, n)
        Of each limit: by how much it is passed, over it; below 0 where it is kept.
    near, near_slopes : (k,), (k, n)
        Whose sum of squares is that of the shapes' deviations over the tolerance.
    shape : float
        The worst shape's root mean square deviation, over its longest way.
    deviations
        That of each shape by a surface.
    by_share : (t, Q)
        Derivatives of each target's miss, without its weight, over the share of stiffness at the
        quadrature points.
    """

    values: FloatArray
    figures: FloatArray
    off: FloatArray
    slopes: FloatArray
    over: FloatArray
    over_slopes: FloatArray
    near: FloatArray
    near_slopes: FloatArray
    shape: float
    deviations: tuple[float, ...]
    by_share: FloatArray


def evaluate(problem: DesignProblem, values: FloatArray) -> Tried:
    """Return what a gradient comes to.

    Raises
    ------
    LostStabilityError
        A case has no stable equilibrium under its load.
    """
    basis = problem.basis
    coordinate, over_value = problem.stiffness.coordinates(basis @ values)
    figures: list[float] = []
    rows: dict[str, list[tuple[float, FloatArray]]] = {"off": [], "over": [], "near": []}
    by_share: list[FloatArray] = []
    rms, deviations = [0.0], list[float]()
    limit = problem.limits.strain_over_break
    for case in problem.cases:
        solved = case.solve(coordinate)
        mechanics, state, sds = solved.mechanics, solved.state, None
        if problem.normal:
            sds = solved.log_stress_sds(problem.stiffness.model, problem.normal)
        points = len([goal for goal in case.goals if goal.kind == "near"])
        squares = 0.0
        for goal in case.goals:
            figure, weights = goal.measure(mechanics, state)
            figures.append(figure)
            through = mechanics.sensitivity(state, solved.factored, weights)
            at_points = through.coordinate * over_value
            row = basis.T @ at_points
            if goal.kind in "<>":
                raised = 1.0
                if sds is not None and figure:
                    change = _worst(through.log_modulus, sds, problem.normal)
                    raised += change / abs(figure) * (1.0 if goal.kind == "<" else -1.0)
                sign = np.sign(figure) * raised * (1.0 if goal.kind == "<" else -1.0)
                rows["over"].append((goal.passed(figure * raised), sign * row / goal.wanted))
            elif goal.kind == "near":
                squares += ((figure - goal.wanted) / goal.scale) ** 2 * 3.0 / points
                scale = problem.tolerance * goal.scale * np.sqrt(points / 3.0 / goal.weight)
                rows["near"].append(((figure - goal.wanted) / scale, row / scale))
            else:
                off, slope = goal.miss(figure)
                rows["off"].append((goal.weight * off, goal.weight * slope * row))
                by_share.append(slope * at_points)
        rms.append(float(np.sqrt(squares)))
        if limit is not None:
            seen = solved.over_break()
            most = seen.largest
            if sds is not None:
                most += _worst(seen.by_stress, sds, problem.normal)
            row = basis.T @ (seen.slope * over_value)
            rows["over"].append((float(np.log(most / limit)), row / seen.norm))
        if case.shapes:
            misses = solved.deviations()
            deviations += [miss.rms for miss in misses]
            off_all = np.concatenate([miss.off for miss in misses])
            moved = solved.moved_by(basis.multiply(over_value[:, None]).tocsr())
            rows_all = np.concatenate([miss.rows(moved) for miss in misses])
            both = np.column_stack([rows_all, off_all]) / problem.tolerance
            short: FloatArray = np.asarray(np.linalg.qr(both, mode="r"))  # of the same squares
            rows["near"] += [(float(row[-1]), row[:-1]) for row in short]

    def gathered(name: str) -> tuple[FloatArray, FloatArray]:
        each = rows[name]
        slopes = np.array([row for _, row in each]).reshape(len(each), len(values))
        return np.array([one for one, _ in each]), slopes

    return Tried(
        values, np.array(figures), *gathered("off"), *gathered("over"), *gathered("near"),
        max(rms + deviations), tuple(deviations),
        np.array(by_share).reshape(len(by_share), len(coordinate)),
    )  # fmt: skip


def _worst(each: FloatArray, sds: tuple[FloatArray, FloatArray], normal: float) -> float:
    """Return the largest change that the palette's uncertainty makes, all grades going together."""
    return normal * max(abs(float(each @ sd)) for sd in sds)


_PLEASED = 0.03
"""A step that reaches the targets and gains less than this share of the merit, or less than a miss
of the tolerance weighs, is the last."""


class Found(NamedTuple):
    """The best gradient, how many were tried, and whether the user ended the search.

    `problem` has the weight of a miss that the search came to.
    """

    best: Tried
    tried: int
    problem: DesignProblem
    stopped: bool = False


_HEAVIER, _HEAVIEST = 10.0, 2000.0
"""Times a miss weighs more, and at most, where the wish holds the gradient off its targets."""

_SHAPE_WEIGHT = 20.0
"""Weight of a shape's mean square deviation over the square of the tolerance: it comes first, down
to a small part of the tolerance."""


def search(
    problem: DesignProblem, start: FloatArray, *, tolerance: float, most: int = 25,
    radius: float = 0.25, progress: Callable[[int, float], None] = lambda tried, off: None,
) -> Found:  # fmt: skip
    """Return the gradient that misses targets and limits least, and pleases most among those.

    Sequential quadratic programming with the wish's own curvature: at each step the targets and
    limits are linear, shapes' squares those of linear deviations (Gauss and Newton), the change of
    each control within a radius that follows how well the last step was foretold. An interrupt
    ends it with the best so far.

    Parameters
    ----------
    tolerance
        Relative miss of a target that counts as none.
    progress
        Called with the number of gradients tried and the largest miss.

    Raises
    ------
    LostStabilityError
        No equilibrium at the start.
    """
    best = evaluate(problem, start)
    tried = 1
    progress(tried, missed(best))
    try:
        while tried < most:
            values = next_values(problem, best, radius)
            moved = float(np.abs(values - best.values).max())
            hoped = _merit(problem, best) - _merit(problem, best, values)
            if moved < 1e-4 or hoped <= _enough(problem, best, tolerance) or radius < 1e-3:
                if _hard(best) < tolerance or problem.miss_weight >= _HEAVIEST:
                    break
                problem = replace(problem, miss_weight=_HEAVIER * problem.miss_weight)
                radius = max(radius, 0.1)
                continue
            other = _tried(problem, values)
            tried += 1
            gained = -1.0 if other is None else _merit(problem, best) - _merit(problem, other)
            if other is not None and gained <= 0.05 * hoped and tried < most:
                # The targets bend: aim again, with what the linear model left out put into it.
                change = values - best.values
                off = other.off - best.slopes @ change
                bent = replace(best, off=off, over=other.over - best.over_slopes @ change)
                again = _tried(problem, next_values(problem, bent, radius))
                tried += 1
                if again is not None and _merit(problem, again) < _merit(problem, other):
                    other, gained = again, _merit(problem, best) - _merit(problem, again)
            if other is not None and gained > 0.05 * hoped:
                settled = gained < _enough(problem, other, tolerance)
                best = other
                if gained > 0.7 * hoped:
                    radius = min(2.0 * radius, 0.5)
                if settled and _hard(best) < tolerance:
                    progress(tried, missed(best))
                    break
            else:
                radius = 0.35 * moved
            progress(tried, missed(best))
    except (KeyboardInterrupt, SystemError) as error:
        if not interrupted(error):
            raise
        return Found(best, tried, problem, stopped=True)
    return Found(best, tried, problem)


def _enough(problem: DesignProblem, at: Tried, tolerance: float) -> float:
    """Return which gain is not worth a further step."""
    if missed(at) >= tolerance:
        return (1e-3 if at.shape > tolerance else 1e-5) * _merit(problem, at)
    return max(_PLEASED * _merit(problem, at), tolerance * problem.miss_weight)


def _tried(problem: DesignProblem, values: FloatArray) -> Tried | None:
    try:
        return evaluate(problem, values)
    except LostStabilityError:
        return None


def missed(candidate: Tried) -> float:
    """Return the largest relative miss of a target, a limit or a shape."""
    return max(_hard(candidate), candidate.shape)


def _hard(candidate: Tried) -> float:
    """Return that of a target or a limit."""
    return float(max([0.0, *np.abs(candidate.off).tolist(), *candidate.over.tolist()]))


def _merit(problem: DesignProblem, at: Tried, values: FloatArray | None = None) -> float:
    """Return what a gradient is worth, or what it foretells of other values."""
    values = at.values if values is None else values
    each = ((at.off, at.slopes), (at.over, at.over_slopes), (at.near, at.near_slopes))
    off, over, near = (now + slopes @ (values - at.values) for now, slopes in each)
    hessian, slope = problem.wish
    even = problem.controls.even
    wish = 0.5 * values @ hessian @ values + slope @ values
    wish -= 0.5 * slope @ even if problem.prefer == "smooth" else 0.0  # so that it is above 0
    misses = float(np.sum(np.abs(off)) + np.sum(np.maximum(over, 0.0)))
    return float(problem.miss_weight * misses + _SHAPE_WEIGHT * np.sum(near**2) + wish)


def next_values(
    problem: DesignProblem, at: Tried, radius: float | FloatArray, *, nearest: bool = False
) -> FloatArray:
    """Return the values that make the linear models' merit least within the radius and bounds.

    `nearest`: the values that change least in place of those that please most.
    """
    hessian, slope = problem.wish
    if nearest:
        hessian = hessian + np.eye(len(slope))
        slope = -hessian @ at.values
    near = at.near - at.near_slopes @ at.values
    hessian = hessian + 2.0 * _SHAPE_WEIGHT * at.near_slopes.T @ at.near_slopes
    slope = slope + 2.0 * _SHAPE_WEIGHT * at.near_slopes.T @ near
    rows = [at.slopes, at.over_slopes]
    rest = [at.off - at.slopes @ at.values, at.over - at.over_slopes @ at.values]
    weight = problem.miss_weight
    bounds = [(-weight, weight, len(at.off)), (0.0, weight, len(at.over))]
    if problem.limits.slope is not None:
        steps = problem.controls.slopes * problem.stiffness.span / problem.limits.slope
        rows += [steps, -steps]
        rest += [-np.ones(len(steps)), -np.ones(len(steps))]
        bounds.append((0.0, np.inf, 2 * len(steps)))
    low, high = np.maximum(at.values - radius, 0.0), np.minimum(at.values + radius, 1.0)
    least, most, counts = zip(*bounds, strict=True)
    return _quadratic(
        hessian, slope, np.concatenate(rows), np.concatenate(rest), np.repeat(least, counts),
        np.repeat(most, counts), low, high, at.values,
    )  # fmt: skip


def _quadratic(
    hessian: FloatArray, slope: FloatArray, rows: FloatArray, rest: FloatArray,
    least: FloatArray, most: FloatArray, low: FloatArray, high: FloatArray, start: FloatArray,
) -> FloatArray:  # fmt: skip
    """Minimise ½ yᵀ H y + gᵀ y + Σ max(least r, most r) over a box, r = rows y + rest.

    By the method of multipliers, which lie between `least` and `most` (R. T. Rockafellar, Augmented
    Lagrange multiplier functions and duality in nonconvex programming, SIAM J. Control 12 (1974)
    268); within it by Newton's method projected on the box (D. P. Bertsekas, SIAM J. Control Optim.
    20 (1982) 221).
    """
    size = np.sqrt(np.maximum(np.sum(rows**2, axis=1), 1e-30))
    rows, rest = rows / size[:, None], rest / size
    least, most = least * size, most * size
    stiff = 10.0 * max(float(np.abs(np.diag(hessian)).max()), 1.0)
    y, pull = np.clip(start, low, high), np.zeros(len(rest))

    def value(y: FloatArray) -> float:
        held = np.clip(t := pull + stiff * (rows @ y + rest), least, most)
        return float(0.5 * y @ hessian @ y + slope @ y + held @ (t - 0.5 * held) / stiff)

    for _ in range(60):
        for _ in range(40):
            t = pull + stiff * (rows @ y + rest)
            gradient = hessian @ y + slope + rows.T @ np.clip(t, least, most)
            free = ~(((y <= low) & (gradient > 0.0)) | ((y >= high) & (gradient < 0.0)))
            if not free.any() or np.abs(gradient[free]).max() < 1e-10 * (1.0 + stiff):
                break
            active = rows[(t > least) & (t < most)][:, free]
            curved = hessian[np.ix_(free, free)] + stiff * active.T @ active
            curved[np.diag_indices_from(curved)] += 1e-12 * stiff
            way = np.zeros_like(y)
            way[free] = -np.linalg.solve(curved, gradient[free])
            now, length = value(y), 1.0
            while length > 1e-9:
                moved = np.clip(y + length * way, low, high)
                if value(moved) <= now + 1e-4 * float(gradient @ (moved - y)):
                    break
                length *= 0.5
            if length <= 1e-9:
                break
            y = moved
        before, pull = pull, np.clip(pull + stiff * (rows @ y + rest), least, most)
        if not len(pull) or np.abs(pull - before).max() <= 1e-9 * (stiff + np.abs(pull).max()):
            break
    return y
