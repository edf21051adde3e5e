"""Where a record breaks, and how noisy it is."""

from dataclasses import replace

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.materials.curve import MINIMUM_POINTS, Curve

__all__ = ["noise_sd", "without_tail"]

BROKEN_SHARE = 0.6
"""A stress below this share of the peak, behind the peak, is a broken specimen's."""

SUDDEN_SHARE = 0.03
"""A fall of more than this share of the peak from one point to the next is rupture, not yield."""


def noise_sd(values: FloatArray) -> float:
    """Return the standard deviation of point-to-point noise.

    From the median absolute second difference, which a smooth course and single jumps leave
    almost untouched; white noise of deviation s has second differences of deviation sqrt(6) s.
    """
    if len(values) < 3:
        return 0.0
    second = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / np.sqrt(6.0))


def without_tail(curve: Curve) -> Curve:
    """Cut what a record holds behind rupture, and note it.

    Rupture is where the stress behind its peak falls below `BROKEN_SHARE` of it, or where the
    record ends in a sudden fall; the sudden falls before that point are cut as well. A drop
    behind a yield point is slow and stays.

    Raises
    ------
    FileError
        The stress never rises above its noise, or too few points are left.
    """
    stress, strain = curve.stress_MPa, curve.strain
    noise = noise_sd(stress)
    peak = int(np.argmax(stress))
    height = float(stress[peak])
    if height <= 0.0 or height - float(np.median(stress[:3])) <= 6.0 * noise:
        raise FileError(
            f"specimen {curve.specimen}: the curve never loads (stress reaches {height:g} MPa, "
            f"noise is {noise:.2g} MPa); check the load cell, the sign and the columns"
        )
    below = np.flatnonzero(stress[peak:] < BROKEN_SHARE * height)
    last = peak + int(below[0]) - 1 if len(below) else len(stress) - 1
    sudden = max(SUDDEN_SHARE * height, 6.0 * noise)
    while last > peak and stress[last - 1] - stress[last] > sudden:
        last -= 1
    # A fall that ends the record may stand in its very last points only.
    cut = len(stress) - 1 - last
    if not cut:
        return curve
    if last + 1 < MINIMUM_POINTS:
        raise FileError(
            f"specimen {curve.specimen}: only {last + 1} points before the break at strain "
            f"{strain[last]:g}; at least {MINIMUM_POINTS} are needed: sample faster"
        )
    return replace(
        curve,
        strain=strain[: last + 1],
        stress_MPa=stress[: last + 1],
        time_s=None if curve.time_s is None else curve.time_s[: last + 1],
        notes=(
            *curve.notes,
            f"specimen {curve.specimen}: breaks at strain {strain[last]:.4g}; {cut} points "
            "behind it are cut",
        ),
    )
