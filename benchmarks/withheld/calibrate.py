"""Calibrate the last step of the diagnosis, from evidence to probabilities, on many campaigns.

python -m benchmarks.withheld.reality make --set development --tier all --count 140 --seed 21 \
    --truth DIR/truth.json -o DIR/campaigns
python -m benchmarks.withheld.calibrate DIR --jobs 2

DIR holds `campaigns/` and `truth.json`. What each campaign's ranking goes by is kept in
`evidence-METHOD.jsonl` there, METHOD the hash of the sources of `planner/gap` when the run began;
`--evidence FILE` goes on from one that is there. The library's campaigns are weighed once more
without the effect that they hide. Priors are those that give the truth the highest mean log
probability, tiers by their weights, with a weak pull to the present ones; what they are worth is
shown on fifths of the campaigns that took no part. Temperature and coarseness stay: they stand for
errors of forms, and `other` forms of the development set are too few to tell them. Fitted to
450 campaigns (seed 71) they became .33 and 12 nats, and the log score of validation's other forms
fell from -1.96 to -2.38.
"""

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit
from threadpoolctl import threadpool_limits

from benchmarks.withheld.answers import answer_all, kept_outcomes
from benchmarks.withheld.method import method_sha256
from benchmarks.withheld.scoring import CONFIDENT, Effects, Truth, named, read_truth
from benchmarks.withheld.sealed import ended, interleaved, tasks_in_turn
from benchmarks.withheld.targets import LEFT_OUT
from planner.cli.output import progress
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnose import prepared
from planner.gap.evidence.weigh import (
    EVERY_TEST,
    Evidence,
    HypothesisKey,
    Priors,
    evidence_of,
    ranking_of,
    weigh,
)
from planner.numerics import FloatArray

__all__ = ["Case", "calibrated", "collected", "main", "mean_log_score", "priors_of", "vector"]


# ------------------------------------------------------------------------------------------------
# What each campaign's ranking goes by.


def collected(folder: Path, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return what a campaign's ranking goes by, as a document; see `Evidence`."""
    with threadpool_limits(1, user_api="blas"):
        problem, *_ = prepared(read_campaign(folder), without)
        found = evidence_of(problem, weigh(problem, Priors()))
    return {
        "hypotheses": [
            [list(e), axis, found.log_prior[e, axis], value]
            for (e, axis), value in found.log_evidence.items()
        ],
        "claimed": [axis.axis for axis in problem.unknown if axis.claimed],
        "specimens": found.specimens,
        "within_floor": found.within_floor,
        "scatter_like": sorted(found.scatter_like),
        "closes": sorted([list(effects), closes] for effects, closes in found.closes.items()),
        "without": sorted([list(e), list(fewer)] for e, fewer in found.without.items()),
        "axes": dict(found.axes),
        "priors": asdict(Priors()),
    }


@dataclass(frozen=True)
class Case:
    """One diagnosis: what it goes by, by which priors, which axes effects claim, and the answer."""

    campaign: str
    tier: str
    expected: Effects
    evidence: Evidence
    claimed: frozenset[str]
    priors: Priors


def _case(truth: Truth, name: str, without: tuple[str, ...], document: Mapping[str, Any]) -> Case:
    entry = truth.campaigns[name]
    rows = [((tuple(e), axis), prior, value) for e, axis, prior, value in document["hypotheses"]]
    evidence = Evidence(
        log_prior={key: prior for key, prior, _ in rows},
        log_evidence={key: value for key, _, value in rows},
        specimens=document["specimens"],
        within_floor=document["within_floor"],
        scatter_like=frozenset(document["scatter_like"]),
        closes={tuple(effects): closes for effects, closes in document["closes"]},
        without={tuple(e): tuple(fewer) for e, fewer in document["without"]},
        axes=document["axes"],
    )
    tier = LEFT_OUT if without else entry.tier
    claimed = frozenset(document["claimed"])
    priors = Priors(**document["priors"])
    return Case(name, tier, entry.expected(without), evidence, claimed, priors)


# ------------------------------------------------------------------------------------------------
# Priors of kinds, and of causes out of the library, as free numbers.


def vector(p: Priors) -> FloatArray:
    """Return priors as free numbers; the single effects' is what the others go by."""
    odds = [math.log(kind / p.single) for kind in (p.none, p.pair, p.unknown)]
    shares = [float(logit(share)) for share in (p.beside, p.axes, p.claimed, p.imitated)]
    positive = (p.imitation_nats, p.imitated_by_three)
    return np.array([*odds, *shares, *map(math.log, positive)])


def priors_of(vector: FloatArray, start: Priors) -> Priors:
    """Return the priors that free numbers stand for, the rest as in `start`; kinds sum to 1."""
    v = [float(x) for x in vector]
    none, pair, unknown = map(math.exp, v[:3])
    total = none + 1.0 + pair + unknown
    beside, axes, claimed, imitated = (float(expit(x)) for x in v[3:7])
    return replace(
        start,
        none=none / total,
        single=1.0 / total,
        pair=pair / total,
        unknown=unknown / total,
        beside=beside,
        axes=axes,
        claimed=claimed,
        imitated=imitated,
        imitation_nats=math.exp(v[7]),
        imitated_by_three=math.exp(v[8]),
    )


def _log_prior(priors: Priors, key: HypothesisKey, claimed: frozenset[str]) -> float:
    """Return the part of a hypothesis' log prior that follows from the priors of kinds."""
    effects, axis = key
    of_axis = priors.claimed if axis in claimed else 1.0 - priors.claimed
    if not effects:
        if not axis:
            return math.log(priors.none)
        share = 1.0 - priors.axes if axis == EVERY_TEST else priors.axes * of_axis
        return math.log(priors.unknown * share)
    # A further effect is as rare beside two as a second is beside one.
    further = (priors.pair / priors.single) ** (len(effects) - 1)
    kind = priors.single * further * (1.0 - priors.beside)
    if not axis:
        return math.log(kind)
    return math.log(kind * priors.beside / (1.0 - priors.beside) * of_axis)


def _ranking(case: Case, new: Priors) -> dict[Effects, float]:
    old = case.priors
    moved = {
        key: value + _log_prior(new, key, case.claimed) - _log_prior(old, key, case.claimed)
        for key, value in case.evidence.log_prior.items()
    }
    evidence = replace(case.evidence, log_prior=moved)
    return {h.effects: h.probability for h in ranking_of(evidence, new)}


# ------------------------------------------------------------------------------------------------
# The priors that are best.


_LEAST = 1e-6
"""Of a probability, as in the score."""

_FREE = 1.5
"""Prior deviation of each free number about where it is: what hardly matters stays."""

_FIFTHS = 5


def _by_tier(cases: Sequence[Case]) -> dict[str, list[Case]]:
    tiers: dict[str, list[Case]] = {}
    for case in cases:
        tiers.setdefault(case.tier, []).append(case)
    return tiers


def _log_score(case: Case, ranking: Mapping[Effects, float]) -> float:
    return math.log(max(ranking.get(case.expected, 0.0), _LEAST))


_WEIGHTS = {"none": 10.0, "none-t4": 5.0, "none-scatter": 5.0}
"""Of tiers; 1 of the others. A cause that is not there costs a lab more than one that is missed:
with these, one clean campaign of fifty raises an alarm; with half of them, one of twenty-five."""


def mean_log_score(cases: Sequence[Case], now: Priors) -> float:
    """Return the mean over tiers, each by its weight, of their mean log score, in nats."""
    tiers = _by_tier(cases)
    weights = [_WEIGHTS.get(tier, 1.0) for tier in tiers]
    return fmean(
        (fmean(_log_score(c, _ranking(c, now)) for c in of) for of in tiers.values()), weights
    )


def _loss(free: FloatArray, cases: Sequence[Case], start: Priors) -> float:
    pull = 0.5 * float(np.sum(((free - vector(start)) / _FREE) ** 2)) / len(cases)
    return pull - mean_log_score(cases, priors_of(free, start))


def calibrated(cases: Sequence[Case], start: Priors) -> Priors:
    """Return the priors of the highest mean log score, tiers counting alike."""
    options = {"eps": 1e-3, "maxiter": 60}
    best = minimize(_loss, vector(start), (cases, start), method="L-BFGS-B", options=options)
    return priors_of(best.x, start)


def _held_out(cases: Sequence[Case], start: Priors) -> list[dict[Effects, float]]:
    """Return each case's ranking by priors of the other four fifths of the campaigns."""
    fifth = {name: k % _FIFTHS for k, name in enumerate(dict.fromkeys(c.campaign for c in cases))}
    found = [
        calibrated([c for c in cases if fifth[c.campaign] != k], start) for k in range(_FIFTHS)
    ]
    return [_ranking(c, found[fifth[c.campaign]]) for c in cases]


def _table(cases: Sequence[Case], columns: Mapping[str, Sequence[dict[Effects, float]]]) -> str:
    head = [f"{name}: right, sure but wrong, log score" for name in columns]
    lines = [f"| tier | n | {' | '.join(head)} |", "|---" * (2 + len(columns)) + "|"]
    for tier in (*_by_tier(cases), "all"):
        at = [k for k, c in enumerate(cases) if tier in (c.tier, "all")]
        cells = []
        for rankings in columns.values():
            right = fmean(
                max(rankings[k], key=rankings[k].__getitem__) == cases[k].expected for k in at
            )
            sure = fmean(
                any(
                    named(e) and p > CONFIDENT and e != cases[k].expected
                    for e, p in rankings[k].items()
                )
                for k in at
            )
            score = fmean(_log_score(cases[k], rankings[k]) for k in at)
            cells.append(f"{100 * right:.0f} %, {100 * sure:.0f} %, {score:.2f}")
        lines.append(f"| {tier} | {len(at)} | {' | '.join(cells)} |")
    return "\n".join(lines)


# ------------------------------------------------------------------------------------------------
# The command.


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    return ended(_run, _parser().parse_args(arguments))


def _run(options: argparse.Namespace) -> int:
    folder: Path = options.folder
    truth = read_truth(folder / "truth.json")
    tasks = interleaved(tasks_in_turn(folder, truth, options.first).values())
    journal = options.evidence or folder / f"evidence-{method_sha256()[:12]}.jsonl"
    with progress(enabled=True) as stage:
        answers = partial(answer_all, collected, jobs=options.jobs, stage=stage)
        outcomes = kept_outcomes(tasks, journal, answers)
    cases = [
        _case(truth, name, without, outcome.document)
        for (name, without), outcome in outcomes.items()
        if outcome.document is not None
    ]
    start = Priors()
    names = {case.campaign for case in cases}
    print(f"{len(cases)} diagnoses of {len(names)} campaigns; evidence in {journal}")
    columns = {"present": [_ranking(c, start) for c in cases]}
    if not options.no_held_out:
        columns["calibrated, held out"] = _held_out(cases, start)
    best = calibrated(cases, start)
    columns["calibrated"] = [_ranking(c, best) for c in cases]
    print(_table(cases, columns))
    for field in fields(best):
        print(f"    {field.name}: float = {getattr(best, field.name):.4g}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.withheld.calibrate",
        description="Calibrate the last step of the diagnosis on many campaigns.",
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="with campaigns/ and truth.json")
    parser.add_argument("--first", type=int, default=10**6, help="campaigns of each tier")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--evidence", type=Path, help="of a former run")
    parser.add_argument("--no-held-out", action="store_true", help="leave the check out")
    return parser


if __name__ == "__main__":
    sys.exit(main())
