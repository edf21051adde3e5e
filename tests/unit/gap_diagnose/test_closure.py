"""How far the gap shrinks on conditions that were left out."""

from dataclasses import replace

import numpy as np
import pytest

from planner.formats.units import QUANTITY_UNITS
from planner.gap.campaign import Campaign
from planner.gap.diagnose import closure
from planner.gap.diagnosis import Diagnosis, Gap
from planner.gap.effects import EFFECTS
from planner.gap.evidence.posterior_mode import Likelihood
from planner.gap.evidence.problem import Candidate, Problem
from planner.gap.evidence.weigh import Priors, reweigh, weigh
from planner.gap.noise import UNIT_GAINS
from planner.gap.observations import ObservationModel

FORCE = "force-scale"


def ready(campaign: Campaign, *effects: str) -> Problem:
    return Problem(campaign, ObservationModel(campaign), [EFFECTS[id] for id in effects])


def closed(problem: Problem, *verdict: str) -> Gap:
    weighed = weigh(problem, Priors())
    return closure(problem, weighed, {}, verdict, np.random.default_rng(0))


def scaled(campaign: Campaign, factors: list[float]) -> Campaign:
    specimens = tuple(
        replace(s, force_N=s.force_N * f) for s, f in zip(campaign.specimens, factors, strict=True)
    )
    return replace(campaign, specimens=specimens)


@pytest.mark.parametrize(
    ("columns", "held_out"),
    [
        ({"rate_mm_s": [0.085, 0.85, 8.5]}, "leave one condition out"),
        pytest.param({"rate_mm_s": [0.1, 0.2, 0.4, 0.8, 1.6, 3.2], "soak_h": [0.0, 24.0]},
                     "12 conditions left out, up to 2 at a time", marks=pytest.mark.slow),
        ({}, "2 specimens left out one at a time"),
        # Without the other nothing is known of a direction: specimens have to do.
        ({"orientation": ["x", "z"]}, "4 specimens left out one at a time"),
    ],
)  # fmt: skip
def test_what_is_left_out_goes_by_what_there_is(planned, imitated, columns, held_out) -> None:
    plan = planned(2, material=["FLX9760"], **columns)
    assert closed(ready(imitated(plan))).held_out == held_out


@pytest.mark.parametrize(
    ("temperatures", "levels"), [([23.0, 30.0, 38.0], 3), ([23.0, 23.6, 38.0], 2)]
)
def test_levels_are_left_out_where_there_are_three(
    planned, imitated, temperatures: list[float], levels: int
) -> None:
    """Of the effect's own column; 23 and 23.6 degC are not two temperatures."""
    plan = planned(2, material=["FLX9760"], temperature_C=temperatures)
    gap = closed(ready(imitated(plan, "temperature:slope=0.04"), "temperature"), "temperature")
    assert (gap.extrapolated is None) == (levels < 3)
    if levels == 3:
        assert gap.extrapolated < 0.6 * gap.extrapolated_before


def test_the_true_effect_closes_the_gap(of_rate: Diagnosis) -> None:
    """To a tenth: of 18 specimens, a third left out at a time."""
    gap = of_rate.gap
    assert gap.closed == pytest.approx(1.0, abs=0.15)
    low, high = gap.closed_interval
    assert low <= gap.closed <= high
    assert low > 0.6
    assert gap.after < 0.5 * gap.before
    assert not gap.negative_transfer
    # Neither stands in for the physics where rates are left out.
    assert gap.after < min(gap.recalibration_only, gap.generic)
    expected = 1.0 - (gap.after - gap.floor) / (gap.before - gap.floor)
    assert gap.closed == pytest.approx(expected, rel=1e-9)


def test_what_is_left_out_is_predicted_with_all_of_the_evidence(rate_campaign) -> None:
    """A part is for how far a name can be trusted; forms that are ruled out have none of it."""
    weighed = weigh(ready(rate_campaign, "rate", "skin"), Priors())
    _, odds = reweigh(weighed, {}, np.ones(len(rate_campaign.specimens)))
    gain = [value - weighed.logs.of(c.effects) - weighed.logs.forms(c) for value, c in odds]
    np.testing.assert_allclose(gain, [c.log_evidence for _, c in odds], atol=1e-9)
    assert np.ptp(gain) > 5.0


def test_what_is_left_out_is_predicted_by_effects_that_need_no_other_laws(rate_campaign) -> None:
    """A level of the laws, which is not added, is not what the effects were fitted beside."""
    problem = ready(rate_campaign, "rate")
    likelihood, _ = reweigh(weigh(problem, Priors()), {}, np.ones(len(rate_campaign.specimens)))
    laws = len(problem.calibrations)
    for off in problem.nuisances[:, :laws].T:
        assert not likelihood.coefficients(off)[:laws].any()
        assert Likelihood(problem).coefficients(off)[:laws].any()


def test_where_there_is_none_nothing_closes(of_nothing: Diagnosis) -> None:
    gap = of_nothing.gap
    assert gap.closed == 0.0
    assert gap.closed_interval is None
    assert gap.after == gap.before
    assert gap.before < 1.5 * gap.floor


def test_the_floor_is_the_scatter_of_replicates(planned, imitated) -> None:
    """Pairs 4 % up and down, and 8 %: by hand, to 2 % for the sensors' noise."""
    plan = planned(2, batches=1, material=["FLX9760"], rate_mm_s=[0.85, 8.5])
    exact = imitated(plan, scatter=0.0)
    problem = ready(scaled(exact, [1.04, 0.96, 1.08, 0.92]))
    pairs = problem.model.measured_N.reshape(2, 2, -1)
    # Over the pair's mean largest force, as both are.
    mean = pairs.mean(axis=1)
    course = np.repeat(np.mean((mean / mean.max(axis=1, keepdims=True)) ** 2, axis=1), 2)
    # Variance of two, of which the mean is known from themselves alone: 2 d^2.
    # And what the one batch shares, of which the pairs know nothing.
    level = 2.0 * np.array([0.04, 0.04, 0.08, 0.08]) ** 2 + problem.scatter.batch**2
    by_hand = np.sqrt(np.mean(level * course))
    assert closed(problem).floor == pytest.approx(by_hand, rel=0.02)


def test_without_replicates_there_is_no_floor_and_no_closure(planned, imitated) -> None:
    plan = planned(material=["FLX9760", "TangoPlus"], rate_mm_s=[0.085, 0.85, 8.5])
    gap = closed(ready(imitated(plan, "rate:rise=0.3,form=power-law"), "rate"), "rate")
    assert (gap.floor, gap.closed, gap.closed_interval) == (None, None, None)
    assert gap.after < gap.before


def test_one_specimen_has_a_gap_and_nothing_else(planned, imitated) -> None:
    problem = ready(imitated(planned(1, material=["FLX9760"])), "force-offset")
    gap = closed(problem, "force-offset")
    assert gap.before > 0.0
    assert (gap.after, gap.floor, gap.closed, gap.generic) == (None, None, None, None)
    assert "one specimen" in gap.held_out


def test_an_effect_that_makes_left_out_conditions_worse_is_flagged(planned, imitated) -> None:
    """Softer both when slow and when fast, and rate the only effect that there is.

    Without the fast ones it stiffens with rate, and is wrong by twice as much.
    """
    plan = planned(3, batches=1, material=["FLX9760"], rate_mm_s=[0.085, 0.85, 8.5])
    both = scaled(imitated(plan), [0.6] * 3 + [1.0] * 3 + [0.6] * 3)
    gap = closed(ready(both, "rate"), "rate")
    assert gap.negative_transfer
    assert gap.after > gap.before
    assert gap.closed < 0.0
    assert gap.extrapolated > gap.extrapolated_before


@pytest.mark.slow
def test_no_baseline_goes_beyond_what_was_measured_or_predicted(planned, imitated) -> None:
    """Forces in one file a thousand times too small: patterns would grow without an end."""
    plan = planned(3, material=["FLX9760", "TangoPlus"], rate_mm_s=[0.085, 0.85, 8.5])
    made = imitated(plan)
    problem = ready(scaled(made, [1e-3] + [1.0] * (len(made.specimens) - 1)), "rate")
    gap = closed(problem)
    assert gap.generic < 10.0 * gap.before


def in_pounds(campaign: Campaign, places: tuple[int, ...]) -> Campaign:
    newtons = QUANTITY_UNITS["force"]["lbf"]
    return scaled(
        campaign, [1 / newtons if k in places else 1.0 for k in range(len(campaign.specimens))]
    )


@pytest.mark.parametrize("places", [(0, 2), (1, 3), (0, 1, 3), (0, 1, 2)])
def test_a_unit_is_no_scatter_whichever_replicate_it_is_of(planned, imitated, places) -> None:
    """Of two replicates neither says which is in pounds; two of three may be, or all."""
    plain = imitated(planned(len(places), material=["FLX9760", "TangoPlus"]))
    problem = ready(in_pounds(plain, places))
    members = np.isin(np.arange(len(plain.specimens)), places).astype(float)
    known = Candidate((FORCE,), members=members, log_gain=-float(UNIT_GAINS[0]))
    floors = problem.replicate_floor(known), ready(plain).replicate_floor()
    np.testing.assert_allclose(*floors, rtol=1e-9)


def test_one_that_is_left_tells_of_a_gain_that_several_had(planned, imitated) -> None:
    """Two of two conditions are in pounds: a fold that leaves out one of them knows the other."""
    plain = imitated(planned(2, material=["FLX9760"], rate_mm_s=[0.085, 0.85, 8.5]))
    weighed = weigh(ready(in_pounds(plain, (0, 2)), FORCE), Priors())
    weight = np.where(np.arange(6) < 2, 0.0, 1.0)
    _, odds = reweigh(weighed, {}, weight)
    _, best = max(odds, key=lambda found: found[0])
    assert best.members is not None
    assert best.members.tolist() == [0, 0, 1, 0, 0, 0]
