"""planner fit --figure and --tables: what is drawn and written agrees with what --json tells."""

import csv
import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.materials.palette_study import PaletteStudy

SVG = "{http://www.w3.org/2000/svg}"
SPECIMENS = ("#0072b2", "#d55e00", "#009e73")


@pytest.fixture(scope="module")
def fitted(samples: Path) -> PaletteStudy:
    return planner.fit([samples / "tensile"], law="ogden-1", starts=10)


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> PaletteStudy:
    """Three rubbers, one specimen each, with Algorithm 1."""
    folder = tmp_path_factory.mktemp("three")
    strain = np.linspace(0.0, 0.8, 81)
    for material, mu in (("A", 0.1), ("B", 0.25), ("C", 0.8)):
        stress = mu * (1.0 + strain - (1.0 + strain) ** -2.0)
        rows = "\n".join(f"{e:.4f},{s:.8f}" for e, s in zip(strain, stress, strict=True))
        (folder / f"{material}.csv").write_text(f"strain (mm/mm),stress (MPa)\n{rows}\n", "utf-8")
    return planner.fit([folder], law="neo-hookean", coefficients="quadratic", compare=False)


def paths(figure: bytes) -> Iterator[ElementTree.Element]:
    return ElementTree.fromstring(figure).iter(f"{SVG}path")


def words(figure: bytes) -> list[str]:
    return [element.text or "" for element in ElementTree.fromstring(figure).iter(f"{SVG}text")]


def rows_of(table: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(table.decode("utf-8"))))


def test_a_curve_and_its_residual_are_drawn_for_each_specimen(fitted: PaletteStudy) -> None:
    figure = planner.fit_figure(fitted)
    assert figure == planner.fit_figure(fitted)
    drawn = [path.get("stroke") for path in paths(figure)]
    for colour in SPECIMENS:
        # Three materials, a curve and a residual each, and the line in the key; and the one between
        # the others again, over what they say of it.
        assert drawn.count(colour) == 3 * 3 + 2
    said = words(figure)
    assert sum(text.startswith("measured less law") for text in said) == 3
    assert sum(text.startswith("secant modulus") for text in said) == 3
    assert "m 0.25: between SYN-soft and SYN-medium" in said
    assert not any("Algorithm" in text for text in said)


def test_nothing_is_drawn_outside_the_picture(fitted: PaletteStudy) -> None:
    """Not the band of a law either that fits far too badly for its curves."""
    soft, *rest = fitted.palette.materials
    wild = replace(soft, modulus_log_sd=2.0)
    wide = replace(fitted, palette=replace(fitted.palette, materials=(wild, *rest)))
    for study in (fitted, wide):
        figure = planner.fit_figure(study)
        root = ElementTree.fromstring(figure)
        size = np.array([float(root.get("width", "")), float(root.get("height", ""))])
        for path in paths(figure):
            data = path.get("d", "")
            if "l" in data or "V" in data or "H" in data:
                continue  # crosses and grids, whose places are relative
            points = data.strip("MZ").replace("L", " ").split()
            places = np.array([[float(v) for v in point.split(",")] for point in points])
            assert (places >= 0.0).all()
            assert (places <= size).all()


def test_algorithm_one_is_drawn_beside(compared: PaletteStudy) -> None:
    figure = planner.fit_figure(compared)
    said = words(figure)
    assert {"c1, MPa", "c2", "c3, MPa", "c4", "c5, MPa", "c6"} <= set(said)
    assert "quadratics (Algorithm 1)" in said
    assert any(path.get("stroke-dasharray") == "7,4" for path in paths(figure))


def test_laws_that_cross_are_drawn_by_themselves(fitted: PaletteStudy) -> None:
    crossing = replace(fitted, problem="laws cross")
    said = words(planner.fit_figure(crossing))
    assert "Not fit to plan with: nothing is drawn between all materials." in said
    assert not any(text.startswith("secant modulus") for text in said)


def test_tables_agree_with_the_document(compared: PaletteStudy) -> None:
    tables = {name: rows_of(table) for name, table in planner.fit_tables(compared).items()}
    told = compared.document()
    assert set(tables) == {
        "characteristics.csv", "laws.csv", "coefficients.csv", "quadratics.csv", "goodness.csv",
        "r2.csv",
    }  # fmt: skip
    assert [row["material"] for row in tables["characteristics.csv"]] == ["A", "B", "C"]
    for row, material in zip(tables["laws.csv"], told["materials"], strict=True):
        assert row["parameter"] == "mu_MPa"
        # Nine significant digits.
        assert float(row["value"]) == pytest.approx(material["law"]["mu_MPa"][0], rel=1e-8)
        assert row["low"] == row["high"] == ""  # one specimen tells no scatter
        assert material["law_low"]["mu_MPa"] == [None]
    quadratic = told["quadratic"]
    for row, powers in zip(tables["quadratics.csv"], quadratic["quadratics"], strict=True):
        assert [float(row[q]) for q in ("q2", "q1", "q0")] == pytest.approx(powers, rel=1e-8)
    coefficients = [float(row["value"]) for row in tables["coefficients.csv"]]
    flat = [c for material in quadratic["materials"] for c in material["coefficients"]]
    assert coefficients == pytest.approx(flat, rel=1e-8)
    for row, material in zip(tables["goodness.csv"], quadratic["materials"], strict=True):
        assert float(row["r2_quadratics"]) == pytest.approx(material["r2"]["quadratics"], rel=1e-8)
        assert float(row["nrmse_law"]) == pytest.approx(material["nrmse"]["law"], rel=1e-8)
        assert row["r2_quadratics_left_out"] == ""  # two are left, too few for a quadratic
    inner = tables["goodness.csv"][1]
    assert float(inner["nrmse_mixtures_left_out"]) > 0.0


def test_without_algorithm_one_there_are_three_tables(fitted: PaletteStudy) -> None:
    tables = planner.fit_tables(fitted)
    assert set(tables) == {"characteristics.csv", "laws.csv", "r2.csv"}
    rows = rows_of(tables["laws.csv"])
    soft = [row for row in rows if row["material"] == "SYN-soft"]
    assert [row["parameter"] for row in soft] == ["mu_MPa", "alpha"]
    for row in rows:
        assert float(row["low"]) < float(row["value"]) < float(row["high"])
        assert (row["level"], row["specimens"]) == ("0.95", "3")


def test_the_command_writes_all_or_nothing(samples: Path, tmp_path: Path, capsys) -> None:
    palette, figure, tables = (tmp_path / name for name in ("lab.toml", "lab.svg", "lab"))
    command = ["fit", str(samples / "tensile"), "--law", "neo-hookean", "-o", str(palette)]
    outputs = ["--figure", str(figure), "--tables", str(tables)]
    assert run([*command, *outputs]) in (0, 1)
    assert f"wrote {tables}" in capsys.readouterr().out
    assert figure.read_bytes().startswith(b"<svg")
    names = ["characteristics.csv", "laws.csv", "r2.csv", "tables.json"]
    assert sorted(path.name for path in tables.iterdir()) == names
    assert run([*command, *outputs, "--force", "--json"]) in (0, 1)
    assert json.loads(capsys.readouterr().out)["file"] == str(palette)
    figure.unlink()
    palette.unlink()
    assert run([*command, *outputs]) == 2  # the folder is there
    assert "--tables" in capsys.readouterr().err
    (tables / "laws.csv").write_text("mine", "utf-8")
    assert run([*command, *outputs, "--force"]) == 2
    assert "laws.csv was changed since" in capsys.readouterr().err
    assert run([*command, "--tables", str(palette)]) == 2
    assert run([*command, "--figure", str(tmp_path / "lab.pdf")]) == 2
    assert not palette.exists()
    assert not figure.exists()


@pytest.mark.parametrize(
    ("law", "how"), [("neo-hookean", "the jackknife"), ("ogden-1", "profiles of the error")]
)
def test_a_material_says_what_its_intervals_rest_on(samples: Path, law: str, how: str) -> None:
    files = sorted((samples / "tensile").glob("soft-*.txt"))
    (one,) = planner.fit(files, law=law, starts=4, compare=False).fits.values()
    assert one.uncertainty.basis.startswith(f"{how}, by the scatter of ")


def test_a_fitted_palette_is_that_of_its_file(samples: Path, tmp_path: Path) -> None:
    """It had no hash, so that a plan of it was simulated with other laws and nothing said so."""
    fitted = planner.fit(samples / "tensile", law="ogden", starts=3, compare=False).palette
    planner.write_palette(fitted, tmp_path / "lab.toml")
    read = planner.load_palette(tmp_path / "lab.toml")
    assert fitted == read
    assert fitted.sha256 == read.sha256 != ""
    plans = [
        planner.grade(samples / "dogbone.stl", from_="SYN-soft", to="SYN-rigid", palette=one)
        for one in (fitted, read)
    ]
    assert plans[0].json() == plans[1].json()
    soft, *rest = read.materials
    stiffer = replace(soft, law=soft.law.stiffened(2.0))
    other = replace(read, materials=(stiffer, *rest)).as_written()
    assert any(
        "is not the one that the plan was made with" in note
        for note in planner.simulate_bar(plans[0], palette=other, to_strain=0.05, steps=3).notes
    )
