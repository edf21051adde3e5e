"""What a design is able to reach, what it came to, and what stands in the way of the rest."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from planner.glance import in_percent
from planner.numerics import FloatArray

if TYPE_CHECKING:
    from planner.inverse_design.goals import Functional
    from planner.inverse_design.search import DesignProblem, Solved, Tried

__all__ = ["DesignFinding", "Ends", "Reached", "findings", "reached"]


@dataclass(frozen=True, slots=True)
class Reached:
    """One target or limit, and what it came to.

    Attributes
    ----------
    target, case
        As it was written, and the load case's name.
    kind
        ``target``; ``near`` of what the design comes as near to as it can: points, and surfaces,
        whose figure is the root mean square deviation; ``<`` or ``>`` of a limit.
    wanted, unit
        The figure: of a stiffness, the displacement or force that it means.
    continuous, printed
        With the gradient as it is wanted, and with the materials of the plan.
    interval
        Holds what a print does, from the palette's uncertainty; None of a surface.
    error
        (printed - wanted) over `whole`, of a surface over its longest way; None of a point of a
        shape along an axis along which it is not to move.
    reach
        The figure in the softest and in the stiffest material that is allowed; None where the part
        is not stable in it.
    largest
        Of a surface: the largest deviation of the printed part, mm.
    whole
        What a miss is relative to: what is wanted; of a distance how far it is to change; where
        nothing is to change, the farthest that the softest or the stiffest material comes to, at
        least a hundredth of the part, 1 deg or 1 N; of a surface its longest way.
    """

    target: str
    case: str
    kind: str
    unit: str
    wanted: float
    continuous: float
    printed: float
    interval: tuple[float, float] | None
    error: float | None
    reach: tuple[float | None, float | None] = (None, None)
    largest: float | None = None
    whole: float = 1.0

    @property
    def hard(self) -> bool:
        """Whether it is to be met or kept."""
        return self.kind != "near"

    @property
    def missed(self) -> float:
        """The relative miss; of a limit, by how much it is passed."""
        return self.missed_by(self.printed)

    def missed_by(self, figure: float) -> float:
        """Return the relative miss of another figure than the printed."""
        if self.error is None:
            return 0.0
        if self.kind not in "<>":
            return abs(figure - self.wanted) / abs(self.whole)
        over = abs(figure) / self.wanted - 1.0
        return max(over if self.kind == "<" else -over, 0.0)


@dataclass(frozen=True, slots=True)
class DesignFinding:
    """What keeps a design from being as wanted, and why: one of `Reached` missed, an interrupt."""

    kind: str
    message: str


# ------------------------------------------------------------------------------------------------
# What is in reach: the softest and the stiffest answers, before the search.


class Ends(NamedTuple):
    """What all goals come to in the softest and in the stiffest material; None where not stable."""

    problem: "DesignProblem"
    ends: Sequence[tuple[float | None, float | None]]

    @classmethod
    def of(cls, problem: "DesignProblem") -> "Ends":
        """Solve for the softest and the stiffest material that is allowed."""
        from planner.simulation.solid import LostStabilityError

        found: list[list[float | None]] = []
        for share, steps in ((0.0, 4), (1.0, 1)):
            coordinate, _ = problem.stiffness.coordinates(np.full(problem.basis.shape[0], share))
            each: list[float | None] = []
            for case in problem.cases:
                try:
                    each += case.solve(coordinate, steps=steps, tangent=False).values().tolist()
                except LostStabilityError:
                    each += [None] * len(case.goals)
                case.state = None  # as if nothing had been solved
            found.append(each)
        return cls(problem, list(zip(*found, strict=True)))

    def _targets(self) -> "Iterator[tuple[Functional, float, float]]":
        """Yield the targets that both ends tell a figure of."""
        for goal, (soft, stiff) in zip(self.problem.goals, self.ends, strict=True):
            if goal.kind == "target" and soft is not None and stiff is not None:
                yield goal, soft, stiff

    def beyond(self) -> Iterator[str]:
        """Say which figures no even material gives."""
        for goal, soft, stiff in self._targets():
            low, high = sorted((soft, stiff))
            if not low <= goal.wanted <= high:
                middle = 0.5 * (low + high) - goal.at_rest
                way = "the sign is the other one" if goal.way * middle < 0.0 else ""
                yield (
                    f"{goal.text}: all in the softest material comes to {soft:.4g} {goal.unit}, "
                    f"all in the stiffest to {stiff:.4g}; {way or 'a gradient may not get there'}"
                )

    def even_share(self) -> float:
        """Return the share of stiffness at which an even part comes nearest to the targets."""
        shares = []
        for goal, soft, stiff in self._targets():
            soft, stiff = soft - goal.at_rest, stiff - goal.at_rest
            if soft and soft != stiff and min(goal.way / soft, stiff / soft) > 0.0:
                wanted, span = np.log(np.array([goal.way, stiff]) / soft)
                shares.append(float(np.clip(wanted / span, 0.05, 0.95)))
        return float(np.mean(shares)) if shares else 0.5


def reached(
    problem: "DesignProblem", best: "Tried", reach: Ends, solved: "Sequence[Solved]", level: float
) -> Iterator[Reached]:
    """Yield what targets and limits came to in the printed materials, beside the gradient's own."""
    figures = iter(zip(best.figures.tolist(), reach.ends, strict=True))
    ideals = iter(best.deviations)
    for case, one in zip(problem.cases, solved, strict=True):
        intervals = one.intervals(problem.stiffness.model, level)
        for goal, figure, span in zip(case.goals, one.values().tolist(), intervals, strict=True):
            continuous, ends = next(figures)
            whole = goal.way if goal.kind == "target" else goal.wanted
            if not whole and goal.kind == "target":
                told = [abs(end - goal.at_rest) for end in ends if end is not None]
                whole = max([goal.scale, *told])
            off = (figure - goal.wanted) / whole if whole else None
            yield Reached(
                goal.text, case.name, goal.kind, goal.unit, goal.wanted, continuous, figure,
                span, off, ends, whole=whole,
            )  # fmt: skip
        for shape, miss in zip(case.shapes, one.deviations(), strict=True):
            way_mm, largest_mm = shape.wanted.greatest_mm, float(miss.off_mm.max())
            yield Reached(
                shape.wanted.target.text, case.name, "near", "mm off", 0.0, next(ideals) * way_mm,
                miss.rms * way_mm, None, miss.rms, largest=largest_mm, whole=way_mm,
            )  # fmt: skip


def findings(
    rows: Sequence[Reached], over: float | None, tolerance: float, problem: "DesignProblem",
    best: "Tried", values: FloatArray, *, dithered: bool,
) -> Iterator[DesignFinding]:  # fmt: skip
    """Say which targets and limits are missed, and what stands in the way.

    Parameters
    ----------
    over
        Largest strain over break in the printed materials, where that is limited.
    values
        Of the gradient that is printed.
    """
    limit, why = problem.limits.strain_over_break, ""
    if (values < 0.01).all() or (values > 0.99).all():
        word = "softest" if values[0] < 0.5 else "stiffest"
        why = f"; all of the part is in the {word} material that is allowed"
    elif limit is not None and over is not None and over > 0.97 * limit:
        why = f"; strain over break is {over:.3g}, its limit {limit:g}"
    against = _against(problem, best, tolerance)
    closer = "" if dithered else "; dithered ones follow it closer (blend: dither)"
    for row in rows:
        if row.missed <= tolerance or not (row.hard or row.largest is not None):
            continue
        name = f"{row.case}: {row.target}" if row.case else row.target
        if row.largest is not None:
            yield DesignFinding(
                "target",
                f"{name}: the surface is {row.printed:.3g} mm off (root mean square), "
                f"{in_percent(row.missed)} of its longest way, and {row.largest:.3g} mm at most; "
                f"the gradient comes to {row.continuous:.3g} mm"
                + ("" if row.continuous > 0.8 * row.printed else closer),
            )
            continue
        off = row.missed if row.kind in "<>" else (row.printed - row.wanted) / row.whole
        told = f"{name}: {row.printed:.4g} {row.unit} is reached, {in_percent(off, '+')}"
        if not row.wanted:
            told += " of the farthest that one material alone gives"
        elif row.whole != row.wanted:
            told += f" of a change of {abs(row.whole):.3g} {row.unit}"
        if row.missed_by(row.continuous) > tolerance:
            soft, stiff = (f"{e:.4g}" if e is not None else "nothing stable" for e in row.reach)
            told += (
                f"; the nearest gradient comes to {row.continuous:.4g} {row.unit}{why}"
                f"{against.get((row.case, row.target), '')}; softest {soft}, stiffest {stiff} "
                f"{row.unit} (in larger cells)"
            )
        else:
            told += (
                f"; the gradient comes to {row.continuous:.4g} {row.unit}, which the printed "
                f"materials follow in steps{closer}"
            )
        yield DesignFinding("target" if row.kind == "target" else "limit", told)
    if limit is not None and over is not None and over > limit * (1.0 + tolerance):
        ends = np.cumsum([1 + sum(g.kind in "<>" for g in case.goals) for case in problem.cases])
        own = limit * float(np.exp(best.over[ends - 1].max()))  # of each case it is the last
        told = f"strain/break<{limit:g}: the printed part comes to {over:.3g}, "
        if own > limit * (1.0 + tolerance):
            told += f"the nearest gradient to {own:.3g}"
        else:
            told += "as materials in steps strain more in places than the gradient; take "
            told += f"strain/break<{limit**2 / over:.2g}{closer}"
        yield DesignFinding("limit", told)


_OPPOSED = -0.5
"""Cosine between two derivatives from which targets are said to stand against each other."""


def _against(
    problem: "DesignProblem", best: "Tried", tolerance: float
) -> dict[tuple[str, str], str]:
    """Say of each target and limit that is missed which other stands most against it."""
    off = zip(best.off, best.slopes, strict=True)
    over = zip(best.over, best.over_slopes, strict=True)
    rows = []
    for case in problem.cases:
        for goal in case.goals:
            if goal.kind != "near":
                miss, row = next(off if goal.kind == "target" else over)
                rows.append((case.name, goal.text, goal.kind, float(miss), row))
        if (limit := problem.limits.strain_over_break) is not None:
            miss, row = next(over)
            rows.append((case.name, f"strain/break<{limit:g}", "<", float(miss), row))
    out = {}
    for name, text, kind, miss, row in rows:
        if (abs(miss) if kind == "target" else miss) <= tolerance:
            continue
        mend = -np.sign(miss) * row
        size = float(np.linalg.norm(mend))
        worst, who = _OPPOSED, ""
        for other, text2, kind2, miss2, row2 in rows:
            if (other, text2) == (name, text) or (kind2 != "target" and miss2 < -0.05):
                continue
            keep = -np.sign(miss2) * row2 if kind2 == "target" and miss2 else -row2
            cosine = float(mend @ keep) / max(size * float(np.linalg.norm(keep)), 1e-300)
            if cosine < worst:
                worst, who = cosine, f"{other}: {text2}" if other else text2
        if who:
            out[name, text] = f"; {who} stands against it"
    return out
