"""The folder of a diagnosis is whole, the same each time, and replaces nothing foreign."""

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

import planner
from planner.errors import OutputError
from planner.gap.diagnosis import Diagnosis, QualityProblem, read_diagnosis
from planner.gap.summary import percent, probability
from planner.report.gap_figures import figures_of
from planner.report.gap_page import verdict_text, write_diagnosis

Examples = dict[str, Diagnosis]


class _Page(HTMLParser):
    """Collects tags and what they point to; void tags aside, every one must be closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.add(tag)
        self.links += [v or "" for k, v in attrs if k in ("src", "href")]
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attrs) -> None:
        self.tags.add(tag)


def test_the_folder_is_whole_and_the_same_each_time(diagnosis: Diagnosis, tmp_path: Path) -> None:
    first, second = (write_diagnosis(diagnosis, tmp_path / name) for name in ("a", "b"))
    files = sorted(p.relative_to(first).as_posix() for p in first.rglob("*") if p.is_file())
    asked = bool(diagnosis.next_experiments)
    figures = ["closure", "evidence"] + ["curves", "residuals"] * (diagnosis.traces is not None)
    assert files == sorted(
        [
            "diagnosis.json",
            "ranking.csv",
            *(["next-specimens.csv", "profiles/soft-to-hard.csv"] if asked else []),
            "report.html",
            "where.csv",
            *(f"figures/{name}.svg" for name in figures),
        ]
    )
    for name in files:
        assert (first / name).read_bytes() == (second / name).read_bytes()
    page = _Page((first / "report.html").read_text(encoding="utf-8"))
    assert page.open == []
    assert page.links == []
    assert not page.tags & {"link", "img", "iframe"}
    text = (first / "report.html").read_text(encoding="utf-8")
    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    assert len(scripts) == 1
    digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
    assert f"default-src 'none'; script-src 'sha256-{digest}'" in text
    assert "spring &lt;1&gt;" in (first / "report.html").read_text(encoding="utf-8")
    ranking = (first / "ranking.csv").read_text(encoding="utf-8").splitlines()
    assert ranking[0] == "hypothesis,probability,with_unknown,same_class"
    assert ranking[1].startswith(f"{diagnosis.verdict},")


def test_nothing_foreign_is_replaced(tmp_path: Path, examples: Examples) -> None:
    target = write_diagnosis(examples["rate"], tmp_path / "out")
    with pytest.raises(OutputError, match="`force`"):
        write_diagnosis(examples["none"], target)
    write_diagnosis(examples["none"], target, force=True)
    assert read_diagnosis(target).verdict == "none"
    (target / "figures" / "mine.txt").write_text("mine")
    write_diagnosis(examples["rate"], target, force=True)
    assert read_diagnosis(target).verdict == "rate"
    assert (target / "figures" / "mine.txt").read_text() == "mine"
    (target / "where.csv").write_text("mine")
    with pytest.raises(OutputError, match=r"where\.csv was changed since"):
        write_diagnosis(examples["none"], target, force=True)
    assert read_diagnosis(target).verdict == "rate"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_the_next_specimens_are_read_back(examples: Examples, tmp_path: Path) -> None:
    """As the list of a campaign that is yet to be measured, bars with their designs."""
    own = replace(planner.load_printer("connex3").palette(), name="lab")
    folder = write_diagnosis(replace(examples["rate"], own_palette=own), tmp_path / "out")
    made = planner.synthesise_campaign(folder / "next-specimens.csv")
    assert made.palette.name == "lab"
    assert [s.id for s in made.specimens] == ["SIM-next-2a", "SIM-next-2b"]
    first = made.specimens[0]
    assert first.profile is not None
    assert first.profile.coordinate.tolist() == [0.0, 0.0, 1.0, 1.0]
    assert (first.width_mm, first.rate_mm_s, first.soak_h, first.temperature_C) == (
        6.0, 0.5, 0.0, None,
    )  # fmt: skip
    assert first.strain.max() == pytest.approx(0.15)


def test_the_page_has_all_of_the_verdict_and_each_thing_once(
    examples: Examples, tmp_path: Path
) -> None:
    """Where the terminal stops, the page goes on: every problem, place, hypothesis and size."""
    problems = tuple(QualityProblem(f"Q{k}", "rate", f"fault {k}") for k in range(20))
    found = replace(examples["rate"], data_quality=problems)
    page = (write_diagnosis(found, tmp_path / "out") / "report.html").read_text(encoding="utf-8")
    headings = re.findall(r"<h2>(.*?)</h2>", page)
    assert len(headings) == len(set(headings))
    assert [page.count(f"fault {k}.<") for k in range(20)] == [1] * 20
    assert "fault 19" not in verdict_text(found)
    for words in ("machine-compliance+rate</td>", "column operator</td>", "soft</td>", "skin."):
        assert words in page, words


def test_the_head_has_the_verdict_in_figures_and_figures_come_first(
    examples: Examples, tmp_path: Path
) -> None:
    """What a reader asks, in order: measured against predicted, the cause, where it lies."""
    found = examples["rate"]
    page = (write_diagnosis(found, tmp_path / "out") / "report.html").read_text(encoding="utf-8")
    head, rest = page.split("</header>")
    facts = dict(re.findall(r'<dt>(.*?)</dt><dd class="\w*">(.*?)</dd>', head))
    gap = found.gap
    assert facts == {
        "verdict": "rate",
        "probability": probability(found.ranking[0].probability),
        "gap before": percent(gap.before),
        "gap after": percent(gap.after),
        "scatter of replicates": percent(gap.floor),
    }
    figures = [rest.index(svg.decode().strip()) for svg in figures_of(found).values()]
    assert list(figures_of(found))[-3:] == ["evidence", "residuals", "closure"][-3:]
    assert figures == sorted(figures)
    assert figures[-1] < rest.index("<h2>")
