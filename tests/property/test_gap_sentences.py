"""Whatever the figures of a diagnosis, its sentences agree with them and with each other."""

import re
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from planner.gap.diagnosis import Diagnosis, Gap, Hypothesis, Location
from planner.gap.summary import axis_words, percent, summary_of
from planner.report.gap_figures import errors_of
from planner.report.gap_page import verdict_text

_ERROR = st.floats(0.001, 3.0)
_DIAGNOSIS = Diagnosis(
    campaign="lab", palette="p", palette_sha256="ab", specimens=9, tests=3, verdict="rate",
    ranking=(Hypothesis(("rate",), 0.9),), same_class=(("rate",),), not_testable=(),
    where=(Location("rate_mm_s", 0.8, (0.7, 0.9), 0.001, "force 20 % below prediction"),),
    gap=Gap(0.2, 0.1, 0.05, 0.66, None, None, None, ""), effect=(), remainder=(), data_quality=(),
    next_experiments=(), detectable=(), limitations=(),
)  # fmt: skip
_NOT_A_LABS = re.compile(r"\bnats?\b|usual kind|no model|beats?\b|\bnan\b|\binf\b|None")


@st.composite
def gaps(draw: st.DrawFn) -> Gap:
    before, after, floor = draw(_ERROR), draw(_ERROR), draw(st.none() | _ERROR)
    closed, interval = None, None
    if floor is not None and before > 1.02 * floor:
        closed = 1.0 - (after - floor) / (before - floor)
        ends = draw(st.tuples(st.floats(-5.0, 1.0), st.floats(0.0, 5.0)))
        interval = (min(closed, closed - ends[0]), max(closed, closed + ends[1]))
    others = draw(st.none() | _ERROR), draw(st.none() | _ERROR)
    worse = after > 1.05 * before
    return Gap(
        before, after, floor, closed, interval, *others, "9 left out", negative_transfer=worse
    )


@given(gaps(), st.sampled_from(["rate", "rate+temperature", "none", "unknown"]))
def test_sentences_agree_with_the_figures(gap: Gap, verdict: str) -> None:
    hypothesis = Hypothesis(tuple(verdict.split("+")) if verdict != "none" else (), 0.9)
    d = replace(_DIAGNOSIS, verdict=verdict, ranking=(hypothesis,), gap=gap)
    *_, how_far = summary_of(d)
    text = verdict_text(d, width=10_000)
    assert not _NOT_A_LABS.search(text)
    shares = re.findall(r"(?:that|interval|to) ([\d.]+)(?: %)?(?= of what| to|\b %\))", how_far)
    assert all(0.0 <= float(share) <= 100.0 for share in shares)
    # Every figure is that of the table, under one definition.
    table = {percent(error) for _, error in errors_of(d)}
    assert percent(gap.before) in table
    assert set(re.findall(r"(?:from|to|by|misses the force by) ([\d.]+ %) of a", how_far)) <= table
    after = percent(gap.after) if gap.after is not None else ""
    if not d.named:
        known = gap.floor is not None and verdict == "none"
        within = known and gap.before <= gap.floor
        assert ("Nothing to explain: the prints repeat no better" in how_far) == within
        assert (
            within
            or "No effect is needed" in how_far
            or "Nothing known closes it" in how_far
            or "Refitted laws" in how_far
        )
    elif gap.negative_transfer:
        by_chance = gap.closed_interval is not None and gap.closed_interval[1] > 0.0
        assert ("which may be chance" in how_far) == by_chance
        assert ("do not use it" in how_far) != by_chance
    else:
        fell = gap.after is not None and gap.after < gap.before
        assert (f"falls from {percent(gap.before)} to {after}" in how_far) == fell
        below = gap.floor is not None and gap.after is not None and gap.after <= gap.floor
        assert ("all is closed that can be" in how_far) == below


@given(gaps(), st.sampled_from(["batch", "temperature_C"]))
def test_none_with_a_remainder_does_not_say_that_there_is_nothing(gap: Gap, axis: str) -> None:
    place = Location(axis, 0.5, (0.2, 0.8), 0.003, "force 14 % below prediction in one of them")
    hypothesis = Hypothesis((), 0.9)
    d = replace(_DIAGNOSIS, verdict="none", ranking=(hypothesis,), gap=gap, remainder=(place,))
    text = " ".join(verdict_text(d, width=10_000).split())
    for calm in ("needs no cause", "No effect is needed", "Nothing to explain", "agrees with"):
        assert calm not in text
    assert f"a gap along {axis_words(axis)} is more than scatter" in text
    assert "A gap above scatter remains" in text
    # Replicates share every condition; a batch they need not.
    assert ("goes with their batch" in text) == (axis == "batch" and gap.floor is not None)
    assert ("is as good as can be" in text) == (axis != "batch" and gap.floor is not None)
