"""The bench's campaigns: their format, their determinism, and that nothing of the truth leaks."""

import csv
import hashlib
import json
import tomllib
from collections import Counter
from dataclasses import fields, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld.reality.__main__ import main
from benchmarks.withheld.reality.campaign import make_campaign, open_lab
from benchmarks.withheld.reality.effects import EFFECTS
from benchmarks.withheld.reality.noise import Handling
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.protocol import ROWS
from benchmarks.withheld.reality.sets import SETS
from benchmarks.withheld.reality.tiers import TIERS
from benchmarks.withheld.reality.writing import campaign_files
from planner.materials.laws import make_law
from planner.printers import load_printer

ROOT = Path(__file__).parents[2]
PALETTE = read_palette(
    (ROOT / "printers/connex3/palettes/connex3-tango-vero.toml").read_text(encoding="utf-8")
)
REQUIRED = {
    *("specimen", "material", "profile", "width_mm", "thickness_mm", "gauge_mm", "rate_mm_s"),
    *("temperature_C", "soak_h", "age_days", "orientation", "protocol", "batch"),
}


def test_the_bench_reads_every_law_as_planner_does() -> None:
    """Of the bundled grades: Ogden's, and one that yields."""
    strain = np.linspace(0.0, 1.0, 101)
    laws = {m.id: m.law for m in load_printer("connex3").palette().materials}
    assert {laws[grade.id].model for grade in PALETTE.grades} == {"ogden", "yielding"}
    for grade in PALETTE.grades:
        expected = make_law(laws[grade.id]).nominal_stress_MPa(1.0 + strain)
        np.testing.assert_allclose(grade.stress_MPa(strain), expected, rtol=1e-12, atol=1e-15)


def made(set_name: str, tier: str, count: int) -> list[str]:
    return ["make", "--set", set_name, "--tier", tier, "--count", str(count), "--seed", "3"]


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def check_format(files: dict[str, str], name: str, specimens: int) -> None:
    """Hold a campaign's files against the contract, section 4."""
    campaign = tomllib.loads(files["campaign.toml"])
    assert set(campaign) <= {"schema", "name", "printer", "palette", "notes"}
    assert (campaign["schema"], campaign["name"]) == (1, name)
    grades = {m["id"]: m for m in tomllib.loads(files[campaign["palette"]])["material"]}
    rows = table(files["specimens.csv"])
    assert len(rows) == len({r["specimen"] for r in rows}) == specimens
    assert set(rows[0]) >= REQUIRED
    for row in rows:
        assert (row["material"] == "") != (row["profile"] == "")
        assert row["material"] in grades or row["profile"] in files
        assert row["orientation"] in "xyz"
        assert row["protocol"] in ("monotonic", "cyclic", "relaxation")
        assert all(float(row[c]) > 0 for c in ("width_mm", "thickness_mm", "gauge_mm", "rate_mm_s"))
        if row["profile"]:
            x = [float(p["x_mm"]) for p in table(files[row["profile"]])]
            assert x[0] == 0.0
            assert x[-1] == float(row["gauge_mm"])
            assert all(np.diff(x) > 0)
    curves = table(files["curves.csv"])
    by_specimen: dict[str, list[list[float]]] = {r["specimen"]: [] for r in rows}
    for row in curves:
        numbers = [float(row[c]) for c in ("time_s", "displacement_mm", "force_N")]
        assert np.isfinite(numbers).all()
        by_specimen[row["specimen"]].append(numbers)
    for row in rows:
        time, travel, _ = np.array(by_specimen[row["specimen"]]).T
        assert len(time) == ROWS + 1
        assert (np.diff(time) > 0).all()
        moving = np.abs(np.diff(travel)) > 0
        rate = np.median(np.abs(np.diff(travel)[moving]) / np.diff(time)[moving])
        # 0.1 ms of clock in the shortest row of the fastest test is 1 %
        assert rate == pytest.approx(float(row["rate_mm_s"]), rel=0.02)
        if row["material"]:
            strain = travel.max() / float(row["gauge_mm"])
            assert strain < 0.9 * grades[row["material"]]["elongation_at_break"]
    for row in table(files["fields.csv"]) if "fields.csv" in files else []:
        assert by_specimen[row["specimen"]]
        assert np.isfinite(float(row["strain"]))


@pytest.mark.parametrize(
    ("set_name", "tier"),
    [
        pytest.param(name, tier, marks=[pytest.mark.long] * ((number + turn) % len(SETS) > 0))
        for number, name in enumerate(SETS)
        for turn, tier in enumerate(TIERS)
    ],
)
def test_campaigns_are_as_the_contract_has_them(set_name: str, tier: str) -> None:
    campaign = make_campaign(PALETTE, set_name, tier, 30, 11, 0)
    check_format(dict(campaign_files(campaign)), campaign.name, 30)


def test_a_full_campaign_has_120_specimens_in_three_batches() -> None:
    campaign = make_campaign(PALETTE, "final", "none", 120, 11, 0)
    check_format(dict(campaign_files(campaign)), campaign.name, 120)
    assert set(campaign.design.batch) == {"B1", "B2", "B3"}
    replicates = Counter(campaign.design.condition.tolist())
    assert set(replicates.values()) == {3}


def test_every_factor_leaves_its_reference_and_is_nearly_uncorrelated() -> None:
    design = make_campaign(PALETTE, "development", "none", 120, 5, 0).design
    coupons = design.take(design.profile < 0)
    factors = [
        coupons.temperature_C != 23.0,
        coupons.soak_h > 0.0,
        coupons.age_days != 9.0,
        coupons.orientation != "x",
        coupons.protocol != "monotonic",
        ~np.isclose(coupons.strain_rate_per_s, 0.034, rtol=0.02),
    ]
    assert all(0.2 < np.mean(f) < 0.7 for f in factors)
    correlation = np.corrcoef(np.array(factors)) - np.eye(len(factors))
    # 32 conditions in random order correlate by 1/sqrt(32) = 0.18 each, 0.5 at worst of 15
    assert np.abs(correlation).max() < 0.4


def test_no_place_of_a_bar_is_strained_near_its_break() -> None:
    limits = {g.coordinate: g.break_strain for g in PALETTE.grades}
    at, ends = np.array(sorted(limits)), np.array([limits[m] for m in sorted(limits)])
    for index in range(5):
        campaign = make_campaign(PALETTE, "development", "none", 30, 21, index)
        for number, _, x_mm, strain in campaign.fields:
            profile = campaign.design.profiles[campaign.design.profile[number]]
            limit = np.interp(profile.at(x_mm), at, ends)
            assert (strain.max(axis=0) < 0.9 * limit).all()


def test_same_seed_same_bytes_and_other_seed_other_bytes() -> None:
    files = [
        campaign_files(make_campaign(PALETTE, "final", "other", 30, seed, 3)) for seed in (1, 1, 2)
    ]
    assert files[0] == files[1]
    assert files[0]["curves.csv"] != files[2]["curves.csv"]


def test_campaigns_with_other_truths_differ_in_names_and_force_alone() -> None:
    """One design and one noise for every truth: nothing but the measurement can tell them apart."""
    tiers = ("library", "other", "none", "pair", "cancelling", "unclaimed")
    campaigns = [make_campaign(PALETTE, "development", tier, 30, 4, 0) for tier in tiers]
    plain = campaigns[2]
    for campaign in campaigns:
        alike = replace(
            campaign,
            name=plain.name,
            specimen_ids=plain.specimen_ids,
            force_N=plain.force_N,
            fields=plain.fields,
        )
        assert campaign_files(alike) == campaign_files(plain)
        assert sorted(campaign.specimen_ids) != sorted(plain.specimen_ids) or campaign is plain
        shapes = [(t.shape, x.shape, e.shape) for _, t, x, e in campaign.fields]
        assert shapes == [(t.shape, x.shape, e.shape) for _, t, x, e in plain.fields]


def test_the_order_of_the_ids_says_nothing_of_the_design() -> None:
    """Spearman's rank correlation of the ids with the order of making, over campaigns."""
    ranks = []
    for index in range(6):
        ids = make_campaign(PALETTE, "development", "none", 30, 8, index).specimen_ids
        ranks.append(np.corrcoef(np.argsort(np.argsort(ids)), np.arange(30))[0, 1])
    # Each has a standard deviation of 1/sqrt(29); three standard errors of their mean
    assert abs(np.mean(ranks)) < 3.0 / np.sqrt(29 * 6)


def test_single_effects_take_turns() -> None:
    effects = [
        open_lab(PALETTE, "final", "library", 20, 9, index).hidden[0].cause.effect.id
        for index in range(len(EFFECTS))
    ]
    assert sorted(effects) == sorted(EFFECTS)


def test_the_sets_share_no_form_and_no_condition_off_the_reference() -> None:
    for effect in EFFECTS.values():
        for forms in (effect.library, effect.other):
            for one, another in combinations(forms.values(), 2):
                ranges = [{(f.name, f.low, f.high) for f in of_set} for of_set in (one, another)]
                assert not ranges[0] & ranges[1]
        names = [
            {f.name for s in by_set.values() for f in s}
            for by_set in (effect.library, effect.other)
        ]
        assert not names[0] & names[1]
        others = [f.name for of_set in effect.other.values() for f in of_set]
        assert len(set(others)) == len(others)
    for one, another in combinations([rules.levels for rules in SETS.values()], 2):
        for levels in fields(one):
            off = [set(getattr(of_set, levels.name)[1:]) for of_set in (one, another)]
            assert not off[0] & off[1]


def test_the_command_seals_the_truth_outside_and_prints_its_hash_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "set"
    command = [*made("development", "library", 2), "--specimens", "20", "-o"]
    assert main([*command, str(folder)]) == 0
    sealed = (tmp_path / "set.truth.json").read_bytes()
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split() == [hashlib.sha256(sealed).hexdigest(), "set.truth.json"]
    truth = json.loads(sealed)
    assert sorted(p.name for p in folder.iterdir()) == sorted(truth["campaigns"])
    for name, account in truth["campaigns"].items():
        assert len(account["effects"]) == 1
        files = {
            str(p.relative_to(folder / name)): p.read_text(encoding="utf-8")
            for p in (folder / name).rglob("*")
            if p.is_file()
        }
        check_format(files, name, 20)
        told = "".join(text for file, text in files.items() if file != "palette.toml")
        words = [account["effects"][0], account["causes"][0]["form"], "snr", "tier", "truth"]
        assert not [w for w in words if w in told]
    assert main([*command, str(folder)]) == 2
    assert "already there" in capsys.readouterr().err


def test_the_command_refuses_a_truth_among_the_campaigns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "set"
    command = made("final", "none", 1)
    assert main([*command, "-o", str(folder), "--truth", str(folder / "truth.json")]) == 2
    assert "outside" in capsys.readouterr().err
    assert main([*command, "--specimens", "5", "-o", str(folder)]) == 2
    assert "at least 20" in capsys.readouterr().err
    assert not folder.exists()


def test_pulls_begin_apart_and_are_written_otherwise_where_asked_for() -> None:
    """Forces stay as they are; travel is off by a toe, or is strain in per cent."""
    of = PALETTE, "validation", "none", 20, 3, 0
    usual, apart = (make_campaign(*of, handling=h) for h in (Handling(), Handling(0.01, 2)))
    np.testing.assert_array_equal(apart.force_N, usual.force_N)
    assert apart.truth == usual.truth
    end_mm = usual.displacement_mm.max(axis=1, keepdims=True)
    percent = apart.displacement_mm.max(axis=1) > 1.5 * end_mm[:, 0]
    assert percent.sum() == 2
    scale = np.where(percent, 100.0 / usual.design.gauge_mm, 1.0)[:, None]
    toe = (apart.displacement_mm / scale - usual.displacement_mm) / end_mm
    assert np.all(toe[:, 0] == 0.0)
    assert np.abs(toe).max() <= 0.02
    # Of twenty, the deviation is known to a sixth; bit by bit, so that no pull turns back.
    assert 0.005 < toe[np.arange(20), usual.displacement_mm.argmax(axis=1)].std() < 0.015
    there = np.sign(np.diff(usual.displacement_mm, axis=1))
    assert np.all(np.sign(np.diff(apart.displacement_mm, axis=1)) == there)
    with pytest.raises(ValueError, match="begin within"):
        Handling(toe=0.2)
