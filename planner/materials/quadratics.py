"""The thesis' coefficient model: each coefficient of eq. 3.8 a quadratic in the coordinate.

Kept to reproduce the source; planning uses `planner.materials.coefficients`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.laws.ogden_thesis import literal_stress_MPa

__all__ = ["QuadraticCoefficients"]


@dataclass(frozen=True, slots=True)
class QuadraticCoefficients:
    """c_j(m) = q2 m² + q1 m + q0 for the six coefficients of `OgdenThesis`.

    Parameters
    ----------
    rows
        (q2, q1, q0) of c1 to c6.
    """

    rows: tuple[tuple[float, float, float], ...]

    def coefficients(self, coordinate: ArrayLike) -> FloatArray:
        """Return c1 to c6 along the last axis."""
        m = np.asarray(coordinate, dtype=np.float64)[..., np.newaxis]
        q2, q1, q0 = np.array(self.rows).T
        return np.asarray((q2 * m + q1) * m + q0)

    def literal_stress_MPa(self, coordinate: ArrayLike, strain: ArrayLike) -> FloatArray:
        """Return the stress as printed, at strains above 0 that broadcast with `coordinate`."""
        return literal_stress_MPa(self.coefficients(coordinate), strain)
