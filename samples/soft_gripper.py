"""Design a soft gripper for how it grasps: its tips shall give, its jaws hold firmly lower down.

python samples/soft_gripper.py [CELL_MM]

Two loads push the jaws apart as an object does, at the tips and half-way up, and each has its own
stiffness. One gradient along the jaws is found that has both.
"""

import sys
from pathlib import Path

import planner


def grasp(where: str, force_N: float, stiffness_N_mm: float) -> planner.LoadCase:
    """Return the case of an object between the jaws: it pushes both apart.

    The jaws are alike, so that a target for one serves both.
    """
    right, left = f"x>0 and {where}", f"x<0 and {where}"
    return planner.LoadCase(
        fix=("z=min",),
        load=(f"{right}: {force_N},0,0 N", f"{left}: {-force_N},0,0 N"),
        target=(f"{right} stiffness={stiffness_N_mm} N/mm",),
        name=where,
    )


def main() -> None:
    """Design it, print what was reached, and write the plan."""
    made = planner.design(
        Path(__file__).with_name("gripper.stl"),
        from_="Vero",
        to="Tango",
        axis="z",
        cases=(grasp("z>95", 0.2, 0.05), grasp("z>55 and z<65", 1.0, 0.5)),
        blend="dither",
        cell_mm=float(sys.argv[1]) if len(sys.argv) > 1 else 5.0,
    )
    for reached in made.reached:
        low, high = reached.interval
        print(
            f"{reached.target:40} moves {reached.printed:.3g} mm, wanted {reached.wanted:.3g}, "
            f"95 % of prints {low:.3g} to {high:.3g}"
        )
    for finding in made.findings:
        print(finding.message)
    print(f"wrote {made.write('gripper-designed', force=True)}")


if __name__ == "__main__":
    main()
