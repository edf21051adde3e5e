"""planner.simulate: sources, findings, protocols, files and bad input."""

import dataclasses
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import planner
from benchmarks.interfaces import BOX, FACES
from planner.cli import run
from planner.errors import ArgumentError, FileError, UnknownNameError
from planner.materials.laws import make_law
from planner.palette import LawParameters, Palette
from planner.printers import load_printer
from planner.report.simulation_figures import simulation_figure
from planner.simulation.bar import Bar

PALETTE = load_printer("connex3").palette()


def box(x: float, y: float, z: float) -> tuple[np.ndarray, np.ndarray]:
    return BOX * [x, y, z], FACES


@pytest.fixture(scope="module")
def plan() -> planner.Plan:
    return planner.grade(box(60.0, 6.0, 4.0), from_="Tango", to="FLX9795", axis="x", name="box")


@pytest.fixture(scope="module")
def folder(plan: planner.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return plan.write(tmp_path_factory.mktemp("plans") / "box-graded")


def profile(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "bar.csv"
    path.write_text(text)
    return path


# --- sources


def test_a_plans_sections_are_its_shells(plan: planner.Plan) -> None:
    """A box has the same exact section everywhere, and slices divide where materials meet."""
    bar = planner.simulate(plan, to_strain=0.1, slices=50).bar
    np.testing.assert_allclose(bar.area_mm2, 24.0, rtol=1e-6)  # float32 of the STL files
    assert bar.gauge_mm == pytest.approx(60.0, rel=1e-6)
    for region in plan.regions:
        inside = bar.coordinate == region.coordinate
        volume = float(bar.length_mm[inside] @ bar.area_mm2[inside])
        assert volume == pytest.approx(region.volume_mm3, rel=1e-5)


def test_plan_folder_file_and_object_are_one(plan: planner.Plan, folder: Path) -> None:
    held, whole, file = (
        planner.simulate(one, steps=5) for one in (plan, folder, folder / "plan.json")
    )
    assert whole.json() == file.json()
    # plan.json rounds places to nine digits.
    np.testing.assert_allclose(held.force_N, file.force_N, rtol=1e-7)


def test_a_plan_is_the_profile_of_its_regions(plan: planner.Plan, tmp_path: Path) -> None:
    rows = [
        f"{60.0 * at:.9g},{region.coordinate:.9g},6,4"
        for region in plan.regions
        for at in region.field
    ]
    text = "x_mm,coordinate,width_mm,thickness_mm\n" + "\n".join(rows) + "\n"
    by_profile = planner.simulate(profile(tmp_path, text), to_strain=0.2)
    by_plan = planner.simulate(plan, to_strain=0.2)
    np.testing.assert_allclose(by_profile.force_N, by_plan.force_N, rtol=1e-6)  # float32 again


def test_a_slanted_axis_finds_the_section_across_it() -> None:
    """A box graded along its long diagonal in x and y: the middle's section is known."""
    made = planner.grade(
        box(60.0, 6.0, 4.0), from_="Tango", to="FLX9795", axis=(1.0, 0.05, 0.0), name="slant"
    )
    bar = planner.simulate(made, to_strain=0.01, slices=100).bar
    middle = (bar.x_mm > 5.0) & (bar.x_mm < 55.0)
    exact = 24.0 * np.hypot(1.0, 0.05)
    # A voxel is 1/512 of the widest side; at a slant whole rows of them come and go.
    np.testing.assert_allclose(bar.area_mm2[middle], exact, rtol=2.0 / 512.0)


def test_a_tensile_specimen_has_its_narrow_section(samples: Path) -> None:
    """ASTM D638 type IV scaled by 29.4/33: 5.345 x 3.564 mm."""
    made = planner.grade(samples / "dogbone-thesis.stl", from_="Tango", to="FLX9750", bands=3)
    scale = 29.4 / 33.0
    whole = planner.simulate(made, to_strain=0.1, steps=4)
    assert float(whole.bar.area_mm2.min()) == pytest.approx(24.0 * scale**2, rel=0.005)
    volume = float(whole.bar.area_mm2 @ whole.bar.length_mm)
    assert volume == pytest.approx(made.part.volume_mm3, rel=1e-3)
    narrow = planner.simulate(made, to_strain=0.1, steps=4, between_mm=(36.6, 65.8))
    assert narrow.bar.gauge_mm == pytest.approx(29.2)
    assert np.ptp(narrow.bar.area_mm2) < 0.005 * narrow.bar.area_mm2.mean()


def test_a_material_is_one_slice_of_d638_type_iv() -> None:
    result = planner.simulate("tango", to_strain=0.5, steps=10)
    assert (result.name, len(result.bar.x_mm), result.bar.gauge_mm) == ("TangoPlus", 1, 33.0)
    assert result.bar.area_mm2[0] == 24.0
    assert result.ok


def test_profiles_jump_and_take_their_own_section(tmp_path: Path) -> None:
    text = "x_mm,coordinate,width_mm\n5,0,6\n15,0,6\n15,1,6\n25,1,12\n"
    bar = planner.simulate(profile(tmp_path, text), slices=20, thickness_mm=2.0).bar
    assert len(bar.x_mm) == 20
    assert (bar.edges_mm[0], bar.edges_mm[-1]) == (5.0, 25.0)
    assert bar.coordinate.tolist() == [0.0] * 10 + [1.0] * 10
    np.testing.assert_allclose(bar.area_mm2[:10], 12.0)
    np.testing.assert_allclose(bar.area_mm2[10:], 2.0 * (6.0 + 6.0 * np.arange(0.05, 1.0, 0.1)))


def test_another_palette_is_used_and_said(plan: planner.Plan) -> None:
    softer = dataclasses.replace(
        PALETTE,
        materials=tuple(
            dataclasses.replace(
                m, law=LawParameters(m.law.model, {k: _halved(k, v) for k, v in _items(m)})
            )
            for m in PALETTE.materials
        ),
    )
    own, other = (planner.simulate(plan, palette=p, steps=4) for p in (None, softer))
    np.testing.assert_allclose(other.force_N, 0.5 * own.force_N, rtol=1e-9)
    assert any("not the one" in note for note in other.notes)
    assert own.notes == ()


def _items(material: planner.Material) -> list[tuple[str, tuple[float, ...]]]:
    return list(material.law.parameters.items())


def _halved(name: str, values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(0.5 * v for v in values) if name.endswith("_MPa") else values


# --- findings


def test_a_break_is_found_with_its_place_and_strain() -> None:
    """FLX9760 (break 0.70) beside FLX9795; the bar's strain then is known from the laws."""
    bar = Bar(np.array([0.0, 10.0, 20.0]), np.array([0.5, 1.0]), np.array([20.0, 20.0]))
    result = planner.simulate(bar, to_strain=0.45, steps=200)
    (found,) = result.findings
    assert found.kind == "break"
    assert found.x_mm == (0.0, 10.0)
    assert "FLX9760 at 5 mm" in found.message
    first = int(np.argmax(result.beyond_break))
    assert result.strain[first - 1, 0] <= 0.7 < result.strain[first, 0]
    assert result.gauge_strain[first - 1] <= found.gauge_strain <= result.gauge_strain[first]
    assert not result.ok


def test_a_rigid_grade_breaks_and_is_said_to_yield() -> None:
    """Of RGD8425 nothing carries a yield, and a note says so; of VeroWhitePlus its law has one."""
    for name in ("RGD8425", "Vero"):
        result = planner.simulate(name, to_strain=0.2)
        assert [f.kind for f in result.findings] == ["break"]
        assert result.findings[0].gauge_strain == pytest.approx(0.17)
        said = any("Young's modulus alone" in note for note in result.notes)
        assert said == (name == "RGD8425")
    assert planner.simulate("RGD8425", to_strain=0.015).notes == ()


def test_out_of_reach_past_twice_the_break() -> None:
    result = planner.simulate("FLX9750", to_strain=2.0, steps=200)
    assert [f.kind for f in result.findings] == ["break", "unreachable"]
    assert result.gauge_strain[-1] == pytest.approx(1.5)
    # A step is halved 14 times before it is given up.
    assert result.findings[1].gauge_strain == pytest.approx(1.5, abs=1e-4)
    coarse = planner.simulate("FLX9750", to_strain=2.0, steps=1).findings
    assert [f.kind for f in coarse] == ["unreachable"]
    assert coarse[0].gauge_strain == pytest.approx(1.5, abs=1e-3)
    assert np.isfinite(result.force_N).all()


def test_out_of_reach_where_a_law_ceases_to_rise() -> None:
    """Yeoh with c2 < 0, c3 = 0: dP/dl = 0 at a strain that a root finder gives."""
    law = LawParameters("yeoh", {"c_MPa": (0.5, -0.05, 0.0)})
    palette = Palette(
        "falling",
        (dataclasses.replace(PALETTE.materials[0], law=law, elongation_at_break=0.9),),
    )
    peak = brentq(lambda s: float(make_law(law).tangent_MPa(1.0 + s)), 0.1, 1.7)
    result = planner.simulate("Tango", palette=palette, to_strain=1.7, steps=1000)
    assert result.findings[-1].kind == "unreachable"
    assert "ceases to rise" in result.findings[-1].message
    # To a load step of 0.0017 and an interval of the table, 0.0009.
    assert 0.0 < peak - float(result.strain.max()) < 0.003


# --- protocols


def test_protocols_and_the_clock() -> None:
    up = planner.simulate("Tango", to_strain=0.2, rate_mm_s=2.0, steps=10)
    assert up.time_s[-1] == pytest.approx(0.2 * 33.0 / 2.0)
    assert any("elastic" in note for note in up.notes)
    default = planner.simulate("Tango", to_strain=0.2, steps=10)
    assert default.rate_mm_s == pytest.approx(0.034 * 33.0)
    held = planner.simulate("Tango", to_strain=0.2, protocol="relaxation", hold_s=60.0, steps=10)
    assert held.time_s[-1] - held.time_s[10] == pytest.approx(60.0)
    np.testing.assert_allclose(held.force_N[10:], held.force_N[10], rtol=1e-12)
    cyclic = planner.simulate("Tango", to_strain=0.2, protocol="cyclic", cycles=3, steps=10)
    assert len(cyclic.time_s) == 61
    np.testing.assert_array_equal(cyclic.force_N[20::20], 0.0)
    assert (np.diff(cyclic.time_s) > 0.0).all()


def test_a_palette_without_a_rate_is_said() -> None:
    bare = dataclasses.replace(PALETTE, reference=type(PALETTE.reference)())
    result = planner.simulate("Tango", palette=bare, steps=3)
    assert result.rate_mm_s == pytest.approx(0.33)
    assert "names no strain rate" in result.notes[0]


def test_equal_input_gives_equal_bytes(plan: planner.Plan) -> None:
    a, b = (planner.simulate(plan, to_strain=0.4) for _ in range(2))
    assert (a.json(), a.csv(), a.field_csv()) == (b.json(), b.csv(), b.field_csv())
    assert simulation_figure(a) == simulation_figure(b)


SVG = "{http://www.w3.org/2000/svg}"


def names_and_lines(figure: bytes) -> tuple[dict, list]:
    """Return boxes of the grades' names, wide rather than narrow, and the lines down to them."""
    root = ET.fromstring(figure)
    names = {m.id for m in PALETTE.materials}
    boxes: dict[str, list] = {}
    for each in root.iter(f"{SVG}text"):
        if each.text in names:
            wide = 6.4 * len(each.text)  # 0.64 em a letter: the digits of DejaVu Sans
            before = {"middle": 0.5, "end": 1.0}[each.get("text-anchor")] * wide
            left, foot = float(each.get("x")) - before, float(each.get("y"))
            boxes.setdefault(each.text, []).append((left, left + wide, foot - 8.0, foot + 2.0))
    lines = [
        [float(value) for value in re.findall(r"[\d.]+", each.get("d"))]
        for each in root.iter(f"{SVG}path")
        if each.get("stroke-width") == "0.8"
    ]
    assert all(right < float(root.get("width")) for b in boxes.values() for _, right, *_ in b)
    assert all(foot < float(root.get("height")) for b in boxes.values() for *_, foot in b)
    return boxes, lines


@pytest.mark.parametrize("blend", ["nearest", "bands:4"])
@pytest.mark.parametrize(("start", "stop"), [("Tango", "Vero"), ("Vero", "Tango")])
def test_every_grade_is_named_under_the_bar(start: str, stop: str, blend: str) -> None:
    plan = planner.grade(
        box(97.0, 6.0, 4.0), from_=start, to=stop, axis="x", name="box", blend=blend
    )
    boxes, lines = names_and_lines(simulation_figure(planner.simulate(plan, to_strain=0.1)))
    assert set(boxes) == {m.id for m in PALETTE.materials}
    flat = [each for several in boxes.values() for each in several]
    if blend == "nearest":
        assert len(flat) == 10
    for number, (left, right, top, foot) in enumerate(flat):
        for other in flat[:number]:
            apart = left >= other[1] or right <= other[0] or top >= other[3] or foot <= other[2]
            assert apart, (flat[number], other)
        for x, above, _, below in lines:
            assert x <= left or x >= right or below <= top or above >= foot


# --- bad input


def test_sources_that_are_none(samples: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"did you mean Tango.*nor is Tangoo a file"):
        planner.simulate("Tangoo")
    for name, reason in (("no.json", "no such file"), ("no.csv", "cannot be read")):
        with pytest.raises(FileError, match=reason):
            planner.simulate(tmp_path / name)
    with pytest.raises(FileError, match=r"no plan\.json"):
        planner.simulate(tmp_path)
    with pytest.raises(FileError, match="planner grade"):
        planner.simulate(samples / "finger.stl")


def test_plans_that_cannot_be_pulled(plan: planner.Plan, folder: Path, tmp_path: Path) -> None:
    radial = dataclasses.replace(
        plan, gradient=dataclasses.replace(plan.gradient, field={"name": "radial"})
    )
    with pytest.raises(ArgumentError, match=r"'radial'.*along an axis"):
        planner.simulate(radial)
    stray = tmp_path / "plan.json"
    stray.write_bytes((folder / "plan.json").read_bytes())
    with pytest.raises(FileError, match=r"beside plan\.json"):
        planner.simulate(stray)
    first = tmp_path / plan.regions[0].file
    first.parent.mkdir()
    first.write_bytes((folder / plan.regions[0].file).read_bytes() + b"\0")
    with pytest.raises(FileError, match="not what the plan was written with"):
        planner.simulate(stray)
    elsewhere = dataclasses.replace(
        plan, palette=dataclasses.replace(plan.palette, name="lab-palette")
    )
    with pytest.raises(UnknownNameError, match="give its file with `palette`"):
        planner.simulate(elsewhere)


def test_a_part_in_two_bodies_carries_no_force() -> None:
    vertices, faces = box(10.0, 6.0, 4.0)
    both = (
        np.concatenate([vertices, vertices + np.array([30.0, 0.0, 0.0])]),
        np.concatenate([faces, faces + 8]),
    )
    made = planner.grade(both, from_="Tango", to="FLX9750", axis="x", name="two")
    with pytest.raises(ArgumentError, match=r"no cross-section at 10(\.\d+)? mm.*`between_mm`"):
        planner.simulate(made)
    assert planner.simulate(made, between_mm=(0.0, 9.0), to_strain=0.1).ok


# --- the command


@pytest.fixture
def _scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("_scratch")
def test_the_command_writes_curve_field_and_figure(folder: Path, capsys) -> None:
    files = ["-o", "curve.csv", "--field", "field.csv", "--figure", "curve.svg"]
    arguments = ["simulate", str(folder), "--to-strain", "0.2", "--steps", "20", *files]
    assert run(arguments) == 0
    assert "wrote curve.csv" in capsys.readouterr().out
    curve = np.genfromtxt("curve.csv", delimiter=",", names=True)
    assert len(curve) == 21
    assert curve["displacement_mm"][-1] == pytest.approx(12.0)
    assert ((curve["force_low_N"] <= curve["force_N"]) & (curve["beyond_break"] == 0)).all()
    field = np.genfromtxt("field.csv", delimiter=",", names=True)
    assert len(field) == 21 * len(np.unique(field["x_mm"]))
    figure = ET.parse("curve.svg").getroot()
    words = " ".join(t.text or "" for t in figure.iter("{http://www.w3.org/2000/svg}text"))
    assert "force, N" in words
    assert "FLX9760" in words
    assert run(arguments) == 2
    assert "--force" in capsys.readouterr().err
    assert run([*arguments, "--force", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.usefixtures("_scratch")
def test_json_is_one_document(capsys) -> None:
    assert run(["simulate", "FLX9750", "--to-strain", "1.0", "--json", "-o", "all.json"]) == 1
    printed = capsys.readouterr()
    assert printed.err == ""
    document = json.loads(printed.out)
    assert document == json.loads(Path("all.json").read_text())
    assert document["findings"][0]["kind"] == "break"
    assert document["steps"]["beyond_break"][-1] is True
    assert len(document["strain"]) == len(document["steps"]["force_N"]) == 101


@pytest.mark.usefixtures("_scratch")
@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["Tango", "-o", "curve.txt"], ".csv or .json"),
        (["Tango", "-o", "a.csv", "--field", "a.csv"], "each its own"),
        (["Tango", "-o", "missing/a.csv"], "there is no folder"),
        (["Tango", "--between", "3"], "START:STOP"),
        (["Tango", "--to-strain", "0"], "--to-strain"),
        (["nothing"], "no material 'nothing'"),
    ],
)
def test_bad_input_is_one_line_and_code_2(arguments: list[str], reason: str, capsys) -> None:
    assert run(["simulate", *arguments]) == 2
    printed = capsys.readouterr()
    assert reason in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert list(Path().iterdir()) == []
