"""Campaigns from published measurements: their conversions, and what is said without the data."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld.real.__main__ import main
from benchmarks.withheld.real.adhesive import tension_of_shear
from benchmarks.withheld.real.coupons import coupon, fitted_palette, median_rate
from benchmarks.withheld.real.spreadsheet import read_numbers
from benchmarks.withheld.real.thesis import stand_in
from planner.gap.campaign_folder import read_campaign
from planner.palette import Reference
from printers.connex3.thesis import load_thesis


def test_shear_of_a_neo_hookean_block_is_its_tension() -> None:
    """Stress G g in shear is G (l - 1/l²) in tension at the same first invariant."""
    shear = np.array([0.0, 1e-3, 0.5, 3.0, 10.0])
    stretch, stress = tension_of_shear(shear, 0.2 * shear)
    np.testing.assert_allclose(stretch**2 + 2 / stretch, 3 + shear**2, rtol=1e-12)
    # at 0.001 the difference of the two terms has lost three digits
    np.testing.assert_allclose(stress, 0.2 * (stretch - stretch**-2), rtol=1e-12, atol=1e-15)
    assert stretch[0] == 1.0


def test_stand_in_curves_have_the_printed_figures() -> None:
    for published in load_thesis().elastomers:
        strain = np.linspace(0.0, published.elongation_at_break, 4001)
        stress = stand_in(published, strain)
        # trapezoids of 4000 steps, and the first of them for the slope
        assert np.trapezoid(stress, strain) == pytest.approx(published.toughness_MJ_m3, rel=1e-4)
        slope = stress[1] / strain[1]
        assert slope == pytest.approx(published.youngs_modulus_MPa, rel=5e-3)
        assert (np.diff(stress) > 0.0).all()


def test_numbers_of_a_spreadsheet(tmp_path: Path) -> None:
    main_name = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    rows = '<row><c r="A1"><v>1</v></c><c r="B1"><v>2.5</v></c></row><row><c r="A2"><v>3</v></c>'
    rows += '</row><row><c r="A3"><v>4e-1</v></c><c r="B3"><v>5</v></c></row>'
    sheet = f'<worksheet xmlns="{main_name}"><sheetData>{rows}</sheetData></worksheet>'
    with zipfile.ZipFile(tmp_path / "t.xlsx", "w") as book:
        book.writestr("xl/worksheets/sheet1.xml", sheet)
    # the half-empty row is left out
    np.testing.assert_array_equal(read_numbers(tmp_path / "t.xlsx"), [[1.0, 2.5], [0.4, 5.0]])


def test_coupons_start_at_rest() -> None:
    time_s = np.arange(1.0, 21.0)
    specimen = coupon("a", "m", time_s, 0.01 * time_s, 0.1 * time_s)
    assert specimen.time_s[0] == specimen.displacement_mm[0] == specimen.force_N[0] == 0.0
    assert specimen.strain[-1] == pytest.approx(0.2)
    assert specimen.area_mm2 is not None
    assert specimen.force_N[-1] / specimen.area_mm2 == pytest.approx(2.0)
    held = np.concatenate([0.01 * time_s, np.full(20, 0.2)])
    assert median_rate(np.arange(40.0), held) == pytest.approx(0.01)


def test_the_palette_is_fitted_to_the_reference_subset() -> None:
    strain = np.linspace(0.02, 1.0, 50)
    stress = 0.3 * ((1 + strain) - (1 + strain) ** -2.0)
    palette = fitted_palette(
        "p", {"m": [(strain, stress)]}, Reference(strain_rate_per_s=0.01), "made up"
    )
    assert palette.reference.strain_rate_per_s == 0.01
    assert palette.materials[0].elongation_at_break == pytest.approx(1.01)


def test_the_thesis_is_a_campaign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-o", str(tmp_path), "thesis"]) == 0
    assert "7 specimens" in capsys.readouterr().out
    campaign = read_campaign(tmp_path / "thesis")
    assert {s.material for s in campaign.specimens} == {p.id for p in load_thesis().elastomers}


def test_data_that_are_not_here_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["-o", str(tmp_path), "tape"]) == 1
    assert "give their folder with --data" in capsys.readouterr().err
    assert main(["--data", str(tmp_path), "-o", str(tmp_path), "tape"]) == 1
    assert "no folder hyperelastics_jl there" in capsys.readouterr().err
    assert not (tmp_path / "tape").exists()
