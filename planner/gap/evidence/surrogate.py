"""A surrogate of the forward model: nodes, interpolation and inner products of each form."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from math import prod
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from planner.gap.effect import Effect, Form
from planner.numerics import FloatArray, IntArray

__all__ = ["Candidate", "Search", "SignedForm", "joined", "node_weights", "signed_forms"]


# ------------------------------------------------------------------------------------------------
# Where each form is evaluated, so that everything in between follows by interpolation.
#
# The features that a form predicts are smooth in its parameters: three sizes, five values of a
# first parameter of shape and three of a second carry them. Sizes are spaced nearly as squares,
# being nought at the first, which needs no evaluation; a place has the root s of the size over its
# largest. Times of relaxation over decades take the five.


_NODES = np.array(
    [
        [0.0, 0.35, 0.7, 1.0, np.nan],  # of s, the root of size over its largest
        [-0.932, -0.576, 0.0, 0.576, 0.932],  # of the ranges, -1 to 1, of a first shape parameter
        [-0.85, 0.0, 0.85, np.nan, np.nan],  # and of a second: nearly Chebyshev's
    ]
)
_FIRST, _STOP = (1, 0, 0), (4, 5, 3)
"""Nodes of a form: where they lie, and which are evaluated. Numerical: what lies between is
interpolated to find where to look; what is found is settled on the model itself."""

_FAR = 4.0
"""Deviations beyond which no parameter is looked for. Numerical: all but 6e-5 of a prior lies
within."""


_Place: TypeAlias = tuple[float, ...]
"""Of a form: s, the root of its size over the largest; shapes in -1 to 1; then perhaps details."""


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
            values[parameter.name] = parameter.at(0.5 * (at + 1.0))
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


_POWER = (2, 1, 1)
"""Of a place, in which polynomials are. Numerical: those of the size itself, and not of its root,
are near at small sizes too."""


@lru_cache(maxsize=3)
def _lagrange(d: int) -> FloatArray:
    """Return the coefficients of Lagrange's polynomials through the nodes of a parameter."""
    nodes = _NODES[d, : _STOP[d]] ** _POWER[d]
    return np.asarray(np.linalg.inv(np.vander(nodes, increasing=True)))


def node_weights(places: ArrayLike) -> FloatArray:
    """Return the weight of each node of a form, (..., nodes), at places (..., 1 + shapes).

    Lagrange's, sizes slowest.
    """
    at = np.asarray(places, dtype=np.float64)
    weights = np.ones((*at.shape[:-1], 1))
    for d in range(at.shape[-1]):
        powers = np.vander(at[..., d].ravel() ** _POWER[d], _STOP[d], increasing=True)
        own = (powers @ _lagrange(d)).reshape(*at.shape[:-1], -1)[..., _FIRST[d] :]
        weights = (weights[..., :, None] * own[..., None, :]).reshape(*at.shape[:-1], -1)
    return weights


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
    places: tuple[_Place, ...] = ()
    gain: float = 0.0
    log_evidence: float = 0.0
    members: FloatArray | None = None
    log_gain: float = 0.0

    @property
    def sizes(self) -> FloatArray:
        """The s of each effect."""
        return np.array([place[0] for place in self.places])

    @property
    def parts(self) -> list[tuple[SignedForm, _Place]]:
        """Each branch with its place."""
        return list(zip(self.branches, self.places, strict=True))


def joined(
    parts: Iterable[tuple[SignedForm, _Place]], gain: float = 0.0, log_evidence: float = 0.0
) -> Candidate:
    """Return branches at places as one candidate, effects sorted."""
    branches, places = zip(*sorted(parts, key=lambda part: part[0].effect.id), strict=True)
    return Candidate(tuple(b.effect.id for b in branches), branches, places, gain, log_evidence)


# ------------------------------------------------------------------------------------------------
# Where to look: every form and every pair of effects, on grids of their sizes and shapes.
#
# All features of a form are combinations of its nodes' features, so that its likelihood needs their
# inner products with the residual and with one another, and nothing of the campaign's size.


_GRID = (24, 7, 7)
"""Sizes and shapes at which a form is looked at. Numerical: its evidence is the mean over them, and
what is settled starts from the best."""

_SCAN = 8
"""Sizes at which pairs are scanned. Numerical: the search goes on from there."""

_PAIRS = 30
"""Pairs of effects that pass the scan. Numerical: more than twice as many as are settled."""

_FORMS = 3
"""Combinations of forms of such a pair that are sought. Numerical: the best ones of the scan; forms
of an effect differ little before they are settled."""

_FINER = (0.5, 0.5, 0.25, 0.25, 0.1, 0.1, 0.03, 0.03)
"""Of the steps of that scan, by which places about the best are looked at, one effect after the
other. Numerical: sizes are found to a hundredth."""


def _sizes(least: float, count: int) -> FloatArray:
    """Return sizes s from the smallest to the largest, in equal ratios."""
    sizes: FloatArray = least ** (1.0 - np.arange(count) / (count - 1.0))
    return sizes


def _mesh(axes: Sequence[FloatArray]) -> FloatArray:
    """Return all combinations of coordinates, (P, len(axes))."""
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


@lru_cache(maxsize=256)
def _grid(least: float, shapes: int) -> tuple[FloatArray, FloatArray]:
    """Return places of a form, and the weights of its nodes there."""
    of_shapes = [np.linspace(-1.0, 1.0, count) for count in _GRID[1 : 1 + shapes]]
    places = _mesh([_sizes(least, _GRID[0]), *of_shapes])
    return places, node_weights(places)


def _gains(weights: FloatArray, residual: FloatArray, nodes: FloatArray) -> FloatArray:
    """Return log likelihoods over that of no effect, (P,), for weights of nodes (P, nodes)."""
    return np.asarray(weights @ residual - 0.5 * np.sum((weights @ nodes) * weights, axis=1))


class Search:
    """Branches searched on inner products of all nodes.

    Parameters
    ----------
    residual : (nodes,), nodes : (nodes, nodes)
        Inner products with the residual and with one another.
    """

    def __init__(
        self, branches: Sequence[SignedForm], residual: FloatArray, nodes: FloatArray
    ) -> None:
        self._branches, self._residual, self._nodes = branches, residual, nodes

    def singles(self) -> list[Candidate]:
        """Return every branch alone, at its best place."""
        return [self._single(branch) for branch in self._branches]

    def _single(self, branch: SignedForm) -> Candidate:
        own = branch.own
        places, weights = _grid(branch.least, branch.shapes)
        gains = _gains(weights, self._residual[own], self._nodes[own, own])
        at = int(np.argmax(gains))
        mean = gains[at] + np.log(np.mean(np.exp(gains - gains[at])))
        return joined([(branch, tuple(places[at].tolist()))], float(gains[at]), float(mean))

    def _sought(
        self, branches: Sequence[SignedForm], places: list[FloatArray], cost: float
    ) -> Candidate:
        """Return a pair at the best places near these.

        Parameters
        ----------
        cost
            Nats that the freedom of sizes and shapes takes off the gain.
        """
        rows = np.concatenate([np.arange(b.own.start, b.own.stop) for b in branches])
        b, g = self._residual[rows], self._nodes[np.ix_(rows, rows)]
        w = np.concatenate([node_weights(place) for place in places])
        for finer in _FINER:
            stop = 0
            for k, branch in enumerate(branches):
                here = slice(stop, stop := stop + branch.nodes)
                w[here] = 0.0
                size, *shapes = places[k].tolist()
                steps = finer * np.linspace(-1.0, 1.0, 5)
                sizes = np.clip(size * branch.least ** (steps / (_SCAN - 1.0)), branch.least, 1.0)
                tried = _mesh([sizes, *(np.clip(at + 0.5 * steps, -1.0, 1.0) for at in shapes)])
                weights = node_weights(tried)
                best = int(np.argmax(_gains(weights, b[here] - g[here] @ w, g[here, here])))
                places[k], w[here] = tried[best], weights[best]
        gain = float(w @ (b - 0.5 * g @ w))
        found = [(branch, tuple(p.tolist())) for branch, p in zip(branches, places, strict=True)]
        return joined(found, gain, gain - cost)

    def pairs(self, singles: Sequence[Candidate]) -> list[Candidate]:
        """Return the pairs of effects worth weighing, each in its best forms at the best place.

        Sizes are scanned with shapes held at those of `singles`, one a branch.
        """
        if not singles:
            return []
        shapes = [single.places[0][1:] for single in singles]
        costs = [single.gain - single.log_evidence for single in singles]
        sizes = [_sizes(branch.least, _SCAN) for branch in self._branches]
        gain, best = self._scanned(sizes, shapes)
        ids = [branch.effect.id for branch in self._branches]
        groups: dict[tuple[str, str], list[tuple[float, int, int]]] = {}
        for other, one in combinations(range(len(ids)), 2):
            if ids[one] != ids[other]:
                found = float(gain[one, other]), one, other
                groups.setdefault((ids[other], ids[one]), []).append(found)
        ranked = sorted((sorted(group, reverse=True) for group in groups.values()), reverse=True)
        pairs = []
        for _, *both in (pair for group in ranked[:_PAIRS] for pair in group[:_FORMS]):
            at = np.unravel_index(best[tuple(both)], (_SCAN, _SCAN))
            starts = [np.array([sizes[k][i], *shapes[k]]) for k, i in zip(both, at, strict=True)]
            branches = [self._branches[k] for k in both]
            pairs.append(self._sought(branches, starts, sum(costs[k] for k in both)))
        return pairs

    def _scanned(
        self, sizes: Sequence[FloatArray], shapes: Sequence[tuple[float, ...]]
    ) -> tuple[FloatArray, IntArray]:
        """Return the best gain of each pair of branches, and which of its sizes have it, (B, B)."""
        weights = [
            node_weights([(s, *shape) for s in own])
            for own, shape in zip(sizes, shapes, strict=True)
        ]
        parts = list(zip(self._branches, weights, strict=True))
        half = np.concatenate([w @ self._nodes[b.own] for b, w in parts])
        cross = np.concatenate([half[:, b.own] @ w.T for b, w in parts], axis=1)
        alone = np.concatenate([w @ self._residual[b.own] for b, w in parts])
        alone -= 0.5 * np.diagonal(cross)
        count = len(self._branches)
        gain = (alone[:, None] + alone - cross).reshape(count, _SCAN, count, _SCAN)
        flat = gain.swapaxes(1, 2).reshape(count, count, -1)
        return flat.max(axis=2), flat.argmax(axis=2)
