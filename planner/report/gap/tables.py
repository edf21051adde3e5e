"""The figures of a diagnosis in rows: as CSV for a spreadsheet, and as tables of the page."""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from planner.gap.diagnosis import Diagnosis
from planner.report.gap.effect_sizes import meaning
from planner.report.gap.wording import (
    axis_words,
    figure,
    id_of,
    percent,
    probability,
    setting,
    title,
)

__all__ = ["Table", "page_tables", "ranking_csv", "where_csv"]

_SIGNIFICANT_DIGITS = 6


@dataclass(frozen=True, slots=True)
class Table:
    """A heading, columns and rows of text; `figures` are columns that stand flush right."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    figures: tuple[str, ...] = ()


def ranking_csv(diagnosis: Diagnosis) -> bytes:
    """Return the hypotheses, most probable first."""
    return _csv(
        ("hypothesis", "probability", "with_unknown", "same_class"),
        (
            (id_of(h.effects), h.probability, h.with_unknown, h.effects in diagnosis.same_class)
            for h in diagnosis.ranking
        ),
    )


def where_csv(diagnosis: Diagnosis) -> bytes:
    """Return the axes of the gap, then those of what remains after the verdict's effects."""
    return _csv(
        ("of", "axis", "share", "share_low", "share_high", "p", "detail"),
        (
            (of, place.axis, place.share, *place.share_interval, place.p, place.detail)
            for of, places in (("gap", diagnosis.where), ("remainder", diagnosis.remainder))
            for place in places
        ),
    )


def page_tables(diagnosis: Diagnosis) -> Iterator[Table]:
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
                    figure(value),
                    "" if ends is None else _interval(ends),
                    "" if unit == "1" else unit,
                )
            )
    columns = ("effect", "form", "parameter", "meaning", "value", "90 % interval", "unit")
    return Table("Size of the effects", columns, tuple(rows), ("value",))


def _where(d: Diagnosis) -> Table:
    rows = [
        (of, axis_words(p.axis), percent(p.share), f"{percent(low)} to {percent(high)}",
         figure(p.p, 2), p.detail)
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
            figure(math.exp(factor)),
            f"{figure(math.exp(factor - 1.645 * sd))} to {figure(math.exp(factor + 1.645 * sd))}",
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
            "none within its bounds" if s.size is None else figure(s.size),
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
            figure(x.expected_gain_nats, 2),
            figure(x.hours, 2),
        )
        for x in d.next_experiments
    ]
    columns = ("test", "tells", "expected gain, nats", "hours")
    return Table("What to test next", columns, tuple(rows), columns[2:])


def _quality(d: Diagnosis) -> Table:
    rows = [(q.specimen or "all", q.kind, q.problem) for q in d.data_quality]
    return Table("Data to look at", ("specimen", "kind", "problem"), tuple(rows))


def _interval(ends: tuple[float, float]) -> str:
    return f"{figure(ends[0])} to {figure(ends[1])}"


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
