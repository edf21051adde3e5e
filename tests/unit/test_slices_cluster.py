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

pytest.importorskip("distributed")

PITCH_MM = (0.05, 0.05, 0.02)
SLICE = """
import sys
from planner.slices.write import write_slices

def main():
    plan, folder, scheduler = sys.argv[1:]
    write_slices(plan, folder, pitch_mm={pitch}, slab_layers=2, scheduler=scheduler)

main()
"""


@pytest.fixture(scope="module")
def plan(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    plan = planner.grade(samples / "dogbone.stl", from_="Tango", to="Vero", axis="x")
    return plan.write(tmp_path_factory.mktemp("plans") / "dogbone")


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


def wait_for(what: str, come: object, log: Path) -> None:
    for _ in range(1500):
        if come():  # type: ignore[operator]
            return
        time.sleep(0.01)
    raise AssertionError(f"{what} did not come:\n{log.read_text()}")


def test_a_worker_killed_on_the_way_changes_no_byte(plan: Path, tmp_path: Path) -> None:
    address = f"tcp://127.0.0.1:{free_port()}"
    stay = ("--no-dashboard", "--nthreads", "1", "--no-nanny", "--death-timeout", "30")
    worker = ("-m", "distributed.cli.dask_worker", address, *stay)
    target = tmp_path / "there"

    def layers() -> list[Path]:
        return list(tmp_path.glob(".there.partial-*/*.png"))

    port = address.rpartition(":")[2]
    scheduler = ("-m", "distributed.cli.dask_scheduler", "--port", port, "--no-dashboard")
    client = ("-c", SLICE.format(pitch=PITCH_MM), str(plan), str(target), address)
    with (
        process(tmp_path, "scheduler", *scheduler, "--host", "127.0.0.1"),
        process(tmp_path, "first", *worker) as first,
        process(tmp_path, "second", *worker) as second,
    ):
        for name in ("first", "second"):
            log = tmp_path / f"{name}.log"
            wait_for(name, lambda log=log: "Registered to" in log.read_text(), log)
        with process(tmp_path, "client", *client) as slicing:
            log = tmp_path / "client.log"
            wait_for("a layer", lambda: len(layers()) >= 20, log)
            first.send_signal(signal.SIGKILL)
            first.wait()
            done = len(layers())
            assert slicing.wait(timeout=15) == 0, log.read_text()
        assert second.poll() is None
    planner.write_slices(plan, tmp_path / "here", pitch_mm=PITCH_MM)
    here, there = (
        {p.name: p.read_bytes() for p in (tmp_path / n).iterdir()} for n in ("here", "there")
    )
    assert here == there
    assert 20 <= done < len(here) - 20  # it was killed on the way


def test_no_scheduler_at_an_address_is_said_in_one_line(
    plan: Path, tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planner.slices.write._CONNECT_S", 1)
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
