"""Time a simulation and a design of a whole part, alone and with another process on each processor.

python -m benchmarks.busy [RUNS]

Prints the least time of RUNS (default 3) of each command after one that is not counted, and the
ratio: half of every processor is taken, so that 2 is what can be had and LIMIT what is allowed.
Whatever else is at work falsifies it: the load, which is printed, should be near 0 before.
Processor time tells of threads that spin on a loaded machine too: it should stay as it is.
"""

import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from benchmarks.grade import PLANNER, SAMPLES, run_once

LIMIT = 2.5
PART = (str(SAMPLES / "finger.stl"), "--fix", "x=max", "--load", "x=min: 0,0,-0.5 N", "--cell", "3")
COMMANDS = {
    "simulate": ("--material", "FLX9785", "--steps", "2"),
    "design": ("--from", "Tango", "--to", "Vero", "--axis", "x", "--target", "x=min uz=-12 mm"),
}


def least(command: list[str], runs: int, busy: int) -> tuple[float, float]:
    """Return the least wall and processor time of a command beside processes that never rest."""
    with ExitStack() as stack:
        for _ in range(busy):
            other = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(other.wait)
            stack.callback(other.kill)
        costs = [run_once(command) for _ in range(runs)]
    return min(c.wall_s for c in costs), min(c.cpu_s for c in costs)


def main() -> None:
    """Run the benchmark."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    processors = len(os.sched_getaffinity(0))
    print(f"{processors} processors, load {os.getloadavg()[0]:.1f}")
    failed = False
    with tempfile.TemporaryDirectory() as scratch:
        for name, options in COMMANDS.items():
            output = ["-o", str(Path(scratch) / name), "--force"] if name == "design" else []
            command = [*PLANNER, name, *PART, *options, *output]
            run_once(command)  # compiles
            (alone_s, cpu_s), (beside_s, beside_cpu_s) = (
                least(command, runs, busy) for busy in (0, processors)
            )
            ratio = beside_s / alone_s
            failed |= ratio > LIMIT
            print(
                f"{name:9} {alone_s:6.1f} s alone, {beside_s:6.1f} s beside, ratio {ratio:.2f} "
                f"(limit {LIMIT:g}); processor {cpu_s:.1f} s and {beside_cpu_s:.1f} s",
                flush=True,
            )
    sys.exit(failed)


if __name__ == "__main__":
    main()
