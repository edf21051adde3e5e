"""One measure of stiffness for soft and rigid grades alike: the secant modulus."""

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.law import Law, positive_stretch

__all__ = ["secant_modulus_MPa"]

_SMALL_STRAIN = 1e-5


def secant_modulus_MPa(law: Law, strain: ArrayLike) -> FloatArray:
    """Return nominal stress over engineering strain, P(1 + strain) / strain.

    At strain 0 this is the initial modulus. A linear law's is its modulus at every strain, so
    that a rigid grade's Young's modulus and an elastomer's secant are the same measure.

    Raises
    ------
    ArgumentError
        A strain is not above -1 and finite.
    """
    strain = np.asarray(strain, dtype=np.float64)
    stretch = positive_stretch(1.0 + strain)
    # Near rest the quotient loses digits; the tangent midway is the secant to second order.
    small = np.abs(strain) < _SMALL_STRAIN
    secant = law.nominal_stress_MPa(stretch) / np.where(small, 1.0, stretch - 1.0)
    return np.where(small, law.tangent_MPa(1.0 + strain / 2.0), secant)
