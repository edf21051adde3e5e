"""Choose a law by what it predicts of a specimen that took no part in the fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.errors import ArgumentError
from planner.materials.fit.law_fit import STARTS, LawFit, fit_law, law_stress_MPa
from planner.materials.fit.sample import Sample
from planner.materials.fit.separable import SeparableLaw
from planner.materials.fit.stability import Stability, stability

__all__ = ["Candidate", "Choice", "choose_law"]

FOLD_STARTS = 12
"""Starts of a fit with a specimen left out, beside the one at the whole fit."""

BLOCKS = 7
"""Blocks along strain for a single specimen; the outer two are never left out, because a law is
not asked to extrapolate."""

INDIFFERENT = 0.02
"""Share of the best held-out error that is no reason to take more parameters."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A fitted law with the evidence for and against it.

    Attributes
    ----------
    held_out
        Relative root mean square error on each specimen (or block) left out, shape (folds,).
    """

    fit: LawFit
    stability: Stability
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

    candidates: tuple[Candidate, ...]
    chosen: Candidate | None
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
        Candidate(fit, stability(fit, working_strain), _held_out(fit, sample, folds, shift))
        for fit in usable
    )
    stable = [c for c in candidates if c.stability.stable]
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
    block = rank * BLOCKS // len(rank)
    return [block == b for b in range(1, BLOCKS - 1)], "one block of strain"


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
        again = fit_law(fit.law, known, starts=FOLD_STARTS, shift=shift, also=fit.a[None])
        asked = sample.part(_asked(fold, sample))
        predicted = law_stress_MPa(fit.law, again.a, again.c, asked.stretch)
        error = (predicted - asked.stress_MPa) / asked.scale_MPa
        errors.append(np.sqrt(np.mean(error**2)))
    return np.array(errors)


def _as_good(candidate: Candidate, best: Candidate) -> bool:
    difference = candidate.held_out - best.held_out
    error = difference.std(ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
    return bool(difference.mean() <= max(error, INDIFFERENT * best.held_out_error))


def _reason(chosen: Candidate, best: Candidate) -> str:
    error = f"{100 * chosen.held_out_error:.2g} %"
    if chosen is best:
        return f"{chosen.fit.name} has the lowest held-out error, {error}"
    return (
        f"{chosen.fit.name} (k = {chosen.fit.parameter_count}, held-out error {error}) is "
        f"as good as {best.fit.name} (k = {best.fit.parameter_count}, "
        f"{100 * best.held_out_error:.2g} %) within one standard error"
    )
