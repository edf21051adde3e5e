"""Weigh all hypotheses: nothing, single effects, pairs, and each beside an unknown."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from planner.gap.campaign import axis_columns
from planner.gap.evidence.problem import AMPLITUDES, Problem, own_axes
from planner.gap.evidence.search import GAIN, Search, weigh_subset
from planner.gap.evidence.settle import Settled, World, joined, settle
from planner.gap.evidence.surrogate import Candidate, Elimination
from planner.gap.noise import FIT_SD, UNIT_GAINS
from planner.numerics import BoolArray, FloatArray

__all__ = [
    "ANY",
    "Effects",
    "HypothesisKey",
    "Priors",
    "Weighed",
    "in_another_unit",
    "reweigh",
    "weigh",
]


# ------------------------------------------------------------------------------------------------
# What is believed before any data: how often campaigns hide nothing, one effect, two, or more.


@dataclass(frozen=True, slots=True)
class Priors:
    """Prior probabilities of kinds of hypothesis; each kind's is shared equally by its members.

    Calibrated: by `benchmarks/withheld/calibrate.py`.

    Attributes
    ----------
    none, single, pair
        Nothing, one effect, two effects of the library.
    unknown
        A pattern that no effect explains, alone.
    beside
        Of any hypothesis with effects, the share that has an unknown beside it.
    axes
        Of an unknown alone, the share of patterns along one axis; the rest goes along every test.
    claimed
        Of an unknown, the share along axes that some effect of the library claims.
    temperature, coarseness_nats
        Share of itself that log evidence counts at least, and what the best hypothesis gains where
        half of the rest counts too: no form is exact, and the more strongly an effect shows, the
        smaller an error of its form would pass for a further effect. A tempered posterior,
        Grunwald & van Ommen, Bayesian Anal. 12, 2017, 1069, coarsened as by Miller & Dunson, J.
        Am. Stat. Assoc. 114, 2019, 1113.
    """

    none: float = 0.3858
    single: float = 0.1154
    pair: float = 0.02849
    unknown: float = 0.4703
    beside: float = 0.01411
    axes: float = 0.4593
    claimed: float = 0.000412
    temperature: float = 0.1
    coarseness_nats: float = 5.0

    def counted(self, gain: float) -> float:
        """Return the share of log evidence that counts where the best hypothesis gains so much."""
        rest = self.coarseness_nats / (self.coarseness_nats + max(gain, 0.0))
        return self.temperature + (1.0 - self.temperature) * rest


# ------------------------------------------------------------------------------------------------
# Weigh all hypotheses: nothing, single effects, pairs, and each beside an unknown.
#
# Marginal likelihoods by Laplace's method over the parameters of each form, forms averaged within
# their effect; over the scale of the scatter by quadrature; over calibration and batches in closed
# form. Odds are relative to no effect at the nominal scatter.


Effects = tuple[str, ...]
HypothesisKey = tuple[Effects, str]
"""Effects, and the axis of an unknown beside them, "" without."""

_Key = TypeVar("_Key", bound=Hashable)

_SINGLES = 24
"""Forms of single effects, and as many pairs as half of them, that are settled. Numerical: the best
ones by the surrogate, of every effect one; it is what a diagnosis' time goes by."""

_BESIDE = 3
"""Effects, the best ones once settled, beside which every other one is looked for anew. Numerical:
what is below the third has little of the evidence."""

_MOST_EFFECTS = 3
"""At work together. Chosen: a fourth beside three that are found would be told by a campaign that
was made for it, and by no other."""

_WITH_UNKNOWN = 8
"""Hypotheses that are weighed with an unknown beside them. Chosen: one that is not among the best
alone is, with an unknown beside it, hardly more than the unknown."""

_OF_SOME = 0.25
"""Prior share, of an effect that may hold for some specimens only, that it does. Chosen: faults of
a machine mostly hold for all that it tested."""

ANY = "every test"
"""In place of an axis, of an unknown that goes along every test."""

_FREE = 0.15
"""Prior share, of an effect with a covariate of its own, of patterns along it that no form has.
Chosen: nothing else is known to depend on that covariate, and forms follow most that do."""


_DISCREPANCIES = {0.0: 0.4, 0.01: 0.2, 0.025: 0.2, 0.06: 0.2}
"""Of a model with effects: how far it may be off, over each test's largest force, with its prior
probability. What has no effects is either exact or unknown. Chosen: from the 1 % that laws follow
their tests to, in steps of 2.5, to what a wrong form of the right effect leaves."""


@dataclass(slots=True, eq=False)
class Weighed:
    """Evidence by hypothesis.

    Attributes
    ----------
    worlds
        Of the scatter as estimated: of models that are exact, of poor laws, of discrepancies.
    log_prior, log_evidence
        By effects and the axis of an unknown beside them ("" without).
    best
        The best form and parameters of each set of effects.
    settled
        Every candidate that was weighed on the forward model.
    beside_some
        Single effects, settled where a gain of some specimens is beside them.
    likeliest
        The world in which the likeliest of these settled, if any did.
    """

    worlds: tuple[World, ...]
    log_prior: dict[HypothesisKey, float] = field(default_factory=dict)
    log_evidence: dict[HypothesisKey, float] = field(default_factory=dict)
    best: dict[Effects, Candidate] = field(default_factory=dict)
    settled: list[Settled] = field(default_factory=list)
    beside_some: list[Settled] = field(default_factory=list)
    likeliest: World | None = None

    @property
    def plain(self) -> World:
        """The world of the scatter as estimated and of models that are exact."""
        return self.worlds[0]

    def relative(self, found: Candidate, world: World) -> float:
        """Return a candidate's evidence in a world, over none in the plain one."""
        return found.log_evidence + world.none - self.plain.none + world.log_share

    def add(self, effects: Effects, axis: str, log_prior: float, log_evidence: float) -> None:
        """Add to a hypothesis' evidence."""
        _add(self.log_evidence, (effects, axis), log_evidence)
        self.log_prior[effects, axis] = log_prior

    def settled_as(self, candidate: Candidate) -> Settled:
        """Return the settled candidate of the same forms, but for a gain of some specimens."""
        if candidate.members is not None:
            for one in self.beside_some:
                if one.candidate.places == candidate.places:
                    return one
        forms = [b.number for b in candidate.branches]
        return next(s for s in self.settled if [b.number for b in s.candidate.branches] == forms)

    def world_of(self, candidate: Candidate) -> World:
        """Return the world in which a candidate is likeliest."""
        if candidate.branches:
            return self.settled_as(candidate).world
        return max(self.worlds, key=lambda world: world.none + world.log_share)

    def offer(self, candidate: Candidate) -> None:
        """Keep a candidate if it is the best of its effects."""
        known = self.best.get(candidate.effects)
        if known is None or candidate.log_evidence > known.log_evidence:
            self.best[candidate.effects] = candidate


def _worlds(problem: Problem) -> tuple[World, ...]:
    """Return the worlds that hypotheses are weighed in, the plain one first.

    Models are exact, the scatter a little off; or laws are as poor as fits may be; or all models
    have a discrepancy.
    """
    spread = float(np.exp(problem.scatter.log_sd * np.sqrt(3.0)))
    errors = _law_errors(problem)
    exact = _DISCREPANCIES[0.0] / len(errors)
    found = [
        World(problem, scale=scale, laws=errors[0] / FIT_SD, share=exact * share)
        for scale, share in ((1.0, 2.0 / 3.0), (1.0 / spread, 1.0 / 6.0), (spread, 1.0 / 6.0))
    ]
    found += [World(problem, laws=error / FIT_SD, share=exact) for error in errors[1:]]
    return *found, *(
        World(problem, discrepancy=size, laws=errors[0] / FIT_SD, share=share)
        for size, share in _DISCREPANCIES.items()
        if size
    )


def weigh(problem: Problem, priors: Priors) -> Weighed:
    """Weigh all hypotheses on a campaign."""
    logs = _LogPriors(problem, priors)
    worlds = _worlds(problem)
    plain, of_scatter = worlds[0], [w for w in worlds if w.scale == 1.0]
    result = Weighed(tuple(of_scatter))
    result.settled = _settled(problem, result.worlds, logs)
    result.offer(Candidate(()))
    for world in worlds:
        evidence = world.none - plain.none + world.log_share
        # What the palette's own fit leaves of its tests is no gap.
        if world.discrepancy <= _law_errors(problem)[0]:
            result.add((), "", logs.none, evidence)
        else:
            result.add((), ANY, logs.any, evidence)
    if logs.some:
        for world in worlds:
            _offer_some(problem, result, _of_some(world, logs), world, logs)
    for one in result.settled:
        for world in worlds:
            found = one.weighed(world, one.eliminated(world))
            found = replace(found, log_evidence=found.log_evidence + logs.forms(found))
            _offer(result, found, world, logs)
    result.beside_some = _settled_beside_some(problem, result, logs)
    for one in result.beside_some:
        _add_subset(problem, one, worlds, logs, result)
    if result.beside_some:
        result.likeliest = result.beside_some[0].world
    elif result.settled:
        result.likeliest = max(result.settled, key=lambda one: one.eliminated(one.world).none).world
    for world in of_scatter:
        _add_unknown(problem, world, logs, result)
    for one in _chosen(result, logs):
        _add_beside(problem, one, logs, result)
        if logs.some and len(one.candidate.effects) < _MOST_EFFECTS:
            _add_subset(problem, one, worlds, logs, result)
    return result


def _offer(result: Weighed, found: Candidate, world: World, logs: "_LogPriors") -> None:
    """Add a candidate without an unknown, weighed in one world."""
    evidence = result.relative(found, world)
    result.add(found.effects, "", logs.of(found.effects), evidence)
    result.offer(replace(found, log_evidence=evidence))


def _offer_some(
    problem: Problem,
    result: Weighed,
    found: Candidate,
    world: World,
    logs: "_LogPriors",
) -> None:
    """Add a candidate with a gain of some specimens, weighed in one world.

    Where a column tells these from the others, what is in it is likelier to be at work than a load
    cell or a slip of the pen that chose them, unless the gain is a unit's.
    """
    assert found.members is not None
    if in_another_unit(found):
        _offer(result, found, world, logs)
        return
    evidence = result.relative(found, world)
    axis = _telling_column(problem, found.members > 0.5)
    if axis is not None:
        effects = tuple(b.effect.id for b in found.branches)
        _add_axis(problem, effects, axis, evidence, logs, result)
        return
    _offer(result, found, world, logs)


def _telling_column(problem: Problem, members: BoolArray) -> int | None:
    """Return the axis of the unknown whose column has no value both in and out of some specimens.

    None if the column is one that tells specimens one by one, or one along which gains may go.
    """
    own = next(b.effect.where for b in problem.branches if b.effect.id == GAIN)
    columns = axis_columns(problem.campaign)
    for number, name in enumerate(axis.axis for axis in problem.unknown):
        cells = columns.get(name)
        if cells is None or name in own or len(set(cells)) > len(cells) // 2:
            continue
        of, other = (
            {cell for cell, member in zip(cells, members, strict=True) if member == side}
            for side in (True, False)
        )
        if of and other and not of & other:
            return number
    return None


def in_another_unit(candidate: Candidate) -> bool:
    """Return whether a gain of some specimens is one of a unit's."""
    return bool(np.min(np.abs(np.abs(candidate.log_gain) - UNIT_GAINS)) < 1e-9)


def _of_some(world: World, logs: "_LogPriors", one: Settled | None = None) -> Candidate:
    """Return a gain of some specimens, alone or beside a settled effect, priors of forms included.

    Its evidence is that over no effect in the world.
    """
    problem = world.problem
    gains = problem.whitened.columns[:, problem.gains]
    if one is None:
        e, beside = world.elimination(problem.whitened.columns[:, 0], kept=gains), Candidate(())
    else:
        e = one.eliminated(world, gains)
        beside = one.weighed(world, e)
    scatter = replace(problem.scatter, specimen=problem.scatter.specimen * world.scale)
    found = weigh_subset(e.products[1:, 0], e.products[1:, 1:], beside, scatter)
    log_prior = logs.forms(beside) + float(np.log(_OF_SOME))
    return replace(found, log_evidence=found.log_evidence + log_prior)


def reweigh(
    problem: Problem, priors: Priors, weighed: Weighed, weight: FloatArray
) -> tuple[World, list[tuple[float, Candidate]]]:
    """Weigh settled candidates on specimens weighted by `weight` (n,).

    By the model linear about where they settled on all specimens, where they stay.

    Returns
    -------
    world
        Of these weights, with the discrepancy that is likeliest on all specimens.
    odds
        Log odds and candidate each.
    """
    logs = _LogPriors(problem, priors)
    like = weighed.likeliest or weighed.plain
    world = World(problem, discrepancy=like.discrepancy, laws=like.laws, weight=weight)
    settled = [one.weighed(world, one.eliminated(world)) for one in weighed.settled]
    prior = [logs.of(c.effects) + logs.forms(c) for c in settled]
    if weighed.beside_some:
        some = [_of_some(world, logs, one) for one in (None, *weighed.beside_some)]
        settled += some
        prior += [logs.of(c.effects) for c in some]
    share = priors.counted(max((c.log_evidence for c in settled), default=0.0))
    odds = [p + share * c.log_evidence for p, c in zip(prior, settled, strict=True)]
    return world, list(zip(odds, settled, strict=True))


def _add(logs: dict[_Key, float], key: _Key, value: float) -> None:
    """Add to a sum that is kept as a logarithm."""
    logs[key] = float(np.logaddexp(logs.get(key, -np.inf), value))


class _LogPriors:
    """Prior log odds of hypotheses of each kind."""

    def __init__(self, problem: Problem, priors: Priors) -> None:
        effects = {b.effect.id: b.effect for b in problem.branches}
        n = max(len(effects), 1)
        self.some = any(e.some for e in effects.values())
        self.none = float(np.log(priors.none))
        self.single = float(np.log(priors.single * (1.0 - priors.beside) / n))
        self.pair = float(np.log(priors.pair * (1.0 - priors.beside) / max(n * (n - 1) / 2, 1)))
        # A third effect is beside two as rare as a second is beside one.
        triples = max(n * (n - 1) * (n - 2) / 6, 1)
        triple = priors.pair**2 / priors.single * (1.0 - priors.beside) / triples
        self.triple = float(np.log(triple))
        self.unknown = _of_axes(problem, priors.axes * priors.unknown, priors.claimed)
        self.any = float(np.log((1.0 - priors.axes) * priors.unknown))
        self.beside = _of_axes(problem, priors.beside / (1.0 - priors.beside), priors.claimed)
        self.branch = np.log([b.weight for b in problem.branches])
        self.owner = own_axes(list(effects.values()))

    def of(self, effects: Effects) -> float:
        """Return the log prior of effects without an unknown."""
        return (self.none, self.single, self.pair, self.triple)[len(effects)]

    def owned(self, effects: Effects, axis: str, result: Weighed) -> Effects | None:
        """Return the effects that a free pattern along an axis beside others amounts to.

        None where the axis is no effect's own, or they would be more than two.
        """
        if axis not in self.owner:
            return None
        together = tuple(sorted({*effects, self.owner[axis]}))
        return together if together in result.best else None

    def forms(self, candidate: Candidate) -> float:
        """Return the log prior of a candidate's forms among those of its effects."""
        return float(sum(self.branch[b.number] for b in candidate.branches))


def _of_axes(problem: Problem, share: float, of_claimed: float) -> FloatArray:
    """Return log priors of an unknown along each axis.

    Where no column is unclaimed, what would lie along such a one is out of the question.
    """
    claimed = np.array([axis.claimed for axis in problem.unknown], dtype=bool)
    counts = np.where(claimed, claimed.sum(), (~claimed).sum())
    kinds = np.where(claimed, of_claimed, 1.0 - of_claimed)
    with np.errstate(divide="ignore"):
        shares: FloatArray = np.log(share * kinds / np.maximum(counts, 1))
    return shares


def _settled(problem: Problem, worlds: Sequence[World], logs: _LogPriors) -> list[Settled]:
    """Return candidates settled: the best forms of every effect, and the pairs worth weighing."""
    nodes = problem.whitened.columns[:, problem.nodes]
    residual = problem.whitened.columns[:, 0]

    def value(candidate: Candidate) -> float:
        return candidate.log_evidence + logs.forms(candidate) + logs.of(candidate.effects)

    # Surrogates are compared where models may be off by as much as surrogates are.
    world = max(worlds, key=lambda w: w.none)
    search = Search.on(problem.branches, world.elimination(residual, kept=nodes), slice(1, None))
    singles = search.singles()
    ranked = sorted(singles, key=lambda c: -value(c))
    first: dict[Effects, Candidate] = {}
    for c in ranked:
        first.setdefault(c.effects, c)
    chosen = list(first.values())
    # Forms with details fit more than their surrogate shows.
    chosen += [c for c in ranked if c.branches[0].form.details and c not in chosen]
    chosen += [c for c in ranked if c not in chosen][: max(_SINGLES - len(chosen), 0)]
    settled = [settle(worlds, c, world) for c in chosen]
    ordered = sorted(settled, key=lambda s: -(s.eliminated(s.world).none + logs.forms(s.candidate)))
    best: dict[Effects, Settled] = {}
    for one in ordered:
        best.setdefault(one.candidate.effects, one)
    pairs = {c.effects: c for c in sorted(search.pairs(singles), key=value)[-_SINGLES // 2 :]}
    for one in reversed(list(best.values())[:_BESIDE]):
        for c in _partners(problem, one, logs)[: _SINGLES // 4]:
            pairs[c.effects] = c
    both = [settle(worlds, c, world) for c in pairs.values()]

    def odds(one: Settled) -> float:
        own = one.candidate
        return one.eliminated(one.world).none + logs.forms(own) + logs.of(own.effects)

    # What looks best with surrogates' forms is looked at in all, and a third effect beside it.
    leading = max(both, key=odds, default=None)
    if leading is None or odds(leading) < max(map(odds, settled)):
        return [*settled, *both]
    forms = {
        frozenset(b.number for b in c.branches): c
        for id, other in (leading.candidate.effects, leading.candidate.effects[::-1])
        if (id,) in best
        for c in _partners(problem, best[id,], logs, of=(other,))
    }
    # Each once, or the pair would count so many times.
    for one in both:
        forms.pop(frozenset(b.number for b in one.candidate.branches), None)
    both += [settle(worlds, c, world) for c in forms.values()]
    leading = max(both, key=odds)
    thirds = _partners(problem, leading, logs)[: _SINGLES // 4]
    return [*settled, *both, *(settle(worlds, c, leading.world) for c in thirds)]


def _partners(
    problem: Problem, one: Settled, logs: _LogPriors, of: Effects | None = None
) -> list[Candidate]:
    """Return a settled candidate joined with each other effect, the best ones first."""
    own = one.candidate
    return [joined(own, c) for c in _others(problem, one.conditional(), own.effects, logs, of)]


def _others(
    problem: Problem,
    left: Elimination,
    beside: Effects,
    logs: _LogPriors,
    of: Effects | None = None,
) -> list[Candidate]:
    """Return the best form of each other effect for what is left, which keeps the nodes.

    Parameters
    ----------
    of
        One effect instead, of which every form is returned.
    """
    found = Search.on(problem.branches, left, slice(1, None)).singles()
    best: dict[Hashable, Candidate] = {}
    for c in sorted(found, key=lambda c: -(c.log_evidence + logs.forms(c))):
        if not set(c.effects) & set(beside) and of in (None, c.effects):
            best.setdefault(c.effects if of is None else c.branches[0].form.name, c)
    return list(best.values())


def _settled_beside_some(problem: Problem, result: Weighed, logs: _LogPriors) -> list[Settled]:
    """Return other effects settled beside a gain of some specimens, where that leads alone.

    Without it they settle where they make up for it. The likeliest first.
    """
    singles = [candidate for effects, candidate in result.best.items() if len(effects) == 1]
    some = max(singles, key=lambda c: c.log_evidence, default=Candidate(()))
    if some.members is None:
        return []
    gain = problem.gain_of(some)
    columns = problem.whitened.columns
    target, nodes = columns[:, 0] - gain, columns[:, problem.nodes]
    world = max(result.worlds, key=lambda w: w.elimination(target).none)
    others = _others(problem, world.elimination(target, kept=nodes), some.effects, logs)
    beside = [replace(c, members=some.members, log_gain=some.log_gain) for c in others]
    found = [settle(result.worlds, c, world) for c in beside[: _SINGLES // 4]]
    found.sort(key=lambda one: -one.eliminated(one.world).none)
    more = _partners(problem, found[0], logs)[: _SINGLES // 4] if found else []
    more = [c for c in more if GAIN not in c.effects]
    found += [
        settle(result.worlds, replace(c, members=some.members, log_gain=some.log_gain), world)
        for c in more
    ]
    found.sort(key=lambda one: -one.eliminated(one.world).none)
    # What the gain does is left for it to make up again, whichever specimens have it.
    return [
        replace(
            one,
            candidate=replace(one.candidate, members=None, log_gain=0.0),
            target=one.target + gain,
        )
        for one in found
    ]


def _chosen(result: Weighed, logs: _LogPriors) -> list[Settled]:
    """Return the best hypotheses' best forms."""
    odds = {
        e: result.log_evidence[e, ""] + logs.of(e)
        for e, c in result.best.items()
        if c.branches and c.members is None
    }
    ranked = sorted(odds, key=lambda e: -odds[e])[:_WITH_UNKNOWN]
    return [result.settled_as(result.best[e]) for e in ranked]


_POOR_FIT = 0.03
"""What a law may leave of its tests where the palette does not say. Physical: laws fitted to other
labs' tests left 1.8 to 7 % of the largest stress."""


def _law_errors(problem: Problem) -> tuple[float, ...]:
    """Return what laws may leave of their own tests, a share of their largest stress.

    The largest that the palette states of the campaign's materials, and what laws usually leave at
    least; that and what they may leave where it does not say.
    """
    names = {way.material for way in problem.ways if way.material}
    laws = [m.uncertainty for m in problem.campaign.palette.materials if m.id in names]
    stated = [u.nrmse for u in laws if u is not None and u.nrmse is not None]
    largest = max([FIT_SD, *stated])
    return (largest,) if len(stated) == len(laws) else (largest, max(largest, _POOR_FIT))


def _along_axes(problem: Problem, target: Elimination) -> Iterator[tuple[int, float]]:
    """Yield each axis of the unknown and what a pattern along it gains, for each amplitude.

    Parameters
    ----------
    target
        Keeps the columns of the unknown after the target.
    """
    first = problem.unknown_span.start - 1
    for number in range(len(problem.unknown)):
        at = problem.unknown_columns(number)
        for amplitude in AMPLITUDES:
            left = target.with_random(slice(at.start - first, at.stop - first), amplitude, 1)
            yield number, left.none - target.none - float(np.log(len(AMPLITUDES)))


def _add_unknown(problem: Problem, world: World, logs: _LogPriors, result: Weighed) -> None:
    """Add the unknown alone, along each axis, in one world."""
    columns = problem.whitened.columns
    e = world.elimination(columns[:, 0], kept=columns[:, problem.unknown_span])
    alone = world.log_share + e.none - result.plain.none
    for number, gain in _along_axes(problem, e):
        _add_axis(problem, (), number, alone + gain, logs, result)


def _add_beside(problem: Problem, one: Settled, logs: _LogPriors, result: Weighed) -> None:
    """Add a candidate with the unknown beside it, along each axis, in the world it settled in."""
    effects = one.candidate.effects
    e = one.eliminated(one.world, problem.whitened.columns[:, problem.unknown_span])
    # Of that world alone, as what the unknown gains is: another's scatter may do without it.
    alone = e.none - result.plain.none + logs.forms(one.candidate)
    alone += one.world.log_share
    for number, gain in _along_axes(problem, e):
        _add_axis(problem, effects, number, alone + gain, logs, result)


def _add_axis(
    problem: Problem,
    effects: Effects,
    number: int,
    evidence: float,
    logs: _LogPriors,
    result: Weighed,
) -> None:
    """Add effects beside a free pattern along an axis, which may be an effect's own."""
    axis = problem.unknown[number].axis
    owned = logs.owned(effects, axis, result)
    if owned is not None:
        result.add(owned, "", logs.of(owned), evidence + np.log(_FREE))
    elif effects:
        result.add(effects, axis, logs.of(effects) + float(logs.beside[number]), evidence)
    else:
        result.add((), axis, float(logs.unknown[number]), evidence)


def _add_subset(
    problem: Problem,
    one: Settled,
    worlds: Sequence[World],
    logs: _LogPriors,
    result: Weighed,
) -> None:
    """Add a single effect beside a gain of some specimens only."""
    if GAIN not in one.candidate.effects:
        for world in worlds:
            _offer_some(problem, result, _of_some(world, logs, one), world, logs)
