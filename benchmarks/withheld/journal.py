"""Answers as they come, a line each, so that an interrupted run can go on."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.withheld.results import Outcome, Task

__all__ = ["Answers", "Key", "kept_outcomes", "read_outcomes"]

Key = tuple[str, tuple[str, ...]]
"""A campaign and the effects that its diagnosis did without."""

Answers = Callable[[Sequence[Task]], Iterator[tuple[Task, Outcome]]]


def kept_outcomes(tasks: Sequence[Task], journal: Path, answers: Answers) -> Mapping[Key, Outcome]:
    """Return the outcome of every task: the journal's, or a new one that goes into it."""
    outcomes = read_outcomes(journal)
    left = [t for t in tasks if (t.folder.name, t.without) not in outcomes]
    with journal.open("a", encoding="utf-8") as file:
        if outcomes:
            file.write("\n")  # the last line may be cut off
        for task, outcome in answers(left):
            key = task.folder.name, task.without
            outcomes[key] = outcome
            entry = {"campaign": key[0], "without": key[1], "seconds": outcome.seconds}
            entry |= {"problem": outcome.problem, "document": outcome.document}
            file.write(json.dumps(entry) + "\n")
            file.flush()
    return {key: outcomes[key] for t in tasks if (key := (t.folder.name, t.without))}


def read_outcomes(journal: Path) -> dict[Key, Outcome]:
    """Return what a journal has; nothing of one that is not there."""
    outcomes: dict[Key, Outcome] = {}
    for line in journal.read_text(encoding="utf-8").splitlines() if journal.exists() else ():
        try:
            entry: dict[str, Any] = json.loads(line)
        except ValueError:  # cut off where the last run was
            continue
        key = entry["campaign"], tuple(entry["without"])
        outcomes[key] = Outcome(entry["document"], entry["seconds"], entry["problem"])
    return outcomes
