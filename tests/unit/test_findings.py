"""A part over the tray is a finding, however far over, and its files are written."""

from dataclasses import replace
from pathlib import Path

import manifold3d as m3
import numpy as np
import pytest

import planner
from planner.errors import ArgumentError
from planner.voxels.columns import MOST_VOXELS
from planner.voxels.thin_places import longest_checked_mm, raster_for


def _bar(length_mm: float) -> tuple[np.ndarray, np.ndarray]:
    mesh = m3.Manifold.cube([length_mm, 50.0, 40.0]).to_mesh()
    return np.asarray(mesh.vert_properties[:, :3]), np.asarray(mesh.tri_verts)


@pytest.mark.parametrize("length_mm", [500.0, 700.0, 970.0, 1200.0, 25_000.0])
def test_a_part_over_the_tray_is_planned_and_reported(length_mm: float, tmp_path: Path) -> None:
    plan = planner.grade(_bar(length_mm), from_="Tango", to="Vero", axis="x")
    (tray,) = (found for found in plan.findings if found.kind == "tray")
    assert "490 x 390 x 200" in tray.message
    assert plan.checks["tray_excess_mm"].value == pytest.approx(length_mm - 490.0, rel=1e-6)
    assert plan.checks["shells_unsound"].ok
    assert not plan.ok
    assert (plan.write(tmp_path / "bar") / "plan.json").exists()


def test_walls_far_over_the_tray_are_said_to_be_unchecked() -> None:
    plan = planner.grade(_bar(25_000.0), from_="Tango", to="Vero", axis="x")
    assert "places_too_thin" not in plan.checks
    assert any("not checked" in found.message for found in plan.findings)
    near = planner.grade(_bar(700.0), from_="Tango", to="Vero", axis="x")
    assert near.checks["places_too_thin"].ok
    assert near.checks["voxel_volume_error"].ok


def test_a_printer_of_fine_walls_says_what_it_cannot_check() -> None:
    """At a fifth of 0.1 mm a bar of 600 mm has 30,000 voxels, more than a grid can number."""
    fine = replace(planner.load_printer("connex3"), minimum_wall_mm=0.1)
    plan = planner.grade(_bar(600.0), from_="Tango", to="Vero", axis="x", printer=fine)
    assert [found.kind for found in plan.findings] == ["tray", "unchecked"]


def test_walls_are_checked_up_to_the_longest_extent() -> None:
    """The grid of the longest region that can be checked has the most voxels, not one more."""
    longest_mm = longest_checked_mm(0.6)
    low, high = np.zeros(3), np.array([1.0, 1.0, longest_mm])
    assert MOST_VOXELS - 1 <= max(raster_for(low, high, 0.6).grid.shape) <= MOST_VOXELS
    with pytest.raises(ArgumentError, match="choose a coarser pitch"):
        raster_for(low, high * 1.001, 0.6)
