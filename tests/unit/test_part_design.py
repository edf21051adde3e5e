"""planner.design of a part: targets, limits, printed materials, files, bad input."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from typer.main import get_command

import planner
from benchmarks.interfaces import BOX, FACES
from planner.cli import app, run
from planner.errors import ArgumentError, PlannerError
from planner.formats.mesh_file import encode_stl
from planner.inverse_design.printing import Printing, _own_advice
from planner.simulation.solid import LostStabilityError

BEAM = ([40.0, 5.0, 5.0] * BOX, FACES)
LOAD = "x=min: 0,0,-0.1 N"


def design(**options: Any) -> planner.PartDesign:
    given = {
        "from_": "Tango", "to": "Vero", "axis": "x", "fix": "x=max", "cell_mm": 2.5, "knots": 5,
        **options,
    }  # fmt: skip
    return planner.design(BEAM, **given)


def simulated(made: planner.PartDesign, **options: Any) -> planner.PartSimulation:
    given = {"fix": "x=max", "cell_mm": 2.5, "steps": 1, "compare_cells": False, **options}
    return planner.simulate(made.plan, **given)


@pytest.fixture(scope="module")
def bent() -> planner.PartDesign:
    return design(load=LOAD, target="x=min uz=-8 mm")


# --- targets


def test_the_printed_materials_reach_the_target(bent: planner.PartDesign) -> None:
    """Within the 1 % that is asked for; the profile within the tenth that its search settles at."""
    assert bent.ok
    (row,) = bent.reached
    assert row.printed == pytest.approx(-8.0, rel=0.01)
    assert row.continuous == pytest.approx(-8.0, rel=0.003)
    low, high = sorted(row.interval)
    assert low < row.printed < high


@pytest.mark.parametrize("wanted_mm", [-5.0, -10.0])
def test_what_a_print_does_is_foretold_so_well_that_one_is_enough(
    wanted_mm: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By derivatives alone it would be off by a per cent, and a second one would be solved."""
    made, own = list[float](), Printing.made

    def counted(self: Printing, values: Any, before: Any) -> Any:
        one = own(self, values, before)
        made.append(float(np.abs(one.misses).max()))
        return one

    monkeypatch.setattr(Printing, "made", counted)
    assert design(load=LOAD, target=f"x=min uz={wanted_mm} mm").ok
    assert len(made) == 1
    assert made[0] < 0.0075


def test_what_is_written_is_what_was_simulated(bent: planner.PartDesign) -> None:
    """`planner.simulate` of the plan solves the same equations on the same cells.

    The design keeps the stabilisation of its cut cells at the middle stiffness; whole cells, as
    these are, have none, and supports give way by a millionth.
    """
    seen = simulated(bent, load=LOAD)
    assert seen.steps.responses[0].displacement_mm[-1, 2] == pytest.approx(
        bent.reached[0].printed, rel=1e-4
    )


def test_a_smooth_profile_stays_near_the_even_gradient(bent: planner.PartDesign) -> None:
    moduli = np.log(bent.moduli_MPa)
    assert np.all(np.diff(moduli) > 0.0)
    assert np.abs(np.diff(moduli, 2)).max() < 0.25 * np.ptp(moduli)


@pytest.mark.long
def test_soft_uses_less_of_what_is_stiff() -> None:
    """Dithered, so that rounding to grades does not move either profile."""
    soft, smooth = (
        design(load=LOAD, target="x=min uz=-8 mm", blend="dither", prefer=prefer)
        for prefer in ("soft", "smooth")
    )
    assert soft.reached[0].printed == pytest.approx(-8.0, rel=0.01)
    means = [np.trapezoid(np.log(made.moduli_MPa), made.positions) for made in (soft, smooth)]
    assert means[0] < means[1]


@pytest.mark.slow
def test_stiffness_and_force_are_displacement_and_reaction() -> None:
    """0.0125 N/mm under 0.1 N is 8 mm; a support that moves by 2 mm pulls with what is wanted."""
    stiff = design(load=LOAD, target="x=min stiffness=0.0125 N/mm")
    assert stiff.reached[0].wanted == pytest.approx(8.0)
    assert stiff.reached[0].printed == pytest.approx(8.0, rel=0.01)
    pulled = design(move="x=min: -2,free,free mm", target="x=min fx=-1.5 N", blend="dither")
    assert pulled.reached[0].printed == pytest.approx(-1.5, rel=0.01)
    seen = simulated(pulled, move="x=min: -2,free,free mm")
    force = next(r for r in seen.steps.responses if r.kind == "move").force_N[-1, 0]
    assert force == pytest.approx(pulled.reached[0].printed, rel=1e-4)


@pytest.mark.slow
def test_two_load_cases_are_met_together() -> None:
    """The beam is to bend by 8 mm at its end and, pressed in its middle, by 0.25 mm."""
    cases = [
        planner.LoadCase(("x=min uz=-8 mm",), ("x=max",), (LOAD,), name="end"),
        planner.LoadCase(
            ("box:18,0,0,22,5,5 uz=-0.25 mm",), ("x=max",), ("box:18,-1,4,22,6,6: 0,0,-0.3 N",),
            name="middle",
        ),
    ]  # fmt: skip
    made = design(fix=(), cases=cases, blend="dither")
    assert [row.case for row in made.reached] == ["end", "middle"]
    for row in made.reached:
        assert row.continuous == pytest.approx(row.wanted, rel=0.01)


@pytest.mark.long
def test_a_shape_is_come_near_to(bent: planner.PartDesign, tmp_path: Path) -> None:
    """The shape of a part designed before is found again: marks move as they did there."""
    seen = simulated(bent, load=LOAD)
    vertices = seen.cells.surface.vertices
    marks = [int(np.argmin(np.sum((vertices - [x, 2.5, 5.0]) ** 2, 1))) for x in (0, 10, 20, 30)]
    lines = ["x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm"]
    for k in marks:
        row = [*vertices[k], *seen.steps.displacement_mm[-1, k]]
        lines.append(",".join(f"{v:.6f}" for v in row))
    file = tmp_path / "marks.csv"
    file.write_text("\n".join(lines))
    made = design(load=LOAD, target=f"shape: {file}", blend="dither")
    off = [row.continuous - row.wanted for row in made.reached]
    assert np.abs(off).max() < 0.02 * 8.0
    assert not any(row.hard for row in made.reached)


# --- limits, and what cannot be had


@pytest.mark.long
def test_a_limit_of_strain_is_kept() -> None:
    free = design(load="x=min: 0,0,-0.3 N", target="x=min uz=-16 mm", limit="strain/break<10")
    assert free.strain_over_break is not None
    bound = 0.9 * free.strain_over_break
    kept = design(load="x=min: 0,0,-0.3 N", target="x=min uz=-16 mm", blend="dither",
                  limit=f"strain/break<{bound:.4f}")  # fmt: skip
    assert kept.strain_over_break is not None
    assert kept.strain_over_break < 1.02 * bound


@pytest.mark.slow
def test_a_limit_of_slope_is_kept() -> None:
    even = design(load=LOAD, target="x=min uz=-8 mm", limit="slope<0.1 /mm")
    assert np.abs(np.diff(np.log(even.moduli_MPa))).max() <= 0.1 * 10.0 * (1.0 + 1e-6)


@pytest.mark.slow
def test_two_figures_of_the_same_faces_are_aimed_at() -> None:
    """A tip that bends by 8 mm comes nearer by 1.5 mm or less, which no profile changes much."""
    free = design(load=LOAD, target="x=min uz=-8 mm", blend="dither")
    seen = simulated(free, load=LOAD)
    near = float(seen.steps.responses[0].displacement_mm[-1, 0])
    made = design(load=LOAD, target=["x=min uz=-8 mm", f"x=min ux={near:.3f} mm"], blend="dither")
    assert [row.target for row in made.reached] == ["x=min uz=-8 mm", f"x=min ux={near:.3f} mm"]
    for row in made.reached:
        assert row.continuous == pytest.approx(row.wanted, rel=0.01)


@pytest.mark.slow
def test_weight_and_a_moment_bend_a_part_as_wanted() -> None:
    """What `planner.simulate` says of the plan agrees, with the weight of what is printed."""
    loads = {"gravity": "-z", "moment": "x=min: 0,-1,0 N mm"}
    made = design(**loads, target="x=min uz=-4 mm", blend="dither")
    assert made.reached[0].printed == pytest.approx(-4.0, rel=0.01)
    seen = simulated(made, **loads, watch="x=min uz")
    watched = seen.steps.responses[-1]
    assert watched.along_mm[-1] == pytest.approx(made.reached[0].printed, rel=1e-4)


def test_what_is_out_of_reach_is_told_with_the_nearest() -> None:
    made = design(load=LOAD, from_="Tango", to="FLX9750", target="x=min uz=-0.5 mm")
    assert not made.ok
    assert "stiffest material that is allowed" in made.findings[0].message
    assert re.search(r"mm is reached, \+\d+ %;", made.findings[0].message)
    assert made.reached[0].continuous < -0.5


def test_a_limit_that_no_gradient_keeps_is_not_laid_on_the_steps_of_a_print() -> None:
    made = design(load=LOAD, target="x=min uz=-8 mm", limit="strain/break<0.0001", cell_mm=5.0)
    told = [re.search("strain/break<0.0001: the printed part comes to (.*), the nearest gradient "
                      "to (.*)$", f.message) for f in made.findings]  # fmt: skip
    printed, own = (float(figure) for figure in told[-1].groups())  # type: ignore[union-attr]
    assert printed == pytest.approx(made.strain_over_break, rel=5e-3)  # of three digits
    assert 0.0001 < own < printed


@pytest.mark.parametrize(("wanted_mm", "change_mm"), [(39.99, "0.01"), (40.0, "1.17")])
def test_a_distance_is_missed_of_its_change(wanted_mm: float, change_mm: str) -> None:
    """It is 40 mm at rest: of all of it, nothing that is soft would be missed by a per cent.

    Where it is to stay, a miss is of what one material alone makes of it.
    """
    target = f"x=min to x=max distance={wanted_mm:g} mm"
    made = design(load="x=min: 0,0,-0.03 N", from_="Tango", to="FLX9750", target=target)
    (row,) = made.reached
    assert abs(row.printed / wanted_mm - 1.0) < 0.01 < row.missed
    assert re.search(rf"mm is reached, \S+ % of a change of {change_mm} mm; ",
                     made.findings[0].message)  # fmt: skip


def test_a_print_that_is_not_stable_is_told_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before that the print that is aimed at and the gradient's own are tried."""
    tried = 0

    def lost(self: Printing, values: Any, before: Any) -> Any:
        nonlocal tried
        tried += 1
        raise LostStabilityError(0.4, None)

    monkeypatch.setattr(Printing, "made", lost)
    with pytest.raises(PlannerError, match="beyond 40 % of them: take smaller loads") as told:
        design(load=LOAD, target="x=min uz=-8 mm")
    assert "\n" not in str(told.value)
    assert tried == 3


# --- files and the command line


@pytest.mark.slow
def test_the_command_writes_the_plan_and_the_design(tmp_path: Path, capsys: Any) -> None:
    part, folder = tmp_path / "beam.stl", tmp_path / "beam-designed"
    part.write_bytes(encode_stl(BEAM[0].astype(np.float32), FACES, "beam"))
    arguments = [
        "design", str(part), "--from", "Tango", "--to", "Vero", "--axis", "x", "--fix", "x=max",
        "--load", LOAD, "--target", "x=min uz=-8 mm", "--cell-mm", "2.5", "--knots", "5",
        "--no-page", "-o", str(folder),
    ]  # fmt: skip
    assert run([*arguments, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((folder / "design.json").read_bytes())
    assert told["targets"][0]["printed"] == pytest.approx(-8.0, rel=0.01)
    assert planner.read_plan(folder).gradient.profile["name"] == "designed"
    again = planner.grade(part, profile=folder / "profile.csv", axis="x")
    assert [r.material for r in again.regions] == [
        r.material for r in planner.read_plan(folder).regions
    ]
    before = {f.name: f.read_bytes() for f in folder.rglob("*") if f.is_file()}
    assert run(arguments) == 2  # the folder is there
    assert "--force" in capsys.readouterr().err
    assert run([*arguments, "--force"]) == 0
    assert "x=min uz=-8 mm" in capsys.readouterr().out
    assert {f.name: f.read_bytes() for f in folder.rglob("*") if f.is_file()} == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"target": ()}, "`target` is missing"),
        ({"target": "x=min"}, "SELECTOR QUANTITY=VALUE UNIT"),
        ({"target": "x=min uw=3 mm"}, "no such quantity 'uw'; there are ux"),
        ({"target": "x=min uz=3"}, "the unit is missing"),
        ({"target": "x=min uz=1e999 mm"}, "unknown unit 'e999 mm'"),
        ({"target": "x=min stiffness=3 N"}, "write N/mm"),
        ({"target": "x=min stiffness=-3 N/mm"}, "must be above 0"),
        ({"target": "x<1 stiffness=3 N/mm"}, "no load or support is on exactly these faces"),
        ({"target": "x=3 uz=-1 mm"}, "catches no face"),
        ({"target": "shape: nowhere.csv"}, "nowhere.csv"),
        ({"limit": "strain<1"}, "`limit` strain<1: there are strain/break<0.5"),
        ({"limit": "slope<0"}, "must be above 0"),
        ({"knots": 1}, "from 2 to 100"),
        ({"prefer": "sofd"}, "did you mean"),
        ({"blend": "mix"}, "a design's may be nearest, dither"),
        ({"target": "x=max uz=-1 mm"}, "all of its faces are held along z by supports (x=max)"),
        ({"moment": "x=min: 0,1 N mm"}, "must be 3 figures"),
        ({"cases": [planner.LoadCase(fix="x=max", load=LOAD)]}, "`target` is missing"),
        ({"cell_mm": 0.05}, "the finest cells that fit are of"),
        ({"fix": ()}, "nothing holds the part"),
        ({"load": ()}, "nothing loads the part"),
        ({"from_": "Tangoo"}, "Tangoo"),
        ({"cell_mm": 0.0}, "`cell_mm`"),
    ],
)
def test_bad_input_is_told_in_a_line(options: dict[str, Any], words: str) -> None:
    with pytest.raises(PlannerError) as told:
        design(**{"load": LOAD, "target": "x=min uz=-8 mm", **options})
    assert words in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "needs tables [[case]]"),
        ("case = [1]\n", "must be a table"),
        ("[[case]]\ntarget = 'x=min uz=1 mm'\nlaod = 'x'\n", "did you mean load"),
        ("[[case]]\ntarget = 3\n", "must be text"),
        ("[[case\n", "not a TOML file"),
    ],
)
def test_case_files(tmp_path: Path, text: str, words: str) -> None:
    from planner.simulation.loads import read_cases

    file = tmp_path / "cases.toml"
    file.write_text(text)
    with pytest.raises(PlannerError) as told:
        read_cases(file)
    assert words in str(told.value)
    file.write_text("[[case]]\nname = 'a'\ntarget = 'x=min uz=1 mm'\nload = ['x=min: 0,0,1 N']\n")
    (case,) = read_cases(file)
    assert case.load == ("x=min: 0,0,1 N",)


def test_what_grade_advises_is_told_as_a_design_can_follow_it() -> None:
    """Of every option that is named, the command must have it, and mean the same by it."""
    part = trimesh.creation.box((4.3, 0.8, 0.9))
    plan = planner.grade(part, from_="Tango", to="Vero", tolerance=1.2)
    told = [found.message for found in plan.findings]
    with pytest.raises(ArgumentError) as thin:
        planner.grade(part, from_="Tango", to="Vero", bands=200)
    told.append(str(thin.value))
    assert any("--bands" in message for message in told)
    assert any("--tolerance" in message for message in told)
    known = {name for p in get_command(app).commands["design"].params for name in p.opts}
    for message in (_own_advice(text, "fewer --knots") for text in told):
        assert {*re.findall(r"--[a-z-]+", message)} <= known - {"--tolerance"}, message
        assert "`bands`" not in message


def test_a_target_of_nothing_is_missed_by_its_share_of_what_is_in_reach() -> None:
    """No material is stiff enough to stay where it is: the stiffest is told, and that it misses."""
    made = design(load=LOAD, target="x=min uz=0 mm", cell_mm=5.0, to="FLX9760")
    (row,) = made.reached
    soft, stiff = row.reach
    assert soft is not None
    assert row.printed == pytest.approx(stiff, rel=0.01)
    assert row.missed == pytest.approx(row.printed / soft)
    assert row.whole == pytest.approx(abs(soft))
    assert not made.ok
    assert "of the farthest that one material alone gives" in made.findings[0].message
    assert "; 1 finding" in repr(made)
