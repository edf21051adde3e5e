"""Where a target lies between two materials, and bands of them in turn."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.grading.profile import Profile
from planner.grading.regions import blend_segments, laminated

LADDER = (1.0, 2.0, 4.0, 10.0)
RISING = Profile("rising", (0, 1), (1, 10), "log")
FALLING = Profile("falling", (0, 1), (12, 0.9), "linear")


def test_stretches_part_where_the_target_passes_a_material():
    found = blend_segments(RISING, LADDER)
    assert [(s.lower, s.upper) for s in found] == [(0, 1), (1, 2), (2, 3)]
    assert found[0].stop == pytest.approx(np.log10(2.0))
    found = blend_segments(FALLING, LADDER)
    assert [(s.lower, s.upper) for s in found] == [(3, 3), (2, 3), (1, 2), (0, 1), (0, 0)]
    assert all(s.ends_MPa[1] < s.ends_MPa[0] for s in found[1:4])
    steps = blend_segments(Profile("s", (0, 0.5, 0.5, 1), (2, 2, 3, 3), "log"), LADDER)
    assert [(s.lower, s.upper, s.run) for s in steps] == [(1, 1, 0), (1, 2, 1)]


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(["log", "linear", "smooth"]),
    st.floats(1.0, 9.9),
    st.floats(1.0, 9.9),
    st.integers(1, 7),
)
def test_bands_in_turn_stretch_as_the_target_does(shape, start, end, periods):
    """Under one force each period elongates by the integral of the target's compliance."""
    profile = Profile("p", (0.0, 1.0), (start, end), shape)
    laminate = laminated(profile, blend_segments(profile, LADDER), LADDER, periods)
    assert laminate[0][0].start == 0.0
    assert laminate[-1][0].stop == pytest.approx(1.0)
    own = sum((band.stop - band.start) / LADDER[band.grade] for band, _ in laminate)
    u = (np.arange(200_000) + 0.5) / 200_000
    target = float(np.mean(1.0 / profile.modulus_MPa(u)))
    assert own == pytest.approx(target, rel=1e-6)
    for (before, _), (after, _) in itertools.pairwise(laminate):
        assert before.stop == pytest.approx(after.start, abs=1e-12)


@pytest.mark.parametrize("periods", [1, 2, 3, 4])
@pytest.mark.parametrize("ends", [(1.0, 9.9), (9.9, 1.0), (1.0, 2.4), (7.0, 1.3)])
def test_bands_in_turn_begin_and_end_with_what_the_target_is_near_to(ends, periods):
    """What lies beyond a field that is held at its ends is all of the first or the last band."""
    profile = Profile("p", (0.0, 1.0), ends, "log")
    laminate = laminated(profile, blend_segments(profile, LADDER), LADDER, periods)
    for (band, _), end in zip((laminate[0], laminate[-1]), ends, strict=True):
        assert band.grade == int(np.argmin(np.abs(np.log(np.array(LADDER) / end))))
