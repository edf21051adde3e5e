"""Figures of a diagnosis: where the gap lies, evidence, curves, closure."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.gap.diagnosis import Diagnosis, Gap, Hypothesis, Location, Traces
from planner.numerics import BoolArray, FloatArray
from planner.report.gap_text import axis_words, id_of, p_value, percent, probability, unit_of
from planner.report.svg import (
    AFTER,
    BASELINE,
    BEFORE,
    GREY,
    INK,
    MEASURED,
    PALE,
    QUIET,
    Chart,
    disc,
    frame,
    line,
    picture,
    rectangle,
    ring,
    segment,
    text,
    ticks,
    upright,
)

__all__ = [
    "closure_figure",
    "curves_figure",
    "error_along",
    "error_of_tests",
    "evidence_figure",
    "points_along",
    "residual_figure",
]


# ------------------------------------------------------------------------------------------------
# Errors of force along measured curves, relative to the largest force of each test.


def _rows_of_test(traces: Traces, test: int) -> Sequence[int]:
    """Return the rows of `measured_N` that belong to a test."""
    places = {id: row for row, id in enumerate(_ids(traces))}
    return [places[id] for id in traces.specimen_ids[test] if id in places]


def _test_of_rows(traces: Traces) -> dict[int, int]:
    """Return the test of each row of `measured_N`."""
    return {row: test for test in range(len(traces.label)) for row in _rows_of_test(traces, test)}


def error_along(traces: Traces, predicted_N: FloatArray) -> FloatArray:
    """Return measured less predicted over the test's largest force, (n, T); NaN where unknown.

    Parameters
    ----------
    predicted_N : (P, T)
        `before_N` or `after_N`.
    """
    errors = np.full(traces.measured_N.shape, np.nan)
    for row, test in _test_of_rows(traces).items():
        predicted, measured = predicted_N[test], traces.measured_N[row]
        largest = np.nanmax(np.abs(measured), initial=0.0)
        if largest > 0.0:
            errors[row] = (measured - predicted) / largest
    return errors


def error_of_tests(traces: Traces) -> FloatArray:
    """Return each test's root mean square error before, (P,); NaN where nothing was measured."""
    squares = error_along(traces, traces.before_N) ** 2
    found = np.full(len(traces.label), np.nan)
    for test in range(len(traces.label)):
        of_test = squares[list(_rows_of_test(traces, test))]
        if np.isfinite(of_test).any():
            found[test] = np.sqrt(np.nanmean(of_test))
    return found


def _ids(traces: Traces) -> Sequence[str]:
    """Return the specimens in the order of `measured_N`; that of the tests where none is given."""
    return traces.specimens or [id for ids in traces.specimen_ids for id in ids]


# ------------------------------------------------------------------------------------------------
# The errors to draw along one axis: points a specimen, or a line a test.


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
    before, after = _specimen_errors(traces)
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


def _specimen_errors(traces: Traces) -> tuple[FloatArray, FloatArray]:
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
    for row, test in _test_of_rows(traces).items():
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
    for row, test in _test_of_rows(traces).items():
        rows.setdefault(test, []).append(row)
    yield from sorted(rows.items())


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan


# ------------------------------------------------------------------------------------------------
# Where the gap lies: errors of force along the leading axes, before and after.


_RESIDUAL_MOST, _RESIDUAL_ACROSS = 4, 2
_RESIDUAL_WIDTH, _RESIDUAL_HEIGHT = 350.0, 190.0
_RESIDUAL_CELL_WIDTH, _RESIDUAL_CELL_HEIGHT, _RESIDUAL_LEFT, _RESIDUAL_TOP = (
    440.0,
    280.0,
    66.0,
    84.0,
)
_SHIFT = 5.0
_CHARACTER = 7.0
_NAMES = 14
_SIGNIFICANT = 0.05
_OVERALL = Location("material", 0.0, (0.0, 0.0), 1.0, "")
"""Shows every specimen where there is room, whether or not the gap varies along it."""


def residual_figure(diagnosis: Diagnosis) -> bytes | None:
    """Return the figure as SVG; None where there are no traces along any axis found."""
    traces = diagnosis.traces
    if traces is None:
        return None
    places = [p for p in diagnosis.where if p.p < _SIGNIFICANT] or list(diagnosis.where[:1])
    if len(places) < _RESIDUAL_ACROSS and all(p.axis != "material" for p in places):
        places.append(_OVERALL)
    found = [(place, points_along(traces, place.axis)) for place in places]
    panels = [(place, points) for place, points in found if points is not None][:_RESIDUAL_MOST]
    panels = [(place, points) for place, points in panels if np.isfinite(points.before).any()]
    if not panels:
        return None
    title = "Measured force above (+) or below (-) prediction"
    has_after = diagnosis.verdict not in ("none", "unknown") and any(
        np.isfinite(points.after).any() for _, points in panels
    )
    parts = [text(20.0, 28.0, title, size=15.0), *_residual_key(has_after)]
    if not has_after:
        panels = [(p, replace(q, after=np.full_like(q.before, np.nan))) for p, q in panels]
    y_range = _y_range([points for _, points in panels])
    for number, (place, points) in enumerate(panels):
        row, column = divmod(number, _RESIDUAL_ACROSS)
        left, top = (
            _RESIDUAL_LEFT + column * _RESIDUAL_CELL_WIDTH,
            _RESIDUAL_TOP + row * _RESIDUAL_CELL_HEIGHT,
        )
        parts += _residual_panel(
            place,
            points,
            Chart(left, top + 20.0, _RESIDUAL_WIDTH, _RESIDUAL_HEIGHT, _x_range(points), y_range),
        )
    rows, columns = math.ceil(len(panels) / _RESIDUAL_ACROSS), min(len(panels), _RESIDUAL_ACROSS)
    return picture(
        columns * _RESIDUAL_CELL_WIDTH + 16.0,
        _RESIDUAL_TOP + rows * _RESIDUAL_CELL_HEIGHT - 16.0,
        parts,
        title=title,
    )


def _residual_panel(place: Location, points: Points, chart: Chart) -> Iterator[str]:
    yield text(chart.left, chart.top - 10.0, _heading(place), size=12.5)
    unit = "s" if place.axis == "time" else unit_of(place.axis)
    label = f"{axis_words(place.axis)}, {unit}" if unit else axis_words(place.axis)
    ends = chart.y_range
    marks = _x_ticks(points, chart)
    blank = [(value, "") for value, _ in marks]
    yield from frame(chart, x_label="", y_label="", x_ticks=blank, most_ticks=7)
    yield from _x_words(chart, marks, label)
    zero = chart.y(0.0)
    yield segment((chart.left, zero), (chart.left + chart.width, zero), colour=GREY, width=1.2)
    yield upright(
        chart.left - 46.0,
        chart.top + 0.5 * chart.height,
        "error of force, %",
        colour=QUIET,
        size=11.0,
    )
    for errors, colour, shift, hollow in (
        (points.before, BEFORE, -_SHIFT, True),
        (points.after, AFTER, _SHIFT, False),
    ):
        y = np.clip(100.0 * errors, *ends)
        if points.of_curve is not None:
            yield from _lines(points, y, chart, colour=colour, dash="6,4" if hollow else "")
            continue
        across = (chart.x_range[1] - chart.x_range[0]) / chart.width
        x = points.x + shift * across
        if points.joined:
            yield from _means(points, x, y, chart, colour=colour, dash="6,4" if hollow else "")
        for a, b in zip(x.tolist(), y.tolist(), strict=True):
            if math.isfinite(a) and math.isfinite(b):
                mark = ring if hollow else disc
                yield mark(chart.x(a), chart.y(b), colour=colour, radius=3.2)


def _heading(place: Location) -> str:
    words = axis_words(place.axis)
    heading = words[:1].upper() + words[1:]
    if place is _OVERALL:
        return heading
    return f"{heading}: {percent(place.share)} of the gap, {p_value(place.p)}"


def _lines(points: Points, y: FloatArray, chart: Chart, *, colour: str, dash: str) -> Iterator[str]:
    assert points.of_curve is not None
    for curve in np.unique(points.of_curve):
        on = (points.of_curve == curve) & np.isfinite(y)
        if on.sum() > 1:
            yield line(chart, points.x[on], y[on], colour=colour, width=1.3, dash=dash)


def _means(
    points: Points, x: FloatArray, y: FloatArray, chart: Chart, *, colour: str, dash: str
) -> Iterator[str]:
    """Join the means of the axis' levels."""
    level = np.round(points.x, 9)
    known = np.isfinite(level) & np.isfinite(y)
    levels = np.unique(level[known])
    if len(levels) < 2:
        return
    at = [known & (level == one) for one in levels]
    across = np.array([x[on].mean() for on in at])
    up = np.array([y[on].mean() for on in at])
    yield line(chart, across, up, colour=colour, width=1.3, dash=dash)


def _x_range(points: Points) -> tuple[float, float]:
    if points.names:
        return -0.6, len(points.names) - 0.4
    x = points.x[np.isfinite(points.x)]
    low, high = (float(x.min()), float(x.max())) if len(x) else (0.0, 1.0)
    room = 0.08 * (high - low) or max(0.1 * abs(low), 0.1)
    if points.of_curve is not None and low >= 0.0 and not points.log:
        return 0.0, high + 0.25 * room
    return low - room, high + room


def _x_words(chart: Chart, marks: Sequence[tuple[float, str]], label: str) -> Iterator[str]:
    """Name the axis and its ticks, on two lines in turn where they have no room on one."""
    bottom = chart.top + chart.height
    room = chart.width / max(len(marks), 1)
    lines = 2 if max((len(words) for _, words in marks), default=0) * _CHARACTER > room else 1
    most = max(3, int(lines * room / _CHARACTER) - 1)
    for number, (value, words) in enumerate(marks):
        cut = words if len(words) <= most else words[: most - 1] + "…"
        yield text(chart.x(value), bottom + 16.0 + 14.0 * (number % lines), cut, anchor="middle")
    y = bottom + 22.0 + 14.0 * lines
    yield text(chart.left + 0.5 * chart.width, y, label, anchor="middle")


def _x_ticks(points: Points, chart: Chart) -> Sequence[tuple[float, str]]:
    if points.names:
        every = math.ceil(len(points.names) / _NAMES)
        return [(float(i), n) for i, n in enumerate(points.names) if i % every == 0]
    if not points.log:
        return [(value, f"{value:g}") for value in ticks(*chart.x_range, 6)]
    low, high = chart.x_range
    steps = (1.0, 2.0, 5.0) if high - low < 2.5 else (1.0,)
    return [
        (math.log10(step) + power, f"{step * 10.0**power:g}")
        for power in range(math.floor(low), math.ceil(high) + 1)
        for step in steps
        if low <= math.log10(step) + power <= high
    ]


def _y_range(panels: Sequence[Points]) -> tuple[float, float]:
    """Return a range in per cent that holds zero and every error."""
    values = np.concatenate([np.concatenate([p.before, p.after]) for p in panels])
    values = 100.0 * values[np.isfinite(values)]
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    room = 0.08 * (high - low) or 1.0
    return min(low - room, -1.0), max(high + room, 1.0)


def _residual_key(has_after: bool) -> Iterator[str]:
    y = 48.0
    yield ring(26.0, y, colour=BEFORE, radius=3.2)
    yield segment((34.0, y), (56.0, y), colour=BEFORE, width=1.5, dash="6,4")
    yield text(62.0, y + 4.0, "palette alone", colour=QUIET)
    if has_after:
        yield disc(166.0, y, colour=AFTER, radius=3.2)
        yield segment((174.0, y), (196.0, y), colour=AFTER, width=1.5)
        yield text(202.0, y + 4.0, "with the verdict's effects", colour=QUIET)


# ------------------------------------------------------------------------------------------------
# Predicted against measured curves of the tests with the largest gap, side by side.


_CURVES_MOST, _CURVES_ACROSS = 6, 3
_CURVES_WIDTH, _CURVES_HEIGHT = 220.0, 150.0
_CURVES_CELL_WIDTH, _CURVES_CELL_HEIGHT, _CURVES_LEFT, _CURVES_TOP = 292.0, 256.0, 62.0, 84.0
_LABEL, _DOTS = 36, 22
_HELD = 0.5


def curves_figure(diagnosis: Diagnosis) -> bytes | None:
    """Return the figure as SVG; None where there is nothing to draw."""
    traces = diagnosis.traces
    if traces is None:
        return None
    if diagnosis.verdict in ("none", "unknown"):  # no effects to draw
        traces = replace(traces, after_N=np.full_like(traces.before_N, np.nan))
    errors = error_of_tests(traces)
    order = [p for p in np.argsort(-errors, kind="stable").tolist() if np.isfinite(errors[p])]
    shown = order[:_CURVES_MOST]
    if not shown:
        return None
    title = "The tests with the largest gap" if len(order) > len(shown) else "Every test"
    parts = [text(20.0, 28.0, f"{title}: predicted and measured", size=15.0), *_curves_key(traces)]
    for number, test in enumerate(shown):
        row, column = divmod(number, _CURVES_ACROSS)
        parts += _curves_panel(
            traces,
            test,
            _CURVES_LEFT + column * _CURVES_CELL_WIDTH,
            _CURVES_TOP + row * _CURVES_CELL_HEIGHT,
        )
    rows, columns = math.ceil(len(shown) / _CURVES_ACROSS), min(len(shown), _CURVES_ACROSS)
    width = max(columns * _CURVES_CELL_WIDTH + 20.0, 470.0)
    return picture(width, _CURVES_TOP + rows * _CURVES_CELL_HEIGHT + 4.0, parts, title=title)


def _curves_panel(traces: Traces, test: int, left: float, top: float) -> Iterator[str]:
    measured = traces.measured_N[list(_rows_of_test(traces, test))]
    travel, time = traces.travel_mm[test], traces.time_s[test]
    held = _is_held(travel, time)
    x = time if held else travel
    known = [c[np.isfinite(c)] for c in (traces.before_N[test], traces.after_N[test], measured)]
    force = np.concatenate([c.ravel() for c in known])
    if not len(force) or not np.isfinite(x).any():
        return
    low, high = min(0.0, float(force.min())), max(float(force.max()), 0.0)
    room = 0.06 * (high - low) or 1.0
    span = float(np.nanmax(x)) or 1.0
    chart = Chart(
        left,
        top + 34.0,
        _CURVES_WIDTH,
        _CURVES_HEIGHT,
        (0.0, span),
        (low - room if low < 0.0 else 0.0, high + room),
    )
    for number, words in enumerate(textwrap.wrap(traces.label[test], _LABEL, max_lines=2)):
        yield text(left, top + 8.0 + 14.0 * number, words, size=11.5)
    yield from frame(chart, x_label="time, s" if held else "travel, mm", y_label="", most_ticks=5)
    yield upright(
        left - 38.0, chart.top + 0.5 * _CURVES_HEIGHT, "force, N", colour=QUIET, size=11.0
    )
    for curve in measured:
        for i in _places(x, curve):
            yield disc(chart.x(x[i]), chart.y(curve[i]), colour=MEASURED, radius=1.7)
    for curve, colour, dash in (
        (traces.before_N[test], BEFORE, "6,4"),
        (traces.after_N[test], AFTER, ""),
    ):
        for run in _runs(np.isfinite(x) & np.isfinite(curve)):
            yield line(chart, x[run], curve[run], colour=colour, width=1.8, dash=dash)


def _curves_key(traces: Traces) -> Iterator[str]:
    y = 48.0
    yield segment((112.0, y), (140.0, y), colour=BEFORE, width=2.0, dash="6,4")
    yield text(146.0, y + 4.0, "palette alone", colour=QUIET)
    yield disc(26.0, y, colour=MEASURED, radius=2.5)
    yield text(36.0, y + 4.0, "measured", colour=QUIET)
    if np.isfinite(traces.after_N).any():
        yield segment((244.0, y), (272.0, y), colour=AFTER, width=2.0)
        yield text(278.0, y + 4.0, "with the verdict's effects", colour=QUIET)


def _is_held(travel: FloatArray, time: FloatArray) -> bool:
    """Tell whether the crosshead stood still for most of the time."""
    known = np.isfinite(travel) & np.isfinite(time)
    if known.sum() < 2:
        return False
    moves, steps = np.abs(np.diff(travel[known])), np.diff(time[known])
    still = moves <= 1e-6 * float(np.ptp(travel[known]))
    return float(steps[still].sum()) > _HELD * float(steps.sum())


def _places(x: FloatArray, y: FloatArray) -> list[int]:
    """Return some steps that lie apart along the curve, its ends among them."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if len(known) <= _DOTS:
        return [int(i) for i in known]
    across = np.diff(x[known]) / (np.ptp(x[known]) or 1.0)
    up = np.diff(y[known]) / (np.ptp(y[known]) or 1.0)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(across, up))])
    wanted = np.linspace(0.0, along[-1], _DOTS)
    return sorted({int(known[i]) for i in np.searchsorted(along, wanted).clip(max=len(known) - 1)})


def _runs(known: BoolArray) -> Iterator[slice]:
    """Yield stretches of at least two known steps."""
    turns = np.diff(np.concatenate([[0], known.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(turns == 1), np.flatnonzero(turns == -1)
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        if stop - start > 1:
            yield slice(start, stop)


# ------------------------------------------------------------------------------------------------
# The probability of each hypothesis as bars.


_EVIDENCE_MOST, _LEAST = 8, 0.005
_EVIDENCE_LEFT, _EVIDENCE_WIDTH, _EVIDENCE_RIGHT, _EVIDENCE_TOP, _EVIDENCE_STEP, _EVIDENCE_BAR = (
    290.0,
    380.0,
    90.0,
    82.0,
    28.0,
    17.0,
)


def evidence_figure(diagnosis: Diagnosis) -> bytes:
    """Return the figure as SVG: most probable first, the part that needs an unknown pale."""
    shown = [
        h
        for h in diagnosis.ranking[:_EVIDENCE_MOST]
        if h.probability >= _LEAST or id_of(h.effects) in ("none", diagnosis.verdict)
    ]
    title = "How probable each explanation is"
    bottom = _EVIDENCE_TOP + _EVIDENCE_STEP * max(len(shown), 1)
    parts = [text(20.0, 28.0, title, size=15.0), *_evidence_key()]
    for tick in (0.0, 0.25, 0.5, 0.75, 1.0):
        x = _EVIDENCE_LEFT + _EVIDENCE_WIDTH * tick
        parts.append(segment((x, _EVIDENCE_TOP - 4.0), (x, bottom), colour="#e4e4e4"))
        parts.append(text(x, bottom + 16.0, f"{tick:g}", anchor="middle", colour=QUIET))
    for number, hypothesis in enumerate(shown):
        parts += _evidence_bar(diagnosis, hypothesis, _EVIDENCE_TOP + _EVIDENCE_STEP * number)
    parts.append(
        segment((_EVIDENCE_LEFT, _EVIDENCE_TOP - 4.0), (_EVIDENCE_LEFT, bottom), colour=GREY)
    )
    if len(diagnosis.same_class) > 1:
        parts.append(text(20.0, bottom + 36.0, "● not to be told apart here", colour=QUIET))
    rest = 1.0 - sum(h.probability for h in shown)
    if rest >= 5e-4:
        note = f"all others together: {probability(rest)}"
        parts.append(
            text(_EVIDENCE_LEFT + _EVIDENCE_WIDTH, bottom + 36.0, note, anchor="end", colour=QUIET)
        )
    return picture(
        _EVIDENCE_LEFT + _EVIDENCE_WIDTH + _EVIDENCE_RIGHT, bottom + 50.0, parts, title=title
    )


def _evidence_bar(diagnosis: Diagnosis, hypothesis: Hypothesis, top: float) -> Iterator[str]:
    name = id_of(hypothesis.effects)
    alike = len(diagnosis.same_class) > 1 and hypothesis.effects in diagnosis.same_class
    mark = "● " if alike else ""
    middle = top + 0.5 * _EVIDENCE_BAR + 4.0
    yield text(_EVIDENCE_LEFT - 10.0, middle, mark + name, anchor="end")
    width = _EVIDENCE_WIDTH * min(hypothesis.probability, 1.0)
    plain = width * (1.0 - min(max(hypothesis.with_unknown, 0.0), 1.0))
    if hypothesis.effects == ("unknown",):
        plain = 0.0
    yield rectangle(_EVIDENCE_LEFT, top, plain, _EVIDENCE_BAR, colour=AFTER)
    yield rectangle(_EVIDENCE_LEFT + plain, top, width - plain, _EVIDENCE_BAR, colour=PALE)
    yield text(_EVIDENCE_LEFT + width + 8.0, middle, probability(hypothesis.probability))


def _evidence_key() -> Iterator[str]:
    yield rectangle(_EVIDENCE_LEFT, 48.0, 12.0, 12.0, colour=AFTER)
    yield text(_EVIDENCE_LEFT + 18.0, 58.0, "by itself", colour=QUIET)
    yield rectangle(_EVIDENCE_LEFT + 92.0, 48.0, 12.0, 12.0, colour=PALE)
    yield text(_EVIDENCE_LEFT + 110.0, 58.0, "needs something unknown", colour=QUIET)


# ------------------------------------------------------------------------------------------------
# How far the gap closes: errors before and after, beside the floor and the baselines.


_CLOSURE_LEFT, _CLOSURE_WIDTH, _CLOSURE_RIGHT, _CLOSURE_TOP, _CLOSURE_STEP, _CLOSURE_BAR = (
    290.0,
    380.0,
    90.0,
    66.0,
    30.0,
    18.0,
)
_LINE, _LEADING = 104, 15.0


def closure_figure(diagnosis: Diagnosis) -> bytes:
    """Return the figure as SVG: a bar an error, the replicate floor as a dashed line."""
    gap = diagnosis.gap
    title = "Error of force, of each test's largest"
    rows = list(_rows(diagnosis))
    interval = _after_interval(gap)
    most = max([value for _, value, _ in rows] + [gap.floor or 0.0, *(interval or ())]) or 1.0
    scale = _CLOSURE_WIDTH / (1.12 * most)
    held_out = textwrap.wrap(f"held out: {gap.held_out}", _LINE) if gap.held_out else []
    first = _CLOSURE_TOP + _LEADING * max(len(held_out) - 1, 0)
    bottom = first + _CLOSURE_STEP * len(rows)
    parts = [text(20.0, 28.0, title, size=15.0)]
    for number, words in enumerate(held_out):
        parts.append(text(20.0, 46.0 + _LEADING * number, words, colour=QUIET))
    for tick in ticks(0.0, 112.0 * most, 6):
        x = _CLOSURE_LEFT + scale * tick / 100.0
        parts.append(segment((x, first - 6.0), (x, bottom), colour="#e4e4e4"))
        parts.append(text(x, bottom + 16.0, f"{tick:g} %", anchor="middle", colour=QUIET))
    for number, (words, value, colour) in enumerate(rows):
        top = first + _CLOSURE_STEP * number
        whisker = interval if colour == AFTER else None
        parts += _closure_bar(words, value, colour, top, scale, whisker)
    parts.append(segment((_CLOSURE_LEFT, first - 6.0), (_CLOSURE_LEFT, bottom), colour=GREY))
    if gap.floor is not None:
        x = _CLOSURE_LEFT + scale * gap.floor
        parts.append(segment((x, first - 6.0), (x, bottom), colour=INK, width=1.5, dash="5,4"))
        note = f"dashed: replicates differ by {percent(gap.floor)}, no model does better"
        parts.append(text(_CLOSURE_LEFT, bottom + 38.0, note, colour=QUIET))
    return picture(
        _CLOSURE_LEFT + _CLOSURE_WIDTH + _CLOSURE_RIGHT, bottom + 52.0, parts, title=title
    )


def _rows(diagnosis: Diagnosis) -> Iterator[tuple[str, float, str]]:
    gap = diagnosis.gap
    named = diagnosis.verdict not in ("none", "unknown")
    yield "palette alone", gap.before, BEFORE
    if gap.recalibration_only is not None:
        yield "laws refitted, no effect", gap.recalibration_only, BASELINE
    if gap.generic is not None:
        yield "flexible regression", gap.generic, BASELINE
    if gap.after is not None:
        yield (
            "with the verdict's effects" if named else "with the best of each fold",
            gap.after,
            AFTER,
        )


def _closure_bar(
    words: str,
    value: float,
    colour: str,
    top: float,
    scale: float,
    interval: tuple[float, float] | None,
) -> Iterator[str]:
    middle = top + 0.5 * _CLOSURE_BAR
    yield text(_CLOSURE_LEFT - 10.0, middle + 4.0, words, anchor="end")
    yield rectangle(_CLOSURE_LEFT, top, scale * value, _CLOSURE_BAR, colour=colour)
    end = value
    if interval is not None:
        low, high = (_CLOSURE_LEFT + scale * x for x in interval)
        yield segment((low, middle), (high, middle), colour=INK, width=1.5)
        for x in (low, high):
            yield segment((x, middle - 4.0), (x, middle + 4.0), colour=INK, width=1.5)
        end = max(value, interval[1])
    yield text(_CLOSURE_LEFT + scale * end + 8.0, middle + 4.0, percent(value))


def _after_interval(gap: Gap) -> tuple[float, float] | None:
    """Return the error after that the ends of the closure's interval stand for."""
    if gap.after is None or gap.floor is None or gap.closed_interval is None:
        return None
    low, high = gap.closed_interval
    if not (math.isfinite(low) and math.isfinite(high)):
        return None
    reach = gap.before - gap.floor
    ends = sorted(max(0.0, gap.floor + (1.0 - closed) * reach) for closed in (low, high))
    return ends[0], ends[1]
