"""Where a record breaks, and how noisy it is."""

from dataclasses import replace

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.materials.curve import MINIMUM_POINTS, Curve

__all__ = ["BROKEN_SHARE", "noise_sd", "without_tail"]

BROKEN_SHARE = 0.2
"""A stress below this share of the peak, behind the peak, is a broken specimen's."""

RUPTURE_SHARE = 0.25
"""A fall by this share of the peak from one point to the next is rupture at once."""

SUDDEN_SHARE = 0.03
"""A fall of more than this share from one point to the next, just before rupture, belongs to it."""


def noise_sd(values: FloatArray) -> float:
    """Return the standard deviation of point-to-point noise.

    From the median absolute third difference, which a smooth course and single jumps leave
    almost untouched; white noise of deviation s has third differences of deviation sqrt(20) s.
    """
    if len(values) < 4:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / np.sqrt(20.0))


def without_tail(curve: Curve) -> Curve:
    """Cut what a record holds behind rupture, and note it.

    Rupture is where the stress behind its peak falls below `BROKEN_SHARE` of it, or by
    `RUPTURE_SHARE` of it at once, or where the record ends in a sudden fall; the sudden falls
    (`SUDDEN_SHARE`) just before are cut as well. A drop behind a yield point is slow and stays.

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
    behind = stress[peak:]
    broken = behind[1:] < BROKEN_SHARE * height
    broken |= -np.diff(behind) > max(RUPTURE_SHARE * height, 6.0 * noise)
    last = peak + int(np.argmax(broken)) if broken.any() else len(stress) - 1
    sudden = max(SUDDEN_SHARE * height, 6.0 * noise)
    while last > peak and stress[last - 1] - stress[last] > sudden:
        last -= 1
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
