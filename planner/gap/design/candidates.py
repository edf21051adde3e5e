"""Conditions that a campaign may have: one step from the reference each, and a few crossed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from planner.errors import PaletteError
from planner.gap.effects.conditions_of_tests import STANDARD
from planner.gap.planned.planned_specimen import planned_specimen, planned_strain
from planner.gap.profile_design import ProfileDesign
from planner.gap.specimen import Specimen
from planner.palette import Material, Palette

__all__ = ["Size", "candidates_of", "may_take_bars", "strain_of"]

_Change = Mapping[str, Any]

_WARMER_K = (10.0, 17.0, -8.0)
_SOAKED_H = (4.0, 24.0, 72.0)
_OLDER_DAYS = (30.0, 110.0)
_FASTER = (10.0, 0.1)

_BY_EFFECT: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "ageing": ("age",),
        "composition-offset": ("materials", "bars"),
        "cross-section": ("section",),
        "force-offset": ("section", "rate"),
        "force-scale": ("section", "gauge"),
        "grip-slack": ("gauge", "cyclic"),
        "grip-slip": ("section", "gauge", "cyclic"),
        "interface-bleed": ("bars",),
        "machine-compliance": ("section", "gauge"),
        "material-law": ("materials",),
        "moisture": ("soak", "soak-section"),
        "orientation": ("orientation",),
        "permanent-set": ("cyclic",),
        "rate": ("rate", "relaxation"),
        "skin": ("section",),
        "softening": ("cyclic",),
        "strain-scale": ("gauge", "section", "bars"),
        "temperature": ("temperature",),
    }
)
"""What has to be changed to see an effect."""


@dataclass(frozen=True, slots=True)
class Size:
    """Of the usual specimen's gauge section."""

    width_mm: float = 6.0
    thickness_mm: float = 3.0
    gauge_mm: float = 25.0


def may_take_bars(effects: Sequence[str]) -> bool:
    """Return whether graded bars are among the candidates."""
    return any("bars" in _BY_EFFECT.get(id, ()) for id in effects)


def strain_of(palette: Palette) -> float:
    """Return how far coupons are pulled, whichever of the palette's elastic materials are chosen.

    Raises
    ------
    PaletteError
        The palette has no elastic material.
    """
    return planned_strain(palette, [m.id for m in _elastic(palette)])


def candidates_of(palette: Palette, effects: Sequence[str], size: Size) -> tuple[Specimen, ...]:
    """Return one planned specimen a condition, those at the palette's own conditions first.

    Every change is tried on the softest, a middle and the hardest elastic material, for effects
    may differ along the palette. Batches are left open.

    Raises
    ------
    PaletteError
        The palette has no elastic material.
    """
    grades = _elastic(palette)
    three = [grades[k] for k in dict.fromkeys([len(grades) // 2, 0, len(grades) - 1])]
    wanted = {group for id in effects for group in _BY_EFFECT[id]}
    changes: list[_Change] = [{"material": m.id} for m in three]
    if "materials" in wanted:
        changes += [{"material": m.id} for m in grades if m.id not in {t.id for t in three}]
    base = _reference(palette, size)
    for group in _GROUPS:
        if group in wanted:
            steps = _steps(group, base, palette, size)
            changes += [{"material": m.id, **step} for step in steps for m in three]
    for first, second in _CROSSED:
        if {first, second} <= wanted:
            a, b = (_steps(g, base, palette, size)[0] for g in (first, second))
            changes.append({"material": three[0].id, **a, **b})
    if "bars" in wanted and len(grades) > 1:
        changes += _bars(grades, size, crossed="rate" in wanted)
    strain = strain_of(palette)
    found = []
    for number, change in enumerate(changes):
        fields = {**base, **change}
        gauge = fields.pop("gauge_mm")
        if "rate_mm_s" not in change:  # a longer gauge, pulled at the same strain rate
            fields["rate_mm_s"] = _round(fields["rate_mm_s"] * gauge / size.gauge_mm)
        found.append(
            planned_specimen(
                palette, id=f"C{number:03d}", gauge_mm=gauge, strain=strain, camera=True, **fields
            )
        )
    return tuple(found)


_GROUPS = (
    "rate", "relaxation", "temperature", "soak", "age", "orientation", "section", "gauge",
    "cyclic", "soak-section",
)  # fmt: skip
_CROSSED = (
    ("rate", "temperature"), ("temperature", "soak"), ("age", "soak"), ("rate", "cyclic"),
    ("temperature", "cyclic"),
)  # fmt: skip


def _reference(palette: Palette, size: Size) -> dict[str, Any]:
    r = palette.reference
    rate = STANDARD["rate_per_s"] if r.strain_rate_per_s is None else r.strain_rate_per_s
    return {
        "width_mm": size.width_mm,
        "thickness_mm": size.thickness_mm,
        "gauge_mm": size.gauge_mm,
        "rate_mm_s": _round(rate * size.gauge_mm),
        "temperature_C": STANDARD["temperature_C"] if r.temperature_C is None else r.temperature_C,
        "soak_h": STANDARD["soak_h"] if r.soak_h is None else r.soak_h,
        "age_days": STANDARD["age_days"] if r.age_days is None else r.age_days,
        "orientation": r.orientation or "x",
        "protocol": "monotonic",
    }


def _steps(
    group: str, base: Mapping[str, Any], palette: Palette, size: Size
) -> list[dict[str, Any]]:
    """Return what to change of the reference, one step each."""
    match group:
        case "rate":
            return [{"rate_mm_s": _round(base["rate_mm_s"] * f)} for f in _FASTER]
        case "relaxation" | "cyclic":
            return [{"protocol": group}]
        case "temperature":
            return [{"temperature_C": base["temperature_C"] + k} for k in _WARMER_K]
        case "soak":
            return [{"soak_h": base["soak_h"] + h} for h in _SOAKED_H]
        case "soak-section":
            thin = {"thickness_mm": 0.5 * size.thickness_mm}
            return [{**thin, "soak_h": base["soak_h"] + _SOAKED_H[0]}, thin]
        case "age":
            return [{"age_days": base["age_days"] + d} for d in _OLDER_DAYS]
        case "orientation":
            return [{"orientation": o} for o in "zyx" if o != base["orientation"]]
        case "section":
            return [
                {"thickness_mm": 0.5 * size.thickness_mm},
                {"width_mm": _round(size.width_mm / 0.6)},
                {"width_mm": _round(0.6 * size.width_mm), "thickness_mm": 2.0 * size.thickness_mm},
            ]
        case "gauge":
            return [{"gauge_mm": _round(1.8 * size.gauge_mm)}]
    raise AssertionError(group)


def _bars(grades: Sequence[Material], size: Size, *, crossed: bool) -> list[_Change]:
    """Return bars of one step, of stripes, and of a ramp."""
    soft, middle, hard = (grades[k].coordinate for k in (0, len(grades) // 2, -1))
    gauge = size.gauge_mm
    half = np.array([0.0, 0.5, 0.5, 1.0]) * gauge
    edges = np.repeat(np.linspace(0.0, 1.0, 7), 2)[1:-1] * gauge
    designs = [
        ProfileDesign("step-middle-hard", half, np.repeat([middle, hard], 2)),
        ProfileDesign("step-soft-middle", half, np.repeat([soft, middle], 2)),
        ProfileDesign("stripes", edges, np.repeat([middle, hard] * 3, 2)),
        ProfileDesign("ramp", np.array([0.0, gauge]), np.array([soft, hard])),
    ]
    changes: list[_Change] = [{"profile": design} for design in designs]
    if crossed:
        changes.append({"profile": designs[0], "protocol": "relaxation"})
    return changes


def _elastic(palette: Palette) -> list[Material]:
    grades = [m for m in palette.materials if m.deformation == "elastic"]
    if not grades:
        raise PaletteError(
            f"palette {palette.name}: no elastic material; a campaign is planned for elastomers"
        )
    return grades


def _round(value: float) -> float:
    return float(f"{value:.3g}")
