"""Printers are found by entry point, and a plugin's faults are named."""

import dataclasses
import importlib
import json
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

import planner
from planner.cli import run
from planner.errors import ArgumentError, FileError, PaletteError, UnknownNameError
from planner.printers import installed_printers, load_printer, load_profile
from planner.testing import check_printer

ROOT = Path(__file__).parents[2]
PALETTE = """
schema = 1
name = "myjet-soft"
kind = "palette"
[[material]]
id = "Soft"
coordinate = 0.0
elongation_at_break = 1.0
density_g_cm3 = 1.1
law = { model = "neo-hookean", mu_MPa = 0.2 }
[[material]]
id = "Hard"
coordinate = 1.0
elongation_at_break = 0.2
density_g_cm3 = 1.2
deformation = "plastic"
law = { model = "linear", modulus_MPa = 900.0 }
"""

PROFILE = """
schema = 1
name = "myjet"
title = "MyJet 3000"
tray_mm = [300.0, 200.0, 150.0]
pixel_mm = [0.042, 0.084]
layer_mm = 0.027
minimum_wall_mm = 0.6
minimum_feature_mm = 0.5
base_resins = ["A", "B"]
support = "S"
palettes = ["myjet-soft"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "palettes").mkdir()
    (tmp_path / "palettes" / "myjet-soft.toml").write_text(PALETTE)
    (tmp_path / "printer.toml").write_text(PROFILE)
    (tmp_path / "job_notes.md").write_text("# Print it\n")
    return tmp_path


@pytest.mark.parametrize("name", ["job_notes.md", "palettes/myjet-soft.toml"])
def test_a_file_that_is_missing_beside_it_is_named(folder: Path, name: str) -> None:
    (folder / name).unlink()
    machine = load_profile(folder)
    with pytest.raises(FileError, match=rf"{name} is missing beside its printer\.toml"):
        machine.job_notes() if name.endswith(".md") else machine.palette()


def test_a_palette_goes_by_one_name(folder: Path) -> None:
    (folder / "palettes" / "myjet-soft.toml").write_text(PALETTE.replace("myjet-soft", "own"))
    with pytest.raises(PaletteError, match=r"palettes/myjet-soft\.toml is of name = 'own'"):
        load_profile(folder).palette()


def test_a_lone_file_is_a_printer_like_another(folder: Path) -> None:
    own = folder / "own.toml"
    own.write_text('schema = 1\nname = "own"\nlike = "connex3"\nminimum_wall_mm = 0.8\n')
    machine, base = load_printer(str(own)), load_printer("connex3")
    check_printer(machine)
    assert (machine.name, machine.minimum_wall_mm) == ("own", 0.8)
    assert (machine.tray_mm, machine.palette()) == (base.tray_mm, base.palette())
    assert machine.operator_name("Vero") == base.operator_name("Vero")
    assert machine.job_notes().endswith("Stated for this plan: minimum_wall_mm 0.8, not 0.6.\n")
    own.write_text('schema = 1\nname = "own"\nlike = "own.toml"\n')
    with pytest.raises(UnknownNameError, match=r"own\.toml"):  # not itself, over and over
        load_printer(own)
    own.write_text('schema = 1\nname = "own"\n')
    with pytest.raises(PaletteError, match="missing required field `title`"):
        load_printer(own)


@pytest.mark.parametrize("name", ["connex3", "own"])
def test_a_plan_is_sliced_in_the_voxels_that_it_was_made_for(name: str, tmp_path: Path) -> None:
    """A file's printer may be called as one that is installed, or as none."""
    own = tmp_path / "own.toml"
    own.write_text(f'schema = 1\nname = "{name}"\nlike = "connex3"\nlayer_mm = 0.014\n')
    body = trimesh.creation.box((12.0, 4.0, 0.28))
    mesh, ends = (body.vertices, body.faces), {"from_": "Tango", "to": "Vero", "axis": "x"}
    plan = planner.grade(mesh, **ends, printer=own)
    assert "20 layers of 14 um" in plan.notes
    folder = plan.write(tmp_path / "plan")
    assert planner.write_slices(folder, tmp_path / "a").grid.pitch_mm == (0.042, 0.042, 0.014)
    stack = planner.write_slices(folder, tmp_path / "b", printer="connex3")
    assert stack.grid.pitch_mm == (0.042, 0.042, 0.03)
    # Nothing more is said of a printer whose name says it.
    machine = load_printer("connex3", minimum_wall_mm=0.8)
    assert "voxel_mm" not in planner.grade(mesh, **ends, printer=machine).document()


def test_single_limits_are_stated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = load_printer("connex3", minimum_wall_mm=0.8, tray_mm=(50.0, 50.0, 50.0))
    check_printer(machine)
    assert (machine.minimum_wall_mm, machine.minimum_feature_mm) == (0.8, 0.42)
    with pytest.raises(ArgumentError, match="above 0"):
        load_printer("connex3", minimum_feature_mm=0.0)
    for tray_mm in (5, (1.0, 2.0), (1, 2, "3")):
        with pytest.raises(ArgumentError, match=r"`tray_mm` .*: it must be"):
            load_printer("connex3", tray_mm=tray_mm)
    assert load_printer("connex3", tray_mm=np.full(3, 50.0)).tray_mm == machine.tray_mm
    part = str(tmp_path / "bar.stl")
    trimesh.creation.box((40.0, 10.0, 0.7)).export(part)
    words = ["grade", part, "--from", "Tango", "--to", "Vero", "--dry-run"]
    assert run(words) == 0
    assert run([*words, "--minimum-wall", "0.8"]) == 1
    assert "below the minimum wall of 0.8 mm" in capsys.readouterr().err
    assert run([*words, "--tray", "30,30,30"]) == 2
    assert "too large for the tray of 30 x 30 x 30 mm" in capsys.readouterr().err
    assert run([*words, "--tray", "30"]) == 2


def test_a_new_printer_is_a_whole_plugin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["printers", "new", "my-jet"]) == 0
    folder = tmp_path / "my-jet-printer"
    project = tomllib.loads((folder / "pyproject.toml").read_text())
    points = project["project"]["entry-points"]["planner.printers"]
    assert points == {"my-jet": "my_jet_printer:PRINTER"}
    monkeypatch.syspath_prepend(str(folder))
    check_printer(importlib.import_module("my_jet_printer").PRINTER)
    exec((folder / "test_my_jet_printer.py").read_text(), checks := {})
    checks["test_it_is_a_printer"]()
    # The editor's line names a file that is there, as seen from the file that has it.
    for file in folder.glob("**/*.toml"):
        first = file.read_text().partition("\n")[0]
        if file.name != "pyproject.toml":
            assert (file.parent / first.removeprefix("#:schema ")).is_file()
    capsys.readouterr()
    assert run(["printers", "show", str(folder / "my_jet_printer" / "printer.toml")]) == 0
    assert "minimum wall: 0.6 mm" in capsys.readouterr().out
    assert run(["printers", "new", "my-jet"]) == 2  # never over what is there
    assert run(["printers", "new", "../jet"]) == 2
    assert run(["printers", "new", "connex3"]) == 2  # its name would stand for two
    assert not Path("connex3-printer").exists()


def test_show_says_what_the_printers_software_calls_materials(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["printers", "show", "connex3", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["minimum_feature_mm"] == 0.42
    assert shown["palettes"]["connex3-tango-vero"]["TangoPlus"] == "TangoPlus FLX930"


@pytest.mark.parametrize("kind", ["printer", "palette", "campaign"])
def test_schemas_take_what_planner_takes_and_refuse_what_it_refuses(
    kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every file of ours is valid; one more key, or one of another type, is not."""
    jsonschema = pytest.importorskip("jsonschema")
    assert run(["schema", kind]) == 0
    judge = jsonschema.Draft7Validator(json.loads(capsys.readouterr().out))
    files = {
        "printer": [
            ROOT / "printers/connex3/printer.toml",
            *ROOT.glob("tests/plugins/*/*/p*.toml"),
        ],
        "palette": [
            *ROOT.glob("printers/*/palettes/*.toml"),
            *ROOT.glob("tests/**/palettes/*.toml"),
        ],
        "campaign": [*ROOT.glob("samples/*/campaign.toml")],
    }[kind]
    assert files
    for file in files:
        document = tomllib.loads(file.read_text())
        assert judge.is_valid(document), file
        assert not judge.is_valid(document | {"nonsense": 1})
        assert not judge.is_valid(document | {"name": 1})
        assert not judge.is_valid({key: document[key] for key in document if key != "schema"})
    if kind == "palette":
        document["material"][0]["law"]["nonsense"] = 1.0
        assert not judge.is_valid(document)
    if kind == "printer":
        assert judge.is_valid({"schema": 1, "name": "own", "like": "connex3"})
        assert not judge.is_valid({"schema": 1, "name": "own"})


def test_connex3_is_installed_and_passes_its_check() -> None:
    assert "connex3" in installed_printers()
    machine = load_printer("connex3")
    check_printer(machine)
    assert machine.tray_mm == (490.0, 390.0, 200.0)
    assert (machine.pixel_mm, machine.layer_mm) == ((0.042, 0.042), 0.030)
    assert machine.minimum_wall_mm == 0.6
    assert len(machine.palette().materials) == 10


def test_a_profile_of_files_is_a_printer(folder: Path) -> None:
    check_printer(load_profile(folder))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"tray_mm": (0.0, 1.0, 1.0)}, "tray_mm"),
        ({"layer_mm": 0.0}, "layer_mm"),
        ({"base_resins": ()}, "base_resins"),
        ({"palettes": ()}, r"palettes is \(\): Expected `array` of length >= 1"),
        ({"pixel_mm": (0.04, 0.04, 0.03)}, "pixel_mm is .*: Expected `array` of length 2, got 3"),
        ({"pixel_mm": (42.0, 84.0)}, r"pixel_mm is .* < 1\.0"),  # micrometres
        ({"tray_mm": (0.3, 0.2, 0.2)}, r"tray_mm is .* >= 10\.0"),  # metres
        ({"operator_names": {"Sofft": "S"}}, "'Sofft', which no palette has"),
        ({"title": None}, "title is None: Expected `str`, got `null`"),
        ({"operator_names": {"Soft": ""}}, "operator_name"),
    ],
)
def test_the_check_names_what_is_wrong(folder: Path, change: dict, reason: str) -> None:
    machine = dataclasses.replace(load_profile(folder), **change)
    with pytest.raises(AssertionError, match=reason):
        check_printer(machine)


def test_the_check_names_what_is_missing() -> None:
    with pytest.raises(AssertionError, match=r"lacks.*tray_mm"):
        check_printer(object())


def test_a_key_that_is_no_key_is_named(folder: Path) -> None:
    (folder / "printer.toml").write_text(PROFILE + "colour = 'red'\n")
    with pytest.raises(PaletteError, match="colour"):
        load_profile(folder)


def test_unknown_printer_and_palette() -> None:
    with pytest.raises(UnknownNameError, match="did you mean connex3"):
        load_printer("connx3")
    with pytest.raises(UnknownNameError, match="it has connex3-tango-vero"):
        load_printer("connex3").palette("agilus")


# ------------------------------------------------------------------------------------------------
# What others publish.


class Jet:
    """A printer of another package, like the Connex3 but for its name."""

    name = "jet"

    def __getattr__(self, member: str) -> Any:
        return getattr(load_printer("connex3"), member)


def published(monkeypatch: pytest.MonkeyPatch, *entries: tuple[str, str, object]) -> None:
    """Stand in for what packages publish: name, package, and what is loaded, beside ours."""
    ours = [*installed_printers().values()]
    others = [
        SimpleNamespace(
            name=name,
            value=f"{of}:IT",
            dist=SimpleNamespace(name=of, version="1"),
            load=lambda it=it: it,
        )
        for name, of, it in entries
    ]
    monkeypatch.setattr("planner.printers.entry_points", lambda group: [*ours, *others])


def raising(*_: object) -> Any:
    raise RuntimeError("no licence")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, None),
        ({"layer_mm": "0.014"}, "layer_mm is '0.014': Expected `float`"),
        ({"tray_mm": (255.0, 252.0)}, "tray_mm is .* length 3, got 2"),
        ({"palette": lambda name=None: None}, r"palette\('connex3-tango-vero'\) is None"),
        ({"palette": raising}, "cannot be loaded .RuntimeError: no licence"),
        ({"job_notes": raising}, "cannot be loaded .RuntimeError: no licence"),
        ({"job_notes": lambda: None}, r"job_notes\(\) is None and no str"),
        ({"name": "other"}, "name is 'other'; give it the entry point's"),
    ],
)
def test_a_printer_of_others_is_sound_or_named(
    change: dict[str, object],
    reason: str | None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    jet = Jet()
    vars(jet).update(change)
    published(monkeypatch, ("jet", "jetpack", jet))
    if reason is None:
        assert load_printer("jet") is jet
    else:
        with pytest.raises(UnknownNameError, match=f"'jet'.*jetpack:IT of jetpack.*{reason}"):
            load_printer("jet")
    assert run(["printers"]) == (reason is not None)
    told = capsys.readouterr()
    assert "connex3" in told.out
    assert ("jetpack" in told.err) == (reason is not None)


def test_a_name_that_two_packages_publish_is_no_ones(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Else which one plans goes by chance, even under the name of a printer of ours."""
    published(monkeypatch, ("jet", "one", Jet()), ("jet", "two", Jet()))
    with pytest.raises(UnknownNameError, match="by one:IT of one and two:IT of two; uninstall"):
        load_printer("jet")
    assert load_printer("connex3").name == "connex3"
    assert run(["printers"]) == 1
    assert "uninstall all but one" in capsys.readouterr().err
