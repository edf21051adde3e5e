"""What the diagnosis of a campaign says: where, which, how far, and what next."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planner.arrays import FloatArray

__all__ = [
    "Detectable",
    "Diagnosis",
    "Experiment",
    "FoundEffect",
    "Gap",
    "Hypothesis",
    "Place",
    "Quality",
    "Traces",
    "Untestable",
]

Effects = tuple[str, ...]
"""Effect ids, sorted; () stands for "none", ("unknown",) for what no effect explains."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A set of effects and its probability.

    `with_unknown` is the share of that probability, 0 to 1, that needs something unknown besides.
    """

    effects: Effects
    probability: float
    with_unknown: float = 0.0


@dataclass(frozen=True, slots=True)
class Place:
    """One axis along which the gap varies: its share of the excess variance.

    Attributes
    ----------
    p
        Family-wise, against replicate noise.
    """

    axis: str
    share: float
    share_interval: tuple[float, float]
    p: float
    detail: str


@dataclass(frozen=True, slots=True)
class Gap:
    """Normalised RMS errors of force on held-out conditions; None where it cannot be known.

    Attributes
    ----------
    closed
        ``1 - (after - floor) / (before - floor)``.
    recalibration_only, generic
        Errors after refitting the base laws alone, and after a generic regressor.
    held_out
        What was left out at a time, in words.
    extrapolated_before, extrapolated
        Errors before and after, where whole levels of a column, such as the warmest, were left out.
    negative_transfer
        Whether the effect makes held-out conditions worse.
    """

    before: float
    after: float | None
    floor: float | None
    closed: float | None
    closed_interval: tuple[float, float] | None
    recalibration_only: float | None
    generic: float | None
    held_out: str
    extrapolated_before: float | None = None
    extrapolated: float | None = None
    negative_transfer: bool = False


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """One effect of the verdict: its form's parameters and their 90 % intervals."""

    id: str
    form: str
    parameters: Mapping[str, float]
    interval: Mapping[str, tuple[float, float]]
    units: Mapping[str, str]
    specimens: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Untestable:
    """An effect that this campaign says nothing about, and why."""

    id: str
    reason: str


@dataclass(frozen=True, slots=True)
class Detectable:
    """The smallest size of an effect that would have been seen; None if none within its bounds."""

    id: str
    parameter: str
    size: float | None
    unit: str


@dataclass(frozen=True, slots=True)
class Quality:
    """Something wrong with the data; `specimen` None means the whole campaign."""

    specimen: str | None
    kind: str
    problem: str


@dataclass(frozen=True, slots=True)
class Experiment:
    """A test worth doing: what to change from the reference, and which hypotheses it splits."""

    change: Mapping[str, Any]
    splits: tuple[tuple[str, str], ...]
    expected_gain_nats: float
    hours: float
    detail: str


@dataclass(frozen=True, slots=True, eq=False)
class Traces:
    """Curves and residuals to draw, a test a row; NaN where there is nothing.

    Attributes
    ----------
    label : (P,)
        Of the test: material or design and what differs from the reference.
    specimen_ids
        The specimens of each test.
    travel_mm, time_s, before_N, after_N : (P, T)
        Predicted by the palette alone, and with the verdict's effects.
    measured_N : (n, T)
        Of each specimen, in the campaign's order, on its test's steps.
    residual_before, residual_after : (n,)
        Mean relative error of force of each specimen, positive where it bears more than predicted.
    specimens : (n,)
        Their ids in the campaign's order.
    columns
        By axis, what each specimen has there, None where it is unknown; see `axis_columns`.
    """

    label: tuple[str, ...]
    specimen_ids: tuple[tuple[str, ...], ...]
    travel_mm: FloatArray
    time_s: FloatArray
    before_N: FloatArray
    after_N: FloatArray
    measured_N: FloatArray
    residual_before: FloatArray = field(default_factory=lambda: np.zeros(0))
    residual_after: FloatArray = field(default_factory=lambda: np.zeros(0))
    specimens: tuple[str, ...] = ()
    columns: Mapping[str, tuple[float | str | None, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The diagnosis of one campaign.

    Attributes
    ----------
    verdict
        An effect id, "a+b", "none" or "unknown".
    ranking
        Most probable first; probabilities sum to 1 over all hypotheses weighed, of which the
        least are left out.
    same_class
        Hypotheses that the data cannot tell from the verdict, the verdict included.
    remainder
        Where a gap remains after the verdict's effects, significant places only.
    recalibration
        By material: the factor on its law's stress that the data ask for beside the effects, as a
        logarithm, with its standard deviation.
    """

    campaign: str
    palette: str
    palette_sha256: str
    specimens: int
    tests: int
    verdict: str
    ranking: tuple[Hypothesis, ...]
    same_class: tuple[Effects, ...]
    not_testable: tuple[Untestable, ...]
    where: tuple[Place, ...]
    gap: Gap
    effect: tuple[FoundEffect, ...]
    remainder: tuple[Place, ...]
    data_quality: tuple[Quality, ...]
    next_experiments: tuple[Experiment, ...]
    detectable: tuple[Detectable, ...]
    limitations: tuple[str, ...]
    recalibration: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    seed: int = 0
    traces: Traces | None = None

    @property
    def ok(self) -> bool:
        """Whether no gap was found: nothing to explain, and nothing that remains."""
        return self.verdict == "none" and not self.remainder
