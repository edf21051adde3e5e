"""Cyclic tests whose peaks fall from cycle to cycle: softening that goes on, and set."""

import numpy as np
import pytest

from planner.gap.campaign import Campaign, Specimen
from planner.gap.diagnose import diagnose
from planner.materials.laws import make_law
from planner.palette import LawParameters, Material, Palette, Reference

PALETTE = Palette(
    "foams",
    (
        Material("soft", 0.0, 2.0, 1.1, LawParameters("yeoh", {"c_MPa": (0.17, -0.004, 4e-4)})),
        Material("firm", 1.0, 1.5, 1.1, LawParameters("neo-hookean", {"mu_MPa": (0.6,)})),
    ),
    Reference(0.03, 23.0, 0.0, 9.0, "x"),
)
CYCLES, RATE_PER_S, GAUGE_MM, AREA_mm2 = 5, 0.03, 20.0, 400.0


def foam(id: str, material: str, amplitude: float, rng: np.random.Generator) -> Specimen:
    """A cube pushed in `CYCLES` times: a tanh of the strain below the largest, ln(1 + n) a peak."""
    way = np.linspace(0.0, 2.0 * CYCLES, 200 * CYCLES + 1)
    strain = amplitude * (1.0 - np.abs(1.0 - way % 2.0))
    law = make_law(PALETTE.resolve(material).law)
    peaks = np.maximum(np.floor((way + 1.0) / 2.0) - 1.0, 0.0)
    kept = np.where(way > 1.0, 1.0 - 0.4 * np.tanh(1.3 * (1.0 - strain / amplitude)), 1.0)
    kept *= 1.0 - 0.06 * np.log1p(peaks)
    force = AREA_mm2 * law.nominal_stress_MPa(1.0 - strain) * kept * np.exp(0.02 * rng.normal())
    force += 1e-3 * np.abs(force).max() * rng.normal(size=len(force))
    return Specimen(
        id, way * amplitude / RATE_PER_S, -GAUGE_MM * strain, force, GAUGE_MM, material=material,
        width_mm=20.0, thickness_mm=20.0, rate_mm_s=RATE_PER_S * GAUGE_MM, temperature_C=23.0,
        soak_h=0.0, age_days=9.0, protocol="cyclic", batch="A", orientation="x",
    )  # fmt: skip


@pytest.mark.slow
def test_a_foam_whose_peaks_fall_with_cycles_is_softened_and_explained() -> None:
    rng = np.random.default_rng(0)
    specimens = tuple(
        foam(f"{m}{a}{k}", m, a, rng)
        for m in ("soft", "firm")
        for a in (0.25, 0.4)
        for k in range(2)
    )
    found = diagnose(Campaign("foams", "any", PALETTE, specimens))
    assert found.verdict == "softening"
    # Force falls by 10 % from the first peak to the last and by 40 % on the way back; what is left
    # is about the specimens' scatter of 2 %.
    assert found.gap.before > 0.08
    assert (found.gap.after or 1.0) < 0.02
