"""planner gap diagnose on folders with something wrong, the diagnosis itself included.

What is refused in reading is in test_campaign.py; here one of each kind goes all the way.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import planner
from planner.cli import run
from planner.errors import ArgumentError, FileError

HEAD = (
    "specimen,material,profile,width_mm,thickness_mm,gauge_mm,rate_mm_s,temperature_C,soak_h,"
    "age_days,orientation,protocol,batch\n"
)
ROWS = (
    "A,FLX9760,,6,3,25,0.85,23,0,9,x,monotonic,1\n"
    "B,FLX9760,,6,3,25,0.85,23,0,9,x,monotonic,1\n"
    "C,TangoPlus,,6,3,25,8.5,23,0,9,x,monotonic,1\n"
    "D,,profiles/bar.csv,6,3,32,1,23,0,9,x,monotonic,1\n"
)
TOML = 'schema = 1\nname = "lab"\nprinter = "connex3"\npalette = "connex3-tango-vero"\n'
PROFILE = "x_mm,coordinate\n0,0\n16,0\n16,0.8\n32,0.8\n"


def curve(name: str, rate_mm_s: float, newton_per_mm: float) -> str:
    travel = [0.4 * k for k in range(20)]
    rows = (f"{name},{u / rate_mm_s:.4f},{u:.1f},{newton_per_mm * u:.4f}" for u in travel)
    return "\n".join(rows) + "\n"


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "lab"
    (folder / "profiles").mkdir(parents=True)
    (folder / "campaign.toml").write_text(TOML)
    (folder / "specimens.csv").write_text(HEAD + ROWS)
    (folder / "profiles" / "bar.csv").write_text(PROFILE)
    (folder / "curves.csv").write_text(
        "specimen,time_s,displacement_mm,force_N\n"
        + curve("A", 0.85, 0.9) + curve("B", 0.85, 0.93) + curve("C", 8.5, 0.3)
        + curve("D", 1.0, 0.4)
    )  # fmt: skip
    return folder


def change(lab: Path, name: str, old: str, new: str) -> None:
    path = lab / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("name", "old", "new", "says"),
    [
        ("specimens.csv", "C,TangoPlus", "C,TangoMinus",
         ["specimens.csv, specimen C", "'TangoMinus'", "did you mean TangoPlus", "it has Tango"]),
        ("specimens.csv", "material,", "stuff,", ["specimens.csv, line 2", "material"]),
        ("specimens.csv", "rate_mm_s", "rate_mm_min", ["'rate_mm_min'", "rate_mm_s"]),
        ("specimens.csv", "25,8.5,", "25,-8.5,", ["line 4: rate_mm_s is '-8.5'", "above 0"]),
        ("specimens.csv", "D,,", "D,TangoPlus,", ["line 5: give exactly one of"]),
        ("specimens.csv", "9,x,monotonic,1\nD", "9,q,monotonic,1\nD", ["'q'", "x, y, z"]),
        ("curves.csv", "force_N", "force_dyn", ["unknown unit 'dyn'", "use one of 'N'"]),
        ("curves.csv", "B,0.4706,0.4,0.3720", "B,,,", ["curves.csv, line 23", "repair or remove"]),
        ("curves.csv", "B,0.4706,0.4,0.3720", "B,0.4706,0.4,inf", ["line 23", "'inf'"]),
        ("curves.csv", "B,0.4706", "B,99", ["specimen B (curves.csv), line 24", "time falls"]),
        ("profiles/bar.csv", "32,0.8", "30,0.8", ["specimen D", "30 mm", "gauge of 32 mm"]),
        ("profiles/bar.csv", "32,0.8", "32,2.8", ["2.8 at 32 mm", "from 0 to 1.5"]),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_in_one_line(
    lab: Path, capsys, name: str, old: str, new: str, says: list[str]
) -> None:
    """What, where, got against allowed, what to do; exit code 2 and nothing written."""
    change(lab, name, old, new)
    assert run(["gap", "diagnose", "lab", "-o", "out"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert all(part in printed.err for part in says), printed.err
    assert "Traceback" not in printed.err
    assert sorted(p.name for p in lab.parent.iterdir()) == ["lab"]


@pytest.mark.parametrize("wrong", [None, 3, ["lab"], b"lab"])
def test_what_is_no_folder_is_refused_from_python_too(wrong: Any) -> None:
    for read in (planner.diagnose, planner.read_campaign, planner.read_diagnosis, planner.correct):
        with pytest.raises(FileError, match=r"give (the folder of a campaign|a diagnosis\.json)"):
            read(wrong)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: planner.design_campaign("rate", 16, width_mm="6"), "`width_mm` '6'"),
        (lambda: planner.design_campaign("rate", 16, gauge_mm=[25]), "`gauge_mm`"),
        (lambda: planner.synthesise_campaign("lab", seed=None), "`seed` None"),
        (lambda: planner.synthesise_campaign("lab", seed=-1), "`seed` -1"),
    ],
)
def test_what_is_no_number_is_refused_by_its_name(
    lab: Path, call: Callable[[], object], said: str
) -> None:
    with pytest.raises(ArgumentError) as caught:
        call()
    assert said in str(caught.value)


def document(capsys) -> dict[str, object]:
    """Diagnose, and return what was printed; NaN is no JSON."""

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    assert run(["gap", "diagnose", "lab", "--json", "-o", "out"]) in (0, 1)
    printed = capsys.readouterr()
    assert printed.err == ""
    found: dict[str, object] = json.loads(printed.out, parse_constant=refuse)
    assert (Path("out") / "report.html").is_file()
    return found


@pytest.mark.slow
def test_specimens_and_curves_without_each_other_and_force_below_zero(lab: Path, capsys) -> None:
    text = (lab / "curves.csv").read_text().replace("\nA,", "\nE,")
    lines = [
        ",".join([*c[:3], f"-{c[3]}"]) if c[0] == "B" else ",".join(c)
        for c in (line.split(",") for line in text.splitlines())
    ]
    (lab / "curves.csv").write_text("\n".join(lines) + "\n")
    found = document(capsys)
    assert found["specimens"] == 3
    limitations = " | ".join(found["limitations"])
    assert "specimen A: no curve" in limitations
    assert "specimen E: a curve in curves.csv but no row" in limitations
    assert "specimen B: force is negative in tension; its sign was turned" in limitations


@pytest.mark.long
def test_strain_past_the_law_is_left_out_and_said(lab: Path, capsys) -> None:
    lines = (lab / "curves.csv").read_text().splitlines()
    longer = [
        f"{c[0]},{c[1]},{5.0 * float(c[2])},{c[3]}" if c[0] == "C" else ",".join(c)
        for c in (line.split(",") for line in lines)
    ]
    (lab / "curves.csv").write_text("\n".join(longer) + "\n")
    found = document(capsys)
    limitations = " | ".join(found["limitations"])
    assert "specimen C: compared up to 1.3 times the elongation at break" in limitations
    # Five times the speed that was declared.
    assert ("C", "rate") in [(q["specimen"], q["kind"]) for q in found["data_quality"]]


def test_one_curve_is_still_a_diagnosis_that_says_so(lab: Path, capsys) -> None:
    lines = (lab / "curves.csv").read_text().splitlines()
    kept = [line for line in lines if line[:2] in ("sp", "D,")]
    (lab / "curves.csv").write_text("\n".join(kept) + "\n")
    found = document(capsys)
    assert found["specimens"] == 1
    assert "one specimen only" in " | ".join(found["limitations"])
    assert found["gap"]["closed"] is None


def test_a_misspelt_effect_is_refused(lab: Path, capsys) -> None:
    assert run(["gap", "diagnose", "lab", "-o", "out", "--without", "rat"]) == 2
    assert "did you mean rate?" in capsys.readouterr().err
    assert not Path("out").exists()
