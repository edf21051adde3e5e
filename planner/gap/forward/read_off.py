"""A specimen's time, travel and force at the steps of its test, its sensors' noise evened out."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.forward.legs import Leg, Path
from planner.gap.forward.steps import Walk, hold_scale_s, instants_s, moments_s

__all__ = ["forces_N", "step_times_s"]

_FEWEST = 7
"""Rows that a parabola is laid through at least, so that it evens out some noise."""

_MANY = 200


def step_times_s(path: Path, walk: Walk) -> FloatArray:
    """Return when a specimen came by each step, (T,)."""
    times = np.zeros(len(walk.leg))
    for number, (own, mean) in enumerate(zip(path.legs, walk.legs, strict=True)):
        here = (walk.leg == number) & (np.arange(len(times)) > 0)
        fraction = walk.fraction[here]
        if own.moves:
            end = min(own.end_mm, mean.end_mm) if len(walk.legs) == 1 else own.end_mm
            places = own.begin_mm + fraction * (end - own.begin_mm)
            times[here] = moments_s(path, own, places)
        else:
            times[here] = own.begin_s + instants_s(own, fraction, hold_scale_s(mean))
    return times


def forces_N(path: Path, walk: Walk) -> FloatArray:
    """Return a specimen's force at the travel, or the time of a rest, of each step, (T,).

    A parabola through the rows of the same leg within a quarter of a stride to either side, or
    the nearest few, is taken where the step is.
    """
    forces = np.zeros(len(walk.leg))
    travel = walk.travel_mm
    for number, (own, mean) in enumerate(zip(path.legs, walk.legs, strict=True)):
        here = np.flatnonzero(walk.leg == number)
        inside = (path.time_s >= own.begin_s - 1e-9) & (path.time_s <= own.end_s + 1e-9)
        inside &= np.arange(len(inside)) <= own.last
        if own.moves:
            rows = path.travel_mm[inside]
            places = travel[here]
        else:
            scale = hold_scale_s(mean)
            since = np.maximum(path.time_s[inside] - own.begin_s, 0.0)
            rows = np.log1p(since / scale)
            length = own.end_s - own.begin_s
            places = walk.fraction[here] * np.log1p(length / scale)
        if not inside.any():
            forces[here] = np.interp(_middle_s(own), path.time_s, path.force_N)
            continue
        stride = np.abs(np.gradient(places)) if len(places) > 1 else np.full(1, np.ptp(rows))
        forces[here] = _smooth(rows, path.force_N[inside], places, 0.25 * stride)
    return forces


def _middle_s(leg: Leg) -> float:
    return 0.5 * (leg.begin_s + leg.end_s)


def _fewer(values: FloatArray) -> FloatArray:
    """Return the means of runs of points where there are very many."""
    size = len(values) // _MANY
    if size < 2:
        return values
    whole = values[: len(values) // size * size].reshape(-1, size).mean(axis=1)
    rest = values[len(values) // size * size :]
    return np.append(whole, rest.mean()) if len(rest) else whole


def _smooth(
    rows: FloatArray, values: FloatArray, places: FloatArray, reach: FloatArray
) -> FloatArray:
    """Return local parabolas at `places`, of the rows within `reach`, at least `_FEWEST`."""
    rows, values = _fewer(rows), _fewer(values)
    away = np.abs(rows[None, :] - places[:, None])
    if len(rows) > _FEWEST:
        width = np.maximum(reach, np.partition(away, _FEWEST, axis=1)[:, _FEWEST])
        width = np.maximum(width, 1e-12)
        # Fading to nothing at the ends, so that no row's place decides all or nothing.
        weight = np.maximum(1.0 - (away / width[:, None]) ** 2, 0.0)
    else:
        width = np.maximum(away.max(axis=1), 1e-12)
        weight = np.ones_like(away)
    powers = np.arange(3 if len(rows) >= 5 else min(2, len(rows)))
    basis = ((rows[None, :] - places[:, None]) / width[:, None])[..., None] ** powers
    normal = np.einsum("pr,pri,prj->pij", weight, basis, basis)
    # Rows that stand at one place decide no slope; the least of a ridge leaves it at none.
    normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.diag(powers > 0)
    right = np.einsum("pr,pri,r->pi", weight, basis, values)
    return np.asarray(np.linalg.solve(normal, right[..., None])[:, 0, 0])
