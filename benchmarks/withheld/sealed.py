"""Campaigns of all tiers and their sealed truth in a run's folder: made, or found there."""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import get_args

from benchmarks.withheld.answers import Task
from benchmarks.withheld.reality.__main__ import main as reality
from benchmarks.withheld.reality.effects import Set
from benchmarks.withheld.scoring import Truth, read_truth
from benchmarks.withheld.targets import LEFT_OUT
from planner.errors import FileError

__all__ = [
    "campaigns_in_turn",
    "ended",
    "interleaved",
    "options_of_runs",
    "sealed_campaigns",
    "tasks_in_turn",
]


def options_of_runs(name: str, description: str, count: int) -> argparse.ArgumentParser:
    """Return a parser of what every run over sealed campaigns takes; `count` of each tier."""
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks.withheld.{name}", description=description
    )
    parser.add_argument("--set", choices=get_args(Set), required=True)
    parser.add_argument("--seed", type=int, required=True, help="0 or above")
    parser.add_argument("--count", type=int, default=count, help=f"of each tier (default {count})")
    parser.add_argument("--specimens", type=int, default=30, help="of each (default 30)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--resume", action="store_true", help="go on with what DIR has")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    return parser


def ended(run: Callable[[argparse.Namespace], int], options: argparse.Namespace) -> int:
    """Return the exit code of a run; what is wrong with its files goes to standard error."""
    try:
        return run(options)
    except (FileError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2


def sealed_campaigns(
    options: argparse.Namespace, at_most: Mapping[str, int] | None = None
) -> Truth:
    """Return the truth of the campaigns in a run's folder, made if they are not there.

    Parameters
    ----------
    options
        With `output`, `resume`, `set`, `seed`, `count` and `specimens`.
    at_most
        Campaigns of each tier, fewer than `count`. With None, a folder made with another count
        and other limits will do.

    Raises
    ------
    FileError
        The folder is there and is not to be gone on with, or was made otherwise.
    """
    folder: Path = options.output
    campaigns, truth_file = folder / "campaigns", folder / "truth.json"
    if folder.exists() and not options.resume:
        raise FileError(f"{folder} is already there; go on with --resume or name another")
    if not (campaigns.exists() and truth_file.exists()):
        code = reality(
            [
                *("make", "--set", options.set, "--tier", "all", "--count", str(options.count)),
                *("--seed", str(options.seed), "--specimens", str(options.specimens)),
                *(part for t, n in (at_most or {}).items() for part in ("--at-most", f"{t}={n}")),
                *("--truth", str(truth_file), "-o", str(campaigns)),
            ]
        )
        if code:
            raise FileError(f"{folder}: the campaigns could not be made")
    truth = read_truth(truth_file)
    wanted: dict[str, object] = {n: getattr(options, n) for n in ("set", "seed", "specimens")}
    if at_most is not None:
        wanted |= {"count": options.count, "at_most": dict(at_most) or None}
    if any(truth.made_by.get(name) != value for name, value in wanted.items()):
        raise FileError(f"{folder} was made with other options: {dict(truth.made_by)}")
    return truth


def campaigns_in_turn(truth_file: Path, count: int | None = None) -> list[str]:
    """Return the first campaigns of each tier, or all, in the order of their turns."""
    entries = json.loads(truth_file.read_text(encoding="utf-8"))["campaigns"]
    taken: dict[str, int] = {}
    chosen = []
    for name in sorted(entries, key=lambda name: int(entries[name]["index"])):
        tier = entries[name]["tier"]
        taken[tier] = taken.get(tier, 0) + 1
        if count is None or taken[tier] <= count:
            chosen.append(name)
    return chosen


def tasks_in_turn(folder: Path, truth: Truth, count: int | None = None) -> dict[str, list[Task]]:
    """Return the tasks of a folder's first campaigns of each tier, or of all, by tier.

    Those of the library have a further tier, `LEFT_OUT`, in which they do without their effects.
    """
    by_tier: dict[str, list[Task]] = {}
    for name in campaigns_in_turn(folder / "truth.json", count):
        entry, whole = truth.campaigns[name], Task(folder / "campaigns" / name)
        by_tier.setdefault(entry.tier, []).append(whole)
        if entry.tier == "library":
            by_tier.setdefault(LEFT_OUT, []).append(replace(whole, without=entry.effects))
    return by_tier


def interleaved(tiers: Iterable[Sequence[Task]]) -> list[Task]:
    """Return the first task of each tier, then the second of each: any part of it has all tiers."""
    turns = zip_longest(*tiers)
    return [task for turn in turns for task in turn if task is not None]
