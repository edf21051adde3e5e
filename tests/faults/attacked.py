"""Run one command of planner in this process, and let something happen at one of its steps.

``python attacked.py FAULT STEP REPORT WORDS...``. A step is what changes the working directory or
what lies in it: a file opened for writing, a folder made, a name changed or removed. Python tells
them all to audit hooks, before they happen. The number of steps goes to the file REPORT, which lies
elsewhere. Faults:

- ``none``: only count;
- ``kill``, ``int``, ``term``: a signal at that step;
- ``full``: from that step on nothing new can be written, as on a full disk;
- ``gone``: the folder that is written into is removed by someone else.
"""

import errno
import os
import shutil
import signal
import sys
from pathlib import Path

_SIGNALS = {"kill": signal.SIGKILL, "int": signal.SIGINT, "term": signal.SIGTERM}
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_CHANGES = {"os.mkdir", "os.rename", "os.remove", "os.rmdir"}


def main() -> None:
    fault, step, report, *words = sys.argv[1:]
    here, own, count, busy = str(Path.cwd()), os.getpid(), 0, False

    def watch(event: str, given: tuple) -> None:
        nonlocal count, busy
        if busy or os.getpid() != own:
            return
        if event == "open":
            path, _, flags = given
            if not flags & _WRITES or isinstance(path, int):
                return
        elif event in _CHANGES:
            path = given[0]
        else:
            return
        path = str(Path(os.fsdecode(path)).absolute())
        if not path.startswith(here + os.sep):
            return
        count += 1
        if fault == "full" and count >= int(step) and event in ("open", "os.mkdir"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)
        if count == int(step) and fault in _SIGNALS:
            os.kill(own, _SIGNALS[fault])
        if count == int(step) and fault == "gone":
            busy = True
            scratch = [p for p in Path(here).iterdir() if ".partial-" in p.name]
            for path in scratch:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            busy = False

    sys.argv = ["planner", *words]
    from planner.cli import main as command

    sys.addaudithook(watch)
    try:
        command()
    finally:
        busy = True
        Path(report).write_text(str(count))


if __name__ == "__main__":
    main()
