"""Figures of a simulation: its load curve, and the strain along a bar."""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from planner.errors import check_kind
from planner.numerics import FloatArray
from planner.report import svg
from planner.report.svg import BLUE, GREY, INK, PALE_BLUE, RED, Chart
from planner.simulation.part import PartSimulation
from planner.simulation.simulate import Simulation

__all__ = ["course_of", "simulation_figure"]


# ------------------------------------------------------------------------------------------------
# Force against displacement, and strain along the bar.


_WIDTH, _HEIGHT, _TOP = 460.0, 300.0, 78.0
_LEFT, _GAP = 64.0, 96.0
_SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)
_SHADES = ("#c3c3c3", "#9d9d9d", "#777777", "#4e4e4e", INK)
_HEADROOM = 1.06
_ROW, _SPACE = 13.0, 3.0  # between rows of names; between a name and its line


def simulation_figure(simulation: Simulation | PartSimulation) -> bytes:
    """Draw force against displacement with its interval, and the strain along the bar.

    A coupon, which strains evenly, has the left panel alone. A whole part has its load curve and
    its largest strain.

    Parameters
    ----------
    simulation
        What `planner.simulate` returns.

    Returns
    -------
    bytes
        The figure as SVG.

    Examples
    --------
    >>> from pathlib import Path  # doctest: +SKIP
    >>> figure = planner.simulation_figure(planner.simulate("FLX9760"))  # doctest: +SKIP
    >>> Path("pull.svg").write_bytes(figure)  # doctest: +SKIP
    """
    check_kind(simulation, (Simulation, PartSimulation), "what `planner.simulate` returns")
    if not isinstance(simulation, Simulation):
        return _part_figure(simulation)
    *_, title = course_of(simulation)
    parts = list(_curve(simulation))
    width, height = _LEFT + _WIDTH + 24.0, _TOP + _HEIGHT + 92.0
    if len(simulation.bar.x_mm) > 1:
        left = width + _GAP - 24.0
        stripes = _stripes(simulation, left)
        names = _names(stripes)
        lower = _ROW * max(0, max((row for _, row in names), default=0) - 1)
        parts += [*_along(simulation, left), *_materials(stripes, names)]
        width, height, middle = width + _GAP + _WIDTH + 24.0, height + lower, left + _WIDTH / 2.0
        parts.append(svg.text(middle, height - 12.0, "place along the axis, mm", anchor="middle"))
    return svg.picture(width, height, parts, title=title)


def _part_figure(result: PartSimulation) -> bytes:
    """Draw a whole part's load curve with its interval, and its largest strain over break."""
    curve, steps = result.curve, result.steps
    broken = next((found.load for found in result.findings if found.kind == "break"), None)
    # Curves turn back where a part snaps; axes hold all of them and 0.
    ends = curve.interval
    x_range, y_range = ((_floor(float(v.min())), _span(float(v.max()))) for v in ends)
    left = _LEFT + _WIDTH + _GAP
    most = (0.0, _span(float(steps.largest.max())))
    force = _chart(_LEFT, x_range, y_range)
    charts = (
        (force, curve.y, curve.y_label),
        (_chart(left, x_range, most), steps.largest, "largest strain over elongation at break"),
    )
    around = [np.concatenate([low, high[::-1]]) for low, high in ends]
    parts = [f'<path d="{force.path(*around)}Z" fill="{PALE_BLUE}"/>']
    for chart, values, label in charts:
        parts += chart.frame(x_label=curve.x_label, y_label=label)
        parts.append(chart.line(curve.x, values, colour=BLUE))
        parts += [svg.disc(chart.x(float(x)), chart.y(float(y)), colour=BLUE, radius=2.5)
                  for x, y in zip(curve.x, values, strict=True)]  # fmt: skip
        if broken is not None:
            at = [float(np.interp(broken, steps.share, one)) for one in (curve.x, values)]
            parts.append(svg.cross(chart.x(at[0]), chart.y(at[1]), colour=RED))
    sure = curve.sure_x != (1.0, 1.0) or curve.sure_y != (1.0, 1.0)
    note = f"band: {100 * result.level:g} % of prints, from the last step" if sure else ""
    if broken is not None:
        note += ("; " if note else "") + "cross: break"
    parts.append(svg.text(left + _WIDTH, _TOP - 12.0, note, anchor="end", colour=GREY))
    width, height = left + _WIDTH + 24.0, _TOP + _HEIGHT + 64.0
    return svg.picture(width, height, parts, title=f"{result.called}: load curve")


def _chart(left: float, x_range: tuple[float, float], y_range: tuple[float, float]) -> Chart:
    return Chart(left, _TOP, _WIDTH, _HEIGHT, x_range, y_range)


def _floor(least: float) -> float:
    return -_span(-least) if least < 0.0 else 0.0


def course_of(simulation: Simulation) -> tuple[FloatArray, str, int, str]:
    """Return what force is drawn over, its name, the first step beyond the break, and a title."""
    x, label, beyond = simulation.displacement_mm, "displacement, mm", simulation.beyond_break
    if simulation.protocol == "relaxation":
        x, label = simulation.time_s, "time, s"
    title = f"{simulation.name}: {simulation.protocol} to strain {simulation.to_strain:g}"
    return x, label, int(np.argmax(beyond)) if beyond.any() else len(x), title


def _curve(simulation: Simulation) -> Iterator[str]:
    x, x_label, first, _ = course_of(simulation)
    force, (low, high) = simulation.force_N, simulation.force_interval_N.T
    chart = _chart(_LEFT, (0.0, _span(float(x.max()))), (0.0, _span(float(high.max()))))
    yield chart.band(x, low, high)
    yield from chart.frame(x_label=x_label, y_label="force, N")
    yield chart.line(x[: first + 1], force[: first + 1], colour=BLUE)
    note = f"band: {100 * simulation.level:g} % of prints"
    if first < len(x):
        yield chart.line(x[first:], force[first:], colour=BLUE, dash="3,4")
        yield svg.cross(chart.x(float(x[first])), chart.y(float(force[first])), colour=RED)
        note += "; cross: break, dotted beyond it"
    yield svg.text(_LEFT + _WIDTH, _TOP - 12.0, note, anchor="end", colour=GREY)


def _along(simulation: Simulation, left: float) -> Iterator[str]:
    bar = simulation.bar
    peak = int(np.argmax(simulation.displacement_mm))
    most = float(simulation.strain[peak].max())
    chart = _chart(left, (float(bar.edges_mm[0]), float(bar.edges_mm[-1])), (0.0, _span(most)))
    yield from chart.frame(x_label="", y_label="strain along the bar")
    steps = sorted({round(share * peak) for share in _SHARES})
    for step, shade in zip(steps, _SHADES[-len(steps) :], strict=True):
        yield chart.line(bar.x_mm, simulation.strain[step], colour=shade, width=1.6)
    strains = ", ".join(f"{simulation.gauge_strain[step]:.3g}" for step in steps)
    words = f"at strains of the bar of {strains}"
    yield svg.text(left + _WIDTH, _TOP - 12.0, words, anchor="end", colour=GREY)
    breaks = simulation.break_strain
    shown = np.ma.masked_greater(np.ma.masked_invalid(breaks), chart.y_range[1])
    for run in np.ma.clump_unmasked(shown):  # type: ignore[no-untyped-call]
        yield chart.line(bar.x_mm[run], breaks[run], colour=RED, width=1.4, dash="6,4")
    if shown.count():
        yield svg.text(left + 6.0, _TOP + 12.0, "dashed: elongation at break", colour=RED)


class _Stripe(NamedTuple):
    """A stretch of the bar of one colour, in pixels, and the grade's name; "" in between grades."""

    left: float
    right: float
    colour: str
    name: str

    @property
    def middle(self) -> float:
        return 0.5 * (self.left + self.right)

    @property
    def room(self) -> bool:
        """Whether its name has room under it."""
        return _width(self.name) <= self.right - self.left


def _width(name: str) -> float:
    # Letters of 10 px: 0.65 em, as wide as the digits of the widest usual font, DejaVu Sans.
    return 6.5 * len(name)


def _stripes(simulation: Simulation, left: float) -> list[_Stripe]:
    bar, palette = simulation.bar, simulation.palette
    edges = bar.edges_mm
    places = left + _WIDTH * (edges - edges[0]) / (edges[-1] - edges[0])
    grades = [m.coordinate for m in palette.materials]
    colours = svg.ramp([m.colour for m in palette.materials], grades, bar.coordinate)
    names = {m.coordinate: m.id for m in palette.materials}
    turns = [0, *(i for i in range(1, len(colours)) if colours[i] != colours[i - 1]), len(colours)]
    return [
        _Stripe(*ends, colours[start], names.get(float(bar.coordinate[start]), ""))
        for start, ends in zip(turns, itertools.pairwise(places[turns].tolist()), strict=False)
    ]


def _names(stripes: Sequence[_Stripe]) -> list[tuple[_Stripe, int]]:
    """Choose the stripes to name, each with the row of its name: 0 where it has room under it.

    Every grade is named, at its widest one if none has room; further narrow stripes are named
    where the rows have room for them.
    """
    roomy = [one for one in stripes if one.name and one.room]
    narrow = [one for one in stripes if one.name and not one.room]
    named = {one.name for one in roomy}
    widest_last = sorted(narrow, key=lambda one: one.left - one.right)[::-1]
    chosen = {one.name: one for one in widest_last if one.name not in named}
    taken = sorted(chosen.values(), key=lambda one: one.left)
    most = max(_rows(taken), default=1)
    for one in narrow:
        more = sorted({*taken, one}, key=lambda one: one.left)
        if max(_rows(more)) <= most:
            taken = more
    return [*((one, 0) for one in roomy), *zip(taken, _rows(taken), strict=True)]


def _rows(stripes: Sequence[_Stripe]) -> list[int]:
    """Return the row of each name, from 1, so that no name meets another's line.

    A name ends at the line that comes down from its one. It so lies below all names whose lines
    it would cross, and none lies under its own line.
    """
    rows: list[int] = []
    for number, one in enumerate(stripes):
        start = one.middle - _width(one.name) - 2.0 * _SPACE
        crossed = [rows[i] for i in range(number) if stripes[i].middle > start]
        rows.append(1 + max(crossed, default=0))
    return rows


def _materials(stripes: Sequence[_Stripe], names: Sequence[tuple[_Stripe, int]]) -> Iterator[str]:
    """Draw a strip in the materials' colours, with the names of the grades."""
    top = _TOP + _HEIGHT + 26.0
    for one in stripes:
        # A little wider, so that no seam shows between neighbours.
        seam = 0.3 if one is not stripes[-1] else 0.0
        yield svg.rectangle(one.left, top, one.right - one.left + seam, 12.0, colour=one.colour)
    for one, row in names:
        foot = top + 25.0 + _ROW * row
        if row:
            start, stop = (one.middle, top + 12.0), (one.middle, foot)
            yield svg.segment(start, stop, colour=GREY, width=0.8)
            yield svg.text(one.middle - _SPACE, foot, one.name, anchor="end", size=10.0)
        else:
            yield svg.text(one.middle, foot, one.name, anchor="middle", size=10.0)


def _span(most: float) -> float:
    return _HEADROOM * most if most > 0.0 else 1.0
