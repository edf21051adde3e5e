"""Units: published factors, cases that differ, and refusal by name."""

from pathlib import Path

import pytest

from planner.errors import FileError
from planner.formats.tensile import TensileTable, read_tensile
from planner.formats.units import quantities_of, unit_factor


@pytest.mark.parametrize(
    ("quantity", "unit", "factor"),
    [
        # NIST SP 811 (2008), appendix B.8, rounded there to the digits given here.
        ("force", "lbf", 4.448222),
        ("force", "kgf", 9.80665),
        ("force", "ozf", 0.2780139),
        ("stress", "psi", 6.894757e-3),
        ("stress", "ksi", 6.894757),
        ("length", "in", 25.4),
        ("strain", "%", 0.01),
        ("time", "min", 60.0),
    ],
)
def test_factors_are_the_published_ones(quantity: str, unit: str, factor: float) -> None:
    # 1e-6: the published factors have seven digits.
    assert unit_factor(quantity, unit, where="") == pytest.approx(factor, rel=1e-6)


def test_case_tells_only_milli_from_mega() -> None:
    assert unit_factor("force", "LBF", where="") == unit_factor("force", "lbf", where="")
    assert unit_factor("force", "mN", where="") == 1e-3
    assert unit_factor("force", "MN", where="") == 1e6
    with pytest.raises(FileError, match="'mn'"):
        unit_factor("force", "mn", where="")


def test_millipascals_are_no_megapascals() -> None:
    with pytest.raises(FileError, match=r"unknown unit 'mPa' of stress; did you mean MPa\?"):
        unit_factor("stress", "mPa", where="a.csv")
    assert unit_factor("stress", "mpa", where="") == unit_factor("stress", "MPA", where="") == 1.0


def test_unknown_unit_is_refused_by_name_with_the_known_ones() -> None:
    with pytest.raises(FileError, match=r"a\.csv: unknown unit 'furlong' of length.*'mm'"):
        unit_factor("length", "furlong", where="a.csv")
    assert not quantities_of("furlong")
    assert not quantities_of("")


def read(tmp_path: Path, heading: str) -> TensileTable:
    """A column of ones under a heading, beside a load and a travel that are understood."""
    path = tmp_path / "a.csv"
    path.write_text(f"{heading};true_stress_MPa;stretch\n" + "1;1;1\n" * 3)
    return read_tensile(path)[0]


@pytest.mark.parametrize(
    ("text", "column", "factor"),
    [
        ("Load (lbF)", "force_N", 4.4482216152605),
        ("force_N", "force_N", 1.0),
        ("displacement_mm", "displacement_mm", 1.0),
        ("Travel [in]", "displacement_mm", 25.4),
        ("Tensile strain (Displacement) (%)", "strain", 0.01),
        ("Tensile strain (Displacement)", "strain", 1.0),
        ("Elongation (%)", "strain", 0.01),
        ("Elongation (mm)", "displacement_mm", 1.0),
        ("Engineering Stress (MPa)", "stress_MPa", 1.0),
        ("True Strain", "true_strain", 1.0),
        ("Time (min)", "time_s", 60.0),
    ],
)
def test_headings_are_understood(tmp_path: Path, text: str, column: str, factor: float) -> None:
    # 1e-12: one rounding of the pound's factor.
    assert read(tmp_path, text).columns[column][0] == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("text", ["Maximum Load (N)", "Reading", "Tensile strain at Break (%)", ""])
def test_other_headings_are_not(tmp_path: Path, text: str) -> None:
    assert set(read(tmp_path, text).columns) == {"true_stress_MPa", "strain"}


@pytest.mark.parametrize("text", ["Load", "Extension", "Stress"])
def test_a_unit_has_to_be_stated_where_it_matters(tmp_path: Path, text: str) -> None:
    with pytest.raises(FileError, match=f"column '{text}': no unit"):
        read(tmp_path, text)


def test_a_strain_in_millimetres_is_an_extensometers_travel(tmp_path: Path) -> None:
    assert read(tmp_path, "Strain (in)").columns["displacement_mm"][0] == 25.4
    with pytest.raises(FileError, match="unknown unit 'N' of strain"):
        read(tmp_path, "Strain (N)")
