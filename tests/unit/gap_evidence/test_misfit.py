"""What becomes of the probability of a hypothesis that leaves too much."""

import pytest

from planner.gap.evidence.posterior import FORMLESS, share_given_up


@pytest.mark.parametrize(
    ("as_it_is", "departing", "given_up"),
    [
        (1.2, 1.0, 0.0),  # fits
        (4.0, 1.0, 0.0),  # an inexact form of what explains 94 % of a mean square of 51
        (8.0, 2.0, FORMLESS),  # explains 86 %, and departures do not do
        (20.0, 1.0, FORMLESS),  # 62 %: departures do the rest
        (30.0, 1.0, 1.0),  # 42 %: departures do more than the effect
        (20.0, 2.0, 1.0),  # neither
    ],
)
def test_share_given_up_goes_by_what_is_explained(as_it_is, departing, given_up) -> None:
    assert share_given_up(51.0, as_it_is, departing, 1.25) == given_up


def test_where_there_is_little_to_explain_a_misfit_is_a_misfit() -> None:
    """Of a mean square of 1.4, one that leaves 1.35 explains an eighth."""
    assert share_given_up(1.4, 1.35, 1.3, 1.25) == 1.0
