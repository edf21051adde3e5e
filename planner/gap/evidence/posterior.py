"""From odds to probabilities, a verdict, and what the data cannot tell from it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from planner.arrays import FloatArray
from planner.gap.diagnosis import Hypothesis
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weigh import Effects, Weighed
from planner.gap.evidence.weights import node_weights

__all__ = [
    "UNKNOWN",
    "class_of",
    "evened_out",
    "posterior",
    "signature_cosine",
    "verdict_of",
    "with_unknown",
]

UNKNOWN: Effects = ("unknown",)

ALIKE_COSINE = 0.95
ALIKE_NATS = 3.0
SAME_COSINE = 0.99

LogOdds = Mapping[tuple[Effects, str], float]


def posterior(runs: Sequence[LogOdds]) -> tuple[Hypothesis, ...]:
    """Return probabilities, most probable first, averaged over runs."""
    together: dict[Effects, float] = {}
    beside: dict[Effects, float] = {}
    for odds in runs:
        total = float(logsumexp(list(odds.values())))
        for (effects, axis), value in odds.items():
            key = UNKNOWN if not effects and axis else effects
            share = float(np.exp(value - total)) / len(runs)
            together[key] = together.get(key, 0.0) + share
            if effects and axis:
                beside[key] = beside.get(key, 0.0) + share
    ranked = sorted(together, key=lambda e: (-together[e], e))
    return tuple(
        Hypothesis(e, together[e], beside.get(e, 0.0) / max(together[e], 1e-300)) for e in ranked
    )


def verdict_of(ranking: Sequence[Hypothesis]) -> Effects:
    """Return the effects of the verdict: () for none."""
    return ranking[0].effects


def signature_cosine(problem: Problem, weighed: Weighed, a: Candidate, b: Candidate) -> float:
    """Return the cosine of two candidates' whitened patterns, nuisances projected out."""
    first, second = _combination(problem, a), _combination(problem, b)
    m = weighed.nominal.products[: len(first), : len(first)]
    ma, mb = m @ first, m @ second
    return float(first @ mb / np.sqrt(max(float((first @ ma) * (second @ mb)), 1e-300)))


def class_of(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis], verdict: Effects
) -> tuple[Effects, ...]:
    """Return the hypotheses that the data cannot tell from the verdict, itself first.

    Those less than `ALIKE_NATS` below it, and single effects whose pattern is the verdict's.
    """
    odds = {h.effects: float(np.log(max(h.probability, 1e-300))) for h in ranking}
    alike = [verdict]
    mine = weighed.best.get(verdict)
    for h in ranking:
        if h.effects == verdict:
            continue
        near = odds[h.effects] > odds[verdict] - ALIKE_NATS
        other = weighed.best.get(h.effects)
        if (
            not near
            and mine is not None
            and other is not None
            and len(h.effects) == len(verdict) == 1
        ):
            near = (
                mine.members is None
                and other.members is None
                and signature_cosine(problem, weighed, mine, other) > ALIKE_COSINE
                and other.gain > mine.gain - 2.0 * ALIKE_NATS
            )
        if near:
            alike.append(h.effects)
    return tuple(alike)


def evened_out(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis]
) -> tuple[Hypothesis, ...]:
    """Return the ranking, the leading effect's probability shared with those that look the same.

    Where patterns and fits are the same, what is left of evidence is how wide priors are, and the
    data have no say in that: shares are by fit alone.
    """
    leading = ranking[0]
    mine = weighed.best.get(leading.effects)
    if len(leading.effects) != 1 or mine is None or mine.members is not None:
        return tuple(ranking)
    alike = [
        h
        for h in ranking
        if len(h.effects) == 1
        and (other := weighed.best.get(h.effects)) is not None
        and other.members is None
        and abs(other.gain - mine.gain) < ALIKE_NATS
        and signature_cosine(problem, weighed, mine, other) > SAME_COSINE
    ]
    fits = np.array([weighed.best[h.effects].gain for h in alike])
    shares = np.exp(fits - logsumexp(fits)) * sum(h.probability for h in alike)
    changed = dict(zip([h.effects for h in alike], shares.tolist(), strict=True))
    found = [replace(h, probability=changed.get(h.effects, h.probability)) for h in ranking]
    return tuple(sorted(found, key=lambda h: (-h.probability, h.effects)))


def with_unknown(kept: Sequence[Hypothesis], lost: float) -> tuple[Hypothesis, ...]:
    """Return a ranking of hypotheses that gave up a probability, and the unknown that takes it."""
    unknown = sum(h.probability for h in kept if h.effects == UNKNOWN) + lost
    others = [h for h in kept if h.effects != UNKNOWN]
    together = [*others, Hypothesis(UNKNOWN, unknown, 0.0)]
    return tuple(sorted(together, key=lambda h: (-h.probability, h.effects)))


def _combination(problem: Problem, candidate: Candidate) -> FloatArray:
    """Return the candidate's pattern as a combination of residual, nodes and gains."""
    vector = np.zeros(problem.gains.stop)
    for branch, place in zip(candidate.branches, candidate.places, strict=True):
        first = problem.nodes.start + branch.first
        vector[first : first + branch.nodes] += node_weights(branch, place)
    if candidate.members is not None:
        vector[problem.gains] = candidate.log_gain * candidate.members
    return vector
