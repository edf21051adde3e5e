"""Laws fitted to several loadings at once: what they were made of, and published fits."""

import numpy as np
import pytest

from benchmarks import loadings
from planner.materials.characterise import Curve
from planner.materials.fit import by_mode, fit_law, fit_material, sample_of
from planner.materials.laws import Yielding, candidate_laws

TRUE = ((1.3, 5.0, -2.0), (0.63, 0.0012, -0.01))
STRETCH = {"uniaxial": (0.6, 3.0), "planar": (1.0, 2.5), "equibiaxial": (1.0, 2.0)}


def stress_MPa(mode: str, stretch: np.ndarray) -> np.ndarray:
    """Ogden's stress by the definition of each loading, from w'(l) = mu l^(alpha - 1)."""
    thin = {"uniaxial": -0.5, "planar": -1.0, "equibiaxial": -2.0}[mode]
    return sum(
        mu * (stretch**a - stretch ** (thin * a)) / stretch for a, mu in zip(*TRUE, strict=True)
    )


def curves() -> list[Curve]:
    found = []
    for mode, (low, high) in STRETCH.items():
        for side in (low, high):
            if side != 1.0:
                stretch = np.linspace(1.0, side, 60)[1:]
                stress = stress_MPa(mode, stretch)
                found.append(Curve(f"{mode} {side}", stretch - 1.0, stress, mode=mode))
    return found


def test_exact_data_of_all_loadings_give_the_law_back() -> None:
    (law,) = candidate_laws("ogden-3")
    fit = fit_law(law, sample_of(curves()))
    order = np.argsort(TRUE[0])
    # Three exponents from exact data; the ridge and five digits leave 0.1 %.
    np.testing.assert_allclose(fit.a, np.array(TRUE[0])[order], rtol=2e-3)
    np.testing.assert_allclose(fit.c, np.array(TRUE[1])[order], rtol=2e-2)


def test_each_loading_weighs_the_same_and_is_told() -> None:
    tension = [c for c in curves() if c.mode == "uniaxial" and c.strain[0] > 0.0]
    others = [c for c in curves() if c not in tension]
    assert sample_of([*tension, *tension, *others]).weight.sum() == pytest.approx(1.0)
    fitted = fit_material("rubber", tension, candidate_laws("all"), others=others, starts=12)
    (said,) = [note for note in fitted.notes if "weighs" in note]
    assert "uniaxial weighs 0.333" in said
    assert "equibiaxial weighs 0.333" in said
    assert fitted.choice.chosen is not None
    assert fitted.choice.chosen.fit.name == "ogden-3"


def test_what_a_plastic_is_not_fitted_to_is_told() -> None:
    """Compressed specimens of a rigid material were left out without a word."""
    strain = np.linspace(0.0, 0.1, 60)
    stress = Yielding(1800.0, 45.0, 20.0, 2.0).nominal_stress_MPa(1.0 + strain)
    pulled = [Curve(f"S{k}", strain, (1.0 + 0.01 * k) * stress) for k in range(3)]
    pushed = Curve("C1", -strain, -2.0 * stress)
    alone, both = (
        fit_material("rigid", pulled, candidate_laws("all"), others=others)
        for others in ([], [pushed])
    )
    assert both.law == alone.law
    assert {*both.notes} - {*alone.notes} == {
        "specimen C1: left out, as a law that yields is fitted to tension alone"
    }


@pytest.mark.skipif(not loadings.FOLDER.exists(), reason="the shared data is not there")
def test_treloars_rubber_is_no_worse_than_published_in_any_loading() -> None:
    sample = loadings.study("Treloar_1944")
    (law,) = candidate_laws("ogden-3")
    fit = fit_law(law, sample)
    assert [share for _, (share, _) in by_mode(fit, sample)] == pytest.approx([1 / 3] * 3)
    known = loadings.errors(loadings.published("Ogden 1972", fit), sample)
    assert all(a < b for a, b in zip(loadings.errors(fit, sample), known, strict=True))
