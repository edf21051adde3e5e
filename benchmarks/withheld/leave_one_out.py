"""Diagnoses made without the effect that a campaign hides: is its absence noticed?"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from benchmarks.withheld.scoring import Answer, Score

__all__ = ["Case", "LeftOut", "by_effect"]


@dataclass(frozen=True)
class LeftOut:
    """One effect's campaigns; the gaps are medians over them of held-out RMS errors.

    Attributes
    ----------
    before, without, with_effect, floor
        Of the palette alone, of the diagnosis that did not know the effect, of the one that did,
        and of replicates. A diagnosis that models nothing leaves the gap as it was.
    true_effect
        With the effect as it was made, by the bench's own figures.
    named
        Times that the full diagnosis has the effect for its verdict.
    unknown, declared
        Verdicts "unknown" of the diagnosis without it, and others with a class of several.
    """

    effect: str
    campaigns: int
    before: float | None
    without: float | None
    with_effect: float | None
    floor: float | None
    true_effect: float
    named: int
    unknown: int
    declared: int
    misattributed: int
    where_hits: int

    def document(self) -> dict[str, Any]:
        """Return the row for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Case:
    """One campaign, diagnosed with and without its effect; an answer is None if that failed."""

    effect: str
    true_effect: float
    full: Answer | None
    full_score: Score
    less: Answer | None
    less_score: Score


def by_effect(cases: Sequence[Case]) -> list[LeftOut]:
    """Return a row for each effect, in alphabetical order."""
    groups: Mapping[str, list[Case]] = defaultdict(list)
    for case in cases:
        groups[case.effect].append(case)
    return [_row(effect, groups[effect]) for effect in sorted(groups)]


def _row(effect: str, cases: Sequence[Case]) -> LeftOut:
    unknown = sum(c.less_score.verdict == ("unknown",) for c in cases)
    return LeftOut(
        effect=effect,
        campaigns=len(cases),
        before=_median([_gap(c.full, "before") for c in cases]),
        without=_median([_after(c.less) for c in cases]),
        with_effect=_median([_after(c.full) for c in cases]),
        floor=_median([_gap(c.full, "floor") for c in cases]),
        true_effect=median(c.true_effect for c in cases),
        named=sum(c.full_score.top_1 for c in cases),
        unknown=unknown,
        declared=sum(bool(c.less_score.open) for c in cases) - unknown,
        misattributed=sum(c.less_score.misattributed for c in cases),
        where_hits=sum(bool(c.less_score.where_hit) for c in cases),
    )


def _gap(answer: Answer | None, name: str) -> float | None:
    return None if answer is None else answer.gap.get(name)


def _after(answer: Answer | None) -> float | None:
    after = _gap(answer, "after")
    return _gap(answer, "before") if after is None else after


def _median(values: Sequence[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return median(known) if known else None
