"""A bench: diagnoses of many campaigns, made in several processes or read, and scored."""

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.withheld.answers import Outcome, Task, answer_all
from benchmarks.withheld.scoring import (
    EFFECT_IDS,
    NO_ANSWER,
    Answer,
    Score,
    Truth,
    read_answer,
    score,
)
from benchmarks.withheld.summary import Summary, summarise
from planner.errors import FileError, UnknownNameError, nearest_names

__all__ = [
    "Documents",
    "Results",
    "check_effects",
    "diagnose_all",
    "read_documents",
    "score_outcomes",
    "scored",
]


# ------------------------------------------------------------------------------------------------
# Diagnoses that were written before, to be scored again.


Documents = Mapping[str, Mapping[str, Any]]
"""By campaign."""

_DIAGNOSIS = "diagnosis.json"


def read_documents(path: str | Path) -> Documents:
    """Read diagnoses from a folder, or from the results of an earlier bench.

    A folder holds ``CAMPAIGN.json`` or ``CAMPAIGN/diagnosis.json``.

    Raises
    ------
    FileError
        Nothing there, or not JSON.
    """
    path = Path(path)
    if path.is_file():
        documents = _json(path).get("documents")
        if not isinstance(documents, dict):
            raise FileError(
                f"{path}: no documents in it; give a folder of diagnoses, or a file that planner "
                "the bench wrote with -o"
            )
        return documents
    if not path.is_dir():
        raise FileError(f"{path}: no such folder or file; give the folder of the diagnoses")
    found = {file.stem: file for file in path.glob("*.json")}
    found |= {file.parent.name: file for file in path.glob(f"*/{_DIAGNOSIS}")}
    if not found:
        raise FileError(f"{path}: no CAMPAIGN.json and no CAMPAIGN/{_DIAGNOSIS} in it")
    return {name: _json(found[name]) for name in sorted(found)}


def _json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read as JSON: {error}") from error
    if not isinstance(document, dict):
        raise FileError(f"{path}: not a JSON object but {type(document).__name__}")
    return document


# ------------------------------------------------------------------------------------------------
# Diagnose many campaigns in several processes.


def diagnose_all(
    tasks: Sequence[Task], *, jobs: int, stage: Callable[[str], None], seed: int = 0
) -> Iterator[tuple[Task, Outcome]]:
    """Diagnose campaigns and yield what became of each; see `answer_all`."""
    return answer_all(partial(_diagnosis, seed), tasks, jobs=jobs, stage=stage)


def _diagnosis(seed: int, folder: Path, without: tuple[str, ...]) -> Mapping[str, Any]:
    from planner.gap.campaign_folder import read_campaign
    from planner.gap.diagnose import diagnose

    return diagnose(read_campaign(folder), seed=seed, without=without).document()


# ------------------------------------------------------------------------------------------------
# A bench: diagnoses of many campaigns, scored and summed up.


_TIERS = {
    name: place
    for place, name in enumerate(
        ("library", "other", "unclaimed", "none", "none-t4", "none-scatter", "pair", "cancelling",
         "confounded")
    )
}  # fmt: skip
"""The order of the rows; tiers of other benches follow by name of campaign."""


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
        found, _, problem = scored(outcomes[name], name, truth, without=without)
        scores.append(found)
        if problem is not None:
            problems[name] = problem
    return Results(
        truth=truth,
        without=tuple(sorted(without)),
        scores=tuple(scores),
        summary=summarise(scores),
        problems=problems,
        not_diagnosed=tuple(name for name in truth.campaigns if name not in outcomes),
    )


def scored(
    outcome: Outcome, name: str, truth: Truth, *, without: Collection[str] = ()
) -> tuple[Score, Answer | None, str | None]:
    """Return the score of what became of a campaign, its answer, and why there is none."""
    answer, problem = None, None
    if outcome.document is None:
        problem = outcome.problem or "no diagnosis"
    else:
        try:
            answer = read_answer(outcome.document, name)
        except FileError as error:
            problem = str(error)
    found = score(
        name,
        answer or NO_ANSWER,
        truth.campaigns[name],
        without=without,
        seconds=outcome.seconds,
        megabytes=outcome.megabytes,
    )
    return found, answer, problem


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
