"""Axes along which a gap may lie, and where it lies: share, p-value and a sentence of each."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.campaign import TOLERANCES, Campaign, axis_columns, column_levels
from planner.gap.diagnosis import SIGNIFICANT, Location
from planner.gap.noise import SpecimenNoise
from planner.gap.observations import BRANCHES, FeatureTable
from planner.glance import counted
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.simulation.bar import ProfileDesign

__all__ = ["Whitening", "axis_patterns", "localise", "specimen_patterns"]


# ------------------------------------------------------------------------------------------------
# Every axis with its patterns: columns of specimens.csv, then what lies within tests.


_CURVED = 0.4
"""Size of a pattern that bends or steps along a column, relative to a straight one's. Chosen: most
of what goes with a condition is a trend."""

_LEAP = 0.05
"""Half the width, of a column's range from -1 to 1, that counts as neither side of a step in its
middle. Numerical: rounding of a value that is meant to be the middle."""

_SMALL, _MIDDLING, _LARGE = 0.03, 0.12, 0.3
"""Strains of patterns along strain: two that fade, and one that grows. Chosen: in steps of three to
four, up to a usual pull's end."""

_CHANGING = 0.4
"""Size of what changes along a path, relative to what multiplies the whole of it. Chosen: most
unknown causes act on all of a curve, and not alike all along it."""


_HOLD = BRANCHES.index("hold")


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
    travel = _share_of_peak(table) - 0.5
    level_and_slope = np.stack([h, h * travel], axis=1)
    cells = _axis_cells(campaign)
    found: dict[str, list[FloatArray]] = {}
    for name in (*TOLERANCES, "orientation", "batch", *campaign.covariates):
        patterns = specimen_patterns(cells[name])
        if patterns is not None:
            rows = patterns[table.specimen]
            changing = _CHANGING * 2.0 * h * travel
            found[name] = [rows * h[:, None], rows * changing[:, None]]
    strain = np.minimum(table.strain, 1.0)
    bumps = [np.exp(-strain / _SMALL), np.exp(-strain / _MIDDLING), strain / _LARGE]
    found["strain"] = [(h * bump)[:, None] for bump in bumps]
    found["branch"] = [
        level_and_slope * (table.branch == k)[:, None]
        for k, name in enumerate(BRANCHES)
        if name not in ("loading", "field")
    ]
    found["time"] = [_along_hold(table, h)]
    names = [s.material for s in campaign.specimens]
    materials = _indicators(names, [n for n in dict.fromkeys(names) if n is not None])
    if materials.shape[1] > 1:
        of_each = materials[table.specimen].T
        found["material"] = [level_and_slope * of_it[:, None] for of_it in of_each]
    found["position"] = [_along_bars(campaign, table, sensitivity)]
    axes = {name: np.concatenate(parts, axis=1) for name, parts in found.items()}
    axes = {name: columns[:, np.any(columns != 0.0, axis=0)] for name, columns in axes.items()}
    return {name: columns for name, columns in axes.items() if columns.shape[1]}


def _axis_cells(campaign: Campaign) -> Mapping[str, tuple[float | str | None, ...]]:
    """Return columns of specimens.csv by name, sizes that are not stated as they were measured."""
    cells = dict(axis_columns(campaign))
    for name in ("width_mm", "thickness_mm"):
        measured = [getattr(s, f"measured_{name}") for s in campaign.specimens]
        pairs = zip(cells[name], measured, strict=True)
        cells[name] = tuple(m if size is None else size for size, m in pairs)
    return cells


def _share_of_peak(table: FeatureTable) -> FloatArray:
    """Return each feature's strain over the largest of its specimen, (N,)."""
    peak = np.zeros(int(table.specimen.max()) + 1)
    np.maximum.at(peak, table.specimen, table.strain)
    return np.asarray(table.strain / np.maximum(peak[table.specimen], 1e-12))


def _indicators(cells: Sequence[object], values: Sequence[object]) -> FloatArray:
    """Return 1 where a cell is a value and 0 elsewhere, (cells, values)."""
    return np.array([[float(cell == value) for value in values] for cell in cells])


def specimen_patterns(cells: Sequence[str | float | None]) -> FloatArray | None:
    """Return patterns over specimens, (n, k), mean 0; None where the column does not vary."""
    known = np.array([c is not None for c in cells])
    values = [c for c in cells if c is not None]
    distinct = sorted(set(values), key=str)
    if len(distinct) < 2:
        return None
    if len(distinct) > 3 and not any(isinstance(v, str) for v in values):
        at = np.array([0.0 if c is None else float(c) for c in cells])
        low, high = min(at[known]), max(at[known])
        t = 2.0 * (at - low) / (high - low) - 1.0
        bend, leap = 1.5 * t * t - 0.5, np.sign(t) * (np.abs(t) > _LEAP)
        patterns = np.stack([t, _CURVED * bend, _CURVED * leap], axis=1)
    elif len(distinct) <= max(2, len(values) // 2):
        patterns = _indicators(cells, distinct)
    else:
        return None
    return np.asarray((patterns - patterns[known].mean(axis=0)) * known[:, None])


def _along_hold(table: FeatureTable, h: FloatArray) -> FloatArray:
    """Return a level, a slope and a bend over the logarithm of the time of a hold, (N, 3)."""
    hold = table.branch == _HOLD
    log = np.log(np.maximum(table.time_s, 1e-3))
    low, high = (float(f(log[hold], initial=0.0)) for f in (np.min, np.max))
    w = (log - low) / max(high - low, 1e-9)
    return np.where(hold, h, 0.0)[:, None] * w[:, None] ** np.arange(3)


# ------------------------------------------------------------------------------------------------
# The place along graded bars: smooth patterns, and steps between materials.


_KNOTS = 6
"""Of the smooth pattern along a bar. Chosen: a fifth of the gauge apart; what is narrower shows at
steps."""

_STEEP_PER_MM = 0.15
"""Change of a design's coordinate from which it is a step. Chosen: a ramp over a whole gauge of 25
mm has at most 0.04, materials side by side have far more."""


def _steps_of(design: ProfileDesign) -> list[list[float]]:
    """Return where a design goes from one coordinate to another, within a millimetre or at once.

    Of each step the place in mm, and the coordinates before and after.
    """
    x, m = design.x_mm, design.coordinate
    rise, run = np.diff(m), np.diff(x)
    steep = (np.abs(rise) > _STEEP_PER_MM * run) & (np.abs(rise) > 1e-3) & (run < 1.0)
    steps = np.stack([0.5 * (x[:-1] + x[1:]), m[:-1], m[1:]], axis=1)
    found: list[list[float]] = steps[steep].tolist()
    return found


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


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """The way from N features to N numbers of unit noise.

    Attributes
    ----------
    directions, shrink : (N, q), (q,)
        What specimens share, orthonormal, and how much of it is taken off.
    degrees_of_freedom
        Of a scaled chi-square variance that is as uncertain as the noise.
    """

    noise: SpecimenNoise
    directions: FloatArray
    shrink: FloatArray
    degrees_of_freedom: float

    @classmethod
    def of(cls, noise: SpecimenNoise, shared: FloatArray, log_sd: float) -> "Whitening":
        """Return the whitening of noise.

        Parameters
        ----------
        shared : (N, q)
            What specimens share, a column of prior deviation 1 each: batches, the calibration of
            the palette's laws. It is marginalised.
        log_sd
            How far the noise may be off, as a standard deviation of its logarithm.
        """
        directions, singular, _ = np.linalg.svd(noise.whiten(shared), full_matrices=False)
        shrink = 1.0 - 1.0 / np.sqrt(1.0 + singular**2)
        return cls(noise, directions, shrink, 0.5 / max(log_sd, 1e-3) ** 2)

    @property
    def starts(self) -> IntArray:
        """Rows of specimen i are ``starts[i]`` to ``starts[i + 1]``, (n + 1,)."""
        return self.noise.first_row

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), whitened: each specimen's own noise, then what they share."""
        whitened = self.noise.whiten(columns)
        along = (self.directions.T @ whitened).T * self.shrink
        return np.asarray(whitened - self.directions @ along.T, dtype=np.float64)

    def summed(self, values: FloatArray) -> FloatArray:
        """Return sums over each specimen's rows, (n, ...)."""
        return np.asarray(np.add.reduceat(values, self.starts[:-1], axis=0))


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
# P-values over a family of axes: how often the clearest of all is as clear without a gap.
#
# Westfall and Young's single-step minimum of p-values. The statistic of each axis is brought to one
# scale by its own draws first, so that none dominates; the draws then say how often the smallest of
# all is as small, whatever the axes have in common. An axis is never clearer than its own statistic
# says.
#
# What draws cannot resolve follows from the tail of its logarithm, which is exponential (a
# generalised Pareto tail of shape 0, fitted to the clearest tenth of draws, never thinner than that
# of a true p-value).


_SMALLEST = 1e-12
"""Of a p-value. Convention: a tail fitted to a thousand draws says nothing about less."""

_TIES = 1e-9
"""Relative difference below which a draw is as large as what is seen. Numerical: rounding."""


def _family_wise(axes: Sequence["_Axis"]) -> FloatArray:
    """Return family-wise p-values of axes, (A,), from statistics like p-values."""
    own = [max(a.p, _tail_p(-math.log(a.p), -np.log(a.drawn_p), 1.0)) for a in axes]
    clearest = -np.log(np.min([_rank_p(-a.drawn_p) for a in axes], axis=0))
    return np.array([max(p, _tail_p(-math.log(p), clearest, 1.0)) for p in own])


def _rank_p(drawn: FloatArray) -> FloatArray:
    """Return the share of draws that are as large as each one."""
    as_large = len(drawn) - np.searchsorted(np.sort(drawn), drawn, side="left")
    return np.asarray(as_large / len(drawn))


def _tail_p(seen: float, drawn: FloatArray, thinnest: float) -> float:
    """Return the chance of a statistic as large as that seen, by draws and their exponential tail.

    Parameters
    ----------
    seen, drawn
        Large where it is clear; the tail falls exponentially.
    thinnest
        The least mean excess over a high threshold that is believed.
    """
    as_large = drawn >= seen - _TIES * max(abs(seen), 1.0)
    counted = (1.0 + float(np.sum(as_large))) / (len(drawn) + 1.0)
    if counted > 1.5 / (len(drawn) + 1.0) or len(drawn) < 50:
        return counted
    threshold = float(np.quantile(drawn, 0.9))
    beyond = drawn[drawn > threshold]
    mean = max(float(np.mean(beyond - threshold)) if len(beyond) else 0.0, thinnest)
    share = len(beyond) / len(drawn)
    tail = share * float(np.exp(-(seen - threshold) / mean))
    return float(np.clip(tail, _SMALLEST, counted))


# ------------------------------------------------------------------------------------------------
# One axis: what is seen is held against the same with whole specimens' signs drawn.
#
# Without a gap a specimen's whitened features are as likely to lie above as below, all together,
# and no specimen knows of another. The statistic is a one-sample F over specimens: what all of them
# agree on against how they differ. Signs of few specimens are soon exhausted (three give a quarter
# at best); then features are drawn from the noise itself, its size moderated by the noise's own
# degrees of freedom. Noise is never taken to be less than declared.


_FEWEST_TO_FLIP = 11.0
"""Specimens, for signs to be drawn. Numerical: 2**10 arrangements of signs, for a thousand
draws."""

_SMALLEST_WEIGHT = 1e-2
"""Weight, of the largest, below which a specimen tells nothing of an axis. Numerical: it
tells a hundredth as much."""


@dataclass(frozen=True, slots=True, eq=False)
class _Axis:
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


_Part = tuple[BoolArray, str, int]
"""Rows, what to call them, and of how many specimens they are; 0 not to tell."""


_CLAIM = 3.0
"""How much of the gap in common an axis may claim, over what varies along it. Physical: the square
of the mean of a ramp from zero, over its variance; an effect in proportion to a column is such."""


@dataclass(frozen=True, slots=True, eq=False)
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
    signs : (P, n)
        Of whole specimens, drawn.
    y, varying : (N,)
        Whitened residuals, all and without their common part.
    common : (N, c)
        Orthonormal.
    """

    campaign: Campaign
    table: FeatureTable
    residual: FloatArray
    force: FloatArray
    local: FloatArray
    patterns: Mapping[str, FloatArray]
    log: FloatArray
    weight: FloatArray
    signs: FloatArray
    rng: np.random.Generator
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

    def explained(self, axis: _Axis) -> float:
        """Return what an axis explains beyond noise, its claim on the common gap included."""
        if axis.is_common:
            return self.in_common
        own = _beyond_noise(axis.basis, self.varying)
        return own + min(_CLAIM * own, self.in_common)

    def share(self, axis: _Axis) -> float:
        """Return the share of the excess, 0 to 1."""
        explained = self.explained(axis)
        total = max(float(self.y @ self.y) - len(self.y), self.least)
        return explained / max(total, explained, 1e-12)

    def interval(self, axis: _Axis, weights: FloatArray) -> tuple[float, float]:
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
        return np.asarray(np.maximum(np.einsum("bk,bk->b", score, solved) - 2.0 * k, 0.0))

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
        told = [
            f"{_off(mean)} {name}" + (f" ({counted(n, 'specimen')})" if n else "")
            for mean, name, n in found
        ]
        return "force " + ", ".join([told[0], *(t.replace(" prediction", "", 1) for t in told[1:])])

    def basis(self, columns: FloatArray) -> FloatArray:
        """Return what a gap along columns may look like, whitened, beside the common gap."""
        return _orthonormal(self.whitening(columns), besides=self.common)

    def flipped(self, basis: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
        """Return the p-value of an axis of orthonormal columns, and that of each draw."""
        whitening = self.whitening
        weight = whitening.summed(basis**2)
        carries = weight > _SMALLEST_WEIGHT * weight.max(axis=0)
        score = np.where(carries, whitening.summed(basis * y[:, None]), 0.0)
        root = np.sqrt(np.where(carries, weight, 1.0))
        k = basis.shape[1]
        total, extra = np.sum((score / root) ** 2), 0.0
        freedom = float(carries.sum()) - k
        # As many specimens as if all that tell weighed alike.
        units = weight.sum(axis=0) ** 2 / np.sum(weight**2, axis=0)
        if float(np.median(units)) >= _FEWEST_TO_FLIP and freedom > 0.0:
            sums = np.concatenate([score.sum(axis=0)[None], self.signs @ score])
        else:
            scores = np.concatenate([score[None], self._scores_of_noise(basis, carries)])
            sums, total = scores.sum(axis=1), np.sum((scores / root) ** 2, axis=(1, 2))
            extra = whitening.degrees_of_freedom
        explained = np.sum(sums**2, axis=1)
        left = np.maximum(total - explained, freedom) + extra
        freedom += extra
        values = np.maximum(fdtrc(k, freedom, explained / k * freedom / left), 1e-300)
        return float(values[0]), values[1:]

    def _scores_of_noise(self, basis: FloatArray, carries: BoolArray) -> FloatArray:
        """Scores of noise alone, (P, n, k), whose size is as uncertain as the noise's."""
        starts, draws = self.whitening.starts, len(self.signs)
        scores = np.zeros((draws, *carries.shape))
        for i in np.flatnonzero(carries.any(axis=1)).tolist():
            piece = basis[starts[i] : starts[i + 1]]
            scores[:, i] = self.rng.standard_normal((draws, len(piece))) @ piece
        freedom = self.whitening.degrees_of_freedom
        size = np.sqrt(freedom / self.rng.chisquare(freedom, draws))
        return np.where(carries, scores, 0.0) * size[:, None, None]


def _beyond_noise(basis: FloatArray, y: FloatArray) -> float:
    """Return the sum of squares along an orthonormal basis, less one a degree of freedom."""
    return float(max(np.sum((basis.T @ y) ** 2) - basis.shape[1], 0.0))


# ------------------------------------------------------------------------------------------------
# The order of axes: by the share of the gap that each explains, counted once more as far as the
# likely causes lie along it.
#
# A weak effect that all hypotheses together tell from chance may be less clear, by itself, than
# what happens to go along with the strain. And yet what no likely cause explains must be seen.


def _added(axis: _Axis, first: _Axis, case: _Case) -> float:
    """Return what an axis explains beside the first."""
    if axis.is_common:
        return max(case.in_common - _CLAIM * _beyond_noise(first.basis, case.varying), 0.0)
    beside = axis.basis if first.is_common else _orthonormal(axis.basis, besides=first.basis)
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
    known = SPECIMEN_COLUMNS.get(name)
    phrase = known.at if known else f"where {name} is {{}}"
    phrase = "in {}" if name == "material" else phrase
    for label, members in _groups(name, cells):
        rows = ~case.table.is_field & members[case.table.specimen]
        yield rows, phrase.format(label), int(members.sum())


def _groups(name: str, cells: Sequence[float | str | None]) -> Iterator[tuple[str, BoolArray]]:
    level = column_levels(name, cells)
    known = sorted(set(level) - {None}, key=str)
    members = [np.array([of == k for of in level]) for k in known]
    if any(isinstance(cell, str) for cell in cells):
        yield from zip(map(str, known), members, strict=True)
        return
    value = np.array([np.nan if cell is None else float(cell) for cell in cells])
    if len(known) <= _MOST_LEVELS:
        for of_it in members:
            yield f"{float(np.mean(value[of_it])):.4g}", of_it
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
    hold = table.branch == BRANCHES.index("hold")
    early, late = np.quantile(table.time_s[hold], (0.25, 0.75)).tolist()
    yield hold & (table.time_s <= early), f"within {early:.2g} s of the hold", 0
    yield hold & (table.time_s >= late), f"after {late:.2g} s of it", 0


def _position_sentence(case: _Case, design: ProfileDesign, at_mm: float, rows: IntArray) -> str:
    """Return where along which bar the local strain is farthest off."""
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


def _outliers_sentence(shift: Mapping[str, float]) -> str:
    """Return which specimens differ from their replicates, and by how much."""
    told = [f"{id} {_off(value, 'its replicates')}" for id, value in shift.items()]
    more = [f"and {len(told) - _NAMED} more"] if len(told) > _NAMED else []
    return "force of " + "; ".join(told[:_NAMED] + more)


def _off(log: float, what: str = "prediction") -> str:
    percent = 100.0 * float(np.expm1(np.clip(log, -7.0, 7.0)))
    if abs(percent) < 0.5:
        return "as predicted" if what == "prediction" else f"as {what}"
    if percent > 200.0:
        return f"{1.0 + percent / 100.0:.3g} times {what}"
    number = f"{abs(percent):.2g}" if abs(percent) < 10.0 else f"{abs(percent):.0f}"
    return f"{number} % {'above' if percent > 0.0 else 'below'} {what}"


# ------------------------------------------------------------------------------------------------
# Along bars: how noisy, and where strains are farthest off.


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


def _farthest_place(case: _Case, y: FloatArray) -> tuple[ProfileDesign, float, IntArray]:
    """Return the place along which bar the local strain is farthest off, and its rows.

    Parameters
    ----------
    y : (N,)
        Whitened.
    """
    best, found = -1.0, None
    for rows, design in _rows_by_design(case.campaign, case.table).values():
        at, place = np.unique(np.round(case.table.x_mm[rows], 3), return_inverse=True)
        score = np.abs(np.bincount(place, y[rows]) / np.sqrt(np.bincount(place)))
        peak = int(np.argmax(score))
        if score[peak] > best:
            best, found = float(score[peak]), (design, float(at[peak]), rows[place == peak])
    assert found is not None
    return found


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


def localise(
    campaign: Campaign,
    table: FeatureTable,
    residual: FloatArray,
    whitening: Whitening,
    rng: np.random.Generator,
    *,
    likely: Mapping[str, float] | None = None,
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
    likely
        How probable it is of each axis that the gap's cause lies along it; 0 by default.
    permutations
        Draws without a gap.

    Returns
    -------
    places
        Nothing for a single specimen: there is nothing to compare it with.
    """
    count = len(campaign.specimens)
    if count < 2:
        return ()
    y, level = whitening(residual), table.sensitivity(table.measured_raw)
    tells = np.abs(level) > _TELLS
    force, local = np.where(table.is_field, 0.0, level), np.where(table.is_field, level, 0.0)
    patterns = axis_patterns(campaign, table, level)
    common = _orthonormal(whitening(np.column_stack([force, patterns["strain"], local])))
    varying = y - common @ (common.T @ y)
    signs: FloatArray = np.where(rng.random((permutations, count)) < 0.5, -1.0, 1.0)
    case = _Case(
        campaign, table, residual, force, local, patterns, residual / np.where(tells, level, 1.0),
        np.where(tells, level**2, 0.0), signs, rng, whitening, y, varying, common,
    )  # fmt: skip
    axes = [*_column_axes(case), *_within_axes(case), *_position_axes(case), *_outlying_axes(case)]
    p, shares = _family_wise(axes), [case.share(axis) for axis in axes]
    weights = rng.multinomial(count, np.full(count, 1.0 / count), _BOOTSTRAPS).astype(np.float64)

    def unlikely(i: int) -> tuple[float, float, float]:
        probability = 0.0 if likely is None else likely.get(axes[i].name, 0.0)
        return -(1.0 + probability) * shares[i], -probability, float(p[i])

    order = sorted(range(len(axes)), key=unlikely)
    places = []
    for i in order:
        axis, first = axes[i], axes[order[0]]
        sentence = axis.detail
        if axis is not first and p[i] <= SIGNIFICANT:
            little = _ADDS_LITTLE * case.explained(axis)
            if _added(axis, first, case) < little:
                sentence += f"; little of it beyond what goes with {first.name}"
        interval = case.interval(axis, weights)
        places.append(Location(axis.name, shares[i], interval, float(p[i]), sentence))
    return tuple(places)


def _column_axes(case: _Case) -> Iterator[_Axis]:
    """Material and the columns of specimens.csv."""
    cells = _axis_cells(case.campaign)
    for name in (name for name in cells if name in case.patterns):
        basis = case.basis(case.patterns[name])
        known = sum(cell is not None for cell in cells[name])
        if known >= _FEWEST_KNOWN and basis.shape[1]:
            sentence = case.sentence(_column_parts(case, name, cells[name]))
            yield _Axis(name, basis, *case.flipped(basis, case.varying), sentence)


def _within_axes(case: _Case) -> Iterator[_Axis]:
    """Strain, branch and time of a hold: signs of whole specimens are drawn."""
    table = case.table
    sentence = case.sentence(_strain_parts(table), alike="alike at all strains")
    p, drawn = case.flipped(case.common, case.y)
    yield _Axis("strain", case.common, p, drawn, sentence, is_common=True)
    for name, parts in (("branch", _branch_parts), ("time", _hold_parts)):
        if name in case.patterns and (basis := case.basis(case.patterns[name])).shape[1]:
            sentence = case.sentence(parts(table), ordered=name == "time")
            yield _Axis(name, basis, *case.flipped(basis, case.varying), sentence)


def _position_axes(case: _Case) -> Iterator[_Axis]:
    """Places along bars: a smooth pattern, and steps between materials.

    A factor on all local strains of a bar is no matter of position.
    """
    whitening, of_row = case.whitening, case.table.specimen
    if "position" not in case.patterns:
        return
    is_bar = of_row[:, None] == np.unique(of_row[case.table.is_field])
    bars = whitening(np.where(is_bar, case.local[:, None], 0.0))
    besides = _orthonormal(np.concatenate([case.common, bars], axis=1))
    basis = _orthonormal(whitening(case.patterns["position"]), besides=besides)
    if not basis.shape[1]:
        return
    y = case.y - besides @ (besides.T @ case.y)
    y = y / _bar_scale(case.table, y, basis)
    sentence = _position_sentence(case, *_farthest_place(case, y))
    yield _Axis("position", basis, *case.flipped(basis, y), sentence)


_TAIL_FREEDOM = 5.0
"""Of Student's t, from which specimens are drawn. Chosen: a stray one is no rarity, and yet the
variance and the kurtosis are finite."""

_NORMAL_MAD = 0.6745
"""Median absolute deviation over the standard one. Convention: of a normal distribution."""


def _outlying_axes(case: _Case) -> Iterator[_Axis]:
    """Specimens against their replicates: noise with stray specimens is drawn.

    Each specimen's level is compared with the mean of its replicates'; the scale is told by the
    median over all specimens, so that a few that are off do not hide themselves. Told are those
    that are farther off than 95 of 100 draws, the farthest first; at least that one.
    """
    whitening, rng = case.whitening, case.rng
    test = case.table.replicates[whitening.starts[:-1]]
    phi = whitening.noise.whiten(case.force)
    information = whitening.summed(phi**2)
    seen = information > 0.0
    known = np.where(seen, information, 1.0)
    height = whitening.summed(phi * whitening.noise.whiten(case.residual)) / known
    alike = (test[:, None] == test) & seen[:, None] & ~np.eye(len(test), dtype=bool)

    def differences(heights: FloatArray, kept: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return those from replicates' means, and the same in deviations, (..., n)."""
        others = np.where(alike & kept, 1.0, 0.0)
        count = others.sum(axis=1, keepdims=True)
        contrasts = np.where(count > 0.0, np.eye(len(test)) - others / np.maximum(count, 1.0), 0.0)
        found = heights @ contrasts.T
        return found, np.abs(found) / np.sqrt(np.maximum(contrasts**2 @ (1.0 / known), 1e-300))

    compared = (alike & seen).any(axis=1)
    if compared.sum() < 2:
        return
    drawn = rng.standard_normal((len(case.signs), len(test)))
    drawn /= np.sqrt(known * rng.chisquare(_TAIL_FREEDOM, drawn.shape) / _TAIL_FREEDOM)
    off = differences(np.concatenate([height[None], drawn]), seen)[1][:, compared]
    scale = np.maximum(np.median(off, axis=1) / _NORMAL_MAD, 1e-9)
    farthest = off.max(axis=1) / scale
    cut = float(np.quantile(farthest[1:], 0.95))
    shift: dict[int, float] = {}
    left = seen.copy()
    for _ in range(max(1, len(test) // 3)):
        difference, away = differences(height, left)
        # Of two that differ from each other only, the one farther from what is predicted.
        worst = int(np.argmax(np.where(left, away, 0.0) / scale[0] + 1e-6 * np.abs(height)))
        if shift and away[worst] < cut * scale[0]:
            break
        shift[worst] = float(difference[worst])
        left[worst] = False
    is_named = case.table.specimen[:, None] == list(shift)
    basis = case.basis(np.where(is_named, case.force[:, None], 0.0))
    p = _tail_p(math.log(max(farthest[0], 1e-9)), np.log(farthest[1:]), _THINNEST)
    sentence = _outliers_sentence({case.campaign.specimens[i].id: shift[i] for i in shift})
    yield _Axis("specimen", basis, p, _rank_p(farthest[1:]), sentence)
