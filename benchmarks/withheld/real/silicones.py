"""Silicones at one rate and temperature: a control with no gap to find.

Soft Robotics Materials Database (Marechal et al., Soft Robotics, 2020; ODbL), ASTM D412, one
specimen a material.
"""

from pathlib import Path

import numpy as np

from benchmarks.withheld.real.coupons import Real, coupon, fitted_palette
from planner.gap.campaign import Campaign
from planner.palette import Reference

__all__ = ["silicones"]

MATERIALS = ("Ecoflex 00-30", "Dragon Skin 10 MEDIUM", "Dragon Skin 20", "Dragon Skin 30")
"""Of one maker, each stiffer than the one before at every strain, so that a palette can hold
them."""

LARGEST_STRAIN = 2.0
WIDTH_MM, THICKNESS_MM, GAUGE_MM, RATE_MM_S = 6.0, 3.0, 33.0, 7.5


def silicones(data: Path) -> Real:
    """Fit each material's even readings and give the odd ones as the campaign."""
    folder = data / "marechal" / "Tensile-Tests-Data"
    curves, specimens = {}, []
    for number, name in enumerate(MATERIALS, start=1):
        material = name.replace(" ", "-")
        time_s, strain, stress_MPa = _read(folder / f"{name}.csv")
        curves[material] = [(strain[::2], stress_MPa[::2])]
        specimens.append(
            coupon(
                f"S{number}",
                material,
                time_s[1::2],
                strain[1::2],
                stress_MPa[1::2],
                width_mm=WIDTH_MM,
                thickness_mm=THICKNESS_MM,
                gauge_mm=GAUGE_MM,
                rate_mm_s=RATE_MM_S,
                protocol="monotonic",
            )
        )
    rate = RATE_MM_S / GAUGE_MM
    palette = fitted_palette(
        "silicones",
        curves,
        Reference(strain_rate_per_s=rate),
        "Marechal et al. 2020, even readings",
    )
    notes = "Odd readings; the palette is fitted to the even ones of the same specimens."
    campaign = Campaign("silicones", "none", palette, tuple(specimens), notes=notes)
    return Real(campaign, "none: the campaign is the palette's own specimens at one condition")


def _read(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith("Time (s)"))
    rows = [line.split(";")[:5] for line in lines[head + 1 :]]
    table = np.array([[float(v) for v in row] for row in rows if all(v.strip() for v in row)])
    time_s, strain, stress_MPa = table[:, 0], table[:, 3], table[:, 4]
    # The crosshead rests before the first reading and overshoots after the break
    inside = (strain > 0.0) & (strain <= LARGEST_STRAIN)
    inside &= np.arange(len(strain)) < np.argmax(strain) + 1
    return time_s[inside], strain[inside], stress_MPa[inside]
