"""Whether a campaign can tell anything about an effect, and if not, why."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from planner.gap.campaign import Campaign
from planner.gap.conditions import TOLERANCES, levels
from planner.gap.effects.effect import Effect
from planner.gap.quality.motion import speed_mm_s, unloading_share
from planner.gap.quality.protocols import HOLDS, UNLOADS, hold_share
from planner.gap.specimen import Specimen

__all__ = ["untestable"]

_DECLARED_HOLDS = 0.5 * HOLDS
"""A test declared to hold may do so for less than one that was not meant to."""


def untestable(effect: Effect, campaign: Campaign) -> str | None:
    """Return why a campaign says nothing about an effect; None if it does say something.

    A covariate serves if it is known of two specimens or more and differs between them by more
    than replicates may. Unloading and holding are taken from the records.
    """
    for needed in (*effect.covariates, *effect.channels):
        reasons = [_missing(name, campaign.specimens) for name in needed.split("|")]
        if None not in reasons:
            return " and ".join(reason for reason in reasons if reason is not None)
    return None


def _missing(name: str, specimens: Sequence[Specimen]) -> str | None:
    channel = _CHANNELS.get(name)
    return _constant(name, specimens) if channel is None else channel(specimens)


def _constant(name: str, specimens: Sequence[Specimen]) -> str | None:
    """Say how a column fails to vary."""
    values = [_value(name, s) for s in specimens]
    known = [value for value in values if value is not None]
    if not known:
        return f"{name} is not known for any specimen"
    if _varies(name, known):
        return None
    first = known[0]
    was = first if isinstance(first, str) else f"{float(np.median(known)):.4g}"  # type: ignore[arg-type]
    if len(known) < len(values):
        return f"{name} is known for {len(known)} of {len(values)} specimens, and was {was} in them"
    return f"{name} was {was} in {'all specimens' if len(values) > 1 else 'the only specimen'}"


def _varies(name: str, known: Sequence[str | float]) -> bool:
    if any(isinstance(value, str) for value in known):
        return len(set(known)) > 1
    numbers = [float(value) for value in known]
    return max(level or 0 for level in levels(numbers, *TOLERANCES.get(name, (0.0, 0.0)))) > 0


def _value(name: str, specimen: Specimen) -> str | float | None:
    """Return a column's value; the rate is what the record shows, where it has a time."""
    if name == "rate_mm_s" and specimen.time_recorded:
        return speed_mm_s(specimen.time_s, specimen.displacement_mm)
    value: str | float | None = getattr(specimen, name, specimen.covariates.get(name))
    return value


def _no_unloading(specimens: Sequence[Specimen]) -> str | None:
    if any(unloading_share(s.displacement_mm, s.force_N) > UNLOADS for s in specimens):
        return None
    return "no specimen was unloaded"


def _no_hold(specimens: Sequence[Specimen]) -> str | None:
    least = {s.id: _DECLARED_HOLDS if s.protocol == "relaxation" else HOLDS for s in specimens}
    if any(hold_share(s) > least[s.id] for s in specimens):
        return None
    return "no specimen was held at a strain"


def _no_bar(specimens: Sequence[Specimen]) -> str | None:
    return None if any(_is_graded(s) for s in specimens) else "there is no graded bar"


def _one_material(specimens: Sequence[Specimen]) -> str | None:
    if any(_is_graded(s) for s in specimens):
        return None
    mixtures = {
        s.material if s.profile is None else float(s.profile.coordinate[0]) for s in specimens
    }
    return None if len(mixtures) > 1 else "there is one material only"


def _no_section(specimens: Sequence[Specimen]) -> str | None:
    if any(s.section_mm2(np.zeros(1)) is not None for s in specimens):
        return None
    return "width and thickness are not known for any specimen"


def _is_graded(specimen: Specimen) -> bool:
    return specimen.profile is not None and float(np.ptp(specimen.profile.coordinate)) > 1e-6


_CHANNELS: Mapping[str, Callable[[Sequence[Specimen]], str | None]] = MappingProxyType(
    {
        "unloading": _no_unloading,
        "hold": _no_hold,
        "bar": _no_bar,
        "materials": _one_material,
        "section": _no_section,
    }
)
