"""One campaign's diagnosis held against its sealed truth."""

import hashlib
import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from planner.errors import FileError
from planner.formats.files import decode_document

__all__ = [
    "CONFIDENT",
    "EFFECT_IDS",
    "NONE",
    "NO_ANSWER",
    "UNKNOWN",
    "Answer",
    "CampaignTruth",
    "Effects",
    "Score",
    "Truth",
    "effects_of",
    "hypothesis_count",
    "named",
    "read_answer",
    "read_truth",
    "score",
]


# ------------------------------------------------------------------------------------------------
# Hypotheses as sets of effect ids, and how many of them a diagnosis chooses from.


Effects = tuple[str, ...]
"""Effect ids, sorted."""

NONE: Effects = ()
UNKNOWN: Effects = ("unknown",)

EFFECT_IDS = frozenset(
    {
        *("rate", "temperature", "moisture", "ageing", "orientation", "composition-offset"),
        *("interface-bleed", "softening", "permanent-set", "grip-slack", "grip-slip"),
        *("machine-compliance", "cross-section", "force-scale", "force-offset", "strain-scale"),
        *("skin", "material-law"),
    }
)
"""What a verdict may name; whatever else causes a gap is unknown."""


def effects_of(ids: Iterable[str]) -> Effects:
    """Return the hypothesis that a list of ids stands for.

    The list ["none"] is the empty one, and a list that has "unknown" beside others is "unknown":
    whoever says so says that the others do not suffice.
    """
    found = {i for i in ids if i not in ("none", "")}
    return UNKNOWN if "unknown" in found else tuple(sorted(found))


def named(effects: Effects) -> bool:
    """Tell whether a hypothesis names a cause: it is neither "none" nor "unknown"."""
    return effects not in (NONE, UNKNOWN)


def hypothesis_count(left_out: Iterable[str] = ()) -> int:
    """Return how many hypotheses there are: none, unknown, each effect and each pair.

    Parameters
    ----------
    left_out
        Effects that were not testable or not known to the diagnosis.
    """
    n = len(EFFECT_IDS - set(left_out))
    return 2 + n + n * (n - 1) // 2


# ------------------------------------------------------------------------------------------------
# The sealed truth of a set of campaigns.


@dataclass(frozen=True, slots=True)
class CampaignTruth:
    """What one campaign hides.

    Attributes
    ----------
    effects
        Ids, sorted; () is none. One that is not in `EFFECT_IDS` stands for "unknown".
    same_class
        Hypotheses that the design cannot tell apart by construction, the truth among them.
    where
        Axes of which at least one carries the gap.
    snr, detectability
        None where nothing is hidden.
    before, with_true_effect, noise
        Normalised RMS errors of force: of the palette, with the effect, and of the bench itself.
    """

    tier: str
    effects: Effects
    same_class: frozenset[Effects]
    where: frozenset[str]
    snr: float | None
    detectability: float | None
    before: float
    with_true_effect: float
    noise: float

    def expected(self, without: Collection[str] = ()) -> Effects:
        """Return the right answer of a diagnosis that does not know the effects `without`."""
        foreign = any(i not in EFFECT_IDS or i in without for i in self.effects)
        return UNKNOWN if foreign else self.effects

    @property
    def closed(self) -> float | None:
        """Share of the gap that the true effect closes; None where there is none to close."""
        gap = self.before - self.noise
        if not self.effects or gap <= 0.0:
            return None
        return 1.0 - (self.with_true_effect - self.noise) / gap


@dataclass(frozen=True, slots=True)
class Truth:
    """A truth file: its hash, the options it was made by, and its campaigns by folder name."""

    file: str
    sha256: str
    made_by: Mapping[str, Any]
    campaigns: Mapping[str, CampaignTruth]


class _Cause(msgspec.Struct):
    effect: str
    where: list[str]


class _TruthGap(msgspec.Struct):
    before: float
    with_true_effect: float
    noise: float


class _Campaign(msgspec.Struct):
    tier: str
    effects: list[str]
    causes: list[_Cause]
    gap: _TruthGap
    same_class: list[list[str]] = msgspec.field(name="class", default_factory=list)
    snr: float | None = None
    detectability: float | None = None


class _File(msgspec.Struct):
    schema: Literal[1]
    kind: Literal["withheld-truth"]
    campaigns: dict[str, _Campaign]
    made_by: dict[str, Any] = {}


def read_truth(path: str | Path, *, sha256: str | None = None) -> Truth:
    """Read a truth file.

    Parameters
    ----------
    sha256
        The hash that was published of it; None does not check.

    Raises
    ------
    FileError
        The file cannot be read, breaks its schema, or is not the one that was published.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror or error}); give the truth file that was "
            "written when the campaigns were made"
        ) from error
    found = hashlib.sha256(data).hexdigest()
    if sha256 is not None and found != sha256.strip().casefold():
        raise FileError(
            f"{path}: its sha256 is {found}, the published one {sha256}; the file is not the one "
            "that was sealed"
        )
    file = decode_document(data, _File, path.name)
    if not file.campaigns:
        raise FileError(f"{path.name}: no campaign; there is nothing to score")
    campaigns = {name: _truth(entry, f"{path.name}, {name}") for name, entry in
                 sorted(file.campaigns.items())}  # fmt: skip
    return Truth(path.name, found, file.made_by, campaigns)


def _truth(entry: _Campaign, place: str) -> CampaignTruth:
    effects = effects_of(entry.effects)
    caused = effects_of(cause.effect for cause in entry.causes)
    if caused != effects or len(entry.causes) != len(effects):
        raise FileError(
            f"{place}: effects are {', '.join(effects) or 'none'}, causes "
            f"{', '.join(caused) or 'none'}; they must be the same, one cause an effect"
        )
    return CampaignTruth(
        tier=entry.tier,
        effects=effects,
        same_class=frozenset({effects, *(effects_of(ids) for ids in entry.same_class)}),
        where=frozenset(axis for cause in entry.causes for axis in cause.where),
        snr=entry.snr if effects else None,
        detectability=entry.detectability if effects else None,
        before=entry.gap.before,
        with_true_effect=entry.gap.with_true_effect,
        noise=entry.gap.noise,
    )


# ------------------------------------------------------------------------------------------------
# What a diagnosis' JSON document answers, as far as it is scored.


_SLACK = 1e-3


@dataclass(frozen=True, slots=True)
class Answer:
    """The scored part of a diagnosis.

    Attributes
    ----------
    ranking
        Hypotheses and their probabilities, most probable first.
    probability_unknown
        That something unknown is at work: alone, or beside the effects of another hypothesis
        (its ``with_unknown``, where the document has it).
    same_class
        Hypotheses that the data cannot tell apart, the verdict always among them.
    where
        Axes, the leading one first.
    closed_interval
        An open end is None.
    gap
        ``before``, ``after`` and ``floor``, None where not known.
    """

    verdict: Effects
    ranking: tuple[tuple[Effects, float], ...]
    probability_unknown: float
    same_class: frozenset[Effects]
    not_testable: frozenset[str]
    where: tuple[str, ...]
    closed: float | None
    closed_interval: tuple[float | None, float | None] | None
    gap: Mapping[str, float | None]

    def probability(self, effects: Effects) -> float:
        """Return the probability of a hypothesis, 0 where the ranking does not have it."""
        return sum(p for found, p in self.ranking if found == effects)


NO_ANSWER = Answer(("no answer",), (), 0.0, frozenset(), frozenset(), (), None, None, {})
"""In place of a diagnosis that failed: right about nothing."""


class _Ranked(msgspec.Struct):
    effects: list[str]
    probability: float
    with_unknown: float = 0.0


class _Place(msgspec.Struct):
    axis: str


class _AnswerGap(msgspec.Struct):
    before: float | None = None
    after: float | None = None
    floor: float | None = None
    closed: float | None = None
    closed_interval: tuple[float | None, float | None] | None = None


class _Document(msgspec.Struct):
    verdict: str
    ranking: list[_Ranked]
    where: list[_Place]
    gap: _AnswerGap
    same_class: list[list[str]] = msgspec.field(name="class")
    not_testable: list[str] = []


def read_answer(document: Mapping[str, Any], name: str) -> Answer:
    """Read the scored part of a diagnosis' JSON document; further keys may be there.

    Raises
    ------
    FileError
        A key is missing or of another kind, or probabilities are none; the message names the key.
    """
    try:
        read = msgspec.convert(document, _Document)
    except msgspec.ValidationError as error:
        raise FileError(
            f"{name}: not a diagnosis' document: {error}; write it with planner gap diagnose --json"
        ) from error
    for ranked in read.ranking:
        for key in ("probability", "with_unknown"):
            if not 0.0 <= getattr(ranked, key) <= 1.0:
                raise FileError(
                    f"{name}: ranking has a {key} of {getattr(ranked, key):g} for "
                    f"{'+'.join(ranked.effects) or 'none'}; it must be from 0 to 1"
                )
    total = math.fsum(ranked.probability for ranked in read.ranking)
    if total > 1.0 + _SLACK:
        raise FileError(
            f"{name}: the probabilities of the ranking sum to {total:g}; they must sum to 1 at most"
        )
    verdict = effects_of(read.verdict.split("+"))
    ranking = [(effects_of(ranked.effects), ranked.probability) for ranked in read.ranking]
    return Answer(
        verdict=verdict,
        ranking=tuple(sorted(ranking, key=lambda ranked: -ranked[1])),
        probability_unknown=min(1.0, math.fsum(map(_unknown, read.ranking))),
        same_class=frozenset({verdict, *(effects_of(ids) for ids in read.same_class)}),
        not_testable=frozenset(read.not_testable),
        where=tuple(place.axis for place in read.where),
        closed=read.gap.closed,
        closed_interval=read.gap.closed_interval,
        gap={name: getattr(read.gap, name) for name in ("before", "after", "floor")},
    )


def _unknown(ranked: _Ranked) -> float:
    share = 1.0 if effects_of(ranked.effects) == UNKNOWN else ranked.with_unknown
    return ranked.probability * share


# ------------------------------------------------------------------------------------------------
# One campaign's diagnosis held against its truth.


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
    megabytes
        The most memory that the process had taken so far.
    oracle
        Whether who knows the bench's forms and noise has the right answer, or may say that the
        effect is not in the library; None where it was not asked.
    oracle_probability
        The same's, on the truth.
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
    megabytes: float | None = None
    oracle: bool | None = None
    oracle_probability: float | None = None

    @property
    def beside_oracle(self) -> bool | None:
        """Tell whether what the oracle was asked is reached: named, or declared open.

        None where it was not asked.
        """
        if self.oracle is None:
            return None
        return self.top_1 if self.open is None else self.open


def score(
    campaign: str,
    answer: Answer,
    truth: CampaignTruth,
    *,
    without: Collection[str] = (),
    seconds: float | None = None,
    megabytes: float | None = None,
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
        megabytes=megabytes,
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
