"""Weigh all hypotheses: nothing, single effects, pairs, and each beside an unknown.

Marginal likelihoods by Laplace's method over the parameters of each form, forms averaged within
their effect; over the scale of the scatter by quadrature; over calibration and batches in closed
form. Odds are relative to no effect at the nominal scatter.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from planner.arrays import FloatArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.gram import Elimination
from planner.gap.evidence.individual import individual_columns
from planner.gap.evidence.priors import Priors
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.search import Pairs, Search, Singles
from planner.gap.evidence.subset import weigh_subset
from planner.gap.evidence.unknown import AMPLITUDES

__all__ = ["Effects", "Weighed", "weigh"]

Effects = tuple[str, ...]

WITH_UNKNOWN = 8
"""Hypotheses that are weighed with an unknown beside them."""


@dataclass(slots=True, eq=False)
class Weighed:
    """Log odds by hypothesis.

    Attributes
    ----------
    log_odds
        By effects and the axis of an unknown beside them ("" without), priors included.
    best
        The best form and parameters of each set of effects, at the nominal scatter.
    nominal
        Inner products at the nominal scatter.
    """

    nominal: Elimination
    log_odds: dict[tuple[Effects, str], float] = field(default_factory=dict)
    best: dict[Effects, Candidate] = field(default_factory=dict)

    def add(self, effects: Effects, axis: str, log_odds: float) -> None:
        """Add to a hypothesis' odds."""
        key = (effects, axis)
        self.log_odds[key] = float(np.logaddexp(self.log_odds.get(key, -np.inf), log_odds))

    def offer(self, candidate: Candidate) -> None:
        """Keep a candidate if it is the best of its effects."""
        known = self.best.get(candidate.effects)
        if known is None or candidate.log_evidence > known.log_evidence:
            self.best[candidate.effects] = candidate


def weigh(
    problem: Problem, priors: Priors, weight: FloatArray | None = None, *, quick: bool = False
) -> Weighed:
    """Weigh all hypotheses on a campaign, specimens weighted by `weight` (n,).

    Parameters
    ----------
    quick
        Take the scatter as estimated, and leave out the unknown.
    """
    gram = problem.whitened.gram(weight)
    search = Search.of(problem)
    nominal = gram.eliminate()
    result = Weighed(nominal)
    singles = search.singles(nominal)
    pairs = search.pairs(nominal, search.scan(nominal, singles.place))
    logs = _LogPriors(problem, priors)
    _offer(search, singles, pairs, logs, result)
    contexts = {}
    for effects, candidate in list(result.best.items()):
        if len(effects) == 1 and candidate.branches:
            extra = individual_columns(problem, candidate, weight)
            if extra is not None:
                contexts[effects[0]] = extra
    spread = float(np.exp(problem.scatter.log_sd * np.sqrt(3.0)))
    scales = ((1.0, 2.0 / 3.0), (1.0 / spread, 1.0 / 6.0), (spread, 1.0 / 6.0))
    for scale, share in scales[: 1 if quick else 3]:
        elimination = nominal if scale == 1.0 else gram.eliminate(scale)
        offset = elimination.none - nominal.none + float(np.log(share))
        here = (singles, pairs)
        if scale != 1.0:
            here = search.singles(elimination), search.pairs(elimination, pairs)
        ours = _evidence(search, *here, logs)
        if logs.some:
            subset = weigh_subset(problem, elimination)
            if scale == 1.0:
                result.offer(subset)
            ours[("force-scale",)] = float(
                np.logaddexp(ours[("force-scale",)], subset.log_evidence) - np.log(2.0)
            )
        for id, extra in contexts.items():
            context = gram.eliminate(scale, extra)
            shift = context.none - elimination.none
            theirs = _evidence(
                search, search.singles(context), search.pairs(context, _with(search, pairs, id)),
                logs,
            )  # fmt: skip
            for effects, value in theirs.items():
                if id in effects and effects in ours:
                    ours[effects] = float(np.logaddexp(ours[effects], value + shift) - np.log(2.0))
        result.add((), "", offset + logs.none)
        for effects, value in ours.items():
            result.add(effects, "", offset + logs.of(effects) + value)
        if not quick:
            _beside_unknown(search, elimination, offset, logs, ours, result)
    return result


class _LogPriors:
    """Prior log odds of hypotheses of each kind."""

    def __init__(self, problem: Problem, priors: Priors) -> None:
        effects = {b.effect.id: b.effect for b in problem.branches}
        n = max(len(effects), 1)
        self.some = any(e.some for e in effects.values())
        self.none = float(np.log(priors.none))
        self.single = float(np.log(priors.single * (1.0 - priors.beside) / n))
        self.pair = float(np.log(priors.pair * (1.0 - priors.beside) / max(n * (n - 1) / 2, 1)))
        self.unknown = float(np.log(priors.unknown))
        self.beside = float(np.log(priors.beside / (1.0 - priors.beside)))
        self.branch = np.log([b.weight for b in problem.branches])

    def of(self, effects: Effects) -> float:
        """Return the log prior of effects without an unknown."""
        return (self.none, self.single, self.pair)[len(effects)]


def _offer(
    search: Search, singles: Singles, pairs: Pairs, logs: _LogPriors, result: Weighed
) -> None:
    result.offer(Candidate(()))
    for k in range(len(singles.gain)):
        numbers = (float(singles.gain[k]), float(singles.evidence[k] + logs.branch[k]))
        result.offer(search.candidate([k], [singles.place[k]], *numbers))
    for row, both in enumerate(pairs.branches.tolist()):
        value = float(pairs.evidence[row] + logs.branch[both].sum())
        places = [pairs.place[row, :3], pairs.place[row, 3:]]
        result.offer(search.candidate(both, places, float(pairs.gain[row]), value))


def _evidence(
    search: Search, singles: Singles, pairs: Pairs, logs: _LogPriors
) -> dict[Effects, float]:
    """Return log evidence by effects, forms averaged."""
    names = [b.effect.id for b in search.problem.branches]
    parts: dict[Effects, list[float]] = {}
    for k, name in enumerate(names):
        parts.setdefault((name,), []).append(float(singles.evidence[k] + logs.branch[k]))
    for row, both in enumerate(pairs.branches.tolist()):
        effects = tuple(sorted((names[both[0]], names[both[1]])))
        value = float(pairs.evidence[row] + logs.branch[both].sum())
        parts.setdefault(effects, []).append(value)
    return {effects: float(logsumexp(values)) for effects, values in parts.items()}


def _with(search: Search, pairs: Pairs, id: str) -> Pairs:
    names = np.array([b.effect.id for b in search.problem.branches])
    rows = np.any(names[pairs.branches] == id, axis=1) if len(pairs.branches) else slice(0)
    return Pairs(pairs.branches[rows], pairs.place[rows], pairs.gain[rows], pairs.evidence[rows])


def _beside_unknown(
    search: Search,
    elimination: Elimination,
    offset: float,
    logs: _LogPriors,
    ours: dict[Effects, float],
    result: Weighed,
) -> None:
    """Add the unknown alone, and beside the best hypotheses."""
    problem = search.problem
    if not problem.unknown:
        return
    ranked = sorted(ours, key=lambda e: -(ours[e] + logs.of(e)))[:WITH_UNKNOWN]
    chosen = [result.best[e] for e in ranked if e in result.best and result.best[e].branches]
    each = float(np.log(len(problem.unknown) * len(AMPLITUDES)))
    start = problem.nodes.start
    for number, axis in enumerate(problem.unknown):
        at = problem.unknown_columns(number)
        random = np.arange(at.start, at.stop)
        for candidate in chosen:
            nodes = [start + b.first + np.arange(b.nodes) for b in candidate.branches]
            head = np.concatenate([[0], *nodes])
            part = elimination.part(np.concatenate([head, random]))
            firsts = np.cumsum([0, *[b.nodes for b in candidate.branches]])[:-1]
            alone = candidate.log_evidence
            for amplitude in AMPLITUDES:
                left = part.with_random(slice(len(head), len(head) + len(random)), amplitude,
                                        len(head))  # fmt: skip
                inner = (np.ascontiguousarray(left.products[0, 1:]),
                         np.ascontiguousarray(left.products[1:, 1:]))  # fmt: skip
                _, value = search.climb(inner, firsts, candidate)
                value += left.none - elimination.none
                # Of the best form alone; its share among the effect's forms as without.
                share = ours[candidate.effects] - alone
                value += logs.of(candidate.effects) + logs.beside - each
                value += float(sum(logs.branch[b.number] for b in candidate.branches)) + max(
                    share, 0.0
                )
                result.add(candidate.effects, axis.axis, offset + value)
        part = elimination.part(np.concatenate([[0], random]))
        for amplitude in AMPLITUDES:
            left = part.with_random(slice(1, 1 + len(random)), amplitude, 1)
            value = left.none - elimination.none + logs.unknown - each
            result.add((), axis.axis, offset + value)
