"""The runner of the withheld check, with a diagnosis that always gives one answer."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks.withheld.comparison import compare
from benchmarks.withheld.leave_one_out import Case, by_effect
from benchmarks.withheld.method import method_sha256
from benchmarks.withheld.run import main
from benchmarks.withheld.run_log import append_run, check_not_scored
from benchmarks.withheld.scoring import NO_ANSWER, CampaignTruth, Score, read_answer, score
from benchmarks.withheld.summary import summarise
from benchmarks.withheld.targets import LEFT_OUT, targets
from benchmarks.withheld.written import put_into_page, results_markdown
from planner.errors import FileError


def document(verdict: str, **gap: float | None) -> dict[str, Any]:
    """Make the document of a diagnosis that is certain."""
    effects = [] if verdict == "none" else verdict.split("+")
    return {
        "verdict": verdict,
        "ranking": [{"effects": effects, "probability": 1.0}],
        "class": [effects],
        "where": [{"axis": "rate_mm_s"}],
        "gap": gap,
    }


def truth(*effects: str, tier: str = "library", snr: float = 5.0) -> CampaignTruth:
    where = frozenset({"rate_mm_s"}) if effects else frozenset()
    own = frozenset({effects})
    return CampaignTruth(tier, effects, own, where, snr if effects else None, 9.0, 0.2, 0.03, 0.01)


def scored(verdict: str, hidden: CampaignTruth, **more: Any) -> Score:
    return score("c", read_answer(document(verdict), "c"), hidden, **more)


def test_targets_are_held_by_tier_and_beside_the_oracle() -> None:
    scores = [
        replace(scored("rate", truth("rate"), seconds=2.0, megabytes=400.0), oracle=True),
        replace(scored("rate", truth("rate", snr=3.0), seconds=12.0), oracle=False),
        replace(scored("skin", truth("rate", snr=3.0)), oracle=True),
        scored("skin", truth("rate", snr=3.0)),  # the oracle was not asked
        replace(scored("skin", truth("rate", tier="other")), oracle=True),
        scored("rate", truth(tier="none")),
        scored("rate+skin", truth("rate", "skin", tier="pair")),
        replace(scored("unknown", truth("rate"), without=["rate"]), tier=LEFT_OUT, oracle=False),
    ]
    by_name = {t.name: t for t in targets(scores, 30)}
    library = by_name["library: named, of what the oracle names"]
    # ours 2 of 3, the oracle's 2 of 3; Wilson's 21 to 94 % of 3 are 31 to 141 % of 2
    assert library.got == "100 % [31, 141] (2/2)"
    assert library.met
    assert by_name["other forms: named, of what the oracle names"].got == "0 % [0, 79] (0/1)"
    assert by_name["one effect: truth in the class"].got == "40 % [12, 77] (2/5)"
    assert by_name["left out: unknown or a class"].met
    assert by_name["none: false alarm"].met is False
    assert by_name["two effects: both"].met
    assert by_name["campaigns, the fewest of library, other, left out and none"].met is False
    assert by_name["how far: median closure error"].met is None
    # one of 12 s; 10 s are allowed for 30 specimens, 30 s for 120
    assert by_name["cost: longest of 30 specimens"].met is False
    assert by_name["cost: most memory of a process"].got == "400 MB"
    assert targets(scores, 120)[-2].met
    row = summarise(scores).row("library")
    assert row is not None
    assert (row.rates["oracle"].hits, row.rates["beside_oracle"].of) == (2, 3)


def test_what_an_effect_left_out_leaves() -> None:
    hidden = truth("rate")
    full = document("rate", before=0.2, after=0.04, floor=0.02)
    for verdict, after, expected in (("unknown", None, 0.2), ("skin", 0.15, 0.15)):
        less = document(verdict, before=0.2, after=after)
        case = Case(
            effect="rate",
            true_effect=hidden.with_true_effect,
            full=read_answer(full, "c"),
            full_score=scored("rate", hidden),
            less=read_answer(less, "c"),
            less_score=scored(verdict, hidden, without=["rate"]),
        )
        (row,) = by_effect([case])
        assert (row.before, row.without, row.with_effect, row.floor) == (0.2, expected, 0.04, 0.02)
        assert (row.true_effect, row.named, row.where_hits) == (0.03, 1, 1)
        assert (row.unknown, row.misattributed) == ((1, 0) if verdict == "unknown" else (0, 1))
        assert row.declared == 0
    failed = score("c", NO_ANSWER, hidden, without=["rate"])
    lost = Case("rate", 0.03, None, failed, None, failed)
    (row,) = by_effect([lost])
    assert (row.before, row.unknown, row.declared, row.misattributed) == (None, 0, 0, 0)


def test_a_run_from_making_to_markdown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[tuple[str, ...]] = []

    def diagnose(campaign: object, *, seed: int, without: tuple[str, ...]) -> SimpleNamespace:
        asked.append(without)
        verdict = "unknown" if without else "none"
        return SimpleNamespace(document=lambda: document(verdict))

    monkeypatch.setattr("planner.gap.diagnose.diagnose", diagnose)
    folder = tmp_path / "run"
    command = ["--set", "development", "--seed", "5", "--count", "1", "--specimens", "20"]
    command += ["--jobs", "1", "--subset", "ci", "-o", str(folder)]
    assert main(command) == 1  # "none" to everything misses targets
    # eight tiers, and the library's campaign once more without its effect
    assert len(asked) == 9
    assert sum(bool(without) for without in asked) == 1
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    rows = {r["tier"]: r["rates"] for r in results["summary"]["rows"] if r["by"] == "all"}
    assert rows["none"]["false_alarm"]["share"] == 0.0
    assert rows["library"]["missed"]["share"] == 1.0
    assert rows[LEFT_OUT]["open"]["share"] == 1.0
    assert results["left_out"][0]["unknown"] == 1
    assert results["problems"] == {}
    said = capsys.readouterr().out
    assert said.startswith(results["truth_sha256"])
    assert said.rstrip().endswith((folder / "results.md").read_text(encoding="utf-8").rstrip())
    assert main(command) == 2
    # going on has nothing left to diagnose, not even after a cut-off line
    with (folder / "outcomes.jsonl").open("a") as journal:
        journal.write('{"campaign": "')
    before = (folder / "results.json").read_bytes()
    assert main([*command, "--resume"]) == 1
    assert len(asked) == 9
    assert (folder / "results.json").read_bytes() == before
    assert main([*command, "--resume", "--seed", "6"]) == 2


def results(method: str = "a" * 64, **made_by: Any) -> dict[str, Any]:
    """Make results of one campaign, as far as they are logged and written."""
    given = {"set": "final", "seed": 4, "count": 18, "specimens": 30, "subset": "all"} | made_by
    right, wrong = scored("rate", truth("rate")), scored("skin", truth("rate"))
    return {
        "planner": "1.2.3",
        "method_sha256": method,
        "truth_sha256": "b" * 64,
        "made_by": given,
        "targets": [vars(t) for t in targets([right], 30)],
        "summary": summarise([right]).document(),
        "log_score": -0.25,
        "left_out": [],
        "naive": compare([right], [wrong]),
        "problems": {},
    }


def test_a_method_is_scored_on_the_final_set_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "docs" / "runs.md"
    method = method_sha256()
    command = ["--set", "final", "--seed", "5", "--count", "1", "-o", str(tmp_path / "run")]
    assert main(command) == 2
    assert "--log" in capsys.readouterr().err
    append_run(log, results("c" * 64), "c" * 64)
    append_run(log, results(set="development"), method)
    check_not_scored(log, method)  # another method, and another set
    append_run(log, results(), method)
    assert main([*command, "--log", str(log)]) == 2
    assert "scored on the final set already, with seed 4" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    log.write_text(
        log.read_text(encoding="utf-8").replace("| left out |", "| left out, as it was |"),
        encoding="utf-8",
    )
    check_not_scored(log, "d" * 64)  # the log's last table has other figures
    with pytest.raises(FileError, match="scored on the final set already"):
        check_not_scored(log, method)
    append_run(log, results("d" * 64), "d" * 64)
    lines = log.read_text(encoding="utf-8").splitlines()
    assert sum(line.startswith("| planner") for line in lines) == 2
    assert lines.pop().split(" | ")[1] == "d" * 16
    lines = lines[:-3]  # without the second table's head and what is between
    assert [line.split(" | ")[1] for line in lines[-3:]] == ["c" * 16, method[:16], method[:16]]
    assert lines[-1].split(" | ")[-3:-1] == ["-0.25", "-13.82"]
    other = tmp_path / "page.md"
    other.write_text("# A page\n", encoding="utf-8")
    with pytest.raises(FileError, match="not a log"):
        check_not_scored(other, method)


def test_the_method_is_its_source(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "a.py").write_text("x = 1\n", encoding="utf-8")
    first = method_sha256(tmp_path)
    (tmp_path / "notes.txt").write_text("not a source", encoding="utf-8")
    assert method_sha256(tmp_path) == first
    (tmp_path / "sub" / "b.py").write_text("", encoding="utf-8")
    second = method_sha256(tmp_path)
    (tmp_path / "sub" / "b.py").rename(tmp_path / "b.py")
    assert len({first, second, method_sha256(tmp_path)}) == 3


def test_the_page_has_both_sides_of_the_comparison() -> None:
    text = results_markdown(results())
    assert text.startswith("## The final set, seed 4\n")
    # one campaign: ours certain of the truth, the naive one of another effect; 173 hypotheses
    assert "| all | 1 | 100 [21, 100] | 0 [0, 79] | 0 [0, 79] | 100 [21, 100] |" in text
    assert "0.00 | -13.82 | -5.15 |" in text


def test_results_go_into_a_page_where_it_has_room(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# A\n<!-- results -->\nold\n<!-- end of results -->\nB\n", encoding="utf-8")
    for text in ("new", "newer"):
        put_into_page(page, text)
    expected = "# A\n<!-- results -->\n\nnewer\n<!-- end of results -->\nB\n"
    assert page.read_text(encoding="utf-8") == expected
    page.write_text("# A\n", encoding="utf-8")
    with pytest.raises(FileError, match="no place for results"):
        put_into_page(page, "new")
    assert page.read_text(encoding="utf-8") == "# A\n"
