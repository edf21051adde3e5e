"""What a campaign's features scatter by when nothing is hidden."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.special
from scipy.linalg.lapack import dtrtrs
from scipy.sparse import block_diag, csr_array

from planner.formats.units import QUANTITY_UNITS
from planner.gap.campaign import Campaign
from planner.gap.observations import SIDES, FeatureTable
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import Palette
from planner.simulation.bar_solver import Setup

__all__ = [
    "FIT_SD",
    "UNIT_GAINS",
    "USUAL",
    "Calibration",
    "NoisyFeatures",
    "SpecimenNoise",
    "calibration_columns",
    "calibrations_of",
    "discrepancy_columns",
    "likeliest_facet",
    "likeliest_sides",
    "unit_gains",
]


# ------------------------------------------------------------------------------------------------
# How much specimens made alike differ.


@dataclass(frozen=True, slots=True)
class Scatter:
    """Standard deviations, of the logarithm of force unless named otherwise.

    Attributes
    ----------
    specimen, batch
        Of the level of a whole curve.
    slope
        Of the change of that level from the start of a path to its end.
    wander, wander_length
        Of what comes and goes along a path, and the share of the path over which it lasts.
    toe
        Of where the pull begins, over the farthest travel.
    sensor
        Factor on the force noise that each record shows.
    field, field_relative
        Of what a camera sees at one place: its own, and relative to the strain.
    field_shared
        Share of that variance that facets have in common where they overlap, 0 to 1.
    log_sd
        How far all of it may be off, as a standard deviation of its logarithm.
    degrees_of_freedom
        Of the replicates behind it; 0 where there are none.
    """

    specimen: float
    batch: float
    slope: float
    wander: float
    wander_length: float
    toe: float
    sensor: float
    field: float
    field_relative: float
    field_shared: float
    log_sd: float
    degrees_of_freedom: int


# ------------------------------------------------------------------------------------------------
# Covariance of each specimen's own features, and what specimens of a batch share.


@dataclass(frozen=True, eq=False)
class SpecimenNoise:
    """Noise of N features.

    Attributes
    ----------
    rows
        Slices of the table's rows, one a specimen.
    blocks
        Covariance of each specimen's rows, (d, d).
    inverse_root : (N, N)
        Sparse: the inverses of their lower Cholesky factors.
    batch : (N, batches)
        What specimens of one batch share, a column of prior deviation 1 a batch; no column where
        batches are unknown or all the same.
    """

    rows: tuple[slice, ...]
    blocks: tuple[FloatArray, ...]
    inverse_root: csr_array
    batch: FloatArray

    @cached_property
    def first_row(self) -> IntArray:
        """Where each specimen's rows begin, and where the last one's end, (n + 1,)."""
        return np.array([0, *(rows.stop for rows in self.rows)])

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), on a scale where each specimen's own noise is white."""
        return np.asarray(self.inverse_root @ columns)


@dataclass(frozen=True, slots=True, eq=False)
class NoisyFeatures:
    """N features, and what their noise goes by.

    Attributes
    ----------
    sensitivity : (N,)
        Of the transformed features by the logarithm of force or strain.
    sensor_sd_N : (n, T)
        What the noise of its record makes of each specimen's force at each step.
    batch_of : (n,)
        A number of each specimen's batch, -1 where unknown.
    """

    table: FeatureTable
    sensitivity: FloatArray
    sensor_sd_N: FloatArray
    batch_of: IntArray

    def noise(self, scatter: Scatter) -> SpecimenNoise:
        """Return the noise of the features where specimens scatter so."""
        table, batch_of = self.table, self.batch_of
        edges = np.flatnonzero(np.diff(table.specimen)) + 1
        rows = tuple(slice(a, b) for a, b in itertools.pairwise([0, *edges.tolist(), len(table)]))
        blocks = tuple(self._block(scatter, of_one) for of_one in rows)
        batches = np.unique(batch_of[batch_of >= 0])
        level = scatter.batch * np.where(table.is_field, 0.0, self.sensitivity)
        columns = level[:, None] * (batch_of[table.specimen][:, None] == batches)
        columns = columns if len(batches) > 1 else columns[:, :0]
        roots = [csr_array(np.linalg.inv(np.linalg.cholesky(block))) for block in blocks]
        return SpecimenNoise(rows, blocks, block_diag(roots, format="csr"), columns)

    def _block(self, scatter: Scatter, rows: slice) -> FloatArray:
        """Return the covariance of one specimen's rows, (d, d): forces, then strains of a bar."""
        stop = rows.stop - int(self.table.is_field[rows].sum())
        forces = self._force_block(slice(rows.start, stop), _MODEL_SD)(scatter)
        field = _field_block(self.table, self.sensitivity, scatter, slice(stop, rows.stop))
        return scipy.linalg.block_diag(forces, field)

    def _force_block(self, rows: slice | IntArray, least: float) -> Callable[[Scatter], FloatArray]:
        """Return what makes the covariance of one specimen's forces, (d, d), of a scatter."""
        table, h = self.table, self.sensitivity[rows]
        place, strain = table.path[rows], table.strain[rows]
        share = strain / max(float(strain.max()), 1e-12)
        # Of nearly straight starts: what travel is off by, over the travel.
        tilt, early = h * (share - 0.5), h * share / (share**2 + _AT_REST**2)
        far = -np.abs(np.subtract.outer(place, place))
        sensor = self.sensor_sd_N[table.specimen[rows], table.step[rows]]
        own = np.square(sensor * _by_raw(table, self.sensitivity, rows))
        level, *others = (np.outer(v, v) for v in (h, tilt, early))
        parts = np.stack([level, *others, np.diag(own), least**2 * np.eye(len(h))])

        def block(scatter: Scatter) -> FloatArray:
            sds = (scatter.specimen, scatter.slope, scatter.toe, scatter.sensor, 1.0)
            wander = np.exp(far / scatter.wander_length) * level
            return np.tensordot(np.square(sds), parts, 1) + scatter.wander**2 * wander

        return block

    def estimated_scatter(
        self, residual: FloatArray, aside: FloatArray, counts: BoolArray
    ) -> Scatter:
        """Return the scatter of the specimens; `USUAL`, widely uncertain, without replicates.

        Differences between replicates do not know what is hidden: they are fitted by restricted
        maximum likelihood with wide physical priors, so that two replicates a condition say what
        they can and a campaign without any still has an honest, wide answer.

        Parameters
        ----------
        residual : (N,)
            Transformed measurements, without `unit_gains`, less what the palette predicts, which
            knows what places each replicate was seen at.
        aside : (N,)
            Change of the features were places to the side of where they are said to be.
        counts : (N,)
            Which features tell of scatter.
        """
        table, batches = self.table, np.unique(self.batch_of)
        members = (self.batch_of[:, None] == batches) & (batches >= 0)
        level = np.where(table.is_field, 0.0, self.sensitivity)

        def field_block(rows: IntArray) -> Callable[[Scatter], FloatArray]:
            # Where replicates differ because their places lie to the side, it is not scatter.
            own = np.outer(aside[rows], aside[rows])
            return lambda scatter: own + _field_block(table, self.sensitivity, scatter, rows)

        logs, freedom = dict[str, float](), 0
        for is_field in (False, True):
            told = []
            for rows in _groups(table, table.is_field if is_field else counts & ~table.is_field):
                # Orthonormal differences of replicates, and how much each has of every batch.
                contrast, of = scipy.linalg.helmert(len(rows)), table.specimen[[r[0] for r in rows]]
                differences = contrast @ residual[np.stack(rows)], contrast @ members[of]
                block = field_block(rows[0]) if is_field else self._force_block(rows[0], _READ_SD)
                told.append((block, level[rows[0]], *differences))
                freedom += 0 if is_field else len(contrast)
            if told:
                logs |= _likeliest([n for n in _PRIOR_SD if ("field" in n) is is_field], told)
        if not logs:
            return USUAL
        log_sd = 1.0 / math.sqrt(1.0 / USUAL.log_sd**2 + 2.0 * freedom)
        return replace(_scatter(logs), log_sd=log_sd, degrees_of_freedom=freedom)


def _likeliest(names: Sequence[str], told: Sequence[tuple[Any, ...]]) -> dict[str, float]:
    """Return logarithms of factors on `USUAL`, or of odds, that differences of replicates tell.

    Parameters
    ----------
    told
        Of each group, what makes its covariance, what a batch changes, (d,), differences, (k, d),
        and how much each has of every batch, (k, batches).
    """
    prior_sd, batches = np.array([_PRIOR_SD[name] for name in names]), told[0][-1].shape[1]

    def cost(logs: FloatArray) -> float:
        scatter = _scatter(dict(zip(names, logs.tolist(), strict=True)))
        total = 0.5 * float(np.sum((logs / prior_sd) ** 2))
        inner, cross = np.eye(batches), np.zeros(batches)
        for block, level, differences, shares in told:
            columns = np.stack([scatter.batch * level, *differences], axis=1)
            half_log, white = _whitened(block(scatter), columns)
            total += len(differences) * half_log + 0.5 * float(np.sum(white[:, 1:] ** 2))
            inner += float(white[:, 0] @ white[:, 0]) * shares.T @ shares
            cross += shares.T @ (white[:, 1:].T @ white[:, 0])
        # Levels of batches, which all groups have in common, integrated out.
        half_log, half = _whitened(inner, cross)
        return total + half_log - 0.5 * float(half @ half)

    best = scipy.optimize.minimize(
        cost, np.zeros(len(names)), method="L-BFGS-B", bounds=[(-2.5, 2.5)] * len(names),
        options={"maxiter": 25},
    )  # fmt: skip
    return dict(zip(names, best.x.tolist(), strict=True))


def _field_block(
    table: FeatureTable, sensitivity: FloatArray, scatter: Scatter, rows: slice | IntArray
) -> FloatArray:
    """Return the covariance of one specimen's strains along a bar, (d, d); frame by frame."""
    own = scatter.field * _by_raw(table, sensitivity, rows)
    sd = np.hypot(own, scatter.field_relative * sensitivity[rows])
    step, places, overlap = table.step[rows], table.places[rows], table.overlap[rows]
    block = np.zeros((len(sd), len(sd)))
    for frame in (np.flatnonzero(step == s) for s in np.unique(step)):
        alike = scatter.field_shared * overlap[frame, : len(frame)]
        alike[np.diag_indices(len(frame))] += (1.0 - scatter.field_shared) / places[frame]
        block[np.ix_(frame, frame)] = np.outer(sd[frame], sd[frame]) * alike
    block[np.diag_indices(len(sd))] += _MODEL_SD**2
    return block


def _by_raw(table: FeatureTable, sensitivity: FloatArray, rows: slice | IntArray) -> FloatArray:
    """Return the derivative of transformed features by raw ones, (d,)."""
    # Of asinh(F / 2 s) by F, where F = 2 s sinh(y): 1 / (2 s cosh y).
    return np.sqrt(np.maximum(1.0 - sensitivity[rows] ** 2, 1e-8)) / (2.0 * table.floor[rows])


# ------------------------------------------------------------------------------------------------
# What the palette's own laws may be off by: columns of the features, each of prior deviation 1.
#
# Every grade's level and slope are uncertain, and so is what lies between grades. The columns are
# the forward model's own derivatives, so that a graded bar feels its grades as it should.


_UNKNOWN_LOG_SD = 0.05
"""Of ln modulus of a grade where the palette does not say. Chosen: what the mean of two or three
tests is off by, of specimens that scatter by 3 to 9 %."""

FIT_SD = 0.01
"""Of the logarithm of stress, from small strains to large ones, and of what a law leaves of its own
tests where the palette does not say. Chosen: laws follow their tests to 1 %."""

_STEP = 0.02
"""Of the differences by which columns are made. Numerical: what is not linear in it stays below a
hundredth of the column."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """One way in which the palette may be off.

    Attributes
    ----------
    material
        Its id, "" between two grades and of a part.
    kind
        "level", "tilt", "between", or "part": what its own simulation may be off by.
    sd
        Of its size.
    weight : (S,)
        How much each slice has of it.
    """

    material: str
    kind: str
    sd: float
    weight: FloatArray

    def applied(self, setup: Setup, size: float = _STEP) -> Setup:
        """Return the setup with the laws off by `size`, or by as much as a way is tried with."""
        if self.kind == "tilt":
            return setup.with_(log_tilt=setup.log_tilt + size * self.weight)
        return setup.stiffened(size * self.weight)


def calibrations_of(palette: Palette, setup: Setup) -> Iterator[Calibration]:
    """Yield the ways that matter to a setup: of its grades, gaps between these, and parts."""
    at = np.array([m.coordinate for m in palette.materials])
    where = np.clip(setup.coordinate, at[0], at[-1])
    for k, material in enumerate(palette.materials):
        hat = np.interp(where, at, np.eye(len(at))[k])
        if hat.max() > 0.0:
            # A fit states it of the next print: sqrt(1 + n) times what the mean of n is off by.
            tested = getattr(material.uncertainty, "specimens", 0)
            sd = (material.modulus_log_sd or _UNKNOWN_LOG_SD) / math.sqrt(1.0 + tested)
            yield Calibration(material.id, "level", sd, hat)
            yield Calibration(material.id, "tilt", FIT_SD, hat)
    for low, high in itertools.pairwise(at):
        t = np.clip((where - low) / (high - low), 0.0, 1.0)
        bump = 4.0 * t * (1.0 - t)
        if bump.max() > 0.01:
            # Nobody measured it: it is as uncertain as one specimen.
            yield Calibration("", "between", USUAL.specimen, bump)
    for part in dict.fromkeys(part for part in setup.parts if part is not None):
        its = setup.on_slices(np.array([part is one for one in setup.parts], dtype=np.float64))
        yield Calibration("", "part", part.log_sd, its)


def calibration_columns(calibrations: tuple[Calibration, ...], changes: FloatArray) -> FloatArray:
    """Return the columns, (N, q).

    Parameters
    ----------
    changes : (q, N)
        Of the features, with ``way.applied(setup)``.
    """
    return np.ascontiguousarray((changes * [[one.sd / _STEP] for one in calibrations]).T)


# ------------------------------------------------------------------------------------------------
# What scatter is usual, and specimens that were made and tested alike.


USUAL = Scatter(
    specimen=0.03, batch=0.012, slope=0.012, wander=0.006, wander_length=0.15, sensor=1.0,
    toe=0.002, field=0.004, field_relative=0.03, field_shared=0.5, log_sd=0.5, degrees_of_freedom=0,
)  # fmt: skip
"""Without replicates, and the centre of the priors with them. Physical: jetted specimens scatter by
1 to 9 % within a print, local strains along them alike; facets of image correlation by some
thousandths of strain; specimens are clamped to some hundredths of a millimetre. Of the parts of it
the shares are chosen: most of a curve goes together."""

_AT_REST = 0.02
"""Share of the farthest travel, within which a toe does ever less. Numerical: nearer to rest than
any feature of a first loading but the first, in which no toe shows."""

_MODEL_SD = 0.1 * USUAL.specimen
"""No prediction is truer than this, in transformed units. Numerical: above what discretisation and
reading a curve at a place leave, and little beside the scatter."""

_READ_SD = 0.1 * _MODEL_SD
"""What replicates differ by at least: a prediction that is off is off for all of them. Numerical:
so that records without noise have a covariance."""

_PRIOR_SD = {"specimen": 1.0, "batch": 0.5, "slope": 0.8, "wander": 0.8, "wander_length": 0.4,
             "toe": 0.5, "sensor": 0.4, "field": 1.0, "field_relative": 1.0,
             "field_shared": 1.5}  # fmt: skip
"""Of their logarithms, and of the last one's odds, before replicates are seen. Physical: 3 % times
or by e^(2 * 1.0) holds the 1 to 9 % of jetted specimens and the 10 to 30 % of some labs'; what
batches share is a ratio to it, what changes along a curve is not: a level that scatters says
nothing of it. Cameras differ more than specimens do; facets share anything from nothing to all."""

UNIT_GAINS: FloatArray = np.log(
    [QUANTITY_UNITS["force"]["lbf"], QUANTITY_UNITS["force"]["kgf"], QUANTITY_UNITS["length"]["in"]]
)
"""Logarithms of pounds and kilograms for newtons; of inches, where somebody scaled the wrong
column."""


_ALIKE = 3.0 * math.sqrt(2.0) * 0.09
"""How far the levels of two specimens made alike may lie apart. Physical: three deviations, of the
9 % that jetted specimens scatter by at most."""


def unit_gains(table: FeatureTable) -> FloatArray:
    """Return by which units' factors specimens differ from most of their replicates, (n,), in logs.

    One of `UNIT_GAINS` either way, to what the difference of two jetted specimens may be.
    """
    found = np.zeros(int(table.specimen.max()) + 1)
    steps = np.concatenate([[0.0], UNIT_GAINS, -UNIT_GAINS])
    for rows in _groups(table, ~table.is_field):
        forces = table.measured_raw[np.stack(rows)]
        clear = (np.abs(forces) > table.floor[rows[0]]).all(axis=0)
        if not clear.any():
            continue
        levels = np.median(np.log(np.abs(forces[:, clear])), axis=1)
        far = np.abs(np.subtract.outer(levels, levels)[..., None] - steps)
        nearest = np.where(far.min(axis=2) < _ALIKE, np.argmin(far, axis=2), 0)
        # Seen from the one that most are like.
        seen = nearest[:, np.argmax(np.sum(nearest == 0, axis=0))]
        found[[table.specimen[r[0]] for r in rows]] = steps[seen]
    return found


def _scatter(logs: Mapping[str, float]) -> Scatter:
    """Return `USUAL` times factors, what batches share times that of the level too."""
    factor = {name: math.exp(log) for name, log in logs.items()}
    factor["batch"] = factor.get("batch", 1.0) * factor.get("specimen", 1.0)
    odds = factor.pop("field_shared", 1.0)
    changed = {name: getattr(USUAL, name) * f for name, f in factor.items()}
    return replace(USUAL, **changed, field_shared=odds / (1.0 + odds))


def _whitened(covariance: FloatArray, columns: FloatArray) -> tuple[float, FloatArray]:
    """Return half the log determinant of a covariance, and columns on its scale."""
    factor = np.linalg.cholesky(covariance)
    white, _ = dtrtrs(factor, columns, lower=True)
    return float(np.log(np.diagonal(factor)).sum()), white


def _groups(table: FeatureTable, of: BoolArray) -> list[list[IntArray]]:
    """Return, for each two replicates or more, the rows of each among some, (N,)."""
    found: dict[int, list[IntArray]] = {}
    for specimen in np.unique(table.specimen[of]):
        rows = np.flatnonzero(of & (table.specimen == specimen))
        found.setdefault(int(table.replicates[rows[0]]), []).append(rows)
    return [group for group in found.values() if len(group) > 1 and len(set(map(len, group))) == 1]


# ------------------------------------------------------------------------------------------------
# What a palette's laws cannot follow, and what a camera does to strains: further nuisances.
#
# A law of a few parameters follows its tests to about 1 %, with an error that changes with
# strain. A camera's facets average over a length that may not be stated, and may lie to the side.


_ROUGHLY = 0.1
"""Of the logarithm of local strains, and of how they differ along a bar: what they may be off by
before any effect is known. Chosen: wide, so that what facets are likeliest is told by how strains
go near steps, and not by how large they are."""

_DECAYS = (0.01, 0.03, 0.09, 0.27)
"""Strains over which laws' departures fade. Chosen: each three times the one before, up to
about a usual pull's end."""


def discrepancy_columns(
    campaign: Campaign, table: FeatureTable, sensitivity: FloatArray
) -> FloatArray:
    """Return what laws may depart by over strain, all together, then each material's and bar's.

    At rest twice what they follow their tests to, from where each of `_DECAYS` lets it fade.
    In compression another law is at work: it departs by itself.
    """
    names = [(s.named, s.pushed) for s in campaign.specimens]
    decays = np.exp(-table.strain[:, None] / np.array(_DECAYS))
    force = np.where(table.is_field, 0.0, 2.0 * FIT_SD * sensitivity)[:, None] * decays
    # Laws of one family miss the same bends, whatever the material.
    each = [np.array([n == name for n in names])[table.specimen] for name in dict.fromkeys(names)]
    return np.concatenate([force, *(force * of_it[:, None] for of_it in each)], axis=1)


def likeliest_sides(table: FeatureTable, seen: FloatArray) -> IntArray:
    """Return where a specimen's places seem to lie for each likely length of facets, (L, F).

    An index into `SIDES`. No effect puts steps aside: the palette alone is asked.

    Parameters
    ----------
    seen : (L, sides, F)
        Strains of bins, by `FieldWeights.weight`, as the palette alone predicts them.
    """
    sides = np.zeros((len(seen), seen.shape[2]), dtype=np.int64)
    for side, of_length in zip(sides, seen, strict=True):
        for at, log in _likelihoods(table, of_length, of_length[len(SIDES) // 2]):
            side[at] = np.argmax(log - 0.5 * SIDES**2)
    return sides


def likeliest_facet(table: FeatureTable, strains: FloatArray) -> int:
    """Return which of the likely lengths of facets makes most of the local strains, by number.

    A boundary that bled looks like a longer facet. So that no length stands for what an effect
    does, effects count for as much as none.

    Parameters
    ----------
    strains : (K, L, F)
        Strains of bins without an effect, then with one at a time.
    """
    if strains.shape[1] == 1:
        return 0
    logs = []
    for of_length in np.moveaxis(strains, 1, 0):
        each = [log for _, log in _likelihoods(table, of_length, of_length[0])]
        log: FloatArray = np.sum(each, axis=0)
        effects = scipy.special.logsumexp(log[1:]) - math.log(max(len(log) - 1, 1))
        logs.append(np.logaddexp(log[0], effects))
    return int(np.argmax(logs))


def _likelihoods(
    table: FeatureTable, strains: FloatArray, usual: FloatArray
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Yield the places of each specimen's strains, and ln likelihood of what is predicted, (K,).

    Before anything is known of camera and bar.

    Parameters
    ----------
    strains : (K, F)
        Of bins, as they may be.
    usual : (F,)
        One of these, by which noise goes.
    """
    field = np.flatnonzero(table.is_field)
    left = table.measured[field] - np.arcsinh(strains / (2.0 * table.floor[field]))
    larger = np.zeros(len(table))
    larger[field] = np.maximum(np.abs(table.measured_raw[field]), np.abs(usual))
    sensitivity = table.sensitivity(larger)
    contrast = np.log(np.maximum(np.abs(usual), 1e-6))
    off = _ROUGHLY * sensitivity[field] * np.stack([np.ones_like(usual), contrast])
    for one in np.unique(table.specimen[field]):
        at = np.flatnonzero(table.specimen[field] == one)
        block = _field_block(table, sensitivity, USUAL, field[at]) + off[:, at].T @ off[:, at]
        half_log, white = _whitened(block, left[:, at].T)
        yield at, -half_log - 0.5 * np.sum(white**2, axis=0)
