"""Choosing conditions one after the other, so that they tell most of every effect."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy.linalg

from planner.arrays import FloatArray, IntArray
from planner.gap.design.power import batch_level, usual_patterns
from planner.gap.effects import Effect, untestable
from planner.gap.evidence.gram import Whitened
from planner.gap.evidence.problem import Problem

__all__ = ["filled", "information", "information_of_pairs", "testable"]

_ROUNDS = 2
"""A condition is chosen so often at most."""


def information_of_pairs(problem: Problem, asked: Sequence[str], copies: int) -> FloatArray:
    """Return what one condition of each candidate tells, (candidates, X, X).

    Inner products of the effects' patterns at their usual size, one a form, then of all
    nuisances: calibration of the laws, courses, and the level that the batches share.

    Parameters
    ----------
    copies
        Specimens of a condition, one a batch.
    """
    patterns = usual_patterns(problem, asked)
    nuisances = problem.whitened.columns[:, -problem.whitened.nuisances :]
    # The mean level of batches is what all conditions share.
    level = batch_level(problem)[:, None] / np.sqrt(copies)
    whole = Whitened(
        np.concatenate([patterns, nuisances, level], axis=1),
        problem.whitened.first_row,
        nuisances.shape[1] + 1,
    )
    edges = whole.first_row.tolist()
    parts = [whole.columns[a:b].T @ whole.columns[a:b] for a, b in pairwise(edges)]
    return copies * np.stack(parts)


def information(pairs: FloatArray, counts: IntArray, forms: Sequence[int]) -> float:
    """Return what chosen conditions tell of the effects in nats, the other effects being possible.

    Of each effect ln det of the information on its forms' sizes, all else being uncertain by a
    prior deviation of 1; an effect of many forms weighs no more than another.

    Parameters
    ----------
    pairs : (candidates, X, X)
        Of `information_of_pairs`, effects first.
    counts : (candidates,)
        How often each is chosen.
    forms
        How many patterns each effect has.
    """
    total = np.tensordot(counts.astype(np.float64), pairs, axes=1)
    total[np.diag_indices(len(total))] += 1.0
    factor = scipy.linalg.cho_factor(total, lower=True, check_finite=False)
    inverse = scipy.linalg.cho_solve(factor, np.eye(len(total), sum(forms)), check_finite=False)
    told, first = 0.0, 0
    for count in forms:
        own = inverse[first : first + count, first : first + count]
        told -= 0.5 * float(np.linalg.slogdet(own)[1]) / count
        first += count
    return told


def testable(problem: Problem, pairs: FloatArray, effects: Sequence[Effect]) -> IntArray:
    """Return how often to choose each candidate, so that every effect can be tested at all.

    The first candidate, at the palette's own conditions, is among them.
    """
    campaign = problem.campaign
    forms = [len(e.forms) for e in effects]
    counts: IntArray = np.zeros(len(campaign.specimens), dtype=np.int64)
    counts[0] = 1

    def lacking(chosen: IntArray) -> int:
        some = tuple(campaign.specimens[k] for k in np.flatnonzero(chosen))
        trial = replace(campaign, specimens=some)
        return sum(untestable(e, trial) is not None for e in effects)

    while missing := lacking(counts):
        steps = list(_steps(counts, 1))
        better = [step for step in steps if lacking(step) < missing] or steps
        if not better:
            break
        counts = _best(better, pairs, forms)
    return counts


def filled(counts: IntArray, conditions: int, pairs: FloatArray, forms: Sequence[int]) -> IntArray:
    """Return the choice with as many more as make up a number of conditions."""
    while counts.sum() < conditions and (steps := list(_steps(counts, _ROUNDS))):
        counts = _best(steps, pairs, forms)
    return counts


def _steps(counts: IntArray, most: int) -> Iterator[IntArray]:
    """Yield every choice with one condition more."""
    for place in np.flatnonzero(counts < most).tolist():
        more = counts.copy()
        more[place] += 1
        yield more


def _best(steps: Sequence[IntArray], pairs: FloatArray, forms: Sequence[int]) -> IntArray:
    """Return the first of the steps that tell most."""
    # Rounded, so that the last bits of another machine choose no other condition.
    told = [round(information(pairs, step, forms), 6) for step in steps]
    return steps[told.index(max(told))]
