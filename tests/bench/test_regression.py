"""The diagnosis on campaigns whose cause is withheld: a regression with a pinned seed.

Run by hand or in CI with ``pytest -n 2 -m bench tests/bench``; two minutes on 2 free cores. The
whole check, its targets and what it measures: benchmarks/withheld/README.md. Thresholds lie below
what the method reached when they were set, by about what a change of little consequence may move of
so few campaigns; raise them when the method gets better, never lower them to let a change pass.
"""

import json
from typing import Any

import pytest

from benchmarks.withheld.run import main

SEED = 7001
"""Of a development set that nothing is tuned on."""

SPECIMENS = 30

LEAST = {
    ("library", "top_1"): 0.66,  # reached: 4 of 6
    ("library", "class_hit"): 0.66,  # 5 of 6
    ("other", "top_1"): 0.50,  # 2 of 4
    ("pair", "partly"): 0.66,  # 3 of 3
    ("pair", "top_1"): 0.66,  # 3 of 3
    ("left out", "open"): 0.33,  # 2 of 6
    ("cancelling", "top_1"): 0.50,  # 2 of 2
    ("unclaimed", "open"): 0.50,  # 2 of 2
}
"""Shares of a tier's campaigns, at least."""

MOST = {
    ("library", "misattributed"): 0.17,  # reached: none of 6
    ("other", "companion"): 0.25,  # 1 of 4
    ("none", "false_alarm"): 0.25,  # none of 4
    ("none-t4", "false_alarm"): 0.50,  # none of 2
    ("none-scatter", "false_alarm"): 0.50,  # 1 of 2
    ("left out", "misattributed"): 0.50,  # 3 of 6
}
"""Shares of a tier's campaigns, at most."""

LEAST_LOG_GAIN = 2.6
"""Of all campaigns, in nats above a guess; reached: 3.10."""

LEAST_AREA_UNKNOWN = 0.65
"""Reached: 0.78."""

MOST_CLOSURE_ERROR = {"library": 0.10, "other": 0.10, "cancelling": 0.10}
"""Medians of a tier's campaigns; reached: 0.065, 0.024 and 0.018."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("withheld") / "run"
    command = ["--set", "development", "--seed", str(SEED), "--specimens", str(SPECIMENS)]
    assert main([*command, "--subset", "ci", "--jobs", "2", "-o", str(folder)]) in (0, 1)
    found: dict[str, Any] = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    return found


def test_no_figure_has_fallen_behind(results: dict[str, Any]) -> None:
    rates = {r["tier"]: r["rates"] for r in results["summary"]["rows"] if r["by"] == "all"}
    behind = []
    for (tier, name), least in LEAST.items():
        share = rates[tier][name]["share"]
        if share < least:
            behind.append(f"{tier}, {name}: {share:.2f}, at least {least:.2f}")
    for (tier, name), most in MOST.items():
        share = rates[tier][name]["share"]
        if share > most:
            behind.append(f"{tier}, {name}: {share:.2f}, at most {most:.2f}")
    assert not behind, "\n".join(behind)


def test_probabilities_are_worth_something(results: dict[str, Any]) -> None:
    overall = results["summary"]["overall"]
    assert overall["log_gain"] >= LEAST_LOG_GAIN
    assert overall["area_unknown"] >= LEAST_AREA_UNKNOWN


def test_how_far_the_gap_closes_is_said_rightly(results: dict[str, Any]) -> None:
    rows = {r["tier"]: r for r in results["summary"]["rows"] if r["by"] == "all"}
    behind = {t: rows[t]["closure_error"] for t in MOST_CLOSURE_ERROR}
    assert all(behind[tier] <= most for tier, most in MOST_CLOSURE_ERROR.items()), behind


def test_every_campaign_was_answered(results: dict[str, Any]) -> None:
    assert results["problems"] == {}
