"""Forms on grids of their parameters, and factors on some specimens' force.

Sizes have priors uniform in their logarithm over a factor of 40, shapes uniform in -1 to 1. The
features of the forms here are exactly what nodes can carry: linear in the size, a parabola in the
shape. Tolerances are in nats, measured over seeds; 3 nats are what a class of hypotheses is.
"""

import itertools
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import nquad
from scipy.special import logsumexp

from planner.gap.effect import Effect, Form, Parameter
from planner.gap.evidence import weigh
from planner.gap.evidence.problem import Candidate, SignedForm, searched, signed_forms
from planner.gap.evidence.weigh import _weigh_subset
from planner.numerics import FloatArray

LEAST = float(np.sqrt(1.0 / 40.0))
FEATURES = 30


def effect(id: str, shapes: int = 0, forms: int = 1) -> Effect:
    """Return an effect whose forms have a size from 1 to 40 and some shapes."""
    shape = tuple(Parameter(f"shape{k}", -1.0, 1.0, "", log=False) for k in range(shapes))
    size = Parameter("size", 1.0, 40.0, "", log=False)
    form = Form("form", (size, *shape), lambda setup, values: setup, "", "")
    return Effect(id, id, id, "law", (form,) * forms, (), ())


def nodes_of(signed: SignedForm, pattern: Callable[..., FloatArray]) -> FloatArray:
    """Return what a form changes at its nodes: linear in the size."""
    return np.array([s * s * pattern(*shape) for s, *shape in signed.node_points()])


def best(pattern: FloatArray, residual: FloatArray) -> Candidate:
    """Return a form without shapes at its best size."""
    (signed,) = signed_forms([effect("a")])
    nodes = nodes_of(signed, lambda: pattern)
    return searched((signed,), nodes @ residual, nodes @ nodes.T)[0]


def size(u: FloatArray | float) -> FloatArray:
    """Return the size over its largest at a place 0 to 1 in its prior."""
    return np.asarray(LEAST ** (2.0 * (1.0 - np.asarray(u))))[..., None]


def integral(log: Callable[..., FloatArray], dims: int) -> float:
    """Return the log of the mean of exp(log) over the unit cube, by midpoints."""
    count = 400 if dims == 1 else 160
    at = (np.arange(count) + 0.5) / count
    values = log(*np.meshgrid(*[at] * dims))
    return float(logsumexp(values) - dims * np.log(count))


def likelihood(residual: FloatArray, change: FloatArray) -> FloatArray:
    return np.asarray(change @ residual - 0.5 * np.sum(change**2, axis=-1))


def pattern_of(rng: np.random.Generator, length: float) -> FloatArray:
    d = rng.standard_normal(FEATURES)
    found: FloatArray = length * d / np.linalg.norm(d)
    return found


def test_midpoints_are_the_integral() -> None:
    """What the others are held against, itself held against adaptive quadrature."""
    rng = np.random.default_rng(3)
    d = pattern_of(rng, 10.0)
    r = 0.3 * d + rng.standard_normal(FEATURES)
    other = nquad(lambda u: np.exp(likelihood(r, size(u) * d)), [(0.0, 1.0)])[0]
    assert integral(lambda u: likelihood(r, size(u) * d), 1) == pytest.approx(np.log(other), 1e-3)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("share", [0.15, 0.3, 0.6])
def test_a_clear_size_is_weighed_right(seed: int, share: float) -> None:
    """Where the peak is inside and six deviations from nothing: within 0.15 nats."""
    rng = np.random.default_rng(seed)
    d = pattern_of(rng, 9.0 / share)
    r = share * d + rng.standard_normal(FEATURES)
    exact = integral(lambda u: likelihood(r, size(u) * d), 1)
    assert best(d, r).log_evidence == pytest.approx(exact, abs=0.15)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("length", [0.01, 1.0, 10.0, 50.0])
def test_no_effect_does_not_blow_the_evidence_up(seed: int, length: float) -> None:
    """Where the least size fits best: a mean is never above the best, and its end counts in full.

    That overstates what a likelihood falls to within half a step of the grid, by ln 2 at most.
    """
    rng = np.random.default_rng(seed)
    d = pattern_of(rng, length)
    r = rng.standard_normal(FEATURES)
    found = best(d, r)
    assert found.log_evidence <= found.gain + 1e-12
    exact = integral(lambda u: likelihood(r, size(u) * d), 1)
    assert -0.1 < found.log_evidence - exact < 0.7


def test_what_changes_nothing_weighs_as_nothing() -> None:
    found = best(np.zeros(FEATURES), np.ones(FEATURES))
    assert (found.gain, found.log_evidence) == (0.0, 0.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("length", [0.0, 8.0, 25.0])
def test_shapes_are_weighed_with_the_size(seed: int, length: float) -> None:
    """One parameter of shape: within 1 nat, as seven shapes lie about an error apart."""
    rng = np.random.default_rng(seed)
    a, b = pattern_of(rng, 1.0), pattern_of(rng, 0.6)
    scale = max(length, 8.0) / 0.4

    def pattern(t: FloatArray | float) -> FloatArray:
        t = np.asarray(t)[..., None]
        found: FloatArray = scale * (a + t * b + 0.2 * t * t * a)
        return found

    r = (0.4 if length else 0.0) * pattern(0.3) + rng.standard_normal(FEATURES)
    (signed,) = signed_forms([effect("a", shapes=1)])
    nodes = nodes_of(signed, pattern)
    (found,) = searched((signed,), nodes @ r, nodes @ nodes.T)
    exact = integral(lambda u, v: likelihood(r, size(u) * pattern(2.0 * v - 1.0)), 2)
    assert found.log_evidence <= found.gain + 1e-12
    assert found.log_evidence - exact == pytest.approx(0.0, abs=1.0)


# ------------------------------------------------------------------------------------------------
# A factor on the force of some specimens: found where it was put in, and not in plain scatter.


UNITS = (4.4482216152605, 9.80665, 25.4)
SHARES = np.array([0.07, 0.15, 0.3, 0.5])
SCATTER = 0.03
"""Of specimens' levels."""

BATCH = 0.012


def weighed(
    levels: FloatArray, shared: FloatArray | None = None, *, large: bool = False
) -> Candidate:
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
    return _weigh_subset(products, Candidate(()), SCATTER, large)


def batches(n: int) -> FloatArray:
    return BATCH * np.array([[float(k % 2 == b) for b in range(2)] for k in range(n)])


def planted(seed: int, members: list[int], log_gain: float, n: int = 20) -> FloatArray:
    levels = SCATTER * np.random.default_rng(seed).standard_normal(n)
    levels[members] += log_gain
    return levels


def test_a_gain_is_where_it_fits_best_and_not_on_the_grid() -> None:
    """Of six specimens without scatter; the grid's nearest are 0.216 and 0.241."""
    found = weighed(np.repeat([0.0, 0.23], [14, 6]))
    assert found.log_gain == pytest.approx(0.23, abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("log_gain", [0.3, -0.25])
def test_those_that_were_put_in_are_found(seed: int, log_gain: float) -> None:
    """Eight deviations off: all of them, none else, the factor to 3 standard errors."""
    members = [1, 4, 5, 11, 17]
    found = weighed(planted(seed, members, log_gain), batches(20))
    assert found.effects == ("force-scale",)
    assert np.flatnonzero(found.members).tolist() == members
    off = abs(found.log_gain - log_gain)
    assert off < 3.0 * SCATTER / np.sqrt(len(members))
    assert found.log_evidence > 50.0
    assert found.gain > found.log_evidence


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_units_are_found_as_they_are(unit: float, sign: float) -> None:
    """The factor itself, not the nearest of a grid."""
    found = weighed(planted(2, [0, 7, 8], sign * float(np.log(unit))))
    assert np.exp(found.log_gain) == pytest.approx(unit**sign, rel=1e-12)
    assert np.flatnonzero(found.members).tolist() == [0, 7, 8]


@pytest.mark.parametrize("factor", [0.28, 3.3, 7.0])
def test_a_factor_between_those_of_units_is_likelier_to_be_none_of_them(factor: float) -> None:
    """Treated samples that bear a third of the force are not in pounds: lbf would be 4.448."""
    levels = planted(2, [0, 7, 8], float(np.log(factor)))
    found = weighed(levels, large=True)
    assert np.exp(found.log_gain) == pytest.approx(factor, rel=4.0 * SCATTER / np.sqrt(3.0))
    assert found.log_evidence > weighed(levels).log_evidence + 10.0


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
    """Sum over all subsets and factors, half of these any from 5 to 80 %, half units mixed up."""
    n = len(levels)
    covariance = SCATTER**2 * np.eye(n)
    if shared is not None:
        covariance = covariance + shared @ shared.T
    precision = np.linalg.inv(covariance)
    some = np.geomspace(0.05, 0.6, 24)
    some = some[some >= 2.5 * SCATTER]
    gains = np.concatenate([some, -some, np.log(UNITS), -np.log(UNITS)])
    log_prior = -np.log(np.repeat([4.0 * len(some), 4.0 * len(UNITS)], [2 * len(some), 6]))
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


def test_two_effects_are_looked_at_in_all_forms_of_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each form where it is best beside the other; none that fits worse than nothing."""
    monkeypatch.setattr(weigh, "joined", tuple)

    def form(id: str, number: int, gain: float = 0.0) -> Any:
        return SimpleNamespace(
            effects=(id,), parts=(f"{id}{number}",), gain=gain, log_evidence=gain
        )

    def single(own: Any, *beside: Any) -> Any:
        return SimpleNamespace(candidate=own, beside=beside)

    best: Any = {
        ("a",): single(form("a", 1), form("c", 1, 3.0), form("b", 1, 2.0), form("b", 2, 1.0)),
        ("b",): single(form("b", 1), form("a", 2, 1.0), form("a", 3, -9.0)),
    }
    found = list(weigh._in_all_forms(("a", "b"), (best, {})))
    assert found == [("a1", "b1"), ("a1", "b2"), ("b1", "a2")]
