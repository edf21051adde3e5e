"""What a folder's documents name lies in that folder: one rule, for all that follow a reference."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

import planner
from planner.errors import ArgumentError, FileError, PlannerError, UnknownNameError
from planner.fields.parse import field_text
from planner.formats.files import path_within
from planner.gap.campaign_folder import read_campaign
from planner.gap.correct import correct
from planner.gap.diagnosis import read_diagnosis
from planner.gap.virtual import read_design
from planner.materials.study import read_study
from planner.printers import load_printer
from planner.simulation.export import export
from planner.simulation.part_response import PartResponse

# ------------------------------------------------------------------------------------------------
# The rule.


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with files, links inwards and outwards, and a pipe; and what lies outside it."""
    made = tmp_path / "made"
    (made / "stl").mkdir(parents=True)
    (made / "stl" / "a.stl").write_bytes(b"a")
    (tmp_path / "outside.stl").write_bytes(b"o")
    (tmp_path / "made-too").mkdir()
    (made / "out.stl").symlink_to("../outside.stl")
    (made / "away").symlink_to(tmp_path / "made-too", target_is_directory=True)
    (made / "in.stl").symlink_to("stl/a.stl")
    (made / "round").symlink_to("round")
    os.mkfifo(made / "pipe")
    (made / "null").symlink_to("/dev/null")
    return made


@pytest.mark.parametrize(
    "name",
    [
        "../outside.stl", "stl/../../outside.stl", "../made-too/x.stl", "/etc/hostname", "C:a.stl",
        "C:\\a.stl", "\\\\host\\share\\a.stl", "", ".", "./", "stl/..", "..", "out.stl", "away",
        "away/x.stl", "null",
    ],
)  # fmt: skip
def test_what_lies_outside_is_refused(folder: Path, name: str) -> None:
    with pytest.raises(FileError, match="outside the folder; it was not read: put it into"):
        path_within(folder, name)


def test_the_whole_path_of_a_file_inside_is_refused_too(folder: Path) -> None:
    """A folder that is sent elsewhere keeps its meaning."""
    with pytest.raises(FileError, match="outside the folder"):
        path_within(folder, str(folder / "stl" / "a.stl"))


@pytest.mark.parametrize("name", ["pipe", "round", "stl/\0", "x" * 5000])
def test_what_is_no_file_is_refused_unopened(folder: Path, name: str) -> None:
    with pytest.raises(FileError, match=r"is a device, a pipe|cannot be read"):
        path_within(folder, name)


@pytest.mark.parametrize("name", ["stl/a.stl", "stl/../stl/a.stl", "in.stl", "stl", "stl/none.stl"])
def test_what_lies_inside_is_found_or_absent(folder: Path, name: str) -> None:
    assert path_within(folder, name) == folder / name
    linked = folder.parent / "linked"
    linked.symlink_to(folder, target_is_directory=True)
    assert path_within(linked, name) == linked / name


# ------------------------------------------------------------------------------------------------
# Everything that follows a plan.


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    bar = trimesh.creation.box((30.0, 6.0, 4.0))
    plan = planner.grade(bar, from_="Tango", to="FLX9750", axis="x", name="bar")
    return plan.write(tmp_path_factory.mktemp("graded") / "bar")


@pytest.fixture
def plan(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sound, tmp_path / "bar"))


def _moved_above(folder: Path, file: str) -> None:
    (folder / file).rename(folder.parent / "outside.stl")


def _named_above(folder: Path, file: str) -> None:
    _moved_above(folder, file)
    document = json.loads((folder / "plan.json").read_text())
    for region in document["regions"]:
        region["file"] = "../outside.stl" if region["file"] == file else region["file"]
    (folder / "plan.json").write_text(json.dumps(document))


def _linked_above(folder: Path, file: str) -> None:
    _moved_above(folder, file)
    (folder / file).symlink_to(folder.parent / "outside.stl")


def _check(folder: Path) -> None:
    found = planner.check(folder)
    assert not found.ok
    raise FileError("; ".join(found.problems))


USES: dict[str, Callable[[Path], object]] = {
    "check": _check,
    "simulate": planner.simulate,
    "simulate read": lambda f: planner.simulate(planner.read_plan(f)),
    "simulate part": lambda f: planner.simulate(f, fix="x=min", gravity="-z"),
    "export": lambda f: export(f, to="vtu", cell_mm=2.0),
    "page": planner.plan_page,
    "view": lambda f: planner.view(f),
    "compare": lambda f: planner.compare_page(f, f),
    "slices": lambda f: planner.write_slices(f, f.parent / "layers", pitch_mm=1.0),
}


@pytest.mark.parametrize("move", [_named_above, _linked_above])
@pytest.mark.parametrize("use", USES)
def test_a_shell_outside_its_plan_is_not_read(
    plan: Path, use: str, move: Callable[[Path, str], None]
) -> None:
    """The shell is the very one that the plan was written with: only its place is wrong."""
    move(plan, planner.read_plan(plan).regions[1].file)
    with pytest.raises(FileError, match="lies outside the folder"):
        USES[use](plan)


@pytest.mark.parametrize("name", ["bar.3mf", "HOWTO.md"])
def test_nothing_beside_the_shells_is_read_by_a_link_outwards(plan: Path, name: str) -> None:
    secret = plan.parent / "secret"
    secret.write_bytes((plan / name).read_bytes())
    (plan / name).unlink()
    (plan / name).symlink_to(secret)
    with pytest.raises(FileError, match="lies outside the folder"):
        planner.plan_page(plan)


def _changed(folder: Path, change: Callable[[dict], object]) -> Path:
    document = json.loads((folder / "plan.json").read_text())
    change(document)
    (folder / "plan.json").write_text(json.dumps(document))
    return folder


@pytest.mark.parametrize("name", ["../bar", "/tmp/bar", "", "a b", "bar\n"])
def test_files_are_called_by_plain_names(plan: Path, name: str) -> None:
    with pytest.raises(FileError, match=r"part\.name is"):
        planner.read_plan(_changed(plan, lambda d: d["part"].update(name=name)))


def test_a_plan_names_its_palette_and_no_file(
    plan: Path, samples: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What a user gives by hand may be a file; what a plan says is the name of a palette."""
    own = planner.read_plan(plan).palette.name
    lab = (samples.parent / f"printers/connex3/palettes/{own}.toml").read_bytes()
    (tmp_path / "lab.toml").write_bytes(lab)
    monkeypatch.chdir(tmp_path)
    _changed(plan, lambda d: d["palette"].update(name="lab.toml"))
    with pytest.raises(UnknownNameError, match=r"no palette 'lab.toml'"):
        planner.simulate(plan)
    with pytest.raises(ArgumentError, match="its printer does not bring"):
        planner.grade(trimesh.creation.box((30.0, 6.0, 4.0)), like=plan)
    assert planner.simulate(plan, palette="lab.toml").palette.name == own


def test_a_formula_opens_no_table() -> None:
    says = {"name": "min", "fields": [
        {"name": "axis", "direction": [1, 0, 0], "start_mm": 0, "span_mm": 30},
        {"name": "expression", "expression": "x; table: /etc/hostname"},
    ]}  # fmt: skip
    with pytest.raises(FileError, match="holds a ';'"):
        field_text(says, (0.0, 0.0, 0.0))


# ------------------------------------------------------------------------------------------------
# Campaigns, lists of specimens and diagnoses.


TOML = 'schema = 1\nname = "lab"\nprinter = "connex3"\npalette = "{}"\n'
CURVES = "specimen,time_s,displacement_mm,force_N\n" + "".join(
    f"S1,{k / 4},{k / 4},{0.3 * k}\n" for k in range(20)
)
BAR = "x_mm,coordinate\n0,0.2\n30,0.4\n"


@pytest.fixture
def outside(plan: Path, samples: Path) -> Path:
    """A folder with a plan, a profile, curves and a palette beside a campaign's."""
    root = plan.parent
    (root / "bar.csv").write_text(BAR)
    (root / "curves.csv").write_text(CURVES)
    shutil.copy(samples / "warm-lab" / "palette.toml", root / "palette.toml")
    (root / "lab").mkdir()
    return root


def _campaign(root: Path, *, columns: str, row: str, palette: str = "connex3-tango-vero") -> Path:
    lab = root / "lab"
    (lab / "campaign.toml").write_text(TOML.format(palette))
    heads = "width_mm,thickness_mm,gauge_mm,rate_mm_s"
    (lab / "specimens.csv").write_text(f"specimen,{columns},{heads}\nS1,{row},6,2,30,1\n")
    (lab / "curves.csv").write_text(CURVES)
    return lab


REFERENCES = {
    "profile": {"columns": "profile", "row": "{}bar.csv"},
    "plan as profile": {"columns": "profile", "row": "{}bar"},
    "file": {"columns": "material,file", "row": "FLX9760,{}curves.csv"},
    "palette": {"columns": "material", "row": "FLX9760", "palette": "{}palette.toml"},
}


@pytest.mark.parametrize("reference", REFERENCES)
def test_a_campaign_reaches_nothing_outside_its_folder(outside: Path, reference: str) -> None:
    texts = REFERENCES[reference]
    lab = _campaign(outside, **{key: text.format("../") for key, text in texts.items()})
    with pytest.raises(FileError, match="lies outside the folder"):
        read_campaign(lab)
    for name in ("bar.csv", "curves.csv", "palette.toml"):
        shutil.copy(outside / name, lab / name)
    shutil.copytree(outside / "bar", lab / "bar")
    lab = _campaign(outside, **{key: text.format("") for key, text in texts.items()})
    assert len(read_campaign(lab).specimens) == 1


def test_a_part_of_a_campaign_lies_in_its_folder(outside: Path, palette: planner.Palette) -> None:
    lab = outside / "lab"
    (lab / "specimens.csv").write_text(
        'specimen,part,fix,move\nP1,../bar,x=min,"x=max: 0,0,-1 mm"\n'
    )
    with pytest.raises(FileError, match="lies outside the folder"):
        read_design(lab / "specimens.csv", palette, printer=load_printer("connex3"), camera=False)


def test_a_palette_from_elsewhere_is_given_by_hand(outside: Path) -> None:
    """What a campaign may not reach for, its user may: by `palette`."""
    lab = _campaign(outside, columns="material", row="FLX9760", palette="../palette.toml")
    with pytest.raises(FileError, match="lies outside the folder"):
        read_campaign(lab)
    assert read_campaign(lab, outside / "palette.toml").specimens


@pytest.mark.parametrize("name", ["campaign.toml", "specimens.csv", "curves.csv"])
def test_a_campaigns_own_files_are_no_links_outwards(outside: Path, name: str) -> None:
    lab = _campaign(outside, columns="material", row="FLX9760")
    (lab / name).rename(outside / "kept")
    (lab / name).symlink_to(outside / "kept")
    with pytest.raises(FileError, match="lies outside the folder"):
        read_campaign(lab)


def test_a_list_of_specimens_names_files_beside_it(outside: Path) -> None:
    _campaign(outside, columns="material,file", row="FLX9760,../curves.csv")
    with pytest.raises(FileError, match="lies outside the folder"):
        read_study([outside / "lab" / "specimens.csv"])


GAP = dict.fromkeys(("after", "floor", "closed", "closed_interval", "recalibration_only"))


def _diagnosis(**more: object) -> dict[str, object]:
    return {
        "schema": 1, "campaign": "lab", "palette": {"name": "lab", "sha256": ""}, "specimens": 1,
        "tests": 1, "verdict": "none", "ranking": [], "class": [], "not_testable": [], "where": [],
        "gap": {**GAP, "before": 0.1, "held_out": ""}, "effect": {}, "data_quality": [],
        "remainder": {"significant": False, "where": []}, "next_experiments": [], **more,
    }  # fmt: skip


@pytest.mark.parametrize("profile", ["../x.csv", "profiles/../../x.csv", "/tmp/x.csv", "x.csv", 3])
def test_a_diagnosis_writes_its_bars_into_profiles(tmp_path: Path, profile: object) -> None:
    """Its next tests name files, which `write_diagnosis` writes."""
    test = {
        "change": {}, "splits": [], "expected_gain_nats": 1.0, "row": {"profile": profile},
        "design": {"x_mm": [0.0, 1.0], "coordinate": [0.0, 1.0]},
    }  # fmt: skip
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps(_diagnosis(next_experiments=[test])))
    with pytest.raises(FileError, match=r"profile is .*it must be profiles/NAME.csv"):
        read_diagnosis(file)


def test_a_diagnosis_names_its_palette_and_no_file(
    outside: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(outside)
    named = {"name": "palette.toml", "sha256": ""}
    Path("diagnosis.json").write_text(json.dumps(_diagnosis(palette=named)))
    with pytest.raises(PlannerError, match="does not bring; give its file"):
        correct(read_diagnosis("diagnosis.json"), temperature_C=30.0)


def test_the_name_of_a_response_is_no_path(tmp_path: Path) -> None:
    """A campaign that holds it is written with a file of that name."""
    document = {
        "name": "../x", "displacement_mm": [1, 2], "force_N": [1, 2], "coordinate": [0.5],
        "strain": [[0.1], [0.2]], "share": [[1], [1]], "thickness_mm": 2, "log_sd": 0,
    }  # fmt: skip
    (tmp_path / "r.json").write_text(json.dumps(document))
    with pytest.raises(FileError, match="holds a path"):
        PartResponse.read(tmp_path / "r.json")
