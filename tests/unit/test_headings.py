"""Exports in eight languages: headings, units, sizes, speeds, encodings; and how to read others."""

import re
from pathlib import Path

import numpy as np
import pytest

from planner.cli import run
from planner.errors import FileError
from planner.formats.tables import number
from planner.formats.tensile import heading_of, marked_specimen, read_tensile, size_of
from planner.formats.units import QUANTITY_UNITS
from planner.materials.study import read_study

TIME_S = 0.25 * np.arange(41)
TRAVEL_MM = 0.5 * np.arange(41)
FORCE_N = 3.25 * np.sqrt(np.arange(41))
WIDTH_MM, THICKNESS_MM, GAUGE_MM, SPEED_MM_S = 6.0, 2.0, 25.0, 2.0


def columns(separator: str, *, comma: bool, force: float = 1.0, quote: str = "") -> str:
    """Rows of time in s, force in `force` newtons and travel in mm."""
    rows = (
        separator.join(
            f"{quote}{v:.6f}{quote}".replace(".", "," if comma else ".") for v in (t, f / force, d)
        )
        for t, f, d in zip(TIME_S, FORCE_N, TRAVEL_MM, strict=True)
    )
    return "\r\n".join(rows) + "\r\n"


FILES = {
    # testXpert: names, units in a row of their own, symbols behind the sizes.
    "german-testxpert": (
        "cp1252",
        '"Probendicke a0";2,00;"mm"\r\n"Probenbreite b0";6,00;"mm"\r\n"Messlänge L0";25,0;"mm"\r\n'
        '"Prüfgeschwindigkeit";120;"mm/min"\r\n\r\n'
        '"Prüfzeit";"Standardkraft";"Standardweg"\r\n"s";"N";"mm"\r\n'
        + columns(";", comma=True),
    ),
    "german-bluehill": (
        "utf-8-sig",
        '"Abmessung : Breite";"6,00";"mm"\r\n"Abmessung : Dicke";"2,00";"mm"\r\n'
        '"Abmessung : Länge";"25,00";"mm"\r\n"Rampe : Geschwindigkeit 1";"120,0";"mm/min"\r\n\r\n'
        "Zeit;Last;Verlängerung\r\n(s);(kN);(mm)\r\n" + columns(";", comma=True, force=1000.0),
    ),
    "french": (
        "cp1252",
        'Largeur;6,00;mm\r\nÉpaisseur;2,00;mm\r\nLongueur de référence;25,0;mm\r\n'
        "Vitesse d'essai;120;mm/min\r\n\r\n"
        "Temps (s);Charge (daN);Déplacement traverse (mm)\r\n"
        + columns(";", comma=True, force=10.0),
    ),
    "spanish": (
        "cp1252",
        "Dimensión : Anchura;6,00;mm\r\nDimensión : Espesor;2,00;mm\r\n"
        "Longitud inicial;25,0;mm\r\nVelocidad de ensayo;2;mm/s\r\n\r\n"
        "Tiempo;Carga;Extensión\r\n(s);(N);(mm)\r\n" + columns(";", comma=True),
    ),
    "italian": (
        "utf-16",
        "Larghezza\t6,00\tmm\r\nSpessore\t2,00\tmm\r\nLunghezza iniziale\t25,0\tmm\r\n"
        "Velocità di prova\t120\tmm/min\r\n\r\n"
        "Tempo [s]\tForza standard [N]\tSpostamento traversa [mm]\r\n" + columns("\t", comma=True),
    ),
    "japanese": (
        "shift_jis",
        '"厚さ","2.00","mm"\r\n"幅","6.00","mm"\r\n"標点間距離","25.0","mm"\r\n'
        '"試験速度","120","mm/min"\r\n\r\n'
        '"時間","試験力","ストローク"\r\n"sec","N","mm"\r\n' + columns(",", comma=False),
    ),
    "japanese-full-width": (
        "utf-8",
        "厚さ（ｍｍ）,2.00\r\n幅（ｍｍ）,6.00\r\nゲージ長（ｍｍ）,25.0\r\n試験速度（ｍｍ/ｍｉｎ）,120\r\n"
        "時間（秒）,荷重（Ｎ）,変位（㎜）\r\n" + columns(",", comma=False),
    ),
    "korean": (
        "cp949",
        "시험편명,고무 1\r\n폭 (mm),6.00\r\n두께 (mm),2.00\r\n표점거리 (mm),25.0\r\n"
        "시험속도 (mm/min),120\r\n시간(초),하중(N),변위(mm)\r\n" + columns(",", comma=False),
    ),
    "russian": (
        "cp1251",
        "Ширина;6,00;мм\r\nТолщина;2,00;мм\r\nНачальная длина;25,0;мм\r\nСкорость;2;мм/с\r\n\r\n"
        "Время;Усилие;Перемещение\r\nс;кН;мм\r\n" + columns(";", comma=True, force=1000.0),
    ),
    "english-mts": (
        "utf-8",
        "Width: 6.00 mm\r\nThickness: 2.00 mm\r\nGage Length: 25.0 mm\r\n"
        "Test Speed: 120 mm/min\r\n\r\n"
        "Running Time (s),Axial Force (lbf),Crosshead Displacement (mm)\r\n"
        + columns(",", comma=False, force=4.4482216152605),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_one_record_in_every_language(tmp_path: Path, name: str) -> None:
    encoding, text = FILES[name]
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode(encoding))
    (table,) = read_tensile(path)
    for column, values in (("time_s", TIME_S), ("displacement_mm", TRAVEL_MM)):
        np.testing.assert_allclose(table.columns[column], values, atol=1e-6)
    # 1e-3 N: the texts have six decimals, of kilonewtons in one of them.
    np.testing.assert_allclose(table.columns["force_N"], FORCE_N, atol=1e-3)
    sizes = ("width_mm", "thickness_mm", "gauge_mm", "rate_mm_s")
    # 1e-12: one product of a unit's factor.
    assert [table.metadata[s] for s in sizes] == pytest.approx(
        [WIDTH_MM, THICKNESS_MM, GAUGE_MM, SPEED_MM_S], rel=1e-12
    )


@pytest.mark.parametrize(
    "head",
    [
        "Время, с;Нагрузка, Н;Деформация, мм", "시간(초);하중(N);변위(mm)",
        "Czas [s];Siła [N];Droga [mm]", "Čas [s];Síla [N];Posuv [mm]",
        "Tid (s);Kraft (N);Förlängning (mm)", "ZEIT <s>;KRAFT_IST <N>;WEG_IST <mm>",
        "Time_S;XForce_N;XDisplacement_mm", "Time_s_;Force_N_;Displacement_mm_",
        "Time (s);Load (N);Extension at grips (mm)", "Time [s];Load [N];Grip displacement [mm]",
        "Sig1;Time (s)\nSig2;Static Force (N)\n\nSig3;Displacement (mm)\nStartOfData",
    ],
)  # fmt: skip
def test_heads_of_other_languages_and_machines(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{head}\n" + columns(";", comma=True), encoding="utf-8")
    (table,) = read_tensile(path)
    # 1e-6: six decimals in the file.
    for column, values in (
        ("time_s", TIME_S),
        ("force_N", FORCE_N),
        ("displacement_mm", TRAVEL_MM),
    ):
        np.testing.assert_allclose(table.columns[column], values, atol=1e-6)


def test_two_axes_of_a_biaxial_machine_stop(tmp_path: Path) -> None:
    """Alike in both, they would be read as one pull."""
    rows = "\n".join(
        f"{t},{d},{d},{f},{f}" for t, f, d in zip(TIME_S, FORCE_N, TRAVEL_MM, strict=True)
    )
    head = "Time_S,XDisplacement_um,YDisplacement_um,XForce_mN,YForce_mN"
    (tmp_path / "a.csv").write_text(f"{head}\n{rows}")
    with pytest.raises(FileError, match="along X and Y, two axes of one test"):
        read_tensile(tmp_path / "a.csv", option="--columns")


def test_loads_of_several_specimens_over_one_strain(tmp_path: Path) -> None:
    """Whatever the refusal proposes is read, each as it says."""
    heads = "Strain (%),Stress 1 (MPa),Stress 2 (MPa),Stress 3 (MPa),Average (MPa)"
    rows = "\n".join(
        f"{d},{f},{2 * f},{3 * f},{2 * f}" for f, d in zip(FORCE_N, TRAVEL_MM, strict=True)
    )
    path = tmp_path / "a.csv"
    path.write_text(f"{heads}\n{rows}")
    with pytest.raises(FileError, match="read 3 specimens by") as caught:
        read_tensile(path, option="--columns")
    read = []
    for example in re.findall(r"--columns ([^\s,]+(?:,[^\s,]+)+)", str(caught.value)):
        tables = read_tensile(path, columns=example.split(","), option="--columns")
        read.append([table.columns["stress_MPa"][-1] / FORCE_N[-1] for table in tables])
    # 1e-12: one product.
    for got, factors in zip(read, ([1.0], [2.0], [1.0, 2.0, 3.0]), strict=True):
        assert got == pytest.approx(factors, rel=1e-12)


def test_comments_below_the_headings_name_records(tmp_path: Path) -> None:
    """Origin writes its legend there, below the units; they were read as one material's."""
    rows = "\n".join(f"\t{d}\t{f}\t{d}\t{f}" for f, d in zip(FORCE_N, TRAVEL_MM, strict=True))
    head = (
        "Long Name\tStrain\tStress\tStrain\tStress\nUnits\t%\tMPa\t%\tMPa\n"
        "Comments\tEcoflex\tEcoflex\tDragon Skin\tDragon Skin"
    )
    (tmp_path / "a.txt").write_text(f"{head}\n{rows}")
    tables = read_tensile(tmp_path / "a.txt")
    assert [table.specimen for table in tables] == ["Ecoflex", "Dragon Skin"]


def test_a_sensor_that_never_moved_is_none(tmp_path: Path) -> None:
    """Programs write the extensometer that hung beside as zeros."""
    rows = "\n".join(f"{f},{d},0.0000" for f, d in zip(FORCE_N, TRAVEL_MM, strict=True))
    (tmp_path / "a.csv").write_text(f"Load (N),Displacement (mm),Strain (mm/mm)\n{rows}")
    (table,) = read_tensile(tmp_path / "a.csv")
    assert {*table.columns} == {"force_N", "displacement_mm"}
    assert table.unused == ("Strain (mm/mm)",)


def test_a_commented_head_between_blanks(tmp_path: Path) -> None:
    """As numpy.savetxt writes it: its hash is no column."""
    rows = "\n".join(
        f"{t} {d} {f * 1e6}" for t, f, d in zip(TIME_S, FORCE_N, TRAVEL_MM, strict=True)
    )
    (tmp_path / "a.dat").write_text(f"# time disp force\n# s mm uN\n{rows}")
    (table,) = read_tensile(tmp_path / "a.dat")
    # 1e-12: one product.
    np.testing.assert_allclose(table.columns["force_N"], FORCE_N, rtol=1e-12)
    np.testing.assert_allclose(table.columns["displacement_mm"], TRAVEL_MM, rtol=1e-12)


def test_two_accents_together_are_not_cyrillic(tmp_path: Path) -> None:
    head = "Größe;Messgröße;Prüfzeit [s];Prüfkraft [N];Weg [mm]"
    rows = columns(";", comma=True).replace("\r\n", "\r\n1;2;").removesuffix("1;2;")
    (tmp_path / "a.csv").write_bytes(f"{head}\r\n1;2;{rows}".encode("cp1252"))
    (table,) = read_tensile(tmp_path / "a.csv")
    assert {*table.columns} == {"time_s", "force_N", "displacement_mm"}


def test_a_sample_is_not_called_like_its_fixture(tmp_path: Path) -> None:
    """A list of specimens names the sample, and TRIOS the fixture further down."""
    head = "Sample name\tA-9\nName\tA-9\n[Geometry Parameters]\nName\tTension fixture\n"
    rows = "Time\tForce\tTravel\ns\tN\tmm\n"
    (tmp_path / "a.txt").write_text(head + rows + columns("\t", comma=False))
    (table,) = read_tensile(tmp_path / "a.txt")
    assert table.specimen == "A-9"


def test_units_in_each_cell_are_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Load,Travel\n" + "1.5 N,2.0 mm\n" * 9)
    with pytest.raises(FileError, match="no bare numbers below; export them, units in headings"):
        read_tensile(tmp_path / "a.csv")


def test_what_is_proposed_drops_no_second_strain(tmp_path: Path) -> None:
    """Else the second load would be read over the first strain."""
    path = tmp_path / "a.csv"
    path.write_text("strain_a,ecoflex MPa,strain_b,skin MPa\n" + "0,0,0,0\n1,2,3,4\n" * 4)
    with pytest.raises(FileError, match=r"--columns strain,\?,\?,\?"):
        read_tensile(path, option="--columns")


def test_numbers_below_a_title_are_told_how_to_be_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "#data\n" + "\n".join(f"{f},{d}" for f, d in zip(FORCE_N, TRAVEL_MM, strict=True))
    )
    with pytest.raises(FileError, match=r"name the columns by position: --columns \?,\? with"):
        read_tensile(path, option="--columns")


def test_a_list_of_specimens_by_another_name_is_told_its_own(tmp_path: Path) -> None:
    path = tmp_path / "sizes.csv"
    path.write_text("Sample,Width (mm),Thickness (mm)\n" + "".join(f"S{n},6,2\n" for n in range(4)))
    with pytest.raises(FileError, match=r"a list of specimens is called specimens\.csv"):
        read_tensile(path, option="--columns")


@pytest.mark.parametrize("heading", ["Eyy", "exx (mm/mm)", "Eyy_mean", "e11"])
def test_a_tensors_strain_is_told_how_it_is_taken(tmp_path: Path, heading: str) -> None:
    """Ncorr's and VIC's are Green-Lagrange's; at a strain of 1 they differ by half."""
    rows = "\n".join(f"{d / 20},{f}" for f, d in zip(FORCE_N, TRAVEL_MM, strict=True))
    for head in (heading, "Strain"):
        (tmp_path / "a.csv").write_text(f"{head},Load (N)\n{rows}")
        (table,) = read_tensile(tmp_path / "a.csv")
        assert any("read as engineering strain" in n for n in table.notes) == (head == heading)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_its_mark(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(FILES["german-testxpert"][1].encode(encoding))
    assert len(read_tensile(path)[0].lines) == len(TIME_S)


@pytest.mark.parametrize(
    ("heading", "meaning", "unit"),
    [
        # Headings as published scripts for such exports look for them.
        ("Prüfzeit", "time", None),
        ("Traversenweg absolut", "position", None),
        ("Traverse abs.", "position", None),
        ("Standardkraft (MPa)", "force", "MPa"),
        ("Dehnung", "elongation", None),
        ("Esfuerzo de tracción MPa", "stress", "MPa"),
        ("Deformación por tracción (Deformación 1)", "elongation", None),
        ("Deformación por tracción %", "elongation", "%"),
        ("Tensile strain (Strain 1) (%)", "strain", "%"),
        ("Tensile strain (Displacement)", "strain", None),
        ("Zugdehnung (Dehnung 1) (%)", "elongation", "%"),
        ("Zugspannung (MPa)", "stress", "MPa"),
        ("Contrainte en traction (MPa)", "stress", "MPa"),
        ("Sforzo a trazione (N/mm²)", "stress", "N/mm2"),
        ("Kraft in N", "force", "N"),
        ("Spannung / N/mm²", "stress", "N/mm2"),
        ("Kraft_kN", "force", "kN"),
        ("PRUEFKRAFT [N]", "force", "N"),
        ("Pruefling", "specimen", None),
        ("ひずみ(%)", "strain", "%"),
        ("応力（MPa）", "stress", "MPa"),
        ("Engineering Stress (MPa)", "stress", "MPa"),
        ("Disp.", "displacement", None),
        ("Eng. Strain (%)", "strain", "%"),
        ("Avg. Force (N)", "force", "N"),
        ("% Strain", "strain", "%"),
        ("Load (kips)", "force", "kips"),
        ("Strain (log) [%]", "true strain", "%"),
        ("%Elongation", "elongation", "%"),
        ("# time_s", "time", "s"),
        ("Static force (N)", "force", "N"),
        ("Compression load (N)", "force", "N"),
        ("Nominelle Stauchung", "elongation", None),
        ("Deformação (%)", "elongation", "%"),
        ("Load (grams)", "force", "grams"),
        ("Stress (true) [MPa]", "true stress", "MPa"),
        ("Strain (Hencky) [%]", "true strain", "%"),
        ("Strain (Green-Lagrange) [-]", "lagrange strain", "-"),
        ("Stress (nominal) [MPa]", "stress", "MPa"),
        ("First Piola-Kirchhoff stress (kPa)", "stress", "kPa"),
        ("Longitudinal strain", "strain", None),
    ],
)
def test_headings_are_taken_apart(heading: str, meaning: str, unit: str | None) -> None:
    found = heading_of(heading)
    assert (found.meaning, found.unit) == (meaning, unit)


@pytest.mark.parametrize(
    "heading",
    [
        "Breitenänderung",
        "Kraftmessdose",
        "Temps de repos",
        "Bruchdehnung",
        "最大点_試験力",
        "1/lambda",
        "1 / λ",
        "Displacement (setpoint) [mm]",
        "Strain (transverse) [%]",
        "Stress (shear) [MPa]",
        "2nd PK stress (MPa)",
        "Stress (2nd PK) [MPa]",
        "Load (max) [N]",
        "Load min [N]",
    ],
)
def test_what_only_sounds_alike_is_none(heading: str) -> None:
    assert not heading_of(heading).meaning


@pytest.mark.parametrize(
    ("cell", "size"),
    [
        *((cell, "gauge_mm") for cell in (
            "Messlänge Standardweg", "Meßlänge Traverse", "Messlaenge grob", "Anfangsmeßlänge L0",
            "Gauge length (extensometer)", "Gage length, fine strain", "Gauge Length 1", "Lo",
            "L 0", "L₀", "Original length", "Original gauge length", "Anfangslänge",
            "Bezugslänge", "標線間距離", "Strain : Tensile strain (Extension) gauge length",
            "# gauge_mm",
        )),
        *((cell, "grip_mm") for cell in ("Jaw separation", "Distance between grips")),
        *((cell, "width_mm") for cell in ("Probenbreite b [mm]:", "Width w", "幅(W)")),
        *((cell, "thickness_mm") for cell in ("Dicke a", "Thickness t", "Dicke h", "a0 (mm)")),
        *((cell, "area_mm2") for cell in ("A0 [mm²]", "Querschnitt A0")),
        *((cell, None) for cell in ("Messlänge nach Bruch", "Gauge length at break", "low", "t")),
    ],
)  # fmt: skip
def test_sizes_and_their_symbols(cell: str, size: str | None) -> None:
    assert size_of(cell)[0] == size


@pytest.mark.parametrize(
    "cell",
    ["Test No: 1", "Test Number: 1", "Test No. 1", "Test Run 1", "Specimen Number: 1", "Kurve 1",
     "Curve 1", "Prova N. 1", "Proben-Nr. 1", "Proben-Nr.: 1", "Specimen 1", "Test #1"],
)  # fmt: skip
def test_marks_of_a_specimen(cell: str) -> None:
    assert marked_specimen(cell) == "1"


@pytest.mark.parametrize(
    "cell",
    [
        "Test: Tensile",
        "Test name: ISO 37",
        "Test ID: 5",
        "Probenbreite: 6",
        "Test Date: 3",
        "Test speed: 5",
        "Curve: Force",
        "Sample rate: 100",
    ],
)
def test_what_marks_no_specimen(cell: str) -> None:
    assert marked_specimen(cell) is None


def test_the_travel_goes_before_a_crossheads_position(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        '"Prüfzeit"\t"Standardkraft"\t"Traversenweg absolut"\t"Standardweg"\t"Breitenänderung"\n'
        '"s"\t"N"\t"mm"\t"mm"\t"mm"\n0\t0\t101.5\t0\t0\n1\t2\t102.5\t0.75\t0\n',
        encoding="utf-8",
    )
    (table,) = read_tensile(path)
    np.testing.assert_array_equal(table.columns["displacement_mm"], [0.0, 0.75])
    assert "'Traversenweg absolut' left out; displacement_mm is read from 'Stand" in table.notes[0]


@pytest.mark.parametrize(
    ("cell", "separator", "value"),
    [
        ("1.234,5", ";", 1234.5),
        ("1\N{NARROW NO-BREAK SPACE}234,5", ";", 1234.5),
        ("1\N{NO-BREAK SPACE}234.5", ",", 1234.5),
        ("1'234.5", ",", 1234.5),
        ("\N{MINUS SIGN}0,5", ";", -0.5),
        ("1,092.8", ";", 1092.8),
        ("1.2,5", ";", None),
    ],
)
def test_thousands_as_countries_group_them(cell: str, separator: str, value: float | None) -> None:
    assert number(cell, separator) == value


def test_decimal_commas_in_quotes_between_commas(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        '"Zeit (s)","Kraft (N)","Weg (mm)"\n' + columns(",", comma=True, quote='"'),
        encoding="utf-8",
    )
    np.testing.assert_allclose(read_tensile(path)[0].columns["force_N"], FORCE_N, atol=1e-6)


def test_what_may_be_a_length_or_a_strain_needs_its_unit(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Kraft (N);Dehnung\n0;0\n1;2\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"'Dehnung': no unit, .*'Dehnung \(mm\)'.*--columns"):
        read_tensile(path, option="--columns")


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("Time (s),Load (N),Gap (mm)\n", r"line 1: no heading of a length.*'Load \(N\)' as force; "
         r"not understood: 'Gap \(mm\)'"),
        ("Aika;Voima;Matka\ns;N;mm\n", "understood: none; not understood: 'Aika', 'Voima', 'Mat"),
        ("Run 7\n\nAika [s];Voima [kN];Venymä [%]\n", "line 3: no heading"),
        ("Temps;Charge;Déplacement\n", r"'Charge': no unit; write it .* as .Charge \(N"),
        ("Time (s),Load (N),Laser travel (mm)\n", "not understood: 'Laser travel"),
    ],
)  # fmt: skip
def test_the_columns_option_that_is_proposed_works(tmp_path: Path, head: str, said: str) -> None:
    comma = ";" in head
    path = tmp_path / "a.csv"
    path.write_text(head + columns(";" if comma else ",", comma=comma), encoding="utf-8")
    with pytest.raises(FileError, match=said) as caught:
        read_tensile(path, option="--columns")
    example = re.search(r"--columns (\S+)", str(caught.value))
    assert example is not None
    (table,) = read_tensile(path, columns=example[1].split(","))
    assert len(table.lines) == len(TIME_S)
    # Where no such option is, as for campaigns, the same stands as headings.
    with pytest.raises(FileError, match="head the columns " + re.escape(example[1])):
        read_tensile(path)


@pytest.mark.parametrize(
    ("head", "example"),
    [
        ("a,b,c", "?,?,?"),
        ("a,b,E_kPa", "?,?,?"),
        ("Aika [s],Voima,Matka", "time_s,?,?"),
        ("Time (s),Load (N),b", "time_s,force_N,?"),
        ("Time (s),Slack (mm),Gap (mm)", "time_s,?,?"),
    ],
)
def test_no_order_of_columns_is_guessed(tmp_path: Path, head: str, example: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(head + "\n" + columns(",", comma=False), encoding="utf-8")
    with pytest.raises(FileError, match=rf"--columns {re.escape(example)} with .* for a '\?'"):
        read_tensile(path, option="--columns")
    with pytest.raises(FileError, match=r"column '\?' is unknown"):
        read_tensile(path, columns=example.split(","))


@pytest.mark.parametrize(
    "other",
    [
        "Young's modulus (MPa)",
        "Peak stress [MPa]",
        "Pressure (kPa)",
        "Yield Str. (MPa)",
        "2nd PK stress (MPa)",
        "Mooney stress (MPa)",
    ],
)
def test_a_figure_is_not_proposed_as_a_load(tmp_path: Path, other: str) -> None:
    """Its unit is a stress's, and yet it is no channel of the record."""
    path = tmp_path / "a.csv"
    for head in (f"Time (s),Strain (%),{other}", f"Time,Strain,{other[:5]}\n(s),(%),(V)"):
        path.write_text(f"{head}\n{columns(',', comma=False)}", encoding="utf-8")
        with pytest.raises(FileError, match=r"--columns time_s,strain_%,(\?|-)") as caught:
            read_tensile(path, option="--columns")
        assert "stress_MPa " not in str(caught.value).partition(" with ")[0]


def test_a_number_behind_a_name_is_no_unit(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"Time (s),Sensor (N),Aux Input 1\n{columns(',', comma=False)}")
    with pytest.raises(FileError, match=r"--columns time_s,force_N,\? with"):
        read_tensile(path, option="--columns")


def test_a_file_without_a_load_is_told_so(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("specimen,time_s,displacement_mm\nA,0,0\nA,1,1\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"line 1: no heading of a load.*export what is missing"):
        read_tensile(path)


TERMS = {
    "time": "Time, Zeit, Prüfzeit, Temps, Tiempo, Tempo, 時間, 时间",
    "force": "Load, Force, Kraft, Last, Prüfkraft, Charge, Effort, Carga, Fuerza, "
    "Carico, Forza, 試験力, 荷重, 力, 试验力, 负荷",
    "displacement": "Extension, Travel, Stroke, Displacement, Weg, Traversenweg, "
    "Verlängerung, Déplacement, Course, Desplazamiento, Extensión, "
    "Spostamento, Estensione, Corsa, ストローク, 変位, 位移, 行程",
    "strain": "Strain, Dehnung, Déformation, Deformación, Deformazione, ひずみ, 应变, 伸长率",
    "stress": "Stress, Spannung, Contrainte, Esfuerzo, Tensión, Sforzo, Tensione, 応力, "
    "应力",
    "width_mm": "Width, Breite, Probenbreite, Largeur, Anchura, Ancho, Larghezza, 幅, 宽度",
    "thickness_mm": "Thickness, Dicke, Probendicke, Épaisseur, Espesor, Spessore, 厚さ, 厚度",
    "gauge_mm": "Gauge length, Length, Messlänge, Länge, Longueur, Longitud, Lunghezza, "
    "標点距離, 标距",
    "rate_mm_s": "Speed, Rate, Prüfgeschwindigkeit, Vitesse, Velocidad, Velocità, 試験速度, "
    "试验速度",
}  # fmt: skip
"""In English, German, French, Spanish, Italian, Japanese and Chinese."""


@pytest.mark.parametrize("what", TERMS)
def test_terms_of_seven_languages_are_understood(what: str) -> None:
    for term in TERMS[what].split(", "):
        found = heading_of(term)
        if what == "strain":
            assert found.meaning in ("strain", "elongation"), term
        elif what.endswith(("_mm", "_mm_s")):
            # A bare "Length" serves where nothing calls itself a gauge length.
            assert (size_of(term)[0] or "").replace("length", "gauge") == what, term
        else:
            assert found.meaning == what, term


def test_records_side_by_side_are_all_read(tmp_path: Path) -> None:
    """Trapezium writes the specimens of a batch beside one another."""
    path = tmp_path / "a.csv"
    rows = "".join(f"{t},{f},{d},{t},{2 * f},{d}\n" for t, f, d in
                   zip(TIME_S, FORCE_N, TRAVEL_MM, strict=True))  # fmt: skip
    path.write_text(
        "1 _ 1,,,1 _ 2,,\n時間,試験力,ストローク,時間,試験力,ストローク\nsec,kN,mm,sec,kN,mm\n"
        + rows,
        encoding="shift_jis",
    )
    one, two = read_tensile(path, option="--columns")
    assert (one.specimen, two.specimen) == ("1 _ 1", "1 _ 2")
    # 1e-12: one product, of figures written in full.
    np.testing.assert_allclose(one.columns["force_N"], 1000.0 * FORCE_N, rtol=1e-12)
    np.testing.assert_allclose(two.columns["force_N"], 2000.0 * FORCE_N, rtol=1e-12)


def test_a_speed_in_the_head_is_used_and_said(tmp_path: Path, capsys) -> None:
    path = tmp_path / "FLX9760.csv"
    path.write_bytes(FILES["german-testxpert"][1].encode("cp1252"))
    assert run(["fit", str(path), "--law", "ogden", "-o", str(tmp_path / "p.toml")]) == 0
    assert "rate_mm_s 2" in capsys.readouterr().err
    # 2 mm/s over 25 mm.
    assert "strain_rate_per_s = 0.08" in (tmp_path / "p.toml").read_text()


def test_two_speeds_leave_it_open(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    head = "Ramp : Speed 1,10,mm/min\nRamp : Speed 2,500,mm/min\nTime (s),Load (N),Travel (mm)\n"
    path.write_text(head + columns(",", comma=False), encoding="utf-8")
    assert "rate_mm_s" not in read_tensile(path)[0].metadata


QUANTITY_NAMES = {
    "force": "Load", "stress": "Stress", "strain": "Strain", "length": "Extension", "time": "Time",
}  # fmt: skip


@pytest.mark.parametrize("form", ["{} {}", "{}, {}", "{} / {}", "{} in {}", "{}/{}", "{}_{}"])
def test_a_unit_is_the_same_however_it_stands_behind_a_name(form: str) -> None:
    """Of "Strain mm/mm" the last mm were the unit, so that it was a travel."""
    for quantity, name in QUANTITY_NAMES.items():
        for unit in QUANTITY_UNITS[quantity]:
            if unit not in ("", "1", "per cent"):  # a bare name, a number, two words
                told = heading_of(form.format(name, unit)).column("here")
                assert told == heading_of(f"{name} ({unit})").column("here"), unit
                apart = form.format(name, unit.replace("/", " / "))
                assert told == heading_of(apart).column("here"), unit
    for name, unit in (("Width", "in"), ("Test speed", "mm/min"), ("Area", "mm^2")):
        assert size_of(form.format(name, unit)) == size_of(f"{name} ({unit})")


@pytest.mark.parametrize("name", ["Percentage Strain", "Percent strain", "Strain percentage"])
def test_a_percentage_is_one_without_a_unit(name: str) -> None:
    """Nexygen's "Percentage Strain" was taken for a fraction."""
    assert heading_of(name).column("here") == ("strain", 0.01)


def test_a_proposal_of_columns_goes_by_tabs(tmp_path: Path) -> None:
    """Blanks within headings were taken for ends of columns: "Step time" for two."""
    path = tmp_path / "a.txt"
    path.write_text("Step time\tGap\tAxial force\ns\tmm\tN\n" + columns("\t", comma=False))
    with pytest.raises(FileError, match="not understood: 'Step time', 'Gap'") as caught:
        read_tensile(path, option="--columns")
    proposed = str(caught.value).partition("--columns ")[2]
    (table,) = read_tensile(path, columns=proposed.split(","))
    # 1e-6: six decimals in the file, whose second column is the force.
    np.testing.assert_allclose(table.columns["displacement_mm"], FORCE_N, atol=1e-6)


def test_a_table_on_its_side_is_told(tmp_path: Path) -> None:
    rows = [["Strain (%)", *TRAVEL_MM], ["Tango (MPa)", *FORCE_N], ["Vero (MPa)", *FORCE_N]]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in rows))
    with pytest.raises(FileError, match=r"beside 'Strain .%.', not below; transpose the table"):
        read_tensile(path, option="--columns")


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("Strain (%),TangoPlus (MPa),Agilus30 (MPa)", "strain_%,stress_MPa,stress_MPa"),
        ("TangoPlus_strain,TangoPlus_MPa,Agilus30_strain,Agilus30_MPa",
         "strain_%,stress_MPa,strain_%,stress_MPa"),
        ("strain (TangoPlus),stress (TangoPlus),strain (Agilus30),stress (Agilus30)",
         "strain_%,stress_MPa,strain_%,stress_MPa"),
    ],
)  # fmt: skip
def test_headings_beside_columns_by_position_name_materials(
    tmp_path: Path, head: str, columns: str
) -> None:
    """Two materials were read as replicates of one."""
    each = [TRAVEL_MM, FORCE_N, TRAVEL_MM, 2 * FORCE_N]
    each = each if head.count(",") == 3 else [*each[:2], each[3]]
    rows = "\n".join(",".join(map(str, row)) for row in zip(*each, strict=True))
    (tmp_path / "a.csv").write_text(f"{head}\n{rows}")
    study = read_study(tmp_path / "a.csv", columns=columns.split(","))
    peaks = {material: curve.stress_MPa[-1] for material, (curve,) in study.groups.items()}
    assert peaks == {"TangoPlus": FORCE_N[-1], "Agilus30": 2 * FORCE_N[-1]}
