"""Integrals over nuisances in closed form against the dense Gaussian that they stand for.

Tolerances of 1e-9 are those of a dozen features of order one in double precision, with room.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import csr_array
from scipy.stats import multivariate_normal

from planner.gap.evidence.posterior_mode import Likelihood
from planner.gap.noise import SpecimenNoise
from planner.numerics import FloatArray, IntArray

COUNTS = (4, 3, 5)
"""Features of each specimen."""

N = sum(COUNTS)


def noise_of(rng: np.random.Generator) -> tuple[SpecimenNoise, FloatArray]:
    """Return a random covariance a specimen, and that of all."""
    edges = np.concatenate([[0], np.cumsum(COUNTS)])
    rows = tuple(slice(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
    halves = [rng.standard_normal((c, c)) for c in COUNTS]
    blocks = tuple(half @ half.T + 0.5 * np.eye(len(half)) for half in halves)
    roots = tuple(np.linalg.inv(np.linalg.cholesky(block)) for block in blocks)
    dense = scipy.linalg.block_diag(*blocks)
    root = csr_array(scipy.linalg.block_diag(*roots))
    return SpecimenNoise(rows, blocks, root, np.zeros((N, 0))), dense


def whiten(columns: FloatArray, noise: SpecimenNoise, nuisances: int) -> SimpleNamespace:
    """Return columns as a problem has them, the last ones nuisances."""
    return problem_of(noise.whiten(columns), noise.first_row, nuisances)


def problem_of(columns: FloatArray, first_row: IntArray, nuisances: int) -> SimpleNamespace:
    noise = SimpleNamespace(first_row=first_row, rows=range(len(first_row) - 1))
    return SimpleNamespace(
        columns=columns, target=columns[:, 0], nuisances=columns[:, columns.shape[1] - nuisances :],
        noise=noise, table=range(len(columns)), of_laws=np.zeros(nuisances, bool),
    )  # fmt: skip


def log_density(residual: FloatArray, covariance: FloatArray, white: FloatArray) -> float:
    """Return ln p of the residual, without the constants that whitening leaves out."""
    left_out = -0.5 * len(residual) * np.log(2.0 * np.pi) - 0.5 * np.linalg.slogdet(white)[1]
    zero = np.zeros(len(residual))
    return float(multivariate_normal.logpdf(residual, zero, covariance) - left_out)


@pytest.fixture(params=range(5))
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    return np.random.default_rng(request.param)


def likelihood(problem: Any, **options: Any) -> Likelihood:
    """Return a likelihood of columns and nuisances alone."""
    return Likelihood(problem, **options)


@pytest.mark.parametrize("scale", [1.0, 0.6, 1.7])
def test_eliminating_is_the_dense_marginal_likelihood(rng, scale: float) -> None:
    noise, dense = noise_of(rng)
    kept, nuisances = rng.standard_normal((N, 4)), rng.standard_normal((N, 3))
    white = whiten(np.hstack([kept, nuisances]), noise, 3)
    left = likelihood(white, scale=scale).elimination(
        white.columns[:, 0], kept=white.columns[:, 1:4]
    )
    covariance = scale**2 * dense + nuisances @ nuisances.T
    products = kept.T @ np.linalg.solve(covariance, kept)
    assert left.products == pytest.approx(products, rel=1e-9, abs=1e-9)
    assert left.none == pytest.approx(log_density(kept[:, 0], covariance, dense), abs=1e-9)


@pytest.mark.parametrize("scale", [1.0, 1.7])
def test_slopes_are_as_good_as_nuisances_that_were_there(rng, scale: float) -> None:
    """Also that what is scaled is the noise alone: nuisances keep their prior deviation of 1."""
    noise, dense = noise_of(rng)
    kept, nuisances = rng.standard_normal((N, 4)), rng.standard_normal((N, 3))
    extra = rng.standard_normal((N, 2))
    white = whiten(np.hstack([kept, nuisances]), noise, 3)
    target, others = white.columns[:, 0], white.columns[:, 1:4]
    slopes = whiten(extra, noise, 0).columns
    left = likelihood(white, scale=scale).elimination(target, slopes, others)
    all_of_them = whiten(np.hstack([kept, nuisances, extra]), noise, 5)
    together = likelihood(all_of_them, scale=scale).elimination(target, kept=others)
    assert left.products == pytest.approx(together.products, rel=1e-9, abs=1e-9)
    assert left.none == pytest.approx(together.none, abs=1e-9)
    covariance = scale**2 * dense + nuisances @ nuisances.T + extra @ extra.T
    assert left.none == pytest.approx(log_density(kept[:, 0], covariance, dense), abs=1e-9)


@pytest.mark.parametrize("amplitude", [0.01, 0.3, 10.0])
def test_random_columns_add_to_the_covariance(rng, amplitude: float) -> None:
    noise, dense = noise_of(rng)
    head, random, nuisances = (rng.standard_normal((N, k)) for k in (3, 2, 2))
    white = whiten(np.hstack([head, random, nuisances]), noise, 2)
    all_of_them = likelihood(white).elimination(white.columns[:, 0], kept=white.columns[:, 1:5])
    none = all_of_them.with_random(slice(3, 5), amplitude)
    covariance = dense + nuisances @ nuisances.T + amplitude**2 * random @ random.T
    assert none == pytest.approx(log_density(head[:, 0], covariance, dense), abs=1e-8)


def test_a_column_without_amplitude_changes_nothing(rng) -> None:
    """Its gain goes with the squared amplitude: below 1e-9 at 1e-6."""
    noise, _ = noise_of(rng)
    white = whiten(rng.standard_normal((N, 5)), noise, 1)
    before = likelihood(white).elimination(white.columns[:, 0], kept=white.columns[:, 1:4])
    assert before.with_random(slice(2, 4), 1e-6) == pytest.approx(before.none, abs=1e-9)


def test_a_weight_of_two_is_a_copy_and_of_nought_is_absence(rng) -> None:
    noise, _ = noise_of(rng)
    white = whiten(rng.standard_normal((N, 5)), noise, 2)
    rows = [*range(4), *range(4), *range(4, 7)]
    copies = problem_of(white.columns[rows], np.array([0, 4, 8, 11]), 2)
    for scale in (1.0, 1.5):
        weighted = likelihood(white, scale=scale, weight=np.array([2.0, 1.0, 0.0]))
        copied = likelihood(copies, scale=scale)
        a, b = (
            w.elimination(of.columns[:, 0], kept=of.columns[:, 1:3])
            for w, of in ((weighted, white), (copied, copies))
        )
        assert a.products == pytest.approx(b.products, abs=1e-9)
        assert a.none == pytest.approx(b.none, abs=1e-9)
