"""A specimen's path, cut at its turns and rests, as far as its record can be compared."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.errors import FileError
from planner.gap.quality.motion import speed_mm_s
from planner.gap.specimen import Specimen
from planner.materials.curve import Curve
from planner.materials.rupture import BROKEN_SHARE, noise_sd, without_tail

__all__ = ["Kind", "Leg", "Path", "path_of"]

Kind = Literal["loading", "unloading", "reloading", "hold", "rest"]

_TURN_SHARE = 0.02
"""A way back of less than this share of the range of travel is no turn."""

_REST_SHARE = 0.004
_REST_LENGTH = 10.0
"""At rest is what moves less than `_REST_SHARE` of the range in `_REST_LENGTH` times the time
that the crosshead takes for it."""

_LOOKS = np.linspace(0.125, 1.0, 8)
MINIMUM_ROWS = 4
"""Of a first loading, unless it is but the way to a hold."""


@dataclass(frozen=True, slots=True)
class Leg:
    """Rows `first` to `last` of a record, both included: one way, or one rest.

    Attributes
    ----------
    kind
        "loading" is the first one; "hold" a rest behind a loading, "rest" any other.
    """

    kind: Kind
    first: int
    last: int
    begin_s: float
    end_s: float
    begin_mm: float
    end_mm: float

    @property
    def rows(self) -> int:
        """Their number."""
        return self.last - self.first + 1

    @property
    def moves(self) -> bool:
        """Whether the crosshead does."""
        return self.kind not in ("hold", "rest")


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """The legs of one specimen, times counted from where travel 0 was left.

    Attributes
    ----------
    time_s, travel_mm, force_N
        The record, on that clock.
    shift_s
        What was taken off the record's time.
    broken
        Whether the legs end at the specimen's break.
    """

    legs: tuple[Leg, ...]
    time_s: FloatArray
    travel_mm: FloatArray
    force_N: FloatArray
    shift_s: float
    broken: bool

    @property
    def speed_mm_s(self) -> float:
        """Of the first loading."""
        leg = self.legs[0]
        return (leg.end_mm - leg.begin_mm) / (leg.end_s - leg.begin_s)


def path_of(specimen: Specimen) -> Path | None:
    """Return a specimen's path up to its break; None where it never loads over enough rows."""
    time, travel, force = specimen.time_s, specimen.displacement_mm, specimen.force_N
    spread = float(np.ptp(travel))
    noise = noise_sd(travel)
    if spread <= 10.0 * noise:
        return None
    spans = _spans(time, travel, spread, noise)
    while spans and (spans[0][0] == "rest" or travel[spans[0][2]] < travel[spans[0][1]]):
        spans.pop(0)
    named = _named(spans, travel)
    kept, broken = _unbroken(named, force)
    if not kept:
        return None
    held = len(kept) > 1 and kept[1][0] == "hold"
    if kept[0][2] - kept[0][1] + 1 < (2 if held else MINIMUM_ROWS):
        return None
    start = kept[0][1]
    reach = kept[0][2]
    speed = (travel[reach] - travel[start]) / (time[reach] - time[start])
    zero_s = float(time[start] - max(travel[start], 0.0) / speed)
    legs: list[Leg] = []
    begin_s, begin_mm = 0.0, 0.0
    for at, (kind, first, last) in enumerate(kept):
        next_kind = kept[at + 1][0] if at + 1 < len(kept) else None
        corner_s, end_mm = _corner(time, travel, first, last, next_kind)
        if kind in ("hold", "rest"):
            end_mm = begin_mm
        end_s = corner_s - zero_s
        if end_s <= begin_s:
            continue
        legs.append(Leg(kind, first, last, begin_s, end_s, begin_mm, end_mm))
        begin_s, begin_mm = end_s, end_mm
    return Path(tuple(legs), time - zero_s, travel, force, zero_s, broken)


def _corner(
    time: FloatArray, travel: FloatArray, first: int, last: int, next_kind: Kind | None
) -> tuple[float, float]:
    """Return when and where a leg ends: where its line meets the next leg's, between two rows."""
    at, level = float(time[last]), float(travel[last])
    if next_kind is None or last - first < 3 or last + 3 > len(time):
        return at, level
    into = float((travel[last - 1] - travel[last - 3]) / (time[last - 1] - time[last - 3]))
    if next_kind in ("hold", "rest"):
        out, after_s, after_mm = 0.0, float(time[last + 1]), float(travel[last])
    else:
        out = float((travel[last + 2] - travel[last + 1]) / (time[last + 2] - time[last + 1]))
        after_s, after_mm = float(time[last + 1]), float(travel[last + 1])
    if into == out:
        return at, level
    before_s, before_mm = float(time[last - 1]), float(travel[last - 1])
    meet = (after_mm - before_mm + into * before_s - out * after_s) / (into - out)
    if not before_s < meet < after_s:
        return at, level
    return meet, before_mm + into * (meet - before_s)


def _spans(
    time: FloatArray, travel: FloatArray, spread: float, noise: float
) -> list[tuple[str, int, int]]:
    """Return ("rest" or "move", first, last) one after the other, each from the last one's end."""
    resting = _resting(time, travel, max(_REST_SHARE * spread, 5.0 * noise))
    turn = max(_TURN_SHARE * spread, 6.0 * noise)
    edges = np.flatnonzero(np.diff(resting.astype(np.int8))) + 1
    spans: list[tuple[str, int, int]] = []
    for first, stop in zip([0, *edges], [*edges, len(time)], strict=True):
        if resting[first]:
            a, b = _held_rows(travel, int(first), int(stop) - 1, spread, noise)
            spans.append(("rest", a, b))
        else:
            first, stop = max(int(first) - 1, 0), min(int(stop) + 1, len(time))
            corners = _turns(travel[first:stop], turn) + first
            spans += [("move", int(a), int(b)) for a, b in pairwise(corners)]
    # Join: a move begins where the span before ends, and one too short to be a way is left out.
    joined: list[tuple[str, int, int]] = []
    for at, (kind, first, last) in enumerate(spans):
        begin = joined[-1][2] if joined else first
        end = last
        if kind == "move" and at + 1 < len(spans) and spans[at + 1][0] == "rest":
            end = spans[at + 1][1]
        if kind == "move" and abs(travel[end] - travel[begin]) < 0.5 * turn:
            continue
        if kind == "rest" and joined and joined[-1][0] == "rest":
            joined[-1] = ("rest", joined[-1][1], end)
        elif end > begin:
            joined.append((kind, begin, end))
    return joined


def _resting(time: FloatArray, travel: FloatArray, least_mm: float) -> BoolArray:
    """Return which rows lie in a time in which travel stays within `least_mm`."""
    window = _REST_LENGTH * least_mm / max(speed_mm_s(time, travel), 1e-300)
    still = time + window <= time[-1]
    for share in _LOOKS:
        ahead = np.interp(time + share * window, time, travel)
        still &= np.abs(ahead - travel) < least_mm
    until = np.maximum.accumulate(np.where(still, time + window, -np.inf))
    resting = np.asarray(until >= time)
    # The last rows have not enough ahead of them: they rest on, or they move.
    judged = int(np.searchsorted(time, time[-1] - window, side="right")) - 1
    if judged >= 0 and still[judged]:
        resting[judged:] = np.abs(travel[judged:] - travel[judged]) < least_mm
    return resting


def _held_rows(
    travel: FloatArray, first: int, last: int, spread: float, noise: float
) -> tuple[int, int]:
    """Take off a rest what still moves towards it, or begins to leave it."""
    level = float(np.median(travel[first : last + 1]))
    near = np.abs(travel[first : last + 1] - level) <= max(0.0005 * spread, 3.0 * noise)
    inside = np.flatnonzero(near)
    return first + int(inside[0]), first + int(inside[-1])


def _turns(travel: FloatArray, least: float) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the ends and the turns between them, of more than `least` each."""
    corners = [0]
    low = high = 0
    rising = 0
    for i, value in enumerate(travel.tolist()):
        if value > travel[high]:
            high = i
        if value < travel[low]:
            low = i
        if rising >= 0 and travel[high] - value > least:
            if rising > 0 or high > 0:
                corners.append(high)
            rising, low = -1, i
            high = i
        elif rising <= 0 and value - travel[low] > least:
            if rising < 0 or low > 0:
                corners.append(low)
            rising, high = 1, i
            low = i
    last = len(travel) - 1
    end = {1: high, -1: low, 0: last}[rising]
    if end != corners[-1]:
        corners.append(end)
    return np.array(corners, dtype=np.int64)


def _named(spans: list[tuple[str, int, int]], travel: FloatArray) -> list[tuple[Kind, int, int]]:
    named: list[tuple[Kind, int, int]] = []
    for what, first, last in spans:
        kind: Kind
        if what == "rest":
            loaded = bool(named) and named[-1][0] in ("loading", "reloading")
            kind = "hold" if loaded else "rest"
        elif travel[last] < travel[first]:
            kind = "unloading"
        else:
            kind = "reloading" if named else "loading"
        named.append((kind, first, last))
    return named


def _unbroken(
    legs: list[tuple[Kind, int, int]], force: FloatArray
) -> tuple[list[tuple[Kind, int, int]], bool]:
    """Keep the legs up to rupture; it shows on a way up, or as a load that is gone in a rest."""
    kept: list[tuple[Kind, int, int]] = []
    peak = 0.0
    for kind, first, last in legs:
        end = last
        part = force[first : last + 1]
        if kind in ("loading", "reloading"):
            end = first + _last_before_break(part)
        elif kind == "hold":
            gone = np.flatnonzero(part < 0.5 * BROKEN_SHARE * float(part[0]))
            end = first + int(gone[0]) - 1 if len(gone) and part[0] > 0.2 * peak else last
        peak = max(peak, float(np.max(part)))
        if end - first >= 1:
            kept.append((kind, first, end))
        if end < last:
            return kept, True
    return kept, False


def _last_before_break(force: FloatArray) -> int:
    """Return the last place before rupture of a loading's rows."""
    rows = np.arange(len(force), dtype=np.float64)
    try:
        return len(without_tail(Curve("", rows, force)).strain) - 1
    except FileError:  # too few rows, or a load that does not rise above its noise
        return len(force) - 1
