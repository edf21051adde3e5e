"""What a suggested test is worth: the truth's log score after it, and after one at random.

python -m benchmarks.withheld.next_experiments --set development --seed 1 --count 6 -o DIR

Takes campaigns of which the diagnosis leaves a class of several; the lab measures one further
specimen of each test from the sealed truth, at the same cost. DIR is as `benchmarks.withheld.run`
has it, and may be that of a run (`--resume`); `next.jsonl`, `next.json` and `next.md` come there.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

from benchmarks.withheld.answers import Key, Outcome, Task, answer_all, kept_outcomes
from benchmarks.withheld.method import method_sha256
from benchmarks.withheld.next_experiment import next_answers
from benchmarks.withheld.reality.tiers import TIERS
from benchmarks.withheld.scoring import Truth, read_answer, score
from benchmarks.withheld.sealed import campaigns_in_turn, ended, options_of_runs, sealed_campaigns
from benchmarks.withheld.summary import markdown
from planner import __version__
from planner.cli.output import progress
from planner.formats.files import encode_document

__all__ = ["COLUMNS", "Done", "main", "next_rows"]

_PALETTE = Path(__file__).parents[2] / "printers/connex3/palettes/connex3-tango-vero.toml"

COLUMNS = (
    *("tier", "n", "hours", "class", "class after suggested", "class after random"),
    *("log score", "gain of suggested", "gain of random", "difference", "gain expected"),
)
"""Means in nats, with standard errors over campaigns."""


@dataclass(frozen=True)
class Done:
    """One campaign's figures; `expected` is the information that the diagnosis foretold."""

    campaign: str
    tier: str
    suggested_change: Mapping[str, Any]
    random_change: Mapping[str, Any]
    hours: float
    classes: tuple[int, int, int]
    log_scores: tuple[float, float, float]
    expected: float


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    return ended(_run, _parser().parse_args(arguments))


def _run(options: argparse.Namespace) -> int:
    folder: Path = options.output
    truth = sealed_campaigns(options)
    tiers = options.tier or list(TIERS)
    tasks = [
        Task(folder / "campaigns" / name)
        for name in campaigns_in_turn(folder / "truth.json", options.count)
        if truth.campaigns[name].tier in tiers
    ]
    answering = partial(next_answers, folder / "truth.json", _PALETTE, options.replicates)
    with progress(enabled=True) as stage:
        answers = partial(answer_all, answering, jobs=options.jobs, stage=stage)
        outcomes = kept_outcomes(tasks, folder / "next.jsonl", answers)
    problems = {key[0]: o.problem for key, o in outcomes.items() if o.document is None}
    done = _done(truth, outcomes)
    results = {
        "schema": 1,
        "kind": "withheld-next-experiments",
        "planner": __version__,
        "method_sha256": method_sha256(),
        "truth_sha256": truth.sha256,
        "made_by": dict(truth.made_by),
        "replicates": options.replicates,
        "diagnosed": len(tasks),
        "columns": list(COLUMNS),
        "rows": next_rows(done),
        "campaigns": [asdict(d) for d in done],
        "problems": problems,
    }
    (folder / "next.json").write_bytes(encode_document(results))
    text = _text(results)
    (folder / "next.md").write_text(text, encoding="utf-8", newline="\n")
    print(text)
    return 1 if problems else 0


def next_rows(done: Sequence[Done]) -> list[list[str]]:
    """Return the texts under `COLUMNS`: a row a tier, and all together."""
    tiers = list(dict.fromkeys(d.tier for d in done))
    rows = [_row(tier, [d for d in done if d.tier == tier]) for tier in tiers]
    return [*rows, _row("all", done)] if len(tiers) > 1 else rows


def _row(tier: str, done: Sequence[Done]) -> list[str]:
    gains = [[d.log_scores[k] - d.log_scores[0] for d in done] for k in (1, 2)]
    apart = [a - b for a, b in zip(*gains, strict=True)]
    return [
        tier,
        str(len(done)),
        f"{fmean(d.hours for d in done):.1f}",
        *(f"{fmean(d.classes[k] for d in done):.1f}" for k in range(3)),
        f"{fmean(d.log_scores[0] for d in done):.2f}",
        *(_mean(values) for values in (*gains, apart)),
        f"{fmean(d.expected for d in done):.2f}",
    ]


def _mean(values: Sequence[float]) -> str:
    if len(values) < 2:
        return f"{values[0]:.2f}"
    return f"{fmean(values):.2f} ± {stdev(values) / len(values) ** 0.5:.2f}"


def _done(truth: Truth, outcomes: Mapping[Key, Outcome]) -> list[Done]:
    found = []
    for (name, _), outcome in outcomes.items():
        document = outcome.document
        if document is None or "suggested" not in document:
            continue
        hidden = truth.campaigns[name]
        three = [document["before"], *(document[k]["document"] for k in ("suggested", "random"))]
        answers = [read_answer(d, name) for d in three]
        logs = [score(name, a, hidden).log_score for a in answers]
        classes = [len(a.same_class) for a in answers]
        found.append(
            Done(
                campaign=name,
                tier=hidden.tier,
                suggested_change=document["suggested"]["change"],
                random_change=document["random"]["change"],
                hours=document["suggested"]["hours"],
                classes=(classes[0], classes[1], classes[2]),
                log_scores=(logs[0], logs[1], logs[2]),
                expected=document["before"]["next_experiments"][0]["expected_gain_nats"],
            )
        )
    return found


def _text(results: Mapping[str, Any]) -> str:
    made_by = results["made_by"]
    count = len(results["campaigns"])
    parts = [
        f"## What a suggested test is worth: the {made_by['set']} set, seed {made_by['seed']}",
        f"Of {results['diagnosed']} campaigns of {made_by['specimens']} specimens, {count} left a "
        f"class of several; {results['replicates']} further specimen"
        f"{'s' if results['replicates'] > 1 else ''} of the first suggested test, and of a random "
        "candidate of the same cost. Log scores of the right hypothesis in nats, ± standard error; "
        f"planner {results['planner']}; sha256 of the truth `{results['truth_sha256']}`, of the "
        f"method `{results['method_sha256']}`.",
        markdown(COLUMNS, results["rows"]) if count else "No test was done.",
    ]
    if results["problems"]:
        lines = (f"- {name}: {problem}\n" for name, problem in results["problems"].items())
        parts += ["### Campaigns that failed", "".join(lines)]
    return "\n".join(part if part.endswith("\n") else part + "\n" for part in parts)


def _parser() -> argparse.ArgumentParser:
    parser = options_of_runs(
        "next_experiments", "Do the next test that the diagnosis suggests, and one at random.", 6
    )
    parser.add_argument("--tier", action="append", choices=list(TIERS), help="default all")
    parser.add_argument("--replicates", type=int, default=1, help="of the test (default 1)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
