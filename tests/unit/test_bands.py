"""Bands: cuts lie where the nearest material changes, or at equal steps."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planner
from benchmarks.interfaces import BOX, FACES
from planner.grading.grade import shortfalls
from planner.grading.profile import Profile, equal_bands, natural_bands
from planner.grading.wish import between

LADDER = (0.3, 0.6, 1.0, 1.7, 3.0, 7.5, 24.0, 96.0, 160.0, 340.0)


def _nearest(modulus: float) -> int:
    return int(np.argmin([abs(math.log(modulus / rung)) for rung in LADDER]))


@settings(deadline=None, derandomize=True)
@given(
    knots=st.lists(st.floats(0.2, 500.0), min_size=2, max_size=6),
    shape=st.sampled_from(["log", "linear", "smooth"]),
)
def test_every_place_takes_the_nearest_material(knots: list[float], shape) -> None:
    profile = Profile("p", tuple(np.linspace(0, 1, len(knots)).tolist()), tuple(knots), shape)
    bands = natural_bands(profile, LADDER)
    assert bands[0].start == 0.0
    assert bands[-1].stop == 1.0
    for band, following in itertools.pairwise(bands):
        assert band.stop == following.start
        assert band.grade != following.grade
    for band in bands:
        for share in (0.01, 0.37, 0.5, 0.99):
            u = band.start + share * (band.stop - band.start)
            target = float(profile.modulus_MPa(u))
            # A target within rounding of a threshold may go either way.
            best = abs(math.log(target / LADDER[_nearest(target)]))
            assert abs(math.log(target / LADDER[band.grade])) <= best + 1e-9
            assert band.target_MPa[0] * (1 - 1e-9) <= target <= band.target_MPa[1] * (1 + 1e-9)


def test_log_profile_uses_every_material_once() -> None:
    bands = natural_bands(between("log", LADDER[0], LADDER[-1]), LADDER)
    assert [band.grade for band in bands] == list(range(10))
    total = math.log(LADDER[-1] / LADDER[0])
    for band, (a, b) in zip(bands[1:], itertools.pairwise(LADDER), strict=True):
        # Analytic: the cut between two rungs lies at their geometric mean.
        expected = math.log(math.sqrt(a * b) / LADDER[0]) / total
        assert band.start == pytest.approx(expected, rel=1e-12)


def test_equal_bands_take_the_log_middle() -> None:
    bands = equal_bands(between("log", 0.3, 340.0), LADDER, 4)
    assert [band.start for band in bands] == [0.0, 0.25, 0.5, 0.75]
    for band in bands:
        middle = math.sqrt(band.target_MPa[0] * band.target_MPa[1])
        assert band.grade == _nearest(middle)


def test_shortfalls_say_where_and_which() -> None:
    profile = Profile("p", (0.0, 0.5, 1.0), (0.03, 3.0, 3400.0), "log")
    low, high = shortfalls(profile, LADDER)
    assert (low.grade, high.grade) == (0, 9)
    # ln E runs from 0.03 to 3 over 0..0.5: the softest, 0.3, lies in the middle of it.
    assert (low.start, low.stop) == (0.0, pytest.approx(0.25))
    share = math.log(340.0 / 3.0) / math.log(3400.0 / 3.0)
    assert (high.start, high.stop) == (pytest.approx(0.5 + 0.5 * share), 1.0)
    assert low.target_MPa == (pytest.approx(0.03), pytest.approx(0.3))


def test_nothing_is_out_of_reach_between_two_materials() -> None:
    assert shortfalls(between("log", LADDER[0], LADDER[-1]), LADDER) == ()
    assert shortfalls(between("linear", LADDER[-1], LADDER[0]), LADDER) == ()


def test_a_modulus_that_was_read_off_a_table_is_in_reach() -> None:
    """The softest is 0.35940 MPa at a strain of 0.1, and shown as 0.359."""
    softest = planner.list_materials().moduli_MPa[0]
    assert softest > 0.359 == float(f"{softest:.3g}")
    assert planner.invert(0.359).reachable
    assert not planner.invert(0.355).reachable
    for least, reached in (("0.359MPa", True), ("0.355MPa", False)):
        assert (
            planner.grade(([40.0, 5.0, 5.0] * BOX, FACES), from_=least, to="FLX9750").ok is reached
        )
