"""Designing a campaign: what it holds, what it promises, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.cli import run
from planner.errors import ArgumentError, UnknownNameError
from planner.gap.campaign import replicate_groups
from planner.gap.design import (
    CampaignDesign,
    Information,
    candidates_of,
    design_campaign,
)
from planner.gap.effect import untestable
from planner.gap.effects import EFFECTS
from planner.gap.virtual import read_design
from planner.palette import Palette, load_palette
from planner.printers import load_printer

PALETTE = Path(__file__).parents[2] / "printers/connex3/palettes/connex3-tango-vero.toml"
BUDGET = 16


@pytest.fixture(scope="module")
def palette() -> Palette:
    return load_palette(PALETTE)


@pytest.fixture(scope="module")
def made(palette: Palette) -> CampaignDesign:
    return design_campaign(["rate", "moisture"], BUDGET, palette=palette)


def test_every_condition_is_printed_once_a_batch(made) -> None:
    specimens = made.campaign.specimens
    assert len(specimens) == BUDGET - made.left_over
    groups = replicate_groups(specimens)
    assert len(groups) == made.conditions
    for group in groups:
        batches = [specimens[k].batch for k in group]
        assert batches.count("1") == batches.count("2") >= 1
    assert len({s.id for s in specimens}) == len(specimens)


def test_what_was_asked_for_can_be_tested(made) -> None:
    assert all(untestable(EFFECTS[id], made.campaign) is None for id in ("rate", "moisture"))
    assert untestable(EFFECTS["temperature"], made.campaign) is not None


def test_the_palettes_own_condition_is_among_them(made, palette) -> None:
    first, own = made.campaign.specimens[0], palette.reference
    assert first.rate_mm_s == pytest.approx(own.strain_rate_per_s * first.gauge_mm, rel=0.01)
    assert (first.temperature_C, first.soak_h) == (own.temperature_C, own.soak_h)
    assert (first.width_mm, first.thickness_mm, first.gauge_mm) == (6.0, 3.0, 25.0)


@pytest.mark.slow
def test_more_specimens_promise_more(made, palette) -> None:
    """With four times the specimens, smaller effects are named and the usual ones more surely."""
    less = design_campaign(["rate", "moisture"], made.least, palette=palette)
    for few, many in zip(less.expected, made.expected, strict=True):
        assert many.probability >= few.probability - 1e-9
        if few.smallest is not None:
            assert many.smallest <= few.smallest
    assert all(0.0 <= e.probability <= 1.0 for e in (*less.expected, *made.expected))


def test_what_one_section_cannot_split_is_said(palette) -> None:
    """Width, thickness and skin scale force alike but for their dependence on the section."""
    expected = design_campaign(["cross-section", "skin"], 8, palette=palette).expected
    assert expected[0].alike == ("skin",)
    assert expected[1].alike == ("cross-section",)


def test_information_of_one_effect_is_that_of_linear_models() -> None:
    """Rows a of an effect and b of a nuisance: half ln(1 + a'a - (a'b)^2 / (1 + b'b))."""
    rng = np.random.default_rng(3)
    rows = rng.standard_normal((5, 4, 2))
    told = Information(np.einsum("kri,krj->kij", rows, rows), [1])
    counts = np.array([1, 0, 2, 0, 1])
    m = np.tensordot(counts, told.pairs, axes=1)
    expected = 0.5 * np.log(1.0 + m[0, 0] - m[0, 1] ** 2 / (1.0 + m[1, 1]))
    assert told.nats(counts) == pytest.approx(expected, rel=1e-12)
    more = told.filled(counts, 5)
    one_more = [told.nats(counts + np.eye(5, dtype=int)[k]) for k in range(5)]
    best = int(np.argmax([v if counts[k] < 2 else -1.0 for k, v in enumerate(one_more)]))
    assert more[best] == counts[best] + 1


def test_an_effect_of_many_forms_weighs_no_more_than_another() -> None:
    """Forms that are told apart equally well: the same information for one as for three."""
    one, three = (Information(np.eye(forms)[None] * 7.0, [forms]) for forms in (1, 3))
    counts = np.array([1])
    assert three.nats(counts) == pytest.approx(one.nats(counts), rel=1e-12)


def test_every_effect_has_candidates_that_make_it_testable(palette, made) -> None:
    for id, effect in EFFECTS.items():
        candidates = candidates_of(palette, [id])
        assert untestable(effect, replace(made.campaign, specimens=candidates)) is None, id


def test_sizes_are_the_labs_own(palette) -> None:
    made = design_campaign(
        ["orientation"], 4, palette=palette, width_mm=10.0, thickness_mm=4.0, gauge_mm=50.0
    )
    assert {(s.width_mm, s.thickness_mm, s.gauge_mm) for s in made.campaign.specimens} == {
        (10.0, 4.0, 50.0)
    }
    assert {s.rate_mm_s for s in made.campaign.specimens} == {1.7}  # 0.034 per s on 50 mm


@pytest.mark.slow
def test_bars_where_boundaries_matter(palette, tmp_path, capsys) -> None:
    arguments = ["gap", "design", "--effects", "interface-bleed", "--budget", "6", "-o"]
    assert run([*arguments, str(tmp_path / "plan")]) in (0, 1)
    assert list((tmp_path / "plan" / "profiles").glob("*.csv"))
    assert "fields.csv" in capsys.readouterr().err
    plan = read_design(tmp_path / "plan", palette, printer=load_printer("connex3"), camera=False)
    assert any(s.profile is not None for s in plan.specimens)
    assert run([*arguments, str(tmp_path / "plan.csv")]) == 2
    assert not (tmp_path / "plan.csv").exists()


@pytest.mark.slow
def test_the_command_writes_a_campaign_to_be_measured(tmp_path, capsys, palette) -> None:
    arguments = ["gap", "design", "--effects", "rate, moisture", "--budget", str(BUDGET)]
    for name in ("one", "two"):
        assert run([*arguments, "--json", "-o", str(tmp_path / name)]) == 0
    files = sorted(p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*.*"))
    assert all(
        (tmp_path / "one" / f).read_bytes() == (tmp_path / "two" / f).read_bytes() for f in files
    )
    first, second = capsys.readouterr().out.replace('"one"', '"two"').split("\n}\n")[:2]
    assert first == second
    document = json.loads(first + "\n}")
    assert [e["effect"] for e in document["expected"]] == ["rate", "moisture"]
    assert (tmp_path / "one" / "curves.csv").read_text().count("\n") == 1
    plan = read_design(tmp_path / "one", palette, printer=load_printer("connex3"), camera=False)
    assert len(plan.specimens) == document["specimens"]
    assert run(["gap", "diagnose", str(tmp_path / "one")]) == 2  # nothing is measured yet
    assert "nothing in curves.csv" in capsys.readouterr().err


def test_a_list_alone_can_be_written(tmp_path, palette) -> None:
    path = tmp_path / "plan.csv"
    arguments = ["gap", "design", "--effects", "orientation", "--budget", "4", "-q"]
    assert run([*arguments, "-o", str(path)]) in (0, 1)
    plan = read_design(path, palette, printer=load_printer("connex3"), camera=False)
    assert len(plan.specimens) == 4
    assert run([*arguments, "-o", str(path)]) == 2  # it is there


@pytest.mark.parametrize(
    ("effects", "budget", "error", "says"),
    [
        (["moistur"], 20, UnknownNameError, "did you mean moisture"),
        ([], 20, ArgumentError, "none"),
        (["rate", "rate"], 20, ArgumentError, "twice"),
        (["rate"], 1000, ArgumentError, "from 1 to 400"),
        (["ageing"], 2, ArgumentError, "at least 4,"),
        (["ageing"], -1, ArgumentError, "from 1 to 400"),
    ],
)
def test_bad_wishes_are_refused(palette, effects, budget, error, says) -> None:
    with pytest.raises(error, match=says):
        design_campaign(effects, budget, palette=palette)


def test_the_least_that_a_refusal_names_will_do(palette) -> None:
    with pytest.raises(ArgumentError, match="at least 4, 2 conditions"):
        design_campaign(["orientation"], 3, palette=palette)
    made = design_campaign(["orientation"], 4, palette=palette)
    assert made.least == 4
    assert untestable(EFFECTS["orientation"], made.campaign) is None


def test_sizes_out_of_bounds_are_refused(palette) -> None:
    with pytest.raises(ArgumentError, match="`gauge_mm`"):
        design_campaign(["rate"], 8, palette=palette, gauge_mm=float("nan"))
