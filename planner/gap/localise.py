"""Where the gap of a campaign lies: every axis, with its share, p-value and a sentence."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import ArgumentError
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.campaign import TOLERANCES, Campaign, Specimen, levels
from planner.gap.diagnosis import SIGNIFICANT, Location
from planner.gap.localise_tests import (
    Whitening,
    axis_p,
    family_wise,
    orthonormal,
    outlying_replicates,
    rank_p,
    tail_p,
)
from planner.gap.observations import BRANCHES, FeatureTable
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import Palette
from planner.simulation.bar import ProfileDesign

__all__ = ["localise"]


# ------------------------------------------------------------------------------------------------
# The shapes over strain that a gap is looked for in: a level, a slope and a bend.


_SMALLEST_STRAIN = 0.01
"""Strains far below it count as one on the logarithmic axis. Chosen: below 1 % little force was
measured, and slack and zeros decide."""

_HOLD = BRANCHES.index("hold")


def _strain_place(table: FeatureTable) -> FloatArray:
    """Return the logarithm of strain, -1 at the table's smallest and 1 at its largest, (N,)."""
    log = np.log(np.maximum(table.strain, 0.0) + _SMALLEST_STRAIN)
    low, high = float(log.min()), float(log.max())
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-9)
    place: FloatArray = (log - middle) / half
    return place


def _strain_shapes(table: FeatureTable) -> FloatArray:
    """Return level, slope and bend of the forces' logarithm over log strain, (N, 3).

    Legendre's polynomials times the sensitivity, so that a gap in per cent is one.
    """
    u = _strain_place(table)
    h = np.where(table.is_field, 0.0, table.sensitivity(table.measured_raw))
    return np.stack([h, h * u, h * (1.5 * u**2 - 0.5)], axis=1)


def _field_level(table: FeatureTable) -> FloatArray:
    """Return what all local strains being off by one factor looks like, (N,)."""
    return np.where(table.is_field, table.sensitivity(table.measured_raw), 0.0)


def _branch_columns(table: FeatureTable) -> FloatArray:
    """Return a level of every later branch, and a slope over strain where strain varies, (N, k)."""
    level, u = _strain_shapes(table)[:, 0], _strain_place(table)
    columns = [np.zeros(len(table))]
    for branch, name in enumerate(BRANCHES):
        here = table.branch == branch
        if name not in ("loading", "field") and here.any():
            columns.append(np.where(here, level, 0.0))
            if branch != _HOLD:
                columns.append(np.where(here, level * u, 0.0))
    return np.stack(columns, axis=1)


def _hold_columns(table: FeatureTable) -> FloatArray:
    """Return a level, a slope and a bend over the logarithm of the time of a hold, (N, 3)."""
    hold = table.branch == _HOLD
    if not hold.any():
        return np.zeros((len(table), 0))
    log = np.log(np.maximum(table.time_s, 1e-3))
    low, high = float(log[hold].min()), float(log[hold].max())
    level = np.where(hold, _strain_shapes(table)[:, 0], 0.0)
    w = np.where(hold, (log - low) / max(high - low, 1e-9), 0.0)
    return np.stack([level, level * w, level * w**2], axis=1)


# ------------------------------------------------------------------------------------------------
# Columns of specimens.csv as axes: their levels, and a few coordinates along each.


@dataclass(frozen=True, slots=True, eq=False)
class _Column:
    """A column that takes more than one value.

    Attributes
    ----------
    values
        Of each specimen with features; None where unknown.
    level : (n,)
        Number of each specimen's level, -1 where unknown.
    coordinates : (n, m)
        Orthonormal and of mean zero over the specimens that are known, zero at the others:
        numbers as polynomials on the column's usual scale, text as levels.
    """

    name: str
    values: tuple[str | float | None, ...]
    level: IntArray
    coordinates: FloatArray

    @property
    def known(self) -> BoolArray:
        """Which specimens' values are known."""
        return np.asarray(self.level >= 0)

    @property
    def is_number(self) -> bool:
        """Whether its values are numbers."""
        return not any(isinstance(v, str) for v in self.values)


_DEGREE = 2
"""Of polynomials along a column of numbers. Chosen: a trend and a bend; a step or a peak still
shows in these."""

_MANYFOLD = 20.0
"""Largest over smallest value of an unknown column, from which it is taken in logarithms. Chosen:
over more than a decade, who sets a column goes by ratios."""

_MOST_COORDINATES = 8
"""Levels of a column of text that count by themselves, the commonest. Chosen: each costs a degree
of freedom, and rare levels show little."""


def _campaign_columns(campaign: Campaign) -> tuple[_Column, ...]:
    """Return the columns that vary over the specimens; material first.

    A column whose text is another for nearly every specimen tells them apart, but not why, and is
    left out.
    """
    specimens = campaign.specimens
    found = [_column("material", [s.named for s in specimens])]
    found += [_column(name, [_size(s, name) for s in specimens]) for name in TOLERANCES]
    texts = [name for name, c in SPECIMEN_COLUMNS.items() if c.choices is not None]
    found += [_column(name, [getattr(s, name) for s in specimens]) for name in texts]
    names = dict.fromkeys((*campaign.covariates, *(k for s in specimens for k in s.covariates)))
    found += [_column(name, [s.covariates.get(name) for s in specimens]) for name in names]
    return tuple(column for column in found if column is not None)


def _size(specimen: Specimen, name: str) -> float | None:
    value: float | None = getattr(specimen, name)
    if value is None:
        value = getattr(specimen, f"measured_{name}", None)
    return value


def _column(name: str, values: Sequence[str | float | None]) -> _Column | None:
    """Return a column by its levels; None where it does not vary."""
    if any(isinstance(v, str) for v in values):
        cells: list[str | float | None] = [
            None if v is None or not str(v).strip() else str(v).strip() for v in values
        ]
        texts = sorted({str(c) for c in cells if c is not None})
        level = np.array([-1 if c is None else texts.index(str(c)) for c in cells])
        known = level >= 0
        if len(texts) < 2 or (len(texts) > 3 and 2 * len(texts) > known.sum()):
            return None
        common = np.argsort(-np.bincount(level[known]), kind="stable")[:_MOST_COORDINATES]
        raw = (level[:, None] == common).astype(np.float64)
    else:
        numbers = [None if v is None or not np.isfinite(float(v)) else float(v) for v in values]
        of = levels(numbers, *TOLERANCES.get(name, (0.0, 1e-6)))
        level = np.array([-1 if k is None else k for k in of])
        known, cells = level >= 0, [*numbers]
        if level.max(initial=-1) < 1:
            return None
        raw = _powers(name, np.array([v for v in numbers if v is not None]), level, known)
    centred = np.where(known[:, None], raw - raw[known].mean(axis=0), 0.0)
    basis, singular, _ = np.linalg.svd(centred, full_matrices=False)
    kept = singular > 1e-6 * max(float(singular[0]), 1e-12)
    if not kept.any():
        return None
    return _Column(name, tuple(cells), level, np.where(known[:, None], basis[:, kept], 0.0))


def _powers(name: str, values: FloatArray, level: IntArray, known: BoolArray) -> FloatArray:
    """Return polynomials of levels' mean values on the column's usual scale, -1 to 1."""
    count = int(level.max()) + 1
    centre = np.array([values[level[known] == k].mean() for k in range(count)])
    if name in SPECIMEN_COLUMNS:
        centre = SPECIMEN_COLUMNS[name].scale(centre)
    elif centre.min() > 0.0 and centre.max() > _MANYFOLD * centre.min():
        centre = np.log(centre)
    x = np.zeros(len(level))
    x[known] = centre[level[known]]
    x[known] -= 0.5 * (x[known].min() + x[known].max())
    x /= max(float(np.abs(x).max()), 1e-12)
    powers = np.stack([x**k for k in range(1, min(_DEGREE, count - 1) + 1)], axis=1)
    return powers * known[:, None]


# ------------------------------------------------------------------------------------------------
# The place along graded bars: smooth patterns, and steps between materials.


_KNOTS = 6
"""Of the smooth pattern along a bar. Chosen: a fifth of the gauge apart; what is narrower shows at
steps."""

_STEEP_PER_MM = 0.15
"""Change of a design's coordinate from which it is a step. Chosen: a ramp over a whole gauge of 25
mm has at most 0.04, materials side by side have far more."""


@dataclass(frozen=True, slots=True)
class Step:
    """Where a design goes from one coordinate to another, within a millimetre or at once."""

    x_mm: float
    before: float
    after: float


def _steps_of(design: ProfileDesign) -> tuple[Step, ...]:
    """Return a design's steps."""
    x, m = design.x_mm, design.coordinate
    rise, run = np.diff(m), np.diff(x)
    steep = (np.abs(rise) > _STEEP_PER_MM * run) & (np.abs(rise) > 1e-3) & (run < 1.0)
    return tuple(
        Step(float(0.5 * (x[i] + x[i + 1])), float(m[i]), float(m[i + 1]))
        for i in np.flatnonzero(steep)
    )


def _rows_by_design(
    campaign: Campaign, table: FeatureTable
) -> dict[str, tuple[IntArray, ProfileDesign]]:
    """Return by design the rows of local strains, bars of one design together."""
    rows: dict[str, tuple[list[int], ProfileDesign]] = {}
    for row in np.flatnonzero(table.is_field).tolist():
        design = campaign.specimens[int(table.specimen[row])].profile
        if design is not None:
            rows.setdefault(design.name, ([], design))[0].append(row)
    return {name: (np.array(found), design) for name, (found, design) in rows.items()}


def _position_columns(campaign: Campaign, table: FeatureTable) -> FloatArray:
    """Return what a gap that varies along the bars may look like, (N, k).

    Hats along each design, and at steps an odd and an even kernel that all steps share, as wide
    as the camera's spacing.
    """
    columns: list[FloatArray] = []
    odd, even = np.zeros(len(table)), np.zeros(len(table))
    for rows, design in _rows_by_design(campaign, table).values():
        x = table.x_mm[rows]
        hats = np.zeros((_KNOTS, len(table)))
        knots = np.linspace(x.min(), x.max(), _KNOTS)
        hats[:, rows] = [np.interp(x, knots, hat) for hat in np.eye(_KNOTS)]
        columns += [*hats]
        at = np.unique(np.round(x, 3))
        width = max(float(np.median(np.diff(at))) if len(at) > 1 else 1.0, 0.5)
        for step in _steps_of(design):
            away = (x - step.x_mm) / width
            bell = np.exp(-0.5 * away**2)
            size = step.after - step.before
            odd[rows] += size * away * bell
            even[rows] += abs(size) * bell
    return np.stack([*columns, odd, even], axis=1) * _field_level(table)[:, None]


def _factors_of_bars(table: FeatureTable, of_row: IntArray) -> FloatArray:
    """Return a factor on all local strains of each bar, (N, bars): no matter of position."""
    bars = np.unique(of_row[table.is_field])
    return np.where(of_row[:, None] == bars, _field_level(table)[:, None], 0.0)


def _bar_scale(table: FeatureTable, y: FloatArray, basis: FloatArray) -> float:
    """Return how much larger the noise of local strains is than declared, at least 1.

    Bars are too few for how they lie together to tell; place by place, replicates tell. Without
    replicates it is what no pattern along the bars explains.
    """
    bars: dict[tuple[int, bytes], list[FloatArray]] = {}
    for number in np.unique(table.specimen[table.is_field]).tolist():
        rows = np.flatnonzero(table.is_field & (table.specimen == number))
        key = int(table.replicates[rows[0]]), np.round(table.x_mm[rows], 3).tobytes()
        bars.setdefault(key, []).append(y[rows])
    squares, freedom = 0.0, 0
    for alike in bars.values():
        values = np.stack(alike)
        squares += float(np.sum((values - values.mean(axis=0)) ** 2))
        freedom += (len(values) - 1) * values.shape[1]
    if not freedom:
        left = (y - basis @ (basis.T @ y))[table.is_field]
        squares, freedom = float(left @ left), max(len(left) - basis.shape[1], 1)
    return max(1.0, float(np.sqrt(squares / freedom)))


def _farthest_place(
    campaign: Campaign, table: FeatureTable, y: FloatArray
) -> tuple[ProfileDesign, float, IntArray]:
    """Return the place along which bar the local strain is farthest off, and its rows.

    Parameters
    ----------
    y : (N,)
        Whitened.
    """
    best, found = -1.0, None
    for rows, design in _rows_by_design(campaign, table).values():
        at, place = np.unique(np.round(table.x_mm[rows], 3), return_inverse=True)
        score = np.abs(np.bincount(place, y[rows]) / np.sqrt(np.bincount(place)))
        peak = int(np.argmax(score))
        if score[peak] > best:
            best, found = float(score[peak]), (design, float(at[peak]), rows[place == peak])
    assert found is not None
    return found


# ------------------------------------------------------------------------------------------------
# One axis along which a gap may vary, and how likely what is seen along it is without one.


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """One axis.

    Attributes
    ----------
    basis : (N, k)
        Orthonormal, in whitened features: what a gap along the axis may look like.
    p : float
        Of what is seen, for this axis alone; small where the gap varies along it.
    drawn_p : (P,)
        The same of each draw without a gap.
    detail
        One sentence.
    is_common
        Whether it is the gap that all specimens have in common, over strain.
    """

    name: str
    basis: FloatArray
    p: float
    drawn_p: FloatArray
    detail: str
    is_common: bool = False


# ------------------------------------------------------------------------------------------------
# How much of the excess an axis explains, and how sure that is.


_CLAIM = 3.0
"""How much of the gap in common an axis may claim, over what varies along it. Physical: the square
of the mean of a ramp from zero, over its variance; an effect in proportion to a column is such."""


@dataclass(frozen=True, slots=True, eq=False)
class Excess:
    """What there is to explain.

    An axis may claim some of the gap that all specimens have in common: with half of them at
    33 degC, soft, and half as predicted, half of the gap is common and yet lies along temperature.
    It may claim three times what the gap varies by along it, which is what a gap has in common
    that rises evenly from none. A gap that is the same everywhere is so claimed by no axis.

    Attributes
    ----------
    y, varying : (N,)
        Whitened residuals, all and without their common part.
    common : (N, c)
        Orthonormal.
    """

    whitening: Whitening
    y: FloatArray
    varying: FloatArray
    common: FloatArray

    @property
    def least(self) -> float:
        """The least excess that shares are taken of: two deviations of pure noise."""
        return float(2.0 * np.sqrt(2.0 * len(self.y)))

    @property
    def in_common(self) -> float:
        """What all specimens have in common, beyond noise."""
        return _beyond_noise(self.common, self.y)

    def explained(self, axis: Axis) -> float:
        """Return what an axis explains beyond noise, its claim on the common gap included."""
        if axis.is_common:
            return self.in_common
        own = _beyond_noise(axis.basis, self.varying)
        return own + min(_CLAIM * own, self.in_common)

    def share(self, axis: Axis) -> float:
        """Return the share of the excess, 0 to 1."""
        explained = self.explained(axis)
        total = max(float(self.y @ self.y) - len(self.y), self.least)
        return explained / max(total, explained, 1e-12)

    def interval(self, axis: Axis, weights: FloatArray) -> tuple[float, float]:
        """Return the 90 % interval of the share over draws of specimens.

        Parameters
        ----------
        weights : (B, n)
            How often each specimen was drawn.
        """
        squares = self.whitening.summed(self.y**2) - np.diff(self.whitening.starts)
        total = np.maximum(weights @ squares, self.least)
        common = self._drawn(self.common, self.y, weights)
        own = common
        if not axis.is_common:
            own = self._drawn(axis.basis, self.varying, weights)
            own = own + np.minimum(_CLAIM * own, common)
        shares = own / np.maximum(total, np.maximum(own, 1e-12))
        share = self.share(axis)
        moved = shares + share - float(np.median(shares))
        low, high = np.quantile(np.clip(moved, 0.0, 1.0), (0.05, 0.95)).tolist()
        return min(low, share), max(high, share)

    def _drawn(self, basis: FloatArray, y: FloatArray, weights: FloatArray) -> FloatArray:
        """Explained beyond noise, of draws, (B,)."""
        k = basis.shape[1]
        if not k:
            return np.zeros(len(weights))
        score = weights @ self.whitening.summed(basis * y[:, None])
        pairs = self.whitening.summed((basis[:, :, None] * basis[:, None, :]).reshape(-1, k * k))
        inner = (weights @ pairs).reshape(-1, k, k) + 1e-3 * np.eye(k)
        solved = np.linalg.solve(inner, score[:, :, None])[:, :, 0]
        # A draw has the noise of what was measured and its own.
        found: FloatArray = np.maximum(np.einsum("bk,bk->b", score, solved) - 2.0 * k, 0.0)
        return found


def _beyond_noise(basis: FloatArray, y: FloatArray, cost: float = 1.0) -> float:
    """Return the sum of squares along an orthonormal basis, less a cost a degree of freedom."""
    return float(max(np.sum((basis.T @ y) ** 2) - cost * basis.shape[1], 0.0))


# ------------------------------------------------------------------------------------------------
# The order of axes: what explains most first, then what adds to it.
#
# Only axes along which the gap varies at the 5 % level compete; the others follow by their p-value.
# The first explains most, each degree of freedom costing the logarithm of the number of specimens
# (Schwarz). The others follow by what they add to the first, and by a part of what they explain
# alone: an axis that merely goes along with the first falls behind one that does not, and before
# one that explains nothing.


_ALONE = 0.3
"""What an axis explains alone, beside what it adds to the first, in the order of axes. Chosen: so
that what merely goes along with the first ranks behind what does not, and before nothing."""


def _ranked(axes: Sequence[Axis], p: FloatArray, excess: Excess) -> tuple[list[int], list[float]]:
    """Return the order of axes, and what each adds to the first as a share of its own."""
    cost = math.log(max(len(excess.whitening.starts) - 1, 2))
    alone = [max(excess.explained(a) - (cost - 1.0) * a.basis.shape[1], 0.0) for a in axes]
    found = [i for i in range(len(axes)) if p[i] <= SIGNIFICANT]
    if not found:
        return sorted(range(len(axes)), key=lambda i: (p[i], -alone[i])), [1.0] * len(axes)
    first = max(found, key=lambda i: (alone[i], -p[i]))
    adds = [_added(axis, axes[first], excess, cost) for axis in axes]
    adds[first] = alone[first]
    rest = sorted((i for i in found if i != first), key=lambda i: -(adds[i] + _ALONE * alone[i]))
    others = sorted((i for i in range(len(axes)) if i not in found), key=lambda i: p[i])
    parts = [a / max(own, 1e-12) if own > 0.0 else 1.0 for a, own in zip(adds, alone, strict=True)]
    return [first, *rest, *others], parts


def _added(axis: Axis, first: Axis, excess: Excess, cost: float) -> float:
    if axis.is_common:
        return max(excess.in_common - _CLAIM * _beyond_noise(first.basis, excess.varying), 0.0)
    beside = axis.basis if first.is_common else orthonormal(axis.basis, besides=first.basis)
    return _beyond_noise(beside, excess.varying, cost)


# ------------------------------------------------------------------------------------------------
# What is seen along an axis, in one sentence with numbers.


_MOST_LEVELS = 6
_NAMED = 4
"""Levels of a column, from more of which thirds are told, and outlying specimens that are named.
Convention: what is shown."""

_ALIKE = 0.01
"""Difference of ln force below which levels are told as one. Convention: what is shown in whole
per cents."""

_TELLS = 0.05
"""Sensitivity below which a force tells no per cents. Numerical: it is a hundredth of the test's
largest, and would weigh 1/400."""

_STEP_REACH, _STEP_REACH_mm = 0.06, 1.0
"""How far off a step of the bar is still told as the place, of its length and at least. Convention:
one bin of a camera's places."""

_Part = tuple[BoolArray, str, int]
"""Rows, what to call them, and of how many specimens they are; 0 not to tell."""


class Gaps:
    """Gaps as shares of force or strain, averaged as weights of what is really told by each.

    Attributes
    ----------
    log : (N,)
        Measured over predicted, as a logarithm.
    weight : (N,)
        How much a feature says: little near zero crossings.
    """

    __slots__ = ("log", "weight")

    def __init__(self, table: FeatureTable, residual: FloatArray) -> None:
        h = table.sensitivity(table.measured_raw)
        self.log = residual / np.where(np.abs(h) > _TELLS, h, 1.0)
        self.weight = np.where(np.abs(h) > _TELLS, h**2, 0.0)

    def mean(self, rows: BoolArray) -> float | None:
        """Return the mean gap over rows, a logarithm; None where nothing is told."""
        weight = self.weight[rows]
        return float(weight @ self.log[rows] / weight.sum()) if weight.sum() > 0.0 else None

    def sentence(
        self, parts: Iterable[_Part], *, ordered: bool = False, alike: str | None = None
    ) -> str:
        """Return where the gap is highest and lowest.

        Parameters
        ----------
        ordered
            Tell all parts as they come.
        alike
            What to say where they hardly differ.
        """
        means = [(self.mean(rows), name, n) for rows, name, n in parts]
        found = [(mean, name, n) for mean, name, n in means if mean is not None]
        if not found:
            return "no force to tell it by"
        logs = [mean for mean, _, _ in found]
        if alike is not None and max(logs) - min(logs) < _ALIKE:
            return f"force {_off(float(np.mean(logs)))} {alike}"
        if not ordered:
            # The one farthest from prediction first, then the one farthest from it.
            first = max(found, key=lambda f: abs(f[0]))
            second = max(found, key=lambda f: abs(f[0] - first[0]))
            found = [first, second][: len(found)]
        told = [f"{_off(mean)} {name}{_count(n)}" for mean, name, n in found]
        return "force " + ", ".join([told[0], *(t.replace(" prediction", "", 1) for t in told[1:])])


def _column_parts(column: _Column, force: BoolArray, of_row: IntArray) -> Iterator[_Part]:
    """Levels of a column, or thirds of one of many numbers."""
    known = SPECIMEN_COLUMNS.get(column.name)
    phrase = known.at if known else f"where {column.name} is {{}}"
    phrase = "in {}" if column.name == "material" else phrase
    for label, members in _groups(column):
        yield force & members[of_row], phrase.format(label), int(members.sum())


def _groups(column: _Column) -> Iterator[tuple[str, BoolArray]]:
    numbers = np.unique(column.level[column.known]).tolist()
    if not column.is_number:
        for k in numbers:
            members = np.asarray(column.level == k)
            yield str(column.values[int(np.argmax(members))]), members
        return
    value = np.array([np.nan if v is None else float(v) for v in column.values])
    if len(numbers) <= _MOST_LEVELS:
        for k in numbers:
            members = np.asarray(column.level == k)
            yield f"{float(np.mean(value[members])):.4g}", members
        return
    low, high = np.nanquantile(value, (1.0 / 3.0, 2.0 / 3.0)).tolist()
    for third in (value <= low, (value > low) & (value <= high), value > high):
        if third.any():
            ends = dict.fromkeys(f"{f(value[third]):.3g}" for f in (np.min, np.max))
            yield " to ".join(ends), third


def _strain_parts(table: FeatureTable) -> Iterator[_Part]:
    """Quarters of the forces by strain."""
    force, strain = ~table.is_field, table.strain
    edges = np.quantile(strain[force], (0.0, 0.25, 0.5, 0.75, 1.0)) if force.any() else ()
    for k, (low, high) in enumerate(itertools.pairwise(edges)):
        rows = force & (strain >= low) & ((strain < high) if k < 3 else (strain <= high))
        name = {0: f"at strains up to {high:.2g}", 3: f"at strains of {low:.2g} and more"}
        yield rows, name.get(k, f"at strains from {low:.2g} to {high:.2g}"), 0


def _branch_parts(table: FeatureTable) -> Iterator[_Part]:
    """Branches of the tests that have more than a first loading."""
    names = {"loading": "in the first loading", "unloading": "in unloading",
             "reloading": "in reloading", "hold": "in the hold"}  # fmt: skip
    cyclic = np.isin(table.specimen, table.specimen[table.branch != 0])
    for branch, name in names.items():
        yield (table.branch == BRANCHES.index(branch)) & cyclic, name, 0


def _hold_parts(table: FeatureTable) -> Iterator[_Part]:
    """Early and late in the hold."""
    hold = table.branch == _HOLD
    early, late = np.quantile(table.time_s[hold], (0.25, 0.75)).tolist()
    yield hold & (table.time_s <= early), f"within {early:.2g} s of the hold", 0
    yield hold & (table.time_s >= late), f"after {late:.2g} s of it", 0


def _position_sentence(
    place: tuple[ProfileDesign, float, IntArray], palette: Palette, gaps: Gaps
) -> str:
    """Return where along which bar the local strain is farthest off."""
    design, at_mm, rows = place
    mean = gaps.mean(np.isin(np.arange(len(gaps.log)), rows))
    off = "off" if mean is None else _off(mean)
    sentence = f"strain {off} near {at_mm:.3g} mm along bar {design.name}"
    reach = max(_STEP_REACH * design.length_mm, _STEP_REACH_mm)
    step = min(_steps_of(design), key=lambda s: abs(s.x_mm - at_mm), default=None)
    if step is not None and abs(step.x_mm - at_mm) <= reach:
        grades = [
            min(palette.materials, key=lambda m: abs(m.coordinate - at)).id
            for at in (step.before, step.after)
        ]
        sentence += f", at the step from {grades[0]} to {grades[1]}"
    return sentence


def _outliers_sentence(ids: Sequence[str], shift: Sequence[float]) -> str:
    """Return which specimens differ from their replicates, and by how much."""
    listed = [
        f"{id} {_off(value, 'its replicates')}"
        for id, value in zip(ids[:_NAMED], shift, strict=False)
    ]
    more = len(ids) - len(listed)
    return "force of " + "; ".join(listed) + (f"; and {more} more" if more else "")


def _count(n: int) -> str:
    return f" ({n} specimen{'s' if n > 1 else ''})" if n else ""


def _off(log: float, what: str = "prediction") -> str:
    percent = 100.0 * float(np.expm1(np.clip(log, -7.0, 7.0)))
    if abs(percent) < 0.5:
        return "as predicted" if what == "prediction" else f"as {what}"
    if percent > 200.0:
        return f"{1.0 + percent / 100.0:.3g} times {what}"
    number = f"{abs(percent):.2g}" if abs(percent) < 10.0 else f"{abs(percent):.0f}"
    return f"{number} % {'above' if percent > 0.0 else 'below'} {what}"


# ------------------------------------------------------------------------------------------------
# Where the gap of a campaign lies: every axis, with its share, p-value and a sentence.


_BOOTSTRAPS = 200
"""Resamples behind the interval of a share. Convention: ends of a 90 % interval are then known to
5 % of its width."""

_THINNEST = 0.1
"""Mean excess, over a high threshold, of the logarithm of how far the farthest specimen is off,
that is believed at least. Chosen: a tenth of the distance, so that a few draws that lie close
together promise no certainty."""

_FEWEST_KNOWN = 4
"""Specimens whose value of a column is known, for it to be an axis. Numerical: three have six
orders at most, of which none is rarer than 1/6."""

_ADDS_LITTLE = 0.25
"""Share of what an axis explains that is left beside the first, below which that is said. Chosen:
three quarters of it are the first's then."""


@dataclass(frozen=True, slots=True, eq=False)
class _Case:
    """What every axis is made from."""

    campaign: Campaign
    table: FeatureTable
    residual: FloatArray
    gaps: Gaps
    signs: FloatArray
    excess: Excess
    rng: np.random.Generator

    @property
    def whitening(self) -> Whitening:
        return self.excess.whitening

    def basis(self, columns: FloatArray) -> FloatArray:
        """Return what a gap along columns may look like, whitened, beside the common gap."""
        return orthonormal(self.whitening(columns), besides=self.excess.common)

    def flipped(self, basis: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
        """Return the p-value of an axis, and that of each draw."""
        return axis_p(self.whitening, basis, y, self.signs, self.rng)


def localise(
    campaign: Campaign,
    table: FeatureTable,
    residual: FloatArray,
    whitening: Whitening,
    rng: np.random.Generator,
    *,
    permutations: int = 999,
) -> tuple[Location, ...]:
    """Return along which axes the gap varies, the one to look at first in front.

    Axes are the material, every column that varies, the strain (what all specimens have in
    common), branch and time of a hold, the place along bars, and specimens against their
    replicates. A share is of the excess over noise that the axis explains alone, so that shares of
    axes which go together add up to more than 1. P-values are family-wise over all axes.

    Parameters
    ----------
    residual : (N,)
        Measured minus predicted, on the table's transformed scale.
    whitening
        Of what the residual would be like if nothing were hidden.
    permutations
        Draws without a gap.

    Returns
    -------
    places
        Nothing for a single specimen: there is nothing to compare it with.

    Raises
    ------
    ArgumentError
        The residual does not fit the table.
    """
    if residual.shape != (len(table),) or not np.all(np.isfinite(residual)):
        raise ArgumentError(
            f"residual: shape {residual.shape} with {int(np.sum(~np.isfinite(residual)))} values "
            f"that are no finite number; it must be one finite number for each of {len(table)} "
            "features"
        )
    count = len(campaign.specimens)
    if count < 2:
        return ()
    y = whitening(residual)
    shapes = np.column_stack([_strain_shapes(table), _field_level(table)])
    common = orthonormal(whitening(shapes))
    varying = y - common @ (common.T @ y)
    signs: FloatArray = np.where(rng.random((permutations, count)) < 0.5, -1.0, 1.0)
    excess = Excess(whitening, y, varying, common)
    case = _Case(campaign, table, residual, Gaps(table, residual), signs, excess, rng)
    axes = [*_column_axes(case), *_within_axes(case), *_position_axes(case), *_outlying_axes(case)]
    p = family_wise(
        np.array([a.p for a in axes]),
        np.stack([a.drawn_p for a in axes]),
    )
    order, adds = _ranked(axes, p, excess)
    weights = rng.multinomial(count, np.full(count, 1.0 / count), _BOOTSTRAPS).astype(np.float64)
    places = []
    for i in order:
        sentence = axes[i].detail
        if i != order[0] and p[i] <= SIGNIFICANT and adds[i] < _ADDS_LITTLE:
            sentence += f"; little of it beyond what goes with {axes[order[0]].name}"
        share, interval = excess.share(axes[i]), excess.interval(axes[i], weights)
        places.append(Location(axes[i].name, share, interval, float(p[i]), sentence))
    return tuple(places)


def _column_axes(case: _Case) -> Iterator[Axis]:
    """Material and the columns of specimens.csv."""
    table, of_row = case.table, case.whitening.of_row
    shapes = _strain_shapes(table)
    for column in _campaign_columns(case.campaign):
        cells = column.coordinates[of_row]
        basis = case.basis((cells[:, :, None] * shapes[:, None, :]).reshape(len(cells), -1))
        if column.known.sum() >= _FEWEST_KNOWN and basis.shape[1]:
            parts = _column_parts(column, ~table.is_field, of_row)
            sentence = case.gaps.sentence(parts)
            yield Axis(column.name, basis, *case.flipped(basis, case.excess.varying), sentence)


def _within_axes(case: _Case) -> Iterator[Axis]:
    """Strain, branch and time of a hold: signs of whole specimens are drawn."""
    table, gaps, excess = case.table, case.gaps, case.excess
    sentence = gaps.sentence(_strain_parts(table), alike="alike at all strains")
    p, drawn = case.flipped(excess.common, excess.y)
    yield Axis("strain", excess.common, p, drawn, sentence, is_common=True)
    basis = case.basis(_branch_columns(table))
    if basis.shape[1]:
        sentence = gaps.sentence(_branch_parts(table))
        yield Axis("branch", basis, *case.flipped(basis, excess.varying), sentence)
    basis = case.basis(_hold_columns(table))
    if basis.shape[1]:
        sentence = gaps.sentence(_hold_parts(table), ordered=True)
        yield Axis("time", basis, *case.flipped(basis, excess.varying), sentence)


def _position_axes(case: _Case) -> Iterator[Axis]:
    """Places along bars: a smooth pattern, and steps between materials."""
    table, whitening, excess = case.table, case.whitening, case.excess
    if not table.is_field.any():
        return
    bars = whitening(_factors_of_bars(table, whitening.of_row))
    besides = orthonormal(np.concatenate([excess.common, bars], axis=1))
    columns = whitening(_position_columns(case.campaign, table))
    basis = orthonormal(columns, besides=besides)
    if not basis.shape[1]:
        return
    y = excess.y - besides @ (besides.T @ excess.y)
    y = y / _bar_scale(table, y, basis)
    place = _farthest_place(case.campaign, table, y)
    sentence = _position_sentence(place, case.campaign.palette, case.gaps)
    yield Axis("position", basis, *case.flipped(basis, y), sentence)


def _outlying_axes(case: _Case) -> Iterator[Axis]:
    """Specimens against their replicates: noise with stray specimens is drawn."""
    whitening = case.whitening
    level = _strain_shapes(case.table)[:, 0]
    alike = case.table.replicates[whitening.starts[:-1]]
    found = outlying_replicates(whitening, level, case.residual, alike, len(case.signs), case.rng)
    if found is None:
        return
    basis = case.basis(np.where(whitening.of_row[:, None] == found.named, level[:, None], 0.0))
    ids = [case.campaign.specimens[i].id for i in found.named]
    p = tail_p(float(np.log(max(found.largest, 1e-9))), np.log(found.drawn), _THINNEST)
    sentence = _outliers_sentence(ids, found.shift)
    yield Axis("specimen", basis, p, rank_p(found.drawn), sentence)
