"""Intervals hold the true parameters as often as they say, whatever the points' number.

Specimens scatter in level (6 %) and in shape, and carry noise correlated over about ten points
(first-order autoregression, 0.9): points are anything but independent. The scatter is centred on
the law, so that the parameters of the mean are the true ones.
"""

import functools

import numpy as np
import pytest

from planner.materials.characterise import Curve
from planner.materials.fit import Sample, fit_law, law_stress_MPa, sample_of
from planner.materials.fit_intervals import (
    ASSUMED_LOG_SD,
    intervals,
    scatter_of_fit,
    scatter_of_levels,
)
from planner.materials.laws import (
    FITTED_MODELS,
    SeparableLaw,
)

(NEO_HOOKEAN,) = FITTED_MODELS["neo-hookean"]
(YEOH,) = FITTED_MODELS["yeoh"]
OGDEN = {law.columns: law for law in FITTED_MODELS["ogden"]}

SEEDS = 200
LAWS: dict[str, tuple[SeparableLaw, tuple[float, ...], tuple[float, ...]]] = {
    "neo-hookean": (NEO_HOOKEAN, (), (0.4,)),
    "yeoh": (YEOH, (), (0.2, -0.01, 0.003)),
    "ogden": (OGDEN[1], (2.5,), (0.3,)),
}


def synthetic(name: str, seed: int, specimens: int, level_sd: float = 0.06) -> Sample:
    law, a, c = LAWS[name]
    rng = np.random.default_rng([seed, specimens])
    curves = []
    for number in range(specimens):
        strain = np.linspace(0.0, 1.5 * rng.uniform(0.9, 1.1), 300)[1:]
        stress = law_stress_MPa(law, np.array(a), np.array(c), 1.0 + strain)
        level = level_sd * rng.standard_normal() + 0.5 * level_sd * rng.standard_normal() * strain
        white = rng.standard_normal(len(strain))
        noise = np.zeros(len(strain))
        for i in range(1, len(strain)):
            noise[i] = 0.9 * noise[i - 1] + white[i]
        curves.append(
            Curve(f"S{number}", strain, stress * np.exp(level) + 0.003 * stress.max() * noise)
        )
    return sample_of(curves)


@functools.cache
def coverage(name: str, specimens: int) -> tuple[float, ...]:
    law, a, c = LAWS[name]
    true = np.array([*a, *c])
    held = np.zeros(len(true))
    for seed in range(SEEDS):
        sample = synthetic(name, seed, specimens)
        ends = intervals(fit_law(law, sample, starts=6), sample)
        low, high = np.concatenate([ends.a, ends.c]).T
        held += (low <= true) & (true <= high)
    return tuple(held / SEEDS)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("specimens", [3, 5])
def test_coverage_is_nominal(name: str, specimens: int) -> None:
    # 95 % of 200 seeds: a binomial standard deviation of 1.5 %; three of them.
    assert min(coverage(name, specimens)) >= 0.95 - 3 * 0.0154
    # Nor wide at will: 99 % lies 2.6 of those deviations above.
    assert np.mean(coverage(name, specimens)) <= 0.99


def test_coverage_is_not_vacuous() -> None:
    """Half the interval's width must miss far more often: the intervals are not merely wide."""
    law, _, c = LAWS["neo-hookean"]
    hits = 0
    for seed in range(SEEDS):
        sample = synthetic("neo-hookean", seed, 3)
        low, high = intervals(fit_law(law, sample), sample).c[0]
        middle, half = 0.5 * (low + high), 0.25 * (high - low)
        hits += middle - half <= c[0] <= middle + half
    # Student's t with 2 degrees at half of 4.30 covers 83.5 %; three binomial deviations.
    assert hits / SEEDS == pytest.approx(0.835, abs=3 * 0.026)


def test_linear_law_gives_students_interval() -> None:
    """For one parameter and equal sampling it is the t interval of the specimens' own values."""
    strain = np.linspace(0, 1, 61)[1:]
    column = (1 + strain) - (1 + strain) ** -2
    own = np.array([0.38, 0.41, 0.45])
    sample = sample_of(
        [Curve(f"S{k}", strain, mu * column) for k, mu in enumerate(own)], weighting="absolute"
    )
    ends = intervals(fit_law(NEO_HOOKEAN, sample), sample)
    half = 4.30265 * own.std(ddof=1) / np.sqrt(3)
    # The profile's crossing is found to 2 % of its distance; a quadratic profile, exactly.
    np.testing.assert_allclose(ends.c[0], [own.mean() - half, own.mean() + half], rtol=1e-4)
    assert ends.independent_points is None


def test_undetermined_parameters_are_left_open() -> None:
    """A second Ogden term of a neo-Hookean material is not determined by its tests."""
    sample = synthetic("neo-hookean", 0, 3)
    ends = intervals(fit_law(OGDEN[2], sample, starts=12), sample)
    widths = ends.a[:, 1] - ends.a[:, 0]
    assert widths.max() > 10.0
    # Where the search met the bound without a crossing the side is open, never the bound.
    assert np.isinf(ends.a).any()
    assert not np.any(np.abs(ends.a) == OGDEN[2].bounds(3.0).max())


def test_profiles_and_students_intervals_are_told_apart() -> None:
    sample = synthetic("ogden", 1, 3)
    one, two, yeoh = (
        intervals(fit_law(law, sample, starts=12), sample) for law in (OGDEN[1], OGDEN[2], YEOH)
    )
    np.testing.assert_array_equal(one.profiled, [True, True])
    np.testing.assert_array_equal(two.profiled, [True, True, False, False])
    assert not yeoh.profiled.any()


def test_one_specimen_counts_its_correlation() -> None:
    """Noise correlated by 0.9 and its bin means leave far fewer independent points than 60."""
    sample = synthetic("neo-hookean", 0, 1)
    ends = intervals(fit_law(NEO_HOOKEAN, sample), sample)
    assert ends.basis == "one specimen"
    assert ends.independent_points is not None
    assert 2 < ends.independent_points < 40


def test_scatter_covers_the_next_print() -> None:
    """The range exp(+-1.96 log_sd) holds the next specimen's level at about 95 %."""
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(2000):
        levels = np.exp(0.05 * rng.standard_normal(4))
        scatter = scatter_of_levels(np.log(levels[:3]).tolist(), 0.0)
        hits += abs(np.log(levels[3]) - np.log(levels[:3]).mean()) <= 1.96 * scatter.log_sd
    # A binomial standard deviation of 0.5 %; four of them.
    assert hits / 2000 == pytest.approx(0.95, abs=0.02)


def test_scatter_of_one_specimen_is_assumed() -> None:
    scatter = scatter_of_levels([0.0], 0.0)
    assert scatter.specimens == 1
    assert scatter.between == ASSUMED_LOG_SD


def test_scatter_of_a_fit_sees_levels_and_misfit() -> None:
    sample = synthetic("ogden", 3, 5, level_sd=0.1)
    good = scatter_of_fit(fit_law(OGDEN[1], sample), sample)
    poor = scatter_of_fit(fit_law(NEO_HOOKEAN, sample), sample)
    assert good.between == pytest.approx(0.1, rel=0.8)
    assert poor.misfit > 1.5 * good.misfit
