"""A plan that was read back goes wherever its folder goes."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import planner
from planner.errors import FileError, OutputError
from planner.plan import Plan


@pytest.fixture(scope="module")
def made(samples: Path) -> Plan:
    return planner.grade(samples / "dogbone.stl", from_="Tango", to="FLX9760", axis="x")


@pytest.fixture
def folder(made: Plan, tmp_path: Path) -> Path:
    return made.write(tmp_path / "bar")


def test_it_remembers_its_folder_and_nobody_else_sees_it(made: Plan, folder: Path) -> None:
    plan = planner.read_plan(folder)
    assert plan.folder == folder
    assert made.folder is None
    assert plan.json() == (folder / "plan.json").read_bytes()
    assert replace(plan, files_sha256={}).json() == made.json()
    assert str(folder) not in repr(plan)
    moved = Path(shutil.copytree(folder, folder.with_name("copy")))
    assert planner.read_plan(moved) == plan


_USES: dict[str, Callable[[Any, Path], Any]] = {
    "simulate": lambda plan, out: planner.simulate(plan, to_strain=0.1, slices=20).json(),
    "check": lambda plan, out: planner.check(plan).document(),
    "plan_page": lambda plan, out: planner.plan_page(plan),
    "view": lambda plan, out: planner.view(plan).read_bytes(),
    "write_slices": lambda plan, out: planner.write_slices(plan, out, pitch_mm=0.5).document(),
    "iterate_layers": lambda plan, out: len(list(planner.iterate_layers(plan, pitch_mm=0.5))),
}


@pytest.mark.parametrize("use", _USES)
def test_it_stands_for_its_folder(
    use: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plan = planner.read_plan("bar")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert _USES[use](plan, tmp_path / "one") == _USES[use](folder, tmp_path / "two")


def test_it_can_be_followed(made: Plan, folder: Path, samples: Path) -> None:
    part = samples / "dogbone.stl"
    followed = planner.grade(part, like=planner.read_plan(folder))
    assert followed.json() == planner.grade(part, like=folder).json()


@pytest.mark.parametrize("use", _USES)
def test_a_folder_that_is_gone_is_named(use: str, folder: Path, tmp_path: Path) -> None:
    plan = planner.read_plan(folder)
    folder.rename(tmp_path / "away")
    with pytest.raises(FileError, match=r"bar/plan\.json: the plan of dogbone\.stl was read from"):
        _USES[use](plan, tmp_path / "one")


def test_another_plan_in_its_place_is_no_substitute(
    folder: Path, samples: Path, tmp_path: Path
) -> None:
    plan = planner.read_plan(folder)
    other = planner.grade(samples / "dogbone.stl", from_="Tango", to="FLX9750", axis="x")
    other.write(folder, force=True)
    with pytest.raises(FileError, match="read it again"):
        planner.check(plan)


def test_what_needs_a_folder_says_so_of_a_plan_just_made(made: Plan, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="it lies in no folder yet; write it"):
        planner.check(made)


def test_it_is_copied_rather_than_written(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=f"copy {folder}, or grade the part again"):
        planner.read_plan(folder).write(tmp_path / "again")
