"""Tests that a lab could do next: one change from the reference each."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.gap.campaign import Campaign
from planner.gap.forward.setup import Setup
from planner.gap.profile_design import ProfileDesign
from planner.gap.quality.loading import predicted_stress_MPa
from planner.gap.specimen import Specimen
from planner.palette import Palette
from planner.simulation.protocol import loading_path

__all__ = ["Trial", "trial_campaign", "trials_of"]

PREPARATION_H = 0.5
"""Printing, cleaning, mounting: of a person's time, a specimen."""

WAITING_SHARE = 0.02
"""Of an hour in which a specimen soaks or ages, what it costs."""

HOLD_S = 240.0
STRAIN = 0.3


@dataclass(frozen=True, slots=True)
class Trial:
    """A test: what differs from the reference, the specimen as if tested, and its hours."""

    change: Mapping[str, Any]
    specimen: Specimen
    hours: float


def trials_of(campaign: Campaign, setup: Setup) -> tuple[Trial, ...]:
    """Return the candidate tests of a campaign, each of one specimen."""
    reference = _reference(campaign, setup)
    grades = [m for m in campaign.palette.materials if m.deformation == "elastic"]
    soft, middle, hard = grades[0].id, grades[len(grades) // 2].id, grades[-1].id
    r = setup.reference
    rate = reference.rate_mm_s or 1.0
    temperature = r.temperature_C if r.temperature_C is not None else 23.0
    age = r.age_days if r.age_days is not None else 9.0
    soak = r.soak_h if r.soak_h is not None else 0.0
    width, thickness = reference.width_mm or 6.0, reference.thickness_mm or 3.0
    changes: list[dict[str, Any]] = [
        {"protocol": "monotonic"},
        {"rate_mm_s": _round(rate * 10.0)},
        {"rate_mm_s": _round(rate / 10.0)},
        {"temperature_C": temperature + 15.0},
        {"temperature_C": temperature - 8.0},
        {"soak_h": soak + 24.0},
        {"age_days": age + 60.0},
        {"orientation": "z" if (r.orientation or "x") != "z" else "x"},
        {"orientation": "y" if (r.orientation or "x") != "y" else "x"},
        {"width_mm": 2.0 * width},
        {"thickness_mm": 0.5 * thickness},
        {"gauge_mm": _round(1.8 * reference.gauge_mm)},
        {"protocol": "cyclic"},
        {"protocol": "relaxation"},
        {"material": soft},
        {"material": middle},
        {"material": hard},
        {"material": soft, "protocol": "cyclic"},
        {"material": hard, "protocol": "cyclic"},
        {"profile": f"{soft} to {hard} in one step, strain along the bar"},
    ]
    trials = []
    for number, change in enumerate(changes):
        if all(getattr(reference, k, None) == v for k, v in change.items()):
            continue
        specimen = _specimen(reference, change, number, campaign.palette, soft, hard)
        trials.append(Trial(change, specimen, _hours(specimen)))
    return tuple(trials)


def trial_campaign(campaign: Campaign, trials: tuple[Trial, ...]) -> Campaign:
    """Return the trials as a campaign, measured as the palette predicts."""
    specimens = tuple(t.specimen for t in trials)
    return replace(campaign, specimens=specimens, covariates=(), remarks=())


def _reference(campaign: Campaign, setup: Setup) -> Specimen:
    """Return the coupon that stands nearest to the palette's conditions, most usual in size."""
    r = setup.reference
    coupons = [s for s in campaign.specimens if s.profile is None] or list(campaign.specimens)

    def departures(s: Specimen) -> int:
        rate = None if s.rate_mm_s is None else s.rate_mm_s / s.gauge_mm
        near = (
            rate is None
            or r.strain_rate_per_s is None
            or (abs(np.log(rate / r.strain_rate_per_s)) < 0.3)
        )
        same = sum(
            getattr(s, name) not in (None, getattr(r, name))
            for name in ("temperature_C", "soak_h", "age_days", "orientation")
        )
        sizes = [(o.width_mm, o.thickness_mm, o.gauge_mm) for o in coupons]
        usual = max(set(sizes), key=sizes.count)
        return int(not near) + same + int((s.width_mm, s.thickness_mm, s.gauge_mm) != usual)

    best = min(coupons, key=departures)
    rate = best.rate_mm_s
    if r.strain_rate_per_s is not None:
        rate = r.strain_rate_per_s * best.gauge_mm
    return replace(
        best,
        profile=None,
        material=best.material or campaign.palette.materials[0].id,
        measured_width_mm=None,
        measured_thickness_mm=None,
        width_mm=best.width_mm or best.measured_width_mm or 6.0,
        thickness_mm=best.thickness_mm or best.measured_thickness_mm or 3.0,
        rate_mm_s=rate or 1.0,
        temperature_C=r.temperature_C,
        soak_h=r.soak_h,
        age_days=r.age_days,
        orientation=r.orientation,
        protocol="monotonic",
        strain_field=None,
        covariates={},
        batch=None,
    )


def _specimen(
    reference: Specimen,
    change: Mapping[str, Any],
    number: int,
    palette: Palette,
    soft: str,
    hard: str,
) -> Specimen:
    fields = {k: v for k, v in change.items() if k != "profile"}
    specimen = replace(reference, id=f"trial-{number:02d}", **fields)
    scale = specimen.gauge_mm / reference.gauge_mm
    rate = (specimen.rate_mm_s or 1.0) * (scale if "rate_mm_s" not in change else 1.0)
    strain = min(STRAIN, 0.6 * palette.resolve(specimen.material or soft).elongation_at_break)
    if "profile" in change:
        x = np.array([0.0, 0.5, 0.5, 1.0]) * specimen.gauge_mm
        ends = [palette.resolve(soft).coordinate, palette.resolve(hard).coordinate]
        design = ProfileDesign("step", x, np.repeat(ends, 2))
        specimen = replace(specimen, material=None, profile=design)
        strain = 0.5 * STRAIN
    path = loading_path(
        specimen.protocol or "monotonic",
        to_displacement_mm=strain * specimen.gauge_mm,
        rate_mm_s=rate,
        hold_s=HOLD_S,
    )
    area = (specimen.width_mm or 1.0) * (specimen.thickness_mm or 1.0)
    at = np.maximum(path.displacement_mm / specimen.gauge_mm, 1e-9)
    force = predicted_stress_MPa(specimen, palette, at) * area
    return replace(
        specimen,
        rate_mm_s=rate,
        time_s=path.time_s,
        displacement_mm=path.displacement_mm,
        force_N=force,
    )


def _hours(specimen: Specimen) -> float:
    test_h = float(specimen.time_s[-1]) / 3600.0
    waiting = (specimen.soak_h or 0.0) + 24.0 * max((specimen.age_days or 0.0) - 9.0, 0.0)
    return PREPARATION_H + test_h + WAITING_SHARE * waiting


def _round(value: float) -> float:
    return float(f"{value:.3g}")
