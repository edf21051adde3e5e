"""Specimens that differ from their replicates by more than scatter.

Each specimen is compared with the mean of its replicates. How far they may differ is told by
the scatter of the others, moderated by that of all other groups: the variances of groups are
taken as scaled inverse chi-square draws whose centre and weight the groups themselves tell
(Smyth, Stat. Appl. Genet. Mol. Biol. 3, 2004). So two or three replicates are judged by what the
whole campaign knows of scatter; where it knows nothing, by what is usual, and then only a gross
fault is named.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.gap.conditions import replicate_groups
from planner.gap.quality.loading import first_loading, stress_at
from planner.gap.quality.problem import Problem
from planner.gap.specimen import Specimen

__all__ = ["outlier_problems"]

FAMILY_WISE = 0.003
"""Chance of any false outlier in a clean campaign, over specimens and figures."""

SMALLEST = 0.08
"""A load within 8 % of its replicates' is no fault of the data, however small their scatter."""

USUAL_SCATTER, USUAL_WEIGHT = 0.06, 4.0
"""Jetted specimens of one print scatter by 1 to 9 %: a standard deviation and its weight as
degrees of freedom."""

_GRID = np.linspace(0.3, 0.9, 13)
_SHORT = 0.3


@dataclass(frozen=True, slots=True)
class _Figure:
    """One number a specimen: a group's values by place."""

    name: str
    groups: tuple[tuple[tuple[int, ...], FloatArray], ...]


def outlier_problems(
    specimens: Sequence[Specimen], *, leave_out: frozenset[str] = frozenset()
) -> tuple[Problem, ...]:
    """Return outlying specimens, the clearest first in each round.

    Two figures are judged: the load at common strains, and how it grows with strain. Levels are
    Bonferroni's over specimens and figures; a specimen that was found is left out and the rest
    judged again.

    Parameters
    ----------
    leave_out
        Specimens with another problem already.
    """
    kept = [s for s in specimens if s.id not in leave_out]
    groups = _groups(kept)
    tests = 2 * sum(len(g) for g in groups)
    gone: set[int] = set()
    found: list[Problem] = []
    while True:
        figures = _figures(kept, [tuple(i for i in g if i not in gone) for g in groups])
        worst = min(
            (w for figure in figures for w in _judged(figure)), key=lambda w: w[0], default=None
        )
        if worst is None or worst[0] >= FAMILY_WISE / max(tests, 1):
            return tuple(found)
        _, name, place, shift, others = worst
        found.extend(_problems(kept, name, place, shift, others))
        gone |= {place} if len(others) > 1 else {place, *others}


def _groups(specimens: Sequence[Specimen]) -> tuple[tuple[int, ...], ...]:
    """Replicates of one batch, unless that leaves less than half of what there is to compare."""
    inside = replicate_groups(specimens, with_batch=True)
    across = replicate_groups(specimens)
    freedom = [sum(len(g) - 1 for g in groups) for groups in (inside, across)]
    chosen = inside if 2 * freedom[0] >= freedom[1] else across
    return tuple(g for g in chosen if len(g) > 1)


def _figures(
    specimens: Sequence[Specimen], groups: Sequence[tuple[int, ...]]
) -> tuple[_Figure, _Figure]:
    level: list[tuple[tuple[int, ...], FloatArray]] = []
    growth: list[tuple[tuple[int, ...], FloatArray]] = []
    for group in groups:
        loadings = {i: first_loading(specimens[i]) for i in group}
        ends = {i: float(strain[-1]) for i, (strain, _) in loadings.items()}
        middle = float(np.median(list(ends.values()))) if ends else 0.0
        members = tuple(i for i in group if ends[i] > _SHORT * middle)
        if len(members) < 2:
            continue
        at = min(ends[i] for i in members) * _GRID
        stress = np.stack([stress_at(*loadings[i], at) for i in members])
        if not np.all(stress > 0.0):
            continue
        logs = np.log(stress)
        level.append((members, np.mean(logs, axis=1)))
        x = np.log(at) - np.mean(np.log(at))
        growth.append((members, logs @ x / float(x @ x)))
    return _Figure("load", tuple(level)), _Figure("growth", tuple(growth))


def _judged(figure: _Figure) -> list[tuple[float, str, int, float, tuple[int, ...]]]:
    """Return p-value, figure, specimen, shift and replicates of everyone that can be judged."""
    from scipy.special import stdtr

    judged = []
    variances = [float(np.var(values, ddof=1)) for _, values in figure.groups]
    freedoms = [len(members) - 1 for members, _ in figure.groups]
    for g, (members, values) in enumerate(figure.groups):
        n = len(members)
        weight, centre = _prior(
            variances[:g] + variances[g + 1 :], freedoms[:g] + freedoms[g + 1 :]
        )
        for k, place in enumerate(members):
            others = np.delete(values, k)
            shift = float(values[k] - np.mean(others))
            freedom = weight + n - 2
            if freedom <= 0.0 or abs(shift) < SMALLEST:
                continue
            own = float(np.var(others, ddof=1)) * (n - 2) if n > 2 else 0.0
            variance = (weight * centre + own) / freedom
            scale = math.sqrt(variance * (1.0 + 1.0 / (n - 1)))
            p = 2.0 * float(stdtr(freedom, -abs(shift) / scale)) if scale > 0.0 else 0.0
            rest = tuple(m for m in members if m != place)
            judged.append((p, figure.name, place, shift, rest))
    return judged


def _prior(variances: Sequence[float], freedoms: Sequence[int]) -> tuple[float, float]:
    """Return weight (degrees of freedom) and centre of the groups' variances.

    What is usual counts as one more group. The weight never exceeds a half of the degrees of
    freedom that it comes from, or that of the usual.
    """
    from scipy.special import polygamma, psi

    known = [(v, d) for v, d in zip(variances, freedoms, strict=True) if v > 0.0]
    if not known:
        return USUAL_WEIGHT, USUAL_SCATTER**2
    known.append((USUAL_SCATTER**2, int(USUAL_WEIGHT)))
    most = max(USUAL_WEIGHT, 0.5 * sum(d for _, d in known))
    d = np.array([d for _, d in known], dtype=np.float64)
    e = np.log([v for v, _ in known]) - psi(d / 2.0) + np.log(d / 2.0)
    excess = float(np.var(e, ddof=1) - np.mean(polygamma(1, d / 2.0)))
    if excess <= 0.0:
        return most, float(np.exp(np.mean(e)))
    weight = 2.0 * _trigamma_inverse(excess)
    centre = math.exp(float(np.mean(e)) + float(psi(weight / 2.0)) - math.log(weight / 2.0))
    return min(weight, most), centre


def _trigamma_inverse(value: float) -> float:
    """Return x with trigamma(x) = value, by bisection in log x."""
    from scipy.special import polygamma

    low, high = -20.0, 20.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if float(polygamma(1, math.exp(middle))) > value:
            low = middle
        else:
            high = middle
    return math.exp(0.5 * (low + high))


def _problems(
    specimens: Sequence[Specimen], name: str, place: int, shift: float, others: Sequence[int]
) -> list[Problem]:
    if name == "load":
        size = f"load is {100 * math.expm1(shift):+.0f} % off"
    else:
        size = f"load grows with strain to the power {shift:+.2f} apart from"
    found = float(f"{math.exp(shift) if name == 'load' else shift:.6g}")
    expected = 1.0 if name == "load" else 0.0
    if len(others) > 1:
        words = f"{size} that of its {len(others)} replicates"
        return [Problem("outlier", specimens[place].id, words, found, expected)]
    pair = (place, others[0])
    return [
        Problem(
            "outlier",
            specimens[one].id,
            f"{size} that of its only replicate {specimens[other].id}, more than replicates "
            "elsewhere; which of the two is off cannot be told",
            found,
            expected,
        )
        for one, other in (pair, pair[::-1])
    ]
