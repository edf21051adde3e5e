"""The neo-Hookean law."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.law import positive_stretch

__all__ = ["NeoHookean"]


@dataclass(frozen=True, slots=True)
class NeoHookean:
    """Gaussian chains: W = μ/2 (I1 - 3), P = μ (λ - 1/λ²), with I1 = λ² + 2/λ.

    μ is the shear modulus, E0 = 3 μ (Treloar, The Physics of Rubber Elasticity, 1975).
    """

    mu_MPa: float

    @property
    def initial_modulus_MPa(self) -> float:
        """Return 3 μ."""
        return 3.0 * self.mu_MPa

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return μ (λ - 1/λ²)."""
        stretch = positive_stretch(stretch)
        return self.mu_MPa * (stretch - stretch**-2)

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return μ (1 + 2/λ³)."""
        stretch = positive_stretch(stretch)
        return self.mu_MPa * (1.0 + 2.0 * stretch**-3)
