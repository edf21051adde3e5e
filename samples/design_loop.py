"""Scan three profiles for one part and print the stiffness each reaches: a design loop.

python samples/design_loop.py [PART]

A slender part pulled along its gradient is a chain of springs: with the section A(u) and the
secant modulus E(u) its axial stiffness is k = 1 / integral of dx / (E A). The regions of a plan
hold what that takes: volume and extent along the axis give the mean section of each band.
"""

import sys
from pathlib import Path

import planner


def axial_stiffness_N_mm(plan: planner.Plan) -> float:
    """Return the stiffness of a plan's regions in series, in N/mm."""
    span_mm = plan.gradient.field["span_mm"]
    compliance = 0.0
    for region in plan.regions:
        length_mm = (region.field[1] - region.field[0]) * span_mm
        section_mm2 = region.volume_mm3 / length_mm
        compliance += length_mm / (region.modulus_MPa * section_mm2)
    return 1.0 / compliance


def main() -> None:
    """Plan the part with each profile, in memory, and print what comes out."""
    sample = Path(__file__).with_name("finger.stl")
    part = Path(sys.argv[1]) if len(sys.argv) > 1 else sample
    print(
        f"{'profile':10} {'materials':>9} {'soft end MPa':>13} {'hard end MPa':>13} {'k N/mm':>9}"
    )
    for profile in ("log", "linear", "smooth"):
        plan = planner.grade(part, from_="Tango", to="FLX9795", axis="x", profile=profile)
        moduli = [region.modulus_MPa for region in plan.regions]
        print(
            f"{profile:10} {len({r.material for r in plan.regions}):9d} {min(moduli):13.3f} "
            f"{max(moduli):13.2f} {axial_stiffness_N_mm(plan):9.3f}"
        )


if __name__ == "__main__":
    main()
