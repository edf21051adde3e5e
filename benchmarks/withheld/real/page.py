"""The page on published measurements, from their diagnoses."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from benchmarks.withheld.real.expectations import Expectation, probability_with
from benchmarks.withheld.real.left_out_rate import LeftOutRate
from planner.errors import listed
from planner.gap.diagnosis import Diagnosis, FoundEffect
from planner.gap.effects import effects_for
from planner.gap.summary import (
    axis_words,
    number_words,
    p_value,
    percent,
    probability,
    sentence,
)
from planner.palette import Palette
from planner.report.gap_page import headline

__all__ = ["Answered", "page", "tables"]

_WIDTH = 100
_SIGNIFICANT = 0.05
_STAND_IN = ": another name for what rate would explain, if rate is the cause."
_NEAR = 1e-3

_HEAD = """# Gaps in measurements that others published

The bench knows what it hid, and its noise is drawn; here nobody made up the cause. Campaigns are
made of published tests: planner's own laws are fitted to a part of each, which makes the palette,
and `planner gap diagnose` is asked about the rest. What should come out was written down before
(`benchmarks/withheld/real/README.md` says how they are made). The data are not kept here.

A diagnosis counts as expected if the verdict or its class says what the tests vary in. The gap is
the root mean square error of force, of each specimen's largest: by the palette alone (before), and
on tests that took no part in the fit (after); the floor is what replicates differ by. Beside it
stands a plain mechanism, fitted without any choice: elastic shapes that relax, in shares that
cannot be negative. It fits the elastic law anew as well and knows no columns but time; the
palette's own curve is one more test to it, and a condition is left out at a time, or a specimen
where there is one condition. The share is what the diagnosis closes of what that mechanism closes,
blank where the mechanism closes less than a tenth of the gap.
"""

_TAIL = """## What these sets can and cannot show

- So few sets are no statistics. How often a verdict is right is counted on the bench; here one sees
  whether it makes sense of data that owe planner nothing.
- Only the resins have replicates by design, from several print sessions. Elsewhere the scatter is
  mostly assumed, and no closure can be given against a floor.
- The palettes are fitted to a few specimens of the same set. What those have for themselves is in
  the palette, and shows as a gap of the others.
- Most conditions were not published. What is not known is said to be untested, and stays open.
- No set is of jetted material, and none has a graded bar.
"""

_LEAST_CLOSED = 0.1
"""Of the gap: where the mechanism closes less, the share is one small difference over another."""


@dataclass(frozen=True)
class Answered:
    """One set with its answers.

    Attributes
    ----------
    convex
        Held-out error of the plain mechanism: a condition left out at a time, and a rate.
    without_rate
        The diagnosis with `rate` taken out of the library; None where that is not asked.
    """

    name: str
    expectation: Expectation
    palette: Palette
    diagnosis: Diagnosis
    convex: tuple[float, float | None]
    without_rate: Diagnosis | None = None
    left_out: Sequence[LeftOutRate] = ()

    @property
    def share(self) -> float | None:
        """Of what the plain mechanism closes, what the diagnosis closes."""
        gap = self.diagnosis.gap
        closable = gap.before - self.convex[0]
        if gap.after is None or closable < _LEAST_CLOSED * gap.before:
            return None
        return (gap.before - gap.after) / closable


def page(answers: Sequence[Answered]) -> str:
    """Return the page as Markdown; figures lie in `real-data/` beside it."""
    parts = [_HEAD, *_overview(answers)]
    for a in answers:
        parts += _section(a)
    return "\n".join([*parts, _TAIL])


def tables(answers: Sequence[Answered]) -> str:
    """Return the tables alone: all sets, and each rate that was left out."""
    rows = [[a.name, *row] for a in answers for row in _left_out_rows(a)]
    said = "Each rate predicted by a diagnosis of the others, with the effects that it names:"
    return "\n".join([*_overview(answers), f"{said}\n", _table(["set", *_LEFT_OUT], rows)])


_LEFT_OUT = ("left out, mm/s", "specimens", "verdict of the others", "before", "after")


def _left_out_rows(a: Answered) -> list[list[str]]:
    return [
        [number_words(r.rate_mm_s), str(r.specimens), r.verdict, _percent(r.before),
         _percent(r.after)]
        for r in a.left_out
    ]  # fmt: skip


def _overview(answers: Sequence[Answered]) -> Iterator[str]:
    rows, met = [], []
    for a in answers:
        d, gap = a.diagnosis, a.diagnosis.gap
        met.append(a.expectation.judge(d)[0])
        chance = next((h.probability for h in d.ranking if h.name == d.verdict), 0.0)
        rows.append(
            [a.name, a.expectation.wanted, f"{d.verdict} ({probability(chance)})", met[-1],
             *(_percent(v) for v in (gap.before, gap.after, gap.floor, a.convex[0], a.share))]
        )  # fmt: skip
    heads = ["set", "expected", "answered (probability)", "as expected", "before", "after", "floor",
             "mechanism", "share"]  # fmt: skip
    yield _table(heads, rows)
    yield _paragraph(
        f"Of {len(met)} sets {met.count('yes')} were answered as expected, "
        f"{met.count('in part')} in part and {met.count('no')} not."
    )


def _section(a: Answered) -> Iterator[str]:
    e, d = a.expectation, a.diagnosis
    met, why = e.judge(d)
    yield f"## {e.title}\n"
    yield _paragraph(f"**What it is.** {e.what} Source: {e.source}.")
    yield _paragraph(f"**Expected.** {e.expected}")
    yield _paragraph(f"**Answered.** {headline(d)}. {' '.join(_places(d))}")
    verdict = {"yes": "As expected", "in part": "In part as expected", "no": "Not as expected"}
    yield _paragraph(f"**{verdict[met]}:** {why}.")
    yield _paragraph(" ".join(_gap(a)))
    if e.rates:
        yield from _rates(a)
    yield from _doubts(a)
    yield _paragraph(f"**Not inferred.** {e.beyond} {_untested(d)}")
    for name, caption in e.figures.items():
        yield f"![{caption}](real-data/{a.name}-{name}.svg)\n"
        yield _paragraph(f"*{caption}*")


def _places(d: Diagnosis) -> Iterator[str]:
    clear = [p for p in d.where if p.p < _SIGNIFICANT]
    for place in clear:
        yield sentence(f"{axis_words(place.axis)} (p = {p_value(place.p)}): {place.detail}")
    if not clear:
        yield "No axis shows more than chance would."


def _gap(a: Answered) -> Iterator[str]:
    d, gap = a.diagnosis, a.diagnosis.gap
    by_condition, by_rate = a.convex
    yield f"**The gap.** {percent(gap.before)} by the palette alone"
    yield "," if gap.floor is None else f"(replicates differ by {percent(gap.floor)}),"
    if gap.after is None:
        yield "not checked on held-out tests."
    else:
        negative = ", which is worse" if gap.negative_transfer else ""
        yield f"{percent(gap.after)} on what was held out{negative} ({gap.held_out})."
    beside = [
        f"{percent(value)} {words}"
        for value, words in (
            (gap.recalibration_only, "by refitting the laws alone"),
            (gap.generic, "by a regression without physics"),
            (by_condition, "by the plain mechanism"),
            (by_rate, "by the same with a rate left out at a time"),
        )
        if value is not None
    ]
    if beside:
        yield f"For comparison: {listed(beside)}."
    remains = [f"{axis_words(p.axis)} (p = {p_value(p.p)}; {p.detail})" for p in d.remainder]
    if remains:
        yield f"What remains lies along {listed(remains)}."


def _rates(a: Answered) -> Iterator[str]:
    d, without = a.diagnosis, a.without_rate
    words = [
        f"**Does it point at rate?** The probability of all hypotheses with rate together is "
        f"{probability(probability_with(d, 'rate'))}."
    ]
    along = next((p for p in d.where if p.axis == "rate_mm_s"), None)
    if along is not None:
        seen = "more" if along.p < _SIGNIFICANT else "no more"
        words.append(
            f"Along the crosshead's speed the gap varies {seen} than by chance "
            f"(p = {p_value(along.p)})."
        )
    if without is not None:
        others = [n for n in map("+".join, without.same_class) if n != without.verdict]
        alike = f", in a class with {listed(others)}" if others else ""
        words.append(
            f"With rate taken out of the library the verdict is {without.verdict}{alike}"
            + ("." if without.verdict in ("none", "unknown") else _STAND_IN)
        )
        if without.gap.after is not None:
            words.append(f"Held-out tests are then missed by {percent(without.gap.after)}.")
    yield _paragraph(" ".join(words))
    if a.left_out:
        yield _paragraph(
            "Each rate predicted by a diagnosis of the others, with the effects that it names:"
        )
        yield _table(_LEFT_OUT, _left_out_rows(a))
        worse = sum(r.after > r.before for r in a.left_out)
        better = sum(r.after < r.before for r in a.left_out)
        yield _paragraph(
            f"Predicted better than by the palette: {better} of {len(a.left_out)} rates; worse: "
            f"{worse}. With a verdict of unknown nothing is added."
        )


def _doubts(a: Answered) -> Iterator[str]:
    words = [
        f"{effect.id}: {name} {value:.3g} stands at a bound of what it may be"
        for effect in a.diagnosis.effect
        for name, value in effect.parameters.items()
        if _at_bound(effect, name, value, a.palette)
    ]
    words += [f"{q.specimen or 'all specimens'}: {q.problem}" for q in a.diagnosis.data_quality]
    if words:
        yield _paragraph(f"**To doubt.** {' '.join(sentence(w) for w in words)}")


def _at_bound(found: FoundEffect, name: str, value: float, palette: Palette) -> bool:
    form = next((f for f in effects_for(palette)[found.id].forms if f.name == found.form), None)
    bounds = next((p for p in form.parameters if p.name == name), None) if form else None
    if bounds is None:
        return False
    near = _NEAR * (bounds.high - bounds.low)
    size = abs(value) if bounds.signed else value
    return not bounds.low + near < size < bounds.high - near


def _untested(d: Diagnosis) -> str:
    return f"Not testable here: {listed([u.id for u in d.not_testable])}." if d.not_testable else ""


def _percent(value: float | None) -> str:
    return "" if value is None else percent(value)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def _paragraph(words: str) -> str:
    joined = " ".join(words.split()).replace(" ,", ",")
    return (
        textwrap.fill(joined, _WIDTH, break_long_words=False, break_on_hyphens=False).rstrip()
        + "\n"
    )
