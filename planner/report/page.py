"""What every page shares: its head, styles, scripts and data, all within it; sections, tables."""

import base64
import hashlib
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from html import escape
from importlib import resources
from typing import Any

from planner.formats.files import encode_document

__all__ = [
    "asset",
    "begin",
    "data_script",
    "end",
    "figure",
    "findings_card",
    "head",
    "packed",
    "section",
    "table",
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
