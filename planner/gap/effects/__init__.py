"""Effects that a palette's laws do not know, one a file."""

from collections.abc import Mapping
from types import MappingProxyType

from planner.gap.effects import (
    ageing,
    composition_offset,
    cross_section,
    force_offset,
    force_scale,
    grip_slack,
    grip_slip,
    interface_bleed,
    machine_compliance,
    material_law,
    moisture,
    orientation,
    permanent_set,
    rate,
    skin,
    softening,
    strain_scale,
    temperature,
)
from planner.gap.effects.effect import Apply, Effect, Form, Parameter, Stage, Values
from planner.gap.effects.testable import untestable
from planner.palette import Palette

__all__ = [
    "EFFECTS",
    "Apply",
    "Effect",
    "Form",
    "Parameter",
    "Stage",
    "Values",
    "effects_for",
    "untestable",
]

_MODULES = (
    ageing, composition_offset, cross_section, force_offset, force_scale, grip_slack, grip_slip,
    interface_bleed, machine_compliance, material_law, moisture, orientation, permanent_set, rate,
    skin, softening, strain_scale, temperature,
)  # fmt: skip

EFFECTS: Mapping[str, Effect] = MappingProxyType(
    dict(sorted((module.EFFECT.id, module.EFFECT) for module in _MODULES))
)
"""Every effect by its id, sorted; `material-law` stands for that of a palette of three."""


def effects_for(palette: Palette) -> Mapping[str, Effect]:
    """Return every effect by its id, sorted, with the forms of a palette's own materials."""
    materials = palette.materials
    own = material_law.effect_for([m.coordinate for m in materials], [m.id for m in materials])
    return MappingProxyType({**EFFECTS, own.id: own})
