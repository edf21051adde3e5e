"""The audit finds faults that are put into a plan's files, and nothing in files as written."""

import json
import re
import shutil
import zipfile

import numpy as np
import pytest

from planner.cli import run
from tests.sweep.audit import audit, read_stl, volume, winding
from tests.sweep.fields import Gradient, distance_to, exactly
from tests.sweep.solids import box, triangles_of
from tests.sweep.test_sweep import stl_bytes

BAR = triangles_of(box(20, 6, 5))
ALONG = Gradient(("--axis", "x"), exactly(lambda points: points[:, 0] / 20), 1 / 20, False)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    (folder / "bar.stl").write_bytes(stl_bytes(BAR))
    ends = ["--from", "Tango", "--to", "Vero", "--axis", "x", "--bands", "4"]
    command = ["grade", str(folder / "bar.stl"), *ends, "--no-page", "-o", str(folder / "out")]
    assert run(command) in (0, 1)
    return folder / "out"


@pytest.fixture
def plan(written, tmp_path):
    return shutil.copytree(written, tmp_path / "plan")


def judged(folder, gradient=ALONG):
    return audit(folder, BAR, gradient, 0.5, seed=1)


def shells(folder):
    return sorted((folder / "stl").iterdir())


def test_a_sound_plan_has_no_fault(plan):
    assert judged(plan) == []


def test_an_open_shell_is_found(plan):
    path = shells(plan)[1]
    path.write_bytes(stl_bytes(read_stl(path)[1:]))
    faults = "\n".join(judged(plan))
    assert f"shape: stl/{path.name} is open" in faults
    assert f"files: stl/{path.name} has not the hash" in faults
    assert "in the 3MF is not what stands" in faults


def test_a_moved_point_of_an_interface_is_found(plan):
    path = shells(plan)[1]
    soup = read_stl(path)
    corner = soup[0, 0].copy()
    soup[(soup == corner).all(axis=2)] += np.float32(1e-5)
    path.write_bytes(stl_bytes(soup))
    faults = "\n".join(judged(plan))
    assert "is open" not in faults
    assert "area" in faults or "more often one way" in faults


def test_a_shell_in_another_shells_place_is_found(plan):
    path = shells(plan)[1]
    path.write_bytes(stl_bytes(read_stl(path) + np.float32([3, 0, 0])))
    faults = "\n".join(judged(plan))
    assert re.search("shells 2 and 3 share .* of the part", faults)


def test_a_shell_inside_out_is_found(plan):
    path = shells(plan)[0]
    path.write_bytes(stl_bytes(read_stl(path)[:, ::-1]))
    assert "has the volume -" in "\n".join(judged(plan))


def test_materials_in_each_others_places_are_found(plan):
    record = json.loads((plan / "plan.json").read_text())
    first, second = record["regions"][:2]
    first["field"], second["field"] = second["field"], first["field"]
    (plan / "plan.json").write_text(json.dumps(record))
    assert [fault[:9] for fault in judged(plan)] == ["material:"] * 2


def test_a_field_off_by_a_twentieth_is_found(plan):
    off = Gradient(ALONG.options, exactly(lambda points: points[:, 0] / 20 + 0.05), 1 / 20, False)
    assert judged(plan, off)[0].startswith("material:")


def test_another_3mf_is_found(plan):
    path = plan / "bar.3mf"
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    model = members["3D/3dmodel.model"].decode()
    members["3D/3dmodel.model"] = re.sub(r'( x="1)\b[.0]*', r"\1.00001", model, count=1).encode()
    assert members["3D/3dmodel.model"].decode() != model
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    assert "in the 3MF" in "\n".join(judged(plan))


def test_its_geometry_is_right_where_the_answer_is_known():
    assert volume(BAR + 1e4) == pytest.approx(600, rel=1e-9)
    points = np.array([[1, 1, 1], [19.9, 5.9, 4.9], [21, 1, 1], [10, -3, -4]], float)
    np.testing.assert_allclose(winding(BAR, points), [1, 1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(distance_to(BAR, points), [1, 0.1, 1, 5], rtol=1e-12)
