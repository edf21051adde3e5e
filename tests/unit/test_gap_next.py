"""Where a campaign stands, and the command that comes next."""

import json
import os
import shutil
from pathlib import Path

import pytest

from planner.cli import run

LAB = Path(__file__).parents[2] / "samples" / "warm-lab"
DIAGNOSIS = {
    "schema": 1,
    "campaign": "warm lab (simulated)",
    "specimens": 18,
    "verdict": "temperature",
    "ranking": [{"effects": ["temperature"], "probability": 0.97}],
    "class": [["temperature"]],
    "not_testable": [],
    "where": [],
    "gap": {
        "before": 0.21,
        "after": 0.03,
        "floor": 0.025,
        "closed": 0.97,
        "closed_interval": [0.93, 0.99],
        "recalibration_only": 0.35,
        "held_out": "leave one condition out",
    },
    "tested": {"temperature_C": [23.0, 40.0]},
    "effect": {"temperature": {"parameters": {"slope": 0.045}, "interval": {}}},
    "remainder": {"significant": False, "where": []},
    "data_quality": [],
    "next_experiments": [],
}


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(LAB, tmp_path / "lab")
    monkeypatch.chdir(tmp_path)
    return Path("lab")


def _standing(capsys: pytest.CaptureFixture[str]) -> dict:
    assert run(["gap", "next", "lab", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_from_a_list_alone_to_a_correction(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    curves = (lab / "curves.csv").read_text()
    heading, _, rows = curves.partition("\n")
    (lab / "curves.csv").write_text(f"{heading}\n")
    found = _standing(capsys)
    assert found["missing"] == found["listed"]
    assert found["next"] == ""

    first = found["listed"][0]
    lines = [line for line in rows.splitlines(keepends=True) if not line.startswith(f"{first},")]
    (lab / "curves.csv").write_text(f"{heading}\n{''.join(lines)}")
    assert _standing(capsys)["missing"] == [first]
    assert run(["gap", "next", "lab"]) == 0
    assert f"missing: specimen {first}; pull" in capsys.readouterr().out

    (lab / "curves.csv").write_text(curves)
    assert _standing(capsys)["next"] == "planner gap diagnose lab -o lab-diagnosis"

    for campaign, expected in (("another", "diagnose lab"), (DIAGNOSIS["campaign"], "correct why")):
        Path("why").mkdir(exist_ok=True)
        document = DIAGNOSIS | {"campaign": campaign}
        Path("why/diagnosis.json").write_text(json.dumps(document))
        assert expected in _standing(capsys)["next"]
    os.utime("why/diagnosis.json", (0, 0))  # of another campaign of that name, before this one
    assert _standing(capsys)["next"] == "planner gap diagnose lab -o lab-diagnosis"


def _diagnosed(folder: str, **more: object) -> None:
    Path(folder).mkdir(exist_ok=True)
    (Path(folder) / "diagnosis.json").write_text(json.dumps(DIAGNOSIS | more))


def test_from_within_the_folder_it_is_the_same_campaign(
    lab: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen from within, the report goes beside the campaign too, where it is then found."""
    monkeypatch.chdir(lab)
    for place in (".", "../lab"):
        assert run(["gap", "next", place, "--json"]) == 0
        expected = Path.cwd().with_name("lab-diagnosis")
        command = json.loads(capsys.readouterr().out)["next"]
        assert command == f"planner gap diagnose {place} -o {expected}"
    _diagnosed("../lab-diagnosis")
    assert run(["gap", "next", "."]) == 0
    assert "planner gap correct" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["curves.csv", "campaign.toml", "palette.toml", "fields.csv"])
def test_what_changed_since_is_diagnosed_anew(
    lab: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """In place of the earlier report: the command runs as it is written."""
    _diagnosed("lab-diagnosis")
    assert "correct" in _standing(capsys)["next"]
    (lab / name).touch()
    later = Path("lab-diagnosis/diagnosis.json").stat().st_mtime + 10.0
    os.utime(lab / name, (later, later))
    assert _standing(capsys)["next"] == "planner gap diagnose lab -o lab-diagnosis --force"


def test_a_specimen_that_is_not_compared_hides_no_diagnosis(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of those that were diagnosed alike the last one counts, whatever it is called."""
    _diagnosed("lab-diagnosis", specimens=17)
    assert _standing(capsys)["diagnosis"] == "lab-diagnosis"
    _diagnosed("another", specimens=17, verdict="unknown", effect={})
    later = Path("lab-diagnosis/diagnosis.json").stat().st_mtime + 10.0
    for first, last in (("lab-diagnosis", "another"), ("another", "lab-diagnosis")):
        os.utime(f"{first}/diagnosis.json", (later, later))
        os.utime(f"{last}/diagnosis.json", (later + 1.0, later + 1.0))
        assert _standing(capsys)["diagnosis"] == last
    _diagnosed("whole")  # of all 18, which no other campaign's few go before
    os.utime("whole/diagnosis.json", (later, later))
    assert _standing(capsys)["diagnosis"] == "whole"


def test_of_a_diagnosis_it_says_the_verdict_and_what_follows(lab: Path, capsys) -> None:
    Path("why").mkdir()
    Path("why/diagnosis.json").write_text(json.dumps(DIAGNOSIS))
    for path in ("why", "why/diagnosis.json"):
        assert run(["gap", "next", path]) == 0
        assert capsys.readouterr().out.splitlines() == [
            f"diagnosed in {path}: temperature",
            f"next: planner gap correct {path} --temperature-C 40 -o palette-corrected.toml",
        ]


def test_a_list_is_of_the_palette_that_the_campaign_beside_it_names(lab: Path) -> None:
    """A lab's own material is known; without the campaign's palette it is not."""
    palette = (lab / "palette.toml").read_text().replace('"TangoPlus"', '"Latex"')
    (lab / "palette.toml").write_text(palette)
    listed = (lab / "specimens.csv").read_text().replace("TangoPlus", "Latex")
    (lab / "specimens.csv").write_text(listed)
    simulate = ["gap", "simulate", "--design"]
    assert run([*simulate, "lab/specimens.csv", "-o", "made", "-q"]) == 0
    Path("alone.csv").write_text(listed)
    assert run([*simulate, "alone.csv", "-o", "other", "-q"]) == 2


def test_conditions_that_no_one_wrote_down_are_told(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heading, *rows = (lab / "specimens.csv").read_text().splitlines()
    at = heading.split(",").index("temperature_C")
    cells = rows[0].split(",")
    cells[at] = ""
    (lab / "specimens.csv").write_text("\n".join([heading, ",".join(cells), *rows[1:]]) + "\n")
    assert _standing(capsys)["unknown"] == {"temperature_C": [cells[0]]}
    assert run(["gap", "next", "nothing"]) == 2
