"""Whole parts in a campaign's folder: read, written, refused, and what effects can be tested."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.errors import FileError
from planner.gap.campaign_folder import read_campaign, write_campaign
from planner.gap.effect import untestable
from planner.gap.effects import effects_for
from planner.gap.observations import ObservationModel
from planner.gap.quality import examine
from planner.gap.virtual import synthesise_campaign
from planner.simulation.bar_solver import predict
from planner.simulation.part_response import PartResponse

TOML = 'schema = 1\nname = "fingers"\nprinter = "connex3"\npalette = "connex3-tango-vero"\n'
HEAD = (
    "specimen,material,part,fix,move,load,width_mm,thickness_mm,gauge_mm,rate_mm_s,temperature_C\n"
)
PART = 'P1,,finger.json,x=min,"x=max: 0,0,8 mm",,,,,1,23\n'
COUPON = "C1,FLX9760,,,,,6,2,25,1,23\n"
D = 10.0 * np.array([0.02, *np.arange(0.1, 1.05, 0.1)])
RESPONSE = PartResponse(
    "finger", D, 0.3 * D, np.array([0.0, 0.5]), np.outer(D, (0.012, 0.004)),
    np.tile([0.7, 0.3], (len(D), 1)), thickness_mm=2.0,
)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "campaign.toml").write_text(TOML)
    (tmp_path / "specimens.csv").write_text(HEAD + PART + PART.replace("P1", "P2") + COUPON)
    (tmp_path / "finger.json").write_bytes(RESPONSE.encode())
    rows = [
        f"{s},{t:g},{np.sign(force) * t:g},{force * t:g}"
        for s, force in (("P1", 0.3), ("P2", -0.303), ("C1", 0.6))
        for t in np.linspace(0.0, 8.0, 41)
    ]
    text = "specimen,time_s,displacement_mm,force_N\n" + "\n".join(rows) + "\n"
    (tmp_path / "curves.csv").write_text(text)
    return tmp_path


def test_a_response_is_read_as_it_was_written(folder: Path) -> None:
    read = PartResponse.read(folder / "finger.json")
    assert read.encode() == RESPONSE.encode()
    # Mean strain 0.7 * 0.12 + 0.3 * 0.04 at 10 mm.
    assert read.gauge_mm == pytest.approx(10.0 / 0.096)


def test_parts_stand_beside_coupons(folder: Path) -> None:
    campaign = read_campaign(folder)
    p1, p2, c1 = campaign.specimens
    assert p1.part is not None
    assert (p1.part.fix, p1.part.move, p1.part.load) == ("x=min", "x=max: 0,0,8 mm", "")
    assert (p1.named, c1.named, p1.gauge_mm) == ("part finger", "FLX9760", RESPONSE.gauge_mm)
    assert not p2.pushed  # travel counts along the load, however it was recorded
    assert p2.part is p1.part
    assert any("P2" in remark and "sign was turned" in remark for remark in campaign.remarks)
    model = ObservationModel(campaign)
    assert model.tests == ((0, 1), (2,))
    force = predict(model.setup, model.laws).force_N[0]
    np.testing.assert_allclose(force, 0.3 * model.setup.travel_mm[0], rtol=1e-6, atol=1e-6)
    assert examine(campaign, model) == ()


def test_what_is_written_is_read_again(folder: Path) -> None:
    campaign = read_campaign(folder)
    written = write_campaign(campaign, folder / "written")
    assert (written / "parts/finger.json").read_bytes() == RESPONSE.encode()
    again = read_campaign(written)
    assert [s.part and s.part.move for s in again.specimens] == [
        s.part and s.part.move for s in campaign.specimens
    ]
    twice = write_campaign(again, written.parent / "twice")
    assert (written / "specimens.csv").read_bytes() == (twice / "specimens.csv").read_bytes()


def test_a_part_is_simulated_as_far_as_its_response_goes(folder: Path) -> None:
    (folder / "curves.csv").write_text("specimen,time_s,displacement_mm,force_N\n")
    made = synthesise_campaign(folder, scatter=0.0)
    assert made.specimens[0].displacement_mm.max() == pytest.approx(10.0)
    assert made.specimens[0].force_N[-1] == pytest.approx(3.0, rel=0.02)


def test_beyond_its_response_a_part_is_not_compared(folder: Path) -> None:
    short = replace(
        RESPONSE, displacement_mm=0.5 * D, force_N=0.15 * D, strain=0.5 * RESPONSE.strain
    )
    (folder / "finger.json").write_bytes(short.encode())
    campaign = read_campaign(folder)
    model = ObservationModel(campaign)
    assert any("as far as the part was simulated" in text for text in model.limitations)
    assert model.setup.travel_mm[0].max() == pytest.approx(5.0)


def test_nobody_knows_what_a_section_would_do_to_parts_alone(folder: Path) -> None:
    campaign = read_campaign(folder)
    parts = replace(campaign, specimens=campaign.specimens[:2])
    effects = effects_for(campaign.palette)
    for id in ("cross-section", "skin", "interface-bleed"):
        assert untestable(effects[id], parts) is not None, id
    assert untestable(effects["composition-offset"], parts) is None
    assert untestable(effects["cross-section"], campaign) is None


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("P1,FLX9760,finger.json,,,,,,,1,23\n", "line 2: give exactly one of"),
        ("P1,FLX9760,,x=min,,,6,2,25,1,23\n", "line 2: 'fix' goes with a part"),
        ("P1,,finger.json,,,,,,25,1,23\n", "line 2: a part has no 'gauge_mm'"),
        ("P1,,plan,x=min,,,,,,1,23\n", "specimen P1: part plan: give 'fix' and one of"),
        ("P1,,specimens.csv,,,,,,,1,23\n", "specimen P1: .*not the JSON document"),
        ('P1,,plan,x=min,"x=max: 0,0,8 mm",,,,,1,23\n', "specimen P1: .*plan: no such file"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(folder: Path, rows: str, message: str) -> None:
    (folder / "specimens.csv").write_text(HEAD + rows)
    with pytest.raises(FileError, match=message) as caught:
        read_campaign(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"force_N": -0.3 * D}, "force is not above 0"),
        ({"displacement_mm": D[::-1]}, "does not rise"),
        ({"share": np.tile([0.7, 0.7], (len(D), 1))}, "do not add up to 1"),
        ({"strain": np.outer(D, (0.012,))}, "differ in length"),
    ],
)
def test_a_response_that_is_none_is_refused(change: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(FileError, match=message):
        replace(RESPONSE, **change)


def test_a_column_load_without_parts_is_a_lab_s_own(folder: Path) -> None:
    (folder / "specimens.csv").write_text(
        "specimen,material,width_mm,thickness_mm,gauge_mm,load\nC1,FLX9760,6,2,25,5 kN cell\n"
    )
    campaign = read_campaign(folder)
    assert campaign.specimens[0].covariates == {"load": "5 kN cell"}


def test_strains_along_a_part_are_left_out(folder: Path) -> None:
    (folder / "fields.csv").write_text(
        "specimen,time_s,x_mm,strain\nP1,1,1,0.1\nP1,1,2,0.1\nP1,2,1,0.2\nP1,2,2,0.2\n"
    )
    campaign = read_campaign(folder)
    assert campaign.specimens[0].strain_field is None
    assert any("whole part" in remark for remark in campaign.remarks)
