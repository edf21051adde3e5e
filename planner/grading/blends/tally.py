"""Where dealt cells are: how much of each material lies in each stretch of the gradient."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.columns import MOST_VOXELS, Grid, dense, iterate_columns
from planner.geometry.dither.own_volume import own_volumes
from planner.geometry.level_sets.split_curved import FIRST_SHIFT
from planner.geometry.mesh import Mesh
from planner.grading.blends.dither import DealtField

__all__ = ["Tally", "tally"]

_PARTS = 3  # of a cell's edge, to tell how much of it is inside
_CHUNK = 1 << 18


@dataclass(frozen=True, slots=True, eq=False)
class Tally:
    """What lies in each of S stretches, by piece of P.

    Attributes
    ----------
    volume_mm3 : (S, P)
        From the cells, corners bevelled, each as far as it is inside the part.
    bounds_mm : (S, P, 2, 3)
        Of the cells' centres, and a cell more; inside out where there is none.
    cells, wanted : (S,)
        Number of cells, and the mean volume fraction of the harder material that they should have.
    """

    volume_mm3: FloatArray
    bounds_mm: FloatArray
    cells: FloatArray
    wanted: FloatArray


def tally(mesh: Mesh, dealt: DealtField) -> Tally:
    """Count the cells of a part."""
    cell_mm = dealt.cell_mm
    first = mesh.bounds_mm[0] - (1.5 + FIRST_SHIFT) * cell_mm
    shape = tuple(np.ceil((mesh.bounds_mm[1] - first) / cell_mm).astype(int).tolist())
    inside = _inside(mesh, first, cell_mm, shape)
    used = np.flatnonzero(inside)
    stretch, piece = np.empty((2, len(used)), dtype=np.int64)
    fraction = np.empty(len(used))
    centre = np.empty((len(used), 3))
    for begin in range(0, len(used), _CHUNK):
        own = slice(begin, begin + _CHUNK)
        index = np.stack(np.unravel_index(used[own], shape), axis=1)
        centre[own] = first + (index + 0.5) * cell_mm
        stretch[own], fraction[own], piece[own] = dealt.deal(centre[own])
    label = np.full(shape, -1, dtype=np.int16)
    label.reshape(-1)[used] = piece
    share = inside.reshape(-1)[used] / _PARTS**3
    volume = share * own_volumes(label).reshape(-1)[used] * cell_mm**3
    stretches, pieces = len(dealt.along), len(dealt.pieces)
    key = stretch * pieces + piece
    bounds = np.empty((stretches * pieces, 2, 3))
    bounds[:, 0], bounds[:, 1] = np.inf, -np.inf
    np.minimum.at(bounds[:, 0], key, centre - cell_mm)
    np.maximum.at(bounds[:, 1], key, centre + cell_mm)
    cells = np.asarray(np.bincount(stretch, weights=share, minlength=stretches), np.float64)
    wanted = np.bincount(stretch, weights=share * fraction, minlength=stretches)
    volumes = np.bincount(key, weights=volume, minlength=stretches * pieces)
    return Tally(
        np.asarray(volumes, np.float64).reshape(stretches, pieces),
        bounds.reshape(stretches, pieces, 2, 3),
        cells,
        np.divide(wanted, cells, out=np.full(stretches, np.nan), where=cells > 0.0),
    )


def _inside(mesh: Mesh, first: FloatArray, cell_mm: float, shape: tuple[int, ...]) -> FloatArray:
    """Return how many of a cell's parts are inside, all of them being `_PARTS` cubed."""
    parts = _PARTS if _PARTS * max(shape) < MOST_VOXELS else 1
    x, y, z = first.tolist()
    nx, ny, nz = (n * parts for n in shape)
    fine_mm = cell_mm / parts
    grid = Grid((x, y, z), (fine_mm, fine_mm, fine_mm), (nx, ny, nz))
    count = np.zeros(shape)
    for columns in iterate_columns(mesh, grid):
        index = np.argwhere(dense(columns))
        index[:, 1] += columns.first_row
        key, several = np.unique(
            np.ravel_multi_index(tuple((index // parts).T), shape), return_counts=True
        )
        count.reshape(-1)[key] += several * (_PARTS // parts) ** 3
    return count
