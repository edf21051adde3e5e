"""The oracle: its noise is the bench's, its priors are the bench's draws, its verdicts hold."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld import oracle
from benchmarks.withheld.reality.campaign import Lab, open_lab
from benchmarks.withheld.reality.effects import EFFECTS, UNCLAIMED
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.sets import SETS

ROOT = Path(__file__).parents[2]
PALETTE = read_palette(
    (ROOT / "printers/connex3/palettes/connex3-tango-vero.toml").read_text(encoding="utf-8")
)


@cache
def opened(set_name: str, tier: str, index: int = 0) -> Lab:
    return open_lab(PALETTE, set_name, tier, 20, 3, index)  # type: ignore[arg-type]  # a set's name


@pytest.mark.parametrize("set_name", SETS)
def test_what_is_left_of_the_truth_is_white_noise_of_one(set_name: str) -> None:
    """Of some 480 forces and 900 strains: mean squares scatter by 0.06 and 0.05."""
    data = oracle._Data(opened(set_name, "none"))
    data.law = data.lab.law  # as the grades truly are
    residual = data.residual(data.predicted(np.zeros(2 * data.grades)))
    pulls, looks = np.split(residual, [data.pull.size])
    assert np.mean(pulls**2) == pytest.approx(1.0, abs=0.25)
    assert np.mean(looks**2) == pytest.approx(1.0, abs=0.2)
    # A model that is off by a common factor gains nothing by it: less than 4 standard deviations
    data.law = data.lab.law.shifted(np.full(data.grades, -0.02), np.zeros(data.grades))
    softer = data.residual(data.predicted(np.zeros(2 * data.grades)))
    assert softer @ softer > residual @ residual - 16.0


def test_draws_are_quantiles_of_the_forms_own_ranges() -> None:
    data = oracle._Data(opened("development", "none"))
    for effect in EFFECTS.values():
        for form in (*effect.library["development"], *effect.library["final"]):
            drawn = form.draw(np.random.default_rng(1), data.lab.design)
            for one in oracle._ways(effect, form, data):
                for z in (-8.0, 0.0, 8.0):
                    hidden = one.hidden(np.full(one.size, z), data)
                    assert hidden.cause.shape.keys() == drawn.keys()
                    share = {-8.0: 0.0, 0.0: 0.5, 8.0: 1.0}[z]
                    expected = form.low * (form.high / form.low) ** share
                    assert hidden.size == pytest.approx(expected, rel=1e-6)
    rate = EFFECTS["rate"].library["development"][0]
    (one,) = oracle._ways(EFFECTS["rate"], rate, data)
    shapes = [one.hidden(np.array([0.0, z]), data).cause.shape["tau_s"] for z in (-8.0, 8.0)]
    assert shapes == pytest.approx([2.0, 60.0])


def test_of_some_the_faulty_specimens_are_those_that_stand_out() -> None:
    data = oracle._Data(opened("development", "none"))
    data.order = np.arange(20)[::-1]
    some = EFFECTS["force-scale"].library["development"][1]
    ways = oracle._ways(EFFECTS["force-scale"], some, data)
    assert len(ways) == 12  # two signs, six counts
    for one in ways:
        shape = one.hidden(np.zeros(one.size), data).cause.shape
        affected = np.flatnonzero(shape["affected"])
        expected = range(20 - len(affected), 20) if shape["sign"] == 1.0 else range(len(affected))
        assert list(affected) == list(expected)
        # at least one of 20 over 3 chosen, a sign and a count
        assert one.log_prior < -np.log(1140.0 * 12.0) + 1e-9


def test_what_is_hidden_is_found_and_nothing_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(oracle, "EFFECTS", {id: EFFECTS[id] for id in ("ageing", "temperature")})
    clean = oracle._weighed(opened("development", "none"))
    assert oracle.oracle_score(clean).named
    assert clean["other_forms"] == {}
    hidden = oracle._weighed(opened("development", "library", 35))  # at a ratio of 15 to the noise
    assert hidden["truth"] == ["ageing"]
    assert hidden["other_forms"].keys() == {"temperature"}
    found = oracle.oracle_score(hidden)
    assert found.named
    assert found.left_out
    assert found.probability > 0.99


def test_scores_ask_for_five_nats() -> None:
    def of(truth: list[str], other: dict[str, float], **evidence: float) -> oracle.OracleScore:
        document = {"truth": truth, "log_evidence": evidence, "other_forms": other}
        return oracle.oracle_score(document)

    ahead = of(["rate"], {"skin": 5.0}, none=0.0, rate=9.0, skin=3.0)
    assert (ahead.named, ahead.left_out) == (True, False)
    assert ahead.probability == pytest.approx(1.0 / (1.0 + np.exp(-9.0) + np.exp(-6.0)))
    assert not of(["rate"], {}, none=0.0, rate=9.0, skin=4.5).named
    assert of(["rate"], {}, none=0.0, rate=9.0).left_out is None
    assert of([], {}, none=0.0, rate=4.5).named
    assert not of([], {}, none=0.0, rate=5.5).named
    assert UNCLAIMED.keys().isdisjoint(EFFECTS)
