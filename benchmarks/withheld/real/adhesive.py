"""An optically clear adhesive, pulled and let go, and sheared: rate.

C. Zhao, "Viscoelastic material deformation calibration" (MIT, 2024). The uniaxial tests name no
material and no unit; kPa gives stresses of the size of acrylic tapes.
"""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from benchmarks.withheld.real.coupons import (
    GAUGE_MM,
    coupon,
    fitted_palette,
    folder_of,
    median_rate,
)
from benchmarks.withheld.real.spreadsheet import read_numbers
from planner.gap.campaign import Campaign, Specimen
from planner.numerics import FloatArray
from planner.palette import Reference

__all__ = ["adhesive_pulled", "adhesive_sheared", "tension_of_shear"]

KPA = 1e-3
REFERENCE_RATE_PER_S = 0.01


def adhesive_pulled(data: Path) -> Campaign:
    """Fit the slowest tests' loading; faster ones and all unloading have the gap."""
    folder = folder_of(data, "oca_shear") / "uniaxial-loading-unloading-test" / "exp-data"
    specimens, loading = [], []
    for path in sorted(folder.glob("loading_*.xlsx")):
        time_s, stretch, stress_kPa = read_numbers(path).T
        _, peak, _, rate = path.stem.split("_")
        rate_per_s = float(rate.replace("d", "."))
        strain, stress = stretch - 1.0, KPA * stress_kPa
        specimens.append(
            coupon(
                f"{peak}-{rate}",
                "adhesive",
                time_s,
                strain,
                stress,
                rate_mm_s=rate_per_s * GAUGE_MM,
                protocol="cyclic",
            )
        )
        if rate_per_s == REFERENCE_RATE_PER_S:
            top = int(np.argmax(strain)) + 1
            loading.append((strain[1:top], stress[1:top]))
    palette = fitted_palette(
        "adhesive-pulled",
        {"adhesive": loading},
        Reference(strain_rate_per_s=REFERENCE_RATE_PER_S),
        "C. Zhao 2024, loading at 0.01/s",
    )
    return Campaign("adhesive-pulled", "none", palette, tuple(specimens))


_SHEARED: Mapping[str, tuple[str, int, int]] = MappingProxyType(
    {
        # file: its test, and the columns of shear strain and of stress in kPa
        "monotonic-shear-test/exp-data/monotonic_shear_0d05.xlsx": ("monotonic", 3, 4),
        "monotonic-shear-test/exp-data/monotonic_shear_0d01.xlsx": ("monotonic", 3, 2),
        "monotonic-shear-test/exp-data/monotonic_shear_0d1.xlsx": ("monotonic", 3, 2),
        "monotonic-shear-test/exp-data/monotonic_shear_1.xlsx": ("monotonic", 3, 2),
        "cyclic-shear-relaxation-test/exp-data/shear_relaxation_0d1.xlsx": ("relaxation", 4, 3),
        "cyclic-shear-relaxation-test/exp-data/shear_relaxation_1.xlsx": ("relaxation", 4, 3),
        "cyclic-shear-relaxation-test/exp-data/shear_relaxation_2.xlsx": ("relaxation", 4, 3),
        "cyclic-shear-relaxation-test/exp-data/shear_relaxation_5.xlsx": ("relaxation", 4, 3),
    }
)
_REFERENCE = "monotonic_shear_0d05"
LARGEST_STRETCH = 5.0


def adhesive_sheared(data: Path) -> Campaign:
    """Fit the one raw monotonic test; those of other rates and with holds have the gap."""
    specimens: list[Specimen] = []
    loading: list[tuple[FloatArray, FloatArray]] = []
    reference_rate = 0.0
    for name, (protocol, shear_column, stress_column) in _SHEARED.items():
        path = folder_of(data, "oca_shear") / name
        table = read_numbers(path)
        stretch, stress = tension_of_shear(table[:, shear_column], KPA * table[:, stress_column])
        last = int(np.argmax(stretch > LARGEST_STRETCH)) or len(stretch)
        time_s, strain, stress = table[:last, 0], stretch[:last] - 1.0, stress[:last]
        rate = median_rate(time_s, strain)
        specimens.append(
            coupon(
                path.stem.replace("_", "-"),
                "adhesive",
                time_s,
                strain,
                stress,
                rate_mm_s=float(f"{rate * GAUGE_MM:.3g}"),
                protocol=protocol,
            )
        )
        if path.stem == _REFERENCE:
            loading, reference_rate = [(strain, stress)], rate
    palette = fitted_palette(
        "adhesive-sheared",
        {"adhesive": loading},
        Reference(strain_rate_per_s=float(f"{reference_rate:.3g}")),
        "C. Zhao 2024, monotonic shear at 0.05/s",
    )
    notes = (
        "Simple shear, as the tension of the same first invariant: exact for a material whose "
        "energy depends on that alone. Up to stretch 5 of 10. Three of the monotonic tests have a "
        "time that is even in a generalised strain, not in the crosshead's travel."
    )
    return Campaign("adhesive-sheared", "none", palette, tuple(specimens), notes=notes)


def tension_of_shear(shear: FloatArray, stress: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return stretch and nominal stress of the tension with the first invariant of a shear.

    With I1 = 3 + g² = l² + 2/l and an energy W(I1), the shear stress is 2 W' g and the nominal
    stress in tension 2 W' (l - 1/l²).
    """
    stretch = np.array([_stretch(g) for g in shear])
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(shear > 0.0, (stretch - stretch**-2.0) / shear, np.sqrt(3.0))
    return stretch, stress * ratio


def _stretch(shear: float) -> float:
    """Return 1 + e, e the root from 0 up of e³ + 3 e² - g² e - g², which is I1 in l = 1 + e."""
    roots = np.roots([1.0, 3.0, -(shear**2), -(shear**2)])
    return 1.0 + max(0.0, float(np.max(roots.real)))
