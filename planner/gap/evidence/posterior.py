"""From evidence to probabilities, a verdict, its class, and how sure its parameters are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import logsumexp

from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Detectable, FoundEffect, Hypothesis
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.surrogate import (
    Candidate,
    Elimination,
    InnerProducts,
    SignedForm,
    node_weights,
)
from planner.gap.evidence.weigh import Effects, Priors, Refiner, Weighed
from planner.gap.noise import USUAL
from planner.numerics import FloatArray

__all__ = [
    "FORMLESS",
    "UNKNOWN",
    "WIDTH_NATS",
    "class_of",
    "detectable_sizes",
    "found_effects",
    "heterogeneity_caution",
    "posterior",
    "ranking_of",
    "share_given_up",
    "verdict_of",
    "without_refuted",
]


# ------------------------------------------------------------------------------------------------
# From odds to probabilities, a verdict, and what the data cannot tell from it.


UNKNOWN: Effects = ("unknown",)

_ALIKE_COSINE = 0.95
_ALIKE_NATS = 3.0
_SAME_COSINE = 0.99

_LogOdds = Mapping[tuple[Effects, str], float]


def posterior(runs: Sequence[_LogOdds]) -> tuple[Hypothesis, ...]:
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


def _signature_cosine(problem: Problem, weighed: Weighed, a: Candidate, b: Candidate) -> float:
    """Return the cosine of two candidates' whitened patterns, nuisances projected out."""
    first, second = _combination(problem, a), _combination(problem, b)
    m = weighed.nominal.products[: len(first), : len(first)]
    ma, mb = m @ first, m @ second
    return float(first @ mb / np.sqrt(max(float((first @ ma) * (second @ mb)), 1e-300)))


def class_of(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis], verdict: Effects
) -> tuple[Effects, ...]:
    """Return the hypotheses that the data cannot tell from the verdict, itself first.

    Those less than `_ALIKE_NATS` below it, and single effects whose pattern is the verdict's.
    """
    odds = {h.effects: float(np.log(max(h.probability, 1e-300))) for h in ranking}
    alike = [verdict]
    mine = weighed.best.get(verdict)
    for h in ranking:
        if h.effects == verdict:
            continue
        near = odds[h.effects] > odds[verdict] - _ALIKE_NATS
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
                and _signature_cosine(problem, weighed, mine, other) > _ALIKE_COSINE
                and other.gain > mine.gain - 2.0 * _ALIKE_NATS
            )
        if near:
            alike.append(h.effects)
    return tuple(alike)


def _evened_out(
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
        and abs(other.gain - mine.gain) < _ALIKE_NATS
        and _signature_cosine(problem, weighed, mine, other) > _SAME_COSINE
    ]
    fits = np.array([weighed.best[h.effects].gain for h in alike])
    shares = np.exp(fits - logsumexp(fits)) * sum(h.probability for h in alike)
    changed = dict(zip([h.effects for h in alike], shares.tolist(), strict=True))
    found = [replace(h, probability=changed.get(h.effects, h.probability)) for h in ranking]
    return tuple(sorted(found, key=lambda h: (-h.probability, h.effects)))


def _with_unknown(kept: Sequence[Hypothesis], lost: float) -> tuple[Hypothesis, ...]:
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


# ------------------------------------------------------------------------------------------------
# Whether a named hypothesis fits at all: the best of several wrong ones is still wrong.
#
# The residual that is left, whitened by replicates' noise, the laws' uncertainty and what forms may
# depart by, has a mean square of 1 under the right hypothesis. One that leaves clearly more is no
# explanation, and its probability goes to the unknown.


_ALLOWED = 1.1
"""Mean square that noise, estimated from few replicates, may show: what campaigns without any gap
do not exceed by more than chance."""

_DEVIATIONS = 2.5

_MEASURED_LOG_SD = 0.2
"""Of the scatter's logarithm: below it replicates have measured it."""

FORMLESS = 0.3
"""Share that goes to the unknown where no known form fits as it is."""

_EXPLAINED = 0.85
"""Share of the excess mean square that stands for an effect even if its form is not exact: where an
effect is a hundred times the noise, a form that is right to a few per cent leaves misfits."""

_HALF = 0.5
"""Share below which departures do more than the effect that they are of."""

_ENOUGH_SPECIMENS = 6
_LEAST_SHARE, _SHARE_EACH = 0.4, 0.065

_LEAST_PROBABILITY = 0.01
"""Hypotheses below it are left as they are."""


def goodness_of_fit(
    problem: Problem, gram: InnerProducts, candidate: Candidate
) -> tuple[float, float]:
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


def largest_expected_misfit(problem: Problem, rows: float) -> float:
    """Return the mean square that a right hypothesis hardly exceeds.

    Without replicates scatter may be three times the usual, 9 %, and mean squares nine times.
    """
    doubt = max(problem.scatter.log_sd - _MEASURED_LOG_SD, 0.0) / (USUAL.log_sd - _MEASURED_LOG_SD)
    found = (_ALLOWED + _DEVIATIONS * np.sqrt(2.0 / rows)) * np.exp(2.0 * doubt * np.log(3.0))
    return float(found)


def drop_poor_fits(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis]
) -> tuple[Hypothesis, ...]:
    """Return the ranking, the probability of named hypotheses that do not fit given to unknown.

    Of those that fit only by departing from every form they are known in, a part is: the data ask
    for a form that nobody knows, or for something else. What explains nearly all of a large gap is
    judged one step more mildly.
    """
    gram = problem.whitened.gram()
    limit = largest_expected_misfit(problem, gram.rows)
    before = float(weighed.nominal.products[0, 0]) / gram.rows
    kept, lost = [], 0.0
    for h in ranking:
        if h.effects in ((), UNKNOWN) or h.probability < _LEAST_PROBABILITY:
            kept.append(h)
            continue
        as_it_is, departing = goodness_of_fit(problem, gram, weighed.best[h.effects])
        share = share_given_up(before, as_it_is, departing, limit)
        lost += share * h.probability
        if share < 1.0:
            kept.append(replace(h, probability=(1.0 - share) * h.probability))
    return _with_unknown(kept, lost) if lost else tuple(kept)


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
    if explained >= _EXPLAINED:
        return 0.0 if departing <= limit else FORMLESS
    return FORMLESS if explained >= _HALF and departing <= limit else 1.0


def temper_few_specimens(ranking: Sequence[Hypothesis], specimens: int) -> tuple[Hypothesis, ...]:
    """Return the ranking of a campaign of very few specimens: they show a gap, not its cause.

    What is named has at most 0.4 + 0.065 n together; the rest is unknown.
    """
    named = sum(h.probability for h in ranking if h.effects not in ((), UNKNOWN))
    share = _LEAST_SHARE + _SHARE_EACH * specimens
    none = sum(h.probability for h in ranking if h.effects == ())
    most_named = share * (1.0 - none)
    if specimens >= _ENOUGH_SPECIMENS or named <= most_named:
        return tuple(ranking)
    kept = [
        replace(h, probability=h.probability * most_named / named)
        if h.effects not in ((), UNKNOWN)
        else h
        for h in ranking
    ]
    return _with_unknown(kept, named - most_named)


# ------------------------------------------------------------------------------------------------
# Specimens that should be alike and are not: something differs that no column tells.


_LARGEST_SCATTER = 0.12
"""Of replicates' levels: jetted specimens scatter by 1 to 9 %, and estimates are off by a third."""


def with_heterogeneity(problem: Problem, ranking: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the ranking; where replicates are not alike, "none" gives way to the unknown.

    A gap no larger than what replicates differ by is no gap, unless they differ by what no print
    scatters: then the gap lies between them.
    """
    nothing = sum(h.probability for h in ranking if h.effects == ())
    if not nothing or not _heterogeneous(problem):
        return tuple(ranking)
    return _with_unknown([h for h in ranking if h.effects != ()], nothing)


def heterogeneity_caution(problem: Problem) -> str | None:
    """Return what to tell of replicates that are not alike; None where they are."""
    if not _heterogeneous(problem):
        return None
    columns = _telling(problem.campaign, problem.observed.tests)
    where = (
        f"they differ in column{'s' if len(columns) > 1 else ''} {', '.join(columns)}, which no "
        "effect claims"
        if columns
        else "no column tells them apart"
    )
    return (
        f"specimens made and tested alike differ by {100.0 * problem.scatter.specimen:.0f} %, and "
        f"jetted ones by 1 to 9 %: {where}; give the condition in which they differ its own column"
    )


def _heterogeneous(problem: Problem) -> bool:
    scatter = problem.scatter
    return bool(scatter.degrees_of_freedom and scatter.specimen > _LARGEST_SCATTER)


def _telling(campaign: Campaign, tests: Sequence[Sequence[int]]) -> list[str]:
    """Return the further columns that differ within a test's specimens."""
    return [
        name
        for name in campaign.covariates
        if any(
            len({campaign.specimens[k].covariates.get(name) for k in members}) > 1
            for members in tests
        )
    ]


# ------------------------------------------------------------------------------------------------
# From weighed hypotheses to the ranking that a diagnosis reports.


_GIVEN_UP = 0.7
"""Share of what is named that an explanation gives up which does not predict."""


def ranking_of(problem: Problem, weighed: Weighed) -> tuple[Hypothesis, ...]:
    """Return hypotheses, the most probable first.

    What does not fit gives way to the unknown, what looks the same shares its probability, and few
    specimens name little; where replicates are not alike, something is at work.
    """
    fitting = drop_poor_fits(problem, weighed, posterior([weighed.log_odds]))
    named = temper_few_specimens(
        _evened_out(problem, weighed, fitting), len(problem.campaign.specimens)
    )
    return with_heterogeneity(problem, named)


def without_refuted(ranking: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the ranking of a campaign whose leading explanation predicts worse than none.

    Folds choose among all hypotheses anew, so that what fails is no one of them: all that is named
    gives most of its probability to the unknown, and keeps its place behind it.
    """
    kept = [
        h
        if h.effects in ((), UNKNOWN)
        else replace(h, probability=(1.0 - _GIVEN_UP) * h.probability)
        for h in ranking
    ]
    lost = sum(_GIVEN_UP * h.probability for h in ranking if h.effects not in ((), UNKNOWN))
    return _with_unknown(kept, lost)


# ------------------------------------------------------------------------------------------------
# How well a candidate's parameters are known.


_POINTS = 13
_DROP = 4.5
"""Places whose log likelihood is lower than the best one's by this do not count."""

_LEVEL = 0.90


def found_effects(
    problem: Problem, nominal: Elimination, candidate: Candidate
) -> tuple[FoundEffect, ...]:
    """Return each effect's form and parameters with 90 % intervals, the other's held at its best.

    Intervals are the posterior's under the form's own prior, on a grid around the best place.
    """
    found = []
    if candidate.branches:
        refiner = Refiner(problem, problem.whitened.gram(), candidate, None)
        products = refiner.likelier(nominal.none).products
        found = [_found(products, candidate, k) for k in range(len(candidate.branches))]
    if candidate.members is not None:
        found.append(_some(problem, nominal, candidate))
    return tuple(sorted(found, key=lambda effect: effect.id))


def _some(problem: Problem, elimination: Elimination, candidate: Candidate) -> FoundEffect:
    assert candidate.members is not None
    h = elimination.products[problem.gains, problem.gains]
    sd = 1.0 / np.sqrt(max(float(candidate.members @ h @ candidate.members), 1e-12))
    factor = float(np.exp(candidate.log_gain))
    names = tuple(
        s.id
        for s, member in zip(problem.campaign.specimens, candidate.members, strict=True)
        if member
    )
    ends = (factor * float(np.exp(-1.645 * sd)), factor * float(np.exp(1.645 * sd)))
    return FoundEffect(
        "force-scale", "of-some-specimens", {"factor": factor}, {"factor": ends}, {"factor": "1"},
        names,
    )  # fmt: skip


def _found(products: FloatArray, candidate: Candidate, number: int) -> FoundEffect:
    branch, place = candidate.branches[number], candidate.places[number]
    b, g = _inner(products, candidate, number)
    ends = [_reach(branch, place, d, b, g) for d in range(len(place))]
    axes = [np.linspace(low, high, _POINTS) for low, high in ends]
    grid = list(product(*axes))
    weights = np.array([node_weights(branch, point) for point in grid])
    log = weights @ b - 0.5 * np.sum((weights @ g) * weights, axis=1)
    # The prior of a size is uniform in its logarithm: ds / s.
    log -= np.log([point[0] for point in grid])
    mass = np.exp(log - log.max()).reshape([_POINTS] * len(axes))
    interval: dict[str, tuple[float, float]] = {}
    best = branch.values(place)
    for d, parameter in enumerate(branch.form.parameters):
        marginal = mass.sum(axis=tuple(k for k in range(len(axes)) if k != d))
        low, high = _quantiles(axes[d], marginal)
        one = [list(place), list(place)]
        one[0][d], one[1][d] = low, high
        values = sorted(branch.values(p)[parameter.name] for p in one)
        interval[parameter.name] = (values[0], values[1])
    return FoundEffect(
        branch.effect.id,
        branch.form.name,
        dict(best),
        interval,
        {p.name: p.unit for p in branch.form.parameters},
    )


def _inner(
    products: FloatArray, candidate: Candidate, number: int
) -> tuple[FloatArray, FloatArray]:
    """Return inner products of the branch's nodes with what the other effect leaves, and own."""
    ends = np.cumsum([1, *[b.nodes for b in candidate.branches]])
    own = slice(int(ends[number]), int(ends[number + 1]))
    left = products[own, 0].copy()
    for k, (other, place) in enumerate(zip(candidate.branches, candidate.places, strict=True)):
        if k != number:
            left -= products[own, ends[k] : ends[k + 1]] @ node_weights(other, place)
    return left, products[own, own]


def _reach(
    branch: SignedForm, place: tuple[float, ...], d: int, b: FloatArray, g: FloatArray
) -> tuple[float, float]:
    """Return how far along one direction the likelihood has not dropped by `_DROP`."""
    low, high = (branch.least, 1.0) if d == 0 else (-1.0, 1.0)

    def drop(x: float) -> float:
        point = list(place)
        point[d] = x
        c = node_weights(branch, point)
        return best - float(c @ b - 0.5 * c @ g @ c)

    c = node_weights(branch, place)
    best = float(c @ b - 0.5 * c @ g @ c)
    ends = []
    for end in (low, high):
        inside, outside = place[d], end
        if drop(end) <= _DROP:
            ends.append(end)
            continue
        for _ in range(20):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if drop(middle) <= _DROP else (inside, middle)
        ends.append(outside)
    # Other parameters move along: the reach at held ones is too short by up to this.
    widen = 1.0 if len(place) == 1 else 2.5
    return (
        max(low, place[d] + widen * (ends[0] - place[d])),
        min(high, place[d] + widen * (ends[1] - place[d])),
    )


def _quantiles(at: FloatArray, mass: FloatArray) -> tuple[float, float]:
    share = np.cumsum(mass)
    share = (share - 0.5 * mass) / share[-1]
    tail = 0.5 * (1.0 - _LEVEL)
    low, high = np.interp([tail, 1.0 - tail], share, at).tolist()
    return low, high


# ------------------------------------------------------------------------------------------------
# The smallest size of each effect that this campaign would have shown.


WIDTH_NATS = 3.0
"""What the freedom of size and shape costs an effect, beyond its prior odds."""

_SIZES = 60


def detectable_sizes(
    problem: Problem, elimination: Elimination, priors: Priors
) -> tuple[Detectable, ...]:
    """Return, of each effect's first form, the size whose expected evidence would name it.

    That is where half the squared length of its whitened pattern, nuisances projected out, makes
    up for the prior odds against it and the width of its prior; shapes are at their middle.
    """
    ids = tuple(dict.fromkeys(b.effect.id for b in problem.branches))
    if not ids:
        return ()
    needed = float(np.log(priors.none * len(ids) / priors.single)) + WIDTH_NATS
    found = []
    for id in ids:
        branches = [b for b in problem.branches if b.effect.id == id]
        first = [b for b in branches if b.form is branches[0].form]
        sizes = [_smallest(problem, elimination, b, needed) for b in first]
        known = [s for s in sizes if s is not None]
        size = first[0].form.size
        found.append(Detectable(id, size.name, min(known, default=None), size.unit))
    return tuple(found)


def _smallest(
    problem: Problem, elimination: Elimination, branch: SignedForm, needed: float
) -> float | None:
    first = problem.nodes.start + branch.first
    own = slice(first, first + branch.nodes)
    g = elimination.products[own, own]
    for s in np.geomspace(branch.least, 1.0, _SIZES).tolist():
        c = node_weights(branch, [s] + [0.0] * branch.shapes)
        if 0.5 * float(c @ g @ c) >= needed:
            return float(branch.form.size.high * s**2)
    return None
