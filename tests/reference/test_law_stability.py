"""How far laws are sound, against closed forms and numerical energies."""

import numpy as np
import pytest

from planner.materials.laws import (
    Law,
    Linear,
    Martins,
    NeoHookean,
    Ogden,
    Yeoh,
    Yielding,
    _second_derivatives_MPa,
    stability,
)

LOADINGS = ("uniaxial", "planar", "equibiaxial")


def energy(law: Law, a: float, b: float, c: float) -> float:
    """Return W of the principal stretches, the fibre along the first."""
    if isinstance(law, Ogden):
        terms = zip(law.mu_MPa, law.alpha, strict=True)
        return sum(mu / alpha * (a**alpha + b**alpha + c**alpha - 3.0) for mu, alpha in terms)
    j = a * a + b * b + c * c - 3.0
    if isinstance(law, NeoHookean):
        return 0.5 * law.mu_MPa * j
    if isinstance(law, Yeoh):
        return sum(ci * j ** (i + 1) for i, ci in enumerate(law.c_MPa))
    assert isinstance(law, Martins)
    matrix = law.c2_MPa * (np.exp(law.c1 * j) - 1.0)
    return float(matrix + law.c4_MPa * (np.exp(law.c3 * (a - 1.0) ** 2) - 1.0))


LAWS = (
    NeoHookean(0.4),
    Yeoh((0.3, -0.02, 0.004)),
    Ogden((0.6, -0.4), (2.0, -1.5)),
    Martins(0.2, 1.0, 0.5, 0.3),
)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("powers", [(-0.5, -0.5), (0.0, -1.0), (1.0, -2.0)])
def test_second_derivatives_are_the_energys(law: Law, powers: tuple[float, float]) -> None:
    """By central differences over the logarithmic strains of the first two directions."""
    for stretch in (0.7, 0.95, 1.3, 1.8):
        e = np.log([stretch, stretch ** powers[0]])

        def w(x: float, y: float, e: np.ndarray = e) -> float:
            return energy(law, *np.exp([e[0] + x, e[1] + y, -e[0] - e[1] - x - y]))

        d = 1e-4
        h11 = (w(d, 0) - 2.0 * w(0, 0) + w(-d, 0)) / d**2
        h22 = (w(0, d) - 2.0 * w(0, 0) + w(0, -d)) / d**2
        h12 = (w(d, d) - w(d, -d) - w(-d, d) + w(-d, -d)) / (4.0 * d**2)
        found = _second_derivatives_MPa(law, np.array([stretch]), powers)[0]
        # Second differences over 1e-4 of energies near 1: rounding leaves some 1e-7.
        assert [float(one[0]) for one in found] == pytest.approx([h11, h22, h12], abs=2e-6)


def test_positive_products_are_sound_in_every_loading() -> None:
    for law in (NeoHookean(1.0), Ogden((-2.0, 0.5), (-3.0, 4.0))):
        found = stability(law, 2.0)
        assert not found.limits
        assert set(found.sound) == set(LOADINGS)


def test_a_law_whose_stress_turns_in_compression_says_where() -> None:
    """TangoPlus as it was fitted before: P' = 0 at a stretch that a root finder gives too."""
    from scipy.optimize import brentq

    law = Ogden((0.2631345, 0.4236421), (-1.5, 1.5))
    found = stability(law, 1.0)
    assert found.limits
    true = brentq(lambda s: float(law.nominal_stress_MPa(s) + s * law.tangent_MPa(s)), 0.6, 0.95)
    # To the step between the stretches looked at, 0.0013.
    assert found.sound["uniaxial"][0] == pytest.approx(true, abs=2e-3)
    assert found.sound["equibiaxial"][1] < 1.2
    low, high = found.sound["uniaxial"]
    assert found.limits[0] == f"uniaxial {low:.3g} to {high:.3g}"


def test_a_law_that_gives_way_across_the_pull_says_where() -> None:
    """Its stress rises to any stretch; across, sum mu alpha l^(-alpha / 2) = 0 at a closed form."""
    law = Ogden((0.5353976, 0.2562666), (-0.5, 2.0))
    found = stability(law, 1.0)
    ratio = 0.5 * law.mu_MPa[0] / (2.0 * law.mu_MPa[1])
    assert found.sound["uniaxial"][1] == pytest.approx(ratio ** (-2.0 / 2.5), abs=4e-3)
    assert found.sound["uniaxial"][1] == pytest.approx(1.68, abs=0.01)
    rises = law.nominal_stress_MPa(np.linspace(1.0, 2.0, 100))
    assert (np.diff(rises) > 0.0).all()


def test_laws_of_one_loading_are_asked_of_that_alone() -> None:
    for law in (Linear(100.0), Yielding(1000.0, 30.0, 10.0, 3.0)):
        found = stability(law, 0.3)
        assert set(found.sound) == {"uniaxial"}
        assert not found.limits
