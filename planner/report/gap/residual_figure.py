"""Where the gap lies: errors of force along the leading axes, before and after."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from planner.arrays import FloatArray
from planner.gap.diagnosis import Diagnosis, Place
from planner.report.gap.colours import AFTER, BEFORE, QUIET
from planner.report.gap.residual_points import Points, points_along
from planner.report.gap.wording import axis_words, p_value, percent, unit_of
from planner.report.svg import (
    GREY,
    Chart,
    disc,
    frame,
    line,
    picture,
    ring,
    segment,
    text,
    ticks,
    upright,
)

__all__ = ["residual_figure"]

_MOST, _ACROSS = 4, 2
_WIDTH, _HEIGHT = 350.0, 190.0
_CELL_WIDTH, _CELL_HEIGHT, _LEFT, _TOP = 440.0, 280.0, 66.0, 84.0
_SHIFT = 5.0
_CHARACTER = 7.0
_NAMES = 14
_SIGNIFICANT = 0.05
_OVERALL = Place("material", 0.0, (0.0, 0.0), 1.0, "")
"""Shows every specimen where there is room, whether or not the gap varies along it."""


def residual_figure(diagnosis: Diagnosis) -> bytes | None:
    """Return the figure as SVG; None where there are no traces along any axis found."""
    traces = diagnosis.traces
    if traces is None:
        return None
    places = [p for p in diagnosis.where if p.p < _SIGNIFICANT] or list(diagnosis.where[:1])
    if len(places) < _ACROSS and all(p.axis != "material" for p in places):
        places.append(_OVERALL)
    found = [(place, points_along(traces, place.axis)) for place in places]
    panels = [(place, points) for place, points in found if points is not None][:_MOST]
    panels = [(place, points) for place, points in panels if np.isfinite(points.before).any()]
    if not panels:
        return None
    title = "Measured force above (+) or below (-) prediction"
    has_after = diagnosis.verdict not in ("none", "unknown") and any(
        np.isfinite(points.after).any() for _, points in panels
    )
    parts = [text(20.0, 28.0, title, size=15.0), *_key(has_after)]
    if not has_after:
        panels = [(p, replace(q, after=np.full_like(q.before, np.nan))) for p, q in panels]
    y_range = _y_range([points for _, points in panels])
    for number, (place, points) in enumerate(panels):
        row, column = divmod(number, _ACROSS)
        left, top = _LEFT + column * _CELL_WIDTH, _TOP + row * _CELL_HEIGHT
        parts += _panel(
            place, points, Chart(left, top + 20.0, _WIDTH, _HEIGHT, _x_range(points), y_range)
        )
    rows, columns = math.ceil(len(panels) / _ACROSS), min(len(panels), _ACROSS)
    return picture(
        columns * _CELL_WIDTH + 16.0, _TOP + rows * _CELL_HEIGHT - 16.0, parts, title=title
    )


def _panel(place: Place, points: Points, chart: Chart) -> Iterator[str]:
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


def _heading(place: Place) -> str:
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


def _key(has_after: bool) -> Iterator[str]:
    y = 48.0
    yield ring(26.0, y, colour=BEFORE, radius=3.2)
    yield segment((34.0, y), (56.0, y), colour=BEFORE, width=1.5, dash="6,4")
    yield text(62.0, y + 4.0, "palette alone", colour=QUIET)
    if has_after:
        yield disc(166.0, y, colour=AFTER, radius=3.2)
        yield segment((174.0, y), (196.0, y), colour=AFTER, width=1.5)
        yield text(202.0, y + 4.0, "with the verdict's effects", colour=QUIET)
