"""The shipped palette is what derive.py makes of the thesis, and is what it says."""

import importlib.util
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from planner.materials.laws import (
    Ogden,
    Yielding,
    make_law,
    stability,
)
from planner.palette import Material, parse_palette
from planner.printers import load_printer
from printers.connex3.curve_fit import (
    TOLERANCE,
    fit_ogden,
    fit_yielding,
    is_a_rubbers,
    over_neo_hooke,
    relative_rms,
    rubber_over_neo_hooke,
)
from printers.connex3.derive import (
    EXTENSOMETER_PALETTE,
    PALETTE,
    fit_strains,
    palette_bytes,
    reading_log_sd,
)
from printers.connex3.thesis import Published, load_thesis
from printers.connex3.toe import correct

THESIS = load_thesis()
SHIPPED = parse_palette(PALETTE.read_bytes(), name=PALETTE.name)
ELASTIC = [
    pytest.param(p, m, id=p.id) for p, m in zip(THESIS.elastomers, SHIPPED.materials, strict=False)
]


def test_derive_makes_the_shipped_palette() -> None:
    assert palette_bytes() == PALETTE.read_bytes()
    assert palette_bytes("extensometer") == EXTENSOMETER_PALETTE.read_bytes()


def test_the_two_palettes_differ_in_what_stands_first_alone() -> None:
    other = parse_palette(EXTENSOMETER_PALETTE.read_bytes(), name=EXTENSOMETER_PALETTE.name)
    for ours, theirs in zip(SHIPPED.materials, other.materials, strict=True):
        if ours.deformation == "elastic":
            assert ours == theirs
            continue
        assert [r.name for r in ours.readings] == ["extensometer"]
        assert [r.name for r in theirs.readings] == ["crosshead"]
        assert (theirs.law, ours.law) == (ours.readings[0].law, theirs.readings[0].law)


@pytest.mark.parametrize("reading", ["crosshead", "extensometer"])
def test_yield_from_toughness_has_the_printed_toughness(reading: str) -> None:
    """The area under the law to the break is Table 3.1's, where a law was derived from it."""
    file = PALETTE if reading == "crosshead" else EXTENSOMETER_PALETTE
    palette = parse_palette(file.read_bytes(), name=file.name)
    derived = {"crosshead": ["VeroWhitePlus"], "extensometer": ["RGD8430", "RGD8425"]}[reading]
    for published in THESIS.materials:
        if published.id not in derived:
            continue
        law = make_law(palette.resolve(published.id).law)
        strain = np.linspace(0.0, published.elongation_at_break, 4001)
        area = np.trapezoid(law.nominal_stress_MPa(1.0 + strain), strain)
        # Parameters are written to seven digits; the area is summed on twice as many points.
        assert area == pytest.approx(published.toughness_MJ_m3, rel=1e-5)


def test_order_and_coordinates() -> None:
    assert [m.id for m in SHIPPED.materials] == [p.id for p in THESIS.materials]
    # Palette files hold nine digits.
    np.testing.assert_allclose(
        [m.coordinate for m in SHIPPED.materials], np.arange(10) / 6, rtol=1e-8
    )
    brightness = [
        sum(w * int(m.colour[i : i + 2], 16) for w, i in ((0.2126, 1), (0.7152, 3), (0.0722, 5)))
        for m in SHIPPED.materials
    ]
    assert all(softer > harder for softer, harder in pairwise(brightness))


@pytest.mark.parametrize(("published", "material"), ELASTIC)
def test_the_law_follows_the_corrected_curve(published: Published, material: Material) -> None:
    curve = correct(published)
    strain = fit_strains(curve)
    law = make_law(material.law)
    assert relative_rms(law, strain, curve.nominal_stress_MPa(strain)) <= TOLERANCE
    # Sound in compression, planar and equibiaxial loading too: 0.6 is 40 % compression.
    found = stability(law, published.elongation_at_break)
    assert not found.limits
    at_rest = float(law.tangent_MPa(1.0))
    if published.id == "FLX9795":  # bends over as a plastic does: no energy
        assert isinstance(law, Yielding)
        # As at the others, but bending from rest on: within the doubt that it states.
        assert abs(np.log(at_rest / curve.modulus_MPa)) < material.modulus_log_sd
        return
    # The tangent at rest is extrapolated from 0.5 %; within the hardest grade's reading error.
    assert at_rest == pytest.approx(curve.modulus_MPa, rel=0.07)
    assert isinstance(law, Ogden)
    assert set(found.sound) == {"uniaxial", "planar", "equibiaxial"}
    assert max(abs(a) for a in law.alpha) <= 5.0
    parts = np.multiply(law.mu_MPa, law.alpha)
    assert np.abs(parts).sum() <= 5.0 * parts.sum()


@pytest.mark.parametrize(("published", "material"), ELASTIC)
def test_the_published_law_is_kept_beside_it(published: Published, material: Material) -> None:
    assert material.published is not None
    assert material.published.parameters["c"] == published.c
    assert material.published.parameters["strain_max"] == (published.elongation_at_break,)
    onset = correct(published).onset
    assert material.published.parameters["strain_min"][0] == pytest.approx(onset, abs=1e-9)


@pytest.mark.parametrize(("published", "material"), ELASTIC)
def test_uncertainty_holds_reading_and_specimens(published: Published, material: Material) -> None:
    curve = correct(published)
    strain = fit_strains(curve)
    law = make_law(material.law)
    off = relative_rms(law, strain, curve.nominal_stress_MPa(strain))
    expected = np.linalg.norm([reading_log_sd(curve), 0.05, off])
    # Written to three decimals.
    assert material.modulus_log_sd == pytest.approx(expected, abs=5.1e-4)


@pytest.mark.parametrize(
    ("name", "expected"), [("RGD8430", 0.3053), ("RGD8425", 0.5965), ("VeroWhitePlus", 0.1954)]
)
def test_uncertainty_of_the_rigid_grades(name: str, expected: float) -> None:
    """Of ln(60.47/46.33) and ln(2 U / ε² / E), by hand from Table 3.1."""
    assert SHIPPED.resolve(name).modulus_log_sd == pytest.approx(expected, abs=6e-4)


def test_fit_finds_a_law_it_was_given() -> None:
    """Exact data of a two-term law on the grid of exponents: its moduli come back."""
    strain = np.geomspace(0.005, 0.6, 100)
    truth = Ogden((-3.7, 1.5), (-2.0, 3.0))
    found = fit_ogden(strain, truth.nominal_stress_MPa(1.0 + strain), 0.6)
    assert found.alpha == truth.alpha
    # Moduli are rounded to seven digits.
    assert found.mu_MPa == pytest.approx(truth.mu_MPa, rel=1e-6)


def test_fit_of_a_bend_finds_a_law_it_was_given() -> None:
    strain = np.geomspace(0.005, 0.6, 100)
    truth = Yielding(40.0, 3.0, 4.0, 2.0)
    found = fit_yielding(strain, truth.nominal_stress_MPa(1.0 + strain))
    assert found.sharpness == 2.0
    # The bend lies on a grid whose steps are 1.2 %.
    assert found.modulus_MPa == pytest.approx(40.0, rel=0.02)
    assert found.flow_MPa == pytest.approx(3.0, rel=0.02)
    assert found.hardening_MPa == pytest.approx(4.0, rel=0.02)
    with pytest.raises(ValueError, match="does not bend over"):
        fit_yielding(strain, 10.0 * strain + 20.0 * strain**2)


@pytest.mark.parametrize("name", load_printer("connex3").palettes)
def test_in_compression_no_bundled_law_leaves_what_its_kind_carries(name: str) -> None:
    """Rubbers between a straight line and Mooney's second term; what bends over, as in tension."""
    stretch = np.linspace(0.6, 0.99, 40)
    for material in load_printer("connex3").palette(name).materials:
        for parameters in (material.law, *(r.law for r in material.readings)):
            law = make_law(parameters)
            assert not stability(law, material.elongation_at_break).limits
            low, high = rubber_over_neo_hooke(stretch)
            found = over_neo_hooke(law, stretch)
            assert (found <= high).all(), material.id
            if isinstance(law, Yielding):
                mirrored = -law.nominal_stress_MPa(2.0 - stretch)
                np.testing.assert_allclose(law.nominal_stress_MPa(stretch), mirrored, rtol=1e-12)
            else:
                # 1e-12: a straight line itself, to rounding.
                assert (found >= low * (1.0 - 1e-12)).all(), material.id


def test_what_a_rubber_carries_in_compression() -> None:
    """Ogden's law of Treloar's rubber (1972), in kg/cm²; a law fitted to tension alone is none."""
    treloar = Ogden((6.3, 0.012, -0.1), (1.3, 5.0, -2.0))
    assert over_neo_hooke(treloar, [0.8, 0.6]) == pytest.approx([1.03, 1.05], abs=0.005)
    assert is_a_rubbers(treloar)
    low, high = rubber_over_neo_hooke([0.8, 0.6])
    assert low == pytest.approx([0.787, 0.551], abs=5e-4)
    assert high == pytest.approx([1.25, 1.667], abs=5e-4)
    tension_alone = Ogden((-4.742473, -3.49445), (-10.5, 5.5))
    assert tension_alone.tangent_MPa(np.linspace(0.6, 1.55, 40)).min() > 0.0
    assert over_neo_hooke(tension_alone, 0.8) > 4.0
    assert not is_a_rubbers(tension_alone)


def test_fit_refuses_a_curve_that_no_sound_law_follows() -> None:
    strain = np.geomspace(0.005, 0.6, 100)
    with pytest.raises(ValueError, match="no sound Ogden law"):
        fit_ogden(strain, 1.0 + np.sin(20.0 * strain) ** 2, 0.6)


def test_the_page_shows_what_is_computed() -> None:
    folder = Path(__file__).resolve().parents[2] / "docs" / "explanation"
    spec = importlib.util.spec_from_file_location("thesis_numbers", folder / "thesis_numbers.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    page = (folder / "thesis-numbers.md").read_text(encoding="utf-8")
    assert script.with_tables(page, script.tables()) == page
