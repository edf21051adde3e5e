"""Weigh all hypotheses: nothing, single effects, pairs, and each beside an unknown."""

from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from scipy.special import logsumexp

from planner.gap.evidence.problem import AMPLITUDES, Problem, own_axes
from planner.gap.evidence.search import Search, weigh_subset
from planner.gap.evidence.surrogate import Candidate, Elimination, InnerProducts, climbed
from planner.numerics import FloatArray

__all__ = ["Effects", "Priors", "Refiner", "Weighed", "weigh"]


# ------------------------------------------------------------------------------------------------
# What is believed before any data: how often campaigns hide nothing, one effect, two, or more.


@dataclass(frozen=True, slots=True)
class Priors:
    """Prior probabilities of kinds of hypothesis; each kind's is shared equally by its members.

    Attributes
    ----------
    none, single, pair
        Nothing, one effect, two effects of the library.
    unknown
        A pattern that no effect explains, alone.
    beside
        Of any hypothesis with effects, the share that has an unknown beside it.
    claimed
        Of an unknown, the share along axes that some effect of the library claims.
    coarseness_nats
        Gain at which evidence counts half: no form is exact, and the more strongly an effect
        shows, the smaller an error of its form would pass for a further effect.
        A coarsened posterior, Miller & Dunson, J. Am. Stat. Assoc. 114, 2019, 1113.
    """

    none: float = 0.66
    single: float = 0.054
    pair: float = 0.0017
    unknown: float = 0.2843
    beside: float = 0.05
    claimed: float = 0.2
    coarseness_nats: float = 400.0


# ------------------------------------------------------------------------------------------------
# Weigh one candidate on its own columns, with what its form may depart by.


_ROUNDS = 4
_SETTLED = 0.1
"""Change of the logarithm of a size that no longer matters."""

_LEAST_GROWTH = 1e-4


class Refiner:
    """One candidate's columns: the residual, its nodes, perhaps the unknown's, and all nuisances.

    Its form is right and its size the same for all, or each specimen's own where that is usual, or
    the form departs as `Problem.departures` says: with equal probability. Departures are as large
    as the effect that is found with them, so that no large effect bends into a small gap.
    """

    def __init__(
        self,
        problem: Problem,
        inner: InnerProducts,
        candidate: Candidate,
        weight: FloatArray | None,
        *,
        unknown: bool = False,
    ) -> None:
        self.candidate = candidate
        self._scatter = problem.scatter
        start, total = problem.nodes.start, len(inner.products)
        nodes = [np.arange(start + b.own.start, start + b.own.stop) for b in candidate.branches]
        self._firsts = np.cumsum([0, *map(len, nodes)])[:-1].tolist()
        self._head = 1 + sum(map(len, nodes))
        first = problem.gains.start if unknown else total - inner.nuisances
        columns = np.concatenate([[0], *nodes, np.arange(first, total)]).astype(np.int64)
        self._shift = self._head - problem.gains.start
        self._gains = slice(self._head, problem.gains.stop + self._shift)
        self._inner = replace(inner, products=inner.products[np.ix_(columns, columns)])
        patterns, own, self._branch = problem.departures(candidate)
        weighted = patterns
        if weight is not None:
            weighted = patterns * problem.whitened.on_rows(weight)[:, None]
        self._cross = weighted.T @ problem.whitened.columns[:, columns]
        self._within = weighted.T @ patterns
        self._counts = sorted({0, own, patterns.shape[1]})
        self._growth = [np.ones(len(candidate.branches)) for _ in self._counts]
        self._settled = [self._settle(number) for number in range(len(self._counts))]

    def _settle(self, number: int) -> Elimination:
        """Find the size at which departures are as large as the effect itself."""
        elimination = self._eliminate(number, 1.0)
        if not self._counts[number]:
            return elimination
        for round_ in range(_ROUNDS):
            sizes = self._at_best(elimination, 0.0).sizes
            growth = np.maximum((sizes / self.candidate.sizes) ** 2, _LEAST_GROWTH)
            if round_:
                # Where small departures ask for a large effect and large ones for a small one.
                growth = np.minimum(growth, self._growth[number])
            if np.all(np.abs(np.log(growth / self._growth[number])) < _SETTLED):
                break
            self._growth[number] = growth
            elimination = self._eliminate(number, 1.0)
        return elimination

    def _eliminate(self, number: int, scale: float) -> Elimination:
        count = self._counts[number]
        if not count:
            return self._inner.eliminate(scale)
        size = self._growth[number][self._branch[:count]]
        own = self._within[:count, :count] * np.outer(size, size)
        return self._inner.eliminate(scale, (self._cross[:count] * size[:, None], own))

    def eliminate(self, scale: float) -> list[Elimination]:
        """Integrate over nuisances: with the form as it is, and with each kind of departure."""
        if scale == 1.0:
            return self._settled
        return [self._eliminate(number, scale) for number in range(len(self._counts))]

    def weigh(self, eliminations: list[Elimination], none: float) -> Candidate:
        """Return the candidate at its best, weighed; `none` is ln p of no effect at that scale."""
        return _averaged([self._at_best(e, none) for e in eliminations])

    def likelier(self, none: float) -> Elimination:
        """Return the inner products, at the nominal scatter, under which it weighs more."""
        return max(self._settled, key=lambda e: self._at_best(e, none).log_evidence)

    def _at_best(self, elimination: Elimination, none: float) -> Candidate:
        a = elimination.products
        found = climbed(
            self.candidate, a[0, 1 : self._head], a[1 : self._head, 1 : self._head], self._firsts
        )
        shift = elimination.none - none
        return replace(found, gain=found.gain + shift, log_evidence=found.log_evidence + shift)

    def left(self, elimination: Elimination) -> float:
        """Return the sum of squares that the candidate leaves at its best place.

        Needs the unknown's columns, with which the gains' are.
        """
        nodes = self._at_best(elimination, 0.0).node_weights()
        gains = np.zeros(self._gains.stop - self._gains.start)
        if self.candidate.members is not None:
            gains = self.candidate.log_gain * self.candidate.members
        vector = np.concatenate([[1.0], *[-n for n in nodes], -gains])
        kept = elimination.products[: len(vector), : len(vector)]
        return float(vector @ kept @ vector)

    def subset(self, scale: float, none: float) -> Candidate:
        """Return the candidate with some specimens' force off by a factor beside it.

        Needs the unknown's columns, with which the gains' are.
        """
        found = []
        # Each specimen's own size of the effect would take up its gain: with and without these.
        for elimination in self.eliminate(scale):
            best = self._at_best(elimination, none)
            gains = elimination.products[self._gains]
            left = gains[:, 0] - gains[:, 1 : self._head] @ np.concatenate(best.node_weights())
            found.append(weigh_subset(left, gains[:, self._gains], best, self._scatter))
        return _averaged(found)

    def beside(
        self, eliminations: list[Elimination], axis: slice, amplitude: float
    ) -> list[Elimination]:
        """Add an unknown along one axis, given by its columns in the problem."""
        at = slice(axis.start + self._shift, axis.stop + self._shift)
        return [e.with_random(at, amplitude, self._head) for e in eliminations]


def _averaged(found: list[Candidate]) -> Candidate:
    """Return the likeliest of equally probable candidates, with the evidence of them all."""
    total = float(np.logaddexp.reduce([c.log_evidence for c in found]) - np.log(len(found)))
    return replace(max(found, key=lambda c: c.log_evidence), log_evidence=total)


# ------------------------------------------------------------------------------------------------
# Weigh all hypotheses: nothing, single effects, pairs, and each beside an unknown.
#
# Marginal likelihoods by Laplace's method over the parameters of each form, forms averaged within
# their effect; over the scale of the scatter by quadrature; over calibration and batches in closed
# form. Odds are relative to no effect at the nominal scatter.


Effects = tuple[str, ...]
_Hypothesis = tuple[Effects, str]
_Key = TypeVar("_Key", bound=Hashable)

_FORMS = 3
"""Forms of a single effect that are weighed in full."""

_QUICK = 6
"""Hypotheses of one effect, and of two, that a quick weighing looks at in full."""

_WORTH_NATS = 15.0
"""Hypotheses this far below the best are not weighed at other scales of scatter."""

_WITH_UNKNOWN = 8
"""Hypotheses that are weighed with an unknown beside them."""

_OF_SOME = 0.25
"""Prior share, of an effect that may hold for some specimens only, that it does."""

_UNEVEN = 0.3
"""Prior share, of nothing at work, of specimens that scatter along some effect's pattern."""

_MOST_UNEVEN = 15.0
"""Log evidence that such scatter gains at most: above it, it would be an effect of a kind."""

_FREE = 0.15
"""Prior share, of an effect with a covariate of its own, of patterns along it that no form has."""


@dataclass(slots=True, eq=False)
class Weighed:
    """Log odds by hypothesis.

    Attributes
    ----------
    log_prior, log_evidence
        By effects and the axis of an unknown beside them ("" without).
    best
        The best form and parameters of each set of effects, at the nominal scatter.
    nominal
        Inner products at the nominal scatter.
    """

    nominal: Elimination
    coarseness_nats: float
    log_prior: dict[_Hypothesis, float] = field(default_factory=dict)
    log_evidence: dict[_Hypothesis, float] = field(default_factory=dict)
    best: dict[Effects, Candidate] = field(default_factory=dict)

    def add(self, effects: Effects, axis: str, log_prior: float, log_evidence: float) -> None:
        """Add to a hypothesis' evidence."""
        _add(self.log_evidence, (effects, axis), log_evidence)
        self.log_prior[effects, axis] = log_prior

    @property
    def log_odds(self) -> dict[_Hypothesis, float]:
        """By hypothesis, priors included, evidence coarsened."""
        none = self.log_evidence[(), ""]
        most = max(max(self.log_evidence.values()) - none, 0.0)
        share = 1.0 / (1.0 + most / self.coarseness_nats)
        return {
            key: self.log_prior[key] + share * (value - none)
            for key, value in self.log_evidence.items()
        }

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
    inner = problem.whitened.inner_products(weight)
    nominal = inner.eliminate()
    result = Weighed(nominal, priors.coarseness_nats)
    logs = _LogPriors(problem, priors)
    candidates = _candidates(Search.on(problem.branches, nominal, problem.nodes), logs)
    if quick:
        candidates = _first(candidates, logs)
    refiners = [Refiner(problem, inner, c, weight) for c in candidates]
    result.offer(Candidate(()))
    spread = float(np.exp(problem.scatter.log_sd * np.sqrt(3.0)))
    scales = ((1.0, 2.0 / 3.0), (1.0 / spread, 1.0 / 6.0), (spread, 1.0 / 6.0))
    chosen: list[tuple[Refiner, float]] = []
    totals: dict[Effects, float] = {}
    at_nominal: dict[Effects, float] = {}
    for scale, share in scales[: 1 if quick else 3]:
        plain = nominal if scale == 1.0 else inner.eliminate(scale)
        offset = plain.none - nominal.none + float(np.log(share))
        ours: dict[Effects, float] = {}
        uneven: dict[Effects, float] = {}
        for refiner in refiners:
            eliminations = refiner.eliminate(scale)
            found = refiner.weigh(eliminations, plain.none)
            if len(found.effects) == 1:
                most = max(0.0, *(e.none - plain.none for e in eliminations))
                uneven[found.effects] = max(uneven.get(found.effects, 0.0), most)
            found = replace(found, log_evidence=found.log_evidence + logs.forms(found))
            _add(ours, found.effects, found.log_evidence)
            if scale == 1.0:
                result.offer(found)
        if logs.some:
            gains = plain.products[problem.gains]
            subset = weigh_subset(
                gains[:, 0], gains[:, problem.gains], Candidate(()), problem.scatter
            )
            if scale == 1.0:
                result.offer(subset)
            _add(ours, subset.effects, subset.log_evidence + np.log(_OF_SOME))
        result.add((), "", logs.none, offset + _nothing(uneven))
        for effects, value in ours.items():
            result.add(effects, "", logs.of(effects), offset + value)
            _add(totals, effects, offset + value)
        if scale == 1.0:
            refiners = _worth(refiners, result, logs)
        if quick or not problem.unknown:
            continue
        if scale == 1.0:
            chosen = _best(problem, inner, weight, result, ours, logs)
            at_nominal = dict(totals)
        _add_unknown(problem, plain, offset, logs, result)
        for refiner, _ in chosen:
            if logs.some and len(refiner.candidate.effects) == 1:
                _add_subset(refiner, scale, plain.none, offset, logs, result)
    for refiner, others in chosen:
        # What an unknown adds is weighed at the nominal scatter alone: it hardly differs at others.
        effects = refiner.candidate.effects
        offset = float(np.log(scales[0][1])) + others + totals[effects] - at_nominal[effects]
        _add_beside(problem, refiner, nominal.none, offset, logs, result)
    return result


def _add(logs: dict[_Key, float], key: _Key, value: float) -> None:
    """Add to a sum that is kept as a logarithm."""
    logs[key] = float(np.logaddexp(logs.get(key, -np.inf), value))


def _nothing(uneven: dict[Effects, float]) -> float:
    """Return the log evidence of nothing at work over that at the plain scatter.

    A form with departures, but of size 0, is no effect: it is scatter along a pattern, such as of
    one grade's specimens at small strains. What it gains must not speak for the effect.
    """
    if not uneven:
        return 0.0
    gains = [min(gain, _MOST_UNEVEN) for gain in uneven.values()]
    of_one = logsumexp(gains) - np.log(len(gains))
    return float(np.logaddexp(np.log1p(-_UNEVEN), np.log(_UNEVEN) + of_one))


class _LogPriors:
    """Prior log odds of hypotheses of each kind."""

    def __init__(self, problem: Problem, priors: Priors) -> None:
        effects = {b.effect.id: b.effect for b in problem.branches}
        n = max(len(effects), 1)
        self.some = any(e.some for e in effects.values())
        self.none = float(np.log(priors.none))
        self.single = float(np.log(priors.single * (1.0 - priors.beside) / n))
        self.pair = float(np.log(priors.pair * (1.0 - priors.beside) / max(n * (n - 1) / 2, 1)))
        self.unknown = _of_axes(problem, priors.unknown, priors.claimed)
        self.beside = _of_axes(problem, priors.beside / (1.0 - priors.beside), priors.claimed)
        self.branch = np.log([b.weight for b in problem.branches])
        self.owner = own_axes(list(effects.values()))

    def of(self, effects: Effects) -> float:
        """Return the log prior of effects without an unknown."""
        return (self.none, self.single, self.pair)[len(effects)]

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
    """Return log priors of an unknown along each axis."""
    claimed = np.array([axis.claimed for axis in problem.unknown], dtype=bool)
    counts = np.where(claimed, claimed.sum(), (~claimed).sum())
    kinds = np.where(claimed, of_claimed, 1.0 - of_claimed)
    if claimed.all() or not claimed.any():
        kinds = np.ones(len(claimed))
    with np.errstate(divide="ignore"):
        shares: FloatArray = np.log(share * kinds / np.maximum(counts, 1))
    return shares


def _candidates(search: Search, logs: _LogPriors) -> list[Candidate]:
    """Return the best forms of every effect, and the pairs that passed the scan."""
    singles = search.singles()
    of: dict[Effects, list[Candidate]] = {}
    for single in singles:
        value = single.log_evidence + logs.forms(single)
        of.setdefault(single.effects, []).append(replace(single, log_evidence=value))
    ranked = (sorted(forms, key=lambda c: -c.log_evidence)[:_FORMS] for forms in of.values())
    return [*(c for forms in ranked for c in forms), *search.pairs(singles)]


def _first(candidates: list[Candidate], logs: _LogPriors) -> list[Candidate]:
    """Return the best candidate of each of the best hypotheses of one effect and of two."""
    best: dict[Effects, Candidate] = {}
    for c in sorted(candidates, key=lambda c: -(c.log_evidence + logs.of(c.effects))):
        best.setdefault(c.effects, c)
    sizes = ([c for c in best.values() if len(c.effects) == size] for size in (1, 2))
    return [c for of_size in sizes for c in of_size[:_QUICK]]


def _worth(refiners: list[Refiner], result: Weighed, logs: _LogPriors) -> list[Refiner]:
    """Return those of hypotheses that another scatter could still make the best."""
    odds = {e: c.log_evidence + logs.of(e) for e, c in result.best.items()}
    least = max(odds.values()) - _WORTH_NATS
    return [r for r in refiners if odds[r.candidate.effects] > least]


def _best(
    problem: Problem,
    inner: InnerProducts,
    weight: FloatArray | None,
    result: Weighed,
    ours: dict[Effects, float],
    logs: _LogPriors,
) -> list[tuple[Refiner, float]]:
    """Return the best hypotheses' best forms, and what their other forms add, in nats."""
    ranked = sorted(ours, key=lambda e: -(ours[e] + logs.of(e)))[:_WITH_UNKNOWN]
    chosen = []
    for effects in ranked:
        best = result.best[effects]
        if best.branches:
            others = max(ours[effects] - best.log_evidence, 0.0)
            chosen.append((Refiner(problem, inner, best, weight, unknown=True), others))
    return chosen


def _add_unknown(
    problem: Problem, plain: Elimination, offset: float, logs: _LogPriors, result: Weighed
) -> None:
    """Add the unknown alone, along each axis."""
    for number in range(len(problem.unknown)):
        for amplitude in AMPLITUDES:
            left = plain.with_random(problem.unknown_columns(number), amplitude, 1)
            evidence = offset + left.none - plain.none - np.log(len(AMPLITUDES))
            _add_axis(problem, (), number, evidence, logs, result)


def _add_beside(
    problem: Problem,
    refiner: Refiner,
    none: float,
    offset: float,
    logs: _LogPriors,
    result: Weighed,
) -> None:
    """Add a candidate with the unknown beside it, along each axis, at the nominal scatter."""
    context = refiner.eliminate(1.0)
    forms = logs.forms(refiner.candidate) - np.log(len(AMPLITUDES))
    for number in range(len(problem.unknown)):
        for amplitude in AMPLITUDES:
            left = refiner.beside(context, problem.unknown_columns(number), amplitude)
            evidence = offset + forms + refiner.weigh(left, none).log_evidence
            _add_axis(problem, refiner.candidate.effects, number, evidence, logs, result)


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
    refiner: Refiner, scale: float, none: float, offset: float, logs: _LogPriors, result: Weighed
) -> None:
    """Add a single effect beside a gain of some specimens only."""
    if refiner.candidate.effects == ("force-scale",):
        return
    both = refiner.subset(scale, none)
    both = replace(both, log_evidence=both.log_evidence + logs.forms(refiner.candidate))
    if scale == 1.0:
        result.offer(both)
    evidence = offset + both.log_evidence + np.log(_OF_SOME)
    result.add(both.effects, "", logs.of(both.effects), evidence)
