"""A bench: diagnoses of many campaigns, scored and summed up."""

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from planner.errors import FileError, UnknownNameError, nearest_names
from planner.gap.bench.answer import NO_ANSWER, read_answer
from planner.gap.bench.documents import Documents
from planner.gap.bench.hypothesis import EFFECT_IDS
from planner.gap.bench.score import Score, score
from planner.gap.bench.summary import Summary, summarise
from planner.gap.bench.truth import Truth

__all__ = ["Outcome", "Results", "check_effects", "score_outcomes"]


_TIERS = {
    name: place
    for place, name in enumerate(
        ("library", "other", "unclaimed", "none", "none-t4", "none-scatter", "pair", "cancelling",
         "confounded")
    )
}  # fmt: skip
"""The order of the rows; tiers of other benches follow by name of campaign."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one campaign: a diagnosis' document, or the problem that prevented it."""

    document: Mapping[str, Any] | None
    seconds: float | None = None
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class Results:
    """Scores of the campaigns that were diagnosed, in the order of their names.

    Attributes
    ----------
    problems
        By campaign: why there is no answer to score; such count as wrong.
    not_diagnosed
        Campaigns of the truth of which nothing was given; they count nowhere.
    """

    truth: Truth
    without: tuple[str, ...]
    scores: tuple[Score, ...]
    summary: Summary
    problems: Mapping[str, str]
    not_diagnosed: tuple[str, ...]

    def document(self, documents: Documents | None = None) -> dict[str, Any]:
        """Return the results for JSON, with the diagnoses themselves if given."""
        content: dict[str, Any] = {
            "schema": 1,
            "kind": "gap-bench",
            "truth": {
                "file": self.truth.file,
                "sha256": self.truth.sha256,
                "made_by": dict(self.truth.made_by),
                "campaigns": len(self.truth.campaigns),
            },
            "without": list(self.without),
            **self.summary.document(),
            "problems": dict(self.problems),
            "not_diagnosed": list(self.not_diagnosed),
            "scores": [asdict(s) for s in self.scores],
        }
        return content if documents is None else content | {"documents": dict(documents)}


def score_outcomes(
    outcomes: Mapping[str, Outcome], truth: Truth, *, without: Collection[str] = ()
) -> Results:
    """Score what became of each campaign.

    Raises
    ------
    FileError
        There is none, or the truth knows nothing of one.
    UnknownNameError
        An effect of `without` is none that a verdict may name.
    """
    check_effects(without)
    if not outcomes:
        raise FileError("no diagnosis to score")
    stranger = next((name for name in outcomes if name not in truth.campaigns), None)
    if stranger is not None:
        raise FileError(
            f"campaign {stranger}: {truth.file} knows nothing of it; give the truth that was "
            "written with the campaigns"
        )
    problems: dict[str, str] = {}
    scores = []
    for name in sorted(outcomes, key=lambda name: (_turn(truth, name), name)):
        outcome = outcomes[name]
        answer = NO_ANSWER
        if outcome.document is None:
            problems[name] = outcome.problem or "no diagnosis"
        else:
            try:
                answer = read_answer(outcome.document, name)
            except FileError as error:
                problems[name] = str(error)
        scores.append(
            score(name, answer, truth.campaigns[name], without=without, seconds=outcome.seconds)
        )
    return Results(
        truth=truth,
        without=tuple(sorted(without)),
        scores=tuple(scores),
        summary=summarise(scores),
        problems=problems,
        not_diagnosed=tuple(name for name in truth.campaigns if name not in outcomes),
    )


def check_effects(ids: Collection[str]) -> None:
    """Refuse ids that no verdict may name.

    Raises
    ------
    UnknownNameError
        Names what is near.
    """
    for unknown in sorted(set(ids) - EFFECT_IDS):
        near = nearest_names(unknown, sorted(EFFECT_IDS)) or sorted(EFFECT_IDS)
        raise UnknownNameError(f"no effect {unknown!r}; did you mean {', '.join(near)}?")


def _turn(truth: Truth, name: str) -> int:
    """Return the place of a campaign's tier: single effects first, the others by name."""
    return _TIERS.get(truth.campaigns[name].tier, len(_TIERS))
