"""The verdict in words, for every kind of verdict."""

import re
from dataclasses import replace

import numpy as np

from planner.errors import listed
from planner.gap.diagnosis import Diagnosis, FoundEffect, Hypothesis
from planner.gap.effects import EFFECTS
from planner.gap.summary import number_words, percent, probability, sentence, summary_of
from planner.report.gap_page import headline, verdict_text

Examples = dict[str, Diagnosis]


def test_every_effect_has_words() -> None:
    assert all(e.title and e.clause for e in EFFECTS.values())


def test_the_verdict_says_itself_first_and_fits_the_terminal(diagnosis: Diagnosis) -> None:
    text = verdict_text(diagnosis, width=60)
    flowing = " ".join(text.split())
    assert flowing.startswith(" ".join(summary_of(diagnosis)))
    assert f"\nVerdict: {diagnosis.verdict} (probability " in text
    assert max(map(len, text.splitlines())) <= 60
    assert not re.search(r"\b(nan|None|inf)\b|\{|\}|  \.|\.\.", text)


def test_what_the_verdict_says_of_each_case(examples: Examples) -> None:
    """On one line a paragraph, so that no phrase is cut by the wrapping."""
    said = {name: verdict_text(d, width=10_000) for name, d in examples.items()}
    assert "very likely" in said["rate"]
    assert "falls from 21 % to 3.0 % of a specimen's largest force" in said["rate"]
    assert "97 % of what can be closed is closed (90 % interval 93 to 99 %)" in said["rate"]
    assert "unknown may be at work beside it (probability 0.23)" in said["rate"]  # 0.25 of 0.91
    assert "Read the force of B in lbf: --unit-of force=lbf:B" in said["rate"]
    assert "softening and permanent-set: no specimen was unloaded." in said["rate"]
    assert "12.3 s (90 % interval 8.00 s or more)" in said["rate"]
    assert "B: load 4.45 times its replicates': pounds-force?" in said["rate"]
    assert "crosshead speed 0.005 mm/s and column replicates 3" in said["rate"]
    assert "replicates 3): is compliance of the machine at work beside strain rate" in said["rate"]
    assert re.search(r"2\. +2 +soft-to-hard +6x3x20 +0\.5 +0 +cyclic +0\.15\n", said["rate"])
    assert "operator" not in said["rate"]  # p = 0.4
    assert "agrees with the palette" in said["none"]
    assert "rate: rise of stress per decade of strain rate +2.0 %" in said["none"]
    assert "Not seen however large: skin" in said["none"]
    assert "no effect that could be tested here explains" in said["unknown"]
    assert "gap above scatter remains: along crosshead speed" in said["unknown"]
    assert "are predicted worse, by 25 %" in said["pair"]
    assert "looks the same here as ageing+rate" in said["pair"]
    assert "How far it closes cannot be checked" in said["one"]
    assert "no replicates" in said["one"]


def said_of(diagnosis: Diagnosis, *others: tuple[str, ...]) -> str:
    verdict = tuple(diagnosis.verdict.split("+"))
    return verdict_text(replace(diagnosis, same_class=(verdict, *others)), width=10_000)


def test_classes_read_well_whatever_the_verdict(examples: Examples) -> None:
    none, unknown, rate = (examples[name] for name in ("none", "unknown", "rate"))
    assert "do not exclude a small gap of unknown cause." in said_of(none, ("unknown",))
    assert "exclude a small gap by rate or skin or of unknown cause." in said_of(
        none, ("rate",), ("skin",), ("unknown",)
    )
    assert "An unknown cause looks the same here as rate: take" in said_of(unknown, ("rate",))
    assert "rate looks the same here as skin or an unknown cause: take them" in said_of(
        rate, ("skin",), ("unknown",)
    )
    assert "rate looks the same here as no gap at all:" in said_of(rate, ("none",))


def test_a_title_that_is_the_verdict_is_not_repeated(examples: Examples) -> None:
    warm = replace(examples["rate"], verdict="temperature",
                   ranking=(Hypothesis(("temperature",), 0.9),))  # fmt: skip
    assert headline(warm) == "Verdict: temperature (probability 0.90)"
    assert headline(examples["rate"]).endswith("(probability 0.91): strain rate and relaxation")


def test_figures_in_words() -> None:
    assert [number_words(v) for v in (0.0, 1234567.0, 0.1234, 12.0, 9.996, 1e-5)] == [
        "0",
        "1.23e+06",
        "0.123",
        "12.0",
        "10.0",
        "1.00e-05",
    ]
    assert [percent(v) for v in (0.0345, 0.995, 1.506, np.inf)] == [
        "3.5 %", "100 %", "150 %", "open",
    ]  # fmt: skip
    assert [probability(v) for v in (0.999, 0.5, 1e-4)] == ["above 0.99", "0.50", "below 0.01"]
    assert [listed(list("abcd")[:n], most=3) for n in (1, 2, 4)] == [
        "a",
        "a and b",
        "a, b, c and 1 more",
    ]
    assert [sentence(s) for s in ("a b", "rate_mm_s is off", "why?")] == [
        "A b.",
        "rate_mm_s is off.",
        "Why?",
    ]


def test_details_of_a_course_are_counted_and_not_listed(examples: Examples) -> None:
    """They have no words of their own; the document has them."""
    form = next(f for f in EFFECTS["rate"].forms if len(f.details) > 1)
    values = {p.name: p.high for p in form.parameters} | dict.fromkeys(form.details, 0.1)
    found = (FoundEffect("rate", form.name, values, {}, {}),)
    said = verdict_text(replace(examples["rate"], effect=found), width=10_000)
    assert f"{len(form.details)} more figures of its course in diagnosis.json." in said
    assert not any(name in said for name in form.details)


def test_a_size_at_its_bound_is_said(examples: Examples) -> None:
    """A gain may be ln 4.448 +- 0.03 in its form of pounds; a slope 0.15 per kelvin at most."""
    found = (
        FoundEffect("force-scale", "pound-force", {"log_gain": -1.5225}, {}, {}),
        FoundEffect("temperature", "exponential", {"slope": 0.1499}, {}, {"slope": "1/K"}),
        FoundEffect("moisture", "fick", {"softening": 0.2, "saturation": 1.0}, {}, {}),
    )
    said = verdict_text(replace(examples["rate"], effect=found), width=10_000)
    assert "0.218 times, at the largest this model allows." in said
    assert "stress per kelvin) 13.9 %, at the largest" not in said  # 0.1499 reads 0.150
    assert "14 %, at the largest this model allows." in said
    assert "softening of a saturated specimen 0.200; " in said
    assert "3 mm sheet) 1.00, at the smallest this model allows." in said
