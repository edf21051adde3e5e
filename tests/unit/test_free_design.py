"""Gradients free in space: lattices of controls, wanted shapes, turns, distances, limits, cases."""

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import planner
from benchmarks.interfaces import BOX, FACES
from benchmarks.shapes import block, manufactured
from planner.cli import run
from planner.errors import ArgumentError, PlannerError, ThinBandError
from planner.formats.field_file import read_grid_table
from planner.formats.mesh_file import encode_stl
from planner.grading.profile import stiffness_scale
from planner.inverse_design import search
from planner.inverse_design.controls import Controls, StiffnessRange, lattice_counts
from planner.inverse_design.design import PartDesign
from planner.inverse_design.findings import DesignFinding
from planner.inverse_design.goals import Limits, ShapeGoal, Target, WantedShape, functionals
from planner.inverse_design.search import Case, DesignProblem, Tried, _quadratic, evaluate
from planner.materials.marlow import marlow_table
from planner.mesh.mesh import Mesh
from planner.printers import load_printer, palette_of
from planner.simulation.cut_cells import cut_cells
from planner.simulation.loads import LoadCase, palette_densities, read_conditions
from planner.simulation.solid import POISSON, Body
from planner.simulation.sparse_cholesky import analyse

BEAM = ([40.0, 5.0, 5.0] * BOX, FACES)
MESH = Mesh(BEAM[0], FACES.astype(np.int32))
LOAD = "x=min: 0,0,-0.1 N"
Array = NDArray[np.float64]


def design(part: object = BEAM, **options: Any) -> PartDesign:
    given = {"from_": "Tango", "to": "Vero", "fix": "x=max", "cell_mm": 2.5, **options}
    return planner.design(part, **given)


# --- controls


def test_quadratic_splines_are_one_in_sum_and_carry_straight_lines() -> None:
    """Linear in the controls is linear in space, with nothing to smooth: of exact arithmetic."""
    made = Controls.lattice(np.array([[0.0, 0, 0], [40, 5, 5]]), (6, 3, 4), [])
    points = np.random.default_rng(1).uniform([0, 0, 0], [40, 5, 5], (200, 3))
    basis = made.basis(points)
    assert np.allclose(basis.sum(axis=1), 1.0)
    place = (np.arange(6) - 0.5) * 10.0
    values = np.broadcast_to(place[:, None, None], (6, 3, 4)).ravel()
    assert np.allclose(basis @ values, points[:, 0])
    assert np.allclose(made.bends @ values, 0.0)
    assert np.abs(made.slopes @ values).max() == pytest.approx(1.0)


def test_a_symmetric_lattice_is_its_own_mirror_image() -> None:
    made = Controls.lattice(np.array([[0.0, 0, 0], [40, 5, 5]]), (5, 4, 3), [1])
    assert len(made.even) == 5 * 2 * 3
    points = np.random.default_rng(2).uniform([0, 0, 0], [40, 5, 5], (50, 3))
    other = points * [1, -1, 1] + [0, 5, 0]
    values = np.random.default_rng(3).uniform(size=len(made.even))
    assert np.allclose(made.basis(points) @ values, made.basis(other) @ values)


def test_lattices_are_counted_by_number_spacing_and_need() -> None:
    box = np.array([40.0, 5.0, 5.0])
    assert lattice_counts("6x3x3", box, 1) == (6, 3, 3)
    assert lattice_counts("8mm", box, 1) == (7, 3, 3)
    x, y, z = lattice_counts("auto", box, 12)
    assert x > y == z
    assert 48 <= x * y * z <= 96
    with pytest.raises(ArgumentError, match="6x3x3"):
        lattice_counts("six", box, 1)
    with pytest.raises(ArgumentError, match="600"):
        lattice_counts("0.5mm", box, 1)


def test_the_step_solves_its_quadratic_programme() -> None:
    """Against scipy's trust-region solver, with multipliers bounded and free ones beside a box."""
    from scipy.optimize import minimize

    rng = np.random.default_rng(4)
    n = 6
    root = rng.normal(size=(n, n))
    hessian, slope = root @ root.T + np.eye(n), rng.normal(size=n)
    rows, rest = rng.normal(size=(3, n)), rng.normal(size=3)
    least, most = np.array([-2.0, 0.0, 0.0]), np.array([2.0, 2.0, np.inf])
    low, high = np.full(n, -0.3), np.full(n, 0.3)
    found = _quadratic(hessian, slope, rows, rest, least, most, low, high, np.zeros(n))

    def cost(v: Array) -> float:
        y = v[:n]
        return float(0.5 * y @ hessian @ y + slope @ y + 2.0 * v[n:].sum())

    held = [
        {"type": "ineq", "fun": lambda v: v[n] - (rows[0] @ v[:n] + rest[0])},
        {"type": "ineq", "fun": lambda v: v[n] + (rows[0] @ v[:n] + rest[0])},
        {"type": "ineq", "fun": lambda v: v[n + 1] - (rows[1] @ v[:n] + rest[1])},
        {"type": "ineq", "fun": lambda v: -(rows[2] @ v[:n] + rest[2])},
    ]
    bounds = [(-0.3, 0.3)] * n + [(0.0, None)] * 2
    other = minimize(cost, np.append(np.zeros(n), [9.0, 9.0]), method="SLSQP", bounds=bounds,
                     constraints=held, options={"maxiter": 500, "ftol": 1e-14})  # fmt: skip
    assert np.allclose(found, other.x[:n], atol=1e-5)


def test_misses_weigh_more_where_smoothness_holds_the_gradient_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A target that only a strong bend reaches, and each per cent of it by much more of that.

    The bend's energy rises by c² / e for a miss of e c; at a weight of 20 nothing moves.
    """
    problem = _problem(["x=min uz=-8 mm"], None, Limits())
    bend = problem.controls.bends[0]
    gain, wanted = 0.02, 0.3 * np.abs(bend).sum() / 2.0
    count, none = len(bend), np.empty((0, len(bend)))

    def linear(problem: DesignProblem, values: Array) -> Tried:
        off = np.array([gain * (bend @ values - wanted)])
        return Tried(values, np.zeros(1), off, gain * bend[None], np.empty(0), none, np.empty(0),
                     none, 0.0, (), np.empty((1, 0)))  # fmt: skip

    monkeypatch.setattr(search, "evaluate", linear)
    found = search.search(problem, np.full(count, 0.5), tolerance=1e-4)
    assert abs(found.best.off[0]) < 1e-4
    assert found.problem.miss_weight > 20.0
    stuck = replace(problem, miss_weight=20.0)
    values = search.next_values(stuck, linear(stuck, np.full(count, 0.5)), 0.5)
    assert abs(linear(stuck, values).off[0]) > 1e-3, "at a weight of 20"


# --- derivatives


def _problem(texts: list[str], shape: Array | None, limits: Limits) -> DesignProblem:
    palette = palette_of(None, load_printer("connex3"))
    scale = stiffness_scale(palette, 0.1)
    cells = cut_cells(MESH, 2.7)
    targets = [Target.read(text) for text in texts]
    case = LoadCase(fix="x=max", load="x=min: 0,0.05,-0.1 N", gravity="-z",
                    watch=[s for t in targets for s in (t.selector, t.other) if s])  # fmt: skip
    on = read_conditions(cells.surface, case)
    middle = np.full(len(cells.points), 0.5)
    body = Body(cells, marlow_table(scale.model, poisson=POISSON), middle,
                densities=palette_densities(palette, [case]))  # fmt: skip
    body = replace(body, stabiliser_MPa=body.cell_shear_MPa)
    bent = Target("bent", surface_mm=shape)
    wished = [] if shape is None else [WantedShape.of(bent, MESH.triangles)]
    solved = Case("", cells, on, analyse(cells.nodes, cells.node_mm, cells.interface.cells),
                  functionals(targets, on, cells.surface), body,
                  [ShapeGoal.on(one, cells, None) for one in wished])  # fmt: skip
    ends = scale.moduli_MPa[0], scale.moduli_MPa[-1]
    controls = Controls.lattice(MESH.bounds_mm, (5, 3, 3), [])
    stiffness = StiffnessRange(ends, scale.model, 0.1)
    return DesignProblem(stiffness, controls, [solved], limits, "smooth")


def _bent(of: Array = MESH.triangles) -> Array:
    """Along an arc of radius 100 mm, downwards from x=40."""
    angle, radius = (40.0 - of[..., 0]) / 100.0, 97.5 + of[..., 2]
    x, z = 40.0 - radius * np.sin(angle), radius * np.cos(angle) - 97.5
    return np.stack([x, of[..., 1], z], axis=-1)


@pytest.mark.parametrize("same", [True, False], ids=["its own triangles", "nearest"])
def test_derivatives_are_those_of_differences(same: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of displacement, turn, distance, limit and shape, to 1e-3 of the largest.

    Two ways in which all controls move at once: a slope that is off shows in both. Central
    differences of 1e-3 are off by 1e-6 of the third derivative, which is of order 1. As far as a
    search settles, derivatives are off by its last change, 5e-3 at most.
    """
    texts = ["x=min uz=-8 mm", "x=min ry=-20 deg",
             "x=min and z<2 to x=max and z>3 distance=30 mm"]  # fmt: skip
    problem = _problem(texts, _bent() if same else _bent()[:-1],
                       limits=Limits(strain_over_break=0.05))  # fmt: skip
    rng = np.random.default_rng(5)
    values = rng.uniform(0.4, 0.6, len(problem.controls.even))
    rough = evaluate(problem, values)
    monkeypatch.setattr(search, "_SETTLED", 1e-5)
    here = evaluate(problem, values)
    assert np.abs(rough.slopes - here.slopes).max() < 5e-3 * np.abs(here.slopes).max()
    near_slope = 2.0 * here.near @ here.near_slopes
    for way in rng.choice([-1.0, 1.0], (2, len(values))):
        two = [evaluate(problem, values + by * way) for by in (-1e-3, 1e-3)]
        off = (two[1].off - two[0].off) / 2e-3
        assert np.abs(off - here.slopes @ way).max() < 1e-3 * np.abs(here.slopes).max()
        near = (np.sum(two[1].near ** 2) - np.sum(two[0].near ** 2)) / 2e-3
        assert near == pytest.approx(near_slope @ way, abs=1e-3 * np.abs(near_slope).max())


# --- designs


@pytest.fixture(scope="module")
def free() -> PartDesign:
    return design(
        load=LOAD, target=["x=min uz=-8 mm", "x=min ry=-14 deg"], free="5x1x3", symmetric="y"
    )


def test_a_free_gradient_meets_displacement_and_turn_together(free: PartDesign) -> None:
    """Both within the 1 % asked for, in the printed materials; `planner.simulate` agrees."""
    assert [row.printed for row in free.reached] == pytest.approx([-8.0, -14.0], rel=0.01)
    assert free.free is not None
    assert free.free["counts"] == [5, 1, 3]
    seen = planner.simulate(free.plan, fix="x=max", load=LOAD, cell_mm=2.5, steps=1,
                            compare_cells=False)  # fmt: skip
    moved = seen.steps.responses[0].displacement_mm[-1, 2]
    assert moved == pytest.approx(free.reached[0].printed, rel=2e-3)


def test_the_gradient_is_a_table_that_grades_the_part_again(
    free: PartDesign, tmp_path: Path
) -> None:
    folder = free.write(tmp_path / "out")
    table = read_grid_table(folder / "field.vti", array="modulus_MPa")
    assert table.values.shape == (25, 9, 9)
    assert table.first_mm == (0.0, 0.0, 0.0)
    share = read_grid_table(folder / "field.vti", array="position")
    low, high = free.moduli_MPa
    assert np.allclose(table.values, low * (high / low) ** share.values, rtol=1e-5)
    again = planner.grade(
        BEAM, field=f"table: {folder / 'field.vti'}, array=position, from=0, to=1",
        profile=folder / "profile.csv",
    )  # fmt: skip
    plan = planner.read_plan(folder)
    assert [r.material for r in again.regions] == [r.material for r in plan.regions]
    volumes = [r.volume_mm3 for r in plan.regions]  # profile.csv has six digits
    assert [r.volume_mm3 for r in again.regions] == pytest.approx(volumes, rel=1e-4)
    like = planner.grade(BEAM, like=folder)
    assert [r.volume_mm3 for r in like.regions] == pytest.approx(volumes, rel=1e-6)
    softer = planner.grade(BEAM, like=folder, palette="connex3-agilus-vero")
    assert softer.palette.name != plan.palette.name
    digest = hashlib.sha256((folder / "field.vti").read_bytes()).hexdigest()
    assert plan.gradient.field["sha256"] == digest


def test_paraview_opens_the_table(free: PartDesign, tmp_path: Path) -> None:
    vtk = pytest.importorskip("vtkmodules.vtkIOXML")
    file = tmp_path / "field.vti"
    assert free.table is not None
    file.write_bytes(free.table)
    reader = vtk.vtkXMLImageDataReader()
    reader.SetFileName(str(file))
    reader.Update()
    assert reader.GetOutput().GetDimensions() == (25, 9, 9)


@pytest.mark.slow
def test_the_page_shows_the_part_from_rest_to_full_load(tmp_path: Path) -> None:
    fine = block(40.0, 5.0, 5.0, (8, 1, 1))
    file = _stl(tmp_path / "bent.stl", _bent(of=fine.triangles))
    made = design(part=fine, load=LOAD, target=f"shape: {file}", free="5x1x3", steps=2)
    page = planner.plan_page(made)
    assert page == planner.plan_page(made)
    text = re.search(rb'id="data">(.*?)</script>', page, re.DOTALL)
    assert text is not None
    data = json.loads(text[1])
    assert [frame["text"] for frame in data["course"]["frames"]] == ["load 0", "load 0.5", "load 1"]
    printed = len(made.plan.regions)
    assert data["course"]["printed"] == printed
    assert [frame["shape"] for frame in data["course"]["frames"]] == [printed] * 3
    assert len(data["shells"]) == printed + 1
    assert data["course"]["top_mm"] == pytest.approx(made.reached[0].largest, rel=1e-6)
    assert b'id="course-step"' not in planner.plan_page(made.plan)
    moved = made.courses[0].displacement_mm
    assert not moved[0].any()
    assert np.abs(moved[2]).max() > 1.5 * np.abs(moved[1]).max()
    older = page.replace(b'content="planner ', b'content="planner 0.', 1)
    folder = made.write(tmp_path / "out", page=older)
    assert planner.view(folder).read_bytes() == older, "what a plan's folder cannot make again"


def test_the_page_says_what_is_missed(free: PartDesign, tmp_path: Path) -> None:
    """The same from the design and from its folder."""
    short = replace(free, findings=(DesignFinding("target", "the tip is 3 mm short"),))
    page = planner.plan_page(short)
    assert b'<li class="plain">the tip is 3 mm short</li>' in page
    folder = short.write(tmp_path / "out")
    assert planner.view(folder).read_bytes() == page


def test_thin_bands_have_an_error_of_their_own() -> None:
    rows = [(0.0, "Tango"), (0.5, "Tango"), (0.50001, "Vero"), (1.0, "Vero")]
    with pytest.raises(ThinBandError, match="thinner than a layer"):
        planner.grade(BEAM, axis="x", profile=rows)


# --- wanted shapes


def _stl(file: Path, triangles: Array) -> Path:
    corners = np.arange(triangles.size // 3, dtype=np.int32).reshape(-1, 3)
    file.write_bytes(encode_stl(triangles.reshape(-1, 3).astype(np.float32), corners, file.stem))
    return file


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_a_manufactured_shape_is_found_again_from_its_surface(seed: int, tmp_path: Path) -> None:
    """2 % of the longest way are asked for; the true surface is that of other cells."""
    rms, largest, correlation = manufactured(seed, tmp_path, cell_mm=4.0)
    assert largest < 0.02
    assert rms < 0.005
    assert correlation > 0.5


@pytest.mark.slow
def test_a_shape_of_other_triangles_is_come_near_to_by_the_nearest_place(tmp_path: Path) -> None:
    """Of a beam graded evenly and bent: within 2 % of its longest way, and it is told."""
    plan = planner.grade(BEAM, from_="Tango", to="Vero", blend="mix", bands=8, axis="x")
    bent = planner.simulate(plan, fix="x=max", load=LOAD, cell_mm=2.5, steps=1, compare_cells=False)
    file = tmp_path / "bent.stl"
    file.write_bytes(bent.deformed_stl())
    made = design(load=LOAD, target=f"shape: {file}", blend="dither")
    assert any("are not the part's 12" in note for note in made.notes)
    (row,) = made.reached
    assert row.error is not None
    assert row.error < 0.01
    assert made.free is not None


@pytest.mark.slow
def test_a_shape_may_be_wanted_of_some_faces_alone(tmp_path: Path) -> None:
    """The tip is to be where a steeper bend has it, whatever is between."""
    fine = block(40.0, 5.0, 5.0, (16, 2, 2))
    file = _stl(tmp_path / "bent.stl", _bent(of=fine.triangles))
    made = design(part=fine, load=LOAD, target=f"shape: {file} on x<5 weight 2", blend="dither",
                  free="5x1x3")  # fmt: skip
    (row,) = made.reached
    assert row.largest is not None
    assert row.error is not None
    assert row.error < 0.03
    with pytest.raises(PlannerError, match="from the part"):
        design(load=LOAD, target=f"shape: {_stl(tmp_path / 'same.stl', MESH.triangles)}")


def test_a_shape_is_read_in_the_unit_that_the_part_is(tmp_path: Path) -> None:
    """What is the part's own surface in inches too is nowhere away from it."""
    file = _stl(tmp_path / "part.stl", MESH.triangles / 25.4)
    with pytest.raises(PlannerError, match="from the part"):
        design(part=file, unit="inch", load=LOAD, target=f"shape: {file}")


# --- cases with limits, what stands against what


SIDE = LoadCase(fix="x=max", load="x=min: 0,0.1,0 N", limit="x=min uy<5 mm", name="side")


@pytest.mark.slow
def test_a_limit_of_another_case_is_kept() -> None:
    """Even, the square beam would bend to the side as far as down: by 8 mm."""
    made = design(load=LOAD, target="x=min uz=-8 mm", cases=[SIDE], free="5x3x3", blend="dither")
    down, side = made.reached
    assert down.printed == pytest.approx(-8.0, rel=0.01)
    assert side.kind == "<"
    assert abs(side.printed) < 5.0 * 1.01
    assert made.ok or {f.kind for f in made.findings} == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    # The table is straight between an eighth of the controls' distance; steps go by the tolerance.
    ("blend", "off"), [("dither", 0.005), (None, 0.02)],
)  # fmt: skip
def test_a_print_does_what_the_gradient_does(blend: str | None, off: float) -> None:
    """Also where a pull bends the part, so that derivatives foretell little."""
    made = design(([50.0, 8.0, 5.0] * BOX, FACES), fix="x=min", load="x=max: 6,0,0 N",
                  target="x=max uz=1.5 mm", free="6x1x3", cell_mm=6.0, blend=blend,
                  tolerance=0.02)  # fmt: skip
    (row,) = made.reached
    assert row.printed == pytest.approx(row.continuous, rel=off)


@pytest.mark.long
def test_robust_limits_hold_at_the_worst_of_the_interval() -> None:
    given = {"load": LOAD, "target": "x=min uz=-8 mm", "free": "5x3x3", "blend": "dither"}
    side = replace(SIDE, limit="x=min uy<6 mm")
    made = design(**given, cases=[side], robust=True)
    row = made.reached[1]
    assert row.interval is not None
    assert max(np.abs(row.interval)) < 6.0 * 1.03
    assert abs(row.continuous) < 6.0 / 1.1


@pytest.mark.slow
def test_what_stands_against_what_is_told_early_and_at_last() -> None:
    """A profile along the beam, alike across it, bends both ways alike."""
    said: list[str] = []
    made = design(load=LOAD, target=["x=min uz=-8 mm", "x=min rx=20 deg"], cases=[SIDE], axis="x",
                  knots=5, progress=said.append)  # fmt: skip
    assert any("all in the stiffest" in words and "rx=20" in words for words in said)
    assert not made.ok
    told = " ".join(f.message for f in made.findings)
    assert "stands against it" in told
    assert "softest -" in told
    shares = [getattr(words, "done", None) for words in said]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert shares[-1] >= 0.7


# --- interrupted, and gone on with


@pytest.mark.slow
def test_an_interrupted_design_is_a_plan_and_goes_on(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, folder = tmp_path / "beam.stl", tmp_path / "out"
    part.write_bytes(encode_stl(BEAM[0].astype(np.float32), FACES, "beam"))
    arguments = [
        "design", str(part), "--from", "Tango", "--to", "Vero", "--free", "5x1x3", "--fix", "x=max",
        "--load", LOAD, "--target", "x=min uz=-8 mm", "--case", "side; load x=min: 0,0.1,0 N; "
        "limit x=min uy<12 mm", "--cell-mm", "2.5", "--no-page", "-o", str(folder),
    ]  # fmt: skip
    whole = search.evaluate
    calls = 0

    def ended(problem: DesignProblem, values: Array) -> Any:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise KeyboardInterrupt
        return whole(problem, values)

    monkeypatch.setattr(search, "evaluate", ended)
    assert run(arguments) == 130
    out = capsys.readouterr()
    assert "interrupted after" in out.err
    assert "nothing was left behind" not in out.err
    first = json.loads((folder / "design.json").read_bytes())
    assert first["interrupted"] is True
    assert planner.check(folder).ok
    monkeypatch.setattr(search, "evaluate", whole)
    assert run(arguments) == 0
    then = json.loads((folder / "design.json").read_bytes())
    assert then["interrupted"] is False
    assert [row["case"] for row in then["targets"]] == ["case 1", "side"]
    assert then["targets"][0]["printed"] == pytest.approx(-8.0, rel=0.01)
    assert run(arguments) == 2  # done, and not replaced without --force


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"free": "6x3"}, "6x3x3"),
        ({"free": "4x1x1", "axis": "x"}, "not both"),
        ({"symmetric": "y"}, "with `free`"),
        ({"free": "4x1x1", "symmetric": "w"}, "x, y or z"),
        ({"minutes": 1.0}, "not both"),
        ({"minutes": 1e-6, "cell_mm": None}, "give more"),
        ({"target": "x=min rx=3 mm"}, "deg and rad"),
        ({"target": "x=min rx=200 deg"}, "below 180"),
        ({"target": "x=min distance=3 mm"}, "between two places"),
        ({"target": "x=min uz=-3 mm weight 0"}, "above 0"),
        ({"limit": "x=min uy<-1 mm"}, "without its sign"),
        ({"cases": [LoadCase(fix="x=max", load=LOAD, limit="slope<3 /mm")]}, "one limit for all"),
        ({"start": "nowhere.json"}, "nowhere.json"),
    ],
)
def test_bad_input_is_told_in_a_line(options: dict[str, Any], words: str) -> None:
    with pytest.raises(PlannerError) as told:
        design(**{"load": LOAD, "target": "x=min uz=-8 mm", **options})
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_cases_are_read_from_a_line() -> None:
    case = LoadCase.read(
        "side; fix x=max; load x=min: 0,0.1,0 N; limit x=min uy<1 mm; limit x=min uz<2 mm"
    )
    assert case == LoadCase(fix="x=max", load="x=min: 0,0.1,0 N", name="side",
                            limit=("x=min uy<1 mm", "x=min uz<2 mm"))  # fmt: skip
    with pytest.raises(PlannerError, match="did you mean load"):
        LoadCase.read("side; laod x=min: 0,0.1,0 N")
    with pytest.raises(PlannerError, match="did you mean gravity"):
        LoadCase.read("side; gravty -z")
