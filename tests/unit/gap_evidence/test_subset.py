"""A factor on the force of some specimens: found where it was put in, and not in plain scatter."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from planner.gap.evidence.search import FORCE_UNITS, SHARES, gains_of, weigh_subset_beside
from planner.gap.evidence.surrogate import Candidate, Elimination
from planner.gap.noise import USUAL
from planner.numerics import FloatArray

SCATTER = 0.03
"""Of specimens' levels."""

BATCH = 0.012
SCATTER_OF = replace(USUAL, specimen=SCATTER)


def weighed(levels: FloatArray, shared: FloatArray | None = None) -> Candidate:
    """Weigh specimens whose force is off by these logarithms, a figure each.

    Parameters
    ----------
    shared : (n, q)
        What specimens have in common, of deviation 1 a column.
    """
    n = len(levels)
    covariance = SCATTER**2 * np.eye(n)
    if shared is not None:
        covariance = covariance + shared @ shared.T
    columns = np.column_stack([levels, np.eye(n)])
    products = columns.T @ np.linalg.solve(covariance, columns)
    elimination = Elimination(products, 0.0)
    return weigh_subset_beside(elimination, slice(1, 1 + n), Candidate(()), np.zeros(0), SCATTER_OF)


def batches(n: int) -> FloatArray:
    return BATCH * np.array([[float(k % 2 == b) for b in range(2)] for k in range(n)])


def planted(seed: int, members: list[int], log_gain: float, n: int = 20) -> FloatArray:
    levels = SCATTER * np.random.default_rng(seed).standard_normal(n)
    levels[members] += log_gain
    return levels


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("log_gain", [0.3, -0.25])
def test_those_that_were_put_in_are_found(seed: int, log_gain: float) -> None:
    """Eight deviations off: all of them, none else, the factor to its grid of 12 % and 3 errors."""
    members = [1, 4, 5, 11, 17]
    found = weighed(planted(seed, members, log_gain), batches(20))
    assert found.effects == ("force-scale",)
    assert np.flatnonzero(found.members).tolist() == members
    off = abs(found.log_gain - log_gain)
    assert off < 0.06 * abs(log_gain) + 3.0 * SCATTER / np.sqrt(len(members))
    assert found.log_evidence > 50.0
    assert found.gain > found.log_evidence


@pytest.mark.parametrize("unit", FORCE_UNITS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_units_are_found_as_they_are(unit: float, sign: float) -> None:
    """The factor itself, not the nearest of a grid."""
    found = weighed(planted(2, [0, 7, 8], sign * float(np.log(unit))))
    assert np.exp(found.log_gain) == pytest.approx(unit**sign, rel=1e-12)
    assert np.flatnonzero(found.members).tolist() == [0, 7, 8]


@pytest.mark.parametrize("seed", range(20))
def test_plain_scatter_has_no_subset(seed: int) -> None:
    """Less likely than none at all, before any prior odds."""
    rng = np.random.default_rng(seed)
    levels = SCATTER * rng.standard_normal(24) + batches(24) @ rng.standard_normal(2)
    assert weighed(levels, batches(24)).log_evidence < 0.0


@pytest.mark.parametrize("seed", range(5))
def test_a_batch_of_its_own_level_is_no_subset(seed: int) -> None:
    """Half of the specimens two of the batches' deviations up, the other half as many down."""
    levels = planted(seed, [], 0.0) + batches(20) @ np.array([2.0, -2.0])
    assert weighed(levels, batches(20)).log_evidence < 0.0


def test_one_specimen_alone_is_an_outlier_and_no_subset() -> None:
    assert weighed(planted(1, [3], 0.5)).log_evidence < 0.0


def exact(levels: FloatArray, shared: FloatArray | None = None) -> float:
    """Sum over all subsets and over the factors' prior."""
    n = len(levels)
    covariance = SCATTER**2 * np.eye(n)
    if shared is not None:
        covariance = covariance + shared @ shared.T
    precision = np.linalg.inv(covariance)
    gains, log_prior = gains_of(SCATTER_OF)
    members = np.array(list(itertools.product((0.0, 1.0), repeat=n)))
    size = members.sum(axis=1)
    share = np.log(SHARES)[:, None] * size + np.log(1.0 - SHARES)[:, None] * (n - size)
    prior = logsumexp(share, axis=0) - np.log(len(SHARES))
    square = np.sum((members @ precision) * members, axis=1)
    log = gains[:, None] * (members @ precision @ levels) - 0.5 * gains[:, None] ** 2 * square
    return float(logsumexp(log_prior[:, None] + prior + log))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("log_gain", [0.0, 0.12, 0.3])
def test_the_evidence_is_the_sum_over_all_subsets(seed: int, log_gain: float) -> None:
    """Of ten specimens that differ on their own, independent beliefs are exact.

    Where fewer than two are likelier members than not there is no subset, whatever the sum.
    """
    levels = planted(seed, [2, 6, 9], log_gain, n=10)
    found = weighed(levels)
    if np.isfinite(found.log_evidence):
        assert found.log_evidence == pytest.approx(exact(levels), abs=1e-3)
    else:
        assert found.members.sum() < 2


@pytest.mark.parametrize("seed", range(6))
def test_the_evidence_is_a_bound_where_specimens_go_together(seed: int) -> None:
    """Mean field, from below: within 2 nats where batches share a third of the variance."""
    shared = np.array([[0.02 * float(k % 2 == b) for b in range(2)] for k in range(10)])
    levels = planted(seed, [2, 6, 9], 0.3, n=10)
    off = weighed(levels, shared).log_evidence - exact(levels, shared)
    assert -2.0 < off < 1e-6
