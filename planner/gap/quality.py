"""Data quality of a campaign: each record alone, against the others, against the palette."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np
from scipy.special import stdtr

from planner.formats.specimens import SPECIMEN_COLUMNS, SpecimenColumn
from planner.formats.units import QUANTITIES, QUANTITY_UNITS, UnitOf, slips, unit_near
from planner.gap.campaign import Campaign, Specimen, axis_columns, replicate_groups
from planner.gap.diagnosis import FoundEffect, QualityProblem
from planner.gap.localise import specimen_patterns
from planner.gap.observations import BRANCHES, ObservationModel
from planner.gap.segments import (
    TIME_TOLERANCE,
    TURN_SHARE,
    hold_share,
    leap_at_end,
    path_of,
    speed_mm_s,
    unloading_share,
)
from planner.materials.characterise import (
    BROKEN_SHARE,
    MINIMUM_POINTS,
    SPIKE_NOISE,
    SPIKE_STEP,
    UNLOADED_SHARE,
    WIDEST_SPIKE,
    noise_sd,
    spikes_in,
)
from planner.numerics import FloatArray

__all__ = ["HOLDS", "UNLOADS", "examine", "merged_units", "suggested_units"]


# ------------------------------------------------------------------------------------------------
# Problems of single records, one by one and of all at once.


_Check = Callable[[Specimen], Iterator[str]]
"""What is wrong with one specimen, in words: what was found against what was expected, without the
specimen's name."""


def _each(kind: str, check: _Check, specimens: Sequence[Specimen]) -> list[QualityProblem]:
    return [QualityProblem(s.id, kind, words) for s in specimens for words in check(s)]


def _shared(kind: str, check: _Check, specimens: Sequence[Specimen]) -> list[QualityProblem]:
    """Find one problem of the whole campaign where all specimens, over two, have an equal one."""
    found = _each(kind, check, specimens)
    if 2 < len(specimens) == len(found) and len({p.problem for p in found}) == 1:
        return [replace(found[0], specimen=None)]
    return found


# ------------------------------------------------------------------------------------------------
# Force that stands still at its largest value while the crosshead moves on.


_RISE, _RISE_SHARE = 4.0, 0.01
"""The force should have risen by so many times noise and resolution, and by so much of its peak,
along the plateau. Chosen: four deviations are no noise; a material that yields levels off before
its force stands still."""


def _clipping(s: Specimen) -> Iterator[str]:
    """Yield a load cell or amplifier that was at its limit, if nothing else explains a plateau."""
    force, way = s.load_N, s.travel_mm
    top = float(np.max(force))
    at_top = (force >= top - 1e-9 * abs(top)).astype(np.int8)
    plateaus = np.flatnonzero(np.diff(at_top, prepend=0, append=0)).reshape(-1, 2)
    start, stop = max(plateaus.tolist(), key=lambda run: run[1] - run[0])
    if min(stop - start, start) < MINIMUM_POINTS:
        return
    first = max(start - max(MINIMUM_POINTS, (stop - start) // 5), 0)
    travel = float(way[stop - 1] - way[start])
    approach = float(way[start] - way[first])
    if travel <= 0.0 or approach <= 0.0:
        return
    expected = travel * float(top - force[first]) / approach
    steps = np.abs(np.diff(force))
    resolution = float(np.min(steps[steps > 0.0], initial=top))
    if expected > max(_RISE * (noise_sd(force[:start]) + resolution), _RISE_SHARE * top):
        yield (
            f"force stands at {float(s.force_N[start]):.4g} N over {stop - start} points from "
            f"strain {s.strain[start]:.3g} while the crosshead moves on; the load cell's limit?"
        )


# ------------------------------------------------------------------------------------------------
# Force that falls at once while the crosshead moves on.


_FALL = 0.05
"""Of the largest force. Chosen: what specimens differ by; behind a yield point it falls slowly."""


def _falls(s: Specimen) -> Iterator[str]:
    """Yield a slip in the grips or a tear, after which the specimen bears load again.

    In as many points as a spike has the force falls by far more than it moves around these, and
    does not leap back. What breaks bears none: records often end some points behind that.
    """
    keep = ~spikes_in(s.load_N)
    if keep.sum() < MINIMUM_POINTS:
        return
    force, way, strain = s.load_N[keep], s.travel_mm[keep], s.strain[keep]
    around = np.pad(np.abs(np.diff(force)), 2 * WIDEST_SPIKE, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view
    usual = SPIKE_STEP * np.median(windows(around, 4 * WIDEST_SPIKE + 1), axis=1)
    least = max(SPIKE_NOISE * noise_sd(force), _FALL * float(np.max(force)))
    # Not where the crosshead turns: real ones let go of much at once there.
    onwards = windows(np.diff(way), 2 * WIDEST_SPIKE).min(axis=1) > 0.0
    n, later = len(onwards), np.maximum.accumulate(force[::-1])[::-1]
    ahead = windows(force, WIDEST_SPIKE + 1)[:n]
    falls = ahead[:, :1] - ahead[:, 1:]
    sudden = falls > np.maximum(least, usual[:n, None] * np.arange(1, WIDEST_SPIKE + 1))
    borne = later[2 * WIDEST_SPIKE :] > BROKEN_SHARE * force[:n]
    fall = np.where(onwards & borne & sudden.any(axis=1), falls.max(axis=1), 0.0)
    if fall[at := int(np.argmax(fall))] > 0.0:
        yield (
            f"force falls by {fall[at]:.4g} N at strain {strain[at]:.3g} while the "
            "crosshead moves on. Did the specimen slip in its grips, or tear? If so, leave it out, "
            "or end its record there"
        )


# ------------------------------------------------------------------------------------------------
# Force that does not change while the specimen is pulled.


_MEANS, _NOISE = 20, 6.0
"""Of a first loading, and their spread in deviations below which its load stands still. Physical:
so many means of noise alone spread over 3.7 on average, and over 6 once in 300."""


def _dead_cell(s: Specimen) -> Iterator[str]:
    """Yield a force that stood still, but for noise, over the first loading."""
    # A crosshead slows down before a hold.
    stop = int(np.argmax(s.travel_mm >= (1.0 - TURN_SHARE) * np.max(s.travel_mm))) + 1
    if stop < MINIMUM_POINTS:
        return
    force = np.array([part.mean() for part in np.array_split(s.force_N[:stop], min(_MEANS, stop))])
    noise = _NOISE * noise_sd(s.force_N[:stop]) / np.sqrt(stop / len(force))
    middle = float(np.median(force))
    if float(np.ptp(force)) <= max(UNLOADED_SHARE * abs(middle), noise):
        yield (
            f"force stays at {middle:.3g} N while the crosshead goes from 0 to "
            f"{s.displacement_mm[stop - 1]:.3g} mm; a dead or unplugged load cell? Leave the "
            "specimen out"
        )


# ------------------------------------------------------------------------------------------------
# Load cells that were not zeroed alike.


def _zero(s: Specimen, usual: float) -> Iterator[str]:
    """Yield a force at rest that is unlike the others'; one that all share is a gap to diagnose."""
    rest, noise = float(s.load_N[0]), _NOISE * noise_sd(s.load_N)
    begins = s.travel_mm[0] <= UNLOADED_SHARE * np.max(s.travel_mm)
    if begins and abs(rest - usual) > max(UNLOADED_SHARE * float(np.max(s.load_N)), noise):
        yield f"force is {rest:.3g} N at rest, where {usual:.3g} N is usual; was the cell zeroed?"


# ------------------------------------------------------------------------------------------------
# Gaps in the time channel, and single points that leap out of the record.


def _dropouts(s: Specimen) -> Iterator[str]:
    """Yield steps of a recorded time that are far longer than those before and behind them."""
    steps = np.diff(s.time_s)
    middle = np.median(np.lib.stride_tricks.sliding_window_view(steps, 3), axis=1)
    gaps = 3 + np.flatnonzero(steps[3:-3] > SPIKE_STEP * np.maximum(middle[:-4], middle[4:]))
    if s.time_recorded and len(gaps):
        longest = int(gaps[np.argmax(steps[gaps])])
        yield (
            f"{_times(len(gaps), 'gap')} in time, the longest {steps[longest]:.3g} s from "
            f"{s.time_s[longest]:.4g} s, where {float(np.median(steps)):.3g} s is usual"
        )


def _spikes(s: Specimen) -> Iterator[str]:
    """Yield points that leap out of the record."""
    if (first := leap_at_end(s)) < len(s.force_N):
        yield (
            f"force_N leaps from {s.force_N[first - 1]:.4g} to {s.force_N[-1]:.4g} at its end, at "
            f"{s.time_s[first]:.4g} s; left out of what is compared. Does something meet a stop?"
        )
    for name, values in (("force_N", s.force_N), ("displacement_mm", s.displacement_mm)):
        if len(begins := np.flatnonzero(np.diff(spikes_in(values).astype(np.int8), prepend=0) > 0)):
            yield (
                f"{_times(len(begins), 'spike')} in {name}, the first of "
                f"{values[begins[0]]:.4g} at {s.time_s[begins[0]]:.4g} s; left out of what is "
                "compared"
            )


def _times(count: int, what: str) -> str:
    return f"a {what}" if count == 1 else f"{count} {what}s"


# ------------------------------------------------------------------------------------------------
# The declared rate against travel and time.


_INCH = QUANTITY_UNITS["length"]["in"]
_RATE_SLIPS = slips("rates")
"""Factors that mixing up two units leaves. Physical: by the units' definitions."""


def _rate(s: Specimen) -> Iterator[str]:
    """Yield a crosshead that moved at another speed than declared."""
    speed, declared = speed_mm_s(s.time_s, s.travel_mm), s.rate_mm_s
    if declared is None or speed <= 0.0:
        return
    off = abs(math.log(speed / declared))
    # Rounded times make steps of a record too short or too long, but not the way to its end.
    path = path_of(s)
    mean = speed if path is None else path.speed_mm_s
    if min(off, abs(math.log(mean / declared))) <= TIME_TOLERANCE:
        return
    factor = _slip(off, TIME_TOLERANCE, _RATE_SLIPS)
    yield (
        f"the crosshead moves at {speed:.3g} mm/s by its time channel, {declared:.3g} mm/s "
        f"is declared{f'; {_RATE_SLIPS[factor]}' if factor else ''}"
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
        if (other := seen.setdefault(digits, s.id)) != s.id:
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
            yield from _shared("size", partial(_implausible, column=column), sized)
    for name in ("width", "thickness"):
        yield from _each("size", partial(_off_nominal, name=name), specimens)


def _implausible(s: Specimen, column: SpecimenColumn) -> Iterator[str]:
    size: float = getattr(s, column.name)
    low, high = column.plausible
    if not low <= size <= high:
        inches = "; inches?" if size < low <= size * _INCH <= high else ""
        yield (
            f"{column.name} is {size:.4g}; tensile specimens have {low:g} to {high:g} mm{inches}"
        )


def _off_nominal(s: Specimen, name: str) -> Iterator[str]:
    nominal: float | None = getattr(s, f"{name}_mm")
    measured: float | None = getattr(s, f"measured_{name}_mm")
    if nominal and measured and abs(measured - nominal) > max(_DEVIATION * nominal, _SLACK_MM):
        yield (
            f"measured {name} is {measured:.4g} mm, nominal {nominal:.4g} mm; width and thickness "
            "swapped, or another unit?"
        )


# ------------------------------------------------------------------------------------------------
# The declared protocol and amplitude against what the crosshead did.


UNLOADS = 0.1
HOLDS = 0.3
"""Shares of range and of duration from which unloading and holding are on purpose. Chosen: machines
settle by less at a turn, and wait for less before and after a pull."""

_STRAINS = ("to_strain", "amplitude_strain", "strain_amplitude", "peak_strain", "hold_strain")
_TRAVELS = ("amplitude_mm", "peak_mm", "hold_mm", "to_mm")


def _protocol(s: Specimen) -> Iterator[str]:
    """Yield a test that was another than its protocol says."""
    back, held, but = unloading_share(s), hold_share(s), f"declared {s.protocol}, but it is"
    if s.protocol == "monotonic" and back > UNLOADS:
        yield f"{but} unloaded by {100 * back:.0f} % of its travel; a cyclic test?"
    elif s.protocol == "monotonic" and held > HOLDS:
        yield f"{but} held for {100 * held:.0f} % of its time; a relaxation test?"
    elif s.protocol == "cyclic" and back < 0.5 * UNLOADS:
        yield f"{but} never unloaded"
    elif s.protocol == "relaxation" and held < 0.5 * HOLDS:
        yield f"{but} held for {100 * held:.0f} % of its time only"


def _amplitudes(specimens: Sequence[Specimen]) -> Iterator[QualityProblem]:
    """Yield specimens that were strained to another amplitude than declared, or than the others.

    Declared is what a further column such as `to_strain` or `amplitude_mm` says. Without one, a
    cyclic or relaxation specimen that stands alone among at least two replicates is named.
    """
    for s in specimens:
        if (declared := _declared_mm(s)) is None:
            continue
        peak = float(np.max(s.travel_mm))
        broke = s.protocol in (None, "monotonic") and peak < declared
        if not broke and abs(peak / declared - 1.0) > TIME_TOLERANCE:
            yield _amplitude(s, peak, declared, "is declared")
    for group in replicate_groups(specimens):
        members = [specimens[i] for i in group if specimens[i].protocol in ("cyclic", "relaxation")]
        peaks = np.array([float(np.max(s.travel_mm)) for s in members])
        if len(members) < 3 or any(_declared_mm(s) is not None for s in members):
            continue
        middle = float(np.median(peaks))
        off = np.abs(peaks / middle - 1.0) > TIME_TOLERANCE
        if off.sum() == 1:
            at = int(np.argmax(off))
            yield _amplitude(members[at], float(peaks[at]), middle, "is its replicates'")


def _declared_mm(specimen: Specimen) -> float | None:
    for name in (*_STRAINS, *_TRAVELS):
        value = specimen.covariates.get(name)
        if isinstance(value, float) and value > 0.0:
            return value * specimen.gauge_mm if name in _STRAINS else value
    return None


def _amplitude(s: Specimen, peak: float, expected: float, whose: str) -> QualityProblem:
    words = f"travels to {peak:.3g} mm, where {expected:.3g} mm {whose}"
    return QualityProblem(s.id, "amplitude", words)


# ------------------------------------------------------------------------------------------------
# The load of a specimen's first loading in proportion to what the palette predicts.


_COMPARED = (0.3, 0.9)
"""Shares of a first loading, between which loads are compared. Chosen: past slack and zeros, before
the break."""


_Loads = Mapping[int, float]
"""ln of measured over predicted force, by a specimen's place."""


def _log_loads(model: ObservationModel) -> dict[int, float]:
    """Return ln(measured over predicted force) by place, the median over the first loading.

    A specimen of which less than half is above zero has none.
    """
    table, predicted = model.table, model.predicted(model.alone)
    loading = table.branch == BRANCHES.index("loading")
    found = {}
    for place in np.unique(table.specimen).tolist():
        own = np.flatnonzero(loading & (table.specimen == place))
        share = table.strain[own] / table.strain[own].max()
        own = own[(share >= _COMPARED[0]) & (share <= _COMPARED[1])]
        ratio = table.measured_raw[own] / predicted[own]
        if np.mean(ratio > 0.0) > 0.5:
            found[place] = float(np.median(np.log(ratio[ratio > 0.0])))
    return found


# ------------------------------------------------------------------------------------------------
# Specimens that differ from their replicates by more than scatter.
#
# The load of each specimen is compared with the mean of its replicates'. How far they may differ is
# told by the scatter of the others, moderated by that of all other groups (as by Smyth, Stat. Appl.
# Genet. Mol. Biol. 3, 2004): the campaign's pooled variance counts as further degrees of freedom.
# So two or three replicates are judged by what the whole campaign knows of scatter; where it knows
# nothing, by what is usual, and then only a gross fault is named.


_FAMILY_WISE = 0.003
"""Chance of any false outlier in a clean campaign, over its specimens. Convention: that of three
standard deviations."""

_LEAST_SHIFT = 0.08
"""ln load within which of its replicates' no fault of the data is seen, however small their
scatter. Physical: jetted specimens scatter by up to 9 %."""

_USUAL_SCATTER, _USUAL_WEIGHT = 0.06, 4.0
"""Standard deviation where the campaign tells none, and its weight as degrees of freedom. Physical:
jetted specimens of one print scatter by 1 to 9 %; four degrees leave it open by as much."""

_POOLED_WEIGHT = 0.25
"""Of the campaign's pooled variance, in its degrees of freedom. Calibrated: groups that scatter by
1 to 9 %, with heavy tails too, give an outlier in at most 1 % of the clean campaigns of
`tests/property/test_gap_quality_rates.py`."""

_Groups = Sequence[tuple[int, ...]]
"""Places of replicates, which differ by scatter alone."""


def _outlier_problems(specimens: Sequence[Specimen], loads: _Loads) -> Iterator[QualityProblem]:
    """Yield outlying specimens, the clearest first in each round.

    The level is Bonferroni's over specimens; one that was found is left out and the rest judged
    again.
    """
    groups = _groups(specimens, loads)
    least = _FAMILY_WISE / max(sum(map(len, groups)), 1)
    while outliers := [one for one in _judged(loads, groups) if one[0] < least]:
        _, place, shift, others = min(outliers, key=lambda one: one[0])
        gone = (place,) if len(others) > 1 else (place, *others)
        for one, other in zip(gone, reversed(gone), strict=True):
            whose = f"its {len(others)} replicates"
            if one != other:
                whose = (
                    f"its only replicate {specimens[other].id}, more than replicates elsewhere; "
                    "which of the two is off cannot be told"
                )
            words = f"load is {100 * math.expm1(shift):+.0f} % off that of {whose}"
            yield QualityProblem(specimens[one].id, "outlier", words)
        groups = [tuple(i for i in g if i not in gone) for g in groups]


def _groups(specimens: Sequence[Specimen], loads: _Loads) -> _Groups:
    """Replicates of one batch, unless that leaves less than half of what there is to compare."""
    inside, across = (
        [tuple(i for i in g if i in loads) for g in replicate_groups(specimens, with_batch=of_one)]
        for of_one in (True, False)
    )
    freedom = [sum(max(len(g) - 1, 0) for g in groups) for groups in (inside, across)]
    return inside if 2 * freedom[0] >= freedom[1] else across


def _judged(loads: _Loads, groups: _Groups) -> Iterator[tuple[float, int, float, tuple[int, ...]]]:
    """Yield p-value, place, shift and replicates of everyone that can be judged."""
    some = [members for members in groups if len(members) > 1]
    of = [np.array([loads[i] for i in members]) for members in some]
    squares = [float(np.sum((values - values.mean()) ** 2)) for values in of]
    freedoms = sum(map(len, some)) - len(some)
    for members, values, square in zip(some, of, squares, strict=True):
        # What the other groups tell of a variance; what is usual counts as one more.
        known = _USUAL_WEIGHT + freedoms - (len(members) - 1)
        centre = (_USUAL_WEIGHT * _USUAL_SCATTER**2 + sum(squares) - square) / known
        weight = max(_USUAL_WEIGHT, _POOLED_WEIGHT * known)
        for k, place in enumerate(members):
            others = np.delete(values, k)
            shift = float(values[k] - np.mean(others))
            if abs(shift) < _LEAST_SHIFT:
                continue
            freedom = weight + len(others) - 1
            variance = (weight * centre + float(np.var(others)) * len(others)) / freedom
            scale = math.sqrt(variance * (1.0 + 1.0 / len(others)))
            p = 2.0 * float(stdtr(freedom, -abs(shift) / scale))
            yield p, place, shift, tuple(m for m in members if m != place)


# ------------------------------------------------------------------------------------------------
# Forces and lengths off by the factor between two units, in all specimens or in some.


_FORCE_SLIPS = slips("forces")
_SLIPS = _FORCE_SLIPS | slips("loads")
"""Factors that mixing up two units leaves, and what it is where loads are high and where they are
low; those that another unit of force mends. Physical: by the units' definitions."""

_AMONG_REPLICATES = 0.25
"""Log distance from a slip's factor. Physical: jetted specimens scatter by up to 9 %, so that two
differ by 0.13; twice that."""

_AGAINST_LAW = 0.35
"""The same for a whole campaign against the laws. Chosen: laws and conditions may be off by a third
and more."""

_BEYOND_EFFECTS = 1.9
"""Log load of a whole campaign from which a slip may be twice as far off. Chosen: no effect of test
or print softens or stiffens all of it e^1.9 = 6.7 times."""

_NEAR_K = 5.0
"""Kelvin about the reference within which specimens tell of the whole campaign. Physical: at some 5
% per kelvin, where elastomers pass their transition, a load is off by a quarter, within
`_AGAINST_LAW`."""

_SPLIT = 1.0
"""Log gap that splits replicates. Physical: ten times what jetted specimens scatter by, and less
than the smallest factor between units, ln 4.4."""


def _unit_problems(campaign: Campaign, loads: _Loads) -> Iterator[QualityProblem]:
    """Yield what looks like another unit of force, travel or size.

    The load of each specimen is put in proportion to the laws' prediction. Travels that their own
    rate tells are named first: as laws bend, the load is off by less than the unit's factor. Then
    specimens apart from their replicates by such a factor; then singles apart from the trend of
    all the others over their conditions; then a material apart from the others; last the whole
    campaign. What is aligned with a condition cannot be told from an effect and is not named.
    """
    specimens = campaign.specimens
    travels = dict(_travel_slips(campaign, loads))
    if 2 * len(travels) > len(loads):
        problem = _of_all(next(iter(travels.values())))
        of_one = len({p.unit_of and p.unit_of.unit for p in travels.values()}) == 1
        yield problem if of_one else replace(problem, unit_of=None)
        return
    yield from travels.values()
    rest = {i: v for i, v in loads.items() if i not in travels}
    off = _among_replicates(specimens, rest)
    off |= _apart_from_trend(campaign, {i: v for i, v in rest.items() if i not in off})
    rest = {i: v for i, v in rest.items() if i not in off}
    materials = _materials_apart(specimens, rest)
    for i, shift in sorted(off.items()):
        yield _problem(specimens[i], shift, "its replicates' or neighbours'")
    for i, shift in sorted(materials.items()):
        yield _problem(specimens[i], shift, "other materials' (or its law is off by as much)")
    yield from _whole(campaign, {i: v for i, v in rest.items() if i not in materials})


def _among_replicates(specimens: Sequence[Specimen], loads: _Loads) -> dict[int, float]:
    """Specimens on the wrong side of a group that a unit's factor splits, with their shift."""
    by_factor = defaultdict[float, list[tuple[list[int], list[int], float]]](list)
    whole: list[float] = []
    for group in replicate_groups(specimens):
        members = sorted((i for i in group if i in loads), key=lambda i: loads[i])
        values = np.array([loads[i] for i in members])
        gaps = np.diff(values)
        if not len(gaps) or gaps.max() < _SPLIT:
            whole.extend(values)
            continue
        cut = int(np.argmax(gaps)) + 1
        shift = float(np.median(values[cut:]) - np.median(values[:cut]))
        tight = max(np.ptp(values[:cut]), np.ptp(values[cut:])) < 0.5 * _SPLIT
        if tight and (factor := _slip(shift, _AMONG_REPLICATES)) is not None:
            by_factor[factor].append((members[:cut], members[cut:], shift))
    reference = float(np.median(whole)) if len(whole) > 2 else 0.0
    off: dict[int, float] = {}
    for groups in by_factor.values():
        # One decision for all groups of a factor: which side lies nearer to everything else.
        low = [abs(loads[i] - reference) for lower, _, _ in groups for i in lower]
        high = [abs(loads[i] - reference) for _, upper, _ in groups for i in upper]
        lower_is_right = float(np.median(low)) <= float(np.median(high))
        for lower, upper, shift in groups:
            off |= dict.fromkeys(*((upper, shift) if lower_is_right else (lower, -shift)))
    return off


_ROUNDS = 60
_SMALLEST = 1e-4
"""Iterations of the fit of least absolute deviations, and the residual below which it goes over to
squares. Numerical: of ln load, a hundredth of any scatter."""


def _apart_from_trend(campaign: Campaign, loads: _Loads) -> dict[int, float]:
    """Single specimens that a trend over material and conditions leaves off by a factor.

    A few strays do not move it: it is a fit of least absolute deviations over the campaign's
    columns, by iteratively reweighted least squares, of twice as many specimens as free patterns
    and four more.
    """
    columns = [column for name, column in axis_columns(campaign).items() if name != "specimen"]
    patterns = [specimen_patterns([column[i] for i in loads]) for column in columns]
    matrix = np.column_stack([np.ones(len(loads)), *(p for p in patterns if p is not None)])
    if len(loads) < 2 * np.linalg.matrix_rank(matrix) + 4:
        return {}
    y = np.array(list(loads.values()))
    residuals: FloatArray = y - np.median(y)
    for _ in range(_ROUNDS):
        weight = 1.0 / np.sqrt(np.maximum(np.abs(residuals), _SMALLEST))
        solution = np.linalg.lstsq(matrix * weight[:, None], y * weight, rcond=1e-9)[0]
        residuals = y - matrix @ solution
    # Of the others, two deviations are to be as near to the trend as replicates are.
    if 2.0 * float(np.median(np.abs(residuals))) * 1.4826 > _AMONG_REPLICATES:
        return {}
    single = {group[0] for group in replicate_groups(campaign.specimens) if len(group) == 1}
    return {
        i: float(r)
        for i, r in zip(loads, residuals, strict=True)
        if i in single and _slip(float(r), _AMONG_REPLICATES) is not None
    }


def _materials_apart(specimens: Sequence[Specimen], loads: _Loads) -> dict[int, float]:
    """All specimens of one material that lies off the others, which agree, by a factor."""
    by_material = defaultdict[str, list[int]](list)
    for i in sorted(loads):
        by_material[specimens[i].material or ""].append(i)
    medians = {m: float(np.median([loads[i] for i in at])) for m, at in by_material.items()}
    off: dict[int, float] = {}
    for material, median in medians.items():
        others = [v for m, v in medians.items() if m != material]
        shift = median - float(np.median(others or [0.0]))
        agree = len(others) > 2 and np.ptp(others) <= _SPLIT
        if agree and _slip(shift, _AMONG_REPLICATES) is not None:
            off |= dict.fromkeys(by_material[material], shift)
    return off


def _whole(campaign: Campaign, loads: _Loads) -> Iterator[QualityProblem]:
    """Say that the median load is off by a factor, near the reference temperature if any is.

    Temperature has the largest effect.
    """
    reference, of = campaign.palette.reference, campaign.specimens
    known = [reference.temperature_C, *(of[i].temperature_C for i in loads)]
    at_C, *own_C = np.array(known, dtype=np.float64).tolist()  # unknown is NaN, near to none
    near = [i for i, C in zip(loads, own_C, strict=True) if abs(C - at_C) <= _NEAR_K] or list(loads)
    if not near:
        return
    values = np.array([loads[i] for i in near])
    shift = float(np.median(values))
    if float(np.median(np.abs(values - shift))) * 1.4826 > max(0.5 * _SPLIT, 0.25 * abs(shift)):
        return
    tolerance = _AGAINST_LAW if abs(shift) < _BEYOND_EFFECTS else 2.0 * _AGAINST_LAW
    if _slip(shift, tolerance) is not None:
        yield _of_all(_problem(of[near[0]], shift, "the laws'"))


def _of_all(problem: QualityProblem) -> QualityProblem:
    unit = problem.unit_of
    return replace(problem, specimen=None, unit_of=unit and replace(unit, specimens=()))


def _problem(specimen: Specimen, shift: float, whose: str) -> QualityProblem:
    factor = _slip(shift, math.inf)
    assert factor is not None
    ratio, (high, low) = math.exp(abs(shift)), _SLIPS[factor]
    way, words = ("above", high) if shift > 0 else ("below", low)
    back = math.copysign(math.log(factor), -shift)
    unit = _unit_of(specimen, "force", back) if factor in _FORCE_SLIPS else None
    told = f"loads are {ratio:.3g} times {way} {whose}, as if {words} (factor {factor:.4g})"
    return QualityProblem(specimen.id, "units", told, unit)


def _unit_of(specimen: Specimen, quantity: str, log: float, reach: float = 0.0) -> UnitOf | None:
    """Return the unit by which numbers in a file become exp(log) times what they are now."""
    own = specimen.force_unit_N if quantity == "force" else specimen.travel_unit_mm
    if own is None:
        return None
    unit = unit_near(QUANTITIES[quantity][1], math.log(own) + log, own, reach)
    return None if unit is None else UnitOf(quantity, unit, (specimen.id,))


def _slip(shift: float, tolerance: float, factors: Iterable[float] = tuple(_SLIPS)) -> float | None:
    """Return the factor between units that a logarithm is nearest to; None beyond the tolerance."""
    off = {factor: abs(abs(shift) - math.log(factor)) for factor in factors}
    nearest = min(off, key=off.__getitem__)
    return nearest if off[nearest] < tolerance else None


_NEARER = 0.5
"""Distance of a load to its like, as a share of what it was, that another unit of travel leaves at
most. Chosen: what lies nearer to another unit than to its own."""


def _travel_slips(campaign: Campaign, loads: _Loads) -> Iterator[tuple[int, QualityProblem]]:
    """Yield specimens whose travel is in another unit, as declared rate and load both tell.

    A factor on travel is told from one on force by the rate. With travel in that unit the load is
    to come near that of others of the material, or of the laws where there are none.
    """
    specimens = campaign.specimens
    made = [s.made_of for s in specimens]
    logs = {i: log for i in loads if (log := _travel_log(specimens[i])) is not None}
    if not logs:
        return
    scales = [math.exp(logs.get(i, 0.0)) for i in range(len(specimens))]
    mended = tuple(
        replace(s, displacement_mm=s.displacement_mm * scale)
        for s, scale in zip(specimens, scales, strict=True)
    )
    again = _log_loads(ObservationModel(replace(campaign, specimens=mended)))
    for i, log in logs.items():
        alike = [v for k, v in loads.items() if k not in logs and made[k] == made[i]]
        usual = float(np.median(alike)) if alike else 0.0
        if i in again and abs(again[i] - usual) < _NEARER * abs(loads[i] - usual):
            yield i, _travel_slip(specimens[i], log)


def _travel_log(specimen: Specimen) -> float | None:
    """Return the logarithm of the factor that brings travel to its declared rate, if a unit's.

    Strain in per cent is as many mm of a gauge of 100 mm.
    """
    speed = speed_mm_s(specimen.time_s, specimen.travel_mm)
    if specimen.rate_mm_s is None or not specimen.time_recorded or speed <= 0.0:
        return None
    log = math.log(specimen.rate_mm_s / speed)
    factor = _slip(log, TIME_TOLERANCE, (_INCH, 100.0 / specimen.gauge_mm))
    if factor is None or abs(log) < _AGAINST_LAW:
        return None
    return math.copysign(math.log(factor), log)


def _travel_slip(specimen: Specimen, log: float) -> QualityProblem:
    inches = _slip(log, TIME_TOLERANCE, (_INCH,)) is not None
    other = "inches" if inches else "per cent of the gauge length"
    told = ("mm", other) if (log < 0.0) is inches else (other, "mm")
    words = (
        f"travel is off by {math.exp(abs(log)):.3g} against its declared rate and its load, as if "
        f"{' taken for '.join(told)}"
    )
    unit, own = _unit_of(specimen, "travel", log), specimen.travel_unit_mm
    if unit is None and own is not None:
        unit = UnitOf("travel", f"{own * math.exp(log):.6g}", (specimen.id,))
    return QualityProblem(specimen.id, "travel", words, unit)


_HUNDREDFOLD = (30.0, 300.0)
"""Mean local strain over travel by gauge length, of a field in per cent. Chosen: a hundred, or a
third or three times as much, for what slips in the grips or lies beyond the gauge."""


def _field_in_percent(s: Specimen) -> Iterator[str]:
    if s.strain_field is None:
        return
    mean = np.mean(s.strain_field.strain, axis=1)
    travel = np.interp(s.strain_field.time_s, s.time_s, s.strain)
    at = int(np.argmax(travel))
    if travel[at] > 0.0 and _HUNDREDFOLD[0] < abs(mean[at]) / travel[at] < _HUNDREDFOLD[1]:
        yield (
            f"the strain field reaches {mean[at]:.3g} on average, travel over gauge length "
            f"{travel[at]:.3g}; per cent taken for fractions"
        )


# ------------------------------------------------------------------------------------------------
# Examine a campaign's data.


def examine(campaign: Campaign, model: ObservationModel) -> tuple[QualityProblem, ...]:
    """Return what is wrong with a campaign's data, problems of all of it first.

    Nothing is changed or left out. Specimens are judged against their own declaration, their
    replicates and, by the factors between units alone, the palette's laws: a load that is off by
    any other factor is a gap to diagnose, not a fault of the data.

    Parameters
    ----------
    model
        Of the campaign.
    """
    specimens = campaign.specimens
    dead, copies = _each("dead", _dead_cell, specimens), list(_duplicates(specimens))
    silent = {p.specimen for p in dead}
    # A force that stood still is named for that, and neither for its protocol nor as clipped.
    live = [s for s in specimens if s.id not in silent]
    loads = {i: v for i, v in _log_loads(model).items() if specimens[i].id not in silent}
    units = [*_unit_problems(campaign, loads), *_each("units", _field_in_percent, specimens)]
    # What is off in its travel is so in its speed.
    moved = {p.specimen for p in units if p.kind == "travel"}
    timed = [s for s in specimens if s.rate_mm_s and s.time_recorded and s.id not in moved]
    suspect = {p.specimen for p in (*copies, *units)}
    judged = {i: v for i, v in loads.items() if specimens[i].id not in suspect}
    usual = float(np.median([s.load_N[0] for s in live] or [0.0]))
    problems = (  # in the order in which a specimen's are told
        *dead,
        *units,
        *_sizes(specimens),
        *_each("zero", partial(_zero, usual=usual), [s for s in live if s.id not in suspect]),
        *_shared("rate", _rate, timed),
        *_each("protocol", _protocol, live),
        *_amplitudes(specimens),
        *_outlier_problems(specimens, judged),
        *_each("clipped", _clipping, live),
        *_each("fall", _falls, live),
        *copies,
        *_each("dropout", _dropouts, specimens),
        *_each("spike", _spikes, specimens),
    )
    order = {None: -1} | {s.id: place for place, s in enumerate(specimens)}
    return tuple(sorted(problems, key=lambda p: order[p.specimen]))


# ------------------------------------------------------------------------------------------------
# As a verdict hints: a gain of force or travel that is the factor between two units.


_GAINS: Mapping[tuple[str, str], tuple[str, float]] = {
    ("force-scale", "log_gain"): ("force", -1.0),
    ("force-scale", "factor"): ("force", -1.0),
    ("strain-scale", "log_factor"): ("travel", 1.0),
}
"""By effect and parameter: the quantity, and the power of true over recorded. Convention: how the
effects define their sizes."""


def suggested_units(
    found: Iterable[FoundEffect], specimens: Sequence[Specimen]
) -> Iterator[UnitOf]:
    """Yield the units in which numbers make sense as they stand in the files, without a gain."""
    for effect in found:
        for name, value in effect.parameters.items():
            if (effect.id, name) not in _GAINS:
                continue
            quantity, power = _GAINS[effect.id, name]
            ends = effect.interval.get(name, (value, value))
            log, low, high = (
                power * (x if name.startswith("log_") else math.log(x)) for x in (value, *ends)
            )
            reach = max(abs(low - log), abs(high - log))
            some = (s for s in specimens if not effect.specimens or s.id in effect.specimens)
            units = (_unit_of(s, quantity, log, reach) for s in some)
            for one in merged_units(filter(None, units)):
                yield one if len(one.specimens) < len(specimens) else replace(one, specimens=())


def merged_units(units: Iterable[UnitOf]) -> tuple[UnitOf, ...]:
    """Return each unit once, with all its specimens."""
    found = defaultdict[tuple[str, str], list[tuple[str, ...]]](list)
    for one in units:
        found[one.quantity, one.unit].append(one.specimens)
    return tuple(  # no specimens means all
        UnitOf(*key, () if () in ids else tuple(dict.fromkeys(chain.from_iterable(ids))))
        for key, ids in found.items()
    )
