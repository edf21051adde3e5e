"""What the thesis' printed numbers say of themselves, and how they must be read.

Hemleben, M.S. thesis, Oregon State University, 2017: Tables 3.1 and 3.2, eq. 3.5 to 3.8 and the
quadratics of section 3.0.5.
"""

from itertools import pairwise

import numpy as np
import pytest

from planner.materials.algorithm_one import QuadraticCoefficients, literal_stress_MPa
from planner.materials.laws import Martins, Yeoh
from planner.numerics import FloatArray
from printers.connex3.thesis import Published, literal_tangent_MPa, load_thesis
from printers.connex3.toe import correct, flattest_tangent

THESIS = load_thesis()
QUADRATICS = QuadraticCoefficients(THESIS.quadratics)
BY_ID = {p.id: p for p in THESIS.materials}


def r_squared(measured: FloatArray, model: FloatArray) -> float:
    residual = np.sum((measured - model) ** 2)
    return float(1.0 - residual / np.sum((measured - measured.mean()) ** 2))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("TangoPlus", 0.007),
        ("FLX9740", 0.561),
        ("FLX9750", 0.863),
        ("FLX9760", 0.976),
        ("FLX9770", 0.941),
        ("FLX9785", 0.925),
        ("FLX9795", 0.967),
    ],
)
def test_the_quadratics_reproduce_the_fits_when_the_variable_is_the_strain(
    name: str, expected: float
) -> None:
    published = BY_ID[name]
    m = THESIS.coordinate(published)
    strain = np.linspace(0.1, published.elongation_at_break, 400)
    fit = literal_stress_MPa(published.c, strain)
    # Half a unit of the last digit given.
    assert r_squared(fit, QUADRATICS.literal_stress_MPa(m, strain)) == pytest.approx(
        expected, abs=5.1e-4
    )
    assert r_squared(fit, QUADRATICS.literal_stress_MPa(m, 1.0 + strain)) < 0.0


def test_with_the_stretch_for_a_variable_nothing_is_at_rest() -> None:
    rest = {p.id: float(literal_stress_MPa(p.c, 1.0)) for p in THESIS.elastomers}
    assert rest["TangoPlus"] == pytest.approx(0.27, abs=0.005)
    assert rest["FLX9795"] == pytest.approx(7.245, abs=0.005)
    assert all(softer < harder for softer, harder in pairwise(rest.values()))


def test_the_factor_two_comes_of_two_over_root_lambda() -> None:
    """W = c1/c2 (λ^c2 + (2/√λ)^c2 - 3) and λ dW/dλ is eq. 3.8's term; eq. 3.3's W is not."""
    c1, c2, x = 1.3, 0.7, 0.4
    step = complex(x, 1e-30)

    def cauchy(energy: complex) -> float:
        return x * energy.imag / 1e-30

    printed = float(literal_stress_MPa((c1, c2, 0, 1, 0, 1), x))
    assert cauchy(c1 / c2 * (step**c2 + (2 / step**0.5) ** c2)) == pytest.approx(printed, rel=1e-12)
    assert cauchy(c1 / c2 * (step**c2 + 2 * (1 / step**0.5) ** c2)) != pytest.approx(
        printed, rel=0.05
    )


@pytest.mark.parametrize("published", THESIS.elastomers, ids=lambda p: p.id)
def test_the_printed_law_diverges_at_rest(published: Published) -> None:
    near = np.abs(literal_stress_MPa(published.c, [1e-9, 1e-6]))
    assert near[0] > near[1]
    # ... while at rest a sound law is at most its stress at 10 % strain.
    assert near[0] > 5.0 * float(literal_stress_MPa(published.c, published.elongation_at_break))


@pytest.mark.parametrize("published", THESIS.elastomers, ids=lambda p: p.id)
def test_literal_derivatives(published: Published) -> None:
    x, h = np.linspace(0.05, published.elongation_at_break, 60), 1e-6
    slope = (literal_stress_MPa(published.c, x + h) - literal_stress_MPa(published.c, x - h)) / (
        2 * h
    )
    bend = (literal_tangent_MPa(published.c, x + h) - literal_tangent_MPa(published.c, x - h)) / (
        2 * h
    )
    # Central differences: roundings of 1e-16 x stress / h, and h^2 / 6 of the third derivative.
    np.testing.assert_allclose(literal_tangent_MPa(published.c, x), slope, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(
        literal_tangent_MPa(published.c, x, order=2), bend, rtol=1e-6, atol=1e-6
    )


def test_table_3_1_is_not_monotonic_and_disagrees_with_table_3_2_on_the_soft_grades() -> None:
    modulus = {p.id: p.youngs_modulus_MPa for p in THESIS.materials}
    assert modulus["FLX9740"] > modulus["FLX9750"]
    assert modulus["FLX9760"] > modulus["FLX9770"]
    ratio = {p.id: correct(p).modulus_MPa / p.youngs_modulus_MPa for p in THESIS.elastomers}
    assert ratio["TangoPlus"] == pytest.approx(41.0, abs=0.5)
    assert ratio["FLX9750"] == pytest.approx(74.1, abs=0.5)
    assert ratio["FLX9795"] == pytest.approx(0.77, abs=0.01)


def test_toughness_is_the_area_in_MJ_m3_for_the_hardest_elastomer_only() -> None:
    ratio = {}
    for published in THESIS.elastomers:
        strain = np.linspace(flattest_tangent(published), published.elongation_at_break, 20001)
        curve = correct(published)
        below = curve.modulus_MPa * (curve.onset - curve.toe) ** 2 / 2
        area = float(np.trapezoid(literal_stress_MPa(published.c, strain), strain)) + below
        ratio[published.id] = area / published.toughness_MJ_m3
    assert ratio["FLX9795"] == pytest.approx(0.98, abs=0.01)
    assert all(3.8 < r < 6.2 for name, r in ratio.items() if name != "FLX9795")


def test_martins_and_yeoh_are_cauchy_stresses() -> None:
    """Eq. 3.6 and 3.7, evaluated as printed with λ the stretch, are λ times the nominal stress."""
    stretch = np.linspace(0.8, 2.0, 25)
    i1 = stretch**2 + 2.0 / stretch
    c1, c2, c3, c4 = 0.2, 0.5, 0.3, 0.7
    g = stretch**2 - 1.0 / stretch
    martins = 2 * g * c1 * c2 * np.exp(c1 * (i1 - 3))
    martins += 2 * stretch * (stretch - 1) * c3 * c4 * np.exp(c3 * (stretch - 1) ** 2)
    yeoh = 2 * g * (c1 + 2 * c2 * (i1 - 3) + 3 * c3 * (i1 - 3) ** 2)
    np.testing.assert_allclose(
        Martins(c1, c2, c3, c4).nominal_stress_MPa(stretch) * stretch, martins, atol=1e-14
    )
    np.testing.assert_allclose(
        Yeoh((c1, c2, c3)).nominal_stress_MPa(stretch) * stretch, yeoh, atol=1e-13
    )


def test_the_onset_is_the_inflexion_where_there_is_one() -> None:
    for published in THESIS.elastomers:
        onset = flattest_tangent(published)
        around = literal_tangent_MPa(published.c, onset + np.array([-2e-4, 2e-4]), order=2)
        assert (around[0] > 0.0 > around[1]) == (published.id != "FLX9740")


def test_the_rule_puts_the_grade_without_inflexion_where_its_neighbours_would() -> None:
    soft, middle, hard = (correct(p).modulus_MPa for p in THESIS.elastomers[:3])
    assert middle == pytest.approx((soft * hard) ** 0.5, rel=0.01)


def test_hardness_sides_with_table_3_2() -> None:
    """Gent, Rubber Chem. Technol. 31 (1958): E = 0.0981 (56 + 7.62336 S)/(0.137505 (254 - 2.54 S)).

    S is Shore A: 26 to 28 for FLX930 (unconfirmed), the last digits of the mixtures' names.
    """
    ratios = []
    for published in THESIS.elastomers:
        S = 27.0 if published.id == "TangoPlus" else float(published.id[-2:])
        gent = 0.0981 * (56.0 + 7.62336 * S) / (0.137505 * (254.0 - 2.54 * S))
        ratios.append((gent / correct(published).modulus_MPa, gent / published.youngs_modulus_MPa))
    assert all(1 / 3 < curve < 3 for curve, _ in ratios)
    assert max(table for _, table in ratios) > 100
