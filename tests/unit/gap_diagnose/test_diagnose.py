"""The whole diagnosis of campaigns that planner itself makes: what it says, and that it repeats it.

Probabilities are held against one half and four fifths only: how sure it is, is for the withheld
check to say.
"""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.errors import UnknownNameError
from planner.formats.units import QUANTITY_UNITS
from planner.gap.campaign_folder import write_campaign
from planner.gap.diagnose import _places_of, diagnose, prepared
from planner.gap.diagnosis import Diagnosis
from planner.gap.effects import EFFECTS
from planner.gap.evidence.problem import Candidate

SURE = 0.8


def test_noise_of_the_load_cell_at_no_strain_is_no_gap(planned, imitated) -> None:
    """Forces that are zero but for it say nothing of what all forces have in common."""
    plan = planned(15, material=["TangoPlus", "FLX9760", "FLX9795"])
    made, rng = imitated(plan), np.random.default_rng(4)
    noisy = tuple(
        replace(s, force_N=s.force_N + 0.003 * s.force_N.max() * rng.standard_normal(len(s.time_s)))
        for s in made.specimens
    )
    problem, *_ = prepared(replace(made, specimens=noisy))
    where, _ = _places_of(problem, {}, Candidate(()))
    assert min(place.p for place in where) > 0.01


def test_nothing_is_none(of_nothing: Diagnosis) -> None:
    assert of_nothing.verdict == "none"
    assert of_nothing.ranking[0].probability > 0.5
    assert of_nothing.effect == ()
    assert of_nothing.remainder == ()
    assert of_nothing.ok


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, pytest.param(3, marks=pytest.mark.long)])
def test_other_draws_of_nothing_name_nothing(rates, imitated, seed: int) -> None:
    assert diagnose(imitated(rates, seed=seed)).verdict == "none"


def test_rate_is_rate(of_rate: Diagnosis) -> None:
    """Its size to three errors of 18 specimens' 3 % over two decades, twice for departing forms."""
    assert of_rate.verdict == "rate"
    assert of_rate.ranking[0].probability > 0.5
    assert of_rate.same_class[0] == ("rate",)
    assert of_rate.where[0].axis == "rate_mm_s"
    (effect,) = of_rate.effect
    assert effect.id == "rate"
    if effect.form == "power-law":
        assert effect.parameters["rise"] == pytest.approx(0.12, abs=0.03)
    for name, (low, high) in effect.interval.items():
        assert low <= effect.parameters[name] <= high
    assert not of_rate.ok


def test_a_figure_has_the_errors_that_the_words_have(of_rate: Diagnosis) -> None:
    """Every condition is left out once and none strays, so that the error before is theirs all."""
    assert of_rate.traces is not None
    of_each = np.mean(of_rate.traces.errors(of_rate.traces.before_N) ** 2, axis=1)
    for squares in (of_each, of_rate.traces.residual_before**2):
        assert np.sqrt(np.mean(squares)) == pytest.approx(of_rate.gap.before, rel=1e-9)


@pytest.mark.slow
def test_temperature_is_not_rate(planned, imitated) -> None:
    plan = planned(2, material=["FLX9760"], rate_mm_s=[0.85, 8.5], temperature_C=[23.0, 38.0])
    found = diagnose(imitated(plan, "temperature:slope=0.04"))
    assert found.verdict == "temperature"
    assert found.where[0].axis == "temperature_C"


def test_what_goes_together_is_told_as_one_class(planned, imitated) -> None:
    """All hot specimens were pulled fast: temperature slower by as much would look the same."""
    plan = planned(
        more=[
            {"material": m, "rate_mm_s": r, "temperature_C": t}
            for m in ("TangoPlus", "FLX9760")
            for r, t in ((0.085, 38.0), (0.85, 23.0))
            for _ in range(4)
        ]
    )
    found = diagnose(imitated(plan, "rate:rise=0.3,form=power-law"))
    named = {id for effects in found.same_class for id in effects}
    assert {"rate", "temperature"} <= named
    assert max(h.probability for h in found.ranking) < SURE


def test_probabilities_are_of_everything_weighed(of_rate: Diagnosis, of_nothing: Diagnosis) -> None:
    for found in (of_rate, of_nothing):
        total = sum(h.probability for h in found.ranking)
        assert 0.95 < total <= 1.0 + 1e-9  # twelve are told
        assert found.ranking[0].effects == found.same_class[0]
        assert found.verdict == found.ranking[0].name


@pytest.mark.long
def test_another_unit_hides_no_second_effect(rate_campaign, of_rate: Diagnosis) -> None:
    """Five of 18 specimens in pounds are found by name, and what acts on all beside them.

    What is predicted of tests that were left out is as good as without, to a fifth.
    """
    factor = QUANTITY_UNITS["force"]["lbf"]
    odd = (1, 3, 6, 8, 15)
    specimens = tuple(
        replace(s, force_N=s.force_N / factor) if k in odd else s
        for k, s in enumerate(rate_campaign.specimens)
    )
    found = diagnose(replace(rate_campaign, specimens=specimens))
    assert found.verdict == "force-scale+rate"
    assert found.ranking[0].probability > 0.5
    (gain,) = (effect for effect in found.effect if effect.id == "force-scale")
    assert gain.specimens == tuple(specimens[k].id for k in odd)
    assert [(u.unit, u.specimens) for u in found.unit_of] == [("lbf", gain.specimens)]
    assert found.gap.after == pytest.approx(of_rate.gap.after, rel=0.2)


def test_an_effect_without_its_covariate_is_not_testable(of_rate: Diagnosis) -> None:
    reasons = {u.id: u.reason for u in of_rate.not_testable}
    for id, says in (
        ("temperature", "temperature_C was 23 in all specimens"),
        ("moisture", "soak_h"),
        ("softening", "no specimen was unloaded"),
        ("interface-bleed", "no graded bar"),
    ):
        assert says in reasons[id]
    assert "rate" not in reasons
    named = {id for h in of_rate.ranking for id in h.effects}
    assert not named & set(reasons)


@pytest.mark.slow
def test_what_could_not_be_tested_but_looks_the_same_is_told(planned, imitated) -> None:
    """Of what shows along an axis of the verdict's, and how to settle it; of nothing else.

    Without unloading there would be no set, without a bar no boundary to bleed over.
    """
    plan = planned(3, material=["FLX9760"], protocol=["monotonic", "cyclic"])
    found = diagnose(imitated(plan, "softening:softening=0.6"))
    assert found.verdict in EFFECTS
    told = {s.partition(" ")[0]: s for s in found.limitations if "could not be tested" in s}
    axes = set(EFFECTS[found.verdict].where)
    for u in found.not_testable:
        shared = axes & set(EFFECTS[u.id].where)
        never = {"unloading", "bar"} & set(EFFECTS[u.id].channels)
        assert (u.id in told) == (bool(shared) and not never)
        if u.id in told:
            assert f"({u.reason}), but shows along " in told[u.id]
            assert all(axis in told[u.id] for axis in shared)
            assert f" as {found.verdict} does, and may be the cause instead" in told[u.id]
    assert told["rate"].endswith(
        "to settle it, test at two speeds that differ tenfold, and write rate_mm_s down, or hold "
        "a specimen at a strain"
    )
    assert told["material-law"].endswith("test a second material of the palette")


@pytest.mark.slow
def test_an_effect_taken_out_is_missed_and_not_replaced(rate_campaign) -> None:
    found = diagnose(rate_campaign, without=["rate"])
    assert all("rate" not in h.effects for h in found.ranking)
    if found.verdict not in ("unknown", "none"):
        assert found.ranking[0].probability < SURE
    assert found.where[0].axis == "rate_mm_s"
    assert not found.ok


def test_without_takes_effects_that_there_are(rate_campaign) -> None:
    with pytest.raises(UnknownNameError, match=r"`without` rat: no such effect; did you mean rate"):
        diagnose(rate_campaign, without=["rat"])


def test_without_everything_there_is_still_a_diagnosis(rate_campaign, rates, imitated) -> None:
    assert diagnose(imitated(rates), without=list(EFFECTS)).verdict == "none"
    assert diagnose(rate_campaign, without=list(EFFECTS)).verdict == "unknown"


def test_progress_is_told(rate_campaign, of_rate: Diagnosis) -> None:
    calls: list[tuple[int, int, str]] = []
    found = diagnose(rate_campaign, progress=lambda *call: calls.append(call))
    assert {what for _, _, what in calls} == {"forward model", "held-out conditions"}
    assert all(0 <= done <= total for done, total, _ in calls)
    assert found.json() == of_rate.json()


@pytest.mark.slow
def test_the_order_of_specimens_does_not_matter(rate_campaign, of_rate: Diagnosis) -> None:
    """To 1 %: sums are taken in another order, and modes are found to 0.05 nats."""
    turned = replace(rate_campaign, specimens=rate_campaign.specimens[::-1])
    found = diagnose(turned)
    assert found.verdict == of_rate.verdict
    assert found.ranking[0].probability == pytest.approx(of_rate.ranking[0].probability, rel=0.01)
    assert found.gap.before == pytest.approx(of_rate.gap.before, rel=0.01)


@pytest.mark.long
def test_another_process_and_other_threads_give_the_same_bytes(
    rate_campaign, tmp_path: Path
) -> None:
    write_campaign(rate_campaign, tmp_path / "lab")
    command = [sys.executable, "-m", "planner", "gap", "diagnose", "lab", "--json"]
    found = []
    for threads in ("1", "2"):
        names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
        environment = {**os.environ, **dict.fromkeys(names, threads)}
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, check=False
        )
        assert (done.returncode, done.stderr) == (1, b"")
        found.append(done.stdout)
    assert found[0] == found[1]
    assert b'"verdict": "rate"' in found[0]
