"""Feed changed files to every reader: each is read, or refused with one line, and nothing else.

``python tests/fuzz/fuzz.py --count 500`` runs the inputs 0 to 499 in processes of their own, whose
address space and time are limited, and tells what each reader did; `--only 123` runs one again, and
leaves its files in the folder that is named. An input is made from its number alone.
"""

import argparse
import collections
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

MOST_MEMORY = 1 << 30
"""Bytes above what the process has at its start; the largest file is 10 MB, and unpacks to 100."""

MOST_SECONDS = 5.0
"""Processor seconds of one input; usual are milliseconds."""

LONGEST_MESSAGE = 480
"""Six rows of a terminal."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", type=int)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "planner-fuzz")
    parser.add_argument("--worker", action="store_true")
    given = parser.parse_args()
    if given.only is not None:
        given.first, given.count = given.only, 1
    if given.worker:
        work(given.first, given.first + given.count, given.keep, given.only is not None)
        return 0
    told = list(run(given.first, given.first + given.count, given.keep, given.only is not None))
    return 0 if report(told) else 1


def run(first: int, end: int, keep: Path, always: bool):
    """Yield what became of each input; a process that dies is told, and the next goes on."""
    options = ["--worker", "--keep", str(keep), *(["--only", str(first)] if always else [])]
    while first < end:
        which = ("--first", str(first), "--count", str(end - first))
        process = subprocess.Popen(
            [sys.executable, __file__, *options, *which],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
                 "NUMBA_NUM_THREADS": "1"},
        )  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        began = None
        for line in process.stdout:
            one = json.loads(line)
            if one["outcome"] == "begun":
                began = one
                continue
            began = None
            yield one
            first = one["input"] + 1
        error = process.stderr.read()
        if process.wait() == 0:
            return
        if began is None:
            raise RuntimeError(f"the worker ended with {process.returncode}: {error[-2000:]}")
        said = f"the process died (exit code {process.returncode}): {error[-300:]}"
        yield {**began, "outcome": "failed", "said": said}
        first = began["input"] + 1


def work(first: int, end: int, keep: Path, always: bool) -> None:
    """Run inputs, telling each before and after; a process that takes too long is killed."""
    import shutil

    import numpy as np
    from readers import READERS

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MOST_MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    for number in range(first, end):
        reader = READERS[number % len(READERS)]
        files = reader.make(np.random.default_rng(number))
        tell({"input": number, "reader": reader.name, "outcome": "begun"})
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            write(folder, files)
            told = attempt(reader, folder)
        if always or told["outcome"] == "failed":
            kept = keep / str(number)
            shutil.rmtree(kept, ignore_errors=True)
            write(kept, files)
            told["files"] = str(kept)
        tell({"input": number, "reader": reader.name, **told})


def tell(one) -> None:
    sys.stdout.write(json.dumps(one) + "\n")
    sys.stdout.flush()


def write(folder: Path, files) -> None:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def attempt(reader, folder: Path) -> dict[str, object]:
    from planner.errors import PlannerError

    said = ""
    outcome = "read"
    resident = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, 4.0 * MOST_SECONDS)  # SIGPROF ends the process
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            reader.read(folder)
        except PlannerError as error:
            outcome, said = "refused", str(error)
            if not said.isprintable() or not 0 < len(said) <= LONGEST_MESSAGE:
                outcome = "failed"
        except BaseException as error:
            import traceback

            outcome = "failed"
            said = "".join(traceback.format_exception(error))[-1500:]
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    seconds = time.process_time() - begin
    if warned:
        outcome, said = "failed", f"warned: {warned[0].message} ({warned[0].filename})"
    if seconds > MOST_SECONDS:
        outcome, said = "failed", f"took {seconds:.1f} s; {said}"
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - resident
    return {"outcome": outcome, "said": said, "seconds": seconds, "grown_MB": grown / 1024}


def report(told) -> bool:
    """Tell a row a reader, and each failure; say whether all is well.

    A reader that read nothing, or refused nothing, of many inputs was not tried.
    """
    by_reader = collections.defaultdict(list)
    for one in told:
        by_reader[one["reader"]].append(one)
    rows = [f"{'reader':16} inputs   read refused failed  most s most MB"]
    well = True
    for name, those in {**by_reader, "all": told}.items():
        count = collections.Counter(one["outcome"] for one in those)
        seconds = max((one.get("seconds", 0.0) for one in those), default=0.0)
        grown = max((one.get("grown_MB", 0.0) for one in those), default=0.0)
        rows.append(
            f"{name:16} {len(those):6} {count['read']:6} {count['refused']:7} {count['failed']:6} "
            f"{seconds:7.2f} {grown:7.0f}"
        )
        tried = len(those) < 100 or (count["read"] and count["refused"])
        well = well and bool(tried) and not count["failed"]
    for one in told:
        if one["outcome"] == "failed":
            rows += ["", f"input {one['input']} ({one['reader']}), files in {one.get('files')}:"]
            rows += [one["said"], f"again: python tests/fuzz/fuzz.py --only {one['input']}"]
    sys.stdout.write("\n".join(rows) + "\n")
    return well


if __name__ == "__main__":
    sys.exit(main())
