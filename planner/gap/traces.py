"""Curves to draw: what was predicted before and after, and what was measured."""

import numpy as np

from planner.gap.axis_columns import axis_columns
from planner.gap.diagnosis import Traces
from planner.gap.evidence.applied import applied, specimen_forces_N
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.problem import Problem
from planner.gap.forward import predict
from planner.gap.specimen import Specimen

__all__ = ["traces_of"]

_NAMED = (
    ("rate_mm_s", "{:g} mm/s"),
    ("temperature_C", "{:g} °C"),
    ("soak_h", "{:g} h soaked"),
    ("age_days", "{:g} d old"),
)


def traces_of(problem: Problem, chosen: Candidate) -> Traces:
    """Return the traces of a campaign and its verdict's candidate."""
    mounted, specimens = problem.mounted, problem.campaign.specimens
    setup = mounted.setup
    measured = mounted.measured_N
    peak = np.maximum(np.abs(measured).max(axis=1), 1e-12)
    before = specimen_forces_N(problem, Candidate(()), setup)
    after = specimen_forces_N(problem, chosen, setup)
    return Traces(
        label=tuple(_label(specimens[members[0]], specimens) for members in mounted.tests),
        specimen_ids=tuple(tuple(specimens[i].id for i in m) for m in mounted.tests),
        travel_mm=setup.travel_mm,
        time_s=setup.time_s,
        before_N=predict(setup, problem.laws).force_N,
        after_N=predict(applied(chosen, setup), problem.laws).force_N,
        measured_N=measured,
        residual_before=np.mean(measured - before, axis=1) / peak,
        residual_after=np.mean(measured - after, axis=1) / peak,
        specimens=tuple(s.id for s in specimens),
        columns=axis_columns(problem.campaign),
    )


def _label(specimen: Specimen, specimens: tuple[Specimen, ...]) -> str:
    """Return what a test is, by the columns that vary in the campaign."""
    profile = specimen.profile
    parts = [specimen.material or (f"bar {profile.name}" if profile is not None else "")]
    for name, text in _NAMED:
        value = getattr(specimen, name)
        if value is not None and len({getattr(s, name) for s in specimens}) > 1:
            parts.append(text.format(value))
    for name in ("orientation", "protocol"):
        if len({getattr(s, name) for s in specimens}) > 1 and getattr(specimen, name):
            parts.append(str(getattr(specimen, name)))
    return ", ".join(parts)
