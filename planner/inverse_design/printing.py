"""From a gradient to its print: the plan, what its materials do, the correction for rounding."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planner.errors import ArgumentError, ThinBandError
from planner.fields.basic import Field
from planner.fields.parse import Setting, TableFile
from planner.formats.field_file import encode_vti
from planner.glance import in_percent
from planner.grading.profile import Profile, StiffnessScale, natural_bands
from planner.grading.snap import snap_limit_mm, snapped_bands
from planner.inverse_design import search
from planner.inverse_design.controls import TABLE
from planner.inverse_design.search import Case, DesignProblem, Solved, Tried, WantedOfPart
from planner.numerics import BoolArray, FloatArray, interrupted
from planner.plan import Plan
from planner.printers import Printer
from planner.simulation.part import filling_along, open_solid
from planner.simulation.solid import LostStabilityError

__all__ = ["Printing", "corrected"]


# ------------------------------------------------------------------------------------------------
# A gradient's plan, and the equilibria of what it prints.


_NUDGE = 1e-3
"""Of the range of ln(modulus): a profile that cuts a band thinner than a layer is moved by it."""

_BANDS = re.compile(r"(?:--bands|`bands`) \d+ or fewer, (?:or )?a gentler profile(?: there)?")
_OF_GRADE = re.compile(r"; (?:--tolerance \S+ accepts it|with --snap 0 it is [^;]*)")


def _own_advice(text: str, gentler: str) -> str:
    """Give what `grade` advises as a design can follow it, whose bands come of its profile."""
    return _OF_GRADE.sub("", _BANDS.sub(gentler, text))


class Print(NamedTuple):
    """A gradient's plan, and what its materials do.

    Attributes
    ----------
    misses : (t,)
        Of targets, against what is aimed at.
    """

    values: FloatArray
    plan: Plan
    cases: list[Case]
    solved: list[Solved]
    misses: FloatArray


@dataclass(frozen=True, eq=False)
class Printing:
    """How gradients are planned, and what their prints come to.

    Attributes
    ----------
    setting
        Of the part as placed for printing.
    along
        The field of a profile; None of a lattice.
    counts
        Of a lattice: controls along x, y and z.
    problem, best
        On the cells that plans are solved on, and the gradient that was found there.
    larger
        On larger cells.
    graded
        `planner.grade` of the part, given a profile and a table.
    scale
        Of the palette.
    tolerance
        Relative miss that is accepted.
    """

    wanted: WantedOfPart
    setting: Setting
    along: Field | None
    counts: tuple[int, int, int]
    problem: DesignProblem
    larger: DesignProblem
    best: Tried
    graded: Callable[..., Plan]
    scale: StiffnessScale
    machine: Printer
    cell_mm: float
    dithered: bool
    tolerance: float

    def laid(self, values: FloatArray) -> tuple[Profile, Field, TableFile | None]:
        """Return the profile, the field that it is along, and the field as a table."""
        if self.along is not None:
            positions = tuple(np.linspace(0.0, 1.0, len(values)).tolist())
            moduli = tuple(self.problem.stiffness.modulus_MPa(values).tolist())
            return Profile("designed", positions, moduli, "log"), self.along, None
        held = TableFile(Path(TABLE), "position", self._encoded(values))
        profile = Profile("designed", (0.0, 1.0), self.problem.stiffness.moduli_MPa, "log")
        return profile, held.field(self.setting), held

    def _encoded(self, values: FloatArray) -> bytes:
        """Return a lattice as a VTI file: eight steps between controls, and the box's ends.

        Between points of a table values are linear: off by 1/64 of an eighth of a second
        difference.
        """
        low, high = self.setting.mesh.bounds_mm - np.array(self.setting.origin_mm)
        steps = [8 * max(count - 2, 1) for count in self.counts]
        spacing = (high - low) / steps
        index = np.stack(np.meshgrid(*(np.arange(n + 1) for n in steps), indexing="ij"), axis=-1)
        share = self.problem.controls.basis(low + index.reshape(-1, 3) * spacing) @ values
        share = share.reshape(index.shape[:3]).astype(np.float32)
        modulus = self.problem.stiffness.modulus_MPa(share.astype(np.float64)).astype(np.float32)
        return encode_vti(low, spacing, {"position": share, "modulus_MPa": modulus})

    def _missed(self, figures: FloatArray) -> FloatArray:
        """Return by how much targets are missed; out of reach, the nearest found."""
        each = zip(self.problem.goals, figures.tolist(), self.best.figures.tolist(), strict=True)
        found = [(g.miss(now)[0], g.miss(near)[0]) for g, now, near in each if g.kind == "target"]
        return np.array([now - near * (abs(near) > self.tolerance) for now, near in found])

    def made(self, values: FloatArray, before: Sequence[Case]) -> Print:
        """Plan a gradient and solve what it prints, deformed as `before` where that begins."""
        try:
            plan, follows = self._planned(values)
        except ThinBandError:  # which goes where all is a bit softer
            values = values - _NUDGE * (values > _NUDGE)
            plan, follows = self._planned(values)
        palette = self.scale.palette
        if self.dithered or len(plan.regions) == 1:
            cases = [replace(case) for case in before]
            for case in before:
                case.factored = None  # its memory is taken
            filling = filling_along(follows, plan, palette)(cases[0].cells.points_mm)
        else:
            solid = open_solid(plan, None, None, None, palette)
            cells, filling = solid.cut(self.cell_mm, like=before[0].cells)
            cases = self.wanted.on(cells, filling, before, varies=False)
        solved = [case.solve(filling, tangent=False) for case in cases]
        figures = np.concatenate([one.values() for one in solved])
        return Print(values, plan, cases, solved, self._missed(figures))

    def _planned(self, values: FloatArray) -> tuple[Plan, Field]:
        profile, follows, table = self.laid(values)
        gentler = "a coarser --free" if table else "fewer --knots"
        try:
            plan = self.graded(profile=profile, **({} if table is None else {"field": table}))
        except ArgumentError as error:
            raise type(error)(_own_advice(str(error), gentler)) from error
        advised = [replace(f, message=_own_advice(f.message, gentler)) for f in plan.findings]
        notes = _own_advice(plan.notes, gentler)
        return replace(plan, findings=tuple(advised), notes=notes), follows

    @cached_property
    def _at_points(self) -> FloatArray | None:
        """Values of a profile's field at the quadrature points."""
        moved = np.array(self.setting.origin_mm)
        if self.along is None:
            return None
        return np.asarray(self.along.values(self.problem.cases[0].cells.points_mm + moved))

    def _shares(self, values: FloatArray) -> FloatArray:
        """Return the stiffness that is printed about the points, as a share of ln(modulus).

        It is that of the materials that `planner.grade` cuts to: the nearest in ln(modulus), with
        cuts moved off faces. A point stands for half of its cell's range of the field. Bands of a
        profile are taken to lie in series there, those of a lattice in no order.
        """
        share = np.asarray(self.problem.basis @ values)
        if self.dithered:
            return share
        profile, field, _ = self.laid(values)
        bands = natural_bands(profile, self.scale.moduli_MPa)
        snapped, _ = snapped_bands(
            self.setting.mesh, field, bands, profile,
            snap_mm=snap_limit_mm(None, self.machine), machine=self.machine,
        )  # fmt: skip
        starts = [band.start for band in snapped]
        moduli = np.array(self.scale.moduli_MPa)[[band.grade for band in bands]]
        place = share if self._at_points is None else self._at_points
        offsets = self.problem.cases[0].cells.offsets
        range_ = [f.reduceat(place, offsets[:-1]) for f in (np.maximum, np.minimum)]
        half = np.repeat(np.maximum(0.25 * (range_[0] - range_[1]), 1e-9), np.diff(offsets))
        edges = np.array([-1.0, *starts[1:], 2.0])
        sums = np.append(0.0, np.cumsum(np.diff(edges) / moduli))
        ends = (np.interp(place + sign * half, edges, sums) for sign in (1.0, -1.0))
        stiffness = self.problem.stiffness
        softer = np.subtract(*ends) / (2.0 * half) * stiffness.moduli_MPa[0]
        return np.asarray(-np.log(softer) / stiffness.span)

    def foretold(self, values: FloatArray) -> FloatArray:
        """Return by how much a print misses its targets, by the gradient's derivatives."""
        change = self._shares(values) - self.problem.basis @ self.best.values
        span = self.problem.stiffness.span
        change = -np.expm1(-span * change) / span
        return np.asarray(self._missed(self.best.figures) + self.best.by_share @ change)

    def beyond(self) -> FloatArray:
        """Return by how much the best gradient's print misses more than is foretold, (t,).

        Of parts that bear side by side the stiffer ones bear more, so that a print is stiffer than
        derivatives say, by a per cent or so. It is solved in larger cells, without interfaces.
        """
        none, larger = np.zeros(len(self.best.off)), self.larger
        if not len(none):
            return none
        try:
            there = replace(self, problem=larger, best=search.evaluate(larger, self.best.values))
            coordinate, _ = larger.stiffness.coordinates(there._shares(self.best.values))
            each = [case.solve(coordinate, tangent=False).values() for case in larger.cases]
        except LostStabilityError:  # the print itself may have an equilibrium
            return none
        return there._missed(np.concatenate(each)) - there.foretold(self.best.values)

    def stepped(self, values: FloatArray, other: FloatArray) -> BoolArray:
        """Return the third of the controls about where two prints differ most, (n,)."""
        change = np.abs(self._shares(values) - self._shares(other))
        at = self.problem.basis.T @ (change * np.abs(self.best.by_share).sum(axis=0))
        return np.asarray(at >= np.sort(at)[-1 - len(at) // 3])


# ------------------------------------------------------------------------------------------------
# The correction for rounding. The gradient is found again, for targets that are off by what
# rounding to materials makes of it. That is foretold by the gradient's own derivatives at each
# point, which costs nothing; what solving adds is learnt from each print (space mapping: J. W.
# Bandler and others, IEEE Trans. Microwave Theory Tech. 42 (1994) 2536).


_MET, _MOST_PRINTS = 0.75, 10
"""Chosen: the share of the tolerance within which a print is taken, and the most that are tried."""

_ROUNDS = 20
"""Of foretold prints before one is solved."""

_REACH = 0.25
"""Of a control, in which the gradient is taken to answer as its derivatives say."""


def corrected(
    printing: Printing, *, stopped: bool, progress: Callable[[float], None]
) -> tuple[Print, int, bool]:
    """Return the print that misses least, how many were solved, and whether the user ended it.

    Parameters
    ----------
    stopped
        Whether the best gradient is to be printed as it is.
    progress
        Called with the least miss so far before each further print.

    Raises
    ------
    ArgumentError
        No print has a stable equilibrium.
    """
    kept, tried = None, 0
    try:
        for one in () if stopped else _prints(printing):
            tried += 1
            if kept is None or _missed(one) < _missed(kept):
                kept = one
            if _missed(kept) <= _MET * printing.tolerance or tried == _MOST_PRINTS:
                break
            progress(_missed(kept))
    except (KeyboardInterrupt, SystemError) as error:
        if not interrupted(error):
            raise
        stopped = True
    if kept is None:
        try:
            kept = printing.made(printing.best.values, printing.problem.cases)
        except LostStabilityError as lost:
            raise ArgumentError(
                "the gradient bears the loads; its print, in the palette's materials, has no "
                f"stable equilibrium beyond {in_percent(lost.share)} of them: take smaller loads, "
                "a stiffer `from_` or `to`, or dithered materials (`blend`), which follow it closer"
            ) from lost
    # The next print has taken the memory of the factors.
    solved = [
        one if case.factored else replace(one, factored=one.mechanics.tangent(one.state))
        for case, one in zip(kept.cases, kept.solved, strict=True)
    ]
    return kept._replace(solved=solved), max(tried, 1), stopped


def _missed(one: Print) -> float:
    return float(np.abs(one.misses).max(initial=0.0))


_STEEP, _CLOSE = 2.0, 0.02
"""Two tries whose foretold misses are so close, and whose misses are times as far apart, have a
step of what is printed between them. Numerical."""


def _prints(printing: Printing) -> Iterator[Print]:
    """Yield prints, each nearer to the aim than the last as a rule, until all ways are gone.

    One target is looked for between the nearest two that miss to either side, save where what is
    printed steps there.
    """
    best = printing.best
    before: Sequence[Case] = printing.problem.cases
    trail, known = list[Print](), list[FloatArray]()

    def is_new(values: FloatArray) -> bool:
        return not any(np.array_equal(values, v) for v in known)

    # Dithered cells follow the gradient itself.
    values = best.values if printing.dithered else _aimed(printing, best.values, -printing.beyond())
    while len(known) <= _MOST_PRINTS and is_new(values):
        known.append(values)
        try:
            one = printing.made(values, before)
        except LostStabilityError:  # cuts may leave a place that hangs by less than a cell
            values = 0.5 * (values + trail[-1].values) if trail else best.values
            continue
        yield one
        before = one.cases
        trail.append(one._replace(cases=[], solved=[]))
        if len(one.misses) == 1:

            def apart(pair: tuple[Print, Print]) -> float:
                return float(np.abs(best.slopes @ (pair[0].values - pair[1].values)).max())

            pairs = [(a, b) for a in trail for b in trail if a.misses > 0.0 >= b.misses]
            a, b = min(pairs, key=apart, default=(trail[-1], trail[-1]))
            if pairs and (apart((a, b)) > _CLOSE or a.misses - b.misses < _STEEP * apart((a, b))):
                share = np.clip(a.misses / (a.misses - b.misses), 0.1, 0.9)
                values = a.values + share * (b.values - a.values)
                continue
        nearest = min(trail, key=_missed)
        values = _aimed(printing, best.values, printing.foretold(nearest.values) - nearest.misses)
        # Where derivatives foretell little, the gradient's own print may be nearer than all.
        values = values if is_new(values) else best.values


def _aimed(
    printing: Printing, base: FloatArray, foretold: FloatArray, still: BoolArray | bool = False
) -> FloatArray:
    """Return a gradient near another whose print is foretold to miss by so much.

    Where what is printed steps there, as a cut passes a wall, what makes the step stays as it is,
    `still`, and the other controls move.
    """
    best, problem = printing.best, printing.problem
    weights = np.array([goal.weight for goal in problem.goals if goal.kind == "target"])
    beyond = best.off * (np.abs(best.off) > printing.tolerance * weights)  # out of reach
    aim, share, kept, least = np.zeros(len(foretold)), 1.0, base, np.inf
    further, sides = aim, dict[bool, tuple[float, FloatArray]]()
    for _ in range(_ROUNDS if len(foretold) else 0):
        at = replace(best, values=base, off=beyond - weights * aim)
        values = search.next_values(problem, at, np.where(still, 0.0, _REACH), nearest=True)
        misses = printing.foretold(values) - foretold
        missed = float(np.abs(misses).max())
        side = bool(misses[0] > 0.0)
        if missed < sides.get(side, (np.inf, values))[0]:
            sides[side] = missed, values
        # Of the way: what is printed goes in steps, and further than is foretold.
        share = 0.5 * share if missed >= least or misses @ further < 0.0 else min(2 * share, 1.0)
        if missed < least:
            kept, least, nearest, further = values, missed, aim, misses
        if least <= 0.1 * printing.tolerance:
            return kept
        aim = nearest - share * further
    if len(foretold) == 1 and len(sides) == 2:  # what is printed steps between them
        more = still | printing.stepped(sides[True][1], sides[False][1])
        if not np.array_equal(more, still):
            return _aimed(printing, kept, foretold, more)
    return kept
