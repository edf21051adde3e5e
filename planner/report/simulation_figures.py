"""Figures of a simulation: load curve, strain along a bar, and a part cut open where it tears."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.materials.mixtures import CoefficientModel
from planner.mesh.distance import nearest, triangle_tree
from planner.numerics import FloatArray
from planner.report.svg import (
    BLUE,
    GREY,
    INK,
    PALE_BLUE,
    RED,
    Chart,
    band,
    cross,
    disc,
    frame,
    inline,
    line,
    picture,
    ramp,
    rectangle,
    runs,
    segment,
    text,
    ticks,
)
from planner.simulation.part import PartSimulation
from planner.simulation.response import hats, in_cells
from planner.simulation.simulate import Simulation, called

__all__ = ["cut_figure", "cut_of", "cut_words", "simulation_figure"]


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
    >>> figure = planner.simulation_figure(planner.simulate("FLX9760"))  # doctest: +SKIP
    >>> Path("pull.svg").write_bytes(figure)  # doctest: +SKIP
    """
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


def _part_figure(result: PartSimulation) -> bytes:
    """Draw a whole part's load curve with its interval, and its largest strain over break."""
    curve, steps = result.curve, result.steps
    broken = next((found.load for found in result.findings if found.kind == "break"), None)
    # Curves turn back where a part snaps; axes hold all of them and 0.
    ends = curve.interval
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
            around = [np.concatenate([low, high[::-1]]) for low, high in ends]
            parts.append(f'<path d="{chart.path(*around)}Z" fill="{PALE_BLUE}"/>')
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


def _curve(simulation: Simulation) -> Iterator[str]:
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


def _bands(simulation: Simulation, left: float) -> list[_Band]:
    bar, palette = simulation.bar, simulation.palette
    edges = bar.edges_mm
    places = left + _WIDTH * (edges - edges[0]) / (edges[-1] - edges[0])
    grades = [m.coordinate for m in palette.materials]
    colours = ramp([m.colour for m in palette.materials], grades, bar.coordinate)
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

    Every grade is named, at its widest one if none has room; further narrow bands are named
    where the rows have room for them.
    """
    roomy = [one for one in bands if one.name and one.room]
    narrow = [one for one in bands if one.name and not one.room]
    chosen: dict[str, _Band] = {}
    for one in sorted(narrow, key=lambda one: one.left - one.right):
        if one.name not in {each.name for each in roomy}:
            chosen.setdefault(one.name, one)
    taken = sorted(chosen.values(), key=lambda one: one.left)
    most = max(_rows(taken), default=1)
    for one in narrow:
        more = sorted({*taken, one}, key=lambda one: one.left)
        if max(_rows(more)) <= most:
            taken = more
    return [*((one, 0) for one in roomy), *zip(taken, _rows(taken), strict=True)]


def _rows(bands: Sequence[_Band]) -> list[int]:
    """Return the row of each name, from 1, so that no name meets another's line.

    A name ends at the line that comes down from its one. It so lies below all names whose lines
    it would cross, and none lies under its own line.
    """
    rows: list[int] = []
    for number, one in enumerate(bands):
        start = one.middle - _width(one.name) - 2.0 * _SPACE
        crossed = [rows[i] for i in range(number) if bands[i].middle > start]
        rows.append(1 + max(crossed, default=0))
    return rows


def _materials(bands: Sequence[_Band], names: Sequence[tuple[_Band, int]]) -> Iterator[str]:
    """Draw a strip in the materials' colours, with the names of the grades."""
    top = _TOP + _HEIGHT + 26.0
    for one in bands:
        # A little wider, so that no seam shows between neighbours.
        seam = 0.3 if one is not bands[-1] else 0.0
        yield rectangle(one.left, top, one.right - one.left + seam, 12.0, colour=one.colour)
    for one, row in names:
        foot = top + 25.0 + _ROW * row
        if row:
            start, stop = (one.middle, top + 12.0), (one.middle, foot)
            yield segment(start, stop, colour=GREY, width=0.8)
            yield text(one.middle - _SPACE, foot, one.name, anchor="end", size=10.0)
        else:
            yield text(one.middle, foot, one.name, anchor="middle", size=10.0)


def _span(most: float) -> float:
    return _HEADROOM * most if most > 0.0 else 1.0


# ------------------------------------------------------------------------------------------------
# A loaded part cut open where it is nearest to breaking: figure and words of its page.


_CUT_LEFT, _CUT_TOP = 58.0, 40.0
_LONGEST, _HIGHEST = 620.0, 400.0
_MARGIN = 12.0
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
class _PartCut:
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


def cut_of(result: PartSimulation) -> _PartCut:
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
    best: _PartCut | None = None
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
        found = _PartCut(
            across, along, up, at, x, y, values.reshape(len(y), len(x)), np.asarray(place)
        )
        if best is None or _area(found) > _area(best):
            best = found
    assert best is not None  # a normal has a component no larger than its least
    return best


def _area(cut: _PartCut) -> float:
    step = float(np.diff(cut.along_mm[:2])[0]) if len(cut.along_mm) > 1 else 1.0
    return float(np.isfinite(cut.strain_over_break).sum()) * step**2


def cut_words(result: PartSimulation, cut: _PartCut) -> Iterator[str]:
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


def cut_figure(result: PartSimulation, cut: _PartCut, colours: Sequence[str], top: float) -> str:
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
    width, height = _SQUARE * columns + 2.0 * _MARGIN, _SQUARE * rows + 2.0 * _MARGIN
    step = float(cut.along_mm[1] - cut.along_mm[0]) if columns > 1 else 1.0
    room = step * (0.5 + _MARGIN / _SQUARE)
    x_range, y_range = (
        (float(v[0]) - room, float(v[-1]) + room) for v in (cut.along_mm, cut.up_mm)
    )
    chart = Chart(_CUT_LEFT, _CUT_TOP, width, height, x_range, y_range)
    x, y = chart.x(float(cut.place_mm[cut.along])), chart.y(float(cut.place_mm[cut.up]))
    worst = float(result.steps.largest[-1])
    bottom = _CUT_TOP + height + 58.0
    side = (x - _CUT_LEFT) / width
    anchor = "start" if side < 0.15 else "end" if side > 0.85 else "middle"
    parts = [
        *frame(
            chart, x_label=f"{'xyz'[cut.along]}, mm", y_label=f"{'xyz'[cut.up]}, mm",
            y_ticks=[(v, f"{v:g}") for v in ticks(*y_range, max(4, int(height / 30.0)))],
            most_ticks=max(3, int(width / 60.0)),
        ),
        *_squares(cut, colours, top),
        segment((x, y - 7.0), (x, _CUT_TOP - 8.0), colour="#fefefe", width=3.0),
        segment((x, y - 7.0), (x, _CUT_TOP - 8.0), colour="#111111"),
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="7" fill="none" stroke="#fefefe" stroke-width="4"/>',
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="7" fill="none" stroke="#111111" stroke-width="2"/>',
        text(x, _CUT_TOP - 14.0, f"largest: {worst:.3g}", anchor=anchor),
        *_cut_legend(colours, top, bottom),
    ]  # fmt: skip
    wide, high = _CUT_LEFT + _LONGEST + 2.0 * _MARGIN + 16.0, bottom + 52.0
    return inline(wide, high, parts, 'aria-labelledby="cut-words"')


def _squares(cut: _PartCut, colours: Sequence[str], top: float) -> Iterator[str]:
    """Draw squares, those of one colour in one path, neighbours in a row as one rectangle."""
    values = cut.strain_over_break[::-1]  # the picture's rows go downwards
    shade = np.clip(np.nan_to_num(values, nan=-1.0) / top * _BANDS, -1.0, _BANDS - 1.0)
    shade = np.floor(np.where(values < 0.0, 0.0, shade)).astype(int)
    shade[np.isnan(values)] = -1
    shade[values > 1.0] = _BANDS
    padded = np.pad(shade, ((0, 0), (1, 1)), constant_values=-1)
    row, edge = np.nonzero(np.diff(padded, axis=1))
    left, above = _CUT_LEFT + _MARGIN, _CUT_TOP + _MARGIN
    paths: dict[int, list[str]] = {}
    for r, a, b in zip(row.tolist(), edge.tolist(), [*edge.tolist()[1:], 0], strict=True):
        if a < b and shade[r, a] >= 0:
            wide = _SQUARE * (b - a)
            x, y = left + _SQUARE * a, above + _SQUARE * r
            path = f"M{x:g},{y:g}h{wide:g}v{_SQUARE:g}h{-wide:g}z"
            paths.setdefault(int(shade[r, a]), []).append(path)
    # The outline: what lies beneath all of them looks out by half its line.
    whole = "".join(each for one in paths.values() for each in one)
    yield f'<path d="{whole}" fill="none" stroke="{INK}" stroke-width="2"/>'
    for k, found in sorted(paths.items()):
        colour = _shade(colours, k)
        yield f'<path d="{"".join(found)}" fill="{colour}" shape-rendering="crispEdges"/>'


def _shade(colours: Sequence[str], number: int) -> str:
    last = len(colours) - 2
    return colours[-1] if number == _BANDS else colours[round((number + 0.5) / _BANDS * last)]


def _cut_legend(colours: Sequence[str], top: float, y: float) -> Iterator[str]:
    long = 360.0
    yield text(
        _CUT_LEFT, y, "largest principal strain, as a share of the elongation at break (no unit)"
    )
    for k in range(_BANDS):
        left = _CUT_LEFT + long * k / _BANDS
        yield rectangle(left, y + 8.0, long / _BANDS + 0.3, 14.0, colour=_shade(colours, k))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        yield text(_CUT_LEFT + long * share, y + 38.0, f"{top * share:.3g}", anchor="middle")
    if top == 1.0:
        yield rectangle(
            _CUT_LEFT + long + 24.0, y + 8.0, 14.0, 14.0, colour=_shade(colours, _BANDS)
        )
        yield text(_CUT_LEFT + long + 44.0, y + 20.0, "above 1: torn")
