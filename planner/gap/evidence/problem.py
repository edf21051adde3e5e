"""A campaign made ready for weighing: every column that any hypothesis needs, whitened."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.gap.camera import SIDES
from planner.gap.campaign import TOLERANCES, Campaign, axis_columns, levels
from planner.gap.effect import Effect, Stage
from planner.gap.evidence.surrogate import Candidate, SignedForm, Whitened, signed_forms
from planner.gap.noise import (
    Calibration,
    Scatter,
    SpecimenNoise,
    calibration_columns,
    calibrations,
    discrepancy_columns,
    estimate_scatter,
    field_columns,
    likeliest_facet,
    likeliest_sides,
    seen_otherwise,
    specimen_noise,
)
from planner.gap.observations import BRANCHES, FeatureTable, ObservationModel
from planner.numerics import FloatArray, IntArray
from planner.simulation.bar_solver import Setup, predict, predict_all

__all__ = ["AMPLITUDES", "Problem", "applied", "own_axes", "set_up", "specimen_forces_N"]


# ------------------------------------------------------------------------------------------------
# No form is exact: by how much a real effect may depart from one that is named rightly.
#
# Whatever a form changes, it may change some more on one branch of the path, at one level of a
# covariate, in one material. Without this, what a strong effect's form leaves would be
# taken for a second effect.
#
# What belongs to the test (geometry, boundary, sensor) departs along the path alone: grips do not
# know how warm it is. A form that could depart at every level of every covariate would explain
# anything, if only it is large enough.


_SD = 0.15
"""Of an effect's size from branch to branch and from level to level."""

_MATERIAL_SD = 0.40
"""Of its size from material to material: how effects go with the mixture is hardly known."""

_SHAPE_SD = 0.45
"""Of its change from the beginning of a path to its end."""

_TEST_SD = 0.06
"""Of its size from test to test and branch to branch, whatever they are."""


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """What multiplies an effect's change of the features, of prior deviation 1.

    Attributes
    ----------
    path : (N, k)
        Along each test's path.
    conditions : (N, m)
        From condition to condition, material to material.
    """

    path: FloatArray
    conditions: FloatArray

    def of(self, stage: Stage) -> FloatArray:
        """Return those of an effect of a stage."""
        if stage in ("composition", "law"):
            return np.concatenate([self.path, self.conditions], axis=1)
        return self.path


def _discrepancy_factors(campaign: Campaign, table: FeatureTable) -> Factors:
    """Return what any effect's form may depart by in a campaign."""
    specimens = campaign.specimens
    branch = table.branch[:, None] == np.arange(len(BRANCHES))
    travel = 2.0 * _share_of_peak(table) - 1.0
    path = [_SD * branch, _SHAPE_SD * travel[:, None] * branch]
    path.append(_SHAPE_SD * (2.0 * travel[:, None] ** 2 - 1.0))
    hold = branch[:, [BRANCHES.index("hold")]]
    if hold.any():
        decades = np.log10(np.maximum(table.time_s, 0.1) / 10.0)[:, None]
        path += [_SHAPE_SD * hold * decades, _SHAPE_SD * hold * (decades**2 - 0.5)]
    for test in np.unique(table.test).tolist():
        of_test = branch & (table.test == test)[:, None]
        path.append(_TEST_SD * of_test[:, of_test.any(axis=0)])
    cells: list[tuple[float, Sequence[object]]] = [
        (_SD, levels([getattr(s, name) for s in specimens], *tolerance))
        for name, tolerance in TOLERANCES.items()
        if name != "gauge_mm"
    ]
    pieces = [s.material if s.profile is None else s.profile.name for s in specimens]
    cells += [(_MATERIAL_SD, pieces), (_SD, [s.orientation for s in specimens])]
    conditions = [np.zeros((len(table), 0))]
    for sd, cell in cells:
        indicators = _indicators(cell, list(dict.fromkeys(cell)))
        if 1 < indicators.shape[1] <= 8:
            conditions.append(sd * indicators[table.specimen])
    return Factors(np.concatenate(path, axis=1), np.concatenate(conditions, axis=1))


def _share_of_peak(table: FeatureTable) -> FloatArray:
    """Return each feature's strain over the largest of its specimen, (N,)."""
    peak = np.zeros(int(table.specimen.max()) + 1)
    np.maximum.at(peak, table.specimen, table.strain)
    share: FloatArray = table.strain / np.maximum(peak[table.specimen], 1e-12)
    return share


def _indicators(cells: Sequence[object], values: Sequence[object]) -> FloatArray:
    """Return 1 where a cell is a value and 0 elsewhere, (cells, values)."""
    return np.array([[float(cell == value) for value in values] for cell in cells])


# ------------------------------------------------------------------------------------------------
# What no effect explains: broad patterns over every axis along which a gap may lie.
#
# One axis at a time, each with its amplitude integrated over, beside the uncertain base laws: a
# pattern that those already cover gains nothing.


AMPLITUDES = (0.03, 0.1, 0.3, 0.9)
"""Standard deviations of an unknown pattern, of the logarithm of force."""

_ANY = "any"
"""All axes at once that effects claim: what is left when the right effect is not in the library."""

_CURVED = 0.4
"""Size of a pattern that bends or steps along a column, relative to a straight one's."""

_CHANGING = 0.4
"""Size of what changes along a path, relative to what multiplies the whole of it."""


@dataclass(frozen=True, slots=True, eq=False)
class UnknownAxis:
    """Patterns along one axis, (N, k): together of mean square 1 over the features."""

    axis: str
    columns: FloatArray
    claimed: bool


def _unknown_axes(
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
        Those that are an effect's own covariate, free patterns along which count for it.
    """
    h = np.where(table.is_field, 0.0, sensitivity)
    travel = _share_of_peak(table) - 0.5
    columns = axis_columns(campaign)
    found = []
    for name in (*TOLERANCES, "orientation", "batch", *campaign.covariates):
        patterns = _specimen_patterns(columns[name])
        if patterns is not None:
            rows = patterns[table.specimen]
            changing = _CHANGING * 2.0 * h * travel
            found.append((name, [rows * h[:, None], rows * changing[:, None]]))
    strain = np.minimum(table.strain, 1.0)
    bumps = [np.exp(-strain / 0.03), np.exp(-strain / 0.12), strain / 0.3]
    found.append(("strain", [(h * bump)[:, None] for bump in bumps]))
    level_and_slope = np.stack([h, h * travel], axis=1)
    branches = [
        level_and_slope * (table.branch == k)[:, None]
        for k, name in enumerate(BRANCHES)
        if name not in ("loading", "field") and (table.branch == k).any()
    ]
    found.append(("branch", branches))
    names = [s.material for s in campaign.specimens]
    materials = _indicators(names, [n for n in dict.fromkeys(names) if n is not None])
    if materials.shape[1] > 1:
        of_each = materials[table.specimen].T
        found.append(("material", [level_and_slope * of_it[:, None] for of_it in of_each]))
    found.append(("position", _position_patterns(campaign, table, sensitivity)))
    axes = [_axis(name, np.concatenate(p, axis=1), claimed) for name, p in found if p]
    axes = [axis for axis in axes if axis.columns.shape[1]]
    known = [axis.columns for axis in axes if axis.claimed and axis.axis not in own]
    if len(known) > 1:
        axes.append(UnknownAxis(_ANY, np.concatenate(known, axis=1), True))
    return tuple(axes)


def own_axes(effects: Sequence[Effect]) -> dict[str, str]:
    """Return, of each axis that is an effect's own covariate, that effect's id."""
    return {name: e.id for e in effects for entry in e.covariates for name in entry.split("|")}


def _claimed_axes(effects: Sequence[Effect]) -> frozenset[str]:
    """Return the axes along which effects vary."""
    return frozenset(own_axes(effects)).union(*[e.where for e in effects])


def _axis(name: str, columns: FloatArray, claimed: Collection[str]) -> UnknownAxis:
    columns = columns[:, np.any(columns != 0.0, axis=0)]
    touched = np.any(columns != 0.0, axis=1)
    scale = np.sqrt(np.sum(columns**2) / max(int(touched.sum()), 1))
    return UnknownAxis(name, columns / max(float(scale), 1e-12), name in claimed)


def _specimen_patterns(cells: Sequence[str | float | None]) -> FloatArray | None:
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
        bend, leap = 1.5 * t * t - 0.5, np.sign(t) * (np.abs(t) > 0.05)
        patterns = np.stack([t, _CURVED * bend, _CURVED * leap], axis=1)
    elif len(distinct) <= max(2, len(values) // 2):
        patterns = _indicators(cells, distinct)
    else:
        return None
    centred: FloatArray = (patterns - patterns[known].mean(axis=0)) * known[:, None]
    return centred


def _position_patterns(
    campaign: Campaign, table: FeatureTable, sensitivity: FloatArray
) -> list[FloatArray]:
    """Return smooth patterns along each design's bars, of local strains."""
    patterns = []
    for test in np.unique(table.test[table.is_field]).tolist():
        of_test = table.is_field & (table.test == test)
        gauge = campaign.specimens[int(table.specimen[of_test][0])].gauge_mm
        u = np.where(of_test, table.x_mm, 0.0) / gauge
        waves = np.cos(np.pi * np.outer(u, np.arange(1, 5)))
        patterns.append((sensitivity * of_test)[:, None] * waves)
    return patterns


# ------------------------------------------------------------------------------------------------
# A campaign made ready for weighing: every column that any hypothesis needs, whitened.


_Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A campaign made ready for weighing.

    Attributes
    ----------
    unpredicted : (N,)
        Raw features that the palette alone predicts.
    residual : (N,)
        Measured less predicted, transformed.
    node_features : (nodes, N)
        Change of the transformed features at each node.
    calibration : (N, q)
        What the palette's laws and a camera may be off by, of prior deviation 1; `ways` first.
    whitened
        The residual, nodes, the specimens' own gains, unknown patterns, then nuisances.
    factors
        What an effect's form may depart by.
    """

    campaign: Campaign
    model: ObservationModel
    branches: tuple[SignedForm, ...]
    scatter: Scatter
    noise: SpecimenNoise
    ways: tuple[Calibration, ...]
    unpredicted: FloatArray
    sensitivity: FloatArray
    residual: FloatArray
    node_features: FloatArray
    calibration: FloatArray
    whitened: Whitened
    factors: Factors
    unknown: tuple[UnknownAxis, ...]

    @property
    def table(self) -> FeatureTable:
        """The features."""
        return self.model.table

    @property
    def nodes(self) -> slice:
        """Columns of the nodes."""
        return slice(1, 1 + len(self.node_features))

    @property
    def gains(self) -> slice:
        """Columns of the specimens' own gains."""
        return slice(self.nodes.stop, self.nodes.stop + len(self.campaign.specimens))

    def unknown_columns(self, number: int) -> slice:
        """Return the columns of an axis of the unknown."""
        first = self.gains.stop + sum(a.columns.shape[1] for a in self.unknown[:number])
        return slice(first, first + self.unknown[number].columns.shape[1])

    def combination(self, candidate: Candidate) -> FloatArray:
        """Return a candidate's change as weights of residual, nodes and gains; of the first 0."""
        gains = np.zeros(len(self.campaign.specimens))
        if candidate.members is not None:
            gains = candidate.log_gain * candidate.members
        nodes = candidate.combination(len(self.node_features))
        return np.concatenate([[0.0], nodes, gains])

    def nuisances_beside(self, candidate: Candidate) -> tuple[FloatArray, FloatArray]:
        """Return the nuisances' posterior mean and covariance, the candidate being right."""
        j = self.whitened.nuisance_columns
        head = self.whitened.columns[:, : self.gains.stop]
        left = head[:, 0] - head @ self.combination(candidate)
        covariance = np.asarray(np.linalg.inv(j.T @ j + np.eye(j.shape[1])), dtype=np.float64)
        return covariance @ (j.T @ left), covariance

    def departures(self, candidate: Candidate) -> tuple[FloatArray, int, IntArray]:
        """Return what a candidate may depart by at its place.

        Returns
        -------
        columns : (N, k)
            Whitened patterns of prior deviation 1.
        own
            How many of them, the first ones, are of specimens' own sizes.
        branch : (k,)
            Which of the candidate's branches each belongs to: it grows as that one's size.
        """
        table = self.table
        specimens = table.specimen[:, None] == np.unique(table.specimen)
        own, form = [], []
        for k, (branch, weights) in enumerate(
            zip(candidate.branches, candidate.node_weights(), strict=True)
        ):
            change = (weights @ self.node_features[branch.own])[:, None]
            form.append((k, change * self.factors.of(branch.effect.stage)))
            if branch.effect.individual > 0.0:
                own.append((k, branch.effect.individual * change * specimens))
        columns = np.concatenate([part for _, part in (*own, *form)], axis=1)
        of = np.concatenate([np.full(part.shape[1], k) for k, part in (*own, *form)])
        return self.noise.whiten(columns), sum(part.shape[1] for _, part in own), of


def set_up(
    campaign: Campaign,
    model: ObservationModel,
    effects: Sequence[Effect],
    progress: _Progress | None = None,
) -> Problem:
    """Run the forward model at every node of every form, and whiten what comes out."""
    branches = signed_forms(effects)
    ways = calibrations(campaign.palette, model.setup)
    setups = [model.setup, *(way.applied(model.setup) for way in ways)]
    for branch in branches:
        setups += [branch.form.apply(model.setup, branch.values(p)) for p in branch.node_places()]
    table = model.table
    raw = np.empty((len(setups), len(table)))
    field, weights = table.is_field, model.field_weights
    seen = np.zeros((*weights.weight.shape[:2], int(field.sum())))
    sides = np.zeros((len(seen), seen.shape[2]), dtype=np.int64)
    likely = weights.weight[:, len(SIDES) // 2]
    strains = np.zeros((len(setups), *sides.shape))
    for k, prediction in enumerate(predict_all(setups, model.laws)):
        raw[k] = prediction.force_N[table.test, table.step]
        if field.any():
            if k == 0:
                seen = model.seen(prediction, weights.weight)
                sides = likeliest_sides(table, seen)
                likely = weights.at_sides(sides)
            strains[k] = model.seen(prediction, likely)
        if progress is not None and k % 20 == 0:
            progress(k, len(setups), "forward model")
    facet = likeliest_facet(table, strains)
    model = replace(model, weight=likely[facet])
    raw[:, field] = strains[:, facet]
    unpredicted = raw[0].copy()
    transformed = table.transformed(raw)
    changes = transformed[1:] - transformed[0]
    residual = table.measured - transformed[0]
    sensitivity = table.sensitivity(
        np.where(np.abs(table.measured_raw) > np.abs(unpredicted), table.measured_raw, unpredicted)
    )
    noise_inputs = (model.sensor_sd_N, _batches(campaign))
    facets, aside = seen_otherwise(table, seen, sides, facet)
    scatter = estimate_scatter(table, sensitivity, *noise_inputs, residual, aside)
    noise = specimen_noise(table, sensitivity, scatter, *noise_inputs)
    calibration = np.concatenate(
        [
            calibration_columns(ways, changes[: len(ways)], np.zeros(len(table))),
            discrepancy_columns(campaign, table, sensitivity),
            field_columns(table, facets, aside, sensitivity),
        ],
        axis=1,
    )
    chord = table.chord(unpredicted)
    unknown = _unknown_axes(campaign, table, chord, _claimed_axes(effects), own_axes(effects))
    gains = np.where(table.is_field, 0.0, chord)[:, None] * (
        table.specimen[:, None] == np.arange(len(campaign.specimens))
    )
    columns = np.concatenate(
        [residual[:, None], changes[len(ways) :].T, gains, *[a.columns for a in unknown],
         calibration, noise.batch],
        axis=1,
    )  # fmt: skip
    nuisances = calibration.shape[1] + noise.batch.shape[1]
    return Problem(
        campaign=campaign,
        model=model,
        branches=branches,
        scatter=scatter,
        noise=noise,
        ways=ways,
        unpredicted=unpredicted,
        sensitivity=sensitivity,
        residual=residual,
        node_features=changes[len(ways) :],
        calibration=calibration,
        whitened=Whitened(noise.whiten(columns), noise.first_row, nuisances),
        factors=_discrepancy_factors(campaign, table),
        unknown=unknown,
    )


def _batches(campaign: Campaign) -> IntArray:
    """Return the number of each specimen's batch, in order of appearance, -1 where unknown."""
    names = [s.batch for s in campaign.specimens]
    order = [name for name in dict.fromkeys(names) if name is not None]
    return np.array([-1 if name is None else order.index(name) for name in names])


# ------------------------------------------------------------------------------------------------
# A setup with a candidate's effects, and the force that each specimen would then show.


def applied(candidate: Candidate, setup: Setup) -> Setup:
    """Return a setup with the candidate's effects, each at its stage.

    What holds for some specimens only is left to `specimen_forces_N`.
    """
    for branch, values in sorted(candidate.values(), key=lambda item: item[0].effect.order):
        setup = branch.form.apply(setup, values)
    return setup


def specimen_forces_N(problem: Problem, candidate: Candidate, setup: Setup) -> FloatArray:
    """Return predicted forces on each specimen's test's steps, (n, T).

    Parameters
    ----------
    setup
        Without the candidate's effects.
    """
    model = problem.model
    forces: FloatArray = predict(applied(candidate, setup), model.laws).force_N[model.test_of]
    if candidate.members is not None:
        forces = forces * np.exp(candidate.log_gain * candidate.members)[:, None]
    return forces
