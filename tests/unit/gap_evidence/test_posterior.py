"""From evidence to probabilities and a verdict."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.gap.evidence import weigh
from planner.gap.evidence.posterior import UNKNOWN, Doubt, Evidence, posterior, ranking_of
from planner.gap.evidence.weigh import Effects, HypothesisKey, Weighed, coarsened

RATE, SLIP, BOTH = ("rate",), ("grip-slip",), ("grip-slip", "rate")
PRIOR = {
    ((), ""): np.log(0.6), (RATE, ""): np.log(0.1), (SLIP, ""): np.log(0.1),
    (BOTH, ""): np.log(0.02), ((), "operator"): np.log(0.1), (RATE, "operator"): np.log(0.01),
}  # fmt: skip


CERTAIN = Doubt(always=-50.0)


def weighed(evidence: dict[HypothesisKey, float]) -> Weighed:
    result = Weighed(())
    for (effects, axis), value in evidence.items():
        result.add(effects, axis, PRIOR[effects, axis], value)
    return result


def log_odds(found: Weighed, coarse: float = 400.0) -> dict[HypothesisKey, float]:
    return coarsened(found.log_prior, found.log_evidence, coarse)


def evidence_of(seed: int, size: float) -> dict[HypothesisKey, float]:
    rng = np.random.default_rng(seed)
    return {key: float(size * rng.standard_normal()) for key in PRIOR} | {((), ""): 0.0}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("size", [0.0, 3.0, 50.0, 5000.0])
def test_probabilities_sum_to_one_and_the_best_comes_first(seed: int, size: float) -> None:
    ranking = posterior(log_odds(weighed(evidence_of(seed, size))))
    assert sum(h.probability for h in ranking) == pytest.approx(1.0, abs=1e-12)
    assert all(0.0 <= h.with_unknown <= 1.0 + 1e-12 for h in ranking)
    values = [h.probability for h in ranking]
    assert values == sorted(values, reverse=True)
    # An unknown beside effects goes with these, one alone is a hypothesis of its own.
    assert {h.effects for h in ranking} == {(), RATE, SLIP, BOTH, UNKNOWN}


def test_without_evidence_the_prior_stands() -> None:
    ranking = {h.effects: h for h in posterior(log_odds(weighed(dict.fromkeys(PRIOR, 0.0))))}
    total = sum(np.exp(v) for v in PRIOR.values())
    assert ranking[()].probability == pytest.approx(0.6 / total)
    assert ranking[RATE].probability == pytest.approx(0.11 / total)
    assert ranking[RATE].with_unknown == pytest.approx(1.0 / 11.0)
    assert ranking[UNKNOWN].probability == pytest.approx(0.1 / total)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("coarse", [10.0, 400.0, 1e9])
def test_coarsening_keeps_the_order_and_never_sharpens(seed: int, coarse: float) -> None:
    values = evidence_of(seed, 300.0)
    odds = log_odds(weighed(values), coarse)
    gains = {key: odds[key] - PRIOR[key] for key in PRIOR}
    assert sorted(gains, key=lambda k: gains[k]) == sorted(values, key=lambda k: values[k])
    assert all(abs(gains[key]) <= abs(values[key]) + 1e-9 for key in PRIOR)
    assert gains[(), ""] == 0.0


def test_little_evidence_is_hardly_coarsened() -> None:
    """Ten nats of 400 lose a fortieth."""
    odds = log_odds(weighed({**dict.fromkeys(PRIOR, 0.0), (RATE, ""): 10.0}))
    assert odds[RATE, ""] - PRIOR[RATE, ""] == pytest.approx(10.0 / 1.025)


def test_more_evidence_is_more_probability() -> None:
    shares = []
    for gain in (0.0, 2.0, 10.0, 100.0, 1e3, 1e5):
        ranking = posterior(log_odds(weighed({**dict.fromkeys(PRIOR, 0.0), (RATE, ""): gain})))
        shares.append(next(h.probability for h in ranking if h.effects == RATE))
    assert np.all(np.diff(shares) >= 0.0)
    assert shares[2] > 0.99


def test_adding_evidence_adds_probabilities_not_logarithms() -> None:
    """Two forms of one effect, each of prior one half, are worth their mean."""
    result = weighed({((), ""): 0.0})
    for value in (3.0, 5.0):
        result.add(RATE, "", PRIOR[RATE, ""], value + float(np.log(0.5)))
    expected = np.log(0.5 * (np.exp(3.0) + np.exp(5.0)))
    assert result.log_evidence[RATE, ""] == pytest.approx(expected)


def evidence(gain: float, **changed: object) -> Evidence:
    """Return evidence of which the rate gains so many nats."""
    log_evidence = {**dict.fromkeys(PRIOR, 0.0), (RATE, ""): gain}
    plain = Evidence(
        log_prior=PRIOR, log_evidence=log_evidence, inexact={}, missing={}, same={}, specimens=30,
        heterogeneous=False,
    )  # fmt: skip
    return replace(plain, **changed)  # type: ignore[arg-type]


def probabilities(found: Evidence, doubt: Doubt = CERTAIN) -> dict[Effects, float]:
    return {h.effects: h.probability for h in ranking_of(found, 1e9, doubt)}


def test_without_doubt_the_ranking_is_the_posterior() -> None:
    odds = log_odds(weighed({**dict.fromkeys(PRIOR, 0.0), (RATE, ""): 3.0}), 1e9)
    plain = {h.effects: h.probability for h in posterior(odds)}
    assert probabilities(evidence(3.0)) == pytest.approx(plain)


@pytest.mark.parametrize("missing", [0.0, 0.5, 1.0])
def test_what_leaves_the_gap_open_gives_way_to_the_unknown(missing: float) -> None:
    """By the logistic share that its coefficients say, and nothing else moves."""
    found = evidence(30.0, missing={RATE: missing}, inexact={RATE: 1.0})
    before = probabilities(found)
    after = probabilities(found, Doubt(always=-2.0, missing=1.0, inexact=0.5, both=3.0))
    share = 1.0 / (1.0 + np.exp(2.0 - missing - 0.5 - 3.0 * missing))
    assert after[RATE] == pytest.approx((1.0 - share) * before[RATE])
    assert after[()] == pytest.approx(before[()])
    assert sum(after.values()) == pytest.approx(1.0)


def test_what_does_not_predict_gives_way_to_the_unknown() -> None:
    doubt = Doubt(-2.0, 0.0, 0.0, 0.0, 4.0)
    before = probabilities(evidence(30.0))
    shares = [
        1.0 - probabilities(evidence(30.0, predicts=p), doubt)[RATE] / before[RATE]
        for p in (1.0, 0.5, 0.0)
    ]
    assert shares == pytest.approx((1.0 / (1.0 + np.exp([2.0, 0.0, -2.0]))).tolist())


def test_effects_of_the_same_pattern_share_by_fit_alone() -> None:
    same = {(RATE, SLIP): -1.0, (SLIP, RATE): 1.0}
    found = probabilities(evidence(20.0, same=same))
    assert found[SLIP] / found[RATE] == pytest.approx(np.exp(-1.0))


def test_what_is_out_of_the_question_asks_for_no_discrepancy() -> None:
    """Where no specimen has a gain, evidence of it is minus infinity, and no share a number."""
    found = weighed({**dict.fromkeys(PRIOR, 0.0), (BOTH, ""): -np.inf})
    found.exact[RATE] = -1.0
    assert found.inexact(BOTH) == 0.0
    assert found.inexact(RATE) == pytest.approx(1.0 - np.exp(-1.0))
    ranking = posterior(log_odds(found))
    assert next(h.probability for h in ranking if h.effects == BOTH) == 0.0


def test_an_unknown_along_a_claimed_axis_is_as_likely_whatever_else_is_recorded() -> None:
    """Without a column of the lab's own the rest of the unknown does not move to the others."""

    def along(*claimed: bool) -> list[float]:
        problem = SimpleNamespace(unknown=[SimpleNamespace(claimed=c) for c in claimed])
        return weigh._of_axes(problem, 0.5, 0.01).tolist()  # type: ignore[arg-type]

    alone, beside = along(True, True), along(True, True, False)
    assert alone == beside[:2] == pytest.approx([np.log(0.5 * 0.01 / 2.0)] * 2)
    assert beside[2] == pytest.approx(np.log(0.5 * 0.99))
