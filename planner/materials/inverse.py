"""From a wanted stiffness back to a coordinate, a grade or a blend of two.

All at one working strain. Moduli outside the palette's range are clamped to it; `reachable`
tells which were not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.errors import ArgumentError
from planner.materials.coefficients import CoefficientModel

__all__ = [
    "Blend",
    "blend_for",
    "coordinate_for",
    "nearest",
    "nearest_on",
    "reachable",
    "thresholds_MPa",
    "thresholds_of",
]


@dataclass(frozen=True, slots=True)
class Blend:
    """What stands at one coordinate: `fraction` of the way from grade `lower` to `upper`.

    Attributes
    ----------
    lower, upper
        Ids of materials; the same, with fraction 0, at a catalogue grade.
    """

    lower: str
    upper: str
    fraction: float
    coordinate: float


def thresholds_MPa(model: CoefficientModel, at_strain: float) -> FloatArray:
    """Return the moduli at which the nearest grade changes: the neighbours' geometric means.

    Raises
    ------
    ArgumentError
        The strain is not a working strain, 0 to `CoefficientModel.strain_limit`.
    """
    return thresholds_of(_ladder_MPa(model, at_strain))


def thresholds_of(ladder_MPa: ArrayLike) -> FloatArray:
    """Return the geometric means of neighbours on a ladder of rising moduli."""
    moduli = np.asarray(ladder_MPa, dtype=np.float64)
    return np.sqrt(moduli[:-1] * moduli[1:])


def nearest_on(ladder_MPa: ArrayLike, modulus_MPa: ArrayLike) -> IntArray:
    """Return the rung nearest in log stiffness on a ladder of rising moduli; see `nearest`."""
    thresholds = thresholds_of(ladder_MPa)
    return np.asarray(np.searchsorted(thresholds, _positive(modulus_MPa), side="left"))


def nearest(model: CoefficientModel, modulus_MPa: ArrayLike, at_strain: float) -> IntArray:
    """Return the place of the grade nearest in log stiffness; a tie goes to the softer.

    Raises
    ------
    ArgumentError
        A modulus is not above 0, or the strain not a working strain.
    """
    return nearest_on(_ladder_MPa(model, at_strain), modulus_MPa)


def reachable(model: CoefficientModel, modulus_MPa: ArrayLike, at_strain: float) -> BoolArray:
    """Return whether the palette's range holds each modulus.

    Raises
    ------
    ArgumentError
        As `nearest`.
    """
    ladder = _ladder_MPa(model, at_strain)
    target = _positive(modulus_MPa)
    return np.asarray((target >= ladder[0]) & (target <= ladder[-1]))


def coordinate_for(model: CoefficientModel, modulus_MPa: ArrayLike, at_strain: float) -> FloatArray:
    """Return the coordinate whose secant modulus is wanted, clamped to the palette.

    The exact inverse of `CoefficientModel.modulus_MPa` within the range.

    Raises
    ------
    ArgumentError
        As `nearest`.
    """
    ladder, c = _ladder_MPa(model, at_strain), model.coordinates
    target = np.clip(_positive(modulus_MPa), ladder[0], ladder[-1])
    lower = np.searchsorted(ladder, target, side="right") - 1
    upper = np.minimum(lower + 1, len(c) - 1)
    step = np.where(upper > lower, np.log(ladder[upper] / ladder[lower]), 1.0)
    t = np.log(target / ladder[lower]) / step
    return np.minimum(c[lower] + t * (c[upper] - c[lower]), c[upper])


def blend_for(model: CoefficientModel, modulus_MPa: float, at_strain: float) -> Blend:
    """Return the blend whose secant modulus is wanted, clamped to the palette.

    Raises
    ------
    ArgumentError
        As `nearest`.
    """
    coordinate = float(coordinate_for(model, float(modulus_MPa), at_strain))
    lower, upper, t = model.bracket(coordinate)
    ids = [material.id for material in model.palette.materials]
    return Blend(ids[int(lower)], ids[int(upper if t > 0.0 else lower)], float(t), coordinate)


def _ladder_MPa(model: CoefficientModel, at_strain: float) -> FloatArray:
    if not 0.0 <= at_strain <= model.strain_limit:
        raise ArgumentError(
            f"strain {at_strain:g}: the working strain must be from 0 to {model.strain_limit:g}, "
            f"where the first elastic material of palette {model.palette.name} breaks"
        )
    return model.grade_moduli_MPa(at_strain)


def _positive(modulus_MPa: ArrayLike) -> FloatArray:
    modulus = np.asarray(modulus_MPa, dtype=np.float64)
    allowed = (modulus > 0.0) & (modulus < np.inf)
    if not allowed.all():
        raise ArgumentError(
            f"modulus {modulus[~allowed].flat[0]:g} MPa: it must be above 0 and finite"
        )
    return modulus
