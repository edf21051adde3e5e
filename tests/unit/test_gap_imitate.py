"""Campaigns that planner makes by its own model: stated effects, scatter, and that they say so."""

from pathlib import Path

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import ArgumentError, FileError, UnknownNameError
from planner.gap.campaign import Campaign
from planner.gap.campaign_folder import read_campaign
from planner.gap.effects import EFFECTS
from planner.gap.virtual import read_design, stated_effect, synthetic_campaign, virtual_strain
from planner.materials.laws import make_law
from planner.palette import Palette, load_palette
from planner.printers import load_printer

PALETTE = Path(__file__).parents[2] / "printers/connex3/palettes/connex3-tango-vero.toml"
HEAD = (
    "specimen,material,profile,width_mm,thickness_mm,gauge_mm,rate_mm_s,temperature_C,soak_h,"
    "age_days,orientation,protocol,batch\n"
)
ROWS = [
    "A1,FLX9760,,6,3,25,0.85,23,0,9,x,monotonic,1",
    "A2,FLX9760,,6,3,25,0.85,23,0,9,x,monotonic,2",
    "B1,FLX9760,,6,3,25,8.5,23,0,9,x,monotonic,1",
    "C1,TangoPlus,,6,3,25,0.85,23,0,9,x,cyclic,1",
    "D1,FLX9795,,6,3,25,0.85,23,0,9,x,relaxation,2",
    "E1,,bar.csv,6,3,32,1.09,23,0,9,x,monotonic,2",
]


@pytest.fixture(scope="module")
def palette() -> Palette:
    return load_palette(PALETTE)


@pytest.fixture
def listed(tmp_path: Path) -> Path:
    (tmp_path / "bar.csv").write_text("x_mm,coordinate\n0,0.1\n16,0.1\n16,0.9\n32,0.9\n")
    path = tmp_path / "specimens.csv"
    path.write_text(HEAD + "\n".join(ROWS) + "\n")
    return path


@pytest.fixture
def plan(listed: Path, palette: Palette) -> Campaign:
    return read_design(listed, palette, printer=load_printer("connex3"), camera=True)


def made(plan: Campaign, *effects: str, scatter: float = 0.0, seed: int = 1) -> Campaign:
    stated = [stated_effect(text, plan.palette) for text in effects]
    return synthetic_campaign(plan, stated, np.random.default_rng(seed), scatter=scatter)


def test_without_effect_or_scatter_coupons_follow_the_law(plan, palette) -> None:
    """To the sensor's noise of 0.1 % of the largest force, five deviations."""
    campaign = made(plan)
    for id in ("SIM-A1", "SIM-B1"):
        s = campaign.specimen(id)
        law = make_law(palette.resolve("FLX9760").law)
        force = 18.0 * law.nominal_stress_MPa(1.0 + s.strain)
        assert np.abs(s.force_N - force).max() < 5e-3 * force.max()
    strain = virtual_strain(palette, ["TangoPlus", "FLX9760", "FLX9795"])
    assert campaign.specimen("SIM-A1").strain.max() == pytest.approx(strain)
    assert strain < 0.6 * palette.resolve("FLX9795").elongation_at_break + 1e-12


def test_a_stated_rate_multiplies_the_fast_pull_alone(plan) -> None:
    """Ten times the rate, 0.2 of ln stress a decade."""
    before, after = made(plan), made(plan, "rate:rise=0.2,form=power-law")
    for id, ratio in (("SIM-A1", 1.0), ("SIM-B1", np.exp(0.2))):
        late = slice(80, None)
        shown = after.specimen(id).force_N[late] / before.specimen(id).force_N[late]
        assert np.median(shown) == pytest.approx(ratio, rel=0.002)


def test_a_bar_under_a_camera_strains_where_it_is_soft(plan) -> None:
    bar = made(plan).specimen("SIM-E1")
    last = bar.strain_field.strain[-1]
    soft = bar.strain_field.x_mm < 15.0
    assert last[soft].mean() > 3.0 * last[~soft].mean()
    assert last.mean() == pytest.approx(bar.strain[-1], rel=0.05)  # noise 2 %, 32 places


def test_scatter_is_as_stated(palette, tmp_path) -> None:
    """200 replicates of scatter 5 %: their deviation to 4 of its own standard errors."""
    rows = [f"S{i},FLX9760,,6,3,25,0.85,23,0,9,x,monotonic,1" for i in range(200)]
    path = tmp_path / "many.csv"
    path.write_text(HEAD + "\n".join(rows) + "\n")
    campaign = made(
        read_design(path, palette, printer=load_printer("connex3"), camera=False), scatter=0.05
    )
    middle = np.log([s.force_N[70:90].mean() for s in campaign.specimens])
    assert np.std(middle) == pytest.approx(0.05, rel=4.0 / np.sqrt(400.0))


def test_what_is_made_says_so_everywhere(plan) -> None:
    campaign = made(plan, "temperature:slope=0.03")
    assert "SIMULATED by planner gap simulate with temperature" in campaign.notes
    assert "simulated" in campaign.name
    assert all(s.id.startswith("SIM-") for s in campaign.specimens)
    assert all("SIMULATED" in str(s.covariates["simulated"]) for s in campaign.specimens)


def test_the_command_writes_a_campaign_and_the_same_again(listed, tmp_path, capsys) -> None:
    arguments = ["gap", "simulate", "--design", str(listed), "--effect", "rate:rise=0.12"]
    for name in ("one", "two"):
        assert run([*arguments, "--seed", "7", "-o", str(tmp_path / name)]) == 0
    files = sorted(p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*.*"))
    assert all(
        (tmp_path / "one" / f).read_bytes() == (tmp_path / "two" / f).read_bytes() for f in files
    )
    campaign = read_campaign(tmp_path / "one")
    assert len(campaign.specimens) == len(ROWS)
    assert run([*arguments, "--seed", "8", "-o", str(tmp_path / "three")]) == 0
    assert (tmp_path / "three" / "curves.csv").read_bytes() != (
        tmp_path / "one" / "curves.csv"
    ).read_bytes()
    assert "SIMULATED" in capsys.readouterr().out
    # What is simulated is a design, too.
    again = [*arguments[:3], str(tmp_path / "one"), "-o", str(tmp_path / "four")]
    assert run(again) == 0
    assert read_campaign(tmp_path / "four").covariates == ("simulated",)


def test_a_campaigns_specimens_are_followed_on_their_own_ways(listed, tmp_path, palette) -> None:
    assert run(["gap", "simulate", "--design", str(listed), "-o", str(tmp_path / "one"), "-q"]) == 0
    plan = read_design(tmp_path / "one", palette, printer=load_printer("connex3"), camera=False)
    first = read_campaign(tmp_path / "one")
    for old, new in zip(first.specimens, plan.specimens, strict=True):
        assert new.time_s[-1] == pytest.approx(old.time_s[-1], rel=1e-3)
        assert new.displacement_mm.max() == pytest.approx(old.displacement_mm.max(), rel=1e-3)


def test_a_campaign_stands_for_its_folder() -> None:
    folder = Path(__file__).parents[2] / "samples" / "warm-lab"
    given = {"effect": "rate:rise=0.12", "seed": 7}
    one = planner.synthesise_campaign(folder, **given)
    other = planner.synthesise_campaign(read_campaign(folder), **given)
    for a, b in zip(one.specimens, other.specimens, strict=True):
        assert (a.force_N == b.force_N).all()


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        ("rat:rise=0.1", UnknownNameError, "did you mean rate"),
        ("rate:rise=0.1,form=powerlaw", UnknownNameError, "did you mean power-law"),
        ("rate:slope=0.1", UnknownNameError, "slope"),
        ("rate:rise", ArgumentError, "NAME=VALUE"),
        ("rate:rise=9", ArgumentError, "0 to 0.8"),
        ("rate:rise=nan", ArgumentError, "rise nan: it must be a finite number"),
    ],
)
def test_a_misstated_effect_is_refused(palette, text, error, says) -> None:
    with pytest.raises(error, match=says):
        stated_effect(text, palette)


def test_every_effect_can_be_stated_by_its_id(palette) -> None:
    for id in EFFECTS:
        assert stated_effect(id, palette).effect.id == id


def test_bad_designs_are_refused(plan, palette, tmp_path) -> None:
    with pytest.raises(ArgumentError, match="scatter"):
        made(plan, scatter=1.0)
    path = tmp_path / "bare.csv"
    path.write_text("specimen,material,gauge_mm\nA,FLX9760,25\n")
    with pytest.raises(FileError, match="width_mm"):
        read_design(path, palette, printer=load_printer("connex3"), camera=False)
