"""Make whole-part.png: the designed finger under its load, as its page shows it in Chromium.

python docs/images/make_whole_part.py

Needs Chromium with its driver, and the packages of the extra `test`.
"""

from pathlib import Path

from make_page import shot_of
from PIL import Image

import planner

HERE = Path(__file__).resolve().parent
HELD = {"fix": "x=max", "load": "x=min: 0,0,-0.5 N"}


def main() -> None:
    """Design the finger as the tutorial does, load it, and keep what its page shows."""
    made = planner.design(
        HERE.parents[1] / "samples" / "finger.stl", from_="Tango", to="Vero", axis="x",
        target="x=min uz=-12 mm", limit="strain/break<0.5", **HELD,
    )  # fmt: skip
    bent = planner.simulate(made.plan, **HELD)
    show_outline = "document.getElementById('ghost').click()"
    # By coverage the colour scale keeps its light end, which few pixels have.
    picture = shot_of(planner.part_page(bent), show_outline).quantize(
        256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
    )
    picture.save(HERE / "whole-part.png", optimize=True)


if __name__ == "__main__":
    main()
