"""What every constitutive law can do, in uniaxial tension of an incompressible material."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.errors import ArgumentError

__all__ = ["Law", "positive_stretch"]


class Law(Protocol):
    """A uniaxial law: nominal stress as a function of stretch.

    Stretch is length over rest length, so engineering strain is ``stretch - 1``; nominal
    (engineering) stress is force over the area at rest, Cauchy stress over ``stretch``.
    """

    @property
    def initial_modulus_MPa(self) -> float:
        """Tangent at rest; three times the shear modulus."""
        ...

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return the nominal stress, of the shape of `stretch`."""
        ...

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return the derivative of the nominal stress by the stretch, of the same shape."""
        ...


def positive_stretch(stretch: ArrayLike) -> FloatArray:
    """Return stretches as an array.

    Raises
    ------
    ArgumentError
        A stretch is not above 0 and finite.
    """
    array = np.asarray(stretch, dtype=np.float64)
    allowed = (array > 0.0) & (array < np.inf)
    if not allowed.all():
        raise ArgumentError(
            f"stretch {array[~allowed].flat[0]:g}: it must be above 0 and finite; stretch is "
            "1 at rest, 1 + engineering strain"
        )
    return array
