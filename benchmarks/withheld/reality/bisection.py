"""Equilibrium of elements in series by nested bisection: slow, but it cannot fail to converge.

Stress rises with strain, and travel with force: halving an interval around the force, and for each
force one around every element's strain, finds the one equilibrium where Newton's method runs into
the kinks of very stiff elements that are all but unstrained.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["equilibrium"]

FloatArray = NDArray[np.float64]

_STRAINS = (-1.0, 4.0)
_HALVINGS = 50  # a strain to 5e-15


def equilibrium(
    bears_N: Callable[[FloatArray], FloatArray],
    lost_mm: Callable[[FloatArray], FloatArray],
    travel_mm: FloatArray,
    element_mm: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the force of every specimen, (S,), and the strains of its elements, (S, N).

    Parameters
    ----------
    bears_N
        Force of every element on its strain, (S, N) to (S, N); rising.
    lost_mm
        Travel that does not reach the specimen on the force, (S,) to (S,); not falling.
    travel_mm
        Of the crosshead, (S,).
    """

    def strain_at(force: FloatArray) -> FloatArray:
        low, high = (np.full(element_mm.shape, end) for end in _STRAINS)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            less = bears_N(middle) < force[:, None]
            low, high = np.where(less, middle, low), np.where(less, high, middle)
        return np.asarray(0.5 * (low + high))

    ends = [bears_N(np.full(element_mm.shape, end)) for end in _STRAINS]
    low, high = ends[0].max(axis=1), ends[1].min(axis=1)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        reach = np.sum(element_mm * strain_at(middle), axis=1) + lost_mm(middle)
        less = reach < travel_mm
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    force = 0.5 * (low + high)
    return force, strain_at(force)
