"""Line charts as SVG: same data, same bytes; and the figure of a simulation."""

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from planner.numerics import BoolArray, FloatArray
from planner.palette import Palette

if TYPE_CHECKING:
    from planner.simulation.part import PartSimulation
    from planner.simulation.simulate import Simulation

__all__ = [
    "BLUE",
    "GREY",
    "INK",
    "PALE_BLUE",
    "RED",
    "RUST",
    "Chart",
    "Panel",
    "axes_of",
    "band",
    "cross",
    "disc",
    "frame",
    "in_rows",
    "line",
    "log_ticks",
    "picture",
    "rectangle",
    "ring",
    "runs",
    "segment",
    "simulation_figure",
    "text",
    "ticks",
    "told",
    "upright",
]


# ------------------------------------------------------------------------------------------------
# A small writer of line charts as SVG: same data, same bytes, no fonts or scripts of its own.


INK = "#222222"
GREY = "#8a8a8a"
BLUE, PALE_BLUE = "#1f5fa8", "#d3e1f1"
"""What is predicted or meant, and its interval."""

RUST = "#c0562b"
"""What it is held against: another reading, another plan, the prediction before."""

RED = "#c0392b"
"""Where something breaks."""

_GRID = "#e4e4e4"
_TICKS = 8


_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")


def _escaped(words: str) -> str:
    return escape(_NOT_XML.sub("\N{REPLACEMENT CHARACTER}", words))


@dataclass(frozen=True, slots=True)
class Chart:
    """A rectangle of the picture, in pixels, and the data it spans."""

    left: float
    top: float
    width: float
    height: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def x(self, value: float) -> float:
        """Return where a value lies in the picture."""
        low, high = self.x_range
        return self.left + self.width * (value - low) / (high - low)

    def y(self, value: float) -> float:
        """Return where a value lies in the picture."""
        low, high = self.y_range
        return self.top + self.height * (1.0 - (value - low) / (high - low))

    def path(self, x: FloatArray, y: FloatArray) -> str:
        """Return points as an SVG path's data."""
        pairs = zip(x.tolist(), y.tolist(), strict=True)
        return "M" + "L".join(f"{self.x(a):.2f},{self.y(b):.2f}" for a, b in pairs)


def picture(
    width: float, height: float, parts: Iterable[str], *, title: str, heading: str = ""
) -> bytes:
    """Return a whole SVG document on white ground, under a heading, the title if none is given."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" font-size="12" '
        f'fill="{INK}">\n<title>{_escaped(title)}</title>\n'
        f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>\n'
    )
    lines = [text(20.0, 28.0, heading or title, size=15.0), *parts]
    return (head + "\n".join(lines) + "\n</svg>\n").encode("utf-8")


Panel = Callable[[float, float], Iterator[str]]
"""Draws a part of a picture, of its left and top."""


def in_rows(
    panels: Sequence[Panel], across: int, corner: tuple[float, float], cell: tuple[float, float]
) -> tuple[list[str], float, float]:
    """Return panels set in rows from a corner, their width, and where the last row ends."""
    left, top = corner
    parts: list[str] = []
    for number, panel in enumerate(panels):
        row, column = divmod(number, across)
        parts += panel(left + column * cell[0], top + row * cell[1])
    rows = math.ceil(len(panels) / across)
    return parts, min(len(panels), across) * cell[0], top + rows * cell[1]


def frame(
    chart: Chart,
    *,
    x_label: str,
    y_label: str,
    x_ticks: Sequence[tuple[float, str]] | None = None,
    y_ticks: Sequence[tuple[float, str]] | None = None,
    most_ticks: int = _TICKS,
) -> Iterator[str]:
    """Draw grid, figures and names of both axes.

    Parameters
    ----------
    x_ticks, y_ticks
        Places and what to write there, in place of round figures.
    most_ticks
        About how many round figures an axis has room for.
    """
    right, bottom = chart.left + chart.width, chart.top + chart.height
    if x_ticks is None:
        ends = sorted(chart.x_range)  # an axis may fall from left to right
        x_ticks = [(value, f"{value:g}") for value in ticks(ends[0], ends[1], most_ticks)]
    for value, words in x_ticks:
        x = chart.x(value)
        yield f'<path d="M{x:.2f},{chart.top:.2f}V{bottom:.2f}" stroke="{_GRID}"/>'
        yield text(x, bottom + 16.0, words, anchor="middle")
    if y_ticks is None:
        y_ticks = [(value, f"{value:g}") for value in ticks(*chart.y_range, most_ticks)]
    for value, words in y_ticks:
        y = chart.y(value)
        yield f'<path d="M{chart.left:.2f},{y:.2f}H{right:.2f}" stroke="{_GRID}"/>'
        yield text(chart.left - 6.0, y + 4.0, words, anchor="end")
    corner = f"M{chart.left:.2f},{chart.top:.2f}V{bottom:.2f}H{right:.2f}"
    yield f'<path d="{corner}" fill="none" stroke="{INK}"/>'
    yield text(chart.left + chart.width / 2.0, bottom + 36.0, x_label, anchor="middle")
    yield text(chart.left - 44.0, chart.top - 12.0, y_label)


def line(
    chart: Chart, x: FloatArray, y: FloatArray, *, colour: str, width: float = 2.0, dash: str = ""
) -> str:
    """Draw a line through points."""
    return (
        f'<path d="{chart.path(x, y)}" fill="none" stroke="{colour}" stroke-width="{width:g}" '
        f'stroke-linejoin="round"{_dashes(dash)}/>'
    )


def _dashes(dash: str) -> str:
    return f' stroke-dasharray="{dash}"' if dash else ""


def band(chart: Chart, x: FloatArray, low: FloatArray, high: FloatArray, *, colour: str) -> str:
    """Fill what lies between two lines."""
    back = chart.path(x[::-1], low[::-1]).replace("M", "L", 1)
    return f'<path d="{chart.path(x, high)}{back}Z" fill="{colour}" stroke="none"/>'


def cross(x: float, y: float, *, colour: str, arm: float = 5.0) -> str:
    """Mark a place of the picture with a cross."""
    d = f"{2.0 * arm:g}"
    across = f"M{x - arm:.2f},{y - arm:.2f}l{d},{d}m0,-{d}l-{d},{d}"
    return f'<path d="{across}" stroke="{colour}" stroke-width="{0.5 * arm:g}"/>'


def segment(
    start: tuple[float, float],
    stop: tuple[float, float],
    *,
    colour: str,
    width: float = 1.0,
    dash: str = "",
) -> str:
    """Draw a straight line between two places of the picture."""
    return (
        f'<path d="M{start[0]:.2f},{start[1]:.2f}L{stop[0]:.2f},{stop[1]:.2f}" '
        f'stroke="{colour}" stroke-width="{width:g}"{_dashes(dash)}/>'
    )


def rectangle(left: float, top: float, width: float, height: float, *, colour: str) -> str:
    """Fill a rectangle of the picture."""
    return (
        f'<rect x="{left:.2f}" y="{top:.2f}" width="{width:.2f}" height="{height:.2f}" '
        f'fill="{colour}"/>'
    )


def text(
    x: float, y: float, words: str, *, anchor: str = "start", colour: str = INK, size: float = 12.0
) -> str:
    """Write words in the picture."""
    return (
        f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" fill="{colour}" '
        f'font-size="{size:g}">{_escaped(words)}</text>'
    )


def upright(x: float, y: float, words: str, *, colour: str = INK, size: float = 12.0) -> str:
    """Write words upwards, their middle at a place of the picture."""
    return (
        f'<text transform="translate({x:.2f},{y:.2f}) rotate(-90)" text-anchor="middle" '
        f'fill="{colour}" font-size="{size:g}">{_escaped(words)}</text>'
    )


def ring(x: float, y: float, *, colour: str, radius: float = 3.5) -> str:
    """Draw a ring at a place of the picture."""
    return (
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{radius:g}" fill="#ffffff" stroke="{colour}" '
        'stroke-width="1.5"/>'
    )


def disc(x: float, y: float, *, colour: str, radius: float = 3.5) -> str:
    """Fill a disc at a place of the picture."""
    return f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{radius:g}" fill="{colour}"/>'


def told(words: str, parts: Iterable[str], *, axes: str = "") -> Iterator[str]:
    """Group what is drawn, with words that a pointer on it brings up.

    Parameters
    ----------
    axes
        See `axes_of`; of a group whose places can be read.
    """
    yield f"<g{axes}><title>{_escaped(words)}</title>"
    yield from parts
    yield "</g>"


def axes_of(chart: Chart, x: str, y: str, *, log: bool = False) -> str:
    """Return a group's attribute that tells a page how places in it are read as figures.

    Parameters
    ----------
    x, y
        What the axes are, each with its unit last: "travel, mm".
    log
        Whether `Chart.x_range` is of decimal logarithms.
    """
    corners = (chart.left, chart.top, chart.width, chart.height, *chart.x_range, *chart.y_range)
    figures = " ".join(f"{corner:.5g}" for corner in corners)
    return f' data-axes="{figures} {int(log)}" data-x="{_escaped(x)}" data-y="{_escaped(y)}"'


def ticks(low: float, high: float, most: int = _TICKS) -> tuple[float, ...]:
    """Return round values from low to high, at steps of 1, 2 or 5 times 10^n.

    They are `most` at most, one more where both ends are round, and at least about half of that.
    """
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= rough * (1.0 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple(float(f"{n * step:.12g}") for n in range(first, last + 1))


def log_ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Return decades between logarithms to base 10; with 2 and 5, or evenly, where few fit."""
    steps = (1.0, 2.0, 5.0) if high - low < 2.5 else (1.0,)
    found = [
        (math.log10(step) + power, f"{step * 10.0**power:g}")
        for power in range(math.floor(low), math.ceil(high) + 1)
        for step in steps
        if low <= math.log10(step) + power <= high
    ]
    if len(found) > 1:
        return found
    return [(math.log10(value), f"{value:g}") for value in ticks(10.0**low, 10.0**high)]


def runs(known: BoolArray) -> list[slice]:
    """Return the stretches of steps that are known, in order."""
    turns = np.flatnonzero(np.diff(known.astype(np.int8), prepend=0, append=0))
    return [slice(start, stop) for start, stop in turns.reshape(-1, 2).tolist()]


# ------------------------------------------------------------------------------------------------
# The figure of a simulation: force against displacement, and strain along the bar.


_WIDTH, _HEIGHT, _TOP = 460.0, 300.0, 78.0
_LEFT, _GAP = 64.0, 96.0
_SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)
_SHADES = ("#c3c3c3", "#9d9d9d", "#777777", "#4e4e4e", INK)
_HEADROOM = 1.06
_ROW, _SPACE = 13.0, 3.0  # between rows of names; between a name and its line


def simulation_figure(simulation: "Simulation | PartSimulation") -> bytes:
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
    >>> figure = planner.simulation_figure(planner.simulate("FLX9760"))  # doctest: +SKIP
    >>> Path("pull.svg").write_bytes(figure)  # doctest: +SKIP
    """
    from planner.simulation.simulate import Simulation

    if not isinstance(simulation, Simulation):
        return _part_figure(simulation)
    title = f"{simulation.name}: {simulation.protocol} to strain {simulation.to_strain:g}"
    parts = list(_curve(simulation))
    width, height = _LEFT + _WIDTH + 24.0, _TOP + _HEIGHT + 92.0
    if len(simulation.bar.x_mm) > 1:
        left = width + _GAP - 24.0
        bands = _bands(simulation, left)
        names = _names(bands)
        lower = _ROW * max(0, max((row for _, row in names), default=0) - 1)
        parts += [*_along(simulation, left), *_materials(bands, names)]
        middle = left + _WIDTH / 2.0
        parts.append(
            text(middle, height + lower - 12.0, "place along the axis, mm", anchor="middle")
        )
        width, height = width + _GAP + _WIDTH + 24.0, height + lower
    return picture(width, height, parts, title=title)


def _part_figure(result: "PartSimulation") -> bytes:
    """Draw a whole part's load curve with its interval, and its largest strain over break."""
    curve, steps = result.curve, result.steps
    broken = next((found.load for found in result.findings if found.kind == "break"), None)
    # Curves turn back where a part snaps; axes hold all of them and 0.
    ends = [
        np.outer(sure, values)
        for sure, values in ((curve.sure_x, curve.x), (curve.sure_y, curve.y))
    ]
    x_range, y_range = ((_floor(float(v.min())), _span(float(v.max()))) for v in ends)
    left = _LEFT + _WIDTH + _GAP
    charts = (
        (Chart(_LEFT, _TOP, _WIDTH, _HEIGHT, x_range, y_range), curve.y, curve.y_label),
        (
            Chart(left, _TOP, _WIDTH, _HEIGHT, x_range, (0.0, _span(float(steps.largest.max())))),
            steps.largest,
            "largest strain over elongation at break",
        ),
    )
    parts: list[str] = []
    for number, (chart, values, label) in enumerate(charts):
        if number == 0:
            (less, more), (low, high) = curve.sure_x, curve.sure_y
            edge = np.concatenate([curve.x * less, (curve.x * more)[::-1]])
            other = np.concatenate([values * low, (values * high)[::-1]])
            parts.append(f'<path d="{chart.path(edge, other)}Z" fill="{PALE_BLUE}"/>')
        parts += frame(chart, x_label=curve.x_label, y_label=label)
        parts.append(line(chart, curve.x, values, colour=BLUE))
        parts += [disc(chart.x(float(x)), chart.y(float(y)), colour=BLUE, radius=2.5)
                  for x, y in zip(curve.x, values, strict=True)]  # fmt: skip
        if broken is not None:
            at = [float(np.interp(broken, steps.share, one)) for one in (curve.x, values)]
            parts.append(cross(chart.x(at[0]), chart.y(at[1]), colour=RED))
    sure = curve.sure_x != (1.0, 1.0) or curve.sure_y != (1.0, 1.0)
    note = f"band: {100 * result.level:g} % of prints, from the last step" if sure else ""
    if broken is not None:
        note += ("; " if note else "") + "cross: break"
    parts.append(text(left + _WIDTH, _TOP - 12.0, note, anchor="end", colour=GREY))
    width, height = left + _WIDTH + 24.0, _TOP + _HEIGHT + 64.0
    return picture(width, height, parts, title=f"{result.called}: load curve")


def _floor(least: float) -> float:
    return -_span(-least) if least < 0.0 else 0.0


def _curve(simulation: "Simulation") -> Iterator[str]:
    over_time = simulation.protocol == "relaxation"
    x = simulation.time_s if over_time else simulation.displacement_mm
    force, (low, high) = simulation.force_N, simulation.force_interval_N.T
    chart = Chart(
        _LEFT, _TOP, _WIDTH, _HEIGHT, (0.0, _span(float(x.max()))), (0.0, _span(float(high.max())))
    )
    yield band(chart, x, low, high, colour=PALE_BLUE)
    yield from frame(
        chart, x_label="time, s" if over_time else "displacement, mm", y_label="force, N"
    )
    beyond = simulation.beyond_break
    first = int(np.argmax(beyond)) if beyond.any() else len(x)
    held = slice(0, min(first + 1, len(x)))
    yield line(chart, x[held], force[held], colour=BLUE)
    note = f"band: {100 * simulation.level:g} % of prints"
    if beyond.any():
        yield line(chart, x[first:], force[first:], colour=BLUE, dash="3,4")
        yield cross(chart.x(float(x[first])), chart.y(float(force[first])), colour=RED)
        note += "; cross: break, dotted beyond it"
    yield text(_LEFT + _WIDTH, _TOP - 12.0, note, anchor="end", colour=GREY)


def _along(simulation: "Simulation", left: float) -> Iterator[str]:
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
    for run in runs(np.isfinite(shown)):
        yield line(chart, bar.x_mm[run], shown[run], colour=RED, width=1.4, dash="6,4")
    if np.isfinite(shown).any():
        yield text(left + 6.0, _TOP + 12.0, "dashed: elongation at break", colour=RED)


@dataclass(frozen=True, slots=True)
class _Band:
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


def _bands(simulation: "Simulation", left: float) -> list[_Band]:
    bar, palette = simulation.bar, simulation.palette
    edges = bar.edges_mm
    places = left + _WIDTH * (edges - edges[0]) / (edges[-1] - edges[0])
    colours = [_colour(palette, m) for m in bar.coordinate.tolist()]
    names = {m.coordinate: m.id for m in palette.materials}
    turns = [0, *(i for i in range(1, len(colours)) if colours[i] != colours[i - 1]), len(colours)]
    return [
        _Band(
            float(places[start]),
            float(places[stop]),
            colours[start],
            names.get(float(bar.coordinate[start]), ""),
        )
        for start, stop in itertools.pairwise(turns)
    ]


def _names(bands: Sequence[_Band]) -> list[tuple[_Band, int]]:
    """Choose the bands to name, each with the row of its name: 0 where it has room under it.

    Every grade is named, at its widest band if none has room; further narrow bands are named
    where the rows have room for them.
    """
    roomy = [band for band in bands if band.name and band.room]
    narrow = [band for band in bands if band.name and not band.room]
    chosen: dict[str, _Band] = {}
    for band in sorted(narrow, key=lambda band: band.left - band.right):
        if band.name not in {each.name for each in roomy}:
            chosen.setdefault(band.name, band)
    taken = sorted(chosen.values(), key=lambda band: band.left)
    most = max(_rows(taken), default=1)
    for band in narrow:
        more = sorted({*taken, band}, key=lambda band: band.left)
        if max(_rows(more)) <= most:
            taken = more
    return [*((band, 0) for band in roomy), *zip(taken, _rows(taken), strict=True)]


def _rows(bands: Sequence[_Band]) -> list[int]:
    """Return the row of each name, from 1, so that no name meets another's line.

    A name ends at the line that comes down from its band. It so lies below all names whose lines
    it would cross, and none lies under its own line.
    """
    rows: list[int] = []
    for number, band in enumerate(bands):
        start = band.middle - _width(band.name) - 2.0 * _SPACE
        crossed = [rows[i] for i in range(number) if bands[i].middle > start]
        rows.append(1 + max(crossed, default=0))
    return rows


def _materials(bands: Sequence[_Band], names: Sequence[tuple[_Band, int]]) -> Iterator[str]:
    """Draw a strip in the materials' colours, with the names of the grades."""
    top = _TOP + _HEIGHT + 26.0
    for band in bands:
        # A little wider, so that no seam shows between neighbours.
        seam = 0.3 if band is not bands[-1] else 0.0
        yield rectangle(band.left, top, band.right - band.left + seam, 12.0, colour=band.colour)
    for band, row in names:
        foot = top + 25.0 + _ROW * row
        if row:
            start, stop = (band.middle, top + 12.0), (band.middle, foot)
            yield segment(start, stop, colour=GREY, width=0.8)
            yield text(band.middle - _SPACE, foot, band.name, anchor="end", size=10.0)
        else:
            yield text(band.middle, foot, band.name, anchor="middle", size=10.0)


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
