"""A surrogate of the forward model: nodes, interpolation and inner products of each form."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from planner.gap.effect import Effect, Form, Parameter, Values
from planner.numerics import FloatArray, IntArray, inner_kernel, kernel

__all__ = [
    "Candidate",
    "Elimination",
    "SignedForm",
    "Whitened",
    "climbed",
    "integrated",
    "node_weights",
    "signed_forms",
]


# ------------------------------------------------------------------------------------------------
# Where each form is evaluated, so that everything in between follows by interpolation.
#
# The features that a form predicts are smooth in its parameters: four sizes, five values of a first
# parameter of shape and three of a second carry them. Sizes are spaced as squares, being nought at
# the first, which needs no evaluation: with size = high s^2, features that are linear in the size
# are a parabola in s. Times of relaxation over decades take the five.


_NODES = np.array(
    [
        [0.0, 0.25, 0.5, 0.75, 1.0],  # of s, the root of size over its largest
        [-0.932, -0.576, 0.0, 0.576, 0.932],  # of the ranges, -1 to 1, of a first shape parameter
        [-0.85, 0.0, 0.85, np.nan, np.nan],  # and of a second: nearly Chebyshev's
    ]
)
_FIRST, _STOP = (1, 0, 0), (5, 5, 3)
_MOST = 60
"""Nodes of a form: where they lie, which are evaluated, and how many at most. Numerical: what lies
between is interpolated to find where to look; what is found is settled on the model itself."""

_FAR = 4.0
"""Deviations beyond which no parameter is looked for. Numerical: all but 6e-5 of a prior lies
within."""


@inner_kernel
def _weights(place: FloatArray, out: FloatArray) -> int:
    """Fill Lagrange's weights of the nodes at a place (s, shapes...), sizes slowest; count them."""
    part = np.empty(5)
    n = 1
    out[0] = 1.0
    for d in range(len(place)):
        first, stop = _FIRST[d], _STOP[d]
        for j in range(first, stop):
            value = 1.0
            for k in range(stop):
                if k != j:
                    value *= (place[d] - _NODES[d, k]) / (_NODES[d, j] - _NODES[d, k])
            part[j - first] = value
        count = stop - first
        for i in range(n - 1, -1, -1):
            old = out[i]
            for j in range(count):
                out[i * count + j] = old * part[j]
        n *= count
    return n


@kernel
def _fill_weights(places: FloatArray, out: FloatArray) -> None:
    """Fill the weights of the nodes, (P, nodes), at places (P, 1 + shapes)."""
    for p in range(len(places)):
        _weights(places[p], out[p])


@dataclass(frozen=True, slots=True)
class SignedForm:
    """One form with one sign of its size.

    Attributes
    ----------
    number
        Among all branches.
    first
        Its first node among all nodes.
    weight
        Its share of the prior among the effect's branches.
    """

    number: int
    effect: Effect
    form: Form
    sign: float
    first: int
    weight: float

    @property
    def shapes(self) -> int:
        """Number of shape parameters."""
        return len(self.form.parameters) - 1

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return prod(_STOP[d] - _FIRST[d] for d in range(1 + self.shapes))

    @property
    def own(self) -> slice:
        """Its nodes among all nodes."""
        return slice(self.first, self.first + self.nodes)

    def values(self, place: Sequence[float]) -> dict[str, float]:
        """Return the parameters at a place: s, then shapes in -1 to 1, then perhaps details."""
        size = self.form.size
        values = {size.name: self.sign * size.high * place[0] ** 2}
        for parameter, at in zip(self.form.parameters[1:], place[1:], strict=False):
            values[parameter.name] = _value_at(parameter, at)
        values.update(zip(self.form.details, place[1 + self.shapes :], strict=False))
        return values

    def coordinates(self, place: Sequence[float]) -> FloatArray:
        """Return a place in coordinates that are normal with deviation 1 before any data.

        Sizes are uniform in their logarithm, shapes over their range.
        """
        share = [1.0 - np.log(max(place[0], self.least)) / np.log(self.least)]
        share += [0.5 * (at + 1.0) for at in place[1 : 1 + self.shapes]]
        found = np.zeros(1 + self.shapes + len(self.form.details))
        found[: len(share)] = ndtri(np.clip(share, *ndtr([-_FAR, _FAR])))
        found[len(share) : len(place)] = place[len(share) :]
        return found

    def place(self, coordinates: FloatArray) -> tuple[float, ...]:
        """Return the place at coordinates; see `coordinates`."""
        at = np.clip(coordinates, -_FAR, _FAR)
        share = ndtr(at[: 1 + self.shapes])
        size = float(self.least ** (1.0 - share[0]))
        return (size, *(2.0 * share[1:] - 1.0).tolist(), *at[1 + self.shapes :].tolist())

    def node_places(self) -> list[tuple[float, ...]]:
        """Return the places of its nodes, sizes slowest."""
        axes = [_NODES[d, _FIRST[d] : _STOP[d]].tolist() for d in range(1 + self.shapes)]
        return list(product(*axes))

    @property
    def least(self) -> float:
        """The smallest s."""
        return float((self.form.size.low / self.form.size.high) ** 0.5)

    @property
    def lows(self) -> list[float]:
        """The smallest value of each coordinate of a place; the largest is 1."""
        return [self.least] + [-1.0] * self.shapes


def _value_at(parameter: Parameter, at: float) -> float:
    """Return a shape parameter's value at a place of its range, -1 to 1."""
    share = 0.5 * (at + 1.0)
    if parameter.log:
        return float(parameter.low * (parameter.high / parameter.low) ** share)
    return float(parameter.low + share * (parameter.high - parameter.low))


def signed_forms(effects: Sequence[Effect]) -> tuple[SignedForm, ...]:
    """Return all branches of the effects, numbered, with their nodes one after another."""
    found: list[SignedForm] = []
    first = 0
    for effect in effects:
        for form in effect.forms:
            signs = (1.0, -1.0) if form.size.signed else (1.0,)
            for sign in signs:
                weight = form.weight / sum(f.weight for f in effect.forms) / len(signs)
                branch = SignedForm(len(found), effect, form, sign, first, weight)
                found.append(branch)
                first += branch.nodes
    return tuple(found)


def node_weights(branch: SignedForm, places: ArrayLike) -> FloatArray:
    """Return the weight of each node of a branch, (..., nodes), at places (..., 1 + shapes)."""
    at = np.asarray(places, dtype=np.float64)
    flat = np.ascontiguousarray(at.reshape(-1, at.shape[-1]))
    weights = np.empty((len(flat), branch.nodes))
    _fill_weights(flat, weights)
    return weights.reshape(*at.shape[:-1], branch.nodes)


# ------------------------------------------------------------------------------------------------
# One explanation of a campaign, fitted.


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Effects in one form each, at their best parameters.

    Attributes
    ----------
    effects
        Ids, sorted; () for none.
    branches, places
        Of each effect, in that order; a place is (s, shapes..., details...).
    gain
        Log likelihood above that of no effect.
    log_evidence
        Above that of no effect, of this form alone.
    members : (n,) or None
        Which specimens it holds for, 1 or 0, where it holds for some only.
    log_gain
        What these specimens' force is off by, as a logarithm.
    """

    effects: tuple[str, ...]
    branches: tuple[SignedForm, ...] = ()
    places: tuple[tuple[float, ...], ...] = ()
    gain: float = 0.0
    log_evidence: float = 0.0
    members: FloatArray | None = None
    log_gain: float = 0.0

    @property
    def sizes(self) -> FloatArray:
        """The s of each effect."""
        return np.array([place[0] for place in self.places])

    def values(self) -> list[tuple[SignedForm, Values]]:
        """Return the branches with their parameters' values."""
        pairs = zip(self.branches, self.places, strict=True)
        return [(branch, branch.values(place)) for branch, place in pairs]


# ------------------------------------------------------------------------------------------------
# Climb to the best parameters, on inner products alone.
#
# All features of a form are combinations of its nodes' features, so that its likelihood needs their
# inner products with the residual and with one another, and nothing of the campaign's size.


_ROOM = 2 * _MOST
"""Of weights. Numerical: the nodes of two forms."""


@inner_kernel
def _gain(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, place: FloatArray,
    c: FloatArray, at: IntArray,
) -> float:  # fmt: skip
    """Return the log likelihood over that of no effect, at a place of one or two branches.

    Sums run along rows, side by side: each sum's own order is fixed, and processors add many
    at a time.
    """
    n = 0
    d = 0
    for i in range(len(firsts)):
        at[i] = n
        n += _weights(place[d : d + 1 + shapes[i]], c[n:])
        d += 1 + shapes[i]
    at[len(firsts)] = n
    total = 0.0
    for i in range(len(firsts)):
        mi = at[i + 1] - at[i]
        inner = c[_ROOM : _ROOM + mi]
        for p in range(mi):
            inner[p] = -2.0 * b[firsts[i] + p]
        for j in range(len(firsts)):
            mj = at[j + 1] - at[j]
            for q in range(mj):
                row = g[firsts[j] + q, firsts[i] : firsts[i] + mi]
                factor = c[at[j] + q]
                for p in range(mi):
                    inner[p] += row[p] * factor
        for p in range(mi):
            total += c[at[i] + p] * inner[p]
    return -0.5 * total


@inner_kernel
def _climb(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, low: FloatArray,
    place: FloatArray, step: float, c: FloatArray, at: IntArray,
) -> float:  # fmt: skip
    """Improve a place by compass search; sizes within (low, 1), shapes within (-1, 1)."""
    dims = len(place)
    best = _gain(b, g, firsts, shapes, place, c, at)
    while step > 2e-4:
        moved = False
        for d in range(dims):
            old = place[d]
            for sign in (-1.0, 1.0):
                trial = old + sign * step * (0.5 if low[d] > -1.0 else 1.0)
                trial = min(max(trial, low[d]), 1.0)
                if trial == old:
                    continue
                place[d] = trial
                value = _gain(b, g, firsts, shapes, place, c, at)
                if value > best + 1e-9:
                    best = value
                    old = trial
                    moved = True
                else:
                    place[d] = old
            place[d] = old
        if not moved:
            step *= 0.5
    return best


@inner_kernel
def _laplace(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, low: FloatArray,
    place: FloatArray, best: float, c: FloatArray, at: IntArray,
) -> float:  # fmt: skip
    """Return the log evidence by Laplace's method, in coordinates in which the prior is uniform.

    Sizes have priors uniform in their logarithm, u = ln(s / low) / ln(1 / low); shapes uniform.
    Each direction's width is bounded by its range, and the peak counts in full even at an edge.
    """
    dims = len(place)
    h = 0.02
    hess = np.empty((dims, dims))
    move = np.empty(dims)
    for d in range(dims):
        # ds for a step h of u; 2 h for shapes, whose range is 2 long
        move[d] = h * place[d] * np.log(1.0 / low[d]) if low[d] > -1.0 else 2.0 * h
    trial = place.copy()
    for i in range(dims):
        for j in range(i + 1):
            total = 0.0
            for si in (-1.0, 1.0):
                for sj in (-1.0, 1.0):
                    for d in range(dims):
                        trial[d] = place[d]
                    trial[i] += si * move[i]
                    trial[j] += sj * move[j]
                    total += si * sj * _gain(b, g, firsts, shapes, trial, c, at)
            hess[i, j] = -total / (4.0 * h * h)
            hess[j, i] = hess[i, j]
    # A flat direction is as wide as its range: sqrt(2 pi / 2 pi) = 1.
    floor = 2.0 * np.pi
    values, _ = np.linalg.eigh(hess)
    log_width = 0.0
    for d in range(dims):
        log_width += 0.5 * np.log(floor / max(values[d], floor))
    return best + log_width


@kernel
def _climbed(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, low: FloatArray,
    place: FloatArray, step: float,
) -> tuple[float, float]:  # fmt: skip
    """Climb from a place of one or two branches, in it; return gain and log evidence."""
    c = np.empty(3 * _MOST)
    at = np.empty(3, dtype=np.int64)
    best = _climb(b, g, firsts, shapes, low, place, step, c, at)
    return best, _laplace(b, g, firsts, shapes, low, place, best, c, at)


def climbed(
    candidate: Candidate,
    residual: FloatArray,
    nodes: FloatArray,
    firsts: Sequence[int],
    step: float = 0.1,
) -> Candidate:
    """Return a candidate at the best place near its own, with its gain and log evidence there.

    Parameters
    ----------
    residual : (k,), nodes : (k, k)
        Inner products of nodes with the residual and with one another.
    firsts
        The first of each branch's nodes among these.
    step
        To begin with, of the range of a parameter.
    """
    branches = candidate.branches
    place = np.array([x for own in candidate.places for x in own])
    gain, evidence = _climbed(
        np.ascontiguousarray(residual),
        np.ascontiguousarray(nodes),
        np.array(firsts, dtype=np.int64),
        np.array([b.shapes for b in branches], dtype=np.int64),
        np.array([low for b in branches for low in b.lows]),
        place,
        step,
    )
    ends = np.cumsum([1 + b.shapes for b in branches])[:-1]
    places = tuple(tuple(own.tolist()) for own in np.split(place, ends))
    return replace(candidate, places=places, gain=float(gain), log_evidence=float(evidence))


# ------------------------------------------------------------------------------------------------
# All inner products that weighing hypotheses takes, whitened once.
#
# Columns are the residual, the features of every node of every form, each specimen's own gain,
# patterns of the unknown, and nuisances: calibration of the laws and batches. Weights on specimens
# and a factor on the scatter enter afterwards, so that resampling and leaving out cost one product
# each.


@dataclass(frozen=True, slots=True, eq=False)
class Whitened:
    """Columns (N, X) whitened specimen by specimen; the last `nuisances` have prior deviation 1.

    Attributes
    ----------
    first_row : (n + 1,)
        Where each specimen's rows begin.
    """

    columns: FloatArray
    first_row: IntArray
    nuisances: int

    @property
    def nuisance_columns(self) -> FloatArray:
        """The last columns."""
        return self.columns[:, self.columns.shape[1] - self.nuisances :]

    def on_rows(self, weight: FloatArray) -> FloatArray:
        """Return the weight of each row, (N,), from each specimen's, (n,)."""
        return np.repeat(weight, np.diff(self.first_row))


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Inner products of the kept columns with nuisances integrated out, and ln p(data | none)."""

    products: FloatArray
    none: float

    def with_random(self, columns: slice, amplitude: float, head: int) -> "Elimination":
        """Integrate over columns with coefficients of deviation `amplitude`; keep `head` others."""
        a = self.products
        inner = a[columns, columns] + np.eye(columns.stop - columns.start) / amplitude**2
        left, log_det = integrated(a[:head, :head], a[columns, :head], inner)
        log_det += 2.0 * len(inner) * float(np.log(amplitude))
        gain = 0.5 * (float(a[0, 0]) - float(left[0, 0])) - 0.5 * log_det
        return Elimination(left, self.none + gain)


def integrated(kept: FloatArray, cross: FloatArray, inner: FloatArray) -> tuple[FloatArray, float]:
    """Return Schur's complement of `inner`, and the logarithm of its determinant."""
    factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
    half = scipy.linalg.solve_triangular(factor, cross, lower=True, check_finite=False)
    return kept - half.T @ half, 2.0 * float(np.log(np.diagonal(factor)).sum())
