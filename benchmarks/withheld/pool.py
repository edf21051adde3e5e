"""Answers to many campaigns by any function, in several processes, with the time each takes."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.withheld.results import Outcome, Task
from planner.errors import PlannerError

__all__ = ["Answering", "answer_all"]

Answering = Callable[[Path, tuple[str, ...]], Mapping[str, Any]]
"""Of a campaign's folder and the effects to do without: a document. At the top of a module, so
that other processes find it."""

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def answer_all(
    answering: Answering, tasks: Sequence[Task], *, jobs: int, stage: Callable[[str], None]
) -> Iterator[tuple[Task, Outcome]]:
    """Yield what became of each task, in their order; a failure is its outcome's problem."""
    answer = partial(_answered, answering)
    if jobs == 1 or len(tasks) < 2:
        outcomes: Iterator[Outcome] = map(answer, tasks)
        yield from _told(tasks, outcomes, stage)
        return
    for name in _ONE_THREAD:
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
    return Outcome(document, time.perf_counter() - started)
