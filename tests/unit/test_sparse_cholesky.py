"""The sparse Cholesky factor against scipy's: boxes, thin walls, bodies apart, phantom cells."""

import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from planner.numerics import BoolArray, FloatArray
from planner.simulation import sparse_cholesky
from planner.simulation.sparse_cholesky import NotPositiveDefinite, analyse, factor


def lattice(
    shape: tuple[int, int, int], kept: BoolArray | None = None
) -> tuple[NDArray[np.int32], FloatArray]:
    """Return nodes of cells on a lattice, and places; `kept` tells which cells there are."""
    cells = np.argwhere(np.ones(shape, dtype=bool) if kept is None else kept)
    local = np.array([(i, j, k) for k in range(3) for j in range(3) for i in range(3)])
    place = 2 * cells[:, None] + local
    _, nodes = np.unique(place.reshape(-1, 3), axis=0, return_inverse=True)
    nodes = nodes.reshape(-1, 27).astype(np.int32)
    node_mm = np.empty((nodes.max() + 1, 3))
    node_mm[nodes] = 0.7 * place - 3.3
    return nodes, node_mm


def walls(shape: tuple[int, int, int]) -> BoolArray:
    """Keep the cells of a box's walls."""
    kept = np.ones(shape, dtype=bool)
    kept[1:-1, 1:-1, 1:-1] = False
    return kept


def element_matrices(n: int, seed: int = 5) -> FloatArray:
    b = np.random.default_rng(seed).normal(size=(n, 30, 81))
    whole = (np.einsum("nij,nik->njk", b, b) + 0.5 * np.eye(81)).reshape(n, 27, 3, 27, 3)
    return np.stack([whole[:, :, i, :, j] for i, j in PAIRS], axis=2)


PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]


def summed(nodes, packed, count: int):
    matrices = np.empty((len(packed), 27, 3, 27, 3))
    for k, (i, j) in enumerate(PAIRS):
        matrices[:, :, i, :, j] = packed[:, :, k]
        matrices[:, :, j, :, i] = packed[:, :, k].transpose(0, 2, 1)
    dof = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 81)
    row, column = np.repeat(dof, 81, axis=1).ravel(), np.tile(dof, 81).ravel()
    return sparse.csc_array((matrices.ravel(), (row, column)), shape=(3 * count, 3 * count))


def phantoms():
    """Two layers of cells at one place, joined at one end only."""
    nodes, node_mm = lattice((5, 2, 2))
    twin = nodes + len(node_mm)
    joined = node_mm[:, 0] < node_mm[:, 0].min() + 1.0
    twin[joined[nodes]] = nodes[joined[nodes]]
    used, both = np.unique(np.concatenate([nodes, twin]), return_inverse=True)
    return both.reshape(-1, 27).astype(np.int32), np.concatenate([node_mm, node_mm])[used]


def apart():
    """Three bodies: two at one place, one beyond."""
    nodes, node_mm = lattice((3, 3, 2))
    count = len(node_mm)
    return (
        np.concatenate([nodes, nodes + count, nodes + 2 * count]),
        np.concatenate([node_mm, node_mm, node_mm + np.array([20.0, 3.0, 0.0])]),
    )


MESHES = {
    "one cell": lambda: lattice((1, 1, 1)),
    "box": lambda: lattice((5, 4, 3)),
    "thin walls": lambda: lattice((7, 4, 5), walls((7, 4, 5))),
    "phantom cells": phantoms,
    "bodies apart": apart,
    "many at one place": lambda: (
        np.arange(27 * 9, dtype=np.int32).reshape(9, 27),
        np.zeros((243, 3)),
    ),
}


@pytest.mark.parametrize("mesh", MESHES)
def test_solves_as_scipy_does(mesh):
    nodes, node_mm = MESHES[mesh]()
    turned = np.random.default_rng(2).permutation(len(node_mm)).astype(np.int32)
    nodes, node_mm = turned[nodes], node_mm[np.argsort(turned)]
    matrices = element_matrices(len(nodes))
    rhs = np.random.default_rng(3).normal(size=(3 * len(node_mm), 3))
    found = factor(analyse(nodes, node_mm), matrices)
    expected = splu(summed(nodes, matrices, len(node_mm))).solve(rhs)
    # Both are backward stable; condition numbers here are below 1e4.
    np.testing.assert_allclose(found.solve(rhs), expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.solve(rhs[:, 1]), expected[:, 1], rtol=1e-10, atol=1e-12)


def test_a_box_fills_in_as_nested_dissection_does():
    # By degrees of freedom: the last cut of an 8 x 8 x 8 box is a plane of 17 x 17 nodes.
    nodes, node_mm = lattice((8, 8, 8))
    analysis = analyse(nodes, node_mm)
    assert np.diff(analysis.first)[-1] == 17 * 17
    assert sorted(analysis.order) == list(range(len(node_mm)))
    assert analysis.order[-1] in np.flatnonzero(
        np.isclose(node_mm, np.median(node_mm, axis=0)).any(axis=1)
    )


def test_one_thread_and_two_write_the_same_bytes(monkeypatch):
    nodes, node_mm = lattice((12, 5, 4))
    analysis, matrices = analyse(nodes, node_mm), element_matrices(240)
    assert len(analysis.tasks) > 3
    monkeypatch.setattr(sparse_cholesky, "_THREADS", 1)
    one = factor(analysis, matrices)
    monkeypatch.undo()
    rhs = np.random.default_rng(3).normal(size=3 * len(node_mm))
    two = factor(analysis, matrices)
    rows = 3 * (np.diff(analysis.first) + np.diff(analysis.rest_start))
    sizes = 3 * np.diff(analysis.first) * rows  # between fronts is up to a line of nothing
    for start, size in zip(analysis.panel, sizes, strict=False):
        assert (
            one.columns[start : start + size].tobytes()
            == two.columns[start : start + size].tobytes()
        )
    assert one.solve(rhs).tobytes() == two.solve(rhs).tobytes()


@pytest.mark.parametrize(
    "shape", [(1, 1, 1), (2, 1, 1), (8, 1, 2), (5, 5, 1), (6, 5, 4), (9, 9, 9)]
)
def test_each_front_is_of_one_task(shape):
    """Of small bodies, whose work no halving divides evenly, too: two tasks would race."""
    analysis = analyse(*lattice(shape))
    fronts = np.concatenate([np.arange(*task) for task in analysis.tasks])
    assert np.sort(fronts).tolist() == list(range(len(analysis.below)))


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("value", [-1e3, np.nan])
def test_a_failing_pivot_is_named(value, threads, monkeypatch):
    monkeypatch.setattr(sparse_cholesky, "_THREADS", threads)
    nodes, node_mm = lattice((8, 4, 4))
    matrices = element_matrices(len(nodes))
    analysis = analyse(nodes, node_mm)
    cell, local = 37, 13
    matrices[cell, local, 1, local] = value
    with pytest.raises(NotPositiveDefinite, match=str(nodes[cell, local])) as told:
        factor(analysis, matrices)
    assert told.value.node == nodes[cell, local]


def test_of_two_failing_pivots_the_first_eliminated_is_named(monkeypatch):
    nodes, node_mm = lattice((16, 4, 4))
    analysis, matrices = analyse(nodes, node_mm), element_matrices(len(nodes))
    failing = [3, 120, 200, 250]
    matrices[failing, 13, 0, 13] = -1e3  # the node in the middle of a cell
    place = np.argsort(analysis.order)
    expected = min(nodes[failing, 13], key=lambda node: place[node])
    for threads in (1, 2, 2, 2):
        monkeypatch.setattr(sparse_cholesky, "_THREADS", threads)
        with pytest.raises(NotPositiveDefinite) as told:
            factor(analysis, matrices)
        assert told.value.node == expected


def test_a_node_of_no_cell_fails():
    nodes, node_mm = lattice((2, 1, 1))
    with pytest.raises(NotPositiveDefinite) as told:
        factor(analyse(nodes, np.concatenate([node_mm, [[0.0, 0.0, 0.0]]])), element_matrices(2))
    assert told.value.node == len(node_mm)


def test_memory_is_foretold_and_taken_again():
    nodes, node_mm = lattice((14, 5, 5))
    analysis, matrices = analyse(nodes, node_mm), element_matrices(len(nodes))
    first = factor(analysis, matrices)
    rhs = np.ones(3 * len(node_mm))
    expected = first.solve(rhs)
    tracemalloc.start()
    try:
        again = factor(analysis, 2.0 * matrices)
        most = tracemalloc.get_traced_memory()[1] - matrices.nbytes
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        third = factor(analysis, matrices, into=again)
        more = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    # Beside arrays stand Python's own objects, some 100 kB.
    assert most < analysis.factor_bytes + analysis.work_bytes + 3e5
    assert more < analysis.work_bytes + 3e5
    assert np.shares_memory(again.columns, third.columns)
    np.testing.assert_array_equal(third.solve(rhs), expected)
