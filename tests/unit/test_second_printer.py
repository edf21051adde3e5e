"""A printer that planner has never heard of: a plugin found on the path, from plan to layers."""

import contextlib
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from planner.cli import run as run_here

PLUGIN = Path(__file__).parents[1] / "plugins" / "duojet"


def run(*command: str, codes: tuple[int, ...] = (0,)) -> str:
    """Run Python with the plugin beside planner, as its users do, and return what it prints."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(PLUGIN), *sys.path])}
    done = subprocess.run(
        [sys.executable, *command],
        env=environment,
        capture_output=True,
        encoding="utf-8",
        timeout=60,
    )
    assert done.returncode in codes, done.stderr
    return done.stdout


def planner(*arguments: object, codes: tuple[int, ...] = (0,)) -> dict:
    """Run a command in this process, with the plugin on the path for as long as it lasts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(PLUGIN)
        with contextlib.redirect_stdout(io.StringIO()) as out:
            code = run_here([*map(str, arguments), "--json"])
    assert code in codes
    return json.loads(out.getvalue())


@pytest.fixture(scope="module")
def plan(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plans") / "finger"
    part = str(samples / "finger.stl")
    ends = ("--from", "Soft", "--to", "Hard", "--axis", "x", "--printer", "duojet")
    run("-m", "planner", "grade", part, *ends, "-o", str(folder), codes=(0, 1))
    return folder


def test_it_is_listed_and_passes_its_check() -> None:
    listed = {row["name"]: row for row in planner("printers")["printers"]}
    assert {"connex3", "duojet"} <= set(listed)
    row = listed["duojet"]
    assert row["tray_mm"] == [150.0, 100.0, 80.0]
    assert row["distribution"] == "duojet-printer 1.2"
    run(
        "-c",
        "import planner, planner.testing as t; t.check_printer(planner.load_printer('duojet'))",
    )


def test_a_plan_has_its_names_wall_and_laws(plan: Path) -> None:
    document = json.loads((plan / "plan.json").read_text())
    assert document["printer"] == "duojet"
    assert document["palette"]["name"] == "duojet-lastik-durol"
    materials = [region["material"] for region in document["regions"]]
    assert (materials[0], materials[-1]) == ("Lastik", "Durol")
    assert set(materials) <= {"Lastik", "LD40", "LD70", "Durol"}
    # Secant of the nominal stress mu (l - l^-2) at 10 %, and the straight law's own.
    expected = 0.3 * (1.1 - 1.1**-2) / 0.1
    assert document["regions"][0]["modulus_MPa"] == pytest.approx(expected, rel=1e-6)
    assert document["regions"][-1]["modulus_MPa"] == pytest.approx(900.0)
    howto = (plan / "HOWTO.md").read_text()
    assert "DuoJet's queue" in howto
    assert "| LSTK-30 (slot 1) |" in howto
    assert "Objet" not in howto
    text = "\n".join(finding["message"] for finding in document["findings"])
    assert "minimum wall of 2 mm" in text  # the finger's walls pass the Connex3's 0.6 mm


def test_its_folder_checks(plan: Path) -> None:
    certificate = planner("check", plan, codes=(0, 1))
    assert certificate["printer"] == "duojet"
    assert certificate["problems"] == []
    assert all(check["ok"] for check in certificate["checks"].values())


def test_layers_have_its_pitch(plan: Path, tmp_path: Path) -> None:
    """0.1 x 0.05 x 0.04 mm without being told; colours that look the same are told apart."""
    document = planner("slices", plan, "-o", tmp_path / "s", "--printer", "duojet")
    assert document["printer"] == "duojet"
    assert document["grid"]["pitch_mm"] == [0.1, 0.05, 0.04]
    x, y, z = (97.0, 16.0, 20.0)
    assert document["grid"]["shape"] == [round(x / 0.1), round(y / 0.05), round(z / 0.04)]
    names = {m["material"]: m["operator_name"] for m in document["materials"]}
    assert names["Durol"] == "DRL-900 (slot 2)"
    colours = np.array([m["rgba"] for m in document["materials"]], float)
    apart = np.linalg.norm(colours[:, None] - colours, axis=-1) + 255 * np.eye(len(colours))
    assert apart.min() >= 8
    with Image.open(tmp_path / "s" / document["files"][100]) as image:
        assert image.size == (970, 320)
        # 25.4 mm an inch; PNG keeps whole pixels a metre
        assert image.info["dpi"] == pytest.approx((254.0, 508.0), rel=1e-4)


def test_it_is_simulated_with_its_laws(plan: Path) -> None:
    strain = ("--to-strain", "0.05", "--printer", "duojet")
    of_plan = planner("simulate", plan, *strain, codes=(0, 1))
    assert of_plan["palette"]["name"] == "duojet-lastik-durol"
    # Lastik's force: mu (l - l^-2) on the 6 x 4 mm of the coupon
    coupon = planner("simulate", "Lastik", *strain, codes=(0, 1))
    assert max(coupon["steps"]["force_N"]) == pytest.approx(
        0.3 * (1.05 - 1.05**-2) * 24.0, rel=1e-3
    )


def test_materials_and_blends_are_its_own() -> None:
    listed = json.dumps(planner("materials", "--printer", "duojet"))
    assert "LD70" in listed
    assert "Tango" not in listed
    found = json.dumps(planner("invert", "--modulus", "5", "--printer", "duojet", codes=(0, 1)))
    assert "LD" in found


def test_without_the_plugin_layers_need_a_pitch(plan: Path, tmp_path: Path) -> None:
    import planner as here
    from planner.errors import UnknownNameError

    certificate = here.check(plan)  # needs the files alone
    assert all(check.ok for check in certificate.checks.values())
    with pytest.raises(UnknownNameError, match=r"no printer 'duojet'.*`pitch_mm`"):
        here.write_slices(plan, tmp_path / "s")
    assert here.write_slices(plan, tmp_path / "s", pitch_mm=0.5).printer == "duojet"
