"""planner characterise as a newcomer runs it."""

import json
from pathlib import Path

import pytest

from planner.cli import run as planner

ROOT = Path(__file__).resolve().parents[2]
STUDY = ROOT / "samples" / "tensile"


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    code = planner(["characterise", *map(str, arguments)])
    return code, *capsys.readouterr()


def test_files_to_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "materials.csv"
    code, out, err = run(capsys, STUDY, "-o", output)
    assert code == 0
    assert "SYN-rigid: plastic" in out
    assert "ASTM D638" in err
    first = output.read_bytes()
    files = sorted(path for path in STUDY.iterdir() if path.is_file())
    code, out, err = run(capsys, *files, "-o", output, "--force", "--quiet")
    # The script that made the study lies beside it and is no tensile file.
    assert (code, out, err) == (0, "", "")
    assert output.read_bytes() == first


def test_a_file_that_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "materials.csv"
    output.write_text("mine")
    code, out, err = run(capsys, STUDY, "-o", output)
    assert (code, out) == (2, "")
    assert "replace it with --force" in err
    assert output.read_text() == "mine"


def test_json_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, STUDY, "--json", "--at-strain", "0.2")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert document["schema"] == 1
    assert [m["deformation"] for m in document["materials"]] == ["elastic", "elastic", "plastic"]
    assert document["findings"] == []
    assert "secant_0.2_MPa" in document["materials"][0]["figures"]


def test_specimens_that_disagree_are_a_finding(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("soft-1.txt", "rigid-1.csv"):
        (tmp_path / name).write_bytes((STUDY / name).read_bytes())
    sizes = ("--width-mm", "3", "--thickness-mm", "2", "--gauge-mm", "15", "--material", "X")
    code, _, err = run(capsys, tmp_path, *sizes)
    assert code == 1
    assert "X: its specimens disagree" in err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,displacement_mm,force_N\n0,0,0\n", "1 points"),
        ("displacement_stone,force_N\n1,1\n", "unknown unit 'stone'"),
        ("", "the file is empty"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    path, output = tmp_path / "a.csv", tmp_path / "out.csv"
    path.write_text(text)
    sizes = ("--width-mm", "3", "--thickness-mm", "2", "--gauge-mm", "15")
    code, out, err = run(capsys, path, *sizes, "-o", output)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not output.exists()


def test_an_output_that_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = run(capsys, STUDY, "-o", tmp_path / "none" / "out.csv")
    assert code == 2
    assert "there is no folder" in err
