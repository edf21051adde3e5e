"""Write the folder machine_exports: what testing machines export, imitated layout by layout.

The specimens are made up, the layouts, words and encodings are those of the machines. Run by hand
(`python tests/data/make_machine_exports.py`); XLSX and XLS take openpyxl and xlwt.
"""

import io
import itertools
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).with_name("machine_exports")
WIDTH_MM, THICKNESS_MM, GAUGE_MM, SPEED_MM_S = 6.0, 2.0, 25.0, 2.0
AREA_MM2 = WIDTH_MM * THICKNESS_MM


def points(number: int) -> int:
    """Of the specimen of this number: each has its own, so that none can stand for another."""
    return 30 + 3 * number


def specimen(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time in s, force in N and travel in mm of a rubber, stiffer from number to number."""
    travel = np.linspace(0.0, 0.8 * GAUGE_MM, points(number))
    stretch = 1.0 + travel / GAUGE_MM
    force = AREA_MM2 * (0.3 + 0.05 * number) * (stretch - stretch**-2.0)
    return travel / SPEED_MM_S, force, travel


def lines(number: int, form: str, comma: bool = False, **scale: float) -> list[str]:
    """Rows in which {t}, {f}, {d}, {e}, {s} are time, force, travel, strain and stress."""
    found = []
    for t, f, d in zip(*specimen(number), strict=True):
        values = {"t": t, "f": f, "d": d, "e": d / GAUGE_MM, "s": f / AREA_MM2}
        cells = {k: f"{v / scale.get(k, 1.0):.9g}" for k, v in values.items()}
        if comma:
            cells = {k: v.replace(".", ",") for k, v in cells.items()}
        found.append(form.format(**cells))
    return found


def beside(numbers: list[int], form: str, separator: str, width: int, **options: Any) -> list[str]:
    """Rows of several specimens beside one another, empty where one has ended."""
    each = [lines(n, form, **options) for n in numbers]
    gap = separator * (width - 1)
    return [
        separator.join(rows[at] if at < len(rows) else gap for rows in each)
        for at in range(max(map(len, each)))
    ]


def text(*parts: str | list[str], end: str = "\r\n") -> str:
    """Lines of a file."""
    return end.join(line for p in parts for line in ([p] if isinstance(p, str) else p)) + end


def texts() -> dict[str, tuple[str, str]]:
    """Files of text by name, each with its encoding."""
    return {
        # Zwick testXpert: one specimen a file, keys and values with units above.
        "zwick_fr.TRA": ("cp1252", text(
            '"Désignation éprouvette";"A1"', '"S0";12,00;"mm²"',
            '"L0 - course standard";25,00;"mm"', '"Vitesse d\'essai";120;"mm/min"', "",
            '"Temps d\'essai";"Force Standard";"Course standard";"Course traverse absolue"',
            '"s";"N";"mm";"mm"', [f"{x};{300 + i}" for i, x in
                                  enumerate(lines(1, "{t};{f};{d}", comma=True))])),
        "zwick_de.asc": ("cp1252", text(
            "Prüfprotokoll\t\t", "Probendicke a0\t2,00\tmm", "Probenbreite b0\t6,00\tmm",
            "Anfangsmesslänge\t25,00\tmm", "",
            "Prüfzeit [s]\tStandardkraft [N]\tStandardwegaufnehmer [mm]\tBemerkung",
            [f"{x}\t" for x in lines(1, "{t}\t{f}\t{d}", comma=True)])),
        "zwick_en.txt": ("utf-16", text(
            '"Specimen designation"\t"A1"', '"Cross-section"\t12\t"mm²"',
            '"Gage length, standard travel"\t25\t"mm"',
            '"Grip to grip separation at the start position"\t60\t"mm"',
            '"Test time"\t"Standard force"\t"Strain"', '"s"\t"N"\t"mm"',
            lines(1, "{t}\t{f}\t{d}"))),
        # Shimadzu Trapezium: specimens beside one another, named above.
        "trapezium_ja.csv": ("shift_jis", text(
            '"名前","1 _ 1","1 _ 2","1 _ 3"', '"厚さ(mm)",2,2,2', '"幅(mm)",6,6,6',
            '"ゲージ長(mm)",25,25,25', "",
            '"1 _ 1",,,"1 _ 2",,,"1 _ 3",,', ",".join(['"時間","試験力","ストローク"'] * 3),
            ",".join(['"sec","N","mm"'] * 3), beside([1, 2, 3], "{t},{f},{d}", ",", 3))),
        "trapezium_en.csv": ("utf-8", text(
            "Name,1_1,1_1,1_1,1_2,1_2,1_2", "Thickness (mm),2,2,2,2,2,2",
            "Width (mm),6,6,6,6,6,6", "Gauge Length (mm),25,25,25,25,25,25", "",
            "1_1,1_1,1_1,1_2,1_2,1_2", "Time,Force,Stroke,Time,Force,Stroke",
            "sec,kN,mm,sec,kN,mm", beside([1, 2], "{t},{f},{d}", ",", 3, f=1e3))),
        # Instron Bluehill: raw data of one specimen; and specimens below one another.
        "Specimen_RawData_1.csv": ("utf-8-sig", text(
            '"General : Specimen label","A1"', '"Dimension : Width","6.00","mm"',
            '"Dimension : Thickness","2.00","mm"', '"Dimension : Length","25.00","mm"', "",
            '"Results Table 1"', '"","Maximum Load (N)","Tensile strain at Break (%)"',
            '"1","4.5","80"', "", '"Time","Extension","Load","Tensile strain (Extension)"',
            '"(s)","(mm)","(N)","(%)"', lines(1, '"{t}","{d}","{f}","{e}"', e=0.01))),
        "bluehill_blocks.csv": ("utf-8", text(
            '"Results Table 1"', '"","Specimen label","Width (mm)","Thickness (mm)",'
            '"Length (mm)","Maximum Load (N)"',
            [f'"{n}","A{n}","{WIDTH_MM}","{THICKNESS_MM}","{GAUGE_MM}","4.5"' for n in (1, 2, 3)],
            '"Mean","","6","2","25","4.5"', "",
            [row for n in (1, 2, 3) for row in
             (f'"Specimen","A{n}"', '"Time","Extension","Load"', '"(s)","(mm)","(N)"',
              *lines(n, '"{t}","{d}","{f}"'), "")])),
        "bluehill_es.csv": ("cp1252", text(
            "Dimensión : Anchura;6,00;mm", "Dimensión : Espesor;2,00;mm",
            "Longitud inicial;25,0;mm", "", "Tiempo;Carga;Extensión", "(s);(N);(mm)",
            lines(1, "{t};{f};{d}", comma=True))),
        # A column of specimens, and the same with a name where it begins only.
        "stacked.csv": ("utf-8", text(
            "Specimen No,Width (mm),Thickness (mm),Gauge length (mm),Time (s),Load (N),"
            "Displacement (mm)",
            [row for n in (1, 2, 3) for row in lines(n, f"{n},6,2,25,{{t}},{{f}},{{d}}")])),
        "stacked_merged.csv": ("utf-8", text(
            "Probe;Weg [mm];Kraft [N];Breite [mm];Dicke [mm];Messlänge [mm]",
            [(f"P{n}" if at == 0 else "") + row + (";6;2;25" if n == 1 and at == 0 else ";;;")
             for n in (1, 2) for at, row in enumerate(lines(n, ";{d};{f}", comma=True))])),
        # MTS: one test in blocks, each with its heads; by tabs and by blanks.
        "mts_blocks.dat": ("utf-8", text(
            "MTS793|BTW|ENU|1|0|.|/|:|1|0|0|A", "", "Width: 6.00 mm", "Thickness: 2.00 mm",
            "Gage Length: 25.0 mm", mts_blocks("\t", "Time\tAxial Force\tAxial Displacement"))),
        "mts_blanks.dat": ("utf-8", text(
            "Width: 6.00 mm", "Thickness: 2.00 mm", "Gage Length: 25.0 mm",
            mts_blocks(" ", "Time      Axial Force Axial Displacement"))),
        "testworks.txt": ("utf-8", text(
            [row for n in (1, 2) for row in
             (f"Specimen {n}", "Width\t6.0\tmm", "Thickness\t2.0\tmm", "Gage Length\t25\tmm",
              "Crosshead\tLoad\tTime", "mm\tN\ts", *lines(n, "{d}\t{f}\t{t}"), "")])),
        # Channels in headings, brackets that hold a channel, an extensometer's strain in mm.
        "walter_bai.csv": ("cp1252", text(
            "Épaisseur éprouvette;2;mm", "Largeur éprouvette;6;mm", "L0;25;mm", "",
            "S/No;System Date;C_1_Temps[s];C_1_Force[kN];C_1_Deform1[mm];C_1_Déplacement[mm]",
            [f"{i};23.11.2026 10:00:{i % 60:02}.5;{x};{3 * i}" for i, x in
             enumerate(lines(1, "{t};{f};{d}", comma=True, f=1e3))])),
        "channels.csv": ("utf-8", text(
            "Sample: A1", "width_mm,6", "thickness_mm,2", "gauge_mm,25",
            "Index,Ch 1 Time (s),Ch 1 Force (N),Ch 2 LVDT (mm)",
            [f"{i},{x}" for i, x in enumerate(lines(1, "{t},{f},{d}"))])),
        "brackets.csv": ("utf-8", text(
            "Area,12,mm^2", "Gauge length (mm),25",
            "Time [Clock] (s),Load (5 kN cell) [N],Strain (Extensometer 1) [mm],Note",
            [f"{x}," for x in lines(1, "{t},{f},{d}")])),
        # LabVIEW, with units above the headings; brackets within brackets.
        "labview.lvm": ("utf-8", text(
            "LabVIEW Measurement\t", "Separator\tTab", "Width\t6\tmm", "Thickness\t2\tmm",
            "Gauge length\t25\tmm", "Time\t10:00:00.1", "***End_of_Header***\t", "\t",
            "Channels\t2\t\t", "Y_Unit_Label\tN\tmm\t", "X_Dimension\tTime\tTime\t",
            "Delta_X\t0.1\t0.1\t", "***End_of_Header***\t\t\t",
            "X_Value\tForce\tDisplacement\tComment",
            [f"{x}\t" for x in lines(1, "{t}\t{f}\t{d}")])),
        "wavematrix.csv": ("utf-8", text(
            '"Width (mm)",6', '"Thickness (mm)",2', '"Gauge length (mm)",25', "",
            '"Total Time (s)","Total Cycles","Step","Total Cycle Count(8800 (0,1) Waveform)",'
            '"Position(8800 (0,1):Position) (mm)","Load(8800 (0,1):Load) (kN)"',
            lines(1, "{t},0,1,0,{d},{f}", f=1e3))),
        "hounsfield_de.txt": ("cp1252", text(
            [row for n in (1, 2) for row in
             (f"Prüfung Nr. {n}", "Breite: 6,00 mm", "Dicke: 2,00 mm", "Messlänge: 25,0 mm",
              "Kraft/N\tWeg/mm", *lines(n, "{f}\t{d}", comma=True), "")])),
        "ibertest.txt": ("cp1252", text(
            "Ancho|6,0|mm", "Espesor|2,0|mm", "Longitud inicial|25,0|mm", "",
            "Tiempo (seg.)|Fuerza (daN)|Desplaz. (mm)|Extens. (mm)",
            [f"{x}|0" for x in lines(1, "{t}|{f}|{d}", comma=True, f=10.0)])),
        "startposition.TRA": ("cp1252", text(
            '"Probendicke a0";2,00;"mm"', '"Probenbreite b0";6,00;"mm"',
            '"Einspannlänge bei Startposition";25,00;"mm"',
            '"Weg ab Vorkraft";"Kraft"', '"mm";"N"', lines(1, "{d};{f}", comma=True))),
        # Spreadsheets of people: wide, by pandas, in two rows of headings.
        "wide_pandas.csv": ("utf-8", text(
            "strain,stress (MPa),strain.1,stress (MPa).1,strain.2,stress (MPa).2",
            beside([1, 2, 3], "{e},{s}", ",", 2))),
        "wide_two_rows.csv": ("utf-8", text(
            "S1,S1,S2,S2", "strain (%),stress (MPa),strain (%),stress (MPa)",
            beside([1, 2], "{e},{s}", ",", 2, e=0.01))),
        "wide_prefixes.csv": ("utf-8", text(
            "S1_strain_%,S1_stress_MPa,S2_strain_%,S2_stress_MPa",
            beside([1, 2], "{e},{s}", ",", 2, e=0.01))),
        # Others.
        "utm_zh.txt": ("gb18030", text(
            "试样宽度(mm)\t6", "试样厚度(mm)\t2", "原始标距(mm)\t25", "试验速度(mm/min)\t120", "",
            "时间(s)\t力(N)\t变形(mm)\t位移(mm)",
            [f"{x}\t{x.split(chr(9))[2]}" for x in lines(1, "{t}\t{f}\t{d}")])),
        "galdabini_it.csv": ("cp1252", text(
            "Larghezza;6,00;mm", "Spessore;2,00;mm", "Lunghezza iniziale;25;mm", "",
            "Tempo [s];Forza [daN];Spostamento traversa [mm]",
            lines(1, "{t};{f};{d}", comma=True, f=10.0))),
        "lloyd_clock.csv": ("utf-8", text(
            "Nexygen", "Width (mm),6", "Thickness (mm),2", "Gauge Length (mm),25", "",
            "Time,Load (N),Machine Extension (mm)",
            [f"00:00:{float(x.split(',')[0]):06.3f},{x.split(',', 1)[1]}" for x in
             lines(1, "{t},{f},{d}")])),
        "tinius_olsen.txt": ("utf-8", text(
            "Sample Name: A1", "Width = 6.0 mm", "Thickness = 2.0 mm", "Gauge Length = 25.0 mm",
            "", "Force (N)\tPosition (mm)\tTime (sec)", lines(1, "{f}\t{d}\t{t}"))),
        "admet.csv": ("utf-8", text(
            "Width,0.2362204724,in", "Thickness,0.07874015748,in", "Gage Length,0.9842519685,in",
            "Elapsed Time,Load,Position", "(sec),(lbs),(in)",
            lines(1, "{t},{f},{d}", f=4.4482216152605, d=25.4))),
        "mark10.txt": ("utf-8", text(
            "8/14/2017  10:46 AM", "Units: N", "Readings: Continuous", "X-Axis: Travel",
            "Travel Unit: mm", "Reading\tLoad\tTravel\tTime",
            [f"{i}\t{x}" for i, x in enumerate(lines(1, "{f}\t{d}\t{t}"), start=1)])),
        # A table of results that is headed like a record; rows of statistics behind one.
        "bluehill_results.csv": ("utf-8", text(
            '"Results Table 1"', '"","Specimen","Load (N)","Extension (mm)"',
            [f'"{n}","A{n}","{9 + n}","20.0"' for n in (1, 2, 3, 4)], '"Mean","","11.5","20.0"',
            "", [row for n in (1, 2, 3, 4) for row in
                 (f'"Specimen","A{n}"', '"Width","6.00","mm"', '"Thickness","2.00","mm"',
                  '"Length","25.00","mm"', '"Time","Extension","Load"', '"(s)","(mm)","(N)"',
                  *lines(n, '"{t}","{d}","{f}"'), "")])),
        "mecmesin_results.csv": ("utf-8", text(
            "Sample,Width [mm],Thickness [mm],Gauge length [mm],Load @ Break [N]",
            [f"{n},6,2,25,9.9" for n in (1, 2, 3)], "Mean,6,2,25,9.9", "Std Dev,0,0,0,0", "",
            [row for n in (1, 2, 3) for row in
             (f"Sample {n}", "Load [N],Displacement [mm],Time [s]",
              *lines(n, "{f},{d},{t}"), "")])),
        "statistics_behind.csv": ("utf-8", text(
            "Width (mm),6", "Thickness (mm),2", "Gauge length (mm),25",
            "No,Time (s),Load (N),Extension (mm)",
            [f"{i},{x}" for i, x in enumerate(lines(1, "{t},{f},{d}"), start=1)],
            "Max,,9.9,20", "Min,,0,0", "Mean,5,5,10", "", "Std. Dev.,1,1,1")),
        # Digits in groups of three.
        "thousands.csv": ("utf-8", text(
            "Width (mm),6", "Thickness (mm),2", "Gauge length (mm),25",
            "Time (s),Extension (mm),Stress (Pa)", in_pascal('"{t}","{d}","{s}"', ".,"))),
        "thousands_de.csv": ("cp1252", text(
            "Breite;6,00;mm", "Dicke;2,00;mm", "Messlänge;25,00;mm",
            "Zeit [s];Weg [mm];Spannung [Pa]", in_pascal("{t};{d};{s}", ",."))),
        "thousands_fr.csv": ("utf-8", text(
            "Largeur;6,00;mm", "Épaisseur;2,00;mm", "Longueur initiale;25,00;mm",
            "Temps [s];Course [mm];Contrainte [Pa]", in_pascal("{t};{d};{s}", ", "))),
        # Several readings of one size; rare units.
        "three_widths.csv": ("utf-8", text(
            "Sample,S1", "Width 1,5.9,mm", "Width 2,6.0,mm", "Width 3,6.1,mm",
            "Thickness 1,1.9,mm", "Thickness 2,2.1,mm", "Gauge Length,25,mm",
            "Time (s),Load (N),Extension (mm)", lines(1, "{t},{f},{d}"))),
        "two_widths_table.csv": ("utf-8", text(
            "Specimen,Width 1,Width 2,Thickness 1,Thickness 2,Gauge length", ",mm,mm,mm,mm,mm",
            [f"S{n},5.9,6.1,1.95,2.05,25" for n in (1, 2)], "",
            [row for n in (1, 2) for row in (f"Specimen S{n}", "Time (s),Load (N),Extension (mm)",
                                             *lines(n, "{t},{f},{d}"), "")])),
        "decinewton.csv": ("utf-8", text(
            "Strain (%),Stress (dN/mm²)", lines(1, "{e},{s}", e=0.01, s=0.1))),
        # MTS TestSuite, Mecmesin Emperor, Lloyd Nexygen, TA.XT, Testometric.
        "mts_testsuite.txt": ("utf-8", text(
            "MTS TW Elite Test Run Data", "Date:\t11/23/2026 10:00:00 AM", "",
            "Width\t6.000\tmm", "Thickness\t2.000\tmm", "Grip Separation\t60\tmm",
            "Gauge Length\t25.000\tmm", "", "Crosshead \tLoad \tTime \tExtensometer ",
            "mm\tN\ts\tmm/mm", lines(1, "{d}\t{f}\t{t}\t{e}"))),
        "mts_test_runs.csv": ("utf-8-sig", text(
            '"Test Run Name","Width (mm)","Thickness (mm)","Gauge length (mm)","Crosshead (mm)",'
            '"Load (N)","Time (s)"',
            [f'"Test Run {n}",6,2,25,{x}' for n in (1, 2) for x in lines(n, "{d},{f},{t}")])),
        "emperor.txt": ("utf-8", text(
            "Emperor (TM)", "Sample\tTest 1", "Force Units\tN", "Displacement Units\tmm",
            "Width\t6 mm", "Thickness\t2 mm", "Gauge Length\t25 mm", "",
            "Point\tForce\tDisplacement\tTime",
            [f"{i}\t{x}" for i, x in enumerate(lines(1, "{f}\t{d}\t{t}"), start=1)])),
        "nexygen.csv": ("cp1252", text(
            "NEXYGENPlus 3", "Batch Reference,B1", "Sample,1 of 2", "Width,6.00,mm",
            "Thickness,2.00,mm", "Gauge Length,25.00,mm", "Preload/Stress,0.1,N",
            "Preload/Stress Speed,20,mm/min", "Load at Maximum,9.9,N", "Extension at Maximum,20,mm",
            '"Time (s)","Load (N)","Extension from Preload (mm)","Machine Extension (mm)"',
            [f"{x},{x.split(',')[2]}" for x in lines(1, "{t},{f},{d}")])),
        "ta_xt.csv": ("utf-8", text(
            "Test ID,Batch,Width,Thickness,Length", "S1,1,6 mm,2 mm,25 mm", "",
            "Force,Distance,Time", "g,mm,sec", lines(1, "{f},{d},{t}", f=9.80665e-3))),
        "wintest.csv": ("utf-8", text(
            "Testometric winTest Analysis", "Test No,1,2", "Width mm,6,6", "Thickness mm,2,2",
            "Gauge Length mm,25,25", "Test 1,,,Test 2,,",
            ",".join(["Force N,Extension mm,Time s"] * 2), beside([1, 2], "{f},{d},{t}", ",", 3))),
        "utm_colon.txt": ("gb18030", text(
            "试样编号：A1", "宽度：6.00 mm", "厚度：2.00 mm", "标距：25.00 mm", "",
            "时间(s)  试验力(N)  位移(mm)", lines(1, "{t}  {f}  {d}"))),
        "trapezium_utf16.txt": ("utf-16", text(
            "名前\t1 _ 1\t1 _ 2", "厚さ(mm)\t2\t2", "幅(mm)\t6\t6", "ゲージ長(mm)\t25\t25", "",
            "1 _ 1\t\t\t1 _ 2\t\t", "\t".join(["時間", "試験力", "ストローク"] * 2),
            "\t".join(["sec", "N", "mm"] * 2), beside([1, 2], "{t}\t{f}\t{d}", "\t", 3))),
        # Sizes by their symbols; in a table of results with units in a row of their own, headed
        # like a record; image correlation, whose strain is that of Green and Lagrange.
        "symbols.csv": ("utf-8", text(
            "w = 6 mm", "t = 2 mm", "L0 = 25 mm", "", "Time (s),Load (N),Extension (mm)",
            lines(1, "{t},{f},{d}"))),
        "results_above.csv": ("utf-8", text(
            "Specimen,Width,Thickness,Gauge length,Load,Extension", "-,mm,mm,mm,N,mm",
            "A1,6,2,25,9.9,20", "", "Time,Load,Extension", "s,N,mm", lines(1, "{t},{f},{d}"))),
        "vic_lagrange.csv": ("utf-8", text(
            "w,t", "mm,mm", "6,2", "", "Count,Load [N],eyy [1] - Lagrange,exy [1] - Lagrange",
            [f"{i},{f:.9g},{e + 0.5 * e * e:.9g},0"
             for i, (f, e) in enumerate(zip(specimen(1)[1], specimen(1)[2] / GAUGE_MM,
                                            strict=True))])),
        # Remarks between rows of numbers.
        "events.csv": ("utf-8", text(
            "Width (mm),6", "Thickness (mm),2", "Gauge length (mm),25",
            "Time (s),Load (N),Extension (mm)", "Preload reached", lines(1, "{t},{f},{d}")[:10],
            "--- speed change ---", lines(1, "{t},{f},{d}")[10:], "Specimen broke")),
    }  # fmt: skip


def in_pascal(form: str, signs: str) -> list[str]:
    """Rows of the first specimen with stress in whole pascal, by thousands."""
    swapped = str.maketrans(".,", signs)
    return [
        form.format(t=f"{t:.4f}".translate(swapped), d=f"{d:.9f}".translate(swapped),
                    s=f"{round(1e6 * f / AREA_MM2):,}".translate(swapped))
        for t, f, d in zip(*specimen(1), strict=True)
    ]  # fmt: skip


def mts_blocks(separator: str, heads: str) -> list[str]:
    """One record in four blocks, heads above each."""
    rows = lines(1, separator.join(("{t}", "{f}", "{d}")))
    cuts = [0, 8, 16, 24, len(rows)]
    return [
        line
        for low, high in itertools.pairwise(cuts)
        for line in (
            "", f"Data Header:{separator}Time:{separator}{low}.5{separator}Sec",
            "Data Acquisition: Timed", "Station Name: a.cfg", "Test File Name: t.000",
            heads, separator.join(("s", "N", "mm")), *rows[low:high],
        )
    ]  # fmt: skip


Sheets = dict[str, list[list[Any]]]


def cells(number: int, *order: int) -> list[list[Any]]:
    """Rows of time, force and travel in an order; other places are empty."""
    columns = [*specimen(number)]
    return [[float(columns[i][at]) for i in order] for at in range(points(number))]


def workbooks() -> dict[str, Sheets]:
    """Workbooks by name: sheets of rows of cells."""
    english: Sheets = {
        "Results": [
            ["", "Specimen designation", "S0", "Gage length, standard travel", "Fmax"],
            ["", "", "mm²", "mm", "N"],
            ["Specimen 1", "A1", AREA_MM2, GAUGE_MM, 9.9],
        ],
        "Values": [
            ["Test time", "Standard force", "Standard travel", "Crosshead absolute"],
            ["s", "N", "mm", "mm"],
            *([*row, 300 + row[2]] for row in cells(1, 0, 1, 2)),
        ],
    }
    german: Sheets = {
        "Parameter": [["Prüfnorm", "ISO 37"], ["Werkstoff", "FLX9760"],
                      ["Prüfgeschwindigkeit", 120, "mm/min"]],
        "Ergebnisse": [
            ["Legende", "h", "b0", "a0", "L0", "Fmax"],
            ["", "", "mm", "mm", "mm", "N"],
            *([f"Probe {n}", "", WIDTH_MM, THICKNESS_MM, GAUGE_MM, 9.9] for n in (1, 2, 3)),
        ],
        "Statistik": [["Serie", "Fmax"], ["n = 3", "N"], ["x", 9.9], ["s", 0.1]],
        **{
            f"Probe {n}": [
                [f"Probe {n}", ""], ["Standardweg", "Standardkraft", "Prüfzeit"],
                ["mm", "N", "s"], *cells(n, 2, 1, 0),
            ]
            for n in (1, 2, 3)
        },
    }  # fmt: skip
    dion: Sheets = {
        "testData": [
            ["Test", "A1", "", "", "", "", "b0", WIDTH_MM, "mm"],
            ["", "", "", "", "", "", "a0", THICKNESS_MM, "mm"],
            ["", "", "", "", "", "", "L0", GAUGE_MM, "mm"], [], [], [],
            ["S/No", "System Date", "C_1_Temps[s]", "C_1_Force[kN]", "C_1_Déplacement[mm]"],
            *([n, "23.11.2026", t, f / 1000.0, d]
              for n, (t, f, d) in enumerate(cells(1, 0, 1, 2))),
        ],
    }  # fmt: skip
    remarks: Sheets = {
        "Tabelle1": [
            ["Weg [mm]", "Kraft [N]", "Bemerkung: Probe von Hand eingespannt", "Breite", "6 mm"],
            *(
                [d, f, "", *tail]
                for (d, f), tail in zip(
                    cells(1, 2, 1),
                    [["Dicke", "2 mm"], ["Messlänge", "25 mm"], *[["", ""]] * points(1)],
                    strict=False,
                )
            ),
        ],
        "Leer": [],
    }
    chinese: Sheets = {
        f"试样{n}": [
            ["宽度(mm)", WIDTH_MM, "厚度(mm)", THICKNESS_MM, "标距(mm)", GAUGE_MM],
            ["时间(s)", "负荷(N)", "位移(mm)"], *cells(n, 0, 1, 2),
        ]
        for n in (1, 2)
    }  # fmt: skip
    series: Sheets = {
        "Results": [
            ["", "Specimen ID", "a0", "b0", "L0", "Fmax", "εB"],
            ["", "", "mm", "mm", "mm", "N", "%"],
            *([f"Specimen {n}", f"A{n}", THICKNESS_MM, WIDTH_MM, GAUGE_MM, 9.9, 80]
              for n in (1, 2, 3)),
        ],
        "Statistics": [["Series", "a0", "b0", "L0"], ["n = 3", "mm", "mm", "mm"],
                       ["x", 2, 6, 25], ["s", 0.1, 0.1, 0.1], ["ν [%]", 1, 1, 1]],
        "Values Series": [
            ["Specimen 1", "", "", "Specimen 2", "", "", "Specimen 3", "", ""],
            ["Test time", "Strain", "Standard force"] * 3, ["s", "mm", "N"] * 3,
            *([cell for row in rows for cell in row] for rows in
              itertools.zip_longest(*(cells(n, 0, 2, 1) for n in (1, 2, 3)), fillvalue=[""] * 3)),
        ],
    }  # fmt: skip
    listed: Sheets = {
        "Sheet1": [
            ["Specimen", "Width (mm)", "Thickness (mm)", "Gauge length (mm)",
             *["", "Time (s)", "Force (N)", "Disp (mm)"] * 2],
            *([*([f"S{at + 1}", WIDTH_MM, THICKNESS_MM, GAUGE_MM] if at < 2 else [""] * 4),
               *(cell for row in rows for cell in ("", *row))]
              for at, rows in enumerate(itertools.zip_longest(
                  cells(1, 0, 1, 2), cells(2, 0, 1, 2), fillvalue=[""] * 3))),
        ],
    }  # fmt: skip
    merged: Sheets = {
        "Parameters": [["Test standard", "ISO 37"], ["Pre-load", 0.1, "N"],
                       ["Notes", "Gauge length 25 mm as marked by hand; discard specimen 9"]],
        "Results": [
            ["Legend", "Specimen ID", "Width", "Thickness", "Gage length", "Fmax", "Note"],
            ["", "", "b0", "a0", "L0", "", ""], ["", "", "mm", "mm", "mm", "N", ""],
            *([f"Specimen {n}", f"A{n}", WIDTH_MM, THICKNESS_MM, GAUGE_MM, 9.9, "slipped?"]
              for n in (1, 2, 3)),
        ],
        "Statistics": [["Series", "Width", "Thickness"], ["n = 3", "mm", "mm"], ["x̄", 6, 2],
                       ["s", 0.01, 0.01], ["ν [%]", 0.2, 0.5]],
        "Values Series": [
            ["Specimen 1", "", "", "Specimen 2", "", "", "Specimen 3", "", ""],
            ["Strain", "Standard force", "Standard travel"] * 3, ["%", "N", "mm"] * 3,
            *([cell for row in rows for cell in row] for rows in itertools.zip_longest(
                *([[4.0 * d, f, d] for d, f in cells(n, 2, 1)] for n in (1, 2, 3)),
                fillvalue=[""] * 3)),
        ],
    }  # fmt: skip
    japanese: Sheets = {
        f"試験片{n}": [
            ["厚さ", THICKNESS_MM, "㎜"], ["幅", WIDTH_MM, "㎜"], ["標点間距離", GAUGE_MM, "㎜"],
            ["変位（㎜）", "荷重（Ｎ）", "時間（秒）"], *cells(n, 2, 1, 0),
        ]
        for n in (1, 2)
    }  # fmt: skip
    chinese_beside: Sheets = {
        "数据": [
            ["试样1", "", "", "试样2", "", ""], ["时间", "力值", "变形"] * 2, ["s", "N", "mm"] * 2,
            *([cell for row in rows for cell in row] for rows in itertools.zip_longest(
                cells(1, 0, 1, 2), cells(2, 0, 1, 2), fillvalue=[""] * 3)),
        ],
        "结果": [["试样编号", "宽度(mm)", "厚度(mm)", "标距(mm)", "最大力(N)"],
                 *([f"试样{n}", WIDTH_MM, THICKNESS_MM, GAUGE_MM, 9.9] for n in (1, 2)),
                 ["平均值", 6, 2, 25, 9.9]],
    }  # fmt: skip
    return {
        "testxpert_merged.xlsx": merged, "utm_ja.xlsx": japanese,
        "utm_zh_beside.xlsx": chinese_beside,
        "testxpert_series.xlsx": series, "listed_beside.xlsx": listed,
        "testxpert_en.xlsx": english, "testxpert_de.xlsx": german, "dion7.xlsx": dion,
        "remarks.xlsx": remarks, "utm_zh.xlsx": chinese,
        "testxpert_en.xls": english, "testxpert_de.ods": german,
    }  # fmt: skip


def _xlsx(sheets: Sheets) -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append([None if cell == "" else cell for cell in row])
    data = io.BytesIO()
    book.save(data)
    return data.getvalue()


def _xls(sheets: Sheets) -> bytes:
    import xlwt

    book = xlwt.Workbook()
    for name, rows in sheets.items():
        sheet = book.add_sheet(name)
        for r, row in enumerate(rows):
            for c, cell in enumerate(row):
                sheet.write(r, c, cell)
    data = io.BytesIO()
    book.save(data)
    return data.getvalue()


def ods(sheets: Sheets) -> bytes:
    """Return a workbook of OpenDocument with these sheets."""
    of = "urn:oasis:names:tc:opendocument:xmlns:"
    spaces = "".join(f' xmlns:{k}="{of}{k}:1.0"' for k in ("office", "table", "text"))
    tables = "".join(
        f'<table:table table:name="{name}">'
        + "".join(
            f"<table:table-row>{''.join(map(_ods_cell, row))}</table:table-row>" for row in rows
        )
        + "</table:table>"
        for name, rows in sheets.items()
    )
    inside = f"<office:body><office:spreadsheet>{tables}</office:spreadsheet></office:body>"
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("META-INF/manifest.xml", "<manifest/>")
        archive.writestr(
            "content.xml", f"<office:document-content{spaces}>{inside}</office:document-content>"
        )
    return data.getvalue()


def _ods_cell(cell: Any) -> str:
    if isinstance(cell, str):
        value = f'"string"><text:p>{cell}</text:p></table:table-cell>'
    else:
        value = f'"float" office:value="{cell}"/>'
    return f"<table:table-cell office:value-type={value}"


WRITERS: dict[str, Callable[[Sheets], bytes]] = {".xlsx": _xlsx, ".xls": _xls, ".ods": ods}


def main() -> None:
    """Write all files."""
    FOLDER.mkdir(exist_ok=True)
    for name, (encoding, content) in texts().items():
        (FOLDER / name).write_bytes(content.encode(encoding))
    for name, sheets in workbooks().items():
        (FOLDER / name).write_bytes(WRITERS[Path(name).suffix](sheets))


if __name__ == "__main__":
    main()
