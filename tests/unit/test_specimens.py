"""specimens.csv: what it tells, and every row that is refused with line and column."""

from pathlib import Path

import pytest

from planner.errors import ArgumentError, FileError
from planner.formats.specimens import is_specimens_file, read_specimens
from planner.materials.study import read_study

HEAD = "specimen,material,width_mm,thickness_mm,gauge_mm,operator\n"
CONDITIONS = "specimen,material,temperature_C,soak_h,age_days\n"


def listing(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "specimens.csv"
    path.write_text(text)
    return path


def curve(slope: float = 3.0, gauge: float = 10.0) -> str:
    lines = [f"{0.1 * i:.2f},{0.5 * i:.3f},{slope * 0.5 * i / gauge:.6f}" for i in range(30)]
    return "time_s,displacement_mm,force_N\n" + "\n".join(lines) + "\n"


def test_a_row(tmp_path: Path) -> None:
    path = listing(tmp_path, HEAD + "S1,FLX9740,3,2,,Ann\n")
    (row,) = read_specimens(path)
    assert (row.material, row.area_mm2, row.gauge_mm) == ("FLX9740", 6.0, None)
    assert row.covariates == {"operator": "Ann"}


def test_the_case_of_headings_does_not_matter(tmp_path: Path) -> None:
    path = listing(tmp_path, "Specimen,Material,Temperature_c,Operator\nS1,A,23,Ann\n")
    (row,) = read_specimens(path)
    assert (row.material, row.temperature_C) == ("A", 23.0)
    assert row.covariates == {"Operator": "Ann"}


def test_columns_that_a_spreadsheet_leaves_empty_are_none(tmp_path: Path) -> None:
    path = tmp_path / "specimens.csv"
    path.write_text("specimen,material,,\nS1,A,,\n")
    assert [row.material for row in read_specimens(path)] == ["A"]


@pytest.mark.parametrize("blank", ["", "\n", "\r\n", " \n"])
def test_a_list_of_any_name_may_begin_with_a_blank_line(tmp_path: Path, blank: str) -> None:
    path = tmp_path / "list.csv"
    path.write_bytes(f"{blank}specimen,material,file\r\nA,TPU,a.csv\r\n".encode())
    assert is_specimens_file(path)
    assert [row.material for row in read_specimens(path)] == ["TPU"]


def test_measured_sizes_go_first(tmp_path: Path) -> None:
    text = "specimen,material,width_mm,thickness_mm,measured_width_mm\nS1,A,3,2,3.5\n"
    assert read_specimens(listing(tmp_path, text))[0].area_mm2 == 7.0


@pytest.mark.parametrize("heading", ["diameter_mm", "Diameter (mm)"])
def test_a_diameter_is_a_section(tmp_path: Path, heading: str) -> None:
    """It was a covariate, and the section unknown."""
    listing(tmp_path, f"specimen,material,{heading},gauge_mm\nS1,A,10,20\n")
    (tmp_path / "S1.csv").write_text(curve())
    assert read_study(tmp_path).dimensions["S1"].area_mm2 == pytest.approx(25.0 * 3.14159265)


def test_a_diameter_of_the_list_goes_before_an_area_in_a_files_head(tmp_path: Path) -> None:
    listing(tmp_path, "specimen,material,diameter_mm,gauge_mm\nS1,A,10,20\nS2,A,,20\n")
    for name in ("S1", "S2"):
        (tmp_path / f"{name}.csv").write_text(f"Area,40,mm2\n{curve()}")
    sizes = read_study(tmp_path).dimensions
    assert sizes["S1"].area_mm2 == pytest.approx(25.0 * 3.14159265)
    assert sizes["S2"].area_mm2 == 40.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,size\na,1\n", "'specimen' and 'material'"),
        (HEAD + "S1,A,3,0,15,\n", "line 2: thickness_mm is '0'; it must be a number above 0"),
        (HEAD + "S1,A,3,two,15,\n", "line 2: thickness_mm is 'two'"),
        (HEAD + "S1,A,3,2,15,\nS1,A,3,2,15,\n", "line 3: specimen 'S1' stands on line 2"),
        (CONDITIONS + "S1,A,-101,,\n", "line 2: temperature_C is '-101'; it must be from -100 to"),
        (CONDITIONS + "S1,A,23,,\nS2,A,310.15,,\n", "line 3: .*from -100 to 300.*kelvin"),
        (CONDITIONS + "S1,A,,-1,\n", "line 2: soak_h is '-1'; it must be 0 or more"),
        (CONDITIONS + "S1,A,,0,-0.5\n", "line 2: age_days is '-0.5'; it must be 0 or more"),
        (HEAD + "S1,,3,2,15,\n", "exactly one of 'material' and 'profile'"),
        (HEAD + ",A,3,2,15,\n", "column 'specimen' is empty"),
        (HEAD + "S1,A,3,2,15,a,b\n", "line 2: 7 cells for 6 columns"),
        (HEAD, "no specimen"),
        ("specimen,material,protocol\nS1,A,fast\n", "protocol is 'fast'"),
        ("specimen,material,material\nS1,A,B\n", "two columns 'material'"),
    ],
)
def test_bad_lists_are_refused_with_line_and_column(
    tmp_path: Path, text: str, message: str
) -> None:
    with pytest.raises(FileError, match=message):
        read_specimens(listing(tmp_path, text))


def test_the_list_groups_and_sizes_the_files(tmp_path: Path) -> None:
    listing(
        tmp_path,
        "specimen,material,profile,file,width_mm,thickness_mm,gauge_mm,protocol\n"
        "b,B,,one.csv,2,1,10,\na,A,,two.csv,4,1,10,monotonic\n"
        "c,A,,three.csv,4,1,10,cyclic\ng,,bar.csv,four.csv,4,1,10,\n",
    )
    for name in ("one", "two", "three", "four", "fields"):
        (tmp_path / f"{name}.csv").write_text(curve())
    study = read_study(sorted(tmp_path.glob("*.csv")))
    assert list(study.groups) == ["B", "A"]
    # Force 3 N a unit strain over 2 mm2 and 4 mm2; 1e-9: nine digits in the text.
    assert study.groups["B"][0].stress_MPa[2] == pytest.approx(0.15, abs=1e-9)
    assert study.groups["A"][0].stress_MPa[2] == pytest.approx(0.075, abs=1e-9)
    notes = " ".join(study.notes)
    for said in ("c: protocol cyclic", "g: a graded bar", "fields.csv: not named"):
        assert said in notes
    assert [c.specimen for c in read_study([tmp_path]).groups["A"]] == ["a"]


def test_names_group_replicates_without_a_list(tmp_path: Path) -> None:
    names = ["FLX9740-1", "FLX9740_02", "FLX9740 S3", "Ecoflex 00-10", "Ecoflex 00-30"]
    for name in names:
        (tmp_path / f"{name}.csv").write_text(curve())
    study = read_study([tmp_path], width_mm=2, thickness_mm=1, gauge_mm=10)
    assert {m: len(c) for m, c in study.groups.items()} == {
        "Ecoflex 00-10": 1,
        "Ecoflex 00-30": 1,
        "FLX9740": 3,
    }
    forced = read_study([tmp_path], material="X", width_mm=2, thickness_mm=1, gauge_mm=10)
    assert list(forced.groups) == ["X"]


@pytest.mark.parametrize("name", ["._a.csv", "~$a.xlsx"])
def test_what_systems_leave_in_a_folder_is_no_test(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.csv").write_text(curve())
    (tmp_path / name).write_bytes(b"\x00\x05\x16\x07\x00\x02")
    study = read_study([tmp_path], width_mm=2, thickness_mm=1, gauge_mm=10)
    assert [record.file for record in study.records] == ["a.csv"]


def test_missing_sizes_and_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(curve())
    with pytest.raises(FileError, match="specimen a: the gauge length is unknown"):
        read_study([path])
    with pytest.raises(FileError, match="specimen a: the section is unknown"):
        read_study([path], gauge_mm=10)
    with pytest.raises(ArgumentError, match="`thickness_mm` 0: it must be above 0"):
        read_study([path], gauge_mm=10, width_mm=1, thickness_mm=0)
    with pytest.raises(ArgumentError, match="no tensile file"):
        read_study([])


def test_a_folder_a_material(tmp_path: Path) -> None:
    """Files called alike in several folders were refused; all have their folder's name in front."""
    for name in ("TPU/1", "TPU/2", "PLA/1", "PLA/2", "PLA/3"):
        path = tmp_path / f"{name}.csv"
        path.parent.mkdir(exist_ok=True)
        path.write_text(curve())
    folders = [tmp_path / "TPU", tmp_path / "PLA"]
    study = read_study(folders, width_mm=2, thickness_mm=1, gauge_mm=10)
    assert {m: [c.specimen for c in group] for m, group in study.groups.items()} == {
        "TPU": ["TPU_1", "TPU_2"],
        "PLA": ["PLA_1", "PLA_2", "PLA_3"],
    }


def test_records_of_workbooks_called_alike_are_of_their_folders(tmp_path: Path) -> None:
    for folder in ("TPU", "PLA"):
        (tmp_path / folder).mkdir()
        rows = "".join(f"S{k},{0.5 * i},{0.1 * i}\n" for k in (1, 2) for i in range(20))
        heads = "specimen,displacement_mm,force_N\n"
        (tmp_path / folder / "results.csv").write_text(heads + rows)
    folders = [tmp_path / "TPU", tmp_path / "PLA"]
    study = read_study(folders, width_mm=2, thickness_mm=1, gauge_mm=10)
    assert {m: len(group) for m, group in study.groups.items()} == {
        "TPU_results": 2,
        "PLA_results": 2,
    }


@pytest.mark.parametrize("ending", ["_rep1", "-rep 2", "_specimen_3", " run 4"])
def test_names_of_replicates(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"TPU{ending}.csv").write_text(curve())
    study = read_study([tmp_path], width_mm=2, thickness_mm=1, gauge_mm=10)
    assert [*study.groups] == ["TPU"]


def test_replicates_beyond_nine_belong_to_their_siblings(tmp_path: Path) -> None:
    names = [*(f"FLX-{n}" for n in range(1, 13)), "Ecoflex 00-10", "Ecoflex 00-30"]
    for name in names:
        (tmp_path / f"{name}.csv").write_text(curve())
    study = read_study([tmp_path], width_mm=2, thickness_mm=1, gauge_mm=10)
    assert {m: len(c) for m, c in study.groups.items()} == {
        "FLX": 12,
        "Ecoflex 00-10": 1,
        "Ecoflex 00-30": 1,
    }
    (said,) = (note for note in study.notes if "by the files' names" in note)
    assert "FLX (12 specimens)" in said


@pytest.mark.parametrize(
    ("names", "materials"),
    [
        (["mix_25", "mix_50", "mix_75"], 3), (["mix_025", "mix_050"], 2),
        (["Eco silicone 10", "Eco silicone 20"], 2),
        (["TPU_1", "TPU_2", "TPU_10"], 1), (["TPU_001", "TPU_002"], 1), (["TPU #1", "TPU #2"], 1),
        (["silicone sample 1", "silicone Sample 2"], 1), (["TPU run1", "TPU run2"], 1),
    ],
)  # fmt: skip
def test_which_names_are_replicates(tmp_path: Path, names: list[str], materials: int) -> None:
    """Shares of a mixture in the name are no replicates: they were pooled."""
    for name in names:
        (tmp_path / f"{name}.csv").write_text(curve())
    study = read_study([tmp_path], width_mm=2, thickness_mm=1, gauge_mm=10)
    assert len(study.groups) == materials


def test_materials_by_names_within_a_file_are_told_as_such(tmp_path: Path) -> None:
    rows = [f"{name},{row}" for name in ("FLX-1", "FLX-2") for row in curve().splitlines()[1:]]
    (tmp_path / "all.csv").write_text("\n".join([f"specimen,{curve().splitlines()[0]}", *rows]))
    study = read_study([tmp_path], width_mm=2, thickness_mm=1, gauge_mm=10)
    assert any("by the specimens' names: FLX (2 specimens)" in note for note in study.notes)


def test_one_file_of_all_specimens_is_told_apart_by_its_own_column(tmp_path: Path) -> None:
    rows = curve().splitlines()[1:]
    both = [f"{name},{row}" for name in ("a", "b", "c") for row in rows]
    header = "specimen,time_s,displacement_mm,force_N"
    (tmp_path / "curves.csv").write_text("\n".join([header, *both]) + "\n")
    listing(
        tmp_path,
        "specimen,material,file,width_mm,thickness_mm,gauge_mm\n"
        "a,A,curves.csv,2,1,10\nb,B,curves.csv,4,1,10\n",
    )
    study = read_study([tmp_path])
    assert {m: c[0].specimen for m, c in study.groups.items()} == {"A": "a", "B": "b"}
    ratio = study.groups["A"][0].stress_MPa[2] / study.groups["B"][0].stress_MPa[2]
    # 1e-9: each specimen has its own section, 2 and 4 mm2.
    assert ratio == pytest.approx(2.0, rel=1e-9)
    assert "specimen c has no row with this file" in " ".join(study.notes)


def test_two_rows_of_one_record_are_refused(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text(curve())
    listing(tmp_path, "specimen,material,file\na,A,one.csv\nb,A,one.csv\n")
    with pytest.raises(
        FileError, match=r"one\.csv: rows of a and b in specimens\.csv name this file"
    ):
        read_study([tmp_path], width_mm=2, thickness_mm=1, gauge_mm=10)


def test_a_strain_without_unit_is_said(tmp_path: Path) -> None:
    for name in ("a", "b"):
        rows = "".join(f"{i / 20},{i / 30}\n" for i in range(20))
        (tmp_path / f"{name}.csv").write_text("strain,stress (MPa)\n" + rows)
    notes = " ".join(read_study([tmp_path]).notes)
    assert "strain of a and b has no unit; taken as a fraction, up to 0.95; if" in notes
    pushed = " ".join(read_study([tmp_path], mode="compression").notes)
    assert "as a fraction, up to 0.95; if" in pushed  # it said -0.95
    text = (tmp_path / "a.csv").read_text()
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text(text.replace("strain", "strain (mm/mm)"))
    assert "no unit" not in " ".join(read_study([tmp_path]).notes)


@pytest.mark.parametrize(
    ("columns", "cells", "head"),
    [
        ("measured_width_mm", "5", "Width (mm),6\nThickness (mm),2\n"),
        ("width_mm,measured_width_mm", "6,5", "Thickness (mm),2\n"),
    ],
)
def test_a_measured_size_goes_before_a_files_head(
    tmp_path: Path, columns: str, cells: str, head: str
) -> None:
    (tmp_path / "a.csv").write_text(f"{head}\n{curve()}")
    listing(tmp_path, f"specimen,material,gauge_mm,{columns}\na,A,25,{cells}\n")
    assert read_study([tmp_path]).dimensions["a"].area_mm2 == 10.0


def test_size_and_rate_go_with_the_study_whatever_their_source(tmp_path: Path) -> None:
    head = "Specimen Length (mm),33,\nSpeed (mm/min),450,\n"
    (tmp_path / "a.csv").write_text(head + curve())
    study = read_study([tmp_path], width_mm=2, thickness_mm=1)
    known = study.dimensions["a"]
    assert (known.gauge_mm, known.rate_mm_s) == (33.0, 7.5)


@pytest.mark.parametrize("heading", ["L0 (mm)", "Initial length (mm)", "Gauge length [mm]"])
def test_a_gauge_length_by_its_other_names(tmp_path: Path, heading: str) -> None:
    """It was kept as a condition of the lab's own, and the gauge length was unknown."""
    (tmp_path / "a.csv").write_text(curve())
    listing(tmp_path, f"specimen,material,width_mm,thickness_mm,{heading}\na,A,6,2,25\n")
    assert read_study([tmp_path]).dimensions["a"].gauge_mm == 25.0
