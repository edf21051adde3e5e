"""Attack planner from outside: changed inputs, odd outputs, kills, full disks, hostile names.

python -m benchmarks.attack [--inputs 2000] [--short]

Each row is one kind of attack, all of whose cases have to end as promised: done, or refused in one
line with exit code 2; what is not planner's stays as it is; what is written is whole. The cases
stand beside their tests (tests/fuzz, tests/faults, tests/unit), which run a part of them with every
change. The long form kills every command that writes at many of its steps and takes about an hour;
`--short` leaves that out.
"""

import argparse
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ATTACKS = {
    "outputs on pipes, devices, links, files of others": ["tests/faults", "-k", "every_kind"],
    "results onto inputs; --force; two runs; devices as inputs": [
        "tests/unit/test_targets.py", "tests/unit/test_folder.py",
    ],
    "hostile names in pages, SVG and CSV": ["tests/unit/test_hostile_text.py"],
    "references out of plans, campaigns and diagnoses": ["tests/unit/test_within.py"],
    "names and components inside 3MF": ["tests/unit/test_threemf_structure.py"],
    "kill, signals and full disk, quick commands": ["tests/faults", "-k", "not every_kind"],
}  # fmt: skip
LONG = {"kill, signals and full disk, every command": ["tests/faults", "-m", "slow"]}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=2000, help="changed files in all")
    parser.add_argument("--short", action="store_true")
    given = parser.parse_args()
    fuzz = [sys.executable, "tests/fuzz/fuzz.py", "--count", str(given.inputs)]
    well = _row("changed inputs of every reader", fuzz, r"^all +(\d+) +\d+ +\d+ +(\d+)")
    for name, words in {**ATTACKS, **({} if given.short else LONG)}.items():
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
        well &= _row(name, command, r"(\d+) passed")
    return 0 if well else 1


def _row(name: str, command: list[str], counts: str) -> bool:
    """Run one kind of attack and print its row: cases, how many failed, seconds."""
    began = time.monotonic()
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    found = re.search(counts, ended.stdout, re.MULTILINE)
    failed = re.search(r"(\d+) failed", ended.stdout)
    failures = found[2] if found and found.re.groups > 1 else failed[1] if failed else "0"
    print(
        f"{name:60} {found[1] if found else '-':>6} {failures:>6} {time.monotonic() - began:6.0f} s"
    )
    if ended.returncode:
        print(ended.stdout[-4000:] + ended.stderr[-2000:])
    return ended.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
