"""Silicones at one rate and temperature: a control with no gap to find, and other makers' ones.

Soft Robotics Materials Database (Marechal et al., Soft Robotics, 2020; ODbL), ASTM D412, one
specimen a material.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from benchmarks.withheld.real.coupons import coupon, fitted_palette, folder_of
from planner.gap.campaign import Campaign
from planner.numerics import FloatArray
from planner.palette import Reference

__all__ = ["silicones", "silicones_substituted"]

MATERIALS = ("Ecoflex 00-30", "Dragon Skin 10 MEDIUM", "Dragon Skin 20", "Dragon Skin 30")
"""Of one maker, each stiffer than the one before at every strain, so that a palette can hold
them."""

SUBSTITUTES = MappingProxyType(
    {
        "Ecoflex 00-30": "Ecoflex 00-35 FAST",
        "Dragon Skin 10 MEDIUM": "PlatSil Gel 10",
        "Dragon Skin 20": "Mold Star 20T",
    }
)
"""Of the same Shore hardness by their names, but for 00-35 in place of 00-30."""

LARGEST_STRAIN = 2.0
WIDTH_MM, THICKNESS_MM, GAUGE_MM, RATE_MM_S = 6.0, 3.0, 33.0, 7.5


def silicones(data: Path) -> Campaign:
    """Fit each material's even readings and give the odd ones as the campaign."""
    read = {name: _read(data, name) for name in MATERIALS}
    notes = "Odd readings; the palette is fitted to the even ones of the same specimens."
    fitted = {name: [column[::2] for column in columns] for name, columns in read.items()}
    tested = [(name, name, [c[1::2] for c in columns]) for name, columns in read.items()]
    return _campaign("silicones", fitted, tested, "even readings", notes)


def silicones_substituted(data: Path) -> Campaign:
    """Fit three materials and give another of the same nominal hardness in place of each."""
    notes = "Each material stands for one of the same nominal Shore hardness, under its name."
    fitted = {name: _read(data, name) for name in SUBSTITUTES}
    tested = [(name, other, _read(data, other)) for name, other in SUBSTITUTES.items()]
    return _campaign("silicones-substituted", fitted, tested, "all readings", notes)


def _campaign(
    name: str,
    fitted: Mapping[str, Sequence[FloatArray]],
    tested: Sequence[tuple[str, str, Sequence[FloatArray]]],
    source: str,
    notes: str,
) -> Campaign:
    """Return a campaign from columns of time, strain and stress.

    Parameters
    ----------
    fitted
        By the materials' names.
    tested
        Of each specimen the material that it counts as, its own name and its columns.
    """
    palette = fitted_palette(
        name,
        {_id(material): [(strain, stress)] for material, (_, strain, stress) in fitted.items()},
        Reference(strain_rate_per_s=RATE_MM_S / GAUGE_MM),
        f"Marechal et al. 2020, {source}",
    )
    specimens = tuple(
        coupon(
            _id(own),
            _id(material),
            *columns,
            width_mm=WIDTH_MM,
            thickness_mm=THICKNESS_MM,
            gauge_mm=GAUGE_MM,
            rate_mm_s=RATE_MM_S,
            protocol="monotonic",
        )
        for material, own, columns in tested
    )
    return Campaign(name, "none", palette, specimens, notes=notes)


def _id(name: str) -> str:
    return name.replace(" ", "-")


def _read(data: Path, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    path = folder_of(data, "marechal") / "Tensile-Tests-Data" / f"{name}.csv"
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith("Time (s)"))
    rows = [line.split(";")[:5] for line in lines[head + 1 :]]
    table = np.array([[float(v) for v in row] for row in rows if all(v.strip() for v in row)])
    time_s, strain, stress_MPa = table[:, 0], table[:, 3], table[:, 4]
    # The crosshead rests before the first reading and overshoots after the break
    inside = (strain > 0.0) & (strain <= LARGEST_STRAIN)
    inside &= np.arange(len(strain)) < np.argmax(strain) + 1
    return time_s[inside], strain[inside], stress_MPa[inside]
