"""Dealing at the scale of single voxels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.errors import ArgumentError
from planner.geometry.kernel import kernel

__all__ = ["deal_cells", "deal_voxels"]


def deal_voxels(fraction: Float32Array, thresholds: FloatArray) -> NDArray[np.uint8]:
    """Tell which voxels of a block are hard.

    Parameters
    ----------
    fraction : (nx, ny, nz) float32
        Of the harder material, wanted at each voxel.
    thresholds : (n, n, n)
        See `planner.geometry.dither.tile.thresholds`; repeated over the block from its corner.

    Returns
    -------
    (nx, ny, nz) uint8
        1 where the fraction exceeds the threshold.

    Raises
    ------
    ArgumentError
        The tile's sides are not one power of two.
    """
    n = thresholds.shape[0]
    if thresholds.shape != (n, n, n) or n & (n - 1):
        raise ArgumentError(f"a tile of {thresholds.shape}: its sides must be one power of two")
    found = np.empty(fraction.shape, dtype=np.uint8)
    _deal(np.asarray(fraction, np.float32), np.asarray(thresholds, np.float32), found)
    return found


def deal_cells(
    fraction: FloatArray, cell: NDArray[np.int64], thresholds: FloatArray
) -> NDArray[np.bool_]:
    """Tell which of some cells are hard.

    Parameters
    ----------
    fraction : (n,)
        Wanted at each.
    cell : (n, 3) int64
        Its place in the lattice of cells.
    """
    i, j, k = (cell % thresholds.shape[0]).T
    return np.asarray(fraction > thresholds[i, j, k])


@kernel
def _deal(fraction: Any, thresholds: Any, found: Any) -> None:
    nx, ny, nz = fraction.shape
    n = thresholds.shape[0]
    for i in range(nx):
        for j in range(ny):
            row = thresholds[i & (n - 1), j & (n - 1)]
            wanted, dealt = fraction[i, j], found[i, j]
            for first in range(0, nz, n):
                for k in range(min(n, nz - first)):
                    dealt[first + k] = wanted[first + k] > row[k]
