"""The bench's effects by id."""

from benchmarks.withheld.reality.effects import (
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
    unclaimed,
)
from benchmarks.withheld.reality.effects.form import Effect, Form, Set, Shape

__all__ = ["EFFECTS", "UNCLAIMED", "Effect", "Form", "Set", "Shape"]

EFFECTS: dict[str, Effect] = {
    effect.id: effect
    for effect in (
        ageing.EFFECT,
        composition_offset.EFFECT,
        cross_section.EFFECT,
        force_offset.EFFECT,
        force_scale.EFFECT,
        grip_slack.EFFECT,
        grip_slip.EFFECT,
        interface_bleed.EFFECT,
        machine_compliance.EFFECT,
        material_law.EFFECT,
        moisture.EFFECT,
        orientation.EFFECT,
        permanent_set.EFFECT,
        rate.EFFECT,
        skin.EFFECT,
        softening.EFFECT,
        strain_scale.EFFECT,
        temperature.EFFECT,
    )
}
"""Those of the contract, section 5."""

UNCLAIMED: dict[str, Effect] = {e.id: e for e in (unclaimed.OPERATOR, unclaimed.TRAY)}
"""Those that lie along a column no effect claims."""
