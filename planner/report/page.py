"""What every page shares: its head, styles, scripts and data, all within it; tables, 3D views."""

import base64
import hashlib
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from html import escape
from importlib import resources
from string import Template
from typing import Any

from planner.formats.files import encode_document
from planner.numerics import IntArray

__all__ = [
    "asset",
    "data_script",
    "encode_page",
    "figure",
    "filled",
    "findings_card",
    "geometry",
    "head",
    "packed",
    "scale_bar",
    "section",
    "section_controls",
    "shell_data",
    "stage",
    "table",
]


@cache
def asset(name: str) -> str:
    """Return a file of the viewer, with the same line ends everywhere."""
    file = resources.files("planner.report").joinpath("viewer", name)
    return "\n".join(file.read_text(encoding="utf-8").splitlines()).strip()


def encode_page(
    title: str,
    body: Iterable[str],
    *,
    styles: Sequence[str],
    scripts: Sequence[str],
    view: bool = True,
    stamp: str = "",
    kind: str = "",
) -> bytes:
    """Return a page, which loads nothing and runs no other scripts than its own.

    Parameters
    ----------
    body
        Its lines.
    styles, scripts
        Names of files of the viewer; base.css comes before the styles.
    view
        Whether it has a 3D view: then library and viewer.js come before the scripts.
    stamp
        An element that tells what the page was made of.
    kind
        Class of the body, for the styles.
    """
    own = "\n".join(map(asset, ("viewer.js", *scripts) if view else scripts))
    texts = (*([_library()] if view else []), f"{own}\n")
    hashes = (hashlib.sha256(text.encode("utf-8")).digest() for text in texts)
    allowed = " ".join(f"'sha256-{base64.b64encode(each).decode()}'" for each in hashes)
    sheets = "\n".join(asset(name) for name in ("base.css", *styles))
    whole = filled(
        "page.html", stamp=stamp and f"{stamp}\n", allowed=allowed, title=escape(title),
        sheets=sheets, kind=kind and f' class="{kind}"', body="\n".join(body),
        scripts="\n".join(f"<script>{text}</script>" for text in texts),
    )  # fmt: skip
    return f"{whole}\n".encode()


def _library() -> str:
    """Return the library of the 3D view, under its licence."""
    licence = asset("THREE-LICENSE.txt")
    return f"/* three.js r187, bundled by esbuild.\n\n{licence}\n*/\n{asset('three.min.js')}\n"


def packed(parts: Iterable[bytes]) -> str:
    """Return parts that each begin at a multiple of four bytes, in base64."""
    return base64.b64encode(b"".join(part + bytes(-len(part) % 4) for part in parts)).decode()


def data_script(name: str, content: Any) -> str:
    """Return a script element that holds base64 text or a document (as JSON) for the viewer."""
    kind, text = "text/plain", content
    if not isinstance(content, str):
        kind = "application/json"
        text = encode_document(content).decode().strip().replace("<", "\\u003c")
    return f'<script type="{kind}" id="{name}">{text}</script>'


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
    button = '<li><button type="button" aria-pressed="false"><b>{}</b><span>{}</span></button></li>'
    for number, (message, placed) in enumerate(messages, start=1):
        shown = button if placed else '<li class="plain">{1}</li>'
        yield shown.format(number, escape(message))
    yield "</ol>\n</section>"


# ------------------------------------------------------------------------------------------------
# The 3D view: its frame and controls, and what it reads of each shell.


def filled(name: str, /, **words: str) -> str:
    """Return a file of the viewer with words in their places, as HTML."""
    return Template(asset(name)).substitute(words)


_NO_VIEW = (
    "The figures, the table and the how-to below are whole; the .3mf opens in any 3D program."
)


def stage(label: str, words: str, note: str = "", no_view: str = _NO_VIEW) -> str:
    """Return the 3D view with what lies over it.

    Parameters
    ----------
    label, words
        What it is called, and what it shows, for those who do not see it.
    note
        HTML that stands in its corner.
    no_view
        What to look at where there is none.
    """
    told = f'\n<p class="read" id="simplified">{note}</p>' if note else ""
    return filled(
        "stage.html", label=escape(label), words=escape(words), note=told, no_view=no_view
    )


def section_controls(ways: Sequence[str]) -> str:
    """Return the controls of the section, by the names of the ways to cut."""
    choice = '<label><input type="radio" name="section" value="{0}"> {0}</label>'
    return filled("section.html", ways="\n".join(map(choice.format, ways)))


def scale_bar(colours: Iterable[str]) -> str:
    """Return a strip of colours that run into each other."""
    ramp = ",".join(colours)
    return f'<div class="scale" style="background:linear-gradient(90deg,{ramp})"></div>'


def shell_data(
    points: IntArray, faces: IntArray, colour: str, name: str, number: int = 1, modulus: str = ""
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
