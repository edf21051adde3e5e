"""The coefficient model over random palettes and over the Connex3's: what holds everywhere."""

from dataclasses import replace
from itertools import pairwise
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from planner.errors import ArgumentError, Caution, PaletteError
from planner.materials.laws import make_law, secant_modulus_MPa
from planner.materials.mixtures import (
    CoefficientModel,
    _coordinates_at,
    gent_modulus_MPa,
    left_out_errors,
    nearest_on,
    pchip_slopes,
    places_of,
)
from planner.numerics import FloatArray
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
    lower, upper, _ = CONNEX3.bracket(m)
    ladder = CONNEX3.grade_moduli_MPa(strain)
    modulus = float(CONNEX3.modulus_MPa(m, strain))
    # 1e-14: roundings of two powers.
    assert ladder[lower] * (1 - 1e-14) <= modulus <= ladder[upper] * (1 + 1e-14)


ladders = st.lists(
    st.tuples(st.floats(0.01, 3.0), st.floats(0.01, 3.0)), min_size=1, max_size=6
)  # of gaps in m and of steps in ln(modulus)


def laddered(steps: list[tuple[float, float]]) -> CoefficientModel:
    m, log_modulus = np.concatenate([[(0.0, 0.0)], np.cumsum(steps, axis=0)]).T
    moduli = np.exp(log_modulus)
    return CoefficientModel(palette(*((c, linear(E)) for c, E in zip(m, moduli, strict=True))))


def test_between_grades_it_is_the_monotone_cubic_of_fritsch_and_butland() -> None:
    """Over the place, which is one too, of Gent's logarithm over m, as far as hardness is known."""
    m, strains = np.linspace(0.0, LAST, 301), np.linspace(0.0, 0.55, 56)
    ladder = np.log(CONNEX3.grade_moduli_MPa(strains))
    known, shore = np.array(CONNEX3.palette.hardness).T
    scale = PchipInterpolator(known, [np.log(gent_modulus_MPa(s)) for s in shore])

    def place(at: FloatArray) -> FloatArray:
        inside = np.minimum(at, known[-1])
        return np.asarray(scale(inside) + scale(known[-1], 1) * (at - inside))

    expected = PchipInterpolator(place(CONNEX3.coordinates), ladder, axis=0)(place(m))
    found = np.log(CONNEX3.modulus_MPa(m[:, None], strains))
    np.testing.assert_allclose(found, expected, atol=1e-12)


@settings(deadline=None, derandomize=True)
@given(steps=ladders, share=st.floats(0.0, 1.0))
def test_any_ladder_is_followed_as_scipy_does_it_and_undone(
    steps: list[tuple[float, float]], share: float
) -> None:
    model = laddered(steps)
    c = model.coordinates
    ladder = np.log(model.grade_moduli_MPa(0.1))
    m = np.clip(c[0] + np.sort([share, 0.1, 0.3, 0.8]) * (c[-1] - c[0]), c[0], c[-1])
    moduli = model.modulus_MPa(m, 0.1)
    np.testing.assert_allclose(np.log(moduli), PchipInterpolator(c, ladder)(m), atol=1e-12)
    # 1e-14: roundings of an exponential, where it hardly rises.
    assert (np.diff(moduli) >= -1e-14 * moduli[1:]).all()
    # In stiffness: at an end without slope the coordinate itself is worth less.
    back = model.modulus_MPa(model.coordinate_for(moduli, 0.1), 0.1)
    np.testing.assert_allclose(back, moduli, rtol=1e-12)


@settings(deadline=None, derandomize=True)
@given(
    gaps=st.lists(st.floats(0.01, 3.0), min_size=1, max_size=6),
    seed=st.integers(0, 2**32 - 1),
)
def test_slopes_are_scipys_whatever_the_order(gaps: list[float], seed: int) -> None:
    c = np.concatenate([[0.0], np.cumsum(gaps)])
    values, ways = np.random.default_rng(seed).standard_normal((2, len(c), 7))
    expected = PchipInterpolator(c, values, axis=0).derivative()(c)
    # Steps of up to 4 over gaps of 0.01 and more.
    np.testing.assert_allclose(pchip_slopes(c, values), expected, atol=1e-11 / min(gaps))
    # A complex step gives their derivative.
    near = [pchip_slopes(c, values + s * 1e-6 * ways) for s in (-1.0, 1.0)]
    with_step = pchip_slopes(c, values + 1e-30j * ways).imag * 1e30
    settled = np.sign(near[0]) == np.sign(near[1])
    # Central differences; some steps pass so close to 0 that theirs are rough.
    rough = np.abs((near[1] - near[0]) / 2e-6 - with_step)[settled]
    assert np.quantile(rough, 0.9) < 1e-4 / min(gaps)


HARDNESS = ((0.0, 30.0), (0.2, 60.0), (1.0, 90.0))


@settings(deadline=None, derandomize=True)
@given(
    place=st.floats(0.0, 1.0),
    moduli=st.lists(st.floats(0.01, 3.0), min_size=3, max_size=3),
    ends=st.tuples(st.floats(-1.0, 0.1), st.floats(0.3, 2.0)),
)
def test_hardness_of_other_mixtures_moves_what_lies_between(
    place: float, moduli: list[float], ends: tuple[float, float]
) -> None:
    """Grades in and out of the table: rising, exact at the grades, undone."""
    c = np.array([ends[0], 0.2, ends[1]])
    ladder = np.exp(np.cumsum(moduli))
    grades = zip(c.tolist(), ladder.tolist(), strict=True)
    model = CoefficientModel(
        replace(palette(*((m, linear(E)) for m, E in grades)), hardness=HARDNESS)
    )
    m = np.clip(c[0] + np.sort([place, 0.05, 0.4, 0.9]) * (c[-1] - c[0]), c[0], c[-1])
    found = model.modulus_MPa(m, 0.1)
    assert (model.modulus_MPa(c, 0.1) == model.grade_moduli_MPa(0.1)).all()
    # 1e-13: roundings of an exponential, where the modulus hardly rises.
    assert (np.diff(found) >= -1e-13 * found[1:]).all()
    back = model.modulus_MPa(model.coordinate_for(found, 0.1), 0.1)
    np.testing.assert_allclose(back, found, rtol=1e-12)


SCALES = [CONNEX3.palette.hardness, (), ((0.0, 30.0), (1.0, 32.0), (2.0, 60.0), (3.0, 62.0))]
"""The last one is so flat at its ends that parabolas there do not rise."""


@given(m=st.floats(-50.0, 2.0 * LAST), hardness=st.sampled_from(SCALES))
def test_a_coordinate_has_one_place(m: float, hardness: tuple[tuple[float, float], ...]) -> None:
    """Also beyond the mixtures whose hardness is known, where either end goes on by its own slope.

    1e-9: places are found by Newton's method to rounding, times slopes of a few hundred at most.
    """
    assert _coordinates_at(hardness, places_of(hardness, m)) == pytest.approx(m, abs=1e-9)


def test_rubbers_as_stiff_as_their_hardness_says_need_no_test_between() -> None:
    """Of moduli that are Gent's, each grade's is found from the others whatever its coordinate."""
    shore = dict(HARDNESS)
    ends = palette(*((m, linear(gent_modulus_MPa(shore[m]))) for m in (0.0, 1.0)))
    model = CoefficientModel(replace(ends, hardness=HARDNESS))
    assert float(model.modulus_MPa(0.2, 0.1)) == pytest.approx(gent_modulus_MPa(60.0), rel=1e-12)


def test_one_cubic_between_two_grades_is_the_straight_line() -> None:
    model = laddered([(0.5, 2.0)])
    np.testing.assert_allclose(
        np.log(model.modulus_MPa([0.1, 0.25, 0.4], 0.1)), [0.4, 1.0, 1.6], rtol=1e-14
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
@given(m=coordinates, strain=st.floats(0.0, 0.55))
def test_interval_encloses_the_modulus_within_those_of_the_grades(m: float, strain: float) -> None:
    low, high = CONNEX3.modulus_interval_MPa(m, strain)
    modulus = float(CONNEX3.modulus_MPa(m, strain))
    assert 0.0 < low < modulus < high
    # It ends where those of the two grades end, and is even in the logarithm if it does not and
    # no other reading reaches farther to one side.
    grades = CONNEX3.coordinates[list(map(int, CONNEX3.bracket(m)[:2]))]
    ends = CONNEX3.modulus_interval_MPa(grades, strain)
    assert ends[0].min() <= low
    assert high <= ends[1].max()
    alone = not any(CONNEX3.palette.materials[int(k)].readings for k in CONNEX3.bracket(m)[:2])
    if alone and ends[0].min() < low and high < ends[1].max():
        assert low * high == pytest.approx(modulus**2, rel=1e-12)


def test_interval_at_a_grade_is_the_grades_own() -> None:
    low, high = CONNEX3.modulus_interval_MPa(CONNEX3.coordinates, 0.1)
    log_sd = np.log(high / low) / 2.0 / NormalDist().inv_cdf(0.975)
    expected = [m.modulus_log_sd for m in CONNEX3.palette.materials if not m.readings]
    np.testing.assert_allclose(log_sd[: len(expected)], expected, rtol=1e-12)


@pytest.mark.parametrize("strain", [0.0, 0.02, 0.1, 0.17])
def test_an_interval_holds_those_of_all_readings(strain: float) -> None:
    normal = NormalDist().inv_cdf(0.975)
    low, high = CONNEX3.modulus_interval_MPa(CONNEX3.coordinates, strain)
    for k, material in enumerate(CONNEX3.palette.materials):
        read = [(make_law(one.law), one.modulus_log_sd) for one in material.readings]
        laws = [(CONNEX3.laws[k], material.modulus_log_sd), *read]
        moduli = np.array([float(secant_modulus_MPa(law, strain)) for law, _ in laws])
        widths = np.exp(normal * np.array([sd for _, sd in laws]))
        assert low[k] == pytest.approx((moduli / widths).min(), rel=1e-12)
        assert high[k] == pytest.approx((moduli * widths).max(), rel=1e-12)


def test_rigid_grades_hold_what_crosshead_and_extensometer_found() -> None:
    """At rest: 95.6 and 343 MPa (the thesis), 1.4 to 2.5 and 2.0 to 2.5 GPa (extensometer)."""
    low, high = CONNEX3.modulus_interval_MPa(CONNEX3.coordinates[[7, 9]], 0.0)
    assert (low < [95.6, 343.0]).all()
    assert (high > 2500.0).all()


def test_a_grade_beyond_its_break_has_the_secant_at_its_break() -> None:
    for place, material in zip(CONNEX3.coordinates, CONNEX3.palette.materials, strict=True):
        at = min(0.4, material.elongation_at_break)
        assert CONNEX3.modulus_MPa(place, 0.4) == CONNEX3.modulus_MPa(place, at)
    # The law itself goes on: a simulation follows it there and says so.
    rigid = CONNEX3.laws[9]
    beyond = CONNEX3.nominal_stress_MPa(1.5, 1.4)
    assert float(beyond) == pytest.approx(float(rigid.nominal_stress_MPa(1.4)), rel=1e-12)


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


def test_wiener_variance_is_that_of_the_model_without_each_grade() -> None:
    squares, materials = [], CONNEX3.palette.materials
    for k in range(1, len(materials) - 1):
        kept = (*materials[:k], *materials[k + 1 :])
        others = CoefficientModel(replace(CONNEX3.palette, materials=kept), chosen=True)
        m = float(CONNEX3.coordinates[k])
        off = np.log(CONNEX3.modulus_MPa(m, 0.1) / others.modulus_MPa(m, 0.1))
        before, after = np.diff(CONNEX3.places)[k - 1 : k + 1]
        squares.append(off**2 * (before + after) / (before * after))
    assert float(CONNEX3.wiener_variance(0.1)) == pytest.approx(np.mean(squares), rel=1e-12)


def test_left_out_over_m_is_pchip_of_the_logarithm_of_stress() -> None:
    """At one strain ln(stress) is ln(secant) and a constant."""
    materials, off = CONNEX3.palette.materials, []
    for k in range(1, len(materials) - 1):
        strain = np.linspace(0.0, materials[k].elongation_at_break, 41)[1:]
        held = [np.minimum(strain, one.elongation_at_break) for one in materials]
        rows = zip(CONNEX3.laws, held, strict=True)
        stress = np.stack([strain * secant_modulus_MPa(law, e) for law, e in rows])
        others = np.delete(CONNEX3.coordinates, k), np.log(np.delete(stress, k, axis=0))
        found = np.exp(PchipInterpolator(*others)(CONNEX3.coordinates[k]))
        off.append(np.sqrt(np.mean((found - stress[k]) ** 2)) / stress[k].max())
    assert left_out_errors(CONNEX3.palette)["coordinate"] == pytest.approx(np.mean(off), rel=1e-9)


def test_an_even_ladder_leaves_no_doubt_between_grades() -> None:
    model = CoefficientModel(palette(*((k / 6, linear(2.0**k)) for k in range(5))))
    assert float(model.wiener_variance(0.1)) == pytest.approx(0.0, abs=1e-28)


def test_two_grades_know_but_one_step() -> None:
    model = CoefficientModel(palette((0.0, linear(1.0)), (0.5, linear(np.e**2))))
    # Half-way the variance of a uniform place on a step of 2: 2^2 / 12, over t (1 - t) gap.
    assert float(model.wiener_variance(0.1)) == pytest.approx(4.0 / 12.0 / (0.25 * 0.5), rel=1e-12)
    assert model.wiener_variance([0.1, 0.2]).shape == (2,)
    low, high = model.modulus_interval_MPa([0.05, 0.25, 0.45], 0.1)
    assert (low >= 1.0).all()
    assert (high <= np.e**2).all()
    # 1.96 sqrt(4 / 12) is more than half a step: the middle may be anything between the two.
    assert (low[1], high[1]) == (1.0, pytest.approx(np.e**2))


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


def test_laws_that_cross_are_planned_with_where_they_rise() -> None:
    """Stiffer at rest, softer at 50 %: refused there alone, unless the intervals hold both."""
    grades = ((0.0, linear(2.9)), (1.0, ogden(-1.0, -2.0)))
    sure = CoefficientModel(palette(*grades))
    np.testing.assert_array_equal(sure.ladder_MPa(0.0), sure.grade_moduli_MPa(0.0))
    with pytest.raises(
        PaletteError, match=r"M1 .* is not stiffer than M0 .* at strain 0\.5; .* 0 to"
    ):
        sure.ladder_MPa(0.5)
    assert [type(said) for said in sure.remarks()] == [Caution]
    assert not [*sure.remarks({"M1"})]
    unsure = CoefficientModel(palette(*grades, log_sd=0.5))
    assert unsure.ladder_MPa(0.5).tolist() == [2.9, 2.9]
    assert float(unsure.modulus_MPa(1.0, 0.5)) < 2.9  # the law stays as it is
    (said,) = unsure.remarks()
    assert not isinstance(said, Caution)
    assert "within their intervals; planned as equal" in said


@settings(deadline=None, derandomize=True)
@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=6), st.floats(0.1, 10.0))
def test_grades_within_their_intervals_make_a_ladder_in_any_order(
    moduli: list[float], wanted: float
) -> None:
    grades = ((float(k), linear(modulus)) for k, modulus in enumerate(moduli))
    model = CoefficientModel(palette(*grades, log_sd=5.0))
    ladder = model.ladder_MPa(0.1)
    assert (np.diff(ladder) >= 0.0).all()
    np.testing.assert_allclose(ladder, np.maximum.accumulate(moduli))
    off = np.abs(np.log(ladder / wanted))
    assert off[nearest_on(model.ladder_MPa(0.1), wanted)] == pytest.approx(off.min())
    assert 0.0 <= model.coordinate_for(wanted, 0.1) <= len(moduli) - 1


def test_mixtures_whose_stress_would_fall_are_told() -> None:
    """Two grades soften to the end, where the third, which stiffens, draws away."""
    yeoh = [(0.22, -0.019, -0.036), (0.873, -0.191, -0.209), (1.144, 2.842, 0.258)]
    grades = [(float(k), LawParameters("yeoh", {"c_MPa": c})) for k, c in enumerate(yeoh)]
    assert not [*CoefficientModel(palette(*grades[:2])).remarks()]
    three = palette(*grades)
    further = tuple(replace(m, elongation_at_break=0.6) for m in three.materials)
    said = [*CoefficientModel(replace(three, materials=further)).remarks()]
    assert any("between M0 and M1 the stress of a mixture falls" in one for one in said)
    assert all(isinstance(one, Caution) for one in said)


def test_arguments_out_of_range() -> None:
    for m in (-1e-9, LAST + 1e-9, np.nan, [0.5, 2.0]):
        with pytest.raises(ArgumentError, match=r"goes from 0 to 1\.5"):
            CONNEX3.modulus_MPa(m, 0.1)
    for strain in (-1.0, np.nan, np.inf):
        with pytest.raises(ArgumentError, match="stretch"):
            CONNEX3.modulus_MPa(0.5, strain)
