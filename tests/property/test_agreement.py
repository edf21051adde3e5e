"""What grade finds of a plan, check finds of its folder: both make the same checks of the files."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import manifold3d as m3
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planner
from planner.grading.regions import BandDesign
from planner.plan import Check, Plan

ROTATED_PLATE = m3.Manifold.cube([120.0, 90.0, 0.1]).rotate([10.0, 20.0, 30.0])


def _arrays(solid: m3.Manifold) -> tuple[np.ndarray, np.ndarray]:
    mesh = solid.to_mesh()
    return np.asarray(mesh.vert_properties[:, :3], np.float64), np.asarray(mesh.tri_verts)


def _agreed(plan: Plan, folder: Path) -> planner.Certificate:
    """Check a plan's folder; what failed there has failed in the plan, with the same figures."""
    certificate = planner.check(plan.write(folder))
    for name, found in certificate.checks.items():
        said = plan.checks.get(name, Check(0.0, 0.0, True))
        assert (said.ok, said.value) == (found.ok, pytest.approx(found.value, rel=1e-8)), name
    return certificate


@st.composite
def thin_solids(draw: st.DrawFn) -> m3.Manifold:
    """Needles, plates, stairs and balls about as thick as a cell: what walls cut cells apart in."""
    size = draw(st.sampled_from([0.6, 1.0, 2.0]))
    kind = draw(st.sampled_from(["needle", "plate", "ball", "stairs"]))
    if kind == "needle":
        solid = m3.Manifold.cube([20.0, size, size])
    elif kind == "plate":
        solid = m3.Manifold.cube([14.0, 9.0, size])
    elif kind == "ball":
        solid = m3.Manifold.sphere(1.5 * size, 24)
    else:
        steps = [
            m3.Manifold.cube([size, 4.0, size * (i + 1)]).translate([size * i, 0.0, 0.0])
            for i in range(5)
        ]
        solid = m3.Manifold.batch_boolean(steps, m3.OpType.Add)
    return solid.rotate(list(draw(st.sampled_from([(0.0, 0.0, 0.0), (10.0, 20.0, 30.0)]))))


@pytest.mark.slow
@settings(deadline=None, derandomize=True, max_examples=6)
@given(
    solid=thin_solids(),
    cell_mm=st.sampled_from([None, 0.5, 0.8, 1.5, 3.0]),
    along=st.sampled_from(
        [{"axis": "x"}, {"axis": "z"}, {"field": "radial"}, {"axis": "1,1,1", "profile": "steps:3"}]
    ),
)
def test_dithered_plans_lie_where_they_say(
    tmp_path_factory: pytest.TempPathFactory, solid: m3.Manifold, cell_mm: float | None,
    along: dict[str, Any],
) -> None:  # fmt: skip
    """Cells are drawn about centres outside the part too: bounds reached further than they said."""
    plan = planner.grade(
        _arrays(solid), from_="Tango", to="Vero", blend="dither", cell_mm=cell_mm, **along
    )
    certificate = _agreed(plan, tmp_path_factory.mktemp("plans") / "plan")
    assert certificate.checks["plan_disagreements"].ok, certificate.problems


def test_boxes_of_stretches_make_up_their_shells(tmp_path: Path) -> None:
    needle = m3.Manifold.cube([40.0, 1.0, 1.0])
    plan = planner.grade(_arrays(needle), from_="Tango", to="Vero", blend="dither", axis="x")
    assert _agreed(plan, tmp_path / "plan").ok
    for shell in plan.shells:
        boxes = np.array([r.bounds_mm for r in plan.regions if r.file == shell.file])
        assert np.array_equal(boxes[:, 0].min(axis=0), shell.vertices.min(axis=0))
        assert np.array_equal(boxes[:, 1].max(axis=0), shell.vertices.max(axis=0))


@pytest.mark.slow
def test_volume_lost_by_rounding_is_told_by_both(tmp_path: Path) -> None:
    """A plate askew whose thickness is some thousands of steps of float32."""
    plan = planner.grade(_arrays(ROTATED_PLATE), from_="Tango", to="Vero", axis="x")
    certificate = _agreed(plan, tmp_path / "plan")
    assert not plan.checks["volume_error"].ok
    assert not certificate.ok
    (told,) = (found.message for found in plan.findings if found.kind == "volume")
    assert "steps of 15 nm at 138 mm" in told


def test_what_only_the_plan_gets_wrong_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    made = BandDesign.regions

    def elsewhere(*given: Any) -> Any:
        first, *others = made(*given)
        return (replace(first, bounds_mm=((0.0,) * 3, (0.5,) * 3)), *others)

    monkeypatch.setattr(BandDesign, "regions", elsewhere)
    bar = m3.Manifold.cube([40.0, 4.0, 4.0])
    plan = planner.grade(_arrays(bar), from_="Tango", to="Vero", axis="x")
    assert not plan.ok
    assert plan.checks["plan_disagreements"].value == len(plan.findings) > 0
    assert "does not lie where the plan says" in plan.findings[-1].message
