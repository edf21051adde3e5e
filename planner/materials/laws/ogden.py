"""The Ogden law."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.law import positive_stretch

__all__ = ["Ogden"]


@dataclass(frozen=True, slots=True)
class Ogden:
    """W = Σ μi/αi (λ^αi + 2 λ^(-αi/2) - 3), P = Σ μi (λ^(αi-1) - λ^(-αi/2-1)).

    Twice the shear modulus is Σ μi αi, so E0 = 3/2 Σ μi αi (Ogden, Proc. R. Soc. A 326, 1972).

    Parameters
    ----------
    mu_MPa, alpha
        One of each a term; no alpha is 0.
    """

    mu_MPa: tuple[float, ...]
    alpha: tuple[float, ...]

    @property
    def initial_modulus_MPa(self) -> float:
        """Return 3/2 Σ μi αi."""
        return 1.5 * sum(mu * a for mu, a in zip(self.mu_MPa, self.alpha, strict=True))

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return Σ μi (λ^(αi-1) - λ^(-αi/2-1))."""
        stretch = positive_stretch(stretch)
        stress = np.zeros_like(stretch)
        for mu, a in zip(self.mu_MPa, self.alpha, strict=True):
            stress = stress + mu * (stretch ** (a - 1.0) - stretch ** (-a / 2.0 - 1.0))
        return stress

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return Σ μi ((αi-1) λ^(αi-2) + (αi/2+1) λ^(-αi/2-2))."""
        stretch = positive_stretch(stretch)
        tangent = np.zeros_like(stretch)
        for mu, a in zip(self.mu_MPa, self.alpha, strict=True):
            tangent = tangent + mu * (
                (a - 1.0) * stretch ** (a - 2.0) + (a / 2.0 + 1.0) * stretch ** (-a / 2.0 - 2.0)
            )
        return tangent
