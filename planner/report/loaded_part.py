"""A loaded part as it is shown: on one page that needs nothing else, in words, as a volume."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from planner import __version__
from planner.errors import check_kind
from planner.formats.field_file import encode_vtu
from planner.glance import format_interval, format_number, in_percent, place_text, sized
from planner.materials.mixtures import CoefficientModel
from planner.mesh.distance import triangle_tree
from planner.numerics import FloatArray, IntArray
from planner.report import page, svg
from planner.report.display import ScreenGrid, thinned
from planner.report.simulation_figures import simulation_figure
from planner.report.svg import INK, Chart
from planner.simulation.element import shape_functions
from planner.simulation.part import PartSimulation
from planner.simulation.simulate import called

__all__ = [
    "part_page", "part_title", "part_volume", "response_rows", "step_rows", "summary_words",
]  # fmt: skip


# ------------------------------------------------------------------------------------------------
# The part at every step, coloured by strain, and figures.


_MOST_TRIANGLES = 100_000
"""A step is on the screen 0.3 s after the slider moves, without a graphics card (headless Chromium,
SwiftShader, two cores)."""

_SCALE = (
    "#440154", "#482878", "#3E4A89", "#31688E", "#26828E", "#1F9E89", "#35B779", "#6DCD59",
    "#B4DE2C", "#FDE725",
)  # fmt: skip
"""From no strain to the most: lightness rises all the way, for the colour-blind too (the colour map
"viridis" of matplotlib, CC0)."""

_BROKEN = "#E0218A"
"""Beyond the elongation at break; no colour of the scale is near it, to the colour-blind either: it
is half-way light where the scale is green."""

_COLOURS = svg.ramp(_SCALE, range(len(_SCALE)), np.linspace(0.0, len(_SCALE) - 1.0, 255))
"""What the scale is drawn in on the part, from no strain to the most."""

_BANDS = 20
"""Colours drawn of the scale on a cut: between them are lines of equal strain, and the file is
small."""

_SHADES = [*(_COLOURS[round((k + 0.5) / _BANDS * 254)] for k in range(_BANDS)), _BROKEN]
"""The bands, and last what is broken."""


def part_page(result: PartSimulation | Sequence[PartSimulation]) -> bytes:
    """Return the page of a loaded part: the part at every step, coloured by strain, and figures.

    It holds all that it needs, and loads nothing from anywhere.

    Parameters
    ----------
    result
        What `planner.simulate` returns of a whole part, or `planner.simulate_part` of its load
        cases, which then follow each other.

    Returns
    -------
    bytes
        HTML; the same for the same result.

    Raises
    ------
    ArgumentError
        Not of a result of a whole part.

    Examples
    --------
    >>> from pathlib import Path  # doctest: +SKIP
    >>> bent = planner.simulate("bar", fix="x=min", gravity="-z")  # doctest: +SKIP
    >>> Path("bent.html").write_bytes(planner.part_page(bent))  # doctest: +SKIP
    """
    results = result if isinstance(result, (tuple, list)) else (result,)
    for one in results or (None,):
        check_kind(one, PartSimulation, "what `planner.simulate` returns of a whole part")
    return page.encode_page(
        f"{results[0].name}: under load", _body(results),
        styles=["plan.css"], scripts=["page.js", "part.js"],
        stamp=f'<meta name="generator" content="planner {__version__}">',
    )  # fmt: skip


def _body(results: Sequence[PartSimulation]) -> Iterator[str]:
    result = results[0]
    surface = result.cells.surface
    kept, faces = thinned(surface.vertices, surface.faces, _MOST_TRIANGLES)
    top = _top(max(float(one.steps.strain_over_break.max()) for one in results))
    yield '<a class="skip" href="#figures">Skip the 3D view</a>'
    yield from _header(results)
    yield '<main>\n<div class="bench">'
    words = (each for one in results for each in (part_title(one), *summary_words(one)))
    said = " ".join(f"{each}." for each in words)
    no_view = "The figure and the tables below are whole."
    yield page.stage(f"The part {result.name} under load", said, no_view=no_view)
    yield '<div class="panel">'
    yield from page.findings_card([(f.message, False) for one in results for f in one.findings])
    last = f"{sum(len(one.steps.share) for one in results) - 1}"
    yield page.filled("load.html", name="", last=last, value=last)
    yield '<label class="tick"><input type="checkbox" id="ghost"> outline at rest</label>'
    yield '<label class="tick"><input type="checkbox" id="edges" checked> edges</label></fieldset>'
    yield from _legend(top)
    yield page.section_controls("xyz")
    yield page.asset("keys.html")
    yield '</div>\n</div>\n<div class="below" id="figures">'
    first = 0
    for number, one in enumerate(results):
        case, mark = (f": {one.case}", f"-{number}") if one.case else ("", "")
        rows = list(step_rows(one, len(one.steps.share)))
        name = f"curve-title{mark}"
        curve = page.figure(name, simulation_figure(one).decode())
        yield from page.section(name, f"Load curve{case}", curve)
        yield from _cut(one, top, case, mark)
        title = f"Where it is held and loaded, at the last step{case}"
        yield from _table(f"responses{mark}", title, list(response_rows(one)))
        yield from _table(f"steps-table{mark}", f"Steps{case}", rows, first=first)
        first += len(rows)
    notes = dict.fromkeys(note for one in results for note in (*summary_words(one), *one.notes))
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    yield from page.section("notes-title", "Notes", [f'<ul class="notes">{items}</ul>'])
    shown, of = len(faces), len(surface.faces)
    simplified = f", simplified for display to {shown} of {of} triangles" if shown < of else ""
    palette = f"{escape(result.palette.name)} {result.palette.sha256[:16]}"
    yield page.filled(
        "part-footer.html", simplified=simplified, version=__version__, palette=palette
    )
    data, rest, moved = _packed(results, kept, faces, top)
    yield page.data_script("data", data)
    yield page.data_script("geometry", rest)
    yield page.data_script("steps", moved)


def _top(most: float) -> float:
    """Return where the colour scale ends: at the break, or lower where strains are far from it."""
    if not 0.0 < most <= 0.5:
        return 1.0
    return next(tick for tick in svg.ticks(0.0, 2.0 * most) if tick >= most)


def _header(results: Sequence[PartSimulation]) -> Iterator[str]:
    worst = max(float(result.steps.largest.max()) for result in results)
    found = sum(len(result.findings) for result in results)
    facts = [
        (f"{one.case}: {label}" if one.case else label, format_number(float(along[-1]), 4), "")
        for one in results
        for curve in [one.curve]
        for label, along in ((curve.x_label, curve.x), (curve.y_label, curve.y))
    ]
    facts.append(("strain / break", format_number(worst), "bad" if worst > 1.0 else "good"))
    facts.append(("findings", str(found), "bad" if found else "good"))
    below = [escape(part_title(result)) for result in results]
    return page.head(f"{results[0].name} under load", below, facts)


def _legend(top: float) -> Iterator[str]:
    spans = (f"<span>{top * share:.3g}</span>" for share in (0.0, 0.25, 0.5, 0.75, 1.0))
    yield page.filled("legend.html", bar=page.scale_bar(_SCALE), figures="".join(spans))
    if top == 1.0:
        yield page.filled("beyond.html", colour=_BROKEN)
    yield "</section>"


def _cut(result: PartSimulation, top: float, case: str, mark: str) -> Iterator[str]:
    cut = _cut_of(result)
    name = f"cut-title{mark}"
    said = f'<p id="cut-words{mark}">{escape(" ".join(_cut_words(result, cut)))}</p>'
    drawn = page.figure(name, _cut_figure(result, cut, top))
    return page.section(name, f"Where it would tear{case}", [said, *drawn])


def _table(
    name: str, title: str, rows: Sequence[Mapping[str, str]], *, first: int | None = None
) -> Iterator[str]:
    marked = [
        ("" if first is None else f' data-step="{first + number}"', list(map(escape, row.values())))
        for number, row in enumerate(rows)
    ]
    columns = [(column or "what", "") for column in rows[0]]
    return page.section(name, title, page.table(columns, marked, of=name))


# ------------------------------------------------------------------------------------------------
# What the viewer reads: positions of all steps as counts on one grid, values as bytes.


def _packed(
    results: Sequence[PartSimulation], kept: IntArray, faces: IntArray, top: float
) -> tuple[dict[str, Any], str, str]:
    """Return what the viewer reads: figures, and in base64 the part at rest and its steps."""
    moves = np.concatenate([one.steps.displacement_mm[:, kept] for one in results])
    over_break = np.concatenate([one.steps.strain_over_break[:, kept] for one in results])
    places = results[0].cells.surface.vertices[kept] + moves
    grid = ScreenGrid.over(list(places))
    points = grid.counts(places).astype("<u2")
    # One colour is kept for what is broken: the last.
    values = np.minimum(np.floor(254.0 * np.maximum(over_break, 0.0) / top), 254)
    values[over_break > 1.0] = 255
    each = zip(points, values.astype("u1"), strict=True)
    moved = [one.tobytes() + value.tobytes() for one, value in each]
    document = {
        "origin": grid.origin_mm.tolist(),
        "step": grid.step_mm,
        "moved": [0.0, 0.0, 0.0],
        "size": np.ptp(places, axis=(0, 1)).tolist(),
        "shells": [page.shell_data(points[0], faces, "#8A8F98", "")],
        "sections": [
            {"name": name, "normal": [float(k == axis) for axis in range(3)], "zero": 0.0}
            for k, name in enumerate("xyz")
        ],
        "findings": [],
        "steps": [
            f"{one.case and one.case + ', '}load {share:.3g}: {x:.4g} "
            f"{one.curve.x_label.rpartition(', ')[2]}"
            for one in results
            for share, x in zip(one.steps.share, one.curve.x, strict=True)
        ],
        "scale": [*_COLOURS, _BROKEN],
        "top": top,
    }
    return document, page.geometry([(points[0], faces)]), page.packed(moved)


# ------------------------------------------------------------------------------------------------
# The part cut open where it is nearest to breaking: figure and words.


_CUT_LEFT, _CUT_TOP = 58.0, 40.0
_CUT_LONGEST, _CUT_HIGHEST = 620.0, 400.0
_MARGIN = 12.0
"""Pixels about the part, so that a ring at its corner meets no axis."""

_SQUARE = 2.0
"""Pixels along the edge of a square of one colour."""

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
    along_mm (a,), up_mm : (b,), step_mm
        Middles of its squares, and their edge.
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
    step_mm: float
    strain_over_break: FloatArray
    place_mm: FloatArray


def _cut_of(result: PartSimulation) -> _PartCut:
    """Cut a part open where it is nearest to breaking, so that the most of it is seen.

    The plane is across one of the axes, and not along the surface at that place.
    """
    return max(_cuts(result), key=lambda c: np.isfinite(c.strain_over_break).sum() * c.step_mm**2)


def _cuts(result: PartSimulation) -> Iterator[_PartCut]:
    surface, cell_mm = result.cells.surface, result.cells.cell_mm
    place = result.steps.largest_mm[-1]
    low, high = surface.bounds_mm
    sizes = high - low
    facet = int(np.linalg.norm(surface.triangles.mean(axis=1) - place, axis=1).argmin())
    normal = np.abs(surface.normals[facet])
    tree = triangle_tree(surface)
    for across in np.flatnonzero(normal <= max(_STEEP, float(normal.min()))).tolist():
        along, up = sorted({0, 1, 2} - {across}, key=lambda axis: (axis == 2, -sizes[axis]))
        step = _SQUARE * max(sizes[along] / _CUT_LONGEST, sizes[up] / _CUT_HIGHEST)
        x, y = (
            low[axis] + step * (np.arange(max(int(np.ceil(sizes[axis] / step)), 1)) + 0.5)
            for axis in (along, up)
        )
        places = np.empty((len(y), len(x), 3))
        margin = _SKIN * float(cell_mm[across])
        at = float(np.clip(place[across], low[across] + margin, high[across] - margin))
        places[..., across], places[..., along], places[..., up] = at, x, y[:, None]
        _, outside = tree.distances(places.reshape(-1, 3))
        values = np.full(places.shape[:2], np.nan)
        if not outside.all():
            inside = ~outside.reshape(values.shape)
            _, cell, local = result.cells.nearest_points(places[inside])
            values[inside] = result.steps.fields.over_break_at(cell, local)
        yield _PartCut(across, along, up, at, x, y, step, values, np.asarray(place))


def _cut_words(result: PartSimulation, cut: _PartCut) -> Iterator[str]:
    """Say in plain words what the figure shows, a sentence each."""
    worst = float(result.steps.largest[-1])
    away = np.linalg.norm(result.cells.surface.vertices - cut.place_mm, axis=1)
    coordinate = float(result.surface_coordinate[away.argmin()])
    material = called(CoefficientModel(result.palette), coordinate)
    yield (
        f"The part is cut open across {'xyz'[cut.across]}, at {cut.at_mm:.4g} mm, and looked at as "
        "it is at rest; the colours are those of the last step."
    )
    bears = f"{worst:.3g} times as far as" if worst > 1.0 else f"by {100.0 * worst:.2g} % of what"
    yield (
        f"The ring marks the place nearest to breaking, at {place_text(cut.place_mm)}, in "
        f"{material}: it is stretched {bears} this material bears."
    )
    if worst > 1.0:
        torn = np.count_nonzero(cut.strain_over_break > 1.0)
        share = 100.0 * torn / np.count_nonzero(np.isfinite(cut.strain_over_break))
        yield f"Pink is beyond its break and would be torn, {share:.2g} % of this cut."
    yield (
        "Strains are means over neighbouring cells: at clamped edges and sharp corners they are "
        "higher."
    )


def _cut_figure(result: PartSimulation, cut: _PartCut, top: float) -> str:
    """Draw a cut.

    Parameters
    ----------
    top
        Where the colour scale ends, which begins at 0.

    Returns
    -------
    str
        An ``svg`` element; the page says what it shows under the id ``cut-words``.
    """
    rows, columns = cut.strain_over_break.shape
    width, height = _SQUARE * columns + 2.0 * _MARGIN, _SQUARE * rows + 2.0 * _MARGIN
    room = cut.step_mm * (0.5 + _MARGIN / _SQUARE)
    both = (cut.along_mm, cut.up_mm)
    x_range, y_range = ((float(v[0]) - room, float(v[-1]) + room) for v in both)
    chart = Chart(_CUT_LEFT, _CUT_TOP, width, height, x_range, y_range)
    x, y = chart.x(float(cut.place_mm[cut.along])), chart.y(float(cut.place_mm[cut.up]))
    worst = float(result.steps.largest[-1])
    bottom = _CUT_TOP + height + 58.0
    side = (x - _CUT_LEFT) / width
    anchor = "start" if side < 0.15 else "end" if side > 0.85 else "middle"
    parts = [
        *chart.frame(
            x_label=f"{'xyz'[cut.along]}, mm", y_label=f"{'xyz'[cut.up]}, mm",
            y_ticks=[(v, f"{v:g}") for v in svg.ticks(*y_range, max(4, int(height / 30.0)))],
            most_ticks=max(3, int(width / 60.0)),
        ),
        *_squares(cut, top),
        svg.segment((x, y - 7.0), (x, _CUT_TOP - 8.0), colour="#fefefe", width=3.0),
        svg.segment((x, y - 7.0), (x, _CUT_TOP - 8.0), colour="#111111"),
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="7" fill="none" stroke="#fefefe" stroke-width="4"/>',
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="7" fill="none" stroke="#111111" stroke-width="2"/>',
        svg.text(x, _CUT_TOP - 14.0, f"largest: {worst:.3g}", anchor=anchor),
        *_cut_legend(top, bottom),
    ]  # fmt: skip
    wide, high = _CUT_LEFT + _CUT_LONGEST + 2.0 * _MARGIN + 16.0, bottom + 52.0
    return svg.inline(wide, high, parts, 'aria-labelledby="cut-words"')


def _squares(cut: _PartCut, top: float) -> Iterator[str]:
    """Draw squares, those of one colour in one path, neighbours in a row as one rectangle."""
    values = cut.strain_over_break[::-1]  # the picture's rows go downwards
    shade = np.clip(np.floor(values / top * _BANDS), 0.0, _BANDS - 1.0)
    shade[values > 1.0] = _BANDS
    shade = np.nan_to_num(shade, nan=-1.0).astype(int)
    row, edge = np.nonzero(np.diff(shade, axis=1, prepend=-1, append=-1))
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
        yield f'<path d="{"".join(found)}" fill="{_SHADES[k]}" shape-rendering="crispEdges"/>'


def _cut_legend(top: float, y: float) -> Iterator[str]:
    long = 360.0
    words = "largest principal strain, as a share of the elongation at break (no unit)"
    yield svg.text(_CUT_LEFT, y, words)
    for k, colour in enumerate(_SHADES[:_BANDS]):
        left = _CUT_LEFT + long * k / _BANDS
        yield svg.rectangle(left, y + 8.0, long / _BANDS + 0.3, 14.0, colour=colour)
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        yield svg.text(_CUT_LEFT + long * share, y + 38.0, f"{top * share:.3g}", anchor="middle")
    if top == 1.0:
        yield svg.rectangle(_CUT_LEFT + long + 24.0, y + 8.0, 14.0, 14.0, colour=_BROKEN)
        yield svg.text(_CUT_LEFT + long + 44.0, y + 20.0, "above 1: torn")


# ------------------------------------------------------------------------------------------------
# What a loaded part does, as tables of words: what the terminal and the page show.


def part_title(result: PartSimulation) -> str:
    """Say in a line what was solved."""
    cells = result.cells
    share = float(result.steps.share[-1])
    reached = "the whole load" if share == 1.0 else f"{share:.3g} of the load"
    return (
        f"{result.called}: {len(cells.nodes)} cells of {sized(cells.cell_mm, '.3g')} mm, "
        f"{3 * len(cells.node_mm)} unknowns, {reached}"
    )


def response_rows(result: PartSimulation) -> Iterator[Mapping[str, str]]:
    """Yield what the part does at the last step where it is loaded, held and watched, a row each.

    Of a moment that is how its faces turn, and what is left of it. The interval is of the figure
    that was not given: the displacement along a force, or the force along a move.
    """
    interval = f"{100.0 * result.level:g} % interval"
    columns = ("", "faces", "moves mm (x y z)", "force N (x y z)", interval, "N/mm")
    sizes_N = [float(np.linalg.norm(r.force_N[-1])) for r in result.steps.responses]
    long_mm = float(np.ptp(result.cells.surface.bounds_mm, axis=0).max())
    sizes_N += [float(np.linalg.norm(m.moment_N_mm)) / long_mm for m in result.conditions.moments]
    # Loads that balance leave a support nothing but rounding.
    least_N = _NOTHING * max(sizes_N, default=0.0)
    units = {"fix": "N", "move": "N", "moment": "°"}
    for response in result.steps.responses:
        kind, stiffness, turn = response.kind, response.stiffness_N_mm, response.turn_deg
        sure = "" if response.interval is None else format_interval(response.interval)
        moved = "" if kind == "fix" else _vector(response.displacement_mm[-1])
        force = "" if kind == "watch" else _vector(response.force_N[-1], least_N)
        if turn is not None and response.moment_N_mm is not None:
            moved, force = f"{_vector(turn[-1])} °", f"{_vector(response.moment_N_mm[-1])} N mm"
        sure = f"{sure} {units.get(kind, 'mm')}" if sure else ""
        stiff = "" if stiffness is None else format_number(stiffness)
        cells = (kind, response.selector, moved, force, sure, stiff)
        yield dict(zip(columns, cells, strict=True))
    away, place_mm = result.farthest
    cells = ("farthest", place_text(place_mm), _vector(away), "", "", "")
    yield dict(zip(columns, cells, strict=True))


_NOTHING = 5e-6
"""Of a vector's length, or of the largest force, below which a component is written as 0: forces
are solved for so far."""


def _vector(components: FloatArray, least: float = 0.0) -> str:
    least = max(least, _NOTHING * float(np.linalg.norm(components)))
    rounded = np.where(np.abs(components) < least, 0.0, components)
    return " ".join(format_number(float(c)) for c in rounded)


def step_rows(result: PartSimulation, most: int) -> Iterator[Mapping[str, str]]:
    """Yield up to so many steps, from rest to the last."""
    curve, steps = result.curve, result.steps
    count = len(steps.share)
    for k in np.rint(np.linspace(0.0, count - 1.0, min(most, count))).astype(int).tolist():
        yield {
            "load": f"{steps.share[k]:.3g}",
            curve.x_label: format_number(float(curve.x[k]), 4),
            curve.y_label: format_number(float(curve.y[k]), 4),
            "energy, mJ": format_number(float(steps.energy_mJ[k]), 4),
            "strain / break": format_number(float(steps.largest[k])),
        }


def summary_words(result: PartSimulation) -> Iterator[str]:
    """Say what the largest strain is and where, and how far the figures depend on the cells."""
    steps, case = result.steps, f"{result.case}: " if result.case else ""
    k = int(steps.largest.argmax())
    yield (
        f"{case}largest strain over elongation at break: {steps.largest[k]:.3g}, "
        f"at {place_text(steps.largest_mm[k])}"
    )
    found = result.discretisation
    largest = None if found is None else found.largest
    if found is not None and largest is None:
        yield f"{case}how far figures depend on the cells is not told: watch a place that moves"
    elif found is not None and largest is not None:
        yield (
            f"{case}figures are within {in_percent(largest)} of those of ever smaller cells, "
            f"as two solutions in cells of {found.cell_mm:.3g} mm tell (right for nine parts in "
            "ten)"
        )


# ------------------------------------------------------------------------------------------------
# Its volume with what stands inside it, for ParaView.


_ACROSS = 3
"""Small hexahedra along a cell's edge: one for each quadrature point of a full cell."""

_NEAR = 1e-3
# of a cell's edge: a corner this near to the surface is on it, so that no sliver is cut off.

_CORNERS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
)


def part_volume(result: PartSimulation) -> bytes:
    """Return the volume of a loaded part at rest, with what stands in it at the last step: VTU.

    Each cell is 27 small hexahedra; those at the surface are clipped by it into wedges and
    tetrahedra. Points have ``displacement_mm``. Cells have, of the quadrature point that is
    nearest to them in their cell, Cauchy's ``stress_MPa`` (xx, yy, zz, xy, yz, xz), ``energy_MPa``
    (stored, over the volume at rest), ``coordinate``, ``material`` (number of the palette's
    nearest, from 0), ``strain_over_break`` (largest principal strain over the elongation at break,
    by the mean over neighbouring cells) and ``cell``, the number of the solver's cell.

    Parameters
    ----------
    result
        What `planner.simulate` returns of a whole part.

    Returns
    -------
    bytes
        The file; the same for the same result.

    Raises
    ------
    ArgumentError
        Not of a result of a whole part.

    Examples
    --------
    >>> from pathlib import Path  # doctest: +SKIP
    >>> bent = planner.simulate("bar", fix="x=min", gravity="-z")  # doctest: +SKIP
    >>> Path("bent.vtu").write_bytes(planner.part_volume(bent))  # doctest: +SKIP
    """
    check_kind(result, PartSimulation, "what `planner.simulate` returns of a whole part")
    cells, fields = result.cells, result.steps.fields
    coordinate = result.coordinate
    grades = np.array([material.coordinate for material in result.palette.materials])
    steps = np.indices(3 * (_ACROSS + 1,)).reshape(3, -1).T  # z fastest
    # A place on a face, edge or corner is shared by the cells that share the node there.
    part = np.where(steps == 0, 0, np.where(steps == _ACROSS, 2, 1))
    owner = cells.nodes[:, part @ np.array([1, 3, 9])]
    place = _ACROSS * cells.index[:, None].astype(np.int64) + steps
    wide = place.max(axis=(0, 1)) + 1
    key = (place[..., 0] * wide[1] + place[..., 1]) * wide[2] + place[..., 2]
    pairs = np.stack([owner.ravel(), key.ravel()], axis=1)
    _, first, number = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    number = number.reshape(owner.shape)
    shape, _ = shape_functions(2.0 * steps / _ACROSS - 1.0, cells.cell_mm)
    moved = np.einsum("sa,nai->nsi", shape, fields.displacement_mm[cells.nodes])
    points = cells.origin_mm + place.reshape(-1, 3)[first] / _ACROSS * cells.cell_mm
    u = moved.reshape(-1, 3)[first]

    low = steps[(steps < _ACROSS).all(axis=1)]
    at = (low[:, None] + _CORNERS) @ np.array([(_ACROSS + 1) ** 2, _ACROSS + 1, 1])
    corners, cell = number[:, at].reshape(-1, 8), np.repeat(np.arange(len(number)), len(low))
    point, of, inner = cells.nearest_points(points[corners].mean(axis=1))
    mine = of == cell  # another piece of material may stand there
    corners, cell, point, inner = corners[mine], cell[mine], point[mine], inner[mine]

    distance = np.full(len(points), -1.0)
    volume = np.zeros(tuple(cells.index.max(axis=0) + 1))
    np.add.at(volume, tuple(cells.index.T), cells.cell_volume_mm3)
    full = volume[tuple(cells.index.T)] > (1.0 - 1e-9) * np.prod(cells.cell_mm)
    asked = np.unique(corners[~full[cell]])
    away, outside = triangle_tree(cells.surface).distances(points[asked])
    distance[asked] = np.where(outside, away, -away) - _NEAR * float(cells.cell_mm.min())
    kept, used, edge, share = _clip_hexahedra(corners, points, distance)

    def cut(values: FloatArray) -> FloatArray:
        a, b = values[edge[:, 0]], values[edge[:, 1]]
        return np.concatenate([values, a + share[:, None] * (b - a)])

    point, over_break = point[used], fields.over_break_at(cell[used], inner[used])
    return encode_vtu(
        cut(points),
        kept,
        point_data={"displacement_mm": cut(u)},
        cell_data={
            "material": np.abs(coordinate[point][:, None] - grades).argmin(axis=1).astype(np.int32),
            "coordinate": coordinate[point],
            "stress_MPa": fields.stress_MPa[point].astype(np.float32),
            "energy_MPa": fields.energy_MPa[point].astype(np.float32),
            "strain_over_break": over_break.astype(np.float32),
            "cell": cell[used].astype(np.int32),
        },
    )


# ------------------------------------------------------------------------------------------------
# Hexahedra clipped by a surface between their corners: whole ones, wedges and tetrahedra.


_TETRAHEDRA = np.array(
    [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
)
"""Six about the diagonal from the first corner to the seventh, in VTK's order of corners: faces of
neighbours on a lattice are halved alike."""


def _clip_hexahedra(
    corners: IntArray, points_mm: FloatArray, distance: FloatArray
) -> tuple[list[IntArray], IntArray, IntArray, FloatArray]:
    """Keep what of hexahedra is inside: where a distance, linear between points, is 0 or less.

    Parameters
    ----------
    corners : (n, 8)
        Points of each, in VTK's order.
    points_mm : (P, 3)
    distance : (P,)
        From the surface, above 0 outside.

    Returns
    -------
    cells : hexahedra (a, 8), wedges (b, 6), tetrahedra (c, 4)
        What is left: points in VTK's order, the given ones, then those on cut edges.
    owner : (a + b + c,)
        Which hexahedron given each is of.
    edge : (p, 2), share : (p,)
        The ends of each cut edge, and how far from the first the cut is.
    """
    inside = distance <= 0.0
    count = inside[corners].sum(axis=1)
    whole, cut = np.flatnonzero(count == 8), np.flatnonzero((count > 0) & (count < 8))
    tets = corners[cut][:, _TETRAHEDRA].reshape(-1, 4)
    owner = np.repeat(cut, len(_TETRAHEDRA))
    # Corners inside come first; where that turns one inside out, two alike are exchanged.
    within = inside[tets].sum(axis=1)
    tets = np.take_along_axis(tets, np.argsort(~inside[tets], axis=1, kind="stable"), axis=1)
    turned = np.linalg.det(points_mm[tets[:, 1:]] - points_mm[tets[:, :1]]) < 0.0
    for rows, pair in ((turned & (within == 2), [0, 1]), (turned & (within != 2), [1, 2])):
        tets[np.ix_(rows, pair)] = tets[np.ix_(rows, pair[::-1])]
    one, two, three, all_four = (tets[within == k].T for k in (1, 2, 3, 4))
    ends = [
        *((one[0], one[k]) for k in (1, 2, 3)),
        *((two[i], two[k]) for i in (0, 1) for k in (2, 3)),
        *((three[k], three[3]) for k in (0, 1, 2)),
    ]
    pairs = np.sort(np.concatenate([np.stack(pair, axis=1) for pair in ends]), axis=1)
    edge, number = np.unique(pairs, axis=0, return_inverse=True)
    sizes = np.cumsum([len(a) for a, _ in ends])[:-1]
    a1, a2, a3, a, b, c, d, e, f, g = np.split(len(points_mm) + number.ravel(), sizes)
    low, high = distance[edge].T
    wedges = [
        np.stack([two[0], a, b, two[1], c, d], axis=1),
        np.stack([three[0], three[1], three[2], e, f, g], axis=1),
    ]
    tetrahedra = [all_four.T, np.stack([one[0], a1, a2, a3], axis=1)]
    cells = [corners[whole], np.concatenate(wedges), np.concatenate(tetrahedra)]
    owner = np.concatenate([whole, *(owner[within == k] for k in (2, 3, 4, 1))])
    return cells, owner, edge, low / (low - high)
