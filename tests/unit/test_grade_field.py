"""Grading along a field, as a user writes it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import PlannerError

SAMPLES = Path(__file__).parents[2] / "samples"
FINGER = SAMPLES / "finger.stl"
ENDS = {"from_": "Tango", "to": "FLX9795", "pitch_mm": 0.8}


def grade(field, **options):
    return planner.grade(FINGER, **{**ENDS, **options}, field=field)


@pytest.mark.parametrize(
    "field",
    [
        "radial: line=0 6 6 1 0 0",
        "distance: surface",
        "distance: hole=0 6 6, to=30",
        "distance: plane=0 0 0 0 0 1, from=1, to=9",
        "harmonic: from=x<4, to=ball 38 6 6 6",
        "geodesic: start=box -1 -1 -1 3 20 20",
        "expression: 0.5 + 0.5*sin(2*pi*x/40)",
        "expression: d / 5",
        "max(axis: x; radial: point=0 6 6, to=12)",
        "blend(axis: x; axis: z; 0.5)",
        "clamp(radial: point=0 0 0; 0.2; 0.8)",
    ],
)
def test_plans_hold(field, tmp_path):
    plan = grade(field, pitch_mm=1, bands=2, tolerance=10)  # two bands are far off any gradient
    failed = {name for name, check in plan.checks.items() if not check.ok}
    # a level may graze the finger's chambers and leave thin layers there
    assert not failed - {"places_too_thin", "thinnest_band_mm"}
    folder = plan.write(tmp_path / "out")
    certificate = planner.check(folder)
    assert all(check.ok for check in certificate.checks.values())
    assert not certificate.problems
    described = json.loads((folder / "plan.json").read_text())["gradient"]["field"]
    assert described["name"] in field or "plane" in field
    assert planner.read_plan(folder).gradient.field == described


def test_profile_and_bands_compose_as_with_an_axis():
    plan = grade(
        "radial: line=0 6 6 1 0 0, from=0.2726", profile="linear", bands=4, snap_mm=0, tolerance=1
    )
    assert [r.field for r in plan.regions] == [(i / 4, (i + 1) / 4) for i in range(4)]
    assert plan.gradient.field["pitch_mm"] == 0.8
    assert not plan.warnings
    assert {"places_too_thin", "thinnest_band_mm", "gaps_too_narrow"} <= set(plan.checks)


def test_a_curved_field_that_is_an_axis_gives_the_axis_volumes():
    straight = planner.grade(FINGER, from_="Tango", to="FLX9795", axis="x")
    low = straight.part.bounds_mm[0][0]
    span = straight.part.bounds_mm[1][0] - low
    curved = grade(lambda points: (points[:, 0] - low) / span)
    found, expected = (np.array([r.volume_mm3 for r in p.regions]) for p in (curved, straight))
    # Linear fields are drawn exactly; values are moved off levels by a thousandth of a pitch.
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.002 * 0.8 * 16**2 * 2)
    named = grade("axis: x")
    assert [r.volume_mm3 for r in named.regions] == [r.volume_mm3 for r in straight.regions]


def test_positions_are_those_of_the_file():
    moved = grade("radial: point=0 0 0, from=0, to=40", pitch_mm=2, bands=2, tolerance=10)
    centre = np.array(moved.gradient.field["centre_mm"])
    np.testing.assert_allclose(centre, moved.part.translation_mm)


def test_same_input_same_bytes():
    first, second = (grade("distance: surface", bands=3, pitch_mm=1.5) for _ in range(2))
    assert first.json() == second.json()
    assert [s.stl for s in first.shells] == [s.stl for s in second.shells]


@pytest.fixture
def table(tmp_path):
    """Write a value along x at places of a grid between two corners."""

    def written(low, high, value=lambda x: x / 80.0):
        corners = np.linspace(low, high, 6).T
        at = np.stack(np.meshgrid(*corners, indexing="ij"), -1).reshape(-1, 3)
        rows = [f"{x},{y},{z},{value(x)}" for x, y, z in at.tolist()]
        (tmp_path / "t.csv").write_text("\n".join(["x_mm,y_mm,z_mm,v", *rows]))
        return tmp_path / "t.csv"

    return written


@pytest.mark.parametrize("kind", ["table", "points"])
def test_a_table_of_half_the_part_is_told_and_one_of_nothing_of_it_refused(kind, table):
    coarse = {"pitch_mm": 2.0, "bands": 2, "tolerance": 10}
    low, high = np.array([-20.0, -20.0, -20.0]), np.array([120.0, 40.0, 40.0])
    assert not any("outside" in w for w in grade(f"{kind}: {table(low, high)}", **coarse).warnings)
    plan = grade(f"{kind}: {table(low, [40.0, 40.0, 40.0])}", **coarse)
    (told,) = (w for w in plan.warnings if "of the part lies outside t.csv" in w)
    assert 20 < float(told.split(" %")[0].split()[-1]) < 80
    with pytest.raises(PlannerError, match=r"where nothing of the part is.*origin and its unit"):
        grade(f"{kind}: {table(low + 1000.0, high + 1000.0)}", **coarse)


def test_a_table_of_one_value_is_no_gradient_by_rounding(table):
    path = table([-20.0, -20.0, -20.0], [120.0, 40.0, 40.0], lambda x: 0.3)
    with pytest.raises(PlannerError, match=r"from 0.3 to 0.3 is none"):
        grade(f"table: {path}")


def test_a_table_that_says_where_it_lies_is_not_told_so(table):
    path = table([-20.0, -20.0, -20.0], [120.0, 40.0, 40.0])
    with pytest.raises(PlannerError, match="leave out origin= and step="):
        grade(f"table: {path}, origin=5 5 5, step=9 9 9")


def test_cells_that_miss_the_field_are_refused():
    with pytest.raises(PlannerError, match=r"`pitch_mm` 1000: cells so large miss"):
        grade("radial:", pitch_mm=1000)


@pytest.mark.parametrize(
    ("field", "step"),
    [("distance: plane=0 0 0 1 0 0, from=0, to=400", 2e-6), ("expression: x / 400", 0.006)],
)
def test_a_part_that_holds_a_stretch_of_the_field_has_the_targets_of_that(field, step):
    """What the field does beyond the part is no error of the part; a step of the grid is."""
    plan = grade(field, pitch_mm=1.0)
    low, high = np.array(plan.part.bounds_mm)[:, 0] / 400.0
    assert len(plan.regions) > 1
    ends = plan.gradient.profile["moduli_MPa"]
    assert low - step <= plan.regions[0].field[0] <= low
    assert high <= plan.regions[-1].field[1] <= high + step
    for region in plan.regions:
        target = np.exp(np.interp(region.field, (0.0, 1.0), np.log(ends)))
        np.testing.assert_allclose(region.target_modulus_MPa, target, rtol=1e-6)
        error = [region.modulus_MPa / end - 1.0 for end in reversed(region.target_modulus_MPa)]
        np.testing.assert_allclose(region.error, error)


def test_dithered_stretches_of_one_material_are_those_of_the_profile(tmp_path):
    """What is cut then are cells: their own field, 0 to 1 over the materials, is not the part's."""
    steps = tmp_path / "steps.csv"
    rows = "0,FLX9750 0.35,FLX9750 0.35,FLX9770 0.9,FLX9770 0.9,FLX9795 1,FLX9795"
    steps.write_text("position,material\n" + rows.replace(" ", "\n") + "\n")
    plan = planner.grade(
        FINGER, profile=str(steps), field="expression: 0.3 + x / 1000", pitch_mm=1.0,
        blend="dither", cell_mm=2.0,
    )  # fmt: skip
    assert [r.field for r in plan.regions] == [(0.0, 0.35), (0.35, 0.9)]


def test_what_does_nothing_is_told():
    away = grade("radial: point=500 500 500, to=12")
    assert any("all of the part is TangoPlus: it lies within 0 to" in w for w in away.warnings)
    along = planner.grade(FINGER, from_="Tango", to="Vero", pitch_mm=0.7)
    assert any("cells of 0.7 mm do nothing" in w for w in along.warnings)
    assert not any("all of the part" in w for w in along.warnings)


@pytest.mark.slow
def test_a_field_that_bends_within_a_pitch_is_a_finding():
    plan = grade("expression: 0.5 + 0.5*sin(3*x)*sin(3*y)", bands=2, pitch_mm=1.5)
    assert not plan.checks["interface_error_um"].ok
    assert any("finer --pitch" in finding.message for finding in plan.findings)


def test_tables_and_points(tmp_path):
    places = np.stack(np.meshgrid(*[np.linspace(-1, 90, 6)] * 3, indexing="ij"), -1).reshape(-1, 3)
    rows = "\n".join(f"{x},{y},{z},{x}" for x, y, z in places.tolist())
    (tmp_path / "a.csv").write_text("x_mm,y_mm,z_mm,v\n" + rows)
    for kind in ("table", "points"):
        plan = grade(f"{kind}: {tmp_path / 'a.csv'}, array=v, from=0, to=80")
        assert plan.checks["shells_unsound"].ok
        assert (plan.gradient.field["file"], plan.gradient.field["array"]) == ("a.csv", "v")


@pytest.mark.parametrize(
    ("field", "reason"),
    [
        ("radal: to=3", "did you mean radial"),
        ("mim(axis: x; axis: y)", "did you mean min"),
        ("radial: centre=0 0 0", "it takes point, line, from, to"),
        ("radial: form=0", "did you mean from="),
        ("radial: from=0, from=1", "given twice"),
        ("radial: point=0 0", "must be 3 numbers"),
        ("radial: point=0 0 nan", "must be 3 numbers"),
        ("radial: point=0 0 0, line=0 0 0 1 0 0", "not both"),
        ("radial: line=0 0 0 0 0 0", "length zero"),
        ("radial: 3", "one too many"),
        ("radial: from=3, to=3", "must be finite and differ"),
        ("distance: nothing.stl", "no such file"),
        ("distance: box=100 100 100 101 101 101", "no face"),
        ("distance: hole=500 0 0", "lies beside the part"),
        ("harmonic: from=x<4", "give both end regions"),
        ("harmonic: from=x<4, to=somewhere", "is no region"),
        ("harmonic: from=x<-4, to=x>70", "from= holds nothing"),
        ("harmonic: from=ball 0 0 0 -1, to=x>70", "radius"),
        ("geodesic:", "start=x<3"),
        ("expression: x +", "cannot be read"),
        ("expression: log(x-20)", "must be finite over the part"),
        ("table:", "give a file"),
        ("points: a.csv", "cannot be read"),
        ("min(axis: x)", r"min takes \(field; field; ...\)"),
        ("blend(axis: x; axis: y; 2)", "not 0 to 1"),
        ("blend(axis: x; axis: y; half)", "must be a number"),
        ("clamp(axis: x; 1; 0)", "not below"),
        ("axis: w", "not a direction"),
        ("", "there is no field"),
        ("min: radial: | axis: x", r"write min\(field; field"),
        ("min(" * 30 + "axis", "there is no field|nested"),
        (7, "give text, a planner Field, or a function"),
        (lambda points: points, "one number for each"),
    ],
)  # fmt: skip
def test_fields_that_cannot_be(field, reason):
    with pytest.raises(PlannerError, match=reason):
        grade(field)


@pytest.mark.parametrize("formula", ["sqrt(x)/9", "(sqrt(x) + sqrt(8-y) + sqrt(20-z)) / 20"])
def test_a_formula_is_asked_where_the_part_is(formula):
    """Beyond the part, where the grid of level sets ends, a root has no value."""
    plan = grade(f"expression: {formula}", bands=2, tolerance=10)
    assert len(plan.regions) == 2
    assert plan.checks["interface_error_um"].ok


def test_a_formula_without_a_value_is_told_in_the_part_s_own_places():
    with pytest.raises(PlannerError, match=r"it is nan at \(.*\) mm; it must be") as told:
        grade("expression: sqrt(x-20)")
    (x,) = re.findall(r"nan at \(([-\d.e]+),", str(told.value))
    assert 0.0 <= float(x) < 20.0


@pytest.mark.slow
def test_the_command(tmp_path, capsys):
    out = tmp_path / "out"
    command = ["grade", str(FINGER), "--from", "Tango", "--to", "FLX9795", "-o", str(out)]
    field = ["--field", "radial: line=0 6 6 1 0 0, from=0.2726", "--pitch", "0.8"]
    assert run([*command, *field, "--bands", "24"]) == 1
    told = capsys.readouterr()
    assert "place mm" in told.out
    # bands of 0.4 mm: place, size, limit and what to change
    assert "a layer of" in told.err
    assert "below the smallest feature of 0.42 mm" in told.err
    assert "take --bands 23 or fewer" in told.err
    assert run(["check", str(out)]) == 1
    assert "the files are sound, with the findings above" in capsys.readouterr().out
    for more, reason in (
        (["--field", "radal:"], "did you mean radial"),
        (["--field", "axis: x", "--axis", "x"], "not both"),
        (["--field", "radial:", "--pitch", "0"], "above 0"),
        (["--field", "radial:", "--pitch", "0.0001"], "or more fits"),
    ):
        capsys.readouterr()
        assert run([*command, "--force", *more]) == 2
        assert reason in capsys.readouterr().err
