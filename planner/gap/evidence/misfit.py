"""Whether a named hypothesis fits at all: the best of several wrong ones is still wrong.

The residual that is left, whitened by replicates' noise, the laws' uncertainty and what forms may
depart by, has a mean square of 1 under the right hypothesis. One that leaves clearly more is no
explanation, and its probability goes to the unknown.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.gap.diagnosis import Hypothesis
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.gram import Gram
from planner.gap.evidence.posterior import UNKNOWN, with_unknown
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.refine import Refiner
from planner.gap.evidence.weigh import Weighed
from planner.gap.noise.estimate import USUAL

__all__ = ["misfits", "most", "share_given_up", "shy", "without_misfits"]

ALLOWED = 1.1
"""Mean square that noise, estimated from few replicates, may show: what campaigns without any gap
do not exceed by more than chance."""

DEVIATIONS = 2.5

MEASURED_LOG_SD = 0.2
"""Of the scatter's logarithm: below it replicates have measured it."""

FORMLESS = 0.3
"""Share that goes to the unknown where no known form fits as it is."""

EXPLAINED = 0.85
"""Share of the excess mean square that stands for an effect even if its form is not exact: where an
effect is a hundred times the noise, a form that is right to a few per cent leaves misfits."""

HALF = 0.5
"""Share below which departures do more than the effect that they are of."""

ENOUGH_SPECIMENS = 6
LEAST_SHARE, SHARE_EACH = 0.4, 0.065

LEAST_PROBABILITY = 0.01
"""Hypotheses below it are left as they are."""


def misfits(problem: Problem, gram: Gram, candidate: Candidate) -> tuple[float, float]:
    """Return the mean square of what a candidate with effects leaves, 1 if it is right.

    Parameters
    ----------
    gram
        The problem's inner products.

    Returns
    -------
    as_it_is, departing
        Without and with what its forms may depart by; the second is never larger.
    """
    if candidate.branches:
        refiner = Refiner(problem, gram, candidate, None, unknown=True)
        found = [refiner.left(e, candidate) / gram.rows for e in refiner.eliminate(1.0)]
        return min(found[:-1]), min(found)
    # A gain of some specimens alone, which has no form to depart from.
    assert candidate.members is not None
    products = gram.eliminate().products
    vector = np.zeros(problem.gains.stop)
    vector[0] = 1.0
    vector[problem.gains] = -candidate.log_gain * candidate.members
    kept = products[: len(vector), : len(vector)]
    left = float(vector @ kept @ vector) / gram.rows
    return left, left


def most(problem: Problem, rows: float) -> float:
    """Return the mean square that a right hypothesis hardly exceeds.

    Without replicates scatter may be three times the usual, 9 %, and mean squares nine times.
    """
    doubt = max(problem.scatter.log_sd - MEASURED_LOG_SD, 0.0) / (USUAL.log_sd - MEASURED_LOG_SD)
    found = (ALLOWED + DEVIATIONS * np.sqrt(2.0 / rows)) * np.exp(2.0 * doubt * np.log(3.0))
    return float(found)


def without_misfits(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis]
) -> tuple[Hypothesis, ...]:
    """Return the ranking, the probability of named hypotheses that do not fit given to unknown.

    Of those that fit only by departing from every form they are known in, a part is: the data ask
    for a form that nobody knows, or for something else. What explains nearly all of a large gap is
    judged one step more mildly.
    """
    gram = problem.whitened.gram()
    limit = most(problem, gram.rows)
    before = float(weighed.nominal.products[0, 0]) / gram.rows
    kept, lost = [], 0.0
    for h in ranking:
        if h.effects in ((), UNKNOWN) or h.probability < LEAST_PROBABILITY:
            kept.append(h)
            continue
        as_it_is, departing = misfits(problem, gram, weighed.best[h.effects])
        share = share_given_up(before, as_it_is, departing, limit)
        lost += share * h.probability
        if share < 1.0:
            kept.append(replace(h, probability=(1.0 - share) * h.probability))
    return with_unknown(kept, lost) if lost else tuple(kept)


def share_given_up(before: float, as_it_is: float, departing: float, limit: float) -> float:
    """Return the share of a hypothesis' probability that its misfit gives to the unknown.

    Parameters
    ----------
    before, as_it_is, departing
        Mean squares without it, with its forms, and with their departures.
    """
    if as_it_is <= limit:
        return 0.0
    explained = 1.0 - (as_it_is - 1.0) / max(before - 1.0, 1e-12)
    if explained >= EXPLAINED:
        return 0.0 if departing <= limit else FORMLESS
    return FORMLESS if explained >= HALF and departing <= limit else 1.0


def shy(ranking: Sequence[Hypothesis], specimens: int) -> tuple[Hypothesis, ...]:
    """Return the ranking of a campaign of very few specimens: they show a gap, not its cause.

    What is named has at most 0.4 + 0.065 n together; the rest is unknown.
    """
    named = sum(h.probability for h in ranking if h.effects not in ((), UNKNOWN))
    share = LEAST_SHARE + SHARE_EACH * specimens
    none = sum(h.probability for h in ranking if h.effects == ())
    most_named = share * (1.0 - none)
    if specimens >= ENOUGH_SPECIMENS or named <= most_named:
        return tuple(ranking)
    kept = [
        replace(h, probability=h.probability * most_named / named)
        if h.effects not in ((), UNKNOWN)
        else h
        for h in ranking
    ]
    return with_unknown(kept, named - most_named)
