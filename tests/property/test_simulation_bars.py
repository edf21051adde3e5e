"""What holds for any bar: symmetry, scaling, equilibrium, and more displacement, more force."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import list_materials, simulate
from planner.simulation.bar import Bar

# Newton's tolerance on the force is 1e-11 a slice; sums over 30 slices stay below this.
RTOL = 1e-9


@st.composite
def bars(draw: st.DrawFn) -> Bar:
    """Between TangoPlus and FLX9795, sections of 2 to 1, so that none breaks at 10 %."""
    n = draw(st.integers(1, 30))
    figures = st.lists(st.floats(0.0, 1.0), min_size=n, max_size=n)
    length, coordinate, area = (np.array(draw(figures)) for _ in range(3))
    edges = np.concatenate([[0.0], np.cumsum(0.1 + length)])
    return Bar(edges, coordinate, 10.0 + 10.0 * area)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(bars())
def test_a_reversed_bar_has_the_same_force_and_its_strains_reversed(bar: Bar) -> None:
    reverse = Bar(bar.edges_mm[-1] - bar.edges_mm[::-1], bar.coordinate[::-1], bar.area_mm2[::-1])
    a, b = (simulate(one, to_strain=0.1, steps=4) for one in (bar, reverse))
    np.testing.assert_allclose(a.force_N, b.force_N, rtol=RTOL)
    np.testing.assert_allclose(a.strain, b.strain[:, ::-1], rtol=RTOL)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(bars(), st.floats(0.1, 10.0))
def test_force_goes_with_the_section_and_displacement_with_the_length(
    bar: Bar, factor: float
) -> None:
    larger = Bar(factor * bar.edges_mm, bar.coordinate, factor * bar.area_mm2)
    a, b = (simulate(one, to_strain=0.1, steps=4) for one in (bar, larger))
    np.testing.assert_allclose(factor * a.force_N, b.force_N, rtol=RTOL)
    np.testing.assert_allclose(factor * a.displacement_mm, b.displacement_mm, rtol=RTOL)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(bars())
def test_one_force_runs_through_all_slices_and_their_elongations_add_up(bar: Bar) -> None:
    result = simulate(bar, to_strain=0.1, steps=5)
    assert len(result.force_N) == 6
    np.testing.assert_allclose(
        result.stress_MPa * bar.area_mm2,
        result.force_N[:, None] * np.ones(len(bar.area_mm2)),
        rtol=RTOL,
    )
    np.testing.assert_allclose(result.strain @ bar.length_mm, result.displacement_mm, rtol=RTOL)
    assert (np.diff(result.force_N) > 0.0).all()
    low, high = result.force_interval_N[1:].T
    assert ((low < result.force_N[1:]) & (result.force_N[1:] < high)).all()


@settings(derandomize=True, deadline=None, max_examples=25)
@given(bars(), st.data())
def test_dividing_a_slice_changes_nothing(bar: Bar, data: st.DataObject) -> None:
    cut = data.draw(st.floats(0.01, 0.99)) * bar.gauge_mm
    finer = Bar.between(
        np.union1d(bar.edges_mm, [cut]),
        *(
            values[np.searchsorted(bar.edges_mm, np.union1d(bar.edges_mm, [cut])[:-1], "right") - 1]
            for values in (bar.coordinate, bar.area_mm2)
        ),
        None,
    )
    a, b = (simulate(one, to_strain=0.1, steps=3) for one in (bar, finer))
    np.testing.assert_allclose(a.force_N, b.force_N, rtol=RTOL)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(bars(), st.integers(1, 40))
def test_the_way_there_does_not_matter(bar: Bar, steps: int) -> None:
    """Elastic: any number of steps, up or back down, meets the same force at a displacement."""
    once = simulate(bar, to_strain=0.1, steps=1)
    cycle = simulate(bar, to_strain=0.1, steps=steps, protocol="cyclic", cycles=2)
    peaks = cycle.force_N[[steps, 3 * steps]]
    np.testing.assert_allclose(peaks, once.force_N[-1], rtol=RTOL)
    np.testing.assert_allclose(
        cycle.force_N[: steps + 1], cycle.force_N[2 * steps : steps - 1 : -1], rtol=RTOL
    )


def test_a_bar_of_one_mixture_pulls_as_the_mixture_is() -> None:
    """What `invert` tells of a mixture: both go the way between grades that all of them choose."""
    model = list_materials().model
    for coordinate in np.linspace(0.02, 0.98, 13).tolist():
        bar = Bar(np.array([0.0, 10.0]), np.array([coordinate]), np.array([10.0]))
        secant_MPa = simulate(bar, to_strain=0.1, steps=1).force_N[-1] / 10.0 / 0.1
        # The tables' cubics over strain are off by 5e-5 near a kink, where laws cross.
        np.testing.assert_allclose(secant_MPa, model.modulus_MPa(coordinate, 0.1), rtol=1e-4)
