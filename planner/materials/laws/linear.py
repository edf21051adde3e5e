"""Linear elasticity in engineering strain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.law import positive_stretch

__all__ = ["Linear"]


@dataclass(frozen=True, slots=True)
class Linear:
    """Hooke's law, P = E (λ - 1), for grades of which only Young's modulus is known.

    Its secant modulus is E at every strain.
    """

    modulus_MPa: float

    @property
    def initial_modulus_MPa(self) -> float:
        """Return E."""
        return self.modulus_MPa

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return E (λ - 1)."""
        return self.modulus_MPa * (positive_stretch(stretch) - 1.0)

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return E."""
        return np.full_like(positive_stretch(stretch), self.modulus_MPa)
