"""Axes along which a gap may vary, and residuals on a scale where noise has unit variance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.special

from planner.errors import ArgumentError
from planner.formats.tensile import SPECIMEN_COLUMNS
from planner.gap.campaign import TOLERANCES, Campaign, Specimen, levels
from planner.gap.observations import FeatureTable
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.simulation.bar import ProfileDesign

__all__ = [
    "CLAIM",
    "Axis",
    "Cluster",
    "Column",
    "Excess",
    "Noise",
    "Whitening",
    "bar_scale",
    "bars_alike",
    "campaign_columns",
    "cluster",
    "cluster_draws",
    "explained_by",
    "factor_of_bars",
    "field_level",
    "orthonormal",
    "position_basis",
    "share_p",
    "steps_of",
    "strain_place",
    "strain_shapes",
]


# ------------------------------------------------------------------------------------------------
# One axis along which a gap may vary, and how likely what is seen along it is without one.


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """One axis.

    Attributes
    ----------
    basis : (N, k)
        Orthonormal, in whitened figures: what a gap along the axis may look like.
    p : float
        Of what is seen, for this axis alone; small where the gap varies along it.
    drawn_p : (P,)
        The same figure of each draw without a gap.
    detail
        One sentence.
    least
        The chance that is left to a draw to show the very same, which `drawn_p` is without.
    is_common
        Whether it is the gap that all specimens have in common, a course over strain.
    """

    name: str
    basis: FloatArray
    p: float
    drawn_p: FloatArray
    detail: str
    is_common: bool = False
    least: float = 0.0


def share_p(explained: FloatArray, left: FloatArray, k: float, freedom: float) -> FloatArray:
    """Return the chance of explaining so much by accident: of Fisher's F, by the beta function.

    Parameters
    ----------
    explained, left
        Sums of squares, in any common unit.
    k, freedom
        Their degrees of freedom.
    """
    ratio = explained / np.maximum(explained + left, 1e-300)
    p = scipy.special.betainc(0.5 * freedom, 0.5 * k, np.clip(1.0 - ratio, 0.0, 1.0))
    floored: FloatArray = np.maximum(np.asarray(p, dtype=np.float64), 1e-300)
    return floored


# ------------------------------------------------------------------------------------------------
# The shapes over strain that a gap is looked for in: a level, a slope and a bend.


_SMALLEST_STRAIN = 0.01


def strain_place(table: FeatureTable) -> FloatArray:
    """Return the logarithm of strain, -1 at the table's smallest and 1 at its largest, (N,)."""
    log = np.log(np.maximum(table.strain, 0.0) + _SMALLEST_STRAIN)
    low, high = float(log.min()), float(log.max())
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-9)
    place: FloatArray = (log - middle) / half
    return place


def strain_shapes(table: FeatureTable) -> FloatArray:
    """Return level, slope and bend of the forces' logarithm over log strain, (N, 3).

    Legendre's polynomials times the sensitivity, so that a gap in per cent is one.
    """
    u = strain_place(table)
    h = np.where(table.is_field, 0.0, table.sensitivity(table.measured_raw))
    return np.stack([h, h * u, h * (1.5 * u**2 - 0.5)], axis=1)


def field_level(table: FeatureTable) -> FloatArray:
    """Return what all local strains being off by one factor looks like, (N,)."""
    return np.where(table.is_field, table.sensitivity(table.measured_raw), 0.0)


# ------------------------------------------------------------------------------------------------
# What the residual of a campaign would be like if nothing were hidden.


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Covariance of N figures: what each specimen has to itself, and what specimens share.

    Attributes
    ----------
    block_covariance
        Of each specimen's own figures, (d, d), in the table's order: scatter of level and slope,
        wandering, sensor.
    shared : (N, q)
        What specimens share, a column of prior deviation 1 each: batches, the calibration of the
        palette's laws. It is marginalised.
    log_sd
        How far the noise may be off, as a standard deviation of its logarithm.
    """

    block_covariance: Sequence[FloatArray]
    shared: FloatArray
    log_sd: float = 0.3

    @property
    def degrees_of_freedom(self) -> float:
        """Of a scaled chi-square variance that is as uncertain."""
        return 0.5 / max(self.log_sd, 1e-3) ** 2


# ------------------------------------------------------------------------------------------------
# Residuals on a scale where all noise is of unit variance and unrelated.
#
# A specimen's own noise is taken out by the Cholesky factor of its covariance, what specimens share
# by the inverse root of ``I + V V'`` with V the whitened shared columns, which is of low rank. So
# what laws or batches may well be off by counts no more than its prior allows.


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """The way from N figures to N numbers of unit noise.

    Attributes
    ----------
    specimen : (n,)
        Places in the campaign of the specimens that have figures.
    starts : (n + 1,)
        Rows of specimen i are ``starts[i]`` to ``starts[i + 1]``.
    inverse_roots
        Of each specimen's covariance.
    directions, shrink : (N, q), (q,)
        What specimens share, orthonormal, and how much of it is taken off.
    """

    specimen: IntArray
    starts: IntArray
    inverse_roots: tuple[FloatArray, ...]
    directions: FloatArray
    shrink: FloatArray

    @classmethod
    def of(cls, table: FeatureTable, noise: Noise) -> "Whitening":
        """Return the whitening of a table's figures.

        Raises
        ------
        ArgumentError
            Blocks or shared columns do not fit the table, or a block is no covariance.
        """
        specimen, first = np.unique(table.specimen, return_index=True)
        starts = np.append(first, len(table))
        sizes = np.diff(starts).tolist()
        if [len(block) for block in noise.block_covariance] != sizes:
            got = [len(block) for block in noise.block_covariance]
            raise ArgumentError(f"noise: blocks of {got} figures; the specimens have {sizes}")
        if noise.shared.shape[0] != len(table):
            raise ArgumentError(
                f"noise: shared has {noise.shared.shape[0]} rows; the table has {len(table)}"
            )
        try:
            roots = tuple(
                np.linalg.inv(np.linalg.cholesky(block)) for block in noise.block_covariance
            )
        except np.linalg.LinAlgError:
            raise ArgumentError(
                "noise: a specimen's covariance is not positive definite; add the sensor's noise "
                "to its diagonal"
            ) from None
        own = cls(specimen, starts, roots, np.zeros((len(table), 0)), np.zeros(0))
        shared = own.of_specimens(noise.shared)
        if shared.shape[1]:
            directions, singular, _ = np.linalg.svd(shared, full_matrices=False)
            own = cls(specimen, starts, roots, directions, 1.0 - 1.0 / np.sqrt(1.0 + singular**2))
        return own

    def of_specimens(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), with each specimen's own noise whitened."""
        pieces = [
            root @ columns[a:b]
            for root, a, b in zip(
                self.inverse_roots, self.starts[:-1], self.starts[1:], strict=True
            )
        ]
        return np.concatenate(pieces)

    def of_all(self, whitened: FloatArray) -> FloatArray:
        """Return what `of_specimens` gave with that whitened which specimens share."""
        along = (self.directions.T @ whitened).T * self.shrink
        return np.asarray(whitened - self.directions @ along.T, dtype=np.float64)

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), whitened."""
        return self.of_all(self.of_specimens(columns))

    def summed(self, values: FloatArray) -> FloatArray:
        """Return sums over each specimen's rows, (n, ...)."""
        sums: FloatArray = np.add.reduceat(values, self.starts[:-1], axis=0)
        return sums


def orthonormal(columns: FloatArray, besides: FloatArray | None = None) -> FloatArray:
    """Return an orthonormal basis of columns, (N, k), and of what is in them beside another."""
    if not columns.shape[1]:
        return columns
    scale = np.linalg.norm(columns, axis=0)
    left: FloatArray = columns[:, scale > 0.0] / scale[scale > 0.0]
    if besides is not None and left.shape[1]:
        for _ in range(2):  # once more for rounding
            left = left - besides @ (besides.T @ left)
    if not left.shape[1]:
        return left
    basis, singular, _ = np.linalg.svd(left, full_matrices=False)
    # Columns were of unit length: what is left of less than a hundredth is the other's.
    kept: FloatArray = np.ascontiguousarray(basis[:, singular > 1e-2])
    return kept


# ------------------------------------------------------------------------------------------------
# How much of the excess an axis explains, and how sure that is.


CLAIM = 3.0
"""The square of the mean of a ramp from zero, over its variance."""


@dataclass(frozen=True, slots=True, eq=False)
class Excess:
    """What there is to explain.

    An axis may claim some of the gap that all specimens have in common: with half of them at
    33 degC, soft, and half as predicted, half of the gap is common and yet lies along temperature.
    It may claim three times what the gap varies by along it, which is what a gap has in common
    that rises evenly from none. A gap that is the same everywhere is so claimed by no axis.

    Attributes
    ----------
    y, apart : (N,)
        Whitened residuals, all and without their common part.
    common : (N, c)
        Orthonormal.
    """

    whitening: Whitening
    y: FloatArray
    apart: FloatArray
    common: FloatArray

    @property
    def noise(self) -> float:
        """The least excess that shares are taken of: two deviations of pure noise."""
        return float(2.0 * np.sqrt(2.0 * len(self.y)))

    @property
    def total(self) -> float:
        """Sum of squares beyond noise."""
        return float(max(float(self.y @ self.y) - len(self.y), self.noise))

    @property
    def in_common(self) -> float:
        """Of it, what all specimens have in common."""
        return max(explained_by(self.common, self.y) - float(self.common.shape[1]), 0.0)

    def explained(self, axis: Axis) -> float:
        """Return what an axis explains beyond noise, its claim on the common gap included."""
        if axis.is_common:
            return self.in_common
        own = max(explained_by(axis.basis, self.apart) - float(axis.basis.shape[1]), 0.0)
        return own + min(CLAIM * own, self.in_common)

    def share(self, axis: Axis) -> float:
        """Return the share of the excess, 0 to 1."""
        explained = self.explained(axis)
        return explained / max(self.total, explained, 1e-12)

    def interval(self, axis: Axis, weights: FloatArray) -> tuple[float, float]:
        """Return the 90 % interval of the share over draws of specimens.

        Parameters
        ----------
        weights : (B, n)
            How often each specimen was drawn.
        """
        squares = self.whitening.summed(self.y**2) - np.diff(self.whitening.starts)
        total = np.maximum(weights @ squares, self.noise)
        common = self._drawn(self.common, self.y, weights)
        own = common
        if not axis.is_common:
            own = self._drawn(axis.basis, self.apart, weights)
            own = own + np.minimum(CLAIM * own, common)
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
        gram = (weights @ pairs).reshape(-1, k, k) + 1e-3 * np.eye(k)
        solved = np.linalg.solve(gram, score[:, :, None])[:, :, 0]
        # A draw has the noise of what was measured and its own.
        found: FloatArray = np.maximum(np.einsum("bk,bk->b", score, solved) - 2.0 * k, 0.0)
        return found


def explained_by(basis: FloatArray, y: FloatArray) -> float:
    """Return the sum of squares along an orthonormal basis."""
    return float(np.sum((basis.T @ y) ** 2))


# ------------------------------------------------------------------------------------------------
# Columns of specimens.csv as axes: their levels, and a few coordinates along each.


_Value = str | float | None

_DEGREE = 2
_MOST_LEVELS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column that takes more than one value.

    Attributes
    ----------
    values
        Of each specimen with figures; None where unknown.
    level : (n,)
        Number of each specimen's level, -1 where unknown.
    coordinates : (n, m)
        Orthonormal and of mean zero over the specimens that are known, zero at the others:
        numbers as polynomials on the column's usual scale, text as levels.
    """

    name: str
    values: tuple[_Value, ...]
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


def campaign_columns(campaign: Campaign, specimen: IntArray) -> tuple[Column, ...]:
    """Return the columns that vary over the specimens at these places; material first.

    A column whose text is another for nearly every specimen tells them apart, but not why, and is
    left out.
    """
    chosen = [campaign.specimens[i] for i in specimen.tolist()]
    found = [_column("material", [_material(s) for s in chosen])]
    found += [_column(name, [_size(s, name) for s in chosen]) for name in TOLERANCES]
    texts = [name for name, c in SPECIMEN_COLUMNS.items() if c.choices is not None]
    found += [_column(name, [getattr(s, name) for s in chosen]) for name in texts]
    names = dict.fromkeys((*campaign.covariates, *(k for s in chosen for k in s.covariates)))
    found += [_column(name, [s.covariates.get(name) for s in chosen]) for name in names]
    return tuple(column for column in found if column is not None)


def _material(specimen: Specimen) -> str:
    if specimen.profile is not None:
        return f"bar {specimen.profile.name}"
    return specimen.material or ""


def _size(specimen: Specimen, name: str) -> float | None:
    value: float | None = getattr(specimen, name)
    if value is None:
        value = getattr(specimen, f"measured_{name}", None)
    return value


def _column(name: str, values: Sequence[_Value]) -> Column | None:
    clean = tuple(_clean(v) for v in values)
    if any(isinstance(v, str) for v in clean):
        clean = tuple(None if v is None else str(v) for v in clean)
        return _of_text(name, clean)
    return _of_numbers(name, clean)


def _clean(value: _Value) -> _Value:
    if isinstance(value, str):
        return value.strip() or None
    return None if value is None or not np.isfinite(value) else float(value)


def _of_text(name: str, values: tuple[_Value, ...]) -> Column | None:
    texts = sorted({v for v in values if isinstance(v, str)})
    level = np.array([-1 if v is None else texts.index(str(v)) for v in values])
    known = level >= 0
    if len(texts) < 2 or (len(texts) > 3 and 2 * len(texts) > known.sum()):
        return None
    counts = np.bincount(level[known])
    common = np.argsort(-counts, kind="stable")[:_MOST_LEVELS]
    indicators = (level[:, None] == common).astype(np.float64)
    return _made(name, values, level, indicators)


def _of_numbers(name: str, values: tuple[_Value, ...]) -> Column | None:
    numbers = [v if isinstance(v, float) else None for v in values]
    absolute, relative = TOLERANCES.get(name, (0.0, 1e-6))
    of = levels(numbers, absolute, relative)
    level = np.array([-1 if k is None else k for k in of])
    known = level >= 0
    count = int(level.max(initial=-1)) + 1
    if count < 2:
        return None
    figures = np.array([v for v in numbers if v is not None])
    centre = np.array([figures[level[known] == k].mean() for k in range(count)])
    x = np.zeros(len(values))
    x[known] = _scaled(name, centre)[level[known]]
    x[known] -= 0.5 * (x[known].min() + x[known].max())
    x /= max(float(np.abs(x).max()), 1e-12)
    powers = np.stack([x**k for k in range(1, min(_DEGREE, count - 1) + 1)], axis=1)
    return _made(name, values, level, powers * known[:, None])


def _scaled(name: str, values: FloatArray) -> FloatArray:
    if name in SPECIMEN_COLUMNS:
        return SPECIMEN_COLUMNS[name].scale(values)
    wide = values.min() > 0.0 and values.max() > 20.0 * values.min()
    return np.log(values) if wide else values


def _made(name: str, values: tuple[_Value, ...], level: IntArray, raw: FloatArray) -> Column | None:
    known = level >= 0
    centred = np.where(known[:, None], raw - raw[known].mean(axis=0), 0.0)
    basis, singular, _ = np.linalg.svd(centred, full_matrices=False)
    kept = singular > 1e-6 * max(float(singular[0]), 1e-12)
    if not kept.any():
        return None
    coordinates = np.where(known[:, None], basis[:, kept], 0.0)
    return Column(name, values, level, coordinates)


# ------------------------------------------------------------------------------------------------
# The place along graded bars: smooth courses, steps between materials, clusters of places.


_KNOTS = 6
"""Of the smooth course along a bar."""

_HIGH = 2.0
"""Standard deviations above which neighbouring places join a cluster."""

_STEEP_PER_MM = 0.15


@dataclass(frozen=True, slots=True)
class Step:
    """Where a design goes from one coordinate to another, within a millimetre or at once."""

    x_mm: float
    before: float
    after: float


def steps_of(design: ProfileDesign) -> tuple[Step, ...]:
    """Return a design's steps."""
    x, m = design.x_mm, design.coordinate
    rise, run = np.diff(m), np.diff(x)
    steep = (np.abs(rise) > _STEEP_PER_MM * run) & (np.abs(rise) > 1e-3) & (run < 1.0)
    return tuple(
        Step(float(0.5 * (x[i] + x[i + 1])), float(m[i]), float(m[i + 1]))
        for i in np.flatnonzero(steep)
    )


def bars_alike(
    campaign: Campaign, table: FeatureTable
) -> dict[str, tuple[IntArray, ProfileDesign]]:
    """Return by design the rows of local strains, bars of one design together."""
    rows: dict[str, tuple[list[int], ProfileDesign]] = {}
    for row in np.flatnonzero(table.is_field).tolist():
        design = campaign.specimens[int(table.specimen[row])].profile
        if design is not None:
            rows.setdefault(design.name, ([], design))[0].append(row)
    return {name: (np.array(found), design) for name, (found, design) in rows.items()}


def position_basis(
    campaign: Campaign, table: FeatureTable, whitening: Whitening, besides: FloatArray
) -> FloatArray:
    """Return what a gap that varies along the bars may look like, whitened, (N, k).

    Hats along each design, and at steps an odd and an even kernel that all steps share, as wide
    as the camera's spacing.

    Parameters
    ----------
    besides
        See `factor_of_bars`: a factor on all local strains of a bar is no matter of position.
    """
    level = field_level(table)
    columns: list[FloatArray] = []
    odd, even = np.zeros(len(table)), np.zeros(len(table))
    for rows, design in bars_alike(campaign, table).values():
        x = table.x_mm[rows]
        knots = np.linspace(x.min(), x.max(), _KNOTS)
        for k in range(_KNOTS):
            column = np.zeros(len(table))
            column[rows] = np.interp(x, knots, np.eye(_KNOTS)[k])
            columns.append(column)
        width = max(_spacing_mm(x), 0.5)
        for step in steps_of(design):
            away = (x - step.x_mm) / width
            bell = np.exp(-0.5 * away**2)
            size = step.after - step.before
            odd[rows] += size * away * bell
            even[rows] += abs(size) * bell
    columns += [odd, even]
    return orthonormal(whitening(np.stack(columns, axis=1) * level[:, None]), besides=besides)


def factor_of_bars(table: FeatureTable, whitening: Whitening, common: FloatArray) -> FloatArray:
    """Return the common gap and a factor on all local strains of each bar, orthonormal."""
    level = field_level(table)
    of_row = np.repeat(np.arange(len(whitening.specimen)), np.diff(whitening.starts))
    bars = np.zeros((len(table), len(whitening.specimen)))
    bars[np.arange(len(table)), of_row] = level
    bars = bars[:, np.abs(bars).max(axis=0) > 0.0]
    return orthonormal(np.concatenate([common, whitening(bars)], axis=1))


def bar_scale(table: FeatureTable, y: FloatArray, basis: FloatArray) -> float:
    """Return how much larger the noise of local strains is than declared, at least 1.

    Bars are too few for how they lie together to tell; place by place, replicates tell. Without
    replicates it is what no course along the bars explains.
    """
    bars: dict[tuple[int, bytes], list[FloatArray]] = {}
    for number in np.unique(table.specimen[table.is_field]).tolist():
        rows = np.flatnonzero(table.is_field & (table.specimen == number))
        key = int(table.test[rows[0]]), np.round(table.x_mm[rows], 3).tobytes()
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


@dataclass(frozen=True, slots=True)
class Cluster:
    """Neighbouring places of one design that are off to one side."""

    design: str
    from_mm: float
    to_mm: float
    peak_mm: float
    mass: float
    rows: tuple[int, ...]


def cluster(campaign: Campaign, table: FeatureTable, y: FloatArray) -> Cluster | None:
    """Return the heaviest cluster of places, by how far its places are off together.

    Parameters
    ----------
    y : (N,)
        Whitened.
    """
    best: Cluster | None = None
    for name, (rows, _) in bars_alike(campaign, table).items():
        at, place = _places(table.x_mm[rows])
        z = _mean_score(y[rows][None], place, len(at))[0]
        start, stop, mass = _heaviest(z)
        if mass > (0.0 if best is None else best.mass):
            peak = start + int(np.argmax(np.abs(z[start:stop])))
            inside = rows[(place >= start) & (place < stop)]
            best = Cluster(name, float(at[start]), float(at[stop - 1]), float(at[peak]), mass,
                           tuple(inside.tolist()))  # fmt: skip
    return best


def cluster_draws(campaign: Campaign, table: FeatureTable, drawn: FloatArray) -> FloatArray:
    """Return the mass of the heaviest cluster of draws, (P,), of whitened figures (P, N)."""
    heaviest = np.zeros(len(drawn))
    for rows, _ in bars_alike(campaign, table).values():
        at, place = _places(table.x_mm[rows])
        heaviest = np.maximum(heaviest, _masses(_mean_score(drawn[:, rows], place, len(at))))
    return heaviest


def _places(x_mm: FloatArray) -> tuple[FloatArray, IntArray]:
    at, place = np.unique(np.round(x_mm, 3), return_inverse=True)
    return at, place.reshape(-1)


def _mean_score(values: FloatArray, place: IntArray, count: int) -> FloatArray:
    sums = values @ np.eye(count)[place]
    scores: FloatArray = sums / np.sqrt(np.bincount(place, minlength=count))
    return scores


def _masses(z: FloatArray) -> FloatArray:
    """Heaviest run of one sign above `_HIGH`, of each row."""
    heaviest = np.zeros(len(z))
    for sign in (1.0, -1.0):
        run = np.zeros(len(z))
        for column in (sign * z).T:
            run = np.where(column > _HIGH, run + column - _HIGH, 0.0)
            heaviest = np.maximum(heaviest, run)
    return heaviest


def _heaviest(z: FloatArray) -> tuple[int, int, float]:
    best = (0, 0, 0.0)
    for sign in (1.0, -1.0):
        start, mass = 0, 0.0
        for i, value in enumerate((sign * z).tolist()):
            if value <= _HIGH:
                start, mass = i + 1, 0.0
                continue
            mass += value - _HIGH
            if mass > best[2]:
                best = (start, i + 1, mass)
    return best


def _spacing_mm(x: FloatArray) -> float:
    at = np.unique(np.round(x, 3))
    return float(np.median(np.diff(at))) if len(at) > 1 else 1.0
