"""The quick loop over campaigns that are kept: lines, what moved, and no question asked twice."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks.withheld import quick
from benchmarks.withheld.reality.__main__ import main as reality
from tests.bench.test_run import document


def test_a_version_is_asked_once_and_held_against_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "set"
    command = ["make", "--set", "development", "--tier", "library", "--count", "2", "--seed", "5"]
    command += ["--specimens", "20", "--truth", str(folder / "truth.json")]
    assert reality([*command, "-o", str(folder / "campaigns")]) == 0
    asked: list[tuple[str, ...]] = []
    verdict = "none"

    def diagnose(campaign: object, *, seed: int, without: tuple[str, ...]) -> SimpleNamespace:
        asked.append(without)
        answer = document(verdict, before=0.2, after=None, floor=0.02)
        return SimpleNamespace(document=lambda: answer)

    monkeypatch.setattr("planner.gap.diagnose.diagnose", diagnose)
    monkeypatch.setattr(quick, "method_sha256", lambda: "a" * 64)
    command = [str(folder), "--jobs", "1", "--tiers", "library,left-out,none"]
    assert quick.main([*command, "--first", "1"]) == 0
    assert [bool(without) for without in asked] == [False, True]
    assert "gap 0.20    - 0.02" in capsys.readouterr().out
    assert quick.main(command) == 0
    assert len(asked) == 4  # the second campaign alone is new
    said = capsys.readouterr().out
    assert "library  0 of 2 right" in said
    assert said.count("snr") == 4
    monkeypatch.setattr(quick, "method_sha256", lambda: "b" * 64)
    verdict = "unknown"
    assert quick.main([*command, "--against", str(folder / f"quick-{'a' * 12}.jsonl")]) == 0
    said = capsys.readouterr().out
    assert said.count("gained, was none") == 2
    assert "left-out 2 of 2 right" in said
    assert "  gained 2: " in said
