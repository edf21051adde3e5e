"""The folder of a diagnosis: report.html, figures and tables."""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from planner import __version__
from planner.formats.files import FolderKind, new_folder
from planner.gap.diagnosis import Diagnosis
from planner.report.gap_figures import figures_of
from planner.report.gap_text import (
    TextSection,
    axis_words,
    headline,
    id_of,
    meaning,
    number_words,
    percent,
    probability,
    scope,
    setting,
    title,
    verdict_sections,
)

__all__ = ["DIAGNOSIS", "diagnosis_files", "write_diagnosis"]


# ------------------------------------------------------------------------------------------------
# The figures of a diagnosis in rows: as CSV for a spreadsheet, and as tables of the page.


_SIGNIFICANT_DIGITS = 6


@dataclass(frozen=True, slots=True)
class Table:
    """A heading, columns and rows of text; `figures` are columns that stand flush right."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    figures: tuple[str, ...] = ()


def _ranking_csv(diagnosis: Diagnosis) -> bytes:
    """Return the hypotheses, most probable first."""
    return _csv(
        ("hypothesis", "probability", "with_unknown", "same_class"),
        (
            (id_of(h.effects), h.probability, h.with_unknown, h.effects in diagnosis.same_class)
            for h in diagnosis.ranking
        ),
    )


def _where_csv(diagnosis: Diagnosis) -> bytes:
    """Return the axes of the gap, then those of what remains after the verdict's effects."""
    return _csv(
        ("of", "axis", "share", "share_low", "share_high", "p", "detail"),
        (
            (of, place.axis, place.share, *place.share_interval, place.p, place.detail)
            for of, places in (("gap", diagnosis.where), ("remainder", diagnosis.remainder))
            for place in places
        ),
    )


def _page_tables(diagnosis: Diagnosis) -> Iterator[Table]:
    """Yield the tables of the report, empty ones left out."""
    for table in (
        _ranking(diagnosis),
        _parameters(diagnosis),
        _where(diagnosis),
        _errors(diagnosis),
        _recalibration(diagnosis),
        _detectable(diagnosis),
        _untestable(diagnosis),
        _experiments(diagnosis),
        _quality(diagnosis),
    ):
        if table.rows:
            yield table


def _ranking(d: Diagnosis) -> Table:
    rows = [
        (
            id_of(h.effects),
            probability(h.probability),
            percent(h.with_unknown),
            "yes" if h.effects in d.same_class else "",
        )
        for h in d.ranking
    ]
    columns = ("hypothesis", "probability", "of it with an unknown", "same class as the verdict")
    return Table("Explanations weighed", columns, tuple(rows), columns[1:3])


def _parameters(d: Diagnosis) -> Table:
    rows = []
    for effect in d.effect:
        for name, value in effect.parameters.items():
            ends = effect.interval.get(name)
            unit = effect.units.get(name, "1")
            rows.append(
                (
                    effect.id,
                    effect.form,
                    name,
                    meaning(effect.id, effect.form, name),
                    number_words(value),
                    "" if ends is None else _interval(ends),
                    "" if unit == "1" else unit,
                )
            )
    columns = ("effect", "form", "parameter", "meaning", "value", "90 % interval", "unit")
    return Table("Size of the effects", columns, tuple(rows), ("value",))


def _where(d: Diagnosis) -> Table:
    rows = [
        (of, axis_words(p.axis), percent(p.share), f"{percent(low)} to {percent(high)}",
         number_words(p.p, 2), p.detail)
        for of, places in (("gap", d.where), ("remainder", d.remainder))
        for p in places
        for low, high in (p.share_interval,)
    ]  # fmt: skip
    columns = ("of", "along", "share", "90 % interval", "p", "detail")
    return Table("Where it lies", columns, tuple(rows), ("share", "p"))


def _errors(d: Diagnosis) -> Table:
    gap = d.gap
    named = (
        ("palette alone", gap.before),
        ("laws refitted, no effect", gap.recalibration_only),
        ("flexible regression", gap.generic),
        ("with the effects", gap.after),
        ("between replicates (floor)", gap.floor),
    )
    rows = [(words, "not known" if v is None else percent(v, 3)) for words, v in named]
    if gap.closed is not None:
        ends = gap.closed_interval
        within = "" if ends is None else f" ({percent(ends[0])} to {percent(ends[1])})"
        rows.append(("closed", f"{percent(gap.closed)}{within}"))
    return Table("Error of force, on data held out", ("model", "error"), tuple(rows), ("error",))


def _recalibration(d: Diagnosis) -> Table:
    rows = [
        (
            material,
            number_words(math.exp(factor)),
            " to ".join(number_words(math.exp(factor + z * sd)) for z in (-1.645, 1.645)),
        )
        for material, (factor, sd) in d.recalibration.items()
    ]
    columns = ("material", "factor on the law's stress", "90 % interval")
    return Table("What the data ask of the laws besides", columns, tuple(rows), columns[1:2])


def _detectable(d: Diagnosis) -> Table:
    rows = [
        (
            s.id,
            s.parameter,
            meaning(s.id, "", s.parameter),
            "none within its bounds" if s.size is None else number_words(s.size),
            "" if s.unit == "1" else s.unit,
        )
        for s in d.detectable
    ]
    columns = ("effect", "parameter", "meaning", "smallest seen", "unit")
    return Table("What this campaign could have seen", columns, tuple(rows), columns[3:4])


def _untestable(d: Diagnosis) -> Table:
    rows = [(u.id, title(u.id), u.reason) for u in d.not_testable]
    return Table("What it could not test", ("effect", "what it is", "because"), tuple(rows))


def _experiments(d: Diagnosis) -> Table:
    rows = [
        (
            x.detail or ", ".join(setting(key, value) for key, value in x.change.items()),
            "; ".join(f"{a} from {b}" for a, b in x.splits),
            number_words(x.expected_gain_nats, 2),
            number_words(x.hours, 2),
        )
        for x in d.next_experiments
    ]
    columns = ("test", "tells", "expected gain, nats", "hours")
    return Table("What to test next", columns, tuple(rows), columns[2:])


def _quality(d: Diagnosis) -> Table:
    rows = [(q.specimen or "all", q.kind, q.problem) for q in d.data_quality]
    return Table("Data to look at", ("specimen", "kind", "problem"), tuple(rows))


def _interval(ends: tuple[float, float]) -> str:
    return f"{number_words(ends[0])} to {number_words(ends[1])}"


def _csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_cell(value) for value in row])
    return text.getvalue().encode("utf-8")


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value + 0.0:.{_SIGNIFICANT_DIGITS}g}" if math.isfinite(value) else ""
    return str(value)


# ------------------------------------------------------------------------------------------------
# report.html: verdict, figures and tables on one page that needs nothing else.


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


def _page(diagnosis: Diagnosis, figures: Mapping[str, bytes]) -> bytes:
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
    for table in _page_tables(d):
        yield from _table(table)
    yield "</main>\n<footer>"
    yield f"<p>planner {escape(__version__)}, seed {d.seed}</p>"
    yield f"<p>palette {escape(d.palette)}, sha256 {escape(d.palette_sha256)}</p>"
    yield "</footer>\n</body>\n</html>\n"


def _section(section: TextSection) -> Iterator[str]:
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


# ------------------------------------------------------------------------------------------------
# The folder of a diagnosis.


DIAGNOSIS = FolderKind(
    "diagnosis.json",
    ("diagnosis.json", "report.html", "where.csv", "ranking.csv", "figures/*.svg"),
)
"""The folder that `write_diagnosis` writes."""


def diagnosis_files(diagnosis: Diagnosis) -> dict[str, bytes]:
    """Return the content of each file by its path; the same diagnosis gives the same bytes."""
    figures = figures_of(diagnosis)
    return {
        "diagnosis.json": diagnosis.json(),
        "report.html": _page(diagnosis, figures),
        "where.csv": _where_csv(diagnosis),
        "ranking.csv": _ranking_csv(diagnosis),
        **{f"figures/{name}.svg": svg for name, svg in figures.items()},
    }


def write_diagnosis(diagnosis: Diagnosis, output: str | Path, *, force: bool = False) -> Path:
    """Write diagnosis.json, report.html, where.csv, ranking.csv and figures, all or nothing.

    Parameters
    ----------
    output
        Folder to write.
    force
        Replace a folder that an earlier diagnosis wrote.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    OutputError
        The folder may not be written; see `planner.formats.files.check_target`.

    Examples
    --------
    >>> planner.write_diagnosis(planner.diagnose("lab"), "diagnosis")  # doctest: +SKIP
    """
    files = diagnosis_files(diagnosis)
    with new_folder(output, force=force, kind=DIAGNOSIS) as scratch:
        (scratch / "figures").mkdir()
        for name, content in files.items():
            (scratch / name).write_bytes(content)
    return Path(output)
