"""The figure of a simulation: force against displacement, and strain along the bar."""

import itertools
from collections.abc import Iterator

import numpy as np

from planner.arrays import FloatArray
from planner.palette import Palette
from planner.report.svg import (
    GREY,
    INK,
    Chart,
    band,
    frame,
    line,
    marker,
    picture,
    rectangle,
    text,
)
from planner.simulation.result import Simulation

__all__ = ["simulation_figure"]

_WIDTH, _HEIGHT, _TOP = 460.0, 300.0, 78.0
_LEFT, _GAP = 64.0, 96.0
_BREAK = "#c0392b"
_CURVE, _BAND = "#1f5fa8", "#d3e1f1"
_SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)
_SHADES = ("#c3c3c3", "#9d9d9d", "#777777", "#4e4e4e", INK)
_HEADROOM = 1.06


def simulation_figure(simulation: Simulation) -> bytes:
    """Return the figure as SVG; a coupon, which strains evenly, has the left panel alone."""
    title = f"{simulation.name}: {simulation.protocol} to strain {simulation.to_strain:g}"
    parts = [text(20.0, 28.0, title, size=15.0), *_curve(simulation)]
    width = _LEFT + _WIDTH + 24.0
    if len(simulation.bar.x_mm) > 1:
        parts += _along(simulation, width + _GAP - 24.0)
        width += _GAP + _WIDTH + 24.0
    return picture(width, _TOP + _HEIGHT + 92.0, parts, title=title)


def _curve(simulation: Simulation) -> Iterator[str]:
    over_time = simulation.protocol == "relaxation"
    x = simulation.time_s if over_time else simulation.displacement_mm
    force, (low, high) = simulation.force_N, simulation.force_interval_N.T
    chart = Chart(
        _LEFT, _TOP, _WIDTH, _HEIGHT, (0.0, _span(float(x.max()))), (0.0, _span(float(high.max())))
    )
    yield band(chart, x, low, high, colour=_BAND)
    yield from frame(
        chart, x_label="time, s" if over_time else "displacement, mm", y_label="force, N"
    )
    beyond = simulation.beyond_break
    first = int(np.argmax(beyond)) if beyond.any() else len(x)
    held = slice(0, min(first + 1, len(x)))
    yield line(chart, x[held], force[held], colour=_CURVE)
    note = f"band: {100 * simulation.level:g} % of prints"
    if beyond.any():
        yield line(chart, x[first:], force[first:], colour=_CURVE, dash="3,4")
        yield marker(chart, float(x[first]), float(force[first]), colour=_BREAK)
        note += "; cross: break, dotted beyond it"
    yield text(_LEFT + _WIDTH, _TOP - 12.0, note, anchor="end", colour=GREY)


def _along(simulation: Simulation, left: float) -> Iterator[str]:
    bar = simulation.bar
    peak = int(np.argmax(simulation.displacement_mm))
    most = float(simulation.strain[peak].max())
    chart = Chart(
        left,
        _TOP,
        _WIDTH,
        _HEIGHT,
        (float(bar.edges_mm[0]), float(bar.edges_mm[-1])),
        (0.0, _span(most)),
    )
    yield from frame(chart, x_label="", y_label="strain along the bar")
    steps = sorted({round(share * peak) for share in _SHARES})
    for step, shade in zip(steps, _SHADES[-len(steps) :], strict=True):
        yield line(chart, bar.x_mm, simulation.strain[step], colour=shade, width=1.6)
    strains = ", ".join(f"{simulation.gauge_strain[step]:.3g}" for step in steps)
    yield text(
        left + _WIDTH, _TOP - 12.0, f"at strains of the bar of {strains}", anchor="end", colour=GREY
    )
    shown = np.where(simulation.break_strain <= chart.y_range[1], simulation.break_strain, np.nan)
    for start, stop in _runs_of_finite(shown):
        yield line(
            chart, bar.x_mm[start:stop], shown[start:stop], colour=_BREAK, width=1.4, dash="6,4"
        )
    if np.isfinite(shown).any():
        yield text(left + 6.0, _TOP + 12.0, "dashed: elongation at break", colour=_BREAK)
    yield from _materials(simulation, chart)
    middle = left + _WIDTH / 2.0
    yield text(middle, _TOP + _HEIGHT + 80.0, "place along the axis, mm", anchor="middle")


def _materials(simulation: Simulation, chart: Chart) -> Iterator[str]:
    """Draw a strip in the materials' colours, with the names of the grades that have room."""
    bar, palette = simulation.bar, simulation.palette
    top = chart.top + chart.height + 26.0
    colours = [_colour(palette, m) for m in bar.coordinate.tolist()]
    names = {m.coordinate: m.id for m in palette.materials}
    turns = [0, *(i for i in range(1, len(colours)) if colours[i] != colours[i - 1]), len(colours)]
    for start, stop in itertools.pairwise(turns):
        left, right = chart.x(float(bar.edges_mm[start])), chart.x(float(bar.edges_mm[stop]))
        # A little wider, so that no seam shows between neighbours.
        yield rectangle(left, top, right - left + (0.3 if stop < len(colours) else 0.0), 12.0,
                        colour=colours[start])  # fmt: skip
        name = names.get(float(bar.coordinate[start]), "")
        if name and 6.0 * len(name) <= right - left:
            yield text(0.5 * (left + right), top + 25.0, name, anchor="middle", size=10.0)


def _colour(palette: Palette, coordinate: float) -> str:
    """Return the colour of a mixture, between its neighbours' colours."""
    grades = [m.coordinate for m in palette.materials]
    channels = [
        np.interp(coordinate, grades, [int(m.colour[i : i + 2], 16) for m in palette.materials])
        for i in (1, 3, 5)
    ]
    return "#" + "".join(f"{round(float(channel)):02X}" for channel in channels)


def _span(most: float) -> float:
    return _HEADROOM * most if most > 0.0 else 1.0


def _runs_of_finite(values: FloatArray) -> list[tuple[int, int]]:
    turns = np.diff(np.concatenate([[0], np.isfinite(values).astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(turns == 1), np.flatnonzero(turns == -1)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))
