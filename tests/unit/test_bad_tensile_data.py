"""Tests that are not what they seem: compressed, alone, copied, in per cent; unknown intervals."""

import json
from pathlib import Path

import numpy as np
import pytest

from planner.cli import run
from planner.palette import load_palette, write_palette

RATIOS = "strain (mm/mm),stress (MPa)"
SIZES = ["--width-mm", "3", "--thickness-mm", "2", "--gauge-mm", "15"]


@pytest.fixture(autouse=True)
def _in_scratch_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write(name: str, *, strain: float = 1.0, stress: float = 1.0, heads: str = RATIOS) -> None:
    """A neo-Hookean rubber of 0.3 MPa to a strain of 1, its columns multiplied."""
    e = np.linspace(0.0, 1.0, 81)
    s = 0.3 * (1.0 + e - (1.0 + e) ** -2.0)
    rows = "".join(f"{strain * a:.6f},{stress * b:.6f}\n" for a, b in zip(e, s, strict=True))
    Path(name).write_text(f"{heads}\n{rows}", encoding="utf-8")


def test_compression_by_both_signs_is_refused_in_one_line(capsys) -> None:
    write("A.csv", strain=-5.0, stress=-6.0, heads="Travel (mm),Load (N)")
    assert run(["characterise", "A.csv", *SIZES]) == 2
    said = capsys.readouterr().err
    assert "are negative, as in compression" in said
    assert said.count("\n") == 1


def test_two_units_of_one_column_are_refused_and_one_said_twice_is_not(capsys) -> None:
    write("A.csv", strain=5.0, stress=6.0, heads="Travel (mm),Load (N)\nin,N")
    assert run(["characterise", "A.csv", *SIZES]) == 2
    assert "it says 'mm' and the row of units 'in'" in capsys.readouterr().err
    write("B.csv", strain=5.0, stress=6.0, heads="Travel (mm),Load (N)\nmm,N")
    assert run(["characterise", "B.csv", *SIZES]) == 0


def test_one_negative_channel_is_turned_with_a_warning(capsys) -> None:
    write("A.csv", strain=5.0, stress=-6.0, heads="Travel (mm),Load (N)")
    assert run(["characterise", "A.csv", *SIZES]) == 0
    assert "warning: specimen A: only force_N is negative; its sign was" in capsys.readouterr().err


def test_compression_by_the_list_is_left_out(capsys) -> None:
    write("A.csv", strain=0.5)
    Path("specimens.csv").write_text(
        "specimen,material,file,protocol\nA,rubber,A.csv,compression\n", encoding="utf-8"
    )
    assert run(["characterise", "specimens.csv"]) == 2
    said = capsys.readouterr().err
    assert "no curve to characterise: specimen A: tested in compression; left out" in said
    assert "add tensile tests" in said
    assert said.count("\n") == 1


def test_a_stress_beyond_polymers_is_refused_with_the_limit_which_can_be_lifted(capsys) -> None:
    write("A.csv", stress=1500.0)
    assert run(["characterise", "A.csv"]) == 2
    said = capsys.readouterr().err
    assert "stress reaches 787.5 MPa, more than any polymer's (500 MPa)" in said
    assert "--unit-of stress=MPa" in said
    assert run(["characterise", "A.csv", "--unit-of", "stress=MPa", "--no-compare", "--json"]) == 0
    (material,) = json.loads(capsys.readouterr().out)["materials"]
    assert material["figures"]["strength_MPa"]["mean"] == pytest.approx(787.5)


def test_one_specimen_has_no_scatter_and_a_note(capsys) -> None:
    write("A.csv")
    assert run(["characterise", "A.csv", "--json"]) == 0
    (material,) = json.loads(capsys.readouterr().out)["materials"]
    figure = material["figures"]["modulus_MPa"]
    assert (figure["sd"], figure["cv"], figure["interval"], figure["n"]) == (None, None, None, 1)
    assert run(["fit", "A.csv", "--law", "neo-hookean"]) == 0
    said = capsys.readouterr().err
    assert "note: one specimen of A" in said
    assert "warning" not in said


def test_copies_of_one_record_are_a_warning(capsys) -> None:
    write("A-1.csv")
    write("A-2.csv")
    assert run(["characterise", "A-1.csv", "A-2.csv"]) == 0
    assert "warning: specimen A-2: its record equals that of A-1" in capsys.readouterr().err


def test_replicates_in_stated_units_that_differ_agree(capsys) -> None:
    write("A-1.csv")
    write("A-2.csv", stress=1.02e3, heads="strain (mm/mm),stress (kPa)")
    write("A-3.csv", strain=100.0, stress=0.98, heads="strain (%),stress (MPa)")
    assert run(["characterise", "A-1.csv", "A-2.csv", "A-3.csv"]) == 0
    # 2 %: the specimens' own differences.
    assert "0.900 ±2.0 %" in capsys.readouterr().out


@pytest.mark.parametrize(("strain", "code", "said"), [
    (100.0, 2, "if it is in per cent, head the column 'strain (%)'"),
    # Silicones stretch as far: only the user knows.
    (9.0, 0, "warning: strain of A has no unit; taken as a fraction, up to 9; if"),
])  # fmt: skip
def test_per_cent_without_a_unit(capsys, strain: float, code: int, said: str) -> None:
    write("A.csv", strain=strain, heads="strain,stress (MPa)")
    assert run(["characterise", "A.csv"]) == code
    assert said in capsys.readouterr().err
    assert run(["characterise", "A.csv", "--unit-of", "strain=%", "--json"]) == 0
    (material,) = json.loads(capsys.readouterr().out)["materials"]
    # 1e-6: six decimals in the file.
    assert material["figures"]["elongation_at_break"]["mean"] == pytest.approx(
        strain / 100.0, abs=1e-6
    )


def test_a_palette_without_uncertainty_has_unknown_intervals(capsys) -> None:
    write("A.csv")
    assert run(["fit", "A.csv", "--law", "neo-hookean", "-q"]) == 0
    text = Path("palette.toml").read_text(encoding="utf-8")
    head = text.partition("[material.uncertainty]")[0]
    kept = [line for line in head.splitlines() if not line.startswith("modulus_log_sd")]
    Path("bare.toml").write_text("\n".join(kept) + "\n", encoding="utf-8")
    for command in (["materials"], ["invert", "-m", "0.8"]):
        run([*command, "--palette", "bare.toml"])
        said = capsys.readouterr().out
        assert "unknown" in said
        assert " .. " not in said
    run(["materials", "--palette", "bare.toml", "--json"])
    assert json.loads(capsys.readouterr().out)["materials"][0]["modulus_interval_MPa"] is None
    write_palette(load_palette("bare.toml"), "again.toml")
    assert load_palette("again.toml").materials[0].modulus_log_sd == 0.0
