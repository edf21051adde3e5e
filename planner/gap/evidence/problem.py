"""A campaign made ready for weighing: every column that any hypothesis needs, whitened."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from planner.gap.campaign import TOLERANCES, Campaign, Specimen, levels
from planner.gap.effect import Effect, Stage
from planner.gap.evidence.surrogate import (
    Candidate,
    SignedForm,
    Whitened,
    node_weights,
    signed_forms,
    whiten,
)
from planner.gap.noise import (
    Calibration,
    Scatter,
    SpecimenNoise,
    calibration_columns,
    calibrations,
    discrepancy_columns,
    estimate_scatter,
    field_columns,
    place_on_path,
    specimen_noise,
    step,
)
from planner.gap.observations import BRANCHES, FeatureTable, ObservationModel
from planner.numerics import FloatArray, IntArray
from planner.simulation.bar_solver import LawTables, Setup, predict, predict_all

__all__ = [
    "AMPLITUDES",
    "Problem",
    "applied",
    "departures",
    "own_axes",
    "set_up",
    "specimen_forces_N",
]


# ------------------------------------------------------------------------------------------------
# No form is exact: by how much a real effect may depart from one that is named rightly.
#
# Whatever a form changes, it may change some more on one branch of the path, at one level of a
# covariate, in one material. Without this, the least misfit of a strong effect's form would be
# taken for a second effect.
#
# What belongs to the test (geometry, boundary, sensor) departs along the path alone: grips do not
# know how warm it is. A form that could depart at every level of every covariate would explain
# anything, if only it is large enough.


_SD = 0.15
"""Of an effect's size from branch to branch and from level to level."""

_MATERIAL_SD = 0.40
"""Of its size from material to material: how effects go with the mixture is hardly known."""

SHAPE_SD = 0.45
"""Of its change from the beginning of a path to its end."""

_TEST_SD = 0.06
"""Of its size from test to test and branch to branch, whatever they are."""


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """What multiplies an effect's change of the figures, of prior deviation 1.

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
    path: list[FloatArray] = [_SD * (table.branch == k) for k in range(len(BRANCHES))]
    peak = np.zeros(len(specimens))
    np.maximum.at(peak, table.specimen, table.strain)
    travel = 2.0 * table.strain / np.maximum(peak[table.specimen], 1e-12) - 1.0
    path += [SHAPE_SD * travel * (table.branch == k) for k in range(len(BRANCHES))]
    path.append(SHAPE_SD * (2.0 * travel**2 - 1.0))
    hold = table.branch == BRANCHES.index("hold")
    if hold.any():
        decades = np.log10(np.maximum(table.time_s, 0.1) / 10.0)
        path += [SHAPE_SD * hold * decades, SHAPE_SD * hold * (decades**2 - 0.5)]
    for test in np.unique(table.test).tolist():
        of_test = table.test == test
        path += [
            _TEST_SD * (of_test & (table.branch == k))
            for k in np.unique(table.branch[of_test]).tolist()
        ]
    cells: list[tuple[float, Sequence[object]]] = [
        (_SD, levels([getattr(s, name) for s in specimens], *tolerance))
        for name, tolerance in TOLERANCES.items()
        if name != "gauge_mm"
    ]
    pieces = [s.material if s.profile is None else s.profile.name for s in specimens]
    cells += [(_MATERIAL_SD, pieces), (_SD, [s.orientation for s in specimens])]
    conditions: list[FloatArray] = []
    for sd, cell in cells:
        distinct = list(dict.fromkeys(cell))
        if 1 < len(distinct) <= 8:
            for value in distinct:
                of_it = np.array([c == value for c in cell])
                conditions.append(sd * of_it[table.specimen])
    none = np.zeros((len(table), 0))
    return Factors(np.stack(path, axis=1), np.stack(conditions, axis=1) if conditions else none)


@dataclass(frozen=True, slots=True, eq=False)
class Departures:
    """Whitened patterns of prior deviation 1, at a candidate's place.

    Attributes
    ----------
    columns : (N, k)
        Those of specimens' own sizes first, then what forms may depart by.
    own
        How many are of specimens' own sizes.
    branch : (k,)
        Which of the candidate's branches each belongs to: it grows as that one's size.
    """

    columns: FloatArray
    own: int
    branch: IntArray


def departures(
    candidate: Candidate,
    node_figures: FloatArray,
    factors: Factors,
    noise: SpecimenNoise,
    table: FeatureTable,
) -> Departures:
    """Return what a candidate may depart by."""
    own, form = [], []
    of_own, of_form = [], []
    for k, (branch, place) in enumerate(zip(candidate.branches, candidate.places, strict=True)):
        nodes = slice(branch.first, branch.first + branch.nodes)
        change = (node_weights(branch, place) @ node_figures[nodes])[:, None]
        form.append(change * factors.of(branch.effect.stage))
        of_form.append(np.full(form[-1].shape[1], k))
        cv = branch.effect.individual
        if cv > 0.0:
            own.append(cv * change * (table.specimen[:, None] == np.unique(table.specimen)))
            of_own.append(np.full(own[-1].shape[1], k))
    columns = np.concatenate([*own, *form], axis=1)
    white = np.empty_like(columns)
    for rows, factor in zip(noise.rows, noise.factors, strict=True):
        white[rows] = scipy.linalg.solve_triangular(
            factor, columns[rows], lower=True, check_finite=False
        )
    count = sum(part.shape[1] for part in own)
    return Departures(white, count, np.concatenate([*of_own, *of_form]).astype(np.int64))


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
"""Size of a course that bends or steps along a column, relative to a straight one's."""

_CHANGING = 0.4
"""Size of what changes along a path, relative to what multiplies the whole of it."""

_FIELD = BRANCHES.index("field")
_LOADING = BRANCHES.index("loading")


@dataclass(frozen=True, slots=True, eq=False)
class UnknownAxis:
    """Patterns along one axis, (N, k): together of mean square 1 over the figures."""

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
        Those that are an effect's own covariate, free courses along which count for it.
    """
    specimens = campaign.specimens
    force = table.branch != _FIELD
    h = np.where(force, sensitivity, 0.0)
    peak = np.zeros(len(specimens))
    np.maximum.at(peak, table.specimen, table.strain)
    travel = table.strain / np.maximum(peak[table.specimen], 1e-12) - 0.5
    found = []
    for name in (*TOLERANCES, "orientation", "batch", *campaign.covariates):
        patterns = _specimen_patterns([_cell(s, name) for s in specimens])
        if patterns is None:
            continue
        rows = patterns[table.specimen]
        changing = _CHANGING * 2.0 * h * travel
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
        found.append(UnknownAxis(_ANY, np.concatenate(known, axis=1), True))
    return tuple(found)


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
        patterns = np.stack([t, _CURVED * bend, _CURVED * leap], axis=1)
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


# ------------------------------------------------------------------------------------------------
# A campaign made ready for weighing: every column that any hypothesis needs, whitened.


_Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Columns: the residual, nodes, the specimens' own gains, unknown patterns, then nuisances.

    Attributes
    ----------
    unpredicted : (N,)
        Raw figures that the palette alone predicts.
    residual : (N,)
        Measured less predicted, transformed.
    node_figures : (nodes, N)
        Change of the transformed figures at each node.
    calibration_figures : (q, N)
        Columns of the laws' calibration.
    factors
        What an effect's form may depart by.
    """

    campaign: Campaign
    observed: ObservationModel
    branches: tuple[SignedForm, ...]
    scatter: Scatter
    noise: SpecimenNoise
    ways: tuple[Calibration, ...]
    unpredicted: FloatArray
    sensitivity: FloatArray
    residual: FloatArray
    node_figures: FloatArray
    calibration_figures: FloatArray
    whitened: Whitened
    factors: Factors
    unknown: tuple[UnknownAxis, ...]
    first_unknown: int

    @property
    def laws(self) -> LawTables:
        """The palette's laws."""
        return self.observed.laws

    @property
    def table(self) -> FeatureTable:
        """The figures."""
        return self.observed.table

    @property
    def nodes(self) -> slice:
        """Columns of the nodes."""
        return slice(1, 1 + len(self.node_figures))

    @property
    def gains(self) -> slice:
        """Columns of the specimens' own gains."""
        return slice(1 + len(self.node_figures), self.first_unknown)

    def unknown_columns(self, number: int) -> slice:
        """Return the columns of an axis of the unknown."""
        first = self.first_unknown + sum(a.columns.shape[1] for a in self.unknown[:number])
        return slice(first, first + self.unknown[number].columns.shape[1])

    @property
    def firsts(self) -> IntArray:
        """First node of each branch."""
        return np.array([b.first for b in self.branches])

    @property
    def shapes(self) -> IntArray:
        """Number of shape parameters of each branch."""
        return np.array([b.shapes for b in self.branches])

    @property
    def lows(self) -> FloatArray:
        """Smallest place of each branch."""
        return np.array([b.least for b in self.branches])


def set_up(
    campaign: Campaign,
    observed: ObservationModel,
    effects: Sequence[Effect],
    progress: _Progress | None = None,
) -> Problem:
    """Run the forward model at every node of every form, and whiten what comes out."""
    branches = signed_forms(effects)
    ways = calibrations(campaign.palette, observed.setup)
    setups: list[Setup] = [observed.setup]
    setups += [way.applied(observed.setup, step(way)) for way in ways]
    for branch in branches:
        setups += [branch.form.apply(observed.setup, v) for v in branch.node_values()]
    table = observed.table
    figures = np.empty((len(setups), len(table)))
    for k, prediction in enumerate(predict_all(setups, observed.laws)):
        figures[k] = observed.predicted(prediction)
        if progress is not None and k % 20 == 0:
            progress(k, len(setups), "forward model")
    unpredicted = figures[0].copy()
    transformed = table.transformed(figures)
    changes = transformed[1:] - transformed[0]
    residual = table.measured - transformed[0]
    sensitivity = table.sensitivity(
        np.where(np.abs(table.measured_raw) > np.abs(unpredicted), table.measured_raw, unpredicted)
    )
    batch_of = _batches(campaign)
    path = place_on_path(table, observed.setup.time_s.shape[1] - 1)
    noise_inputs = (observed.sensor_sd_N, batch_of, path)
    scatter = estimate_scatter(table, sensitivity, *noise_inputs)
    noise = specimen_noise(table, sensitivity, scatter, *noise_inputs)
    calibration = calibration_columns(ways, changes[: len(ways)], np.zeros(len(table)))
    courses = np.concatenate(
        [discrepancy_columns(campaign, table, sensitivity),
         field_columns(table, unpredicted, sensitivity)], axis=1,
    )  # fmt: skip
    calibration = np.concatenate([calibration, courses], axis=1)
    chord = table.chord(unpredicted)
    claimed, own = _claimed_axes(effects), own_axes(effects)
    unknown = _unknown_axes(campaign, table, chord, claimed, own)
    gains = np.where(table.branch != _FIELD, chord, 0.0)[:, None] * (
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
        observed=observed,
        branches=branches,
        scatter=scatter,
        noise=noise,
        ways=ways,
        unpredicted=unpredicted,
        sensitivity=sensitivity,
        residual=residual,
        node_figures=changes[len(ways) :],
        calibration_figures=calibration.T,
        whitened=whiten(columns, noise, nuisances),
        factors=_discrepancy_factors(campaign, table),
        unknown=unknown,
        first_unknown=1 + len(changes) - len(ways) + gains.shape[1],
    )


def _batches(campaign: Campaign) -> IntArray:
    names = [s.batch for s in campaign.specimens]
    order = {name: k for k, name in enumerate(dict.fromkeys(n for n in names if n is not None))}
    return np.array([-1 if name is None else order[name] for name in names])


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
    force = predict(applied(candidate, setup), problem.laws).force_N
    observed = problem.observed
    rows = [0] * len(problem.campaign.specimens)
    for test, members in enumerate(observed.tests):
        for place in members:
            rows[place] = test
    forces: FloatArray = force[rows]
    if candidate.members is not None:
        factor = 1.0 + candidate.members * (2.718281828459045**candidate.log_gain - 1.0)
        forces = forces * factor[:, None]
    return forces
