"""plan.html: a plan on one page that needs nothing else, with the part in its materials."""

import hashlib
import math
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from planner import __version__
from planner.errors import OutputError
from planner.formats.files import decode_document, path_within, read_file
from planner.formats.outputs import SEAL, is_sealed, seal, write_whole
from planner.formats.threemf import read_threemf
from planner.glance import format_number
from planner.grading.check import Difference, diff
from planner.numerics import Float32Array, FloatArray, IntArray, Point
from planner.plan import Plan, decode_plan, plan_file, read_plan, read_shells
from planner.report import page, plan_figure
from planner.report.display import ScreenGrid, Shown, colours_told_apart, shown, thinned
from planner.report.markdown import to_html
from planner.report.svg import ramp

if TYPE_CHECKING:
    from planner.inverse_design.design import Course, PartDesign

__all__ = ["compare_page", "plan_page", "view"]


# ------------------------------------------------------------------------------------------------
# What the page is made of: the same whether a plan was just made or is read from its folder.


_NAME = "plan.html"


@dataclass(frozen=True, slots=True, eq=False)
class _PlanSource:
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


def _source_of(plan: Plan | str | Path) -> _PlanSource:
    """Return what a page shows of a plan, made just now or read from its folder."""
    return _from_plan(plan) if isinstance(plan, Plan) and plan.shells else _from_folder(plan)


def _from_plan(plan: Plan) -> _PlanSource:
    return _PlanSource(
        decode_plan(plan.json(), "plan.json"),  # with the digits that the file keeps
        _sha256_of(plan),
        plan.howto(),
        tuple(shell.material for shell in plan.shells),
        tuple(shell.colour for shell in plan.shells),
        tuple((shell.vertices, shell.faces) for shell in plan.shells),
    )


def _from_folder(where: str | Path | Plan) -> _PlanSource:
    file = plan_file(where)
    plan, root = read_plan(file), file.parent
    threemf = read_threemf(path_within(root, f"{plan.name}.3mf"))
    colours = {item.material_name: item.colour for item in threemf.objects}
    printed = {region.file: region.printed for region in plan.regions}
    read = list(read_shells(plan))
    names = tuple(printed[file] for file, _ in read)
    soups = (triangles.reshape(-1, 3) for _, triangles in read)
    howto = path_within(root, "HOWTO.md")
    return _PlanSource(
        plan,
        _sha256_of(plan),
        howto.read_text(encoding="utf-8", errors="replace") if howto.is_file() else "",
        names,
        tuple(colours.get(name, "") or "#808080" for name in names),
        tuple((soup, np.arange(len(soup), dtype=np.int32).reshape(-1, 3)) for soup in soups),
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
    given: Any = plan
    source, courses = _source_of(getattr(given, "plan", given)), getattr(given, "courses", ())
    if hasattr(given, "plan"):  # a design
        source = replace(source, missed=tuple(found.message for found in given.findings))
    made = page.encode_page(
        f"{source.plan.part.file}: plan", _body(source, courses), styles=["plan.css"],
        scripts=["page.js", "figure.js", *(["course.js"] if courses else ())],
        stamp=f"{_stamp(source.sha256)}\n{SEAL}",
    )  # fmt: skip
    return seal(made)


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
    html = file.parent / _NAME
    if os.path.lexists(html):
        if html.is_file():
            shown_sha256, data = _sha256_of(read_plan(file)), read_file(html)
            begin = data[:_HEAD_BYTES]
            designed = _COURSE.encode() in data and shown_sha256.encode() in begin
            if designed or _stamp(shown_sha256).encode() in begin:
                return html
        if not (html.is_file() and is_sealed(html)):
            raise OutputError(
                f"{html}: was not written by planner, or was changed since, and is not replaced; "
                "move it elsewhere"
            )
    write_whole(html, plan_page(file))
    return html


_COURSE = 'id="course-frames"'

_HEAD_BYTES = 2048
"""The stamp stands within so many bytes of the page's beginning."""


def _stamp(plan_sha256: str) -> str:
    """Return what tells a page that is up to date: planner, the viewer, and the plan it shows."""
    viewer = hashlib.sha256("".join(map(page.asset, _ASSETS)).encode()).hexdigest()[:16]
    return f'<meta name="generator" content="planner {__version__} {viewer} {plan_sha256}">'


_ASSETS = (
    "base.css", "plan.css", "three.min.js", "THREE-LICENSE.txt", "viewer.js", "page.js",
    "figure.js",
)  # fmt: skip


def _body(source: _PlanSource, courses: "Sequence[Course]") -> Iterator[str]:
    """Yield the lines of the page."""
    plan = source.plan
    display = shown(source.shells)
    more: dict[str, Any] = {}
    frames = ""
    if courses:
        display, more["course"], frames = _course_data(courses, display, plan.part.translation_mm)
    colours = _colours([source])
    yield '<a class="skip" href="#figures">Skip the 3D view</a>'
    yield from _header(source)
    yield '<main>\n<div class="bench">'
    note = _simplified(display) if display.simplified else ""
    yield page.stage(f"The part {plan.part.file} in its materials", _in_words(plan), note)
    yield '<div class="panel">'
    placed = [(found.message, found.place_mm is not None) for found in plan.findings]
    missed = [(words, False) for words in plan_figure.unreachable_words(plan)]
    yield from page.findings_card([*missed, *placed, *((words, False) for words in source.missed)])
    if courses:
        yield from _course_controls(more["course"])
    yield page.section_controls([way["name"] for way in _cut_directions(plan)])
    yield from _materials(source, colours)
    yield page.asset("keys.html")
    yield '</div>\n</div>\n<div class="below" id="figures">'
    drawn, told = "modulus of what is printed there", "numbers"
    if plan.gradient.kind == "dither":
        drawn = "mean of each stretch, within which the shares of cells follow the target"
        told = "shares"
    yield from _figure(
        "stiffness",
        plan_figure.stiffness_figure(plan, colours),
        f"Dashed: the target. Thick: the {drawn}, with the interval that holds it with 95 % "
        f"probability. Below: the materials by their {told}.",
    )
    name = "table-title"
    yield from page.section(name, "Regions", _regions_table(plan, colours, name))
    yield from _remarks(plan)
    if source.howto.strip():
        # Its first line is a heading of its own: the section's.
        yield f'<section class="howto">\n{to_html(source.howto, top_level=2)}\n</section>'
    yield "</div>\n</main>"
    yield _footer(source, display)
    yield page.data_script("data", _viewer_data(source, display, colours) | more)
    yield page.data_script("geometry", page.geometry(display.shells))
    if courses:
        yield page.data_script("course-frames", frames)


# ------------------------------------------------------------------------------------------------
# What the viewer reads.


def _colours(sources: Sequence[_PlanSource]) -> dict[str, str]:
    """Return the colour in which each material of some plans is shown, from soft to hard."""
    own: dict[str, tuple[float, str]] = {}
    for source in sources:
        of = {region.printed: region.coordinate for region in source.plan.regions}
        for name, colour in zip(source.names, source.colours, strict=True):
            own.setdefault(name, (of[name], colour))
    names = sorted(own, key=lambda name: own[name][0])
    return dict(zip(names, colours_told_apart([own[name][1] for name in names]), strict=True))


def _viewer_data(source: _PlanSource, display: Shown, colours: Mapping[str, str]) -> dict[str, Any]:
    """Return what the viewer reads; shapes of a design follow the shells."""
    plan, names = source.plan, source.names
    numbers = {name: number for number, name in enumerate(colours, start=1)}
    points = np.concatenate([points for points, _ in display.shells[: len(names)]])
    looks = [(colours[name], name, numbers[name], _modulus_words(plan, name)) for name in names]
    looks += [("#2A9D8F", "wanted", 0, "")] * (len(display.shells) - len(names))
    shells = zip(display.shells, looks, strict=True)
    return {
        "origin": display.origin_mm.tolist(),
        "step": display.step_mm,
        "moved": list(plan.part.translation_mm),
        "size": (display.step_mm * points.max(axis=0).astype(float)).tolist(),
        "shells": [page.shell_data(points, faces, *look) for (points, faces), look in shells],
        "sections": list(_cut_directions(plan)),
        "findings": [
            {"number": number, "place": list(found.place_mm), "size": found.size_mm or 0.0}
            for number, found in enumerate(plan.findings, start=1 + len(plan.unreachable))
            if found.place_mm is not None
        ],
    }


def _modulus_words(plan: Plan, material: str) -> str:
    """Return the modulus of what is printed in a material, where it is the material's own."""
    regions = [region for region in plan.regions if region.printed == material]
    blended = any((region.blend or {}).get("kind") in ("dither", "bands") for region in regions)
    return "" if blended else f"{format_number(regions[0].modulus_MPa)} MPa"


def _cut_directions(plan: Plan) -> Iterator[dict[str, Any]]:
    """Yield ways to cut: name, normal, and where the zero that a user knows lies along it."""
    for k, (name, zero) in enumerate(zip("xyz", plan.part.translation_mm, strict=True)):
        yield {"name": name, "normal": [float(k == axis) for axis in range(3)], "zero": zero}
    field = plan.gradient.field
    direction, start = field.get("direction"), field.get("start_mm")
    if field.get("name") == "axis" and isinstance(direction, list) and isinstance(start, float):
        yield {"name": "along the field", "normal": [float(d) for d in direction], "zero": start}


# ------------------------------------------------------------------------------------------------
# The head of the page, and the view with its controls.


def _header(source: _PlanSource) -> Iterator[str]:
    plan = source.plan
    found = len(plan.findings) + len(plan.unreachable)
    failed = [name for name, check in plan.checks.items() if not check.ok]
    volume = plan.part.volume_mm3
    facts = (
        ("size, mm", " × ".join(_sizes(plan)), ""),
        ("volume, mm³", format_number(volume, 5), "")
        if volume < 1e5
        else ("volume, cm³", format_number(volume / 1000.0, 5), ""),
        ("mass, g", format_number(plan.mass_g, 4), ""),
        ("materials", str(len(source.names)), ""),
        ("checks that hold", f"{len(plan.checks) - len(failed)} of {len(plan.checks)}",
         "bad" if failed else "good"),
        ("findings", str(found), "bad" if found else "good"),
    )  # fmt: skip
    yield from page.head(plan.part.file, [escape(_wish_words(plan))], facts)


def _wish_words(plan: Plan) -> str:
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


def _simplified(display: Shown) -> str:
    shown, of = _thousands(display.triangles), _thousands(display.of)
    return f"Simplified for display alone: {shown} of {of} triangles"


def _thousands(count: int) -> str:
    """Write a count in groups of three digits, with narrow spaces that do not break."""
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def _sizes(plan: Plan) -> list[str]:
    return [format_number(b - a, 4) for a, b in zip(*plan.part.bounds_mm, strict=True)]


def _in_words(plan: Plan) -> str:
    """Say in words what the view shows."""
    first, last = (
        f"{'a blend with ' if r.blend and r.material else ''}{r.printed}, "
        f"{format_number(r.modulus_MPa)} MPa"
        for r in (plan.regions[0], plan.regions[-1])
    )
    return (
        f"The part is {' by '.join(_sizes(plan))} mm. It begins in {first}, and ends in {last}, "
        f"{_field_words(plan.gradient.field)}. The table below has every region."
    )


def _materials(source: _PlanSource, colours: Mapping[str, str]) -> Iterator[str]:
    volumes = dict.fromkeys(source.names, 0.0)
    for region in source.plan.regions:
        volumes[region.printed] += region.volume_mm3
    whole = sum(volumes.values()) or 1.0
    yield '<fieldset id="materials"><legend>Materials, from soft to hard</legend>'
    yield '<ul role="list">'
    told = {
        name: f'<span class="volume">{format_number(volume, 4)} mm³</span>'
        f'<span class="share">{100.0 * volume / whole:.1f} %</span>'
        for name, volume in volumes.items()
    }
    yield from _material_items(colours, told, _NAME_FITS)
    yield "</ul>"
    if tuple(colours.values()) != source.colours:
        yield (
            '<p class="note quiet">Colours run from soft (yellow) to hard (violet): the '
            "palette's own are too alike to be told apart.</p>"
        )
    yield page.asset("all.html")


def _material_items(
    colours: Mapping[str, str], more: Mapping[str, str], fits: float = math.inf
) -> Iterator[str]:
    """Yield each material with a box that shows it, and what more is said of it as HTML.

    Names of more letters than `fits` have a line of their own.
    """
    for number, (name, colour) in enumerate(colours.items(), start=1):
        long = ' class="long"' if len(name) > fits else ""
        yield (
            f'<li data-material="{number}"{long}><label><input type="checkbox" checked>'
            f'{_swatch(colour)}<span class="number">{number}</span>'
            f'<span class="name">{escape(name)}</span>{more[name]}</label></li>'
        )


_NAME_FITS = 16
"""Letters of a material's name that stand in a line with its volume."""


def _swatch(colour: str) -> str:
    """Return a square of a colour; without words, which stand beside it."""
    return page.filled("swatch.html", colour=colour)


# ------------------------------------------------------------------------------------------------
# Below the view: figure, table, checks, how to print.


def _figure(name: str, drawn: str, words: str) -> Iterator[str]:
    """Yield the section of a figure of the stiffness, explained in words whose id is NAME-words."""
    title, caption = f"{name}-title", f'<figcaption id="{name}-words">{words}</figcaption>'
    return page.section(title, "Stiffness along the field", page.figure(title, drawn, caption))


def _regions_table(
    plan: Plan, colours: Mapping[str, str], title: str, changed: Collection[int] = ()
) -> Iterator[str]:
    """Yield a plan's regions as a table, under what it says of their stiffness.

    Parameters
    ----------
    colours
        Of each material from soft to hard, as the page shows it.
    title
        Id of the heading above it.
    changed
        Rows to mark, from 0.
    """
    numbers = {name: number for number, name in enumerate(colours, start=1)}
    shown = plan_figure.plan_table(plan)
    yield f'<p class="quiet">{escape(shown.title)}</p>'
    for words in filter(None, (plan_figure.error_words(plan), plan_figure.moved_words(plan))):
        yield f'<p class="quiet">{escape(words)}</p>'
    rows = []
    for place, (region, row) in enumerate(zip(plan.regions, shown.rows, strict=True)):
        cells = {name: escape(row[name]) for name in shown.columns}
        cells["material"] = _swatch(colours[region.printed]) + cells["material"]
        mark = f' data-material="{numbers[region.printed]}"'
        if place in changed:
            mark += ' class="changed"'
            cells["#"] = f"<b>≠</b> {cells['#']}"
        rows.append((mark, tuple(cells.values())))
    heads = {"#": "no.", "volume mm3": "volume mm³"}
    columns = [(heads.get(n, n), "figure" if n in shown.right else "") for n in shown.columns]
    total = [escape(shown.total.get(name, "")) for name in shown.columns]
    yield from page.table(columns, rows, of=title, total=total)


def _remarks(plan: Plan) -> Iterator[str]:
    remarks = [*plan.part.repairs, *plan.warnings]
    items = "".join(f"<li>{escape(remark)}</li>\n" for remark in remarks)
    columns = (("check", ""), ("value", "figure"), ("limit", "figure"), ("holds", ""))
    rows = [
        ("", (escape(name), f"{c.value:.3g}", f"{c.limit:.3g}", "yes" if c.ok else "NO"))
        for name, c in plan.checks.items()
    ]
    notes = [f'<ul class="notes">\n{items}</ul>'] if remarks else []
    name = "checks-title"
    return page.section(name, "Checks and notes", [*notes, *page.table(columns, rows, of=name)])


def _footer(source: _PlanSource, display: Shown) -> str:
    plan = source.plan
    if display.simplified:
        shown = (
            f"{_simplified(display)}, "
            f"positions up to {display.moved_mm:.2g} mm from theirs. The files hold all."
        )
    else:
        shown = (
            f"Shown: all {_thousands(display.of)} triangles, positions rounded to "
            f"{display.moved_mm:.1g} mm for display; the files hold them whole."
        )
    return page.filled(
        "plan-footer.html", shown=shown, version=escape(plan.version), plan=source.sha256[:16],
        moved=", ".join(f"{t:.6g}" for t in plan.part.translation_mm),
        part=escape(plan.part.sha256[:16]),
        palette=escape(f"{plan.palette.name} {plan.palette.sha256[:16]}"),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------
# What the page of a design shows beside: the part from rest to full load.


_LEFT_SCALE = ("#F4F1DE", "#F2CC8F", "#E07A5F", "#B5374A", "#6D1A36")
"""From nothing left to the most: lightness falls all the way."""

_MOST_WANTED = 20_000
"""Of a wanted shape, of which the sharp edges are drawn alone."""


def _course_data(
    courses: "Sequence[Course]", display: Shown, moved_mm: Point
) -> tuple[Shown, dict[str, Any], str]:
    """Return what the viewer shows of a design.

    Returns
    -------
    display : Shown
        The shells, and behind them the shapes that are wanted, on a grid that holds all frames.
    document
        What the viewer's JSON holds of the course.
    frames : str
        Places and values of all frames, in base64.
    """
    shift = np.array(moved_mm)
    printed = [display.origin_mm + display.step_mm * points for points, _ in display.shells]
    frames: list[tuple[str, int | None, list[FloatArray], list[FloatArray]]] = []
    shapes: list[tuple[FloatArray, Any]] = []
    top = max((float(c.off_mm.max()) for c in courses if c.off_mm is not None), default=0.0)
    for course in courses:
        number = None
        if course.wanted is not None:
            number = len(display.shells) + len(shapes)
            kept, faces = thinned(course.wanted.vertices, course.wanted.faces, _MOST_WANTED)
            shapes.append((course.wanted.vertices[kept] + shift, faces))
        off = [_left(course, places - shift, top) for places in printed]
        flat = course.displacement_mm.transpose(1, 0, 2).reshape(-1, 3 * len(course.share))
        moves = [course.cells.interpolated(places - shift, flat) for places in printed]
        for k, share in enumerate(course.share):
            places = [p + m[:, 3 * k : 3 * k + 3] for p, m in zip(printed, moves, strict=True)]
            name = f"{course.case}, " if course.case else ""
            frames.append((f"{name}load {share:.3g}", number, places, off))
    everything = [p for _, _, places, _ in frames for p in places] + [p for p, _ in shapes]
    grid = ScreenGrid.over(everything)
    drawn = [*zip(printed, (f for _, f in display.shells), strict=True), *shapes]
    shells = tuple((grid.counts(p).astype(np.uint16), f) for p, f in drawn)
    parts = [
        grid.counts(p).astype("<u2").tobytes() + np.rint(255.0 * v).astype("u1").tobytes()
        for _, _, places, off in frames
        for p, v in zip(places, off, strict=True)
    ]
    document = {
        "printed": len(printed),
        "frames": [{"text": text, "shape": number} for text, number, *_ in frames],
        "scale": ramp(_LEFT_SCALE, range(5), np.linspace(0.0, 4.0, 256)),
        "top_mm": top,
    }
    # The last frame of the first case is what the slider begins with; the grid holds all of them.
    seen = replace(display, origin_mm=grid.origin_mm, step_mm=grid.step_mm, shells=shells)
    return seen, document, page.packed(parts)


def _left(course: "Course", places_mm: FloatArray, top: float) -> FloatArray:
    """Return how far the surface nearest to places is off what is wanted, over the most."""
    from scipy.spatial import KDTree

    if course.off_mm is None or top <= 0.0:
        return np.zeros(len(places_mm))
    nearest = KDTree(course.cells.surface.vertices).query(places_mm)[1]
    return np.asarray(course.off_mm[nearest] / top)


def _course_controls(document: dict[str, Any]) -> Iterator[str]:
    """Yield the slider and what stands beside it."""
    frames = document["frames"]
    last = next(k for k in reversed(range(len(frames))) if frames[k]["shape"] == frames[0]["shape"])
    yield page.filled("load.html", name="course-", last=f"{len(frames) - 1}", value=f"{last}")
    if any(frame["shape"] is not None for frame in frames):
        words = f"what is left, up to {document['top_mm']:.3g} mm"
        yield page.filled("wanted.html", words=words, bar=page.scale_bar(_LEFT_SCALE))
    else:
        yield '<input type="checkbox" id="course-wanted" hidden>'
    yield "</fieldset>"


# ------------------------------------------------------------------------------------------------
# Two plans side by side on one page that needs nothing else.


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
    >>> from pathlib import Path  # doctest: +SKIP
    >>> page = planner.compare_page("finger-graded", "five-bands")  # doctest: +SKIP
    >>> Path("compare.html").write_bytes(page)  # doctest: +SKIP
    """
    sources = (_source_of(before), _source_of(after))
    found = diff(sources[0].plan, sources[1].plan, tolerance=tolerance)
    title = " and ".join(dict.fromkeys(source.plan.part.file for source in sources))
    return page.encode_page(
        f"{title}: two plans", _compared(title, sources, found),
        styles=["plan.css"], scripts=["compare.js", "figure.js"],
    )  # fmt: skip


def _compared(
    title: str, sources: Sequence[_PlanSource], found: Sequence[Difference]
) -> Iterator[str]:
    colours = _colours(sources)
    plans = [source.plan for source in sources]
    yield '<a class="skip" href="#differences">Skip the 3D views</a>'
    sides = zip(_SIDES, plans, strict=True)
    below = [f"<b>{side}</b> {escape(_wish_words(plan))}" for side, plan in sides]
    yield from page.head(f"{title}: two plans", below)
    yield '<main>\n<div class="pair">'
    displays = [shown(source.shells) for source in sources]
    for side, plan in zip(_SIDES, plans, strict=True):
        yield page.filled("side.html", side=side, part=escape(plan.part.file))
    yield "</div>"
    items = _material_items(colours, {name: _sides_of(name, sources) for name in colours})
    controls = f"{page.section_controls('xyz')}\n{page.asset('keys.html')}"
    yield page.filled("shared.html", controls=controls, materials="\n".join(items))
    yield '<div class="below" id="differences">'
    yield from _differences(found)
    drawn = plan_figure.both_figure(plans[0], plans[1], "curves-words")
    words = "Dashed: the targets. Thick: the moduli of what is printed there; A is drawn wider."
    yield from _figure("curves", drawn, words)
    rows = [[tuple(row.values()) for row in plan_figure.plan_table(plan).rows] for plan in plans]
    for side, plan, mine, other in zip(_SIDES, plans, rows, reversed(rows), strict=True):
        changed = [k for k, row in enumerate(mine) if k >= len(other) or row != other[k]]
        name = f"regions-{side}"
        marked = '<p class="quiet">≠ marks a region that the other plan has not.</p>'
        regions = _regions_table(plan, colours, name, changed)
        body = [marked, *regions] if changed else regions
        yield from page.section(name, f"Regions of {side}", body)
    yield "</div>\n</main>\n<footer>"
    for side, source in zip(_SIDES, sources, strict=True):
        made = f"planner {escape(source.plan.version)}, plan.json {source.sha256[:16]}"
        yield f"<p>{side}: {made}</p>"
    yield "</footer>"
    for side, source, display in zip(_SIDES, sources, displays, strict=True):
        yield page.data_script(f"data-{side}", _viewer_data(source, display, colours))
        yield page.data_script(f"geometry-{side}", page.geometry(display.shells))


def _sides_of(name: str, sources: Sequence[_PlanSource]) -> str:
    """Say which of two plans have a material."""
    sides = [side for side, source in zip(_SIDES, sources, strict=True) if name in source.names]
    words = "A and B" if len(sides) > 1 else f"{sides[0]} alone"
    return f'<span class="volume">{words}</span>'


def _differences(found: Sequence[Difference]) -> Iterator[str]:
    name, title = "differences-title", f"What differs{f' ({len(found)})' if found else ''}"
    if not found:
        return page.section(name, title, ["<p>The plans mean the same.</p>"])
    columns = [(words, "words") for words in ("what", "where", "A", "B")]
    rows = [("", [escape(w) for w in (d.what, d.where, d.before, d.after)]) for d in found]
    return page.section(name, title, page.table(columns, rows, of=name))
