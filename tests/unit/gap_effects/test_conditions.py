"""Effects of conditions and of unloading go the right way, off the palette's reference."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import expit

from planner.gap.effects import EFFECTS
from planner.palette import Reference
from planner.printers import palette_of
from planner.simulation.bar_solver import (
    SOFTENING_PEAKS,
    RELAXATION_TIMES_s,
    Setup,
    law_tables,
    predict,
)

Make = Callable[..., Setup]
Apply = Callable[..., Setup]
Middles = Callable[..., dict[str, float]]


@pytest.mark.parametrize("id", ["rate", "temperature", "moisture", "ageing", "orientation"])
def test_at_the_reference_the_palette_holds(id: str, coupons: Make, middles: Middles) -> None:
    before = coupons()
    for form in EFFECTS[id].forms:
        after = form.apply(before, middles(form))
        if not np.any(after.relaxing):
            np.testing.assert_allclose(after.log_factor, 0.0, atol=1e-15)
            np.testing.assert_allclose(after.log_tilt, 0.0, atol=1e-15)


@pytest.mark.parametrize("form", [f.name for f in EFFECTS["rate"].forms])
@pytest.mark.parametrize("size", [0.1, 0.4, 0.75])
def test_a_relaxing_law_shows_the_palettes_own_law_in_its_own_test(
    form: str, size: float, coupons: Make, applied: Apply
) -> None:
    laws = law_tables(palette_of())
    at = laws.coordinate[:7]
    # The palette's own tests: even pulls at its rate, here to a strain of 0.6.
    time_s = np.broadcast_to(np.linspace(0.0, 0.6 / 0.034, 64), (7, 64))
    before = coupons(
        7, steps=64, coordinate=at, palette_coordinate=laws.coordinate, time_s=time_s,
        travel_mm=25.0 * 0.034 * time_s,
    )  # fmt: skip
    first = EFFECTS["rate"].form(form).size
    after = applied("rate", form, before, **{first.name: size * first.high})
    shown, law = (predict(s, laws).force_N for s in (after, before))
    # 64 steps follow a curve to 1e-4 of its largest force; a step at rest says nothing.
    np.testing.assert_allclose(shown, law, rtol=1e-3, atol=1e-4 * law.max(axis=1).min())


@pytest.mark.parametrize("form", ["power-law", "graded-power-law", "power-of-time"])
def test_faster_is_stiffer(form: str, coupons: Make, applied: Apply) -> None:
    rates = 0.034 * np.array([0.01, 0.1, 1.0, 10.0, 100.0, 1000.0])
    after = applied("rate", form, coupons(rate_per_s=rates, coordinate=np.full(6, 0.3)))
    assert np.all(np.diff(after.log_factor) > 0.0)
    # A power law: the same for every decade.
    np.testing.assert_allclose(np.diff(after.log_factor, 2), 0.0, atol=1e-12)


@pytest.mark.parametrize("form", ["power-of-time", "graded-power-of-time"])
def test_what_is_held_is_as_soft_as_what_was_pulled_as_slowly(
    form: str, coupons: Make, applied: Apply, middles: Middles
) -> None:
    # To a strain of 0.3: fast and held for ten times as long, slowly, fast and back and forth.
    share = np.linspace(0.0, 1.0, 61)  # every corner is a step
    ends = [([0.0, 1.0, 10.0], [0.0, 1.0, 1.0]), ([0.0, 10.0], [0.0, 1.0]),
            ([0.0, 1.0, 1.5, 2.0], [0.0, 1.0, 0.5, 1.0])]  # fmt: skip
    time_s = np.array([10.0 * share, 10.0 * share, 2.0 * share])
    travel = np.array([np.interp(t, *at) for t, at in zip(time_s, ends, strict=True)])
    before = coupons(
        3, steps=61, coordinate=np.full(3, 0.3), time_s=time_s, travel_mm=0.3 * 25.0 * travel,
        rate_per_s=np.array([0.3, 0.03, 0.3]),
    )  # fmt: skip
    after = applied("rate", form, before, **middles(EFFECTS["rate"].form(form)))
    laws = law_tables(palette_of())
    ratio = predict(after, laws).force_N[:, 1:] / predict(before, laws).force_N[:, 1:]
    assert ratio[0, -1] == pytest.approx(ratio[1, -1], rel=1e-9)
    assert ratio[0, 5] == pytest.approx(ratio[2, -1], rel=1e-9)
    np.testing.assert_allclose(ratio[1:], ratio[1:, :1] * np.ones(60), rtol=1e-9)
    assert ratio[1, 0] < 1.0 < ratio[2, 0]


def test_the_fractional_law_is_a_power_of_time(coupons: Make, applied: Apply) -> None:
    exponent, onset = 0.2, 0.5
    one = coupons(1)
    after = applied("rate", "fractional", one, exponent=exponent, onset=onset, peak=0.0)
    t = np.geomspace(0.1, 2000.0, 30)
    shares = after.relaxing[0]
    shown = 1.0 - shares.sum() + np.exp(-t[:, None] / RELAXATION_TIMES_s) @ shares
    # The sum over half decades is off by 1e-3 inside the range of times; the part that relaxes
    # after 1e5 s stands still here, 9 % of (0.5 / 1e5)^0.2.
    np.testing.assert_allclose(shown, (1.0 + t / onset) ** -exponent, atol=0.02)


@pytest.mark.parametrize("form", [f.name for f in EFFECTS["temperature"].forms])
def test_warmer_is_softer(form: str, coupons: Make, applied: Apply) -> None:
    warm = np.array([5.0, 15.0, 23.0, 30.0, 40.0, 60.0])
    after = applied("temperature", form, coupons(temperature_C=warm, coordinate=np.full(6, 0.3)))
    assert np.all(np.diff(after.log_factor) < 0.0)


WAVES = [f"wave_{k}" for k in range(1, 8)]


@pytest.mark.parametrize("middle", [-50.0, -20.0, 23.0, 60.0, 110.0])
def test_a_transition_anywhere_is_among_the_courses(
    middle: float, coupons: Make, applied: Apply
) -> None:
    at = np.linspace(-60.0, 120.0, 10)
    # Five of ln stress from glass to rubber, 10 to 90 % of it within 44 K.
    falls = 5.0 * (expit((at - middle) / 10.0) - expit((23.0 - middle) / 10.0))
    before = coupons(10, temperature_C=at, coordinate=np.full(10, 0.5))

    def left(x: np.ndarray) -> np.ndarray:
        values = dict(zip(WAVES, x[1:].tolist(), strict=True))
        after = applied("temperature", "any-course", before, slope=math.exp(x[0]), **values)
        return np.concatenate([(after.log_factor + falls) / 0.03, x[1:]])

    found = least_squares(left, np.concatenate([[math.log(0.02)], np.zeros(7)])).x
    # Within 5 % of the stress, at details that three deviations hold.
    assert np.max(np.abs(left(found)[:10])) * 0.03 < 0.05
    assert np.max(np.abs(found[1:])) < 3.0


def test_the_glass_transition_lies_higher_in_harder_mixtures(coupons: Make, applied: Apply) -> None:
    before = coupons(temperature_C=np.full(6, 33.0))
    # A course that falls most near 23 degC in the middle of the palette.
    hump = {"wave_2": -0.5, "wave_3": 2.5, "wave_5": 0.9}
    steepest = [
        np.argmin(applied("temperature", "any-course", before, span=span, **hump).log_factor)
        for span in (-1.0, 0.0, 1.0)
    ]
    even = applied("temperature", "any-course", before, **hump).log_factor
    assert np.ptp(even) == 0.0
    # At 23 to 33 degC, with transitions 20 K lower and higher at the ends, the middle falls most.
    assert steepest[0] in (2, 3)
    assert steepest[2] in (2, 3)


@pytest.mark.parametrize("temperature_C", [-20.0, 5.0, 60.0])
def test_a_warmer_test_is_a_slower_one(
    temperature_C: float, coupons: Make, applied: Apply, middles: Middles
) -> None:
    """Williams, Landel & Ferry 1955: with relaxation all times shift by one factor, a_T."""
    laws = law_tables(palette_of())
    before = coupons(6, steps=64, palette_coordinate=laws.coordinate)
    relaxing = applied("rate", "spectrum", before, share=0.7, wave_1=1.0)
    warm = replace(relaxing, temperature_C=np.full(6, temperature_C))
    values = {"haste": 0.8, "wave_2": -1.0, "wave_3": 0.7}
    after = applied("temperature", "any-course", warm, **values)
    softer = np.exp(after.log_factor[:1])
    a_t = 1.0 / after.clock
    assert np.all(np.sign(temperature_C - 23.0) * np.log(a_t) < 0.0)
    slower = replace(relaxing, time_s=relaxing.time_s / a_t[:, None])
    shown, at_reference = (predict(s, laws).force_N for s in (after, slower))
    # Newton's method ends at 1e-10 of the force, and of 1e-4 of the stiffness at rest.
    np.testing.assert_allclose(shown, softer * at_reference, rtol=1e-8, atol=1e-10)
    # Where nothing relaxes, a test's time is nothing to it.
    still = applied("temperature", "any-course", replace(warm, relaxing=0.0 * warm.relaxing,
                    reference_relaxing=warm.reference_relaxing[:0]), **values)  # fmt: skip
    np.testing.assert_array_equal(
        predict(still, laws).force_N, predict(replace(still, clock=np.ones(6)), laws).force_N
    )


@pytest.mark.parametrize(("effect", "form"), [("ageing", "log-time"), ("moisture", "graded-fick")])
def test_any_details_leave_a_course_over_time_monotone(
    effect: str, form: str, coupons: Make, applied: Apply
) -> None:
    times = np.concatenate([[0.0], np.geomspace(0.03, 3e4, 59)])
    before = coupons(60, soak_h=times, age_days=times, coordinate=np.full(60, 0.3))
    rng = np.random.default_rng(5)
    for _ in range(5):
        details = dict(zip(WAVES, (2.0 * rng.standard_normal(7)).tolist(), strict=True))
        after = applied(effect, form, before, **details)
        course = np.diff(after.log_factor) * (1.0 if effect == "ageing" else -1.0)
        assert np.all(course >= 0.0)
        assert course.max() > 0.0


def test_soaking_softens_thin_sheet_first_and_saturates(
    coupons: Make, applied: Apply, middles: Middles
) -> None:
    hours = np.array([0.0, 1.0, 4.0, 24.0, 240.0, 1000.0])
    for form in EFFECTS["moisture"].forms:
        same = {"coordinate": np.full(6, 0.3), "soak_h": hours}
        after = form.apply(coupons(**same), middles(form, softening=0.3, peak=0.3))
        assert np.all(np.diff(after.log_factor) <= 0.0)
        # Saturated within 1 % of the size after 1000 h.
        assert after.log_factor[-1] == pytest.approx(np.log(0.7), abs=0.01)
    thin = applied("moisture", "fick", coupons(soak_h=np.full(6, 4.0)))
    thick = applied("moisture", "fick", coupons(soak_h=np.full(6, 4.0), thickness_mm=np.full(6, 5)))
    assert np.all(thin.log_factor < thick.log_factor)


@pytest.mark.parametrize("form", [f.name for f in EFFECTS["ageing"].forms])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_ageing_goes_one_way_ever_slower(
    form: str, sign: float, coupons: Make, applied: Apply
) -> None:
    days = np.array([1.0, 9.0, 17.0, 25.0, 33.0, 41.0])
    before = coupons(age_days=days, coordinate=np.full(6, 0.3))
    after = applied("ageing", form, before, change=sign * 0.1)
    grown = sign * np.diff(after.log_factor)
    assert np.all(grown > 0.0)
    assert np.all(np.diff(grown) < 0.0)
    assert after.log_factor[1] == pytest.approx(0.0, abs=1e-15)


def test_orientations_differ_as_each_form_says(coupons: Make, applied: Apply) -> None:
    before = coupons(3, orientation=np.arange(3))
    changes = {
        "build-direction": (0.0, 0.0, 0.2),
        "head-direction": (0.0, -0.2, -0.2),
        "swath-direction": (0.0, 0.2, 0.0),
        "three-way": (0.0, 0.1, 0.2),
        "strained-layers": (0.0, 0.0, 0.2),
    }
    for name, expected in changes.items():
        after = applied("orientation", name, before, change=0.2)
        np.testing.assert_allclose(after.log_factor, expected, atol=1e-15)
    along_z = replace(before, reference=Reference(orientation="z"))
    turned = applied("orientation", "build-direction", along_z, change=0.2)
    np.testing.assert_allclose(turned.log_factor, (-0.2, -0.2, 0.0), atol=1e-15)


def test_a_reference_that_says_nothing_is_the_standard(away: Make, middles: Middles) -> None:
    bare = replace(away(), reference=Reference())
    for id in ("rate", "temperature", "moisture", "ageing", "orientation"):
        for form in EFFECTS[id].forms:
            assert np.all(np.isfinite(form.apply(bare, middles(form)).log_factor))


def test_trends_are_largest_where_they_say(coupons: Make, applied: Apply) -> None:
    before = coupons(rate_per_s=np.full(6, 0.34))
    for peak, expected in ((0.0, 0), (0.4, 2), (1.0, 5)):
        after = applied("rate", "graded-power-law", before, rise=0.5, peak=peak)
        assert int(np.argmax(after.log_factor)) == expected
        assert after.log_factor.max() == pytest.approx(0.5)


def test_softening_vanishes_at_the_peak_and_grows_away_from_it(
    coupons: Make, middles: Middles
) -> None:
    for form in EFFECTS["softening"].forms:
        table = form.apply(coupons(), middles(form)).softening_table
        assert np.all(np.diff(table, axis=0) <= 0.0)
        assert np.all(np.diff(table[0]) >= -1e-15)
        assert np.all(table[:, 0] == 0.0)


def test_set_grows_with_the_peak(coupons: Make, applied: Apply, middles: Middles) -> None:
    for form in EFFECTS["permanent-set"].forms:
        after = form.apply(coupons(), middles(form))
        assert np.all(after.set_share > 0.0)
        assert np.all(np.diff(after.set_table) > 0.0)
        assert after.set_table[0] == 0.0
    below, beyond = (
        np.interp(e, SOFTENING_PEAKS, applied("permanent-set", "threshold", coupons(),
                                               threshold=0.3).set_table) / e
        for e in (0.1, 0.8)
    )  # fmt: skip
    assert below < 0.05 < 0.9 < beyond


def test_damage_goes_on_with_cycles_where_details_say_so(coupons: Make, applied: Apply) -> None:
    before = coupons()
    once = applied("softening", "damage", before, softening=0.4)
    more = applied("softening", "damage", before, softening=0.4, cycles=1.0, mixture=1.0)
    assert not np.any(once.fatigue)
    assert np.all(np.diff(more.softening) > 0.0)
    # Nowhere is more lost than there is, however far the details go.
    far = applied("softening", "damage", before, softening=0.7, mixture=4.0)
    assert np.all(far.softening < 1.0)
    np.testing.assert_allclose(more.fatigue / more.softening, 0.15)
    grown = applied("permanent-set", "power", before, cycles=2.0)
    assert grown.set_growth == pytest.approx(0.6)
