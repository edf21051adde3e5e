"""Search for the profile of stiffness with which load cases come to their targets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from planner.inverse_design.goals import Functional, Limits
from planner.materials.mixtures import CoefficientModel, coordinate_for
from planner.numerics import FloatArray
from planner.simulation.response import CellAverage, largest_stretch
from planner.simulation.solid import Body, Equilibrium, LostStabilityError, Mechanics

if TYPE_CHECKING:
    from planner.simulation.cut_cells import CutCells
    from planner.simulation.loads import Conditions
    from planner.simulation.sparse_cholesky import Analysis, Factor

__all__ = ["Case", "Found", "Knots", "ProfileProblem", "TriedProfile", "search"]


# ------------------------------------------------------------------------------------------------
# The unknowns: ln(modulus) at knots of the field, as a share of the way from the softest to the
# stiffest that is allowed; straight lines between, as planning's profiles have them.


@dataclass(frozen=True, eq=False)
class Knots:
    """Stiffness along a field by its values at evenly spaced knots.

    Attributes
    ----------
    count
        Of knots.
    moduli_MPa
        Softest and stiffest that is allowed: values 0 and 1.
    model, at_strain
        Turn a modulus into a mixture.
    """

    count: int
    moduli_MPa: tuple[float, float]
    model: CoefficientModel
    at_strain: float

    @property
    def positions(self) -> FloatArray:
        """Field values of the knots, (count,)."""
        return np.linspace(0.0, 1.0, self.count)

    @property
    def span(self) -> float:
        """ln(stiffest / softest)."""
        return float(np.log(self.moduli_MPa[1] / self.moduli_MPa[0]))

    def modulus_MPa(self, values: FloatArray) -> FloatArray:
        """Return the moduli that values mean."""
        return np.asarray(self.moduli_MPa[0] * np.exp(self.span * values))

    def weights(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the knot below each field value, and the share of the way to the next."""
        at = np.clip(u, 0.0, 1.0) * (self.count - 1)
        below = np.minimum(at.astype(np.int64), self.count - 2)
        return below, at - below

    def coordinates(self, values: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mixtures' coordinates at field values, and their derivative over the value."""
        nodes = np.linspace(0.0, 1.0, 2049)
        known = coordinate_for(self.model, self.modulus_MPa(nodes), self.at_strain)
        at = np.interp(u, self.positions, values)
        step = nodes[1]
        cell = np.clip((at / step).astype(np.int64), 0, len(nodes) - 2)
        return np.interp(at, nodes, known), (known[cell + 1] - known[cell]) / step

    def gathered(self, u: FloatArray, each: FloatArray) -> FloatArray:
        """Return derivatives over the knots' values of what has them over values at points."""
        below, share = self.weights(u)
        low = np.bincount(below, each * (1.0 - share), self.count)
        return np.asarray(low + np.bincount(below + 1, each * share, self.count))


# ------------------------------------------------------------------------------------------------
# One load case on one set of cells.


@dataclass(eq=False)
class Case:
    """A load case on cells; it keeps its last equilibrium, from which the next one starts."""

    name: str
    cells: "CutCells"
    conditions: "Conditions"
    analysis: "Analysis"
    goals: Sequence[Functional]
    body: Body
    mechanics: Mechanics | None = None
    state: Equilibrium | None = None
    average: CellAverage | None = None

    def solve(self, coordinate: FloatArray) -> "Solved":
        """Return the equilibrium with mixtures at the quadrature points.

        Raises
        ------
        LostStabilityError
            Neither from the last equilibrium nor from rest is there one.
        """
        body = replace(self.body, coordinate=coordinate)
        mechanics = Mechanics(body, self.conditions, self.analysis, like=self.mechanics)
        self.mechanics = mechanics
        try:
            if self.state is None:
                raise LostStabilityError(0.0, None)
            state, factored = mechanics.settle(self.state, 1.0)
        except LostStabilityError:
            state, factored = list(mechanics.follow([1.0]))[-1]
        self.state = state
        if self.average is None:
            self.average = CellAverage(self.cells)
        return Solved(mechanics, state, factored, self.average, self.goals)


@dataclass(frozen=True, eq=False)
class Solved:
    """An equilibrium of a case, with what its goals come to."""

    mechanics: Mechanics
    state: Equilibrium
    factored: "Factor"
    average: CellAverage
    goals: Sequence[Functional]

    def values(self) -> FloatArray:
        """Return the figures of the goals."""
        return np.array([goal.value(self.mechanics, self.state) for goal in self.goals])

    def slopes(self) -> FloatArray:
        """Return their derivatives over the coordinate at the points, (goals, Q)."""
        rows = [
            self.mechanics.sensitivity(
                self.state,
                self.factored,
                goal.weights(self.mechanics)[0],
            ).coordinate
            for goal in self.goals
        ]
        return np.array(rows).reshape(len(rows), -1)

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
        through = mechanics.sensitivity(state, self.factored, pulled).coordinate
        table = body.table
        gap = 1e-6 * float(np.ptp(table.coordinate)) + 1e-12
        change = (table.break_at(body.coordinate + gap) - breaks) / gap
        direct = -each * ratio / breaks * change
        return OverBreak(largest, norm * largest, (through + direct))


_NORM = 12
"""Power of the norm that stands for the largest value in gradients; the limit is on the largest."""


class OverBreak(NamedTuple):
    """Largest strain over break, its norm, and the norm's derivatives over coordinates, (Q,)."""

    largest: float
    norm: float
    slope: FloatArray


# ------------------------------------------------------------------------------------------------
# The search: linear models of what the cases come to, a quadratic wish, within a trust region.


@dataclass(frozen=True, eq=False)
class ProfileProblem:
    """Knots to find.

    Attributes
    ----------
    cases
        Load cases, each with its goals, on cells of one size.
    along : (Q,)
        Field values at the cells' quadrature points.
    ramp : (knots,)
        The even gradient that a smooth profile stays near.
    prefer
        Among profiles that reach the targets: ``smooth``, or ``soft``, which has the least of
        what is stiff.
    knot_mm
        Distance of knots, or of the field where it has no length.
    """

    knots: Knots
    cases: Sequence[Case]
    along: FloatArray
    limits: Limits
    ramp: FloatArray
    prefer: str
    knot_mm: float
    volume: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        weights = self.cases[0].cells.weights_mm3
        volume = self.knots.gathered(self.along, weights)
        object.__setattr__(self, "volume", volume / volume.sum())

    @property
    def goals(self) -> list[Functional]:
        """Of all cases, in their order."""
        return [goal for case in self.cases for goal in case.goals]

    def wish(self, values: FloatArray) -> float:
        """Return what is made small among profiles that reach the targets."""
        bend = np.diff(values, 2)
        if self.prefer == "soft":
            return float(self.volume @ values + 0.1 * np.sum(bend**2))
        return float(np.sum(bend**2) + 0.1 * np.mean((values - self.ramp) ** 2))


@dataclass(frozen=True, eq=False)
class TriedProfile:
    """A profile that was tried.

    Attributes
    ----------
    values : (knots,)
    figures : (goals,)
    off : (goals,), slopes : (goals, knots)
        ln(figure / wanted), or the deviation over its scale, and the derivatives.
    over_break : (cases,), over_break_slopes : (cases, knots)
        ln(largest strain over break / limit), if there is a limit.
    largest : float
        Strain over break in all cases; nan if there is no limit.
    """

    values: FloatArray
    figures: FloatArray
    off: FloatArray
    slopes: FloatArray
    over_break: FloatArray
    over_break_slopes: FloatArray
    largest: float


def evaluate(problem: ProfileProblem, values: FloatArray) -> TriedProfile:
    """Return what a profile comes to.

    Raises
    ------
    LostStabilityError
        A case has no stable equilibrium under its load.
    """
    coordinate, over_value = problem.knots.coordinates(values, problem.along)
    figures: list[float] = []
    slopes: list[FloatArray] = []
    over: list[float] = []
    over_slopes: list[FloatArray] = []
    largest = float("nan")
    limit = problem.limits.strain_over_break
    for case in problem.cases:
        solved = case.solve(coordinate)
        figures += solved.values().tolist()
        slopes += [
            problem.knots.gathered(problem.along, row * over_value) for row in solved.slopes()
        ]
        if limit is not None:
            seen = solved.over_break()
            largest = float(np.fmax(largest, seen.largest))
            over.append(float(np.log(seen.largest / limit)))
            row = problem.knots.gathered(problem.along, seen.slope * over_value)
            over_slopes.append(row / seen.norm)
    off: list[float] = []
    rows: list[FloatArray] = []
    for goal, figure, row in zip(problem.goals, figures, slopes, strict=True):
        if goal.hard and goal.wanted and figure / goal.wanted > 0.0:
            off.append(float(np.log(figure / goal.wanted)))
            rows.append(row / figure)
        else:
            scale = abs(goal.wanted) if goal.hard and goal.wanted else goal.scale
            off.append((figure - goal.wanted) / scale)
            rows.append(row / scale)
    count = problem.knots.count
    return TriedProfile(
        values,
        np.array(figures),
        np.array(off),
        np.array(rows).reshape(-1, count),
        np.array(over),
        np.array(over_slopes).reshape(-1, count),
        largest,
    )


_PLEASED = 0.03
"""A step that reaches the targets and gains less than this share of the wish is the last."""


class Found(NamedTuple):
    """The best profile, and how many were tried."""

    best: TriedProfile
    tried: int


_MULTIPLIER = 20.0
"""Weight of a miss of 1 against the wish, whose values are below 1: misses come first."""

_NEARNESS = 20.0
"""Weight of the mean square deviation from a shape, over the squares of its scale: it comes first.
"""


def search(
    problem: ProfileProblem,
    start: FloatArray,
    *,
    tolerance: float,
    most: int = 25,
    radius: float = 0.25,
    progress: Callable[[int, float], None] = lambda tried, off: None,
) -> Found:
    """Return the profile that misses targets and limits least, and pleases most among those.

    Sequential quadratic programming with the wish's own curvature: at each step the targets and
    limits are linear, the change of each knot within a radius that follows how well the last
    step was foretold.

    Parameters
    ----------
    tolerance
        Relative miss of a target that counts as none.
    progress
        Called with the number of profiles tried and the largest miss.

    Raises
    ------
    LostStabilityError
        No equilibrium at the start.
    """
    best = evaluate(problem, start)
    tried = 1
    progress(tried, _miss(problem, best))
    while tried < most:
        values = _step(problem, best, radius)
        moved = float(np.abs(values - best.values).max())
        hoped = _merit(problem, best) - _foretold(problem, best, values)
        if moved < 1e-4 or hoped <= 1e-7 or radius < 1e-3:
            break
        other = _tried(problem, values)
        tried += 1
        gained = -1.0 if other is None else _merit(problem, best) - _merit(problem, other)
        if other is not None and gained <= 0.05 * hoped and tried < most:
            # The targets bend: aim again, with what the linear model left out put into it.
            bent = replace(
                best,
                off=other.off - best.slopes @ (values - best.values),
                over_break=other.over_break - best.over_break_slopes @ (values - best.values),
            )
            again = _tried(problem, _step(problem, bent, radius))
            tried += 1
            if again is not None and _merit(problem, again) < _merit(problem, other):
                other, gained = again, _merit(problem, best) - _merit(problem, again)
        if other is not None and gained > 0.05 * hoped:
            settled = _miss(problem, other) < tolerance and gained < _PLEASED * problem.wish(values)
            best = other
            if gained > 0.7 * hoped:
                radius = min(2.0 * radius, 0.5)
            if settled:
                progress(tried, _miss(problem, best))
                break
        else:
            radius = 0.35 * moved
        progress(tried, _miss(problem, best))
    return Found(best, tried)


def _tried(problem: ProfileProblem, values: FloatArray) -> TriedProfile | None:
    try:
        return evaluate(problem, values)
    except LostStabilityError:
        return None


def _miss(problem: ProfileProblem, candidate: TriedProfile) -> float:
    hard = [abs(o) for o, goal in zip(candidate.off, problem.goals, strict=True) if goal.hard]
    return float(max([0.0, *hard, *candidate.over_break.tolist()]))


def _merit(problem: ProfileProblem, candidate: TriedProfile) -> float:
    return _weighed(problem, candidate.values, candidate.off, candidate.over_break)


def _foretold(problem: ProfileProblem, at: TriedProfile, values: FloatArray) -> float:
    change = values - at.values
    off, over = at.off + at.slopes @ change, at.over_break + at.over_break_slopes @ change
    return _weighed(problem, values, off, over)


def _weighed(
    problem: ProfileProblem, values: FloatArray, off: FloatArray, over: FloatArray
) -> float:
    hard = np.array([goal.hard for goal in problem.goals])
    missed = float(np.sum(np.abs(off[hard])) + np.sum(np.maximum(over, 0.0)))
    shape = float(np.sum(off[~hard] ** 2))
    shape *= _NEARNESS / max(1, int(np.count_nonzero(~hard)))
    return _MULTIPLIER * missed + shape + problem.wish(values)


def _step(problem: ProfileProblem, at: TriedProfile, radius: float) -> FloatArray:
    """Return the values that make the linear models' merit least within the radius and bounds.

    The misses' absolute values become slack variables, so that the problem is smooth.
    """
    from scipy.optimize import Bounds, LinearConstraint, minimize

    hard = np.array([goal.hard for goal in problem.goals])
    rows = at.slopes[hard]
    fixed = at.off[hard] - rows @ at.values
    limits, over = at.over_break_slopes, at.over_break - at.over_break_slopes @ at.values
    count, misses, limited = len(at.values), len(rows), len(limits)
    soft = at.slopes[~hard]
    soft_fixed = at.off[~hard] - soft @ at.values
    share = _NEARNESS / max(1, len(soft))

    def cost(v: FloatArray) -> float:
        y = v[:count]
        shape = share * float(np.sum((soft_fixed + soft @ y) ** 2))
        return float(problem.wish(y) + shape + _MULTIPLIER * v[count:].sum())

    size = count + 2 * misses + limited
    constraints = []
    if misses:
        matrix = np.zeros((misses, size))
        matrix[:, :count] = rows
        matrix[:, count : count + misses] = -np.eye(misses)
        matrix[:, count + misses : count + 2 * misses] = np.eye(misses)
        constraints.append(LinearConstraint(matrix, -fixed, -fixed))
    if limited:
        matrix = np.zeros((limited, size))
        matrix[:, :count] = limits
        matrix[:, count + 2 * misses :] = -np.eye(limited)
        constraints.append(LinearConstraint(matrix, -np.inf, -over))
    if problem.limits.slope is not None:
        matrix = np.zeros((count - 1, size))
        matrix[:, :count] = np.diff(np.eye(count), axis=0)
        most = problem.limits.slope * problem.knot_mm / problem.knots.span
        constraints.append(LinearConstraint(matrix, -most, most))
    low = np.concatenate([np.maximum(at.values - radius, 0.0), np.zeros(size - count)])
    high = np.concatenate([np.minimum(at.values + radius, 1.0), np.full(size - count, np.inf)])
    off = at.off[hard]
    start = np.concatenate(
        [at.values, np.maximum(off, 0.0), np.maximum(-off, 0.0), np.maximum(at.over_break, 0.0)]
    )
    found = minimize(
        cost, start, method="SLSQP", bounds=Bounds(low, high),
        constraints=constraints, options={"maxiter": 300, "ftol": 1e-12},
    )  # fmt: skip
    return np.asarray(np.clip(found.x[:count], low[:count], high[:count]))
