"""Test coupons beside a part, and the job sheet that names them."""

import io
import re

import numpy as np
import pytest
import trimesh

import planner
from planner.errors import ArgumentError
from planner.formats.specimens import read_specimens

ENDS = {"from_": "Tango", "to": "Vero", "axis": "x"}
BAR = trimesh.creation.box((60.0, 10.0, 6.0))
BRIDGE = trimesh.boolean.difference(
    [BAR, trimesh.creation.box((40.0, 20.0, 4.0)).apply_translation((0.0, 0.0, -1.0))]
)
"""A table of 60 x 10 x 2 mm on two feet, 40 mm apart and 4 mm high."""


def test_coupons_lie_beside_the_part_and_one_another_in_its_coordinates(tmp_path) -> None:
    plan = planner.grade(BAR, **ENDS, coupons=True)
    folder = plan.write(tmp_path / "bar")
    files = sorted((folder / "coupons").glob("*.stl"))
    assert len(files) == len(plan.shells) == 10
    meshes = [trimesh.load_mesh(file) for file in (*sorted((folder / "stl").iterdir()), *files)]
    coupons = meshes[len(plan.shells) :]
    for mesh in coupons:
        assert mesh.is_watertight
        assert f", {mesh.volume / 1000.0:.1f} cm3 each" in plan.howto()
        assert mesh.extents == pytest.approx([115.0, 19.0, 4.0])
        # The narrow section of ASTM D638, type IV: 6 mm wide over 33 mm.
        middle = np.abs(mesh.vertices[:, 0] - mesh.bounds[:, 0].mean()) <= 16.51
        assert np.ptp(mesh.vertices[middle, 1]) == pytest.approx(6.0, abs=1e-4)
    boxes = [BAR.bounds - BAR.bounds[0] + 1.0, *(mesh.bounds for mesh in coupons)]
    for number, one in enumerate(boxes):
        for other in boxes[:number]:
            assert (np.maximum(one[0], other[0]) >= np.minimum(one[1], other[1])).any()
    assert (np.ptp(np.concatenate(boxes), axis=0) <= (490.0, 390.0, 200.0)).all()
    listed = read_specimens(folder / "coupons" / "specimens.csv")
    assert [row.material for row in listed] == [shell.material for shell in plan.shells]
    assert planner.check(folder).ok
    assert "coupons" not in planner.read_plan(folder).document()


def test_coupons_that_the_tray_does_not_hold_are_refused() -> None:
    small = planner.load_printer("connex3", tray_mm=(100.0, 100.0, 100.0))
    with pytest.raises(ArgumentError, match="do not fit"):
        planner.grade(BAR, **ENDS, printer=small, coupons=True)


def test_the_job_sheet_has_grams_layers_and_support(tmp_path) -> None:
    plan = planner.grade(BRIDGE, **ENDS)
    howto = plan.howto()
    assert "6 mm, 200 layers of 30 um" in howto
    # Under the bridge: 40 x 10 x 4 mm, to a voxel of 60/256 mm along each edge.
    support_cm3 = float(re.search(r"about (\S+) cm3 of SUP705", howto)[1])
    assert support_cm3 == pytest.approx(1.6, rel=0.05)
    grams = [float(cells[3]) for cells in _table(howto)]
    assert sum(grams[:-1]) == pytest.approx(grams[-1], rel=0.01)
    assert grams[-1] == pytest.approx(sum(r.mass_g for r in plan.regions), rel=0.01)
    assert "coupons" not in howto


def _table(howto: str) -> list[list[str]]:
    lines = io.StringIO(howto.partition("| --- | --- | --- | --- |\n")[2])
    return [line.split("|") for line in lines if line.startswith("|")]
