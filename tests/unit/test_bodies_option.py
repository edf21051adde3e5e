"""A part with a pocket wound inwards: every command that reads a mesh asks for `--bodies`."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.formats.mesh_file import encode_stl

_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_BOX = np.array([face for a, b, c, d in _QUADS for face in [(a, b, c), (a, c, d)]])
VERTICES = np.concatenate([_CORNERS * (8, 8, 16), _CORNERS * (4, 4, 8) + (2, 2, 8)])
FACES = np.concatenate([_BOX, _BOX[:, ::-1] + 8])

HELD = ("--fix", "z=min", "--load", "z=max: 0.1,0,0 N")
COMMANDS = {
    "grade": ("--from", "Tango", "--to", "Vero", "--axis", "z", "--bands", "2"),
    "design": (
        "--from",
        "Tango",
        "--to",
        "Vero",
        "--axis",
        "z",
        *HELD,
        "--target",
        "z=max ux=1 mm",
    ),
    "simulate": ("--material", "FLX9760", *HELD),
    "export": ("--material", "FLX9760", "--to", "vtu"),
}


@pytest.fixture
def pocketed(tmp_path: Path) -> str:
    file = tmp_path / "block.stl"
    file.write_bytes(encode_stl(VERTICES.astype(np.float32), FACES.astype(np.int32), "block"))
    return str(file)


@pytest.mark.parametrize(("command", "options"), COMMANDS.items())
def test_every_command_tells_both_volumes_and_asks(
    command: str, options: Sequence[str], pocketed: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    output = tmp_path / ("out.json" if command == "simulate" else "out.vtu")
    assert run([command, pocketed, *options, "-o", str(output)]) == 2
    told = capsys.readouterr().err
    assert "it has 896 mm3 with cavities, 1024 mm3 with solids; choose by --bodies" in told
    assert told.count("\n") == 1
    assert not output.exists()
    assert run([command, pocketed, *options, "--bodies", "hollow", "-o", str(output)]) == 2
    assert "--bodies hollow: it may be cavities, solids" in capsys.readouterr().err


@pytest.mark.parametrize(("bodies", "volume_mm3"), [("cavities", 896), ("solids", 1024)])
def test_a_plan_says_which_reading_was_chosen(
    bodies: str, volume_mm3: float, pocketed: str, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    words = ["grade", pocketed, *COMMANDS["grade"], "--bodies", bodies, "--no-page"]
    assert run([*words, "-o", str(folder)]) in (0, 1)
    part = json.loads((folder / "plan.json").read_text(encoding="utf-8"))["part"]
    assert part["volume_mm3"] == pytest.approx(volume_mm3, rel=1e-6)
    assert part["repairs"] == [
        f"its 2 bodies read as {bodies}: 896 mm3 with cavities, 1024 mm3 with solids"
    ]


def test_the_choice_reaches_the_model() -> None:
    """Cells of 2 mm fill the part exactly."""
    for bodies, cells in (("cavities", 112), ("solids", 128)):
        model = planner.export(
            (VERTICES, FACES), to="vtu", material="FLX9760", cell_mm=2.0, bodies=bodies
        )
        assert model.cells == cells


def test_a_plan_has_no_bodies_to_choose(tmp_path: Path) -> None:
    plan = planner.grade((VERTICES, FACES), from_="Tango", to="Vero", axis="z", bodies="cavities")
    with pytest.raises(planner.PlannerError, match="`bodies` solids: it goes with a mesh"):
        planner.export(plan, to="vtu", bodies="solids")
    with pytest.raises(TypeError, match="bodies"):
        planner.simulate(plan, bodies="solids")  # a bar's, without loads
