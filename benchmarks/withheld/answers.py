"""Answers to many campaigns by any function, in several processes, kept as they come."""

import json
import multiprocessing
import os
import resource
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from planner.errors import PlannerError

__all__ = ["Key", "Outcome", "Task", "answer_all", "kept_outcomes", "read_outcomes"]

Key = tuple[str, tuple[str, ...]]
"""A campaign and the effects that its diagnosis did without."""


@dataclass(frozen=True, slots=True)
class Task:
    """One campaign to answer for, without some effects."""

    folder: Path
    without: tuple[str, ...] = ()

    @property
    def key(self) -> Key:
        """Return its name in a journal."""
        return self.folder.name, self.without


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one campaign: a document, or the problem that prevented it.

    Attributes
    ----------
    megabytes
        The most memory that the process had taken so far.
    """

    document: Mapping[str, Any] | None
    seconds: float | None = None
    problem: str | None = None
    megabytes: float | None = None


Answering = Callable[[Path, tuple[str, ...]], Mapping[str, Any]]
"""Of a campaign's folder and the effects to do without: a document. At the top of a module, so
that other processes find it."""

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def answer_all(
    answering: Answering, tasks: Sequence[Task], *, jobs: int, stage: Callable[[str], None]
) -> Iterator[tuple[Task, Outcome]]:
    """Yield what became of each task, in their order.

    What stops one answer, a bug included, is its outcome's problem and stops no other.

    Parameters
    ----------
    jobs
        Processes; 1 stays in this one.
    stage
        Told how many are done.
    """
    answer = partial(_answered, answering)
    if jobs == 1 or len(tasks) < 2:
        yield from _told(tasks, map(answer, tasks), stage)
        return
    for name in _ONE_THREAD:  # the processes share the cores already
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(tasks)), mp_context=context)
    try:
        yield from _told(tasks, pool.map(answer, tasks), stage)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _told(
    tasks: Sequence[Task], outcomes: Iterator[Outcome], stage: Callable[[str], None]
) -> Iterator[tuple[Task, Outcome]]:
    for number, (task, outcome) in enumerate(zip(tasks, outcomes, strict=True), start=1):
        stage(f"{number} of {len(tasks)} campaigns")
        yield task, outcome


def _answered(answering: Answering, task: Task) -> Outcome:
    started = time.perf_counter()
    try:
        document = answering(task.folder, task.without)
    except PlannerError as error:
        return Outcome(None, None, str(error))
    except Exception as error:  # counted as no answer; the others go on
        return Outcome(None, None, f"a bug: {type(error).__name__}: {error}")
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # KiB on Linux
    return Outcome(document, time.perf_counter() - started, None, megabytes)


def kept_outcomes(
    tasks: Sequence[Task],
    journal: Path,
    answers: Callable[[Sequence[Task]], Iterator[tuple[Task, Outcome]]],
) -> Mapping[Key, Outcome]:
    """Return the outcome of every task: the journal's, or a new one that goes into it."""
    outcomes = read_outcomes(journal)
    left = [t for t in tasks if t.key not in outcomes]
    with journal.open("a", encoding="utf-8") as file:
        if outcomes:
            file.write("\n")  # the last line may be cut off
        for task, outcome in answers(left):
            outcomes[task.key] = outcome
            entry: dict[str, Any] = {"campaign": task.folder.name, "without": task.without}
            entry |= {"seconds": outcome.seconds, "megabytes": outcome.megabytes}
            entry |= {"problem": outcome.problem, "document": outcome.document}
            file.write(json.dumps(entry) + "\n")
            file.flush()
    return {t.key: outcomes[t.key] for t in tasks}


def read_outcomes(journal: Path) -> dict[Key, Outcome]:
    """Return what a journal has; nothing of one that is not there."""
    outcomes: dict[Key, Outcome] = {}
    for line in journal.read_text(encoding="utf-8").splitlines() if journal.exists() else ():
        try:
            entry: dict[str, Any] = json.loads(line)
        except ValueError:  # cut off where the last run was
            continue
        outcome = (entry.get(k) for k in ("document", "seconds", "problem", "megabytes"))
        outcomes[entry["campaign"], tuple(entry["without"])] = Outcome(*outcome)
    return outcomes
