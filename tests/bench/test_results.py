"""The truth's file, and the bench as a whole: what is scored, what is said, what is refused."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks.withheld.answers import Outcome, Task
from benchmarks.withheld.bench import app, bench
from benchmarks.withheld.results import diagnose_all, read_documents, score_outcomes
from benchmarks.withheld.scoring import read_truth
from benchmarks.withheld.summary import Rate
from planner.cli import run
from planner.errors import ArgumentError, FileError, OutputError, UnknownNameError


def document(verdict: str) -> dict[str, Any]:
    """Make the document of a diagnosis that is certain."""
    effects = [] if verdict == "none" else verdict.split("+")
    return {
        "verdict": verdict,
        "ranking": [{"effects": effects, "probability": 1.0}],
        "class": [effects],
        "where": [],
        "gap": {"before": 0.2},
    }


def sealed(path: Path, campaigns: dict[str, dict[str, Any]]) -> str:
    """Write a truth file and return its hash."""
    made_by = {"set": "development", "seed": 1}
    content = {"schema": 1, "kind": "withheld-truth", "made_by": made_by, "campaigns": campaigns}
    path.write_text(json.dumps(content), encoding="utf-8")
    return hashlib.sha256(path.read_bytes()).hexdigest()


def entry(tier: str, *effects: str, snr: float = 5.0, where: str = "rate_mm_s") -> dict[str, Any]:
    return {
        "tier": tier,
        "effects": list(effects),
        "causes": [{"effect": e, "where": [where], "form": "x"} for e in effects],
        "class": [list(effects)] if effects else [],
        "snr": snr,
        "detectability": 3 * snr,
        "gap": {"before": 0.21, "with_true_effect": 0.03, "noise": 0.01},
        "scatter": {},
    }


def test_truth_is_read_and_its_hash_checked(tmp_path: Path) -> None:
    path = tmp_path / "t.json"
    digest = sealed(path, {"a": entry("library", "rate"), "b": entry("none", snr=0.0)})
    truth = read_truth(path, sha256=digest.upper())
    assert truth.sha256 == digest
    assert truth.made_by["seed"] == 1
    a, b = truth.campaigns["a"], truth.campaigns["b"]
    assert (a.effects, a.snr, a.where) == (("rate",), 5.0, {"rate_mm_s"})
    assert a.same_class == {("rate",)}
    assert (b.effects, b.snr, b.closed) == ((), None, None)
    with pytest.raises(FileError, match="not the one"):
        read_truth(path, sha256="0" * 64)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "not the JSON"),
        ('{"schema": 1, "kind": "withheld-truth", "campaigns": {}}', "no campaign"),
        ('{"schema": 2, "kind": "withheld-truth", "campaigns": {}}', "schema"),
        ('{"schema": 1, "kind": "withheld-truth", "campaigns": {"a": {}}}', "tier"),
    ],
)
def test_a_broken_truth_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "t.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=said):
        read_truth(path)


def test_effects_and_causes_must_agree(tmp_path: Path) -> None:
    sealed(tmp_path / "t.json", {"a": {**entry("library", "rate"), "effects": ["skin"]}})
    with pytest.raises(FileError, match="effects are skin, causes rate"):
        read_truth(tmp_path / "t.json")
    with pytest.raises(FileError, match="cannot be read"):
        read_truth(tmp_path / "absent.json")


# The bench as a whole


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """Two campaigns' folders and their truth; the second one's diagnosis is missing."""
    campaigns = {"a": entry("library", "rate"), "b": entry("none")}
    sealed(tmp_path / "truth.json", campaigns)
    for name in campaigns:
        (tmp_path / "campaigns" / name).mkdir(parents=True)
        (tmp_path / "campaigns" / name / "campaign.toml").write_text("schema = 1\n")
    (tmp_path / "documents").mkdir()
    (tmp_path / "documents" / "a.json").write_text(json.dumps(document("rate")))
    return tmp_path


def stand_in(monkeypatch: pytest.MonkeyPatch, verdict_of: Callable[..., str]) -> None:
    """Put another diagnosis in place of planner's, one that takes a campaign's name."""

    def diagnose(name: str, **options: Any) -> SimpleNamespace:
        verdict = verdict_of(name, **options)
        return SimpleNamespace(document=lambda: document(verdict))

    monkeypatch.setattr("planner.gap.diagnose.diagnose", diagnose)
    monkeypatch.setattr("planner.gap.campaign_folder.read_campaign", lambda folder: folder.name)


def test_no_answer_counts_as_wrong(lab: Path) -> None:
    truth = read_truth(lab / "truth.json")
    outcomes = {"b": Outcome(None, problem="no force"), "a": Outcome(document("rate"))}
    results = score_outcomes(outcomes, truth)
    assert [s.campaign for s in results.scores] == ["a", "b"]
    assert results.problems == {"b": "no force"}
    row = results.summary.row("none")
    assert row is not None
    assert row.rates["false_alarm"] == Rate(1, 1)
    broken = score_outcomes({"a": Outcome({"verdict": "rate"})}, truth)
    assert "ranking" in broken.problems["a"]
    assert broken.not_diagnosed == ("b",)
    with pytest.raises(FileError, match="campaign z"):
        score_outcomes({"z": Outcome(None)}, truth)
    with pytest.raises(UnknownNameError, match="temperature"):
        score_outcomes(outcomes, truth, without=["temprature"])


def test_documents_are_scored_again(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = {"truth": lab / "truth.json", "output": lab / "results.json"}
    assert bench(lab / "campaigns", documents=lab / "documents", **given) == 1
    said = capsys.readouterr()
    assert "100 [21, 100]" in said.out
    assert "campaign b: no answer" in said.err
    # without the campaigns' folder the one document alone is scored
    again = ["--truth", str(lab / "truth.json"), "--json", "--documents"]
    assert run([*again, str(lab / "documents")], app) == 1
    alone = json.loads(capsys.readouterr().out)
    assert alone["not_diagnosed"] == ["b"]
    assert alone["rows"][0]["rates"]["top_1"]["share"] == 1.0
    # and from the results file the same comes out
    assert read_documents(lab / "results.json") == {"a": document("rate")}
    assert run([*again, str(lab / "results.json")], app) == 1
    assert json.loads(capsys.readouterr().out) == alone


def test_wrong_usage_writes_nothing(lab: Path) -> None:
    truth = lab / "truth.json"
    with pytest.raises(ArgumentError, match="--truth"):
        bench(lab / "campaigns")
    with pytest.raises(ArgumentError, match="nothing to score"):
        bench(truth=truth)
    with pytest.raises(UnknownNameError, match="rate"):
        bench(lab / "campaigns", truth=truth, without=["rat"])
    with pytest.raises(FileError, match="no campaign"):
        bench(lab, truth=truth)
    with pytest.raises(FileError, match="not the one"):
        bench(lab / "campaigns", truth=truth, sha256="1", output=lab / "results.json")
    assert not (lab / "results.json").exists()
    (lab / "results.json").write_text("mine")
    with pytest.raises(OutputError, match="`force`"):
        bench(lab / "campaigns", truth=truth, output=lab / "results.json")
    (lab / "campaigns" / "c").mkdir()
    (lab / "campaigns" / "c" / "campaign.toml").write_text("schema = 1\n")
    with pytest.raises(FileError, match="knows nothing of this campaign"):
        bench(lab / "campaigns", truth=truth)


def test_what_stops_one_diagnosis_stops_no_other(
    lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diagnose(name: str, *, seed: int, without: tuple[str, ...]) -> str:
        if name == "a":
            raise FileError("no force in a")
        if name == "b":
            raise ZeroDivisionError("division by zero")
        return f"{name} {seed} {','.join(without)}"

    stand_in(monkeypatch, diagnose)
    stages: list[str] = []
    tasks = [Task(lab / name, ("rate",)) for name in ("a", "b", "c")]
    done = list(diagnose_all(tasks, jobs=1, stage=stages.append, seed=3))
    assert [task for task, _ in done] == tasks
    a, b, c = (outcome for _, outcome in done)
    assert (a.document, a.problem) == (None, "no force in a")
    assert (b.document, b.problem) == (
        None,
        "a bug: ZeroDivisionError: division by zero",
    )
    assert c.document == document("c 3 rate")
    assert c.seconds is not None
    assert len(stages) == 3


def test_campaigns_are_diagnosed_and_scored(
    lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts = {"a": "rate", "b": "none"}
    stand_in(monkeypatch, lambda name, **_: verdicts[name])
    given = [str(lab / "campaigns"), "--truth", str(lab / "truth.json"), "--jobs", "1", "--json"]
    assert run([*given, "--output", str(lab / "results.json")], app) == 0
    results = json.loads(capsys.readouterr().out)
    assert [s["top_1"] for s in results["scores"]] == [True, True]
    assert all(s["seconds"] >= 0.0 for s in results["scores"])
    assert set(read_documents(lab / "results.json")) == {"a", "b"}
    assert run([*given, "--without", "rate"], app) == 0
    assert [s["top_1"] for s in json.loads(capsys.readouterr().out)["scores"]] == [False, True]
