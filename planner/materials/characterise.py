"""What a tensile test says of a material without any law: modulus, toughness, elongation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from planner.errors import Caution, FileError, positive
from planner.glance import brief
from planner.numerics import BoolArray, FloatArray, IntArray, freeze, students_t

__all__ = [
    "BROKEN_SHARE",
    "HELD_SHARE",
    "MINIMUM_POINTS",
    "SECANT_STRAINS",
    "SPIKE_NOISE",
    "SPIKE_STEP",
    "STILL_SHARE",
    "UNLOADED_SHARE",
    "WIDEST_SPIKE",
    "Characteristics",
    "Curve",
    "MaterialCharacteristics",
    "Spread",
    "characterise_curve",
    "characterise_material",
    "check_record",
    "doubts",
    "noise_sd",
    "spikes_in",
    "toe_compensated",
    "without_spikes",
    "without_tail",
]


# ------------------------------------------------------------------------------------------------
# One specimen's loading curve, checked: the input of characterisation and of fitting.


MINIMUM_POINTS = 8
"""Fewer points than this decide neither a slope nor a law."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Nominal stress against engineering strain of one specimen.

    Attributes
    ----------
    specimen
        The specimen's name; errors carry it.
    strain
        Engineering strain (elongation over gauge length, a fraction), shape (n,).
    stress_MPa
        Nominal stress (force over the undeformed section), shape (n,).
    material
        What the specimen is made of, as the lab calls it.
    notes
        What was corrected or assumed on the way, one sentence each.
    mode
        ``uniaxial``, ``planar`` or ``equibiaxial``; in uniaxial compression strain and stress
        are negative. ``compression`` where nothing was pulled: they are sizes.

    Raises
    ------
    FileError
        The arrays differ in length, hold NaN or infinity, or have fewer than `MINIMUM_POINTS`
        points.
    """

    specimen: str
    strain: FloatArray
    stress_MPa: FloatArray
    material: str = ""
    notes: tuple[str, ...] = field(default=())
    mode: str = "uniaxial"

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "strain", "stress_MPa")
        columns = {"strain": self.strain, "stress_MPa": self.stress_MPa}
        check_record(f"specimen {self.specimen}", columns)

    def part(self, keep: slice | BoolArray, *notes: str, origin: float = 0.0) -> "Curve":
        """Return the points that are kept, strains counted from `origin`, with more notes."""
        strain, stress = self.strain[keep] - origin, self.stress_MPa[keep]
        return replace(self, strain=strain, stress_MPa=stress, notes=(*self.notes, *notes))


def check_record(where: str, columns: Mapping[str, FloatArray]) -> None:
    """Refuse columns that are no record of a test.

    Raises
    ------
    FileError
        They differ in length, hold NaN or infinity, have fewer than `MINIMUM_POINTS` points, or
        ``time_s`` does not rise.
    """
    shapes = {name: array.shape for name, array in columns.items()}
    points, *more = next(iter(shapes.values()))
    if len(set(shapes.values())) > 1 or more:
        raise FileError(f"{where}: columns differ in shape ({shapes}); give one value a point")
    if points < MINIMUM_POINTS:
        raise FileError(
            f"{where}: the record has {points} points; at least {MINIMUM_POINTS} are needed: "
            "export all of it, not a row a test, or leave the specimen out"
        )
    for name, array in columns.items():
        if len(bad := np.flatnonzero(~np.isfinite(array))):
            raise FileError(
                f"{where}: {name} is {array[bad[0]]} at point {bad[0] + 1}; remove or repair "
                "such points"
            )
    time = columns.get("time_s", np.arange(points))
    if len(fall := np.flatnonzero(np.diff(time) <= 0.0)):
        raise FileError(
            f"{where}: time goes from {time[fall[0]]:g} s to {time[fall[0] + 1]:g} s at point "
            f"{fall[0] + 2}; time must rise"
        )


# ------------------------------------------------------------------------------------------------
# Where a record breaks, how noisy it is, and which points leap out of it.


UNLOADED_SHARE = 0.02
"""Share of the peak stress that a specimen at rest may show: more tells a load cell not zeroed."""

BROKEN_SHARE = 0.2
"""A stress below this share of the peak, behind the peak, is a broken specimen's."""

_RUPTURE_SHARE = 0.25
"""A fall by this share of the peak from one point to the next is rupture at once."""

_SUDDEN_SHARE = 0.03
"""A fall of more than this share from one point to the next, just before rupture, belongs to it."""


def noise_sd(values: FloatArray) -> float:
    """Return the standard deviation of point-to-point noise.

    From the median absolute third difference, which a smooth course and single jumps leave
    almost untouched; white noise of deviation s has third differences of deviation sqrt(20) s.
    """
    if len(values) < 4:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / np.sqrt(20.0))


SPIKE_NOISE, SPIKE_STEP = 12.0, 5.0
"""A spike leaps by so many noise deviations, so many steps nearby; so does time over lost rows.
Chosen: noise never does, and adaptive sampling changes less at once."""

WIDEST_SPIKE = 3
"""Points that a spike has at most. Chosen: what lasts longer is an event."""


def spikes_in(values: FloatArray) -> BoolArray:
    """Return which points, up to `WIDEST_SPIKE` beside each other, leap out of a record.

    A turn of a triangle wave or a break is none: a spike leaps further off the median of what is
    around it than the record moves there.
    """
    low, high = np.quantile(values, [0.02, 0.98])  # without what leaps out
    least = max(SPIKE_NOISE * noise_sd(values), _SUDDEN_SHARE * float(high - low))
    padded = np.pad(values, WIDEST_SPIKE, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * WIDEST_SPIKE + 1)
    moves = np.median(np.abs(np.diff(around, axis=1)), axis=1)
    off = np.abs(values - np.median(around, axis=1))
    return np.asarray(off > np.maximum(least, SPIKE_STEP * moves))


def without_spikes(curve: Curve) -> Curve:
    """Leave out points whose stress leaps out of the record, and note it.

    What leaps at its end may be the break.
    """
    leaps = spikes_in(curve.stress_MPa)
    leaps[-WIDEST_SPIKE:] = False
    if not (count := int(leaps.sum())) or len(leaps) - count < MINIMUM_POINTS:
        return curve
    points = "1 point leaps" if count == 1 else f"{count} points leap"
    where = f"strain {curve.strain[np.argmax(leaps)]:.4g}"
    told = f"{points} out of the record (at {where}) and {'is' if count == 1 else 'are'} left out"
    return curve.part(~leaps, f"specimen {curve.specimen}: {told}")


def without_tail(curve: Curve) -> Curve:
    """Cut what a record holds behind rupture, and note it; ask about a break ahead of the peak.

    Rupture is where the stress behind its peak falls below `BROKEN_SHARE` of it, or by
    `_RUPTURE_SHARE` of it at once, or where the record ends in a sudden fall; the sudden falls
    (`_SUDDEN_SHARE`) just before are cut as well. A drop behind a yield point is slow and stays.

    Raises
    ------
    FileError
        The stress never rises above its noise, or too few points are left.
    """
    stress, strain = curve.stress_MPa, curve.strain
    noise = noise_sd(stress)
    peak = int(np.argmax(stress))
    height = float(stress[peak])
    if height <= 0.0 or height - float(np.median(stress[:3])) <= 6.0 * noise:
        raise FileError(
            f"specimen {curve.specimen}: the curve never loads (stress reaches {height:g} MPa, "
            f"noise is {noise:.2g} MPa); check the load cell, the sign and the columns"
        )
    borne = np.maximum.accumulate(stress[:peak]) > max(UNLOADED_SHARE * height, 6.0 * noise)
    slack = np.flatnonzero(borne & (stress[:peak] <= 0.0))
    if len(slack) > WIDEST_SPIKE:
        told = (
            f"specimen {curve.specimen}: bears nothing from strain {strain[slack[0]]:.4g} on, and "
            "more than ever behind that; if it broke there, end the record there"
        )
        curve = curve.part(slice(None), Caution(told))
    behind = stress[peak:]
    broken = behind[1:] < BROKEN_SHARE * height
    broken |= -np.diff(behind) > max(_RUPTURE_SHARE * height, 6.0 * noise)
    last = peak + int(np.argmax(broken)) if broken.any() else len(stress) - 1
    sudden = max(_SUDDEN_SHARE * height, 6.0 * noise)
    while last > peak and stress[last - 1] - stress[last] > sudden:
        last -= 1
    cut = len(stress) - 1 - last
    if not cut:
        return curve
    if last + 1 < MINIMUM_POINTS:
        raise FileError(
            f"specimen {curve.specimen}: only {last + 1} points before the break at strain "
            f"{strain[last]:g}; at least {MINIMUM_POINTS} are needed: sample faster"
        )
    return curve.part(
        slice(last + 1),
        f"specimen {curve.specimen}: breaks at strain {strain[last]:.4g}; {cut} points behind it "
        "are cut",
    )


# ------------------------------------------------------------------------------------------------
# The linear part of a loading curve, and the toe before it.
#
# The rule, in the order it is applied:
#
# 1. Slopes of short windows along the curve up to its peak; a window is just long enough that
#    scatter leaves the steepest slope of the beginning uncertain by at most 2 % (standard error),
#    and no longer than a sixth of the points.
# 2. The tangent sought is the steepest of the first rise: before the slopes first fall below 80 %
#    of their largest so far, at a stress above a load cell's at rest, and within the first 0.2 of
#    strain, by which grips have seated and slack is drawn out. The final upturn of a rubber is
#    thereby out of the question.
# 3. From there the linear part grows both ways while the windows' slopes stay within 5 % of the
#    least-squares slope of what it holds already (plus three standard errors), until it no longer
#    changes. Its least-squares slope is Young's modulus.
# 4. A toe is there if the line meets zero stress behind the record's first point, by more than
#    three standard errors and half a step, and the points before lie above it. Strains then count
#    from that point (ASTM D638, annex A1: the tangent at the maximum slope, extrapolated to zero
#    stress).
#
# 5. A part that begins with the record and yet bends is the arc of a rubber and no line: a parabola
#    through it changes its slope by more than a tenth, and by five standard errors. Its modulus is
#    the slope at the beginning of Mooney's form, c0 + (l - l^-2) (c1 + c2 / l), through it (up to a
#    strain of 1), and nothing is shifted.
#
# A curve that steepens on beyond that range, as a rubber's may, has no such tangent: its modulus
# is the slope at the origin, and nothing is shifted.


_SLOPE_ERROR = 0.02
_FIRST_FALL = 0.8
_LINEARITY = 0.05
_TOE_RANGE = 0.2
"""Strain within which the linear part begins."""

_LONG_SHARE = 0.2
"""A line over this share of the peak stress is one, though the slopes rise on behind it."""

_ARC_CHANGE = 0.1
"""Relative change of slope over a part that is an arc."""

_MOONEY_RANGE = 1.0
"""Strain over which Mooney's form holds a rubber; its upturn lies beyond."""

_MINIMUM_WINDOW = 5


@dataclass(frozen=True, slots=True)
class LinearPart:
    """Where a curve is straight, and how steep.

    Attributes
    ----------
    start, stop
        Points of the linear part, as a slice.
    modulus_MPa
        Slope of the line, or of the arc at its beginning.
    toe_strain
        The strain from which strains count; 0 where there is no toe.
    kind
        "line" (a linear part was found), "arc" (the curve bends from its beginning) or "origin"
        (it steepens on); the modulus of the latter two is the slope at the beginning.
    zero_strain
        Where the line, or the arc's tangent, meets zero stress, shifted or not.
    """

    start: int
    stop: int
    modulus_MPa: float
    toe_strain: float
    kind: Literal["line", "arc", "origin"]
    zero_strain: float


class _Lines:
    """Least-squares lines through runs of points, each in constant time by running sums."""

    def __init__(self, x: FloatArray, y: FloatArray) -> None:
        self._centre = float(x.mean()), float(y.mean())
        u, v = x - self._centre[0], y - self._centre[1]
        self._sums = [np.append(0.0, np.cumsum(values)) for values in (u, v, u * u, u * v, v * v)]

    def _moments(self, i: IntArray | int, j: IntArray | int) -> tuple[FloatArray, ...]:
        n = np.asarray(j - i, dtype=np.float64)
        u, v, uu, uv, vv = (s[j] - s[i] for s in self._sums)
        return n, u / n, v / n, uu - u * u / n, uv - u * v / n, vv - v * v / n

    def windows(self, width: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Slopes of all windows of `width` points, spread of x (Sxx), scatter about each line."""
        start = np.arange(len(self._sums[0]) - width)
        _, _, _, sxx, sxy, syy = self._moments(start, start + width)
        sxx = np.where(sxx > 0.0, sxx, np.inf)
        slopes = sxy / sxx
        return slopes, sxx, np.sqrt(np.maximum(syy - slopes * sxy, 0.0) / (width - 2))

    def line(self, start: int, stop: int) -> tuple[float, float, float]:
        """Slope, where the line meets zero, and that strain's standard error."""
        n, u, v, sxx, sxy, syy = map(float, self._moments(start, stop))
        slope = sxy / sxx if sxx > 0.0 else 0.0
        if slope <= 0.0:
            return slope, 0.0, np.inf
        variance = max(syy - slope * sxy, 0.0) / max(n - 2.0, 1.0)
        x_mean, y_mean = u + self._centre[0], v + self._centre[1]
        zero = x_mean - y_mean / slope
        zero_error = np.sqrt(variance * (1.0 / n + (x_mean - zero) ** 2 / sxx)) / slope
        return slope, zero, float(zero_error)


def _linear_part(curve: Curve) -> LinearPart:
    """Find a curve's linear part by the rule in the module's description.

    Raises
    ------
    FileError
        The stress reaches its peak within fewer than five points.
    """
    peak = int(np.argmax(curve.stress_MPa)) + 1
    x, y = curve.strain[:peak], curve.stress_MPa[:peak]
    if peak < _MINIMUM_WINDOW:
        raise FileError(
            f"specimen {curve.specimen}: the stress peaks at point {peak}; a slope takes at "
            f"least {_MINIMUM_WINDOW} points of loading: sample faster, or turn its rows round"
        )
    lines = _Lines(x, y)
    noise = noise_sd(y)
    begins = x - x[0] <= _TOE_RANGE
    slopes, errors, width = _windows(lines, begins, noise)
    # In slack there is noise alone, whose slopes rise and fall.
    bears = int(np.argmax(y[width - 1 :] > UNLOADED_SHARE * y[-1]))
    seed, still_rising = _steepest(slopes, errors, begins[: len(slopes)], bears)
    start, stop = _grow(lines, slopes, errors, seed, width)
    kind: Literal["line", "arc", "origin"] = "line"
    if still_rising and y[stop - 1] - y[start] < _LONG_SHARE * y[-1]:
        kind = "origin"
        start, stop = _grow(lines, slopes, errors, 0, width)
    modulus, zero, zero_error = lines.line(start, stop)
    # Scatter of the first slopes makes no toe, whose points would lie above the line.
    above = y[:start] - modulus * (x[:start] - zero)
    arc = _arc(x[:stop], y[:stop]) if above.sum() <= 0.0 else None
    if arc is not None:
        kind = "arc" if kind == "line" else kind
        start, (modulus, zero) = 0, arc
    if modulus <= 0.0:
        raise FileError(
            f"specimen {curve.specimen}: the stress does not rise with strain at strain "
            f"{x[start]:.4g}; check the columns, or cut the record before the loading"
        )
    toe = 0.0
    if kind == "line" and curve.mode != "compression":  # which steepens, so that all have a zero
        front = x < zero
        # On the line itself, they show a load that was not zeroed, and no toe.
        above = y[front] - modulus * (x[front] - zero)
        is_behind = zero - x[0] > max(3.0 * zero_error, 0.5 * float(np.median(np.diff(x[:stop]))))
        if is_behind and float(np.mean(above)) > 3.0 * noise / np.sqrt(len(above)):
            toe = zero
    return LinearPart(start, stop, modulus, toe, kind, zero)


def _arc(x: FloatArray, y: FloatArray) -> tuple[float, float] | None:
    """Slope of an arc at its first point, and the zero of the tangent there.

    None where a parabola's bend is not significant, or the slope not positive.
    """
    if len(x) < _MINIMUM_WINDOW or x[-1] <= x[0]:
        return None
    terms = np.vander((x - x[0]) / float(x[-1] - x[0]), 3, increasing=True)
    inverse = np.linalg.pinv(terms)
    coefficients = inverse @ y
    slope, bend = (float(c) for c in coefficients[1:])
    scatter = float(np.sum((y - terms @ coefficients) ** 2)) / (len(x) - 3)
    bend_error = np.sqrt(scatter * np.sum(inverse[2] ** 2))
    if slope <= 0.0 or abs(bend) <= max(5.0 * bend_error, 0.5 * _ARC_CHANGE * slope):
        return None
    # Mooney's form instead of the parabola: as many coefficients, and the shape of rubber.
    near = x - x[0] <= max(_MOONEY_RANGE, float(x[_MINIMUM_WINDOW - 1] - x[0]))
    stretch = 1.0 + x[near]
    uniaxial = stretch - stretch**-2.0
    terms = np.stack([np.ones_like(stretch), uniaxial, uniaxial / stretch], axis=1)
    level, first, second = (float(c) for c in np.linalg.lstsq(terms, y[near])[0])
    at = float(stretch[0])
    slope = first * (1.0 + 2.0 * at**-3.0) + 3.0 * second * at**-4.0
    if slope <= 0.0:
        return None
    start = float(terms[0] @ [level, first, second])
    return slope, float(x[0]) - start / slope


def _windows(lines: _Lines, begins: BoolArray, noise: float) -> tuple[FloatArray, FloatArray, int]:
    """Slopes, their standard errors, and the width of the shortest windows that do."""
    count = len(begins)
    width = min(_MINIMUM_WINDOW, max(3, count // 6))
    while True:
        slopes, spread, scatter = lines.windows(width)
        near = begins[: len(slopes)]
        # Typical scatter, so that one stray point neither spoils nor excuses its window.
        errors = max(noise, float(np.median(scatter[near]))) / np.sqrt(spread)
        at = int(np.argmax(np.where(near, slopes, -np.inf)))
        if errors[at] <= _SLOPE_ERROR * slopes[at] or width * 1.5 > count / 6:
            return slopes, errors, width
        width = int(width * 1.5)


def _steepest(
    slopes: FloatArray, errors: FloatArray, near: BoolArray, bears: int
) -> tuple[int, bool]:
    """Index of the steepest window of the first rise, and whether steeper ones follow it.

    The rise does not end before the window from which on the specimen bears.
    """
    highest = np.maximum.accumulate(slopes - errors)
    falls = (slopes + 2.0 * errors < _FIRST_FALL * highest) & (highest > 0.0)
    fallen = bears + np.flatnonzero(falls[bears:])
    end = max(int(fallen[0]), 1) if len(fallen) else len(slopes)
    rise = slopes[:end]
    seed = int(np.argmax(np.where(near[:end], rise, -np.inf)))
    limit = (1.0 + _LINEARITY) * slopes[seed] + 3.0 * errors[seed]
    return seed, bool(np.any(rise[seed:] > limit))


def _grow(
    lines: _Lines, slopes: FloatArray, errors: FloatArray, seed: int, width: int
) -> tuple[int, int]:
    """Grow from a window both ways while slopes agree with the line; the points' slice."""
    modulus = float(slopes[seed])
    first = last = seed
    for _ in range(20):
        fits = np.abs(slopes - modulus) <= _LINEARITY * abs(modulus) + 3.0 * errors
        fits[seed] = True
        misfits = np.flatnonzero(~fits)
        before = int(misfits[misfits < seed].max(initial=-1))
        behind = int(misfits[misfits > seed].min(initial=len(slopes)))
        if (before + 1, behind - 1) == (first, last):
            break
        first, last = before + 1, behind - 1
        modulus = lines.line(first, last + width)[0]
    return first, last + width


# ------------------------------------------------------------------------------------------------
# Whether a material deforms elastically (a hyperelastic law) or plastically (a modulus alone).
#
# The rule:
#
# - Young's modulus above 70 MPa: plastic. ASTM D883 calls a plastic nonrigid up to 70 MPa
#   (10 000 psi), semirigid and rigid above; a network of rubber does not get there, and what is
#   stiffer takes its large strains by yielding, or breaks.
# - Up to 70 MPa: plastic only if the stress has a true yield point, a maximum in the first half of
#   the strain to break with a fall of at least 3 % of the peak behind it. A falling slope alone
#   shows nothing there: every rubber's falls.
#
# On the thesis' ten digital materials the limit stands between FLX9795 (60.5 MPa, elastic) and
# RGD8430 (95.6 MPa, plastic).


_NONRIGID_MPA = 70.0
"""Largest modulus of a nonrigid plastic (ASTM D883)."""

_YIELD_DROP = 0.03


@dataclass(frozen=True, slots=True)
class Deformation:
    """How a material deforms, and by which part of the rule."""

    kind: Literal["elastic", "plastic"]
    reason: str


def _yield_strain(curve: Curve, origin: float) -> float | None:
    """Return the strain at the yield point: the first maximum of stress before break.

    A fall of at least 3 % of the peak stress, and of six times the noise, has to follow.
    """
    stress = curve.stress_MPa
    highest = np.maximum.accumulate(stress)
    drop = max(_YIELD_DROP * float(stress.max()), 6.0 * noise_sd(stress))
    fallen = np.flatnonzero(highest - stress > drop)
    return float(curve.strain[np.argmax(stress[: fallen[0]])]) - origin if len(fallen) else None


def deformation(
    modulus_MPa: float, elongation_at_break: float, yield_strain: float | None = None
) -> Deformation:
    """Classify by Young's modulus, strain at break and strain at yield (None: no yield point)."""
    modulus, limit = f"modulus {modulus_MPa:.3g} MPa is", f"{_NONRIGID_MPA:g} MPa"
    yields = "" if yield_strain is None else f"yields at strain {yield_strain:.3g}"
    if modulus_MPa > _NONRIGID_MPA:
        above = f"{modulus} above {limit}, not a nonrigid material (ASTM D883); it"
        return Deformation("plastic", f"{above} {yields or 'breaks without a yield point'}")
    if yield_strain is not None and yield_strain <= 0.5 * elongation_at_break:
        before = f"before half its strain to break ({elongation_at_break:.3g})"
        return Deformation("plastic", f"{yields}, {before}")
    none = "no yield point comes before half the strain to break"
    return Deformation("elastic", f"{modulus} nonrigid (up to {limit}, ASTM D883) and {none}")


# ------------------------------------------------------------------------------------------------
# What a tensile test says of a material without any law: modulus, toughness, elongation.


SECANT_STRAINS = (0.1, 0.5, 1.0)
_MATERIAL_FIGURES = (
    "modulus_MPa", "modulus_uncompensated_MPa", "toughness_MJ_m3", "elongation_at_break",
    "strength_MPa",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Characteristics:
    """One specimen's figures. Strains count from the toe-compensated origin.

    Attributes
    ----------
    modulus_MPa
        Young's modulus: the slope of the linear part.
    modulus_uncompensated_MPa
        Stress over strain at the end of the linear part with strains as recorded: what the
        modulus would be without compensation. The modulus itself where there is no toe.
    zero_strain
        Where the line of that slope meets zero stress; 0 behind a toe that was taken off.
    toe_strain
        What was taken off the strains; 0 where there is no toe.
    toughness_MJ_m3
        Area under the curve to break, in MJ/m3 (MPa).
    elongation_at_break
        Strain at break, a fraction.
    strength_MPa
        Largest nominal stress.
    secant_MPa
        Stress over strain by strain; None beyond break.
    """

    specimen: str
    modulus_MPa: float
    modulus_uncompensated_MPa: float
    linear_strain: tuple[float, float]
    zero_strain: float
    toe_strain: float
    toughness_MJ_m3: float
    elongation_at_break: float
    strength_MPa: float
    secant_MPa: Mapping[float, float | None]
    yield_strain: float | None
    deformation: Deformation
    notes: tuple[str, ...]

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and scatter of one figure over replicates.

    Attributes
    ----------
    sd, cv
        Standard deviation (n - 1) and its ratio to the mean; None for one specimen.
    interval
        95 % interval of the mean by Student's t; None for one specimen.
    """

    mean: float
    sd: float | None
    cv: float | None
    interval: tuple[float, float] | None
    n: int


@dataclass(frozen=True, slots=True)
class MaterialCharacteristics:
    """One material's figures over its specimens; names of `spreads` are those of the table."""

    material: str
    specimens: tuple[Characteristics, ...]
    spreads: Mapping[str, Spread]
    deformation: Deformation
    agree: bool

    __repr__ = brief

    @property
    def n(self) -> int:
        """Number of specimens."""
        return len(self.specimens)


def toe_compensated(curve: Curve) -> Curve:
    """Return the curve with strains counted from the end of its toe (ASTM D638, annex A1).

    Points before that origin are dropped; a curve without a toe comes back as it is.
    """
    part = _linear_part(curve)
    toe = part.toe_strain
    return curve.part(curve.strain >= toe, _toe_note(curve, part), origin=toe) if toe else curve


def characterise_curve(
    curve: Curve, *, secant_strains: Sequence[float] = SECANT_STRAINS
) -> Characteristics:
    """Take a loading curve's figures.

    Raises
    ------
    FileError
        The curve has no rising part to take a slope from.
    ArgumentError
        A secant strain is not above 0.
    """
    for value in secant_strains:
        positive(value, "secant strain")
    part = _linear_part(curve)
    strain = curve.strain - part.toe_strain
    end = part.stop - 1
    elongation = float(strain[-1])
    at_yield = _yield_strain(curve, part.toe_strain)
    how = deformation(part.modulus_MPa, elongation, at_yield)
    # Of a record that begins behind rest; where there is a toe it begins before its end.
    origin_area = 0.5 * max(float(strain[0]), 0.0) * max(float(curve.stress_MPa[0]), 0.0)
    secants = {value: _secant(curve, part.toe_strain, value) for value in secant_strains}
    return Characteristics(
        specimen=curve.specimen,
        modulus_MPa=part.modulus_MPa,
        modulus_uncompensated_MPa=part.modulus_MPa * float(strain[end] / curve.strain[end]),
        linear_strain=(float(strain[part.start]), float(strain[end])),
        zero_strain=part.zero_strain - part.toe_strain,
        toe_strain=part.toe_strain,
        toughness_MJ_m3=float(np.trapezoid(curve.stress_MPa, strain)) + origin_area,
        elongation_at_break=elongation,
        strength_MPa=float(np.max(curve.stress_MPa)),
        secant_MPa=secants,
        yield_strain=at_yield,
        deformation=how,
        notes=(_toe_note(curve, part), *_odd(curve, part, how.kind)),
    )


def characterise_material(
    material: str, curves: Sequence[Curve], *, secant_strains: Sequence[float] = SECANT_STRAINS
) -> MaterialCharacteristics:
    """Take the figures of a material's specimens, with their spread.

    Raises
    ------
    FileError, ArgumentError
        See `characterise_curve`.
    """
    found = tuple(characterise_curve(curve, secant_strains=secant_strains) for curve in curves)
    figures = {name: [getattr(c, name) for c in found] for name in _MATERIAL_FIGURES}
    for strain in secant_strains:
        secants = (c.secant_MPa[strain] for c in found)
        figures[f"secant_{strain:g}_MPa"] = [one for one in secants if one is not None]
    spreads = {name: spread_of(values) for name, values in figures.items() if values}
    yields = [c.yield_strain for c in found if c.yield_strain is not None]
    at_yield = float(np.mean(yields)) if 2 * len(yields) > len(found) else None
    modulus, elongation = spreads["modulus_MPa"].mean, spreads["elongation_at_break"].mean
    whole = deformation(modulus, elongation, at_yield)
    agree = all(c.deformation.kind == whole.kind for c in found)
    return MaterialCharacteristics(material, found, spreads, whole, agree)


def spread_of(values: Sequence[float]) -> Spread:
    """Return mean, standard deviation, coefficient of variation and 95 % t-interval."""
    n = len(values)
    mean = float(np.mean(values))
    if n < 2:
        return Spread(mean, None, None, None, n)
    sd = float(np.std(values, ddof=1))
    half = students_t(0.95, n) * sd / n**0.5
    return Spread(mean, sd, sd / abs(mean) if mean else None, (mean - half, mean + half), n)


def _secant(curve: Curve, toe: float, strain: float) -> float | None:
    """Stress over strain, the stress from a line through the points nearby."""
    x = curve.strain - toe
    if strain > x[-1] or strain < x[0]:
        return None
    # Five points even out noise; where they lie too far apart, two have to do.
    at = np.sort(np.argsort(np.abs(x - strain), kind="stable")[:5])
    if not 0.0 < float(np.ptp(x[at])) <= 0.5 * strain:
        return float(np.interp(strain, x, curve.stress_MPa)) / strain
    return float(np.polyfit(x[at] - strain, curve.stress_MPa[at], 1)[1]) / strain


def _toe_note(curve: Curve, part: LinearPart) -> str:
    where = f"specimen {curve.specimen}"
    if part.toe_strain:
        return (
            f"{where}: a toe; strains count from {part.toe_strain:.4g}, where the steepest tangent "
            "meets zero stress (ASTM D638, A1)"
        )
    if part.kind == "origin":
        return f"{where}: steepens from the start; modulus at the origin, strains not shifted"
    if part.kind == "arc":
        return f"{where}: bends from the start; modulus at the origin, no toe, strains not shifted"
    if part.start == 0 and part.zero_strain > 0.0 and curve.strain[0] > 0.0:
        return (
            f"{where}: begins at strain {curve.strain[0]:.4g} on a line from "
            f"{part.zero_strain:.4g}; no toe is recorded, strains not shifted"
        )
    return f"{where}: no toe; strains not shifted"


STILL_SHARE, HELD_SHARE = 1e-3, 0.02
"""The last share of the travel in which a hold is, and the share of all points from which it is
one. Chosen: in a pull at one rate a thousandth of the points is there, in a hold far more."""


def _odd(curve: Curve, part: LinearPart, kind: str) -> Iterator[str]:
    """Say what is odd at the ends of a curve.

    A line or arc that misses the origin though the record begins at rest, a hold at the end, which
    is no break, and a long fall at the end of a rubber's curve, which counts as elongation.
    """
    strain, stress, where = curve.strain, curve.stress_MPa, f"specimen {curve.specimen}"
    at_rest, at_peak = -part.modulus_MPa * part.zero_strain, int(np.argmax(stress))
    peak, end = float(stress[at_peak]), float(strain[-1])
    begins = float(strain[0]) <= 0.01 * end
    if begins and not part.toe_strain and abs(at_rest) > UNLOADED_SHARE * peak:
        yield Caution(
            f"{where}: its beginning points at {at_rest:.3g} MPa at rest, "
            f"{100 * at_rest / peak:.2g} % of its peak; it may not have been zeroed"
        )
    held = int(np.sum(strain >= end - STILL_SHARE * np.ptp(strain)))
    if held > max(HELD_SHARE * len(strain), 3.0):
        yield Caution(
            f"{where}: it ends in a hold of {held} points at strain {end:.4g}; it was not pulled "
            "to its break, for which the largest strain stands"
        )
    if kind == "elastic" and strain[at_peak] <= 0.98 * end and 1.0 - stress[-1] / peak >= 0.1:
        yield (
            f"{where}: stress falls slowly from its peak at strain {strain[at_peak]:.4g} "
            f"to the break at {end:.4g}, which counts as elongation"
        )


# ------------------------------------------------------------------------------------------------
# What to look at again before a material's figures are used.


_REPLICATE_FACTOR = 2.0
"""Replicates differ by a few to some tens of per cent; beyond this factor from their median a
specimen is another material, or its size is wrong."""

_DOUBTED_FIGURES = {
    "modulus (MPa)": "modulus_MPa",
    "strength (MPa)": "strength_MPa",
    "strain at break": "elongation_at_break",
}


def doubts(found: MaterialCharacteristics, *, unit_told: bool = False) -> Iterator[str]:
    """Say what speaks against a material's figures, one sentence each.

    Where it was told that specimens are in another unit (`unit_told`), what follows from that is
    not told again.

    - Specimens that deform unlike one another.
    - Specimens whose modulus, strength or strain at break is more than `_REPLICATE_FACTOR` times
      the replicates' median, or less than its inverse; two specimens are compared directly.
    - A modulus above the nonrigid plastics' with more than twice the length at break and no
      yield point, which few materials show, and every rubber whose stress is psi given as MPa.
    """
    if not found.agree:
        kinds = ", ".join(f"{c.specimen} {c.deformation.kind}" for c in found.specimens)
        yield (
            f"{found.material}: its specimens disagree on how it deforms: {kinds}; taken as "
            f"{found.deformation.kind}, because {found.deformation.reason}"
        )
    for name, figure in _DOUBTED_FIGURES.items():
        if not (unit_told and name.endswith("(MPa)")):
            yield from _unlike(found, name, figure)
    for c in found.specimens:
        stretches = c.elongation_at_break > 1.0 and c.yield_strain is None
        if stretches and c.modulus_MPa > _NONRIGID_MPA:
            yield (
                f"specimen {c.specimen}: {c.modulus_MPa:.3g} MPa is above a nonrigid material's "
                f"({_NONRIGID_MPA:g} MPa), yet it stretches by {c.elongation_at_break:.3g} without "
                "a yield point; a rubber whose stress is psi given as MPa looks so: check the unit "
                "of stress"
            )


def _unlike(found: MaterialCharacteristics, name: str, figure: str) -> Iterator[str]:
    values = [getattr(c, figure) for c in found.specimens]
    each = [f"{v:.3g} of {c.specimen}" for v, c in zip(values, found.specimens, strict=True)]
    median = sorted(values)[len(values) // 2]
    least, most = median / _REPLICATE_FACTOR, _REPLICATE_FACTOR * median
    far = [said for said, value in zip(each, values, strict=True) if not least <= value <= most]
    if far:
        of, off = (", ", f"off the replicates' median, {median:.3g}")
        if len(values) == 2:  # neither of which is the middle
            far, of, off = each, " and ", "apart"
        yield (
            f"{found.material}: {name} is {of.join(far)}, more than {_REPLICATE_FACTOR:g} times "
            f"{off}; check the specimens' sizes, units and materials"
        )
