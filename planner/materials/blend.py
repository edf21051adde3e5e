"""A blend of two grades as a law of its own."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.law import Law, positive_stretch
from planner.materials.stiffness import secant_modulus_MPa

__all__ = ["BlendLaw"]


@dataclass(frozen=True, slots=True)
class BlendLaw:
    """The geometric mean of two laws: P = Pa^(1-t) Pb^t at every stretch, t in 0..1.

    Written with secant moduli, P = Sa^(1-t) Sb^t (λ - 1), it holds in compression too. It is
    stress-free at rest, increases with stretch where both laws do, and lies between them.
    """

    softer: Law
    harder: Law
    fraction: float

    @property
    def initial_modulus_MPa(self) -> float:
        """Return the geometric mean of the two initial moduli."""
        t = self.fraction
        a, b = self.softer.initial_modulus_MPa, self.harder.initial_modulus_MPa
        return float(a ** (1.0 - t) * b**t)

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return Sa^(1-t) Sb^t (λ - 1)."""
        strain = positive_stretch(stretch) - 1.0
        a = secant_modulus_MPa(self.softer, strain)
        b = secant_modulus_MPa(self.harder, strain)
        return a ** (1.0 - self.fraction) * b**self.fraction * strain

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return Sa^(1-t) Sb^t ((1-t) Ta/Sa + t Tb/Sb), T the tangents."""
        strain = positive_stretch(stretch) - 1.0
        t = self.fraction
        a = secant_modulus_MPa(self.softer, strain)
        b = secant_modulus_MPa(self.harder, strain)
        share = (1.0 - t) * self.softer.tangent_MPa(stretch) / a
        share = share + t * self.harder.tangent_MPa(stretch) / b
        return a ** (1.0 - t) * b**t * share
