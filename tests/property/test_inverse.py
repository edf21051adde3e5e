"""The inverse undoes the model, stays in range, and takes the nearest grade in log stiffness."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import ArgumentError
from planner.materials.mixtures import (
    Blend,
    CoefficientModel,
    nearest_on,
    thresholds_of,
)
from planner.palette import LawParameters, Material, Palette
from planner.printers import load_printer

CONNEX3 = CoefficientModel(load_printer("connex3").palette())
IDS = [m.id for m in CONNEX3.palette.materials]
strains = st.floats(0.0, 0.55)


@settings(deadline=None, derandomize=True)
@given(strain=strains, seed=st.integers(0, 2**32 - 1))
def test_round_trip_over_the_whole_range(strain: float, seed: int) -> None:
    ladder = CONNEX3.grade_moduli_MPa(strain)
    share = np.concatenate([[0.0, 1.0], np.random.default_rng(seed).uniform(size=200)])
    target = np.clip(ladder[0] * (ladder[-1] / ladder[0]) ** share, ladder[0], ladder[-1])
    target = np.concatenate([target, ladder])
    m = CONNEX3.coordinate_for(target, strain)
    assert (m >= CONNEX3.coordinates[0]).all()
    assert (m <= CONNEX3.coordinates[-1]).all()
    # The promise is 1e-9; roundings of a logarithm and two powers are far below.
    np.testing.assert_allclose(CONNEX3.modulus_MPa(m, strain), target, rtol=1e-13)
    assert (CONNEX3.coordinate_for(ladder, strain) == CONNEX3.coordinates).all()


@settings(deadline=None, derandomize=True)
@given(m=st.floats(0.0, 1.5), strain=strains)
def test_the_model_undoes_the_inverse(m: float, strain: float) -> None:
    back = float(CONNEX3.coordinate_for(CONNEX3.modulus_MPa(m, strain), strain))
    # Roundings of 2e-16 of a modulus and a cubic over the flattest place, ln 1.5 in 1/6 or so.
    assert back == pytest.approx(m, abs=1e-14)


@settings(deadline=None, derandomize=True)
@given(log_modulus=st.floats(-12.0, 12.0), strain=strains)
def test_nearest_in_log_stiffness(log_modulus: float, strain: float) -> None:
    modulus = float(np.exp(log_modulus))
    distance = np.abs(np.log(CONNEX3.grade_moduli_MPa(strain) / modulus))
    found = int(nearest_on(CONNEX3.ladder_MPa(strain), modulus))
    assert distance[found] <= distance.min() + 1e-12
    changes = thresholds_of(CONNEX3.grade_moduli_MPa(strain))
    assert found == int(np.count_nonzero(changes < modulus))


def test_a_tie_goes_to_the_softer() -> None:
    law = [LawParameters("linear", {"modulus_MPa": (E,)}) for E in (1.0, 4.0, 16.0)]
    materials = tuple(Material(f"M{k}", float(k), 0.5, 1.0, law[k]) for k in range(3))
    model = CoefficientModel(Palette("ties", materials))
    assert thresholds_of(model.grade_moduli_MPa(0.1)).tolist() == [2.0, 8.0]
    assert nearest_on(model.ladder_MPa(0.1), [0.1, 2.0, 2.0 + 1e-12, 8.0, 9.0, 99.0]).tolist() == [
        0, 0, 1, 1, 2, 2,
    ]  # fmt: skip


@settings(deadline=None, derandomize=True)
@given(log_modulus=st.floats(-700.0, 700.0), strain=strains)
def test_out_of_range_is_clamped(log_modulus: float, strain: float) -> None:
    modulus = float(np.exp(log_modulus))
    ladder = CONNEX3.grade_moduli_MPa(strain)
    m = float(CONNEX3.coordinate_for(modulus, strain))
    if not ladder[0] <= modulus <= ladder[-1]:
        assert m == (0.0 if modulus < ladder[0] else CONNEX3.coordinates[-1])


@settings(deadline=None, derandomize=True)
@given(log_modulus=st.floats(-2.0, 7.0), strain=strains)
def test_blend_describes_the_coordinate(log_modulus: float, strain: float) -> None:
    blend = CONNEX3.blend_for(float(np.exp(log_modulus)), strain)
    lower, upper = IDS.index(blend.lower), IDS.index(blend.upper)
    assert 0.0 <= blend.fraction < 1.0
    assert upper - lower == (1 if blend.fraction > 0.0 else 0)
    c = CONNEX3.coordinates
    assert blend.coordinate == pytest.approx(
        c[lower] + blend.fraction * (c[upper] - c[lower]), abs=1e-15
    )


def test_a_blend_at_a_grade_is_that_grade() -> None:
    modulus = float(CONNEX3.grade_moduli_MPa(0.1)[3])
    assert CONNEX3.blend_for(modulus, 0.1) == Blend(
        float(CONNEX3.coordinates[3]), "FLX9760", "FLX9760", 0.0
    )


def test_a_palette_of_one_material() -> None:
    law = LawParameters("linear", {"modulus_MPa": (5.0,)})
    model = CoefficientModel(Palette("one", (Material("Only", 0.3, 0.5, 1.0, law),)))
    assert model.coordinate_for([1.0, 5.0, 9.0], 0.1).tolist() == [0.3, 0.3, 0.3]
    assert nearest_on(model.ladder_MPa(0.1), [1.0, 9.0]).tolist() == [0, 0]
    assert thresholds_of(model.grade_moduli_MPa(0.1)).size == 0
    assert model.blend_for(9.0, 0.1) == Blend(0.3, "Only", "Only", 0.0)


@pytest.mark.parametrize("function", [CoefficientModel.coordinate_for, CoefficientModel.blend_for])
@pytest.mark.parametrize("modulus", [0.0, -1.0, np.nan, np.inf])
def test_refuses_what_is_no_modulus(function, modulus: float) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ArgumentError, match="must be above 0 and finite"):
        function(CONNEX3, modulus, 0.1)


@pytest.mark.parametrize("strain", [-0.01, 0.56, np.nan])
def test_refuses_what_is_no_working_strain(strain: float) -> None:
    with pytest.raises(ArgumentError, match=r"working strain must be from 0 \(at rest\) to 0\.55"):
        CONNEX3.coordinate_for(1.0, strain)
    with pytest.raises(ArgumentError, match=r"working strain must be from 0 \(at rest\) to 0\.55"):
        nearest_on(CONNEX3.ladder_MPa(strain), 1.0)
