"""Diagnose many campaigns in several processes, and take the time."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.gap.bench.results import Outcome

__all__ = ["Task", "diagnose_all"]

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Task:
    """One campaign to diagnose without some effects."""

    folder: Path
    without: tuple[str, ...] = ()
    seed: int = 0


def diagnose_all(
    tasks: Sequence[Task], *, jobs: int, stage: Callable[[str], None]
) -> Iterator[tuple[Task, "Outcome"]]:
    """Diagnose campaigns and yield what became of each, in the order of the tasks.

    What stops one diagnosis, a bug included, is its outcome's problem and stops no other.

    Parameters
    ----------
    jobs
        Processes; 1 stays in this one.
    stage
        Told how many are done.
    """
    total = len(tasks)
    if jobs == 1 or total < 2:
        for number, task in enumerate(tasks, start=1):
            stage(f"diagnosing {task.folder.name}, {number} of {total}")
            yield task, _diagnosed(task)
        return
    for name in _ONE_THREAD:  # the processes share the cores already
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, total), mp_context=context)
    try:
        for number, (task, outcome) in enumerate(
            zip(tasks, pool.map(_diagnosed, tasks), strict=True), start=1
        ):
            stage(f"diagnosed {number} of {total} campaigns")
            yield task, outcome
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _diagnosed(task: Task) -> "Outcome":
    from planner.errors import PlannerError
    from planner.gap.bench.results import Outcome
    from planner.gap.campaign_reader import read_campaign
    from planner.gap.diagnose import diagnose
    from planner.gap.diagnosis_json import to_document

    started = time.perf_counter()
    try:
        campaign = read_campaign(task.folder)
        document = to_document(diagnose(campaign, seed=task.seed, without=task.without))
    except PlannerError as error:
        return Outcome(None, None, str(error))
    except Exception as error:  # counted as no answer; the other campaigns go on
        return Outcome(None, None, f"a bug in planner: {type(error).__name__}: {error}")
    return Outcome(document, time.perf_counter() - started)
