"""Effects that a palette's laws do not know, one a file."""

from collections.abc import Mapping
from types import MappingProxyType

from planner.gap.effects.ageing import EFFECT as AGEING
from planner.gap.effects.composition_offset import EFFECT as COMPOSITION_OFFSET
from planner.gap.effects.cross_section import EFFECT as CROSS_SECTION
from planner.gap.effects.effect import Apply, Effect, Form, Parameter, Stage, Values
from planner.gap.effects.force_offset import EFFECT as FORCE_OFFSET
from planner.gap.effects.force_scale import EFFECT as FORCE_SCALE
from planner.gap.effects.grip_slack import EFFECT as GRIP_SLACK
from planner.gap.effects.grip_slip import EFFECT as GRIP_SLIP
from planner.gap.effects.interface_bleed import EFFECT as INTERFACE_BLEED
from planner.gap.effects.machine_compliance import EFFECT as MACHINE_COMPLIANCE
from planner.gap.effects.material_law import EFFECT as MATERIAL_LAW
from planner.gap.effects.material_law import effect_for
from planner.gap.effects.moisture import EFFECT as MOISTURE
from planner.gap.effects.orientation import EFFECT as ORIENTATION
from planner.gap.effects.permanent_set import EFFECT as PERMANENT_SET
from planner.gap.effects.rate import EFFECT as RATE
from planner.gap.effects.skin import EFFECT as SKIN
from planner.gap.effects.softening import EFFECT as SOFTENING
from planner.gap.effects.strain_scale import EFFECT as STRAIN_SCALE
from planner.gap.effects.temperature import EFFECT as TEMPERATURE
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
