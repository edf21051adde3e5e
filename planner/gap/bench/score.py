"""One campaign's diagnosis held against its truth."""

import math
from collections.abc import Collection
from dataclasses import dataclass

from planner.gap.bench.answer import NO_ANSWER, Answer
from planner.gap.bench.hypothesis import (
    NONE,
    UNKNOWN,
    Effects,
    hypothesis_count,
    named,
)
from planner.gap.bench.truth import CampaignTruth

__all__ = ["CONFIDENT", "Score", "score"]

CONFIDENT = 0.8
"""Above this probability a diagnosis is sure of what it says."""

_LEAST_PROBABILITY = 1e-6
"""In place of 0 in the log score, which would be infinite."""

_LOOKED_AT = 2


@dataclass(frozen=True, slots=True)
class Score:
    """What is right and wrong in one diagnosis; None where a measure has no meaning.

    Attributes
    ----------
    expected
        The right answer: the hidden effects, none, or unknown where one is out of the library.
    answered
        False where the diagnosis failed; it then counts as wrong.
    top_1
        The verdict is the right answer, the whole set of it.
    probability
        On the right answer.
    class_hit
        The right answer is the verdict or in its class.
    false_alarm
        Nothing is hidden, and the verdict is not "none".
    missed
        Something is hidden, and the verdict is "none".
    misattributed
        A wrong set of effects is named with P > `CONFIDENT`; a named verdict that the ranking
        does not have counts as certain.
    partly
        The verdict has at least one of the hidden effects.
    companion
        One effect is hidden, and the verdict names it and others.
    open
        An effect out of the library is hidden, and the verdict is "unknown" or a class of several.
    honest
        The design cannot tell the truth from others of its class: the class reported has the
        truth, and no single name has P > `CONFIDENT`, unless the others of the truth's class were
        declared not testable.
    where_hit
        One of the true axes is among the first two reported.
    closure_error
        Distance of the closure reported from that with the true effect.
    covered
        The interval of the closure has that of the true effect.
    probability_unknown
        That an effect out of the library is at work.
    leading_probability, leading_right
        Of the first of the ranking.
    log_score
        Natural logarithm of the probability of the right answer; what the ranking leaves out
        shares what is left of 1.
    log_gain
        The same above that of a guess, even over all hypotheses that could be weighed.
    seconds
        As the caller took them.
    """

    campaign: str
    tier: str
    snr: float | None
    detectability: float | None
    expected: Effects
    verdict: Effects
    answered: bool
    top_1: bool
    probability: float
    class_hit: bool
    false_alarm: bool | None
    missed: bool | None
    misattributed: bool
    partly: bool | None
    companion: bool | None
    open: bool | None
    honest: bool | None
    where_hit: bool | None
    closure_error: float | None
    covered: bool | None
    probability_unknown: float
    leading_probability: float | None
    leading_right: bool
    log_score: float
    log_gain: float
    seconds: float | None = None


def score(
    campaign: str,
    answer: Answer,
    truth: CampaignTruth,
    *,
    without: Collection[str] = (),
    seconds: float | None = None,
) -> Score:
    """Score one diagnosis.

    Parameters
    ----------
    without
        Effects that the diagnosis was made without; where one of them is hidden, the right answer
        is "unknown".
    """
    expected, verdict = truth.expected(without), answer.verdict
    foreign = expected == UNKNOWN
    closed = None if foreign else truth.closed
    closure_error = covered = None
    if closed is not None:
        if answer.closed is not None:
            closure_error = abs(answer.closed - closed)
        if answer.closed_interval is not None:
            low, high = answer.closed_interval
            covered = (low is None or low <= closed) and (high is None or closed <= high)
    log_score, log_gain = _logarithms(answer, expected, without)
    leading = answer.ranking[0] if answer.ranking else None
    return Score(
        campaign=campaign,
        tier=truth.tier,
        snr=truth.snr,
        detectability=truth.detectability,
        expected=expected,
        verdict=verdict,
        answered=answer is not NO_ANSWER,
        top_1=verdict == expected,
        probability=answer.probability(expected),
        class_hit=verdict == expected or expected in answer.same_class,
        false_alarm=None if truth.effects else verdict != NONE,
        missed=verdict == NONE if truth.effects else None,
        misattributed=answer is not NO_ANSWER and _misattributed(answer, expected),
        partly=bool(set(verdict) & set(truth.effects)) if truth.effects and not foreign else None,
        companion=set(verdict) > set(expected) if len(expected) == 1 and not foreign else None,
        open=verdict == UNKNOWN or len(answer.same_class) > 1 if foreign else None,
        honest=_honest(answer, truth, expected) if len(truth.same_class) > 1 else None,
        where_hit=bool(truth.where & set(answer.where[:_LOOKED_AT])) if truth.where else None,
        closure_error=closure_error,
        covered=covered,
        probability_unknown=answer.probability_unknown,
        leading_probability=None if leading is None else leading[1],
        leading_right=leading is not None and leading[0] == expected,
        log_score=log_score,
        log_gain=log_gain,
        seconds=seconds,
    )


def _confident_names(answer: Answer) -> set[Effects]:
    """Return the sets of effects that the answer is sure of."""
    sure = {effects for effects, p in answer.ranking if p > CONFIDENT and named(effects)}
    ranked = {effects for effects, _ in answer.ranking}
    if named(answer.verdict) and answer.verdict not in ranked:
        sure.add(answer.verdict)
    return sure


def _misattributed(answer: Answer, expected: Effects) -> bool:
    return bool(_confident_names(answer) - {expected})


def _honest(answer: Answer, truth: CampaignTruth, expected: Effects) -> bool:
    others = truth.same_class - {truth.effects}
    excused = all(set(effects) & answer.not_testable for effects in others)
    return expected in answer.same_class and (excused or not _confident_names(answer))


def _logarithms(answer: Answer, expected: Effects, without: Collection[str]) -> tuple[float, float]:
    count = hypothesis_count({*without, *answer.not_testable})
    ranked = {effects for effects, _ in answer.ranking}
    if expected in ranked:
        p = answer.probability(expected)
    else:
        rest = 1.0 - math.fsum(p for _, p in answer.ranking)
        p = rest / max(count - len(ranked), 1)
    log_score = math.log(max(p, _LEAST_PROBABILITY))
    return log_score, log_score + math.log(count)
