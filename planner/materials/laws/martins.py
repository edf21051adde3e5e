"""The Martins law."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.law import positive_stretch

__all__ = ["Martins"]


@dataclass(frozen=True, slots=True)
class Martins:
    """Exponential matrix and fibre: W = c2 (exp(c1 J) - 1) + c4 (exp(c3 (λ-1)²) - 1).

    J = I1 - 3 = λ² + 2/λ - 3. With g = λ - 1/λ²,
    P = 2 c1 c2 g exp(c1 J) + 2 c3 c4 (λ-1) exp(c3 (λ-1)²), and E0 = 6 c1 c2 + 2 c3 c4
    (Martins, Natal Jorge & Ferreira, Strain 42, 2006, who print the Cauchy stress λ P; the
    numbering is that of Hemleben's eq. 3.6).
    """

    c1: float
    c2_MPa: float
    c3: float
    c4_MPa: float

    @property
    def initial_modulus_MPa(self) -> float:
        """Return 6 c1 c2 + 2 c3 c4."""
        return 6.0 * self.c1 * self.c2_MPa + 2.0 * self.c3 * self.c4_MPa

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return dW/dλ."""
        stretch = positive_stretch(stretch)
        matrix, fibre = self._matrix_and_fibre_MPa(stretch)
        return matrix * (stretch - stretch**-2) + fibre * (stretch - 1.0)

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return d²W/dλ²."""
        stretch = positive_stretch(stretch)
        matrix, fibre = self._matrix_and_fibre_MPa(stretch)
        g = stretch - stretch**-2
        return matrix * (1.0 + 2.0 * stretch**-3 + 2.0 * self.c1 * g**2) + fibre * (
            1.0 + 2.0 * self.c3 * (stretch - 1.0) ** 2
        )

    def _matrix_and_fibre_MPa(self, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
        j = stretch**2 + 2.0 / stretch - 3.0
        matrix = 2.0 * self.c1 * self.c2_MPa * np.exp(self.c1 * j)
        fibre = 2.0 * self.c3 * self.c4_MPa * np.exp(self.c3 * (stretch - 1.0) ** 2)
        return matrix, fibre
