"""A surrogate of the forward model: nodes, interpolation and inner products of each form."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod

import numpy as np
import scipy.linalg

from planner.gap.effect import Effect, Form, Parameter, Values
from planner.gap.noise import SpecimenNoise
from planner.numerics import FloatArray, IntArray

__all__ = [
    "SHAPE_NODES",
    "SIZE_NODES",
    "Candidate",
    "Elimination",
    "InnerProducts",
    "SignedForm",
    "Whitened",
    "interpolated_features",
    "node_weights",
    "signed_forms",
    "whiten",
]


# ------------------------------------------------------------------------------------------------
# Where each form is evaluated, so that everything in between follows by interpolation.
#
# The figures of a form are smooth in its parameters: four sizes, five values of a first parameter
# of shape and three of a second carry them. Sizes are spaced as squares, being nought at the first,
# which needs no evaluation: with size = high s^2, figures that are linear in the size are a
# parabola in s.


SIZE_NODES = (0.25, 0.5, 0.75, 1.0)
"""Of s, the root of size over its largest."""

SHAPE_NODES = ((-0.932, -0.576, 0.0, 0.576, 0.932), (-0.85, 0.0, 0.85))
"""Of the ranges, -1 to 1, of a form's first shape parameter and of its second: nearly Chebyshev's.
Times of relaxation over decades take five."""


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
        return len(SIZE_NODES) * prod(len(nodes) for nodes in SHAPE_NODES[: self.shapes])

    def values(self, place: Sequence[float]) -> dict[str, float]:
        """Return the parameters at a place: s, then shapes in -1 to 1."""
        size = self.form.size
        values = {size.name: self.sign * size.high * place[0] ** 2}
        for parameter, at in zip(self.form.parameters[1:], place[1:], strict=True):
            values[parameter.name] = _value_at(parameter, at)
        return values

    def node_values(self) -> list[dict[str, float]]:
        """Return the parameters of its nodes, sizes slowest."""
        grid = product(SIZE_NODES, *SHAPE_NODES[: self.shapes])
        return [self.values(place) for place in grid]

    @property
    def least(self) -> float:
        """The smallest s."""
        return float((self.form.size.low / self.form.size.high) ** 0.5)


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
        Of each effect, in that order; a place is (s, shapes...).
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

    def values(self) -> list[tuple[SignedForm, Values]]:
        """Return the branches with their parameters' values."""
        pairs = zip(self.branches, self.places, strict=True)
        return [(branch, branch.values(place)) for branch, place in pairs]

    @property
    def flat(self) -> FloatArray:
        """All places one after another."""
        return np.array([x for place in self.places for x in place])

    def at(self, flat: tuple[float, ...], gain: float, log_evidence: float) -> "Candidate":
        """Return the candidate moved to another place."""
        places, first = [], 0
        for place in self.places:
            places.append(tuple(flat[first : first + len(place)]))
            first += len(place)
        return replace(self, places=tuple(places), gain=gain, log_evidence=log_evidence)


# ------------------------------------------------------------------------------------------------
# Interpolation weights of a branch's nodes, and the figures of a candidate by them.


def node_weights(branch: SignedForm, place: Sequence[float]) -> FloatArray:
    """Return the weight of each node of a branch at a place."""
    size = _lagrange((0.0, *SIZE_NODES), place[0])[1:]
    shapes = [_lagrange(nodes, at) for nodes, at in zip(SHAPE_NODES, place[1:], strict=False)]
    return np.array([np.prod(parts) for parts in product(size, *shapes)])


def interpolated_features(candidate: Candidate, node_figures: FloatArray) -> FloatArray:
    """Return how a candidate's effects change the figures, by interpolation, (N,)."""
    total = np.zeros(node_figures.shape[1])
    for branch, place in zip(candidate.branches, candidate.places, strict=True):
        nodes = slice(branch.first, branch.first + branch.nodes)
        total += node_weights(branch, place) @ node_figures[nodes]
    return total


def _lagrange(at: tuple[float, ...], x: float) -> list[float]:
    return [float(np.prod([(x - b) / (a - b) for b in at if b != a])) for a in at]


# ------------------------------------------------------------------------------------------------
# All inner products that weighing hypotheses takes, whitened once.
#
# Columns are the residual, the figures of every node of every form, patterns of the unknown, each
# specimen's own gain, and nuisances: calibration of the laws and batches. Weights on specimens and
# a factor on the scatter enter afterwards, so that resampling and leaving out cost one product
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

    def gram(self, weight: FloatArray | None = None) -> "InnerProducts":
        """Return the inner products, specimens weighted by `weight` (n,)."""
        counts = np.diff(self.first_row)
        if weight is None:
            return InnerProducts(self.columns.T @ self.columns, float(counts.sum()), self.nuisances)
        rows = np.repeat(weight, counts)
        kept = rows > 0.0
        part = self.columns[kept] * np.sqrt(rows[kept])[:, None]
        return InnerProducts(part.T @ part, float(rows.sum()), self.nuisances)


@dataclass(frozen=True, slots=True, eq=False)
class InnerProducts:
    """Inner products (X, X) of weighted columns and the weighted number of rows."""

    products: FloatArray
    rows: float
    nuisances: int

    def eliminate(
        self, scale: float = 1.0, extra: tuple[FloatArray, FloatArray] | None = None
    ) -> "Elimination":
        """Integrate over nuisances, the noise being `scale` times as large.

        Parameters
        ----------
        extra
            Further nuisances of prior deviation 1: inner products with all columns, (e, X), and
            with one another, (e, e).
        """
        kept = len(self.products) - self.nuisances
        m = self.products / scale**2
        inner, cross = m[kept:, kept:], m[kept:, :kept]
        if extra is not None:
            more, own = extra[0] / scale**2, extra[1] / scale**2
            cross = np.concatenate([cross, more[:, :kept]])
            inner = np.block([[inner, more[:, kept:].T], [more[:, kept:], own]])
        inner = inner + np.eye(len(inner))
        factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
        half = scipy.linalg.solve_triangular(factor, cross, lower=True, check_finite=False)
        log_det = 2.0 * float(np.log(np.diagonal(factor)).sum())
        left = m[:kept, :kept] - half.T @ half
        none = -self.rows * float(np.log(scale)) - 0.5 * (float(left[0, 0]) + log_det)
        return Elimination(left, none)


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Inner products of the kept columns with nuisances integrated out, and ln p(data | none)."""

    products: FloatArray
    none: float

    def part(self, columns: IntArray) -> "Elimination":
        """Return the inner products of some columns, the residual first."""
        return Elimination(self.products[np.ix_(columns, columns)], self.none)

    def with_random(self, columns: slice, amplitude: float, head: int) -> "Elimination":
        """Integrate over columns with coefficients of deviation `amplitude`; keep `head` others."""
        a = self.products
        inner = a[columns, columns] + np.eye(columns.stop - columns.start) / amplitude**2
        factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
        half = scipy.linalg.solve_triangular(
            factor, a[columns, :head], lower=True, check_finite=False
        )
        log_det = 2.0 * float(np.log(np.diagonal(factor)).sum())
        log_det += 2.0 * len(inner) * float(np.log(amplitude))
        left = a[:head, :head] - half.T @ half
        gain = 0.5 * (float(a[0, 0]) - float(left[0, 0])) - 0.5 * log_det
        return Elimination(left, self.none + gain)


def whiten(columns: FloatArray, noise: SpecimenNoise, nuisances: int) -> Whitened:
    """Whiten columns (N, X) by each specimen's own covariance."""
    white = np.empty_like(columns)
    for rows, factor in zip(noise.rows, noise.factors, strict=True):
        white[rows] = scipy.linalg.solve_triangular(
            factor, columns[rows], lower=True, check_finite=False
        )
    first = np.array([r.start for r in noise.rows] + [len(columns)])
    return Whitened(white, first, nuisances)
