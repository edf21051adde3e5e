"""planner fit --coefficients quadratic: Algorithm 1 on a lab's own tests, beside the palette."""

import json
from dataclasses import replace
from functools import wraps
from pathlib import Path

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import ArgumentError
from planner.materials.algorithm_one import quadratic_study
from planner.materials.palette_study import PaletteStudy

MODULI_MPA = {"A": 0.3, "B": 0.6, "C": 1.3, "D": 2.9, "E": 6.0}


@pytest.fixture(scope="module")
def ladder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five rubbers, neo-Hookean, two specimens each 3 % apart."""
    folder = tmp_path_factory.mktemp("ladder")
    rows = ["specimen,material,file,width_mm,thickness_mm,gauge_mm,coordinate"]
    strain = np.linspace(0.0, 0.8, 81)
    for place, (material, modulus) in enumerate(MODULI_MPA.items()):
        for number, factor in enumerate((0.985, 1.015)):
            stress = factor * modulus / 3.0 * (1.0 + strain - (1.0 + strain) ** -2.0)
            name = f"{material}-{number}"
            table = "\n".join(
                f"{15 * e:.6f},{6 * s:.8f}" for e, s in zip(strain, stress, strict=True)
            )
            (folder / f"{name}.csv").write_text(f"displacement_mm,force_N\n{table}\n", "utf-8")
            rows.append(f"{name},{material},{name}.csv,3,2,15,{place / 4}")
    (folder / "specimens.csv").write_text("\n".join(rows) + "\n", "utf-8")
    return folder


@pytest.fixture(scope="module")
def fitted(ladder: Path) -> PaletteStudy:
    return planner.fit([ladder], law="neo-hookean", coefficients="quadratic", compare=False)


@pytest.fixture(scope="module")
def plain(ladder: Path) -> PaletteStudy:
    return planner.fit([ladder], law="neo-hookean", compare=False)


def test_the_palette_stays_what_it_is_without(fitted: PaletteStudy, plain: PaletteStudy) -> None:
    assert plain.palette == fitted.palette
    assert plain.quadratic is None
    assert "quadratic" not in plain.document()


def test_both_ways_are_held_against_the_same_points(fitted: PaletteStudy) -> None:
    found = fitted.quadratic
    assert found is not None
    assert [row.id for row in found.rows] == list(MODULI_MPA)
    for row in found.rows:
        # Two specimens 3 % apart: what no law can describe is a few thousandths.
        for kind in ("own", "law"):
            error = row.errors[kind]
            assert error is not None
            assert error.r2 > 0.99
        assert len(row.curve.strain) == 2 * 60
        # Neo-Hooke's E times the strain, a thousandth.
        assert row.law_near_rest_MPa == pytest.approx(1e-3 * MODULI_MPA[row.id], rel=0.02)
    ends, inner = (found.rows[0], found.rows[-1]), found.rows[1:-1]
    without = ("quadratics_without", "mixtures_without")
    assert all(row.errors[kind] is None for row in ends for kind in without)
    means = []
    for row in inner:
        quadratics, mixtures = (row.errors[kind] for kind in without)
        assert quadratics is not None
        assert mixtures is not None
        means.append((quadratics.nrmse, mixtures.nrmse))
        # ln E rises by 0.69 to 0.80 a step: the monotone cubic without a grade is within 5 % of E.
        assert mixtures.nrmse < 0.05
    of_quadratics, of_mixtures = 100.0 * np.mean(means, axis=0)
    assert of_mixtures < of_quadratics
    said = " ".join(found.remarks())
    assert f"quadratics {of_quadratics:.2g} % of" in said
    assert f"mixtures {of_mixtures:.2g} % (mean of 3)" in said
    assert "not free of stress" in said


def test_the_document_has_every_figure(fitted: PaletteStudy) -> None:
    told = fitted.document()["quadratic"]
    assert len(told["quadratics"]) == 6
    first, second = told["materials"][:2]
    assert first["r2"]["quadratics_without"] is None
    assert second["nrmse"]["mixtures_without"] < 0.05
    for low, c, high in zip(
        first["coefficients_low"], first["coefficients"], first["coefficients_high"], strict=True
    ):
        assert low <= c <= high


def test_the_command_tells_both(
    ladder: Path, fitted: PaletteStudy, tmp_path: Path, capsys, monkeypatch
) -> None:
    command = ["fit", str(ladder), "--law", "neo-hookean", "--coefficients", "quadratic"]
    palette = tmp_path / "lab.toml"
    assert run([*command, "--no-compare", "-o", str(palette)]) == 0
    said = capsys.readouterr().out
    assert "Algorithm 1, lines 4 to 7" in said
    assert "predicted by the others" in said
    again = wraps(planner.fit)(lambda *_, **__: fitted)  # the same, as the fixture has it
    monkeypatch.setattr(planner, "fit", again)
    assert run([*command, "--no-compare", "-o", str(palette), "--force", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["quadratic"]["materials"]) == 5


def test_crossing_laws_leave_the_quadratics_alone(plain: PaletteStudy) -> None:
    """Two pairs of equal laws: whichever material is left out, no mixture is made."""
    a, b, c, d, e = plain.palette.materials
    equal = (a, replace(b, law=a.law), c, d, replace(e, law=d.law))
    # Which no scatter excuses.
    equal = tuple(replace(one, modulus_log_sd=0.0, uncertainty=None) for one in equal)
    crossing = replace(plain.palette, materials=equal)
    assert "makes no mixtures" in next(quadratic_study(crossing, plain.fits).remarks())


def test_what_cannot_be_compared_is_refused(samples: Path, tmp_path: Path, capsys) -> None:
    palette = tmp_path / "lab.toml"
    command = ["fit", str(samples / "tensile"), "--law", "neo-hookean", "-o", str(palette)]
    command.append("--coefficients")
    assert run([*command, "quadratic"]) == 2
    assert "3 elastic materials at least; the tests have 2" in capsys.readouterr().err
    assert run([*command, "cubic"]) == 2
    assert "it can be quadratic" in capsys.readouterr().err
    assert not palette.exists()
    with pytest.raises(ArgumentError, match="quadratic"):
        planner.fit([samples / "tensile"], coefficients="linear")
