"""Each law is the derivative of its textbook energy, and agrees with linear elasticity at rest."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import ArgumentError
from planner.materials.laws import (
    Law,
    Linear,
    Martins,
    NeoHookean,
    Ogden,
    Yeoh,
    make_law,
    secant_modulus_MPa,
)
from planner.palette import LawParameters

Energy = Callable[[complex], complex]
modulus = st.floats(1e-3, 1e3)
exponent = st.floats(-8.0, 8.0).filter(lambda a: abs(a) > 0.05)


def j(x: complex) -> complex:
    """First invariant of the right Cauchy-Green tensor less 3, incompressible, uniaxial."""
    return x**2 + 2 / x - 3


@st.composite
def laws(draw: st.DrawFn) -> tuple[Law, Energy]:
    match draw(st.sampled_from(["linear", "neo-hookean", "yeoh", "ogden", "martins"])):
        case "linear":
            E = draw(modulus)
            return Linear(E), lambda x: E * (x - 1) ** 2 / 2
        case "neo-hookean":
            mu = draw(modulus)
            return NeoHookean(mu), lambda x: mu / 2 * j(x)
        case "yeoh":
            c1, c2, c3 = draw(modulus), draw(modulus), draw(modulus)
            return Yeoh((c1, c2, c3)), lambda x: c1 * j(x) + c2 * j(x) ** 2 + c3 * j(x) ** 3
        case "ogden":
            terms = draw(st.lists(st.tuples(modulus, exponent), min_size=1, max_size=3))
            mus = tuple(float(np.copysign(mu, a)) for mu, a in terms)
            alphas = tuple(a for _, a in terms)
            return Ogden(mus, alphas), lambda x: sum(
                mu / a * (x**a + 2 * x ** (-a / 2) - 3) for mu, a in zip(mus, alphas, strict=True)
            )
        case _:
            c1, c3 = draw(st.floats(0.05, 2.0)), draw(st.floats(0.05, 2.0))
            c2, c4 = draw(modulus), draw(modulus)
            return Martins(
                c1, c2, c3, c4
            ), lambda x: c2 * (np.exp(c1 * j(x)) - 1) + c4 * (np.exp(c3 * (x - 1) ** 2) - 1)


@settings(deadline=None, derandomize=True)
@given(law=laws(), stretch=st.floats(0.5, 2.0))
def test_stress_is_the_derivative_of_the_energy(law: tuple[Law, Energy], stretch: float) -> None:
    # The complex step differentiates without cancellation: only roundings of the terms are left,
    # whose size is that of the modulus (near rest the terms of the stress cancel, not the step's).
    expected = law[1](complex(stretch, 1e-30)).imag / 1e-30
    size = abs(expected) + float(law[0].tangent_MPa(1.0))
    assert abs(float(law[0].nominal_stress_MPa(stretch)) - expected) <= 1e-12 * size


@settings(deadline=None, derandomize=True)
@given(law=laws(), stretch=st.floats(0.6, 1.9))
def test_tangent_is_the_derivative_of_the_stress(law: tuple[Law, Energy], stretch: float) -> None:
    h = 1e-5
    ends = law[0].nominal_stress_MPa(np.array([stretch - h, stretch + h]))
    tangent = float(law[0].tangent_MPa(stretch))
    # Central difference: error h^2 P'''/6, at most some hundred times the tangent here, and
    # roundings of 1e-16 / h.
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(tangent, rel=1e-6)


@settings(deadline=None, derandomize=True)
@given(law=laws())
def test_at_rest(law: tuple[Law, Energy]) -> None:
    rest = law[0]
    assert float(rest.nominal_stress_MPa(1.0)) == 0.0
    assert float(secant_modulus_MPa(rest, 0.0)) == float(rest.tangent_MPa(1.0))


@settings(deadline=None, derandomize=True)
@given(law=laws(), strain=st.floats(-0.4, 1.0))
def test_secant_is_stress_over_strain_and_smooth_at_rest(
    law: tuple[Law, Energy], strain: float
) -> None:
    secant = float(secant_modulus_MPa(law[0], strain))
    stress = float(law[0].nominal_stress_MPa(1.0 + strain))
    # The stress is a difference of terms of the modulus' size: an absolute error of roundings.
    assert abs(secant * strain - stress) <= 1e-13 * float(law[0].tangent_MPa(1.0)) + 1e-12 * abs(
        stress
    )
    # Across the switch at 1e-5 the secant moves by no more than the tangent does up to twice
    # that strain; 1e-6 for the digits that the quotient loses.
    below, above = secant_modulus_MPa(law[0], [0.999e-5, 1.001e-5])
    rest, beyond = law[0].tangent_MPa([1.0, 1.0 + 2e-5])
    assert abs(above - below) <= abs(beyond - rest) + 1e-6 * rest


@settings(deadline=None, derandomize=True)
@given(mu=st.tuples(modulus, modulus), alpha=st.tuples(exponent, exponent))
def test_ogden_initial_modulus(mu: tuple[float, float], alpha: tuple[float, float]) -> None:
    expected = 1.5 * (mu[0] * alpha[0] + mu[1] * alpha[1])
    size = abs(mu[0] * alpha[0]) + abs(mu[1] * alpha[1])
    assert float(Ogden(mu, alpha).tangent_MPa(1.0)) == pytest.approx(expected, abs=1e-14 * size)


def test_ogden_of_exponent_two_is_neo_hookean_and_two_terms_are_mooney_rivlin() -> None:
    stretch = np.linspace(0.4, 3.0, 50)
    g = stretch - stretch**-2
    np.testing.assert_allclose(
        Ogden((0.7,), (2.0,)).nominal_stress_MPa(stretch),
        NeoHookean(0.7).nominal_stress_MPa(stretch),
        rtol=1e-12,
        atol=1e-15,
    )
    # Mooney-Rivlin: P = 2 (l - 1/l^2) (C10 + C01/l), with mu = (2 C10, -2 C01), alpha = (2, -2).
    np.testing.assert_allclose(
        Ogden((0.6, -0.2), (2.0, -2.0)).nominal_stress_MPa(stretch),
        2.0 * g * (0.3 + 0.1 / stretch),
        rtol=1e-12,
        atol=1e-15,
    )


@pytest.mark.parametrize("stretch", [0.0, -1.0, np.nan, np.inf, [1.0, 0.0]])
@pytest.mark.parametrize(
    "law", [Linear(1.0), NeoHookean(1.0), Yeoh((1.0, 0.0, 0.0)), Ogden((1.0,), (2.0,))]
)
def test_refuses_what_is_no_stretch(law: Law, stretch: float | list[float]) -> None:
    for function in (law.nominal_stress_MPa, law.tangent_MPa):
        with pytest.raises(ArgumentError, match="must be above 0 and finite"):
            function(stretch)


@pytest.mark.parametrize(
    ("model", "parameters", "law"),
    [
        ("linear", {"modulus_MPa": (3.0,)}, Linear(3.0)),
        ("neo-hookean", {"mu_MPa": (0.3,)}, NeoHookean(0.3)),
        ("yeoh", {"c_MPa": (0.1, 0.2, 0.3)}, Yeoh((0.1, 0.2, 0.3))),
        ("ogden", {"mu_MPa": (1.0, -2.0), "alpha": (3.0, -4.0)}, Ogden((1.0, -2.0), (3.0, -4.0))),
        (
            "martins",
            {"c1": (0.1,), "c2_MPa": (0.2,), "c3": (0.3,), "c4_MPa": (0.4,)},
            Martins(0.1, 0.2, 0.3, 0.4),
        ),
    ],
)
def test_make_law(model: str, parameters: dict[str, tuple[float, ...]], law: Law) -> None:
    assert make_law(LawParameters(model, parameters)) == law


def test_make_law_refuses_a_law_that_is_not_planned_with() -> None:
    published = LawParameters(
        "ogden-thesis", {"c": (1.0,) * 6, "strain_min": 0.1, "strain_max": 0.9}
    )
    with pytest.raises(
        ArgumentError, match=r"one of linear, yielding, neo-hookean, yeoh, ogden, martins$"
    ):
        make_law(published)
