"""The columns of the laws, and the search by variable projection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.materials.characterise import Curve
from planner.materials.fit import Sample, law_stress_MPa, minimise, sample_of, spread_starts
from planner.materials.laws import (
    FITTED_MODELS,
    SeparableLaw,
    make_law,
)
from planner.palette import LawParameters

(NEO_HOOKEAN,) = FITTED_MODELS["neo-hookean"]
(YEOH,) = FITTED_MODELS["yeoh"]
(MARTINS,) = FITTED_MODELS["martins"]
OGDEN = {law.columns: law for law in FITTED_MODELS["ogden"]}

STRETCH = np.linspace(1.0, 3.0, 41)[1:]
LAWS = [law for laws in FITTED_MODELS.values() for law in laws]
# Truths that are sound in every mode: a search that is held to that cannot reach others.
EXACT = [
    (NEO_HOOKEAN, [], [0.4]),
    (YEOH, [], [0.2, -0.01, 0.002]),
    (OGDEN[1], [2.5], [0.3]),
    (OGDEN[2], [-2.0, 4.0], [-0.1, 0.05]),
    (OGDEN[3], [-0.5, 1.3, 6.0], [-0.05, 0.6, 0.001]),
    (MARTINS, [0.2, 0.5], [0.3, 0.2]),
]


def _sample(law: SeparableLaw, a: list[float], c: list[float]) -> Sample:
    stress = law_stress_MPa(law, np.array(a), np.array(c), STRETCH)
    return sample_of([Curve("S1", STRETCH - 1.0, stress)], points=None)


def _name(law: object) -> str:
    return f"{type(law).__name__}-{getattr(law, 'columns', '')}"


@pytest.mark.parametrize(("law", "a", "c"), EXACT, ids=lambda v: _name(v) if v else None)
def test_columns_are_the_palette_law(law: SeparableLaw, a: list[float], c: list[float]) -> None:
    palette = make_law(LawParameters(law.model, law.parameters(np.array(a), np.array(c))))
    ours = law_stress_MPa(law, np.array(a), np.array(c), STRETCH)
    # Rounding alone: the two are one formula written differently.
    np.testing.assert_allclose(ours, palette.nominal_stress_MPa(STRETCH), rtol=1e-11)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.floats(-29.9, 29.9), st.floats(1.001, 6.0))
def test_derivative_of_an_ogden_column(alpha: float, stretch: float) -> None:
    law, x, h = OGDEN[1], np.array([stretch]), 1e-5
    _, slope = law.evaluate(x, np.array([[alpha]]))
    ends = [law.evaluate(x, np.array([[alpha + d]]))[0][0, 0, 0] for d in (-h, h)]
    difference = (ends[1] - ends[0]) / (2 * h)
    # Central differences: h^2 (ln l)^2 / 6 relative, and eps / h of rounding.
    scale = abs(slope[0, 0, 0]) + abs(ends[0])
    assert difference == pytest.approx(slope[0, 0, 0], abs=1e-8 * scale)


def test_an_ogden_column_goes_smoothly_through_zero() -> None:
    """At alpha = 0 the column is ln(l) / l; the series near it meets the closed form."""
    phi, _ = OGDEN[1].evaluate(STRETCH, np.array([[0.0], [1e-9], [0.012]]))
    np.testing.assert_allclose(phi[0, :, 0], np.log(STRETCH) / STRETCH, rtol=1e-14)
    np.testing.assert_allclose(phi[1], phi[0], rtol=1e-8)
    alpha = 0.012
    closed = (STRETCH ** (alpha - 1) - STRETCH ** (-alpha / 2 - 1)) / (1.5 * alpha)
    np.testing.assert_allclose(phi[2, :, 0], closed, rtol=1e-12)


@pytest.mark.parametrize(("law", "a", "c"), EXACT, ids=lambda v: _name(v) if v else None)
def test_exact_data_are_fitted_exactly(law: SeparableLaw, a: list[float], c: list[float]) -> None:
    sample = _sample(law, a, c)
    found = minimise(law, sample, spread_starts(law, sample, 50))
    # The ridge alone keeps the cost from zero: 1e-4 squared times shares of a few units.
    assert found.cost.min() < 1e-6
    assert found.converged.mean() > 0.9


def test_a_linear_law_is_the_least_squares_solution() -> None:
    rng = np.random.default_rng(1)
    stress = YEOH.evaluate(STRETCH, np.empty((1, 0)))[0][0] @ [0.2, -0.01, 0.002]
    stress = stress * (1 + 0.02 * rng.standard_normal(len(stress)))
    sample = sample_of([Curve("S1", STRETCH - 1.0, stress)], points=None)
    found = minimise(YEOH, sample, np.empty((1, 0)))
    columns = YEOH.evaluate(STRETCH, np.empty((1, 0)))[0][0] * sample.factor[:, None]
    expected = np.linalg.lstsq(columns, sample.factor * stress, rcond=None)[0]
    # The ridge of 1e-4 moves near-collinear columns by about its square over their gap.
    np.testing.assert_allclose(found.c[0], expected, rtol=1e-4)


@pytest.mark.parametrize("law", [OGDEN[2], MARTINS], ids=_name)
def test_the_search_ends_at_a_minimum(law: SeparableLaw) -> None:
    """No small step of any parameter lowers the cost, found with the others held or free."""
    sample = _sample(YEOH, [], [0.2, -0.01, 0.002])
    found = minimise(law, sample, spread_starts(law, sample, 40))
    best = int(found.cost.argmin())
    at = found.a[best]
    held = (np.ones((1, 2), dtype=bool), np.full((1, 2), np.nan))
    for step in (1e-3, -1e-3):
        for k in range(2):
            moved = at.copy()
            moved[k] *= 1 + step
            near = minimise(law, sample, moved[None], held)
            assert near.cost[0] >= found.cost[best] * (1 - 1e-9)


def test_held_parameters_stay_and_cost_more() -> None:
    law, a, c = OGDEN[2], [-2.0, 4.0], [-0.1, 0.05]
    sample = _sample(law, a, c)
    held = (np.array([[False, False]]), np.array([[np.nan, 0.06]]))
    found = minimise(law, sample, np.array([a]), held)
    assert found.c[0, 1] == 0.06
    free = minimise(law, sample, np.array([a]))
    assert found.cost[0] > free.cost[0]
    held = (np.array([[True, False]]), np.full((1, 2), np.nan))
    found = minimise(law, sample, np.array([[-2.5, 4.0]]), held)
    assert found.a[0, 0] == -2.5


@pytest.mark.parametrize("law", LAWS, ids=_name)
def test_starts_lie_within_the_bounds(law: SeparableLaw) -> None:
    sample = _sample(NEO_HOOKEAN, [], [0.4])
    starts = spread_starts(law, sample, 64, shift=0.3)
    low, high = law.bounds(3.0).T
    assert np.all(starts >= low)
    assert np.all(starts <= high)
    if law.nonlinear:
        assert len(np.unique(starts, axis=0)) == 64


def test_coincident_terms_stay_small() -> None:
    """A neo-Hookean material leaves a second Ogden term free; it must not blow up."""
    sample = _sample(NEO_HOOKEAN, [], [0.4])
    found = minimise(OGDEN[2], sample, spread_starts(OGDEN[2], sample, 50))
    best = int(found.cost.argmin())
    assert np.abs(found.c[best]).max() < 100.0
