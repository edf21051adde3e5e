"""Laplace's method on inner products against the integrals that it stands for.

Sizes have priors uniform in their logarithm over a factor of 40, shapes uniform in -1 to 1. The
figures of the forms here are exactly what nodes can carry: linear in the size, a parabola in the
shape. Tolerances are in nats, measured over seeds; 3 nats are what a class of hypotheses is.
"""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import nquad
from scipy.special import logsumexp

from planner.gap.evidence.search import best_pair, best_single, scan_pairs, weigh_single
from planner.gap.evidence.surrogate import SHAPE_NODES, SIZE_NODES
from planner.numerics import FloatArray

LEAST = float(np.sqrt(1.0 / 40.0))
FIGURES = 30
Pattern = Callable[[float], FloatArray]


def of_sizes(pattern: FloatArray) -> FloatArray:
    return np.array([s * s * pattern for s in SIZE_NODES])


def of_shapes(pattern: Pattern) -> FloatArray:
    return np.array([s * s * pattern(t) for s in SIZE_NODES for t in SHAPE_NODES[0]])


def ints(*values: int) -> FloatArray:
    return np.array(values, dtype=np.int64)


def best(nodes: FloatArray, residual: FloatArray, shapes: int = 0) -> tuple[float, float]:
    """Return gain and log evidence of one branch."""
    place, gain, evidence = np.zeros((1, 3)), np.empty(1), np.empty(1)
    best_single(nodes @ residual, nodes @ nodes.T, ints(0), ints(shapes), np.array([LEAST]), place,
                gain, evidence)  # fmt: skip
    return float(gain[0]), float(evidence[0])


def size(u: float) -> float:
    """Return the size over its largest at a place 0 to 1 in its prior."""
    return float(LEAST ** (2.0 * (1.0 - u)))


def integral(log: Callable[..., float], dims: int, count: int = 400) -> float:
    """Return the log of the mean of exp(log) over the unit cube, by midpoints."""
    count = count if dims == 1 else 160
    at = (np.arange(count) + 0.5) / count
    grid = np.meshgrid(*[at] * dims)
    values = np.vectorize(log)(*grid)
    return float(logsumexp(values) - dims * np.log(count))


def likelihood(residual: FloatArray, change: FloatArray) -> float:
    return float(change @ residual - 0.5 * change @ change)


def pattern_of(rng: np.random.Generator, length: float) -> FloatArray:
    d = rng.standard_normal(FIGURES)
    found: FloatArray = length * d / np.linalg.norm(d)
    return found


def test_midpoints_are_the_integral() -> None:
    """What the others are held against, itself held against adaptive quadrature."""
    rng = np.random.default_rng(3)
    d = pattern_of(rng, 10.0)
    r = 0.3 * d + rng.standard_normal(FIGURES)
    other = nquad(lambda u: np.exp(likelihood(r, size(u) * d)), [(0.0, 1.0)])[0]
    assert integral(lambda u: likelihood(r, size(u) * d), 1) == pytest.approx(np.log(other), 1e-3)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("share", [0.15, 0.3, 0.6])
def test_a_clear_size_is_weighed_right(seed: int, share: float) -> None:
    """Where the peak is inside and six deviations from nothing: within 0.15 nats."""
    rng = np.random.default_rng(seed)
    d = pattern_of(rng, 9.0 / share)
    r = share * d + rng.standard_normal(FIGURES)
    _, evidence = best(of_sizes(d), r)
    assert evidence == pytest.approx(integral(lambda u: likelihood(r, size(u) * d), 1), abs=0.15)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("length", [0.01, 1.0, 10.0, 50.0])
def test_no_effect_does_not_blow_the_evidence_up(seed: int, length: float) -> None:
    """At the edge of size 0 the width is bounded: never above the best likelihood.

    The peak counts in full there, which overstates an absent effect, by less than 2.5 nats, and
    never understates it by more than 0.5. Without the bound a flat direction would add any number.
    """
    rng = np.random.default_rng(seed)
    d = pattern_of(rng, length)
    r = rng.standard_normal(FIGURES)
    gain, evidence = best(of_sizes(d), r)
    assert np.isfinite(evidence)
    assert evidence <= gain + 1e-12
    assert -0.5 < evidence - integral(lambda u: likelihood(r, size(u) * d), 1) < 2.5


def test_what_changes_nothing_weighs_as_nothing() -> None:
    gain, evidence = best(np.zeros((4, FIGURES)), np.ones(FIGURES))
    assert (gain, evidence) == (0.0, 0.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("length", [0.0, 8.0, 25.0])
def test_shapes_are_weighed_with_the_size(seed: int, length: float) -> None:
    """One parameter of shape: within 1 nat where the effect is there, 3 where it is not."""
    rng = np.random.default_rng(seed)
    a, b = pattern_of(rng, 1.0), pattern_of(rng, 0.6)
    scale = max(length, 8.0) / 0.4

    def pattern(t: float) -> FloatArray:
        found: FloatArray = scale * (a + t * b + 0.2 * t * t * a)
        return found

    r = (0.4 if length else 0.0) * pattern(0.3) + rng.standard_normal(FIGURES)
    gain, evidence = best(of_shapes(pattern), r, shapes=1)
    exact = integral(lambda u, v: likelihood(r, size(u) * pattern(2.0 * v - 1.0)), 2)
    assert evidence <= gain + 1e-12
    assert evidence - exact == pytest.approx(0.0, abs=1.0 if length else 3.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("shares", [(0.3, 0.4), (0.4, 0.0), (0.0, 0.0)])
def test_pairs_are_weighed(seed: int, shares: tuple[float, float]) -> None:
    """Both there: within 0.3 nats; each that is not may overstate by 2.5, as alone."""
    rng = np.random.default_rng(seed)
    first, second = pattern_of(rng, 30.0), pattern_of(rng, 30.0)
    r = shares[0] * first + shares[1] * second + rng.standard_normal(FIGURES)
    nodes = np.concatenate([of_sizes(first), of_sizes(second)])
    b, g = nodes @ r, nodes @ nodes.T
    firsts, shapes, lows = ints(0, 4), ints(0, 0), np.array([LEAST, LEAST])
    place = np.array([0.5, 0.5])
    gain, evidence = weigh_single(b, g, firsts, shapes, lows, place)
    exact = integral(lambda u, v: likelihood(r, size(u) * first + size(v) * second), 2)
    assert evidence <= gain + 1e-12
    absent = sum(share == 0.0 for share in shares)
    assert -0.5 < evidence - exact < 0.3 + 2.5 * absent
    # The search for pairs weighs the same, from where it starts.
    starts = np.zeros((1, 6))
    starts[0, [0, 3]] = 0.5
    gains, evidences = np.empty(1), np.empty(1)
    best_pair(b, g, firsts[None], shapes[None], lows[None], starts, gains, evidences)
    assert evidences[0] == pytest.approx(evidence, abs=0.01)  # places to 2e-4 of the range
    assert starts[0, [0, 3]] == pytest.approx(place, abs=0.01)


def test_the_scan_finds_the_pair_that_was_put_in() -> None:
    """Of four effects' patterns, and never two branches of one effect."""
    rng = np.random.default_rng(5)
    patterns = [pattern_of(rng, 30.0) for _ in range(5)]
    r = 0.3 * patterns[1] + 0.5 * patterns[3] + rng.standard_normal(FIGURES)
    nodes = np.concatenate([of_sizes(d) for d in patterns])
    effect = ints(0, 1, 2, 3, 3)
    gain, sizes = np.full((5, 5), -np.inf), np.zeros((5, 5, 2))
    place = np.zeros((5, 3))
    scan_pairs(nodes @ r, nodes @ nodes.T, 4 * np.arange(5), np.zeros(5, dtype=np.int64),
               np.full(5, LEAST), place, effect, gain, sizes)  # fmt: skip
    assert np.unravel_index(np.argmax(gain), gain.shape) == (3, 1)
    assert not np.isfinite(gain[4, 3])
    assert sizes[3, 1] ** 2 == pytest.approx([0.5, 0.3], rel=0.6)  # 8 sizes over a factor of 40
