"""Modulus of cells of two materials dealt by the blue-noise tile, and back.

Between Hashin and Shtrikman's bounds E- and E+ the modulus is E-^(1-w) E+^w, with w from a table
that `benchmarks/calibrate_dither.py` solves on the very pattern, corners bevelled, by
`planner.materials.homogenisation.periodic_cell`. Phases are taken as linear, each with its secant
modulus at the working strain; strains within a cell of two elastomers differ, so at finite strain
this is an approximation.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray
from planner.materials.homogenisation.bounds import hashin_shtrikman_MPa

__all__ = ["DitherTable", "dither_table", "dithered_fraction", "dithered_modulus_MPa"]

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
    path = files("planner.materials.homogenisation") / "dithered.json"
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
    found = np.where(wanted <= np.log(soft_MPa), 0.0, found)
    return np.asarray(np.where(wanted >= np.log(hard_MPa), 1.0, found))
