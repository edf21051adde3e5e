"""The stress of one slice: its law, and what its largest strain so far has done to it."""

import math

from planner.arrays import FloatArray
from planner.geometry.kernel import inner_kernel

__all__ = ["elastic_stress", "fallen_share", "slice_stress"]

BUCKLED = 0.05
"""Stiffness in compression over that in tension: a strip gives way sideways."""

_BUCKLING_STRAIN = 0.005
_TILT_MIDDLE, _TILT_WIDTH = 0.15, 0.2
_LEAST_TANGENT = 0.02
"""Of the secant: a tangent below it, of a law that falls, would send Newton's method astray."""


@inner_kernel
def elastic_stress(
    strain: float, lower: int, upper: int, fraction: float, log_factor: float,
    log_tilt: float, cubics: FloatArray, step: float,
) -> tuple[float, float]:  # fmt: skip
    """Return stress and tangent of a mixture that was never strained farther."""
    intervals = cubics.shape[1]
    end = intervals * step
    inside = min(max(strain, 0.0), end)
    place = inside / step
    i = min(int(place), intervals - 1)
    s = place - i
    c0 = cubics[lower, i, 0] + fraction * (cubics[upper, i, 0] - cubics[lower, i, 0])
    c1 = cubics[lower, i, 1] + fraction * (cubics[upper, i, 1] - cubics[lower, i, 1])
    c2 = cubics[lower, i, 2] + fraction * (cubics[upper, i, 2] - cubics[lower, i, 2])
    c3 = cubics[lower, i, 3] + fraction * (cubics[upper, i, 3] - cubics[lower, i, 3])
    logarithm = c0 + s * (c1 + s * (c2 + s * c3)) + log_factor
    slope = (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / step
    if log_tilt != 0.0:
        bend = math.tanh((inside - _TILT_MIDDLE) / _TILT_WIDTH)
        logarithm += log_tilt * bend
        slope += log_tilt * (1.0 - bend * bend) / _TILT_WIDTH
    secant = math.exp(logarithm)
    if strain < 0.0:
        decay = math.exp(max(strain / _BUCKLING_STRAIN, -700.0))
        stress = BUCKLED * strain - (1.0 - BUCKLED) * _BUCKLING_STRAIN * (1.0 - decay)
        return secant * stress, secant * (BUCKLED + (1.0 - BUCKLED) * decay)
    tangent = secant * (1.0 + inside * slope)
    tangent = max(tangent, _LEAST_TANGENT * secant)
    if strain > end:
        return secant * end + tangent * (strain - end), tangent
    return secant * inside, tangent


@inner_kernel
def fallen_share(table: FloatArray, share: float, largest: float) -> tuple[float, float]:
    """Return a softening table between its nodes, and its derivative by the share, 0 to 1."""
    rows, columns = table.shape[0] - 1, table.shape[1] - 1
    place = min(max(share, 0.0), 1.0) * rows
    i = min(int(place), rows - 1)
    across = min(max(largest, 0.0), 1.0) * columns
    j = min(int(across), columns - 1)
    v = across - j
    begin = table[i, j] + v * (table[i, j + 1] - table[i, j])
    rise = table[i + 1, j] + v * (table[i + 1, j + 1] - table[i + 1, j]) - begin
    if share < 0.0 or share > 1.0:
        return begin + (place - i) * rise, 0.0
    return begin + (place - i) * rise, rise * rows


@inner_kernel
def slice_stress(
    strain: float, largest: float, left: float, softening: float, table: FloatArray,
    lower: int, upper: int, fraction: float, log_factor: float, log_tilt: float,
    cubics: FloatArray, step: float,
) -> tuple[float, float]:  # fmt: skip
    """Return stress and tangent below `largest`, of which a strain of `left` stays for good."""
    if strain >= largest or (left == 0.0 and softening == 0.0):
        return elastic_stress(strain, lower, upper, fraction, log_factor, log_tilt, cubics, step)
    spread = largest / (largest - left)
    felt = (strain - left) * spread
    stress, tangent = elastic_stress(
        felt, lower, upper, fraction, log_factor, log_tilt, cubics, step
    )
    tangent *= spread
    if softening != 0.0:
        fall, slope = fallen_share(table, felt / largest, largest)
        factor = 1.0 - softening * fall
        least = _LEAST_TANGENT * factor * tangent
        tangent = factor * tangent - softening * slope * spread / largest * stress
        tangent = max(tangent, least)
        stress *= factor
    return stress, tangent
