"""What could be said of a campaign at best: the bench's own forms, weighed by its own noise.

The oracle knows how the lab prints, pulls and scatters, in which form each effect comes and from
which ranges its parameters are drawn. It does not know which effect is hidden, the parameters, the
errors of the palette's calibration, nor the scale of the scatter. Each hypothesis is fitted through
the bench's solver by Levenberg and Marquardt's method on 24 rows a curve and the camera's strains;
its evidence is Laplace's, all parameters having a normal prior once they are written as quantiles.
Forces are held against each other as asinh(F / F0), F0 a twentieth of the curve's peak: there the
scatter of a specimen is a sum, so that a softer model does not make the noise look smaller.
"""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import gammaln, ndtr, ndtri
from threadpoolctl import threadpool_limits

from benchmarks.withheld.answers import Key, Outcome, Task, answer_all, kept_outcomes
from benchmarks.withheld.reality.__main__ import PALETTE
from benchmarks.withheld.reality.base_law import BaseLaw, fit_base_law
from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.campaign import (
    Campaign,
    Lab,
    measured_in,
    mounted_groups,
    open_lab,
)
from benchmarks.withheld.reality.effects import EFFECTS, Effect, Form, Set
from benchmarks.withheld.reality.fields import FIELD_ROWS, USUAL, strain_sd
from benchmarks.withheld.reality.noise import Handling, Scatter, wander_correlation
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.protocol import ROWS, Motion
from benchmarks.withheld.reality.sets import SETS
from benchmarks.withheld.reality.sizing import Hidden, mounted_with
from benchmarks.withheld.reality.solver import Response, solve
from benchmarks.withheld.reality.tiers import Cause
from benchmarks.withheld.scoring import Score, Truth

__all__ = ["OracleScore", "beside_oracle", "oracle_answer", "oracle_outcomes", "oracle_score"]

_TIERS = ("library", "other", "pair")
"""Where nothing is hidden, there is nothing to name; other tiers are no question of evidence."""

_NATS = 5.0
"""A hypothesis is told from another where its evidence is better by this: odds of 150 to 1."""


# ------------------------------------------------------------------------------------------------
# What the oracle's evidences amount to.


@dataclass(frozen=True, slots=True)
class OracleScore:
    """How far a campaign can be told.

    Attributes
    ----------
    named
        The truth is ahead of every rival by 5 nats; where nothing is hidden, no effect is ahead
        of nothing by as much.
    probability
        Of the truth, all hypotheses weighed being equally likely beforehand.
    left_out
        Every effect in every form but the hidden one's is behind the truth by 5 nats, so that its
        absence can be noticed; None where this was not weighed.
    """

    named: bool
    probability: float
    left_out: bool | None


def oracle_score(document: Mapping[str, Any]) -> OracleScore:
    """Return what `oracle_answer`'s document amounts to."""
    evidence: dict[str, float] = document["log_evidence"]
    truth = "+".join(document["truth"]) or "none"
    own = evidence[truth]
    rivals = [e for name, e in evidence.items() if name != truth]
    named = own >= max(rivals) + _NATS if truth != "none" else max(rivals) < own + _NATS
    probability = 1.0 / (1.0 + math.fsum(math.exp(min(e - own, 700.0)) for e in rivals))
    left_out = None
    if document["other_forms"]:
        left_out = own >= max(*rivals, *document["other_forms"].values()) + _NATS
    return OracleScore(named, probability, left_out)


def beside_oracle(score: Score, outcome: Outcome | None, *, left_out: bool) -> Score:
    """Return a score with what the oracle reached; as it is where that was not asked."""
    if outcome is None or outcome.document is None:
        return score
    found = oracle_score(outcome.document)
    if left_out:
        return replace(score, oracle=found.left_out)
    return replace(score, oracle=found.named, oracle_probability=found.probability)


def oracle_outcomes(
    truth: Truth, tasks: Sequence[Task], truth_file: Path, jobs: int, stage: Callable[[str], None]
) -> Mapping[Key, Outcome]:
    """Return the oracle's answers, which `oracle.jsonl` beside the truth keeps."""
    asked = [t for t in tasks if truth.campaigns[t.folder.name].tier in _TIERS and not t.without]
    answering = partial(oracle_answer, truth_file)
    answers = partial(answer_all, answering, jobs=jobs, stage=stage)
    return kept_outcomes(asked, truth_file.with_name("oracle.jsonl"), answers)


# ------------------------------------------------------------------------------------------------
# Hypotheses: forms whose draws are functions of standard normal variables.


@dataclass
class _Quantiles:
    """Stands for the random generator of a form's `draw`: each draw is a quantile of `z`.

    Attributes
    ----------
    picks
        Which option each `choice` takes.
    order
        Of the specimens, the one whose force is most above the model's first: what a permutation
        returns, the other way round where the first pick is the sign -1.
    groups
        Which of `z` each draw took.
    options
        How many options each choice had.
    counted
        The group that says how many of the permutation are meant.
    """

    z: FloatArray
    picks: Sequence[int]
    order: NDArray[np.int64]
    groups: list[slice] = field(default_factory=list)
    options: list[int] = field(default_factory=list)
    counted: int | None = None

    def _next(self, count: int) -> FloatArray:
        first = self.groups[-1].stop if self.groups else 1  # the size has the first
        self.groups.append(slice(first, first + count))
        return self.z[first : first + count]

    def uniform(self, low: float, high: float) -> float:
        return low + (high - low) * float(ndtr(self._next(1)[0]))

    def normal(self, mean: float, sd: float, size: int) -> FloatArray:
        return mean + sd * self._next(size)

    def choice(self, options: Sequence[float]) -> float:
        self.options.append(len(options))
        return options[self.picks[len(self.options) - 1]]

    def permutation(self, count: int) -> NDArray[np.int64]:
        self.counted = len(self.groups) - 1
        return self.order if self.picks[0] else self.order[::-1]


_COUNTS = 6
"""Counts of the specimens that a fault has, at evenly spaced quantiles."""


@dataclass(frozen=True)
class _One:
    """One effect in one form, its discrete draws made."""

    effect: Effect
    form: Form
    picks: tuple[int, ...]
    groups: tuple[slice, ...]
    counted: int | None
    log_prior: float

    @property
    def size(self) -> int:
        """Return how many of z it takes."""
        return self.groups[-1].stop if self.groups else 1

    def hidden(self, z: FloatArray, data: "_Data") -> Hidden:
        z = z.copy()
        if self.counted is not None:
            z[self.groups[self.counted]] = ndtri((self.picks[-1] + 0.5) / _COUNTS)
        rng: Any = _Quantiles(z, self.picks, data.order)
        shape = self.form.draw(rng, data.lab.design)
        grown = math.log(self.form.high / self.form.low) * float(ndtr(z[0]))
        return Hidden(Cause(self.effect, self.form, shape, 0.0), self.form.low * math.exp(grown))


def _ways(effect: Effect, form: Form, data: "_Data") -> list[_One]:
    """Return an effect's form with every combination of its discrete draws."""
    count = len(data.lab.design)
    tried = _Quantiles(np.zeros(1 + 8 + 2 * count), [0] * 8, data.order)
    rng: Any = tried
    form.draw(rng, data.lab.design)
    options = [*tried.options, *([] if tried.counted is None else [_COUNTS])]
    ways = []
    for picks in product(*map(range, options)):
        prior = -math.fsum(map(math.log, options))
        one = _One(effect, form, picks, tuple(tried.groups), tried.counted, prior)
        if tried.counted is not None:
            # As many masks as there are ways to choose so many
            shape = one.hidden(np.zeros(one.size), data).cause.shape
            k = sum(shape["affected"])  # type: ignore[arg-type]  # a list by that name
            chosen = gammaln(count + 1.0) - gammaln(k + 1.0) - gammaln(count - k + 1.0)
            one = replace(one, log_prior=prior - float(chosen))
        ways.append(one)
    return ways


# ------------------------------------------------------------------------------------------------
# The data and what the bench predicts of them.


@dataclass(frozen=True)
class _Seen:
    """Forces (S, T) as asinh(F / F0) and the camera's strains (bars, rows, places)."""

    pull: FloatArray
    strain: FloatArray


_EVERY = 5
_TIMES = FIELD_ROWS // _EVERY
_SMALL_SHARE_OF_PEAK = 0.05
_STEP = 0.02


class _Data:
    """A campaign's data, whitened, and the bench's predictions of them."""

    def __init__(self, lab: Lab) -> None:
        self.lab = lab
        campaign = measured_in(lab)
        rules = SETS[lab.set_name]
        self.law = fit_base_law(lab.palette, rules.network, rules.largest_misfit)
        groups = mounted_groups(lab.palette, lab.design, self.law)
        self.benches = tuple(map(_coarse, groups))
        number = np.concatenate([b.design.number for b in groups])
        rows = np.concatenate([_rows_kept(b.motion) for b in groups])[number.argsort()]
        self.rows = rows[:, 1:]
        self.travel = np.take_along_axis(campaign.displacement_mm, self.rows, axis=1)
        self.travel /= campaign.displacement_mm.max(axis=1, keepdims=True)
        self.force_N = np.take_along_axis(campaign.force_N, self.rows, axis=1)
        peak_N = np.abs(self.force_N).max(axis=1, keepdims=True)
        self.small_N = _SMALL_SHARE_OF_PEAK * peak_N
        self.pull = np.arcsinh(self.force_N / self.small_N)
        self.root = np.linalg.cholesky(_covariance(self, lab.scatter))
        self.facets, self.strain = _camera(groups, campaign)
        self.strain_sd = strain_sd(self.strain)
        self.grades = len(self.law.coordinates)
        self.order = np.arange(len(lab.design))
        self._kept: dict[tuple[int, bytes], Response] = {}

    def predicted(self, c: FloatArray, hidden: Sequence[Hidden] = ()) -> _Seen:
        """Return what ideal sensors would see, the palette off by `c` standard deviations."""
        scatter, n = self.lab.scatter, self.grades
        law: BaseLaw = self.law.shifted(scatter.calibration * c[:n], scatter.tilt * c[n:])
        force = np.zeros_like(self.force_N)
        strain = np.zeros_like(self.strain)
        for bench in self.benches:
            plain = replace(bench, law=law)
            faulty = mounted_with(plain, hidden)
            response = self._response(plain) if _moves_alike(faulty, plain) else solve(faulty)
            seen = faulty.gain * response.force_N + faulty.offset_N
            force[bench.design.number] = seen[:, 1:]
            if (bench.design.profile >= 0).any():
                strain = np.einsum("bpn,btn->btp", self.facets, response.strain[:, _TIMES])
        return _Seen(np.arcsinh(force / self.small_N), strain)

    def _response(self, plain: Bench) -> Response:
        """Return the response of a bench without effect, kept for the last law of each bench."""
        kind = len(plain.design), plain.law.log_secant_MPa.tobytes()
        if kind not in self._kept:
            self._kept = {k: v for k, v in self._kept.items() if k[0] != kind[0]}
            self._kept[kind] = solve(plain)
        return self._kept[kind]

    def whitened(self, pull: FloatArray, strain: FloatArray) -> FloatArray:
        """Return differences of pull (P, S, T) and strain (P, ...) in standard deviations."""
        columns = pull.reshape(len(pull), self.pull.size).T
        pulls = solve_triangular(self.root, columns, lower=True, check_finite=False)
        looks = (strain / self.strain_sd).reshape(len(strain), self.strain.size).T
        return np.concatenate([pulls, looks])

    def residual(self, seen: _Seen) -> FloatArray:
        """Return measured less predicted, in standard deviations."""
        pull, strain = self.pull - seen.pull, self.strain - seen.strain
        return self.whitened(pull[None], strain[None])[:, 0]

    @cached_property
    def by_law(self) -> FloatArray:
        """How the whitened data follow the palette's 2 G errors, where nothing is hidden.

        A factor on a force leaves this as it is, and so about does every effect.
        """
        plain = self.predicted(np.zeros(2 * self.grades))
        moved = [self.predicted(_STEP * unit) for unit in np.eye(2 * self.grades)]
        pull = np.array([m.pull - plain.pull for m in moved]) / _STEP
        return self.whitened(pull, np.array([m.strain - plain.strain for m in moved]) / _STEP)


def _moves_alike(faulty: Bench, plain: Bench) -> bool:
    """Tell whether an effect left everything but the load cell as it was."""
    names = {f.name for f in fields(Bench)} - {"gain", "offset_N"}
    return all(getattr(faulty, name) is getattr(plain, name) for name in names)


def _rows_kept(motion: Motion) -> NDArray[np.int64]:
    """Return rest and every fifth row, moved so that every corner of the travel has one."""
    kept = []
    for direction in motion.direction:
        rows = np.arange(0, ROWS + 1, _EVERY)
        for corner in np.flatnonzero(np.diff(direction[1:])) + 1:
            movable = np.where(np.isin(rows, FIELD_ROWS), 10 * ROWS, np.abs(rows - corner))
            rows[movable.argmin()] = corner if corner not in rows else rows[movable.argmin()]
        kept.append(rows)
    return np.array(kept)


def _coarse(bench: Bench) -> Bench:
    motion, rows = bench.motion, _rows_kept(bench.motion)
    kept = Motion(
        np.take_along_axis(motion.time_s, rows, axis=1),
        np.take_along_axis(motion.displacement_mm, rows, axis=1),
        np.take_along_axis(motion.direction, rows, axis=1),
    )
    return replace(bench, motion=kept, lost_mm=np.zeros(rows.shape))


def _covariance(data: _Data, scatter: Scatter) -> FloatArray:
    """Return the covariance of `pull` that the lab's scatter makes."""
    specimens, rows = data.pull.shape
    batch = data.lab.design.batch
    shared = np.kron(scatter.batch**2 * (batch[:, None] == batch), np.ones((rows, rows)))
    for i in range(specimens):
        own = slice(i * rows, (i + 1) * rows)
        slope = data.travel[i] - 0.5
        shared[own, own] += scatter.specimen**2 + scatter.slope**2 * np.outer(slope, slope)
        shared[own, own] += scatter.wander**2 * wander_correlation(data.rows[i], scatter)
    scale_N = np.hypot(data.force_N, data.small_N)
    felt = (data.force_N / scale_N).ravel()
    white = (scatter.white_N(data.force_N) / scale_N) ** 2
    return np.asarray(shared * np.outer(felt, felt) + np.diag(white.ravel()))


def _camera(groups: Sequence[Bench], campaign: Campaign) -> tuple[FloatArray, FloatArray]:
    """Return what of each element each facet sees, (B, P, N), and the strains, (B, rows, P)."""
    seen = {number: strain for number, _, _, strain in campaign.fields}
    bars = next(b for b in groups if (b.design.profile >= 0).any())
    specimens, elements = bars.coordinate.shape
    facets = []
    for first in range(0, elements, len(FIELD_ROWS)):
        # Each of the camera's rows has one element strained by 1
        at = np.arange(first, min(first + len(FIELD_ROWS), elements))
        strain = np.zeros((specimens, ROWS + 1, elements))
        strain[:, FIELD_ROWS[: len(at)], at] = 1.0
        facets.append(np.array(USUAL.seen(bars, strain))[:, : len(at)])
    by_element = np.concatenate(facets, axis=1).swapaxes(1, 2)
    return by_element, np.array([seen[int(number)] for number in bars.design.number])


# ------------------------------------------------------------------------------------------------
# Levenberg and Marquardt's fit of a hypothesis, and its evidence.


_ITERATIONS = 15
_ENOUGH_NATS = 0.02
_LARGEST_STEP = 1.5
_SCANNED = (-1.3, 0.0, 1.3)


@dataclass(frozen=True)
class _Fit:
    """Of one hypothesis: its parts, their z and the palette's errors c at the best, ln Z."""

    ones: tuple[_One, ...]
    z: tuple[FloatArray, ...]
    c: FloatArray
    log_evidence: float


def _cost(data: _Data, residual: FloatArray, parameters: FloatArray) -> float:
    """Return minus the logarithm of the density, the scale of the scatter at its best."""
    n = data.pull.size
    pulls, looks = residual[:n], residual[n:]
    chi: float = n * math.log(float(pulls @ pulls) / n) + float(looks @ looks)
    return 0.5 * (chi + float(parameters @ parameters))


def _predicted(data: _Data, ones: Sequence[_One], z: FloatArray, c: FloatArray) -> _Seen:
    return data.predicted(
        c, [one.hidden(p, data) for one, p in zip(ones, _parts(ones, z), strict=True)]
    )


def _parts(ones: Sequence[_One], z: FloatArray) -> list[FloatArray]:
    return np.split(z, np.cumsum([one.size for one in ones])[:-1]) if ones else []


def _jacobian(
    data: _Data, ones: Sequence[_One], z: FloatArray, c: FloatArray, seen: _Seen
) -> FloatArray:
    """Return how the whitened prediction follows z and c, (n, len(z) + len(c)).

    What every specimen has of its own moves that specimen alone: one run for all of them.
    """
    pull = np.zeros((len(z), *data.pull.shape))
    strain = np.zeros((len(z), *data.strain.shape))
    bars = np.flatnonzero(data.lab.design.profile >= 0)
    first = 0
    for one in ones:
        own = (slice(0, 1), *one.groups)
        for number, group in enumerate(own):
            if one.counted is not None and number == one.counted + 1:
                continue
            at = np.arange(first + group.start, first + group.stop)
            moved = z.copy()
            moved[at] += _STEP
            change = _predicted(data, ones, moved, c)
            pulled = (change.pull - seen.pull) / _STEP
            looked = (change.strain - seen.strain) / _STEP
            if len(at) == 1:
                pull[at[0]], strain[at[0]] = pulled, looked
            else:
                every = np.arange(len(at))
                pull[at, every] = pulled[every]
                strain[at[bars], np.arange(len(bars))] = looked
        first += one.size
    return np.concatenate([data.whitened(pull, strain), data.by_law], axis=1)


def _fitted(data: _Data, ones: tuple[_One, ...], z: FloatArray, c: FloatArray) -> _Fit:
    n, free = data.pull.size, len(z)
    at = np.concatenate([z, c])
    seen = _predicted(data, ones, z, c)
    residual = data.residual(seen)
    cost, damping = _cost(data, residual, at), 1e-2
    for _ in range(_ITERATIONS):
        jacobian = _jacobian(data, ones, at[:free], at[free:], seen)
        weight = np.ones(len(residual))
        weight[:n] = n / float(residual[:n] @ residual[:n])
        curvature = jacobian.T @ (weight[:, None] * jacobian) + np.eye(len(at))
        down = jacobian.T @ (weight * residual) - at
        before = cost
        while damping < 1e6:
            step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), down)
            trial = at + np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
            there = _predicted(data, ones, trial[:free], trial[free:])
            new = data.residual(there)
            if _cost(data, new, trial) < cost:
                at, seen, residual = trial, there, new
                cost, damping = _cost(data, new, trial), 0.2 * damping
                break
            damping *= 8.0
        if before - cost < _ENOUGH_NATS:
            break
    _, log_determinant = np.linalg.slogdet(curvature)
    prior = math.fsum(one.log_prior for one in ones)
    evidence = prior - cost - 0.5 * float(log_determinant)
    return _Fit(ones, tuple(_parts(ones, at[:free])), at[free:], evidence)


def _start(
    data: _Data, ways: Iterable[_One], beside: _Fit
) -> tuple[float, tuple[_One, ...], FloatArray]:
    """Return the cost, the parts and the z of the best start of one more effect beside a fit."""
    law = data.by_law
    inner = np.linalg.cholesky(law.T @ law + np.eye(law.shape[1]))

    def cost(one: _One, z: FloatArray) -> float:
        # The palette's errors give way as far as their linear effect goes
        whole = np.concatenate([*beside.z, z])
        seen = _predicted(data, (*beside.ones, one), whole, beside.c)
        residual = data.residual(seen)
        taken = solve_triangular(inner, law.T @ residual, lower=True)
        less = residual - law @ solve_triangular(inner.T, taken)
        return _cost(data, less, whole) - one.log_prior

    best: tuple[float, _One, FloatArray] | None = None
    for one in ways:
        for size in _SCANNED:
            z = np.zeros(one.size)
            z[0] = size
            found = cost(one, z)
            if best is None or found < best[0]:
                best = found, one, z
    assert best is not None
    found, one, z = best
    for group in one.groups:
        if group.stop - group.start > 1:
            continue
        for value in (_SCANNED[0], _SCANNED[-1]):
            moved = z.copy()
            moved[group] = value
            there = cost(one, moved)
            if there < found:
                found, z = there, moved
    return found, (*beside.ones, one), np.concatenate([*beside.z, z])


def _forms(data: _Data, effect: Effect, kind: str) -> tuple[Form, ...]:
    forms: Mapping[Set, tuple[Form, ...]] = getattr(effect, kind)
    return forms[data.lab.set_name]


def _best(data: _Data, effect: Effect, kind: str, beside: _Fit) -> _Fit:
    """Return the fit of an effect beside a fit; of several forms the best, each as likely."""
    fits = []
    forms = _forms(data, effect, kind)
    for form in forms:
        _, ones, z = _start(data, _ways(effect, form, data), beside)
        fits.append(_fitted(data, ones, z, beside.c))
    best = max(fits, key=lambda fit: fit.log_evidence)
    return replace(best, log_evidence=best.log_evidence - math.log(len(forms)))


# ------------------------------------------------------------------------------------------------
# A campaign's hypotheses.


_PAIRS = 3
"""Pairs other than the true one that are fitted: the best ones at their starts."""


def oracle_answer(truth_file: Path, folder: Path, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the log evidences of a sealed campaign's hypotheses.

    ``log_evidence`` of none, of every single effect in the form of the campaign's tier and, where
    two are hidden, of that pair and the pairs that come next; ``other_forms`` of every effect but
    the hidden one, in the set's other form.
    """
    truth = json.loads(truth_file.read_text(encoding="utf-8"))
    made_by, entry = truth["made_by"], truth["campaigns"][folder.name]
    assert made_by["set"] in get_args(Set)
    palette = read_palette(PALETTE.read_text(encoding="utf-8"))
    which = made_by["set"], entry["tier"], made_by["specimens"], made_by["seed"], entry["index"]
    with threadpool_limits(1, user_api="blas"):
        handling = Handling(**made_by.get("handling", {}))
        return _weighed(open_lab(palette, *which, handling=handling))


def _weighed(lab: Lab) -> dict[str, Any]:
    data = _Data(lab)
    true = sorted(item.cause.effect.id for item in lab.hidden)
    used = {"other" if item.cause.form in item.cause.effect.other[lab.set_name] else "library"
            for item in lab.hidden}  # fmt: skip
    kind = "other" if used == {"other"} else "library"
    none = _fitted(data, (), np.zeros(0), np.zeros(2 * data.grades))
    above = data.pull - data.predicted(none.c).pull
    data.order = np.argsort(-np.median(above, axis=1))
    fits = {id: _best(data, effect, kind, none) for id, effect in EFFECTS.items()}
    evidence = {"none": none.log_evidence, **{id: f.log_evidence for id, f in fits.items()}}
    if len(true) == 2:
        evidence |= _pairs(data, fits, kind, (true[0], true[1]))
    others = {}
    if lab.tier == "library":
        rest = [id for id in EFFECTS if id not in true]
        others = {id: _best(data, EFFECTS[id], "other", none).log_evidence for id in rest}
    return {"truth": true, "log_evidence": evidence, "other_forms": others}


def _pairs(
    data: _Data, fits: Mapping[str, _Fit], kind: str, true: tuple[str, str]
) -> dict[str, float]:
    """Return the evidence of the true pair, and of those that look best beside the best singles."""
    own = max(
        _best(data, EFFECTS[other], kind, fits[one]).log_evidence
        for one, other in (true, true[::-1])
    )
    looks: dict[str, tuple[float, str, str]] = {}
    for one in sorted(fits, key=lambda id: -fits[id].log_evidence)[:2]:
        for other in EFFECTS:
            name = "+".join(sorted((one, other)))
            if other == one or name == "+".join(true):
                continue
            ways = [
                w
                for f in _forms(data, EFFECTS[other], kind)
                for w in _ways(EFFECTS[other], f, data)
            ]
            cost = _start(data, ways, fits[one])[0]
            if name not in looks or cost < looks[name][0]:
                looks[name] = cost, one, other
    found = {"+".join(true): own}
    for name, (_, one, other) in sorted(looks.items(), key=lambda item: item[1][0])[:_PAIRS]:
        found[name] = _best(data, EFFECTS[other], kind, fits[one]).log_evidence
    return found
