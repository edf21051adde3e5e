"""The best parameters of every form, of pairs, and of subsets of specimens."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from planner.formats.tables import QUANTITY_UNITS
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.surrogate import Candidate, Elimination, SignedForm
from planner.gap.noise import Scatter
from planner.numerics import FloatArray, IntArray, inner_kernel, kernel

__all__ = [
    "FORCE_UNITS",
    "SHARES",
    "Pairs",
    "Search",
    "Singles",
    "best_pair",
    "best_single",
    "gains_of",
    "scan_pairs",
    "weigh_single",
    "weigh_subset",
    "weigh_subset_beside",
]


# ------------------------------------------------------------------------------------------------
# Loops of the search for the best parameters, on inner products alone.
#
# All figures of a form are combinations of its nodes' figures, so that its likelihood needs their
# inner products with the residual and with one another, and nothing of the campaign's size.


_MOST = 60
_SIZES = 4
_ROOM = 2 * _MOST
_NODES = np.array([[-0.932, -0.576, 0.0, 0.576, 0.932], [-0.85, 0.0, 0.85, 0.0, 0.0]])
_COUNTS = (5, 3)


@inner_kernel
def _weights(place: FloatArray, shapes: int, out: FloatArray) -> int:
    """Fill the interpolation weights of the nodes at a place (s, shapes...); return their count."""
    s = place[0]
    size = np.empty(_SIZES)
    for j in range(_SIZES):
        at = 0.25 * (j + 1)
        value = s / at
        for k in range(_SIZES):
            if k != j:
                value *= (s - 0.25 * (k + 1)) / (0.25 * (j - k))
        size[j] = value
    if shapes == 0:
        for j in range(_SIZES):
            out[j] = size[j]
        return _SIZES
    parts = np.empty((2, 5))
    for d in range(shapes):
        count = _COUNTS[d]
        for j in range(count):
            value = 1.0
            for k in range(count):
                if k != j:
                    value *= (place[1 + d] - _NODES[d, k]) / (_NODES[d, j] - _NODES[d, k])
            parts[d, j] = value
    n = 0
    for j in range(_SIZES):
        for a in range(_COUNTS[0]):
            if shapes == 1:
                out[n] = size[j] * parts[0, a]
                n += 1
            else:
                for b in range(_COUNTS[1]):
                    out[n] = size[j] * parts[0, a] * parts[1, b]
                    n += 1
    return n


@inner_kernel
def _number(shapes: int) -> int:
    """Return the number of nodes of a form."""
    n = _SIZES
    for d in range(shapes):
        n *= _COUNTS[d]
    return n


@inner_kernel
def _gain(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, place: FloatArray,
    c: FloatArray, at: IntArray,
) -> float:  # fmt: skip
    """Return the log likelihood over that of no effect, at a place of one or two branches.

    Sums run along rows, side by side: each figure's own order is fixed, and processors add many
    at a time.
    """
    n = 0
    d = 0
    for i in range(len(firsts)):
        m = _weights(place[d:], shapes[i], c[n:])
        at[i] = n
        n += m
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
def best_single(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, lows: FloatArray,
    place: FloatArray, gain: FloatArray, evidence: FloatArray,
) -> None:  # fmt: skip
    """Fill the best place (branches, 3), gain and log evidence of every branch."""
    c = np.empty(3 * _MOST)
    at = np.empty(3, dtype=np.int64)
    first, shape = np.empty(1, dtype=np.int64), np.empty(1, dtype=np.int64)
    for k in range(len(firsts)):
        first[0], shape[0] = firsts[k], shapes[k]
        dims = 1 + shapes[k]
        low = np.full(dims, -1.0)
        low[0] = lows[k]
        trial, start = np.empty(dims), np.zeros(dims)
        best = -np.inf
        n1 = 5 if shapes[k] > 0 else 1
        n2 = 5 if shapes[k] > 1 else 1
        for i in range(14):
            trial[0] = lows[k] ** (1.0 - i / 13.0)
            for j in range(n1):
                if shapes[k] > 0:
                    trial[1] = -1.0 + 0.5 * j
                for m in range(n2):
                    if shapes[k] > 1:
                        trial[2] = -1.0 + 0.5 * m
                    value = _gain(b, g, first, shape, trial, c, at)
                    if value > best:
                        best = value
                        start[:] = trial
        best = _climb(b, g, first, shape, low, start, 0.2, c, at)
        gain[k] = best
        evidence[k] = _laplace(b, g, first, shape, low, start, best, c, at)
        for d in range(dims):
            place[k, d] = start[d]


@kernel
def weigh_single(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, lows: FloatArray,
    place: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Climb from a place of one or two branches, in it; return gain and log evidence."""
    c = np.empty(3 * _MOST)
    at = np.empty(3, dtype=np.int64)
    low = np.full(len(place), -1.0)
    d = 0
    for i in range(len(firsts)):
        low[d] = lows[i]
        d += 1 + shapes[i]
    best = _climb(b, g, firsts, shapes, low, place, 0.1, c, at)
    return best, _laplace(b, g, firsts, shapes, low, place, best, c, at)


@kernel
def scan_pairs(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, lows: FloatArray,
    place: FloatArray, effect: IntArray, gain: FloatArray, sizes: FloatArray,
) -> None:  # fmt: skip
    """Fill the best gain (branches, branches) of pairs, and their sizes (.., 2), shapes held."""
    n, count = len(firsts), 8
    c = np.empty((n, count, _MOST))
    own_b = np.empty((n, count))
    own_g = np.empty((n, count))
    s = np.empty((n, count))
    trial = np.empty(3)
    for k in range(n):
        m = 0
        for i in range(count):
            trial[:] = place[k]
            trial[0] = lows[k] ** (1.0 - i / (count - 1.0))
            s[k, i] = trial[0]
            m = _weights(trial, shapes[k], c[k, i])
            vb = 0.0
            vg = 0.0
            for p in range(m):
                vb += c[k, i, p] * b[firsts[k] + p]
                inner = 0.0
                for q in range(m):
                    inner += g[firsts[k] + p, firsts[k] + q] * c[k, i, q]
                vg += c[k, i, p] * inner
            own_b[k, i] = vb
            own_g[k, i] = vg
    half = np.empty((count, _MOST))
    for k in range(n):
        mk = _number(shapes[k])
        for other in range(k):
            gain[k, other] = -np.inf
            if effect[k] == effect[other]:
                continue
            mo = _number(shapes[other])
            for i in range(count):
                for q in range(mo):
                    inner = 0.0
                    for p in range(mk):
                        inner += c[k, i, p] * g[firsts[k] + p, firsts[other] + q]
                    half[i, q] = inner
            for i in range(count):
                for j in range(count):
                    cross = 0.0
                    for q in range(mo):
                        cross += half[i, q] * c[other, j, q]
                    value = own_b[k, i] + own_b[other, j] - cross
                    value -= 0.5 * (own_g[k, i] + own_g[other, j])
                    if value > gain[k, other]:
                        gain[k, other] = value
                        sizes[k, other, 0] = s[k, i]
                        sizes[k, other, 1] = s[other, j]


@kernel
def best_pair(
    b: FloatArray, g: FloatArray, firsts: IntArray, shapes: IntArray, lows: FloatArray,
    starts: FloatArray, gain: FloatArray, evidence: FloatArray,
) -> None:  # fmt: skip
    """Improve pairs (M, 2) from starts (M, 6), in them; fill gain and log evidence (M,)."""
    c = np.empty(3 * _MOST)
    at = np.empty(3, dtype=np.int64)
    for k in range(len(firsts)):
        da, db = 1 + shapes[k, 0], 1 + shapes[k, 1]
        low = np.full(da + db, -1.0)
        low[0], low[da] = lows[k, 0], lows[k, 1]
        place = np.empty(da + db)
        place[:da] = starts[k, :da]
        place[da:] = starts[k, 3 : 3 + db]
        best = _climb(b, g, firsts[k], shapes[k], low, place, 0.1, c, at)
        gain[k] = best
        evidence[k] = _laplace(b, g, firsts[k], shapes[k], low, place, best, c, at)
        starts[k, :da] = place[:da]
        starts[k, 3 : 3 + db] = place[da:]


# ------------------------------------------------------------------------------------------------
# The search for some specimens whose force is off by one factor.


_ROUNDS = 30
_SETTLED = 1e-4


@kernel
def _best_subset(
    b: FloatArray, h: FloatArray, gammas: FloatArray, shares: FloatArray,
    belief: FloatArray, best_belief: FloatArray, evidence: FloatArray,
) -> int:  # fmt: skip
    """Fill the log evidence of each logarithm of gain; return the best one, its beliefs filled.

    With members z, each of them one with probability `share`, the log likelihood over that of none
    is g z'b - g^2 z'Hz / 2. Its sum over all z is bounded from below by independent beliefs q in
    each specimen (mean field), improved one by one:

        sum q g b - g^2/2 (q'Hq + sum q (1 - q) H_ii) + entropy of q + q ln s + (1 - q) ln(1 - s)

    Parameters
    ----------
    b : (n,), h : (n, n)
        Inner products of the specimens' own gains with the residual and one another.
    shares : (m,)
        Shares of members, equally probable.
    belief, best_belief : (n,)
        Workspace, and the beliefs at the best gain.
    evidence : (gammas,)
    """
    n, m = len(b), len(shares)
    bounds = np.empty(m)
    best, best_value = 0, -np.inf
    pull = np.empty(n)
    for k in range(len(gammas)):
        gamma = gammas[k]
        square = gamma * gamma
        for s in range(m):
            odds = np.log(shares[s] / (1.0 - shares[s]))
            for i in range(n):
                belief[i] = 1.0 if gamma * b[i] > 0.5 * square * h[i, i] else 0.0
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += h[i, j] * belief[j]
                pull[i] = total
            for _ in range(_ROUNDS):
                moved = 0.0
                for i in range(n):
                    others = pull[i] - h[i, i] * belief[i]
                    logit = gamma * b[i] - square * (others + 0.5 * h[i, i]) + odds
                    new = 1.0 / (1.0 + np.exp(-min(max(logit, -700.0), 700.0)))
                    change = new - belief[i]
                    if change != 0.0:
                        belief[i] = new
                        for j in range(n):
                            pull[j] += change * h[i, j]
                        moved = max(moved, abs(change))
                if moved < _SETTLED:
                    break
            value = 0.0
            for i in range(n):
                q = belief[i]
                value += q * gamma * b[i]
                value -= 0.5 * square * (q * pull[i] + q * (1.0 - q) * h[i, i])
                if q > 0.0:
                    value += q * (np.log(shares[s]) - np.log(q))
                if q < 1.0:
                    value += (1.0 - q) * (np.log(1.0 - shares[s]) - np.log(1.0 - q))
            bounds[s] = value
            if value > best_value and np.sum(belief > 0.5) > 0:
                best, best_value = k, value
                best_belief[:] = belief
        most = np.max(bounds)
        evidence[k] = most + np.log(np.sum(np.exp(bounds - most)) / m)
    return best


# ------------------------------------------------------------------------------------------------
# The best parameters of every form and of the pairs that matter.


_PAIRS = 30
"""Pairs of effects that pass the scan."""

_FORMS = 3
"""Combinations of forms of such a pair that are weighed."""


@dataclass(frozen=True, slots=True, eq=False)
class Singles:
    """Of every branch: best place (B, 3), gain and log evidence (B,) over no effect."""

    place: FloatArray
    gain: FloatArray
    evidence: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Of M pairs of branches (M, 2): best places (M, 6), gain and log evidence (M,)."""

    branches: IntArray
    place: FloatArray
    gain: FloatArray
    evidence: FloatArray


_Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """The branches of a problem, ready to be searched on any inner products."""

    problem: Problem
    effect: IntArray
    firsts: IntArray
    shapes: IntArray
    lows: FloatArray

    @classmethod
    def of(cls, problem: Problem) -> "Search":
        """Give each of a problem's effects a number."""
        ids = {id: k for k, id in enumerate(dict.fromkeys(b.effect.id for b in problem.branches))}
        return cls(
            problem,
            np.array([ids[b.effect.id] for b in problem.branches], dtype=np.int64),
            np.array([b.first for b in problem.branches], dtype=np.int64),
            np.array([b.shapes for b in problem.branches], dtype=np.int64),
            np.array([b.least for b in problem.branches]),
        )

    def inner(self, elimination: Elimination) -> tuple[FloatArray, FloatArray]:
        """Return inner products of nodes with the residual and with one another."""
        a, nodes = elimination.products, self.problem.nodes
        return np.ascontiguousarray(a[0, nodes]), np.ascontiguousarray(a[nodes, nodes])

    def singles(self, elimination: Elimination) -> Singles:
        """Search every branch alone."""
        count = len(self.firsts)
        gain, evidence, place = np.empty(count), np.empty(count), np.zeros((count, 3))
        best_single(*self.inner(elimination), self.firsts, self.shapes, self.lows, place, gain,
                    evidence)  # fmt: skip
        return Singles(place, gain, evidence)

    def scan(self, elimination: Elimination, place: FloatArray) -> Pairs:
        """Return the pairs worth weighing, with sizes to start from; shapes are held at `place`."""
        count = len(self.firsts)
        gain = np.full((count, count), -np.inf)
        sizes = np.zeros((count, count, 2))
        scan_pairs(*self.inner(elimination), self.firsts, self.shapes, self.lows, place,
                   self.effect, gain, sizes)  # fmt: skip
        groups: dict[_Pair, list[tuple[float, int, int]]] = {}
        for k, other in np.argwhere(np.isfinite(gain)).tolist():
            low, high = sorted((int(self.effect[k]), int(self.effect[other])))
            groups.setdefault((low, high), []).append((float(gain[k, other]), k, other))
        ranked = sorted((sorted(group, reverse=True) for group in groups.values()), reverse=True)
        chosen = [(k, o) for group in ranked[:_PAIRS] for _, k, o in group[:_FORMS]]
        starts = np.zeros((len(chosen), 6))
        for row, (k, other) in enumerate(chosen):
            starts[row, :3], starts[row, 3:] = place[k], place[other]
            starts[row, [0, 3]] = sizes[k, other]
        none = np.full(len(chosen), -np.inf)
        return Pairs(np.array(chosen, dtype=np.int64).reshape(-1, 2), starts, none, none)

    def pairs(self, elimination: Elimination, start: Pairs) -> Pairs:
        """Search pairs from where they start."""
        count = len(start.branches)
        gain, evidence, place = np.empty(count), np.empty(count), start.place.copy()
        if count:
            best_pair(*self.inner(elimination), self.firsts[start.branches],
                      self.shapes[start.branches], self.lows[start.branches], place, gain,
                      evidence)  # fmt: skip
        return Pairs(start.branches, place, gain, evidence)

    def climb(
        self, inner: tuple[FloatArray, FloatArray], firsts: IntArray, candidate: Candidate
    ) -> tuple[float, float]:
        """Improve a candidate on inner products of its own nodes; return gain and log evidence."""
        numbers = [b.number for b in candidate.branches]
        gain, evidence = weigh_single(
            *inner, firsts, self.shapes[numbers], self.lows[numbers], candidate.flat
        )
        return float(gain), float(evidence)

    def candidate(
        self, numbers: Sequence[int], places: Sequence[FloatArray], gain: float, evidence: float
    ) -> Candidate:
        """Return the candidate of branches by number, effects sorted."""
        branches: list[SignedForm] = [self.problem.branches[k] for k in numbers]
        order = sorted(range(len(branches)), key=lambda i: branches[i].effect.id)
        cut = [tuple(p[: 1 + b.shapes].tolist()) for b, p in zip(branches, places, strict=True)]
        return Candidate(
            tuple(branches[i].effect.id for i in order),
            tuple(branches[i] for i in order),
            tuple(cut[i] for i in order),
            gain,
            evidence,
        )


# ------------------------------------------------------------------------------------------------
# Some specimens, but not the others, have their force off by one factor.


FORCE_UNITS = (
    QUANTITY_UNITS["force"]["lbf"],
    QUANTITY_UNITS["force"]["kgf"],
    QUANTITY_UNITS["length"]["in"],
)
"""Pounds and kilograms for newtons; inches, where somebody scaled the wrong column."""

_GAINS = np.geomspace(0.05, 0.6, 24)
_UNITS = np.log(FORCE_UNITS)

_DISTINCT = 2.5
"""Deviations of the specimens' scatter by which a gain must exceed it: smaller ones are scatter."""

SHARES: FloatArray = np.array([0.07, 0.15, 0.3, 0.5])
"""Of specimens that are members."""

_LEAST_MEMBERS = 2
"""One specimen alone is an outlier of the data, not an effect."""


def gains_of(scatter: Scatter) -> tuple[FloatArray, FloatArray]:
    """Return logarithms of the factor, and their log prior: half for any gain, half for units."""
    some = _GAINS[_DISTINCT * scatter.specimen <= _GAINS]
    gains = np.concatenate([some, -some, _UNITS, -_UNITS])
    of_units = np.arange(len(gains)) >= 2 * len(some)
    prior = np.where(of_units, 0.5 / of_units.sum(), 0.5 / max(int((~of_units).sum()), 1))
    return gains, np.log(prior)


def weigh_subset(problem: Problem, elimination: Elimination) -> Candidate:
    """Return the best subset, with the log evidence of there being one."""
    gains = problem.gains
    b = np.ascontiguousarray(elimination.products[gains, 0])
    h = np.ascontiguousarray(elimination.products[gains, gains])
    return _best(b, h, Candidate(()), problem.scatter)


def weigh_subset_beside(
    elimination: Elimination,
    gains: slice,
    candidate: Candidate,
    weights: FloatArray,
    scatter: Scatter,
) -> Candidate:
    """Return the best subset beside a candidate at its best place.

    Parameters
    ----------
    elimination
        Of the residual, the candidate's nodes and the gains, in that order.
    weights
        Of the nodes.
    """
    a = elimination.products
    b = a[gains, 0] - a[gains, 1 : 1 + len(weights)] @ weights
    inner = np.ascontiguousarray(a[gains, gains])
    return _best(np.ascontiguousarray(b), inner, candidate, scatter)


def _best(b: FloatArray, h: FloatArray, beside: Candidate, scatter: Scatter) -> Candidate:
    n = len(b)
    gammas, prior = gains_of(scatter)
    belief, best = np.zeros(n), np.zeros(n)
    evidence = np.empty(len(gammas))
    at = int(_best_subset(b, h, gammas, SHARES, belief, best, evidence))
    total = float(logsumexp(evidence + prior))
    gamma, members = float(gammas[at]), (best > 0.5).astype(np.float64)
    gain = float(gamma * members @ b - 0.5 * gamma**2 * members @ h @ members)
    if members.sum() < _LEAST_MEMBERS:
        total = -np.inf
    return replace(
        beside,
        effects=tuple(sorted({*beside.effects, "force-scale"})),
        gain=beside.gain + gain,
        log_evidence=beside.log_evidence + total,
        members=members,
        log_gain=gamma,
    )
