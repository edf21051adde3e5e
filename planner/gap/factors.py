"""What effects multiply the stress of materials by in use, and how sure that is far from tests."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from typing import TypeAlias

import numpy as np

from planner.gap.campaign import Campaign
from planner.gap.diagnosis import FoundEffect
from planner.gap.effect import Form, StatedEffect, with_effects
from planner.gap.virtual import single_tests, virtual_specimen
from planner.numerics import FloatArray
from planner.palette import Material, Palette, Reference
from planner.simulation.bar_solver import LawTables, Setup, law_tables, predict

__all__ = [
    "WORKING_STRAIN",
    "Factors",
    "Place",
    "breaks_share",
    "forms_sd",
    "intervals_sd",
    "working_strain",
]


# ------------------------------------------------------------------------------------------------
# Factors on stress: materials pulled at conditions, with effects and without.


_GAUGE_mm = 25.0
"""Of what is pulled. Convention: any would do, as pace and path are those of strain."""

_BREAK_SHARE = 0.95
"""How far a law is followed, of the elongation at break. Chosen: near the break, with no step
beyond it."""

Place: TypeAlias = tuple[Material, Reference]
"""A material, and the conditions it is pulled at, all of them known."""


def breaks_share(material: Material) -> float:
    """Return the strain that a law is followed to: near its break."""
    return _BREAK_SHARE * material.elongation_at_break


WORKING_STRAIN = 0.1
"""At which a factor is told, or at half the break of rigid grades. Convention: as the ladder of
stiffness is."""


def working_strain(material: Material) -> float:
    """Return the strain at which a factor is told."""
    return min(WORKING_STRAIN, 0.5 * material.elongation_at_break)


class Factors:
    """What effects multiply the stress of materials by, against the palette's own conditions.

    Parameters
    ----------
    places
        Materials and the conditions they are pulled at.
    own
        The palette's own conditions, at which effects of a condition change nothing.
    strain
        How far each material is pulled.
    steps
        Of the way there.
    """

    def __init__(
        self,
        palette: Palette,
        places: Sequence[Place],
        own: Reference,
        section_mm: tuple[float, float],
        strain: Callable[[Material], float],
        steps: int,
    ) -> None:
        self.strain: FloatArray = np.stack(
            [strain(m) * np.linspace(0.0, 1.0, steps + 1) for m, _ in places]
        )
        self._laws: LawTables = law_tables(palette)
        self._used = _pulled(palette, places, section_mm, self.strain)
        self._own = _pulled(palette, [(m, own) for m, _ in places], section_mm, self.strain)

    def log(self, effects: Sequence[StatedEffect]) -> FloatArray:
        """Return ln factor at the strains above 0 of every place, (P, steps); NaN where it is none.

        An effect of a condition acts at the palette's own conditions too: its law was measured
        with it.
        """
        ours = [e for e in effects if e.effect.condition]
        after = predict(with_effects(self._used, effects), self._laws).force_N
        before = predict(with_effects(self._own, ours), self._laws).force_N
        with np.errstate(all="ignore"):
            log: FloatArray = np.log(after[:, 1:] / before[:, 1:])
        return np.where(np.isfinite(log), log, np.nan)


def _pulled(
    palette: Palette, places: Sequence[Place], section_mm: tuple[float, float], strain: FloatArray
) -> Setup:
    specimens, times = [], []
    for number, ((material, at), strains) in enumerate(zip(places, strain, strict=True)):
        conditions = asdict(at)
        rate_per_s = conditions.pop("strain_rate_per_s")
        times.append(strains / rate_per_s)
        specimens.append(
            virtual_specimen(
                palette,
                id=f"{number}",
                gauge_mm=_GAUGE_mm,
                strain=float(strains[-1]),
                material=material.id,
                width_mm=section_mm[0],
                thickness_mm=section_mm[1],
                rate_mm_s=rate_per_s * _GAUGE_mm,
                **conditions,
            )
        )
    campaign = Campaign("use", "", palette, tuple(specimens))
    setup = single_tests(campaign, range(len(places)), np.stack(times), strain * _GAUGE_mm)
    assert setup is not None
    return setup


# ------------------------------------------------------------------------------------------------
# How sure a factor is: by the intervals of its parameters, and by the forms that fit as well.


_INTERVAL_SD = 2.0 * 1.645
"""Width of a 90 % interval in standard deviations. Convention: of a normal distribution."""

_GRID = 7
"""Values of each parameter of shape. Numerical: a seventh of its prior is finer than tests
resolve."""

_ROUNDS = 4
"""In which a size is scaled to the tests, at most. Numerical: ln factor is nearly proportional to
the size, so that each round leaves a small share of the error; 1e-4 ends them."""


def intervals_sd(
    factors: Factors, found: Sequence[FoundEffect], effects: Sequence[StatedEffect]
) -> FloatArray:
    """Return the deviation of the mean ln factor of every place, from the parameters' intervals."""
    total = np.zeros(len(factors.strain))
    for number, (one, effect) in enumerate(zip(found, effects, strict=True)):
        for name, ends in one.interval.items():
            if name not in one.parameters or not all(map(math.isfinite, ends)):
                continue
            low, high = (
                factors.log(
                    [*effects[:number], _with(effect, name, end), *effects[number + 1 :]]
                ).mean(axis=1)
                for end in ends
            )
            total += ((high - low) / _INTERVAL_SD) ** 2
    return np.sqrt(total)


def _with(effect: StatedEffect, name: str, value: float) -> StatedEffect:
    return replace(effect, values={**effect.values, name: value})


def forms_sd(factors: Factors, effect: StatedEffect, tests: int, sd: float) -> FloatArray:
    """Return how far the forms of an effect part that fit the tests as well, (P - tests,).

    What the form found says of the tests stands for the tests. Every form, in every shape on a
    grid over its prior, is given the size that comes nearest to that; a shape weighs
    ``exp(-chi² / 2)`` within its form, a form as its best shape does: that tests do not tell two
    forms apart is no reason to believe the simpler one elsewhere. What is returned is the root
    mean square of how far they are from the form found at the places that follow the tests. It is
    small among the tests, and grows away from them as physics that they cannot tell apart parts.

    Parameters
    ----------
    factors
        Of the places tested, then of those asked for.
    tests
        How many are tested.
    sd
        Of ln stress: what a form may be off by at each test.
    """
    found = _at_end(factors, effect)
    total, weight = np.zeros(len(found) - tests), 0.0
    for form in effect.effect.forms:
        tried = (_fitted(factors, start, found, tests, sd) for start in _starts(form, effect))
        fits = [fit for fit in tried if fit is not None]
        if form.name == effect.form.name:
            fits.append((0.0, found))
        if fits:
            each = np.exp([log_weight for log_weight, _ in fits])
            off = np.stack([log[tests:] - found[tests:] for _, log in fits])
            best = form.weight * float(each.max())
            total += best * (each @ off**2) / max(float(each.sum()), 1e-300)
            weight += best
    return np.sqrt(total / weight)


def _starts(form: Form, effect: StatedEffect) -> Iterator[StatedEffect]:
    """Yield the form in every shape of the grid, at the usual size."""
    size, *shapes = form.parameters
    middles = (np.arange(_GRID) + 0.5) / _GRID
    for values in itertools.product(*([p.at(share) for share in middles] for p in shapes)):
        shape = dict(zip((p.name for p in shapes), values, strict=True))
        yield replace(effect, form=form, values={size.name: size.usual, **shape})


def _fitted(
    factors: Factors, one: StatedEffect, found: FloatArray, tests: int, sd: float
) -> tuple[float, FloatArray] | None:
    """Return ln of the weight and of the factors of a form at the size nearest to the tests.

    None where it does not show in them, or leaves no stress. ln factor is nearly proportional to
    the size, so that scaling it by the ratio of the two sets of logarithms converges.
    """
    size = one.form.size
    lowest = -size.high if size.signed else 0.0
    for _ in range(_ROUNDS):
        log = _at_end(factors, one)
        there, value = log[:tests], one.values[size.name]
        norm = float(there @ there)
        if not (np.isfinite(log).all() and norm > 0.0):
            return None
        better = min(max(value * float(there @ found[:tests]) / norm, lowest), size.high)
        if abs(better - value) < 1e-4 * abs(value):
            break
        if better == 0.0:
            log = np.zeros_like(log)
            break
        one = _with(one, size.name, better)
    chi2 = float(np.sum(((log[:tests] - found[:tests]) / sd) ** 2))
    return -0.5 * chi2, log


def _at_end(factors: Factors, one: StatedEffect) -> FloatArray:
    return np.asarray(factors.log([one])[:, -1])
