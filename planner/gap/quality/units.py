"""Forces and lengths off by the factor between two units, in all specimens or in some."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.gap.conditions import replicate_groups
from planner.gap.quality.condition_trend import trend_residuals
from planner.gap.quality.loading import log_load
from planner.gap.quality.motion import speed_mm_s
from planner.gap.quality.problem import Problem
from planner.gap.specimen import Specimen
from planner.palette import Palette

__all__ = ["unit_problems"]


@dataclass(frozen=True, slots=True)
class _Slip:
    factor: float
    high: str
    low: str


INCH = 25.4
_SLIPS = (
    _Slip(4.4482216, "N taken for lbf", "lbf taken for N"),
    _Slip(9.80665, "N taken for kgf", "kgf taken for N"),
    _Slip(1 / 0.00980665, "gf taken for N", "N taken for gf"),
    _Slip(1 / 0.00689475729, "psi taken for MPa", "MPa taken for psi"),
    _Slip(1000.0, "mN taken for N, or N for kN", "kN taken for N, or N for mN"),
)
_INCHES = (
    _Slip(INCH, "a size in inches taken for mm", "a size or travel in mm taken for inches"),
    _Slip(INCH**2, "width and thickness in inches taken for mm",
          "width and thickness in mm taken for inches"),
)  # fmt: skip

AMONG_REPLICATES = 0.25
"""Log distance from a slip's factor; replicates scatter by up to 9 %, so 0.13 between two."""

AGAINST_LAW = 0.35
"""The same for a whole campaign against the laws: they may be off by a third and more."""

BEYOND_EFFECTS = 1.9
"""No effect of test or print softens or stiffens a whole campaign e^1.9 = 6.7 times."""

NEAR_K = 5.0

SPLIT = 1.0
"""Replicates whose loads differ by a factor of e differ by more than scatter."""

STEADY = 0.15
"""Robust log deviation of the others from a trend in the conditions, for a single to be judged."""


def unit_problems(specimens: Sequence[Specimen], palette: Palette) -> tuple[Problem, ...]:
    """Return what looks like another unit of force, travel or size.

    The load of each specimen is put in proportion to the laws' prediction. Specimens apart from
    their replicates by a unit's factor are named first; then singles apart from the trend of
    all the others over their conditions; then a material apart from the others; last the whole
    campaign. What is aligned with a condition cannot be told from an effect and is not named.
    """
    loads = {i: v for i, s in enumerate(specimens) if (v := log_load(s, palette)) is not None}
    if not loads:
        return ()
    off = _among_replicates(specimens, loads)
    off |= _apart_from_trend(specimens, {i: v for i, v in loads.items() if i not in off})
    rest = {i: v for i, v in loads.items() if i not in off}
    materials = _materials_apart(specimens, rest)
    problems = [_single(specimens, palette, i, shift, loads[i]) for i, shift in sorted(off.items())]
    problems += [
        _problem(specimens[i].id, shift, "other materials' (or its law is off by as much)")
        for i, shift in sorted(materials.items())
    ]
    rest = {i: v for i, v in rest.items() if i not in materials}
    whole = _whole(specimens, palette, rest)
    return (*problems, *_fields_in_percent(specimens), *([] if whole is None else [whole]))


def _among_replicates(
    specimens: Sequence[Specimen], loads: Mapping[int, float]
) -> dict[int, float]:
    """Specimens on the wrong side of a group that a unit's factor splits, with their shift."""
    split: list[tuple[list[int], list[int], float]] = []
    whole: list[float] = []
    for group in replicate_groups(specimens):
        members = sorted((i for i in group if i in loads), key=lambda i: loads[i])
        values = np.array([loads[i] for i in members])
        gaps = np.diff(values)
        if not len(gaps) or gaps.max() < SPLIT:
            whole.extend(values)
            continue
        cut = int(np.argmax(gaps)) + 1
        shift = float(np.median(values[cut:]) - np.median(values[:cut]))
        tight = max(np.ptp(values[:cut]), np.ptp(values[cut:])) < 0.5 * SPLIT
        if tight and _slip(shift, AMONG_REPLICATES) is not None:
            split.append((members[:cut], members[cut:], shift))
    reference = float(np.median(whole)) if len(whole) > 2 else 0.0
    off: dict[int, float] = {}
    by_factor: dict[float, list[tuple[list[int], list[int], float]]] = {}
    for one in split:
        slip = _slip(one[2], AMONG_REPLICATES)
        by_factor.setdefault(slip.factor if slip else 0.0, []).append(one)
    for groups in by_factor.values():
        # One decision for all groups of a factor: which side lies nearer to everything else.
        low = [abs(loads[i] - reference) for lower, _, _ in groups for i in lower]
        high = [abs(loads[i] - reference) for _, upper, _ in groups for i in upper]
        lower_is_right = float(np.median(low)) <= float(np.median(high))
        for lower, upper, shift in groups:
            for i in upper if lower_is_right else lower:
                off[i] = shift if lower_is_right else -shift
    return off


def _apart_from_trend(
    specimens: Sequence[Specimen], loads: Mapping[int, float]
) -> dict[int, float]:
    """Single specimens that a smooth trend over material and conditions leaves off by a factor."""
    places = sorted(loads)
    residuals = trend_residuals([specimens[i] for i in places], [loads[i] for i in places])
    if residuals is None:
        return {}
    single = {group[0] for group in replicate_groups(specimens) if len(group) == 1}
    if float(np.median(np.abs(residuals))) * 1.4826 > STEADY:
        return {}
    return {
        i: float(r)
        for i, r in zip(places, residuals, strict=True)
        if i in single and _slip(float(r), AMONG_REPLICATES) is not None
    }


def _materials_apart(specimens: Sequence[Specimen], loads: Mapping[int, float]) -> dict[int, float]:
    """All specimens of one material that lies off the others, which agree, by a factor."""
    by_material: dict[str, list[int]] = {}
    for i in sorted(loads):
        by_material.setdefault(specimens[i].material or "", []).append(i)
    medians = {m: float(np.median([loads[i] for i in at])) for m, at in by_material.items()}
    off: dict[int, float] = {}
    for material, median in medians.items():
        others = [v for m, v in medians.items() if m != material]
        if len(others) < 3 or np.ptp(others) > SPLIT:
            continue
        shift = median - float(np.median(others))
        if _slip(shift, AMONG_REPLICATES) is not None:
            off |= dict.fromkeys(by_material[material], shift)
    return off


def _whole(
    specimens: Sequence[Specimen], palette: Palette, loads: Mapping[int, float]
) -> Problem | None:
    near = _near_reference(specimens, palette, loads)
    if not near:
        return None
    values = np.array([loads[i] for i in near])
    shift = float(np.median(values))
    spread = float(np.median(np.abs(values - shift))) * 1.4826
    if spread > max(0.5 * SPLIT, 0.25 * abs(shift)):
        return None
    travel = [t for i in near if (t := _travel_slip(specimens[i], palette, loads[i])) is not None]
    if 2 * len(travel) > len(near):
        return Problem("units", None, travel[0], math.exp(shift), 1.0)
    tolerance = AGAINST_LAW if abs(shift) < BEYOND_EFFECTS else 2.0 * AGAINST_LAW
    if _slip(shift, tolerance) is None:
        return None
    return _problem(None, shift, "the laws'")


def _near_reference(
    specimens: Sequence[Specimen], palette: Palette, loads: Mapping[int, float]
) -> list[int]:
    """Specimens near the reference temperature, whose effect is the largest; all if none is."""
    reference = palette.reference.temperature_C
    near = [
        i
        for i in loads
        if reference is not None
        and (t := specimens[i].temperature_C) is not None
        and abs(t - reference) <= NEAR_K
    ]
    return near or list(loads)


def _single(
    specimens: Sequence[Specimen], palette: Palette, i: int, shift: float, load: float
) -> Problem:
    travel = _travel_slip(specimens[i], palette, load)
    if travel is not None:
        return Problem("units", specimens[i].id, travel, math.exp(shift), 1.0)
    return _problem(specimens[i].id, shift, "its replicates' or neighbours'")


def _problem(specimen: str | None, shift: float, whose: str) -> Problem:
    slip = _slip(shift, math.inf)
    assert slip is not None
    ratio = math.exp(abs(shift))
    way, words = ("above", slip.high) if shift > 0 else ("below", slip.low)
    return Problem(
        "units",
        specimen,
        f"loads are {ratio:.3g} times {way} {whose}, as if {words} (factor {slip.factor:.4g})",
        float(f"{math.exp(shift):.6g}"),
        1.0,
    )


def _slip(shift: float, tolerance: float) -> _Slip | None:
    nearest = min((*_SLIPS, *_INCHES), key=lambda s: abs(abs(shift) - math.log(s.factor)))
    return nearest if abs(abs(shift) - math.log(nearest.factor)) < tolerance else None


def _travel_slip(specimen: Specimen, palette: Palette, load: float) -> str | None:
    """Say that travel is in another unit where correcting it brings the load into place.

    A factor on travel is told from one on force by the declared rate.
    """
    if abs(load) < math.log(INCH) - 2.0 * SPLIT or specimen.rate_mm_s is None:
        return None
    speed = speed_mm_s(specimen.time_s, specimen.displacement_mm)
    ratio = math.log(speed / specimen.rate_mm_s) if speed > 0.0 else 0.0
    if abs(abs(ratio) - math.log(INCH)) > 0.1:
        return None
    corrected = log_load(specimen, palette, stretched=INCH if ratio < 0.0 else 1.0 / INCH)
    if corrected is None or abs(corrected) > abs(load) - SPLIT:
        return None
    words = "inches taken for mm" if ratio < 0.0 else "mm taken for inches"
    return f"travel is off by 25.4 against its declared rate and its load, as if {words}"


def _fields_in_percent(specimens: Sequence[Specimen]) -> list[Problem]:
    found = []
    for s in specimens:
        if s.strain_field is None:
            continue
        mean = np.mean(s.strain_field.strain, axis=1)
        travel = np.interp(s.strain_field.time_s, s.time_s, s.strain)
        at = int(np.argmax(travel))
        if travel[at] > 0.0 and 30.0 < mean[at] / travel[at] < 300.0:
            found.append(
                Problem(
                    "units",
                    s.id,
                    f"the strain field reaches {mean[at]:.3g} on average, travel over gauge "
                    f"length {travel[at]:.3g}; per cent taken for fractions",
                    float(f"{mean[at]:.6g}"),
                    float(f"{travel[at]:.6g}"),
                )
            )
    return found
