"""Diagnose campaigns that are kept, a line each, and compare with a former version of the method.

python -m benchmarks.withheld.quick DIR --jobs 2 --tiers library,none,left-out --first 8 \
    --against DIR/quick-0123456789ab.jsonl

DIR holds `campaigns/` and `truth.json`, as `reality make` writes them. Answers go into
`quick-METHOD.jsonl` there, METHOD the hash of the sources of `planner/gap`: what a version has
answered it is not asked again. With `--oracle` the oracle answers in place of planner, once for all
versions, into `oracle.jsonl`; where that is there, the sums of the tiers say what it reaches.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean, median

from benchmarks.withheld.answers import Key, Outcome, Task, kept_outcomes, read_outcomes
from benchmarks.withheld.method import method_sha256
from benchmarks.withheld.oracle import beside_oracle, oracle_outcomes
from benchmarks.withheld.results import diagnose_all, scored
from benchmarks.withheld.scoring import Effects, Score, Truth, read_truth
from benchmarks.withheld.sealed import ended, interleaved, tasks_in_turn
from benchmarks.withheld.targets import LEFT_OUT
from planner.cli.output import progress

__all__ = ["main"]

_LEFT_OUT = LEFT_OUT.replace(" ", "-")
_TIERS = f"library,other,none,{_LEFT_OUT}"


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    return ended(_run, _parser().parse_args(arguments))


def _run(options: argparse.Namespace) -> int:
    folder: Path = options.folder
    truth = read_truth(folder / "truth.json")
    by_tier = tasks_in_turn(folder, truth, options.first)
    tiers = (tier.replace(_LEFT_OUT, LEFT_OUT) for tier in options.tiers.split(","))
    tasks = interleaved(by_tier.get(tier, []) for tier in tiers)
    if options.oracle:
        with progress(enabled=True) as stage:
            oracle_outcomes(truth, tasks, folder / "truth.json", options.jobs, stage)
    oracle = read_outcomes(folder / "oracle.jsonl")
    former = {} if options.against is None else read_outcomes(options.against)
    journal = folder / f"quick-{method_sha256()[:12]}.jsonl"
    for key, outcome in read_outcomes(journal).items():
        if key in {t.key for t in tasks}:
            print(_line(truth, key, outcome, former))
    outcomes: Mapping[Key, Outcome] = read_outcomes(journal)
    if options.oracle:
        outcomes = {t.key: outcomes[t.key] for t in tasks if t.key in outcomes}
    else:
        outcomes = kept_outcomes(tasks, journal, partial(_told, truth, options.jobs, former))
    print(*_summary(truth, outcomes, former), *_reached(truth, tasks, oracle), sep="\n")
    print(f"answers in {journal}")
    return 0


def _told(
    truth: Truth, jobs: int, former: Mapping[Key, Outcome], tasks: Sequence[Task]
) -> Iterator[tuple[Task, Outcome]]:
    for task, outcome in diagnose_all(tasks, jobs=jobs, stage=lambda _: None):
        print(_line(truth, task.key, outcome, former), flush=True)
        yield task, outcome


def _score(truth: Truth, key: Key, outcome: Outcome) -> Score:
    return scored(outcome, key[0], truth, without=key[1])[0]


def _line(truth: Truth, key: Key, outcome: Outcome, former: Mapping[Key, Outcome]) -> str:
    found = _score(truth, key, outcome)
    gap = (outcome.document or {}).get("gap", {})
    gaps = " ".join(
        "   -" if gap.get(n) is None else f"{gap[n]:.2f}" for n in ("before", "after", "floor")
    )
    hidden = "-" if found.snr is None else f"{found.snr:.1f}"
    cells = [
        f"{_tier(found, key):8} {key[0]} {_name(truth.campaigns[key[0]].effects):34}",
        f"snr {hidden:>4}  {'right' if found.top_1 else 'wrong'} {_name(found.verdict):34}",
        f"P {found.probability:.2f}  gap {gaps}  {found.seconds or 0.0:5.1f} s",
    ]
    if key in former:
        before = _score(truth, key, former[key])
        if before.top_1 != found.top_1:
            cells.append(f"{'gained' if found.top_1 else 'lost'}, was {_name(before.verdict)}")
    if outcome.problem is not None:
        cells.append(outcome.problem)
    return "  ".join(cells)


def _summary(
    truth: Truth, outcomes: Mapping[Key, Outcome], former: Mapping[Key, Outcome]
) -> Iterator[str]:
    scores = {key: _score(truth, key, outcome) for key, outcome in outcomes.items()}
    for tier in sorted({_tier(s, key) for key, s in scores.items()}):
        of_tier = {key: s for key, s in scores.items() if _tier(s, key) == tier}
        yield _row(tier, list(of_tier.values()))
        both = {k: _score(truth, k, former[k]) for k in of_tier if k in former}
        if both:
            yield _row("  was", list(both.values()))
            moved = [(k, of_tier[k].top_1) for k in both if of_tier[k].top_1 != both[k].top_1]
            for word, now in (("gained", True), ("lost", False)):
                found = [k[0] for k, right in moved if right == now]
                if found:
                    yield f"  {word} {len(found)}: {' '.join(found)}"


def _reached(truth: Truth, tasks: Sequence[Task], oracle: Mapping[Key, Outcome]) -> Iterator[str]:
    """Return what the oracle reaches of the same campaigns, a line a tier."""
    found: dict[str, list[Score]] = {}
    for task in tasks:
        outcome = oracle.get((task.folder.name, ()))
        if outcome is not None:
            plain = _score(truth, task.key, Outcome(None))
            beside = beside_oracle(plain, outcome, left_out=bool(task.without))
            found.setdefault(_tier(plain, task.key), []).append(beside)
    for tier, scores in sorted(found.items()):
        sure = [s.oracle_probability for s in scores if s.oracle_probability is not None]
        yield f"oracle, {tier}: {sum(s.oracle or False for s in scores)} of {len(scores)}" + (
            f", P(truth) {fmean(sure):.2f}" if sure else ""
        )


def _row(name: str, scores: Sequence[Score]) -> str:
    errors = [s.closure_error for s in scores if s.closure_error is not None]
    seconds = [s.seconds for s in scores if s.seconds is not None]
    return (
        f"{name:8} {sum(s.top_1 for s in scores)} of {len(scores)} right, "
        f"{sum(s.class_hit for s in scores)} in class, "
        f"{sum(s.open or False for s in scores)} unknown or class, "
        f"{sum(s.misattributed for s in scores)} sure but wrong; "
        f"P(truth) {fmean(s.probability for s in scores):.2f}, "
        f"log score {fmean(s.log_score for s in scores):.2f}"
        + (f", closure error {median(errors):.3f}" if errors else "")
        + (f", {median(seconds):.1f} s" if seconds else "")
    )


def _tier(score: Score, key: Key) -> str:
    return _LEFT_OUT if key[1] else score.tier


def _name(effects: Effects) -> str:
    return "+".join(effects) or "none"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.withheld.quick",
        description="Diagnose campaigns that are kept, and compare with a former version.",
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="with campaigns/ and truth.json")
    parser.add_argument("--tiers", default=_TIERS, help=f"default {_TIERS}")
    parser.add_argument("--first", type=int, default=10**6, help="campaigns of each tier")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--oracle", action="store_true", help="ask the oracle, not planner")
    parser.add_argument("--against", type=Path, help="answers of a former version")
    return parser


if __name__ == "__main__":
    sys.exit(main())
