"""A loaded part on one page that needs nothing else: as it moves from step to step, and figures."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from planner import __version__
from planner.numerics import IntArray
from planner.report.display import thinned
from planner.report.page import (
    asset,
    begin,
    data_script,
    end,
    figure,
    findings_card,
    head,
    packed,
    section,
    table,
)
from planner.report.part_text import part_title, response_rows, step_rows, summary_words
from planner.report.plan_page import KEYS, geometry, library, section_controls, shell_data, stage
from planner.report.plan_text import format_number
from planner.report.simulation_figures import cut_figure, cut_of, cut_words, simulation_figure
from planner.report.svg import ramp, ticks
from planner.simulation.part import PartSimulation

__all__ = ["part_page"]


_MOST_TRIANGLES = 100_000
"""A step is on the screen 0.3 s after the slider moves, without a graphics card (headless Chromium,
SwiftShader, two cores)."""

_POINTS = 65535
"""Positions along the longest edge of all steps' box: what 16 bits count."""

_SCALE = (
    "#440154", "#482878", "#3E4A89", "#31688E", "#26828E", "#1F9E89", "#35B779", "#6DCD59",
    "#B4DE2C", "#FDE725",
)  # fmt: skip
"""From no strain to the most: lightness rises all the way, for the colour-blind too (the colour map
"viridis" of matplotlib, CC0)."""

_BROKEN = "#E0218A"
"""Beyond the elongation at break; no colour of the scale is near it, to the colour-blind either: it
is half-way light where the scale is green."""


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
    PlannerError
        Not of a result that `planner.simulate` returns.

    Examples
    --------
    >>> bent = planner.simulate("bar", fix="x=min", gravity="-z")  # doctest: +SKIP
    >>> Path("bent.html").write_bytes(planner.part_page(bent))  # doctest: +SKIP
    """
    results = (result,) if isinstance(result, PartSimulation) else tuple(result)
    return "\n".join(_page(results)).encode("utf-8")


def _page(results: Sequence[PartSimulation]) -> Iterator[str]:
    result = results[0]
    kept, faces = thinned(
        result.cells.surface.vertices, result.cells.surface.faces, _MOST_TRIANGLES
    )
    own = "\n".join(map(asset, ("viewer.js", "page.js", "part.js")))
    scripts = (library(), f"{own}\n")
    top = _top(max(float(one.steps.strain_over_break.max()) for one in results))
    yield from begin(
        f"{result.name}: under load",
        styles=["plan.css"],
        scripts=scripts,
        stamp=f'<meta name="generator" content="planner {__version__}">',
    )
    yield '<a class="skip" href="#figures">Skip the 3D view</a>'
    yield from _header(results)
    yield '<main>\n<div class="bench">'
    yield from stage(
        f"The part {result.name} under load",
        " ".join(
            f"{words}." for one in results for words in (part_title(one), *summary_words(one))
        ),
        no_view="The figure and the tables below are whole.",
    )
    yield '<div class="panel">'
    yield from findings_card([(f.message, False) for one in results for f in one.findings])
    yield from _slider(sum(len(one.steps.share) for one in results))
    yield from _legend(top)
    yield from section_controls("xyz")
    yield KEYS
    yield '</div>\n</div>\n<div class="below" id="figures">'
    first = 0
    for number, one in enumerate(results):
        case, mark = (f": {one.case}", f"-{number}") if one.case else ("", "")
        rows = list(step_rows(one, len(one.steps.share)))
        name = f"curve-title{mark}"
        curve = figure(name, simulation_figure(one).decode())
        yield from section(name, f"Load curve{case}", curve)
        yield from _cut(one, top, case, mark)
        title = f"Where it is held and loaded, at the last step{case}"
        yield from _table(f"responses{mark}", title, list(response_rows(one)))
        yield from _table(f"steps-table{mark}", f"Steps{case}", rows, first=first)
        first += len(rows)
    notes = dict.fromkeys(note for one in results for note in (*summary_words(one), *one.notes))
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    yield from section("notes-title", "Notes", [f'<ul class="notes">{items}</ul>'])
    yield "</div>\n</main>\n<footer>"
    shown, of = len(faces), len(result.cells.surface.faces)
    simplified = f", simplified for display to {shown} of {of} triangles" if shown < of else ""
    yield (
        f"<p>Places are in the coordinates of the part's own file, in mm{simplified}.</p>\n"
        f"<p>planner {__version__}; palette {escape(result.palette.name)} "
        f"{result.palette.sha256[:16]}. 3D view by three.js r187, MIT licence, whose text is in "
        "this file.</p>\n</footer>"
    )
    data, rest, moved = _packed(results, kept, faces, top)
    yield data_script("data", data)
    yield f'<script type="text/plain" id="geometry">{rest}</script>'
    yield f'<script type="text/plain" id="steps">{moved}</script>'
    yield end(scripts)


def _top(most: float) -> float:
    """Return where the colour scale ends: at the break, or lower where strains are far from it."""
    if not 0.0 < most <= 0.5:
        return 1.0
    return next(tick for tick in ticks(0.0, 2.0 * most) if tick >= most)


def _header(results: Sequence[PartSimulation]) -> Iterator[str]:
    worst = max(float(result.steps.largest.max()) for result in results)
    found = sum(len(result.findings) for result in results)
    curves = [(one, one.curve) for one in results]
    facts = [
        (f"{one.case}: {label}" if one.case else label, format_number(float(along[-1]), 4), "")
        for one, curve in curves
        for label, along in ((curve.x_label, curve.x), (curve.y_label, curve.y))
    ]
    facts.append(("strain / break", format_number(worst), "bad" if worst > 1.0 else "good"))
    facts.append(("findings", str(found), "bad" if found else "good"))
    return head(f"{results[0].name} under load", [escape(part_title(r)) for r in results], facts)


def _slider(count: int) -> Iterator[str]:
    last = count - 1
    yield '<fieldset id="load" data-needs-view hidden><legend>Load</legend><div class="slide">'
    yield (
        f'<input type="range" id="step" min="0" max="{last}" value="{last}" step="1" '
        'aria-label="Step of the load">'
    )
    yield '<output id="step-words" for="step"></output></div>'
    yield '<label class="tick"><input type="checkbox" id="ghost"> outline at rest</label>'
    yield '<label class="tick"><input type="checkbox" id="edges" checked> edges</label></fieldset>'


def _legend(top: float) -> Iterator[str]:
    yield '<section class="card" aria-labelledby="legend-title">'
    yield '<h2 id="legend-title">Strain over elongation at break</h2>'
    yield f'<div class="scale" style="background:linear-gradient(90deg,{",".join(_SCALE)})"></div>'
    yield '<div class="scale-figures">'
    yield "".join(f"<span>{top * share:.3g}</span>" for share in (0.0, 0.25, 0.5, 0.75, 1.0))
    yield "</div>"
    if top == 1.0:
        yield (
            f'<p class="note"><span class="beyond" style="background:{_BROKEN}"></span> above 1: '
            "a print would break here</p>"
        )
    yield "</section>"


def _cut(result: PartSimulation, top: float, case: str, mark: str) -> Iterator[str]:
    cut = cut_of(result)
    name = f"cut-title{mark}"
    said = f'<p id="cut-words{mark}">{escape(" ".join(cut_words(result, cut)))}</p>'
    drawn = figure(name, cut_figure(result, cut, _colours(), top))
    return section(name, f"Where it would tear{case}", [said, *drawn])


def _table(
    name: str, title: str, rows: Sequence[Mapping[str, str]], *, first: int | None = None
) -> Iterator[str]:
    marked = [
        ("" if first is None else f' data-step="{first + number}"', list(map(escape, row.values())))
        for number, row in enumerate(rows)
    ]
    columns = [(column or "what", "") for column in rows[0]]
    return section(name, title, table(columns, marked, of=name))


# ------------------------------------------------------------------------------------------------
# What the viewer reads: positions of all steps as counts on one grid, values as bytes.


def _packed(
    results: Sequence[PartSimulation], kept: IntArray, faces: IntArray, top: float
) -> tuple[dict[str, Any], str, str]:
    """Return what the viewer reads: figures, and in base64 the part at rest and its steps."""
    moves = np.concatenate([one.steps.displacement_mm[:, kept] for one in results])
    over_break = np.concatenate([one.steps.strain_over_break[:, kept] for one in results])
    places = results[0].cells.surface.vertices[kept] + moves
    low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    step_mm = float((high - low).max()) / _POINTS or 1.0
    points = np.floor((places - low) / step_mm + 0.5).astype("<u2")
    # One colour is kept for what is broken: the last.
    values = np.minimum(np.floor(254.0 * np.maximum(over_break, 0.0) / top), 254)
    values[over_break > 1.0] = 255
    moved = [
        one.tobytes() + value.astype("u1").tobytes()
        for one, value in zip(points, values, strict=True)
    ]
    document = {
        "origin": low.tolist(),
        "step": step_mm,
        "moved": [0.0, 0.0, 0.0],
        "size": (high - low).tolist(),
        "shells": [shell_data(points[0], faces, "#8A8F98")],
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
        "scale": _colours(),
        "top": top,
    }
    return document, geometry([(points[0], faces)]), packed(moved)


def _colours() -> list[str]:
    """Return 255 colours of the scale, and that of what is broken."""
    return [*ramp(_SCALE, range(len(_SCALE)), np.linspace(0.0, len(_SCALE) - 1.0, 255)), _BROKEN]
