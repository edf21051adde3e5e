"""Gaps in the time channel, and single points that leap out of the record."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.quality.problem import Problem
from planner.gap.specimen import Specimen
from planner.materials.rupture import noise_sd

__all__ = ["dropouts", "spikes", "timing_problems"]

GAP = 5.0
"""A step of so many times those before and behind it is a gap; adaptive sampling changes less."""

SPIKE_NOISE, SPIKE_SHARE, SPIKE_STEP = 12.0, 0.03, 5.0
"""A spike leaps by so many noise deviations, so much of the range, so many steps nearby."""

WIDEST = 3
_AROUND = 6


def timing_problems(specimens: Sequence[Specimen]) -> Iterator[Problem]:
    """Yield specimens with lost data or with spikes."""
    for s in specimens:
        gaps = dropouts(s.time_s) if s.time_recorded else np.zeros(0, dtype=np.int64)
        if len(gaps):
            steps = np.diff(s.time_s)
            longest = int(gaps[np.argmax(steps[gaps])])
            usual = float(np.median(steps))
            yield Problem(
                "dropout",
                s.id,
                f"{_times(len(gaps), 'gap')} in time, the longest {steps[longest]:.3g} s from "
                f"{s.time_s[longest]:.4g} s, where {usual:.3g} s is usual",
                float(f"{steps[longest]:.6g}"),
                float(f"{usual:.6g}"),
            )
        for name, values in (("force_N", s.force_N), ("displacement_mm", s.displacement_mm)):
            found = spikes(values)
            if len(found):
                first = int(found[0])
                yield Problem(
                    "spike",
                    s.id,
                    f"{_times(len(found), 'spike')} in {name}, the first of {values[first]:.4g} at "
                    f"{s.time_s[first]:.4g} s",
                    float(f"{values[first]:.6g}"),
                    float(f"{np.median(_around(values, first)):.6g}"),
                )


def dropouts(time_s: FloatArray) -> IntArray:
    """Return the indices of steps far longer than those before and behind them."""
    steps = np.diff(time_s)
    if len(steps) < 7:
        return np.zeros(0, dtype=np.int64)
    windows = np.lib.stride_tricks.sliding_window_view(steps, 3)
    middle = np.median(windows, axis=1)
    inner = np.arange(3, len(steps) - 3)
    nearby = np.maximum(middle[inner - 3], middle[inner + 1])
    found: IntArray = inner[steps[inner] > GAP * nearby]
    return found


def spikes(values: FloatArray) -> IntArray:
    """Return the indices at which up to `WIDEST` points leap out and the record comes back.

    A turn of a triangle wave or a break is none: a spike leaps further than the record moves
    nearby on both sides, and ends where it began.
    """
    n = len(values)
    least = max(SPIKE_NOISE * noise_sd(values), SPIKE_SHARE * _span(values))
    moves = np.abs(np.diff(values))
    found: list[int] = []
    for width in range(1, WIDEST + 1):
        before = np.arange(_AROUND, n - _AROUND - width)
        rise = values[before + 1] - values[before]
        fall = values[before + width] - values[before + width + 1]
        leap = np.minimum(np.abs(rise), np.abs(fall))
        for i in before[(rise * fall > 0.0) & (leap > least)]:
            if any(abs(i + 1 - f) <= WIDEST for f in found):
                continue
            near = np.concatenate([moves[i - _AROUND : i], moves[i + width + 1 : i + width + 6]])
            back = abs(values[i + width + 1] - values[i])
            this = min(
                abs(values[i + 1] - values[i]), abs(values[i + width + 1] - values[i + width])
            )
            if this > SPIKE_STEP * float(np.max(near)) and back < 0.5 * this:
                found.append(int(i) + 1)
    return np.array(sorted(found), dtype=np.int64)


def _span(values: FloatArray) -> float:
    """Range of the record without what leaps out of it."""
    low, high = np.quantile(values, [0.02, 0.98])
    return float(high - low)


def _around(values: FloatArray, at: int) -> FloatArray:
    return np.concatenate([values[at - _AROUND : at], values[at + WIDEST : at + WIDEST + _AROUND]])


def _times(count: int, what: str) -> str:
    return f"a {what}" if count == 1 else f"{count} {what}s"
