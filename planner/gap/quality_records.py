"""Faults of single records: clipped force, dead cells, clocks, motion, sizes, copies."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from planner.formats.specimens import SPECIMEN_COLUMNS, SpecimenColumn
from planner.formats.units import QUANTITY_UNITS
from planner.gap.campaign import Specimen, replicate_groups
from planner.gap.diagnosis import QualityProblem
from planner.materials.characterise import MINIMUM_POINTS, noise_sd
from planner.numerics import FloatArray, IntArray

__all__ = [
    "BEARING_SHARE",
    "HOLDS",
    "RATE_TOLERANCE",
    "UNLOADS",
    "first_turn",
    "hold_share",
    "record_problems",
    "speed_mm_s",
    "turns",
    "unloading_share",
    "without_spikes",
]


# ------------------------------------------------------------------------------------------------
# Problems of single records, one by one and of all at once.


_Problems = Iterator[tuple[str, str]]
"""What is wrong with one specimen: the kind, and in words what was found against what was expected,
without the specimen's name."""


def record_problems(specimens: Sequence[Specimen]) -> list[QualityProblem]:
    """Return what is wrong with single records, held against their own declaration.

    A record whose force stood still is named for that, and neither for its protocol nor as clipped.
    """
    dead = _each(_dead_cell, specimens)
    silent = {p.specimen for p in dead}
    live = [s for s in specimens if s.id not in silent]
    timed = [s for s in specimens if s.rate_mm_s is not None and s.time_recorded]
    return [
        *dead,
        *_sizes(specimens),
        *_shared(_rate, timed),
        *_each(_protocol, live),
        *_amplitudes(specimens),
        *_each(_clipping, live),
        *_duplicates(specimens),
        *_each(_timing, specimens),
    ]


def _each(
    check: Callable[[Specimen], _Problems], specimens: Sequence[Specimen]
) -> list[QualityProblem]:
    return [QualityProblem(s.id, *found) for s in specimens for found in check(s)]


def _shared(
    check: Callable[[Specimen], _Problems], specimens: Sequence[Specimen]
) -> list[QualityProblem]:
    """Find one problem of the whole campaign where all specimens, over two, have an equal one."""
    found = _each(check, specimens)
    equal = len({(p.kind, p.problem) for p in found}) == 1
    if len(specimens) > 2 and len(found) == len(specimens) and equal:
        return [replace(found[0], specimen=None)]
    return found


# ------------------------------------------------------------------------------------------------
# Force that stands still at its largest value while the crosshead moves on.


_SHORTEST = 5
"""Points of a plateau. Chosen: fewer equal ones may be chance."""

_RISE, _RISE_SHARE = 4.0, 0.01
"""The force should have risen by so many times noise and resolution, and by so much of its peak,
along the plateau. Chosen: four deviations are no noise; a material that yields levels off before
its force stands still."""


def _clipping(s: Specimen) -> _Problems:
    """Yield a load cell or amplifier that was at its limit."""
    run = _plateau(s)
    if run is not None:
        yield (
            "clipped",
            f"force stands at {float(s.force_N[run[0]]):.4g} N over {run[1] - run[0]} points from "
            f"strain {s.strain[run[0]]:.3g} while the crosshead moves on; the load cell's limit?",
        )


def _plateau(s: Specimen) -> tuple[int, int] | None:
    """First and last-but-one index of the run at the largest force, if nothing else explains it."""
    force, way = s.load_N, s.travel_mm
    top = float(np.max(force))
    at_top = force >= top - 1e-9 * abs(top)
    start, stop = _longest_run(at_top)
    if stop - start < _SHORTEST or start < _SHORTEST:
        return None
    # A coarse resolution gives runs of equal values everywhere, not only at the top.
    equal = (np.diff(force) == 0.0) & ~at_top[1:]
    elsewhere = _longest_run(equal)
    if stop - start < 3 * (elsewhere[1] - elsewhere[0] + 1):
        return None
    first = max(start - max(_SHORTEST, (stop - start) // 5), 0)
    travel = float(way[stop - 1] - way[start])
    approach = float(way[start] - way[first])
    if travel <= 0.0 or approach <= 0.0:
        return None
    expected = travel * float(top - force[first]) / approach
    steps = np.abs(np.diff(force))
    resolution = float(np.min(steps[steps > 0.0], initial=top))
    least = max(_RISE * (noise_sd(force[:start]) + resolution), _RISE_SHARE * top)
    return (start, stop) if expected > least else None


def _longest_run(flags: np.ndarray) -> tuple[int, int]:
    """Return begin and end of the longest run of True, (0, 0) if there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    if not len(edges):
        return 0, 0
    starts, stops = edges[::2], edges[1::2]
    at = int(np.argmax(stops - starts))
    return int(starts[at]), int(stops[at])


# ------------------------------------------------------------------------------------------------
# What the crosshead did: its speed, its turns and its rests.


_BLOCKS, _BLOCKS_A_WAY = 60, 10
"""A record is looked at in about so many steps, and so many at least from one turn to the next.
Chosen: over a step noise of the travel evens out; the one that holds a turn shows less than the
speed, and must be one of ten."""

_TURN_SHARE = 0.05
"""A way back of less than this share of the range of travel is no turn. Chosen: wider than in
`segments`, as here noise has not been judged yet."""

BEARING_SHARE = 0.2
"""A specimen bears load above this share of its largest load so far. Chosen: a broken one bears
next to nothing."""


def turns(values: FloatArray, least: float) -> IntArray:
    """Return the ends and the turns between them, of more than `least` each."""
    corners = [0]
    low = high = 0
    rising = 0
    for i, value in enumerate(values.tolist()):
        if value > values[high]:
            high = i
        if value < values[low]:
            low = i
        if rising >= 0 and values[high] - value > least:
            if rising > 0 or high > 0:
                corners.append(high)
            rising, low = -1, i
            high = i
        elif rising <= 0 and value - values[low] > least:
            if rising < 0 or low > 0:
                corners.append(low)
            rising, high = 1, i
            low = i
    last = len(values) - 1
    end = {1: high, -1: low, 0: last}[rising]
    if end != corners[-1]:
        corners.append(end)
    return np.array(corners, dtype=np.int64)


def _turns_of(displacement_mm: FloatArray) -> IntArray:
    return turns(displacement_mm, _TURN_SHARE * float(np.ptp(displacement_mm)))


def _resolving(displacement_mm: FloatArray, least: int) -> int:
    """Return in how many steps to look at a record so that each way between turns has some."""
    return max(least, _BLOCKS_A_WAY * (len(_turns_of(displacement_mm)) - 1))


def _blocks(time_s: FloatArray, values: FloatArray, count: int) -> tuple[FloatArray, ...]:
    """Return times and means of `values` over about `count` runs of points of equal number."""
    size = max(1, len(values) // count)
    starts = np.arange(0, len(values) - size + 1, size)
    share = 1.0 / size
    return (
        np.add.reduceat(time_s[: starts[-1] + size], starts) * share,
        np.add.reduceat(values[: starts[-1] + size], starts) * share,
    )


def speed_mm_s(time_s: FloatArray, displacement_mm: FloatArray) -> float:
    """Return the crosshead's speed: half of its way was faster, half slower.

    Rests do not count, as they add no way; loading and unloading both do.
    """
    time, travel = _blocks(time_s, displacement_mm, _resolving(displacement_mm, _BLOCKS))
    way = np.abs(np.diff(travel))
    speeds = way / np.diff(time)
    order = np.argsort(speeds, kind="stable")
    share = np.cumsum(way[order])
    return float(speeds[order][int(np.searchsorted(share, 0.5 * share[-1]))])


def first_turn(travel_mm: FloatArray) -> int:
    """Return the index of the first peak of travel that a way back follows, else the last one."""
    for at, after in pairwise(_turns_of(travel_mm)):
        if travel_mm[after] < travel_mm[at]:
            return int(at)
    return len(travel_mm) - 1


def unloading_share(specimen: Specimen) -> float:
    """Return the longest way back of a specimen that bears load, over the range of travel.

    Whether it does is told by medians just before the way back begins and just behind, so that
    the way back of a broken specimen's grips does not count, and a drop-out hides none.
    """
    travel, load = specimen.travel_mm, specimen.load_N
    near = _TURN_SHARE * float(np.ptp(travel))
    longest = 0.0
    for at, after in pairwise(_turns_of(travel).tolist()):
        fall = float(travel[at] - travel[after])
        if fall <= longest:
            continue
        before = int(np.argmax(travel[at] - travel[: at + 1] < near))
        behind = max(1, int(np.argmax(travel[at] - travel[at + 1 : after + 1] > near)))
        sides = load[before : at + 1], load[at + 1 : at + 1 + behind]
        if min(map(np.median, sides)) >= BEARING_SHARE * float(np.max(load[: at + 1])):
            longest = fall
    return longest / float(np.ptp(travel))


# ------------------------------------------------------------------------------------------------
# Force that does not change while the specimen is pulled.


_STEADY_SHARE = 0.02
"""Change over its middle below which a load stands still. Chosen: a load that starts at rest rises
by all of its peak."""

_NOISE = 6.0
"""Spread of means below which a load stands still, in their deviations. Physical: a score of means
of noise alone spread over 3.7 on average, and over 6 once in 300."""

_MEANS = 20
"""Of a first loading. Chosen: what `_NOISE` is reckoned with."""

_LEAST_STRAIN = 0.01
"""From which a load should show. Chosen: below 1 % slack may take up the travel."""

_ARRIVED = 0.98
"""Share of the way to its turn at which a loading ends. Chosen: a crosshead slows down before a
hold."""

_FEWEST = 5
"""Points of a loading that is judged. Chosen: fewer may all lie in the zero."""


def _dead_cell(s: Specimen) -> _Problems:
    """Yield a force that stood still, but for noise, over the first loading."""
    stop = _loaded(s)
    if stop < _FEWEST or float(s.strain[stop - 1]) < _LEAST_STRAIN:
        return
    time, force = _blocks(s.time_s[:stop], s.force_N[:stop], _MEANS)
    points = max(stop // len(time), 1)
    noise = _NOISE * noise_sd(s.force_N[:stop]) / np.sqrt(points)
    middle = float(np.median(force))
    if float(np.ptp(force)) <= max(_STEADY_SHARE * abs(middle), noise):
        yield (
            "dead",
            f"force stays at {middle:.3g} N while the crosshead goes from 0 to "
            f"{s.displacement_mm[stop - 1]:.3g} mm; a dead or unplugged load cell? Leave the "
            "specimen out",
        )


def _loaded(s: Specimen) -> int:
    """Return how many points the first loading has, a hold at its end left out."""
    turn = first_turn(s.travel_mm)
    travel = s.travel_mm[: turn + 1]
    return int(np.argmax(travel >= _ARRIVED * float(np.max(travel)))) + 1


# ------------------------------------------------------------------------------------------------
# Gaps in the time channel, and single points that leap out of the record.


_GAP = 5.0
"""A step of so many times those before and behind it is a gap. Chosen: adaptive sampling changes
less at once."""

_SPIKE_NOISE, _SPIKE_SHARE, _SPIKE_STEP = 12.0, 0.03, 5.0
"""A spike leaps by so many noise deviations, so much of the range, so many steps nearby. Chosen:
noise never does, and what leaps by less than the scatter of specimens does no harm."""

_WIDEST = 3
_AROUND = 6
"""Points that a spike has at most, and that are looked at on either side, fewer at an end. Chosen:
what lasts longer is an event; twice as many beside it tell how the record goes."""


def _timing(s: Specimen) -> _Problems:
    """Yield lost data and spikes."""
    gaps = _dropouts(s.time_s) if s.time_recorded else np.zeros(0, dtype=np.int64)
    if len(gaps):
        steps = np.diff(s.time_s)
        longest = int(gaps[np.argmax(steps[gaps])])
        yield (
            "dropout",
            f"{_times(len(gaps), 'gap')} in time, the longest {steps[longest]:.3g} s from "
            f"{s.time_s[longest]:.4g} s, where {float(np.median(steps)):.3g} s is usual",
        )
    for first, _ in _stop(s):
        yield (
            "spike",
            f"force_N leaps from {s.force_N[first - 1]:.4g} to {s.force_N[-1]:.4g} at its end, at "
            f"{s.time_s[first]:.4g} s; left out of what is compared. Does something meet a stop?",
        )
    for name, values in (("force_N", s.force_N), ("displacement_mm", s.displacement_mm)):
        found = [first for first, _ in _spikes(values)]
        if found:
            yield (
                "spike",
                f"{_times(len(found), 'spike')} in {name}, the first of {values[found[0]]:.4g} at "
                f"{s.time_s[found[0]]:.4g} s; left out of what is compared",
            )


def _dropouts(time_s: FloatArray) -> IntArray:
    """Return the indices of steps far longer than those before and behind them."""
    steps = np.diff(time_s)
    if len(steps) < 7:
        return np.zeros(0, dtype=np.int64)
    windows = np.lib.stride_tricks.sliding_window_view(steps, 3)
    middle = np.median(windows, axis=1)
    inner = np.arange(3, len(steps) - 3)
    nearby = np.maximum(middle[inner - 3], middle[inner + 1])
    found: IntArray = inner[steps[inner] > _GAP * nearby]
    return found


def without_spikes(specimen: Specimen) -> Specimen:
    """Return a specimen without the points that leap out of its force or travel."""
    keep = np.ones(len(specimen.time_s), dtype=np.bool_)
    spikes = (*_spikes(specimen.force_N), *_spikes(specimen.displacement_mm), *_stop(specimen))
    for first, stop in spikes:
        keep[first:stop] = False
    if keep.all() or keep.sum() < MINIMUM_POINTS:
        return specimen
    return replace(
        specimen,
        time_s=specimen.time_s[keep],
        displacement_mm=specimen.displacement_mm[keep],
        force_N=specimen.force_N[keep],
    )


def _spikes(values: FloatArray) -> list[tuple[int, int]]:
    """Return begin and end, as of slices, of up to `_WIDEST` points that leap out of a record.

    A turn of a triangle wave or a break is none: a spike leaps further than the record moves
    nearby on both sides, and ends where it began.
    """
    n = len(values)
    low, high = np.quantile(values, [0.02, 0.98])  # without what leaps out
    least = max(_SPIKE_NOISE * noise_sd(values), _SPIKE_SHARE * float(high - low))
    moves = np.abs(np.diff(values))
    found: list[tuple[int, int]] = []
    for width in range(1, _WIDEST + 1):
        before = np.arange(max(n - 1 - width, 0))
        rise = values[before + 1] - values[before]
        fall = values[before + width] - values[before + width + 1]
        leap = np.minimum(np.abs(rise), np.abs(fall))
        for i in before[(rise * fall > 0.0) & (leap > least)]:
            if any(abs(i + 1 - f) <= _WIDEST for f, _ in found):
                continue
            behind = moves[i + width + 1 : i + width + _AROUND]
            near = np.concatenate([moves[max(i - _AROUND, 0) : i], behind])
            back = abs(values[i + width + 1] - values[i])
            this = min(
                abs(values[i + 1] - values[i]), abs(values[i + width + 1] - values[i + width])
            )
            if this > _SPIKE_STEP * float(np.max(near)) and back < 0.5 * this:
                found.append((int(i) + 1, int(i) + width + 1))
    return sorted(found)


def _stop(s: Specimen) -> list[tuple[int, int]]:
    """Return the last points if force leaps away from zero there, while the crosshead does not.

    So it does where a crosshead or an over-stretched specimen meets a stop.
    """
    size, duration = np.abs(s.force_N), np.diff(s.time_s)
    n = len(size)
    least = max(_SPIKE_NOISE * noise_sd(s.force_N), _SPIKE_SHARE * float(np.ptp(size[:-_WIDEST])))
    speed, rise = np.abs(np.diff(s.displacement_mm)) / duration, np.abs(np.diff(size)) / duration
    for width in range(1, min(_WIDEST, n - _AROUND - 1) + 1):
        i = n - 1 - width
        before = slice(i - _AROUND, i)
        leaps = rise[i] > _SPIKE_STEP * np.max(rise[before]) and size[i + 1] - size[i] > least
        onwards = (np.diff(size[i:]) > 0.0).all()
        if leaps and onwards and np.max(speed[i:]) < _SPIKE_STEP * np.max(speed[before]):
            return [(i + 1, n)]
    return []


def _times(count: int, what: str) -> str:
    return f"a {what}" if count == 1 else f"{count} {what}s"


# ------------------------------------------------------------------------------------------------
# The declared rate against travel and time.


RATE_TOLERANCE = 0.1
"""Log ratio from which the crosshead's speed is another than declared. Chosen: machines hold a
speed to 1 %, rounded times may hide a few per cent."""

_MINUTE, _INCH = QUANTITY_UNITS["time"]["min"], QUANTITY_UNITS["length"]["in"]
_SLIPS = (
    (_MINUTE, "mm/s and mm/min, or s and min, were mixed up"),
    (_INCH, "mm and inches were mixed up in travel or rate"),
    (_INCH * _MINUTE, "mm/s and in/min were mixed up"),
    (1.0 / QUANTITY_UNITS["time"]["ms"], "s and ms were mixed up"),
)
"""Factors that mixing up two units leaves. Physical: by the units' definitions."""


def _rate(s: Specimen) -> _Problems:
    """Yield a crosshead that moved at another speed than declared."""
    speed, declared = speed_mm_s(s.time_s, s.travel_mm), s.rate_mm_s
    if declared is None or speed <= 0.0:
        return
    off = abs(math.log(speed / declared))
    # Rounded times make steps of a record too short or too long, but not the way to its end.
    turn = _loaded(s) - 1
    way = float(s.travel_mm[turn] - s.travel_mm[0])
    mean = way / float(s.time_s[turn] - s.time_s[0]) if turn > 0 else 0.0
    if off <= RATE_TOLERANCE or (mean > 0.0 and abs(math.log(mean / declared)) <= RATE_TOLERANCE):
        return
    reasons = [words for factor, words in _SLIPS if abs(off - math.log(factor)) < RATE_TOLERANCE]
    yield (
        "rate",
        f"the crosshead moves at {speed:.3g} mm/s by its time channel, {declared:.3g} mm/s "
        f"is declared{f'; {reasons[0]}' if reasons else ''}",
    )


# ------------------------------------------------------------------------------------------------
# Curves that are copies of one another.


_SIGNIFICANT_DIGITS = 7
"""In which two curves are the same. Convention: more than a load cell resolves, so that no two
measurements agree, and fewer than files lose."""


def _duplicates(specimens: Sequence[Specimen]) -> Iterator[QualityProblem]:
    """Yield specimens whose force and travel are another's, number for number.

    Time does not count: a copy may start elsewhere.
    """
    seen: dict[bytes, str] = {}
    for s in specimens:
        digits = _rounded(s.force_N).tobytes() + _rounded(s.displacement_mm).tobytes()
        other = seen.setdefault(digits, s.id)
        if other != s.id:
            words = f"its curve is that of specimen {other}, number for number"
            yield QualityProblem(s.id, "duplicate", words)


def _rounded(values: np.ndarray) -> np.ndarray:
    scale = float(np.max(np.abs(values))) or 1.0
    return np.round(values / scale, _SIGNIFICANT_DIGITS) * float(f"{scale:.{_SIGNIFICANT_DIGITS}g}")


# ------------------------------------------------------------------------------------------------
# Sizes that no tensile specimen has, and measured ones far from nominal.


_DEVIATION = 0.25
_SLACK_MM = 0.4
"""Measured from nominal size, as a share and in millimetres, above the larger of which it is told.
Physical: jetted parts print up to 0.3 mm oversize."""


def _sizes(specimens: Sequence[Specimen]) -> Iterator[QualityProblem]:
    """Yield implausible sizes of coupons and bars; one that all share is the campaign's."""
    for name, column in SPECIMEN_COLUMNS.items():
        if column.is_size:
            sized = [s for s in specimens if getattr(s, name) is not None and s.part is None]
            yield from _shared(partial(_implausible, column=column), sized)
    for name in ("width", "thickness"):
        yield from _each(partial(_off_nominal, name=name), specimens)


def _implausible(s: Specimen, column: SpecimenColumn) -> _Problems:
    size: float = getattr(s, column.name)
    low, high = column.plausible
    if not low <= size <= high:
        inches = "; inches?" if size < low <= size * _INCH <= high else ""
        yield (
            "size",
            f"{column.name} is {size:.4g}; tensile specimens have {low:g} to {high:g} mm{inches}",
        )


def _off_nominal(s: Specimen, name: str) -> _Problems:
    nominal: float | None = getattr(s, f"{name}_mm")
    measured: float | None = getattr(s, f"measured_{name}_mm")
    if nominal is None or measured is None:
        return
    if abs(measured - nominal) > max(_DEVIATION * nominal, _SLACK_MM):
        yield (
            "size",
            f"measured {name} is {measured:.4g} mm, nominal {nominal:.4g} mm; width and thickness "
            "swapped, or another unit?",
        )


# ------------------------------------------------------------------------------------------------
# The declared protocol and amplitude against what the crosshead did.


UNLOADS = 0.1
HOLDS = 0.3
"""Shares of range and of duration from which unloading and holding are on purpose. Chosen: machines
settle by less at a turn, and wait for less before and after a pull."""

_PACE_SHARE, _LOAD_SHARE = 0.05, 0.1
"""Of the mean pace, below which a crosshead rests, and of the largest load, above which a specimen
is loaded. Chosen: a creeping crosshead is no test, and an unloaded specimen shows its zero only."""

_AGREEING = 0.02
"""Relative spread of replicates' amplitudes that agree. Chosen: machines turn to within half
of it."""

_AMPLITUDE_TOLERANCE = 0.1
"""Relative, of the travel declared or the replicates'. Chosen: machines turn to within 1 %; slack
and a start that is not at zero take a few per cent."""
_STRAINS = ("to_strain", "amplitude_strain", "strain_amplitude", "peak_strain", "hold_strain")
_TRAVELS = ("amplitude_mm", "peak_mm", "hold_mm", "to_mm")


def _protocol(s: Specimen) -> _Problems:
    """Yield a test that was another than its protocol says."""
    back, held = unloading_share(s), hold_share(s)
    found = None
    if s.protocol == "monotonic" and back > UNLOADS:
        found = f"it is unloaded by {100 * back:.0f} % of its travel; a cyclic test?"
    elif s.protocol == "monotonic" and held > HOLDS:
        found = f"it is held for {100 * held:.0f} % of its time; a relaxation test?"
    elif s.protocol == "cyclic" and back < 0.5 * UNLOADS:
        found = "it is never unloaded"
    elif s.protocol == "relaxation" and held < 0.5 * HOLDS:
        found = f"it is held for {100 * held:.0f} % of its time only"
    if found is not None:
        yield "protocol", f"declared {s.protocol}, but {found}"


def hold_share(specimen: Specimen) -> float:
    """Return the share of the duration in which the crosshead rests on a loaded specimen."""
    count = _resolving(specimen.travel_mm, 200)
    time, travel = _blocks(specimen.time_s, specimen.travel_mm, count)
    _, force = _blocks(specimen.time_s, specimen.load_N, count)
    way, duration = np.abs(np.diff(travel)), np.diff(time)
    mean = float(np.sum(way)) / float(np.sum(duration))
    rests = (way < _PACE_SHARE * mean * duration) & (force[1:] > _LOAD_SHARE * float(np.max(force)))
    return float(np.sum(duration[rests])) / float(np.sum(duration))


def _amplitudes(specimens: Sequence[Specimen]) -> Iterator[QualityProblem]:
    """Yield specimens that were strained to another amplitude than declared, or than the others.

    Declared is what a further column such as `to_strain` or `amplitude_mm` says. Without one, a
    cyclic or relaxation specimen that stands alone among at least two replicates that agree is
    named.
    """
    for s in specimens:
        declared = _declared_mm(s)
        peak = float(np.max(s.travel_mm))
        broken = s.protocol in (None, "monotonic")
        if declared is None or (broken and peak < declared):
            continue
        if abs(peak / declared - 1.0) > _AMPLITUDE_TOLERANCE:
            yield _amplitude(s, peak, declared, "is declared")
    for group in replicate_groups(specimens):
        members = [specimens[i] for i in group if specimens[i].protocol in ("cyclic", "relaxation")]
        peaks = np.array([float(np.max(s.travel_mm)) for s in members])
        if len(members) < 3 or any(_declared_mm(s) is not None for s in members):
            continue
        middle = float(np.median(peaks))
        off = np.abs(peaks / middle - 1.0) > _AMPLITUDE_TOLERANCE
        if off.sum() == 1 and np.ptp(peaks[~off]) < _AGREEING * middle:
            at = int(np.argmax(off))
            yield _amplitude(members[at], float(peaks[at]), middle, "is its replicates'")


def _declared_mm(specimen: Specimen) -> float | None:
    for names, factor in ((_STRAINS, specimen.gauge_mm), (_TRAVELS, 1.0)):
        for name in names:
            value = specimen.covariates.get(name)
            if isinstance(value, float) and value > 0.0:
                return value * factor
    return None


def _amplitude(s: Specimen, peak: float, expected: float, whose: str) -> QualityProblem:
    words = f"travels to {peak:.3g} mm, where {expected:.3g} mm {whose}"
    return QualityProblem(s.id, "amplitude", words)
