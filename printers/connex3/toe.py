"""Take the toe off a published curve, so that it starts at rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.materials.algorithm_one import literal_stress_MPa
from planner.numerics import FloatArray
from printers.connex3.thesis import Published, literal_tangent_MPa

__all__ = ["CorrectedCurve", "correct", "flattest_tangent"]

_RESOLUTION = 1e-4


@dataclass(frozen=True, slots=True)
class CorrectedCurve:
    """A published curve, moved to the left by its toe and straight up to its onset.

    Attributes
    ----------
    onset
        Crosshead strain from which the published curve is followed.
    toe
        Crosshead strain at which the tangent at the onset meets zero stress: slack.
    modulus_MPa
        Slope of that tangent.
    """

    published: Published
    onset: float
    toe: float
    modulus_MPa: float

    def nominal_stress_MPa(self, strain: ArrayLike) -> FloatArray:
        """Return the stress at strains from 0 to the break less the toe."""
        strain = np.asarray(strain, dtype=np.float64)
        followed = np.maximum(strain + self.toe, self.onset)
        return np.where(
            strain + self.toe < self.onset,
            self.modulus_MPa * strain,
            literal_stress_MPa(self.published.c, followed),
        )


def flattest_tangent(published: Published) -> float:
    """Return the strain at which the published tangent is steadiest, to 0.0001.

    From the break downwards, the first local minimum of abs(d ln P' / d ln strain). Where the
    curve has an inflexion this is it, the strain of the steepest tangent above the toe (as
    ASTM D638, annex A1, takes it); where the divergence of eq. 3.8 leaves none, the strain at
    which it bends the tangent least.
    """
    strain = np.arange(_RESOLUTION, published.elongation_at_break, _RESOLUTION)
    tangent = literal_tangent_MPa(published.c, strain)
    bend = np.abs(strain * literal_tangent_MPa(published.c, strain, order=2) / tangent)
    minima = np.flatnonzero((bend[1:-1] <= bend[:-2]) & (bend[1:-1] <= bend[2:])) + 1
    return float(round(strain[minima[-1]] / _RESOLUTION) * _RESOLUTION)


def correct(published: Published, onset: float | None = None) -> CorrectedCurve:
    """Extend the tangent at `onset` (default: the flattest) down to zero stress.

    The toe compensation of ASTM D638, annex A1.
    """
    if onset is None:
        onset = flattest_tangent(published)
    slope = float(literal_tangent_MPa(published.c, onset))
    stress = float(literal_stress_MPa(published.c, onset))
    return CorrectedCurve(published, onset, onset - stress / slope, slope)
