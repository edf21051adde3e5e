"""A certificate sees what was done to a folder, and is given whatever was done to it."""

import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

import planner
from planner.cli import run

BY_MATERIAL = ("material", "modulus_MPa", "coordinate")


@pytest.fixture(scope="module")
def sound(finger_plan: planner.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finger_plan.write(tmp_path_factory.mktemp("graded") / "finger")


@pytest.fixture
def folder(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sound, tmp_path / "copy"))


def _change(folder: Path, change: Callable[[dict], object]) -> None:
    document = json.loads((folder / "plan.json").read_text())
    change(document)
    (folder / "plan.json").write_text(json.dumps(document))


def _swap(document: dict, keys: tuple[str, ...]) -> None:
    a, b = document["regions"][3:5]
    for key in keys:
        a[key], b[key] = b[key], a[key]


def test_it_is_said_in_words_too(folder: Path, capsys) -> None:
    (folder / "HOWTO.md").unlink()
    assert run(["check", str(folder)]) == 1
    printed = capsys.readouterr()
    assert "NOT sound" in printed.out
    assert "finding" in printed.err
    assert "HOWTO.md" in printed.err


def test_an_untouched_folder_is_sound(sound: Path) -> None:
    certificate = planner.check(sound)
    assert certificate.ok
    assert certificate.problems == ()
    assert certificate.shells == 10
    assert set(certificate.checks) >= {"shells_unsound", "overlap", "plan_disagreements"}


def test_a_lab_s_own_notes_beside_a_plan_are_no_fault(folder: Path) -> None:
    (folder / "notes.txt").write_text("printed on tray 3", encoding="utf-8")
    assert planner.check(folder).ok


def test_a_damaged_shell_is_the_only_one_that_is_told(folder: Path) -> None:
    """The others keep their numbers, and its object in the 3MF is not said to have no STL."""
    with sorted((folder / "stl").iterdir())[0].open("ab") as shell:
        shell.write(b"x")
    problems = planner.check(folder).problems
    assert problems
    assert all("finger__01" in problem for problem in problems)


DAMAGE: dict[str, Callable[[Path], object]] = {
    "instructions changed": lambda f: (f / "HOWTO.md").write_text("another", encoding="utf-8"),
    "instructions gone": lambda f: (f / "HOWTO.md").unlink(),
    "picture gone": lambda f: (f / "section.png").unlink(),
    "files swapped": lambda f: _change(f, lambda d: _swap(d, ("file", "sha256"))),
    "materials swapped": lambda f: _change(f, lambda d: _swap(d, BY_MATERIAL)),
    "volumes swapped": lambda f: _change(f, lambda d: _swap(d, ("volume_mm3",))),
    "bounds swapped": lambda f: _change(f, lambda d: _swap(d, ("bounds_mm",))),
    "mass negative": lambda f: _change(f, lambda d: d["regions"][2].update(mass_g=-3.0)),
    "mass enormous": lambda f: _change(f, lambda d: d["regions"][0].update(mass_g=1e9)),
    "triangles wrong": lambda f: _change(f, lambda d: d["regions"][0].update(triangles=4)),
    "part elsewhere": lambda f: _change(
        f, lambda d: d["part"].update(bounds_mm=[[0, 0, 0], [1, 1, 1]])
    ),
    "part without volume": lambda f: _change(f, lambda d: d["part"].update(volume_mm3=0.0)),
    "no regions": lambda f: _change(f, lambda d: d.update(regions=[])),
    "shells gone": lambda f: shutil.rmtree(f / "stl"),
    "shell cut short": lambda f: _cut(sorted((f / "stl").iterdir())[2]),
    "shell empty": lambda f: sorted((f / "stl").iterdir())[2].write_bytes(b""),
    "shell a folder": lambda f: _folder(sorted((f / "stl").iterdir())[2]),
    "3MF cut short": lambda f: _cut(f / "finger.3mf"),
    "3MF gone": lambda f: (f / "finger.3mf").unlink(),
    "3MF in inches": lambda f: _edit_model(f, b'unit="millimeter"', b'unit="inch"'),
    "3MF in another colour": lambda f: _edit_model(f, b'displaycolor="#F', b'displaycolor="#0'),
    "listed hash of a shell": lambda f: _change(
        f, lambda d: d["files_sha256"].update({d["regions"][0]["file"]: 64 * "0"})
    ),
    "place along the field": lambda f: _change(
        f,
        lambda d: d["regions"][3].update(
            field=[d["regions"][3]["field"][0], d["regions"][4]["field"][0] - 0.02]
        ),
    ),
    "place beyond the field": lambda f: _change(f, lambda d: d["regions"][9].update(field=[7, 5])),
    "another profile": lambda f: _change(
        f, lambda d: d["gradient"]["profile"].update(moduli_MPa=[1.0, 30.0])
    ),
    "number wrong": lambda f: _change(f, lambda d: d["regions"][2].update(index=9)),
    "stranger beside": lambda f: (f / "old.STL").write_bytes(b"x"),
    "stranger": lambda f: (f / "stl" / "extra.stl").write_bytes(b"x"),
    "shell outside": lambda f: _change(f, lambda d: d["regions"][0].update(file="/etc/hostname")),
    "shell above": lambda f: _change(f, lambda d: d["regions"][0].update(file="../x.stl")),
}


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def _edit_model(folder: Path, old: bytes, new: bytes) -> None:
    file = folder / "finger.3mf"
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    assert old in members["3D/3dmodel.model"]
    members["3D/3dmodel.model"] = members["3D/3dmodel.model"].replace(old, new, 1)
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize("damage", DAMAGE)
def test_damage_is_a_finding_and_never_a_crash(damage: str, folder: Path, capsys) -> None:
    DAMAGE[damage](folder)
    assert run(["check", str(folder), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert not document["ok"]
    assert document["problems"]


@pytest.mark.parametrize("strain", [-0.1, 1e9])
def test_a_working_strain_that_no_material_reaches_is_refused(
    strain: float, folder: Path, capsys
) -> None:
    _change(folder, lambda d: d["stiffness"].update(at_strain=strain))
    assert run(["check", str(folder)]) == 2
    assert "$.stiffness.at_strain" in capsys.readouterr().err


def test_what_lies_outside_the_folder_is_not_read(folder: Path, capsys) -> None:
    _change(folder, lambda d: d["regions"][0].update(file="/etc/hostname"))
    run(["check", str(folder)])
    assert "lies outside the folder" in capsys.readouterr().err


@pytest.mark.parametrize("unknown", [0, 2])
def test_a_mass_is_known_of_all_regions_of_a_material_or_of_none(
    unknown: int, samples: Path, tmp_path: Path
) -> None:
    """It was told only where the region of an unknown mass came behind the other."""
    plan = planner.grade(
        samples / "dogbone.stl", from_="Tango", to="FLX9740", axis="x", blend="bands:3"
    )
    folder = plan.write(tmp_path / "bands")
    alike = [k for k, one in enumerate(plan.regions) if one.printed == plan.regions[0].printed]
    assert len(alike) > 2
    assert planner.check(folder).problems == ()
    _change(folder, lambda d: d["regions"][alike[unknown]].update(mass_g=None))
    problems = planner.check(folder).problems
    assert any("its mass" in problem for problem in problems)


def test_findings_of_the_plan_are_not_forgotten(tmp_path: Path, capsys) -> None:
    plate = trimesh.creation.box((20.0, 5.0, 0.4))
    plan = planner.grade(plate, from_="Vero", to="Tango", axis="x")
    assert plan.findings
    assert run(["check", str(plan.write(tmp_path / "thin"))]) == 1
    printed = capsys.readouterr()
    assert "minimum wall" in printed.err
    assert "files are sound" in printed.out


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": 2}'])
def test_what_is_no_plan_is_bad_input(folder: Path, capsys, text: str) -> None:
    (folder / "plan.json").write_text(text)
    assert run(["check", str(folder)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("modulus_MPa", 99.0, "is not in its interval"),
        ("modulus_interval_MPa", [700.0, 800.0], "is not in its interval"),
        ("target_modulus_MPa", [100.0, 200.0], "give another error"),
        ("error", [5.0, 9.0], "give another error"),
    ],
)
def test_figures_that_contradict_each_other_are_told(folder, key, value, said) -> None:
    _change(folder, lambda document: document["regions"][3].update({key: value}))
    assert any(said in problem for problem in planner.check(folder).problems)
