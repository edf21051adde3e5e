"""Axes along which a gap may lie, and where it lies: share, p-value and a sentence of each."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc, stdtr

from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.campaign import TOLERANCES, Campaign, axis_columns, column_levels
from planner.gap.diagnosis import SIGNIFICANT, Location
from planner.gap.noise import SpecimenNoise
from planner.gap.observations import BRANCHES, FeatureTable
from planner.glance import counted
from planner.numerics import BoolArray, FloatArray, IntArray, normal_quantile
from planner.simulation.bar import ProfileDesign, step_places_mm

__all__ = ["Whitening", "axis_patterns", "localise", "specimen_patterns"]


# ------------------------------------------------------------------------------------------------
# Every axis with its patterns: columns of specimens.csv, then what lies within tests.


_LESS = 0.4
"""Size of a pattern that bends or steps along a column, relative to a straight one's; and of what
changes along a path, relative to what multiplies the whole of it. Chosen: most of what goes with a
condition is a trend, and most unknown causes act on all of a curve."""

_LEAP = 0.05
"""Half the width, of a column's range from -1 to 1, that counts as neither side of a step in its
middle. Numerical: rounding of a value that is meant to be the middle."""

_SMALL, _MIDDLING, _LARGE = 0.03, 0.12, 0.3
"""Strains of patterns along strain: two that fade, and one that grows. Chosen: in steps of three to
four, up to a usual pull's end."""


def axis_patterns(
    campaign: Campaign, table: FeatureTable, sensitivity: FloatArray
) -> Mapping[str, FloatArray]:
    """Return by axis what a gap along it looks like in the features, (N, k); what varies alone.

    Parameters
    ----------
    sensitivity : (N,)
        Of the features by the logarithm of force or strain.
    """
    h = np.where(table.is_field, 0.0, sensitivity)
    peak = np.zeros(int(table.specimen.max()) + 1)
    np.maximum.at(peak, table.specimen, table.strain)
    travel = table.strain / np.maximum(peak[table.specimen], 1e-12) - 0.5
    level_and_slope = np.stack([h, h * travel], axis=1)
    cells = _axis_cells(campaign)
    found: dict[str, list[FloatArray]] = {}
    for name in (*TOLERANCES, "orientation", "batch", *campaign.covariates):
        if (patterns := specimen_patterns(cells[name])) is not None:
            rows = patterns[table.specimen]
            found[name] = [rows * h[:, None], rows * (_LESS * 2.0 * h * travel)[:, None]]
    strain = np.minimum(table.strain, 1.0)
    bumps = [np.exp(-strain / _SMALL), np.exp(-strain / _MIDDLING), strain / _LARGE]
    found["strain"] = [(h * bump)[:, None] for bump in bumps]
    later = [k for k, name in enumerate(BRANCHES) if name not in ("loading", "field")]
    found["branch"] = [level_and_slope * (table.branch == k)[:, None] for k in later]
    found["time"] = [_along_hold(table, h)]
    names = [s.material for s in campaign.specimens]
    materials = [name for name in dict.fromkeys(names) if name is not None]
    if len(materials) > 1:
        of_each = np.array([[name == one for name in names] for one in materials])
        found["material"] = [level_and_slope * is_of[table.specimen, None] for is_of in of_each]
    found["position"] = [_along_bars(campaign, table, sensitivity)]
    axes = {name: np.concatenate(parts, axis=1) for name, parts in found.items()}
    axes = {name: columns[:, np.any(columns != 0.0, axis=0)] for name, columns in axes.items()}
    return {name: columns for name, columns in axes.items() if columns.shape[1]}


def _axis_cells(campaign: Campaign) -> Mapping[str, tuple[float | str | None, ...]]:
    """Return columns of specimens.csv by name, sizes that are not stated as they were measured."""
    cells = dict(axis_columns(campaign))
    for name in ("width_mm", "thickness_mm"):
        pairs = zip(cells[name], cells[f"measured_{name}"], strict=True)
        cells[name] = tuple(m if size is None else size for size, m in pairs)
    return cells


def specimen_patterns(cells: Sequence[str | float | None]) -> FloatArray | None:
    """Return patterns over specimens, (n, k), mean 0; None where the column does not vary."""
    known = np.array([c is not None for c in cells])
    values = [c for c in cells if c is not None]
    distinct = sorted(set(values), key=str)
    if len(distinct) > 3 and not any(isinstance(v, str) for v in values):
        at = np.array([0.0 if c is None else float(c) for c in cells])
        low, high = min(at[known]), max(at[known])
        t = 2.0 * (at - low) / (high - low) - 1.0
        bend, leap = 1.5 * t * t - 0.5, np.sign(t) * (np.abs(t) > _LEAP)
        patterns = np.stack([t, _LESS * bend, _LESS * leap], axis=1)
    elif 1 < len(distinct) <= max(2, len(values) // 2):
        patterns = np.array([[float(cell == value) for value in distinct] for cell in cells])
    else:
        return None
    return np.asarray((patterns - patterns[known].mean(axis=0)) * known[:, None])


def _along_hold(table: FeatureTable, h: FloatArray) -> FloatArray:
    """Return a level, a slope and a bend over the logarithm of the time of a hold, (N, 3)."""
    hold = table.branch == BRANCHES.index("hold")
    log = np.log(np.maximum(table.time_s, 1e-3))
    low, high = (float(f(log[hold], initial=0.0)) for f in (np.min, np.max))
    w = (log - low) / max(high - low, 1e-9)
    return np.where(hold, h, 0.0)[:, None] * w[:, None] ** np.arange(3)


# ------------------------------------------------------------------------------------------------
# The place along graded bars: smooth patterns, and steps between materials.


_KNOTS = 6
"""Of the smooth pattern along a bar. Chosen: a fifth of the gauge apart; what is narrower shows at
steps."""

_ASIDE_MM = 0.2
"""How far off a step the coordinates before and after it are taken. Numerical: a rise of
`step_places_mm` ends within 0.15 mm of its middle."""


def _steps_of(design: ProfileDesign) -> FloatArray:
    """Return of each step of a design the place, and the coordinates before and after, (k, 3)."""
    at = step_places_mm(design)
    return np.stack([at, design.at(at - _ASIDE_MM), design.at(at + _ASIDE_MM)], axis=1)


def _rows_by_design(
    campaign: Campaign, table: FeatureTable
) -> dict[str, tuple[IntArray, ProfileDesign]]:
    """Return by design the rows of local strains, bars of one design together."""
    rows: dict[str, tuple[list[int], ProfileDesign]] = {}
    for row in np.flatnonzero(table.is_field).tolist():
        if (design := campaign.specimens[int(table.specimen[row])].profile) is not None:
            rows.setdefault(design.name, ([], design))[0].append(row)
    return {name: (np.array(found), design) for name, (found, design) in rows.items()}


def _along_bars(campaign: Campaign, table: FeatureTable, sensitivity: FloatArray) -> FloatArray:
    """Return what a gap of strain that varies along the bars may look like, (N, k).

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
        for at_mm, before, after in _steps_of(design):
            away, size = (x - at_mm) / width, after - before
            bell = np.exp(-0.5 * away**2)
            odd[rows] += size * away * bell
            even[rows] += abs(size) * bell
    return np.stack([*columns, odd, even], axis=1) * sensitivity[:, None]


# ------------------------------------------------------------------------------------------------
# Residuals on a scale where all noise is of unit variance and unrelated.
#
# A specimen's own noise is taken out by its covariance, what specimens share by the inverse root of
# ``I + V V'`` with V the whitened shared columns, which is of low rank. So what laws or batches may
# well be off by counts no more than its prior allows.


class Whitening:
    """The way from N features to N numbers of unit noise.

    Parameters
    ----------
    shared : (N, q)
        What specimens share, a column of prior deviation 1 each, white by the noise: batches, the
        calibration of the palette's laws. It is marginalised.
    log_sd
        How far the noise may be off, as a standard deviation of its logarithm.

    Attributes
    ----------
    degrees_of_freedom
        Of a scaled chi-square variance that is as uncertain as the noise.
    """

    def __init__(self, noise: SpecimenNoise, shared: FloatArray, log_sd: float) -> None:
        self.noise, self.degrees_of_freedom = noise, 0.5 / max(log_sd, 1e-3) ** 2
        # What specimens share, orthonormal, and how much of it is taken off.
        self._directions, size, _ = np.linalg.svd(shared, full_matrices=False)
        self._shrink = 1.0 - 1.0 / np.sqrt(1.0 + size**2)

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), whitened: each specimen's own noise, then what they share."""
        whitened = self.noise.whiten(columns)
        along = (self._directions.T @ whitened).T * self._shrink
        return np.asarray(whitened - self._directions @ along.T, dtype=np.float64)

    def summed(self, values: FloatArray) -> FloatArray:
        """Return sums over each specimen's rows, (n, ...)."""
        return np.asarray(np.add.reduceat(values, self.noise.first_row[:-1], axis=0))


def _orthonormal(columns: FloatArray, besides: FloatArray | None = None) -> FloatArray:
    """Return an orthonormal basis of columns, (N, k), and of what is in them beside another."""
    scale = np.linalg.norm(columns, axis=0)
    left: FloatArray = columns[:, scale > 0.0] / scale[scale > 0.0]
    if besides is not None:
        for _ in range(2):  # once more for rounding
            left = left - besides @ (besides.T @ left)
    basis, singular, _ = np.linalg.svd(left, full_matrices=False)
    # Columns were of unit length: what is left of less than a hundredth is the other's.
    return np.ascontiguousarray(basis[:, singular > 1e-2])


# ------------------------------------------------------------------------------------------------
# One axis: what all specimens agree on along it, against how they differ.
#
# Without a gap a specimen's whitened features are as likely to lie above as below, all together,
# and no specimen knows of another. So the specimen is the unit: a one-sample F over specimens,
# whose variance is moderated by that of the noise, in the degrees of freedom in which that is
# known, and whose degrees of freedom are those of the directions in which they differ (Greenhouse
# and Geisser, Psychometrika 24, 1959). Noise is never taken to be less than declared.


_SMALLEST_WEIGHT = 1e-2
"""Weight, of the largest, below which a specimen tells nothing of an axis. Numerical: it
tells a hundredth as much."""

_SMALLEST = 1e-12
"""Of a p-value. Convention: no tail of a noise that is estimated is known so far out."""


@dataclass(frozen=True, slots=True, eq=False)
class _Axis:
    """One axis; ``strain`` is that of the gap that all specimens have in common.

    Attributes
    ----------
    basis : (N, k)
        Orthonormal, in whitened features: what a gap along the axis may look like.
    p
        Of what is seen, for this axis alone; small where the gap varies along it.
    spread
        Variance of what specimens agree on, by how they differ, over that of noise; 1 or more.
    detail
        One sentence.
    """

    name: str
    basis: FloatArray
    p: float
    spread: float
    detail: str


_Part = tuple[BoolArray, str]
"""Rows, and what to call them."""


_CLAIM = 3.0
"""How much of the gap in common an axis may claim, over what varies along it. Physical: the square
of the mean of a ramp from zero, over its variance; an effect in proportion to a column is such."""


class _Case:
    """What every axis is made from, and what there is to explain.

    An axis may claim some of the gap that all specimens have in common: with half of them at
    33 degC, soft, and half as predicted, half of the gap is common and yet lies along temperature.
    It may claim three times what the gap varies by along it, which is what a gap has in common
    that rises evenly from none. A gap that is the same everywhere is so claimed by no axis.

    Attributes
    ----------
    force, local : (N,)
        What all forces, and all local strains, being off by one factor looks like.
    log, weight : (N,)
        Measured over predicted, as a logarithm; and how much a feature says of it: little near
        zero crossings.
    y, varying : (N,)
        Whitened residuals, all and without their common part.
    common : (N, c), in_common
        What all specimens have in common: orthonormal, and how much beyond noise it explains.
    patterns
        See `axis_patterns`.
    """

    def __init__(
        self, campaign: Campaign, table: FeatureTable, residual: FloatArray, whitening: Whitening
    ) -> None:
        self.campaign, self.table, self.residual = campaign, table, residual
        self.whitening, self.y = whitening, whitening(residual)
        # Where zero is predicted what was measured is noise, and would explain itself.
        predicted = table.raw(table.measured - residual)
        level = table.sensitivity(predicted)
        tells = np.abs(level) > _TELLS
        level = np.where(tells, table.chord(predicted), level)
        self.force = np.where(table.is_field, 0.0, level)
        self.local = np.where(table.is_field, level, 0.0)
        self.log = residual / np.where(tells, level, 1.0)
        self.weight = np.where(tells, level**2, 0.0)
        self.patterns = axis_patterns(campaign, table, level)
        shared = np.column_stack([self.force, self.patterns["strain"], self.local])
        self.common = _orthonormal(whitening(shared))
        self.varying = self.y - self.common @ (self.common.T @ self.y)
        self.in_common = _beyond_noise(self.common, self.y)

    def explained(self, axis: _Axis, deviations: float = 0.0) -> float:
        """Return what an axis explains beyond noise, its claim on the common gap included.

        Parameters
        ----------
        deviations
            How much more of it there is than was seen, in standard deviations.
        """
        if axis.name == "strain":
            return _beyond_noise(axis.basis, self.y, deviations, axis.spread)
        own = _beyond_noise(axis.basis, self.varying, deviations, axis.spread)
        return own + min(_CLAIM * own, self.in_common)

    def share(self, axis: _Axis, deviations: float = 0.0) -> float:
        """Return the share of the excess, 0 to 1; see `explained`."""
        explained = self.explained(axis, deviations)
        count = len(self.y)
        # At least two deviations of pure noise.
        total = max(float(self.y @ self.y) - count, 2.0 * math.sqrt(2.0 * count))
        return explained / max(total, explained)

    def mean(self, rows: BoolArray) -> float | None:
        """Return the mean gap over rows, a logarithm; None where nothing is told."""
        weight = self.weight[rows]
        return float(weight @ self.log[rows] / weight.sum()) if weight.sum() > 0.0 else None

    def sentence(self, parts: Iterable[_Part], alike: str | None = None) -> str:
        """Return where the gap is highest and lowest.

        Parameters
        ----------
        alike
            What to say where they hardly differ.
        """
        found = [(mean, name) for of, name in parts if (mean := self.mean(of)) is not None]
        if not found:
            return "no force to tell it by"
        logs = [mean for mean, _ in found]
        if alike is not None and max(logs) - min(logs) < _ALIKE:
            return f"force {_off(float(np.mean(logs)))} {alike}"
        # The one farthest from prediction first, then the one farthest from it.
        first = max(found, key=lambda f: abs(f[0]))
        second = max(found, key=lambda f: abs(f[0] - first[0]))
        told = [f"{_off(mean)} {name}" for mean, name in (first, second)[: len(found)]]
        return "force " + ", ".join([told[0], *(t.replace(" prediction", "", 1) for t in told[1:])])

    def basis(self, columns: FloatArray) -> FloatArray:
        """Return what a gap along columns may look like, whitened, beside the common gap."""
        return _orthonormal(self.whitening(columns), besides=self.common)

    def tested(self, basis: FloatArray, y: FloatArray) -> tuple[float, float]:
        """Return `p` and `spread` of an axis of orthonormal columns; see `_Axis`."""
        whitening, k, agreed = self.whitening, basis.shape[1], basis.T @ y
        weight = whitening.summed(basis**2)
        carries = weight > _SMALLEST_WEIGHT * weight.max(axis=0)
        root = np.sqrt(np.where(carries, weight, 1.0))
        left = whitening.summed(basis * (y - basis @ agreed)[:, None])
        apart = np.where(carries, left / root, 0.0)
        freedom = max(float(carries.sum()) - k, 0.0)
        missing = max(freedom - float(np.sum(apart**2)), 0.0)
        known = freedom + whitening.degrees_of_freedom
        covariance = apart.T @ apart
        covariance += (missing + whitening.degrees_of_freedom) / k * np.eye(k)
        total = float(np.trace(covariance))
        # Where specimens differ in one direction, they tell as often as if it were alone.
        share = total**2 / (k * float(np.sum(covariance**2)))
        squares = float(agreed @ agreed)
        p = float(fdtrc(share * k, share * known, squares / k * known / total))
        varies = float(np.sum((left @ agreed) ** 2)) / max(squares, 1e-12)
        return max(p, _SMALLEST), max(varies, 1.0)


def _beyond_noise(
    basis: FloatArray, y: FloatArray, deviations: float = 0.0, spread: float = 1.0
) -> float:
    """Return the sum of squares along an orthonormal basis, less one a degree of freedom.

    Parameters
    ----------
    deviations, spread
        How many of its own more are returned: it is of noncentral chi-square, times the spread.
    """
    beyond, k = float(np.sum((basis.T @ y) ** 2)) - basis.shape[1], basis.shape[1]
    variance = spread * (4.0 * max(beyond, 0.0) + 2.0 * k)
    return float(max(beyond + deviations * math.sqrt(variance), 0.0))


# ------------------------------------------------------------------------------------------------
# The order of axes: by the share of the gap that each explains, counted once more as far as the
# likely causes lie along it.
#
# A weak effect that all hypotheses together tell from chance may be less clear, by itself, than
# what happens to go along with the strain. And yet what no likely cause explains must be seen.


def _added(axis: _Axis, first: _Axis, case: _Case) -> float:
    """Return what an axis explains beside the first."""
    if axis.name == "strain":
        return max(case.in_common - _CLAIM * _beyond_noise(first.basis, case.varying), 0.0)
    beside = axis.basis if first.name == "strain" else _orthonormal(axis.basis, besides=first.basis)
    return _beyond_noise(beside, case.varying)


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


def _column_parts(case: _Case, name: str, cells: Sequence[float | str | None]) -> Iterator[_Part]:
    """Levels of a column, or thirds of one of many numbers."""
    phrases = {"material": "in {}"} | {known: c.at for known, c in SPECIMEN_COLUMNS.items()}
    for label, members in _groups(name, cells):
        rows = ~case.table.is_field & members[case.table.specimen]
        words = phrases[name].format(label) if name in phrases else f"where {name} is {label}"
        yield rows, f"{words} ({counted(int(members.sum()), 'specimen')})"


def _groups(name: str, cells: Sequence[float | str | None]) -> Iterator[tuple[str, BoolArray]]:
    level = column_levels(name, cells)
    known = sorted(set(level) - {None}, key=str)
    members = [np.array([of == k for of in level]) for k in known]
    if any(isinstance(cell, str) for cell in cells):
        yield from zip(map(str, known), members, strict=True)
        return
    value = np.array([np.nan if cell is None else float(cell) for cell in cells])
    ends = [[float(np.mean(value[of_it]))] for of_it in members]
    if len(known) > _MOST_LEVELS:
        low, high = np.nanquantile(value, (1.0 / 3.0, 2.0 / 3.0)).tolist()
        thirds = value <= low, (value > low) & (value <= high), value > high
        members = [third for third in thirds if third.any()]
        ends = [[float(np.min(value[of_it])), float(np.max(value[of_it]))] for of_it in members]
    told = {end for of_it in ends for end in of_it}
    # Four digits of levels, three of ends; of dates and the like all, or what tells them apart.
    digits = max(5 - len(ends[0]), min(len(f"{max(map(abs, told)):.0f}"), 17))
    while len({f"{end:.{digits}g}" for end in told}) < len(told):
        digits += 1
    for of_it, own in zip(members, ends, strict=True):
        yield " to ".join(dict.fromkeys(f"{end:.{digits}g}" for end in own)), of_it


def _strain_parts(table: FeatureTable) -> Iterator[_Part]:
    """Quarters of the forces by strain."""
    force, strain = ~table.is_field, table.strain
    edges = np.quantile(strain[force], (0.0, 0.25, 0.5, 0.75, 1.0)) if force.any() else ()
    for k, (low, high) in enumerate(itertools.pairwise(edges)):
        rows = force & (strain >= low) & ((strain < high) if k < 3 else (strain <= high))
        name = {0: f"at strains up to {high:.2g}", 3: f"at strains of {low:.2g} and more"}
        yield rows, name.get(k, f"at strains from {low:.2g} to {high:.2g}")


def _branch_parts(table: FeatureTable) -> Iterator[_Part]:
    """Branches of the tests that have more than a first loading."""
    names = ("in the first loading", "in unloading", "in reloading", "in the hold")
    cyclic = np.isin(table.specimen, table.specimen[table.branch != 0])
    for branch, name in enumerate(names):  # as `BRANCHES` has them
        yield (table.branch == branch) & cyclic, name


def _hold_parts(table: FeatureTable) -> Iterator[_Part]:
    """Early and late in the hold."""
    hold = table.branch == BRANCHES.index("hold")
    early, late = np.quantile(table.time_s[hold], (0.25, 0.75)).tolist()
    yield hold & (table.time_s <= early), f"within {early:.2g} s of the hold"
    yield hold & (table.time_s >= late), f"after {late:.2g} s of the hold"


def _position_sentence(case: _Case, y: FloatArray) -> str:
    """Return where along which bar the local strain is farthest off.

    Parameters
    ----------
    y : (N,)
        Whitened.
    """
    found: list[tuple[float, ProfileDesign, float, IntArray]] = []
    for rows, design in _rows_by_design(case.campaign, case.table).values():
        at, place = np.unique(np.round(case.table.x_mm[rows], 3), return_inverse=True)
        score = np.abs(np.bincount(place, y[rows]) / np.sqrt(np.bincount(place)))
        peak = int(np.argmax(score))
        found.append((float(score[peak]), design, float(at[peak]), rows[place == peak]))
    _, design, at_mm, rows = max(found, key=lambda one: one[0])
    mean = case.mean(np.isin(np.arange(len(case.y)), rows))
    off = "off" if mean is None else _off(mean)
    sentence = f"strain {off} near {at_mm:.3g} mm along bar {design.name}"
    reach = max(_STEP_REACH * design.length_mm, _STEP_REACH_mm)
    near = min(_steps_of(design), key=lambda step: abs(step[0] - at_mm), default=None)
    if near is not None and abs(near[0] - at_mm) <= reach:
        materials = case.campaign.palette.materials
        grades = [min(materials, key=lambda m: abs(m.coordinate - at)).id for at in near[1:]]
        sentence += f", at the step from {grades[0]} to {grades[1]}"
    return sentence


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


_FEWEST_KNOWN = 4
"""Specimens whose value of a column is known, for it to be an axis. Numerical: three have six
orders at most, of which none is rarer than 1/6."""

_ADDS_LITTLE = 0.25
"""Share of what an axis explains that is left beside the first, below which that is said. Chosen:
three quarters of it are the first's then."""


def localise(
    campaign: Campaign,
    table: FeatureTable,
    residual: FloatArray,
    whitening: Whitening,
    likely: Mapping[str, float] | None = None,
) -> tuple[Location, ...]:
    """Return along which axes the gap varies, the one to look at first in front.

    Axes are the material, every column that varies, the strain (what all specimens have in
    common), branch and time of a hold, the place along bars, and specimens against their
    replicates. A share is of the excess over noise that the axis explains alone, so that shares of
    axes which go together add up to more than 1. P-values are family-wise over all axes, by their
    number (Bonferroni).

    Parameters
    ----------
    residual : (N,)
        Measured minus predicted, on the table's transformed scale.
    whitening
        Of what the residual would be like if nothing were hidden.
    likely
        How probable it is of each axis that the gap's cause lies along it; 0 by default.

    Returns
    -------
    places
        Nothing for a single specimen: there is nothing to compare it with.
    """
    if len(campaign.specimens) < 2:
        return ()
    case = _Case(campaign, table, residual, whitening)
    in_words, tested = case.sentence(_strain_parts(table), "alike at all strains"), case.tested
    axes = [_Axis("strain", case.common, *tested(case.common, case.y), in_words)]
    for name, columns in case.patterns.items():
        if name == "position":
            axes += _axis_along_bars(case, columns)
        elif name != "strain":
            axes += _axis_along(case, name, columns)
    axes += _axis_of_strays(case)

    def unlikely(axis: _Axis) -> tuple[float, float, float]:
        probability = 0.0 if likely is None else likely.get(axis.name, 0.0)
        return -(1.0 + probability) * case.share(axis), -probability, axis.p

    order = sorted(axes, key=unlikely)
    first, end, places = order[0], normal_quantile(0.9), []
    for axis in order:
        p, sentence = min(len(axes) * axis.p, 1.0), axis.detail
        beside = axis is not first and p <= SIGNIFICANT
        if beside and _added(axis, first, case) < _ADDS_LITTLE * case.explained(axis):
            sentence += f"; little of it beyond what goes with {first.name}"
        interval = case.share(axis, -end), case.share(axis, end)
        places.append(Location(axis.name, case.share(axis), interval, p, sentence))
    return tuple(places)


def _axis_along(case: _Case, name: str, columns: FloatArray) -> Iterator[_Axis]:
    """Yield the axis of a column of specimens.csv, of branch or of the time of a hold, if any."""
    basis, cells = case.basis(columns), _axis_cells(case.campaign).get(name)
    if not basis.shape[1] or (cells and sum(c is not None for c in cells) < _FEWEST_KNOWN):
        return
    of_path = _branch_parts if name == "branch" else _hold_parts
    parts = _column_parts(case, name, cells) if cells else of_path(case.table)
    yield _Axis(name, basis, *case.tested(basis, case.varying), case.sentence(parts))


def _axis_along_bars(case: _Case, columns: FloatArray) -> Iterator[_Axis]:
    """Yield the axis of places along bars: a smooth pattern, and steps between materials.

    A factor on all local strains of a bar is no matter of position.
    """
    whitening, of_row = case.whitening, case.table.specimen
    is_bar = of_row[:, None] == np.unique(of_row[case.table.is_field])
    bars = whitening(np.where(is_bar, case.local[:, None], 0.0))
    besides = _orthonormal(np.concatenate([case.common, bars], axis=1))
    basis = _orthonormal(whitening(columns), besides=besides)
    if not basis.shape[1]:
        return
    y = case.y - besides @ (besides.T @ case.y)
    # What no pattern along the bars explains tells how much larger the noise is than declared.
    left = (y - basis @ (basis.T @ y))[case.table.is_field]
    y = y / max(1.0, float(np.sqrt(left @ left / max(len(left) - basis.shape[1], 1))))
    yield _Axis("position", basis, *case.tested(basis, y), _position_sentence(case, y))


_TAIL_FREEDOM = 5.0
"""Of Student's t, by which specimens are judged. Chosen: a stray one is no rarity, and yet the
variance and the kurtosis are finite."""

_NORMAL_MAD = 0.6745
"""Median absolute deviation over the standard one. Convention: of a normal distribution."""


def _axis_of_strays(case: _Case) -> Iterator[_Axis]:
    """Yield the axis of specimens that stray from their replicates, if there are any.

    Each specimen's level is compared with the mean of its replicates'; the scale is told by the
    median over all specimens, so that a few that are off do not hide themselves. Told are those
    that are significantly off, the farthest first; at least that one.
    """
    whitening = case.whitening
    test = case.table.replicates[whitening.noise.first_row[:-1]]
    phi = whitening.noise.whiten(case.force)
    information = whitening.summed(phi**2)
    seen = information > 0.0
    known = np.where(seen, information, 1.0)
    height = whitening.summed(phi * whitening.noise.whiten(case.residual)) / known
    alike = (test[:, None] == test) & seen[:, None] & ~np.eye(len(test), dtype=bool)
    compared = (alike & seen).any(axis=1)
    if compared.sum() < 2:
        return
    scale, p = 0.0, 1.0
    strays: list[int] = []
    left = seen.copy()
    for _ in range(max(1, len(test) // 3)):
        others = (alike & left).astype(np.float64)
        others /= np.maximum(others.sum(axis=1, keepdims=True), 1.0)
        off = np.where(others.any(axis=1), height - others @ height, 0.0)
        away = np.abs(off) / np.sqrt(1.0 / known + others**2 @ (1.0 / known))
        # A few that are left out do not change the scale.
        scale = scale or max(float(np.median(away[compared])) / _NORMAL_MAD, 1e-9)
        # Of two that differ from each other only, the one farther from what is predicted.
        worst = int(np.argmax(np.where(left, away, 0.0) / scale + 1e-6 * np.abs(height)))
        chance = 2.0 * float(compared.sum()) * float(stdtr(_TAIL_FREEDOM, -away[worst] / scale))
        if strays and chance > SIGNIFICANT:
            break
        p = min(p, chance)
        strays.append(worst)
        left[worst] = False

    def mean(among: BoolArray) -> float:
        return case.mean(among[case.table.specimen] & ~case.table.is_field) or 0.0

    # Told as it is: a level that is likeliest where noise is correlated may lie beyond all steps.
    logs = [mean(np.arange(len(test)) == i) - mean(alike[i] & left) for i in strays]
    is_named = case.table.specimen[:, None] == strays
    basis = case.basis(np.where(is_named, case.force[:, None], 0.0))
    ids = [s.id for s in case.campaign.specimens]
    told = [f"{ids[i]} {_off(log, 'its replicates')}" for i, log in zip(strays, logs, strict=True)]
    more = [f"and {len(told) - _NAMED} more"] if len(told) > _NAMED else []
    sentence = "force of " + "; ".join(told[:_NAMED] + more)
    yield _Axis("specimen", basis, max(p, _SMALLEST), 1.0, sentence)
