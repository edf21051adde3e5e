"""Time the inverse on the Connex3 palette: a million wanted moduli at working strain 0.1.

python benchmarks/inverse.py [TARGETS]

Prints the best of five for each step and the largest relative error of forward(inverse(E)).
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from planner.materials.mixtures import CoefficientModel, nearest_on
from planner.printers import load_printer

LIMIT_S = 1.0
LIMIT_ERROR = 1e-9
AT_STRAIN = 0.1


def best_s(function: Callable[[], object]) -> float:
    times = []
    for _ in range(5):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def main(targets: int) -> None:
    palette = load_printer("connex3").palette()
    model = CoefficientModel(palette)
    ladder = model.grade_moduli_MPa(AT_STRAIN)
    share = np.random.default_rng(1).uniform(size=targets)
    wanted = np.clip(ladder[0] * (ladder[-1] / ladder[0]) ** share, ladder[0], ladder[-1])
    coordinate = model.coordinate_for(wanted, AT_STRAIN)
    inverse_s = best_s(lambda: model.coordinate_for(wanted, AT_STRAIN))
    error = float(np.abs(model.modulus_MPa(coordinate, AT_STRAIN) / wanted - 1.0).max())
    print(f"model    {best_s(lambda: CoefficientModel(palette)) * 1e3:8.2f} ms")
    print(f"inverse  {inverse_s * 1e3:8.2f} ms for {targets} targets (limit {LIMIT_S:g} s)")
    print(f"forward  {best_s(lambda: model.modulus_MPa(coordinate, AT_STRAIN)) * 1e3:8.2f} ms")
    print(
        f"nearest  {best_s(lambda: nearest_on(model.ladder_MPa(AT_STRAIN), wanted)) * 1e3:8.2f} ms"
    )
    print(f"error    {error:8.1e} (limit {LIMIT_ERROR:g})")
    sys.exit(0 if inverse_s <= LIMIT_S and error <= LIMIT_ERROR else 1)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
