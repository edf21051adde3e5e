"""What is seen along an axis, in one sentence with figures."""

import itertools
from collections.abc import Sequence

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.gap.campaign import Campaign
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.where.columns import Column
from planner.gap.where.position import Cluster, bars_alike, steps_of
from planner.palette import Palette

__all__ = ["Gaps", "branch_sentence", "column_sentence", "hold_sentence", "position_sentence", "specimens_sentence",
           "strain_sentence"]  # fmt: skip

_PHRASES = {
    "material": "in {}",
    "rate_mm_s": "at {} mm/s",
    "temperature_C": "at {} degC",
    "soak_h": "after {} h of soaking",
    "age_days": "at an age of {} days",
    "width_mm": "at a width of {} mm",
    "thickness_mm": "at a thickness of {} mm",
    "gauge_mm": "at a gauge of {} mm",
    "orientation": "along {}",
    "protocol": "in {} tests",
    "batch": "in batch {}",
}
_MOST_LEVELS = 6
_ALIKE = 0.01
_NAMED = 4


class Gaps:
    """Gaps as shares of force or strain, averaged as weights of what is really told by each.

    Attributes
    ----------
    log : (N,)
        Measured over predicted, as a logarithm.
    weight : (N,)
        How much a figure says: little near zero crossings.
    """

    __slots__ = ("log", "weight")

    def __init__(self, table: FeatureTable, residual: FloatArray) -> None:
        h = table.sensitivity(table.measured_raw)
        self.log = residual / np.where(np.abs(h) > 0.05, h, 1.0)
        self.weight = np.where(np.abs(h) > 0.05, h**2, 0.0)

    def mean(self, rows: BoolArray) -> float | None:
        """Return the mean gap over rows, a logarithm; None where nothing is told."""
        weight = self.weight[rows]
        if not weight.sum() > 0.0:
            return None
        return float(weight @ self.log[rows] / weight.sum())


def column_sentence(column: Column, table: FeatureTable, of_row: IntArray, gaps: Gaps) -> str:
    """Return where along a column the gap is highest and lowest.

    Parameters
    ----------
    of_row : (N,)
        Number of each row's specimen.
    """
    phrase = _PHRASES.get(column.name, f"where {column.name} is {{}}")
    force = ~table.is_field
    found = []
    for label, members in _groups(column):
        mean = gaps.mean(force & members[of_row])
        if mean is not None:
            found.append((mean, phrase.format(label), int(members.sum())))
    return _extremes(found)


def strain_sentence(table: FeatureTable, gaps: Gaps) -> str:
    """Return in which band of strain the common gap is largest and smallest."""
    force = ~table.is_field
    if not force.any():
        return "no force to tell it by"
    strain = table.strain
    edges = np.quantile(strain[force], (0.0, 0.25, 0.5, 0.75, 1.0))
    found = []
    for k, (low, high) in enumerate(itertools.pairwise(edges.tolist())):
        rows = force & (strain >= low) & ((strain < high) if k < 3 else (strain <= high))
        mean = gaps.mean(rows) if rows.any() else None
        if mean is not None:
            name = {0: f"at strains up to {high:.2g}", 3: f"at strains of {low:.2g} and more"}
            found.append((mean, name.get(k, f"at strains from {low:.2g} to {high:.2g}"), 0))
    if found and max(f[0] for f in found) - min(f[0] for f in found) < _ALIKE:
        return f"force {_off(float(np.mean([f[0] for f in found])))} alike at all strains"
    return _extremes(found)


def branch_sentence(table: FeatureTable, gaps: Gaps) -> str:
    """Return on which branches the gap is highest and lowest."""
    names = {"loading": "in the first loading", "unloading": "in unloading",
             "reloading": "in reloading", "hold": "in the hold"}  # fmt: skip
    cyclic = np.isin(table.specimen, table.specimen[table.branch != 0])
    found = []
    for k, branch in enumerate(BRANCHES):
        rows = (table.branch == k) & cyclic
        mean = gaps.mean(rows) if branch in names and rows.any() else None
        if mean is not None:
            found.append((mean, names[branch], 0))
    return _extremes(found)


def hold_sentence(table: FeatureTable, gaps: Gaps) -> str:
    """Return the gap early and late in the hold."""
    hold = table.branch == BRANCHES.index("hold")
    early, late = np.quantile(table.time_s[hold], (0.25, 0.75)).tolist()
    found = []
    for rows, name in (
        (hold & (table.time_s <= early), f"within {early:.2g} s of the hold"),
        (hold & (table.time_s >= late), f"after {late:.2g} s of it"),
    ):
        mean = gaps.mean(rows) if rows.any() else None
        if mean is not None:
            found.append((mean, name, 0))
    return _extremes(found, ordered=True)


def position_sentence(
    cluster: Cluster | None, campaign: Campaign, table: FeatureTable, gaps: Gaps
) -> str:
    """Return where along which bar the local strain is farthest off."""
    if cluster is None:
        return "no place along the bars stands out"
    rows = np.zeros(len(table), dtype=bool)
    rows[list(cluster.rows)] = True
    near = rows & (np.abs(table.x_mm - cluster.peak_mm) < 1e-3)
    mean = gaps.mean(near if near.any() else rows)
    off = "off" if mean is None else _off(mean)
    sentence = f"strain {off} near {cluster.peak_mm:.3g} mm along bar {cluster.design}"
    design = bars_alike(campaign, table)[cluster.design][1]
    reach = max(0.06 * design.length_mm, 1.0)
    for step in sorted(steps_of(design), key=lambda s: abs(s.x_mm - cluster.peak_mm))[:1]:
        if cluster.from_mm - reach <= step.x_mm <= cluster.to_mm + reach:
            ends = (_grade(campaign.palette, m) for m in (step.before, step.after))
            sentence += ", at the step from {} to {}".format(*ends)
    return sentence


def specimens_sentence(ids: Sequence[str], shift: Sequence[float]) -> str:
    """Return which specimens stand apart from their replicates, and by how much."""
    listed = [
        f"{id} {_off(value, 'its replicates')}"
        for id, value in zip(ids[:_NAMED], shift, strict=False)
    ]
    more = len(ids) - len(listed)
    return "force of " + "; ".join(listed) + (f"; and {more} more" if more else "")


def _groups(column: Column) -> list[tuple[str, BoolArray]]:
    levels = np.unique(column.level[column.known])
    if not column.is_number:
        return [
            (str(next(v for v, k in zip(column.values, column.level, strict=True) if k == level)),
             np.asarray(column.level == level))
            for level in levels
        ]  # fmt: skip
    value = np.array([np.nan if v is None else float(v) for v in column.values])
    if len(levels) <= _MOST_LEVELS:
        return [
            (f"{float(np.mean(value[column.level == k])):.4g}", np.asarray(column.level == k))
            for k in levels
        ]
    low, high = np.nanquantile(value, (1.0 / 3.0, 2.0 / 3.0)).tolist()
    thirds = (value <= low, (value > low) & (value <= high), value > high)
    return [(_range(value[t]), np.asarray(t)) for t in thirds if t.any()]


def _range(values: FloatArray) -> str:
    low, high = f"{np.min(values):.3g}", f"{np.max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def _extremes(found: Sequence[tuple[float, str, int]], *, ordered: bool = False) -> str:
    if not found:
        return "no force to tell it by"
    if ordered:
        chosen = list(found)
    else:
        # The one farthest from prediction first, then the one farthest from it.
        first = max(found, key=lambda f: abs(f[0]))
        chosen = [first]
        if len(found) > 1:
            chosen.append(max(found, key=lambda f: abs(f[0] - first[0])))
    parts = [f"{_off(mean)} {name}{_count(n)}" for mean, name, n in chosen]
    if len(parts) > 1:
        parts[1:] = [part.replace(" prediction", "", 1) for part in parts[1:]]
    return "force " + ", ".join(parts)


def _count(n: int) -> str:
    return f" ({n} specimen{'s' if n > 1 else ''})" if n else ""


def _off(log: float, what: str = "prediction") -> str:
    percent = 100.0 * float(np.expm1(np.clip(log, -7.0, 7.0)))
    if abs(percent) < 0.5:
        return "as predicted" if what == "prediction" else f"as {what}"
    if percent > 200.0:
        return f"{1.0 + percent / 100.0:.3g} times {what}"
    figure = f"{abs(percent):.2g}" if abs(percent) < 10.0 else f"{abs(percent):.0f}"
    return f"{figure} % {'above' if percent > 0.0 else 'below'} {what}"


def _grade(palette: Palette, coordinate: float) -> str:
    return min(palette.materials, key=lambda m: abs(m.coordinate - coordinate)).id
