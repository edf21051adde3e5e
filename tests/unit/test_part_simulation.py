"""planner.simulate of a whole part: figures, files, findings, the command line, bad input."""

import csv
import io
import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planner
from benchmarks.interfaces import BOX, FACES
from planner.cli import run
from planner.errors import ArgumentError
from planner.formats.mesh_file import decode_stl
from planner.materials.mixtures import CoefficientModel
from planner.printers import load_printer
from planner.report.loaded_part import summary_words
from planner.simulation import part

PALETTE = load_printer("connex3").palette()
BAR = ([20.0, 4.0, 4.0] * BOX, FACES)
EVENLY = ["x=min: 0,free,free mm", "y=min: free,0,free mm", "z=min: free,free,0 mm"]
"""Supports under which a pulled bar strains alike everywhere."""


def simulate(source: object = BAR, **options: Any) -> planner.PartSimulation:
    given = {"material": "FLX9760", "cell_mm": 4.0, "steps": 2, "compare_cells": False, **options}
    return planner.simulate(source, **{"fix": (), **given})


@pytest.fixture(scope="module")
def pulled() -> planner.PartSimulation:
    return simulate(move=[*EVENLY, "x=max: 2,free,free mm"], steps=4, compare_cells=True)


@pytest.fixture(scope="module")
def bent() -> planner.PartSimulation:
    return simulate(fix="x=min", load="x=max: 0,0,-0.05 N", watch="x>9 and x<11", steps=3)


def test_a_support_on_which_loads_balance_bears_nothing() -> None:
    """Rounding is no force: two loads against each other leave the support 0 in every direction."""
    from planner.report.loaded_part import response_rows

    loads = ["x=max and y>2: 0,0,-0.01 N", "x=max and y<2: 0,0,0.01 N"]
    result = simulate(fix="x=min", load=loads, steps=1)
    (fixed,) = [row for row in response_rows(result) if row[""] == "fix"]
    assert fixed["force N (x y z)"] == "0 0 0"


# --- figures


def test_an_even_pull_is_the_palettes_curve(pulled: planner.PartSimulation) -> None:
    """Force over area is the tensile test's stress, less what a Poisson's ratio of 0.49 gives way.

    Against an incompressible solid the modulus at rest is the same, and at strain 0.1 the stress
    differs by less than 0.01 times the strain: 1e-3. Marlow's table adds 3e-4.
    """
    strain = 2.0 / 20.0 * pulled.steps.share
    material = PALETTE.resolve("FLX9760")
    stress = CoefficientModel(PALETTE).nominal_stress_MPa(material.coordinate, 1.0 + strain)
    np.testing.assert_allclose(pulled.curve.y, 16.0 * stress, rtol=3e-3, atol=1e-12)
    # Supports are springs of 1e4 times a cell's stiffness.
    np.testing.assert_allclose(pulled.curve.x, 2.0 * pulled.steps.share, rtol=1e-4)
    breaks = strain / material.elongation_at_break
    np.testing.assert_allclose(pulled.steps.largest, breaks, rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(
        pulled.steps.strain_over_break, np.outer(breaks, np.ones(len(pulled.surface_coordinate))),
        rtol=1e-3, atol=1e-12,
    )  # fmt: skip
    assert pulled.ok


def test_an_interval_of_an_even_pull_is_the_materials_own(pulled: planner.PartSimulation) -> None:
    """Every place has the same weight: the force is as sure as the modulus is, at its strain."""
    response = pulled.main
    assert response is not None
    assert response.interval is not None
    coordinate = PALETTE.resolve("FLX9760").coordinate
    low, high = CoefficientModel(PALETTE).modulus_interval_MPa(coordinate, 0.1)
    modulus = CoefficientModel(PALETTE).modulus_MPa(coordinate, 0.1)
    figure = response.along_N[-1]
    got = np.log(np.array(response.interval) / figure)
    # Weights over the modulus' logarithm add up to 1 within what 0.49 and the penalty take.
    np.testing.assert_allclose(got, np.log(np.array([low, high]) / modulus), rtol=0.02)


LAYERS = [(0, "Vero"), (0.3, "Vero"), (0.3, "Tango"), (0.6, "Tango"), (0.6, "Vero"), (1, "Vero")]


@pytest.mark.parametrize(
    ("sides", "cell_mm", "gradient"),
    [
        ((20.0, 4.0, 4.0), 2.5, {"axis": "z", "profile": LAYERS, "snap_mm": 0}),
        ((20.0, 3.0, 3.0), 2.0, {"axis": "x", "from_": "Vero", "to": "Tango"}),
    ],
)
def test_the_error_that_is_told_is_that_of_the_cells(
    sides: tuple[float, ...], cell_mm: float, gradient: dict[str, Any]
) -> None:
    """At least what half the cells differ by, and not 5 times it: layers, and a gradient."""
    plan = planner.grade((np.array(sides) * BOX, FACES), **gradient)
    bending = {"fix": "x=min", "load": "x=max: 0,0,-0.001 N", "steps": 1}
    found = planner.simulate(plan, cell_mm=cell_mm, **bending)
    finer = planner.simulate(plan, cell_mm=cell_mm / 2, compare_cells=False, **bending)
    assert found.discretisation is not None
    assert found.main is not None
    assert finer.main is not None
    error = abs(finer.main.along_mm[-1] / found.main.along_mm[-1] - 1.0)
    assert error <= found.discretisation.largest <= 5.0 * error


def test_cells_of_another_size_pull_alike(pulled: planner.PartSimulation) -> None:
    """The field is linear, which cells of any size hold; supports yield by 1e-4 of a cell."""
    assert pulled.discretisation is not None
    assert pulled.discretisation.cell_mm == pytest.approx(6.0)
    assert pulled.discretisation.largest < 2e-3
    assert [error is None for error in pulled.discretisation.errors] == [True] * 3 + [False]


def test_what_nothing_tells_of_the_cells_is_not_called_exact(tmp_path, capsys) -> None:
    """Of gravity without a place that is watched, and of a load under which nothing settles."""
    options: dict[str, Any] = {"compare_cells": True, "steps": 1, "cell_mm": 2.0}
    weight = simulate(fix="x=min", gravity="-z", **options)
    assert weight.discretisation is not None
    assert weight.discretisation.largest is None
    (words,) = [w for w in summary_words(weight) if "cells" in w]
    assert words == "how far figures depend on the cells is not told: watch a place that moves"
    watched = simulate(fix="x=min", gravity="-z", watch="x=max", **options)
    assert watched.discretisation is not None
    assert 0.0 < (watched.discretisation.largest or 0.0) < 0.2
    torn = simulate(fix="x=min", load="x=max: 0,0,-5000 N", **options)
    assert torn.steps.share[-1] == 0.0
    assert torn.discretisation is None
    assert "take smaller cells or more steps" in torn.findings[-1].message


def test_what_symmetry_holds_in_place_tells_nothing_of_the_cells() -> None:
    """The faces of a cavity between held ends move apart, on the mean by nothing: no error is its.

    That of the side that is watched is told alone.
    """
    walls = (np.concatenate([10 * BOX, 2 + 6 * BOX]), np.concatenate([FACES, FACES[:, ::-1] + 8]))
    found = simulate(
        walls, fix=["x=min", "x=max"], pressure="cavity: 1 kPa", watch="y=max uy", cell_mm=1.6,
        steps=1, compare_cells=True,
    ).discretisation  # fmt: skip
    assert found is not None
    cavity, *_, watched = found.errors
    assert cavity is None
    assert found.largest == watched
    assert 0.0 < watched < 0.3


def test_forces_are_in_balance_and_work_is_stored(bent: planner.PartSimulation) -> None:
    load, held, watched = bent.steps.responses
    assert [load.kind, held.kind, watched.kind] == ["load", "fix", "watch"]
    np.testing.assert_allclose(load.force_N + held.force_N, 0.0, atol=1e-7)
    work = np.trapezoid(load.along_N, load.along_mm) if hasattr(np, "trapezoid") else np.nan
    assert bent.steps.energy_mJ[-1] == pytest.approx(work, rel=0.01)  # three straight steps
    assert 0.2 < watched.along_mm[-1] / load.along_mm[-1] < 0.4  # a cantilever's middle: 5/16
    moved, place = bent.farthest
    assert place[0] == 20.0
    assert np.linalg.norm(moved) >= load.along_mm[-1]
    assert load.stiffness_N_mm == pytest.approx(0.05 / load.along_mm[-1])


@pytest.mark.parametrize("made_of", ["Tango", "Vero", "layers"])
def test_what_a_small_load_stores_is_its_work(made_of: str) -> None:
    """Half of force times way: also where layers of 15 to 1000 times the stiffness meet in cells.

    What holds cut cells and supports, which is not counted, has 1e-4 of it at most; what is not
    linear in a strain of 1e-4 as much. Springs between layers have 1e-3.
    """
    material, source = {"material": made_of}, BAR
    if made_of == "layers":
        flat = ([9.0, 8.0, 2.3] * BOX, FACES)
        source = planner.grade(flat, from_="Vero", to="Tango", axis="z", bands=3)
        material = {"material": None}
    given = {"fix": "z=min", "load": "z=max: 0,0,0.01 N", "cell_mm": 1.3, "steps": 1, **material}
    result = simulate(source, **given)
    load = result.steps.responses[0]
    work = 0.5 * load.along_N[-1] * load.along_mm[-1]
    assert result.steps.energy_mJ[-1] == pytest.approx(work, rel=2e-4)


def test_weight_is_carried_by_the_support() -> None:
    result = simulate(fix="z=min", gravity="-z", steps=1)
    (held,) = result.steps.responses
    grams = PALETTE.resolve("FLX9760").density_g_cm3 * 20 * 4 * 4 * 1e-3
    assert held.force_N[-1] == pytest.approx([0.0, 0.0, grams * 9.80665e-3], abs=1e-9)
    assert result.main is None
    assert result.curve.y_label == "share of the load"


def test_a_graded_part_is_as_stiff_as_its_bar() -> None:
    """Sections stay nearly plane where bands are long and grades alike: within 2 %.

    The bar misses what neighbouring bands hold each other from narrowing by, so it is softer.
    """
    plan = planner.grade(
        ([60.0, 4.0, 4.0] * BOX, FACES), from_="FLX9750", to="FLX9770", axis="x", name="bar"
    )
    whole = planner.simulate(
        plan, fix=(), move=[*EVENLY, "x=max: 3,free,free mm"], cell_mm=2.0, steps=1,
        compare_cells=False,
    )  # fmt: skip
    bar = planner.simulate(plan, to_strain=0.05, steps=1)
    assert 1.0 < whole.curve.y[-1] / bar.force_N[-1] < 1.02
    assert whole.name == bar.name


# --- moments, several cases, several figures


LONG = ([40.0, 4.0, 4.0] * BOX, FACES)


def test_a_moment_bends_and_twists_as_a_beam() -> None:
    """M L / E I, and T L / (0.1406 G a⁴) (Timoshenko).

    Cells of half the width are 1 % off in shear; the clamp takes a tenth of the width off the 40.
    """
    M = 0.02
    case = planner.LoadCase(fix="x=min", moment=f"x=max: 0,{M},0 N mm")
    twist = planner.LoadCase(fix="x=min", moment=f"x=max: {M},0,0 N mm")
    results = planner.simulate_part(
        LONG, [case, twist], material="FLX9760", cell_mm=2.0, steps=1, compare_cells=False
    )
    E = CoefficientModel(PALETTE).modulus_MPa(PALETTE.resolve("FLX9760").coordinate, 1e-4)
    bent, twisted = (result.steps.responses[0] for result in results)
    assert bent.turn_deg[-1, 1] == pytest.approx(np.degrees(M * 40 / (E * 4**4 / 12)), rel=0.01)
    G = E / (2.0 * 1.49)
    round_ = np.degrees(M * 40.0 / (0.1406 * G * 4.0**4))
    assert twisted.turn_deg[-1, 0] == pytest.approx(round_, rel=0.02)
    for response, result in zip((bent, twisted), results, strict=True):
        assert response.moment_N_mm[-1] @ response.direction == pytest.approx(M, rel=0.01)
        assert np.abs(result.steps.responses[1].force_N[-1]).max() < 1e-7  # a moment is no force
        low, high = sorted(response.interval)
        assert low < response.turn_deg[-1] @ response.direction < high
    assert results[0].curve.x_label == "turn of x=max, °"
    assert results[0].curve.y[-1] == pytest.approx(M, rel=0.01)


def test_what_a_load_moves_goes_its_way() -> None:
    """Rubber between skins whose interval is wider than what they bend: all of it is positive.

    Readings of Vero's modulus reach 6 times the palette's, so that less than a third may be left.
    """
    profile = [
        (0, "Vero"),
        (0.4, "Vero"),
        (0.4, "Tango"),
        (0.6, "Tango"),
        (0.6, "Vero"),
        (1, "Vero"),
    ]
    plan = planner.grade(BAR, axis="z", profile=profile, snap_mm=0, name="sandwich")
    load = simulate(plan, material=None, fix="x=min", load="x=max: 0,0,-0.01 N", steps=1).main
    assert load is not None
    assert load.interval is not None
    low, high = np.array(load.interval) / load.along_mm[-1]
    assert 0.05 < low < 0.35
    assert 1.2 < high < 2.0


def test_a_point_under_the_load_has_the_loads_interval() -> None:
    """The same displacement twice, of a grade whose modulus is known to a factor of three."""
    found = simulate(
        BAR, material="Vero", fix="x=min", load="x=max: 0,0,-0.01 N", watch="x=max uz", steps=1
    ).steps.responses
    load, tip = (next(one for one in found if one.kind == kind) for kind in ("load", "watch"))
    assert load.interval is not None
    assert tip.interval is not None
    low, high = load.interval
    assert 0.0 < low < high
    assert tip.interval == pytest.approx((-high, -low), rel=1e-6)


def test_loads_that_cancel_have_an_interval_all_the_same() -> None:
    """A force and the moment that brings its end back, but for a thousandth."""
    alone = simulate(BAR, fix="x=min", load="x=max: 0,0,-0.001 N", steps=1).main
    turned = simulate(BAR, fix="x=min", moment="x=max: 0,0.01,0 N mm", steps=1, watch="x=max uz")
    back = float(turned.steps.responses[-1].displacement_mm[-1, 2])
    moment = -0.01 * (alone.along_mm[-1] / back) * 1.001
    both = simulate(
        BAR, fix="x=min", load="x=max: 0,0,-0.001 N", moment=f"x=max: 0,{-moment:.9g},0 N mm",
        steps=1,
    ).main  # fmt: skip
    assert both.interval is not None
    low, high = both.interval
    assert low < both.along_mm[-1] < high
    assert max(abs(low), high) < alone.along_mm[-1]


def test_a_moments_interval_is_that_of_the_stiffness() -> None:
    """A small turn goes with 1 / E of one material; so do its ends."""
    result = simulate(LONG, fix="x=min", moment="x=max: 0,0.1,0 N mm", steps=1)
    response = result.main
    low, high = CoefficientModel(PALETTE).modulus_interval_MPa(
        PALETTE.resolve("FLX9760").coordinate, 0.001
    )
    E = CoefficientModel(PALETTE).modulus_MPa(PALETTE.resolve("FLX9760").coordinate, 0.001)
    figure = response.turn_deg[-1, 1]
    assert response.interval == pytest.approx((figure * E / high, figure * E / low), rel=0.02)


def test_what_a_turned_face_has_left_of_a_moment_is_told() -> None:
    """Tractions that keep their direction have the cosine of the turn for their arm.

    They stretch the end by 5 % besides: M z / (E I).
    """
    result = simulate(LONG, fix="x=min", moment="x=max: 0,1,0 N mm", steps=2)
    response = result.main
    turn = np.radians(response.turn_deg[-1, 1])
    assert turn > 0.4
    left = response.moment_N_mm[-1, 1]
    assert left == pytest.approx(np.cos(turn), rel=0.05)
    assert any(f"{left:.3g} of 1 N mm are left" in note for note in result.notes)


HELD = {"fix": "x=min", "watch": "x>9 and x<11 uz"}
CASES = [
    planner.LoadCase(name="down", load="x=max: 0,0,-0.05 N", **HELD),
    planner.LoadCase(name="pull", load="x=max: 0.5,0,0 N", target="x=max ux=1 mm", **HELD),
]


@pytest.fixture(scope="module")
def both() -> tuple[planner.PartSimulation, ...]:
    return planner.simulate_part(BAR, CASES, material="FLX9760", cell_mm=4.0, steps=2)


def test_cases_together_are_each_alone(both: tuple[planner.PartSimulation, ...]) -> None:
    """They share the factor of the body at rest, which is that of each: the same bytes."""
    for case, one in zip(CASES, both, strict=True):
        (alone,) = planner.simulate_part(BAR, case, material="FLX9760", cell_mm=4.0, steps=2)
        assert one.json() == alone.json()
    assert [one.case for one in both] == ["down", "pull"]
    assert repr(both[1]).startswith("<PartSimulation part, pull: ")
    assert [r.selector for r in both[1].steps.responses][2:] == ["x>9 and x<11 uz", "x=max ux"]


def test_one_factor_serves_all_cases_of_a_body_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small loads, with which cells are compared, take one factor on each size of cells."""
    from planner.simulation import solid

    made: list[int] = []
    factor = solid.factor

    def counted(analysis: Any, *given: Any, **more: Any) -> Any:
        made.append(len(analysis.order))
        return factor(analysis, *given, **more)

    monkeypatch.setattr(solid, "factor", counted)
    cases = [planner.LoadCase(fix="x=min", load=f"x=max: 0,0,-{k} mN") for k in (1, 2, 3)]
    said: list[str] = []
    results = planner.simulate_part(
        BAR, cases, material="FLX9760", cell_mm=4.0, steps=1, progress=said.append
    )
    fine, coarse = len(results[0].cells.node_mm), made[-1]
    assert made.count(coarse) == 1
    # One is for the first iteration of each, and for the comparison.
    assert made.count(fine) == sum("iteration" in words for words in said) - 2


def test_figures_of_the_same_faces_are_told_along_axes() -> None:
    watch = ["x=max", "x=max ux", "x=max uz", "x=max uz"]
    result = simulate(fix="x=min", load="x=max: 0,0,-0.05 N", watch=watch, steps=1)
    load, _, free, ux, uz = result.steps.responses
    np.testing.assert_array_equal(ux.direction, [1.0, 0.0, 0.0])
    assert (free.selector, uz.selector) == ("x=max", "x=max uz")
    assert uz.along_mm[-1] == load.displacement_mm[-1, 2]
    assert sorted(uz.interval) == pytest.approx(sorted(-end for end in load.interval))


@pytest.mark.parametrize(("watch", "says"), [
    ("x=min", "`watch` x=min: all of its faces are held by supports (x=min)"),
    ("x=min uz", "are held along z by supports (x=min)"),
    ("x=max ux", "are held along x by supports (x=max)"),
])  # fmt: skip
def test_faces_whose_displacement_is_given_are_not_watched(watch: str, says: str) -> None:
    with pytest.raises(ArgumentError, match=re.escape(says)):
        simulate(fix="x=min", move="x=max: 1,free,free mm", watch=watch)


@pytest.mark.parametrize(("cases", "says"), [(3, " 3: give a LoadCase"), ((), ": there is none")])
def test_what_is_no_load_case_is_told(cases: Any, says: str) -> None:
    with pytest.raises(planner.PlannerError, match=f"^`cases`{says}"):
        planner.simulate_part("no.stl", cases, material="FLX9760")


def test_the_page_holds_all_cases(both: tuple[planner.PartSimulation, ...]) -> None:
    page = planner.part_page(both).decode()
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1])  # type: ignore[index]
    assert [words.split(":")[0] for words in data["steps"]] == [
        f"{case}, load {share}" for case in ("down", "pull") for share in ("0", "0.5", "1")
    ]
    assert [f'data-step="{k}"' in page for k in range(7)] == [True] * 6 + [False]
    assert "Load curve: pull" in page
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))


# --- findings


def test_a_break_is_found_with_its_place_and_load() -> None:
    material = PALETTE.resolve("FLX9795")
    end = 1.5 * material.elongation_at_break * 20.0
    result = simulate(material="FLX9795", move=[*EVENLY, f"x=max: {end},free,free mm"], steps=6)
    (found,) = result.findings
    assert found.kind == "break"
    assert found.load == pytest.approx(2.0 / 3.0, rel=0.01)
    assert found.message.startswith("FLX9795 at (")
    assert "0.66" in found.message or "0.67" in found.message
    assert not result.ok


def test_a_balloon_that_is_inflated_without_end_is_told() -> None:
    """A soft hollow cube: what is before is given, with the place; the command's code is 1."""
    walls = (np.concatenate([10 * BOX, 2 + 6 * BOX]), np.concatenate([FACES, FACES[:, ::-1] + 8]))
    given = {"material": "Tango", "fix": "x=min", "watch": "x=max ux", "cell_mm": 5.0}
    result = simulate(walls, pressure="cavity: 380 kPa", steps=8, **given)
    before = simulate(walls, pressure=f"cavity: {380 * result.steps.share[-1]} kPa", **given)
    # The interval is that of the last step, which the failed one has taken nothing from; both are
    # settled to a few millionths, as a closed void's balance has no tangent.
    assert result.main.interval == pytest.approx(before.main.interval, rel=1e-5)
    (found,) = result.findings
    assert found.kind == "stopped"
    assert found.place_mm is not None
    # Cells of 3.4 and 2.5 mm say 0.234; with wall and corner in one piece it was 0.391.
    assert "loses stability at 0.25 of the load near (" in found.message
    np.testing.assert_allclose(result.steps.share, [0.0, 0.125, 0.25])
    assert found.load == 0.25
    assert result.curve.y[-1] == pytest.approx(95.0)  # kPa
    assert b"stopped" in result.json()


def test_what_is_before_the_loss_of_stability_is_given() -> None:
    """A column under 1.5 times its critical load in one step, halved down to 1/64 of it."""
    column = {"fix": "x=min", "load": "x=max: -0.09,0,0 N", "steps": 1}
    result = simulate(([40.0, 4.0, 4.0] * BOX, FACES), **column)
    assert result.steps.lost is not None
    assert result.steps.share[-1] == result.steps.lost.share == pytest.approx(2.0 / 3.0, abs=1 / 64)
    load, held = result.steps.responses
    np.testing.assert_allclose(load.force_N[-1] + held.force_N[-1], 0.0, atol=1e-7)
    assert load.force_N[-1, 0] == pytest.approx(-0.09 * result.steps.share[-1])
    assert load.interval is not None


def test_a_step_that_comes_to_just_beyond_the_loss_of_stability_is_told() -> None:
    """Where the last factor was positive, and that of the state is not: within 1e-3 of the load."""
    source = ([40.0, 4.0, 4.0] * BOX, FACES)

    def pushed(newtons: float, steps: int) -> planner.PartSimulation:
        return simulate(source, fix="x=min", load=f"x=max: {-newtons},0,0 N", steps=steps)

    low, high = 0.05, 0.07
    for _ in range(11):  # to 1e-5
        middle = 0.5 * (low + high)
        low, high = (middle, high) if pushed(middle, 1).ok else (low, middle)
    beyond = pushed(2.0 * (high + 1e-4 * high), 2)
    assert [finding.kind for finding in beyond.findings] == ["stopped"]


def test_a_load_that_nothing_holds_is_told() -> None:
    """A column under a thousand times the force that it carries: the result is that at rest."""
    result = simulate(([40.0, 2.0, 2.0] * BOX, FACES), fix="x=min", load="x=max: -3,0,0 N",
                      steps=1, material="Tango", compare_cells=True)  # fmt: skip
    (found,) = result.findings
    assert "no equilibrium is found under the least load" in found.message
    assert len(result.steps.share) == 1
    assert "<PartSimulation" in repr(result)
    assert planner.part_page(result)
    assert planner.simulation_figure(result)
    assert result._repr_html_()


# --- the value and its files


def test_the_document_csv_and_line_say_the_same(bent: planner.PartSimulation) -> None:
    document = json.loads(bent.json())
    assert document["schema"] == 1
    assert document["cells"]["volume_mm3"] == pytest.approx(320.0, rel=1e-3)
    rows = list(csv.DictReader(io.StringIO(bent.csv().decode())))
    assert len(rows) == len(document["share"]) == 4
    last = document["responses"][0]["displacement_mm"][-1]
    assert [float(rows[-1][f"load1_{axis}_mm"]) for axis in "xyz"] == pytest.approx(last)
    assert "watch3_z_mm" in rows[0]
    assert "watch3_z_N" not in rows[0]
    assert repr(bent) == (
        f"<PartSimulation part: {bent.curve.x[-1]:.4g} mm at 0.05 N, 3 steps; ok>"
    )
    html = bent._repr_html_()
    assert "<svg" in html
    assert "cells of" in html


def test_the_deformed_surface_is_where_vertices_went(bent: planner.PartSimulation) -> None:
    triangles = decode_stl(bent.deformed_stl(), "bent.stl")
    moved = bent.cells.surface.vertices + bent.steps.displacement_mm[-1]
    np.testing.assert_allclose(triangles, moved[bent.cells.surface.faces], atol=1e-5)  # float32
    rest = decode_stl(bent.deformed_stl(0), "rest.stl")
    assert rest.max() == pytest.approx(20.0)
    assert b"displacement_mm" in bent.vtu()


def test_the_figure_shows_curve_band_and_break(
    bent: planner.PartSimulation, pulled: planner.PartSimulation
) -> None:
    for result in (bent, pulled):
        figure = planner.simulation_figure(result)
        root = ET.fromstring(figure)
        assert root.tag.endswith("svg")
        assert b"band: 95 % of prints" in figure
        assert b"cross: break" not in figure


def test_the_page_holds_every_step(bent: planner.PartSimulation) -> None:
    page = planner.part_page(bent).decode()
    assert not re.search(r'(src|href)="(?!#)', page)
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1])  # type: ignore[index]
    assert len(data["steps"]) == 4
    assert len(data["scale"]) == 256
    assert data["top"] < 1.0
    packed = re.search(r'id="steps">(.*?)</script>', page)[1]  # type: ignore[index]
    stride = -(-7 * data["shells"][0]["points"] // 4) * 4
    assert len(packed) == -(-4 * stride // 3) * 4


# --- the command line


@pytest.fixture
def bar_stl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    from planner.formats.mesh_file import encode_stl

    monkeypatch.chdir(tmp_path)
    vertices, faces = BAR
    Path("bar.stl").write_bytes(encode_stl(vertices.astype(np.float32), faces, "bar, mm"))
    return tmp_path


OPTIONS = "simulate bar.stl --material FLX9760 --cell-mm 4 --steps 2 --fix x=min"


def command(text: str, *more: str) -> int:
    return run([*text.split(), *more])


def test_the_command_writes_what_it_is_asked_for(bar_stl: Path, capsys: Any) -> None:
    files = "--page a.html --figure a.svg --deformed a.stl --vtu a.vtu"
    load = ("--load", "x=max: 0,0,-50 mN", "--watch", "x>9 and x<11")
    assert command(f"{OPTIONS} -o a.csv {files}", *load) == 0
    shown = capsys.readouterr()
    assert all(f"wrote a.{end}" in shown.out for end in ("csv", "html", "svg", "stl", "vtu"))
    for words in (
        "displacement of x=max, mm",
        "95 % interval",
        "farthest",
        "the whole load",
        "largest strain over elongation at break:",
        "as two solutions in cells of 6 mm tell",
    ):
        assert words in shown.out
    assert "the palette's laws are of tension" in shown.err
    assert command(f"{OPTIONS} -o a.csv {files}", *load) == 2  # they are there
    assert command(f"{OPTIONS} -o a.csv --force -q", *load) == 0
    capsys.readouterr()
    assert command(f"{OPTIONS} --json --no-compare-cells", *load) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["discretisation"] is None
    assert document["source"] == "bar.stl"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("--load|x=max: 0,0,-1", "the unit is missing"),
        ("--load|x<0.0: 0,0,-1 N", "--load x<0.0 catches no face: the part's x goes from 0 to 20"),
        ("--pressure|cavity: 20 kPa", "the part has no cavity"),
        ("--load|x=max: 0,0,-1 N|--to-strain|0.1", "--to-strain 0.1: it is of a bar"),
        ("--load|x=max: 0,0,-1 N|--between|1:2", "--between 1:2: it is of a bar"),
        ("--load|x=max: 0,0,-1 N|--field|f.csv", "--field f.csv: it is of a bar"),
        ("--load|x=max: 0,0,-1 N|--cell|30", "--cell 30: the part is 20 x 4 x 4 mm"),
        ("--load|x=max: 0,0,-1 N|--cell|0", "--cell 0: it must be above 0"),
        ("--load|x=max: 0,0,-1 N|--steps|0", "--steps 0: it must be a whole number"),
        ("--load|x=max: 0,0,-1 N|--level|1", "--level 1: it must be between 0 and 1"),
        ("--load|x=max: 0,0,-1 N|--page|a.htm", "--page a.htm: its ending must be .html"),
        ("--load|x=max: 0,0,-1 N|-o|a.txt", "its ending must be .csv or .json"),
        ("", "nothing loads the part"),
    ],
)
def test_bad_input_of_the_command_is_told(
    bar_stl: Path, capsys: Any, options: str, says: str
) -> None:
    assert command(OPTIONS, *filter(None, options.split("|"))) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("simulate bar.stl --material FLX9760", "--material FLX9760: it is of a whole part; say"),
        ("simulate bar.stl --page a.html", "--page a.html: it is of a whole part; say"),
        ("simulate bar.stl", "say how a mesh is held and loaded with --fix and --load"),
        ("simulate bar.stl --gravity -z", "--material is missing"),
        ("simulate bar.stl --gravity -z --material FLX9760", "nothing holds the part"),
    ],
)
def test_a_bar_and_a_whole_part_are_told_apart(
    bar_stl: Path, capsys: Any, text: str, says: str
) -> None:
    assert command(text) == 2
    assert says in capsys.readouterr().err


CASE_FILE = """
[[case]]
name = "down"
fix = "x=min"
load = "x=max: 0,0,-50 mN"
target = "x=max uz=-1 mm"
[[case]]
fix = ["x=min"]
gravity = "-z"
moment = "x=max: 0,0.1,0 N mm"
"""


def test_the_command_takes_a_file_of_cases(bar_stl: Path, capsys: Any) -> None:
    Path("cases.toml").write_text(CASE_FILE)
    words = "simulate bar.stl --material FLX9760 --cell 4 --steps 1 --cases cases.toml"
    assert command(f"{words} --json") == 0
    document = json.loads(capsys.readouterr().out)
    assert [case["case"] for case in document["cases"]] == ["down", "case 2"]
    assert [r["kind"] for r in document["cases"][1]["responses"]] == ["moment", "fix"]
    files = "-o a.csv --figure a.svg --deformed a.stl --vtu a.vtu --page a.html"
    assert command(f"{words} {files}") == 0
    shown = capsys.readouterr().out
    assert "bar.stl, down: " in shown
    assert "bar.stl, case 2: " in shown
    assert "x=max uz" in shown
    assert re.search(r"moment +x=max +0 \S+ 0 ° +0 0\.\d+ 0 N mm", shown)
    made = {path.name for path in Path().iterdir()} - {"bar.stl", "cases.toml"}
    ends = ("csv", "svg", "stl", "vtu")
    assert made == {"a.html", *(f"a-{k}.{end}" for k in (1, 2) for end in ends)}
    assert "moment1_y_N_mm" in Path("a-2.csv").read_text().splitlines()[0]
    assert command(f"{words} --figure a.svg") == 2  # a-1.svg is there
    assert "a-1.svg" in capsys.readouterr().err
    Path("cases.toml").write_text(CASE_FILE.replace('moment = "x=max', 'moment = "x=99'))
    assert command(words) == 2
    assert "case 2: --moment x=99 catches no face" in capsys.readouterr().err
    Path("cases.toml").write_text(CASE_FILE.replace("gravity", 'name = "down"\ngravity'))
    assert command(words) == 2
    assert "'down' names two; give each case its own name" in capsys.readouterr().err


def test_cells_that_do_not_fit_are_refused_with_the_finest_that_do() -> None:
    """Whatever their size; and what is advised is taken."""
    from planner.mesh.part import open_part

    surface = open_part(BAR, unit=None).mesh
    for edge in (0.05, 0.01, 1e-4):
        with pytest.raises(ArgumentError, match="the finest cells that fit are of") as told:
            part.check_effort(surface, edge)
        finest = float(re.search(r"fit are of (\S+) mm", str(told.value))[1])  # type: ignore[index]
        assert re.match("about .* GB of memory and ", part.check_effort(surface, finest))


@pytest.mark.parametrize("cell_mm", [1e300, 1e160, 1e-300])
def test_cells_with_which_one_cannot_reckon_are_refused(cell_mm: float) -> None:
    """Their volume is no double."""
    with pytest.raises(ArgumentError, match=r"`cell_mm` 1e.*: it must be between 1e-30 and 1e\+30"):
        simulate(fix="x=min", gravity="-z", cell_mm=cell_mm)
    with pytest.raises(ArgumentError, match=r"`cell_mm` 1e.*: it must be between 1e-30 and 1e\+30"):
        planner.export(BAR, material="Tango", to="vtu", cell_mm=cell_mm)


def test_a_load_beyond_all_bearing_is_a_finding() -> None:
    """The third power of what it would move is no double."""
    result = simulate(fix="x=min", load="x=max: 1e150,0,0 N", steps=1)
    assert [finding.kind for finding in result.findings] == ["stopped"]


def test_what_cells_take_is_foretold(samples: Path) -> None:
    """Of walls of about a cell: within a fifth of the cells, and half of the memory."""
    from planner.mesh.part import open_part
    from planner.simulation.cut_cells import cut_cells
    from planner.simulation.sparse_cholesky import analyse

    surface = open_part(samples / "finger.stl", unit=None).mesh
    cells = cut_cells(surface, 2.2)
    analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
    needed = analysis.factor_bytes + analysis.work_bytes + 8 * 6 * 27**2 * len(cells.nodes)
    found = part._effort(surface, np.array([2.2]), factors=1, solutions=1)
    assert found[0][0] == pytest.approx(len(cells.nodes), rel=0.2)
    assert found[1][0] == pytest.approx(3 * len(cells.node_mm), rel=0.2)
    assert 0.96 < found[2][0] / needed < 1.5


def test_more_memory_than_there_is_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is foretold, before anything is cut."""
    read: Callable[..., str] = Path.read_text

    def text(path: Path, **options: Any) -> str:
        return "MemAvailable: 10 kB" if str(path) == "/proc/meminfo" else read(path, **options)

    monkeypatch.setattr(part.Path, "read_text", text)
    with pytest.raises(
        ArgumentError,
        match=r"`cell_mm` 4: about \d+ equations take .* GB of memory, and .* none fit",
    ):
        simulate(fix="x=min", gravity="-z")


def test_progress_tells_stages_and_residuals() -> None:
    stages: list[str] = []
    simulate(fix="x=min", load="x=max: 0,0,-0.01 N", steps=1, progress=stages.append)
    assert stages[0] == "reading the part"
    words = r"load 1: iteration \d+, residual \d\.\de-\d\d; all takes about .* 1 minute"
    assert any(re.fullmatch(words, stage) for stage in stages)


def test_what_is_known_to_take_more_takes_longer() -> None:
    """A plan's regions have cells of their own, which take memory and time alike."""
    from planner.mesh.part import open_part

    surface = open_part(BAR, unit=None).mesh
    _, _, memory, seconds = part._effort(surface, np.array([0.5]), factors=1, solutions=60)
    known = {"factors": 1, "solutions": 60, "known_bytes": 8.0 * float(memory[0])}
    minutes = int(part.check_effort(surface, 0.5, **known).split()[-2])  # type: ignore[arg-type]
    assert minutes == np.ceil(8.0 * seconds[0] / 60.0) > np.ceil(seconds[0] / 60.0)


@pytest.mark.slow
def test_a_pressure_within_a_closed_void_pushes_no_part_as_a_whole() -> None:
    """Nor bends one that is alike on both sides, whatever cells it is cut into."""
    hollow = [20.0, 6.0, 6.0] * BOX, [14.0, 3.0, 3.0] * BOX + [3.0, 1.5, 1.5]
    corners, faces = np.concatenate(hollow), np.concatenate([FACES, FACES[:, ::-1] + len(BOX)])
    result, *_ = planner.simulate_part(
        (corners, faces), planner.LoadCase(fix="x=min", pressure="cavity: 20 kPa", watch="x=max"),
        material="TangoPlus", cell_mm=1.7, steps=1, compare_cells=False,
    )  # fmt: skip
    pushed, watched = result.steps.responses[1:3]
    assert np.abs(pushed.force_N[-1]).max() < 1e-9
    along, *aside = watched.displacement_mm[-1]
    assert np.abs(aside).max() < 0.05 * along  # of half the length a bend is half as large
