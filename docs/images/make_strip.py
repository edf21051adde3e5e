"""Make strip-to-s.png and strip-left.png: the tutorial's strip on its page, as Chromium draws it.

python docs/images/make_strip.py

Needs Chromium with its driver, and the packages of the extra `test`.
"""

import re
import tempfile
from pathlib import Path

from make_page import shot_of
from PIL import Image

import planner

HERE = Path(__file__).resolve().parent
FRONT = "document.querySelector('[data-view=front]').click();"


def main() -> None:
    """Run the tutorial's script, design the strip as it does, and keep what its page shows."""
    page = (HERE.parent / "tutorial" / "strip-to-s.md").read_text(encoding="utf-8")
    script = re.search(r"```python\n(.*?)```", page, re.DOTALL)
    assert script is not None
    with tempfile.TemporaryDirectory() as folder:
        exec(script[1].replace('export("', f'export("{folder}/'))
        made = planner.design(
            f"{folder}/strip.stl", from_="Tango", to="Vero", fix="x=min", load="x=max: 20,0,0 N",
            target=f"shape: {folder}/s.stl", free="8x1x3", cell_mm=4.0, tolerance=0.05, steps=4,
        )  # fmt: skip
    shown = planner.plan_page(made)
    for name, act in (
        ("strip-to-s", ""),
        ("strip-left", f"{FRONT} document.getElementById('course-left').click()"),
    ):
        # By coverage the colour scale keeps its ends, which few pixels have.
        picture = shot_of(shown, act).quantize(
            256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
        )
        picture.save(HERE / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
