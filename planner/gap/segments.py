"""Segments of a test (loading, unloading, rest) and the time grid that predicts them."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from planner.errors import FileError
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.campaign import Campaign, Specimen, stated
from planner.materials.characterise import (
    BROKEN_SHARE,
    MINIMUM_POINTS,
    SPIKE_NOISE,
    SPIKE_STEP,
    WIDEST_SPIKE,
    Curve,
    noise_sd,
    spikes_in,
    without_tail,
)
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.simulation.bar import slice_edges_mm
from planner.simulation.bar_solver import Setup, unaltered

__all__ = [
    "PATH_STEPS",
    "TIME_TOLERANCE",
    "TURN_SHARE",
    "ReplicateTest",
    "SpecimenPath",
    "forces_N",
    "hold_share",
    "leap_at_end",
    "path_of",
    "setup_of",
    "speed_mm_s",
    "unloading_share",
]


# ------------------------------------------------------------------------------------------------
# Single points that leap out of a record.


_SCATTER = 0.03
"""A leap of less of the range does no harm, and ends of segments of one test lie no farther apart,
of the longest travel. Physical: jetted specimens scatter by as much."""

_AROUND = 2 * WIDEST_SPIKE
"""Points that are looked at on either side of a leap, fewer at an end. Chosen: twice as many as it
has tell how the record goes."""


def _without_spikes(specimen: Specimen) -> Specimen:
    """Return a specimen without the points that leap out of its force or travel."""
    keep = ~(spikes_in(specimen.force_N) | spikes_in(specimen.displacement_mm))
    keep[leap_at_end(specimen) :] = False
    if keep.all() or keep.sum() < MINIMUM_POINTS:
        return specimen
    record = ("time_s", "displacement_mm", "force_N")
    return replace(specimen, **{name: getattr(specimen, name)[keep] for name in record})


def leap_at_end(s: Specimen) -> int:
    """Return the first of the last points if force leaps away from zero there; else their number.

    The crosshead does not: so it is where it or an over-stretched specimen meets a stop.
    """
    size, duration = np.abs(s.force_N), np.diff(s.time_s)
    n = len(size)
    least = max(SPIKE_NOISE * noise_sd(s.force_N), _SCATTER * float(np.ptp(size[:-WIDEST_SPIKE])))
    speed, rise = np.abs(np.diff(s.displacement_mm)) / duration, np.abs(np.diff(size)) / duration
    for width in range(1, min(WIDEST_SPIKE, n - _AROUND - 1) + 1):
        i = n - 1 - width
        before = slice(i - _AROUND, i)
        leaps = rise[i] > SPIKE_STEP * np.max(rise[before]) and size[i + 1] - size[i] > least
        onwards = (np.diff(size[i:]) > 0.0).all()
        if leaps and onwards and np.max(speed[i:]) < SPIKE_STEP * np.max(speed[before]):
            return i + 1
    return n


# ------------------------------------------------------------------------------------------------
# How fast the crosshead moved, and where it turned.


_BLOCKS, _BLOCKS_A_WAY = 60, 10
"""A record is looked at in about so many steps, and so many at least from one turn to the next.
Chosen: over a step noise of the travel evens out; the one that holds a turn shows less than the
speed, and must be one of ten."""


def speed_mm_s(time_s: FloatArray, travel_mm: FloatArray) -> float:
    """Return the crosshead's speed: half of its way was faster, half slower.

    Rests do not count, as they add no way; loading and unloading both do.
    """
    ways = len(_turns(travel_mm, _least_turn_mm(travel_mm))) - 1
    count = max(_BLOCKS, _BLOCKS_A_WAY * ways)
    way = np.abs(np.diff(_fewer(travel_mm, count)))
    speeds = way / np.diff(_fewer(time_s, count))
    order = np.argsort(speeds, kind="stable")
    share = np.cumsum(way[order])
    return float(speeds[order][int(np.searchsorted(share, 0.5 * share[-1]))])


def _fewer(values: FloatArray, count: int) -> FloatArray:
    """Return the means of runs of points, `count` or a few more, where there are twice as many."""
    size = len(values) // count
    if size < 2:
        return values
    return np.array([run.mean() for run in np.split(values, range(size, len(values), size))])


def _least_turn_mm(travel_mm: FloatArray) -> float:
    return max(TURN_SHARE * float(np.ptp(travel_mm)), _TURN_NOISE * noise_sd(travel_mm))


def _turns(values: FloatArray, least: float) -> IntArray:
    """Return the ends and the turns between them, of `least` or more each.

    Turns are what has moved farthest, as often as it has, before a way back of `least`. They are
    those of scipy's `find_peaks` by prominence, which takes half a second to import.
    """
    rises = values - np.minimum.accumulate(values) >= least
    first = int(np.argmax(rises | (np.maximum.accumulate(values) - values >= least)))
    turns, way, farthest = [0], 1.0 if rises[first] else -1.0, [first]
    for place in (np.flatnonzero(np.diff(values[first:])) + first + 1).tolist():
        ahead = way * float(values[place] - values[farthest[-1]])
        if ahead >= 0.0:
            farthest = [*(farthest if ahead == 0.0 else ()), place]
        elif -ahead >= least:
            turns, way, farthest = [*turns, *farthest], -way, [place]
    corners = np.unique(turns)
    # What follows the last turn ends where it has come farthest.
    since = np.abs(values[corners[-1] :] - values[corners[-1]])
    return np.append(corners, corners[-1] + np.argmax(since)) if since.any() else corners


# ------------------------------------------------------------------------------------------------
# A specimen's path, cut at its turns and rests, as far as its record can be compared.


SegmentKind = Literal["loading", "unloading", "reloading", "hold", "rest"]

TURN_SHARE = 0.02
"""A way back of less than this share of the range of travel is no turn. Chosen: machines settle and
overshoot by less, no cycle that is meant is so small."""

_REST_SHARE = 0.004
_REST_LENGTH = 10.0
"""At rest is what moves less than `_REST_SHARE` of the range in `_REST_LENGTH` times the time
that the crosshead takes for it. Chosen: a tenth of its pace is none that was meant, and the time
for it, 4 % of a pull, is less than holds last."""

_LEAST_SPREAD, _REST_NOISE, _TURN_NOISE = 10.0, 5.0, 6.0
"""Range of travel, motion in a rest and way back of a turn, in deviations of the travel's noise,
below which there is none. Physical: the difference of two rows, 1.4 deviations of its own, passes 5
once in 2,500 and 6 once in 45,000; ten deviations are no pull."""

_HELD_SHARE, _HELD_NOISE = 0.0005, 3.0
"""How far from its middle a rest's rows lie, of the range and in deviations of noise. Chosen: an
eighth of what counts as rest; three deviations hold nearly all rows."""

_LOOKS = np.linspace(0.125, 1.0, 8)
"""Shares of that time ahead at which travel is looked at. Numerical: every eighth, so that no way
there and back passes for a rest."""

_MINIMUM_ROWS = 4
"""Of a first loading, unless it is but the way to a hold. Numerical: what a parabola has to be laid
through, and one more."""

_MOST_SEGMENTS = 24
"""Of a path; more cycles are compared in groups. Numerical: of more, `PATH_STEPS` would leave fewer
than two to some."""

_BACK_SHARE = 0.5
"""A fall of the load is no rupture if so much of the load comes back later. Chosen: a broken
specimen bears next to nothing, one that was unloaded nearly all."""

_SAME_TRAVEL = 0.95
"""Of the largest travel so far: from there on a reloaded specimen may be broken. Physical: there a
softened one bears again about what it bore (Mullins effect)."""


@dataclass(frozen=True, slots=True)
class Segment:
    """Rows `first` to `last` of a record, both included: one way, or one rest.

    Attributes
    ----------
    kind
        "loading" is the first one; "hold" a rest behind a loading, "rest" any other.
    cycles
        Of a reloading: how many it stands for, rows being the last one's; see `_in_groups`.
    """

    kind: SegmentKind
    first: int
    last: int
    begin_s: float
    end_s: float
    begin_mm: float
    end_mm: float
    cycles: int = 1

    @property
    def moves(self) -> bool:
        """Whether the crosshead does."""
        return self.kind not in ("hold", "rest")


@dataclass(frozen=True, slots=True, eq=False)
class SpecimenPath:
    """The segments of one specimen, times counted from where travel 0 was left.

    Attributes
    ----------
    time_s, travel_mm, force_N
        The record, on that clock; travel the way it loads.
    shift_s
        What was taken off the record's time.
    broken
        Whether the segments end at the specimen's break.
    gauge_mm
        What travel over it is the nominal strain.
    """

    segments: tuple[Segment, ...]
    time_s: FloatArray
    travel_mm: FloatArray
    force_N: FloatArray
    shift_s: float
    broken: bool
    gauge_mm: float

    @property
    def speed_mm_s(self) -> float:
        """Of the first loading."""
        segment = self.segments[0]
        return (segment.end_mm - segment.begin_mm) / (segment.end_s - segment.begin_s)

    def on_gauge(self, gauge_mm: float) -> "SpecimenPath":
        """Return the path to the same strains of another gauge length."""
        ratio = gauge_mm / self.gauge_mm
        segments = tuple(
            replace(s, begin_mm=ratio * s.begin_mm, end_mm=ratio * s.end_mm) for s in self.segments
        )
        return replace(self, segments=segments, travel_mm=ratio * self.travel_mm, gauge_mm=gauge_mm)

    def until(self, most_mm: float) -> "SpecimenPath":
        """Return the path up to where its travel passes `most_mm` first."""
        for at, segment in enumerate(self.segments):
            if segment.end_mm > most_mm * (1.0 + 1e-9):
                before = self.segments[:at]
                if max(segment.begin_mm, 0.0) < most_mm:
                    when = float(_moments_s(self, segment, np.array([most_mm]))[0])
                    before += (replace(segment, end_mm=most_mm, end_s=when),)
                return replace(self, segments=before)
        return self

    def is_like(self, other: "SpecimenPath") -> bool:
        """Say whether two specimens went the same way, at the same pace.

        Pulls that only load may end elsewhere, as long as the shorter is not much shorter.
        """
        if [s.kind for s in self.segments] != [s.kind for s in other.segments]:
            return False
        if abs(self.speed_mm_s / other.speed_mm_s - 1.0) > TIME_TOLERANCE:
            return False
        if len(self.segments) == 1:
            ends = self.segments[0].end_mm, other.segments[0].end_mm
            return min(ends) > _SHORTEST_SHARE * max(ends)
        spread = max(segment.end_mm for segment in self.segments)
        return all(
            abs(a.end_mm - b.end_mm) <= _SCATTER * spread
            and abs((a.end_s - a.begin_s) / (b.end_s - b.begin_s) - 1.0) <= TIME_TOLERANCE
            for a, b in zip(self.segments, other.segments, strict=True)
        )


@lru_cache(maxsize=256)  # several look at one record, one after the other
def path_of(specimen: Specimen) -> SpecimenPath | None:
    """Return a specimen's path up to its break; None where it never loads over enough rows."""
    specimen = _without_spikes(specimen)
    time, travel, load = specimen.time_s, specimen.travel_mm, specimen.load_N
    spans = _spans(time, travel)
    while spans and (spans[0][0] == "rest" or travel[spans[0][2]] < travel[spans[0][1]]):
        spans.pop(0)
    kept, broken = _unbroken(spans, travel, load)
    if not kept:
        return None
    _, start, reach = kept[0]
    held = len(kept) > 1 and kept[1][0] == "hold"
    if reach - start + 1 < (2 if held else _MINIMUM_ROWS):
        return None
    speed = (travel[reach] - travel[start]) / (time[reach] - time[start])
    zero_s = float(time[start] - max(travel[start], 0.0) / speed)
    segments: list[Segment] = []
    begin_s, begin_mm = 0.0, 0.0
    for at, (kind, first, last) in enumerate(kept):
        next_kind = kept[at + 1][0] if at + 1 < len(kept) else None
        corner_s, end_mm = _corner(time, travel, first, last, next_kind)
        if kind in ("hold", "rest"):
            end_mm = begin_mm
        if (end_s := corner_s - zero_s) > begin_s:
            segments.append(Segment(kind, first, last, begin_s, end_s, begin_mm, end_mm))
            begin_s, begin_mm = end_s, end_mm
    if not segments:
        return None
    return SpecimenPath(
        segments=_in_groups(segments),
        time_s=time - zero_s,
        travel_mm=travel,
        force_N=specimen.force_N,
        shift_s=zero_s,
        broken=broken,
        gauge_mm=specimen.gauge_mm,
    )


def unloading_share(specimen: Specimen) -> float:
    """Return the longest way back of a specimen before its break, over the range of travel."""
    path = path_of(specimen)
    ways = [s.begin_mm - s.end_mm for s in path.segments if s.kind == "unloading"] if path else []
    return max(ways, default=0.0) / float(np.ptp(specimen.travel_mm))


def hold_share(specimen: Specimen) -> float:
    """Return the share of the duration in which the crosshead rests on a loaded specimen."""
    path = path_of(specimen)
    held = [s.end_s - s.begin_s for s in path.segments if s.kind == "hold"] if path else []
    return sum(held) / float(np.ptp(specimen.time_s))


def _in_groups(segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """Return segments no more than steps can resolve: of many cycles, some in groups.

    Of a group the first valley, the last peak and what follows it are kept, and one slow way
    between: what relaxes slowly feels the mean of all, what relaxes fast the last cycle. Groups are
    the larger the later, as softening and relaxation go with the logarithm of time; the first cycle
    and the last two stand alone. Where half of the stress relaxes, the last of 20 cycles are so
    predicted to 0.2 % of the peak, of 50 to 2 %.
    """
    starts = [i for i, segment in enumerate(segments) if segment.kind == "reloading"]
    if len(segments) <= _MOST_SEGMENTS or not starts:
        return tuple(segments)
    cycles = [segments[a:b] for a, b in pairwise([*starts, len(segments)])]
    groups = max((_MOST_SEGMENTS - starts[0]) // max(map(len, cycles)), 3)
    ends = (np.geomspace(1.0, len(cycles) - 1.0, groups - 1) - 1.0).round().astype(np.int64)
    ends = np.maximum(ends, np.arange(groups - 1))
    kept = [*segments[: starts[0]]]
    for a, b in pairwise([*ends.tolist(), len(cycles) - 1, len(cycles)]):
        first, (last, *rest) = cycles[a][0], cycles[b - 1]
        kept.append(replace(last, begin_s=first.begin_s, begin_mm=first.begin_mm, cycles=b - a))
        kept += rest
    return tuple(kept)


def _corner(
    time: FloatArray, travel: FloatArray, first: int, last: int, next_kind: SegmentKind | None
) -> tuple[float, float]:
    """Return when and where a segment ends: where its line meets the next one's."""
    at, level = float(time[last]), float(travel[last])
    if next_kind is None or last - first < 3 or last + 3 > len(time):
        return at, level

    def slope(row: int, to: int) -> float:
        return float((travel[to] - travel[row]) / (time[to] - time[row]))

    into, rests = slope(last - 3, last - 1), next_kind in ("hold", "rest")
    out = 0.0 if rests else slope(last + 1, last + 2)
    before_s, before_mm = float(time[last - 1]), float(travel[last - 1])
    after_s, after_mm = float(time[last + 1]), float(travel[last if rests else last + 1])
    if into != out:
        meet = (after_mm - before_mm + into * before_s - out * after_s) / (into - out)
        if before_s < meet < after_s:
            return meet, before_mm + into * (meet - before_s)
    return at, level


def _spans(time: FloatArray, travel: FloatArray) -> list[tuple[str, int, int]]:
    """Return ("rest" or "move", first, last) one after the other, each from the last one's end.

    There is none where travel is noise alone.
    """
    spread, noise = float(np.ptp(travel)), noise_sd(travel)
    if spread <= _LEAST_SPREAD * noise:
        return []
    held_mm = max(_HELD_SHARE * spread, _HELD_NOISE * noise)
    resting = _resting(time, travel, max(_REST_SHARE * spread, _REST_NOISE * noise))
    turn = _least_turn_mm(travel)
    edges = np.flatnonzero(np.diff(resting.astype(np.int8))) + 1
    spans: list[tuple[str, int, int]] = []
    for first, stop in zip([0, *edges], [*edges, len(time)], strict=True):
        if resting[first]:
            # What still moves towards it, or begins to leave it, is no part of a rest.
            away = np.abs(travel[first:stop] - np.median(travel[first:stop]))
            # The median of an even number may lie between two rows, far from both.
            inside = np.flatnonzero(away <= max(held_mm, float(away.min())))
            spans.append(("rest", int(first + inside[0]), int(first + inside[-1])))
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
        still &= np.abs(np.interp(time + share * window, time, travel) - travel) < least_mm
    resting = np.maximum.accumulate(np.where(still, time + window, -np.inf)) >= time
    # The last rows have not enough ahead of them: they rest on, or they move.
    judged = int(np.searchsorted(time, time[-1] - window, side="right")) - 1
    if judged >= 0 and still[judged]:
        resting[judged:] = np.abs(travel[judged:] - travel[judged]) < least_mm
    # Two rows before and behind a turn stand at one place, and yet nothing rests.
    step, way = np.diff(time), np.diff(travel)
    for i in np.flatnonzero(resting[1:-2] & ~resting[:-3] & ~resting[3:]) + 1:
        if way[i - 1] * way[i + 1] < 0.0 and step[i] < 1.5 * max(step[i - 1], step[i + 1]):
            resting[i : i + 2] = False
    return resting


def _unbroken(
    spans: list[tuple[str, int, int]], travel: FloatArray, force: FloatArray
) -> tuple[list[tuple[SegmentKind, int, int]], bool]:
    """Name what comes before rupture: seen on a way up, or as a load that is gone in a rest."""
    kept: list[tuple[SegmentKind, int, int]] = []
    peak, farthest = 0.0, 0.0
    for what, first, last in spans:
        kind: SegmentKind = "reloading" if kept else "loading"
        if what == "rest":
            kind = "hold" if kept and kept[-1][0] in ("loading", "reloading") else "rest"
        elif travel[last] < travel[first]:
            kind = "unloading"
        end, part = last, force[first : last + 1]
        if kind in ("loading", "reloading"):
            there = kind == "reloading" and travel[last] > _SAME_TRAVEL * farthest
            if there and np.max(part) < BROKEN_SHARE * peak:
                return kept, True
            with suppress(FileError):  # too few rows, or a load that does not rise above its noise
                end = first + len(without_tail(Curve("", part, part)).strain) - 1
            if np.max(force[last + 1 :], initial=0.0) > _BACK_SHARE * force[end]:
                end = last  # what comes back later was no rupture's
        elif kind == "unloading":
            back = travel[first] - travel[first + 1 : last + 1]
            near = max(1, int(np.sum(back < TURN_SHARE * float(np.ptp(travel)))))
            # What broke at the turn bears nothing behind it; a row that was lost hides no way back.
            if np.median(part[1 : 1 + near]) < BROKEN_SHARE * part[0]:
                return kept, True
        elif kind == "hold":
            none = np.flatnonzero(part < 0.5 * BROKEN_SHARE * float(part[0]))
            end = first + int(none[0]) - 1 if len(none) and part[0] > BROKEN_SHARE * peak else last
        peak = max(peak, float(np.max(part)))
        farthest = max(farthest, float(travel[last]))
        if end > first:
            kept.append((kind, first, end))
        if end < last:
            return kept, True
    return kept, False


# ------------------------------------------------------------------------------------------------
# The steps of a test: a set number of them over a path of segments.


PATH_STEPS = 64
"""Of every test, the first at rest included. Numerical: a pull's strains lie 1/64 apart, over which
laws, and what relaxes, are close to straight."""

_LEAST = 6
"""Steps of a segment, where there is room. Numerical: relaxation over a segment is followed in
sixths of it."""

_HOLD_DECADES = 1000.0
"""How long a hold is, over the time from which its steps lie evenly in the logarithm of time.
Numerical: three decades; of a hold of 240 s from 0.24 s on, when machines
have stopped."""

TIME_TOLERANCE = 0.1
"""Relative difference of speeds and of times of segments of one test. Physical: a tenth of a rate
changes a polymer's stress by less than 1 % (at 20 % a decade)."""

_SHORTEST_SHARE = 0.6
"""Shortest over longest pull of one test, which is compared up to the shortest. Chosen: so most of
each curve is used; a specimen that broke earlier has a test of its own."""

_FRACTIONS: Mapping[SegmentKind, tuple[tuple[float, ...], ...]] = {
    "loading": (
        (0.06, 0.12, 0.2, 0.32, 0.46, 0.64, 0.82, 1.0),
        (0.08, 0.18, 0.32, 0.5, 0.75, 1.0),
        (0.1, 0.25, 0.45, 0.7, 1.0),
    ),
    "unloading": ((0.2, 0.45, 0.7, 0.9), (0.2, 0.45, 0.7, 0.9), (0.25, 0.6, 0.9)),
    "reloading": ((0.25, 0.5, 0.75, 1.0), (0.25, 0.5, 0.75, 1.0), (0.3, 0.65, 1.0)),
    "hold": ((0.2, 0.4, 0.6, 0.8, 1.0), (0.25, 0.5, 0.75, 1.0), (0.25, 0.5, 0.75, 1.0)),
}
"""Places of features along a segment, three lists each: the fewer the more segments. Chosen: closer
at small strains, where laws bend; not at the turn itself, where an unloading begins."""

_FEATURES_MOST = 18
"""Of a test, else shorter lists are taken. Chosen: points of one curve are no witnesses of their
own, and cost grows with them."""

_ROWS_LEAST = 5
"""Of a segment, for more features than its end. Numerical: fewer rows do not carry a parabola."""


class ReplicateTest:
    """One test: the specimens that went the same way, and their steps.

    Parameters
    ----------
    paths
        Of its specimens, by place.
    frames
        Fractions of the first loading at which strain fields are compared: steps beside the
        features'.

    Attributes
    ----------
    segments
        The mean of the specimens' own, rows of the first one's record.
    segment, fraction : (T,)
        Where each step is: its segment, and how much of it is behind it. Of a rest the fraction is
        that of the logarithm of time, see `_HOLD_DECADES`.
    time_s : (T,)
        Mean of the times at which specimens came by each step, rising.
    """

    def __init__(self, paths: Mapping[int, SpecimenPath], frames: tuple[float, ...] = ()) -> None:
        self.paths, self.frames = paths, frames
        self.places, members = tuple(paths), list(paths.values())
        if len(members[0].segments) == 1:
            shortest = min(path.segments[0].end_mm for path in members)
            members = [path.until(shortest) for path in members]
        ends = ("begin_s", "end_s", "begin_mm", "end_mm")
        self.segments = tuple(
            replace(of[0], **{end: float(np.mean([getattr(s, end) for s in of])) for end in ends})
            for of in zip(*(path.segments for path in members), strict=True)
        )
        first, *others = _feature_places(self.segments)
        wanted = [sorted({*at, 1.0}) for at in ((*first, *frames), *others)]
        counts = _counts(self.segments, [len(at) for at in wanted])
        self.segment = np.concatenate([[0], np.repeat(np.arange(len(self.segments)), counts)])
        self.fraction = np.concatenate([[0.0], *map(_filled, wanted, counts)])
        times = np.mean([_step_times_s(path, self) for path in paths.values()], axis=0)
        apart = 1e-9 * float(times[-1]) * np.arange(len(times))
        self.time_s: FloatArray = np.maximum.accumulate(times) + apart

    @property
    def travel_mm(self) -> FloatArray:
        """Of the crosshead at every step."""
        begin, end = np.array([(s.begin_mm, s.end_mm) for s in self.segments])[self.segment].T
        return np.asarray(begin + self.fraction * (end - begin))

    def step_at(self, segment: int, fraction: float) -> int:
        """Return the step of a segment that is nearest to a fraction of it."""
        here = 1 + np.flatnonzero(self.segment[1:] == segment)
        return int(here[np.argmin(np.abs(self.fraction[here] - fraction))])

    def feature_steps(self) -> list[int]:
        """Return the steps at which features are taken, the record's start first.

        There an offset of the force shows, and nothing that a specimen does.
        """
        return [0] + [
            self.step_at(segment, fraction)
            for segment, places in enumerate(_feature_places(self.segments))
            for fraction in places
        ]


def _moments_s(path: SpecimenPath, segment: Segment, travel_mm: FloatArray) -> FloatArray:
    """Return when a specimen's travel was at these places of a moving segment."""
    sign = 1.0 if segment.end_mm > segment.begin_mm else -1.0
    inside = (path.time_s > segment.begin_s) & (path.time_s < segment.end_s)
    rows = sign * path.travel_mm[inside]
    even = 0.5 * (np.maximum.accumulate(rows) + np.minimum.accumulate(rows[::-1])[::-1])
    low, high = sign * segment.begin_mm, sign * segment.end_mm
    places = np.concatenate([[low], np.clip(even, low, high), [high]])
    times = np.concatenate([[segment.begin_s], path.time_s[inside], [segment.end_s]])
    return np.asarray(np.interp(sign * travel_mm, places, times))


def _feature_places(segments: Sequence[Segment]) -> list[tuple[float, ...]]:
    """Return where along each segment features are taken: () on most.

    The first loading, the first and the last unloading, the last reloading and the longest hold
    have some, `_FEATURES_MOST` in all at most. A segment of few rows has its end only.
    """
    kinds = [segment.kind for segment in segments]
    down, up, held = (
        [i for i, kind in enumerate(kinds) if kind == of]
        for of in ("unloading", "reloading", "hold")
    )
    longest = sorted(held, key=lambda i: segments[i].begin_s - segments[i].end_s)[:1]
    chosen = {0, *down[:1], *down[-1:], *up[-1:], *longest}
    for level in range(3):
        places = [_FRACTIONS[kind][level] if i in chosen else () for i, kind in enumerate(kinds)]
        if sum(map(len, places)) <= _FEATURES_MOST:
            break
    return [
        some if segment.last - segment.first + 1 >= _ROWS_LEAST else some[-1:]
        for some, segment in zip(places, segments, strict=True)
    ]


def _counts(segments: Sequence[Segment], least: Sequence[int]) -> list[int]:
    """Share `PATH_STEPS` but one out among segments by their travel, a rest's half the longest."""
    travel = np.array([abs(s.end_mm - s.begin_mm) if s.moves else 0.0 for s in segments])
    travel[[not s.moves for s in segments]] = 0.5 * float(travel.max())
    grouped = np.array([s.cycles > 1 for s in segments])
    travel[grouped] = 0.0
    floor = min(_LEAST, (PATH_STEPS - 1) // len(segments))
    while (counts := np.maximum(least, np.where(grouped, 1, floor))).sum() > PATH_STEPS - 1:
        floor -= 1
    while counts.sum() < PATH_STEPS - 1:
        counts[int(np.argmax(travel / counts))] += 1
    return list(counts.tolist())


def _filled(places: Sequence[float], count: int) -> FloatArray:
    """Add places between 0 and 1, each halving the widest gap, up to `count`."""
    found = [0.0, *places]
    while len(found) <= count:
        at = int(np.argmax(np.diff(found)))
        found.insert(at + 1, 0.5 * (found[at] + found[at + 1]))
    return np.array(found[1:])


# ------------------------------------------------------------------------------------------------
# A specimen's time, travel and force at the steps of its test, its sensors' noise evened out.


_FEWEST = 7
"""Rows that a parabola is laid through at least. Numerical: so that it evens out some noise."""

_MANY = 200
"""Points of a segment, from twice of which runs are averaged before. Numerical: several a step
still."""


def _step_times_s(path: SpecimenPath, test: ReplicateTest) -> FloatArray:
    """Return when a specimen came by each step, (T,)."""
    times = np.zeros(len(test.segment))
    for number, (own, mean) in enumerate(zip(path.segments, test.segments, strict=True)):
        here = (test.segment == number) & (np.arange(len(times)) > 0)
        fraction = test.fraction[here]
        if own.moves:
            end = min(own.end_mm, mean.end_mm) if len(test.segments) == 1 else own.end_mm
            times[here] = _moments_s(path, own, own.begin_mm + fraction * (end - own.begin_mm))
        else:
            scale = (mean.end_s - mean.begin_s) / _HOLD_DECADES
            length = np.log1p((own.end_s - own.begin_s) / scale)
            times[here] = own.begin_s + scale * np.expm1(fraction * length)
    return times


def forces_N(specimens: Sequence[Specimen], tests: Sequence[ReplicateTest]) -> FloatArray:
    """Return each specimen's force on its test's steps, and its noise, (2, n, T).

    As of the test's section; the noise as a share of that of the record. NaN for a specimen of
    none.
    """
    forces = np.full((2, len(specimens), PATH_STEPS), np.nan)
    for test in tests:
        group = [specimens[place] for place in test.places]
        at = np.linspace(0.0, group[0].gauge_mm, 65)
        mean = _mean_section_mm2(group, at)
        for (place, path), specimen in zip(test.paths.items(), group, strict=True):
            own = specimen.section_mm2(at)
            # In series the compliances add up, so the ratio that counts is of 1 / area.
            ratio = 1.0 if own is None else float(np.mean(1.0 / own) / np.mean(1.0 / mean))
            forces[:, place] = ratio * _forces_of(path, test)
    return forces


def _forces_of(path: SpecimenPath, test: ReplicateTest) -> FloatArray:
    """Return a specimen's force at the travel, or time of a rest, of each step, and its noise.

    Of shape (2, T).

    A parabola through the rows of the same segment within a quarter of a stride to either side, or
    the nearest few, is taken where the step is.
    """
    forces, noise = found = np.ones((2, len(test.segment)))
    for number, (own, mean) in enumerate(zip(path.segments, test.segments, strict=True)):
        here = np.flatnonzero(test.segment == number)
        inside = (path.time_s >= own.begin_s - 1e-9) & (path.time_s <= own.end_s + 1e-9)
        inside &= (np.arange(len(inside)) >= own.first) & (np.arange(len(inside)) <= own.last)
        if own.moves:
            rows, places = path.travel_mm[inside], test.travel_mm[here]
        else:
            scale = (mean.end_s - mean.begin_s) / _HOLD_DECADES
            rows = np.log1p(np.maximum(path.time_s[inside] - own.begin_s, 0.0) / scale)
            places = test.fraction[here] * np.log1p((own.end_s - own.begin_s) / scale)
        if not inside.any():
            forces[here] = np.interp(0.5 * (own.begin_s + own.end_s), path.time_s, path.force_N)
            continue
        stride = np.abs(np.gradient(places)) if len(places) > 1 else np.full(1, np.ptp(rows))
        forces[here], noise[here] = _smooth(rows, path.force_N[inside], places, 0.25 * stride)
    # As it was read: a parabola that ends where curves bend most is off by more than an offset.
    found[:, 0] = path.force_N[path.segments[0].first], 1.0
    return found


def _smooth(
    rows: FloatArray, values: FloatArray, places: FloatArray, reach: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return local parabolas at `places`, of the rows within `reach`, at least `_FEWEST`.

    And the noise that each has, as a share of that of a row.
    """
    count = len(values)
    rows, values = _fewer(rows, _MANY), _fewer(values, _MANY)
    away = np.abs(rows[None, :] - places[:, None])
    if len(rows) > _FEWEST:
        width = np.maximum(reach, np.partition(away, _FEWEST, axis=1)[:, _FEWEST])
        width = np.maximum(width, 1e-12)
        # Fading to nothing at the ends, so that no row's place decides all or nothing.
        weight = np.maximum(1.0 - (away / width[:, None]) ** 2, 0.0)
        # Rows that all stand at one distance have none left of it.
        weight = np.where(weight.any(axis=1, keepdims=True), weight, away <= width[:, None])
    else:
        width = np.maximum(away.max(axis=1), 1e-12)
        weight = np.ones_like(away)
    powers = np.arange(3 if len(rows) >= _ROWS_LEAST else min(2, len(rows)))
    basis = ((rows[None, :] - places[:, None]) / width[:, None])[..., None] ** powers
    normal = np.einsum("pr,pri,prj->pij", weight, basis, basis)
    # Rows that stand at one place decide no slope; the least of a ridge leaves it at none.
    normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.diag(powers > 0)
    first = np.linalg.solve(normal, np.eye(len(powers))[:, :1])
    of_row = weight * np.einsum("pri,pi->pr", basis, first[..., 0])
    return of_row @ values, np.linalg.norm(of_row, axis=1) * np.sqrt(len(values) / count)


# ------------------------------------------------------------------------------------------------
# The setup of a campaign's tests, with no effect.


def _slices_of(
    campaign: Campaign, specimen: Specimen, gauge_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return the edges of a specimen's slices along the drawn gauge, and their coordinates.

    A part's slices are its bins.
    """
    if specimen.part is not None:
        coordinate = specimen.part.response.coordinate
        return np.arange(len(coordinate) + 1.0), coordinate
    if specimen.profile is None:
        material = campaign.palette.resolve(specimen.material or "")
        return np.array([0.0, gauge_mm]), np.array([material.coordinate])
    edges = slice_edges_mm(specimen.profile)
    edges = edges * (gauge_mm / edges[-1])
    return edges, specimen.profile.at(0.5 * (edges[1:] + edges[:-1]))


def setup_of(campaign: Campaign, tests: Sequence[ReplicateTest]) -> Setup:
    """Return the setup: as printed, by the palette's laws, in a rigid machine."""
    groups = [[campaign.specimens[place] for place in test.places] for test in tests]
    gauge = np.array([test.paths[test.places[0]].gauge_mm for test in tests])
    each = zip(groups, gauge.tolist(), strict=True)
    slices = [_slices_of(campaign, group[0], length) for group, length in each]
    middles = [0.5 * (edges[1:] + edges[:-1]) for edges, _ in slices]
    area = [
        _mean_section_mm2(group if group[0].part is None else (), at)
        for group, at in zip(groups, middles, strict=True)
    ]
    own, of_tests = stated(campaign.palette.reference), dict[str, Any]()
    for name, column in SPECIMEN_COLUMNS.items():
        if column.usual is not None:
            values = [[getattr(s, name) for s in group] for group in groups]
            of_tests[name] = _means(values, getattr(own, name))
    for name in ("width_mm", "thickness_mm"):
        sizes = [[_nominal_size_mm(s, name) for s in group] for group in groups]
        of_tests[name] = _means(sizes, 1.0)
    of_tests["pushed"] = np.array([group[0].pushed for group in groups])
    of_tests["reloads"] = np.stack([_reloads(test) for test in tests])
    along = [next((s.orientation for s in g if s.orientation), own.orientation) for g in groups]
    rate = np.array([np.mean([p.speed_mm_s for p in test.paths.values()]) for test in tests])
    first_slice = np.cumsum([0, *map(len, middles)], dtype=np.int64)
    return Setup(
        reference=campaign.palette.reference,
        palette_coordinate=np.array([m.coordinate for m in campaign.palette.materials]),
        first_slice=first_slice,
        time_s=np.stack([test.time_s for test in tests]),
        travel_mm=np.stack([test.travel_mm for test in tests]),
        rate_per_s=rate / gauge,
        gauge_mm=gauge,
        orientation=np.array(["xyz".index(direction or "x") for direction in along]),
        designs=tuple(group[0].profile for group in groups),
        parts=tuple(part.response if (part := group[0].part) else None for group in groups),
        x_mm=np.concatenate(middles),
        length_mm=np.concatenate([np.diff(edges) for edges, _ in slices]),
        coordinate=np.concatenate([coordinate for _, coordinate in slices]),
        area_mm2=np.concatenate(area),
        **unaltered(first_slice, len(tests[0].time_s)) | of_tests,
    )


_MET_AGAIN = 20.0
"""Power of the farthest travel over travel, by which reloads are felt. Physical: a reload meets the
first loading again some per cent beyond: 10 % beyond, a seventh of the reloads is felt."""


def _reloads(test: ReplicateTest) -> FloatArray:
    """Return how often a test was loaded again by each step; see `PulledBars.reloads`."""
    found = np.zeros(len(test.segment))
    farthest, count = 0.0, 0.0
    for step, (before, now) in enumerate(pairwise(test.travel_mm.tolist()), start=1):
        if farthest > 0.0:
            up = max(min(now, farthest) - min(before, farthest), 0.0)
            count += test.segments[test.segment[step]].cycles * up / farthest
            count *= (farthest / max(now, farthest)) ** _MET_AGAIN
        farthest = max(farthest, now)
        found[step] = count
    return found


def _mean_section_mm2(group: Sequence[Specimen], x_mm: FloatArray) -> FloatArray:
    """Return the mean section of specimens along the gauge; 1 mm² where it is unknown."""
    found = [area for s in group if (area := s.section_mm2(x_mm)) is not None]
    return np.mean(found, axis=0) if found else np.ones_like(x_mm)


def _nominal_size_mm(specimen: Specimen, name: str) -> float | None:
    """Return nominal `width_mm` or `thickness_mm`, else the design's mean, else the measured.

    A part of no stated section is a sheet of its mean thickness, endlessly wide.
    """
    own: float | None = getattr(specimen, name)
    design = specimen.profile
    if own is None and specimen.part is not None:
        return specimen.part.response.thickness_mm if name == "thickness_mm" else np.inf
    if own is None and design is not None and getattr(design, name) is not None:
        own = float(np.trapezoid(getattr(design, name), design.x_mm)) / design.length_mm
    return getattr(specimen, f"measured_{name}") if own is None else own


def _means(groups: Sequence[Sequence[float | None]], otherwise: float) -> FloatArray:
    """Return the mean of what is known of each group."""
    known = [[value for value in group if value is not None] for group in groups]
    return np.array([np.mean(values or [otherwise]) for values in known])
