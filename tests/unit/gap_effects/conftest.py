"""Tests as they are observed, made by hand, and effects at the middle of their bounds."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from planner.gap.effect import Form
from planner.gap.effects import EFFECTS
from planner.palette import Reference
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Setup, unaltered

REFERENCE = Reference(
    strain_rate_per_s=0.034, temperature_C=23.0, soak_h=0.0, age_days=9.0, orientation="x"
)
STEP_BAR = ProfileDesign("step", np.array([0.0, 12.5, 12.5, 25.0]), np.array([0.1, 0.1, 0.9, 0.9]))
RAMP_BAR = ProfileDesign("ramp", np.array([0.0, 8.0, 16.0, 25.0]), np.array([0.0, 0.0, 1.0, 1.0]))


def make_setup(
    *designs: ProfileDesign | None, slices: int = 200, steps: int = 16, **changes: Any
) -> Setup:
    """Tests at the reference: coupons of coordinates 0 to 1 in turn, and bars of 25 mm."""
    counts = [1 if design is None else slices for design in designs]
    first = np.concatenate([[0], np.cumsum(counts)])
    coordinate, x, length = [], [], []
    for test, (design, count) in enumerate(zip(designs, counts, strict=True)):
        middle = (np.arange(count) + 0.5) * 25.0 / count
        x.append(middle)
        length.append(np.full(count, 25.0 / count))
        coupon = test % 6 / 5.0
        coordinate.append(np.full(1, coupon) if design is None else design.at(middle))
    tests, total = len(designs), int(first[-1])
    one, zero = np.ones(tests), np.zeros(tests)
    time_s = np.broadcast_to(np.linspace(0.0, 12.0, steps), (tests, steps)).copy()
    there_and_back = 10.0 * (1.0 - np.abs(1.0 - time_s / 6.0))
    values: dict[str, Any] = {
        "reference": REFERENCE,
        "palette_coordinate": np.array([0.0, 1.0]),
        "first_slice": first,
        "time_s": time_s,
        "travel_mm": there_and_back,
        "rate_per_s": 0.034 * one,
        "temperature_C": 23.0 * one,
        "soak_h": zero,
        "age_days": 9.0 * one,
        "width_mm": 6.0 * one,
        "thickness_mm": 2.0 * one,
        "gauge_mm": 25.0 * one,
        "orientation": np.zeros(tests, dtype=np.int64),
        "designs": designs,
        "x_mm": np.concatenate(x),
        "coordinate": np.concatenate(coordinate),
        "length_mm": np.concatenate(length),
        "area_mm2": np.full(total, 12.0),
        **unaltered(first, steps),
    }
    return Setup(**(values | changes))


def make_coupons(count: int = 6, **changes: Any) -> Setup:
    return make_setup(*(None,) * count, **changes)


def make_away(**changes: Any) -> Setup:
    """Six coupons and two bars, all conditions off the reference, each test elsewhere."""
    n = 8
    others = {
        "rate_per_s": np.geomspace(3e-3, 0.5, n),
        "temperature_C": np.linspace(12.0, 42.0, n),
        "soak_h": np.linspace(0.0, 40.0, n),
        "age_days": np.geomspace(1.0, 300.0, n),
        "thickness_mm": np.linspace(1.0, 5.0, n),
        "orientation": np.arange(n) % 3,
    }
    return make_setup(*(None,) * 6, STEP_BAR, RAMP_BAR, **(others | changes))


def make_middles(form: Form, **changes: float) -> dict[str, float]:
    return {p.name: p.usual for p in form.parameters} | changes


def apply_form(effect: str, form: str, to: Setup, **values: float) -> Setup:
    chosen = next(f for f in EFFECTS[effect].forms if f.name == form)
    return chosen.apply(to, make_middles(chosen, **values))


@pytest.fixture
def setup() -> Callable[..., Setup]:
    """Of designs, None for a coupon: tests at the reference."""
    return make_setup


@pytest.fixture
def coupons() -> Callable[..., Setup]:
    """Of a number: coupons at the reference."""
    return make_coupons


@pytest.fixture
def away() -> Callable[..., Setup]:
    """Six coupons and two bars off the reference."""
    return make_away


@pytest.fixture
def bars() -> dict[str, ProfileDesign]:
    """A design of one step and one of a ramp."""
    return {bar.name: bar for bar in (STEP_BAR, RAMP_BAR)}


@pytest.fixture
def middles() -> Callable[..., dict[str, float]]:
    """Of a form: its parameters at the middle of their bounds, some changed."""
    return make_middles


@pytest.fixture
def applied() -> Callable[..., Setup]:
    """Of an effect's and a form's name and a setup: the setup with the effect."""
    return apply_form
