"""Effects that a palette's laws do not know: of the print, of conditions, of the test."""

from collections.abc import Mapping
from types import MappingProxyType

from planner.errors import UnknownNameError, did_you_mean
from planner.gap.effect import Effect
from planner.gap.effects.conditions import (
    AGEING,
    MOISTURE,
    PERMANENT_SET,
    RATE,
    SOFTENING,
    TEMPERATURE,
)
from planner.gap.effects.print import (
    COMPOSITION_OFFSET,
    CROSS_SECTION,
    INTERFACE_BLEED,
    MATERIAL_LAW,
    ORIENTATION,
    SKIN,
    effect_for,
)
from planner.gap.effects.test import (
    FORCE_OFFSET,
    FORCE_SCALE,
    GRIP_SLACK,
    GRIP_SLIP,
    MACHINE_COMPLIANCE,
    STRAIN_SCALE,
)
from planner.palette import Palette

__all__ = ["EFFECTS", "effect_named", "effects_for"]


_ALL = (
    AGEING,
    COMPOSITION_OFFSET,
    CROSS_SECTION,
    FORCE_OFFSET,
    FORCE_SCALE,
    GRIP_SLACK,
    GRIP_SLIP,
    INTERFACE_BLEED,
    MACHINE_COMPLIANCE,
    MATERIAL_LAW,
    MOISTURE,
    ORIENTATION,
    PERMANENT_SET,
    RATE,
    SKIN,
    SOFTENING,
    STRAIN_SCALE,
    TEMPERATURE,
)

EFFECTS: Mapping[str, Effect] = MappingProxyType(
    {effect.id: effect for effect in sorted(_ALL, key=lambda e: e.id)}
)
"""Every effect by its id, sorted; `material-law` stands for that of a palette of three."""


def effects_for(palette: Palette) -> Mapping[str, Effect]:
    """Return every effect by its id, sorted, with the forms of a palette's own materials."""
    materials = palette.materials
    own = effect_for([m.coordinate for m in materials], [m.id for m in materials])
    return MappingProxyType({**EFFECTS, own.id: own})


def effect_named(id: str, effects: Mapping[str, Effect], option: str) -> Effect:
    """Return an effect by its id.

    Raises
    ------
    UnknownNameError
        There is none; the message names what is near.
    """
    if id in effects:
        return effects[id]
    raise UnknownNameError(
        f"{option} {id}: no such effect; {did_you_mean(id, effects)}there are {', '.join(effects)}"
    )
