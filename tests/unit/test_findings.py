"""A part over the tray is refused at once; forced, it is a finding, and its files are written."""

import time
from dataclasses import replace
from pathlib import Path

import manifold3d as m3
import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import ArgumentError
from planner.formats.mesh_file import encode_stl
from planner.voxels.columns import MOST_VOXELS
from planner.voxels.thin_places import longest_checked_mm, raster_for


def _bar(length_mm: float) -> tuple[np.ndarray, np.ndarray]:
    mesh = m3.Manifold.cube([length_mm, 50.0, 40.0]).to_mesh()
    return np.asarray(mesh.vert_properties[:, :3]), np.asarray(mesh.tri_verts)


@pytest.mark.slow
@pytest.mark.parametrize("length_mm", [500.0, 25_000.0])
def test_a_part_over_the_tray_is_planned_and_reported(length_mm: float, tmp_path: Path) -> None:
    plan = planner.grade(_bar(length_mm), from_="Tango", to="Vero", axis="x", force_oversize=True)
    (tray,) = (found for found in plan.findings if found.kind == "tray")
    assert "490 x 390 x 200" in tray.message
    assert plan.checks["tray_excess_mm"].value == pytest.approx(length_mm - 490.0, rel=1e-6)
    assert plan.checks["shells_unsound"].ok
    assert not plan.ok
    assert (plan.write(tmp_path / "bar") / "plan.json").exists()


@pytest.mark.parametrize(
    ("unit", "hint"),
    [
        ("cm", "in mm it would be 100 x 50 x 40 mm: --unit mm"),
        ("inch", "in mm it would be 100 x 50 x 40 mm: --unit mm"),
        ("ft", "in mm it would be 100 x 50 x 40 mm: --unit mm"),
    ],
)
@pytest.mark.parametrize("command", ["grade", "design"])
def test_a_part_over_the_tray_is_refused_before_the_work(
    command: str, unit: str, hint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vertices, faces = _bar(100.0)
    file = tmp_path / "bar.stl"
    file.write_bytes(encode_stl(vertices.astype(np.float32), faces, "bar"))
    words = [command, str(file), "--from", "Tango", "--to", "Vero", "--unit", unit]
    if command == "design":
        words += ["--fix", "x=max", "--load", "x=min: 0,0,-0.5 N", "--target", "x=min uz=-1 mm"]
    begun = time.process_time()
    assert run([*words, "-o", str(tmp_path / "out")]) == 2
    assert time.process_time() - begun < 3.0
    told = capsys.readouterr().err
    assert told.startswith("planner: bar.stl: the part is ")
    assert "too large for the tray of 490 x 390 x 200 mm" in told
    assert hint in told
    assert told.endswith("with --force-oversize\n")
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_part_that_fits_turned_is_planned_and_reported() -> None:
    vertices, faces = _bar(480.0)
    plan = planner.grade((vertices[:, [1, 0, 2]], faces[:, ::-1]), from_="Tango", to="Vero")
    (tray,) = (found for found in plan.findings if found.kind == "tray")
    assert "turn it to fit" in tray.message


@pytest.mark.long
def test_walls_far_over_the_tray_are_said_to_be_unchecked() -> None:
    plan = planner.grade(_bar(25_000.0), from_="Tango", to="Vero", axis="x", force_oversize=True)
    assert "places_too_thin" not in plan.checks
    assert any("not checked" in found.message for found in plan.findings)
    near = planner.grade(_bar(700.0), from_="Tango", to="Vero", axis="x", force_oversize=True)
    assert near.checks["places_too_thin"].ok
    assert near.checks["voxel_volume_error"].ok


def test_a_printer_of_fine_walls_says_what_it_cannot_check() -> None:
    """At a fifth of 0.1 mm a bar of 600 mm has 30,000 voxels, more than a grid can number."""
    fine = replace(planner.load_printer("connex3"), minimum_wall_mm=0.1)
    plan = planner.grade(
        _bar(600.0), from_="Tango", to="Vero", axis="x", printer=fine, force_oversize=True
    )
    assert [found.kind for found in plan.findings] == ["tray", "unchecked"]


def test_walls_are_checked_up_to_the_longest_extent() -> None:
    """The grid of the longest region that can be checked has the most voxels, not one more."""
    longest_mm = longest_checked_mm(0.6)
    low, high = np.zeros(3), np.array([1.0, 1.0, longest_mm])
    assert MOST_VOXELS - 1 <= max(raster_for(low, high, 0.6).grid.shape) <= MOST_VOXELS
    with pytest.raises(ArgumentError, match="choose a coarser pitch"):
        raster_for(low, high * 1.001, 0.6)
