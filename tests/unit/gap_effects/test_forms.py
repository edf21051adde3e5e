"""The effect library: every form is off at size 0, smooth, and within physical bounds."""

import dataclasses
import runpy
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.gap.effect import Effect, Form, Parameter
from planner.gap.effects import EFFECTS, effects_for
from planner.printers import load_printer
from planner.simulation.bar_solver import SOFTENING_PEAKS, Setup

Make = Callable[..., Setup]
Apply = Callable[..., Setup]
Middles = Callable[..., dict[str, float]]

CONTRACT = (
    "rate", "temperature", "moisture", "ageing", "orientation", "composition-offset",
    "interface-bleed", "softening", "permanent-set", "grip-slack", "grip-slip",
    "machine-compliance", "cross-section", "force-scale", "force-offset", "strain-scale", "skin",
    "material-law",
)  # fmt: skip
PALETTE = load_printer("connex3").palette()


def arrays(of: Setup) -> tuple[str, ...]:
    names = (field.name for field in dataclasses.fields(of))
    return tuple(name for name in names if isinstance(getattr(of, name), np.ndarray))


def every_form() -> Iterator[Any]:
    for effect in effects_for(PALETTE).values():
        for form in effect.forms:
            yield pytest.param(effect, form, id=f"{effect.id}-{form.name}")


EVERY_FORM = pytest.mark.parametrize(("effect", "form"), list(every_form()))


def test_every_effect_of_the_contract_is_there() -> None:
    assert list(EFFECTS) == sorted(CONTRACT)
    assert list(effects_for(PALETTE)) == sorted(CONTRACT)
    with pytest.raises(TypeError):
        EFFECTS["rate"] = EFFECTS["skin"]  # type: ignore[index]


def test_a_palette_has_a_factor_and_a_tilt_for_each_of_its_materials() -> None:
    names = [form.name for form in effects_for(PALETTE)["material-law"].forms]
    assert names == [f"{m.id} {kind}" for m in PALETTE.materials for kind in ("factor", "tilt")]


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_an_effect_says_what_it_is(effect: Effect) -> None:
    assert effect.title
    assert effect.clause
    assert effect.changes
    assert len(effect.forms) >= 2
    assert len({form.name for form in effect.forms}) == len(effect.forms)
    assert effect.where
    assert effect.individual == 0.0 or 0.3 <= effect.individual <= 0.4
    assert effect.some == (effect.id == "force-scale")
    assert bool(effect.individual) == (effect.id in ("grip-slack", "grip-slip", "force-offset"))


@EVERY_FORM
def test_bounds_are_sane(effect: Effect, form: Form) -> None:
    assert form.equation
    assert form.source
    size, *shape = form.parameters
    assert 0.0 < size.low < size.high
    # Four sizes, two signs, three values of each shape: 36 nodes of quadrature at most.
    assert len(shape) <= (1 if size.signed else 2)
    for parameter in form.parameters:
        assert parameter.low < parameter.high
        assert parameter.low > 0.0 or not parameter.log
        assert parameter.meaning
    assert not any(parameter.signed for parameter in shape)


@EVERY_FORM
@pytest.mark.parametrize("end", [0, 1])
def test_off_at_size_zero(effect: Effect, form: Form, end: int, away: Make) -> None:
    corner = {p.name: (p.low, p.high)[end] for p in form.parameters} | {form.size.name: 0.0}
    before = away()
    after = form.apply(before, corner)
    for name in arrays(before):
        # Rounding alone.
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), rtol=0, atol=1e-15)


@EVERY_FORM
def test_effects_stay_physical_at_the_corners_of_their_bounds(
    effect: Effect, form: Form, away: Make
) -> None:
    ends = np.meshgrid(*[(p.low, p.high) for p in form.parameters])
    before = away()
    for corner in np.stack([e.ravel() for e in ends], axis=1):
        for sign in (1.0, -1.0) if form.size.signed else (1.0,):
            values = dict(zip((p.name for p in form.parameters), corner.tolist(), strict=True))
            values[form.size.name] *= sign
            after = form.apply(before, values)
            for name in arrays(before):
                assert np.all(np.isfinite(getattr(after, name))), name
            assert np.all((after.coordinate >= 0.0) & (after.coordinate <= 1.0))
            assert np.all(after.area_mm2 > 0.0)
            assert np.all(after.relaxing >= 0.0)
            assert np.all(after.relaxing.sum(axis=1) < 1.0)
            assert np.all((after.softening >= 0.0) & (after.softening < 1.0))
            assert np.all((after.softening_table >= 0.0) & (after.softening_table <= 1.0))
            assert np.all(after.softening_table[-1] == 0.0)
            # What stays is less than what was.
            assert np.all(after.set_share.max() * after.set_table <= 0.9 * SOFTENING_PEAKS)
            # No more travel is lost than was made.
            furthest = np.maximum.accumulate(after.travel_mm, axis=1)
            assert np.all(after.lost_mm <= furthest * (1.0 + 1e-12))
            assert np.all(after.travel_factor > 0.0)
            assert np.all(after.gain > 0.0)


@EVERY_FORM
@pytest.mark.parametrize("far", [-4.0, 4.0])
def test_details_are_finite_as_far_as_they_are_looked_for(
    effect: Effect, form: Form, far: float, away: Make
) -> None:
    """Four deviations hold all but 6e-5 of a prior: one detail after the other, and all at once."""
    none = {p.name: p.high for p in form.parameters} | dict.fromkeys(form.details, 0.0)
    for names in (form.details, *((name,) for name in form.details)):
        after = form.apply(away(), none | dict.fromkeys(names, far))
        for name in arrays(after):
            assert np.all(np.isfinite(getattr(after, name))), (names, name)


@EVERY_FORM
def test_effects_are_smooth_in_their_parameters(
    effect: Effect, form: Form, away: Make, middles: Middles
) -> None:
    # A second difference falls to a quarter when its step is halved, if there is a second
    # derivative; a kink would halve it. Off the middle, so that no symmetry hides one.
    before = away()
    for parameter in form.parameters:
        at = middles(form)[parameter.name] * 1.03

        def curve(value: float, parameter: Parameter = parameter) -> np.ndarray:
            after = form.apply(before, middles(form, **{parameter.name: value}))
            return np.concatenate([np.ravel(getattr(after, name)) for name in arrays(before)])

        step = 0.02 * at
        second = [
            curve(at + h) - 2.0 * curve(at) + curve(at - h) for h in (step, 0.5 * step)
        ]  # fmt: skip
        coarse, fine = (float(np.linalg.norm(s)) for s in second)
        # The allowance is for rounding of arrays of order 100.
        assert fine <= 0.3 * coarse + 1e-11, parameter.name


@EVERY_FORM
def test_effects_are_fast_and_leave_their_input_alone(
    effect: Effect, form: Form, away: Make, middles: Middles
) -> None:
    before = away(steps=64)
    copies = {name: getattr(before, name).copy() for name in arrays(before)}
    values = middles(form)
    form.apply(before, values)
    best = min(_seconds(form, before, values) for _ in range(5))
    # Of a diagnosis' thousand calls, five times the aim, as machines are shared.
    assert best < 1e-3
    for name, copy in copies.items():
        np.testing.assert_array_equal(getattr(before, name), copy)


def _seconds(form: Form, before: Setup, values: dict[str, float]) -> float:
    start = time.perf_counter()
    form.apply(before, values)
    return time.perf_counter() - start


def test_effects_add_up_in_any_order_within_a_stage(away: Make, middles: Middles) -> None:
    before = away()
    first, second = EFFECTS["rate"].forms[2], EFFECTS["temperature"].forms[2]
    ways = [
        b.apply(a.apply(before, middles(a)), middles(b))
        for a, b in ((first, second), (second, first))
    ]
    for name in arrays(before):
        np.testing.assert_allclose(getattr(ways[0], name), getattr(ways[1], name), atol=1e-15)


def test_the_tables_of_effects_have_the_library() -> None:
    folder = Path(__file__).parents[3] / "docs" / "reference"
    made = runpy.run_path(str(folder / "make_effects.py"))["tables"]()
    for effect in EFFECTS.values():
        assert f"| `{effect.id}` | {effect.stage} |" in made
        for form in effect.forms:
            assert f"| {form.name} | `{form.equation.replace('|', chr(92) + '|')}` |" in made
