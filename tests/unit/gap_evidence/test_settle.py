"""Candidates at their mode on the forward model, in worlds of scatter and discrepancy."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from planner.gap.campaign import Campaign
from planner.gap.effects import EFFECTS
from planner.gap.evidence.problem import Candidate, Problem, joined, set_up
from planner.gap.evidence.settle import Settled, World, settle
from planner.gap.evidence.weigh import (
    Priors,
    _in_all_forms,
    _LogPriors,
    _nothing,
    _with_parts_alone,
)
from planner.gap.observations import observation_model

RISE = 0.12


@pytest.fixture(scope="module")
def plan(planned) -> Campaign:
    """Two materials at three rates, two of each."""
    return planned(2, material=["TangoPlus", "FLX9760"], rate_mm_s=[0.085, 0.85, 8.5])


@pytest.fixture(scope="module")
def problem(plan, imitated) -> Problem:
    campaign = imitated(plan, f"rate:rise={RISE},form=power-law")
    return set_up(campaign, observation_model(campaign), [EFFECTS["rate"]])


def candidate(problem: Problem, form: str, size: float = 0.6) -> Candidate:
    branch = next(b for b in problem.branches if b.form.name == form)
    return Candidate(("rate",), ((branch, (size, *[0.0] * branch.shapes)),))


def test_a_world_integrates_its_nuisances_out(problem: Problem) -> None:
    """As the normal density with the covariance that noise and nuisances make together."""
    world = World(problem, scale=1.3, discrepancy=0.02)
    j = np.concatenate([problem.nuisances, 0.02 * problem.discrepancy], axis=1)
    residual = problem.target
    covariance = 1.3**2 * np.eye(len(residual)) + j @ j.T
    expected = -0.5 * (
        np.linalg.slogdet(covariance)[1] + residual @ np.linalg.solve(covariance, residual)
    )
    assert world.none == pytest.approx(expected, rel=1e-9)


def test_a_level_that_scatters_less_takes_that_much_from_the_covariance(problem: Problem) -> None:
    """As if the noise had been made with that scatter from the start."""
    level, first = 0.4, problem.noise.first_row
    world = World(problem, level=level)
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
    assert world.none == pytest.approx(expected, rel=1e-9)


def test_the_mode_is_found_and_flat(problem: Problem) -> None:
    world = World(problem)
    settled = settle((world,), candidate(problem, "power-law"), world)
    ((branch, place),) = settled.candidate.parts
    low, high = (
        branch.values(
            branch.place(settled.coordinates + k * np.sqrt(np.diagonal(settled.covariance())))
        )["rise"]
        for k in (-3.0, 3.0)
    )
    assert low < RISE < high
    # The target is the whole residual, for a form that is nearly linear in its size.
    left = settled.target - settled.slopes @ settled.coordinates
    changes = problem.changes(problem.predictions([settled.candidate]))
    change = problem.noise.whiten(problem.residual - changes[0])
    assert left == pytest.approx(change, abs=1e-9)
    gradient = world.products(np.stack([left, settled.slopes[:, 0]], axis=1))[1, 0]
    # An iteration that gains 0.05 nats is the last: half a squared step over the curvature.
    curvature = world.products(settled.slopes)[0, 0] + 1.0
    assert 0.5 * (gradient - settled.coordinates[0]) ** 2 / curvature < 0.05
    assert branch.values(place)["rise"] == pytest.approx(RISE, rel=0.2)


def test_a_mode_is_that_of_the_world_in_which_it_is_likeliest(planned, imitated) -> None:
    """Not of the sloppier one that the search began in, however much its linear model promises."""
    plan = planned(2, material=["TangoPlus", "FLX9760"], rate_mm_s=[0.085, 0.85, 8.5, 85.0])
    campaign = imitated(plan, "rate:share=0.6,form=prony")
    problem = set_up(campaign, observation_model(campaign), [EFFECTS["rate"]])
    worlds = (World(problem), World(problem, laws=3.0), World(problem, discrepancy=0.06))
    settled = settle(worlds, candidate(problem, "graded-prony"), worlds[2])
    assert settled.world is worlds[0]
    assert settled.eliminated(worlds[0]).none > settled.eliminated(worlds[2]).none


@pytest.mark.parametrize("form", ["prony", "spectrum", "graded-power-law"])
def test_coordinates_and_places_are_one_to_one(problem: Problem, form: str) -> None:
    branch = next(b for b in problem.branches if b.form.name == form)
    rng = np.random.default_rng(3)
    for _ in range(20):
        at = rng.standard_normal(1 + branch.shapes + len(branch.form.details))
        assert branch.coordinates(branch.place(at)) == pytest.approx(at, abs=1e-6)


def test_a_discrepancy_is_asked_for_where_no_form_fits(plan, imitated) -> None:
    """Force off by 5 % along the path, alike in replicates: no scatter, and no rate."""
    campaign = imitated(plan, "softening")
    problem = set_up(campaign, observation_model(campaign), [EFFECTS["rate"]])
    bent = np.sin(np.linspace(0.0, 6.0, len(problem.table))) * 0.05
    exact, off = World(problem), World(problem, discrepancy=0.06)
    residual = problem.target
    whitened = residual + problem.noise.whiten(bent)
    gained = off.elimination(whitened).none - exact.elimination(whitened).none
    assert gained > off.none - exact.none


def test_errors_are_those_of_features_that_laws_leave(problem: Problem) -> None:
    found = candidate(problem, "power-law")
    change, level = problem.explained(found), problem.calibration[:, 0]
    exact = replace(problem, residual=change, target=problem.noise.whiten(change))
    assert World(exact).error(found) == pytest.approx(0.0, abs=1e-9)
    # What a law's level is off by is mostly taken for that.
    off = replace(exact, residual=change + level, target=problem.noise.whiten(change + level))
    world, tests = World(off), problem.table.test
    whole = sum(np.sqrt(np.mean(level[tests == test] ** 2)) for test in np.unique(tests))
    assert 0.0 < world.error(found) < 0.5 * whole
    assert world.error(Candidate(())) > world.error(found)


def test_a_part_of_the_likeliest_is_settled_from_where_it_is_there(problem: Problem) -> None:
    """An effect that had settled far off alone is as likely as it is in its place in a pair."""
    effects = [EFFECTS["rate"], EFFECTS["force-offset"]]
    both = set_up(problem.campaign, problem.model, effects)
    world = World(both)
    alone = settle((world,), candidate(both, "power-law"), world)
    beside = next(c for c in alone.beside() if c.effects == ("force-offset",))
    pair = settle((world,), joined([*alone.candidate.parts, *beside.parts]), world)
    astray = replace(alone, target=2.0 * alone.target)

    def odds(one: Settled) -> float:
        return one.eliminated(world).none

    found = _with_parts_alone([astray, pair], (world,), odds)
    assert {one.candidate.effects for one in found} == {
        ("rate",), ("force-offset",), ("force-offset", "rate")
    }  # fmt: skip
    (rate,) = (one for one in found if one.candidate.effects == ("rate",))
    assert odds(astray) + 10.0 < odds(alone)
    assert odds(rate) == pytest.approx(odds(alone), abs=0.1)  # as far as modes are found


def test_errors_are_of_each_specimens_own_size(planned, imitated) -> None:
    """Slack of four specimens that differ by a factor: its mean alone closes little."""
    plan = planned(4, material=["TangoPlus", "FLX9760"])
    campaign = imitated(plan, "grip-slack:slack=0.6,form=taking-up", seed=5)
    problem = set_up(campaign, observation_model(campaign), [EFFECTS["grip-slack"]])
    world = World(problem)
    branch = next(b for b in problem.branches if b.form.name == "taking-up")
    start = Candidate(("grip-slack",), ((branch, (0.3, *[0.0] * branch.shapes)),))
    settled = settle((world,), start, world)
    own = settled.with_own_sizes(settled.candidate)
    assert own.own is not None
    assert own.own.shape == (1, 8)
    assert np.ptp(own.own) > 0.3  # of sizes drawn with a deviation of a third
    assert world.error(own) < 0.8 * world.error(settled.candidate)


def test_errors_of_strays_are_not_counted(problem: Problem) -> None:
    rows, residual = problem.table.specimen == 0, problem.explained(Candidate(()))
    exact = replace(problem, residual=residual + rows, target=0.0 * problem.target)
    assert World(exact).error(Candidate(())) > 0.1
    stray = replace(exact, strays=np.arange(len(problem.strays)) == 0)
    assert World(stray).error(Candidate(())) == 0.0


def test_a_form_that_fits_worse_than_nothing_is_not_followed(problem: Problem) -> None:
    """A gauge length taken from another drawing is never a little off: no other effect mends it."""
    wrong = "other-length"
    campaign, rate = problem.campaign, EFFECTS["rate"]
    scale = EFFECTS["strain-scale"]
    tried = replace(scale, forms=tuple(f for f in scale.forms if f.name in ("factor", wrong)))
    both = set_up(campaign, problem.model, [rate, tried])
    world, logs = World(both), _LogPriors(both, Priors())
    alone = [settle((world,), c, world) for c in _nothing(world).beside()]
    best = {id: next(s for s in alone if s.candidate.effects == id)
            for id in (("rate",), ("strain-scale",))}  # fmt: skip
    forms = {
        branch.form.name
        for c in _in_all_forms(("rate", "strain-scale"), best, alone, logs)
        for branch, _ in c.parts
    }
    assert {"factor", "power-law"} <= forms
    assert wrong not in forms
