"""Time simulated bars: 1,000 slices over 100 load steps, alone and with all that goes with it.

python benchmarks/simulate.py

Prints the best of five for each, and how far the force is from that of 64 times as many slices.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from planner.printers import load_printer
from planner.simulation.bar import Bar
from planner.simulation.bar_solver import PulledBars, law_tables, predict, unaltered
from planner.simulation.simulate import simulate

LIMIT_S = 0.1
SLICES, STEPS, TO_STRAIN = 1000, 100, 0.3


def best_s(function: Callable[[], object]) -> float:
    times = []
    for _ in range(5):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def graded(slices: int) -> Bar:
    """TangoPlus to FLX9795 over 60 mm, with a waisted section."""
    edges = np.linspace(0.0, 60.0, slices + 1)
    x = 0.5 * (edges[1:] + edges[:-1])
    return Bar(edges, x / 60.0, 24.0 + 6.0 * np.cos(x / 10.0))


def main() -> None:
    palette = load_printer("connex3").palette()
    bar = graded(SLICES)
    laws = law_tables(palette)
    path = np.linspace(0.0, TO_STRAIN * bar.gauge_mm, STEPS + 1)
    all_slices = np.array([0, SLICES])
    bars = PulledBars(
        first_slice=all_slices,
        time_s=np.zeros((1, STEPS + 1)),
        travel_mm=path[None, :],
        length_mm=bar.length_mm,
        area_mm2=bar.area_mm2,
        coordinate=bar.coordinate,
        **unaltered(all_slices, STEPS + 1),
    )

    tables_s = best_s(lambda: law_tables(palette))
    solve_s = best_s(lambda: predict(bars, laws))
    whole_s = best_s(lambda: simulate(bar, to_strain=TO_STRAIN, steps=STEPS))
    coupon_s = best_s(lambda: simulate("FLX9760", to_strain=TO_STRAIN, steps=STEPS))
    force = predict(bars, laws).force_N[0, -1]
    fine = simulate(graded(64 * SLICES), to_strain=TO_STRAIN, steps=1).force_N[-1]
    print(f"tables of the laws   {1e3 * tables_s:7.1f} ms")
    print(
        f"equilibrium          {1e3 * solve_s:7.1f} ms for {SLICES} slices x {STEPS} steps "
        f"(limit {1e3 * LIMIT_S:g} ms)"
    )
    print(f"simulate, this bar   {1e3 * whole_s:7.1f} ms, with interval and findings")
    print(f"simulate, a coupon   {1e3 * coupon_s:7.1f} ms")
    print(f"error of the force   {abs(force / fine - 1.0):7.1e}")
    sys.exit(0 if solve_s <= LIMIT_S else 1)


if __name__ == "__main__":
    main()
