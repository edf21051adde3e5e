"""Rigid grades: one measure of stiffness, fitted from their own curves, and said past the break."""

import numpy as np
import pytest
from numpy.typing import NDArray

import planner
from planner.errors import ArgumentError, PaletteError
from planner.grading.invert import invert
from planner.grading.profile import list_materials
from planner.materials.characterise import Curve, characterise_material
from planner.materials.fit import ASSUMED_LOG_SD, fit_material
from planner.materials.laws import Yielding, candidate_laws, make_law, secant_modulus_MPa
from planner.palette import encode_palette, parse_palette
from planner.simulation.bar_solver import law_tables
from planner.simulation.simulate import simulate

LAW = Yielding(1475.0, 36.0, 15.0, 3.0)


def specimens(rng: np.random.Generator, law: Yielding = LAW, spread: float = 0.03) -> list[Curve]:
    """Three curves of a law to strain 0.15, of different levels, with a load cell's noise."""
    curves = []
    for k in range(3):
        strain = np.linspace(0.0, 0.15, 400)
        stress = law.nominal_stress_MPa(1.0 + strain) * np.exp(spread * rng.standard_normal())
        curves.append(Curve(f"S{k}", strain, stress + 0.05 * rng.standard_normal(len(strain))))
    return curves


def test_a_law_that_yields_is_smooth_odd_and_rises() -> None:
    stretch = np.linspace(0.6, 1.8, 24001)
    stress = LAW.nominal_stress_MPa(stretch)
    # Central differences over 5e-5: their error is the third derivative's, below 0.1 MPa.
    np.testing.assert_allclose(
        np.gradient(stress, stretch)[1:-1], LAW.tangent_MPa(stretch)[1:-1], atol=0.1
    )
    assert (LAW.tangent_MPa(stretch) >= LAW.hardening_MPa).all()
    strain = np.linspace(0.0, 0.4, 41)
    np.testing.assert_allclose(
        LAW.nominal_stress_MPa(1.0 - strain), -LAW.nominal_stress_MPa(1.0 + strain), rtol=1e-12
    )
    assert float(LAW.tangent_MPa(1.0)) == LAW.modulus_MPa
    # Far behind the yield: Y + H e.
    assert float(LAW.nominal_stress_MPa(1.8)) == pytest.approx(36.0 + 15.0 * 0.8, rel=1e-4)


WRONG = (
    (-1.0, 36.0, 15.0, 3.0),
    (1475.0, 0.0, 15.0, 3.0),
    (1475.0, 36.0, 1475.0, 3.0),
    (1475.0, 36.0, 15.0, 0.0),
)


@pytest.mark.parametrize("wrong", WRONG)
def test_parameters_without_a_yield_are_refused(wrong: tuple[float, ...]) -> None:
    with pytest.raises(ArgumentError, match="law 'yielding': flow_MPa and sharpness"):
        Yielding(*wrong)


@pytest.mark.parametrize("strain", [0.01, 0.02, 0.05, 0.1, 0.14])
def test_a_plastic_materials_secant_is_that_of_its_curves(strain: float) -> None:
    """A triplicate whose secant at 0.1 is 374 MPa was listed with its modulus at rest, 1475."""
    curves = specimens(np.random.default_rng(3))
    fit = fit_material("S", curves, candidate_laws("all"))
    measured = characterise_material("S", curves, secant_strains=[strain])
    mean = measured.spreads[f"secant_{strain:g}_MPa"].mean
    # The modulus is the slope of the linear part, which noise of 0.05 MPa moves by 2 %; behind the
    # knee what is left is the bins' width.
    assert float(secant_modulus_MPa(make_law(fit.law), strain)) == pytest.approx(mean, rel=0.03)
    assert fit.law.model == "yielding"


def test_the_fit_gives_the_law_back_and_its_intervals_hold_it() -> None:
    curves = specimens(np.random.default_rng(5))
    fit = fit_material("S", curves, candidate_laws("all"))
    known = fit.uncertainty
    for symbol in ("modulus_MPa", "flow_MPa"):
        low, high = known.law_low[symbol][0], known.law_high[symbol][0]
        assert low < getattr(LAW, symbol) < high
        # Student's t of three specimens that scatter by 3 %: about 15 %.
        assert 1.0 < high / low < 1.4
    assert known.r2 is not None
    assert known.r2 > 0.99
    assert [one.strain for one in fit.secants] == [0.0, 0.1]
    for one in fit.secants:
        true = float(secant_modulus_MPa(LAW, one.strain))
        assert one.low_MPa < true < one.high_MPa
        assert 1.0 < one.high_MPa / one.low_MPa < 1.4


@pytest.mark.parametrize("records", [1, 3])
def test_one_record_tells_nothing_of_the_scatter(records: int) -> None:
    """Rigid or not: intervals are open, and never of no width."""
    curves = specimens(np.random.default_rng(5))[:1] * records
    fit = fit_material("S", curves, candidate_laws("all"))
    assert {v for values in fit.uncertainty.law_low.values() for v in values} == {0.0}
    assert {v for values in fit.uncertainty.law_high.values() for v in values} == {np.inf}
    assert {(one.low_MPa, one.high_MPa) for one in fit.secants} == {(0.0, np.inf)}
    assert fit.uncertainty.basis.startswith("unknown: ")
    assert fit.scatter.between == ASSUMED_LOG_SD


def test_a_fall_behind_the_yield_is_told_and_the_law_rises() -> None:
    strain = np.linspace(0.0, 0.2, 500)
    stress = Yielding(1475.0, 36.0, 5.0, 6.0).nominal_stress_MPa(1.0 + strain)
    stress = stress - 100.0 * np.maximum(strain - 0.08, 0.0)
    fit = fit_material("S", [Curve("S1", strain, stress)], candidate_laws("all"))
    law = make_law(fit.law)
    assert (law.tangent_MPa(np.linspace(0.6, 1.5, 901)) > 0.0).all()
    assert any("falls by up to" in note and "behind the yield" in note for note in fit.notes)


def text_of(law: str, extra: str = "") -> bytes:
    return (
        'schema = 1\nname = "t"\nkind = "palette"\n'
        '[[material]]\nid = "soft"\ncoordinate = 0.0\nelongation_at_break = 0.8\n'
        'density_g_cm3 = 1.1\n[material.law]\nmodel = "neo-hookean"\nmu_MPa = 1.0\n'
        '[[material]]\nid = "hard"\ncoordinate = 1.0\nelongation_at_break = 0.2\n'
        f'density_g_cm3 = 1.1\ndeformation = "plastic"\n[material.law]\n{law}\n{extra}'
    ).encode()


YIELDING = (
    'model = "yielding"\nmodulus_MPa = 1475.0\nflow_MPa = 36.0\nhardening_MPa = 15.0\n'
    "sharpness = 3.0"
)


def test_palette_files_hold_yield_and_readings() -> None:
    reading = (
        '[[material.reading]]\nname = "extensometer"\nmodulus_log_sd = 0.1\n'
        'source = "there"\n[material.reading.law]\nmodel = "linear"\nmodulus_MPa = 2000.0\n'
    )
    palette = parse_palette(text_of(YIELDING, reading), name="t")
    hard = palette.materials[1]
    assert make_law(hard.law) == LAW
    assert hard.readings[0].law.parameters["modulus_MPa"] == (2000.0,)
    again = parse_palette(encode_palette(palette), name="t")
    assert again.materials == palette.materials
    with pytest.raises(PaletteError, match="reading: law: unknown key 'modulus'"):
        parse_palette(text_of(YIELDING, reading.replace("modulus_MPa", "modulus")), name="t")


def test_solvers_follow_the_law_behind_its_yield() -> None:
    palette = parse_palette(text_of(YIELDING), name="t")
    strain = np.linspace(0.001, 0.19, 50)
    stress, tangent = law_tables(palette).stress_and_tangent_MPa(1.0, strain)
    # The tables' cubics over 0.002 of strain, across the knee at 0.025.
    np.testing.assert_allclose(stress, LAW.nominal_stress_MPa(1.0 + strain), rtol=1e-4)
    np.testing.assert_allclose(tangent, LAW.tangent_MPa(1.0 + strain), rtol=0.02, atol=0.5)


def test_a_grade_with_a_yield_draws_no_warning_of_a_bound() -> None:
    def notes(law: str) -> tuple[str, ...]:
        palette = parse_palette(text_of(law), name="t")
        return simulate("hard", to_strain=0.1, steps=5, palette=palette).notes

    assert not any("upper bound" in note for note in notes(YIELDING))
    assert any("upper bound" in note for note in notes('model = "linear"\nmodulus_MPa = 1475.0'))


def test_a_strain_past_a_break_is_said_wherever_a_stiffness_is_shown() -> None:
    scale = list_materials(at_strain=0.3)
    said = [note for note in scale.remarks() if "past the break" in note]
    assert len(said) == 1
    assert "RGD8425 (0.17), VeroWhitePlus (0.17)" in said[0]
    assert not any("past the break" in note for note in list_materials(at_strain=0.17).remarks())
    # What is shown is the secant at the break.
    assert scale.modulus_of("VeroWhitePlus") == list_materials(at_strain=0.17).modulus_of(
        "VeroWhitePlus"
    )
    found = invert(300.0, at_strain=0.3)
    assert any("past the break" in note for note in found.notes)
    assert not invert(2.0, at_strain=0.3).notes
    cube = _cube()
    hard = planner.grade(cube, from_="RGD8425", to="VeroWhitePlus", axis="x", at_strain=0.3)
    assert any("past the break" in warning for warning in hard.warnings)
    soft = planner.grade(cube, from_="FLX9750", to="FLX9760", axis="x", at_strain=0.3)
    assert soft.warnings == ()


def _cube() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    corners = np.array([[x, y, z] for x in (0.0, 30.0) for y in (0.0, 10.0) for z in (0.0, 10.0)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
             [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    return corners, np.array(faces)


def test_both_readings_are_said_and_can_be_chosen() -> None:
    """95.6 MPa by crosshead, some 1.9 GPa by extensometer: RGD8430 at rest."""
    said = [note for note in list_materials().remarks() if "extensometer" in note]
    assert len(said) == 1
    assert "RGD8430 to VeroWhitePlus are 1.4 to 2.1 times as stiff" in said[0]
    other = list_materials(palette="connex3-tango-vero-extensometer")
    assert other.modulus_of("RGD8430") == pytest.approx(202.1, abs=0.1)
    assert other.modulus_of("TangoPlus") == list_materials().modulus_of("TangoPlus")
    for ours, theirs in zip(list_materials().intervals_MPa, other.intervals_MPa, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-6)


def test_a_published_law_of_the_thesis_stays_refused() -> None:
    published = planner.list_materials().palette.resolve("FLX9760").published
    assert published is not None
    with pytest.raises(ArgumentError, match="law 'ogden-thesis'"):
        make_law(published)


def test_a_palette_with_an_unsound_law_is_read_and_told() -> None:
    """TangoPlus' law as it was: in compression its true stress turns at stretch 0.724."""
    unsound = 'model = "ogden"\nmu_MPa = [0.2631345, 0.4236421]\nalpha = [-1.5, 1.5]'
    soft = b'model = "neo-hookean"\nmu_MPa = 1.0'
    palette = parse_palette(text_of(YIELDING).replace(soft, unsound.encode()), name="t")
    (said,) = [note for note in list_materials(palette=palette).remarks() if "Drucker" in note]
    assert said.startswith("soft: ")
    assert "uniaxial 0.724 to 1.37" in said
    assert not any("Drucker" in note for note in list_materials().remarks())
