"""A loaded part cut open where it is nearest to breaking: figure and words of its page."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.materials.mixtures import CoefficientModel
from planner.mesh.distance import nearest, triangle_tree
from planner.numerics import FloatArray
from planner.report.svg import INK, Chart, frame, rectangle, segment, text, ticks
from planner.simulation.part import PartSimulation
from planner.simulation.response import hats, in_cells
from planner.simulation.simulate import called

__all__ = ["PartCut", "cut_figure", "cut_of", "cut_words"]


_LEFT, _TOP = 58.0, 40.0
_LONGEST, _HIGHEST = 620.0, 400.0
_ROOM = 12.0
"""Pixels about the part, so that a ring at its corner meets no axis."""

_SQUARE = 2.0
"""Pixels along the edge of a square of one colour."""

_BANDS = 20
"""Colours drawn of the scale: between them are lines of equal strain, and the file is small."""

_SKIN = 0.05
"""Of a cell: a cut is at least so far inside the part's box; at its end there is nothing to see."""

_STEEP = 0.71
"""Of a surface's normal along an axis, from which up a cut across the axis would run along it."""


@dataclass(frozen=True, eq=False)
class PartCut:
    """A plane across an axis through a part at rest, and strain over break on it at the last step.

    Attributes
    ----------
    across, along, up
        Numbers of the axes: across the plane, and to the right and upwards in it.
    at_mm
        Where it is along `across`.
    along_mm (a,), up_mm : (b,)
        Middles of its squares.
    strain_over_break : (b, a)
        nan outside of the part.
    place_mm : (3,)
        Where the strain over break is largest.
    """

    across: int
    along: int
    up: int
    at_mm: float
    along_mm: FloatArray
    up_mm: FloatArray
    strain_over_break: FloatArray
    place_mm: FloatArray


def cut_of(result: PartSimulation) -> PartCut:
    """Cut a part open where it is nearest to breaking, so that the most of it is seen.

    The plane is across one of the axes, and not along the surface at that place.
    """
    surface, cell_mm = result.cells.surface, result.cells.cell_mm
    place = result.steps.largest_mm[-1]
    low, high = surface.bounds_mm
    corners = surface.vertices[surface.faces]
    facet = int(np.linalg.norm(corners.mean(axis=1) - place, axis=1).argmin())
    normal = np.cross(*(corners[facet, 1:] - corners[facet, 0]))
    normal = np.abs(normal) / np.linalg.norm(normal)
    tree = triangle_tree(surface)
    best: PartCut | None = None
    for across in np.flatnonzero(normal <= max(_STEEP, float(normal.min()))).tolist():
        along, up = sorted(
            {0, 1, 2} - {across}, key=lambda axis: (axis == 2, low[axis] - high[axis])
        )
        sizes = high - low
        step = _SQUARE * max(sizes[along] / _LONGEST, sizes[up] / _HIGHEST)
        x, y = (
            low[axis] + step * (np.arange(max(int(np.ceil(sizes[axis] / step)), 1)) + 0.5)
            for axis in (along, up)
        )
        places = np.empty((len(y), len(x), 3))
        margin = _SKIN * float(cell_mm[across])
        at = float(np.clip(place[across], low[across] + margin, high[across] - margin))
        places[..., across], places[..., along], places[..., up] = at, x, y[:, None]
        _, outside = nearest(tree, places.reshape(-1, 3))
        inside = np.flatnonzero(~outside)
        values = np.full(len(y) * len(x), np.nan)
        if len(inside):
            _, cell, local = in_cells(result.cells, places.reshape(-1, 3)[inside])
            of_cell = result.steps.fields.strain_over_break[cell]
            values[inside] = np.einsum("mc,mc->m", hats(local), of_cell)
        found = PartCut(
            across, along, up, at, x, y, values.reshape(len(y), len(x)), np.asarray(place)
        )
        if best is None or _area(found) > _area(best):
            best = found
    assert best is not None  # a normal has a component no larger than its least
    return best


def _area(cut: PartCut) -> float:
    step = float(np.diff(cut.along_mm[:2])[0]) if len(cut.along_mm) > 1 else 1.0
    return float(np.isfinite(cut.strain_over_break).sum()) * step**2


def cut_words(result: PartSimulation, cut: PartCut) -> Iterator[str]:
    """Say in plain words what the figure shows, a sentence each."""
    worst = float(result.steps.largest[-1])
    where = ", ".join(f"{x:.4g}" for x in cut.place_mm)
    coordinate = float(result.surface_coordinate[_vertex(result, cut.place_mm)])
    material = called(CoefficientModel(result.palette), coordinate)
    yield (
        f"The part is cut open across {'xyz'[cut.across]}, at {cut.at_mm:.4g} mm, and looked at as "
        "it is at rest; the colours are those of the last step."
    )
    bears = f"{worst:.3g} times as far as" if worst > 1.0 else f"by {100.0 * worst:.2g} % of what"
    yield (
        f"The ring marks the place nearest to breaking, at ({where}) mm, in {material}: it is "
        f"stretched {bears} this material bears."
    )
    if worst > 1.0:
        torn = np.count_nonzero(cut.strain_over_break > 1.0)
        inside = np.count_nonzero(np.isfinite(cut.strain_over_break))
        share = 100.0 * torn / inside
        yield f"Pink is beyond its break and would be torn, {share:.2g} % of this cut."
    yield (
        "Strains are means over neighbouring cells: at clamped edges and sharp corners they are "
        "higher."
    )


def _vertex(result: PartSimulation, place_mm: FloatArray) -> int:
    away = np.linalg.norm(result.cells.surface.vertices - place_mm, axis=1)
    return int(away.argmin())


def cut_figure(result: PartSimulation, cut: PartCut, colours: Sequence[str], top: float) -> str:
    """Draw a cut.

    Parameters
    ----------
    colours
        Of the scale from 0 to `top`, and last that of what is beyond its break.

    Returns
    -------
    str
        An ``svg`` element; the page says what it shows under the id ``cut-words``.
    """
    rows, columns = cut.strain_over_break.shape
    width, height = _SQUARE * columns + 2.0 * _ROOM, _SQUARE * rows + 2.0 * _ROOM
    step = float(cut.along_mm[1] - cut.along_mm[0]) if columns > 1 else 1.0
    room = step * (0.5 + _ROOM / _SQUARE)
    x_range, y_range = (
        (float(v[0]) - room, float(v[-1]) + room) for v in (cut.along_mm, cut.up_mm)
    )
    chart = Chart(_LEFT, _TOP, width, height, x_range, y_range)
    x, y = chart.x(float(cut.place_mm[cut.along])), chart.y(float(cut.place_mm[cut.up]))
    worst = float(result.steps.largest[-1])
    bottom = _TOP + height + 58.0
    side = (x - _LEFT) / width
    anchor = "start" if side < 0.15 else "end" if side > 0.85 else "middle"
    parts = [
        *frame(
            chart, x_label=f"{'xyz'[cut.along]}, mm", y_label=f"{'xyz'[cut.up]}, mm",
            y_ticks=[(v, f"{v:g}") for v in ticks(*y_range, max(4, int(height / 30.0)))],
            most_ticks=max(3, int(width / 60.0)),
        ),
        *_squares(cut, colours, top),
        segment((x, y - 7.0), (x, _TOP - 8.0), colour="#fefefe", width=3.0),
        segment((x, y - 7.0), (x, _TOP - 8.0), colour="#111111"),
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="7" fill="none" stroke="#fefefe" stroke-width="4"/>',
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="7" fill="none" stroke="#111111" stroke-width="2"/>',
        text(x, _TOP - 14.0, f"largest: {worst:.3g}", anchor=anchor),
        *_legend(colours, top, bottom),
    ]  # fmt: skip
    wide, high = _LEFT + _LONGEST + 2.0 * _ROOM + 16.0, bottom + 52.0
    return (
        f'<svg viewBox="0 0 {wide:g} {high:g}" width="{wide:g}" height="{high:g}" font-size="12" '
        f'fill="{INK}" role="img" aria-labelledby="cut-words">\n' + "\n".join(parts) + "\n</svg>"
    )


def _squares(cut: PartCut, colours: Sequence[str], top: float) -> Iterator[str]:
    """Draw squares, those of one colour in one path, neighbours in a row as one rectangle."""
    values = cut.strain_over_break[::-1]  # the picture's rows go downwards
    band = np.clip(np.nan_to_num(values, nan=-1.0) / top * _BANDS, -1.0, _BANDS - 1.0)
    band = np.floor(np.where(values < 0.0, 0.0, band)).astype(int)
    band[np.isnan(values)] = -1
    band[values > 1.0] = _BANDS
    padded = np.pad(band, ((0, 0), (1, 1)), constant_values=-1)
    row, edge = np.nonzero(np.diff(padded, axis=1))
    left, above = _LEFT + _ROOM, _TOP + _ROOM
    paths: dict[int, list[str]] = {}
    for r, a, b in zip(row.tolist(), edge.tolist(), [*edge.tolist()[1:], 0], strict=True):
        if a < b and band[r, a] >= 0:
            wide = _SQUARE * (b - a)
            x, y = left + _SQUARE * a, above + _SQUARE * r
            path = f"M{x:g},{y:g}h{wide:g}v{_SQUARE:g}h{-wide:g}z"
            paths.setdefault(int(band[r, a]), []).append(path)
    # The outline: what lies beneath all of them looks out by half its line.
    whole = "".join(each for one in paths.values() for each in one)
    yield f'<path d="{whole}" fill="none" stroke="{INK}" stroke-width="2"/>'
    for k, found in sorted(paths.items()):
        colour = _colour(colours, k)
        yield f'<path d="{"".join(found)}" fill="{colour}" shape-rendering="crispEdges"/>'


def _colour(colours: Sequence[str], band: int) -> str:
    last = len(colours) - 2
    return colours[-1] if band == _BANDS else colours[round((band + 0.5) / _BANDS * last)]


def _legend(colours: Sequence[str], top: float, y: float) -> Iterator[str]:
    long = 360.0
    yield text(
        _LEFT, y, "largest principal strain, as a share of the elongation at break (no unit)"
    )
    for k in range(_BANDS):
        left = _LEFT + long * k / _BANDS
        yield rectangle(left, y + 8.0, long / _BANDS + 0.3, 14.0, colour=_colour(colours, k))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        yield text(_LEFT + long * share, y + 38.0, f"{top * share:.3g}", anchor="middle")
    if top == 1.0:
        yield rectangle(_LEFT + long + 24.0, y + 8.0, 14.0, 14.0, colour=_colour(colours, _BANDS))
        yield text(_LEFT + long + 44.0, y + 20.0, "above 1: torn")
