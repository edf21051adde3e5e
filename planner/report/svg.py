"""A small writer of line charts as SVG: same data, same bytes, no fonts or scripts of its own."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TypeAlias

import numpy as np

from planner.glance import channels
from planner.numerics import FloatArray

__all__ = [
    "BLUE",
    "GREY",
    "INK",
    "PALE_BLUE",
    "QUIET",
    "RED",
    "RUST",
    "Chart",
    "cross",
    "disc",
    "in_rows",
    "inline",
    "log_ticks",
    "picture",
    "ramp",
    "rectangle",
    "ring",
    "segment",
    "text",
    "ticks",
    "told",
    "with_room",
]


INK = "#222222"
GREY = "#8a8a8a"
BLUE, PALE_BLUE = "#1f5fa8", "#d3e1f1"
"""What is predicted or meant, and its interval."""

RUST = "#c0562b"
"""What it is held against: another reading, another plan, the prediction before."""

RED = "#c0392b"
"""Where something breaks."""

QUIET = "#5c5c5c"
"""Notes, and words of a key."""

_GRID = "#e4e4e4"
_TICKS = 8


_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")


def _escaped(words: str) -> str:
    return escape(_NOT_XML.sub("\N{REPLACEMENT CHARACTER}", words))


_Pair: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Chart:
    """A rectangle of the picture, in pixels, and the data it spans.

    Attributes
    ----------
    y_log
        Whether `y_range` is of decimal logarithms of what is drawn.
    """

    left: float
    top: float
    width: float
    height: float
    x_range: _Pair
    y_range: _Pair
    y_log: bool = False

    def x(self, value: float) -> float:
        """Return where a value lies in the picture."""
        low, high = self.x_range
        return self.left + self.width * (value - low) / (high - low)

    def y(self, value: float) -> float:
        """Return where a value lies in the picture."""
        low, high = self.y_range
        at = float(np.log10(value)) if self.y_log else value
        return self.top + self.height * (1.0 - (at - low) / (high - low))

    def path(self, x: FloatArray, y: FloatArray) -> str:
        """Return points as an SVG path's data."""
        pairs = zip(x.tolist(), y.tolist(), strict=True)
        return "M" + "L".join(f"{self.x(a):.2f},{self.y(b):.2f}" for a, b in pairs)

    def frame(
        self,
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
        right, bottom = self.left + self.width, self.top + self.height

        def round_figures(ends: _Pair) -> list[tuple[float, str]]:
            low, high = sorted(ends)  # an axis may fall from left to right
            return [(value, f"{value:g}") for value in ticks(low, high, most_ticks)]

        for value, words in x_ticks or round_figures(self.x_range):
            x = self.x(value)
            yield f'<path d="M{x:.2f},{self.top:.2f}V{bottom:.2f}" stroke="{_GRID}"/>'
            yield text(x, bottom + 16.0, words, anchor="middle")
        decades = log_ticks(*self.y_range) if self.y_log else []
        upwards = [(10.0**power, words) for power, words in decades] or y_ticks
        for value, words in upwards or round_figures(self.y_range):
            y = self.y(value)
            yield f'<path d="M{self.left:.2f},{y:.2f}H{right:.2f}" stroke="{_GRID}"/>'
            yield text(self.left - 6.0, y + 4.0, words, anchor="end")
        corner = f"M{self.left:.2f},{self.top:.2f}V{bottom:.2f}H{right:.2f}"
        yield f'<path d="{corner}" fill="none" stroke="{INK}"/>'
        yield text(self.left + self.width / 2.0, bottom + 36.0, x_label, anchor="middle")
        yield text(self.left - 44.0, self.top - 12.0, y_label)

    def line(
        self, x: FloatArray, y: FloatArray, *, colour: str, width: float = 2.0, dash: str = ""
    ) -> str:
        """Draw a line through points."""
        return (
            f'<path d="{self.path(x, y)}" fill="none" stroke="{colour}" stroke-width="{width:g}" '
            f'stroke-linejoin="round"{_dashes(dash)}/>'
        )

    def band(self, x: FloatArray, low: FloatArray, high: FloatArray) -> str:
        """Fill what lies between two lines, the ends of an interval."""
        back = self.path(x[::-1], low[::-1]).replace("M", "L", 1)
        return f'<path d="{self.path(x, high)}{back}Z" fill="{PALE_BLUE}" stroke="none"/>'

    def upright(self, left_by: float, words: str) -> str:
        """Write words upwards, so far to the left of the chart's middle."""
        x, y = self.left - left_by, self.top + 0.5 * self.height
        return (
            f'<text transform="translate({x:.2f},{y:.2f}) rotate(-90)" text-anchor="middle" '
            f'fill="{QUIET}" font-size="11">{_escaped(words)}</text>'
        )

    def axes(self, x: str, y: str, *, log: bool = False) -> str:
        """Return a group's attribute that tells a page how places in it are read as figures.

        Parameters
        ----------
        x, y
            What the axes are, each with its unit last: "travel, mm".
        log
            Whether `x_range` is of decimal logarithms.
        """
        corners = (self.left, self.top, self.width, self.height, *self.x_range, *self.y_range)
        figures = " ".join(f"{corner:.5g}" for corner in corners)
        return f' data-axes="{figures} {int(log)}" data-x="{_escaped(x)}" data-y="{_escaped(y)}"'


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


def inline(width: float, height: float, parts: Iterable[str], label: str) -> str:
    """Return an SVG element for a page, with the attribute that names it."""
    return (
        f'<svg viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}" '
        f'font-size="12" fill="{INK}" role="img" {label}>\n' + "\n".join(parts) + "\n</svg>"
    )


_Panel = Callable[[float, float], Iterator[str]]
"""Draws a part of a picture, of its left and top."""


def in_rows(
    panels: Sequence[_Panel], across: int, corner: _Pair, cell: _Pair
) -> tuple[list[str], float, float]:
    """Return panels set in rows from a corner, their width, and where the last row ends."""
    left, top = corner
    parts: list[str] = []
    for number, panel in enumerate(panels):
        row, column = divmod(number, across)
        parts += panel(left + column * cell[0], top + row * cell[1])
    rows = math.ceil(len(panels) / across)
    return parts, min(len(panels), across) * cell[0], top + rows * cell[1]


def _dashes(dash: str) -> str:
    return f' stroke-dasharray="{dash}"' if dash else ""


def cross(x: float, y: float, *, colour: str, arm: float = 5.0) -> str:
    """Mark a place of the picture with a cross."""
    d = f"{2.0 * arm:g}"
    across = f"M{x - arm:.2f},{y - arm:.2f}l{d},{d}m0,-{d}l-{d},{d}"
    return f'<path d="{across}" stroke="{colour}" stroke-width="{0.5 * arm:g}"/>'


def segment(start: _Pair, stop: _Pair, *, colour: str, width: float = 1.0, dash: str = "") -> str:
    """Draw a straight line between two places of the picture."""
    return (
        f'<path d="M{start[0]:.2f},{start[1]:.2f}L{stop[0]:.2f},{stop[1]:.2f}" '
        f'stroke="{colour}" stroke-width="{width:g}"{_dashes(dash)}/>'
    )


def rectangle(left: float, top: float, width: float, height: float, *, colour: str) -> str:
    """Fill a rectangle of the picture."""
    size = f'width="{width:.2f}" height="{height:.2f}"'
    return f'<rect x="{left:.2f}" y="{top:.2f}" {size} fill="{colour}"/>'


def text(
    x: float, y: float, words: str, *, anchor: str = "start", colour: str = INK, size: float = 12.0
) -> str:
    """Write words in the picture."""
    return (
        f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" fill="{colour}" '
        f'font-size="{size:g}">{_escaped(words)}</text>'
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
        See `Chart.axes`; of a group whose places can be read.
    """
    yield f"<g{axes}><title>{_escaped(words)}</title>"
    yield from parts
    yield "</g>"


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


def with_room(ends: Sequence[float] | FloatArray, share: float, least: float = 0.5) -> _Pair:
    """Return a range with a share of it as room on either side, so much of one without width."""
    room = share * float(ends[-1] - ends[0]) or least
    return float(ends[0]) - room, float(ends[-1]) + room


def ramp(colours: Sequence[str], places: Sequence[float], at: FloatArray) -> list[str]:
    """Return colours in between: at each of `at`, of colours "#RRGGBB" that stand at places."""
    known = np.array([channels(colour) for colour in colours], np.float64)
    mixed = np.stack([np.interp(at, places, channel) for channel in known.T], axis=1)
    return ["#" + bytes(np.rint(row).astype(np.uint8)).hex().upper() for row in mixed]
