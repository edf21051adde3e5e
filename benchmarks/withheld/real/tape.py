"""The acrylic tape VHB 4910, loaded and unloaded at three speeds that were not published.

Examples of Hyperelastics.jl (MIT): strain, and in kPa the stress of three loops, of each the
unloading and then the loading branch.
"""

from pathlib import Path

import numpy as np

from benchmarks.withheld.real.coupons import coupon, evenly, fitted_palette, folder_of
from planner.gap.campaign import Campaign
from planner.palette import Reference

__all__ = ["tape"]

KPA = 1e-3
ASSUMED_RATE_PER_S = 0.01


def tape(data: Path) -> Campaign:
    """Fit the lowest loop's loading; the other loops and all unloading have the gap."""
    path = folder_of(data, "hyperelastics_jl") / "examples" / "vhb4910.csv"
    strain, columns = evenly(*np.loadtxt(path, delimiter=",", skiprows=1, unpack=True))
    specimens = []
    for number, name in enumerate("abc"):
        down, up = KPA * columns[2 * number], KPA * columns[2 * number + 1]
        # Drawn below 0 too, where a slack tape bears nothing; the branches meet at the top
        up, down = np.clip(up, 0.0, None), np.clip(down, 0.0, None)
        path_strain = np.concatenate([strain, strain[-2::-1]])
        stress = np.concatenate([up, down[-2::-1]])
        travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path_strain)))])
        specimens.append(
            coupon(
                f"loop-{name}",
                "tape",
                travelled / ASSUMED_RATE_PER_S,
                path_strain,
                stress,
                protocol="cyclic",
                covariates={"speed": name},
            )
        )
    palette = fitted_palette(
        "tape",
        {"tape": [(strain[1:], KPA * columns[1][1:])]},
        Reference(strain_rate_per_s=ASSUMED_RATE_PER_S),
        "VHB 4910, lowest loop, loading",
    )
    notes = (
        "Read off a figure, here at even strains. The speeds were not published: rate_mm_s is "
        "empty, time is counted at 0.01 strain per second of all, and which loop was faster "
        "stands in the column speed."
    )
    return Campaign("tape", "none", palette, tuple(specimens), ("speed",), notes)
