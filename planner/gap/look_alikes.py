"""Effects that could not be tested, but would show where the verdict's effects do."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from planner.gap.diagnosis import Untestable
from planner.gap.effects import EFFECTS

__all__ = ["look_alikes"]

_TESTS: Mapping[str, str] = MappingProxyType(
    {
        "rate_mm_s": "test at two speeds that differ tenfold, and write rate_mm_s down",
        "hold": "hold a specimen at a strain",
        "temperature_C": "test at two temperatures 10 K apart, and write temperature_C down",
        "soak_h": "test specimens soaked for a day and dry ones, and write soak_h down",
        "age_days": "test specimens of two ages weeks apart, and write age_days down",
        "orientation": "print specimens along two directions, and write orientation down",
        "materials": "test a second material of the palette",
        "section": "measure width and thickness",
    }
)
"""What makes a covariate or channel serve."""

_NEVER_THERE = frozenset({"unloading", "bar"})
"""Channels without which an effect does not act: what was never unloaded has no set, what was
printed of one material no boundary."""


def look_alikes(effects: Sequence[str], not_testable: Sequence[Untestable]) -> tuple[str, ...]:
    """Return a sentence for each effect that may be the cause in place of the verdict's.

    Such an effect could not be tested, so that no evidence speaks for or against it, and shows
    along an axis along which one of the verdict's effects shows as well.

    Parameters
    ----------
    effects
        The verdict's, by id; an "unknown" has no axes of its own and resembles nothing.
    """
    return tuple(sentence for u in not_testable if (sentence := _sentence(u, effects)) is not None)


def _sentence(untestable: Untestable, effects: Sequence[str]) -> str | None:
    other = EFFECTS[untestable.id]
    needs = (*other.covariates, *other.channels)
    if _NEVER_THERE & set(needs):
        return None
    alike = [id for id in effects if id in EFFECTS and set(EFFECTS[id].where) & set(other.where)]
    if not alike:
        return None
    axes = [axis for axis in other.where if any(axis in EFFECTS[id].where for id in alike)]
    tests = " and ".join(", or ".join(_TESTS[n] for n in need.split("|")) for need in needs)
    settle = f"; to settle it, {tests}" if tests else ""
    return (
        f"{other.id} could not be tested ({untestable.reason}), but shows along "
        f"{' and '.join(axes)} as {' and '.join(alike)} {'do' if len(alike) > 1 else 'does'}, and "
        f"may be the cause instead, or a part of it{settle}"
    )
