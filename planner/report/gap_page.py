"""The folder of a diagnosis: report.html, figures and tables."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from string import ascii_lowercase

from planner import __version__
from planner.formats.outputs import new_folder
from planner.formats.tables import encode_csv
from planner.gap.diagnosis import PALETTE_FILE, Diagnosis
from planner.gap.summary import (
    best_of,
    percent,
    probability,
    summary_of,
)
from planner.palette import encode_palette
from planner.report.gap_figures import figures_of
from planner.report.gap_text import (
    Table,
    TextSection,
    headline,
    scope,
    verdict_sections,
)
from planner.report.page import asset, begin, end, head, table

__all__ = ["diagnosis_files", "write_diagnosis"]


# ------------------------------------------------------------------------------------------------
# The figures of a diagnosis in rows, as CSV for a spreadsheet.


_SIGNIFICANT_DIGITS = 6


def _csv_files(d: Diagnosis) -> dict[str, bytes]:
    """Return tables by path: axes, hypotheses, specimens to be tested next, designs of bars."""
    places = [
        (of, place.axis, place.share, *place.share_interval, place.p, place.detail)
        for of, found in (("gap", d.where), ("remainder", d.remainder))
        for place in found
    ]
    ranking = [
        (h.name, h.probability, h.with_unknown, h.effects in d.same_class) for h in d.ranking
    ]
    columns = list(dict.fromkeys(name for x in d.next_experiments for name in x.row))
    specimens = [
        (f"next-{number}{ascii_lowercase[copy]}", *(x.row.get(name, "") for name in columns))
        for number, x in enumerate(d.next_experiments, start=1)
        for copy in range(x.count if x.row else 0)
    ]
    tables: dict[str, Sequence[Sequence[str | float]]] = {
        "where.csv": [("of", "axis", "share", "share_low", "share_high", "p", "detail"), *places],
        "ranking.csv": [("hypothesis", "probability", "with_unknown", "same_class"), *ranking],
        **({"next-specimens.csv": [("specimen", *columns), *specimens]} if columns else {}),
        **{
            str(x.row["profile"]): [tuple(x.design), *zip(*x.design.values(), strict=True)]
            for x in d.next_experiments
            if x.design
        },
    }
    return {path: encode_csv(rows, _SIGNIFICANT_DIGITS) for path, rows in tables.items()}


_FLUSH_RIGHT = {
    "probability", "with an unknown beside it", "share", "p", "error",
    "factor on the law's stress", "no.", "mm/s", "°C", "soak h", "days", "pull to",
}  # fmt: skip


# ------------------------------------------------------------------------------------------------
# report.html: verdict, figures and tables on one page that needs nothing else.


_SIGN = (
    "Every error is the one of “How far it closes”; a single specimen's is with all tests in "
    "the fit. It is drawn below zero where the measured force is less than predicted; along a "
    "curve it is that of each place alone. Where words say how far force is below or above "
    "prediction, they compare forces, in per cent of the predicted one. Point at a mark, or go "
    "to a figure and press the arrow keys, to read the specimen, its conditions and values; "
    "Enter enlarges the figure."
)


def _page(d: Diagnosis, figures: Mapping[str, bytes]) -> Iterator[str]:
    """Yield the lines of the page, figures as SVG by name; their marks tell what they are."""
    scripts = (f"{asset('figure.js')}\n",)
    title = f"{d.campaign}: {d.verdict}"
    yield from begin(title, styles=["report.css"], scripts=scripts, kind="report")
    yield from _head(d)
    yield "<main>"
    for svg in figures.values():
        yield '<figure>\n<div class="wide" tabindex="0" role="group" aria-label="Figure">'
        yield f"{svg.decode('utf-8').strip()}\n</div>\n</figure>"
    if figures:
        yield f'<p class="quiet">{escape(_SIGN)}</p>'
    yield from (f"<p>{escape(words)}</p>" for words in summary_of(d))
    for section in verdict_sections(d, whole=True):
        yield from _section(section)
    yield "</main>\n<footer>"
    yield f"<p>planner {escape(__version__)}, seed {d.seed}</p>"
    yield f"<p>palette {escape(d.palette)}, sha256 {escape(d.palette_sha256)}</p>"
    yield "</footer>"
    yield end(scripts)


def _head(d: Diagnosis) -> Iterator[str]:
    """Yield the head: what was diagnosed, and the verdict in figures."""
    errors = {"gap before": d.gap.before, "gap after": d.gap.after, "floor": d.gap.floor}
    facts = (
        ("verdict", d.verdict, "good" if d.ok else "bad"),
        ("probability", probability(best_of(d).probability), ""),
        *((name, percent(error), "") for name, error in errors.items() if error is not None),
    )
    return head(d.campaign, [escape(headline(d)), escape(scope(d))], facts)


def _section(section: TextSection) -> Iterator[str]:
    yield f"<h2>{escape(section.heading)}</h2>"
    for part in section.parts:
        if isinstance(part, Table):
            yield from _table(part.columns, part.rows)
        elif isinstance(part, str):
            yield f"<p>{escape(part)}</p>"
        else:
            items = "".join(f"<li>{escape(sentence)}</li>\n" for sentence in part)
            yield f"<ul>\n{items}</ul>"


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    heads = [(name, "figure" if name in _FLUSH_RIGHT else "") for name in columns]
    return table(heads, (("", [escape(cell) for cell in row]) for row in rows))


# ------------------------------------------------------------------------------------------------
# The folder of a diagnosis.


def diagnosis_files(diagnosis: Diagnosis) -> dict[str, bytes]:
    """Return the content of each file by its path; the same diagnosis gives the same bytes."""
    figures = figures_of(diagnosis)
    palette = diagnosis.own_palette
    return {
        "diagnosis.json": diagnosis.json(),
        "report.html": "\n".join(_page(diagnosis, figures)).encode("utf-8"),
        **_csv_files(diagnosis),
        **({PALETTE_FILE: encode_palette(palette)} if palette is not None else {}),
        **{f"figures/{name}.svg": svg for name, svg in figures.items()},
    }


def write_diagnosis(diagnosis: Diagnosis, output: str | Path, *, force: bool = False) -> Path:
    """Write diagnosis.json, its palette, report.html, CSV tables and figures whole, or nothing.

    Parameters
    ----------
    diagnosis
        What `planner.diagnose` returns, with its traces.
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
        The folder may not be written; see `planner.formats.outputs.check_target`.

    Examples
    --------
    >>> planner.write_diagnosis(planner.diagnose("lab"), "diagnosis")  # doctest: +SKIP
    """
    files = diagnosis_files(diagnosis)
    with new_folder(output, force=force, record="diagnosis.json") as scratch:
        for name, content in files.items():
            (scratch / name).parent.mkdir(exist_ok=True)
            (scratch / name).write_bytes(content)
    return Path(output)
