"""Dealing voxels by tiles: time, and power at long wavelengths beside white noise.

python benchmarks/dither.py
"""

import time

import numpy as np

from planner.grading.dither import bayer_ranks, blue_noise_ranks, dither_voxels, thresholds

SIDE = 464  # 1e8 voxels
FRACTIONS = (0.02, 0.1, 0.25, 1 / 3, 0.5, 0.7, 0.9)


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
    fraction = rng.random((SIDE, SIDE, SIDE), dtype=np.float32)
    bayer = np.tile(bayer_ranks(), (4, 4, 4))
    tiles = {"bayer 8": bayer, "blue noise 32": blue_noise_ranks()}
    for name, ranks in tiles.items():
        limits = thresholds(ranks if name != "bayer 8" else bayer_ranks())
        dither_voxels(fraction[:32], limits)
        took = []
        for _ in range(3):
            start = time.perf_counter()
            dither_voxels(fraction, limits)
            took.append(time.perf_counter() - start)
        print(f"{name}: {fraction.size:.3g} voxels in {min(took):.2f} s")
    print("fraction  white  " + "  ".join(tiles))
    for f in FRACTIONS:
        white = low_power((rng.random((32, 32, 32)) < f).astype(float))
        row = [low_power((ranks < f * (ranks.max() + 1)).astype(float)) for ranks in tiles.values()]
        print(f"{f:8.2f}  {white:5.2f}  " + "  ".join(f"{power:.4f}" for power in row))


if __name__ == "__main__":
    main()
