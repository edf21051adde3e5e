"""The bundled campaign, diagnosed as a user's first one is: in a room warmer than the palette's."""

import json
from pathlib import Path

import pytest

import planner
from planner.cli import run

SAMPLE = Path(__file__).parents[2] / "samples" / "warm-lab"


def test_the_sample_is_warm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["gap", "diagnose", str(SAMPLE), "--json", "-o", str(tmp_path / "diagnosis")]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"] == "temperature"
    # The sample was made with 0.045 per kelvin; its own scatter of 3 % on four warm specimens
    # against fourteen others is worth 0.001 per kelvin.
    low, high = document["effect"]["temperature"]["interval"]["slope"]
    assert low - 0.002 < 0.045 < high + 0.002
    assert document["where"][0]["axis"] == "temperature_C"
    assert document["gap"]["closed"] == pytest.approx(1.0, abs=0.1)
    assert {entry["id"] if isinstance(entry, dict) else entry
            for entry in document["not_testable"]} >= {"ageing", "orientation"}  # fmt: skip
    assert (tmp_path / "diagnosis" / "report.html").is_file()


def test_from_python_and_again_the_same() -> None:
    campaign = planner.read_campaign(SAMPLE)
    first, second = planner.diagnose(campaign), planner.diagnose(campaign)
    assert first.verdict == "temperature"
    assert first.ranking == second.ranking
    assert first.gap == second.gap


def test_taken_out_of_the_library_it_is_not_put_down_to_another() -> None:
    diagnosis = planner.diagnose(planner.read_campaign(SAMPLE), without=["temperature"])
    assert diagnosis.verdict == "unknown"
    assert diagnosis.where[0].axis == "temperature_C"
