"""How the crosshead moves, and when the machine writes a row.

Every protocol has as many rows as any other: the length of a file says nothing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.design import Design

__all__ = ["ROWS", "Motion", "crosshead"]

FloatArray = NDArray[np.float64]

ROWS = 120
"""Rows a curve, after the one at rest."""

_HOLD_S = 240.0
_BAR_SHARE = 0.55  # bars are pulled less far: their softest place strains more than the mean
_PEAK = {"monotonic": (0.34,), "cyclic": (0.16, 0.30), "relaxation": (0.22,)}
_LOW = 0.02


@dataclass(frozen=True)
class Motion:
    """Crosshead of each specimen, shape (specimens, ROWS + 1), starting at rest.

    Attributes
    ----------
    direction
        1 loading, -1 unloading, 0 holding, into each row.
    """

    time_s: FloatArray
    displacement_mm: FloatArray
    direction: NDArray[np.int64]


def crosshead(design: Design) -> Motion:
    """Return the motion that each specimen's protocol, rate and gauge length ask for."""
    rows = [
        _one(str(design.protocol[i]), float(design.strain_rate_per_s[i]), design.profile[i] >= 0)
        for i in range(len(design))
    ]
    time, strain = (np.array([row[k] for row in rows]) for k in (0, 1))
    direction = np.sign(np.round(np.diff(strain, axis=1, prepend=0.0), 12)).astype(np.int64)
    # As the encoder and the clock resolve them
    time_s = np.round(time, 4)
    return Motion(time_s, np.round(strain * design.gauge_mm[:, None], 4), direction)


def _one(protocol: str, rate_per_s: float, bar: bool) -> tuple[FloatArray, FloatArray]:
    peaks = [p * (_BAR_SHARE if bar else 1.0) for p in _PEAK[protocol]]
    if protocol == "relaxation":
        ramp = ROWS // 3
        strain = np.r_[np.linspace(0.0, peaks[0], ramp + 1), np.full(ROWS - ramp, peaks[0])]
        end_s = peaks[0] / rate_per_s
        hold_s = np.geomspace(min(0.05 * end_s, 0.5), _HOLD_S, ROWS - ramp)
        return np.r_[np.linspace(0.0, end_s, ramp + 1), end_s + hold_s], strain
    if protocol == "monotonic":
        corners = [0.0, peaks[0]]
    else:
        low = _LOW * (_BAR_SHARE if bar else 1.0)
        corners = [0.0, peaks[0], low, peaks[1], low]
    turns = np.cumsum(np.abs(np.diff(corners, prepend=0.0)))
    # Rows at equal path, moved so that every corner has one
    path = np.linspace(0.0, turns[-1], ROWS + 1)
    path[np.searchsorted(path, turns[:-1])] = turns[:-1]
    return path / rate_per_s, np.interp(path, turns, corners)
