"""The linear part of a loading curve, and the toe before it.

The rule, in the order it is applied:

1. Slopes of short windows along the curve up to its peak; a window is just long enough that
   scatter leaves the steepest slope of the beginning uncertain by at most 2 % (standard error),
   and no longer than a sixth of the points.
2. The tangent sought is the steepest of the first rise: before the slopes first fall below 80 %
   of their largest so far, and within the first 0.2 of strain, by which grips have seated and
   slack is drawn out. The final upturn of a rubber is thereby out of the question.
3. From there the linear part grows both ways while the windows' slopes stay within 5 % of the
   least-squares slope of what it holds already (plus three standard errors), until it no longer
   changes. Its least-squares slope is Young's modulus.
4. A toe is there if the line meets zero stress behind the record's first point, by more than
   three standard errors and half a step, and the points before lie above it. Strains then count
   from that point (ASTM D638, annex A1: the tangent at the maximum slope, extrapolated to zero
   stress).

5. A part that begins with the record and yet bends is the arc of a rubber and no line: a parabola
   through it changes its slope by more than a tenth, and by five standard errors. Its modulus is
   the slope at the beginning of Mooney's form, c0 + (l - l^-2) (c1 + c2 / l), through it (up to a
   strain of 1), and nothing is shifted.

A curve that steepens on beyond that range, as a rubber's may, has no such tangent: its modulus
is the slope at the origin, and nothing is shifted.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.errors import FileError
from planner.materials.curve import Curve
from planner.materials.rupture import noise_sd

__all__ = ["LinearPart", "linear_part"]

SLOPE_ERROR = 0.02
FIRST_FALL = 0.8
LINEARITY = 0.05
TOE_RANGE = 0.2
"""Strain within which the linear part begins."""

LONG_SHARE = 0.2
"""A line over this share of the peak stress is one, though the slopes rise on behind it."""

ARC_CHANGE = 0.1
"""Relative change of slope over a part that is an arc."""

MOONEY_RANGE = 1.0
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
        self._sums = [
            np.concatenate([[0.0], np.cumsum(values)]) for values in (u, v, u * u, u * v, v * v)
        ]

    def _moments(self, i: IntArray, j: IntArray) -> tuple[FloatArray, ...]:
        n = (j - i).astype(np.float64)
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
        n, u, v, sxx, sxy, syy = (
            float(m[0]) for m in self._moments(np.array([start]), np.array([stop]))
        )
        if not sxx > 0.0:
            return 0.0, 0.0, np.inf
        slope = sxy / sxx
        if slope <= 0.0:
            return slope, 0.0, np.inf
        variance = max(syy - slope * sxy, 0.0) / max(n - 2.0, 1.0)
        x_mean, y_mean = u + self._centre[0], v + self._centre[1]
        zero = x_mean - y_mean / slope
        zero_error = np.sqrt(variance * (1.0 / n + (x_mean - zero) ** 2 / sxx)) / slope
        return slope, zero, float(zero_error)


def linear_part(curve: Curve) -> LinearPart:
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
            f"least {_MINIMUM_WINDOW} points of loading: sample faster"
        )
    lines = _Lines(x, y)
    noise = noise_sd(y)
    begins = x - x[0] <= TOE_RANGE
    slopes, errors, width = _windows(lines, begins, noise)
    seed, still_rising = _steepest(slopes, errors, begins[: len(slopes)])
    start, stop = _grow(lines, slopes, errors, seed, width)
    kind: Literal["line", "arc", "origin"] = "line"
    if still_rising and y[stop - 1] - y[start] < LONG_SHARE * y[-1]:
        kind = "origin"
        start, stop = _grow(lines, slopes, errors, 0, width)
    modulus, zero, zero_error = lines.line(start, stop)
    arc = _arc(x[start:stop], y[start:stop]) if start == 0 else None
    if arc is not None:
        kind = "arc" if kind == "line" else kind
        modulus, zero = arc
    if modulus <= 0.0:
        raise FileError(
            f"specimen {curve.specimen}: the stress does not rise with strain at strain "
            f"{x[start]:.4g}; check the columns, or cut the record before the loading"
        )
    toe = 0.0
    if kind == "line":
        spacing = float(np.median(np.diff(x[:stop])))
        front = x < zero
        # On the line itself, they show a load that was not zeroed, and no toe.
        above = y[front] - modulus * (x[front] - zero)
        if zero - x[0] > max(3.0 * zero_error, 0.5 * spacing) and float(
            np.mean(above)
        ) > 3.0 * noise / np.sqrt(len(above)):
            toe = zero
    return LinearPart(start, stop, modulus, toe, kind, zero)


def _arc(x: FloatArray, y: FloatArray) -> tuple[float, float] | None:
    """Slope of an arc at its first point, and the zero of the tangent there.

    None where a parabola's bend is not significant, or the slope not positive.
    """
    if len(x) < _MINIMUM_WINDOW or x[-1] <= x[0]:
        return None
    scale = float(x[-1] - x[0])
    terms = np.vander((x - x[0]) / scale, 3, increasing=True)
    inverse = np.linalg.pinv(terms)
    coefficients = inverse @ y
    slope, bend = (float(c) for c in coefficients[1:])
    scatter = float(np.sum((y - terms @ coefficients) ** 2)) / (len(x) - 3)
    bend_error = np.sqrt(scatter * np.sum(inverse[2] ** 2))
    if slope <= 0.0 or abs(bend) <= max(5.0 * bend_error, 0.5 * ARC_CHANGE * slope):
        return None
    # Mooney's form instead of the parabola: as many coefficients, and the shape of rubber.
    near = x - x[0] <= max(MOONEY_RANGE, float(x[_MINIMUM_WINDOW - 1] - x[0]))
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
        if errors[at] <= SLOPE_ERROR * slopes[at] or width * 1.5 > count / 6:
            return slopes, errors, width
        width = int(width * 1.5)


def _steepest(slopes: FloatArray, errors: FloatArray, near: BoolArray) -> tuple[int, bool]:
    """Index of the steepest window of the first rise, and whether steeper ones follow it."""
    highest = np.maximum.accumulate(slopes - errors)
    fallen = np.flatnonzero((slopes + 2.0 * errors < FIRST_FALL * highest) & (highest > 0.0))
    end = max(int(fallen[0]), 1) if len(fallen) else len(slopes)
    rise = slopes[:end]
    seed = int(np.argmax(np.where(near[:end], rise, -np.inf)))
    limit = (1.0 + LINEARITY) * slopes[seed] + 3.0 * errors[seed]
    return seed, bool(np.any(rise[seed:] > limit))


def _grow(
    lines: _Lines, slopes: FloatArray, errors: FloatArray, seed: int, width: int
) -> tuple[int, int]:
    """Grow from a window both ways while slopes agree with the line; the points' slice."""
    modulus = float(slopes[seed])
    first = last = seed
    for _ in range(20):
        fits = np.abs(slopes - modulus) <= LINEARITY * abs(modulus) + 3.0 * errors
        fits[seed] = True
        misfits = np.flatnonzero(~fits)
        before, behind = misfits[misfits < seed], misfits[misfits > seed]
        grown = (
            int(before[-1]) + 1 if len(before) else 0,
            int(behind[0]) - 1 if len(behind) else len(slopes) - 1,
        )
        if grown == (first, last):
            break
        first, last = grown
        modulus = lines.line(first, last + width)[0]
    return first, last + width
