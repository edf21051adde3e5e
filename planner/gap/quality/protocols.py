"""The declared protocol and amplitude against what the crosshead did."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.gap.conditions import replicate_groups
from planner.gap.quality.motion import blocks, unloading_share
from planner.gap.quality.problem import Problem
from planner.gap.specimen import Specimen

__all__ = ["amplitude_problems", "hold_share", "protocol_problems"]

UNLOADS = 0.1
HOLDS = 0.3
"""Shares of range and of duration from which unloading and holding are on purpose."""

AMPLITUDE_TOLERANCE = 0.1
_STRAINS = ("to_strain", "amplitude_strain", "strain_amplitude", "peak_strain", "hold_strain")
_TRAVELS = ("amplitude_mm", "peak_mm", "hold_mm", "to_mm")


def protocol_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    """Yield the specimens that were tested otherwise than their protocol says."""
    for s in specimens:
        back = unloading_share(s.displacement_mm, s.force_N)
        held = hold_share(s)
        if s.protocol == "monotonic" and back > UNLOADS:
            yield Problem(
                "protocol", s.id,
                f"declared monotonic, but it is unloaded by {100 * back:.0f} % of its travel; "
                "a cyclic test?", back, 0.0,
            )  # fmt: skip
        elif s.protocol == "monotonic" and held > HOLDS:
            yield Problem(
                "protocol", s.id,
                f"declared monotonic, but it is held for {100 * held:.0f} % of its time; "
                "a relaxation test?", held, 0.0,
            )  # fmt: skip
        elif s.protocol == "cyclic" and back < 0.5 * UNLOADS:
            yield Problem("protocol", s.id, "declared cyclic, but it is never unloaded", back)
        elif s.protocol == "relaxation" and held < 0.5 * HOLDS:
            yield Problem(
                "protocol", s.id,
                f"declared relaxation, but it is held for {100 * held:.0f} % of its time only",
                held,
            )  # fmt: skip


def hold_share(specimen: Specimen) -> float:
    """Return the share of the duration in which the crosshead rests on a loaded specimen."""
    time, travel = blocks(specimen.time_s, specimen.displacement_mm, 200)
    _, force = blocks(specimen.time_s, specimen.force_N, 200)
    way, duration = np.abs(np.diff(travel)), np.diff(time)
    mean = float(np.sum(way)) / float(np.sum(duration))
    rests = (way < 0.05 * mean * duration) & (force[1:] > 0.1 * float(np.max(force)))
    return float(np.sum(duration[rests])) / float(np.sum(duration))


def amplitude_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    """Yield specimens that were strained to another amplitude than declared, or than the others.

    Declared is what a further column such as `to_strain` or `amplitude_mm` says. Without one, a
    cyclic or relaxation specimen that stands alone among at least two replicates that agree is
    named.
    """
    for s in specimens:
        declared = _declared_mm(s)
        peak = float(np.max(s.displacement_mm))
        broken = s.protocol in (None, "monotonic")
        if declared is None or (broken and peak < declared):
            continue
        if abs(peak / declared - 1.0) > AMPLITUDE_TOLERANCE:
            yield _amplitude(s, peak, declared, "is declared")
    for group in replicate_groups(specimens):
        members = [specimens[i] for i in group if specimens[i].protocol in ("cyclic", "relaxation")]
        peaks = np.array([float(np.max(s.displacement_mm)) for s in members])
        if len(members) < 3 or any(_declared_mm(s) is not None for s in members):
            continue
        middle = float(np.median(peaks))
        off = np.abs(peaks / middle - 1.0) > AMPLITUDE_TOLERANCE
        if off.sum() == 1 and np.ptp(peaks[~off]) < 0.02 * middle:
            at = int(np.argmax(off))
            yield _amplitude(members[at], float(peaks[at]), middle, "is its replicates'")


def _declared_mm(specimen: Specimen) -> float | None:
    for names, factor in ((_STRAINS, specimen.gauge_mm), (_TRAVELS, 1.0)):
        for name in names:
            value = specimen.covariates.get(name)
            if isinstance(value, float) and value > 0.0:
                return value * factor
    return None


def _amplitude(specimen: Specimen, peak: float, expected: float, whose: str) -> Problem:
    return Problem(
        "amplitude",
        specimen.id,
        f"travels to {peak:.3g} mm, where {expected:.3g} mm {whose}",
        float(f"{peak:.6g}"),
        float(f"{expected:.6g}"),
    )
