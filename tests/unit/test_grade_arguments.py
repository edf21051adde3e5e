"""grade() takes numbers as scripts have them, and names what it cannot take."""

import copy
import pickle
from pathlib import Path

import manifold3d as m3
import numpy as np
import pytest

import planner
from planner.errors import ArgumentError, OutputError, PlannerError, UnknownNameError

BAR = m3.Manifold.cube([40.0, 8.0, 6.0]).to_mesh()
MESH = (np.asarray(BAR.vert_properties[:, :3]), np.asarray(BAR.tri_verts))
ENDS = {"from_": "Tango", "to": "FLX9795"}
TESTS = Path(__file__).parents[2] / "samples" / "tensile"
LAB = TESTS.with_name("warm-lab")


class _Mesh:
    vertices, faces = MESH


def test_every_kind_of_part_gives_the_same_shells(tmp_path: Path) -> None:
    plans = [planner.grade(part, **ENDS) for part in (MESH, _Mesh())]
    assert [s.stl for s in plans[0].shells] == [s.stl for s in plans[1].shells]


def test_numpy_scalars_are_numbers() -> None:
    given = planner.grade(MESH, **ENDS, bands=np.int64(3), at_strain=np.float64(0.1))
    assert given.json() == planner.grade(MESH, **ENDS, bands=3, at_strain=0.1).json()


def test_materials_profiles_and_palettes_may_be_values() -> None:
    palette = planner.load_printer("connex3").palette()
    soft, hard = palette.materials[0], palette.materials[6]
    by_value = planner.grade(
        MESH, from_=soft, to=hard, palette=palette, printer=planner.load_printer("connex3")
    )
    assert by_value.json() == planner.grade(MESH, **ENDS).json()
    profile = planner.Profile("mine", (0, 1), (0.5, 5), "linear")
    assert planner.grade(MESH, profile=profile).regions[0].target_modulus_MPa[0] == 0.5


@pytest.mark.parametrize(
    "arguments",
    [
        {"bands": 2.5},
        {"bands": True},
        {"bands": "3"},
        {"bands": 0},
        {"at_strain": "0.1"},
        {"at_strain": float("nan")},
        {"profile": 3},
        {"printer": object()},
        {"palette": object()},
        {"field": lambda points: points},
        {"from_": -7},
        {"from_": []},
        {"like": 7},
        {"axis": "up"},
        {"axis": (1, 0)},
        {"axis": 0},
        {"unit": "furlong"},
        {"unit": 25.4},
        {"bodies": 3},
        {"from_": "0.5mPa"},
        {"blend": "mixed"},
    ],
)
def test_what_cannot_be_taken_is_named(arguments: dict) -> None:
    with pytest.raises((ArgumentError, UnknownNameError)):
        planner.grade(MESH, **{**ENDS, **arguments})


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: planner.check(3), "plan 3: give a plan.json, its folder or a planner.Plan"),
        (lambda: planner.read_plan(None), "plan None: give a plan.json"),
        (lambda: planner.load_palette(3), "3: cannot be read .*; give the path of a palette file"),
        (lambda: planner.simulate_bar("Tango", steps="3"), "`steps` '3': it must be a whole"),
        (lambda: planner.simulate_bar("Tango", slices=2.5), "`slices` 2.5: it must be a whole"),
        (lambda: planner.simulate_part(MESH, ["fix"]), "'fix' is no LoadCase"),
        (lambda: planner.LoadCase(fix=3), "`fix` 3: it must be text, or several"),
        (lambda: planner.LoadCase(load=["x=min: 0,0,1 N", 3]), r"`load` \[.*3\]: it must be text"),
        (lambda: planner.design(MESH, **ENDS, target=3), "`target` 3: it must be text"),
        (lambda: planner.design(MESH, **ENDS, limit=3), "`limit` 3: it must be text"),
        (lambda: planner.design(MESH, **ENDS, target="x=min uz=1 mm", level=95), "between 0 and 1"),
        (lambda: planner.design(MESH, **ENDS, target="x=min uz=1 mm", steps=-1), "`steps` -1: it"),
        (lambda: planner.simulate_bar("Tango", level=95), "`level` 95: it must be between 0 and 1"),
        (
            lambda: planner.simulate_bar("Tango", width_mm="6"),
            "`width_mm` '6': it must be a finite",
        ),
        (lambda: planner.invert(coordinate="x"), "`coordinate` 'x': it must be a finite number"),
        (lambda: planner.invert(1.0, law=3), "law 3: no such law; choose one of"),
        (lambda: planner.list_materials().palette.resolve(3), "no material 3 in palette"),
        (lambda: planner.fit(3), "`files` 3: give paths of files or folders"),
        (lambda: planner.fit(TESTS, law="yeoh", level="95"), "`level` '95': it must be a finite"),
        (lambda: planner.fit(TESTS, law="yeoh", density=1.1), "1.1: give figures by material, as"),
        (lambda: planner.fit(TESTS, law="yeoh", order=3), "`order` 3: it must be text, or several"),
        (lambda: planner.fit(TESTS, law="yeoh", leave_out=3), "`leave_out` 3: it must be text"),
        (lambda: planner.fit(TESTS, law="yeoh", unit_of=3), "`unit_of` 3: it must be text"),
        (lambda: planner.fit(TESTS, law="yeoh", columns=3), "`columns` 3: it must be text"),
        (lambda: planner.fit(TESTS, law="yeoh", mode=3), "mode is 3; it must be one of"),
        (lambda: planner.simulate_part(MESH, None), "`cases`: there is none"),
        (lambda: planner.simulate_part(MESH, 3), "`cases` 3: give a LoadCase, or several"),
        (lambda: planner.design(MESH, **ENDS, cases=3), "`cases` 3: give a LoadCase, or several"),
        (lambda: planner.campaign_standing(None), "campaign None: give its folder"),
        (lambda: planner.synthesise_campaign(3), "`design` 3: give a list or a campaign"),
        (lambda: planner.synthesise_campaign(LAB, scatter="0.03"), "`scatter` '0.03': it must be"),
        (lambda: planner.diff(LAB, LAB, tolerance="1e-6"), "`tolerance` '1e-6': it must be a"),
        (lambda: planner.invert(1.0, printer=""), "no printer ''"),
        (lambda: planner.design_campaign("rate", budget="8"), "`budget` '8': it must be a whole"),
        (lambda: planner.simulate_bar("Tango", to_strain="20%"), "`to_strain` '20%': it must be"),
        (lambda: planner.simulate_bar("Tango", rate_mm_s="1"), "`rate_mm_s` '1': it must be"),
        (lambda: planner.simulate_bar("Tango", level="0.95"), "`level` '0.95': it must be"),
        (lambda: planner.simulate_bar("Tango", between_mm="1:9"), r"two places in mm, as \(10, 60"),
        (
            lambda: planner.characterise(TESTS, gauge_mm="15"),
            "`gauge_mm` '15': it must be a finite",
        ),
        (lambda: planner.characterise(TESTS, at_strain="0.1"), "strain '0.1': it must be a finite"),
        (lambda: planner.fit(TESTS, law="yeoh", order="A,B"), "`order` A,B: give each of"),
        (
            lambda: planner.fit(TESTS, law="yeoh", density={"SYN-soft": "1.1"}),
            "density_g_cm3 of SYN-soft '1.1': it must be a finite",
        ),
    ],
)
def test_another_type_is_refused_with_what_to_give(call, says) -> None:
    with pytest.raises(PlannerError, match=says):
        call()


@pytest.mark.parametrize(
    ("positions", "moduli", "shape"),
    [
        ((0, 1), (0, 1), "log"),
        ((0, 1), (1, float("nan")), "log"),
        ((0, 1), (1, 1e300), "log"),
        ((1, 0), (1, 2), "log"),
        ((0.1, 1), (1, 2), "log"),
        ((0, 0.5, 0.5, 0.5, 1), (1, 2, 3, 4, 5), "log"),
        ((0, 1), (1, 2, 3), "log"),
        ((0,), (1,), "log"),
        ((0, 1), (1, 2), "cubic"),
        ((0, "x"), (1, 2), "log"),
        (0, 1, "log"),
    ],
)
def test_a_profile_is_whole_or_refused(positions, moduli, shape) -> None:
    with pytest.raises(ArgumentError, match="profile mine"):
        planner.Profile("mine", positions, moduli, shape)


@pytest.mark.parametrize(
    ("positions", "moduli", "told"),
    [
        ((0, 1), (1, 1e300), "knot 2: modulus_MPa is 1e[+]300"),
        ((0, 0.7, 0.6, 1), (1, 2, 3, 4), "knot 3: position is 0.6; positions rise"),
        ((0, 0.5, 0.5, 0.5, 1), (1, 2, 3, 4, 5), "knot 4: position 0.5 stands three times"),
        ((0, 0.9), (1, 2), "mine: it needs rows from position 0 to position 1"),
    ],
)
def test_a_profile_that_is_refused_names_the_knot(positions, moduli, told) -> None:
    with pytest.raises(ArgumentError, match=told):
        planner.Profile("mine", positions, moduli, "log")


def test_values_can_be_sent_to_other_processes(samples: Path) -> None:
    """Fits and campaigns held views of mappings, and with them palettes and plans of a fit."""
    plan = planner.grade(MESH, **ENDS)
    palette = planner.load_printer("connex3").palette()
    fitted = planner.fit(samples / "tensile", law="neo-hookean", starts=2, compare=False)
    for value in (plan, palette, fitted.palette, palette.materials[0].law.stiffened(2.0)):
        assert pickle.loads(pickle.dumps(value)) == value
        assert copy.deepcopy(value) == value
    sent = pickle.loads(pickle.dumps(fitted))
    assert planner.fit_tables(sent) == planner.fit_tables(copy.deepcopy(fitted))
    moduli = planner.characterise(samples / "tensile", compare=False)
    for value in (moduli, planner.read_campaign(samples / "warm-lab")):
        assert repr(pickle.loads(pickle.dumps(value))) == repr(copy.deepcopy(value))


def test_a_plan_read_back_says_that_it_holds_no_shells(tmp_path: Path) -> None:
    folder = planner.grade(MESH, **ENDS).write(tmp_path / "bar")
    read = planner.read_plan(folder)
    assert read.json() == (folder / "plan.json").read_bytes()
    with pytest.raises(OutputError, match="grade the part again"):
        read.write(tmp_path / "again")
    with pytest.raises(OutputError, match=r"HOWTO\.md is in its folder"):  # it had no material
        read.howto()


def test_the_howto_says_which_material_to_which_file(tmp_path: Path) -> None:
    folder = planner.grade(MESH, **ENDS).write(tmp_path / "bar")
    howto = (folder / "HOWTO.md").read_text()
    for file in sorted((folder / "stl").iterdir()):
        assert f"| `{file.name}` |" in howto
    assert "FLX9795-DM" in howto


def test_the_public_names_are_there() -> None:
    assert sorted(planner.__all__) == planner.__all__
    for name in planner.__all__:
        assert getattr(planner, name) is not None
    assert set(planner.__all__) <= set(dir(planner))
    with pytest.raises(AttributeError, match="nothing"):
        _ = planner.nothing  # type: ignore[attr-defined]
