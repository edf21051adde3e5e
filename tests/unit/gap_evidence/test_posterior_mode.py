"""Candidates at their mode on the forward model, by likelihoods of scatter and discrepancy."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from benchmarks.withheld.ablated import altered
from planner.gap.campaign import Campaign
from planner.gap.effects import EFFECTS
from planner.gap.evidence.posterior_mode import Likelihood, PosteriorMode, _State, posterior_mode
from planner.gap.evidence.problem import Candidate, Problem, joined
from planner.gap.evidence.weigh import (
    _in_all_forms,
    _likelihoods,
    _with_parts_alone,
)
from planner.gap.observations import ObservationModel
from planner.simulation.bar_solver import predict

RISE = 0.12


@pytest.fixture(scope="module")
def plan(planned) -> Campaign:
    """Two materials at three rates, two of each."""
    return planned(2, material=["TangoPlus", "FLX9760"], rate_mm_s=[0.085, 0.85, 8.5])


@pytest.fixture(scope="module")
def problem(plan, imitated) -> Problem:
    campaign = imitated(plan, f"rate:rise={RISE},form=power-law")
    return Problem(campaign, ObservationModel(campaign), [EFFECTS["rate"]])


def candidate(problem: Problem, form: str, size: float = 0.6) -> Candidate:
    signed = next(b for b in problem.signed_forms if b.form.name == form)
    return Candidate(("rate",), ((signed, (size, *[0.0] * signed.shapes)),))


def test_a_world_integrates_its_nuisances_out(problem: Problem) -> None:
    """As the normal density with the covariance that noise and nuisances make together."""
    likelihood = Likelihood(problem, scale=1.3, discrepancy=0.02)
    j = np.concatenate([problem.nuisances, 0.02 * problem.discrepancy], axis=1)
    residual = problem.target
    covariance = 1.3**2 * np.eye(len(residual)) + j @ j.T
    expected = -0.5 * (
        np.linalg.slogdet(covariance)[1] + residual @ np.linalg.solve(covariance, residual)
    )
    assert likelihood.none == pytest.approx(expected, rel=1e-9)


def test_own_sizes_and_discrepancies_are_integrated_out_together(problem: Problem) -> None:
    """As the normal density with the covariance that all of them make."""
    of, rng = problem.table.specimen, np.random.default_rng(4)
    own = rng.standard_normal((2, len(of)))
    each = [(of[:, None] == np.arange(of.max() + 1)) * columns[:, None] for columns in own]
    residual, j = problem.target, np.concatenate([problem.nuisances, *each], axis=1)
    covariance = np.eye(len(of)) + j @ j.T + 0.02**2 * problem.discrepancy @ problem.discrepancy.T
    left = residual @ np.linalg.solve(covariance, residual)
    found = Likelihood(problem, discrepancy=0.02).elimination(residual, own=own)
    assert found.products[0, 0] == pytest.approx(left, rel=1e-9)
    assert found.none == pytest.approx(-0.5 * (np.linalg.slogdet(covariance)[1] + left), rel=1e-9)


def test_likelihoods_share_one_and_their_scatter_is_as_unsure_as_it_is(problem: Problem) -> None:
    """They sum to one; how far levels scatter, and the rest, are normal each, by its moments."""
    prior, _ = _likelihoods(problem)
    assert sum(np.exp(each.log_share) for each in prior) == pytest.approx(1.0, rel=1e-12)
    exact = [each for each in prior if (each.discrepancy, each.laws) == (0.0, prior[0].laws)]
    share = np.exp([each.log_share for each in exact])
    rest, sd = np.log([each.scale for each in exact]), problem.scatter.log_sd
    level = rest + np.log([each.level for each in exact])
    for logs in (rest, level):
        moments = [share @ logs**power / share.sum() for power in (1, 2, 3, 4)]
        np.testing.assert_allclose(moments, [0.0, sd**2, 0.0, 3.0 * sd**4], atol=1e-12)
    assert share @ (rest * level) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("level", [0.4, 1.7])
def test_another_scatter_of_levels_changes_the_covariance_by_that_much(
    problem: Problem, level: float
) -> None:
    """As if the noise had been made with that scatter from the start."""
    first = problem.noise.first_row
    likelihood = Likelihood(problem, level=level)
    change = np.where(problem.table.is_field, 0.0, problem.sensitivity)
    whole = scipy.linalg.block_diag(*problem.noise.blocks)
    for a, b in itertools.pairwise(first):
        own = problem.scatter.specimen * change[a:b]
        whole[a:b, a:b] -= (1.0 - level**2) * np.outer(own, own)
    white = problem.noise.whiten(problem.noise.whiten(whole).T)
    covariance = white + problem.nuisances @ problem.nuisances.T
    residual = problem.target
    expected = -0.5 * (
        np.linalg.slogdet(covariance)[1] + residual @ np.linalg.solve(covariance, residual)
    )
    assert likelihood.none == pytest.approx(expected, rel=1e-9)


def test_the_mode_is_found_and_flat(problem: Problem) -> None:
    likelihood = Likelihood(problem)
    mode = posterior_mode((likelihood,), candidate(problem, "power-law"), likelihood)
    ((signed, point),) = mode.candidate.parts
    low, high = (
        signed.values(signed.point(mode.coordinates + k * np.sqrt(np.diagonal(mode.covariance()))))[
            "rise"
        ]
        for k in (-3.0, 3.0)
    )
    assert low < RISE < high
    # The target is the whole residual, for a form that is nearly linear in its size.
    left = mode.target - mode.slopes @ mode.coordinates
    changes = problem.changes(problem.predictions([mode.candidate]))
    change = problem.noise.whiten(problem.residual - changes[0])
    assert left == pytest.approx(change, abs=1e-9)
    gradient = likelihood.products(np.stack([left, mode.slopes[:, 0]], axis=1))[1, 0]
    # An iteration that gains 0.05 nats is the last: half a squared step over the curvature.
    curvature = likelihood.products(mode.slopes)[0, 0] + 1.0
    assert 0.5 * (gradient - mode.coordinates[0]) ** 2 / curvature < 0.05
    assert signed.values(point)["rise"] == pytest.approx(RISE, rel=0.2)


def test_a_search_that_ends_early_is_weighed_by_what_it_reached(
    planned, imitated, monkeypatch
) -> None:
    """What the model linear about its last point promises beyond is no evidence."""
    plan = planned(2, material=["TangoPlus", "FLX9760"], protocol=["monotonic", "cyclic"])
    campaign = imitated(plan, "softening:softening=0.5,scale=0.3,power=1.5,form=damage", seed=3)
    problem = Problem(campaign, ObservationModel(campaign), [EFFECTS["softening"]])
    likelihood = Likelihood(problem)
    signed = next(b for b in problem.signed_forms if b.form.name == "damage")
    start = Candidate(("softening",), ((signed, (0.5, *[0.9] * signed.shapes)),))
    mode = posterior_mode((likelihood,), start, likelihood)
    monkeypatch.setattr("planner.gap.evidence.posterior_mode._STEPS", 2)
    early = posterior_mode((Likelihood(problem),), start, Likelihood(problem))
    evidence = early.eliminated(likelihood).none
    assert early.unkept > 50.0 > 0.5 > mode.unkept
    assert evidence < mode.eliminated(likelihood).none - 50.0
    # Laplace's: the height at the point, and how wide the linear model is there.
    left = early.target - early.slopes @ early.coordinates
    height = likelihood.elimination(left).none - 0.5 * float(early.coordinates @ early.coordinates)
    wide = 0.5 * np.linalg.slogdet(early.covariance())[1]
    assert evidence == pytest.approx(height + wide, abs=1e-6)


def test_a_mode_far_behind_is_found_roughly_with_fewer_runs(problem: Problem, monkeypatch) -> None:
    """To a twentieth of what it is too far behind by; the search ends where less is promised."""
    runs = []
    monkeypatch.setattr(
        "planner.gap.evidence.problem.predict", lambda *a, **k: runs.append(1) or predict(*a, **k)
    )

    def evidence(likeliest: float) -> tuple[float, int]:
        likelihood = Likelihood(problem)
        likelihood.likeliest = likeliest
        runs.clear()
        mode = posterior_mode((likelihood,), candidate(problem, "power-law", 0.9), likelihood)
        return mode.eliminated(likelihood).none, len(runs)

    exact, most = evidence(-np.inf)
    rough, fewer = evidence(exact + 1000.0)
    assert exact - 950.0 / 20.0 < rough <= exact + 0.1
    assert fewer < 0.7 * most
    assert evidence(exact + 45.0) == (exact, most)


def test_a_mode_is_that_of_the_world_in_which_it_is_likeliest(planned, imitated) -> None:
    """Not of the sloppier one that the search began in, however much its linear model promises."""
    plan = planned(2, material=["TangoPlus", "FLX9760"], rate_mm_s=[0.085, 0.85, 8.5, 85.0])
    campaign = imitated(plan, "rate:share=0.6,form=prony")
    problem = Problem(campaign, ObservationModel(campaign), [EFFECTS["rate"]])
    likelihoods = (
        Likelihood(problem),
        Likelihood(problem, laws=3.0),
        Likelihood(problem, discrepancy=0.06),
    )
    mode = posterior_mode(likelihoods, candidate(problem, "graded-prony"), likelihoods[2])
    assert mode.likelihood is likelihoods[0]
    assert mode.eliminated(likelihoods[0]).none > mode.eliminated(likelihoods[2]).none


@pytest.mark.parametrize("form", ["prony", "spectrum", "graded-power-law"])
def test_coordinates_and_places_are_one_to_one(problem: Problem, form: str) -> None:
    signed = next(b for b in problem.signed_forms if b.form.name == form)
    rng = np.random.default_rng(3)
    for _ in range(20):
        at = rng.standard_normal(1 + signed.shapes + len(signed.form.details))
        assert signed.coordinates(signed.point(at)) == pytest.approx(at, abs=1e-6)


def test_a_discrepancy_is_asked_for_where_no_form_fits(plan, imitated) -> None:
    """Force off by 5 % along the path, alike in replicates: no scatter, and no rate."""
    campaign = imitated(plan, "softening")
    problem = Problem(campaign, ObservationModel(campaign), [EFFECTS["rate"]])
    bent = np.sin(np.linspace(0.0, 6.0, len(problem.table))) * 0.05
    exact, off = Likelihood(problem), Likelihood(problem, discrepancy=0.06)
    residual = problem.target
    whitened = residual + problem.noise.whiten(bent)
    gained = off.elimination(whitened).none - exact.elimination(whitened).none
    assert gained > off.none - exact.none


def test_errors_are_those_of_features_that_laws_leave(problem: Problem) -> None:
    found = candidate(problem, "power-law")
    change, level = problem.explained(found), problem.calibration[:, 0]
    exact = altered(problem, residual=change, target=problem.noise.whiten(change))
    assert Likelihood(exact).error(found) == pytest.approx(0.0, abs=1e-9)
    # What a law's level is off by is mostly taken for that.
    off = altered(exact, residual=change + level, target=problem.noise.whiten(change + level))
    likelihood, of = Likelihood(off), problem.table.specimen
    whole = [np.sqrt(np.mean(level[of == one] ** 2)) for one in np.unique(of)]
    forces, strains = likelihood.error(found).T
    assert 0.0 < forces.sum() < 0.5 * sum(whole)
    assert not strains.any()  # no camera looked on
    assert likelihood.error(Candidate(()))[:, 0].sum() > forces.sum()


def test_a_part_of_the_likeliest_is_settled_from_where_it_is_there(problem: Problem) -> None:
    """An effect that had settled far off alone is as likely as it is in its place in a pair."""
    effects = [EFFECTS["rate"], EFFECTS["force-offset"]]
    both = Problem(problem.campaign, problem.model, effects)
    likelihood = Likelihood(both)
    alone = posterior_mode((likelihood,), candidate(both, "power-law"), likelihood)
    beside = next(c for c in alone.beside if c.effects == ("force-offset",))
    pair = posterior_mode(
        (likelihood,), joined([*alone.candidate.parts, *beside.parts]), likelihood
    )
    astray = replace(alone, target=2.0 * alone.target)

    def odds(one: PosteriorMode) -> float:
        return one.eliminated(likelihood).none

    found = _with_parts_alone([astray, pair], (likelihood,), odds)
    assert {one.candidate.effects for one in found} == {
        ("rate",), ("force-offset",), ("force-offset", "rate")
    }  # fmt: skip
    (rate,) = (one for one in found if one.candidate.effects == ("rate",))
    assert odds(astray) + 10.0 < odds(alone)
    assert odds(rate) == pytest.approx(odds(alone), abs=0.1)  # as far as modes are found


@pytest.fixture(scope="module")
def slack(planned, imitated) -> Problem:
    """Two materials, four of each, whose grips lose a tenth to seven tenths of a millimetre."""
    campaign = imitated(planned(4, material=["TangoPlus", "FLX9760"]))
    problem = Problem(campaign, ObservationModel(campaign), [EFFECTS["grip-slack"]])
    signed = next(b for b in problem.signed_forms if b.form.name == "dead-travel")
    lost = [joined([(signed, (np.sqrt(s / signed.form.size.high),))]) for s in LOST_MM]
    each = problem.changes(problem.predictions(lost))[
        problem.table.specimen, np.arange(len(problem.table))
    ]
    return altered(problem, residual=each, target=problem.noise.whiten(each))


LOST_MM = (0.1, 0.14, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7)


def test_specimens_own_sizes_are_found_where_they_differ_by_a_factor(slack: Problem) -> None:
    """By a factor of seven, to 15 %: the prior draws to the middle, cubics miss a little."""
    likelihood = Likelihood(slack)
    signed = next(b for b in slack.signed_forms if b.form.name == "dead-travel")
    mode = posterior_mode((likelihood,), joined([(signed, (0.6,))]), likelihood)
    own = mode.with_own_sizes(mode.candidate)
    ((_, point),) = own.parts
    found = signed.values(point)["slack"] * own.own_sizes(own.own)[0]
    assert found[0] == pytest.approx(LOST_MM, rel=0.15)


def test_a_mode_beside_own_sizes_is_the_likeliest_with_their_volume(slack: Problem) -> None:
    """A larger effect makes own sizes cheap; what integrating over them costs holds that."""
    likelihood = Likelihood(slack)
    signed = next(b for b in slack.signed_forms if b.form.name == "dead-travel")
    mode = posterior_mode((likelihood,), joined([(signed, (0.6,))]), likelihood)
    costs = [
        _State(slack, mode.candidate, mode.coordinates + step).cost(likelihood)
        for step in (-0.2, -0.1, 0.0, 0.1, 0.2)
    ]
    assert min(costs) > costs[2] - 0.05  # nats, at which a search ends
    assert costs[0] > costs[1] > costs[2] < costs[3] < costs[4]
    curvature = likelihood.products(mode.slopes, mode.own)[0, 0] + 1.0
    evidence = likelihood.offset - costs[2] - 0.5 * np.log(curvature)
    assert mode.eliminated(likelihood).none == pytest.approx(evidence, abs=0.05)


def test_what_a_mode_leaves_is_the_same_of_its_model_and_of_the_forward_model(
    slack: Problem,
) -> None:
    """Folds compare both: where they differ, no candidate moves to what the others say."""
    likelihood = Likelihood(slack)
    signed = next(b for b in slack.signed_forms if b.form.name == "dead-travel")
    mode = posterior_mode((likelihood,), joined([(signed, (0.6,))]), likelihood)
    state = _State(slack, mode.candidate, mode.coordinates)
    left = mode.target - mode.slopes @ mode.coordinates
    assert state.left_at_none(mode.deviates, mode.own) == pytest.approx(left, abs=1e-9)


def test_errors_are_of_each_specimens_own_size(planned, imitated) -> None:
    """Slack of four specimens that differ by a factor: its mean alone closes little."""
    plan = planned(4, material=["TangoPlus", "FLX9760"])
    campaign = imitated(plan, "grip-slack:slack=0.6,form=taking-up", seed=5)
    problem = Problem(campaign, ObservationModel(campaign), [EFFECTS["grip-slack"]])
    likelihood = Likelihood(problem)
    signed = next(b for b in problem.signed_forms if b.form.name == "taking-up")
    start = Candidate(("grip-slack",), ((signed, (0.3, *[0.0] * signed.shapes)),))
    mode = posterior_mode((likelihood,), start, likelihood)
    own = mode.with_own_sizes(mode.candidate)
    assert own.own is not None
    assert own.own.shape == (1, 8)
    assert np.ptp(own.own) > 0.3  # of sizes drawn with a deviation of a third
    assert likelihood.error(own).sum() < 0.8 * likelihood.error(mode.candidate).sum()


def test_errors_of_strays_are_not_counted(problem: Problem) -> None:
    rows, residual = problem.table.specimen == 0, problem.explained(Candidate(()))
    exact = altered(problem, residual=residual + rows, target=0.0 * problem.target)
    assert Likelihood(exact).error(Candidate(())).max() > 0.1
    stray = altered(exact, strays=np.arange(len(problem.strays)) == 0)
    assert not Likelihood(stray).error(Candidate(())).any()


def test_a_form_that_fits_worse_than_nothing_is_not_followed(problem: Problem) -> None:
    """A gauge length taken from another drawing is never a little off: no other effect mends it."""
    wrong = "other-length"
    campaign, rate = problem.campaign, EFFECTS["rate"]
    scale = EFFECTS["strain-scale"]
    tried = replace(scale, forms=tuple(f for f in scale.forms if f.name in ("factor", wrong)))
    both = Problem(campaign, problem.model, [rate, tried])
    likelihood = Likelihood(both)
    alone = [
        posterior_mode((likelihood,), c, likelihood)
        for c in PosteriorMode.of_nothing(likelihood).beside
    ]
    best = {id: next(s for s in alone if s.candidate.effects == id)
            for id in (("rate",), ("strain-scale",))}  # fmt: skip
    forms = {
        signed.form.name
        for c in _in_all_forms(("rate", "strain-scale"), (best, {}))
        for signed, _ in c.parts
    }
    assert {"factor", "power-law"} <= forms
    assert wrong not in forms
