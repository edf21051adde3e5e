"""What a function of `planner` says to a value of another kind, from a script."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planner
from planner.errors import ArgumentError, OutputError
from planner.glance import format_number

SCALE = planner.list_materials()
TANGO = SCALE.palette.resolve("Tango")
HUGE: Any = 10**400


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda it: planner.law_block(it, "abaqus"), "give a Material, as `Palette.resolve`"),
        (planner.materials_figure, "give what `planner.list_materials` returns"),
        (planner.fit_figure, "give what `planner.fit` returns"),
        (planner.fit_tables, "give what `planner.fit` returns"),
        (planner.characterisation_figure, "give what `planner.characterise` returns"),
        (planner.simulation_figure, "give what `planner.simulate` returns"),
        (planner.part_page, "give what `planner.simulate` returns of a whole part"),
        (planner.part_volume, "give what `planner.simulate` returns of a whole part"),
        (lambda it: planner.write_diagnosis(it, "diagnosis"), "give what `planner.diagnose` ret"),
    ],
)
@pytest.mark.parametrize("value", ["Tango", None, SCALE.palette, Path("lab")])
def test_another_value_is_refused_with_what_to_give(
    call: Callable[[Any], object], words: str, value: Any
) -> None:
    """They ended in an AttributeError or TypeError that told neither."""
    with pytest.raises(ArgumentError, match=re.escape(words)):
        call(value)


def test_figures_that_are_none_are_refused(tmp_path: Path) -> None:
    """Of these some ended in an OverflowError or ValueError; a law's number was taken as it was."""
    for call, words in (
        (lambda: planner.list_materials(at_strain=HUGE), "must be a finite number"),
        (lambda: planner.law_block(TANGO, "ansys", float("nan")), "`number` nan"),  # type: ignore[arg-type]
        (lambda: planner.Bar("abc", [0.0], [1.0]), "bar: figures must be numbers"),  # type: ignore[arg-type]
        (lambda: planner.Bar(None, [0.0], [1.0]), "bar: edges_mm must be finite"),  # type: ignore[arg-type]
        (lambda: SCALE.modulus_of("nonsense"), "no material 'nonsense' in palette"),
    ):
        with pytest.raises(planner.PlannerError, match=re.escape(words)):
            call()
    assert SCALE.modulus_of("tango") == SCALE.moduli_MPa[0]
    with pytest.raises(OutputError, match="choose another place"):
        planner.write_palette(SCALE.palette, 3)  # type: ignore[arg-type]


def test_a_pitch_is_one_length_or_three(tmp_path: Path) -> None:
    soft = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    plan = planner.grade((soft, faces), from_="Tango", to="FLX9740", axis="x", name="corner")
    plan.write(tmp_path / "corner")
    for pitch in (HUGE, -1.0, np.nan, True, "1"):
        with pytest.raises(ArgumentError, match="pitch in mm"):
            next(planner.iterate_layers(tmp_path / "corner", pitch_mm=pitch))
    with pytest.raises(ArgumentError, match="2 lengths; give one in mm, or three"):
        next(planner.iterate_layers(tmp_path / "corner", pitch_mm=(1.0, 2.0)))
    for pitch in (0.5, np.float64(0.5), [0.5, 0.5, 0.5], np.full(3, 0.5)):
        layer = next(planner.iterate_layers(tmp_path / "corner", pitch_mm=pitch))
        assert layer.label.shape == (8, 8)


def test_a_figure_that_is_rounded_up_to_a_power_of_ten_keeps_its_digits() -> None:
    """9.996 was written 10.00, with four digits."""
    assert [format_number(v) for v in (9.996, 99.96, 0.09996, -9.996, 9.994)] == [
        "10.0", "100", "0.100", "-10.0", "9.99",
    ]  # fmt: skip


def test_a_page_and_a_plot_say_what_they_take() -> None:
    """They ended in an AttributeError."""
    with pytest.raises(ArgumentError, match=r"plan 3: give a plan\.json, its folder or a planner"):
        planner.plan_page(3)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="`ax` 3: give axes of matplotlib, or none"):
        SCALE.plot(3)  # type: ignore[arg-type]


def test_no_progress_is_none(tmp_path: Path) -> None:
    """None was called."""
    corners = np.array([[0, 0, 0], [40, 0, 0], [0, 40, 0], [0, 0, 40]], dtype=float)
    faces = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    plan = planner.grade((corners, faces), from_="Tango", to="Vero", progress=None)
    folder = plan.write(tmp_path / "plan")
    assert not planner.check(folder, progress=None).problems
    planner.write_slices(folder, tmp_path / "slices", pitch_mm=1.0, progress=None)
