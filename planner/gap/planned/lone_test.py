"""One specimen's test on its own, at any steps: to predict whole curves."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.campaign import Campaign
from planner.gap.forward import Setup
from planner.gap.forward.assemble import MountedTest, assemble, mean_times_s
from planner.gap.forward.legs import path_of
from planner.gap.forward.steps import walk_of

__all__ = ["lone_test", "nominal_record"]

_ROWS = 200


def lone_test(
    campaign: Campaign, place: int, time_s: FloatArray, travel_mm: FloatArray
) -> Setup | None:
    """Return the setup of one specimen along a path of any steps, with no effect.

    None where the specimen never loads over enough rows to be mounted.

    Parameters
    ----------
    place
        Of the specimen in the campaign.
    time_s, travel_mm : (T,)
        Of the crosshead, the first step at rest.
    """
    path = path_of(campaign.specimens[place])
    if path is None or not path.legs:
        return None
    walk = walk_of([path])
    test = MountedTest((place,), walk, mean_times_s([path], walk), ())
    setup = assemble(campaign, [test], {place: path})
    shape = (1, len(time_s))
    return setup.with_(
        time_s=np.asarray(time_s, dtype=np.float64)[None],
        travel_mm=np.asarray(travel_mm, dtype=np.float64)[None],
        lost_mm=np.zeros(shape),
        gain=np.ones(shape),
        offset_N=np.zeros(shape),
    )


def nominal_record(campaign: Campaign, place: int) -> tuple[FloatArray, FloatArray, float] | None:
    """Return time and travel of a specimen's test as it was meant: corners, and lines between.

    The last figure is what was taken off the record's clock: times count from the start of travel.

    None where the specimen never loads over enough rows to be mounted.
    """
    path = path_of(campaign.specimens[place])
    if path is None or not path.legs:
        return None
    corners_s = np.array([0.0, *(leg.end_s for leg in path.legs)])
    corners_mm = np.array([0.0, *(leg.end_mm for leg in path.legs)])
    rows = max(_ROWS // len(path.legs), 12)
    parts = [np.zeros(1)]
    for leg in path.legs:
        length = leg.end_s - leg.begin_s
        even = np.arange(1, rows + 1) / rows
        parts.append(leg.begin_s + length * (even if leg.moves else np.geomspace(1e-3, 1.0, rows)))
    time = np.concatenate(parts)
    return time, np.interp(time, corners_s, corners_mm), path.shift_s
