"""The Ogden-like expression of Hemleben's thesis, as printed; to reproduce it, not to plan."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.materials.laws.law import positive_stretch

__all__ = ["OgdenThesis", "literal_stress_MPa", "literal_tangent_MPa"]


@dataclass(frozen=True, slots=True)
class OgdenThesis:
    """P = Σ c_i (x^c_j - 2^(c_j-1) x^(-c_j/2)), (i, j) = (1, 2), (3, 4), (5, 6), x the strain.

    Eq. 3.8 of S. Hemleben, Modeling a Spectrum of 3D Printed Materials for Soft Robots, Oregon
    State University, 2017. What the thesis calls λ is the engineering strain x = stretch - 1,
    and the factor 2^(c-1) comes of (2/√λ)^c in place of 2 (1/√λ)^c in the energy. Hence the
    stress neither vanishes nor stays finite at rest: the law holds from `strain_min` to
    `strain_max` only, and has no initial modulus.
    """

    c: tuple[float, ...]
    strain_min: float
    strain_max: float

    @property
    def initial_modulus_MPa(self) -> float:
        """Raise, for the expression diverges at rest.

        Raises
        ------
        ArgumentError
            Always.
        """
        raise ArgumentError(
            "the thesis-literal law diverges at rest and has no initial modulus; "
            "use the material's stress-free law"
        )

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return the stress as printed.

        Raises
        ------
        ArgumentError
            A strain outside [strain_min, strain_max].
        """
        return literal_stress_MPa(self.c, self._strain(stretch))

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return the derivative by the strain.

        Raises
        ------
        ArgumentError
            A strain outside [strain_min, strain_max].
        """
        return literal_tangent_MPa(self.c, self._strain(stretch))

    def _strain(self, stretch: ArrayLike) -> FloatArray:
        strain = positive_stretch(stretch) - 1.0
        # A few roundings of 1 + strain, so that the ends themselves are within.
        slack = 8.0 * np.finfo(np.float64).eps
        outside = (strain < self.strain_min - slack) | (strain > self.strain_max + slack)
        if outside.any():
            raise ArgumentError(
                f"strain {strain[outside].flat[0]:g}: the thesis-literal law holds from "
                f"{self.strain_min:g} to {self.strain_max:g} only; use the material's "
                "stress-free law elsewhere"
            )
        return strain


def literal_stress_MPa(c: ArrayLike, strain: ArrayLike) -> FloatArray:
    """Return eq. 3.8 at strains above 0, wherever they are.

    Parameters
    ----------
    c
        Six coefficients along the last axis; the other axes broadcast with `strain`.
    """
    c = np.asarray(c, dtype=np.float64)
    x = np.asarray(strain, dtype=np.float64)
    stress: FloatArray = np.zeros(np.broadcast_shapes(c.shape[:-1], x.shape))
    for i in (0, 2, 4):
        a, b = c[..., i], c[..., i + 1]
        stress = stress + a * (x**b - 2.0 ** (b - 1.0) * x ** (-b / 2.0))
    return stress


def literal_tangent_MPa(c: ArrayLike, strain: ArrayLike, order: int = 1) -> FloatArray:
    """Return the derivative of eq. 3.8 by the strain, of order 1 or 2.

    Parameters
    ----------
    c, strain
        As `literal_stress_MPa`.
    """
    c = np.asarray(c, dtype=np.float64)
    x = np.asarray(strain, dtype=np.float64)
    slope: FloatArray = np.zeros(np.broadcast_shapes(c.shape[:-1], x.shape))
    for i in (0, 2, 4):
        a, b = c[..., i], c[..., i + 1]
        up, down = a * b, a * b * 2.0 ** (b - 2.0)
        if order == 1:
            slope = slope + up * x ** (b - 1.0) + down * x ** (-b / 2.0 - 1.0)
        else:
            slope = slope + up * (b - 1.0) * x ** (b - 2.0)
            slope = slope - down * (b / 2.0 + 1.0) * x ** (-b / 2.0 - 2.0)
    return slope
