"""What a notebook shows of values, and their plots."""

import dataclasses
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planner
from planner.plan import Finding, Plan, Unreachable

MOST_BYTES = 100_000
"""A notebook keeps what it showed: ten pages of ours are at most a megabyte of its file."""

NAMED = "<script>alert(1)</script>&\"'"


@pytest.fixture(scope="module")
def values(
    dogbone_plan: Plan, samples: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    plan = dogbone_plan
    folder = plan.write(tmp_path_factory.mktemp("plans") / "bar")
    scale = planner.list_materials(at_strain=0.2)
    return {
        "plan": plan,
        "plan read back": planner.read_plan(folder),
        "plan with cells": planner.grade(
            samples / "dogbone.stl", from_="Tango", to="FLX9750", blend="dither", cell_mm=1.0
        ),
        "plan on a field": planner.grade(
            samples / "dogbone.stl", from_="Tango", to="FLX9750",
            field="radial: point=0 0 0, to=60", pitch_mm=2.0,
        ),
        "palette": scale.palette,
        "ladder": scale,
        "simulation": planner.simulate(folder),
        "coupon": planner.simulate("FLX9760", to_strain=0.1, protocol="relaxation"),
        "whole part": planner.simulate(
            samples / "dogbone.stl", material="FLX9760", fix="x=min", load="x=max: 1,0,0 N",
            cell_mm=8.0, steps=2,
        ),
        "diagnosis": _diagnosis(),
        "tests": planner.characterise([samples / "tensile"]),
        "campaign": planner.read_campaign(samples / "warm-lab"),
    }  # fmt: skip


def _diagnosis() -> planner.Diagnosis:
    from planner.gap.diagnosis import Gap, Hypothesis

    return planner.Diagnosis(
        campaign="lab", palette="p", palette_sha256="", specimens=8, tests=4,
        verdict="temperature", same_class=(("temperature",),),
        ranking=(Hypothesis(("temperature",), 0.9), Hypothesis((), 0.1)),
        gap=Gap(0.3, 0.03, 0.02, 0.96, (0.9, 1.0), 0.2, 0.25, "each level of temperature"),
        not_testable=(), where=(), effect=(), remainder=(), data_quality=(), next_experiments=(),
        detectable=(), limitations=("one batch",), summary=("The gap goes with temperature.",),
    )  # fmt: skip


_KINDS = [
    "plan", "plan read back", "plan with cells", "plan on a field", "palette", "ladder",
    "simulation", "coupon", "whole part", "diagnosis",
]  # fmt: skip


class Reader(HTMLParser):
    """Tags as a browser finds them; every one that is opened is closed in its place."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.text = ""
        self.feed(page)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.tags.append(tag)
        for name, value in attrs:
            assert not name.startswith("on")
            assert "//" not in (value or "") or name == "xmlns"

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.parametrize("kind", _KINDS)
def test_a_page_is_short_and_needs_nothing_else(values: dict[str, Any], kind: str) -> None:
    page = values[kind]._repr_html_()
    assert len(page.encode()) < MOST_BYTES
    read = Reader(page)
    assert "svg" in read.tags
    assert not {"script", "link", "img", "iframe", "style"} & set(read.tags)
    assert repr(values[kind]).strip("<>") in read.text
    assert page == values[kind]._repr_html_()
    assert not re.search(r'\bid="', page), "two pages of a notebook would share it"


def test_a_plan_is_the_same_page_when_it_is_read_back(values: dict[str, Any]) -> None:
    made, read = (values[kind]._repr_html_() for kind in ("plan", "plan read back"))
    assert made == read


def test_names_and_messages_are_text(values: dict[str, Any]) -> None:
    plan: Plan = values["plan"]
    region = dataclasses.replace(plan.regions[0], material=NAMED)
    odd = dataclasses.replace(
        plan,
        part=dataclasses.replace(plan.part, name=NAMED, file=NAMED),
        regions=(region, *plan.regions[1:]),
        findings=(Finding("sliver", NAMED),) * 9,
        unreachable=(Unreachable((0.0, 0.1), (1.0, 2.0), NAMED, 0.36),),
    )
    read = Reader(odd._repr_html_())
    assert "script" not in read.tags
    assert NAMED in read.text
    assert "and 4 more" in read.text
    named = dataclasses.replace(values["simulation"], name=NAMED, notes=(NAMED,))
    assert "script" not in Reader(named._repr_html_()).tags
    blamed = dataclasses.replace(values["diagnosis"], campaign=NAMED, summary=(NAMED,))
    assert "script" not in Reader(blamed._repr_html_()).tags


def test_many_regions_do_not_fill_the_notebook(values: dict[str, Any]) -> None:
    plan: Plan = values["plan"]
    long = dataclasses.replace(plan, regions=plan.regions * 30)
    assert Reader(long._repr_html_()).text.count("TangoPlus") < 60
    assert "and 280 more" in long._repr_html_()


def test_odd_values_still_have_a_page(values: dict[str, Any]) -> None:
    plan: Plan = values["plan"]
    assert "0 regions" in dataclasses.replace(plan, regions=())._repr_html_()
    unknown = dataclasses.replace(values["plan read back"], printer="gone")
    assert "svg" in Reader(unknown._repr_html_()).tags
    palette = values["palette"]
    soft, hard = palette.materials[0], palette.materials[-1]
    ends = (dataclasses.replace(soft, law=hard.law), dataclasses.replace(hard, law=soft.law))
    crossing = dataclasses.replace(palette, materials=ends)
    assert "VeroWhitePlus" in Reader(crossing._repr_html_()).text


# ------------------------------------------------------------------------------------------------
# Plots by matplotlib, an optional extra.


@pytest.fixture
def pyplot(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("MPLBACKEND", "Agg")
    matplotlib = pytest.importorskip("matplotlib.pyplot")
    yield matplotlib
    matplotlib.close("all")


@pytest.mark.parametrize("kind", [*_KINDS, "tests", "campaign"])
def test_a_plot_is_drawn_into_the_axes_given_or_new_ones(
    values: dict[str, Any], kind: str, pyplot: Any
) -> None:
    _, ax = pyplot.subplots()
    assert values[kind].plot(ax) is ax
    assert values[kind].plot() is not ax
    assert ax.get_xlabel()
    assert ax.lines or ax.patches
    ax.figure.canvas.draw()


def test_plots_show_the_figures_that_values_hold(values: dict[str, Any], pyplot: Any) -> None:
    plan: Plan = values["plan"]
    achieved = [line for line in plan.plot().lines if len(line.get_ydata()) == 2][-10:]
    assert [line.get_ydata()[0] for line in achieved] == [r.modulus_MPa for r in plan.regions]
    simulation = values["simulation"]
    held, beyond, _ = simulation.plot().lines
    drawn = np.concatenate([held.get_ydata()[:-1], beyond.get_ydata()])
    np.testing.assert_array_equal(drawn, simulation.force_N)
    ladder = values["ladder"]
    materials = ladder.plot().collections[-1]
    np.testing.assert_allclose(materials.get_offsets()[:, 1], ladder.moduli_MPa)


def test_without_matplotlib_the_command_that_brings_it_is_said(
    values: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(planner.PlannerError, match="pip install matplotlib"):
        values["palette"].plot()


def test_nothing_is_drawn_or_imported_until_someone_looks() -> None:
    code = (
        "import sys, planner\n"
        "from planner import Plan, Palette, Material\n"
        "from planner.palette import LawParameters\n"
        "assert not [n for n in sys.modules if n.startswith(('planner.report', 'matplotlib'))]\n"
        "law = LawParameters('neo-hookean', {'mu_MPa': 1.0})\n"
        "repr(Palette('p', (Material('m', 0.0, 1.0, 1.1, law),)))\n"
        "assert not [n for n in sys.modules if n.startswith(('planner.report', 'matplotlib'))]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
