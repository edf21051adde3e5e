"""Calendered rubber along and across the calendering: orientation.

Diani's tests, as the examples of Hyperelastics.jl (MIT) have them: stretch and nominal stress in
MPa of two directions, no time, no replicates.
"""

from pathlib import Path

import numpy as np

from benchmarks.withheld.real.coupons import coupon, evenly, fitted_palette, folder_of
from planner.gap.campaign import Campaign
from planner.palette import Reference

__all__ = ["calendered_rubber"]

ASSUMED_RATE_PER_S = 0.01


def calendered_rubber(data: Path) -> Campaign:
    """Fit the law along the calendering (x); the specimen across it (y) has the gap."""
    path = folder_of(data, "hyperelastics_jl") / "examples" / "Diani" / "diani_data.csv"
    stretch, along, across = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
    strain, (along, across) = evenly(stretch - 1.0, along, across)
    time_s = strain / ASSUMED_RATE_PER_S
    palette = fitted_palette(
        "calendered-rubber",
        {"rubber": [(strain[1:], along[1:])]},
        Reference(strain_rate_per_s=ASSUMED_RATE_PER_S, orientation="x"),
        "Diani, along the calendering",
    )
    specimens = tuple(
        coupon(name, "rubber", time_s, strain, stress, orientation=way, protocol="monotonic")
        for name, way, stress in (("along", "x", along), ("across", "y", across))
    )
    notes = (
        "Read off a figure, here at even strains. Time was not published; 0.01 strain per second "
        "is assumed of both."
    )
    return Campaign("calendered-rubber", "none", palette, specimens, notes=notes)
