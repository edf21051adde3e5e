"""The linear part of a loading curve, and the toe before it.

The rule, in the order it is applied:

1. Slopes of short windows along the curve up to its peak; a window is just long enough that
   noise leaves the steepest slope uncertain by at most 2 % (standard error).
2. The tangent sought is the steepest one of the first rise: the largest slope before the slopes
   first fall below 80 % of it. The final upturn of a rubber is thereby out of the question.
3. From there the linear part grows both ways while the windows' slopes stay within 5 % of the
   least-squares slope of what it holds already (plus three standard errors), until it no longer
   changes. Its least-squares slope is Young's modulus.
4. A toe is there if the record begins before the linear part, above its line, and the line meets
   zero stress at a positive strain by more than three standard errors. Strains then count from
   that point (ASTM D638, annex A1: the tangent at the maximum slope, extrapolated to zero stress).

A curve that steepens all the way to its break, as a rubber's may, has no such tangent: its
modulus is the slope at the origin, and nothing is shifted.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.materials.curve import Curve
from planner.materials.rupture import noise_sd

__all__ = ["LinearPart", "linear_part"]

SLOPE_ERROR = 0.02
FIRST_FALL = 0.8
LINEARITY = 0.05
TOE_STRESS_SHARE = 0.3
"""Above this share of the peak stress, a steepening is an upturn and no toe."""

_MINIMUM_WINDOW = 5


@dataclass(frozen=True, slots=True)
class LinearPart:
    """Where a curve is straight, and how steep.

    Attributes
    ----------
    start, stop
        Points of the linear part, as a slice.
    modulus_MPa, modulus_se_MPa
        Least-squares slope, and its standard error from the scatter about the line.
    toe_strain
        The strain from which strains count; 0 where there is no toe.
    kind
        "line" (a linear part was found) or "origin" (the curve steepens throughout; the slope
        at its beginning).
    zero_strain
        Where the line meets zero stress, shifted or not.
    """

    start: int
    stop: int
    modulus_MPa: float
    modulus_se_MPa: float
    toe_strain: float
    kind: Literal["line", "origin"]
    zero_strain: float


class _Lines:
    """Least-squares lines through runs of points, each in constant time by running sums."""

    def __init__(self, x: FloatArray, y: FloatArray) -> None:
        self._centre = float(x.mean()), float(y.mean())
        u, v = x - self._centre[0], y - self._centre[1]
        self._sums = [
            np.concatenate([[0.0], np.cumsum(values)]) for values in (u, v, u * u, u * v, v * v)
        ]

    def _moments(self, start: FloatArray, stop: FloatArray) -> tuple[FloatArray, ...]:
        i, j = np.asarray(start, dtype=np.int64), np.asarray(stop, dtype=np.int64)
        n = (j - i).astype(np.float64)
        u, v, uu, uv, vv = (s[j] - s[i] for s in self._sums)
        return n, u / n, v / n, uu - u * u / n, uv - u * v / n, vv - v * v / n

    def slopes(self, width: int) -> tuple[FloatArray, FloatArray]:
        """Slopes of all windows of `width` points, and the spread of x within each (Sxx)."""
        last = len(self._sums[0]) - 1
        start = np.arange(last - width + 1, dtype=np.float64)
        _, _, _, sxx, sxy, _ = self._moments(start, start + width)
        sxx = np.where(sxx > 0.0, sxx, np.inf)
        return sxy / sxx, sxx

    def line(self, start: int, stop: int) -> tuple[float, float, float, float]:
        """Slope, its standard error, where the line meets zero, and that strain's error."""
        n, u, v, sxx, sxy, syy = (
            float(m) for m in self._moments(np.float64(start), np.float64(stop))
        )
        if not sxx > 0.0:
            return 0.0, np.inf, 0.0, np.inf
        slope = sxy / sxx
        variance = max(syy - slope * sxy, 0.0) / max(n - 2.0, 1.0)
        error = np.sqrt(variance / sxx)
        if slope <= 0.0:
            return slope, float(error), 0.0, np.inf
        x_mean, y_mean = u + self._centre[0], v + self._centre[1]
        zero = x_mean - y_mean / slope
        zero_error = np.sqrt(variance * (1.0 / n + (x_mean - zero) ** 2 / sxx)) / slope
        return slope, float(error), zero, float(zero_error)


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
    width, slopes, errors = _windows(lines, noise, peak)
    steepest, fell = _steepest_of_first_rise(slopes, errors)
    start, stop = _grow(lines, slopes, errors, steepest, width)
    kind: Literal["line", "origin"] = "line"
    height = float(y[-1])
    long_enough = y[stop - 1] - y[start] >= 0.2 * height
    # A mean over a few points, so that noise on one of them decides nothing.
    low_enough = float(np.median(y[start : start + 3])) <= TOE_STRESS_SHARE * height
    if not low_enough or not (fell or long_enough):
        kind = "origin"
        start, stop = _grow(lines, slopes, errors, 0, width)
    modulus, error, zero, zero_error = lines.line(start, stop)
    if modulus <= 0.0:
        raise FileError(
            f"specimen {curve.specimen}: the stress does not rise with strain at strain "
            f"{x[start]:.4g}; check the columns, or cut the record before the loading"
        )
    toe = 0.0
    if kind == "line" and start >= 2 and zero > x[0]:
        # The error of the line alone is blind to the spacing of points.
        spacing = float(np.median(np.diff(x[:stop])))
        above = float(np.mean(y[:start] - modulus * (x[:start] - zero))) > 0.0
        if above and zero > max(3.0 * zero_error, 0.0) and zero - x[0] > 0.5 * spacing:
            toe = zero
    return LinearPart(start, stop, modulus, error, toe, kind, zero)


def _windows(lines: _Lines, noise: float, count: int) -> tuple[int, FloatArray, FloatArray]:
    """Width, slopes and standard errors of the shortest windows that are certain enough."""
    width = min(_MINIMUM_WINDOW, max(3, count // 4))
    while True:
        slopes, spread = lines.slopes(width)
        errors = noise / np.sqrt(spread)
        at = int(np.argmax(slopes - 2.0 * errors))
        if errors[at] <= SLOPE_ERROR * slopes[at] or width * 1.5 > count / 4:
            return width, slopes, errors
        width = int(width * 1.5)


def _steepest_of_first_rise(slopes: FloatArray, errors: FloatArray) -> tuple[int, bool]:
    """Index of the steepest window of the first rise, and whether a fall ended that rise."""
    highest = np.maximum.accumulate(slopes - errors)
    fallen = np.flatnonzero((slopes + 2.0 * errors < FIRST_FALL * highest) & (highest > 0.0))
    end = int(fallen[0]) if len(fallen) else len(slopes)
    return int(np.argmax(slopes[: max(end, 1)])), bool(len(fallen))


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
