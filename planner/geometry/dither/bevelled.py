"""What cells come to once their corners are bevelled.

Shells of dealt cells are level sets on the lattice of the cells' centres, in the six tetrahedra
between eight of them. So two materials meet half-way between centres, cells that touch along an
edge or at a corner are joined or parted by one rule everywhere, and no edge ever has four faces.
But a cell alone among others keeps half of its volume. Which fraction of the volume a dealt
fraction comes to is counted here, exactly, on the very tile.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import permutations

import msgspec
import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray

__all__ = ["BevelledTile", "bevelled_fractions", "blue_noise_bevelled"]

# Of a tetrahedron with 0 to 4 hard corners: hard volume, and triangles between.
_VOLUME = np.array([0.0, 0.125, 0.5, 0.875, 1.0])
_TRIANGLES = np.array([0, 1, 2, 1, 0])


@dataclass(frozen=True, slots=True, eq=False)
class BevelledTile:
    """How a tile's cells come out, from all soft to all hard.

    Attributes
    ----------
    dealt : (n,)
        Fractions of cells, 0 to 1.
    volume : (n,)
        Fraction of the volume that is hard; rises strictly from 0 to 1.
    triangles_per_cell : (n,)
        Of the surface between both.
    """

    dealt: FloatArray
    volume: FloatArray
    triangles_per_cell: FloatArray

    def dealt_for(self, volume: FloatArray) -> FloatArray:
        """Return the fraction of cells to deal for a volume fraction."""
        return np.asarray(np.interp(volume, self.volume, self.dealt))


def bevelled_fractions(hard: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the volume fraction of a periodic block of cells, and the triangles a cell.

    Parameters
    ----------
    hard : (nx, ny, nz) bool
        Which cells are hard.
    """
    volume, triangles = 0.0, 0.0
    for order in permutations(range(3)):
        corner, count = hard, hard.astype(np.int8)
        for axis in order:
            corner = np.roll(corner, -1, axis)
            count = count + corner
        of = np.bincount(count.ravel(), minlength=5)
        volume += float(_VOLUME @ of) / 6.0
        triangles += float(_TRIANGLES @ of)
    return volume / hard.size, triangles / hard.size


@cache
def blue_noise_bevelled() -> BevelledTile:
    """Return the table of the tile that cells are dealt by.

    Of 129 fractions; between them the volume is off by 2e-4 at most. `bevelled_fractions` of the
    tile gives the same; `benchmarks/calibrate_dither.py` keeps it.
    """
    data = (files("planner.geometry.dither") / "bevelled.json").read_bytes()
    columns = msgspec.json.decode(data, type=dict[str, list[float]])
    return BevelledTile(**{name: np.array(values) for name, values in columns.items()})
