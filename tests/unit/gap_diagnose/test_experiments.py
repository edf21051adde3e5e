"""Which test to do next: what it is expected to tell."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.gap import design
from planner.gap.design import next_experiments
from planner.gap.diagnose import diagnose
from planner.gap.diagnosis import Diagnosis, Experiment, Hypothesis
from planner.gap.effects import EFFECTS
from planner.gap.evidence.posterior_mode import Likelihood
from planner.gap.evidence.problem import Candidate, Problem
from planner.gap.observations import ObservationModel


@pytest.fixture(scope="module")
def problem(planned, imitated) -> Problem:
    campaign = imitated(planned(2, material=["TangoPlus", "FLX9760"]))
    effects = [EFFECTS[id] for id in ("rate", "temperature")]
    return Problem(campaign, ObservationModel(campaign), effects)


def candidate(problem: Problem, effect: str, form: str, s: float) -> Candidate:
    signed = next(b for b in problem.signed_forms if (b.effect.id, b.form.name) == (effect, form))
    return Candidate((effect,), ((signed, (s, *[0.0] * signed.shapes)),))


def asked(problem: Problem, *candidates: Candidate) -> tuple[Experiment, ...]:
    share = 1.0 / len(candidates)
    ranking = [Hypothesis(c.effects, share) for c in candidates]
    exact = Likelihood(problem)
    weighed = SimpleNamespace(
        plain=exact,
        best={c.effects: c for c in candidates},
        mode_of=lambda _: SimpleNamespace(likelihood=exact),
    )
    return next_experiments(problem, weighed, ranking)  # type: ignore[arg-type]


def test_what_predicts_alike_is_not_told_apart(problem: Problem) -> None:
    """By no test: the information is nought, to rounding."""
    one = candidate(problem, "rate", "power-law", 0.5)
    other = replace(one, effects=("temperature",))
    for experiment in asked(problem, one, other):
        assert experiment.expected_gain_nats == pytest.approx(0.0, abs=1e-9)
        assert experiment.splits == ()


def test_a_clear_split_is_worth_the_odds_and_no_more(problem: Problem) -> None:
    """Half and half: ln 2, to 1 % where hypotheses lie many deviations apart."""
    none, rate = Candidate(()), candidate(problem, "rate", "power-law", 0.9)
    best = asked(problem, none, rate)[0]
    assert "rate_mm_s" in best.change
    assert best.expected_gain_nats == pytest.approx(np.log(2.0), rel=0.01)
    assert best.splits == (("none", "rate"),)


def test_two_effects_are_split_along_their_own_columns(problem: Problem) -> None:
    rate = candidate(problem, "rate", "power-law", 0.9)
    temperature = candidate(problem, "temperature", "exponential", 0.9)
    found = asked(problem, rate, temperature)
    assert {"rate_mm_s", "temperature_C"} & set(found[0].change)
    assert found[0].splits == (("rate", "temperature"),)


def test_information_is_within_its_bounds_and_the_best_comes_first(problem: Problem) -> None:
    """From 0 to ln of the number of hypotheses, sorted by what an hour yields."""
    candidates = [
        Candidate(()),
        candidate(problem, "rate", "power-law", 0.3),
        candidate(problem, "temperature", "exponential", 0.3),
    ]
    found = asked(problem, *candidates)
    assert len(found) == 3
    assert all(0.0 <= x.expected_gain_nats <= np.log(3.0) + 1e-9 for x in found)
    hourly = [x.expected_gain_nats / x.hours for x in found]
    assert hourly == sorted(hourly, reverse=True)
    assert all(x.hours >= 0.5 for x in found)


def test_a_test_planned_for_two_reasons_is_proposed_once(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    none, rate = Candidate(()), candidate(problem, "rate", "power-law", 0.9)
    usual = design.trials_of

    def twice(*given):
        trials = usual(*given)
        again = [replace(t.specimen, id=f"{t.specimen.id} again") for t in trials]
        return [*trials, *(replace(t, specimen=s) for t, s in zip(trials, again, strict=True))]

    monkeypatch.setattr(design, "trials_of", twice)
    details = [found.detail for found in asked(problem, none, rate)]
    assert len(set(details)) == len(details) == 3


@pytest.mark.parametrize(("share", "distance"), [(0.5, 1.0), (0.5, 2.0), (0.1, 2.0), (0.03, 3.0)])
def test_information_between_two_is_that_of_their_mixture(share: float, distance: float) -> None:
    """By quadrature, to a seventh at most."""
    y, shares = np.linspace(-9.0, 9.0 + distance, 4001), np.array([1.0 - share, share])
    mean = np.array([0.0, distance])
    density = np.exp(-0.5 * (y - mean[:, None]) ** 2) / np.sqrt(2.0 * np.pi)
    ratio = np.log(density / (shares @ density))
    exact = float(shares @ np.trapezoid(density * ratio, y, axis=1))
    gain, _ = design._information(mean[:, None], np.eye(1), shares)
    assert gain == pytest.approx(exact, rel=1.0 / 7.0)


def test_a_lone_hypothesis_asks_for_nothing(problem: Problem) -> None:
    assert asked(problem, Candidate(())) == ()


def test_diagnoses_ask_for_three(of_rate: Diagnosis, of_nothing: Diagnosis) -> None:
    for diagnosis in (of_rate, of_nothing):
        assert len(diagnosis.next_experiments) == 3
        for x in diagnosis.next_experiments:
            assert 0.0 <= x.expected_gain_nats <= np.log(6.0)
            assert x.change
            assert x.detail


@pytest.mark.slow
def test_rigid_materials_alone_have_a_diagnosis_and_no_test_to_propose(rate_campaign) -> None:
    palette = rate_campaign.palette
    rigid = tuple(replace(m, deformation="plastic") for m in palette.materials)
    found = diagnose(replace(rate_campaign, palette=replace(palette, materials=rigid)))
    assert "rate" in found.verdict
    assert found.next_experiments == ()
