"""What testing machines export, in each layout, is read whole; and what is not used is said."""

import importlib.util
import itertools
import json
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.cli import run
from planner.errors import FileError, PlannerError
from planner.formats.tables import read_sheets
from planner.formats.tensile import TensileTable, read_tensile
from planner.materials.study import Study, read_study

DATA = Path(__file__).parents[1] / "data"


def _maker() -> ModuleType:
    spec = importlib.util.spec_from_file_location("made", DATA / "make_machine_exports.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MADE = _maker()
EXPORTS = DATA / "machine_exports"
SIZES = {"width_mm": 6.0, "thickness_mm": 2.0, "gauge_mm": 25.0}

SPECIMENS = {
    "zwick_fr.TRA": 1, "zwick_de.asc": 1, "zwick_en.txt": 1, "trapezium_ja.csv": 3,
    "trapezium_en.csv": 2, "Specimen_RawData_1.csv": 1, "bluehill_blocks.csv": 3,
    "bluehill_es.csv": 1, "stacked.csv": 3, "stacked_merged.csv": 2, "mts_blocks.dat": 1,
    "mts_blanks.dat": 1, "testworks.txt": 2, "walter_bai.csv": 1, "channels.csv": 1,
    "brackets.csv": 1, "wide_pandas.csv": 3, "wide_two_rows.csv": 2, "wide_prefixes.csv": 2,
    "utm_zh.txt": 1, "galdabini_it.csv": 1, "lloyd_clock.csv": 1, "tinius_olsen.txt": 1,
    "admet.csv": 1, "mark10.txt": 1, "testxpert_en.xlsx": 1, "testxpert_de.xlsx": 3,
    "dion7.xlsx": 1, "remarks.xlsx": 1, "utm_zh.xlsx": 2, "testxpert_en.xls": 1,
    "testxpert_de.ods": 3, "labview.lvm": 1, "wavematrix.csv": 1, "hounsfield_de.txt": 2,
    "ibertest.txt": 1, "startposition.TRA": 1, "testxpert_series.xlsx": 3, "listed_beside.xlsx": 2,
    "bluehill_results.csv": 4, "mecmesin_results.csv": 3, "statistics_behind.csv": 1,
    "thousands.csv": 1, "thousands_de.csv": 1, "thousands_fr.csv": 1, "three_widths.csv": 1,
    "two_widths_table.csv": 2, "decinewton.csv": 1, "mts_testsuite.txt": 1, "mts_test_runs.csv": 2,
    "emperor.txt": 1, "nexygen.csv": 1, "ta_xt.csv": 1, "wintest.csv": 2, "utm_colon.txt": 1,
    "trapezium_utf16.txt": 2, "events.csv": 1, "testxpert_merged.xlsx": 3, "utm_ja.xlsx": 2,
    "utm_zh_beside.xlsx": 2, "symbols.csv": 1, "results_above.csv": 1, "vic_lagrange.csv": 1,
}  # fmt: skip
WITHOUT_SIZES = {"mark10.txt"}
NO_SIZES_NEEDED = {
    "wide_pandas.csv", "wide_two_rows.csv", "wide_prefixes.csv", "decinewton.csv", "thousands.csv",
    "thousands_de.csv", "thousands_fr.csv",
}  # fmt: skip


def check(study: Study, count: int) -> None:
    """Hold every specimen's curve against what the file was made of."""
    curves = [curve for group in study.groups.values() for curve in group]
    assert len(curves) == count
    for number, curve in enumerate(curves, start=1):
        _, force, travel = MADE.specimen(number)
        # 1e-7: nine digits in the files, of strains up to 1 and in inches.
        np.testing.assert_allclose(curve.strain, travel / MADE.GAUGE_MM, atol=1e-7)
        # Or whole pascal.
        np.testing.assert_allclose(curve.stress_MPa, force / MADE.AREA_MM2, atol=5.1e-7)


@pytest.mark.parametrize("name", SPECIMENS)
def test_each_layout_is_read_whole(name: str) -> None:
    given_ = SIZES if name in WITHOUT_SIZES else {}
    study = read_study([EXPORTS / name], **given_)  # type: ignore[arg-type]  # sizes alone
    check(study, SPECIMENS[name])
    for number, record in enumerate(study.records, start=1):
        assert record.rows == MADE.points(number)
        assert record.mode == "tension"
        if name not in {*NO_SIZES_NEEDED, *WITHOUT_SIZES}:
            assert re.search(r"line \d+, '", record.area_from)


def test_the_files_are_the_scripts() -> None:
    texts = MADE.texts()
    assert {*texts, *MADE.workbooks()} == set(SPECIMENS)
    for name, (encoding, content) in texts.items():
        assert (EXPORTS / name).read_bytes() == content.encode(encoding), name
    for name, sheets in MADE.workbooks().items():
        read = read_sheets((EXPORTS / name).read_bytes(), name)
        assert [sheet for sheet, *_ in read] == list(sheets)


def test_a_symbol_is_a_size_only_with_a_unit_of_length(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = MADE.lines(1, "{t},{f},{d},6.{t}")
    head = ["w = 6 mm", "t = 20", "Time (s),Load (N),Extension (mm),t (mm)"]
    path.write_text("\n".join([*head, *rows]), encoding="utf-8")
    (table,) = read_tensile(path)
    assert dict(table.metadata) == {"width_mm": 6.0}


def test_a_size_that_heads_a_table_names_no_specimen(tmp_path: Path) -> None:
    """The width of all, 6, is also what one specimen is called."""
    path = tmp_path / "a.csv"
    head = ["Width,Thickness,Gauge length", "mm,mm,mm", "6,2,25", ""]
    heads = "Time (s),Load (N),Extension (mm)"
    blocks = [[f"Specimen {n}", heads, *MADE.lines(n, "{t},{f},{d}"), ""] for n in (6, 7)]
    path.write_text("\n".join([*head, *blocks[0], *blocks[1]]), encoding="utf-8")
    tables = read_tensile(path)
    assert [table.metadata["thickness_mm"] for table in tables] == [2.0, 2.0]


def test_a_lagrange_strain_that_no_stretch_has_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{n},{-0.02 * n}" for n in range(30)]
    path.write_text("\n".join(["Load [N],exx [1] - Lagrange", *rows]), encoding="utf-8")
    with pytest.raises(FileError, match=r"Lagrange strain reaches -0\.58; it is above -0\.5"):
        read_tensile(path)


@pytest.mark.parametrize("heading", ["Stretch", "Lagrange strain"])
def test_what_strain_is_made_of_takes_no_other_unit_of_strain(tmp_path: Path, heading: str) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{1.0 + 0.01 * n},{n}" for n in range(30)]
    path.write_text("\n".join([f"{heading},Stress (MPa)", *rows]), encoding="utf-8")
    with pytest.raises(FileError, match="has no column of strain"):
        read_study([path], unit_of="strain=%")


def test_a_statistic_that_stands_twice_is_no_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{n},{row}" for n, row in enumerate(MADE.lines(1, "{t},{f},{d}"))]
    rows += ["Max,,9.9,20", "Max,,9.9,20"]
    path.write_text("\n".join(["No,Time (s),Load (N),Extension (mm)", *rows]), encoding="utf-8")
    assert len(read_tensile(path)[0].lines) == MADE.points(1)


def test_what_may_be_two_readings_or_two_specimens_is_not_averaged(tmp_path: Path) -> None:
    """Two records, two widths that differ, each in a line of its own: of one, or of both?"""
    path = tmp_path / "a.csv"
    head = ["Width 1,5.9,mm", "Width 2,6.1,mm", "Thickness,2,mm", "Gauge length,25,mm"]
    heads = ["S1,,,S2,,", "Time (s),Load (N),Extension (mm),Time (s),Load (N),Extension (mm)"]
    path.write_text("\n".join([*head, *heads, *MADE.beside([1, 2], "{t},{f},{d}", ",", 3)]))
    with pytest.raises(FileError, match="'Width 2', of one specimen or of 2"):
        read_study([path])


def test_a_ramp_of_temperature_is_no_tensile_test(tmp_path: Path) -> None:
    path = tmp_path / "ramp.csv"
    rows = [f"{25 + i},{900 - 8 * i},{0.1 + 0.001 * i},{0.1 + 0.001 * i}" for i in range(40)]
    heads = "Temperature (°C),Storage Modulus (MPa),Stress (MPa),Strain (%)"
    path.write_text("\n".join([heads, *rows]), encoding="utf-8")
    with pytest.raises(FileError, match=r"'Temperature .*' goes from 25 to 64; a law is of one"):
        read_study([path])


def test_a_specimen_may_be_called_like_a_statistic(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [
        f"{name},{x}" for n, name in ((1, "Dev-1"), (2, "Max")) for x in MADE.lines(n, "{e},{s}")
    ]
    path.write_text("\n".join(["Specimen,Strain,Stress (MPa)", *rows]), encoding="utf-8")
    check(read_study([path]), 2)


def test_a_folder_of_all_of_them_loses_none(capsys: pytest.CaptureFixture[str]) -> None:
    sizes = ["--width-mm", "6", "--thickness-mm", "2", "--gauge-mm", "25"]
    code = run(["characterise", str(EXPORTS), "--no-compare", "--json", *sizes])
    records = json.loads(capsys.readouterr().out)["records"]
    assert code in (0, 1)  # groups of different specimens may disagree
    count = {name: [r["file"] for r in records].count(name) for name in SPECIMENS}
    assert count == SPECIMENS
    assert not any(r["left_out"] for r in records)


def test_the_table_says_where_sizes_come_from(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["characterise", str(EXPORTS / "testxpert_en.xlsx")]) == 0
    out = capsys.readouterr().out
    assert out.startswith("What was read")
    assert "testxpert_en.xlsx, Values" in out
    assert "Standard force (N)" in out
    assert "not used: Crosshead absolute" in out
    assert "sheet 'Results', line 1, 'S0'" in out


# ------------------------------------------------------------------------------------------------
# Nothing is dropped with exit code 0.


def test_blocks_that_nothing_names_stop_and_the_option_decides(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.csv"
    blocks = [["strain,stress (MPa)", *MADE.lines(n, "{e},{s}")] for n in (1, 2)]
    path.write_text("\n\n".join("\n".join(block) for block in blocks), encoding="utf-8")
    assert run(["characterise", str(path)]) == 2
    said = capsys.readouterr().err
    assert "--blocks apart for specimens, or --blocks join for one record" in said
    assert said.count("\n") == 1
    check(read_study([path], blocks="apart"), 2)


@pytest.mark.parametrize("columns", [None, ["time_s", "force_N", "displacement_mm"]])
def test_a_record_in_four_blocks_keeps_its_peak(columns: list[str] | None) -> None:
    (table,) = read_tensile(EXPORTS / "mts_blocks.dat", columns=columns)
    # 1e-8: nine digits in the file.
    assert table.columns["force_N"].max() == pytest.approx(MADE.specimen(1)[1][-1], rel=1e-8)
    assert len(table.lines) == MADE.points(1)


def test_columns_by_position_read_specimens_side_by_side(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = MADE.beside([1, 2], "{e};{s}", ";", 2, comma=True)
    path.write_text("Posun;Sila;Posun;Sila\n" + "\n".join(rows), encoding="utf-8")
    check(read_study([path], columns=["strain", "stress_MPa"] * 2), 2)


def test_two_loads_over_one_travel_stop_and_each_reading_works(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    e = np.linspace(0.0, 0.5, 20)
    rows = "".join(f"{x:.6f},{x:.6f},{2 * x:.6f}\n" for x in e)
    path.write_text("strain (mm/mm),Stress 1 (MPa),Stress 2 (MPa)\n" + rows, encoding="utf-8")
    with pytest.raises(FileError, match="two loads over one length") as caught:
        read_tensile(path, option="--columns")
    examples = re.findall(r"--columns (\S+)", str(caught.value))
    peaks = [
        [float(t.columns["stress_MPa"].max()) for t in read_tensile(path, columns=one.split(","))]
        for one in examples
    ]
    assert peaks == [[0.5], [1.0], [0.5, 1.0]]


def test_two_strains_that_differ_stop_and_each_reading_works(tmp_path: Path) -> None:
    """Along and across, as a camera has them: which is along, nothing tells."""
    path = tmp_path / "a.csv"
    e = np.linspace(0.0, 0.5, 20)
    rows = "".join(f"{-0.4 * x:.6f},{x:.6f},{2 * x:.6f}\n" for x in e)
    path.write_text("exx (mm/mm),eyy (mm/mm),Stress (MPa)\n" + rows, encoding="utf-8")
    with pytest.raises(FileError, match="two lengths of one record, of two sensors") as caught:
        read_tensile(path, option="--columns")
    examples = re.findall(r"--columns (\S+)", str(caught.value))
    ends = [
        float(read_tensile(path, columns=one.split(","))[0].columns["strain"][-1])
        for one in examples
    ]
    assert ends == [-0.2, 0.5]


def test_the_crosshead_goes_behind_a_nearer_sensor_wherever_it_stands(tmp_path: Path) -> None:
    near, far = "Standardweg [mm]", "Traversenweg [mm]"
    rows = [row.split(";") for row in MADE.lines(1, "{d};{f}")]
    for heads in ((near, far), (far, near)):
        travel = [{near: d, far: f"{1.1 * float(d):.9g}", "f": f} for d, f in rows]
        body = ["{};{};{}".format(*(one[key] for key in (*heads, "f"))) for one in travel]
        text = "\n".join([";".join((*heads, "Kraft [N]")), *body])
        (tmp_path / "a.csv").write_text(text, encoding="utf-8")
        (table,) = read_tensile(tmp_path / "a.csv")
        assert table.headings["displacement_mm"] == near
        assert table.unused == (far,)
        # 1e-8: nine digits in the file.
        assert table.columns["displacement_mm"][-1] == pytest.approx(20.0, rel=1e-8)


def test_decimal_commas_between_commas_are_told(tmp_path: Path) -> None:
    rows = "\n".join(MADE.lines(1, "{f},{d}", comma=True))
    (tmp_path / "a.csv").write_text("Kraft (N),Weg (mm)\n" + rows, encoding="utf-8")
    with pytest.raises(FileError, match=r"4 cells where the headings have 2; a decimal comma"):
        read_tensile(tmp_path / "a.csv")


def test_a_size_without_a_unit_is_told_where_it_is_missing(tmp_path: Path) -> None:
    head = "Width,6\nThickness,2,mm\nGauge length,25,mm\n\nForce (N),Travel (mm)\n"
    (tmp_path / "a.csv").write_text(head + "\n".join(MADE.lines(1, "{f},{d}")))
    with pytest.raises(FileError, match=r"section is unknown.*line 1, 'Width' without a unit"):
        read_study([tmp_path / "a.csv"])
    check(read_study([tmp_path / "a.csv"], width_mm=6.0), 1)


@pytest.mark.parametrize("cut", [8, 30, 31, 32])
def test_a_record_that_goes_on_behind_a_remark_keeps_its_end(tmp_path: Path, cut: int) -> None:
    rows = MADE.lines(1, "{e},{s}")
    rows.insert(cut, "--- paused ---")
    (tmp_path / "a.csv").write_text("strain (mm/mm),stress (MPa)\n" + "\n".join(rows))
    check(read_study([tmp_path / "a.csv"]), 1)


def test_a_row_with_a_name_alone_is_told(tmp_path: Path) -> None:
    rows = MADE.lines(1, "A,{e},{s}")
    rows[5] = "A,,"
    (tmp_path / "a.csv").write_text("specimen,strain,stress (MPa)\n" + "\n".join(rows))
    with pytest.raises(FileError, match=r"line 7, column 'strain': '' is no finite number"):
        read_tensile(tmp_path / "a.csv")


@pytest.mark.parametrize("head", ["mode", "specimen,mode"])
def test_modes_in_one_file_are_specimens_of_one_material(tmp_path: Path, head: str) -> None:
    names = [("a1,uniaxial", "a2,planar"), ("uniaxial", "planar")][head == "mode"]
    rows = [row for n, name in enumerate(names, 1) for row in MADE.lines(n, name + ",{e},{s}")]
    (tmp_path / "a.csv").write_text(f"{head},strain (mm/mm),stress (MPa)\n" + "\n".join(rows))
    study = read_study([tmp_path / "a.csv"], material="M")
    assert [record.mode for record in study.records] == ["tension", "planar"]
    assert [record.rows for record in study.records] == [MADE.points(1), MADE.points(2)]


def test_a_material_that_is_merged_over_specimens_is_of_each(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    head = "Material;Probe;Dehnung [%];Spannung [MPa]\n"
    made = [("Weich", "P1", 1), ("", "P2", 1.1), ("Hart", "P3", 9), ("", "P4", 9.1)]
    curves = ["".join(f";;{i};{i * e / 100}\n" for i in range(1, 40)) for _, _, e in made]
    rows = [f"{m};{p};0;0\n{curve}" for (m, p, _), curve in zip(made, curves, strict=True)]
    path.write_text(head + "".join(rows), encoding="utf-8")
    records = read_study([path]).records
    assert [r.material for r in records] == ["Weich", "Weich", "Hart", "Hart"]


def test_materials_stand_in_a_table_of_specimens(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    table = "Probe;Material;Breite (mm)\nP1;Weich;6\nP2;;6\nP3;Hart;6\n\n"
    heads = "P1;;P2;;P3;\n" + ";".join(["Dehnung [%];Spannung [MPa]"] * 3) + "\n"
    rows = "".join(f"{i};{i};{i};{i * 1.1};{i};{i * 9}\n" for i in range(40))
    path.write_text(table + heads + rows, encoding="utf-8")
    assert [r.material for r in read_study([path]).records] == ["Weich", "Weich", "Hart"]


def test_a_mode_is_of_its_specimen_alone(tmp_path: Path) -> None:
    """Empty, it is the usual one, whatever the specimen above was."""
    head = "specimen,mode,strain (mm/mm),stress (MPa)\n"
    rows = "\n".join([*MADE.lines(1, "P1,planar,{e},{s}"), *MADE.lines(2, "P2,,{e},{s}")])
    (tmp_path / "a.csv").write_text(head + rows)
    study = read_study([tmp_path / "a.csv"], material="soft")
    assert [curve.specimen for curve in study.groups["soft"]] == ["P2"]


def test_an_unknown_mode_in_a_column_is_refused(tmp_path: Path) -> None:
    rows = "\n".join(MADE.lines(1, "bending,{e},{s}"))
    (tmp_path / "a.csv").write_text("mode,strain (mm/mm),stress (MPa)\n" + rows)
    with pytest.raises(FileError, match="mode is 'bending'; it must be one of tension"):
        read_study([tmp_path / "a.csv"])
    rows = "\n".join(MADE.lines(1, "{e},{s}"))
    (tmp_path / "a.csv").write_text("strain (mm/mm),stress (MPa)\n" + rows)
    (tmp_path / "specimens.csv").write_text("specimen,material,file,mode\na,A,a.csv,bending\n")
    with pytest.raises(FileError, match=r"specimens\.csv, specimen a: mode is 'bending'"):
        read_study([tmp_path])


def test_what_has_no_row_in_the_list_is_a_finding(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for n in (1, 2):
        rows = "\n".join(MADE.lines(n, "{e},{s}"))
        (tmp_path / f"s{n}.csv").write_text("strain (mm/mm),stress (MPa)\n" + rows)
    (tmp_path / "specimens.csv").write_text("specimen,material,file\na,A,s1.csv\n")
    assert run(["characterise", str(tmp_path), "--no-compare"]) == 1
    captured = capsys.readouterr()
    assert "s2.csv: not used" in captured.err
    assert re.search(r"s2\.csv .*left out: no row in specimens\.csv", captured.out)


def test_a_specimen_without_a_row_is_a_finding_that_names_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a file whose other specimens have rows."""
    (tmp_path / "stacked.csv").write_bytes((EXPORTS / "stacked.csv").read_bytes())
    rows = "specimen,material,file\n1,A,stacked.csv\n2,A,stacked.csv\n"
    (tmp_path / "specimens.csv").write_text(rows)
    assert run(["characterise", str(tmp_path), "--no-compare"]) == 1
    assert "finding: stacked.csv, specimen 3: not used" in capsys.readouterr().err
    (tmp_path / "specimens.csv").write_text("specimen,material,file\nX,A,stacked.csv\n")
    with pytest.raises(FileError, match=r"give each specimen of the file a row in specimens\.csv"):
        read_study([tmp_path])


def test_a_list_elsewhere_names_the_files_of_the_folder_that_was_given(tmp_path: Path) -> None:
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "stacked.csv").write_bytes((EXPORTS / "stacked.csv").read_bytes())
    rows = [f"{n},A,stacked.csv" for n in (1, 2, 3)]
    (tmp_path / "list.csv").write_text("\n".join(["specimen,material,file", *rows]))
    check(read_study([tmp_path / "lab"], specimens=tmp_path / "list.csv"), 3)


def test_a_sheet_that_is_not_understood_is_no_silent_loss(tmp_path: Path) -> None:
    sheets = MADE.workbooks()["testxpert_de.xlsx"]
    sheets["Probe 2"][1] = ["Voima", "Matka", ""]
    (tmp_path / "a.ods").write_bytes(MADE.ods(sheets))
    with pytest.raises(FileError, match=r"sheet 'Probe 2', line \d: no heading.*'Voima', 'Matka'"):
        read_tensile(tmp_path / "a.ods", option="--columns")


# ------------------------------------------------------------------------------------------------
# Ways of loading.


@pytest.mark.parametrize(
    ("word", "mode"),
    [("equibiaxial", "equibiaxial"), ("pure shear", "planar"), ("Druck", "compression"),
     ("tension", "tension"), ("拉伸", "tension")],
)  # fmt: skip
def test_a_mode_is_read_and_kept(tmp_path: Path, word: str, mode: str) -> None:
    rows = "\n".join(MADE.lines(1, "{e},{s}", e=2.0))
    (tmp_path / "a.csv").write_text("strain (mm/mm),stress (MPa)\n" + rows)
    (tmp_path / "specimens.csv").write_text(
        f"specimen,material,file,mode\na,A,a.csv,{word}\n", encoding="utf-8"
    )
    study = read_study([tmp_path])
    assert study.records[0].mode == mode
    (curve,) = (study.groups if mode == "tension" else study.other_modes)["A"]
    assert curve.mode == {"planar": "planar", "equibiaxial": "equibiaxial"}.get(mode, "uniaxial")
    sign = -1.0 if mode == "compression" else 1.0
    # 1e-8: nine digits in the file.
    assert curve.strain[-1] == pytest.approx(sign * 0.4, rel=1e-8)


def test_an_unknown_mode_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("strain,stress (MPa)\n" + "\n".join(MADE.lines(1, "{e},{s}")))
    with pytest.raises(PlannerError, match="it must be one of tension, compression, planar"):
        read_study([tmp_path / "a.csv"], mode="bending")


def test_compressive_headings_say_the_mode(tmp_path: Path) -> None:
    rows = "\n".join(MADE.lines(1, "{e},{s}", e=2.0))
    (tmp_path / "a.csv").write_text("Compressive strain (mm/mm),Compressive stress (MPa)\n" + rows)
    study = read_study([tmp_path / "a.csv"])
    assert study.records[0].mode == "compression"
    assert study.other_modes["a"][0].stress_MPa[-1] < 0.0


# ------------------------------------------------------------------------------------------------
# Any order of columns, words and separators: all specimens, or an error.


WORDS = {
    "force": ["Force (N)", "Kraft [N]", "Standard force\nN", "Charge (N)", "Carga [N]", "試験力(N)",
              "力(N)", "C_1_Force[N]", "Load N", "Axial Force (N)", "force_N"],
    "travel": ["Extension (mm)", "Weg [mm]", "Course (mm)", "位移(mm)", "ストローク(mm)",
               "LVDT [mm]", "Crosshead (mm)", "displacement_mm", "Strain (Ext 1) [mm]",
               "Spostamento [mm]"],
    "time": ["Time (s)", "Zeit [s]", "Temps (s)", "时间(s)", "", "時間(sec)"],
    "other": ["", "Index", "Temperatur [°C]", "Remark", "Width change (mm)"],
}  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_no_order_of_headings_loses_a_specimen(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Any words, order, separator, layout and names: every specimen is read, with its numbers."""
    draw = data.draw
    words = {key: draw(st.sampled_from(some)) for key, some in WORDS.items()}
    separator = draw(st.sampled_from([",", ";", "\t"]))
    order = draw(st.permutations(["force", "travel", "time", "other"]))
    order = [key for key in order if words[key]]
    forms = {"force": "{f}", "travel": "{d}", "time": "{t}", "other": "7"}
    comma = separator != "," and draw(st.booleans())
    count = draw(st.integers(1, 3))
    layout = draw(st.sampled_from(["beside", "blocks", "column", "files"]))
    form = separator.join(forms[key] for key in order)
    heads = ['"' + words[key] + '"' if "\n" in words[key] else words[key] for key in order]
    numbers = list(range(1, count + 1))
    name = draw(st.sampled_from(["Specimen {}", "A{}", "1_{}", "Probe {}"]))
    names = [name.format(n) for n in numbers]
    folder = tmp_path_factory.mktemp("order")
    sizes = separator.join(["Width", "6", "mm"])
    head = [sizes, ""] if draw(st.booleans()) else []
    if layout == "files":
        for n in numbers:
            rows = [separator.join(heads), *MADE.lines(n, form, comma=comma)]
            (folder / f"A-{n}.csv").write_text("\n".join([*head, *rows]), encoding="utf-8")
    elif layout == "column":
        rows = [separator.join(["Specimen", *heads])]
        for n, label in zip(numbers, names, strict=True):
            rows += MADE.lines(n, label + separator + form, comma=comma)
        (folder / "a.csv").write_text("\n".join([*head, *rows]), encoding="utf-8")
    elif layout == "blocks":
        rows = []
        for n, label in zip(numbers, names, strict=True):
            mark = label if label.startswith(("Spec", "Prob")) else f"Specimen{separator}{label}"
            rows += [mark, separator.join(heads), *MADE.lines(n, form, comma=comma), ""]
        (folder / "a.csv").write_text("\n".join([*head, *rows]), encoding="utf-8")
    else:
        above = separator.join(label + separator * (len(order) - 1) for label in names)
        rows = (
            [above, separator.join(heads * count)]
            if draw(st.booleans())
            else [separator.join(heads * count)]
        )
        rows += MADE.beside(numbers, form, separator, len(order), comma=comma)
        (folder / "a.csv").write_text("\n".join([*head, *rows]), encoding="utf-8")
    study = read_study([folder], material="M", **SIZES)  # type: ignore[arg-type]  # sizes alone
    check(study, count)


TEXTS = MADE.texts()


def _damaged(lines: list[str], at: int, kind: str, places: st.DataObject) -> list[str]:
    line, rest = lines[at], lines[at + 1 :]
    if kind in ("", "# remark", "Operator: x"):
        return [*lines[:at], kind, line, *rest]
    if kind == "twice":
        return [*lines[:at], line, line, *rest]
    if kind == "cut":
        return [*lines[:at], *rest]
    place = places.draw(st.integers(0, len(line)))
    return [*lines[:at], line[:place] + kind + line[place + 1 :], *rest]


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_no_damage_loses_a_specimen_or_a_part_of_one(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A line cut, doubled, put in or with a wrong sign: an error, or a row each at most is lost."""
    name = data.draw(st.sampled_from(sorted(TEXTS)))
    encoding, text = TEXTS[name]
    lines = text.split("\r\n")[:-1]
    at = data.draw(st.integers(0, len(lines) - 1))
    kind = data.draw(st.sampled_from(["", "# remark", "Operator: x", "twice", "cut", "x", "?"]))
    path = tmp_path_factory.mktemp("damaged") / name
    path.write_bytes("\r\n".join(_damaged(lines, at, kind, data)).encode(encoding))
    try:
        records = read_study([path], **SIZES).records  # type: ignore[arg-type]  # sizes alone
    except FileError:
        return
    count = SPECIMENS[name]
    assert len(records) == count
    rows = [MADE.points(n) for n in range(1, count + 1)]
    assert sum(abs(r.rows - n) for r, n in zip(records, rows, strict=True)) <= count


# ------------------------------------------------------------------------------------------------
# Hostile workbooks.


def _zip(members: dict[str, bytes]) -> bytes:
    import io
    import zipfile

    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return data.getvalue()


FAR = (
    b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
    b'<row r="1"><c r="A1"><v>1</v></c></row><row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'
    b"</sheetData></worksheet>"
)
ODS_FAR = (
    b"<office:document-content><table:table><table:table-row "
    b'table:number-rows-repeated="1048576"><table:table-cell '
    b'table:number-columns-repeated="16384" office:value-type="float" office:value="1"/>'
    b"</table:table-row></table:table></office:document-content>"
)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"PK\x03\x04 no zip", "not a zip archive"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "a workbook that cannot be read"),
        ({"a.txt": b"x"}, "no workbook"),
        ({"xl/workbook.xml": b"<workbook/>"}, "a workbook"),
        ({"xl/worksheets/sheet1.xml": FAR}, "more than 20,000,000 cells"),
        ({"content.xml": ODS_FAR}, "more than 20,000,000 cells"),
        ({"xl/worksheets/sheet1.xml": FAR.replace(b'"', b"'")}, "more than 20,000,000 cells"),
        ({"content.xml": ODS_FAR.replace(b'"', b"'")}, "more than 20,000,000 cells"),
        ({"xl/worksheets/sheet1.xml": bytes(300_000_000)}, "made to exhaust memory"),
    ],
    ids=[
        "no-zip", "no-ole", "no-book", "no-sheets", "far-cell", "far-repeats", "far-cell, '",
        "far-repeats, '", "bomb",
    ],
)  # fmt: skip
def test_hostile_workbooks_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], data: bytes | dict[str, bytes], said: str
) -> None:
    (tmp_path / "a.xlsx").write_bytes(data if isinstance(data, bytes) else _zip(data))
    assert run(["characterise", str(tmp_path / "a.xlsx")]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.strip().count("\n") == 0


_DAMAGED = """
import random, re, sys
from pathlib import Path
from planner.errors import FileError
from planner.formats.tables import read_sheets

whole = Path(sys.argv[1]).read_bytes()
# Behind the head of a number's record its row and column stand.
places = [match.end() for match in re.finditer(rb"\\x03\\x02\\x0e\\0", whole)]
for seed in range(40):
    rng, data = random.Random(seed), bytearray(whole)
    at, size = rng.randrange(len(data)), rng.choice([1, 4, 64, 512])
    if seed % 4 == 0:
        at, size = rng.choice(places), 4
    data[at : at + size] = rng.choice([b"\\xff" * size, rng.randbytes(size)])
    try:
        print("read", len(read_sheets(bytes(data), "a.xls")))
    except FileError as error:
        print("refused", error)
"""


def test_no_damage_of_an_xls_ends_the_process() -> None:
    """calamine aborts where a cell lies so far off that its sheet's rectangle takes 137 GB."""
    command = [sys.executable, "-c", _DAMAGED, str(EXPORTS / "testxpert_en.xls")]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    said = ended.stdout.splitlines()
    assert len(said) == 40
    assert any(line.startswith("read") for line in said)
    assert any("its cells take more than 4 GB of memory" in line for line in said)


# ------------------------------------------------------------------------------------------------
# Names and sizes of records side by side, and of several series.


def _beside(
    *above: str,
) -> str:
    heads = [",".join(["Time (s),Load (N),Extension (mm)"] * 3)]
    sizes = [f"{name},{value:g},mm" for name, value in zip(HEAD, SIZES.values(), strict=True)]
    rows = MADE.beside([1, 2, 3], "{t},{f},{d}", ",", 3)
    return "\n".join([*sizes, "", *above, *heads, *rows])


HEAD = ("Width", "Thickness", "Gauge length")


@pytest.mark.parametrize(
    ("above", "names", "materials"),
    [
        (["PU,,,PU,,,EP,,"], ["PU 1", "PU 2", "EP 1"], ["PU", "PU", "EP"]),
        (["S1,,,S2,,,S3,,", "PU,,,PU,,,EP,,"], ["S1", "S2", "S3"], ["PU", "PU", "EP"]),
        (["S1,,,S2,,,S3,,", "2.0,,,2.2,,,1.8,,"], ["S1", "S2", "S3"], ["a"] * 3),
        (["S1,,,S2,,,S3,,", "5,,,6,,,7,,"], ["S1", "S2", "S3"], ["a"] * 3),
        *(
            (["PU,,,,,,EP,,", row], ["PU 1", "PU 2", "EP 1"], ["PU", "PU", "EP"])
            for row in (
                "Probe 1,,,Probe 2,,,Probe 1,,",
                "S1,,,S2,,,S1,,",
                "Rep. 1,,,Rep. 2,,,Rep. 1,,",
            )
        ),
        (["11,,,12,,,14,,"], ["11", "12", "14"], ["a"] * 3),
    ],
)
def test_names_that_come_again_are_of_a_material_and_figures_are_none(
    tmp_path: Path, above: list[str], names: list[str], materials: list[str]
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(_beside(*above), encoding="utf-8")
    study = read_study([path])
    check(study, 3)
    assert [r.specimen for r in study.records] == names
    assert [r.material for r in study.records] == materials


def test_a_size_of_all_stands_in_the_column_of_the_first_name(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    above = ["Sample,S1,,,S2,,,S3,,", "Operator,JD,,,JD,,,JD,,"]
    head, _, rows = _beside().partition("\n\n")
    beside = ["," + row for row in rows.split("\n")]
    path.write_text("\n".join([head, "", *above, *beside]), encoding="utf-8")
    study = read_study([path])
    check(study, 3)
    assert [record.specimen for record in study.records] == ["S1", "S2", "S3"]


def _stacked(results: list[tuple[str, float]], marks: Sequence[str]) -> str:
    rows = [f"{name}\t{thickness:g}\t6" for name, thickness in results]
    blocks = [
        "\n".join([f"Specimen {m}", "Time (s)\tLoad (N)\tExtension (mm)", *MADE.lines(n, FORM), ""])
        for n, m in enumerate(marks, start=1)
    ]
    return "\n".join(
        ["Gage Length\t25\tmm", "", "Specimen #\tThickness\tWidth", "\tmm\tmm", *rows, "", *blocks]
    )


FORM = "{t}\t{f}\t{d}"


@pytest.mark.parametrize(
    ("results", "marks", "thicknesses"),
    [
        ([("3", 1.8), ("1", 2.0), ("2", 2.2)], "123", [2.0, 2.2, 1.8]),  # by name
        ([("1", 2.0), ("2", 2.2), ("3", 9.0), ("4", 1.8)], "124", [2.0, 2.2, 1.8]),
        ([("1", 2.0), ("2", 2.2), ("3", 2.1)], "124", [2.0, 2.2, None]),
        ([("2", 2.2)], "123", [None, 2.2, None]),
        ([("1", 2.0), ("2", 2.0)], "123", [2.0, 2.0, 2.0]),  # all alike
        ([("P-A", 2.0), ("P-B", 2.2), ("P-C", 1.8)], "123", [2.0, 2.2, 1.8]),  # by place
    ],
)
def test_no_size_is_taken_from_another_specimen(
    tmp_path: Path,
    results: list[tuple[str, float]],
    marks: str,
    thicknesses: list[float | None],
) -> None:
    path = tmp_path / "a.txt"
    path.write_text(_stacked(results, marks), encoding="utf-8")
    tables = read_tensile(path)
    assert [table.metadata.get("thickness_mm") for table in tables] == thicknesses
    assert [("thickness_mm" in table.unclear) for table in tables] == [
        thickness is None for thickness in thicknesses
    ]


def _of_two_series(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, results: Sequence[str]
) -> tuple[TensileTable, ...]:
    sheets = [("Parameters", [["Gage length", "25", "mm"]], {})]
    for name, sizes in zip(results, (("2.0", "2.2"), ("1.8",)), strict=True):
        rows = [[f"Specimen {n}", size, "6"] for n, size in enumerate(sizes, start=1)]
        sheets.append((name, [["", "a0", "b0"], ["", "mm", "mm"], *rows], {}))
    for series, numbers in (("1", [1, 2]), ("2", [3])):
        heads = [",".join(f"Specimen {n},," for n in range(1, len(numbers) + 1))]
        heads += [",".join(["Test time,Standard force,Standard travel"] * len(numbers))]
        rows = [*heads, ",".join(["s,N,mm"] * len(numbers))]
        rows += MADE.beside(numbers, "{t},{f},{d}", ",", 3)
        sheets.append((f"Values Series {series}", [row.split(",") for row in rows], {}))
    path = tmp_path / "two.xlsx"
    path.write_bytes(b"PK")
    monkeypatch.setattr("planner.formats.tables.is_workbook", lambda data: True)
    monkeypatch.setattr("planner.formats.tables.read_sheets", lambda data, name: sheets)
    return read_tensile(path)


def test_results_of_a_series_are_of_its_values_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = _of_two_series(tmp_path, monkeypatch, ["Results Series 1", "Results Series 2"])
    assert [table.metadata["thickness_mm"] for table in tables] == [2.0, 2.2, 1.8]


def test_results_that_may_be_of_either_series_are_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = _of_two_series(tmp_path, monkeypatch, ["Results A", "Results B"])
    assert not any("thickness_mm" in table.metadata for table in tables)
    assert all("thickness_mm" in table.unclear for table in tables)


# ------------------------------------------------------------------------------------------------
# Sizes beside the columns, and what ends a record.


@pytest.mark.parametrize("said", ["A0;12,00;mm²", "A0 = 12,00 mm²", "A0 [mm²];12,00"])
def test_a_section_a0_in_square_millimetres(tmp_path: Path, said: str) -> None:
    path = tmp_path / "a.csv"
    rows = MADE.lines(1, "{t};{f};{d}", comma=True)
    head = [said, "L0;25,00;mm", "", "Zeit;Kraft;Weg", "s;N;mm"]
    path.write_text("\n".join([*head, *rows]), encoding="utf-8")
    check(read_study([path]), 1)


@pytest.mark.parametrize("label", ["", "-"])
def test_rows_of_statistics_are_no_specimens(tmp_path: Path, label: str) -> None:
    results = [f"{n},P-{n},{size},6.00" for n, size in enumerate((2.0, 2.2, 1.8), start=1)]
    results += [f"Mean,{label},2.00,6.00", f"Standard deviation,{label},0.20,0.00"]
    blocks = [
        "\n".join(
            [f"Specimen {n}", "Time (s),Load (N),Extension (mm)", *MADE.lines(n, "{t},{f},{d}"), ""]
        )
        for n in (1, 2, 3)
    ]
    head = "No,Specimen label,Thickness (mm),Width (mm)"
    path = tmp_path / "a.csv"
    path.write_text("\n".join([head, *results, "", *blocks]), encoding="utf-8")
    tables = read_tensile(path)
    assert [table.metadata["thickness_mm"] for table in tables] == [2.0, 2.2, 1.8]


def test_an_orientation_beside_sizes_is_no_mean(tmp_path: Path) -> None:
    rows = [f"x,STD-1,2,6,{row}" for row in MADE.lines(1, "{t},{f},{d}")]
    head = "Orientation,Specimen,Thickness (mm),Width (mm),Time (s),Load (N),Extension (mm)"
    path = tmp_path / "a.csv"
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    check(read_study([path], gauge_mm=25.0), 1)


def test_segments_of_a_labview_file_are_told_apart(tmp_path: Path) -> None:
    units = ("Newtons", "Millimeters")
    text = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\n***End_of_Header***\t\n"
    for n in (1, 2):
        text += f"Channels\t2\t\t\nSamples\t{MADE.points(n)}\t{MADE.points(n)}\t\n"
        text += "\t".join(["Y_Unit_Label", *units, ""]) + "\nTime\t10:22:13\t10:22:13\t\n"
        text += "Delta_X\t0.1\t0.1\t\n***End_of_Header***\t\t\t\nX_Value\tLoad\tDisplacement\t\n"
        text += "\n".join(MADE.lines(n, "{t}\t{f}\t{d}\t")) + "\n"
    path = tmp_path / "a.lvm"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match="--blocks apart"):
        read_tensile(path, option="--columns")
    check(read_study([path], blocks="apart", **SIZES), 2)  # type: ignore[arg-type]  # sizes alone


@pytest.mark.parametrize(
    ("stress", "scale", "strain", "per"),
    [("daN/mm²", 10.0, "mm/m", 1e-3), ("MPa", 1.0, "µm/m", 1e-6), ("MPa", 1.0, "μm/m", 1e-6)],
)
def test_units_of_bridges_and_old_machines(
    tmp_path: Path, stress: str, scale: float, strain: str, per: float
) -> None:
    path = tmp_path / "a.csv"
    rows = MADE.lines(1, "{e},{s}", e=per, s=scale)
    path.write_text("\n".join([f"Strain [{strain}],Stress [{stress}]", *rows]), encoding="utf-8")
    check(read_study([path]), 1)


def test_an_unknown_unit_names_the_option(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Strain (%),Stress (stone)\n0,0\n1,1\n2,2\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"unknown unit 'stone'.* by --columns"):
        read_tensile(path, option="--columns")


# ------------------------------------------------------------------------------------------------
# What is not understood, and what is of two axes.


@pytest.mark.parametrize(
    ("far", "near", "unit", "per"),
    [
        ("Crosshead (mm)", "Laser 2 head (mm)", "displacement_mm", 0.04),
        ("Weg [mm]", "Dehnungsmesser [mm]", "displacement_mm", 0.04),
        ("Extension (mm)", "Calibrated video transducer (%)", "strain_%", 0.01),
        ("Position (mm)", "DIC eps1 [%]", "strain_%", 0.01),
    ],
)
def test_a_column_that_may_be_nearer_stops_and_both_readings_work(
    tmp_path: Path, far: str, near: str, unit: str, per: float
) -> None:
    path = tmp_path / "a.csv"
    rows = [
        f"{row},{float(e) / per:.9g}"
        for row, e in zip(MADE.lines(1, "{t},{f},{d}"), MADE.lines(1, "{e}"), strict=True)
    ]
    path.write_text("\n".join([f"Time (s),Load (N),{far},{near}", *rows]), encoding="utf-8")
    with pytest.raises(FileError, match=re.escape(f"{near!r} is not understood")) as caught:
        read_tensile(path, option="--columns")
    examples = re.findall(r"--columns (\S+)", str(caught.value))
    assert examples == [f"time_s,force_N,-,{unit}", "time_s,force_N,displacement_mm,-"]
    for example in examples:
        check(read_study([path], columns=example.split(","), **SIZES), 1)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "other", ["Strain rate (%)", "Querdehnung (%)", "Laser setpoint (mm)", "Strain limit"]
)
def test_a_column_of_another_matter_stops_nothing(tmp_path: Path, other: str) -> None:
    path = tmp_path / "a.csv"
    rows = MADE.lines(1, "{t},{f},{d},{e}")
    path.write_text("\n".join([f"Time (s),Load (N),Weg (mm),{other}", *rows]), encoding="utf-8")
    check(read_study([path], **SIZES), 1)  # type: ignore[arg-type]  # sizes alone


@pytest.mark.parametrize("near", ["Laser (mm)", "AVE axial displacement (mm)", "dL [mm]",
                                  "Verlängerung dL [mm]", "ΔL (mm)", "Extenso [mm]"])  # fmt: skip
def test_sensors_go_before_the_crosshead(tmp_path: Path, near: str) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{row},{2.0 * n}" for n, row in enumerate(MADE.lines(1, "{t},{f},{d}"))]
    path.write_text("\n".join([f"Time (s),Load (N),{near},Weg (mm)", *rows]), encoding="utf-8")
    check(read_study([path], **SIZES), 1)  # type: ignore[arg-type]  # sizes alone


def test_two_axes_of_one_test_are_no_two_specimens(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = MADE.lines(1, "{t},{f},{f},{d},{d}")
    head = "Time (s),Force X (N),Force Y (N),Displacement X (mm),Displacement Y (mm)"
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    with pytest.raises(FileError, match=r"two axes of one test.*--mode equibiaxial") as caught:
        read_tensile(path, option="--columns")
    examples = re.findall(r"--columns ([^\s,]\S*[^\s,])", str(caught.value))
    assert examples == ["time_s,force_N,-,displacement_mm,-", "time_s,-,force_N,-,displacement_mm"]
    for example in examples:
        check(read_study([path], columns=example.split(","), **SIZES), 1)  # type: ignore[arg-type]


def test_results_numbered_in_a_later_column_go_by_the_number(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    text = _stacked([("1", 2.0), ("2", 2.2), ("3", 1.8)], "13")
    head, rest = text.split("Specimen #", 1)
    table, blocks = f"No.{rest}".split("\n\n", 1)
    table = "\n".join("\t" + line for line in table.split("\n"))
    path.write_text(f"{head}{table}\n\n{blocks}", encoding="utf-8")
    assert [table.metadata["thickness_mm"] for table in read_tensile(path)] == [2.0, 1.8]


def test_two_directions_of_image_correlation_stop(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{f},{-0.3 * float(f)},{f}" for f in MADE.lines(1, "{f}")]
    head = "Load [N],exx [1] - Engr. (mean),eyy [1] - Engr. (mean)"
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    with pytest.raises(FileError, match=r"two lengths of one record.*--columns force_N,-,strain"):
        read_tensile(path, option="--columns")


@pytest.mark.parametrize("nothing", ["N/A", "---", "NaN", "n. a."])
def test_a_column_without_numbers_is_none(tmp_path: Path, nothing: str) -> None:
    """Programs fill the columns that they did not measure with words."""
    path = tmp_path / "a.csv"
    rows = MADE.lines(1, f"{{t}},{{f}},{nothing},,{{d}}")
    head = "Time (sec),Load (N),Stress (kPa),Strain (mm),Position (mm)"
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    check(read_study([path], **SIZES), 1)  # type: ignore[arg-type]
    path.write_text("\n".join([head, *MADE.lines(1, "{t},,,,{d}")]), encoding="utf-8")
    with pytest.raises(FileError, match=r"a\.csv: no numbers of a load .*; export them too"):
        read_tensile(path)


def test_words_of_unknown_headings_are_not_laid_over_the_columns(tmp_path: Path) -> None:
    """Where tabs make no headings of a row, its words would: more of them than of numbers."""
    path = tmp_path / "a.txt"
    rows = MADE.lines(1, "{t}\t{d}\t{f}\t0.1\t0.2")
    head = (
        "Time\tUniversal Displacement\tUniversal Force\tAux Input 1\tAux Input 2\ns\tmm\tkN\tV\tV"
    )
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    with pytest.raises(FileError, match="not understood: 'Universal Disp") as caught:
        read_tensile(path, option="--columns")
    assert "--columns time_s,displacement_mm,force_kN,-,-" in str(caught.value)


@pytest.mark.parametrize("other", [
    "Flexure stress (MPa)", "Flex Stress (MPa)", "Bending stress [MPa]", "Biegespannung (MPa)",
    "Shear stress (kPa)", "Flexural strain (%)", "Contrainte de flexion (MPa)",
])  # fmt: skip
def test_bending_and_shear_are_no_tension(tmp_path: Path, other: str) -> None:
    path = tmp_path / "a.csv"
    for head in (f"Time (s),Load (N),Extension (mm),{other}", f"Time (s),b,c,{other}"):
        rows = MADE.lines(1, "{t},{f},{d},{f}")
        path.write_text("\n".join([head, *rows]), encoding="utf-8")
        with pytest.raises(FileError, match=re.escape(f"{other!r} is of bending or shear; leave")):
            read_tensile(path, option="--columns")
    # As it says: that column taken out, it is read.
    path.write_text("\n".join(["Time (s),Load (N),Extension (mm)", *MADE.lines(1, "{t},{f},{d}")]))
    check(read_study([path], **SIZES), 1)  # type: ignore[arg-type]


@pytest.mark.parametrize("near", ["Pure shear stress (MPa)", "Flex70 (V)", "exy [1] - Lagrange"])
def test_what_only_sounds_like_bending_or_shear_stops_nothing(tmp_path: Path, near: str) -> None:
    path = tmp_path / "a.csv"
    head = f"Time (s),Load (N),Extension (mm),{near}"
    path.write_text("\n".join([head, *MADE.lines(1, "{t},{f},{d},0.5")]), encoding="utf-8")
    check(read_study([path], **SIZES), 1)  # type: ignore[arg-type]


@pytest.mark.parametrize(("length", "load"), [
    ("stretch", "Cauchy stress (MPa)"), ("Strain (mm/mm)", "Stress True (MPa)"),
    ("Hencky strain", "sigma_true (MPa)"), ("strain_true", "stress_true (MPa)"),
    ("Strain (log) [-]", "Stress (Cauchy) [MPa]"), ("Log strain", "Nominal stress (MPa)"),
    ("epsilon", "P (MPa)"),
])  # fmt: skip
def test_true_measures_by_their_other_names_are_turned(
    tmp_path: Path, length: str, load: str
) -> None:
    """Whatever names say, the curve is the same one of nominal stress over engineering strain."""
    path = tmp_path / "a.csv"
    stretch = np.linspace(1.0, 2.0, 41)
    nominal = 0.3 * (stretch - stretch**-2.0)
    is_log = re.search("(?i)hencky|true|log", length)
    x = stretch if length == "stretch" else np.log(stretch) if is_log else stretch - 1.0
    y = nominal if load[0] in "NP" else nominal * stretch
    rows = "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(x, y, strict=True))
    path.write_text(f"{length},{load}\n{rows}", encoding="utf-8")
    columns = ["strain", "stress_MPa"] if load[0] == "P" else None
    ((curve,),) = read_study([path], columns=columns).groups.values()
    # 1e-8: nine digits in the file.
    np.testing.assert_allclose(curve.strain, stretch - 1.0, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(curve.stress_MPa, nominal, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("label", ["Mean", "Average", "Std. Dev.", "Mittelwert", "平均"])
@pytest.mark.parametrize("beside", [True, False])
def test_a_mean_beside_records_is_no_specimen(tmp_path: Path, label: str, *, beside: bool) -> None:
    path = tmp_path / "a.csv"
    one, two = MADE.lines(1, "{f},{d}"), MADE.lines(2, "{f},{d}")
    if beside:
        names = f"S1,,S2,,{label},\n" + ",".join(["Load (N),Extension (mm)"] * 3)
        rows = [",".join(row) for row in itertools.zip_longest(one, two, one, fillvalue=",")]
    else:
        names = "specimen,Load (N),Extension (mm)"
        of = {"S1": one, "S2": two, label: one}
        rows = [f"{name},{row}" for name, lines in of.items() for row in lines]
    path.write_text("\n".join([names, *rows]), encoding="utf-8")
    found = read_study([path], **SIZES)  # type: ignore[arg-type]
    check(found, 2)
    assert f"a.csv: {label} of the others; left out" in " ".join(found.notes)


def test_a_sheet_of_means_is_no_specimen(tmp_path: Path) -> None:
    """A material "Average" was made of it."""
    heads = ["Load (N)", "Extension (mm)"]
    rows = {n: [line.split(",") for line in MADE.lines(n, "{f},{d}")] for n in (1, 2)}
    sheets = {name: [heads, *rows[n]] for name, n in (("S1", 1), ("S2", 2), ("Average", 1))}
    (tmp_path / "a.ods").write_bytes(MADE.ods(sheets))
    found = read_study([tmp_path / "a.ods"], **SIZES)  # type: ignore[arg-type]
    check(found, 2)
    assert "a.ods: Average of the others; left out" in found.notes


def test_sizes_behind_hashes_as_scripts_write_them(tmp_path: Path) -> None:
    """A figure of one digit as well, in one cell with its name."""
    path = tmp_path / "a.csv"
    head = ["# width_mm: 6", "# Thickness (mm): 2", "# gauge_mm: 25", "# time_s,force_N,travel_mm"]
    path.write_text("\n".join([*head, *MADE.lines(1, "{t},{f},{d}")]), encoding="utf-8")
    found = read_study([path])
    check(found, 1)
    assert found.records[0].area_mm2 == 12.0


def test_specimens_that_are_counted_ahead_of_the_headings(tmp_path: Path) -> None:
    """A heading may begin with a figure: it was taken for one, and the second one lost."""
    path = tmp_path / "a.csv"
    one, two = MADE.lines(1, "{f},{d}"), MADE.lines(2, "{f},{d}")
    rows = [",".join(row) for row in itertools.zip_longest(one, two, fillvalue=",")]
    for head in (
        "1_force_N,1_disp_mm,2_force_N,2_disp_mm",
        "1 Load (N),1 Travel (mm),2 Load (N),2 Travel (mm)",
    ):
        path.write_text("\n".join([head, *rows]), encoding="utf-8")
        check(read_study([path], **SIZES), 2)  # type: ignore[arg-type]


@pytest.mark.parametrize("tests", [5, 12])
def test_results_a_row_a_test_are_told(tmp_path: Path, tests: int) -> None:
    """They were told to be cyclic, or of too few points, and nothing said why."""
    figures = np.random.default_rng(0).normal([10.0, 25.0], [0.5, 1.0], (tests, 2))
    rows = "".join(f"{n},{load:.3f},{travel:.3f}\n" for n, (load, travel) in enumerate(figures))
    (tmp_path / "a.csv").write_text("Test,Load (N),Extension (mm)\n" + rows)
    with pytest.raises(FileError, match=r"not a row a test|if a row is a test, export curves"):
        read_study([tmp_path / "a.csv"], **SIZES)  # type: ignore[arg-type]


@pytest.mark.parametrize("names", ["S{}", "TPU {}", "{}a"])
def test_results_that_rise_are_no_curve(tmp_path: Path, names: str) -> None:
    """Specimens by name, the strongest last: their loads at break were one specimen's curve."""
    rows = "".join(f"{names.format(n)},{3 + 2 * n},{20 + 3 * n}\n" for n in range(1, 12))
    (tmp_path / "a.csv").write_text("Sample,Load (N),Extension (mm)\n" + rows)
    with pytest.raises(FileError, match="not a row a test"):
        read_study([tmp_path / "a.csv"], **SIZES)  # type: ignore[arg-type]


_OPEN = "http://schemas.openxmlformats.org/"
_CELLS = f'xmlns="{_OPEN}spreadsheetml/2006/main"'
_RELATIONS = f'<Relationships xmlns="{_OPEN}package/2006/relationships">{{}}</Relationships>'
_PARTS = {
    "[Content_Types].xml": f'<Types xmlns="{_OPEN}package/2006/content-types"/>',
    "_rels/.rels": _RELATIONS.format(
        f'<Relationship Id="b" Target="xl/workbook.xml" Type="{_OPEN}officeDocument/2006/'
        'relationships/officeDocument"/>'
    ),
    "xl/_rels/workbook.xml.rels": _RELATIONS.format(
        f'<Relationship Id="a" Target="worksheets/sheet1.xml" Type="{_OPEN}officeDocument/2006/'
        'relationships/worksheet"/>'
    ),
    "xl/workbook.xml": f'<workbook {_CELLS} xmlns:r="{_OPEN}officeDocument/2006/relationships">'
    '<sheets><sheet name="Data" sheetId="1" r:id="a"/></sheets></workbook>',
}


def _merged(path: Path, heads: Sequence[Sequence[str]], merged: str) -> None:
    """Write a record whose third column is 1.2 of the second; `merged` are two of its cells."""
    rows = [[str(n), f"{0.1 * n}", f"{0.12 * n}", f"{n**0.5}"] for n in range(9)]
    texts = "".join(
        f"<row>{''.join(f'<c t={chr(34)}{kind}{chr(34)}><v>{cell}</v></c>' for cell in row)}</row>"
        for kind, part in (("str", heads), ("n", rows))
        for row in part
    )
    ends = f'<sheetData>{texts}</sheetData><mergeCells><mergeCell ref="{merged}"/></mergeCells>'
    sheet = {"xl/worksheets/sheet1.xml": f"<worksheet {_CELLS}>{ends}</worksheet>"}
    path.write_bytes(_zip({k: v.encode() for k, v in (_PARTS | sheet).items()}))


def test_a_workbook_says_how_far_a_heading_goes(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    units = ["s", "mm", "mm", "N"]
    _merged(
        path, [["Time", "Travel", "", "Force"], ["", "Machine", "Extensometer", ""], units], "B1:C1"
    )
    (table,) = read_tensile(path)
    assert table.headings["displacement_mm"] == "Extensometer Travel (mm)"
    assert table.columns["displacement_mm"][-1] == pytest.approx(0.96, rel=1e-12)
    assert table.unused == ("Machine Travel",)
    _merged(path, [["Time (s)", "Travel (mm)", "", "Force (N)"]], "B1:C1")
    with pytest.raises(FileError, match="two lengths of one record, of two sensors"):
        read_tensile(path)
    _merged(path, [["Time", "Travel", "", "Force"], units], "D1:E1")
    (table,) = read_tensile(path)
    assert table.unused == ("column 3 (no heading)",)


@pytest.mark.parametrize(
    ("before", "cells", "warned"),
    [
        ("", '<xf numFmtId="0"/><xf numFmtId="10"/>', True),
        ('<numFmt numFmtId="164" formatCode="0.0%"/>', '<xf/><xf numFmtId="164"/>', True),
        # LibreOffice writes a style of per cent that no cell has.
        ('<cellStyleXfs><xf numFmtId="9"/></cellStyleXfs>', '<xf/><xf numFmtId="0"/>', False),
        # A format that no cell has, and one that the column beside has alone.
        ("", '<xf numFmtId="9"/><xf numFmtId="0"/>', False),
        ("", '<xf/><xf numFmtId="0"/><xf numFmtId="10"/>', False),
    ],
)
def test_cells_in_a_format_of_per_cent_are_warned_of(
    tmp_path: Path, before: str, cells: str, warned: bool
) -> None:
    """Excel's 12 % is the number 0.12: below "Strain (%)" moduli came out a hundredfold, unsaid."""
    rows = [("Strain (%)", "Stress (MPa)")]
    for e in np.linspace(0.0, 1.0, 60).tolist():
        rows.append((e if warned else 100.0 * e, 0.3 * (1.0 + e - (1.0 + e) ** -2.0)))
    data = (
        "<sheetData>"
        + "".join(
            f'<row><c r="A{n}" s="1" t="{kind}"><v>{strain}</v></c>'
            f'<c r="B{n}" s="2" t="{kind}"><v>{stress}</v></c></row>'
            for n, (strain, stress) in enumerate(rows, start=1)
            for kind in ["str" if n == 1 else "n"]
        )
        + "</sheetData>"
    )
    parts = _PARTS | {
        "xl/worksheets/sheet1.xml": f"<worksheet {_CELLS}>{data}</worksheet>",
        "xl/styles.xml": f"<styleSheet {_CELLS}>{before}<cellXfs>{cells}</cellXfs></styleSheet>",
    }
    (tmp_path / "a.xlsx").write_bytes(_zip({k: v.encode() for k, v in parts.items()}))
    told = [note for note in read_study([tmp_path / "a.xlsx"]).notes if "per cent" in note]
    assert [note.rpartition(", ")[2] for note in told] == ["give --unit-of strain=1"] * warned
    # That option makes it right.
    unit = ["strain=1"] if warned else []
    ((curve,),) = read_study([tmp_path / "a.xlsx"], unit_of=unit).groups.values()
    assert curve.strain[-1] == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("name", ["Specimen {}", "Run {}", "Éprouvette {}", "試験片{}", "A-{}"])
def test_a_line_that_names_the_specimen_by_its_word_again(tmp_path: Path, name: str) -> None:
    """ "Specimen,Specimen 1" above a block was taken for a row of headings, and named nothing."""
    lines = list[str]()
    for n in (1, 2):
        lines += [f"Specimen,{name.format(n)}", "Load (N),Travel (mm)", *MADE.lines(n, "{f},{d}")]
    (tmp_path / "a.csv").write_text("\n".join(lines), encoding="utf-8")
    found = read_study([tmp_path / "a.csv"], **SIZES)  # type: ignore[arg-type]
    check(found, 2)
    assert [record.specimen for record in found.records] == [name.format(n) for n in (1, 2)]


def test_what_stands_behind_a_record_says_how_it_was_loaded(tmp_path: Path) -> None:
    """A direction below the rows, where some programs write it, was not read: it was pulled."""
    head = "Time (sec), Load (N), Strain, , Position (mm), Count"
    foot = ["", "Date:, 11/13/25", "Specimen ID#:, 1", "Direction:, COMPRESSION", "Status:, PASS"]
    rows = MADE.lines(1, "{t}, {f}, N/A, , {d}, 1")
    (tmp_path / "a.csv").write_text("\n".join([head, *rows, *foot]), encoding="utf-8")
    study = read_study([tmp_path / "a.csv"], **SIZES)  # type: ignore[arg-type]  # sizes alone
    assert [record.mode for record in study.records] == ["compression"]
    assert not study.groups


@pytest.mark.parametrize("head", ["Test Direction,MD", "Test type,QA"])
def test_a_direction_in_the_sheet_hides_no_mode(tmp_path: Path, head: str) -> None:
    """The first of two lines that may tell the mode counted, though it told none."""
    lines = [head, "Test mode,Compression", "Time (s),Load (N),Extension (mm)"]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*lines, *MADE.lines(1, "{t},{f},{d}")]), encoding="utf-8")
    (table,) = read_tensile(path)
    assert table.metadata == {"mode": "Compression"}


def test_numbers_ahead_of_the_headings_name_specimens(tmp_path: Path) -> None:
    """Of several in one file the second was refused: "nothing names another"."""
    lines = ["Results Table 1", "", ""]
    for n in (1, 2):
        rows = MADE.lines(n, '"","{t}","{d}","{f}"')
        lines += [f"{n},Time,Displacement,Force", ",(s),(mm),(N)", *rows, ""]
    (tmp_path / "a.csv").write_text("\n".join(lines), encoding="utf-8")
    found = read_study([tmp_path / "a.csv"], **SIZES)  # type: ignore[arg-type]  # sizes alone
    check(found, 2)
    assert [record.specimen for record in found.records] == ["1", "2"]


@pytest.mark.parametrize(
    "head", ["t(s),F(N),Position(mm)", "t / s,Load cell (N),s / mm", "t [s],Tension [N],u [mm]"]
)
def test_symbols_with_their_units_are_columns(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join([head, *MADE.lines(1, "{t},{f},{d}")]), encoding="utf-8")
    check(read_study([path], **SIZES), 1)  # type: ignore[arg-type]  # sizes alone


def test_symbols_with_other_units_are_none(tmp_path: Path) -> None:
    """A bridge's voltage, a temperature and a place along the gauge head no column of a record."""
    path = tmp_path / "a.csv"
    head = "Time (s),Load (N),Extension (mm),Load cell (mV),T (°C),x (mm)"
    rows = MADE.lines(1, "{t},{f},{d},{f},23,{d}")
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    (table,) = read_tensile(path)
    assert {*table.columns} == {"time_s", "force_N", "displacement_mm"}
    assert table.unused == ("Load cell (mV)", "T (°C)", "x (mm)")


def test_an_anvil_height_is_the_length_that_is_pressed(tmp_path: Path) -> None:
    heads = ["Specimen properties : Anvil height,6.0,mm", "Specimen properties : Diameter,5.4,mm"]
    columns = "Time (s),Compressive load (N),Compressive extension (mm)"
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*heads, columns, *MADE.lines(1, "{t},{f},{d}")]), encoding="utf-8")
    (table,) = read_tensile(path)
    assert (table.metadata["gauge_mm"], table.metadata["mode"]) == (6.0, "compression")
