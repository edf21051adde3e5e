"""What a diagnosis' JSON document answers, as far as it is scored."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from planner.errors import FileError
from planner.gap.bench.hypothesis import UNKNOWN, Effects, effects_of

__all__ = ["NO_ANSWER", "Answer", "read_answer"]

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


class _Gap(msgspec.Struct):
    before: float | None = None
    after: float | None = None
    floor: float | None = None
    closed: float | None = None
    closed_interval: tuple[float | None, float | None] | None = None


class _Document(msgspec.Struct):
    verdict: str
    ranking: list[_Ranked]
    where: list[_Place]
    gap: _Gap
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
