"""How well a rate is predicted from the others: diagnose without it, then predict it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from planner.gap.campaign import Campaign, column_levels
from planner.gap.diagnosis import Diagnosis, FoundEffect
from planner.gap.effects import effects_for
from planner.gap.observations import ObservationModel
from planner.numerics import FloatArray
from planner.simulation.bar_solver import law_tables, predict

__all__ = ["LeftOutRate", "left_out_rates", "specimen_errors"]


@dataclass(frozen=True)
class LeftOutRate:
    """One rate, predicted from a diagnosis that has not seen it.

    Attributes
    ----------
    rate_mm_s
        Mean of its specimens'.
    verdict
        Of the other rates' specimens.
    before, after
        RMS error of force, of each specimen's largest: by the palette alone, and with that verdict.
    """

    rate_mm_s: float
    specimens: int
    verdict: str
    before: float
    after: float


def left_out_rates(
    campaign: Campaign, diagnosis_of: Callable[[Campaign], Diagnosis]
) -> Iterator[LeftOutRate]:
    """Yield every rate of a campaign, from the slowest."""
    rates = [s.rate_mm_s for s in campaign.specimens]
    level = column_levels("rate_mm_s", rates)
    before = specimen_errors(campaign, ())
    for out in range(len({k for k in level if k is not None})):
        kept = tuple(s for s, k in zip(campaign.specimens, level, strict=True) if k != out)
        if not kept:
            return
        found = diagnosis_of(replace(campaign, specimens=kept))
        after = specimen_errors(campaign, found.effect)
        mine = np.array([k == out for k in level]) & np.isfinite(before)
        if not mine.any():
            continue
        yield LeftOutRate(
            rate_mm_s=float(np.mean([r for r, k in zip(rates, level, strict=True) if k == out])),
            specimens=int(mine.sum()),
            verdict=found.verdict,
            before=float(np.sqrt(np.mean(before[mine]))),
            after=float(np.sqrt(np.mean(after[mine]))),
        )


def specimen_errors(campaign: Campaign, found: tuple[FoundEffect, ...]) -> FloatArray:
    """Return each specimen's mean squared error of force over its largest, NaN if not compared.

    Effects of some specimens only say nothing of others and are left out.
    """
    mounted = ObservationModel(campaign)
    effects = effects_for(campaign.palette)
    setup = mounted.setup
    acting = [one for one in found if not one.specimens]
    for one in sorted(acting, key=lambda f: effects[f.id].order):
        form = next(form for form in effects[one.id].forms if form.name == one.form)
        setup = form.apply(setup, one.parameters)
    force = predict(setup, law_tables(campaign.palette)).force_N[mounted.test_of]
    peak = np.max(np.abs(mounted.measured_N), axis=1, keepdims=True)
    error: FloatArray = np.mean(((mounted.measured_N - force) / peak) ** 2, axis=1)
    return np.where(mounted.test_of >= 0, error, np.nan)
