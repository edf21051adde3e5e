"""Compare the coefficient models: each interior grade predicted by the others, and the time.

python benchmarks/coefficients.py

Prints the normalised RMSE of the whole curve for the thesis' model and for the consistent one.
Exits 1 if the consistent one's is more than half the other's on average, in any reading.
"""

import sys
import time
from statistics import fmean

from planner.printers import load_printer
from printers.connex3.leave_one_out import held_out, literal_without
from printers.connex3.thesis import load_thesis

LIMIT_RATIO = 0.5


def main() -> None:
    thesis, palette = load_thesis(), load_printer("connex3").palette()
    start = time.perf_counter()
    literal_without(thesis, None)
    print(f"Algorithm 1 of all grades {time.perf_counter() - start:8.2f} s")
    start = time.perf_counter()
    rows = [held_out(thesis, palette, p) for p in thesis.elastomers[1:-1]]
    print(f"leave one grade out       {time.perf_counter() - start:8.2f} s")
    print("grade    crosshead: literal consistent   toe off: literal consistent")
    for row in rows:
        print(
            f"{row.id}  {row.literal:17.4f} {row.consistent_crosshead:10.4f}"
            f"   {row.literal_toe_off:16.4f} {row.consistent:10.4f}"
        )
    own, crosshead, toe_off = (
        fmean(r.consistent for r in rows) / fmean(r.literal for r in rows),
        fmean(r.consistent_crosshead for r in rows) / fmean(r.literal for r in rows),
        fmean(r.consistent for r in rows) / fmean(r.literal_toe_off for r in rows),
    )
    print(f"ratio of the means: crosshead {crosshead:.3f}, toe off {toe_off:.3f}, own {own:.3f}")
    print(f"limit {LIMIT_RATIO:g}")
    sys.exit(0 if max(own, crosshead, toe_off) <= LIMIT_RATIO else 1)


if __name__ == "__main__":
    main()
