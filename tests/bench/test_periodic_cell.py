"""Stiffness of periodic cells, against what is known exactly."""

import numpy as np
import pytest

from benchmarks.periodic_cell import effective_stiffness_MPa, solve_cell, youngs_modulus_MPa
from planner.errors import ArgumentError
from planner.materials.mixtures import TwoPhases

EXTENSION = [1.0, -0.5, -0.5, 0.0, 0.0, 0.0]
SHEAR_YZ, SHEAR_XY = [0, 0, 0, 1.0, 0, 0], [0, 0, 0, 0, 0, 1.0]


def test_layers_are_exact():
    """Sheared across, layers lie in series; sheared along or stretched, side by side."""
    cell = np.full((8, 1, 1), 1.0)
    cell[3:] = 4.0
    series, parallel = 2 * TwoPhases(1, 4).reuss_MPa(5 / 8), 2 * TwoPhases(1, 4).voigt_MPa(5 / 8)
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
        low, high = TwoPhases(1.0, 4.0).hashin_shtrikman_MPa(float(ball(n, 0.3).mean()))
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
