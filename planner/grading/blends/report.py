"""What a plan says of regions that meet their target together with a neighbour."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from planner.grading.bands import Band
from planner.grading.blends.dither import DealtField, Expected
from planner.grading.blends.periods import Period
from planner.grading.stiffness_scale import StiffnessScale
from planner.materials.homogenisation.bounds import (
    hashin_shtrikman_MPa,
    reuss_MPa,
    voigt_MPa,
)
from planner.materials.homogenisation.dithered import (
    dither_table,
    dithered_fraction,
    dithered_modulus_MPa,
)
from planner.plan import Check, Region

__all__ = ["fraction_check", "with_dither", "with_periods"]

_SHARE_ERROR = 0.01  # of the volume: graded cells against those of an even fraction


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
                modulus_interval_MPa=_interval(
                    scale, period.lower, period.upper, period.modulus_MPa, 0.0
                ),
                error=(period.modulus_MPa / high - 1.0, period.modulus_MPa / low - 1.0),
                blend=blend,
            )
        )
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Share:
    achieved: float
    wanted: float
    cells: float


def with_dither(
    regions: Sequence[Region], dealt: DealtField, foreseen: Expected, scale: StiffnessScale
) -> tuple[Region, ...]:
    """Say of each dealt region what its stretch comes to, from the volumes of its two materials.

    The modulus is that of the stretch at its mean fraction; the error is that of the estimate,
    because the fraction follows the target within the stretch.
    """
    shares = _shares(regions, dealt, foreseen, scale)
    found = []
    for region in regions:
        number = _stretch_of(region, dealt)
        stretch = dealt.along[number]
        if stretch.lower == stretch.upper:
            found.append(region)
            continue
        soft, hard = scale.moduli_MPa[stretch.lower], scale.moduli_MPa[stretch.upper]
        share = shares[number]
        modulus = float(dithered_modulus_MPa(soft, hard, share.achieved))
        low, high = hashin_shtrikman_MPa(soft, hard, share.achieved)
        ends = dithered_fraction(soft, hard, np.array(stretch.ends_MPa))
        error = dither_table().error_at(hard / soft)
        blend: dict[str, Any] = {
            "kind": "dither",
            "lower": scale.palette.materials[stretch.lower].id,
            "upper": scale.palette.materials[stretch.upper].id,
            "moduli_MPa": [soft, hard],
            "fraction": [round(float(f), 6) for f in ends],
            "volume_fraction": share.achieved,
            "volume_fraction_wanted": share.wanted,
            "cell_mm": dealt.cell_mm,
            "bounds_MPa": [float(low), float(high)],
            "voigt_MPa": float(voigt_MPa(soft, hard, share.achieved)),
            "reuss_MPa": float(reuss_MPa(soft, hard, share.achieved)),
            "estimate_error": error,
        }
        found.append(
            replace(
                region,
                modulus_MPa=modulus,
                modulus_interval_MPa=_interval(scale, stretch.lower, stretch.upper, modulus, error),
                error=(-error, error),
                blend=blend,
            )
        )
    return tuple(found)


def fraction_check(
    regions: Sequence[Region], dealt: DealtField, foreseen: Expected, scale: StiffnessScale
) -> Check:
    """Hold the achieved volume fractions against those wanted, over each stretch.

    The limit is 0.01 and what chance leaves of few cells: the error of the worst stretch is given
    as a share of its own limit.
    """
    worst = 0.0
    for share in _shares(regions, dealt, foreseen, scale).values():
        limit = _SHARE_ERROR + 1.0 / max(share.cells, 1.0) ** (2.0 / 3.0)
        worst = max(worst, abs(share.achieved - share.wanted) / limit)
    return Check(worst, 1.0, worst <= 1.0)


def _shares(
    regions: Sequence[Region], dealt: DealtField, foreseen: Expected, scale: StiffnessScale
) -> dict[int, _Share]:
    volumes: dict[int, list[float]] = {}
    for region in regions:
        number = _stretch_of(region, dealt)
        stretch = dealt.along[number]
        if stretch.lower < stretch.upper:
            of_harder = region.material == scale.palette.materials[stretch.upper].id
            volumes.setdefault(number, [0.0, 0.0])[int(of_harder)] += region.volume_mm3
    found = {}
    for number, (soft, hard) in volumes.items():
        achieved = hard / (soft + hard)
        wanted = float(foreseen.fraction[number])
        wanted = achieved if math.isnan(wanted) else wanted
        found[number] = _Share(achieved, wanted, float(foreseen.cells[number]))
    return found


def _stretch_of(region: Region, dealt: DealtField) -> int:
    starts = [stretch.start for stretch in dealt.along]
    return starts.index(region.field[0])


def _interval(
    scale: StiffnessScale, lower: int, upper: int, modulus_MPa: float, error: float
) -> tuple[float, float]:
    """Return the 95 % interval of a blend: its materials' errors go together, as in planning.

    The larger of the two materials' own scatters is taken, and the estimate's error added to it.
    """
    materials = scale.palette.materials
    log_sd = max(materials[lower].modulus_log_sd, materials[upper].modulus_log_sd)
    factor = math.exp(NormalDist().inv_cdf(0.975) * log_sd) * (1.0 + error)
    return modulus_MPa / factor, modulus_MPa * factor
