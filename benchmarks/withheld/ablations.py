"""What each part of the diagnosis is worth: the same campaigns without it.

python -m benchmarks.withheld.ablations --set development --seed 1 --count 6 --jobs 2 -o DIR

DIR holds `campaigns/` and `truth.json`, made anew or those of an earlier run of this or of
`benchmarks.withheld.run` (`--resume`), `ablations.jsonl`, `ablations.json` and `ablations.md`.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

from benchmarks.withheld.ablated import FULL, VARIANTS, ablated_answers
from benchmarks.withheld.answers import Key, Outcome, Task, answer_all, kept_outcomes
from benchmarks.withheld.method import method_sha256
from benchmarks.withheld.scoring import NO_ANSWER, UNKNOWN, Score, Truth, named, read_answer, score
from benchmarks.withheld.sealed import campaigns_in_turn, ended, options_of_runs, sealed_campaigns
from benchmarks.withheld.summary import Rate, expected_calibration_error, markdown
from planner import __version__
from planner.cli.output import progress
from planner.formats.files import encode_document

__all__ = ["COLUMNS", "ablation_rows", "main"]

_MEASURES: Mapping[str, Callable[[Score], bool | None]] = {
    "one effect: top-1 %": lambda s: (
        s.top_1 if len(s.expected) == 1 and named(s.expected) else None
    ),
    "two: both %": lambda s: s.top_1 if len(s.expected) == 2 else None,
    "none: false alarm %": lambda s: s.false_alarm,
    "unclaimed: unknown %": lambda s: s.verdict == UNKNOWN if s.expected == UNKNOWN else None,
    "sure but wrong %": lambda s: s.misattributed,
}

COLUMNS = ("", *_MEASURES, "P(truth)", "log score", "calibration error")
"""Headings; shares in per cent with Wilson's intervals at 95 %, confounded designs in the last four
alone."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    return ended(_run, _parser().parse_args(arguments))


def _run(options: argparse.Namespace) -> int:
    folder: Path = options.output
    truth = sealed_campaigns(options)
    names = campaigns_in_turn(folder / "truth.json", options.count)
    tasks = [Task(folder / "campaigns" / name) for name in names]
    with progress(enabled=True) as stage:
        answers = partial(answer_all, ablated_answers, jobs=options.jobs, stage=stage)
        outcomes = kept_outcomes(tasks, folder / "ablations.jsonl", answers)
    problems = {key[0]: o.problem for key, o in outcomes.items() if o.document is None}
    rows = ablation_rows({name: _scores(truth, outcomes, name) for name in VARIANTS})
    results = {
        "schema": 1,
        "kind": "withheld-ablations",
        "planner": __version__,
        "method_sha256": method_sha256(),
        "truth_sha256": truth.sha256,
        "made_by": dict(truth.made_by),
        "campaigns": len(tasks),
        "columns": list(COLUMNS),
        "rows": rows,
        "problems": problems,
    }
    (folder / "ablations.json").write_bytes(encode_document(results))
    text = _text(results)
    (folder / "ablations.md").write_text(text, encoding="utf-8", newline="\n")
    print(text)
    return 1 if problems else 0


def ablation_rows(scores: Mapping[str, Sequence[Score]]) -> list[list[str]]:
    """Return the texts under `COLUMNS`, a row a variant."""
    return [[name, *_row(of_variant)] for name, of_variant in scores.items()]


def _row(scores: Sequence[Score]) -> list[str]:
    cells = []
    for name, measure in _MEASURES.items():
        counted = [s for s in scores if s.tier != "confounded" or name.startswith("sure")]
        values = [v for s in counted if (v := measure(s)) is not None]
        cells.append(_share(Rate(sum(values), len(values))))
    led = [s for s in scores if s.leading_probability is not None]
    error = expected_calibration_error(
        [s.leading_probability or 0.0 for s in led], [s.leading_right for s in led]
    )
    return [
        *cells,
        f"{fmean(s.probability for s in scores):.2f}",
        f"{fmean(s.log_score for s in scores):.2f}",
        "" if error is None else f"{error:.2f}",
    ]


def _one(score: Score) -> bool:
    return len(score.expected) == 1 and named(score.expected)


def _share(rate: Rate) -> str:
    if rate.share is None:
        return ""
    low, high = rate.interval
    return f"{100 * rate.share:.0f} [{100 * low:.0f}, {100 * high:.0f}]"


def _scores(truth: Truth, outcomes: Mapping[Key, Outcome], variant: str) -> list[Score]:
    return [
        score(
            name,
            NO_ANSWER if o.document is None else read_answer(o.document[variant], name),
            truth.campaigns[name],
        )
        for (name, _), o in outcomes.items()
    ]


def _text(results: Mapping[str, Any]) -> str:
    made_by = results["made_by"]
    parts = [
        f"## What each part is worth: the {made_by['set']} set, seed {made_by['seed']}",
        f"{results['campaigns']} campaigns of {made_by['specimens']} specimens, evenly of all "
        f"tiers; planner {results['planner']}; sha256 of the truth `{results['truth_sha256']}`, of "
        f"the method `{results['method_sha256']}`.",
        markdown(COLUMNS, results["rows"]),
        "Without specimen effects, figures differ by the sensor alone; fixed base parameters take "
        "the palette's laws for exact; flat priors hold none, unknown, every effect and every pair "
        f"for equally likely. Row {FULL!r} is the diagnosis as it is.",
    ]
    if results["problems"]:
        lines = (f"- {name}: {problem}\n" for name, problem in results["problems"].items())
        parts += ["### Diagnoses that failed, counted as wrong", "".join(lines)]
    return "\n".join(part if part.endswith("\n") else part + "\n" for part in parts)


def _parser() -> argparse.ArgumentParser:
    return options_of_runs(
        "ablations", "Weigh the same campaigns without one part of the diagnosis at a time.", 6
    )


if __name__ == "__main__":
    sys.exit(main())
