"""A whole part as a specimen: to first order, its response and its shares say what it would do.

Parts are mocked by bars of slices, whose answer to any change of their laws is known exactly.
"""

import numpy as np
import pytest

from planner.gap.effect import with_effects
from planner.gap.virtual import stated_effect
from planner.palette import Palette
from planner.simulation.bar_solver import Setup, law_tables, predict, unaltered
from planner.simulation.part_response import (
    PartResponse,
)

BARS = 24
END_MM = 14.0
STEPS = 61


def setup(palette: Palette, *, first_slice, time_s, travel_mm, **fields) -> Setup:
    """One test under the palette's own conditions."""
    one, reference = np.ones(1), palette.reference
    conditions = {
        "rate_per_s": reference.strain_rate_per_s, "temperature_C": reference.temperature_C,
        "soak_h": reference.soak_h, "age_days": reference.age_days, "width_mm": 6.0,
        "thickness_mm": 3.0, "gauge_mm": 40.0,
    }  # fmt: skip
    counts = int(first_slice[-1])
    return Setup(
        reference=reference,
        palette_coordinate=np.array([m.coordinate for m in palette.materials]),
        first_slice=first_slice,
        time_s=time_s[None],
        travel_mm=travel_mm[None],
        orientation=np.zeros(1, dtype=int),
        designs=(None,),
        x_mm=np.zeros(counts),
        **{name: value * one for name, value in conditions.items()},
        **fields,
        **unaltered(first_slice, len(travel_mm)),
    )


@pytest.fixture(scope="module")
def laws(palette):
    return law_tables(palette)


@pytest.fixture(scope="module")
def way():
    """Time and travel of a pull and of the way back."""
    travel = np.concatenate([np.linspace(0.0, END_MM, STEPS), np.linspace(END_MM, 0.0, STEPS)[1:]])
    return np.arange(len(travel)) * 0.5, travel


@pytest.fixture(scope="module")
def bar(palette, way):
    """A graded bar, in slices of one millimetre and more."""
    time, travel = way
    return setup(
        palette, first_slice=np.array([0, BARS]), time_s=time, travel_mm=travel,
        coordinate=np.linspace(0.0, 0.7, BARS), length_mm=np.full(BARS, 40.0 / BARS),
        area_mm2=np.full(BARS, 18.0),
    )  # fmt: skip


@pytest.fixture(scope="module")
def response(bar, laws):
    """What a solver of parts would say of that bar."""
    d = 1.2 * END_MM * np.array([0.02, *np.arange(0.1, 1.05, 0.1)])
    found = predict(
        bar.with_(travel_mm=d[None], time_s=d[None], **unaltered(bar.first_slice, len(d))),
        laws,
    )
    _, tangent = laws.stress_and_tangent_MPa(bar.coordinate, found.strain)
    softness = bar.length_mm / (bar.area_mm2 * tangent) * found.force_N[0][:, None]
    return PartResponse(
        "mock", d, found.force_N[0], bar.coordinate, found.strain,
        softness / softness.sum(axis=1, keepdims=True), thickness_mm=3.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def part(bar, response):
    """The same test of it as a whole part."""
    ones = np.ones(BARS)
    return bar.with_(length_mm=ones, area_mm2=ones, parts=(response,))


def test_unaltered_it_bears_what_the_response_says(bar, part, laws):
    exact, found = predict(bar, laws), predict(part, laws)
    # Cubics between the response's twelve steps.
    np.testing.assert_allclose(found.force_N, exact.force_N, rtol=2e-3, atol=1e-3)
    np.testing.assert_allclose(found.strain, exact.strain, rtol=2e-2, atol=2e-3)


@pytest.mark.parametrize(
    "effect",
    [
        "temperature:slope=0.03", "temperature:form=graded-exponential,slope=0.03,peak=0.2",
        "composition-offset:shift=0.03", "composition-offset:form=dot-gain,shift=0.04",
        "material-law:form=FLX9750 factor,log_factor=0.3",
        "material-law:form=FLX9740 tilt,log_tilt=0.3", "ageing:change=0.1",
        "moisture:softening=0.2",
        "rate:form=prony,share=0.5,centre=10", "machine-compliance:compliance=0.1",
        "rate:form=graded-prony,share=0.4,centre=10,peak=0.3", "grip-slack:slack=1",
        "grip-slip:slip=0.2,hold=2", "force-scale:log_gain=0.2", "force-offset:offset=0.2",
        "strain-scale:log_factor=0.1", "softening:softening=0.3,scale=0.1,power=1",
    ],
)  # fmt: skip
def test_effects_change_its_force_as_they_change_the_bar_s(bar, part, laws, palette, effect):
    one = [stated_effect(effect, palette)]
    warm = {"temperature_C": np.array([33.0]), "age_days": np.array([200.0]),
            "soak_h": np.array([20.0]), "rate_per_s": np.array([0.2])}  # fmt: skip
    exact, found = (
        predict(with_effects(s.with_(**warm), one), laws).force_N[0] for s in (bar, part)
    )
    plain = predict(bar, laws).force_N[0]
    change = np.abs(exact - plain).max()
    taut = exact > 0.0  # pushed back, strips give way sideways, and parts do not
    found, exact = found[taut], exact[taut]
    assert change > 0.015 * plain.max()
    assert np.abs(found - exact).max() < 0.1 * change


def test_each_bin_is_strained_at_its_own_rate(bar, part, laws, palette):
    """Softest slices are strained some times faster than the part as a whole."""
    one = [stated_effect("rate:rise=0.1", palette)]
    fast = {"rate_per_s": np.array([0.2])}
    ratio = part.rate_ratio
    strain = predict(bar, laws).strain[STEPS - 1]
    np.testing.assert_allclose(ratio, strain / (END_MM / 40.0), rtol=1e-2)
    exact = with_effects(bar.with_(**fast), one).stiffened(0.1 * np.log10(ratio))
    force = predict(exact, laws).force_N[0]
    found = predict(with_effects(part.with_(**fast), one), laws).force_N[0]
    change = np.abs(force - predict(bar, laws).force_N[0]).max()
    assert np.abs(found - force).max() < 0.1 * change
