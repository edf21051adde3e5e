"""Specimens that should be alike and are not: something differs that no column tells."""

from collections.abc import Sequence

from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Hypothesis
from planner.gap.evidence.posterior import with_unknown
from planner.gap.evidence.problem import Problem

__all__ = ["LARGEST_SCATTER", "caution", "with_unlike"]

LARGEST_SCATTER = 0.12
"""Of replicates' levels: jetted specimens scatter by 1 to 9 %, and estimates are off by a third."""


def with_unlike(problem: Problem, ranking: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the ranking; where replicates are not alike, "none" gives way to the unknown.

    A gap no larger than what replicates differ by is no gap, unless they differ by what no print
    scatters: then the gap lies between them.
    """
    nothing = sum(h.probability for h in ranking if h.effects == ())
    if not nothing or not _unlike(problem):
        return tuple(ranking)
    return with_unknown([h for h in ranking if h.effects != ()], nothing)


def caution(problem: Problem) -> str | None:
    """Return what to tell of replicates that are not alike; None where they are."""
    if not _unlike(problem):
        return None
    columns = _telling(problem.campaign, problem.mounted.tests)
    where = (
        f"they differ in column{'s' if len(columns) > 1 else ''} {', '.join(columns)}, which no "
        "effect claims"
        if columns
        else "no column tells them apart"
    )
    return (
        f"specimens made and tested alike differ by {100.0 * problem.scatter.specimen:.0f} %, and "
        f"jetted ones by 1 to 9 %: {where}; give the condition in which they differ its own column"
    )


def _unlike(problem: Problem) -> bool:
    scatter = problem.scatter
    return bool(scatter.degrees_of_freedom and scatter.specimen > LARGEST_SCATTER)


def _telling(campaign: Campaign, tests: Sequence[Sequence[int]]) -> list[str]:
    """Return the further columns that differ within a test's specimens."""
    return [
        name
        for name in campaign.covariates
        if any(
            len({campaign.specimens[k].covariates.get(name) for k in members}) > 1
            for members in tests
        )
    ]
