"""Force that does not change while the specimen is pulled."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.gap.quality.motion import blocks, first_turn
from planner.gap.quality.problem import Problem
from planner.gap.specimen import Specimen
from planner.materials.rupture import noise_sd

__all__ = ["dead_cell_problems"]

STEADY_SHARE = 0.02
"""A load that starts at rest rises by all of its peak; one that changes by less is none."""

NOISE = 6.0
"""Means of noise alone, a score of them, spread over 3.7 of their deviations on average, and over
6 of them once in thousands."""

LEAST_STRAIN, ARRIVED = 0.01, 0.98
_BLOCKS, _FEWEST = 20, 5


def dead_cell_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    """Yield specimens whose force stood still, but for noise, over the first loading."""
    for s in specimens:
        stop = _loaded(s)
        if stop < _FEWEST or float(s.strain[stop - 1]) < LEAST_STRAIN:
            continue
        time, force = blocks(s.time_s[:stop], s.force_N[:stop], _BLOCKS)
        points = max(stop // len(time), 1)
        noise = NOISE * noise_sd(s.force_N[:stop]) / np.sqrt(points)
        middle = float(np.median(force))
        if float(np.ptp(force)) <= max(STEADY_SHARE * abs(middle), noise):
            yield Problem(
                "dead",
                s.id,
                f"force stays at {middle:.3g} N while the crosshead goes from 0 to "
                f"{s.displacement_mm[stop - 1]:.3g} mm; a dead or unplugged load cell? Leave the "
                "specimen out",
                float(f"{middle:.6g}"),
            )


def _loaded(s: Specimen) -> int:
    """Return how many points the first loading has, a hold at its end left out."""
    turn = first_turn(s.displacement_mm)
    travel = s.displacement_mm[: turn + 1]
    return int(np.argmax(travel >= ARRIVED * float(np.max(travel)))) + 1
