"""The errors to draw along one axis: points a specimen, or a line a test."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.gap.diagnosis import Traces
from planner.report.gap.trace_errors import error_along, test_of_rows

__all__ = ["Points", "points_along", "specimen_errors"]

_LEVELS = 12
_LOG_FROM = 20.0
_CURVE_STEPS = 40
_BRANCHES = ("loading", "unloading", "reloading", "hold")


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Errors along an axis, before and after.

    Attributes
    ----------
    x, before, after : (n,)
        Places on the axis, and errors there; NaN where unknown.
    names
        Of the places 0, 1, 2, ..., where the axis has no numbers.
    log
        Whether `x` is a decimal logarithm.
    joined
        Whether to join the means of the axis' levels.
    of_curve : (n,)
        For errors along curves: which curve each point belongs to; None for points a specimen.
    """

    x: FloatArray
    before: FloatArray
    after: FloatArray
    names: tuple[str, ...] = ()
    log: bool = False
    joined: bool = False
    of_curve: FloatArray | None = None


def points_along(traces: Traces, axis: str) -> Points | None:
    """Return the points of an axis; None where the traces do not hold it."""
    if axis in ("strain", "time"):
        return _along_curves(traces, axis)
    if axis == "branch":
        return _of_branches(traces)
    column = traces.columns.get(axis)
    if column is None:
        return None
    before, after = specimen_errors(traces)
    if len(before) != len(column):
        return None
    numbers = [v for v in column if isinstance(v, (int, float))]
    if numbers and all(v is None or isinstance(v, (int, float)) for v in column):
        x = np.array([np.nan if v is None else float(v) for v in column])
        log = min(numbers) > 0.0 and max(numbers) >= _LOG_FROM * min(numbers)
        x = np.log10(x) if log else x
        few = len(np.unique(np.round(x[np.isfinite(x)], 9))) <= _LEVELS
        return Points(x, before, after, log=log, joined=few)
    names = sorted({str(v) for v in column if v is not None})
    if axis in ("specimen", "material"):
        names = list(dict.fromkeys(str(v) for v in column if v is not None))
    places = {name: float(i) for i, name in enumerate(names)}
    x = np.array([np.nan if v is None else places[str(v)] for v in column])
    return Points(x, before, after, names=tuple(names), joined=axis != "specimen")


def specimen_errors(traces: Traces) -> tuple[FloatArray, FloatArray]:
    """Return each specimen's mean relative error before and after, (n,); (0,) if not known."""
    before, after = traces.residual_before, traces.residual_after
    return before, after if len(after) == len(before) else np.full(len(before), np.nan)


def _along_curves(traces: Traces, axis: str) -> Points | None:
    """Return the mean error of each test along its curve, at steps that lie apart."""
    x_of_tests = _strain(traces) if axis == "strain" else traces.time_s
    before, after = (error_along(traces, f) for f in (traces.before_N, traces.after_N))
    parts: list[FloatArray] = []
    for test, rows in _rows_of_tests(traces):
        x = x_of_tests[test]
        if axis == "strain":  # first loading alone: on the way back the same strains come again
            stop = int(np.nanargmax(x)) + 1 if np.isfinite(x).any() else 0
        else:
            stop = len(x)
        steps = np.linspace(0, max(stop - 1, 0), _CURVE_STEPS).round().astype(np.intp)
        for i in np.unique(steps).tolist():
            if np.isfinite(x[i]) and np.isfinite(before[rows, i]).any():
                errors = [_mean(e[rows, i]) for e in (before, after)]
                parts.append(np.array([x[i], *errors, float(test)]))
    if not parts:
        return None
    table = np.stack(parts)
    log = False
    if axis == "time":
        table = table[table[:, 0] > 0.0]
        if not len(table):
            return None
        log = bool(table[:, 0].max() >= _LOG_FROM * table[:, 0].min())
        table[:, 0] = np.log10(table[:, 0]) if log else table[:, 0]
    return Points(table[:, 0], table[:, 1], table[:, 2], log=log, of_curve=table[:, 3])


def _of_branches(traces: Traces) -> Points | None:
    """Return each specimen's mean error on each way of its path."""
    before, after = (error_along(traces, f) for f in (traces.before_N, traces.after_N))
    rows: list[tuple[float, float, float]] = []
    for row, test in test_of_rows(traces).items():
        branch = _branch_of_steps(traces.travel_mm[test])
        for place in range(len(_BRANCHES)):
            on = branch == place
            if on.any() and np.isfinite(before[row, on]).any():
                rows.append((float(place), _mean(before[row, on]), _mean(after[row, on])))
    if not rows:
        return None
    table = np.array(rows)
    there = sorted(set(table[:, 0].tolist()))
    x = np.searchsorted(there, table[:, 0]).astype(np.float64)
    names = tuple(_BRANCHES[int(place)] for place in there)
    return Points(x, table[:, 1], table[:, 2], names=names)


def _branch_of_steps(travel: FloatArray) -> FloatArray:
    """Return the place in `_BRANCHES` of each step; NaN where the travel is not known."""
    branch = np.full(len(travel), np.nan)
    known = np.flatnonzero(np.isfinite(travel))
    if len(known) < 2:
        return branch
    moves = np.diff(travel[known])
    still = np.abs(moves) <= 1e-6 * float(np.ptp(travel[known]))
    fallen = False
    for place, move, stands in zip(known[1:], moves, still, strict=True):
        if stands:
            branch[place] = 3.0
        elif move < 0.0:
            branch[place], fallen = 1.0, True
        else:
            branch[place] = 2.0 if fallen else 0.0
    return branch


def _strain(traces: Traces) -> FloatArray:
    """Return travel over gauge length, (P, T); NaN where the gauge length is not known."""
    gauges = traces.columns.get("gauge_mm", ())
    strain = np.full(traces.travel_mm.shape, np.nan)
    for test, rows in _rows_of_tests(traces):
        gauge = gauges[rows[0]] if rows[0] < len(gauges) else None
        if isinstance(gauge, (int, float)) and gauge > 0.0:
            strain[test] = traces.travel_mm[test] / gauge
    return strain


def _rows_of_tests(traces: Traces) -> Iterator[tuple[int, list[int]]]:
    rows: dict[int, list[int]] = {}
    for row, test in test_of_rows(traces).items():
        rows.setdefault(test, []).append(row)
    yield from sorted(rows.items())


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan
