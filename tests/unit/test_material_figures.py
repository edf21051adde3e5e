"""Figures of materials: whole SVG, one curve for each that there is, the same bytes twice."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.materials.palette_study import Characterisation

SVG = "{http://www.w3.org/2000/svg}"


def words(figure: bytes) -> list[str]:
    """All that is written in a figure, which is well-formed."""
    return [element.text or "" for element in ElementTree.fromstring(figure).iter(f"{SVG}text")]


def strokes(figure: bytes, colour: str) -> int:
    """How many lines are drawn in a colour."""
    paths = ElementTree.fromstring(figure).iter(f"{SVG}path")
    return sum(path.get("stroke") == colour and path.get("fill") == "none" for path in paths)


def test_a_palette_has_a_ladder_and_a_curve_a_material() -> None:
    scale = planner.list_materials(at_strain=0.2)
    figure = planner.materials_figure(scale)
    assert figure == planner.materials_figure(planner.list_materials(at_strain=0.2))
    said = words(figure)
    assert "secant modulus at strain 0.2, MPa" in said
    assert "the same read otherwise" in said  # the rigid grades', by extensometer
    for material in scale.palette.materials:
        assert said.count(material.id) == 2  # on the ladder, and at its curve
        assert strokes(figure, material.colour) == 1


def test_names_of_a_figure_do_not_cover_one_another() -> None:
    figure = planner.materials_figure(planner.list_materials(palette="connex3-agilus-vero"))
    names = {m.id for m in planner.load_printer("connex3").palette("connex3-agilus-vero").materials}
    boxes = []
    for element in ElementTree.fromstring(figure).iter(f"{SVG}text"):
        if element.text in names:
            x, y, width = float(element.get("x", "")), float(element.get("y", "")), 6.0
            width *= len(element.text)
            boxes.append((x - width if element.get("text-anchor") == "end" else x, y, width))
    # 11 pixels high: lines of small words stand 12 apart.
    for place, (x, y, width) in enumerate(boxes):
        for other_x, other_y, other_width in boxes[:place]:
            apart = x >= other_x + other_width or other_x >= x + width
            assert apart or abs(y - other_y) > 11.0


def test_materials_writes_its_figure_once(tmp_path: Path, capsys) -> None:
    figure = tmp_path / "ladder.svg"
    assert run(["materials", "--figure", str(figure)]) == 0
    assert f"wrote {figure}" in capsys.readouterr().out
    assert figure.read_bytes() == planner.materials_figure(planner.list_materials())
    assert run(["materials", "--figure", str(figure)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run(["materials", "--figure", str(figure), "--force", "--json"]) == 0
    assert run(["materials", "--figure", str(tmp_path / "ladder.png")]) == 2
    assert "must be .svg" in capsys.readouterr().err


@pytest.mark.parametrize("palette", ["connex3-tango-vero-extensometer", "connex3-agilus-vero"])
def test_every_palette_of_the_printer_has_a_figure(palette: str) -> None:
    words(planner.materials_figure(planner.list_materials(palette=palette)))


@pytest.fixture(scope="module")
def tests(samples: Path) -> Characterisation:
    return planner.characterise([samples / "tensile"])


def test_tests_have_a_curve_a_specimen(tests: Characterisation) -> None:
    figure = planner.characterisation_figure(tests)
    assert figure == planner.characterisation_figure(tests)
    said = words(figure)
    for material in tests.materials:
        assert any(text.startswith(f"{material.material}: ") for text in said)
        for specimen in material.specimens:
            assert said.count(specimen.specimen) == 1
    # Three specimens of each of three materials, in the same three colours.
    for colour in ("#0072b2", "#d55e00", "#009e73"):
        assert strokes(figure, colour) == 3


def test_the_slope_is_a_tangent_of_its_curve(tests: Characterisation) -> None:
    for material in tests.materials:
        for one, curve in zip(material.specimens, tests.curves[material.material], strict=True):
            assert one.toe_strain == 0.0 or one.zero_strain == 0.0
            # A rubber's tangent begins at rest, to 0.2 % of noise over its slope.
            assert abs(one.zero_strain) < 0.01
            middle = float(np.mean(one.linear_strain))
            drawn = one.modulus_MPa * (middle - one.zero_strain)
            measured = np.interp(one.toe_strain + middle, curve.strain, curve.stress_MPa)
            # A line lies on its curve within the noise; an arc has left its tangent by a fifth.
            assert drawn == pytest.approx(measured, rel=0.02 if one.toe_strain else 0.25)


def test_characterise_writes_its_figure(tmp_path: Path, samples: Path, capsys) -> None:
    figure, table = tmp_path / "tests.svg", tmp_path / "tests.csv"
    command = ["characterise", str(samples / "tensile"), "--figure", str(figure), "-o", str(table)]
    assert run(command) == 0
    said = capsys.readouterr().out
    assert f"wrote {table}" in said
    assert f"wrote {figure}" in said
    words(figure.read_bytes())
    table.unlink()
    assert run(command) == 2  # the figure is there, so that no table is written either
    assert not table.exists()
    same = [*command[:2], "--figure", str(tmp_path / "a.svg"), "-o", str(tmp_path / "a.svg")]
    assert run(same) == 2
    assert "name one place" in capsys.readouterr().err
