"""The stable Yeoh law: exact where one is given, and stable in every mode for all grades."""

import numpy as np
import pytest

from planner.materials.mixtures import CoefficientModel
from planner.materials.stable_yeoh import StableYeoh, stable_yeoh
from planner.printers import palette_of


def hessian_lows(law: StableYeoh, stretches: np.ndarray) -> np.ndarray:
    """Smallest curvature over logarithmic strains of no volume, at pairs of stretches, (n, 2)."""
    c1, c2, c3 = law.coefficients_MPa
    lows = []
    for a, b in stretches:
        square = np.array([a, b, 1.0 / (a * b)]) ** 2
        y = square.sum() - 3.0
        slope, curvature = c1 + 2.0 * c2 * y + 3.0 * c3 * y * y, 2.0 * c2 + 6.0 * c3 * y
        full = 4.0 * curvature * np.outer(square, square) + 4.0 * slope * np.diag(square)
        plane = np.linalg.svd(np.ones((1, 3)))[2][1:]
        lows.append(np.linalg.eigvalsh(plane @ full @ plane.T)[0])
    return np.array(lows)


def test_a_yeoh_law_is_found_again():
    wanted = StableYeoh((0.3, 0.02, 0.004), 0.0)
    strain = np.linspace(0.02, 1.2, 50)
    found = stable_yeoh(strain, wanted.nominal_stress_MPa(1.0 + strain))
    # The linear programme's own tolerance is 1e-7.
    assert found.error < 1e-6
    np.testing.assert_allclose(found.coefficients_MPa, wanted.coefficients_MPa, rtol=1e-4)


@pytest.mark.parametrize("material", palette_of().materials, ids=lambda m: m.id)
def test_every_grade_is_stable_in_every_mode(material):
    palette = palette_of()
    strain = material.elongation_at_break * np.linspace(0.02, 1.0, 40)
    stress = CoefficientModel(palette).nominal_stress_MPa(material.coordinate, 1.0 + strain)
    law = stable_yeoh(strain, stress)
    ratio = law.nominal_stress_MPa(1.0 + strain) / stress
    assert np.abs(ratio - 1.0).max() == pytest.approx(law.error, rel=1e-4)
    # All but FLX9795, which bends over, are met better than prints of one grade scatter.
    assert law.error < (0.35 if material.id == "FLX9795" else 0.07)
    draws = np.exp(np.random.default_rng(1).uniform(-1.2, 1.2, (2000, 2)))
    assert hessian_lows(law, draws).min() > 0.0
