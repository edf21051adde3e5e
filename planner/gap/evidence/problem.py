"""A campaign made ready for weighing: forms on nodes, and every column that hypotheses need."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import prod
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtrc, ndtr, ndtri

from planner.gap.campaign import Campaign, axis_columns
from planner.gap.effect import Effect, Form, StatedEffect, with_effects
from planner.gap.localise import axis_patterns, specimen_patterns
from planner.gap.noise import (
    FIT_SD,
    UNIT_GAINS,
    NoisyFeatures,
    calibration_columns,
    calibrations_of,
    discrepancy_columns,
    likeliest_facet,
    likeliest_sides,
    unit_gains,
)
from planner.gap.observations import FeatureTable, ObservationModel
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.simulation.bar_solver import Prediction, Setup, predict

__all__ = ["EVERY_AXIS", "Candidate", "Problem", "SignedForm", "joined", "node_weights", "searched"]


# ------------------------------------------------------------------------------------------------
# Where each form is evaluated, so that everything in between follows by interpolation.
#
# The features that a form predicts are smooth in its parameters: three sizes, five values of a
# first parameter of shape and three of a second carry them. Sizes are spaced nearly as squares,
# being nought at the first, which needs no evaluation; a point has the root s of the size over its
# largest. Times of relaxation over decades take the five.


_NODES = np.array(
    [
        [0.0, 0.35, 0.7, 1.0, np.nan],  # of s, the root of size over its largest
        [-0.932, -0.576, 0.0, 0.576, 0.932],  # of the ranges, -1 to 1, of a first shape parameter
        [-0.85, 0.0, 0.85, np.nan, np.nan],  # and of a second: nearly Chebyshev's
    ]
)
_FIRST, _STOP = (1, 0, 0), (4, 5, 3)
"""Nodes of a form: where they lie, and which are evaluated. Numerical: what lies between is
interpolated to find where to look; the posterior mode is found on the model itself."""

_FAR = 4.0
"""Deviations beyond which no parameter is looked for. Numerical: all but 6e-5 of a prior lies
within."""


_Point: TypeAlias = tuple[float, ...]
"""Of a form: s, the root of its size over the largest; shapes in -1 to 1; then perhaps details."""


@dataclass(frozen=True, slots=True)
class SignedForm:
    """One form with one sign of its size.

    Attributes
    ----------
    number
        Among all signed forms.
    first
        Its first node among all nodes.
    weight
        Its share of the prior among the effect's signed forms.
    """

    number: int
    effect: Effect
    form: Form
    sign: float
    first: int
    weight: float

    @property
    def shapes(self) -> int:
        """Number of shape parameters."""
        return len(self.form.parameters) - 1

    @property
    def own(self) -> slice:
        """Its nodes among all nodes."""
        count = prod(_STOP[d] - _FIRST[d] for d in range(1 + self.shapes))
        return slice(self.first, self.first + count)

    def values(self, point: Sequence[float]) -> dict[str, float]:
        """Return the parameters at a point: s, then shapes in -1 to 1, then perhaps details."""
        size = self.form.size
        values = {size.name: self.sign * size.high * point[0] ** 2}
        for parameter, at in zip(self.form.parameters[1:], point[1:], strict=False):
            values[parameter.name] = parameter.at(0.5 * (at + 1.0))
        values.update(zip(self.form.details, point[1 + self.shapes :], strict=False))
        return values

    def coordinates(self, point: Sequence[float]) -> FloatArray:
        """Return a point in coordinates that are normal with deviation 1 before any data.

        Sizes are uniform in their logarithm, shapes over their range.
        """
        share = [1.0 - np.log(max(point[0], self.least)) / np.log(self.least)]
        share += [0.5 * (at + 1.0) for at in point[1 : 1 + self.shapes]]
        found = np.zeros(1 + self.shapes + len(self.form.details))
        found[: len(share)] = ndtri(np.clip(share, *ndtr([-_FAR, _FAR])))
        found[len(share) : len(point)] = point[len(share) :]
        return found

    def point(self, coordinates: FloatArray) -> tuple[float, ...]:
        """Return the point at coordinates; see `coordinates`."""
        at = np.clip(coordinates, -_FAR, _FAR)
        share = ndtr(at[: 1 + self.shapes])
        size = float(self.least ** (1.0 - share[0]))
        return (size, *(2.0 * share[1:] - 1.0).tolist(), *at[1 + self.shapes :].tolist())

    def node_points(self) -> list[tuple[float, ...]]:
        """Return the points of its nodes, sizes slowest."""
        return list(product(*(_NODES[d, _FIRST[d] : _STOP[d]] for d in range(1 + self.shapes))))

    @property
    def least(self) -> float:
        """The smallest s."""
        return float((self.form.size.low / self.form.size.high) ** 0.5)


def signed_forms(effects: Sequence[Effect]) -> tuple[SignedForm, ...]:
    """Return all signed forms of the effects, numbered, with their nodes one after another."""
    found: list[SignedForm] = []
    first = 0
    for effect in effects:
        for form in effect.forms:
            signs = (1.0, -1.0) if form.size.signed else (1.0,)
            for sign in signs:
                weight = form.weight / sum(f.weight for f in effect.forms) / len(signs)
                found.append(SignedForm(len(found), effect, form, sign, first, weight))
                first = found[-1].own.stop
    return tuple(found)


_POWER = (2, 1, 1)
"""Of a point, in which polynomials are. Numerical: those of the size itself, and not of its root,
are near at small sizes too."""


@lru_cache(maxsize=3)
def _lagrange(d: int) -> FloatArray:
    """Return the coefficients of Lagrange's polynomials through the nodes of a parameter."""
    return np.asarray(np.linalg.inv(np.vander(_NODES[d, : _STOP[d]] ** _POWER[d], increasing=True)))


def node_weights(points: ArrayLike) -> FloatArray:
    """Return the weight of each node of a form, (..., nodes), at points (..., 1 + shapes).

    Lagrange's, sizes slowest.
    """
    at = np.asarray(points, dtype=np.float64)
    weights = np.ones((*at.shape[:-1], 1))
    for d in range(at.shape[-1]):
        powers = np.vander(at[..., d].ravel() ** _POWER[d], _STOP[d], increasing=True)
        own = (powers @ _lagrange(d)).reshape(*at.shape[:-1], -1)[..., _FIRST[d] :]
        weights = (weights[..., :, None] * own[..., None, :]).reshape(*at.shape[:-1], -1)
    return weights


# ------------------------------------------------------------------------------------------------
# One explanation of a campaign, fitted.


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Effects in one form each, at their best parameters.

    Attributes
    ----------
    effects
        Ids, sorted; () for none.
    parts
        Of each effect, in that order: a signed form, and its point (s, shapes..., details...).
    gain
        Log likelihood above that of no effect.
    log_evidence
        Above that of no effect, of this form alone.
    members : (n,) or None
        Which specimens it holds for, 1 or 0, where it holds for some only.
    log_gain
        What these specimens' force is off by, as a logarithm.
    own : (m, n) or None
        Of effects whose sizes differ: a normal deviate of each specimen's; see `own_sizes`.
    """

    effects: tuple[str, ...]
    parts: tuple[tuple[SignedForm, _Point], ...] = ()
    gain: float = 0.0
    log_evidence: float = 0.0
    members: FloatArray | None = None
    log_gain: float = 0.0
    own: FloatArray | None = None

    def applied(self, setup: Setup) -> Setup:
        """Return a setup with the effects, each at its stage.

        What holds for some specimens only is left to `Problem.forces_N`.
        """
        effects = (StatedEffect(b.effect, b.form, b.values(point)) for b, point in self.parts)
        return with_effects(setup, effects)

    def log_gains(self, n: int) -> FloatArray:
        """Return what the force of each of n specimens is off by, as a logarithm, (n,)."""
        return np.zeros(n) if self.members is None else self.log_gain * self.members

    def own_sizes(self, deviates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return specimens' own sizes, over the effects', and slopes; see `Effect.own_size`."""
        each = zip(self.differing, deviates, strict=True)
        found = [signed.effect.own_size(row) for (signed, _), row in each]
        sizes, slopes = np.reshape(found, (len(found), 2, deviates.shape[1])).swapaxes(0, 1)
        return sizes, slopes

    @property
    def differing(self) -> tuple[tuple[SignedForm, _Point], ...]:
        """Of its parts, those whose sizes differ from specimen to specimen."""
        return tuple(part for part in self.parts if part[0].effect.individual)

    @property
    def forms(self) -> tuple[int, ...]:
        """Its signed forms' numbers."""
        return tuple(signed.number for signed, _ in self.parts)


def joined(
    parts: Iterable[tuple[SignedForm, _Point]], gain: float = 0.0, log_evidence: float = 0.0
) -> Candidate:
    """Return signed forms at points as one candidate, effects sorted."""
    ordered = tuple(sorted(parts, key=lambda part: part[0].effect.id))
    return Candidate(tuple(b.effect.id for b, _ in ordered), ordered, gain, log_evidence)


# ------------------------------------------------------------------------------------------------
# Where to look: every form, on a grid of its sizes and shapes.
#
# All features of a form are combinations of its nodes' features, so that its likelihood needs their
# inner products with the residual and with one another, and nothing of the campaign's size.


_GRID = (24, 7, 7)
"""Sizes and shapes at which a form is looked at. Numerical: its evidence is the mean over them, and
the search for a mode starts from the best."""


@lru_cache(maxsize=256)
def _grid(least: float, shapes: int) -> tuple[FloatArray, FloatArray]:
    """Return points of a form, and the weights of its nodes there."""
    sizes = least ** (1.0 - np.arange(_GRID[0]) / (_GRID[0] - 1.0))
    of_shapes = [np.linspace(-1.0, 1.0, count) for count in _GRID[1 : 1 + shapes]]
    points = np.array(list(product(sizes, *of_shapes)))
    return points, node_weights(points)


def searched(
    signed_forms: Sequence[SignedForm], residual: FloatArray, nodes: FloatArray
) -> list[Candidate]:
    """Return every signed form alone, at its best point, the likeliest first.

    Evidence has the form's share of the prior among its effect's.

    Parameters
    ----------
    residual : (nodes,), nodes : (nodes, nodes)
        Inner products of all nodes with the residual and with one another.
    """
    found = []
    for signed in signed_forms:
        own = signed.own
        points, weights = _grid(signed.least, signed.shapes)
        squares = np.sum((weights @ nodes[own, own]) * weights, axis=1)
        gains = weights @ residual[own] - 0.5 * squares
        at = int(np.argmax(gains))
        mean = gains[at] + np.log(signed.weight * np.mean(np.exp(gains - gains[at])))
        found.append(joined([(signed, tuple(points[at].tolist()))], float(gains[at]), float(mean)))
    return sorted(found, key=lambda c: -c.log_evidence)


# ------------------------------------------------------------------------------------------------
# What every model misses: a course along each test, which its replicates share; and along a bar.


_COURSE = 0.25
"""Share of a path over which a discrepancy keeps its sign. Chosen: what a law of few parameters
misses bends a few times along a curve."""


def _model_discrepancy(table: FeatureTable, unpredicted: FloatArray) -> FloatArray:
    """Return courses of deviation 1 over each test's largest force, (N, r).

    Local strains are missed by as much of themselves.
    """
    raw = np.maximum(np.abs(table.measured_raw), np.abs(unpredicted))
    # The derivative of asinh(F / 2 s) by F.
    by_raw = 1.0 / np.hypot(2.0 * table.floor, raw)
    # A bar's strains go along it, each frame by itself; forces along the path.
    along = np.where(table.is_field, table.x_mm, table.path)
    of_frame = np.stack([table.test, np.where(table.is_field, table.step, -1)])
    columns = []
    for test, step in np.unique(of_frame, axis=1).T:
        rows = np.flatnonzero((of_frame[0] == test) & (of_frame[1] == step))
        at = along[rows] / (along[rows].max() if step >= 0 else 1.0)
        size = raw[rows] if step >= 0 else np.full(len(rows), raw[rows].max())
        places, of = np.unique(at, return_inverse=True)
        courses = np.exp(-np.abs(np.subtract.outer(places, places)) / _COURSE)
        root = np.linalg.cholesky(courses + 1e-9 * np.eye(len(places)))
        own = np.zeros((len(table), len(places)))
        own[rows] = (size * by_raw[rows])[:, None] * root[of]
        columns.append(own)
    return np.concatenate(columns, axis=1)


def _seen_otherwise(
    table: FeatureTable, seen: FloatArray, sides: IntArray, facet: int
) -> tuple[FloatArray, FloatArray]:
    """Return how features change with a camera's facets and places, (N,) each.

    By standard deviations: a step from one of the likely lengths to the next, or of `SIDES`, as
    they are known no better. Finite differences, as strain at a boundary has no slope.

    Parameters
    ----------
    seen : (L, sides, F)
        Strains of bins, by `FieldWeights.weight`, as the palette alone predicts them.
    sides, facet
        What is predicted with: see `likeliest_sides` and `likeliest_facet`.
    """
    field = table.is_field
    facets, aside = np.zeros((2, len(table)))
    features, each = np.arcsinh(seen / (2.0 * table.floor[field])), np.arange(int(field.sum()))
    at = facet, sides[facet], each
    if len(seen) > 1:
        facets[field] = np.gradient(features, axis=0)[at]
    aside[field] = np.gradient(features, axis=1)[at]
    return facets, aside


def _field_columns(
    table: FeatureTable, facets: FloatArray, aside: FloatArray, sensitivity: FloatArray
) -> FloatArray:
    """Return what facets and laws do to local strains, (N, q); see `_seen_otherwise`.

    Laws are off by `FIT_SD` of them at each place.
    """
    field = table.is_field
    if not field.any():
        return np.zeros((len(table), 0))
    bars = table.specimen[:, None] == np.unique(table.specimen[field])
    places = [
        np.where((table.test == test) & (np.abs(table.x_mm - x) < 1e-3), FIT_SD, 0.0)
        for test, x in np.unique([table.test[field], table.x_mm[field].round(6)], axis=1).T
    ]
    columns = [*(aside[:, None] * bars).T, *(sensitivity * of_it for of_it in places)]
    return np.stack([facets, *columns] if facets.any() else columns, axis=1)


# ------------------------------------------------------------------------------------------------
# What no effect explains: broad patterns over every axis along which a gap may lie.
#
# One axis at a time, each with its amplitude integrated over, beside the uncertain base laws: a
# pattern that those already cover gains nothing.


EVERY_AXIS = "any"
"""All axes at once that effects claim: what is left when the right effect is not in the library."""


@dataclass(frozen=True, slots=True, eq=False)
class UnknownAxis:
    """Patterns along one axis, (N, k): together of mean square 1 over the features."""

    axis: str
    columns: FloatArray
    claimed: bool


def _unknown_axes(
    patterns: Mapping[str, FloatArray], effects: Iterable[Effect], own: Collection[str]
) -> tuple[UnknownAxis, ...]:
    """Return the axes that vary in a campaign, with their patterns.

    Claimed are those along which some effect varies. All of these together, but for an effect's own
    covariate, along which free patterns count for it, are one axis more.
    """
    claimed = frozenset(own).union(*[e.where for e in effects])
    axes = []
    for name, columns in patterns.items():
        scale = np.sqrt(np.sum(columns**2) / np.any(columns != 0.0, axis=1).sum())
        axes.append(UnknownAxis(name, columns / scale, name in claimed))
    known = [axis.columns for axis in axes if axis.claimed and axis.axis not in own]
    if len(known) > 1:
        axes.append(UnknownAxis(EVERY_AXIS, np.concatenate(known, axis=1), True))
    return tuple(axes)


_LEAST_LEVEL = 1e-3
"""Of a specimen's force, over its replicates' mean. Numerical: so that zero has a logarithm."""

_BY_CHANCE = 0.01
"""Level of the F test of whether replicates differ along a column. Convention: 1 %, as each of
several columns is asked."""


def _levels_apart(campaign: Campaign, model: ObservationModel, counts: BoolArray) -> FloatArray:
    """Return by how much replicates differ along the batch or further column that tells most, (n,).

    In the logarithm of force; nothing unless the mean square of what the column's patterns
    explain is more than the variance that they leave, and not so by chance. Who tested is no part
    of the scatter, nor is a batch that is off by far more than its specimens.
    """
    counted = ([k for k in of if counts[k]] for of in model.replicates)
    groups = [of for of in counted if len(of) > 1]
    level = np.zeros(len(counts))
    for of in groups:
        mean = model.measured_N[of].mean(axis=0)
        own = np.log(np.maximum(model.measured_N[of] @ mean / (mean @ mean), _LEAST_LEVEL))
        level[of] = own - own.mean()
    count, found, most = sum(map(len, groups)), np.zeros(len(counts)), 1.0
    columns = axis_columns(campaign)
    for name in ("batch", *campaign.covariates):
        if (patterns := specimen_patterns(columns[name])) is None:
            continue
        own = np.zeros_like(patterns)
        for of in groups:
            own[of] = patterns[of] - patterns[of].mean(axis=0)
        size, _, rank, _ = np.linalg.lstsq(own, level, rcond=None)
        explained = own @ size
        freedom = count - len(groups) - int(rank)
        if not rank or freedom < 1:
            continue
        variance = max(float(np.sum((level - explained) ** 2)), 1e-12) / freedom
        squares = float(np.sum(explained**2))
        ratio = squares / count / variance
        if ratio > most and fdtrc(rank, freedom, squares / rank / variance) < _BY_CHANCE:
            found, most = explained, ratio
    return found


# ------------------------------------------------------------------------------------------------
# A campaign made ready for weighing: every column that any hypothesis needs, whitened once.
#
# Weights on specimens and a factor on the scatter enter afterwards, so that resampling and leaving
# out cost one product each.


_OWN_SHARES = np.array([0.3, 0.5, 0.7])
_OWN_COURSE: FloatArray = np.linalg.inv(_OWN_SHARES[:, None] ** np.arange(1, 4))
"""Of a specimen's own size in the sum of that and the effect's, at which features are predicted,
and the cubics through these. Numerical: from nothing at no size on, off by less than features
scatter for sizes of a half to twice the effect's."""

_Progress = Callable[[int, int, str], None]

_STRAY_SD = float(UNIT_GAINS.max())
"""Deviation of the logarithm of a stray's own gain. Physical: any factor, up to those of units."""


class Problem:
    """A campaign made ready for weighing.

    The forward model is run at every node of every form, and what comes out whitened.

    Parameters
    ----------
    strays
        Ids of specimens that are off by themselves.

    Attributes
    ----------
    effects
        By id.
    own_axes
        Of each axis that is an effect's own covariate, that effect's id.
    unpredicted : (N,)
        What the palette alone predicts of the features, raw.
    residual : (N,)
        Measured less predicted, transformed.
    chord : (N,)
        What a factor on a specimen's forces changes, over its logarithm.
    unit_gains : (n,)
        See `planner.gap.noise.unit_gains`.
    calibration : (N, q)
        What the palette's laws and a camera may be off by, of prior deviation 1; the
        `calibrations` first.
    target, nodes, gains, patterns, nuisances : (N,), (N, ...)
        Whitened: the residual, the change at each node, each specimen's own gain, the patterns of
        the `unknown` along all axes, and what is uncertain besides, of prior deviation 1.
    of_laws : (nuisances,)
        Which nuisances are courses of laws, in which a poor fit is off by more.
    apart : (n,)
        By how much replicates differ along a further column that tells them apart; no scatter.
    strays : (n,)
        Specimens that data quality sets apart from their replicates: each has a gain of its own,
        and tells neither of scatter nor of how far the gap closes.
    discrepancy : (N, r)
        Whitened: what all models miss together, of deviation 1 over each test's largest force.
    """

    def __init__(
        self,
        campaign: Campaign,
        model: ObservationModel,
        effects: Sequence[Effect],
        progress: _Progress | None = None,
        strays: Collection[str] = (),
    ) -> None:
        self.campaign, self.signed_forms = campaign, signed_forms(effects)
        self.effects = {effect.id: effect for effect in effects}
        covariates = ((entry, e.id) for e in effects for entry in e.covariates)
        self.own_axes = {name: id for entry, id in covariates for name in entry.split("|")}
        self.calibrations = tuple(calibrations_of(campaign.palette, model.setup))
        count = len(self.calibrations)
        setups = [model.setup, *(one.applied(model.setup) for one in self.calibrations)]
        for signed in self.signed_forms:
            points = signed.node_points()
            setups += [signed.form.apply(model.setup, signed.values(p)) for p in points]
        table, field, weights = model.table, model.table.is_field, model.field_weights
        seen = model.seen(model.alone, weights.weight)
        sides = likeliest_sides(table, seen)
        likely = weights.at_sides(sides)
        raw, strains = np.empty((len(setups), len(table))), np.empty((len(setups), *sides.shape))
        for k, setup in enumerate(setups):
            prediction = predict(setup, model.laws, like=model.alone)
            raw[k] = prediction.force_N[table.test, table.step]
            strains[k] = model.seen(prediction, likely)
            if progress is not None and k % 20 == 0:
                progress(k, len(setups), "forward model")
        facet = likeliest_facet(table, strains)
        self.model, self.table = copy(model), table
        self.model.weight = likely[facet]
        raw[:, field] = strains[:, facet]
        self.unpredicted = raw[0].copy()
        transformed = table.transformed(raw)
        changes = transformed[1:] - transformed[0]
        self.residual: FloatArray = table.measured - transformed[0]
        # By replicates' mean: each one's own would weigh those that came out low more than others.
        typical = table.test_means(np.abs(table.measured_raw))
        self.sensitivity = table.sensitivity(np.maximum(typical, np.abs(self.unpredicted)))
        facets, aside = _seen_otherwise(table, seen, sides, facet)
        self.unit_gains = unit_gains(table)
        self.strays = np.array([s.id in strays for s in campaign.specimens])
        self.apart = _levels_apart(campaign, model, ~self.strays)
        own = np.where(field, 0.0, (self.unit_gains + self.apart)[table.specimen])
        in_one_unit = table.transformed(table.measured_raw * np.exp(-own)) - transformed[0]
        names = [s.batch for s in campaign.specimens]
        batch_of = np.array([-1 if name is None else names.index(name) for name in names])
        features = NoisyFeatures(table, self.sensitivity, model.sensor_sd_N, batch_of)
        counts = ~self.strays[table.specimen]
        self.scatter = features.estimated_scatter(in_one_unit, aside, counts)
        self.noise = features.noise(self.scatter)
        chord = table.chord(self.unpredicted)
        members = table.specimen[:, None] == np.arange(len(campaign.specimens))
        self.chord: FloatArray = np.where(field, 0.0, chord)
        gains = self.chord[:, None] * members
        laws = calibration_columns(self.calibrations, changes[:count])
        bends = discrepancy_columns(campaign, table, self.sensitivity)
        camera = _field_columns(table, facets, aside, self.sensitivity)
        stray = _STRAY_SD * gains[:, self.strays]
        self.calibration = np.concatenate([laws, bends, camera, stray], axis=1)
        axes = axis_patterns(campaign, table, chord)
        self.unknown = _unknown_axes(axes, effects, self.own_axes)
        nuisances = np.concatenate([self.calibration, self.noise.batch], axis=1)
        self.of_laws = np.arange(nuisances.shape[1]) < count + bends.shape[1]
        self.of_laws[:count] = [one.kind == "tilt" for one in self.calibrations]
        patterns = np.concatenate([axis.columns for axis in self.unknown], axis=1)
        whiten = self.noise.whiten
        self.target, self.gains = whiten(self.residual), whiten(gains)
        self.nodes, self.patterns = whiten(changes[count:].T), whiten(patterns)
        self.nuisances = whiten(nuisances)
        self.discrepancy = whiten(_model_discrepancy(table, self.unpredicted))

    def predictions(
        self, candidates: Sequence[Candidate], like: Prediction | None = None
    ) -> list[Prediction]:
        """Return what the forward model predicts of candidates, gains of some specimens left out.

        Parameters
        ----------
        like
            Of a candidate much like these, which is faster; the palette alone by default.
        """
        model = self.model
        setups = (candidate.applied(model.setup) for candidate in candidates)
        return [predict(setup, model.laws, like=like or model.alone) for setup in setups]

    def changes(self, predictions: Sequence[Prediction]) -> FloatArray:
        """Return what predictions change of the palette's transformed features, (k, N)."""
        raw, table = np.stack([self.model.predicted(p) for p in predictions]), self.table
        return np.asarray(table.transformed(raw) - table.transformed(self.unpredicted))

    def gain_of(self, candidate: Candidate) -> FloatArray:
        """Return the whitened change by a candidate's gain of some specimens, (N,)."""
        return np.asarray(self.gains @ candidate.log_gains(len(self.strays)))

    def explained(self, candidate: Candidate) -> FloatArray:
        """Return what a candidate changes of the transformed features, (N,)."""
        change = candidate.log_gains(len(self.strays))[self.table.specimen] * self.chord
        if candidate.parts:
            change += self.changes(self.predictions([candidate]))[0]
        if candidate.own is not None:
            courses = np.stack([self.course_over_sizes(part) for part in candidate.differing])
            change = change + self.by_own_sizes(courses, *candidate.own_sizes(candidate.own))[0]
        return change

    def course_over_sizes(self, part: tuple[SignedForm, _Point]) -> FloatArray:
        """Return the course over its size of what an effect alone changes of features, (3, N)."""
        signed, (s, *rest) = part
        roots = np.sqrt(_OWN_SHARES / (1.0 - _OWN_SHARES)).tolist()
        sized = [joined([(signed, (s * root, *rest))]) for root in roots]
        return _OWN_COURSE @ self.changes(self.predictions(sized))

    def by_own_sizes(
        self, courses: FloatArray, sizes: FloatArray, slopes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the change by own sizes in place of the effects', (N,), and by each deviate.

        Parameters
        ----------
        courses : (m, 3, N)
            See `course_over_sizes`.
        sizes, slopes : (m, n)
            See `Candidate.own_sizes`.
        """
        of, power = self.table.specimen, np.arange(1, 4)[:, None]
        at = (sizes / (1.0 + sizes))[:, None, of]
        change = np.sum((at**power - 0.5**power) * courses, axis=(0, 1))
        by_size = np.sum(power * at ** (power - 1) * (1.0 - at) ** 2 * courses, axis=1)
        return change, by_size * slopes[:, of]

    def forces_N(self, candidate: Candidate) -> FloatArray:
        """Return predicted forces on each specimen's test's steps, (n, T)."""
        model = self.model
        forces = predict(candidate.applied(model.setup), model.laws).force_N[model.test_of]
        return np.asarray(forces * np.exp(candidate.log_gains(len(forces)))[:, None])

    def squared_errors(self, predicted: Candidate | FloatArray) -> FloatArray:
        """Return mean squared errors of force over `typical_peaks_N`, (n,).

        Parameters
        ----------
        predicted
            Forces, (n, T), or what they are predicted with; see `forces_N`.
        """
        if isinstance(predicted, Candidate):
            predicted = self.forces_N(predicted)
        off = (self.model.measured_N - predicted) / self.typical_peaks_N()
        return np.asarray(np.mean(off**2, axis=1))

    def typical_peaks_N(self) -> FloatArray:
        """Return the mean size of its replicates' largest forces, in each specimen's unit, (n, 1).

        Its own would hide that it is high, and double that it is low.
        """
        # As far as they are in one unit: a slip of the pen is no scatter.
        units = np.exp(self.unit_gains)[:, None]
        peaks = self.model.peaks_N / units
        typical = peaks.copy()
        for members in self.model.replicates:
            known = [k for k in members if not self.strays[k]]
            typical[list(members)] = peaks[known or list(members)].mean()
        return np.asarray(typical * units)

    def replicate_floor(self, known: Candidate | None = None) -> FloatArray | None:
        """Return what a prediction of a new specimen misses by, squared, (n,).

        None without replicates. What these differ by, and what they share as specimens of one
        batch. It is known from few replicates, so that an error may come out slightly below it. A
        gain of some specimens, of the candidate that is `known`, is no scatter.
        """
        curves = self.model.measured_N / self.typical_peaks_N()
        gain = (known or Candidate(())).log_gains(len(curves))
        floor = np.full(len(curves), np.nan)
        batches = [s.batch for s in self.campaign.specimens]
        for members in self.model.replicates:
            rows = np.array([k for k in members if not self.strays[k]])
            if len(rows) > 1:
                # Else each one's peak has it already.
                if np.ptp(gain[rows]) and not self.unit_gains[rows].any():
                    curves[rows] *= np.exp(-gain[rows])[:, None]
                away = curves[rows] - curves[rows].mean(axis=0)
                floor[rows] = len(rows) / (len(rows) - 1.0) * np.mean(away**2, axis=1)
                if len({batches[k] for k in rows}) == 1:
                    floor[rows] += self.scatter.batch**2 * np.mean(curves[rows] ** 2, axis=1)
        return None if np.isnan(floor).all() else floor
