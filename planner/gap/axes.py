"""Axes along which a gap may lie, and what one along each looks like in the features."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.gap.campaign import TOLERANCES, Campaign, axis_columns, levels
from planner.gap.observations import BRANCHES, FeatureTable
from planner.numerics import FloatArray, IntArray
from planner.simulation.bar import ProfileDesign

__all__ = [
    "axis_cells",
    "axis_patterns",
    "column_levels",
    "rows_by_design",
    "specimen_patterns",
    "steps_of",
]


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
    cells = axis_cells(campaign)
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


def column_levels(name: str, cells: Sequence[float | str | None]) -> tuple[int | str | None, ...]:
    """Return each cell's level: its text, or a number that cells within tolerance share."""
    if any(isinstance(cell, str) for cell in cells):
        return tuple(None if cell is None else str(cell) for cell in cells)
    numbers = [None if cell is None else float(cell) for cell in cells]
    return levels(numbers, *TOLERANCES.get(name, (0.0, 1e-6)))


def axis_cells(campaign: Campaign) -> Mapping[str, tuple[float | str | None, ...]]:
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
    share: FloatArray = table.strain / np.maximum(peak[table.specimen], 1e-12)
    return share


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
    centred: FloatArray = (patterns - patterns[known].mean(axis=0)) * known[:, None]
    return centred


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


def rows_by_design(
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
    for rows, design in rows_by_design(campaign, table).values():
        x = table.x_mm[rows]
        hats = np.zeros((_KNOTS, len(table)))
        knots = np.linspace(x.min(), x.max(), _KNOTS)
        hats[:, rows] = [np.interp(x, knots, hat) for hat in np.eye(_KNOTS)]
        columns += [*hats]
        at = np.unique(np.round(x, 3))
        width = max(float(np.median(np.diff(at))) if len(at) > 1 else 1.0, 0.5)
        for step in steps_of(design):
            away = (x - step.x_mm) / width
            bell = np.exp(-0.5 * away**2)
            size = step.after - step.before
            odd[rows] += size * away * bell
            even[rows] += abs(size) * bell
    return np.stack([*columns, odd, even], axis=1) * sensitivity[:, None]
