"""Data quality of a campaign: records held against each other and against the palette."""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.formats.units import OWN, QUANTITIES, QUANTITY_UNITS, UnitOf, unit_near
from planner.gap.campaign import Campaign, Specimen, replicate_groups
from planner.gap.diagnosis import FoundEffect, QualityProblem
from planner.gap.quality_records import (
    RATE_TOLERANCE,
    first_turn,
    record_problems,
    speed_mm_s,
    without_spikes,
)
from planner.materials.laws import make_law
from planner.numerics import FloatArray
from planner.palette import Palette
from planner.simulation.bar_solver import PUSHED_END

__all__ = ["examine", "merged_units", "predicted_stress_MPa", "suggested_units"]


# ------------------------------------------------------------------------------------------------
# First loading of a specimen, and its load in proportion to what the palette predicts.


_GRID = np.linspace(0.3, 0.9, 13)
"""Where loads are compared, of a first loading. Chosen: past slack and zeros, before the break; 13
make a median that no stray point moves."""


def _first_loading(specimen: Specimen) -> tuple[FloatArray, FloatArray]:
    """Return strain and mean nominal stress of the first loading, to its turn or peak load."""
    load = specimen.load_N
    stop = first_turn(specimen.travel_mm) + 1
    stop = int(np.argmax(load[:stop])) + 1
    return specimen.strain[:stop], load[:stop] / _mean_section_mm2(specimen)


def _stress_at(strain: FloatArray, stress_MPa: FloatArray, at: FloatArray) -> FloatArray:
    """Return the stress at rising strains `at`, each the mean of the points half-way around it.

    Where there are no such points, a line between the nearest ones has to do.
    """
    rising = np.maximum.accumulate(strain)
    edges = np.concatenate([[at[0]], 0.5 * (at[1:] + at[:-1]), [at[-1]]])
    edges[0] -= edges[1] - at[0]
    edges[-1] += at[-1] - edges[-2]
    bounds = np.searchsorted(rising, edges)
    sums = np.concatenate([[0.0], np.cumsum(stress_MPa)])
    places = np.concatenate([[0.0], np.cumsum(rising)])
    count = np.diff(bounds)
    some = np.maximum(count, 1)
    mean = np.diff(sums[bounds]) / some
    middle = np.diff(places[bounds]) / some
    line = np.interp(at, rising, stress_MPa)
    # Points of a bin lie about its middle, not at it; the load's proportion to strain corrects it.
    return np.where(count > 2, mean * at / np.where(middle > 0.0, middle, at), line)


def predicted_stress_MPa(specimen: Specimen, palette: Palette, strain: FloatArray) -> FloatArray:
    """Return the mean nominal stress that the palette's laws give, roughly for a graded bar.

    A bar's slices are taken as springs of their secant moduli at the mean strain; of a part, whose
    section nobody states, the force stands for it. Of a compressed specimen strain and stress are
    positive, too.
    """
    if specimen.part is not None:
        force, _, _ = specimen.part.response.at(strain * specimen.gauge_mm)
        return force / (specimen.area_mm2 or 1.0)
    grades = np.array([m.coordinate for m in palette.materials])
    true = -strain if specimen.pushed else strain
    secants = np.stack(
        [make_law(m.law).nominal_stress_MPa(1.0 + true) / true for m in palette.materials]
    )
    if specimen.profile is None:
        index = palette.materials.index(palette.resolve(specimen.material or ""))
        predicted: FloatArray = secants[index] * strain
        return predicted
    x = _slices(specimen)
    coordinate = specimen.profile.at(x)
    section = specimen.section_mm2(x)
    share = np.ones_like(x) if section is None else section / np.mean(section)
    logs = np.log(np.maximum(secants, 1e-12))
    along = np.stack([np.interp(coordinate, grades, column) for column in logs.T])
    compliance = np.mean(np.exp(-along) / share, axis=1)
    bar: FloatArray = strain / compliance
    return bar


def _log_load(specimen: Specimen, palette: Palette, *, stretched: float = 1.0) -> float | None:
    """Return ln(measured over predicted load), the median over the first loading's upper part.

    Parameters
    ----------
    stretched
        Factor on the strains, to see what the load would be were the travel in another unit.

    Returns
    -------
    float or None
        None where nothing there is above zero.
    """
    strain, stress = _first_loading(specimen)
    strain = strain * stretched
    end = min(float(strain[-1]), _law_end(specimen, palette))
    at = end * _GRID
    at = at[(at > 0.0) & (at >= strain[0])]
    if len(at) < 3:
        return None
    measured = _stress_at(strain, stress, at)
    predicted = predicted_stress_MPa(specimen, palette, at)
    both = (measured > 0.0) & (predicted > 0.0)
    if both.sum() < 3:
        return None
    return float(np.median(np.log(measured[both] / predicted[both])))


def _law_end(specimen: Specimen, palette: Palette) -> float:
    if specimen.pushed:
        return PUSHED_END
    if specimen.part is not None:
        return float(specimen.part.response.displacement_mm[-1]) / specimen.gauge_mm
    if specimen.profile is None:
        return palette.resolve(specimen.material or "").elongation_at_break
    return min(m.elongation_at_break for m in palette.materials)


def _mean_section_mm2(specimen: Specimen) -> float:
    section = specimen.section_mm2(_slices(specimen))
    return 1.0 if section is None else float(np.mean(section))


def _slices(specimen: Specimen) -> FloatArray:
    middles: FloatArray = specimen.gauge_mm * (np.arange(200) + 0.5) / 200
    return middles


# ------------------------------------------------------------------------------------------------
# Specimens that differ from their replicates by more than scatter.
#
# Each specimen is compared with the mean of its replicates. How far they may differ is told by
# the scatter of the others, moderated by that of all other groups: the variances of groups are
# taken as scaled inverse chi-square draws whose centre and weight the groups themselves tell
# (Smyth, Stat. Appl. Genet. Mol. Biol. 3, 2004). So two or three replicates are judged by what the
# whole campaign knows of scatter; where it knows nothing, by what is usual, and then only a gross
# fault is named.


_FAMILY_WISE = 0.003
"""Chance of any false outlier in a clean campaign, over specimens and figures. Convention: that of
three standard deviations."""

_LEAST_SHIFT = 0.08
"""ln load within which of its replicates' no fault of the data is seen, however small their
scatter. Physical: jetted specimens scatter by up to 9 %."""

_USUAL_SCATTER, _USUAL_WEIGHT = 0.06, 4.0
"""Standard deviation where the campaign tells none, and its weight as degrees of freedom. Physical:
jetted specimens of one print scatter by 1 to 9 %; four degrees leave it open by as much."""

_NEAR, _FEWEST = 0.1, 4
"""A strain without a point within a tenth of the shortest loading was not recorded; of a specimen
of which most were not, and from fewer strains, nothing is said. Chosen: a line over a tenth of a
loading is good to a per cent, and a growth with strain needs four."""

_SHORT = 0.3
"""A first loading shorter than this share of its replicates' is not compared. Chosen: it has not
come to where theirs are compared (`_GRID`)."""


_Groups = list[tuple[tuple[int, ...], FloatArray]]
"""Replicates by place, with one number each."""


def _outlier_problems(
    specimens: Sequence[Specimen], leave_out: Collection[str | None]
) -> list[QualityProblem]:
    """Return outlying specimens, the clearest first in each round.

    Two figures are judged: the load at common strains, and how it grows with strain. Levels are
    Bonferroni's over specimens and figures; a specimen that was found is left out and the rest
    judged again.

    Parameters
    ----------
    leave_out
        Specimens with another problem already.
    """
    kept = [s for s in specimens if s.id not in leave_out]
    groups = _groups(kept)
    tests = 2 * sum(len(g) for g in groups)
    gone: set[int] = set()
    found: list[QualityProblem] = []
    while True:
        figures = _figures(kept, [tuple(i for i in g if i not in gone) for g in groups])
        judged = ((*w, name) for name, figure in figures.items() for w in _judged(figure))
        worst = min(judged, key=lambda w: w[0], default=None)
        if worst is None or worst[0] >= _FAMILY_WISE / max(tests, 1):
            return found
        _, place, shift, others, name = worst
        found.extend(_outliers(kept, name, place, shift, others))
        gone |= {place} if len(others) > 1 else {place, *others}


def _groups(specimens: Sequence[Specimen]) -> tuple[tuple[int, ...], ...]:
    """Replicates of one batch, unless that leaves less than half of what there is to compare."""
    inside = replicate_groups(specimens, with_batch=True)
    across = replicate_groups(specimens)
    freedom = [sum(len(g) - 1 for g in groups) for groups in (inside, across)]
    chosen = inside if 2 * freedom[0] >= freedom[1] else across
    return tuple(g for g in chosen if len(g) > 1)


def _figures(
    specimens: Sequence[Specimen], groups: Sequence[tuple[int, ...]]
) -> dict[str, _Groups]:
    level: _Groups = []
    growth: _Groups = []
    for group in groups:
        loadings = {i: _first_loading(specimens[i]) for i in group}
        ends = {i: float(strain[-1]) for i, (strain, _) in loadings.items()}
        middle = float(np.median(list(ends.values()))) if ends else 0.0
        members = tuple(i for i in group if ends[i] > _SHORT * middle)
        if len(members) < 2:
            continue
        end = min(ends[i] for i in members)
        at = end * _GRID
        seen = {
            i: np.abs(np.subtract.outer(at, loadings[i][0])).min(axis=1) <= _NEAR * end
            for i in members
        }
        members = tuple(i for i in members if 2 * seen[i].sum() > len(at))
        if len(members) < 2:
            continue
        at = at[np.all([seen[i] for i in members], axis=0)]
        stress = np.stack([_stress_at(*loadings[i], at) for i in members])
        if len(at) < _FEWEST or not np.all(stress > 0.0):
            continue
        logs = np.log(stress)
        level.append((members, np.mean(logs, axis=1)))
        x = np.log(at) - np.mean(np.log(at))
        growth.append((members, logs @ x / float(x @ x)))
    return {"load": level, "growth": growth}


def _judged(groups: _Groups) -> Iterator[tuple[float, int, float, tuple[int, ...]]]:
    """Yield p-value, specimen, shift and replicates of everyone that can be judged."""
    from scipy.special import stdtr

    variances = [float(np.var(values, ddof=1)) for _, values in groups]
    freedoms = [len(members) - 1 for members, _ in groups]
    for g, (members, values) in enumerate(groups):
        n = len(members)
        weight, centre = _prior(
            variances[:g] + variances[g + 1 :], freedoms[:g] + freedoms[g + 1 :]
        )
        for k, place in enumerate(members):
            others = np.delete(values, k)
            shift = float(values[k] - np.mean(others))
            freedom = weight + n - 2
            if freedom <= 0.0 or abs(shift) < _LEAST_SHIFT:
                continue
            own = float(np.var(others, ddof=1)) * (n - 2) if n > 2 else 0.0
            variance = (weight * centre + own) / freedom
            scale = math.sqrt(variance * (1.0 + 1.0 / (n - 1)))
            p = 2.0 * float(stdtr(freedom, -abs(shift) / scale)) if scale > 0.0 else 0.0
            yield p, place, shift, tuple(m for m in members if m != place)


def _prior(variances: Sequence[float], freedoms: Sequence[int]) -> tuple[float, float]:
    """Return weight (degrees of freedom) and centre of the groups' variances.

    What is usual counts as one more group. The weight never exceeds a half of the degrees of
    freedom that it comes from, or that of the usual.
    """
    from scipy.optimize import brentq
    from scipy.special import polygamma, psi

    known = [(v, d) for v, d in zip(variances, freedoms, strict=True) if v > 0.0]
    if not known:
        return _USUAL_WEIGHT, _USUAL_SCATTER**2
    known.append((_USUAL_SCATTER**2, int(_USUAL_WEIGHT)))
    most = max(_USUAL_WEIGHT, 0.5 * sum(d for _, d in known))
    d = np.array([d for _, d in known], dtype=np.float64)
    e = np.log([v for v, _ in known]) - psi(d / 2.0) + np.log(d / 2.0)
    excess = float(np.var(e, ddof=1) - np.mean(polygamma(1, d / 2.0)))
    if excess <= 1e-8:  # the trigamma function's inverse is beyond any weight
        return most, float(np.exp(np.mean(e)))
    weight = 2.0 * math.exp(brentq(lambda x: polygamma(1, math.exp(x)) - excess, -20.0, 20.0))
    centre = math.exp(float(np.mean(e)) + float(psi(weight / 2.0)) - math.log(weight / 2.0))
    return min(weight, most), centre


def _outliers(
    specimens: Sequence[Specimen], name: str, place: int, shift: float, others: Sequence[int]
) -> Iterator[QualityProblem]:
    size = (
        f"load is {100 * math.expm1(shift):+.0f} % off"
        if name == "load"
        else f"load grows with strain to the power {shift:+.2f} apart from"
    )
    if len(others) > 1:
        words = f"{size} that of its {len(others)} replicates"
        yield QualityProblem(specimens[place].id, "outlier", words)
        return
    for one, other in ((place, others[0]), (others[0], place)):
        words = (
            f"{size} that of its only replicate {specimens[other].id}, more than replicates "
            "elsewhere; which of the two is off cannot be told"
        )
        yield QualityProblem(specimens[one].id, "outlier", words)


# ------------------------------------------------------------------------------------------------
# A smooth trend of a figure over material and conditions, that a few strays do not move.


_ROUNDS = 60
_SMALLEST = 1e-4
"""Iterations of the fit of least absolute deviations, and the residual below which it goes over to
squares. Numerical: of ln load, a hundredth of any scatter."""


def _trend_residuals(specimens: Sequence[Specimen], values: Sequence[float]) -> FloatArray | None:
    """Return what a least-absolute-deviations fit over the conditions leaves of each value.

    Columns: one a material or design and orientation, log rate, temperature, the root of the
    soaking time, log age; iteratively reweighted least squares.

    Returns
    -------
    residuals
        None where there are not twice as many specimens as columns and four more.
    """
    matrix = _design(specimens)
    if len(values) < 2 * matrix.shape[1] + 4:
        return None
    y = np.asarray(values, dtype=np.float64)
    residuals: FloatArray = y - np.median(y)
    for _ in range(_ROUNDS):
        weight = 1.0 / np.sqrt(np.maximum(np.abs(residuals), _SMALLEST))
        solution = np.linalg.lstsq(matrix * weight[:, None], y * weight, rcond=1e-9)[0]
        residuals = y - matrix @ solution
    return residuals


def _design(specimens: Sequence[Specimen]) -> FloatArray:
    pieces = [s.named for s in specimens]
    columns = _indicators(pieces) + _indicators([s.orientation for s in specimens])[1:]
    for name, described in SPECIMEN_COLUMNS.items():
        values = [getattr(s, name) for s in specimens]
        known = [v for v in values if v is not None]
        if described.is_size or described.choices is not None or not known:
            continue
        usual = np.median(known)
        column = described.scale(np.array([usual if v is None else v for v in values]))
        spread = float(np.ptp(column))
        if spread > 1e-9:
            columns.append((column - column.mean()) / spread)
    return np.stack(columns, axis=1)


def _indicators(labels: Sequence[str | None]) -> list[FloatArray]:
    return [np.array([float(v == k) for v in labels]) for k in dict.fromkeys(labels)]


# ------------------------------------------------------------------------------------------------
# Forces and lengths off by the factor between two units, in all specimens or in some.


@dataclass(frozen=True, slots=True)
class _Slip:
    factor: float
    high: str
    low: str


_INCH, _FORCES_N = QUANTITY_UNITS["length"]["in"], QUANTITY_UNITS["force"]

_SLIPS = (
    _Slip(_FORCES_N["lbf"], "N taken for lbf", "lbf taken for N"),
    _Slip(_FORCES_N["kgf"], "N taken for kgf", "kgf taken for N"),
    _Slip(1 / _FORCES_N["gf"], "gf taken for N", "N taken for gf"),
    _Slip(1 / QUANTITY_UNITS["stress"]["psi"], "psi taken for MPa", "MPa taken for psi"),
    _Slip(_FORCES_N["kN"], "mN taken for N, or N for kN", "kN taken for N, or N for mN"),
    _Slip(_INCH, "a size in inches taken for mm", "a size or travel in mm taken for inches"),
    _Slip(_INCH**2, "width and thickness in inches taken for mm",
          "width and thickness in mm taken for inches"),
)  # fmt: skip
"""Factors that mixing up two units leaves. Physical: by the units' definitions."""

_FORCE_FACTORS = frozenset(slip.factor for slip in (*_SLIPS[:3], _SLIPS[4]))
"""Of slips that another unit of force mends."""

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

_STEADY = 0.15
"""Robust log deviation of the others from a trend in the conditions, for a single to be judged.
Chosen: the nearest factor, ln 4.4, is ten of these away."""


def _unit_problems(specimens: Sequence[Specimen], palette: Palette) -> list[QualityProblem]:
    """Return what looks like another unit of force, travel or size.

    The load of each specimen is put in proportion to the laws' prediction. Specimens apart from
    their replicates by a unit's factor are named first; then singles apart from the trend of
    all the others over their conditions; then a material apart from the others; last the whole
    campaign. What is aligned with a condition cannot be told from an effect and is not named.
    """
    loads = {i: v for i, s in enumerate(specimens) if (v := _log_load(s, palette)) is not None}
    if not loads:
        return []
    off = _among_replicates(specimens, loads)
    off |= _apart_from_trend(specimens, {i: v for i, v in loads.items() if i not in off})
    rest = {i: v for i, v in loads.items() if i not in off}
    materials = _materials_apart(specimens, rest)
    problems = [_single(specimens, palette, i, shift, loads[i]) for i, shift in sorted(off.items())]
    problems += [
        _problem(specimens[i], shift, "other materials' (or its law is off by as much)")
        for i, shift in sorted(materials.items())
    ]
    rest = {i: v for i, v in rest.items() if i not in materials}
    whole = _whole(specimens, palette, rest)
    return [*problems, *_fields_in_percent(specimens), *([] if whole is None else [whole])]


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
        if not len(gaps) or gaps.max() < _SPLIT:
            whole.extend(values)
            continue
        cut = int(np.argmax(gaps)) + 1
        shift = float(np.median(values[cut:]) - np.median(values[:cut]))
        tight = max(np.ptp(values[:cut]), np.ptp(values[cut:])) < 0.5 * _SPLIT
        if tight and _slip(shift, _AMONG_REPLICATES) is not None:
            split.append((members[:cut], members[cut:], shift))
    reference = float(np.median(whole)) if len(whole) > 2 else 0.0
    off: dict[int, float] = {}
    by_factor: dict[float, list[tuple[list[int], list[int], float]]] = {}
    for one in split:
        slip = _slip(one[2], _AMONG_REPLICATES)
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
    residuals = _trend_residuals([specimens[i] for i in places], [loads[i] for i in places])
    if residuals is None:
        return {}
    single = {group[0] for group in replicate_groups(specimens) if len(group) == 1}
    if float(np.median(np.abs(residuals))) * 1.4826 > _STEADY:
        return {}
    return {
        i: float(r)
        for i, r in zip(places, residuals, strict=True)
        if i in single and _slip(float(r), _AMONG_REPLICATES) is not None
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
        if len(others) < 3 or np.ptp(others) > _SPLIT:
            continue
        shift = median - float(np.median(others))
        if _slip(shift, _AMONG_REPLICATES) is not None:
            off |= dict.fromkeys(by_material[material], shift)
    return off


def _whole(
    specimens: Sequence[Specimen], palette: Palette, loads: Mapping[int, float]
) -> QualityProblem | None:
    near = _near_reference(specimens, palette, loads)
    if not near:
        return None
    values = np.array([loads[i] for i in near])
    shift = float(np.median(values))
    spread = float(np.median(np.abs(values - shift))) * 1.4826
    if spread > max(0.5 * _SPLIT, 0.25 * abs(shift)):
        return None
    travel = [t for i in near if (t := _travel_slip(specimens[i], palette, loads[i])) is not None]
    if 2 * len(travel) > len(near):
        return _of_all(travel[0])
    tolerance = _AGAINST_LAW if abs(shift) < _BEYOND_EFFECTS else 2.0 * _AGAINST_LAW
    if _slip(shift, tolerance) is None:
        return None
    return _of_all(_problem(specimens[near[0]], shift, "the laws'"))


def _of_all(problem: QualityProblem) -> QualityProblem:
    unit = problem.unit_of
    return replace(problem, specimen=None, unit_of=unit and replace(unit, specimens=()))


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
        and abs(t - reference) <= _NEAR_K
    ]
    return near or list(loads)


def _single(
    specimens: Sequence[Specimen], palette: Palette, i: int, shift: float, load: float
) -> QualityProblem:
    travel = _travel_slip(specimens[i], palette, load)
    if travel is not None:
        return travel
    return _problem(specimens[i], shift, "its replicates' or neighbours'")


def _problem(specimen: Specimen, shift: float, whose: str) -> QualityProblem:
    slip = _slip(shift, math.inf)
    assert slip is not None
    ratio = math.exp(abs(shift))
    way, words = ("above", slip.high) if shift > 0 else ("below", slip.low)
    unit = None
    if slip.factor in _FORCE_FACTORS:
        factor = slip.factor if shift < 0.0 else 1.0 / slip.factor
        unit = _unit_of(specimen, "force", specimen.force_unit_N, factor)
    return QualityProblem(
        specimen.id,
        "units",
        f"loads are {ratio:.3g} times {way} {whose}, as if {words} (factor {slip.factor:.4g})",
        unit,
    )


def _unit_of(specimen: Specimen, quantity: str, own: float | None, factor: float) -> UnitOf | None:
    """Return the unit by which numbers in a file become `factor` times what they are now."""
    if own is None:
        return None
    unit = unit_near(QUANTITIES[quantity][1], math.log(own * factor), own)
    return None if unit is None else UnitOf(quantity, unit, (specimen.id,))


def _slip(shift: float, tolerance: float) -> _Slip | None:
    nearest = min(_SLIPS, key=lambda s: abs(abs(shift) - math.log(s.factor)))
    return nearest if abs(abs(shift) - math.log(nearest.factor)) < tolerance else None


def _travel_slip(specimen: Specimen, palette: Palette, load: float) -> QualityProblem | None:
    """Say that travel is in another unit where correcting it brings the load into place.

    A factor on travel is told from one on force by the declared rate.
    """
    if abs(load) < math.log(_INCH) - 2.0 * _SPLIT or specimen.rate_mm_s is None:
        return None
    speed = speed_mm_s(specimen.time_s, specimen.travel_mm)
    ratio = math.log(speed / specimen.rate_mm_s) if speed > 0.0 else 0.0
    if abs(abs(ratio) - math.log(_INCH)) > RATE_TOLERANCE:
        return None
    corrected = _log_load(specimen, palette, stretched=_INCH if ratio < 0.0 else 1.0 / _INCH)
    if corrected is None or abs(corrected) > abs(load) - _SPLIT:
        return None
    words = "inches taken for mm" if ratio < 0.0 else "mm taken for inches"
    factor = _INCH if ratio < 0.0 else 1.0 / _INCH
    return QualityProblem(
        specimen.id,
        "units",
        f"travel is off by 25.4 against its declared rate and its load, as if {words}",
        _unit_of(specimen, "travel", specimen.travel_unit_mm, factor),
    )


_HUNDREDFOLD = (30.0, 300.0)
"""Mean local strain over travel by gauge length, of a field in per cent. Chosen: a hundred, or a
third or three times as much, for what slips in the grips or lies beyond the gauge."""


def _fields_in_percent(specimens: Sequence[Specimen]) -> Iterator[QualityProblem]:
    for s in specimens:
        if s.strain_field is None:
            continue
        mean = np.mean(s.strain_field.strain, axis=1)
        travel = np.interp(s.strain_field.time_s, s.time_s, s.strain)
        at = int(np.argmax(travel))
        low, high = _HUNDREDFOLD
        if travel[at] > 0.0 and low < abs(mean[at]) / travel[at] < high:
            words = (
                f"the strain field reaches {mean[at]:.3g} on average, travel over gauge length "
                f"{travel[at]:.3g}; per cent taken for fractions"
            )
            yield QualityProblem(s.id, "units", words)


# ------------------------------------------------------------------------------------------------
# Examine a campaign's data.


_KINDS = (
    "dead", "units", "size", "rate", "protocol", "amplitude", "outlier", "clipped", "duplicate",
    "dropout", "spike",
)  # fmt: skip
"""In the order in which they are told."""


def examine(campaign: Campaign) -> tuple[QualityProblem, ...]:
    """Return what is wrong with a campaign's data, problems of all of it first.

    Nothing is changed or left out. Specimens are judged against their own declaration, their
    replicates and, by the factors between units alone, the palette's laws: a load that is off by
    any other factor is a gap to diagnose, not a fault of the data.
    """
    records = record_problems(campaign.specimens)
    specimens = [without_spikes(s) for s in campaign.specimens]
    silent = {p.specimen for p in records if p.kind == "dead"}
    units = _unit_problems([s for s in specimens if s.id not in silent], campaign.palette)
    suspect = [*units, *(p for p in records if p.kind in ("dead", "duplicate"))]
    outliers = _outlier_problems(specimens, {p.specimen for p in suspect})
    order = {None: -1} | {s.id: place for place, s in enumerate(specimens)}
    problems = (*records, *units, *outliers)
    return tuple(sorted(problems, key=lambda p: (order[p.specimen], _KINDS.index(p.kind))))


# ------------------------------------------------------------------------------------------------
# As a verdict hints: a gain of force or travel that is the factor between two units.


_GAINS: Mapping[tuple[str, str], tuple[str, float]] = MappingProxyType(
    {
        ("force-scale", "log_gain"): ("force", -1.0),
        ("force-scale", "factor"): ("force", -1.0),
        ("strain-scale", "log_factor"): ("travel", 1.0),
    }
)
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
            reach = max(OWN, abs(low - log), abs(high - log))
            by_unit: dict[str, list[str]] = {}
            for s in specimens:
                own = s.force_unit_N if quantity == "force" else s.travel_unit_mm
                if own is None or (effect.specimens and s.id not in effect.specimens):
                    continue
                unit = unit_near(QUANTITIES[quantity][1], math.log(own) + log, own, reach)
                if unit is not None:
                    by_unit.setdefault(unit, []).append(s.id)
            for unit, ids in by_unit.items():
                yield UnitOf(quantity, unit, () if len(ids) == len(specimens) else tuple(ids))


def merged_units(units: Iterable[UnitOf]) -> tuple[UnitOf, ...]:
    """Return each unit once, with all its specimens."""
    found: dict[tuple[str, str], tuple[str, ...]] = {}
    for one in units:
        key = one.quantity, one.unit
        before = found.setdefault(key, one.specimens)
        # No specimens means all.
        found[key] = (
            tuple(dict.fromkeys(before + one.specimens)) if before and one.specimens else ()
        )
    return tuple(UnitOf(*key, specimens) for key, specimens in found.items())
