"""Tensile files: the layouts of MESURgauge, Bluehill and plain CSV, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from planner.errors import FileError
from planner.formats.tensile import TensileTable, read_tensile

TIME = np.arange(10) * 0.1
TRAVEL_MM = 0.5 * np.arange(10)
LOAD_N = 2.0 * np.arange(10) ** 0.5


def read(tmp_path: Path, text: str | bytes, name: str = "a.csv") -> TensileTable:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    (table,) = read_tensile(path)
    return table


def rows(form: str, *, load: float = 1.0, travel: float = 1.0, end: str = "\n") -> str:
    return "".join(
        form.format(n=n, t=t, d=d / travel, f=f / load) + end
        for n, (t, d, f) in enumerate(zip(TIME, TRAVEL_MM, LOAD_N, strict=True), start=1)
    )


MARK10 = (
    "8/14/2017  10:46 AM\r\nUnits: lbF\r\nReadings: Continuous\r\nX-Axis: Travel\r\n"
    "Travel Unit: in\r\nReading\tLoad\tTravel\tTime\r\n"
    + rows("{n}\t{f:.9f}\t{d:.9f}\t{t:.3f}", load=4.4482216152605, travel=25.4, end="\r\n")
)
BLUEHILL = (
    '"General : Specimen label","x1"\r\n"Dimension : Width","3.10","mm"\r\n'
    '"Dimension : Thickness","0.1","in"\r\n\r\n'
    '"Results Table 1"\r\n"","Maximum Load (N)","Tensile strain at Break (%)"\r\n'
    '"1","6.0","30"\r\n\r\n"Time","Extension","Load"\r\n"(s)","(mm)","(kN)"\r\n'
    + rows('"{t:.3f}","{d:.4f}","{f:.12f}"', load=1000.0, end="\r\n")
)
PLAIN = "time_s,displacement_mm,force_N\n" + rows("{t:.3f},{d:.4f},{f:.9f}")
EUROPEAN = "Time (s);Position (mm);Load (N)\n" + rows("{t:.3f};{d:.4f};{f:.9f}").replace(".", ",")


@pytest.mark.parametrize(
    "text",
    [
        MARK10,
        MARK10.replace("\t", ","),
        BLUEHILL,
        PLAIN,
        EUROPEAN,
        PLAIN.encode("utf-16"),
        b"\xef\xbb\xbf" + PLAIN.encode(),
    ],
    ids=["mark10", "mark10-commas", "bluehill", "plain", "european", "utf-16", "bom"],
)
def test_one_record_in_every_layout(tmp_path: Path, text: str | bytes) -> None:
    table = read(tmp_path, text)
    assert list(table.columns) >= ["displacement_mm"]
    # 1e-7 N and mm: the texts' own rounding.
    np.testing.assert_allclose(table.columns["force_N"], LOAD_N, atol=1e-7)
    np.testing.assert_allclose(table.columns["displacement_mm"], TRAVEL_MM, atol=1e-7)
    np.testing.assert_allclose(table.columns["time_s"], TIME, atol=1e-7)


@pytest.mark.parametrize(
    "headings",
    ["Time [sec.],Travel mm,Load N", "Time s,Disp (mm),Force N", "Time (min.),Stroke mm,Load kN"],
)
def test_units_behind_a_blank_or_with_a_dot(tmp_path: Path, headings: str) -> None:
    scale = {"Time (min.)": 60.0, "Load kN": 1000.0}
    table = read(tmp_path, headings + "\n" + rows("{t:.3f},{d:.4f},{f:.9f}"))
    time, _, load = headings.split(",")
    # 1e-6: nine digits in the text, times 1000.
    np.testing.assert_allclose(table.columns["time_s"], TIME * scale.get(time, 1.0), atol=1e-6)
    np.testing.assert_allclose(table.columns["force_N"], LOAD_N * scale.get(load, 1.0), atol=1e-6)


def test_a_name_that_ends_in_no_unit_is_no_column(tmp_path: Path) -> None:
    table = read(tmp_path, PLAIN.replace("time_s", "Load cell"))
    assert set(table.columns) == {"displacement_mm", "force_N"}


def test_time_in_an_unknown_unit_is_left_out_in_sight(tmp_path: Path) -> None:
    table = read(tmp_path, PLAIN.replace("time_s", "Time [ticks]"))
    assert "time_s" not in table.columns
    assert "unknown unit 'ticks'" in table.notes[0]
    assert "time is optional" in table.notes[0]


def test_the_row_nearest_to_headings_is_quoted(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"line 2: no heading of a length.*'Time \(s\)' as time"):
        read(
            tmp_path, "Run 7\n" + PLAIN.replace(PLAIN.split("\n")[0], "Time (s),Gap (mm),Load (N)")
        )


def test_the_head_tells_sizes_and_units(tmp_path: Path) -> None:
    table = read(tmp_path, BLUEHILL)
    assert table.metadata["width_mm"] == 3.1
    # 1e-12: one product.
    assert table.metadata["thickness_mm"] == pytest.approx(2.54, rel=1e-12)
    assert table.metadata["specimen"] == "x1"
    assert "displacement in in, time in s by its head" in read(tmp_path, MARK10).notes[0]


def test_thousands_in_quotes(tmp_path: Path) -> None:
    text = 'Time (s),Travel (mm),Load (N)\n0,0,0\n1,1,"1,234.5"\n'
    assert read(tmp_path, text).columns["force_N"][1] == 1234.5


def test_specimens_in_one_file(tmp_path: Path) -> None:
    path = tmp_path / "curves.csv"
    path.write_text("specimen,time_s,displacement_mm,force_N\nA,0,0,0\nB,0,0,1\nA,1,1,2\n")
    first, second = read_tensile(path)
    assert (first.specimen, second.specimen) == ("A", "B")
    np.testing.assert_array_equal(first.columns["force_N"], [0.0, 2.0])
    np.testing.assert_array_equal(first.lines, [2, 4])


def test_a_short_record_that_is_said_to_have_broken_is_no_table_of_results(tmp_path: Path) -> None:
    head = "Time (s),Load (N),Travel (mm)\n"
    first, second = ("".join(f"{i},{2 * i},{0.5 * i}\n" for i in range(n)) for n in (40, 8))
    text = f"Specimen 1\n{head}{first}Specimen 2\nBreak type,ductile\n{second}"
    path = tmp_path / "two.csv"
    path.write_text(text)
    tables = read_tensile(path)
    assert [(table.specimen, len(table.lines)) for table in tables] == [("1", 40), ("2", 8)]


def test_a_head_behind_a_name_and_a_blank_line_is_that_of_its_block(tmp_path: Path) -> None:
    """It was skipped, and load and travel were read by the head before: one for the other."""
    rows = [(i, 2.0 * i, 0.5 * i) for i in range(8)]
    first = "\n".join(f"{t},{load},{travel}" for t, load, travel in rows)
    second = "\n".join(f"{t},{travel},{load}" for t, load, travel in rows)
    path = tmp_path / "two.csv"
    path.write_text(
        f"Specimen A\nTime (s),Load (N),Travel (mm)\n{first}\n"
        f"Specimen B\n\nTime (s),Travel (mm),Load (N)\n{second}\n"
    )
    for table in read_tensile(path):
        assert table.columns["force_N"][-1] == 14.0
        assert table.columns["displacement_mm"][-1] == 3.5


def test_columns_by_position_in_a_file_without_headings(tmp_path: Path) -> None:
    path = tmp_path / "treloar.txt"
    path.write_text("   0.0255    1.0200\n   0.1344    1.1250\n")
    (table,) = read_tensile(path, columns=["stress_MPa", "stretch"])
    # 1e-15: one subtraction of numbers near 1.
    np.testing.assert_allclose(table.columns["strain"], [0.02, 0.125], atol=1e-15)
    np.testing.assert_array_equal(table.columns["stress_MPa"], [0.0255, 0.1344])
    with pytest.raises(FileError, match="column 'stres' is unknown"):
        read_tensile(path, columns=["stres", "stretch"])


def test_what_follows_a_blank_line_is_left_out_and_noted(tmp_path: Path) -> None:
    table = read(tmp_path, PLAIN + "\nComment,by hand,\n")
    assert len(table.lines) == 10
    assert "line 13" in table.notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("a,b\n1,2\n", "no heading of a load"),
        ("only words\n", "no row of headings"),
        (PLAIN.replace("force_N", "Load (stone)"), "unknown unit 'stone' of force"),
        (PLAIN.replace("force_N", "Load"), "column 'Load': no unit"),
        (PLAIN.replace("0.5000,2.0", "0.5000,nan"), "line 3, column 'force_N': 'nan"),
        (PLAIN.replace("0.5000,2.0", "0.5000,x2.0"), "line 3, column 'force_N': 'x2.0"),
        (PLAIN.replace("0.100,0.5000,2.000000000", "0.100,0.5000"), "line 3: 2 cells"),
        ("time_s,displacement_mm,force_N\n", "no bare numbers below"),
        (b"\x00\x01\x02", "binary"),
        (MARK10.replace("X-Axis: Travel", "Units: N"), "unit of force is 'N' here and 'lbF'"),
    ],
)
def test_bad_files_are_refused_with_the_place(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(FileError, match=message) as caught:
        read(tmp_path, text)
    assert str(tmp_path) in str(caught.value) or "a.csv" in str(caught.value)


SIZED = "Width,6,mm\nThickness,4,mm\n"


@pytest.mark.parametrize(
    ("heads", "read_as", "unused"),
    [
        # In each the fourth column is 0.8 of the third, and the one to read.
        ("Time,Strain,,Force\n,Transverse,Axial,\ns,%,%,N", "Strain Axial (%)",
         "Strain Transverse"),
        ("Time,Travel,,Force\n,Crosshead,Extensometer,\ns,mm,mm,N", "Extensometer Travel (mm)",
         "Crosshead Travel"),
        ("Time (s),Travel (mm),,Force (N)\n,Crosshead,Extensometer,", "Extensometer Travel (mm)",
         "Crosshead Travel (mm)"),
        ("Time,Travel,,Force\n,,Extensometer,\ns,mm,mm,N", "Extensometer Travel (mm)", "Travel"),
        ("Zeit,Dehnung,,Kraft\n,quer,längs,\ns,%,%,N", "Dehnung längs (%)", "Dehnung quer"),
    ],
)  # fmt: skip
def test_a_heading_above_several_columns_counts_for_each_with_the_word_below(
    tmp_path: Path, heads: str, read_as: str, unused: str
) -> None:
    """The second column had no heading, and the first was read: the wrong sensor's, unsaid."""
    two = "".join(
        f"{t},{d},{0.8 * d},{f}\n" for t, d, f in zip(TIME, TRAVEL_MM, LOAD_N, strict=True)
    )
    table = read(tmp_path, f"{SIZED}{heads}\n{two}")
    (length,) = {"strain", "displacement_mm"} & {*table.columns}
    assert table.headings[length] == read_as
    # 1e-12: texts hold the numbers whole.
    factor = 0.008 if length == "strain" else 0.8
    np.testing.assert_allclose(table.columns[length], factor * TRAVEL_MM, rtol=1e-12)
    assert table.unused == (unused,)


def test_a_heading_above_a_length_and_a_strain_is_of_both(tmp_path: Path) -> None:
    heads = "Time,Extension,,Load\ns,mm,%,N\n"
    table = read(tmp_path, heads + rows("{t:.3f},{d:.4f},{d:.4f},{f:.9f}"))
    np.testing.assert_allclose(table.columns["strain"], 0.01 * TRAVEL_MM, rtol=1e-12)
    np.testing.assert_allclose(table.columns["displacement_mm"], TRAVEL_MM, rtol=1e-12)
    assert table.unused == ()


@pytest.mark.parametrize("words", ["Left,Right", "Sensor 1,Sensor 2", ","])
def test_two_columns_of_one_heading_are_refused_as_where_it_comes_again(
    tmp_path: Path, words: str
) -> None:
    heads = f"Time,Force,Strain,\n,,{words}\ns,N,%,%\n"
    with pytest.raises(FileError, match="two lengths of one record, of two sensors"):
        read(tmp_path, heads + "".join(f"{t},{t},{t},{1.3 * t}\n" for t in TIME))


def test_names_of_specimens_below_merged_headings_tell_them_apart(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    heads = "Time,Travel,,Force,\n,A,B,A,B\ns,mm,mm,N,N\n"
    path.write_text(heads + "".join(f"{t},{t},{2 * t},{3 * t},{4 * t}\n" for t in TIME))
    first, second = read_tensile(path)
    assert (first.specimen, second.specimen) == ("A", "B")
    np.testing.assert_allclose(second.columns["displacement_mm"], 2 * TIME, rtol=1e-12)
    np.testing.assert_allclose(second.columns["force_N"], 4 * TIME, rtol=1e-12)


@pytest.mark.parametrize(
    ("heads", "unused"),
    [
        ("Time (s),Travel (mm),,Force (N)", "column 3 (no heading)"),
        ("Time,Travel,,Force\ns,mm,[ticks],N", "column 3 (no heading)"),
        ("Time,Travel,,Force\ns,mm,N,N", "column 3 (no heading)"),
        ("Time,Travel,,Force\ns,mm,degC,N", "Travel degC"),
    ],
)
def test_numbers_below_no_heading_are_told_as_not_used(
    tmp_path: Path, heads: str, unused: str
) -> None:
    table = read(tmp_path, f"{heads}\n" + rows("{t:.3f},{d:.4f},{n},{f:.9f}"))
    assert table.unused == (unused,)
    np.testing.assert_allclose(table.columns["displacement_mm"], TRAVEL_MM, rtol=1e-12)


def test_empty_columns_are_not_told(tmp_path: Path) -> None:
    assert read(tmp_path, PLAIN.replace("\n", ",,\n")).unused == ()


RESULTS = "{},Maximum Load (N),Modulus (MPa)\n1,9.1,0.91\n2,9.3,0.93\n3,9.0,0.88\nMean,9.1,0.91\n"


@pytest.mark.parametrize(
    "results",
    [
        "Results Table 1\n" + RESULTS.format(""),
        RESULTS.format("Specimen"),
        "Results\n,Maximale Kraft,E-Modul,Bruchdehnung\n,(N),(MPa),(%)\n1,9.12,0.91,80\n"
        "2,9.3,0.93,80\n3,9,0.88,80\nSD,0.1,0.02,0\n",
        "Specimen,Fmax,Emod\n,N,MPa\n1,9.1,0.91\n2,9.3,0.93\n",
    ],
)
@pytest.mark.parametrize("beside", [False, True])
def test_a_table_of_results_behind_several_records_is_left_out_and_said_to_be(
    tmp_path: Path, results: str, beside: bool
) -> None:
    """It was read as one record more, or refused with advice that led to the same refusal."""
    heads, points = "Time (s),Travel (mm),Load (N)", [f"{n},{2 * n},{n**0.5}" for n in range(50)]
    if beside:
        lines = ["S1,,,S2,,", f"{heads},{heads}", *(f"{point},{point}" for point in points), ""]
    else:
        lines = [line for n in (1, 2) for line in (f"Specimen S{n}", heads, *points, "")]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*lines, results]))
    tables = read_tensile(path)
    assert [table.specimen for table in tables] == ["S1", "S2"]
    assert [len(table.lines) for table in tables] == [50, 50]
    said = f"a.csv: what stands from line {len(lines) + 1} on is no part of the record"
    assert tables[-1].notes == (said,)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be read"):
        read_tensile(tmp_path / "none.csv")
