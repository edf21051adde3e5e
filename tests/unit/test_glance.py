"""What a value shows at a glance: its `repr` is one line, whatever it holds."""

import copy
import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

import planner
from planner.glance import counted, outcome
from planner.plan import Plan

LINE = 120
"""What a terminal or a cell of a notebook shows unbroken."""

INNER = 400
"""Of the smaller things within a result, which are shown one at a time."""


@pytest.fixture
def plan(dogbone_plan: Plan) -> Plan:
    return dogbone_plan


@pytest.fixture(scope="module")
def results(
    dogbone_plan: Plan, samples: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    """What public functions return, but for the slow ones of the gap."""
    plan = dogbone_plan
    tmp_path = tmp_path_factory.mktemp("results")
    folder = plan.write(tmp_path / "bar")
    scale = planner.list_materials()
    return {
        "grade": plan,
        "read_plan": planner.read_plan(folder),
        "check": planner.check(folder),
        "diff": planner.diff(plan, planner.grade(samples / "dogbone.stl", from_="1MPa", to="Vero")),
        "simulate": planner.simulate(folder),
        "write_slices": planner.write_slices(folder, tmp_path / "slices", pitch_mm=1.0),
        "iterate_layers": next(iter(planner.iterate_layers(folder, pitch_mm=1.0))),
        "list_materials": scale,
        "palette": scale.palette,
        "invert": planner.invert(1.2),
        "invert coordinate": planner.invert(coordinate=0.4),
        "load_printer": planner.load_printer("connex3"),
        "characterise": planner.characterise([samples / "tensile"]),
        "fit": planner.fit([samples / "tensile"], starts=3),
        "read_campaign": planner.read_campaign(samples / "warm-lab"),
    }


def within(value: Any) -> Iterator[Any]:
    """Yield a value and all dataclasses in it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield value
        value = [getattr(value, f.name) for f in dataclasses.fields(value)]
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, (list, tuple)):
        for inner in value:
            yield from within(inner)


def test_results_are_one_short_line(results: dict[str, Any]) -> None:
    for called, result in results.items():
        for one in result if isinstance(result, tuple) else (result,):
            assert len(repr(one)) <= LINE, called
            assert repr(one).startswith(f"<{type(one).__name__} "), called


def test_no_part_of_a_result_fills_a_screen(results: dict[str, Any]) -> None:
    for result in results.values():
        for inner in within(result):
            shown = repr(inner)
            assert len(shown) <= INNER, shown
            assert "\n" not in shown


def test_a_plan_says_what_it_is_and_whether_it_is_well(plan: Plan) -> None:
    assert repr(plan) == (
        "<Plan dogbone: 10 materials, 10 regions, 6015.7 mm3, connex3-tango-vero; ok>"
    )
    finding = planner.plan.Finding("sliver", "too thin")
    missed = planner.plan.Unreachable((0.0, 0.1), (1.0, 2.0), "TangoPlus", 0.36)
    failed = planner.plan.Check(1, 0, False)
    ill = dataclasses.replace(
        plan, findings=(finding,), unreachable=(missed,) * 2, checks={"overlap": failed}
    )
    assert repr(ill).endswith("; 1 check failed, 1 finding, 2 targets out of reach>")


@pytest.mark.parametrize("name", ["a\nb\x1b[2J\x00", "x" * 10_000, "", "Gerät 軟", "<b>&"])
def test_odd_names_stay_on_the_line(plan: Plan, name: str) -> None:
    odd = dataclasses.replace(plan, part=dataclasses.replace(plan.part, name=name, file=name))
    for shown in (repr(odd), repr(odd.part)):
        assert len(shown) <= LINE
        assert shown.isprintable()
    assert repr(odd).endswith("; ok>")


def test_what_is_not_complete_still_has_a_repr(plan: Plan) -> None:
    assert repr(object.__new__(Plan)) == "<Plan, not complete>"
    broken: Any = copy.copy(plan)
    object.__setattr__(broken, "regions", None)
    assert repr(broken) == "<Plan, not complete>"
    assert repr(object.__new__(planner.Bar)) == "<Bar, not complete>"
    assert repr(object.__new__(planner.Palette)) == "<Palette, not complete>"


def test_counts_read_as_words() -> None:
    assert counted(1, "target out of reach") == "1 target out of reach"
    assert counted(0, "layer") == "0 layers"
    assert outcome((0, "finding"), (2, "check failed")) == "2 checks failed"
    assert outcome((0, "finding")) == "ok"
