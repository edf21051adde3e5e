"""The coefficient model over random palettes and over the Connex3's: what holds everywhere."""

from dataclasses import replace
from itertools import pairwise
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import ArgumentError, PaletteError
from planner.materials.mixtures import CoefficientModel
from planner.palette import LawParameters, Material, Palette
from planner.printers import load_printer

CONNEX3 = CoefficientModel(load_printer("connex3").palette())
LAST = float(CONNEX3.coordinates[-1])
coordinates = st.floats(0.0, LAST)
stretches = st.floats(0.75, 1.55)


def linear(modulus: float) -> LawParameters:
    return LawParameters("linear", {"modulus_MPa": (modulus,)})


def palette(*grades: tuple[float, LawParameters], log_sd: float = 0.0) -> Palette:
    materials = tuple(
        Material(f"M{k}", m, 0.5, 1.1, law, modulus_log_sd=log_sd)
        for k, (m, law) in enumerate(grades)
    )
    return Palette("test", materials)


@settings(deadline=None, derandomize=True)
@given(m=coordinates, strain=st.floats(0.0, 0.55))
def test_between_its_neighbours(m: float, strain: float) -> None:
    lower, upper, t = CONNEX3.bracket(m)
    ladder = CONNEX3.grade_moduli_MPa(strain)
    modulus = float(CONNEX3.modulus_MPa(m, strain))
    # 1e-14: roundings of two powers.
    assert ladder[lower] * (1 - 1e-14) <= modulus <= ladder[upper] * (1 + 1e-14)
    assert np.log(modulus) == pytest.approx(
        float((1 - t) * np.log(ladder[lower]) + t * np.log(ladder[upper])), abs=1e-12
    )


@settings(deadline=None, derandomize=True)
@given(m=coordinates)
def test_at_rest_no_stress_and_then_ever_more(m: float) -> None:
    assert float(CONNEX3.nominal_stress_MPa(m, 1.0)) == 0.0
    stress = CONNEX3.nominal_stress_MPa(m, np.linspace(0.75, 1.55, 161))
    assert (np.diff(stress) > 0.0).all()


@settings(deadline=None, derandomize=True)
@given(pair=st.tuples(coordinates, coordinates), strain=st.floats(0.0, 0.55))
def test_stiffness_rises_with_the_coordinate(pair: tuple[float, float], strain: float) -> None:
    low, high = sorted(pair)
    moduli = CONNEX3.modulus_MPa(np.array([low, high]), strain)
    # Coordinates a hair apart may round to one modulus; else it rises.
    assert moduli[1] >= moduli[0] * (1 - 1e-14)
    if high - low > 1e-9:
        assert moduli[1] > moduli[0]


@pytest.mark.parametrize("strain", [0.0, 1e-9, 0.01, 0.1, 0.3, 0.55])
def test_exact_at_the_grades(strain: float) -> None:
    at_grades = CONNEX3.modulus_MPa(CONNEX3.coordinates, strain)
    assert (at_grades == CONNEX3.grade_moduli_MPa(strain)).all()


@settings(deadline=None, derandomize=True, max_examples=30)
@given(data=st.data())
def test_arrays_broadcast_as_their_elements(data: st.DataObject) -> None:
    m = np.array(data.draw(st.lists(coordinates, min_size=2, max_size=5)))
    stretch = np.array(data.draw(st.lists(stretches, min_size=2, max_size=4)))
    table = CONNEX3.nominal_stress_MPa(m[:, np.newaxis], stretch)
    assert table.shape == (len(m), len(stretch))
    for i, row in enumerate(table):
        for j, value in enumerate(row):
            one = float(CONNEX3.nominal_stress_MPa(m[i], stretch[j]))
            # Vector and scalar powers may differ in the last bits.
            assert value == pytest.approx(one, rel=1e-13, abs=1e-300)


@settings(deadline=None, derandomize=True)
@given(m=coordinates, strain=st.floats(0.0, 0.55), level=st.floats(0.05, 0.99))
def test_interval_encloses_the_modulus_and_widens_with_the_level(
    m: float, strain: float, level: float
) -> None:
    low, high = CONNEX3.modulus_interval_MPa(m, strain, level)
    modulus = float(CONNEX3.modulus_MPa(m, strain))
    assert 0.0 < low < modulus < high
    assert low * high == pytest.approx(modulus**2, rel=1e-12)
    wider = CONNEX3.modulus_interval_MPa(m, strain, level + 0.005)
    assert wider[0] < low
    assert wider[1] > high


def test_interval_at_a_grade_is_the_grades_own() -> None:
    low, high = CONNEX3.modulus_interval_MPa(CONNEX3.coordinates, 0.1)
    log_sd = np.log(high / low) / 2.0 / NormalDist().inv_cdf(0.975)
    expected = [m.modulus_log_sd for m in CONNEX3.palette.materials]
    np.testing.assert_allclose(log_sd, expected, rtol=1e-12)


def test_wiener_variance_of_a_wiener_process() -> None:
    """ln E a Wiener process of σ = 0.7 with a drift, at random coordinates: σ comes back."""
    random = np.random.default_rng(20170320)
    estimates = []
    for _ in range(400):
        gaps = random.uniform(0.1, 0.3, 9)
        # A drift large enough that stiffness rises at every step.
        steps = 20.0 * gaps + 0.7 * np.sqrt(gaps) * random.standard_normal(9)
        moduli = np.exp(np.concatenate([[0.0], np.cumsum(steps)]))
        m = np.concatenate([[0.0], np.cumsum(gaps)])
        grades = ((c, linear(E)) for c, E in zip(m.tolist(), moduli.tolist(), strict=True))
        estimates.append(float(CoefficientModel(palette(*grades)).wiener_variance(0.1)))
    # Eight correlated squares a draw: a relative standard error of about sqrt(2 * 1.7 / 8 / 400).
    assert np.mean(estimates) == pytest.approx(0.49, rel=0.1)


def test_an_even_ladder_leaves_no_doubt_between_grades() -> None:
    model = CoefficientModel(palette(*((k / 6, linear(2.0**k)) for k in range(5))))
    assert float(model.wiener_variance(0.1)) == pytest.approx(0.0, abs=1e-28)


def test_two_grades_know_but_one_step() -> None:
    model = CoefficientModel(palette((0.0, linear(1.0)), (0.5, linear(np.e**2))))
    assert float(model.wiener_variance(0.1)) == pytest.approx(8.0, rel=1e-12)  # 2^2 / 0.5


def test_a_palette_of_one_material() -> None:
    model = CoefficientModel(palette((0.3, linear(5.0)), log_sd=0.1))
    assert float(model.modulus_MPa(0.3, 0.2)) == 5.0
    low, high = model.modulus_interval_MPa(0.3, 0.2)
    assert float(high / low) == pytest.approx(np.exp(0.2 * NormalDist().inv_cdf(0.975)))
    with pytest.raises(ArgumentError, match=r"goes from 0\.3 to 0\.3"):
        model.modulus_MPa(0.31, 0.2)


def test_working_strains_end_where_the_first_elastic_grade_breaks() -> None:
    assert CONNEX3.strain_limit == 0.55  # FLX9795; the rigid grades break at 0.17
    rigid = tuple(m for m in CONNEX3.palette.materials if m.deformation == "plastic")
    assert CoefficientModel(replace(CONNEX3.palette, materials=rigid)).strain_limit == 0.17


def test_the_connex3_ladder_rises_at_every_working_strain() -> None:
    strains = np.linspace(0.0, 0.55, 1001)
    for softer, harder in pairwise(CONNEX3.grade_moduli_MPa(strains)):
        assert (harder > 1.4 * softer).all()


def ogden(mu: float, alpha: float) -> LawParameters:
    return LawParameters("ogden", {"mu_MPa": (mu,), "alpha": (alpha,)})


@pytest.mark.parametrize(
    ("grades", "words"),
    [
        (((0.0, linear(2.0)), (1.0, linear(1.0))), r"M1 \(1 MPa\) is not stiffer than M0 \(2 MPa"),
        (((0.0, linear(2.0)), (1.0, linear(2.0))), "M1 .* is not stiffer than M0"),
        # Stiffer at rest, softer at 50 %: the ladder turns within the working strains.
        (((0.0, linear(2.9)), (1.0, ogden(-1.0, -2.0))), "M1 .* is not stiffer than M0 .* strain"),
        (((0.0, linear(-2.0)), (1.0, linear(1.0))), "'M0': law: the secant modulus is -2"),
        (
            (
                (
                    0.0,
                    LawParameters(
                        "ogden-thesis",
                        {"c": (1.0,) * 6, "strain_min": (0.1,), "strain_max": (1.0,)},
                    ),
                ),
            ),
            "'M0': law: ogden-thesis is not stress-free",
        ),
    ],
)
def test_no_ladder_no_model(grades: tuple[tuple[float, LawParameters], ...], words: str) -> None:
    with pytest.raises(PaletteError, match=words):
        CoefficientModel(palette(*grades))


def test_arguments_out_of_range() -> None:
    for m in (-1e-9, LAST + 1e-9, np.nan, [0.5, 2.0]):
        with pytest.raises(ArgumentError, match=r"goes from 0 to 1\.5"):
            CONNEX3.modulus_MPa(m, 0.1)
    for strain in (-1.0, np.nan, np.inf):
        with pytest.raises(ArgumentError, match="stretch"):
            CONNEX3.modulus_MPa(0.5, strain)
    for level in (0.0, 1.0, np.nan):
        with pytest.raises(ArgumentError, match="level"):
            CONNEX3.modulus_interval_MPa(0.5, 0.1, level)
