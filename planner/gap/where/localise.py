"""Where the gap of a campaign lies: every axis, with its share, p-value and a sentence."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.errors import ArgumentError
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Place
from planner.gap.features.table import FeatureTable
from planner.gap.where.detail import (
    Gaps,
    branch_sentence,
    column_sentence,
    hold_sentence,
    position_sentence,
    specimens_sentence,
    strain_sentence,
)
from planner.gap.where.along_path import branch_basis, hold_time_basis
from planner.gap.where.apart import specimens_apart
from planner.gap.where.axis import Axis
from planner.gap.where.columns import campaign_columns
from planner.gap.where.dealing import dealt, seen_by_chance, varies_within
from planner.gap.where.family import family_wise, rank_p, tail_p
from planner.gap.where.noise import Noise
from planner.gap.where.position import (
    bar_scale,
    cluster,
    cluster_draws,
    factor_of_bars,
    position_basis,
)
from planner.gap.where.ranking import SIGNIFICANT, ranked
from planner.gap.where.relabelling import SpecimenScores
from planner.gap.where.shapes import field_level, strain_shapes
from planner.gap.where.share import Excess
from planner.gap.where.sign_flip import FEWEST_TO_FLIP, within_p
from planner.gap.where.whitening import Whitening, orthonormal

__all__ = ["localise"]

BOOTSTRAPS = 200
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
) -> tuple[Place, ...]:
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
    axes = [*_column_axes(case), *_within_axes(case), *_position_axes(case), *_apart_axes(case)]
    if not axes:
        return ()
    p = family_wise(
        np.array([a.p for a in axes]),
        np.stack([a.drawn_p for a in axes]),
        np.array([a.least for a in axes]),
    )
    order, adds = ranked(axes, p, case.excess)
    weights = rng.multinomial(
        len(case.whitening.specimen),
        np.full(len(case.whitening.specimen), 1.0 / len(case.whitening.specimen)),
        BOOTSTRAPS,
    ).astype(np.float64)
    first = axes[order[0]].name
    places = []
    for i in order:
        sentence = axes[i].detail
        if i != order[0] and p[i] <= SIGNIFICANT and adds[i] < _ADDS_LITTLE:
            sentence += f"; little of it beyond what goes with {first}"
        share, interval = case.excess.share(axes[i]), case.excess.interval(axes[i], weights)
        places.append(Place(axes[i].name, share, interval, float(p[i]), sentence))
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
        p, drawn = scores.p(column, dealt(keys, column, within), *totals[known])
        sentence = column_sentence(column, case.table, case.of_row, case.gaps)
        least = seen_by_chance(column, within)
        axes.append(Axis(column.name, basis, p, drawn, sentence, least=least))
    return axes


def _within_axes(case: _Case) -> list[Axis]:
    """Strain, branch and time of a hold: signs of whole specimens are drawn."""
    table, whitening, excess = case.table, case.whitening, case.excess
    p, drawn = _flipped(case, excess.common, excess.y)
    sentence = strain_sentence(table, case.gaps)
    axes = [Axis("strain", excess.common, p, drawn, sentence, is_common=True)]
    basis = branch_basis(table, whitening, excess.common)
    if basis.shape[1]:
        p, drawn = _flipped(case, basis, excess.apart)
        axes.append(Axis("branch", basis, p, drawn, branch_sentence(table, case.gaps)))
    basis = hold_time_basis(table, whitening, excess.common)
    if basis.shape[1]:
        p, drawn = _flipped(case, basis, excess.apart)
        axes.append(Axis("time", basis, p, drawn, hold_sentence(table, case.gaps)))
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
    sentence = position_sentence(found, case.campaign, table, case.gaps)
    return [Axis("position", basis, 2.0 * min(p, of_cluster), either, sentence)]


def _apart_axes(case: _Case) -> list[Axis]:
    """Specimens against their replicates: noise with stray specimens is drawn."""
    table, whitening = case.table, case.whitening
    level = strain_shapes(table)[:, 0]
    test = table.test[whitening.starts[:-1]]
    found = specimens_apart(whitening, level, case.residual, test, len(case.signs), case.rng)
    if found is None:
        return []
    columns = np.stack([np.where(case.of_row == i, level, 0.0) for i in found.named], axis=1)
    basis = orthonormal(whitening(columns), besides=case.excess.common)
    ids = [case.campaign.specimens[int(whitening.specimen[i])].id for i in found.named]
    p = tail_p(float(np.log(max(found.figure, 1e-9))), np.log(found.drawn), 0.1)
    sentence = specimens_sentence(ids, found.shift)
    return [Axis("specimen", basis, p, rank_p(found.drawn), sentence)]


def _flipped(case: _Case, basis: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
    freedom = case.noise.degrees_of_freedom
    return within_p(case.whitening, basis, y, case.signs, freedom, case.rng)
