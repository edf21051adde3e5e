"""plan.html: a plan on one page that needs nothing else, with the part in its materials."""

import hashlib
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from planner import __version__
from planner.errors import OutputError
from planner.formats.files import decode_document, path_within, read_file
from planner.formats.markdown import to_html
from planner.formats.outputs import SEAL, is_sealed, seal, write_whole
from planner.formats.threemf import read_threemf
from planner.numerics import Float32Array, FloatArray, IntArray
from planner.plan import Plan, decode_plan, plan_file, read_plan, read_shells
from planner.report.course_page import course_controls, course_data
from planner.report.display import Shown, colours_told_apart, shown
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
from planner.report.plan_figure import stiffness_figure
from planner.report.plan_text import (
    error_words,
    format_number,
    moved_words,
    plan_table,
    unreachable_words,
)

if TYPE_CHECKING:
    from planner.inverse_design.design import Course, PartDesign

__all__ = [
    "KEYS",
    "PlanSource",
    "geometry",
    "library",
    "plan_page",
    "regions_table",
    "section_controls",
    "shell_data",
    "source_of",
    "stage",
    "swatch",
    "view",
    "viewer_data",
    "wish_words",
]


# ------------------------------------------------------------------------------------------------
# What the page is made of: the same whether a plan was just made or is read from its folder.


_NAME = "plan.html"


@dataclass(frozen=True, slots=True, eq=False)
class PlanSource:
    """A plan as plan.json has it, its hash, the text of HOWTO.md, and its shells from soft to hard.

    Attributes
    ----------
    names, colours
        Of each shell's material.
    missed
        What a design says of its targets and limits.
    """

    plan: Plan
    sha256: str
    howto: str
    names: tuple[str, ...]
    colours: tuple[str, ...]
    shells: tuple[tuple[Float32Array | FloatArray, IntArray], ...]
    missed: tuple[str, ...] = ()


def source_of(plan: Plan | str | Path) -> PlanSource:
    """Return what a page shows of a plan, made just now or read from its folder."""
    return _from_plan(plan) if isinstance(plan, Plan) and plan.shells else _from_folder(plan)


def _from_plan(plan: Plan) -> PlanSource:
    return PlanSource(
        decode_plan(plan.json(), "plan.json"),  # with the digits that the file keeps
        _sha256_of(plan),
        plan.howto(),
        tuple(shell.material for shell in plan.shells),
        tuple(shell.colour for shell in plan.shells),
        tuple((shell.vertices, shell.faces) for shell in plan.shells),
    )


def _from_folder(where: str | Path | Plan) -> PlanSource:
    file = plan_file(where)
    plan, root = read_plan(file), file.parent
    threemf = read_threemf(path_within(root, f"{plan.name}.3mf"))
    colours = {item.material_name: item.colour for item in threemf.objects}
    printed = {region.file: region.printed for region in plan.regions}
    names: list[str] = []
    shells: list[tuple[Float32Array | FloatArray, IntArray]] = []
    for name, triangles in read_shells(plan):
        faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
        shells.append((triangles.reshape(-1, 3), faces))
        names.append(printed[name])
    howto = path_within(root, "HOWTO.md")
    return PlanSource(
        plan,
        _sha256_of(plan),
        howto.read_text(encoding="utf-8", errors="replace") if howto.is_file() else "",
        tuple(names),
        tuple(colours.get(name, "") or "#808080" for name in names),
        tuple(shells),
        _missed(root / "design.json"),
    )


class _Told(TypedDict):
    message: str


class _Design(TypedDict):
    findings: list[_Told]


def _missed(file: Path) -> tuple[str, ...]:
    if not file.is_file():
        return ()
    design = decode_document(read_file(file), _Design, str(file))
    return tuple(found["message"] for found in design["findings"])


def _sha256_of(plan: Plan) -> str:
    """Return a plan's hash, wherever it lies: of plan.json but for the files beside it."""
    return hashlib.sha256(replace(plan, files_sha256={}).json()).hexdigest()


# ------------------------------------------------------------------------------------------------
# The page as bytes, and as a file beside plan.json.


def plan_page(plan: "Plan | PartDesign | str | Path") -> bytes:
    """Return the page of a plan: the part in its materials, its figures, how to print it.

    It holds all that it needs, and loads nothing from anywhere.

    Parameters
    ----------
    plan
        What `planner.grade` or `planner.read_plan` returns; a folder that ``planner grade``
        wrote, or its plan.json; or what `planner.design` returns: with steps, a slider takes the
        part from rest to its full load.

    Returns
    -------
    bytes
        HTML; the same for the same plan, however it was given.

    Raises
    ------
    FileError
        There is no plan, or a file of its folder is missing or altered.

    Examples
    --------
    >>> plan = planner.grade("finger.stl", from_="Tango", to="Vero")  # doctest: +SKIP
    >>> plan.write("finger-graded", page=planner.plan_page(plan))  # doctest: +SKIP
    """
    if isinstance(plan, (Plan, str, Path)):
        source, courses = source_of(plan), tuple["Course", ...]()
    else:
        missed = tuple(found.message for found in plan.findings)
        source, courses = replace(source_of(plan.plan), missed=missed), plan.courses
    return seal("\n".join(_page(source, courses)).encode("utf-8"))


def view(plan: str | Path | Plan) -> Path:
    """Return the page of a plan's folder, made where it is missing or of another version.

    That of a design is kept: the part from rest to full load is on the page alone.

    Parameters
    ----------
    plan
        A folder that ``planner grade`` wrote, its plan.json, or the plan read from there.

    Returns
    -------
    pathlib.Path
        plan.html, beside plan.json.

    Raises
    ------
    FileError
        There is no plan, or a file of its folder is missing or altered.
    OutputError
        The page cannot be written, or the one that is there was not written by planner, or was
        changed since.

    Examples
    --------
    >>> planner.view("finger-graded").name  # doctest: +SKIP
    'plan.html'
    """
    file = plan_file(plan)
    page = file.parent / _NAME
    if os.path.lexists(page):
        if page.is_file():
            shown_sha256, data = _sha256_of(read_plan(file)), read_file(page)
            if _stamp(shown_sha256).encode() in data[:_HEAD_BYTES]:
                return page
            if _COURSE.encode() in data and shown_sha256.encode() in data[:_HEAD_BYTES]:
                return page
        if not (page.is_file() and is_sealed(page)):
            raise OutputError(
                f"{page}: was not written by planner, or was changed since, and is not replaced; "
                "move it elsewhere"
            )
    write_whole(page, plan_page(file))
    return page


_COURSE = 'id="course-frames"'

_HEAD_BYTES = 2048
"""The stamp stands within so many bytes of the page's beginning."""


def _stamp(plan_sha256: str) -> str:
    """Return what tells a page that is up to date: planner, the viewer, and the plan it shows."""
    viewer = hashlib.sha256("".join(map(asset, _ASSETS)).encode()).hexdigest()[:16]
    return f'<meta name="generator" content="planner {__version__} {viewer} {plan_sha256}">'


_ASSETS = (
    "base.css", "plan.css", "three.min.js", "THREE-LICENSE.txt", "viewer.js", "page.js",
    "figure.js",
)  # fmt: skip


def library() -> str:
    """Return the script of the 3D library, under its licence."""
    licence = asset("THREE-LICENSE.txt")
    return f"/* three.js r187, bundled by esbuild.\n\n{licence}\n*/\n{asset('three.min.js')}\n"


def _page(source: PlanSource, courses: "Sequence[Course]") -> Iterator[str]:
    """Yield the lines of the page."""
    plan = source.plan
    display = shown(source.shells)
    more: dict[str, Any] = {}
    frames = ""
    if courses:
        moved = plan.part.translation_mm
        display, more["course"], frames = course_data(courses, display, moved)
    colours = colours_told_apart(source.colours)
    names = ("viewer.js", "page.js", "figure.js", *(("course.js",) if courses else ()))
    own = "\n".join(map(asset, names))
    scripts = (library(), f"{own}\n")
    yield from begin(
        f"{plan.part.file}: plan",
        styles=["plan.css"],
        scripts=scripts,
        stamp=f"{_stamp(source.sha256)}\n{SEAL}",
    )
    yield '<a class="skip" href="#figures">Skip the 3D view</a>'
    yield from _header(source)
    yield '<main>\n<div class="bench">'
    yield from stage(
        f"The part {plan.part.file} in its materials",
        _in_words(plan),
        _simplified(display) if display.simplified else "",
    )
    yield '<div class="panel">'
    yield from _findings(plan, source.missed)
    if courses:
        yield from course_controls(more["course"])
    yield from section_controls([name for name, *_ in _ways(plan)])
    yield from _materials(source, colours)
    yield KEYS
    yield '</div>\n</div>\n<div class="below" id="figures">'
    yield from _figure(source, colours)
    inks = dict(zip(source.names, colours, strict=True))
    regions = regions_table(plan, inks, _numbers(source), "table-title")
    yield from section("table-title", "Regions", regions)
    yield from _remarks(plan)
    yield from _howto(source.howto)
    yield "</div>\n</main>"
    yield from _footer(source, display)
    data = viewer_data(source, display, colours, _numbers(source), more)
    yield data_script("data", data)
    yield f'<script type="text/plain" id="geometry">{geometry(display.shells)}</script>'
    if courses:
        yield f'<script type="text/plain" {_COURSE}>{frames}</script>'
    yield end(scripts)


# ------------------------------------------------------------------------------------------------
# What the viewer reads.


def _numbers(source: PlanSource) -> dict[str, int]:
    """Return each material's number, from soft to hard."""
    return {name: number for number, name in enumerate(source.names, start=1)}


def viewer_data(
    source: PlanSource,
    display: Shown,
    colours: Sequence[str],
    numbers: Mapping[str, int],
    more: Mapping[str, Any] = MappingProxyType({}),
) -> dict[str, Any]:
    """Return what the viewer reads; shapes of a design follow the shells."""
    printed = display.shells[: len(source.names)]
    points = np.concatenate([points for points, _ in printed])
    plan = source.plan
    return {
        "origin": display.origin_mm.tolist(),
        "step": display.step_mm,
        "moved": list(plan.part.translation_mm),
        "size": (display.step_mm * points.max(axis=0).astype(float)).tolist(),
        "shells": [
            shell_data(points, faces, colour, name, numbers[name], _modulus_words(plan, name))
            for name, colour, (points, faces) in zip(source.names, colours, printed, strict=True)
        ]
        + [
            shell_data(points, faces, "#2A9D8F", "wanted", 0)
            for points, faces in display.shells[len(source.names) :]
        ],
        "sections": [
            {"name": name, "normal": normal, "zero": zero} for name, normal, zero in _ways(plan)
        ],
        "findings": [
            {"number": number, "place": list(found.place_mm), "size": found.size_mm or 0.0}
            for number, found in enumerate(plan.findings, start=1 + len(plan.unreachable))
            if found.place_mm is not None
        ],
        **more,
    }


def _modulus_words(plan: Plan, material: str) -> str:
    """Return the modulus of what is printed in a material, where it is the material's own."""
    regions = [region for region in plan.regions if region.printed == material]
    blended = any((region.blend or {}).get("kind") in ("dither", "bands") for region in regions)
    return "" if blended else f"{format_number(regions[0].modulus_MPa)} MPa"


def _ways(plan: Plan) -> Iterator[tuple[str, list[float], float]]:
    """Yield ways to cut: name, normal, and where the zero that a user knows lies along it."""
    for k, name in enumerate("xyz"):
        yield name, [float(k == axis) for axis in range(3)], plan.part.translation_mm[k]
    field = plan.gradient.field
    direction, start = field.get("direction"), field.get("start_mm")
    if field.get("name") == "axis" and isinstance(direction, list) and isinstance(start, float):
        yield "along the field", [float(d) for d in direction], start


def shell_data(
    points: IntArray,
    faces: IntArray,
    colour: str,
    name: str = "",
    number: int = 1,
    modulus: str = "",
) -> dict[str, Any]:
    """Return what the viewer reads of a shell besides its geometry."""
    return {
        "name": name,
        "number": number,
        "modulus": modulus,
        "colour": colour,
        "points": len(points),
        "faces": len(faces),
        "wide": _wide(points),
    }


def _wide(points: IntArray) -> bool:
    """Whether a shell has more points than 16 bits count."""
    return len(points) > 1 << 16


def geometry(shells: Iterable[tuple[IntArray, IntArray]]) -> str:
    """Return positions and triangles of each shell, little-endian, at multiples of four bytes."""
    return packed(
        values.astype(kind).tobytes()
        for points, faces in shells
        for values, kind in ((points, "<u2"), (faces, "<u4" if _wide(points) else "<u2"))
    )


# ------------------------------------------------------------------------------------------------
# The head of the page, and the view with its controls.


def _header(source: PlanSource) -> Iterator[str]:
    plan = source.plan
    size = [high - low for low, high in zip(*plan.part.bounds_mm, strict=True)]
    mass = sum(region.mass_g for region in plan.regions)
    found = len(plan.findings) + len(plan.unreachable)
    failed = [name for name, check in plan.checks.items() if not check.ok]
    volume = plan.part.volume_mm3
    facts = (
        ("size, mm", " × ".join(format_number(length, 4) for length in size), ""),
        ("volume, mm³", format_number(volume, 5), "")
        if volume < 1e5
        else ("volume, cm³", format_number(volume / 1000.0, 5), ""),
        ("mass, g", format_number(mass, 4) if mass else "", ""),
        ("materials", str(len(source.names)), ""),
        ("checks that hold", f"{len(plan.checks) - len(failed)} of {len(plan.checks)}",
         "bad" if failed else "good"),
        ("findings", str(found), "bad" if found else "good"),
    )  # fmt: skip
    yield from head(plan.part.file, [escape(wish_words(plan))], facts)


def wish_words(plan: Plan) -> str:
    """Say in a line what was wanted."""
    gradient, words = plan.gradient, []
    if gradient.start and gradient.end:
        words.append(f"{gradient.start} to {gradient.end}")
    words += [_field_words(gradient.field), f"profile {gradient.profile.get('name', '')}"]
    if gradient.blend is not None:
        words.append(f"blend {gradient.blend.get('kind')}")
    words += [f"printer {plan.printer}", f"palette {plan.palette.name}"]
    return " · ".join(words)


def _field_words(field: Mapping[str, object]) -> str:
    direction = field.get("direction")
    if field.get("name") != "axis" or not isinstance(direction, list):
        return f"field {field.get('name')}"
    for k, name in enumerate("xyz"):
        if abs(direction[k]) == 1.0:
            return f"along {'-' if direction[k] < 0 else ''}{name}"
    return f"along ({', '.join(f'{d:.3g}' for d in direction)})"


_NO_VIEW = (
    "The figures, the table and the how-to below are whole; the .3mf opens in any 3D program."
)


def stage(label: str, words: str, note: str = "", no_view: str = _NO_VIEW) -> Iterator[str]:
    """Yield the 3D view with what lies over it.

    Parameters
    ----------
    label, words
        What it is called, and what it shows, for those who do not see it.
    note
        HTML that stands in its corner.
    no_view
        What to look at where there is none.
    """
    yield '<section class="stage" aria-label="3D view">'
    yield (
        f'<canvas id="view" tabindex="0" role="application" aria-label="{escape(label)}, 3D view" '
        'aria-describedby="view-words keys"></canvas>'
    )
    yield f'<p id="view-words" hidden>{escape(words)}</p>'
    yield '<div id="marks" aria-hidden="true"></div>'
    yield '<div class="bar" role="group" aria-label="Views" data-needs-view hidden>'
    views = {"corner": "Whole", "front": "Front", "side": "Side", "top": "Top"}
    yield "".join(
        f'<button type="button" data-view="{view}">{words}</button>'
        for view, words in views.items()
    )
    yield '</div>\n<div class="bar zoom" role="group" aria-label="Zoom" data-needs-view hidden>'
    yield '<button type="button" id="zoom-in" aria-label="Zoom in">+</button>'
    yield '<button type="button" id="zoom-out" aria-label="Zoom out">−</button></div>'
    yield '<svg class="read" id="axes" viewBox="-38 -38 76 76" aria-hidden="true">'
    yield from (f'<g><line x1="0" y1="0"/><text>{axis}</text></g>' for axis in "xyz")
    yield '</svg>\n<div class="read" id="scale" aria-hidden="true" data-needs-view hidden>'
    yield '<span id="scale-words"></span><div id="scale-bar"></div></div>'
    yield '<div class="read" id="under" role="status"></div>'
    if note:
        yield f'<p class="read" id="simplified">{note}</p>'
    yield (f'<p id="no-view" hidden>This browser shows no 3D graphics (WebGL 2). {no_view}</p>')
    yield (
        '<noscript><p class="quiet">The 3D view needs JavaScript; the rest of the page does '
        "not.</p></noscript>"
    )
    yield "</section>"


def _simplified(display: Shown) -> str:
    shown, of = _thousands(display.triangles), _thousands(display.of)
    return f"Simplified for display alone: {shown} of {of} triangles"


def _thousands(count: int) -> str:
    """Write a count in groups of three digits, with narrow spaces that do not break."""
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def _in_words(plan: Plan) -> str:
    """Say in words what the view shows."""
    first, last = plan.regions[0], plan.regions[-1]
    size = " by ".join(
        format_number(high - low, 4) for low, high in zip(*plan.part.bounds_mm, strict=True)
    )
    return (
        f"The part is {size} mm. It begins in {first.printed}, "
        f"{format_number(first.modulus_MPa)} MPa, and ends in {last.printed}, "
        f"{format_number(last.modulus_MPa)} MPa, {_field_words(plan.gradient.field)}. The table "
        "below has every region."
    )


def _findings(plan: Plan, more: Sequence[str]) -> Iterator[str]:
    missed = [(words, False) for words in unreachable_words(plan)]
    placed = [(found.message, found.place_mm is not None) for found in plan.findings]
    return findings_card([*missed, *placed, *((words, False) for words in more)])


def section_controls(ways: Sequence[str]) -> Iterator[str]:
    """Yield the controls of the section, by the names of the ways to cut."""
    yield '<fieldset id="section" data-needs-view hidden><legend>Section</legend><div class="ways">'
    yield '<label><input type="radio" name="section" value="off" checked> none</label>'
    for name in ways:
        yield f'<label><input type="radio" name="section" value="{name}"> {name}</label>'
    yield '</div>\n<div class="slide">'
    yield (
        '<input type="range" id="section-place" min="0" max="1000" value="500" disabled '
        'aria-label="Place of the section">'
    )
    yield '<output id="section-words" for="section-place"></output>'
    yield (
        '<label class="tick"><input type="checkbox" id="section-flip" disabled> show the other '
        "side</label></div></fieldset>"
    )


def _materials(source: PlanSource, colours: Sequence[str]) -> Iterator[str]:
    volumes = dict.fromkeys(source.names, 0.0)
    for region in source.plan.regions:
        volumes[region.printed] += region.volume_mm3
    whole = sum(volumes.values()) or 1.0
    yield '<fieldset id="materials"><legend>Materials, from soft to hard</legend>'
    yield '<ul role="list">'
    for number, (name, colour) in enumerate(zip(source.names, colours, strict=True), start=1):
        share = 100.0 * volumes[name] / whole
        long = ' class="long"' if len(name) > _NAME_FITS else ""
        yield (
            f'<li data-material="{number}"{long}><label><input type="checkbox" checked>'
            f'{swatch(colour)}<span class="number">{number}</span>'
            f'<span class="name">{escape(name)}</span>'
            f'<span class="volume">{format_number(volumes[name], 4)} mm³</span>'
            f'<span class="share">{share:.1f} %</span></label></li>'
        )
    yield "</ul>"
    if tuple(colours) != source.colours:
        yield (
            '<p class="note quiet">Colours run from soft (yellow) to hard (violet): the '
            "palette's own are too alike to be told apart.</p>"
        )
    yield '<div class="all" data-needs-view hidden>'
    yield '<button type="button" id="show-all">Show all</button>'
    yield '<button type="button" id="hide-all">Hide all</button>'
    yield (
        '<label class="tick"><input type="checkbox" id="edges" checked> edges</label></div>'
        "</fieldset>"
    )


_NAME_FITS = 16
"""Letters of a material's name that stand in a line with its volume."""


def swatch(colour: str) -> str:
    """Return a square of a colour; without words, which stand beside it."""
    return (
        '<svg width="14" height="14" aria-hidden="true"><rect class="swatch" x=".5" y=".5" '
        f'width="13" height="13" rx="3" fill="{colour}"/></svg>'
    )


KEYS = """<details class="card" data-needs-view hidden><summary>Mouse and keys</summary>
<dl class="keys" id="keys">
<dt>drag</dt><dd>turn; with the right button or two fingers: move</dd>
<dt>wheel, pinch</dt><dd>zoom</dd>
<dt><kbd>←</kbd> <kbd>→</kbd> <kbd>↑</kbd> <kbd>↓</kbd></dt>
<dd>turn, once the view has the focus</dd>
<dt><kbd>Shift</kbd> + arrows</dt><dd>move</dd>
<dt><kbd>+</kbd> <kbd>-</kbd></dt><dd>zoom</dd>
<dt><kbd>0</kbd>, <kbd>Home</kbd></dt><dd>the whole part again</dd>
</dl></details>"""


# ------------------------------------------------------------------------------------------------
# Below the view: figure, table, checks, how to print.


def _figure(source: PlanSource, colours: Sequence[str]) -> Iterator[str]:
    numbers = _numbers(source)
    drawn = stiffness_figure(source.plan, dict(zip(source.names, colours, strict=True)), numbers)
    caption = (
        '<figcaption id="stiffness-words">Dashed: the target. Thick: the modulus of what is '
        "printed there, with the interval that holds it with 95 % probability. Below: the "
        "materials by their numbers.</figcaption>"
    )
    name = "stiffness-title"
    return section(name, "Stiffness along the field", figure(name, drawn, caption))


def regions_table(
    plan: Plan,
    colours: Mapping[str, str],
    numbers: Mapping[str, int],
    title: str,
    changed: Collection[int] = (),
) -> Iterator[str]:
    """Yield a plan's regions as a table, under what it says of their stiffness.

    Parameters
    ----------
    colours, numbers
        Of each material, as the page shows it.
    title
        Id of the heading above it.
    changed
        Rows to mark, from 0.
    """
    shown = plan_table(plan)
    yield f'<p class="quiet">{escape(shown.title)}</p>'
    for words in (error_words(plan), moved_words(plan)):
        if words:
            yield f'<p class="quiet">{escape(words)}</p>'
    rows = []
    for place, (region, row) in enumerate(zip(plan.regions, shown.rows, strict=True)):
        cells = {name: escape(row[name]) for name in shown.columns}
        cells["material"] = swatch(colours[region.printed]) + cells["material"]
        mark = f' data-material="{numbers[region.printed]}"'
        if place in changed:
            mark += ' class="changed"'
            cells["#"] = f"<b>≠</b> {cells['#']}"
        rows.append((mark, tuple(cells.values())))
    columns = [(_heading(name), "figure" if name in shown.right else "") for name in shown.columns]
    total = [escape(shown.total.get(name, "")) for name in shown.columns]
    yield from table(columns, rows, of=title, total=total)


def _heading(column: str) -> str:
    return {"#": "no.", "volume mm3": "volume mm³"}.get(column, column)


def _remarks(plan: Plan) -> Iterator[str]:
    remarks = [*plan.part.repairs, *plan.warnings]
    items = "".join(f"<li>{escape(remark)}</li>\n" for remark in remarks)
    columns = (("check", ""), ("value", "figure"), ("limit", "figure"), ("holds", ""))
    rows = [
        (
            "",
            (escape(name), f"{check.value:.3g}", f"{check.limit:.3g}", "yes" if check.ok else "NO"),
        )
        for name, check in plan.checks.items()
    ]
    notes = [f'<ul class="notes">\n{items}</ul>'] if remarks else []
    name = "checks-title"
    return section(name, "Checks and notes", [*notes, *table(columns, rows, of=name)])


def _howto(text: str) -> Iterator[str]:
    if text.strip():
        # Its first line is a heading of its own: the section's.
        yield f'<section class="howto">\n{to_html(text, top_level=2)}\n</section>'


def _footer(source: PlanSource, display: Shown) -> Iterator[str]:
    plan = source.plan
    yield "<footer>"
    if display.simplified:
        yield (
            f"<p>{_simplified(display)}, "
            f"positions up to {display.moved_mm:.2g} mm from theirs. The files hold all.</p>"
        )
    else:
        yield (
            f"<p>Shown: all {_thousands(display.of)} triangles, positions rounded to "
            f"{display.moved_mm:.1g} mm for display; the files hold them whole.</p>"
        )
    yield (
        "<p>Places are in the coordinates of the part's own file, in mm; the files in stl/ are "
        f"moved by ({', '.join(f'{t:.6g}' for t in plan.part.translation_mm)}).</p>"
    )
    yield (
        f"<p>planner {escape(plan.version)}; part sha256 {escape(plan.part.sha256[:16])}, palette "
        f"{escape(plan.palette.name)} {escape(plan.palette.sha256[:16])}, plan.json "
        f"{source.sha256[:16]}. "
        "3D view by three.js r187, MIT licence, whose text is in this file.</p>\n</footer>"
    )
