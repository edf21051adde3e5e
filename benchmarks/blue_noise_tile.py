"""Make the tile of thresholds that dithering deals by: python benchmarks/blue_noise_tile.py.

Void and cluster (Ulichney 1993) on a periodic cube of 32^3 cells. Each cell's rank says when it
turns hard as the fraction rises. Ranks go to planner/grading/blue-noise-32.npy; half a
minute on one core, the same bytes each time.
"""

from pathlib import Path

import numba
import numpy as np

SIZE, SIGMA, SEED = 32, 1.3, 1
TILE = Path(__file__).parents[1] / "planner/grading/blue-noise-32.npy"


@numba.njit(cache=True)
def add(energy, kernel, at, sign):
    n = energy.shape[0]
    x, y, z = at // (n * n), at // n % n, at % n
    for i in range(n):
        for j in range(n):
            for k in range(n):
                energy[i, j, k] += sign * kernel[(i - x) % n, (j - y) % n, (k - z) % n]


@numba.njit(cache=True)
def tightest(energy, ones):
    best, at = -np.inf, 0
    for c in range(ones.size):
        if ones[c] and energy.flat[c] > best:
            best, at = energy.flat[c], c
    return at


@numba.njit(cache=True)
def emptiest(energy, ones):
    best, at = np.inf, 0
    for c in range(ones.size):
        if not ones[c] and energy.flat[c] < best:
            best, at = energy.flat[c], c
    return at


def void_and_cluster(size, sigma, seed):
    """Rank the cells of a periodic cube."""
    # Powers of two times integers: sums of energies are exact, in whatever order.
    steps = np.minimum(np.arange(size), size - np.arange(size)).astype(float)
    square = (steps**2)[:, None, None] + (steps**2)[None, :, None] + (steps**2)[None, None, :]
    kernel = np.rint(np.exp(-square / (2 * sigma**2)) * 2.0**30)
    count = size**3
    ones = np.zeros(count, dtype=np.bool_)
    ones[np.random.default_rng(seed).permutation(count)[: count // 10]] = True
    energy = np.zeros((size, size, size))
    for at in np.flatnonzero(ones):
        add(energy, kernel, at, 1.0)
    while True:
        away = tightest(energy, ones)
        ones[away] = False
        add(energy, kernel, away, -1.0)
        to = emptiest(energy, ones)
        ones[to] = True
        add(energy, kernel, to, 1.0)
        if to == away:
            break
    ranks = np.empty(count, dtype=np.int64)
    start, begun = ones.copy(), energy.copy()
    for rank in range(int(ones.sum()) - 1, -1, -1):
        at = tightest(energy, ones)
        ones[at] = False
        add(energy, kernel, at, -1.0)
        ranks[at] = rank
    ones, energy = start, begun
    for rank in range(int(ones.sum()), count):
        at = emptiest(energy, ones)
        ones[at] = True
        add(energy, kernel, at, 1.0)
        ranks[at] = rank
    return ranks.reshape(size, size, size)


if __name__ == "__main__":
    np.save(TILE, void_and_cluster(SIZE, SIGMA, SEED).astype("<u2"))
    print(f"wrote {TILE}")
