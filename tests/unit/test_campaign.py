"""A campaign's folder: what is read of it, and every folder that is refused."""

import json
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from planner.errors import FileError, OutputError, PlannerError, UnknownNameError
from planner.gap.campaign import Campaign, replicate_groups
from planner.gap.campaign_folder import read_campaign, write_campaign
from planner.gap.observations import ObservationModel
from planner.materials.study import read_study
from planner.palette import load_palette
from planner.plan import Plan

HEAD = (
    "specimen,material,profile,width_mm,thickness_mm,gauge_mm,rate_mm_s,temperature_C,soak_h,"
    "age_days,orientation,protocol,batch,operator,tray_x_mm\n"
)
ROWS = (
    "S1,FLX9760,,6,2,25,1,23,0,9,x,monotonic,A,Ann,10\n"
    "S2,flx 9760,,6,2,25,1,23,0,9.2,x,monotonic,A,Ben,\n"
    "G1,,profiles/bar.csv,6,2,40,1,,,,x,,,Ann,30\n"
)
TOML = 'schema = 1\nname = "demo"\nprinter = "connex3"\npalette = "connex3-tango-vero"\n'
PROFILE = "x_mm,coordinate\n0,0.2\n20,0.2\n20,0.8\n40,1.0\n"


def curve(points: int = 20, *, rate: float = 1.0, modulus: float = 0.3) -> list[str]:
    return [f"{i / 4},{rate * i / 4},{modulus * i}" for i in range(points)]


def curves(*specimens: str, points: int = 20) -> str:
    lines = [f"{s},{row}" for s in specimens for row in curve(points)]
    return "specimen,time_s,displacement_mm,force_N\n" + "\n".join(lines) + "\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "profiles").mkdir()
    (tmp_path / "campaign.toml").write_text(TOML)
    (tmp_path / "specimens.csv").write_text(HEAD + ROWS)
    (tmp_path / "curves.csv").write_text(curves("S1", "S2", "G1"))
    (tmp_path / "profiles" / "bar.csv").write_text(PROFILE)
    return tmp_path


def test_a_campaign_is_read(folder: Path) -> None:
    campaign = read_campaign(folder)
    assert (campaign.name, campaign.printer) == ("demo", "connex3")
    assert campaign.palette.name == "connex3-tango-vero"
    assert [s.id for s in campaign.specimens] == ["S1", "S2", "G1"]
    s1, s2, g1 = campaign.specimens
    assert (s2.material, s2.age_days, s2.area_mm2) == ("FLX9760", 9.2, 12.0)
    assert s1.strain[4] == 0.04
    assert g1.profile is not None
    assert g1.profile.at(np.array([10.0, 30.0])).tolist() == [0.2, 0.9]


def test_an_empty_cell_is_unknown_and_said_so(folder: Path) -> None:
    campaign = read_campaign(folder)
    g1 = campaign.specimen("G1")
    assert g1.temperature_C is None
    assert g1.protocol is None
    said = " ".join(campaign.limitations)
    assert "temperature_C is unknown for specimen G1" in said
    assert "rate_mm_s" not in said


def test_further_columns_are_covariates(folder: Path) -> None:
    campaign = read_campaign(folder)
    assert campaign.covariates == ("operator", "tray_x_mm")
    assert dict(campaign.specimens[0].covariates) == {"operator": "Ann", "tray_x_mm": 10.0}
    assert dict(campaign.specimens[1].covariates) == {"operator": "Ben", "tray_x_mm": None}


def test_replicates_are_alike_but_for_small_differences(folder: Path) -> None:
    groups = read_campaign(folder).replicates()
    assert [[s.id for s in group] for group in groups] == [["S1", "S2"], ["G1"]]


def test_the_order_of_further_columns_tells_no_replicates_apart(folder: Path) -> None:
    """Each of two columns leaves all with a replicate, both together leave hardly any."""
    one, *_ = read_campaign(folder).specimens
    own = [("A" if k < 6 else "B", "xyz"[k % 3], k % 2) for k in range(12)]
    columns = [{"lab": lab, "person": person, "day": float(day)} for lab, person, day in own]
    groups = set()
    for names in permutations(columns[0]):
        cells = ({name: of[name] for name in names} for of in columns)
        specimens = [replace(one, id=f"S{k}", covariates=c) for k, c in enumerate(cells)]
        groups.add(replicate_groups(specimens))
    assert len(groups) == 1


def test_a_palette_goes_before_the_files(folder: Path) -> None:
    from planner.printers import load_printer

    (folder / "campaign.toml").write_text(TOML.replace("connex3-tango-vero", "absent"))
    with pytest.raises(UnknownNameError, match="no palette 'absent'"):
        read_campaign(folder)
    palette = load_printer("connex3").palette()
    assert read_campaign(folder, palette).palette is palette


def test_raw_exports_are_read_by_file(folder: Path) -> None:
    (folder / "specimens.csv").write_text(
        "specimen,material,file,gauge_mm\nS1,FLX9760,bluehill.csv,25\nS2,FLX9760,mark10.txt,25\n"
    )
    (folder / "curves.csv").unlink()
    rows = "\n".join(f'"{i / 4}","{i / 10}","{i / 1000}"' for i in range(20))
    (folder / "bluehill.csv").write_text(
        '"Width","6.00","mm"\n"Thickness","2.00","mm"\n"Rate","60","mm/min"\n\n'
        f'"Time","Extension","Load"\n"(s)","(mm)","(kN)"\n{rows}\n'
    )
    rows = "\n".join(f"{i}\t{i / 10}\t{i / 100}\t{i / 4}" for i in range(20))
    (folder / "mark10.txt").write_text(
        "MESURgauge\nUnits: lbf\nTravel Unit: in\nReading\tLoad\tTravel\tTime\n" + rows + "\n"
    )
    with pytest.raises(FileError, match=r"specimens.csv, specimen S2: the section is unknown"):
        read_campaign(folder)
    (folder / "specimens.csv").write_text(
        "specimen,material,file,gauge_mm,width_mm,thickness_mm\n"
        "S1,FLX9760,bluehill.csv,25,,\nS2,FLX9760,mark10.txt,25,6,2\n"
    )
    (folder / "curves.csv").write_text(curves())  # headings alone, as a design leaves them
    s1, s2 = read_campaign(folder).specimens
    assert (s1.width_mm, s1.rate_mm_s, s1.force_N[10]) == (6.0, 1.0, 10.0)
    # Ten pounds in N, ten hundredths of an inch in mm, by the definitions of both.
    assert s2.force_N[10] == pytest.approx(4.4482216152605, rel=1e-12)
    assert s2.displacement_mm[10] == pytest.approx(2.54, rel=1e-12)


def test_strain_fields_keep_the_places_seen_throughout(folder: Path) -> None:
    lines = [
        f"G1,{t},{x},{0.01 * t * x}" for t in (0, 1, 2) for x in (5, 10, 20) if (t, x) != (1, 5)
    ]
    (folder / "fields.csv").write_text("specimen,time_s,x_mm,strain\n" + "\n".join(lines) + "\n")
    campaign = read_campaign(folder)
    field = campaign.specimen("G1").strain_field
    assert field is not None
    assert field.x_mm.tolist() == [10, 20]
    assert field.strain.tolist() == [[0, 0], [0.1, 0.2], [0.2, 0.4]]
    assert any("G1: places along the axis" in text for text in campaign.limitations)


@pytest.mark.parametrize("start_s", [-5.0, 7.0])
def test_a_clock_that_starts_elsewhere_is_that_of_curve_and_camera(
    folder: Path, start_s: float
) -> None:
    """Both count on one clock, wherever it starts: what the camera saw stays where it was."""
    for start in (0.0, start_s):
        rows = [line.split(",", 1) for line in curve()]
        told = [f"G1,{float(time) + start},{rest}" for time, rest in rows]
        (folder / "curves.csv").write_text(curves("S1", "S2") + "\n".join(told) + "\n")
        told = [f"G1,{t + start},{x},{0.01 * t * x}" for t in (1, 2, 3) for x in (5, 10, 20)]
        (folder / "fields.csv").write_text("specimen,time_s,x_mm,strain\n" + "\n".join(told))
        bar = read_campaign(folder).specimen("G1")
        assert bar.strain_field is not None
        travel = np.interp(bar.strain_field.time_s, bar.time_s, bar.displacement_mm)
        assert travel.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("places", "message"),
    [
        ((-3, 10, 20, 30), r"fields\.csv, line 2: x_mm is -3; the gauge goes from 0 to 40 mm"),
        ((10, 20, 30, 43), r"fields\.csv, line 5: x_mm is 43"),
        # Facets of 0.5 mm: 2 % of the gauge is more.
        ((39, 39.5, 40, 40.5, 41), r"line 6: x_mm is 41"),
    ],
)
def test_places_beyond_the_gauge_are_refused(
    folder: Path, places: tuple[float, ...], message: str
) -> None:
    rows = [f"G1,{t},{x},0.01" for t in (0, 1) for x in places]
    path = folder / "fields.csv"
    path.write_text("specimen,time_s,x_mm,strain\n" + "\n".join(rows) + "\n")
    with pytest.raises(FileError, match=message):
        read_campaign(folder)


def test_places_beyond_the_gauge_by_less_than_a_facet_stay(folder: Path) -> None:
    places = (-0.8, 10, 20, 30, 41.9)
    rows = [f"G1,{t},{x},0.01" for t in (0, 1) for x in places]
    path = folder / "fields.csv"
    path.write_text("specimen,time_s,x_mm,strain\n" + "\n".join(rows) + "\n")
    field = read_campaign(folder).specimen("G1").strain_field
    assert field is not None
    assert field.x_mm.tolist() == list(places)


def test_a_campaign_built_in_memory_has_its_limitations(folder: Path) -> None:
    read = read_campaign(folder)
    built = Campaign("built", "connex3", read.palette, read.specimens[:1])
    assert built.remarks == ()
    assert [text for text in built.limitations if "one specimen only" in text]
    # Of what is left, not of what was there before.
    fewer = replace(read, specimens=read.specimens[:2])
    assert "temperature_C is unknown" in " ".join(read.limitations)
    assert "temperature_C is unknown" not in " ".join(fewer.limitations)


def test_two_profiles_of_one_name_are_refused(folder: Path) -> None:
    """They would count as replicates."""
    (folder / "others").mkdir()
    (folder / "others" / "bar.csv").write_text(PROFILE)
    (row,) = (line for line in ROWS.splitlines() if line.startswith("G1,"))
    other = row.replace("G1,", "G2,").replace("profiles/", "others/")
    (folder / "specimens.csv").write_text(HEAD + ROWS + other + "\n")
    curves = folder / "curves.csv"
    more = [
        line.replace("G1,", "G2,")
        for line in curves.read_text().splitlines()
        if line.startswith("G1,")
    ]
    curves.write_text(curves.read_text() + "\n".join(more) + "\n")
    with pytest.raises(FileError, match=r"specimen G2: another profile is called 'bar' too"):
        read_campaign(folder)


def test_a_plan_is_a_profile(folder: Path, dogbone_plan: Plan) -> None:
    plan = dogbone_plan
    (folder / "bar-graded").mkdir()
    (folder / "bar-graded" / "plan.json").write_bytes(plan.json())
    (folder / "specimens.csv").write_text(HEAD + ROWS.replace("profiles/bar.csv", "bar-graded"))
    campaign = read_campaign(folder)
    design = campaign.specimen("G1").profile
    assert design is not None
    assert design.length_mm == 40.0
    span = plan.part.bounds_mm[1][0] - plan.part.bounds_mm[0][0]
    # The middle of the gauge is the middle of the part; a region's coordinate is constant.
    middle = next(r for r in plan.regions if r.field[0] <= 0.5 < r.field[1])
    assert design.at(np.array([20.0]))[0] == middle.coordinate
    edges = {round(e * span - (span - 40.0) / 2, 6) for r in plan.regions for e in r.field}
    steps = design.x_mm[1:][np.diff(design.x_mm) == 0.0]
    assert {round(x, 6) for x in steps} == {e for e in edges if 0.0 < e < 40.0}
    assert any("taken to be its middle" in text for text in campaign.limitations)


def test_writing_and_reading_again_changes_nothing(folder: Path, tmp_path: Path) -> None:
    (folder / "fields.csv").write_text(
        "specimen,time_s,x_mm,strain\n"
        + "".join(f"G1,{t},{x},0.1\n" for t in (0, 1) for x in (3, 9))
    )
    first = read_campaign(folder)
    write_campaign(first, tmp_path / "one")
    again = read_campaign(tmp_path / "one")
    write_campaign(again, tmp_path / "two")
    names = sorted(p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*.*"))
    assert len(names) == 6
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert again.limitations == first.limitations
    assert [dict(s.covariates) for s in again.specimens] == [
        dict(s.covariates) for s in first.specimens
    ]
    for a, b in zip(first.specimens, again.specimens, strict=True):
        # Nine significant digits in the file.
        assert a.force_N == pytest.approx(b.force_N, rel=1e-9)
        assert (a.material, a.batch, a.soak_h) == (b.material, b.batch, b.soak_h)
    assert load_palette(tmp_path / "one" / "palette.toml").materials == first.palette.materials
    with pytest.raises(OutputError):
        write_campaign(first, tmp_path / "one")


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("campaign.toml", "schema = 1", "schema = 1\ncolour = 2", "`colour`"),
        ("campaign.toml", "schema = 1", "schema = 2", r"campaign\.toml.*schema"),
        ("campaign.toml", "schema = 1", "schema = ", "not a TOML file"),
        ("campaign.toml", 'palette = "connex3-tango-vero"', "", "no palette; write"),
        ("campaign.toml", '"connex3-tango-vero"', '"p.toml"', "p.toml: cannot be read"),
        ("specimens.csv", "S1,FLX9760,", "S1,FLX97,", "specimen S1: material 'FLX97' is ambig"),
        ("specimens.csv", "S1,FLX9760,", "S1,PLA,", "specimen S1: no material 'PLA'"),
        ("specimens.csv", "S1,FLX9760,,", "S1,FLX9760,profiles/bar.csv,", "line 2: give exactly"),
        ("specimens.csv", "material,", "substance,", "material"),
        ("specimens.csv", "width_mm", "width_in", "column 'width_in': its unit"),
        ("specimens.csv", "operator", "position", "column 'position' would be .*'tray position'"),
        ("specimens.csv", "temperature_C", "Temperature (K)", "give the values as temperature_C"),
        ("specimens.csv", "S1,FLX9760,,6,2,25,1", "S1,FLX9760,,6,2,,1", "give gauge_mm"),
        ("specimens.csv", "S1,FLX9760,,6", "S1,FLX9760,,", "section is unknown.*give width_mm"),
        ("specimens.csv", "2,40,1", "2,60,1", "40 mm long, shorter than the gauge of 60 mm"),
        ("specimens.csv", "2,40,1", "2,30,1", "x_mm runs from 0 to 40, the gauge from 0 to 30"),
        ("specimens.csv", "profiles/bar", "profiles/rod", "specimen G1: .*cannot be read"),
        ("curves.csv", "force_N", "force_stone", "unknown unit 'stone' of force"),
        ("curves.csv", "force_N", "torque_Nm", "no heading of a load"),
        ("curves.csv", "displacement_mm", "depth_mm", "no heading of a length"),
        ("curves.csv", "specimen,", "item,", "no column 'specimen'"),
        ("curves.csv", "S2,0.5,0.5,0.6", "S2,0.5,0.5,nan", "line 24, column 'force_N': 'nan'"),
        ("curves.csv", "S2,0.5,0.5,0.6", "S2,0.5,0.5,", "line 24, column 'force_N': ''"),
        ("curves.csv", "S2,0.5,", "S2,0.1,", r"line 24: time falls from 0\.25 s to 0\.1 s; sort"),
        ("profiles/bar.csv", "20,0.8", "19,0.8", "line 4: x_mm falls from 20 to 19"),
        ("profiles/bar.csv", "20,0.8", "20,1.8", "coordinate is 1.8 at 20 mm"),
        ("profiles/bar.csv", "20,0.8", "20,", "line 4, column 'coordinate': '' is no"),
        ("profiles/bar.csv", "x_mm", "x_furlong", "unknown unit 'furlong' of length"),
        ("profiles/bar.csv", "x_mm", "x", "no unit; head it 'x_mm'"),
        ("profiles/bar.csv", "coordinate", "blend", "unknown column 'blend'"),
    ],
)  # fmt: skip
def test_bad_folders_are_refused(folder: Path, name: str, old: str, new: str, message: str) -> None:
    path = folder / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(PlannerError, match=message):
        read_campaign(folder)


@pytest.mark.parametrize("missing", ["campaign.toml", "specimens.csv", "curves.csv"])
def test_missing_files_are_named(folder: Path, missing: str) -> None:
    (folder / missing).unlink()
    with pytest.raises(FileError, match=missing.replace(".", r"\.")):
        read_campaign(folder)
    with pytest.raises(FileError, match="no such folder"):
        read_campaign(folder / "absent")


def test_an_empty_curve_is_refused(folder: Path) -> None:
    (folder / "curves.csv").write_text(curves("S1", "G1") + "S2,0,0,0\nS2,1,1,1\n")
    with pytest.raises(FileError, match=r"specimen S2 \(curves.csv\): the record has \d points"):
        read_campaign(folder)
    (folder / "curves.csv").write_text(curves())
    with pytest.raises(FileError, match=r"nothing in curves\.csv; write the curves there"):
        read_campaign(folder)


def test_rows_in_reversed_order_of_time_are_read_from_the_last(folder: Path) -> None:
    """In a fit, too: it took them for a pull that begins at -40 %."""
    (folder / "specimens.csv").write_text("\n".join((HEAD + ROWS).splitlines()[:2]) + "\n")
    head, *rows = curves("S1").splitlines()
    found = []
    for lines in (rows, rows[::-1]):
        (folder / "curves.csv").write_text("\n".join([head, *lines]) + "\n")
        (specimen,) = read_campaign(folder).specimens
        study = read_study(folder)
        ((curve,),) = study.groups.values()
        found.append((specimen.time_s, specimen.force_N, curve.strain, curve.stress_MPa))
    for forwards, backwards in zip(*found, strict=True):
        np.testing.assert_array_equal(forwards, backwards)
    assert any("reversed order of time" in note for note in study.notes)


def test_specimens_and_curves_without_each_other_are_left_out(folder: Path) -> None:
    (folder / "curves.csv").write_text(curves("S1", "S22", "X"))
    campaign = read_campaign(folder)
    assert [s.id for s in campaign.specimens] == ["S1"]
    said = " ".join(campaign.limitations)
    assert "specimens S2, G1: no curve; left out" in said
    assert (
        "specimen S22: a curve in curves.csv but no row in specimens.csv; did you mean S2" in said
    )
    assert "specimen X: a curve" in said
    assert "one specimen only" in said
    (folder / "curves.csv").write_text(curves("X"))
    with pytest.raises(FileError, match="none of the 3 specimens has a curve"):
        read_campaign(folder)


def test_force_of_the_wrong_sign_is_turned_and_said(folder: Path) -> None:
    text = (folder / "curves.csv").read_text().splitlines()
    turned = [
        ",".join((*line.split(",")[:3], f"-{line.split(',')[3]}")) if line[:2] == "S2" else line
        for line in text
    ]
    (folder / "curves.csv").write_text("\n".join(turned) + "\n")
    campaign = read_campaign(folder)
    assert campaign.specimen("S2").force_N[10] == 3.0
    assert "specimen S2: force is negative in tension; its sign was turned" in campaign.limitations


@pytest.mark.parametrize("column", ["displacement_mm", "strain"])
@pytest.mark.parametrize(
    ("start_mm", "way", "said"),
    [
        (100.0, 1.0, "its first value"),  # a crosshead's place, unloaded
        (100.0, 1.0, "no load, by a line through its first 6 rows"),
        (20.0, -1.0, "no load, by a line through its first 6 rows"),
        (-10.0, 1.0, "no load, by a line through its first 6 rows"),
        (8.0, 1.0, "no load, by a line through its first 6 rows"),
    ],
)
def test_a_record_counts_from_no_load_as_it_does_in_a_fit(
    folder: Path, column: str, start_mm: float, way: float, said: str
) -> None:
    travel = np.linspace(0.0, 10.0, 41)
    force = 5.0 * (1.0 - np.exp(-travel / 5.0))
    rows = slice(0 if said == "its first value" else 10, None)  # from 45 % of the largest load on
    place = start_mm + way * (travel - travel[rows][0])
    place = place / 25.0 if column == "strain" else place
    lines = zip(travel[rows], place[rows], force[rows], strict=True)
    text = "".join(f"S1,{t:.9g},{x:.9g},{f:.9g}\n" for t, x, f in lines)
    heading = "strain (mm/mm)" if column == "strain" else column
    (folder / "curves.csv").write_text(f"specimen,time_s,{heading},force_N\n{text}")
    campaign = read_campaign(folder)
    (specimen,) = campaign.specimens
    (curve,) = read_study(folder).groups["FLX9760"]
    np.testing.assert_allclose(specimen.strain, curve.strain, atol=1e-8)
    np.testing.assert_allclose(specimen.load_N / 12.0, curve.stress_MPa, rtol=1e-7, atol=1e-9)
    assert not specimen.pushed
    # The line meets zero 1.2 mm from where the curve does.
    assert specimen.displacement_mm[0] == pytest.approx(travel[rows][0], abs=1.3)
    assert f"specimen S1: travel counts from {said}, not from 0 as recorded" in campaign.limitations


def test_slack_that_was_taken_off_the_travel_stays_off(folder: Path) -> None:
    """0 stands where the pull begins; before it nothing but noise of the load cell is borne."""
    travel = np.linspace(-1.5, 8.5, 41)
    taut = np.maximum(travel, 0.0)
    force = 5.0 * (1.0 - np.exp(-taut / 5.0)) + 0.02 * np.sin(40.0 * travel)
    rows = "".join(f"S1,{x:.9g},{x:.9g},{f:.9g}\n" for x, f in zip(travel, force, strict=True))
    (folder / "curves.csv").write_text(f"specimen,time_s,displacement_mm,force_N\n{rows}")
    campaign = read_campaign(folder)
    np.testing.assert_allclose(campaign.specimens[0].displacement_mm, travel, atol=1e-8)
    assert "counts from" not in " ".join(campaign.limitations)


def test_an_offset_is_taken_off_a_curve_that_rises_slowly(folder: Path) -> None:
    """It bears hardly anything up to 0, but more with every row: no slack was taken off."""
    travel = np.linspace(0.0, 40.0, 81)
    force = 0.0005 * travel**3
    rows = "".join(
        f"S1,{x:.9g},{x - 2.0:.9g},{f:.9g}\n" for x, f in zip(travel, force, strict=True)
    )
    (folder / "curves.csv").write_text(f"specimen,time_s,displacement_mm,force_N\n{rows}")
    (specimen,) = read_campaign(folder).specimens
    np.testing.assert_allclose(specimen.displacement_mm, travel, atol=1e-8)


def test_a_travel_that_was_zeroed_at_a_preload_counts_from_no_load(folder: Path) -> None:
    """As campaign.toml says: a load cell that shows as much at rest looks the same."""
    travel = np.linspace(0.0, 10.0, 101)[3:]  # from a twentieth of the largest load on
    force = 5.0 * (1.0 - np.exp(-travel / 5.0))
    rows = "".join(
        f"S1,{x:.9g},{x - travel[0]:.9g},{f:.9g}\n" for x, f in zip(travel, force, strict=True)
    )
    (folder / "curves.csv").write_text(f"specimen,time_s,displacement_mm,force_N\n{rows}")
    (as_recorded,) = read_campaign(folder).specimens
    assert as_recorded.displacement_mm[0] == 0.0
    with (folder / "campaign.toml").open("a") as file:
        file.write("\nzeroed_at_preload = true\n")
    (specimen,) = read_campaign(folder).specimens
    # A line up to twice the preload misses the curve's bend.
    np.testing.assert_allclose(specimen.displacement_mm, travel, atol=0.05)


def test_a_preload_is_found_through_noise(folder: Path) -> None:
    """Of a twentieth of the largest load, in a thousand rows with noise of half a per cent."""
    travel = np.linspace(0.0, 10.0, 1031)[31:]
    noise = 0.02 * np.random.default_rng(4).standard_normal(len(travel))
    force = 5.0 * (1.0 - np.exp(-travel / 5.0)) + noise
    rows = zip(travel, travel - travel[0], force, strict=True)
    text = "".join(f"S1,{t:.9g},{x:.9g},{f:.9g}\n" for t, x, f in rows)
    (folder / "curves.csv").write_text(f"specimen,time_s,displacement_mm,force_N\n{text}")
    with (folder / "campaign.toml").open("a") as file:
        file.write("\nzeroed_at_preload = true\n")
    (specimen,) = read_campaign(folder).specimens
    # The bend of the curve, as without noise, and the noise of 32 rows.
    np.testing.assert_allclose(specimen.displacement_mm, travel, atol=0.08)


def test_a_push_from_a_preload_on_is_one_as_it_is_in_a_fit(folder: Path) -> None:
    travel = np.linspace(0.0, -10.0, 41)[10:]
    force = 5.0 * (np.exp(travel / 5.0) - 1.0)  # from 45 % of the largest on
    rows = "".join(f"S1,{-x:.9g},{x:.9g},{f:.9g}\n" for x, f in zip(travel, force, strict=True))
    (folder / "curves.csv").write_text(f"specimen,time_s,displacement_mm,force_N\n{rows}")
    head, row, *_ = (HEAD + ROWS).splitlines()
    (folder / "specimens.csv").write_text(f"{head},mode\n{row},compression\n")
    (specimen,) = read_campaign(folder).specimens
    (curve,) = read_study(folder).other_modes["FLX9760"]
    assert specimen.pushed
    np.testing.assert_allclose(specimen.displacement_mm / 25.0, curve.strain, atol=1e-8)
    np.testing.assert_allclose(specimen.force_N / 12.0, curve.stress_MPa, rtol=1e-7)
    np.testing.assert_allclose(specimen.force_N, force, rtol=1e-7)


@pytest.mark.parametrize("column", ["mode", "Mode", ""])
def test_a_planar_test_is_no_pull(folder: Path, column: str) -> None:
    head, row, *_ = (HEAD + ROWS).splitlines()
    listed = f"{head},{column}\n{row},planar\n"
    if not column:
        assert "monotonic" in row
        listed = f"{head}\n{row.replace('monotonic', 'planar')}\n"
    (folder / "specimens.csv").write_text(listed)
    with pytest.raises(FileError, match=r"mode is 'planar'; .* leave this specimen out"):
        read_campaign(folder)


def test_a_crosshead_that_stands_somewhere_never_moves(folder: Path) -> None:
    rows = "".join(f"S1,{k},3.0,{0.1 * k}\n" for k in range(20))
    (folder / "curves.csv").write_text(f"specimen,time_s,displacement_mm,force_N\n{rows}")
    (folder / "specimens.csv").write_text("\n".join((HEAD + ROWS).splitlines()[:2]) + "\n")
    with pytest.raises(FileError, match=r"S1 .*the crosshead never moves"):
        read_campaign(folder)


def test_an_area_in_a_files_head_is_no_width(folder: Path) -> None:
    (folder / "specimens.csv").write_text(
        "specimen,material,file,gauge_mm\nS1,FLX9760,one.csv,25\n"
    )
    (folder / "curves.csv").unlink()
    rows = "\n".join(curve())
    (folder / "one.csv").write_text(f"Area (mm2),12\n\ntime_s,displacement_mm,force_N\n{rows}\n")
    with pytest.raises(FileError, match=r"S1: the section is unknown.*; give width_mm"):
        read_campaign(folder)


def test_a_diameter_in_a_files_head_is_a_section(folder: Path) -> None:
    """A disc between plates: the machine's own head tells all that there is of its section."""
    (folder / "specimens.csv").write_text("specimen,material,file\nS1,FLX9760,disc.csv\n")
    (folder / "curves.csv").unlink()
    rows = "\n".join(f'"{k / 50}","{0.2 * k}","{k / 2}"' for k in range(20))
    (folder / "disc.csv").write_text(
        'Specimen properties : Anvil height,"8.0000",mm\n'
        'Specimen properties : Diameter,"20.0000",mm\n\n'
        f"Compressive extension,Compressive load,Time\n(mm),(N),(s)\n{rows}\n"
    )
    campaign = read_campaign(folder)
    (disc,) = campaign.specimens
    assert (disc.gauge_mm, disc.force_N[-1]) == (8.0, pytest.approx(-3.8))
    assert (disc.width_mm or 0.0) * (disc.thickness_mm or 0.0) == pytest.approx(100.0 * np.pi)
    assert any("a diameter of 20 mm, taken as a square" in note for note in campaign.limitations)


def test_a_diameter_in_the_list_is_a_section(folder: Path) -> None:
    (folder / "specimens.csv").write_text(
        "specimen,material,gauge_mm,diameter_mm\nS1,FLX9760,25,20\n"
    )
    (disc,) = read_campaign(folder).specimens
    assert (disc.width_mm or 0.0) * (disc.thickness_mm or 0.0) == pytest.approx(100.0 * np.pi)


def test_time_may_be_counted_from_the_rate(folder: Path) -> None:
    text = (folder / "curves.csv").read_text()
    lines = [",".join((c := line.split(","))[:1] + c[2:]) for line in text.splitlines()]
    (folder / "curves.csv").write_text("\n".join(lines) + "\n")
    campaign = read_campaign(folder)
    assert not campaign.specimens[0].time_recorded
    assert campaign.specimens[0].time_s[4] == 1.0
    assert any("time was not recorded" in text for text in campaign.limitations)
    (folder / "specimens.csv").write_text(HEAD + ROWS.replace("2,25,1,", "2,25,,"))
    with pytest.raises(FileError, match="no column of time and no rate_mm_s"):
        read_campaign(folder)
    # All points of a hold would come at once.
    (folder / "specimens.csv").write_text(HEAD + ROWS.replace("monotonic", "relaxation"))
    with pytest.raises(FileError, match="no column of time in a relaxation test; export"):
        read_campaign(folder)


def test_points_of_one_time_are_averaged(folder: Path) -> None:
    text = (folder / "curves.csv").read_text().replace("S1,0.5,0.5,0.6", "S1,0.25,0.75,0.9")
    (folder / "curves.csv").write_text(text)
    s1 = read_campaign(folder).specimen("S1")
    assert s1.time_s[:3].tolist() == [0, 0.25, 0.75]
    assert s1.displacement_mm[1] == 0.5
    # The mean of 0.3 and 0.9, to rounding.
    assert s1.force_N[1] == pytest.approx(0.6, rel=1e-12)


def test_strain_past_the_law_is_a_limitation(folder: Path) -> None:
    (folder / "specimens.csv").write_text(HEAD + ROWS.replace("6,2,25", "6,2,2.5"))
    said = ObservationModel(read_campaign(folder)).limitations
    assert "specimens S1, S2: compared up to 1.3 times the elongation at break" in " ".join(said)


def test_one_specimen_a_condition_is_a_limitation(folder: Path) -> None:
    (folder / "specimens.csv").write_text(HEAD + ROWS.replace("S2,flx 9760", "S2,FLX9750"))
    assert any("one specimen a condition" in text for text in read_campaign(folder).limitations)


def test_a_slip_in_a_heading_is_pointed_out(folder: Path) -> None:
    (folder / "specimens.csv").write_text((HEAD + ROWS).replace("temperature_C", "temprature_C"))
    campaign = read_campaign(folder)
    assert "temprature_C" in campaign.covariates
    assert any("rename it if it means temperature_C" in text for text in campaign.limitations)


def test_a_plan_off_its_axis_is_refused(folder: Path) -> None:
    (folder / "bar.json").write_text(json.dumps({"schema": 1}))
    (folder / "specimens.csv").write_text(HEAD + ROWS.replace("profiles/bar.csv", "bar.json"))
    with pytest.raises(FileError, match=r"specimen G1: .*bar\.json"):
        read_campaign(folder)
