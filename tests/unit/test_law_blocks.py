"""Blocks to paste: the modulus at rest that each program would take from its own formula."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

import planner
from planner import cli
from planner.errors import ArgumentError
from planner.materials.laws import make_law
from planner.palette import Material
from planner.printers import load_printer

PALETTE = load_printer("connex3").palette()
RUBBERS = [m for m in PALETTE.materials if m.law.model == "ogden"]
NU = 0.49


def young_MPa(shear_MPa: float) -> float:
    return 2.0 * (1.0 + NU) * shear_MPa


@pytest.mark.parametrize("material", RUBBERS, ids=lambda m: m.id)
def test_the_modulus_at_rest_is_the_palettes(material: Material) -> None:
    at_rest = float(make_law(material.law).tangent_MPa(1.0))
    lines = planner.law_block(material, "abaqus").splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("*HYPERELASTIC, OGDEN"))
    numbers = [
        float(v) for line in lines[head + 1 : lines.index("*DENSITY")] for v in line.split(",")
    ]
    terms = len(material.law.parameters["alpha"])
    # Abaqus: mu0 = sum mu_i, K0 = 2 / D1 (User's manual, Ogden form). Nine digits are written.
    assert young_MPa(sum(numbers[: 2 * terms : 2])) == pytest.approx(at_rest, rel=5e-8)
    bulk = 2.0 / numbers[2 * terms]
    assert bulk == pytest.approx(at_rest / (3.0 * (1.0 - 2.0 * NU)), rel=5e-8)
    assert len(numbers) == 3 * terms
    # Ansys: mu0 = sum mu_i alpha_i / 2.
    text = planner.law_block(material, "ansys")
    values = [float(v) for row in re.findall(r"TBDATA,[0-9]+,(.*)", text) for v in row.split(",")]
    pairs = np.array(values[: 2 * terms]).reshape(-1, 2)
    assert young_MPa(0.5 * float(pairs.prod(axis=1).sum())) == pytest.approx(at_rest, rel=5e-8)
    assert 2.0 / values[2 * terms] == pytest.approx(bulk, rel=5e-8)
    # FEBio: W = sum c / m^2 (...), mu0 = sum c / 2.
    block = ElementTree.fromstring(planner.law_block(material, "febio").split("-->", 1)[1])
    c = [float(one.text or "") for one in block if re.fullmatch("c[0-9]", one.tag)]
    assert young_MPa(0.5 * sum(c)) == pytest.approx(at_rest, rel=5e-8)
    assert float(block.findtext("k") or "") == pytest.approx(bulk, rel=5e-8)
    ordered = [f"{letter}{number}" for number in range(1, terms + 1) for letter in "cm"]
    assert [one.tag for one in block if one.tag[1:].isdigit()] == ordered


def test_what_yields_flows_or_says_that_it_stays_straight() -> None:
    rigid = load_printer("connex3").palette("connex3-agilus-vero").resolve("Vero")
    text = planner.law_block(rigid, "abaqus")
    rows = text.split("*PLASTIC\n")[1].split("*DENSITY")[0].split()
    first, last = float(rows[0].rstrip(",")), float(rows[-2].rstrip(","))
    assert first < 46.9 < last
    # Abaqus and CalculiX both ask that the first plastic strain be zero.
    assert float(rows[1]) == 0.0
    assert "straight" in planner.law_block(PALETTE.resolve("Vero"), "ansys")
    assert "*HYPERELASTIC, MARLOW" in planner.law_block(PALETTE.resolve("FLX9795"), "abaqus")


def test_each_material_of_a_model_has_its_own_number(capsys) -> None:
    """Pasted one below the other, none takes another's place."""
    every = PALETTE.materials
    assert cli.run(["materials", "--as", "ansys"]) == 0
    lines = re.findall(r"^(?:TB|MP),[A-Z]+,([0-9]+),", capsys.readouterr().out, re.MULTILINE)
    assert list(dict.fromkeys(lines)) == [str(k) for k in range(1, len(every) + 1)]
    assert cli.run(["materials", *(m.id for m in RUBBERS), "--as", "febio"]) == 0
    ids = re.findall(r'<material id="([0-9]+)" name="(.*?)"', capsys.readouterr().out)
    assert ids == [(str(k), m.id) for k, m in enumerate(RUBBERS, 1)]


def test_no_file_is_asked_for_with_laws_to_paste(tmp_path, capsys) -> None:
    figure = tmp_path / "ladder.svg"
    assert cli.run(["materials", "--as", "abaqus", "--figure", str(figure)]) == 2
    assert "--as prints laws and writes no file" in capsys.readouterr().err
    assert not figure.exists()


def test_programs_and_laws_that_do_not_meet_are_told() -> None:
    with pytest.raises(ArgumentError, match="program 'abacus': did you mean abaqus"):
        planner.law_block(RUBBERS[0], "abacus")
    with pytest.raises(ArgumentError, match="FEBio has no law of its own like yielding"):
        planner.law_block(PALETTE.resolve("FLX9795"), "febio")


@pytest.mark.slow
def test_coefficients_at_a_coordinate_and_for_a_modulus() -> None:
    """A law that is asked for stands for the blend; at rest the modulus is the tangent."""
    at = planner.invert(coordinate=0.4, law="ogden-2")
    assert at.law is not None
    assert len(at.law.law.parameters["alpha"]) == 2
    assert at.law.error < 0.02
    wanted = planner.invert(1.2, at_strain=0.0, law="ogden-3")
    assert wanted.law is not None
    # The law is fitted to the whole curve, within its own error.
    tangent = float(make_law(wanted.law.law).tangent_MPa(1.0))
    assert tangent == pytest.approx(1.2, rel=0.03)
    thesis = planner.invert(coordinate=0.4, law="ogden-thesis")
    assert thesis.law is not None
    assert thesis.law.law.model == "ogden-thesis"
    # Printed in section 3.0.5 at m = 0.4, as the literal curve between FLX9750 and FLX9760.
    m = np.array([0.16, 0.4, 1.0])
    printed = np.array(
        [
            [-1.1003, 1.2263, -0.1408], [-0.0046, -0.5049, 1.4082], [15.3259, -5.9351, 1.0001],
            [-0.7300, 0.4358, 0.5459], [3.6022, 0.8816, 0.1686], [0.7538, -0.6806, -0.2277],
        ]
    )  # fmt: skip
    strain = np.linspace(0.15, 0.7, 50)

    def stress(c: np.ndarray) -> np.ndarray:
        return sum(
            c[i] * (strain ** c[i + 1] - 2.0 ** (c[i + 1] - 1.0) * strain ** (-c[i + 1] / 2.0))
            for i in (0, 2, 4)
        )

    ours = stress(np.array(thesis.law.law.parameters["c"]))
    # The thesis' own search stopped elsewhere; both lie near the neighbours' curves.
    assert np.sqrt(np.mean((ours / stress(printed @ m) - 1.0) ** 2)) < 0.25
