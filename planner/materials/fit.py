"""Fit laws to specimens by variable projection, and choose one."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from planner.errors import ArgumentError
from planner.materials.characterise import Curve
from planner.materials.laws import SeparableLaw
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import LawParameters

__all__ = [
    "RELATIVE_FLOOR",
    "STARTS",
    "WEIGHTINGS",
    "Choice",
    "Held",
    "LawCandidate",
    "LawFit",
    "Sample",
    "choose_law",
    "fit_law",
    "law_stress_MPa",
    "minimise",
    "sample_of",
    "unstable_strain",
]


# ------------------------------------------------------------------------------------------------
# The points that a law is fitted to: every specimen counts once, whatever its sampling rate.


WEIGHTINGS = ("relative", "absolute")

RELATIVE_FLOOR = 0.05
"""Share of the largest stress under which a relative residual stops growing: near zero stress
the load cell's noise, not the law, would decide."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Points of one material's specimens, with weights that sum to one.

    The cost of a law is ``sum w_i ((P(l_i) - P_i) / s_i)^2``, the mean square of the residual
    over the scale s: dimensionless, so that stiff and soft materials are judged alike.

    Attributes
    ----------
    stretch, stress_MPa
        Shape (n,).
    scale_MPa
        Shape (n,): hypot(stress, floor) for relative weighting, the root mean square stress for
        absolute weighting.
    weight
        Shape (n,): equal within a specimen; each specimen has the same sum.
    specimen
        Shape (n,), the specimen's number from zero.
    """

    stretch: FloatArray
    stress_MPa: FloatArray
    scale_MPa: FloatArray
    weight: FloatArray
    specimen: IntArray

    @property
    def specimens(self) -> int:
        """Number of specimens."""
        return len(np.unique(self.specimen))

    @property
    def factor(self) -> FloatArray:
        """Multiplier of a residual in MPa under which the sum of squares is the cost."""
        return np.sqrt(self.weight) / self.scale_MPa

    def part(self, chosen: BoolArray) -> "Sample":
        """Return the points where `chosen` (n,) is true, weighed anew."""
        keep = chosen
        specimen = self.specimen[keep]
        return Sample(
            self.stretch[keep],
            self.stress_MPa[keep],
            self.scale_MPa[keep],
            _weights(specimen),
            specimen,
        )


def sample_of(
    curves: Sequence[Curve], *, weighting: str = "relative", points: int | None = 60
) -> Sample:
    """Resample the specimens' loading curves to points even in strain, and weigh them.

    Parameters
    ----------
    curves
        Replicates of one material, strain from rest, loading only.
    weighting
        "relative": residual over hypot(stress, `RELATIVE_FLOOR` of the largest stress);
        "absolute": residual over the root mean square stress of all points.
    points
        Means over this many bins of equal strain width a specimen (empty bins are left out);
        None takes the points as they are, each of a specimen with the same weight.

    Raises
    ------
    ArgumentError
        No curve, or a curve without tension.
    """
    if not curves:
        raise ArgumentError("no curve to fit a law to; give at least one specimen")
    stretch, stress, specimen = [], [], []
    for number, curve in enumerate(curves):
        tension = (curve.strain > 0.0) & np.isfinite(curve.stress_MPa)
        if tension.sum() < 3 or curve.stress_MPa[tension].max() <= 0.0:
            raise ArgumentError(
                f"specimen {curve.specimen}: fewer than 3 points in tension with a stress above "
                "zero; a law is fitted to strain from 0 upwards and tensile stress as positive"
            )
        x, y = curve.strain[tension], curve.stress_MPa[tension]
        if points is not None and len(x) > points:
            x, y = _bin_means(x, y, points)
        stretch.append(1.0 + x)
        stress.append(y)
        specimen.append(np.full(len(x), number))
    all_stress, numbers = np.concatenate(stress), np.concatenate(specimen)
    weight = _weights(numbers)
    if weighting == "relative":
        scale = np.hypot(all_stress, RELATIVE_FLOOR * all_stress.max())
    else:
        scale = np.full(len(all_stress), np.sqrt((weight * all_stress**2).sum()))
    return Sample(np.concatenate(stretch), all_stress, scale, weight, numbers)


def _bin_means(x: FloatArray, y: FloatArray, bins: int) -> tuple[FloatArray, FloatArray]:
    index = np.minimum((x / x.max() * bins).astype(np.int64), bins - 1)
    count = np.bincount(index, minlength=bins)
    used = count > 0
    sums = (np.bincount(index, values, minlength=bins)[used] for values in (x, y))
    mean_x, mean_y = (s / count[used] for s in sums)
    return mean_x, mean_y


def _weights(specimen: IntArray) -> FloatArray:
    numbers, inverse, count = np.unique(specimen, return_inverse=True, return_counts=True)
    out: FloatArray = 1.0 / (count[inverse] * len(numbers))
    return out


# ------------------------------------------------------------------------------------------------
# Variable projection: separable least squares from many starts at once.
#
# The residual of ``P = sum_j c_j phi_j(a_j)`` is minimised over c exactly at each a, which leaves a
# search over a alone: fewer dimensions, better conditioned, and no start values for c. The Jacobian
# is Kaufman's, whose gradient is exact (G. Golub and V. Pereyra 1973; L. Kaufman 1975). All starts
# go through Levenberg-Marquardt together as one batch of arrays.


_CONVERGED_GRADIENT = 1e-6
"""Largest cosine between the residual and a direction of search that counts as converged."""

_RIDGE = 1e-4
"""Weight of the terms' own sizes, as shares of the stress, beside the relative residual. It does
nothing where terms differ; where two coincide it keeps them from growing to many times the stress
and cancelling: tests do not determine such pairs, and they would make figures of noise."""

_ITERATIONS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Solutions:
    """Where each start ended.

    Attributes
    ----------
    a, c
        Nonlinear parameters (s, q) and linear coefficients (s, p), held ones as they were given.
    cost
        Shape (s,): the sample's mean square relative residual, with the ridge's part.
    gradient
        Shape (s,): largest cosine between the residual and a free direction of search.
    converged
        Shape (s,): gradient below `_CONVERGED_GRADIENT`, or no step lowers the cost any more.
    """

    a: FloatArray
    c: FloatArray
    cost: FloatArray
    gradient: FloatArray
    converged: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Parameters that a search leaves alone, one row a start.

    Attributes
    ----------
    a
        Shape (s, q): true where the nonlinear parameter stays at its start.
    c
        Shape (s, p): where a coefficient is held, its value in the file's terms (see
        `SeparableLaw.divisor`); NaN where it is free.
    """

    a: BoolArray
    c: FloatArray


def spread_starts(law: SeparableLaw, sample: Sample, count: int, shift: float = 0.5) -> FloatArray:
    """Return `count` starts spread evenly over the bounds, shape (count, q).

    A Kronecker sequence with the generalised golden ratio (M. Roberts 2018); `shift` in 0..1
    moves the whole pattern, as a seed would.
    """
    q = law.nonlinear
    if q == 0:
        return np.empty((1, 0))
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (q + 1))
    steps = ratio ** -np.arange(1.0, q + 1)
    fraction = (shift + np.arange(1, count + 1)[:, None] * steps) % 1.0
    return law.start(fraction, float(sample.stretch.max()))


def minimise(
    law: SeparableLaw,
    sample: Sample,
    starts: FloatArray,
    held: Held | None = None,
    flat: float = 1e-14,
) -> Solutions:
    """Minimise the sample's cost over a law's parameters from each start.

    Parameters
    ----------
    starts
        Nonlinear parameters, shape (s, q).
    held
        Parameters left alone, for profiles.
    flat
        Share of the cost that a step has to gain for a search to go on.
    """
    problem = _Problem(law, sample)
    low, high = law.bounds(float(sample.stretch.max())).T
    a = np.clip(starts, low, high)
    s, q = a.shape
    held_a = np.zeros((s, q), dtype=bool) if held is None else held.a
    held_c = np.full((s, law.columns), np.nan) if held is None else held.c
    state = problem.project(a, held_c)
    damping = np.full(s, 1e-2)
    gradient = np.zeros(s)
    converged = np.full(s, q == 0)
    active = np.flatnonzero(~converged)
    for _ in range(_ITERATIONS):
        if not len(active):
            break
        now = state.rows(active)
        at = a[active]
        slope = np.einsum("snk,sn->sk", now.jacobian, now.residual)
        stuck = held_a[active] | ((at <= low) & (slope > 0)) | ((at >= high) & (slope < 0))
        jacobian = np.where(stuck[:, None, :], 0.0, now.jacobian)
        slope = np.where(stuck, 0.0, slope)
        square = np.einsum("snk,snk->sk", jacobian, jacobian)
        length = np.sqrt(square * now.cost[:, None])
        cosine = np.abs(slope) / np.where(length > 0, length, 1.0)
        gradient[active] = cosine.max(axis=1)
        normal = np.einsum("snk,snl->skl", jacobian, jacobian)
        diagonal = np.where(square > 0, square, 1.0)
        normal[:, range(q), range(q)] = diagonal * (1.0 + damping[active])[:, None]
        step = -np.linalg.solve(normal, slope[:, :, None])[:, :, 0]
        trial = np.clip(at + step, low, high)
        after = problem.project(trial, held_c[active])
        better = after.cost < now.cost
        gained = now.cost - after.cost > flat * now.cost
        small = np.abs(trial - at).max(axis=1) <= 1e-10 * (1.0 + np.abs(at).max(axis=1))
        damping[active] *= np.where(better, 0.2, 5.0)
        damping[active] = np.maximum(damping[active], 1e-10)
        a[active] = np.where(better[:, None], trial, at)
        state.take(active[better], after.rows(np.flatnonzero(better)))
        done = (gradient[active] < _CONVERGED_GRADIENT) | (better & ~gained) | (~better & small)
        converged[active] |= done
        active = active[~done]
    return Solutions(a, state.coefficients, state.cost, gradient, converged)


class _State(NamedTuple):
    """What projecting at each candidate's a gives; one row a candidate."""

    coefficients: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    cost: FloatArray

    def rows(self, index: IntArray) -> "_State":
        return _State(*(values[index] for values in self))

    def take(self, index: IntArray, other: "_State") -> None:
        for values, new in zip(self, other, strict=True):
            values[index] = new


class _Problem:
    def __init__(self, law: SeparableLaw, sample: Sample) -> None:
        self.law = law
        self.stretch = sample.stretch
        self.factor = sample.factor
        self.target = sample.factor * sample.stress_MPa

    def project(self, a: FloatArray, held_c: FloatArray) -> _State:
        """Solve for the free coefficients at each a, and differentiate the residual by a."""
        phi, slope = self.law.evaluate(self.stretch, a)
        free = np.isnan(held_c)
        if not free.all():
            # A held coefficient is the file's: its column carries the divisor.
            divisor, divisor_slope = self.law.divisor(a)
            multiplier = np.where(free, 1.0, divisor)[:, None, :]
            if self.law.nonlinear:
                slope = slope * multiplier + phi * np.where(free, 0.0, divisor_slope)[:, None, :]
            phi = phi * multiplier
        phi = phi * self.factor[:, None]
        slope = slope * self.factor[:, None]
        given = np.where(free, 0.0, held_c)
        norm = np.where(free, np.sqrt(np.einsum("snp,snp->sp", phi, phi)), 1.0)
        unit = np.where(free[:, None, :], phi / norm[:, None, :], 0.0)
        target = self.target - np.einsum("snp,sp->sn", phi, given)
        s, n, p = unit.shape
        ridge = np.broadcast_to(_RIDGE * np.eye(p), (s, p, p))
        padded = np.concatenate([unit, ridge], axis=1)
        basis, triangle = np.linalg.qr(padded)
        inner = np.einsum("snp,sn->sp", basis[:, :n], target)
        shares = np.linalg.solve(triangle, inner[:, :, None])[:, :, 0]
        residual = np.einsum("snp,sp->sn", padded, shares)
        residual[:, :n] -= target
        jacobian = np.zeros((s, n + p, self.law.nonlinear))
        coefficients = np.where(free, shares / norm, given)
        if self.law.nonlinear:
            # A unit column turns, it does not grow: its change has no part along itself.
            change = slope * coefficients[:, None, :]
            change -= unit * np.einsum("snp,snp->sp", unit, change)[:, None, :]
            jacobian[:, :n] = change
            jacobian -= basis @ np.einsum("snp,snk->spk", basis[:, :n], change)
        return _State(coefficients, residual, jacobian, np.einsum("sn,sn->s", residual, residual))


# ------------------------------------------------------------------------------------------------
# Fit one law to one material's specimens, and say how well and how surely.


STARTS = 50
_AGREEMENT = 1e-3
"""Starts agree when their costs differ by less than this share."""

_ROUGH = 1e-5
"""Gain per step, as a share of the cost, at which a search is left; the lowest go on."""

_POLISHED = 5

_SIGNIFICANT_DIGITS = 5
"""Nonlinear parameters are rounded to this and the coefficients solved anew: what lies beyond
is neither determined by tests nor the same on every processor."""


@dataclass(frozen=True, slots=True)
class Convergence:
    """How a multi-start search ended.

    Attributes
    ----------
    starts, converged, agreeing
        Starts made; how many converged; how many ended within `_AGREEMENT` of the lowest cost.
    gradient
        Of the best start: largest cosine between the residual and a direction of search.
    at_bound
        Whether a nonlinear parameter of the best lies at its bound.
    """

    starts: int
    converged: int
    agreeing: int
    gradient: float
    at_bound: bool

    @property
    def ok(self) -> bool:
        """Whether the best start converged and, with several starts, another one agrees."""
        return self.converged > 0 and self.agreeing >= min(2, self.starts)


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """A fitted law.

    Attributes
    ----------
    parameters
        As a palette file holds them.
    a, c
        Nonlinear parameters (q,) and the law's coefficients (p,) in file terms.
    cost
        Mean square of the residual over its scale; see `Sample`.
    objective
        What was minimised: the cost with the ridge's part; see `planner.materials.fit`.
    r2, adjusted_r2
        Of nominal stress, each specimen with equal weight. The adjustment counts the resampled
        points, which are correlated: it flatters, and is no criterion of choice.
    nrmse
        Root mean square error over the largest stress.
    """

    law: SeparableLaw
    parameters: LawParameters
    a: FloatArray
    c: FloatArray
    cost: float
    objective: float
    r2: float
    adjusted_r2: float
    nrmse: float
    convergence: Convergence

    @property
    def name(self) -> str:
        """The model with its number of terms where there is a choice, as "ogden-2"."""
        terms = f"-{self.law.columns}" if self.law.model == "ogden" else ""
        return f"{self.law.model}{terms}"

    @property
    def parameter_count(self) -> int:
        """Number of fitted parameters."""
        return self.law.columns + self.law.nonlinear


def fit_law(
    law: SeparableLaw,
    sample: Sample,
    *,
    starts: int = STARTS,
    shift: float = 0.5,
    also: FloatArray | None = None,
) -> LawFit:
    """Fit a law by multi-start variable projection.

    Parameters
    ----------
    starts
        Number of starts spread over the bounds.
    shift
        Moves the pattern of starts; see `spread_starts`.
    also
        Further starts, shape (k, q).
    """
    spread = spread_starts(law, sample, starts, shift)
    if also is not None and law.nonlinear:
        spread = np.concatenate([spread, also])
    rough = minimise(law, sample, spread, flat=_ROUGH)
    lowest = np.argsort(rough.cost, kind="stable")[:_POLISHED]
    found = minimise(law, sample, rough.a[lowest])
    best = _best(found)
    a = _significant(np.sort(found.a[best]) if law.model == "ogden" else found.a[best])
    held = Held(np.ones((1, law.nonlinear), dtype=bool), np.full((1, law.columns), np.nan))
    final = minimise(law, sample, a[None], held)
    a = final.a[0]
    c = final.c[0] / law.divisor(final.a)[0][0]
    residual = law_stress_MPa(law, a, c, sample.stretch) - sample.stress_MPa
    mean = sample.weight @ sample.stress_MPa
    error = float(sample.weight @ residual**2)
    r2 = 1.0 - error / float(sample.weight @ (sample.stress_MPa - mean) ** 2)
    count, used = len(sample.stretch), law.columns + law.nonlinear
    low, high = law.bounds(float(sample.stretch.max())).T
    return LawFit(
        law=law,
        parameters=LawParameters(law.model, MappingProxyType(law.parameters(a, c))),
        a=a,
        c=c,
        cost=float(((sample.factor * residual) ** 2).sum()),
        objective=float(final.cost[0]),
        r2=r2,
        adjusted_r2=1.0 - (1.0 - r2) * (count - 1) / max(count - used - 1, 1),
        nrmse=float(np.sqrt(error) / sample.stress_MPa.max()),
        convergence=Convergence(
            starts=len(spread),
            converged=int(rough.converged.sum()),
            agreeing=int((rough.cost <= found.cost[best] * (1.0 + _AGREEMENT)).sum()),
            gradient=float(found.gradient[best]),
            at_bound=bool(np.any((a <= low * (1 + 1e-9)) | (a >= high * (1 - 1e-9))))
            if law.model != "ogden"
            else bool(np.any(np.abs(a) >= high - 1e-6)),
        ),
    )


def law_stress_MPa(
    law: SeparableLaw, a: FloatArray, c: FloatArray, stretch: FloatArray
) -> FloatArray:
    """Return nominal stress of a law with nonlinear parameters a (q,), file coefficients c (p,)."""
    phi, _ = law.evaluate(stretch, a[None])
    out: FloatArray = phi[0] @ (c * law.divisor(a[None])[0][0])
    return out


def _best(found: Solutions) -> int:
    """Return the start with the lowest cost; among equal ones that with the smallest exponents.

    Where a law has more terms than the tests determine, different parameters reach one cost.
    """
    equal = np.flatnonzero(found.cost <= found.cost.min() * (1.0 + 1e-6) + 1e-30)
    return int(equal[np.argmin(np.round(np.abs(found.a[equal]).sum(axis=1), 4))])


def _significant(values: FloatArray) -> FloatArray:
    return np.array([float(f"{v:.{_SIGNIFICANT_DIGITS}g}") for v in values])


# ------------------------------------------------------------------------------------------------
# Drucker's postulate in tension: the stress of a law must rise with the stretch.


_MARGIN = 0.1
"""Share of the working strain that the law must hold beyond each end of the working range."""

_POINTS = 801


def unstable_strain(fit: LawFit, working_strain: float, margin: float = _MARGIN) -> float | None:
    """Return the first strain, seen from rest, at which nominal stress does not rise, if any.

    For an incompressible law in uniaxial tension dP/dl > 0 with P >= 0 is more than Drucker's
    d(tau)/d(ln l) > 0, for tau = l P.

    Parameters
    ----------
    working_strain
        The working range is from rest to this strain; it is checked from ``-margin`` times it
        (not below ``-margin``) to ``1 + margin`` times it.
    """
    strain = np.linspace(
        -margin * min(working_strain, 1.0), (1.0 + margin) * working_strain, _POINTS
    )
    rises = np.diff(law_stress_MPa(fit.law, fit.a, fit.c, 1.0 + strain)) > 0.0
    falling = (0.5 * (strain[1:] + strain[:-1]))[~rises]
    return float(falling[np.argmin(np.abs(falling))]) if len(falling) else None


# ------------------------------------------------------------------------------------------------
# Choose a law by what it predicts of a specimen that took no part in the fit.


_FOLD_STARTS = 12
"""Starts of a fit with a specimen left out, beside the one at the whole fit."""

_BLOCKS = 7
"""Blocks along strain for a single specimen; the outer two are never left out, because a law is
not asked to extrapolate."""

_INDIFFERENT = 0.02
"""Share of the best held-out error that is no reason to take more parameters."""


@dataclass(frozen=True, slots=True, eq=False)
class LawCandidate:
    """A fitted law with the evidence for and against it.

    Attributes
    ----------
    unstable_strain
        See `unstable_strain`, over the working range.
    held_out
        Relative root mean square error on each specimen (or block) left out, shape (folds,).
    """

    fit: LawFit
    unstable_strain: float | None
    held_out: FloatArray

    @property
    def held_out_error(self) -> float:
        """Mean of the held-out errors."""
        return float(self.held_out.mean())


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The candidates and the one to use.

    Attributes
    ----------
    candidates
        In the order they were given.
    chosen
        None when every candidate is unstable in the working range.
    scheme
        What was left out in turn: "one specimen" or "one block of strain".
    reason
        Why the chosen one, in one sentence.
    """

    candidates: tuple[LawCandidate, ...]
    chosen: LawCandidate | None
    scheme: str
    reason: str


def choose_law(
    laws: Sequence[SeparableLaw],
    sample: Sample,
    working_strain: float,
    *,
    starts: int = STARTS,
    shift: float = 0.5,
) -> Choice:
    """Fit every law, leave one specimen out in turn, and choose.

    Among laws that are stable over the working range the fewest parameters win whose mean
    held-out error lies within one standard error of the best one's; the standard error is that
    of the paired difference, specimen by specimen, for the specimens' own scatter is common to
    all laws. With a single specimen blocks along strain are left out instead, which judges the
    law's shape but not the scatter between specimens.

    Raises
    ------
    ArgumentError
        The sample holds fewer points than the smallest law has parameters.
    """
    folds, scheme = _folds(sample)
    fits = [fit_law(law, sample, starts=starts, shift=shift) for law in laws]
    points = len(sample.stretch) - max(int(fold.sum()) for fold in folds)
    usable = [fit for fit in fits if fit.parameter_count < points]
    if not usable:
        raise ArgumentError(
            f"{points} points are too few to fit {', '.join(f.name for f in fits)} and test it "
            "on what is left out; measure more points or choose a law of fewer parameters"
        )
    candidates = tuple(
        LawCandidate(
            fit, unstable_strain(fit, working_strain), _held_out(fit, sample, folds, shift)
        )
        for fit in usable
    )
    stable = [c for c in candidates if c.unstable_strain is None]
    if not stable:
        return Choice(candidates, None, scheme, "no law's stress rises over the working range")
    best = min(stable, key=lambda c: c.held_out_error)
    near = [c for c in stable if _as_good(c, best)]
    chosen = min(near, key=lambda c: (c.fit.parameter_count, c.held_out_error))
    return Choice(candidates, chosen, scheme, _reason(chosen, best))


def _folds(sample: Sample) -> tuple[list[BoolArray], str]:
    """Return what is left out in turn; a specimen that nothing can be asked of is not."""
    if sample.specimens > 1:
        # The one that begins lowest can always be asked, so that at least one fold is left.
        folds = [sample.specimen == n for n in np.unique(sample.specimen)]
        return [fold for fold in folds if _asked(fold, sample).any()], "one specimen"
    rank = np.argsort(np.argsort(sample.stretch, kind="stable"), kind="stable")
    block = rank * _BLOCKS // len(rank)
    return [block == b for b in range(1, _BLOCKS - 1)], "one block of strain"


def _asked(fold: BoolArray, sample: Sample) -> BoolArray:
    """Return the points left out that lie within the others' strain.

    Beyond it would be extrapolation, which a palette never does.
    """
    asked: BoolArray = fold & (sample.stretch <= sample.stretch[~fold].max())
    return asked


def _held_out(fit: LawFit, sample: Sample, folds: Sequence[BoolArray], shift: float) -> FloatArray:
    errors = []
    for fold in folds:
        known = sample.part(~fold)
        again = fit_law(fit.law, known, starts=_FOLD_STARTS, shift=shift, also=fit.a[None])
        asked = sample.part(_asked(fold, sample))
        predicted = law_stress_MPa(fit.law, again.a, again.c, asked.stretch)
        error = (predicted - asked.stress_MPa) / asked.scale_MPa
        errors.append(np.sqrt(np.mean(error**2)))
    return np.array(errors)


def _as_good(candidate: LawCandidate, best: LawCandidate) -> bool:
    difference = candidate.held_out - best.held_out
    error = difference.std(ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
    return bool(difference.mean() <= max(error, _INDIFFERENT * best.held_out_error))


def _reason(chosen: LawCandidate, best: LawCandidate) -> str:
    error = f"{100 * chosen.held_out_error:.2g} %"
    if chosen is best:
        return f"{chosen.fit.name} has the lowest held-out error, {error}"
    return (
        f"{chosen.fit.name} (k = {chosen.fit.parameter_count}, held-out error {error}) is "
        f"as good as {best.fit.name} (k = {best.fit.parameter_count}, "
        f"{100 * best.held_out_error:.2g} %) within one standard error"
    )
