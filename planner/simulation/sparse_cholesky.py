"""Factor finite-element matrices of 27-node cells: multifrontal Cholesky on nested dissection."""

from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from llvmlite import ir
from numba.core import cgutils, config, types
from numba.extending import get_cython_function_address, intrinsic
from numpy.typing import NDArray

from planner.numerics import FloatArray, IntArray, inner_kernel, kernel, one_blas_thread
from planner.simulation.element import SIX

__all__ = ["Analysis", "Factor", "NotPositiveDefinite", "analyse", "factor", "reused"]


# ------------------------------------------------------------------------------------------------
# How it works
#
# The cells are halved again and again. A node that cells of both halves touch belongs to that cut
# and is eliminated after all nodes inside either half (A. George, Nested dissection of a regular
# finite element mesh, SIAM J. Numer. Anal. 10, 1973, doi 10.1137/0710032). Every cut, and every
# last heap of cells, has a front: a dense matrix over its own nodes and the rest, nodes of earlier
# cuts that its cells touch. It is the sum of its cells' matrices and of the updates of its two
# halves; dense LAPACK eliminates its own nodes, and what then stands over the rest is its update
# (J. W. H. Liu, The multifrontal method for sparse matrix solution, SIAM Review 34, 1992, doi
# 10.1137/1034004).
#
# Fronts are numbered in postorder: halves before their cut, and the fronts within one cut without a
# gap. Rows and columns of a front go by the order of elimination, own nodes first, so that lower
# triangles go into lower triangles.


_CELLS_OF_A_LEAF = 4
"""So many cells are not halved further. Measured on a finger: 1 to 8 differ by less than a tenth,
with 16 factoring takes 1.4 times as long and a third more memory."""

_TASKS = 8
"""A subtree of at most this share of all work is one task; cuts above are tasks of their own.
Numerical: enough to keep two threads busy, few enough updates that wait at a time."""

_THREADS = min(2, config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
"""Chosen: the last cut's front is one thread's, and updates of more tasks wait in memory. On one
processor two take a twentieth longer than one: both want its cache."""

# ------------------------------------------------------------------------------------------------
# LAPACK and BLAS for compiled loops: factor, divide and multiply dense matrices in place.


# Addresses of scipy's functions are asked for at run time and given to kernels as numbers, so that
# kernels can be cached on disk. Calls are Fortran's: a letter says lower (L), left (L), right (R),
# transposed (T) or as it is (N); a matrix is an array that begins with it, its columns one after
# the other, and behind it stands its leading dimension.

_Int: TypeAlias = Any
"""In kernels, of any width."""

_L, _R, _T, _N = np.frombuffer(b"LRTN", dtype=np.uint8)


@cache
def _blas_addresses() -> tuple[int, ...]:
    """Return the addresses of dpotrf, dtrsm, dsyrk and dgemm."""
    names = ("lapack", "dpotrf"), ("blas", "dtrsm"), ("blas", "dsyrk"), ("blas", "dgemm")
    return tuple(
        get_cython_function_address(f"scipy.linalg.cython_{of}", name) for of, name in names
    )


def _calling(typing_context: Any, address: Any, given: Any) -> Any:
    """Call the function at an address: it is told where arrays begin, and where numbers stand.

    Whole numbers, but for letters, stand there in 32 bits.
    """
    tools: Any = cgutils

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointers = []
        for kind, value in zip(given, tools.unpack_tuple(builder, arguments[1]), strict=True):
            if isinstance(kind, types.Array):
                pointers.append(context.make_array(kind)(context, builder, value).data)
            else:
                if kind not in (types.float64, types.uint8):
                    value = builder.trunc(value, ir.IntType(32))
                pointers.append(tools.alloca_once_value(builder, value))
        function = ir.FunctionType(ir.VoidType(), [each.type for each in pointers]).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), pointers)
        return context.get_dummy_value()

    return types.void(address, given), code


_call: Any = intrinsic(_calling)


# ------------------------------------------------------------------------------------------------
# What a matrix is made of, and its factor.


_NO_LINKS, _NO_SPRINGS = np.empty((0, 2), np.int32), np.empty((0, 54, 54))


class NotPositiveDefinite(Exception):  # noqa: N818 - it is an answer, no error
    """A pivot was not above 0: the body is not held, or not stable.

    Attributes
    ----------
    node
        Where.
    """

    def __init__(self, node: int):
        super().__init__(f"the matrix is not positive definite: node {node}")
        self.node = node


class Analysis(NamedTuple):
    """In which order nodes are eliminated, and what that needs; no number of the matrix is known.

    Attributes
    ----------
    factor_bytes, work_bytes
        Of the factor, and of what is needed beside it until it is done, at most.
    order : (N,)
        The nodes as they are eliminated.
    first : (T + 1,)
        Where the own nodes of each front begin in the order.
    rest, above, rest_start
        Other nodes of front t, by their places in the order, at `rest_start[t]:rest_start[t + 1]`;
        and each one's place in the front above.
    below : (T, 2)
        Fronts of both halves, or -1.
    cells, cell_start
        Cells of front t, and links by numbers above theirs, at `cell_start[t]:cell_start[t + 1]`.
    place, begin
        Of each one's nodes in their front, at `begin[c]:begin[c + 1]`.
    panel : (T + 1,)
        Where the columns of each front begin in the factor.
    tasks : (k, 2)
        First front of each task and the one after its last, in postorder.
    """

    factor_bytes: int
    work_bytes: int
    order: IntArray
    first: IntArray
    rest: IntArray
    above: IntArray
    rest_start: IntArray
    below: IntArray
    cells: IntArray
    cell_start: IntArray
    begin: IntArray
    place: IntArray
    panel: IntArray
    tasks: IntArray


@dataclass(frozen=True, eq=False)
class Factor:
    """The factor of a matrix, which solves for any right-hand side."""

    analysis: Analysis
    columns: FloatArray

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return x where the matrix times x is `rhs`.

        Parameters
        ----------
        rhs : (3 N,) or (3 N, k)
        """
        a = self.analysis
        given = np.asarray(rhs, dtype=np.float64)
        columns = given.reshape(len(a.order), 3, -1)
        x = np.array(columns[a.order].reshape(3 * len(a.order), -1), order="F")
        most = 3 * int(np.diff(a.rest_start).max(initial=0))
        with one_blas_thread():
            _solve(
                _blas_addresses(), a, self.columns, x.ravel(order="K"),
                np.empty(max(most, 1) * x.shape[1]), x.shape[1],
            )  # fmt: skip
        solved = np.empty_like(columns)
        solved[a.order] = x.reshape(len(a.order), 3, -1)
        return solved.reshape(given.shape)


# ------------------------------------------------------------------------------------------------
# Analysis: halving, fronts and their sizes.


def analyse(nodes: IntArray, node_mm: FloatArray, links: IntArray = _NO_LINKS) -> Analysis:
    """Order the nodes of a mesh so that little fills in, and foretell what factoring needs.

    Parameters
    ----------
    nodes : (n, 27)
        Of each cell. Cells are coupled by the nodes they share, and by links.
    links : (m, 2)
        Pairs of cells whose nodes are coupled too.
    node_mm : (N, 3)
        Places, several nodes at one if need be; they only decide where to cut.
    """
    count = len(node_mm)
    middle = np.asarray(node_mm, dtype=np.float64)[nodes].mean(axis=1)
    middle = np.concatenate([middle, middle[links].mean(axis=1)])
    ranks = np.stack([_ranks(middle[:, axis]) for axis in range(3)]).astype(np.int32)
    begin = np.append(0, np.cumsum(np.repeat([27, 54], [len(nodes), len(links)])))
    each = np.concatenate([nodes.ravel(), nodes[links].ravel()]).astype(np.int32), begin
    layers = int(ranks.max(initial=0)) + 1
    cells, bounds, halves, owner = _halved(*each, ranks, count, layers, _CELLS_OF_A_LEAF)
    # The last front made comes first: halves before their cut.
    fronts = len(bounds)
    bounds = bounds[::-1]
    below = np.where(halves >= 0, fronts - 1 - halves, -1)[::-1].copy()
    # Nodes of no cell stay with the last front, where they fail as pivots.
    front_of = fronts - 1 - np.maximum(owner, 0)
    order = np.argsort(front_of, kind="stable").astype(np.int32)
    first = np.searchsorted(front_of[order], np.arange(fronts + 1)).astype(np.int32)
    number = np.argsort(order).astype(np.int32)
    leaf = below[:, 0] < 0
    cell_start = np.concatenate([[0], np.cumsum(np.where(leaf, bounds[:, 1] - bounds[:, 0], 0))])
    cells = np.concatenate([cells[a:b] for a, b in bounds[leaf]] or [cells])
    of_cell = np.repeat(np.arange(fronts), np.diff(cell_start))[np.argsort(cells)]
    front_above = np.full(fronts, -1)
    front_above[below[~leaf].ravel()] = np.repeat(np.flatnonzero(~leaf), 2)
    rest, above, rest_start, place = _structure(*each, number, first, front_above, of_cell)
    own = 3 * np.diff(first).astype(np.int64)
    update = (3 * np.diff(rest_start)) ** 2
    panel = np.concatenate([[0], np.cumsum(-(-own * (own + 3 * np.diff(rest_start)) // 8) * 8)])
    k, b = own.astype(np.float64), np.sqrt(update)
    flops = k**3 / 3.0 + k * k * b + k * b * b
    tasks, most = _tasks(below, front_above, update, flops)
    return Analysis(
        factor_bytes=8 * int(panel[-1]) + 64,
        work_bytes=8 * most,
        order=order, first=first, rest=rest, above=above, rest_start=rest_start, below=below,
        cells=cells, cell_start=cell_start, begin=begin, place=place, panel=panel, tasks=tasks,
    )  # fmt: skip


def _ranks(value: FloatArray) -> IntArray:
    """Return the ranks of values; what rounding alone tells apart has one."""
    by_value = np.argsort(value, kind="stable")
    rising = value[by_value]
    extent = float(np.ptp(rising)) if len(value) else 0.0
    ranks = np.empty(len(value), dtype=np.int64)
    # Cells are thousandths of the extent and more, roundings of means 1e-15 of the coordinates.
    ranks[by_value] = np.cumsum(np.diff(rising, prepend=rising[:1]) > 1e-6 * extent)
    return ranks


@kernel
def _halved(
    nodes: NDArray[np.int32], begin: IntArray, ranks: NDArray[np.int32], count: int, layers: int,
    most: int,
) -> tuple[IntArray, IntArray, IntArray, IntArray]:  # fmt: skip
    """Halve the cells until heaps of at most so many are left.

    The cut is the plane between layers of cells with the fewest nodes on it over the product of
    the cells on either side. Measured on boxes and fingers: other powers of either, or the least
    sum of both halves' and the cut's work, come to the same or up to a tenth more work.

    Returns
    -------
    cells : (n,)
        Their order.
    bounds : (T, 2)
        Of each front's cells, cuts before their halves.
    halves : (T, 2)
        -1 for heaps.
    owner : (N,)
        Front that each node is eliminated in.
    """
    n = len(begin) - 1
    cells = np.arange(n).astype(np.int32)
    bounds = np.zeros((2 * n + 1, 2), dtype=np.int64)
    halves = np.full((2 * n + 1, 2), -1, dtype=np.int64)
    owner = np.full(count, -1, dtype=np.int64)
    low, high = np.empty((3, count), dtype=np.int32), np.empty((3, count), dtype=np.int32)
    seen = np.full(count, -1, dtype=np.int64)
    touched = np.empty(count, dtype=np.int32)
    spare = np.empty(n, dtype=np.int32)
    in_layer, on_planes = np.empty(layers, np.int64), np.empty(layers, np.int64)
    # Waiting: bounds, and the half of which cut it is.
    waiting = [(0, n, -1, 0)]
    made = 0
    while len(waiting) > 0:
        start, end, cut, half = waiting.pop()
        t = made
        made += 1
        bounds[t, 0], bounds[t, 1] = start, end
        if cut >= 0:
            halves[cut, half] = t
        met = 0
        for place in range(start, end):
            c = cells[place]
            for node in nodes[begin[c] : begin[c + 1]]:
                if owner[node] >= 0:
                    continue
                if seen[node] != t:
                    seen[node] = t
                    touched[met] = node
                    met += 1
                    for axis in range(3):
                        low[axis, node] = high[axis, node] = ranks[axis, c]
                for axis in range(3):
                    low[axis, node] = min(low[axis, node], ranks[axis, c])
                    high[axis, node] = max(high[axis, node], ranks[axis, c])
        best, best_axis, best_rank = np.inf, -1, 0
        if end - start > most:
            for axis in range(3):
                in_layer[:], on_planes[:] = 0, 0
                for place in range(start, end):
                    in_layer[ranks[axis, cells[place]]] += 1
                for i in range(met):
                    on_planes[low[axis, touched[i]]] += 1
                    on_planes[high[axis, touched[i]]] -= 1
                before, cost = 0, 0
                for rank in range(1, layers):
                    before += in_layer[rank - 1]
                    cost += on_planes[rank - 1]
                    if before == 0 or before == end - start:
                        continue
                    score = cost / (np.float64(before) * np.float64(end - start - before))
                    if score < best:
                        best, best_axis, best_rank = score, axis, rank
        for i in range(met):
            node = touched[i]
            if best_axis < 0 or low[best_axis, node] < best_rank <= high[best_axis, node]:
                owner[node] = t
        if best_axis < 0:
            continue
        lower, upper = start, 0
        for place in range(start, end):
            c = cells[place]
            if ranks[best_axis, c] < best_rank:
                cells[lower] = c
                lower += 1
            else:
                spare[upper] = c
                upper += 1
        for i in range(upper):
            cells[lower + i] = spare[i]
        # The larger half is made last and so factored first, while no update waits.
        waiting.append((lower, end, t, 1))
        waiting.append((start, lower, t, 0))
        if lower - start > upper:
            waiting[-1], waiting[-2] = waiting[-2], waiting[-1]
    return cells, bounds[:made], halves[:made], owner


def _structure(
    members: IntArray, begin: IntArray, number: IntArray, first: IntArray, above: IntArray,
    leaf: IntArray,
) -> tuple[IntArray, IntArray, IntArray, IntArray]:  # fmt: skip
    """Return the rest of every front, places in the front above, and of cells' nodes in fronts.

    Parameters
    ----------
    number : (N,)
        Of each node in the order.
    above : (T,)
        The front above each.
    leaf : (n,)
        The front that each cell is in.
    """
    count = len(number)
    of, node = np.repeat(leaf, np.diff(begin)), number[members].astype(np.int64)
    found, key = [], np.unique(of * count + node)
    while len(key):  # what a front does not eliminate it hands on
        front, given = np.divmod(key, count)
        rest = given >= first[front + 1]
        found.append(key[rest])
        key = np.unique(above[front[rest]] * count + given[rest])
    keys = np.unique(np.concatenate(found))
    front, rest = np.divmod(keys, count)
    rest_start = np.searchsorted(front, np.arange(len(above) + 1))

    def place(front: IntArray, node: IntArray) -> NDArray[np.int32]:
        last = first[front + 1].astype(np.int64)
        in_rest = np.searchsorted(keys, front * count + node) - rest_start[front]
        return (np.where(node < last, node, last + in_rest) - first[front]).astype(np.int32)

    return rest.astype(np.int32), place(above[front], rest), rest_start, place(of, node)


def _tasks(
    below: IntArray, above: IntArray, update: IntArray, flops: FloatArray
) -> tuple[IntArray, int]:
    """Divide the fronts among tasks.

    Returns
    -------
    tasks : (k, 2)
    most
        Numbers that the updates of all tasks together may have in use at a time, whatever order
        they run in.
    """
    fronts = len(below)
    total, need, start = flops.copy(), update.copy(), np.arange(fronts)
    for t in range(fronts):
        a, b = sorted(below[t])
        if a >= 0:
            total[t] += total[a] + total[b]
            need[t] = max(need[a], update[a] + need[b], update[a] + update[b] + update[t])
            start[t] = start[a]
    small = total * _TASKS <= total[-1]
    if not small.any():
        small[:] = True  # one task has them all
    last = np.flatnonzero((above < 0) | ~small | ~small[above])  # of each task
    tasks = np.stack([np.where(small, start, np.arange(fronts))[last], last + 1], axis=1)
    all_at_once = need + update  # of fronts that are done memory is not all given back at once
    for t in np.flatnonzero(~small).tolist():
        halves = below[t][below[t] >= 0]
        waiting, busy = update[halves].sum(), all_at_once[halves].sum()
        all_at_once[t] = max(busy, update[t] + waiting)
    return tasks, int(all_at_once[-1])


# ------------------------------------------------------------------------------------------------
# Factoring


def factor(
    analysis: Analysis,
    element_matrices: FloatArray,
    springs: FloatArray = _NO_SPRINGS,
    *,
    into: Factor | None = None,
) -> Factor:
    """Sum the matrices of cells and factor the sum.

    The result is the same bytes on any number of threads.

    Parameters
    ----------
    element_matrices : (n, 27, 6, 27)
        Of each cell, symmetric: between local nodes a and b, at [a, k, b], for the pair k of axes
        11, 22, 33, 12, 23, 13, of which the first is that of a.
    springs : (m, 54, 54)
        Of each link, alike along each axis: between the nodes of its cells, one after the other.
    into
        A factor that is needed no more: its memory is taken, where it is enough.

    Raises
    ------
    NotPositiveDefinite
        A pivot failed, the first in the order of elimination.
    """
    a = analysis
    matrices = np.ascontiguousarray(element_matrices, dtype=np.float64)
    assert matrices.shape == (len(a.begin) - 1 - len(springs), 27, 6, 27)
    columns = reused(int(a.panel[-1]), None if into is None else into.columns)
    updates: dict[int, FloatArray] = {}  # of tasks' last fronts, until the front above has them
    none = np.empty(0)
    failed = len(a.order)

    def is_ready(task: int) -> bool:
        start, end = a.tasks[task]
        return end - start > 1 or all(t < 0 or t in updates for t in a.below[end - 1].tolist())

    def begin(task: int) -> Future[Any]:
        start, end = a.tasks[task]
        outside = tuple(updates.pop(half, none) for half in a.below[end - 1].tolist())
        given = (start, end, matrices, springs, columns, outside)
        return pool.submit(_factor_fronts, _blas_addresses(), a, *given)

    with one_blas_thread(), ThreadPoolExecutor(_THREADS) as pool:
        todo = list(range(len(a.tasks)))
        running: dict[Future[Any], int] = {}
        while todo or running:
            ready = [k for k in todo if is_ready(k)][: _THREADS - len(running)]
            todo = [k for k in todo if k not in ready]
            running |= {begin(task): task for task in ready}
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                task = running.pop(future)
                pivot, updates[int(a.tasks[task, 1]) - 1] = future.result()
                if pivot >= 0:
                    # Tasks before this one may fail at an earlier pivot; those after it cannot.
                    failed = min(failed, pivot)
                    todo = [k for k in todo if k < task]
    if failed < len(a.order):
        raise NotPositiveDefinite(int(a.order[failed]))
    return Factor(analysis, columns)


_ROOM = 1.25
"""Times the memory asked for where another factor's was too small: prints differ by a tenth."""


def reused(size: int, from_: FloatArray | None) -> FloatArray:
    """Return so many numbers in memory that begins where a vector register's line does.

    In that of an array that is needed no more and was returned by this function, if it is enough.
    """
    memory: FloatArray = np.empty(0) if from_ is None else np.asarray(from_.base)
    if len(memory) < size + 8:
        memory = np.empty((size if from_ is None else int(_ROOM * size)) + 8)
    skip = (-memory.ctypes.data // 8) % 8
    return memory[skip : skip + size]


@kernel
def _factor_fronts(
    blas: tuple[int, ...], analysis: Analysis, start: _Int, end: _Int, matrices: FloatArray,
    springs: FloatArray, columns: FloatArray, outside: Any,
) -> tuple[_Int, FloatArray]:  # fmt: skip
    """Factor fronts of one task, in order; `outside` are updates of halves that others have made.

    Returns
    -------
    pivot
        The one that failed, in the order of elimination, or -1.
    update
        Of the last front.
    """
    none = np.empty(0)
    updates = [none] * (end - start)
    potrf, trsm, syrk, _ = blas
    info = np.zeros(1, dtype=np.int32)
    for t in range(start, end):
        own = np.int64(3 * (analysis.first[t + 1] - analysis.first[t]))
        rest = 3 * (analysis.rest_start[t + 1] - analysis.rest_start[t])
        rows = own + rest
        panel = columns[analysis.panel[t] : analysis.panel[t] + rows * own]
        update = np.empty(rest * rest)
        panel[:] = 0.0
        for j in range(rest):
            update[j * rest + j - j % 3 : (j + 1) * rest] = 0.0
        for c in analysis.cells[analysis.cell_start[t] : analysis.cell_start[t + 1]]:
            nodes = analysis.place[analysis.begin[c] : analysis.begin[c + 1]]
            if c < len(matrices):
                _add_cell(matrices[c], nodes, panel, rows, update, own, rest)
            else:
                _add_springs(springs[c - len(matrices)], nodes, panel, rows, update, own, rest)
        for k in range(2):
            half = analysis.below[t, k]
            if half < 0:
                continue
            given = outside[k]
            if half >= start:
                given, updates[half - start] = updates[half - start], none
            to = analysis.above[analysis.rest_start[half] : analysis.rest_start[half + 1]]
            _add_update(given, to, panel, rows, update, own, rest)
        updates[t - start] = update
        if own == 0:
            continue
        _call(potrf, (_L, own, panel, rows, info))
        failed = info[0]  # a pivot, from 1
        for j in range(own):  # LAPACK lets what is not a number pass
            if failed == 0 and not panel[j * rows + j] > 0.0:
                failed = j + 1
        if failed > 0:
            return np.int64(analysis.first[t]) + (failed - 1) // 3, none
        if rest > 0:
            under = panel[own:]
            _call(trsm, (_R, _L, _T, _N, rest, own, 1.0, panel, rows, under, rows))
            _call(syrk, (_L, _N, rest, own, -1.0, under, rows, 1.0, update, rest))
    return np.int64(-1), update


@inner_kernel
def _column(
    column: _Int, panel: FloatArray, rows: _Int, update: FloatArray, own: _Int, rest: _Int
) -> Any:
    """Return where a column of a front stands: in its own columns or the update, from which on."""
    return (panel, column * rows) if column < own else (update, (column - own) * rest - own)


@inner_kernel
def _add_cell(
    matrix: FloatArray, place: IntArray, panel: FloatArray, rows: _Int, update:
    FloatArray, own: _Int, rest: _Int,
) -> None:  # fmt: skip
    """Add a cell's matrix to the lower triangle of its front."""
    for b in range(27):
        for axis in range(3):
            into, offset = _column(np.int64(3 * place[b] + axis), panel, rows, update, own, rest)
            for a in range(27):
                if place[a] >= place[b]:
                    to = offset + 3 * place[a]
                    for i in range(3):
                        k = SIX[i, axis]
                        into[to + i] += matrix[a, k, b] if i <= axis else matrix[b, k, a]


@inner_kernel
def _add_springs(
    matrix: FloatArray, place: IntArray, panel: FloatArray, rows: _Int, update: FloatArray,
    own: _Int, rest: _Int,
) -> None:  # fmt: skip
    """Add a link's matrix, along each axis, to the lower triangle of its front."""
    for b in range(54):
        for axis in range(3):
            into, offset = _column(np.int64(3 * place[b] + axis), panel, rows, update, own, rest)
            for a in range(54):
                if place[a] >= place[b]:
                    into[offset + 3 * place[a] + axis] += matrix[a, b]


@inner_kernel
def _add_update(
    given: FloatArray, to: IntArray, panel: FloatArray, rows: _Int, update: FloatArray,
    own: _Int, rest: _Int,
) -> None:  # fmt: skip
    """Add the lower triangle of a half's update to its front."""
    n = len(to)
    for b in range(n):
        for axis in range(3):
            into, offset = _column(np.int64(3 * to[b] + axis), panel, rows, update, own, rest)
            source = (3 * b + axis) * 3 * n
            for a in range(b, n):
                at = offset + 3 * to[a]
                of = source + 3 * a
                into[at] += given[of]
                into[at + 1] += given[of + 1]
                into[at + 2] += given[of + 2]


# ------------------------------------------------------------------------------------------------
# Solving


@kernel
def _solve(
    blas: tuple[int, ...], analysis: Analysis, columns: FloatArray, x: FloatArray,
    spare: FloatArray, many: _Int,
) -> None:  # fmt: skip
    """Solve in place for `many` right-hand sides, one after the other in x, by the order."""
    first, rest, rest_start = analysis.first, analysis.rest, analysis.rest_start
    length = 3 * np.int64(first[-1])
    _, trsm, _, gemm = blas
    fronts = len(first) - 1
    for turn in range(2 * fronts):
        back = turn >= fronts
        t = 2 * fronts - 1 - turn if back else turn
        own = np.int64(3 * (first[t + 1] - first[t]))
        others = rest[rest_start[t] : rest_start[t + 1]]
        n = 3 * len(others)
        rows = own + n
        if own == 0:
            continue
        l11, x1 = columns[analysis.panel[t] :], x[3 * first[t] :]
        l21 = l11[own:]
        if not back:
            _call(trsm, (_L, _L, _N, _N, own, many, 1.0, l11, rows, x1, length))
            if n > 0:
                _call(gemm, (_N, _N, n, many, own, 1.0, l21, rows, x1, length, 0.0, spare, n))
                for k in range(many):
                    for i in range(len(others)):
                        for axis in range(3):
                            x[k * length + 3 * others[i] + axis] -= spare[k * n + 3 * i + axis]
        else:
            if n > 0:
                for k in range(many):
                    for i in range(len(others)):
                        for axis in range(3):
                            spare[k * n + 3 * i + axis] = x[k * length + 3 * others[i] + axis]
                _call(gemm, (_T, _N, own, many, n, -1.0, l21, rows, spare, n, 1.0, x1, length))
            _call(trsm, (_L, _L, _T, _N, own, many, 1.0, l11, rows, x1, length))
