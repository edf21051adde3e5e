"""Designs that cannot tell some effects apart, and which those are.

In each, every member of the class makes the same pattern, so that an honest answer names them all
and is sure of none. Truths are drawn from the class evenly.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.withheld.reality.design import Design, Levels, three_digits
from benchmarks.withheld.reality.effects import EFFECTS, Form, Shape

__all__ = ["ELSEWHERE", "SCENARIOS", "Member", "Scenario"]


@dataclass(frozen=True)
class Member:
    """One effect of a class: its form, and the part of its shape that the class needs."""

    effect: str
    form: str
    fixed: Shape

    def find(self) -> Form:
        """Return the form; a class takes it from whichever set has it."""
        effect = EFFECTS[self.effect]
        forms = [f for by_set in (effect.library, effect.other) for g in by_set.values() for f in g]
        return next(f for f in forms if f.name == self.form)


@dataclass(frozen=True)
class Scenario:
    """A restricted design and the class that it leaves.

    Attributes
    ----------
    restrict
        Of the full design, the levels and the palette's strain rate.
    """

    name: str
    restrict: Callable[[Design, Levels, float], Design]
    members: tuple[Member, ...]

    @property
    def confounded(self) -> list[str]:
        """Return the ids of the class, sorted."""
        return sorted(m.effect for m in self.members)


def _coupons(design: Design) -> Design:
    """Turn the bars into coupons like the first, so that the count stays."""
    rows = np.where(design.profile >= 0, int(np.argmax(design.profile < 0)), np.arange(len(design)))
    like = design.take(rows)
    return replace(
        like,
        number=design.number,
        batch=design.batch,
        operator=design.operator,
        tray_x_mm=design.tray_x_mm,
    )


def _filled(design: Design, **columns: float | str) -> Design:
    """Hold columns at one value; the rate follows the gauge."""
    rate_per_s = design.strain_rate_per_s
    held: Mapping[str, object] = {
        name: np.full(len(design), value) for name, value in columns.items()
    }
    changed = replace(design, **held)  # type: ignore[arg-type]  # columns by name
    if "rate_mm_s" not in columns:
        changed = replace(changed, rate_mm_s=three_digits(rate_per_s * changed.gauge_mm))
    return changed


def _one_strip(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """One soft, nearly linear grade, one section, one gauge length."""
    design = _coupons(design)
    width, thickness = levels.sections_mm[0]
    first = int(np.argmin(design.coordinate))
    return _filled(
        design,
        material=str(design.material[first]),
        coordinate=float(design.coordinate[first]),
        width_mm=width,
        thickness_mm=thickness,
        gauge_mm=levels.gauges_mm[0],
    )


def _old_when_soaked(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """What was soaked had lain about as well, and nothing else had."""
    design = _coupons(design)
    soaked = design.soak_h > levels.soaks_h[0]
    if not soaked.any():
        soaked = design.batch == design.batch[0]
    width, thickness = levels.sections_mm[0]
    design = _filled(design, width_mm=width, thickness_mm=thickness)
    return replace(
        design,
        soak_h=np.where(soaked, levels.soaks_h[-1], levels.soaks_h[0]),
        age_days=np.where(soaked, levels.ages_days[-1], levels.ages_days[0]),
    )


def _slow_when_warm(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """One grade, only pulled: the warm tests ran slowly, the others at the reference."""
    design = _one_strip(design, levels, rate_per_s)
    warm = design.temperature_C > levels.temperatures_C[0]
    if not warm.any():
        warm = design.batch == design.batch[0]
    design = _filled(design, protocol="monotonic")
    slow = min(levels.strain_rate_factors)
    rates_per_s = rate_per_s * np.where(warm, slow, 1.0)
    return replace(
        design,
        temperature_C=np.where(warm, max(levels.temperatures_C), levels.temperatures_C[0]),
        rate_mm_s=three_digits(rates_per_s * design.gauge_mm),
    )


def _only_pulled(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """One width, no unloading: what the grips lose and what the frame gives are both by force."""
    width, thickness = levels.sections_mm[0]
    return _filled(_coupons(design), width_mm=width, thickness_mm=thickness, protocol="monotonic")


def _all_warm(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """All tests warmer than the palette's, all else as it varies."""
    return _filled(design, temperature_C=max(levels.temperatures_C))


def _all_slow(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """All tests as much slower than the palette's."""
    slow = rate_per_s * min(levels.strain_rate_factors)
    return replace(design, rate_mm_s=three_digits(slow * design.gauge_mm))


def _all_soaked(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """All specimens soaked, the palette's dry."""
    return _filled(design, soak_h=levels.soaks_h[-1])


def _all_old(design: Design, levels: Levels, rate_per_s: float) -> Design:
    """All specimens older than the palette's."""
    return _filled(design, age_days=levels.ages_days[-1])


_FREE: Shape = {}
_LESS: Shape = {"sign": -1.0}

SCENARIOS: tuple[Scenario, ...] = (
    Scenario(
        "one-strip",
        _one_strip,
        (
            Member("cross-section", "oversize", _FREE),
            Member("force-scale", "gain", {"sign": 1.0}),
            Member("skin", "layer", {"sign": 1.0}),
            Member("material-law", "factor", {"sign": 1.0}),
            Member("composition-offset", "constant", {"sign": 1.0}),
            Member("strain-scale", "factor", _LESS),
        ),
    ),
    Scenario(
        "old-when-soaked",
        _old_when_soaked,
        (Member("ageing", "log-time", _LESS), Member("moisture", "root-time", _FREE)),
    ),
    Scenario(
        "slow-when-warm",
        _slow_when_warm,
        (Member("rate", "power", _FREE), Member("temperature", "exponential", _FREE)),
    ),
    Scenario(
        "only-pulled",
        _only_pulled,
        (
            Member("grip-slip", "power", {"power": 1.0}),
            Member("machine-compliance", "linear", _FREE),
        ),
    ),
)

_GAIN_DOWN = Member("force-scale", "gain", _LESS)

ELSEWHERE: tuple[Scenario, ...] = (
    Scenario("all-warm", _all_warm, (Member("temperature", "exponential", _FREE), _GAIN_DOWN)),
    Scenario("all-slow", _all_slow, (Member("rate", "power", _FREE), _GAIN_DOWN)),
    Scenario("all-soaked", _all_soaked, (Member("moisture", "root-time", _FREE), _GAIN_DOWN)),
    Scenario("all-old", _all_old, (Member("ageing", "log-time", _LESS), _GAIN_DOWN)),
)
"""Labs that test everything at another condition than the palette was measured at. A gain of force
looks nearly the same there, but that conditions act less on harder grades, or later in a test."""
