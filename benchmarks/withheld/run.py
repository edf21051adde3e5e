"""Make sealed campaigns of every tier, diagnose and score them.

python -m benchmarks.withheld.run --set development --seed 1 --count 18 --jobs 2 -o DIR

DIR holds `campaigns/`, `truth.json` (its sha256 is printed before anything is diagnosed),
`outcomes.jsonl`, `naive.jsonl` and `oracle.jsonl` (each answer as it comes, so that `--resume` goes
on from there),
`results.json` and `results.md`. `--log` keeps a row of every run; the final set needs one, and is
scored once for each version of the method. Exit code 1 when a target is missed or a diagnosis
failed, 2 when nothing was scored.
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

from benchmarks.withheld.answers import Key, Outcome, Task, answer_all, kept_outcomes
from benchmarks.withheld.comparison import compare
from benchmarks.withheld.leave_one_out import Case, by_effect
from benchmarks.withheld.method import method_sha256
from benchmarks.withheld.naive_bic import naive_answer
from benchmarks.withheld.oracle import beside_oracle, oracle_outcomes
from benchmarks.withheld.reality.__main__ import at_most
from benchmarks.withheld.results import diagnose_all, scored
from benchmarks.withheld.run_log import MIXED, append_run, check_not_scored
from benchmarks.withheld.scoring import Answer, Score, Truth
from benchmarks.withheld.sealed import (
    campaigns_in_turn,
    ended,
    options_of_runs,
    sealed_campaigns,
)
from benchmarks.withheld.summary import summarise
from benchmarks.withheld.targets import LEFT_OUT, targets
from benchmarks.withheld.written import put_into_page, results_markdown
from planner import __version__
from planner.cli.output import progress
from planner.errors import FileError
from planner.formats.files import encode_document

__all__ = ["main"]

SUBSETS: Mapping[str, Mapping[str, int]] = {
    "ci": {
        "library": 4, "other": 3, "none": 2, "none-t4": 1, "none-scatter": 1, "pair": 2,
        "cancelling": 1, "confounded": 0, "unclaimed": 1,
    },
    "pinned": {
        "library": 8, "other": 8, "none": 4, "none-t4": 2, "none-scatter": 2, "pair": 4,
        "cancelling": 2, "confounded": 2, "unclaimed": 2,
    },
}  # fmt: skip
"""Campaigns of each tier that take two minutes and five on two free cores, those of the library
tier diagnosed once more without their effects."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    return ended(_run, _parser().parse_args(arguments))


def _run(options: argparse.Namespace) -> int:
    folder: Path = options.output
    campaigns, truth_file = folder / "campaigns", folder / "truth.json"
    if options.log is not None:
        # Also keeps a page that is no log from being found out after an hour
        check_not_scored(options.log, method_sha256())
    elif options.set == "final":
        raise FileError("the final set is scored once for each method: name the log with --log")
    first = SUBSETS.get(options.subset) or at_most(options.at_most)
    truth = sealed_campaigns(options, first)
    print(f"{truth.sha256}  {truth_file.name}", flush=True)
    begun = _method(folder)
    if options.set == "final" and begun == MIXED:
        raise FileError(
            f"{folder} was begun with another method; the final set is scored with one: undo the "
            "change of planner/gap, or begin anew with another seed"
        )
    whole = [Task(campaigns / name) for name in campaigns_in_turn(truth_file)]
    tasks = whole + [
        replace(task, without=truth.campaigns[task.folder.name].effects)
        for task in whole
        if truth.campaigns[task.folder.name].tier == "library"
    ]
    with progress(enabled=True) as stage:
        ours = partial(diagnose_all, jobs=options.jobs, stage=stage)
        outcomes = kept_outcomes(tasks, folder / "outcomes.jsonl", ours)
        naive: Mapping[Key, Outcome] = {}
        if options.subset is None and not options.no_naive:
            theirs = partial(answer_all, naive_answer, jobs=options.jobs, stage=stage)
            naive = kept_outcomes(whole, folder / "naive.jsonl", theirs)
        oracle: Mapping[Key, Outcome] = {}
        if options.subset is None and not options.no_oracle:
            asked = campaigns_in_turn(truth_file, options.oracle_first)
            known = [task for task in whole if task.folder.name in set(asked)]
            oracle = oracle_outcomes(truth, known, truth_file, options.jobs, stage)
    method = _method(folder)  # MIXED if it changed meanwhile
    made_by = {name: getattr(options, name) for name in ("set", "count", "seed", "specimens")}
    made_by |= {"subset": options.subset or "all"}
    results = _results(truth, outcomes, naive, oracle, made_by) | {"method_sha256": method}
    (folder / "results.json").write_bytes(encode_document(results))
    text = results_markdown(results)
    (folder / "results.md").write_text(text, encoding="utf-8", newline="\n")
    print(text)
    if options.page is not None:
        put_into_page(options.page, text)
    if options.log is not None:
        append_run(options.log, results, method)
    missed = any(target["met"] is False for target in results["targets"])
    return 1 if missed or results["problems"] else 0


def _method(folder: Path) -> str:
    """Return the hash of the method, `MIXED` if it is not that which a run was begun with."""
    now, kept = method_sha256(), folder / "method.sha256"
    if not kept.exists():
        kept.write_text(now + "\n", encoding="utf-8", newline="\n")
    return now if kept.read_text(encoding="utf-8").strip() == now else MIXED


def _results(
    truth: Truth,
    outcomes: Mapping[Key, Outcome],
    naive: Mapping[Key, Outcome],
    oracle: Mapping[Key, Outcome],
    made_by: Mapping[str, Any],
) -> dict[str, Any]:
    answers: dict[Key, Answer | None] = {}
    scores: dict[Key, Score] = {}
    problems: dict[str, str] = {}
    for key, outcome in outcomes.items():
        name, without = key
        found, answers[key], problem = scored(outcome, name, truth, without=without)
        if problem is not None:
            problems[name + (f" without {'+'.join(without)}" if without else "")] = problem
        found = beside_oracle(found, oracle.get((name, ())), left_out=bool(without))
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
        # Of the whole library's diagnoses, as the naive analyst's are; the summary has all.
        "log_score": fmean(s.log_score for (_, without), s in scores.items() if not without),
        "left_out": [row.document() for row in by_effect(cases)],
        "naive": _beside_naive(truth, scores, naive) if naive else None,
        "problems": problems,
        "documents": {
            name: outcome.document
            for (name, without), outcome in outcomes.items()
            if not without and outcome.document is not None
        },
    }


def _beside_naive(
    truth: Truth, scores: Mapping[Key, Score], naive: Mapping[Key, Outcome]
) -> dict[str, Any]:
    theirs = [scored(outcome, name, truth)[0] for (name, _), outcome in naive.items()]
    return compare([scores[key] for key in naive], theirs)


def _parser() -> argparse.ArgumentParser:
    parser = options_of_runs(
        "run", "Make sealed campaigns of every tier, diagnose and score them.", 18
    )
    parser.add_argument("--subset", choices=[*SUBSETS], help="3 or 5 minutes on 2 free cores")
    parser.add_argument(
        "--at-most", action="append", default=[], metavar="TIER=N", help="the first N of a tier"
    )
    parser.add_argument("--no-naive", action="store_true", help="leave the naive BIC out")
    parser.add_argument("--no-oracle", action="store_true", help="leave the oracle out")
    parser.add_argument(
        "--oracle-first", type=int, metavar="N", help="ask the oracle of the first N of a tier"
    )
    parser.add_argument("--page", type=Path, help="put the results into this page (Markdown)")
    parser.add_argument("--log", type=Path, help="append a row to this log of runs (Markdown)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
