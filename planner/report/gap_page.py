"""A diagnosis in plain words, and its folder: report.html, figures and tables."""

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import ascii_lowercase

from planner import __version__
from planner.errors import check_kind, listed
from planner.formats.outputs import write_folder
from planner.formats.tables import encode_csv
from planner.formats.units import UnitOf
from planner.gap.diagnosis import PALETTE_FILE, Diagnosis, Experiment, name_of
from planner.gap.effect import Form
from planner.gap.effects import EFFECTS
from planner.gap.summary import (
    axis_words,
    best_of,
    clear_places,
    number_words,
    p_value,
    percent,
    probability,
    sentence,
    summary_of,
)
from planner.glance import counted
from planner.palette import encode_palette
from planner.report.gap_figures import errors_of, figures_of, unit_of
from planner.report.page import encode_page, head, table

__all__ = ["headline", "scope", "verdict_text", "write_diagnosis"]


# ------------------------------------------------------------------------------------------------
# How large the effects of a verdict are, and how large one had to be to be seen, in words.


_SPECIMENS = 6
_LOG_STRESS = re.compile(r"(^|fall |drop )of ln stress")


def _size_words(diagnosis: Diagnosis) -> Iterator[str]:
    """Yield a sentence an effect: its parameters with their 90 % intervals, but for details."""
    for effect in diagnosis.effect:
        sizes = []
        form = EFFECTS[effect.id].form(effect.form) if effect.id in EFFECTS else None
        details = set(form.details if form is not None else ()).intersection(effect.parameters)
        for name in (name for name in effect.parameters if name not in details):
            value = effect.parameters[name]
            unit = effect.units.get(name, "1")
            ends = effect.interval.get(name)
            words = _meaning(effect.id, effect.form, name)
            size = f"{_label(name, words)} {_shown(name, words, unit, value)}"
            if ends is not None:
                size += f" (90 % interval {_span(name, words, unit, ends)})"
            sizes.append(size + _at_bound(form, name, value))
        members = listed(effect.specimens, most=_SPECIMENS)
        of = f" (in {members} only)" if members else ""
        called = f", {effect.form} form" if effect.form else ""
        if details:
            figures = "one more figure" if len(details) == 1 else f"{len(details)} more figures"
            sizes.append(f"{figures} of its course in diagnosis.json")
        yield f"{effect.id}{called}{of}: {'; '.join(sizes)}."


def _at_bound(form: Form | None, name: str, value: float) -> str:
    """Say that a size is as large or small as it may be, as far as the figures shown tell."""
    for p in form.parameters if form is not None else ():
        shown = number_words(abs(value) if p.signed else value)
        bounds = {number_words(p.low): "smallest", number_words(p.high): "largest"}
        if p.name == name and shown in bounds:
            return f", at the {bounds[shown]} this model allows"
    return ""


def _detectable_words(diagnosis: Diagnosis, most: int | None) -> Iterator[str]:
    """Yield the smallest size of each effect that would have been seen."""
    seen = [
        f"{d.id}: {_label(d.parameter, words)} {_shown(d.parameter, words, d.unit, d.size)}."
        for d in diagnosis.detectable
        if d.size is not None
        for words in [_meaning(d.id, "", d.parameter)]
    ]
    yield from _first(seen, most)
    blind = [d.id for d in diagnosis.detectable if d.size is None]
    if blind:
        yield f"Not seen however large: {listed(blind)}."


def _first(sentences: Sequence[str], most: int | None) -> Iterator[str]:
    """Yield the first sentences, all where there is no most, and where the others are."""
    yield from sentences[:most]
    if most is not None and len(sentences) > most:
        yield f"{len(sentences) - most} more of these are in diagnosis.json."


def _meaning(effect: str, form: str, parameter: str) -> str:
    """Return what a parameter means, as the effect's form says it; "" where none does."""
    forms = EFFECTS[effect].forms if effect in EFFECTS else ()
    own_first = sorted(forms, key=lambda f: f.name != form)
    return next((p.meaning for one in own_first for p in one.parameters if p.name == parameter), "")


def _shown(name: str, words: str, unit: str, value: float) -> str:
    """Return a value as a lab writes it: logarithms as ratios or per cent, units beside figures."""
    if name.startswith("log_"):
        return f"{number_words(math.exp(value))} times"
    log = _LOG_STRESS.match(words)
    if log is not None and log[1]:  # a fall by so much
        return percent(-math.expm1(-value))
    if log is not None:
        return f"{'+' if value > 0.0 else ''}{percent(math.expm1(value))}"
    return number_words(value) if unit in ("1", "") else f"{number_words(value)} {unit}"


def _label(name: str, words: str) -> str:
    """Name a parameter with its meaning, if that says more."""
    if name.startswith("log_"):
        name = name.removeprefix("log_")
        words = words.removeprefix("ln of ")
    words = words.replace("of ln stress", "of stress").replace("ln of ", "")
    if not words:
        return name
    if words.startswith(f"{name} "):
        return words
    return f"{name} {words}" if words.startswith("of ") else f"{name} ({words})"


def _span(name: str, words: str, unit: str, ends: tuple[float, float]) -> str:
    low, high = (_shown(name, words, unit, end) if math.isfinite(end) else "" for end in ends)
    if not (low and high):
        return f"{low} or more" if low else f"up to {high}" if high else "open"
    # A unit that both ends share is written once.
    for suffix in (f" {unit}", " %", " times"):
        if low.endswith(suffix) and high.endswith(suffix):
            return f"{low.removesuffix(suffix)} to {high}"
    return f"{low} to {high}"


# ------------------------------------------------------------------------------------------------
# The verdict in plain words: for the terminal, and above the figures of the report.


_INDENT = "  "
_PLACES = 3
_UNIT = re.compile(r"(?<=\d) (?=(?:%|mm|N|K|°C|h|s|days|times|decade)\b|%)")


@dataclass(frozen=True, slots=True)
class _Table:
    """Rows of cells below their headings."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def __bool__(self) -> bool:
        return bool(self.rows)


_Part = str | tuple[str, ...] | _Table
"""What stands below a heading: a paragraph, a list of sentences, a table."""


def verdict_text(diagnosis: Diagnosis, *, width: int = 80) -> str:
    """Return the verdict as text, no line wider than `width` but for a command to copy."""
    lines: list[str] = []
    for paragraph in (*summary_of(diagnosis), "", headline(diagnosis), scope(diagnosis)):
        lines += _wrapped(paragraph, width, "", "") or [""]
    for heading, parts in _sections(diagnosis):
        lines += ["", heading]
        for part in parts:
            if isinstance(part, _Table):
                lines += _table_lines(part, width)
            elif isinstance(part, str):
                lines += _wrapped(part, width, _INDENT, _INDENT)
            else:
                for item in part:
                    lines += _wrapped(item, width, f"{_INDENT}- ", f"{_INDENT}  ")
    return "\n".join(lines).replace("\xa0", " ")


def _wrapped(block: str, width: int, lead: str, follow: str) -> list[str]:
    return textwrap.wrap(
        _UNIT.sub("\xa0", block),  # a figure and its unit stay on one line
        max(width, 20),
        initial_indent=lead,
        subsequent_indent=follow,
        break_on_hyphens=False,
        break_long_words=False,
    )


def _table_lines(table: _Table, width: int) -> list[str]:
    """Return a table's lines; a row as a sentence where it is too wide."""
    cells = (table.columns, *table.rows)
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for gap in ("  ", " "):
        if len(_INDENT) + sum(widths) + len(gap) * (len(widths) - 1) <= width:
            rows = (gap.join(map(str.ljust, row, widths)) for row in cells)
            return [f"{_INDENT}{row}".rstrip() for row in rows]
    named = (zip(table.columns, row, strict=True) for row in table.rows)
    texts = (", ".join(f"{name} {cell}".strip() for name, cell in row if cell) for row in named)
    return [line for t in texts for line in _wrapped(t, width, f"{_INDENT}- ", f"{_INDENT}  ")]


def _cause_words(name: str) -> str:
    """Return a hypothesis in words: "no gap", "water uptake", "strain rate + water uptake"."""
    others = {"none": "no gap", "unknown": "an unknown cause"}
    causes = (EFFECTS[e].title if e in EFFECTS else others.get(e, e) for e in name.split("+"))
    return " + ".join(causes)


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one line."""
    verdict = diagnosis.verdict
    none = "no cause that was tested" if diagnosis.remainder else "no gap that needs an explanation"
    others = {"none": none, "unknown": "a gap that no effect here explains"}
    words = others.get(verdict, _cause_words(verdict))
    more = f": {words}" if words != verdict else ""
    return f"Verdict: {verdict} (probability {probability(best_of(diagnosis).probability)}){more}"


def _sections(d: Diagnosis, *, whole: bool = False) -> Iterator[tuple[str, tuple[_Part, ...]]]:
    """Yield the verdict section by section, heading and parts, those with nothing to say left out.

    A page has it whole: with tables of all that was weighed, and every row of them.
    """
    ranking, places, levels = _tables(d) if whole else ("", "", "")
    # Where the cause is unknown, an effect much larger may be what it is.
    clear = (whole or d.verdict == "none") and d.verdict != "unknown"
    seen = tuple(_detectable_words(d, None if whole else 8)) if clear else ()
    quality = [sentence(f"{q.specimen or 'All specimens'}: {q.problem}") for q in d.data_quality]
    sections: Sequence[tuple[str, Iterable[_Part]]] = (
        ("How sure that is", (*_how_sure(d), ranking)),
        ("Numbers in another unit", _units(d.unit_of)),
        ("How large it is", [tuple(_size_words(d))]),
        ("Smaller effects than these may hide", [seen]),
        ("Where it lies", (tuple(_where(d)), places)),
        ("How far it closes", _how_far(d)),
        ("What remains", _remainder(d)),
        ("What the data ask of the laws besides", [levels]),
        ("What could not be tested", [tuple(_not_testable(d))]),
        ("Data to look at", [tuple(_first(quality, None if whole else 6))]),
        ("Limits of this campaign", [tuple(map(sentence, d.limitations))]),
        ("What to test next", _next(d.next_experiments[:3], d.verdict)),
    )
    for heading, parts in sections:
        if filled := tuple(part for part in parts if part):
            yield heading, filled


def _tables(d: Diagnosis) -> Iterator[_Table]:
    """Yield every hypothesis, every axis of the gap and of its remainder, every law's level."""
    ranking = (
        (name, probability(share), probability(share * unknown), "yes" if same else "")
        for name, share, unknown, same in _ranked(d)
    )
    named = ("hypothesis", "probability", "with an unknown beside it", "same class as the verdict")
    yield _Table(named, tuple(ranking))
    places = (
        (of, axis_words(axis), percent(share), _ends(ends, percent), p_value(p), detail)
        for of, axis, share, *ends, p, detail in _placed(d)
    )
    yield _Table(("of", "along", "share", "90 % interval", "p", "detail"), tuple(places))
    levels = (
        (material, _factor(log), _ends((log - 1.645 * sd, log + 1.645 * sd), _factor))
        for material, (log, sd) in d.recalibration.items()
    )
    yield _Table(("material", "factor on the law's stress", "90 % interval"), tuple(levels))


def _factor(log: float) -> str:
    return number_words(math.exp(log))


def _ranked(d: Diagnosis) -> Iterator[tuple[str, float, float, bool]]:
    """Yield hypotheses: probability, share with an unknown, whether of the verdict's class."""
    for h in d.ranking:
        yield h.name, h.probability, h.with_unknown, h.effects in d.same_class


def _placed(d: Diagnosis) -> Iterator[tuple[str, str, float, float, float, float, str]]:
    """Yield axes of the gap and of what remains: share, its interval, p and detail."""
    for of, places in (("gap", d.where), ("remainder", d.remainder)):
        for place in places:
            yield of, place.axis, place.share, *place.share_interval, place.p, place.detail


def _ends(ends: Sequence[float], words: Callable[[float], str]) -> str:
    return f"{words(ends[0])} to {words(ends[1])}"


def scope(d: Diagnosis) -> str:
    """Return what was diagnosed, in one line."""
    count, tests = counted(d.specimens, "specimen"), counted(d.tests, "test")
    return f"{d.campaign or 'campaign'}: {count} in {tests}, held against palette {d.palette}"


def _how_sure(diagnosis: Diagnosis) -> Iterator[str]:
    best = best_of(diagnosis)
    beside = best.probability * best.with_unknown
    if diagnosis.verdict != "unknown" and best.with_unknown >= 0.2:
        what = "it" if diagnosis.verdict != "none" else "the scatter"
        yield f"Something unknown may be at work beside {what} (probability {probability(beside)})."
    others = [
        f"{h.name} ({probability(h.probability)})"
        for h in diagnosis.ranking
        if h.name != diagnosis.verdict and h.probability >= 0.05
    ]
    if others:
        yield f"Not ruled out: {listed(others, most=4)}."
    yield from _same_class(diagnosis)


def _units(units: Sequence[UnitOf]) -> Iterator[str | tuple[str, ...]]:
    if units:
        yield (
            "Some numbers are off by the factor between two units. If a file is in another unit "
            "than its heading says, diagnose again with the option that says so:"
        )
        for unit in units:
            of = listed(unit.specimens, most=_SPECIMENS) or "all specimens"
            yield (f"Read the {unit.quantity} of {of} in {unit.unit}: --unit-of {unit.text}",)


def _where(diagnosis: Diagnosis) -> Iterator[str]:
    clear = clear_places(diagnosis)
    for number, place in enumerate(clear[:_PLACES]):
        low, high = place.share_interval
        # What the first one is in detail is the first sentence of all.
        detail = f": {place.detail}" if place.detail and number else ""
        yield sentence(
            f"{axis_words(place.axis)}, {percent(place.share)} of the gap beyond scatter "
            f"({percent(low)} to {percent(high)}, p = {p_value(place.p)}){detail}"
        )
    if len(clear) > _PLACES:
        yield sentence(f"also along {listed([axis_words(p.axis) for p in clear[_PLACES:]])}")
    if clear and diagnosis.verdict == "unknown":
        yield "Look there before blaming any cause."


def _how_far(diagnosis: Diagnosis) -> Iterator[str | _Table]:
    gap, named = diagnosis.gap, diagnosis.named
    yield _ERROR
    if gap.held_out:
        yield f"These errors are on tests that took no part in the fit ({gap.held_out})."
    errors = tuple((words, percent(error)) for words, error in errors_of(diagnosis))
    yield _Table(("prediction", "error"), errors)
    if gap.floor is not None and any(place.axis == "batch" for place in diagnosis.remainder):
        yield (
            "Part of what replicates differ by goes with their batch and is no scatter: a "
            "prediction that knew of it could be better than that."
        )
    elif gap.floor is not None:
        below = any(error < gap.floor for _, error in errors_of(diagnosis))
        yield (
            "However good a prediction is, it misses a new specimen by about as much as "
            "replicates scatter: an error near that"
            f"{', even slightly below by chance,' if below else ''} is as good as can be."
        )
    if named and gap.extrapolated is not None and gap.extrapolated_before is not None:
        worse = gap.extrapolated > gap.extrapolated_before
        yield (
            "Where all tests at one level are left out, such as the warmest, it misses these by "
            f"{percent(gap.extrapolated)}, and the palette alone by "
            f"{percent(gap.extrapolated_before)}"
            f"{': do not use it beyond the conditions tested' if worse else ''}."
        )
    refitted = math.inf if gap.recalibration_only is None else gap.recalibration_only
    if named and gap.after is not None and not gap.negative_transfer and refitted <= gap.after:
        yield (
            "Refitting the laws does as well as the effect: what is off may be the palette, "
            "or what the effect does to all its materials alike."
        )


_ERROR = (
    "The error of a specimen is the root mean square, over its curve, of measured less predicted "
    "force, in per cent of the largest force of the specimen and its replicates, on the mean; that "
    "of several specimens is the root mean square of theirs."
)
"""The one definition, of text, tables, figures and diagnosis.json alike."""


def _same_class(diagnosis: Diagnosis) -> Iterator[str]:
    others = [name for name in map(name_of, diagnosis.same_class) if name != diagnosis.verdict]
    if not others:
        return
    if diagnosis.verdict == "none":
        causes = [name for name in others if name != "unknown"]
        along = f"by {listed(causes, last='or')}" if causes else ""
        unknown = "of unknown cause" if "unknown" in others else ""
        small = " or ".join(filter(None, (along, unknown)))
        yield f"These data do not exclude a small gap {small}."
    else:
        words = {"none": "no gap at all", "unknown": "an unknown cause"}
        named = listed([words.get(name, name) for name in others], last="or")
        what = "An unknown cause" if diagnosis.verdict == "unknown" else diagnosis.verdict
        yield f"{what} looks the same here as {named}: take them as one answer."
    splits = {tuple(sorted(pair)) for x in diagnosis.next_experiments for pair in x.splits}
    if any(tuple(sorted((diagnosis.verdict, other))) in splits for other in others):
        yield "The tests proposed below would tell some of them apart."


def _remainder(diagnosis: Diagnosis) -> Iterator[str]:
    if not diagnosis.remainder:
        return
    places = [
        f"along {axis_words(p.axis)} (p = {p_value(p.p)})"
        + (f", {p.detail.rstrip('.')}" if p.detail else "")
        for p in diagnosis.remainder
    ]
    beside = "Beside the effect, a" if diagnosis.named else "A"
    yield f"{beside} gap above scatter remains: {'; '.join(places)}."


def _not_testable(diagnosis: Diagnosis) -> Iterator[str]:
    reasons: dict[str, list[str]] = {}
    for untestable in diagnosis.not_testable:
        reasons.setdefault(untestable.reason, []).append(untestable.id)
    for reason, ids in reasons.items():
        yield f"{listed(ids)}{': ' + reason.rstrip('.') if reason else ''}."


# ------------------------------------------------------------------------------------------------
# The next tests: what to print, and why.


def _next(experiments: Sequence[Experiment], verdict: str) -> Iterator[_Part]:
    if not experiments:
        return
    how = "compressed" if _pushed(experiments[0]) else "pulled"
    yield (
        "Print and test these, the first being worth most for its hours. Size is width x "
        f"thickness x gauge, and they are {how} to a strain; next-specimens.csv in the report "
        "folder has them as rows of specimens.csv."
    )
    rows = [_next_cells(number, x) for number, x in enumerate(experiments, start=1) if x.row]
    if rows:
        columns = [name for name in rows[0] if any(row[name] for row in rows)]
        yield _Table(tuple(columns), tuple(tuple(row[name] for name in columns) for row in rows))
    reasons: dict[str, list[str]] = {}
    for number, x in enumerate(experiments, start=1):
        words = [f"{axis_words(k)} {v} {unit_of(k)}".strip() for k, v in x.change.items()]
        what = "" if x.row else f" ({listed(words)})"
        reasons.setdefault(_next_reason(x, verdict), []).append(f"{number}{what}")
    yield tuple(
        f"Test{'s' if len(tests) > 1 else ''} {listed(tests)}: {reason}"
        for reason, tests in reasons.items()
    )


def _split_words(first: str, second: str) -> str:
    """Return the question whose answer tells one hypothesis from another."""
    if "none" in (first, second):
        return f"is {_cause_words(second if first == 'none' else first)} at work at all"
    a, b = (set(name.split("+")) for name in (first, second))
    both, only_a, only_b = (
        _cause_words("+".join(sorted(effects))) for effects in (a & b, a - b, b - a)
    )
    if not a & b:
        return f"is it {only_a}, or {only_b}"
    if a - b and b - a:
        return f"is it {only_a}, or {only_b}, beside {both}"
    return f"is {only_a or only_b} at work beside {both}"


def _next_cells(number: int, x: Experiment) -> dict[str, str]:
    """Return a row of the table; its size as width x thickness x gauge."""
    cell = {name: v if isinstance(v, str) else f"{v:.4g}" for name, v in x.row.items()}
    bar = cell.get("profile", "").rpartition("/")[2].removesuffix(".csv")
    sizes = (cell.get(name, "?") for name in ("width_mm", "thickness_mm", "gauge_mm"))
    to = "push to" if _pushed(x) else "pull to"
    conditions = {
        "mm/s": "rate_mm_s", "°C": "temperature_C", "soak h": "soak_h", "days": "age_days",
        "along": "orientation", "protocol": "protocol", to: "to_strain",
    }  # fmt: skip
    return {
        "": f"{number}.",
        "no.": f"{x.count}",
        "of": cell.get("material") or bar,
        "size mm": "x".join(sizes),
        **{words: cell.get(name, "") for words, name in conditions.items()},
    }


def _pushed(x: Experiment) -> bool:
    return f"{x.row.get('protocol', '')}".endswith("compression")


def _next_reason(x: Experiment, verdict: str) -> str:
    """Return what a test is good for, and the hours of its specimens together."""
    of_verdict = [pair for pair in x.splits if verdict in pair] or x.splits
    told = "; and ".join(_split_words(*pair) for pair in of_verdict[:2])
    odds = "the odds between causes shift, but no two are told apart for sure."
    told = f"{told}?" if told else odds
    return told + (f" About {number_words(x.hours, 2)} h of work each." if x.hours > 0.0 else "")


# ------------------------------------------------------------------------------------------------
# The figures of a diagnosis in rows, as CSV for a spreadsheet.


def _csv_files(d: Diagnosis) -> dict[str, bytes]:
    """Return tables by path: axes, hypotheses, specimens to be tested next, designs of bars."""
    columns = list(dict.fromkeys(name for x in d.next_experiments for name in x.row))
    specimens = [
        (f"next-{number}{ascii_lowercase[copy]}", *(x.row.get(name, "") for name in columns))
        for number, x in enumerate(d.next_experiments, start=1)
        for copy in range(x.count if x.row else 0)
    ]
    where = ("of", "axis", "share", "share_low", "share_high", "p", "detail")
    tables: dict[str, Sequence[Sequence[str | float]]] = {
        "where.csv": [where, *_placed(d)],
        "ranking.csv": [("hypothesis", "probability", "with_unknown", "same_class"), *_ranked(d)],
        **({"next-specimens.csv": [("specimen", *columns), *specimens]} if columns else {}),
    }
    for x in d.next_experiments:
        if x.design:
            profile = [tuple(x.design), *zip(*x.design.values(), strict=True)]
            tables[str(x.row["profile"])] = profile
    return {path: encode_csv(rows, digits=6) for path, rows in tables.items()}


_FLUSH_RIGHT = {
    "probability", "with an unknown beside it", "share", "p", "error",
    "factor on the law's stress", "no.", "mm/s", "°C", "soak h", "days", "pull to", "push to",
}  # fmt: skip


# ------------------------------------------------------------------------------------------------
# report.html: verdict, figures and tables on one page that needs nothing else.


_SIGN = (
    "Errors in figures are in per cent of the largest force (“How far it closes”), those of one "
    "specimen with all tests in the fit. How far force lies above or below prediction, in words, "
    "is in per cent of the predicted force. Point at a mark, or go to a figure and press the arrow "
    "keys, to read specimen, conditions and values; Enter enlarges the figure."
)


def _body(d: Diagnosis, figures: Mapping[str, bytes]) -> Iterator[str]:
    """Yield the lines of the page, figures as SVG by name; their marks tell what they are."""
    gap = d.gap
    errors = {"gap before": gap.before, "gap after": gap.after, "scatter of replicates": gap.floor}
    facts = (
        ("verdict", d.verdict, "good" if d.ok else "bad"),
        ("probability", probability(best_of(d).probability), ""),
        *((name, percent(error), "") for name, error in errors.items() if error is not None),
    )
    yield from head(d.campaign, [escape(headline(d)), escape(scope(d))], facts)
    yield "<main>"
    for svg in figures.values():
        yield '<figure>\n<div class="wide" tabindex="0" role="group" aria-label="Figure">'
        yield f"{svg.decode('utf-8').strip()}\n</div>\n</figure>"
    yield from (f"<p>{escape(words)}</p>" for words in summary_of(d))
    if figures:
        yield f'<p class="quiet">{escape(_SIGN)}</p>'
    for heading, parts in _sections(d, whole=True):
        yield f"<h2>{escape(heading)}</h2>"
        for part in parts:
            if isinstance(part, _Table):
                heads = [(name, "figure" if name in _FLUSH_RIGHT else "") for name in part.columns]
                yield from table(heads, (("", list(map(escape, row))) for row in part.rows))
            elif isinstance(part, str):
                yield f"<p>{escape(part)}</p>"
            else:
                items = "".join(f"<li>{escape(sentence)}</li>\n" for sentence in part)
                yield f"<ul>\n{items}</ul>"
    yield "</main>\n<footer>"
    yield f"<p>planner {escape(__version__)}, seed {d.seed}</p>"
    yield f"<p>palette {escape(d.palette)}, sha256 {escape(d.palette_sha256)}</p>"
    yield "</footer>"


# ------------------------------------------------------------------------------------------------
# The folder of a diagnosis.


def diagnosis_files(diagnosis: Diagnosis) -> dict[str, bytes]:
    """Return the content of each file by its path; the same diagnosis gives the same bytes."""
    figures, palette = figures_of(diagnosis), diagnosis.own_palette
    title, body = f"{diagnosis.campaign}: {diagnosis.verdict}", _body(diagnosis, figures)
    page = encode_page(
        title, body, styles=["report.css"], scripts=["figure.js"], view=False, kind="report"
    )
    return {
        "diagnosis.json": diagnosis.json(),
        "report.html": page,
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
    check_kind(diagnosis, Diagnosis, "what `planner.diagnose` returns")
    return write_folder(output, diagnosis_files(diagnosis), force=force, record="diagnosis.json")
