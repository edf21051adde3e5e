"""Slices made on a real local cluster, one of whose two workers is killed on the way."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import planner
from planner.cli import run

PITCH_MM = (0.1, 0.1, 0.1)
SLICE = """
import sys
from planner.slices import write_slices

def main():
    plan, folder, scheduler = sys.argv[1:]
    write_slices(plan, folder, pitch_mm={pitch}, slab_layers=2, scheduler=scheduler)

main()
"""


@pytest.fixture(scope="module")
def plan(dogbone_plan: planner.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("distributed")  # here: not in each worker that collects these tests
    return dogbone_plan.write(tmp_path_factory.mktemp("plans") / "dogbone")


@contextlib.contextmanager
def process(folder: Path, name: str, *command: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run Python in another folder, so that nothing but the address is shared."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(["", *sys.path])}
    (folder / name).mkdir()
    with (folder / f"{name}.log").open("wb") as log:
        started = subprocess.Popen(
            [sys.executable, "-W", "ignore", *command],
            cwd=folder / name, stdout=log, stderr=log, env=environment,
        )  # fmt: skip
    try:
        yield started
    finally:
        started.kill()
        started.wait()


def free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


# Begins a slab, and is no more: there is no moment to wait for, nor to miss.
FALLS = """
import os, signal
from distributed import WorkerPlugin

class Falls(WorkerPlugin):
    def transition(self, key, start, finish, **more):
        if finish == "executing":
            os.kill(os.getpid(), signal.SIGKILL)

async def dask_setup(worker):
    await worker.plugin_add(Falls())
"""
HANGS_S = 300  # nothing takes a tenth of it


def registered(log: Path, process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + HANGS_S
    while "Registered to" not in log.read_text():
        assert process.poll() is None and time.monotonic() < until, log.read_text()  # noqa: PT018
        time.sleep(0.01)


@pytest.mark.slow
def test_a_worker_killed_on_the_way_changes_no_byte(plan: Path, tmp_path: Path) -> None:
    address = f"tcp://127.0.0.1:{free_port()}"
    stay = ("--no-dashboard", "--nthreads", "1", "--no-nanny", "--death-timeout", str(HANGS_S))
    worker = ("-m", "distributed.cli.dask_worker", address, *stay)
    falls = tmp_path / "falls.py"
    falls.write_text(FALLS)
    port = address.rpartition(":")[2]
    scheduler = ("-m", "distributed.cli.dask_scheduler", "--port", port, "--no-dashboard")
    client = ("-c", SLICE.format(pitch=PITCH_MM), str(plan), str(tmp_path / "there"), address)
    with (
        process(tmp_path, "scheduler", *scheduler, "--host", "127.0.0.1"),
        process(tmp_path, "first", *worker, "--preload", str(falls)) as first,
        process(tmp_path, "second", *worker) as second,
    ):
        registered(tmp_path / "first.log", first)
        registered(tmp_path / "second.log", second)
        with process(tmp_path, "client", *client) as slicing:
            log = (tmp_path / "client.log").read_text
            assert slicing.wait(timeout=HANGS_S) == 0, log()
        assert first.wait(timeout=HANGS_S) == -signal.SIGKILL, (tmp_path / "first.log").read_text()
        assert second.poll() is None
    planner.write_slices(plan, tmp_path / "here", pitch_mm=PITCH_MM)
    here, there = (
        {p.name: p.read_bytes() for p in (tmp_path / n).iterdir()} for n in ("here", "there")
    )
    assert here == there


def test_no_scheduler_at_an_address_is_said_in_one_line(
    plan: Path, tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planner.slices._CONNECT_S", 1)
    address = f"tcp://127.0.0.1:{free_port()}"
    command = ["slices", str(plan), "-o", str(tmp_path / "s"), "--scheduler", address]
    assert run(command) == 2
    error = capsys.readouterr().err
    assert f"{address}: no scheduler answers there" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("address", ["127.0.0.1:8786", "localhost", "http://here:8786", "tcp://a"])
def test_addresses_that_are_none(address: str, plan: Path, tmp_path: Path, capsys) -> None:
    command = ["slices", str(plan), "-o", str(tmp_path / "s"), "--scheduler", address]
    assert run(command) == 2
    assert "as tcp://127.0.0.1:8786" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
