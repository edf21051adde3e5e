"""Dealing by tiles: power at long wavelengths beside white noise.

python benchmarks/dither.py
"""

import numpy as np

from planner.grading.dither import blue_noise_ranks

TILE_CORNERS = np.array([[[0, 6], [5, 3]], [[4, 2], [1, 7]]])
FRACTIONS = (0.02, 0.1, 0.25, 1 / 3, 0.5, 0.7, 0.9)


def bayer_ranks(size=8):
    """Return the ordered ranks of a cube of size^3 cells, a power of two.

    At fractions of a multiple of 1/8 the pattern repeats within a few cells, the same way along
    all axes; between, it has strong periods of 8 cells.
    """
    ranks = np.zeros((1, 1, 1), dtype=np.int32)
    while ranks.shape[0] < size:
        blocks = [
            [[8 * ranks + c for c in row] for row in plane] for plane in TILE_CORNERS.tolist()
        ]
        ranks = np.block(blocks).astype(np.int32)
    return ranks


def low_power(hard):
    """Return mean power at wavelengths of 8 cells and more; white noise has 1."""
    n = hard.shape[0]
    share = hard.mean()
    power = np.abs(np.fft.fftn(hard - share)) ** 2 / hard.size / (share * (1.0 - share))
    waves = np.fft.fftfreq(n) * n
    length = np.sqrt(
        waves[:, None, None] ** 2 + waves[None, :, None] ** 2 + waves[None, None, :] ** 2
    )
    return float(power[(length > 0) & (length <= n / 8)].mean())


def main():
    rng = np.random.default_rng(0)
    bayer = np.tile(bayer_ranks(), (4, 4, 4))
    tiles = {"bayer 8": bayer, "blue noise 32": blue_noise_ranks()}
    print("fraction  white  " + "  ".join(tiles))
    for f in FRACTIONS:
        white = low_power((rng.random((32, 32, 32)) < f).astype(float))
        row = [low_power((ranks < f * (ranks.max() + 1)).astype(float)) for ranks in tiles.values()]
        print(f"{f:8.2f}  {white:5.2f}  " + "  ".join(f"{power:.4f}" for power in row))


if __name__ == "__main__":
    main()
