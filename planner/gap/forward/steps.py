"""The steps of a test: how a path of legs is walked in a set number of strides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.forward.legs import Kind, Leg, Path

__all__ = [
    "STEPS",
    "Walk",
    "agree",
    "cut",
    "feature_places",
    "hold_scale_s",
    "instants_s",
    "moments_s",
    "walk_of",
]

STEPS = 64
"""Of every test, the first at rest included."""

_LEAST = 6
_MOST_LEGS = 24
_HOLD_DECADES = 1000.0
_TRAVEL_TOLERANCE = 0.03
_TIME_TOLERANCE = 0.1
_SHORTEST_SHARE = 0.6

_FRACTIONS: Mapping[Kind, tuple[tuple[float, ...], ...]] = {
    "loading": (
        (0.06, 0.12, 0.2, 0.32, 0.46, 0.64, 0.82, 1.0),
        (0.08, 0.18, 0.32, 0.5, 0.75, 1.0),
        (0.1, 0.25, 0.45, 0.7, 1.0),
    ),
    "unloading": ((0.2, 0.45, 0.7, 0.9), (0.2, 0.45, 0.7, 0.9), (0.25, 0.6, 0.9)),
    "reloading": ((0.25, 0.5, 0.75, 1.0), (0.25, 0.5, 0.75, 1.0), (0.3, 0.65, 1.0)),
    "hold": ((0.2, 0.4, 0.6, 0.8, 1.0), (0.25, 0.5, 0.75, 1.0), (0.25, 0.5, 0.75, 1.0)),
    "rest": ((), (), ()),
}
"""Places of features along a leg, three lists each: fewer a leg where more legs have any."""

FEATURES_MOST = 18
ROWS_LEAST = 5


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """The steps of one test.

    Attributes
    ----------
    legs
        The mean of the specimens' own, rows of the first one's record.
    leg, fraction : (T,)
        Where each step is: its leg, and how much of it is behind it. Of a rest the fraction is
        that of the logarithm of time, see `instants_s`.
    """

    legs: tuple[Leg, ...]
    leg: IntArray
    fraction: FloatArray

    @property
    def travel_mm(self) -> FloatArray:
        """Of the crosshead at every step."""
        begin = np.array([leg.begin_mm for leg in self.legs])[self.leg]
        end = np.array([leg.end_mm for leg in self.legs])[self.leg]
        fraction = np.where([not leg.moves for leg in self.legs], 1.0, 0.0)[self.leg]
        return np.asarray(begin + np.maximum(self.fraction, fraction) * (end - begin))


def agree(one: Path, other: Path) -> bool:
    """Say whether two specimens went the same way, at the same pace.

    Pulls that only load may end elsewhere, as long as the shorter is not much shorter.
    """
    if [leg.kind for leg in one.legs] != [leg.kind for leg in other.legs]:
        return False
    if abs(one.speed_mm_s / other.speed_mm_s - 1.0) > _TIME_TOLERANCE:
        return False
    if len(one.legs) == 1:
        ends = one.legs[0].end_mm, other.legs[0].end_mm
        return min(ends) > _SHORTEST_SHARE * max(ends)
    spread = max(leg.end_mm for leg in one.legs)
    return all(
        abs(a.end_mm - b.end_mm) <= _TRAVEL_TOLERANCE * spread
        and abs((a.end_s - a.begin_s) / (b.end_s - b.begin_s) - 1.0) <= _TIME_TOLERANCE
        for a, b in zip(one.legs, other.legs, strict=True)
    )


def cut(path: Path, most_mm: float) -> Path:
    """Return a path up to where its travel passes `most_mm` first."""
    for at, leg in enumerate(path.legs):
        if leg.end_mm > most_mm * (1.0 + 1e-9):
            begin = max(leg.begin_mm, 0.0)
            if begin >= most_mm:
                return replace(path, legs=path.legs[:at])
            when = float(moments_s(path, leg, np.array([most_mm]))[0])
            return replace(path, legs=(*path.legs[:at], replace(leg, end_mm=most_mm, end_s=when)))
    return replace(path, legs=path.legs[:_MOST_LEGS])


def moments_s(path: Path, leg: Leg, travel_mm: FloatArray) -> FloatArray:
    """Return when a specimen's travel was at these places of a moving leg."""
    sign = 1.0 if leg.end_mm > leg.begin_mm else -1.0
    inside = (path.time_s > leg.begin_s) & (path.time_s < leg.end_s)
    rows = sign * path.travel_mm[inside]
    even = 0.5 * (np.maximum.accumulate(rows) + np.minimum.accumulate(rows[::-1])[::-1])
    low, high = sign * leg.begin_mm, sign * leg.end_mm
    places = np.concatenate([[low], np.clip(even, low, high), [high]])
    times = np.concatenate([[leg.begin_s], path.time_s[inside], [leg.end_s]])
    return np.asarray(np.interp(sign * travel_mm, places, times))


def instants_s(leg: Leg, fraction: FloatArray, first_s: float) -> FloatArray:
    """Return times since a rest began, even in the logarithm of `first_s` and them."""
    length = leg.end_s - leg.begin_s
    return np.asarray(first_s * np.expm1(fraction * np.log1p(length / first_s)))


def hold_scale_s(leg: Leg) -> float:
    """Return the time from which on a rest is looked at evenly in the logarithm of time."""
    return (leg.end_s - leg.begin_s) / _HOLD_DECADES


def feature_places(legs: Sequence[Leg]) -> list[tuple[float, ...]]:
    """Return where along each leg features are taken: () on most.

    The first loading, the first and the last unloading, the last reloading and the longest hold
    have some, `FEATURES_MOST` in all at most. A leg of few rows has its end only.
    """
    kinds = [leg.kind for leg in legs]
    chosen: set[int] = {0}
    down = [i for i, kind in enumerate(kinds) if kind == "unloading"]
    up = [i for i, kind in enumerate(kinds) if kind == "reloading"]
    held = [i for i, kind in enumerate(kinds) if kind == "hold"]
    chosen.update(down[:1] + down[-1:] + up[-1:])
    if held:
        chosen.add(max(held, key=lambda i: legs[i].end_s - legs[i].begin_s))
    for level in range(3):
        places = [_FRACTIONS[kind][level] if i in chosen else () for i, kind in enumerate(kinds)]
        if sum(map(len, places)) <= FEATURES_MOST:
            break
    return [
        some if leg.rows >= ROWS_LEAST else some[-1:]
        for some, leg in zip(places, legs, strict=True)
    ]


def walk_of(paths: Sequence[Path], extra: Sequence[float] = ()) -> Walk:
    """Return the steps of a test whose specimens went these ways.

    Parameters
    ----------
    extra
        Fractions of the first loading that must be steps, beside the features' own.
    """
    if len(paths[0].legs) == 1:
        shortest = min(path.legs[0].end_mm for path in paths)
        paths = [cut(path, shortest) for path in paths]
    legs = tuple(
        replace(
            together[0],
            **{
                name: float(np.mean([getattr(leg, name) for leg in together]))
                for name in ("begin_s", "end_s", "begin_mm", "end_mm")
            },
        )
        for together in zip(*(path.legs for path in paths), strict=True)
    )
    wanted = [sorted({*places, 1.0}) for places in feature_places(legs)]
    wanted[0] = sorted({*wanted[0], *extra})
    counts = _counts(legs, [len(places) for places in wanted])
    leg = np.concatenate([[0], np.repeat(np.arange(len(legs)), counts)])
    fraction = np.concatenate(
        [[0.0], *(_filled(w, n) for w, n in zip(wanted, counts, strict=True))]
    )
    return Walk(legs, leg, fraction)


def _counts(legs: Sequence[Leg], least: Sequence[int]) -> list[int]:
    """Share `STEPS` but one out among legs by their way, a rest's as half of the longest."""
    all_ = STEPS - 1
    ways = np.array([abs(leg.end_mm - leg.begin_mm) if leg.moves else 0.0 for leg in legs])
    ways[[not leg.moves for leg in legs]] = 0.5 * float(ways.max())
    floor = min(_LEAST, all_ // len(legs))
    counts = np.maximum(least, floor)
    while counts.sum() > all_:
        floor -= 1
        counts = np.maximum(least, floor)
    while counts.sum() < all_:
        counts[int(np.argmax(ways / counts))] += 1
    return [int(n) for n in counts]


def _filled(places: Sequence[float], count: int) -> FloatArray:
    """Add places between 0 and 1, each halving the widest gap, up to `count`."""
    found = [0.0, *places]
    while len(found) <= count:
        at = int(np.argmax(np.diff(found)))
        found.insert(at + 1, 0.5 * (found[at] + found[at + 1]))
    return np.array(found[1:])
