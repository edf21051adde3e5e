"""From evidence to probabilities: the verdict, its class, and when it is unknown."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from scipy.special import expit, logsumexp

from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Detectable, FoundEffect, Hypothesis
from planner.gap.evidence.problem import (
    Problem,
    falls,
    replicate_floor,
    specimen_forces_N,
    squared_errors,
)
from planner.gap.evidence.search import GAIN
from planner.gap.evidence.settle import World
from planner.gap.evidence.surrogate import (
    Candidate,
    Elimination,
    SignedForm,
    node_weights,
)
from planner.gap.evidence.weigh import Effects, HypothesisKey, Priors, Weighed, coarsened
from planner.numerics import FloatArray

__all__ = [
    "ALIKE_COSINE",
    "ENOUGH_SPECIMENS",
    "UNKNOWN",
    "Doubt",
    "Evidence",
    "class_of",
    "detectable_sizes",
    "evidence_of",
    "found_effects",
    "heterogeneity_caution",
    "needed_nats",
    "posterior",
    "ranking_of",
]


# ------------------------------------------------------------------------------------------------
# From odds to probabilities, a verdict, and what the data cannot tell from it.


UNKNOWN: Effects = ("unknown",)

ALIKE_COSINE = 0.95
"""Of patterns, above which one that fits as well is of the other's class. Chosen: a tenth of one's
square is not the other's, which few campaigns show."""

_ALIKE_NATS = 3.0
"""Below the verdict, within which the data do not tell from it. Convention: odds of twenty to one,
as a level of 5 %."""

_SAME_COSINE = 0.99
"""Of patterns, above which two are the same to the data. Chosen: a fiftieth of one's square is not
the other's, less than a wrong form leaves."""


def posterior(log_odds: Mapping[HypothesisKey, float]) -> tuple[Hypothesis, ...]:
    """Return probabilities, most probable first."""
    together: dict[Effects, float] = {}
    beside: dict[Effects, float] = {}
    total = float(logsumexp(list(log_odds.values())))
    for (effects, axis), value in log_odds.items():
        key = UNKNOWN if not effects and axis else effects
        share = float(np.exp(value - total))
        together[key] = together.get(key, 0.0) + share
        if effects and axis:
            beside[key] = beside.get(key, 0.0) + share
    ranked = sorted(together, key=lambda e: (-together[e], e))
    return tuple(
        Hypothesis(e, together[e], beside.get(e, 0.0) / max(together[e], 1e-300)) for e in ranked
    )


def class_of(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis], verdict: Effects
) -> tuple[Effects, ...]:
    """Return the hypotheses that the data cannot tell from the verdict, itself first.

    Those less than `_ALIKE_NATS` below it, single effects whose pattern is the verdict's, and of
    two effects the one beside which the other closes nothing of the gap.
    """
    odds = {h.effects: float(np.log(max(h.probability, 1e-300))) for h in ranking}
    leading = odds.get(verdict, max(odds.values()))
    alike = _fits_of_same_pattern(problem, weighed, list(odds), ALIKE_COSINE)

    def near(effects: Effects) -> bool:
        fit = alike.get((verdict, effects), -np.inf)
        return odds[effects] > leading - _ALIKE_NATS or fit > -2.0 * _ALIKE_NATS

    found = [verdict, *(h.effects for h in ranking if h.effects != verdict and near(h.effects))]
    for both in [effects for effects in found if len(effects) == 2]:
        found += [one for one in _enough_alone(problem, weighed, both) if one not in found]
    return tuple(found)


def _enough_alone(problem: Problem, weighed: Weighed, both: Effects) -> list[Effects]:
    """Return those of two effects that close as much of the gap alone.

    The more strongly an effect shows, the more its form's own error asks for a second one, in
    evidence: what is small in force may count for much there.
    """
    errors = {
        effects: squared_errors(
            problem, specimen_forces_N(problem, weighed.best[effects], problem.model.setup)
        )
        for effects in (both, *((id,) for id in both))
        if effects in weighed.best
    }
    return [e for e in errors if e != both and falls(problem, errors[e], errors[both]) < 0.5]


def _fits_of_same_pattern(
    problem: Problem, weighed: Weighed, among: Iterable[Effects], cosine: float
) -> dict[tuple[Effects, Effects], float]:
    """Return how much better the second effect's best form fits than the first's, in nats.

    Of pairs of single effects, of all specimens, whose whitened patterns, nuisances projected out,
    have a larger cosine than this.
    """
    best = {e: weighed.best[e] for e in among if len(e) == 1 and e in weighed.best}
    best = {e: candidate for e, candidate in best.items() if candidate.members is None}
    if len(best) < 2:
        return {}
    patterns = np.stack([problem.signature(candidate) for candidate in best.values()], axis=1)
    m = weighed.plain.products(patterns)
    size = np.sqrt(np.maximum(np.diagonal(m), 1e-150))
    alike = m > cosine * np.outer(size, size)
    return {
        (one, other): best[other].gain - best[one].gain
        for (i, one), (j, other) in permutations(enumerate(best), 2)
        if alike[i, j]
    }


def _evened_out(ranking: Sequence[Hypothesis], evidence: "Evidence") -> tuple[Hypothesis, ...]:
    """Return the ranking, the leading effect's probability shared with those that look the same.

    Where patterns and fits are the same, what is left of evidence is how wide priors are, and the
    data have no say in that: shares are by fit alone.
    """
    leading = ranking[0].effects
    fits = {leading: 0.0} | {
        other: fit
        for (one, other), fit in evidence.same.items()
        if one == leading and abs(fit) < _ALIKE_NATS
    }
    alike = [h for h in ranking if h.effects in fits]
    if len(alike) < 2:
        return tuple(ranking)
    together = logsumexp([fits[h.effects] for h in alike])
    whole = sum(h.probability for h in alike)
    changed = {h.effects: whole * float(np.exp(fits[h.effects] - together)) for h in alike}
    return _sorted(replace(h, probability=changed.get(h.effects, h.probability)) for h in ranking)


def _sorted(ranking: Iterable[Hypothesis]) -> tuple[Hypothesis, ...]:
    return tuple(sorted(ranking, key=lambda h: (-h.probability, h.effects)))


def _given_to_unknown(
    ranking: Sequence[Hypothesis], share: Mapping[Effects, float]
) -> tuple[Hypothesis, ...]:
    """Return a ranking in which hypotheses give shares of their probability to the unknown.

    One that gives up all is gone.
    """
    lost = sum(share.get(h.effects, 0.0) * h.probability for h in ranking)
    if not lost:
        return tuple(ranking)
    unknown = sum(h.probability for h in ranking if h.effects == UNKNOWN) + lost
    kept = [
        replace(h, probability=(1.0 - share.get(h.effects, 0.0)) * h.probability)
        for h in ranking
        if h.effects != UNKNOWN and share.get(h.effects, 0.0) < 1.0
    ]
    return _sorted([*kept, Hypothesis(UNKNOWN, unknown, 0.0)])


def _named(ranking: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the hypotheses with effects of the library."""
    return [h for h in ranking if h.effects not in ((), UNKNOWN)]


# ------------------------------------------------------------------------------------------------
# What a ranking goes by: numbers that the calibration of the last step keeps of each campaign.


_LOOKED_AT = 12
"""Effects, the best ones by evidence, of which is known how much of the gap they leave open.
Convention: as many as a diagnosis ranks."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that a campaign's ranking goes by.

    Attributes
    ----------
    log_prior, log_evidence
        Of each hypothesis.
    inexact
        Of effects: the share of their evidence that asks for a discrepancy.
    missing
        Of effects: the share of the gap's square that they leave open, 0 to 1.
    same
        Of pairs of single effects whose patterns are the same: how much better the other fits, in
        nats.
    specimens
        How many.
    heterogeneous
        Whether replicates differ by more than prints scatter.
    predicts
        The probability that tests which took no part are predicted better by what is likely than
        by the palette alone; 1 while this is not known. Folds choose among all hypotheses anew, so
        that it speaks for all that is named.
    another_unit
        Log evidence of some specimens in another unit, where that leads.
    """

    log_prior: Mapping[HypothesisKey, float]
    log_evidence: Mapping[HypothesisKey, float]
    inexact: Mapping[Effects, float]
    missing: Mapping[Effects, float]
    same: Mapping[tuple[Effects, Effects], float]
    specimens: int
    heterogeneous: bool
    predicts: float = 1.0
    another_unit: float = -np.inf


def evidence_of(problem: Problem, weighed: Weighed) -> Evidence:
    """Return what a campaign's ranking goes by."""
    named = [e for e, axis in weighed.log_evidence if e and not axis]
    named.sort(key=lambda e: -weighed.log_evidence[e, ""])
    looked_at = named[:_LOOKED_AT]
    world = next(w for w in weighed.worlds if w.discrepancy == weighed.discrepancy)
    return Evidence(
        log_prior=weighed.log_prior,
        log_evidence=weighed.log_evidence,
        inexact={e: weighed.inexact(e) for e in named},
        missing=_missing(world, {e: weighed.best[e] for e in looked_at}),
        same=_fits_of_same_pattern(problem, weighed, looked_at, _SAME_COSINE),
        specimens=len(problem.campaign.specimens),
        heterogeneous=problem.scatter.heterogeneous,
        another_unit=weighed.another_unit,
    )


def _missing(world: World, candidates: Mapping[Effects, Candidate]) -> dict[Effects, float]:
    """Return the share of the gap's square that each candidate leaves open, 0 to 1.

    The gap above what replicates differ by: in force, as the gap is. Their scatter in logarithms
    may be many times that, by what they differ by where they hardly bear any load. Laws are as
    they likeliest are, with the candidate and without: what the palette is off by is no effect's
    to close.
    """
    problem = world.problem
    own = replicate_floor(problem)
    floor = problem.scatter.specimen if own is None else float(np.sqrt(np.nanmean(own)))

    def above(one: Candidate) -> float:
        forces = specimen_forces_N(problem, one, world.calibrated(one))
        return max(float(np.sqrt(np.mean(squared_errors(problem, forces)))) - floor, 0.0)

    gap = max(above(Candidate(())), 1e-12)
    return {e: min(above(one) / gap, 1.0) ** 2 for e, one in candidates.items()}


# ------------------------------------------------------------------------------------------------
# Whether a named hypothesis is to be believed: the best of several wrong ones is still wrong.
#
# One that fits only with more beside it, a discrepancy or a pattern along an axis, and yet closes
# little of the gap is no explanation; and what is in no library is imitated by what is. The share
# of its probability that goes to the unknown is logistic in both.


@dataclass(frozen=True, slots=True)
class Doubt:
    """Log odds that what is named is a cause out of the library, beyond what evidence says.

    The sum of `always`, of `missing` times the share of the gap's square that is left open, of
    `inexact` times the share of the evidence that asks for more beside, of `both` times their
    product, and of `unpredicted` times the probability that tests which took no part are predicted
    no better. Calibrated: with `Priors`, by `benchmarks/withheld/calibrate.py`; two effects are in
    no more doubt than one.
    """

    always: float = -2.789
    missing: float = 2.009
    inexact: float = 0.6053
    both: float = 7.715
    unpredicted: float = 1.149

    def share(self, hypothesis: Hypothesis, evidence: Evidence) -> float:
        """Return the share of a hypothesis' probability that goes to the unknown."""
        missing = evidence.missing.get(hypothesis.effects, 0.0)
        exact = 1.0 - evidence.inexact.get(hypothesis.effects, 0.0)
        inexact = 1.0 - (1.0 - hypothesis.with_unknown) * exact
        return float(
            expit(
                self.always
                + self.missing * missing
                + self.inexact * inexact
                + self.both * missing * inexact
                + self.unpredicted * (1.0 - evidence.predicts)
            )
        )


ENOUGH_SPECIMENS = 6
_LEAST_SHARE, _SHARE_EACH = 0.4, 0.065
"""Of fewer specimens, what is named has at most one share, and another each, together. Chosen: one
specimen hardly tells causes apart (0.47), and five do nearly as six (0.73)."""


def _tempered(ranking: Sequence[Hypothesis], specimens: int) -> tuple[Hypothesis, ...]:
    """Return the ranking of a campaign of very few specimens: they show a gap, not its cause.

    What is named has at most 0.4 + 0.065 n together; the rest is unknown.
    """
    named = sum(h.probability for h in _named(ranking))
    none = sum(h.probability for h in ranking if h.effects == ())
    most_named = (_LEAST_SHARE + _SHARE_EACH * specimens) * (1.0 - none)
    if specimens >= ENOUGH_SPECIMENS or named <= most_named:
        return tuple(ranking)
    share = 1.0 - most_named / named
    return _given_to_unknown(ranking, {h.effects: share for h in _named(ranking)})


# ------------------------------------------------------------------------------------------------
# Specimens that should be alike and are not: something differs that no column tells.


def heterogeneity_caution(problem: Problem) -> str | None:
    """Return what to tell of replicates that are not alike; None where they are."""
    if not problem.scatter.heterogeneous:
        return None
    columns = _telling(problem.campaign, problem.model.replicates)
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


def ranking_of(
    evidence: Evidence,
    coarseness_nats: float,
    doubt: Doubt | None = None,
    *,
    open_to_others: bool = True,
) -> tuple[Hypothesis, ...]:
    """Return hypotheses, the most probable first.

    What looks the same shares its probability, what is in doubt gives way to the unknown, and few
    specimens name little. A gap no larger than what replicates differ by is no gap, unless they
    differ by what no print scatters: then it lies between them, and "none" gives way.

    Parameters
    ----------
    open_to_others
        Whether the doubt that is always there counts too: of what is in no library and is imitated
        by what is. No campaign says anything of it.
    """
    doubt = Doubt() if doubt is None else doubt
    odds = coarsened(
        evidence.log_prior, evidence.log_evidence, coarseness_nats, evidence.another_unit
    )
    evened = _evened_out(posterior(odds), evidence)
    least = 0.0 if open_to_others else float(expit(doubt.always))
    shares = {h.effects: max(doubt.share(h, evidence) - least, 0.0) for h in _named(evened)}
    fitting = _given_to_unknown(evened, shares)
    ranking = _tempered(fitting, evidence.specimens)
    return _given_to_unknown(ranking, {(): 1.0}) if evidence.heterogeneous else ranking


# ------------------------------------------------------------------------------------------------
# How well a candidate's parameters are known.


_TAIL = 1.645
"""Deviations of a normal coordinate to either side. Convention: they hold 90 % of it."""


def found_effects(
    problem: Problem, weighed: Weighed, candidate: Candidate
) -> tuple[FoundEffect, ...]:
    """Return each effect's form and parameters with 90 % intervals.

    Intervals are the posterior's, normal about its mode in coordinates in which the prior is.
    """
    found = []
    if candidate.branches:
        one = weighed.settled_as(candidate)
        at, sd = one.coordinates, one.deviations()
        first = 0
        for branch, place in zip(candidate.branches, candidate.places, strict=True):
            own = slice(first, first + len(branch.coordinates(place)))
            found.append(_found(branch, at[own], sd[own]))
            first = own.stop
    if candidate.members is not None:
        h = weighed.plain.products(problem.whitened.columns[:, problem.gains])
        found.append(_gain_found(problem, h, candidate.members, candidate.log_gain))
    return tuple(sorted(found, key=lambda effect: effect.id))


def _gain_found(
    problem: Problem, inner: FloatArray, members: FloatArray, log_gain: float
) -> FoundEffect:
    sd = 1.0 / np.sqrt(max(float(members @ inner @ members), 1e-12))
    factor, reach = float(np.exp(log_gain)), float(np.exp(_TAIL * sd))
    return FoundEffect(
        GAIN,
        "of-some-specimens",
        {"factor": factor},
        {"factor": (factor / reach, factor * reach)},
        {"factor": "1"},
        tuple(s.id for s, m in zip(problem.campaign.specimens, members, strict=True) if m),
    )


def _found(branch: SignedForm, at: FloatArray, sd: FloatArray) -> FoundEffect:
    ends = [branch.values(branch.place(at + step * sd)) for step in (-_TAIL, 0.0, _TAIL)]
    low, middle, high = ends
    interval = {name: (min(low[name], high[name]), max(low[name], high[name])) for name in middle}
    units = {p.name: p.unit for p in branch.form.parameters}
    units |= dict.fromkeys(branch.form.details, "1")
    return FoundEffect(branch.effect.id, branch.form.name, middle, interval, units)


# ------------------------------------------------------------------------------------------------
# The smallest size of each effect that this campaign would have shown.


_WIDTH_NATS = 3.0
"""What the freedom of size and shape costs an effect, beyond its prior odds. Chosen: ln 20, for a
size that is known to a twentieth of its prior."""

_SIZES = 60
"""At which is looked for the smallest that would be named. Numerical: in steps of some 6 % of
the size, for a largest one of 40 times the smallest."""


def detectable_sizes(
    problem: Problem, elimination: Elimination, priors: Priors
) -> tuple[Detectable, ...]:
    """Return, of each effect's first form, the size whose expected evidence would name it.

    That is where half the squared length of its whitened pattern, nuisances projected out, makes
    up for the prior odds against it and the width of its prior; shapes are at their middle.
    """
    nodes = elimination.products[problem.nodes, problem.nodes]
    first_forms = {b.effect.id: b.form for b in reversed(problem.branches)}
    found = []
    for id in dict.fromkeys(b.effect.id for b in problem.branches):
        size = first_forms[id].size
        needed = needed_nats(priors, len(first_forms))
        known = [
            size.high * s**2
            for b in problem.branches
            if b.form is first_forms[id]
            and (s := _smallest(nodes[b.own, b.own], b, needed)) is not None
        ]
        found.append(Detectable(id, size.name, min(known, default=None), size.unit))
    return tuple(found)


def needed_nats(priors: Priors, effects: int) -> float:
    """Return the gain at which one of so many effects is named rather than none."""
    return float(np.log(priors.none * effects / priors.single)) + _WIDTH_NATS


def _smallest(nodes: FloatArray, branch: SignedForm, needed: float) -> float | None:
    sizes = np.geomspace(branch.least, 1.0, _SIZES)
    weights = node_weights(branch, [(s, *[0.0] * branch.shapes) for s in sizes])
    enough = np.flatnonzero(0.5 * np.sum((weights @ nodes) * weights, axis=1) >= needed)
    return float(sizes[enough[0]]) if len(enough) else None
