"""Weigh all hypotheses, and go from evidence to probabilities: the verdict, and its class."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, permutations, product
from math import comb

import numpy as np
import scipy.linalg
from scipy.special import chdtri, expit, logit, logsumexp, stdtrit

from planner.gap.campaign import TOLERANCES, axis_columns
from planner.gap.diagnosis import Detectable, Effects, FoundEffect, Hypothesis
from planner.gap.evidence.posterior_mode import Likelihood, PosteriorMode, posterior_mode
from planner.gap.evidence.problem import EVERY_AXIS, Candidate, Problem, joined, node_weights
from planner.gap.noise import FIT_SD, UNIT_GAINS
from planner.numerics import BoolArray, FloatArray, kernel

__all__ = [
    "ALIKE_COSINE",
    "ENOUGH_SPECIMENS",
    "UNKNOWN",
    "Priors",
    "Weighed",
    "axes_of",
    "class_of",
    "detectable_sizes",
    "evidence_of",
    "found_effects",
    "needed_nats",
    "ranking_of",
    "reweigh",
    "verdict_of",
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
    imitated, imitation_nats
        Of whatever the data name, the share of causes out of the library that look the same, and
        what an effect gains where half of what a pattern beside it gains speaks for such a cause.
    imitated_by_three
        Odds that such a cause looks like three effects, over those that it looks like fewer.
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
    imitated: float = 0.058
    imitation_nats: float = 50.0
    imitated_by_three: float = 4.0
    temperature: float = 0.2
    coarseness_nats: float = 5.0

    def counted(self, gain: float) -> float:
        """Return the share of log evidence that counts where the best hypothesis gains so much."""
        rest = self.coarseness_nats / (self.coarseness_nats + max(gain, 0.0))
        return self.temperature + (1.0 - self.temperature) * rest


# ------------------------------------------------------------------------------------------------
# Some specimens, but not the others, have their force off by one factor.


_GAIN = "force-scale"
"""The effect that may hold for some specimens only."""

_GAINS = np.geomspace(0.05, 0.6, 24)
_LARGE_GAINS = np.arange(0.66, UNIT_GAINS.max(), 0.06)
_LARGE_GAINS = _LARGE_GAINS[np.abs(_LARGE_GAINS[:, None] - UNIT_GAINS).min(axis=1) > 0.1]
"""Logarithms of a gain of some specimens that a load cell may have, and of larger ones that a
column tells, none of them a unit's. Numerical: each 11 %, or .06, larger than the one before, which
a few specimens of usual scatter do not resolve."""

_DISTINCT = 2.5
"""Deviations of the specimens' scatter by which a gain must exceed it. Chosen: by chance one
specimen in 80 lies so far off, less than one of a campaign."""

_SHARES: FloatArray = np.array([0.07, 0.15, 0.3, 0.5])
"""Of specimens that are members. Numerical: in steps of two, from two of thirty to half; of more
the others are members of the inverse gain."""


_LEVELS = (0.7, 0.5, 0.35, 0.25)
"""Scatter of the level beside a gain of some specimens, over the one that was estimated: that holds
the gain too. Numerical: in steps that some twenty replicates do not resolve, down to what a gain of
half of them four times their scatter leaves."""

_ROUNDS = 30
_SETTLED = 1e-4
"""Rounds of beliefs, and the change of one at which they end. Numerical: the bound is flat there,
and off by much less."""


@kernel
def _best_subset(
    b: FloatArray, h: FloatArray, likeliest: FloatArray, gammas: FloatArray, prior: FloatArray,
    shares: FloatArray, belief: FloatArray, best_belief: FloatArray, evidence: FloatArray,
) -> int:  # fmt: skip
    """Fill the log odds of each gain and share; return the best gain, its beliefs filled.

    With members z, each of them one with probability `share`, the log likelihood over that of none
    is g z'b - g^2 z'Hz / 2. Its sum over all z is bounded from below by independent beliefs q in
    each specimen (mean field), improved one by one:

        sum q g b - g^2/2 (q'Hq + sum q (1 - q) H_ii) + entropy of q + q ln s + (1 - q) ln(1 - s)

    Parameters
    ----------
    b : (n,), h : (n, n)
        Inner products of the specimens' own gains with the residual and one another.
    likeliest : (n,)
        Logarithms of every specimen's own gain, all free, from which members are told at first.
    prior : (gammas,)
        Its logarithm.
    shares : (m,)
        Shares of members, equally probable.
    belief, best_belief : (n,)
        Workspace, and the beliefs at the best gain.
    evidence : (gammas, m)
    """
    n = len(b)
    best, best_value = 0, -np.inf
    pull = np.empty(n)
    for k in range(len(gammas)):
        gamma = gammas[k]
        square = gamma * gamma
        for s in range(len(shares)):
            odds = np.log(shares[s] / (1.0 - shares[s]))
            pull[:] = 0.0
            for i in range(n):
                belief[i] = 1.0 if gamma * likeliest[i] > 0.5 * square else 0.0
                if belief[i] > 0.0:
                    for j in range(n):
                        pull[j] += h[i, j]
            for _ in range(_ROUNDS):
                moved = 0.0
                for i in range(n):
                    others = pull[i] - h[i, i] * belief[i]
                    logit = gamma * b[i] - square * (others + 0.5 * h[i, i]) + odds
                    new = 1.0 / (1.0 + np.exp(-min(max(logit, -700.0), 700.0)))
                    change = new - belief[i]
                    if change != 0.0:
                        belief[i] = new
                        for j in range(n):
                            pull[j] += change * h[i, j]
                        moved = max(moved, abs(change))
                if moved < _SETTLED:
                    break
            value = prior[k]
            for i in range(n):
                q = belief[i]
                value += q * gamma * b[i]
                value -= 0.5 * square * (q * pull[i] + q * (1.0 - q) * h[i, i])
                if q > 0.0:
                    value += q * (np.log(shares[s]) - np.log(q))
                if q < 1.0:
                    value += (1.0 - q) * (np.log(1.0 - shares[s]) - np.log(1.0 - q))
            evidence[k, s] = value
            if value > best_value and np.sum(belief > 0.5) > 0:
                best, best_value = k, value
                for i in range(n):
                    best_belief[i] = belief[i]
    return best


def _weigh_subset(
    products: FloatArray, beside: Candidate, scatter: float, large: bool = False, least: int = 2
) -> Candidate:
    """Return the best subset beside a candidate, with the log evidence of there being one.

    Parameters
    ----------
    products : (1 + n, 1 + n)
        Inner products of what the candidate leaves of the residual, then of the specimens' own
        gains.
    scatter
        Deviation of the specimens' levels.
    large
        Whether it is one that neither a load cell nor a unit has.
    least
        Members: one specimen alone is an outlier of the data, unless others were in that unit too.
    """
    n = len(products) - 1
    b, h = np.ascontiguousarray(products[1:, 0]), np.ascontiguousarray(products[1:, 1:])
    some = _LARGE_GAINS if large else _GAINS[_DISTINCT * scatter <= _GAINS]
    units = UNIT_GAINS[:0] if large else UNIT_GAINS
    gammas = np.concatenate([some, -some, units, -units])
    # Half for any gain, half for units.
    counts = np.array([2 * len(some), 2 * len(units)])
    prior = np.log(np.repeat(0.5 / np.maximum(counts, 1), counts))
    belief, best = np.zeros(n), np.zeros(n)
    evidence = np.empty((len(gammas), len(_SHARES)))
    likeliest = scipy.linalg.lstsq(h, b, cond=1e-9, lapack_driver="gelsy", check_finite=False)[0]
    at = int(_best_subset(b, h, likeliest, gammas, prior, _SHARES, belief, best, evidence))
    total = float(logsumexp(evidence) - np.log(len(_SHARES)))
    gamma, members = float(gammas[at]), (best > 0.5).astype(np.float64)
    if members.any() and at < counts[0]:  # no unit's: the grid's nearest, now itself
        gamma = float(members @ b / (members @ h @ members))
    gain = float(gamma * members @ b - 0.5 * gamma**2 * members @ h @ members)
    if not least <= members.sum() < n - 1:
        total = -np.inf
    return replace(
        beside,
        effects=tuple(sorted({*beside.effects, _GAIN})),
        gain=beside.gain + gain,
        log_evidence=beside.log_evidence + total,
        members=members,
        log_gain=gamma,
    )


# ------------------------------------------------------------------------------------------------
# Weigh all hypotheses: nothing, single effects, pairs, and each beside an unknown.
#
# Marginal likelihoods by Laplace's method over the parameters of each form, forms averaged within
# their effect; over the scale of the scatter by quadrature; over calibration and batches in closed
# form. Odds are relative to no effect at the nominal scatter.


HypothesisKey = tuple[Effects, str]
"""Effects, and the axis of an unknown beside them, "" without."""

_PARTNERS = 6
"""Effects whose mode is found beside others. Numerical: the best ones by the surrogate."""

_SURROGATE_NATS = 3.0
"""Below its effect's best form by the surrogate, to which a form's mode is found. Numerical: in
97 % of effects a form so far below is not the best at its mode."""

_LOST_NATS = 20.0
"""Below the best of all, from which one form of an effect will do by the surrogate, and what folds
do not weigh. Numerical: such an effect has none of the probability, with evidence counted in part
too."""

_BESIDE = 3
"""Effects, the best ones at their modes, beside which every other one is looked for anew.
Numerical: what is below the third has little of the evidence."""

_MOST_EFFECTS = 3
"""At work together. Chosen: a fourth beside three that are found would be told by a campaign that
was made for it, and by no other."""

_OF_SOME = 0.25
"""Prior share, of an effect that may hold for some specimens only, that it does. Chosen: faults of
a machine mostly hold for all that it tested."""

EVERY_TEST = "every test"
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
    logs
        Prior log odds.
    likelihoods
        Of the scatter as estimated: of models that are exact, of poor laws, of discrepancies.
    none
        No effect at all, under the likelihood in which that is likeliest.
    log_prior, log_evidence
        By effects and the axis of an unknown beside them ("" without).
    best
        The best form and parameters of each set of effects.
    modes
        Every candidate that was weighed on the forward model.
    beside_some
        Single effects, at their modes where a gain of some specimens is beside them.
    likeliest
        That under which the likeliest of these has its mode, if any does.
    """

    logs: "_LogPriors"
    likelihoods: tuple[Likelihood, ...]
    none: PosteriorMode
    log_prior: dict[HypothesisKey, float] = field(default_factory=dict)
    log_evidence: dict[HypothesisKey, float] = field(default_factory=dict)
    best: dict[Effects, Candidate] = field(default_factory=lambda: {(): Candidate(())})
    modes: list[PosteriorMode] = field(default_factory=list)
    beside_some: list[PosteriorMode] = field(default_factory=list)
    likeliest: Likelihood | None = None

    @property
    def plain(self) -> Likelihood:
        """That of the scatter as estimated and of models that are exact."""
        return self.likelihoods[0]

    def relative(self, found: Candidate, likelihood: Likelihood) -> float:
        """Return a candidate's evidence under a likelihood, over none in the plain one."""
        return found.log_evidence + likelihood.none - self.plain.none + likelihood.log_share

    def add(self, effects: Effects, axis: str, log_prior: float, log_evidence: float) -> None:
        """Add to a hypothesis' evidence, of which logarithms are kept."""
        before = self.log_evidence.get((effects, axis), -np.inf)
        self.log_evidence[effects, axis] = float(np.logaddexp(before, log_evidence))
        self.log_prior[effects, axis] = log_prior

    def add_candidate(self, found: Candidate, likelihood: Likelihood) -> None:
        """Add a candidate without an unknown, weighed under a likelihood; the best one stays."""
        evidence = self.relative(found, likelihood)
        self.add(found.effects, "", self.logs.of(found.effects), evidence)
        known = self.best.get(found.effects)
        if known is None or evidence > known.log_evidence:
            self.best[found.effects] = replace(found, log_evidence=evidence)

    def mode_of(self, candidate: Candidate) -> PosteriorMode:
        """Return the mode of the same forms, but for a gain of some specimens."""
        if not candidate.parts:
            return self.none
        some = self.beside_some if candidate.members is not None else ()
        beside = next((s for s in some if s.candidate.parts == candidate.parts), None)
        return beside or next(s for s in self.modes if s.candidate.forms == candidate.forms)

    def errors(self, effects: Effects, *, own: bool = True) -> tuple[FloatArray, FloatArray]:
        """Return specimens' errors without effects, and with them at their mode, (n, 2) each.

        Of forces and of strains. Of `own` sizes of specimens, or the effect's for all, whichever
        leaves less.
        """
        mode, found = self.mode_of(self.best[effects]), [self.best[effects]]
        if own and len(mode.own):
            found.append(mode.with_own_sizes(found[0]))
        error = mode.likelihood.error
        return error(Candidate(())), min((error(each) for each in found), key=np.sum)


def _likelihoods(problem: Problem) -> tuple[tuple[Likelihood, ...], tuple[Likelihood, ...]]:
    """Return the likelihoods that hypotheses are weighed under, the plain one first, and more.

    Models are exact, the scatter a little off; or laws are as poor as fits may be; or all models
    have a discrepancy. In those that are more, levels scatter less: for a gain of some specimens.

    How far levels scatter and how far the rest does is unsure each by itself: few replicates may
    agree by chance, and would make an effect of what others differ by, and the many features of a
    curve's course say nothing of its level.
    """
    spread = float(np.exp(problem.scatter.log_sd * np.sqrt(3.0)))
    nodes = ((1.0, 2.0 / 3.0), (1.0 / spread, 1.0 / 6.0), (spread, 1.0 / 6.0))
    least, *poorer = (error / FIT_SD for error in _law_errors(problem))
    exact = _DISCREPANCIES[0.0] / (1 + len(poorer))
    sizes = [
        *(
            (rest, level / rest, 0.0, least, a * b * exact)
            for (rest, a), (level, b) in product(nodes, nodes)
        ),
        *((1.0, 1.0, 0.0, laws, exact) for laws in poorer),
        *((1.0, 1.0, size, least, share) for size, share in _DISCREPANCIES.items() if size),
    ]
    less = [(1.0, level, 0.0, least, 4.0 / 9.0 * exact / len(_LEVELS)) for level in _LEVELS]
    usual, narrow = (
        tuple(
            Likelihood(problem, scale=scale, level=level, discrepancy=size, laws=laws, share=share)
            for scale, level, size, laws, share in each
        )
        for each in (sizes, less)
    )
    return usual, narrow


def weigh(problem: Problem, priors: Priors) -> Weighed:
    """Weigh all hypotheses on a campaign."""
    logs = _LogPriors(problem, priors)
    likelihoods, narrow = _likelihoods(problem)
    of_scatter = tuple(w for w in likelihoods if w.scale == w.level == 1.0)
    none = PosteriorMode.of_nothing(max(of_scatter, key=lambda w: w.none + w.log_share))
    result = Weighed(logs, of_scatter, none)
    for likelihood in likelihoods:
        evidence = result.relative(none.candidate, likelihood)
        # What the palette's own fit leaves of its tests is no gap.
        exact = likelihood.discrepancy <= _law_errors(problem)[0]
        axis, log_prior = ("", logs.of(())) if exact else (EVERY_TEST, logs.any)
        result.add((), axis, log_prior, evidence)
    beside_gain = (*likelihoods, *narrow) if logs.some else ()
    result.modes = _modes(result.likelihoods, logs)
    for one, likelihood in product(result.modes, likelihoods):
        found = one.weighed(likelihood, one.eliminated(likelihood))
        found = replace(found, log_evidence=found.log_evidence + logs.forms(found))
        result.add_candidate(found, likelihood)
    _add_subset(none, beside_gain, result)
    result.beside_some = _modes_beside_some(result, beside_gain)
    for one in result.beside_some:
        _add_subset(one, beside_gain, result)
    if leading := result.beside_some[:1] or result.modes:
        result.likeliest = max(leading, key=lambda m: m.eliminated(m.likelihood).none).likelihood
    for likelihood in of_scatter:
        _add_axes(none, likelihood, result)
    for one in _chosen(result):
        # Of that alone in which it is likeliest: another's scatter may do without the unknown.
        _add_axes(one, max(likelihoods, key=lambda w: one.eliminated(w).none + w.log_share), result)
        # Where it lies beside a gain is not where it lies alone.
        known = any(some.candidate.effects == one.candidate.effects for some in result.beside_some)
        if len(one.candidate.effects) < _MOST_EFFECTS and not known:
            _add_subset(one, beside_gain, result)
    return result


def _add_subset(one: PosteriorMode, likelihoods: Sequence[Likelihood], result: Weighed) -> None:
    """Add a candidate with a gain of some specimens beside it, weighed under each likelihood.

    Where a column tells these from the others, what is in it is likelier to be at work than a load
    cell or a slip of the pen that chose them, unless the gain is a unit's. No load cell is off by a
    large one.
    """
    if _GAIN in one.candidate.effects:
        return
    for likelihood, large in product(likelihoods, (False, True)):
        found = _of_some(likelihood, result.logs, one, large)
        assert found.members is not None
        if found.log_evidence == -np.inf:
            continue
        axis = None if _of_unit(found) else _telling_column(likelihood.problem, found.members > 0.5)
        if axis is not None:
            _add_axis(one.candidate.effects, axis, result.relative(found, likelihood), result)
        elif not large:
            result.add_candidate(found, likelihood)


def _of_unit(candidate: Candidate) -> bool:
    """Return whether the gain of some specimens is one that a unit makes."""
    return bool(np.min(np.abs(np.abs(candidate.log_gain) - UNIT_GAINS)) < 1e-9)


def _telling_column(problem: Problem, members: BoolArray) -> int | None:
    """Return the axis of the unknown whose column has no value both in and out of some specimens.

    None if the column is one that tells specimens one by one, or one along which gains may go.
    """
    own, columns = problem.effects[_GAIN].where, axis_columns(problem.campaign)
    for number, name in enumerate(axis.axis for axis in problem.unknown):
        cells = columns.get(name, ())
        distinct = len(set(cells))
        shared = name in own or not 0 < distinct <= len(cells) // 2
        if not shared and len(set(zip(cells, members.tolist(), strict=True))) == distinct:
            return number
    return None


def _of_some(
    likelihood: Likelihood, logs: "_LogPriors", one: PosteriorMode, large: bool = False,
    least: int = 2,
) -> Candidate:  # fmt: skip
    """Return a gain of some specimens beside a candidate at its mode, priors of forms included.

    Its evidence is that over no effect under the likelihood.
    """
    problem = likelihood.problem
    e = one.eliminated(likelihood, problem.gains)
    scatter = problem.scatter.specimen * likelihood.scale * likelihood.level
    found = _weigh_subset(e.products, one.weighed(likelihood, e), scatter, large, least)
    return replace(found, log_evidence=found.log_evidence + logs.forms(found) + np.log(_OF_SOME))


def reweigh(
    weighed: Weighed, vain: Mapping[Effects, float], weight: FloatArray
) -> tuple[Likelihood, list[tuple[float, Candidate]]]:
    """Weigh candidates at their modes, vain ones too, on specimens weighted by `weight` (n,).

    By the model linear about their modes on all specimens, where they stay. Evidence counts
    in full: a part of it (`Priors.counted`) says how far a name can be trusted, but predicts with
    forms that the specimens speak against.

    Returns
    -------
    likelihood
        Of these weights, with the discrepancy that is likeliest on all specimens, and the palette's
        laws taken for exact: by these is predicted, and effects that were fitted beside laws that
        are off would miss what these make up for.
    odds
        Log odds and candidate each.
    """
    logs = weighed.logs
    like = weighed.likeliest or weighed.plain
    likelihood_of = partial(
        Likelihood, like.problem, level=like.level, discrepancy=like.discrepancy, weight=weight
    )
    likelihood = likelihood_of(laws=like.laws)
    alone = [one.weighed(likelihood, one.eliminated(likelihood)) for one in weighed.modes]
    found = [(logs.forms(c), c) for c in alone]
    leading = max(c.log_evidence for c in weighed.best.values()) - _LOST_NATS
    for c in weighed.best.values():
        if c.members is not None and c.log_evidence > leading:
            least = 1 if _of_unit(c) else 2  # of those in another unit, one may be left
            some = _of_some(likelihood, logs, weighed.mode_of(c), least=least)
            found.append((0.0, some))  # its evidence has the prior of forms
    other = like.problem.nuisances.copy()
    other[:, : len(like.problem.calibrations)] = 0.0
    return likelihood_of(nuisances=other), [
        (logs.of(c.effects) + forms - vain.get(c.effects, 0.0) + c.log_evidence, c)
        for forms, c in found
    ]


class _LogPriors:
    """Prior log odds of hypotheses of each kind."""

    def __init__(self, problem: Problem, priors: Priors) -> None:
        self.priors = priors
        self.some = any(e.some for e in problem.effects.values())
        # A third effect is beside two as rare as a second is beside one.
        named = np.array([priors.single, priors.pair, priors.pair**2 / priors.single])
        named *= 1.0 - priors.beside
        named /= [max(comb(len(problem.effects), k), 1) for k in (1, 2, 3)]
        self.by_count = np.log([priors.none, *named]).tolist()
        self.unknown = _of_axes(problem, priors.axes * priors.unknown, priors.claimed)
        self.any = float(np.log((1.0 - priors.axes) * priors.unknown))
        self.beside = _of_axes(problem, priors.beside / (1.0 - priors.beside), priors.claimed)
        self.of_form = np.log([b.weight for b in problem.signed_forms])

    def of(self, effects: Effects) -> float:
        """Return the log prior of effects without an unknown."""
        return float(self.by_count[len(effects)])

    def forms(self, candidate: Candidate) -> float:
        """Return the log prior of a candidate's forms among those of its effects."""
        return float(sum(self.of_form[number] for number in candidate.forms))


def _of_axes(problem: Problem, share: float, of_claimed: float) -> FloatArray:
    """Return log priors of an unknown along each axis.

    Where no column is unclaimed, what would lie along such a one is out of the question.
    """
    claimed = np.array([axis.claimed for axis in problem.unknown], dtype=bool)
    counts = np.where(claimed, claimed.sum(), (~claimed).sum())
    kinds = np.where(claimed, of_claimed, 1.0 - of_claimed)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(share * kinds / np.maximum(counts, 1)))


def _most_effects(problem: Problem) -> int:
    """Return how many effects may be at work together: fewer than there are tests, but one.

    A gain of some specimens, which shows between replicates, comes on top.
    """
    return min(_MOST_EFFECTS, max(len(problem.model.tests) - 1, 1))


def _modes(likelihoods: Sequence[Likelihood], logs: _LogPriors) -> list[PosteriorMode]:
    """Return modes: the best forms of every effect, and of several effects."""

    def odds(one: PosteriorMode) -> float:
        c = one.candidate
        return one.eliminated(one.likelihood).none + logs.forms(c) + logs.of(c.effects)

    # Surrogates are compared where models may be off by as much as surrogates are.
    likelihood = max(likelihoods, key=lambda w: w.none)
    ranked = PosteriorMode.of_nothing(likelihood).beside
    most = {c.effects: c.log_evidence for c in reversed(ranked)}
    lost = max(most.values(), default=0.0) - _LOST_NATS
    least = {e: max(v - _SURROGATE_NATS, min(v, lost)) for e, v in most.items()}
    # Forms with details fit more than their surrogate shows.
    near = (c for c in ranked if c.log_evidence >= least[c.effects] or c.parts[0][0].form.details)
    modes = [posterior_mode(likelihoods, c, likelihood) for c in near]
    together = _most_effects(likelihood.problem)
    best, rich = dict[Effects, PosteriorMode](), dict[Effects, PosteriorMode]()
    for one in sorted(modes, key=lambda one: -odds(one)):
        best.setdefault(one.candidate.effects, one)
        if one.candidate.parts[0][0].form.details:
            rich.setdefault(one.candidate.effects, one)
    pairs = {
        c.effects: c
        for one in reversed(list(best.values())[: _BESIDE if together > 1 else 0])
        for c in _partners(one)[:_PARTNERS]
    }
    both = [posterior_mode(likelihoods, c, likelihood) for c in pairs.values()]
    leading = sorted(both, key=odds, reverse=True)[:_BESIDE]
    if not leading or odds(leading[0]) < max(map(odds, modes)):
        return [*modes, *both]
    # What looks best with some forms is looked at in all, and a third effect beside it; then any
    # two of the best three. Each once, or it would count so many times.
    pairs_in_all = {one.candidate.effects for one in leading}
    thirds: dict[Effects, PosteriorMode] = {}
    known = {one.candidate.forms for one in both}
    for _ in range(2):
        for effects in sorted(pairs_in_all):
            for c in _in_all_forms(effects, (best, rich)):
                if c.forms not in known:
                    known.add(c.forms)
                    both.append(posterior_mode(likelihoods, c, likelihood))
        likeliest = max(both, key=odds)
        for c in _partners(likeliest)[:_PARTNERS] if together > 2 else ():
            if c.effects not in thirds:
                thirds[c.effects] = posterior_mode(likelihoods, c, likeliest.likelihood)
        third = max(thirds.values(), key=odds, default=likeliest)
        pairs_in_all = set(combinations(third.candidate.effects, 2))
    return _with_parts_alone([*modes, *both, *thirds.values()], likelihoods, odds)


def _with_parts_alone(
    found: Sequence[PosteriorMode], likelihoods: Sequence[Likelihood],
    odds: Callable[[PosteriorMode], float],
) -> list[PosteriorMode]:  # fmt: skip
    """Return the modes, and the likeliest of several effects with one of these left out.

    Alone an effect may have its mode far from where it is best, which it finds beside another: then
    that other one would count for what this one does.
    """
    best = {one.candidate.forms: one for one in found}
    several = sorted((one for one in found if len(one.candidate.parts) > 1), key=odds)
    leading, tried = several[: -_BESIDE - 1 : -1], set[tuple[int, ...]]()
    for one in leading:
        for fewer in combinations(one.candidate.parts, len(one.candidate.parts) - 1):
            if (c := joined(fewer)).forms in tried:
                continue
            tried.add(c.forms)
            alone = posterior_mode(likelihoods, c, one.likelihood)
            if c.forms not in best or odds(alone) > odds(best[c.forms]):
                best[c.forms] = alone
            if len(fewer) > 1:
                leading.append(alone)
    return list(best.values())


def _in_all_forms(
    effects: Effects, known: Sequence[Mapping[Effects, PosteriorMode]]
) -> Iterator[Candidate]:
    """Yield either effect in each form, where it is best beside the other at its best.

    One alone does not tell what form suits both, nor does one beside a poor form of the other:
    those with details, as of rate and temperature by one clock, are tried together. What fits worse
    there than nothing in its place, as a wrong unit does, is left out: no other effect makes up for
    that, and the search for its mode is a long one.

    Parameters
    ----------
    known
        Effects alone at their best: in any form, and in one with details.
    """
    for (id, other), best in product((effects, effects[::-1]), known):
        for c in best[id,].beside if (id,) in best else ():
            suits = best is known[0] or c.parts[0][0].form.details
            if suits and c.effects == (other,) and c.gain > -_ALIKE_NATS:
                yield joined([*best[id,].candidate.parts, *c.parts])


def _partners(one: PosteriorMode) -> list[Candidate]:
    """Join a candidate at its mode with each other effect in its best form, the best first."""
    own = one.candidate
    best = dict[Effects, Candidate]()
    for c in one.beside:
        if not set(c.effects) & set(own.effects):
            best.setdefault(c.effects, joined([*own.parts, *c.parts]))
    return list(best.values())


def _modes_beside_some(result: Weighed, likelihoods: Sequence[Likelihood]) -> list[PosteriorMode]:
    """Return the modes of other effects beside a gain of some specimens, where that leads alone.

    Without it their modes lie where they make up for it. The likeliest first.
    """
    singles = [candidate for effects, candidate in result.best.items() if len(effects) == 1]
    some = max(singles, key=lambda c: c.log_evidence, default=Candidate(()))
    if some.members is None:
        return []
    # A unit's, where models are exact: one that may be far off takes what is soft for a member.
    if _of_unit(some):
        some = _of_some(result.plain, result.logs, result.none)
    gain = result.plain.problem.gain_of(some)
    left = replace(result.none, candidate=some, target=result.none.target - gain)
    likelihoods = [likelihood for likelihood in likelihoods if likelihood.scale == 1.0]
    left = replace(left, likelihood=max(likelihoods, key=lambda w: left.eliminated(w).none))
    found = dict[Effects, PosteriorMode]()
    leading = [left]
    for _ in range(min(_most_effects(left.likelihood.problem), _MOST_EFFECTS - 1)):
        for one in leading:  # the best ones, as the second may be better beside a third
            beside = [c for c in _partners(one) if _GAIN not in c.effects]
            for c in beside[:_PARTNERS]:
                if c.effects not in found:
                    both = replace(c, members=some.members, log_gain=some.log_gain)
                    found[c.effects] = posterior_mode(likelihoods, both, one.likelihood)
        ranked = sorted(found.values(), key=lambda m: -m.eliminated(m.likelihood).none)
        leading = ranked[:_BESIDE]
    # What the gain does is left for it to make up again, whichever specimens have it.
    return [
        replace(one, target=one.target + gain, candidate=joined(one.candidate.parts))
        for one in ranked
    ]


def _chosen(result: Weighed) -> list[PosteriorMode]:
    """Return the best hypotheses' best forms."""
    odds = {
        e: result.log_evidence[e, ""] + result.logs.of(e)
        for e, c in result.best.items()
        if c.parts and c.members is None
    }
    ranked = sorted(odds, key=lambda e: -odds[e])[:_LOOKED_AT]
    return [result.mode_of(result.best[e]) for e in ranked]


_POOR_FIT = 0.03
"""What a law may leave of its tests where the palette does not say. Physical: laws fitted to other
labs' tests left 1.8 to 7 % of the largest stress."""


def _law_errors(problem: Problem) -> tuple[float, ...]:
    """Return what laws may leave of their own tests, a share of their largest stress.

    The largest that the palette states of the campaign's materials, and what laws usually leave at
    least; that and what they may leave where it does not say.
    """
    names = {calibration.material for calibration in problem.calibrations if calibration.material}
    laws = [m.uncertainty for m in problem.campaign.palette.materials if m.id in names]
    stated = [u.nrmse for u in laws if u is not None and u.nrmse is not None]
    largest = max([FIT_SD, *stated])
    return (largest,) if len(stated) == len(laws) else (largest, max(largest, _POOR_FIT))


_AMPLITUDES = (0.03, 0.1, 0.3, 0.9)
"""Standard deviations of an unknown pattern, of the logarithm of force. Numerical: in steps of
three, from the scatter of specimens to a factor of more than two."""


def _add_axes(one: PosteriorMode, likelihood: Likelihood, result: Weighed) -> None:
    """Add a candidate with the unknown beside it, along each axis, under a likelihood."""
    problem = likelihood.problem
    e = one.eliminated(likelihood, problem.patterns)
    forms = result.logs.forms(one.candidate) - float(np.log(len(_AMPLITUDES)))
    none, stop = forms - result.plain.none + likelihood.log_share, 1
    for number, axis in enumerate(problem.unknown):
        own = slice(stop, stop := stop + axis.columns.shape[1])
        for amplitude in _AMPLITUDES:
            _add_axis(one.candidate.effects, number, e.with_random(own, amplitude) + none, result)


def _add_axis(effects: Effects, number: int, evidence: float, result: Weighed) -> None:
    """Add effects beside a free pattern along an axis, which may be an effect's own."""
    problem, logs = result.plain.problem, result.logs
    axis, owner = problem.unknown[number].axis, problem.own_axes
    owned = tuple(sorted({*effects, owner[axis]})) if axis in owner else ()
    if owned and owned in result.best:  # weighed: no more effects than may be at work together
        result.add(owned, "", logs.of(owned), evidence + np.log(_FREE))
    elif effects:
        result.add(effects, axis, logs.of(effects) + float(logs.beside[number]), evidence)
    else:
        result.add((), axis, float(logs.unknown[number]), evidence)


# ------------------------------------------------------------------------------------------------
# From odds to probabilities, a verdict, and what the data cannot tell from it.


UNKNOWN: Effects = ("unknown",)

ALIKE_COSINE = 0.95
"""Of patterns, above which one that fits as well is of the other's class. Chosen: a tenth of one's
square is not the other's, which few campaigns show."""

_ALIKE_NATS = 3.0
"""Below the verdict, within which the data do not tell from it. Convention: odds of twenty to one,
as a level of 5 %."""


def posterior(log_odds: Mapping[HypothesisKey, float]) -> tuple[dict[Effects, float], ...]:
    """Return probabilities, and of these with effects the share that has an unknown beside it.

    Effects beside an unknown along an axis go by whichever of both is likelier alone: what an axis
    explains, and effects mend, is no evidence for the effects.
    """
    together = dict[Effects, float]()
    beside = dict[Effects, float]()
    total = float(logsumexp(list(log_odds.values())))
    for (effects, axis), value in log_odds.items():
        alone = log_odds.get((effects, ""), -np.inf)
        named = bool(effects) and alone >= log_odds.get(((), axis), -np.inf)
        key = UNKNOWN if axis and not named else effects
        share = float(np.exp(value - total))
        together[key] = together.get(key, 0.0) + share
        if named and axis:
            beside[key] = beside.get(key, 0.0) + share
    return together, {e: share / max(together[e], 1e-300) for e, share in beside.items()}


def class_of(
    problem: Problem, weighed: Weighed, evidence: "Evidence", ranking: Sequence[Hypothesis],
    verdict: Effects,
) -> tuple[Effects, ...]:  # fmt: skip
    """Return the hypotheses that the data cannot tell from the verdict, itself first.

    Those less than `_ALIKE_NATS` below it, single effects whose pattern is the verdict's, and of
    several effects those beside which another closes nothing of the gap. An unknown cause that
    looks like effects is not told from them.
    """
    share = {h.effects: h.probability for h in ranking}
    named = [effects for effects in share if effects not in ((), UNKNOWN)]
    priors = weighed.logs.priors
    if verdict != UNKNOWN:
        # That a cause out of the library may look the same holds of whatever is named.
        odds_imitated = priors.imitated / (1.0 - priors.imitated)
        share[UNKNOWN] = share.get(UNKNOWN, 0.0) - odds_imitated * sum(share[e] for e in named)
    elif not evidence.within_floor:
        for effects in named:
            share[effects] /= 1.0 - _imitated(effects, evidence, priors)
    odds = {effects: float(np.log(max(p, 1e-300))) for effects, p in share.items()}
    leading = odds.get(verdict, max(odds.values()))
    alike = _fits_of_same_pattern(problem, weighed, list(odds))
    near = {e for e, value in odds.items() if value > leading - _ALIKE_NATS}
    near |= {e for (one, e), fit in alike.items() if one == verdict and fit > -2.0 * _ALIKE_NATS}
    found = [verdict, *(h.effects for h in ranking if h.effects in near - {verdict})]
    # The more strongly an effect shows, the more its form's own error asks for a second one, in
    # evidence: what is small in force may count for much there.
    for both in [effects for effects in found if len(effects) > 1]:
        fewer = (tuple(e for e in both if e != id) for id in both)
        errors = {e: weighed.errors(e)[1].sum(axis=0) for e in (both, *fewer) if e in weighed.best}
        found += [e for e in errors if e not in found and not _falls(errors[e], errors[both])]
    return tuple(found)


def _fits_of_same_pattern(
    problem: Problem, weighed: Weighed, among: Iterable[Effects]
) -> dict[tuple[Effects, Effects], float]:
    """Return how much better the second effect's best form fits than the first's, in nats.

    Of pairs of single effects, of all specimens, whose whitened patterns, nuisances projected out,
    have a larger cosine than this.
    """
    singles = {e: weighed.best[e] for e in among if len(e) == 1 and e in weighed.best}
    best = {e: candidate for e, candidate in singles.items() if candidate.members is None}
    if len(best) < 2:
        return {}
    changes = np.stack([problem.explained(candidate) for candidate in best.values()], axis=1)
    m = weighed.plain.products(problem.noise.whiten(changes))
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
    closes
        Of the best effects of the library, whether errors fall with them.
    without
        Of effects with which errors of force rise, fewer of them with which they do not.
    axes
        That each effect varies along.
    specimens
        How many.
    """

    log_prior: Mapping[HypothesisKey, float]
    log_evidence: Mapping[HypothesisKey, float]
    specimens: int = ENOUGH_SPECIMENS
    within_floor: bool = False
    scatter_like: frozenset[str] = frozenset()
    closes: Mapping[Effects, bool] = field(default_factory=dict)
    without: Mapping[Effects, Effects] = field(default_factory=dict)
    axes: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def vain(self) -> Mapping[Effects, float]:
        """By how many nats effects that close nothing, or less than fewer of them, are less."""
        nothing = {e: _ALIKE_NATS for e, closes in self.closes.items() if not closes}
        return nothing | dict.fromkeys(self.without, np.inf)


def evidence_of(problem: Problem, weighed: Weighed) -> Evidence:
    """Return what a campaign's ranking goes by."""
    within_floor = _within_floor(problem) and not problem.apart.any()
    closes, without = _explained(weighed, within_floor=within_floor)
    # What a sensor does to all specimens of one condition, their scatter does as well.
    sensors = {id for id, effect in problem.effects.items() if effect.stage == "sensor"}
    return Evidence(
        log_prior=weighed.log_prior,
        log_evidence=weighed.log_evidence,
        specimens=len(problem.campaign.specimens),
        within_floor=within_floor,
        scatter_like=frozenset(sensors if len(problem.model.tests) == 1 else ()),
        closes=closes,
        without=without,
        axes={id: effect.where for id, effect in problem.effects.items()},
    )


_BY_CHANCE = 0.05
"""Level of the tests of lack of fit and of whether errors rise. Convention: 5 %."""


def _within_floor(problem: Problem) -> bool:
    """Return whether the palette misses by no more than replicates differ by, but for chance.

    That is the test of lack of fit against pure error. Where nothing but scatter is wrong, the
    squared error of n specimens in G groups of replicates, over the floor's, is 1 + (X - G) / n
    with X of chi squared, G degrees of freedom. Few specimens do not show that there is nothing.
    """
    if (floor := problem.replicate_floor()) is None:
        return False
    known = np.isfinite(floor) & ~problem.strays
    most, n = 1.0, int(known.sum())
    if len(problem.campaign.specimens) >= ENOUGH_SPECIMENS:
        groups = sum(bool(known[list(members)].any()) for members in problem.model.replicates)
        most += (float(chdtri(groups, _BY_CHANCE)) - groups) / n
    errors = problem.squared_errors(Candidate(()))
    return bool(np.mean(errors[known]) <= most * np.mean(floor[known]))


_WRONG_FORM = 1.0 / 3.0
"""Share of an effect's pattern that a wrong form of it may miss. Chosen: a form that misses more is
hardly one of that effect."""

_LOOKED_AT = 12
"""Effects, the best ones by evidence, that are weighed with an unknown beside them, and of which is
asked whether errors fall. Convention: as many as a diagnosis ranks."""


def _explained(
    weighed: Weighed, *, within_floor: bool
) -> tuple[Mapping[Effects, bool], Mapping[Effects, Effects]]:
    """Return `Evidence.closes` and `Evidence.without`, of the best effects and of fewer of each.

    Specimens may each have their own size of an effect, but not within the floor: there, what they
    differ by is no gap, and errors of force have to fall by more than chance; it says nothing of
    strains. Laws are as they likeliest are with the effects, and without: what the palette is
    off by is no effect's to close. Nor is it one's to open: a further effect that only a law far
    off makes up for raises the errors of force by the palette's own laws. It gains no more than
    what the form of the others may miss, or where all together close nothing, than these do.
    """
    problem, none = weighed.plain.problem, weighed.log_evidence[(), ""]
    test_of = problem.model.test_of
    gain = {e: weighed.log_evidence[e, ""] - none for e in weighed.best if e}
    best = sorted(gain, key=lambda e: -gain[e])[:_LOOKED_AT]
    closes = dict[Effects, bool]()
    without = dict[Effects, Effects]()
    errors: dict[Effects, FloatArray] = {}
    for effects in sorted((e for e in gain if any(set(e) <= set(b) for b in best)), key=len):
        before, after = weighed.errors(effects, own=not within_floor)
        force, strain = np.stack([before.sum(axis=0), after.sum(axis=0)], axis=1)
        by_chance = within_floor and not _rise((before - after)[:, 0])
        closes[effects] = _falls(*strain) or (_falls(*force) and not by_chance)
        errors[effects] = own = problem.squared_errors(weighed.best[effects])
        fewer = [
            e
            for e in errors
            if set(e) < set(effects)
            and closes[e]
            and gain[effects] - gain[e] < (_WRONG_FORM**2 if closes[effects] else 1.0) * gain[e]
            and _rise(np.bincount(test_of, own - errors[e]) / np.bincount(test_of))
        ]
        if fewer:
            least = min(fewer, key=lambda e: errors[e].mean())
            without[effects] = without.get(least, least)
    return closes, without


def _rise(rise: FloatArray) -> bool:
    """Return whether errors rise, by a paired t test; of tests, or of specimens, each its rise."""
    least = float(stdtrit(len(rise) - 1, 1.0 - _BY_CHANCE))
    return len(rise) > 1 and bool(rise.mean() > least * rise.std(ddof=1) / np.sqrt(len(rise)))


_RESOLVED = 0.005
"""Share of errors by which they must fall. Numerical: an idle effect beside a mode that is found to
0.05 nats moves them by some thousandths either way."""


def _falls(before: FloatArray, after: FloatArray) -> bool:
    """Return whether errors of forces fall, or those of strains."""
    return bool(np.any(before - after > _RESOLVED * before))


# ------------------------------------------------------------------------------------------------
# From weighed hypotheses to the ranking that a diagnosis reports.


_UNKNOWN_WITHIN = 0.3
"""Share that an unknown cause keeps of its probability where the gap is within the floor.
Calibrated: of development campaigns with an unknown cause 9 of 32 lie within it."""


def ranking_of(evidence: Evidence, priors: Priors) -> tuple[Hypothesis, ...]:
    """Return hypotheses, the most probable first.

    Evidence counts the share of itself that `Priors` say. A gap no larger than what replicates
    differ by is seldom an unknown one; a right effect may be smaller than that. What closes nothing
    is hardly an explanation: of a gap that is larger it speaks for what closes it, or for an
    unknown. What raises the errors of force speaks for what does without. Neither is ruled out, as
    each specimen may have its own size of a right effect. A cause out of the library may look like
    one that is in it, which no data tell. Very few specimens show a gap, not its cause: the rest of
    what they name is unknown, or where they show none, none.
    """
    counted = _counted_of(evidence, priors)
    odds = {key: prior + counted[key] for key, prior in evidence.log_prior.items()}
    p, beside = posterior(odds)
    named = [effects for effects in p if effects not in ((), UNKNOWN)]
    unlikely = float(expit(-_ALIKE_NATS))
    for effects, fewer in evidence.without.items():
        _give(p, {effects: 1.0 - unlikely}, fewer)
    vain = [effects for effects, closes in evidence.closes.items() if not closes]
    if evidence.within_floor:
        # The floor is of forces. Of strains along a bar it says nothing.
        local = float(np.exp(odds.get(((), "position"), -np.inf) - logsumexp(list(odds.values()))))
        of_forces = 1.0 - local / max(p.get(UNKNOWN, 0.0), local, 1e-300)
        _give(p, {UNKNOWN: (1.0 - _UNKNOWN_WITHIN) * of_forces}, ())
        no_gap = [*vain, *((id,) for id in sorted(evidence.scatter_like))]
        _give(p, dict.fromkeys(no_gap, 1.0 - unlikely), ())
    else:
        # In proportion, and to an unknown as if that were `_ALIKE_NATS` below what gives: what has
        # less yet, as a third effect that fits by chance, is no better explanation.
        given = (1.0 - unlikely) * sum(p.get(effects, 0.0) for effects in vain)
        closing = sum(p.get(e, 0.0) for e, closes in evidence.closes.items() if closes)
        each = given / max(closing + unlikely * given, 1e-300)
        for effects in p.keys() & evidence.closes.keys():
            p[effects] *= 1.0 + each if evidence.closes[effects] else unlikely
        p[UNKNOWN] = p.get(UNKNOWN, 0.0) + unlikely * each * given
        _give(p, {e: _imitated(e, evidence, priors) for e in named}, UNKNOWN)
    most = (evidence.specimens - 1) / (ENOUGH_SPECIMENS - 1) * (1.0 - p.get((), 0.0))
    over = sum(p[effects] for effects in named)
    if evidence.specimens < ENOUGH_SPECIMENS and over > most:
        _give(p, dict.fromkeys(named, 1.0 - most / over), () if evidence.within_floor else UNKNOWN)
    ranked = sorted(p, key=lambda e: (-p[e], e))
    return tuple(Hypothesis(e, p[e], beside.get(e, 0.0)) for e in ranked)


_SURE = 30.0
"""Log odds that are as good as certain. Numerical: what is left is not rounded to nothing."""


def _imitated(effects: Effects, evidence: Evidence, priors: Priors) -> float:
    """Return how probable it is that a cause out of the library looks like effects.

    It need not look the same: the more a pattern beside the effects explains, the likelier. The
    more they explain themselves, the less of that pattern is more than their form's own error; and
    along what they vary along it is nothing but that. Three effects have many courses.
    """
    found = evidence.log_evidence
    # Along strain most do.
    own_axes = {axis for id in effects for axis in evidence.axes.get(id, ())} - {"strain"}
    own = found.get((effects, ""), np.inf)
    beside = [v - own for (e, at), v in found.items() if e == effects and at not in {"", *own_axes}]
    form = priors.imitation_nats / (priors.imitation_nats + max(own - found[(), ""], 0.0))
    log_odds = min(_counted(found, priors), form) * max([0.0, *beside])
    log_odds += np.log(priors.imitated_by_three) * (len(effects) > 2)
    return float(expit(logit(priors.imitated) + min(log_odds, _SURE)))


_COLUMNS = frozenset({*TOLERANCES, "orientation"})
"""Conditions and sizes of specimens. Of all axes these alone hold nothing of a curve's course, of a
mixture or of what specimens are unlike by, in which any effect's form is off."""


def _counted_of(evidence: Evidence, priors: Priors) -> Mapping[HypothesisKey, float]:
    """Return how much of each hypothesis' log evidence counts.

    A form is off along its effect's own axes. What the weaker one of two effects explains along
    columns alone, none of them the other's, is no such error: it counts as if it were found alone.
    Of three it does not, as orientation then was named beside two effects that were all.
    """
    found, axes = evidence.log_evidence, evidence.axes
    counts = _counted(found, priors)
    counted = {key: counts * value for key, value in found.items()}
    for both, axis in (key for key in found if len(key[0]) == 2):
        weaker, other = sorted(both, key=lambda id: found.get(((id,), ""), -np.inf))
        if set(axes.get(weaker, ("",))) <= _COLUMNS - set(axes.get(other, ())):
            gain = max(0.0, found.get((both, ""), -np.inf) - found.get(((other,), ""), np.inf))
            counted[both, axis] += max(0.0, gain * (priors.counted(gain) - counts))
    return counted


def _counted(found: Mapping[HypothesisKey, float], priors: Priors) -> float:
    """Return the share of log evidence that counts."""
    # Over no effect in models that are exact, or that all miss.
    none = max(found.get(((), axis), -np.inf) for axis in ("", EVERY_TEST))
    return priors.counted(max(found.values()) - none)


def _give(p: dict[Effects, float], share: Mapping[Effects, float], to: Effects) -> None:
    """Give shares of hypotheses' probability to another one."""
    for effects in (e for e in share if e in p and e != to):
        given = share[effects] * p[effects]
        p[to] = p.get(to, 0.0) + given
        p[effects] -= given


def axes_of(
    problem: Problem, evidence: Evidence, ranking: Sequence[Hypothesis], priors: Priors
) -> Mapping[str, float]:
    """Return, by axis, how probable it is that the gap lies along it, if it has a cause.

    An effect's lies along the axes that it varies along, an unknown's along its own; what goes
    along every test says nothing of where.
    """
    own = {id: set(effect.where) for id, effect in problem.effects.items()}
    own |= {axis.axis: {axis.axis} for axis in problem.unknown if axis.axis != EVERY_AXIS}
    names = set().union(*own.values())
    counts = _counted(evidence.log_evidence, priors)
    odds: dict[HypothesisKey, float] = {
        ((axis,), ""): prior + counts * evidence.log_evidence[effects, axis]
        for (effects, axis), prior in evidence.log_prior.items()
        if axis and not effects
    }
    shares = {h.effects: h.probability for h in ranking if h.effects}
    unknown = shares.pop(UNKNOWN, 0.0)
    parts = [*shares.items(), *((of, unknown * share) for of, share in posterior(odds)[0].items())]
    found, caused = dict.fromkeys(names, 0.0), sum(probability for _, probability in parts)
    for of, probability in parts:
        for axis in set().union(*(own.get(id, names) for id in of)):
            found[axis] += probability / max(caused, 1e-300)
    return found


def verdict_of(ranking: Sequence[Hypothesis]) -> Effects:
    """Return the likeliest hypothesis of the likeliest kind: none, unknown or named."""
    kinds: dict[Effects | None, list[Hypothesis]] = {}
    for h in ranking:
        kinds.setdefault(h.effects if h.effects in ((), UNKNOWN) else None, []).append(h)
    return max(kinds.values(), key=lambda of_it: sum(h.probability for h in of_it))[0].effects


# ------------------------------------------------------------------------------------------------
# How well a candidate's parameters are known.


_TAIL = 0.95
"""Quantile of a coordinate at the upper end. Convention: both ends hold 90 %."""


def found_effects(weighed: Weighed, candidate: Candidate) -> tuple[FoundEffect, ...]:
    """Return each effect's form and parameters with 90 % intervals.

    Intervals are the posterior's about its mode in coordinates in which the prior is normal:
    Student's t, as the scatter is known to the deviation of its logarithm.
    """
    one, found, first = weighed.mode_of(candidate), [], 0
    tail = float(stdtrit(0.5 / one.likelihood.problem.scatter.log_sd**2, _TAIL))
    at, covariance = one.coordinates, one.covariance()
    sd = np.sqrt(np.diagonal(covariance))
    for signed, point in candidate.parts:
        own = slice(first, first := first + len(signed.coordinates(point)))
        ends = [signed.point(at[own] + step * sd[own]) for step in (-tail, 0.0, tail)]
        low, middle, high = map(signed.values, ends)
        interval = {n: (min(low[n], high[n]), max(low[n], high[n])) for n in middle}
        scaled = np.sign([high[n] - low[n] for n in middle]) / sd[own]
        related = tuple(map(tuple, (covariance[own, own] * np.outer(scaled, scaled)).tolist()))
        units = {p.name: p.unit for p in signed.form.parameters}
        units |= dict.fromkeys(signed.form.details, "1")
        names = signed.effect.id, signed.form.name
        found.append(FoundEffect(*names, middle, interval, units, correlation=related))
    if candidate.members is not None:
        members, problem = candidate.members, weighed.plain.problem
        inner = weighed.plain.products(problem.gains)
        sd_of_log = 1.0 / np.sqrt(max(float(members @ inner @ members), 1e-12))
        factor, reach = float(np.exp(candidate.log_gain)), float(np.exp(tail * sd_of_log))
        interval, unit = {"factor": (factor / reach, factor * reach)}, {"factor": "1"}
        ids = tuple(s.id for s, m in zip(problem.campaign.specimens, members, strict=True) if m)
        of_it = FoundEffect(_GAIN, "of-some-specimens", {"factor": factor}, interval, unit, ids)
        found.append(of_it)
    return tuple(sorted(found, key=lambda effect: effect.id))


# ------------------------------------------------------------------------------------------------
# The smallest size of each effect that this campaign would have shown.


_SIZES = 60
"""At which is looked for the smallest that would be named. Numerical: in steps of some 6 % of
the size, for a largest one of 40 times the smallest."""


def detectable_sizes(problem: Problem, nodes: FloatArray, priors: Priors) -> Iterator[Detectable]:
    """Yield, of each effect's first form, the size whose expected evidence would name it.

    That is where half the squared length of its whitened pattern, nuisances projected out, makes
    up for the prior odds against it and tells it from none; shapes are at their middle.

    Parameters
    ----------
    nodes : (nodes, nodes)
        Inner products of all nodes, what is uncertain besides integrated out.
    """
    needed = needed_nats(priors, max(len(problem.effects), 1))
    for id, effect in problem.effects.items():
        known, form = list[float](), effect.forms[0]
        for b in (b for b in problem.signed_forms if b.form is form):
            sizes = np.geomspace(b.least, 1.0, _SIZES)
            weights = node_weights([(s, *[0.0] * b.shapes) for s in sizes])
            nats = 0.5 * np.sum((weights @ nodes[b.own, b.own]) * weights, axis=1)
            known += sizes[nats >= needed][:1].tolist()
        size = form.size.high * min(known) ** 2 if known else None
        yield Detectable(id, form.size.name, size, form.size.unit)


def needed_nats(priors: Priors, effects: int) -> float:
    """Return the gain at which one of so many effects is told from none, by `_ALIKE_NATS`."""
    odds = float(np.log(priors.none * effects / priors.single))
    # Where what counts of a gain g, T g + (1 - T) c g / (c + g), makes up for the odds.
    t, c = priors.temperature, priors.coarseness_nats
    gain = (odds - c + float(np.sqrt((c - odds) ** 2 + 4.0 * t * odds * c))) / (2.0 * t)
    return gain + _ALIKE_NATS
