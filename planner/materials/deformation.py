"""Whether a material deforms elastically (a hyperelastic law) or plastically (a modulus alone).

The rule:

- Young's modulus above 70 MPa: plastic. ASTM D883 calls a plastic nonrigid up to 70 MPa
  (10 000 psi), semirigid and rigid above; a network of rubber does not get there, and what is
  stiffer takes its large strains by yielding, or breaks.
- Up to 70 MPa: plastic only if the stress has a true yield point, a maximum in the first half of
  the strain to break with a fall of at least 3 % of the peak behind it. A falling slope alone
  shows nothing there: every rubber's falls.

On the thesis' ten digital materials the limit stands between FLX9795 (60.5 MPa, elastic) and
RGD8430 (95.6 MPa, plastic).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.materials.curve import Curve
from planner.materials.rupture import noise_sd

__all__ = ["NONRIGID_MPA", "Deformation", "deformation", "yield_strain"]

NONRIGID_MPA = 70.0
"""Largest modulus of a nonrigid plastic (ASTM D883)."""

YIELD_DROP = 0.03


@dataclass(frozen=True, slots=True)
class Deformation:
    """How a material deforms, and by which part of the rule."""

    kind: Literal["elastic", "plastic"]
    reason: str


def yield_strain(curve: Curve) -> float | None:
    """Return the strain at the yield point: the first maximum of stress before break.

    A fall of at least 3 % of the peak stress, and of six times the noise, has to follow.
    """
    stress = curve.stress_MPa
    highest = np.maximum.accumulate(stress)
    drop = max(YIELD_DROP * float(stress.max()), 6.0 * noise_sd(stress))
    fallen = np.flatnonzero(highest - stress > drop)
    if not len(fallen):
        return None
    return float(curve.strain[int(np.argmax(stress[: fallen[0]]))])


def deformation(
    modulus_MPa: float, elongation_at_break: float, yield_strain: float | None = None
) -> Deformation:
    """Classify by Young's modulus, strain at break and strain at yield (None: no yield point)."""
    if modulus_MPa > NONRIGID_MPA:
        how = (
            f"yields at strain {yield_strain:.3g}"
            if yield_strain is not None
            else "breaks without a yield point"
        )
        return Deformation(
            "plastic",
            f"modulus {modulus_MPa:.3g} MPa is above {NONRIGID_MPA:g} MPa, not a nonrigid "
            f"material (ASTM D883); it {how}",
        )
    if yield_strain is not None and yield_strain <= 0.5 * elongation_at_break:
        return Deformation(
            "plastic",
            f"yields at strain {yield_strain:.3g}, before half its strain to break "
            f"({elongation_at_break:.3g})",
        )
    return Deformation(
        "elastic",
        f"modulus {modulus_MPa:.3g} MPa is nonrigid (up to {NONRIGID_MPA:g} MPa, ASTM D883) "
        "and no yield point comes before half the strain to break",
    )
