"""Changed files end in a value or in one line: no traceback, warning, hang, or loss of memory."""

import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).with_name("fuzz.py")


def fuzz(tmp_path: Path, first: int, count: int) -> None:
    run = subprocess.run(
        [sys.executable, FUZZ, "--first", str(first), "--count", str(count), "--keep", tmp_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.slow
def test_50_changed_files(tmp_path):
    fuzz(tmp_path, 0, 50)


@pytest.mark.long
def test_10000_changed_files(tmp_path):
    fuzz(tmp_path, 50, 10_000)


def test_what_harms_is_told_with_the_way_to_run_it_again(tmp_path):
    """The suite itself: a reader that ends its process, and one that takes too much memory."""
    script = f"""
import sys
sys.path.insert(0, {str(FUZZ.parent)!r})
sys.argv[0] = {str(FUZZ)!r}
import fuzz, types, json, pathlib
bad = [lambda at: __import__("os").abort(), lambda at: bytearray(1 << 34), lambda at: None,
       lambda at: __import__("warnings").warn("odd")]
readers = types.ModuleType("readers")
readers.READERS = [types.SimpleNamespace(name=str(k), read=read, make=lambda rng: {{"a": b"x"}})
                   for k, read in enumerate(bad)]
sys.modules["readers"] = readers
fuzz.work(int(sys.argv[1]), 4, pathlib.Path({str(tmp_path)!r}), False)
"""
    told = [
        subprocess.run(
            [sys.executable, "-c", script, str(first)], capture_output=True, text=True, check=False
        )
        for first in (0, 1)
    ]
    assert told[0].returncode != 0
    assert '"begun"' in told[0].stdout.splitlines()[-1]
    assert "MemoryError" in told[1].stdout
    assert "warned: odd" in told[1].stdout
    assert (tmp_path / "1" / "a").read_bytes() == b"x"
