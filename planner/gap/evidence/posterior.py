"""From evidence to probabilities: the verdict, its class, and when it is unknown."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations

import numpy as np
from scipy.special import logsumexp

from planner.gap.diagnosis import Detectable, FoundEffect, Hypothesis
from planner.gap.evidence.problem import (
    Problem,
    falls,
    replicate_floor,
    squared_errors,
)
from planner.gap.evidence.settle import Elimination
from planner.gap.evidence.surrogate import Candidate, SignedForm, node_weights
from planner.gap.evidence.weigh import (
    ANY,
    GAIN,
    Effects,
    HypothesisKey,
    Priors,
    Weighed,
    in_another_unit,
)
from planner.numerics import FloatArray

__all__ = [
    "ALIKE_COSINE",
    "ENOUGH_SPECIMENS",
    "NO_GAP",
    "UNKNOWN",
    "Evidence",
    "class_of",
    "detectable_sizes",
    "evidence_of",
    "found_effects",
    "needed_nats",
    "posterior",
    "ranking_of",
    "verdict_of",
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
    several effects those beside which another closes nothing of the gap.
    """
    odds = {h.effects: float(np.log(max(h.probability, 1e-300))) for h in ranking}
    leading = odds.get(verdict, max(odds.values()))
    alike = _fits_of_same_pattern(problem, weighed, list(odds))

    def near(effects: Effects) -> bool:
        fit = alike.get((verdict, effects), -np.inf)
        return odds[effects] > leading - _ALIKE_NATS or fit > -2.0 * _ALIKE_NATS

    found = [verdict, *(h.effects for h in ranking if h.effects != verdict and near(h.effects))]
    for both in [effects for effects in found if len(effects) > 1]:
        found += [one for one in _enough_alone(problem, weighed, both) if one not in found]
    return tuple(found)


def _enough_alone(problem: Problem, weighed: Weighed, both: Effects) -> list[Effects]:
    """Return those of several effects, less one, that close as much of the gap.

    The more strongly an effect shows, the more its form's own error asks for a second one, in
    evidence: what is small in force may count for much there.
    """
    errors = {
        effects: squared_errors(problem, weighed.best[effects])
        for effects in (both, *(tuple(e for e in both if e != id) for id in both))
        if effects in weighed.best
    }
    return [e for e in errors if e != both and not falls(problem, errors[e], errors[both])]


def _fits_of_same_pattern(
    problem: Problem, weighed: Weighed, among: Iterable[Effects]
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
    alike = m > ALIKE_COSINE * np.outer(size, size)
    return {
        (one, other): best[other].gain - best[one].gain
        for (i, one), (j, other) in permutations(enumerate(best), 2)
        if alike[i, j]
    }


# ------------------------------------------------------------------------------------------------
# What a ranking goes by: numbers that the calibration of priors keeps of each campaign.


ENOUGH_SPECIMENS = 6
"""Fewer hardly tell causes apart: what is named then has at most a share, from nothing with one
specimen on. Chosen: three conditions, twice each."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that a campaign's ranking goes by.

    Attributes
    ----------
    log_prior, log_evidence
        Of each hypothesis.
    within_floor, scatter_like
        Whether the palette misses by no more than replicates differ by, and these along no column;
        and the effects that look like scatter then.
    of_unlike
        Effects with a gain of some specimens, but for a unit's, where replicates are not alike.
    closes
        Of the best effects of the library, whether errors fall with them, and with each of them.
    specimens
        How many.
    """

    log_prior: Mapping[HypothesisKey, float]
    log_evidence: Mapping[HypothesisKey, float]
    specimens: int = ENOUGH_SPECIMENS
    within_floor: bool = False
    scatter_like: frozenset[str] = frozenset()
    of_unlike: frozenset[Effects] = frozenset()
    closes: Mapping[Effects, bool] = field(default_factory=dict)

    @property
    def vain(self) -> frozenset[Effects]:
        """Effects that close nothing, or no more than fewer of them do."""
        return frozenset(effects for effects, closes in self.closes.items() if not closes)


def evidence_of(problem: Problem, weighed: Weighed) -> Evidence:
    """Return what a campaign's ranking goes by."""
    errors = squared_errors(problem, Candidate(()))
    floor = replicate_floor(problem)
    known = np.isfinite(errors if floor is None else floor) & ~problem.strays
    return Evidence(
        log_prior=weighed.log_prior,
        log_evidence=weighed.log_evidence,
        specimens=len(problem.campaign.specimens),
        within_floor=floor is not None
        and bool(np.mean(errors[known]) <= NO_GAP**2 * np.mean(floor[known]))
        and not problem.apart.any(),
        # What a sensor does to all specimens of one condition, their scatter does as well.
        scatter_like=frozenset(
            b.effect.id
            for b in problem.branches
            if b.effect.stage == "sensor" and len(problem.model.tests) == 1
        ),
        of_unlike=frozenset(
            effects
            for effects, candidate in weighed.best.items()
            if problem.scatter.heterogeneous
            and candidate.members is not None
            and not in_another_unit(candidate)
        ),
        closes=_closes(problem, weighed),
    )


_LOOKED_AT = 12
"""Effects, the best ones by evidence, of which is asked whether errors fall. Convention: as many as
a diagnosis ranks."""


def _closes(problem: Problem, weighed: Weighed) -> Mapping[Effects, bool]:
    """Return whether tests' errors fall with the best effects, and with each further one of them.

    Laws are as they likeliest are with the effects, and without: what the palette is off by is no
    effect's to close.
    """
    value = {
        e: weighed.log_evidence[e, ""]
        for e in weighed.best
        if e and (e, "") in weighed.log_evidence
    }
    best = sorted(value, key=lambda e: -value[e])[:_LOOKED_AT]
    found: dict[Effects, bool] = {}
    errors: dict[Effects, FloatArray] = {}
    for effects in sorted((e for e in value if any(set(e) <= set(b) for b in best)), key=len):
        candidate = weighed.best[effects]
        world = weighed.settled_as(candidate).world
        before, errors[effects] = (
            np.where(
                problem.strays,
                np.nan,
                squared_errors(problem, one, world.calibrated(one)),
            )
            for one in (Candidate(()), candidate)
        )
        fewer = [errors[e] for e, closes in found.items() if closes and set(e) < set(effects)]
        found[effects] = all(falls(problem, one, errors[effects]) for one in (before, *fewer))
    return found


# ------------------------------------------------------------------------------------------------
# From weighed hypotheses to the ranking that a diagnosis reports.


NO_GAP = 1.02
"""Error before over the floor up to which there is nothing to close. Chosen: the floor itself is
known no better, and a share of nothing is none."""


def ranking_of(evidence: Evidence, priors: Priors) -> tuple[Hypothesis, ...]:
    """Return hypotheses, the most probable first.

    Evidence counts the share of itself that `Priors` say. A gap no larger than what replicates
    differ by is no unknown one; a right effect may be smaller than that. What closes nothing is no
    explanation: of a gap that is larger it speaks for what closes it, or for an unknown. Where
    replicates are not alike, a condition that nobody wrote down is as likely as a gain of some.
    Very few specimens show a gap, not its cause: the rest of what they name is unknown.
    """
    found = evidence.log_evidence
    # Over no effect in models that are exact, or that all miss.
    none = max(found.get(((), axis), -np.inf) for axis in ("", ANY))
    counts = priors.counted(max(found.values()) - none)
    ranking = posterior(
        {key: prior + counts * found[key] for key, prior in evidence.log_prior.items()}
    )
    p = {h.effects: h.probability for h in ranking}
    vain = dict.fromkeys(evidence.vain, 1.0)
    if evidence.within_floor:
        no_gap = dict.fromkeys([UNKNOWN, *((id,) for id in evidence.scatter_like)], 1.0)
        _give(p, vain | no_gap, ())
    else:
        # In proportion, and to an unknown as if that were `_ALIKE_NATS` below what gives: what has
        # less yet, as a third effect that fits by chance, is no better explanation.
        given = sum(p.get(effects, 0.0) for effects in vain)
        unknown = float(np.exp(-_ALIKE_NATS))
        closing = sum(p.get(e, 0.0) for e, closes in evidence.closes.items() if closes)
        each = given / max(closing + unknown * given, 1e-300)
        for effects in p.keys() & evidence.closes.keys():
            p[effects] *= unknown * each if effects in vain else 1.0 + each
        _give(p, vain, UNKNOWN)
        _give(p, dict.fromkeys(evidence.of_unlike, 0.5), UNKNOWN)
    named = [effects for effects in p if effects not in ((), UNKNOWN)]
    most = (evidence.specimens - 1) / (ENOUGH_SPECIMENS - 1) * (1.0 - p.get((), 0.0))
    over = sum(p[effects] for effects in named)
    if evidence.specimens < ENOUGH_SPECIMENS and over > most:
        _give(p, dict.fromkeys(named, 1.0 - most / over), UNKNOWN)
    beside = {h.effects: h.with_unknown for h in ranking}
    return tuple(
        Hypothesis(effects, p[effects], 0.0 if effects in ((), UNKNOWN) else beside[effects])
        for effects in sorted(p, key=lambda e: (-p[e], e))
    )


def _give(p: dict[Effects, float], share: Mapping[Effects, float], to: Effects) -> None:
    """Give shares of hypotheses' probability to another one; one that gives up all is gone."""
    for effects in (e for e in share if e in p and e != to):
        given = share[effects] * p[effects]
        p[to] = p.get(to, 0.0) + given
        p[effects] -= given
        if share[effects] == 1.0:
            del p[effects]


def verdict_of(ranking: Sequence[Hypothesis]) -> Effects:
    """Return the likeliest hypothesis of the likeliest kind: none, unknown or named."""
    kinds: dict[Effects | None, list[Hypothesis]] = {}
    for h in ranking:
        kinds.setdefault(h.effects if h.effects in ((), UNKNOWN) else None, []).append(h)
    likeliest = max(kinds.values(), key=lambda of_it: sum(h.probability for h in of_it))
    return likeliest[0].effects


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
    one, found, first = weighed.settled_as(candidate), [], 0
    at, sd = one.coordinates, one.deviations()
    for branch, place in candidate.parts:
        own = slice(first, first + len(branch.coordinates(place)))
        found.append(_found(branch, at[own], sd[own]))
        first = own.stop
    if candidate.members is not None:
        h = weighed.plain.products(problem.columns[:, problem.gains])
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
    odds = float(np.log(priors.none * effects / priors.single))
    # Where what counts of a gain g, T g + (1 - T) c g / (c + g), makes up for the odds.
    t, c = priors.temperature, priors.coarseness_nats
    gain = (odds - c + float(np.sqrt((c - odds) ** 2 + 4.0 * t * odds * c))) / (2.0 * t)
    return gain + _WIDTH_NATS


def _smallest(nodes: FloatArray, branch: SignedForm, needed: float) -> float | None:
    sizes = np.geomspace(branch.least, 1.0, _SIZES)
    weights = node_weights([(s, *[0.0] * branch.shapes) for s in sizes])
    enough = np.flatnonzero(0.5 * np.sum((weights @ nodes) * weights, axis=1) >= needed)
    return float(sizes[enough[0]]) if len(enough) else None
