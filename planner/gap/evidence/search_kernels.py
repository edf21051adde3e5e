"""Loops of the search for the best parameters, on inner products alone.

All figures of a form are combinations of its nodes' figures, so that its likelihood needs their
inner products with the residual and with one another, and nothing of the campaign's size.
"""

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.geometry.kernel import inner_kernel, kernel

__all__ = ["best_pair", "best_single", "scan_pairs", "weigh_single"]

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
