"""planner gap diagnose as its users meet it, the search for a diagnosis replaced."""

import json
import math
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from planner.cli import run
from planner.formats.units import UnitOf
from planner.gap.campaign import axis_columns
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnosis import Diagnosis, FoundEffect

Examples = dict[str, Diagnosis]


@pytest.fixture
def campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one specimen, in an otherwise empty working folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "lab"
    folder.mkdir()
    (folder / "campaign.toml").write_text(
        'schema = 1\nname = "lab"\nprinter = "connex3"\npalette = "connex3-tango-vero"\n'
    )
    (folder / "specimens.csv").write_text(
        "specimen,material,width_mm,thickness_mm,gauge_mm,rate_mm_s,operator\n"
        "A,FLX9760,6,4,33,1,Mira\n"
    )
    rows = [f"A,{t},{t},{2 * t}" for t in range(10)]
    (folder / "curves.csv").write_text(
        "\n".join(["specimen,time_s,displacement_mm,force_N", *rows]) + "\n"
    )
    return folder


def stub(monkeypatch: pytest.MonkeyPatch, diagnosis: Diagnosis) -> list[dict[str, object]]:
    """Put a diagnosis in place of the search for one; return what it is called with."""
    calls: list[dict[str, object]] = []

    def diagnose(
        campaign, *, palette=None, seed=0, without=(), unit_of=(), progress=None
    ) -> Diagnosis:
        progress(1, 2, "half")
        read = read_campaign(campaign, palette, unit_of)
        calls.append({"campaign": read, "seed": seed, "without": tuple(without)})
        return diagnosis

    monkeypatch.setattr("planner.diagnose", diagnose, raising=False)
    return calls


def test_columns_of_axes(campaign: Path) -> None:
    columns = axis_columns(read_campaign(campaign))
    assert columns["material"] == ("FLX9760",)
    assert columns["rate_mm_s"] == (1.0,)
    assert columns["temperature_C"] == (None,)
    assert columns["operator"] == ("Mira",)


@pytest.mark.parametrize(("name", "code"), [("none", 0), ("rate", 1), ("unknown", 1)])
def test_the_command_says_the_verdict(
    campaign, monkeypatch, capsys, name: str, code: int, examples: Examples
) -> None:
    calls = stub(monkeypatch, examples[name])
    assert run(["gap", "diagnose", "lab", "--without", "skin", "--seed", "7"]) == code
    printed = capsys.readouterr()
    assert f"\nVerdict: {name} " in printed.out
    assert "\x1b" not in printed.out
    assert (calls[0]["seed"], calls[0]["without"]) == (7, ("skin",))
    assert run(["gap", "diagnose", "lab", "--quiet"]) == code
    assert capsys.readouterr() == ("", "")
    assert [p.name for p in campaign.parent.iterdir()] == ["lab"]


def test_a_remainder_alone_is_a_finding(campaign, monkeypatch, examples: Examples) -> None:
    stub(monkeypatch, replace(examples["none"], remainder=examples["rate"].where[:1]))
    assert run(["gap", "diagnose", "lab", "--quiet"]) == 1


def test_json_is_the_document_and_the_file(
    campaign, monkeypatch, capsysbinary, examples: Examples
) -> None:
    stub(monkeypatch, examples["rate"])
    assert run(["gap", "diagnose", "lab", "--json", "-o", "out"]) == 1
    printed = capsysbinary.readouterr()
    written = json.loads(Path("out/diagnosis.json").read_bytes())
    assert "report.html" in written.pop("files_sha256")
    assert json.loads(printed.out) == written
    assert printed.err == b""


def test_a_folder_that_is_there_is_refused_before_the_work(
    campaign, monkeypatch, capsys, examples: Examples
) -> None:
    calls = stub(monkeypatch, examples["rate"])
    assert run(["gap", "diagnose", "lab", "-o", "out", "--quiet"]) == 1
    assert run(["gap", "diagnose", "lab", "-o", "out"]) == 2
    assert "--force" in capsys.readouterr().err
    assert run(["gap", "diagnose", "lab", "-o", "lab", "--force"]) == 2
    assert "holds no diagnosis.json" in capsys.readouterr().err
    assert len(calls) == 1
    assert run(["gap", "diagnose", "lab", "-o", "out", "--force", "--quiet"]) == 1


def test_another_palette(campaign, monkeypatch, capsys, examples: Examples) -> None:
    calls = stub(monkeypatch, examples["none"])
    assert run(["gap", "diagnose", "lab", "--palette", "connex3-tango-vero", "--quiet"]) == 0
    assert calls[0]["campaign"].palette.name == "connex3-tango-vero"  # type: ignore[attr-defined]
    for palette, said in (("connex3-tango-verp", "did you mean"), ("no.toml", "cannot be read")):
        assert run(["gap", "diagnose", "lab", "--palette", palette]) == 2
        assert said in capsys.readouterr().err


def test_force_is_read_in_the_unit_that_is_said(campaign, monkeypatch, examples: Examples) -> None:
    calls = stub(monkeypatch, examples["none"])
    assert run(["gap", "diagnose", "lab", "--unit-of", "force=kN:A", "--quiet"]) == 0
    specimen = calls[0]["campaign"].specimen("A")  # type: ignore[attr-defined]
    assert specimen.force_N[-1] == 18e3


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["diagnose", "nowhere"], "no such folder"),
        (["diagnose"], "CAMPAIGN"),
        (["diagnos", "lab"], "diagnose"),
        (["diagnose", "lab", "--seed", "-1"], "--seed"),
        (["diagnose", "lab", "--witout", "rate"], "--without"),
        (["diagnose", "lab", "--unit-of", "force=lbff"], "did you mean lbf?"),
        (["diagnose", "lab", "--unit-of", "force=lbf:a"], "did you mean A?"),
    ],
)
def test_bad_usage_is_one_line(
    campaign, monkeypatch, capsys, arguments, reason: str, examples: Examples
) -> None:
    stub(monkeypatch, examples["none"])
    assert run(["gap", *arguments]) == 2
    printed = capsys.readouterr()
    assert reason.casefold() in printed.err.casefold()
    assert printed.err.count("\n") == 1
    assert printed.out == ""


def test_gap_alone_shows_its_commands(capsys) -> None:
    assert run(["gap"]) == 0
    assert "diagnose" in capsys.readouterr().out


def test_the_verdict_ends_with_the_command_that_follows(
    campaign, monkeypatch, capsys, examples: Examples
) -> None:
    """It runs as it stands; a palette that the printer brings is not asked for again."""
    palette = read_campaign(campaign).palette
    rise = FoundEffect("rate", "power-law", {"rise": 0.2}, {"rise": (0.15, 0.25)}, {"rise": "1"})
    found = replace(
        examples["rate"], unit_of=(), effect=(rise,), tested={"strain_rate_per_s": (0.001, 0.1)},
        palette=palette.name, palette_sha256=palette.sha256,
    )  # fmt: skip
    stub(monkeypatch, found)
    run(["gap", "diagnose", "lab", "-o", "my out"])
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == ("next: planner gap correct 'my out' --rate-per-s 0.1 -o palette-corrected.toml")
    assert run(shlex.split(last.removeprefix("next: planner "))) in (0, 1)
    assert Path("palette-corrected.toml").is_file()


def test_another_unit_is_named_in_the_next_command(
    campaign, monkeypatch, capsys, examples: Examples
) -> None:
    units = (UnitOf("force", "lbf", ("A",)),)
    stub(monkeypatch, replace(examples["rate"], unit_of=units))
    run(["gap", "diagnose", "lab"])
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"next: planner gap diagnose lab --unit-of {units[0].text}"
    # What was said before stays said: files in two wrong units are read in both.
    said = ["--palette", "connex3-tango-vero", "--without", "skin", "--unit-of", "force=kgf"]
    run(["gap", "diagnose", "lab", *said])
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"next: planner gap diagnose lab {' '.join(said)} --unit-of {units[0].text}"


def test_what_changes_no_palette_is_told_by_the_command_that_follows(
    campaign, monkeypatch, capsys, examples: Examples
) -> None:
    """A gain as the factor that it is, not as its logarithm, with what to do to the forces."""
    palette = read_campaign(campaign).palette
    gain = FoundEffect("force-scale", "gain", {"log_gain": math.log(1.21)}, {}, {})
    found = replace(
        examples["rate"], verdict="force-scale", unit_of=(), effect=(gain,), palette=palette.name,
        palette_sha256=palette.sha256,
    )  # fmt: skip
    stub(monkeypatch, found)
    run(["gap", "diagnose", "lab", "-o", "out"])
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "next: planner gap correct out"
    run(shlex.split(last.removeprefix("next: planner ")))
    printed = capsys.readouterr()
    told = printed.out + printed.err
    assert "(gain 1.21 times)" in told
    assert "divide the forces by the gain" in told


def test_of_nothing_no_command_follows(campaign, monkeypatch, capsys, examples: Examples) -> None:
    for name in ("none", "unknown"):
        stub(monkeypatch, replace(examples[name], unit_of=()))
        run(["gap", "diagnose", "lab", "-o", f"out-{name}"])
        assert "next: planner" not in capsys.readouterr().out
