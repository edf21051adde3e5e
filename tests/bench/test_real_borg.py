"""Campaigns of the resins: what of the tables ends up where, on tables made up here."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld.real.borg import BORG, toe_compensated
from planner.gap.campaign import Campaign

MODULUS_MPA = 0.9
SECTIONS_MM = {"formlabs silicone ipa": (1.5, 3.0), "formlabs silicone mix": (1.2, 2.9)}
SPEED_MM_S = 500.0 / 60.0


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two washes of one neo-Hookean silicone, in discs and strips of lengths of their own."""
    folder = tmp_path_factory.mktemp("data") / "resins" / "borg_resins"
    folder.mkdir(parents=True)
    geometry = [
        "test,sterilization,resin,plate,specimen,L0_mm,d_or_thickness_mm,width_mm,area_mm2,broke,use"
    ]
    head = "resin,class,sterilization,plate,specimen,time_s,crosshead_mm,load_N"
    pulls, raw = [head], [head]
    for resin, (thickness, width) in SECTIONS_MM.items():
        for treatment in ("NS", "EtOH", "Autoclave"):
            for plate in "123":
                for number in "12":
                    length = 25.0 + int(plate)
                    name = f"{resin},{treatment},{plate},{number}"
                    area = thickness * width
                    geometry.append(
                        f"Tensile,{treatment},{resin},{plate},{number},{length},{thickness},"
                        f"{width},{area},1,1"
                    )
                    travel = 0.58 + SPEED_MM_S * 0.1 * np.arange(50)
                    stretch = 1.0 + travel / length
                    load = area * MODULUS_MPA / 3.0 * (stretch - stretch**-2.0)
                    for k, (x, f) in enumerate(zip(travel, load, strict=True)):
                        # names differ in case between the sheets
                        row = f"{name.split(',')[0].title()},Soft,{treatment},{plate},{number}"
                        raw.append(f"{row},{0.113 + 0.1 * k:.3f},{x},{f}")
                    pulls += raw[-50:-2]
                    raw.append(f"{row},5.113,{travel[-1] + 0.8},{-0.1}")
    (folder / "geometry.csv").write_text("\n".join(geometry) + "\n")
    (folder / "tension_raw.csv").write_text("\n".join(raw) + "\n")
    (folder / "tension_trimmed_by_authors.csv").write_text("\n".join(pulls) + "\n")
    return folder.parents[1]


def made(tables: Path, name: str) -> Campaign:
    """One campaign."""
    return BORG[f"borg-{name}"](tables)


def test_strain_and_force_are_as_recorded_on_a_shared_gauge(tables: Path) -> None:
    campaign = made(tables, "silicone")
    assert len(campaign.specimens) == 6
    assert {s.batch for s in campaign.specimens} == {
        f"formlabs-silicone-ipa-{plate}" for plate in "123"
    }
    for s in campaign.specimens:
        assert (s.gauge_mm, s.width_mm, s.thickness_mm) == (26.0, 3.0, 1.5)
        assert s.time_s[0] == s.displacement_mm[0] == s.force_N[0] == 0.0
        # the shared gauge goes at the speed that was set, so that replicates are of one rate
        speed = np.diff(s.displacement_mm) / np.diff(s.time_s)
        np.testing.assert_allclose(speed, SPEED_MM_S, rtol=1e-6)
        stretch = 1.0 + s.strain
        expected = 4.5 * MODULUS_MPA / 3.0 * (stretch - stretch**-2.0)
        np.testing.assert_allclose(s.force_N, expected, rtol=1e-6, atol=1e-9)
    assert campaign.specimens[0].strain[1] == pytest.approx(0.58 / 26.0)


def test_treatment_is_a_column_that_no_effect_claims(tables: Path) -> None:
    treated = made(tables, "silicone-treated")
    assert treated.palette.reference.strain_rate_per_s == pytest.approx(SPEED_MM_S / 26.0)
    assert treated.covariates == ("treatment",)
    assert {s.covariates["treatment"] for s in treated.specimens} == {"NS", "EtOH", "Autoclave"}


def test_the_section_is_told_or_not(tables: Path) -> None:
    """The wash's sections are 23 % smaller than drawn; forces are the same either way."""
    wrong, right = made(tables, "wrong-area"), made(tables, "right-area")
    assert [s.material for s in wrong.specimens] == ["formlabs-silicone-ipa"] * 6
    assert wrong.specimens[0].area_mm2 == pytest.approx(4.5)
    assert right.specimens[0].area_mm2 == pytest.approx(1.2 * 2.9)
    np.testing.assert_allclose(wrong.specimens[0].force_N, right.specimens[0].force_N)


def test_a_toe_is_taken_off_and_what_yields_left_out() -> None:
    """A straight line of 200 MPa from a strain of 0.03 on, with a rounded foot, to its yield."""
    strain = np.linspace(0.0, 0.2, 201)
    foot = 0.004 * np.logaddexp(0.0, (strain - 0.03) / 0.004)
    stress = np.minimum(200.0 * foot, 20.0)
    straightened, kept = toe_compensated(strain, stress)
    # what is left of the foot at its steepest fifth is below a thousandth
    np.testing.assert_allclose(kept, 200.0 * straightened, rtol=0.01)
    assert 0.85 * 20.0 < kept[-1] <= 0.91 * 20.0
