"""Bands of true mixtures, for printers that jet them."""

import math
from collections.abc import Sequence

import numpy as np

from planner.errors import ArgumentError
from planner.grading.bands import Band, equal_bands, natural_bands
from planner.grading.printed import Printed, mixture
from planner.grading.profile import Profile
from planner.grading.stiffness_scale import StiffnessScale
from planner.printers import Printer

__all__ = ["MIXTURES_UNCALIBRATED", "MOST_MIXTURES", "mixed_bands"]

MOST_MIXTURES = 99
"""Each is a file of its own."""

MIXTURES_UNCALIBRATED = (
    "mixtures are for a printer that jets them: whether {printer} does planner does not know, and "
    "the ratios are places between catalogue materials, not calibrated on a machine"
)

_STEP = 1.2  # of the modulus from mixture to mixture: within 10 % of the target


def mixed_bands(
    profile: Profile, scale: StiffnessScale, count: int | None, machine: Printer
) -> tuple[tuple[Band, ...], tuple[Printed, ...]]:
    """Cut where the mixture changes, and say what each band is printed in.

    Parameters
    ----------
    count
        Equal steps of the field; by default steps of the modulus of up to 20 %, both ends of the
        gradient among them.

    Raises
    ------
    ArgumentError
        More than 99 bands.
    """
    if count is None:
        low, high = (
            float(np.clip(end, scale.moduli_MPa[0], scale.moduli_MPa[-1]))
            for end in profile.interval_MPa(0.0, 1.0)
        )
        steps = max(1, math.ceil(math.log(high / low) / math.log(_STEP) - 1e-9))
        ladder = np.geomspace(low, high, steps + 1).tolist() if high > low * 1.001 else [low]
        bands = natural_bands(profile, tuple(ladder))
        moduli = [ladder[band.grade] for band in bands]
    else:
        if count > MOST_MIXTURES:
            raise ArgumentError(
                f"--blend mix --bands {count}: each mixture is a file of its own; up to "
                f"{MOST_MIXTURES} are possible"
            )
        bands = equal_bands(profile, scale.moduli_MPa, count)
        moduli = [math.sqrt(band.target_MPa[0] * band.target_MPa[1]) for band in bands]
    printed = tuple(mixture(scale, modulus, machine) for modulus in moduli)
    return _merged(bands, printed)


def _merged(
    bands: Sequence[Band], printed: Sequence[Printed]
) -> tuple[tuple[Band, ...], tuple[Printed, ...]]:
    """Join neighbours that come to one mixture, shares being kept to 0.1 %."""
    kept: list[tuple[Band, Printed]] = []
    for band, what in zip(bands, printed, strict=True):
        if kept and kept[-1][1] == what:
            last = kept.pop()[0]
            low = min(last.target_MPa[0], band.target_MPa[0])
            high = max(last.target_MPa[1], band.target_MPa[1])
            band = Band(last.start, band.stop, band.grade, (low, high))
        kept.append((band, what))
    return tuple(band for band, _ in kept), tuple(what for _, what in kept)
