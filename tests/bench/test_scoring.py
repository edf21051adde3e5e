"""Scoring of diagnoses: each measure on cases counted by hand."""

import json
import math
from typing import Any

import numpy as np
import pytest

from benchmarks.withheld.scoring import (
    EFFECT_IDS,
    NO_ANSWER,
    UNKNOWN,
    CampaignTruth,
    Score,
    effects_of,
    hypothesis_count,
    read_answer,
    score,
)
from benchmarks.withheld.summary import (
    COLUMNS,
    Rate,
    area_under_curve,
    expected_calibration_error,
    markdown,
    summarise,
    table_rows,
    wilson,
)
from planner.errors import FileError


def document(verdict: str, ranking: dict[str, float] | None = None, **more: Any) -> dict[str, Any]:
    """Make a diagnosis' document; hypotheses are written as verdicts are."""
    ranking = {verdict: 1.0} if ranking is None else ranking
    return {
        "schema": 1,
        "verdict": verdict,
        "ranking": [
            {"effects": [] if name == "none" else name.split("+"), "probability": p}
            for name, p in ranking.items()
        ],
        "class": [name.split("+") for name in more.pop("alike", [verdict])],
        "not_testable": more.pop("not_testable", []),
        "where": [{"axis": axis} for axis in more.pop("where", [])],
        "gap": {"before": 0.2, **more},
    }


def truth_of(*effects: str, **more: Any) -> CampaignTruth:
    given: dict[str, Any] = {
        "tier": "library" if effects else "none",
        "effects": effects,
        "same_class": frozenset({effects}),
        "where": frozenset({"rate_mm_s"}) if effects else frozenset(),
        "snr": 5.0 if effects else None,
        "detectability": 9.0 if effects else None,
        "before": 0.21,
        "with_true_effect": 0.03,
        "noise": 0.01,
    }
    return CampaignTruth(**{**given, **more})


def scored(doc: dict[str, Any], truth: CampaignTruth, **more: Any) -> Score:
    return score("c", read_answer(doc, "c"), truth, **more)


# One campaign


def test_hypotheses_are_sets() -> None:
    assert effects_of(["skin", "rate"]) == ("rate", "skin")
    assert effects_of(["none"]) == effects_of([]) == ()
    assert effects_of(["rate", "unknown"]) == UNKNOWN
    assert len(EFFECT_IDS) == 18
    # none, unknown, 18 effects, 18 * 17 / 2 pairs
    assert hypothesis_count() == 2 + 18 + 153
    assert hypothesis_count(["rate", "skin", "operator"]) == 2 + 16 + 120


def test_a_right_answer() -> None:
    doc = document("rate", {"rate": 0.9, "none": 0.06}, where=["strain", "rate_mm_s"])
    s = scored(doc, truth_of("rate"), seconds=3.0)
    assert s.top_1
    assert s.class_hit
    assert s.leading_right
    assert s.where_hit
    assert s.partly
    assert s.probability == s.leading_probability == 0.9
    assert s.missed is s.misattributed is s.companion is False
    assert s.false_alarm is s.open is s.honest is None
    assert s.log_score == pytest.approx(math.log(0.9))
    assert s.log_gain == pytest.approx(math.log(0.9 * 173))
    assert s.seconds == 3.0


def test_only_the_first_two_places_are_looked_at() -> None:
    assert not scored(
        document("rate", where=["strain", "batch", "rate_mm_s"]), truth_of("rate")
    ).where_hit


def test_a_class_may_hold_the_truth() -> None:
    doc = document("skin", {"skin": 0.5, "rate": 0.3}, alike=["skin", "rate"])
    s = scored(doc, truth_of("rate"))
    assert not s.top_1
    assert s.class_hit
    assert s.probability == 0.3
    assert not s.misattributed


def test_confidence_decides_about_misattribution() -> None:
    truth = truth_of("rate")
    assert scored(document("skin", {"skin": 0.81}), truth).misattributed
    assert not scored(document("skin", {"skin": 0.8}), truth).misattributed
    assert scored(document("rate+skin", {"rate+skin": 0.9}), truth).misattributed
    # what the ranking does not have is taken for certain
    assert scored(document("skin", {}), truth).misattributed
    # "none" and "unknown" blame nothing
    assert not scored(document("unknown"), truth).misattributed
    missed = scored(document("none"), truth)
    assert missed.missed
    assert not missed.misattributed


def test_no_effect() -> None:
    assert scored(document("none"), truth_of()).top_1
    for verdict in ("rate", "unknown"):
        s = scored(document(verdict), truth_of())
        assert s.false_alarm
        assert s.missed is s.partly is s.where_hit is s.closure_error is None
    assert scored(document("none"), truth_of()).false_alarm is False


def test_what_the_ranking_leaves_out_shares_the_rest() -> None:
    s = scored(document("skin", {"skin": 0.6, "none": 0.3}), truth_of("rate"))
    assert s.probability == 0.0
    assert s.log_score == pytest.approx(math.log(0.1 / 171))
    floored = scored(document("skin", {"skin": 1.0}), truth_of("rate"))
    assert floored.log_score == pytest.approx(math.log(1e-6))


def test_pairs_and_companions() -> None:
    pair = truth_of("rate", "skin", tier="pair")
    assert scored(document("rate+skin"), pair).top_1
    one = scored(document("rate"), pair)
    assert (one.top_1, one.partly, one.companion) == (False, True, None)
    assert not scored(document("moisture"), pair).partly
    assert scored(document("rate+skin"), truth_of("rate")).companion
    assert not scored(document("moisture+skin"), truth_of("rate")).companion


def test_an_effect_out_of_the_library_is_unknown() -> None:
    foreign = truth_of("operator", where=frozenset({"operator"}))
    right = scored(document("unknown", {"unknown": 0.7}, where=["operator"]), foreign)
    assert right.top_1
    assert right.open
    assert right.where_hit
    assert right.probability == right.probability_unknown == 0.7
    assert right.closure_error is None
    beside = document("rate", {"rate": 0.6, "unknown": 0.1})
    beside["ranking"][0]["with_unknown"] = 0.5
    assert scored(beside, foreign).probability_unknown == pytest.approx(0.1 + 0.5 * 0.6)
    assert scored(beside, foreign).probability == 0.1
    assert scored(document("skin", {"skin": 0.5}, alike=["skin", "rate"]), foreign).open
    assert not scored(document("skin", {"skin": 0.5}), foreign).open
    # the same of an effect that the diagnosis was made without, but not of another
    assert scored(document("unknown"), truth_of("rate"), without=["rate"]).top_1
    assert not scored(document("unknown"), truth_of("rate"), without=["skin"]).top_1
    # of a pair too, where the other alone does not explain it all
    pair = truth_of("rate", "skin")
    assert scored(document("unknown"), pair, without=["skin"]).top_1
    assert not scored(document("rate"), pair, without=["skin"]).top_1


def test_confounded_designs_want_an_honest_class() -> None:
    truth = truth_of("skin", same_class=frozenset({("skin",), ("force-scale",), ("rate",)}))
    alike = ["skin", "force-scale", "rate"]
    evenly = {"skin": 0.4, "force-scale": 0.3, "rate": 0.3}
    assert scored(document("skin", evenly, alike=alike), truth).honest
    assert scored(document("rate", evenly, alike=alike), truth).honest
    # sure without reason, be it right by luck
    assert not scored(document("skin", {"skin": 0.9}, alike=alike), truth).honest
    assert not scored(document("rate", evenly, alike=["rate", "force-scale"]), truth).honest
    # but for a reason: the others cannot be tested
    excused = document("skin", {"skin": 0.9}, not_testable=["force-scale", "rate"])
    assert scored(excused, truth).honest
    half = document("skin", {"skin": 0.9}, not_testable=["rate"])
    assert not scored(half, truth).honest


def test_closure_is_held_against_the_true_effect() -> None:
    # 1 - (0.03 - 0.01) / (0.21 - 0.01) = 0.9
    truth = truth_of("rate")
    assert truth.closed == pytest.approx(0.9)
    s = scored(document("rate", closed=0.83, closed_interval=[0.7, 0.95]), truth)
    assert s.closure_error == pytest.approx(0.07)
    assert s.covered
    assert scored(document("rate", closed_interval=[0.91, 0.95]), truth).covered is False
    assert scored(document("rate", closed_interval=[0.7, None]), truth).covered
    silent = scored(document("rate", closed=None), truth)
    assert silent.closure_error is silent.covered is None
    assert truth_of("rate", before=0.01).closed is None


def test_a_failed_diagnosis_is_wrong_everywhere() -> None:
    for truth in (truth_of(), truth_of("rate"), truth_of("operator")):
        s = score("c", NO_ANSWER, truth)
        assert s.top_1 is s.class_hit is s.answered is s.misattributed is False
        assert s.false_alarm in (None, True)
        assert s.open in (None, False)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"verdict": None}, "verdict"),
        ({"ranking": [{"effects": ["rate"], "probability": 1.2}]}, "1.2 for rate"),
        ({"ranking": [{"effects": ["rate"], "probability": 0.6}] * 2}, "sum to 1.2"),
        ({"where": [{"share": 1.0}]}, "axis"),
    ],
)
def test_a_document_that_is_none_is_refused_by_key(change: dict[str, Any], said: str) -> None:
    with pytest.raises(FileError, match=said):
        read_answer({**document("rate"), **change}, "c")


# Intervals and calibration


def test_wilson() -> None:
    # 8 of 10: Agresti & Coull, The American Statistician 52 (1998): 0.490 to 0.943
    assert wilson(8, 10) == pytest.approx((0.4902, 0.9433), abs=5e-5)
    # z² / (n + z²) for none of n
    z2 = 1.959964**2
    assert wilson(0, 20) == (0.0, pytest.approx(z2 / (20 + z2), rel=1e-6))
    assert wilson(20, 20) == (pytest.approx(20 / (20 + z2), rel=1e-6), 1.0)
    assert wilson(0, 0) == (0.0, 1.0)
    assert Rate(0, 0).share is None


def test_wilson_keeps_its_level() -> None:
    """Of 20 trials, true shares from 0.2 to 0.8: 92 to 98 % covered (exact binomial sums)."""
    for share in np.linspace(0.2, 0.8, 13):
        covered = sum(
            math.comb(20, k) * share**k * (1 - share) ** (20 - k)
            for k in range(21)
            if wilson(k, 20)[0] <= share <= wilson(k, 20)[1]
        )
        assert 0.92 < covered < 0.985


def test_calibration_error() -> None:
    # 0.9 three times, right twice: |0.667 - 0.9|, weight 3/4; 0.25 once, wrong: 0.25, weight 1/4
    error = expected_calibration_error([0.9, 0.9, 0.9, 0.25], [True, True, False, False])
    assert error == pytest.approx(0.75 * (0.9 - 2 / 3) + 0.25 * 0.25)
    assert expected_calibration_error([1.0], [True]) == 0.0
    assert expected_calibration_error([], []) is None


def test_area_under_curve() -> None:
    # of the 6 pairs, 4 in order, 1 tied, 1 reversed
    scores, positive = [0.9, 0.4, 0.4, 0.1, 0.5], [True, True, False, False, False]
    assert area_under_curve(scores, positive) == pytest.approx((4 + 0.5) / 6)
    assert area_under_curve([0.2, 0.3], [True, True]) is None


# Summary


def test_rows_by_tier_and_stratum() -> None:
    right, wrong = document("rate"), document("skin", {"skin": 0.6, "rate": 0.2})
    scores = [
        scored(right, truth_of("rate", snr=0.5), seconds=1.0),
        scored(wrong, truth_of("rate", snr=2.0), seconds=2.0),
        scored(right, truth_of("rate", snr=3.9), seconds=9.0),
        scored(right, truth_of("rate", snr=4.0)),
        scored(document("none"), truth_of()),
    ]
    summary = summarise(scores)
    whole = summary.row("library")
    assert whole is not None
    assert (whole.campaigns, whole.rates["top_1"]) == (4, Rate(3, 4))
    assert whole.probability == pytest.approx((1 + 0.2 + 1 + 1) / 4)
    assert (whole.median_seconds, whole.longest_seconds) == (2.0, 9.0)
    strata = {r.stratum: r.rates["top_1"] for r in summary.rows if r.by == "snr"}
    assert strata == {"<1": Rate(1, 1), "2-4": Rate(1, 2), ">4": Rate(1, 1)}
    none = summary.row("none")
    assert none is not None
    assert none.rates["false_alarm"] == Rate(0, 1)
    assert none.rates["where_hit"].of == 0
    middle = summary.row("library", "4-10", by="detectability")  # all at 9
    assert middle is not None
    assert middle.campaigns == 4
    assert summary.row("other") is None
    assert summary.area_unknown is None
    # leading: four right with 1.0, one wrong with 0.6
    assert summary.calibration_error == pytest.approx(0.6 / 5)
    json.dumps(summary.document(), allow_nan=False)


def test_the_table_shows_shares_with_intervals() -> None:
    rows = table_rows(summarise([scored(document("rate"), truth_of("rate"))]))
    assert [row[:3] for row in rows] == [["library", "all", "1"], ["", "snr >4", "1"]]
    assert rows[0][COLUMNS.index("top-1 %")] == "100 [21, 100]"
    text = markdown(COLUMNS, rows)
    assert "false alarm" not in text  # nothing to count
    assert text.splitlines()[2].startswith("| library | all | 1 | 1.00 | 100 [21, 100] |")
