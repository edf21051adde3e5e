"""The Yeoh law."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.law import positive_stretch

__all__ = ["Yeoh"]


@dataclass(frozen=True, slots=True)
class Yeoh:
    """W = c1 J + c2 J² + c3 J³ with J = I1 - 3 = λ² + 2/λ - 3.

    P = dW/dλ = 2 (λ - 1/λ²) (c1 + 2 c2 J + 3 c3 J²); the shear modulus is 2 c1, E0 = 6 c1
    (Yeoh, Rubber Chem. Technol. 66, 1993). The form with λ² - 1/λ in front is the Cauchy stress
    λ P of the same energy.
    """

    c_MPa: tuple[float, float, float]

    @property
    def initial_modulus_MPa(self) -> float:
        """Return 6 c1."""
        return 6.0 * self.c_MPa[0]

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return W'(J) dJ/dλ."""
        stretch = positive_stretch(stretch)
        c1, c2, c3 = self.c_MPa
        j = stretch**2 + 2.0 / stretch - 3.0
        return 2.0 * (stretch - stretch**-2) * (c1 + j * (2.0 * c2 + 3.0 * c3 * j))

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return W''(J) (dJ/dλ)² + W'(J) d²J/dλ²."""
        stretch = positive_stretch(stretch)
        c1, c2, c3 = self.c_MPa
        j = stretch**2 + 2.0 / stretch - 3.0
        slope = 2.0 * (stretch - stretch**-2)
        return (2.0 * c2 + 6.0 * c3 * j) * slope**2 + (c1 + j * (2.0 * c2 + 3.0 * c3 * j)) * (
            2.0 + 4.0 * stretch**-3
        )
