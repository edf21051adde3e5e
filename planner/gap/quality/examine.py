"""Examine a campaign's data."""

from planner.gap.campaign import Campaign
from planner.gap.quality.clipping import clipping_problems
from planner.gap.quality.dead_cells import dead_cell_problems
from planner.gap.quality.duplicates import duplicate_problems
from planner.gap.quality.outliers import outlier_problems
from planner.gap.quality.problem import Problem
from planner.gap.quality.protocols import amplitude_problems, protocol_problems
from planner.gap.quality.rates import rate_problems
from planner.gap.quality.sizes import size_problems
from planner.gap.quality.timing import timing_problems
from planner.gap.quality.units import unit_problems

__all__ = ["examine"]


def examine(campaign: Campaign) -> tuple[Problem, ...]:
    """Return what is wrong with a campaign's data, problems of all of it first.

    Nothing is changed or left out. Specimens are judged against their own declaration, their
    replicates and, by the factors between units alone, the palette's laws: a load that is off by
    any other factor is a gap to diagnose, not a fault of the data.
    """
    specimens = campaign.specimens
    dead = tuple(dead_cell_problems(specimens))
    silent = {p.specimen for p in dead}
    live = [s for s in specimens if s.id not in silent]
    units = unit_problems(live, campaign.palette)
    copies = tuple(duplicate_problems(specimens))
    named = frozenset(p.specimen for p in (*dead, *units, *copies) if p.specimen is not None)
    problems: tuple[Problem, ...] = (
        *dead,
        *units,
        *size_problems(specimens),
        *rate_problems(specimens),
        *protocol_problems(live),
        *amplitude_problems(specimens),
        *outlier_problems(specimens, leave_out=named),
        *clipping_problems(live),
        *copies,
        *timing_problems(specimens),
    )
    order = {s.id: place for place, s in enumerate(specimens)}
    return tuple(sorted(problems, key=lambda p: -1 if p.specimen is None else order[p.specimen]))
