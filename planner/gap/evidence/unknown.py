"""What no effect explains: broad patterns over every axis along which a gap may lie.

One axis at a time, each with its amplitude integrated over, beside the uncertain base laws: a
pattern that those already cover gains nothing.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.gap.campaign import Campaign
from planner.gap.effects.effect import Effect
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.specimen import Specimen

__all__ = ["AMPLITUDES", "UnknownAxis", "claimed_axes", "own_axes", "unknown_axes"]

AMPLITUDES = (0.03, 0.1, 0.3, 0.9)
"""Standard deviations of an unknown pattern, of the logarithm of force."""

NUMERIC = ("rate_mm_s", "temperature_C", "soak_h", "age_days", "width_mm", "thickness_mm",
           "gauge_mm")  # fmt: skip
ANY = "any"
"""All axes at once that effects claim: what is left when the right effect is not in the library."""

CURVED = 0.4
"""Size of a course that bends or steps along a column, relative to a straight one's."""

CHANGING = 0.4
"""Size of what changes along a path, relative to what multiplies the whole of it."""

_FIELD = BRANCHES.index("field")
_LOADING = BRANCHES.index("loading")


@dataclass(frozen=True, slots=True, eq=False)
class UnknownAxis:
    """Patterns along one axis, (N, k): together of mean square 1 over the figures."""

    axis: str
    columns: FloatArray
    claimed: bool


def unknown_axes(
    campaign: Campaign,
    table: FeatureTable,
    sensitivity: FloatArray,
    claimed: Collection[str],
    own: Collection[str],
) -> tuple[UnknownAxis, ...]:
    """Return the axes that vary in a campaign, with their patterns.

    Parameters
    ----------
    claimed
        Axes along which some effect of the library varies.
    own
        Those that are an effect's own covariate, free courses along which count for it.
    """
    specimens = campaign.specimens
    force = table.branch != _FIELD
    h = np.where(force, sensitivity, 0.0)
    peak = np.zeros(len(specimens))
    np.maximum.at(peak, table.specimen, table.strain)
    travel = table.strain / np.maximum(peak[table.specimen], 1e-12) - 0.5
    found = []
    for name in (*NUMERIC, "orientation", "batch", *campaign.covariates):
        patterns = _specimen_patterns([_cell(s, name) for s in specimens])
        if patterns is None:
            continue
        rows = patterns[table.specimen]
        changing = CHANGING * 2.0 * h * travel
        columns = np.concatenate([rows * h[:, None], rows * changing[:, None]], axis=1)
        found.append(_axis(name, columns, claimed))
    strain = np.minimum(table.strain, 1.0)
    bumps = [np.exp(-strain / 0.03), np.exp(-strain / 0.12), strain / 0.3]
    found.append(_axis("strain", np.stack([h * b for b in bumps], axis=1), claimed))
    branches = [
        h * (table.branch == k) * shape
        for k in range(len(BRANCHES))
        if k not in (_LOADING, _FIELD) and (table.branch == k).any()
        for shape in (np.ones(len(table)), travel)
    ]
    if branches:
        found.append(_axis("branch", np.stack(branches, axis=1), claimed))
    names = [s.material for s in specimens]
    courses = []
    for material in dict.fromkeys(n for n in names if n is not None):
        of_it = np.array([n == material for n in names])[table.specimen]
        courses += [h * of_it, h * of_it * travel]
    if len(courses) > 2:
        found.append(_axis("material", np.stack(courses, axis=1), claimed))
    places = _position_patterns(campaign, table, sensitivity)
    if places is not None:
        found.append(_axis("position", places, claimed))
    found = [axis for axis in found if axis.columns.shape[1]]
    known = [axis.columns for axis in found if axis.claimed and axis.axis not in own]
    if len(known) > 1:
        found.append(UnknownAxis(ANY, np.concatenate(known, axis=1), True))
    return tuple(found)


def own_axes(effects: Sequence[Effect]) -> dict[str, str]:
    """Return, of each axis that is an effect's own covariate, that effect's id."""
    return {name: e.id for e in effects for entry in e.covariates for name in entry.split("|")}


def claimed_axes(effects: Sequence[Effect]) -> frozenset[str]:
    """Return the axes along which effects vary."""
    return frozenset(own_axes(effects)).union(*[e.where for e in effects])


def _axis(name: str, columns: FloatArray, claimed: Collection[str]) -> UnknownAxis:
    columns = columns[:, np.any(columns != 0.0, axis=0)]
    touched = np.any(columns != 0.0, axis=1)
    scale = np.sqrt(np.sum(columns**2) / max(int(touched.sum()), 1))
    return UnknownAxis(name, columns / max(float(scale), 1e-12), name in claimed)


def _cell(specimen: Specimen, name: str) -> str | float | None:
    if name in specimen.covariates:
        return specimen.covariates[name]
    value = getattr(specimen, name, None)
    return value if value is None or isinstance(value, str) else float(value)


def _specimen_patterns(cells: Sequence[str | float | None]) -> FloatArray | None:
    """Return patterns over specimens, (n, k), mean 0; None where the column does not vary."""
    known = np.array([c is not None for c in cells])
    values = [c for c in cells if c is not None]
    distinct = sorted(set(values), key=str)
    if len(distinct) < 2:
        return None
    numeric = all(isinstance(v, float) for v in values)
    if numeric and len(distinct) > 3:
        at = np.array([0.0 if c is None else float(c) for c in cells])
        low, high = min(at[known]), max(at[known])
        t = 2.0 * (at - low) / (high - low) - 1.0
        bend, leap = 1.5 * t * t - 0.5, np.sign(t) * (np.abs(t) > 0.05)
        patterns = np.stack([t, CURVED * bend, CURVED * leap], axis=1)
    else:
        if len(distinct) > max(2, len(values) // 2):
            return None
        patterns = np.array([[float(c == v) for v in distinct] for c in cells])
    patterns = patterns * known[:, None]
    centred: FloatArray = (patterns - patterns[known].mean(axis=0)) * known[:, None]
    return centred


def _position_patterns(
    campaign: Campaign, table: FeatureTable, sensitivity: FloatArray
) -> FloatArray | None:
    """Return smooth courses along each design's bars, of local strains."""
    field = table.branch == _FIELD
    if not field.any():
        return None
    columns = []
    for test in np.unique(table.test[field]).tolist():
        of_test = field & (table.test == test)
        gauge = campaign.specimens[int(table.specimen[of_test][0])].gauge_mm
        u = np.where(of_test, table.x_mm, 0.0) / gauge
        columns += [sensitivity * of_test * np.cos(np.pi * k * u) for k in range(1, 5)]
    return np.stack(columns, axis=1)
