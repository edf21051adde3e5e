"""The modulus of two phases: bounds, and cells of a dither."""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from planner.numerics import FloatArray

__all__ = [
    "dither_table",
    "dithered_fraction",
    "dithered_modulus_MPa",
    "hashin_shtrikman_MPa",
    "reuss_MPa",
    "reuss_share",
    "voigt_MPa",
]


# ------------------------------------------------------------------------------------------------
# Bounds on the modulus of a mixture of two phases, both incompressible.
#
# Elastomers change their volume a thousand times less readily than their shape, and the laws that
# planning uses are incompressible throughout: Poisson's ratio is 1/2, the bulk modulus infinite,
# and E = 3 µ for the phases and for what they make. Hashin and Shtrikman's bounds on µ are then
# bounds on E.


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
    soft_MPa: ArrayLike, hard_MPa: ArrayLike, fraction: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the bounds on the modulus of any isotropic mixture (Hashin and Shtrikman 1963).

    Parameters
    ----------
    soft_MPa, hard_MPa
        Young's moduli of the phases, the softer first.
    fraction
        Volume fraction of the harder one.
    """
    f = np.asarray(fraction, dtype=np.float64)
    soft, hard = np.asarray(soft_MPa, dtype=np.float64), np.asarray(hard_MPa, dtype=np.float64)
    return _mixed(soft, hard, f, 0.4 / soft), _mixed(hard, soft, 1.0 - f, 0.4 / hard)


def _mixed(matrix: FloatArray, other: FloatArray, share: FloatArray, of: FloatArray) -> FloatArray:
    """Return matrix + share / (1 / (other - matrix) + (1 - share) of), without dividing by zero."""
    step = other - matrix
    return np.asarray(matrix + share * step / (1.0 + (1.0 - share) * of * step))


# ------------------------------------------------------------------------------------------------
# Modulus of cells of two materials dealt by the blue-noise tile, and back.
#
# Between Hashin and Shtrikman's bounds E- and E+ the modulus is E-^(1-w) E+^w, with w from a table
# that `benchmarks/calibrate_dither.py` solves on the very pattern, corners bevelled, by
# `planner.materials.homogenisation`. Phases are taken as linear, each with its secant
# modulus at the working strain; strains within a cell of two elastomers differ, so at finite strain
# this is an approximation.


_NODES = 513


@dataclass(frozen=True, slots=True)
class DitherTable:
    """Where the modulus lies between the bounds.

    Attributes
    ----------
    volume
        Volume fractions of the harder phase, rising.
    contrast
        Harder modulus over softer one, rising.
    place
        w at each volume and contrast.
    error
        Largest relative error of a modulus, of any direction, at each contrast. Most of it is that
        cells are bevelled along one diagonal of their cubes, in which the pattern is stiffest.
    """

    volume: tuple[float, ...]
    contrast: tuple[float, ...]
    place: tuple[tuple[float, ...], ...]
    error: tuple[float, ...]

    def error_at(self, contrast: float) -> float:
        """Return the largest relative error at a contrast; beyond the largest it is not known."""
        return float(np.interp(np.log(contrast), np.log(self.contrast), self.error))


@cache
def dither_table() -> DitherTable:
    """Return the table that planner brings."""
    path = files("planner.materials") / "dithered.json"
    return msgspec.json.decode(path.read_bytes(), type=DitherTable)


def dithered_modulus_MPa(soft_MPa: float, hard_MPa: float, volume: ArrayLike) -> FloatArray:
    """Return the modulus of a dithered mixture.

    Parameters
    ----------
    soft_MPa, hard_MPa
        Moduli of the phases, the softer first. Beyond the table's largest contrast its last
        column is used, and the bounds alone are sure.
    volume
        Volume fraction of the harder phase, 0 to 1.
    """
    v = np.asarray(volume, dtype=np.float64)
    low, high = hashin_shtrikman_MPa(soft_MPa, hard_MPa, v)
    table = dither_table()
    contrasts = np.log(table.contrast)
    contrast = np.clip(np.log(hard_MPa / soft_MPa), contrasts[0], contrasts[-1])
    column = [float(np.interp(contrast, contrasts, row)) for row in table.place]
    w = np.interp(v, table.volume, column)
    return np.asarray(low ** (1.0 - w) * high**w)


def dithered_fraction(soft_MPa: float, hard_MPa: float, modulus_MPa: ArrayLike) -> FloatArray:
    """Return the volume fraction of the harder phase that gives a modulus.

    The inverse of `dithered_modulus_MPa` within 1e-6: it rises with the modulus, from exactly 0 at
    the softer phase's to exactly 1 at the harder one's, and stays there beyond.
    """
    volume = np.linspace(0.0, 1.0, _NODES)
    ladder = np.log(dithered_modulus_MPa(soft_MPa, hard_MPa, volume))
    wanted = np.log(np.asarray(modulus_MPa, dtype=np.float64))
    found = np.interp(wanted, ladder, volume)
    slope = np.interp(found, volume, np.gradient(ladder, volume))  # and a step of Newton's
    off = np.log(dithered_modulus_MPa(soft_MPa, hard_MPa, found)) - wanted
    found = np.clip(found - off / slope, 0.0, 1.0)
    found = np.where(wanted <= np.log(soft_MPa), 0.0, found)
    return np.asarray(np.where(wanted >= np.log(hard_MPa), 1.0, found))
