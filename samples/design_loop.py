"""Design the sample finger for three travels of its tip, and print what its print would do.

python samples/design_loop.py [CELL_MM]
"""

import sys
from pathlib import Path

import planner

for wanted_mm in (8, 12, 16):
    made = planner.design(
        Path(__file__).with_name("finger.stl"), from_="Tango", to="Vero", axis="x", fix="x=max",
        load="x=min: 0,0,-0.5 N", target=f"x=min uz={-wanted_mm} mm",
        cell_mm=float(sys.argv[1]) if len(sys.argv) > 1 else 3.0,
    )  # fmt: skip
    (tip,) = made.reached
    soft, stiff = made.moduli_MPa[0], made.moduli_MPa[-1]
    print(
        f"{wanted_mm} mm: {-tip.printed:.2f} mm, {soft:.3g} to {stiff:.3g} MPa, {made.tried} tried"
    )
