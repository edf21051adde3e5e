"""Predicted against measured curves of the tests with the largest gap, side by side."""

import math
import textwrap
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.gap.diagnosis import Diagnosis, Traces
from planner.report.gap.colours import AFTER, BEFORE, MEASURED, QUIET
from planner.report.gap.trace_errors import error_of_tests, rows_of_test
from planner.report.svg import Chart, disc, frame, line, picture, segment, text, upright

__all__ = ["curves_figure"]

_MOST, _ACROSS = 6, 3
_WIDTH, _HEIGHT = 220.0, 150.0
_CELL_WIDTH, _CELL_HEIGHT, _LEFT, _TOP = 292.0, 256.0, 62.0, 84.0
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
    shown = order[:_MOST]
    if not shown:
        return None
    title = "The tests with the largest gap" if len(order) > len(shown) else "Every test"
    parts = [text(20.0, 28.0, f"{title}: predicted and measured", size=15.0), *_key(traces)]
    for number, test in enumerate(shown):
        row, column = divmod(number, _ACROSS)
        parts += _panel(traces, test, _LEFT + column * _CELL_WIDTH, _TOP + row * _CELL_HEIGHT)
    rows, columns = math.ceil(len(shown) / _ACROSS), min(len(shown), _ACROSS)
    width = max(columns * _CELL_WIDTH + 20.0, 470.0)
    return picture(width, _TOP + rows * _CELL_HEIGHT + 4.0, parts, title=title)


def _panel(traces: Traces, test: int, left: float, top: float) -> Iterator[str]:
    measured = traces.measured_N[list(rows_of_test(traces, test))]
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
        _WIDTH,
        _HEIGHT,
        (0.0, span),
        (low - room if low < 0.0 else 0.0, high + room),
    )
    for number, words in enumerate(textwrap.wrap(traces.label[test], _LABEL, max_lines=2)):
        yield text(left, top + 8.0 + 14.0 * number, words, size=11.5)
    yield from frame(chart, x_label="time, s" if held else "travel, mm", y_label="", most_ticks=5)
    yield upright(left - 38.0, chart.top + 0.5 * _HEIGHT, "force, N", colour=QUIET, size=11.0)
    for curve in measured:
        for i in _places(x, curve):
            yield disc(chart.x(x[i]), chart.y(curve[i]), colour=MEASURED, radius=1.7)
    for curve, colour, dash in (
        (traces.before_N[test], BEFORE, "6,4"),
        (traces.after_N[test], AFTER, ""),
    ):
        for run in _runs(np.isfinite(x) & np.isfinite(curve)):
            yield line(chart, x[run], curve[run], colour=colour, width=1.8, dash=dash)


def _key(traces: Traces) -> Iterator[str]:
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
