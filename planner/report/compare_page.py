"""Two plans side by side on one page that needs nothing else."""

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from planner.grading.check import Difference, diff
from planner.plan import Plan
from planner.report.display import colours_told_apart, shown
from planner.report.page import (
    asset,
    begin,
    data_script,
    end,
    figure,
    head,
    section,
    table,
)
from planner.report.plan_figure import both_figure
from planner.report.plan_page import (
    KEYS,
    PlanSource,
    geometry,
    library,
    regions_table,
    section_controls,
    source_of,
    swatch,
    viewer_data,
    wish_words,
)
from planner.report.plan_text import plan_table

__all__ = ["compare_page"]


_SIDES = ("A", "B")


def compare_page(
    before: Plan | str | Path, after: Plan | str | Path, *, tolerance: float = 1e-6
) -> bytes:
    """Return a page with two plans side by side.

    Parts in the same colours, seen from the same side and cut at the same place; what differs, in
    words; target and achieved stiffness over each other; both tables of regions, rows that differ
    marked.

    Parameters
    ----------
    before, after
        Plans that `planner.grade` or `planner.read_plan` returned, or folders that ``planner
        grade`` wrote, or their plan.json.
    tolerance
        See `planner.diff`.

    Returns
    -------
    bytes
        HTML; the same for the same plans.

    Raises
    ------
    ArgumentError
        The tolerance is not a number from 0 to 1.
    FileError
        There is no plan, or a file of its folder is missing or altered.

    Examples
    --------
    >>> page = planner.compare_page("finger-graded", "five-bands")  # doctest: +SKIP
    >>> Path("compare.html").write_bytes(page)  # doctest: +SKIP
    """
    sources = (source_of(before), source_of(after))
    found = diff(sources[0].plan, sources[1].plan, tolerance=tolerance)
    return "\n".join(_page(sources, found)).encode("utf-8")


def _page(sources: Sequence[PlanSource], found: Sequence[Difference]) -> Iterator[str]:
    colours = _colours(sources)
    numbers = {name: number for number, name in enumerate(colours, start=1)}
    own = "\n".join(map(asset, ("viewer.js", "compare.js", "figure.js")))
    scripts = (library(), f"{own}\n")
    plans = [source.plan for source in sources]
    title = " and ".join(dict.fromkeys(plan.part.file for plan in plans))
    yield from begin(f"{title}: two plans", styles=["plan.css"], scripts=scripts)
    yield '<a class="skip" href="#differences">Skip the 3D views</a>'
    sides = zip(_SIDES, plans, strict=True)
    below = [f"<b>{side}</b> {escape(wish_words(plan))}" for side, plan in sides]
    yield from head(f"{title}: two plans", below)
    yield '<main>\n<div class="pair">'
    displays = [shown(source.shells) for source in sources]
    for side, plan in zip(_SIDES, plans, strict=True):
        yield (
            f'<section class="stage" aria-label="3D view of {side}"><canvas id="view-{side}" '
            f'tabindex="0" role="application" aria-label="Plan {side}: {escape(plan.part.file)} '
            f'in its materials, 3D view"></canvas><b class="side" aria-hidden="true">{side}</b>'
            '<p class="no-view" hidden>This browser shows no 3D graphics (WebGL 2).</p></section>'
        )
    yield "</div>"
    yield '<div class="shared" data-needs-view hidden>'
    yield '<div class="panel">'
    yield from section_controls("xyz")
    yield f"{KEYS}\n</div>"
    yield from _materials(sources, colours)
    yield "</div>"
    yield '<div class="below" id="differences">'
    yield from _differences(found)
    yield from _curves(plans)
    rows = [[tuple(row.values()) for row in plan_table(plan).rows] for plan in plans]
    for side, plan, mine, other in zip(_SIDES, plans, rows, reversed(rows), strict=True):
        changed = [k for k, row in enumerate(mine) if k >= len(other) or row != other[k]]
        name = f"regions-{side}"
        marked = '<p class="quiet">≠ marks a region that the other plan has not.</p>'
        regions = regions_table(plan, colours, numbers, name, changed)
        yield from section(name, f"Regions of {side}", [marked, *regions] if changed else regions)
    yield "</div>\n</main>\n<footer>"
    for side, source in zip(_SIDES, sources, strict=True):
        made = f"planner {escape(source.plan.version)}, plan.json {source.sha256[:16]}"
        yield f"<p>{side}: {made}</p>"
    yield "</footer>"
    for side, source, display in zip(_SIDES, sources, displays, strict=True):
        inks = [colours[name] for name in source.names]
        yield data_script(f"data-{side}", viewer_data(source, display, inks, numbers))
        yield f'<script type="text/plain" id="geometry-{side}">{geometry(display.shells)}</script>'
    yield end(scripts)


def _colours(sources: Sequence[PlanSource]) -> dict[str, str]:
    """Return the colour of each material of either plan, from soft to hard."""
    own: dict[str, tuple[float, str]] = {}
    for source in sources:
        of = {region.printed: region.coordinate for region in source.plan.regions}
        for name, colour in zip(source.names, source.colours, strict=True):
            own.setdefault(name, (of[name], colour))
    names = sorted(own, key=lambda name: own[name][0])
    return dict(zip(names, colours_told_apart([own[name][1] for name in names]), strict=True))


def _materials(sources: Sequence[PlanSource], colours: dict[str, str]) -> Iterator[str]:
    yield '<fieldset id="materials"><legend>Materials, from soft to hard</legend><ul role="list">'
    for number, (name, colour) in enumerate(colours.items(), start=1):
        sides = [s for s, source in zip(_SIDES, sources, strict=True) if name in source.names]
        of = "A and B" if len(sides) > 1 else f"{sides[0]} alone"
        yield (
            f'<li data-material="{number}"><label><input type="checkbox" checked>{swatch(colour)}'
            f'<span class="number">{number}</span><span class="name">{escape(name)}</span>'
            f'<span class="volume">{of}</span></label></li>'
        )
    yield "</ul></fieldset>"


def _differences(found: Sequence[Difference]) -> Iterator[str]:
    name, title = "differences-title", f"What differs{f' ({len(found)})' if found else ''}"
    if not found:
        return section(name, title, ["<p>The plans mean the same.</p>"])
    columns = [(words, "words") for words in ("what", "where", "A", "B")]
    rows = [("", [escape(w) for w in (d.what, d.where, d.before, d.after)]) for d in found]
    return section(name, title, table(columns, rows, of=name))


def _curves(plans: Sequence[Plan]) -> Iterator[str]:
    drawn = both_figure(plans[0], plans[1], "curves-words")
    caption = (
        '<figcaption id="curves-words">Dashed: the targets. Thick: the moduli of what is '
        "printed there; A is drawn wider.</figcaption>"
    )
    return section(
        "curves-title", "Stiffness along the field", figure("curves-title", drawn, caption)
    )
