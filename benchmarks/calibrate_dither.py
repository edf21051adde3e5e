"""Solve the dithered pattern itself, and write the constants that planner interpolates.

python -m benchmarks.calibrate_dither [--check]

Writes planner/grading/bevelled.json (what dealt fractions come to) and
planner/materials/dithered.json (where the modulus lies between Hashin and
Shtrikman's bounds). With --check it writes nothing, and solves the pattern at random fractions and
contrasts, on finer voxels, and in other directions, to find the error of that table. Minutes on two
cores.
"""

import argparse
import json
from itertools import permutations, product
from pathlib import Path

import numpy as np

from benchmarks.periodic_cell import effective_stiffness_MPa, solve_cell, youngs_modulus_MPa
from planner.grading.dither import blue_noise_ranks
from planner.materials.mixtures import TwoPhases

PLANNER = Path(__file__).parents[1] / "planner"
BEVELLED = PLANNER / "grading/bevelled.json"
DITHERED = PLANNER / "materials/dithered.json"
STEPS = 128
DEALT = (0.06, 0.14, 0.25, 0.37, 0.5, 0.63, 0.75, 0.86, 0.94)
CONTRASTS = (1.5, 2.5, 4.0, 10.0)
PER_CELL = 3  # voxels along an edge of a cell
ALONG_X = 0.005  # error of voxels and of interpolation, from --check
DIRECTIONS = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 1, 1), (1, -1, 1))
SAMPLES = 2  # of the pattern along an edge of a voxel
EXTENSION = (1.0, -0.5, -0.5, 0.0, 0.0, 0.0)

# Of a tetrahedron with 0 to 4 hard corners: hard volume, and triangles between.
_VOLUME = np.array([0.0, 0.125, 0.5, 0.875, 1.0])
_TRIANGLES = np.array([0, 1, 2, 1, 0])


def bevelled_fractions(hard: np.ndarray) -> tuple[float, float]:
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


def hard_share(hard, per_cell):
    """Return the hard share of every voxel of a periodic block of bevelled cells."""
    fine = per_cell * SAMPLES
    places = (np.arange(fine) + 0.5) / fine
    shape = tuple(n * per_cell for n in hard.shape)
    found = np.zeros(shape)
    corners = {c: np.roll(hard, [-x for x in c], (0, 1, 2)).astype(float) for c in CORNERS}
    for i, j, k in product(range(fine), repeat=3):
        point = (places[i], places[j], places[k])
        order = sorted(range(3), key=lambda axis: -point[axis])
        corner, value, at = [0, 0, 0], corners[0, 0, 0] * (1 - point[order[0]]), (*point, 0.0)
        for axis, after in zip(order, [*order[1:], 3], strict=True):
            corner[axis] = 1
            value = value + corners[tuple(corner)] * (at[axis] - at[after])
        inside = np.where(np.abs(value - 0.5) < 1e-12, 0.5, value > 0.5)
        x, y, z = i // SAMPLES, j // SAMPLES, k // SAMPLES
        found[x::per_cell, y::per_cell, z::per_cell] += inside
    return found / SAMPLES**3


CORNERS = list(product((0, 1), repeat=3))


def moduli(share, contrast):
    """Return shear moduli; in voxels that hold both, the middle of the bounds on a mixture."""
    low, high = TwoPhases(1.0, contrast).hashin_shtrikman_MPa(share)
    return np.sqrt(low * high) / 3.0


def extension_modulus(share, contrast):
    """Return E along x, the soft phase's being 1."""
    # In tension along x the stress is 3/2 of its part without pressure.
    return 1.5 * float(solve_cell(moduli(share, contrast), EXTENSION, 1e-4).stress_MPa[0])


def weight(modulus, contrast, fraction):
    """Return where a modulus lies between the bounds: 0 at the lower, 1 at the upper, in log."""
    low, high = TwoPhases(1.0, contrast).hashin_shtrikman_MPa(fraction)
    return float(np.log(modulus / low) / np.log(high / low))


def calibrate():
    ranks = blue_noise_ranks()
    dealt = np.linspace(0.0, 1.0, STEPS + 1)
    bevelled = [bevelled_fractions(ranks < f * ranks.size) for f in dealt.tolist()]
    BEVELLED.write_text(
        json.dumps(
            {
                "dealt": dealt.tolist(),
                "volume": [round(v, 9) for v, _ in bevelled],
                "triangles_per_cell": [round(t, 6) for _, t in bevelled],
            }
        )
        + "\n"
    )
    fractions, rows = [], []
    for f in DEALT:
        share = hard_share(ranks < f * ranks.size, PER_CELL)
        fractions.append(float(share.mean()))
        row = [weight(extension_modulus(share, c), c, fractions[-1]) for c in CONTRASTS]
        print(f"{f:.2f} {fractions[-1]:.4f}", " ".join(f"{w:.4f}" for w in row), flush=True)
        rows.append([round(w, 5) for w in row])
    DITHERED.write_text(
        json.dumps(
            {
                "volume": [round(v, 6) for v in fractions],
                "contrast": list(CONTRASTS),
                "weight": rows,
                "error": [round(directional(ranks, c) + ALONG_X, 3) for c in CONTRASTS],
            }
        )
        + "\n"
    )


def directional(ranks, contrast):
    """Return how far the modulus of a direction is off that along x, at half the cells."""
    share = hard_share(ranks < 0.5 * ranks.size, 2)
    stiffness = effective_stiffness_MPa(moduli(share, contrast), 1e-4)
    along_x = youngs_modulus_MPa(stiffness, (1, 0, 0))
    return max(abs(youngs_modulus_MPa(stiffness, n) / along_x - 1.0) for n in DIRECTIONS)


def check():
    ranks = blue_noise_ranks()
    rng = np.random.default_rng(5)
    print("dealt volume contrast  solved  table  error")
    for _ in range(12):
        f, c = rng.uniform(0.05, 0.95), np.exp(rng.uniform(np.log(1.4), np.log(10.0)))
        share = hard_share(ranks < f * ranks.size, PER_CELL)
        v, e = float(share.mean()), extension_modulus(share, c)
        table = float(TwoPhases(1.0, c).dithered_MPa(v))
        print(f"{f:.3f} {v:.4f} {c:6.2f} {e:8.4f} {table:8.4f} {100 * (table / e - 1):+.2f} %")
    print("voxels along a cell's edge: modulus, at half the cells, contrast 4")
    block = ranks < 0.5 * ranks.size
    for per_cell in (2, 3, 4):
        share = hard_share(block, per_cell)
        print(per_cell, f"{share.mean():.5f} {extension_modulus(share, 4.0):.5f}", flush=True)
    print("direction: modulus")
    for c in (2.5, 4.0):
        stiffness = effective_stiffness_MPa(moduli(hard_share(block, 2), c), 1e-4)
        for n in DIRECTIONS:
            print(c, n, f"{youngs_modulus_MPa(stiffness, n):.4f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    check() if parser.parse_args().check else calibrate()
