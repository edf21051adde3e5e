"""How a graded bar is cut into slices: fine where its mixture steps, coarse where it does not."""

from itertools import pairwise

import numpy as np

from planner.arrays import FloatArray
from planner.gap.profile_design import ProfileDesign

__all__ = ["slice_edges_mm", "step_places_mm"]

_FINEST_MM = 0.05
"""At a step; from there slices double, so that 0.05 to 1 mm of bleeding is resolved."""

_MOST = 56
_STEEP_MM = 0.3
_JUMP = 0.02
_COORDINATE_CHANGE = 0.025
_FEWEST = 24
_GRID = 4001


def step_places_mm(design: ProfileDesign) -> FloatArray:
    """Return where mixture or section steps: a place that stands twice, or a steep rise.

    Points of a rise within 0.3 mm make one step, in their middle.
    """
    x = design.x_mm
    jump = np.abs(np.diff(design.coordinate)) > _JUMP
    for sizes in (design.width_mm, design.thickness_mm):
        if sizes is not None:
            jump |= np.abs(np.diff(np.log(sizes))) > _JUMP
    steep = np.flatnonzero(jump & (np.diff(x) <= _STEEP_MM))
    places: list[list[float]] = []
    for at in steep.tolist():
        begin, end = float(x[at]), float(x[at + 1])
        if places and begin - places[-1][1] < 1e-9 and end - places[-1][0] <= _STEEP_MM:
            places[-1][1] = end
        else:
            places.append([begin, end])
    middle: FloatArray = np.array([0.5 * (begin + end) for begin, end in places], dtype=np.float64)
    inside = (middle > 1e-9) & (middle < x[-1] - 1e-9)
    return np.asarray(middle[inside])


def slice_edges_mm(design: ProfileDesign) -> FloatArray:
    """Return the edges of the slices, from 0 to the gauge's length; steps are among them."""
    length = design.length_mm
    steps = step_places_mm(design)
    bounds = np.unique(np.concatenate([[0.0], steps, [length]]))
    x = (np.arange(_GRID) + 0.5) * length / _GRID
    size = np.full(_GRID, length / _FEWEST)
    half = 0.5 * _STEEP_MM
    slope = np.abs(design.at(np.minimum(x + half, length)) - design.at(np.maximum(x - half, 0.0)))
    slope /= np.minimum(x + half, length) - np.maximum(x - half, 0.0)
    if len(steps):
        away = np.min(np.abs(x[:, None] - steps), axis=1)
        size = np.minimum(size, np.log(2.0) * (_FINEST_MM + away))
        slope[away < _STEEP_MM] = 0.0  # the step's own
    size = np.minimum(size, _COORDINATE_CHANGE / np.maximum(slope, 1e-9))
    wanted = float(np.sum(1.0 / size)) * length / _GRID
    scale = max(1.0, wanted / (_MOST - len(bounds) + 1))
    edges = [0.0]
    reach = np.concatenate([[0.0], np.cumsum(length / _GRID / (scale * size))])
    at = np.arange(_GRID + 1) * length / _GRID
    for begin, end in pairwise(bounds):
        low, high = np.interp([begin, end], at, reach)
        count = max(1, round(high - low))
        inner = np.interp(np.linspace(low, high, count + 1)[1:-1], reach, at)
        edges += [*inner[(inner > begin) & (inner < end)].tolist(), float(end)]
    return np.array(edges)
