"""Plans compared by meaning: every kind of change shows, and what means nothing does not."""

import dataclasses

import pytest

from planner.cli import run
from planner.grading.check import diff
from planner.plan import (
    Check,
    Finding,
    Gradient,
    PaletteUsed,
    PartGraded,
    Plan,
    Region,
    Stiffness,
    Unreachable,
    read_plan,
)
from planner.testing import assert_same_plan

BOX = ((1.0, 1.0, 1.0), (11.0, 3.0, 3.0))


def _region(index: int, material: str, start: float, stop: float) -> Region:
    return Region(
        index=index,
        material=material,
        coordinate=0.1 * index,
        field=(start, stop),
        target_modulus_MPa=(1.0, 2.0),
        modulus_MPa=1.5,
        modulus_interval_MPa=(1.2, 1.8),
        error=(-0.25, 0.5),
        volume_mm3=40.0 * (stop - start),
        mass_g=0.04 * (stop - start),
        bounds_mm=BOX,
        file=f"stl/bar__0{index}_{material}.stl",
        sha256="ab",
        triangles=12,
    )


PLAN = Plan(
    schema=1,
    version="0.1.0",
    printer="connex3",
    palette=PaletteUsed("connex3-tango-vero", "cd"),
    part=PartGraded("bar", "bar.stl", "ef", "mm", 40.0, 88.0, BOX, 12, (1.0, 1.0, 1.0)),
    gradient=Gradient({"name": "axis", "span_mm": 10.0}, {"name": "log"}, "TangoPlus", "FLX9795"),
    stiffness=Stiffness("secant-nominal", 0.1),
    regions=(_region(1, "TangoPlus", 0.0, 0.4), _region(2, "FLX9795", 0.4, 1.0)),
    checks={"overlap": Check(0.0, 1e-9, True)},
)


def test_a_plan_equals_itself_and_its_file(tmp_path) -> None:
    assert diff(PLAN, PLAN) == ()
    (tmp_path / "plan.json").write_bytes(PLAN.json())
    assert read_plan(tmp_path) == PLAN
    assert_same_plan(PLAN, tmp_path)


def test_hashes_and_versions_mean_nothing() -> None:
    other = dataclasses.replace(PLAN, version="9", part=dataclasses.replace(PLAN.part, sha256="00"))
    assert diff(PLAN, other) == ()


MOVED = (_region(1, "TangoPlus", 0.0, 0.5), _region(2, "FLX9795", 0.5, 1.0))
SWAPPED = (_region(1, "FLX9740", 0.0, 0.4), PLAN.regions[1])
CHANGES = {
    "printer": {"printer": "other"},
    "palette": {"palette": PaletteUsed("mine", "cd")},
    "palette content": {"palette": PaletteUsed("connex3-tango-vero", "99")},
    "part volume mm3": {"part": dataclasses.replace(PLAN.part, volume_mm3=41.0)},
    "working strain": {"stiffness": Stiffness("secant-nominal", 0.2)},
    "gradient to": {"gradient": dataclasses.replace(PLAN.gradient, end="VeroWhitePlus")},
    "field": {"gradient": dataclasses.replace(PLAN.gradient, field={"name": "radial"})},
    "place along the field": {"regions": MOVED},
    "material volume mm3": {"regions": MOVED},
    "material": {"regions": SWAPPED},
    "material added": {"regions": SWAPPED},
    "material removed": {"regions": SWAPPED},
    "regions": {"regions": PLAN.regions[:1]},
    "check": {"checks": {"overlap": Check(1.0, 1e-9, False)}},
    "findings": {"findings": (Finding("thin-wall", "too thin"),)},
    "unreachable targets": {"unreachable": (Unreachable((0.0, 0.1), (0.1, 0.2), "a", 0.3),)},
}


@pytest.mark.parametrize("what", CHANGES)
def test_each_change_shows_both_ways(what: str) -> None:
    other = dataclasses.replace(PLAN, **CHANGES[what])
    assert what in {d.what for d in diff(PLAN, other)}
    back = (
        what.replace("added", "REMOVED").replace("removed", "added").replace("REMOVED", "removed")
    )
    assert back in {d.what for d in diff(other, PLAN)}
    with pytest.raises(AssertionError, match="the plans differ"):
        assert_same_plan(other, PLAN)


def test_tolerance_is_the_line_between_equal_and_not() -> None:
    nudged = dataclasses.replace(
        PLAN, regions=(dataclasses.replace(PLAN.regions[0], volume_mm3=16.0008), PLAN.regions[1])
    )
    assert diff(PLAN, nudged, tolerance=1e-4) == ()
    assert {d.what for d in diff(PLAN, nudged, tolerance=1e-6)} == {
        "volume mm3",
        "material volume mm3",
    }


def test_differences_fit_a_terminal(tmp_path, capsys) -> None:
    long = {"name": "list", "positions": [i / 40 for i in range(41)]}
    other = dataclasses.replace(PLAN, gradient=dataclasses.replace(PLAN.gradient, profile=long))
    for name, plan in (("a", PLAN), ("b", other)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "plan.json").write_bytes(plan.json())
    assert run(["diff", str(tmp_path / "a"), str(tmp_path / "b")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("profile (plan): name log ->")
    assert max(map(len, lines)) <= 80


def test_a_difference_has_as_many_digits_as_it_takes() -> None:
    part = dataclasses.replace(PLAN.part, volume_mm3=40.00001)
    (found,) = diff(PLAN, dataclasses.replace(PLAN, part=part), tolerance=1e-9)
    assert found.text == "part volume mm3 (plan): 40 -> 40.00001"
