"""Tiles of thresholds: a cell turns hard where the fraction exceeds its own."""

from functools import cache
from importlib.resources import files

import numpy as np

from planner.arrays import FloatArray, IntArray

__all__ = ["bayer_ranks", "blue_noise_ranks", "thresholds"]

_CORNERS = np.array([[[0, 6], [5, 3]], [[4, 2], [1, 7]]])


@cache
def blue_noise_ranks() -> IntArray:
    """Return the ranks of a periodic cube of 32^3 cells, each of 0 to 32767 once.

    By void and cluster (Ulichney 1993): at every fraction the hard cells lie evenly but without a
    pattern. Power at wavelengths above 8 cells is about 1 % of white noise's.
    `benchmarks/blue_noise_tile.py` makes it.
    """
    with (files("planner.geometry.dither") / "blue-noise-32.npy").open("rb") as file:
        ranks: IntArray = np.load(file).astype(np.int32)
    ranks.setflags(write=False)
    return ranks


def bayer_ranks(size: int = 8) -> IntArray:
    """Return the ordered ranks of a cube of size^3 cells, a power of two.

    At fractions of a multiple of 1/8 the pattern repeats within a few cells, the same way along
    all axes; between, it has strong periods of 8 cells.
    """
    ranks = np.zeros((1, 1, 1), dtype=np.int32)
    while ranks.shape[0] < size:
        blocks = [[[8 * ranks + c for c in row] for row in plane] for plane in _CORNERS.tolist()]
        ranks = np.block(blocks).astype(np.int32)
    return ranks


def thresholds(ranks: IntArray) -> FloatArray:
    """Return the fraction above which each cell is hard, evenly over 0 to 1, neither included."""
    return np.asarray((ranks + 0.5) / ranks.size)
