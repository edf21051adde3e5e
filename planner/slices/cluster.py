"""Slabs made by the workers of a Dask cluster, which need share no disk with this machine."""

import re
from collections.abc import Iterator
from importlib import import_module
from itertools import islice
from typing import Any

from planner.errors import ArgumentError, OutputError, PlannerError
from planner.slices.slab import SlabImages, SlabTask, make_slab

__all__ = ["make_slabs_on"]

_CONNECT_S, _SILENCE_S = 10, 30
_SLABS_A_THREAD = 2  # in flight: one is made while the next is on its way
_LARGE_TASK = "distributed.admin.large-graph-warning-threshold"


def make_slabs_on(scheduler: str, tasks: Iterator[SlabTask]) -> Iterator[SlabImages]:
    """Make slabs on a cluster, and yield them as they come.

    A slab carries its triangles there and its images back. When a worker dies, what it had is
    made again by another.

    Parameters
    ----------
    scheduler
        Its address, ``tcp://HOST:PORT``.

    Raises
    ------
    ArgumentError
        No address; Dask is not installed here, or planner not there; nothing answers, or has no
        workers.
    OutputError
        The cluster lost all its workers, or several over one slab.
    """
    if not isinstance(scheduler, str) or not re.fullmatch(
        r"(tcp|tls|ws|wss)://[^\s:/]+:\d+", scheduler
    ):
        raise ArgumentError(
            f"--scheduler {scheduler}: is no address of a scheduler; give what dask scheduler "
            "prints, as tcp://127.0.0.1:8786"
        )
    try:
        distributed: Any = import_module("distributed")
        dask: Any = import_module("dask")
    except ImportError as error:
        raise ArgumentError(
            f"--scheduler {scheduler}: Dask is not installed ({error}); "
            "pip install 'planner[distributed]', or leave --scheduler out"
        ) from error
    with dask.config.set({_LARGE_TASK: "1GiB"}), _client(distributed, scheduler) as client:
        threads = _threads(client, scheduler)
        submitted = _submit(client, tasks)
        waiting = set(islice(submitted, _SLABS_A_THREAD * threads))
        while waiting:
            finished = _some_of(distributed, client, waiting, scheduler)
            waiting -= finished
            for future in finished:
                slab = _result(distributed, future, scheduler)
                waiting |= set(islice(submitted, 1))
                yield slab


def _client(distributed: Any, scheduler: str) -> Any:
    try:
        return distributed.Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
    except OSError as error:  # TimeoutError is one
        raise ArgumentError(
            f"--scheduler {scheduler}: no scheduler answers there within {_CONNECT_S} s; give the "
            "address that dask scheduler prints"
        ) from error


def _threads(client: Any, scheduler: str) -> int:
    try:
        client.wait_for_workers(1, timeout=_CONNECT_S)
    except TimeoutError as error:
        raise ArgumentError(
            f"--scheduler {scheduler}: has no workers; start some: dask worker {scheduler}"
        ) from error
    return max(1, int(sum(client.nthreads().values())))


def _submit(client: Any, tasks: Iterator[SlabTask]) -> Iterator[Any]:
    from planner import __version__

    for task in tasks:
        yield client.submit(_make_elsewhere, task.alone(), __version__, pure=False)


def _make_elsewhere(task: SlabTask, version: str) -> SlabImages:
    """Make a slab, if this is the planner that asked: another might choose other voxels."""
    from planner import __version__

    if version != __version__:
        raise ArgumentError(
            f"a worker has planner {__version__}, not {version}; install planner {version} there"
        )
    return make_slab(task)


def _some_of(distributed: Any, client: Any, waiting: set[Any], scheduler: str) -> set[Any]:
    """Wait for some of the slabs for as long as there are workers."""
    while True:
        try:
            with client.as_current():
                some = distributed.wait(waiting, _SILENCE_S, return_when="FIRST_COMPLETED")
            return set(some.done)
        except TimeoutError as error:
            if not client.nthreads():
                raise OutputError(
                    f"--scheduler {scheduler}: all its workers are gone; start some again"
                ) from error


def _result(distributed: Any, future: Any, scheduler: str) -> SlabImages:
    try:
        slab: SlabImages = future.result()
    except PlannerError:
        raise
    except ImportError as error:
        raise ArgumentError(
            f"--scheduler {scheduler}: its workers cannot import what they need ({error}); install "
            "planner there"
        ) from error
    except distributed.KilledWorker as error:
        raise OutputError(
            f"--scheduler {scheduler}: several workers died over one slab; give them more memory"
        ) from error
    return slab
