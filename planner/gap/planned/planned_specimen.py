"""Specimens that are yet to be tested, on the path that their protocol will take them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.gap.profile_design import ProfileDesign
from planner.gap.specimen import Specimen, StrainField
from planner.palette import Palette
from planner.simulation.protocol import loading_path

__all__ = ["BAR_SHARE", "HOLD_S", "FACET_mm", "planned_specimen", "planned_strain"]

HOLD_S = 240.0
"""How long relaxation holds."""

FACET_mm = 1.0
"""Between places at which a camera sees a bar's strain."""

_ROWS = 160
_FRAMES = 8
_STRAIN = 0.3
_BREAK_SHARE = 0.6
BAR_SHARE = 0.5
"""A bar is pulled less far than coupons: its soft end strains more than the bar does."""


def planned_strain(
    palette: Palette, materials: Sequence[str], profiles: Sequence[ProfileDesign] = ()
) -> float:
    """Return how far a campaign's coupons are pulled: the same strain for all, broken by none.

    Bars go half as far. One strain for all keeps it from going with the material.
    """
    breaks = [palette.resolve(name).elongation_at_break for name in materials]
    at = [m.coordinate for m in palette.materials]
    for design in profiles:
        ends = [m.elongation_at_break for m in palette.materials]
        breaks.append(float(np.interp(design.coordinate, at, ends).min()))
    return min([_STRAIN, *(_BREAK_SHARE * b for b in breaks)])


def planned_specimen(
    palette: Palette,
    *,
    id: str,
    gauge_mm: float,
    strain: float,
    hold_s: float = HOLD_S,
    camera: bool = False,
    **fields: Any,
) -> Specimen:
    """Return a specimen with the time and travel of its test; its force is a stand-in.

    The force is what keeps a record whole, rising with travel; whoever needs the truth predicts it.

    Parameters
    ----------
    strain
        How far a coupon is pulled; see `planned_strain`.
    camera
        Whether a bar's strain is seen along its axis.
    fields
        Of `Specimen`. Without `rate_mm_s` it is pulled at the palette's own strain rate.
    """
    rate = fields.get("rate_mm_s") or (palette.reference.strain_rate_per_s or 0.03) * gauge_mm
    design: ProfileDesign | None = fields.get("profile")
    protocol = fields.get("protocol") or "monotonic"
    end_mm = strain * gauge_mm * (1.0 if design is None else BAR_SHARE)
    path = loading_path(
        protocol,
        to_displacement_mm=end_mm,
        rate_mm_s=rate,
        steps=_ROWS if protocol == "monotonic" else _ROWS // 2,
        hold_s=hold_s,
    )
    seen = None
    if camera and design is not None:
        x = np.arange(0.5 * FACET_mm, gauge_mm, FACET_mm)
        last = int(np.argmax(path.displacement_mm))
        rows = np.unique(np.linspace(1, last, _FRAMES).astype(np.int64))
        local = np.repeat(path.displacement_mm[rows, None] / gauge_mm, len(x), axis=1)
        seen = StrainField(path.time_s[rows], x, local)
    return Specimen(
        id=id,
        time_s=path.time_s,
        displacement_mm=path.displacement_mm,
        force_N=path.displacement_mm / gauge_mm,
        gauge_mm=gauge_mm,
        strain_field=seen,
        **fields,
    )
