"""Where the gap of a campaign lies: every axis, with its share, p-value and a sentence."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import ArgumentError
from planner.formats.tensile import SPECIMEN_COLUMNS
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Location
from planner.gap.localise_axes import (
    CLAIM,
    Axis,
    Cluster,
    Column,
    Excess,
    Noise,
    Whitening,
    bar_scale,
    bars_alike,
    campaign_columns,
    cluster,
    cluster_draws,
    explained_by,
    factor_of_bars,
    field_level,
    orthonormal,
    position_basis,
    steps_of,
    strain_place,
    strain_shapes,
)
from planner.gap.localise_tests import (
    FEWEST_TO_FLIP,
    SpecimenScores,
    family_wise,
    least_permutation_p,
    outlying_replicates,
    permuted,
    rank_p,
    tail_p,
    varies_within,
    within_p,
)
from planner.gap.observations import BRANCHES, FeatureTable
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import Palette

__all__ = ["localise"]


# ------------------------------------------------------------------------------------------------
# What is seen along an axis, in one sentence with figures.


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


def _column_sentence(column: Column, table: FeatureTable, of_row: IntArray, gaps: Gaps) -> str:
    """Return where along a column the gap is highest and lowest.

    Parameters
    ----------
    of_row : (N,)
        Number of each row's specimen.
    """
    known = SPECIMEN_COLUMNS.get(column.name)
    phrase = known.at if known else f"where {column.name} is {{}}"
    phrase = "in {}" if column.name == "material" else phrase
    force = ~table.is_field
    found = []
    for label, members in _groups(column):
        mean = gaps.mean(force & members[of_row])
        if mean is not None:
            found.append((mean, phrase.format(label), int(members.sum())))
    return _extremes(found)


def _strain_sentence(table: FeatureTable, gaps: Gaps) -> str:
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


def _branch_sentence(table: FeatureTable, gaps: Gaps) -> str:
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


def _hold_sentence(table: FeatureTable, gaps: Gaps) -> str:
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


def _position_sentence(
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


def _specimens_sentence(ids: Sequence[str], shift: Sequence[float]) -> str:
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


# ------------------------------------------------------------------------------------------------
# What a gap that goes with the branch of the path, or with the time of a hold, looks like.


_HOLD = BRANCHES.index("hold")


def _later_branches(table: FeatureTable) -> tuple[int, ...]:
    """Return the branches of forces, other than the first loading, that were measured."""
    return tuple(
        k for k, name in enumerate(BRANCHES)
        if name not in ("loading", "field") and np.any(table.branch == k)
    )  # fmt: skip


def _branch_basis(table: FeatureTable, whitening: Whitening, common: FloatArray) -> FloatArray:
    """Return a level of every later branch, and a slope over strain where strain varies, (N, k)."""
    level = strain_shapes(table)[:, 0]
    u = strain_place(table)
    columns = []
    for branch in _later_branches(table):
        of_branch = np.where(table.branch == branch, level, 0.0)
        columns.append(of_branch)
        if branch != _HOLD:
            columns.append(of_branch * u)
    return _made(columns, table, whitening, common)


def _hold_time_basis(table: FeatureTable, whitening: Whitening, common: FloatArray) -> FloatArray:
    """Return a level, a slope and a bend over the logarithm of the time of a hold, (N, k)."""
    hold = table.branch == _HOLD
    if not hold.any():
        return np.zeros((len(table), 0))
    level = np.where(hold, strain_shapes(table)[:, 0], 0.0)
    w = _hold_place(table)
    return _made([level, level * w, level * w**2], table, whitening, common)


def _hold_place(table: FeatureTable) -> FloatArray:
    """Return the logarithm of the time of a hold, 0 at the shortest and 1 at the longest, (N,)."""
    hold = table.branch == _HOLD
    log = np.log(np.maximum(table.time_s, 1e-3))
    low, high = float(log[hold].min()), float(log[hold].max())
    place: FloatArray = np.where(hold, (log - low) / max(high - low, 1e-9), 0.0)
    return place


def _made(
    columns: list[FloatArray], table: FeatureTable, whitening: Whitening, common: FloatArray
) -> FloatArray:
    if not columns:
        return np.zeros((len(table), 0))
    return orthonormal(whitening(np.stack(columns, axis=1)), besides=common)


# ------------------------------------------------------------------------------------------------
# The order of axes: what explains most first, then what adds to it.
#
# Only axes along which the gap varies at the 5 % level compete; the others follow by their p-value.
# The first explains most, each degree of freedom costing the logarithm of the number of specimens
# (Schwarz). The others follow by what they add to the first, and by a part of what they explain
# alone: an axis that merely goes along with the first falls behind one that does not, and before
# one that explains nothing.


_SIGNIFICANT = 0.05
_ALONE = 0.3


def _ranked(
    axes: Sequence[Axis], p: FloatArray, excess: Excess
) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return the order of axes, and what each adds to the first as a share of its own."""
    cost = math.log(max(len(excess.whitening.specimen), 2))
    alone = np.array([excess.explained(a) - (cost - 1.0) * a.basis.shape[1] for a in axes])
    alone = np.maximum(alone, 0.0)
    found = [i for i in range(len(axes)) if p[i] <= _SIGNIFICANT]
    if not found:
        order = sorted(range(len(axes)), key=lambda i: (p[i], -alone[i]))
        return tuple(order), (1.0,) * len(axes)
    first = max(found, key=lambda i: (alone[i], -p[i]))
    adds = np.array([_added(axis, axes[first], excess, cost) for axis in axes])
    adds[first] = alone[first]
    merit = adds + _ALONE * alone
    rest = sorted((i for i in found if i != first), key=lambda i: -merit[i])
    others = sorted((i for i in range(len(axes)) if i not in found), key=lambda i: p[i])
    parts = tuple(
        float(added / max(own, 1e-12)) if own > 0.0 else 1.0
        for added, own in zip(adds, alone, strict=True)
    )
    return (first, *rest, *others), parts


def _added(axis: Axis, first: Axis, excess: Excess, cost: float) -> float:
    if axis is first:
        return 0.0
    if axis.is_common:
        own = max(explained_by(first.basis, excess.apart) - float(first.basis.shape[1]), 0.0)
        return max(excess.in_common - CLAIM * own, 0.0)
    beside = axis.basis if first.is_common else orthonormal(axis.basis, besides=first.basis)
    return max(explained_by(beside, excess.apart) - cost * float(beside.shape[1]), 0.0)


# ------------------------------------------------------------------------------------------------
# Where the gap of a campaign lies: every axis, with its share, p-value and a sentence.


_BOOTSTRAPS = 200
_FEWEST_KNOWN = 4
_ADDS_LITTLE = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class _Case:
    """What every axis is made from."""

    campaign: Campaign
    table: FeatureTable
    residual: FloatArray
    noise: Noise
    whitening: Whitening
    gaps: Gaps
    of_row: IntArray
    signs: FloatArray
    excess: Excess
    rng: np.random.Generator


def localise(
    campaign: Campaign,
    table: FeatureTable,
    residual: FloatArray,
    noise: Noise,
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
    permutations
        Draws without a gap.

    Returns
    -------
    places
        Nothing for a single specimen: there is nothing to compare it with.

    Raises
    ------
    ArgumentError
        Residual or noise do not fit the table.
    """
    if residual.shape != (len(table),) or not np.all(np.isfinite(residual)):
        raise ArgumentError(
            f"residual: shape {residual.shape} with {int(np.sum(~np.isfinite(residual)))} values "
            f"that are no finite number; it must be one finite number for each of {len(table)} "
            "figures"
        )
    if len(table) == 0 or len(np.unique(table.specimen)) < 2:
        return ()
    case = _case(campaign, table, residual, noise, rng, permutations)
    axes = [*_column_axes(case), *_within_axes(case), *_position_axes(case), *_outlying_axes(case)]
    if not axes:
        return ()
    p = family_wise(
        np.array([a.p for a in axes]),
        np.stack([a.drawn_p for a in axes]),
        np.array([a.least for a in axes]),
    )
    order, adds = _ranked(axes, p, case.excess)
    weights = rng.multinomial(
        len(case.whitening.specimen),
        np.full(len(case.whitening.specimen), 1.0 / len(case.whitening.specimen)),
        _BOOTSTRAPS,
    ).astype(np.float64)
    first = axes[order[0]].name
    places = []
    for i in order:
        sentence = axes[i].detail
        if i != order[0] and p[i] <= _SIGNIFICANT and adds[i] < _ADDS_LITTLE:
            sentence += f"; little of it beyond what goes with {first}"
        share, interval = case.excess.share(axes[i]), case.excess.interval(axes[i], weights)
        places.append(Location(axes[i].name, share, interval, float(p[i]), sentence))
    return tuple(places)


def _case(
    campaign: Campaign,
    table: FeatureTable,
    residual: FloatArray,
    noise: Noise,
    rng: np.random.Generator,
    permutations: int,
) -> _Case:
    whitening = Whitening.of(table, noise)
    y = whitening(residual)
    shapes = strain_shapes(table)
    common = orthonormal(whitening(np.concatenate([shapes, field_level(table)[:, None]], axis=1)))
    apart = y - common @ (common.T @ y)
    count = len(whitening.specimen)
    signs: FloatArray = np.where(rng.random((permutations, count)) < 0.5, -1.0, 1.0)
    return _Case(
        campaign, table, residual, noise, whitening, Gaps(table, residual),
        np.repeat(np.arange(count), np.diff(whitening.starts)), signs,
        Excess(whitening, y, apart, common), rng,
    )  # fmt: skip


def _column_axes(case: _Case) -> list[Axis]:
    """Material and the columns of specimens.csv: whole specimens' cells are dealt anew."""
    whitening, common = case.whitening, case.excess.common
    shapes = strain_shapes(case.table)
    scores = SpecimenScores.of(whitening, shapes, common, case.excess.apart)
    chosen = [case.campaign.specimens[i].batch for i in whitening.specimen.tolist()]
    names = list(dict.fromkeys(chosen))
    batch = np.array([names.index(b) for b in chosen])
    keys = case.rng.random(case.signs.shape)
    totals: dict[bytes, tuple[float, int]] = {}
    axes = []
    for column in campaign_columns(case.campaign, whitening.specimen):
        if column.known.sum() < _FEWEST_KNOWN:
            continue
        within = batch if len(names) > 1 and varies_within(column, batch) else None
        basis = scores.basis(whitening, shapes, common, column)
        if not basis.shape[1]:
            continue
        known = column.known.tobytes()
        if known not in totals:
            totals[known] = scores.total(np.flatnonzero(column.known))
        p, drawn = scores.p(column, permuted(keys, column, within), *totals[known])
        sentence = _column_sentence(column, case.table, case.of_row, case.gaps)
        least = least_permutation_p(column, within)
        axes.append(Axis(column.name, basis, p, drawn, sentence, least=least))
    return axes


def _within_axes(case: _Case) -> list[Axis]:
    """Strain, branch and time of a hold: signs of whole specimens are drawn."""
    table, whitening, excess = case.table, case.whitening, case.excess
    p, drawn = _flipped(case, excess.common, excess.y)
    sentence = _strain_sentence(table, case.gaps)
    axes = [Axis("strain", excess.common, p, drawn, sentence, is_common=True)]
    basis = _branch_basis(table, whitening, excess.common)
    if basis.shape[1]:
        p, drawn = _flipped(case, basis, excess.apart)
        axes.append(Axis("branch", basis, p, drawn, _branch_sentence(table, case.gaps)))
    basis = _hold_time_basis(table, whitening, excess.common)
    if basis.shape[1]:
        p, drawn = _flipped(case, basis, excess.apart)
        axes.append(Axis("time", basis, p, drawn, _hold_sentence(table, case.gaps)))
    return axes


def _position_axes(case: _Case) -> list[Axis]:
    """Places along bars: the clearer of a smooth course with steps, and a cluster of places."""
    table, whitening, excess = case.table, case.whitening, case.excess
    if not table.is_field.any():
        return []
    besides = factor_of_bars(table, whitening, excess.common)
    basis = position_basis(case.campaign, table, whitening, besides)
    if not basis.shape[1]:
        return []
    y = excess.y - besides @ (besides.T @ excess.y)
    y = y / bar_scale(table, y, basis)
    found = cluster(case.campaign, table, y)
    p, drawn = _flipped(case, basis, y)
    bars = np.unique(case.of_row[table.is_field])
    if len(bars) >= FEWEST_TO_FLIP:
        noise = case.signs[:, case.of_row] * y
    else:
        noise = case.rng.standard_normal((len(case.signs), len(table)))
        freedom = case.noise.degrees_of_freedom
        noise *= np.sqrt(freedom / case.rng.chisquare(freedom, len(noise)))[:, None]
    masses = cluster_draws(case.campaign, table, noise)
    of_cluster = tail_p(0.0 if found is None else found.mass, masses, 0.3)
    either = 2.0 * np.minimum(drawn, rank_p(masses))
    sentence = _position_sentence(found, case.campaign, table, case.gaps)
    return [Axis("position", basis, 2.0 * min(p, of_cluster), either, sentence)]


def _outlying_axes(case: _Case) -> list[Axis]:
    """Specimens against their replicates: noise with stray specimens is drawn."""
    table, whitening = case.table, case.whitening
    level = strain_shapes(table)[:, 0]
    test = table.test[whitening.starts[:-1]]
    found = outlying_replicates(whitening, level, case.residual, test, len(case.signs), case.rng)
    if found is None:
        return []
    columns = np.stack([np.where(case.of_row == i, level, 0.0) for i in found.named], axis=1)
    basis = orthonormal(whitening(columns), besides=case.excess.common)
    ids = [case.campaign.specimens[int(whitening.specimen[i])].id for i in found.named]
    p = tail_p(float(np.log(max(found.figure, 1e-9))), np.log(found.drawn), 0.1)
    sentence = _specimens_sentence(ids, found.shift)
    return [Axis("specimen", basis, p, rank_p(found.drawn), sentence)]


def _flipped(case: _Case, basis: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
    freedom = case.noise.degrees_of_freedom
    return within_p(case.whitening, basis, y, case.signs, freedom, case.rng)
