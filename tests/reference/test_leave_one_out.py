"""Each grade predicted by the others: what the consistent coefficient model is worth."""

from dataclasses import replace
from statistics import NormalDist, fmean

import numpy as np
import pytest

from planner.errors import PaletteError
from planner.materials.algorithm_one import normalised_rmse, r_squared, without
from planner.materials.mixtures import (
    CoefficientModel,
    interpolated,
    left_out_errors,
    left_out_remark,
)
from planner.palette import LawParameters
from planner.printers import load_printer
from planner.simulation.bar_solver import law_tables
from printers.connex3.leave_one_out import HeldOut, held_out, published_curve
from printers.connex3.thesis import load_thesis

THESIS = load_thesis()
PALETTE = load_printer("connex3").palette()
MODEL = CoefficientModel(PALETTE)
TAIL = NormalDist().inv_cdf(0.975)


@pytest.fixture(scope="module")
def rows() -> list[HeldOut]:
    return [held_out(THESIS, PALETTE, p) for p in THESIS.elastomers[1:-1]]


@pytest.mark.slow
def test_half_the_error_of_the_literal_model_on_average(rows: list[HeldOut]) -> None:
    assert [r.id for r in rows] == ["FLX9740", "FLX9750", "FLX9760", "FLX9770", "FLX9785"]
    literal = fmean(r.literal for r in rows)
    assert fmean(r.consistent_crosshead for r in rows) <= 0.5 * literal
    assert fmean(r.consistent for r in rows) <= 0.5 * fmean(r.literal_toe_off for r in rows)
    # ... and smaller at each grade in the reading where nothing of the grade is known.
    assert all(r.consistent_crosshead < r.literal for r in rows)


@pytest.mark.slow
def test_six_tenths_of_the_error_of_straight_lines_between_neighbours(rows: list[HeldOut]) -> None:
    """By crosshead, where nothing of the grade's own curve is known, and at no grade above it."""
    off, straight = (
        np.array([getattr(r, name) for r in rows])
        for name in ("consistent_crosshead", "straight_crosshead")
    )
    assert off.mean() <= 0.6 * straight.mean()
    assert (off <= straight).all()
    # It is the hardness that does it: the same cubic over the coordinate is half as good.
    assert fmean(r.even_crosshead for r in rows) > 0.8 * straight.mean()
    assert fmean(r.consistent for r in rows) <= 0.7 * fmean(r.straight for r in rows)


@pytest.mark.long
@pytest.mark.parametrize("softest", [26.0, pytest.param(28.0, marks=pytest.mark.long)])
@pytest.mark.slow
def test_the_softest_grades_unsure_hardness_changes_little(
    softest: float, rows: list[HeldOut]
) -> None:
    """TangoPlus is 26 to 28, from memory of its data sheet."""
    (first, _), *others = PALETTE.hardness
    other = replace(PALETTE, hardness=((first, softest), *others))
    found = fmean(held_out(THESIS, other, p).consistent_crosshead for p in THESIS.elastomers[1:-1])
    assert found <= 0.6 * fmean(r.straight_crosshead for r in rows)


def test_figures_of_merit() -> None:
    measured, predicted = np.array([1.0, 2.0, 4.0]), np.array([1.0, 2.0, 1.0])
    assert normalised_rmse(measured, predicted) == pytest.approx(3**0.5 / 4)
    assert r_squared(measured, measured) == 1.0
    assert r_squared(measured, np.full(3, measured.mean())) == 0.0


def test_the_curve_with_its_toe_off_is_the_same_curve_moved() -> None:
    for published in THESIS.elastomers:
        crosshead = published_curve(THESIS, published)
        moved = published_curve(THESIS, published, toe_off=True)
        assert (moved.stress_MPa == crosshead.stress_MPa).all()
        assert crosshead.strain[-1] == published.elongation_at_break
        shift = crosshead.strain - moved.strain
        # Roundings of a difference of numbers up to 1.
        assert float(np.ptp(shift)) < 1e-15
        assert shift[0] > 0.0


def log_sd(model: CoefficientModel, m: np.ndarray, strain: float) -> np.ndarray:
    low, high = model.modulus_interval_MPa(m, strain)
    return np.log(high / low) / 2.0 / TAIL


@pytest.mark.parametrize("strain", [0.0, 0.1, 0.5])
def test_the_interval_is_a_grades_own_at_it_and_wider_between(strain: float) -> None:
    """Without other readings, which reach farther to one side of the rigid grades."""
    alone = tuple(replace(m, readings=()) for m in PALETTE.materials)
    model = CoefficientModel(replace(PALETTE, materials=alone))
    grades = np.array([m.modulus_log_sd for m in PALETTE.materials])
    np.testing.assert_allclose(log_sd(model, model.coordinates, strain), grades, rtol=1e-12)
    for k in range(len(grades) - 1):
        t = np.linspace(0.0, 1.0, 21)
        m = (1.0 - t) * MODEL.coordinates[k] + t * MODEL.coordinates[k + 1]
        excess = log_sd(model, m[1:-1], strain) - ((1.0 - t) * grades[k] + t * grades[k + 1])[1:-1]
        assert (excess > 0.0).all()
        # Widest beyond the grades' own toward the middle, not at an end.
        assert 0 < int(np.argmax(excess)) < len(excess) - 1


def test_a_left_out_grade_widens_the_interval_there() -> None:
    for material in PALETTE.materials[1:-1]:
        wide = log_sd(without(PALETTE, material.id), np.array(material.coordinate), 0.1)
        if material.id != "RGD8425":  # whose own doubt is three times its neighbours'
            assert wide > material.modulus_log_sd


def test_coverage_of_left_out_grades() -> None:
    strains = np.linspace(0.0, MODEL.strain_limit, 56)
    inside = []
    for material in PALETTE.materials[1:-1]:
        low, high = without(PALETTE, material.id).modulus_interval_MPa(material.coordinate, strains)
        modulus = MODEL.modulus_MPa(material.coordinate, strains)
        inside.append(np.mean((modulus >= low) & (modulus <= high)))
    # Eight grades: a share of 0.95 with a standard error of sqrt(0.95 * 0.05 / 8) = 0.08.
    assert np.mean(inside) == pytest.approx(0.95, abs=0.08)
    # The elastomers among elastomers are all within; the rubber-to-plastic step is the weak place.
    assert inside[:5] == [1.0] * 5
    assert min(inside[5:7]) < 0.95


def test_each_way_between_grades_is_measured_as_a_model_without_the_grade_has_it() -> None:
    for hardness, way in ((PALETTE.hardness, "hardness"), ((), "coordinate")):
        palette, off = replace(PALETTE, hardness=hardness), []
        for material in palette.materials[1:-1]:
            strain = np.linspace(0.0, material.elongation_at_break, 41)[1:]
            foretold, own = (
                model.modulus_MPa(material.coordinate, strain) * strain
                for model in (without(palette, material.id), MODEL)
            )
            off.append(normalised_rmse(own, foretold))
        assert left_out_errors(palette)[way] == pytest.approx(np.mean(off), rel=1e-9)


def test_the_hardness_is_used_where_it_predicts_and_dropped_where_it_does_not() -> None:
    off = left_out_errors(PALETTE)
    assert off["hardness"] < off["coordinate"]
    assert MODEL.palette == PALETTE
    (said,) = left_out_remark(PALETTE)
    assert f"misses by {100 * off['hardness']:.2g} %" in said
    assert "a cubic over hardness is used" in said
    # Steep in hardness where the ladder is even over m, and even where it is steep.
    gaps = np.diff([shore for _, shore in PALETTE.hardness])[::-1]
    shores = 27.0 + np.cumsum([0.0, *gaps])
    told = zip((m for m, _ in PALETTE.hardness), shores.tolist(), strict=True)
    wrong = replace(PALETTE, hardness=tuple(told))
    lost = left_out_errors(wrong)
    assert lost["hardness"] > lost["coordinate"] == off["coordinate"]
    assert CoefficientModel(wrong).palette == interpolated(wrong) == replace(PALETTE, hardness=())
    assert law_tables(wrong).hardness == ()
    assert "a cubic over m is used" in next(left_out_remark(wrong))
    assert not [*left_out_remark(replace(PALETTE, materials=PALETTE.materials[:3]))]


def test_a_law_without_stiffness_is_still_refused_by_name() -> None:
    soft, second, *rest = PALETTE.materials
    lost = replace(second, law=LawParameters("yeoh", {"c_MPa": (0.1, -0.5, 0.0)}))
    with pytest.raises(PaletteError, match="'FLX9740': law: the secant modulus is -"):
        CoefficientModel(replace(PALETTE, materials=(soft, lost, *rest)))
