"""Make sealed campaigns of every tier, diagnose and score them.

python -m benchmarks.withheld.run --set development --seed 1 --count 18 --jobs 2 -o DIR

DIR holds `campaigns/`, `truth.json` (its sha256 is printed before anything is diagnosed),
`outcomes.jsonl` (each diagnosis as it comes, so that `--resume` goes on from there),
`results.json` and `results.md`. Exit code 1 when a target is missed or a diagnosis failed.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from benchmarks.withheld.leave_one_out import Case, by_effect
from benchmarks.withheld.reality.__main__ import main as reality
from benchmarks.withheld.reality.effects import Set
from benchmarks.withheld.targets import LEFT_OUT, targets
from benchmarks.withheld.written import results_markdown
from planner import __version__
from planner.cli.gap_pool import Task, diagnose_all
from planner.cli.output import progress
from planner.errors import FileError
from planner.formats.json_document import encode_document
from planner.gap.bench.answer import NO_ANSWER, Answer, read_answer
from planner.gap.bench.results import Outcome
from planner.gap.bench.score import Score, score
from planner.gap.bench.summary import summarise
from planner.gap.bench.truth import Truth, read_truth

__all__ = ["main"]

CI: Mapping[str, int] = {
    "library": 18, "other": 18, "none": 18, "none-t4": 9, "none-scatter": 9,
    "pair": 18, "cancelling": 9, "confounded": 8, "unclaimed": 9,
}  # fmt: skip
"""Campaigns of each tier that take five minutes on two cores at 4 s each, the 18 of the library
tier diagnosed once more without their effects."""

_Key = tuple[str, tuple[str, ...]]


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    options = _parser().parse_args(arguments)
    folder: Path = options.output
    campaigns, truth_file = folder / "campaigns", folder / "truth.json"
    made = campaigns.exists() and truth_file.exists()
    if folder.exists() and not options.resume:
        print(f"{folder} is already there; go on with --resume or name another", file=sys.stderr)
        return 2
    if not made:
        code = reality(
            [
                *("make", "--set", options.set, "--tier", "all", "--count", str(options.count)),
                *("--seed", str(options.seed), "--specimens", str(options.specimens)),
                *("--truth", str(truth_file), "-o", str(campaigns)),
            ]
        )
        if code:
            return code
    truth = read_truth(truth_file)
    wanted = {name: getattr(options, name) for name in ("set", "count", "seed", "specimens")}
    if any(truth.made_by.get(name) != value for name, value in wanted.items()):
        print(f"{folder} was made with other options: {dict(truth.made_by)}", file=sys.stderr)
        return 2
    print(f"{truth.sha256}  {truth_file.name}", flush=True)
    chosen = _chosen(truth_file, CI if options.subset == "ci" else None)
    tasks = [Task(campaigns / name) for name in chosen]
    tasks += [
        Task(campaigns / name, truth.campaigns[name].effects)
        for name in chosen
        if truth.campaigns[name].tier == "library"
    ]
    outcomes = _diagnosed(tasks, folder / "outcomes.jsonl", options.jobs)
    results = _results(truth, outcomes, {**wanted, "subset": options.subset or "all"})
    (folder / "results.json").write_bytes(encode_document(results))
    text = results_markdown(results)
    (folder / "results.md").write_text(text, encoding="utf-8", newline="\n")
    print(text)
    missed = any(target["met"] is False for target in results["targets"])
    return 1 if missed or results["problems"] else 0


def _chosen(truth_file: Path, counts: Mapping[str, int] | None) -> list[str]:
    """Return campaigns in the order of tiers and their turns, the first of each tier."""
    entries = json.loads(truth_file.read_text(encoding="utf-8"))["campaigns"]
    names = sorted(entries, key=lambda name: int(entries[name]["index"]))
    if counts is None:
        return names
    taken: dict[str, int] = {}
    chosen = []
    for name in names:
        tier = entries[name]["tier"]
        taken[tier] = taken.get(tier, 0) + 1
        if taken[tier] <= counts.get(tier, 0):
            chosen.append(name)
    return chosen


def _diagnosed(tasks: Sequence[Task], journal: Path, jobs: int) -> Mapping[_Key, Outcome]:
    """Diagnose what the journal does not have yet, and write each into it as it comes."""
    outcomes: dict[_Key, Outcome] = {}
    lines = journal.read_text(encoding="utf-8").splitlines() if journal.exists() else []
    for line in lines:
        try:
            entry: dict[str, Any] = json.loads(line)
        except ValueError:  # cut off where the last run was
            continue
        key = entry["campaign"], tuple(entry["without"])
        outcomes[key] = Outcome(entry["document"], entry["seconds"], entry["problem"])
    left = [t for t in tasks if (t.folder.name, t.without) not in outcomes]
    with progress(enabled=True) as stage, journal.open("a", encoding="utf-8") as file:
        if lines:
            file.write("\n")
        for task, outcome in diagnose_all(left, jobs=jobs, stage=stage):
            key = task.folder.name, task.without
            outcomes[key] = outcome
            entry = {"campaign": key[0], "without": key[1], "seconds": outcome.seconds}
            entry |= {"problem": outcome.problem, "document": outcome.document}
            file.write(json.dumps(entry) + "\n")
            file.flush()
    return {key: outcomes[key] for t in tasks if (key := (t.folder.name, t.without))}


def _results(
    truth: Truth, outcomes: Mapping[_Key, Outcome], made_by: Mapping[str, Any]
) -> dict[str, Any]:
    answers: dict[_Key, Answer | None] = {}
    scores: dict[_Key, Score] = {}
    problems: dict[str, str] = {}
    for key, outcome in outcomes.items():
        name, without = key
        answers[key], problem = _answer(outcome, name)
        if problem is not None:
            problems[name + (f" without {'+'.join(without)}" if without else "")] = problem
        found = score(
            name,
            answers[key] or NO_ANSWER,
            truth.campaigns[name],
            without=without,
            seconds=outcome.seconds,
        )
        scores[key] = replace(found, tier=LEFT_OUT) if without else found
    cases = [
        Case(
            effect="+".join(without),
            true_effect=truth.campaigns[name].with_true_effect,
            full=answers[name, ()],
            full_score=scores[name, ()],
            less=answers[name, without],
            less_score=scores[name, without],
        )
        for name, without in outcomes
        if without
    ]
    summary = summarise(list(scores.values()))
    return {
        "schema": 1,
        "kind": "withheld-results",
        "planner": __version__,
        "made_by": dict(made_by),
        "truth_sha256": truth.sha256,
        "targets": [vars(t) for t in targets(list(scores.values()), made_by["specimens"])],
        "summary": summary.document(),
        "left_out": [row.document() for row in by_effect(cases)],
        "problems": problems,
        "documents": {
            name: outcome.document
            for (name, without), outcome in outcomes.items()
            if not without and outcome.document is not None
        },
    }


def _answer(outcome: Outcome, name: str) -> tuple[Answer | None, str | None]:
    if outcome.document is None:
        return None, outcome.problem or "no diagnosis"
    try:
        return read_answer(outcome.document, name), None
    except FileError as error:
        return None, str(error)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.withheld.run",
        description="Make sealed campaigns of every tier, diagnose and score them.",
    )
    parser.add_argument("--set", choices=get_args(Set), required=True)
    parser.add_argument("--seed", type=int, required=True, help="0 or above")
    parser.add_argument("--count", type=int, default=18, help="of each tier (default 18)")
    parser.add_argument("--specimens", type=int, default=30, help="of each (default 30)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--subset", choices=["ci"], help="ci: about 5 minutes on 2 cores")
    parser.add_argument("--resume", action="store_true", help="go on with what DIR has")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    return parser


if __name__ == "__main__":
    sys.exit(main())
