"""Cuts move off faces that lie alongside them, by little, and only where that helps."""

import manifold3d as m3
import numpy as np
import pytest

import planner
from planner.errors import ArgumentError
from planner.printers import load_printer

ENDS = {"from_": "Tango", "to": "Vero", "axis": "x"}
WALL_MM, FEATURE_MM = 0.6, 0.42  # of the Connex3


def _stepped(at_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """A bar of 80 mm whose section grows at one place: a face alongside the cuts across x."""
    solid = m3.Manifold.cube([80.0, 10.0, 10.0])
    solid += m3.Manifold.cube([80.0 - at_mm, 20.0, 10.0]).translate([at_mm, 0.0, 0.0])
    mesh = solid.to_mesh()
    return np.asarray(mesh.vert_properties[:, :3]), np.asarray(mesh.tri_verts)


@pytest.fixture(scope="module")
def cut_mm() -> float:
    """Where a plain bar of 80 mm is cut for the third time."""
    return planner.grade(_stepped(5.0), **ENDS, snap_mm=0).regions[2].field[1] * 80.0


@pytest.mark.parametrize("beside_mm", [0.05, 0.15, 0.25])
def test_a_sliver_beside_a_step_is_gone(cut_mm, beside_mm) -> None:
    """The cut goes onto the step, or as far from it as the smallest feature, if that is nearer."""
    part = _stepped(cut_mm - beside_mm)
    as_asked = planner.grade(part, **ENDS, snap_mm=0)
    assert as_asked.gradient.snap is None
    plan = planner.grade(part, **ENDS)
    (moved,) = plan.gradient.snap["moved"]
    # Steps of the search are 1/40 of half the minimum wall.
    step = WALL_MM / 2.0 / 40.0
    assert moved["by_mm"] == pytest.approx(min(beside_mm, FEATURE_MM - beside_mm), abs=1.01 * step)
    assert plan.regions[2].field[1] == moved["to"]
    assert plan.ok
    # The cost: what the target rises over that little.
    before, after = (p.checks["worst_stiffness_error"].value for p in (as_asked, plan))
    slope = np.log(as_asked.regions[-1].target_modulus_MPa[1] / as_asked.regions[0].modulus_MPa)
    assert after <= before * np.exp(slope * moved["by_mm"] / 80.0) * (1.0 + 1e-9)
    assert plan.stiffness.alternatives.get("with --snap 0", after) == pytest.approx(before)


def test_a_cut_where_nothing_lies_alongside_stays(cut_mm) -> None:
    for beside_mm in (0.0, 0.43, -0.05, 2.0):  # on the step, far enough, on its other side
        plan = planner.grade(_stepped(cut_mm - beside_mm), **ENDS)
        assert plan.gradient.snap is None, beside_mm


def test_a_step_down_has_its_layer_on_the_other_side(cut_mm) -> None:
    vertices, faces = _stepped(80.0 - (cut_mm + 0.1))
    mirrored = vertices * [-1.0, 1.0, 1.0] + [80.0, 0.0, 0.0], faces[:, ::-1]
    plan = planner.grade(mirrored, **ENDS)
    (moved,) = plan.gradient.snap["moved"]
    assert moved["to"] > moved["field"]


def test_a_skin_along_a_curved_field_is_thickened() -> None:
    """From the surface inwards, the first cut may lie too near below the whole skin."""
    ball = m3.Manifold.sphere(12.0, 96).to_mesh()
    part = np.asarray(ball.vert_properties[:, :3]), np.asarray(ball.tri_verts)
    rows = [(0, "Tango"), (0.02, "Tango"), (0.02, "FLX9760"), (1, "FLX9760")]
    wish = {"field": "distance: surface, to=11", "profile": rows, "pitch_mm": 0.5}
    thin = planner.grade(part, **wish, snap_mm=0)
    assert thin.regions[0].field[1] * 11.0 == pytest.approx(0.22)
    assert thin.checks["places_too_thin"].value > 0
    plan = planner.grade(part, **wish)
    (moved,) = plan.gradient.snap["moved"]
    # Facets lie up to 0.007 mm within the ball, and steps of the search are 0.0075 mm.
    assert moved["to"] * 11.0 == pytest.approx(FEATURE_MM, abs=0.02)
    assert plan.checks["places_too_thin"].ok


@pytest.mark.parametrize("snap_mm", [-0.1, np.nan, np.inf])
def test_a_distance_is_none_or_more(snap_mm) -> None:
    with pytest.raises(ArgumentError, match="snap"):
        planner.grade(_stepped(20.0), **ENDS, snap_mm=snap_mm)


def test_places_are_told_where_the_part_was_drawn(tmp_path) -> None:
    """In the message and `drawn_mm` as in the part's file, in `place_mm` as in the shells."""
    thin = m3.Manifold.cube([80.0, 10.0, 10.0]) + m3.Manifold.cube([20.0, 0.3, 10.0]).translate(
        [30.0, 9.9, 0.0]
    )
    fin = m3.Manifold.cube([0.3, 6.0, 10.0]).translate([40.0, 9.0, 0.0])
    mesh = (thin + fin).translate([-500.0, 70.0, 3.0]).to_mesh()
    part = np.asarray(mesh.vert_properties[:, :3]), np.asarray(mesh.tri_verts)
    plan = planner.grade(part, **ENDS)
    (wall,) = [f for f in plan.findings if f.kind == "thin-wall"]
    assert wall.drawn_mm[0] == pytest.approx(-500.0 + 40.15, abs=0.2)
    moved = np.subtract(wall.place_mm, wall.drawn_mm)
    assert moved == pytest.approx(np.array(plan.part.translation_mm))
    assert f"({wall.drawn_mm[0]:.2f}, " in wall.message
    assert "thicken the part there, or print it 2.1 times as large" in wall.message  # 0.6 / 0.298
    howto = (plan.write(tmp_path / "out") / "HOWTO.md").read_text()
    assert wall.message in howto


def test_the_howto_names_the_resins_of_the_palette(tmp_path) -> None:
    machine = load_printer("connex3")
    plan = planner.grade(_stepped(5.0), from_="FLXA9840", to="FLXA9895", axis="x",
                         palette="connex3-agilus-vero")  # fmt: skip
    howto = (plan.write(tmp_path / "out") / "HOWTO.md").read_text()
    resins = machine.palette("connex3-agilus-vero").base_resins
    assert all(f"**{resin}**" in howto for resin in resins)
    assert "TangoPlus" not in howto
