"""The place along graded bars: smooth courses, steps between materials, clusters of places."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.campaign import Campaign
from planner.gap.features.table import FeatureTable
from planner.gap.profile_design import ProfileDesign
from planner.gap.where.shapes import field_level
from planner.gap.where.whitening import Whitening, orthonormal

__all__ = [
    "Cluster",
    "Step",
    "bar_scale",
    "bars_alike",
    "cluster",
    "cluster_draws",
    "factor_of_bars",
    "position_basis",
    "steps_of",
]

KNOTS = 6
"""Of the smooth course along a bar."""

HIGH = 2.0
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
        knots = np.linspace(x.min(), x.max(), KNOTS)
        for k in range(KNOTS):
            column = np.zeros(len(table))
            column[rows] = np.interp(x, knots, np.eye(KNOTS)[k])
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
    """Heaviest run of one sign above `HIGH`, of each row."""
    heaviest = np.zeros(len(z))
    for sign in (1.0, -1.0):
        run = np.zeros(len(z))
        for column in (sign * z).T:
            run = np.where(column > HIGH, run + column - HIGH, 0.0)
            heaviest = np.maximum(heaviest, run)
    return heaviest


def _heaviest(z: FloatArray) -> tuple[int, int, float]:
    best = (0, 0, 0.0)
    for sign in (1.0, -1.0):
        start, mass = 0, 0.0
        for i, value in enumerate((sign * z).tolist()):
            if value <= HIGH:
                start, mass = i + 1, 0.0
                continue
            mass += value - HIGH
            if mass > best[2]:
                best = (start, i + 1, mass)
    return best


def _spacing_mm(x: FloatArray) -> float:
    at = np.unique(np.round(x, 3))
    return float(np.median(np.diff(at))) if len(at) > 1 else 1.0
