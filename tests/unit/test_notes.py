"""Notes and warnings of characterise and fit: what asks for an act, and each kind told once."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

import planner
from planner.cli import run
from planner.errors import Caution


def test_the_sample_study_asks_for_nothing(samples: Path, capsys) -> None:
    assert run(["characterise", str(samples / "tensile")]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert not [line for line in lines if line.startswith("warning:")]
    assert [line.partition(" (")[2] for line in lines if "breaks at" in line] == [
        "9 such; --json lists all)"
    ]
    assert len(lines) == 4


def test_json_lists_what_the_terminal_counts(samples: Path, capsys) -> None:
    assert run(["characterise", str(samples / "tensile"), "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert sum("breaks at strain" in note for note in notes) == 9
    assert sum(note.endswith("time in s by its head") for note in notes) == 3


def test_cautions_are_warnings_before_the_notes(tmp_path: Path, capsys) -> None:
    strain = np.linspace(0.0, 1.0, 40)
    for name, stress in (("A-1", 1.0), ("A-2", 1.01)):
        rows = "".join(f"{e:.5f},{stress * np.sqrt(e):.5f}\n" for e in strain)
        (tmp_path / f"{name}.csv").write_text(f"strain,stress (MPa)\n{rows}", encoding="utf-8")
    assert run(["characterise", str(tmp_path)]) == 0
    kinds = [line.partition(":")[0] for line in capsys.readouterr().err.splitlines()]
    assert kinds == sorted(kinds, reverse=True)  # warnings, then notes
    assert kinds[0] == "warning"
    found = planner.characterise([tmp_path])
    cautions = [note for note in found.notes if isinstance(note, Caution)]
    assert [d.partition(";")[0] for d in cautions] == ["strain of A-1 and A-2 has no unit"]
    assert cautions[0] in json.loads(json.dumps(found.document()))["notes"]


def test_files_that_were_not_named_are_no_warning(samples: Path, capsys) -> None:
    assert run(["characterise", str(samples / "tensile" / "soft-1.txt")]) == 0
    assert "note: specimen soft-2: no curve among the files (8 such" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["characterise", "fit"])
def test_quiet_says_neither(samples: Path, tmp_path: Path, capsys, command: str) -> None:
    options = [str(samples / "tensile" / "soft-1.txt"), "-q", "--width-mm", "3", "--thickness-mm",
               "2", "--gauge-mm", "15", "-o", str(tmp_path / "out")]  # fmt: skip
    assert run([command, *options]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("palette", planner.load_printer("connex3").palettes)
@pytest.mark.parametrize("at_strain", [0.01, 0.1, 0.3])
def test_notes_on_a_palette_are_short(palette: str, at_strain: float) -> None:
    for note in planner.list_materials(palette=palette, at_strain=at_strain).remarks():
        assert len(note) <= 120, note


def test_notes_on_tests_are_short_and_said_once(tmp_path: Path) -> None:
    """Of records with a toe, a copy, no unit, a fall, an offset, and one specimen a material."""
    strain = np.linspace(0.0, 1.0, 80)
    rubber = 0.4 * (1.0 + strain - (1.0 + strain) ** -2)
    records = {
        "neat": rubber,
        "late": np.interp(strain - 0.08, strain, rubber),
        "falls": rubber * np.interp(strain, [0.0, 0.6, 1.0], [1.0, 1.0, 0.5]),
        "offset": rubber + 0.05,
        "steepens": 0.4 * strain**2 + 0.02 * strain,
    }
    for name, stress in records.items():
        rows = "".join(f"{e:.5f},{s:.6f}\n" for e, s in zip(strain, stress, strict=True))
        for number in (1, 2) if name == "neat" else (1,):
            file = tmp_path / f"{name}-{number}.csv"
            file.write_text(f"strain,stress (MPa)\n{rows}", encoding="utf-8")
    options = {"law": "ogden-1", "starts": 4, "compare": False}
    for notes in (planner.characterise([tmp_path]).document()["notes"],
                  planner.fit([tmp_path], **options).document()["notes"]):  # fmt: skip
        assert len(notes) == len(set(notes)) > 5
        for note in notes:
            assert len(note) <= 120, note


def test_a_note_is_said_where_the_plan_is_made_and_not_again(tmp_path, capsys) -> None:
    part = tmp_path / "bar.stl"
    trimesh.creation.box((60.0, 10.0, 6.0)).export(part)
    out = str(tmp_path / "out" / "graded")
    assert run(["grade", str(part), "--from", "Tango", "--to", "Vero", "-o", out]) == 0
    notes = [line for line in capsys.readouterr().err.splitlines() if line.startswith("note: ")]
    assert len(notes) == 1
    assert len(notes[0]) <= 120
    assert run(["check", out]) == 0
    assert capsys.readouterr().err == ""


def test_usage_errors_name_the_command_that_was_run(capsys) -> None:
    for words, command in (
        (["grade", "--bnads", "3"], "planner grade"),
        (["gap", "design", "--bnads"], "planner gap design"),
        (["gap", "desing"], "planner gap"),
        (["grdae"], "planner"),
    ):
        assert run(words) == 2
        assert capsys.readouterr().err.endswith(f"(see {command} --help)\n")
