"""The scatter between specimens made alike is estimated right, and whitening takes it out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from planner.formats.units import QUANTITY_UNITS
from planner.gap.campaign import Specimen
from planner.gap.evidence.posterior_mode import Likelihood
from planner.gap.evidence.problem import Problem
from planner.gap.noise import USUAL, calibrations_of, unit_gains
from planner.gap.observations import ObservationModel
from planner.materials.fit import scatter_of_levels
from planner.palette import Uncertainty


def ready(campaign) -> Problem:
    return Problem(campaign, ObservationModel(campaign), ())


@pytest.fixture(scope="module")
def cells(planned):
    """Two materials at two rates, four of each in two batches."""
    return planned(4, material=["TangoPlus", "FLX9760"], rate_mm_s=[0.85, 8.5])


@pytest.mark.parametrize(
    "scatter", [0.03, *(pytest.param(sd, marks=pytest.mark.slow) for sd in (0.012, 0.08))]
)
def test_a_known_scatter_is_estimated(cells, imitated, scatter: float) -> None:
    """Twelve degrees of freedom: each estimate within three of its own errors of 20 %.

    Over three seeds their mean is within three of its own, of 12 %.
    """
    found = [ready(imitated(cells, seed=s, scatter=scatter)).scatter for s in range(3)]
    logs = np.log([f.specimen / scatter for f in found])
    assert np.abs(logs).max() < 0.6
    assert abs(logs.mean()) < 0.36
    assert all(f.degrees_of_freedom == 12 for f in found)
    assert all(f.log_sd < 0.2 for f in found)


def test_a_hidden_effect_is_no_scatter(cells, imitated) -> None:
    """Replicates share it: to 5 %, for forces that rise above their floor."""
    plain = imitated(cells, seed=2)
    hidden = tuple(
        replace(s, force_N=1.7 * s.force_N) if s.rate_mm_s == 8.5 else s for s in plain.specimens
    )
    one, two = (ready(c).scatter for c in (plain, replace(plain, specimens=hidden)))
    assert two.specimen == pytest.approx(one.specimen, rel=0.05)


@pytest.mark.parametrize("unit", ["lbf", "kgf"])
def test_another_unit_is_no_scatter(cells, imitated, unit: str) -> None:
    """Of some replicates, in one direction or the other: scatter and floor are as without, to 15 %.

    A sensor's noise counts in the unit of its record: less than the scatter's own error of 20 %.
    Uncorrected they would be ten times as large.
    """
    plain = imitated(cells, seed=2)
    factor = QUANTITY_UNITS["force"][unit]
    factors = {1: factor, 6: 1.0 / factor}
    mixed = tuple(
        replace(s, force_N=s.force_N * factors.get(k, 1.0)) for k, s in enumerate(plain.specimens)
    )
    clean, problem = ready(plain), ready(replace(plain, specimens=mixed))
    assert problem.scatter.specimen == pytest.approx(clean.scatter.specimen, rel=0.15)
    expected = [np.log(factors.get(k, 1.0)) for k in range(len(mixed))]
    assert unit_gains(problem.table) == pytest.approx(expected)
    assert not unit_gains(clean.table).any()
    floor, other = (np.sqrt(np.nanmean(p.replicate_floor())) for p in (clean, problem))
    assert other == pytest.approx(floor, rel=0.15)


def test_without_replicates_the_scatter_is_the_usual_and_uncertain(planned, imitated) -> None:
    singles = planned(material=["TangoPlus", "FLX9760"], rate_mm_s=[0.85, 8.5])
    scatter = ready(imitated(singles, scatter=0.09)).scatter
    assert scatter == replace(USUAL, degrees_of_freedom=0)


def test_two_replicates_say_what_they_can(planned, imitated) -> None:
    """One difference: between what it shows and the usual, and hardly less uncertain."""
    pair = planned(2, batches=1, material=["FLX9760"])
    for scatter in (0.01, 0.08):
        found = ready(imitated(pair, scatter=scatter, seed=5)).scatter
        assert found.degrees_of_freedom == 1
        assert 0.3 < found.log_sd < USUAL.log_sd
        assert 0.008 < found.specimen < 0.09


@pytest.mark.parametrize("seed", range(3))
def test_whitening_makes_replicates_differences_white(cells, imitated, seed: int) -> None:
    """Differences of residuals of one batch's pairs: chi-square, in an interval of 1 in 10 000.

    The scatter was estimated from them and the prior expects the usual: 15 % are added.
    """
    problem = ready(imitated(cells, seed=seed))
    white = problem.target
    squares, count = 0.0, 0
    for members in problem.model.tests:
        first = [problem.noise.first_row[m] for m in members]
        size = int(problem.noise.first_row[members[0] + 1] - first[0])
        # Four a test, in two batches in turn.
        for a, b in ((0, 2), (1, 3)):
            d = white[first[a] : first[a] + size] - white[first[b] : first[b] + size]
            squares, count = squares + 0.5 * float(d @ d), count + size
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], count)
    assert 0.85 * low < squares < 1.15 * high


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))]
)
def test_the_whole_residual_is_as_large_as_its_model_says(cells, imitated, seed: int) -> None:
    """With calibration and batches integrated over: no larger than noise; laws are exact here.

    So nuisances only take away, at most one square each.
    """
    problem = ready(imitated(cells, seed=seed))
    left = float(Likelihood(problem).left)
    count = len(problem.table)
    assert 0.85 * chi2.ppf(5e-5, count - problem.nuisances.shape[1]) < left
    assert left < 1.15 * chi2.ppf(1.0 - 5e-5, count)


def test_noise_at_rest_is_that_of_one_row(planned, imitated) -> None:
    """Elsewhere parabolas through many rows have a fraction of it. 30 values know 1 to 13 %."""
    made, rng = imitated(planned(15, material=["TangoPlus", "FLX9760"])), np.random.default_rng(4)

    def noisy(one: Specimen) -> Specimen:
        time_s = np.linspace(one.time_s[0], one.time_s[-1], 3000)
        displacement_mm, force_N = (
            np.interp(time_s, one.time_s, values) for values in (one.displacement_mm, one.force_N)
        )
        force_N += 0.003 * force_N.max() * rng.standard_normal(3000)
        return replace(one, time_s=time_s, displacement_mm=displacement_mm, force_N=force_N)

    problem = ready(replace(made, specimens=tuple(map(noisy, made.specimens))))
    sd = np.sqrt(np.concatenate([np.diagonal(block) for block in problem.noise.blocks]))
    rest, off = problem.table.strain <= 0.0, problem.residual / sd
    assert 0.6 < np.std(off[rest]) < 1.4
    assert 0.8 < np.std(off[~rest]) < 1.2


@pytest.mark.parametrize("tested", [2, 3, 6])
def test_a_fitted_law_is_off_by_what_the_mean_of_its_tests_is(cells, imitated, tested) -> None:
    """In 95 % of 1,500 fits its level lies within 1.96 deviations, to three errors of 0.6 %.

    Those of the next print, which a palette states, would hold nearly all.
    """
    model, palette = ObservationModel(imitated(cells, seed=1)), cells.palette
    soft, *others = palette.materials
    held = 0
    for levels in np.random.default_rng(3).normal(0.0, 0.05, (1500, tested)):
        sd = scatter_of_levels(levels.tolist(), 0.0).log_sd
        fitted = replace(soft, modulus_log_sd=sd, uncertainty=Uncertainty(specimens=tested))
        of = calibrations_of(replace(palette, materials=(fitted, *others)), model.setup)
        held += abs(levels.mean()) <= 1.96 * next(c.sd for c in of if c.kind == "level")
    assert held / 1500 == pytest.approx(0.95, abs=0.017)
