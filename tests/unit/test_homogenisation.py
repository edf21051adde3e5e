"""Bounds, the periodic cell and the dithered pattern's table, against what is known exactly."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import ArgumentError
from planner.grading.dither import (
    bayer_ranks,
    bevelled_fractions,
    blue_noise_bevelled,
    blue_noise_ranks,
)
from planner.materials.homogenisation import (
    dither_table,
    dithered_fraction,
    dithered_modulus_MPa,
    effective_stiffness_MPa,
    hashin_shtrikman_MPa,
    reuss_MPa,
    reuss_share,
    solve_cell,
    voigt_MPa,
    youngs_modulus_MPa,
)

EXTENSION = [1.0, -0.5, -0.5, 0.0, 0.0, 0.0]
SHEAR_YZ, SHEAR_XY = [0, 0, 0, 1.0, 0, 0], [0, 0, 0, 0, 0, 1.0]

moduli = st.tuples(st.floats(0.1, 500.0), st.floats(1.01, 100.0)).map(lambda p: (p[0], p[0] * p[1]))
shares = st.floats(0.0, 1.0)


@given(moduli, shares)
def test_bounds_are_in_order_and_meet_at_the_ends(pair, f):
    soft, hard = pair
    low, high = hashin_shtrikman_MPa(soft, hard, f)
    order = [reuss_MPa(soft, hard, f), low, high, voigt_MPa(soft, hard, f)]
    assert all(a <= b * (1 + 1e-12) for a, b in itertools.pairwise(order))
    for end, modulus in ((0.0, soft), (1.0, hard)):
        np.testing.assert_allclose(hashin_shtrikman_MPa(soft, hard, end), modulus, rtol=1e-12)
    assert float(reuss_share(soft, hard, 1 / order[0])) == pytest.approx(f, abs=1e-6)


def test_nearly_incompressible_phases_come_to_the_incompressible_bounds():
    soft, hard, f = 1.0, 4.0, np.linspace(0, 1, 11)
    near = hashin_shtrikman_MPa(soft, hard, f, 0.5 - 1e-7)
    np.testing.assert_allclose(near, hashin_shtrikman_MPa(soft, hard, f), rtol=1e-6)


def test_layers_are_exact():
    """Sheared across, layers lie in series; sheared along or stretched, side by side."""
    cell = np.full((8, 1, 1), 1.0)
    cell[3:] = 4.0
    series, parallel = 2 * reuss_MPa(1, 4, 5 / 8), 2 * voigt_MPa(1, 4, 5 / 8)
    assert solve_cell(cell, SHEAR_XY).stress_MPa[5] == pytest.approx(series, rel=1e-9)
    assert solve_cell(cell, SHEAR_YZ).stress_MPa[3] == pytest.approx(parallel, rel=1e-9)
    assert solve_cell(cell, EXTENSION).stress_MPa[0] == pytest.approx(parallel, rel=1e-9)
    turned = solve_cell(cell.reshape(1, 1, 8), [0, 0, 0, 1.0, 0, 0]).stress_MPa[3]
    assert turned == pytest.approx(series, rel=1e-9)


def test_one_phase_is_itself_in_every_direction():
    stiffness = effective_stiffness_MPa(np.full((3, 4, 5), 2.0))
    np.testing.assert_allclose(stiffness, 4 * np.eye(5), atol=1e-12)
    assert youngs_modulus_MPa(stiffness, [1, -2, 3]) == pytest.approx(6.0)


def ball(n, radius):
    x = (np.arange(n) + 0.5) / n - 0.5
    square = x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2
    return square < radius**2


def test_dilute_balls():
    """Eshelby: µ = µ1 (1 + f 5 (r - 1) / (3 + 2 r)) as f goes to 0; the mean over directions."""
    inside = ball(24, 0.15)
    f, ratio = inside.mean(), 5.0
    stiffness = effective_stiffness_MPa(np.where(inside, ratio, 1.0), 1e-4)
    slope = (np.trace(stiffness) / 10.0 - 1.0) / f  # isotropic part: a fifth of the trace
    # Neighbours add a term of order f, 1 %; voxels of a ball of 8 across another few per cent.
    assert slope == pytest.approx(5 * (ratio - 1) / (3 + 2 * ratio), rel=0.06)


def test_solved_strains_are_compatible_and_keep_volume():
    rng = np.random.default_rng(1)
    solved = solve_cell(rng.uniform(1, 10, (6, 5, 8)), EXTENSION)
    np.testing.assert_allclose(solved.strain[:3].sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(solved.strain.mean(axis=(1, 2, 3)), EXTENSION, atol=1e-12)


def test_meshes_converge():
    found = []
    for n in (8, 16, 32):
        stress = solve_cell(np.where(ball(n, 0.3), 4.0, 1.0), EXTENSION).stress_MPa[0]
        low, high = hashin_shtrikman_MPa(1.0, 4.0, float(ball(n, 0.3).mean()))
        # Place between the bounds, which takes out that voxels change the ball's volume.
        found.append(float((stress / 2 - low) / (high - low)))
    assert abs(found[2] - found[1]) < 0.6 * abs(found[1] - found[0]) + 0.02


@pytest.mark.parametrize(
    ("cell", "mean"),
    [
        (np.zeros((2, 2, 2)), EXTENSION),
        (np.ones((2, 2)), EXTENSION),
        (np.full((2, 2, 2), np.nan), EXTENSION),
        (np.ones((2, 2, 2)), [1, 0, 0, 0, 0, 0]),
        (np.ones((2, 2, 2)), [1, -1, 0]),
    ],
)
def test_cells_that_cannot_be(cell, mean):
    with pytest.raises(ArgumentError):
        solve_cell(cell, mean)


@settings(max_examples=50)
@given(moduli, shares)
def test_the_estimate_lies_within_the_bounds_and_rises(pair, f):
    soft, hard = pair
    low, high = hashin_shtrikman_MPa(soft, hard, f)
    value = dithered_modulus_MPa(soft, hard, f)
    assert low * (1 - 1e-9) <= value <= high * (1 + 1e-9)
    steps = dithered_modulus_MPa(soft, hard, np.linspace(0, 1, 200))
    assert (np.diff(steps) > -1e-12 * hard).all()


@settings(max_examples=50)
@given(st.floats(0.1, 100.0), st.floats(1.2, 8.0), shares)
def test_the_inverse_of_the_estimate(soft, contrast, f):
    hard = soft * contrast
    back = dithered_fraction(soft, hard, dithered_modulus_MPa(soft, hard, f))
    assert float(back) == pytest.approx(f, abs=2e-6)
    assert dithered_fraction(soft, hard, [soft, hard, soft / 2, hard * 2]).tolist() == [0, 1, 0, 1]


def test_the_pattern_solved_has_the_modulus_it_was_dealt_for():
    """From a target over fraction and cells to the modulus of these very cells."""
    ranks = blue_noise_ranks()
    contrast, target = 4.0, 2.0
    fraction = dithered_fraction(1.0, contrast, target)
    dealt = float(blue_noise_bevelled().dealt_for(fraction))
    # Two voxels a cell, eight places each: a quick view of the bevelled pattern.
    share = quick_share(ranks < dealt * ranks.size)
    assert share.mean() == pytest.approx(float(fraction), abs=0.003)
    low, high = hashin_shtrikman_MPa(1.0, contrast, share)
    solved = solve_cell(np.sqrt(low * high) / 3.0, EXTENSION, 1e-3).stress_MPa[0] * 1.5
    # The table's error, and 1 % of voxels as coarse as these (benchmarks/calibrate_dither.py).
    assert solved == pytest.approx(target, rel=0.01 + dither_table().error_at(contrast))


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


def test_tiles_hold_every_rank_once_and_spread_evenly():
    for ranks in (blue_noise_ranks(), bayer_ranks()):
        np.testing.assert_array_equal(np.sort(ranks.ravel()), np.arange(ranks.size))
    ranks = blue_noise_ranks()
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
