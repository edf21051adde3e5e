"""Bounds on the modulus of a mixture of two phases, both incompressible.

Elastomers change their volume a thousand times less readily than their shape, and the laws that
planning uses are incompressible throughout: Poisson's ratio is 1/2, the bulk modulus infinite, and
E = 3 µ for the phases and for what they make. Hashin and Shtrikman's bounds on µ are then bounds
on E. `poisson_ratio` lets one see what a compressible pair would have.
"""

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray

__all__ = ["hashin_shtrikman_MPa", "reuss_MPa", "reuss_share", "voigt_MPa"]


def voigt_MPa(soft_MPa: ArrayLike, hard_MPa: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Return the arithmetic mean: phases side by side along the load, equal strain."""
    soft, hard = np.asarray(soft_MPa, dtype=np.float64), np.asarray(hard_MPa, dtype=np.float64)
    f = np.asarray(fraction, dtype=np.float64)
    return np.asarray((1.0 - f) * soft + f * hard)


def reuss_MPa(soft_MPa: ArrayLike, hard_MPa: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Return the harmonic mean: layers across the load, equal stress."""
    f = np.asarray(fraction, dtype=np.float64)
    return np.asarray(1.0 / ((1.0 - f) / np.asarray(soft_MPa) + f / np.asarray(hard_MPa)))


def reuss_share(soft_MPa: float, hard_MPa: float, compliance_per_MPa: ArrayLike) -> FloatArray:
    """Return the share of the harder layer at which layers have a mean compliance, 0 to 1.

    The inverse of `reuss_MPa`; compliances beyond those of the layers are clamped to them.
    """
    wanted = np.asarray(compliance_per_MPa, dtype=np.float64)
    share = (1.0 / soft_MPa - wanted) / (1.0 / soft_MPa - 1.0 / hard_MPa)
    return np.clip(share, 0.0, 1.0)


def hashin_shtrikman_MPa(
    soft_MPa: ArrayLike, hard_MPa: ArrayLike, fraction: ArrayLike, poisson_ratio: float = 0.5
) -> tuple[FloatArray, FloatArray]:
    """Return the bounds on the modulus of any isotropic mixture (Hashin and Shtrikman 1963).

    Parameters
    ----------
    soft_MPa, hard_MPa
        Young's moduli of the phases, the softer first.
    fraction
        Volume fraction of the harder one.
    poisson_ratio
        Of both phases, 0 to 1/2.
    """
    f = np.asarray(fraction, dtype=np.float64)
    soft, hard = np.asarray(soft_MPa, dtype=np.float64), np.asarray(hard_MPa, dtype=np.float64)
    if poisson_ratio == 0.5:
        low = _mixed(soft, hard, f, 0.4 / soft)
        high = _mixed(hard, soft, 1.0 - f, 0.4 / hard)
        return low, high
    shear = [e / (2.0 * (1.0 + poisson_ratio)) for e in (soft, hard)]
    bulk = [e / (3.0 * (1.0 - 2.0 * poisson_ratio)) for e in (soft, hard)]
    bounds = []
    for a, b, share in ((0, 1, f), (1, 0, 1.0 - f)):
        k, g = bulk[a], shear[a]
        of_shear = 6.0 * (k + 2.0 * g) / (5.0 * g * (3.0 * k + 4.0 * g))
        mixed_shear = _mixed(g, shear[b], share, of_shear)
        mixed_bulk = _mixed(k, bulk[b], share, 3.0 / (3.0 * k + 4.0 * g))
        bounds.append(9.0 * mixed_bulk * mixed_shear / (3.0 * mixed_bulk + mixed_shear))
    return bounds[0], bounds[1]


def _mixed(matrix: FloatArray, other: FloatArray, share: FloatArray, of: FloatArray) -> FloatArray:
    """Return matrix + share / (1 / (other - matrix) + (1 - share) of), without dividing by zero."""
    step = other - matrix
    return np.asarray(matrix + share * step / (1.0 + (1.0 - share) * of * step))
