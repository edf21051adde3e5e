"""From evidence to probabilities and a verdict."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from planner.gap.diagnosis import Effects, Hypothesis
from planner.gap.evidence import weigh
from planner.gap.evidence.weigh import (
    UNKNOWN,
    Evidence,
    HypothesisKey,
    Priors,
    Weighed,
    axes_of,
    class_of,
    needed_nats,
    posterior,
    ranking_of,
    verdict_of,
)

RATE, SLIP, BOTH = ("rate",), ("grip-slip",), ("grip-slip", "rate")
PRIOR = {
    ((), ""): np.log(0.6), (RATE, ""): np.log(0.1), (SLIP, ""): np.log(0.1),
    (BOTH, ""): np.log(0.02), ((), "operator"): np.log(0.1), (RATE, "operator"): np.log(0.01),
}  # fmt: skip


def weighed(evidence: dict[HypothesisKey, float]) -> Weighed:
    result = Weighed(None, (), None)  # type: ignore[arg-type]
    for (effects, axis), value in evidence.items():
        result.add(effects, axis, PRIOR[effects, axis], value)
    return result


def log_odds(found: Weighed, temperature: float = 1.0) -> dict[HypothesisKey, float]:
    return {k: v + temperature * found.log_evidence[k] for k, v in found.log_prior.items()}


def evidence_of(seed: int, size: float) -> dict[HypothesisKey, float]:
    rng = np.random.default_rng(seed)
    return {key: float(size * rng.standard_normal()) for key in PRIOR} | {((), ""): 0.0}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("size", [0.0, 3.0, 50.0, 5000.0])
def test_probabilities_sum_to_one_and_the_best_comes_first(seed: int, size: float) -> None:
    found = weighed(evidence_of(seed, size))
    ranking = ranking_of(Evidence(found.log_prior, found.log_evidence), Priors())
    assert sum(h.probability for h in ranking) == pytest.approx(1.0, abs=1e-12)
    assert all(0.0 <= h.with_unknown <= 1.0 + 1e-12 for h in ranking)
    values = [h.probability for h in ranking]
    assert values == sorted(values, reverse=True)
    # An unknown beside effects goes with these, one alone is a hypothesis of its own.
    assert {h.effects for h in ranking} == {(), RATE, SLIP, BOTH, UNKNOWN}


def test_without_evidence_the_prior_stands() -> None:
    p, beside = posterior(log_odds(weighed(dict.fromkeys(PRIOR, 0.0))))
    total = sum(np.exp(v) for v in PRIOR.values())
    assert p[()] == pytest.approx(0.6 / total)
    assert p[RATE] == pytest.approx(0.11 / total)
    assert beside == {RATE: pytest.approx(1.0 / 11.0)}
    assert p[UNKNOWN] == pytest.approx(0.1 / total)


@pytest.mark.parametrize(("alone", "named"), [(50.0, True), (20.0, False)])
def test_effects_beside_an_unknown_go_by_the_likelier_of_both(alone: float, named: bool) -> None:
    """What a gap's own axis explains, and an effect mends, is no evidence for the effect."""
    evidence = dict.fromkeys(PRIOR, 0.0) | {
        (RATE, ""): alone, ((), "operator"): 40.0, (RATE, "operator"): 100.0,
    }  # fmt: skip
    p, beside = posterior(log_odds(weighed(evidence)))
    assert max(p, key=p.__getitem__) == (RATE if named else UNKNOWN)
    assert beside.get(RATE, 0.0) == pytest.approx(float(named))


def test_more_evidence_is_more_probability() -> None:
    shares = []
    for gain in (0.0, 2.0, 10.0, 100.0, 1e3, 1e5):
        p, _ = posterior(log_odds(weighed({**dict.fromkeys(PRIOR, 0.0), (RATE, ""): gain})))
        shares.append(p[RATE])
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
    return replace(Evidence(PRIOR, log_evidence), **changed)  # type: ignore[arg-type]


def probabilities(
    found: Evidence,
    temperature: float = 1.0,
    coarseness_nats: float = 1e-12,
    imitated: float = 0.0,
) -> dict[Effects, float]:
    priors = Priors(temperature=temperature, coarseness_nats=coarseness_nats, imitated=imitated)
    return {h.effects: h.probability for h in ranking_of(found, priors)}


def test_at_full_temperature_the_ranking_is_the_posterior() -> None:
    odds = log_odds(weighed({**dict.fromkeys(PRIOR, 0.0), (RATE, ""): 3.0}))
    assert probabilities(evidence(3.0)) == pytest.approx(posterior(odds)[0])


@pytest.mark.parametrize("temperature", [0.1, 0.5])
def test_evidence_counts_its_share(temperature: float) -> None:
    """Ten nats move odds by ten times the temperature, and no others."""
    before, after = (probabilities(evidence(gain), temperature) for gain in (0.0, 10.0))
    moved = np.log(after[RATE] / after[SLIP]) - np.log(before[RATE] / before[SLIP])
    alone = {key: prior for key, prior in PRIOR.items() if key[0] == RATE}
    share = np.exp(alone[RATE, ""]) / sum(np.exp(v) for v in alone.values())
    expected = np.log(share * np.exp(10.0 * temperature) + 1.0 - share)
    assert moved == pytest.approx(expected)


@pytest.mark.parametrize("gain", [0.0, 1.0, 8.0, 1e3])
def test_the_more_the_best_gains_the_less_evidence_counts(gain: float) -> None:
    """All of it where nothing gains, half of what is beyond the temperature at the coarseness."""
    priors = Priors(temperature=0.1, coarseness_nats=8.0)
    share = {0.0: 1.0, 1.0: 0.9, 8.0: 0.55, 1e3: 0.1 + 0.9 * 8.0 / 1008.0}[gain]
    assert priors.counted(gain) == pytest.approx(share)
    found = probabilities(evidence(gain), 0.1, 8.0)
    assert found == pytest.approx(probabilities(evidence(gain), share))


@pytest.mark.parametrize(
    ("rate", "slip", "counts"),
    [
        (("temperature_C",), ("strain", "material"), 0.1 + 0.9 * 8.0 / 28.0),
        (("temperature_C",), ("strain", "temperature_C"), None),  # what slip's form misses, too
        (("temperature_C", "branch"), ("strain",), None),  # of which a curve's course has some
        (("operator",), ("strain",), None),  # no effect's
        ((), (), None),
    ],
)
def test_what_columns_alone_tell_beside_another_effect_counts_as_if_alone(
    rate: tuple[str, ...], slip: tuple[str, ...], counts: float | None
) -> None:
    """Slip gains 500 nats, rate beside it 20, of which no error of slip's form has any."""
    priors = Priors(temperature=0.1, coarseness_nats=8.0)
    nats = {(SLIP, ""): 500.0, (BOTH, ""): 520.0, (BOTH, "operator"): 521.0}
    prior = {**PRIOR, (BOTH, "operator"): 0.0}
    axes = {"rate": rate, "grip-slip": slip} if rate else {}
    found = Evidence(prior, {**dict.fromkeys(prior, 0.0), **nats}, axes=axes)
    counted = weigh._counted_of(found, priors)
    plain = priors.counted(521.0)
    assert counted[SLIP, ""] == pytest.approx(500.0 * plain)
    assert counted[BOTH, ""] == pytest.approx(500.0 * plain + 20.0 * (counts or plain))
    assert counted[BOTH, "operator"] - counted[BOTH, ""] == pytest.approx(plain)


def test_what_columns_alone_tell_beside_two_effects_is_coarsened() -> None:
    three, axes = ("grip-slip", "rate", "skin"), {"rate": ["soak_h"], "skin": ["width_mm"]}
    nats = {(SLIP, ""): 500.0, (BOTH, ""): 520.0, (three, ""): 540.0}
    found = Evidence({}, {((), ""): 0.0, **nats}, axes=axes)
    plain = Priors().counted(540.0)
    assert weigh._counted_of(found, Priors())[three, ""] == pytest.approx(540.0 * plain)


@pytest.mark.parametrize("effects", [1, 5, 20])
def test_what_is_needed_is_what_then_counts(effects: int) -> None:
    priors = Priors()
    needed = needed_nats(priors, effects) - weigh._ALIKE_NATS
    odds = np.log(priors.none * effects / priors.single)
    assert priors.counted(needed) * needed == pytest.approx(odds)


UNLIKELY = 1.0 / (1.0 + np.exp(3.0))
"""Odds of twenty to one."""


def test_a_gap_within_the_floor_is_seldom_an_unknown_one() -> None:
    """What is named stays as it is: a right effect may be smaller than the scatter."""
    before, after = (probabilities(evidence(3.0, within_floor=w)) for w in (False, True))
    assert after[UNKNOWN] == pytest.approx(0.3 * before[UNKNOWN])
    assert after[()] == pytest.approx(before[()] + 0.7 * before[UNKNOWN])
    assert after[RATE] == pytest.approx(before[RATE])


def test_what_is_named_may_be_an_imitation_however_much_evidence_there_is() -> None:
    plain = probabilities(evidence(500.0))
    found = probabilities(evidence(500.0), imitated=0.1)
    assert found[RATE] == pytest.approx(0.9 * plain[RATE])
    assert found[()] == plain[()]
    assert sum(found.values()) == pytest.approx(1.0)
    # The more a pattern beside it explains, the likelier, but for its form's own error.
    for gain, nats, counts in ((500.0, 1e12, 1.0), (50.0, 50.0, 0.5), (5000.0, 50.0, 50 / 5050)):
        beside = evidence(gain)
        patterned = {**beside.log_evidence, (RATE, "operator"): gain + 4.0, (SLIP, ""): -99.0}
        priors = Priors(temperature=1.0, coarseness_nats=1e-12, imitated=0.1, imitation_nats=nats)
        ranking = ranking_of(replace(beside, log_evidence=patterned), priors)
        p = {h.effects: h.probability for h in ranking}
        odds = np.exp(4.0 * counts) / 9.0
        assert p[UNKNOWN] / p[RATE] == pytest.approx(odds, rel=1e-6)
        # Along what it varies along itself, a pattern is but its form's error.
        own = replace(beside, log_evidence=patterned, axes={"rate": ["operator"]})
        p = {h.effects: h.probability for h in ranking_of(own, priors)}
        assert p[UNKNOWN] / p[RATE] == pytest.approx(1.0 / 9.0, rel=1e-6)
    # Where there is no gap, nothing out of the library makes one.
    within = evidence(500.0, within_floor=True)
    assert probabilities(within, imitated=0.1) == probabilities(within)


def test_three_effects_are_likelier_an_imitation_than_two() -> None:
    found, priors = evidence(500.0), Priors(imitated=0.1)
    shares = [weigh._imitated((*BOTH, "skin")[:k], found, priors) for k in (1, 2, 3)]
    assert shares == pytest.approx([0.1, 0.1, 4.0 / 13.0])


def test_within_the_floor_of_one_condition_a_gain_is_scatter() -> None:
    found = evidence(3.0, within_floor=True, scatter_like=frozenset({"rate"}))
    plain, after = probabilities(evidence(3.0, within_floor=True)), probabilities(found)
    assert after[RATE] == pytest.approx(UNLIKELY * plain[RATE])
    assert after[()] == pytest.approx(plain[()] + (1.0 - UNLIKELY) * plain[RATE])


def test_the_kind_is_chosen_before_the_name() -> None:
    """Three names of a fifth each are likelier than an unknown cause of two fifths."""
    three = [Hypothesis(e, 0.2) for e in (RATE, SLIP, BOTH)]
    assert verdict_of([Hypothesis(UNKNOWN, 0.4), *three]) == RATE
    assert verdict_of([Hypothesis(UNKNOWN, 0.7), Hypothesis(RATE, 0.3)]) == UNKNOWN


def test_what_is_out_of_the_question_has_no_probability() -> None:
    """Where no specimen has a gain, evidence of it is minus infinity."""
    found = weighed({**dict.fromkeys(PRIOR, 0.0), (BOTH, ""): -np.inf})
    assert posterior(log_odds(found))[0][BOTH] == 0.0


def test_an_unknown_along_a_claimed_axis_is_as_likely_whatever_else_is_recorded() -> None:
    """Without a column of the lab's own the rest of the unknown does not move to the others."""

    def along(*claimed: bool) -> list[float]:
        problem = SimpleNamespace(unknown=[SimpleNamespace(claimed=c) for c in claimed])
        return weigh._of_axes(problem, 0.5, 0.01).tolist()  # type: ignore[arg-type]

    alone, beside = along(True, True), along(True, True, False)
    assert alone == beside[:2] == pytest.approx([np.log(0.5 * 0.01 / 2.0)] * 2)
    assert beside[2] == pytest.approx(np.log(0.5 * 0.99))


@pytest.mark.parametrize("within", [False, True])
def test_what_closes_nothing_of_a_gap_hardly_explains_it(within: bool) -> None:
    """Of one that is larger than the floor the cause is unknown; below it there is none."""
    plain = probabilities(evidence(3.0, within_floor=within))
    closes = {RATE: False, BOTH: False}
    found = probabilities(evidence(3.0, within_floor=within, closes=closes))
    to = () if within else UNKNOWN
    given = (1.0 - UNLIKELY) * (plain[RATE] + plain[BOTH])
    assert found[to] == pytest.approx(plain.get(to, 0.0) + given)
    assert found[RATE] == pytest.approx(UNLIKELY * plain[RATE])


@pytest.mark.parametrize("gain", [0.0, 3.0, 30.0])
def test_what_closes_nothing_speaks_for_what_closes_the_gap(gain: float) -> None:
    """In proportion, an unknown counting as three nats less than what gives."""
    plain = probabilities(evidence(gain))
    found = probabilities(evidence(gain, closes={RATE: False, BOTH: True, SLIP: True}))
    assert sum(found.values()) == pytest.approx(1.0)
    assert found[()] == pytest.approx(plain[()])
    given = (1.0 - UNLIKELY) * plain[RATE]
    whole = plain[BOTH] + plain[SLIP] + UNLIKELY * given
    for effects in (BOTH, SLIP):
        assert found[effects] == pytest.approx(plain[effects] * (1.0 + given / whole))
    assert found[RATE] == pytest.approx(UNLIKELY * plain[RATE])
    assert found[UNKNOWN] == pytest.approx(plain[UNKNOWN] + UNLIKELY * given * given / whole)


def test_what_hardly_fits_is_no_better_explanation() -> None:
    """A pair a thousand times less likely than what closes nothing leaves the cause unknown."""
    found = evidence(30.0, closes={RATE: False, BOTH: True})
    assert verdict_of(ranking_of(found, Priors(temperature=1.0))) == UNKNOWN


@pytest.mark.parametrize(("specimens", "most"), [(2, 0.2), (5, 0.8)])
def test_very_few_specimens_name_little(specimens: int, most: float) -> None:
    found = probabilities(evidence(50.0, specimens=specimens))
    assert found[RATE] == pytest.approx(most, abs=1e-6)
    assert found[UNKNOWN] == pytest.approx(1.0 - most, abs=1e-6)
    assert probabilities(evidence(50.0, specimens=6))[RATE] == pytest.approx(1.0, abs=1e-6)
    # Where they show no gap, there is nothing that could have an unknown cause.
    found = probabilities(evidence(50.0, specimens=specimens, within_floor=True))
    assert found[()] == pytest.approx(1.0 - most, abs=1e-6)


def test_a_gap_lies_where_its_likely_causes_do() -> None:
    """An unknown along its axis; one along every test anywhere."""
    where = {"rate": ("rate_mm_s", "time"), "grip-slip": ("time",)}
    problem = SimpleNamespace(
        effects={id: SimpleNamespace(where=w) for id, w in where.items()},
        unknown=[SimpleNamespace(axis=axis) for axis in ("operator", "any")],
    )
    p = {(): 0.1, RATE: 0.4, SLIP: 0.1, BOTH: 0.05, UNKNOWN: 0.35}
    ranking = [Hypothesis(effects, share) for effects, share in p.items()]
    keys = {
        ((), "operator"): 0.5,
        ((), "any"): 0.25,
        ((), weigh.EVERY_TEST): 0.25,
        (RATE, "any"): 9.0,
    }
    found = Evidence({key: np.log(share) for key, share in keys.items()}, dict.fromkeys(keys, 0.0))
    axes = axes_of(problem, found, ranking, Priors())  # type: ignore[arg-type]
    everywhere = 0.5 * 0.35
    expected = {"rate_mm_s": 0.45 + everywhere, "time": 0.55 + everywhere, "operator": 0.35}
    assert axes == pytest.approx({axis: p / 0.9 for axis, p in expected.items()})


def test_errors_fall_by_more_than_an_idle_effect_moves_them() -> None:
    before = np.array([1.0, 1.0])  # of forces, of strains
    assert weigh._falls(before, np.array([0.99, 1.0]))
    assert weigh._falls(before, np.array([1.01, 0.9]))
    assert not weigh._falls(before, np.array([0.998, 0.998]))
    assert not weigh._falls(before, np.array([1.01, 1.0]))
    assert not weigh._falls(0.0 * before, 0.0 * before)  # where no camera looked on


def test_what_raises_errors_of_force_speaks_for_what_does_without() -> None:
    plain = probabilities(evidence(3.0))
    found = probabilities(evidence(3.0, without={BOTH: RATE}))
    given = (1.0 - UNLIKELY) * plain[BOTH]
    assert found[RATE] == pytest.approx(plain[RATE] + given)
    assert found[BOTH] == pytest.approx(plain[BOTH] - given)


@pytest.mark.parametrize(
    ("extra", "left", "kept"),
    [(10.0, 0.5, False), (12.0, 0.5, True), (12.0, 1.0, False), (100.0, 1.0, True)],
)
def test_what_gains_more_than_a_wrong_form_could_is_kept(
    monkeypatch: pytest.MonkeyPatch, extra: float, left: float, kept: bool
) -> None:
    """A third of a pattern is a ninth of the gain; what closes nothing gains no more than both."""
    error = {RATE: 0.5, BOTH: left}
    problem = SimpleNamespace(
        model=SimpleNamespace(test_of=np.arange(8)),
        squared_errors=lambda candidate: np.full(8, error[candidate]),
    )
    found = SimpleNamespace(
        plain=SimpleNamespace(problem=problem),
        best={RATE: RATE, BOTH: BOTH},
        log_evidence={((), ""): -4.0, (RATE, ""): 95.0, (BOTH, ""): 95.0 + extra},
        errors=lambda effects, own: (np.ones((8, 2)), np.full((8, 2), error[effects])),
    )
    monkeypatch.setattr(weigh, "_rise", lambda rise: True)
    _, without = weigh._explained(found, within_floor=False)  # type: ignore[arg-type]
    assert without == ({} if kept else {BOTH: RATE})


@pytest.mark.parametrize(("rise", "expected"), [(0.0, False), (0.05, True)])
def test_errors_rise_where_they_do_so_in_most_tests(rise: float, expected: bool) -> None:
    """Of ten tests; a single test says nothing."""
    own = 0.02 * np.random.default_rng(0).standard_normal(10)
    assert weigh._rise(rise + own - own.mean()) is expected
    assert not weigh._rise(np.ones(1))


@pytest.mark.parametrize(("fall", "closes"), [(0.1, True), (0.05, False)])
def test_within_the_floor_errors_have_to_fall_by_more_than_chance(
    fall: float, closes: bool
) -> None:
    """Of six specimens that each fall by a tenth more or less: the level is 2.02 / √6 of that."""
    apart = 0.1 * np.array([-1.3, -0.8, -0.3, 0.3, 0.8, 1.3])
    before, after = (
        np.stack([forces, np.zeros(6)], axis=1)
        for forces in (1.0 + 0.0 * apart, 1.0 - fall - apart)
    )
    problem = SimpleNamespace(
        model=SimpleNamespace(test_of=np.zeros(6, dtype=int)),
        squared_errors=lambda candidate: np.ones(6),
    )
    found = SimpleNamespace(
        plain=SimpleNamespace(problem=problem),
        best={RATE: RATE},
        log_evidence={((), ""): 0.0, (RATE, ""): 6.0},
        errors=lambda effects, own: (before, after),
    )
    for within_floor, expected in ((False, True), (True, closes)):
        told, _ = weigh._explained(found, within_floor=within_floor)  # type: ignore[arg-type]
        assert told == {RATE: expected}
    # The floor is of forces: what a camera sees of one bar counts as it is.
    before[0, 1] = 0.1
    told, _ = weigh._explained(found, within_floor=True)  # type: ignore[arg-type]
    assert told == {RATE: True}


@pytest.mark.parametrize("mean", [1.6, 1.8])  # the level is 2.92 / √3
def test_a_rise_is_by_students_one_sided_test(mean: float) -> None:
    rises = mean + np.array([-1.0, 0.0, 1.0])
    by_chance = ttest_1samp(rises, 0.0, alternative="greater").pvalue
    assert weigh._rise(rises) is bool(by_chance < 0.05)


@pytest.mark.parametrize(("groups", "each"), [(1, 18), (3, 6), (15, 2)])
def test_a_palette_without_an_error_is_within_the_floor_in_nineteen_of_twenty(
    groups: int, each: int
) -> None:
    """Specimens are made so that they differ by just the floor; their means are drawn."""
    rng, n, within = np.random.default_rng(3), groups * each, []
    members = np.arange(n).reshape(groups, each)
    problem = SimpleNamespace(
        strays=np.zeros(n, dtype=bool),
        campaign=SimpleNamespace(specimens=[None] * n),
        model=SimpleNamespace(replicates=members.tolist()),
        replicate_floor=lambda: np.ones(n),
    )
    for _ in range(2000):
        level = rng.standard_normal((groups, each))
        mean = level.mean(axis=1, keepdims=True)
        error = (mean + (level - mean) / level.std(axis=1, ddof=1, keepdims=True)) ** 2
        problem.squared_errors = Mock(return_value=error.ravel())
        within.append(weigh._within_floor(problem))  # type: ignore[arg-type]
    # Three standard errors of 2,000.
    assert np.mean(within) == pytest.approx(0.95, abs=0.015)


@pytest.mark.parametrize("within_floor", [False, True])
def test_an_unknown_is_of_one_class_with_what_it_resembles(within_floor: bool) -> None:
    """Rate fits by 40 nats, and a pattern beside it by 40 more: a cause like rate, or rate itself.

    Slip fits neither. A gap within the scatter resembles nothing.
    """
    found = weighed(
        {((), ""): 0.0, (RATE, ""): 40.0, (SLIP, ""): 0.0, (BOTH, ""): 36.0,
         ((), "operator"): 20.0, (RATE, "operator"): 80.0}
    )  # fmt: skip
    evidence = replace(Evidence(found.log_prior, found.log_evidence), within_floor=within_floor)
    ranking = ranking_of(replace(evidence, within_floor=False), Priors())
    assert verdict_of(ranking) == UNKNOWN
    known = SimpleNamespace(logs=SimpleNamespace(priors=Priors()), best={})
    alike = class_of(Mock(), known, evidence, ranking, UNKNOWN)  # type: ignore[arg-type]
    assert alike[0] == UNKNOWN
    assert (RATE in alike) == (not within_floor)
    assert SLIP not in alike


def test_effects_that_are_known_beside_their_own_axis_alone_have_a_probability() -> None:
    """A gain of some specimens that a column tells is that column's, which an effect may claim."""
    prior = {**PRIOR, (BOTH, "rate_mm_s"): PRIOR[BOTH, ""]}
    del prior[BOTH, ""]
    found = Evidence(prior, dict.fromkeys(prior, 0.0), axes={"rate": ["rate_mm_s"]})
    shares = [h.probability for h in ranking_of(found, Priors())]
    assert sum(shares) == pytest.approx(1.0)
    assert min(shares) > 0.0
