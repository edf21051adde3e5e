"""The inverse question: which material, or which blend of two, has a wanted stiffness."""

import math
from dataclasses import dataclass
from typing import Any

from planner.errors import ArgumentError
from planner.grading.stiffness_scale import stiffness_scale
from planner.materials.inverse import Blend, blend_for, nearest
from planner.palette import Palette

__all__ = ["Mixture", "mixture_for"]


@dataclass(frozen=True, slots=True)
class Mixture:
    """The answer for one wanted modulus.

    Attributes
    ----------
    reachable
        Whether the palette's range holds the target; if not, `blend` is the nearest end.
    nearest
        Catalogue material nearest in log stiffness.
    blend, modulus_MPa, interval_MPa
        The interpolated blend, its modulus and the 95 % interval of that.
    range_MPa
        What the palette reaches.
    """

    target_MPa: float
    at_strain: float
    reachable: bool
    nearest: str
    nearest_modulus_MPa: float
    blend: Blend
    modulus_MPa: float
    interval_MPa: tuple[float, float]
    range_MPa: tuple[float, float]

    def blend_text(self) -> str:
        """Return the blend in words."""
        if self.blend.fraction == 0.0 or self.blend.lower == self.blend.upper:
            return self.blend.lower
        if self.blend.fraction == 1.0:
            return self.blend.upper
        share = 100.0 * self.blend.fraction
        return f"{100.0 - share:.1f} % {self.blend.lower} + {share:.1f} % {self.blend.upper}"

    def document(self) -> dict[str, Any]:
        """Return the answer as JSON holds it; moduli in MPa with all their digits."""
        return {
            "target_modulus_MPa": self.target_MPa,
            "reachable": self.reachable,
            "range_MPa": list(self.range_MPa),
            "nearest": {"material": self.nearest, "modulus_MPa": self.nearest_modulus_MPa},
            "blend": {
                "coordinate": self.blend.coordinate,
                "lower": self.blend.lower,
                "upper": self.blend.upper,
                "fraction": self.blend.fraction,
                "modulus_MPa": self.modulus_MPa,
                "modulus_interval_MPa": list(self.interval_MPa),
            },
        }


def mixture_for(palette: Palette, modulus_MPa: float, at_strain: float) -> Mixture:
    """Find what has a wanted modulus.

    Raises
    ------
    ArgumentError
        The modulus is not a positive number, or the strain is out of range.
    """
    if not (math.isfinite(modulus_MPa) and modulus_MPa > 0.0):
        raise ArgumentError(f"--modulus {modulus_MPa:g}: it must be above 0 MPa")
    scale = stiffness_scale(palette, at_strain)
    low, high = scale.moduli_MPa[0], scale.moduli_MPa[-1]
    within = min(max(modulus_MPa, low), high)
    blend = blend_for(scale.model, within, at_strain)
    place = int(nearest(scale.model, within, at_strain))
    interval = scale.model.modulus_interval_MPa(blend.coordinate, at_strain)
    return Mixture(
        target_MPa=modulus_MPa,
        at_strain=at_strain,
        reachable=low * (1 - 1e-9) <= modulus_MPa <= high * (1 + 1e-9),
        nearest=palette.materials[place].id,
        nearest_modulus_MPa=scale.moduli_MPa[place],
        blend=blend,
        modulus_MPa=float(scale.model.modulus_MPa(blend.coordinate, at_strain)),
        interval_MPa=(float(interval[0]), float(interval[1])),
        range_MPa=(low, high),
    )
