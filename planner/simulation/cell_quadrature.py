"""Positive quadrature over the material in each cell: 27 points that have its moments."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from hashlib import blake2b
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from planner.numerics import BoolArray, FloatArray, IntArray, inner_kernel, kernel, one_blas_thread
from planner.simulation.element import LOCAL
from planner.simulation.material_columns import SampledMaterial, column_xy

if TYPE_CHECKING:
    from planner.simulation.cut_cells import CutCells

__all__ = ["quadrature"]


# The material of a cut piece is a discrete measure: 4 Gauss points along each segment. Its moments
# up to degree 6 are met by 27 points, as many as a full cell has: 108 numbers for 84 equations.
# Newton's method finds them (the step of least length, no weight below zero and no point out of
# the piece's box), from the Gauss points of a box stretched to where the material is. Where that
# does not end, as for some flat pieces, it is tried with twice as many points, and where that does
# not either, the piece keeps all points of the measure: no material is lost.


_DEGREE = 6
_MOMENTS = (_DEGREE + 1) * (_DEGREE + 2) * (_DEGREE + 3) // 6

_POINTS = 27
"""Of a full cell, and of a cut piece unless they cannot be found."""

_THREADS = 2
_CHUNK = 32  # pieces that a thread takes at once

_OUTERMOST = 0.8611363115940526
# of the four Gauss points between -1 and 1.

_MUCH_SMALLER = 0.7
# A box along a piece's axes is taken up to this share of the cell-aligned box: of a wall aslant it
# is a small part, and of a nearly full cell it would stick out.

_STRAY = 0.05
# How far points are moved off the places of Gauss's, of the box's half edge. On these Newton's
# method cannot begin: the square of Legendre's third polynomial is zero there, and so is its
# slope. Any stray from 0.02 to 0.2 does.

_STEPS = 40
# Newton steps before it is given up: 10 are usual.

_MET = 1e-12
# Largest error of a moment, of the mass; Newton's last step usually ends near 1e-15.


def quadrature(
    material: SampledMaterial,
    index: NDArray[np.int32],
    full: BoolArray,
    like: "CutCells | None" = None,
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return the quadrature of all cells.

    Parameters
    ----------
    material
        Its segments told to cells.
    index : (n, 3)
        Place of each cell in the lattice.
    full : (n,)
        Whether its material is all of that place.
    like
        Of nearly the same part: pieces that are the same there have their points from there.

    Returns
    -------
    offsets, points, weights
        As in `CutCells`; weights in cells.
    """
    cut = np.where(full, -1, np.cumsum(~full) - 1).astype(np.int32)
    index = index[~full]
    begin, segments = material.segments_of(cut, index[:, 2])
    share = 1.0 / np.maximum(material.per_foot[material.foot], 1)
    rule = np.stack(np.polynomial.legendre.leggauss(4))
    pieces = (segments, begin, material.frame, material.across, material.voxels, share, index, rule)
    found: list[Any] = [None] * len(index)  # points of each piece
    if like is not None and _same_columns(material, like.material):
        rows = np.column_stack([like.points, like.weights_mm3 / np.prod(like.cell_mm)])
        every = np.arange(len(like.index), dtype=np.int32)
        names = _names(like.index, *like.material.segments_of(every, like.index[:, 2]))
        known = dict(zip(names, np.split(rows, like.offsets[1:-1]), strict=True))
        found = [known.get(name) for name in _names(index, begin, segments)]

    def find(first: int) -> None:
        for p in range(first, min(first + _CHUNK, len(found))):
            if found[p] is None:
                found[p] = _points(pieces, p)

    with one_blas_thread(), ThreadPoolExecutor(_THREADS) as pool:
        list(pool.map(find, range(0, len(found), _CHUNK)))
    gauss, weight = np.polynomial.legendre.leggauss(3)
    whole = np.column_stack([gauss[LOCAL], weight[LOCAL].prod(axis=1) / 8])
    cut_ones = iter(found)
    each = [whole if is_full else next(cut_ones) for is_full in full.tolist()]
    offsets, rows = np.append(0, np.cumsum([len(own) for own in each])), np.concatenate(each)
    return offsets, rows[:, :3].copy(), rows[:, 3].copy()


def _same_columns(one: SampledMaterial, other: SampledMaterial) -> bool:
    """Tell whether columns stand in the same places, save for what surfaces were rounded by."""
    return np.array_equal(one.foot, other.foot) and np.allclose(one.frame, other.frame)


def _names(
    index: NDArray[np.int32], begin: IntArray, segments: NDArray[np.int32]
) -> Iterator[bytes]:
    """Yield what tells pieces apart: their place in the lattice, and their segments."""
    for place, (a, b) in zip(index, pairwise(begin.tolist()), strict=True):
        yield blake2b(place.tobytes() + segments[a:b].tobytes(), digest_size=16).digest()


@inner_kernel
def _measure(pieces: Any, p: Any, measure: Any) -> Any:
    # The discrete measure of a piece: x, y, z in its cell and weight.
    segments, begin, frame, across, voxels, share, index, rule = pieces
    n = 0
    for s in range(begin[p], begin[p + 1]):
        x, y = column_xy(frame, across, segments[s, 0])
        bottom = 2.0 * segments[s, 1] / voxels - 1.0
        top = 2.0 * segments[s, 2] / voxels - 1.0
        for g in range(rule.shape[1]):
            measure[n, 0] = 2.0 * (x - index[p, 0]) - 1.0
            measure[n, 1] = 2.0 * (y - index[p, 1]) - 1.0
            measure[n, 2] = (top + bottom + (top - bottom) * rule[0, g]) / 2.0
            measure[n, 3] = (top - bottom) * rule[1, g] / 4.0 * share[segments[s, 0]]
            n += 1


@kernel
def _points(pieces: Any, p: Any) -> Any:
    # The points of a piece and their weights: few that have its moments, or all of its measure.
    begin, frame = pieces[1], pieces[2]
    measure = np.empty((4 * (begin[p + 1] - begin[p]), 4))
    _measure(pieces, p, measure)
    if measure.shape[0] <= _POINTS:
        return measure
    mass = measure[:, 3].sum()
    wide = frame[2] * min(frame[5], frame[6])  # half a column's width, of the local -1..1
    middle, half = np.empty(3), np.empty(3)
    line, moment = np.empty((7, 7)), np.zeros(_MOMENTS)
    turn = _find_box(measure, mass, wide, middle, half)
    _into_box(measure, middle, half, turn, False)
    for q in range(measure.shape[0]):
        for axis in range(3):
            _legendre(measure[q, axis], line[axis], line[3])
        _add_products(moment, measure[q, 3] / mass, line[0], line[1], line[2])
    for many in range(_POINTS, min(2 * _POINTS, measure.shape[0]) + 1, _POINTS):
        place = np.empty((many, 4))
        _guess(measure, place)
        met, place = _adjust(moment, place, line)
        if met:
            for q in range(many):
                place[q, 3] *= mass
            _into_box(place, middle, half, turn, True)
            return place
    _measure(pieces, p, measure)
    return measure


@inner_kernel
def _find_box(measure: Any, mass: Any, wide: Any, middle: Any, half: Any) -> Any:
    # The box that holds a piece, and its axes, a row each: along the piece's principal axes, or
    # along the cell's where that is not much smaller.
    aligned, turn, mean, spread = np.eye(3), np.eye(3), np.zeros(3), np.zeros((3, 3))
    for q in range(measure.shape[0]):
        for a in range(3):
            mean[a] += measure[q, 3] * measure[q, a]
            for b in range(3):
                spread[a, b] += measure[q, 3] * measure[q, a] * measure[q, b]
    for a in range(3):
        for b in range(3):
            spread[a, b] = spread[a, b] / mass - mean[a] * mean[b] / mass**2
    for sweep in range(18):  # Jacobi's rotations, six times about each axis
        a, b = sweep % 3, (sweep + 1) % 3
        if abs(spread[a, b]) < 1e-14:
            continue
        lean = (spread[b, b] - spread[a, a]) / (2.0 * spread[a, b])
        tan = (1.0 if lean >= 0.0 else -1.0) / (abs(lean) + np.sqrt(lean * lean + 1.0))
        cos = 1.0 / np.sqrt(tan * tan + 1.0)
        sin = tan * cos
        _rotate(spread.T, a, b, cos, sin)
        _rotate(spread, a, b, cos, sin)
        _rotate(turn, a, b, cos, sin)
    whole = _bounds(measure, wide, aligned, middle, half)
    if _bounds(measure, wide, turn, middle, half) > _MUCH_SMALLER * whole:
        _bounds(measure, wide, aligned, middle, half)
        return aligned
    return turn


@inner_kernel
def _rotate(rows: Any, a: Any, b: Any, cos: Any, sin: Any) -> Any:
    for k in range(3):
        one, other = rows[a, k], rows[b, k]
        rows[a, k], rows[b, k] = cos * one - sin * other, sin * one + cos * other


@inner_kernel
def _bounds(measure: Any, wide: Any, turn: Any, middle: Any, half: Any) -> Any:
    # The box along the rows of `turn` about all segments, each a pillar as `wide` as its column.
    volume = 1.0
    for a in range(3):
        low, high = np.inf, -np.inf
        for q in range(0, measure.shape[0], 4):
            across = turn[a, 0] * measure[q, 0] + turn[a, 1] * measure[q, 1]
            rise = (measure[q + 3, 2] - measure[q, 2]) / (2.0 * _OUTERMOST)
            for z in (-rise, rise):
                at = across + turn[a, 2] * ((measure[q + 3, 2] + measure[q, 2]) / 2.0 + z)
                low, high = min(low, at), max(high, at)
        middle[a] = (high + low) / 2.0
        half[a] = (high - low) / 2.0 + wide * np.sqrt(turn[a, 0] ** 2 + turn[a, 1] ** 2)
        volume *= half[a]
    return volume


@inner_kernel
def _into_box(measure: Any, middle: Any, half: Any, turn: Any, back: Any) -> Any:
    # From the cell's coordinates to those of the box, -1..1, or back.
    at = np.empty(3)
    for q in range(measure.shape[0]):
        for a in range(3):
            at[a] = middle[a] + half[a] * measure[q, a] if back else measure[q, a]
        for a in range(3):
            if back:
                measure[q, a] = turn[0, a] * at[0] + turn[1, a] * at[1] + turn[2, a] * at[2]
            else:
                x = turn[a, 0] * at[0] + turn[a, 1] * at[1] + turn[a, 2] * at[2]
                measure[q, a] = (x - middle[a]) / half[a]


_SIZE = np.sqrt(2.0 * np.arange(8) + 1.0)
_RISE = _SIZE[1:] * _SIZE[:-1] / np.arange(1, 8)
_FALL = np.append(0.0, _RISE[1:] / _RISE[:-1])
# Legendre polynomials of mean square 1 over -1..1: next = rise x this - fall previous.


@inner_kernel
def _legendre(x: Any, value: Any, slope: Any) -> Any:
    value[0], slope[0] = 1.0, 0.0
    value[1], slope[1] = _RISE[0] * x, _RISE[0]
    for d in range(1, 6):
        value[d + 1] = _RISE[d] * x * value[d] - _FALL[d] * value[d - 1]
        slope[d + 1] = _RISE[d] * (value[d] + x * slope[d]) - _FALL[d] * slope[d - 1]


@inner_kernel
def _add_products(row: Any, factor: Any, x: Any, y: Any, z: Any) -> Any:
    # Add factor x[a] y[b] z[c] to all moments, those of a + b + c up to 6.
    t = 0
    for a in range(7):
        for b in range(7 - a):
            f = factor * x[a] * y[b]
            for c in range(7 - a - b):
                row[t + c] += f * z[c]
            t += 7 - a - b


@inner_kernel
def _guess(measure: Any, place: Any) -> Any:
    # 27 points like the material: along x three places as Gauss's are to mean and spread; the
    # material divided between them, the same along y for each share, and along z for theirs. Then
    # each a little aside, evenly to all sides (multiples of powers of an irrational number).
    group, many = np.zeros(measure.shape[0], np.int64), place.shape[0]
    place[:, 3] = 1.0
    for axis in range(3):
        total, mean, spread = np.zeros(28), np.zeros(28), np.zeros(28)
        for q in range(measure.shape[0]):
            x, w = measure[q, axis], measure[q, 3]
            for g in (group[q], 27):  # 27: all of the material, for shares that have none
                total[g] += w
                mean[g] += w * x
                spread[g] += w * x * x
        for g in range(28):
            if total[g] > 0.0:
                mean[g] /= total[g]
                spread[g] = np.sqrt(max(spread[g] / total[g] - mean[g] ** 2, 0.0025))
        for q in range(measure.shape[0]):
            g = group[q]
            away = (measure[q, axis] - mean[g]) / spread[g]
            # shares of 5, 8 and 5 of 18 where it is even
            group[q] = 3 * g + (0 if away < -0.7698 else 1 if away < 0.7698 else 2)
        for q in range(many):
            # share, and third of it
            g, k = q % 27 // 3 ** (3 - axis), q % 27 // 3 ** (2 - axis) % 3
            of = g if total[g] > 0.0 else 27
            aside = 2.0 * ((q + 1) * 0.8191725134 ** (axis + 1) % 1.0) - 1.0
            at = mean[of] + (k - 1) * np.sqrt(1.8) * spread[of] + _STRAY * aside
            place[q, axis] = min(max(at, -0.97), 0.97)
            place[q, 3] = place[q, 3] * (8.0 if k == 1 else 5.0) / 18.0
    for q in range(many):
        place[q, 3] = place[q, 3] * 27 / many


@inner_kernel
def _adjust(moment: Any, place: Any, line: Any) -> Any:
    """Move points in the box -1..1, and change their weights, until they have the moments.

    Return whether they do, and the points.
    """
    many, moments = place.shape[0], moment.size
    miss, trial_miss, answer = np.empty(moments), np.empty(moments), np.empty(moments)
    trial, step = np.empty((many, 4)), np.empty((many, 4))
    normal, slopes = np.empty((moments, moments)), np.empty((4 * many, moments))
    error, worst = _miss(moment, place, line, miss)
    for _ in range(_STEPS):
        if worst < _MET:
            return True, place
        # slopes of the moments by each place and each weight, in units of the room to the box's
        # sides and of the weight
        for q in range(many):
            for axis in range(3):
                _legendre(place[q, axis], line[axis], line[3 + axis])
            x, y, z, w = line[0], line[1], line[2], place[q, 3]
            slopes[4 * q : 4 * q + 4] = 0.0
            _add_products(slopes[4 * q], w * _room(place[q, 0]), line[3], y, z)
            _add_products(slopes[4 * q + 1], w * _room(place[q, 1]), x, line[4], z)
            _add_products(slopes[4 * q + 2], w * _room(place[q, 2]), x, y, line[5])
            _add_products(slopes[4 * q + 3], w, x, y, z)
        _solve_normal(slopes, miss, normal, answer)
        moves = np.dot(slopes, answer)
        most = 1.0
        for q in range(many):
            for k in range(4):
                at = place[q, k]
                move = moves[4 * q + k] * (at if k == 3 else _room(at))
                step[q, k] = move
                room = at if move < 0.0 else np.inf
                if k < 3:
                    room = 1.0 + at if move < 0.0 else 1.0 - at
                if 0.9 * room < most * abs(move):
                    most = 0.9 * room / abs(move)
        trial_error = np.inf
        for _ in range(6):
            for q in range(many):
                for k in range(4):
                    trial[q, k] = place[q, k] + most * step[q, k]
            trial_error, worst = _miss(moment, trial, line, trial_miss)
            if trial_error < error * (1.0 - 1e-3 * most):
                break
            most /= 2.0
        if not trial_error < error:
            break
        error = trial_error
        miss, trial_miss = trial_miss, miss
        place, trial = trial, place
    return False, place


@inner_kernel
def _room(x: Any) -> Any:
    return np.sqrt((1.0 - x) * (1.0 + x))


@inner_kernel
def _miss(moment: Any, place: Any, line: Any, miss: Any) -> Any:
    # What the moments lack; the length of that, and its largest.
    for t in range(moment.size):
        miss[t] = moment[t]
    for q in range(place.shape[0]):
        for axis in range(3):
            _legendre(place[q, axis], line[axis], line[3])
        _add_products(miss, -place[q, 3], line[0], line[1], line[2])
    square = worst = 0.0
    for t in range(moment.size):
        square += miss[t] * miss[t]
        worst = max(worst, abs(miss[t]))
    return np.sqrt(square), worst


@inner_kernel
def _solve_normal(slopes: Any, miss: Any, normal: Any, answer: Any) -> Any:
    # slopes' slopes answer = miss
    np.dot(slopes.T, slopes, normal)
    n, trace = miss.size, np.trace(normal)
    for i in range(n):
        normal[i, i] += 1e-12 * trace  # points that fall together leave it singular
    lower = np.linalg.cholesky(normal)
    for i in range(n):
        answer[i] = miss[i]
        for j in range(i):
            answer[i] -= lower[i, j] * answer[j]
        answer[i] /= lower[i, i]
    for i in range(n - 1, -1, -1):
        answer[i] /= lower[i, i]
        for j in range(i):
            answer[j] -= lower[i, j] * answer[i]
