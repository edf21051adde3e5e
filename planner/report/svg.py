"""A small writer of line charts as SVG: same data, same bytes, no fonts or scripts of its own."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

from planner.arrays import FloatArray

__all__ = [
    "GREY",
    "INK",
    "Chart",
    "band",
    "disc",
    "frame",
    "line",
    "marker",
    "picture",
    "rectangle",
    "ring",
    "segment",
    "text",
    "ticks",
    "upright",
]

INK = "#222222"
GREY = "#8a8a8a"
_GRID = "#e4e4e4"
_TICKS = 8


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


def picture(width: float, height: float, parts: Sequence[str], *, title: str) -> bytes:
    """Return a whole SVG document on white ground."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" font-size="12" '
        f'fill="{INK}">\n<title>{escape(title)}</title>\n'
        f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>\n'
    )
    return (head + "\n".join(parts) + "\n</svg>\n").encode("utf-8")


def frame(
    chart: Chart,
    *,
    x_label: str,
    y_label: str,
    x_ticks: Sequence[tuple[float, str]] | None = None,
    most_ticks: int = _TICKS,
) -> Iterator[str]:
    """Draw grid, figures and names of both axes.

    Parameters
    ----------
    x_ticks
        Places and what to write there, in place of round figures.
    most_ticks
        About how many round figures an axis has room for.
    """
    right, bottom = chart.left + chart.width, chart.top + chart.height
    if x_ticks is None:
        x_ticks = [(value, f"{value:g}") for value in ticks(*chart.x_range, most_ticks)]
    for value, words in x_ticks:
        x = chart.x(value)
        yield f'<path d="M{x:.2f},{chart.top:.2f}V{bottom:.2f}" stroke="{_GRID}"/>'
        yield text(x, bottom + 16.0, words, anchor="middle")
    for value in ticks(*chart.y_range, most_ticks):
        y = chart.y(value)
        yield f'<path d="M{chart.left:.2f},{y:.2f}H{right:.2f}" stroke="{_GRID}"/>'
        yield text(chart.left - 6.0, y + 4.0, f"{value:g}", anchor="end")
    corner = f"M{chart.left:.2f},{chart.top:.2f}V{bottom:.2f}H{right:.2f}"
    yield f'<path d="{corner}" fill="none" stroke="{INK}"/>'
    yield text(chart.left + chart.width / 2.0, bottom + 36.0, x_label, anchor="middle")
    yield text(chart.left - 44.0, chart.top - 12.0, y_label)


def line(
    chart: Chart, x: FloatArray, y: FloatArray, *, colour: str, width: float = 2.0, dash: str = ""
) -> str:
    """Draw a line through points."""
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<path d="{chart.path(x, y)}" fill="none" stroke="{colour}" stroke-width="{width:g}" '
        f'stroke-linejoin="round"{dashes}/>'
    )


def band(chart: Chart, x: FloatArray, low: FloatArray, high: FloatArray, *, colour: str) -> str:
    """Fill what lies between two lines."""
    back = chart.path(x[::-1], low[::-1]).replace("M", "L", 1)
    return f'<path d="{chart.path(x, high)}{back}Z" fill="{colour}" stroke="none"/>'


def marker(chart: Chart, x: float, y: float, *, colour: str) -> str:
    """Mark a point with a cross."""
    a, b = chart.x(x), chart.y(y)
    cross = f"M{a - 5:.2f},{b - 5:.2f}l10,10m0,-10l-10,10"
    return f'<path d="{cross}" stroke="{colour}" stroke-width="2.5"/>'


def segment(
    start: tuple[float, float],
    stop: tuple[float, float],
    *,
    colour: str,
    width: float = 1.0,
    dash: str = "",
) -> str:
    """Draw a straight line between two places of the picture."""
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<path d="M{start[0]:.2f},{start[1]:.2f}L{stop[0]:.2f},{stop[1]:.2f}" '
        f'stroke="{colour}" stroke-width="{width:g}"{dashes}/>'
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
        f'font-size="{size:g}">{escape(words)}</text>'
    )


def upright(x: float, y: float, words: str, *, colour: str = INK, size: float = 12.0) -> str:
    """Write words upwards, their middle at a place of the picture."""
    return (
        f'<text transform="translate({x:.2f},{y:.2f}) rotate(-90)" text-anchor="middle" '
        f'fill="{colour}" font-size="{size:g}">{escape(words)}</text>'
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


def ticks(low: float, high: float, most: int = _TICKS) -> tuple[float, ...]:
    """Return round values from low to high, at steps of 1, 2 or 5 times 10^n.

    They are `most` at most, one more where both ends are round, and at least about half of that.
    """
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= rough * (1.0 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple(float(f"{n * step:.12g}") for n in range(first, last + 1))
