"""A campaign made ready for weighing: every column that any hypothesis needs, whitened."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.campaign import Campaign
from planner.gap.effects.effect import Effect
from planner.gap.evidence.discrepancy import Factors, discrepancy_factors
from planner.gap.evidence.gram import Whitened, whiten
from planner.gap.evidence.nodes import Branch, branches_of
from planner.gap.evidence.unknown import UnknownAxis, claimed_axes, own_axes, unknown_axes
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.forward import Setup, predict_all
from planner.gap.forward.law_tables import LawTables
from planner.gap.forward.mount import Mounted
from planner.gap.noise import (
    Scatter,
    SpecimenNoise,
    calibration_columns,
    estimate_scatter,
    specimen_noise,
)
from planner.gap.noise.blocks import place_on_path
from planner.gap.noise.calibration import Calibration, calibrations, step
from planner.gap.noise.courses import course_columns, field_columns

__all__ = ["Problem", "Progress", "set_up"]

Progress = Callable[[int, int, str], None]
_FIELD = BRANCHES.index("field")


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
    mounted: Mounted
    branches: tuple[Branch, ...]
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
        return self.mounted.laws

    @property
    def table(self) -> FeatureTable:
        """The figures."""
        return self.mounted.table

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
    mounted: Mounted,
    effects: Sequence[Effect],
    progress: Progress | None = None,
) -> Problem:
    """Run the forward model at every node of every form, and whiten what comes out."""
    branches = branches_of(effects)
    ways = calibrations(campaign.palette, mounted.setup)
    setups: list[Setup] = [mounted.setup]
    setups += [way.applied(mounted.setup, step(way)) for way in ways]
    for branch in branches:
        setups += [branch.form.apply(mounted.setup, v) for v in branch.node_values()]
    table = mounted.table
    figures = np.empty((len(setups), len(table)))
    for k, prediction in enumerate(predict_all(setups, mounted.laws)):
        figures[k] = mounted.predicted(prediction)
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
    path = place_on_path(table, mounted.setup.time_s.shape[1] - 1)
    noise_inputs = (mounted.sensor_sd_N, batch_of, path)
    scatter = estimate_scatter(table, sensitivity, *noise_inputs)
    noise = specimen_noise(table, sensitivity, scatter, *noise_inputs)
    calibration = calibration_columns(ways, changes[: len(ways)], np.zeros(len(table)))
    courses = np.concatenate(
        [course_columns(campaign, table, sensitivity),
         field_columns(table, unpredicted, sensitivity)], axis=1,
    )  # fmt: skip
    calibration = np.concatenate([calibration, courses], axis=1)
    chord = table.chord(unpredicted)
    claimed, own = claimed_axes(effects), own_axes(effects)
    unknown = unknown_axes(campaign, table, chord, claimed, own)
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
        mounted=mounted,
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
        factors=discrepancy_factors(campaign, table),
        unknown=unknown,
        first_unknown=1 + len(changes) - len(ways) + gains.shape[1],
    )


def _batches(campaign: Campaign) -> IntArray:
    names = [s.batch for s in campaign.specimens]
    order = {name: k for k, name in enumerate(dict.fromkeys(n for n in names if n is not None))}
    return np.array([-1 if name is None else order[name] for name in names])
