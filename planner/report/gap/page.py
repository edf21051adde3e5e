"""report.html: verdict, figures and tables on one page that needs nothing else."""

from collections.abc import Iterator, Mapping
from html import escape

from planner import __version__
from planner.gap.diagnosis import Diagnosis
from planner.report.gap.tables import Table, page_tables
from planner.report.gap.verdict_text import Section, headline, scope, verdict_sections

__all__ = ["page"]

_STYLE = """
:root { color-scheme: light dark; --ink: #1d2126; --quiet: #5c6570; --ground: #ffffff;
  --line: #d9dde2; --card: #f4f6f8; --found: #1f5fa8; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8ea; --quiet: #a3abb4;
  --ground: #16191d; --line: #363c43; --card: #20252b; --found: #8ab8ee; } }
body { margin: 0 auto; padding: 2rem 1.25rem 4rem; max-width: 60rem; color: var(--ink);
  background: var(--ground); font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.5rem; line-height: 1.25; margin: 0 0 .25rem; color: var(--found); }
h2 { font-size: 1.1rem; margin: 1.75rem 0 .4rem; }
p, ul { margin: .3rem 0; max-width: 46rem; }
ul { padding-left: 1.2rem; }
.quiet { color: var(--quiet); }
figure { margin: 1.25rem 0; padding: .5rem; background: #ffffff; border: 1px solid var(--line);
  border-radius: 6px; overflow-x: auto; }
figure svg { display: block; max-width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; margin: .3rem 0; }
th, td { text-align: left; vertical-align: top; padding: .25rem .75rem .25rem 0;
  border-bottom: 1px solid var(--line); }
th { font-weight: 600; color: var(--quiet); }
td.figure, th.figure { text-align: right; font-variant-numeric: tabular-nums; }
footer { margin-top: 2.5rem; padding-top: .75rem; border-top: 1px solid var(--line);
  font-size: .85rem; color: var(--quiet); overflow-wrap: anywhere; }
@media print { :root { color-scheme: light; --ink: #000000; --quiet: #444444;
  --ground: #ffffff; --line: #bbbbbb; --found: #000000; }
  body { max-width: none; padding: 0; font-size: 10.5pt; }
  figure, tr { break-inside: avoid; } h2 { break-after: avoid; }
  figure { border: 0; padding: 0; } .wide { overflow: visible; } }
"""

_ORDER = ("residuals", "evidence", "closure", "curves")
"""Figures that come after the sections, by name; others follow in their own order."""


def page(diagnosis: Diagnosis, figures: Mapping[str, bytes]) -> bytes:
    """Return the page.

    Parameters
    ----------
    figures
        SVG by name.
    """
    return "\n".join(_lines(diagnosis, figures)).encode("utf-8")


def _lines(diagnosis: Diagnosis, figures: Mapping[str, bytes]) -> Iterator[str]:
    d = diagnosis
    yield '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    yield f"<title>{escape(d.campaign)}: {escape(d.verdict)}</title>"
    yield f"<style>{_STYLE}</style>\n</head>\n<body>"
    yield f"<header>\n<h1>{escape(headline(d))}</h1>"
    yield f'<p class="quiet">{escape(scope(d))}</p>\n</header>\n<main>'
    for section in verdict_sections(d):
        yield from _section(section)
    if figures:
        yield "<h2>Figures</h2>"
    for name in sorted(figures, key=lambda n: (_ORDER.index(n) if n in _ORDER else 99, n)):
        yield f"<figure>\n{figures[name].decode('utf-8').strip()}\n</figure>"
    for table in page_tables(d):
        yield from _table(table)
    yield "</main>\n<footer>"
    yield f"<p>planner {escape(__version__)}, seed {d.seed}</p>"
    yield f"<p>palette {escape(d.palette)}, sha256 {escape(d.palette_sha256)}</p>"
    yield "</footer>\n</body>\n</html>\n"


def _section(section: Section) -> Iterator[str]:
    yield f"<h2>{escape(section.heading)}</h2>"
    if section.is_list:
        items = "".join(f"<li>{escape(sentence)}</li>\n" for sentence in section.sentences)
        yield f"<ul>\n{items}</ul>"
    else:
        yield f"<p>{escape(' '.join(section.sentences))}</p>"


def _table(table: Table) -> Iterator[str]:
    kinds = [' class="figure"' if c in table.figures else "" for c in table.columns]
    yield f'<h2>{escape(table.heading)}</h2>\n<div class="wide">\n<table>\n<thead><tr>'
    heads = zip(table.columns, kinds, strict=True)
    yield "".join(f'<th scope="col"{kind}>{escape(words)}</th>' for words, kind in heads)
    yield "</tr></thead>\n<tbody>"
    for row in table.rows:
        cells = zip(row, kinds, strict=True)
        yield f"<tr>{''.join(f'<td{kind}>{escape(cell)}</td>' for cell, kind in cells)}</tr>"
    yield "</tbody>\n</table>\n</div>"
