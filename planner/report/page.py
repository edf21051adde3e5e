"""What every page shares: its head, styles, scripts and data, all within it; tables, 3D views."""

import base64
import hashlib
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from html import escape
from importlib import resources
from typing import Any

from planner.formats.files import encode_document
from planner.numerics import IntArray

__all__ = [
    "KEYS",
    "asset",
    "begin",
    "data_script",
    "end",
    "figure",
    "findings_card",
    "geometry",
    "head",
    "load_slider",
    "packed",
    "scale_bar",
    "section",
    "section_controls",
    "shell_data",
    "stage",
    "table",
    "viewer_scripts",
]


@cache
def asset(name: str) -> str:
    """Return a file of the viewer, with the same line ends everywhere."""
    file = resources.files("planner.report").joinpath("viewer", name)
    return "\n".join(file.read_text(encoding="utf-8").splitlines()).strip()


def begin(
    title: str, *, styles: Sequence[str], scripts: Sequence[str], stamp: str = "", kind: str = ""
) -> Iterator[str]:
    """Yield a page's lines up to its body, which may load nothing and run no other scripts.

    Parameters
    ----------
    styles
        Names of style sheets; base.css comes before them.
    scripts
        Texts of the scripts that `end` writes.
    stamp
        An element that tells what the page was made of.
    kind
        Class of the body, for the styles.
    """
    allowed = " ".join(f"'sha256-{_integrity(script)}'" for script in scripts)
    sheets = "\n".join(asset(name) for name in ("base.css", *styles))
    yield '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    if stamp:
        yield stamp
    yield (
        f'<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        f"script-src {allowed}; style-src 'unsafe-inline'; base-uri 'none'; "
        "form-action 'none'\">"
    )
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    yield f"<title>{escape(title)}</title>"
    yield f"<style>\n{sheets}\n</style>\n</head>"
    yield f'<body class="{kind}">' if kind else "<body>"


def end(scripts: Sequence[str]) -> str:
    """Return the end of a page: its scripts."""
    return "\n".join(f"<script>{script}</script>" for script in scripts) + "\n</body>\n</html>\n"


def _integrity(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode()


def packed(parts: Iterable[bytes]) -> str:
    """Return parts that each begin at a multiple of four bytes, in base64."""
    return base64.b64encode(b"".join(part + bytes(-len(part) % 4) for part in parts)).decode()


def data_script(name: str, document: Any) -> str:
    """Return a script element that holds JSON for the viewer, safe within it."""
    data = encode_document(document).decode().strip().replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{data}</script>'


def head(
    title: str, below: Iterable[str], facts: Iterable[tuple[str, str, str]] = ()
) -> Iterator[str]:
    """Yield the head of a page.

    Parameters
    ----------
    below
        What stands under the title, as HTML.
    facts
        Figures beside it: name, value, and the class of the value, as ``good`` or ``bad``.
    """
    yield f"<header>\n<div>\n<h1>{escape(title)}</h1>"
    yield from (f'<p class="quiet">{words}</p>' for words in below)
    yield "</div>"
    shown = [
        f'<div><dt>{escape(name)}</dt><dd class="{kind}">{escape(value)}</dd></div>'
        for name, value, kind in facts
        if value
    ]
    if shown:
        yield '<dl class="facts">\n' + "\n".join(shown) + "\n</dl>"
    yield "</header>"


def section(name: str, title: str, body: Iterable[str]) -> Iterator[str]:
    """Yield a section under a heading, whose id is `name`."""
    yield f'<section aria-labelledby="{name}">\n<h2 id="{name}">{escape(title)}</h2>'
    yield from body
    yield "</section>"


def figure(name: str, drawn: str, caption: str = "") -> Iterator[str]:
    """Yield an SVG that may be wider than the page, of the section `name`; caption as HTML."""
    yield f'<figure>\n<div class="wide" tabindex="0" role="group" aria-labelledby="{name}">'
    yield f"{drawn}\n</div>{caption}\n</figure>"


def table(
    columns: Iterable[tuple[str, str]],
    rows: Iterable[tuple[str, Sequence[str]]],
    *,
    of: str = "",
    total: Sequence[str] = (),
) -> Iterator[str]:
    """Yield a table that may be wider than the page, of the section whose id is given.

    Parameters
    ----------
    columns
        Heading and class of each.
    rows, total
        Attributes of each row with its cells, as HTML; and the cells of the last, if there is one.
    """
    heads = [(escape(words), f' class="{kind}"' if kind else "") for words, kind in columns]
    kinds = [kind for _, kind in heads]

    def cells(values: Sequence[str]) -> str:
        return "".join(f"<td{k}>{value}</td>" for k, value in zip(kinds, values, strict=True))

    label = f'aria-labelledby="{of}"' if of else 'aria-label="Table"'
    yield f'<div class="wide" tabindex="0" role="group" {label}>\n<table>'
    row = "".join(f'<th scope="col"{kind}>{words}</th>' for words, kind in heads)
    yield f"<thead><tr>{row}</tr></thead>\n<tbody>"
    yield from (f"<tr{mark}>{cells(values)}</tr>" for mark, values in rows)
    yield "</tbody>"
    if total:
        yield f"<tfoot><tr>{cells(total)}</tr></tfoot>"
    yield "</table>\n</div>"


def findings_card(messages: Sequence[tuple[str, bool]]) -> Iterator[str]:
    """Yield findings by number; those that have a place in the view are buttons that lead to it."""
    if not messages:
        return
    yield '<section class="card" id="findings" aria-labelledby="findings-title">'
    yield f'<h2 id="findings-title">Findings ({len(messages)})</h2>\n<ol role="list">'
    for number, (message, placed) in enumerate(messages, start=1):
        if placed:
            yield (
                f'<li><button type="button" aria-pressed="false"><b>{number}</b>'
                f"<span>{escape(message)}</span></button></li>"
            )
        else:
            yield f'<li class="plain">{escape(message)}</li>'
    yield "</ol>\n</section>"


# ------------------------------------------------------------------------------------------------
# The 3D view: its scripts, its frame and controls, and what it reads of each shell.


def viewer_scripts(*names: str) -> tuple[str, str]:
    """Return the scripts of a page with a 3D view: the library, under its licence, and our own."""
    licence = asset("THREE-LICENSE.txt")
    head = f"/* three.js r187, bundled by esbuild.\n\n{licence}\n*/\n"
    own = "\n".join(map(asset, ("viewer.js", *names)))
    return f"{head}{asset('three.min.js')}\n", f"{own}\n"


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


def section_controls(ways: Sequence[str]) -> Iterator[str]:
    """Yield the controls of the section, by the names of the ways to cut."""
    yield '<fieldset id="section" data-needs-view hidden><legend>Section</legend><div class="ways">'
    yield '<label><input type="radio" name="section" value="off" checked> none</label>'
    for name in ways:
        yield f'<label><input type="radio" name="section" value="{name}"> {name}</label>'
    yield '</div>\n<div class="slide">'
    yield _slider("section-place", 1000, 500, "disabled", "Place of the section")
    yield '<output id="section-words" for="section-place"></output>'
    yield (
        '<label class="tick"><input type="checkbox" id="section-flip" disabled> show the other '
        "side</label></div></fieldset>"
    )


def _slider(name: str, most: int, value: int, state: str, label: str) -> str:
    return (
        f'<input type="range" id="{name}" min="0" max="{most}" value="{value}" {state} '
        f'aria-label="{label}">'
    )


def load_slider(name: str, count: int, value: int) -> Iterator[str]:
    """Yield the beginning of the controls of a load: which of so many steps is seen, in words."""
    yield '<fieldset id="load" data-needs-view hidden><legend>Load</legend><div class="slide">'
    yield _slider(f"{name}step", count - 1, value, 'step="1"', "Step of the load")
    yield f'<output id="{name}step-words" for="{name}step"></output></div>'


def scale_bar(colours: Iterable[str]) -> str:
    """Return a strip of colours that run into each other."""
    ramp = ",".join(colours)
    return f'<div class="scale" style="background:linear-gradient(90deg,{ramp})"></div>'


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
