"""What the crosshead did: its speed, its turns and its rests."""

import numpy as np

from planner.arrays import FloatArray

__all__ = ["blocks", "first_turn", "speed_mm_s", "unloading_share"]

BLOCKS = 60
"""A record is looked at in about so many steps, over which noise of the travel evens out."""


def blocks(time_s: FloatArray, values: FloatArray, count: int = BLOCKS) -> tuple[FloatArray, ...]:
    """Return times and means of `values` over about `count` runs of points of equal number."""
    size = max(1, len(values) // count)
    starts = np.arange(0, len(values) - size + 1, size)
    share = 1.0 / size
    return (
        np.add.reduceat(time_s[: starts[-1] + size], starts) * share,
        np.add.reduceat(values[: starts[-1] + size], starts) * share,
    )


def speed_mm_s(time_s: FloatArray, displacement_mm: FloatArray) -> float:
    """Return the crosshead's speed: half of its way was faster, half slower.

    Rests do not count, as they add no way; loading and unloading both do.
    """
    time, travel = blocks(time_s, displacement_mm)
    way = np.abs(np.diff(travel))
    speeds = way / np.diff(time)
    order = np.argsort(speeds, kind="stable")
    share = np.cumsum(way[order])
    return float(speeds[order][int(np.searchsorted(share, 0.5 * share[-1]))])


def first_turn(displacement_mm: FloatArray, share: float = 0.05) -> int:
    """Return the index of the first peak of travel that a fall by `share` of its range follows.

    The last index if there is none.
    """
    highest = np.maximum.accumulate(displacement_mm)
    fallen = np.flatnonzero(highest - displacement_mm > share * float(np.ptp(displacement_mm)))
    if not len(fallen):
        return len(displacement_mm) - 1
    return int(np.argmax(displacement_mm[: fallen[0] + 1]))


def unloading_share(displacement_mm: FloatArray, force_N: FloatArray) -> float:
    """Return the largest fall of travel while the specimen still bears load, over its range.

    Load means a fifth of the peak force at the place where the fall begins, so that the way back
    of a broken specimen's grips does not count.
    """
    turn = first_turn(displacement_mm)
    if turn == len(displacement_mm) - 1 or force_N[turn] < 0.2 * float(np.max(force_N)):
        return 0.0
    after = displacement_mm[turn:]
    behind = force_N[turn : turn + max(2, len(after) // 50)]
    if float(np.min(behind)) < 0.2 * float(force_N[turn]):
        return 0.0
    return float(displacement_mm[turn] - np.min(after)) / float(np.ptp(displacement_mm))
