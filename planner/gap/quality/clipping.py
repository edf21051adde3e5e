"""Force that stands still at its largest value while the crosshead moves on."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.gap.quality.problem import Problem
from planner.gap.specimen import Specimen
from planner.materials.rupture import noise_sd

__all__ = ["clipping_problems"]

SHORTEST = 5
"""Fewer equal points than this may be chance."""

RISE, RISE_SHARE = 4.0, 0.01
"""The force should have risen by so many times noise and resolution, and by so much of its peak,
along the plateau: a material that yields levels off before."""


def clipping_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    """Yield specimens whose load cell or amplifier was at its limit."""
    for s in specimens:
        run = _plateau(s)
        if run is not None:
            top = float(s.force_N[run[0]])
            yield Problem(
                "clipped",
                s.id,
                f"force stands at {top:.4g} N over {run[1] - run[0]} points from strain "
                f"{s.strain[run[0]]:.3g} while the crosshead moves on; the load cell's limit?",
                float(f"{top:.6g}"),
            )


def _plateau(s: Specimen) -> tuple[int, int] | None:
    """First and last-but-one index of the run at the largest force, if nothing else explains it."""
    force = s.force_N
    top = float(np.max(force))
    at_top = force >= top - 1e-9 * abs(top)
    start, stop = _longest_run(at_top)
    if stop - start < SHORTEST or start < SHORTEST:
        return None
    # A coarse resolution gives runs of equal values everywhere, not only at the top.
    equal = (np.diff(force) == 0.0) & ~at_top[1:]
    elsewhere = _longest_run(equal)
    if stop - start < 3 * (elsewhere[1] - elsewhere[0] + 1):
        return None
    first = max(start - max(SHORTEST, (stop - start) // 5), 0)
    travel = float(s.displacement_mm[stop - 1] - s.displacement_mm[start])
    approach = float(s.displacement_mm[start] - s.displacement_mm[first])
    if travel <= 0.0 or approach <= 0.0:
        return None
    expected = travel * float(top - force[first]) / approach
    steps = np.abs(np.diff(force))
    resolution = float(np.min(steps[steps > 0.0], initial=top))
    least = max(RISE * (noise_sd(force[:start]) + resolution), RISE_SHARE * top)
    return (start, stop) if expected > least else None


def _longest_run(flags: np.ndarray) -> tuple[int, int]:
    """Return begin and end of the longest run of True, (0, 0) if there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    if not len(edges):
        return 0, 0
    starts, stops = edges[::2], edges[1::2]
    at = int(np.argmax(stops - starts))
    return int(starts[at]), int(stops[at])
