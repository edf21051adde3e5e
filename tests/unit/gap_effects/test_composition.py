"""What is printed other than designed: offsets, bleeding, and the law of one material."""

from collections.abc import Callable

import numpy as np
import pytest

from planner.gap.effects import effects_for
from planner.printers import load_printer
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Setup

Make = Callable[..., Setup]
Apply = Callable[..., Setup]
Bars = dict[str, ProfileDesign]

PALETTE = load_printer("connex3").palette()


def test_offsets_move_mixtures_and_never_leave_the_palette(coupons: Make, applied: Apply) -> None:
    before = coupons()
    for name, still in (("constant", ()), ("dot-gain", (0, 5)), ("hard-jets", (0,))):
        for sign in (1.0, -1.0):
            after = applied("composition-offset", name, before, shift=sign * 0.1)
            moved = sign * (after.coordinate - before.coordinate)
            assert np.all(moved >= 0.0)
            assert np.all(moved[1:-1] > 0.0)
            np.testing.assert_allclose(moved[list(still)], 0.0, atol=1e-9)
    after = applied("composition-offset", "constant", before, shift=0.05)
    # Well inside the palette the limit at its end is felt by 2e-6 of the shift.
    np.testing.assert_allclose((after.coordinate - before.coordinate)[:-1], 0.05, rtol=1e-5)


KERNELS = {
    "gaussian": lambda x: np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi),
    "exponential": lambda x: 0.5 * np.exp(-np.abs(x)),
    "droplet": lambda x: 0.75 * np.maximum(1.0 - x**2, 0.0),
}


@pytest.mark.parametrize("form", KERNELS)
@pytest.mark.parametrize("bar", ["step", "ramp"])
@pytest.mark.parametrize("length_mm", [0.3, 1.5])
def test_bleed_is_the_convolution_of_the_design(
    form: str, bar: str, length_mm: float, setup: Make, bars: Bars, applied: Apply
) -> None:
    design = bars[bar]
    before = setup(design)
    after = applied("interface-bleed", form, before, length=length_mm)
    # Integrated by midpoints of 0.0025 mm over 12 lengths; beyond its ends a bar goes on.
    offsets = (np.arange(-48000, 48000) + 0.5) * 0.00025 * length_mm
    weights = KERNELS[form](offsets / length_mm) / length_mm
    picked = before.x_mm[::7]
    there = design.at(np.clip(picked[:, None] + offsets[::10], 0.0, 25.0))
    expected = there @ weights[::10] * 0.0025 * length_mm
    # A step within a midpoint's cell costs half a cell of the kernel's peak: 1e-3.
    np.testing.assert_allclose(after.coordinate[::7], expected, atol=1.5e-3)


@pytest.mark.parametrize("form", KERNELS)
def test_bleed_conserves_what_was_jetted_and_only_bars_feel_it(
    form: str, setup: Make, bars: Bars, applied: Apply
) -> None:
    before = setup(None, bars["step"], bars["ramp"], slices=2000)
    after = applied("interface-bleed", form, before, length=0.4)
    assert after.coordinate[0] == before.coordinate[0]
    change = (after.coordinate - before.coordinate) * before.length_mm
    for test in (1, 2):
        slices = slice(before.first_slice[test], before.first_slice[test + 1])
        # Slices of 0.0125 mm hold the antisymmetric change of a step to rounding, that of a
        # ramp's two bends, which cancel, too.
        assert abs(float(np.sum(change[slices]))) < 1e-9
        assert float(np.sum(np.abs(change[slices]))) > 1e-3
    assert np.all(np.diff(after.coordinate[1:2001]) >= -1e-12)


def test_bleed_takes_a_densely_sampled_design_as_the_curve_it_stands_for(
    setup: Make, applied: Apply
) -> None:
    x = np.linspace(0.0, 25.0, 2001)
    smooth = ProfileDesign("smooth", x, 0.5 - 0.5 * np.cos(np.pi * x / 25.0))
    before = setup(smooth)
    after = applied("interface-bleed", "gaussian", before, length=1.0)
    inside = slice(60, 140)
    # A Gaussian scales a cosine by exp(-(k s)^2 / 2); the design stands on chords to 1e-4.
    wave = 0.5 * np.cos(np.pi * before.x_mm / 25.0)
    expected = 0.5 - wave * np.exp(-0.5 * (np.pi / 25.0) ** 2)
    np.testing.assert_allclose(after.coordinate[inside], expected[inside], atol=2e-4)


def test_a_law_off_at_one_material_is_right_at_the_others(coupons: Make) -> None:
    effect = effects_for(PALETTE)["material-law"]
    places = np.array([m.coordinate for m in PALETTE.materials])
    before = coupons(len(places), coordinate=places, palette_coordinate=np.array([0.0, 1.5]))
    for form in effect.forms:
        after = form.apply(before, {form.size.name: -0.4})
        changed = after.log_factor + after.log_tilt
        own = [f"{m.id} {form.name.split()[-1]}" for m in PALETTE.materials].index(form.name)
        np.testing.assert_allclose(changed, np.where(np.arange(len(places)) == own, -0.4, 0.0))
