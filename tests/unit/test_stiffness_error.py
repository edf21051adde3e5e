"""The stiffness error as a check; targets as functions, rows and grades."""

import itertools
import math
import re
from dataclasses import replace

import manifold3d as m3
import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import ArgumentError
from planner.materials.mixtures import TwoPhases
from planner.report.plan_figure import error_words, plan_table

BAR = m3.Manifold.cube([80.0, 20.0, 20.0]).to_mesh()
MESH = (np.asarray(BAR.vert_properties[:, :3]), np.asarray(BAR.tri_verts))
ENDS = {"from_": "Tango", "to": "Vero"}


@pytest.fixture(scope="module")
def moduli() -> dict[str, float]:
    scale = planner.list_materials()
    ids = [material.id for material in scale.palette.materials]
    return dict(zip(ids, scale.moduli_MPa, strict=True))


def _error(plan: planner.Plan) -> float:
    return plan.checks["worst_stiffness_error"].value


def test_nearest_materials_leave_half_of_the_largest_step(moduli) -> None:
    """Half-way between two in the logarithm, either is off by the root of their ratio."""
    plan = planner.grade(MESH, **ENDS)
    ladder = list(moduli.values())
    steps = [b / a for a, b in itertools.pairwise(ladder)]
    check = plan.checks["worst_stiffness_error"]
    assert check.value == pytest.approx(math.sqrt(max(steps)), rel=1e-9)
    assert check.limit == 2.0
    assert plan.ok
    strict = planner.grade(MESH, **ENDS, tolerance=1.5)
    assert not strict.ok
    assert strict.checks["worst_stiffness_error"].limit == 1.5
    # Below 1 it is a share.
    share = planner.grade(MESH, **ENDS, tolerance=0.5)
    assert share.checks == strict.checks


def test_a_coarse_palette_is_a_finding_with_its_remedy() -> None:
    """Two materials a factor of 69 apart: half-way between them either is off by 8.3."""
    palette = planner.load_printer("connex3").palette()
    two = replace(palette, materials=(palette.materials[0], palette.materials[6]))
    plan = planner.grade(MESH, from_="Tango", to="FLX9795", palette=two)
    (finding,) = plan.findings
    assert "a factor of 8.3" in finding.message
    assert "the tolerance, a factor of 2" in finding.message
    assert "with --blend dither" in finding.message


@pytest.mark.parametrize(
    ("field", "low", "high"),
    [("clamp(axis: x; 0.2; 0.7)", 0.2, 0.7), ("min(axis: x; axis: -x)", 0.0, 0.5),
     ("expression: 0.5", 0.5, 0.5)],
)  # fmt: skip
def test_targets_are_those_that_a_field_has_within_the_part(moduli, field, low, high) -> None:
    """One that ends within a band is not held against the rest of it; to 1e-5 of the field."""
    plan = planner.grade(MESH, **ENDS, field=field)
    softest, stiffest = plan.regions[0], plan.regions[-1]
    assert softest.field[0] == pytest.approx(low, abs=1e-5)
    assert stiffest.field[1] == pytest.approx(high, abs=1e-5)
    soft, hard = moduli["TangoPlus"], moduli["VeroWhitePlus"]
    for found, u in ((softest.target_modulus_MPa[0], low), (stiffest.target_modulus_MPa[1], high)):
        assert math.log(found / soft) / math.log(hard / soft) == pytest.approx(u, abs=2e-5)


def test_a_part_that_is_too_soft_alone_is_told_by_a_factor_that_its_table_has_as_a_share() -> None:
    """Bands that begin in their own materials are nowhere too stiff: 1 / 1.71 is 41 % too soft."""
    plan = planner.grade(MESH, from_="FLX9740", to="FLX9760", bands=2)
    assert "stiffness: a factor of 1.71, without --bands a factor of 1.31, " in error_words(plan)
    assert [row["error"] for row in plan_table(plan).rows] == ["-41 .. +0 %"] * 2
    close = planner.grade(MESH, from_="FLX9740", to="FLX9760", blend="dither", cell_mm=2.0)
    assert re.search(r"stiffness: \d\.?\d* %", error_words(close))


def test_coarse_bands_fail_and_the_remedies_keep_their_word(capsys, tmp_path) -> None:
    plan = planner.grade(MESH, **ENDS, bands=2)
    assert not plan.ok
    (finding,) = [f for f in plan.findings if f.kind == "stiffness"]
    assert "a factor of" in finding.message
    promised = plan.stiffness.alternatives
    assert promised["without --bands"] == pytest.approx(_error(planner.grade(MESH, **ENDS)))
    dithered = planner.grade(MESH, **ENDS, blend="dither", cell_mm=0.6)
    # Cells of that size hold their shares to a thousandth; those of 2 mm are off by 1.5 %.
    assert promised["with --blend dither"] == pytest.approx(_error(dithered), rel=1e-3)
    accepted = float(re.search(r"--tolerance (\S+) accepts", finding.message)[1])
    again = planner.grade(MESH, **ENDS, bands=2, tolerance=accepted)
    assert again.checks["worst_stiffness_error"].ok
    part = tmp_path / "bar.stl"
    _write_stl(part)
    common = ["grade", str(part), "--from", "Tango", "--to", "Vero", "--bands", "2", "--dry-run"]
    assert run(common) == 1
    out = capsys.readouterr()
    assert "worst_stiffness_error" in out.out
    assert "with --blend dither" in out.out
    assert finding.message in out.err
    assert run([*common, "--tolerance", str(accepted)]) == 0


@pytest.mark.parametrize(("from_", "to", "blend"), [
    ("0.01MPa", "5MPa", "nearest"), ("Vero", "3GPa", "nearest"), ("Vero", "3GPa", "dither"),
])  # fmt: skip
def test_no_option_mends_a_target_that_no_material_reaches(from_, to, blend) -> None:
    plan = planner.grade(
        MESH, from_=from_, to=to, blend=blend, cell_mm=2.0 if blend == "dither" else None
    )
    assert plan.unreachable
    assert plan.stiffness.alternatives == {}


def test_mixtures_in_bands_do_not_promise_what_nearest_materials_would_leave() -> None:
    plan = planner.grade(MESH, **ENDS, bands=2, blend="mix")
    assert "without --bands" not in plan.stiffness.alternatives


def test_cells_that_miss_their_share_miss_the_stiffness_as_much() -> None:
    """Cells as large as the stretches of the gradient: shares are off by tenths."""
    plan = planner.grade(MESH, **ENDS, blend="dither", cell_mm=4.0)
    for region in plan.regions:
        phases = TwoPhases(*region.blend["moduli_MPa"])
        shares = region.blend["volume_fraction"], region.blend["volume_fraction_wanted"]
        achieved, wanted = map(float, phases.dithered_MPa(shares))
        assert region.error[0] <= achieved / wanted - 1.0 <= region.error[1]
    assert any(min(map(abs, r.error)) > 0.01 for r in plan.regions)


@pytest.mark.parametrize("tolerance", [-0.1, math.nan, 1e9])
def test_a_tolerance_is_a_ratio_or_a_share(tolerance) -> None:
    with pytest.raises(ArgumentError, match="tolerance"):
        planner.grade(MESH, **ENDS, tolerance=tolerance)


def test_grades_have_equal_lengths_and_no_error(moduli) -> None:
    """The thesis' part: one step a material."""
    plan = planner.grade(MESH, **ENDS, profile="grades")
    assert [r.material for r in plan.regions] == list(moduli)
    ends = np.array([r.field for r in plan.regions])
    assert np.diff(ends, axis=1) == pytest.approx(0.1, abs=1e-9)
    assert _error(plan) == pytest.approx(1.0, rel=1e-9)
    back = planner.grade(MESH, from_="FLX9760", to="FLX9740", profile="grades")
    assert [r.material for r in back.regions] == ["FLX9760", "FLX9750", "FLX9740"]
    # Between moduli: to what is nearest to them, and what is off there is told.
    some = planner.grade(MESH, from_="1MPa", to="0.01GPa", profile="grades")
    assert [r.material for r in some.regions] == ["FLX9750", "FLX9760", "FLX9770", "FLX9785"]
    assert some.regions[-1].error == pytest.approx((moduli["FLX9785"] / 10.0 - 1.0,) * 2)
    assert _error(some) == pytest.approx(10.0 / moduli["FLX9785"])
    beyond = planner.grade(MESH, from_="20MPa", to="1MPa", profile="grades")
    assert beyond.regions[0].material == "FLX9795"
    with pytest.raises(ArgumentError, match="two or more"):
        planner.grade(MESH, from_="1MPa", to="1.1MPa", profile="grades")


def test_a_profile_may_be_rows_or_a_function() -> None:
    rows = planner.grade(MESH, profile=[(0, "Tango"), (0.25, "900kPa"), (1, 7)])
    assert rows.gradient.profile["positions"] == [0.0, 0.25, 1.0]
    assert rows.gradient.profile["moduli_MPa"][1:] == [0.9, 7.0]
    whole = planner.grade(MESH, profile=lambda u: 0.5 * 14.0**u)
    ends = planner.grade(MESH, from_=0.5, to=7.0)
    # Both are the same log-linear target, one of them through 257 knots.
    for a, b in zip(whole.regions, ends.regions, strict=True):
        assert a.field == pytest.approx(b.field, abs=1e-9)
    one_by_one = planner.grade(MESH, profile=lambda u: 0.5 * math.pow(14.0, u))
    assert one_by_one.regions == whole.regions


@pytest.mark.parametrize(
    ("profile", "said"),
    [
        (3, "rows of"),
        ([1, 2], "rows of"),
        ([(0, "Tango"), (0.5, "Vero")], "from position 0 to position 1"),
        ([(0, "Tango"), (1, "0.1 parsec")], "parsec"),
        (lambda u: u[:3], "for each"),
        (lambda u: -1.0, "knot 1: modulus_MPa is -1"),
        (lambda u: "stiff", "function"),
        (lambda u: None, "function"),
    ],
)
def test_other_profiles_are_refused(profile, said) -> None:
    with pytest.raises(planner.PlannerError, match=said):
        planner.grade(MESH, profile=profile)


def test_own_targets_take_no_ends() -> None:
    with pytest.raises(ArgumentError, match="leave out"):
        planner.grade(MESH, **ENDS, profile=[(0, 1.0), (1, 2.0)])


def _write_stl(path) -> None:
    triangles = MESH[0][MESH[1]].astype("<f4")
    record = np.zeros(len(triangles), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["v"] = triangles
    path.write_bytes(b"\0" * 80 + np.uint32(len(triangles)).tobytes() + record.tobytes())
