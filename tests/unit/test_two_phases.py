"""Bounds, the periodic cell and the dithered pattern's table, against what is known exactly."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.calibrate_dither import bevelled_fractions
from benchmarks.periodic_cell import solve_cell
from planner.grading.dither import blue_noise_bevelled, blue_noise_ranks
from planner.materials.mixtures import TwoPhases

EXTENSION = [1.0, -0.5, -0.5, 0.0, 0.0, 0.0]

moduli = st.tuples(st.floats(0.1, 500.0), st.floats(1.01, 100.0)).map(lambda p: (p[0], p[0] * p[1]))
shares = st.floats(0.0, 1.0)


@given(moduli, shares)
def test_bounds_are_in_order_and_meet_at_the_ends(pair, f):
    soft, hard = pair
    low, high = TwoPhases(soft, hard).hashin_shtrikman_MPa(f)
    order = [TwoPhases(soft, hard).reuss_MPa(f), low, high, TwoPhases(soft, hard).voigt_MPa(f)]
    assert all(a <= b * (1 + 1e-12) for a, b in itertools.pairwise(order))
    for end, modulus in ((0.0, soft), (1.0, hard)):
        np.testing.assert_allclose(
            TwoPhases(soft, hard).hashin_shtrikman_MPa(end), modulus, rtol=1e-12
        )
    assert float(TwoPhases(soft, hard).reuss_share(1 / order[0])) == pytest.approx(f, abs=1e-6)


def test_nearly_incompressible_phases_come_to_the_incompressible_bounds():
    """Hashin and Shtrikman's bounds on bulk and shear moduli, as Poisson's ratio goes to 1/2."""
    f, nu = np.linspace(0, 1, 11), 0.5 - 1e-7
    bounds = TwoPhases(1.0, 4.0).hashin_shtrikman_MPa(f)
    shear, bulk = ([e / factor for e in (1.0, 4.0)] for factor in (2 * (1 + nu), 3 * (1 - 2 * nu)))
    for matrix, other, share, bound in ((0, 1, f, bounds[0]), (1, 0, 1 - f, bounds[1])):
        k, g = bulk[matrix], shear[matrix]
        dk, dg = bulk[other] - k, shear[other] - g
        K = k + share / (1 / dk + 3 * (1 - share) / (3 * k + 4 * g))
        G = g + share / (1 / dg + 6 * (1 - share) * (k + 2 * g) / (5 * g * (3 * k + 4 * g)))
        np.testing.assert_allclose(9 * K * G / (3 * K + G), bound, rtol=1e-6)


@settings(max_examples=50)
@given(moduli, shares)
def test_the_estimate_lies_within_the_bounds_and_rises(pair, f):
    soft, hard = pair
    low, high = TwoPhases(soft, hard).hashin_shtrikman_MPa(f)
    value = TwoPhases(soft, hard).dithered_MPa(f)
    assert low * (1 - 1e-9) <= value <= high * (1 + 1e-9)
    steps = TwoPhases(soft, hard).dithered_MPa(np.linspace(0, 1, 200))
    assert (np.diff(steps) > -1e-12 * hard).all()


@settings(max_examples=50)
@given(st.floats(0.1, 100.0), st.floats(1.2, 8.0), shares)
def test_the_inverse_of_the_estimate(soft, contrast, f):
    hard = soft * contrast
    back = TwoPhases(soft, hard).dithered_fraction(TwoPhases(soft, hard).dithered_MPa(f))
    assert float(back) == pytest.approx(f, abs=1e-6)
    assert TwoPhases(soft, hard).dithered_fraction([soft, hard, soft / 2, hard * 2]).tolist() == [
        0,
        1,
        0,
        1,
    ]


def test_the_pattern_solved_has_the_modulus_it_was_dealt_for():
    """From a target over fraction and cells to the modulus of these very cells."""
    ranks = blue_noise_ranks()
    contrast, target = 4.0, 2.0
    fraction = TwoPhases(1.0, contrast).dithered_fraction(target)
    dealt = float(blue_noise_bevelled().dealt_for(fraction))
    # Two voxels a cell, eight places each: a quick view of the bevelled pattern.
    share = quick_share(ranks < dealt * ranks.size)
    assert share.mean() == pytest.approx(float(fraction), abs=0.003)
    low, high = TwoPhases(1.0, contrast).hashin_shtrikman_MPa(share)
    solved = solve_cell(np.sqrt(low * high) / 3.0, EXTENSION, 1e-3).stress_MPa[0] * 1.5
    # The table's error, and 1 % of voxels as coarse as these (benchmarks/calibrate_dither.py).
    assert solved == pytest.approx(target, rel=0.01 + TwoPhases(1.0, contrast).dither_error)


def quick_share(hard):
    """Hard share of 2^3 voxels a cell, from the tetrahedra's linear functions."""
    corner = {
        (i, j, k): np.roll(hard, (-i, -j, -k), (0, 1, 2)).astype(float)
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    }
    places = (np.arange(4) + 0.5) / 4
    found = np.zeros([2 * n for n in hard.shape])
    for i, a in enumerate(places):
        for j, b in enumerate(places):
            for k, c in enumerate(places):
                point = np.array([a, b, c])
                order = np.argsort(-point, kind="stable")
                at, value = [0, 0, 0], corner[0, 0, 0] * (1 - point[order[0]])
                for axis, after in zip(order, [*point[order[1:]], 0.0], strict=True):
                    at[axis] = 1
                    value = value + corner[tuple(at)] * (point[axis] - after)
                inside = np.where(np.abs(value - 0.5) < 1e-12, 0.5, value > 0.5)
                found[i // 2 :: 2, j // 2 :: 2, k // 2 :: 2] += inside / 8
    return found


def test_the_tile_holds_every_rank_once_and_spreads_evenly():
    ranks = blue_noise_ranks()
    np.testing.assert_array_equal(np.sort(ranks.ravel()), np.arange(ranks.size))
    for fraction in (0.1, 0.5, 0.8):
        hard = (ranks < fraction * ranks.size) - fraction
        power = np.abs(np.fft.fftn(hard)) ** 2 / ranks.size / (fraction * (1 - fraction))
        waves = np.fft.fftfreq(32) * 32
        length = np.sqrt(waves[:, None, None] ** 2 + waves[:, None] ** 2 + waves**2)
        # White noise has 1: long waves are what one could feel as lumps.
        assert power[(length > 0) & (length <= 4)].mean() < 0.03


def test_the_table_of_bevelled_cells_is_that_of_the_tile():
    ranks, table = blue_noise_ranks(), blue_noise_bevelled()
    assert (np.diff(table.volume) > 0).all()
    for fraction in (0.03, 0.2717, 0.5, 0.81):
        volume, triangles = bevelled_fractions(ranks < fraction * ranks.size)
        assert volume == pytest.approx(np.interp(fraction, table.dealt, table.volume), abs=2e-4)
        drawn = np.interp(fraction, table.dealt, table.triangles_per_cell)
        assert triangles == pytest.approx(drawn, rel=0.01)


def test_bevels_of_single_cells():
    """A cell alone keeps half of its volume; layers of whole cells keep all of it."""
    lone = np.zeros((6, 6, 6), dtype=bool)
    lone[2, 3, 1] = True
    assert bevelled_fractions(lone)[0] * lone.size == pytest.approx(0.5)
    assert bevelled_fractions(~lone)[0] * lone.size == pytest.approx(lone.size - 0.5)
    layers = np.zeros((6, 6, 6), dtype=bool)
    layers[:, :3] = True
    assert bevelled_fractions(layers)[0] == pytest.approx(0.5)
