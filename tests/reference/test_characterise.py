"""Figures of a curve against the truth: synthetic curves, the thesis, statistics, real data."""

import csv
import importlib.util
import io
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from planner.materials.characterise import (
    Curve,
    characterise_curve,
    characterise_material,
    deformation,
    spread_of,
    toe_compensated,
)
from planner.materials.palette_study import characterise
from planner.materials.study import read_study

ROOT = Path(__file__).resolve().parents[2]
MARECHAL = ROOT.parent / "shared" / "data" / "elastomers" / "marechal" / "Tensile-Tests-Data"


def rigid(modulus: float, toe: float, noise: float = 0.0, seed: int = 0) -> Curve:
    """A quadratic toe that ends on the line through zero at `toe`, a line, a rounded yield."""
    strain = np.linspace(0.0, 0.15, 1501)
    x = np.where(strain < 2 * toe, strain**2 / (4 * max(toe, 1e-9)), strain - toe)
    line, knee, width = modulus * x, 30.0, 20.0
    stress = np.where(line < knee, line, knee + width * np.tanh((line - knee) / width))
    stress += noise * np.random.default_rng(seed).standard_normal(len(strain))
    return Curve("s", strain, stress)


@pytest.mark.parametrize("modulus", [300.0, 1000.0])
@pytest.mark.parametrize("toe", [0.0, 0.002, 0.01])
def test_linear_part_is_exact_without_noise(modulus: float, toe: float) -> None:
    part = characterise_curve(rigid(modulus, toe))
    # 0.2 %: the linear part may take in rounded ends whose slope is within 5 % of the line's.
    assert part.modulus_MPa == pytest.approx(modulus, rel=2e-3)
    # 1e-4 of strain: one step of the record.
    assert part.toe_strain == pytest.approx(toe, abs=1e-4)


@pytest.mark.parametrize("toe", [0.0, 0.01])
def test_linear_part_with_noise(toe: float) -> None:
    parts = [characterise_curve(rigid(300.0, toe, noise=0.25, seed=seed)) for seed in range(20)]
    moduli = np.array([part.modulus_MPa for part in parts])
    # Noise of 0.5 % of the strength: the part reaches a little over its ends, to the soft side.
    assert abs(moduli.mean() / 300.0 - 1.0) < 0.01
    assert moduli.std() / 300.0 < 0.005
    # 5e-4: five steps of the record, for the same reason.
    np.testing.assert_allclose([part.toe_strain for part in parts], toe, atol=5e-4)


def test_uncompensated_modulus_is_the_chord_over_the_toe() -> None:
    found = characterise_curve(rigid(300.0, 0.01))
    low, high = found.linear_strain
    # The chord's stress is the line's at its end; 1e-9: the same arithmetic.
    expected = found.modulus_MPa * high / (high + found.toe_strain)
    assert found.modulus_uncompensated_MPa == pytest.approx(expected, rel=1e-9)
    assert found.modulus_uncompensated_MPa < 0.95 * found.modulus_MPa
    assert low < high


def test_compensated_curve_starts_at_zero_and_has_no_toe_left() -> None:
    shifted = toe_compensated(rigid(300.0, 0.01))
    assert 0.0 <= shifted.strain[0] < 1e-4
    assert characterise_curve(shifted).toe_strain < 1e-3
    assert "ASTM D638" in shifted.notes[-1]
    rubber = neo_hookean()
    assert toe_compensated(rubber) is rubber


def neo_hookean(noise: float = 0.0, seed: int = 0) -> Curve:
    strain = np.linspace(0.0, 1.5, 301)
    stress = 0.2 * (1.0 + strain - (1.0 + strain) ** -2.0)
    return Curve(
        "r", strain, stress + noise * np.random.default_rng(seed).standard_normal(len(strain))
    )


def test_a_rubber_gives_its_initial_modulus_and_is_not_shifted() -> None:
    # Young's modulus of an incompressible neo-Hookean solid is 3 mu = 0.6 MPa.
    found = characterise_curve(neo_hookean())
    # 1e-6: Mooney's form holds the neo-Hookean solid, up to rounding.
    assert found.modulus_MPa == pytest.approx(0.6, rel=1e-6)
    assert found.toe_strain == 0.0
    noisy = [characterise_curve(neo_hookean(0.003, seed)) for seed in range(10)]
    # 10 %: three standard errors of ten slopes of such noise.
    assert np.mean([c.modulus_MPa for c in noisy]) == pytest.approx(0.6, rel=0.1)
    assert all(c.toe_strain == 0.0 for c in noisy)


def test_an_offset_load_is_no_toe() -> None:
    curve = rigid(300.0, 0.0)
    low = Curve("s", curve.strain, curve.stress_MPa - 1.0)
    assert characterise_curve(low).toe_strain == 0.0


@pytest.mark.parametrize("mu_alpha", [(0.4, 2.0), (1.2, 3.0), (-0.6, -1.0)])
def test_the_modulus_of_an_arc_is_the_initial_one(mu_alpha: tuple[float, float]) -> None:
    mu, alpha = mu_alpha
    stretch = 1.0 + np.linspace(0.0, 1.0, 161)
    stress = mu * (stretch ** (alpha - 1.0) - stretch ** (-alpha / 2.0 - 1.0))
    part = characterise_curve(Curve("s", stretch - 1.0, stress))
    # 1 %: Mooney's form, exact for alpha = 2, over the first tenth of the curve.
    assert part.modulus_MPa == pytest.approx(1.5 * mu * alpha, rel=0.01)


@pytest.mark.parametrize("curve", [neo_hookean(), rigid(300.0, 0.0)], ids=["arc", "line"])
def test_without_a_toe_the_uncompensated_modulus_is_the_modulus(curve: Curve) -> None:
    found = characterise_curve(curve)
    assert found.toe_strain == 0.0
    assert found.modulus_uncompensated_MPa == found.modulus_MPa


@pytest.mark.parametrize("share", [0.05, -0.05, 0.0])
def test_a_load_cell_not_zeroed_is_noted(share: float) -> None:
    curve = neo_hookean(0.001)
    offset = share * curve.stress_MPa.max()
    notes = " ".join(characterise_curve(Curve("r", curve.strain, curve.stress_MPa + offset)).notes)
    assert ("may not have been zeroed" in notes) == (share != 0.0)


def test_a_slow_fall_that_counts_as_elongation_is_noted() -> None:
    curve = neo_hookean()
    strain = np.append(curve.strain, np.linspace(1.51, 1.8, 30))
    stress = np.append(curve.stress_MPa, curve.stress_MPa[-1] * np.linspace(0.98, 0.4, 30))
    found = characterise_curve(Curve("r", strain, stress))
    assert found.elongation_at_break == 1.8
    assert "falls slowly from its peak at strain 1.5 to the break at 1.8" in " ".join(found.notes)
    assert "falls slowly" not in " ".join(characterise_curve(curve).notes)


def test_area_elongation_and_secants_are_the_analytic_ones() -> None:
    found = characterise_curve(neo_hookean(), secant_strains=(0.1, 0.5, 2.0))
    # Energy of a neo-Hookean solid: mu/2 (l^2 + 2/l - 3) at stretch 2.5.
    # 1e-4: trapezoids of 0.005 strain.
    assert found.toughness_MJ_m3 == pytest.approx(0.1 * (6.25 + 0.8 - 3.0), rel=1e-4)
    assert found.elongation_at_break == 1.5
    for strain in (0.1, 0.5):
        nominal = 0.2 * (1.0 + strain - (1.0 + strain) ** -2.0)
        # 1e-3: a line through five points of a curve.
        assert found.secant_MPa[strain] == pytest.approx(nominal / strain, rel=1e-3)
    assert found.secant_MPa[2.0] is None


# Thesis, table 3.1: Young's modulus in MPa and elongation at break.
TABLE_3_1 = {
    "TangoPlus": (0.0088, 1.00, "elastic"),
    "FLX9740": (0.0249, 0.90, "elastic"),
    "FLX9750": (0.0141, 0.75, "elastic"),
    "FLX9760": (0.5718, 0.70, "elastic"),
    "FLX9770": (0.3668, 0.65, "elastic"),
    "FLX9785": (2.5499, 0.60, "elastic"),
    "FLX9795": (60.4749, 0.55, "elastic"),
    "RGD8430": (95.5735, 0.30, "plastic"),
    "RGD8425": (159.0943, 0.17, "plastic"),
    "VeroWhitePlus": (342.6460, 0.17, "plastic"),
}


@pytest.mark.parametrize("material", TABLE_3_1)
def test_the_thesis_ten_materials_are_told_apart_as_it_does(material: str) -> None:
    modulus, elongation, kind = TABLE_3_1[material]
    assert deformation(modulus, elongation).kind == kind


def test_a_soft_material_with_a_yield_point_is_plastic() -> None:
    assert deformation(50.0, 2.0, yield_strain=0.3).kind == "plastic"
    # Tearing shortly before the break is no yield point.
    assert deformation(50.0, 2.0, yield_strain=1.9).kind == "elastic"


def test_spread_is_students() -> None:
    # Quantile 0.975 of t with 2 degrees of freedom is 4.302653 (tables); 1e-6: its digits.
    found = spread_of([1.0, 2.0, 3.0])
    assert (found.mean, found.n, found.sd, found.cv) == (2.0, 3, 1.0, 0.5)
    assert found.interval is not None
    assert found.interval[1] - 2.0 == pytest.approx(4.302653 / np.sqrt(3.0), rel=1e-6)
    assert spread_of([1.0]).sd is None


def test_intervals_hold_the_truth_at_their_rate() -> None:
    rng = np.random.default_rng(7)
    held = 0
    for values in rng.normal(5.0, 1.0, size=(1000, 3)):
        interval = spread_of(list(values)).interval
        assert interval is not None
        held += interval[0] <= 5.0 <= interval[1]
    # Binomial of 1000 at 0.95: standard deviation 6.9; four of them.
    assert abs(held - 950) <= 28


def load_sample() -> ModuleType:
    path = ROOT / "samples" / "tensile" / "make_study.py"
    spec = importlib.util.spec_from_file_location("make_study", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_sample_study_gives_back_what_it_was_made_of() -> None:
    sample = load_sample()
    study = read_study([ROOT / "samples" / "tensile"])
    assert {m: len(c) for m, c in study.groups.items()} == {
        "SYN-soft": 3,
        "SYN-medium": 3,
        "SYN-rigid": 3,
    }
    found = {m: characterise_material(m, c) for m, c in study.groups.items()}
    for name, modulus, kind in (
        ("SYN-soft", 3 * sample.SOFT_MU_MPA, "elastic"),
        ("SYN-medium", 1.5 * sample.MEDIUM_MU_MPA * sample.MEDIUM_ALPHA, "elastic"),
        ("SYN-rigid", sample.RIGID_MODULUS_MPA, "plastic"),
    ):
        # Means of three specimens of 4 % spread are 2.3 % uncertain; a rubber's arc adds 5 %.
        assert found[name].spreads["modulus_MPa"].mean == pytest.approx(modulus, rel=0.1)
        assert found[name].deformation.kind == kind
        assert found[name].agree
    toes = [c.toe_strain for c in found["SYN-rigid"].specimens]
    # 1e-3: noise of 0.4 N on the line.
    np.testing.assert_allclose(toes, sample.RIGID_TOE, atol=1e-3)
    for c in found["SYN-rigid"].specimens:
        assert c.yield_strain == pytest.approx(0.13, abs=0.02)  # the fall begins at 0.13


def test_the_sample_files_are_the_scripts() -> None:
    for name, text in load_sample().study().items():
        assert (ROOT / "samples" / "tensile" / name).read_bytes() == text.encode(), name


def test_table_is_readable_and_the_same_twice() -> None:
    study = read_study([ROOT / "samples" / "tensile"])
    found = characterise(study)
    text = found.csv().decode()
    assert text.encode() == characterise(study).csv()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["material"] for row in rows] == ["SYN-soft", "SYN-medium", "SYN-rigid"]
    assert rows[1]["secant_1_MPa"] == ""  # breaks before
    for row in rows:
        assert float(row["modulus_low_MPa"]) < float(row["modulus_MPa"])


def test_treloar_by_position() -> None:
    path = ROOT / "tests" / "data" / "treloar" / "uniaxial.csv"
    study = read_study([path], columns=["stretch", "stress_MPa"])
    found = characterise_curve(study.groups["uniaxial"][0])
    # Treloar's rubber breaks at a stretch of 7.5 under some 5.6 MPa; its table ends there.
    assert found.elongation_at_break == pytest.approx(6.512)
    assert found.strength_MPa == pytest.approx(5.5639)
    # Between the secant over the first two points and twice that; mu is about 0.4 MPa, E 1.2.
    assert 0.5 < found.modulus_MPa < 1.4
    assert found.deformation.kind == "elastic"


@pytest.mark.skipif(not MARECHAL.is_dir(), reason="the shared data are not there")
def test_nineteen_silicones_are_read_as_they_are() -> None:
    study = read_study([MARECHAL])
    assert len(study.groups) == 19
    for material, curves in study.groups.items():
        found = characterise_material(material, curves, secant_strains=(0.5, 1.0))
        assert found.deformation.kind == "elastic", material
        assert all(c.toe_strain == 0.0 for c in found.specimens), material
        # Suppliers' moduli at 100 % of these grades are 0.01 to 1 MPa.
        assert 0.003 < found.spreads["secant_1_MPa"].mean < 1.0, material
        # The initial slope is no less than half of, nor thrice, the secant at 50 %: rubbers soften.
        ratio = found.spreads["modulus_MPa"].mean / found.spreads["secant_0.5_MPa"].mean
        assert 0.5 < ratio < 3.0, material
