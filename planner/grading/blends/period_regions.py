"""What a plan says of bands that take turns."""

from collections.abc import Sequence
from dataclasses import replace

from planner.grading.bands import Band
from planner.grading.blends.blend_interval import blend_interval_MPa
from planner.grading.blends.periods import Period
from planner.grading.stiffness_scale import StiffnessScale
from planner.plan import Region

__all__ = ["with_periods"]


def with_periods(
    regions: Sequence[Region], steps: Sequence[tuple[Band, Period | None]], scale: StiffnessScale
) -> tuple[Region, ...]:
    """Say of each thin band which period it belongs to, and what that comes to in series."""
    periods = {(band.start, band.stop): period for band, period in steps}
    found = []
    for region in regions:
        period = periods[region.field]
        if period is None or period.share in (0.0, 1.0):
            found.append(region)
            continue
        low, high = period.target_MPa
        blend = {
            "kind": "bands",
            "lower": scale.palette.materials[period.lower].id,
            "upper": scale.palette.materials[period.upper].id,
            "field": [period.start, period.stop],
            "share": period.share,
        }
        found.append(
            replace(
                region,
                modulus_MPa=period.modulus_MPa,
                modulus_interval_MPa=blend_interval_MPa(
                    scale, period.lower, period.upper, period.modulus_MPa, 0.0
                ),
                error=(period.modulus_MPa / high - 1.0, period.modulus_MPa / low - 1.0),
                blend=blend,
            )
        )
    return tuple(found)
